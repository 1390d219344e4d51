//! Stellar parameters that a config leaves to the profiles: active regions, with the line and limb contrast for which
//! ln Z is largest, under priors (`docs/method.md` section 9).
//!
//! Priors are centred on the Sun: the line of a spot is 24 % wider than that of the quiet photosphere and has 7 % more
//! equivalent width, and inhibited convection shifts it by 0.3 km/s (Dumusque, Boisse & Santos 2014, ApJ 796, 132,
//! sections 2 and 3). They are wide: regions of other stars are stronger.

use crate::model::{FreeParameter, Parameter, ParameterValues};
use crate::numerics::units::FWHM_PER_SIGMA;
use crate::star::{Seen, StarSettings};
use crate::surface::Known;
use crate::surface::evolving_map::star::{FittedStar, StarPrior, coarsely, fit_star};
use crate::surface::evolving_map::{Assumed, Fitted, NoFit};
use crate::surface::imaging::Imager;
use serde::{Deserialize, Serialize};

/// Means and standard deviations of the priors of active regions, and the start of a climb.
const PRIORS: [(Parameter, f64, f64, f64); Parameter::REGIONS.len()] = [
    (Parameter::RegionLineWidth, 1.24, 0.25, 1.24),
    (Parameter::RegionEquivalentWidth, 1.07, 0.2, 1.07),
    (Parameter::RegionShift, 0.2, 0.3, 0.2),
    (Parameter::RegionArea, 0.0, 3.0, 1.0),
    (Parameter::RegionAreaLimb, 0.0, 2.0, 0.0),
    (Parameter::RegionDimmingLimb, 0.0, 0.7, 0.0),
];

/// Widths of the priors of line and vsini around the values of the config: as fractions, km/s.
const OF_LINE: f64 = 0.4;
const OF_STRENGTH: f64 = 0.15;
const OF_VSINI: (f64, f64) = (0.04, 1.0);
const OF_LIMB_DARKENING: f64 = 0.15;

/// Mean and standard deviation of the normal prior of a fitted stellar parameter that is `value` in the config.
pub fn mean_and_sd(parameter: Parameter, value: f64) -> (f64, f64) {
    let prior = prior(parameter, value);
    (prior.mean, prior.sd)
}

/// The prior of a stellar parameter that is `value` in the config.
fn prior(parameter: Parameter, value: f64) -> StarPrior {
    let (low, high) = parameter.widest();
    let of =
        |mean: f64, sd: f64, start: f64| StarPrior { parameter, mean, sd, start, bounds: (low, high), is_free: false };
    match parameter {
        Parameter::LineSigma => StarPrior { bounds: (0.2 * value, 5.0 * value), ..of(value, OF_LINE * value, value) },
        Parameter::EquivalentWidth => {
            StarPrior { bounds: (0.3 * value, 3.0 * value), ..of(value, OF_STRENGTH * value, value) }
        }
        Parameter::Vsini => {
            let sd = OF_VSINI.1.max(OF_VSINI.0 * value);
            StarPrior { bounds: (0.3 * value, 3.0 * value), ..of(value, sd, value) }
        }
        Parameter::LimbDarkening => of(value, OF_LIMB_DARKENING, value.clamp(0.02, 0.98)),
        _ => {
            let of_regions = PRIORS.iter().find(|(of, ..)| *of == parameter);
            of_regions.map_or(of(value, 1.0, value), |&(_, mean, sd, start)| of(mean, sd, start))
        }
    }
}

/// The parameters that are fitted, and those that are always free. Active regions that were found at a wrong
/// inclination would compensate for it, and a search for the inclination would not leave it.
#[derive(Clone, Copy, Debug)]
pub struct Open<'a> {
    /// Fitted parameters.
    pub fitted: &'a [Parameter],
    /// Free parameters.
    pub free: &'a [FreeParameter],
}

impl Open<'_> {
    /// Priors of free parameters, as in chains except for their shape.
    fn of_free(&self, values: &ParameterValues) -> Vec<StarPrior> {
        let is_open = |of: &&FreeParameter| GEOMETRY.contains(&of.parameter) && !self.fitted.contains(&of.parameter);
        let of = |&FreeParameter { parameter, prior }: &FreeParameter| {
            let (mean, sd) = prior.mean_and_sd();
            StarPrior { parameter, mean, sd, start: values[parameter], bounds: prior.bounds(), is_free: true }
        };
        self.free.iter().filter(is_open).map(of).collect()
    }
}

/// Parameters whose errors active regions may absorb.
const GEOMETRY: [Parameter; 4] = [Parameter::Inclination, Parameter::Vsini, Parameter::OmegaEq, Parameter::DOmega];

