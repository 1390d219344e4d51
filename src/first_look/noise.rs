//! How noisy the profiles are: what their errors say, and what the continuum beside the line says.

use super::median;
use crate::observation::{Observations, Profile};

/// Fewest bins of continuum, in all profiles together, whose scatter means something.
const FEWEST_BINS: usize = 30;

/// Fewest bins of continuum of a profile that is counted.
const FEWEST_IN_PROFILE: usize = 4;

/// Only continuum nearer to the centre than this is asked, in units of the distance at which the line ends: farther out LSD
/// profiles ripple.
const OUTER: f64 = 2.0;

/// Errors of a bin in units of the continuum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// As quoted, median over all bins.
    pub quoted: f64,
    /// Scatter of the continuum about the mean of its own profile; `None` where there is too little of it.
    pub scatter: Option<f64>,
}

impl Noise {
    /// Errors of profiles whose line reaches `reach_kms` to either side of `centre_kms`.
    pub fn of(observations: &Observations, centre_kms: f64, reach_kms: f64) -> Self {
        let step = observations.step_kms;
        let beside = |profile: &Profile| -> Vec<f64> {
            let distance = |j: usize| (profile.velocity_kms(j, step) - centre_kms).abs();
            let bins = profile.intensity.iter().enumerate();
            bins.filter(|(j, _)| (reach_kms..=OUTER * reach_kms).contains(&distance(*j))).map(|(_, i)| *i).collect()
        };
        let (mut bins, mut freedom, mut square) = (0, 0, 0.0);
        for continuum in observations.profiles.iter().map(beside).filter(|c| c.len() >= FEWEST_IN_PROFILE) {
            let mean = continuum.iter().sum::<f64>() / continuum.len() as f64;
            square += continuum.iter().map(|i| (i - mean).powi(2)).sum::<f64>();
            bins += continuum.len();
            freedom += continuum.len() - 1;
        }
        let sigmas = observations.profiles.iter().flat_map(|p| p.sigma.iter().copied()).collect();
        Noise {
            quoted: median(sigmas),
            scatter: (bins >= FEWEST_BINS && square > 0.0).then(|| (square / freedom as f64).sqrt()),
        }
    }

    /// Scatter over quoted errors; `None` where there is no continuum to tell.
    pub fn ratio(&self) -> Option<f64> {
        self.scatter.map(|scatter| scatter / self.quoted)
    }
}
