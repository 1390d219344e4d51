//! The assumptions of a static map.

use crate::surface::ObjectiveKind;
use crate::surface::evolving_map::Known;

/// Spots that do not change within a season, by the map of maximum entropy at a target chi2.
#[derive(Clone, Copy, Debug)]
pub struct StaticMap {
    /// The objective.
    pub objective: ObjectiveKind,
    /// Target of chi2, per datum. Where it requires more than three times the entropy's weight over the number of data,
    /// the image stops short of it: beyond, noise is turned into spots.
    pub chi2_target: f64,
    /// Prior knowledge of the field for the comparison with evolving spots; without it there is none.
    pub compared_with: Option<Known>,
}
