//! Whatever interrupts a long computation (a kill, Ctrl-C, a scheduler's warning, a power cut within a line), the same
//! command with `--resume` gives the bytes of an uninterrupted one. Cuts byte by byte are in `tests/method/chain.rs`,
//! ranks of a cluster in `mpi/tests/mpi.rs`.
#![cfg(unix)]

use crate::desk::{Desk, kill, says, text, tiny};
use crate::shared;
use serde_json::{Value, json};
use std::process::{Child, Command};
use std::time::Duration;

const CONFIG: &str = "config.json";

/// A long computation, with one thread.
struct Task {
    command: &'static str,
    config: Value,
    /// The final content of its folder: its settings, lines of results, and the summary.
    files: [&'static str; 3],
    /// Lines that are written at once.
    block: usize,
    /// After how many lines it is killed.
    kills: &'static [usize],
}

const RUN: [&str; 3] = ["manifest.json", "chain.jsonl", "summary.json"];

fn tasks() -> [Task; 2] {
    let mut landscape = tiny(2);
    landscape["grid"] = json!({ "axes": { "k_kms": [0.0, 0.4, 100] } });
    [
        Task { command: "sample", config: tiny(30), files: RUN, block: 12, kills: &[0, 50, 200] },
        Task {
            command: "grid",
            config: landscape,
            files: ["landscape.json", "landscape.jsonl", "paraboloid.json"],
            block: 1,
            kills: &[0, 40],
        },
    ]
}

/// A chain under the marginal likelihood.
fn integrated() -> Task {
    let block = shared::ENSEMBLES * shared::WALKERS;
    let mut config = shared::config();
    config["sampler"]["steps"] = json!(10);
    // every command fits the star by itself: one without active regions takes less time
    config["star"]["regions"] = json!({ "area": 0.0 });
    Task { command: "sample", config, files: RUN, block, kills: &[40] }
}

impl Task {
    /// A desk where the command has run to its end in `whole`.
    fn desk(&self) -> Desk {
        let desk = Desk::new(self.config.clone());
        desk.succeed(&[&self.args("whole")[..], &["--threads", "2"]].concat());
        desk
    }

    fn args<'a>(&self, out: &'a str) -> [&'a str; 4] {
        [self.command, CONFIG, "--out", out]
    }

    fn start(&self, desk: &Desk, out: &str, more: &[&str]) -> Child {
        desk.start(&[&self.args(out)[..], &["--threads", "1"], more].concat())
    }

    fn resumed_is_whole(&self, desk: &Desk, out: &str) {
        // one that was stopped before its settings were written begins again
        let begun = desk.path(out).join(self.files[0]).exists();
        desk.succeed(&[&self.args(out)[..], &[if begun { "--resume" } else { "--force" }]].concat());
        for file in self.files {
            let [a, b] = ["whole", out].map(|folder| desk.read(&format!("{folder}/{file}")));
            assert!(a == b, "{} {out}: {file} differs", self.command);
        }
    }
}

#[test]
fn killed_or_torn_and_resumed_is_uninterrupted() {
    for task in tasks().into_iter().chain([integrated()]) {
        let desk = task.desk();
        for least in task.kills {
            let out = format!("killed_{least}");
            let lines = format!("{out}/{}", task.files[1]);
            let mut child = task.start(&desk, &out, &[]);
            match least {
                // during the search
                0 => std::thread::sleep(Duration::from_millis(10)),
                _ => desk.wait_for_lines(&lines, &mut child, *least),
            }
            kill(child);
            // and again, before it has gone far
            if desk.path(&out).join(task.files[0]).exists() {
                let there = desk.lines(&lines);
                let mut child = task.start(&desk, &out, &["--resume"]);
                desk.wait_for_lines(&lines, &mut child, there + 2 * task.block);
                kill(child);
            }
            task.resumed_is_whole(&desk, &out);
        }
        let [head, lines, _] = task.files;
        let whole = desk.read(&format!("whole/{lines}"));
        for (out, cut) in [("within_a_line", whole.len() * 2 / 3), ("last_byte", whole.len() - 1)] {
            std::fs::create_dir(desk.path(out)).unwrap();
            std::fs::copy(desk.path("whole").join(head), desk.path(out).join(head)).unwrap();
            desk.write(&format!("{out}/{lines}"), &whole[..cut]);
            task.resumed_is_whole(&desk, out);
        }
    }
}

#[test]
fn a_signal_stops_cleanly_and_it_is_said_how_to_go_on() {
    for task in tasks() {
        let desk = task.desk();
        // Ctrl-C, and what schedulers send, who are to run the same again
        for (signal, code) in [("INT", 1), ("TERM", 75), ("USR1", 75)] {
            let lines = format!("{signal}/{}", task.files[1]);
            let mut child = task.start(&desk, signal, &[]);
            desk.wait_for_lines(&lines, &mut child, 2 * task.block);
            let sent = Command::new("kill").args([&format!("-{signal}"), &child.id().to_string()]).status();
            assert!(sent.unwrap().success());
            let output = child.wait_with_output().unwrap();
            let message = text(&output.stderr);
            assert_eq!(output.status.code(), Some(code), "{message}");
            let again = format!("dimcmc {} config.json --out {signal} --resume", task.command);
            says(&message, &["error: interrupted after ", &again]);
            assert_eq!(message.matches('\n').count(), 1);
            let there = desk.lines(&lines);
            assert!(there.is_multiple_of(task.block) && there < desk.lines(&format!("whole/{}", task.files[1])));
            task.resumed_is_whole(&desk, signal);
        }
    }
}
