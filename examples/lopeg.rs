//! A real star: the orbit found by each model in the profiles of LO Peg, where no planet is known, and orbits injected
//! into them.
//!
//!     cargo run --release --example lopeg -- models
//!     cargo run --release --example lopeg -- injections
//!
//! print the tables of `results/lopeg.md`. Chains are kept in `runs/lopeg` and resumed. The profiles are not part of
//! this repository: `configs/lopeg.json` has their path.

#[path = "reproduce/cases/mod.rs"]
#[allow(dead_code, unused_imports)]
mod cases;

use cases::{Case, Failure, Laboratory, Outcome};
use dimcmc::Pool;
use dimcmc::internals::data::io::lsd;
use dimcmc::internals::data::scene::Scene;
use dimcmc::internals::star::Orbit;
use dimcmc::internals::star::injection::inject;
use serde_json::{Value, json};
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A model of the star relative to the plain one: a name, and changes of its config.
type Model = (&'static str, &'static [(&'static str, fn() -> Value)]);

const BRIGHT: (&str, fn() -> Value) = ("/imaging/brightness", || json!("bright-and-dark"));
const MEASURED: (&str, fn() -> Value) = ("/observations/sigma_scale", || json!("auto"));
const NUISANCES: (&str, fn() -> Value) =
    ("/imaging/nuisances", || json!({ "continuum_offset": 5e-4, "continuum_slope": 5e-4, "equivalent_width": 0.02 }));
const VOIGT: (&str, fn() -> Value) =
    ("/star/line", || json!({ "shape": "voigt", "sigma_kms": 1.7, "gamma_kms": 2.1, "equivalent_width_kms": "auto" }));
const UNRESOLVED_SPOTS: (&str, fn() -> Value) = ("/imaging/unresolved_spots", || json!("fitted"));

const MODELS: [Model; 10] = [
    ("spots", &[]),
    ("spots, errors measured", &[MEASURED]),
    ("bright and dark", &[BRIGHT]),
    ("bright and dark, errors measured", &[BRIGHT, MEASURED]),
    ("spots, nuisances, errors measured", &[NUISANCES, MEASURED]),
    ("bright and dark, nuisances, errors measured", &[BRIGHT, NUISANCES, MEASURED]),
    ("spots, Voigt, errors measured", &[VOIGT, MEASURED]),
    ("bright and dark, Voigt, errors measured", &[BRIGHT, VOIGT, MEASURED]),
    ("spots, errors measured, unresolved spots", &[MEASURED, UNRESOLVED_SPOTS]),
    RECOMMENDED,
];

/// The model that is recommended for a real star.
const RECOMMENDED: Model =
    ("bright and dark, errors measured, unresolved spots", &[BRIGHT, MEASURED, UNRESOLVED_SPOTS]);

/// Injected orbits: K (km/s), Porb/Prot, phases.
const K_KMS: [f64; 3] = [0.3, 0.6, 1.0];
const PERIODS: [f64; 2] = [1.7, 2.6];
const PHASES: [f64; 4] = [0.1, 0.35, 0.6, 0.85];

const CONFIG: &str = "configs/lopeg.json";
const WORK: &str = "runs/lopeg";

fn main() -> Result<(), Failure> {
    let base = base()?;
    let (pool, report) = (Pool::threads(Arc::new(AtomicBool::new(false))), |message: &str| eprintln!("{message}"));
    let laboratory = Laboratory { folder: WORK.into(), quick: false, pool: &pool, report: &report };
    match std::env::args().nth(1).as_deref() {
        Some("models") => models(&laboratory, &base),
        Some("injections") => injections(&laboratory, &base),
        _ => Err("give `models` or `injections`".into()),
    }
}

/// The config of the star with periods from half a rotation to four.
fn base() -> Result<Value, Failure> {
    let mut config: Value = serde_json::from_str(&std::fs::read_to_string(CONFIG)?)?;
    config.as_object_mut().ok_or("the config is no object")?.remove("$schema");
    let list = config["observations"]["path"].as_str().ok_or("no observations.path")?;
    let list = std::path::absolute(Path::new(CONFIG).parent().unwrap_or(Path::new("")).join(list))?;
    let changes = [
        ("/observations/path", json!(list)),
        // white errors and the entropy's spots, unless a model changes them
        ("/observations/sigma_scale", json!(0.3)),
        ("/imaging/unresolved_spots", json!("entropy")),
        ("/parameters/porb_over_prot", json!({ "prior": "log-uniform", "min": 0.5, "max": 4.0 })),
        ("/planet", json!({ "k_kms": 0.1, "porb_over_prot": 1.7, "phi": 0.5 })),
        ("/sampler/walkers", json!(24)),
        ("/sampler/ess", json!(500)),
        ("/sampler/rhat", json!(1.02)),
    ];
    Ok(cases::with(config, &changes))
}

fn with(base: &Value, model: &Model) -> Value {
    let changes: Vec<(&str, Value)> = model.1.iter().map(|(key, value)| (*key, value())).collect();
    cases::with(base.clone(), &changes)
}

fn case(name: &str, config: Value, periodogram: Option<usize>) -> Case {
    Case { name: name.replace([' ', ','], "_"), config, grid: None, chain: true, periodogram }
}

fn models(laboratory: &Laboratory, base: &Value) -> Result<(), Failure> {
    println!("| model | chi2 target | spottedness | K (km/s) | 95 % | Porb/Prot | best period blind | FAP |");
    println!("|---|---|---|---|---|---|---|---|");
    for model in &MODELS {
        let case = case(model.0, with(base, model), Some(10_000));
        let outcome = laboratory.outcomes("models", &[case])?.remove(0);
        let (Some(k), Some(period)) = (outcome.by_chain("k_kms"), outcome.by_chain("porb_over_prot")) else {
            println!("| {} | no result: {} |||||||", model.0, outcome.failed.unwrap_or_default());
            continue;
        };
        let blind = outcome.periodogram.as_ref().and_then(|route| route.parameters.get("porb_over_prot"));
        let limit = outcome.k_upper95_kms.map_or_else(String::new, |k| format!(", below {k:.2}"));
        println!(
            "| {} | {:.3} | {:.3} | {:.2} ({:.2} to {:.2}){limit} | {:.2} to {:.2} | {:.2} ({:.2} to {:.2}) | {:.2} | \
            {:.1e} |",
            model.0,
            outcome.chi2_target.unwrap_or(f64::NAN),
            outcome.spottedness.unwrap_or(f64::NAN),
            k.value,
            k.ci68[0],
            k.ci68[1],
            k.ci95[0],
            k.ci95[1],
            period.value,
            period.ci68[0],
            period.ci68[1],
            blind.map_or(f64::NAN, |period| period.value),
            outcome.false_alarm.unwrap_or(f64::NAN),
        );
    }
    Ok(())
}

/// Injected orbits, recovered at their periods by the recommended model, against its result there without an injection.
fn injections(laboratory: &Laboratory, base: &Value) -> Result<(), Failure> {
    let (mut near, mut covered, mut all) = (0, 0, 0);
    println!(
        "| K injected | Porb/Prot | phi | found | 95 % | minus null, along the orbit | in errors | across, in errors |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for period in PERIODS {
        let null = Orbit { k_kms: 0.0, porb_over_prot: period, phi: 0.0 };
        let (nothing, _) =
            amplitude(&recovered(laboratory, base, null)?).ok_or("nothing found in the profiles as they are")?;
        for k_kms in K_KMS {
            for phi in PHASES {
                let outcome = recovered(laboratory, base, Orbit { k_kms, porb_over_prot: period, phi })?;
                let Some((found, error)) = amplitude(&outcome) else {
                    println!("| {k_kms} | {period} | {phi} | no result: {} |||||", outcome.failed.unwrap_or_default());
                    all += 1;
                    continue;
                };
                let k = outcome.chain.as_ref().map(|chain| chain.parameters["k_kms"]).ok_or("no chain")?;
                let (sin, cos) = (TAU * phi).sin_cos();
                let change = [found[0] - nothing[0], found[1] - nothing[1]];
                let (along, across) = (change[0] * cos + change[1] * sin, change[1] * cos - change[0] * sin);
                let (off, aside) = ((along - k_kms) / error, across / error);
                println!(
                    "| {k_kms} | {period} | {phi} | {:.2} +- {error:.2} | {:.2} to {:.2} | {along:.2} | {off:+.1} | \
                    {aside:+.1} |",
                    k.value, k.ci95[0], k.ci95[1]
                );
                all += 1;
                near += usize::from(off.abs() < 2.0);
                covered += usize::from(k.ci95[0] <= k_kms && k_kms <= k.ci95[1]);
            }
        }
    }
    println!(
        "\nWithin two errors of the orbit put in: {near} of {all}; K put in inside the 95 % interval: {covered} of \
        {all}."
    );
    Ok(())
}

/// The orbit recovered by the recommended model from profiles with an injection, its period known.
fn recovered(laboratory: &Laboratory, base: &Value, orbit: Orbit) -> Result<Outcome, Failure> {
    let name = format!("k_{}_p_{}_phi_{}", orbit.k_kms, orbit.porb_over_prot, orbit.phi);
    let config = with(base, &RECOMMENDED);
    let list = injected(laboratory, base, orbit, &name).expect("profiles can be read and written");
    let mut config = cases::with(
        config,
        &[
            ("/observations/path", json!(list)),
            // a start at the known period only
            ("/planet/porb_over_prot", json!(orbit.porb_over_prot)),
            ("/parameters/k_kms/max", json!(2.5)),
        ],
    );
    config["parameters"].as_object_mut().expect("an object").remove("porb_over_prot");
    Ok(laboratory.outcomes("injections", &[case(&name, config, None)])?.remove(0))
}

/// The profiles with an orbit in them; the list of their files.
fn injected(laboratory: &Laboratory, base: &Value, orbit: Orbit, name: &str) -> Result<PathBuf, Failure> {
    let folder = laboratory.folder(&format!("injections/{name}/profiles"))?;
    let config = folder.join("base.json");
    std::fs::write(&config, base.to_string())?;
    let scene = Scene::load(&config)?;
    let injected = inject(&scene.whole(), &scene.imager.star, &[orbit]);
    lsd::write_as(&folder, &injected, &scene.data.sets[0].labels, "with an injected orbit")?;
    Ok(std::path::absolute(folder.join("observations.txt"))?)
}

/// The orbit found as `K (cos, sin)` of its phase, and the standard error of K.
fn amplitude(outcome: &Outcome) -> Option<([f64; 2], f64)> {
    let parameters = &outcome.chain.as_ref()?.parameters;
    let (k, phi) = (parameters.get("k_kms")?, parameters.get("phi")?.value);
    let (sin, cos) = (TAU * phi).sin_cos();
    Some(([k.value * cos, k.value * sin], k.error()))
}
