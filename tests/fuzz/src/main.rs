//! One reader under AFL++: `DIMCMC_READER` is its name, `DIMCMC_RESULTS` a folder of results that may be written.
//!
//! `dimcmc-fuzz edits` turns bytes on standard input into the edits of a file of results that they stand for. Called by
//! the name `dimcmc` it is the program.

mod readers;

use serde_json::{Value, json};
use std::path::PathBuf;
use std::process::ExitCode;

fn main() -> ExitCode {
    if std::env::args().next().is_some_and(|name| name.ends_with("/dimcmc")) {
        return dimcmc::command_line(std::env::args_os()).into();
    }
    fuzz();
    ExitCode::SUCCESS
}

fn fuzz() {
    let of = |name: &str| std::env::var(name).unwrap_or_else(|_| panic!("{name} is not set"));
    let (reader, folder) = (of("DIMCMC_READER"), PathBuf::from(of("DIMCMC_RESULTS")));
    let is_input = readers::INPUTS.contains(&reader.as_str());
    let places = if is_input { Vec::new() } else { places(&reader, &folder) };
    let is_text = |bytes: &[u8]| is_input || bytes.starts_with(b"[[");
    let text = |bytes: &[u8]| if is_text(bytes) { bytes.to_vec() } else { edits(&places, bytes).into_bytes() };
    if std::env::args().nth(1).as_deref() == Some("edits") {
        let bytes = std::io::Read::bytes(std::io::stdin()).collect::<Result<Vec<u8>, _>>().expect("it is read");
        std::io::Write::write_all(&mut std::io::stdout(), &text(&bytes)).expect("it is written");
        return;
    }
    afl::fuzz!(|bytes: &[u8]| readers::read(&reader, &folder, &text(bytes)));
}

/// The pointers of a file of results; of long lists those of the first two and the last entry.
fn places(reader: &str, folder: &std::path::Path) -> Vec<String> {
    let bytes = std::fs::read(folder.join(reader)).expect("the results are there");
    let mut places = Vec::new();
    walk(&readers::taken_apart(reader, &bytes).expect("it is a file of results"), String::new(), &mut places);
    places
}

fn walk(value: &Value, place: String, places: &mut Vec<String>) {
    match value {
        Value::Object(all) => {
            for (key, value) in all {
                walk(value, format!("{place}/{}", key.replace('~', "~0").replace('/', "~1")), places);
            }
        }
        Value::Array(all) => {
            let ends = all.iter().enumerate().filter(|(k, _)| *k < 2 || k + 1 == all.len());
            ends.for_each(|(k, value)| walk(value, format!("{place}/{k}"), places));
            places.push(format!("{place}/-"));
        }
        _ => {}
    }
    places.push(place);
}

/// The edits that bytes stand for: three each, two for the place and one for the value.
fn edits(places: &[String], bytes: &[u8]) -> String {
    let values = [
        json!(0),
        json!(1),
        json!(-1),
        json!(2),
        json!(3),
        json!(0.5),
        json!(-0.5),
        json!(1e-300),
        json!(1e-9),
        json!(1e15),
        json!(1e99),
        json!(-1e99),
        json!(90),
        json!(360),
        json!(4_294_967_296_u64),
        json!(u64::MAX),
        json!(i64::MIN),
        json!(null),
        json!(true),
        json!(false),
        json!(""),
        json!("a"),
        json!("nan"),
        json!("inf"),
        json!("-1e99"),
        json!("\u{1b}[31m\n"),
        json!("\u{b1}\u{200b}\u{1f30d}"),
        json!([]),
        json!({}),
        json!([0]),
        json!([0, 1]),
        json!([1, 0]),
        json!([[]]),
        json!([null]),
        json!([1, 2, 3, 4, 5]),
        json!([[0, 0], [0, 0]]),
        json!(100),
        json!(1e5),
        json!(-90),
        json!(0.999999),
    ];
    let edit = |of: &[u8]| {
        let place = &places[(usize::from(of[0]) * 256 + usize::from(of[1])) % places.len()];
        match values.get(usize::from(of[2]) % (values.len() + 4)) {
            Some(value) => json!([place, value]),
            None => json!([place]),
        }
    };
    Value::from(bytes.chunks_exact(3).take(8).map(edit).collect::<Vec<_>>()).to_string()
}
