//! The correlation of a coefficient in time (`docs/method.md` section 9), `k = f + (1 - f) (1 + a) exp(-a)` with `a =
//! sqrt(3) |t - t'| / lifetime`: Matern 3/2 plus a static share f.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// Lifetime of the field.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Lifetime {
    /// Static: the limit of long lifetimes.
    Static,
    /// Scale of the Matern 3/2 kernel (d).
    Days(f64),
}

impl Lifetime {
    /// In days; `None` if static.
    pub fn days(self) -> Option<f64> {
        match self {
            Lifetime::Static => None,
            Lifetime::Days(days) => Some(days),
        }
    }
}

/// Correlation in time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Kernel {
    /// Lifetime of the evolving part.
    pub lifetime: Lifetime,
    /// Share f, in [0, 1], of the variance that does not change.
    pub persistent: f64,
}

impl Kernel {
    /// A kernel without a static part.
    pub fn of(lifetime: Lifetime) -> Self {
        Kernel { lifetime, persistent: 0.0 }
    }

    /// Correlation of values so far (d) apart.
    pub fn at(&self, delay_d: f64) -> f64 {
        self.persistent + (1.0 - self.persistent) * self.changing(delay_d)
    }

    /// k between some times (rows) and others (d).
    pub(super) fn between(&self, times_d: &[f64], others_d: &[f64]) -> DMatrix<f64> {
        DMatrix::from_fn(times_d.len(), others_d.len(), |k, t| self.at(times_d[k] - others_d[t]))
    }

    /// Its derivative with respect to the logarithm of the lifetime.
    pub fn by_log_lifetime(&self, delay_d: f64) -> f64 {
        let Some(a) = self.scaled(delay_d) else { return 0.0 };
        (1.0 - self.persistent) * a * a * (-a).exp()
    }

    /// Its derivative with respect to the persistent share.
    pub fn by_persistent(&self, delay_d: f64) -> f64 {
        1.0 - self.changing(delay_d)
    }

    /// Whether the field is static.
    pub fn is_static(&self) -> bool {
        self.lifetime == Lifetime::Static || self.persistent == 1.0
    }

    /// Correlation of the evolving part.
    fn changing(&self, delay_d: f64) -> f64 {
        self.scaled(delay_d).map_or(1.0, |a| (1.0 + a) * (-a).exp())
    }

    /// `sqrt(3) |delay| / lifetime`; `None` for a static field.
    pub(super) fn scaled(&self, delay_d: f64) -> Option<f64> {
        match self.lifetime {
            Lifetime::Static => None,
            Lifetime::Days(days) => Some(3.0_f64.sqrt() * delay_d.abs() / days),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_lifetime_is_static_and_a_short_one_leaves_the_persistent_share() {
        let long = Kernel::of(Lifetime::Days(1e9));
        assert!((long.at(10.0) - Kernel::of(Lifetime::Static).at(10.0)).abs() < 1e-15);
        let short = Kernel { lifetime: Lifetime::Days(1e-3), persistent: 0.3 };
        assert_eq!(short.at(1.0), 0.3);
        assert_eq!(short.at(0.0), 1.0);
    }

    #[test]
    fn derivatives_are_those_of_differences() {
        let at = |lifetime: f64, persistent| Kernel { lifetime: Lifetime::Days(lifetime), persistent }.at(-4.0);
        let kernel = Kernel { lifetime: Lifetime::Days(7.0), persistent: 0.2 };
        let h = 1e-5_f64;
        let lifetime = (at(7.0 * h.exp(), 0.2) - at(7.0 * (-h).exp(), 0.2)) / (2.0 * h);
        assert!((kernel.by_log_lifetime(-4.0) - lifetime).abs() < 1e-9);
        let persistent = (at(7.0, 0.2 + h) - at(7.0, 0.2 - h)) / (2.0 * h);
        assert!((kernel.by_persistent(-4.0) - persistent).abs() < 1e-9);
    }
}
