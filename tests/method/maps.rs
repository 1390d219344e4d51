//! Maps of evolving spots: they are recovered at their times, and unconstrained at other times.

use dimcmc::{Config, NoMaps, Observations, Scene, SurfaceMaps, VelocityWithoutSpots};
use serde_json::json;

/// Rotation cycles of the profiles: four nights of four profiles.
fn cycles() -> Vec<f64> {
    (0..4).flat_map(|night| (0..4).map(move |k| 3.0 * f64::from(night) + 0.21 * f64::from(k))).collect()
}

/// A star with these spots; 0.2 % noise in a bin.
fn config(spots: &serde_json::Value, cycles: &[f64]) -> Config {
    Config::default()
        .with("star.rotation_period_d", 1.0)
        .with("star.inclination_deg", 50.0)
        .with("star.vsini_kms", 25.0)
        .with("star.line", json!({ "sigma_kms": 2.5, "equivalent_width_kms": 5.8 }))
        .with("star.contrast", 0.1)
        .with("planet", json!({ "k_kms": 0.0, "porb_over_prot": 1.7, "phi": 0.5 }))
        .with("observations.simulate.spots", spots.clone())
        .with("observations.simulate.cycles", cycles.to_vec())
        .with("observations.simulate.velocity_kms", json!({ "min": -33.0, "max": 33.0, "step": 3.0 }))
        .with("observations.simulate.snr", 500.0)
        .with("observations.simulate.pixels", 2000)
        .with("imaging.pixels", 300)
        .with("imaging.objective", "spottedness")
}

/// Where profiles are given there is nothing to simulate.
fn of_profiles(jitter_kms: f64) -> Config {
    let star = json!({
        "rotation_period_d": 1.0, "inclination_deg": 50.0, "vsini_kms": 25.0, "contrast": 0.1,
        "line": { "sigma_kms": 2.5, "equivalent_width_kms": 5.8 }
    });
    Config::default()
        .with("star", star)
        .with("observations.path", "profiles")
        .with("observations.velocity_jitter_kms", jitter_kms)
        .with("imaging.pixels", 300)
        .with("imaging.objective", "marginal-likelihood")
}

fn with_profiles(profiles: Observations) -> Scene {
    Scene::with_profiles(&of_profiles(0.0), profiles).unwrap()
}

/// Of a spot at longitude 40 that fades, and one at longitude 220 that grows, at a share of the time between.
fn spots(share: f64) -> serde_json::Value {
    json!([[40.0, 35.0, 22.0, 0.95 * (1.0 - share)], [220.0, 35.0, 22.0, 0.95 * share]])
}

/// Profiles of that star, one scene a profile, and the true maps of the first and the last.
fn changing_star() -> (Scene, [Vec<f64>; 2]) {
    let cycles = cycles();
    let last = cycles.len() - 1;
    let of = |k: usize| {
        let share = cycles[k] / cycles[last];
        let config = config(&spots(share), &[cycles[k]]).with("observations.simulate.seed", k);
        Scene::new(&config).unwrap()
    };
    let scenes: Vec<Scene> = (0..cycles.len()).map(of).collect();
    let truth = [0, last].map(|k| scenes[k].true_spot_filling().unwrap());
    let profiles = scenes.iter().map(|scene| scene.observations.profiles[0].clone()).collect();
    (with_profiles(Observations { profiles }), truth)
}

/// Of the upper half of the star and a little more: what is below is hardly seen.
fn seen(scene: &Scene, map: &[f64]) -> Vec<f64> {
    let latitudes = &scene.imager.grid.latitude;
    map.iter().zip(latitudes).filter(|(_, latitude)| latitude.to_degrees() > -20.0).map(|(x, _)| *x).collect()
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    let (mean_a, mean_b) = (mean(a), mean(b));
    let product = |x: &[f64], of_x: f64, y: &[f64], of_y: f64| -> f64 {
        x.iter().zip(y).map(|(x, y)| (x - of_x) * (y - of_y)).sum()
    };
    product(a, mean_a, b, mean_b) / (product(a, mean_a, a, mean_a) * product(b, mean_b, b, mean_b)).sqrt()
}

fn map_at(fit: &SurfaceMaps, k: usize) -> &[f64] {
    &fit.maps[k].pixels
}

#[test]
fn each_night_has_its_own_map_and_far_away_there_is_none() {
    let (scene, truth) = changing_star();
    let far_d = 1e6;
    let fit = scene.maps(Some(&[far_d, 0.0, 9.3])).unwrap();
    let times: Vec<f64> = fit.maps.iter().map(|map| map.time_d.unwrap()).collect();
    assert_eq!(times, [0.0, 9.3, far_d], "in the order of time");
    let correlation = |k: usize, of: usize| correlation(&seen(&scene, map_at(&fit, k)), &seen(&scene, &truth[of]));
    for (own, other) in [(0, 1), (1, 0)] {
        // a map of 16 profiles at S/N 500 has edges blurred and little of the far side: 0.77 and 0.83
        assert!(correlation(own, own) > 0.6, "{own}: {}", correlation(own, own));
        assert!(correlation(own, own) > correlation(own, other) + 0.4, "{own}: {}", correlation(own, other));
    }
    // a static map fits worse, and an evolving one within the noise
    let summary = &fit.summary;
    assert!(summary.chi2_per_datum < 1.1 && summary.chi2_per_datum_unchanging.unwrap() > 1.5, "{summary:?}");
    assert_eq!(fit.model.len(), 16);
    assert_eq!(fit.static_model.as_ref().unwrap().len(), 16);

    // the correlation with all profiles is 0 to rounding: the prior of the field, uniform everywhere
    let amplitude = fit.field.as_ref().unwrap().spot_amplitude;
    let far = &fit.maps[2];
    assert!(far.pixels.iter().all(|x| (x - 0.06).abs() < 1e-12));
    assert!(far.sigma.as_ref().unwrap().iter().all(|sd| (sd / amplitude - 1.0).abs() < 1e-9));
    // at the times of the data it is known better, and best where the star is seen
    for map in &fit.maps[..2] {
        assert!(map.sigma.as_ref().unwrap().iter().all(|sd| *sd < amplitude * (1.0 + 1e-9)));
        assert!(map.sigma.as_ref().unwrap().iter().any(|sd| *sd < 0.8 * amplitude));
    }
    assert!(fit.warnings.iter().any(|warning| warning.contains("1000000.00 d")), "{:?}", fit.warnings);
}

