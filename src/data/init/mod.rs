//! A first config for observed profiles: measured, given, and assumed values, each with its source.
//!
//! The config is accepted by `map`, `periodogram` and `sample` without changes, and is tested by maps of its objective.
//! Where no map fits, the likely fault is found by tests (`diagnosis`), and no config is made. Each of several lists is
//! a data set: they share the star, and the first has no RV offset.

mod digits;
mod known;
mod ledger;
mod light;
mod line;
mod proposal;
mod trial;
mod values;

pub use known::{Given, Known};
pub use ledger::{Entry, Source};
pub use light::LightCurve;
pub use proposal::{List, Place, Proposal, ProposalError};

use crate::data::config::{Beside, ObservationsSection, ZeroPoint};
use crate::data::dataset::SceneError;
use crate::data::io::lsd;
use crate::data::io::lsd::ProfileSet;
use crate::star::observation::Observations;
use ledger::Ledger;
use proposal::to_json;
use values::{Values, variances};

/// A list of profiles with its measurements.
struct Set {
    profiles: ProfileSet,
    whole: Observations,
    values: Values,
    ledger: Ledger,
    /// The profiles within the velocity range, in units of their continuum.
    cut: Observations,
}

/// The proposal for the profiles of some lists, given known properties of the star. Suspicious values are reported by
/// `say` at once, before any test.
///
/// # Errors
/// Profiles that cannot be read or show no line, given values that are invalid or inconsistent with the profiles;
/// profiles that maps of the config do not fit, with the likely reason.
pub fn propose(place: &Place, known: &Known, say: &dyn Fn(&str)) -> Result<Proposal, ProposalError> {
    let mut sets = place.lists.iter().map(|list| measured(list, known)).collect::<Result<Vec<Set>, _>>()?;
    let (first, others) = sets.split_at_mut(1);
    let first = &mut first[0];
    first.values.join(&others.iter().map(|set| &set.values).collect::<Vec<_>>(), known, &mut first.ledger);
    let cuts: Vec<&Observations> = std::iter::once(&first.cut).chain(others.iter().map(|set| &set.cut)).collect();
    let beside = Beside {
        photometry: place.light_curves.iter().map(LightCurve::section).collect(),
        indicators: place.indicators.clone(),
    };
    let mut draft = first.values.draft(&cuts, beside, known, &mut first.ledger);
    let several = place.lists.len() > 1;
    let mut sections = Vec::new();
    for (s, (set, list)) in sets.iter_mut().zip(&place.lists).enumerate() {
        let section = set.values.section(known, &mut set.ledger, several);
        let own = |of: fn(&List) -> Option<f64>| of(list).filter(|_| s > 0);
        sections.push(ObservationsSection {
            name: list.name.clone().filter(|_| several),
            path: Some(list.list_in_config.clone()),
            resolving_power: own(|list| list.resolving_power.as_ref().map(|given| given.value)),
            wavelength_nm: own(|list| list.wavelength_nm.as_ref().map(|given| given.value)),
            zero_point_kms: if s > 0 { ZeroPoint::FITTED } else { ZeroPoint::default() },
            ..section
        });
    }
    draft.observations.sections = sections;
    if let [Set { values, ledger, .. }] = &mut sets[..] {
        draft.imaging.nuisances = values.nuisances(ledger);
    }
    draft.schema.clone_from(&place.schema);
    let mut notes = Vec::new();
    for (set, list) in sets.iter().zip(&place.lists) {
        let of = list.name.as_ref().filter(|_| several).map_or_else(String::new, |name| format!("{name}: "));
        notes.extend(set.profiles.remarks.iter().map(|remark| format!("profiles: {of}{remark}")));
        let Some(text) = variances(&set.whole, &set.values.look.noise) else { continue };
        // the continuum scales them; without it maps would fit the noise, very slowly
        if set.values.look.noise.ratio().is_none() && known.sigma_scale.is_none() {
            return Err(ProposalError::Variances { list: list.list.into(), text });
        }
        notes.push(format!("{of}{text}"));
    }
    notes.extend(sets[0].values.notes(known, sets.iter().map(|set| set.whole.profiles.len()).sum()));
    notes.iter().for_each(|note| say(note));
    let profiles: Vec<ProfileSet> = sets.iter().map(|set| set.profiles.clone()).collect();
    let trial = trial::run(&mut draft, trial::Observed { place, profiles: &profiles, values: &sets[0].values, known })?;
    values::note_objective(&draft, known, &mut sets[0].ledger);
    notes.extend(trial.notes(&draft));
    for (s, set) in sets.iter_mut().enumerate() {
        set.values.note_errors(known, trial.errors.get(s).and_then(Option::as_ref), &mut set.ledger);
    }
    Values::note_jitter(&draft, &mut sets[0].ledger);
    if trial.measured_vsini {
        sets[0].ledger.replace(
            "star.vsini_kms",
            draft.star.vsini_kms,
            "flanks of the mean profile, replaces the given one: see the note",
        );
    }
    values::note_orbit(&draft, trial.orbit && trial.is_complete(), &mut sets[0].ledger);
    let mut ledger = Ledger::default();
    let observed: Vec<String> = sets.iter().map(|set| set.values.observed(&set.whole)).collect();
    for (s, set) in sets.into_iter().enumerate() {
        match s {
            0 if several => ledger.take_first(set.ledger),
            0 => ledger = set.ledger,
            _ => ledger.take_set(&set.ledger, s),
        }
    }
    for (s, list) in place.lists.iter().enumerate().skip(1) {
        let remark = "fitted: a prior of 3 km/s around 0; the first data set has none";
        ledger.note(format!("observations[{s}].zero_point_kms"), "fitted", "km/s", Source::Data, remark);
        if let Some(given) = &list.wavelength_nm {
            let key = format!("observations[{s}].wavelength_nm");
            ledger.note(key, given.value, "nm", Source::Given, given.by.as_str());
        }
    }
    place.light_curves.iter().for_each(|curve| curve.note(&mut ledger));
    Ok(Proposal {
        json: to_json(&draft, place.config)?,
        observed: observed.join("\n"),
        entries: ledger.entries,
        notes,
        complete: trial.is_complete(),
    })
}

/// The profiles of a list, with measurements.
fn measured(list: &List, known: &Known) -> Result<Set, ProposalError> {
    let known = &Known {
        resolving_power: list.resolving_power.clone().or_else(|| known.resolving_power.clone()),
        wavelength_nm: list.wavelength_nm.clone().or_else(|| known.wavelength_nm.clone()),
        ..known.clone()
    };
    let profiles =
        lsd::read_listed(list.list, list.list_bytes, known.range_kms(), lsd::FEWEST).map_err(SceneError::from)?;
    let mut whole = match &known.velocity_range_kms {
        Some(given) if known.only_within_range => profiles.within(Some(given.value), 1.0).map_err(SceneError::from)?,
        _ => profiles.observations.clone(),
    };
    let mut ledger = Ledger::default();
    let look = |error| ProposalError::Look { list: list.list.into(), error };
    let values = Values::measure(&mut whole, known, &mut ledger).map_err(look)?;
    let cut = profiles.within(Some(values.velocity_range_kms), 1.0).map_err(SceneError::from)?;
    let cut = cut.over_continuum(values.continuum_level.unwrap_or(1.0));
    Ok(Set { profiles, whole, values, ledger, cut })
}
