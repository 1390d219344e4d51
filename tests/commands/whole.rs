//! Results are complete or absent, whatever ends a command: signals, full disks, kills; leftovers are no obstacle, and
//! of two commands for one folder one is refused before it starts its work.

use crate::desk::{Desk, dimcmc, says, text, tiny};
#[cfg(target_os = "linux")]
use crate::faults::{catches_signals, send};
use serde_json::{Value, json};
use std::process::Child;
use std::time::{Duration, Instant};

const PLANET: [&str; 6] = ["--k-kms", "0.2", "--porb-over-prot", "2.6", "--phi", "0.25"];

/// Pixels so many that every command takes some seconds.
fn slow() -> Value {
    let mut config = tiny(2);
    config["imaging"]["pixels"] = json!(20_000);
    config["observations"]["simulate"]["pixels"] = json!(200_000);
    config
}

fn plan() -> Value {
    let mut config = tiny(2);
    config["imaging"] = json!({ "objective": "marginal-likelihood", "pixels": 300, "spot_lifetime_d": 20.0 });
    config["sampler"]["walkers"] = json!(16);
    let cycles: Vec<f64> = (0..300).map(|k| 0.313 * f64::from(k)).collect();
    config["observations"]["simulate"]["cycles"] = json!(cycles);
    config
}

#[cfg(target_os = "linux")]
fn send_once_caught(signal: &str, child: &mut Child) {
    catches_signals(child);
    send(signal, child);
}

#[test]
#[cfg(target_os = "linux")]
fn every_command_tells_the_scheduler_of_a_signal() {
    let desk = Desk::new(slow());
    desk.write("plan.json", &plan().to_string());
    let inject = [&["inject", "config.json", "--out", "x"][..], &PLANET].concat();
    let commands: [&[&str]; 6] = [
        &["map", "config.json", "--out", "x"],
        &["periodogram", "config.json", "--out", "x"],
        &["optimise", "config.json", "--out", "x"],
        &["simulate", "config.json", "--out", "x"],
        &["plan", "plan.json", "--out", "x"],
        &inject,
    ];
    for command in commands {
        for (signal, code) in [("TERM", 75), ("INT", 1)] {
            let mut child = desk.start(command);
            send_once_caught(signal, &mut child);
            let output = child.wait_with_output().unwrap();
            let message = text(&output.stderr);
            assert_eq!(output.status.code(), Some(code), "{command:?} {signal}: {message}");
            says(&message, &["error: interrupted before the first result; nothing was written"]);
            assert!(!desk.path("x").exists(), "{command:?}");
        }
    }
}

