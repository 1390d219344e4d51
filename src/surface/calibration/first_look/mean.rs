//! The mean of all profiles, and the position of its line.
//!
//! Profiles whose bins are offset from each other, because their VRAD differ, are interpolated linearly: sufficient for
//! a first look, and used only there.

use super::LookError;
use crate::numerics::quantile::middle;
use crate::star::observation::{Observations, Profile};

/// Fewest bins that a line must have above half its depth.
const FEWEST_BINS: usize = 3;

/// A line shallower than this many standard errors of a bin of the mean is not significant.
const LEAST_SIGNIFICANCE: f64 = 5.0;

/// The inverse of the fraction of a profile that counts as one of its ends.
const ENDS: usize = 20;

/// Profiles with more of the largest depth left at their ends may not have the whole line.
const CUT: f64 = 0.1;

/// The mean of all profiles, on the bins that all of them have.
#[derive(Clone, Debug, PartialEq)]
pub struct MeanProfile {
    /// Velocity of the first bin (km/s).
    pub first_velocity_kms: f64,
    /// Width of a bin (km/s).
    pub step_kms: f64,
    /// Depth `1 - I` of each bin.
    pub depth: Vec<f64>,
    /// Standard error of a bin, from the quoted uncertainties (median over the bins).
    pub sigma: f64,
}

/// Velocities at which the line of a profile crosses half its depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfDepth {
    /// Velocity on the blue side (km/s).
    pub blue_kms: f64,
    /// Velocity on the red side (km/s).
    pub red_kms: f64,
}

impl HalfDepth {
    /// The middle (km/s).
    pub fn centre_kms(self) -> f64 {
        0.5 * (self.blue_kms + self.red_kms)
    }

    /// Half the distance of the two (km/s).
    pub fn half_width_kms(self) -> f64 {
        0.5 * (self.red_kms - self.blue_kms)
    }
}

impl MeanProfile {
    /// The mean of `observations`.
    ///
    /// # Errors
    /// If fewer than five bins are common to all profiles.
    pub fn of(observations: &Observations) -> Result<Self, LookError> {
        let step = observations.step_kms();
        let last = |p: &Profile| p.velocity_kms(p.intensity.len() - 1);
        let profiles = &observations.profiles;
        let first = profiles.iter().map(|p| p.first_velocity_kms).fold(f64::NEG_INFINITY, f64::max);
        let end = profiles.iter().map(last).fold(f64::INFINITY, f64::min);
        // rounding of VRAD may lose the last bin, that of this division does not
        let bins = ((end - first) / step + 1e-6).floor();
        if bins.is_nan() || bins < 4.0 {
            return Err(LookError::NothingInCommon);
        }
        let count = profiles.len() as f64;
        let velocities = (0..=bins as usize).map(|j| first + j as f64 * step);
        let depth = velocities.map(|v| profiles.iter().map(|p| 1.0 - p.intensity_at(v)).sum::<f64>() / count);
        let variance: f64 = profiles.iter().map(|p| middle(p.sigma.clone()).powi(2)).sum();
        Ok(MeanProfile {
            first_velocity_kms: first,
            step_kms: step,
            depth: depth.collect(),
            sigma: variance.sqrt() / count,
        })
    }

    /// Velocity of bin `j` (km/s).
    pub fn velocity_kms(&self, j: usize) -> f64 {
        self.first_velocity_kms + j as f64 * self.step_kms
    }

    /// Velocities of the first and the last bin (km/s).
    pub fn range_kms(&self) -> (f64, f64) {
        (self.first_velocity_kms, self.velocity_kms(self.depth.len() - 1))
    }

    /// The same within a range of velocities (km/s); at least its first bin remains.
    pub fn within(&self, from_kms: f64, to_kms: f64) -> Self {
        let slack = 1e-6 * self.step_kms;
        let inside = |j: &usize| (from_kms - slack..=to_kms + slack).contains(&self.velocity_kms(*j));
        let kept: Vec<usize> = (0..self.depth.len()).filter(inside).collect();
        let begin = kept.first().copied().unwrap_or(0);
        let end = kept.last().map_or(begin, |j| *j);
        MeanProfile {
            first_velocity_kms: self.velocity_kms(begin),
            depth: self.depth[begin..=end].to_vec(),
            ..self.clone()
        }
    }

    /// Mean depth of its ends: of the continuum, whatever its level, or of the outermost part of the line.
    fn at_its_ends(&self) -> f64 {
        let bins = (self.depth.len() / ENDS).max(1);
        let (first, last) = (&self.depth[..bins], &self.depth[self.depth.len() - bins..]);
        0.5 * (middle(first.to_vec()) + middle(last.to_vec()))
    }

    /// Level of the continuum, or of the outermost part of the line.
    pub fn level(&self) -> f64 {
        1.0 - self.at_its_ends()
    }

    /// Whether a tenth of the depth is left at the ends: of the line, or of a continuum that is not at 1.
    pub fn may_end_in_line(&self) -> bool {
        self.at_its_ends() > CUT * self.depth.iter().copied().fold(0.0, f64::max)
    }

    /// Uncertainty (km/s) of the middle of two crossings by the noise of the mean profile alone.
    pub fn centre_error_kms(&self, half_depth: HalfDepth) -> f64 {
        let deepest = self.depth.iter().copied().fold(0.0, f64::max);
        self.sigma / deepest * (self.step_kms * half_depth.half_width_kms()).sqrt()
    }

    /// The crossings of half the depth on either side of the deepest line.
    ///
    /// # Errors
    /// If there is no line, or it extends beyond the data.
    pub fn half_depth(&self) -> Result<HalfDepth, LookError> {
        let deepest = (0..self.depth.len()).max_by(|a, b| self.depth[*a].total_cmp(&self.depth[*b])).unwrap_or(0);
        let continuum = self.at_its_ends();
        let depth = self.depth[deepest] - continuum;
        if depth.is_nan() || depth < LEAST_SIGNIFICANCE * self.sigma {
            return Err(LookError::NoLine { depth, sigma: self.sigma });
        }
        let half = continuum + 0.5 * depth;
        let (from_kms, to_kms) = self.range_kms();
        let cut = || LookError::LineCut { from_kms, to_kms };
        let above = |j: &usize| self.depth[*j] > half;
        let blue = (0..deepest).rev().find(|j| !above(j)).ok_or_else(cut)?;
        let red = (deepest..self.depth.len()).find(|j| !above(j)).ok_or_else(cut)?;
        if red - blue <= FEWEST_BINS {
            return Err(LookError::LineTooNarrow { bins: red - blue - 1 });
        }
        // between the last bin below half the depth and its neighbour above it
        let crossing = |below: usize, above: usize| {
            let part = (half - self.depth[below]) / (self.depth[above] - self.depth[below]);
            self.velocity_kms(below) + part * (self.velocity_kms(above) - self.velocity_kms(below))
        };
        Ok(HalfDepth { blue_kms: crossing(blue, blue + 1), red_kms: crossing(red, red - 1) })
    }
}
