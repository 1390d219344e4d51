//! A truncated eigenbasis of the misfit's curvature at a reference image (method section 2): almost the inverse of the Newton
//! system of every nearby problem.
//!
//! In the entropy's metric the system is `1 + lambda M`, and M has a few hundred eigenvalues above 0.01 whatever the number
//! of pixels; the basis is found in a block Krylov space from a fixed random start (Musco & Musco 2015), and lives on the
//! pixels that carry it: the spotted part of the star. Left out: when to rebuild it.

use crate::vector::linear::dot;
use crate::vector::{self, Instructions, Number, Registers, Task};
use nalgebra::{DMatrix, SymmetricEigen};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

/// `(1 + lambda M)^-1` on the span of M's largest eigenvectors, the identity elsewhere.
#[derive(Clone, Debug, Default)]
pub struct Preconditioner {
    /// Largest eigenvalues of M.
    eigenvalues: Vec<f64>,
    /// The eigenvectors where most of them is, ...
    spotted: Rows<i16>,
    /// ... and on pixels that carry less than [`FAINT_ENERGY`] together: the time goes into fetching rows.
    faint: Rows<i8>,
    /// Of a component at most so much is subtracted: less than everything, because rounded eigenvectors are not quite orthonormal.
    most_subtracted: f64,
}

/// Eigenvectors on some of the pixels.
#[derive(Clone, Debug)]
struct Rows<W> {
    /// The pixels, and others, whose rows are zero, to make their number a multiple of [`LANES`].
    pixels: Vec<u32>,
    /// How many of them are not there to fill up.
    active: usize,
    /// Of [`LANES`] pixels after [`LANES`] pixels, every eigenvector.
    rows: Vec<Row<W>>,
    /// Unit in which each eigenvector is written.
    units: Vec<f32>,
}

/// Pixels side by side: four of the widest registers, so that a sum over pixels is stored once for four products, and sums over
/// eigenvectors do not wait for each other.
const LANES: usize = 64;

/// Rows from the one at work to the one that is asked for.
const AHEAD: usize = 24;

/// Sums over pixels that are kept apart.
const PARTS: usize = 16;

/// What an eigenvector has on pixels side by side, in whole units.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct Row<W>([W; LANES]);

/// Of anything at most so much is subtracted: what is left must not drown in rounding, or the inverse is no longer positive.
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
        Preconditioner { eigenvalues, spotted, faint, most_subtracted: MOST_SUBTRACTED / longest.max(1.0) }
    }

    /// Number of eigenvectors.
    pub fn rank(&self) -> usize {
        self.eigenvalues.len()
    }

    /// Number of pixels on which they live.
    pub fn active_pixels(&self) -> usize {
        self.spotted.active + self.faint.active
    }

    /// Bytes that it takes in memory, all but a few.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.spotted.rows[..]) + size_of_val(&self.faint.rows[..])
    }

    /// Eigenvalues of M, largest first.
    pub fn eigenvalues(&self) -> &[f64] {
        &self.eigenvalues
    }

    /// Approximates `out = (1 + lambda M)^-1 r`.
    pub fn apply<N: Number>(&self, lambda: f64, r: &[N], out: &mut [N]) {
        out.copy_from_slice(r);
        let mut components = self.components(r);
        for (c, e) in components.iter_mut().zip(&self.eigenvalues) {
            *c *= (lambda * e / (1.0 + lambda * e)).min(self.most_subtracted) as f32;
        }
        self.subtract(&components, out);
    }

    /// Approximates `r (1 + lambda M)^-1 r`, in two parts: of what the eigenvectors span of r, and of the rest.
    pub fn norms(&self, lambda: f64, r: &[f32]) -> (f64, f64) {
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

    /// Subtracts a combination of the eigenvectors; in the order that has the last rows of the components, which are still in the
    /// cache, first.
    fn subtract<N: Number>(&self, components: &[f32], out: &mut [N]) {
        self.faint.subtract(components, out);
        self.spotted.subtract(components, out);
    }
}

