//! The innermost loops: sums over the visible pixels that lie in a cell of the velocity grid, for several cells in
//! parallel, and their transpose.
//!
//! A pixel is a weight at a position t in [-1/2, 1/2] of its cell, or a little beyond. Its contribution to the grid is
//! a polynomial in t (see `line_profile`), so that a cell needs the sums of `x weight t^k`, k = 0 to 5, which stay in
//! registers however many pixels there are.

use super::block::{Group, LANES};
use super::line_profile::{DEPOSIT_NODES, DEPOSIT_WEIGHTS};
use crate::numerics::vector::{self, Number, Registers, Scattered};

/// Blocks (96 bytes each, and 32 of pixels) from the current one to the prefetched one; all of an observation are
/// contiguous.
const AHEAD: usize = 32;

/// The mean of `t^k` over a pixel's extent is `t^k + k (k - 1) t^(k-2) spread` to second order: k (k - 1) for k = 2 to
/// 5.
const SPREAD_FACTORS: [f64; DEPOSIT_NODES - 2] = [2.0, 6.0, 12.0, 20.0];

/// The contributions of the pixels of each cell, times `x`, to its nodes: row n of `left`, as long as the grid, gets
/// the n-th node of the cell. Where all lanes are one cell, it gets the sum of them.
///
/// # Safety
/// Every pixel of every block lies within `x`, and the nodes of every cell within the grid.
#[inline(always)]
#[allow(unsafe_code)]
pub unsafe fn gather<R: Scattered>(
    r: R,
    Group { cells, blocks, pixels }: Group,
    x: &[R::Number],
    left: &mut [R::Number],
) {
    let (grid, pixels) = (left.len() / DEPOSIT_NODES, &pixels[..blocks.len()]);
    // lanes without a pixel may repeat a cell: they come last, and of two stores to one place the first wins
    let (one_cell, mut totals) = (cells[0] == cells[1], [0.0; DEPOSIT_NODES]);
    for first in (0..LANES).step_by(R::LANES).rev() {
        let mut sums = [r.splat(R::Number::default()); DEPOSIT_NODES];
        let mut spread_sums = [r.splat(R::Number::default()); SPREAD_FACTORS.len()];
        for (n, block) in blocks.iter().enumerate() {
            let pixels = &pixels[n];
            if first == 0 {
                vector::fetch_ahead(block, AHEAD);
                vector::fetch_ahead(pixels, AHEAD);
            }
            // safe: the caller guarantees the pixels
            let x = unsafe { r.pick(x, pixels, first) };
            let (t, spread) = (r.load(&block.position, first), r.load(&block.spread, first));
            let squared = r.multiply(t, t);
            // times 1, t, t^2 and t^3: avoids a long chain of dependent products
            let term = r.multiply(x, r.load(&block.weight, first));
            let times_t = r.multiply(term, t);
            let terms = [term, times_t, r.multiply(term, squared), r.multiply(times_t, squared)];
            for k in 0..terms.len() {
                sums[k] = r.add(sums[k], terms[k]);
                spread_sums[k] = r.multiply_add(terms[k], spread, spread_sums[k]);
            }
            for k in terms.len()..DEPOSIT_NODES {
                sums[k] = r.multiply_add(terms[k - 2], squared, sums[k]);
            }
        }
        for k in 0..SPREAD_FACTORS.len() {
            sums[k + 2] = r.multiply_add(r.splat(R::Number::of(SPREAD_FACTORS[k])), spread_sums[k], sums[k + 2]);
        }
        // nodes that mirror each other have the same weights except for the sign of odd powers
        let mut nodes = sums;
        for (n, weights) in DEPOSIT_WEIGHTS.iter().enumerate() {
            let (even, odd) = (every_second(r, weights, &sums, 0), every_second(r, weights, &sums, 1));
            nodes[n] = r.add(even, odd);
            nodes[DEPOSIT_NODES - 1 - n] = r.subtract(even, odd);
        }
        for n in 0..DEPOSIT_NODES {
            if one_cell {
                totals[n] += r.total(nodes[n]);
            } else {
                // safe: the caller guarantees the cells
                unsafe { r.put(nodes[n], &mut left[n * (grid + 1)..], cells, first) };
            }
        }
    }
    if one_cell {
        for (n, total) in totals.into_iter().enumerate() {
            left[n * (grid + 1) + cells[0] as usize] = R::Number::of(total);
        }
    }
}

