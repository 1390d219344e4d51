//! Activity indicators from their tables to a map; and refusals.

use super::desk::{Desk, says};
use serde_json::{Value, json};

const CONFIG: &str = "config.json";

/// A star with profiles of a week, and a light curve from which its indicator is made.
fn star() -> Value {
    let cycles: Vec<f64> = (0..9).map(|k| 0.31 * f64::from(k)).collect();
    json!({
        "star": { "rotation_period_d": 3.0, "inclination_deg": 60.0, "vsini_kms": 22.0, "contrast": 0.3, "fitted": [],
                  "line": { "sigma_kms": 3.0, "equivalent_width_kms": 6.0 } },
        "imaging": { "pixels": 200, "objective": "marginal-likelihood", "spot_amplitude": 0.2, "spot_slope": 0.9,
                     "spot_lifetime_d": 15 },
        "observations": { "velocity_jitter_kms": 0.0, "simulate": {
            "random_spots": { "number": 8, "lifetime_d": 20, "seed": 4 }, "cycles": cycles,
            "velocity_kms": { "min": -33.0, "max": 33.0, "step": 3.0 }, "pixels": 1000 } },
        "photometry": { "name": "tess", "contrast": 0.0, "simulate": { "cadence_d": 0.2, "sigma": 1e-4 } }
    })
}

/// A desk with the profiles in `data`, and the values of an indicator that falls with the filling factor of the disc.
fn desk() -> (Desk, Vec<[f64; 2]>) {
    let desk = Desk::new(star());
    desk.succeed(&["simulate", CONFIG, "--out", "data"]);
    let light = desk.read("data/tess.csv");
    let rows = light.lines().skip(1).map(|line| line.split(',').map(|x| x.parse().unwrap()).collect::<Vec<f64>>());
    let values = rows.map(|row| [row[0], 0.2 - 0.5 * (1.0 - row[1])]).collect();
    (desk, values)
}

/// The config that reads the files, with these indicators.
fn with(indicators: Value) -> Value {
    let mut config = star();
    config.as_object_mut().unwrap().remove("photometry");
    config["observations"] = json!({ "path": "data/observations.txt", "velocity_jitter_kms": 0.0, "events": "none" });
    config["indicators"] = indicators;
    config
}

#[test]
fn an_indicator_from_its_table_to_a_map() {
    let (desk, values) = desk();
    let rows: String = values.iter().map(|[t, v]| format!("{t}\t{v}\t0.001\n")).collect();
    desk.write("data/halpha.rdb", &format!("# H alpha\nbjd\thalpha\terr_halpha\n---\t---\t---\n{rows}"));
    // values unrelated to spots
    let rows: String = (0..values.len()).map(|k| format!("{} {} 1\n", values[k][0], (k * k * 7 % 11) as f64)).collect();
    desk.write("data/noise.txt", &format!("JD value sigma\n{rows}"));
    let both = json!([{ "name": "halpha", "path": "data/halpha.rdb" }, { "path": "data/noise.txt" }]);
    desk.write("star.json", &with(both).to_string());
    let said = desk.succeed(&["map", "star.json", "--out", "map"]);
    let count = values.len();
    says(
        &said,
        &[&format!("halpha: {count} values, gain -"), &format!("indicator2: {count} values, not used: no sig")],
    );
    let fit = desk.json("map/fit.json");
    let found = &fit["measured"]["indicators"];
    let number = |of: usize, key: &str| found[of][key].as_f64().unwrap();
    // it goes with the amplitude of the spots, which is held
    assert!((-0.6..-0.25).contains(&number(0, "gain")) && number(0, "ln_bayes") > 10.0, "{found}");
    assert_eq!(number(1, "gain"), 0.0);
    // the used one is tabulated with its prediction by the maps, and drawn by its name
    let table = desk.read("map/indicators.csv");
    assert_eq!(table.lines().next(), Some("time_d,value,sigma,model,residual,indicator"));
    let rows: Vec<Vec<f64>> =
        table.lines().skip(1).map(|line| line.split(',').map(|x| x.parse().unwrap()).collect()).collect();
    assert_eq!(rows.len(), count);
    for (row, [t, v]) in rows.iter().zip(&values) {
        assert!((row[0] - t).abs() < 1e-9 && (row[1] - v).abs() < 1e-9 && row[5] == 1.0, "{row:?} {t} {v}");
        assert!((row[3] + row[4] - row[1]).abs() < 1e-12, "{row:?}");
    }
    let squares = |of: &dyn Fn(&Vec<f64>) -> f64| rows.iter().map(|row| of(row).powi(2)).sum::<f64>();
    let mean = rows.iter().map(|row| row[1]).sum::<f64>() / count as f64;
    assert!(squares(&|row| row[4]) < 0.2 * squares(&|row| row[1] - mean), "{table}");
    assert!(squares(&|row| row[4] / row[2]) < 2.0 * count as f64, "{table}");
    desk.succeed(&["plot", "map", "--out", "figures"]);
    says(&desk.read("figures/indicators.svg"), &["halpha", "most probable maps", "residual"]);
    // a useless one by itself changes no byte of the maps
    let own = |indicators: Value, out: &str| {
        let mut config = with(indicators);
        if config["indicators"].is_null() {
            config.as_object_mut().unwrap().remove("indicators");
        }
        desk.write("own.json", &config.to_string());
        desk.succeed(&["map", "own.json", "--out", out]);
        (desk.read(&format!("{out}/profiles.csv")), desk.read(&format!("{out}/rv.csv")))
    };
    assert!(own(json!({ "path": "data/noise.txt" }), "noise") == own(Value::Null, "none"));
    assert!(!desk.path("noise/indicators.csv").exists());
    // nor does a table stay of maps that are replaced
    desk.succeed(&["map", "own.json", "--out", "map", "--force"]);
    assert!(!desk.path("map/indicators.csv").exists());
    // tables and what was found travel with an injected orbit
    desk.succeed(&["inject", "star.json", "--k-kms", "0.2", "--porb-over-prot", "1.7", "--phi", "0", "--out", "more"]);
    says(&desk.succeed(&["map", "more/config.json", "--out", "again"]), &["halpha: ", "gain -"]);
}

