//! Every example in the program's own help, run as it stands; and what shells, editors and `man` read.
//!
//! Commands and examples are taken from `--help`, so that a new command is covered without a line here, but for its
//! place in [`ORDER`].

use crate::desk::{Desk, dimcmc, says, text};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// The order in which examples run: a command comes after those whose results its example reads.
const ORDER: &[&str] = &[
    "simulate",
    "inject",
    "init",
    "import",
    "schema",
    "completions",
    "man",
    "map",
    "periodogram",
    "limits",
    "optimise",
    "grid",
    "sample",
    "merge",
    "batch",
    "analyse",
    "compare",
    "plot",
    "report",
    "export",
    "reproduce",
];

/// No example may take longer on the small star.
const LONGEST: Duration = Duration::from_secs(300);

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn help(args: &[&str]) -> String {
    let output = dimcmc(args, Path::new("."));
    assert_eq!(output.status.code(), Some(0), "{args:?}: {}", text(&output.stderr));
    text(&output.stdout)
}

/// The commands that `dimcmc --help` lists: the first words of indented lines above the options.
fn commands() -> Vec<String> {
    let whole = help(&["--help"]);
    let listed = whole.split("\nOptions:").next().unwrap().lines().filter_map(|line| line.strip_prefix("  "));
    let names = listed.filter(|line| line.starts_with(|c: char| c.is_ascii_lowercase()));
    let names = names.map(|line| line.split_whitespace().next().unwrap().to_owned());
    names.filter(|name| name != "help").collect()
}

/// The lines below "Example:" in the help of a command.
fn examples(command: &str) -> Vec<String> {
    let whole = help(&[command, "--help"]);
    let (_, examples) =
        whole.rsplit_once("Example:").unwrap_or_else(|| panic!("dimcmc {command} --help has no Example:"));
    let lines = examples.lines().map(str::trim).filter(|line| !line.is_empty());
    let lines: Vec<String> = lines.map(str::to_owned).collect();
    let begin = format!("dimcmc {command} ");
    assert!(!lines.is_empty() && lines.iter().all(|line| line.starts_with(&begin)), "{command}: {lines:?}");
    lines
}

/// `configs/demo.json`, but small: a third of the profiles, few pixels, more noise, short chains, 27 nodes.
fn small_demo() -> Value {
    let mut demo: Value = serde_json::from_slice(&std::fs::read(root().join("configs/demo.json")).unwrap()).unwrap();
    let simulate = &mut demo["observations"]["simulate"];
    let cycles = simulate["cycles"].as_array().unwrap().iter().step_by(3).cloned().collect::<Vec<_>>();
    simulate["cycles"] = Value::from(cycles);
    simulate["pixels"] = json!(2000);
    simulate["snr"] = json!(300);
    demo["imaging"]["pixels"] = json!(800);
    demo["imaging"]["chi2_target"] = json!(1.0);
    demo["sampler"] = json!({ "ensembles": 2, "walkers": 8, "steps": 20 });
    demo["grid"]["axes"] = json!({ "k_kms": [0.05, 0.15, 3], "porb_over_prot": [1.5, 1.9, 3], "phi": [0.4, 0.6, 3] });
    demo
}

/// A folder as an example expects it: `configs` with the small demo and the schema.
fn desk() -> Desk {
    let desk = Desk::new(json!(null));
    std::fs::create_dir(desk.path("configs")).unwrap();
    desk.write("configs/demo.json", &small_demo().to_string());
    desk.write("configs/stars.txt", "demo.json\n");
    std::fs::copy(root().join("configs/dimcmc.schema.json"), desk.path("configs/dimcmc.schema.json")).unwrap();
    desk
}

/// What an example needs that no other one writes.
fn prepare(command: &str, desk: &Desk) {
    if command != "import" {
        return;
    }
    // ZDIpy's input for the profiles that the example of `simulate` wrote
    for file in ["inzdi.dat", "model-voigt-line.dat"] {
        std::fs::copy(root().join("tests/data/zdipy").join(file), desk.path(file)).unwrap();
    }
    std::fs::create_dir(desk.path("LSDprof")).unwrap();
    for entry in std::fs::read_dir(desk.path("demo_data")).unwrap() {
        let path = entry.unwrap().path();
        std::fs::copy(&path, desk.path("LSDprof").join(path.file_name().unwrap())).unwrap();
    }
}

