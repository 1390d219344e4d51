//! README and `docs/`: what they say is what the program does.
//!
//! Blocks marked `sh` are run line by line, in the order of the page, in a separate folder with a small star; of blocks
//! marked `console`, which need what a test does not have, commands and options are looked up. Blocks marked `json` are
//! configs.

use crate::desk::{Desk, copy};
use crate::reference;
use crate::small::{commands, desk, help, root, run, short_chains, zdipy};
use dimcmc::internals::data::config;
use rayon::prelude::*;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// The README is one page.
const README_BYTES: usize = 8000;

/// Characters of a line.
const LONGEST_LINE: usize = 120;

/// Terms of the glossary.
const GLOSSARY_TERMS: usize = 40;

/// Where people write.
const WRITTEN: [&str; 12] = [
    "src",
    "tests",
    "benches",
    "examples",
    "python",
    ".ci",
    ".github",
    "paper",
    "build.rs",
    "Cargo.toml",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
];

struct Page {
    /// Relative to the root.
    path: PathBuf,
    text: String,
}

/// A line of a page, the language of the block that it is in, and its number.
type Line<'a> = (usize, Option<&'a str>, &'a str);

impl Page {
    fn read(path: &Path) -> Self {
        let text = std::fs::read_to_string(root().join(path)).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        Page { path: path.to_owned(), text }
    }

    /// All lines but the fences.
    fn lines(&self) -> Vec<Line<'_>> {
        let mut block = None;
        let mut lines = Vec::new();
        for (number, line) in self.text.lines().enumerate() {
            match (line.strip_prefix("```"), block) {
                (Some(language), None) => block = Some(language),
                (Some(_), Some(_)) => block = None,
                (None, _) => lines.push((number + 1, block, line)),
            }
        }
        assert!(block.is_none(), "{}: a block has no end", self.path.display());
        lines
    }

    /// Lines of all blocks of a language that are no comments, numbered.
    fn commands(&self, language: &str) -> Vec<(usize, &str)> {
        let lines = self.lines().into_iter().filter(|(_, block, _)| *block == Some(language));
        lines.map(|(number, _, line)| (number, line)).filter(|(_, line)| !line.trim().is_empty()).collect()
    }

    /// The blocks of a language.
    fn blocks(&self, language: &str) -> Vec<String> {
        let fence = format!("```{language}\n");
        self.text.split(&fence).skip(1).map(|rest| rest.split("\n```").next().unwrap().to_owned() + "\n").collect()
    }

    /// What stands between backticks outside of blocks.
    fn code_spans(&self) -> Vec<(usize, &str)> {
        let prose = self.lines().into_iter().filter(|(_, block, _)| block.is_none());
        prose.flat_map(|(number, _, line)| line.split('`').skip(1).step_by(2).map(move |span| (number, span))).collect()
    }

    /// Targets of links and pictures outside of blocks.
    fn links(&self) -> Vec<(usize, &str)> {
        let prose = self.lines().into_iter().filter(|(_, block, _)| block.is_none());
        let targets = |line| str::split(line, "](").skip(1).map(|rest| rest.split(')').next().unwrap());
        prose.flat_map(|(number, _, line)| targets(line).map(move |target| (number, target))).collect()
    }

    /// Anchors of its headings, as forges make them.
    fn anchors(&self) -> BTreeSet<String> {
        let prose = self.lines().into_iter().filter(|(_, block, _)| block.is_none());
        let headings =
            prose.filter_map(|(_, _, line)| line.strip_prefix('#').map(|line| line.trim_matches(['#', ' '])));
        let kept = |c: &char| c.is_alphanumeric() || ['-', '_', ' '].contains(c);
        headings.map(|line| line.to_lowercase().chars().filter(kept).collect::<String>().replace(' ', "-")).collect()
    }
}

/// README.md and all of `docs`.
fn pages() -> Vec<Page> {
    let mut paths = vec![PathBuf::from("README.md")];
    let mut folders = vec![PathBuf::from("docs")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(root().join(&folder)).unwrap() {
            let path = folder.join(entry.unwrap().file_name());
            match root().join(&path).is_dir() {
                true => folders.push(path),
                false if path.extension().is_some_and(|e| e == "md") => paths.push(path),
                false => {}
            }
        }
    }
    paths.sort();
    paths.iter().map(|path| Page::read(path)).collect()
}

