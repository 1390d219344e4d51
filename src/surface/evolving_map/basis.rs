//! The harmonics of the maps, on the pixels of a star.

use super::{DEGREE, MEAN_FILLING};
use crate::field::{Compression, Degrees, Harmonics, Settling, Spectrum};
use crate::star::SurfaceGrid;
use nalgebra::{DMatrix, DVector, RowDVector};

/// Approximate number of pixels at which changes of the maps are monitored.
const WATCHED: usize = 150;

/// Precision of maps where differences of ln Z need an accuracy of only a few tenths.
const ROUGH: f64 = 5e-3;

/// The harmonics on the pixels of a map.
#[derive(Clone, Debug)]
pub struct Basis {
    /// Degrees of the harmonics (H).
    pub degrees: Degrees,
    /// The harmonics (pixels, H).
    pub on_pixels: DMatrix<f64>,
    /// The harmonics (points, H) where changes of the maps are monitored.
    pub(super) watched: DMatrix<f64>,
    /// Precision of the maps.
    pub(super) settling: Settling,
    /// Iterations of maps with a jitter, each along the slopes of the previous ones.
    pub(super) jittered: usize,
}

impl Basis {
    /// All harmonics on the pixels of `grid`, with maps precise enough for ln Z to some 0.03.
    pub fn new(grid: &SurfaceGrid) -> Self {
        Basis::up_to(grid, DEGREE)
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

    /// The same where ln Z is compared with that of neighbours: maps precise enough for ln Z to some 0.003.
    #[must_use]
    pub fn exactly(self) -> Self {
        let settling = Settling { tolerance: 2e-4, ..Settling::default() };
        Basis { settling, jittered: 2, ..self }
    }

    /// The same where differences of ln Z need an accuracy of only a few tenths.
    pub fn rough(grid: &SurfaceGrid) -> Self {
        Basis::new(grid).roughly()
    }

    /// The same with harmonics up to a lower degree, which resolve only large spots.
    pub(super) fn coarse(grid: &SurfaceGrid, degree: usize) -> Self {
        Basis::up_to(grid, degree).roughly()
    }

    /// These harmonics, with differences of ln Z accurate to a few tenths.
    #[must_use]
    pub(super) fn roughly(&self) -> Self {
        let compression = Compression { left_out: 0.03 };
        Basis { settling: Settling { tolerance: ROUGH, compression, ..Settling::default() }, ..self.clone() }
    }

    /// Whether they have that accuracy.
    pub(super) fn is_rough(&self) -> bool {
        self.settling.tolerance >= ROUGH
    }

    /// Number H of harmonics.
    pub fn len(&self) -> usize {
        self.degrees.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.degrees.is_empty()
    }

    /// Variance of each pixel by harmonics to which no data are sensitive.
    pub(super) fn unseen_variances(&self, spectrum: &Spectrum) -> DVector<f64> {
        // together harmonics of all degrees have the variance of the field everywhere
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
