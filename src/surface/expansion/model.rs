//! The forward model at a fixed map, displaced in one or two coordinates: its derivatives by central differences.
//!
//! One shift of all profiles gives the derivative of each, because each profile depends only on its velocity.

use crate::maxent::Problem;
use crate::model::{Parameter, ParameterValues, Step, turning};
use crate::numerics::vector::Portable;
use crate::star::Response;
use crate::surface::imaging::{Imager, ImagingProblem};
use crate::surface::static_map::Reference;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::ops::Range;

/// Step of the velocities (km/s): the relative error of derivatives of a line is the square of this over the line
/// width.
pub const VELOCITY_STEP_KMS: f64 = 0.02;

/// Step of a stellar parameter: large enough for a smooth change by the many pixels that come into sight at the limb.
pub fn stellar_step(parameter: Parameter, values: &ParameterValues, time_base_d: f64) -> f64 {
    match parameter.spec().difference {
        Step::Fixed(step) => step,
        Step::Relative(part) => part * values[parameter],
        Step::Turn(times) => times * turning((0.5 * time_base_d).max(1e-3)),
        Step::Ratio(_) | Step::Period(_) | Step::Time(_) => unreachable!("orbits are displaced by velocities"),
    }
}

/// The model at the reference image.
pub(super) struct DisplacedModel<'a> {
    imager: &'a Imager,
    reference: &'a Reference,
    stellar: Vec<Parameter>,
    steps: Vec<f64>,
    map: Vec<f64>,
    cycles: Vec<f64>,
    here: ImagingProblem<'a>,
    /// All profiles shifted by a step up and down.
    shifted: [ImagingProblem<'a>; 2],
    /// Each stellar parameter displaced by a step up and down.
    turned: Vec<[ImagingProblem<'a>; 2]>,
    /// The fraction of the information on the velocity of each profile that remains with the RV jitter; empty without a
    /// jitter.
    left: Vec<f64>,
}

impl<'a> DisplacedModel<'a> {
    pub fn new(imager: &'a Imager, reference: &'a Reference, stellar: &[Parameter]) -> Self {
        let map = imager.entropy.image(&reference.solution.image.coordinates);
        let base = imager.longest_season_cycles() * imager.star.rotation_period_d;
        let steps: Vec<f64> = stellar.iter().map(|&p| stellar_step(p, &reference.values, base)).collect();
        let at = |response: Response| displaced(imager, response, &map);
        let here = at(reference.response.clone());
        let shift = |h: f64| at(shifted(imager, &reference.response, &reference.values, h));
        let turn = |(&p, &h): (&Parameter, &f64)| {
            [h, -h].map(|h| at(imager.response(&moved(&reference.values, &[(p, h)]).state())))
        };
        let turned = stellar.par_iter().zip(&steps).map(turn).collect();
        let mut model = DisplacedModel {
            shifted: [VELOCITY_STEP_KMS, -VELOCITY_STEP_KMS].map(shift),
            cycles: imager.cycles(),
            stellar: stellar.to_vec(),
            imager,
            reference,
            steps,
            here,
            turned,
            map,
            left: Vec::new(),
        };
        model.left = model.left_by_zero_points();
        model
    }

    /// `1 - s^2 D'_k W D'_k`, that is `1 / (1 + s^2 E)` with E the information of the bins on the velocity of a profile
    /// beside all else.
    ///
    /// A profile with the density `exp(g V - J V^2 / 2)` has, marginalised over its RV jitter, `J / (1 + s^2 J)`
    /// instead of J and `g / (1 + s^2 J)` instead of g. Weights with the slopes of one image do that for first
    /// derivatives. For second ones, which change J by a small `r W D''`, they do not, because the slopes do not follow
    /// the velocity: so it is done here.
    fn left_by_zero_points(&self) -> Vec<f64> {
        let sd = self.imager.data.nuisances.zero_point_kms();
        if sd == 0.0 {
            return Vec::new();
        }
        let slopes = first(&self.shifted, VELOCITY_STEP_KMS);
        let mut weighted = vec![0.0; slopes.len()];
        let left = |k: usize| {
            self.imager.data.weigh_root(self.bins(k), &slopes, &mut weighted);
            (1.0 - sd * sd * self.bins(k).map(|j| weighted[j] * weighted[j]).sum::<f64>()).max(0.0)
        };
        (0..self.profiles()).map(left).collect()
    }

    fn left(&self, profile: usize) -> f64 {
        self.left.get(profile).copied().unwrap_or(1.0)
    }

    pub fn profiles(&self) -> usize {
        self.cycles.len()
    }

    pub fn cycles(&self) -> &[f64] {
        &self.cycles
    }

    /// The problem at the reference, linearised at its image.
    pub fn problem(&self) -> ImagingProblem<'a> {
        displaced(self.imager, self.reference.response.clone(), &self.map)
    }

    /// `C_x`: the derivative with coordinate `x` of the gradient of chi2/2 with respect to the map.
    pub fn pull(&self, x: usize) -> Vec<f64> {
        let (pair, profiles, h) = match x.checked_sub(self.profiles()) {
            None => (&self.shifted, x..x + 1, VELOCITY_STEP_KMS),
            Some(i) => (&self.turned[i], 0..self.profiles(), self.steps[i]),
        };
        let [plus, minus] = pair.each_ref().map(|at| {
            let mut gradient = vec![0.0; self.map.len()];
            at.gradient_of(profiles.clone(), &mut gradient);
            gradient
        });
        let mut pull: Vec<f64> = plus.iter().zip(minus).map(|(p, m)| (p - m) / (2.0 * h)).collect();
        if let Some(left) = self.left.get(x) {
            let (slopes, bins) = (first(&self.shifted, VELOCITY_STEP_KMS), self.bins(x));
            let (mut weighted, mut linear) = (vec![0.0; slopes.len()], vec![0.0; pull.len()]);
            self.imager.data.weigh(Portable, bins, &slopes, &mut weighted);
            self.here.pulled(x..x + 1, &weighted, &mut linear);
            pull.iter_mut().zip(linear).for_each(|(pull, linear)| *pull = linear + left * (*pull - linear));
        }
        pull
    }

    /// `D_x` of every bin, one column per coordinate.
    pub fn tangents(&self) -> DMatrix<f64> {
        let mut tangents = DMatrix::zeros(self.here.model().len(), self.profiles() + self.stellar.len());
        let velocity = first(&self.shifted, VELOCITY_STEP_KMS);
        for k in 0..self.profiles() {
            for j in self.bins(k) {
                tangents[(j, k)] = velocity[j];
            }
        }
        for (i, (pair, h)) in self.turned.iter().zip(&self.steps).enumerate() {
            tangents.column_mut(self.profiles() + i).copy_from_slice(&first(pair, *h));
        }
        tangents
    }

    /// `-r W D_x`: the derivative of ln L.
    pub fn slope(&self) -> DVector<f64> {
        let residual = DVector::from_column_slice(self.here.weighted_residual());
        -self.tangents().tr_mul(&residual)
    }

    /// `D_x W D_y + r W D_xy`: the curvature of chi2/2 at a fixed map.
    pub fn curvature(&self) -> DMatrix<f64> {
        let (profiles, stellar) = (self.profiles(), self.stellar.len());
        let weighted = self.weigh_root(&self.tangents());
        let mut curvature = weighted.tr_mul(&weighted);
        let residual = self.here.weighted_residual();
        let bent = |second: &[f64], bins: Range<usize>| bins.map(|j| residual[j] * second[j]).sum::<f64>();
        let velocity = second(&self.shifted, &self.here, VELOCITY_STEP_KMS);
        for k in 0..profiles {
            curvature[(k, k)] += self.left(k).powi(2) * bent(&velocity, self.bins(k));
        }
        for i in 0..stellar {
            let own = second(&self.turned[i], &self.here, self.steps[i]);
            curvature[(profiles + i, profiles + i)] += bent(&own, 0..own.len());
            let with_velocity = self.mixed((self.stellar[i], self.steps[i]), (Parameter::Vsys, VELOCITY_STEP_KMS));
            for k in 0..profiles {
                let share = self.left(k) * bent(&with_velocity, self.bins(k));
                curvature[(k, profiles + i)] += share;
                curvature[(profiles + i, k)] += share;
            }
            for j in 0..i {
                let both = self.mixed((self.stellar[i], self.steps[i]), (self.stellar[j], self.steps[j]));
                let share = bent(&both, 0..both.len());
                curvature[(profiles + i, profiles + j)] += share;
                curvature[(profiles + j, profiles + i)] += share;
            }
        }
        curvature
    }

    /// Mixed second difference of the depths in two parameters with their steps.
    fn mixed(&self, (a, step_a): (Parameter, f64), (b, step_b): (Parameter, f64)) -> Vec<f64> {
        let at = |(sign_a, sign_b): (f64, f64)| {
            let values = moved(&self.reference.values, &[(a, sign_a * step_a), (b, sign_b * step_b)]);
            displaced(self.imager, self.imager.response(&values.state()), &self.map).model().to_vec()
        };
        let corners = [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)];
        let d: Vec<Vec<f64>> = corners.into_par_iter().map(at).collect();
        (0..d[0].len()).map(|j| (d[0][j] - d[1][j] - d[2][j] + d[3][j]) / (4.0 * step_a * step_b)).collect()
    }

    /// The root of the weights times every column.
    pub fn weigh_root(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        let mut weighted = columns.clone();
        for (column, mut weighted) in columns.column_iter().zip(weighted.column_iter_mut()) {
            for k in 0..self.profiles() {
                self.imager.data.weigh_root(self.bins(k), column.as_slice(), weighted.as_mut_slice());
            }
        }
        weighted
    }

    fn bins(&self, profile: usize) -> Range<usize> {
        self.reference.response.bins(profile)
    }
}

