//! A truncated eigenbasis of the misfit's curvature at a reference image (`docs/method.md` section 2): almost the
//! inverse of the Newton system of every nearby problem.
//!
//! In the entropy's metric the system is `1 + lambda M`, and M has a few hundred eigenvalues above 0.01 whatever the
//! number of pixels; the basis is found in a block Krylov space from a fixed random start (Musco & Musco 2015), and
//! lives on the pixels that carry it: the spotted part of the star.

mod rows;

use crate::numerics::vector::Number;
use crate::numerics::vector::linear::dot;
use nalgebra::{DMatrix, SymmetricEigen};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rows::Rows;
use std::ops::Range;

/// `(1 + lambda M)^-1` of one map or of several, one after the other, that M does not mix.
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
    /// The eigenvectors where most of them is, ...
    spotted: Rows<i16>,
    /// ... and on pixels that carry less than [`FAINT_ENERGY`] together: the time goes into fetching rows.
    faint: Rows<i8>,
    /// Of a component at most so much is subtracted: less than everything, because rounded eigenvectors are not quite
    /// orthonormal.
    most_subtracted: f64,
}

/// Of anything at most so much is subtracted: what is left must not drown in rounding, or the inverse is no longer
/// positive.
const MOST_SUBTRACTED: f64 = 1.0 - 1e-4;

/// Pixels are dropped, faintest first, as long as they carry less than this share of the basis.
const DROPPED_ENERGY: f64 = 2e-3;

/// So are others put among the faint ones, whose entries are rounded to 1/127 of the largest.
const FAINT_ENERGY: f64 = 0.1;

/// Vectors beyond the wanted rank that the Krylov space has.
const OVERSAMPLING: usize = 60;

/// Vectors that the operator is applied to before it is applied to what came out.
const BLOCK: usize = 20;

/// Projections that take the vectors so far out of the next ones: at most so many, ...
const MOST_PROJECTIONS: usize = 5;

/// ... and no more once each of unit length keeps this much.
const NOT_SPANNED: f64 = 0.7;

impl Preconditioner {
    /// No preconditioning: the identity.
    pub fn identity() -> Self {
        Preconditioner::default()
    }

    /// From the operator M (`apply(v, out)`) on vectors that hold so many `maps` of so many `pixels`: for each map at
    /// most `rank` eigenvectors, those with eigenvalues above `smallest`. M is applied as often as for one map.
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

    /// Bytes that it takes in memory, all but a few.
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

    /// Approximates `r (1 + lambda M)^-1 r`, in two parts: of what the eigenvectors span of r, and of the rest.
    pub fn norms(&self, lambda: f64, r: &[f32]) -> (f64, f64) {
        if self.maps.is_empty() {
            return (0.0, dot(r, r));
        }
        let of_map = |(basis, map): (&Basis, Range<usize>)| basis.norms(lambda, &r[map]);
        self.places().map(of_map).fold((0.0, 0.0), |sum, of| (sum.0 + of.0, sum.1 + of.1))
    }

    /// Each map's, and where the map stands.
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

    /// As [`Preconditioner::apply`], where `out` holds r already.
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

    /// Subtracts a combination of the eigenvectors; in the order that has the last rows of the components, which are
    /// still in the cache, first.
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

/// An orthonormal basis of the block Krylov space of an operator, and what the operator makes of it.
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

/// The space of each map from a fixed random start, with about so many columns. The operator does not mix the maps, so
/// that it is applied to a vector of each at once.
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
            // until nothing of the known ones is left: what is nearly spanned by them is mostly rounding errors at
            // first
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
mod tests {
    use super::*;

    #[test]
    fn inverts_a_low_rank_system() {
        let n = 60;
        // M = sum of two projectors on unit vectors e3 and (e10 + e20)/sqrt 2
        let apply = |v: &[f64], out: &mut [f64]| {
            out.fill(0.0);
            out[3] = 50.0 * v[3];
            let c = 0.5 * (v[10] + v[20]);
            out[10] = 8.0 * c;
            out[20] = 8.0 * c;
        };
        let preconditioner = Preconditioner::build(1, n, 10, 1e-6, apply);
        assert_eq!(preconditioner.maps[0].eigenvalues.len(), 2);
        assert_eq!(active_pixels(&preconditioner.maps[0]), 3);
        let x: Vec<f64> = (0..n).map(|i| (i as f64).sin()).collect();
        let (mut mx, mut back) = (vec![0.0; n], vec![0.0; n]);
        apply(&x, &mut mx);
        let b: Vec<f64> = x.iter().zip(&mx).map(|(x, m)| x + 0.7 * m).collect();
        preconditioner.apply(0.7, &b, &mut back);
        for (x, back) in x.iter().zip(&back) {
            assert!((x - back).abs() < 1e-5);
        }
    }

