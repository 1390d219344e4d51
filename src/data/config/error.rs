//! Errors of a config: one line each, naming the file and the key. Messages of serde are translated for users here.

use crate::numerics::text::escaped;
use std::path::{Path, PathBuf};

/// Why a config was refused.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file could not be read.
    #[error("{}: cannot read: {source}", .path.display())]
    Read {
        /// The config.
        path: PathBuf,
        /// The message of the system.
        source: std::io::Error,
    },
    /// The file is not JSON.
    #[error("{}:{line}:{column}: invalid JSON: {problem}", .path.display())]
    Json {
        /// The config.
        path: PathBuf,
        /// Line (from 1).
        line: usize,
        /// Column (from 1).
        column: usize,
        /// The message of the parser.
        problem: String,
    },
    /// A key that does not exist.
    #[error("{}: unknown key {key}: {hint}", .path.display())]
    UnknownKey {
        /// The config.
        path: PathBuf,
        /// The key with all its parents, dotted.
        key: String,
        /// The key that was perhaps meant, or all allowed keys.
        hint: String,
    },
    /// A key whose value is wrong.
    #[error("{}: {key}: {problem}", .path.display())]
    Key {
        /// The config.
        path: PathBuf,
        /// The key with all its parents, dotted.
        key: String,
        /// What is wrong with it.
        problem: String,
    },
}

/// A fault of one key, before it is known which file it is in.
#[derive(Debug)]
pub(super) struct Fault {
    pub key: String,
    pub problem: String,
}

impl Fault {
    pub fn new(key: impl Into<String>, problem: impl Into<String>) -> Self {
        Fault { key: key.into(), problem: problem.into() }
    }

    /// The error for the config at `path`.
    pub fn within(self, path: &Path) -> ConfigError {
        ConfigError::Key { path: path.into(), key: self.key, problem: self.problem }
    }
}

impl ConfigError {
    /// The parser's complaint about the text as a whole.
    pub(super) fn json(path: &Path, error: &serde_json::Error) -> Self {
        let (line, column) = (error.line(), error.column());
        ConfigError::Json { path: path.into(), line, column, problem: one_line(&without_position(error)) }
    }

    /// The deserialiser's complaint about one key.
    pub(super) fn data(path: &Path, error: serde_path_to_error::Error<serde_json::Error>) -> Self {
        if !error.inner().is_data() {
            return ConfigError::json(path, error.inner());
        }
        let at = one_line(&error.path().to_string());
        let message = without_position(error.inner());
        let path = path.to_path_buf();
        if let Some(field) = quoted_after(&message, "missing field ") {
            return ConfigError::Key { path, key: below(&at, field), problem: "missing".into() };
        }
        if let Some(field) = quoted_after(&message, "duplicate field ") {
            return ConfigError::Key { path, key: below(&at, field), problem: "given twice".into() };
        }
        if message.starts_with("unknown field ") {
            let key = error.path().iter().next_back().map(ToString::to_string).unwrap_or_default();
            return ConfigError::UnknownKey { path, key: at, hint: hint(&key, &message) };
        }
        if let Some(value) = quoted_after(&message, "unknown variant ") {
            let problem = format!("unknown value {}: {}", one_line(value), hint(value, &message));
            return ConfigError::Key { path, key: at.trim_end_matches(&format!(".{value}")).into(), problem };
        }
        ConfigError::Key { path, key: at, problem: one_line(&in_the_users_words(&message)) }
    }
}

/// Keys that had another name: the old one and the new one.
const RENAMED: [(&str, &str); 1] = [("spots_left", "unresolved_spots")];

/// The new name of an old key, "did you mean X?", or all that is allowed, from the end of a message of serde's.
fn hint(given: &str, message: &str) -> String {
    if let Some((_, name)) = RENAMED.iter().find(|(old, _)| *old == given) {
        return format!("it is now called {name}");
    }
    let (_, expected) = message.rsplit_once(", expected ").unwrap_or_default();
    let allowed: Vec<&str> = expected.split('`').skip(1).step_by(2).collect();
    match nearest(given, &allowed) {
        Some(name) => format!("did you mean {name}?"),
        None => format!("must be one of {}", allowed.join(", ")),
    }
}

/// Similarity (Jaro-Winkler, which favours a common beginning) from which a name is suggested.
const SIMILAR: f64 = 0.75;

/// The candidate most similar to `given`, ignoring case, if one is similar enough.
fn nearest<'a>(given: &str, candidates: &[&'a str]) -> Option<&'a str> {
    let given = given.to_lowercase();
    let similarity = |name: &str| strsim::jaro_winkler(&given, &name.to_lowercase());
    let best = candidates.iter().map(|name| (similarity(name), *name)).max_by(|a, b| a.0.total_cmp(&b.0))?;
    (best.0 >= SIMILAR).then_some(best.1)
}

/// `invalid type: string "a", expected f64` -> `expected a number, found string "a"`.
fn in_the_users_words(message: &str) -> String {
    let Some((found, expected)) = message.rsplit_once(", expected ") else {
        return message.to_string();
    };
    let found = ["invalid type: ", "invalid value: "].iter().fold(found, |f, prefix| f.trim_start_matches(prefix));
    let found = match found.strip_prefix("invalid length ") {
        Some(length) => format!("length {length}"),
        None => found.to_string(),
    };
    let expected = match expected {
        "f64" => "a number".to_string(),
        "usize" | "u64" | "u32" => "a whole number, 0 or more".to_string(),
        e if e.starts_with("struct ") => "an object in braces".to_string(),
        e => e.replace("a tuple of size", "an array of length"),
    };
    match found.as_str() {
        "null" => format!("null marks a missing value: give {expected}"),
        _ => format!("expected {expected}, found {found}"),
    }
}

fn without_position(error: &serde_json::Error) -> String {
    let text = error.to_string();
    let position = format!(" at line {} column {}", error.line(), error.column());
    text.strip_suffix(&position).unwrap_or(&text).to_string()
}

fn quoted_after<'a>(message: &'a str, start: &str) -> Option<&'a str> {
    message.strip_prefix(start)?.split('`').nth(1)
}

fn below(parent: &str, field: &str) -> String {
    if parent == "." { field.to_string() } else { format!("{parent}.{field}") }
}

/// Text of the user in one line of bounded length, control characters escaped.
fn one_line(text: &str) -> String {
    const LONGEST: usize = 300;
    let mut short: String = escaped(text).chars().take(LONGEST + 1).collect();
    if let Some((cut, _)) = short.char_indices().nth(LONGEST) {
        short.truncate(cut);
        short.push_str("...");
    }
    short
}

#[cfg(test)]
mod tests {
    use super::nearest;

    #[test]
    fn near_names_are_found_and_far_ones_not() {
        let names = crate::model::Parameter::ALL.map(|p| p.name());
        for (given, expected) in [
            ("vsinni_kms", Some("vsini_kms")),
            ("K_kms", Some("k_kms")),
            ("k", Some("k_kms")),
            ("porb_over_rot", Some("porb_over_prot")),
            ("inclination", Some("inclination_deg")),
            ("gamma", None),
            ("", None),
        ] {
            assert_eq!(nearest(given, &names), expected, "{given}");
        }
    }
}
