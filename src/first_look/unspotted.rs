//! The unspotted star whose profile is most like the mean one: vsini, centre, strength and level of the continuum, by least
//! squares (Levenberg-Marquardt) through the forward model.
//!
//! Spots that are dark at all phases, polar ones above all, fill the core of the mean profile and leave its flanks alone; so
//! only the flanks and the continuum beside them are fitted. What remains is good to 1 % and 0.3 km/s of vsini, and to 0.4 % of
//! vsini for the centre (`tests/first_look.rs`). Left out: the width of the local line and limb darkening, which are given.

use super::mean::{HalfDepth, MeanProfile};
use super::{LineModel, LookError};
use crate::star::{LocalLine, Orbit, Quadrature, Response, Rotation, Sampling, StarSettings, StarState, SurfaceGrid};
use nalgebra::{Matrix4, Vector4};
use std::f64::consts::{FRAC_PI_2, TAU};

/// Pixels of the model star.
const PIXELS: usize = 2000;

/// Only bins farther than this from the centre are fitted, in units of vsini.
const FLANK: f64 = 0.7;

/// Only bins nearer than this to it are, in units of the distance at which the line ends.
const OUTER: f64 = 1.5;

/// The line ends that many standard deviations of the local line beyond vsini: it is 0.1 % deep there.
const REACH_SIGMAS: f64 = 3.0;

/// Bins beyond the line from which its continuum can be fitted too.
const CONTINUUM_BINS: usize = 6;

/// Passes of choosing the bins and fitting them.
const PASSES: usize = 3;

/// Most steps of a fit; it takes five to ten.
const STEPS: usize = 50;

/// A step of less than this (km/s) is the last.
const TOLERANCE_KMS: f64 = 1e-4;

/// Steps of differences (km/s): large against rounding, small against the line.
const DIFFERENCE_KMS: f64 = 0.02;

/// Damping that a fit begins with, and at which it gives up.
const DAMPING: (f64, f64) = (1e-3, 1e9);

/// vsini stays within this factor of where the fit begins.
const FARTHEST: f64 = 10.0;

/// The unspotted star nearest to a mean profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unspotted {
    /// Projected equatorial velocity (km/s).
    pub vsini_kms: f64,
    /// Velocity of the centre (km/s).
    pub centre_kms: f64,
    /// Equivalent width (km/s) that the flanks would have without spots; larger than the line's own where there are polar ones.
    pub equivalent_width_kms: f64,
    /// Depth of what is beyond the line: 0 where the continuum is at 1.
    pub offset: f64,
}

impl Unspotted {
    /// The unspotted star nearest to the mean profile of a line whose local width and limb darkening are given.
    ///
    /// # Errors
    /// If the fit runs away: there is no rotating star in the profile.
    pub fn fit(mean: &MeanProfile, half_depth: HalfDepth, line: LineModel) -> Result<Self, LookError> {
        let model = Model::new(line);
        let mut found = start(mean, half_depth, line);
        for _ in 0..PASSES {
            found = Fit::new(&model, mean, &found).run()?;
        }
        Ok(found)
    }

    /// Distance (km/s) from the centre at which the line has ended.
    pub fn reach_kms(&self, sigma_kms: f64) -> f64 {
        self.vsini_kms + REACH_SIGMAS * sigma_kms
    }
}

/// A star as wide as the line: at half depth a limb-darkened profile is about 0.85 vsini wide on either side.
fn start(mean: &MeanProfile, half_depth: HalfDepth, line: LineModel) -> Unspotted {
    const HALF_DEPTH: f64 = 0.85;
    const SIGMAS: f64 = 1.18;
    let width = half_depth.half_width_kms();
    let rotation = (width.powi(2) - (SIGMAS * line.sigma_kms).powi(2)).max((0.3 * width).powi(2)).sqrt();
    let line_alone = mean.within(half_depth.blue_kms, half_depth.red_kms);
    Unspotted {
        vsini_kms: rotation / HALF_DEPTH,
        centre_kms: half_depth.centre_kms(),
        equivalent_width_kms: line_alone.depth.iter().sum::<f64>() * mean.step_kms,
        offset: 0.0,
    }
}

/// An unspotted star, but for vsini and where it is.
struct Model {
    grid: SurfaceGrid,
    star: StarSettings,
}

impl Model {
    fn new(line: LineModel) -> Self {
        Model {
            grid: SurfaceGrid::equal_area(PIXELS, Quadrature::Gauss2x2),
            star: StarSettings {
                rotation_period_d: 1.0,
                epoch_d: 0.0,
                limb_darkening: line.law(),
                contrast: 0.0,
                line: LocalLine::gaussian(line.sigma_kms, 1.0),
            },
        }
    }

