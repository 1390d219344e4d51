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
    /// Velocities below this are in m/s.
    const SMALL_KMS: f64 = 1.0;

    /// Those of a star.
    pub const KMS: Speeds = Speeds { factor: 1.0, name: "km/s" };

    /// m/s for small ones.
    pub fn of(kms: &[f64]) -> Self {
        let largest = kms.iter().filter(|x| x.is_finite()).fold(0.0, |largest: f64, x| largest.max(x.abs()));
        if largest < Self::SMALL_KMS { Speeds { factor: 1e3, name: "m/s" } } else { Speeds::KMS }
    }

    /// A velocity (km/s) in a column of a table: to 1 m/s, or 0.1 m/s below 10. `-` where there is none.
    pub fn cell(self, kms: Option<f64>) -> String {
        let digits = |kms: f64| match self == Speeds::KMS {
            true => 3,
            false => usize::from(kms != 0.0 && kms.abs() < 0.01),
        };
        kms.map_or_else(|| "-".to_owned(), |kms| format!("{:.1$}", self.factor * kms, digits(kms)))
    }
}

/// A velocity (km/s) without an uncertainty, as in a table, with its unit.
pub fn with_unit(kms: f64) -> String {
    let unit = Speeds::of(&[kms]);
    format!("{} {}", unit.cell(Some(kms)), unit.name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_velocities_are_in_metres() {
        let unit = Speeds::of(&[0.0024, 0.3, f64::INFINITY, f64::NAN]);
        assert_eq!(unit.name, "m/s");
        assert_eq!([Some(0.0024), Some(0.3), None].map(|kms| unit.cell(kms)), ["2.4", "300", "-"]);
        assert_eq!([0.0, 0.0024, 0.058, 1.3334].map(with_unit), ["0 m/s", "2.4 m/s", "58 m/s", "1.333 km/s"]);
        let unit = Speeds::of(&[1.6]);
        assert_eq!((unit, unit.cell(Some(0.0024))), (Speeds::KMS, "0.002".to_owned()));
    }
}