#[test]
fn what_a_kill_has_left_is_no_obstacle() {
    let desk = Desk::new(tiny(2));
    desk.succeed(&["periodogram", "config.json", "--out", "search", "--draws", "1000"]);
    for folder in ["map", "search/rv", "run"] {
        std::fs::create_dir(desk.path(folder)).unwrap();
        desk.write(&format!("{folder}/.README.txt.123.tmp"), "half");
        std::fs::create_dir_all(desk.path(&format!("{folder}/.dimcmc.123.tmp/files"))).unwrap();
    }
    desk.succeed(&["map", "config.json", "--out", "map"]);
    desk.succeed(&["export", "search", "--format", "rv"]);
    desk.succeed(&["sample", "config.json", "--out", "run"]);
    for folder in ["map", "search/rv", "run"] {
        let hidden =
            |entry: std::io::Result<std::fs::DirEntry>| entry.unwrap().file_name().to_string_lossy().starts_with('.');
        assert!(!std::fs::read_dir(desk.path(folder)).unwrap().any(hidden), "{folder}");
    }
    // what is not of this program stays
    std::fs::create_dir(desk.path("mine")).unwrap();
    desk.write("mine/.swap.tmp", "precious");
    says(&desk.refusal(&["map", "config.json", "--out", "mine"]), &["not empty"]);
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_leaves_no_part_and_the_same_command_goes_on() {
    let desk = Desk::new(tiny(8));
    desk.write("plan.json", &{
        let mut config = plan();
        config["observations"]["simulate"]["cycles"] = json!([0.0, 0.3, 0.7, 1.1, 1.6, 2.2]);
        config.to_string()
    });
    desk.succeed(&["sample", "config.json", "--out", "a"]);
    desk.succeed(&["sample", "config.json", "--out", "b", "--seed", "4"]);
    desk.succeed(&["periodogram", "config.json", "--out", "search", "--draws", "1000"]);
    let limits = ["--periods", "3", "--amplitudes", "3", "--phases", "2", "--draws", "1000"];
    let inject = [&["inject", "config.json", "--out", "small/x"][..], &PLANET].concat();
    let commands: [&[&str]; 7] = [
        &["map", "config.json", "--out", "small/x"],
        &["periodogram", "config.json", "--out", "small/x", "--draws", "1000"],
        &[&["limits", "config.json", "--out", "small/x"][..], &limits].concat(),
        &["plan", "plan.json", "--out", "small/x", "--maps", "0", "--draws", "1000"],
        &inject,
        &["merge", "a", "b", "--out", "small/x"],
        &["export", "search", "--format", "rv", "--out", "small/x"],
    ];
    for command in commands {
        // room for some of the files
        for kilobytes in [8, 16] {
            let Some(disk) = crate::faults::SmallDisk::new(&desk.path("small"), kilobytes) else { return };
            let output = dimcmc(command, &desk.path(""));
            let message = text(&output.stderr);
            if output.status.code() == Some(0) {
                // it needs less
                continue;
            }
            assert_eq!(output.status.code(), Some(1), "{command:?}: {message}");
            says(&message, &["error: small/x", "No space left on device"]);
            let left = std::fs::read_dir(desk.path("small/x")).map_or(0, Iterator::count);
            assert_eq!(left, 0, "{command:?} in {kilobytes} kB");
            disk.grow();
            desk.succeed(command);
        }
    }
}

#[test]
fn of_two_for_one_folder_the_second_is_refused_before_it_works() {
    let mut config = slow();
    config["grid"] = json!({ "axes": { "k_kms": [0.0, 0.4, 60] } });
    let desk = Desk::new(config);
    desk.write("stars.txt", "config.json\n");
    for (command, file) in [("sample", "chain.jsonl"), ("grid", "landscape.jsonl")] {
        let mut first = desk.start(&[command, "config.json", "--out", "run"]);
        let began = Instant::now();
        while !desk.path("run").join(file).exists() && first.try_wait().unwrap().is_none() {
            assert!(began.elapsed() < Duration::from_secs(60));
            std::thread::sleep(Duration::from_millis(1));
        }
        // before the search of the first is over
        assert_eq!(desk.lines(&format!("run/{file}")), 0);
        let message = desk.refusal(&[command, "config.json", "--out", "run"]);
        says(&message, &[&format!("run/{file}: another process is writing this run")]);
        #[cfg(unix)]
        crate::desk::interrupt(first);
        #[cfg(not(unix))]
        crate::desk::kill(first);
        assert!(!desk.path("run").exists(), "nothing had begun");
    }
    // a batch that loses does not write its table over that of the other
    let mut first = desk.start(&["batch", "stars.txt", "--out", "stars"]);
    let began = Instant::now();
    while !desk.path("stars/.batch.lock").exists() && first.try_wait().unwrap().is_none() {
        assert!(began.elapsed() < Duration::from_secs(60));
        std::thread::sleep(Duration::from_millis(1));
    }
    let output = dimcmc(&["batch", "stars.txt", "--out", "stars"], &desk.path(""));
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    says(&text(&output.stderr), &["--out stars: another `dimcmc batch` is at work there"]);
    assert!(!desk.path("stars/batch.json").exists());
    crate::desk::kill(first);
    // what a kill leaves is no obstacle
    desk.write("config.json", &tiny(2).to_string());
    desk.succeed(&["batch", "stars.txt", "--out", "stars"]);
    assert!(!desk.path("stars/.batch.lock").exists());
}

#[test]
fn a_wrong_option_is_refused_in_one_line() {
    let desk = Desk::new(tiny(2));
    for (args, parts) in [
        (&["map", "config.json", "--out", "x", "--forc"][..], &["unexpected argument '--forc'", "'--force'"][..]),
        (&["map"], &["required arguments were not provided: ", "--out <DIR>", "<CONFIG>"]),
        (&["limits", "config.json", "--out", "x", "--periods", "1"], &["invalid value '1' for '--periods <N>'"]),
        (&["mapp"], &["unrecognized subcommand 'mapp'", "'map'"]),
    ] {
        let message = desk.refusal(args);
        says(&message, parts);
        assert!(message.contains("--help"), "{message}");
    }
}
