//! Coverage of intervals: the fraction of injected values inside the chain's 68 and 95 % intervals, over spot maps and
//! noise seeds, for each objective of reconstructions.
//!
//! Orbits are drawn from the prior of the chain, so that an exact posterior has nominal coverage.

use crate::cases::{Case, ENDS, Estimate, Failure, Laboratory, Outcome, paper, share, with};
use crate::report::{Panel, Report, Series};
use dimcmc::internals::surface::static_map::Reference;
use dimcmc::{Config, Scene};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Map, Value, json};

/// Objectives of reconstructions.
struct Judge {
    name: &'static str,
    objective: &'static str,
    unresolved_spots: &'static str,
}

const JUDGES: [Judge; 3] = [
    Judge { name: "spottedness", objective: "spottedness", unresolved_spots: "entropy" },
    Judge { name: "regularised_likelihood", objective: "regularised-likelihood", unresolved_spots: "entropy" },
    Judge { name: "unresolved_spots_fitted", objective: "spottedness", unresolved_spots: "fitted" },
];

/// Parameters that are sampled.
const ORBIT: [&str; 3] = ["k_kms", "porb_over_prot", "phi"];

/// Prior of K (km/s), uniform.
const K_KMS: (f64, f64) = (0.03, 0.2);

/// Prior of Porb/Prot, log-uniform.
const PERIODS: (f64, f64) = (0.5, 4.0);

/// Periods within this share of the rotation period are near co-rotation.
const NEAR: f64 = 0.15;

/// Coverage over 20 spot maps, five noise seeds and orbits each.
pub fn coverage(laboratory: &Laboratory) -> Result<Report, Failure> {
    let (maps, seeds) = laboratory.full_or_quick((20u64, 5u64), (1, 2));
    let stars: Vec<(u64, u64)> = (0..maps).flat_map(|map| (0..seeds).map(move |seed| (map, seed))).collect();
    let mut columns: Vec<String> = ["map", "seed"].map(str::to_owned).to_vec();
    columns.extend(ORBIT.map(|name| format!("true_{name}")));
    let judged = JUDGES.iter().flat_map(|judge| ORBIT.map(|name| (judge, name)));
    columns.extend(judged.flat_map(|(judge, name)| ENDS.map(|end| format!("{}_{name}_{end}", judge.name))));
    let mut report = Report::new(columns);
    let mut by_judge = Vec::new();
    (laboratory.report)("coverage: targets");
    let configs = stars.iter().map(|&(map, seed)| star(laboratory, map, seed));
    let configs: Vec<Value> = configs.collect::<Result<_, _>>()?;
    for judge in &JUDGES {
        let case = |((map, seed), config): (&(u64, u64), &Value)| Case {
            name: format!("{}_map_{map}_seed_{seed}", judge.name),
            config: with(
                config.clone(),
                &[
                    ("/imaging/objective", json!(judge.objective)),
                    ("/imaging/unresolved_spots", json!(judge.unresolved_spots)),
                ],
            ),
            grid: None,
            chain: true,
            periodogram: None,
        };
        let cases: Vec<Case> = stars.iter().zip(&configs).map(case).collect();
        by_judge.push(laboratory.outcomes("coverage", &cases)?);
    }
    for (k, &(map, seed)) in stars.iter().enumerate() {
        let mut row = vec![map as f64, noise_seed(map, seed) as f64];
        row.extend(ORBIT.map(|name| injected(&configs[k], name)));
        for outcomes in &by_judge {
            row.extend(ORBIT.iter().flat_map(|name| Estimate::numbers(outcomes[k].by_chain(name))));
        }
        report.row(row);
    }
    let panel = |judge: &Judge| Panel {
        x: "true_k_kms".into(),
        label: "k_kms".into(),
        series: vec![Series {
            name: judge.name.replace('_', " "),
            y: format!("{}_k_kms_median", judge.name),
            interval: Some(["low68", "high68"].map(|end| format!("{}_k_kms_{end}", judge.name))),
        }],
        truth: Some("true_k_kms".into()),
        joined: false,
        only: None,
    };
    report.figure = JUDGES.iter().map(panel).collect();
    for (judge, outcomes) in JUDGES.iter().zip(&by_judge) {
        report.number(judge.name, shares(&configs, outcomes));
    }
    Ok(report)
}

/// The injected value, which the config has in place of a start.
fn injected(config: &Value, name: &str) -> f64 {
    config["planet"][name].as_f64().unwrap_or(f64::NAN)
}

