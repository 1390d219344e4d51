//! Projections of the stellar surface: flattened polar (equidistant: colatitude is the distance from the pole, as in
//! most published Doppler images) and Mollweide (equal areas).
//!
//! Both show the star as seen from its upper side. In the polar one the observer of cycle 0 is below the picture:
//! longitude 0 is at the bottom and longitudes increase anticlockwise, in the direction of rotation; the phase at which
//! a longitude faces the observer increases clockwise. In Mollweide's, longitudes increase to the right, with 180
//! degrees in the middle.

use crate::figures::drawing::Point;
use std::f64::consts::{FRAC_PI_2, PI, SQRT_2};

/// The southernmost latitude of the polar projection (degrees).
pub const SOUTHERNMOST_DEG: f64 = -30.0;

/// A projection onto the page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Flattened polar, down to -30 degrees.
    Polar {
        /// The pole (pt).
        centre: Point,
        /// Distance from there to latitude -30 degrees (pt).
        radius: f64,
    },
    /// Mollweide.
    Mollweide {
        /// Longitude 180 degrees on the equator (pt).
        centre: Point,
        /// Half the height (pt); half the width is twice as much.
        radius: f64,
    },
}

impl Projection {
    /// The position of a longitude and latitude (degrees) on the page.
    pub fn place(&self, longitude_deg: f64, latitude_deg: f64) -> Point {
        match *self {
            Projection::Polar { centre, radius } => {
                let r = radius * (90.0 - latitude_deg) / (90.0 - SOUTHERNMOST_DEG);
                let (sin, cos) = longitude_deg.to_radians().sin_cos();
                [centre[0] + r * sin, centre[1] + r * cos]
            }
            Projection::Mollweide { centre, radius } => {
                let theta = auxiliary(latitude_deg.to_radians());
                let x = 2.0 * (longitude_deg - 180.0) / 180.0 * theta.cos();
                [centre[0] + radius * x, centre[1] - radius * theta.sin()]
            }
        }
    }

    /// Whether a latitude (degrees) is shown.
    pub fn shows(&self, latitude_deg: f64) -> bool {
        matches!(self, Projection::Mollweide { .. }) || latitude_deg >= SOUTHERNMOST_DEG
    }

    /// The outline of a rectangle in longitude and latitude (degrees); parts too far south are cut off.
    pub fn patch(&self, longitude: [f64; 2], latitude: [f64; 2]) -> Vec<Point> {
        let south = if let Projection::Polar { .. } = self { latitude[0].max(SOUTHERNMOST_DEG) } else { latitude[0] };
        let north = latitude[1].max(south);
        let along = steps(longitude[1] - longitude[0], 4.0);
        let up = steps(north - south, 4.0);
        let lon = |t: f64| longitude[0] + t * (longitude[1] - longitude[0]);
        let lat = |t: f64| south + t * (north - south);
        // every side without its end, where the next one begins
        let below = along.iter().map(|t| self.place(lon(*t), south)).take(along.len() - 1);
        let right = up.iter().map(|t| self.place(longitude[1], lat(*t))).take(up.len() - 1);
        let above = along.iter().rev().map(|t| self.place(lon(*t), north)).take(along.len() - 1);
        let left = up.iter().rev().map(|t| self.place(longitude[0], lat(*t))).take(up.len() - 1);
        below.chain(right).chain(above).chain(left).collect()
    }
}

/// Fractions from 0 to 1 in steps of at most `longest` of `extent`.
fn steps(extent: f64, longest: f64) -> Vec<f64> {
    let count = (extent.abs() / longest).ceil().max(1.0) as usize;
    (0..=count).map(|k| k as f64 / count as f64).collect()
}

/// Mollweide's auxiliary angle: 2 theta + sin 2 theta = pi sin(latitude), by Newton steps.
fn auxiliary(latitude: f64) -> f64 {
    if FRAC_PI_2 - latitude.abs() < 1e-9 {
        return latitude.signum() * FRAC_PI_2;
    }
    let goal = PI * latitude.sin();
    // close to the poles the root is a cube root: the iteration begins beyond it
    let mut theta = latitude * (1.0 - 0.2 * (latitude / FRAC_PI_2).powi(2) / SQRT_2);
    for _ in 0..60 {
        let slope = 2.0 + 2.0 * (2.0 * theta).cos();
        let step = (2.0 * theta + (2.0 * theta).sin() - goal) / slope.max(1e-12);
        theta = (theta - step).clamp(-FRAC_PI_2, FRAC_PI_2);
        if step.abs() < 1e-12 {
            break;
        }
    }
    theta
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn longitudes_run_anticlockwise_from_the_bottom() {
        let polar = Projection::Polar { centre: [100.0, 100.0], radius: 60.0 };
        for ([longitude, latitude], place) in [
            ([0.0, 90.0], [100.0, 100.0]),
            ([0.0, 0.0], [100.0, 145.0]),
            ([90.0, 30.0], [130.0, 100.0]),
            ([180.0, -30.0], [100.0, 40.0]),
            ([270.0, 60.0], [85.0, 100.0]),
        ] {
            let found = polar.place(longitude, latitude);
            assert!((found[0] - place[0]).abs() < 1e-9 && (found[1] - place[1]).abs() < 1e-9, "{longitude} {latitude}");
        }
    }

    #[test]
    fn mollweide_keeps_areas() {
        let radius = 10.0;
        let mollweide = Projection::Mollweide { centre: [0.0, 0.0], radius };
        for south in [-90.0, -75.0, -30.0, 0.0, 45.0, 80.0_f64] {
            let north: f64 = south + 10.0;
            // in narrow bands, whose sides are straight even at the poles
            let area = |k: u32| -> f64 {
                let latitudes = [0.05 * f64::from(k), 0.05 * f64::from(k + 1)].map(|up| south + up);
                let outline = mollweide.patch([20.0, 50.0], latitudes);
                let next = outline.iter().cycle().skip(1);
                outline.iter().zip(next).map(|(a, b)| 0.5 * (a[0] * b[1] - b[0] * a[1])).sum::<f64>()
            };
            let area: f64 = (0..200).map(area).sum();
            let share = (north.to_radians().sin() - south.to_radians().sin()) / 2.0 * 30.0 / 360.0;
            let whole = 2.0 * PI * radius * radius;
            assert!((area.abs() / whole / share - 1.0).abs() < 1e-3, "from {south}: {} {share}", area.abs() / whole);
        }
        assert_eq!(mollweide.place(180.0, 90.0), [0.0, -10.0]);
        assert_eq!(mollweide.place(0.0, 0.0), [-20.0, 0.0]);
    }
}
