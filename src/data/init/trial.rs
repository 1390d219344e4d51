//! Tests a draft as `map` would: by the maps of its objective, with few pixels and profiles to save time; and the
//! likely fault if there are none. A static map is tested for reaching its target chi2 with uncertainties from the
//! continuum, without a planet or with the best orbit of a search.

use super::digits::rounded;
use super::known::Known;
use super::proposal::{Place, ProposalError, to_json};
use super::values::Values;
use crate::data::config::{self, Automatic, ConfigError, Draft, VelocityJitter};
use crate::data::dataset::{Dataset, ProfileSet, SceneError};
use crate::data::diagnosis::{Diagnosis, Reason};
use crate::data::scene::Scene;
use crate::inference::search::SearchError;
use crate::model::Parameter;
use crate::star::BrightnessModel;
use crate::surface::calibration::noise::MeasuredErrors;
use crate::surface::calibration::star::MeasuredStar;
use crate::surface::{FittedIndicator, NoMaps, OtherRotation, ReferenceError, SurfaceMaps};
use std::path::Path;
use std::sync::Arc;

/// Placeholder (d) for a rotation period that is still to be given, so that everything else is checked.
const STAND_IN_D: f64 = 1.0;

/// Pixels, and least number of profiles per data set, for the test of evolving maps.
const PIXELS: usize = 500;
const PROFILES: usize = 12;

/// Evolving maps with a larger chi2 per datum do not fit.
const POOR: f64 = 1.5;

/// A vsini is better if ln Z is higher by more than this.
const BETTER: f64 = 10.0;

/// Tolerated ratio of the uncertainties that a map needs to those aimed at.
const AS_GOOD: f64 = 0.8;

/// If uncertainties must exceed those of the continuum by more than this, and no tested change helps, the model is at
/// fault.
const MOST_MISFIT: f64 = 5.0;

/// Maximum-entropy maps hardly ever have a larger spot coverage.
const MANY_SPOTS: f64 = 0.25;

/// The result of the test.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Trial {
    /// How it ended.
    pub end: End,
    /// Measured uncertainties of each data set, where left to the profiles.
    pub errors: Vec<Option<MeasuredErrors>>,
    /// Why no map fits within the uncertainties, if none does.
    pub diagnosis: Option<Diagnosis>,
    /// Whether the start is an orbit, since there is no fit without one.
    pub orbit: bool,
    /// Whether the measured vsini replaces the given one, with which nothing fits.
    pub measured_vsini: bool,
    /// Fitted properties of the star, and the gain in ln Z.
    pub star: Option<String>,
    /// Relation of activity indicators to the spots.
    pub indicators: Vec<String>,
    /// Remarks on the maps.
    pub warnings: Vec<String>,
}

/// How it ended.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum End {
    /// It was not tested: there is no rotation period.
    Untried,
    /// There are maps, described in words.
    Fits(String),
}

/// The key of the RV jitter.
const JITTER: &str = "observations.velocity_jitter_kms";

/// One tested draft.
struct Attempt {
    /// The draft with its profiles; `None` where their uncertainties cannot be measured.
    scene: Option<Scene>,
    reached: Result<f64, String>,
    /// Whether, for a map to fit, uncertainties must be larger than those of the continuum, or than the given ones.
    misfits: bool,
    /// By which factor; 1 otherwise.
    misfit: f64,
}

/// Inputs of the test of a draft.
#[derive(Clone, Copy)]
pub(super) struct Observed<'a> {
    /// Where the config goes, and its lists.
    pub place: &'a Place<'a>,
    /// The profiles of each list.
    pub profiles: &'a [ProfileSet],
    /// Measurements on those of the first.
    pub values: &'a Values,
    /// Properties known independently of them.
    pub known: &'a Known,
}

/// Tests `draft` on its profiles, a set for each list. Changes vsini where the given one is far from that of the
/// profiles and no map fits with it; with a static map also the draft's start, where only an orbit makes a map fit. No
/// orbit is searched for with such a vsini.
///
/// # Errors
/// Given values that are invalid; a model whose maps do not fit these profiles, with the likely reason.
pub(super) fn run(draft: &mut Draft, observed: Observed) -> Result<Trial, ProposalError> {
    let Observed { place, profiles, known, .. } = observed;
    if draft.star.rotation_period_d.is_none() {
        let mut stand_in = draft.clone().with_jitter(VelocityJitter::default());
        stand_in.star.rotation_period_d = Some(STAND_IN_D);
        stand_in.observations.sections.iter_mut().for_each(|set| set.sigma_scale = Some(Automatic::Number(1.0)));
        let share: Vec<ProfileSet> = profiles.iter().map(|set| share(set, PROFILES)).collect();
        scene(&stand_in, place.config, &share)?;
        return Ok(Trial::of(End::Untried));
    }
    match known.objective().properties().map_changes {
        true => evolving(draft, observed),
        false => unchanging(draft, observed),
    }
}

