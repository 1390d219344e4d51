//! Priors of single parameters: densities, bounds and draws, in the units of the parameter's name.
//!
//! Every density is normalised over its own bounds.

use rand::Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// The prior of one free parameter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "prior", rename_all = "kebab-case")]
pub enum Prior {
    /// Constant density.
    Uniform {
        /// Lower bound.
        min: f64,
        /// Upper bound.
        max: f64,
    },
    /// Density proportional to `1/x`.
    LogUniform {
        /// Lower bound, above 0.
        min: f64,
        /// Upper bound.
        max: f64,
    },
    /// A Gaussian cut off at the bounds, which may be infinite.
    Normal {
        /// Mean of the Gaussian before the cut.
        mean: f64,
        /// Standard deviation of the Gaussian before the cut.
        sd: f64,
        /// Lower bound.
        min: f64,
        /// Upper bound.
        max: f64,
    },
    /// An angle in degrees with density proportional to its sine: a random orientation.
    Isotropic {
        /// Lower bound (degrees).
        min: f64,
        /// Upper bound (degrees).
        max: f64,
    },
    /// One of the two coordinates of a point with uniform density in a disc around 0. The density of both is not the
    /// product: [`super::ParameterSpace`] has it.
    Disc {
        /// Square of the disc's radius: the largest eccentricity.
        max_eccentricity: f64,
    },
    /// Constant density on the circle `[0, 1)`; any real number stands for its fractional part.
    Periodic,
}

/// Kinds of priors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PriorKind {
    /// Constant between `min` and `max`.
    Uniform,
    /// Proportional to 1/x between `min` and `max`.
    LogUniform,
    /// A Gaussian of `mean` and `sd`, cut off at `min` and `max` if given.
    Normal,
    /// For `inclination_deg`: proportional to sin i, between `min` (0 if not given) and `max` (90).
    Isotropic,
    /// For `phi`: constant on the circle from 0 to 1.
    Periodic,
    /// For `sqrt_e_cos_omega` and `sqrt_e_sin_omega` together: constant on the disc in which the eccentricity is below
    /// `max` (1 if not given), that is, any eccentricity up to there and any argument of periastron alike.
    UnitDisc,
}

impl PriorKind {
    /// Its name in the config.
    pub fn name(self) -> &'static str {
        match self {
            PriorKind::Uniform => "uniform",
            PriorKind::LogUniform => "log-uniform",
            PriorKind::Normal => "normal",
            PriorKind::Isotropic => "isotropic",
            PriorKind::Periodic => "periodic",
            PriorKind::UnitDisc => "unit-disc",
        }
    }
}

impl Prior {
    /// Bounds of the support. That of [`Prior::Periodic`] is `[0, 1)`, of the others closed.
    pub fn bounds(&self) -> (f64, f64) {
        match *self {
            Prior::Uniform { min, max }
            | Prior::LogUniform { min, max }
            | Prior::Normal { min, max, .. }
            | Prior::Isotropic { min, max } => (min, max),
            Prior::Disc { max_eccentricity } => (-max_eccentricity.sqrt(), max_eccentricity.sqrt()),
            Prior::Periodic => (0.0, 1.0),
        }
    }

    /// Where it is densest, or the middle of its bounds.
    pub fn centre(&self) -> f64 {
        match *self {
            Prior::Normal { mean, min, max, .. } => mean.clamp(min, max),
            _ => 0.5 * (self.bounds().0 + self.bounds().1),
        }
    }

    /// Whether `x` has a density above zero (as far as the bounds go).
    pub fn contains(&self, x: f64) -> bool {
        let (min, max) = self.bounds();
        x.is_finite() && (matches!(self, Prior::Periodic) || (min <= x && x <= max))
    }

    /// `x` itself, or its representative in `[0, 1)` if the prior is periodic.
    pub fn wrap(&self, x: f64) -> f64 {
        if !matches!(self, Prior::Periodic) {
            return x;
        }
        // A tiny negative number has remainder 1 after rounding.
        let remainder = x.rem_euclid(1.0);
        if remainder >= 1.0 { 0.0 } else { remainder }
    }

    /// Natural logarithm of the density at `x`; minus infinity outside the bounds and for NaN.
    pub fn log_density(&self, x: f64) -> f64 {
        if !self.contains(x) {
            return f64::NEG_INFINITY;
        }
        match *self {
            Prior::Uniform { min, max } => -(max - min).ln(),
            Prior::LogUniform { min, max } => -x.ln() - (max / min).ln().ln(),
            Prior::Normal { mean, sd, min, max } => {
                let z = (x - mean) / sd;
                -0.5 * z * z - sd.ln() - Truncated::new((min - mean) / sd, (max - mean) / sd).log_integral()
            }
            Prior::Isotropic { min, max } => {
                let (a, b) = (min.to_radians(), max.to_radians());
                x.to_radians().sin().ln() + 1f64.to_radians().ln() - (a.cos() - b.cos()).ln()
            }
            Prior::Disc { max_eccentricity } => {
                (max_eccentricity - x * x).max(0.0).sqrt().ln() - (0.5 * PI * max_eccentricity).ln()
            }
            Prior::Periodic => 0.0,
        }
    }