/// Nothing on no pixels.
impl<W> Default for Rows<W> {
    fn default() -> Self {
        Rows { pixels: Vec::new(), active: 0, rows: Vec::new(), units: Vec::new() }
    }
}

impl<W: Whole> Rows<W> {
    /// Of the columns of `vectors` what they have on these pixels.
    fn new(vectors: &DMatrix<f64>, mut pixels: Vec<u32>) -> Self {
        pixels.sort_unstable();
        let (active, rank) = (pixels.len(), vectors.ncols());
        // a number that is not finite is none in units of anything: the unit shows it
        let units = vectors.column_iter().map(|vector| {
            let numbers = pixels.iter().map(|p| vector[*p as usize].abs());
            match numbers.clone().all(f64::is_finite) {
                true => numbers.fold(0.0, f64::max) / W::LARGEST,
                false => f64::NAN,
            }
        });
        let units: Vec<f64> = units.collect();
        let mut rows = vec![Row([W::default(); LANES]); active.div_ceil(LANES) * rank];
        for (pixels, rows) in pixels.chunks(LANES).zip(rows.chunks_mut(rank.max(1))) {
            for (k, Row(row)) in rows.iter_mut().enumerate() {
                row.iter_mut().zip(pixels).for_each(|(x, p)| *x = W::nearest(vectors[(*p as usize, k)] / units[k]));
            }
        }
        let units = units.iter().map(|unit| *unit as f32).collect();
        pixels.resize(active.next_multiple_of(LANES), 0);
        Rows { pixels, active, rows, units }
    }

    /// Pixels side by side and what every eigenvector has there.
    #[inline(always)]
    fn groups(&self) -> impl DoubleEndedIterator<Item = (&[u32; LANES], &[Row<W>])> {
        self.pixels.as_chunks::<LANES>().0.iter().zip(self.rows.chunks_exact(self.units.len().max(1)))
    }

    /// The eigenvectors as they are written here, a pixel in each row.
    fn rounded(&self) -> DMatrix<f64> {
        let rank = self.units.len();
        DMatrix::from_fn(self.active, rank, |i, k| {
            let Row(row) = &self.rows[i / LANES * rank + k];
            f64::from(self.units[k]) * row[i % LANES].into()
        })
    }

    /// Scalar products of them with each other.
    fn products(&self) -> DMatrix<f64> {
        let rounded = self.rounded();
        rounded.transpose() * rounded
    }

    /// Scalar products of `r` with the eigenvectors, on these pixels.
    fn components<N: Number>(&self, r: &[N]) -> Vec<f32> {
        let mut components = vector::run(Components { basis: self, r });
        components.iter_mut().zip(&self.units).for_each(|(c, unit)| *c *= unit);
        components
    }

    /// Subtracts a combination of the eigenvectors on these pixels.
    fn subtract<N: Number>(&self, components: &[f32], out: &mut [N]) {
        let components: Vec<f32> = components.iter().zip(&self.units).map(|(c, unit)| c * unit).collect();
        vector::run(Subtract { basis: self, components: &components, out });
    }
}

/// Whole numbers of which rows are made.
trait Whole: Copy + Default + Into<f64> {
    /// The largest of them.
    const LARGEST: f64;

    /// The nearest to a number.
    fn nearest(x: f64) -> Self;

    /// Those from entry `first` on, side by side.
    fn load<I: Instructions>(i: I, from: &[Self], first: usize) -> <I::Broad as Registers>::Lanes;
}

impl Whole for i16 {
    const LARGEST: f64 = i16::MAX as f64;

    fn nearest(x: f64) -> Self {
        x.round() as i16
    }

    #[inline(always)]
    fn load<I: Instructions>(i: I, from: &[i16], first: usize) -> <I::Broad as Registers>::Lanes {
        i.load_whole(from, first)
    }
}

impl Whole for i8 {
    const LARGEST: f64 = i8::MAX as f64;

    fn nearest(x: f64) -> Self {
        x.round() as i8
    }

    #[inline(always)]
    fn load<I: Instructions>(i: I, from: &[i8], first: usize) -> <I::Broad as Registers>::Lanes {
        i.load_bytes(from, first)
    }
}

