//! Free parameters, their joint prior, and the sampling coordinates that samplers and optimisers move in.
//!
//! Where K and phi are both free they become `(K cos, K sin)` of the orbital phase at mid-time (`docs/method.md`
//! section 5): K near 0 and the wrap of phi are then no special case, and phi no longer hangs on the period.

use super::parameters::{Parameter, ParameterValues};
use super::prior::Prior;
use std::f64::consts::TAU;

/// A free parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreeParameter {
    /// Which.
    pub parameter: Parameter,
    /// Its prior, in the units of its name.
    pub prior: Prior,
}

/// The free parameters of a problem, and the values of the fixed ones.
#[derive(Clone, Debug)]
pub struct ParameterSpace {
    /// The free parameters in the order of [`Parameter::ALL`].
    free: Vec<FreeParameter>,
    /// Values of all; those of the free ones are where a search starts.
    values: ParameterValues,
    names: Vec<String>,
    /// Rotation cycle in the middle of the time base, and its length.
    mid_cycle: f64,
    time_base_cycles: f64,
    rotation_period_d: f64,
    /// Positions of K and phi among the free parameters, if both are.
    polar: Option<(usize, usize)>,
}

/// Smallest K (km/s) at which the Jacobian of the polar coordinates is told apart from that at K = 0.
const SMALLEST_K_KMS: f64 = 1e-9;

impl ParameterSpace {
    /// Of the given free parameters, the rest fixed at `values`; times span `time_base_cycles` around `mid_cycle`.
    pub fn new(
        mut free: Vec<FreeParameter>,
        values: ParameterValues,
        mid_cycle: f64,
        time_base_cycles: f64,
        rotation_period_d: f64,
    ) -> Self {
        free.sort_by_key(|f| f.parameter);
        let position = |p: Parameter| free.iter().position(|f| f.parameter == p);
        let polar = position(Parameter::K).zip(position(Parameter::Phi));
        let names = free.iter().map(|f| f.parameter.name().to_string()).collect();
        ParameterSpace { polar, names, free, values, mid_cycle, time_base_cycles, rotation_period_d }
    }

    /// The same with the field of `values` where it is fixed.
    pub fn with_field_of(mut self, values: &ParameterValues) -> Self {
        for p in Parameter::FIELD.into_iter().filter(|p| self.free.iter().all(|f| f.parameter != *p)) {
            self.values[p] = values[p];
        }
        self
    }

    /// Number of free parameters.
    pub fn dimension(&self) -> usize {
        self.free.len()
    }

    /// Their names.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The free parameters.
    pub fn free(&self) -> &[FreeParameter] {
        &self.free
    }

    /// Values of all parameters at `theta`.
    pub fn values_at(&self, theta: &[f64]) -> ParameterValues {
        let mut values = self.values;
        for (f, &x) in self.free.iter().zip(theta) {
            values[f.parameter] = x;
        }
        values
    }

    /// The free ones among `values`.
    pub fn theta_of(&self, values: &ParameterValues) -> Vec<f64> {
        self.free.iter().map(|f| values[f.parameter]).collect()
    }

    /// Where a search starts: the free parameters as given.
    pub fn start(&self) -> Vec<f64> {
        self.theta_of(&self.values)
    }

    /// Logarithm of the prior density at `theta`; minus infinity outside.
    pub fn log_prior(&self, theta: &[f64]) -> f64 {
        self.free.iter().zip(theta).map(|(f, &x)| f.prior.log_density(x)).sum()
    }

    /// A draw from the prior.
    pub fn sample_prior(&self, rng: &mut impl rand::Rng) -> Vec<f64> {
        self.free.iter().map(|f| f.prior.sample(rng)).collect()
    }

    /// Which free parameters are periodic (phase of the orbit).
    pub fn periodic(&self) -> Vec<bool> {
        self.free.iter().map(|f| f.prior == Prior::Periodic).collect()
    }

    /// Orbital phase angle at mid-time, but for phi.
    fn mid_angle(&self, theta: &[f64]) -> f64 {
        let period = self.free.iter().position(|f| f.parameter == Parameter::PorbOverProt);
        let period = period.map_or(self.values[Parameter::PorbOverProt], |i| theta[i]);
        TAU * self.mid_cycle / period
    }

    /// Internal coordinates of `theta`.
    pub fn to_sampling(&self, theta: &[f64]) -> Vec<f64> {
        let own = |(f, x): (&FreeParameter, &f64)| f.parameter.to_sampling(*x);
        let mut x: Vec<f64> = self.free.iter().zip(theta).map(own).collect();
        if let Some((k, phi)) = self.polar {
            let (sin, cos) = (self.mid_angle(theta) - TAU * theta[phi]).sin_cos();
            (x[k], x[phi]) = (theta[k] * cos, theta[k] * sin);
        }
        x
    }

