//! An RV jitter of unknown size beside the orbit: independent RV offsets of all profiles with standard deviation s.
//!
//! Marginalised over the offsets, `ln L(V)` of information I becomes that of the information `(1 + s^2 I)^-1 I`. A
//! jitter found without a planet in the model may be due to the planet: with few profiles a strong signal would be
//! absorbed. So s is fitted both without an orbit and with each orbit, as in the F-test of a periodogram of unknown
//! noise. Simulated stars without a planet have the jitter found without one, and are searched in the same way,
//! also where none was found: in half of them chance mimics one, which lowers their peaks.

use super::orbits::{CircularOrbit, Trial, scan};
use crate::planets::velocities::VelocityQuadratic;
use nalgebra::{DMatrix, DVector};

/// Trial jitters, in units of the one found without a planet, or that chance mimics.
pub(super) const SIZES: [f64; 6] = [0.0, 0.25, 0.5, std::f64::consts::FRAC_1_SQRT_2, 1.0, std::f64::consts::SQRT_2];

/// By how many of its standard errors a variance exceeds 0 by chance.
const BY_CHANCE: f64 = 2.0;

/// Directions of the gradient with less than this fraction of the largest variance are dropped.
const STILL: f64 = 1e-13;

/// RV stability of a spectrograph that is not named (km/s): that of ESPaDOnS and Narval.
pub const USUAL_STABILITY_KMS: f64 = 0.03;

/// ln of the prior of a jitter or of offsets of nights (km/s) relative to that of none: half-Cauchy, its scale (km/s)
/// the stability of the spectrograph; the tail admits larger ones where the profiles require them (Gelman 2006,
/// Bayesian Analysis 1, 515). Uniform with an infinite scale.
pub fn ln_prior(jitter_kms: f64, stability_kms: f64) -> f64 {
    -(jitter_kms / stability_kms).powi(2).ln_1p()
}

/// ln of the share of each size in the range up to the largest.
pub(super) fn ln_shares(sizes: &[f64]) -> Vec<f64> {
    let last = sizes.len() - 1;
    let share = |k: usize| 0.5 * (sizes[(k + 1).min(last)] - sizes[k.saturating_sub(1)]) / sizes[last];
    if last == 0 { vec![0.0] } else { (0..=last).map(|k| share(k).ln()).collect() }
}

/// The standard deviation (km/s) of offsets that chance mimics where there are none, given the information on them: the
/// standard error of their variance is `sqrt(2 / tr(information^2))`. 0 without information.
pub(super) fn by_chance_kms(information: &DMatrix<f64>) -> f64 {
    let norm = information.norm();
    if norm > 0.0 { (BY_CHANCE * std::f64::consts::SQRT_2 / norm).sqrt() } else { 0.0 }
}

/// Standard deviations (km/s) of jitter and nightly offsets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scatter {
    /// Jitter of each profile.
    pub jitter_kms: f64,
    /// Offsets that the profiles of a night share.
    pub night_kms: f64,
}

/// ln L of the velocities at several jitters and nightly offsets (`nights`).
#[derive(Clone, Debug, PartialEq)]
pub struct Jitters {
    pub(super) levels: Vec<Level>,
    /// ln of the share of each in the range up to the largest.
    pub(super) ln_shares: Vec<f64>,
    /// The noise of stars without a planet, where it may include nightly offsets.
    pub(super) null: Option<Scatter>,
    /// Units of the trial sizes.
    pub(super) units: Scatter,
    /// Covariance of the gradient, without jitter, of a star without a planet.
    pub(super) covariance: DMatrix<f64>,
}

/// One size.
#[derive(Clone, Debug, PartialEq)]
pub struct Level {
    /// ln L of the velocities.
    pub quadratic: VelocityQuadratic,
    /// ln L at velocities 0, including the prior of the size, relative to the best size.
    pub ln_l: f64,
    /// ln L at velocities 0 of a star with gradient g (without jitter) is `constant + |solved g|^2 / 2`; without rows
    /// where there is no jitter.
    pub(super) constant: f64,
    pub(super) solved: DMatrix<f64>,
    /// From gradients without jitter to those with it.
    pub(super) kept: DMatrix<f64>,
}

