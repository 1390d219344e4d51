//! Every example in the program's own help, run as it stands; and what shells, editors and `man` read.
//!
//! Commands and examples are taken from `--help`, so that a new command is covered without a line here, but for its
//! place in [`ORDER`].

use crate::desk::{Desk, dimcmc, says, text};
use crate::small::{commands, desk, help, root, run, zdipy};
use serde_json::json;
use std::path::Path;

/// The order in which examples run: a command comes after those whose results its example reads.
const ORDER: &[&str] = &[
    "simulate",
    "inject",
    "init",
    "import",
    "plan",
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
    "survey",
    "analyse",
    "compare",
    "plot",
    "report",
    "export",
];

/// The examples below "Example:" in the help of a command, each in one line; none is wider than a narrow terminal.
fn examples(command: &str) -> Vec<String> {
    let whole = help(&[command, "--help"]);
    let (_, examples) =
        whole.rsplit_once("Example:").unwrap_or_else(|| panic!("dimcmc {command} --help has no Example:"));
    assert!(examples.lines().all(|line| line.chars().count() <= 80), "{command}: a terminal breaks an example");
    let examples = examples.replace("\\\n   ", "");
    let lines = examples.lines().map(str::trim).filter(|line| !line.is_empty());
    let lines: Vec<String> = lines.map(str::to_owned).collect();
    let begin = format!("dimcmc {command} ");
    assert!(!lines.is_empty() && lines.iter().all(|line| line.starts_with(&begin)), "{command}: {lines:?}");
    lines
}

#[test]
#[ignore = "long: .ci/run has it run"]
fn every_example_works() {
    let mut commands = commands();
    let place = |command: &String| ORDER.iter().position(|name| name == command);
    let placeless: Vec<&String> = commands.iter().filter(|command| place(command).is_none()).collect();
    assert!(
        placeless.is_empty(),
        "{placeless:?}: no place in ORDER of tests/house/examples.rs: put the command after those whose results its \
        example reads"
    );
    commands.sort_by_key(place);
    let desk = desk();
    for command in &commands {
        if command == "import" {
            zdipy(&desk, "demo_data");
        }
        for line in examples(command) {
            run(&line, &desk);
        }
    }
}

/// A command that is in none of the groups of `dimcmc --help` stands under "Others".
#[test]
fn every_command_has_its_group_and_its_examples() {
    let whole = help(&["--help"]);
    assert!(!whole.contains("Others:"), "a command has no place in src/cli/groups.rs:\n{whole}");
    assert!(commands().len() >= 13, "{whole}");
    for command in commands() {
        assert!(!examples(&command).is_empty());
    }
    for args in [&["-h"][..], &["help"]] {
        assert_eq!(help(args), whole);
    }
}

#[test]
fn the_schema_is_the_one_that_ships() {
    let shipped = std::fs::read_to_string(root().join("configs/dimcmc.schema.json")).unwrap();
    let made = help(&["schema"]);
    let line = made.lines().zip(shipped.lines()).find(|(made, shipped)| made != shipped);
    assert!(made == shipped, "{line:?}");
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
    desk.refusal(&["man", "--out", "man"]);
}

#[test]
fn the_version_is_that_of_the_package() {
    let version = help(&["--version"]);
    let rest = version.strip_prefix(concat!("dimcmc ", env!("CARGO_PKG_VERSION"))).expect(&version).trim_end();
    // the commit, where the program was built in a separate working tree
    let commit = rest.strip_prefix(" (").and_then(|rest| rest.strip_suffix(')'));
    assert!(
        rest.is_empty() || commit.is_some_and(|c| c.len() >= 7 && c.chars().all(|c| c.is_ascii_hexdigit())),
        "{version}"
    );
}
