//! Many stars together: the completeness of a sample, and the rate of planets in it.
//!
//! In: folders of searches and of detection limits. `folders` matches them star by star, `star` is one star with both,
//! `table` reads a table of the stars. Out: [`file`]'s `survey.csv`, `completeness.csv`, `survey.json`. The statistics
//! are in `planets::occurrence`.

mod boxes;
mod file;
mod folders;
mod rates;
mod star;
mod table;

pub use boxes::{PlanetBox, Size};
pub use file::{BoxRecord, COMPLETENESS, CSV, JSON, StarRecord, SurveyFile};
pub use folders::SurveyError;
pub use rates::{RateRecord, SignalRecord};
pub use table::StarTable;

use crate::data::io::atomic::WriteError;
use crate::planets::occurrence::RatePrior;
use std::path::{Path, PathBuf};

/// Settings of a survey.
#[derive(Clone, Debug, PartialEq)]
pub struct SurveySettings {
    /// Boxes whose rate of planets is requested; those of hot Jupiters where there are none.
    pub boxes: Vec<PlanetBox>,
    /// Prior of each rate.
    pub prior: RatePrior,
    /// Further data on the stars.
    pub table: Option<StarTable>,
}

impl Default for SurveySettings {
    fn default() -> Self {
        SurveySettings { boxes: vec![PlanetBox::HOT_JUPITERS], prior: RatePrior::Uniform, table: None }
    }
}

/// A sample of stars with its rates.
#[derive(Clone, Debug)]
pub struct Survey {
    stars: Vec<star::Star>,
    file: SurveyFile,
}

impl Survey {
    /// From the results in `folders`, and in folders inside these.
    ///
    /// # Errors
    /// [`SurveyError`]: a star without search or limits, inconsistent results, files that are wrong.
    pub fn of(folders: &[PathBuf], settings: &SurveySettings) -> Result<Self, SurveyError> {
        let mut stars = folders::stars(folders)?;
        if let Some(table) = &settings.table {
            table.read_into(&mut stars)?;
        }
        if let Some(planets) = settings.boxes.iter().find(|planets| planets.size == Size::Mass) {
            let without = stars.iter().filter(|star| star.mass_msun.is_none()).map(|star| star.name.as_str());
            let without: Vec<&str> = without.collect();
            if !without.is_empty() {
                let problem = format!("needs star.mass_msun in the config of {}", without.join(", "));
                return Err(SurveyError::Sample(format!("--mass-box {planets}: {problem}")));
            }
        }
        let file = SurveyFile::new(&stars, settings);
        Ok(Survey { stars, file })
    }

    /// Writes `survey.csv`, `completeness.csv` and `survey.json` into `folder`, which must exist.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), WriteError> {
        self.file.write(&self.stars, folder)
    }

    /// The printed output.
    pub fn table(&self) -> String {
        self.file.table()
    }
}
