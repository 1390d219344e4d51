//! The surrogate of a density that recomputes its maps for each field of spots: expansions at its draws, with
//! interpolation; more of them until the density accepts its proposals.
//!
//! One quadratic in field and velocities together misses the dependence of the velocity uncertainties on the spots'
//! lifetime: two to four of ten proposals are rejected, and walkers stay for long where it is too low.

use super::Surrogate;
use super::conditional::LinearModel;
use super::correction::Drawn;
use crate::model::Parameter;
use crate::sampling::log_density::{Evaluator, LogDensity};
use crate::surface::expansion::Expansion;
use nalgebra::DVector;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// Draws of the posterior in each round, which also test the surrogate.
const TRIALS: usize = 64;

/// Draws of a wider distribution: chains begin there, and it covers the tails, where a surrogate that is too low by d
/// in ln L holds a walker for e^d steps.
const WIDE: usize = 32;

/// Its temperature: the divisor of differences of ln L. The largest d of three chains was 2.7, 1.4 and 1.1 at 2.5; 1.3,
/// 0.6 and 3.2 at 3; 1.1, 8.9 and 2.6 at 4, where one round fewer was enough for the second. Without the draws of the
/// last test as places it was 3.3, 1.7 and 1.6 at 2.5.
const TEMPERATURE: f64 = 3.0;

/// Largest number of rounds after the first.
const ROUNDS: usize = 4;

/// A sufficient fraction of accepted proposals.
const GOOD: f64 = 0.9;

/// Expansions between two checks of the stop flag.
const AT_ONCE: usize = 32;

/// Expansions in the velocities at the fields of `theta` (physical coordinates); `None` where there is none.
pub type AtField<'a> = dyn Fn(&[f64]) -> Option<Expansion> + Sync + 'a;

/// A draw with the expansion at its field.
struct Expanded {
    position: Vec<f64>,
    theta: Vec<f64>,
    expansion: Expansion,
}

impl Surrogate {
    /// With expansions `at` fields of spots, and the fraction of its proposals that are accepted; the usual fit where
    /// that fails.
    pub fn refined(self, mid_cycle: f64, density: &dyn LogDensity, at: &AtField, by: &dyn Evaluator) -> (Self, f64) {
        let free = self.space.free();
        let positions: Vec<usize> =
            (0..free.len()).filter(|&i| Parameter::FIELD.contains(&free[i].parameter)).collect();
        let (mut best, mut known): (Option<(Self, f64)>, Vec<Expanded>) = (None, Vec::new());
        for round in 0..=ROUNDS {
            let now = best.as_ref().map_or(&self, |best| &best.0);
            let wide = now.tempered(TEMPERATURE);
            let drawn = [(Some(now), TRIALS), (wide.as_ref(), WIDE)];
            let draws = drawn.into_iter().filter_map(|(of, count)| of.map(|of| of.positions(count, round as u64)));
            let Some(draws) = expanded(&draws.flatten().collect::<Vec<_>>(), density, at, by) else { break };
            let mut acceptance = 0.0;
            if let Some((surrogate, own)) = &mut best {
                let tried: Vec<Drawn> = draws.iter().take(TRIALS).map(|draw| surrogate.drawn(draw)).collect();
                acceptance = surrogate.acceptance_of(&tried, density);
                *own = acceptance;
            }
            // the draws of a test that was passed are places as well: they cost nothing more, and cover the tails
            known.extend(draws);
            let places: Vec<(DVector<f64>, &Expansion)> =
                known.iter().map(|of| (of.field(&positions), &of.expansion)).collect();
            let model = LinearModel::of(&places, &positions, &self.space, mid_cycle);
            let next = model.and_then(|model| Surrogate::of(model, self.space.clone(), self.time_base_cycles, 1.0));
            let Some(next) = next else { break };
            // no worse than the one before it, whose test this is
            best = Some((next, acceptance));
            if acceptance > GOOD {
                break;
            }
        }
        match best {
            Some((surrogate, acceptance)) if acceptance > 0.0 => (surrogate, acceptance),
            _ => self.fitted_if_poor(density, by),
        }
    }

    fn positions(&self, count: usize, round: u64) -> Vec<Vec<f64>> {
        let mut rng = ChaCha8Rng::seed_from_u64(round);
        (0..count).filter_map(|_| self.draw(&mut rng)).collect()
    }

    fn drawn(&self, of: &Expanded) -> Drawn {
        let values = self.space.values_at(&of.theta);
        let log_prob = of.expansion.log_likelihood_at(&values) + self.space.log_prior(&of.theta);
        (of.position.clone(), of.theta.clone(), log_prob)
    }
}

impl Expanded {
    fn field(&self, positions: &[usize]) -> DVector<f64> {
        DVector::from_iterator(positions.len(), positions.iter().map(|&i| self.position[i]))
    }
}

/// Those of the draws that have an expansion; `None` if told to stop.
fn expanded(draws: &[Vec<f64>], density: &dyn LogDensity, at: &AtField, by: &dyn Evaluator) -> Option<Vec<Expanded>> {
    let mut all = Vec::with_capacity(draws.len());
    for some in draws.chunks(AT_ONCE) {
        if !by.goes_on(some.len()) {
            return None;
        }
        let of = |position: &Vec<f64>| {
            let theta = density.to_physical(position);
            Some(Expanded { position: position.clone(), expansion: at(&theta)?, theta })
        };
        all.extend(some.par_iter().with_max_len(1).filter_map(of).collect::<Vec<_>>());
    }
    Some(all)
}