/// A trial period with the best jitter for its orbit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BestTrial {
    /// The trial at that jitter, its height relative to no planet at the same jitter.
    pub trial: Trial,
    /// Index of the size.
    pub level: usize,
    /// Height relative to no planet at the best jitter for no planet.
    pub delta_ln_l: f64,
}

impl BestTrial {
    /// The trial with its height relative to no planet.
    pub fn trial_above_no_planet(&self) -> Trial {
        let delta_ln_l = self.delta_ln_l;
        Trial { orbit: self.trial.orbit.map(|orbit| CircularOrbit { delta_ln_l, ..orbit }), ..self.trial }
    }
}

impl Jitters {
    /// No jitter.
    pub fn none(quadratic: &VelocityQuadratic) -> Self {
        let n = quadratic.len();
        let level = Level {
            quadratic: quadratic.clone(),
            ln_l: 0.0,
            constant: 0.0,
            solved: DMatrix::zeros(0, n),
            kept: DMatrix::identity(n, n),
        };
        let units = Scatter { jitter_kms: 0.0, night_kms: 0.0 };
        let covariance = quadratic.information.clone();
        Jitters { levels: vec![level], ln_shares: vec![0.0], null: None, units, covariance }
    }

    /// Jitters added to the quadratic `without` one; `found_kms` is the standard deviation (km/s) found without a
    /// planet; with the [`ln_prior`] of that scale.
    pub fn new(without: &VelocityQuadratic, found_kms: f64, stability_kms: f64) -> Self {
        let unit_kms = found_kms.max(by_chance_kms(&without.information));
        Jitters::in_units(without, (found_kms, unit_kms), stability_kms)
    }

    /// The same with trial jitters in `unit_kms`.
    pub fn in_units(without: &VelocityQuadratic, (found_kms, unit_kms): (f64, f64), stability_kms: f64) -> Self {
        let eigen = without.information.clone().symmetric_eigen();
        let (lambda, u) = (eigen.eigenvalues.map(|l| l.max(0.0)), eigen.eigenvectors);
        let among = |d: DVector<f64>| &u * DMatrix::from_diagonal(&d) * u.transpose();
        let pulled = u.tr_mul(&without.gradient);
        let level = |size: f64| {
            let variance = (size * unit_kms).powi(2);
            let left = lambda.map(|l| 1.0 / (1.0 + variance * l));
            let constant = 0.5 * left.map(f64::ln).sum() + ln_prior(size * unit_kms, stability_kms);
            let information = among(lambda.component_mul(&left));
            Level {
                ln_l: constant + 0.5 * variance * pulled.component_mul(&pulled).dot(&left),
                quadratic: VelocityQuadratic {
                    cycles: without.cycles.clone(),
                    gradient: &u * pulled.component_mul(&left),
                    information: 0.5 * (&information + information.transpose()),
                },
                constant,
                solved: DMatrix::from_diagonal(&left.map(|left| (variance * left).sqrt())) * u.transpose(),
                kept: among(left),
            }
        };
        let mut levels = SIZES.map(level).to_vec();
        let best = levels.iter().map(|level| level.ln_l).fold(f64::NEG_INFINITY, f64::max);
        levels.iter_mut().for_each(|level| level.ln_l -= best);
        let covariance = among(lambda.map(|l| l + (found_kms * l).powi(2)));
        let units = Scatter { jitter_kms: unit_kms, night_kms: 0.0 };
        Jitters { levels, ln_shares: ln_shares(&SIZES), null: None, units, covariance }
    }

