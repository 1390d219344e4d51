//! Entropies of images, by what an image holds (method section 2): filling factors of dark spots (`spots`), or brightnesses above
//! and below that of the photosphere (`bright_and_dark`).
//!
//! The solver works in a coordinate u of each pixel that keeps the image inside its domain, and measures steps in the entropy's own
//! metric, in which -S has the unit matrix as its second derivative. Left out: data.

mod bright_and_dark;
mod spots;

use super::cg::dot;
use crate::vector;
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

/// A step of the image, to be taken in the coordinates.
struct Step<'a> {
    u: &'a [f64],
    image: &'a [f64],
    step: &'a [f64],
    scale: f64,
    cap: f64,
    out: &'a mut [f64],
}

impl Entropy {
    /// Entropy of spots relative to the default filling factor m, in (0, 1).
    pub fn new(default_spot: f64) -> Self {
        Entropy::Spots { default_logit: (default_spot / (1.0 - default_spot)).ln() }
    }

    /// About how large the Lagrange multipliers of images of some data are, in units of those of spots: on the paper's star, with
    /// and without faculae, at chi2 = 0.97 per datum.
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

    /// Image of the coordinates u.
    pub fn image(&self, u: &[f64], image: &mut [f64]) {
        match self {
            Entropy::Spots { .. } => spots::image(u, image),
            Entropy::BrightAndDark => bright_and_dark::image(u, image),
        }
    }

    /// Coordinates moved by `scale` times the image step `step`, none by more than `cap`; whether any reached the cap.
    pub fn step(&self, u: &[f64], image: &[f64], step: &[f64], scale: f64, cap: f64, out: &mut [f64]) -> bool {
        let step = Step { u, image, step, scale, cap, out };
        match self {
            Entropy::Spots { .. } => vector::run(spots::LogitStep(step)),
            Entropy::BrightAndDark => vector::run(bright_and_dark::LogarithmStep(step)),
        }
    }

    /// Entropy of the image with coordinates `u` (at most 0, and 0 at the default), and the image itself.
    pub fn value(&self, u: &[f64], area: &[f64], image: &mut [f64]) -> f64 {
        -match *self {
            Entropy::Spots { default_logit } => vector::run(spots::NegativeValue { default_logit, u, area, s: image }),
            Entropy::BrightAndDark => vector::run(bright_and_dark::NegativeValue { u, area, b: image }),
        }
    }

    /// Gradient of -S with respect to the image.
    pub fn gradient(&self, u: &[f64], area: &[f64], out: &mut [f64]) {
        match *self {
            Entropy::Spots { default_logit } => spots::gradient(default_logit, u, area, out),
            Entropy::BrightAndDark => bright_and_dark::gradient(u, area, out),
        }
    }

    /// Scale of the metric: a step z in it is the image step `scale * z`.
    pub fn metric(&self, image: &[f64], area: &[f64], out: &mut [f64]) {
        match self {
            Entropy::Spots { .. } => spots::metric(image, area, out),
            Entropy::BrightAndDark => bright_and_dark::metric(image, area, out),
        }
    }

    /// Spottedness: how far the image is from one without spots.
    pub fn spottedness(&self, image: &[f64], area: &[f64]) -> f64 {
        match self {
            Entropy::Spots { .. } => dot(image, area),
            Entropy::BrightAndDark => bright_and_dark::spottedness(image, area),
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
