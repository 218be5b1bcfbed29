//! Wrong command lines, made from the grammar that `--help` shows: each is refused in one line that says what would be
//! right, and none is passed over.

mod common;

use std::collections::BTreeSet;

use common::{Workshop, legacy_grid};

const COMMANDS: [&str; 4] = ["render", "info", "slice", "demo"];

/// An option as the help shows it.
#[derive(Clone, Debug)]
struct Opt {
    name: String,
    /// What its value is called; `None` for one that has no value.
    value: Option<String>,
    /// The heading that it stands under.
    heading: String,
}

/// The options of a subcommand, out of its help.
fn options(shop: &Workshop, command: &str) -> Vec<Opt> {
    let help = shop.done(&format!("{command} --help")).stdout;
    let mut heading = String::new();
    let mut options = Vec::new();
    for line in help.lines() {
        if !line.starts_with(' ') && line.ends_with(':') {
            heading = line.trim_end_matches(':').to_owned();
        }
        if let Some((_, alias)) = line.split_once("[aliases: ") {
            let option: &Opt = options.last().expect("an alias of an option");
            let name = alias.split(']').next().expect("the name of an alias").to_owned();
            options.push(Opt { name, ..option.clone() });
        }
        let Some(start) = line.find("--").filter(|&start| start <= 6) else { continue };
        let mut words = line[start..].split_whitespace();
        let name = words.next().expect("an option with a name").to_owned();
        let value = words.next().filter(|word| word.starts_with('<'));
        let value = value.map(|word| word.trim_matches(['<', '>']).to_owned());
        if name != "--help" && name != "--version" {
            options.push(Opt { name, value, heading: heading.clone() });
        }
    }
    assert!(options.iter().any(|option| option.name == "--threads"), "{help}");
    options
}

/// What a subcommand needs to be right.
fn right(command: &str) -> &'static str {
    match command {
        "render" => "render waves.nrrd -o new.png",
        "info" => "info waves.nrrd",
        "slice" => "slice ring.vtk -o new.vsl",
        _ => "demo -o new",
    }
}

/// Values that an option of this grammar cannot have.
fn wrong_values(value: &str) -> Vec<&'static str> {
    let is_numbers = value.contains(',') && !value.contains("FILE") || value == "WxH";
    if is_numbers || ["N", "T", "E", "Q", "SHARE"].contains(&value) {
        return vec!["many", "nan", "1,2,3,4,5,6,7", "-1e999", ",", "1;2;3"];
    }
    match value {
        "TECHNIQUE" | "THICKNESS" | "BACKEND" | "TYPE" => vec!["best", "AUTOO", "1"],
        "OUT.png|OUT.exr" | "OUT.png" => vec!["a.jpg", "a", ".png.txt"],
        "OUT.glb|OUT.vsl" => vec!["a.stl", "a"],
        "FILE.json|PRESET" => vec!["virids", "a.lut", "CT-BONE"],
        _ => Vec::new(),
    }
}

/// Words of a line that says what would be right.
const HELPFUL: [&str; 11] = [
    "expected",
    "possible values",
    "similar",
    "required",
    "is read by",
    "is not read by",
    "cannot be used multiple times",
    "unexpected value",
    "unexpected argument",
    "alone",
    "a value is required",
];

