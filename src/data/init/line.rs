//! Line and continuum from a first look, as values of a config: the level of the continuum, the width of the local
//! line, and the velocity range of the line with some continuum on both sides.

use super::digits::rounded;
use super::known::Known;
use super::ledger::{Ledger, Source, origin};
use crate::surface::calibration::first_look::{FirstLook, LineModel};

/// The velocity range includes this many bins, and this many observed line widths, of the continuum on either side.
const CONTINUUM: (f64, f64) = (6.0, 2.0);

/// A line width is poorly determined where its error is more than this share of it.
const POORLY: f64 = 0.25;

/// The level of the continuum, where it is not 1.
pub(super) fn note_continuum(level: f64, error: f64, ledger: &mut Ledger) {
    let remark = format!("level of the continuum beside the line, ± {error:.0e}: profiles are divided by it");
    ledger.note("observations.continuum_level", level, "", Source::Data, remark);
}

/// Width of the local line: given, or from the flanks of the mean profile.
pub(super) fn sigma_kms(look: &FirstLook, line: LineModel, known: &Known, ledger: &mut Ledger) -> f64 {
    let (sigma, error) = (look.unspotted.line_sigma_kms, look.line_sigma_error_kms.unwrap_or(0.0));
    let (source, remark) = match error > POORLY * sigma {
        true => (
            Source::Assumed,
            format!(
                "± {error:.1}: hardly distinguished from vsini, default {} as a prior; --line-sigma",
                line.sigma_kms
            ),
        ),
        false => (Source::Data, format!("± {error:.1}, local line, by the flanks of the mean profile; --line-sigma")),
    };
    ledger.settle(("star.line.sigma_kms", "km/s"), &known.line_sigma_kms, (rounded(sigma, 1), source, remark.as_str()))
}

/// The line with some continuum on both sides, as far as the profiles reach.
pub(super) fn velocity_range(
    look: &FirstLook,
    line: LineModel,
    step_kms: f64,
    known: &Known,
    ledger: &mut Ledger,
) -> (f64, f64) {
    let total_kms = look.unspotted.line_sigma_kms.hypot(line.instrumental_sigma_kms);
    let (bins, widths) = CONTINUUM;
    let reach = look.reach_kms + (bins * step_kms).max(widths * total_kms);
    let centre = look.unspotted.centre_kms;
    let (first, last) = look.range_kms;
    let inside = (centre - reach >= first, centre + reach <= last);
    let from = if inside.0 { rounded(centre - reach, 1) } else { first };
    let to = if inside.1 { rounded(centre + reach, 1) } else { last };
    let value = known.velocity_range_kms.as_ref().map_or((from, to), |given| given.value);
    let measured = match inside {
        (true, true) => "the line, to 3 standard deviations beyond vsini, and continuum on both sides",
        _ => "the profiles, which hold little or no continuum beside the line",
    };
    let (source, remark) = origin(&known.velocity_range_kms, measured);
    ledger.note("observations.velocity_range_kms", format!("[{}, {}]", value.0, value.1), "km/s", source, remark);
    value
}
