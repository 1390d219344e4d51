//! The unspotted star whose profile is nearest to the mean profile: vsini, centre, strength, level of the continuum
//! and, unless it is given, width of the local line, by least squares (Levenberg-Marquardt) through the forward model.
//!
//! Spots that are dark at all phases, polar ones in particular, fill the core of the mean profile but not its flanks;
//! so only the flanks and the continuum beside them are fitted. The result is accurate to 1 % and 0.3 km/s in vsini,
//! and to 0.4 % of vsini for the centre (`tests/method/first_look.rs`), if the width of the local line is known.
//! Otherwise the width has a weak prior, and the uncertainty of vsini includes that of the width: the flanks of a slow
//! rotator constrain it, those of a fast one hardly. Limb darkening is given.

use super::mean::{HalfDepth, MeanProfile};
use super::{LineModel, LookError};
use crate::star::{
    LocalLine, Orbit, Quadrature, Regions, Response, Rotation, Sampling, StarSettings, StarState, SurfaceGrid,
};
use nalgebra::{Matrix5, Vector5};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Pixels of the model star.
const PIXELS: usize = 2000;

/// Only bins farther than this from the centre are fitted, in units of vsini.
const FLANK: f64 = 0.7;

/// Only bins nearer than this to it are fitted, in units of the distance at which the line ends.
const OUTER: f64 = 1.5;

/// The line ends this many standard deviations of the local line beyond vsini, where it is 0.1 % deep.
const REACH_SIGMAS: f64 = 3.0;

/// A line has ended where no more than 2 % of its depth is left, this many standard deviations of the local line beyond
/// vsini; so many bins on either side are then continuum.
const ENDED_SIGMAS: f64 = 1.5;
const ENDS: usize = 2;

/// An offset continuum is off by at least so many standard errors of a bin of the mean profile, and by the second
/// number.
const OFF: (f64, f64) = (10.0, 2e-3);

/// Its largest distance from the level of the ends, in units of its distance from 1.
const SEEN: f64 = 0.3;

/// Fewest bins beyond the line for fitting its continuum too.
const CONTINUUM_BINS: usize = 6;

/// Iterations of choosing the bins and fitting them.
const PASSES: usize = 4;

/// Standard deviation of the prior of the logarithm of the width of the local line: thermal motion and turbulence of a
/// cool dwarf, blends of LSD lines.
const LINE_PRIOR: f64 = 0.5;

/// Allowed widths of the local line (standard deviations in km/s, before instrumental broadening).
const LINE_KMS: std::ops::RangeInclusive<f64> = 1.0..=10.0;

/// Least effect of spots on the flanks of the mean profile, as a fraction of its depth.
const SPOTS_IN_FLANKS: f64 = 0.0015;

/// Most steps of a fit; it takes five to ten.
const STEPS: usize = 50;

/// A step of less than this (km/s) ends the fit.
const TOLERANCE_KMS: f64 = 1e-4;

/// Steps of differences (km/s): large compared with rounding, small compared with the line.
const DIFFERENCE_KMS: f64 = 0.02;

/// The same of the log width of the local line.
const DIFFERENCE_WIDTH: f64 = 0.01;

/// Initial damping of a fit, and the damping at which it gives up.
const DAMPING: (f64, f64) = (1e-3, 1e9);

/// vsini stays within this factor of its start.
const FARTHEST: f64 = 10.0;

/// The unspotted star nearest to a mean profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unspotted {
    /// Projected equatorial velocity (km/s).
    pub vsini_kms: f64,
    /// Velocity of the centre (km/s).
    pub centre_kms: f64,
    /// Equivalent width (km/s) that the flanks would have without spots; larger than that of the line for polar spots.
    pub equivalent_width_kms: f64,
    /// Depth beyond the line: 0 where the continuum is at 1.
    pub offset: f64,
    /// Standard deviation of the local line before instrumental broadening (km/s): given, or fitted.
    pub line_sigma_kms: f64,
    /// Uncertainty of that (km/s), and the resulting one of vsini; 0 where it is given.
    pub line_errors_kms: (f64, f64),
    /// Residual rms in the flanks.
    pub residual: f64,
}

