//! The shape of the source tree: which room may see which, read from the `crate::` paths in `src`.
//!
//! Code under `#[cfg(test)]` is held to it as well.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// The rooms of `src/`, lowest first; the modules of each, lowest first, where there is an order to keep; and what it
/// may see elsewhere: whole rooms or modules of them.
const ROOMS: &[(&str, &[&str], &[&str])] = &[
    ("numerics", &[], &[]),
    ("star", &[], &["numerics"]),
    ("maxent", &[], &["numerics"]),
    ("field", &[], &["numerics"]),
    (
        "planets",
        &["mixture", "velocities", "verdict", "periodogram", "modes", "evidence"],
        &["numerics", "star::kepler"],
    ),
    ("sampling", &["log_density", "chain", "landscape", "optimise", "ensemble"], &["numerics"]),
    ("model", &[], &["numerics", "star", "sampling", "planets"]),
    ("surface", &[], &["numerics", "star", "maxent", "field", "planets", "sampling", "model"]),
    (
        "inference",
        &["evidence", "detection", "search"],
        &["numerics", "star", "maxent", "field", "planets", "sampling", "model", "surface"],
    ),
    (
        "data",
        &["simulate", "io", "config", "dataset", "ephemeris", "calibrated", "scene", "diagnosis", "init", "import"],
        &["numerics", "star", "maxent", "field", "planets", "sampling", "model", "surface", "inference"],
    ),
    (
        "runs",
        &[
            "cluster",
            "origin",
            "blind_search",
            "limits",
            "maps",
            "simulated",
            "plan",
            "pool",
            "manifest",
            "grid_scan",
            "optimum",
            "run",
            "log_posterior",
            "comparison",
            "export",
            "merge",
            "batch",
        ],
        &["numerics", "star", "maxent", "field", "planets", "sampling", "model", "surface", "inference", "data"],
    ),
    // from saved files alone: nothing that makes images, samples or searches
    (
        "figures",
        &["drawing", "plot", "report"],
        &[
            "numerics::text",
            "numerics::quantile",
            "star",
            "planets",
            "sampling::chain",
            "sampling::landscape",
            "sampling::log_density",
            "model",
            "surface",
            "data::io",
            "runs",
        ],
    ),
    (
        "cli",
        &[],
        &[
            "numerics",
            "star",
            "maxent",
            "planets",
            "sampling",
            "model",
            "surface",
            "inference",
            "data",
            "runs",
            "figures",
        ],
    ),
];

struct Source {
    path: PathBuf,
    text: String,
}

impl Source {
    /// The room and the module in it: `star` and `grid` for `src/star/grid.rs`.
    fn place(&self) -> (String, String) {
        let mut names = self.path.components().map(|part| Path::new(part.as_os_str()).file_stem().unwrap());
        let mut next = || names.next().map_or(String::new(), |name| name.to_str().unwrap().to_owned());
        (next(), next())
    }

    /// Lines of code with their numbers; comments and documentation left out.
    fn code(&self) -> impl Iterator<Item = (usize, &str)> {
        let lines = self.text.lines().enumerate().map(|(k, line)| (k + 1, line));
        lines.filter(|(_, line)| !line.trim_start().starts_with("//"))
    }

    /// Paths that the file names by `crate::`, as far as the room and the module in it, with the lines.
    fn imports(&self) -> Vec<(usize, String, String)> {
        let mut found = Vec::new();
        for (number, line) in self.code() {
            for rest in line.split("crate::").skip(1) {
                let is_path = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
                let mut names = rest.split(|c| !is_path(c)).next().unwrap().split("::");
                let mut next = || names.next().unwrap_or_default().to_owned();
                found.push((number, next(), next()));
            }
        }
        found
    }
}

/// All of `src`, paths relative to it.
fn sources() -> Vec<Source> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let (mut found, mut folders) = (Vec::new(), vec![root.clone()]);
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let text = std::fs::read_to_string(&path).unwrap();
                found.push(Source { path: path.strip_prefix(&root).unwrap().to_owned(), text });
            }
        }
    }
    found.sort_by(|a, b| a.path.cmp(&b.path));
    found
}

/// The files of rooms.
fn in_rooms() -> impl Iterator<Item = Source> {
    sources().into_iter().filter(|source| source.path.components().count() > 1)
}

fn hold(faults: Vec<String>) {
    assert!(faults.is_empty(), "\n{}", faults.join("\n"));
}

/// Whoever comes new to the tree sees a dozen names.
#[test]
fn every_room_is_listed() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let name = |entry: std::io::Result<std::fs::DirEntry>| entry.unwrap().file_name().into_string().unwrap();
    let entries: BTreeSet<String> = std::fs::read_dir(root).unwrap().map(name).collect();
    let listed: BTreeSet<String> = ROOMS.iter().map(|(room, ..)| (*room).to_owned()).chain(["lib.rs".into()]).collect();
    assert_eq!(entries, listed, "the table of this test names every room, and no other");
    assert!(entries.len() <= 14);
    for (room, order, _) in ROOMS.iter().filter(|(_, order, _)| !order.is_empty()) {
        let inside = in_rooms().map(|source| source.place()).filter(|(of, module)| of == room && module != "mod");
        let inside: BTreeSet<String> = inside.map(|(_, module)| module).collect();
        assert_eq!(inside, order.iter().map(|module| (*module).to_owned()).collect(), "{room}");
    }
}

#[test]
fn imports_run_downwards() {
    let mut faults = Vec::new();
    for source in in_rooms() {
        let (room, module) = source.place();
        let (_, order, sees) = ROOMS.iter().find(|(name, ..)| *name == room).unwrap();
        let rank = |module: &str| order.iter().position(|name| *name == module);
        for (line, other, inside) in source.imports() {
            let allowed = match other == room {
                true => inside == module || rank(&inside).is_none() || rank(&inside) < rank(&module),
                false => sees.contains(&other.as_str()) || sees.contains(&format!("{other}::{inside}").as_str()),
            };
            if !allowed {
                faults.push(format!("{}:{line}: sees {other}::{inside}", source.path.display()));
            }
        }
    }
    hold(faults);
}

/// Nothing outside of `surface` asks which surface model it is given.
#[test]
fn surface_models_are_named_in_their_room_alone() {
    let names = ["static_map", "evolving_map", "StaticMap", "EvolvingMap"];
    let mut faults = Vec::new();
    for source in in_rooms().filter(|source| source.place().0 != "surface") {
        for (line, code) in source.code() {
            for name in names.iter().filter(|name| code.contains(*name)) {
                faults.push(format!("{}:{line}: names {name}", source.path.display()));
            }
        }
    }
    hold(faults);
}

/// Only the command line prints and ends the program.
#[test]
fn all_but_the_command_line_are_silent() {
    let loud = ["println!", "print!", "eprintln!", "eprint!", "dbg!", "process::exit", "std::io::stdout", "stderr()"];
    let mut faults = Vec::new();
    for source in in_rooms().filter(|source| source.place().0 != "cli") {
        for (line, code) in source.code() {
            for word in loud.iter().filter(|word| code.contains(*word)) {
                faults.push(format!("{}:{line}: {word}", source.path.display()));
            }
        }
    }
    hold(faults);
}

#[test]
fn every_file_says_what_it_is() {
    let silent = sources().into_iter().filter(|source| !source.text.starts_with("//! "));
    hold(silent.map(|source| format!("{}: does not open with `//!`", source.path.display())).collect());
}
