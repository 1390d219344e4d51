//! Two-component entropy of an image of spot filling factors (method section 2, Collier Cameron 1992):
//! `S(s) = - sum_p a_p [ s ln(s/m) + (1-s) ln((1-s)/(1-m)) ]` with default filling m.
//!
//! The coordinate is `u = logit(s)`, which keeps s inside (0, 1). Left out: which entropy an image has (`entropy`), data.

use super::Step;
use crate::vector::elementary::{exp_minus, ln_1p, ln_1p_single};
use crate::vector::linear::short_dot;
use crate::vector::{Instructions, Task};

/// Pixels whose terms are summed at a time.
const CHUNK: usize = 512;

/// Largest |u|: beyond it s (1-s) would lose its precision.
pub(super) const LOGIT_LIMIT: f64 = 30.0;

/// The image s.
pub(super) fn image(u: &[f64]) -> Vec<f64> {
    u.iter().map(|u| 1.0 / (1.0 + (-u).exp())).collect()
}

/// Scale of the metric, `sqrt(s (1-s) / a)`.
#[inline(always)]
pub(super) fn metric(s: f64, area: f64) -> f32 {
    ((s * (1.0 - s)) as f32 / area as f32).sqrt()
}

/// Gain by a change of the logit: the divergence of the two images.
pub(super) fn gain(u: f64, change: f64) -> f64 {
    let softplus = |u: f64| u.max(0.0) + (-u.abs()).exp().ln_1p();
    softplus(u + change) - softplus(u) - change / (1.0 + (-u).exp())
}

/// Logits moved by an image step.
pub(super) struct LogitStep<'a>(pub Step<'a>);

impl Task for LogitStep<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<I: Instructions>(self, i: I) -> bool {
        let Step { u, image, step, scale, cap, out } = self.0;
        let mut capped = false;
        for (((out, u), s), ds) in out.iter_mut().zip(u).zip(image).zip(step) {
            let du = logit_step(i, *s, scale * ds);
            capped |= du.abs() > cap;
            *out = (u + f64::from(du.clamp(-cap, cap))).clamp(-LOGIT_LIMIT, LOGIT_LIMIT);
        }
        capped
    }
}

/// `-S` of the image with logits `u`, and the image s itself.
pub(super) struct NegativeValue<'a> {
    pub default_logit: f64,
    pub u: &'a [f64],
    pub area: &'a [f64],
    pub s: &'a mut [f64],
}

impl Task for NegativeValue<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<I: Instructions>(self, i: I) -> f64 {
        let NegativeValue { default_logit, u, area, s } = self;
        // s u - ln(1 + e^u) is s ln s + (1-s) ln(1-s); both parts from one exponential
        let at_default = softplus(i, default_logit, exp_minus(i, default_logit.abs()));
        let (mut total, mut terms) = (0.0, [0.0; CHUNK]);
        for ((s, u), area) in s.chunks_mut(CHUNK).zip(u.chunks(CHUNK)).zip(area.chunks(CHUNK)) {
            for ((s, &u), term) in s.iter_mut().zip(u).zip(&mut terms) {
                let small = exp_minus(i, u.abs());
                *s = if u > 0.0 { 1.0 } else { small } / (1.0 + small);
                *term = *s * (u - default_logit) - softplus(i, u, small) + at_default;
            }
            total += short_dot(i, area, &terms[..area.len()]);
        }
        total
    }
}

/// Change of the logit that moves s by `ds`: exact up to half way to 0 or 1, beyond that along the tangent.
///
/// Data are nearly linear in s, so that a step straight in s keeps what the stiff directions have gained; a step straight in
/// the logit, equal to first order, would undo it to second order. To single precision: where a step leads is computed anew.
#[inline(always)]
fn logit_step(i: impl Instructions, s: f64, ds: f32) -> f32 {
    let (s, above) = (s as f32, (1.0 - s) as f32);
    let room = if ds < 0.0 { s } else { above };
    let straight = ds.abs().min(0.5 * room) * ds.signum();
    let (there, left) = (s + straight, above - straight);
    ln_1p_single(i, straight / (s * left)) + (ds - straight) / (there * left)
}

/// `ln(1 + e^u)`, given `e^-|u|`.
#[inline(always)]
fn softplus(i: impl Instructions, u: f64, small: f64) -> f64 {
    u.max(0.0) + ln_1p(i, small)
}
