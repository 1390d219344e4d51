//! The reference of the config, `docs/reference/config.md`, from its JSON Schema: a table for each section; and the
//! spectrographs that it may name, `docs/reference/instruments.md`.

use dimcmc::internals::data::config::SPECTROGRAPHS;
use serde_json::{Map, Value};

/// Sections in the order in which one thinks of a star; others come after them.
const ORDER: &[&str] =
    &["star", "instrument", "planet", "observations", "photometry", "imaging", "parameters", "sampler", "grid"];

/// Units by the end of a key; the longest that fits counts.
const UNITS: &[(&str, &str)] = &[
    ("_kms", "km/s"),
    ("_rad_d", "rad/d"),
    ("_d", "d"),
    ("_deg", "degrees"),
    ("photosphere_k", "K"),
    ("spot_k", "K"),
    ("_nm", "nm"),
    ("_ms", "m/s"),
    ("_msun", "solar masses"),
    ("phi", "cycles"),
    ("cycles", "cycles"),
];

const HEAD: &str = "# Every config key

This page is made from the JSON Schema of the config by a test; `dimcmc schema` prints the same for editors. Keys that
are not here are refused. Under `parameters` stands what is free, each with its prior; all other parameters keep their
values under `star` and `planet`. [Write a config](../howto/first-config.md) has an example.
";

/// The page.
pub fn page(schema: &Value) -> String {
    let mut page = Page { schema, text: HEAD.to_owned() };
    let sections = properties(schema);
    let known = ORDER.iter().copied().filter(|name| sections.contains_key(*name));
    let others = sections.keys().map(String::as_str).filter(|name| !ORDER.contains(name) && *name != "$schema");
    let names: Vec<&str> = known.chain(others).collect();
    page.table("the config", schema, &names, "");
    for name in names {
        let required = is_required(schema, name);
        page.section(name, &sections[name], required);
    }
    page.text
}

const INSTRUMENTS: &str = "# Spectrographs

`instrument.name` of a [config](config.md#instrument) is one of these, in any case; blanks and hyphens do not matter. It
gives resolving power R and RV stability where `instrument.resolving_power` and `instrument.stability_ms` are not given.
`dimcmc init --instrument NAME` also writes the wavelength λ, where `--wavelength` is not given. Any other name takes
both `instrument.resolving_power` and `instrument.stability_ms`.

R is that of the usual mode; of a slit it depends on its width. λ is a round value of the centre of LSD profiles of cool
stars; it depends on the line list, and of CRIRES+, PEPSI and UVES on the setting. The RV stability, from night to night
and without a gas cell, is the scale of the priors of RV jitter and offsets of nights. This page is made from the table
in `src/data/config/instruments.rs` by a test.

| name | R | λ (nm) | RV stability (m/s) | sources |
|---|---|---|---|---|
";

/// The page of the spectrographs.
pub fn instruments() -> String {
    let rows = SPECTROGRAPHS.iter().map(|row| {
        let thousands = row.resolving_power / 1e3;
        let power = format!("{},{:03}", thousands.floor(), (row.resolving_power % 1e3).round());
        format!("| {} | {power} | {} | {} | {} |\n", row.name, row.wavelength_nm, row.stability_ms, row.source)
    });
    rows.fold(INSTRUMENTS.to_owned(), |page, row| page + &row)
}

struct Page<'a> {
    schema: &'a Value,
    text: String,
}

