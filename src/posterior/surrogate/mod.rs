//! A stand-in for the posterior that costs microseconds: the quadratic of [`crate::posterior::expansion`] with the
//! priors, frozen before a chain begins (`docs/method.md` section 5, surrogate move).
//!
//! Given the period, the quadratic is a Gaussian in K cos, K sin, the systemic velocity and the stellar parameters;
//! over the periods it is tabulated. Its tails are those of a t distribution, so that nothing it calls improbable is
//! out of reach.

mod conditional;
mod correction;
mod periods;
mod proposal;

use crate::posterior::expansion::{Expansion, free_stellar};
use crate::posterior::imaging::Imager;
use crate::posterior::objective::{Parameter, ParameterSpace, Reference};
use conditional::{Conditional, LinearModel};
use periods::PeriodTable;
use rand::{Rng, RngCore};

pub use proposal::SurrogateMove;

/// Degrees of freedom of the surrogate's tails.
const TAIL: f64 = 60.0;

/// Steps of the walk on the surrogate that make one draw of it.
const WALK: usize = 16;

/// The surrogate posterior of a parameter space in which K and phi are free.
#[derive(Clone, Debug)]
pub struct Surrogate {
    space: ParameterSpace,
    time_base_cycles: f64,
    model: LinearModel,
    periods: PeriodTable,
    /// Highest ln L over all periods.
    best: f64,
    /// What differences of ln L are divided by.
    temperature: f64,
}

/// A maximum of the surrogate's likelihood over the periods.
#[derive(Clone, Debug, PartialEq)]
pub struct Peak {
    /// Internal coordinates.
    pub position: Vec<f64>,
    /// ln L below that of the best peak.
    pub drop: f64,
}

/// A place with all that the walk needs to know of it.
#[derive(Clone, Debug)]
struct Place {
    position: Vec<f64>,
    /// ln of the surrogate density in sampling coordinates.
    log_density: f64,
    /// ln of the density with which [`Surrogate::propose`] comes here.
    log_proposal: f64,
}

impl Surrogate {
    /// Around `reference`; `None` where the space is not one that it is made for (K or phi fixed), or the likelihood
    /// has no maximum to second order.
    pub fn new(imager: &Imager, space: &ParameterSpace, reference: &Reference) -> Option<Self> {
        if !is_orbit_free(space) {
            return None;
        }
        Surrogate::of_expansion(&Expansion::of(imager, reference, &free_stellar(space.free())), space, imager)
    }

    /// Of an expansion whose stellar coordinates are those that `space` leaves free; `None` where K or phi is fixed, or
    /// the likelihood has no maximum.
    pub fn of_expansion(expansion: &Expansion, space: &ParameterSpace, imager: &Imager) -> Option<Self> {
        if !is_orbit_free(space) {
            return None;
        }
        let model = LinearModel::new(expansion, space, imager.mid_cycle());
        Surrogate::of(model, space.clone(), imager.time_base_cycles(), 1.0)
    }

    fn of(model: LinearModel, space: ParameterSpace, time_base_cycles: f64, temperature: f64) -> Option<Self> {
        let (periods, best) = PeriodTable::new(&model, &space, time_base_cycles, temperature)?;
        Some(Surrogate { space, time_base_cycles, model, periods, best, temperature })
    }

    /// The same with differences of ln L divided by `temperature`: wider, and with more weight on minor peaks.
    pub fn tempered(&self, temperature: f64) -> Option<Self> {
        Surrogate::of(self.model.clone(), self.space.clone(), self.time_base_cycles, temperature)
    }

    /// ln of the density at sampling coordinates, up to a constant; minus infinity outside the priors.
    pub fn log_density(&self, position: &[f64]) -> f64 {
        let period = self.model.period_of(position);
        match self.model.at(period, self.temperature) {
            Some(conditional) => self.density(&conditional, position),
            None => f64::NEG_INFINITY,
        }
    }

    fn density(&self, conditional: &Conditional, position: &[f64]) -> f64 {
        let theta = self.space.to_physical(position);
        let log_prior = self.space.log_prior(&theta);
        if !log_prior.is_finite() {
            return f64::NEG_INFINITY;
        }
        let linear = self.model.linear_of(position);
        let below = (self.best - conditional.log_likelihood(&linear)) / self.temperature;
        self.tail(below) + log_prior + self.space.log_jacobian(&theta)
    }

    /// ln of a t distribution's density so far `below` its peak in ln L.
    fn tail(&self, below: f64) -> f64 {
        let degrees = TAIL + self.space.dimension() as f64;
        -0.5 * degrees * (2.0 * below.max(-0.25 * TAIL) / TAIL).ln_1p()
    }

    /// A place drawn from the table of periods and the Gaussian (with heavier tails) at the period.
    fn propose(&self, rng: &mut dyn RngCore) -> Option<Place> {
        let (period, log_period) = self.periods.draw(rng);
        let conditional = self.model.at(period, self.temperature)?;
        let (linear, log_linear) = conditional.draw(rng);
        let position = self.model.position(period, &linear);
        let log_density = self.density(&conditional, &position);
        Some(Place { position, log_density, log_proposal: log_period + log_linear })
    }

    /// The place at `position`.
    fn place(&self, position: &[f64]) -> Option<Place> {
        let period = self.model.period_of(position);
        let conditional = self.model.at(period, self.temperature)?;
        let log_proposal = self.periods.log_density(period) + conditional.log_density(&self.model.linear_of(position));
        Some(Place { position: position.to_vec(), log_density: self.density(&conditional, position), log_proposal })
    }

    /// The end of a walk of independent proposals on the surrogate that begins at `place`: reversible with respect to
    /// it, and after so many steps all but a draw of it.
    fn walk(&self, mut place: Place, rng: &mut dyn RngCore) -> Place {
        for _ in 0..WALK {
            let log_uniform = rng.random::<f64>().ln();
            let Some(next) = self.propose(rng) else { continue };
            let gain = |p: &Place| p.log_density - p.log_proposal;
            if next.log_density.is_finite() && log_uniform < gain(&next) - gain(&place) {
                place = next;
            }
        }
        place
    }

    /// A draw in sampling coordinates; `None` if the priors leave no place.
    pub fn draw(&self, rng: &mut dyn RngCore) -> Option<Vec<f64>> {
        const TRIES: usize = 200;
        let first = (0..TRIES).find_map(|_| self.propose(rng).filter(|place| place.log_density.is_finite()))?;
        Some(self.walk(self.walk(first, rng), rng).position)
    }

    /// Maxima over the periods that lie within `drop` of the best in ln L, highest first, at most so many.
    pub fn peaks(&self, drop: f64, most: usize) -> Vec<Peak> {
        let heights = self.periods.peaks();
        let chosen = heights.into_iter().filter(|(_, height)| self.best - height <= drop).take(most);
        let peak = |(period, height): (f64, f64)| {
            let linear = self.model.at(period, 1.0)?.mode();
            Some(Peak { position: self.model.position(period, &linear), drop: self.best - height })
        };
        chosen.filter_map(peak).collect()
    }
}

/// Whether K and phi are free.
fn is_orbit_free(space: &ParameterSpace) -> bool {
    [Parameter::K, Parameter::Phi].iter().all(|p| space.free().iter().any(|f| f.parameter == *p))
}
