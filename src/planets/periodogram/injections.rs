//! Orbits injected into the velocities of a star, and the highest peak of each, with a jitter and nightly offsets of
//! unknown size and spots of an unknown field.
//!
//! An orbit adds `I V` to the gradient and changes nothing else, so that the whitened gradient at every trial period
//! and for every size of the jitter is linear in the orbit's two amplitudes: three products per period, and each orbit
//! of that period is a sum. A jitter that absorbs an orbit grows with it, so its values reach from 0 to the largest
//! orbit, those of offsets to the largest allowed. Spots that absorb an orbit belong to another field with a shorter
//! lifetime: a search uses the field that maximises ln L with the orbit in the velocities and no planet in the model,
//! which lies between the given fields.

use super::draws::factor;
use super::false_alarm::FalseAlarm;
use super::jitter::{Jitters, Scatter};
use super::nights::{Beside, Nights, beside, clipped, most_offset_kms, scatters};
use super::orbits::{amplitudes, design, scan};
use super::{Frequencies, SearchSettings};
use crate::numerics::once;
use crate::planets::velocities::VelocityQuadratic;
use nalgebra::{DMatrix, DVector, Matrix2, Vector2};
use rayon::prelude::*;
use std::sync::OnceLock;

/// Ratio of successive jitters.
const STEP: f64 = std::f64::consts::SQRT_2;

/// Ratio of successive nightly offsets.
const STEP_OF_OFFSETS: f64 = 2.0;

/// The smallest jitter, in standard errors of a velocity.
const SMALLEST: f64 = 0.35;

/// Draws for the detection threshold with a fitted jitter, one threshold per jitter; beyond their reach the form of the
/// tail is used.
const DRAWS: usize = 1000;

/// A star without a planet, with one field of spots.
#[derive(Clone, Debug)]
pub struct OfField {
    /// The velocities that are searched; without a jitter where the jitter is fitted.
    pub velocities: VelocityQuadratic,
    /// The velocities for the fit of the field: all constant velocities fixed.
    pub held: VelocityQuadratic,
    /// The objective of that fit: ln L at velocities 0, including the prior of the field.
    pub ln_posterior: f64,
}

/// What is known of the jitter.
#[derive(Clone, Debug)]
pub enum Jitter {
    /// Its size: it is part of the noise.
    Known,
    /// It is fitted, as are offsets of these nights, for a spectrograph of that stability (km/s).
    Fitted(f64, Option<Nights>),
}

/// A star without a planet, into which orbits are injected.
pub struct Injections<'a> {
    fields: Vec<Field<'a>>,
    frequencies: &'a Frequencies,
    settings: SearchSettings,
    probability: f64,
    /// cos and sin of all trial periods.
    trials: DMatrix<f64>,
}

/// One field, with all jitters and offsets.
struct Field<'a> {
    star: &'a OfField,
    /// Stability of the spectrograph (km/s), where the jitter is fitted.
    stability_kms: Option<f64>,
    nights: Option<Nights>,
    sizes: Vec<Size>,
}

/// One jitter and one size of offsets.
struct Size {
    scatter: Scatter,
    /// From the gradient without a jitter to that beside it.
    left: DMatrix<f64>,
    /// From the gradient in (a, b) at every trial period to whitened amplitudes: lower factors of the information;
    /// infinite where the orbit is unbounded.
    factors: Vec<[f64; 3]>,
    /// ln L at velocities 0: a constant, and directions of the gradient whose squares add to it.
    constant: f64,
    directions: DMatrix<f64>,
    /// Detection threshold in Delta ln L where this size is the best for the star without an orbit.
    level: OnceLock<f64>,
}

/// Orbits of one period.
pub struct Column<'a, 'b> {
    all: &'b Injections<'a>,
    cycles: &'a [f64],
    frequency: f64,
    fields: Vec<OfPeriod>,
}

/// Effect of orbits of one period, with one field.
struct OfPeriod {
    /// ln L without a planet and without a jitter, in (a, b).
    gradient: Vector2<f64>,
    information: Matrix2<f64>,
    /// For each size, the whitened amplitudes and those along the directions: without an orbit, and for a and b of 1
    /// km/s.
    whitened: Vec<[DVector<f64>; 3]>,
    along: Vec<[DVector<f64>; 3]>,
}

