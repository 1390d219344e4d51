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

    /// Intensity relative to the disc centre at `mu` = cosine of the angle to the line of sight.
    pub fn at(self, mu: f64) -> f64 {
        let (a, b) = self.coefficients();
        let x = 1.0 - mu;
        1.0 - x * (a + b * x)
    }
}
