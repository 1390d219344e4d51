//! Errors of each observed profile by itself: the level and the slope of its continuum, the equivalent width of its
//! line, and its RV jitter; each with a Gaussian prior, and marginalised over.
//!
//! The observed depth is linear in the first three, `d = D - offset - slope x + equivalent_width M + noise`, with x
//! from -1 to 1 along the profile and M the mean of all observed profiles. So marginalisation over them is exact and
//! only changes the covariance of a profile's bins to `Sigma = diag(sigma^2) + T P T^t`: a chi2 of `r Sigma^-1 r` still
//! has as many degrees of freedom as there are bins. A velocity offset z by the jitter, small compared with the width
//! of the line, adds one more term `+ z D'` with D' the derivative of the depths with velocity, which depends on the
//! star and is given. With the whitened templates `sigma^-1 T P^(1/2) = Q s V^t` the inverse is `sigma^-1 (1 - Q
//! s^2/(1+s^2) Q^t) sigma^-1`: one scalar product per template.

use crate::numerics::vector::Instructions;
use crate::numerics::vector::linear::short_dot;
use crate::star::observation::{Observations, Profile};
use nalgebra::DMatrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// One number for each of the three: the standard deviations of their priors, or their values in one profile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LineAndContinuum {
    /// Level of the continuum, in its own units.
    pub continuum_offset: f64,
    /// Slope of the continuum: by how much it is higher at the last bin of a profile than in the middle.
    pub continuum_slope: f64,
    /// Equivalent width of the line, relative.
    pub equivalent_width: f64,
}

impl LineAndContinuum {
    /// The three in order.
    pub fn numbers(&self) -> [f64; 3] {
        [self.continuum_offset, self.continuum_slope, self.equivalent_width]
    }

    /// From the three in order.
    pub fn of_numbers([continuum_offset, continuum_slope, equivalent_width]: [f64; 3]) -> Self {
        LineAndContinuum { continuum_offset, continuum_slope, equivalent_width }
    }
}

/// Derivatives of the depth in bin `j` of `bins` with each of the three, in a profile with that depth there.
pub fn templates(j: usize, bins: usize, depth: f64) -> [f64; 3] {
    let half = 0.5 * (bins as f64 - 1.0);
    [-1.0, -(j as f64 - half) / half.max(0.5), depth]
}

/// Estimates for one profile.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// Line and continuum.
    pub line_and_continuum: LineAndContinuum,
    /// Velocity offset by the RV jitter (km/s).
    pub zero_point_kms: f64,
}

/// Index of the RV jitter among the templates, after those of line and continuum.
const ZERO_POINT: usize = 3;

/// The nuisances of a set of profiles; none by default. Vectors have the length of the data, all profiles one after the
/// other.
#[derive(Clone, Debug, Default)]
pub struct Nuisances {
    /// Standard deviations of the priors of line and continuum, of each bin; empty without any.
    priors: Vec<[f64; 3]>,
    /// RV jitter (km/s).
    zero_point_kms: f64,
    /// Change of the depths per standard deviation of the prior, for each that is not fixed.
    templates: Vec<(usize, Vec<f64>)>,
    corrections: Vec<Correction>,
}

/// One direction in the space of a profile's bins in which the nuisances reduce the information of the data.
#[derive(Clone, Debug)]
struct Correction {
    /// The weights are `1/sigma^2 - full full^t`.
    full: Vec<f64>,
    /// Their root is `1/sigma - half full^t`.
    half: Vec<f64>,
}

impl Nuisances {
    /// For `observations`, with priors of these standard deviations; a standard deviation of 0 fixes a nuisance at 0.
    pub fn new(priors: LineAndContinuum, observations: &Observations) -> Self {
        Nuisances::of_sets(&[(priors, observations)])
    }

