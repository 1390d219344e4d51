//! Files that fuzzing has kept (`tests/fuzz`), each handed to its reader: none may make it panic.

#[path = "../fuzz/src/readers.rs"]
mod readers;

use crate::shared;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// All files below a folder, in the order of their names.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut entries: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    entries.into_iter().flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

#[test]
fn no_kept_file_makes_its_reader_panic() {
    let desk = shared::desk();
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz/corpus");
    let fails = |file: &PathBuf| {
        let reader = file.parent().unwrap().strip_prefix(&corpus).unwrap().to_string_lossy().replace('\\', "/");
        let bytes = std::fs::read(file).unwrap();
        catch_unwind(AssertUnwindSafe(|| readers::read(&reader, &desk.path(""), &bytes))).is_err()
    };
    let failed: Vec<PathBuf> = files(&corpus).into_iter().filter(fails).collect();
    assert!(failed.is_empty(), "{failed:?}");
}

/// A reader quadratic in the length of a line takes hours for these.
#[test]
fn lines_of_any_length_are_read_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let began = std::time::Instant::now();
    let words = |n: usize, first: &str| (0..n).map(|k| format!("{first}{k} ")).collect::<String>();
    let rows: String = (0..11).map(|j| format!("{:.1} 0.9 0.001\n", -9.0 + 1.8 * f64::from(j))).collect();
    for title in [words(100_000, "word"), words(100_000, "(word"), format!("# {}", words(100_000, "[a"))] {
        for reader in ["profile", "light-curve", "indicator"] {
            readers::read(reader, folder.path(), format!("{title}\n{rows}").as_bytes());
        }
    }
    let columns = format!("time {} sigma\n{}\n", words(2_000, "c"), words(2_002, ""));
    readers::read("indicator", folder.path(), columns.as_bytes());
    readers::read("light-curve", folder.path(), columns.as_bytes());
    assert!(began.elapsed().as_secs() < 60, "{:?}", began.elapsed());
}
