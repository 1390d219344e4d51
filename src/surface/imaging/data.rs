//! The observed depths and the weights of their bins: the input of the misfit.

use crate::numerics::vector::Instructions;
use crate::star::observation::Observations;
use crate::surface::nuisances::Nuisances;
use std::ops::Range;

/// Data in the form of the misfit.
#[derive(Clone, Debug)]
pub struct Data {
    /// Observed depth `1 - I` of every bin.
    pub depth: Vec<f64>,
    /// `1 / sigma^2` of every bin.
    pub inverse_variance: Vec<f64>,
    /// Number of bins over which their noise is correlated, included in the uncertainties; 1 for white noise.
    pub correlated_bins: f64,
    /// Errors of each profile by itself, marginalised over.
    pub nuisances: Nuisances,
}

impl Data {
    /// Depths and weights of all profiles, one after the other.
    pub fn of(observations: &Observations) -> Self {
        let profiles = || observations.profiles.iter();
        Data {
            depth: profiles().flat_map(|p| p.intensity.iter().map(|i| 1.0 - i)).collect(),
            inverse_variance: profiles().flat_map(|p| p.sigma.iter().map(|s| 1.0 / (s * s))).collect(),
            correlated_bins: 1.0,
            nuisances: Nuisances::default(),
        }
    }

    /// The data of the profiles with these `bins` alone.
    pub fn of_profiles(&self, profiles: &[Range<usize>]) -> Self {
        let of = |x: &[f64]| profiles.iter().flat_map(|bins| x[bins.clone()].to_vec()).collect::<Vec<f64>>();
        let inverse_variance = of(&self.inverse_variance);
        let sigma: Vec<f64> = inverse_variance.iter().map(|w| w.sqrt().recip()).collect();
        let nuisances = self.nuisances.of_profiles(profiles, &sigma);
        Data { depth: of(&self.depth), inverse_variance, correlated_bins: self.correlated_bins, nuisances }
    }

    /// The same with the uncertainties of each profile, which has these `bins`, times its factor.
    pub fn with_larger_errors(&self, profiles: &[Range<usize>], factors: &[f64]) -> Self {
        let mut larger = self.clone();
        for (bins, factor) in profiles.iter().zip(factors) {
            larger.inverse_variance[bins.clone()].iter_mut().for_each(|weight| *weight /= factor * factor);
        }
        larger.of_profiles(profiles)
    }

    /// Sets `out = W x` in the `bins` of one profile, W the inverse of their covariance: each profile's weights involve
    /// only its bins.
    #[inline(always)]
    pub fn weigh(&self, i: impl Instructions, bins: Range<usize>, x: &[f64], out: &mut [f64]) {
        let weights = x[bins.clone()].iter().zip(&self.inverse_variance[bins.clone()]);
        out[bins.clone()].iter_mut().zip(weights).for_each(|(out, (x, weight))| *out = x * weight);
        self.nuisances.weigh(i, bins, x, out);
    }

    /// Sets `out = R x` in the `bins` of one profile, `R^t R = W`.
    pub fn weigh_root(&self, bins: Range<usize>, x: &[f64], out: &mut [f64]) {
        for j in bins.clone() {
            out[j] = x[j] * self.inverse_variance[j].sqrt();
        }
        self.nuisances.weigh_root(bins, x, out);
    }
}
