//! The fit of stellar parameters: those of the line and of active regions for which ln Z is largest, together with the
//! field, which depends on them (`docs/method.md` section 9).
//!
//! ln Z is climbed by Newton's steps. Its gradient is from differences, because the determinant counts; its second
//! derivatives are those of the linearised model, improved from step to step. Harmonics up to a low degree suffice:
//! they give the same lines.

use super::climb::{LEAST_BEND, USUAL_BEND, assumed_at, limits as limits_of_field, place as place_of_field};
use super::fit::{fit, share_of};
use super::{Assumed, Basis, Design, Fitted, Known, Marginal, NoFit};
use crate::field::FieldError;
use crate::model::{Parameter, ParameterValues};
use crate::surface::constants;
use crate::surface::expansion::Nuisance;
use crate::surface::imaging::Imager;
use nalgebra::{DMatrix, DVector, Vector4};
use rayon::prelude::*;
use std::sync::Arc;

/// Degree of the harmonics.
pub(super) const DEGREE: usize = 18;

/// A climb ends when a step would gain less than this in ln Z, or after so many.
const GAIN: f64 = 1.0;
const STEPS: usize = 12;

/// So many steps with all profiles follow those with a subset of them.
const LAST_STEPS: usize = 2;

/// Parameters of a climb that are not stellar: ln amplitude, slope, ln lifetime and ln jitter of the field, ln size of
/// the error common to all profiles.
const OF_FIELD: usize = 5;
const SIZE: usize = 4;

/// Start of its size, its bounds, and the standard deviation of its prior; at the lower bound there is none.
const MEAN_PROFILE: f64 = 1e-3;
const MEAN_PROFILES: (f64, f64) = (2e-5, 0.1);
const MEAN_PROFILE_SD: f64 = 5e-3;

/// Smallest surface of active regions per filling factor of spots in a climb.
const LEAST_AREA: f64 = 0.02;

/// A climb with more profiles than this starts from that with a subset of them.
const FEW: usize = 24;

/// Longest step in a coordinate.
const LONGEST: f64 = 1.0;

/// Largest amplitude of the spots where a climb begins.
const MOST_AT_FIRST: f64 = 0.3;

/// Damping of the first step, and where no step leads up.
const DAMPING: f64 = 0.05;
const MOST_DAMPING: f64 = 1e3;

/// A fitted parameter: its Gaussian prior, the start of a climb, and its bounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StarPrior {
    /// The parameter.
    pub parameter: Parameter,
    /// Mean of the prior.
    pub mean: f64,
    /// Standard deviation of the prior.
    pub sd: f64,
    /// The start of a climb.
    pub start: f64,
    /// Bounds.
    pub bounds: (f64, f64),
    /// Whether it is free in any case: chains and searches find it.
    pub is_free: bool,
}

/// The most probable star.
#[derive(Clone, Debug)]
pub struct FittedStar {
    /// All parameters, including those that were fitted and those of the field.
    pub values: ParameterValues,
    /// Standard deviations of those that were fitted.
    pub sd: Vec<f64>,
    /// Size of the error common to all profiles.
    pub mean_profile: f64,
    /// ln Z, with harmonics up to a low degree.
    pub ln_evidence: f64,
    /// ln of the prior density.
    pub ln_prior: f64,
    /// The field fitted together with it.
    pub assumed: Assumed,
}

/// A point of a climb.
struct Point {
    place: DVector<f64>,
    marginal: Marginal,
    height: f64,
}

/// The end of a climb.
struct Top {
    point: Point,
    /// Minus the second derivatives.
    bend: DMatrix<f64>,
    /// Those along each parameter of the field.
    of_field: [f64; OF_FIELD],
}

/// A climb.
#[derive(Clone)]
struct Climb<'a> {
    imager: &'a Imager,
    basis: Arc<Basis>,
    known: &'a Known,
    priors: &'a [StarPrior],
    free: Vec<bool>,
    limits: Vec<(f64, f64)>,
}

