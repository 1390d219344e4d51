//! A surrogate of the posterior that costs microseconds: the quadratic of [`crate::surface::expansion`] with the
//! priors, frozen before a chain begins (`docs/method.md` section 5, surrogate move).
//!
//! At a given period, the quadratic is a Gaussian in K cos, K sin, the systemic velocity and the stellar parameters;
//! over the periods it is tabulated. For eccentric orbits it is one at a given shape as well, which is drawn from its
//! prior; for two planets, at both given periods, each tabulated with the other at its best. Where maps are recomputed
//! for each field of spots, the quadratics of some fields are interpolated (`interpolation`). Its tails are those of a
//! t distribution, so that improbable points remain reachable.

mod conditional;
mod correction;
mod interpolation;
mod periods;
mod planet;
mod proposal;
mod refinement;
mod student;

use crate::model::{Elements, Parameter, ParameterSpace};
use crate::surface::expansion::{Expansion, free_stellar};
use crate::surface::imaging::Imager;
use crate::surface::static_map::Reference;
use conditional::{Conditional, Given, LinearModel};
use nalgebra::DVector;
use periods::{PeriodTable, Scale};
use rand::{Rng, RngCore};

pub use proposal::SurrogateMove;

/// Degrees of freedom of the surrogate's tails.
const TAIL: f64 = 60.0;

/// Steps of the walk on the surrogate per draw.
const WALK: usize = 16;

/// The same where shapes are drawn from their priors, or periods of two planets and fields independently.
const LONG_WALK: usize = 96;

/// The surrogate posterior of a parameter space in which K of a planet is free, with phi or the time of a conjunction.
#[derive(Clone, Debug)]
pub struct Surrogate {
    space: ParameterSpace,
    time_base_cycles: f64,
    model: LinearModel,
    /// One for each planet; none where a conjunction is a parameter, and period and time are drawn from their priors.
    periods: Vec<Option<PeriodTable>>,
    /// Steps of its walk.
    walk: usize,
    /// Highest ln L over all periods.
    best: f64,
    /// Divisor of differences of ln L.
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

/// A point with the data of the walk.
#[derive(Clone, Debug)]
struct Place {
    position: Vec<f64>,
    /// ln of the surrogate density in sampling coordinates.
    log_density: f64,
    /// ln of the density with which [`Surrogate::propose`] gives it.
    log_proposal: f64,
}

/// A proposal of the walk before its quadratic is known.
#[derive(Clone, Debug)]
struct Attempt {
    given: Given,
    /// The linear coordinates, in units of their uncertainties around their mode.
    linear: DVector<f64>,
    /// ln of the density of `given`.
    log_proposal: f64,
}

impl Surrogate {
    /// Around `reference`; `None` where the space is not supported, or the likelihood has no maximum to second order.
    pub fn new(imager: &Imager, space: &ParameterSpace, reference: &Reference) -> Option<Self> {
        if !is_orbit_free(space) {
            return None;
        }
        Surrogate::of_expansion(&Expansion::of(imager, reference, &free_stellar(space.free())), space, imager)
    }

    /// From an expansion whose stellar coordinates are those that `space` leaves free; `None` where the space is not
    /// supported, or the likelihood has no maximum.
    pub fn of_expansion(expansion: &Expansion, space: &ParameterSpace, imager: &Imager) -> Option<Self> {
        if !is_orbit_free(space) {
            return None;
        }
        let model = LinearModel::new(expansion, space, imager.mid_cycle())?;
        Surrogate::of(model, space.clone(), imager.time_base_cycles(), 1.0)
    }

    fn of(model: LinearModel, space: ParameterSpace, time_base_cycles: f64, temperature: f64) -> Option<Self> {
        let scale = Scale { dimension: space.dimension(), time_base_cycles, temperature };
        let planets = model.planets();
        // every planet with the others on circular orbits of these periods
        let table = |which: usize, beside: &[f64]| {
            let at = |period: f64, temperature: f64| {
                model.at(&model.circles(|i| if i == which { period } else { beside[i] }), temperature)
            };
            PeriodTable::new(&at, model.column_of(which), planets[which].period(), scale)
        };
        let centre: Vec<f64> = planets.iter().map(|planet| planet.central_period()).collect();
        let tabulated: Vec<usize> = (0..planets.len()).filter(|i| planets[*i].has_table()).collect();
        let (best, tables) = match tabulated[..] {
            [] => {
                let conditional = model.at(&model.circles(|i| centre[i]), 1.0)?;
                (conditional.log_likelihood(&conditional.mode()), Vec::new())
            }
            [only] => {
                let (table, best) = table(only, &centre)?;
                (best, vec![(only, table)])
            }
            _ => pair(&table, &centre)?,
        };
        let mut periods: Vec<Option<PeriodTable>> = planets.iter().map(|_| None).collect();
        tables.into_iter().for_each(|(which, table)| periods[which] = Some(table));
        let is_plain = matches!(planets, [planet] if planet.plain().is_some()) && model.interpolation().is_none();
        let walk = if is_plain { WALK } else { LONG_WALK };
        Some(Surrogate { space, time_base_cycles, model, periods, walk, best, temperature })
    }