/// Files of these folders that people write.
fn sources(of: &[&str]) -> Vec<PathBuf> {
    let mut left: Vec<PathBuf> = of.iter().map(|path| root().join(path)).collect();
    let mut files = Vec::new();
    while let Some(path) = left.pop() {
        if path.ends_with("tests/fuzz/corpus") {
            continue;
        }
        if path.is_dir() {
            left.extend(std::fs::read_dir(path).unwrap().map(|entry| entry.unwrap().path()));
        } else if path.extension().is_none_or(|e| ["rs", "py", "sh", "toml", "css", "md"].iter().any(|one| e == *one)) {
            files.push(path);
        }
    }
    files
}

fn hold(faults: Vec<String>) {
    assert!(faults.is_empty(), "\n{}", faults.join("\n"));
}

#[test]
fn the_readme_is_one_page() {
    let bytes = Page::read(Path::new("README.md")).text.len();
    assert!(bytes <= README_BYTES, "{bytes} bytes");
}

#[test]
fn lines_are_short() {
    let mut faults = Vec::new();
    for path in sources(&WRITTEN) {
        for (number, line) in std::fs::read_to_string(&path).unwrap().lines().enumerate() {
            if line.chars().count() > LONGEST_LINE && !line.starts_with('|') {
                faults.push(format!("{}:{}: {} characters", path.display(), number + 1, line.chars().count()));
            }
        }
    }
    for page in pages() {
        for (number, block, line) in page.lines() {
            // tables, links and output of the program may be longer
            let free = block == Some("text") || line.starts_with('|') || line.contains("](");
            if !free && line.chars().count() > LONGEST_LINE {
                faults.push(format!("{}:{number}: {} characters", page.path.display(), line.chars().count()));
            }
        }
    }
    hold(faults);
}

/// Links, pictures and anchors, of pages and of what they link to.
#[test]
fn links_lead_somewhere() {
    let mut faults = Vec::new();
    let results = sources(&["results"]).into_iter().filter(|path| path.extension().is_some_and(|e| e == "md"));
    let others = ["CHANGELOG.md", "CONTRIBUTING.md", "python/README.md"].map(|path| root().join(path));
    let others: Vec<Page> = others.into_iter().chain(results).map(|path| Page::read(&path)).collect();
    for page in pages().iter().chain(&others) {
        for (number, target) in page.links().into_iter().filter(|(_, target)| !target.starts_with("http")) {
            let (file, anchor) = target.split_once('#').map_or((target, None), |(file, anchor)| (file, Some(anchor)));
            let path = match file {
                "" => page.path.clone(),
                file => page.path.parent().unwrap().join(file),
            };
            let place = format!("{}:{number}: {target}", page.path.display());
            if !root().join(&path).exists() {
                faults.push(format!("{place}: is not there"));
            } else if anchor.is_some_and(|anchor| !Page::read(&path).anchors().contains(anchor)) {
                faults.push(format!("{place}: has no such heading"));
            }
        }
    }
    hold(faults);
}

/// Files and folders of the tree that documents and comments name.
#[test]
fn paths_that_are_named_are_there() {
    let roots = ["src/", "tests/", "benches/", "examples/", "docs/", "configs/", "results/"];
    let is_path = |span: &&str| {
        roots.iter().any(|root| span.starts_with(root))
            && span.chars().all(|c| c.is_alphanumeric() || ['/', '.', '_', '-'].contains(&c))
    };
    let mut faults = Vec::new();
    for file in [sources(&WRITTEN), sources(&["README.md", "docs", "results"])].concat() {
        for (number, line) in std::fs::read_to_string(&file).unwrap().lines().enumerate() {
            for path in line.split('`').skip(1).step_by(2).filter(is_path).filter(|path| !root().join(path).exists()) {
                faults.push(format!("{}:{}: {path} is not there", file.display(), number + 1));
            }
        }
    }
    hold(faults);
}

/// A guide shows what it describes, and pictures are small.
#[test]
fn guides_have_pictures() {
    let mut faults = Vec::new();
    for page in pages().iter().filter(|page| ["docs/howto", "docs/tutorials"].iter().any(|f| page.path.starts_with(f)))
    {
        if !page.text.contains("](../figures/") {
            faults.push(format!("{}: no picture", page.path.display()));
        }
    }
    let gallery = Path::new("docs/gallery.md");
    let all: String = pages().iter().filter(|page| page.path != gallery).map(|page| page.text.as_str()).collect();
    for entry in std::fs::read_dir(root().join("docs/figures")).unwrap() {
        let path = entry.unwrap().path();
        let (name, bytes) = (path.file_name().unwrap().to_str().unwrap(), path.metadata().unwrap().len());
        if bytes > 150_000 || !all.contains(&format!("figures/{name})")) {
            faults.push(format!("docs/figures/{name}: {bytes} bytes, or on no page but the gallery"));
        }
    }
    hold(faults);
}

