//! The quadratic at one period (or two, with the shapes of the orbits): a Gaussian in all other coordinates.
//!
//! With `x = T y + o` the coordinates of the expansion, y the linear ones (K cos, K sin, systemic velocity, stellar
//! parameters) and T's first columns the velocities of unit orbits (`planet`): for a circular one the cosine and sine
//! of its angle. Then `ln L = c + b y - y A y / 2`.

use super::interpolation::{Interpolation, Pieces};
use super::planet::{Nonlinear, Planet};
use super::student;
use crate::model::{Elements, Parameter, ParameterSpace, Prior};
use crate::surface::expansion::Expansion;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// The nonlinear coordinates that determine a quadratic in the linear ones.
#[derive(Clone, Debug)]
pub(super) struct Given {
    /// The coordinates of each planet in which the velocities are not linear.
    pub planets: Vec<Nonlinear>,
    /// The sampling coordinates over which expansions are interpolated; empty where there is one expansion.
    pub field: DVector<f64>,
}

/// The source of the pieces.
#[derive(Clone, Debug)]
enum Source {
    /// One expansion.
    One(Pieces),
    /// Several, with interpolation between them, and the positions of the coordinates.
    Several(Interpolation, Vec<usize>),
}

/// The common part of the quadratics of all periods.
#[derive(Clone, Debug)]
pub(super) struct LinearModel {
    /// Rotation cycles from mid-time.
    cycles: Vec<f64>,
    source: Source,
    /// Columns of T except those of orbits.
    columns: DMatrix<f64>,
    /// The planets, whose columns come first, in this order.
    planets: Vec<Planet>,
    /// Positions of the other linear coordinates in a vector of internal ones: those of `columns`.
    others: Vec<usize>,
    dimension: usize,
    correction: Option<Correction>,
    /// Precision and pull of the normal priors of linear coordinates.
    prior_precision: DVector<f64>,
    prior_pull: DVector<f64>,
}

/// Added to ln L at every period: `constant + gradient (y - centre) - (y - centre) information (y - centre) / 2`.
#[derive(Clone, Debug)]
pub(super) struct Correction {
    pub centre: DVector<f64>,
    pub constant: f64,
    pub gradient: DVector<f64>,
    pub information: DMatrix<f64>,
}

/// The quadratic at one period.
pub(super) struct Conditional {
    information: DMatrix<f64>,
    gradient: DVector<f64>,
    constant: f64,
    /// Of the distribution for draws: with the normal priors, at the temperature.
    factor: Cholesky<f64, Dyn>,
    mode: DVector<f64>,
    log_determinant: f64,
}

impl LinearModel {
    /// From an expansion whose stellar coordinates are those that `space` leaves free; `None` where no planet's
    /// velocities are linear in some of its free parameters.
    pub fn new(expansion: &Expansion, space: &ParameterSpace, mid_cycle: f64) -> Option<Self> {
        LinearModel::of(&[(DVector::zeros(0), expansion)], &[], space, mid_cycle)
    }

