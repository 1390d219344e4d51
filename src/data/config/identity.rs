//! The fingerprint of a config: the part that must be identical for a chain to be resumed; and the part that two
//! related configs share.

use crate::model::{Elements, Parameter};
use serde_json::Value;
use sha2::{Digest, Sha256};

/// SHA-256 (hex) of the resolved config without keys that may change on resuming: `$schema`, `grid`, `plan`, the names
/// of star and spectrograph, the star's mass (with one planet), and the sampler's `steps`, `rhat` and `ess`.
/// Independent of the order of keys.
pub(super) fn fingerprint(resolved: &Value) -> String {
    sha256(&decisive(resolved))
}

/// SHA-256 (hex) of the part of a resolved config that decides what is fitted to the profiles before maps and searches:
/// neither sampler nor planet, as the fit is without one. A second planet is part of it.
pub fn fit_fingerprint(resolved: &Value) -> String {
    let mut value = decisive(resolved);
    if let Some(top) = value.as_object_mut() {
        top.remove("sampler");
    }
    let [first, _] = &Elements::PLANETS;
    for section in ["planet", "parameters"] {
        if let Some(section) = value.get_mut(section).and_then(Value::as_object_mut) {
            section.retain(|key, _| first.all().into_iter().all(|parameter| parameter.name() != key));
        }
    }
    sha256(&value)
}

fn sha256(value: &Value) -> String {
    let mut text = String::new();
    canonical(value, &mut text);
    format!("{:x}", Sha256::digest(text))
}

/// A key that is not the same in two configs.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// The key with all its parents, dotted.
    pub key: String,
    /// Its value in the one, for a message.
    pub first: String,
    /// Its value in the other.
    pub second: String,
}

/// The first key that matters for the fingerprint and is not the same in both resolved configs, with both values.
pub fn first_difference(then: &Value, now: &Value) -> Option<String> {
    let Difference { key, first, second } = difference("", &decisive(then), &decisive(now))?;
    Some(format!("{key} ({first} then, {second} now)"))
}

/// Whether two resolved configs treat the RV jitter in the same way.
pub fn jitter_difference(first: &Value, second: &Value) -> Option<Difference> {
    const KEY: &str = "velocity_jitter_kms";
    // of several data sets it is one for all
    let [first, second] = [first, second].map(|resolved| {
        let observations = &resolved["observations"];
        &observations.get(0).unwrap_or(observations)[KEY]
    });
    difference(&format!("observations.{KEY}"), first, second)
}

/// The first key of a section, which need not be there, in which two resolved configs differ in their model, ignoring
/// values of parameters that may be free.
pub fn section_difference(name: &str, first: &Value, second: &Value) -> Option<Difference> {
    let without_parameters = |resolved: &Value| {
        let mut section = resolved.get(name).cloned().unwrap_or(Value::Null);
        if let Some(map) = section.as_object_mut() {
            // a likelihood grid treats unresolved spots by the entropy, whatever the chain does
            let free = |key: &str| Parameter::from_name(key).is_some_and(|p| !p.is_optional());
            map.retain(|key, _| !free(key) && key != "unresolved_spots" && key != "mass_msun" && key != "name");
        }
        section
    };
    difference(name, &without_parameters(first), &without_parameters(second))
}

fn difference(key: &str, first: &Value, second: &Value) -> Option<Difference> {
    let (Value::Object(a), Value::Object(b)) = (first, second) else {
        let differ = || Difference { key: key.to_owned(), first: brief(first), second: brief(second) };
        return (first != second).then(differ);
    };
    let mut names: Vec<&String> = a.keys().chain(b.keys()).collect();
    names.sort();
    names.into_iter().find_map(|name| {
        let inner = if key.is_empty() { name.clone() } else { format!("{key}.{name}") };
        difference(&inner, a.get(name).unwrap_or(&Value::Null), b.get(name).unwrap_or(&Value::Null))
    })
}

/// A value for a message: numbers and words in full, lists and sections by their type.
fn brief(value: &Value) -> String {
    match value {
        Value::Null => "absent".into(),
        Value::Array(_) => "a list".into(),
        Value::Object(_) => "a section".into(),
        scalar => scalar.to_string(),
    }
}

/// The part of a resolved config that decides the posterior and the chain.
fn decisive(resolved: &Value) -> Value {
    let mut value = resolved.clone();
    if let Some(top) = value.as_object_mut() {
        top.remove("$schema");
        top.remove("grid");
        top.remove("plan");
        if let Some(star) = top.get_mut("star").and_then(Value::as_object_mut) {
            star.remove("name");
            // stability of two planets depends on the mass
            if !has_second_planet(resolved) {
                star.remove("mass_msun");
            }
        }
        // the values it gives are stored beside it
        if let Some(instrument) = top.get_mut("instrument").and_then(Value::as_object_mut) {
            instrument.remove("name");
        }
        if let Some(sampler) = top.get_mut("sampler").and_then(Value::as_object_mut) {
            sampler.retain(|key, _| !["steps", "rhat", "ess"].contains(&key.as_str()));
        }
    }
    value
}

fn has_second_planet(resolved: &Value) -> bool {
    let [_, second] = &Elements::PLANETS;
    let given = |section: &str, p: Parameter| resolved[section].get(p.name()).is_some_and(|value| !value.is_null());
    second.all().into_iter().any(|p| given("planet", p) || given("parameters", p))
}

/// Compact JSON with sorted keys, whatever the features serde_json was built with.
fn canonical(value: &Value, text: &mut String) {
    match value {
        Value::Object(map) => {
            let mut entries: Vec<_> = map.iter().collect();
            entries.sort_by_key(|(key, _)| *key);
            text.push('{');
            for (key, value) in entries {
                text.push_str(&Value::from(key.as_str()).to_string());
                text.push(':');
                canonical(value, text);
                text.push(',');
            }
            text.push('}');
        }
        Value::Array(items) => {
            text.push('[');
            for item in items {
                canonical(item, text);
                text.push(',');
            }
            text.push(']');
        }
        scalar => text.push_str(&scalar.to_string()),
    }
}
