//! The quantity in a map of the star, and its colours, discs and words.

use super::injected::Injected;
use super::surface::Scale;
use crate::figures::drawing::colour::ColourMap;
use crate::figures::drawing::panel::Shade;
use crate::star::{Brightness, Disc};

/// The quantity in a map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Content {
    /// Spot filling factors.
    Spots,
    /// Brightnesses; that of spots is known.
    Brightness(Brightness),
}

impl Content {
    pub fn title(self, what: &str, spottedness: Option<f64>) -> String {
        spottedness.map_or_else(
            || what.to_owned(),
            |s| match self {
                Content::Spots => format!("{what}: {:.1} % spotted", 100.0 * s),
                Content::Brightness(_) => format!("{what}: brightness varies by {:.1} % rms", 100.0 * s),
            },
        )
    }

    /// Discs with the map's value inside them, those that cover others last: spots with larger filling, brighter
    /// faculae, and spots over any faculae that they cover.
    pub fn discs(self, injected: &Injected) -> Vec<(Disc, f64)> {
        let mut spots: Vec<(Disc, f64)> = injected.spots.iter().map(|spot| (spot.disc(), spot.filling)).collect();
        spots.sort_by(|a, b| a.1.total_cmp(&b.1));
        let Content::Brightness(of_spots) = self else { return spots };
        let mut discs: Vec<(Disc, f64)> = injected.faculae.iter().map(|f| (f.disc, 1.0 + f.excess)).collect();
        discs.sort_by(|a, b| a.1.total_cmp(&b.1));
        discs.extend(spots.into_iter().map(|(disc, filling)| (disc, of_spots.at(filling))));
        discs
    }

    /// Colours for all painted values.
    pub fn scale(self, values: impl Iterator<Item = f64>) -> Scale {
        let photosphere = if self == Content::Spots { 0.0 } else { 1.0 };
        let highest = values.map(|value| (value - photosphere).abs()).fold(0.0, f64::max);
        // a map of faint spots has a smaller scale
        let reach = if highest > 0.5 { 1.0 } else { ((10.0 * highest).ceil() / 10.0).max(0.1) };
        let shade = match self {
            Content::Spots => Shade { map: ColourMap::Spots, low: 0.0, high: reach },
            Content::Brightness(_) => Shade { map: ColourMap::Brightness, low: 1.0 - reach, high: 1.0 + reach },
        };
        Scale { shade, photosphere }
    }

    pub fn label(self) -> &'static str {
        match self {
            Content::Spots => "spot filling factor",
            Content::Brightness(_) => "brightness over that of the photosphere",
        }
    }
}
