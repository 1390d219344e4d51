//! Quantiles of priors: from the unit interval to a parameter, for nested samplers.

use super::prior::Prior;
use crate::numerics::normal::cumulative;

/// Bisections after which no double remains in between.
const HALVINGS: usize = 80;

/// Standard deviations beyond which tail probabilities underflow a double.
const REACH: f64 = 38.0;

impl Prior {
    /// The value below which a fraction `u` of the prior lies, in the units of the parameter; always within the bounds.
    ///
    /// `u` is from 0 to 1; what is outside counts as the nearer of both.
    pub fn quantile(&self, u: f64) -> f64 {
        let u = u.clamp(0.0, 1.0);
        let (low, high) = self.bounds();
        let value = match *self {
            Prior::Uniform { min, max } => min + u * (max - min),
            Prior::LogUniform { min, max } => min * (u * (max / min).ln()).exp(),
            Prior::Normal { mean, sd, min, max } => mean + sd * normal_between((min - mean) / sd, (max - mean) / sd, u),
            Prior::Isotropic { min, max } => {
                let (a, b) = (min.to_radians().cos(), max.to_radians().cos());
                (a + u * (b - a)).acos().to_degrees()
            }
            Prior::Disc { max_eccentricity } => max_eccentricity.sqrt() * in_disc(u),
            Prior::Periodic => return self.wrap(u),
        };
        value.clamp(low, high)
    }
}

/// The quantile of one coordinate of a point in the unit disc, by bisection: the fraction below x is `1/2 + (x sqrt(1 -
/// x^2) + asin x) / pi`.
fn in_disc(u: f64) -> f64 {
    let (mut low, mut high) = (-1.0_f64, 1.0_f64);
    for _ in 0..HALVINGS {
        let x = 0.5 * (low + high);
        let below = 0.5 + (x * (1.0 - x * x).sqrt() + x.asin()) / std::f64::consts::PI;
        if below < u { low = x } else { high = x }
    }
    0.5 * (low + high)
}

/// The quantile of a standard normal deviate between two bounds, by bisection.
fn normal_between(low: f64, high: f64, u: f64) -> f64 {
    // in the lower tail probabilities keep their digits
    if low > 0.0 {
        return -normal_between(-high, -low, 1.0 - u);
    }
    let (below, within) = (cumulative(low), cumulative(high) - cumulative(low));
    let (mut low, mut high) = (low.max(-REACH), high.min(REACH));
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if cumulative(middle) - below < u * within {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The fraction below a value, by the midpoint rule from the lowest relevant value.
    fn share_below(prior: &Prior, low: f64, value: f64) -> f64 {
        const CELLS: usize = 40_000;
        let width = (value - low) / CELLS as f64;
        (0..CELLS).map(|k| prior.log_density(low + (k as f64 + 0.5) * width).exp() * width).sum()
    }

    #[test]
    fn quantiles_are_the_inverse_of_the_integrated_density() {
        let examples = [
            (Prior::Uniform { min: -1.5, max: 0.3 }, -1.5),
            (Prior::LogUniform { min: 0.01, max: 4.0 }, 0.01),
            (Prior::Normal { mean: 40.0, sd: 0.5, min: f64::NEG_INFINITY, max: f64::INFINITY }, 35.0),
            (Prior::Normal { mean: 0.05, sd: 0.1, min: 0.0, max: 0.3 }, 0.0),
            // twenty standard deviations away from its mean
            (Prior::Normal { mean: -2.0, sd: 0.1, min: 0.0, max: f64::INFINITY }, 0.0),
            (Prior::Normal { mean: 2.0, sd: 0.1, min: f64::NEG_INFINITY, max: 0.0 }, -0.2),
            (Prior::Isotropic { min: 20.0, max: 55.0 }, 20.0),
            (Prior::Disc { max_eccentricity: 0.49 }, -0.7),
            (Prior::Periodic, 0.0),
        ];
        for (prior, low) in examples {
            for u in [0.001, 0.1, 0.5, 0.9, 0.999] {
                let value = prior.quantile(u);
                // the midpoint rule on 1/x over these cells is accurate to 1e-6
                assert!((share_below(&prior, low, value) - u).abs() < 3e-6, "{prior:?} at {u}: {value}");
            }
            let ends = [0.0, 1.0, -0.5, 1.5].map(|u| prior.quantile(u));
            assert!(ends.iter().all(|end| prior.contains(*end) || end.is_infinite()), "{prior:?}: {ends:?}");
        }
        // any number is equivalent to its fractional part
        assert_eq!(Prior::Periodic.quantile(1.0), 0.0);
    }
}
