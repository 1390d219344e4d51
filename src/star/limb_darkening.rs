//! Limb darkening `LD(mu)`, normalised to 1 at the centre of the disc.

/// A limb-darkening law with its coefficients.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LimbDarkening {
    /// `1 - u (1 - mu)`
    Linear(f64),
    /// `1 - a (1 - mu) - b (1 - mu)^2`
    Quadratic(f64, f64),
}

impl LimbDarkening {
    /// The two coefficients of `1 - a (1 - mu) - b (1 - mu)^2`.
    pub fn coefficients(self) -> (f64, f64) {
        match self {
            LimbDarkening::Linear(u) => (u, 0.0),
            LimbDarkening::Quadratic(a, b) => (a, b),
        }
    }

    /// Coefficients of mu, mu^2, mu^3 and mu^4 in `mu LD(mu)`; or in `mu (1 - mu) LD(mu)`, which weights the limb.
    pub(super) fn of_mu(self, limb_alone: bool) -> [f64; 4] {
        // mu (1 - u1 (1 - mu) - u2 (1 - mu)^2)
        let (u1, u2) = self.coefficients();
        let [a, b, c] = [1.0 - u1 - u2, u1 + 2.0 * u2, -u2];
        match limb_alone {
            false => [a, b, c, 0.0],
            true => [a, b - a, c - b, -c],
        }
    }

    /// The same law with another first coefficient.
    pub fn with_first(self, coefficient: f64) -> Self {
        match self {
            LimbDarkening::Linear(_) => LimbDarkening::Linear(coefficient),
            LimbDarkening::Quadratic(_, b) => LimbDarkening::Quadratic(coefficient, b),
        }
    }

    /// Whether `1 - a x - b x^2` is positive for `x = 1 - mu` from 0 to the limb (where it may be 0).
    pub fn is_positive(self) -> bool {
        let (a, b) = self.coefficients();
        let limb = 1.0 - a - b;
        let turning = -a / (2.0 * b);
        let has_minimum_inside = b < 0.0 && turning > 0.0 && turning < 1.0;
        // Rounding of 1 - a - b where a and b sum to 1.
        limb >= -1e-12 && (!has_minimum_inside || 1.0 + a * a / (4.0 * b) > 0.0)
    }

    /// Intensity relative to the disc centre at `mu` = cosine of the angle to the line of sight.
    pub fn at(self, mu: f64) -> f64 {
        let (a, b) = self.coefficients();
        let x = 1.0 - mu;
        1.0 - x * (a + b * x)
    }
}

#[cfg(test)]
mod tests {
    use super::LimbDarkening;

    #[test]
    fn limb_darkening_is_positive_where_it_should_be() {
        for (a, b, fine) in [
            (0.4, 0.3, true),
            (0.7, 0.3, true),
            (0.8, 0.3, false),
            (1.5, -0.5, true),
            (2.5, -1.5, false),
            (-0.2, 0.0, true),
            (0.0, 0.0, true),
            (3.0, -2.9, true),
            (3.5, -2.9, false),
        ] {
            assert_eq!(LimbDarkening::Quadratic(a, b).is_positive(), fine, "{a} {b}");
            let least = (0..1000).map(|k| k as f64 / 1000.0).map(|x| 1.0 - a * x - b * x * x).fold(f64::MAX, f64::min);
            assert_eq!(least > 0.0, fine, "{a} {b}: {least}");
        }
    }
}