    /// From expansions in the velocities at some points, interpolated between them: values of the coordinates at these
    /// `positions`. `None` also where there are too few points.
    pub fn of(
        expansions: &[(DVector<f64>, &Expansion)],
        positions: &[usize],
        space: &ParameterSpace,
        mid_cycle: f64,
    ) -> Option<Self> {
        let (_, expansion) = expansions.first()?;
        let (n, all) = (expansion.profiles(), expansion.centre.len());
        let is_free = |of: &Elements| space.free().iter().any(|f| of.all().contains(&f.parameter));
        let free = Elements::PLANETS.iter().filter(|of| is_free(of));
        let planets: Vec<Planet> = free.map(|of| Planet::new(space, of, mid_cycle)).collect::<Option<_>>()?;
        if planets.is_empty() {
            return None;
        }
        let fixed = space.values_at(&space.start());
        let of_planets: Vec<usize> = planets.iter().flat_map(Planet::positions).collect();
        let is_other = |i: &usize| !of_planets.contains(i) && !positions.contains(i);
        let others: Vec<usize> = (0..space.dimension()).filter(is_other).collect();
        let mut columns = DMatrix::zeros(all, others.len());
        let mut offset = -&expansion.centre;
        for (mut column, &i) in columns.column_iter_mut().zip(&others) {
            column.copy_from(&expansion.direction(space.free()[i].parameter));
        }
        if !space.free().iter().any(|f| f.parameter == Parameter::Vsys) {
            offset.rows_mut(0, n).add_scalar_mut(fixed[Parameter::Vsys]);
        }
        for of in Elements::PLANETS.iter().filter(|of| !is_free(of) && fixed.get(of.k).is_some_and(|k| k != 0.0)) {
            let planet = of.orbit(&fixed);
            offset.iter_mut().zip(&expansion.cycles).for_each(|(v, cycle)| *v += planet.velocity_kms(*cycle));
        }
        let normal = |i: Option<usize>| match i.map(|i| space.free()[i]) {
            Some(f) => match f.prior {
                Prior::Normal { mean, sd, .. } => {
                    // in the sampling coordinate, to first order
                    let p = f.parameter;
                    let sd = sd * (-p.log_jacobian(mean)).exp();
                    (sd.powi(-2), p.to_sampling(mean) * sd.powi(-2))
                }
                _ => (0.0, 0.0),
            },
            None => (0.0, 0.0),
        };
        let of_orbits = planets.iter().flat_map(|planet| vec![planet.ray(); planet.columns()]);
        let normals: Vec<(f64, f64)> = of_orbits.chain(others.iter().copied().map(Some)).map(normal).collect();
        let pieces = |of: &Expansion| {
            let pushed = &of.information * &offset;
            Pieces {
                constant: of.log_likelihood + of.gradient.dot(&offset) - 0.5 * offset.dot(&pushed),
                gradient: &of.gradient - &pushed,
                informed: &of.information * &columns,
                information: of.information.clone(),
            }
        };
        let source = match positions {
            [] => Source::One(pieces(expansion)),
            _ => {
                let places: Vec<(&DVector<f64>, Pieces)> = expansions.iter().map(|(at, of)| (at, pieces(of))).collect();
                Source::Several(Interpolation::new(&places)?, positions.to_vec())
            }
        };
        Some(LinearModel {
            cycles: expansion.cycles.iter().map(|e| e - mid_cycle).collect(),
            source,
            columns,
            dimension: space.dimension(),
            correction: None,
            prior_precision: DVector::from_iterator(normals.len(), normals.iter().map(|n| n.0)),
            prior_pull: DVector::from_iterator(normals.len(), normals.iter().map(|n| n.1)),
            planets,
            others,
        })
    }

    /// With a correction to ln L that replaces the previous one.
    pub fn with_correction(self, correction: Correction) -> Self {
        LinearModel { correction: Some(correction), ..self }
    }

    /// Number of linear coordinates.
    pub fn linear_count(&self) -> usize {
        self.orbit_count() + self.others.len()
    }

    fn orbit_count(&self) -> usize {
        self.planets.iter().map(Planet::columns).sum()
    }

    /// The planets.
    pub fn planets(&self) -> &[Planet] {
        &self.planets
    }

    /// The first column of a planet.
    pub fn column_of(&self, planet: usize) -> usize {
        self.planets[..planet].iter().map(Planet::columns).sum()
    }

    /// Circular orbits of these periods, in the middle of the points of the interpolation.
    pub fn circles(&self, period: impl Fn(usize) -> f64) -> Given {
        let planets = self.planets.iter().enumerate().map(|(i, planet)| planet.circle(period(i))).collect();
        Given { planets, field: self.interpolation().map_or(DVector::zeros(0), |(between, _)| between.centre()) }
    }

    /// The interpolation of the expansions, and the positions of its coordinates.
    pub fn interpolation(&self) -> Option<(&Interpolation, &[usize])> {
        match &self.source {
            Source::One(_) => None,
            Source::Several(between, positions) => Some((between, positions)),
        }
    }

    /// The nonlinear and the linear coordinates of a position.
    pub fn split(&self, position: &[f64]) -> (Given, DVector<f64>) {
        let (planets, linear): (Vec<_>, Vec<_>) = self.planets.iter().map(|planet| planet.split(position)).unzip();
        let linear = linear.into_iter().flatten().chain(self.others.iter().map(|&i| position[i]));
        let positions = self.interpolation().map_or(&[][..], |(_, positions)| positions);
        let field = DVector::from_iterator(positions.len(), positions.iter().map(|&i| position[i]));
        (Given { planets, field }, DVector::from_vec(linear.collect()))
    }

    /// Internal coordinates of both.
    pub fn position(&self, given: &Given, linear: &DVector<f64>) -> Vec<f64> {
        let mut position = vec![0.0; self.dimension];
        if let Some((_, positions)) = self.interpolation() {
            positions.iter().zip(given.field.iter()).for_each(|(&i, x)| position[i] = *x);
        }
        let mut first = 0;
        for (planet, at) in self.planets.iter().zip(&given.planets) {
            planet.write(at, &linear.as_slice()[first..first + planet.columns()], &mut position);
            first += planet.columns();
        }
        self.others.iter().zip(linear.iter().skip(first)).for_each(|(&i, x)| position[i] = *x);
        position
    }