/// The test of evolving maps.
fn evolving(draft: &mut Draft, Observed { place, profiles, values, known }: Observed) -> Result<Trial, ProposalError> {
    let few: Vec<ProfileSet> = profiles.iter().map(|set| share(set, PROFILES)).collect();
    // errors of the draft itself are reported by themselves
    config::from_json(to_json(draft, place.config)?.as_bytes(), place.config).map_err(SceneError::from)?;
    let tried = |draft: &Draft| -> Result<(Scene, Result<SurfaceMaps, NoMaps>), ProposalError> {
        let mut coarse = draft.clone();
        coarse.imaging.pixels = coarse.imaging.pixels.min(PIXELS);
        let scene = scene(&coarse, place.config, &few)?.fitted(&|_| ());
        let first_d = scene.observations.profiles.first().map(|profile| profile.time_d);
        let maps = scene.maps(Some(first_d.as_slice()));
        Ok((scene, maps))
    };
    let (mut scene, mut maps) = tried(draft)?;
    let mut trial = Trial::of(End::Untried);
    if values.is_another_star(known) {
        let mut measured = draft.clone();
        measured.star.vsini_kms = rounded(values.look.unspotted.vsini_kms, 1);
        let (other, of_other) = tried(&measured)?;
        let height = |maps: &Result<SurfaceMaps, NoMaps>| {
            let field = maps.as_ref().ok().and_then(|maps| maps.field.as_ref());
            field.map_or(f64::NEG_INFINITY, |field| field.ln_evidence)
        };
        if height(&of_other) > height(&maps) + BETTER {
            (*draft, scene, maps, trial.measured_vsini) = (measured, other, of_other, true);
        }
    }
    let maps = match maps {
        Ok(maps) => maps,
        Err(error) => return Err(no_maps(place, Diagnosis::of(&scene), &error)),
    };
    let field = maps.field.as_ref();
    let is_bound = |name: &String| *name != Parameter::SpotLifetime.name();
    let poor = maps.summary.chi2_per_datum > POOR;
    let stands_in = field.is_some_and(|field| field.stands_in().is_some());
    if poor || stands_in || field.is_some_and(|field| field.at_bounds.iter().any(is_bound)) {
        trial.diagnosis = Diagnosis::of(&scene).filter(|diagnosis| poor || diagnosis.reason != Reason::Errors);
    } else if field.and_then(|f| f.spot_lifetime_d).is_some_and(|d| d < scene.imager.star.rotation_period_d) {
        // spots that live for less than a rotation fit anything, a second star included
        trial.diagnosis = Diagnosis::at_sight(&scene).filter(|seen| seen.reason == Reason::DoubleLines);
    }
    trial.star = scene.measured.star.as_ref().map(MeasuredStar::line);
    trial.indicators = scene.measured.indicators.iter().map(FittedIndicator::line).collect();
    // a second star biases the rotation period
    let is_double = trial.diagnosis.as_ref().is_some_and(|diagnosis| diagnosis.reason == Reason::DoubleLines);
    let rotation = scene.measured.other_rotation.as_ref().filter(|_| is_double).map(OtherRotation::sentence);
    let warnings = maps.warnings.iter().chain(&maps.checks.warnings);
    trial.warnings = warnings.filter(|text| Some(*text) != rotation.as_ref()).cloned().collect();
    let (used, all) = (few.iter().map(count).sum::<usize>(), profiles.iter().map(count).sum::<usize>());
    let of = if used < all { format!("{used} of the {all}") } else { format!("the {all}") };
    let spots = field.map_or_else(String::new, |field| {
        let digits = |days: f64| (1.0 - days.log10().floor()).clamp(0.0, 2.0) as usize;
        let lifetime =
            field.spot_lifetime_d.map_or_else(String::new, |days| format!(", lifetime ≈ {days:.0$} d", digits(days)));
        format!(" (spot amplitude {:.2}{lifetime})", field.spot_amplitude)
    });
    let chi2 = maps.summary.chi2_per_datum;
    trial.end = End::Fits(format!("evolving maps fit {of} profiles with χ²/N = {chi2:.2}{spots}"));
    // errors of one data set are those of all its profiles; a scene of several takes a fit
    trial.errors = match profiles {
        [_] => vec![self::scene(draft, place.config, profiles)?.measured.errors],
        _ => scene.measured.sets.iter().map(|set| set.errors.clone()).collect(),
    };
    Ok(trial)
}

/// The number of profiles.
fn count(set: &ProfileSet) -> usize {
    set.observations.profiles.len()
}

