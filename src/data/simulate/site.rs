//! When a star can be observed from a place: the Sun below, the star above an altitude.
//!
//! Position of the Sun by the low-precision formulae of the Astronomical Almanac (section C), better than 0.02 degrees
//! from 1950 to 2050; sidereal time by the linear expression of the IAU 1982 model. Refraction, and the difference
//! between the barycentre's clock and the observatory's (up to eight minutes), are left out.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// J2000.
const J2000_JD: f64 = 2_451_545.0;

/// The sky is dark while the Sun is lower than this (degrees): between nautical and astronomical twilight.
const DARK_DEG: f64 = -15.0;

/// Steps per day, of five minutes.
const STEPS: usize = 288;

/// Julian dates that a night may have: 1900 to 2100.
const DATES_JD: [f64; 2] = [2_415_020.0, 2_488_070.0];

/// An observatory, and where the star stands in its sky.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Site {
    /// Geographic latitude (degrees), north positive.
    pub latitude_deg: f64,
    /// Geographic longitude (degrees), east positive.
    pub longitude_deg: f64,
    /// Right ascension of the star (degrees).
    pub right_ascension_deg: f64,
    /// Its declination (degrees).
    pub declination_deg: f64,
    /// Lowest altitude of the star (degrees): 30 is an airmass of 2.
    #[serde(default = "usual_altitude")]
    pub min_altitude_deg: f64,
    /// Julian date of time 0: what was subtracted from the times of the observations.
    #[serde(default)]
    pub time_zero_jd: f64,
}

fn usual_altitude() -> f64 {
    30.0
}

impl Site {
    /// The numbers out of range: key and error.
    pub fn fault(&self) -> Option<(&'static str, String)> {
        let within = |key, value: f64, [low, high]: [f64; 2]| {
            let is_within = (low..=high).contains(&value);
            (!is_within).then(|| (key, format!("{value} must be from {low} to {high}")))
        };
        within("latitude_deg", self.latitude_deg, [-90.0, 90.0])
            .or_else(|| within("longitude_deg", self.longitude_deg, [-180.0, 360.0]))
            .or_else(|| within("right_ascension_deg", self.right_ascension_deg, [0.0, 360.0]))
            .or_else(|| within("declination_deg", self.declination_deg, [-90.0, 90.0]))
            .or_else(|| within("min_altitude_deg", self.min_altitude_deg, [0.0, 89.0]))
            .or_else(|| within("time_zero_jd", self.time_zero_jd, [0.0, DATES_JD[1]]))
    }

    /// Whether a time (d) is one of this century or the last, as Julian dates are.
    pub fn has_date(&self, time_d: f64) -> bool {
        (DATES_JD[0]..=DATES_JD[1]).contains(&(self.time_zero_jd + time_d))
    }

    /// The longest time (d) without a break in which the star is observable in the night of `time_d`, from local noon
    /// to noon: first and last moment. `None` where it is not.
    pub fn window_d(&self, time_d: f64) -> Option<[f64; 2]> {
        let noon = self.night(time_d) as f64 - self.east();
        let time = |k: usize| noon + k as f64 / STEPS as f64;
        let mut best: Option<[usize; 2]> = None;
        let mut from = None;
        for k in 0..=STEPS {
            match (self.is_observable(time(k)) && k < STEPS, from) {
                (true, None) => from = Some(k),
                (false, Some(first)) => {
                    let longer = best.is_none_or(|[a, b]| k - 1 - first > b - a);
                    best = if longer { Some([first, k - 1]) } else { best };
                    from = None;
                }
                _ => {}
            }
        }
        best.map(|ends| ends.map(|k| time(k) - self.time_zero_jd))
    }

    /// Number of the night of `time_d`, from local noon to noon.
    pub fn night(&self, time_d: f64) -> i64 {
        // Julian days begin at noon in Greenwich
        (self.time_zero_jd + time_d + self.east()).floor() as i64
    }