    /// Written coordinates of `internal`, periodic ones wrapped.
    pub fn to_physical(&self, internal: &[f64]) -> Vec<f64> {
        let mut theta = internal.to_vec();
        if let Some((k, phi)) = self.polar {
            let (x, y) = (internal[k], internal[phi]);
            theta[k] = x.hypot(y);
            theta[phi] = (self.mid_angle(internal) - y.atan2(x)) / TAU;
            // phi has period 1 whatever its prior: bring it to where that one may contain it
            let (lowest, _) = self.free[phi].prior.bounds();
            theta[phi] -= (theta[phi] - lowest.max(-1e6)).floor();
        }
        for (f, x) in self.free.iter().zip(&mut theta) {
            *x = f.prior.wrap(f.parameter.to_physical(*x));
        }
        theta
    }

    /// ln |d(written) / d(internal)| at `theta`: `d(K, phi) = dx dy / (2 pi K)`, and logarithms of the field.
    pub fn log_jacobian(&self, theta: &[f64]) -> f64 {
        let own: f64 = self.free.iter().zip(theta).map(|(f, x)| f.parameter.log_jacobian(*x)).sum();
        own + self.polar.map_or(0.0, |(k, _)| -(TAU * theta[k].max(SMALLEST_K_KMS)).ln())
    }

    /// Steps of the sampling coordinates over which profiles change by a percent or so of their features: what
    /// numerical derivatives and a first trust region are scaled with.
    pub fn scales(&self) -> Vec<f64> {
        // a change of angular velocity that turns the star by this angle (rad) in half the time base
        let turn = 0.01;
        let omega = turn / (0.5 * self.time_base_cycles.max(0.1) * self.rotation_period_d);
        let scale = |f: &FreeParameter| match f.parameter {
            Parameter::K | Parameter::Vsys => 0.02,
            Parameter::Phi if self.polar.is_some() => 0.02,
            Parameter::Phi => 0.02,
            Parameter::PorbOverProt => {
                let period = self.values[Parameter::PorbOverProt];
                0.02 * period * period / (0.5 * self.time_base_cycles).max(0.1)
            }
            Parameter::OmegaEq => omega,
            Parameter::DOmega => 3.0 * omega,
            Parameter::Inclination => 0.5,
            Parameter::Vsini => 5e-4 * self.values[Parameter::Vsini],
            Parameter::LimbDarkening => 0.01,
            Parameter::LineSigma => 0.01 * self.values[Parameter::LineSigma],
            Parameter::EquivalentWidth => 2e-3 * self.values[Parameter::EquivalentWidth],
            Parameter::Contrast => 0.02,
            Parameter::SpotAmplitude | Parameter::SpotSlope => 0.05,
            Parameter::SpotLifetime => 0.1,
        };
        self.free.iter().map(scale).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    fn space() -> ParameterSpace {
        let uniform = |parameter, min, max| FreeParameter { parameter, prior: Prior::Uniform { min, max } };
        let free = vec![
            FreeParameter { parameter: Parameter::Phi, prior: Prior::Periodic },
            uniform(Parameter::K, 0.0, 0.3),
            uniform(Parameter::PorbOverProt, 0.5, 4.0),
        ];
        ParameterSpace::new(
            free,
            ParameterValues::of_eight([0.1, 1.7, 0.5, 2.0, 0.0, 38.0, 40.0, 0.0]),
            1.47,
            2.94,
            3.0,
        )
    }

    #[test]
    fn internal_and_written_coordinates_are_inverse_and_keep_the_orbit() {
        let space = space();
        assert_eq!(space.names(), ["k_kms", "porb_over_prot", "phi"]);
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        for _ in 0..200 {
            let theta = space.sample_prior(&mut rng);
            let back = space.to_physical(&space.to_sampling(&theta));
            for (a, b) in theta.iter().zip(&back) {
                assert!((a - b).abs() < 1e-9, "{theta:?} {back:?}");
            }
            // x is the velocity at mid-time
            let velocity = space.values_at(&theta).state().orbit.velocity_kms(1.47);
            assert!((space.to_sampling(&theta)[0] - velocity).abs() < 1e-12);
        }
    }

    #[test]
    fn jacobian_is_the_determinant() {
        let space = space();
        let theta = [0.12, 1.6, 0.3];
        let h = 1e-6;
        let column = |i: usize| {
            let shifted = |h: f64| {
                let mut t = theta;
                t[i] += h;
                space.to_sampling(&t)
            };
            let (plus, minus) = (shifted(h), shifted(-h));
            [0, 1, 2].map(|j| (plus[j] - minus[j]) / (2.0 * h))
        };
        let m = nalgebra::Matrix3::from_columns(&[column(0), column(1), column(2)].map(nalgebra::Vector3::from));
        assert!((m.determinant().abs().ln() + space.log_jacobian(&theta)).abs() < 1e-6);
    }
}
