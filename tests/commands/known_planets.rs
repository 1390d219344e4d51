//! Planets of known ephemeris: each with the other in the model, their tables and figures, and a search for a third
//! one.

use crate::desk::{Desk, says, star};
use serde_json::{Value, json};

/// Periods and conjunctions (d), semi-amplitudes (km/s).
const PERIODS_D: [f64; 2] = [4.9, 10.7];
const CONJUNCTIONS_D: [f64; 2] = [1.2, 5.1];
const K_KMS: [f64; 2] = [0.24, 0.16];

/// A star with evolving spots and two planets.
fn config() -> Value {
    let mut star = star();
    star["mass_msun"] = json!(0.9);
    // nothing is fitted that takes long
    star["regions"] = json!({ "area": 0.0 });
    star["fitted"] = json!([]);
    let normal = |mean: f64, sd: f64| json!({ "prior": "normal", "mean": mean, "sd": sd });
    json!({
        "star": star,
        "planet": {
            "k_kms": K_KMS[0], "period_d": PERIODS_D[0], "t_conjunction_d": CONJUNCTIONS_D[0],
            "k2_kms": K_KMS[1], "period2_d": PERIODS_D[1], "t_conjunction2_d": CONJUNCTIONS_D[1]
        },
        "observations": { "simulate": {
            "random_spots": { "number": 10, "lifetime_d": 15, "seed": 2 },
            "schedule": { "nights": 14, "per_night": [2, 2], "night_hours": 7.0, "seed": 3 },
            "velocity_kms": { "min": -30, "max": 30, "step": 3.0 }, "snr": 800, "seed": 4, "pixels": 1000
        } },
        "imaging": { "pixels": 300, "objective": "marginal-likelihood" },
        "parameters": {
            "k_kms": { "prior": "uniform", "min": 0, "max": 2 },
            "period_d": normal(PERIODS_D[0], 0.001), "t_conjunction_d": normal(CONJUNCTIONS_D[0], 0.01),
            "k2_kms": { "prior": "uniform", "min": 0, "max": 2 },
            "period2_d": normal(PERIODS_D[1], 0.001), "t_conjunction2_d": normal(CONJUNCTIONS_D[1], 0.01),
            "vsys_kms": { "prior": "uniform", "min": -1, "max": 1 }
        }
    })
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value}"))
}

#[test]
fn two_known_planets_are_judged_together_and_a_third_is_found_beside_them() {
    let desk = Desk::new(config());
    let said = desk.succeed(&["periodogram", "config.json", "--draws", "1000", "--out", "search"]);
    says(&said, &["Known planet 1: detected", "Known planet 2: detected", "Blind search: No significant signal"]);
    says(&said, &["planet 1", "planet 2", "msini_mjup", "blind search beside the known planets:"]);
    let file = desk.json("search/periodogram.json");
    for (k, planet) in file["known_planets"].as_array().unwrap().iter().enumerate() {
        let [k_kms, sigma] = ["k_kms", "sigma_k_kms"].map(|key| number(&planet["orbit"][key]));
        assert!((k_kms - K_KMS[k]).abs() < 3.0 * sigma && sigma < 0.05, "{k_kms} +- {sigma}");
        assert_eq!(
            (planet["planet"].as_u64(), &planet["orbit"]["period_d"]),
            (Some(k as u64 + 1), &json!(PERIODS_D[k]))
        );
    }
    assert_eq!(file["best"], file["known_planets"][0]["orbit"]);
    assert_eq!(file["verdict"]["known"]["planet"], 1);
    assert!(number(&file["blind"]["false_alarm_probability"]) > 0.01);
    // nights are those of the known planet
    for night in file["robustness"]["without_night"].as_array().unwrap() {
        assert_eq!(night["phi"], file["best"]["phi"]);
    }
    desk.succeed(&["plot", "search"]);
    says(&desk.read("search/figures/rv.svg"), &["known planet"]);
    desk.succeed(&["report", "search"]);
    says(&desk.read("search/report.html"), &["Known planet 2: detected", "The known planet."]);

    // one known alone: the search beside it finds the other
    let mut alone = config();
    alone["observations"]["simulate"]["truth"] = alone["planet"].clone();
    for section in ["planet", "parameters"] {
        let section = alone[section].as_object_mut().unwrap();
        section.retain(|key, _| !["k2_kms", "period2_d", "t_conjunction2_d"].contains(&key.as_str()));
    }
    let one = Desk::new(alone);
    let said = one.succeed(&["periodogram", "config.json", "--draws", "1000", "--out", "search"]);
    says(&said, &["Known planet: detected", "Blind search: ", "blind search beside the known planet:"]);
    let found = number(&one.json("search/periodogram.json")["peaks"][0]["period_d"]);
    assert!((1.0 / found - 1.0 / PERIODS_D[1]).abs() < 0.5 / 13.0, "the second planet: {found}");
    // a second one beside that is a third of the star
    one.succeed(&["periodogram", "config.json", "--planets", "2", "--draws", "1000", "--out", "third"]);
    let first = &one.json("third/periodogram.json")["second"]["orbits"][0];
    assert!((number(&first["k_kms"]) - K_KMS[1]).abs() < 4.0 * number(&first["sigma_k_kms"]), "{first}");
}

