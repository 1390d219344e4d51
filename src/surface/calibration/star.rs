//! The star itself, as far as a config leaves it to the profiles: active regions, whose line and limb contrast are
//! those for which ln Z is largest, under priors (`docs/method.md` section 9).
//!
//! Priors are centred on the Sun: the line of a spot is 24 % wider than that of the quiet photosphere and has 7 % more
//! equivalent width, and inhibited convection shifts it by 0.3 km/s (Dumusque, Boisse & Santos 2014, ApJ 796, 132,
//! sections 2 and 3). They are wide: regions of other stars are stronger.

use crate::model::{Parameter, ParameterValues};
use crate::star::StarSettings;
use crate::surface::Known;
use crate::surface::evolving_map::NoFit;
use crate::surface::evolving_map::star::{FittedStar, StarPrior, coarsely, fit_star};
use crate::surface::imaging::Imager;
use serde::{Deserialize, Serialize};

/// Means and standard deviations of the priors of active regions, and where a climb begins.
const PRIORS: [(Parameter, f64, f64, f64); Parameter::REGIONS.len()] = [
    (Parameter::RegionLineWidth, 1.24, 0.25, 1.24),
    (Parameter::RegionEquivalentWidth, 1.07, 0.2, 1.07),
    (Parameter::RegionShift, 0.2, 0.3, 0.2),
    (Parameter::RegionArea, 0.0, 3.0, 1.0),
    (Parameter::RegionAreaLimb, 0.0, 2.0, 0.0),
    (Parameter::RegionDimmingLimb, 0.0, 0.7, 0.0),
];

/// Regions have to gain so much in ln Z, what their numbers are free to be counted against them.
const NEEDED: f64 = 5.0;

/// A number of the star that was fitted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FittedNumber {
    /// Name of the parameter.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

/// The star as the profiles say it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeasuredStar {
    /// What was fitted; nothing where spots that are the photosphere, dimmed, explain the profiles as well.
    pub numbers: Vec<FittedNumber>,
    /// What that gains in ln Z.
    pub gain: f64,
}

impl MeasuredStar {
    /// Of the profiles of `imager`, the other parameters at `values`, without a planet.
    ///
    /// # Errors
    /// [`NoFit`].
    pub fn of(imager: &Imager, mut values: ParameterValues, known: Known, fitted: &[Parameter]) -> Result<Self, NoFit> {
        values.set(Parameter::K, 0.0);
        let plain = coarsely(imager, values, known)?;
        let priors: Vec<StarPrior> = PRIORS
            .iter()
            .filter(|(parameter, ..)| fitted.contains(parameter))
            .map(|&(parameter, mean, sd, start)| StarPrior { parameter, mean, sd, start, bounds: parameter.widest() })
            .collect();
        let FittedStar { values, sd, ln_evidence, ln_prior } = fit_star(imager, &plain, &known, &priors)?;
        let told: f64 = sd.iter().zip(&priors).map(|(sd, prior)| (sd / prior.sd).min(1.0).ln()).sum();
        let gain = ln_evidence - plain.ln_evidence;
        if gain + ln_prior + told < NEEDED {
            return Ok(MeasuredStar { numbers: Vec::new(), gain });
        }
        let number = |(prior, sigma): (&StarPrior, &f64)| FittedNumber {
            name: prior.parameter.name().to_owned(),
            value: values[prior.parameter],
            sigma: *sigma,
        };
        Ok(MeasuredStar { numbers: priors.iter().zip(&sd).map(number).collect(), gain })
    }

    /// Puts what was found into a star.
    pub fn put_into(&self, star: &mut StarSettings) {
        let mut values = ParameterValues::of_eight([0.0; 8]);
        self.set(&mut values, |_| true);
        *star = star.with(&values.surface);
    }

    /// Sets the parameters that are free to what was found: where searches begin.
    pub fn set(&self, values: &mut ParameterValues, is_free: impl Fn(Parameter) -> bool) {
        for number in &self.numbers {
            if let Some(parameter) = Parameter::from_name(&number.name).filter(|parameter| is_free(*parameter)) {
                values.set(parameter, number.value);
            }
        }
    }

    /// It in words.
    pub fn line(&self) -> String {
        let MeasuredStar { numbers, gain } = self;
        if numbers.is_empty() {
            return format!("as the photosphere, dimmed (a line of their own gains {gain:.1} in ln Z)");
        }
        let of = |FittedNumber { name, value, sigma }: &FittedNumber| {
            let name = name.trim_start_matches("region_").trim_end_matches("_kms").replace('_', " ");
            format!("{name} {value:.2} +- {sigma:.2}")
        };
        let all: Vec<String> = numbers.iter().map(of).collect();
        format!("{} (gain {gain:.0} in ln Z)", all.join(", "))
    }
}
