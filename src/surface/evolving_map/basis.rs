//! The harmonics that maps are made of, on the pixels of a star.

use super::condense::ROUGHEST;
use super::{DEGREE, Design, MEAN_FILLING};
use crate::field::{Compression, Degrees, Harmonics, Settling, Spectrum};
use crate::model::ParameterValues;
use crate::star::SurfaceGrid;
use crate::surface::imaging::Imager;
use nalgebra::{DMatrix, DVector, RowDVector};
use std::ops::Range;

/// Pixels at which changes of the maps are watched, about.
const WATCHED: usize = 150;

/// Largest variance of all data together, over that of the noise of one, by harmonics that are left out, of the
/// roughest spots: of usual ones an error of ln Z of some 2e-3 (`tests/method/marginal.rs`).
const LEFT_OUT: f64 = 0.2;

/// The harmonics on the pixels of a map.
#[derive(Clone, Debug)]
pub struct Basis {
    /// Degrees of the harmonics (H).
    pub degrees: Degrees,
    /// The harmonics (pixels, H).
    pub on_pixels: DMatrix<f64>,
    /// The harmonics (points, H) where changes of the maps are watched.
    pub(super) watched: DMatrix<f64>,
    /// How exactly maps are found.
    pub(super) settling: Settling,
    /// Times that maps are found with a jitter, along their slopes from time to time.
    pub(super) jittered: usize,
}

impl Basis {
    /// All, on the pixels of `grid`, maps exact enough for ln Z to some 0.03.
    pub fn new(grid: &SurfaceGrid) -> Self {
        Basis::up_to(grid, DEGREE)
    }

    /// Those that the data of `imager` see of a star at `values`, the same otherwise.
    pub fn seen(imager: &Imager, values: &ParameterValues) -> Self {
        let all = Basis::new(&imager.grid);
        let design = Design::new(imager, &all, &values.state());
        all.seen_by(imager, &design)
    }

    fn up_to(grid: &SurfaceGrid, degree: usize) -> Self {
        let harmonics = Harmonics::new(degree);
        let on_pixels = harmonics.at(&grid.longitude, &grid.latitude);
        let each = (grid.len() / WATCHED).max(1);
        let watched: Vec<usize> = (0..grid.len()).step_by(each).collect();
        Basis {
            degrees: harmonics.degrees(),
            watched: on_pixels.select_columns(&watched).transpose(),
            on_pixels: on_pixels.transpose(),
            settling: Settling { tolerance: 1e-3, ..Settling::default() },
            jittered: 1,
        }
    }

    /// The same where ln Z is compared with that of neighbours: maps exact enough for ln Z to some 0.003.
    #[must_use]
    pub fn exactly(self) -> Self {
        let settling = Settling { tolerance: 2e-4, ..Settling::default() };
        Basis { settling, jittered: 2, ..self }
    }

    /// The same where differences of ln Z need be good to a few tenths only.
    pub fn rough(grid: &SurfaceGrid) -> Self {
        Basis::new(grid).roughly()
    }

    /// The same with harmonics up to a lower degree, which tell of large spots only.
    pub(super) fn coarse(grid: &SurfaceGrid, degree: usize) -> Self {
        Basis::up_to(grid, degree).roughly()
    }

    /// These harmonics, differences of ln Z good to a few tenths.
    #[must_use]
    pub(super) fn roughly(&self) -> Self {
        let compression = Compression { left_out: 0.03 };
        Basis { settling: Settling { tolerance: 5e-3, compression, ..Settling::default() }, ..self.clone() }
    }

    /// Number H of harmonics.
    pub fn len(&self) -> usize {
        self.degrees.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.degrees.is_empty()
    }

    /// Combinations of the harmonics of each degree, those of which the data of a `design` with all of them see more
    /// than next to nothing: from half as many to nine tenths. All of a degree have one prior variance, whatever
    /// directions they are counted along, and so those that are left out tell nothing of the others.
    fn seen_by(&self, imager: &Imager, design: &Design) -> Self {
        let variances = ROUGHEST.variances(&self.degrees);
        let mut directions: Vec<Direction> = Vec::with_capacity(self.len());
        for of in self.each_degree() {
            let eigen = design.information(imager, of.clone()).symmetric_eigen();
            for (information, column) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
                let variance = variances[of.start] * information.max(0.0);
                directions.push(Direction { of: of.clone(), along: column.into_owned(), variance });
            }
        }
        let mut order: Vec<usize> = (0..directions.len()).collect();
        order.sort_by(|a, b| directions[*a].variance.total_cmp(&directions[*b].variance));
        let mut left_out = 0.0;
        let is_left_out = |i: &usize| {
            left_out += directions[*i].variance;
            left_out <= LEFT_OUT
        };
        let mut seen = order.split_off(order.iter().copied().take_while(is_left_out).count());
        let unseen = order;
        seen.sort_unstable();
        let turned = |points: &DMatrix<f64>| {
            let column = |i: &usize| points.columns_range(directions[*i].of.clone()) * &directions[*i].along;
            DMatrix::from_columns(&seen.iter().map(column).collect::<Vec<_>>())
        };
        let degrees = |of: &[usize]| of.iter().map(|i| self.degrees.of_each[directions[*i].of.start]).collect();
        Basis {
            degrees: Degrees { of_each: degrees(&seen), unseen: degrees(&unseen) },
            on_pixels: turned(&self.on_pixels),
            watched: turned(&self.watched),
            ..*self
        }
    }

    /// Which harmonics are of each degree.
    fn each_degree(&self) -> impl Iterator<Item = Range<usize>> {
        let mut end = 0;
        self.degrees.of_each.chunk_by(|a, b| a == b).map(move |of| {
            end += of.len();
            end - of.len()..end
        })
    }

    /// Variance of each pixel by those that no data see.
    pub(super) fn unseen_variances(&self, spectrum: &Spectrum) -> DVector<f64> {
        // together harmonics of all degrees have that of the field everywhere
        let seen = spectrum.variances(&self.degrees);
        let left = |pixel: RowDVector<f64>| {
            let of_seen: f64 = pixel.iter().zip(&seen).map(|(y, variance)| y * y * variance).sum();
            (spectrum.amplitude.powi(2) - of_seen).max(0.0)
        };
        let pixels = self.on_pixels.row_iter().map(|pixel| left(pixel.into_owned()));
        DVector::from_iterator(self.on_pixels.nrows(), pixels)
    }

    /// Spot filling factors (pixels, columns) of maps with these `coefficients` (H, columns).
    pub fn filling(&self, coefficients: &DMatrix<f64>) -> DMatrix<f64> {
        (&self.on_pixels * coefficients).add_scalar(MEAN_FILLING)
    }
}

/// A combination of the harmonics of one degree.
struct Direction {
    /// Which harmonics.
    of: Range<usize>,
    /// How much of each.
    along: DVector<f64>,
    /// Variance of the data by it, in units of their noise, of the roughest spots.
    variance: f64,
}
