//! A truncated eigenbasis of the misfit's curvature at a reference image (method section 2): almost the inverse of the Newton
//! system of every nearby problem.
//!
//! In the entropy's metric the system is `1 + lambda M`, and M has a few hundred eigenvalues above 0.01 whatever the number
//! of pixels; the basis is found in a block Krylov space from a fixed random start (Musco & Musco 2015), and lives on the
//! pixels that carry it: the spotted part of the star. Left out: when to rebuild it.

use crate::vector::linear::dot;
use crate::vector::{self, Instructions, Task};
use nalgebra::{DMatrix, SymmetricEigen};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

/// `(1 + lambda M)^-1` on the span of M's largest eigenvectors, the identity elsewhere.
#[derive(Clone, Debug, Default)]
pub struct Preconditioner {
    /// Largest eigenvalues of M.
    eigenvalues: Vec<f64>,
    /// Pixels on which the basis lives, and others with rows of zeros to make the number of rows a multiple of [`GROUP`].
    pixels: Vec<u32>,
    /// How many of them are not there to fill up.
    active: usize,
    /// Eigenvectors: one row of components a pixel, filled up with zeros to a multiple of [`LANES`].
    rows: Vec<Lanes>,
}

/// Components of a row that are computed side by side.
const LANES: usize = 8;
type Lanes = [f32; LANES];

/// Rows that are read together, so that the components are loaded once for all of them.
const GROUP: usize = 4;

/// Pixels are dropped, faintest first, as long as they carry less than this share of the basis.
const DROPPED_ENERGY: f64 = 1e-3;

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

    /// From the operator M (`apply(v, out)`) on vectors of length `n`: at most `rank` eigenvectors, those with eigenvalues
    /// above `smallest`.
    pub fn build(n: usize, rank: usize, smallest: f64, apply: impl FnMut(&[f64], &mut [f64])) -> Self {
        let (basis, image) = krylov(n, rank + OVERSAMPLING, apply);
        let projected = basis.transpose() * image;
        let eigen = SymmetricEigen::new(0.5 * (&projected + projected.transpose()));
        let mut order: Vec<usize> = (0..basis.ncols()).filter(|&i| eigen.eigenvalues[i] > smallest).collect();
        order.sort_by(|&i, &j| eigen.eigenvalues[j].total_cmp(&eigen.eigenvalues[i]));
        order.truncate(rank);
        let vectors = basis * eigen.eigenvectors.select_columns(&order);
        let eigenvalues: Vec<f64> = order.iter().map(|&i| eigen.eigenvalues[i]).collect();
        Preconditioner::on_active_pixels(eigenvalues, &vectors)
    }

    fn on_active_pixels(eigenvalues: Vec<f64>, vectors: &DMatrix<f64>) -> Self {
        let energy: Vec<f64> = vectors.row_iter().map(|row| row.norm_squared()).collect();
        let mut by_energy: Vec<u32> = (0..energy.len() as u32).collect();
        by_energy.sort_by(|&p, &q| energy[p as usize].total_cmp(&energy[q as usize]));
        let total: f64 = energy.iter().sum();
        let mut dropped = 0.0;
        let faint = by_energy.iter().take_while(|&&p| {
            dropped += energy[p as usize];
            dropped < DROPPED_ENERGY * total
        });
        let first = faint.count();
        let mut active = by_energy.split_off(first);
        active.sort_unstable();
        let mut rows = Vec::new();
        for &p in &active {
            let row: Vec<f32> = vectors.row(p as usize).iter().map(|x| *x as f32).collect();
            rows.extend(row.chunks(LANES).map(|part| std::array::from_fn(|i| part.get(i).copied().unwrap_or(0.0))));
        }
        let (mut pixels, width) = (active, eigenvalues.len().div_ceil(LANES));
        let active = pixels.len();
        pixels.resize(active.next_multiple_of(GROUP), 0);
        rows.resize(pixels.len() * width, [0.0; LANES]);
        Preconditioner { eigenvalues, pixels, active, rows }
    }

    /// Number of eigenvectors.
    pub fn rank(&self) -> usize {
        self.eigenvalues.len()
    }

    /// Number of pixels on which they live.
    pub fn active_pixels(&self) -> usize {
        self.active
    }

    /// Bytes that it takes in memory, all but a few.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.rows[..])
    }

    /// Groups of components in a row.
    fn width(&self) -> usize {
        self.eigenvalues.len().div_ceil(LANES)
    }

    /// Rows and their pixels, [`GROUP`] at a time.
    #[inline(always)]
    fn groups(&self) -> impl DoubleEndedIterator<Item = ([&[Lanes]; GROUP], &[u32; GROUP])> {
        let width = self.width();
        let rows = self.rows.chunks_exact((GROUP * width).max(1));
        rows.map(move |rows| std::array::from_fn(|j| &rows[j * width..][..width]))
            .zip(self.pixels.as_chunks::<GROUP>().0)
    }

    /// Eigenvalues of M, largest first.
    pub fn eigenvalues(&self) -> &[f64] {
        &self.eigenvalues
    }

    /// Approximates `out = (1 + lambda M)^-1 r`.
    pub fn apply(&self, lambda: f64, r: &[f64], out: &mut [f64]) {
        out.copy_from_slice(r);
        let mut components = vector::run(Components { basis: self, r });
        for (c, e) in components.as_flattened_mut().iter_mut().zip(&self.eigenvalues) {
            *c *= (lambda * e / (1.0 + lambda * e)) as f32;
        }
        vector::run(Subtract { basis: self, components: &components, out });
    }

    /// Approximates `r (1 + lambda M)^-1 r`, in two parts: of what the eigenvectors span of r, and of the rest.
    pub fn norms(&self, lambda: f64, r: &[f64]) -> (f64, f64) {
        let components = vector::run(Components { basis: self, r });
        let spanned = components
            .as_flattened()
            .iter()
            .zip(&self.eigenvalues)
            .map(|(c, e)| f64::from(*c).powi(2) / (1.0 + lambda * e));
        let mut rest = r.to_vec();
        vector::run(Subtract { basis: self, components: &components, out: &mut rest });
        (spanned.sum(), dot(&rest, &rest))
    }
}