    /// How many days earlier than in Greenwich noon is.
    fn east(&self) -> f64 {
        ((self.longitude_deg + 180.0).rem_euclid(360.0) - 180.0) / 360.0
    }

    fn is_observable(&self, jd: f64) -> bool {
        let sidereal_deg = 280.460_618_37 + 360.985_647_366_29 * (jd - J2000_JD) + self.longitude_deg;
        let [sun_ra, sun_dec] = sun_deg(jd);
        let altitude = |ra: f64, dec: f64| altitude_deg(self.latitude_deg, dec, sidereal_deg - ra);
        altitude(sun_ra, sun_dec) < DARK_DEG
            && altitude(self.right_ascension_deg, self.declination_deg) > self.min_altitude_deg
    }
}

/// Altitude (degrees) at an hour angle (degrees).
fn altitude_deg(latitude: f64, declination: f64, hour_angle: f64) -> f64 {
    let [latitude, declination, hour_angle] = [latitude, declination, hour_angle].map(f64::to_radians);
    let sine = latitude.sin() * declination.sin() + latitude.cos() * declination.cos() * hour_angle.cos();
    sine.clamp(-1.0, 1.0).asin().to_degrees()
}

/// Right ascension and declination of the Sun (degrees).
fn sun_deg(jd: f64) -> [f64; 2] {
    let n = jd - J2000_JD;
    let anomaly = (357.528 + 0.985_600_3 * n).to_radians();
    let longitude = 280.460 + 0.985_647_4 * n + 1.915 * anomaly.sin() + 0.020 * (2.0 * anomaly).sin();
    let (longitude, obliquity) = (longitude.to_radians(), (23.439 - 4e-7 * n).to_radians());
    let right_ascension = (obliquity.cos() * longitude.sin()).atan2(longitude.cos());
    [right_ascension, (obliquity.sin() * longitude.sin()).asin()].map(f64::to_degrees)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The Sun at the equinox and the solstice of 2026 (20 March 14:46 UT, 21 June 08:25 UT).
    #[test]
    fn the_sun_stands_where_it_should() {
        let [right_ascension, declination] = sun_deg(2_461_120.115);
        assert!(declination.abs() < 0.02 && right_ascension.abs() < 0.03, "{right_ascension} {declination}");
        let [right_ascension, declination] = sun_deg(2_461_212.851);
        assert!((declination - 23.44).abs() < 0.01 && (right_ascension - 90.0).abs() < 0.03, "{right_ascension}");
    }

    /// LO Peg from Pic du Midi in the middle of August: most of the night; in March never.
    #[test]
    fn a_star_of_summer_is_up_in_summer() {
        let site = Site {
            latitude_deg: 42.94,
            longitude_deg: 0.14,
            right_ascension_deg: 322.79,
            declination_deg: 23.34,
            min_altitude_deg: 30.0,
            time_zero_jd: 0.0,
        };
        let [first, last] = site.window_d(2_461_267.9).unwrap();
        let hours = 24.0 * (last - first);
        assert!((5.5..8.0).contains(&hours), "{hours}");
        // darkness begins after 20:30 UT, and ends before 04:00
        let of_day = |jd: f64| 24.0 * ((jd + 0.5).fract());
        assert!((20.3..21.5).contains(&of_day(first)) && (2.5..4.0).contains(&of_day(last)), "{first} {last}");
        // the same night, given by a time after midnight or with a constant subtracted
        assert_eq!(site.window_d(2_461_267.6), Some([first, last]));
        let less = Site { time_zero_jd: 2_400_000.5, ..site };
        let [a, _] = less.window_d(61_267.1).unwrap();
        assert!((a + 2_400_000.5 - first).abs() < 1e-6);
        assert_eq!(site.window_d(2_461_110.0), None);
        assert!(site.has_date(2_461_110.0) && !site.has_date(12.0));
        assert_eq!(site.fault(), None);
        assert_eq!(Site { latitude_deg: 430.0, ..site }.fault().unwrap().0, "latitude_deg");
    }
}