/// The field of the star at `values`, without a planet, by harmonics up to a low degree.
///
/// # Errors
/// [`NoFit`].
pub fn coarsely(imager: &Imager, values: ParameterValues, known: Known) -> Result<Fitted, NoFit> {
    fit(imager, &Arc::new(Basis::coarse(&imager.grid, DEGREE)), values.without_planet(), known, None)
}

/// The slopes of drifts of the velocities (km/s per day) by the field `near`, without an orbit, where one is steep.
///
/// # Errors
/// [`FieldError`].
pub fn slopes(imager: &Imager, near: &Fitted, nuisances: &[Nuisance]) -> Result<Option<Vec<f64>>, FieldError> {
    if imager.drifts.is_empty() {
        return Ok(None);
    }
    let marginal = &near.marginal;
    let held = marginal.known_zero_points(imager, &[])?.velocities(&[]);
    Ok(constants::slopes(&held, imager, nuisances, marginal.values[Parameter::Vsys]))
}

/// Fits stellar parameters, and the size of the error common to all profiles, beginning from the field of `near`: first
/// those of the line, if there are any, then all with a subset of the profiles, then with all of them. Where the subset
/// gives a gain of less than `needed` in ln Z and ln of their prior, or maps of all profiles are not found from there,
/// its result is returned.
///
/// # Errors
/// [`FieldError`].
pub fn fit_star(
    imager: &Imager,
    near: &Fitted,
    known: &Known,
    priors: &[StarPrior],
    needed: f64,
) -> Result<FittedStar, FieldError> {
    let assumed = near.marginal.assumed;
    let few = share_of(imager, FEW);
    let climb = Climb::new(few.as_ref().unwrap_or(imager), known, &assumed, priors);
    let of_line = climb.priors.iter().filter(|prior| prior.is_of_line()).count();
    let mut start = near.marginal.clone();
    if few.is_some() {
        let values = start.values;
        let design = Arc::new(Design::new(climb.imager, &climb.basis, &values.state()));
        start = Marginal::new(climb.imager, &climb.basis, design, values, assumed, None)?;
    }
    let plain = start.ln_evidence();
    let mut place = climb.start(&assumed, &start.values);
    if of_line > 0 && of_line < priors.len() {
        let line = Climb::new(climb.imager, known, &assumed, &priors[..of_line]);
        let from = place.rows(0, OF_FIELD + of_line).into_owned();
        let top = line.up(line.condensed_at(&from, &start, None)?, None)?;
        place.rows_mut(0, OF_FIELD + of_line).copy_from(&top.point.place);
        start = top.point.marginal;
    }
    let top = climb.up(climb.condensed_at(&place, &start, None)?, None)?;
    if few.is_none() {
        return Ok(climb.fitted(&top));
    }
    let more = imager.profiles().count() as f64 / climb.imager.profiles().count() as f64;
    let by_few = climb.fitted(&top);
    let gain = more * (by_few.ln_evidence - plain);
    if gain + by_few.ln_prior < needed {
        return Ok(FittedStar { ln_evidence: near.ln_evidence + gain, ..by_few });
    }
    let of_field = top.of_field.map(|along| along * more);
    let climb = Climb { imager, ..climb };
    let whole = climb.condensed_at(&top.point.place, &near.marginal, None);
    match whole.and_then(|whole| climb.up(whole, Some(of_field))) {
        // maps of many profiles may be too far from those of another star
        Err(FieldError::NotSettled { .. }) => Ok(FittedStar { ln_evidence: near.ln_evidence + gain, ..by_few }),
        top => Ok(climb.fitted(&top?)),
    }
}

/// The coordinate of a parameter of active regions in which the profiles are nearly linear: the effects of their line
/// are proportional to the surface that they cover.
fn coordinate(parameter: Parameter, x: f64, area: f64) -> f64 {
    match parameter {
        Parameter::RegionLineWidth => area * (x * x - 1.0),
        Parameter::RegionEquivalentWidth => area * (x - 1.0),
        Parameter::RegionShift => area * x,
        Parameter::RegionArea => x.ln(),
        Parameter::RegionAreaLimb => x / area,
        _ => x,
    }
}

