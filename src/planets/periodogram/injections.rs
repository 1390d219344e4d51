//! Orbits put into the velocities of a star, and the highest peak of each, beside a jitter of unknown size.
//!
//! An orbit adds `I V` to the gradient and changes nothing else, so that the whitened gradient at every trial period
//! and for every size of the jitter is linear in the orbit's two amplitudes: three products a period, and each orbit
//! of that period is a sum. A jitter that hides an orbit grows with it, so sizes reach from none to that of the largest
//! orbit.

use super::draws::whitening;
use super::false_alarm::FalseAlarm;
use super::jitter::{Jitters, ln_prior};
use super::orbits::{amplitudes, design, scan};
use super::{Frequencies, SearchSettings};
use crate::planets::velocities::VelocityQuadratic;
use nalgebra::{DMatrix, DVector};
use std::sync::OnceLock;

/// Sizes of the jitter grow by this factor.
const STEP: f64 = std::f64::consts::SQRT_2;

/// The smallest one, of the standard error of a velocity.
const SMALLEST: f64 = 0.35;

/// Draws by which the level of detections beside a jitter is found; beyond their reach by the form of the tail.
const DRAWS: usize = 1000;

/// The velocities of a star without a planet, into which orbits are put.
pub struct Injections<'a> {
    without: &'a VelocityQuadratic,
    scale_kms: Option<f64>,
    frequencies: &'a Frequencies,
    settings: SearchSettings,
    probability: f64,
    sizes: Vec<Size>,
}

/// A jitter of one size.
struct Size {
    kms: f64,
    /// Trial periods that are bounded.
    frequencies: Vec<f64>,
    /// From the gradient without a jitter to the two whitened amplitudes of every trial period.
    rows: DMatrix<f64>,
    /// From these to (a, b): lower factors of the information.
    factors: Vec<[f64; 3]>,
    /// ln L at velocities 0: a constant, and directions of the gradient whose squares add to it.
    constant: f64,
    directions: DMatrix<f64>,
    /// Delta ln L of a detection where this size suits the star without an orbit best.
    level: OnceLock<f64>,
}

/// Orbits of one period.
pub struct Column<'a, 'b> {
    all: &'b Injections<'a>,
    cycles: &'a [f64],
    frequency: f64,
    /// Of each size: whitened amplitudes, and those along the directions, of no orbit and of a and b of 1 km/s.
    whitened: Vec<[DVector<f64>; 3]>,
    along: Vec<[DVector<f64>; 3]>,
}

/// The highest peak.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Highest {
    /// Frequency (orbits a rotation cycle), refined between the trial periods.
    pub frequency: f64,
    /// ln L above no planet, at a trial period.
    pub delta_ln_l: f64,
    /// Semi-amplitude (km/s).
    pub k_kms: f64,
    /// Delta ln L of a detection.
    pub level: f64,
}

