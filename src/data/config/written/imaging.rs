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
    /// With objectives of a static map: its brightness model, spots only if not given. Not with "marginal-likelihood",
    /// the default, whose maps may be brighter or darker than the photosphere.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub brightness: Option<BrightnessModel>,
    /// Default spot filling factor of a pixel without data, above 0 and below 0.5; unused by bright-and-dark maps.
    pub default_spot: f64,
    /// Target chi2 per datum, above 0. "auto": the highest value below which the rms of the filtered radial velocities
    /// (observed minus modelled first moments) stops decreasing, at the config's values.
    pub chi2_target: Automatic,
    /// What a reconstruction is judged by.
    pub objective: ObjectiveKind,
    /// With objectives of a static map: a longer gap between profiles (d), above 0, begins another season, which has
    /// its own map. If not given, 60.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub season_gap_d: Option<f64>,
    /// In place of `season_gap_d`: the seasons as `[start, end]` (d), one after the other.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub seasons: Vec<[f64; 2]>,
    /// With objective "marginal-likelihood": prior standard deviation of the spot filling factor, from 0.01 to 1.5.
    #[serde(skip_serializing_if = "Hyperparameter::is_default")]
    pub spot_amplitude: Hyperparameter,
    /// With objective "marginal-likelihood": power-law index of the angular power spectrum of the spots in l(l+1) (the
    /// variance of a harmonic falls as l^(-2 index)), from 0 (small spots) to 3 (large ones).
    #[serde(skip_serializing_if = "Hyperparameter::is_default")]
    pub spot_slope: Hyperparameter,
    /// With objective "marginal-likelihood": turnover degree of the angular power spectrum, flat below it, from 0 (a
    /// pure power law) to 30. If not given, 0 or 7 (spots of 10 to 25 degrees), whichever has the higher evidence; 0
    /// with a number as `spot_slope`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spot_break_degree: Option<f64>,
    /// With objective "marginal-likelihood": spot lifetime, from 0.3 to 3000 d, or "static".
    #[serde(skip_serializing_if = "Hyperparameter::is_default")]
    pub spot_lifetime_d: Hyperparameter,
    /// Unresolved-spot noise of a chain. Likelihood grids and optima use "entropy".
    pub unresolved_spots: UnresolvedSpots,
    /// Nuisance parameters of line and continuum per profile, marginalised over: standard deviations of their Gaussian
    /// priors around 0, from 0 (no nuisance) to 10.
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