/// Offsets of nights that chance mimics beside both planets: K of the second is counted once.
#[test]
fn offsets_of_nights_leave_two_known_planets_as_they_are() {
    let mut star = config();
    let simulate = &mut star["observations"]["simulate"];
    (simulate["seed"], simulate["random_spots"]["seed"]) = (json!(10), json!(10));
    // an unstable spectrograph, of which they are expected
    star["instrument"]["stability_ms"] = json!(1000);
    let desk = Desk::new(star);
    desk.succeed(&["periodogram", "config.json", "--draws", "1000", "--out", "search"]);
    let file = desk.json("search/periodogram.json");
    assert!(number(&file["false_alarm"]["night_offsets_kms"]) > 0.0, "no offsets");
    for (planet, of) in file["known_planets"].as_array().unwrap().iter().zip(K_KMS) {
        let [k_kms, sigma] = ["k_kms", "sigma_k_kms"].map(|key| number(&planet["orbit"][key]));
        assert!((k_kms - of).abs() < 3.0 * sigma && sigma < 0.05, "{k_kms} +- {sigma}");
    }
}

/// RV offsets from night to night, by chance larger where the planet would be receding.
#[test]
fn a_known_planet_is_compared_with_offsets_of_nights() {
    let mut star = config();
    for section in ["planet", "parameters"] {
        let section = star[section].as_object_mut().unwrap();
        section.retain(|key, _| !["k2_kms", "period2_d", "t_conjunction2_d"].contains(&key.as_str()));
    }
    star["planet"]["k_kms"] = json!(0.0);
    star["observations"]["simulate"]["schedule"]["nights"] = json!(8);
    star["observations"]["simulate"]["schedule"]["per_night"] = json!([4, 4]);
    let desk = Desk::new(star.clone());
    desk.succeed(&["simulate", "config.json", "--out", "data"]);
    let with_offset = |line: &str| match line.split_whitespace().collect::<Vec<_>>()[..] {
        [file, time] if file != "#" => {
            let night = time.parse::<f64>().unwrap().round();
            let orbit = (std::f64::consts::TAU * (night - CONJUNCTIONS_D[0]) / PERIODS_D[0]).sin();
            // what VRAD holds is subtracted
            format!("{file} {time} {}\n", 0.15 * (1.3 * night * night + 1.0).sin() + 0.06 * orbit)
        }
        _ => "# file  time_d  vrad_kms\n".to_owned(),
    };
    desk.edit("data/observations.txt", |list| list.lines().map(with_offset).collect());
    star["observations"] = json!({ "path": "data/observations.txt" });
    star["imaging"]["pixels"] = json!(200);
    desk.write("star.json", &star.to_string());
    let said = desk.succeed(&["periodogram", "star.json", "--planets", "2", "--draws", "1000", "--out", "search"]);
    println!("{said}");
    says(&said, &["Known planet: marginal. ", "one-sided p = 0.00", "not significant beside RV offsets of nights"]);
    let search = desk.json("search/periodogram.json");
    let beside = &search["known_planets"][0]["night_offsets"];
    assert!(number(&beside["sigma_kms"]) > 0.03 && number(&beside["false_alarm_probability"]) > 0.05, "{beside}");
    // the blind search counts those of up to 60 m/s
    let blind = &search["false_alarm"];
    let counted = number(&blind["night_offsets_kms"]);
    assert!(counted > 0.03 && counted < 0.0601 && number(&blind["probability"]) > 0.01, "{blind}");
    says(&said, &["simulations with RV offsets of nights of "]);
    // and so does the search beside the highest peak
    let counted = number(&search["second"]["false_alarm"]["night_offsets_kms"]);
    assert!(counted > 0.02 && counted < 0.0601, "{counted}");
}
