//! The innermost loops: sums over the visible pixels that lie in one cell of the velocity grid, and their transpose.
//!
//! A pixel is a weight at a position t in [0, 1] of the cell. What it leaves on the grid is a polynomial in t (see
//! `line_profile`), so that a cell needs the sums of `x weight t^k`, k = 0 to 5, which stay in registers however many pixels
//! there are. Each loop is written twice: as it reads, and in AVX2, which the compiler does not find by itself (four times
//! slower). Left out: which pixels lie in which cell.

use super::line_profile::DEPOSIT_NODES;
use crate::vector::Instructions;

/// Pixels that are summed side by side.
pub const LANES: usize = 4;

/// Visible pixels of one cell; a block that is not full ends in pixels of weight 0.
#[derive(Clone, Copy, Debug)]
pub struct Block {
    /// Projected area times limb darkening.
    pub weight: [f32; LANES],
    /// Distance of the mean velocity from the cell's lower border over the grid's step; in [0, 1], as single precision rounds up.
    pub position: [f32; LANES],
    /// Variance of the velocity over twice the squared step.
    pub spread: [f32; LANES],
    /// Index of the pixel.
    pub pixel: [u32; LANES],
}

/// The mean of `t^k` over a pixel's extent is `t^k + k (k - 1) t^(k-2) spread` to second order: k (k - 1) for k = 2 to 5.
const SPREAD_FACTORS: [f64; DEPOSIT_NODES - 2] = [2.0, 6.0, 12.0, 20.0];

impl Block {
    /// No pixel yet; the lanes may point to any pixel of the map, and this one stays in the cache.
    pub fn empty(pixel: u32) -> Self {
        Block { weight: [0.0; LANES], position: [0.0; LANES], spread: [0.0; LANES], pixel: [pixel; LANES] }
    }

    /// Means of `t^k` over the extent of the pixel in a lane, to second order in it: `t^k + k (k - 1) t^(k-2) spread`.
    fn powers(&self, lane: usize) -> [f64; DEPOSIT_NODES] {
        let (t, spread) = (f64::from(self.position[lane]), f64::from(self.spread[lane]));
        let t2 = t * t;
        let plus = |factor: f64| t2 + factor * spread;
        [1.0, t, plus(2.0), t * plus(6.0), t2 * plus(12.0), t * t2 * plus(20.0)]
    }
}

/// Sums over the pixels of `x weight t^k`.
///
/// # Safety
/// Every pixel of every block lies within `x`.
#[inline(always)]
#[allow(unsafe_code)]
pub unsafe fn sum<I: Instructions>(_: I, blocks: &[Block], x: &[f64]) -> [f64; DEPOSIT_NODES] {
    #[cfg(target_arch = "x86_64")]
    if I::AVX2 {
        // safe: `I` proves the instructions, the caller the pixels
        return unsafe { avx2::sum(blocks, x) };
    }
    plain_sum(blocks, x)
}

/// Transpose of [`sum`]: adds `weight (c_0 + c_1 t + ... + c_5 t^5)` to every pixel of `out`.
///
/// # Safety
/// Every pixel of every block lies within `out`.
#[inline(always)]
#[allow(unsafe_code)]
pub unsafe fn spread<I: Instructions>(_: I, blocks: &[Block], coefficients: &[f64; DEPOSIT_NODES], out: &mut [f64]) {
    #[cfg(target_arch = "x86_64")]
    if I::AVX2 {
        // safe: `I` proves the instructions, the caller the pixels
        return unsafe { avx2::spread(blocks, coefficients, out) };
    }
    plain_spread(blocks, coefficients, out);
}

fn plain_sum(blocks: &[Block], x: &[f64]) -> [f64; DEPOSIT_NODES] {
    let mut sums = [0.0; DEPOSIT_NODES];
    for block in blocks {
        for lane in 0..LANES {
            let amount = x[block.pixel[lane] as usize] * f64::from(block.weight[lane]);
            let terms = block.powers(lane).map(|power| amount * power);
            sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
        }
    }
    sums
}

fn plain_spread(blocks: &[Block], coefficients: &[f64; DEPOSIT_NODES], out: &mut [f64]) {
    for block in blocks {
        for lane in 0..LANES {
            let polynomial: f64 = block.powers(lane).iter().zip(coefficients).map(|(power, c)| power * c).sum();
            out[block.pixel[lane] as usize] += f64::from(block.weight[lane]) * polynomial;
        }
    }
}

/// The same loops, four pixels at a time.
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
mod avx2 {
    use super::{Block, DEPOSIT_NODES, LANES, SPREAD_FACTORS};
    use std::arch::x86_64::*;

