//! `dimcmc plan` as users run it: what is written, drawn and reported, that more nights show smaller planets, that a
//! forecast is what a search of the simulated profiles achieves, and refusals.

use crate::desk::{Desk, dimcmc, says, star, text};
use serde_json::{Value, json};

/// A small star with known spots, observed for some nights.
fn config(nights: usize) -> Value {
    json!({
        "star": star(),
        "observations": { "simulate": {
            "random_spots": { "number": 10, "lifetime_d": 15, "seed": 2 },
            "schedule": { "nights": nights, "per_night": [2, 2], "night_hours": 7.0, "seed": 3 },
            "velocity_kms": { "min": -30, "max": 30, "step": 3.0 }, "snr": 500, "pixels": 1000
        } },
        "imaging": {
            "pixels": 300, "objective": "marginal-likelihood",
            "spot_amplitude": 0.2, "spot_slope": 0.9, "spot_lifetime_d": 12
        },
        "parameters": { "vsys_kms": { "prior": "uniform", "min": -1, "max": 1 } }
    })
}

const QUICK: [&str; 4] = ["--draws", "1000", "--maps", "3"];

fn plan(desk: &Desk, options: &[&str]) -> String {
    desk.succeed(&[&["plan", "config.json"], &QUICK[..], options].concat())
}

/// Columns of a table by name, row by row.
fn column(table: &str, name: &str) -> Vec<f64> {
    let mut lines = table.lines();
    let k = lines.next().unwrap().split(',').position(|one| one == name).unwrap();
    lines.map(|line| line.split(',').nth(k).unwrap().parse().unwrap()).collect()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value}"))
}

#[test]
fn a_config_of_a_star_that_does_not_change_has_a_plan_too() {
    let mut config = config(6);
    config["imaging"] = json!({ "pixels": 300, "seasons": [[-1, 100]], "objective": "spottedness" });
    plan(&Desk::new(config), &["--out", "plan"]);
}

#[test]
fn more_nights_show_smaller_planets_and_the_best_schedule_is_said() {
    let desk = Desk::new(config(10));
    let said = plan(&desk, &["--nights", "6,12", "--out", "a"]);
    says(&said, &["best: config, 12 nights", "K 95 %", "would be found with 95 % probability", "written: a: plan.csv"]);
    let file = desk.json("a/plan.json");
    assert_eq!(file["best"], 2);
    let [few, many] = [0, 1].map(|k| &file["schedules"][k]);
    // one night of two profiles is no orbit
    assert_eq!((few["after"].as_array().unwrap().len(), many["after"].as_array().unwrap().len()), (5, 6));
    let last = |of: &Value| of["after"].as_array().unwrap().last().unwrap().clone();
    assert_eq!((last(few)["profiles"].as_u64(), last(many)["profiles"].as_u64()), (Some(12), Some(24)));
    for key in ["sigma_k_kms", "k50_kms", "k95_kms"] {
        assert!(number(&last(many)[key]) < number(&last(few)[key]), "{key}");
    }
    for at in many["periods"].as_array().unwrap() {
        let [sigma, k50, k95] = ["sigma_k_kms", "k50_kms", "k95_kms"].map(|key| number(&at[key]));
        assert!(sigma < k50 && k50 < k95, "{at}");
    }
    // the same bytes again, whatever the number of threads
    plan(&desk, &["--nights", "6,12", "--out", "b", "--threads", "1"]);
    for name in ["plan.csv", "plan.json"] {
        assert!(desk.read(&format!("a/{name}")) == desk.read(&format!("b/{name}")), "{name}");
    }
    desk.succeed(&["plot", "a"]);
    let svg = desk.read("a/figures/plan.svg");
    assert!(svg.contains("config, 12 nights") && !svg.contains("NaN"), "a figure for a proposal");
    desk.succeed(&["report", "a"]);
    says(&desk.read("a/report.html"), &["The best schedule: config, 12 nights.", "would be found with 95 %"]);
}

