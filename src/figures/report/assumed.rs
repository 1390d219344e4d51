//! The assumptions of a result: fixed values, priors, and quantities measured from the observations.

use super::chapter::{Table, table};
use crate::figures::plot::symbols::label;
use crate::model::Parameter;
use crate::planets::periodogram::{USUAL_STABILITY_KMS, most_offset_kms};
use crate::planets::speeds::with_unit;
use crate::surface::calibration::star::mean_and_sd;
use serde_json::Value;
use std::collections::BTreeMap;

const NIGHTS: &str = "/observations/night_jitter_kms";

/// Keys of a config with their names and units.
const KEYS: [(&str, &str, &str); 26] = [
    ("/star/rotation_period_d", "rotation period", "d"),
    ("/star/epoch_d", "epoch of rotation phase 0", "d"),
    ("/star/inclination_deg", "inclination", "°"),
    ("/star/vsini_kms", "*v* sin *i*", "km/s"),
    ("/star/vsys_kms", "systemic velocity", "km/s"),
    ("/star/domega_rad_d", "differential rotation d*Ω*", "rad/d"),
    ("/star/mass_msun", "stellar mass", "*M*_{Sun}"),
    ("/star/limb_darkening/law", "limb-darkening law", ""),
    ("/star/limb_darkening/coefficients", "limb-darkening coefficients", ""),
    ("/star/photosphere_k", "photospheric temperature", "K"),
    ("/star/spot_k", "spot temperature", "K"),
    ("/star/wavelength_nm", "wavelength", "nm"),
    ("/star/contrast", "brightness of a spot over that of the photosphere", ""),
    ("/star/line/shape", "local line profile", ""),
    ("/star/line/sigma_kms", "standard deviation of the local line", "km/s"),
    ("/star/line/equivalent_width_kms", "equivalent width", "km/s"),
    ("/instrument/name", "spectrograph", ""),
    ("/instrument/resolving_power", "resolving power", ""),
    ("/observations/sigma_scale", "scale of the uncertainties", ""),
    ("/observations/velocity_jitter_kms", "RV jitter", "km/s"),
    (NIGHTS, "RV offsets of nights", "km/s"),
    ("/imaging/objective", "surface model", ""),
    ("/imaging/brightness", "pixels hold", ""),
    ("/imaging/pixels", "pixels", ""),
    ("/imaging/chi2_target", "target χ²/N", ""),
    ("/imaging/spot_lifetime_d", "spot lifetime", "d"),
];

/// Keys that only static maps use.
const STATIC: [&str; 1] = ["/imaging/chi2_target"];

fn is_evolving(config: &Value) -> bool {
    config.pointer("/imaging/objective").and_then(Value::as_str) == Some("marginal-likelihood")
}

/// Whether a search fits RV offsets of nights: beside a fitted jitter, where no data set has its own.
fn are_nights_fitted(config: &Value) -> bool {
    let observations = config.get("observations").unwrap_or(&Value::Null);
    let sets = observations.as_array().map_or(std::slice::from_ref(observations), Vec::as_slice);
    let is_given = |set: &Value, key: &str| set.get(key).is_some_and(Value::is_number);
    let is_held = |set: &Value| is_given(set, "velocity_jitter_kms") || is_given(set, "night_jitter_kms");
    is_evolving(config) && !sets.iter().any(is_held)
}

/// Values of the config: those that are held fixed, and the defaults that decide on planets.
pub(super) fn fixed(config: &Value) -> Table {
    let is_free = |pointer: &str| {
        let key = pointer.rsplit('/').next().unwrap_or_default();
        config.pointer(&format!("/parameters/{key}")).is_some()
    };
    let evolves = is_evolving(config);
    let row = |(pointer, name, unit): &(&str, &str, &str)| {
        let is_idle = evolves && STATIC.contains(pointer);
        if *pointer == NIGHTS && are_nights_fitted(config) {
            let stability_ms = config.pointer("/instrument/stability_ms").and_then(Value::as_f64);
            let stability_kms = stability_ms.map_or(USUAL_STABILITY_KMS, |x| x / 1e3);
            let text = format!(
                "fitted where nights of several profiles show them, up to {}; stability of the spectrograph {}",
                with_unit(most_offset_kms(stability_kms)),
                with_unit(stability_kms)
            );
            return Some(vec![(*name).to_owned(), text]);
        }
        let value = config.pointer(pointer).filter(|value| !value.is_null() && !is_free(pointer) && !is_idle)?;
        let unit = if unit.is_empty() || !value.is_number() { String::new() } else { format!(" {unit}") };
        Some(vec![(*name).to_owned(), format!("{}{}", written(value), unit.replace(" °", "°"))])
    };
    Table { head: Vec::new(), rows: KEYS.iter().filter_map(row).collect() }
}

