//! `lightcurve.csv` and `indicators.csv`: light curves and activity indicators, and their prediction by the most
//! probable maps.

use crate::data::io::csv::Table;
use crate::surface::{FluxFit, ReadingFit, SurfaceMaps};

/// Name of the file, which is there where there are light curves.
pub const LIGHT_CURVES: &str = "lightcurve.csv";

/// Name of the file, which is there where there are indicators in use.
pub const INDICATORS: &str = "indicators.csv";

/// The tables of data other than profiles for these maps, with the names of their files.
pub fn tables(maps: &SurfaceMaps) -> Vec<(&'static str, Table)> {
    let light = (LIGHT_CURVES, light_curves as fn(&SurfaceMaps) -> Table, maps.light.len());
    let all = [light, (INDICATORS, indicators, maps.readings.len())];
    all.into_iter().filter(|(.., rows)| *rows > 0).map(|(name, table, _)| (name, table(maps))).collect()
}

/// Segments and bands are numbers from 1, flux is in units of the mean of its segment.
fn light_curves(maps: &SurfaceMaps) -> Table {
    let mut table = Table::new(&["time_d", "flux", "sigma", "model", "residual", "segment", "band"]);
    for FluxFit { curve, bin, model } in &maps.light {
        let numbers = [(bin.segment + 1) as f64, (curve + 1) as f64];
        table.row(&[&[bin.time_d, bin.flux, bin.sigma, *model, bin.flux - model][..], &numbers].concat());
    }
    table
}

/// Indicators are numbers from 1, in the order of the config.
fn indicators(maps: &SurfaceMaps) -> Table {
    let mut table = Table::new(&["time_d", "value", "sigma", "model", "residual", "indicator"]);
    for ReadingFit { indicator, time_d, value, sigma, model } in &maps.readings {
        table.row(&[*time_d, *value, *sigma, *model, value - model, (indicator + 1) as f64]);
    }
    table
}
