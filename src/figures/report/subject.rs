//! What a page is about: the star, and the data in number and time.

use crate::data::io::csv::Columns;
use crate::data::io::lsd;
use crate::data::io::map::{FIT, MAP};
use crate::data::io::provenance::Measured;
use crate::figures::plot::PlotError;
use crate::runs::origin;
use serde::Deserialize;
use serde_json::Value;
use std::path::Path;

/// What all results say of where they came from, as far as they do.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct About {
    /// The config with all defaults filled in.
    pub config: Option<Value>,
    version: Option<String>,
    data_sha256: Option<String>,
    profiles: Option<usize>,
    time_span_d: Option<[f64; 2]>,
    measured: Measured,
}

impl About {
    /// Of the result in `folder` that is known by `file`.
    pub fn read(folder: &Path, file: &'static str) -> Result<Self, PlotError> {
        Ok(match file {
            MAP => origin::read(folder, FIT)?,
            // tables say nothing
            file if !file.ends_with(".json") => About::default(),
            file => origin::read(folder, file)?,
        })
    }

    /// Version of the program and fingerprint of the data.
    pub fn provenance(&self) -> Vec<(String, String)> {
        let entries = [("dimcmc", &self.version), ("SHA-256 of the observations", &self.data_sha256)];
        entries.into_iter().filter_map(|(label, text)| Some((label.to_owned(), text.clone()?))).collect()
    }
}

/// Star and data of the result in `folder`; `title` names what has no name of its own. Empty for files that say nothing
/// of a star.
pub(super) fn lines(folder: &Path, title: &str, about: &About) -> Vec<(String, String)> {
    let config = about.config.as_ref().unwrap_or(&Value::Null);
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
    lines.extend(Data::of(folder, about).map(|data| ("Data".to_owned(), data.text())));
    let sets = about.measured.sets.iter().map(|set| ("Data set".to_owned(), set.line()));
    lines.extend(sets);
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
    fn of(folder: &Path, about: &About) -> Option<Self> {
        let recorded = about.profiles.zip(about.time_span_d);
        recorded.map(|(profiles, span_d)| Data { profiles, span_d }).or_else(|| {
            let table = Columns::read(&folder.join("rv.csv")).ok();
            let times = table.and_then(|table| table.column("time_d").ok().map(<[f64]>::to_vec));
            Data::at(&times.or_else(|| {
                let read = lsd::read(&folder.join("observations.txt")).ok()?;
                Some(read.observations.times_d())
            })?)
        })
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
        let whole: About = serde_json::from_value(whole).unwrap();
        let lines = lines(Path::new("absent"), "run", &whole);
        assert_eq!(lines[0].1, "lopeg: *P*_{rot} = 0.4232 d, *v* sin *i* = 67.7 km/s, *i* = 45°");
        assert_eq!(lines[1].1, "44 profiles from 2456892.4000 d to 2456894.6500 d, a span of 2.25 d");
        assert!(super::lines(Path::new("absent"), "run", &About::default()).is_empty());
    }
}
