//! The surrogate of a density that finds its maps anew for each field of spots: expansions at draws of its own,
//! interpolated between; more of them until the density accepts what it proposes.
//!
//! One quadratic in field and velocities together misses how the errors of velocities depend on the spots' lifetime:
//! two to four of ten proposals are refused, and walkers stay for long where it is too low.

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

/// Draws of the posterior in each round, on which the surrogate is tried as well.
const TRIALS: usize = 64;

/// Draws of a wider one: chains begin there, and tails are known.
const WIDE: usize = 32;

/// How much wider: what differences of ln L are divided by.
const TEMPERATURE: f64 = 2.5;

/// Rounds at most.
const ROUNDS: usize = 4;

/// A share of proposals accepted that is good enough.
const GOOD: f64 = 0.9;

/// Expansions made between two looks at whether to stop.
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
    /// With expansions `at` fields of spots, and the share of its proposals that are accepted. As it is fitted
    /// otherwise where that leads to nothing.
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
            if let Some((surrogate, acceptance)) = &mut best {
                let tried: Vec<Drawn> = draws.iter().take(TRIALS).map(|draw| surrogate.drawn(draw)).collect();
                *acceptance = surrogate.acceptance_of(&tried, density);
                if *acceptance > GOOD || round == ROUNDS {
                    break;
                }
            }
            known.extend(draws);
            let places: Vec<(DVector<f64>, &Expansion)> =
                known.iter().map(|of| (of.field(&positions), &of.expansion)).collect();
            let model = LinearModel::of(&places, &positions, &self.space, mid_cycle);
            let next = model.and_then(|model| Surrogate::of(model, self.space.clone(), self.time_base_cycles, 1.0));
            match next {
                Some(next) => best = Some((next, 0.0)),
                None => break,
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

/// Those of the draws that have an expansion; `None` where it was told to stop.
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