/// The gallery has every picture.
#[test]
fn the_gallery_has_every_picture() {
    let gallery = Page::read(Path::new("docs/gallery.md")).text;
    let mut faults = Vec::new();
    for entry in std::fs::read_dir(root().join("docs/figures")).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        if !gallery.contains(&format!("](figures/{name})")) {
            faults.push(format!("docs/figures/{name}: not in docs/gallery.md"));
        }
    }
    hold(faults);
}

/// A glossary that is read from end to end.
#[test]
fn the_glossary_is_short() {
    let glossary = Page::read(Path::new("docs/glossary.md"));
    // without the head of the table and the line below it
    let terms = glossary.text.lines().filter(|line| line.starts_with("| ")).count() - 1;
    assert!(terms > 0 && terms <= GLOSSARY_TERMS, "{terms} terms");
}

#[test]
fn the_summary_lists_every_page() {
    let summary = Page::read(Path::new("docs/SUMMARY.md"));
    let listed: BTreeSet<PathBuf> = summary.links().iter().map(|(_, file)| Path::new("docs").join(file)).collect();
    let pages = pages().into_iter().map(|page| page.path);
    let there: BTreeSet<PathBuf> = pages.filter(|p| p.starts_with("docs") && *p != summary.path).collect();
    assert_eq!(listed, there);
}

#[test]
fn the_paths_through_the_code_are_there() {
    let page = std::fs::read_to_string(root().join("docs/reference/code.md")).unwrap();
    let mut calls = 0;
    for line in page.lines().filter(|line| line.starts_with("| `")) {
        let names: Vec<&str> = line.split('`').skip(1).step_by(2).collect();
        let source = std::fs::read_to_string(root().join(names[1])).unwrap_or_else(|e| panic!("{}: {e}", names[1]));
        let is_there = [format!("fn {}(", names[0]), format!("fn {}<", names[0])].iter().any(|f| source.contains(f));
        assert!(is_there, "no {} in {}", names[0], names[1]);
        calls += 1;
    }
    assert!(calls > 10);
}

#[test]
fn the_reference_of_the_config_is_that_of_the_schema() {
    let of_the_schema = reference::page(&serde_json::from_str(&config::schema()).unwrap());
    for (name, generated) in [("config.md", of_the_schema), ("instruments.md", reference::instruments())] {
        let path = root().join("docs/reference").join(name);
        if std::env::var_os("DIMCMC_WRITE_SCHEMA").is_some() {
            std::fs::write(&path, &generated).unwrap();
        }
        let page = std::fs::read_to_string(&path).unwrap();
        assert!(page == generated, "{name}: run the tests once with DIMCMC_WRITE_SCHEMA=1");
    }
}

#[test]
fn configs_resolve() {
    let mut configs = 0;
    for page in pages() {
        for block in page.blocks("json") {
            let place = page.path.display();
            config::from_json(block.as_bytes(), Path::new("star.json")).unwrap_or_else(|e| panic!("{place}: {e}"));
            configs += 1;
        }
    }
    assert!(configs >= 2);
    for entry in std::fs::read_dir(root().join("configs")).unwrap() {
        let path = entry.unwrap().path();
        if !path.to_str().unwrap().ends_with("schema.json") {
            config::Config::load(&path).unwrap().settings().unwrap().require_free().unwrap();
        }
    }
}