/// The field with the most probable values of those parameters that are free, active regions excluded; `None` where
/// none is free.
///
/// # Errors
/// [`NoFit`].
pub fn with_geometry(imager: &Imager, plain: &Fitted, known: &Known, open: Open) -> Result<Option<Fitted>, NoFit> {
    let mut values = plain.marginal.values;
    let priors = open.of_free(&values);
    if priors.is_empty() {
        return Ok(None);
    }
    let found = fit_star(imager, plain, known, &priors, f64::NEG_INFINITY)?;
    priors.iter().for_each(|prior| values.set(prior.parameter, found.values[prior.parameter]));
    coarsely(imager, values, *known).map(Some)
}

/// Whether a parameter of active regions lies on a bound; zero surface is not a bound.
fn is_at_bound(prior: &StarPrior, value: f64) -> bool {
    let (low, high) = prior.bounds;
    let near = 1e-6 * (high - low);
    let is_low = value < low + near && prior.parameter != Parameter::RegionArea;
    Parameter::REGIONS.contains(&prior.parameter) && (is_low || value > high - near)
}

/// Full width at half maximum of the line of active regions (km/s), where it exceeds the velocity range of every
/// profile.
pub fn too_wide_kms(imager: &Imager, star: &StarSettings) -> Option<f64> {
    let widest = |set: &Seen| {
        let bins = set.sampling.profiles.iter().map(|profile| profile.2).max().unwrap_or(0);
        bins as f64 * set.sampling.step_kms
    };
    let range_kms = imager.sets.iter().map(widest).fold(0.0, f64::max);
    let fwhm_kms = FWHM_PER_SIGMA * star.regions.line(star.line).sigma_kms;
    (!star.regions.are_plain() && fwhm_kms > range_kms).then_some(fwhm_kms)
}

/// The gain in ln Z that regions require, with their free parameters counted against them.
const NEEDED: f64 = 5.0;

/// A stellar parameter that was fitted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FittedNumber {
    /// Name of the parameter.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

/// The star as measured from the profiles.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeasuredStar {
    /// The fitted parameters; empty where spots that are dimmed photosphere explain the profiles equally well.
    pub numbers: Vec<FittedNumber>,
    /// Size of the error common to all profiles of a data set, relative to the continuum; 0 for none.
    #[serde(default)]
    pub mean_profile: f64,
    /// The total gain in ln Z.
    pub gain: f64,
    /// Names of those parameters of active regions that the evidence drives to a bound.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub at_bounds: Vec<String>,
    /// Full width at half maximum of the line of active regions (km/s), where it is wider than the velocity range.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub too_wide_kms: Option<f64>,
}

impl MeasuredStar {
    /// Measured from the profiles of `imager`, the other parameters as those of `plain` spots, starting from their
    /// field; with the resulting field. Where line and regions together gain too little, regions alone: a line that is
    /// right already does not count against them.
    ///
    /// # Errors
    /// [`NoFit`].
    pub fn of(imager: &Imager, plain: &Fitted, known: &Known, open: Open) -> Result<(Self, Assumed), NoFit> {
        let together = MeasuredStar::by(imager, plain, known, open)?;
        let fitted = open.fitted;
        let is_of_regions = |parameter: &Parameter| Parameter::REGIONS.contains(parameter);
        let regions: Vec<Parameter> = fitted.iter().copied().filter(is_of_regions).collect();
        if !together.0.numbers.is_empty() || regions.is_empty() || regions.len() == fitted.len() {
            return Ok(together);
        }
        let alone = MeasuredStar::by(imager, plain, known, Open { fitted: &regions, ..open })?;
        Ok(if alone.0.numbers.is_empty() { together } else { alone })
    }

    /// The same by all that is `fitted` or by nothing.
    fn by(imager: &Imager, plain: &Fitted, known: &Known, open: Open) -> Result<(Self, Assumed), NoFit> {
        let values = plain.marginal.values;
        let star = imager.star.with(&values.surface);
        let value = |parameter: Parameter| match parameter {
            Parameter::LineSigma => star.line.own_sigma_kms(),
            Parameter::EquivalentWidth => star.line.strength_kms(),
            Parameter::LimbDarkening => star.limb_darkening.coefficients().0,
            _ => values.get(parameter).unwrap_or(0.0),
        };
        let fitted = open.fitted.iter().map(|parameter| prior(*parameter, value(*parameter)));
        let priors: Vec<StarPrior> = open.of_free(&values).into_iter().chain(fitted).collect();
        let FittedStar { values, sd, mean_profile, ln_evidence, ln_prior, assumed } =
            fit_star(imager, plain, known, &priors, NEEDED)?;
        let counted = sd.iter().zip(&priors).filter(|(_, prior)| !prior.is_free);
        let told: f64 = counted.map(|(sd, prior)| (sd / prior.sd).min(1.0).ln()).sum();
        let gain = ln_evidence - plain.ln_evidence;
        if gain + ln_prior + told < NEEDED {
            return Ok((MeasuredStar { gain, ..MeasuredStar::default() }, plain.marginal.assumed));
        }
        let number = |(prior, sigma): (&StarPrior, &f64)| FittedNumber {
            name: prior.parameter.name().to_owned(),
            value: values[prior.parameter],
            sigma: *sigma,
        };
        let at_bounds = priors.iter().filter(|prior| is_at_bound(prior, values[prior.parameter]));
        let at_bounds = at_bounds.map(|prior| prior.parameter.name().to_owned()).collect();
        let numbers = priors.iter().zip(&sd).map(number).collect();
        let too_wide_kms = too_wide_kms(imager, &imager.star.with(&values.surface));
        Ok((MeasuredStar { numbers, mean_profile, gain, at_bounds, too_wide_kms }, assumed))
    }

