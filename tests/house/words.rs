//! The field's words: phrases of this house, which readers stumble over, are refused in all that users read.
//!
//! Read are pages and results outside of code, docstrings of the Python package, `--help` of every command, and string
//! literals and comments of `src`.

use crate::small::{commands, help, root};
use std::path::{Path, PathBuf};

/// Phrases, and what to write. Each was found to puzzle readers; a phrase with an ordinary meaning has no place here.
const HOUSE_WORDS: &[(&str, &str)] = &[
    ("zero point", "RV jitter (per profile), RV offset (per data set), time system"),
    ("for ever", "static"),
    ("takes for granted", "assumes"),
    ("taken for granted", "assumed"),
    ("leaves over", "residual"),
    ("left over", "residual"),
    ("told from", "distinguished from"),
    ("tells from", "distinguishes from"),
    ("told apart", "distinguished"),
    ("is said", "is reported"),
    ("are said", "are reported"),
    ("as it is", "unchanged"),
    ("as they are", "unchanged"),
    ("of its own", "its own"),
    ("of their own", "their own"),
    ("whole way", "full pipeline"),
    ("all the way", "pure"),
    ("put in", "injected"),
    ("put into", "injected into"),
    ("puts in", "injects"),
    ("found again", "recovered"),
    ("held against", "compared with"),
    ("on a circle", "circular orbit"),
    ("on an ellipse", "Keplerian orbit"),
    ("two circles", "two circular orbits"),
    ("landscape", "likelihood grid"),
    ("integrated maps", "evolving maps"),
    ("integrated over", "marginalised over"),
    ("integrated out", "marginalised over"),
    ("integrates out", "marginalises over"),
    ("integrate out", "marginalise over"),
    ("the process", "quasi-periodic GP"),
    ("stars that change", "evolving spots"),
    ("star that changes", "evolving spots"),
    ("star that does not change", "static map"),
    ("hangs on", "depends on"),
    ("hang on", "depend on"),
    ("is worth", "name the quantity"),
    ("anew", "again"),
    ("afresh", "again"),
    ("comes to the same", "is identical"),
    ("goes by", "uses"),
    ("stands in place", "replaces"),
    ("stand in for", "mimic"),
    ("speaks against", "caveat"),
    ("planet is needed", "no significant signal"),
    ("false alarms", "FAP"),
    ("profiles tell", "profiles constrain"),
    ("data tell", "data constrain"),
    ("tells nothing", "does not constrain"),
    ("nobody", "name who"),
    ("shortcut", "linearised"),
    ("believe", "name the evidence"),
    ("paper's own", "name the method"),
    ("truer", "more accurate"),
    ("as ever", "delete"),
    ("beyond sense", "out of range"),
    ("a map a", "per"),
    ("a line a", "per"),
    ("a row a", "per"),
    ("a star a", "per"),
];

/// Folders whose comments are excluded: these docstrings are part of the config's schema.
const COMMENTS_NOT_YET: [&str; 1] = ["src/data/config/written"];

/// A text that users read: where it is, its first line there, and its words without code and names of files.
struct Text {
    place: String,
    line: usize,
    words: String,
}

/// House words of `text`, with what to write.
fn house_words(text: &str) -> Vec<(&'static str, &'static str)> {
    let text = text.to_lowercase();
    let is_whole = |at: usize, end: usize| {
        let inside = |c: char| c.is_alphanumeric() || ['_', '/', '-'].contains(&c);
        let after = text[end..].strip_prefix('s').unwrap_or(&text[end..]);
        // `landscape.jsonl` is the name of a file
        let file = after.strip_prefix('.').is_some_and(|rest| rest.starts_with(char::is_alphabetic));
        !text[..at].ends_with(inside) && !after.starts_with(inside) && !file
    };
    let is_there =
        |phrase: &&(&str, &str)| text.match_indices(phrase.0).any(|(at, _)| is_whole(at, at + phrase.0.len()));
    HOUSE_WORDS.iter().filter(is_there).copied().collect()
}

/// Text without what stands between `open` and `close`.
fn without(text: &str, open: &str, close: &str) -> String {
    let mut kept = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once(open) {
        kept += before;
        kept += " ";
        rest = after.split_once(close).map_or("", |(_, after)| after);
    }
    kept + rest
}