impl Unspotted {
    /// The unspotted star nearest to the mean profile of a line whose local width and limb darkening are given.
    ///
    /// # Errors
    /// If the fit diverges: the profile does not show a rotating star.
    pub fn fit(mean: &MeanProfile, half_depth: HalfDepth, line: LineModel) -> Result<Self, LookError> {
        Self::of(mean, &start(mean, half_depth, line), line, false)
    }

    /// The same where the continuum is at another level than 1, and too little of it is beside the line for [`fit`] to
    /// constrain that: the ends of the profile are assumed to be continuum. `None` where the line has not ended there.
    ///
    /// [`fit`]: Self::fit
    pub fn fit_between_ends(mean: &MeanProfile, half_depth: HalfDepth, line: LineModel) -> Option<Self> {
        let start = Unspotted { offset: 1.0 - mean.level(), ..start(mean, half_depth, line) };
        let found = Self::of(mean, &start, line, true).ok()?;
        let reach = found.vsini_kms + ENDED_SIGMAS * found.line_sigma_kms.hypot(line.instrumental_sigma_kms);
        let ((from, to), beyond) = (mean.range_kms(), ENDS as f64 * mean.step_kms);
        (from + beyond <= found.centre_kms - reach && found.centre_kms + reach <= to - beyond).then_some(found)
    }

    fn of(mean: &MeanProfile, start: &Unspotted, line: LineModel, between_ends: bool) -> Result<Self, LookError> {
        let model = Model::new(line);
        // first with the guessed line, then with the residuals in the flanks as the noise for its width
        let mut found = Fit::new(&model, mean, start, (None, between_ends)).run()?;
        for _ in 1..PASSES {
            let noise = line.is_guess.then_some(found.1);
            found = Fit::new(&model, mean, &found.0, (noise, between_ends)).run()?;
        }
        Ok(found.0)
    }

    /// Whether the continuum of the mean profile is at another level than 1, according to its ends.
    pub fn is_off(&self, mean: &MeanProfile) -> bool {
        let off = self.offset.abs();
        let beside_ends = (1.0 - self.offset - mean.level()).abs();
        off > OFF.0 * mean.sigma && off > OFF.1 && beside_ends < SEEN * off
    }

    /// Distance (km/s) from the centre at which a line with instrumental broadening `instrumental_sigma_kms` has ended.
    pub fn reach_kms(&self, instrumental_sigma_kms: f64) -> f64 {
        self.vsini_kms + REACH_SIGMAS * self.line_sigma_kms.hypot(instrumental_sigma_kms)
    }
}

/// A star with the width of the line: at half depth a limb-darkened profile is about 0.85 vsini wide on either side.
fn start(mean: &MeanProfile, half_depth: HalfDepth, line: LineModel) -> Unspotted {
    const HALF_DEPTH: f64 = 0.85;
    const SIGMAS: f64 = 1.18;
    let width = half_depth.half_width_kms();
    let rotation = (width.powi(2) - (SIGMAS * line.total_sigma_kms()).powi(2)).max((0.3 * width).powi(2)).sqrt();
    let line_alone = mean.within(half_depth.blue_kms, half_depth.red_kms);
    Unspotted {
        vsini_kms: rotation / HALF_DEPTH,
        centre_kms: half_depth.centre_kms(),
        equivalent_width_kms: line_alone.depth.iter().sum::<f64>() * mean.step_kms,
        offset: 0.0,
        line_sigma_kms: line.sigma_kms,
        line_errors_kms: (0.0, 0.0),
        residual: 0.0,
    }
}

/// An unspotted star, except for vsini, centre, and the width of its line.
struct Model {
    grid: SurfaceGrid,
    star: StarSettings,
    line: LineModel,
}