/// The largest eigenvalue of a symmetric matrix; 0 of one that is empty or not finite.
fn largest_eigenvalue(matrix: DMatrix<f64>) -> f64 {
    let is_one = !matrix.is_empty() && matrix.iter().all(|x| x.is_finite());
    if is_one { matrix.symmetric_eigenvalues().max() } else { 0.0 }
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

/// Sums on a cache line of their own.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Sums([f32; PARTS]);

/// Scalar products of `r` with the eigenvectors, in units of each; single precision suffices for an approximate inverse.
struct Components<'a, W, N> {
    basis: &'a Rows<W>,
    r: &'a [N],
}

impl<W: Whole, N: Number> Task for Components<'_, W, N> {
    type Output = Vec<f32>;

    #[inline(always)]
    fn run<I: Instructions>(self, i: I) -> Vec<f32> {
        let singles = i.broad();
        let mut sums = vec![Sums([0.0; PARTS]); self.basis.units.len()];
        for (pixels, rows) in self.basis.groups() {
            let mut r = [0.0; LANES];
            for (r, p) in r.iter_mut().zip(pixels) {
                let number: f64 = self.r[*p as usize].into();
                *r = number as f32;
            }
            for first in (0..PARTS).step_by(I::Broad::LANES) {
                let mut parts = [singles.splat(0.0); LANES / PARTS];
                for (k, part) in parts.iter_mut().enumerate() {
                    *part = singles.load(&r, k * PARTS + first);
                }
                for (Sums(sum), row) in sums.iter_mut().zip(rows) {
                    vector::fetch_ahead(row, AHEAD);
                    let Row(row) = row;
                    let mut total = singles.load(sum, first);
                    for (k, part) in parts.into_iter().enumerate() {
                        total = singles.multiply_add(W::load(i, row, k * PARTS + first), part, total);
                    }
                    singles.store(total, sum, first);
                }
            }
        }
        sums.iter().map(|Sums(sum)| sum.iter().sum()).collect()
    }
}

/// Registers of sums over eigenvectors.
const WIDE: usize = 4;

/// Subtracts a combination of the eigenvectors from `out`.
struct Subtract<'a, W, N> {
    basis: &'a Rows<W>,
    /// In units of each eigenvector.
    components: &'a [f32],
    out: &'a mut [N],
}

