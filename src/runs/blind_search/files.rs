//! The files of a blind search: `rv.csv`, `covariance.csv`, `periodogram.csv` (with a second planet
//! `periodogram_2.csv`) and `periodogram.json`.

use super::record::{FILE, PeriodogramFile};
use super::search::BlindSearch;
use crate::data::io::atomic::{WriteError, write, write_json, write_set};
use crate::data::io::csv::{DATA_SET, Table};
use crate::planets::periodogram::Search;
use crate::planets::periodogram::orbits::scan;
use nalgebra::{DMatrix, DVector};
use std::path::Path;

/// Columns of `periodogram.csv`.
const COLUMNS: [&str; 12] = [
    "period_d",
    "porb_over_prot",
    "frequency_per_d",
    "delta_ln_l",
    "k_kms",
    "sigma_k_kms",
    "phi",
    "sigma_phi",
    "k_upper95_kms",
    "window",
    "k_limit_kms",
    "k_limit95_kms",
];

/// Names of all files that a search may write.
pub const FILES: [&str; 5] = ["rv.csv", "covariance.csv", "periodogram.csv", "periodogram_2.csv", FILE];

impl BlindSearch<'_> {
    /// Names of the files, in the order in which they are written.
    pub fn files(&self) -> Vec<&'static str> {
        let second = self.detection.second.as_ref().map(|_| "periodogram_2.csv");
        ["rv.csv", "covariance.csv", "periodogram.csv"].into_iter().chain(second).chain([FILE]).collect()
    }

    /// Writes `rv.csv`, `covariance.csv`, `periodogram.csv` and `periodogram.json` into `folder`, which must exist;
    /// with a second planet `periodogram_2.csv`, too.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), WriteError> {
        write_set(folder, &|stage| self.fill(stage))
    }

    fn fill(&self, folder: &Path) -> Result<(), WriteError> {
        let (velocities, covariance) = self.velocities();
        write(&folder.join("rv.csv"), &self.rv(&velocities, &covariance).into_bytes())?;
        write(&folder.join("covariance.csv"), matrix(&covariance).as_bytes())?;
        write(&folder.join("periodogram.csv"), &self.first_periodogram().into_bytes())?;
        if let Some(second) = &self.detection.second {
            write(&folder.join("periodogram_2.csv"), &self.periodogram(&second.search).into_bytes())?;
        }
        write_json(&folder.join(FILE), &PeriodogramFile::of(self))
    }

    /// The table of results, and of quantities measured from the observations.
    pub fn table(&self) -> String {
        PeriodogramFile::of(self).printed()
    }

    /// Velocities (km/s) and their covariance (km^2/s^2) in the last expansion; NaN where the data do not bound them.
    /// Velocities common to the profiles, systemic velocity, RV offsets and drift, are subtracted, and held in the
    /// covariance.
    fn velocities(&self) -> (DVector<f64>, DMatrix<f64>) {
        let held = &self.detection.last().held;
        let n = held.len();
        let missing = |_| (DVector::from_element(n, f64::NAN), DMatrix::from_element(n, n, f64::NAN));
        let (velocities, covariance) = held.radial_velocities().unwrap_or_else(missing);
        match &self.constants {
            Some(constants) => (velocities - &constants.of_each_kms, covariance),
            None => (velocities, covariance),
        }
    }

    fn rv(&self, velocities: &DVector<f64>, covariance: &DMatrix<f64>) -> Table {
        let moments = ["first_moment_kms", "first_moment_sigma_kms", "filtered_kms"];
        let set_of = self.scene.imager.set_of_each();
        let sets: &[&str] = if set_of.is_empty() { &[] } else { &[DATA_SET] };
        let mut table = Table::new(&[&["time_d", "cycle", "rv_kms", "rv_sigma_kms"][..], &moments, sets].concat());
        for (k, v) in self.planet_free.velocities.iter().enumerate() {
            let (rv, sigma) = (velocities[k], covariance[(k, k)].sqrt());
            let moment = v.observed;
            let mut row = vec![v.time_d, v.cycle, rv, sigma, moment.value_kms, moment.sigma_kms, v.filtered_kms()];
            row.extend(set_of.get(k).map(|s| *s as f64));
            table.row(&row);
        }
        table
    }

    /// The periodogram of the first search, including Delta ln L of the regularised likelihood.
    fn first_periodogram(&self) -> Table {
        let found = &self.detection;
        let regularised = found.known.beside(&found.planet_free.regularised);
        let regularised = scan(&regularised, &found.frequencies.per_cycle);
        let mut table = Table::new(&[&COLUMNS[..], &["regularised_delta_ln_l"]].concat());
        for (mut numbers, trial) in self.rows(&found.blind).zip(regularised) {
            numbers.push(trial.orbit.map_or(f64::NAN, |orbit| orbit.delta_ln_l));
            table.row(&numbers);
        }
        table
    }

    fn periodogram(&self, search: &Search) -> Table {
        let mut table = Table::new(&COLUMNS);
        self.rows(search).for_each(|numbers| table.row(&numbers));
        table
    }

    /// The values under [`COLUMNS`].
    fn rows<'a>(&self, search: &'a Search) -> impl Iterator<Item = Vec<f64>> + 'a {
        let rotation_period_d = self.scene.imager.star.rotation_period_d;
        search.rows.iter().map(move |row| {
            let frequency = row.trial.frequency;
            let mut numbers = vec![rotation_period_d / frequency, 1.0 / frequency, frequency / rotation_period_d];
            match row.trial.orbit {
                Some(o) => numbers.extend([o.delta_ln_l, o.k_kms, o.sigma_k_kms, o.phi, o.sigma_phi]),
                None => numbers.extend([f64::NAN; 5]),
            }
            let or_missing = |x: Option<f64>| x.unwrap_or(f64::NAN);
            let (upper, fair, safe) = (row.k_upper95_kms, row.k_limit50_kms, row.k_limit95_kms);
            numbers.extend([or_missing(upper), row.window, or_missing(fair), or_missing(safe)]);
            numbers
        })
    }
}

/// Rows of comma-separated numbers, without a header.
fn matrix(m: &DMatrix<f64>) -> String {
    let row = |k: usize| m.row(k).iter().map(f64::to_string).collect::<Vec<_>>().join(",") + "\n";
    (0..m.nrows()).map(row).collect()
}
