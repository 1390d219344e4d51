//! Exposure times: the mean of a profile over its exposure, in which the star rotates, by Gauss-Legendre quadrature.
//! Line and continuum are averaged separately, as fluxes add, so that the response stays linear in the map
//! (`docs/method.md` section 1).
//!
//! Neglected: the change of the orbital velocity (the profile has that of mid-exposure, off by `(pi T / Porb)^2 / 6` of
//! K), and the evolution of spots.

use std::f64::consts::PI;

/// Exposures in which rotation moves a feature at the centre of the disc by less (velocity bins) are instants.
pub const SMALLEST_SHIFT_BINS: f64 = 0.1;

/// Longest exposure (rotations): beyond, a profile shows another side of the star at its end.
pub const LONGEST_ROTATIONS: f64 = 0.1;

/// An exposure of a profile, its time in the middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposure {
    /// Its length (d).
    pub length_d: f64,
    /// Number of samples; 1 for an instant.
    pub looks: usize,
}

/// Rotational smearing of a line, with the scales to compare it with.
#[derive(Clone, Copy, Debug)]
pub struct Smearing {
    /// Projected equatorial velocity (km/s).
    pub vsini_kms: f64,
    /// Angular velocity of the equator (rad/d).
    pub omega_eq_rad_d: f64,
    /// Width of a velocity bin (km/s).
    pub bin_kms: f64,
    /// Standard deviation of the narrower local line (km/s).
    pub line_sigma_kms: f64,
}

impl Smearing {
    /// Velocity change (km/s) of a feature at the centre of the disc in this time (d).
    fn shift_kms(&self, length_d: f64) -> f64 {
        self.vsini_kms.abs() * self.omega_eq_rad_d.abs() * length_d
    }

    /// An exposure of this length (d): one sample more than the smearing in standard deviations of the line, which
    /// keeps the profile of a point to 1e-3 of its depth; an instant where it moves less than a tenth of a bin.
    pub fn exposure(&self, length_d: f64) -> Exposure {
        let shift_kms = self.shift_kms(length_d);
        let looks = match shift_kms > SMALLEST_SHIFT_BINS * self.bin_kms {
            true => (shift_kms / self.line_sigma_kms).ceil() as usize + 1,
            false => 1,
        };
        Exposure { length_d, looks }
    }
}

impl Exposure {
    /// An instant.
    pub const INSTANT: Exposure = Exposure { length_d: 0.0, looks: 1 };

    /// Sampling times from its middle (d), and their weights, which sum to 1.
    pub fn looks(&self) -> Vec<(f64, f64)> {
        match self.looks {
            0 | 1 => vec![(0.0, 1.0)],
            looks => gauss_legendre(looks).into_iter().map(|(x, w)| (0.5 * self.length_d * x, w)).collect(),
        }
    }
}

/// Nodes in [-1, 1] and weights that sum to 1, exact for polynomials of degree `2 n - 1`.
fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    // Newton's method from Tricomi's estimate converges in a few steps
    const STEPS: usize = 20;
    let node = |i: usize| {
        let mut x = -(PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
        for _ in 0..STEPS {
            let (p, slope) = legendre(n, x);
            x -= p / slope;
        }
        let (_, slope) = legendre(n, x);
        (x, 1.0 / ((1.0 - x * x) * slope * slope))
    };
    (0..n).map(node).collect()
}

/// Legendre polynomial of degree `n` at `x`, and its derivative.
fn legendre(n: usize, x: f64) -> (f64, f64) {
    let (mut before, mut p) = (1.0, x);
    for k in 2..=n {
        let k = k as f64;
        (before, p) = (p, ((2.0 * k - 1.0) * x * p - (k - 1.0) * before) / k);
    }
    (p, n as f64 * (x * p - before) / (x * x - 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quadratures_are_exact_to_their_degree() {
        for n in 2..40 {
            let looks = Exposure { length_d: 2.0, looks: n }.looks();
            for power in 0..2 * n.min(12) {
                let sum: f64 = looks.iter().map(|(x, w)| w * x.powi(power as i32)).sum();
                let wanted = if power % 2 == 0 { 1.0 / (power + 1) as f64 } else { 0.0 };
                assert!((sum - wanted).abs() < 1e-14, "{n} {power}: {sum} {wanted}");
            }
        }
    }

    #[test]
    fn short_exposures_are_instants_and_a_gaussian_is_smeared_to_a_thousandth() {
        let smearing = Smearing { vsini_kms: 30.0, omega_eq_rad_d: 2.0, bin_kms: 1.8, line_sigma_kms: 3.0 };
        assert_eq!(smearing.exposure(0.0029), Exposure { length_d: 0.0029, looks: 1 });
        assert_eq!(smearing.exposure(0.0031).looks, 2);
        for length_d in [0.0031, 0.03, 0.05, 0.1, 0.2, 0.3] {
            let exposure = smearing.exposure(length_d);
            let shift = 60.0 / 3.0;
            let line = |t: f64, v: f64| (-0.5 * (v - shift * t).powi(2)).exp();
            for v in (0..60).map(|j| 0.1 * f64::from(j)) {
                let smeared: f64 = exposure.looks().iter().map(|(t, w)| w * line(*t, v)).sum();
                let fine = (0..2000).map(|j| ((f64::from(j) + 0.5) / 2000.0 - 0.5) * length_d);
                let wanted = fine.map(|t| line(t, v)).sum::<f64>() / 2000.0;
                assert!((smeared - wanted).abs() < 1e-3, "{length_d} {v}: {smeared} {wanted}");
            }
        }
    }
}
