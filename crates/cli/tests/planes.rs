//! Cutting planes through the program: images, progress, what is refused.

mod common;

use common::{Workshop, head};

/// A generated image as a PNG file.
fn write_plate(shop: &Workshop, name: &str, [width, height]: [u32; 2]) {
    let plate = volery_data::zone_plate([width as usize, height as usize]);
    let samples = plate.samples();
    let pixel = |i: usize| [0, 1, 2].map(|c| (samples.value(i, c) / 255.0) as f32);
    let pixels: Vec<_> = (0..plate.num_samples()).map(pixel).collect();
    volery::io::write_png(&shop.path(name), width, height, &pixels).expect("an image is written");
}

#[test]
fn an_image_needs_no_plane_and_no_technique() {
    let shop = Workshop::new();
    write_plate(&shop, "plate.png", [200, 150]);
    let line = "render plate.png --size 160x120 --backend software";
    let outcome = shop.done(&format!("{line} -o a.png --verify --report a.json"));
    assert!(outcome.stdout.starts_with("a.png: 160x120, plane, "), "{}", outcome.stdout);
    let report = shop.json("a.json");
    assert_eq!(
        (report["input"]["kind"].as_str(), report["technique"].as_str()),
        (Some("image"), Some("plane"))
    );
    assert_eq!(report["error"]["bound_max"], 0.0);
    let found = report["error"]["measured_max"].as_f64().unwrap();
    println!("measured {found:.2e}, at most 2e-5");
    assert!(found <= 2e-5, "{found}");
    // ceil(199 / 30) * ceil(149 / 30)
    assert_eq!(report["work"]["nodes_by_level"], serde_json::json!([35]));

    let outcome =
        shop.done(&format!("{line} -o b.png --technique plane --focus 30,20 --quality 0.5 --report b.json"));
    assert!(outcome.stdout.contains("bound: no colour differs by more than 0."), "{}", outcome.stdout);
    let report = shop.json("b.json");
    assert_eq!(report["dial"]["quality"], 0.5);
    let by_level = report["work"]["nodes_by_level"].as_array().unwrap();
    assert!(by_level.len() > 1 && by_level[0].as_u64() > Some(0), "{by_level:?}");
    assert!(shop.bytes("a.png") != shop.bytes("b.png"));
}

#[test]
fn progress_ends_with_the_picture_itself() {
    let shop = Workshop::new();
    shop.write_volume("head.nrrd", &head());
    let planes = "--plane 0.3,0.5,0.81,150 --plane 1,0,0,88.75";
    for dial in ["", "--focus 90,20,110 --quality 0.7", "--error 0.2"] {
        let line =
            format!("render head.nrrd --technique plane {planes} --size 100x90 --backend software {dial}");
        let folder = format!("steps{}", dial.len());
        let outcome = shop.done(&format!("{line} -o whole.png --report whole.json --progressive {folder}"));
        let names: Vec<_> = (0..100).map(|i| format!("{folder}/{i:02}.png")).collect();
        let num_steps = names.iter().take_while(|name| shop.path(name).exists()).count();
        assert!((3..=10).contains(&num_steps), "{dial}: {num_steps} pictures");
        assert!(shop.bytes(&names[num_steps - 1]) == shop.bytes("whole.png"), "{dial}: the last picture");
        assert!(shop.bytes(&names[0]) != shop.bytes("whole.png"), "{dial}: the first picture");
        assert_eq!(
            outcome.stdout.lines().filter(|line| line.contains("no colour off by more than")).count(),
            num_steps
        );
        let report = |name: &str| shop.json(&name.replace(".png", ".json"));
        let sent: u64 = names[..num_steps]
            .iter()
            .map(|name| report(name)["work"]["bytes_uploaded"].as_u64().unwrap())
            .sum();
        let bound = |name: &str| report(name)["error"]["bound_max"].as_f64().unwrap();
        assert!(sent > 0 && bound(&names[0]) > bound("whole.png"), "{dial}");
        assert_eq!(bound(&names[num_steps - 1]), bound("whole.png"), "{dial}");
        assert_eq!(shop.json("whole.json")["work"]["bytes_uploaded"], 0, "{dial}: it is all there by then");
    }
}