    /// Sets the results in what profiles are imaged with.
    pub fn put_into(&self, imager: &mut Imager) {
        let mut values = ParameterValues::of_eight([0.0; 8]);
        self.set(&mut values, |_| true);
        let star = imager.star.with(&values.surface);
        for set in &mut imager.sets {
            set.line = set.line.map(|own| own.in_proportion(&imager.star.line, &star.line));
        }
        imager.star = star;
        imager.mean_profile = self.mean_profile;
    }

    /// Sets the free parameters to the results: where searches begin.
    pub fn set(&self, values: &mut ParameterValues, is_free: impl Fn(Parameter) -> bool) {
        for number in &self.numbers {
            if let Some(parameter) = Parameter::from_name(&number.name).filter(|parameter| is_free(*parameter)) {
                values.set(parameter, number.value);
            }
        }
    }

    /// Why the active regions as found are impossible, with a status for it.
    pub fn problem(&self) -> Option<String> {
        let words = |name: &String| name.trim_end_matches("_kms").replace('_', " ");
        let cure = "check velocity range and star.line, or set star.regions.area to 0";
        if let Some(fwhm_kms) = self.too_wide_kms {
            return Some(format!(
                "the fitted line of active regions, {fwhm_kms:.0} km/s wide, exceeds the velocity range \
                 (region-too-wide): {cure}"
            ));
        }
        let names: Vec<String> = self.at_bounds.iter().map(words).collect();
        let plural = if names.len() == 1 { "its bound" } else { "their bounds" };
        let all = names.join(", ");
        (!names.is_empty()).then(|| format!("{all} at {plural} (region-at-bound): {cure}"))
    }

    /// A text.
    pub fn line(&self) -> String {
        let MeasuredStar { numbers, mean_profile, gain, .. } = self;
        if numbers.is_empty() {
            let why = match *gain < NEEDED {
                true => format!("are not better (Δln Z = {gain:.1}, {NEEDED} needed)"),
                false => format!("are too far from their priors (Δln Z = {gain:.1})"),
            };
            return format!("values of the config kept: fitted line and active regions {why}");
        }
        let of = |FittedNumber { name, value, sigma }: &FittedNumber| {
            let name = name.trim_end_matches("_kms").replace('_', " ");
            format!("{name} {value:.2} ± {sigma:.2}")
        };
        let all: Vec<String> = numbers.iter().map(of).collect();
        let mean = match mean_profile {
            0.0 => String::new(),
            size => format!(", mean profile {:.2} %", 100.0 * size),
        };
        format!("{}{mean} (Δln Z = {gain:.0})", all.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_at_a_bound_have_a_name() {
        let prior = |parameter: Parameter| prior(parameter, 1.0);
        let high = |parameter: Parameter| prior(parameter).bounds.1;
        assert!(is_at_bound(&prior(Parameter::RegionLineWidth), high(Parameter::RegionLineWidth)));
        assert!(!is_at_bound(&prior(Parameter::RegionLineWidth), 1.3));
        // zero surface is a star without regions
        assert!(!is_at_bound(&prior(Parameter::RegionArea), 0.0));
        assert!(is_at_bound(&prior(Parameter::RegionArea), high(Parameter::RegionArea)));
        let at_bounds = vec!["region_line_width".to_owned(), "region_shift_kms".to_owned()];
        let star = MeasuredStar { at_bounds, ..MeasuredStar::default() };
        let said = star.problem().unwrap();
        assert!(said.starts_with("region line width, region shift at their bounds (region-at-bound): "), "{said}");
        let wide = MeasuredStar { too_wide_kms: Some(95.0), ..star };
        assert!(wide.problem().unwrap().contains("95 km/s wide, exceeds the velocity range (region-too-wide)"));
        assert_eq!(MeasuredStar::default().problem(), None);
    }
}