    #[test]
    fn maps_that_are_not_mixed_are_inverted_each_by_itself() {
        let n = 60;
        // of the second map everything is three times as strong
        let of_map = |v: &[f64], out: &mut [f64], times: f64| {
            out.iter_mut().zip(v).enumerate().for_each(|(p, (out, v))| *out = times * (-0.1 * p as f64).exp() * v);
        };
        let both = |v: &[f64], out: &mut [f64]| {
            for (times, (v, out)) in [1.0, 3.0].into_iter().zip(v.chunks(n).zip(out.chunks_mut(n))) {
                of_map(v, out, times);
            }
        };
        let together = Preconditioner::build(2, n, 40, 1e-3, both);
        let r: Vec<f64> = (0..2 * n).map(|p| (0.4 * p as f64).cos()).collect();
        let (mut out, mut single) = (vec![0.0; 2 * n], vec![0.0; n]);
        together.apply(50.0, &r, &mut out);
        let mut norms = (0.0, 0.0);
        for (k, times) in [1.0, 3.0].into_iter().enumerate() {
            let alone = Preconditioner::build(1, n, 40, 1e-3, |v: &[f64], out: &mut [f64]| of_map(v, out, times));
            alone.apply(50.0, &r[k * n..(k + 1) * n], &mut single);
            assert!(out[k * n..(k + 1) * n].iter().zip(&single).all(|(a, b)| (a - b).abs() < 1e-3));
            let rounded: Vec<f32> = r[k * n..(k + 1) * n].iter().map(|x| *x as f32).collect();
            let (spanned, rest) = alone.norms(50.0, &rounded);
            norms = (norms.0 + spanned, norms.1 + rest);
        }
        let (spanned, rest) = together.norms(50.0, &r.iter().map(|x| *x as f32).collect::<Vec<_>>());
        assert!((spanned + rest - norms.0 - norms.1).abs() < 1e-2 * (norms.0 + norms.1));
    }

    #[test]
    fn the_basis_is_orthonormal_whatever_the_operator() {
        // eigenvalues over so many decades, down to those that rounding errors drown
        for decades in [1.0, 5.0, 20.0, 60.0] {
            let apply = |v: &[f64], out: &mut [f64]| {
                for (i, (out, v)) in out.iter_mut().zip(v).enumerate() {
                    *out = 1e3 * 10f64.powf(-decades * i as f64 / 150.0) * v;
                }
            };
            let Krylov { basis, image } = krylov(1, 150, 130, apply).remove(0);
            assert_eq!((basis.ncols(), image.ncols()), (140, 140));
            let error = (basis.transpose() * &basis - DMatrix::identity(140, 140)).amax();
            assert!(error < 1e-13, "{decades} decades: {error:e}");
        }
    }

    #[test]
    fn it_stays_positive_however_strong_the_data() {
        let (n, rank) = (1000, 120);
        // spots: where vectors are large, and rounded coarsely, on few pixels
        let noise = DMatrix::from_fn(n, rank, |i, k| {
            let falls = 0.03 * ((i + 8 * k) % n) as f64;
            (-falls).exp() * (0.7 + 12.9898 * (i * i + 31 * k) as f64).sin()
        });
        let vectors = noise.qr().q();
        for strongest in [1e3, 1e5, 1e7, 1e12] {
            let eigenvalues: Vec<f64> = (0..rank).map(|k| strongest * 10f64.powf(-0.02 * k as f64)).collect();
            let basis = Basis::on_active_pixels(eigenvalues, &vectors);
            let preconditioner = Preconditioner { maps: vec![basis] };
            let mut applied = DMatrix::zeros(n, n);
            for k in 0..n {
                let unit: Vec<f32> = (0..n).map(|p| f32::from(p == k)).collect();
                let mut column = vec![0.0f32; n];
                preconditioner.apply(1.0, &unit, &mut column);
                applied.column_mut(k).iter_mut().zip(column).for_each(|(x, single)| *x = f64::from(single));
            }
            let smallest = (0.5 * (&applied + applied.transpose())).symmetric_eigenvalues().min();
            assert!(smallest > 0.0, "{strongest:e}: {smallest:e}");
        }
    }

    #[test]
    fn any_rank_on_any_number_of_pixels() {
        for (n, rank) in [(1, 1), (16, 4), (40, 7), (83, 12)] {
            let vectors = orthonormal(n, rank);
            let r: Vec<f64> = (0..n).map(|i| (0.3 * i as f64).cos()).collect();
            let eigenvalues: Vec<f64> = (0..rank).map(|k| 100.0 / (1.0 + k as f64)).collect();
            let (basis, lambda) = (Basis::on_active_pixels(eigenvalues, &vectors), 0.4);
            assert!(active_pixels(&basis) == n && basis.eigenvalues.len() == rank);
            let (wanted, mut out) = (inverse_by_the_rounded(&basis, lambda, &r), vec![0.0; n]);
            Preconditioner { maps: vec![basis] }.apply(lambda, &r, &mut out);
            assert!(out.iter().zip(&wanted).all(|(a, b)| (a - b).abs() < 1e-6), "{n} {rank}: {out:?} {wanted:?}");
        }
    }

    /// Number of pixels on which the eigenvectors live.
    fn active_pixels(basis: &Basis) -> usize {
        basis.spotted.active + basis.faint.active
    }

    /// Orthonormal columns that live on all pixels.
    pub(super) fn orthonormal(n: usize, rank: usize) -> DMatrix<f64> {
        DMatrix::from_fn(n, rank, |i, k| (0.7 + 12.9898 * (i * i + 31 * k) as f64).sin()).qr().q()
    }

    fn inverse_by_the_rounded(basis: &Basis, lambda: f64, r: &[f64]) -> Vec<f64> {
        let Basis { eigenvalues, spotted, faint, .. } = basis;
        let vectors = spotted.on_all(r.len()) + faint.on_all(r.len());
        let mut kept = vectors.transpose() * nalgebra::DVector::from_column_slice(r);
        kept.iter_mut().zip(eigenvalues).for_each(|(c, e)| *c *= lambda * e / (1.0 + lambda * e));
        r.iter().zip(&(vectors * kept)).map(|(r, back)| r - back).collect()
    }
}