/// Paragraphs of a page, and what the program prints on it.
fn paragraphs(path: &Path) -> Vec<Text> {
    let mut texts: Vec<Text> = Vec::new();
    let (mut block, mut open) = (None, false);
    for (number, line) in read(path).lines().enumerate() {
        match (line.strip_prefix("```"), block.is_some()) {
            (Some(language), false) => block = Some(language.to_owned()),
            (Some(_), true) => block = None,
            (None, _) if block.as_deref().is_some_and(|language| language != "text") || line.starts_with("    ") => {}
            (None, _) if open && !line.is_empty() => {
                let text = texts.last_mut().expect("a paragraph that is open");
                text.words += " ";
                text.words += line.trim();
                continue;
            }
            (None, _) if !line.is_empty() => {
                texts.push(Text { place: path.display().to_string(), line: number + 1, words: line.to_owned() });
                open = true;
                continue;
            }
            _ => {}
        }
        open = false;
    }
    for text in &mut texts {
        text.words = without(&without(&text.words, "](", ")"), "`", "`");
    }
    texts
}

/// String literals of a source of at least three words, `{}` left out; what follows its tests is not read.
fn literals(path: &Path) -> Vec<Text> {
    let source = read(path);
    let code = source.split("#[cfg(test)]\nmod tests").next().unwrap();
    let mut texts = Vec::new();
    let mut rest = code;
    while let Some(at) = rest.find(['"', '\'', '/']) {
        let (sign, line) = (&rest[at..], code[..code.len() - rest.len() + at].lines().count());
        let raw = rest[..at].ends_with("r#") || rest[..at].ends_with("b'") || rest[..at].ends_with('r');
        rest = if sign.starts_with("//") {
            sign.find('\n').map_or("", |end| &sign[end..])
        } else if sign.starts_with('"') {
            let end = closing(sign, raw);
            let words = without(&without(&sign[1..end].replace("\\\n", " "), "{", "}"), "`", "`");
            let words = words.split_whitespace().collect::<Vec<_>>().join(" ");
            if words.split(' ').count() >= 3 {
                texts.push(Text { place: path.display().to_string(), line, words });
            }
            &sign[end + 1..]
        } else if let Some(after) = ["'\"'", "'\\''", "'\\\\'", "'/'"].iter().find_map(|c| sign.strip_prefix(*c)) {
            after
        } else {
            &sign[1..]
        };
    }
    texts
}

/// Comments of a source without code in backticks; successive lines are one text.
fn comments(path: &Path) -> Vec<Text> {
    let mut texts: Vec<Text> = Vec::new();
    let mut open = false;
    for (number, line) in read(path).lines().enumerate() {
        let Some(comment) = line.trim_start().strip_prefix("//") else {
            open = false;
            continue;
        };
        let words = comment.trim_start_matches(['/', '!']).trim();
        if open {
            let text = texts.last_mut().expect("a text that is open");
            text.words += " ";
            text.words += words;
        } else {
            texts.push(Text { place: path.display().to_string(), line: number + 1, words: words.to_owned() });
            open = true;
        }
    }
    for text in &mut texts {
        text.words = without(&text.words, "`", "`");
    }
    texts
}

/// Where the literal that begins `text` ends.
fn closing(text: &str, raw: bool) -> usize {
    let mut escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        match c {
            '"' if !escaped => return at,
            '\\' if !raw => escaped = !escaped,
            _ => escaped = false,
        }
    }
    panic!("a literal has no end: {}", &text[..text.len().min(80)]);
}

