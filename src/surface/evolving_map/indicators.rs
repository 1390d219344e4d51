//! The dependence of an activity indicator on the spots: its gain by the evidence, and rows of the field's likelihood
//! (`docs/method.md` section 9).
//!
//! A reading is `level + slope t + gain f(t) + noise`, with f the filling factor of the visible disc, weighted by
//! projected area and limb darkening, and noise from its uncertainties and a jitter. Profiles predict f(t) with a
//! covariance, so that the likelihood of all readings is a Gaussian for each gain and jitter. The gain has a Gaussian
//! prior around 0 with a width for which spots of the field explain all of the variation; where it improves ln Z too
//! little it is set to 0, and the indicator is omitted.
//!
//! Not included: the uncertainty of gain and jitter, which are held at their most probable values; time lags of an
//! indicator behind the spots.

use super::{Basis, Marginal};
use crate::field::Epoch;
use crate::planets::verdict::decimals;
use crate::star::{Band, StarState};
use crate::surface::imaging::Imager;
use crate::surface::indicator::{Indicator, Reading, Scale};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// An indicator is used where its gain raises ln Z by more than this: odds of 20 to 1.
pub const NEEDED: f64 = 3.0;

/// Standard deviation of the priors of level and slope, the latter from the middle to the end, over the rms of the
/// values.
const LEVEL: f64 = 3.0;

/// Largest gain that is tried, relative to that for which the spots of the field explain all variation; and steps of
/// the first scan.
const LARGEST: f64 = 4.0;
const STEPS: i32 = 40;

/// Smallest uncertainty of a gain in the search, in the same units.
const SMALLEST: f64 = 1e-5;

/// Jitters that are tried, over the rms of the values.
const JITTERS: [f64; 12] = [0.0, 0.03, 0.06, 0.1, 0.15, 0.22, 0.3, 0.42, 0.6, 0.8, 1.0, 1.4];

/// Results for an indicator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FittedIndicator {
    /// Its name.
    pub name: String,
    /// Number of its values.
    pub values: usize,
    /// Change of the value for a filling factor of the visible disc of 1; 0 where it does not depend on the spots.
    pub gain: f64,
    /// Its standard deviation; that of the tested gain where it is 0.
    pub sigma_gain: f64,
    /// Standard deviation that neither spots nor uncertainties explain, in units of the value.
    pub jitter: f64,
    /// ln Bayes factor of the gain over none.
    pub ln_bayes: f64,
}

impl FittedIndicator {
    /// Whether it is used.
    pub fn is_used(&self) -> bool {
        self.gain != 0.0
    }

    /// A text.
    pub fn line(&self) -> String {
        let FittedIndicator { name, values, gain, sigma_gain, jitter, ln_bayes } = self;
        if !self.is_used() {
            return format!(
                "{name}: {values} values, not used: no significant gain (Δln Z = {ln_bayes:.1}, threshold {NEEDED})"
            );
        }
        let digits = decimals(*sigma_gain);
        let jitter = if *jitter > 0.0 { format!("{jitter:.2e}") } else { "0".to_owned() };
        format!(
            "{name}: {values} values, gain {gain:.digits$} ± {sigma_gain:.digits$} per filling factor \
            (Δln Z = {ln_bayes:.1}), jitter {jitter}"
        )
    }
}

/// Filling factor of the visible disc at the times of these readings, by each harmonic (readings, H).
fn rows(imager: &Imager, basis: &Basis, state: &StarState, readings: &[Reading]) -> DMatrix<f64> {
    let shares = |reading: &Reading| Band::default().shares(&imager.grid, &imager.star, state, &[reading.time_d]);
    let shares: Vec<Vec<f64>> = readings.par_iter().map(shares).collect();
    let shares = DMatrix::from_iterator(imager.grid.len(), readings.len(), shares.into_iter().flatten());
    shares.transpose() * &basis.on_pixels
}

/// For all indicators in use, one after the other (readings, H): change of their scaled values.
pub(super) fn jacobian(imager: &Imager, basis: &Basis, state: &StarState) -> DMatrix<f64> {
    let of = |indicator: &Indicator| rows(imager, basis, state, &indicator.readings) * indicator.gain;
    let all: Vec<DMatrix<f64>> = imager.indicators.iter().map(of).collect();
    let (count, mut first) = (all.iter().map(DMatrix::nrows).sum(), 0);
    let mut jacobian = DMatrix::zeros(count, basis.len());
    for rows in all {
        jacobian.rows_mut(first, rows.nrows()).copy_from(&rows);
        first += rows.nrows();
    }
    jacobian
}

/// The readings of all indicators as epochs, given the effect of each harmonic, and that of the maps: level and slope
/// follow `before` other common columns.
pub(super) fn epochs(imager: &Imager, jacobian: &DMatrix<f64>, seen: &[f64], before: usize) -> Vec<Epoch> {
    let numbers = before + 2 * imager.indicators.len();
    let each = imager.indicators.iter().enumerate();
    let readings = each.flat_map(|(i, indicator)| indicator.readings.iter().map(move |reading| (i, reading)));
    let epoch = |(k, (i, reading)): (usize, (usize, &Reading))| {
        let mut common = DMatrix::zeros(1, numbers);
        common[before + 2 * i] = LEVEL;
        common[before + 2 * i + 1] = LEVEL * reading.place;
        let row = jacobian.rows(k, 1).into_owned();
        Epoch::of_datum(reading.time_d, row, reading.value - seen[k], reading.sigma, common)
    };
    readings.enumerate().map(epoch).collect()
}