/// The search makes the profiles linear at the maps that fit them, the plan at maps that might be there.
#[test]
fn a_forecast_is_what_a_search_achieves() {
    let desk = Desk::new(config(10));
    plan(&desk, &["--out", "plan"]);
    desk.succeed(&["periodogram", "config.json", "--draws", "1000", "--out", "search"]);
    let [plan, search] = ["plan/plan.csv", "search/periodogram.csv"].map(|name| desk.read(name));
    // a search goes from long periods to short ones
    let found = |name: &str| column(&search, name).into_iter().rev().collect::<Vec<f64>>();
    let (forecast, achieved) = (column(&plan, "period_d"), found("period_d"));
    assert_eq!(forecast.len(), achieved.len());
    assert!(forecast.iter().zip(&achieved).all(|(a, b)| (a - b).abs() < 1e-9), "the same periods");
    let ratios = column(&plan, "sigma_k_kms").into_iter().zip(found("sigma_k_kms")).map(|(a, b)| b / a);
    let ratio = median(ratios.collect());
    assert!((ratio - 1.0).abs() < 0.12, "{ratio}");
    let ratios = column(&plan, "k95_kms").into_iter().zip(found("k_limit95_kms")).map(|(a, b)| b / a);
    let ratio = median(ratios.collect());
    assert!((ratio - 1.0).abs() < 0.15, "{ratio}");
}

/// The uncertainty before the next nights is that of a search of the profiles; then it falls.
#[test]
fn the_next_nights_add_to_what_has_been_observed() {
    let mut config = config(6);
    config["plan"] = json!({ "schedule": { "nights": 6, "per_night": [2, 2] }, "snr": 500 });
    let desk = Desk::new(config);
    let said = plan(&desk, &["--out", "a", "--min-period-d", "1", "--max-period-d", "8"]);
    says(&said, &["fitted to the profiles there are"]);
    let file = desk.json("a/plan.json");
    let schedule = &file["schedules"][0];
    assert_eq!(schedule["taken"], 12);
    let after: Vec<(u64, f64)> = schedule["after"]
        .as_array()
        .unwrap()
        .iter()
        .map(|after| (after["nights"].as_u64().unwrap(), number(&after["sigma_k_kms"])))
        .collect();
    assert_eq!(after.iter().map(|(nights, _)| *nights).collect::<Vec<_>>(), [0, 1, 2, 3, 4, 5, 6]);
    assert!(after.windows(2).all(|pair| pair[1].1 < pair[0].1), "{after:?}");
    let span = schedule["span_d"].as_array().unwrap();
    assert!(number(&span[1]) > 11.0 && number(&span[1]) < 13.0, "from the day after the last profile on: {span:?}");
}

/// Nights are chosen for one planet or to distinguish two periods: each adds, and together they constrain more than as
/// many others.
#[test]
fn the_best_of_the_coming_nights_are_chosen() {
    let mut config = config(6);
    config["plan"] = json!({ "schedule": { "nights": 12, "per_night": [1, 4], "seed": 5 }, "snr": 500 });
    let desk = Desk::new(config);
    let chosen = |options: &[&str], out: &str| {
        let said = plan(&desk, &[&["--next", "4", "--out", out], options].concat());
        (said, desk.json(&format!("{out}/plan.json"))["schedules"][0]["next"].clone())
    };
    let (said, next) = chosen(&["--period-d", "4.9"], "a");
    says(&said, &["next nights, for K of a planet of 4.9 d", "4 of 12 nights: chosen ", "evenly spaced", "random"]);
    let sigma = |of: &Value| number(&of["sigma_k_kms"]);
    let nights = next["chosen"].as_array().unwrap();
    let falls: Vec<f64> = std::iter::once(&next["now"]).chain(nights).map(sigma).collect();
    assert!(falls.len() == 5 && falls.windows(2).all(|pair| pair[1] < pair[0]), "{falls:?}");
    for others in ["even", "random"] {
        let other = sigma(next[others].as_array().unwrap().last().unwrap());
        assert!(falls[4] < other, "{others}: {falls:?}, {other}");
    }
    // the same bytes again, whatever the number of threads
    plan(&desk, &["--next", "4", "--period-d", "4.9", "--threads", "1", "--out", "b"]);
    assert!(desk.read("a/plan.json") == desk.read("b/plan.json"));
    desk.succeed(&["plot", "a"]);
    says(&desk.read("a/figures/plan_next.svg"), &["chosen", "even", "random"]);

    let (said, alias) = chosen(&["--period-d", "4.9", "--alias-d", "1.26"], "c");
    says(&said, &["to tell a planet of 4.9 d from one of 1.26 d"]);
    // the part absorbed by another period is lost
    assert!(sigma(alias["chosen"].as_array().unwrap().last().unwrap()) > falls[4]);
    says(&desk.refusal(&["plan", "config.json", "--next", "4", "--out", "d"]), &["planet", "--period-d"]);
}

