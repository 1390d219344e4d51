//! Tries a draft out: whether a map reaches its target chi2 with errors as the continuum has them, without a planet or
//! with the best orbit that a search finds, and what is likely to be wrong if none does.

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
use crate::planets::periodogram::{Frequencies, FrequencySettings};
use crate::star::BrightnessModel;
use crate::surface::calibration::noise::MeasuredErrors;
use crate::surface::expansion::nuisances;
use crate::surface::{Change, NoMaps, ObjectiveKind, ReferenceError};
use std::path::Path;
use std::sync::Arc;

/// Stands in for a rotation period that is still to be given, so that everything else is checked (d).
const STAND_IN_D: f64 = 1.0;

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
    /// What the profiles say of their errors, where that is left to them.
    pub errors: Option<MeasuredErrors>,
    /// Why no map fits as well as the errors promise, if none does.
    pub diagnosis: Option<Diagnosis>,
    /// That the star changes, where no map fits and that is why.
    pub change: Option<Change>,
    /// Whether the start is an orbit, since there is no fit without one.
    pub orbit: bool,
    /// Whether the measured vsini stands in place of the given one, with which nothing fits.
    pub measured_vsini: bool,
}

/// How it ended.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum End {
    /// It was not tried: there is no rotation period.
    Untried,
    /// A map reaches the target.
    Reached {
        /// How spotted the star is then.
        spottedness: f64,
    },
    /// None does, since the star changes.
    Changes,
    /// None does, and none will: why.
    Failed(String),
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

/// Tries `draft` on its profiles. Changes the draft's start where only an orbit makes a map fit, and vsini where the
/// given one is far from that of the profiles and no map fits with it. No orbit is searched for with such a vsini.
///
/// # Errors
/// Given values that make no sense; a model so far from the profiles that nothing helps.
pub(super) fn run(
    draft: &mut Draft,
    Place { config, list, .. }: &Place,
    profiles: &ProfileSet,
    values: &Values,
    known: &Known,
) -> Result<Trial, ProposalError> {
    let mut trial =
        Trial { end: End::Untried, errors: None, diagnosis: None, change: None, orbit: false, measured_vsini: false };
    if draft.star.rotation_period_d.is_none() {
        let mut stand_in = draft.clone().with_jitter(VelocityJitter::default());
        stand_in.star.rotation_period_d = Some(STAND_IN_D);
        stand_in.observations.sigma_scale = Some(Automatic::Number(1.0));
        scene(&stand_in, config, profiles)?;
        return Ok(trial);
    }
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
    if attempt.misfits && is_this_star && known.objective().properties().map_changes {
        trial.change = change(draft, config, profiles)?;
        if trial.change.is_some() {
            // a line that is wrong may look like a star that changes
            let wrong = attempt.scene.as_ref().and_then(Diagnosis::of);
            trial.diagnosis = wrong.filter(|diagnosis| diagnosis.reason != Reason::Errors);
            trial.end = End::Changes;
            return Ok(trial);
        }
    }
    if attempt.misfits && is_this_star {
        let mut with_orbit = draft.clone();
        if search(&mut with_orbit, config, profiles, attempt.scene.as_ref())? {
            let other = attempt_of(&with_orbit, config, profiles)?;
            if other.reached.is_ok() && (!other.misfits || other.misfit < AS_GOOD * attempt.misfit) {
                (*draft, attempt, trial.orbit) = (with_orbit, other, true);
            }
        }
    }
    if attempt.misfits {
        trial.diagnosis = attempt.scene.as_ref().and_then(Diagnosis::of);
    }
    let hopeless = |diagnosis: &&Diagnosis| diagnosis.reason == Reason::Errors && attempt.misfit > MOST_MISFIT;
    if let Some(diagnosis) = trial.diagnosis.as_ref().filter(hopeless) {
        let (factor, reason) = (attempt.misfit, diagnosis.text.clone());
        return Err(ProposalError::OutOfReach { list: list.into(), factor, reason });
    }
    trial.errors = attempt.scene.and_then(|scene| scene.measured.errors);
    trial.end = match attempt.reached {
        Ok(spottedness) => End::Reached { spottedness },
        Err(error) => End::Failed(error),
    };
    Ok(trial)
}

/// What the profiles say of their errors where all maps are integrated over.
///
/// # Errors
/// As [`run`].
pub(super) fn errors(
    draft: &Draft,
    config: &Path,
    profiles: &ProfileSet,
) -> Result<Option<MeasuredErrors>, ProposalError> {
    Ok(integrated(draft, config, profiles)?.measured.errors)
}