#[test]
fn what_is_seen_changes_with_every_option() {
    let shop = Workshop::new();
    let line = "render waves.nrrd --technique plane --size 90x80 --backend software";
    let options = [
        "",
        "--plane 0,0,1,10",
        "--plane 0,0,1,10 --plane 1,1,0,30",
        "--plane 0,0,1,10 --nearest",
        "--plane 0,0,1,10 --show-nodes",
        "--plane 0,0,1,10 --transfer viridis",
        "--plane 0,0,1,10 --transfer viridis --transparent",
        "--plane 0,0,1,10 --focus 1,1,10 --quality 0.1",
        "--plane 0,0,1,10 --view 30,30",
    ];
    let mut pictures: Vec<Vec<u8>> = Vec::new();
    for option in options {
        shop.done(&format!("{line} -o a.png {option}"));
        let picture = shop.bytes("a.png");
        let same = pictures.iter().position(|other| *other == picture);
        assert_eq!(same.map(|place| options[place]), None, "{option} shows the same");
        pictures.push(picture);
    }
}

#[test]
fn fans_say_how_they_found_lengths() {
    let shop = Workshop::new();
    let line = "render waves.nrrd --size 40x30 --backend software --technique fans --view 30,20,3";
    shop.done(&format!("{line} -o a.exr --report a.json"));
    shop.done(&format!("{line} -o b.exr --report b.json --thickness interpolated"));
    assert_eq!(shop.json("a.json")["thickness"], "exact");
    assert_eq!(shop.json("b.json")["thickness"], "interpolated");
    assert!(shop.json("a.json")["work"]["triangles"].as_u64() > Some(0));
    assert!(shop.bytes("a.exr") != shop.bytes("b.exr"), "in perspective the two differ");
}

#[test]
fn matter_is_coarse_first() {
    let shop = Workshop::new();
    for technique in ["raycast", "fans"] {
        let line =
            format!("render waves.nrrd -o a.png --size 60x50 --backend software --technique {technique}");
        shop.done(&format!("{line} --tolerance 0.1 --progressive {technique}"));
        let tolerance = |name: &str| shop.json(name)["dial"]["tolerance"].as_f64().unwrap();
        let steps = [0, 1, 2, 3].map(|i| tolerance(&format!("{technique}/0{i}.json")));
        assert!(steps.windows(2).all(|pair| pair[0] > pair[1]) && steps[3] == 0.1, "{technique}: {steps:?}");
        assert!(shop.bytes(&format!("{technique}/03.png")) == shop.bytes("a.png"), "{technique}");
        assert!(shop.bytes(&format!("{technique}/00.png")) != shop.bytes("a.png"), "{technique}");
    }
}

#[test]
fn what_is_no_plane_is_refused() {
    let shop = Workshop::new();
    let run = |extra: &str| {
        shop.run_line(&format!("render waves.nrrd -o a.png --size 30x30 --backend software {extra}"))
    };
    for (extra, word) in [
        ("--technique plane --plane 0,0,0,1", "normal"),
        ("--technique plane --plane 0,0,1", "NX,NY,NZ,D"),
        ("--technique plane --plane nan,0,1,2", "--plane"),
        ("--technique plane --focus 1", "X,Y"),
        ("--technique plane --focus 1,2,3 --quality -1", "at least 0"),
        ("--technique plane --error 1.5", "from 0 to 1"),
    ] {
        let outcome = run(extra);
        assert_eq!(outcome.code, Some(2), "{extra}: {}", outcome.stderr);
        assert!(outcome.stderr.contains(word), "{extra}: {}", outcome.stderr);
    }
    let many = "--plane 1,2,3,4 ".repeat(17);
    run(&format!("--technique plane {many}")).fails(1, &["17 planes", "1 to 16"]);
    assert!(!shop.names().contains(&"a.png".to_owned()), "no half file: {:?}", shop.names());
}