/// Docstrings of a Python file.
fn docstrings(path: &Path) -> Vec<Text> {
    let source = read(path);
    let parts = source.split("\"\"\"").enumerate();
    let mut line = 1;
    let mut texts = Vec::new();
    for (number, part) in parts {
        if number % 2 == 1 {
            let words = part.split_whitespace().collect::<Vec<_>>().join(" ");
            texts.push(Text { place: path.display().to_string(), line, words });
        }
        line += part.matches('\n').count();
    }
    texts
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(root().join(path)).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Files below a folder that end in `extension`, relative to the root.
fn files(folder: &str, extension: &str) -> Vec<PathBuf> {
    let mut left = vec![PathBuf::from(folder)];
    let mut found = Vec::new();
    while let Some(path) = left.pop() {
        if root().join(&path).is_dir() {
            let entries = std::fs::read_dir(root().join(&path)).unwrap();
            left.extend(entries.map(|entry| path.join(entry.unwrap().file_name())));
        } else if path.extension().is_some_and(|e| e == extension) {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// All that users read.
fn texts() -> Vec<Text> {
    let pages = ["README.md", "CHANGELOG.md", "CONTRIBUTING.md", "python/README.md"].map(PathBuf::from);
    let pages = pages.into_iter().chain(files("docs", "md")).chain(files("results", "md")).chain(files("paper", "md"));
    let sources = files("src", "rs").into_iter();
    let helps = commands().into_iter().map(|name| {
        let words = help(&[name.as_str(), "--help"]).split_whitespace().collect::<Vec<_>>().join(" ");
        Text { place: format!("dimcmc {name} --help"), line: 1, words }
    });
    let pages = pages.flat_map(|path| paragraphs(&path));
    let sources = sources.flat_map(|path| literals(&path));
    let python = files("python/dimcmc", "py").into_iter().flat_map(|path| docstrings(&path));
    pages.chain(sources).chain(python).chain(helps).collect()
}

#[test]
fn help_fits_a_page() {
    let all = commands().into_iter().map(|name| vec![name, "--help".to_owned()]).chain([vec!["--help".to_owned()]]);
    for args in all {
        let printed = help(&args.iter().map(String::as_str).collect::<Vec<_>>());
        let long: Vec<&str> = printed.lines().filter(|line| line.chars().count() > 120).collect();
        assert!(long.is_empty(), "{args:?}: {long:#?}");
    }
}

#[test]
fn users_read_the_words_of_the_field() {
    let mut faults = Vec::new();
    let texts = texts();
    assert!(texts.len() > 1000, "{}", texts.len());
    for Text { place, line, words } in &texts {
        for (found, better) in house_words(words) {
            faults.push(format!("{place}:{line}: {found:?}; better: {better}"));
        }
    }
    assert!(faults.is_empty(), "\n{}", faults.join("\n"));
}

#[test]
fn comments_use_plain_words() {
    let sources = files("src", "rs").into_iter();
    let sources = sources.filter(|path| !COMMENTS_NOT_YET.iter().any(|folder| path.starts_with(folder)));
    let texts: Vec<Text> = sources.flat_map(|path| comments(&path)).collect();
    assert!(texts.len() > 1000, "{}", texts.len());
    let mut faults = Vec::new();
    for Text { place, line, words } in &texts {
        for (found, better) in house_words(words) {
            faults.push(format!("{place}:{line}: {found:?}; better: {better}"));
        }
    }
    assert!(faults.is_empty(), "\n{}", faults.join("\n"));
}

/// The search finds phrases in every kind of text, and no others.
#[test]
fn house_words_are_seen() {
    let found = |text: &str| house_words(text).into_iter().map(|(phrase, _)| phrase).collect::<Vec<_>>();
    assert_eq!(found("Zero points of 0.1 km/s live for ever."), ["zero point", "for ever"]);
    assert_eq!(found("in landscape.jsonl and the forever_map"), [""; 0]);
    assert_eq!(without("the `zero point` of", "`", "`"), "the   of");
    let desk = crate::desk::Desk::new(serde_json::json!(null));
    desk.write("page.md", "A map that\nleaves over spots, `for ever`.\n\n```sh\nput in\n```\n");
    desk.write(
        "source.rs",
        "// anew\nlet a = ('\"', \"no planet \\\n    is needed {anew}\", '\\'');\n#[cfg(test)]\nmod tests {}\n",
    );
    let page = paragraphs(&desk.path("page.md"));
    assert_eq!(page.iter().flat_map(|text| found(&text.words)).collect::<Vec<_>>(), ["leaves over"]);
    let source = literals(&desk.path("source.rs"));
    assert_eq!(source.iter().flat_map(|text| found(&text.words)).collect::<Vec<_>>(), ["planet is needed"]);
    let source = comments(&desk.path("source.rs"));
    assert_eq!(source.iter().flat_map(|text| found(&text.words)).collect::<Vec<_>>(), ["anew"]);
}
