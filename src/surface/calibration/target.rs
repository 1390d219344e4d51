//! The target chi2 from the profiles: the highest below which the filtered radial velocities of the image stop
//! shrinking (Petit et al. 2015, section 3; `docs/method.md` section 3).
//!
//! Above it spots are still missing in the image; below, noise is turned into spots. Along the path of images the rms
//! of the filtered velocities, observed minus modelled first moments, falls with lambda and then stays constant: the
//! target is the chi2 at which a doubling of lambda reduces it by less than 3 %: 0.97 on the setup of Petit et al.
//! Where the rms still shrinks at the lambda beyond which noise is turned into spots, which does not happen with the
//! right model and uncertainties, that lambda is the end.

use crate::maxent::{Goal, Problem, Solution, Solver, SolverSettings, Start};
use crate::model::ParameterValues;
use crate::planets::speeds::with_unit;
use crate::star::observation::Profile;
use crate::surface::imaging::Imager;
use crate::surface::static_map::reference::{PROVISIONAL_LAMBDA, Reference, ReferenceError};
use serde::{Deserialize, Serialize};

/// The velocities stop shrinking where a doubling of lambda leaves this fraction of them.
const STOPPED: f64 = 0.97;

/// Images per doubling of lambda.
const IMAGES: usize = 3;

/// The path begins at this lambda over the number of data, where a spotted star is fitted badly.
const FIRST: f64 = 0.1;

/// A target that was chosen.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChosenTarget {
    /// chi2 per datum.
    pub value: f64,
    /// Standard deviation of the filtered velocities there (km/s).
    pub filtered_rv_rms_kms: f64,
    /// The fraction of it that remains after a doubling of lambda.
    pub left_by_doubling: f64,
    /// Whether it still shrinks there, because beyond noise is turned into spots.
    pub still_shrinking: bool,
    /// Whether it never shrank: the target is then that of the largest lambda.
    #[serde(default)]
    pub never_shrinking: bool,
}

impl ChosenTarget {
    /// One line of text.
    pub fn line(&self) -> String {
        let left = 100.0 * (1.0 - self.left_by_doubling);
        let ChosenTarget { value, filtered_rv_rms_kms, .. } = self;
        let still = match (self.still_shrinking, self.never_shrinking) {
            (true, _) => "; still decreasing there: uncertainties are too large, or the stellar model is incomplete",
            (false, true) => "; it does not decrease with more spots: give a number",
            (false, false) => "",
        };
        format!(
            "{value} per datum; filtered residual RV rms {}, {left:.0} % less with twice the weight of the \
             data{still}",
            with_unit(*filtered_rv_rms_kms)
        )
    }
}

/// One image on the path.
#[derive(Clone, Copy, Debug)]
struct Place {
    chi2: f64,
    rms_kms: f64,
}

/// The target at `values`, for data with noise correlated over `correlated_bins`: per datum, not per independent one.
///
/// # Errors
/// If the solver fails.
pub fn choose(imager: &Imager, values: ParameterValues, correlated_bins: f64) -> Result<ChosenTarget, ReferenceError> {
    let path = path(imager, values, PROVISIONAL_LAMBDA * correlated_bins)?;
    let left: Vec<f64> = path.windows(IMAGES + 1).map(|p| p[IMAGES].rms_kms / p[0].rms_kms).collect();
    let last = left.len() - 1;
    let (k, part) = match left.iter().rposition(|left| *left < STOPPED) {
        // velocities that spots do not explain at all do not constrain spots
        None => (last, 0.0),
        Some(k) if k == last => (last, 0.0),
        // between the last image with a gain and the first without one
        Some(k) => (k, (STOPPED - left[k]) / (left[k + 1] - left[k])),
    };
    let between = |a: f64, b: f64| a + part * (b - a);
    let next = (k + 1).min(last);
    Ok(ChosenTarget {
        value: rounded(between(path[k].chi2, path[k + 1].chi2)),
        filtered_rv_rms_kms: between(path[k].rms_kms, path[k + 1].rms_kms),
        left_by_doubling: between(left[k], left[next]),
        still_shrinking: left[last] < STOPPED,
        never_shrinking: left.iter().all(|left| *left >= STOPPED),
    })
}

/// Four decimals: the last bits of a search for a target are not significant, and all later results depend on them.
fn rounded(chi2: f64) -> f64 {
    (1e4 * chi2).round() / 1e4
}

/// Images from the first lambda to a doubling of `last_lambda`, both over the number of data.
fn path(imager: &Imager, values: ParameterValues, last_lambda: f64) -> Result<Vec<Place>, ReferenceError> {
    let data = imager.data.depth.len() as f64;
    let first = Reference::at_lambda(imager, values, FIRST)?;
    let last = Reference::at_lambda(imager, values, last_lambda)?;
    let solver =
        Solver { entropy: imager.entropy, preconditioner: &last.preconditioner, settings: SolverSettings::patient() };
    let observed = moments(imager, &imager.data.depth);
    let mut problem = imager.problem(first.response.clone());
    let mut place = |solution: &Solution| {
        let map = imager.entropy.image(&solution.image.coordinates);
        problem.linearise(&map);
        let modelled = moments(imager, problem.model());
        let filtered: Vec<f64> = observed.iter().zip(modelled).map(|(o, m)| o - m).collect();
        Place { chi2: solution.chi2 / data, rms_kms: scatter(&filtered) }
    };
    // the last image is at the last lambda, and a doubling beyond it
    let (unit, over) = (imager.entropy.lambda_unit(), imager.data_as_of_one_map());
    let steps = (IMAGES as f64 * (last_lambda / FIRST).log2()).floor();
    let mut at = first.solution.clone();
    let mut places = Vec::new();
    let mut work = imager.problem(first.response.clone());
    for k in -(steps as i32)..=IMAGES as i32 {
        let lambda = unit * last_lambda / over * (f64::from(k) / IMAGES as f64).exp2();
        let start =
            Start { image: at.image.clone(), path: Vec::new(), chi2_slope: 0.0, adjoint: Vec::new(), best: None };
        at = solver.solve(&mut work, Goal::Lambda(lambda), start);
        places.push(place(&at));
    }
    match places.iter().all(|place| place.chi2.is_finite() && place.rms_kms > 0.0) {
        true => Ok(places),
        false => Err(ReferenceError::Solver(at.termination)),
    }
}

/// First moment (km/s) of every profile with these `depths` in the bins of the data.
fn moments(imager: &Imager, depths: &[f64]) -> Vec<f64> {
    let mut first = 0;
    let moment = |(step_kms, (time_d, first_velocity_kms, bins)): (f64, (f64, f64, usize))| {
        let (intensity, sigma) = (Vec::new(), Vec::new());
        let profile = Profile { time_d, first_velocity_kms, step_kms, intensity, sigma, exposure_s: None };
        first += bins;
        profile.first_moment_of(&depths[first - bins..first])
    };
    let steps = imager.sets.iter().flat_map(|set| set.sampling.profiles.iter().map(|_| set.sampling.step_kms));
    steps.zip(imager.profiles()).map(moment).collect()
}

/// Root mean square about the mean.
fn scatter(x: &[f64]) -> f64 {
    let n = x.len() as f64;
    let mean = x.iter().sum::<f64>() / n;
    (x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt()
}
