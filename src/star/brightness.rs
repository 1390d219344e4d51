//! The content of a map of the star, and the brightness of a pixel (`docs/method.md` section 1).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What the pixels of a map hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BrightnessModel {
    /// Filling factors of spots as dark as the star's contrast says; nothing is brighter than the photosphere.
    #[default]
    Spots,
    /// Brightnesses above and below that of the photosphere; the contrast has no part in them.
    BrightAndDark,
}

impl BrightnessModel {
    /// The name used in configs and tables.
    pub fn name(self) -> &'static str {
        match self {
            BrightnessModel::Spots => "spots",
            BrightnessModel::BrightAndDark => "bright-and-dark",
        }
    }

    /// Whether it is the default, which configs need not mention.
    pub fn is_default(&self) -> bool {
        *self == BrightnessModel::default()
    }
}

/// Brightness of a pixel, that of the photosphere being 1, as an affine function of the map's value there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Brightness {
    /// Where the map holds 0.
    at_zero: f64,
    /// Its derivative.
    pub slope: f64,
}

impl Brightness {
    /// The map holds the brightness.
    pub const ITSELF: Brightness = Brightness { at_zero: 0.0, slope: 1.0 };

    /// The map holds filling factors of spots of brightness `contrast`.
    pub fn of_spots(contrast: f64) -> Self {
        Brightness { at_zero: 1.0, slope: -(1.0 - contrast) }
    }

    /// Brightness where the map holds `x`.
    #[inline]
    pub fn at(&self, x: f64) -> f64 {
        self.at_zero + self.slope * x
    }
}