/// Commands and options that are not run: those of blocks marked `console`, and those named in sentences.
#[test]
fn commands_and_options_exist() {
    let commands = commands();
    let helps: BTreeMap<&str, String> = commands.iter().map(|name| (name.as_str(), help(&[name, "--help"]))).collect();
    let has = |help: &str, option: &str| help.split(|c: char| !(c.is_alphanumeric() || c == '-')).any(|o| o == option);
    let mut faults = Vec::new();
    for page in pages() {
        let place = |number: usize| format!("{}:{number}", page.path.display());
        let known = ["sh", "console", "text", "json", "python"];
        for (number, language, _) in page.lines() {
            if language.is_some_and(|language| !known.contains(&language)) {
                faults.push(format!("{}: a block of {language:?}", place(number)));
            }
        }
        let spans = page.code_spans().into_iter().chain(page.commands("console"));
        for (number, code) in spans {
            let words: Vec<&str> = code.split([' ', '|']).collect();
            if words[0] == "cargo" {
                let example = words.iter().skip_while(|word| **word != "--example").nth(1);
                let is_there = |name: &str| {
                    let paths = [format!("examples/{name}.rs"), format!("examples/{name}/main.rs")];
                    paths.iter().any(|path| root().join(path).exists())
                };
                if let Some(name) = example.filter(|name| **name != "NAME" && !is_there(name)) {
                    faults.push(format!("{}: no example {name}", place(number)));
                }
                continue;
            }
            let at = words.iter().position(|word| *word == "dimcmc");
            let name = at.and_then(|at| words.get(at + 1)).filter(|name| !name.starts_with('-'));
            if let Some(name) = name.filter(|name| **name != "COMMAND" && !helps.contains_key(**name)) {
                faults.push(format!("{}: no command {name}", place(number)));
            }
            let options = words[at.unwrap_or(0)..].iter().filter(|word| word.starts_with("--"));
            for option in options {
                let exists = match name.and_then(|name| helps.get(name)) {
                    Some(help) => has(help, option),
                    None => helps.values().any(|help| has(help, option)) || has(&help(&["--help"]), option),
                };
                if !exists {
                    faults.push(format!("{}: no option {option} in {code:?}", place(number)));
                }
            }
        }
    }
    hold(faults);
}

/// The small star as pages expect it: the list of its profiles and a config, and input of ZDIpy.
fn star() -> Desk {
    let desk = desk();
    desk.succeed(&["simulate", "configs/demo.json", "--out", "data"]);
    zdipy(&desk, "data");
    copy(&desk.path("data"), &desk.path(""));
    std::fs::remove_dir_all(desk.path("data")).unwrap();
    desk.succeed(&["init", "observations.txt", "--rotation-period", "3", "--inclination", "38"]);
    shorten(&desk);
    let mut changing = desk.json("star.json");
    changing["imaging"]["objective"] = json!("marginal-likelihood");
    desk.write("changing.json", &changing.to_string());
    desk
}

/// In place of the config of `init`: a coarse map, fixed hyperparameters of spots, no RV jitter or free systemic
/// velocity, and a short chain, which take a tenth of the time.
fn shorten(desk: &Desk) {
    let mut config = desk.json("star.json");
    config["imaging"]["pixels"] = json!(300);
    config["imaging"]["spot_amplitude"] = json!(0.2);
    config["imaging"]["spot_slope"] = json!(0.9);
    config["imaging"]["spot_lifetime_d"] = json!(20);
    config["observations"]["velocity_jitter_kms"] = json!(0.0);
    config["parameters"].as_object_mut().unwrap().remove("vsys_kms");
    config["sampler"] = short_chains();
    desk.write("star.json", &config.to_string());
}

/// Runs a page, and returns where.
fn run_page(page: &Page, star: &Desk) -> Desk {
    let desk = Desk::new(json!(null));
    copy(&star.path(""), &desk.path(""));
    let lines = page.commands("sh");
    if lines.iter().any(|(_, line)| line.starts_with("dimcmc init ")) {
        std::fs::remove_file(desk.path("star.json")).unwrap();
    }
    if page.path == Path::new("README.md") {
        std::fs::copy(root().join("configs/demo.json"), desk.path("configs/demo.json")).unwrap();
    }
    for (number, line) in lines {
        // `cargo` builds what is built already, and the tests are these
        if line == "cargo test --workspace" {
            continue;
        }
        let line = line.replace("cargo run --release -- ", "dimcmc ");
        println!("{}:{number}", page.path.display());
        let printed = run(&line, &desk);
        if line.starts_with("dimcmc init ") {
            shorten(&desk);
        }
        if page.path == Path::new("README.md") && line.contains("configs/demo.json") {
            demo_prints(page, &printed);
        }
    }
    desk
}

/// The README shows what the demo prints, to the last digit: on processors with AVX2, for others round otherwise.
fn demo_prints(readme: &Page, printed: &str) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        let shown = readme.blocks("text").remove(0);
        assert!(printed.starts_with(&shown), "the README shows\n{shown}\nand the demo prints\n{printed}");
    }
    let _ = (readme, printed);
}

#[test]
fn every_command_works_and_every_file_is_described() {
    let star = star();
    let pages = pages();
    let with_commands: Vec<&Page> = pages.iter().filter(|page| !page.commands("sh").is_empty()).collect();
    assert!(with_commands.len() >= 7, "{}", with_commands.len());
    let desks: Vec<Desk> = with_commands.par_iter().map(|page| run_page(page, &star)).collect();
    let mut described = Described::new();
    for desk in &desks {
        described.check(&desk.path(""));
    }
    let files = described.files.len();
    assert!(files >= 18, "{:?}", described.files);
    hold(described.faults.into_iter().collect());
}