/// The highest peak.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Highest {
    /// Frequency (orbits a rotation cycle), refined between the trial periods.
    pub frequency: f64,
    /// ln L relative to no planet, at a trial period.
    pub delta_ln_l: f64,
    /// Semi-amplitude (km/s).
    pub k_kms: f64,
    /// Detection threshold in Delta ln L.
    pub level: f64,
}

impl<'a> Injections<'a> {
    /// Injections into a star with one of these `fields`, evenly spaced along a line; orbits of up to `most_kms`. A
    /// detection has that false-alarm `probability`.
    pub fn new(
        fields: &'a [OfField],
        jitter: &Jitter,
        most_kms: f64,
        frequencies: &'a Frequencies,
        settings: SearchSettings,
        probability: f64,
    ) -> Self {
        let trials = design(&fields[0].velocities.cycles, &frequencies.per_cycle);
        let fields = fields.iter().map(|star| Field::new(star, jitter, most_kms, frequencies)).collect();
        let settings = match jitter {
            Jitter::Known => settings,
            Jitter::Fitted(..) => SearchSettings { draws: DRAWS.min(settings.draws), ..settings },
        };
        Injections { fields, frequencies, settings, probability, trials }
    }

    /// Orbits of that period over the rotation period.
    pub fn column(&self, porb_over_prot: f64) -> Column<'a, '_> {
        let frequency = 1.0 / porb_over_prot;
        let cycles: &[f64] = &self.fields[0].star.velocities.cycles;
        let orbits = design(cycles, &[frequency]);
        let fields = self.fields.iter().map(|field| field.of_period(&orbits, &self.trials)).collect();
        Column { all: self, cycles, frequency, fields }
    }

    fn level(&self, field: &Field, size: &Size) -> f64 {
        *once::found(&size.level, || {
            let (velocities, Scatter { jitter_kms, night_kms }) = (&field.star.velocities, size.scatter);
            let fitted = |stability_kms: f64| {
                // without offsets in the model a jitter absorbs them
                let of_nights = |nights: &Nights| {
                    let most_kms = most_offset_kms(stability_kms);
                    let units = nights.units(velocities, size.scatter, (jitter_kms.hypot(night_kms), most_kms));
                    beside(velocities, nights, (size.scatter, units), stability_kms)
                };
                let of_jitter = || Jitters::new(velocities, jitter_kms, stability_kms);
                field.nights.as_ref().and_then(of_nights).unwrap_or_else(of_jitter)
            };
            let jitters = field.stability_kms.map_or_else(|| Jitters::none(velocities), fitted);
            let SearchSettings { draws, seed } = self.settings;
            FalseAlarm::draw(&jitters, &self.frequencies.per_cycle, draws, seed).level(self.probability)
        })
    }
}

impl<'a> Field<'a> {
    fn new(star: &'a OfField, jitter: &Jitter, most_kms: f64, frequencies: &Frequencies) -> Self {
        let velocities = &star.velocities;
        let error_kms = (velocities.len() as f64 / velocities.information.trace()).sqrt();
        let sizes = |step: f64, most_kms: f64| {
            let (mut kms, mut next) = (vec![0.0], SMALLEST * error_kms);
            while next < step * most_kms {
                kms.push(next);
                next *= step;
            }
            kms
        };
        let most_kms = most_kms.max(error_kms);
        let (stability_kms, nights, scatters) = match jitter {
            Jitter::Known => (None, None, scatters(&[0.0], &[0.0])),
            Jitter::Fitted(scale, None) => (Some(*scale), None, scatters(&sizes(STEP, most_kms), &[0.0])),
            Jitter::Fitted(scale, nights) => {
                let largest_kms = most_offset_kms(*scale);
                let offsets = clipped(&sizes(STEP_OF_OFFSETS, largest_kms), largest_kms);
                (Some(*scale), nights.clone(), scatters(&sizes(STEP, most_kms), &offsets))
            }
        };
        let of_all = nights.clone().unwrap_or_else(|| Nights::none(velocities.len()));
        let size = |scatter: &Scatter| {
            // where the jitter is known there is none
            let beside = Beside::new(velocities, &of_all, *scatter, stability_kms.unwrap_or(f64::INFINITY))?;
            Some(Size::new(*scatter, &beside, velocities, frequencies))
        };
        let sizes = scatters.par_iter().filter_map(size).collect();
        Field { star, stability_kms, nights, sizes }
    }