fn integrated(draft: &Draft, config: &Path, profiles: &ProfileSet) -> Result<Scene, ProposalError> {
    let mut draft = draft.clone();
    draft.imaging.objective = ObjectiveKind::MarginalLikelihood;
    scene(&draft, config, profiles)
}

/// That the star changes, if it does.
fn change(draft: &Draft, config: &Path, profiles: &ProfileSet) -> Result<Option<Change>, ProposalError> {
    let Scene { settings, imager, .. } = integrated(draft, config, profiles)?;
    let Ok(frequencies) =
        Frequencies::new(&imager.cycles(), imager.star.rotation_period_d, FrequencySettings::default())
    else {
        return Ok(None);
    };
    let change = Change::of(&imager, settings.values, &frequencies, &nuisances(&settings.free), settings.known_field());
    Ok(change.ok().filter(Change::is_changing))
}

/// The draft as commands see it.
fn scene(draft: &Draft, config: &Path, profiles: &ProfileSet) -> Result<Scene, ProposalError> {
    let settings = config::from_json(to_json(draft, config)?.as_bytes(), config).map_err(SceneError::from)?;
    let data = Dataset::with_profiles(&settings, profiles.clone())?;
    Ok(Scene::of(settings, Arc::new(data))?)
}

/// The map at the draft's values.
fn attempt_of(draft: &Draft, config: &Path, profiles: &ProfileSet) -> Result<Attempt, ProposalError> {
    let scene = match scene(draft, config, profiles) {
        Ok(scene) => scene,
        // what is measured, not what is given
        Err(ProposalError::Scene(SceneError::Config(ConfigError::Key { key, problem, .. })))
            if key == "observations.sigma_scale"
                || key == JITTER && draft.observations.velocity_jitter_kms != Some(VelocityJitter::FITTED) =>
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
    profiles: &ProfileSet,
    tried: Option<&Scene>,
) -> Result<bool, ProposalError> {
    let measured = tried.and_then(|scene| scene.measured.errors.as_ref());
    let by_continuum = measured.and_then(|errors| Some(errors.continuum? * errors.correlated_bins.sqrt()));
    let mut with_its_errors = draft.clone();
    if let Some(scale) = by_continuum {
        with_its_errors.observations.sigma_scale = Some(Automatic::Number(scale));
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

impl Trial {
    /// Whether a map can be made of the config as it is.
    pub fn is_complete(&self) -> bool {
        matches!(self.end, End::Reached { .. } | End::Changes)
    }

    /// It in words.
    pub fn notes(&self, draft: &Draft) -> Vec<String> {
        let vsini = self.measured_vsini.then(|| {
            format!(
                "no map fits with the given vsini, and one does much better with that of the mean profile, which is \
                written: {} km/s",
                draft.star.vsini_kms
            )
        });
        let misfit = self.diagnosis.as_ref().map(|diagnosis| {
            let larger = self.errors.as_ref().and_then(MeasuredErrors::misfit).map_or_else(String::new, |misfit| {
                format!("; as it is, \"auto\" makes the errors {misfit:.1} times those of the continuum")
            });
            format!("the model does not fit as well as the errors promise: {}{larger}", diagnosis.text)
        });
        vsini.into_iter().chain(misfit).chain([self.ending(draft)]).collect()
    }

    fn ending(&self, draft: &Draft) -> String {
        match &self.end {
            End::Untried => "without a rotation period no command takes the config".into(),
            End::Reached { spottedness } => {
                let orbit =
                    if self.orbit { ", but only with an orbit; `periodogram` says what it is worth" } else { "" };
                let (percent, spots) = (100.0 * spottedness, draft.imaging.brightness == BrightnessModel::Spots);
                let many = match spots && *spottedness > MANY_SPOTS {
                    true => "; that is a lot: are vsini, inclination and line right?",
                    false => "",
                };
                let what = match spots {
                    true => format!("spots on {percent:.1} % of the star fit"),
                    false => format!("a brightness that varies by {percent:.1} % rms fits"),
                };
                format!("tried out: {what} the profiles{orbit}{many}")
            }
            End::Changes => {
                "tried out: no map of a star that stays as it is fits the profiles, and none need: the star \
                             changes while it is observed"
                    .into()
            }
            End::Failed(error) => format!("no command takes the config as it is: {error}"),
        }
    }
}
