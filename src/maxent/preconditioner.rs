//! A truncated eigenbasis of the misfit's curvature at a reference image (`docs/method.md` section 2): almost the
//! inverse of the Newton system of every nearby problem.
//!
//! In the entropy's metric the system is `1 + lambda M`, and M has a few hundred eigenvalues above 0.01 whatever the
//! number of pixels; the basis is found in a block Krylov space from a fixed random start (Musco & Musco 2015), and is
//! restricted to pixels with significant entries: the spotted part of the star.

mod rows;

use crate::numerics::vector::Number;
use crate::numerics::vector::linear::dot;
use nalgebra::{DMatrix, SymmetricEigen};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rows::Rows;
use std::ops::Range;

/// `(1 + lambda M)^-1` of one map or of several in sequence, which M does not mix.
#[derive(Clone, Debug, Default)]
pub struct Preconditioner {
    maps: Vec<Basis>,
}

/// `(1 + lambda M)^-1` on the span of M's largest eigenvectors, the identity elsewhere.
#[derive(Clone, Debug)]
struct Basis {
    /// Pixels of the map.
    pixels: usize,
    /// Largest eigenvalues of M.
    eigenvalues: Vec<f64>,
    /// The eigenvectors on pixels with most of their norm, ...
    spotted: Rows<i16>,
    /// ... and on pixels that carry less than [`FAINT_ENERGY`] together: fetching rows takes most of the time.
    faint: Rows<i8>,
    /// Largest fraction of a component that is subtracted: less than 1, because rounded eigenvectors are not quite
    /// orthonormal.
    most_subtracted: f64,
}

/// Largest fraction that is subtracted in total: the remainder must exceed rounding errors, or the inverse is no longer
/// positive.
const MOST_SUBTRACTED: f64 = 1.0 - 1e-4;

/// Pixels are dropped, faintest first, as long as they carry less than this fraction of the basis.
const DROPPED_ENERGY: f64 = 2e-3;

/// The same for the faint pixels, whose entries are rounded to 1/127 of the largest.
const FAINT_ENERGY: f64 = 0.1;

/// Vectors beyond the wanted rank that the Krylov space has.
const OVERSAMPLING: usize = 60;

/// Vectors to which the operator is applied before it is applied to the results.
const BLOCK: usize = 20;

/// Projections that orthogonalise the next vectors to those so far: at most this many, ...
const MOST_PROJECTIONS: usize = 5;

/// ... and no more once each of unit length keeps this much.
const NOT_SPANNED: f64 = 0.7;

impl Preconditioner {
    /// No preconditioning: the identity.
    pub fn identity() -> Self {
        Preconditioner::default()
    }

    /// From the operator M (`apply(v, out)`) on vectors of `maps` times `pixels` entries: for each map at most `rank`
    /// eigenvectors, those with eigenvalues above `smallest`. M is applied as often as for one map.
    pub fn build(
        maps: usize,
        pixels: usize,
        rank: usize,
        smallest: f64,
        apply: impl FnMut(&[f64], &mut [f64]),
    ) -> Self {
        let of_map = |krylov: Krylov| krylov.largest(rank, smallest);
        Preconditioner { maps: krylov(maps, pixels, rank + OVERSAMPLING, apply).into_iter().map(of_map).collect() }
    }

    /// Approximate size in memory (bytes).
    pub fn bytes(&self) -> usize {
        self.maps.iter().map(|basis| basis.spotted.bytes() + basis.faint.bytes()).sum()
    }

    /// Approximates `out = (1 + lambda M)^-1 r`.
    pub fn apply<N: Number>(&self, lambda: f64, r: &[N], out: &mut [N]) {
        out.copy_from_slice(r);
        for (basis, map) in self.places() {
            basis.apply(lambda, &r[map.clone()], &mut out[map]);
        }
    }

    /// Approximates `r (1 + lambda M)^-1 r`, in two parts: of the part of r spanned by the eigenvectors, and of the
    /// rest.
    pub fn norms(&self, lambda: f64, r: &[f32]) -> (f64, f64) {
        if self.maps.is_empty() {
            return (0.0, dot(r, r));
        }
        let of_map = |(basis, map): (&Basis, Range<usize>)| basis.norms(lambda, &r[map]);
        self.places().map(of_map).fold((0.0, 0.0), |sum, of| (sum.0 + of.0, sum.1 + of.1))
    }

    /// That of each map, with the range of the map.
    fn places(&self) -> impl Iterator<Item = (&Basis, Range<usize>)> {
        self.maps.iter().scan(0, |first, basis| {
            let map = *first..*first + basis.pixels;
            *first = map.end;
            Some((basis, map))
        })
    }
}

impl Basis {
    fn on_active_pixels(eigenvalues: Vec<f64>, vectors: &DMatrix<f64>) -> Self {
        let energy: Vec<f64> = vectors.row_iter().map(|row| row.norm_squared()).collect();
        let mut by_energy: Vec<u32> = (0..energy.len() as u32).collect();
        by_energy.sort_by(|&p, &q| energy[p as usize].total_cmp(&energy[q as usize]));
        let total: f64 = energy.iter().sum();
        let [dropped, faint] = [DROPPED_ENERGY, FAINT_ENERGY].map(|share| {
            let mut below = 0.0;
            let carry_less = by_energy.iter().take_while(|&&p| {
                below += energy[p as usize];
                below < share * total
            });
            carry_less.count()
        });
        let spotted = Rows::new(vectors, by_energy.split_off(faint));
        let faint = Rows::new(vectors, by_energy.split_off(dropped));
        let longest = largest_eigenvalue(spotted.products() + faint.products());
        let (pixels, most_subtracted) = (energy.len(), MOST_SUBTRACTED / longest.max(1.0));
        Basis { pixels, eigenvalues, spotted, faint, most_subtracted }
    }

