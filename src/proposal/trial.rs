//! Tries a draft out: whether a map reaches its target chi2, and by how much the errors promise too much if none does.

use super::values::significant;
use super::{ProposalError, to_json};
use crate::config::{self, Draft};
use crate::imaging::Imager;
use crate::objective::{Reference, ReferenceError};
use crate::observation::Observations;
use std::path::Path;

/// Stands in for a rotation period that is still to be given, so that everything else is checked (d).
const STAND_IN_D: f64 = 1.0;

/// Errors are scaled to stay that far above those at which the target is just reached: at other parameters the floor is higher.
const CLEARANCE: f64 = 1.2;

/// Most rounds of scaling and trying again; it takes one or two.
const ROUNDS: usize = 4;

/// What became of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Outcome {
    /// It was not tried: there is no rotation period.
    Untried,
    /// A map reaches the target.
    Reached {
        /// How much of the star is spotted then.
        spottedness: f64,
    },
    /// One does with errors scaled anew.
    Scaled {
        /// How much of the star is spotted then.
        spottedness: f64,
        /// Factor on the errors as quoted at which the best fit just reaches the target.
        floor_scale: f64,
    },
    /// None does, and none will.
    Failed(ReferenceError),
}

/// Tries `draft` on `cut`, the profiles within its velocity range with errors as quoted, and scales its errors where need be,
/// unless they are the user's own.
pub(super) fn run(
    draft: &mut Draft,
    config: &Path,
    cut: &Observations,
    scale_is_given: bool,
) -> Result<Outcome, ProposalError> {
    if draft.rotation_period_d.is_none() {
        reference(&Draft { rotation_period_d: Some(STAND_IN_D), ..draft.clone() }, config, None)?;
        return Ok(Outcome::Untried);
    }
    let (mut last, mut floor_scale) = (Outcome::Untried, None);
    for _ in 0..ROUNDS {
        last = match reference(draft, config, Some(cut))? {
            None => Outcome::Untried,
            Some(Ok(reference)) => {
                let spottedness = reference.solution.spottedness;
                return Ok(match floor_scale {
                    None => Outcome::Reached { spottedness },
                    Some(floor_scale) => Outcome::Scaled { spottedness, floor_scale },
                });
            }
            Some(Err(error)) => Outcome::Failed(error),
        };
        match last {
            Outcome::Failed(ReferenceError::TargetBelowFloor { target, floor }) if !scale_is_given => {
                let least = draft.sigma_scale * (floor / target).sqrt();
                floor_scale = Some(least);
                draft.sigma_scale = significant(CLEARANCE * least, f64::ceil);
            }
            _ => break,
        }
    }
    Ok(last)
}

/// Resolves the draft, and makes the reference image of it on the profiles `cut`, if any.
fn reference(
    draft: &Draft,
    config: &Path,
    cut: Option<&Observations>,
) -> Result<Option<Result<Reference, ReferenceError>>, ProposalError> {
    let settings = config::from_json(to_json(draft, config)?.as_bytes(), config)?;
    let Some(cut) = cut else { return Ok(None) };
    let mut observations = cut.clone();
    for profile in &mut observations.profiles {
        profile.sigma.iter_mut().for_each(|sigma| *sigma *= draft.sigma_scale);
    }
    settings.check_velocity_grid(&settings.values, observations.step_kms)?;
    let star = settings.star_for(&observations)?;
    let imager = Imager::new(star, &observations, settings.imaging.pixels, settings.imaging.default_spot);
    Ok(Some(Reference::build(&imager, settings.values, settings.imaging.chi2_target)))
}

impl Outcome {
    /// Whether a map can be made of the config as it is.
    pub fn is_complete(&self) -> bool {
        matches!(self, Outcome::Reached { .. } | Outcome::Scaled { .. })
    }

    /// It in words; `quoted` is the error of a bin as its file has it.
    pub fn notes(&self, quoted: f64, draft: &Draft) -> Vec<String> {
        let fits = |spottedness: f64| {
            format!("tried out: spots on {:.1} % of the star fit the profiles to the target chi2", 100.0 * spottedness)
        };
        match self {
            Outcome::Untried => vec!["without a rotation period no command takes the config".into()],
            Outcome::Reached { spottedness } => vec![fits(*spottedness)],
            Outcome::Scaled { spottedness, floor_scale } => vec![
                format!(
                    "no map fits better than errors of {:.1e} a bin allow, so they are scaled to {:.1e}; better values for vsini, \
                     line or velocity range may allow less (see the README)",
                    quoted * floor_scale,
                    quoted * draft.sigma_scale
                ),
                fits(*spottedness),
            ],
            Outcome::Failed(error) => vec![format!("no command takes the config as it is: {error}")],
        }
    }
}