/// Fractions of the stars inside the intervals, with their binomial errors, for all periods, away from co-rotation and
/// near it.
fn shares(configs: &[Value], outcomes: &[Outcome]) -> Value {
    let is_near = |config: &Value| (injected(config, "porb_over_prot") - 1.0).abs() < NEAR;
    let of = |near: bool| -> Vec<&Outcome> {
        configs.iter().zip(outcomes).filter(|(config, _)| is_near(config) == near).map(|(_, outcome)| outcome).collect()
    };
    let groups =
        [("all", outcomes.iter().collect()), ("away_from_co_rotation", of(false)), ("near_co_rotation", of(true))];
    let of_group = |(group, stars): (&str, Vec<&Outcome>)| {
        let of_one = |name: &str| {
            let shares = [("inside_68", 0), ("inside_95", 1)].map(|(level, k)| {
                let inside = stars.iter().filter(|star| star.is_covered(name, k)).count();
                (level.to_owned(), json!(share(inside, stars.len())))
            });
            (name.to_owned(), Value::Object(shares.into_iter().collect()))
        };
        let mut of_all: Map<String, Value> = ORBIT.iter().map(|name| of_one(name)).collect();
        of_all.insert("stars".into(), json!(stars.len()));
        (group.to_owned(), Value::Object(of_all))
    };
    let mut all: Map<String, Value> = groups.into_iter().map(of_group).collect();
    let converged = outcomes.iter().filter(|o| o.chain.as_ref().is_some_and(|chain| chain.note.is_none())).count();
    all.insert("converged".into(), json!(converged));
    Value::Object(all)
}

/// Seed of the noise of a star.
fn noise_seed(map: u64, seed: u64) -> u64 {
    1000 * (map + 1) + seed
}

/// A star with spots of its map, and orbit and noise of its seed.
fn star(laboratory: &Laboratory, map: u64, seed: u64) -> Result<Value, Failure> {
    let mut rng = ChaCha8Rng::seed_from_u64(map);
    let spots = random_spots(&mut rng);
    rng.set_stream(1 + seed);
    let k_kms = rng.random_range(K_KMS.0..K_KMS.1);
    let period = rng.random_range(PERIODS.0.ln()..PERIODS.1.ln()).exp();
    let changes = [
        ("/observations/simulate/spots", spots),
        ("/observations/simulate/seed", json!(noise_seed(map, seed))),
        ("/planet", json!({ "k_kms": k_kms, "porb_over_prot": period, "phi": rng.random::<f64>() })),
        ("/observations/simulate/pixels", json!(laboratory.full_or_quick(20_000, 6000))),
        ("/imaging/pixels", json!(laboratory.full_or_quick(5000, 800))),
        ("/parameters/k_kms", json!({ "prior": "uniform", "min": K_KMS.0, "max": K_KMS.1 })),
        ("/parameters/porb_over_prot", json!({ "prior": "log-uniform", "min": PERIODS.0, "max": PERIODS.1 })),
        ("/sampler/walkers", json!(10)),
        ("/sampler/ess", json!(laboratory.full_or_quick(200, 100))),
        ("/sampler/rhat", json!(laboratory.full_or_quick(1.05, 1.1))),
    ];
    let config = with(paper(), &changes);
    attainable(laboratory, config)
}

/// lambda of the image at the target chi2, over the number of data; the paper's star at 0.97 has 1.6.
const LAMBDA: f64 = 3.0;

/// `config` with a target chi2 that its image attains: that of the image where lambda is [`LAMBDA`] over the number of
/// data. The lowest attainable chi2 depends on the noise realisation, and at a target near it spots would fit noise.
pub fn attainable(laboratory: &Laboratory, config: Value) -> Result<Value, Failure> {
    let scene = Scene::new(&Config::at(config.clone(), &laboratory.folder.join("config.json")))?;
    let image = Reference::at_lambda(&scene.imager, scene.settings.values, LAMBDA)?;
    let chi2 = (1e4 * image.solution.chi2 / scene.imager.data.depth.len() as f64).round() / 1e4;
    Ok(with(config, &[("/imaging/chi2_target", json!(chi2))]))
}

/// A dozen spots from the pole down to latitude -17.
pub fn random_spots(rng: &mut ChaCha8Rng) -> Value {
    let mut spot = || {
        let longitude = rng.random_range(0.0..360.0f64);
        let latitude = rng.random_range(-0.3f64..1.0).asin().to_degrees();
        json!([longitude, latitude, rng.random_range(5.0..17.0f64), rng.random_range(0.5..0.92f64)])
    };
    (0..12).map(|_| spot()).collect()
}
