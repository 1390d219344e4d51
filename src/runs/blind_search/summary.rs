//! The summary of a blind search, for the results of commands that follow it.

use super::options::BlindSearchError;
use crate::inference::evidence::EvidenceRecord;
use crate::planets::periodogram::RotationPeriods;
use crate::planets::periodogram::window::is_same_frequency;
use crate::planets::verdict::{Remark, Verdict};
use serde::{Deserialize, Serialize};

/// The summary of a blind search.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SearchSummary {
    /// The verdict on the best orbit.
    pub verdict: Verdict,
    /// Remarks beside the verdict.
    pub remarks: Vec<Remark>,
    /// The star's periods under this sampling; null where there was no search.
    #[doc(hidden)]
    pub rotation: Option<RotationPeriods>,
    /// Bayes factors of no, one and two planets; absent where the config has no priors for them.
    #[doc(hidden)]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub evidence: Option<EvidenceRecord>,
}

impl SearchSummary {
    /// For a failed search.
    pub(super) fn failed(error: &BlindSearchError) -> Self {
        let verdict = Verdict::not_judged(format!("the blind search failed ({error})"));
        SearchSummary { verdict, remarks: Vec::new(), rotation: None, evidence: None }
    }

    /// The same for an orbit that was found, with this `Porb/Prot`.
    #[doc(hidden)]
    pub fn beside(mut self, porb_over_prot: f64, rotation_period_d: f64) -> Self {
        let another = self.of_another_orbit(porb_over_prot, rotation_period_d);
        if let Some(another) = another.filter(|_| self.verdict.finding.is_signal()) {
            self.verdict = self.verdict.with(std::slice::from_ref(&another));
            self.remarks.push(another);
        }
        self
    }

    /// The caveat on an orbit that was found, with this `Porb/Prot`, where the verdict is on another one.
    #[doc(hidden)]
    pub fn of_another_orbit(&self, porb_over_prot: f64, rotation_period_d: f64) -> Option<Remark> {
        let (judged, rotation) = (self.verdict.signal?.period_d, self.rotation.as_ref()?);
        let frequency = 1.0 / (judged / rotation_period_d);
        (!is_same_frequency(1.0 / porb_over_prot, frequency, rotation.time_base_cycles)).then(|| {
            let found = rotation_period_d * porb_over_prot;
            Remark::against(
                format!("this fit has another period ({found:.4} d)"),
                format!("the blind search finds P = {judged:.4} d, this fit P = {found:.4} d"),
            )
        })
    }
}
