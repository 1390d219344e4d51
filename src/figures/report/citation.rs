//! The citation, from the CITATION.cff at the build of the program.

/// The file.
const CITATION: &str = include_str!("../../../CITATION.cff");

/// The value of a key of the file, the first after `section`.
fn value(section: &str, key: &str) -> Option<&'static str> {
    let rest = &CITATION[CITATION.find(section)?..];
    let line = rest.lines().find_map(|line| line.trim().trim_start_matches("- ").strip_prefix(key))?;
    Some(line.trim_start_matches(':').trim().trim_matches('"'))
}

/// The program: title and version.
pub(super) fn program() -> (&'static str, &'static str) {
    (
        value("title", "title").unwrap_or("dimcmc"),
        value("type: software", "version").unwrap_or(env!("CARGO_PKG_VERSION")),
    )
}

/// The paper on the method: authors, title, journal and DOI.
pub(super) fn paper() -> Paper {
    let get = |key| value("references:", key).unwrap_or_default();
    Paper { title: get("title"), journal: get("journal"), volume: get("volume"), start: get("start"), doi: get("doi") }
}

/// A paper.
pub(super) struct Paper {
    pub title: &'static str,
    pub journal: &'static str,
    pub volume: &'static str,
    pub start: &'static str,
    pub doi: &'static str,
}

#[test]
fn the_file_is_understood() {
    let (title, version) = program();
    assert_eq!((title, version), ("dimcmc: orbits of planets around spotted stars", env!("CARGO_PKG_VERSION")));
    let paper = paper();
    assert!(paper.title.starts_with("A maximum entropy approach"), "{}", paper.title);
    assert_eq!((paper.journal, paper.volume, paper.start), ("Astronomy & Astrophysics", "584", "A84"));
    assert_eq!(paper.doi, "10.1051/0004-6361/201525993");
}
