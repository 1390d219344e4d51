//! The search for the best parameters: a blind search for the planet, where the surface model begins with one, and the
//! model's own optimiser from there.

use crate::inference::detection::{Detection, DetectionSettings};
use crate::model::{Elements, Parameter, ParameterSpace, ParameterValues, for_blind_search};
use crate::planets::periodogram::{Frequencies, FrequencySettings};
use crate::sampling::optimise::Optimum;
use crate::star::Shape;
use crate::surface::density::Density;
use crate::surface::expansion::nuisances;
use crate::surface::imaging::Imager;
use crate::surface::optimum::{Best, BlindStart, RIVAL_DISTANCE, Sought, shift, with_spots_of};
use crate::surface::{OtherRotation, SurfaceSettings};

pub use crate::surface::optimum::{Attempt, Progress, SearchError, Stage};

/// What to search for, and from where.
#[derive(Clone, Copy, Debug)]
pub struct SearchSettings {
    /// The prior of the spots.
    pub surface: SurfaceSettings,
    /// Largest number of other orbits to start from, beside the config's values.
    pub other_starts: usize,
    /// Seed of those that are drawn.
    pub seed: u64,
    /// Another rotation period with which the profiles are far more probable.
    pub other_rotation: Option<OtherRotation>,
}

impl SearchSettings {
    /// The default search.
    pub fn of(surface: SurfaceSettings, seed: u64) -> Self {
        SearchSettings { surface, other_starts: OTHER_STARTS, seed, other_rotation: None }
    }
}

/// Largest number of orbits that a search starts from, beside the config's.
const OTHER_STARTS: usize = 4;

/// A circular orbit is a saddle point in the square roots of eccentricities: optimisers begin beside it.
const SMALLEST_E: f64 = 0.01;

/// Share of the largest eccentricity within which an optimiser begins.
const SMALL_PART: f64 = 0.8;

/// A maximum this much lower in log-probability has a thousandth of the weight of the best, and is ignored.
const RIVAL_DROP: f64 = 7.0;

/// The result of a search.
#[derive(Clone, Debug)]
pub struct Found {
    /// The posterior relative to the reference at the optimum.
    pub posterior: Density,
    /// The optimum of the configured objective.
    pub optimum: Optimum,
    /// All starts.
    #[doc(hidden)]
    pub attempts: Vec<Attempt>,
    /// The blind search at the start, if there was one.
    #[doc(hidden)]
    pub detection: Option<Box<Detection>>,
}

impl Found {
    /// Maxima other than the optimum, best first, that are lower by less than 7 in log-probability. A chain that
    /// starts around the optimum may never see them.
    #[doc(hidden)]
    pub fn rivals(&self) -> Vec<&Optimum> {
        let mut ends: Vec<&Optimum> = self.attempts.iter().filter_map(|attempt| attempt.end.as_ref().ok()).collect();
        ends.sort_by(|a, b| b.evaluation.log_prob.total_cmp(&a.evaluation.log_prob));
        let mut distinct: Vec<&Optimum> = Vec::new();
        for end in ends {
            let lower = distinct.first().map_or(0.0, |best| best.evaluation.log_prob - end.evaluation.log_prob);
            let same = |other: &&Optimum| shift(self.posterior.space(), &end.theta, other) < RIVAL_DISTANCE;
            if lower < RIVAL_DROP && !distinct.iter().any(same) {
                distinct.push(end);
            }
        }
        distinct.split_off(distinct.len().min(1))
    }
}

