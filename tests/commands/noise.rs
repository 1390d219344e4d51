//! Uncertainties and target chi2 that are left to the observations: noise of known size is recovered, slopes have no
//! effect, noisier profiles have less weight, and all later results equal those with the same numbers given.

use crate::desk::{Desk, says, star};
use dimcmc::internals::data::io::lsd;
use dimcmc::internals::star::observation::Observations;
use serde_json::{Value, json};

/// A spotted star of S/N 500 with a wide continuum, its profiles in `data` after `change`.
fn desk(change: impl Fn(&mut Observations)) -> Desk {
    let desk = Desk::new(json!({
        "star": star(),
        "observations": { "simulate": {
            "spots": [[40, 30, 20, 1], [200, 60, 25, 0.8]],
            "cycles": (0..20).map(|k| 0.17 * f64::from(k)).collect::<Vec<_>>(),
            "velocity_kms": { "min": -72.0, "max": 72.0, "step": 1.8 }, "snr": 500, "pixels": 2000
        } },
        "imaging": { "pixels": 600, "chi2_target": 0.97, "objective": "spottedness" }
    }));
    desk.succeed(&["simulate", "config.json", "--out", "data"]);
    let list = desk.path("data").join("observations.txt");
    let mut observations = lsd::read(&list).unwrap().observations;
    change(&mut observations);
    lsd::write(&desk.path("data"), &observations).unwrap();
    desk.set("/observations", observed("auto", "quoted"));
    desk
}

fn observed(sigma_scale: &str, weights: &str) -> Value {
    json!({
        "path": "data/observations.txt", "velocity_range_kms": [-27, 27],
        "sigma_scale": sigma_scale, "weights": weights
    })
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("no number: {value}"))
}

#[test]
fn errors_quoted_too_large_are_put_right() {
    let desk = desk(|observations| {
        for (k, profile) in observations.profiles.iter_mut().enumerate() {
            profile.sigma.iter_mut().for_each(|sigma| *sigma *= 4.0);
            // a continuum that wanders by many times the noise
            for (j, intensity) in profile.intensity.iter_mut().enumerate().filter(|(j, _)| !(25..56).contains(j)) {
                *intensity += 0.02 + 2e-4 * j as f64 * (k as f64 - 10.0);
            }
        }
    });
    let table = desk.succeed(&["map", "config.json", "--out", "map"]);
    says(&table, &["errors", "rescaled by", "map residuals"]);
    let fit = desk.json("map/fit.json");
    let errors = &fit["measured"]["errors"];
    // 20 profiles of some 24 bins of continuum constrain it to 1/sqrt(2 * 440), 3.4 %; a map of 620 bins to 2.8 %, and
    // 0.97 is the paper's
    assert!((number(&errors["continuum"]) / 0.25 - 1.0).abs() < 0.1, "{errors}");
    assert!((number(&errors["residual"]) / 0.25 - 1.0).abs() < 0.1, "{errors}");
    let scale = number(&errors["sigma_scale"]);
    assert_eq!(scale, number(&errors["continuum"]).max(number(&errors["residual"])));
    assert_eq!(errors["correlated_bins"], 1.0);
    // the same numbers written down give the same map; data of other errors are other data
    desk.set(
        "/observations",
        json!({
            "path": "data/observations.txt", "velocity_range_kms": [-27, 27], "sigma_scale": scale
        }),
    );
    desk.succeed(&["map", "config.json", "--out", "by_hand"]);
    let by_hand = desk.json("by_hand/fit.json");
    assert_eq!(fit["spottedness"], by_hand["spottedness"]);
    assert_ne!(fit["data_sha256"], by_hand["data_sha256"]);
    assert!(by_hand.get("measured").is_none());
}

/// Nuisances are marginalised over with the tested uncertainties, not with the quoted ones.
#[test]
fn nuisances_take_part() {
    let desk = desk(|observations| {
        for profile in &mut observations.profiles {
            profile.sigma.iter_mut().for_each(|sigma| *sigma *= 4.0);
        }
    });
    let mut config: Value = serde_json::from_str(&desk.read("config.json")).unwrap();
    config["imaging"]["nuisances"] = json!({ "continuum_offset": 0.003, "continuum_slope": 0.003 });
    desk.write("config.json", &config.to_string());
    desk.succeed(&["map", "config.json", "--out", "map"]);
    let errors = &desk.json("map/fit.json")["measured"]["errors"];
    // 40 nuisances of 620 bins take up 3 % of the residuals more
    assert!((number(&errors["residual"]) / 0.25 - 1.0).abs() < 0.12, "{errors}");
}