/// The parameter of active regions at a coordinate.
fn number(parameter: Parameter, coordinate: f64, area: f64) -> f64 {
    match parameter {
        Parameter::RegionLineWidth => (1.0 + coordinate / area).max(0.0).sqrt(),
        Parameter::RegionEquivalentWidth => 1.0 + coordinate / area,
        Parameter::RegionShift => coordinate / area,
        Parameter::RegionArea => coordinate.exp(),
        Parameter::RegionAreaLimb => coordinate * area,
        _ => coordinate,
    }
}

impl StarPrior {
    fn is_of_line(&self) -> bool {
        !Parameter::REGIONS.contains(&self.parameter)
    }

    fn is_fitted_line(&self) -> bool {
        self.is_of_line() && !self.is_free
    }
}

impl<'a> Climb<'a> {
    /// The climb for the parameters that have `priors`, those of the line first.
    fn new(imager: &'a Imager, known: &'a Known, assumed: &Assumed, priors: &'a [StarPrior]) -> Self {
        let ends = |prior: &StarPrior| match prior.parameter {
            Parameter::RegionArea => (prior.bounds.0.max(LEAST_AREA).ln(), prior.bounds.1.ln()),
            _ => (f64::NEG_INFINITY, f64::INFINITY),
        };
        let size = (MEAN_PROFILES.0.ln(), MEAN_PROFILES.1.ln());
        let limits = limits_of_field(known).into_iter().chain([size]).chain(priors.iter().map(ends)).collect();
        // the mean profile is free only if the line is fitted
        let free = known.free(assumed).into_iter().chain([priors.iter().any(StarPrior::is_fitted_line)]).collect();
        Climb { imager, basis: Arc::new(Basis::coarse(&imager.grid, DEGREE)), known, priors, free, limits }
    }

    /// The start.
    fn start(&self, assumed: &Assumed, values: &ParameterValues) -> DVector<f64> {
        let area = self.priors.iter().find(|prior| prior.parameter == Parameter::RegionArea);
        let area = area.map(|prior| prior.start).or(values.get(Parameter::RegionArea)).unwrap_or(1.0);
        let of_star = self.priors.iter().map(|prior| coordinate(prior.parameter, prior.start, area));
        let size: f64 = if self.free[SIZE] { MEAN_PROFILE } else { 0.0 };
        let mut of_field = place_of_field(assumed);
        // more spots than usual mimic the parameters to be found
        if self.known.amplitude.is_none() {
            of_field[0] = of_field[0].min(MOST_AT_FIRST.ln()).max(self.limits[0].0);
        }
        let all = of_field.iter().copied().chain([size.ln()]).chain(of_star);
        DVector::from_iterator(OF_FIELD + self.priors.len(), all)
    }

    /// The point with coordinates of parameters within their bounds.
    fn inside(&self, place: &DVector<f64>, values: &ParameterValues) -> DVector<f64> {
        let mut inside = place.clone();
        let numbers = self.numbers(place, values);
        let area = self.priors.iter().position(|prior| prior.parameter == Parameter::RegionArea);
        let area = area.map(|i| numbers[i]).or(values.get(Parameter::RegionArea)).unwrap_or(1.0);
        for (i, (prior, x)) in self.priors.iter().zip(&numbers).enumerate() {
            inside[OF_FIELD + i] = coordinate(prior.parameter, *x, area);
        }
        inside
    }

