//! A separate Python for tests that open results with other programs: a virtual environment under `target/python`, made
//! once.
#![allow(dead_code)]

use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// What is installed, in whatever version there is today: users have no other.
const PACKAGES: &str = include_str!("packages.txt");

/// The interpreter, or `None` with a message where it is unavailable. In continuous integration (`CI` is set) it is
/// required.
pub fn python() -> Option<PathBuf> {
    let found = environment();
    if let Err(problem) = &found {
        assert!(std::env::var_os("CI").is_none(), "no Python to test with: {problem}");
        // past the test's capture, so that it is seen
        let _ = writeln!(std::io::stderr(), "skipped: no Python to test with: {problem}");
    }
    found.ok()
}

/// Makes the environment, or takes the one that is there if it has all packages.
fn environment() -> Result<PathBuf, String> {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().ok_or("no target folder")?;
    let (folder, wanted) = (target.join("python"), PACKAGES.split_whitespace().collect::<Vec<_>>());
    let python = folder.join("bin/python");
    // one process makes it, others wait
    let lock = File::create(target.join("python.lock")).map_err(|e| e.to_string())?;
    lock.lock().map_err(|e| e.to_string())?;
    let complete = folder.join("packages");
    if std::fs::read_to_string(&complete).is_ok_and(|there| there == PACKAGES) {
        return Ok(python);
    }
    let _ = std::fs::remove_dir_all(&folder);
    run(Command::new("python3").args(["-m", "venv"]).arg(&folder))?;
    let options = ["-m", "pip", "install", "--quiet", "--no-input", "--disable-pip-version-check"];
    run(Command::new(&python).args(options).args(["--retries", "2", "--timeout", "20"]).args(wanted))?;
    std::fs::write(&complete, PACKAGES).map_err(|e| e.to_string())?;
    Ok(python)
}

fn run(command: &mut Command) -> Result<Output, String> {
    let output = command.output().map_err(|e| format!("{command:?}: {e}"))?;
    match output.status.success() {
        true => Ok(output),
        false => Err(format!("{command:?}: {}", String::from_utf8_lossy(&output.stderr).trim_end())),
    }
}