    /// Mean and standard deviation, by the midpoint rule; those of a circle are those of its interval.
    pub fn mean_and_sd(&self) -> (f64, f64) {
        const CELLS: usize = 4000;
        let (lo, hi) = match *self {
            Prior::Normal { mean, sd, min, max } => {
                // the density is 0 beyond
                let reach = 10.0 * sd + (mean.clamp(min, max) - mean).abs();
                (min.max(mean - reach), max.min(mean + reach))
            }
            _ => self.bounds(),
        };
        let width = (hi - lo) / CELLS as f64;
        let at = |k: usize| lo + (k as f64 + 0.5) * width;
        let weight = |k: usize| self.log_density(at(k)).exp() * width;
        let total: f64 = (0..CELLS).map(weight).sum();
        let mean = (0..CELLS).map(|k| weight(k) * at(k)).sum::<f64>() / total;
        let variance = (0..CELLS).map(|k| weight(k) * (at(k) - mean).powi(2)).sum::<f64>() / total;
        (mean, variance.sqrt())
    }

    /// The same prior of `x / unit`.
    pub fn in_units_of(&self, unit: f64) -> Self {
        match *self {
            Prior::Uniform { min, max } => Prior::Uniform { min: min / unit, max: max / unit },
            Prior::LogUniform { min, max } => Prior::LogUniform { min: min / unit, max: max / unit },
            Prior::Normal { mean, sd, min, max } => {
                Prior::Normal { mean: mean / unit, sd: sd / unit, min: min / unit, max: max / unit }
            }
            Prior::Isotropic { .. } | Prior::Disc { .. } | Prior::Periodic => *self,
        }
    }

    /// A random draw, always within the bounds.
    pub fn sample(&self, rng: &mut impl Rng) -> f64 {
        let (lower, upper) = self.bounds();
        let draw = match *self {
            Prior::Uniform { min, max } => min + rng.random::<f64>() * (max - min),
            Prior::LogUniform { min, max } => min * (rng.random::<f64>() * (max / min).ln()).exp(),
            Prior::Normal { mean, sd, min, max } => {
                mean + sd * Truncated::new((min - mean) / sd, (max - mean) / sd).sample(rng)
            }
            Prior::Isotropic { min, max } => {
                let (a, b) = (min.to_radians().cos(), max.to_radians().cos());
                (a + rng.random::<f64>() * (b - a)).acos().to_degrees()
            }
            Prior::Disc { max_eccentricity } => {
                let (radius, angle) = ((max_eccentricity * rng.random::<f64>()).sqrt(), TAU * rng.random::<f64>());
                radius * angle.cos()
            }
            Prior::Periodic => return rng.random::<f64>(),
        };
        draw.clamp(lower, upper)
    }
}

/// A standard normal between two bounds, relative to its density at the mode `peak`, on the interval `[lo, hi]` outside
/// which that relative density is below `exp(-40)`.
struct Truncated {
    lo: f64,
    hi: f64,
    peak: f64,
}

impl Truncated {
    fn new(min: f64, max: f64) -> Self {
        let peak = 0f64.clamp(min, max);
        let reach = (peak * peak + 80.0).sqrt();
        Truncated { lo: min.max(-reach), hi: max.min(reach), peak }
    }

    /// `exp(-(z^2 - peak^2) / 2)`, at most 1.
    fn relative_density(&self, z: f64) -> f64 {
        (-0.5 * (z - self.peak) * (z + self.peak)).exp()
    }

    /// Logarithm of the integral of `exp(-z^2/2)` between the bounds: three-point Gauss-Legendre on 400 panels, none
    /// wider than 0.05, which leaves errors of 1e-12.
    fn log_integral(&self) -> f64 {
        const PANELS: usize = 400;
        let half = 0.5 * (self.hi - self.lo) / PANELS as f64;
        let offset = 0.6f64.sqrt() * half;
        let sum: f64 = (0..PANELS)
            .map(|k| {
                let middle = self.lo + (2 * k + 1) as f64 * half;
                let sides = self.relative_density(middle - offset) + self.relative_density(middle + offset);
                (5.0 * sides + 8.0 * self.relative_density(middle)) / 9.0
            })
            .sum();
        (half * sum).ln() - 0.5 * self.peak * self.peak
    }

    /// Rejection from a uniform envelope: at least one draw in 40 is kept, wherever the bounds are.
    fn sample(&self, rng: &mut impl Rng) -> f64 {
        loop {
            let z = self.lo + rng.random::<f64>() * (self.hi - self.lo);
            if rng.random::<f64>() <= self.relative_density(z) {
                return z;
            }
        }
    }
}

#[cfg(test)]
mod tests;
