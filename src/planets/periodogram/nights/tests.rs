//! Nightly offsets against the covariance of velocities, and the false-alarm probability with them.

use super::super::jitter::root;
use super::super::sample::{self, STABILITY_KMS};
use super::super::{Frequencies, FrequencySettings, Search};
use super::*;

const ERROR_KMS: f64 = 0.03;

/// Twelve nights of three profiles.
fn of(jitter_kms: f64, night_kms: f64, k_kms: f64, seed: u64) -> (VelocityQuadratic, Nights) {
    let cycles: Vec<f64> = (0..36).map(|k| 0.37 * (k / 3) as f64 + 0.03 * (k % 3) as f64).collect();
    let nights: Vec<Vec<usize>> = (0..12).map(|night| (3 * night..3 * night + 3).collect()).collect();
    let offsets = night_kms * sample::normal(12, seed);
    let rv = sample::orbit(&cycles, k_kms, 1.7, 0.3)
        + ERROR_KMS * sample::normal(36, 1000 + seed)
        + jitter_kms * sample::normal(36, 2000 + seed)
        + DVector::from_fn(36, |k, _| offsets[k / 3]);
    let velocities = sample::independent(&cycles, &rv, &DVector::from_element(36, ERROR_KMS));
    (velocities, Nights::new(36, &nights).unwrap())
}

/// With offsets and a jitter that explains all of the rms without a planet; the false-alarm probability of the highest
/// peak, with the offsets.
fn found(jitter_kms: f64, night_kms: f64, k_kms: f64, seed: u64) -> Option<(f64, Offsets)> {
    let (velocities, nights) = of(jitter_kms, night_kms, k_kms, seed);
    let frequencies = Frequencies::new(&velocities.cycles, 1.0, FrequencySettings::default()).unwrap();
    let found_kms = jitter_kms.hypot(night_kms).hypot(k_kms / std::f64::consts::SQRT_2);
    let (all, offsets) = beside_offsets(&velocities, &nights, (found_kms, STABILITY_KMS))?;
    let search = Search::with_jitter(&all, &frequencies, SearchSettings { draws: 1000, seed: 1 }).unwrap();
    Some((search.false_alarm.probability(search.best().orbit.delta_ln_l).value(), offsets))
}

/// By the covariance of the velocities.
#[test]
fn the_offsets_add_to_the_covariance() {
    let (velocities, nights) = of(0.0, 0.08, 0.0, 3);
    let of_night = &nights.0;
    let (rv, noise) = velocities.radial_velocities().unwrap();
    let density = |scatter: Scatter| {
        let Scatter { jitter_kms, night_kms } = scatter;
        let nights = of_night * of_night.transpose() * night_kms.powi(2);
        let c = &noise + DMatrix::identity(36, 36) * jitter_kms.powi(2) + nights;
        let inverse = c.clone().try_inverse().unwrap();
        (-0.5 * (rv.dot(&(&inverse * &rv)) + c.determinant().ln()), inverse, c)
    };
    let alone = density(Scatter { jitter_kms: 0.0, night_kms: 0.0 }).0;
    let all = scatters(&[0.0, 0.02], &[0.0, 0.07]);
    assert_eq!(all.len(), 4);
    let beside = |scatter: &Scatter| Beside::new(&velocities, &nights, *scatter, STABILITY_KMS).unwrap();
    let (levels, covariance) = levels(&velocities, &beside(&all[2]), all.iter().map(beside).collect());
    let null = density(all[2]).2;
    for (scatter, level) in all.iter().zip(levels) {
        let (ln_l, inverse, _) = density(*scatter);
        let of = |kms| ln_prior(kms, STABILITY_KMS);
        let above = ln_l - alone + of(scatter.jitter_kms) + of(scatter.night_kms);
        assert!((beside(scatter).height - above).abs() < 1e-8, "{scatter:?}");
        assert!((&level.quadratic.information - &inverse).norm() < 1e-8 * inverse.norm(), "{scatter:?}");
        assert!((&level.quadratic.gradient - &inverse * &rv).norm() < 1e-8 * (&inverse * &rv).norm(), "{scatter:?}");
        // gradients of a star of the null
        let expected = &inverse * &null * &inverse;
        let drawn = &level.kept * &covariance * level.kept.transpose();
        assert!((drawn - &expected).norm() < 1e-8 * expected.norm(), "{scatter:?}");
    }
}

