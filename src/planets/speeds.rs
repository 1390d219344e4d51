//! The unit in which velocities are printed and drawn.

/// What a velocity in km/s is multiplied by, and the unit then.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Speeds {
    /// What a velocity in km/s is multiplied by.
    pub factor: f64,
    /// The unit.
    pub name: &'static str,
}

impl Speeds {
    /// Velocities up to this are in m/s.
    const SMALL_KMS: f64 = 1.5;

    /// Those of a star.
    pub const KMS: Speeds = Speeds { factor: 1.0, name: "km/s" };

    /// m/s for small ones.
    pub fn of(kms: &[f64]) -> Self {
        let largest = kms.iter().filter(|x| x.is_finite()).fold(0.0, |largest: f64, x| largest.max(x.abs()));
        if largest < Self::SMALL_KMS { Speeds { factor: 1e3, name: "m/s" } } else { Speeds::KMS }
    }

    /// A velocity (km/s) in a column of a table: to 1 m/s, or to 0.001 km/s. `-` where there is none.
    pub fn cell(self, kms: Option<f64>) -> String {
        let digits = if self == Speeds::KMS { 3 } else { 0 };
        kms.map_or_else(|| "-".to_owned(), |kms| format!("{:.digits$}", self.factor * kms))
    }
}