#[test]
fn wrong_usages_are_refused_in_one_line_that_helps() {
    let shop = Workshop::new();
    shop.write("ring.vtk", legacy_grid(1.0, usize::MAX));
    let grammar: Vec<(&str, Vec<Opt>)> =
        COMMANDS.iter().map(|&command| (command, options(&shop, command))).collect();
    let all: BTreeSet<&str> =
        grammar.iter().flat_map(|(_, options)| options).map(|option| option.name.as_str()).collect();
    let mut lines: Vec<(String, String)> = Vec::new();
    for (command, options) in &grammar {
        let right = right(command);
        let own: BTreeSet<&str> = options.iter().map(|option| option.name.as_str()).collect();
        for Opt { name, value, heading } in options {
            let mut add = |rest: String| lines.push((format!("{right} {rest}"), name.clone()));
            // A slip of the pen.
            add(format!("{}x", name));
            match value {
                None => add(format!("{name}=yes")),
                Some(value) => {
                    add(name.clone());
                    wrong_values(value).iter().for_each(|wrong| add(format!("{name}={wrong}")));
                }
            }
            // An option of one technique beside the others.
            let technique = heading.strip_prefix("Technique ");
            let others =
                ["raycast", "fans", "plane", "stack"].into_iter().filter(|other| Some(*other) != technique);
            let value = match value.as_deref() {
                None => "",
                Some("NX,NY,NZ,D") => "=0,0,1,2",
                Some("X,Y[,Z]") => "=1,2,3",
                Some("FILE.pvd|FILE,FILE,...") => "=ring.vtk",
                // It needs --focus, which is tried itself.
                Some("Q") => continue,
                Some("E" | "SHARE") => "=0.5",
                Some(_) => "=4",
            };
            for other in others.filter(|_| technique.is_some()) {
                add(format!("{name}{value} --technique {other}"));
            }
        }
        // What other subcommands know.
        for name in all.difference(&own) {
            lines.push((format!("{right} {name}"), (*name).to_owned()));
        }
    }
    for near in ["rendr", "inof", "slcie", "dmeo"] {
        lines.push((format!("{near} waves.nrrd -o new.png"), near.to_owned()));
    }
    println!("{} wrong command lines", lines.len());
    assert!(lines.len() >= 200, "{}", lines.len());
    let before = shop.names();
    for (line, name) in &lines {
        let outcome = shop.run_line(line);
        assert!(matches!(outcome.code, Some(1 | 2)), "volery {line} was passed over: {}", outcome.stdout);
        outcome.fails(outcome.code.expect("an option with a name"), &[name.trim_start_matches('-')]);
        let said = &outcome.stderr;
        assert!(HELPFUL.iter().any(|word| said.contains(word)), "volery {line}: {said}");
        assert!(said.len() < 500, "volery {line}: {said}");
        assert_eq!(shop.names(), before, "volery {line}");
    }
}