/// The derivative of every bin's depth with the velocity of its profile, at the image of `reference`.
pub fn velocity_slopes(imager: &Imager, reference: &Reference) -> Vec<f64> {
    let map = imager.entropy.image(&reference.solution.image.coordinates);
    let at = |h: f64| displaced(imager, shifted(imager, &reference.response, &reference.values, h), &map);
    first(&[VELOCITY_STEP_KMS, -VELOCITY_STEP_KMS].map(at), VELOCITY_STEP_KMS)
}

/// The problem seen through `response`, linearised at the map.
fn displaced<'a>(imager: &'a Imager, response: Response, map: &[f64]) -> ImagingProblem<'a> {
    let mut problem = imager.problem(response);
    problem.linearise(map);
    problem
}

/// The response with all profiles shifted by `h` (km/s).
fn shifted(imager: &Imager, response: &Response, values: &ParameterValues, h: f64) -> Response {
    let state = moved(values, &[(Parameter::Vsys, h)]).state();
    imager.with_velocities(response, &state)
}

fn moved(values: &ParameterValues, moves: &[(Parameter, f64)]) -> ParameterValues {
    let mut values = *values;
    moves.iter().for_each(|&(p, h)| values.set(p, values[p] + h));
    values
}

/// Central first difference of the depths.
fn first([plus, minus]: &[ImagingProblem; 2], h: f64) -> Vec<f64> {
    plus.model().iter().zip(minus.model()).map(|(p, m)| (p - m) / (2.0 * h)).collect()
}

/// Central second difference of the depths.
fn second([plus, minus]: &[ImagingProblem; 2], here: &ImagingProblem, h: f64) -> Vec<f64> {
    let all = plus.model().iter().zip(minus.model()).zip(here.model());
    all.map(|((p, m), d)| (p - 2.0 * d + m) / (h * h)).collect()
}
