//! The main sentences of a result, from its file.

use super::chapter::Tone;
use crate::planets::verdict::{Finding, Verdict};

/// For a verdict on a planet: a detection is reliable, a candidate doubtful.
pub(super) fn of(verdict: &Verdict) -> (Tone, String) {
    let tone = match verdict.finding {
        Finding::Detection => Tone::Good,
        Finding::Candidate => Tone::Doubt,
        Finding::NoPlanetNeeded | Finding::NotJudged => Tone::Neutral,
    };
    (tone, verdict.sentence.clone())
}
