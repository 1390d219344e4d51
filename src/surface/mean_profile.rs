//! The error common to all profiles of a data set: a line or a continuum that differs slightly from the star's. Smooth
//! in velocity, of an unknown size, and marginalised over, so that no spots mimic it (`docs/method.md` section 9).
//!
//! It is a Gaussian process with squared-exponential covariance in the observer's velocities, represented by weights of
//! adjacent Gaussians.

use super::imaging::Imager;
use nalgebra::DMatrix;

/// Correlation length (km/s); there are at most so many of them in the velocity range.
const LENGTH_KMS: f64 = 4.0;
const MOST: f64 = 24.0;

/// Height of the Gaussians for which the sum of their squares is 1: their spacing and width are a correlation length.
const HEIGHT: f64 = 0.8932;

/// Unit changes of the depths of each profile (bins, columns): the columns of one data set follow those of the previous
/// one.
pub fn columns(imager: &Imager) -> Vec<DMatrix<f64>> {
    let ranges: Vec<(f64, f64)> = imager
        .sets
        .iter()
        .map(|set| {
            let sampling = &set.sampling;
            let ends = |range: (f64, f64), &(_, first, bins): &(f64, f64, usize)| {
                (range.0.min(first), range.1.max(first + bins as f64 * sampling.step_kms))
            };
            sampling.profiles.iter().fold((f64::INFINITY, f64::NEG_INFINITY), ends)
        })
        .collect();
    let length = |(low, high): &(f64, f64)| LENGTH_KMS.max((high - low) / MOST);
    let count = |range: &(f64, f64)| ((range.1 - range.0) / length(range)).ceil().max(1.0) as usize;
    let numbers = ranges.iter().map(count).sum();
    let mut all = Vec::new();
    let mut first = 0;
    for (set, range) in imager.sets.iter().zip(&ranges) {
        let (length, count) = (length(range), count(range));
        for &(_, velocity, bins) in &set.sampling.profiles {
            let mut columns = DMatrix::zeros(bins, numbers);
            for j in 0..bins {
                let v = velocity + j as f64 * set.sampling.step_kms;
                for c in 0..count {
                    let off = (v - range.0) / length - (c as f64 + 0.5);
                    columns[(j, first + c)] = HEIGHT * (-off * off).exp();
                }
            }
            all.push(columns);
        }
        first += count;
    }
    all
}
