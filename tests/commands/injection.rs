//! `dimcmc inject` as users run it: against a star simulated with the orbit, unchanged parts, refusals, and use by
//! other commands.

use crate::desk::{Desk, says, star};
use dimcmc::internals::data::io::lsd;
use dimcmc::internals::star::observation::Observations;
use serde_json::{Value, json};

const ORBIT: [&str; 6] = ["--k-kms", "0.7", "--porb-over-prot", "1.7", "--phi", "0.3"];

/// A spotted star in a continuum of 20 km/s to either side.
fn desk(snr: Value) -> Desk {
    Desk::new(json!({
        "star": star(),
        "instrument": { "resolving_power": 65000.0 },
        "observations": { "simulate": {
            "spots": [[40, 30, 20, 1], [200, 60, 25, 0.8]],
            "cycles": (0..14).map(|k| 0.23 * f64::from(k)).collect::<Vec<_>>(),
            "velocity_kms": { "min": -50.4, "max": 50.4, "step": 1.8 }, "snr": snr, "pixels": 800
        } },
        "imaging": { "pixels": 300, "chi2_target": 1.0, "objective": "spottedness" },
        "parameters": {
            "k_kms": { "prior": "uniform", "min": 0, "max": 0.5 },
            "phi": { "prior": "periodic" }
        }
    }))
}

fn read(desk: &Desk, folder: &str) -> Observations {
    lsd::read(&desk.path(folder).join("observations.txt")).unwrap().observations
}

#[test]
fn it_is_the_star_with_that_orbit() {
    let desk = desk(Value::Null);
    let says_so = desk.succeed(&[&["inject", "config.json", "--out", "injected"][..], &ORBIT].concat());
    says(&says_so, &["14, shifted by up to 0.69", "0.7 is outside the prior of parameters.k_kms"]);
    desk.set("/planet", json!({ "k_kms": 0.5, "porb_over_prot": 1.7, "phi": 0.3 }));
    let truth = json!({ "k_kms": 0.7, "porb_over_prot": 1.7, "phi": 0.3 });
    desk.set("/observations/simulate/truth", truth);
    desk.succeed(&["simulate", "config.json", "--out", "direct"]);
    let (injected, direct) = (read(&desk, "injected"), read(&desk, "direct"));
    let apart = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    for (k, (a, b)) in injected.profiles.iter().zip(&direct.profiles).enumerate() {
        assert_eq!((a.time_d, &a.sigma), (b.time_d, &b.sigma));
        // the interpolation loses 1e-5 of a depth of 0.2
        assert!(apart(&a.intensity, &b.intensity) < 4e-6, "{k}: {}", apart(&a.intensity, &b.intensity));
    }
    let truth = desk.json("injected/truth.json");
    assert_eq!(truth["injected"], json!({ "k_kms": 0.7, "porb_over_prot": 1.7, "phi": 0.3 }));
    let velocity = truth["velocity_kms"][3].as_f64().unwrap();
    let expected = 0.7 * (std::f64::consts::TAU * (0.69 / 1.7 - 0.3)).cos();
    assert!((velocity - expected).abs() < 1e-9, "{velocity} {expected}");
    desk.succeed(&["plot", "injected"]);
}

#[test]
fn what_a_list_says_stays() {
    let desk = desk(json!(500));
    desk.succeed(&["simulate", "config.json", "--out", "data"]);
    desk.edit("data/observations.txt", |list| {
        let line = |line: &str| if line.starts_with('p') { format!("{line} -3.5  # a night\n") } else { String::new() };
        list.lines().map(line).collect()
    });
    let observations = json!({ "path": "data/observations.txt", "velocity_range_kms": [-30, 38], "sigma_scale": 0.9 });
    desk.set("/observations", observations);
    desk.succeed(&[&["inject", "config.json", "--out", "injected"][..], &ORBIT].concat());
    let config = desk.json("injected/config.json");
    assert_eq!(
        config["observations"],
        json!({ "path": "observations.txt", "velocity_range_kms": [-30.0, 38.0], "sigma_scale": 0.9 })
    );
    assert_eq!(config["planet"]["k_kms"], 0.0, "the start is the config's");
    let list = desk.read("injected/observations.txt");
    assert!(list.contains("p010.prof 6.9 -3.5  # p010.prof"), "{list}");
    let (before, after) = (read(&desk, "data"), read(&desk, "injected"));
    for (b, a) in before.profiles.iter().zip(&after.profiles) {
        assert_eq!((b.time_d, b.intensity.len()), (a.time_d, a.intensity.len()));
        assert!((b.first_velocity_kms - a.first_velocity_kms).abs() < 1e-9);
    }
    // ready for the others
    desk.succeed(&["periodogram", "injected/config.json", "--out", "search", "--draws", "1000"]);
    assert!(desk.json("search/periodogram.json")["best"]["k_kms"].as_f64().unwrap() > 0.5);
}

#[test]
fn orbits_that_make_no_sense_are_refused() {
    let desk = desk(json!(500));
    let refused = |k: &str, period: &str, phi: &str| {
        let orbit = ["--k-kms", k, "--porb-over-prot", period, "--phi", phi, "--out", "x"];
        desk.refusal(&[&["inject", "config.json"][..], &orbit].concat())
    };
    says(&refused("30", "1.7", "0"), &["--k-kms", "from 0 to 25.7", "not 30"]);
    says(&refused("NaN", "1.7", "0"), &["--k-kms", "not NaN"]);
    says(&refused("1", "0", "0"), &["--porb-over-prot", "above 0"]);
    says(&refused("1", "1.7", "inf"), &["--phi", "finite"]);
}