    /// ln L of no planet at each size, including its prior and its share of the range up to the largest.
    pub fn ln_weights(&self) -> Vec<f64> {
        self.levels.iter().zip(&self.ln_shares).map(|(level, ln_share)| level.ln_l + ln_share).collect()
    }

    /// Units of the trial sizes.
    pub fn units(&self) -> Scatter {
        self.units
    }

    /// All sizes.
    pub fn levels(&self) -> &[Level] {
        &self.levels
    }

    /// The best orbit of one frequency (orbits a rotation cycle) at its best jitter, its height relative to no planet
    /// at the best jitter of that. `None` where no orbit is bounded.
    pub fn orbit_at(&self, frequency: f64) -> Option<CircularOrbit> {
        self.scan(&[frequency])[0].trial_above_no_planet().orbit
    }

    /// The most likely amplitude of the velocities `unit`, its standard error, and its height above none, each at its
    /// best jitter.
    pub fn amplitude(&self, unit: &DVector<f64>) -> [f64; 3] {
        let of = |level: &Level| {
            let [mean, sd] = level.quadratic.amplitude(unit);
            [mean, sd, level.ln_l + 0.5 * (mean / sd).powi(2)]
        };
        self.levels.iter().map(of).max_by(|a, b| a[2].total_cmp(&b[2])).unwrap_or([f64::NAN; 3])
    }

    /// The height of the most likely amplitude of 0 or more of the velocities `unit` above none, each at its best
    /// jitter.
    pub fn height_above_zero(&self, unit: &DVector<f64>) -> f64 {
        let of = |level: &Level| {
            let [mean, sd] = level.quadratic.amplitude(unit);
            level.ln_l + 0.5 * (mean / sd).max(0.0).powi(2)
        };
        self.levels.iter().map(of).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Height of an orbit of these velocities (km/s) relative to no planet, each at its best jitter.
    pub fn delta_ln_l(&self, velocities: &DVector<f64>) -> f64 {
        let height = |level: &Level| level.ln_l + level.quadratic.log_likelihood(velocities);
        self.levels.iter().map(height).fold(f64::NEG_INFINITY, f64::max)
    }

    /// At the best jitter of the star without a planet.
    pub fn as_found(&self) -> &Level {
        self.levels.iter().find(|level| level.ln_l == 0.0).unwrap_or(&self.levels[0])
    }

    /// Whether there is no jitter.
    pub fn is_none(&self) -> bool {
        self.levels.len() == 1
    }

    /// The best orbit at every frequency (orbits a rotation cycle), at its best jitter; without jitter where no orbit
    /// is bounded.
    pub(super) fn scan(&self, frequencies: &[f64]) -> Vec<BestTrial> {
        let of_level = |(level, of): (usize, &Level)| {
            let height = |trial: &Trial| trial.orbit.map_or(f64::NEG_INFINITY, |orbit| of.ln_l + orbit.delta_ln_l);
            let best = |trial: Trial| BestTrial { delta_ln_l: height(&trial), trial, level };
            scan(&of.quadratic, frequencies).into_iter().map(best).collect::<Vec<_>>()
        };
        let mut levels = self.levels.iter().enumerate().map(of_level);
        let mut best = levels.next().unwrap_or_default();
        for level in levels {
            for (best, next) in best.iter_mut().zip(level) {
                if next.delta_ln_l > best.delta_ln_l {
                    *best = next;
                }
            }
        }
        best
    }
}

/// The symmetric root of a covariance: unlike roots made of eigenvectors alone, it does not depend on their signs, nor
/// do draws.
pub(super) fn root(covariance: &DMatrix<f64>) -> DMatrix<f64> {
    let mut eigen = covariance.clone().symmetric_eigen();
    let still = STILL * eigen.eigenvalues.max();
    eigen.eigenvalues.apply(|variance| *variance = if *variance > still { variance.sqrt() } else { 0.0 });
    eigen.recompose()
}

#[cfg(test)]
mod tests;
