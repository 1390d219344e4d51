//! What is assumed of a static map.

use crate::surface::ObjectiveKind;
use crate::surface::evolving_map::Known;

/// Spots that do not change within a season, as the map of maximum entropy at a target chi2 has them.
#[derive(Clone, Copy, Debug)]
pub struct StaticMap {
    /// What a map is judged by.
    pub objective: ObjectiveKind,
    /// Target of chi2, per datum. Where it takes more than three times the entropy's weight over the number of data,
    /// the image stops short of it: beyond, noise is turned into spots.
    pub chi2_target: f64,
    /// What is known of the field in a comparison with spots that evolve; without it there is none.
    pub compared_with: Option<Known>,
}
