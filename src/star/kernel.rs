//! The innermost loops: sums over the visible pixels that lie in a cell of the velocity grid, for several cells side by side,
//! and their transpose.
//!
//! A pixel is a weight at a position t in [-1/2, 1/2] of its cell. What it leaves on the grid is a polynomial in t (see
//! `line_profile`), so that a cell needs the sums of `x weight t^k`, k = 0 to 5, which stay in registers however many pixels
//! there are. Each loop is written twice: as it reads, and in AVX2, which the compiler does not find by itself. Left
//! out: which pixels lie in which cell, and which cells stand side by side.

use super::line_profile::{DEPOSIT_NODES, DEPOSIT_WEIGHTS};
use crate::vector::Instructions;

/// Cells side by side.
pub const LANES: usize = 4;

/// Numbers on the nodes of a cell.
pub type Nodes = [f64; DEPOSIT_NODES];

/// A visible pixel of each cell; a cell that has no pixel left has one of weight 0.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub struct Block {
    /// Projected area times limb darkening.
    pub weight: [f32; LANES],
    /// Distance of the mean velocity from the middle of the cell over the grid's step.
    pub position: [f32; LANES],
    /// Variance of the velocity over twice the squared step.
    pub spread: [f32; LANES],
    /// Index of the pixel.
    pub pixel: [u32; LANES],
}

/// A lane of a block.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(16))]
pub struct Pixel {
    /// As in a block.
    pub weight: f32,
    /// As in a block.
    pub position: f32,
    /// As in a block.
    pub spread: f32,
    /// As in a block.
    pub pixel: u32,
}

/// The mean of `t^k` over a pixel's extent is `t^k + k (k - 1) t^(k-2) spread` to second order: k (k - 1) for k = 2 to 5.
const SPREAD_FACTORS: [f64; DEPOSIT_NODES - 2] = [2.0, 6.0, 12.0, 20.0];

impl Pixel {
    /// Lanes without a pixel, of a map of so many. They point to different pixels where there are as many, for no sum to wait
    /// for another.
    pub fn empty(pixels: usize) -> [Pixel; LANES] {
        std::array::from_fn(|lane| Pixel { pixel: lane.min(pixels.saturating_sub(1)) as u32, ..Pixel::default() })
    }
}

impl Block {
    /// Of a pixel for each lane.
    #[inline(always)]
    pub fn of(pixels: [&Pixel; LANES]) -> Self {
        #[cfg(target_arch = "x86_64")]
        return sse::block_of(pixels);
        #[cfg(not(target_arch = "x86_64"))]
        Block {
            weight: pixels.map(|p| p.weight),
            position: pixels.map(|p| p.position),
            spread: pixels.map(|p| p.spread),
            pixel: pixels.map(|p| p.pixel),
        }
    }

    /// Copies the pixel of every lane to a place of its own.
    #[inline(always)]
    pub fn deal(&self, places: [usize; LANES], to: &mut [Pixel]) {
        #[cfg(target_arch = "x86_64")]
        sse::deal(self, places, to);
        #[cfg(not(target_arch = "x86_64"))]
        for (lane, place) in places.into_iter().enumerate() {
            let (weight, position) = (self.weight[lane], self.position[lane]);
            to[place] = Pixel { weight, position, spread: self.spread[lane], pixel: self.pixel[lane] };
        }
    }

    /// Means of `t^k` over the extent of the pixel in a lane.
    fn powers(&self, lane: usize) -> [f64; DEPOSIT_NODES] {
        let (t, spread) = (f64::from(self.position[lane]), f64::from(self.spread[lane]));
        let t2 = t * t;
        let plus = |factor: f64| t2 + factor * spread;
        [1.0, t, plus(2.0), t * plus(6.0), t2 * plus(12.0), t * t2 * plus(20.0)]
    }
}

/// What the pixels of each cell, times `x`, leave on its nodes.
///
/// # Safety
/// Every pixel of every block lies within `x`.
#[inline(always)]
#[allow(unsafe_code)]
pub unsafe fn gather<I: Instructions>(_: I, blocks: &[Block], x: &[f64]) -> [Nodes; LANES] {
    #[cfg(target_arch = "x86_64")]
    if I::AVX2 {
        // safe: `I` proves the instructions, the caller the pixels
        return unsafe { avx2::gather(blocks, x) };
    }
    plain_gather(blocks, x)
}

