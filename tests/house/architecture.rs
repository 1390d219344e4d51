//! The shape of the source tree: which room may see which, read from the `crate::` paths in `src`, code under
//! `#[cfg(test)]` held to it as well; and that no files need each other.

use std::collections::{BTreeMap, BTreeSet};
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
        &["mixture", "velocities", "speeds", "verdict", "periodogram", "modes", "evidence", "occurrence"],
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
            "fitted",
            "origin",
            "blind_search",
            "limits",
            "maps",
            "simulated",
            "injected",
            "plan",
            "pool",
            "detection_limits",
            "manifest",
            "grid_scan",
            "optimum",
            "run",
            "log_posterior",
            "comparison",
            "export",
            "merge",
            "batch",
            "survey",
        ],
        &["numerics", "star", "maxent", "field", "planets", "sampling", "model", "surface", "inference", "data"],
    ),
    // from saved files alone: nothing that makes images, samples or searches
    (
        "figures",
        &["drawing", "plot", "printed", "report"],
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

/// A newcomer to the tree sees a dozen names.
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

/// `get_or_init` of a cell locks the cell meanwhile: jobs within it that need its value wait for themselves.
#[test]
fn what_is_found_once_holds_no_cell() {
    let mut faults = Vec::new();
    for source in in_rooms().filter(|source| !source.path.ends_with("numerics/once.rs")) {
        for (line, code) in source.code() {
            if code.contains("get_or_init") || code.contains("get_or_try_init") {
                faults.push(format!("{}:{line}: numerics::once::found does it without a lock", source.path.display()));
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

/// A module by its path, that of the crate being empty; and any other path in code.
type Names = Vec<String>;

/// What a file defines, and what it names.
#[derive(Default)]
struct Code {
    file: PathBuf,
    /// Names of functions, types and constants.
    defined: BTreeSet<String>,
    /// Names that it imports or exports, after the paths that they stand for.
    uses: Vec<(Names, String)>,
    /// Paths within its code.
    paths: Vec<Names>,
}

impl Code {
    /// Comments and tests left out.
    fn of(source: &Source) -> Self {
        let text = source.text.split("#[cfg(test)]\nmod tests").next().unwrap();
        let mut lines = text.lines().map(str::trim).filter(|line| !line.starts_with("//"));
        let mut code = Code { file: source.path.clone(), ..Code::default() };
        let mut rest = String::new();
        while let Some(line) = lines.next() {
            let mut public = ["", "pub ", "pub(super) ", "pub(crate) "].into_iter();
            let Some(tree) = public.find_map(|public| line.strip_prefix(public)?.strip_prefix("use ")) else {
                rest += line;
                rest += "\n";
                continue;
            };
            let mut tree = tree.to_owned();
            while !tree.contains(';') {
                tree += lines.next().unwrap_or(";");
            }
            import(&words(&tree), &mut 0, &[], &mut code.uses);
        }
        let words = words(&rest);
        for (k, word) in words.iter().enumerate() {
            let next = |i: usize| words.get(k + i).copied().unwrap_or_default();
            if ["fn", "struct", "enum", "trait", "type", "const", "static"].contains(word) {
                code.defined.insert(next(1).to_owned());
            }
            if is_name(word) && next(1) == "::" && is_name(next(2)) && (k == 0 || words[k - 1] != "::") {
                let more = words[k + 1..].chunks_exact(2).take_while(|pair| pair[0] == "::" && is_name(pair[1]));
                code.paths.push(std::iter::once(*word).chain(more.map(|pair| pair[1])).map(str::to_owned).collect());
            }
        }
        code
    }
}

fn is_name(word: &str) -> bool {
    word.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

/// Names and numbers, `::`, and all other characters one by one.
fn words(text: &str) -> Vec<&str> {
    let is_inside = |c: char| c.is_alphanumeric() || c == '_';
    let (mut words, mut rest) = (Vec::new(), text.trim_start());
    while let Some(first) = rest.chars().next() {
        let end = match first {
            _ if is_inside(first) => rest.find(|c| !is_inside(c)).unwrap_or(rest.len()),
            _ if rest.starts_with("::") => 2,
            _ => first.len_utf8(),
        };
        words.push(&rest[..end]);
        rest = rest[end..].trim_start();
    }
    words
}

/// All that the tree of a `use` brings in, from word `at` on to the end of the tree; `before` is the path to it.
fn import(words: &[&str], at: &mut usize, before: &[String], found: &mut Vec<(Names, String)>) {
    let mut path = before.to_vec();
    loop {
        let word = words[*at];
        match word {
            "," | "}" | ";" => {
                let name = path.last().cloned().unwrap_or_default();
                return found.push((path, name));
            }
            "as" => {
                *at += 2;
                return found.push((path, words[*at - 1].to_owned()));
            }
            "{" => {
                *at += 1;
                while words[*at] != "}" {
                    import(words, at, &path, found);
                    *at += usize::from(words[*at] == ",");
                }
                *at += 1;
                return;
            }
            "::" => {}
            // the module before it
            "self" if !path.is_empty() => {}
            _ => path.push(word.to_owned()),
        }
        *at += 1;
    }
}

/// The module whose file defines what a path in module `from` leads to, and its name there; `None` of what is not the
/// crate's own, and of modules themselves. Re-exports are followed, no more than `steps` of them.
fn definition(tree: &BTreeMap<Names, Code>, from: &[String], path: &[String], steps: usize) -> Option<(Names, String)> {
    let up = path.iter().take_while(|word| *word == "super").count();
    let (mut module, mut rest) = match path.first()?.as_str() {
        "crate" => (Names::new(), &path[1..]),
        "self" => (from.to_vec(), &path[1..]),
        _ => (from[..from.len().checked_sub(up)?].to_vec(), &path[up..]),
    };
    while let Some((word, after)) = rest.split_first() {
        let child = [&module[..], std::slice::from_ref(word)].concat();
        if tree.contains_key(&child) {
            (module, rest) = (child, after);
            continue;
        }
        let code = tree.get(&module)?;
        if code.defined.contains(word) {
            return Some((module, word.clone()));
        }
        let steps = steps.checked_sub(1)?;
        let stands_for = |(path, name): &(Names, String)| match name.as_str() {
            "*" => Some([&path[..path.len() - 1], rest].concat()),
            _ => (name == word).then(|| [path, after].concat()),
        };
        let mut meant = code.uses.iter().filter_map(stands_for);
        return meant.find_map(|path| definition(tree, &module, &path, steps));
    }
    None
}

/// Who needs whom can be read from the top of the house to its ground. A folder's own file beside the files in the
/// folder, or in folders of it, is left out: it may say what they have in common, and put them together.
#[test]
fn no_circles_between_files() {
    /// Re-exports of re-exports.
    const STEPS: usize = 6;
    let module = |source: &Source| {
        let names = source.path.with_extension("");
        let names: Names = names.iter().map(|name| name.to_str().unwrap().to_owned()).collect();
        let own = names.last().is_some_and(|name| name == "mod" || name == "lib");
        names[..names.len() - usize::from(own)].to_vec()
    };
    let tree: BTreeMap<Names, Code> = sources().iter().map(|source| (module(source), Code::of(source))).collect();
    let mut needs: BTreeMap<&Names, BTreeMap<Names, BTreeSet<String>>> = BTreeMap::new();
    for (from, code) in &tree {
        for path in code.uses.iter().map(|(path, _)| path).chain(&code.paths) {
            let Some((of, name)) = definition(&tree, from, path, STEPS) else { continue };
            if !of.starts_with(from) && !from.starts_with(&of) {
                needs.entry(from).or_default().entry(of).or_default().insert(name);
            }
        }
    }
    assert!(needs.values().map(BTreeMap::len).sum::<usize>() > 1000, "paths are no longer understood");
    let reached = |from: &Names| {
        let (mut reached, mut next) = (BTreeSet::new(), vec![from]);
        while let Some(of) = next.pop() {
            next.extend(needs.get(of).into_iter().flat_map(BTreeMap::keys).filter(|of| reached.insert((*of).clone())));
        }
        reached
    };
    let reached: BTreeMap<&Names, BTreeSet<Names>> = tree.keys().map(|from| (from, reached(from))).collect();
    let mut faults = Vec::new();
    for (from, of) in &needs {
        for (of, names) in of.iter().filter(|(of, _)| reached[of].contains(*from)) {
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            let [from, of] = [*from, of].map(|module| tree[module].file.display());
            faults.push(format!("{from} needs {of} ({}), which needs it", names.join(", ")));
        }
    }
    hold(faults);
}
