//! The subject of a page: the star, and the number and times of the data.

use crate::data::io::csv::Columns;
use crate::data::io::lsd;
use crate::data::io::map::{FIT, MAP};
use crate::data::io::provenance::Measured;
use crate::data::io::saved::Saved;
use crate::figures::plot::PlotError;
use crate::numerics::text::escaped;
use crate::runs::origin;
use serde::Deserialize;
use serde_json::Value;
use std::path::Path;

/// The provenance that results have in common.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct About {
    /// The config with all defaults filled in.
    pub config: Option<Value>,
    version: Option<String>,
    /// Fingerprint of the observations.
    pub data_sha256: Option<String>,
    profiles: Option<usize>,
    time_span_d: Option<[f64; 2]>,
    /// Quantities measured from the observations.
    pub measured: Measured,
}

impl Saved for About {}

impl About {
    /// For the result in `folder` identified by `file`.
    pub fn read(folder: &Path, file: &'static str) -> Result<Self, PlotError> {
        Ok(match file {
            MAP => origin::read(folder, FIT)?,
            // tables have no provenance
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

/// Star and data of the result in `folder`. Empty for files without a star.
pub(super) fn lines(folder: &Path, about: &About) -> Vec<(String, String)> {
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
    let mut lines = vec![("Star".to_owned(), star.join(", "))];
    lines.extend(Data::of(folder, about).map(|data| ("Data".to_owned(), data.text())));
    let sets = about.measured.sets.iter().map(|set| ("Data set".to_owned(), set.line()));
    lines.extend(sets);
    lines
}

/// The name of the star in a config.
pub(super) fn given_name(config: &Value) -> Option<&str> {
    config.pointer("/star/name")?.as_str()
}

/// Generic names of folders, which do not name the star.
const GENERIC: [&str; 15] = [
    "data",
    "profiles",
    "observations",
    "obs",
    "lsd",
    "spectra",
    "runs",
    "results",
    "out",
    "output",
    "work",
    "tmp",
    "figures",
    "..",
    ".",
];

/// The name for a star without one: that of the folder of its profiles, or of its results, unless these have names such
/// as `data`; otherwise that of the result.
pub(super) fn name_from_folders(config: &Value, folder: &Path) -> String {
    let says = |name: &&str| !name.is_empty() && !name.starts_with('.') && !GENERIC.contains(name);
    let of = |path: Option<&Path>| {
        path.and_then(Path::file_name).and_then(|name| name.to_str()).filter(says).map(str::to_owned)
    };
    let list = config.pointer("/observations/path").and_then(Value::as_str).map(Path::new);
    let whole = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    let own = || whole.file_name().unwrap_or(folder.as_os_str()).to_string_lossy().into_owned();
    let name = of(list.and_then(Path::parent)).or_else(|| of(whole.parent())).unwrap_or_else(own);
    escaped(&name).into_owned()
}

/// The profiles: number, first and last time (d).
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
        let lines = lines(Path::new("absent"), &whole);
        assert_eq!(lines[0].1, "*P*_{rot} = 0.4232 d, *v* sin *i* = 67.7 km/s, *i* = 45°");
        assert_eq!(lines[1].1, "44 profiles from 2456892.4000 d to 2456894.6500 d, a span of 2.25 d");
        assert!(super::lines(Path::new("absent"), &About::default()).is_empty());
    }

    #[test]
    fn a_star_without_a_name_has_that_of_a_folder_that_says_something() {
        let config = |path: &str| json!({ "observations": { "path": path } });
        let name = |path: &str, folder: &str| name_from_folders(&config(path), Path::new(folder));
        assert_eq!(name("../data/lopeg/observations.txt", "/absent/runs/map"), "lopeg");
        assert_eq!(name("data/observations.txt", "/absent/au_mic/map"), "au_mic");
        assert_eq!(name("data/observations.txt", "/absent/runs/demo"), "demo");
        assert_eq!(name("observations.txt", "/absent/.tmp/run"), "run");
        let named = json!({ "star": { "name": "LO Peg" } });
        assert_eq!((given_name(&named), given_name(&json!({}))), (Some("LO Peg"), None));
    }
}