impl<'a> Injections<'a> {
    /// Into velocities `without` jitter, whose prior has that scale, orbits of up to `most_kms`; a detection has
    /// that false-alarm `probability`.
    pub fn new(
        (without, scale_kms): (&'a VelocityQuadratic, Option<f64>),
        most_kms: f64,
        frequencies: &'a Frequencies,
        settings: SearchSettings,
        probability: f64,
    ) -> Self {
        let eigen = without.information.clone().symmetric_eigen();
        let lambda = eigen.eigenvalues.map(|l| l.max(0.0));
        let error_kms = (lambda.len() as f64 / lambda.sum()).sqrt();
        let mut kms = vec![0.0];
        let mut next = SMALLEST * error_kms;
        while next < STEP * most_kms.max(error_kms) {
            kms.push(next);
            next *= STEP;
        }
        let size = |kms: f64| Size::new((kms, scale_kms), without, (&lambda, &eigen.eigenvectors), frequencies);
        let sizes = kms.into_iter().map(size).collect();
        let settings = SearchSettings { draws: DRAWS.min(settings.draws), ..settings };
        Injections { without, scale_kms, frequencies, settings, probability, sizes }
    }

    /// Orbits of that period over the rotation period.
    pub fn column(&self, porb_over_prot: f64) -> Column<'a, '_> {
        let frequency = 1.0 / porb_over_prot;
        let cycles: &[f64] = &self.without.cycles;
        let moved = &self.without.information * design(cycles, &[frequency]);
        let parts = [self.without.gradient.clone(), moved.column(0).into_owned(), moved.column(1).into_owned()];
        let by = |matrix: &DMatrix<f64>| parts.each_ref().map(|part| matrix * part);
        let (mut whitened, mut along) = (Vec::new(), Vec::new());
        for size in &self.sizes {
            whitened.push(by(&size.rows));
            along.push(by(&size.directions));
        }
        Column { all: self, cycles, frequency, whitened, along }
    }

    fn level(&self, size: &Size) -> f64 {
        *size.level.get_or_init(|| {
            let jitters = match size.kms > 0.0 {
                true => Jitters::new(self.without, size.kms, self.scale_kms),
                false => Jitters::none(self.without),
            };
            let SearchSettings { draws, seed } = self.settings;
            FalseAlarm::draw(&jitters, &self.frequencies.per_cycle, draws, seed).level(self.probability)
        })
    }
}

impl Size {
    fn new(
        (kms, scale_kms): (f64, Option<f64>),
        without: &VelocityQuadratic,
        (lambda, u): (&DVector<f64>, &DMatrix<f64>),
        all: &Frequencies,
    ) -> Self {
        let left = lambda.map(|l| 1.0 / (1.0 + kms * kms * l));
        let among = |d: &DVector<f64>| u * DMatrix::from_diagonal(d) * u.transpose();
        let information = among(&lambda.component_mul(&left));
        let beside = VelocityQuadratic {
            cycles: without.cycles.clone(),
            gradient: DVector::zeros(lambda.len()),
            information: 0.5 * (&information + information.transpose()),
        };
        let mut trials = scan(&beside, &all.per_cycle);
        trials.retain(|trial| trial.orbit.is_some());
        let (columns, factors) = whitening(&beside.cycles, &trials, &among(&left));
        Size {
            kms,
            frequencies: trials.iter().map(|trial| trial.frequency).collect(),
            rows: columns.transpose(),
            factors,
            constant: 0.5 * left.map(f64::ln).sum() + ln_prior(kms, scale_kms),
            directions: DMatrix::from_diagonal(&left.map(|left| kms * (0.5 * left).sqrt())) * u.transpose(),
            level: OnceLock::new(),
        }
    }
}

impl Column<'_, '_> {
    /// The highest peak with the orbit of that semi-amplitude (km/s) and phase in the velocities; `None` where no orbit
    /// is bounded.
    pub fn highest(&self, k_kms: f64, phi: f64) -> Option<Highest> {
        let ab = amplitudes(self.cycles, self.frequency, k_kms, phi);
        let sum = |parts: &[DVector<f64>; 3]| &parts[0] + &parts[1] * ab.x + &parts[2] * ab.y;
        let alone: Vec<f64> =
            self.all.sizes.iter().zip(&self.along).map(|(s, a)| s.constant + sum(a).norm_squared()).collect();
        let best_alone = (0..alone.len()).max_by(|a, b| alone[*a].total_cmp(&alone[*b]))?;
        let whitened: Vec<DVector<f64>> = self.whitened.iter().map(sum).collect();
        let height = |size: usize, trial: usize| {
            let amplitudes = whitened[size].as_slice();
            0.5 * (amplitudes[2 * trial].powi(2) + amplitudes[2 * trial + 1].powi(2))
        };
        let all = (0..alone.len()).flat_map(|size| (0..self.all.sizes[size].frequencies.len()).map(move |t| (size, t)));
        let of = |&(size, trial): &(usize, usize)| alone[size] + height(size, trial);
        let best @ (size, trial) = all.max_by(|a, b| of(a).total_cmp(&of(b)))?;
        let Size { frequencies, factors, .. } = &self.all.sizes[size];
        let [a, b] = [whitened[size][2 * trial], whitened[size][2 * trial + 1]];
        let [first, below, second] = factors[trial];
        // (a, b) = L^-T of the whitened amplitudes
        let y = b / second;
        let x = (a - below * y) / first;
        let heights = |k: usize| height(size, k);
        Some(Highest {
            frequency: summit(frequencies, trial, heights),
            delta_ln_l: of(&best) - alone[best_alone],
            k_kms: x.hypot(y),
            level: self.all.level(&self.all.sizes[best_alone]),
        })
    }
}

/// Where the parabola through the peak at a trial and its neighbours is highest.
fn summit(frequencies: &[f64], trial: usize, height: impl Fn(usize) -> f64) -> f64 {
    if trial == 0 || trial + 1 == frequencies.len() {
        return frequencies[trial];
    }
    let [before, here, after] = [height(trial - 1), height(trial), height(trial + 1)];
    let bend = 2.0 * here - before - after;
    let step = 0.5 * (frequencies[trial + 1] - frequencies[trial - 1]);
    if bend > 0.0 {
        frequencies[trial] + (0.5 * step * (after - before) / bend).clamp(-step.abs(), step.abs())
    } else {
        frequencies[trial]
    }
}

#[cfg(test)]
mod tests {
    use super::super::FrequencySettings;
    use super::super::orbits::velocities;
    use super::super::sample::{self, uneven};
    use super::*;

