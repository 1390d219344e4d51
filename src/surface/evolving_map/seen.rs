//! The harmonics to which data are sensitive: the same maps with fewer coefficients
//! (`docs/explanation/evolving-maps.md`).
//!
//! All harmonics of a degree have one prior variance, in any basis. So those directions to which the data are hardly
//! sensitive can be omitted, without effect on the others. A star of 30 km/s with a line of 3.6 km/s omits four of ten,
//! and evaluations with other spots take half of the time. The filter of many profiles (`field::filter`) proceeds from
//! these to directions over all degrees, which differ for each field.

use super::condense::ROUGHEST;
use super::{Basis, Design};
use crate::field::Degrees;
use crate::model::ParameterValues;
use crate::surface::imaging::Imager;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// Largest variance of all data together, relative to the noise of one, by harmonics that are omitted, for the roughest
/// spots: for usual ones an error of ln Z of some 2e-3 (`tests/method/marginal.rs`).
const LEFT_OUT: f64 = 0.2;

/// Steps after which eigenvalues of a degree are given up: some 2 per coefficient are usual.
const MOST_ROTATIONS: usize = 10_000;

/// A combination of the harmonics of one degree.
struct Direction {
    /// Which harmonics.
    of: Range<usize>,
    /// Its components.
    along: DVector<f64>,
    /// Variance of the data by it, in units of their noise, for the roughest spots.
    variance: f64,
}

impl Basis {
    /// The harmonics to which the data of `imager` are sensitive for a star at `values`, otherwise the same.
    pub fn seen(imager: &Imager, values: &ParameterValues) -> Self {
        let all = Basis::new(&imager.grid);
        let design = Design::new(imager, &all, &values.state());
        all.seen_by(imager, &design)
    }

    /// Combinations of the harmonics of each degree to which the data of a `design` with all harmonics are
    /// significantly sensitive; all, where there is no design.
    fn seen_by(&self, imager: &Imager, design: &Design) -> Self {
        let variances = ROUGHEST.variances(&self.degrees);
        let mut directions: Vec<Direction> = Vec::with_capacity(self.len());
        for of in self.each_degree() {
            let information = design.information(imager, of.clone());
            // no convergence for values that are not finite
            let Some(eigen) = information.try_symmetric_eigen(f64::EPSILON, MOST_ROTATIONS) else {
                return self.clone();
            };
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
        // with noise alone one is kept
        let first = order.iter().copied().take_while(is_left_out).count().min(order.len() - 1);
        let mut seen = order.split_off(first);
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

    /// The range of harmonics of each degree.
    fn each_degree(&self) -> impl Iterator<Item = Range<usize>> {
        let mut end = 0;
        self.degrees.of_each.chunk_by(|a, b| a == b).map(move |of| {
            end += of.len();
            end - of.len()..end
        })
    }
}
