//! The program as users run it, in a separate folder.
#![allow(dead_code)]

pub use crate::PROGRAM;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// A separate folder with a config.
pub struct Desk {
    folder: tempfile::TempDir,
    pub config: Value,
}

/// A small star, including its local line.
pub fn star() -> Value {
    json!({
        "rotation_period_d": 3.0, "inclination_deg": 50.0, "vsini_kms": 20.0, "contrast": 0.1,
        "line": { "sigma_kms": 2.5, "equivalent_width_kms": 5.8 }
    })
}

/// A config of that star with two spots and a planet, K and phi free, that takes a second or two; `sampler` as given.
pub fn two_spots(sampler: Value) -> Value {
    json!({
        "star": star(),
        "planet": { "k_kms": 0.2, "porb_over_prot": 1.7, "phi": 0.0 },
        "observations": { "simulate": {
            "spots": [[30, 40, 25, 0.8], [200, 10, 15, 0.9]],
            "cycles": [0.0, 0.13, 0.29, 0.41, 0.58, 0.72, 0.87, 1.04, 1.21, 1.35, 1.52, 1.66],
            "velocity_kms": { "min": -27.0, "max": 27.0, "step": 3.0 },
            "snr": 1000, "seed": 7, "pixels": 2000
        } },
        "imaging": { "pixels": 200, "chi2_target": 1.05, "unresolved_spots": "entropy", "objective": "spottedness" },
        "parameters": {
            "k_kms": { "prior": "uniform", "min": 0.0, "max": 1.0 },
            "phi": { "prior": "periodic" }
        },
        "sampler": sampler
    })
}

/// The same star in more noise, for chains of two ensembles of six walkers and this many steps.
pub fn tiny(steps: usize) -> Value {
    let mut config = two_spots(json!({ "ensembles": 2, "walkers": 6, "steps": steps, "seed": 3, "ess": 1e6 }));
    config["planet"]["phi"] = json!(0.5);
    config["observations"]["simulate"]["snr"] = json!(500);
    config["observations"]["simulate"]["pixels"] = json!(1000);
    config
}

/// Copies a folder and all that is in it.
pub fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let name = to.join(path.file_name().unwrap());
        match path.is_dir() {
            true => copy(&path, &name),
            false => drop(std::fs::copy(&path, name).unwrap()),
        }
    }
}

/// Folder of its cached fits to profiles, for the next test.
pub const CACHE: &str = concat!(env!("CARGO_TARGET_TMPDIR"), "/fitted");

/// The program, ready for arguments.
pub fn program() -> Command {
    let mut command = Command::new(PROGRAM);
    command.env("DIMCMC_CACHE", CACHE);
    command
}

/// Runs it; where the number of threads is given, it fits everything itself.
pub fn dimcmc(args: &[&str], folder: &Path) -> Output {
    let mut command = program();
    if args.contains(&"--threads") {
        command.env("DIMCMC_CACHE", "off");
    }
    command.args(args).current_dir(folder).output().unwrap()
}

/// No line is longer than 120 characters, but for tables with a last column beyond 80 and names of files.
fn lines_fit(args: &[&str], stdout: &[u8]) {
    // these are for other programs
    if ["completions", "schema", "man"].contains(&args[0]) {
        return;
    }
    let last_column = |line: &str| line.rfind("  ").map_or(0, |at| line[..at].chars().count() + 2);
    let is_long = |line: &&str| line.chars().count() > 120 && last_column(line) <= 80;
    let is_path = |line: &&str| line.starts_with("written: ") || line.split(' ').any(|word| word.len() > 60);
    let printed = std::str::from_utf8(stdout).unwrap();
    let long: Vec<&str> = printed.lines().filter(|line| is_long(line) && !is_path(line)).collect();
    assert!(long.is_empty(), "{args:?}: {long:#?}");
}

/// What the program prints, its long lines whole again: those that the first word of the next one would have made
/// longer than 120 characters.
pub fn text(bytes: &[u8]) -> String {
    let printed = String::from_utf8(bytes.to_vec()).unwrap();
    let mut lines: Vec<String> = Vec::new();
    let (mut before, mut hanging) = (0, 0);
    for line in printed.split('\n') {
        let length = line.chars().count();
        let indent = line.chars().take_while(|c| *c == ' ').count();
        let word = line.split_whitespace().next().map_or(0, |word| word.chars().count());
        match lines.last_mut() {
            Some(last) if indent == hanging && word > 0 && before <= 120 && before + 1 + word > 120 => {
                last.push(' ');
                last.push_str(line.trim_start());
            }
            _ => {
                let column = line.rfind("  ").map_or(0, |at| line[..at].chars().count() + 2);
                hanging = if column > indent { column } else { indent + 2 };
                lines.push(line.to_owned());
            }
        }
        before = length;
    }
    lines.join("\n")
}

