//! Tries a draft out: whether a map reaches its target chi2, without a planet or with the best orbit that a search finds, and by
//! how much the errors promise too much if none does.

use super::digits::{rounded, significant};
use super::values::Values;
use super::{Known, Place, ProposalError, to_json};
use crate::config::{self, Draft};
use crate::objective::{Parameter, Reference, ReferenceError};
use crate::observation::Observations;
use crate::scene::Scene;
use crate::search::{self, SearchError, SearchSettings};
use crate::star::BrightnessModel;
use std::path::Path;

/// Stands in for a rotation period that is still to be given, so that everything else is checked (d).
const STAND_IN_D: f64 = 1.0;

/// Errors are scaled to stay that far above those at which the target is just reached: at other parameters the floor is higher.
const CLEARANCE: f64 = 1.2;

/// Most rounds of scaling and trying again; it takes one or two.
const ROUNDS: usize = 4;

/// Errors that have to be scaled by more than this, beyond what the continuum says, are not at fault: the config is.
const MOST_SCALE: f64 = 5.0;

/// More of a star is hardly ever spotted in a maximum-entropy map.
const MANY_SPOTS: f64 = 0.25;

/// What became of it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Trial {
    /// How it ended.
    pub end: End,
    /// Factor on the errors as quoted at which the best fit just reaches the target, if they had to be scaled for it.
    pub floor_scale: Option<f64>,
    /// Whether the start is an orbit, since there is no fit without one.
    pub orbit: bool,
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
    /// None does, and none will: why.
    Failed(String),
}

/// Tries `draft` on `cut`, the profiles within its velocity range with errors as quoted. Changes the draft's start where only an
/// orbit makes a map fit, and scales its errors where nothing does, unless they are the user's own. No orbit is searched for where
/// the star is another one than that of the profiles.
///
/// # Errors
/// Given values that make no sense; a model so far from the profiles that their errors would have to be scaled beyond reason.
pub(super) fn run(
    draft: &mut Draft,
    Place { config, list, .. }: &Place,
    cut: &Observations,
    values: &Values,
    known: &Known,
) -> Result<Trial, ProposalError> {
    let (scale_is_given, other_star) = (known.sigma_scale.is_some(), values.is_another_star(known));
    let mut trial = Trial { end: End::Untried, floor_scale: None, orbit: false };
    if draft.rotation_period_d.is_none() {
        scene(&Draft { rotation_period_d: Some(STAND_IN_D), ..draft.clone() }, config, cut)?;
        return Ok(trial);
    }
    let without_planet = draft.clone();
    for _ in 0..ROUNDS {
        *draft = Draft { sigma_scale: draft.sigma_scale, ..without_planet.clone() };
        let mut reached = reach(draft, config, cut)?;
        trial.orbit = matches!(reached, Err(ReferenceError::TargetBelowFloor { .. }));
        trial.orbit &= !other_star;
        if trial.orbit {
            reached = match search(draft, config, cut)? {
                Ok(()) => reach(draft, config, cut)?,
                Err(SearchError::Reference(error)) => Err(error),
                // what matters is that there is no map
                Err(SearchError::Optimise(_)) => reached,
            };
        }
        match reached {
            Ok(spottedness) => {
                trial.end = End::Reached { spottedness };
                return Ok(trial);
            }
            Err(ReferenceError::TargetBelowFloor { target, floor }) if !scale_is_given => {
                let least = draft.sigma_scale * (floor / target).sqrt();
                if least > MOST_SCALE * without_planet.sigma_scale {
                    return Err(ProposalError::OutOfReach {
                        list: list.into(),
                        factor: least / without_planet.sigma_scale,
                        vsini_kms: draft.vsini_kms,
                        measured_kms: values.look.unspotted.vsini_kms,
                        error_kms: values.look.vsini_error_kms,
                    });
                }
                trial.floor_scale = Some(least);
                draft.sigma_scale = significant(CLEARANCE * least, f64::ceil);
            }
            Err(error) => {
                trial.end = End::Failed(error.to_string());
                break;
            }
        }
    }
    *draft = Draft { sigma_scale: draft.sigma_scale, ..without_planet };
    Ok(trial)
}

/// The draft as commands see it, with the profiles `cut`, their errors scaled.
fn scene(draft: &Draft, config: &Path, cut: &Observations) -> Result<Scene, ProposalError> {
    let settings = config::from_json(to_json(draft, config)?.as_bytes(), config)?;
    let mut observations = cut.clone();
    for profile in &mut observations.profiles {
        profile.sigma.iter_mut().for_each(|sigma| *sigma *= draft.sigma_scale);
    }
    Ok(Scene::of(settings, observations)?)
}

/// Spottedness of the map at the draft's values.
fn reach(draft: &Draft, config: &Path, cut: &Observations) -> Result<Result<f64, ReferenceError>, ProposalError> {
    let Scene { settings, imager, .. } = scene(draft, config, cut)?;
    let reference = Reference::build(&imager, settings.values, settings.imaging.chi2_target.value());
    Ok(reference.map(|reference| reference.solution.spottedness))
}

/// Puts the best orbit and systemic velocity into the draft, if there are any.
fn search(draft: &mut Draft, config: &Path, cut: &Observations) -> Result<Result<(), SearchError>, ProposalError> {
    let Scene { settings, imager, space, .. } = scene(draft, config, cut)?;
    Ok(search::find(&imager, &space, SearchSettings::new(&settings), &|_| ()).map(|found| {
        let best = space.values_at(&found.optimum.theta);
        // rounding does not lead out of the priors
        let within = |parameter, (min, max): (f64, f64)| rounded(best[parameter], 4).clamp(min, max);
        let k = within(Parameter::K, (0.0, draft.k_max_kms));
        let period = within(Parameter::PorbOverProt, draft.porb_over_prot_range);
        draft.orbit = (k, period, rounded(best[Parameter::Phi], 4).rem_euclid(1.0));
        draft.vsys_kms = within(Parameter::Vsys, draft.vsys_range_kms);
    }))
}

impl Trial {
    /// Whether a map can be made of the config as it is.
    pub fn is_complete(&self) -> bool {
        matches!(self.end, End::Reached { .. })
    }

    /// It in words; `quoted` is the error of a bin as its file has it.
    pub fn notes(&self, quoted: f64, draft: &Draft) -> Vec<String> {
        let scaled = self.floor_scale.map(|floor_scale| {
            format!(
                "no map fits better than errors of {:.1e} a bin allow, so they are scaled to {:.1e}; better values for vsini, line \
                 or velocity range may allow less (see the README)",
                quoted * floor_scale,
                quoted * draft.sigma_scale
            )
        });
        let end = match &self.end {
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
            End::Failed(error) => format!("no command takes the config as it is: {error}"),
        };
        scaled.into_iter().chain([end]).collect()
    }
}