    /// The same with differences of ln L divided by `temperature`: wider, and with more weight on minor peaks.
    pub fn tempered(&self, temperature: f64) -> Option<Self> {
        Surrogate::of(self.model.clone(), self.space.clone(), self.time_base_cycles, temperature)
    }

    /// ln of the density at sampling coordinates, up to a constant; minus infinity outside the priors.
    pub fn log_density(&self, position: &[f64]) -> f64 {
        let (given, linear) = self.model.split(position);
        match self.model.at(&given, self.temperature) {
            Some(conditional) => self.density(&conditional, &linear, position),
            None => f64::NEG_INFINITY,
        }
    }

    fn density(&self, conditional: &Conditional, linear: &DVector<f64>, position: &[f64]) -> f64 {
        let theta = self.space.to_physical(position);
        let log_prior = self.space.log_prior(&theta);
        if !log_prior.is_finite() {
            return f64::NEG_INFINITY;
        }
        let below = (self.best - conditional.log_likelihood(linear)) / self.temperature;
        self.tail(below) + log_prior + self.space.log_jacobian(&theta)
    }

    /// ln of a t distribution's density this far `below` its peak in ln L.
    fn tail(&self, below: f64) -> f64 {
        let degrees = TAIL + self.space.dimension() as f64;
        -0.5 * degrees * (2.0 * below.max(-0.25 * TAIL) / TAIL).ln_1p()
    }

    /// A point drawn from the tables of periods, the priors of shapes, and the Gaussian (with heavier tails) there.
    fn propose(&self, rng: &mut dyn RngCore) -> Option<Place> {
        let attempt = self.attempt(rng);
        self.model.at(&attempt.given, self.temperature).map(|conditional| self.placed(&attempt, &conditional))
    }

    /// The random numbers of a proposal.
    fn attempt(&self, rng: &mut dyn RngCore) -> Attempt {
        let mut log_proposal = 0.0;
        let mut planets = Vec::with_capacity(self.periods.len());
        for (planet, table) in self.model.planets().iter().zip(&self.periods) {
            let drawn = table.as_ref().map(|table| table.draw(rng));
            let (at, log_shape) = planet.draw(drawn.map(|drawn| drawn.0), rng);
            log_proposal += drawn.map_or(0.0, |drawn| drawn.1) + log_shape;
            planets.push(at);
        }
        let between = self.model.interpolation().map(|(between, _)| between);
        let (field, log_field) = between.map_or((DVector::zeros(0), 0.0), |b| b.draw(self.temperature, rng));
        log_proposal += log_field;
        let linear = student::draw(self.model.linear_count(), rng);
        Attempt { given: Given { planets, field }, linear, log_proposal }
    }

    /// The point of an attempt, by the quadratic at its nonlinear coordinates.
    fn placed(&self, attempt: &Attempt, conditional: &Conditional) -> Place {
        let (linear, log_linear) = conditional.drawn(&attempt.linear);
        let position = self.model.position(&attempt.given, &linear);
        let log_density = self.density(conditional, &linear, &position);
        Place { position, log_density, log_proposal: attempt.log_proposal + log_linear }
    }

    /// The point at `position`.
    fn place(&self, position: &[f64]) -> Option<Place> {
        let (given, linear) = self.model.split(position);
        let conditional = self.model.at(&given, self.temperature)?;
        let between = self.model.interpolation().map(|(between, _)| between);
        let mut log_proposal = between.map_or(0.0, |between| between.log_draw(&given.field, self.temperature));
        for ((planet, table), at) in self.model.planets().iter().zip(&self.periods).zip(&given.planets) {
            log_proposal += table.as_ref().map_or(0.0, |table| table.log_density(at.period));
            log_proposal += planet.log_draw(at, table.is_none());
        }
        let log_proposal = log_proposal + conditional.log_density(&linear);
        let log_density = self.density(&conditional, &linear, position);
        Some(Place { position: position.to_vec(), log_density, log_proposal })
    }

