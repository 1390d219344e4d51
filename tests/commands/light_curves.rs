//! Light curves beside profiles: simulated, read from a table, mapped and drawn; and refusals.

use super::desk::{Desk, says};
use serde_json::{Value, json};

const CONFIG: &str = "config.json";

/// A star with profiles of a week and a light curve, simulated.
fn star() -> Value {
    let cycles: Vec<f64> = (0..7).map(|k| 0.37 * f64::from(k)).collect();
    json!({
        "star": { "rotation_period_d": 3.0, "inclination_deg": 60.0, "vsini_kms": 22.0,
                  "photosphere_k": 4500, "spot_k": 3400, "line": { "sigma_kms": 3.0, "equivalent_width_kms": 6.0 } },
        "imaging": { "pixels": 200, "objective": "marginal-likelihood", "spot_amplitude": 0.2, "spot_slope": 0.9,
                     "spot_lifetime_d": 15 },
        "observations": { "velocity_jitter_kms": 0.0, "simulate": {
            "random_spots": { "number": 8, "lifetime_d": 20, "seed": 4 }, "cycles": cycles,
            "velocity_kms": { "min": -33.0, "max": 33.0, "step": 3.0 }, "pixels": 1000 } },
        "photometry": { "name": "tess", "wavelength_nm": 790, "segment_gap_d": 1.0,
                        "limb_darkening": { "law": "quadratic", "coefficients": [0.4, 0.2] },
                        "simulate": { "cadence_d": 0.05, "sigma": 3e-4 } }
    })
}

/// The same read from the files that `simulate` has written to `data`.
fn from_files() -> Value {
    let mut config = star();
    config["observations"] = json!({ "path": "data/observations.txt", "velocity_jitter_kms": 0.0 });
    let light = config["photometry"].as_object_mut().unwrap();
    light.remove("simulate");
    light.insert("path".into(), json!("data/tess.csv"));
    config
}

#[test]
fn a_light_curve_from_its_table_to_a_figure() {
    let desk = Desk::new(star());
    says(&desk.succeed(&["simulate", CONFIG, "--out", "data"]), &["tess.csv: 134 measurements"]);
    let table = desk.read("data/tess.csv");
    assert!(table.starts_with("time,flux,sigma\n"));
    // two days are lost, and the flux is in counts, rising and falling where the instrument does
    let kept = table.lines().skip(1).map(|line| line.split(',').map(|x| x.parse().unwrap()).collect::<Vec<f64>>());
    let drift = |t: f64| if t < 2.0 { 1000.0 } else { 1500.0 * (1.0 + 0.01 * (t - 5.0)) };
    let kept = kept.filter(|row| !(2.0..4.0).contains(&row[0]));
    let rows: String =
        kept.map(|row| format!("{},{},{}\n", row[0], row[1] * drift(row[0]), row[2] * drift(row[0]))).collect();
    desk.write("data/tess.csv", &format!("time,flux,sigma\n{rows}"));
    desk.write("star.json", &from_files().to_string());
    let said = desk.succeed(&["map", "star.json", "--out", "map"]);
    says(&said, &["light curve", "tess: ", "in 2 segments", "flux", "χ²/N", "lightcurve.csv"]);
    // a transit, which no spot explains
    let deep = |line: &str| match line.split(',').map(str::parse::<f64>).collect::<Result<Vec<_>, _>>() {
        Ok(row) if (4.9..5.1).contains(&row[0]) => format!("{},{},{}", row[0], 0.9 * row[1], row[2]),
        _ => line.to_owned(),
    };
    let whole = desk.read("data/tess.csv");
    desk.write("data/tess.csv", &whole.lines().map(deep).collect::<Vec<_>>().join("\n"));
    let mut config = from_files();
    config["photometry"]["exclude"] = json!([[4.9, 5.1]]);
    desk.write("cut.json", &config.to_string());
    says(&desk.succeed(&["map", "cut.json", "--out", "cut"]), &["in 2 segments", "4 measurements left out"]);
    let times = desk.read("cut/lightcurve.csv");
    let times = times.lines().skip(1).map(|line| line.split(',').next().unwrap().parse::<f64>().unwrap());
    assert!(times.clone().all(|time| !(4.9..5.1).contains(&time)) && times.count() > 20);
    desk.write("data/tess.csv", &whole);
    let table = desk.read("map/lightcurve.csv");
    let mut lines = table.lines();
    assert_eq!(lines.next(), Some("time_d,flux,sigma,model,residual,segment,band"));
    let bins: Vec<Vec<f64>> = lines.map(|l| l.split(',').map(|x| x.parse().unwrap()).collect()).collect();
    // level and drift are not spots: the residual is noise
    let chi2: f64 = bins.iter().map(|bin| (bin[4] / bin[2]).powi(2)).sum();
    assert!(chi2 < 1.6 * bins.len() as f64, "{chi2} of {} bins", bins.len());
    let spread = |column: usize| {
        let values = || bins.iter().map(|bin| bin[column]);
        values().fold(f64::MIN, f64::max) - values().fold(f64::MAX, f64::min)
    };
    assert!(spread(3) > 0.005 && bins.iter().any(|bin| bin[5] == 2.0), "spots are seen in the flux");
    desk.succeed(&["plot", "map"]);
    assert!(desk.read("map/figures/lightcurve.svg").contains("most probable maps"));
    says(&desk.read("map/fit.json"), &["light_curves"]);
}