/// Runs a line as a shell does; blanks separate, and `>` sends stdout to a file.
fn run(line: &str, desk: &Desk) {
    assert!(!line.contains(['"', '\'', '$', '|', '\\']), "{line}: more of a shell than this test knows");
    let (command, file) = line.split_once('>').map_or((line, None), |(command, file)| (command, Some(file.trim())));
    let args: Vec<&str> = command.split_whitespace().skip(1).collect();
    let stdout = desk.path(file.unwrap_or("stdout.txt"));
    let stderr = desk.path("stderr.txt");
    let to = |path: &Path| Stdio::from(std::fs::File::create(path).unwrap());
    let mut program = Command::new(env!("CARGO_BIN_EXE_dimcmc"));
    let mut child =
        program.args(args).current_dir(desk.path("")).stdout(to(&stdout)).stderr(to(&stderr)).spawn().unwrap();
    let began = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if began.elapsed() > LONGEST {
            child.kill().unwrap();
            child.wait().unwrap();
            panic!("{line}: more than {} s; make the small star in this test smaller", LONGEST.as_secs());
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    println!("{:6.2} s  {line}", began.elapsed().as_secs_f64());
    assert!(status.success(), "{line}: {status}\n{}", std::fs::read_to_string(stderr).unwrap());
    assert!(std::fs::metadata(stdout).unwrap().len() > 0, "{line}: says nothing");
}

#[test]
fn every_example_works() {
    let mut commands = commands();
    let place = |command: &String| ORDER.iter().position(|name| name == command);
    let placeless: Vec<&String> = commands.iter().filter(|command| place(command).is_none()).collect();
    assert!(
        placeless.is_empty(),
        "{placeless:?}: no place in ORDER of tests/examples.rs: put the command after those whose results its example \
        reads"
    );
    commands.sort_by_key(place);
    let desk = desk();
    for command in &commands {
        prepare(command, &desk);
        for line in examples(command) {
            run(&line, &desk);
        }
    }
}

/// A command that is in none of the groups of `dimcmc --help` stands under "Others".
#[test]
fn every_command_has_its_group() {
    let whole = help(&["--help"]);
    assert!(!whole.contains("Others:"), "a command has no place in src/cli/groups.rs:\n{whole}");
    assert!(commands().len() >= 13, "{whole}");
    for args in [&["-h"][..], &["help"]] {
        assert_eq!(help(args), whole);
    }
}

#[test]
fn the_schema_is_the_one_that_ships() {
    let shipped = std::fs::read_to_string(root().join("configs/dimcmc.schema.json")).unwrap();
    assert_eq!(help(&["schema"]), shipped);
}

#[test]
fn shells_complete_every_command() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = help(&["completions", shell]);
        for command in commands() {
            assert!(script.contains(&command), "{shell}: {command}");
        }
        assert!(script.contains("rotation-period"), "{shell}: an option");
    }
    let output = dimcmc(&["completions", "cmd"], Path::new("."));
    assert_eq!(output.status.code(), Some(2));
    says(&text(&output.stderr), &["error: ", "cmd", "bash"]);
}

#[test]
fn every_command_has_its_page() {
    let desk = Desk::new(json!(null));
    desk.succeed(&["man", "--out", "man"]);
    let page = desk.read("man/dimcmc.1");
    for command in commands() {
        assert!(page.contains(&format!("dimcmc\\-{command}(1)")), "{command} is not on the first page");
        let page = desk.read(&format!("man/dimcmc-{command}.1"));
        says(&page, &[".SH NAME", "Example:", &format!("dimcmc {command} ").replace('-', "\\-")]);
    }
    says(&desk.refusal(&["man", "--out", "man"]), &["--out man", "not empty", "--force"]);
}

#[test]
fn the_version_is_that_of_the_package() {
    let version = help(&["--version"]);
    let rest = version.strip_prefix(concat!("dimcmc ", env!("CARGO_PKG_VERSION"))).expect(&version).trim_end();
    // the commit, where the program was built in a working tree of its own
    let commit = rest.strip_prefix(" (").and_then(|rest| rest.strip_suffix(')'));
    assert!(
        rest.is_empty() || commit.is_some_and(|c| c.len() >= 7 && c.chars().all(|c| c.is_ascii_hexdigit())),
        "{version}"
    );
}