    /// With `orbits` of 1 km/s, cos and sin of one period.
    fn of_period(&self, orbits: &DMatrix<f64>, trials: &DMatrix<f64>) -> OfPeriod {
        let OfField { velocities, held, .. } = self.star;
        let moved = &velocities.information * orbits;
        let parts = [velocities.gradient.clone(), moved.column(0).into_owned(), moved.column(1).into_owned()];
        let whitened = |size: &Size| parts.each_ref().map(|part| size.whitened(trials.tr_mul(&(&size.left * part))));
        let along = |size: &Size| parts.each_ref().map(|part| &size.directions * part);
        let (b, a) = (orbits.tr_mul(&held.gradient), orbits.tr_mul(&(&held.information * orbits)));
        OfPeriod {
            gradient: Vector2::new(b[0], b[1]),
            information: Matrix2::from_fn(|i, j| a[(i, j)]),
            whitened: self.sizes.iter().map(whitened).collect(),
            along: self.sizes.iter().map(along).collect(),
        }
    }
}

impl Size {
    fn new(scatter: Scatter, beside: &Beside, without: &VelocityQuadratic, all: &Frequencies) -> Self {
        let trials = scan(&beside.likelihood(without), &all.per_cycle);
        Size {
            scatter,
            left: beside.kept(),
            factors: trials.iter().map(|trial| factor(trial).unwrap_or(UNBOUNDED)).collect(),
            constant: beside.constant,
            directions: &beside.solved * std::f64::consts::FRAC_1_SQRT_2,
            level: OnceLock::new(),
        }
    }

    /// Whitened amplitudes from the gradient in (a, b) at every trial period.
    fn whitened(&self, mut gradient: DVector<f64>) -> DVector<f64> {
        for (trial, [first, below, second]) in self.factors.iter().enumerate() {
            let a = gradient[2 * trial] / first;
            gradient[2 * trial] = a;
            gradient[2 * trial + 1] = (gradient[2 * trial + 1] - below * a) / second;
        }
        gradient
    }
}

/// Factors by which whitened amplitudes are 0.
const UNBOUNDED: [f64; 3] = [f64::INFINITY, 0.0, f64::INFINITY];

/// Amplitudes for the orbit (a, b) from those without an orbit and with a and b of 1 km/s.
fn sum(parts: &[DVector<f64>; 3], ab: Vector2<f64>) -> DVector<f64> {
    &parts[0] + &parts[1] * ab.x + &parts[2] * ab.y
}

/// Index of the largest value.
fn largest(values: &[f64]) -> Option<usize> {
    (0..values.len()).max_by(|a, b| values[*a].total_cmp(&values[*b]))
}

/// Index of the maximum reached by climbing from one of the values.
fn uphill(values: &[f64], mut at: usize) -> usize {
    while at + 1 < values.len() && values[at + 1] > values[at] {
        at += 1;
    }
    while at > 0 && values[at - 1] > values[at] {
        at -= 1;
    }
    at
}

impl Column<'_, '_> {
    /// The highest peak with the orbit of that semi-amplitude (km/s) and phase in the velocities; `None` where no orbit
    /// is bounded.
    pub fn highest(&self, k_kms: f64, phi: f64) -> Option<Highest> {
        let ab = amplitudes(self.cycles, self.frequency, k_kms, phi);
        let posteriors = self.ln_posteriors(ab);
        // like a fit, which climbs from the field without the orbit and may miss a higher maximum
        let best = uphill(&posteriors, largest(&self.ln_posteriors(Vector2::zeros()))?);
        let here = self.highest_in(best, ab)?;
        if best == 0 || best + 1 == posteriors.len() {
            return Some(here);
        }
        let beyond = vertex([0, 1, 2].map(|k| posteriors[best + k - 1]));
        let next = self.highest_in(if beyond > 0.0 { best + 1 } else { best - 1 }, ab)?;
        Some(here.towards(next, beyond.abs()))
    }

    /// The objective of fits without a planet, for each field, with (a, b) in the velocities.
    fn ln_posteriors(&self, ab: Vector2<f64>) -> Vec<f64> {
        self.all.fields.iter().zip(&self.fields).map(|(field, of)| field.ln_posterior(of, ab)).collect()
    }

