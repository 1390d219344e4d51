//! Injected orbits against searches of velocities that contain them.

use super::super::FrequencySettings;
use super::super::orbits::velocities;
use super::super::sample::{self, STABILITY_KMS, uneven};
use super::*;

/// Velocities whose information halves from field to field: an orbit is searched for with the best field of the star
/// without a planet, from its ln L and the loss due to the orbit, both in closed form.
#[test]
fn an_orbit_is_searched_for_with_the_field_that_absorbs_it() {
    let cycles = uneven(20, 5.0);
    let quadratic =
        |scatter_kms: f64| sample::independent(&cycles, &DVector::zeros(20), &DVector::from_element(20, scatter_kms));
    let star = |(k, ln_posterior)| {
        let velocities = quadratic(0.05 * 2f64.powf(0.5 * f64::from(k)));
        OfField { held: velocities.clone(), velocities, ln_posterior }
    };
    let stars = [(0, 0.0), (1, -2.0), (2, -6.0), (3, -12.0)].map(star);
    let frequencies = Frequencies::new(&cycles, 1.0, FrequencySettings::default()).unwrap();
    let settings = SearchSettings { draws: 1000, seed: 1 };
    let highest = |stars: &[OfField], k_kms: f64| {
        let injections = Injections::new(stars, &Jitter::Known, 0.6, &frequencies, settings, 0.01);
        injections.column(1.7).highest(k_kms, 0.4).unwrap()
    };
    let of_field = |field: usize, k_kms: f64| highest(&stars[field..=field], k_kms);
    // without a planet ln L falls by half of V I V: some 20 K^2 / 4 sigma^2
    for (k_kms, between) in [(0.01, [0, 0]), (0.06, [0, 1]), (0.08, [1, 2]), (0.12, [2, 3]), (0.4, [3, 3])] {
        let found = highest(&stars, k_kms);
        let [most, least] = between.map(|field| of_field(field, k_kms).delta_ln_l);
        assert!(
            least * 0.999 <= found.delta_ln_l && found.delta_ln_l <= most * 1.001,
            "{k_kms}: {found:?} {most} {least}"
        );
    }
}

/// Against velocities with the orbit in them, jitter by jitter and offset by offset.
#[test]
fn a_peak_is_that_of_the_search_with_the_orbit_in_the_velocities() {
    let cycles = uneven(20, 5.0);
    let rv = 0.08 * sample::normal(20, 3);
    let without = sample::correlated(&cycles, &rv, 5);
    let frequencies = Frequencies::new(&cycles, 1.0, FrequencySettings::default()).unwrap();
    let settings = SearchSettings { draws: 1000, seed: 1 };
    let star = [OfField { velocities: without.clone(), held: without.clone(), ln_posterior: 0.0 }];
    let pairs: Vec<Vec<usize>> = (0..10).map(|night| vec![2 * night, 2 * night + 1]).collect();
    for fitted in [Jitter::Fitted(STABILITY_KMS, None), Jitter::Fitted(STABILITY_KMS, Nights::new(20, &pairs))] {
        let injections = Injections::new(&star, &fitted, 0.6, &frequencies, settings, 0.01);
        let nights = injections.fields[0].nights.clone().unwrap_or_else(|| Nights::none(20));
        for (period, k_kms, phi) in [(1.7, 0.0, 0.0), (1.7, 0.3, 0.4), (0.61, 0.6, 0.9)] {
            let found = injections.column(period).highest(k_kms, phi).unwrap();
            let ab = amplitudes(&cycles, 1.0 / period, k_kms, phi);
            let moved = &without.gradient + &without.information * velocities(&cycles, 1.0 / period, ab);
            let moved = VelocityQuadratic { gradient: moved, ..without.clone() };
            let beside = |scatter| Beside::new(&moved, &nights, scatter, STABILITY_KMS).unwrap();
            let of = |size: &Size| (size.scatter, beside(size.scatter));
            let all: Vec<(Scatter, Beside)> = injections.fields[0].sizes.iter().map(of).collect();
            let (_, alone) = all.iter().max_by(|a, b| a.1.height.total_cmp(&b.1.height)).unwrap();
            let mut with = (f64::NEG_INFINITY, 0.0);
            for (_, beside) in &all {
                let left = beside.kept();
                let here = VelocityQuadratic {
                    gradient: &left * &moved.gradient,
                    information: &left * &moved.information,
                    ..moved.clone()
                };
                for orbit in scan(&here, &frequencies.per_cycle).into_iter().filter_map(|trial| trial.orbit) {
                    if beside.height + orbit.delta_ln_l > with.0 {
                        with = (beside.height + orbit.delta_ln_l, orbit.k_kms);
                    }
                }
            }
            assert!((found.delta_ln_l - (with.0 - alone.height)).abs() < 1e-8, "{found:?} {with:?}");
            assert!((found.k_kms - with.1).abs() < 1e-8, "{found:?} {with:?}");
            if k_kms > 0.2 {
                assert!((found.frequency * period - 1.0).abs() < 0.02, "{found:?}");
                assert!(found.delta_ln_l > found.level, "{found:?}");
            }
        }
    }
}

/// The fit of spots has no nightly offsets: they do not change the field of the search.
#[test]
fn fields_are_fitted_without_offsets_of_nights() {
    let cycles = uneven(20, 5.0);
    let quadratic = sample::independent(&cycles, &DVector::zeros(20), &DVector::from_element(20, 0.05));
    let stars = [OfField { held: quadratic.clone(), velocities: quadratic, ln_posterior: 0.0 }];
    let frequencies = Frequencies::new(&cycles, 1.0, FrequencySettings::default()).unwrap();
    let settings = SearchSettings { draws: 1000, seed: 1 };
    let pairs: Vec<Vec<usize>> = (0..10).map(|night| vec![2 * night, 2 * night + 1]).collect();
    let heights = [None, Nights::new(20, &pairs)].map(|nights| {
        let fitted = Jitter::Fitted(STABILITY_KMS, nights);
        let injections = Injections::new(&stars, &fitted, 0.6, &frequencies, settings, 0.01);
        injections.column(1.7).ln_posteriors(amplitudes(&cycles, 1.0 / 1.7, 0.3, 0.4))[0]
    });
    assert!((heights[0] - heights[1]).abs() < 1e-9, "{heights:?}");
}