impl Desk {
    pub fn new(config: Value) -> Self {
        let desk = Desk { folder: tempfile::tempdir().unwrap(), config };
        desk.write("config.json", &desk.config.to_string());
        desk
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    pub fn json(&self, name: &str) -> Value {
        serde_json::from_str(&self.read(name)).unwrap()
    }

    pub fn edit(&self, name: &str, change: impl Fn(String) -> String) {
        let (before, after) = (self.read(name), change(self.read(name)));
        assert_ne!(before, after, "{name} was not changed");
        self.write(name, &after);
    }

    /// Sets a value of the config, or removes it by null.
    pub fn set(&self, pointer: &str, value: Value) {
        let mut config = self.config.clone();
        let (parent, key) = pointer.rsplit_once('/').unwrap();
        let parent = config.pointer_mut(parent).unwrap().as_object_mut().unwrap();
        parent.insert(key.into(), value);
        self.write("config.json", &config.to_string());
    }

    pub fn succeed(&self, args: &[&str]) -> String {
        let output = dimcmc(args, self.folder.path());
        let (stdout, stderr) = (text(&output.stdout), text(&output.stderr));
        assert_eq!(output.status.code(), Some(0), "{args:?}: {stderr}");
        assert_eq!(stderr, "", "silent when stderr is no terminal");
        lines_fit(args, &output.stdout);
        stdout
    }

    /// Starts the program and does not wait for it.
    pub fn start(&self, args: &[&str]) -> Child {
        let mut command = program();
        command.args(args).current_dir(self.path("")).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
    }

    /// Lines in a file so far; 0 if it is not there.
    pub fn lines(&self, name: &str) -> usize {
        std::fs::read(self.path(name)).map_or(0, |text| text.iter().filter(|b| **b == b'\n').count())
    }

    /// Waits until a file has so many lines or the program has ended.
    pub fn wait_for_lines(&self, name: &str, child: &mut Child, least: usize) {
        let began = Instant::now();
        while self.lines(name) < least && child.try_wait().unwrap().is_none() {
            assert!(began.elapsed() < Duration::from_secs(300), "{name} does not come to {least} lines");
            std::thread::sleep(Duration::from_micros(200));
        }
    }

    /// Everything in the folder, with its content.
    pub fn inventory(&self) -> Vec<(PathBuf, Vec<u8>)> {
        let mut found = Vec::new();
        let mut folders = vec![self.folder.path().to_path_buf()];
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(&folder).unwrap() {
                let path = entry.unwrap().path();
                match path.is_dir() {
                    true => {
                        found.push((path.clone(), Vec::new()));
                        folders.push(path);
                    }
                    false => found.push((path.clone(), std::fs::read(&path).unwrap())),
                }
            }
        }
        found.sort();
        found
    }

    /// The message of a command that must be refused and leave nothing.
    pub fn refusal(&self, args: &[&str]) -> String {
        let before = self.inventory();
        let output = dimcmc(args, self.folder.path());
        let (stdout, stderr) = (text(&output.stdout), text(&output.stderr));
        assert_eq!(output.status.code(), Some(2), "{stdout}{stderr}");
        assert_eq!(stdout, "");
        assert!(self.inventory() == before, "something was written: {stderr}");
        let message = stderr.strip_prefix("error: ").unwrap_or_else(|| panic!("{stderr}"));
        assert_eq!(message.matches('\n').count(), 1, "more than one line: {message}");
        message.trim_end().to_string()
    }
}

/// Ends a program like a power cut.
pub fn kill(mut child: Child) {
    child.kill().unwrap();
    child.wait().unwrap();
}

/// Ends a program as Ctrl-C does; its message.
#[cfg(unix)]
pub fn interrupt(child: Child) -> String {
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    text(&output.stderr)
}

/// Whether every part occurs in the message.
pub fn says(message: &str, parts: &[&str]) {
    println!("{message}");
    for part in parts {
        assert!(message.contains(part), "{part:?} is missing in: {message}");
    }
}

/// `text` with line `number` (from 1) replaced.
pub fn with_line(text: &str, number: usize, line: &str) -> String {
    let mut lines: Vec<&str> = text.lines().collect();
    lines[number - 1] = line;
    lines.join("\n") + "\n"
}