    /// The stellar parameters there.
    fn numbers(&self, place: &DVector<f64>, values: &ParameterValues) -> Vec<f64> {
        let of_star = || self.priors.iter().zip(place.iter().skip(OF_FIELD));
        let inside = |prior: &StarPrior, x: f64| x.clamp(prior.bounds.0, prior.bounds.1);
        let area = of_star().find(|(prior, _)| prior.parameter == Parameter::RegionArea);
        let area = area.map(|(prior, x)| inside(prior, number(prior.parameter, *x, 1.0)));
        let area = area.or(values.get(Parameter::RegionArea)).unwrap_or(1.0);
        of_star().map(|(prior, x)| inside(prior, number(prior.parameter, *x, area))).collect()
    }

    /// A point, its profiles compressed with the coefficients of those `near`.
    fn at(&self, place: &DVector<f64>, near: &Marginal) -> Result<Point, FieldError> {
        self.condensed_at(place, near, Some(&near.design))
    }

    fn condensed_at(&self, place: &DVector<f64>, near: &Marginal, like: Option<&Design>) -> Result<Point, FieldError> {
        let imager = &Imager { mean_profile: place[SIZE].exp(), ..self.imager.clone() };
        let mut values = near.values;
        let numbers = self.numbers(place, &values);
        self.priors.iter().zip(&numbers).for_each(|(prior, x)| values.set(prior.parameter, *x));
        let assumed = assumed_at(Vector4::from_fn(|i, _| place[i]), &near.assumed);
        let same_star = self.priors.iter().all(|prior| near.values.get(prior.parameter) == values.get(prior.parameter));
        let design = match same_star && like.is_some() {
            true => Arc::clone(&near.design),
            false => {
                let state = values.state();
                Arc::new(Design::of(imager, &self.basis, (imager.response(&state), &state), like))
            }
        };
        let marginal = Marginal::new(imager, &self.basis, design, values, assumed, Some(near))?;
        let of_size = -0.5 * (imager.mean_profile / MEAN_PROFILE_SD).powi(2);
        let height = self.known.height(&marginal) + self.ln_prior(&numbers) + of_size;
        match height.is_finite() {
            true => Ok(Point { place: self.inside(place, &values), marginal, height }),
            false => Err(FieldError::NotPositive),
        }
    }

    fn ln_prior(&self, numbers: &[f64]) -> f64 {
        let off = |(prior, x): (&StarPrior, &f64)| -0.5 * ((x - prior.mean) / prior.sd).powi(2);
        self.priors.iter().zip(numbers).map(off).sum()
    }

    /// Derivatives of the stellar parameters with their coordinates.
    fn jacobian(&self, at: &Point) -> DMatrix<f64> {
        const H: f64 = 1e-4;
        let count = self.priors.len();
        let mut jacobian = DMatrix::zeros(count, count);
        for i in 0..count {
            let [above, below] = [H, -H].map(|h| {
                let mut place = at.place.clone();
                place[OF_FIELD + i] += h;
                self.numbers(&place, &at.marginal.values)
            });
            for j in 0..count {
                jacobian[(j, i)] = (above[j] - below[j]) / (2.0 * H);
            }
        }
        jacobian
    }

    fn is_free(&self, i: usize) -> bool {
        i >= OF_FIELD || self.free[i]
    }

    /// Minus the second derivatives: those of the linearised model at fixed maps, and of the priors.
    fn bend(&self, at: &Point) -> Result<DMatrix<f64>, FieldError> {
        let parameters: Vec<Parameter> = self.priors.iter().map(|prior| prior.parameter).collect();
        let imager = &Imager { mean_profile: at.place[SIZE].exp(), ..self.imager.clone() };
        let expansion = at.marginal.expansion(imager, &parameters)?;
        let profiles = expansion.profiles();
        let of_star = expansion.information.view((profiles, profiles), (parameters.len(), parameters.len()));
        let mut of_star = of_star.into_owned();
        self.priors.iter().enumerate().for_each(|(i, prior)| of_star[(i, i)] += prior.sd.powi(-2));
        let jacobian = self.jacobian(at);
        let of_star = jacobian.tr_mul(&of_star) * jacobian;
        let mut bend = DMatrix::zeros(self.limits.len(), self.limits.len());
        bend.view_mut((OF_FIELD, OF_FIELD), of_star.shape()).copy_from(&of_star);
        (0..OF_FIELD).for_each(|i| bend[(i, i)] = USUAL_BEND);
        Ok(bend)
    }

