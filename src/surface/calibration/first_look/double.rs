//! Double lines: profiles whose line is much broader at some times than at others.
//!
//! Spots move the edges of a line by a few percent of its width (3 % on LO Peg, 9 % on simulated stars with the largest
//! spots); the line of a companion that moves through that of the star, or beside it, by tens of percent.

use super::mean::MeanProfile;
use crate::numerics::quantile::{middle, quantile};
use crate::star::observation::{Observations, Profile};

/// The line ends where its depth is this fraction of that of the mean profile.
const DEPTH: f64 = 0.25;

/// Widths that differ by more than this fraction of the usual one indicate two lines.
const DIFFERENCE: f64 = 0.15;

/// Fewest profiles that show it.
const FEWEST: usize = 4;

/// Bins are averaged over so many standard deviations of the local line on either side.
const SMOOTHING: f64 = 1.0;

/// The edges are measured where the noise of an average is below this fraction of the depth there.
const NOISE: f64 = 0.2;

/// Widths of the line (km/s): a tenth of the profiles have a narrower one, a tenth a broader one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DoubleLines {
    /// The narrow one.
    pub narrow_kms: f64,
    /// The broad one.
    pub broad_kms: f64,
}

impl DoubleLines {
    /// For profiles in units of their continuum, whose observed local line has the width `sigma_kms`; `None` where the
    /// line has the same width at all times, or the noise hides its edges.
    pub fn of(observations: &Observations, sigma_kms: f64) -> Option<Self> {
        let mean = MeanProfile::of(observations).ok()?;
        let half = (SMOOTHING * sigma_kms / mean.step_kms).round() as usize;
        let depth = DEPTH * seen(&mean.depth, half).into_iter().reduce(f64::max)?;
        let noise = |profile: &Profile| middle(profile.sigma.clone()) / ((2 * half + 1) as f64).sqrt();
        let profiles = &observations.profiles;
        if profiles.len() < FEWEST || profiles.iter().any(|profile| noise(profile) > NOISE * depth) {
            return None;
        }
        let mut widths =
            profiles.iter().map(|profile| width_kms(profile, half, depth)).collect::<Option<Vec<f64>>>()?;
        widths.sort_by(f64::total_cmp);
        let [narrow_kms, usual, broad_kms] = [0.1, 0.5, 0.9].map(|part| quantile(&widths, part));
        (broad_kms - narrow_kms > DIFFERENCE * usual).then_some(DoubleLines { narrow_kms, broad_kms })
    }

    /// The message.
    pub fn text(&self) -> String {
        let DoubleLines { narrow_kms, broad_kms } = self;
        format!(
            "the line is {narrow_kms:.0} to {broad_kms:.0} km/s wide from profile to profile, more than spots \
            explain: the profiles look like those of a double-lined binary, which the model of one star does not fit. \
            Take out the line of the companion, or leave out the profiles where it shows"
        )
    }
}

/// Each bin averaged with its neighbours, above the straight line through the ends: continua may be offset and tilted.
fn seen(depth: &[f64], half: usize) -> Vec<f64> {
    let around = |j: usize| &depth[j.saturating_sub(half)..(j + half + 1).min(depth.len())];
    let smooth: Vec<f64> = (0..depth.len()).map(|j| around(j).iter().sum::<f64>() / around(j).len() as f64).collect();
    let (Some(first), Some(last)) = (smooth.first(), smooth.last()) else { return smooth };
    let along = |j: usize| j as f64 / (smooth.len() - 1).max(1) as f64;
    smooth.iter().enumerate().map(|(j, depth)| depth - first - along(j) * (last - first)).collect()
}

/// Width between the outermost bins that are deeper than `depth`, interpolated within a bin, limited by the data.
fn width_kms(profile: &Profile, half: usize, depth: f64) -> Option<f64> {
    let depths: Vec<f64> = profile.intensity.iter().map(|intensity| 1.0 - intensity).collect();
    let smooth = seen(&depths, half);
    let deep = |j: &usize| smooth[*j] > depth;
    let (first, last) = ((0..smooth.len()).find(deep)?, (0..smooth.len()).rev().find(deep)?);
    let beyond = |inside: usize, outside: Option<&f64>| {
        outside.map_or(0.0, |outside| (smooth[inside] - depth) / (smooth[inside] - outside))
    };
    let before = first.checked_sub(1).and_then(|j| smooth.get(j));
    Some(((last - first) as f64 + beyond(first, before) + beyond(last, smooth.get(last + 1))) * profile.step_kms)
}
