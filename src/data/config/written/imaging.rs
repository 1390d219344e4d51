//! `imaging` as users write it. Doc comments here are the descriptions of the JSON Schema.

use super::number_or::{Automatic, Hyperparameter};
use crate::maxent::entropy::Entropy;
use crate::star::BrightnessModel;
use crate::surface::nuisances::LineAndContinuum;
use crate::surface::{ObjectiveKind, UnresolvedSpots};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A longer gap between profiles (d) begins another season, unless the config has another number.
const SEASON_GAP_D: f64 = 60.0;

/// The Doppler image.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ImagingSettings {
    /// Pixels of the image, 100 to 2,000,000 (approximately: rings hold whole numbers of pixels).
    pub pixels: usize,
    /// With objectives of a static map: what its pixels hold, spots alone if not given. With "marginal-likelihood", the
    /// default, it has no meaning: spots may be brighter or darker than the photosphere.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub brightness: Option<BrightnessModel>,
    /// Spot filling factor of a pixel that the data say nothing about, above 0 and below 0.5; an image of bright and
    /// dark pixels has no use for it.
    pub default_spot: f64,
    /// Target chi2 per datum, above 0. "auto": the highest value below which the radial velocities that are left over,
    /// observed minus modelled, stop shrinking, at the config's values.
    pub chi2_target: Automatic,
    /// What a reconstruction is judged by.
    pub objective: ObjectiveKind,
    /// With objectives of a star that does not change: a longer gap between profiles (d), above 0, begins another
    /// season, which has a map of its own. If not given, 60.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub season_gap_d: Option<f64>,
    /// In place of `season_gap_d`: the seasons as `[start, end]` (d), one after the other.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub seasons: Vec<[f64; 2]>,
    /// With objective "marginal-likelihood": standard deviation of the spot filling factor before the data, from 0.01
    /// to 1.5.
    #[serde(skip_serializing_if = "Hyperparameter::is_default")]
    pub spot_amplitude: Hyperparameter,
    /// With objective "marginal-likelihood": how fast the spots' power falls with the degree of the harmonics, from 0
    /// (small spots) to 3 (large ones).
    #[serde(skip_serializing_if = "Hyperparameter::is_default")]
    pub spot_slope: Hyperparameter,
    /// With objective "marginal-likelihood": degree of the harmonics below which the spots' power does not rise any
    /// more, from 0 (a power law all the way) to 30. If not given, 0 or 7 (spots of 10 to 25 degrees, here and there),
    /// whichever has the higher evidence; 0 with a number as `spot_slope`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spot_break_degree: Option<f64>,
    /// With objective "marginal-likelihood": how long spots live, from 0.3 to 3000 d, or "static".
    #[serde(skip_serializing_if = "Hyperparameter::is_default")]
    pub spot_lifetime_d: Hyperparameter,
    /// What the chain takes the spots that the map leaves over for. Landscapes and optima take them as the entropy has
    /// them.
    pub unresolved_spots: UnresolvedSpots,
    /// Line and continuum of each profile by itself, integrated out: standard deviations of their Gaussian priors
    /// around 0, from 0 (no nuisance) to 10.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nuisances: Option<LineAndContinuum>,
}

impl Default for ImagingSettings {
    fn default() -> Self {
        ImagingSettings {
            pixels: 2000,
            brightness: None,
            default_spot: 1e-4,
            chi2_target: Automatic::Number(0.97),
            objective: ObjectiveKind::default(),
            season_gap_d: None,
            seasons: Vec::new(),
            spot_amplitude: Hyperparameter::default(),
            spot_slope: Hyperparameter::default(),
            spot_break_degree: None,
            spot_lifetime_d: Hyperparameter::default(),
            unresolved_spots: UnresolvedSpots::default(),
            nuisances: None,
        }
    }
}

impl ImagingSettings {
    /// A longer gap between profiles (d) begins another season.
    pub fn longest_gap_d(&self) -> f64 {
        match self.objective.properties().map_changes {
            true => f64::INFINITY,
            false => self.season_gap_d.unwrap_or(SEASON_GAP_D),
        }
    }

    /// What the pixels of a static map hold.
    pub fn brightness(&self) -> BrightnessModel {
        self.brightness.unwrap_or_default()
    }

    /// Entropy of the image.
    pub fn entropy(&self) -> Entropy {
        match self.brightness() {
            BrightnessModel::Spots => Entropy::new(self.default_spot),
            BrightnessModel::BrightAndDark => Entropy::BrightAndDark,
        }
    }
}
