//! Warm starts: images that evaluations nearby start from, each with its preconditioner and what a prediction needs.
//!
//! The reference is one. Far from it a Newton system is no longer close to the one that its preconditioner inverts, and
//! an evaluation takes hundreds of model applications instead of tens; another warm start there brings it down again,
//! for the model applications of about five such evaluations. What an evaluation ends at does not depend on where it
//! started beyond the solver's tolerance.

use super::prediction::Prediction;
use crate::maxent::{Preconditioner, Start};
use crate::model::ParameterSpace;
use crate::surface::imaging::Imager;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;

/// An image, and what evaluations nearby need of it.
#[derive(Clone, Debug)]
pub struct WarmStart {
    /// Where it is (physical coordinates).
    pub theta: Vec<f64>,
    /// The same as [`place`] has it.
    pub place: Vec<f64>,
    /// Where an evaluation there starts.
    pub start: Start,
    /// Approximate inverse of the Newton systems around it.
    pub preconditioner: Arc<Preconditioner>,
    /// How image and lambda move with the parameters.
    pub prediction: Prediction,
}

impl WarmStart {
    /// Bytes that it takes in memory, all but a few.
    fn bytes(&self) -> usize {
        let start = size_of_val(&self.start.image.coordinates[..]) + size_of_val(&self.start.path[..]);
        self.preconditioner.bytes() + self.prediction.bytes() + start
    }
}

/// Velocities that differ by this (km/s, in the root mean square over the profiles) are one unit apart in [`place`].
const VELOCITY_KMS: f64 = 0.02;

/// Where `theta` is as profiles have it: the velocities of all of them and the star's own free parameters, each in a
/// unit that changes profiles as much, so that distances say how different the profiles are.
pub fn place(imager: &Imager, space: &ParameterSpace, theta: &[f64]) -> Vec<f64> {
    let state = space.values_at(theta).state();
    let cycles = imager.cycles();
    let unit = VELOCITY_KMS * (cycles.len() as f64).sqrt();
    let mut place: Vec<f64> = state.motion.velocities_kms(&cycles).map(|v| (v + state.vsys_kms) / unit).collect();
    let stellar = space.free().iter().zip(theta).zip(space.scales()).filter(|((f, _), _)| !f.parameter.only_shifts());
    place.extend(stellar.map(|((_, x), scale)| x / scale));
    place
}

/// The warm start nearest to `theta`, the first of equals; one that stands alone is not looked for.
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

/// Model applications per evaluation that starts so far from where it ends: about what the paper's setup takes in the
/// mean.
fn applications(distance: f64) -> f64 {
    (15.0 + 6.0 * distance.powf(3.5)).min(500.0)
}

/// Passes that a warm start takes to be made.
const PASSES: f64 = 2000.0;

/// Bytes that all warm starts together may take.
const MEMORY: usize = 1 << 29;

/// Most places that are considered for a warm start, and most that it is judged by; the others are like them.
const CONSIDERED: usize = 400;
const JUDGED: usize = 2000;

/// At most as many of `thetas` as are judged, drawn at random, so that no order of theirs shows; always the same.
pub fn sampled(thetas: &[Vec<f64>]) -> Vec<&Vec<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let chosen = rand::seq::index::sample(&mut rng, thetas.len(), JUDGED.min(thetas.len()));
    chosen.into_iter().map(|i| &thetas[i]).collect()
}

/// At which of `places` warm starts save more model applications than they take, if so many `evaluations` are spread
/// like the places and there is the `reference` already: the one that saves most, then the next. The places are in no
/// particular order.
pub fn worthwhile(reference: &WarmStart, places: &[Vec<f64>], evaluations: usize) -> Vec<usize> {
    let each = evaluations as f64 / places.len() as f64;
    let mut now: Vec<f64> = places.iter().map(|place| applications(distance(&reference.place, place))).collect();
    // what evaluations at all places would take from each candidate
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
