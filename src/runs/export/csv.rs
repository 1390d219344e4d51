//! Comma-separated text for pandas and other programs: one row per line of the chain, in the same order.
//!
//! `warmup` is true for the steps that `analyse` discards. Values are those of the chain, digit by digit; a periodic
//! parameter is not unwrapped. `move` is empty at step 0. Derived quantities are in the last columns.

use super::place::begins_with;
use super::{Contents, DerivedQuantity};
use crate::data::io::atomic::{self, WriteError};
use crate::data::io::csv::Table;
use serde::Serialize;
use std::path::Path;

/// Columns before the parameters.
const FIRST: [&str; 4] = ["ensemble", "step", "walker", "warmup"];

/// Whether the file may be an earlier export: whether its first columns are these.
pub fn is_own(file: &Path) -> bool {
    begins_with(file, FIRST.join(",").as_bytes())
}

/// Writes the file.
///
/// # Errors
/// A file that cannot be written.
pub fn write(contents: &Contents, file: &Path) -> Result<(), WriteError> {
    let after = ["accepted", "status", "move", "proposed", "model_applications"];
    let derived = contents.derived.iter().map(DerivedQuantity::name);
    let columns = FIRST.into_iter().chain(contents.names()).chain(["log_prob"]).chain(contents.numbers());
    let columns: Vec<&str> = columns.chain(after).chain(derived).collect();
    let mut table = Table::new(&columns);
    for record in contents.chain.records() {
        let warmup = record.step < contents.summary.discarded_steps;
        let place =
            [record.ensemble.to_string(), record.step.to_string(), record.walker.to_string(), warmup.to_string()];
        let values = record.theta.iter().chain([&record.log_prob]).chain(&record.numbers).map(f64::to_string);
        let outcome = [
            record.accepted.to_string(),
            word(&record.status),
            record.by.map_or_else(String::new, |by| by.name().to_owned()),
            word(&record.proposed),
            record.model_applications.to_string(),
        ];
        let derived = contents.derived.iter().map(|one| one.settled.value(&record.theta).to_string());
        table.cells(place.into_iter().chain(values).chain(outcome).chain(derived));
    }
    atomic::write(file, &table.into_bytes())
}

/// The word for it in the chain.
fn word(value: &impl Serialize) -> String {
    serde_json::to_value(value).ok().and_then(|value| value.as_str().map(str::to_owned)).unwrap_or_default()
}