    /// Against the search of velocities with the orbit in them, jitter by jitter.
    #[test]
    fn a_peak_is_that_of_the_search_with_the_orbit_in_the_velocities() {
        let cycles = uneven(20, 5.0);
        let rv = 0.08 * sample::normal(20, 3);
        let without = sample::correlated(&cycles, &rv, 5);
        let frequencies = Frequencies::new(&cycles, 1.0, FrequencySettings::default()).unwrap();
        let settings = SearchSettings { draws: 1000, seed: 1 };
        let injections = Injections::new((&without, None), 0.6, &frequencies, settings, 0.01);
        for (period, k_kms, phi) in [(1.7, 0.0, 0.0), (1.7, 0.3, 0.4), (0.61, 0.6, 0.9)] {
            let found = injections.column(period).highest(k_kms, phi).unwrap();
            let ab = amplitudes(&cycles, 1.0 / period, k_kms, phi);
            let moved = &without.gradient + &without.information * velocities(&cycles, 1.0 / period, ab);
            let moved = VelocityQuadratic { gradient: moved, ..without.clone() };
            let (mut with, mut alone) = ((f64::NEG_INFINITY, 0.0, 0.0), f64::NEG_INFINITY);
            for size in &injections.sizes {
                // ln L of this size above none, and the best orbit beside it
                let [none, here] = match size.kms > 0.0 {
                    true => {
                        let both = Jitters::new(&moved, size.kms, None);
                        [0, 4].map(|k| both.levels()[k].clone())
                    }
                    false => [0, 0].map(|k| Jitters::none(&moved).levels()[k].clone()),
                };
                let ln_l = here.ln_l - none.ln_l;
                alone = alone.max(ln_l);
                for orbit in scan(&here.quadratic, &frequencies.per_cycle).into_iter().filter_map(|trial| trial.orbit) {
                    if ln_l + orbit.delta_ln_l > with.0 {
                        with = (ln_l + orbit.delta_ln_l, orbit.k_kms, size.kms);
                    }
                }
            }
            assert!((found.delta_ln_l - (with.0 - alone)).abs() < 1e-8, "{found:?} {with:?} {alone}");
            assert!((found.k_kms - with.1).abs() < 1e-8, "{found:?} {with:?}");
            if k_kms > 0.2 {
                assert!((found.frequency * period - 1.0).abs() < 0.02 && found.delta_ln_l > found.level, "{found:?}");
            }
        }
    }
}