/// Finds the best parameters and the reference there; `report` is called at every evaluation, from any thread.
///
/// # Errors
/// If there is no reference, or no start leads to a finite log-probability.
pub fn find(
    imager: &Imager,
    space: &ParameterSpace,
    settings: SearchSettings,
    report: &(dyn Fn(Progress) + Sync),
) -> Result<Found, SearchError> {
    let SearchSettings { surface, other_starts, seed, other_rotation } = settings;
    let (model, sought) = (surface.model(), Sought { imager, space, other_starts, seed });
    report(Progress { stage: Stage::FirstImage, evaluations: 0 });
    let blind = model.begins_with_blind_search().then(|| blind(imager, space, surface, other_rotation)).flatten();
    let (detection, start) = blind.map_or((None, None), |(detection, start)| (Some(Box::new(detection)), start));
    let start = detection.as_ref().zip(start);
    let start = start.map(|(detection, (theta, values))| BlindStart { theta, values, here: detection.last() });
    let Best { posterior, optimum, attempts } = model.optimum(sought, start, report)?;
    Ok(Found { posterior, optimum, attempts, detection })
}

/// A point in parameter space: the free parameters, and the values of all.
type Point = (Vec<f64>, ParameterValues);

/// A blind search, where an orbit is sought; and the orbit that it finds, where the priors allow it.
fn blind(
    imager: &Imager,
    space: &ParameterSpace,
    surface: SurfaceSettings,
    other_rotation: Option<OtherRotation>,
) -> Option<(Detection, Option<Point>)> {
    let is_free = |p: Parameter| space.free().iter().any(|f| f.parameter == p);
    let sought = |of: &&Elements| is_free(of.k) && is_free(of.phi) && space.period_prior(of).is_some();
    let sought: Vec<&Elements> = Elements::PLANETS.iter().filter(sought).collect();
    let [first, second] = &Elements::PLANETS;
    let beside = second.all().into_iter().any(is_free);
    // of a planet of known ephemeris the config knows where it is
    if !sought.contains(&first) || (beside && !sought.contains(&second)) {
        return None;
    }
    let usual = FrequencySettings::default();
    let frequencies = Frequencies::new(&imager.cycles(), imager.star.rotation_period_d, usual).ok()?;
    let wanted = DetectionSettings {
        eccentric: is_free(first.shape[0]),
        second_planet: beside,
        other_rotation,
        ..DetectionSettings::of(surface, nuisances(space.free()))
    };
    let config = space.values_at(&space.start());
    let values = for_blind_search(config, space.free());
    let found = Detection::find(imager, values, frequencies, &wanted, &|_| ()).ok()?;
    let mut values = found.last().expansion.values.with_orbits_of(&config);
    let both = found.second.as_ref().and_then(|second| second.both).map(|both| both.orbits.to_vec());
    let mut peaks = both.filter(|_| beside).unwrap_or_else(|| vec![found.best]);
    for of in sought {
        let prior = space.period_prior(of)?;
        let allowed = peaks.iter().position(|peak| prior.contains(peak.porb_over_prot));
        let peak = peaks.remove(allowed.or((!beside).then_some(0))?);
        values.set(of.k, peak.orbit.k_kms);
        values.set(of.ratio, peak.porb_over_prot);
        values.set(of.phi, peak.orbit.phi);
    }
    if let Some(Some(ellipse)) = found.keplerian.first().filter(|_| !beside) {
        let largest =
            first.shape.map(|p| space.free().iter().find(|f| f.parameter == p).map(|f| f.prior.bounds().1))[0]?;
        let e = ellipse.eccentricity.clamp(SMALLEST_E, (SMALL_PART * largest * largest).max(SMALLEST_E));
        let shape = Shape::new(e, ellipse.omega);
        values.set(Parameter::SqrtECosOmega, shape.sqrt_e_cos_omega);
        values.set(Parameter::SqrtESinOmega, shape.sqrt_e_sin_omega);
        values.set(Parameter::K, ellipse.k_kms);
        values.set(Parameter::PorbOverProt, ellipse.porb_over_prot);
        values.set(Parameter::Phi, (ellipse.maximum_cycle / ellipse.porb_over_prot).rem_euclid(1.0));
    }
    let mut theta = with_spots_of(space, space.theta_of(&values), &values);
    // phi as its prior has it
    theta = space.to_physical(&space.to_sampling(&theta));
    let start = space.log_prior(&theta).is_finite().then_some((theta, values));
    Some((found, start))
}