impl<W: Whole, N: Number> Task for Subtract<'_, W, N> {
    type Output = ();

    #[inline(always)]
    fn run<I: Instructions>(self, i: I) {
        let (singles, lanes) = (i.broad(), I::Broad::LANES);
        // backwards: the last rows are still in the cache
        for (pixels, rows) in self.basis.groups().rev() {
            let mut subtracted = [0.0; LANES];
            for first in (0..LANES).step_by(WIDE * lanes) {
                let mut sums = [singles.splat(0.0); WIDE];
                for (Row(row), component) in rows.iter().zip(self.components) {
                    let component = singles.splat(*component);
                    for (k, sum) in sums.iter_mut().enumerate() {
                        *sum = singles.multiply_add(W::load(i, row, first + k * lanes), component, *sum);
                    }
                }
                for (k, sum) in sums.into_iter().enumerate() {
                    singles.store(sum, &mut subtracted, first + k * lanes);
                }
            }
            for (subtracted, pixel) in subtracted.into_iter().zip(pixels) {
                let out = &mut self.out[*pixel as usize];
                *out = *out - N::of(f64::from(subtracted));
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
            let preconditioner = Preconditioner::on_active_pixels(eigenvalues, &vectors);
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
    fn any_rank_on_any_number_of_pixels_by_all_instructions() {
        for (n, rank) in [(1, 1), (16, 4), (40, 7), (83, 12)] {
            // orthonormal columns that live on all pixels
            let noise = DMatrix::from_fn(n, rank, |i, k| (0.7 + 12.9898 * (i * i + 31 * k) as f64).sin());
            let vectors = noise.qr().q();
            let r: Vec<f64> = (0..n).map(|i| (0.3 * i as f64).cos()).collect();
            let along = vectors.transpose() * nalgebra::DVector::from_column_slice(&r);
            check_rows(along.as_slice(), &r, &Rows::<i16>::new(&vectors, (0..n as u32).collect()));
            check_rows(along.as_slice(), &r, &Rows::<i8>::new(&vectors, (0..n as u32).collect()));
            let eigenvalues: Vec<f64> = (0..rank).map(|k| 100.0 / (1.0 + k as f64)).collect();
            let (preconditioner, lambda) = (Preconditioner::on_active_pixels(eigenvalues, &vectors), 0.4);
            assert!(preconditioner.active_pixels() == n && preconditioner.rank() == rank);
            let (wanted, mut out) = (inverse_by_the_rounded(&preconditioner, lambda, &r), vec![0.0; n]);
            preconditioner.apply(lambda, &r, &mut out);
            assert!(out.iter().zip(&wanted).all(|(a, b)| (a - b).abs() < 1e-6), "{n} {rank}: {out:?} {wanted:?}");
        }
    }

    fn inverse_by_the_rounded(preconditioner: &Preconditioner, lambda: f64, r: &[f64]) -> Vec<f64> {
        let Preconditioner { eigenvalues, spotted, faint, .. } = preconditioner;
        let mut vectors = DMatrix::zeros(r.len(), eigenvalues.len());
        for (pixels, rounded) in [(&spotted.pixels, spotted.rounded()), (&faint.pixels, faint.rounded())] {
            rounded.row_iter().zip(pixels).for_each(|(row, p)| vectors.set_row(*p as usize, &row));
        }
        let mut kept = vectors.transpose() * nalgebra::DVector::from_column_slice(r);
        kept.iter_mut().zip(eigenvalues).for_each(|(c, e)| *c *= lambda * e / (1.0 + lambda * e));
        r.iter().zip(&(vectors * kept)).map(|(r, back)| r - back).collect()
    }

    /// What is left of `r` without a combination of the eigenvectors.
    struct Without<'a, W> {
        basis: &'a Rows<W>,
        components: &'a [f32],
        r: &'a [f64],
    }

    impl<W: Whole> Task for Without<'_, W> {
        type Output = Vec<f64>;

        #[inline(always)]
        fn run<I: Instructions>(self, i: I) -> Vec<f64> {
            let Without { basis, components, r } = self;
            let mut out = r.to_vec();
            Subtract { basis, components, out: &mut out }.run(i);
            out
        }
    }

    /// Holds components and what is left without them to what the eigenvectors say.
    fn check_rows<W: Whole>(wanted: &[f64], r: &[f64], basis: &Rows<W>) {
        let components = vector::by_each(|| Components { basis, r });
        for components in &components {
            for ((component, unit), wanted) in components.iter().zip(&basis.units).zip(wanted) {
                // every entry is off by half a unit at most, and sums are in single precision
                let off = f64::from(*unit) * 0.5 * r.iter().map(|r| r.abs()).sum::<f64>() + 1e-5;
                assert!((f64::from(component * unit) - wanted).abs() < off, "{component} {wanted}");
            }
        }
        assert!(components[1..].windows(2).all(|two| two[0] == two[1]), "wider registers change the sums");
        let along: Vec<f32> = components[0].iter().zip(&basis.units).map(|(c, unit)| c * unit).collect();
        let combined = basis.rounded() * nalgebra::DVector::from_fn(along.len(), |k, _| f64::from(along[k]));
        // rows of whole numbers: their components have the units
        let in_units: Vec<f32> = along.iter().zip(&basis.units).map(|(c, unit)| c * unit).collect();
        let left = vector::by_each(|| Without { basis, components: &in_units, r });
        for left in &left {
            for (pixel, taken) in basis.pixels.iter().map(|p| *p as usize).zip(&combined) {
                let (left, wanted) = (left[pixel], r[pixel] - taken);
                assert!((left - wanted).abs() < 1e-5, "{pixel}: {left} {wanted}");
            }
        }
        assert!(left[1..].windows(2).all(|two| two[0] == two[1]), "wider registers change the sums");
    }
}
