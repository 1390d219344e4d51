//! Offsets of nights against the covariance of velocities, and how often chance makes a planet beside them.

use super::super::FrequencySettings;
use super::super::sample;
use super::*;

const ERROR_KMS: f64 = 0.03;

/// Twelve nights of three profiles, seen by themselves.
fn of(jitter_kms: f64, night_kms: f64, k_kms: f64, seed: u64) -> (VelocityQuadratic, Vec<Vec<usize>>) {
    let cycles: Vec<f64> = (0..36).map(|k| 0.37 * (k / 3) as f64 + 0.03 * (k % 3) as f64).collect();
    let nights: Vec<Vec<usize>> = (0..12).map(|night| (3 * night..3 * night + 3).collect()).collect();
    let offsets = night_kms * sample::normal(12, seed);
    let rv = sample::orbit(&cycles, k_kms, 1.7, 0.3)
        + ERROR_KMS * sample::normal(36, 1000 + seed)
        + jitter_kms * sample::normal(36, 2000 + seed)
        + DVector::from_fn(36, |k, _| offsets[k / 3]);
    (sample::independent(&cycles, &rv, &DVector::from_element(36, ERROR_KMS)), nights)
}

/// Of the highest peak, the scatter that it has without a planet being its jitter.
fn found(jitter_kms: f64, night_kms: f64, k_kms: f64, seed: u64) -> Option<NightOffsets> {
    let (velocities, nights) = of(jitter_kms, night_kms, k_kms, seed);
    let frequencies = Frequencies::new(&velocities.cycles, 1.0, FrequencySettings::default()).unwrap();
    let found_kms = jitter_kms.hypot(night_kms).hypot(k_kms / std::f64::consts::SQRT_2);
    let settings = SearchSettings { draws: 1000, seed: 1 };
    let jitters = Jitters::new(&velocities, found_kms, None);
    let heights = jitters.scan(&frequencies.per_cycle);
    let highest = heights.iter().max_by(|a, b| a.delta_ln_l.total_cmp(&b.delta_ln_l)).unwrap();
    let peak = Compared::Peak(highest.trial.frequency, &frequencies);
    night_offsets(&velocities, &nights, (found_kms, None), peak, settings)
}

/// By the covariance of the velocities.
#[test]
fn the_offsets_add_to_the_covariance() {
    let (velocities, nights) = of(0.0, 0.08, 0.0, 3);
    let of_night = DMatrix::from_fn(36, 12, |k, night| f64::from(u8::from(nights[night].contains(&k))));
    let (rv, noise) = velocities.radial_velocities().unwrap();
    let density = |scatter: Scatter| {
        let Scatter { jitter_kms, night_kms } = scatter;
        let nights = &of_night * of_night.transpose() * night_kms.powi(2);
        let c = &noise + DMatrix::identity(36, 36) * jitter_kms.powi(2) + nights;
        let inverse = c.clone().try_inverse().unwrap();
        (-0.5 * (rv.dot(&(&inverse * &rv)) + c.determinant().ln()), inverse, c)
    };
    let alone = density(Scatter { jitter_kms: 0.0, night_kms: 0.0 }).0;
    let all = scatters([0.02, 0.0], &[0.07, 0.0]);
    assert_eq!(all.len(), 4);
    let beside = |scatter: &Scatter| Beside::new(&velocities, &of_night, *scatter, None).unwrap();
    let jitters = of_scatters(&velocities, beside(&all[1]), all.iter().map(beside).collect());
    let null = density(all[1]).2;
    for (scatter, level) in all.iter().zip(jitters.levels()) {
        let (ln_l, inverse, _) = density(*scatter);
        let above = ln_l - alone + ln_prior(scatter.night_kms, Some(USUAL_KMS));
        assert!((beside(scatter).height - above).abs() < 1e-8, "{scatter:?}");
        assert!((&level.quadratic.information - &inverse).norm() < 1e-8 * inverse.norm(), "{scatter:?}");
        assert!((&level.quadratic.gradient - &inverse * &rv).norm() < 1e-8 * (&inverse * &rv).norm(), "{scatter:?}");
        // gradients of a star of the null
        let expected = &inverse * &null * &inverse;
        assert!((level.root.tr_mul(&level.root) - &expected).norm() < 1e-8 * expected.norm(), "{scatter:?}");
    }
}