    /// The quadratic for given nonlinear coordinates, with draws as if ln L were divided by `temperature`; `None` where
    /// it has no maximum.
    pub fn at(&self, given: &Given, temperature: f64) -> Option<Conditional> {
        self.at_each(&[given], temperature).pop().flatten()
    }

    /// The same for several.
    pub fn at_each(&self, given: &[&Given], temperature: f64) -> Vec<Option<Conditional>> {
        match &self.source {
            Source::One(pieces) => given.iter().map(|given| self.of_pieces(pieces, given, temperature)).collect(),
            Source::Several(between, _) => {
                let pieces = between.at(given.iter().map(|given| &given.field));
                given.iter().zip(&pieces).map(|(given, pieces)| self.of_pieces(pieces, given, temperature)).collect()
            }
        }
    }

    fn of_pieces(&self, pieces: &Pieces, given: &Given, temperature: f64) -> Option<Conditional> {
        let (all, count, orbits) = (pieces.gradient.len(), self.linear_count(), self.orbit_count());
        let mut orbit = DMatrix::zeros(all, orbits);
        let mut first = 0;
        for (planet, at) in self.planets.iter().zip(&given.planets) {
            planet.fill(at, &self.cycles, &mut orbit, first);
            first += planet.columns();
        }
        let informed_orbit = &pieces.information * &orbit;
        let mut information = DMatrix::zeros(count, count);
        information.view_mut((0, 0), (orbits, orbits)).copy_from(&orbit.tr_mul(&informed_orbit));
        let across = orbit.tr_mul(&pieces.informed);
        information.view_mut((0, orbits), (orbits, count - orbits)).copy_from(&across);
        information.view_mut((orbits, 0), (count - orbits, orbits)).copy_from(&across.transpose());
        information
            .view_mut((orbits, orbits), (count - orbits, count - orbits))
            .copy_from(&self.columns.tr_mul(&pieces.informed));
        let mut gradient = DVector::zeros(count);
        gradient.rows_mut(0, orbits).copy_from(&orbit.tr_mul(&pieces.gradient));
        gradient.rows_mut(orbits, count - orbits).copy_from(&self.columns.tr_mul(&pieces.gradient));
        let mut constant = pieces.constant;
        if let Some(Correction { centre, constant: at_centre, gradient: slope, information: bend }) = &self.correction {
            let bent = bend * centre;
            constant += at_centre - slope.dot(centre) - 0.5 * centre.dot(&bent);
            gradient += slope + bent;
            information += bend;
        }
        let mut drawn = &information / temperature;
        drawn.set_diagonal(&(drawn.diagonal() + &self.prior_precision));
        let factor = drawn.cholesky()?;
        let mode = factor.solve(&(&gradient / temperature + &self.prior_pull));
        let log_determinant = 2.0 * factor.l_dirty().diagonal().iter().map(|l| l.ln()).sum::<f64>();
        Some(Conditional { information, gradient, constant, factor, mode, log_determinant })
    }
}

impl Conditional {
    /// ln L at the linear coordinates `y`.
    pub fn log_likelihood(&self, y: &DVector<f64>) -> f64 {
        self.constant + self.gradient.dot(y) - 0.5 * y.dot(&(&self.information * y))
    }

    /// The mode of the distribution for draws.
    pub fn mode(&self) -> DVector<f64> {
        self.mode.clone()
    }

    /// K at the mode, or its standard error if that is larger, with all other coordinates known, of a planet whose
    /// columns begin at `first`.
    pub fn amplitude(&self, first: usize) -> f64 {
        let error = (2.0 / (self.information[(first, first)] + self.information[(first + 1, first + 1)])).sqrt();
        self.mode[first].hypot(self.mode[first + 1]).max(error)
    }

    /// ln of the determinant of its information.
    pub fn log_determinant(&self) -> f64 {
        self.log_determinant
    }

    /// Linear coordinates at a draw `at` of the t distribution ([`student::draw`]), put around the mode, and ln of the
    /// density there.
    pub fn drawn(&self, at: &DVector<f64>) -> (DVector<f64>, f64) {
        let step = self.factor.l_dirty().tr_solve_lower_triangular(at).expect("a factor has no zero on its diagonal");
        (&self.mode + step, 0.5 * self.log_determinant + student::log_density(at))
    }

    /// ln of the density with which [`Conditional::drawn`] gives `y`.
    pub fn log_density(&self, y: &DVector<f64>) -> f64 {
        let at = self.factor.l_dirty().lower_triangle().tr_mul(&(y - &self.mode));
        0.5 * self.log_determinant + student::log_density(&at)
    }
}
