//! The start of the walkers of a run: at draws from the surrogate, around the maxima of the search, or all over the
//! prior.

use super::RunError;
use super::error::PRIOR_TRIES;
use crate::data::scene::Scene;
use crate::inference::search::Found;
use crate::runs::pool::Target;
use crate::sampling::ensemble::{EnsembleError, Positions, StartDraw, draw_start, start_numbers};
use crate::sampling::log_density::{Evaluator, LogDensity as _};
use crate::sampling::optimise::Optimum;
use crate::surface::surrogate::Surrogate;
use rand_chacha::ChaCha8Rng;

/// Starts are wider than the curvature by this factor, so that R-hat reveals whether the chain has forgotten them.
const OVERDISPERSION: f64 = 1.5;

/// Draws from the surrogate tried for one walker.
const DRAW_TRIES: usize = 3;

/// Walkers drawn from the surrogate, wider than the posterior and with more of them around minor peaks than their
/// weight; `None` where the priors exclude most of it, or no reconstruction succeeds at a draw.
pub(super) fn from_surrogate(
    surrogate: &Surrogate,
    target: &Target,
    evaluator: &dyn Evaluator,
    scene: &Scene,
) -> Option<Positions> {
    let wide = surrogate.tempered(OVERDISPERSION.powi(2))?;
    let draw = |rng: &mut ChaCha8Rng| Some(target.to_physical(&wide.draw(rng)?));
    reconstructed(evaluator, scene, DRAW_TRIES, draw)
}

/// Walkers around the optimum and its rivals. Where there are several maxima, half of an ensemble starts around one of
/// them and half around all in turn, another one for each ensemble: so walkers can move between them, and R-hat reveals
/// if they do not.
pub(super) fn around_maxima(
    found: &Found,
    target: &Target,
    evaluator: &dyn Evaluator,
    scene: &Scene,
) -> Result<Positions, RunError> {
    let sampler = &scene.settings.sampler;
    let maxima: Vec<&Optimum> = std::iter::once(&found.optimum).chain(found.rivals()).collect();
    let draw = |(m, maximum): (usize, &&Optimum)| {
        let draw = StartDraw {
            centre: &maximum.theta,
            covariance: &maximum.covariance,
            scale: OVERDISPERSION,
            ensembles: sampler.ensembles,
            walkers: sampler.walkers(),
            seed: sampler.seed.wrapping_add(m as u64),
        };
        draw_start(target, &draw, &|theta| scene.space.log_prior(theta).is_finite())
    };
    let around: Result<Vec<Positions>, _> = maxima.iter().enumerate().map(draw).collect();
    let around = match around {
        // data so weak that the curvature is wider than the prior
        Err(EnsembleError::StartOutside { .. }) => return over_prior(evaluator, scene),
        around => around?,
    };
    let choose = |e: usize, w: usize| if w.is_multiple_of(2) { e % maxima.len() } else { (w / 2) % maxima.len() };
    let walker = |e: usize, w: usize| around[choose(e, w)][e][w].clone();
    Ok((0..sampler.ensembles).map(|e| (0..sampler.walkers()).map(|w| walker(e, w)).collect()).collect())
}

/// Draws from the prior at which the reconstruction succeeds.
pub(super) fn over_prior(evaluator: &dyn Evaluator, scene: &Scene) -> Result<Positions, RunError> {
    let draw = |rng: &mut ChaCha8Rng| Some(scene.space.sample_prior(rng));
    reconstructed(evaluator, scene, PRIOR_TRIES, draw).ok_or(RunError::PriorStart)
}

/// The first of so many draws, for each walker, at which the reconstruction succeeds; `None` if a walker finds none.
fn reconstructed(
    evaluator: &dyn Evaluator,
    scene: &Scene,
    tries: usize,
    draw: impl Fn(&mut ChaCha8Rng) -> Option<Vec<f64>>,
) -> Option<Positions> {
    let sampler = &scene.settings.sampler;
    let walkers = sampler.ensembles * sampler.walkers();
    let numbers = |index| start_numbers(sampler.seed, index / sampler.walkers(), index % sampler.walkers());
    let mut numbers: Vec<ChaCha8Rng> = (0..walkers).map(numbers).collect();
    let mut positions: Vec<Option<Vec<f64>>> = vec![None; walkers];
    for _ in 0..tries {
        let without = (0..walkers).filter(|&index| positions[index].is_none());
        let drawn = without.filter_map(|index| Some((index, draw(&mut numbers[index])?)));
        let (indices, batch): (Vec<usize>, Vec<Vec<f64>>) = drawn.unzip();
        let evaluations = evaluator.evaluate(&batch);
        for ((index, theta), evaluation) in indices.into_iter().zip(batch).zip(evaluations) {
            positions[index] = evaluation.log_prob.is_finite().then_some(theta);
        }
        if positions.iter().all(Option::is_some) {
            break;
        }
    }
    let positions: Vec<Vec<f64>> = positions.into_iter().collect::<Option<_>>()?;
    Some(positions.chunks(sampler.walkers()).map(<[_]>::to_vec).collect())
}
