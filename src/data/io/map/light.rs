//! `lightcurve.csv`: light curves and what the most probable maps make of them.

use crate::data::io::csv::Table;
use crate::surface::FluxFit;

/// Name of the file, which is there where there are light curves.
pub const LIGHT_CURVES: &str = "lightcurve.csv";

/// Its columns: segments and bands are numbers from 1, flux is in units of the mean of its segment.
const COLUMNS: [&str; 7] = ["time_d", "flux", "sigma", "model", "residual", "segment", "band"];

/// The table.
pub(super) fn table(fits: &[FluxFit]) -> Table {
    let mut table = Table::new(&COLUMNS);
    for FluxFit { curve, bin, model } in fits {
        let numbers = [(bin.segment + 1) as f64, (curve + 1) as f64];
        table.row(&[&[bin.time_d, bin.flux, bin.sigma, *model, bin.flux - model][..], &numbers].concat());
    }
    table
}