/// Two spectrographs and a light curve: before the first night, and then from existing observations.
fn two_sets() -> Value {
    let mut config = config(5);
    let mut second = config["observations"].clone();
    config["observations"]["name"] = json!("blue");
    second["name"] = json!("red");
    second["zero_point_kms"] = json!("fitted");
    second["resolving_power"] = json!(40_000);
    let simulate = second["simulate"].as_object_mut().unwrap();
    simulate.remove("random_spots");
    simulate.insert("seed".into(), json!(9));
    simulate.insert("schedule".into(), json!({ "nights": 4, "per_night": [1, 3], "seed": 4 }));
    simulate.insert("velocity_kms".into(), json!({ "min": -28, "max": 28, "step": 2.0 }));
    config["observations"] = json!([config["observations"], second]);
    config["imaging"]["pixels"] = json!(200);
    config["photometry"] = json!({ "name": "tess", "simulate": { "cadence_d": 0.1, "sigma": 5e-4 } });
    config
}

#[test]
fn two_spectrographs_and_a_light_curve_are_planned() {
    let desk = Desk::new(two_sets());
    let said = plan(&desk, &["--out", "a"]);
    says(&said, &["blue: 0 profiles taken, 10 of S/N 500 planned in 5 nights", "red: 0 profiles", "tess: "]);
    let schedule = |out: &str| desk.json(&format!("{out}/plan.json"))["schedules"][0].clone();
    let whole = |of: &Value| of["after"].as_array().unwrap().last().unwrap().clone();
    let first = schedule("a");
    assert_eq!((first["taken"].as_u64(), whole(&first)["nights"].as_u64()), (Some(0), Some(9)));
    plan(&desk, &["--nights", "3", "--out", "fewer"]);
    let fewer = whole(&schedule("fewer"));
    assert_eq!(fewer["nights"].as_u64(), Some(6));
    assert!(number(&fewer["k95_kms"]) > number(&whole(&first)["k95_kms"]));

    // what has been taken, and what comes: by default of the last data set
    let coming = json!({ "schedule": { "nights": 5, "per_night": [2, 2] } });
    desk.set("/plan", coming.clone());
    let said = plan(&desk, &["--next", "2", "--period-d", "4.9", "--out", "red"]);
    says(&said, &["next nights", "data set", "fitted to the profiles there are"]);
    let red = schedule("red");
    let taken = red["sets"][1]["taken"].as_u64();
    assert_eq!(red["sets"][1], json!({ "name": "red", "taken": taken, "planned": 10, "nights": 5, "snr": 500.0 }));
    assert_eq!(red["sets"][0]["snr"], Value::Null);
    assert_eq!(red["next"]["chosen"][0]["set"], "red");
    // nights of either, and photometry beside those of one
    let mut of_blue = coming.clone();
    of_blue["set"] = json!("blue");
    of_blue["snr"] = json!(900);
    of_blue["photometry"] = json!({ "cadence_d": 0.1, "sigma": 5e-4 });
    desk.set("/plan", json!([coming, of_blue]));
    let said = plan(&desk, &["--next", "3", "--period-d", "4.9", "--out", "both"]);
    says(&said, &["of S/N 900 planned in 5 nights", "plan[1].photometry: ", "3 of 10 nights"]);
    let both = schedule("both");
    let light = both["light_curves"].as_array().unwrap();
    let known = light.iter().map(|curve| (curve["name"].as_str().unwrap(), curve["planned"].as_bool().unwrap()));
    assert_eq!(known.collect::<Vec<_>>(), [("tess", false), ("plan[1].photometry", true)]);
    assert!(desk.json("both/plan.json")["measured"]["sets"][1]["zero_point"].is_object(), "what was fitted is told");
    assert_eq!(both["next"]["chosen"][0]["set"], "blue", "the better profiles");
    assert_eq!(number(&both["next"]["now"]["sigma_k_kms"]), number(&red["next"]["now"]["sigma_k_kms"]));
    desk.succeed(&["plot", "both"]);

    let faulty = |key: &str, value: Value, parts: &[&str]| {
        let mut config = two_sets();
        config["plan"] = json!([{}, { "set": "blue" }]);
        *config.pointer_mut(key).unwrap() = value;
        says(&Desk::new(config).refusal(&["plan", "config.json", "--out", "a"]), parts);
    };
    faulty("/plan/1", json!({ "set": "green" }), &["config.json: plan[1].set: \"green\" is not there: blue, red"]);
    faulty("/plan/1", json!({}), &["config.json: plan[1].set: red is planned in plan[0] already"]);
    let light = json!({ "photometry": { "name": "kepler", "cadence_d": 0.1, "sigma": 1e-3 } });
    faulty("/plan/0", light, &["plan[0].photometry.name: \"kepler\"", "tess"]);
    let light = json!({ "photometry": { "cadence_d": 0, "sigma": 1e-3 } });
    faulty("/plan/0", light, &["plan[0].photometry.cadence_d"]);
    faulty("/plan", json!([]), &["plan", "the list is empty"]);
    // a light curve of another year
    let desk = Desk::new(two_sets());
    let rows: String = (0..50).map(|k| format!("{},1,0.001\n", 900.0 + 0.1 * f64::from(k))).collect();
    desk.write("old.csv", &format!("time,flux,sigma\n{rows}"));
    desk.set("/photometry", json!({ "path": "old.csv" }));
    says(&desk.refusal(&["plan", "config.json", "--out", "a"]), &["photometry: its times", "one time system"]);
}