/// The strength of the line is measured below the adjacent continuum, whatever its level, where that level is a
/// nuisance.
#[test]
fn a_continuum_offset_is_not_counted_as_line() {
    let desk = desk(|observations| {
        for profile in &mut observations.profiles {
            profile.intensity.iter_mut().for_each(|intensity| *intensity -= 0.03);
        }
    });
    let mut config: Value = serde_json::from_str(&desk.read("config.json")).unwrap();
    config["observations"] =
        json!({ "path": "data/observations.txt", "velocity_range_kms": [-38, 38], "sigma_scale": 1.0 });
    config["star"]["line"]["equivalent_width_kms"] = json!("auto");
    config["imaging"]["nuisances"] = json!({ "continuum_offset": 0.03 });
    desk.write("config.json", &config.to_string());
    desk.succeed(&["map", "config.json", "--out", "map"]);
    let width = number(&desk.json("map/fit.json")["equivalent_width_kms"]);
    // 76 km/s of 0.03 would add 2.3 km/s; 20 profiles of some 14 bins of continuum of S/N 500 leave 0.02 km/s
    assert!((width - 5.8).abs() < 0.1, "{width}");
}

#[test]
fn a_line_that_no_map_fits_counts_for_more_than_the_continuum() {
    let desk = desk(|observations| {
        for (k, profile) in observations.profiles.iter_mut().enumerate() {
            // waves in the line alone that change from profile to profile
            for (j, intensity) in profile.intensity.iter_mut().enumerate().filter(|(j, _)| (30..51).contains(j)) {
                *intensity += 5e-3 * (2.5 * j as f64 + 7.0 * k as f64 * k as f64).sin();
            }
        }
    });
    desk.succeed(&["map", "config.json", "--out", "map"]);
    let errors = &desk.json("map/fit.json")["measured"]["errors"];
    assert!((number(&errors["continuum"]) - 1.0).abs() < 0.1, "{errors}");
    assert!(number(&errors["residual"]) > 1.3, "{errors}");
    assert_eq!(errors["sigma_scale"], errors["residual"]);
}

/// Noise smoothed over three bins by (1, 2, 1)/4 has correlations 2/3 and 1/6; the local line, 1.56 bins wide, overlaps
/// with itself by 0.902 and 0.663 one and two bins apart: 1 + 2 (2/3 0.902 + 1/6 0.663) = 2.42.
#[test]
fn noise_that_goes_together_makes_errors_larger() {
    let desk = desk(|observations| {
        for profile in &mut observations.profiles {
            let at = |j: isize| profile.intensity[j.clamp(0, 80) as usize];
            let smooth = (0..81).map(|j| 0.25 * (at(j - 1) + 2.0 * at(j) + at(j + 1))).collect();
            profile.intensity = smooth;
        }
    });
    // the line is a little broader after that: a variance of half a bin squared
    let mut config: Value = serde_json::from_str(&desk.read("config.json")).unwrap();
    config["star"]["line"]["sigma_kms"] = json!(2.5_f64.hypot(1.8 * 0.5_f64.sqrt()));
    desk.write("config.json", &config.to_string());
    says(&desk.succeed(&["map", "config.json", "--out", "map"]), &["noise correlation length"]);
    let fit = desk.json("map/fit.json");
    let errors = &fit["measured"]["errors"];
    // the variance of a smoothed bin is 6/16
    assert!((number(&errors["continuum"]) / 0.375_f64.sqrt() - 1.0).abs() < 0.1, "{errors}");
    let bins = number(&errors["correlated_bins"]);
    // 20 profiles of 28 bins beside the line
    assert!((bins / 2.42 - 1.0).abs() < 0.2, "{errors}");
    // the mean of many bins is as well known as before the smoothing
    assert!((number(&errors["sigma_scale"]) - 1.0).abs() < 0.15, "{errors}");
    assert!((number(&fit["chi2_per_datum"]) / (0.97 / bins) - 1.0).abs() < 1e-6);
}

#[test]
fn noisier_profiles_weigh_less() {
    let desk = desk(|observations| {
        // twice the noise, the errors as before
        let mean = 1.0;
        for profile in observations.profiles.iter_mut().take(5) {
            let wild = |j: usize| !(25..56).contains(&j);
            let bins = profile.intensity.iter_mut().enumerate().filter(|(j, _)| wild(*j));
            bins.for_each(|(_, intensity)| *intensity = mean + 2.0 * (*intensity - mean));
        }
    });
    desk.set("/observations", observed("auto", "per-profile"));
    says(&desk.succeed(&["map", "config.json", "--out", "map"]), &["per profile"]);
    let factors = desk.json("map/fit.json")["measured"]["errors"]["profiles"].clone();
    let factors: Vec<f64> = factors.as_array().unwrap().iter().map(number).collect();
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    // each is known to 15 %, 0.02 in the variance of its logarithm, which scatters by 0.09 between such profiles: 80 %
    // of the logarithm remain, and the means are known to 7 and 4 %
    let left = (mean(&factors[..5]) / mean(&factors[5..])).log2();
    assert!((left - 0.8).abs() < 0.2, "{left}");
    let weight = mean(&factors.iter().map(|f| f.powi(-2)).collect::<Vec<_>>());
    assert!((weight - 1.0).abs() < 0.01, "the weights as a whole stay: {weight}");
}