#[test]
fn a_first_config_has_indicators_that_are_named() {
    let (desk, values) = desk();
    let rows: String = values.iter().map(|[t, v]| format!("{t},{v},0.001\n")).collect();
    desk.write("data/h alpha.csv", &format!("time,value,sigma\n{rows}"));
    std::fs::create_dir(desk.path("data/deep")).unwrap();
    desk.write("data/deep/halpha.csv", &format!("time,value,sigma\n{rows}"));
    desk.write("data/deep/HALPHA.csv", &format!("time,value,sigma\n{rows}"));
    let init = ["init", "data/observations.txt", "--rotation-period", "3", "--inclination", "60", "--pixels", "200"];
    let first = ["h alpha", "deep/halpha", "deep/HALPHA"].map(|name| format!("--indicator=data/{name}.csv"));
    let first = first.each_ref().map(String::as_str);
    let said = desk.succeed(&[&init[..], &first, &["--out", "star.json"]].concat());
    says(&said, &[&format!("note: indicator halpha: {} values, gain -", values.len()), "note: indicator indicator2: "]);
    let found = &desk.json("star.json")["indicators"];
    assert_eq!(
        *found,
        json!([{ "name": "halpha", "path": "data/h alpha.csv" },
               { "name": "indicator2", "path": "data/deep/halpha.csv" },
               { "name": "indicator3", "path": "data/deep/HALPHA.csv" }])
    );
    let refused = |more: &[&str], parts: &[&str]| says(&desk.refusal(&[&init[..], more].concat()), parts);
    refused(&["--indicator", "absent.csv", "--out", "no.json"], &["absent.csv: cannot read"]);
    refused(
        &["--indicator", "data/deep/halpha.csv", "--objective", "spottedness", "--out", "no.json"],
        &["--indicator: takes the objective \"marginal-likelihood\""],
    );
    refused(&[&first[..1], &["--out", "data/h alpha.csv", "--force"]].concat(), &["h alpha.csv"]);
}

#[test]
fn what_makes_no_sense_is_refused_by_file_and_row_or_by_key() {
    let (desk, values) = desk();
    let refused = |table: &str, change: &dyn Fn(&mut Value), parts: &[&str]| {
        desk.write("data/s.csv", table);
        let mut config = with(json!({ "path": "data/s.csv" }));
        change(&mut config);
        desk.write("star.json", &config.to_string());
        says(&desk.refusal(&["map", "star.json", "--out", "map"]), parts);
    };
    let table = |from: usize, to: usize| {
        let row = |[t, v]: &[f64; 2]| format!("{t},{v},0.001\n");
        format!("time,value,sigma\n{}", values[from..to].iter().map(row).collect::<String>())
    };
    let same = |_: &mut Value| ();
    refused("time,value,sigma\n1,x,0.1\n", &same, &["data/s.csv:2: value: \"x\""]);
    refused("time,value\n1,2\n2,3\n", &same, &["data/s.csv: ", "no column sigma", "time, value, sigma among them"]);
    refused("no table\n", &same, &["data/s.csv: the table has no row of numbers"]);
    refused(&table(0, 4), &same, &["star.json: indicators: 4 of 4 values left, at least 6 are needed"]);
    let exclude = |config: &mut Value| config["indicators"]["exclude"] = json!([[0.0, 100.0]]);
    refused(&table(0, 20), &exclude, &["star.json: indicators.exclude: 0 of 20 values left"]);
    let far = table(0, 20).replace("\n", "\n9") + "1,0,0.001\n";
    refused(&far, &same, &["star.json: indicators: its times, ", "from any profile"]);
    let objective = |config: &mut Value| {
        config["imaging"] = json!({ "pixels": 200, "objective": "spottedness" });
        config["observations"].as_object_mut().unwrap().remove("events");
    };
    refused(&table(0, 20), &objective, &["star.json: indicators: ", "\"spottedness\" has no model of activity"]);
    let lost = |config: &mut Value| config["indicators"]["path"] = json!("data/lost.csv");
    refused(&table(0, 20), &lost, &["data/lost.csv: cannot read"]);
    let unknown = |config: &mut Value| config["indicators"]["gain"] = json!(1);
    refused(&table(0, 20), &unknown, &["star.json: unknown key indicators.gain"]);
}
