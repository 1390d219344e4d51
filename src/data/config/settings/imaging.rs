//! The Doppler image: the keys allowed with an objective, and the prior of the spots as a field.

use super::checks::{NUISANCES, automatic, check_nuisances, check_pixels, check_windows};
use super::parameters::check_value;
use crate::data::config::error::Fault;
use crate::data::config::written::{Config, Hyperparameter, ImagingSettings, OfField, PriorSection, VelocityJitter};
use crate::model::{Parameter, ParameterValues};
use crate::surface::Properties;

/// Largest turnover degree: harmonics go to 36.
const MOST_BREAK_DEGREE: f64 = 30.0;

/// Error on keys of a field with a static map.
const OF_INTEGRATED_MAPS: &str = "only for imaging.objective \"marginal-likelihood\"";

/// Checks that the content of a map is given only with a static one; the default may be given too.
pub(super) fn check_brightness(imaging: &mut ImagingSettings) -> Result<(), Fault> {
    if imaging.brightness.is_some() && imaging.objective.properties().has_field {
        let problem = "no effect with imaging.objective \"marginal-likelihood\" (the default), whose maps may be \
                       brighter and darker than the photosphere: delete it, or set \"spottedness\"";
        return Err(Fault::new("imaging.brightness", problem));
    }
    imaging.brightness = imaging.brightness.filter(|model| !model.is_default());
    Ok(())
}

pub(super) fn check_imaging(imaging: &ImagingSettings, jitter: VelocityJitter) -> Result<(), Fault> {
    check_pixels("imaging.pixels", imaging.pixels)?;
    check_seasons(imaging)?;
    let &Properties { has_field, has_target, .. } = imaging.objective.properties();
    if let Some(degree) = imaging.spot_break_degree {
        const KEY: &str = "imaging.spot_break_degree";
        if !has_field {
            return Err(Fault::new(KEY, OF_INTEGRATED_MAPS));
        }
        if !(0.0..=MOST_BREAK_DEGREE).contains(&degree) {
            return Err(Fault::new(KEY, format!("{degree} must be from 0 to {MOST_BREAK_DEGREE}")));
        }
    }
    if !(imaging.default_spot > 0.0 && imaging.default_spot < 0.5) {
        let problem = format!("{} must be above 0 and below 0.5", imaging.default_spot);
        return Err(Fault::new("imaging.default_spot", problem));
    }
    if !has_target && imaging.chi2_target.is_word() {
        let problem = "auto is for static maps, not for imaging.objective \"marginal-likelihood\", the default: \
        delete it, or set \"spottedness\"";
        return Err(Fault::new("imaging.chi2_target", problem));
    }
    if imaging.nuisances.is_some() && imaging.chi2_target.is_word() {
        let problem = "auto uses RVs, which nuisances of line and continuum absorb: give a number, such as 0.97";
        return Err(Fault::new("imaging.chi2_target", problem));
    }
    if !jitter.is_default() && imaging.chi2_target.is_word() {
        let problem = "auto uses RVs, which observations.velocity_jitter_kms affects: give a number, such as 0.97";
        return Err(Fault::new("imaging.chi2_target", problem));
    }
    if let Some(priors) = &imaging.nuisances {
        check_nuisances("imaging.nuisances", NUISANCES, priors)?;
    }
    automatic("imaging.chi2_target", imaging.chi2_target)
}

/// How seasons are separated.
fn check_seasons(imaging: &ImagingSettings) -> Result<(), Fault> {
    const GAP: &str = "imaging.season_gap_d";
    let ImagingSettings { season_gap_d: gap, seasons, .. } = imaging;
    let given = [(gap.is_some(), GAP), (!seasons.is_empty(), "imaging.seasons")].map(|(is, key)| is.then_some(key));
    match (given, imaging.objective.properties().map_changes) {
        ([Some(key), _] | [None, Some(key)], true) => {
            let problem = "delete it: with imaging.objective \"marginal-likelihood\", the default, spots evolve \
            continuously; for one map per season set \"spottedness\"";
            return Err(Fault::new(key, problem));
        }
        ([Some(_), Some(key)], _) => return Err(Fault::new(key, "replaces season_gap_d: give one of them")),
        _ => {}
    }
    if let Some(gap) = gap.filter(|gap| gap.is_nan() || *gap <= 0.0) {
        return Err(Fault::new(GAP, format!("{gap} must be above 0")));
    }
    check_windows(seasons, "imaging.seasons")?;
    match seasons.windows(2).position(|two| two[1][0] <= two[0][1]) {
        None => Ok(()),
        Some(k) => {
            let [[_, end], [start, _]] = [seasons[k], seasons[k + 1]];
            let problem = format!("begins at {start} d, and imaging.seasons[{k}] ends only at {end} d");
            Err(Fault::new(format!("imaging.seasons[{}]", k + 1), problem))
        }
    }
}

/// Keys of the spots are allowed where spots are marginalised over, within the bounds of a fit. Those left to the
/// profiles are free in a chain, under a weak prior over the whole range.
pub(super) fn resolve_field(written: &mut Config, values: &mut ParameterValues) -> Result<(), Fault> {
    let imaging = &written.imaging;
    let has_field = imaging.objective.properties().has_field;
    let something_is_free = !written.parameters.is_empty();
    let given = [imaging.spot_amplitude, imaging.spot_slope, imaging.spot_lifetime_d];
    for (parameter, given) in Parameter::FIELD.into_iter().zip(given) {
        let name = parameter.name();
        let (axis, prior) = (written.has_axis(parameter), written.parameters.has(parameter));
        let wanted = [(prior, "parameters"), (axis, "grid.axes"), (!given.is_default(), "imaging")];
        if let Some((_, section)) = wanted.into_iter().find(|(is_there, _)| *is_there && !has_field) {
            return Err(Fault::new(format!("{section}.{name}"), OF_INTEGRATED_MAPS));
        }
        match given {
            _ if !has_field => {}
            Hyperparameter::Word(OfField::Static) if parameter != Parameter::SpotLifetime => {
                return Err(Fault::new(format!("imaging.{name}"), "only spot_lifetime_d may be \"static\""));
            }
            Hyperparameter::Word(OfField::Static) if prior || axis => {
                let problem = "\"static\" spots have no lifetime that could be free";
                return Err(Fault::new(format!("imaging.{name}"), problem));
            }
            Hyperparameter::Word(OfField::Static) => {}
            Hyperparameter::Number(value) => {
                check_value(parameter, value, &format!("imaging.{name}"))?;
                values.set(parameter, value);
            }
            Hyperparameter::Word(OfField::Fitted) => {
                values.set(parameter, parameter.usual());
                if let Some(kind) = parameter.spec().usual_prior.filter(|_| something_is_free && !prior) {
                    written.parameters.set(parameter, PriorSection::even(kind, parameter.widest()));
                }
            }
        }
    }
    Ok(())
}