/// The prediction of the profiles for an indicator, and its values, scaled.
struct Predicted<'a> {
    readings: &'a [Reading],
    /// Filling factor of the visible disc over its rms by the field: mean and covariance.
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
}

impl Predicted<'_> {
    /// ln density of the values with a gain and a jitter; minus infinity where it is undefined.
    fn ln_density(&self, gain: f64, jitter: f64) -> f64 {
        let n = self.readings.len();
        let mut covariance = &self.covariance * (gain * gain);
        for (k, one) in self.readings.iter().enumerate() {
            for (j, other) in self.readings.iter().enumerate() {
                covariance[(k, j)] += LEVEL * LEVEL * (1.0 + one.place * other.place);
            }
            covariance[(k, k)] += one.sigma.powi(2) + jitter * jitter;
        }
        let misfit = DVector::from_fn(n, |k, _| self.readings[k].value - gain * self.mean[k]);
        let Some(factor) = covariance.cholesky() else { return f64::NEG_INFINITY };
        let ln_determinant = 2.0 * factor.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>();
        -0.5 * (misfit.dot(&factor.solve(&misfit)) + ln_determinant)
    }

    /// The same with the best jitter, and that jitter.
    fn best_jitter(&self, gain: f64) -> (f64, f64) {
        let tried = JITTERS.map(|jitter| (self.ln_density(gain, jitter), jitter));
        tried.into_iter().max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::NEG_INFINITY, 0.0))
    }

    /// The same with the prior of the gain, of standard deviation 1.
    fn height(&self, gain: f64, jitter: f64) -> f64 {
        self.ln_density(gain, jitter) - 0.5 * gain * gain - 0.5 * std::f64::consts::TAU.ln()
    }
}

/// Gain and jitter of an indicator with these readings, scaled by `scale`, given the profiles alone.
pub fn fit_indicator(
    imager: &Imager,
    marginal: &Marginal,
    (name, scale, readings): (&str, Scale, &[Reading]),
) -> FittedIndicator {
    let rows = rows(imager, &marginal.basis, &marginal.values.state(), readings);
    let times_d: Vec<f64> = readings.iter().map(|reading| reading.time_d).collect();
    let evidence = &marginal.settled.evidence;
    let before = evidence.variances_before(&rows);
    let rms = (before.iter().sum::<f64>() / before.len() as f64).sqrt();
    let (mean, covariance) = evidence.predicted(&rows, &times_d);
    let predicted = Predicted { readings, mean: mean / rms, covariance: covariance / (rms * rms) };
    let (without, jitter_without) = predicted.best_jitter(0.0);
    let tried = (-STEPS..=STEPS).map(|k| LARGEST * f64::from(k) / f64::from(STEPS));
    let of = |gain: f64| {
        let (density, jitter) = predicted.best_jitter(gain);
        (density - 0.5 * gain * gain, gain, jitter)
    };
    let coarse: Vec<(f64, f64, f64)> = tried.collect::<Vec<_>>().into_par_iter().map(of).collect();
    let best = coarse.iter().max_by(|a, b| a.0.total_cmp(&b.0)).copied().unwrap_or((0.0, 0.0, 0.0));
    let (mean, sd, ln_integral, jitter) = integrated(&predicted, best);
    // values beyond double precision give no result
    let found = [mean, sd, ln_integral - without];
    let [mean, sd, ln_bayes] = if found.iter().all(|x| x.is_finite()) { found } else { [0.0; 3] };
    let unit = scale.rms / rms;
    let is_used = ln_bayes > NEEDED;
    FittedIndicator {
        name: name.to_owned(),
        values: readings.len(),
        gain: if is_used { mean * unit } else { 0.0 },
        sigma_gain: sd * unit,
        jitter: scale.rms * if is_used { jitter } else { jitter_without },
        ln_bayes,
    }
}

/// Mean and standard deviation of the gain around the best trial value, ln of the integral over it, and the jitter
/// there.
fn integrated(predicted: &Predicted, (_, mut gain, mut jitter): (f64, f64, f64)) -> (f64, f64, f64, f64) {
    let mut width = LARGEST / f64::from(STEPS);
    // to the maximum, by thirds
    for _ in 0..3 {
        let (mut low, mut high) = (gain - width, gain + width);
        for _ in 0..24 {
            let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
            match predicted.height(a, jitter) < predicted.height(b, jitter) {
                true => low = a,
                false => high = b,
            }
        }
        gain = 0.5 * (low + high);
        jitter = predicted.best_jitter(gain).1;
    }
    let top = predicted.height(gain, jitter);
    // where it is lower by 1/2
    let drop = |width: f64| top - predicted.height(gain + width, jitter).max(predicted.height(gain - width, jitter));
    while width < LARGEST && drop(width) < 0.5 {
        width *= 1.4;
    }
    while width > SMALLEST && drop(width) > 0.5 {
        width *= 0.7;
    }
    const HALF: i32 = 40;
    let reach = 8.0 * width;
    let nodes = (-HALF..=HALF).map(|k| gain + reach * f64::from(k) / f64::from(HALF));
    let weighted: Vec<(f64, f64)> = nodes.map(|x| (x, (predicted.height(x, jitter) - top).exp())).collect();
    let sum: f64 = weighted.iter().map(|(_, w)| w).sum();
    let mean = weighted.iter().map(|(x, w)| x * w).sum::<f64>() / sum;
    let variance = weighted.iter().map(|(x, w)| (x - mean).powi(2) * w).sum::<f64>() / sum;
    (mean, variance.sqrt(), top + (sum * reach / f64::from(HALF)).ln(), jitter)
}