/// Transpose of [`gather`]: adds to every pixel of `out` what it gets from the nodes of its cell.
///
/// # Safety
/// Every pixel of every block lies within `out`.
#[inline(always)]
#[allow(unsafe_code)]
pub unsafe fn scatter<I: Instructions>(_: I, blocks: &[Block], nodes: [&Nodes; LANES], out: &mut [f64]) {
    #[cfg(target_arch = "x86_64")]
    if I::AVX2 {
        // safe: `I` proves the instructions, the caller the pixels
        return unsafe { avx2::scatter(blocks, nodes, out) };
    }
    plain_scatter(blocks, nodes, out);
}

fn plain_gather(blocks: &[Block], x: &[f64]) -> [Nodes; LANES] {
    let mut sums = [[0.0; DEPOSIT_NODES]; LANES];
    for block in blocks {
        for (lane, sums) in sums.iter_mut().enumerate() {
            let amount = x[block.pixel[lane] as usize] * f64::from(block.weight[lane]);
            sums.iter_mut().zip(block.powers(lane)).for_each(|(sum, power)| *sum += amount * power);
        }
    }
    sums.map(|sums| {
        let mut nodes = [0.0; DEPOSIT_NODES];
        for (n, weights) in DEPOSIT_WEIGHTS.iter().enumerate() {
            for (k, (weight, sum)) in weights.iter().zip(sums).enumerate() {
                nodes[n] += weight * sum;
                nodes[DEPOSIT_NODES - 1 - n] += mirrored(k, weight * sum);
            }
        }
        nodes
    })
}

fn plain_scatter(blocks: &[Block], nodes: [&Nodes; LANES], out: &mut [f64]) {
    let coefficients = nodes.map(|nodes| {
        let mut coefficients = [0.0; DEPOSIT_NODES];
        for (n, weights) in DEPOSIT_WEIGHTS.iter().enumerate() {
            for (k, (coefficient, weight)) in coefficients.iter_mut().zip(weights).enumerate() {
                *coefficient += weight * (nodes[n] + mirrored(k, nodes[DEPOSIT_NODES - 1 - n]));
            }
        }
        coefficients
    });
    for block in blocks {
        for (lane, coefficients) in coefficients.iter().enumerate() {
            let polynomial: f64 = coefficients.iter().zip(block.powers(lane)).map(|(c, power)| c * power).sum();
            out[block.pixel[lane] as usize] += f64::from(block.weight[lane]) * polynomial;
        }
    }
}

/// A term of `t^k` as the mirror image of a node has it.
fn mirrored(k: usize, term: f64) -> f64 {
    match k % 2 {
        0 => term,
        _ => -term,
    }
}

/// Blocks of pixels and pixels of blocks in registers; the compiler takes one number after another through memory.
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
mod sse {
    use super::{Block, LANES, Pixel};
    use std::arch::x86_64::*;
    use std::mem::transmute;

    #[inline(always)]
    pub(super) fn block_of(pixels: [&Pixel; LANES]) -> Block {
        // safe: pixels and rows of a block are four numbers of four bytes
        unsafe { transmute(transposed(pixels.map(|pixel| transmute::<Pixel, __m128>(*pixel)))) }
    }

    #[inline(always)]
    pub(super) fn deal(block: &Block, places: [usize; LANES], to: &mut [Pixel]) {
        // safe: as above
        let lanes = unsafe { transposed(transmute::<Block, [__m128; LANES]>(*block)) };
        for (place, lane) in places.into_iter().zip(lanes) {
            // safe: as above
            unsafe { _mm_store_ps((&raw mut to[place]).cast(), lane) };
        }
    }