/// A planet and its star, for two rotations.
fn with_planet() -> Value {
    let mut config = star();
    config["planet"] = json!({ "k_kms": 0.3, "porb_over_prot": 1.3, "phi": 0.2 });
    config["imaging"]["spot_break_degree"] = json!(0);
    let cycles: Vec<f64> = (0..9).map(|k| 0.27 * f64::from(k)).collect();
    config["observations"]["simulate"]["cycles"] = json!(cycles);
    config["parameters"] = json!({
        "k_kms": { "prior": "uniform", "min": 0.0, "max": 1.0 },
        "porb_over_prot": { "prior": "uniform", "min": 0.5, "max": 4.0 },
        "phi": { "prior": "periodic" }
    });
    config
}

/// One of 122 fluxes that is 5 % too high made a signal more significant by a factor of 1e23, and its period another.
#[test]
fn a_wild_point_is_named_and_moves_no_planet() {
    let desk = Desk::new(with_planet());
    desk.succeed(&["simulate", CONFIG, "--out", "data"]);
    let mut config = with_planet();
    config["observations"] = from_files()["observations"].clone();
    config["photometry"] = from_files()["photometry"].clone();
    desk.write("star.json", &config.to_string());
    let signal = |out: &str, parts: &[&str]| {
        says(&desk.succeed(&["periodogram", "star.json", "--out", out]), parts);
        let file: Value = serde_json::from_str(&desk.read(&format!("{out}/periodogram.json"))).unwrap();
        let verdict = &file["verdict"];
        let of = |key: &str| verdict["signal"][key].as_f64().unwrap();
        let ln_fap = verdict["false_alarm_probability"].as_f64().unwrap().ln();
        [of("k_kms"), of("sigma_k_kms"), of("period_d"), ln_fap]
    };
    let good = signal("good", &["light curve: tess: "]);
    let table = desk.read("data/tess.csv");
    let high = |(k, line): (usize, &str)| match line.split(',').collect::<Vec<_>>()[..] {
        [time, flux, sigma] if k == 60 => format!("{time},{},{sigma}\n", 1.05 * flux.parse::<f64>().unwrap()),
        _ => format!("{line}\n"),
    };
    desk.write("data/tess.csv", &table.lines().enumerate().map(high).collect::<String>());
    let note = "1 outlying point rejected (photometry.outliers \"keep\" keeps them): 2.950 d (flux 0.997";
    let wild = signal("wild", &["light curve: tess: ", note]);
    let sigma = good[1];
    assert!((wild[0] - good[0]).abs() < 0.1 * sigma && (wild[1] / sigma - 1.0).abs() < 0.03, "{good:?} {wild:?}");
    assert!((wild[2] - good[2]).abs() < 0.01 && (wild[3] - good[3]).abs() < f64::ln(3.0), "{good:?} {wild:?}");
    // if kept, it is named where it affects the result
    config["photometry"]["outliers"] = json!("keep");
    desk.write("star.json", &config.to_string());
    let said = desk.succeed(&["map", "star.json", "--out", "kept"]);
    assert!(!said.contains("outlying point"), "{said}");
    let fit: Value = serde_json::from_str(&desk.read("kept/fit.json")).unwrap();
    says(&fit["warnings"].to_string(), &["light curve tess", "2.9", "sigma", "photometry.exclude"]);
    let fit: Value = serde_json::from_str(&desk.read("wild/periodogram.json")).unwrap();
    says(&fit["measured"]["light_curve_notes"].to_string(), &["1 outlying point"]);
}

