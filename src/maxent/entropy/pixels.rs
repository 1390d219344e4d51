//! Values and steps of an image, pixel by pixel, for its entropy.

use super::{MetricStep, Worth};
use crate::numerics::vector::linear::short_dot;
use crate::numerics::vector::{Instructions, Task};

/// Pixels per partial sum.
const CHUNK: usize = 512;

/// The entropy of one pixel.
pub(super) trait Pixel: Copy {
    /// Largest |u|.
    const LIMIT: f64;

    /// The image at coordinate `u`, and its -S per area; to be marked `#[inline(always)]`, as is the step.
    fn value(self, i: impl Instructions, u: f64) -> (f64, f64);

    /// Contribution of a pixel, per area, to the sum of which spottedness is a function.
    fn spot(x: f64) -> f64;

    /// Spottedness by that sum.
    fn spottedness(sum: f64) -> f64;

    /// The image in single precision, and its distance from the end of its domain.
    fn in_single(x: f64) -> [f32; 2];

    /// Change of the coordinate that moves the image by `dx`, if that is a small fraction of the distance to the end of
    /// its domain.
    ///
    /// Data are nearly linear in the image, so that a step straight in it preserves the gain in the stiff directions; a
    /// step straight in the coordinate, equal to first order, would lose it at second order. In single precision, since
    /// the new image is recomputed.
    fn step(self, i: impl Instructions, image: [f32; 2], dx: f32) -> f32;
}

/// Entropy and spottedness of the image with coordinates `u`, and the image itself.
pub(super) struct Value<'a, P> {
    pub pixel: P,
    pub u: &'a [f64],
    pub area: &'a [f64],
    pub image: &'a mut [f64],
}

impl<P: Pixel> Task for Value<'_, P> {
    type Output = Worth;

    #[inline(always)]
    fn run<I: Instructions>(self, i: I) -> Worth {
        let Value { pixel, u, area, image } = self;
        let mut sums = [0.0; 2];
        for ((image, u), area) in image.chunks_mut(CHUNK).zip(u.chunks(CHUNK)).zip(area.chunks(CHUNK)) {
            add_values(i, pixel, u, area, image, &mut sums);
        }
        worth::<P>(sums)
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

/// A step in the metric, and image, entropy and spottedness after it: in chunks of pixels, because most of the time is
/// spent in fetching them.
pub(super) struct Advance<'a, P> {
    pub pixel: P,
    pub step: MetricStep<'a>,
    pub area: &'a [f64],
    pub u: &'a mut [f64],
    pub image: &'a mut [f64],
}

impl<P: Pixel> Task for Advance<'_, P> {
    type Output = Worth;

    #[inline(always)]
    fn run<I: Instructions>(self, i: I) -> Worth {
        let Advance { pixel, step, area, u, image } = self;
        let (mut sums, mut changes) = ([0.0; 2], [0.0; CHUNK]);
        for first in (0..u.len()).step_by(CHUNK) {
            let chunk = first..u.len().min(first + CHUNK);
            let changes = &mut changes[..chunk.len()];
            for ((change, z), scale) in changes.iter_mut().zip(&step.z[chunk.clone()]).zip(&step.scale[chunk.clone()]) {
                *change = step.length * (z * scale);
            }
            let (from, u) = ((&step.u[chunk.clone()], &step.image[chunk.clone()]), &mut u[chunk.clone()]);
            take(i, pixel, from, changes, step.cap, u);
            add_values(i, pixel, u, &area[chunk.clone()], &mut image[chunk], &mut sums);
        }
        worth::<P>(sums)
    }
}

/// Spottedness of an image.
pub(super) fn spottedness<P: Pixel>(image: &[f64], area: &[f64]) -> f64 {
    P::spottedness(image.iter().zip(area).map(|(x, area)| area * P::spot(*x)).sum())
}

/// Adds to the two sums of -S and of spottedness, for at most [`CHUNK`] pixels.
#[inline(always)]
fn add_values<P: Pixel>(
    i: impl Instructions,
    pixel: P,
    u: &[f64],
    area: &[f64],
    image: &mut [f64],
    [negative, spotted]: &mut [f64; 2],
) {
    let (mut terms, mut spots) = ([0.0; CHUNK], [0.0; CHUNK]);
    for ((x, &u), (term, spot)) in image.iter_mut().zip(u).zip(terms.iter_mut().zip(&mut spots)) {
        (*x, *term) = pixel.value(i, u);
        *spot = P::spot(*x);
    }
    *negative += short_dot(i, area, &terms[..area.len()]);
    *spotted += short_dot(i, area, &spots[..area.len()]);
}

fn worth<P: Pixel>([negative, spotted]: [f64; 2]) -> Worth {
    Worth { entropy: -negative, spottedness: P::spottedness(spotted) }
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