/// Every n-th profile of a set, so that `least` are left, and less than twice as many.
fn share(set: &ProfileSet, least: usize) -> ProfileSet {
    let every = (count(set) / least).max(1);
    let mut few = set.clone();
    few.sha256 = None;
    few.labels = set.labels.iter().step_by(every).cloned().collect();
    few.observations.profiles = set.observations.profiles.iter().step_by(every).cloned().collect();
    few
}

/// The error where there are no maps, worded as by `map`.
fn no_maps(place: &Place, diagnosis: Option<Diagnosis>, error: &NoMaps) -> ProposalError {
    let status = error.status().map_or_else(String::new, |status| format!(" ({status})"));
    let reason = diagnosis.map_or_else(|| error.to_string(), |diagnosis| diagnosis.text);
    ProposalError::NoMaps { list: place.first_list().into(), status, reason }
}

/// The test of static maps.
fn unchanging(
    draft: &mut Draft,
    Observed { place, profiles, values, known }: Observed,
) -> Result<Trial, ProposalError> {
    let config = place.config;
    let mut trial = Trial::of(End::Untried);
    let mut attempt = match attempt_of(draft, config, profiles) {
        // few profiles do not constrain their RV jitter
        Err(ProposalError::Scene(SceneError::Config(ConfigError::Key { key, .. }))) if key == JITTER => {
            *draft = draft.clone().with_jitter(VelocityJitter::default());
            attempt_of(draft, config, profiles)?
        }
        attempt => attempt?,
    };
    if attempt.misfits && values.is_another_star(known) {
        let mut measured = draft.clone();
        measured.star.vsini_kms = rounded(values.look.unspotted.vsini_kms, 1);
        let other = attempt_of(&measured, config, profiles)?;
        if other.misfit < AS_GOOD * attempt.misfit {
            (*draft, attempt, trial.measured_vsini) = (measured, other, true);
        }
    }
    let is_this_star = trial.measured_vsini || !values.is_another_star(known);
    // neither a second star nor variances indicate a planet
    let seen = attempt.scene.as_ref().filter(|_| attempt.misfits).and_then(Diagnosis::at_sight);
    if attempt.misfits && is_this_star && seen.is_none() {
        let mut with_orbit = draft.clone();
        if search(&mut with_orbit, config, profiles, attempt.scene.as_ref())? {
            let other = attempt_of(&with_orbit, config, profiles)?;
            if other.reached.is_ok() && (!other.misfits || other.misfit < AS_GOOD * attempt.misfit) {
                (*draft, attempt, trial.orbit) = (with_orbit, other, true);
            }
        }
    }
    if attempt.misfits {
        trial.diagnosis = seen.or_else(|| attempt.scene.as_ref().and_then(Diagnosis::of));
    }
    let list = place.first_list();
    let hopeless = |diagnosis: &&Diagnosis| diagnosis.reason == Reason::Errors && attempt.misfit > MOST_MISFIT;
    if let Some(diagnosis) = trial.diagnosis.as_ref().filter(hopeless) {
        let (factor, reason) = (attempt.misfit, diagnosis.text.clone());
        return Err(ProposalError::OutOfReach { list: list.into(), factor, reason });
    }
    trial.errors = vec![attempt.scene.and_then(|scene| scene.measured.errors)];
    trial.end = match attempt.reached {
        Ok(spottedness) => End::Fits(spotted(spottedness, draft, trial.orbit)),
        Err(error) => {
            let reason = trial.diagnosis.map_or(error, |diagnosis| diagnosis.text);
            return Err(ProposalError::NoMaps { list: list.into(), status: String::new(), reason });
        }
    };
    Ok(trial)
}

/// The draft as commands see it.
fn scene(draft: &Draft, config: &Path, profiles: &[ProfileSet]) -> Result<Scene, ProposalError> {
    let settings = config::from_json(to_json(draft, config)?.as_bytes(), config).map_err(SceneError::from)?;
    let data = Dataset::with_profiles(&settings, profiles.to_vec())?;
    Ok(Scene::of(settings, Arc::new(data))?)
}

/// The static map at the draft's values.
fn attempt_of(draft: &Draft, config: &Path, profiles: &[ProfileSet]) -> Result<Attempt, ProposalError> {
    let fitted = Some(VelocityJitter::FITTED);
    let jitter = draft.observations.sections.iter().any(|set| set.velocity_jitter_kms == fitted);
    let scene = match scene(draft, config, profiles) {
        Ok(scene) => scene,
        // the measured value, not the given one
        Err(ProposalError::Scene(SceneError::Config(ConfigError::Key { key, problem, .. })))
            if key == "observations.sigma_scale" || key == JITTER && !jitter =>
        {
            let reached = Err(format!("{key}: {problem}"));
            return Ok(Attempt { scene: None, reached, misfits: true, misfit: f64::INFINITY });
        }
        Err(error) => return Err(error),
    };
    let maps = scene.maps(None);
    let floor = match &maps {
        Err(NoMaps::Reference(ReferenceError::TargetBelowFloor { target, floor })) => Some((floor / target).sqrt()),
        _ => None,
    };
    let errors = scene.measured.errors.as_ref();
    let larger = errors.and_then(|errors| errors.misfit()).map_or(1.0, |misfit| misfit.max(1.0));
    Ok(Attempt {
        misfits: floor.is_some() || errors.is_some_and(MeasuredErrors::is_misfit),
        misfit: larger * floor.unwrap_or(1.0),
        reached: maps
            .map(|maps| maps.summary.image.map_or(0.0, |image| image.spottedness))
            .map_err(|error| error.to_string()),
        scene: Some(scene),
    })
}

