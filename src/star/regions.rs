//! Differences in active regions other than brightness: their line, its area, and the change of contrast and area
//! towards the limb (`docs/method.md` section 1).
//!
//! With the filling factor x of spots, the line l of the photosphere and that of a region, r, a profile is `sum w [l -
//! x ((q + q1 m) l - (F + F1 m) (r - l))] / sum w [1 - x (q + q1 m)]`, `m = 1 - mu`: linear in x above and below. On
//! the Sun lines of spots are wider and stronger, and convection is inhibited in spots and in the plages around them,
//! which are several times as large and bright only at the limb.

use super::LocalLine;

/// Differences in active regions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Regions {
    /// Width of the line before the spectrograph over that of the photosphere's.
    pub line_width: f64,
    /// Its equivalent width over that of the photosphere's.
    pub equivalent_width: f64,
    /// Its velocity (km/s) over that of the photosphere, positive to the red.
    pub shift_kms: f64,
    /// F: area with this line per unit of the spots' filling factor.
    pub area: f64,
    /// F1: increase of that area at the limb.
    pub area_limb: f64,
    /// q1: additional darkening at the limb of spots with their surroundings.
    pub dimming_limb: f64,
}

/// Combination of the lines of photosphere and regions: factors of the sums over pixels, plain and weighted by `1 -
/// mu`, per unit of dimming.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Mixture {
    /// Of the photosphere's line.
    pub own: [f64; 2],
    /// Of the line of regions.
    pub region: [f64; 2],
}

impl Regions {
    /// Spots that are merely dimmed photosphere.
    pub const PLAIN: Regions = Regions {
        line_width: 1.0,
        equivalent_width: 1.0,
        shift_kms: 0.0,
        area: 0.0,
        area_limb: 0.0,
        dimming_limb: 0.0,
    };

    /// Whether spots are merely dimmed photosphere: the line of regions has no effect.
    pub fn are_plain(&self) -> bool {
        self.area == 0.0 && self.area_limb == 0.0 && self.dimming_limb == 0.0
    }

    /// Whether anything depends on the distance from the limb.
    pub(super) fn know_the_limb(&self) -> bool {
        self.area_limb != 0.0 || self.dimming_limb != 0.0
    }

    /// The line of regions where that of the photosphere is `line`.
    pub fn line(&self, line: LocalLine) -> LocalLine {
        let instrumental = line.instrumental_sigma_kms;
        let own = (line.sigma_kms.powi(2) - instrumental.powi(2)).max(0.0).sqrt();
        LocalLine {
            sigma_kms: (self.line_width * own).hypot(instrumental),
            gamma_kms: self.line_width * line.gamma_kms,
            equivalent_width_kms: line.equivalent_width_kms.map(|width| self.equivalent_width * width),
            ..line
        }
    }

    /// The combination of lines for a fully spotted pixel of this brightness.
    pub(super) fn mixture(&self, contrast: f64) -> Mixture {
        let q = 1.0 - contrast;
        let (area, area_limb) = (self.area / q, self.area_limb / q);
        Mixture { own: [1.0 + area, self.dimming_limb / q + area_limb], region: [-area, -area_limb] }
    }
}

impl Default for Regions {
    fn default() -> Self {
        Regions::PLAIN
    }
}