    /// For several data sets, one after the other, each with its own priors.
    pub fn of_sets(sets: &[(LineAndContinuum, &Observations)]) -> Self {
        let profiles = || sets.iter().flat_map(|(_, set)| &set.profiles);
        let rows: Vec<[f64; 3]> =
            sets.iter().flat_map(|(_, set)| set.profiles.iter().flat_map(|p| templates_of(p, set))).collect();
        let of_bins = |(priors, set): &(LineAndContinuum, &Observations)| vec![priors.numbers(); set.len()];
        let priors: Vec<[f64; 3]> = sets.iter().flat_map(of_bins).collect();
        let free = (0..ZERO_POINT).filter(|i| priors.iter().any(|sd| sd[*i] > 0.0));
        let of_one = |i: usize| (i, rows.iter().zip(&priors).map(|(row, sd)| row[i] * sd[i]).collect());
        let templates = free.map(of_one).collect();
        let mut end = 0;
        let bins = profiles().map(|profile| {
            end += profile.sigma.len();
            end - profile.sigma.len()..end
        });
        let bins: Vec<Range<usize>> = bins.collect();
        let sigma: Vec<f64> = profiles().flat_map(|profile| profile.sigma.clone()).collect();
        Nuisances { priors, templates, ..Nuisances::default() }.of_profiles(&bins, &sigma)
    }

    /// The same with an RV jitter of this standard deviation (km/s) instead of the previous one. The derivatives of the
    /// depths with velocity are `slopes`; profiles have these `bins`, of uncertainties `sigma`.
    pub fn with_zero_points(mut self, sd_kms: f64, slopes: &[f64], bins: &[Range<usize>], sigma: &[f64]) -> Self {
        self.templates.retain(|(i, _)| *i != ZERO_POINT);
        self.zero_point_kms = sd_kms;
        if sd_kms > 0.0 {
            self.templates.push((ZERO_POINT, slopes.iter().map(|slope| sd_kms * slope).collect()));
        }
        self.of_profiles(bins, sigma)
    }

    /// Those of the profiles with these `bins` alone, whose bins have the uncertainties `sigma`, one after the other.
    pub fn of_profiles(&self, profiles: &[Range<usize>], sigma: &[f64]) -> Self {
        let kept = |(i, template): &(usize, Vec<f64>)| {
            (*i, profiles.iter().flat_map(|bins| template[bins.clone()].to_vec()).collect())
        };
        let templates: Vec<(usize, Vec<f64>)> = self.templates.iter().map(kept).collect();
        let mut corrections = vec![Correction { full: Vec::new(), half: Vec::new() }; templates.len()];
        let mut first = 0;
        for bins in profiles {
            let columns = DMatrix::from_fn(bins.len(), templates.len(), |j, column| templates[column].1[first + j]);
            correct(&columns, &sigma[first..first + bins.len()], &mut corrections);
            first += bins.len();
        }
        let has_priors = !self.priors.is_empty();
        let priors = profiles.iter().filter(|_| has_priors).flat_map(|bins| self.priors[bins.clone()].to_vec());
        Nuisances { priors: priors.collect(), zero_point_kms: self.zero_point_kms, templates, corrections }
    }

    /// Derivatives of the depths of the profile with these `bins` with line and continuum, per standard deviation of
    /// their priors (bins, nuisances).
    pub fn line_and_continuum_of(&self, bins: Range<usize>) -> DMatrix<f64> {
        let columns = self.templates.iter().filter(|(i, _)| *i != ZERO_POINT).map(|(_, all)| &all[bins.clone()]);
        // nuisances of other data sets have no column
        let columns: Vec<&[f64]> = columns.filter(|own| own.iter().any(|x| *x != 0.0)).collect();
        DMatrix::from_fn(bins.len(), columns.len(), |j, column| columns[column][j])
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.templates.is_empty()
    }

    /// Whether line or continuum are among them.
    pub fn has_line_and_continuum(&self) -> bool {
        self.templates.iter().any(|(i, _)| *i != ZERO_POINT)
    }

    /// RV jitter (km/s); 0 without one.
    pub fn zero_point_kms(&self) -> f64 {
        self.zero_point_kms
    }