/// The parameters that determine the shape of its profile.
#[derive(Clone, Copy)]
struct Shape {
    vsini_kms: f64,
    centre_kms: f64,
    /// Logarithm of the width of the local line, in units of the guess.
    log_width: f64,
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
                line: LocalLine::gaussian(line.total_sigma_kms(), 1.0),
                regions: Regions::PLAIN,
            },
            line,
        }
    }

    fn line_sigma_kms(&self, log_width: f64) -> f64 {
        self.line.sigma_kms * log_width.exp()
    }

    /// Depths, for an equivalent width of 1, in the bins of `profile`. An unspotted star in solid-body rotation looks
    /// the same at all phases.
    fn depths(&self, shape: Shape, profile: &MeanProfile) -> Vec<f64> {
        let state = StarState {
            rotation: Rotation { omega_eq_rad_d: TAU, domega_rad_d: 0.0 },
            inclination: FRAC_PI_2,
            vsini_kms: shape.vsini_kms,
            vsys_kms: shape.centre_kms,
            motion: Orbit { k_kms: 0.0, porb_over_prot: 1.0, phi: 0.0 }.into(),
            surface: Default::default(),
        };
        let mut star = self.star.clone();
        star.line.sigma_kms = self.line_sigma_kms(shape.log_width).hypot(self.line.instrumental_sigma_kms);
        let bins = (0.0, profile.first_velocity_kms, profile.depth.len());
        let sampling = Sampling { step_kms: profile.step_kms, profiles: vec![bins] };
        Response::new(&self.grid, &star, &state, &sampling).depths(&vec![1.0; self.grid.len()])
    }
}

/// A fit of vsini, centre, equivalent width, offset and log width of the line (in this order) to fixed bins.
struct Fit<'a> {
    model: &'a Model,
    mean: &'a MeanProfile,
    /// 1 for a bin that is fitted, 0 for one that is not.
    weights: Vec<f64>,
    /// 1 where the offset is free, 0 where there is too little continuum.
    offset: f64,
    /// Variance of a bin relative to which the prior of the line's width is weighted; `None` where the width is not
    /// free.
    noise: Option<f64>,
    start: Vector5<f64>,
}

/// A point during a fit.
struct Point {
    p: Vector5<f64>,
    shape: Vec<f64>,
    residual: Vec<f64>,
    /// Sum of the squares, including the prior.
    square: f64,
}

impl Point {
    fn shape(&self) -> Shape {
        shape(&self.p)
    }
}

fn shape(p: &Vector5<f64>) -> Shape {
    Shape { vsini_kms: p[0], centre_kms: p[1], log_width: p[4] }
}

impl<'a> Fit<'a> {
    /// A fit in the flanks of the star `around` and beside them; the offset is free where the ends are continuum.
    fn new(
        model: &'a Model,
        mean: &'a MeanProfile,
        around: &Unspotted,
        (noise, between_ends): (Option<f64>, bool),
    ) -> Self {
        let reach = around.reach_kms(model.line.instrumental_sigma_kms);
        let fitted = FLANK * around.vsini_kms..=OUTER * reach;
        let distances: Vec<f64> =
            (0..mean.depth.len()).map(|j| (mean.velocity_kms(j) - around.centre_kms).abs()).collect();
        let continuum = distances.iter().filter(|d| (reach..=OUTER * reach).contains(*d)).count();
        let offset = if between_ends || continuum >= CONTINUUM_BINS { 1.0 } else { 0.0 };
        let Unspotted { vsini_kms, centre_kms, equivalent_width_kms, .. } = *around;
        let log_width = (around.line_sigma_kms / model.line.sigma_kms).ln();
        Fit {
            model,
            mean,
            weights: distances.iter().map(|d| if fitted.contains(d) { 1.0 } else { 0.0 }).collect(),
            offset,
            noise,
            start: Vector5::new(vsini_kms, centre_kms, equivalent_width_kms, offset * around.offset, log_width),
        }
    }

    fn point(&self, p: Vector5<f64>) -> Point {
        let shape = self.model.depths(shape(&p), self.mean);
        let depths = self.mean.depth.iter().zip(&shape).zip(&self.weights);
        let residual: Vec<f64> = depths.map(|((depth, shape), w)| w * (depth - p[2] * shape - p[3])).collect();
        let square = residual.iter().map(|r| r * r).sum::<f64>() + self.prior_weight() * p[4] * p[4];
        Point { p, square, shape, residual }
    }

    /// The contribution of the log-width prior to the normal equations.
    fn prior_weight(&self) -> f64 {
        self.noise.map_or(0.0, |noise| noise / LINE_PRIOR.powi(2))
    }

