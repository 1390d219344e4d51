//! Several ranks by MPI, with `mpirun` on this machine: the same bytes as by threads, whatever happens on the way, and
//! no job that hangs.
//!
//! Without a test harness: `mpirun` also starts this program as ranks of jobs that fail on purpose (`ranks`). Without
//! `mpirun` it prints `skipped`, and fails where `CI` is set.

#[path = "../../tests/common/desk.rs"]
#[allow(unused)]
mod desk;
mod ranks;

use desk::{Desk, says, text, tiny};
use serde_json::{Value, json};
use std::path::Path;
use std::process::{Child, Command, ExitCode, Output, Stdio};
use std::time::{Duration, Instant};

/// The program.
pub const PROGRAM: &str = env!("CARGO_BIN_EXE_dimcmc-mpi");

/// A job that takes longer hangs.
const LONGEST: Duration = Duration::from_secs(180);

/// A panic ends a job within this.
const AT_ONCE: Duration = Duration::from_secs(5);

const CONFIG: &str = "config.json";

const RUN: [&str; 3] = ["manifest.json", "chain.jsonl", "summary.json"];

const GRID: [&str; 3] = ["landscape.json", "landscape.jsonl", "paraboloid.json"];

const CHECKS: [(&str, fn()); 13] = [
    ("a chain is the same on any number of ranks and threads", any_number_of_ranks),
    ("so it is with other models of star and data", other_models),
    ("a landscape is the same", landscape),
    ("so are orbits put in and searched for", limits),
    ("a killed rank ends the job, and another number of ranks resumes it", killed),
    ("SIGUSR1 ends the job with the code that says resume", warned),
    ("a panic on a worker ends the job", || panics("panic-on-worker", "on purpose on rank 2")),
    ("a panic on the first rank ends the job", || panics("panic-on-first", "on purpose on rank 0")),
    ("a rank without the data ends the job and says so", without_data),
    ("bad input is one line and code 2", bad_input),
    ("stars of a batch are those of sample", batch),
    ("every question is answered by its own brief", many_briefs),
    ("answers come in order, and nobody burns a processor while waiting", order_and_rest),
];

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    if let [first, role, rest @ ..] = &args[..]
        && first == "--rank"
    {
        return ranks::play(role, rest);
    }
    if Command::new("mpirun").arg("--version").stdout(Stdio::null()).status().is_err() {
        println!("mpi: skipped, there is no mpirun");
        return if std::env::var_os("CI").is_some() { ExitCode::FAILURE } else { ExitCode::SUCCESS };
    }
    let wanted =
        |name: &str| !args.iter().any(|arg| !arg.starts_with('-')) || args.iter().any(|arg| name.contains(arg));
    for (name, check) in CHECKS.iter().filter(|(name, _)| wanted(name)) {
        let began = Instant::now();
        check();
        println!("{name}: ok, {:.1} s", began.elapsed().as_secs_f64());
    }
    ExitCode::SUCCESS
}

fn config() -> Value {
    let mut config = tiny(60);
    config["grid"] =
        json!({ "axes": { "k_kms": [0.11, 0.26, 6], "porb_over_prot": [1.62, 1.92, 4], "phi": [0.49, 0.55, 3] } });
    config
}

/// A program on this many ranks.
fn mpirun(desk: &Desk, ranks: usize, program: &str, args: &[&str]) -> Command {
    let mut command = Command::new("mpirun");
    command.args(["--oversubscribe", "--allow-run-as-root", "--bind-to", "none", "-n", &ranks.to_string(), program]);
    command.args(args).current_dir(desk.path("")).stdout(Stdio::piped()).stderr(Stdio::piped());
    // Open MPI's launcher sleeps for a second between SIGTERM and SIGKILL, sometimes even with no process left to kill
    command.env("OMPI_MCA_odls_base_sigkill_timeout", "0").env("DIMCMC_CACHE", "off");
    command
}

fn on_ranks(desk: &Desk, ranks: usize, args: &[&str]) -> Child {
    mpirun(desk, ranks, PROGRAM, args).spawn().unwrap()
}

