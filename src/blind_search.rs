//! The blind search that every statement on a planet rests on: what `periodogram` does without options, for the commands that go on
//! from there (`optimise`, `sample`, `batch`).
//!
//! An optimum or a chain takes a planet for granted and says which one; whether there is one is told by how often stars without a
//! planet show as much. So their results hold the search beside them, and its verdict heads them.

use crate::detection::{Detection, DetectionError, DetectionSettings, Evidence};
use crate::expansion::nuisances;
use crate::fit::Fit;
use crate::objective::{Parameter, Prior};
use crate::periodogram::{CircularOrbit, Frequencies, FrequencyError, FrequencySettings, RotationPeriods, Row};
use crate::scene::Scene;
use crate::verdict::{Remark, Signal, Verdict};
use serde::{Deserialize, Serialize};

/// What the search found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BlindSearch {
    /// What is said of the best orbit.
    pub verdict: Verdict,
    /// What has to be known beside the verdict.
    pub remarks: Vec<Remark>,
    /// The star's own periods under this sampling; null where there was no search.
    pub rotation: Option<RotationPeriods>,
}

#[derive(Debug, thiserror::Error)]
enum SearchError {
    #[error("{0}")]
    Frequencies(#[from] FrequencyError),
    #[error("{0}")]
    Detection(#[from] DetectionError),
}

impl BlindSearch {
    /// Searches the star of `scene`, what its config leaves free integrated out. `None` where no orbit is asked for, K being fixed.
    /// Where the search fails the verdict says why.
    pub fn of(scene: &Scene) -> Option<Self> {
        let asked = scene.settings.free.iter().any(|f| f.parameter == Parameter::K);
        asked.then(|| BlindSearch::tried(scene).unwrap_or_else(|error| BlindSearch::failed(&error)))
    }

    fn tried(scene: &Scene) -> Result<Self, SearchError> {
        let rotation_period_d = scene.imager.star.rotation_period_d;
        let frequencies = Frequencies::new(&scene.imager.cycles(), rotation_period_d, FrequencySettings::default())?;
        let settings =
            DetectionSettings::of(scene.settings.imaging.chi2_target.value(), nuisances(&scene.settings.free));
        let found = Detection::find(&scene.imager, scene.settings.values, frequencies, &settings, &|_| ())?;
        let fit = Fit::new(&scene.imager, &scene.observations, &found.last().reference);
        let misfit = &fit.checks.warnings;
        let evidence = Evidence { imager: &scene.imager, settings: &settings, robustness: None, misfit };
        let mut remarks = found.remarks(&evidence);
        let mut verdict = found.verdict(&remarks);
        let period = scene.settings.free.iter().find(|f| f.parameter == Parameter::PorbOverProt);
        if let Some(prior) = period.map(|f| f.prior).filter(|prior| !prior.contains(found.best.porb_over_prot)) {
            remarks.retain(|remark| !found.of_the_period().contains(remark));
            verdict = within(&prior, &found, &remarks);
            remarks.push(Remark::note(format!(
                "the highest peak of the blind search, {:.4} d, lies outside of the prior of porb_over_prot",
                rotation_period_d * found.best.porb_over_prot
            )));
        }
        Ok(BlindSearch { verdict, rotation: Some(found.blind.rotation.clone()), remarks })
    }

    fn failed(error: &SearchError) -> Self {
        let verdict = Verdict::not_judged(format!("the blind search failed ({error})"));
        BlindSearch { verdict, remarks: Vec::new(), rotation: None }
    }
}

/// The verdict where the best period lies outside of the `prior`: that of the highest place inside, by the chance of one as high at any
/// period.
fn within(prior: &Prior, found: &Detection, remarks: &[Remark]) -> Verdict {
    let orbit = |row: &Row| Some((1.0 / row.trial.frequency, row.trial.orbit?));
    let inside = found.blind.rows.iter().filter_map(orbit).filter(|(ratio, _)| prior.contains(*ratio));
    match inside.max_by(|a, b| a.1.delta_ln_l.total_cmp(&b.1.delta_ln_l)) {
        None => Verdict::not_judged("the blind search has no period within the prior of porb_over_prot"),
        Some((porb_over_prot, CircularOrbit { k_kms, sigma_k_kms, delta_ln_l, .. })) => {
            let rotation_period_d = found.frequencies.rotation_period_d;
            let imitation = found.blind.rotation.imitated(porb_over_prot, None);
            let words = imitation.map(|imitation| format!("the period is {}", imitation.words(rotation_period_d)));
            let remarks: Vec<Remark> =
                remarks.iter().cloned().chain(words.map(|words| Remark::against(words, ""))).collect();
            let signal = Signal { period_d: rotation_period_d * porb_over_prot, k_kms, sigma_k_kms };
            Verdict::new(found.blind.false_alarm.probability(delta_ln_l).value(), signal, &remarks)
        }
    }
}
