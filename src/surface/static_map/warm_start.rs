//! Warm starts: images from which evaluations nearby start, each with its preconditioner and the data of a prediction.
//!
//! The reference is one. Far from it a Newton system is no longer close to the one that its preconditioner inverts, and
//! an evaluation takes hundreds of model applications instead of tens; another warm start there reduces them again, at
//! the cost of about five such evaluations. The result of an evaluation does not depend on its start beyond the
//! solver's tolerance.

use super::prediction::Prediction;
use crate::maxent::{Preconditioner, Start};
use crate::model::ParameterSpace;
use crate::surface::imaging::Imager;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;

/// An image, with the data that evaluations nearby need.
#[derive(Clone, Debug)]
pub struct WarmStart {
    /// Its position (physical coordinates).
    pub theta: Vec<f64>,
    /// The same in the coordinates of [`place`].
    pub place: Vec<f64>,
    /// The start of an evaluation there.
    pub start: Start,
    /// Approximate inverse of the Newton systems around it.
    pub preconditioner: Arc<Preconditioner>,
    /// Derivatives of image and lambda with the parameters.
    pub prediction: Prediction,
}

impl WarmStart {
    /// Approximate size in memory (bytes).
    fn bytes(&self) -> usize {
        let start = size_of_val(&self.start.image.coordinates[..]) + size_of_val(&self.start.path[..]);
        self.preconditioner.bytes() + self.prediction.bytes() + start
    }
}

/// Velocities that differ by this (km/s, in the root mean square over the profiles) are one unit apart in [`place`].
const VELOCITY_KMS: f64 = 0.02;

/// `theta` in coordinates of the profiles: the velocities of all of them and the free stellar parameters, each in a
/// unit of equal change of the profiles, so that distances measure the difference of the profiles.
pub fn place(imager: &Imager, space: &ParameterSpace, theta: &[f64]) -> Vec<f64> {
    let state = space.values_at(theta).state();
    let cycles = imager.cycles();
    let unit = VELOCITY_KMS * (cycles.len() as f64).sqrt();
    let mut place: Vec<f64> = state.motion.velocities_kms(&cycles).map(|v| (v + state.vsys_kms) / unit).collect();
    let stellar = space.free().iter().zip(theta).zip(space.scales()).filter(|((f, _), _)| !f.parameter.only_shifts());
    place.extend(stellar.map(|((_, x), scale)| x / scale));
    place
}

/// The warm start nearest to `theta`, the first of equals; without a search if there is only one.
pub fn nearest<'a>(
    warm_starts: &'a [WarmStart],
    imager: &Imager,
    space: &ParameterSpace,
    theta: &[f64],
) -> &'a WarmStart {
    if let [only] = warm_starts {
        return only;
    }
    let here = place(imager, space, theta);
    let to = |warm_start: &&WarmStart| distance(&warm_start.place, &here);
    warm_starts.iter().min_by(|a, b| to(a).total_cmp(&to(b))).expect("the reference is one")
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

/// Model applications per evaluation that starts so far from its end: about the mean on the setup of Petit et al.
fn applications(distance: f64) -> f64 {
    (15.0 + 6.0 * distance.powf(3.5)).min(500.0)
}

/// Model applications for making a warm start.
const PASSES: f64 = 2000.0;

/// Largest size of all warm starts in memory (bytes).
const MEMORY: usize = 1 << 29;

/// Largest number of points considered for a warm start, and largest number for assessing it; the others are similar.
const CONSIDERED: usize = 400;
const JUDGED: usize = 2000;

/// At most the number for the assessment of `thetas`, drawn at random, independent of their order; always the same.
pub fn sampled(thetas: &[Vec<f64>]) -> Vec<&Vec<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let chosen = rand::seq::index::sample(&mut rng, thetas.len(), JUDGED.min(thetas.len()));
    chosen.into_iter().map(|i| &thetas[i]).collect()
}

/// The `places` at which warm starts save more model applications than they cost, if so many `evaluations` are spread
/// like the places and the `reference` exists already: the one that saves most, then the next. The places are in no
/// particular order.
pub fn worthwhile(reference: &WarmStart, places: &[Vec<f64>], evaluations: usize) -> Vec<usize> {
    let each = evaluations as f64 / places.len() as f64;
    let mut now: Vec<f64> = places.iter().map(|place| applications(distance(&reference.place, place))).collect();
    // model applications of evaluations at all places from each candidate
    let from = |candidate: &Vec<f64>| places.iter().map(|place| applications(distance(candidate, place))).collect();
    let candidates: Vec<Vec<f64>> = places.iter().take(CONSIDERED).map(from).collect();
    let mut chosen = Vec::new();
    while chosen.len() < MEMORY / reference.bytes() {
        let saved = |then: &Vec<f64>| -> f64 {
            each * now.iter().zip(then).map(|(now, then)| (now - then).max(0.0)).sum::<f64>()
        };
        let best = candidates.iter().map(saved).enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((index, _)) = best.filter(|(_, saved)| *saved > PASSES) else { break };
        now.iter_mut().zip(&candidates[index]).for_each(|(now, then)| *now = now.min(*then));
        chosen.push(index);
    }
    chosen
}
