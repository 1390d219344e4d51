//! Values and steps of an image, pixel by pixel, as its entropy has them.
//!
//! Left out: what an entropy is (`spots`, `bright_and_dark`).

use super::MetricStep;
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

    /// The image in single precision, and what it lacks of the end of its domain.
    fn in_single(x: f64) -> [f32; 2];

    /// Change of the coordinate that moves the image by `dx`, if that is no great part of the way to the end of its domain.
    ///
    /// Data are nearly linear in the image, so that a step straight in it keeps what the stiff directions have gained; a step straight
    /// in the coordinate, equal to first order, would undo it to second order. To single precision: where a step leads is computed anew.
    fn step(self, i: impl Instructions, image: [f32; 2], dx: f32) -> f32;
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
        let chunks = image.chunks_mut(CHUNK).zip(u.chunks(CHUNK)).zip(area.chunks(CHUNK));
        chunks.map(|((image, u), area)| negative_value(i, pixel, u, area, image)).sum()
    }
}

/// Coordinates moved by the image step `step`, none by more than `cap`.
pub(super) struct Step<'a, P> {
    pub pixel: P,
    pub u: &'a [f64],
    pub image: &'a [f64],
    pub step: &'a [f32],
    pub cap: f32,
    pub out: &'a mut [f64],
}

impl<P: Pixel> Task for Step<'_, P> {
    type Output = ();

    #[inline(always)]
    fn run<I: Instructions>(self, i: I) {
        let Step { pixel, u, image, step, cap, out } = self;
        let chunks = out.chunks_mut(CHUNK).zip(u.chunks(CHUNK)).zip(image.chunks(CHUNK).zip(step.chunks(CHUNK)));
        chunks.for_each(|((out, u), (image, step))| take(i, pixel, (u, image), step, cap, out));
    }
}

/// A step in the metric, and `-S` and the image where it leads to: a chunk of pixels after another, because most of the time goes into
/// fetching them.
pub(super) struct Advance<'a, P> {
    pub pixel: P,
    pub step: MetricStep<'a>,
    pub area: &'a [f64],
    pub u: &'a mut [f64],
    pub image: &'a mut [f64],
}

impl<P: Pixel> Task for Advance<'_, P> {
    type Output = f64;

    #[inline(always)]
    fn run<I: Instructions>(self, i: I) -> f64 {
        let Advance { pixel, step, area, u, image } = self;
        let (mut total, mut changes) = (0.0, [0.0; CHUNK]);
        for first in (0..u.len()).step_by(CHUNK) {
            let chunk = first..u.len().min(first + CHUNK);
            let changes = &mut changes[..chunk.len()];
            for ((change, z), scale) in changes.iter_mut().zip(&step.z[chunk.clone()]).zip(&step.scale[chunk.clone()]) {
                *change = step.length * (z * scale);
            }
            let (from, u) = ((&step.u[chunk.clone()], &step.image[chunk.clone()]), &mut u[chunk.clone()]);
            take(i, pixel, from, changes, step.cap, u);
            total += negative_value(i, pixel, u, &area[chunk.clone()], &mut image[chunk]);
        }
        total
    }
}

/// Of at most [`CHUNK`] pixels.
#[inline(always)]
fn negative_value(i: impl Instructions, pixel: impl Pixel, u: &[f64], area: &[f64], image: &mut [f64]) -> f64 {
    let mut terms = [0.0; CHUNK];
    for ((x, &u), term) in image.iter_mut().zip(u).zip(&mut terms) {
        (*x, *term) = pixel.value(i, u);
    }
    short_dot(i, area, &terms[..area.len()])
}

/// Of at most [`CHUNK`] pixels.
#[inline(always)]
fn take<P: Pixel>(
    i: impl Instructions,
    pixel: P,
    (u, image): (&[f64], &[f64]),
    step: &[f32],
    cap: f32,
    out: &mut [f64],
) {
    // loops of one precision each: registers hold twice as many numbers in single precision
    let (mut near, mut far, mut changes) = ([0.0; CHUNK], [0.0; CHUNK], [0.0; CHUNK]);
    for ((near, far), x) in near.iter_mut().zip(&mut far).zip(image) {
        [*near, *far] = P::in_single(*x);
    }
    for ((change, dx), (near, far)) in changes.iter_mut().zip(step).zip(near.iter().zip(&far)) {
        *change = pixel.step(i, [*near, *far], *dx).clamp(-cap, cap);
    }
    for ((out, u), change) in out.iter_mut().zip(u).zip(&changes) {
        *out = (u + f64::from(*change)).clamp(-P::LIMIT, P::LIMIT);
    }
}