    /// The highest peak with one of the fields, with the orbit (a, b) in the velocities.
    fn highest_in(&self, field: usize, ab: Vector2<f64>) -> Option<Highest> {
        let (of, field) = (&self.fields[field], &self.all.fields[field]);
        let alone = field.alone(of, ab);
        let best_alone = largest(&alone)?;
        let whitened: Vec<DVector<f64>> = of.whitened.iter().map(|parts| sum(parts, ab)).collect();
        let height = |size: usize, trial: usize| {
            let amplitudes = whitened[size].as_slice();
            0.5 * (amplitudes[2 * trial].powi(2) + amplitudes[2 * trial + 1].powi(2))
        };
        let bounded = |size: usize, trial: usize| field.sizes[size].factors[trial] != UNBOUNDED;
        let frequencies = &self.all.frequencies.per_cycle;
        let of_size = |size: usize| (0..frequencies.len()).map(move |trial| (size, trial));
        let all = (0..alone.len()).flat_map(of_size).filter(|&(size, trial)| bounded(size, trial));
        let total = |&(size, trial): &(usize, usize)| alone[size] + height(size, trial);
        let best @ (size, trial) = all.max_by(|a, b| total(a).total_cmp(&total(b)))?;
        let [a, b] = [whitened[size][2 * trial], whitened[size][2 * trial + 1]];
        let [first, below, second] = field.sizes[size].factors[trial];
        // (a, b) = L^-T of the whitened amplitudes
        let y = b / second;
        let x = (a - below * y) / first;
        Some(Highest {
            frequency: summit(frequencies, trial, |k| height(size, k)),
            delta_ln_l: total(&best) - alone[best_alone],
            k_kms: x.hypot(y),
            level: self.all.level(field, &field.sizes[best_alone]),
        })
    }
}

impl Field<'_> {
    /// ln L without a planet at each jitter relative to no jitter, with (a, b) in the velocities.
    fn alone(&self, of: &OfPeriod, ab: Vector2<f64>) -> Vec<f64> {
        self.sizes.iter().zip(&of.along).map(|(size, along)| size.constant + sum(along, ab).norm_squared()).collect()
    }

    /// The objective of a fit without a planet and without nightly offsets, with (a, b) in the velocities.
    fn ln_posterior(&self, of: &OfPeriod, ab: Vector2<f64>) -> f64 {
        let alone = self.alone(of, ab).into_iter().zip(&self.sizes);
        let of_jitter = alone.filter(|(_, size)| size.scatter.night_kms == 0.0).map(|(ln_l, _)| ln_l);
        let of_jitter = of_jitter.fold(f64::NEG_INFINITY, f64::max);
        self.star.ln_posterior - of.gradient.dot(&ab) - 0.5 * ab.dot(&(of.information * ab)) + of_jitter
    }
}

impl Highest {
    /// Interpolation towards the peak of a neighbouring field: heights change by a factor from one field to the next.
    fn towards(self, next: Highest, share: f64) -> Self {
        let between = |a: f64, b: f64| a + share * (b - a);
        Highest {
            frequency: self.frequency,
            delta_ln_l: self.delta_ln_l.powf(1.0 - share) * next.delta_ln_l.powf(share),
            k_kms: between(self.k_kms, next.k_kms),
            level: between(self.level, next.level),
        }
    }
}

/// Vertex of the parabola through three even steps, the middle one the highest: steps from the middle.
fn vertex([before, here, after]: [f64; 3]) -> f64 {
    let bend = 2.0 * here - before - after;
    if bend > 0.0 { (0.5 * (after - before) / bend).clamp(-1.0, 1.0) } else { 0.0 }
}

/// Vertex of the parabola through the peak at a trial and its neighbours.
fn summit(frequencies: &[f64], trial: usize, height: impl Fn(usize) -> f64) -> f64 {
    if trial == 0 || trial + 1 == frequencies.len() {
        return frequencies[trial];
    }
    let step = 0.5 * (frequencies[trial + 1] - frequencies[trial - 1]);
    frequencies[trial] + step * vertex([0, 1, 2].map(|k| height(trial + k - 1)))
}

#[cfg(test)]
mod tests;
