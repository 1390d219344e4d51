//! The sentences that head a result, as its file has them.

use super::chapter::Tone;
use crate::planets::verdict::{Finding, Verdict};

/// Of a verdict on a planet: a detection can be relied on, a candidate is to be doubted.
pub(super) fn of(verdict: &Verdict) -> (Tone, String) {
    let tone = match verdict.finding {
        Finding::Detection => Tone::Good,
        Finding::Candidate => Tone::Doubt,
        Finding::NoPlanetNeeded | Finding::NotJudged => Tone::Neutral,
    };
    (tone, verdict.sentence.clone())
}