    /// The same, with those along each parameter of the field.
    fn with_field(&self, at: &Point, of_field: &[f64; OF_FIELD]) -> Result<DMatrix<f64>, FieldError> {
        let mut bend = self.bend(at)?;
        of_field.iter().enumerate().for_each(|(i, along)| bend[(i, i)] = *along);
        Ok(bend)
    }

    /// The gradient, by differences over steps that change the height by about a half: central ones, which also give
    /// minus the second derivatives along each parameter, or one-sided ones where these are known well.
    fn gradient(&self, at: &Point, bend: &DMatrix<f64>, central: bool) -> (DVector<f64>, DVector<f64>) {
        let along = |i: usize| {
            if !self.is_free(i) {
                return (0.0, bend[(i, i)]);
            }
            let h = bend[(i, i)].max(1e-6).sqrt().recip();
            let beside = |h: f64| {
                let mut place = at.place.clone();
                place[i] = (place[i] + h).clamp(self.limits[i].0, self.limits[i].1.max(place[i]));
                let moved = place[i] - at.place[i];
                (moved != 0.0).then(|| self.at(&place, &at.marginal).ok().map(|there| (moved, there.height)))?
            };
            let above = beside(h);
            let below = if central || above.is_none() { beside(-h) } else { None };
            match (above, below) {
                (Some((up, above)), Some((down, below))) => {
                    let (a, b) = ((above - at.height) / up, (below - at.height) / down);
                    let second = 2.0 * (b - a) / (up - down);
                    // the slope here of the parabola through the three
                    ((a * -down + b * up) / (up - down), second)
                }
                (Some((moved, there)), None) | (None, Some((moved, there))) => {
                    ((there - at.height) / moved + 0.5 * bend[(i, i)] * moved, bend[(i, i)])
                }
                (None, None) => (0.0, bend[(i, i)]),
            }
        };
        // once, before all threads need it
        at.marginal.settled.evidence.explained();
        let all: Vec<(f64, f64)> = (0..self.limits.len()).into_par_iter().map(along).collect();
        let of = |which: &dyn Fn(&(f64, f64)) -> f64| DVector::from_iterator(all.len(), all.iter().map(which));
        (of(&|a| a.0), of(&|a| a.1))
    }

