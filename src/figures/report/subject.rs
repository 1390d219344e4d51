//! What a page is about: the star, and the data in number and time.

use crate::data::io::csv::Columns;
use crate::data::io::lsd::{self, ReadOptions};
use serde_json::Value;
use std::path::Path;

/// Star and data of the result in `folder`, whose file says `whole`; `title` names what has no name of its own. Empty
/// for files that say nothing of a star.
pub(super) fn lines(folder: &Path, title: &str, whole: &Value) -> Vec<(String, String)> {
    let config = whole.get("config").unwrap_or(&Value::Null);
    let star: Vec<String> = [
        ("rotation_period_d", "*P*_{rot} = ", " d"),
        ("vsini_kms", "*v* sin *i* = ", " km/s"),
        ("inclination_deg", "*i* = ", "°"),
    ]
    .into_iter()
    .filter_map(|(key, symbol, unit)| {
        let value = config.pointer(&format!("/star/{key}"))?.as_f64()?;
        Some(format!("{symbol}{value}{unit}"))
    })
    .collect();
    if star.is_empty() {
        return Vec::new();
    }
    let mut lines = vec![("Star".to_owned(), format!("{}: {}", name(config).unwrap_or(title), star.join(", ")))];
    lines.extend(Data::of(folder, whole).map(|data| ("Data".to_owned(), data.text())));
    lines
}

/// The name of the folder with the profiles, which is mostly that of the star.
fn name(config: &Value) -> Option<&str> {
    let list = Path::new(config.pointer("/observations/path")?.as_str()?);
    list.parent()?.file_name()?.to_str().filter(|name| !name.is_empty() && *name != "..")
}

/// The profiles: how many, and from when to when (d).
#[derive(Clone, Copy, Debug, PartialEq)]
struct Data {
    profiles: usize,
    span_d: [f64; 2],
}

impl Data {
    /// From the file, or from a table or the profiles beside it.
    fn of(folder: &Path, whole: &Value) -> Option<Self> {
        Data::recorded(whole).or_else(|| {
            let table = Columns::read(&folder.join("rv.csv")).ok();
            let times = table.and_then(|table| table.column("time_d").ok().map(<[f64]>::to_vec));
            Data::at(&times.or_else(|| {
                let read = lsd::read(&folder.join("observations.txt"), &ReadOptions::default()).ok()?;
                Some(read.observations.times_d())
            })?)
        })
    }

    fn recorded(whole: &Value) -> Option<Self> {
        let span = whole.get("time_span_d")?;
        let end = |k: usize| span.get(k).and_then(Value::as_f64);
        let profiles = usize::try_from(whole.get("profiles")?.as_u64()?).ok()?;
        Some(Data { profiles, span_d: [end(0)?, end(1)?] })
    }

    fn at(times_d: &[f64]) -> Option<Self> {
        let span = |[first, last]: [f64; 2], time: &f64| [first.min(*time), last.max(*time)];
        let span_d = times_d.iter().fold([f64::INFINITY, f64::NEG_INFINITY], span);
        (span_d[0] <= span_d[1]).then_some(Data { profiles: times_d.len(), span_d })
    }

    fn text(&self) -> String {
        let Data { profiles, span_d: [first, last] } = self;
        format!("{profiles} profiles from {first:.4} d to {last:.4} d, a span of {:.2} d", last - first)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn star_and_data_are_named() {
        let star = json!({ "rotation_period_d": 0.4232, "vsini_kms": 67.7, "inclination_deg": 45.0 });
        let config = json!({ "star": star, "observations": { "path": "../data/lopeg/observations.txt" } });
        let whole = json!({ "config": config, "profiles": 44, "time_span_d": [2456892.4, 2456894.65] });
        let lines = lines(Path::new("absent"), "run", &whole);
        assert_eq!(lines[0].1, "lopeg: *P*_{rot} = 0.4232 d, *v* sin *i* = 67.7 km/s, *i* = 45°");
        assert_eq!(lines[1].1, "44 profiles from 2456892.4000 d to 2456894.6500 d, a span of 2.25 d");
        assert!(super::lines(Path::new("absent"), "run", &json!({ "names": [] })).is_empty());
    }
}
