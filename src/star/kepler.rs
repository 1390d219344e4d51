//! Kepler's equation, and the velocity of an eccentric orbit.
//!
//! `V = K (cos(nu + omega) + e cos omega)`, nu the true anomaly; with e = 0 it is the circular orbit.

use std::f64::consts::{PI, TAU};

/// Largest number of Newton steps; from this start a few are enough.
const STEPS: usize = 50;

/// The eccentric anomaly E of a mean anomaly (radians), `E - e sin E = M`, for `0 <= e < 1`; in the same turn as M.
pub fn eccentric_anomaly(mean_anomaly: f64, e: f64) -> f64 {
    let m = (mean_anomaly + PI).rem_euclid(TAU) - PI;
    // beyond the root on the side where the function is convex: Newton's steps approach it monotonically and never
    // leave the half turn
    let mut anomaly = if m >= 0.0 { (m + e).min(PI) } else { (m - e).max(-PI) };
    for _ in 0..STEPS {
        let step = (anomaly - e * anomaly.sin() - m) / (1.0 - e * anomaly.cos());
        anomaly -= step;
        if step.abs() < 1e-15 * anomaly.abs().max(1e-3) {
            break;
        }
    }
    anomaly + (mean_anomaly - m)
}

/// Cosine and sine of the true anomaly at a mean anomaly (radians).
pub fn true_anomaly(mean_anomaly: f64, e: f64) -> (f64, f64) {
    let (sin, cos) = eccentric_anomaly(mean_anomaly, e).sin_cos();
    let distance = 1.0 - e * cos;
    ((cos - e) / distance, (1.0 - e * e).sqrt() * sin / distance)
}

/// The mean anomaly (radians) at a true anomaly, in (-pi, pi].
pub fn mean_anomaly(true_anomaly: f64, e: f64) -> f64 {
    let (sin, cos) = true_anomaly.sin_cos();
    let (sin, cos) = ((1.0 - e * e).sqrt() * sin / (1.0 + e * cos), (cos + e) / (1.0 + e * cos));
    sin.atan2(cos) - e * sin
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn anomalies_solve_the_equation() {
        for e in [0.0, 1e-6, 0.1, 0.5, 0.9, 0.95] {
            for k in -4000..4000 {
                let m = k as f64 * 2.5e-3 + 1e-7;
                let anomaly = eccentric_anomaly(m, e);
                assert!((anomaly - e * anomaly.sin() - m).abs() < 1e-13, "{m} {e}: {anomaly}");
            }
        }
    }

    #[test]
    fn true_anomalies_lead_back() {
        for e in [0.0, 0.1, 0.6, 0.95] {
            for m in [-3.0, -0.7, 0.0, 0.2, 1.5, 3.1] {
                let (cos, sin) = true_anomaly(m, e);
                assert!((mean_anomaly(sin.atan2(cos), e) - m).abs() < 1e-12, "{m} {e}");
            }
        }
    }

    #[test]
    fn without_eccentricity_all_anomalies_agree() {
        for m in [-3.0, -0.1, 0.0, 2.0, 9.0] {
            let (cos, sin) = true_anomaly(m, 0.0);
            assert!((cos - m.cos()).abs() < 1e-15 && (sin - m.sin()).abs() < 1e-15);
        }
    }
}