    /// Rows as columns.
    #[inline(always)]
    fn transposed([a, b, c, d]: [__m128; LANES]) -> [__m128; LANES] {
        // safe: every processor of this kind has these instructions
        unsafe {
            let (low, low_2) = (_mm_unpacklo_ps(a, b), _mm_unpacklo_ps(c, d));
            let (high, high_2) = (_mm_unpackhi_ps(a, b), _mm_unpackhi_ps(c, d));
            [
                _mm_movelh_ps(low, low_2),
                _mm_movehl_ps(low_2, low),
                _mm_movelh_ps(high, high_2),
                _mm_movehl_ps(high_2, high),
            ]
        }
    }
}

/// The same loops, all cells at a time.
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
mod avx2 {
    use super::{Block, DEPOSIT_NODES, DEPOSIT_WEIGHTS, LANES, Nodes, SPREAD_FACTORS};
    use std::arch::x86_64::*;

    /// One number of every node or power: a lane a cell.
    type Lanes = [__m256d; DEPOSIT_NODES];

    /// As [`super::plain_gather`].
    ///
    /// # Safety
    /// The processor has AVX2 and FMA; every pixel of every block lies within `x`.
    #[inline]
    #[target_feature(enable = "avx2,fma")]
    pub(super) unsafe fn gather(blocks: &[Block], x: &[f64]) -> [Nodes; LANES] {
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
        // nodes that mirror each other have the same weights but for the sign of odd powers
        let mut nodes = sums;
        for (n, weights) in DEPOSIT_WEIGHTS.iter().enumerate() {
            let half = |first: usize| {
                let w = |k: usize| _mm256_set1_pd(weights[k]);
                let highest = _mm256_mul_pd(w(first + 4), sums[first + 4]);
                _mm256_fmadd_pd(w(first), sums[first], _mm256_fmadd_pd(w(first + 2), sums[first + 2], highest))
            };
            let (even, odd) = (half(0), half(1));
            nodes[n] = _mm256_add_pd(even, odd);
            nodes[DEPOSIT_NODES - 1 - n] = _mm256_sub_pd(even, odd);
        }
        cells_of_lanes(nodes)
    }

    /// As [`super::plain_scatter`].
    ///
    /// # Safety
    /// The processor has AVX2 and FMA; every pixel of every block lies within `out`.
    #[inline]
    #[target_feature(enable = "avx2,fma")]
    pub(super) unsafe fn scatter(blocks: &[Block], nodes: [&Nodes; LANES], out: &mut [f64]) {
        let nodes = lanes_of_cells(nodes);
        let mut coefficients = [_mm256_setzero_pd(); DEPOSIT_NODES];
        for (n, weights) in DEPOSIT_WEIGHTS.iter().enumerate() {
            let (node, mirrored) = (nodes[n], nodes[DEPOSIT_NODES - 1 - n]);
            let both = [_mm256_add_pd(node, mirrored), _mm256_sub_pd(node, mirrored)];
            for (k, coefficient) in coefficients.iter_mut().enumerate() {
                *coefficient = _mm256_fmadd_pd(_mm256_set1_pd(weights[k]), both[k % 2], *coefficient);
            }
        }
        let of_spread: [__m256d; SPREAD_FACTORS.len()] =
            std::array::from_fn(|k| _mm256_mul_pd(_mm256_set1_pd(SPREAD_FACTORS[k]), coefficients[k + 2]));
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

    /// The nodes of each cell together.
    #[inline]
    #[target_feature(enable = "avx2,fma")]
    fn cells_of_lanes([a, b, c, d, e, f]: Lanes) -> [Nodes; LANES] {
        let first = transposed([a, b, c, d]);
        let (even, odd) = (_mm256_unpacklo_pd(e, f), _mm256_unpackhi_pd(e, f));
        let last = [
            _mm256_castpd256_pd128(even),
            _mm256_castpd256_pd128(odd),
            _mm256_extractf128_pd::<1>(even),
            _mm256_extractf128_pd::<1>(odd),
        ];
        let mut cells = [[0.0; DEPOSIT_NODES]; LANES];
        for (cell, (first, last)) in cells.iter_mut().zip(first.into_iter().zip(last)) {
            // safe: four and two numbers are six
            unsafe {
                _mm256_storeu_pd(cell.as_mut_ptr(), first);
                _mm_storeu_pd(cell.as_mut_ptr().add(LANES), last);
            }
        }
        cells
    }

    /// The cells of each node together.
    #[inline]
    #[target_feature(enable = "avx2,fma")]
    fn lanes_of_cells(cells: [&Nodes; LANES]) -> Lanes {
        // safe: six numbers are four and two
        let first = cells.map(|cell| unsafe { _mm256_loadu_pd(cell.as_ptr()) });
        let last = cells.map(|cell| unsafe { _mm_loadu_pd(cell.as_ptr().add(LANES)) });
        let [a, b, c, d] = transposed(first);
        let (low, high) = (_mm256_set_m128d(last[2], last[0]), _mm256_set_m128d(last[3], last[1]));
        [a, b, c, d, _mm256_unpacklo_pd(low, high), _mm256_unpackhi_pd(low, high)]
    }

    /// Rows as columns.
    #[inline]
    #[target_feature(enable = "avx2,fma")]
    fn transposed([a, b, c, d]: [__m256d; LANES]) -> [__m256d; LANES] {
        let (even, even_2) = (_mm256_unpacklo_pd(a, b), _mm256_unpacklo_pd(c, d));
        let (odd, odd_2) = (_mm256_unpackhi_pd(a, b), _mm256_unpackhi_pd(c, d));
        [
            _mm256_permute2f128_pd::<0x20>(even, even_2),
            _mm256_permute2f128_pd::<0x20>(odd, odd_2),
            _mm256_permute2f128_pd::<0x31>(even, even_2),
            _mm256_permute2f128_pd::<0x31>(odd, odd_2),
        ]
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

    struct Both<'a>(&'a [Block], &'a [f64], [&'a Nodes; LANES], &'a mut [f64]);

    impl Task for Both<'_> {
        type Output = [Nodes; LANES];

        #[inline(always)]
        #[allow(unsafe_code)]
        fn run<I: Instructions>(self, instructions: I) -> Self::Output {
            // safe: the pixels of the test are below 19
            unsafe {
                scatter(instructions, self.0, self.2, self.3);
                gather(instructions, self.0, self.1)
            }
        }
    }

