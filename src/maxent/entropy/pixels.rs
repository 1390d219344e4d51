//! Values and steps of an image, pixel by pixel, as its entropy has them.
//!
//! Left out: what an entropy is (`spots`, `bright_and_dark`).

use crate::vector::linear::short_dot;
use crate::vector::{Instructions, Task};

/// Pixels whose terms are summed at a time.
const CHUNK: usize = 512;

/// An entropy, as one pixel has it.
pub(super) trait Pixel: Copy {
    /// Largest |u|.
    const LIMIT: f64;

    /// The image at coordinate `u`, and its -S per area; to be marked `#[inline(always)]`, as is the step.
    fn value(self, i: impl Instructions, u: f64) -> (f64, f64);

    /// Change of the coordinate that moves the image `x` by `dx`, if that is no great part of the way to the end of its domain.
    ///
    /// Data are nearly linear in the image, so that a step straight in it keeps what the stiff directions have gained; a step straight
    /// in the coordinate, equal to first order, would undo it to second order. To single precision: where a step leads is computed anew.
    fn step(self, i: impl Instructions, x: f64, dx: f32) -> f32;
}

/// `-S` of the image with coordinates `u`, and the image itself.
pub(super) struct NegativeValue<'a, P> {
    pub pixel: P,
    pub u: &'a [f64],
    pub area: &'a [f64],
    pub image: &'a mut [f64],
}

impl<P: Pixel> Task for NegativeValue<'_, P> {
    type Output = f64;

    #[inline(always)]
    fn run<I: Instructions>(self, i: I) -> f64 {
        let NegativeValue { pixel, u, area, image } = self;
        let (mut total, mut terms) = (0.0, [0.0; CHUNK]);
        for ((image, u), area) in image.chunks_mut(CHUNK).zip(u.chunks(CHUNK)).zip(area.chunks(CHUNK)) {
            for ((x, &u), term) in image.iter_mut().zip(u).zip(&mut terms) {
                (*x, *term) = pixel.value(i, u);
            }
            total += short_dot(i, area, &terms[..area.len()]);
        }
        total
    }
}

/// Coordinates moved by `scale` times the image step `step`, none by more than `cap`; whether any reached the cap.
pub(super) struct Step<'a, P> {
    pub pixel: P,
    pub u: &'a [f64],
    pub image: &'a [f64],
    pub step: &'a [f32],
    pub scale: f32,
    pub cap: f32,
    pub out: &'a mut [f64],
}

impl<P: Pixel> Task for Step<'_, P> {
    type Output = bool;

    #[inline(always)]
    fn run<I: Instructions>(self, i: I) -> bool {
        let Step { pixel, u, image, step, scale, cap, out } = self;
        let mut capped = false;
        for (((out, u), x), dx) in out.iter_mut().zip(u).zip(image).zip(step) {
            let du = pixel.step(i, *x, scale * dx);
            capped |= du.abs() > cap;
            *out = (u + f64::from(du.clamp(-cap, cap))).clamp(-P::LIMIT, P::LIMIT);
        }
        capped
    }
}
