//! Tries a draft out as `map` would: by the maps of its objective, on few pixels and few profiles for the sake of time;
//! and what is likely to be wrong if there are none. Of a static map it is whether it reaches its target chi2 with
//! uncertainties as the continuum has them, without a planet or with the best orbit that a search finds.

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

/// Stands in for a rotation period that is still to be given, so that everything else is checked (d).
const STAND_IN_D: f64 = 1.0;

/// Pixels, and so many profiles of each data set at least, with which evolving maps are tried.
const PIXELS: usize = 500;
const PROFILES: usize = 12;

/// Evolving maps that leave a larger chi2 per datum than this do not fit.
const POOR: f64 = 1.5;

/// A vsini is a better one where ln Z is higher by more than this.
const BETTER: f64 = 10.0;

/// Errors that a map needs may be larger by this than those that it is hoped to do with.
const AS_GOOD: f64 = 0.8;

/// Where errors have to be larger than those of the continuum by more than this, and nothing that is tried helps, they
/// are not at fault: the model is.
const MOST_MISFIT: f64 = 5.0;

/// More of a star is hardly ever spotted in a maximum-entropy map.
const MANY_SPOTS: f64 = 0.25;

/// What became of it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Trial {
    /// How it ended.
    pub end: End,
    /// What the profiles of each data set say of their errors, where that is left to them.
    pub errors: Vec<Option<MeasuredErrors>>,
    /// Why no map fits as well as the errors promise, if none does.
    pub diagnosis: Option<Diagnosis>,
    /// Whether the start is an orbit, since there is no fit without one.
    pub orbit: bool,
    /// Whether the measured vsini stands in place of the given one, with which nothing fits.
    pub measured_vsini: bool,
    /// What was fitted of the star, and what it gains.
    pub star: Option<String>,
    /// What activity indicators have to do with the spots.
    pub indicators: Vec<String>,
    /// What has to be known of the maps.
    pub warnings: Vec<String>,
}

/// How it ended.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum End {
    /// It was not tried: there is no rotation period.
    Untried,
    /// There are maps: what they are, in words.
    Fits(String),
}

/// The key of the velocity zero points.
const JITTER: &str = "observations.velocity_jitter_kms";

/// One draft, tried.
struct Attempt {
    /// The draft with its profiles; `None` where their errors cannot be measured.
    scene: Option<Scene>,
    reached: Result<f64, String>,
    /// Whether errors are larger than those of the continuum, or than those given would have to be, because no map
    /// fits.
    misfits: bool,
    /// By how much; 1 where they do not.
    misfit: f64,
}

/// What a draft is tried on.
#[derive(Clone, Copy)]
pub(super) struct Observed<'a> {
    /// Where the config goes, and its lists.
    pub place: &'a Place<'a>,
    /// The profiles of each list.
    pub profiles: &'a [ProfileSet],
    /// What those of the first say.
    pub values: &'a Values,
    /// What is known without them.
    pub known: &'a Known,
}

/// Tries `draft` on its profiles, a set for each list. Changes vsini where the given one is far from that of the
/// profiles and no map fits with it; of a static map the draft's start, too, where only an orbit makes a map fit. No
/// orbit is searched for with such a vsini.
///
/// # Errors
/// Given values that make no sense; a model that has no maps of these profiles, with the likely reason.
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

/// The trial of maps that evolve.
fn evolving(draft: &mut Draft, Observed { place, profiles, values, known }: Observed) -> Result<Trial, ProposalError> {
    let few: Vec<ProfileSet> = profiles.iter().map(|set| share(set, PROFILES)).collect();
    // what is wrong with the draft itself is said of itself
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
        // spots that do not live for a rotation fit anything, a second star included
        trial.diagnosis = Diagnosis::at_sight(&scene).filter(|seen| seen.reason == Reason::DoubleLines);
    }
    trial.star = scene.measured.star.as_ref().map(MeasuredStar::line);
    trial.indicators = scene.measured.indicators.iter().map(FittedIndicator::line).collect();
    // a second star makes another rotation period look better
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

/// That there are no maps, and why, as `map` would say it.
fn no_maps(place: &Place, diagnosis: Option<Diagnosis>, error: &NoMaps) -> ProposalError {
    let status = error.status().map_or_else(String::new, |status| format!(" ({status})"));
    let reason = diagnosis.map_or_else(|| error.to_string(), |diagnosis| diagnosis.text);
    ProposalError::NoMaps { list: place.first_list().into(), status, reason }
}

/// The trial of static maps.
fn unchanging(
    draft: &mut Draft,
    Observed { place, profiles, values, known }: Observed,
) -> Result<Trial, ProposalError> {
    let config = place.config;
    let mut trial = Trial::of(End::Untried);
    let mut attempt = match attempt_of(draft, config, profiles) {
        // few profiles do not tell how much their zero points scatter
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
    // neither a second star nor variances are a planet's
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
        // what is measured, not what is given
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

/// Puts the best orbit and systemic velocity into the draft, searched for with errors as the continuum has them;
/// whether there are any.
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
        // what matters is that there is no map
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

    /// Whether a map can be made of the config as it is.
    pub fn is_complete(&self) -> bool {
        matches!(self.end, End::Fits(_))
    }

    /// It in words.
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
        let star = self.star.as_ref().map(|star| format!("fitted star: {star}"));
        let indicators = self.indicators.iter().map(|found| format!("indicator {found}"));
        vsini.into_iter().chain([ending]).chain(star).chain(indicators).chain(self.warnings.iter().cloned()).collect()
    }
}