#[test]
fn what_was_meant_is_offered() {
    let shop = Workshop::new();
    shop.write("ring.vtk", legacy_grid(1.0, usize::MAX));
    shop.write("s.json", r#"{"input": {"file": "waves.nrrd"}, "transfer_function": "virids"}"#);
    for (line, meant) in [
        ("rende waves.nrrd -o a.png", "'render'"),
        ("render waves.nrrd -o a.png --tolerence 0.1", "'--tolerance'"),
        ("render waves.nrrd -o a.png --transfer infreno", "did you mean inferno?"),
        ("render waves.nrrd -o a.png --technique raycats", "'raycast'"),
        ("render ring.vtk -o a.png --array haet", "did you mean heat?"),
        ("render s.json -o a.png", "did you mean viridis?"),
    ] {
        let outcome = shop.run_line(line);
        outcome.fails(outcome.code.expect("an option with a name"), &[meant]);
    }
}

/// Options that a file has nothing for: the option is refused, and the line names the file and the option.
#[test]
fn what_a_file_cannot_answer_is_refused() {
    let shop = Workshop::new();
    shop.write("ring.vtk", legacy_grid(1.0, usize::MAX));
    shop.write("v_5x4x3_uint8.raw", [7; 60]);
    shop.done("slice ring.vtk -o ring.vsl --count 8");
    volery::io::write_png(&shop.path("image.png"), 5, 4, &[[0.5, 0.2, 0.1]; 20])
        .expect("an option with a name");
    shop.write("t.json", common::scene_json("x")["transfer_function"].to_string());
    shop.write("step.json", r#"{"input": {"file": "ring.vtk", "time_step": 0}}"#);
    for (file, option) in [
        // B5: --array on files without arrays.
        ("v_5x4x3_uint8.raw", "--array nosuch"),
        ("waves.nrrd", "--array nosuch"),
        ("image.png", "--array nosuch"),
        ("ring.vsl", "--array heat"),
        ("ring.vtk", "--array nosuch"),
        ("ring.vtk", "--dims 4,4,4"),
        ("ring.vtk", "--dtype uint8"),
        ("ring.vtk", "--spacing 1,1,1"),
        ("ring.vsl", "--spacing 1,1,1"),
        ("waves.nrrd", "--dims 4,4,4"),
        ("waves.nrrd", "--dtype float32"),
        ("v_5x4x3_uint8.raw", "--dims 4,4,4"),
        // Raw files and stacks know one of each; others are asked for one that they have not.
        ("v_5x4x3_uint8.raw", "--channel 0"),
        ("v_5x4x3_uint8.raw", "--component 1"),
        ("v_5x4x3_uint8.raw", "--time-step 0"),
        ("v_5x4x3_uint8.raw", "--volume 1"),
        ("ring.vsl", "--channel 0"),
        ("ring.vsl", "--time-step 0"),
        ("waves.nrrd", "--channel 1"),
        ("waves.nrrd", "--time-step 1"),
        ("image.png", "--channel 3"),
        ("image.png", "--time-step 1"),
        ("ring.vtk", "--channel 1"),
        ("ring.vtk", "--time-step 1"),
    ] {
        for command in ["render -o new.png --size 8x8", "info"] {
            let (command, rest) = command.split_once(' ').unwrap_or((command, ""));
            let outcome = shop.run_line(&format!("{command} {file} {rest} {option}"));
            outcome.fails(1, &[file]);
        }
    }
    for (line, words) in [
        ("waves.nrrd --data .", &["--data", "waves.nrrd"][..]),
        ("waves.nrrd --range 1,2 --transfer ct-bone", &["--range", "ct-bone"]),
        ("waves.nrrd --range 1,2 --transfer t.json", &["--range", "t.json"]),
        ("image.png --transfer viridis", &["image.png", "--transfer"]),
        ("image.png --range 1,2", &["image.png", "--range"]),
        ("image.png --transparent", &["image.png", "--transparent"]),
        ("waves.nrrd --color-map x --transfer viridis", &["--color-map", "viridis"]),
        ("ring.vtk --focus 1,2,3", &["ring.vtk", "--focus"]),
        ("ring.vtk --nearest", &["ring.vtk", "--nearest"]),
        ("waves.nrrd --shade", &["waves.nrrd", "--shade"]),
        ("waves.nrrd --channel 0 --component 0", &["--channel", "cannot be used multiple times"]),
        ("ring.vtk --time-steps ring.vtk --volume 0", &["--time-step", "--time-steps", "cannot be used"]),
    ] {
        let outcome = shop.run_line(&format!("render {line} -o new.png --size 8x8"));
        outcome.fails(outcome.code.expect("an option with a name"), words);
    }
    let outcome = shop.run_line("render step.json --time-steps ring.vtk -o new-%d.png --size 8x8");
    outcome.fails(1, &["step.json", "time_step", "--time-steps"]);
    assert!(!shop.names().iter().any(|name| name.starts_with("new")));
}

#[test]
fn an_option_that_changes_the_technique_says_so() {
    let shop = Workshop::new();
    for option in ["--focus 1,2,3", "--nearest", "--plane 0,0,1,9", "--transparent", "--show-nodes"] {
        let said = shop.done(&format!("render waves.nrrd -o a.png --size 9x9 {option}")).stdout;
        let name = option.split(' ').next().expect("an option with a name");
        assert!(
            said.contains(&format!("note: drawn by --technique plane, which alone reads {name}")),
            "{said}"
        );
    }
    assert!(!shop.done("render waves.nrrd -o a.png --size 9x9").stdout.contains("note:"));
    // Rays obey it too.
    let said = shop.done("render waves.nrrd -o a.png --size 9x9 --error 0.1").stdout;
    assert!(said.contains("raycast") && said.contains("bound: ") && !said.contains("drawn by"), "{said}");
}
