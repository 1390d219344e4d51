//! A table of the stars: their groups, and the reliability of their signals.

use super::folders::SurveyError;
use super::star::Star;
use crate::data::io::FileError;
use crate::data::io::csv::Words;
use std::path::PathBuf;

/// A table of stars: their names in the column `name` or `star`, or else in the first.
#[derive(Clone, Debug, PartialEq)]
pub struct StarTable {
    /// The file (CSV).
    pub path: PathBuf,
    /// Column of the groups whose rates are requested.
    pub group: Option<String>,
    /// Column of the probability that the star's signal is a planet.
    pub reliability: Option<String>,
}

impl StarTable {
    /// Reads the data on `stars`.
    ///
    /// # Errors
    /// A table that cannot be read, without a column or a star, or with an invalid probability.
    pub(super) fn read_into(&self, stars: &mut [Star]) -> Result<(), SurveyError> {
        let table = Words::read(&self.path)?;
        let key = ["name", "star"].into_iter().find(|name| table.has(name)).unwrap_or(table.first());
        let names = table.column(key)?;
        let row = |star: &Star| names.iter().position(|name| *name == star.name);
        let missing: Vec<&str> =
            stars.iter().filter(|star| row(star).is_none()).map(|star| star.name.as_str()).collect();
        if !missing.is_empty() {
            let problem = format!("no row of {} in column {key}", missing.join(", "));
            return Err(FileError::of(&self.path, problem).into());
        }
        let rows: Vec<usize> = stars.iter().filter_map(row).collect();
        if let Some(column) = &self.group {
            let groups = table.column(column)?;
            for (star, row) in stars.iter_mut().zip(&rows) {
                star.group = Some(groups[*row].to_owned()).filter(|group| !group.is_empty());
            }
        }
        if let Some(column) = &self.reliability {
            let numbers = table.column(column)?;
            for (star, row) in stars.iter_mut().zip(&rows).filter(|(_, row)| !numbers[**row].is_empty()) {
                let number = numbers[*row].parse::<f64>().ok().filter(|number| (0.0..=1.0).contains(number));
                star.planet = number.ok_or_else(|| FileError::Line {
                    path: self.path.clone(),
                    line: table.line(*row),
                    problem: format!("{column}: {:?} is no probability from 0 to 1", numbers[*row]),
                })?;
            }
        }
        Ok(())
    }
}
