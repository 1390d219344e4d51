//! Faults by users and systems: closed streams, signals at any time, full disks, missing permissions, absurd numbers,
//! `--force` into the wrong place, edited results, control characters in names.

use crate::desk::{Desk, PROGRAM, dimcmc, program, says, text, tiny};
use serde_json::{Value, json};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

fn long() -> Value {
    let mut config = tiny(100_000);
    config["grid"] = json!({ "axes": { "k_kms": [0.0, 0.4, 300], "phi": [0.3, 0.7, 300] } });
    config
}

pub(crate) fn send(signal: &str, child: &Child) {
    assert!(Command::new("kill").args([&format!("-{signal}"), &child.id().to_string()]).status().unwrap().success());
}

/// The exit code; a program that does not end within a minute is killed and has none.
fn code(mut child: Child) -> Option<i32> {
    let began = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if began.elapsed() > Duration::from_secs(60) {
            child.kill().unwrap();
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    child.wait().unwrap().code()
}

/// A stream that accepts nothing (a full disk), and a pipe without a reader.
#[cfg(target_os = "linux")]
fn broken() -> [Stdio; 2] {
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    [full.into(), writer.into()]
}

/// Waits until the program waits for signals: Linux says which it catches.
#[cfg(target_os = "linux")]
pub(crate) fn catches_signals(child: &mut Child) {
    let began = Instant::now();
    let catches = |status: String| {
        let line = status.lines().find_map(|line| line.strip_prefix("SigCgt:").map(str::to_owned));
        // SIGTERM is number 15
        line.is_some_and(|mask| u64::from_str_radix(mask.trim(), 16).unwrap() >> 14 & 1 == 1)
    };
    let status = format!("/proc/{}/status", child.id());
    while !std::fs::read_to_string(&status).is_ok_and(catches) {
        assert!(
            child.try_wait().unwrap().is_none() && began.elapsed() < Duration::from_secs(60),
            "ends or never listens"
        );
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
#[cfg(target_os = "linux")]
fn a_stream_that_is_gone_stops_no_signal() {
    let desk = Desk::new(long());
    for (k, stderr) in broken().into_iter().enumerate() {
        // before the first step: a slow image keeps the search at work
        desk.set("/imaging", json!({ "pixels": 50_000, "chi2_target": 1.05, "objective": "spottedness" }));
        let run = |name: &str, stderr: Stdio| {
            let args = ["sample", "config.json", "--out", name];
            program().args(args).current_dir(desk.path("")).stderr(stderr).stdout(Stdio::null()).spawn().unwrap()
        };
        let mut child = run("early", stderr);
        catches_signals(&mut child);
        send("TERM", &child);
        assert_eq!(code(child), Some(75), "stream {k}, before the first step");
        assert!(!desk.path("early").exists());
    }
    desk.write("config.json", &long().to_string());
    for (k, stderr) in broken().into_iter().enumerate() {
        let name = format!("late{k}");
        let mut command = program();
        command.args(["sample", "config.json", "--out", &name]).current_dir(desk.path(""));
        let mut child = command.stderr(stderr).stdout(Stdio::null()).spawn().unwrap();
        desk.wait_for_lines(&format!("{name}/chain.jsonl"), &mut child, 24);
        send("TERM", &child);
        assert_eq!(code(child), Some(75), "stream {k}, after the first step");
    }
    // an error has its exit code, whatever the streams
    for stderr in broken() {
        let mut command = program();
        let child =
            command.args(["map", "absent.json", "--out", "x"]).current_dir(desk.path("")).stderr(stderr).spawn();
        assert_eq!(code(child.unwrap()), Some(2));
    }
}

#[test]
#[cfg(target_os = "linux")]
fn results_that_cannot_be_printed_are_a_failure_and_a_closed_pipe_is_none() {
    let desk = Desk::new(tiny(2));
    for (k, (stdout, expected)) in broken().into_iter().zip([1, 0]).enumerate() {
        let mut command = program();
        command.args(["map", "config.json", "--out", &format!("map{k}")]).current_dir(desk.path(""));
        let output = command.stdout(stdout).stderr(Stdio::piped()).output().unwrap();
        assert_eq!(output.status.code(), Some(expected), "{}", text(&output.stderr));
        assert!(desk.path(&format!("map{k}/fit.json")).exists());
    }
}

#[test]
#[cfg(target_os = "linux")]
fn a_signal_at_any_time_is_told_to_the_scheduler() {
    let mut config = long();
    config["imaging"]["pixels"] = json!(50_000);
    let desk = Desk::new(config);
    for (command, input) in [("sample", "config.json"), ("grid", "config.json"), ("limits", "config.json")] {
        for signal in ["TERM", "USR1"] {
            let mut child = desk.start(&[command, input, "--out", "early"]);
            catches_signals(&mut child);
            send(signal, &child);
            let output = child.wait_with_output().unwrap();
            let message = text(&output.stderr);
            assert_eq!(output.status.code(), Some(75), "{command} {signal}: {message}");
            says(&message, &["error: interrupted before the first", "nothing was written"]);
            assert!(!desk.path("early").exists(), "{command}");
        }
    }
    // while orbits go through the full pipeline
    let desk = Desk::new(tiny(2));
    let args = ["limits", "config.json", "--out", "l", "--draws", "1000", "--periods", "3", "--amplitudes", "3"];
    let mut child = desk.start(&[&args[..], &["--phases", "2", "--full", "60000", "--quiet"]].concat());
    catches_signals(&mut child);
    std::thread::sleep(Duration::from_millis(500));
    send("TERM", &child);
    assert_eq!(code(child), Some(75));
    desk.succeed(&args);
}

/// A folder of `kilobytes` in memory, if this user may have one.
#[cfg(target_os = "linux")]
pub struct SmallDisk(std::path::PathBuf);

#[cfg(target_os = "linux")]
impl SmallDisk {
    pub fn new(folder: &Path, kilobytes: usize) -> Option<Self> {
        std::fs::create_dir_all(folder).unwrap();
        let size = format!("size={kilobytes}k");
        let mut mount = Command::new("mount");
        mount.args(["-t", "tmpfs", "-o", &size, "tmpfs"]).arg(folder).stderr(Stdio::null());
        match mount.status() {
            Ok(status) if status.success() => Some(SmallDisk(folder.to_owned())),
            _ => {
                println!("skipped: no small disk can be had here");
                None
            }
        }
    }

    pub fn grow(&self) {
        let grown = Command::new("mount").args(["-o", "remount,size=1m"]).arg(&self.0).status();
        assert!(grown.unwrap().success());
    }
}

#[cfg(target_os = "linux")]
impl Drop for SmallDisk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg("-l").arg(&self.0).status();
    }
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_is_a_failure_and_the_run_begins_or_goes_on() {
    let mut config = tiny(20);
    config["grid"] = json!({ "axes": { "k_kms": [0.0, 0.4, 60] } });
    let desk = Desk::new(config);
    // 4 kB hold no manifest, 16 kB a few steps and no more
    for (kilobytes, again) in [(4, &[][..]), (4, &["--resume"]), (16, &["--resume"])] {
        for command in ["sample", "grid"] {
            let Some(disk) = SmallDisk::new(&desk.path("small"), kilobytes) else { return };
            let args = [command, "config.json", "--out", "small/run"];
            for tried in [&args[..], &[&args[..], again].concat()] {
                let output = dimcmc(tried, &desk.path(""));
                let message = text(&output.stderr);
                assert_eq!(output.status.code(), Some(1), "{kilobytes} kB {tried:?}: {message}");
                says(&message, &["error: small/run/", "No space left on device"]);
                assert!(!message.contains("effort.json"), "{message}");
            }
            disk.grow();
            desk.succeed(&[&args[..], again].concat());
        }
    }
}

#[test]
#[cfg(target_os = "linux")]
fn a_missing_permission_is_a_failure() {
    let desk = Desk::new(tiny(2));
    std::fs::create_dir(desk.path("locked")).unwrap();
    desk.write("secret.json", &desk.config.to_string());
    let chmod = |mode: &str, name: &str| {
        assert!(Command::new("chmod").arg(mode).arg(desk.path(name)).status().unwrap().success());
    };
    chmod("755", "");
    chmod("555", "locked");
    chmod("000", "secret.json");
    let is_root = text(&Command::new("id").arg("-u").output().unwrap().stdout).trim() == "0";
    for args in [
        &["sample", "config.json", "--out", "locked"][..],
        &["sample", "config.json", "--out", "locked/run"],
        &["grid", "secret.json", "--out", "x"],
        &["map", "config.json", "--out", "locked"],
    ] {
        let mut command = Command::new(if is_root { "setpriv" } else { PROGRAM });
        if is_root {
            command.args(["--reuid=65534", "--regid=65534", "--clear-groups", PROGRAM]);
        }
        let output = match command.args(args).current_dir(desk.path("")).output() {
            Ok(output) => output,
            Err(error) => return println!("skipped: no other user can be had here: {error}"),
        };
        let message = text(&output.stderr);
        if message.contains("setpriv") || output.status.code() == Some(126) {
            return println!("skipped: no other user can be had here: {message}");
        }
        assert_eq!(output.status.code(), Some(1), "{args:?}: {message}");
        says(&message, &["error: ", "Permission denied"]);
        // before the work
        assert!(!args[3].starts_with("locked") || message.contains("--out locked"), "{args:?}: {message}");
    }
}

#[test]
#[cfg(unix)]
fn two_processes_do_not_write_into_one_folder() {
    let desk = Desk::new(tiny(60));
    std::fs::create_dir(desk.path("out")).unwrap();
    let folder = std::fs::File::open(desk.path("out")).unwrap();
    folder.lock().unwrap();
    let mut second = desk.start(&["simulate", "config.json", "--out", "out"]);
    std::thread::sleep(Duration::from_secs(1));
    assert!(second.try_wait().unwrap().is_none(), "it waits");
    assert!(std::fs::read_dir(desk.path("out")).unwrap().next().is_none());
    // what the first has written by then stays
    desk.write("out/truth.json", "precious");
    drop(folder);
    let output = second.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    says(&text(&output.stderr), &["error: --out out: the folder is not empty; give another one, or --force"]);
    assert_eq!(desk.read("out/truth.json"), "precious");
    // as for files by themselves
    desk.succeed(&["simulate", "config.json", "--out", "data"]);
    let folder = std::fs::File::open(desk.path("")).unwrap();
    folder.lock().unwrap();
    let second = desk.start(&["init", "data/observations.txt", "--objective", "spottedness", "--out", "star.json"]);
    std::thread::sleep(Duration::from_secs(1));
    desk.write("star.json", "precious");
    drop(folder);
    says(&text(&second.wait_with_output().unwrap().stderr), &["error: --out star.json: star.json exists"]);
    assert_eq!(desk.read("star.json"), "precious");
}

#[test]
fn numbers_beyond_sense_are_refused_by_key() {
    let desk = Desk::new(tiny(2));
    for (pointer, value, parts) in [
        ("/observations/simulate/cycles/3", json!(1e12), &["observations.simulate.cycles[3]", "1000000000000"][..]),
        ("/observations/simulate/cycles/3", json!(-1e15), &["observations.simulate.cycles[3]"]),
        ("/star/epoch_d", json!(1e12), &["star.epoch_d"]),
        ("/star/rotation_period_d", json!(1e12), &["star.rotation_period_d"]),
        ("/star/vsys_kms", json!(1e12), &["star.vsys_kms"]),
        ("/planet/porb_over_prot", json!(1e12), &["planet.porb_over_prot"]),
        ("/sampler/ensembles", json!(100_000), &["sampler.ensembles", "at most"]),
        ("/sampler/walkers", json!(1_000_000), &["sampler.walkers", "at most"]),
        ("/sampler/steps", json!(u64::MAX), &["sampler.steps", "at most"]),
    ] {
        let mut config = desk.config.clone();
        match config.pointer_mut(pointer) {
            Some(slot) => *slot = value,
            None => {
                let (parent, key) = pointer.rsplit_once('/').unwrap();
                config.pointer_mut(parent).unwrap()[key] = value;
            }
        }
        desk.write("config.json", &config.to_string());
        let message = desk.refusal(&["sample", "config.json", "--out", "run"]);
        says(&message, &[&["config.json: "], parts].concat());
    }
    let mut config = desk.config.clone();
    (config["sampler"]["ensembles"], config["sampler"]["walkers"]) = (json!(1000), json!(1000));
    desk.write("config.json", &config.to_string());
    says(&desk.refusal(&["sample", "config.json", "--out", "run"]), &["sampler.walkers", "not 1000000"]);
    let output = dimcmc(&["map", "config.json", "--out", "x", "--threads", "100000"], &desk.path(""));
    assert_eq!(output.status.code(), Some(2));
    says(&text(&output.stderr), &["--threads", "from 1 to 4096"]);
}

#[test]
fn tables_that_were_edited_are_refused_by_line() {
    let desk = Desk::new(tiny(2));
    let few = ["--draws", "1000"];
    desk.succeed(&[&["periodogram", "config.json", "--out", "search"][..], &few].concat());
    let orbits = ["--periods", "3", "--amplitudes", "3", "--phases", "2"];
    desk.succeed(&[&["limits", "config.json", "--out", "limits"][..], &orbits, &few].concat());
    desk.succeed(&["map", "config.json", "--out", "map"]);
    type Change = fn(&str) -> String;
    fn cell(table: &str, line: usize, column: &str, value: &str) -> String {
        let k = table.lines().next().unwrap().split(',').position(|name| name == column).unwrap();
        let mut cells: Vec<&str> = table.lines().nth(line - 1).unwrap().split(',').collect();
        cells[k] = value;
        crate::desk::with_line(table, line, &cells.join(","))
    }
    fn without_line(table: &str, line: usize) -> String {
        table.lines().enumerate().filter(|(k, _)| k + 1 != line).map(|(_, line)| format!("{line}\n")).collect()
    }
    let cases: [(&str, Change, &[&str]); 12] = [
        ("limits/limits.csv", |t| cell(t, 2, "period_d", "1e300"), &["limits.csv:2", "period_d"]),
        ("limits/limits.csv", |t| cell(t, 4, "k_kms", "1e30"), &["limits.csv:4", "k_kms"]),
        ("limits/limits.csv", |t| without_line(t, 3), &["limits.csv", "8 rows instead of 9"]),
        ("search/periodogram.csv", |t| cell(t, 5, "period_d", "1e300"), &["periodogram.csv:5", "period_d"]),
        ("search/periodogram.csv", |t| cell(t, 5, "period_d", "-1"), &["periodogram.csv:5", "period_d"]),
        ("search/periodogram.csv", |t| without_line(t, 7), &["periodogram.csv", "rows instead of"]),
        ("search/periodogram.csv", |t| t.lines().next().unwrap().to_owned(), &["periodogram.csv:2", "no row"]),
        ("search/periodogram.csv", |t| t.replacen("window", "windows", 1), &["periodogram.csv", "no column window"]),
        ("search/rv.csv", |t| without_line(t, 4), &["rv.csv", "11 rows instead of 12"]),
        ("search/rv.csv", |t| cell(t, 4, "cycle", "1e300"), &["rv.csv:4", "cycle"]),
        ("map/rv.csv", |t| without_line(t, 2), &["rv.csv", "11 rows instead of 12", "fit.json"]),
        ("map/profiles.csv", |t| without_line(t, 9), &["profiles.csv", "rows instead of", "fit.json"]),
    ];
    for (file, change, parts) in cases {
        let good = desk.read(file);
        desk.write(file, &change(&good));
        let folder = file.split('/').next().unwrap();
        says(&desk.refusal(&["plot", folder, "--out", "figures"]), parts);
        desk.write(file, &good);
    }
}

#[test]
fn a_landscape_with_rows_missing_is_drawn_as_far_as_it_goes() {
    let mut config = tiny(2);
    config["grid"] = json!({ "axes": { "k_kms": [0.1, 0.3, 3], "phi": [0.4, 0.6, 3] } });
    let desk = Desk::new(config);
    desk.succeed(&["grid", "config.json", "--out", "grid"]);
    assert!(!desk.succeed(&["plot", "grid", "--out", "whole"]).contains("note"));
    desk.edit("grid/landscape.jsonl", |nodes| nodes.lines().take(7).map(|line| format!("{line}\n")).collect());
    says(&desk.succeed(&["plot", "grid", "--out", "part"]), &["note", "landscape.jsonl: 7 of 9 nodes are there"]);
    says(&desk.read("part/landscape.svg"), &["7 of 9 nodes are there"]);
    // a grid of more nodes than memory
    desk.edit("grid/landscape.json", |header| header.replace("\"nodes\": 3", "\"nodes\": 3000000000"));
    says(&desk.refusal(&["plot", "grid", "--out", "huge"]), &["grid/landscape.json: grid", "at most"]);
}

#[test]
fn force_spares_what_the_command_reads() {
    let desk = Desk::new(tiny(2));
    desk.succeed(&["simulate", "config.json", "--out", "data"]);
    let mut config = desk.config.clone();
    config["observations"] = json!({ "path": "observations.txt" });
    desk.write("data/config.json", &config.to_string());
    let orbit = ["--k-kms", "0.2", "--porb-over-prot", "2.6", "--phi", "0.25"];
    let message = desk.refusal(&[&["inject", "data/config.json", "--out", "data", "--force"][..], &orbit].concat());
    says(&message, &["--out data", "data/config.json would be replaced", "reads"]);
    // another config of the same profiles
    desk.write("data/other.json", &config.to_string());
    let message =
        desk.refusal(&[&["inject", "data/other.json", "--out", "data/../data", "--force"][..], &orbit].concat());
    says(&message, &["data/observations.txt would be replaced"]);
    let message = desk.refusal(&["init", "data/observations.txt", "--out", "data/observations.txt", "--force"]);
    says(&message, &["data/observations.txt would be replaced"]);
    let message = desk.refusal(&["init", "data/observations.txt", "--out", "data/p003.prof", "--force"]);
    says(&message, &["data/p003.prof would be replaced"]);
    desk.write("data/truth.json", &desk.config.to_string());
    says(&desk.refusal(&["simulate", "data/truth.json", "--out", "data", "--force"]), &["data/truth.json would be"]);
    desk.write("fit.json", &desk.config.to_string());
    says(&desk.refusal(&["map", "fit.json", "--out", ".", "--force"]), &["fit.json would be replaced"]);
    // files that are not read are replaced as usual
    desk.succeed(&["map", "data/config.json", "--out", "data", "--force"]);
    desk.write("data/mine.csv", "precious");
    says(&desk.refusal(&["report", "data", "--out", "data/mine.csv", "--force"]), &["no report"]);
}

#[test]
fn an_edited_manifest_is_an_error() {
    let desk = Desk::new(tiny(8));
    desk.succeed(&["sample", "config.json", "--out", "run"]);
    let good = desk.json("run/manifest.json");
    let rival = good["optimum"].clone();
    let mut renamed = rival.clone();
    renamed["parameters"] = json!({ "k_kms": 0.1, "psi": 0.5 });
    for (pointer, value, parts) in [
        ("/rivals", json!([renamed]), &["rivals.parameters", "psi"][..]),
        ("/optimum/parameters", json!({ "k_kms": 0.2 }), &["optimum.parameters", "missing phi"]),
        ("/names", json!(["k_kms", "psi"]), &["psi"]),
        ("/colour", json!("red"), &["unknown key colour"]),
        ("/reference/colour", json!("red"), &["unknown field `colour`"]),
        ("/walkers", json!(8), &["start"]),
        ("/priors/psi", json!({}), &["priors: unknown key psi"]),
    ] {
        let mut manifest = good.clone();
        let (parent, key) = pointer.rsplit_once('/').unwrap();
        manifest.pointer_mut(parent).unwrap()[key] = value;
        desk.write("run/manifest.json", &manifest.to_string());
        for command in [
            &["analyse", "run"][..],
            &["plot", "run", "--out", "x"],
            &["sample", "config.json", "--out", "run", "--resume"],
        ] {
            says(&desk.refusal(command), &[&["run/manifest.json"], parts].concat());
        }
    }
    let mut manifest = good.clone();
    manifest["rivals"] = json!([rival]);
    desk.write("run/manifest.json", &manifest.to_string());
    says(&desk.succeed(&["analyse", "run"]), &["Secondary maximum"]);
}

#[test]
#[cfg(unix)]
fn control_characters_in_names_are_escaped() {
    let desk = Desk::new(tiny(2));
    let odd = "a\nb\u{1b}[31mc";
    let message = desk.refusal(&["map", odd, "--out", "x"]);
    says(&message, &["a\\nb\\u{1b}[31mc: cannot read"]);
    desk.write(odd, &desk.config.to_string().replacen("vsini_kms", "vsi\\nni\\u001b_kms", 1));
    says(&desk.refusal(&["map", odd, "--out", "x"]), &["a\\nb\\u{1b}[31mc: unknown key star.vsi\\nni\\u{1b}_kms"]);
    std::fs::remove_file(desk.path(odd)).unwrap();
    let table = desk.succeed(&["map", "config.json", "--out", odd]);
    says(&table, &["a\\nb\\u{1b}[31mc: map.json"]);
    assert!(!table.contains('\u{1b}'));
    let page = desk.succeed(&["report", odd, "--out", "report.html"]);
    assert!(page.contains("report.html"));
    let html = desk.read("report.html");
    says(&html, &["<h1>a\\nb\\u{1b}[31mc</h1>"]);
    assert!(!html.contains(|c: char| c.is_control() && c != '\n'));
}