/// Waits for the end; a job that hangs fails here.
fn end(mut child: Child) -> Output {
    let began = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if began.elapsed() > LONGEST {
            child.kill().unwrap();
            panic!("the job hangs");
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    child.wait_with_output().unwrap()
}

fn succeed(desk: &Desk, ranks: usize, args: &[&str]) -> String {
    let output = end(on_ranks(desk, ranks, args));
    assert_eq!(output.status.code(), Some(0), "{args:?}: {}", text(&output.stderr));
    assert_eq!(text(&output.stderr), "");
    text(&output.stdout)
}

fn same(desk: &Desk, files: &[&str], a: &str, b: &str) {
    for file in files {
        let [a, b] = [a, b].map(|folder| desk.read(&format!("{folder}/{file}")));
        assert!(a == b, "{file} of {b} differs from that of {a}");
    }
}

fn any_number_of_ranks() {
    let desk = Desk::new(config());
    let threaded = desk.succeed(&["sample", CONFIG, "--out", "threads", "--threads", "2"]);
    for (ranks, threads) in [(1, None), (2, None), (3, None), (3, Some("2"))] {
        let out = format!("{ranks}_{}", threads.unwrap_or("-"));
        let threads: Vec<&str> = threads.iter().flat_map(|n| ["--threads", n]).collect();
        let table = succeed(&desk, ranks, &[&["sample", CONFIG, "--out", &out], &threads[..]].concat());
        assert_eq!(table, threaded);
        same(&desk, &RUN, "threads", &out);
    }
    desk.succeed(&["sample", CONFIG, "--out", "prior", "--start", "prior"]);
    succeed(&desk, 3, &["sample", CONFIG, "--out", "prior_3", "--start", "prior"]);
    same(&desk, &RUN, "prior", "prior_3");
}

/// The result of a rank depends only on the config.
fn other_models() {
    for (pointer, value) in [
        ("/imaging/unresolved_spots", json!("fitted")),
        ("/imaging/brightness", json!("bright-and-dark")),
        ("/imaging/chi2_target", json!("auto")),
        ("/imaging/nuisances", json!({ "equivalent_width": 0.02 })),
        ("/parameters/vsini_kms", json!({ "prior": "normal", "mean": 20.0, "sd": 0.3 })),
    ] {
        let desk = Desk::new(config());
        desk.set(pointer, value);
        desk.succeed(&["sample", CONFIG, "--out", "a"]);
        succeed(&desk, 3, &["sample", CONFIG, "--out", "b"]);
        same(&desk, &RUN, "a", "b");
    }
}

fn landscape() {
    let desk = Desk::new(config());
    desk.succeed(&["grid", CONFIG, "--out", "a", "--threads", "2"]);
    succeed(&desk, 3, &["grid", CONFIG, "--out", "b"]);
    same(&desk, &GRID, "a", "b");
}

fn limits() {
    let desk = Desk::new(config());
    let args =
        ["limits", CONFIG, "--periods", "3", "--amplitudes", "4", "--phases", "2", "--draws", "1000", "--full", "5"];
    desk.succeed(&[&args[..], &["--out", "a", "--threads", "2"]].concat());
    succeed(&desk, 3, &[&args[..], &["--out", "b"]].concat());
    assert_eq!(desk.json("a/limits.json")["agreement"]["orbits"], 5);
    same(&desk, &["limits.csv", "limits.json"], "a", "b");
}

/// The system process of one rank in a job.
fn rank_of(mpirun: &Child, rank: usize) -> String {
    let is_it = |pid: &String| {
        let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
        let parent = stat.rsplit_once(") ")?.1.split_whitespace().nth(1)?.to_owned();
        let environment = std::fs::read(format!("/proc/{pid}/environ")).ok()?;
        let wanted = format!("OMPI_COMM_WORLD_RANK={rank}");
        let found = environment.split(|byte| *byte == 0).any(|one| one == wanted.as_bytes());
        (parent == mpirun.id().to_string() && found).then_some(())
    };
    let processes = std::fs::read_dir("/proc").unwrap();
    let mut pids = processes.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned());
    pids.find(|pid| is_it(pid).is_some()).expect("the rank runs")
}

fn signal(name: &str, pid: &str) {
    assert!(Command::new("kill").args([&format!("-{name}"), pid]).status().unwrap().success());
}

/// A job with some steps of a chain that would take long.
fn sampling(desk: &Desk, out: &str) -> Child {
    let mut job = on_ranks(desk, 3, &["sample", CONFIG, "--out", out]);
    desk.wait_for_lines(&format!("{out}/chain.jsonl"), &mut job, 100);
    job
}

/// A chain long enough to be interrupted, and its state at step 60.
fn long_and_short(desk: &Desk) {
    desk.succeed(&["sample", CONFIG, "--out", "whole"]);
    desk.set("/sampler/steps", json!(100_000));
}

fn killed() {
    let desk = Desk::new(config());
    long_and_short(&desk);
    let job = sampling(&desk, "killed");
    signal("KILL", &rank_of(&job, 2));
    let output = end(job);
    assert!(!output.status.success(), "the job goes on without a rank");
    desk.write(CONFIG, &config().to_string());
    // cut to what there was early on: how far the job came is a matter of chance
    let chain = desk.read("killed/chain.jsonl");
    let early: String = chain.split_inclusive('\n').take(100).collect();
    desk.write("killed/chain.jsonl", &early);
    succeed(&desk, 2, &["sample", CONFIG, "--out", "killed", "--resume"]);
    same(&desk, &RUN, "whole", "killed");
}