    /// As [`super::plain_sum`].
    ///
    /// # Safety
    /// The processor has AVX2 and FMA; every pixel of every block lies within `x`.
    #[inline]
    #[target_feature(enable = "avx2,fma")]
    pub(super) unsafe fn sum(blocks: &[Block], x: &[f64]) -> [f64; DEPOSIT_NODES] {
        let mut sums = [_mm256_setzero_pd(); DEPOSIT_NODES];
        let mut spread_sums = [_mm256_setzero_pd(); SPREAD_FACTORS.len()];
        for block in blocks {
            let at = |lane: usize| unsafe { *x.get_unchecked(block.pixel[lane] as usize) };
            let x = _mm256_set_pd(at(3), at(2), at(1), at(0));
            let (t, spread) = (load(&block.position), load(&block.spread));
            let mut term = _mm256_mul_pd(x, load(&block.weight));
            for (k, sum) in sums.iter_mut().enumerate() {
                *sum = _mm256_add_pd(*sum, term);
                if let Some(sum) = spread_sums.get_mut(k) {
                    *sum = _mm256_fmadd_pd(term, spread, *sum);
                }
                term = _mm256_mul_pd(term, t);
            }
        }
        for ((sum, spread_sum), factor) in sums[2..].iter_mut().zip(spread_sums).zip(SPREAD_FACTORS) {
            *sum = _mm256_fmadd_pd(_mm256_set1_pd(factor), spread_sum, *sum);
        }
        let mut totals = [0.0; DEPOSIT_NODES];
        for (totals, pair) in totals.chunks_exact_mut(2).zip(sums.chunks_exact(2)) {
            let neighbours = _mm256_hadd_pd(pair[0], pair[1]);
            let both = _mm_add_pd(_mm256_castpd256_pd128(neighbours), _mm256_extractf128_pd::<1>(neighbours));
            totals[0] = _mm_cvtsd_f64(both);
            totals[1] = _mm_cvtsd_f64(_mm_unpackhi_pd(both, both));
        }
        totals
    }

    /// As [`super::plain_spread`].
    ///
    /// # Safety
    /// The processor has AVX2 and FMA; every pixel of every block lies within `out`.
    #[inline]
    #[target_feature(enable = "avx2,fma")]
    pub(super) unsafe fn spread(blocks: &[Block], coefficients: &[f64; DEPOSIT_NODES], out: &mut [f64]) {
        let of_spread: [__m256d; SPREAD_FACTORS.len()] =
            std::array::from_fn(|k| _mm256_set1_pd(SPREAD_FACTORS[k] * coefficients[k + 2]));
        let coefficients = coefficients.map(|c| _mm256_set1_pd(c));
        for block in blocks {
            let (t, spread) = (load(&block.position), load(&block.spread));
            let at_t = |coefficients: &[__m256d]| {
                let (last, rest) = coefficients.split_last().expect("coefficients");
                rest.iter().rev().fold(*last, |sum, c| _mm256_fmadd_pd(sum, t, *c))
            };
            let polynomial = _mm256_fmadd_pd(at_t(&of_spread), spread, at_t(&coefficients));
            let values = _mm256_mul_pd(polynomial, load(&block.weight));
            let (low, high) = (_mm256_castpd256_pd128(values), _mm256_extractf128_pd::<1>(values));
            let mut add = |lane: usize, value: f64| unsafe {
                *out.get_unchecked_mut(block.pixel[lane] as usize) += value;
            };
            add(0, _mm_cvtsd_f64(low));
            add(1, _mm_cvtsd_f64(_mm_unpackhi_pd(low, low)));
            add(2, _mm_cvtsd_f64(high));
            add(3, _mm_cvtsd_f64(_mm_unpackhi_pd(high, high)));
        }
    }

    #[inline]
    #[target_feature(enable = "avx2,fma")]
    fn load(x: &[f32; LANES]) -> __m256d {
        // safe: the four numbers are there
        _mm256_cvtps_pd(unsafe { _mm_loadu_ps(x.as_ptr()) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::{self, Task};

    fn number(i: usize) -> f32 {
        (0.5 + 0.5 * (12.9898 * i as f64).sin()) as f32
    }

    struct Both<'a>(&'a [Block], &'a [f64], &'a [f64; DEPOSIT_NODES], &'a mut [f64]);

    impl Task for Both<'_> {
        type Output = [f64; DEPOSIT_NODES];

        #[inline(always)]
        #[allow(unsafe_code)]
        fn run<I: Instructions>(self, instructions: I) -> Self::Output {
            // safe: the pixels of the test are below 19
            unsafe {
                spread(instructions, self.0, self.2, self.3);
                sum(instructions, self.0, self.1)
            }
        }
    }

    #[test]
    fn the_instructions_of_this_processor_agree_with_the_plain_loops() {
        let block = |b: usize| Block {
            weight: std::array::from_fn(|l| number(4 * b + l)),
            position: std::array::from_fn(|l| number(100 + 4 * b + l)),
            spread: std::array::from_fn(|l| number(200 + 4 * b + l)),
            pixel: std::array::from_fn(|l| ((7 * b + l) % 19) as u32),
        };
        let blocks: Vec<Block> = (0..9).map(block).collect();
        let x: Vec<f64> = (0..19).map(|i| (i as f64).cos()).collect();
        let coefficients = [0.3, -1.0, 2.0, 0.7, -0.2, 0.9];
        let (mut plain, mut fast) = (vec![1.0; 19], vec![1.0; 19]);
        plain_spread(&blocks, &coefficients, &mut plain);
        let sums = vector::run(Both(&blocks, &x, &coefficients, &mut fast));
        for (a, b) in sums.iter().zip(plain_sum(&blocks, &x)).chain(fast.iter().zip(plain)) {
            assert!((a - b).abs() < 1e-13, "{a} {b}");
        }
    }
}