    /// Depths, for an equivalent width of 1, in the bins of `profile`. A star that rotates as a solid body and has no spots looks
    /// the same from everywhere.
    fn depths(&self, vsini_kms: f64, centre_kms: f64, profile: &MeanProfile) -> Vec<f64> {
        let state = StarState {
            rotation: Rotation { omega_eq_rad_d: TAU, domega_rad_d: 0.0 },
            inclination: FRAC_PI_2,
            vsini_kms,
            vsys_kms: centre_kms,
            orbit: Orbit { k_kms: 0.0, porb_over_prot: 1.0, phi: 0.0 },
            surface: Default::default(),
        };
        let bins = (0.0, profile.first_velocity_kms, profile.depth.len());
        let sampling = Sampling { step_kms: profile.step_kms, profiles: vec![bins] };
        Response::new(&self.grid, &self.star, &state, &sampling).depths(&vec![1.0; self.grid.len()])
    }
}

/// A fit of vsini, centre, equivalent width and offset (in this order) to bins that stay the same.
struct Fit<'a> {
    model: &'a Model,
    mean: &'a MeanProfile,
    /// 1 for a bin that is fitted, 0 for one that is not.
    weights: Vec<f64>,
    /// 1 where the offset is free, 0 where there is too little continuum.
    offset: f64,
    start: Vector4<f64>,
}

/// A point on the way of a fit.
struct Point {
    p: Vector4<f64>,
    shape: Vec<f64>,
    residual: Vec<f64>,
    square: f64,
}

impl<'a> Fit<'a> {
    /// Bins in the flanks of the star `around` and beside them.
    fn new(model: &'a Model, mean: &'a MeanProfile, around: &Unspotted) -> Self {
        let reach = around.reach_kms(model.star.line.sigma_kms);
        let fitted = FLANK * around.vsini_kms..=OUTER * reach;
        let distances: Vec<f64> =
            (0..mean.depth.len()).map(|j| (mean.velocity_kms(j) - around.centre_kms).abs()).collect();
        let continuum = distances.iter().filter(|d| (reach..=OUTER * reach).contains(*d)).count();
        let offset = if continuum >= CONTINUUM_BINS { 1.0 } else { 0.0 };
        let Unspotted { vsini_kms, centre_kms, equivalent_width_kms, .. } = *around;
        Fit {
            model,
            mean,
            weights: distances.iter().map(|d| if fitted.contains(d) { 1.0 } else { 0.0 }).collect(),
            offset,
            start: Vector4::new(vsini_kms, centre_kms, equivalent_width_kms, offset * around.offset),
        }
    }

    fn point(&self, p: Vector4<f64>) -> Point {
        let shape = self.model.depths(p[0], p[1], self.mean);
        let depths = self.mean.depth.iter().zip(&shape).zip(&self.weights);
        let residual: Vec<f64> = depths.map(|((depth, shape), w)| w * (depth - p[2] * shape - p[3])).collect();
        Point { p, square: residual.iter().map(|r| r * r).sum(), shape, residual }
    }

    fn run(&self) -> Result<Unspotted, LookError> {
        let mut here = self.point(self.start);
        let mut damping = DAMPING.0;
        for _ in 0..STEPS {
            let (normal, right) = self.normal_equations(&here);
            let before = here.p;
            while damping < DAMPING.1 {
                let damped = normal + Matrix4::from_diagonal(&(normal.diagonal() * damping));
                let step = damped.lu().solve(&right).ok_or(LookError::NoRotation)?;
                let there = Some(before + step).filter(|p| self.is_allowed(p)).map(|p| self.point(p));
                match there.filter(|there| there.square < here.square) {
                    Some(there) => {
                        here = there;
                        damping *= 0.1;
                        break;
                    }
                    None => damping *= 10.0,
                }
            }
            if (here.p[0] - before[0]).abs() + (here.p[1] - before[1]).abs() < TOLERANCE_KMS {
                break;
            }
        }
        let [vsini_kms, centre_kms, equivalent_width_kms, offset] = here.p.into();
        match equivalent_width_kms > 0.0 {
            true => Ok(Unspotted { vsini_kms, centre_kms, equivalent_width_kms, offset }),
            false => Err(LookError::NoRotation),
        }
    }

    fn is_allowed(&self, p: &Vector4<f64>) -> bool {
        (self.start[0] / FARTHEST..self.start[0] * FARTHEST).contains(&p[0])
    }

    /// Matrix and right-hand side of the linear least squares around a point.
    fn normal_equations(&self, here: &Point) -> (Matrix4<f64>, Vector4<f64>) {
        let slope = |vsini: f64, centre: f64| -> Vec<f64> {
            let at = |by: f64| self.model.depths(here.p[0] + by * vsini, here.p[1] + by * centre, self.mean);
            let (above, below) = (at(DIFFERENCE_KMS), at(-DIFFERENCE_KMS));
            above.iter().zip(below).map(|(a, b)| here.p[2] * (a - b) / (2.0 * DIFFERENCE_KMS)).collect()
        };
        let (by_vsini, by_centre) = (slope(1.0, 0.0), slope(0.0, 1.0));
        let (mut normal, mut right) = (Matrix4::zeros(), Vector4::zeros());
        for (j, weight) in self.weights.iter().enumerate() {
            let row = *weight * Vector4::new(by_vsini[j], by_centre[j], here.shape[j], self.offset);
            normal += row * row.transpose();
            right += row * here.residual[j];
        }
        // an offset that is not free stays where it is
        normal[(3, 3)] += 1.0 - self.offset;
        (normal, right)
    }
}
