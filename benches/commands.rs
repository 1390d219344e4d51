//! Whole commands, as users run them: seconds, processor seconds, peak memory, reconstructions.
//!
//! Memory and processor time are read from `/proc` (Linux) while the command runs; elsewhere they are unknown.

mod common;

use common::paper::file;
use common::table::Table;
use std::io::Read;
use std::process::{Child, Command, Stdio};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// A command of the program.
struct Case {
    command: &'static str,
    config: &'static str,
    /// The word after the number of reconstructions in its output.
    counted: &'static str,
    /// Its output on success.
    good: &'static str,
}

const CASES: [Case; 3] = [
    Case { command: "sample", config: "configs/demo.json", counted: "evaluations", good: "\nconverged" },
    Case { command: "grid", config: "configs/paper_grid.json", counted: "reconstructions", good: " 0 failed" },
    Case { command: "sample", config: "configs/paper_7d.json", counted: "evaluations", good: "\nconverged" },
];

/// Ticks of processor time in `/proc` a second, on every Linux.
const TICKS: f64 = 100.0;

fn main() {
    if !common::wanted() {
        return;
    }
    let columns = ["command", "seconds", "processor seconds", "peak memory, MiB", "reconstructions"];
    let mut table = Table::new("Whole commands", &columns);
    let filter = std::env::args().skip(1).find(|argument| !argument.starts_with('-')).unwrap_or_default();
    for Case { command, config, counted, good } in CASES {
        let name = format!("`dimcmc {command} {config}`");
        if !name.contains(&filter) {
            continue;
        }
        println!("{name} ...");
        let unknown = || "-".to_owned();
        let cells = match run(command, config) {
            Ok(run) if !run.stdout.contains(good) => {
                let last = run.stdout.lines().last().unwrap_or("nothing").to_owned();
                [name, format!("ended in: {last}"), unknown(), unknown(), unknown()]
            }
            Ok(run) => [
                name,
                format!("{:.1}", run.seconds),
                run.usage.processor_s.map_or_else(unknown, |s| format!("{s:.1}")),
                run.usage.peak_kib.map_or_else(unknown, |kib| format!("{:.0}", kib / 1024.0)),
                number_before(&run.stdout, counted).unwrap_or_else(unknown),
            ],
            Err(message) => [name, format!("failed: {message}"), unknown(), unknown(), unknown()],
        };
        table.row(cells);
    }
    table.print("All processors. Reconstructions of a chain are those of its steps, without the search before them.");
}

/// A finished command.
struct Run {
    seconds: f64,
    usage: Usage,
    stdout: String,
}

fn run(command: &str, config: &str) -> Result<Run, String> {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let began = Instant::now();
    let mut child = Command::new(env!("CARGO_BIN_EXE_dimcmc"))
        .arg(command)
        .arg(file(config))
        .arg("--out")
        .arg(folder.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|e| e.to_string())?;
    // read as they come, so that the command never waits for a full pipe
    let (stdout, stderr) = (drain(child.stdout.take()), drain(child.stderr.take()));
    let usage = Usage::until_the_end_of(&mut child);
    let status = child.wait().map_err(|e| e.to_string())?;
    let seconds = began.elapsed().as_secs_f64();
    let [stdout, stderr] = [stdout, stderr].map(|text| text.join().unwrap_or_default());
    match status.success() {
        true => Ok(Run { seconds, usage, stdout }),
        false => Err(stderr.lines().next().unwrap_or("no message").to_owned()),
    }
}

/// Reads a pipe to its end beside everything else.
fn drain(pipe: Option<impl Read + Send + 'static>) -> JoinHandle<String> {
    std::thread::spawn(move || {
        let mut bytes = Vec::new();
        pipe.map(|mut pipe| pipe.read_to_end(&mut bytes));
        String::from_utf8_lossy(&bytes).into_owned()
    })
}

/// Resources used by a process.
#[derive(Default)]
struct Usage {
    processor_s: Option<f64>,
    peak_kib: Option<f64>,
}

impl Usage {
    /// Polls every few milliseconds until the command is a zombie, whose processor time is final but whose memory is
    /// gone.
    fn until_the_end_of(child: &mut Child) -> Self {
        let mut usage = Usage::default();
        let read = |name| std::fs::read_to_string(format!("/proc/{}/{name}", child.id())).ok();
        while let Some(stat) = read("stat") {
            // after the name, in brackets: state, ..., and as 12th and 13th the ticks of user and system
            let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or("").split_whitespace().collect();
            let ticks = |i: usize| fields.get(i)?.parse::<f64>().ok();
            usage.processor_s = ticks(11).zip(ticks(12)).map(|(user, system)| (user + system) / TICKS);
            usage.peak_kib = read("status").as_deref().and_then(peak_kib).or(usage.peak_kib);
            if fields.first().is_none_or(|state| ["Z", "X"].contains(state)) {
                break;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        usage
    }
}

/// Peak resident memory of a process.
fn peak_kib(status: &str) -> Option<f64> {
    status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix("kB")?.trim().parse().ok())
}

/// The number before `word`, where the text has one.
fn number_before(text: &str, word: &str) -> Option<String> {
    let words: Vec<&str> = text.split_whitespace().collect();
    let number = |pair: &[&str]| (pair[1].trim_end_matches(',') == word).then(|| pair[0].to_owned());
    words.windows(2).find_map(number).filter(|number| number.parse::<f64>().is_ok())
}