    /// The star, and the residual variance of a bin in its flanks.
    fn run(&self) -> Result<(Unspotted, f64), LookError> {
        let mut here = self.point(self.start);
        let mut damping = DAMPING.0;
        for _ in 0..STEPS {
            let (normal, right) = self.normal_equations(&here);
            let before = here.p;
            while damping < DAMPING.1 {
                let damped = normal + Matrix5::from_diagonal(&(normal.diagonal() * damping));
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
        let [vsini_kms, centre_kms, equivalent_width_kms, offset, log_width] = here.p.into();
        if equivalent_width_kms <= 0.0 {
            return Err(LookError::NoRotation);
        }
        let line_sigma_kms = self.model.line_sigma_kms(log_width);
        let (by_vsini, by_width) = self.errors(&here);
        let line_errors_kms = (line_sigma_kms * by_width, by_vsini);
        let bins = self.weights.iter().sum::<f64>().max(1.0);
        let residual = (here.residual.iter().map(|r| r * r).sum::<f64>() / bins).sqrt();
        let star = Unspotted {
            vsini_kms,
            centre_kms,
            equivalent_width_kms,
            offset,
            line_sigma_kms,
            line_errors_kms,
            residual,
        };
        Ok((star, self.unexplained(&here)))
    }

    /// Standard errors of vsini (km/s) due to the width of the line, and of the log width.
    fn errors(&self, here: &Point) -> (f64, f64) {
        let Some(noise) = self.noise else { return (0.0, 0.0) };
        match self.normal_equations(here).0.try_inverse() {
            Some(inverse) => {
                let open = inverse[(0, 4)].powi(2) / inverse[(4, 4)];
                ((noise * open).max(0.0).sqrt(), (noise * inverse[(4, 4)]).max(0.0).sqrt())
            }
            None => (0.0, LINE_PRIOR),
        }
    }

    /// Residual variance of a bin in the flanks. Residuals from spots are correlated over the width of the local line,
    /// and so many bins count as one.
    fn unexplained(&self, here: &Point) -> f64 {
        let fitted = self.weights.iter().sum::<f64>();
        let total_kms = self.model.line_sigma_kms(here.p[4]).hypot(self.model.line.instrumental_sigma_kms);
        let together = (2.0 * PI.sqrt() * total_kms / self.mean.step_kms).max(1.0);
        let scatter = here.residual.iter().map(|r| r * r).sum::<f64>() / (fitted - 5.0).max(1.0);
        let deepest = here.shape.iter().copied().fold(0.0, f64::max) * here.p[2];
        let spots = (SPOTS_IN_FLANKS * deepest).powi(2);
        self.mean.sigma.powi(2) + together * (scatter + spots)
    }

    fn is_allowed(&self, p: &Vector5<f64>) -> bool {
        let width = self.noise.is_none() || LINE_KMS.contains(&self.model.line_sigma_kms(p[4]));
        width && (self.start[0] / FARTHEST..self.start[0] * FARTHEST).contains(&p[0])
    }

    /// Matrix and right-hand side of the linear least squares around a point.
    fn normal_equations(&self, here: &Point) -> (Matrix5<f64>, Vector5<f64>) {
        let slope = |change: &dyn Fn(&mut Shape, f64), step: f64| -> Vec<f64> {
            let at = |by: f64| {
                let mut shape = here.shape();
                change(&mut shape, by);
                self.model.depths(shape, self.mean)
            };
            at(step).iter().zip(at(-step)).map(|(a, b)| here.p[2] * (a - b) / (2.0 * step)).collect()
        };
        let by_vsini = slope(&|shape, by| shape.vsini_kms += by, DIFFERENCE_KMS);
        let by_centre = slope(&|shape, by| shape.centre_kms += by, DIFFERENCE_KMS);
        let by_width = match self.noise {
            Some(_) => slope(&|shape, by| shape.log_width += by, DIFFERENCE_WIDTH),
            None => vec![0.0; here.shape.len()],
        };
        let (mut normal, mut right) = (Matrix5::zeros(), Vector5::zeros());
        for (j, weight) in self.weights.iter().enumerate() {
            let row = *weight * Vector5::new(by_vsini[j], by_centre[j], here.shape[j], self.offset, by_width[j]);
            normal += row * row.transpose();
            right += row * here.residual[j];
        }
        normal[(4, 4)] += self.prior_weight();
        right[4] -= self.prior_weight() * here.p[4];
        // parameters that are not free stay unchanged
        normal[(3, 3)] += 1.0 - self.offset;
        normal[(4, 4)] += f64::from(u8::from(self.noise.is_none()));
        (normal, right)
    }
}
