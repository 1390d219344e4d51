//! What the README and `configs/` show is what the program takes.

use dimcmc::internals::data::config;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// The code blocks of a language in the README.
fn blocks(language: &str) -> Vec<String> {
    let readme = std::fs::read_to_string(root().join("README.md")).unwrap();
    let fence = format!("```{language}\n");
    readme.split(&fence).skip(1).map(|rest| rest.split("```").next().unwrap().to_owned()).collect()
}

#[test]
fn the_config_of_the_readme_resolves() {
    let configs = blocks("json");
    assert_eq!(configs.len(), 1);
    let settings = config::from_json(configs[0].as_bytes(), Path::new("star.json")).unwrap();
    assert_eq!(settings.free.len(), 3);
}

#[test]
fn the_commands_of_the_readme_exist() {
    let known = [
        "init",
        "import",
        "schema",
        "completions",
        "man",
        "simulate",
        "inject",
        "limits",
        "map",
        "periodogram",
        "optimise",
        "sample",
        "analyse",
        "grid",
        "compare",
        "merge",
        "batch",
        "export",
        "reproduce",
        "plot",
        "report",
    ];
    let lines: Vec<String> = blocks("sh").iter().flat_map(|block| block.lines()).map(str::to_owned).collect();
    let commands = lines.iter().filter_map(|line| {
        let rest = line.strip_prefix("dimcmc ").or_else(|| line.strip_prefix("cargo run --release -- "))?;
        rest.split_whitespace().next()
    });
    let found: Vec<&str> = commands.collect();
    assert!(found.len() >= 6 && found.iter().all(|command| known.contains(command)), "{found:?}");
}

#[test]
fn shipped_configs_resolve() {
    for entry in std::fs::read_dir(root().join("configs")).unwrap() {
        let path = entry.unwrap().path();
        if !path.to_str().unwrap().ends_with("schema.json") {
            config::load(&path).unwrap().require_free().unwrap();
        }
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
    let contributing = std::fs::read_to_string(root().join("CONTRIBUTING.md")).unwrap();
    let sections = manifest.split("\n[").filter(|section| section.contains("dependencies]\n"));
    for line in sections.flat_map(|section| section.lines().skip(1)) {
        let Some((name, _)) = line.split_once(" = ") else { continue };
        assert!(contributing.contains(&format!("`{name}`")), "{name} is not in CONTRIBUTING.md");
    }
}