#[test]
fn what_was_left_out_and_converted_is_told() {
    let mut config = star();
    config["star"]["epoch_d"] = json!(2_459_000.5);
    let desk = Desk::new(config.clone());
    desk.succeed(&["simulate", CONFIG, "--out", "data"]);
    let btjd = |(k, line): (usize, &str)| match line.split(',').map(str::parse::<f64>).collect::<Result<Vec<_>, _>>() {
        Ok(row) if k == 30 => format!("{};;;G\n", row[0] - 2_457_000.0),
        Ok(row) => format!("{};{};{};{}\n", row[0] - 2_457_000.0, row[1], row[2], if k == 40 { "B" } else { "G" }),
        Err(_) => "# sector 12\nBTJD;flux;flux_err;quality\n".into(),
    };
    let table = desk.read("data/tess.csv").lines().enumerate().map(btjd).collect::<String>();
    desk.write("data/tess.csv", &table);
    config["observations"] = from_files()["observations"].clone();
    config["photometry"] = from_files()["photometry"].clone();
    desk.write("star.json", &config.to_string());
    let notes =
        ["1 of 134 rows left out, whose numbers", "1 of 134 rows left out that the column quality", "2457000 added"];
    says(&desk.succeed(&["map", "star.json", "--out", "map"]), &notes);
    let first = desk.read("map/lightcurve.csv").lines().nth(1).unwrap().split(',').next().unwrap().to_owned();
    assert!((first.parse::<f64>().unwrap() - 2_459_000.5).abs() < 0.1, "{first}");
}

#[test]
fn what_is_no_light_curve_is_refused_by_key_file_or_line() {
    let refused = |edit: &dyn Fn(&mut Value), parts: &[&str]| {
        let mut config = star();
        edit(&mut config);
        says(&Desk::new(config).refusal(&["map", CONFIG, "--out", "map"]), parts);
    };
    let set = |key: &'static str, value: Value| move |c: &mut Value| c["photometry"][key] = value.clone();
    refused(&set("colour", json!("red")), &["unknown key photometry.colour"]);
    refused(&set("contrast", json!(0.5)), &["photometry.wavelength_nm", "not both"]);
    refused(&set("wavelength_nm", json!(-5)), &["photometry.wavelength_nm", "above 0"]);
    refused(&set("sigma_scale", json!(0)), &["photometry.sigma_scale", "above 0"]);
    refused(&set("segment_gap_d", json!(-1)), &["photometry.segment_gap_d", "0 to 1000"]);
    refused(&set("exclude", json!([[2, 1]])), &["photometry.exclude[0]", "before the end"]);
    refused(&set("exclude", json!([[-1, 100]])), &["photometry.exclude", "leaves 0 of 134 measurements"]);
    refused(&set("path", json!("tess.csv")), &["photometry", "not both"]);
    refused(
        &set("limb_darkening", json!({ "law": "linear", "coefficients": [2.0] })),
        &["photometry.limb_darkening.coefficients", "0 to 1"],
    );
    refused(&|c| c["photometry"]["simulate"]["sigma"] = json!(0), &["photometry.simulate.sigma", "above 0"]);
    refused(&|c| c["photometry"]["simulate"]["cadence_d"] = json!(1e-7), &["photometry.simulate.cadence_d", "over"]);
    refused(&|c| c["photometry"] = json!([c["photometry"], c["photometry"]]), &["photometry[1].name", "photometry[0]"]);
    refused(&|c| c["photometry"] = json!([]), &["photometry", "empty"]);
    refused(
        &|c| c["imaging"] = json!({ "pixels": 200, "objective": "spottedness" }),
        &["photometry", "\"spottedness\"", "marginal-likelihood"],
    );
    let desk = Desk::new(star());
    desk.succeed(&["simulate", CONFIG, "--out", "data"]);
    desk.write("star.json", &from_files().to_string());
    let table = |text: &str, parts: &[&str]| {
        desk.write("data/tess.csv", text);
        says(&desk.refusal(&["map", "star.json", "--out", "map"]), parts);
    };
    table("time,flux\n1,2\n", &["tess.csv", "no column sigma", "time, flux, sigma"]);
    table("time,flux,sigma\n1,-2,0.1\n", &["tess.csv:2", "flux: -2 must be above 0"]);
    table("time,flux,sigma\n1,2,0\n2,2,0\n", &["tess.csv:2", "sigma: 0 must be above 0"]);
    table("time,flux,sigma\n1,nan,0.1\n", &["tess.csv:2", "flux"]);
    table("time,flux,sigma\nnoon,2,0.1\n", &["tess.csv:2", "noon"]);
    table("time,flux,sigma\n2457000,2,0.1\n", &["photometry", "from any profile", "one time system", "BTJD"]);
    table("time,flux,sigma\n1,11.2,0.01\n2,11.3,0.01\n", &["tess.csv", "magnitudes", "mag"]);
    table("SIMPLE  =                    T", &["tess.csv", "a FITS file", "to_csv"]);
    says(&desk.refusal(&["simulate", "star.json", "--out", "x"]), &["observations.simulate"]);
}
