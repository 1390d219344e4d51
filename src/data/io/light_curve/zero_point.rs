//! The time systems of a light curve and of the profiles.

use super::Measurements;
use super::columns::{BKJD, BTJD, MJD, RJD};

/// Time systems in use: their names, and their origins as Julian dates.
const COUNTS: [(&str, f64); 6] = [
    ("JD", 0.0),
    ("TESS's BTJD (BJD - 2457000)", BTJD),
    ("Kepler's BKJD (BJD - 2454833)", BKJD),
    ("MJD (JD - 2400000.5)", MJD),
    ("JD - 2400000", RJD),
    ("JD - 2450000", 2_450_000.0),
];

/// What has to be added to times (d) to bring one of them within `near_d` of one of the profiles', if one of these time
/// systems was mistaken for another: names of both, and the shift.
pub fn fitting(times_d: &[f64], of_profiles: &[f64], near_d: f64) -> Option<([&'static str; 2], f64)> {
    let pairs = COUNTS.iter().flat_map(|own| COUNTS.iter().map(move |other| (own, other)));
    let add = |((own, from), (other, to)): (&(&'static str, f64), &(&'static str, f64))| ([*own, *other], from - to);
    pairs.map(add).find(|(_, add)| *add != 0.0 && distance(times_d, *add, of_profiles) <= near_d)
}

/// The least distance (d) of times, moved, from those of profiles.
fn distance(times_d: &[f64], moved_d: f64, of_profiles: &[f64]) -> f64 {
    let least = |times: &mut dyn Iterator<Item = f64>| times.fold(f64::INFINITY, f64::min);
    let nearest = |time: f64| least(&mut of_profiles.iter().map(|one| (one - time - moved_d).abs()));
    least(&mut times_d.iter().map(|time| nearest(*time)))
}

impl Measurements {
    /// Converts times to the time system of profiles at these times (d), where the table gives its own.
    pub fn count_as(&mut self, of_profiles: &[f64]) {
        let Some(zero_jd) = self.zero_jd.filter(|_| !of_profiles.is_empty()) else { return };
        let mut times_d: Vec<f64> = self.fluxes.iter().map(|one| one.time_d).collect();
        // some are enough
        let every = times_d.len().div_ceil(1000);
        times_d = times_d.into_iter().step_by(every).collect();
        let add = |(_, zero): &(&str, f64)| zero_jd - zero;
        /// Time systems that differ by less than this (d) are not distinguished: the first of them is taken.
        const ALIKE_D: f64 = 2.0;
        let off = |add: f64| (distance(&times_d, add, of_profiles) / ALIKE_D).floor();
        let counts = std::iter::once(0.0).chain(COUNTS.iter().map(add));
        if let Some(add) = counts.min_by(|a, b| off(*a).total_cmp(&off(*b))).filter(|add| *add != 0.0) {
            self.fluxes.iter_mut().for_each(|one| one.time_d += add);
            self.remarks.push(format!("its days are JD - {zero_jd} by the name of the column: {add} added"));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::photometry::Flux;

    fn counted(zero_jd: f64, time_d: f64, of_profiles: f64) -> (f64, usize) {
        let fluxes = vec![Flux { time_d, flux: 1.0, sigma: 0.1 }];
        let mut curve = Measurements { fluxes, zero_jd: Some(zero_jd), ..Measurements::default() };
        curve.count_as(&[of_profiles]);
        (curve.fluxes[0].time_d, curve.remarks.len())
    }

    #[test]
    fn days_of_a_named_zero_point_become_those_of_the_profiles() {
        assert_eq!(counted(BTJD, 2001.5, 2_459_003.0), (2_459_001.5, 1));
        assert_eq!(counted(BKJD, 4168.5, 2_459_003.0), (2_459_001.5, 1));
        assert_eq!(counted(MJD, 59001.0, 2_459_003.0), (2_459_001.5, 1));
        // profiles in MJD, or in the same time system
        assert_eq!(counted(BTJD, 2001.5, 59002.0), (59001.0, 1));
        assert_eq!(counted(BTJD, 2001.5, 2003.0), (2001.5, 0));
    }

    #[test]
    fn a_zero_point_that_was_mixed_up_is_named() {
        let found = fitting(&[2001.5], &[2_459_003.0], 50.0).unwrap();
        assert!(found.0[0].contains("BTJD") && found.1 == BTJD, "{found:?}");
        let found = fitting(&[2_459_001.5], &[59002.0], 50.0).unwrap();
        assert!(found.0 == ["JD", "MJD (JD - 2400000.5)"] && found.1 == -MJD, "{found:?}");
        assert_eq!(fitting(&[2_459_001.5], &[2_455_003.0], 50.0), None);
    }
}
