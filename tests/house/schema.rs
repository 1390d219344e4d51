//! The JSON Schema of the config: it is the one of the config's types, and explains every key.

use dimcmc::internals::data::config;
use serde_json::Value;
use std::path::Path;

#[test]
fn the_shipped_schema_is_the_generated_one() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/dimcmc.schema.json");
    if std::env::var_os("DIMCMC_WRITE_SCHEMA").is_some() {
        std::fs::write(&path, config::schema()).unwrap();
    }
    let shipped: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    let generated: Value = serde_json::from_str(&config::schema()).unwrap();
    assert_eq!(shipped, generated, "run the tests once with DIMCMC_WRITE_SCHEMA=1");
}

/// Every key of every section, every section, and every word that a key may have says what it is, in a sentence.
#[test]
fn the_schema_explains_everything() {
    let schema: Value = serde_json::from_str(&config::schema()).unwrap();
    let mut faults = Vec::new();
    let mut explained = 0;
    let mut explain = |name: String, part: &Value| match part["description"].as_str() {
        Some(text) if text.len() > 5 && text.ends_with('.') => explained += 1,
        other => faults.push(format!("{name}: {other:?}")),
    };
    let sections = schema["$defs"].as_object().unwrap().iter().map(|(name, section)| (name.as_str(), section));
    for (name, section) in sections.chain([("the config", &schema)]) {
        explain(name.to_owned(), section);
        for (key, property) in section["properties"].as_object().into_iter().flatten() {
            explain(format!("{name}.{key}"), property);
        }
        for choice in section["oneOf"].as_array().into_iter().flatten() {
            explain(format!("{name} = {}", choice["const"]), choice);
        }
        // a bare list of words would leave them unexplained
        assert!(section.get("enum").is_none(), "{name}");
    }
    assert!(faults.is_empty(), "no description:\n{}", faults.join("\n"));
    assert!(explained > 80, "{explained}");
}