#[test]
fn zero_points_are_no_spots_and_velocities_scatter_by_them() {
    // static spots, with an RV jitter of 1 km/s
    let spots = json!([[40.0, 35.0, 22.0, 0.9]]);
    let jitter_kms = 1.0;
    let whole = config(&spots, &cycles()).with("observations.simulate.velocity_jitter_kms", jitter_kms);
    let whole = Scene::new(&whole).unwrap();
    let truth = whole.true_spot_filling().unwrap();
    let fit = |jitter_kms: f64| {
        let config = of_profiles(jitter_kms).with("imaging.spot_lifetime_d", "static").with("imaging.spot_slope", 0.9);
        let scene = Scene::with_profiles(&config, whole.observations.clone()).unwrap();
        let fit = scene.maps(None).unwrap();
        let like = correlation(&seen(&scene, map_at(&fit, 0)), &seen(&scene, &truth));
        (fit, like)
    };
    let (counted, like) = fit(jitter_kms);
    // static spots have one map, and nothing to compare it with
    assert_eq!((counted.maps.len(), counted.static_model.is_none()), (1, true));
    assert_eq!(counted.zero_points_kms.len(), 16);
    let (ignored, less_like) = fit(0.0);
    assert!(like > less_like, "{like} {less_like}");
    assert!(counted.summary.chi2_per_datum < ignored.summary.chi2_per_datum);
    // velocities have the rms of the jitter and its uncertainties; 16 of them constrain the rms to 18 %
    let (rms, error) = (counted.summary.rv_rms_kms.unwrap(), counted.summary.rv_error_kms.unwrap());
    assert!((rms / jitter_kms - 1.0).abs() < 0.45, "{rms}");
    assert!(error > 0.9 * jitter_kms, "{error}");
}

/// Of all planets, as the orbit is that figures draw beside them.
#[test]
fn velocities_without_spots_hold_a_second_planet() {
    let planets = json!({
        "k_kms": 0.0, "porb_over_prot": 1.7, "phi": 0.5, "k2_kms": 0.5, "porb2_over_prot": 2.3, "phi2": 0.2
    });
    let with_two = |config: Config| config.with("planet", planets.clone());
    let profiles = Scene::new(&with_two(config(&json!([[40.0, 35.0, 22.0, 0.9]]), &cycles()))).unwrap().observations;
    let known = of_profiles(0.0).with("imaging.spot_lifetime_d", "static").with("imaging.spot_slope", 0.9);
    let fit = Scene::with_profiles(&with_two(known), profiles).unwrap().maps(None).unwrap();
    let of = |velocity: &VelocityWithoutSpots| (velocity.marginalised_kms.unwrap(), velocity.moments.orbit_kms);
    let velocities: Vec<([f64; 2], f64)> = fit.velocities.iter().map(of).collect();
    assert!(velocities.iter().any(|(_, orbit)| orbit.abs() > 0.4));
    // within their errors, of which some are as large as the orbit
    let off = velocities.iter().map(|([rv, sigma], orbit)| ((rv - orbit) / sigma).powi(2)).sum::<f64>();
    let absent = velocities.iter().map(|([rv, sigma], _)| (rv / sigma).powi(2)).sum::<f64>();
    assert!(off < 3.0 * velocities.len() as f64 && off < 0.3 * absent, "{off} {absent}");
}

#[test]
fn fields_that_cannot_be_fitted_and_times_without_sense_are_refused_by_name() {
    // profiles of a faster star: no spots explain them
    let other = config(&spots(0.5), &cycles()).with("star.vsini_kms", 40.0).with("observations.simulate.snr", 5000.0);
    let profiles = Scene::new(&other).unwrap().observations;
    // from every lifetime alike
    let scene = Scene::with_profiles(&of_profiles(0.0).with("imaging.spot_lifetime_d", 12.0), profiles).unwrap();
    let status = |times: Option<&[f64]>| scene.maps(times).map(|_| ()).map_err(|error| error.status());
    assert_eq!(status(None), Err(Some("not-settled")));
    for times in [&[][..], &[f64::NAN], &[1.0, f64::INFINITY], &[2.0, 1.0, 2.0], &[1e13]] {
        assert_eq!(status(Some(times)), Err(Some("no-such-times")), "{times:?}");
    }
    assert!(matches!(scene.maps(Some(&[])), Err(NoMaps::Times(_))));
    // for a slightly faster star maps are found, and reported as bad fits
    let other = config(&spots(0.5), &cycles()).with("star.vsini_kms", 32.0).with("observations.simulate.snr", 5000.0);
    let fit = with_profiles(Scene::new(&other).unwrap().observations).maps(None).unwrap();
    assert!(fit.warnings.iter().any(|warning| warning.contains("do not reproduce the profiles")), "{:?}", fit.warnings);
}