impl<'a> Page<'a> {
    /// What a `$ref`, or a choice of something and null or a list of it, refers to.
    fn resolve(&self, part: &'a Value) -> &'a Value {
        if let Some(reference) = part["$ref"].as_str() {
            return self.resolve(&self.schema["$defs"][reference.rsplit('/').next().unwrap()]);
        }
        let choices: Option<Vec<&Value>> = part["anyOf"]
            .as_array()
            .map(|all| all.iter().filter(|c| c["type"] != "null" && c["items"].is_null()).collect());
        match choices.unwrap_or_default()[..] {
            [only] => self.resolve(only),
            _ => part,
        }
    }

    /// A section and those in it.
    fn section(&mut self, path: &str, part: &'a Value, required: bool) {
        let section = self.resolve(part);
        let level = "#".repeat(2 + path.matches('.').count().min(1));
        let description = one_line(part["description"].as_str().or(section["description"].as_str()).unwrap());
        let required = if required { " Required." } else { "" };
        self.text += &format!("\n{level} `{path}`\n\n{}\n", wrapped(&format!("{description}{required}")));
        let keys: Vec<&str> = properties(section).keys().map(String::as_str).collect();
        if path != "parameters" && self.is_per_parameter(section) {
            let each = self.type_of(&section["properties"][keys[0]]);
            self.text += &format!("\nKeys are those of [`parameters`](#parameters); each takes {each}.\n");
            return;
        }
        self.table(path, section, &keys, path);
        for key in &keys {
            let choice = self.resolve(&section["properties"][*key]);
            let Some(words) = choice["oneOf"].as_array() else { continue };
            self.text += &format!("\n`{key}`:\n\n");
            for word in words {
                let item = format!("`{}`: {}", word["const"], one_line(word["description"].as_str().unwrap()));
                self.text += &format!("- {}\n", wrapped(&item).replace('\n', "\n  "));
            }
        }
        if path == "parameters" {
            // one for all of them
            let prior = self.resolve(&section["properties"][keys[0]]);
            return self.section("parameters.NAME", prior, false);
        }
        for key in keys {
            let inner = &section["properties"][key];
            if self.resolve(inner)["properties"].is_object() {
                self.section(&format!("{path}.{key}"), inner, is_required(section, key));
            }
        }
    }

    fn table(&mut self, name: &str, section: &'a Value, keys: &[&str], path: &str) {
        self.text += "\n| key | type | unit | default | meaning |\n|---|---|---|---|---|\n";
        for key in keys {
            let part = &section["properties"][*key];
            let inner = self.resolve(part)["properties"].is_object();
            let anchor = match (inner, path) {
                (false, _) => format!("`{key}`"),
                (true, "") => format!("[`{key}`](#{key})"),
                // all of them alike
                (true, "parameters") => format!("`{key}`"),
                (true, _) => format!("[`{key}`](#{}{key})", path.replace('.', "")),
            };
            let default = match &part["default"] {
                _ if is_required(section, key) => "required".to_owned(),
                Value::Null | Value::Object(_) => String::new(),
                Value::Array(all) if all.is_empty() => "none".to_owned(),
                default => format!("`{default}`"),
            };
            let unit = if inner && path != "parameters" { "" } else { unit(key) };
            let meaning = part["description"].as_str().unwrap_or_else(|| panic!("{name}: {key}"));
            let meaning = one_line(meaning).replace('|', "\\|");
            self.text += &format!("| {anchor} | {} | {unit} | {default} | {meaning} |\n", self.type_of(part));
        }
    }

    /// In words: `number`, `"auto"`, `list of [number, number]`.
    fn type_of(&self, part: &'a Value) -> String {
        let part = self.resolve(part);
        let all = |values: &'a [Value]| values.iter().map(|v| self.type_of(v)).collect::<Vec<String>>();
        if let Some(choices) = part["oneOf"].as_array().or(part["anyOf"].as_array()) {
            return all(choices).join(" or ");
        }
        if !part["const"].is_null() {
            return format!("`{}`", part["const"]);
        }
        if let Some(items) = part["prefixItems"].as_array() {
            return format!("[{}]", all(items).join(", "));
        }
        if part["items"].is_object() {
            let item = self.type_of(&part["items"]);
            return match (part["minItems"].as_u64(), part["maxItems"].as_u64()) {
                (Some(n), Some(m)) if n == m => format!("[{}]", vec![item; n as usize].join(", ")),
                _ => format!("list of {item}"),
            };
        }
        let name = part["type"].as_array().map_or(&part["type"], |types| types.iter().find(|t| *t != "null").unwrap());
        match name.as_str().unwrap() {
            "object" if part["properties"]["prior"].is_object() => "[prior](#parametersname)".to_owned(),
            other => other.to_owned(),
        }
    }

    /// Whether a section has a key for each parameter.
    fn is_per_parameter(&self, section: &Value) -> bool {
        let parameters = self.resolve(&self.schema["properties"]["parameters"]);
        properties(parameters).keys().eq(properties(section).keys())
    }
}

fn properties(section: &Value) -> &Map<String, Value> {
    section["properties"].as_object().unwrap()
}

fn is_required(section: &Value, key: &str) -> bool {
    section["required"].as_array().is_some_and(|all| all.iter().any(|name| name == key))
}

fn unit(key: &str) -> &'static str {
    let fits = UNITS.iter().filter(|(end, _)| key.ends_with(end));
    fits.max_by_key(|(end, _)| end.len()).map_or("", |(_, unit)| unit)
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<&str>>().join(" ")
}

/// In lines of at most 118 characters.
fn wrapped(text: &str) -> String {
    let mut lines = vec![String::new()];
    for word in text.split(' ') {
        let line = lines.last_mut().unwrap();
        if line.is_empty() {
            line.push_str(word);
        } else if line.chars().count() + 1 + word.chars().count() <= 118 {
            *line += &format!(" {word}");
        } else {
            lines.push(word.to_owned());
        }
    }
    lines.join("\n")
}
