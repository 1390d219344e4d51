//! Two-component entropy of an image of spot filling factors (method section 2, Collier Cameron 1992):
//! `S(s) = - sum_p a_p [ s ln(s/m) + (1-s) ln((1-s)/(1-m)) ]` with default filling m.
//!
//! The solver works in `u = logit(s)`, which keeps s inside (0, 1), and measures steps in the entropy's own metric,
//! `z = ds / sqrt(s (1-s) / a)`. Left out: other images (bright and dark), data.

use super::cg::dot;
use super::elementary::{exp_minus, ln_1p};
use crate::vector::{self, Instructions, Task};

/// The two-component entropy with its default filling factor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entropy {
    /// logit of the default filling factor.
    default_logit: f64,
}

/// Largest |u|: beyond it s (1-s) would lose its precision.
const LOGIT_LIMIT: f64 = 30.0;

impl Entropy {
    /// Entropy relative to the default spot filling factor m, in (0, 1).
    pub fn new(default_spot: f64) -> Self {
        Entropy { default_logit: (default_spot / (1.0 - default_spot)).ln() }
    }

    /// The logit of the default: the image without data.
    pub fn default_logit(&self) -> f64 {
        self.default_logit
    }

    /// Image s of the logits u.
    pub fn image(&self, u: &[f64], s: &mut [f64]) {
        for (s, u) in s.iter_mut().zip(u) {
            *s = 1.0 / (1.0 + (-u).exp());
        }
    }

    /// Logits moved by the image step `ds`, no logit by more than `cap`; whether any reached the cap.
    pub fn step(&self, u: &[f64], s: &[f64], ds: &[f64], scale: f64, cap: f64, out: &mut [f64]) -> bool {
        vector::run(Step { u, s, ds, scale, cap, out })
    }

    /// Entropy of the image with logits `u` (at most 0, and 0 at the default), and the image s itself.
    pub fn value(&self, u: &[f64], area: &[f64], s: &mut [f64]) -> f64 {
        -vector::run(NegativeValue { default_logit: self.default_logit, u, area, s })
    }

    /// Gradient of -S with respect to s.
    pub fn gradient(&self, u: &[f64], area: &[f64], out: &mut [f64]) {
        for ((out, u), a) in out.iter_mut().zip(u).zip(area) {
            *out = a * (u - self.default_logit);
        }
    }

    /// Scale of the metric, `sqrt(s (1-s) / a)`: a step z in it is the image step `scale * z`.
    pub fn metric(&self, s: &[f64], area: &[f64], out: &mut [f64]) {
        for ((out, s), a) in out.iter_mut().zip(s).zip(area) {
            *out = (s * (1.0 - s) / a).sqrt();
        }
    }
}

/// The work of [`Entropy::step`].
struct Step<'a> {
    u: &'a [f64],
    s: &'a [f64],
    ds: &'a [f64],
    scale: f64,
    cap: f64,
    out: &'a mut [f64],
}

impl Task for Step<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<I: Instructions>(self, i: I) -> bool {
        let Step { u, s, ds, scale, cap, out } = self;
        let mut capped = false;
        for (((out, u), s), ds) in out.iter_mut().zip(u).zip(s).zip(ds) {
            let du = logit_step(i, *s, scale * ds);
            capped |= du.abs() > cap;
            *out = (u + du.clamp(-cap, cap)).clamp(-LOGIT_LIMIT, LOGIT_LIMIT);
        }
        capped
    }
}

/// The work of [`Entropy::value`].
struct NegativeValue<'a> {
    default_logit: f64,
    u: &'a [f64],
    area: &'a [f64],
    s: &'a mut [f64],
}

impl Task for NegativeValue<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<I: Instructions>(self, i: I) -> f64 {
        let NegativeValue { default_logit, u, area, s } = self;
        // s u - ln(1 + e^u) is s ln s + (1-s) ln(1-s); both parts from one exponential
        let at_default = softplus(i, default_logit, exp_minus(i, default_logit.abs()));
        let mut terms = vec![0.0; u.len()];
        for ((s, &u), term) in s.iter_mut().zip(u).zip(&mut terms) {
            let small = exp_minus(i, u.abs());
            *s = if u > 0.0 { 1.0 } else { small } / (1.0 + small);
            *term = *s * (u - default_logit) - softplus(i, u, small) + at_default;
        }
        dot(area, &terms)
    }
}

/// Change of the logit that moves s by `ds`: exact up to half way to 0 or 1, beyond that along the tangent.
///
/// Data are nearly linear in s, so that a step straight in s keeps what the stiff directions have gained; a step straight in
/// the logit, equal to first order, would undo it to second order.
#[inline(always)]
fn logit_step(i: impl Instructions, s: f64, ds: f64) -> f64 {
    let room = if ds < 0.0 { s } else { 1.0 - s };
    let straight = ds.abs().min(0.5 * room) * ds.signum();
    let (there, rest) = (s + straight, ds - straight);
    let left = 1.0 - there;
    ln_1p(i, straight / (s * left)) + rest / (there * left)
}

/// `ln(1 + e^u)`, given `e^-|u|`.
#[inline(always)]
fn softplus(i: impl Instructions, u: f64, small: f64) -> f64 {
    u.max(0.0) + ln_1p(i, small)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn value_is_the_formula_and_gradient_its_derivative() {
        let (m, entropy) = (1e-3, Entropy::new(1e-3));
        let (u, area) = ([-9.0, -2.0, 0.5, 3.0], [0.1, 0.2, 0.3, 0.4]);
        let formula = |u: &[f64]| {
            let term = |(u, a): (&f64, &f64)| {
                let s = 1.0 / (1.0 + (-u).exp());
                a * (s * (s / m).ln() + (1.0 - s) * ((1.0 - s) / (1.0 - m)).ln())
            };
            -u.iter().zip(&area).map(term).sum::<f64>()
        };
        let (mut image, mut same) = ([0.0; 4], [0.0; 4]);
        assert!((entropy.value(&u, &area, &mut image) - formula(&u)).abs() < 1e-13);
        entropy.image(&u, &mut same);
        assert!(image.iter().zip(same).all(|(a, b)| (a / b - 1.0).abs() < 1e-14));
        assert!(entropy.value(&[entropy.default_logit(); 4], &area, &mut image).abs() < 1e-15);
        let mut gradient = [0.0; 4];
        entropy.gradient(&u, &area, &mut gradient);
        for p in 0..4 {
            let s = 1.0 / (1.0 + (-u[p]).exp());
            let h = 1e-5;
            let shifted = |h: f64| {
                let mut v = u;
                v[p] += h;
                formula(&v)
            };
            let derivative = -(shifted(h) - shifted(-h)) / (2.0 * h) / (s * (1.0 - s));
            assert!((gradient[p] - derivative).abs() < 1e-6 * (1.0 + derivative.abs()), "{p}");
        }
    }
}