/// An orthonormal basis of the block Krylov space of an operator from a fixed random start, with about so many columns, and what the
/// operator makes of it.
fn krylov(n: usize, columns: usize, mut apply: impl FnMut(&[f64], &mut [f64])) -> (DMatrix<f64>, DMatrix<f64>) {
    let width = BLOCK.min(n);
    let columns = width * columns.div_ceil(width).min(n / width);
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(0x5eed);
    let (mut basis, mut image) = (DMatrix::zeros(n, columns), DMatrix::zeros(n, columns));
    let mut block = DMatrix::from_fn(n, width, |_, _| -> f64 { StandardNormal.sample(&mut rng) });
    for first in (0..columns).step_by(width) {
        let known = basis.columns(0, first);
        // until nothing of the known ones is left: what is nearly spanned by them is mostly rounding errors at first
        for _ in 0..MOST_PROJECTIONS {
            block = block.qr().q();
            block -= known * (known.transpose() * &block);
            if block.column_iter().all(|column| column.norm() > NOT_SPANNED) {
                break;
            }
        }
        block = block.qr().q();
        for j in 0..width {
            apply(block.column(j).as_slice(), image.column_mut(first + j).as_mut_slice());
        }
        basis.columns_mut(first, width).copy_from(&block);
        block.copy_from(&image.columns(first, width));
    }
    (basis, image)
}

/// Scalar products of `r` with the eigenvectors; single precision suffices for an approximate inverse, and is twice as fast.
struct Components<'a> {
    basis: &'a Preconditioner,
    r: &'a [f64],
}

impl Task for Components<'_> {
    type Output = Vec<Lanes>;

    #[inline(always)]
    fn run<I: Instructions>(self, _: I) -> Vec<Lanes> {
        let mut components = vec![[0.0; LANES]; self.basis.width()];
        for (rows, pixels) in self.basis.groups() {
            let r = pixels.map(|p| self.r[p as usize] as f32);
            for (k, sums) in components.iter_mut().enumerate() {
                // values, not references: the compiler makes vectors of the lanes then
                let rows = rows.map(|row| row[k]);
                for lane in 0..LANES {
                    let of_row = |j: usize| r[j] * rows[j][lane];
                    sums[lane] += (of_row(0) + of_row(1)) + (of_row(2) + of_row(3));
                }
            }
        }
        components
    }
}

/// Subtracts a combination of the eigenvectors from `out`.
struct Subtract<'a> {
    basis: &'a Preconditioner,
    components: &'a [Lanes],
    out: &'a mut [f64],
}

impl Task for Subtract<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Instructions>(self, _: I) {
        // backwards: the last rows are still in the cache
        for (rows, pixels) in self.basis.groups().rev() {
            let mut sums = [[0.0; LANES]; GROUP];
            for (k, components) in self.components.iter().enumerate() {
                for j in 0..GROUP {
                    for lane in 0..LANES {
                        sums[j][lane] += rows[j][k][lane] * components[lane];
                    }
                }
            }
            for (p, sums) in pixels.iter().zip(sums) {
                self.out[*p as usize] -= f64::from(sums.iter().sum::<f32>());
            }
        }
    }
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
        let preconditioner = Preconditioner::build(n, 10, 1e-6, apply);
        assert_eq!(preconditioner.rank(), 2);
        assert_eq!(preconditioner.active_pixels(), 3);
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
    fn the_basis_is_orthonormal_whatever_the_operator() {
        // eigenvalues over so many decades, down to those that rounding errors drown
        for decades in [1.0, 5.0, 20.0, 60.0] {
            let apply = |v: &[f64], out: &mut [f64]| {
                for (i, (out, v)) in out.iter_mut().zip(v).enumerate() {
                    *out = 1e3 * 10f64.powf(-decades * i as f64 / 150.0) * v;
                }
            };
            let (basis, image) = krylov(150, 130, apply);
            assert_eq!((basis.ncols(), image.ncols()), (140, 140));
            let error = (basis.transpose() * &basis - DMatrix::identity(140, 140)).amax();
            assert!(error < 1e-13, "{decades} decades: {error:e}");
        }
    }
}