/// Transpose of [`gather`]: adds to every pixel of `out` the contribution from the nodes of its cell. No pixel may
/// occur twice in a block except in lanes of weight 0, which come last.
///
/// # Safety
/// Every pixel of every block lies within `out`, and the nodes of every cell within `nodes`.
#[inline(always)]
#[allow(unsafe_code)]
pub unsafe fn scatter<R: Scattered>(
    r: R,
    Group { cells, blocks, pixels }: Group,
    nodes: &[R::Number],
    out: &mut [R::Number],
) {
    let pixels = &pixels[..blocks.len()];
    for first in (0..LANES).step_by(R::LANES) {
        let mut of_cells = [r.splat(R::Number::default()); DEPOSIT_NODES];
        for n in 0..DEPOSIT_NODES {
            // safe: the caller guarantees the cells
            of_cells[n] = unsafe { r.pick(&nodes[n..], cells, first) };
        }
        let mut coefficients = [r.splat(R::Number::default()); DEPOSIT_NODES];
        for (n, weights) in DEPOSIT_WEIGHTS.iter().enumerate() {
            let (node, mirrored) = (of_cells[n], of_cells[DEPOSIT_NODES - 1 - n]);
            let both = [r.add(node, mirrored), r.subtract(node, mirrored)];
            for k in 0..DEPOSIT_NODES {
                coefficients[k] = r.multiply_add(r.splat(R::Number::of(weights[k])), both[k % 2], coefficients[k]);
            }
        }
        let of_spread: [R::Lanes; SPREAD_FACTORS.len()] =
            std::array::from_fn(|k| r.multiply(r.splat(R::Number::of(SPREAD_FACTORS[k])), coefficients[k + 2]));
        for (n, block) in blocks.iter().enumerate() {
            let pixels = &pixels[n];
            if first == 0 {
                vector::fetch_ahead(block, AHEAD);
                vector::fetch_ahead(pixels, AHEAD);
            }
            let (t, spread) = (r.load(&block.position, first), r.load(&block.spread, first));
            let squared = r.multiply(t, t);
            let [of_spread, rest] = [polynomial(r, &of_spread, t, squared), polynomial(r, &coefficients, t, squared)];
            let polynomial = r.multiply_add(of_spread, spread, rest);
            // safe: the caller guarantees the pixels
            unsafe {
                let sums = r.multiply_add(polynomial, r.load(&block.weight, first), r.pick(out, pixels, first));
                r.put(sums, out, pixels, first);
            }
        }
    }
}

/// The sum of `w_k s_k` over even k, or from 1 on over odd ones.
#[inline(always)]
fn every_second<R: Registers>(r: R, w: &[f64; DEPOSIT_NODES], s: &[R::Lanes; DEPOSIT_NODES], first: usize) -> R::Lanes {
    let highest = r.multiply(r.splat(R::Number::of(w[first + 4])), s[first + 4]);
    let lower = r.multiply_add(r.splat(R::Number::of(w[first + 2])), s[first + 2], highest);
    r.multiply_add(r.splat(R::Number::of(w[first])), s[first], lower)
}

/// `c_0 + c_1 t + ...`, an even number of coefficients: pairs of them in parallel, then in sequence.
#[inline(always)]
fn polynomial<R: Registers>(r: R, coefficients: &[R::Lanes], t: R::Lanes, squared: R::Lanes) -> R::Lanes {
    let (pairs, _) = coefficients.as_chunks();
    let mut sum = r.multiply_add(pairs[pairs.len() - 1][1], t, pairs[pairs.len() - 1][0]);
    for [even, odd] in pairs[..pairs.len() - 1].iter().rev() {
        sum = r.multiply_add(sum, squared, r.multiply_add(*odd, t, *even));
    }
    sum
}

#[cfg(test)]
mod tests;