/// Priors of the free parameters.
pub(super) fn priors(config: &Value) -> Table {
    let of = |(name, prior): (&String, &Value)| {
        let kind = prior.get("prior").map(written).unwrap_or_default();
        let bound = |key: &str| prior.get(key).map(written);
        let range = match (bound("min"), bound("max")) {
            (Some(min), Some(max)) => format!("{min} to {max}"),
            _ => {
                let others = prior.as_object().into_iter().flatten().filter(|(key, _)| *key != "prior");
                others.map(|(key, value)| format!("{key} {}", written(value))).collect::<Vec<_>>().join(", ")
            }
        };
        vec![label(name), kind, range]
    };
    let mut rows: Vec<(usize, Vec<String>)> = config
        .get("parameters")
        .and_then(Value::as_object)
        .into_iter()
        .flatten()
        .map(|entry| (Parameter::ALL.iter().position(|p| p.name() == entry.0).unwrap_or(usize::MAX), of(entry)))
        .collect();
    rows.sort();
    table(&["parameter", "prior", "range"], rows.into_iter().map(|(_, row)| row).collect())
}

/// Normal priors of the line and of active regions, where they are fitted before maps and searches; static maps do not
/// fit them.
pub(super) fn fitted(config: &Value) -> Table {
    let at = |key: &str| config.pointer(&format!("/{}", key.replace('.', "/"))).filter(|value| !value.is_null());
    let named = at("star.fitted").and_then(Value::as_array).into_iter().flatten();
    let of_line = named.filter_map(|name| Parameter::from_name(name.as_str()?));
    let of_regions = Parameter::REGIONS.into_iter().filter(|region| at(region.spec().config_key).is_none());
    // without regions beyond spots their line has no effect
    let areas = &Parameter::REGIONS[3..];
    let are_spots = areas.iter().all(|area| at(area.spec().config_key).and_then(Value::as_f64) == Some(0.0));
    let of_regions = of_regions.filter(|_| !are_spots);
    let row = |parameter: Parameter| {
        let value = match at(parameter.spec().config_key) {
            Some(Value::Array(list)) => list.first().and_then(Value::as_f64),
            Some(value) => value.as_f64(),
            None => parameter.spec().usual,
        };
        let unit = parameter.spec().unit.trim_start_matches('1');
        let prior = match (value, mean_and_sd(parameter, value.unwrap_or(1.0))) {
            (Some(_), (mean, sd)) => format!("{mean:.2} ± {sd:.2} {unit}"),
            (None, (_, sd)) => format!("value from the mean profile ± {:.0} %", 100.0 * sd),
        };
        let meaning = parameter.spec().about.split([':', '.']).next().unwrap_or_default();
        vec![label(parameter.name()), meaning.to_owned(), prior.trim_end().to_owned()]
    };
    let all = of_line.chain(of_regions).filter(|_| is_evolving(config));
    table(&["parameter", "meaning", "normal prior"], all.map(row).collect())
}

/// Keys in which the configs of several folders differ: key, and its value in each.
pub(super) fn differences(configs: &[(&str, &Value)]) -> Table {
    let flat: Vec<BTreeMap<String, String>> = configs
        .iter()
        .map(|(_, config)| {
            let mut found = BTreeMap::new();
            flatten("", config, &mut found);
            found
        })
        .collect();
    let mut keys: Vec<&String> = flat.iter().flat_map(BTreeMap::keys).collect();
    keys.sort();
    keys.dedup();
    let decides = |key: &&&String| {
        let idle = ["$schema", "grid", "plan", "sampler"];
        !idle.contains(&key.split('.').next().unwrap_or_default()) && key.as_str() != "star.name"
    };
    let row = |key: &String| {
        let values: Vec<String> =
            flat.iter().map(|config| config.get(key).cloned().unwrap_or_else(|| "–".into())).collect();
        let differ = values.windows(2).any(|pair| pair[0] != pair[1]);
        differ.then(|| [vec![key.clone()], values].concat())
    };
    let head = std::iter::once("key".to_owned()).chain(configs.iter().map(|(folder, _)| (*folder).to_owned()));
    Table { head: head.collect(), rows: keys.iter().filter(decides).filter_map(|key| row(key)).collect() }
}

