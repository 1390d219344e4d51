//! The sampler with and without the surrogate move: cost for the same posterior, also where the surrogate is poor.
//!
//!     cargo run --release --example moves
//!
//! prints the table of `results/moves.md`. Every case is `configs/demo.json` with another planet (on 5,000 pixels where
//! there is one), or `configs/paper_7d.json`; a part of a name after `--` runs only that case.

use dimcmc::internals::sampling::chain::{MoveKind, Summary};
use dimcmc::{Config, Run, Scene};
use serde_json::{Value, json};

type Failure = Box<dyn std::error::Error>;

/// Name, config, changes of it.
fn cases() -> Vec<(&'static str, &'static str, Value)> {
    let fine = json!({ "imaging": { "pixels": 5000 } });
    let planet = |k: f64, period: f64| {
        let mut change = json!({ "planet": { "k_kms": k, "porb_over_prot": period, "phi": 0.5 } });
        if k > 0.0 {
            merge(&mut change, &fine);
        }
        change
    };
    let wide = json!({ "parameters": { "k_kms": { "prior": "uniform", "min": 0.0, "max": 0.8 } } });
    let mut strong = planet(0.4, 1.7);
    merge(&mut strong, &wide);
    vec![
        ("K = 100 m/s, P = 1.7", "demo", fine.clone()),
        ("K = 400 m/s, P = 1.7", "demo", strong),
        ("K = 100 m/s, P = 1.0", "demo", planet(0.1, 1.0)),
        ("7-D, K = 100 m/s, P = 1.7", "paper_7d", json!({})),
        ("K = 0", "demo", planet(0.0, 1.7)),
    ]
}

fn main() -> Result<(), Failure> {
    let only = std::env::args().nth(1);
    let head = ["case", "moves", "evaluations", "ESS / evaluation", "accepted (surrogate)"].join(" | ");
    println!("| {head} | parameters: median (-, + of 68 %) |\n|---|---|---|---|---|---|");
    for (name, config, change) in cases() {
        if only.as_ref().is_some_and(|only| !name.contains(only.as_str())) {
            continue;
        }
        let mut config: Value = serde_json::from_str(&std::fs::read_to_string(format!("configs/{config}.json"))?)?;
        config.as_object_mut().map(|c| c.remove("$schema"));
        merge(&mut config, &change);
        let with = chain(&config, 20.0, 2000.0)?;
        let without = chain(&config, 0.0, 1000.0)?;
        for (moves, summary) in [("with surrogate", &with), ("without", &without)] {
            println!("| {name} | {moves} | {} |", row(summary));
        }
    }
    Ok(())
}

/// The summary of a chain with this weight of the surrogate and this goal.
fn chain(config: &Value, surrogate: f64, ess: f64) -> Result<Summary, Failure> {
    let mut config = config.clone();
    let seed = if surrogate > 0.0 { 1 } else { 2 };
    merge(&mut config, &json!({ "sampler": { "ess": ess, "seed": seed, "moves": { "surrogate": surrogate } } }));
    let scene = Scene::new(&Config::at(config, "config".as_ref()))?;
    let mut run = Run::new(&scene)?;
    run.finish()?;
    Ok(run.summary()?.chain)
}

fn row(summary: &Summary) -> String {
    let surrogate = summary.moves.iter().find(|m| m.kind == MoveKind::Surrogate);
    let accepted = surrogate.map_or("-".to_owned(), |m| format!("{:.2}", m.acceptance_fraction));
    let worth = summary.ess_per_evaluation.map_or("-".to_owned(), |x| format!("{x:.3}"));
    let parameters: Vec<String> = summary
        .names
        .iter()
        .map(|name| {
            let p = &summary.parameters[name];
            let digits = (1.0 - p.sd.log10().floor()).max(0.0) as usize;
            let (low, high) = (p.median - p.ci68[0], p.ci68[1] - p.median);
            format!("{name} {:.digits$} (-{low:.digits$}, +{high:.digits$})", p.median)
        })
        .collect();
    format!("{} | {worth} | {accepted} | {}", summary.evaluations, parameters.join(", "))
}

/// Merges the members of `change` into `value`, objects member by member.
fn merge(value: &mut Value, change: &Value) {
    match (value, change) {
        (Value::Object(value), Value::Object(change)) => {
            for (key, change) in change {
                merge(value.entry(key.clone()).or_insert(Value::Null), change);
            }
        }
        (value, change) => *value = change.clone(),
    }
}
