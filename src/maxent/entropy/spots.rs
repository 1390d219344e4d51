//! Two-component entropy of an image of spot filling factors (`docs/method.md` section 2, Collier Cameron 1992):
//! `S(s) = - sum_p a_p [ s ln(s/m) + (1-s) ln((1-s)/(1-m)) ]` with default filling m.
//!
//! The coordinate is `u = logit(s)`, which keeps s inside (0, 1).

use super::pixels::Pixel;
use crate::numerics::vector::Instructions;
use crate::numerics::vector::elementary::{exp_minus, ln_1p_and_inverse, ln_1p_single};

/// A pixel with its default.
#[derive(Clone, Copy)]
pub(super) struct Filling {
    default_logit: f64,
    /// `-ln(1 - m)`.
    at_default: f64,
}

impl Filling {
    /// By the logit of the default.
    pub fn new(default_logit: f64) -> Self {
        Filling { default_logit, at_default: softplus(default_logit) }
    }
}

impl Pixel for Filling {
    /// Beyond it s (1-s) would lose its precision.
    const LIMIT: f64 = 30.0;

    #[inline(always)]
    fn value(self, i: impl Instructions, u: f64) -> (f64, f64) {
        // s u - ln(1 + e^u) is s ln s + (1-s) ln(1-s); both parts from one exponential
        let small = exp_minus(i, u.abs());
        let (logarithm, inverse) = ln_1p_and_inverse(i, small);
        let s = if u > 0.0 { 1.0 } else { small } * inverse;
        (s, s * (u - self.default_logit) - (u.max(0.0) + logarithm) + self.at_default)
    }

    #[inline(always)]
    fn spot(s: f64) -> f64 {
        s
    }

    /// The covered fraction of the surface.
    fn spottedness(covered: f64) -> f64 {
        covered
    }

    #[inline(always)]
    fn in_single(s: f64) -> [f32; 2] {
        [s as f32, (1.0 - s) as f32]
    }

    /// Exact up to half way to 0 or 1, beyond that along the tangent.
    #[inline(always)]
    fn step(self, i: impl Instructions, [s, above]: [f32; 2], ds: f32) -> f32 {
        let room = if ds < 0.0 { s } else { above };
        let straight = ds.abs().min(0.5 * room) * ds.signum();
        let (there, left) = (s + straight, above - straight);
        // one division for two, of a product that vanishes where the default is nearer to 0 than pixels may be
        let (here, there) = (s * left, there * left);
        let per_both = 1.0 / (here * there).max(f32::MIN_POSITIVE);
        // close to s = 1 rounding makes it -1, or less
        let relative = (straight * (there * per_both)).max(LOWEST_RELATIVE);
        ln_1p_single(i, relative) + (ds - straight) * (here * per_both)
    }
}

/// Its logarithm is a change beyond that of any step.
const LOWEST_RELATIVE: f32 = -0.99;

/// The image s.
pub(super) fn image(u: &[f64]) -> Vec<f64> {
    u.iter().map(|u| 1.0 / (1.0 + (-u).exp())).collect()
}

/// Scale of the metric, `sqrt(s (1-s) / a)`.
#[inline(always)]
pub(super) fn metric(s: f64, area: f64) -> f32 {
    ((s * (1.0 - s)) as f32 / area as f32).sqrt()
}

/// Gain from a change of the logit: the divergence of the two images.
pub(super) fn gain(u: f64, change: f64) -> f64 {
    softplus(u + change) - softplus(u) - change / (1.0 + (-u).exp())
}

/// `ln(1 + e^u)`.
fn softplus(u: f64) -> f64 {
    u.max(0.0) + (-u.abs()).exp().ln_1p()
}
