//! A first config for observed profiles: what they say themselves, what is given, and what has to be assumed; each
//! value with where it came from.
//!
//! It is a config that `map`, `periodogram` and `sample` take as it is, and that is tried out. Where the model does not
//! fit as well as the errors of the continuum promise, what is likely to be wrong is found by trying (`diagnosis`), and
//! put right where it was measured.

mod digits;
mod known;
mod ledger;
mod line;
mod proposal;
mod trial;
mod values;

pub use known::{Given, Known};
pub use ledger::{Entry, Source};
pub use proposal::{Place, Proposal, ProposalError};

use crate::data::dataset::SceneError;
use crate::data::io::lsd;
use ledger::Ledger;
use proposal::to_json;
use values::Values;

/// The proposal for the profiles of a list, of a star of which something is known. What looks wrong is said at once by
/// `say`, before anything is tried out.
///
/// # Errors
/// Profiles that cannot be read or show no line, given values that make no sense or are far from what the profiles say.
pub fn propose(place: &Place, known: &Known, say: &dyn Fn(&str)) -> Result<Proposal, ProposalError> {
    let profiles = lsd::read_listed(place.list, place.list_bytes, known.range_kms()).map_err(SceneError::from)?;
    let mut whole = match &known.velocity_range_kms {
        Some(given) if known.only_within_range => profiles.within(Some(given.value), 1.0).map_err(SceneError::from)?,
        _ => profiles.observations.clone(),
    };
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
    if draft.star.rotation_period_d.is_some() && known.objective().properties().map_changes {
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
