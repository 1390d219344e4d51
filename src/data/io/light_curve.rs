//! Light curves: the table of time, flux and sigma that is read, and that `dimcmc simulate` writes.

use super::FileError;
use super::atomic::{WriteError, write};
use super::csv::{Columns, Table};
use crate::surface::photometry::Flux;
use std::path::Path;

/// Columns of the table.
pub const COLUMNS: [&str; 3] = ["time", "flux", "sigma"];

/// Times beyond it (d) are a mistake, and so are fluxes.
const LARGEST: [f64; 2] = [1e9, 1e30];

/// Reads a light curve; in the order of time, whatever that of the table is.
///
/// # Errors
/// [`FileError`]: a file that cannot be read, has not these columns, or has numbers that are none of a light curve.
pub fn read(path: &Path) -> Result<Vec<Flux>, FileError> {
    let table = Columns::read(path)?;
    let missing = |name: &str| {
        let problem =
            format!("no column {name}: the first line must name the columns, {} among them", COLUMNS.join(", "));
        FileError::of(path, problem)
    };
    for name in COLUMNS {
        table.column(name).map_err(|_| missing(name))?;
    }
    let [time, flux, sigma] = COLUMNS;
    let times_d = table.column_within(time, [-LARGEST[0], LARGEST[0]])?;
    let positive = [f64::MIN_POSITIVE, LARGEST[1]];
    let (fluxes, sigmas) = (table.column_within(flux, positive)?, table.column_within(sigma, positive)?);
    let all = times_d.iter().zip(fluxes).zip(sigmas);
    let mut measured: Vec<Flux> =
        all.map(|((time_d, flux), sigma)| Flux { time_d: *time_d, flux: *flux, sigma: *sigma }).collect();
    measured.sort_by(|a, b| a.time_d.total_cmp(&b.time_d));
    Ok(measured)
}

/// Writes a light curve.
///
/// # Errors
/// A file that cannot be written.
pub fn write_to(path: &Path, measured: &[Flux]) -> Result<(), WriteError> {
    let mut table = Table::new(&COLUMNS);
    measured.iter().for_each(|one| table.row(&[one.time_d, one.flux, one.sigma]));
    write(path, &table.into_bytes())
}