    /// From `out = x / sigma^2` to `out = W x` in the `bins` of one profile.
    #[inline(always)]
    pub fn weigh(&self, i: impl Instructions, bins: Range<usize>, x: &[f64], out: &mut [f64]) {
        for correction in &self.corrections {
            let full = &correction.full[bins.clone()];
            let along = short_dot(i, full, &x[bins.clone()]);
            out[bins.clone()].iter_mut().zip(full).for_each(|(out, full)| *out -= along * full);
        }
    }

    /// From `out = x / sigma` to `out = R x`, `R^t R = W`, in the `bins` of one profile.
    pub fn weigh_root(&self, bins: Range<usize>, x: &[f64], out: &mut [f64]) {
        for Correction { full, half } in &self.corrections {
            let along = dot(&full[bins.clone()], &x[bins.clone()]);
            out[bins.clone()].iter_mut().zip(&half[bins.clone()]).for_each(|(out, half)| *out -= along * half);
        }
    }

    /// The posterior mean of the nuisances of the profile with these `bins`, given the weighted residual `W (model -
    /// data)`; their change of its depths is added to `depth`.
    pub fn estimate(&self, bins: Range<usize>, weighted_residual: &[f64], depth: &mut [f64]) -> Estimate {
        let mut numbers = [0.0; ZERO_POINT + 1];
        let [offset, slope, width] = self.priors.get(bins.start).copied().unwrap_or_default();
        let sd = [offset, slope, width, self.zero_point_kms];
        for (i, template) in &self.templates {
            let template = &template[bins.clone()];
            let in_sd = -dot(template, &weighted_residual[bins.clone()]);
            numbers[*i] = in_sd * sd[*i];
            depth[bins.clone()].iter_mut().zip(template).for_each(|(depth, change)| *depth += in_sd * change);
        }
        let [offset, slope, width, zero_point_kms] = numbers;
        Estimate { line_and_continuum: LineAndContinuum::of_numbers([offset, slope, width]), zero_point_kms }
    }
}

/// Templates of every bin of a profile.
fn templates_of(profile: &Profile, observations: &Observations) -> Vec<[f64; 3]> {
    let bins = profile.intensity.len();
    let mean = |j: usize| {
        let velocity = profile.velocity_kms(j);
        let (sum, count) = observations.profiles.iter().fold((0.0, 0.0), |(sum, count), other| {
            // rounding of VRAD must not lose the last bin
            let position = (velocity - other.first_velocity_kms) / other.step_kms;
            match position > -1e-6 && position < other.intensity.len() as f64 - 1.0 + 1e-6 {
                true => (sum + 1.0 - other.intensity_at(velocity), count + 1.0),
                false => (sum, count),
            }
        });
        sum / count
    };
    (0..bins).map(|j| templates(j, bins, mean(j))).collect()
}

/// Appends the corrections of the weights by the `templates` (columns, in standard deviations of the prior) of a
/// profile with these uncertainties.
fn correct(templates: &DMatrix<f64>, sigma: &[f64], corrections: &mut [Correction]) {
    if corrections.is_empty() {
        return;
    }
    let whitened = DMatrix::from_fn(sigma.len(), templates.ncols(), |j, column| templates[(j, column)] / sigma[j]);
    let svd = whitened.svd(true, false);
    let basis = svd.u.expect("asked for");
    for (column, correction) in corrections.iter_mut().enumerate() {
        // a profile with fewer bins than templates has fewer directions
        let s2 = svd.singular_values.get(column).map_or(0.0, |s| s * s);
        let full = (s2 / (1.0 + s2)).sqrt();
        // `half` times `full` is 1 - 1/sqrt(1+s^2); `full` is the root of s^2/(1+s^2)
        let half = full / (1.0 + (1.0 + s2).sqrt().recip());
        for (j, sigma) in sigma.iter().enumerate() {
            let q = if s2 > 0.0 { basis[(j, column)] } else { 0.0 };
            correction.full.push(full * q / sigma);
            correction.half.push(half * q);
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests;