fn warned() {
    let desk = Desk::new(config());
    desk.set("/sampler/steps", json!(100_000));
    let job = sampling(&desk, "warned");
    signal("USR1", &job.id().to_string());
    let output = end(job);
    assert_eq!(output.status.code(), Some(75), "{}", text(&output.stderr));
    says(&text(&output.stderr), &["interrupted after step", "--out warned --resume"]);
    let [lines, steps] = [desk.lines("warned/chain.jsonl"), desk.lines("warned/chain.jsonl") / 12 - 1];
    assert!(lines.is_multiple_of(12), "{lines} lines");
    // a single process of one thread goes on: as far again as an uninterrupted one
    let more = (steps + 20).to_string();
    desk.set("/sampler/steps", json!(steps + 20));
    desk.succeed(&["sample", CONFIG, "--out", "warned", "--resume", "--threads", "1"]);
    desk.succeed(&["sample", CONFIG, "--out", "whole"]);
    same(&desk, &["chain.jsonl"], "whole", "warned");
    println!("interrupted after step {steps}, gone on to {more}");
}

/// This program as ranks that play a role.
fn play(desk: &Desk, ranks: usize, args: &[&str]) -> Child {
    let program = std::env::current_exe().unwrap();
    mpirun(desk, ranks, program.to_str().unwrap(), &[&["--rank"], args].concat()).spawn().unwrap()
}

fn panics(role: &str, message: &str) {
    let desk = Desk::new(json!(null));
    let output = end(play(&desk, 3, &[role, "when"]));
    let ended = ranks::now_s();
    assert_eq!(output.status.code(), Some(101), "{}", text(&output.stderr));
    says(&text(&output.stderr), &["panicked at", message]);
    let panicked: f64 = desk.read("when").parse().unwrap();
    println!("ended {:.3} s after the panic", ended - panicked);
    assert!(ended - panicked < AT_ONCE.as_secs_f64());
}

fn without_data() {
    let mut config = config();
    config["observations"] = json!({ "path": "data/observations.txt" });
    let desk = Desk::new(config);
    desk.write("simulated.json", &self::config().to_string());
    desk.succeed(&["simulate", "simulated.json", "--out", "data"]);
    std::fs::create_dir(desk.path("elsewhere")).unwrap();
    let sample = [PROGRAM, "sample", CONFIG, "--out", "run"];
    let mut command = mpirun(&desk, 1, PROGRAM, &sample[1..]);
    let job = command.args([":", "-n", "1", "--wdir", desk.path("elsewhere").to_str().unwrap()]).args(sample);
    let output = end(job.spawn().unwrap());
    assert_eq!(output.status.code(), Some(2));
    says(&text(&output.stderr), &["error: rank 1: ", "data/observations.txt"]);
    assert!(!Path::new(&desk.path("run")).exists(), "nothing is written");
}

fn bad_input() {
    let desk = Desk::new(config());
    desk.set("/imaging/pixels", json!(-3));
    let output = end(on_ranks(&desk, 3, &["sample", CONFIG, "--out", "run"]));
    assert_eq!(output.status.code(), Some(2));
    let stderr = text(&output.stderr);
    assert_eq!(stderr.matches("error: ").count(), 1, "{stderr}");
    says(&stderr, &["error: config.json", "imaging.pixels"]);
}

fn batch() {
    let desk = Desk::new(config());
    let mut other = config();
    other["observations"]["simulate"]["seed"] = json!(8);
    desk.write("other.json", &other.to_string());
    desk.write("stars.txt", "config.json\nother.json\nabsent.json\n");
    for star in ["config", "other"] {
        desk.succeed(&["sample", &format!("{star}.json"), "--out", star]);
    }
    let output = end(on_ranks(&desk, 3, &["batch", "stars.txt", "--out", "stars"]));
    assert_eq!(output.status.code(), Some(1), "a star of the list is not there");
    says(&text(&output.stdout), &["config ", "other ", "absent: absent.json"]);
    for star in ["config", "other"] {
        same(&desk, &RUN, star, &format!("stars/{star}"));
    }
}

fn many_briefs() {
    let desk = Desk::new(json!(null));
    let output = end(play(&desk, 3, &["many-briefs"]));
    assert_eq!(text(&output.stdout).trim(), "right: 1100", "{}", text(&output.stderr));
}

fn order_and_rest() {
    let desk = Desk::new(json!(null));
    let output = end(play(&desk, 3, &["order-and-rest"]));
    let stdout = text(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let number = |name: &str| -> f64 {
        let line =
            stdout.lines().find_map(|line| line.strip_prefix(name)).unwrap_or_else(|| panic!("{name}: {stdout}"));
        line.trim().parse().unwrap()
    };
    assert_eq!(number("in order:"), 1.0);
    // ranks 1 and 2 of two threads each: four at once, so 40 answers of 50 ms take half a second and some
    let seconds = number("seconds:");
    println!(
        "40 answers of 50 ms by 4 threads on 2 ranks: {seconds:.3} s, processor of rank 0: {:.3} s",
        number("processor:")
    );
    assert!((0.5..1.5).contains(&seconds));
    // spinning would be all of it
    assert!(number("processor:") < 0.15 * seconds);
}