/// Stars without a planet are drawn with the offsets found with the peak: probabilities are uniform or larger.
#[test]
fn offsets_of_nights_are_no_planet() {
    let found: Vec<(f64, Offsets)> = (0..60).filter_map(|seed| found(0.0, 0.06, 0.0, seed)).collect();
    let mut all: Vec<f64> = found.iter().map(|found| found.0).collect();
    all.sort_by(f64::total_cmp);
    let below = |(k, p): (usize, &f64)| (k as f64 + 0.5) / all.len() as f64 - p;
    let distance = all.iter().enumerate().map(below).fold(0.0, f64::max);
    // exceeded once in a hundred by chance: 1.52 / sqrt(60)
    assert!(all.len() > 58 && distance < 0.2 && all[0] > 1e-3 && all[30] < 0.8, "{distance} {all:?}");
    // offsets of at most 60 m/s are allowed
    let sizes = found.iter().map(|found| found.1.sigma_kms.powi(2)).sum::<f64>() / found.len() as f64;
    assert!((0.65..1.05).contains(&(sizes.sqrt() / 0.06)), "{sizes}");
}

/// Without any noise but that of the profiles a chance jitter or offset takes a part of the peaks: stars that are drawn
/// without one have peaks that are as high.
#[test]
fn stars_without_offsets_are_searched_like_those_that_are_drawn() {
    let (nights, zero) = (of(0.0, 0.0, 0.0, 0).1, Scatter { jitter_kms: 0.0, night_kms: 0.0 });
    let frequencies = Frequencies::new(&of(0.0, 0.0, 0.0, 0).0.cycles, 1.0, FrequencySettings::default()).unwrap();
    let of_star = |seed: u64| {
        let velocities = of(0.0, 0.0, 0.0, seed).0;
        let units = nights.units(&velocities, zero, (0.0, most_offset_kms(STABILITY_KMS)));
        (beside(&velocities, &nights, (zero, units), STABILITY_KMS).unwrap(), velocities)
    };
    let (first, velocities) = of_star(0);
    let drawn = FalseAlarm::draw(&first, &frequencies.per_cycle, 4000, 1);
    let alone = FalseAlarm::draw(&Jitters::none(&velocities), &frequencies.per_cycle, 4000, 1);
    assert!(drawn.level(0.1) < alone.level(0.1) - 0.3, "{} {}", drawn.level(0.1), alone.level(0.1));
    let highest = |seed: u64| {
        let trials = of_star(seed).0.scan(&frequencies.per_cycle);
        trials.iter().map(|trial| trial.delta_ln_l).fold(f64::NEG_INFINITY, f64::max)
    };
    let mut all: Vec<f64> = (1..=200).map(|seed| drawn.probability(highest(seed)).by_draws).collect();
    all.sort_by(f64::total_cmp);
    let apart = |(k, p): (usize, &f64)| ((k as f64 + 0.5) / all.len() as f64 - p).abs();
    let distance = all.iter().enumerate().map(apart).fold(0.0, f64::max);
    // exceeded once in a hundred by chance: 1.63 / sqrt(200)
    assert!(distance < 0.115, "{distance}");
}

/// Of a planet whose ephemeris is known.
fn known(night_kms: f64, k_kms: f64, seed: u64) -> Option<NightOffsets> {
    let (velocities, nights) = of(0.0, night_kms, k_kms, seed);
    let unit = sample::orbit(&velocities.cycles, 1.0, 1.7, 0.3);
    let found_kms = night_kms.hypot(k_kms / std::f64::consts::SQRT_2);
    let settings = SearchSettings { draws: 2000, seed: 1 };
    known_beside_offsets(&velocities, &nights, (found_kms, STABILITY_KMS), &unit, settings)
}

/// The false-alarm probability of K of such a planet is calibrated.
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

/// With a jitter or none.
#[test]
fn a_planet_is_no_offset_of_nights() {
    for jitter_kms in [0.0, 0.06] {
        let all: Vec<(f64, Offsets)> = (0..6).filter_map(|seed| found(jitter_kms, 0.0, 0.15, seed)).collect();
        let clear = all.iter().filter(|found| found.0 < 1e-2).count();
        assert_eq!(clear, all.len(), "{jitter_kms}: {all:?}");
    }
}

/// Around the planet they are the star's own: without it in the model they absorb it.
#[test]
fn offsets_beside_a_planet_do_not_absorb_it() {
    let most_kms = most_offset_kms(STABILITY_KMS);
    let beside = |night_kms: f64, seed: u64| {
        let (mut velocities, nights) = of(0.0, night_kms, 0.15, seed);
        let of = |velocities: &VelocityQuadratic| {
            most_likely(velocities, &nights, (0.1, STABILITY_KMS)).map_or(0.0, |scatter| scatter.night_kms)
        };
        let without = of(&velocities);
        let planet = sample::orbit(&velocities.cycles, -0.15, 1.7, 0.3);
        velocities.gradient += &velocities.information * planet;
        (without, of(&velocities))
    };
    let median = |night_kms: f64| {
        let mut all: Vec<f64> = (0..9).map(|seed| beside(night_kms, seed).1).collect();
        all.sort_by(f64::total_cmp);
        all[4]
    };
    assert!((0..9).all(|seed| beside(0.0, seed).0 == most_kms), "they absorb it");
    let (none, some) = (median(0.0), median(0.045));
    assert!(none < 0.01 && (0.03..0.06).contains(&some), "{none} {some}");
}

