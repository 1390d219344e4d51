//! Tells `dimcmc --version` the commit that it is built from, where there is git and this is its working tree.
//!
//! Runs again when the tree's HEAD moves, and never otherwise. Changes that are not committed are not told: nothing
//! would say when they come and go. A package from the registry has no commit, whatever repository it is unpacked in.

use std::path::Path;
use std::process::Command;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let commit = commit().map(|commit| format!(" ({commit})")).unwrap_or_default();
    println!("cargo::rustc-env=DIMCMC_COMMIT={commit}");
}

/// The abbreviated hash of HEAD, if this folder is the top of a repository.
fn commit() -> Option<String> {
    // not in a folder of some other repository
    if !Path::new(".git").exists() {
        return None;
    }
    let commit = git(&["rev-parse", "--short", "HEAD"])?;
    // the log of HEAD grows with every commit and checkout, also where branches are packed; HEAD itself does not
    for name in ["HEAD", "logs/HEAD"] {
        let path = git(&["rev-parse", "--git-path", name])?;
        // a file that is not there would count as changed at every build
        if Path::new(&path).exists() {
            println!("cargo::rerun-if-changed={path}");
        }
    }
    Some(commit)
}

fn git(args: &[&str]) -> Option<String> {
    let output = Command::new("git").args(args).output().ok().filter(|output| output.status.success())?;
    Some(String::from_utf8(output.stdout).ok()?.trim().to_owned()).filter(|text| !text.is_empty())
}
