//! A small star to run commands on: the demo with a third of its profiles, few pixels and short chains; and a shell's
//! line, run.

use crate::desk::{CACHE, Desk, PROGRAM, copy, dimcmc, text};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// No command may take longer on the small star.
const LONGEST: Duration = Duration::from_secs(300);

/// Chains that say something and have not converged.
pub fn short_chains() -> Value {
    json!({ "ensembles": 2, "walkers": 14, "steps": 8 })
}

pub fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// What the program prints.
pub fn help(args: &[&str]) -> String {
    let output = dimcmc(args, Path::new("."));
    assert_eq!(output.status.code(), Some(0), "{args:?}: {}", text(&output.stderr));
    text(&output.stdout)
}

/// The commands that `dimcmc --help` lists: the first words of indented lines above the options.
pub fn commands() -> Vec<String> {
    let whole = help(&["--help"]);
    let listed = whole.split("\nOptions:").next().unwrap().lines().filter_map(|line| line.strip_prefix("  "));
    let names = listed.filter(|line| line.starts_with(|c: char| c.is_ascii_lowercase()));
    let names = names.map(|line| line.split_whitespace().next().unwrap().to_owned());
    names.filter(|name| name != "help").collect()
}

/// `configs/demo.json`, but small: a third of the profiles, few pixels, more noise, short chains, 27 nodes.
fn demo() -> Value {
    let mut demo: Value = serde_json::from_slice(&std::fs::read(root().join("configs/demo.json")).unwrap()).unwrap();
    let simulate = &mut demo["observations"]["simulate"];
    let cycles = simulate["cycles"].as_array().unwrap().iter().step_by(3).cloned().collect::<Vec<_>>();
    simulate["cycles"] = Value::from(cycles);
    simulate["pixels"] = json!(400);
    simulate["snr"] = json!(300);
    demo["imaging"]["pixels"] = json!(400);
    // else most of the time goes into reconstructions of a noise that few pixels make
    demo["imaging"]["unresolved_spots"] = json!("entropy");
    demo["imaging"]["chi2_target"] = json!(1.0);
    demo["sampler"] = short_chains();
    demo["grid"]["axes"] = json!({ "k_kms": [0.05, 0.15, 3], "porb_over_prot": [1.5, 1.9, 3], "phi": [0.4, 0.6, 3] });
    demo
}

/// `configs/plan.json` with few pixels and profiles.
fn planned() -> Value {
    let mut plan: Value = serde_json::from_slice(&std::fs::read(root().join("configs/plan.json")).unwrap()).unwrap();
    plan["imaging"]["pixels"] = json!(300);
    plan["observations"]["simulate"]["schedule"]["per_night"] = json!([1, 2]);
    plan
}

/// A folder as examples expect it: `configs` with the small demo, a plan and the schema.
pub fn desk() -> Desk {
    let desk = Desk::new(json!(null));
    std::fs::create_dir(desk.path("configs")).unwrap();
    desk.write("configs/demo.json", &demo().to_string());
    desk.write("configs/stars.txt", "demo.json\n");
    desk.write("configs/plan.json", &planned().to_string());
    std::fs::copy(root().join("configs/dimcmc.schema.json"), desk.path("configs/dimcmc.schema.json")).unwrap();
    desk
}

/// ZDIpy's input for the profiles that `simulate` wrote into the folder `data`.
pub fn zdipy(desk: &Desk, data: &str) {
    for file in ["inzdi.dat", "model-voigt-line.dat"] {
        std::fs::copy(root().join("tests/data/zdipy").join(file), desk.path(file)).unwrap();
    }
    copy(&desk.path(data), &desk.path("LSDprof"));
}

/// Runs a line of one command in a shell, as it stands; what it printed.
pub fn run(line: &str, desk: &Desk) -> String {
    let program = Path::new(PROGRAM).parent().unwrap();
    let path = std::env::join_paths(
        [program.to_owned()].into_iter().chain(std::env::split_paths(&std::env::var_os("PATH").unwrap())),
    );
    let to = |name: &str| Stdio::from(std::fs::File::create(desk.path(name)).unwrap());
    let mut shell = Command::new("sh");
    shell.args(["-euc", &format!("exec {line}")]).current_dir(desk.path("")).env("PATH", path.unwrap());
    shell.env("DIMCMC_CACHE", CACHE);
    let mut child = shell.stdout(to("stdout.txt")).stderr(to("stderr.txt")).spawn().unwrap();
    let began = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if began.elapsed() > LONGEST {
            child.kill().unwrap();
            child.wait().unwrap();
            panic!("{line}: more than {} s; make the small star in this file smaller", LONGEST.as_secs());
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    println!("{:6.2} s  {line}", began.elapsed().as_secs_f64());
    assert!(status.success(), "{line}: {status}\n{}", desk.read("stderr.txt"));
    let command = line.split(" #").next().unwrap();
    let file = command.split_once('>').map_or("stdout.txt", |(_, file)| file.trim());
    assert!(!desk.read(file).is_empty(), "{line}: says nothing");
    desk.read("stdout.txt")
}
