//! A first config for observed profiles: what they say themselves, what is given, and what has to be assumed; each
//! value with where it came from.
//!
//! It is a config that `map`, `periodogram` and `sample` take as it is, and that is tried out. Where the model does not
//! fit as well as the errors of the continuum promise, what is likely to be wrong is found by trying (`diagnosis`), and
//! put right where it was measured.

mod digits;
mod ledger;
mod line;
mod trial;
mod values;

pub use ledger::{Entry, Source};

use crate::data::config::{Draft, EquivalentWidth};
use crate::data::dataset::SceneError;
use crate::data::io::lsd;
use crate::inference::first_look::LookError;
use crate::numerics::units::gaussian_as_wide_as_voigt;
use crate::star::BrightnessModel;
use crate::surface::objective::ObjectiveKind;
use ledger::Ledger;
use std::path::{Path, PathBuf};
use values::Values;

/// A value with who gave it: an option, or a line of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Given<T> {
    /// The value.
    pub value: T,
    /// Who gave it, for the table.
    pub by: String,
}

/// What is known of the star without its profiles; all of it may be absent. Names and units are those of the config.
#[derive(Clone, Debug, Default, PartialEq)]
#[allow(missing_docs)]
pub struct Known {
    pub rotation_period_d: Option<Given<f64>>,
    pub epoch_d: Option<Given<f64>>,
    pub inclination_deg: Option<Given<f64>>,
    pub vsini_kms: Option<Given<f64>>,
    pub vsys_kms: Option<Given<f64>>,
    pub domega_rad_d: Option<Given<f64>>,
    /// Coefficient of the linear law.
    pub limb_darkening: Option<Given<f64>>,
    pub photosphere_k: Option<Given<f64>>,
    pub spot_k: Option<Given<f64>>,
    pub wavelength_nm: Option<Given<f64>>,
    /// Standard deviation of the local line, of its Gaussian.
    pub line_sigma_kms: Option<Given<f64>>,
    /// Half width at half depth of its Lorentzian, which makes it a Voigt profile.
    pub line_gamma_kms: Option<Given<f64>>,
    pub equivalent_width: Option<Given<EquivalentWidth>>,
    pub resolving_power: Option<Given<f64>>,
    pub velocity_range_kms: Option<Given<(f64, f64)>>,
    pub sigma_scale: Option<Given<f64>>,
    pub objective: Option<Given<ObjectiveKind>>,
    pub brightness: Option<Given<BrightnessModel>>,
    pub pixels: Option<Given<usize>>,
    pub chi2_target: Option<Given<f64>>,
}

impl Known {
    /// What reconstructions are judged by: what is right for most stars, if nothing else is given.
    fn objective(&self) -> ObjectiveKind {
        self.objective.as_ref().map_or(ObjectiveKind::MarginalLikelihood, |given| given.value)
    }

    /// Standard deviation (km/s) of the Gaussian as wide as the local line, whose Gaussian has that of `sigma_kms`.
    fn line_width_kms(&self, sigma_kms: f64) -> f64 {
        self.line_gamma_kms.as_ref().map_or(sigma_kms, |gamma| gaussian_as_wide_as_voigt(sigma_kms, gamma.value))
    }
}

/// Where things are or will be.
#[derive(Clone, Debug)]
pub struct Place<'a> {
    /// The config that will be written.
    pub config: &'a Path,
    /// The list of profiles.
    pub list: &'a Path,
    /// Its content, which need not have been written.
    pub list_bytes: &'a [u8],
    /// The list as the config names it, relative to the config's folder.
    pub list_in_config: PathBuf,
    /// The JSON Schema as the config names it.
    pub schema: Option<String>,
}

/// A config and where its values came from.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// The config, as text.
    pub json: String,
    /// What was observed, in a line.
    pub observed: String,
    /// Every value that is worth a look, with its source.
    pub entries: Vec<Entry>,
    /// What became of the trial, and what looks wrong.
    pub notes: Vec<String>,
    /// Whether a map can be made of the config as it is.
    pub complete: bool,
}

/// Why there is no proposal: one line that names the file at fault.
#[derive(Debug, thiserror::Error)]
pub enum ProposalError {
    /// The list or a profile, or a given value that makes no sense.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The profiles show no star.
    #[error("{}: {error}", .list.display())]
    Look {
        /// The list of profiles.
        list: PathBuf,
        /// What is wrong with them.
        error: LookError,
    },
    /// The model is nowhere near the profiles.
    #[error("{}: no map fits unless the errors are {factor:.1} times as large: {reason}", .list.display())]
    OutOfReach {
        /// The list of profiles.
        list: PathBuf,
        /// Factor on the errors of the continuum at which a map would fit.
        factor: f64,
        /// The likely reason, by trying.
        reason: String,
    },
    /// A path that JSON cannot hold.
    #[error("{}: the path of the observations cannot be written in JSON: {problem}", .config.display())]
    Path {
        /// The config.
        config: PathBuf,
        /// What is wrong.
        problem: String,
    },
}

/// The proposal for the profiles of a list, of a star of which something is known. What looks wrong is said at once by
/// `say`, before anything is tried out.
///
/// # Errors
/// Profiles that cannot be read or show no line, given values that make no sense or are far from what the profiles say.
pub fn propose(place: &Place, known: &Known, say: &dyn Fn(&str)) -> Result<Proposal, ProposalError> {
    let profiles = lsd::read_listed(place.list, place.list_bytes).map_err(SceneError::from)?;
    let mut whole = profiles.observations.clone();
    let mut ledger = Ledger::default();
    let look = |error| ProposalError::Look { list: place.list.into(), error };
    let values = Values::measure(&mut whole, known, &mut ledger).map_err(look)?;
    let cut = profiles.within(Some(values.velocity_range_kms), 1.0).map_err(SceneError::from)?;
    let cut = cut.over_continuum(values.continuum_level.unwrap_or(1.0));
    let mut draft = values.draft(&cut, known, &mut ledger);
    draft.observations.path = Some(place.list_in_config.clone());
    draft.schema.clone_from(&place.schema);
    let mut notes: Vec<String> = profiles.remarks.iter().map(|remark| format!("profiles: {remark}")).collect();
    notes.extend(values.notes(known));
    notes.iter().for_each(|note| say(note));
    // one map that does not change has the sharper eye for what is wrong with a model
    let mut trial = trial::run(&mut draft, place, &profiles, &values, known)?;
    draft.imaging.objective = known.objective();
    if draft.star.rotation_period_d.is_finite() && known.objective() == ObjectiveKind::MarginalLikelihood {
        trial.errors = trial::errors(&draft, place.config, &profiles)?;
    }
    values::note_objective(&draft, known, trial.change.as_ref(), &mut ledger);
    notes.extend(trial.notes(&draft));
    values.note_errors(known, trial.errors.as_ref(), &mut ledger);
    Values::note_jitter(&draft, &mut ledger);
    if trial.measured_vsini {
        ledger.replace(
            "star.vsini_kms",
            draft.star.vsini_kms,
            "flanks of the mean profile, in place of the given one: see the note",
        );
    }
    values::note_orbit(&draft, trial.orbit && trial.is_complete(), &mut ledger);
    Ok(Proposal {
        json: to_json(&draft, place.config)?,
        observed: values.observed(&whole),
        entries: ledger.entries,
        notes,
        complete: trial.is_complete(),
    })
}

fn to_json(draft: &Draft, config: &Path) -> Result<String, ProposalError> {
    draft.to_json().map_err(|e| ProposalError::Path { config: config.into(), problem: e.to_string() })
}
