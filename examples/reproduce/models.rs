//! Stars beyond spots on a quiet photosphere: faculae, a line with wings, a varying continuum; each analysed with its
//! true model and with the plain one.
//!
//! Cost of a wrong model: bias of K and coverage of its intervals. Every noise seed has its own spot map and phase.

use crate::cases::{Case, ENDS, Estimate, Failure, Laboratory, Outcome, paper, share, with};
use crate::coverage::{attainable, random_spots};
use crate::report::{Report, rounded};
use dimcmc::internals::data::io::lsd;
use dimcmc::{Config, Scene};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// A change of a config: where (JSON pointer), and what.
type Changes = Vec<(&'static str, Value)>;

/// A property of a star beyond spots, with the change of the model for it.
struct Kind {
    name: &'static str,
    /// Changes of the simulated star.
    star: fn(&mut ChaCha8Rng) -> Changes,
    /// Changes of the true model.
    model: fn() -> Changes,
}

const KINDS: [Kind; 4] = [
    Kind { name: "spots", star: |_| Vec::new(), model: Vec::new },
    Kind {
        name: "faculae",
        star: |rng| vec![("/observations/simulate/faculae", faculae(rng))],
        model: || vec![("/imaging/brightness", json!("bright-and-dark"))],
    },
    Kind { name: "wings", star: |_| voigt(), model: voigt },
    Kind {
        name: "continuum",
        star: |_| {
            let wandering = json!({ "offset": 1e-3, "slope": 1e-3, "equivalent_width": 0.01 });
            vec![("/observations/simulate/continuum", wandering)]
        },
        model: || {
            let nuisances = json!({ "continuum_offset": 1e-3, "continuum_slope": 1e-3, "equivalent_width": 0.01 });
            vec![("/imaging/nuisances", nuisances)]
        },
    },
];

/// A line with wings: a Lorentzian of a fifth of the Gaussian's width convolved with it.
fn voigt() -> Changes {
    vec![("/star/line/shape", json!("voigt")), ("/star/line/gamma_kms", json!(0.6))]
}

/// Six regions a fifth brighter than the photosphere.
fn faculae(rng: &mut ChaCha8Rng) -> Value {
    let mut region = || {
        let latitude = rng.random_range(-0.3f64..1.0).asin().to_degrees();
        json!([rng.random_range(0.0..360.0f64), latitude, rng.random_range(8.0..20.0f64), 0.2])
    };
    (0..6).map(|_| region()).collect()
}

/// The orbit, but for its phase: K (km/s) and Porb/Prot.
const ORBIT: [(&str, f64); 2] = [("k_kms", 0.1), ("porb_over_prot", 1.7)];

/// The stars of all kinds, each analysed by the plain model and by the right one.
pub fn models(laboratory: &Laboratory) -> Result<Report, Failure> {
    let seeds = laboratory.full_or_quick(10u64, 1);
    let columns = ["kind", "right_model", "seed", "chi2_target", "spottedness", "true_phi"].map(str::to_owned);
    let names = ["k_kms", "porb_over_prot", "phi"];
    let estimates = names.iter().flat_map(|name| ENDS.map(|end| format!("{name}_{end}")));
    let mut report = Report::new(columns.into_iter().chain(estimates));
    for (k, kind) in KINDS.iter().enumerate() {
        let simulated: Vec<(Value, f64)> =
            (0..seeds).map(|seed| star(laboratory, kind, seed)).collect::<Result<_, _>>()?;
        let right = (kind.model)();
        // the plain model is true for a star with only spots
        let models = [(0.0, Vec::new()), (1.0, right)];
        for (is_right, model) in models.into_iter().filter(|(is_right, model)| *is_right == 0.0 || !model.is_empty()) {
            let way = if is_right == 1.0 { "right" } else { "plain" };
            let case = |(seed, (config, _)): (usize, &(Value, f64))| {
                Ok(Case {
                    name: format!("{}_{way}_{seed}", kind.name),
                    config: attainable(laboratory, with(config.clone(), &model))?,
                    grid: None,
                    chain: true,
                    periodogram: None,
                })
            };
            let cases: Vec<Case> = simulated.iter().enumerate().map(case).collect::<Result<_, Failure>>()?;
            let mut outcomes = laboratory.outcomes("models", &cases)?;
            for (seed, (outcome, (_, phi))) in outcomes.iter_mut().zip(&simulated).enumerate() {
                let [k_kms, period] = ORBIT.map(|(name, value)| (name.to_owned(), value));
                outcome.truth = BTreeMap::from([k_kms, period, ("phi".to_owned(), *phi)]);
                let [target, spottedness] = [outcome.chi2_target, outcome.spottedness].map(|x| x.unwrap_or(f64::NAN));
                let row = [k as f64, is_right, seed as f64, target, spottedness, *phi];
                let estimates = names.iter().flat_map(|name| Estimate::numbers(outcome.by_chain(name)));
                report.row(row.into_iter().chain(estimates).collect());
            }
            report.number(&format!("{}, {way} model", kind.name), sum_up(&outcomes));
        }
    }
    Ok(report)
}

/// Bias and rms of K, its mean error bar, and the coverage of intervals.
fn sum_up(outcomes: &[Outcome]) -> Value {
    let found = outcomes.iter().filter_map(|outcome| {
        let estimate = outcome.by_chain("k_kms")?;
        Some((outcome.deviation("k_kms", estimate)?, estimate.error()))
    });
    let found: Vec<(f64, f64)> = found.collect();
    let n = found.len() as f64;
    let bias = found.iter().map(|(d, _)| d).sum::<f64>() / n;
    let targets = outcomes.iter().map(|outcome| outcome.chi2_target.unwrap_or(f64::NAN));
    let covered = |name: &str, level| {
        share(outcomes.iter().filter(|outcome| outcome.is_covered(name, level)).count(), outcomes.len())
    };
    json!({
        "stars": outcomes.len(),
        "without_result": outcomes.len() - found.len(),
        "mean_chi2_target": rounded(targets.sum::<f64>() / outcomes.len() as f64),
        "k_bias_kms": rounded(bias),
        "k_scatter_kms": rounded((found.iter().map(|(d, _)| (d - bias).powi(2)).sum::<f64>() / (n - 1.0)).sqrt()),
        "k_error_kms": rounded(found.iter().map(|(_, error)| error).sum::<f64>() / n),
        "k_inside_68": covered("k_kms", 0),
        "k_inside_95": covered("k_kms", 1),
        "period_inside_95": covered("porb_over_prot", 1),
        "phi_inside_95": covered("phi", 1),
    })
}

/// A star of this kind, simulated into files, with the plain model of it as a config; and the phase of its planet.
fn star(laboratory: &Laboratory, kind: &Kind, seed: u64) -> Result<(Value, f64), Failure> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let spots = random_spots(&mut rng);
    let phi = rng.random::<f64>();
    let [(_, k_kms), (_, period)] = ORBIT;
    let plain = [
        ("/planet", json!({ "k_kms": k_kms, "porb_over_prot": period, "phi": phi })),
        ("/imaging/pixels", json!(laboratory.full_or_quick(2000, 1000))),
        ("/imaging/unresolved_spots", json!("fitted")),
        ("/parameters/k_kms/max", json!(0.4)),
        ("/parameters/porb_over_prot/min", json!(1.2)),
        ("/parameters/porb_over_prot/max", json!(2.4)),
        ("/sampler/walkers", json!(12)),
        ("/sampler/ess", json!(laboratory.full_or_quick(200, 100))),
        ("/sampler/rhat", json!(laboratory.full_or_quick(1.05, 1.1))),
    ];
    let plain = with(paper(), &plain);
    let more = (kind.star)(&mut rng);
    let seeded = [("/observations/simulate/spots", spots), ("/observations/simulate/seed", json!(1 + seed))];
    let simulated = with(with(plain.clone(), &seeded), &more);
    let folder = laboratory.folder(&format!("models/{}_data_{seed}", kind.name))?;
    let observations = Scene::new(&Config::at(simulated, &folder.join("config.json")))?.observations;
    lsd::write(&folder, &observations)?;
    // an absolute path for readers of the config in other folders
    let path = std::path::absolute(folder.join("observations.txt")).unwrap_or_else(|_| folder.join("observations.txt"));
    Ok((with(plain, &[("/observations", json!({ "path": path }))]), phi))
}