/// All values with their dotted keys.
fn flatten(key: &str, value: &Value, found: &mut BTreeMap<String, String>) {
    match value {
        Value::Object(map) => {
            for (name, inner) in map {
                let whole = if key.is_empty() { name.clone() } else { format!("{key}.{name}") };
                flatten(&whole, inner, found);
            }
        }
        Value::Array(list) if list.iter().any(Value::is_object) => {
            list.iter().enumerate().for_each(|(k, inner)| flatten(&format!("{key}[{k}]"), inner, found));
        }
        other => drop(found.insert(key.to_owned(), written(other))),
    }
}

/// A value as text.
fn written(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Array(list) => list.iter().map(written).collect::<Vec<_>>().join(", "),
        // numbers that are long only by a rounding error are shortened
        Value::Number(number) => match number.as_f64() {
            Some(x) if number.to_string().len() > 12 => {
                format!("{:.6}", x).trim_end_matches('0').trim_end_matches('.').into()
            }
            _ => number.to_string().trim_end_matches(".0").to_owned(),
        },
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn what_is_free_is_not_fixed() {
        let config = json!({
            "star": { "rotation_period_d": 2.741, "vsini_kms": 30.0, "inclination_deg": 55 },
            "imaging": { "objective": "marginal-likelihood", "chi2_target": 0.97 },
            "parameters": {
                "vsini_kms": { "prior": "uniform", "min": 20, "max": 40.0 }, "phi": { "prior": "periodic" }
            }
        });
        let fixed = fixed(&config).rows;
        assert!(fixed.contains(&vec!["rotation period".into(), "2.741 d".into()]), "{fixed:?}");
        assert!(fixed.contains(&vec!["inclination".into(), "55°".into()]), "{fixed:?}");
        assert!(!fixed.iter().any(|row| row[0].contains("sin") || row[0].contains("target")), "{fixed:?}");
        let priors = priors(&config).rows;
        assert_eq!(priors.iter().map(|row| row[1..].join(" ")).collect::<Vec<_>>(), ["periodic ", "uniform 20 to 40"]);
    }

    #[test]
    fn priors_of_the_line_and_offsets_of_nights_are_told() {
        let mut config = json!({
            "star": { "line": { "sigma_kms": 3.6, "equivalent_width_kms": "auto" }, "regions": { "area": 0.0 },
                "fitted": ["line_sigma_kms", "equivalent_width_kms"] },
            "imaging": { "objective": "marginal-likelihood" }
        });
        let rows = fitted(&config).rows;
        assert_eq!([&rows[0][2], &rows[1][2]], ["3.60 ± 1.44 km/s", "value from the mean profile ± 15 %"]);
        assert_eq!(rows.len(), 2 + Parameter::REGIONS.len() - 1, "{rows:?}");
        let nights = |config: &Value| fixed(config).rows.into_iter().find(|row| row[0].contains("nights"));
        assert!(nights(&config).unwrap()[1].ends_with("up to 60 m/s; stability of the spectrograph 30 m/s"));
        config["observations"] = json!({ "night_jitter_kms": 0.0 });
        assert_eq!(nights(&config).unwrap()[1], "0 km/s");
        for held in [json!({ "velocity_jitter_kms": 0.0 }), json!([{ "night_jitter_kms": 0.01 }, {}])] {
            config["observations"] = held;
            assert!(nights(&config).is_none());
        }
        config["observations"] = json!([{ "velocity_jitter_kms": "fitted" }, {}]);
        assert!(nights(&config).is_some());
        config["star"]["regions"] = json!({ "area": 0.0, "area_limb": 0.0, "dimming_limb": 0 });
        assert_eq!(fitted(&config).rows.len(), 2);
        config["imaging"]["objective"] = json!("spottedness");
        assert!(nights(&config).is_none() && fitted(&config).rows.is_empty());
    }

    #[test]
    fn only_keys_that_differ_are_listed() {
        let other = |pixels: u32| json!({ "imaging": { "pixels": pixels, "x": 1 }, "grid": { "a": pixels } });
        let [a, b] = [other(400), other(2000)];
        assert_eq!(differences(&[("map", &a), ("run", &b)]).rows, [["imaging.pixels", "400", "2000"]]);
        assert_eq!(differences(&[("map", &a), ("run", &a)]).rows.len(), 0);
    }
}