/// Random differences in the rms of equal profiles, 15 % each, are not treated as real.
#[test]
fn equal_profiles_weigh_alike() {
    let desk = desk(|_| ());
    desk.set("/observations", observed("auto", "per-profile"));
    desk.succeed(&["map", "config.json", "--out", "map"]);
    let factors = desk.json("map/fit.json")["measured"]["errors"]["profiles"].clone();
    let factors: Vec<f64> = factors.as_array().unwrap().iter().map(number).collect();
    assert!(factors.iter().all(|factor| (factor - 1.0).abs() < 0.08), "{factors:?}");
}

#[test]
fn without_continuum_there_are_no_weights() {
    let desk = desk(|observations| {
        for profile in &mut observations.profiles {
            (profile.intensity, profile.sigma) = (profile.intensity[25..56].to_vec(), profile.sigma[25..56].to_vec());
            profile.first_velocity_kms += 25.0 * 1.8;
        }
    });
    let refused = |weights| {
        desk.set("/observations", observed("auto", weights));
        desk.refusal(&["map", "config.json", "--out", "x"])
    };
    says(&refused("per-profile"), &["config.json: observations.weights: profile 1", "too little continuum"]);
    desk.set("/observations", observed("auto", "quoted"));
    desk.succeed(&["map", "config.json", "--out", "map"]);
    let errors = &desk.json("map/fit.json")["measured"]["errors"];
    assert_eq!((&errors["continuum"], &errors["sigma_scale"]), (&Value::Null, &errors["residual"]));
    desk.set("/observations/sigma_scale", json!("guess"));
    says(&desk.refusal(&["map", "config.json", "--out", "x"]), &["observations.sigma_scale", "a number or \"auto\""]);
}

/// With the right errors the target is near 1 (a little above for few and noisy profiles), and the residual velocities
/// are photon noise.
#[test]
fn the_target_is_where_velocities_stop_shrinking() {
    let desk = desk(|_| ());
    desk.set("/observations", json!({ "path": "data/observations.txt", "velocity_range_kms": [-34.2, 34.2] }));
    let config = json!({ "pixels": 600, "chi2_target": "auto", "objective": "spottedness" });
    let mut whole: Value = serde_json::from_str(&desk.read("config.json")).unwrap();
    whole["imaging"] = config;
    desk.write("config.json", &whole.to_string());
    says(&desk.succeed(&["map", "config.json", "--out", "map"]), &["target chi2", "filtered residual RV rms"]);
    let fit = desk.json("map/fit.json");
    let target = &fit["measured"]["chi2_target"];
    assert!((0.8..1.15).contains(&number(&target["value"])), "{target}");
    assert!((number(&fit["chi2_per_datum"]) - number(&target["value"])).abs() < 1e-6);
    // between images linear, so a little off
    let (here, there) = (number(&target["filtered_rv_rms_kms"]), number(&fit["filtered_rv_rms_kms"]));
    assert!((here / there - 1.0).abs() < 0.02, "{here} {there}");
    assert!(there < 1.4 * number(&fit["photon_rv_error_kms"]), "{there}");
    assert_eq!(fit["config"]["imaging"]["chi2_target"], "auto");
    desk.succeed(&["map", "config.json", "--out", "again"]);
    assert_eq!(desk.read("map/fit.json"), desk.read("again/fit.json"));
}

/// Whatever is measured on them, over whichever range.
#[test]
fn a_profile_is_opened_once_in_a_command() {
    let desk = desk(|_| ());
    let mut config = desk.json("config.json");
    config["parameters"] = json!({ "k_kms": { "prior": "uniform", "min": 0, "max": 1 } });
    config["sampler"] = json!({ "steps": 2, "ensembles": 2, "walkers": 4, "seed": 1 });
    config["grid"] = json!({ "axes": { "k_kms": [0, 0.2, 3] } });
    desk.write("config.json", &config.to_string());
    let config = desk.path("config.json");
    let opened =
        || -> Vec<usize> { (0..20).map(|k| lsd::times_opened(&desk.path(&format!("data/p{k:03}.prof")))).collect() };
    let orbit = ["--k-kms", "0.1", "--porb-over-prot", "2", "--phi", "0"];
    for (command, options) in [
        ("map", &[][..]),
        ("periodogram", &["--draws", "1000"]),
        ("limits", &["--periods", "4", "--full", "2", "--draws", "1000"]),
        ("inject", &orbit),
        ("optimise", &[]),
        ("grid", &[]),
        ("sample", &[]),
    ] {
        let before = opened();
        let out = desk.path(command);
        let paths = ["dimcmc", "-q", command, config.to_str().unwrap(), "--out", out.to_str().unwrap()];
        // in this process, which counts
        let code = dimcmc::command_line(paths.iter().chain(options).map(Into::into));
        assert_eq!(code, 0, "{command}");
        assert!(opened().iter().zip(before).all(|(after, before)| after - before == 1), "{command}: {:?}", opened());
    }
}
