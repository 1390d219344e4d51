//! Entropies of images, by content of the image (`docs/method.md` section 2): filling factors of dark spots (`spots`),
//! or brightnesses above and below that of the photosphere (`bright_and_dark`).
//!
//! The solver works in a coordinate u of each pixel that keeps the image inside its domain, and measures steps in the
//! entropy's own metric, in which -S has the unit matrix as its second derivative.

mod bright_and_dark;
mod pixels;
mod spots;

use crate::numerics::vector;
use crate::numerics::vector::linear::{combine_two, combined};
use bright_and_dark::Brightness;
use pixels::{Advance, Pixel, Step, Value, spottedness};
use spots::Filling;
use std::borrow::Cow;

/// The entropy with its default image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Entropy {
    /// Of spot filling factors s; the coordinate is logit(s).
    Spots {
        /// logit of the default filling factor.
        default_logit: f64,
    },
    /// Of brightnesses B, with the default 1; the coordinate is ln B.
    BrightAndDark,
}

/// Entropy and spottedness of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Worth {
    /// Entropy: at most 0, and 0 at the default.
    pub entropy: f64,
    /// Spottedness: how far the image is from one without spots.
    pub spottedness: f64,
}

/// A step of an image in the metric.
#[derive(Clone, Copy, Debug)]
pub struct MetricStep<'a> {
    /// Coordinates before it.
    pub u: &'a [f64],
    /// The image before it.
    pub image: &'a [f64],
    /// The step, ...
    pub z: &'a [f32],
    /// ... the scale of the metric, ...
    pub scale: &'a [f32],
    /// ... and its length.
    pub length: f32,
    /// Largest change of a coordinate.
    pub cap: f32,
}

impl Entropy {
    /// Entropy of spots relative to the default filling factor m, in (0, 1).
    pub fn new(default_spot: f64) -> Self {
        Entropy::Spots { default_logit: (default_spot / (1.0 - default_spot)).ln() }
    }

    /// Typical Lagrange multipliers of images, in units of those of spots: on the paper's star, with and without
    /// faculae, at chi2 = 0.97 per datum.
    pub fn lambda_unit(&self) -> f64 {
        match self {
            Entropy::Spots { .. } => 1.0,
            Entropy::BrightAndDark => 0.045,
        }
    }

    /// Coordinate of the default: the image without data.
    pub fn default_coordinate(&self) -> f64 {
        match *self {
            Entropy::Spots { default_logit } => default_logit,
            Entropy::BrightAndDark => 0.0,
        }
    }

    /// Lower bound of the coordinates for steps: the image is practically 0 there. The upper bound is symmetric.
    pub fn lowest_coordinate(&self) -> f64 {
        match self {
            Entropy::Spots { .. } => -Filling::LIMIT,
            Entropy::BrightAndDark => -Brightness::LIMIT,
        }
    }

    /// Image of the coordinates u.
    pub fn image(&self, u: &[f64]) -> Vec<f64> {
        match self {
            Entropy::Spots { .. } => spots::image(u),
            Entropy::BrightAndDark => bright_and_dark::image(u),
        }
    }

    /// Coordinates moved by the image step `step`, none by more than `cap`.
    pub fn step(&self, u: &[f64], image: &[f64], step: &[f32], cap: f32, out: &mut [f64]) {
        match *self {
            Entropy::Spots { default_logit } => {
                vector::run(Step { pixel: Filling::new(default_logit), u, image, step, cap, out });
            }
            Entropy::BrightAndDark => vector::run(Step { pixel: Brightness, u, image, step, cap, out }),
        }
    }

    /// Takes a step: coordinates, image, entropy and spottedness there.
    pub fn advance(&self, step: MetricStep, area: &[f64], u: &mut [f64], image: &mut [f64]) -> Worth {
        match *self {
            Entropy::Spots { default_logit } => {
                vector::run(Advance { pixel: Filling::new(default_logit), step, area, u, image })
            }
            Entropy::BrightAndDark => vector::run(Advance { pixel: Brightness, step, area, u, image }),
        }
    }

    /// Entropy and spottedness of the image with coordinates `u`, and the image itself.
    pub fn value(&self, u: &[f64], area: &[f64], image: &mut [f64]) -> Worth {
        match *self {
            Entropy::Spots { default_logit } => {
                vector::run(Value { pixel: Filling::new(default_logit), u, area, image })
            }
            Entropy::BrightAndDark => vector::run(Value { pixel: Brightness, u, area, image }),
        }
    }

    /// Gradient of -S with respect to the image: by either entropy the distance of the coordinate from that of the
    /// default, per area.
    pub fn gradient(&self, u: &[f64], area: &[f64]) -> Vec<f64> {
        let default = self.default_coordinate();
        combined(u, area, |u, area| area * (u - default))
    }

    /// Scale of the metric: a step z in it is the image step `scale * z`. Single precision is enough for the
    /// coordinates of steps.
    pub fn metric(&self, image: &[f64], area: &[f64]) -> Vec<f32> {
        let mut scale = vec![0.0; image.len()];
        match self {
            Entropy::Spots { .. } => combine_two(&mut scale, image, area, |_, s, area| spots::metric(s, area)),
            Entropy::BrightAndDark => {
                combine_two(&mut scale, image, area, |_, b, area| bright_and_dark::metric(b, area))
            }
        }
        scale
    }

    /// Gain of a pixel, per area, from a change of its coordinate from `u` to the best for a misfit that is linear in
    /// the image.
    pub fn gain(&self, u: f64, change: f64) -> f64 {
        match self {
            Entropy::Spots { .. } => spots::gain(u, change),
            Entropy::BrightAndDark => bright_and_dark::gain(u, change),
        }
    }

    /// Spottedness of an image.
    pub fn spottedness(&self, image: &[f64], area: &[f64]) -> f64 {
        match self {
            Entropy::Spots { .. } => spottedness::<Filling>(image, area),
            Entropy::BrightAndDark => spottedness::<Brightness>(image, area),
        }
    }

    /// Gradient of the spottedness with respect to the image.
    pub fn spottedness_gradient<'a>(&self, image: &[f64], area: &'a [f64]) -> Cow<'a, [f64]> {
        match self {
            Entropy::Spots { .. } => Cow::Borrowed(area),
            Entropy::BrightAndDark => Cow::Owned(bright_and_dark::spottedness_gradient(image, area)),
        }
    }
}

#[cfg(test)]
mod tests;