    /// The climb by Newton's steps, damped as by Levenberg and Marquardt (Nocedal & Wright 2006, section 10.3). Second
    /// derivatives along the parameters of the field are measured, unless they are known.
    fn up(&self, mut here: Point, of_field: Option<[f64; OF_FIELD]>) -> Result<Top, FieldError> {
        let count = self.limits.len();
        let mut bend = self.with_field(&here, &of_field.unwrap_or([USUAL_BEND; OF_FIELD]))?;
        let (mut gradient, along) = self.gradient(&here, &bend, of_field.is_none());
        let steps = if of_field.is_some() { LAST_STEPS } else { STEPS };
        let of_field = of_field.unwrap_or(std::array::from_fn(|i| along[i].max(LEAST_BEND)));
        let mut damping = DAMPING;
        bend = self.with_field(&here, &of_field)?;
        let mut learnt = false;
        for step in 1..=steps {
            let pushes = |i: usize| {
                let (low, high) = self.limits[i];
                (here.place[i] <= low + 1e-9 && gradient[i] < 0.0)
                    || (here.place[i] >= high - 1e-9 && gradient[i] > 0.0)
            };
            let stuck = |i: usize| {
                let mut there = here.place.clone();
                there[i] += 1e-3 * gradient[i].signum();
                let values = &here.marginal.values;
                i >= OF_FIELD && self.numbers(&there, values) == self.numbers(&here.place, values)
            };
            let moves: Vec<bool> = (0..count).map(|i| self.is_free(i) && !pushes(i) && !stuck(i)).collect();
            let inside = DVector::from_fn(count, |i, _| if moves[i] { gradient[i] } else { 0.0 });
            let way = |damping: f64| {
                let damped = DMatrix::from_fn(count, count, |i, j| match i == j {
                    true => (1.0 + damping) * bend[(i, i)].max(1e-6),
                    false if moves[i] && moves[j] => bend[(i, j)],
                    false => 0.0,
                });
                damped.cholesky().map(|factor| factor.solve(&inside))
            };
            let Some(hoped) = way(damping).map(|way| 0.5 * inside.dot(&way)) else {
                // the previous updates do not apply to the stellar part
                match learnt {
                    true => (bend, learnt) = (self.with_field(&here, &of_field)?, false),
                    false => break,
                }
                continue;
            };
            if hoped < GAIN {
                break;
            }
            let mut next = None;
            while next.is_none() && damping < MOST_DAMPING {
                next = way(damping).and_then(|way| self.stepped(&here, &way));
                damping *= if next.is_some() { 0.2 } else { 8.0 };
            }
            let Some(next) = next else { break };
            let (gained, moved) = (next.height - here.height, &next.place - &here.place);
            let moved = moved.map_with_location(|i, _, x| if self.is_free(i) { x } else { 0.0 });
            here = next;
            if gained < 0.3 * GAIN {
                break;
            }
            // the stellar part is recomputed; the rest is updated along the climb (BFGS; chapter 6 there)
            let of_star = self.bend(&here)?;
            let corner = (OF_FIELD, OF_FIELD);
            let size = (count - OF_FIELD, count - OF_FIELD);
            bend.view_mut(corner, size).copy_from(&of_star.view(corner, size));
            if step == steps {
                break;
            }
            let there = self.gradient(&here, &bend, false).0;
            let (bent, before) = (&gradient - &there, &bend * &moved);
            if moved.dot(&bent) > 0.1 * moved.dot(&before) {
                bend += &bent * bent.transpose() / moved.dot(&bent) - &before * before.transpose() / moved.dot(&before);
                learnt = true;
            }
            gradient = there;
        }
        Ok(Top { point: here, bend, of_field })
    }

    /// The star at the end of a climb.
    fn fitted(&self, Top { point: here, bend, .. }: &Top) -> FittedStar {
        let covariance = match bend.clone().cholesky() {
            Some(factor) => factor.inverse(),
            None => DMatrix::from_diagonal(&bend.diagonal().map(|bend| bend.max(1e-6).recip())),
        };
        let of_star = (OF_FIELD, self.priors.len());
        let jacobian = self.jacobian(here);
        let covariance =
            &jacobian * covariance.view((of_star.0, of_star.0), (of_star.1, of_star.1)) * jacobian.transpose();
        let sd = covariance.diagonal().map(f64::sqrt);
        let numbers = self.numbers(&here.place, &here.marginal.values);
        let ln_prior = self.ln_prior(&numbers);
        let sd = sd.iter().copied().collect();
        let mean_profile = Some(here.place[SIZE].exp()).filter(|size| *size > 1.5 * MEAN_PROFILES.0).unwrap_or(0.0);
        FittedStar {
            values: here.marginal.values,
            sd,
            mean_profile,
            ln_evidence: here.marginal.ln_evidence(),
            ln_prior,
            assumed: here.marginal.assumed,
        }
    }

    /// The point at the end of a step, where it is higher.
    fn stepped(&self, here: &Point, way: &DVector<f64>) -> Option<Point> {
        let to = |i: usize| {
            let (low, high) = self.limits[i];
            (here.place[i] + way[i].clamp(-LONGEST, LONGEST)).clamp(low, high.max(here.place[i]))
        };
        let place = DVector::from_fn(way.len(), |i, _| if self.is_free(i) { to(i) } else { here.place[i] });
        self.condensed_at(&place, &here.marginal, None).ok().filter(|next| next.height > here.height)
    }
}