    /// As [`Preconditioner::apply`], where `out` already contains r.
    fn apply<N: Number>(&self, lambda: f64, r: &[N], out: &mut [N]) {
        let mut components = self.components(r);
        for (c, e) in components.iter_mut().zip(&self.eigenvalues) {
            *c *= (lambda * e / (1.0 + lambda * e)).min(self.most_subtracted) as f32;
        }
        self.subtract(&components, out);
    }

    /// As [`Preconditioner::norms`].
    fn norms(&self, lambda: f64, r: &[f32]) -> (f64, f64) {
        let components = self.components(r);
        let spanned = components.iter().zip(&self.eigenvalues).map(|(c, e)| f64::from(*c).powi(2) / (1.0 + lambda * e));
        let mut rest = r.to_vec();
        self.subtract(&components, &mut rest);
        (spanned.sum(), dot(&rest, &rest))
    }

    /// Scalar products of `r` with the eigenvectors.
    fn components<N: Number>(&self, r: &[N]) -> Vec<f32> {
        let (mut components, of_faint) = (self.spotted.components(r), self.faint.components(r));
        components.iter_mut().zip(of_faint).for_each(|(c, of_faint)| *c += of_faint);
        components
    }

    /// Subtracts a combination of the eigenvectors, beginning with the last rows of the components, which are still in
    /// the cache.
    fn subtract<N: Number>(&self, components: &[f32], out: &mut [N]) {
        self.faint.subtract(components, out);
        self.spotted.subtract(components, out);
    }
}

/// The largest eigenvalue of a symmetric matrix; 0 of one that is empty or not finite.
fn largest_eigenvalue(matrix: DMatrix<f64>) -> f64 {
    let is_one = !matrix.is_empty() && matrix.iter().all(|x| x.is_finite());
    if is_one { matrix.symmetric_eigenvalues().max() } else { 0.0 }
}

/// An orthonormal basis of the block Krylov space of an operator, and its image under the operator.
struct Krylov {
    basis: DMatrix<f64>,
    image: DMatrix<f64>,
}

impl Krylov {
    /// The largest eigenvectors of the operator on its span.
    fn largest(self, rank: usize, smallest: f64) -> Basis {
        let Krylov { basis, image } = self;
        let projected = basis.transpose() * image;
        let eigen = SymmetricEigen::new(0.5 * (&projected + projected.transpose()));
        let mut order: Vec<usize> = (0..basis.ncols()).filter(|&i| eigen.eigenvalues[i] > smallest).collect();
        order.sort_by(|&i, &j| eigen.eigenvalues[j].total_cmp(&eigen.eigenvalues[i]));
        order.truncate(rank);
        let vectors = basis * eigen.eigenvectors.select_columns(&order);
        let eigenvalues: Vec<f64> = order.iter().map(|&i| eigen.eigenvalues[i]).collect();
        Basis::on_active_pixels(eigenvalues, &vectors)
    }
}

/// The space of each map from a fixed random start, with about this many columns. The operator does not mix the maps,
/// so that it is applied to a vector of each at once.
fn krylov(maps: usize, pixels: usize, columns: usize, mut apply: impl FnMut(&[f64], &mut [f64])) -> Vec<Krylov> {
    let width = BLOCK.min(pixels);
    let columns = width * columns.div_ceil(width).min(pixels / width);
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(0x5eed);
    let empty = || Krylov { basis: DMatrix::zeros(pixels, columns), image: DMatrix::zeros(pixels, columns) };
    let mut spaces: Vec<Krylov> = (0..maps).map(|_| empty()).collect();
    let mut start = || DMatrix::from_fn(pixels, width, |_, _| -> f64 { StandardNormal.sample(&mut rng) });
    let mut blocks: Vec<DMatrix<f64>> = (0..maps).map(|_| start()).collect();
    let (mut all, mut applied) = (vec![0.0; maps * pixels], vec![0.0; maps * pixels]);
    for first in (0..columns).step_by(width) {
        for (block, space) in blocks.iter_mut().zip(&mut spaces) {
            let known = space.basis.columns(0, first);
            // until no component along the known ones remains: vectors nearly spanned by them are mostly rounding
            // errors at first
            for _ in 0..MOST_PROJECTIONS {
                *block = std::mem::take(block).qr().q();
                *block -= known * (known.transpose() * &*block);
                if block.column_iter().all(|column| column.norm() > NOT_SPANNED) {
                    break;
                }
            }
            *block = std::mem::take(block).qr().q();
        }
        for j in 0..width {
            for (block, all) in blocks.iter().zip(all.chunks_exact_mut(pixels)) {
                all.copy_from_slice(block.column(j).as_slice());
            }
            apply(&all, &mut applied);
            for (space, applied) in spaces.iter_mut().zip(applied.chunks_exact(pixels)) {
                space.image.column_mut(first + j).copy_from_slice(applied);
            }
        }
        for (block, space) in blocks.iter_mut().zip(&mut spaces) {
            space.basis.columns_mut(first, width).copy_from(block);
            block.copy_from(&space.image.columns(first, width));
        }
    }
    spaces
}

#[cfg(test)]
mod tests;
