//! Ended at any moment, the program leaves whole files or none, and its inputs as they were.
#![cfg(unix)]
#![allow(clippy::disallowed_methods, reason = "that a signal comes at any moment is what is tested")]

mod common;

use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use common::{Workshop, legacy_grid};

/// Moments at which each run is ended.
const MOMENTS: u32 = 50;

fn start(shop: &Workshop, line: &str) -> Child {
    Command::new(env!("CARGO_BIN_EXE_volery"))
        .args(line.split_whitespace())
        .current_dir(shop.path(""))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("a folder and a program")
}

fn end(child: &mut Child, signal: &str) {
    let status = Command::new("kill").args([signal, &child.id().to_string()]).stderr(Stdio::null()).status();
    // It may have ended by itself.
    status.expect("a folder and a program");
    child.wait().expect("a folder and a program");
}

/// Whether bytes are a whole file of what their name says.
fn is_whole(shop: &Workshop, name: &str) -> bool {
    let bytes = shop.bytes(name);
    match name.rsplit('.').next().expect("a folder and a program") {
        "png" => volery::io::read_png_rgb(&shop.path(name)).is_ok(),
        "json" => serde_json::from_slice::<serde_json::Value>(&bytes).is_ok() && bytes.ends_with(b"}\n"),
        "vsl" | "glb" => volery::io::read_stack(&shop.path(name), 1 << 30).is_ok(),
        // Written without losses and without times: the same bytes each time.
        _ => bytes == shop.bytes(&format!("reference-{name}")),
    }
}

/// Ends a run at moments spread over the time that it takes, with each signal in turn.
fn check(line: &str, outputs: &[&str]) {
    let shop = Workshop::new();
    shop.write("ring.vtk", legacy_grid(1.0, usize::MAX));
    let start_time = Instant::now();
    shop.done(line);
    let whole_run = start_time.elapsed();
    for name in outputs.iter().filter(|name| name.ends_with(".exr")) {
        std::fs::copy(shop.path(name), shop.path(format!("reference-{name}")))
            .expect("a folder and a program");
    }
    let inputs = ["waves.nrrd", "ring.vtk"].map(|name| (name, shop.bytes(name)));
    let known = shop.names();
    let mut num_ended_early = 0;
    // A generator of moments that are spread evenly whatever their number (the golden ratio).
    let moments = (1..=MOMENTS).map(|i| whole_run.mul_f64((f64::from(i) * 0.618_033_988_749_895).fract()));
    for (number, moment) in moments.enumerate() {
        // Half of the runs replace a file, half make one.
        if number % 2 == 0 {
            outputs.iter().for_each(|name| {
                let _ = std::fs::remove_file(shop.path(name));
            });
        }
        let mut child = start(&shop, line);
        std::thread::sleep(moment.min(Duration::from_secs(20)));
        num_ended_early += u32::from(child.try_wait().expect("a folder and a program").is_none());
        end(&mut child, ["-KILL", "-TERM", "-INT"][number % 3]);
        for name in shop.names() {
            assert!(known.contains(&name), "{line}: {name} was left after {moment:?}");
        }
        for name in outputs.iter().filter(|name| shop.path(name).exists()) {
            assert!(is_whole(&shop, name), "{line}: a part of {name} was left after {moment:?}");
        }
        for (name, bytes) in &inputs {
            assert!(shop.bytes(name) == *bytes, "{line}: {name} changed");
        }
    }
    println!("{line}: {num_ended_early} of {MOMENTS} ended early, {whole_run:?} a run");
    assert!(num_ended_early >= MOMENTS / 4, "{line}: only {num_ended_early} runs were ended early");
}

#[test]
fn pictures_reports_maps_and_scenes() {
    let line = "render waves.nrrd --size 90x90 --backend software -o a.png --error-map e.png --report r.json \
                --save-scene s.json";
    check(line, &["a.png", "e.png", "r.json", "s.json"]);
}

#[test]
fn pictures_in_floats() {
    check("render waves.nrrd --size 400x400 --backend software -o a.exr", &["a.exr"]);
}

#[test]
fn slices() {
    check("slice ring.vtk --count 300 -o a.vsl", &["a.vsl"]);
    check("slice ring.vtk --count 300 -o a.glb", &["a.glb"]);
}

#[test]
fn pictures_on_the_way() {
    let shop = Workshop::new();
    let line = "render waves.nrrd --size 200x200 --backend software -o a.png --progressive steps";
    let start_time = Instant::now();
    shop.done(line);
    let whole_run = start_time.elapsed();
    let folder = |shop: &Workshop| {
        let entries = std::fs::read_dir(shop.path("steps")).expect("a folder and a program");
        let names = entries.map(|entry| {
            entry.expect("a folder and a program").file_name().into_string().expect("a folder and a program")
        });
        let mut names: Vec<_> = names.map(|name| format!("steps/{name}")).collect();
        names.sort();
        names
    };
    let known = folder(&shop);
    for number in 0..MOMENTS {
        let mut child = start(&shop, line);
        std::thread::sleep(whole_run.mul_f64((f64::from(number) * 0.618_033_988_749_895).fract()));
        end(&mut child, ["-KILL", "-TERM", "-INT"][number as usize % 3]);
        for name in folder(&shop) {
            assert!(known.contains(&name) && is_whole(&shop, &name), "{name} was left");
        }
    }
}

/// Whether this process does not ignore a signal; SIGTERM nobody does.
fn is_heard(number: u32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    number == 15 || ignored >> (number - 1) & 1 == 0
}

#[test]
fn an_interrupt_ends_the_program_as_the_signal_says() {
    use std::os::unix::process::ExitStatusExt;
    let shop = Workshop::new();
    // What started the tests may ignore a signal, as a shell does for what runs behind it; so does the program then.
    let signals =
        [("-INT", 2), ("-TERM", 15), ("-HUP", 1)].into_iter().filter(|(_, number)| is_heard(*number));
    for (name, number) in signals {
        let mut child =
            start(&shop, "render waves.nrrd --size 2000x2000 --backend software --verify -o a.png");
        std::thread::sleep(Duration::from_millis(300));
        assert!(child.try_wait().expect("a folder and a program").is_none(), "it takes longer than that");
        let sent = Command::new("kill")
            .args([name, &child.id().to_string()])
            .status()
            .expect("a folder and a program");
        assert!(sent.success());
        assert_eq!(child.wait().expect("a folder and a program").signal(), Some(number as i32));
    }
    // What was told to ignore a signal goes on.
    let script = format!(
        "trap '' HUP; {} render waves.nrrd --size 300x300 --backend software --verify -o b.png & \
         sleep 0.3; kill -HUP $!; wait $!",
        env!("CARGO_BIN_EXE_volery")
    );
    let status =
        Command::new("sh").args(["-c", &script]).current_dir(shop.path("")).stdout(Stdio::null()).status();
    assert!(status.expect("a folder and a program").success());
    assert!(is_whole(&shop, "b.png"));
}
