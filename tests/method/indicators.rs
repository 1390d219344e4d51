//! Activity indicators beside profiles: gains by the evidence, rows of the likelihood, and their constraints on spots.

use dimcmc::internals::field::{Field, Kernel, Lifetime, Spectrum};
use dimcmc::internals::star::Band;
use dimcmc::internals::surface::evolving_map::{Assumed, Basis, Design, FittedIndicator, Marginal, fit_indicator};
use dimcmc::internals::surface::indicator::{Indicator, scaled};
use dimcmc::internals::surface::photometry::Flux;
use dimcmc::{Config, Scene};
use nalgebra::DMatrix;
use serde_json::{Value, json};
use std::f64::consts::TAU;
use std::sync::Arc;

/// A star whose spots live some days, seen for three weeks.
fn config(seed: u64, profiles: usize) -> Value {
    let cycles: Vec<f64> =
        (0..profiles).map(|k| (7.0 * k as f64 + 0.31 * (k as f64).sin()) / profiles as f64).collect();
    json!({
        "star": { "rotation_period_d": 3.0, "inclination_deg": 60.0, "vsini_kms": 25.0, "contrast": 0.3,
                  "line": { "sigma_kms": 3.0, "equivalent_width_kms": 6.0 } },
        "planet": { "k_kms": 0.2, "porb_over_prot": 1.7, "phi": 0.3 },
        "imaging": { "pixels": 250, "objective": "marginal-likelihood" },
        "observations": { "velocity_jitter_kms": 0.0, "simulate": {
            "random_spots": { "number": 8, "lifetime_d": 12, "seed": seed }, "cycles": cycles, "seed": seed,
            "velocity_kms": { "min": -36.0, "max": 36.0, "step": 2.4 }, "snr": 700, "pixels": 3000 } }
    })
}

fn scene(config: &Value) -> Scene {
    Scene::new(&Config::from_json(&config.to_string()).unwrap()).unwrap()
}

fn marginal(scene: &Scene, basis: &Arc<Basis>, lifetime_d: f64) -> Marginal {
    let values = scene.settings.values;
    let design = Arc::new(Design::new(&scene.imager, basis, &values.state()));
    let spectrum = Spectrum { amplitude: 0.2, slope: 0.9, break_degree: 0.0 };
    let assumed = Assumed {
        field: Field { spectrum, kernel: Kernel::of(Lifetime::Days(lifetime_d)) },
        jitter_kms: 0.0,
        night_kms: 0.0,
    };
    Marginal::new(&scene.imager, basis, design, values, assumed, None).unwrap()
}

/// A number from -1 to 1 without a pattern, of unit variance.
fn noise(k: usize, seed: u64) -> f64 {
    let x = (k as f64 * 12.9898 + seed as f64 * 78.233).sin() * 43_758.545_3;
    (2.0 * (x - x.floor()) - 1.0) * 3f64.sqrt()
}

/// Values of an indicator that is this multiple of the filling factor of the visible disc, in noise.
fn values(scene: &Scene, count: usize, gain: f64, sigma: f64, seed: u64) -> Vec<Flux> {
    let simulation = scene.settings.sets[0].simulation().unwrap();
    let times_d: Vec<f64> = (0..count).map(|k| 21.0 * (k as f64 + 0.3) / count as f64).collect();
    // a band in which spots are black: the flux is what is left
    let band = Band { contrast: Some(0.0), ..Band::default() };
    let fluxes = simulation.fluxes(&scene.settings.star, &band, &times_d, (1e-12, 1));
    let value = |(k, one): (usize, Flux)| Flux {
        flux: 3.0 + 0.01 * one.time_d + gain * (1.0 - one.flux) + sigma * noise(k, seed),
        sigma,
        ..one
    };
    fluxes.into_iter().enumerate().map(value).collect()
}

fn found(scene: &Scene, marginal: &Marginal, values: &[Flux]) -> FittedIndicator {
    let (scale, readings) = scaled(values);
    fit_indicator(&scene.imager, marginal, ("halpha", scale, &readings))
}

#[test]
fn gains_of_either_sign_come_back_and_noise_has_none() {
    let scene = scene(&config(5, 24));
    let basis = Arc::new(Basis::new(&scene.imager.grid));
    let marginal = marginal(&scene, &basis, 12.0);
    let filling = values(&scene, 40, 1.0, 1e-9, 1);
    let (scale, _) = scaled(&filling);
    // as large as the rms of the filling factor, a third of it, and in units of a field in gauss
    for (gain, sigma) in [(1.0, 0.1 * scale.rms), (-1.0, 0.1 * scale.rms), (-0.5, 0.3 * scale.rms), (4000.0, 10.0)] {
        let found = found(&scene, &marginal, &values(&scene, 40, gain, sigma, 3));
        println!("{gain}: {found:?}");
        let off = (found.gain - gain) / gain;
        assert!(found.is_used() && found.ln_bayes > 5.0 && off.abs() < 0.35, "{gain}: {found:?}");
        assert!(found.jitter < 0.5 * scale.rms * gain.abs(), "{found:?}");
    }
    // noise, and noise with errors that are too small
    for seed in 1..=30 {
        for quoted in [1.0, 0.3] {
            let mut useless = values(&scene, 40, 0.0, 0.02, seed);
            useless.iter_mut().for_each(|one| one.sigma *= quoted);
            let found = found(&scene, &marginal, &useless);
            assert!(!found.is_used() && found.ln_bayes < 3.0, "{seed}: {found:?}");
            assert!(found.jitter < 0.04, "{found:?}");
        }
    }
}

