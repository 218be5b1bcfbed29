//! System packages, through `apt-get` where there is one.

use std::process::{Command, Stdio};

use crate::shell;

/// Installs Debian packages and says so.
///
/// # Errors
/// When this is no Debian, or neither root nor `sudo` without a password: one line with what to install.
pub(crate) fn install(packages: &[&str]) -> Result<(), String> {
    let by_hand = format!("install it by hand (Debian, Ubuntu: apt-get install {})", packages.join(" "));
    if !answers(Command::new("apt-get").arg("--version")) {
        return Err(format!("there is no apt-get here; {by_hand}"));
    }
    let is_root = shell::read(Command::new("id").arg("-u")).is_ok_and(|id| id.trim() == "0");
    if !is_root && !answers(Command::new("sudo").args(["-n", "true"])) {
        return Err(format!("neither root nor sudo without a password; {by_hand}"));
    }
    println!("installing through apt-get: {}", packages.join(" "));
    let apt = |arguments: &[&str]| {
        let mut command = Command::new(if is_root { "apt-get" } else { "sudo" });
        if !is_root {
            command.args(["-n", "apt-get"]);
        }
        command.args(arguments).env("DEBIAN_FRONTEND", "noninteractive").stdout(Stdio::null());
        shell::run(&mut command)
    };
    let install = [["install", "--yes", "--no-install-recommends"].as_slice(), packages].concat();
    apt(&["update"]).and_then(|()| apt(&install)).map_err(|error| format!("{error}; {by_hand}"))
}

/// Whether a program can be started and ends well.
fn answers(command: &mut Command) -> bool {
    let command = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command.status().is_ok_and(|status| status.success())
}