/// Without a night in the middle its offset is left without a profile.
#[test]
fn profiles_that_are_left_keep_their_nights() {
    let nights = Nights::new(6, &[vec![0, 1], vec![2, 3], vec![4, 5]]).unwrap();
    let left = nights.of(&[0.0, 0.1, 2.0, 2.1], &[0.0, 0.1, 1.0, 1.1, 2.0, 2.1]);
    let of = [[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]];
    assert_eq!(left.0, DMatrix::from_fn(4, 3, |row, night| of[row][night]));
    assert_eq!(Nights::new(5, &[vec![0, 1], vec![2], vec![3, 4]]), None);
}

/// K of a known planet is drawn with the variance of its gradient: nights and uncertainties of unequal size, whose root
/// is not symmetric.
#[test]
fn amplitudes_have_the_variance_of_the_gradient() {
    let cycles: Vec<f64> = (0..12).map(|k| 0.37 * f64::from(k / 3) + 0.03 * f64::from(k % 3)).collect();
    let errors_kms = DVector::from_fn(12, |k, _| if k % 3 == 0 { 0.02 } else { 0.2 });
    let velocities = sample::independent(&cycles, &DVector::zeros(12), &errors_kms);
    let nights = Nights::new(12, &[(0..2).collect(), (2..9).collect(), (9..12).collect()]).unwrap();
    let of = |night_kms| {
        let scatter = Scatter { jitter_kms: 0.0, night_kms };
        Beside::new(&velocities, &nights, scatter, STABILITY_KMS).unwrap()
    };
    let (levels, found) = levels(&velocities, &of(0.3), vec![of(0.15)]);
    let of_level = &levels[0].quadratic.information;
    let unit = sample::orbit(&cycles, 1.0, 1.7, 0.9);
    let nights_kms2 = &nights.0 * nights.0.transpose() * 0.09;
    let covariance = velocities.information.clone().try_inverse().unwrap() + nights_kms2;
    let pulled = of_level * &unit;
    let expected = pulled.dot(&(&covariance * &pulled)) / unit.dot(&pulled);
    let transposed = (root(&found) * &levels[0].kept * &unit).norm_squared() / unit.dot(&pulled);
    assert!((transposed / expected - 1.0).abs() > 0.15, "{transposed} {expected}: does not tell");
    let (ln_shares, units) = (vec![0.0], Scatter { jitter_kms: 0.0, night_kms: 0.3 });
    let jitters = Jitters { levels, ln_shares, null: None, units, covariance: found };
    // half of the amplitudes are above zero, where Delta ln L is half of their square
    let drawn = amplitudes(&jitters, &unit, 20_000, 1);
    let variance = 4.0 * drawn.iter().sum::<f64>() / drawn.len() as f64;
    assert!((variance / expected - 1.0).abs() < 0.06, "{variance} {expected}");
}

/// Without a night the offsets are those of the star, whatever the other nights require.
#[test]
fn without_a_night_the_offsets_stay() {
    let (mut velocities, nights) = of(0.0, 0.0, 0.0, 7);
    // one night is off by 0.3 km/s, and nothing else
    let off = DVector::from_fn(36, |k, _| if k < 3 { 0.3 } else { 0.0 });
    velocities.gradient = &velocities.information * off;
    let jitter = (0.09, STABILITY_KMS);
    let (all, Offsets { sigma_kms, .. }) = beside_offsets(&velocities, &nights, jitter).unwrap();
    assert!(sigma_kms > 0.03, "{sigma_kms}");
    // profiles are independent here
    let others = VelocityQuadratic {
        cycles: velocities.cycles[3..].to_vec(),
        gradient: velocities.gradient.rows(3, 33).into_owned(),
        information: velocities.information.view((3, 3), (33, 33)).into_owned(),
    };
    let nights = nights.of(&others.cycles, &velocities.cycles);
    let (_, of_others) = beside_offsets(&others, &nights, jitter).unwrap();
    assert_eq!(of_others.sigma_kms, 0.0, "the others have no offsets");
    let some = beside_offsets_of(&all, &others, &nights, jitter.1).unwrap();
    assert_eq!((some.null, some.levels.len(), &some.ln_shares), (all.null, all.levels.len(), &all.ln_shares));
    // that without offsets is the most likely one of the same levels
    let best = (0..some.levels.len()).max_by(|a, b| some.levels[*a].ln_l.total_cmp(&some.levels[*b].ln_l)).unwrap();
    assert!(best < 4, "{best}");
}