    fn blocks() -> Vec<Block> {
        let block = |b: usize| Block {
            weight: std::array::from_fn(|l| number(4 * b + l)),
            position: std::array::from_fn(|l| number(100 + 4 * b + l) - 0.5),
            spread: std::array::from_fn(|l| number(200 + 4 * b + l)),
            pixel: std::array::from_fn(|l| ((7 * b + l) % 19) as u32),
        };
        (0..9).map(block).collect()
    }

    #[test]
    fn the_instructions_of_this_processor_agree_with_the_plain_loops() {
        let blocks = blocks();
        let x: Vec<f64> = (0..19).map(|i| (i as f64).cos()).collect();
        let nodes: [Nodes; LANES] =
            std::array::from_fn(|lane| std::array::from_fn(|n| ((7 * lane + n) as f64 + 0.3).sin()));
        let (mut plain, mut fast) = (vec![1.0; 19], vec![1.0; 19]);
        plain_scatter(&blocks, nodes.each_ref(), &mut plain);
        let left = vector::run(Both(&blocks, &x, nodes.each_ref(), &mut fast));
        let plain_left = plain_gather(&blocks, &x);
        let pairs = left.as_flattened().iter().zip(plain_left.as_flattened()).chain(fast.iter().zip(&plain));
        for (a, b) in pairs {
            assert!((a - b).abs() < 1e-13, "{a} {b}");
        }
    }

    #[test]
    fn blocks_are_dealt_and_collected() {
        for block in blocks() {
            let mut pixels = [Pixel::default(); 9];
            block.deal([4, 1, 8, 2], &mut pixels);
            for (lane, place) in [4, 1, 8, 2].into_iter().enumerate() {
                let (weight, position) = (block.weight[lane], block.position[lane]);
                let expected = Pixel { weight, position, spread: block.spread[lane], pixel: block.pixel[lane] };
                assert_eq!(pixels[place], expected);
            }
            let again = Block::of([4, 1, 8, 2].map(|place: usize| &pixels[place]));
            assert_eq!(format!("{again:?}"), format!("{block:?}"));
        }
    }
}
