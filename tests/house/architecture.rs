//! The shape of the source tree: what may import what, read from the `crate::` paths in `src`.
//!
//! Code under `#[cfg(test)]` is held to it as well. What a part must not know is stated twice where it matters most: by the
//! order of the layers, and by name.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// The layers, lowest first. A module imports from lower layers only; those of one layer do not see each other.
const LAYERS: &[&[&str]] = &[
    &["units", "text", "vector", "velocities", "log_density", "verdict", "figure", "cluster"],
    &["observation"],
    &["star", "maxent", "chain", "landscape", "periodogram", "nuisances"],
    &["imaging", "ensemble", "optimise", "first_look"],
    &["objective"],
    &["expansion"],
    &["surrogate"],
    &["simulate", "injection", "noise", "fit", "detection", "zero_points"],
    &["io"],
    &["config"],
    &["scene", "search"],
    &["origin", "diagnosis", "limits", "blind_search"],
    &["proposal"],
    &["pool"],
    &["manifest", "survey", "optimum", "import"],
    &["run"],
    &["comparison", "export", "merge", "batch"],
    &["experiments"],
    &["plot"],
    &["report"],
];

/// Modules, and all that they may import. What is not listed here may import whatever lies lower.
const MAY_SEE: &[(&str, &[&str])] = &[
    ("units", &[]),
    ("text", &[]),
    ("vector", &[]),
    ("velocities", &[]),
    ("figure", &[]),
    ("log_density", &[]),
    ("verdict", &[]),
    ("cluster", &[]),
    ("observation", &["units"]),
    ("star", &["observation", "units", "vector"]),
    ("maxent", &["units", "vector"]),
    ("nuisances", &["observation", "vector"]),
    ("imaging", &["maxent", "nuisances", "observation", "star", "units", "vector"]),
    ("chain", &["log_density", "text", "verdict"]),
    ("landscape", &["log_density", "text"]),
    ("periodogram", &["velocities", "verdict"]),
    ("ensemble", &["chain", "log_density"]),
    ("optimise", &["log_density"]),
    ("export", &["chain", "io", "log_density", "manifest", "objective", "origin", "run"]),
    ("first_look", &["observation", "star"]),
    ("injection", &["observation", "star"]),
    ("noise", &["first_look", "imaging", "objective", "observation", "star"]),
    // from saved files alone: nothing that reconstructs, samples or searches
    (
        "plot",
        &[
            "chain",
            "comparison",
            "experiments",
            "figure",
            "io",
            "landscape",
            "manifest",
            "objective",
            "observation",
            "origin",
            "run",
            "star",
            "survey",
            "verdict",
        ],
    ),
    ("report", &["chain", "figure", "io", "manifest", "objective", "origin", "plot", "survey", "text", "verdict"]),
];

struct Source {
    path: PathBuf,
    text: String,
}

impl Source {
    /// The module at the top of the crate that the file belongs to: `star` for `src/star/grid.rs`, `run` for `src/run.rs`.
    fn module(&self) -> String {
        let first = self.path.components().next().unwrap();
        Path::new(first.as_os_str()).file_stem().unwrap().to_str().unwrap().to_owned()
    }

    /// Lines of code with their numbers; comments and documentation left out.
    fn code(&self) -> impl Iterator<Item = (usize, &str)> {
        let lines = self.text.lines().enumerate().map(|(k, line)| (k + 1, line));
        lines.filter(|(_, line)| !line.trim_start().starts_with("//"))
    }

    /// Modules that the file names by `crate::`, with the lines.
    fn imports(&self) -> Vec<(usize, String)> {
        let mut found = Vec::new();
        for (number, line) in self.code() {
            for rest in line.split("crate::").skip(1) {
                let names = match rest.strip_prefix('{') {
                    Some(group) => group.split('}').next().unwrap().split(',').collect(),
                    None => vec![rest],
                };
                for name in names {
                    let is_name = |c: char| c.is_alphanumeric() || c == '_';
                    let name = name.trim().split(|c| !is_name(c)).next().unwrap();
                    found.push((number, name.to_owned()));
                }
            }
        }
        found
    }

    fn within(&self, module: &str) -> bool {
        self.module() == module
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

/// The files of the library: all but the binary's.
fn library() -> Vec<Source> {
    sources().into_iter().filter(|s| !["main", "cli", "lib"].contains(&s.module().as_str())).collect()
}

fn layers() -> BTreeMap<&'static str, usize> {
    LAYERS.iter().enumerate().flat_map(|(k, layer)| layer.iter().map(move |module| (*module, k))).collect()
}

fn hold(faults: Vec<String>) {
    assert!(faults.is_empty(), "\n{}", faults.join("\n"));
}

#[test]
fn every_module_has_its_layer() {
    let modules: BTreeSet<String> = library().iter().map(Source::module).collect();
    let listed: BTreeSet<String> = layers().into_keys().map(str::to_owned).collect();
    assert_eq!(modules, listed, "the table of layers in this test names every module of the library, and no other");
}

#[test]
fn imports_run_downwards() {
    let layers = layers();
    let mut faults = Vec::new();
    for source in library() {
        let module = source.module();
        for (line, other) in source.imports().into_iter().filter(|(_, other)| *other != module) {
            match layers.get(other.as_str()) {
                Some(layer) if *layer < layers[module.as_str()] => {}
                Some(_) => faults.push(format!("{}:{line}: {module} sees {other}", source.path.display())),
                // a name that lib.rs re-exports is for users of the library, not for itself
                None => faults.push(format!("{}:{line}: crate::{other} is no module", source.path.display())),
            }
        }
    }
    hold(faults);
}

#[test]
fn parts_see_no_more_than_they_need() {
    let mut faults = Vec::new();
    for source in library() {
        let Some((module, allowed)) = MAY_SEE.iter().find(|(module, _)| source.within(module)) else { continue };
        for (line, other) in source.imports() {
            if other != *module && !allowed.contains(&other.as_str()) {
                faults.push(format!("{}:{line}: {module} sees {other}", source.path.display()));
            }
        }
    }
    hold(faults);
}

#[test]
fn commands_belong_to_the_binary() {
    for source in sources() {
        let declares = source.code().any(|(_, line)| line.trim_end().ends_with("mod cli;"));
        assert_eq!(declares, source.within("main"), "{}: cli is declared in main.rs", source.path.display());
    }
}

/// The library prints nothing and never ends the program; only the binary does.
#[test]
fn the_library_is_silent() {
    let loud = ["println!", "print!", "eprintln!", "eprint!", "dbg!", "process::exit", "std::io::stdout", "stderr()"];
    let mut faults = Vec::new();
    for source in library() {
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