    /// The end of a walk of independent proposals on the surrogate that begins at `place`: reversible with respect to
    /// it, and after so many steps nearly an independent draw.
    fn walk(&self, mut place: Place, rng: &mut dyn RngCore) -> Place {
        // none depends on the one before: their quadratics are found together
        let attempts: Vec<(f64, Attempt)> =
            (0..self.walk).map(|_| (rng.random::<f64>().ln(), self.attempt(rng))).collect();
        let given: Vec<&Given> = attempts.iter().map(|(_, attempt)| &attempt.given).collect();
        let conditionals = self.model.at_each(&given, self.temperature);
        for ((log_uniform, attempt), conditional) in attempts.iter().zip(conditionals) {
            let Some(next) = conditional.map(|conditional| self.placed(attempt, &conditional)) else { continue };
            let gain = |p: &Place| p.log_density - p.log_proposal;
            if next.log_density.is_finite() && *log_uniform < gain(&next) - gain(&place) {
                place = next;
            }
        }
        place
    }

    /// A draw in sampling coordinates; `None` if the priors exclude all.
    pub fn draw(&self, rng: &mut dyn RngCore) -> Option<Vec<f64>> {
        const TRIES: usize = 200;
        let first = (0..TRIES).find_map(|_| self.propose(rng).filter(|place| place.log_density.is_finite()))?;
        Some(self.walk(self.walk(first, rng), rng).position)
    }

    /// Maxima over the periods of one planet that lie within `drop` of the best in ln L, highest first, at most so
    /// many; a second planet is at its best.
    pub fn peaks(&self, drop: f64, most: usize) -> Vec<Peak> {
        let planets = self.model.planets();
        let Some(which) = self.periods.iter().position(Option::is_some) else {
            let middle: Vec<f64> = planets.iter().map(|planet| planet.central_period()).collect();
            return self.shaped(&middle).map(|(position, _)| Peak { position, drop: 0.0 }).into_iter().collect();
        };
        let heights = self.periods[which].as_ref().map_or_else(Vec::new, PeriodTable::peaks);
        let chosen = heights.into_iter().filter(|(_, height)| self.best - height <= drop).take(most);
        let peak = |(period, height): (f64, f64)| {
            let of = |i: usize| match &self.periods[i] {
                _ if i == which => period,
                Some(table) => table.highest().0,
                None => planets[i].central_period(),
            };
            let periods: Vec<f64> = (0..planets.len()).map(of).collect();
            Some(Peak { position: self.shaped(&periods)?.0, drop: self.best - height })
        };
        chosen.filter_map(peak).collect()
    }

    /// The highest point at these periods, with circular orbits or some eccentric ones where shapes are free, with ln L
    /// there. One planet after the other.
    fn shaped(&self, periods: &[f64]) -> Option<(Vec<f64>, f64)> {
        let planets = self.model.planets();
        let mut at = self.model.circles(|i| periods[i]);
        let mut best: Option<(f64, DVector<f64>)> = None;
        for i in 0..planets.len() {
            let tried = planets[i].ellipses(periods[i]).into_iter().filter_map(|ellipse| {
                let mut here = at.clone();
                here.planets[i] = ellipse;
                let conditional = self.model.at(&here, 1.0)?;
                let mode = conditional.mode();
                Some((conditional.log_likelihood(&mode), mode, ellipse))
            });
            let (height, mode, ellipse) = tried.max_by(|a, b| a.0.total_cmp(&b.0))?;
            at.planets[i] = ellipse;
            best = Some((height, mode));
        }
        best.map(|(height, mode)| (self.model.position(&at, &mode), height))
    }
}

/// Tables of two planets, each with the other at its best: of the two orders, the one that ends higher.
type Tables = (f64, Vec<(usize, PeriodTable)>);

/// The table of a planet's periods, by its index and the position of all parameters, with its height.
type OfPlanet<'a> = dyn Fn(usize, &[f64]) -> Option<(PeriodTable, f64)> + 'a;

fn pair(table: &OfPlanet, centre: &[f64]) -> Option<Tables> {
    let order = |first: usize, second: usize| -> Option<Tables> {
        let mut beside = centre.to_vec();
        beside[first] = table(first, &beside)?.0.highest().0;
        beside[second] = table(second, &beside)?.0.highest().0;
        let (of_first, _) = table(first, &beside)?;
        beside[first] = of_first.highest().0;
        let (of_second, best) = table(second, &beside)?;
        Some((best, vec![(first, of_first), (second, of_second)]))
    };
    let [one, other] = [order(0, 1), order(1, 0)];
    match (one, other) {
        (Some(one), Some(other)) => Some(if one.0 >= other.0 { one } else { other }),
        (one, other) => one.or(other),
    }
}

/// Whether K of every planet in the search is free.
fn is_orbit_free(space: &ParameterSpace) -> bool {
    let is_free = |p: Parameter| space.free().iter().any(|f| f.parameter == p);
    let sought = |of: &&Elements| of.all().into_iter().any(is_free);
    let mut sought = Elements::PLANETS.iter().filter(sought).peekable();
    sought.peek().is_some() && sought.all(|of| is_free(of.k) && (is_free(of.phi) || is_free(of.conjunction)))
}

#[cfg(test)]
mod tests;