/// ln Z with an indicator over ln Z without is the density of its values that the profiles predict.
#[test]
fn rows_of_the_likelihood_are_what_the_gain_was_found_by() {
    let scene = scene(&config(5, 8));
    let basis = Arc::new(Basis::new(&scene.imager.grid));
    let plain = marginal(&scene, &basis, 12.0);
    let good = values(&scene, 25, 2.0, 0.01, 4);
    let (scale, readings) = scaled(&good);
    let ln_z = |gain: f64| {
        let mut with = scene.clone();
        with.imager.indicators = vec![Indicator::new((0, "halpha"), &good, gain, 0.0)];
        assert_eq!(with.imager.epochs(), 8 + 25);
        marginal(&with, &basis, 12.0).ln_evidence()
    };
    // by hand: what profiles predict of the filling factor of the disc, and level and slope of 3 scatters each
    let times_d: Vec<f64> = readings.iter().map(|one| one.time_d).collect();
    let band = Band::default();
    let state = scene.settings.values.state();
    let shares = times_d.iter().flat_map(|t| band.shares(&scene.imager.grid, &scene.imager.star, &state, &[*t]));
    let shares = DMatrix::from_iterator(scene.imager.grid.len(), times_d.len(), shares);
    let rows = shares.transpose() * &basis.on_pixels;
    let (mean, covariance) = plain.settled.evidence.predicted(&rows, &times_d);
    let by_hand = |gain: f64| {
        let gain = gain / scale.rms;
        let mut all = &covariance * (gain * gain);
        for (j, a) in readings.iter().enumerate() {
            for (k, b) in readings.iter().enumerate() {
                all[(j, k)] += 9.0 * (1.0 + a.place * b.place);
            }
            all[(j, j)] += a.sigma * a.sigma;
        }
        let misfit: Vec<f64> = readings.iter().zip(&mean).map(|(one, m)| one.value - gain * m).collect();
        let misfit = nalgebra::DVector::from_vec(misfit);
        let factor = all.cholesky().unwrap();
        let determinant: f64 = factor.l().diagonal().iter().map(|x| 2.0 * x.ln()).sum();
        -0.5 * (misfit.dot(&factor.solve(&misfit)) + determinant + 25.0 * TAU.ln())
    };
    let plain = plain.ln_evidence();
    // maps settle elsewhere with an indicator: the linearised profiles differ a little
    for (gain, tolerance) in [(0.0, 1e-6), (1.0, 0.1), (1.8, 0.02), (2.2, 0.02)] {
        let (whole, conditional) = (ln_z(gain) - plain, by_hand(gain));
        println!("{gain}: {whole} {conditional}");
        assert!((whole - conditional).abs() < tolerance, "{gain}: {whole} {conditional}");
    }
}

/// The error of ln lifetime from the second difference of ln Z at a field that is known but for that.
fn lifetime_error(scene: &Scene, basis: &Arc<Basis>) -> f64 {
    const STEP: f64 = 0.3;
    let at = |step: f64| marginal(scene, basis, 12.0 * f64::exp(step)).ln_evidence();
    let bend = (2.0 * at(0.0) - at(STEP) - at(-STEP)) / (STEP * STEP);
    bend.max(0.0).sqrt().recip()
}

#[test]
fn a_good_indicator_narrows_the_lifetime_and_a_useless_one_changes_nothing() {
    let plain = scene(&config(5, 8));
    let basis = Arc::new(Basis::new(&plain.imager.grid));
    // as the config has it: gain and jitter fitted, and used
    let folder = tempfile::tempdir().unwrap();
    let table = |name: &str, values: &[Flux]| {
        let rows: String = values.iter().map(|one| format!("{},{},{}\n", one.time_d, one.flux, one.sigma)).collect();
        std::fs::write(folder.path().join(name), format!("BJD,S,e_S\n{rows}")).unwrap();
    };
    table("good.csv", &values(&plain, 90, 20.0, 0.02, 4));
    table("useless.csv", &values(&plain, 90, 0.0, 0.02, 4));
    let with = |name: Option<&str>| {
        let mut config = config(5, 8);
        config["imaging"]["spot_amplitude"] = json!(0.2);
        config["imaging"]["spot_slope"] = json!(0.9);
        config["imaging"]["spot_lifetime_d"] = json!(12.0);
        config["observations"]["events"] = json!("none");
        if let Some(name) = name {
            config["indicators"] = json!({ "name": "s", "path": folder.path().join(name) });
        }
        scene(&config).fitted(&|_| ())
    };
    let without = with(None);
    let error = lifetime_error(&without, &basis);
    let good = with(Some("good.csv"));
    let found = &good.measured.indicators[0];
    println!("{found:?}");
    assert!(found.is_used() && (found.gain / 20.0 - 1.0).abs() < 0.35, "{found:?}");
    assert_eq!((good.imager.indicators.len(), good.imager.epochs()), (1, 98));
    let narrow = lifetime_error(&good, &basis);
    println!("{narrow} {error}");
    assert!(narrow < 0.6 * error, "{narrow} with the indicator, {error} without");
    let useless = with(Some("useless.csv"));
    assert!(useless.measured.indicators[0].line().contains("not used: no significant gain"));
    assert!(useless.imager.indicators.is_empty());
    assert_eq!(lifetime_error(&useless, &basis), error);
    assert_eq!(useless.settings.values, without.settings.values);
}
