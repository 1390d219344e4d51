//! The marginal likelihood of stars that change, against an independent implementation (`tests/data/evolving`).

use dimcmc::Scene;
use dimcmc::internals::field::Lifetime;
use dimcmc::internals::planets::periodogram::{Frequencies, FrequencySettings, Search, SearchSettings, orbits};
use dimcmc::internals::posterior::marginal::{Basis, Change, Known, fit};
use dimcmc::internals::posterior::objective::{Parameter, ParameterValues};
use std::path::{Path, PathBuf};

fn folder(star: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/evolving").join(star)
}

/// The scene of a star, its values without a planet, and the periods to search.
fn star(name: &str) -> (Scene, ParameterValues, Frequencies) {
    let scene = Scene::load(&folder(name).join("config.json")).unwrap();
    let mut values = scene.settings.values;
    values[Parameter::K] = 0.0;
    let rotation_period_d = scene.imager.star.rotation_period_d;
    let frequencies = Frequencies::new(&scene.imager.cycles(), rotation_period_d, FrequencySettings::default());
    (scene, values, frequencies.unwrap())
}

#[test]
fn the_highest_peak_is_that_of_another_implementation() {
    for name in ["slow-planet", "static-planet"] {
        let (scene, values, frequencies) = star(name);
        let oracle: serde_json::Value =
            serde_json::from_slice(&std::fs::read(folder(name).join("oracle.json")).unwrap()).unwrap();
        let number = |part: &str, key: &str| oracle[part][key].as_f64().unwrap();
        let known = Known {
            amplitude: Some(number("hyper", "amplitude")),
            slope: Some(number("hyper", "slope")),
            lifetime: Some(Lifetime::Days(number("hyper", "lifetime_d"))),
            jitter_kms: Some(0.0),
        };
        let basis = Basis::new(&scene.imager.grid);
        let fitted = fit(&scene.imager, &basis, values, known, None).unwrap();
        assert!(fitted.at_bounds.is_empty());
        let quadratic = fitted.marginal.expansion(&scene.imager, &basis, &[]).unwrap().velocities(&[]);
        let search = Search::new(&quadratic, &frequencies, SearchSettings::default()).unwrap();
        let best = search.best();
        let sigma = number("peak", "sigma_k_kms");
        // pixels, harmonics' numbers and periods of the search are others: 0.3 sigma and 5 per cent
        let off = (best.orbit.k_kms - number("peak", "k_kms")).abs() / sigma;
        assert!(off < 0.3, "{name}: K is {off} sigma off");
        // the reference's error is the mean over phases, at its period
        let there = orbits::at(&quadratic, 1.0 / number("peak", "porb_over_prot")).information;
        let mean = (0.5 * there.try_inverse().unwrap().trace()).sqrt();
        assert!((mean / sigma - 1.0).abs() < 0.05, "{name}: sigma_K {mean}, not {sigma}");
        let period = best.porb_over_prot / number("peak", "porb_over_prot") - 1.0;
        assert!(period.abs() < 0.05, "{name}: P {}", best.porb_over_prot);
        assert!(search.false_alarm.probability(best.orbit.delta_ln_l).value() < 1e-3, "{name}");
    }
}

#[test]
fn a_star_that_changes_is_told_from_one_that_does_not() {
    for (name, changes) in [("slow-planet", true), ("static-planet", false)] {
        let (scene, values, frequencies) = star(name);
        let known = Known { jitter_kms: Some(0.0), ..Known::default() };
        let change = Change::of(&scene.imager, values, &frequencies, &[], known).unwrap();
        assert_eq!(change.is_changing(), changes, "{name}: {change:?}");
    }
}
