//! What a release needs: one version in all files, packages without results, and lists that name every workflow.

use crate::small::root;

const VERSION: &str = env!("CARGO_PKG_VERSION");

fn read(path: &str) -> String {
    std::fs::read_to_string(root().join(path)).unwrap_or_else(|e| panic!("{path}: {e}"))
}

/// `[workspace.package]` has the version; all crates take it from there, and files that cannot agree with it.
#[test]
fn the_version_is_written_once() {
    for path in ["Cargo.toml", "mpi/Cargo.toml", "python/Cargo.toml"] {
        let package = read(path);
        let package = package.split("\n[").find(|section| section.trim_start_matches('[').starts_with("package]"));
        assert!(package.unwrap().contains("\nversion.workspace = true\n"), "{path}: another version");
    }
    assert!(read("python/pyproject.toml").contains("\ndynamic = [\"version\"]\n"));
    for (path, line) in [
        ("Cargo.toml", format!("\nversion = \"{VERSION}\"\n")),
        ("Cargo.lock", format!("\nname = \"dimcmc\"\nversion = \"{VERSION}\"\n")),
        ("Cargo.lock", format!("\nname = \"dimcmc-mpi\"\nversion = \"{VERSION}\"\n")),
        ("Cargo.lock", format!("\nname = \"dimcmc-python\"\nversion = \"{VERSION}\"\n")),
        ("CITATION.cff", format!("\nversion: {VERSION}\n")),
        ("python/conda/recipe.yaml", format!("\n  version: {VERSION}\n")),
    ] {
        assert!(read(path).contains(&line), "{path}: no {:?}", line.trim());
    }
    let changelog = read("CHANGELOG.md");
    let headings = [format!("\n## [{VERSION}]"), format!("\n## [Unreleased] - {VERSION}\n")];
    assert!(headings.iter().any(|heading| changelog.contains(heading)), "CHANGELOG.md: no section {VERSION}");
}

/// The oldest Rust and the Pythons of the support policy are those that are tested.
#[test]
fn the_support_policy_is_what_is_tested() {
    let (policy, checks) = (read("CONTRIBUTING.md"), read(".github/workflows/checks.yml"));
    let manifest = read("Cargo.toml");
    let rust = manifest.split("\nrust-version = \"").nth(1).and_then(|rest| rest.split('"').next()).unwrap();
    assert!(policy.contains(&format!("| Rust | {rust} ")), "CONTRIBUTING.md: Rust {rust}");
    let pythons = checks.split("python: [").nth(1).and_then(|rest| rest.split(']').next()).unwrap();
    let pythons: Vec<&str> = pythons.split(", ").map(|version| version.trim_matches('"')).collect();
    let range = format!("| Python | {} to {},", pythons[0], pythons[pythons.len() - 1]);
    assert!(policy.contains(&range), "CONTRIBUTING.md: no {range:?}");
    assert!(read("python/pyproject.toml").contains(&format!("\nrequires-python = \">={}\"\n", pythons[0])));
}

/// The crate is small: nothing of these folders, which are most of the tree, gets into it.
#[test]
fn the_crate_has_no_results() {
    let manifest = read("Cargo.toml");
    let list = manifest.split_once("\ninclude = [").expect("a list of what is packed").1;
    let line = list.split_once(']').expect("its end").0;
    for folder in ["results", "docs", "tests", "benches", "examples", "paper"] {
        assert!(!line.contains(&format!("\"/{folder}")), "{line}");
    }
    // what the library is compiled with
    for path in ["/src", "/build.rs", "/CITATION.cff", "/configs/*.json", "/LICENSE-*"] {
        assert!(line.contains(&format!("\"{path}\"")), "{path} is not packed");
    }
}

/// The sources of the Python package have the manifest of the crate, and only the files that it packs: Cargo takes a
/// target whose file is missing if its path is given, and refuses it otherwise.
#[test]
fn targets_have_paths() {
    for section in read("Cargo.toml").split("\n[[").skip(1) {
        assert!(section.contains("\npath = \""), "[[{}", section.lines().take(2).collect::<Vec<_>>().join(" "));
    }
}

/// Two pages that whoever comes new reads before a change.
#[test]
fn contributing_is_short() {
    let lines = read("CONTRIBUTING.md").lines().count();
    assert!(lines <= 120, "{lines} lines");
}

/// Forms ask for what a fault is repeated with.
#[test]
fn forms_ask_for_config_profiles_and_version() {
    let forms = std::fs::read_dir(root().join(".github/ISSUE_TEMPLATE")).unwrap();
    let forms = forms.map(|entry| format!(".github/ISSUE_TEMPLATE/{}", entry.unwrap().file_name().to_str().unwrap()));
    let forms = forms.filter(|path| !path.ends_with("/config.yml")).chain([".github/pull_request_template.md".into()]);
    for path in forms {
        let form = read(&path).to_lowercase();
        for asked in ["config", "profiles", "dimcmc --version"] {
            assert!(form.contains(asked), "{path} does not ask for {asked}");
        }
    }
}