/// For a given site nights are as long as the star is up, and a star that is never up is refused.
#[test]
fn a_place_says_when_a_star_is_up() {
    let site = json!({
        "latitude_deg": 42.94, "longitude_deg": 0.14, "right_ascension_deg": 322.8, "declination_deg": 23.3
    });
    let mut config = config(6);
    config["star"]["epoch_d"] = json!(2_461_260.0);
    config["plan"] = json!({ "schedule": { "nights": 4, "per_night": [3, 3] }, "site": site });
    let desk = Desk::new(config);
    plan(&desk, &["--next", "4", "--period-d", "4.9", "--out", "a"]);
    let file = desk.json("a/plan.json");
    let nights = file["schedules"][0]["next"]["chosen"].as_array().unwrap();
    assert_eq!(nights.len(), 4);
    for night in nights {
        // between 20 and 4 UT
        let hours = [0, 1].map(|k| 24.0 * (number(&night["span_d"][k]) + 0.5).fract());
        assert!(hours[0] > 20.0 || hours[0] < 4.0, "{hours:?}");
        assert!(hours[1] > 20.0 || hours[1] < 4.0, "{hours:?}");
    }
    desk.set("/plan/first_d", json!(2_461_470.0));
    says(&desk.refusal(&["plan", "config.json", "--out", "b"]), &["plan.site: in none of the nights"]);
    desk.set("/plan/first_d", json!(12.0));
    says(&desk.refusal(&["plan", "config.json", "--out", "b"]), &["plan.site.time_zero_jd", "2457000 for BTJD"]);
    desk.set("/plan/site/latitude_deg", json!(100));
    says(&desk.refusal(&["plan", "config.json", "--out", "b"]), &["plan.site.latitude_deg", "-90 to 90"]);
}

#[test]
fn what_makes_no_sense_is_refused() {
    let desk = Desk::new(config(6));
    let refused = |options: &[&str], parts: &[&str]| {
        says(&desk.refusal(&[&["plan", "config.json", "--out", "a"], options].concat()), parts);
    };
    let zero = dimcmc(&["plan", "config.json", "--nights", "0", "--out", "a"], &desk.path(""));
    assert_eq!(zero.status.code(), Some(2));
    says(&text(&zero.stderr), &["--nights", "1 to 1000"]);
    refused(&["--min-period-d=-1"], &["--min-period-d", "positive"]);
    refused(&["--nights", "1"], &["config.json", "three different times"]);
    let faulty = |key: &str, value: Value, parts: &[&str]| {
        let mut config = config(6);
        config[key] = value;
        says(&Desk::new(config).refusal(&["plan", "config.json", "--out", "a"]), parts);
    };
    let path = json!({ "path": "observations.txt" });
    faulty("observations", path, &["config.json: plan: missing", "when is the star to be observed next?"]);
    faulty("plan", json!({ "snr": 0 }), &["config.json: plan.snr", "0"]);
    faulty("plan", json!({ "schedule": { "on_nights": [3, 2] } }), &["plan.schedule.on_nights", "rising"]);
    let listed = json!({ "on_nights": [0, 1, 5], "per_night": [2, 2] });
    desk.set("/observations/simulate/schedule", listed);
    says(&desk.refusal(&["plan", "config.json", "--nights", "4", "--out", "a"]), &["--nights 4", "lists 3 nights"]);
}
