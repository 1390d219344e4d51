//! Eigenvectors as integers: one unit for each, and pixels contiguous.
//!
//! An application reads every entry twice, and waits for memory: two bytes or one instead of four
//! (`results/performance.md`).

use crate::numerics::vector::{self, Instructions, Number, Registers, Task};
use nalgebra::DMatrix;

/// Eigenvectors on some of the pixels.
#[derive(Clone, Debug)]
pub struct Rows<W> {
    /// The pixels, padded with zero rows to a multiple of [`LANES`].
    pixels: Vec<u32>,
    /// Their number without padding.
    pub(super) active: usize,
    /// For each block of [`LANES`] pixels, every eigenvector.
    rows: Vec<Row<W>>,
    /// Unit in which each eigenvector is written.
    units: Vec<f32>,
}

/// Pixels per block: four of the widest registers, so that a sum over pixels is stored once for four products, and sums
/// over eigenvectors do not wait for each other.
const LANES: usize = 64;

/// Rows between the current one and the prefetched one.
const AHEAD: usize = 24;

/// Independent sums over pixels.
const PARTS: usize = 16;

/// Entries of an eigenvector on a block of pixels, in integer units.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct Row<W>([W; LANES]);

/// Empty.
impl<W> Default for Rows<W> {
    fn default() -> Self {
        Rows { pixels: Vec::new(), active: 0, rows: Vec::new(), units: Vec::new() }
    }
}

impl<W: Whole> Rows<W> {
    /// The entries of the columns of `vectors` on these pixels.
    pub fn new(vectors: &DMatrix<f64>, mut pixels: Vec<u32>) -> Self {
        pixels.sort_unstable();
        let (active, rank) = (pixels.len(), vectors.ncols());
        // a non-finite entry makes the unit non-finite
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

    /// Approximate size in memory (bytes).
    pub fn bytes(&self) -> usize {
        size_of_val(&self.rows[..])
    }

    /// A block of pixels with the entries of every eigenvector.
    #[inline(always)]
    fn groups(&self) -> impl DoubleEndedIterator<Item = (&[u32; LANES], &[Row<W>])> {
        self.pixels.as_chunks::<LANES>().0.iter().zip(self.rows.chunks_exact(self.units.len().max(1)))
    }

    /// The rounded eigenvectors, one pixel per row.
    fn rounded(&self) -> DMatrix<f64> {
        let rank = self.units.len();
        DMatrix::from_fn(self.active, rank, |i, k| {
            let Row(row) = &self.rows[i / LANES * rank + k];
            f64::from(self.units[k]) * row[i % LANES].into()
        })
    }

    /// Scalar products of them with each other.
    pub fn products(&self) -> DMatrix<f64> {
        let rounded = self.rounded();
        rounded.transpose() * rounded
    }

    /// Scalar products of `r` with the eigenvectors, on these pixels.
    pub fn components<N: Number>(&self, r: &[N]) -> Vec<f32> {
        let mut components = vector::run(Components { basis: self, r });
        components.iter_mut().zip(&self.units).for_each(|(c, unit)| *c *= unit);
        components
    }

    /// Subtracts a combination of the eigenvectors on these pixels.
    pub fn subtract<N: Number>(&self, components: &[f32], out: &mut [N]) {
        let components: Vec<f32> = components.iter().zip(&self.units).map(|(c, unit)| c * unit).collect();
        vector::run(Subtract { basis: self, components: &components, out });
    }
}

/// Integers of which rows consist.
pub trait Whole: Copy + Default + Into<f64> {
    /// The largest of them.
    const LARGEST: f64;

    /// The nearest to a number.
    fn nearest(x: f64) -> Self;

    /// Those from entry `first` on.
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

/// Sums aligned to a cache line.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Sums([f32; PARTS]);

/// Scalar products of `r` with the eigenvectors, in units of each; single precision suffices for an approximate
/// inverse.
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
    use crate::maxent::preconditioner::tests::orthonormal;
    use nalgebra::DVector;

    impl<W: Whole> Rows<W> {
        /// The eigenvectors on all of `n` pixels, as rounded here.
        pub fn on_all(&self, n: usize) -> DMatrix<f64> {
            let (rounded, mut vectors) = (self.rounded(), DMatrix::zeros(n, self.units.len()));
            rounded.row_iter().zip(&self.pixels).for_each(|(row, p)| vectors.set_row(*p as usize, &row));
            vectors
        }
    }

    #[test]
    fn any_number_of_vectors_on_any_number_of_pixels_by_all_instructions() {
        for (n, rank) in [(1, 1), (16, 4), (40, 7), (83, 12)] {
            let vectors = orthonormal(n, rank);
            check(&vectors, &Rows::<i16>::new(&vectors, (0..n as u32).collect()));
            check(&vectors, &Rows::<i8>::new(&vectors, (0..n as u32).collect()));
        }
    }

    /// `r` minus a combination of the eigenvectors.
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

    /// Compares components along vectors, and the remainder, with plain products.
    fn check<W: Whole>(vectors: &DMatrix<f64>, basis: &Rows<W>) {
        let r = DVector::from_fn(vectors.nrows(), |i, _| (0.3 * i as f64).cos());
        let (wanted, r) = (vectors.transpose() * &r, r.as_slice());
        let components = vector::by_each(|| Components { basis, r });
        for components in &components {
            for ((component, unit), wanted) in components.iter().zip(&basis.units).zip(&wanted) {
                // every entry is off by half a unit at most, and sums are in single precision
                let off = f64::from(*unit) * 0.5 * r.iter().map(|r| r.abs()).sum::<f64>() + 1e-5;
                assert!((f64::from(component * unit) - wanted).abs() < off, "{component} {wanted}");
            }
        }
        assert!(components[1..].windows(2).all(|two| two[0] == two[1]), "wider registers change the sums");
        let along: Vec<f32> = components[0].iter().zip(&basis.units).map(|(c, unit)| c * unit).collect();
        let combined = basis.on_all(r.len()) * DVector::from_fn(along.len(), |k, _| f64::from(along[k]));
        // rows of integers: their components have the units
        let in_units: Vec<f32> = along.iter().zip(&basis.units).map(|(c, unit)| c * unit).collect();
        let left = vector::by_each(|| Without { basis, components: &in_units, r });
        for left in &left {
            for ((left, r), taken) in left.iter().zip(r).zip(&combined) {
                assert!((left - (r - taken)).abs() < 1e-5, "{left} {r} {taken}");
            }
        }
        assert!(left[1..].windows(2).all(|two| two[0] == two[1]), "wider registers change the sums");
    }
}