/// `docs/reference/files.md` against files.
struct Described {
    /// What it says of each file.
    sections: BTreeMap<String, String>,
    /// Of keys that many files have, before the first file.
    common: String,
    /// Files that it describes and that there were.
    files: BTreeSet<String>,
    faults: BTreeSet<String>,
}

impl Described {
    fn new() -> Self {
        let text = Page::read(Path::new("docs/reference/files.md")).text;
        let mut parts = text.split("\n### `");
        let common = parts.next().unwrap().to_owned();
        let section = |part: &str| (part.split('`').next().unwrap().to_owned(), part.to_owned());
        let sections = parts.map(section).collect();
        Described { sections, common, files: BTreeSet::new(), faults: BTreeSet::new() }
    }

    /// All files of results below a folder.
    fn check(&mut self, folder: &Path) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_str().unwrap().to_owned();
            let is_config = ["changing.json", "config.json", "star.json", "zdipy.json"].contains(&name.as_str());
            match path.extension().and_then(|e| e.to_str()) {
                _ if path.is_dir() && name != "configs" && !name.ends_with(".zarr") => self.check(&path),
                Some("json" | "jsonl" | "csv") if !is_config && !name.contains("schema") => self.file(&name, &path),
                _ => {}
            }
        }
    }

    fn file(&mut self, name: &str, path: &Path) {
        let name = name.replace("_2.csv", ".csv");
        let Some(section) = self.sections.get(&name) else {
            self.faults.insert(format!("{name} is not described"));
            return;
        };
        let free = dimcmc::internals::model::Parameter::ALL.map(|parameter| parameter.name());
        for key in keys(&name, path) {
            let is_known = |key: &str| [section, &self.common].iter().any(|text| text.contains(&format!("`{key}`")));
            // the error of a number that is described
            let known = is_known(&key) || key.strip_prefix("sigma_").is_some_and(is_known);
            if !known && !free.contains(&key.as_str()) {
                self.faults.insert(format!("{name}: `{key}` is not described"));
            }
        }
        self.files.insert(name);
    }
}

/// Columns, or keys, but those of the config.
fn keys(name: &str, path: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(path).unwrap();
    let of = |json: &str| {
        let mut found = Vec::new();
        all_keys(&serde_json::from_str(json).unwrap(), &mut found);
        found
    };
    match name {
        // a matrix of numbers
        "covariance.csv" | "covariance_m2s2.csv" => Vec::new(),
        _ if name.ends_with(".csv") => text.lines().next().unwrap().split(',').map(str::to_owned).collect(),
        _ if name.ends_with(".jsonl") => of(text.lines().last().unwrap()),
        _ => of(&text),
    }
}

/// Keys of an object and of what is in it.
fn all_keys(value: &Value, found: &mut Vec<String>) {
    match value {
        Value::Array(items) => items.iter().for_each(|item| all_keys(item, found)),
        Value::Object(object) => {
            for (key, inside) in object {
                found.push(key.clone());
                if key != "config" {
                    all_keys(inside, found);
                }
            }
        }
        _ => {}
    }
}

/// The citation is of this version, and of the paper whose method it is.
#[test]
fn the_citation_is_up_to_date() {
    let citation = std::fs::read_to_string(root().join("CITATION.cff")).unwrap();
    let version = concat!("\nversion: ", env!("CARGO_PKG_VERSION"), "\n");
    for part in ["cff-version: 1.2.0\n", version, "doi: 10.1051/0004-6361/201525993\n", "volume: 584\n", "start: A84\n"]
    {
        assert!(citation.contains(part), "{part:?}");
    }
}

/// Every dependency is there for a reason, and the reason is written down.
#[test]
fn dependencies_are_listed() {
    let manifest = std::fs::read_to_string(root().join("Cargo.toml")).unwrap();
    let list = std::fs::read_to_string(root().join("docs/reference/dependencies.md")).unwrap();
    let sections = manifest.split("\n[").filter(|section| section.contains("dependencies]\n"));
    for line in sections.flat_map(|section| section.lines().skip(1)) {
        let Some((name, _)) = line.split_once(" = ") else { continue };
        assert!(list.contains(&format!("`{name}`")), "{name} is not in docs/reference/dependencies.md");
    }
}