#[test]
fn offsets_of_nights_are_no_planet() {
    let found: Vec<NightOffsets> = (0..40).filter_map(|seed| found(0.0, 0.08, 0.0, seed)).collect();
    let mut all: Vec<f64> = found.iter().map(|found| found.false_alarm_probability).collect();
    all.sort_by(f64::total_cmp);
    // the peak may not be the highest beside offsets: probabilities are uniform or larger
    let below = |(k, p): (usize, &f64)| (k as f64 + 0.5) / all.len() as f64 - p;
    let distance = all.iter().enumerate().map(below).fold(0.0, f64::max);
    // exceeded once in a hundred by chance: 1.52 / sqrt(40)
    assert!(all.len() > 38 && distance < 0.24 && all[0] > 1e-3, "{distance} {all:?}");
    let sizes = found.iter().map(|found| found.sigma_kms.powi(2)).sum::<f64>() / found.len() as f64;
    assert!((sizes.sqrt() / 0.08 - 1.0).abs() < 0.15, "{sizes}");
}

/// Of a planet whose ephemeris is known.
fn known(night_kms: f64, k_kms: f64, seed: u64) -> Option<NightOffsets> {
    let (velocities, nights) = of(0.0, night_kms, k_kms, seed);
    let unit = sample::orbit(&velocities.cycles, 1.0, 1.7, 0.3);
    let found_kms = night_kms.hypot(k_kms / std::f64::consts::SQRT_2);
    let settings = SearchSettings { draws: 2000, seed: 1 };
    night_offsets(&velocities, &nights, (found_kms, None), Compared::Known(&unit), settings)
}

/// K of such a planet is as improbable as it says.
#[test]
fn offsets_of_nights_are_no_known_planet() {
    let mut all: Vec<f64> = (0..200)
        .filter_map(|seed| known(0.08, 0.0, seed))
        .collect::<Vec<_>>()
        .iter()
        .map(|found| found.false_alarm_probability)
        .collect();
    all.sort_by(f64::total_cmp);
    let half = all.partition_point(|p| *p < 0.5);
    // half of the draws are below zero, and have 1; exceeded once in a hundred by chance: 1.63 / sqrt(200)
    let distance = |(k, p): (usize, &f64)| ((k as f64 + 0.5) / all.len() as f64 - p).abs();
    let distance = all[..half].iter().enumerate().map(distance).fold(0.0, f64::max);
    assert!(all.len() > 195 && distance < 0.115 && half.abs_diff(100) < 25, "{distance} {half}");
}

#[test]
fn a_known_planet_is_no_offset_of_nights() {
    let all: Vec<NightOffsets> = (0..6).filter_map(|seed| known(0.0, 0.1, seed)).collect();
    assert!(all.len() == 6 && all.iter().all(|found| found.false_alarm_probability < 1e-2), "{all:?}");
}

/// Beside a jitter or none.
#[test]
fn a_planet_is_no_offset_of_nights() {
    for jitter_kms in [0.0, 0.06] {
        let all: Vec<NightOffsets> = (0..6).filter_map(|seed| found(jitter_kms, 0.0, 0.15, seed)).collect();
        let clear = all.iter().filter(|found| found.false_alarm_probability < 1e-2).count();
        assert_eq!(clear, all.len(), "{jitter_kms}: {all:?}");
    }
}

/// A jitter alone, and nights of one profile, have no offsets.
#[test]
fn a_jitter_is_no_offset_of_nights() {
    let with = (0..20).filter(|seed| found(0.06, 0.0, 0.0, *seed).is_some_and(|found| found.gain > 2.0)).count();
    assert!(with < 2, "{with}");
    let (velocities, _) = of(0.0, 0.0, 0.0, 1);
    let frequencies = Frequencies::new(&velocities.cycles, 1.0, FrequencySettings::default()).unwrap();
    let alone: Vec<Vec<usize>> = (0..36).map(|k| vec![k]).collect();
    let settings = SearchSettings { draws: 1000, seed: 1 };
    let peak = Compared::Peak(0.5, &frequencies);
    assert_eq!(night_offsets(&velocities, &alone, (0.08, None), peak, settings), None);
}

/// A velocity that all profiles have in common is open.
#[test]
fn an_open_velocity_is_no_obstacle() {
    let (velocities, nights) = of(0.0, 0.08, 0.0, 2);
    let open = velocities.beside(&DMatrix::from_element(36, 1, 1.0)).unwrap();
    let frequencies = Frequencies::new(&open.cycles, 1.0, FrequencySettings::default()).unwrap();
    let settings = SearchSettings { draws: 1000, seed: 1 };
    let peak = Compared::Peak(1.0 / 1.7, &frequencies);
    let found = night_offsets(&open, &nights, (0.08, None), peak, settings).unwrap();
    assert!((0.04..0.16).contains(&found.sigma_kms) && found.false_alarm_probability > 1e-3, "{found:?}");
}