/// Puts the best orbit and systemic velocity into the draft, searched for with uncertainties from the continuum;
/// returns whether there are any.
fn search(
    draft: &mut Draft,
    config: &Path,
    profiles: &[ProfileSet],
    tried: Option<&Scene>,
) -> Result<bool, ProposalError> {
    let measured = tried.and_then(|scene| scene.measured.errors.as_ref());
    let by_continuum = measured.and_then(|errors| Some(errors.continuum? * errors.correlated_bins.sqrt()));
    let mut with_its_errors = draft.clone();
    if let Some(scale) = by_continuum {
        let sections = &mut with_its_errors.observations.sections;
        sections.iter_mut().for_each(|set| set.sigma_scale = Some(Automatic::Number(scale)));
    }
    let scene = scene(&with_its_errors, config, profiles)?;
    let found = match scene.optimise() {
        Ok(found) => found,
        // the only relevant point is that there is no map
        Err(SearchError::Reference(_) | SearchError::Optimise(_) | SearchError::Field(_)) => return Ok(false),
    };
    let best = scene.space.values_at(&found.optimum.theta);
    // rounding does not lead out of the priors
    let within = |parameter: Parameter| {
        let prior = scene.space.free().iter().find(|free| free.parameter == parameter).map(|free| free.prior.bounds());
        let (min, max) = prior.expect("orbit and systemic velocity of a draft are free");
        rounded(best[parameter], 4).clamp(min, max)
    };
    let phi = rounded(best[Parameter::Phi], 4).rem_euclid(1.0);
    *draft = draft.clone().with_orbit((within(Parameter::K), within(Parameter::PorbOverProt), phi));
    draft.star.vsys_kms = within(Parameter::Vsys);
    Ok(true)
}

/// A static map in words.
fn spotted(spottedness: f64, draft: &Draft, orbit: bool) -> String {
    let orbit = if orbit { ", but only with an orbit: run `periodogram`" } else { "" };
    let (percent, spots) = (100.0 * spottedness, draft.imaging.brightness() == BrightnessModel::Spots);
    let many = match spots && spottedness > MANY_SPOTS {
        true => "; this is high: check vsini, inclination and line",
        false => "",
    };
    let what = match spots {
        true => format!("spots on {percent:.1} % of the star fit"),
        false => format!("a brightness that varies by {percent:.1} % rms fits"),
    };
    format!("{what} the profiles{orbit}{many}")
}

impl Trial {
    fn of(end: End) -> Self {
        Trial {
            end,
            errors: Vec::new(),
            diagnosis: None,
            orbit: false,
            measured_vsini: false,
            star: None,
            indicators: Vec::new(),
            warnings: Vec::new(),
        }
    }

    /// Whether a map can be made from the config without changes.
    pub fn is_complete(&self) -> bool {
        matches!(self.end, End::Fits(_))
    }

    /// The result in words.
    pub fn notes(&self, draft: &Draft) -> Vec<String> {
        let vsini = self.measured_vsini.then(|| {
            format!(
                "maps fit much better with the vsini of the mean profile than with the given one: {} km/s is written",
                draft.star.vsini_kms
            )
        });
        let ending = match (&self.end, &self.diagnosis) {
            (End::Untried, _) => "missing rotation period: other commands refuse the config".into(),
            (End::Fits(maps), None) => format!("test fit: {maps}"),
            (End::Fits(maps), Some(diagnosis)) => {
                let larger =
                    self.errors.iter().flatten().find_map(MeasuredErrors::misfit).map_or_else(String::new, |misfit| {
                        format!("; without it \"auto\" makes the errors {misfit:.1} times those of the continuum")
                    });
                format!("test fit: {maps}, but not to within the uncertainties: {}{larger}", diagnosis.text)
            }
        };
        let star = self.star.as_ref().map(|star| format!("star: {star}"));
        let indicators = self.indicators.iter().map(|found| format!("indicator {found}"));
        vsini.into_iter().chain([ending]).chain(star).chain(indicators).chain(self.warnings.iter().cloned()).collect()
    }
}
