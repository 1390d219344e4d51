//! Stars with evolving spots, with and without a planet, searched blindly by two objectives: one static map of least
//! spots for all nights, and the marginal likelihood, marginalised over evolving maps.
//!
//! Star and line are known; the uncertainties of the profiles are measured. A star has the same nights, noise and orbit
//! whatever the lifetime of its spots.

use crate::cases::case::is_of_the_star;
use crate::cases::{Failure, Laboratory, paper, share, with};
use crate::report::{Panel, Report, Series, rounded};
use dimcmc::internals::data::io::lsd;
use dimcmc::internals::inference::detection::{Detection, DetectionSettings, Evidence};
use dimcmc::internals::planets::periodogram::Frequencies;
use dimcmc::internals::planets::verdict::CANDIDATE_FAP;
use dimcmc::internals::surface::evolving_map::change::CHANGES;
use dimcmc::{Config, Finding, FrequencySettings, Scene, SceneError, Verdict};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::path::Path;
use std::time::Instant;

/// Periods closer than this many inverse time bases are the same.
const SAME_PERIOD: f64 = 0.5;

/// Periods within this share of the rotation period are near co-rotation, where sigma_K differs.
const NEAR: f64 = 0.15;

/// Name of the row's raw results.
const ROW: &str = "changing";

/// Lifetimes of the spots (d); none for static spots. Spots on a star at a time: evolving ones have half of their
/// largest area in the mean.
const LIFETIMES_D: [Option<f64>; 3] = [None, Some(45.0), Some(15.0)];
const SPOTS_FOR_EVER: usize = 12;
const SPOTS_AT_A_TIME: usize = 16;

/// K of the planets (km/s), and the periods, over that of the rotation.
const K_KMS: f64 = 0.1;
const PERIODS: (f64, f64) = (0.5, 4.0);

/// Objectives, and the prefixes of the columns of their results.
const OBJECTIVES: [(&str, &str); 2] = [("spottedness", "one_map"), ("marginal-likelihood", "integrated")];

/// Suffixes of the columns of an objective. Findings: 0 no significant signal, 1 a candidate, 2 a detection.
const RESULTS: [&str; 8] = [
    "false_alarm",
    "log10_false_alarm",
    "finding",
    "porb_over_prot",
    "is_right",
    "k_kms",
    "sigma_k_kms",
    "median_sigma_k_kms",
];

/// One star for a search.
#[derive(Clone, Copy)]
struct Star {
    lifetime_d: Option<f64>,
    has_planet: bool,
    seed: u64,
}

/// The result of a search.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Searched {
    /// The verdict of the search, ignoring remarks on spot evolution.
    verdict: Verdict,
    porb_over_prot: f64,
    /// Whether that is the period of the planet, to half the inverse time base.
    is_right: bool,
    /// sigma_K (km/s), its median over all periods away from that of the rotation.
    median_sigma_k_kms: Option<f64>,
    /// Difference in ln Z between evolving and static spots, where they are compared.
    change: Option<f64>,
    /// Lifetime of the fitted field (d).
    lifetime_d: Option<f64>,
    seconds: f64,
}

/// The results of both objectives for a star, or why one has none.
type OfStar = Vec<Result<Searched, String>>;

impl Star {
    fn name(&self) -> String {
        let lifetime = self.lifetime_d.map_or("for_ever".to_owned(), |days| format!("{days}_d"));
        let planet = if self.has_planet { "planet" } else { "no_planet" };
        format!("{lifetime}_{planet}_{}", self.seed)
    }

    /// K (km/s), period over that of the rotation, phase.
    fn orbit(&self) -> [f64; 3] {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        let period = rng.random_range(PERIODS.0.ln()..PERIODS.1.ln()).exp();
        let phi = rng.random::<f64>();
        [if self.has_planet { K_KMS } else { 0.0 }, period, phi]
    }

    /// The config of its simulation.
    fn simulated(&self, laboratory: &Laboratory) -> Value {
        let number = if self.lifetime_d.is_some() { SPOTS_AT_A_TIME } else { SPOTS_FOR_EVER };
        let [k_kms, porb_over_prot, phi] = self.orbit();
        let simulate = json!({
            "random_spots": {
                "number": number, "lifetime_d": self.lifetime_d, "latitude_deg": [-17, 90], "seed": self.seed
            },
            "schedule": { "nights": laboratory.full_or_quick(15, 8), "clouds": 0.12, "seed": self.seed },
            "velocity_kms": { "min": -59.4, "max": 59.4, "step": 1.8 },
            "snr": 1000, "seed": self.seed, "pixels": 20_000
        });
        let changes = [
            ("/observations", json!({ "simulate": simulate })),
            ("/planet", json!({ "k_kms": k_kms, "porb_over_prot": porb_over_prot, "phi": phi })),
            ("/imaging/pixels", json!(laboratory.full_or_quick(2000, 1000))),
        ];
        with(paper(), &changes)
    }

    /// The results of both objectives; its profiles are stored in `folder`.
    fn searched(&self, config: &Value, folder: &Path) -> Result<OfStar, Failure> {
        let at = |config: Value| Config::at(config, &folder.join("config.json"));
        let observations = Scene::new(&at(config.clone()))?.observations;
        lsd::write(folder, &observations)?;
        let observed = json!({ "path": "observations.txt", "sigma_scale": "auto" });
        let by = |(objective, _): &(&str, &str)| {
            let changes = [("/observations", observed.clone()), ("/imaging/objective", json!(objective))];
            match self.search(at(with(config.clone(), &changes))) {
                // no map, no maximum: that is a result too
                Err(error) if is_of_the_star(&error) || error.is::<SceneError>() => Ok(Err(error.to_string())),
                searched => searched.map(Ok),
            }
        };
        OBJECTIVES.iter().map(by).collect()
    }

    fn search(&self, config: Config) -> Result<Searched, Failure> {
        let began = Instant::now();
        let scene = Scene::new(&config)?;
        let imager = &scene.imager;
        let frequencies =
            Frequencies::new(&imager.cycles(), imager.star.rotation_period_d, FrequencySettings::default())?;
        let settings = DetectionSettings::of(scene.surface(), Vec::new());
        let mut found = Detection::find(imager, scene.settings.values, frequencies, &settings, &|_| ())?;
        let change = found.change.take().and_then(Result::ok);
        let evidence = Evidence { imager, settings: &settings, robustness: None, night_offsets: None, misfit: &[] };
        let remarks = found.remarks(&evidence);
        let [_, porb_over_prot, _] = self.orbit();
        let apart = (1.0 / found.best.porb_over_prot - 1.0 / porb_over_prot).abs() * imager.time_base_cycles();
        let near = |frequency: f64| (1.0 / frequency - 1.0).abs() < NEAR;
        let trials = found.blind.rows.iter().map(|row| row.trial).filter(|trial| !near(trial.frequency));
        let away = trials.filter_map(|trial| Some(trial.orbit?.sigma_k_kms));
        let field = found.last().field.as_ref();
        Ok(Searched {
            verdict: found.verdict(&remarks),
            porb_over_prot: found.best.porb_over_prot,
            is_right: self.has_planet && apart < SAME_PERIOD,
            median_sigma_k_kms: median(away.collect()),
            change: change.map(|change| change.ln_evidence_gain),
            lifetime_d: field.and_then(|field| field.spot_lifetime_d),
            seconds: began.elapsed().as_secs_f64(),
        })
    }
}

impl Searched {
    /// Numbers for the columns [`RESULTS`].
    fn numbers(&self) -> [f64; RESULTS.len()] {
        let finding = match self.verdict.finding {
            Finding::NoPlanetNeeded => 0.0,
            Finding::Candidate => 1.0,
            Finding::Detection => 2.0,
            Finding::NotJudged => f64::NAN,
        };
        let false_alarm = self.false_alarm();
        // an underflow is shown as the smallest double
        let log10 = false_alarm.max(f64::MIN_POSITIVE).log10();
        let [k_kms, sigma_k_kms] = self.verdict.signal.map_or([f64::NAN; 2], |s| [s.k_kms, s.sigma_k_kms]);
        let is_right = f64::from(self.is_right);
        let median = self.median_sigma_k_kms.unwrap_or(f64::NAN);
        [false_alarm, log10, finding, self.porb_over_prot, is_right, k_kms, sigma_k_kms, median]
    }

    fn false_alarm(&self) -> f64 {
        self.verdict.false_alarm_probability.unwrap_or(f64::NAN)
    }

    fn is_candidate(&self) -> bool {
        self.false_alarm() < CANDIDATE_FAP
    }

    /// Whether the injected K is inside that many standard errors.
    fn covers(&self, errors: f64) -> bool {
        self.verdict.signal.is_some_and(|s| (s.k_kms - K_KMS).abs() <= errors * s.sigma_k_kms)
    }
}

/// The stars of all lifetimes, without and with a planet, by both objectives.
pub fn changing(laboratory: &Laboratory) -> Result<Report, Failure> {
    let seeds = laboratory.full_or_quick(1..=5, 1..=1);
    let lifetimes_d = laboratory.some(LIFETIMES_D.to_vec());
    let groups: Vec<(Option<f64>, bool)> =
        [false, true].into_iter().flat_map(|planet| lifetimes_d.iter().map(move |days| (*days, planet))).collect();
    let group_of = |&(lifetime_d, has_planet): &(Option<f64>, bool)| {
        seeds.clone().map(move |seed| Star { lifetime_d, has_planet, seed })
    };
    let stars: Vec<Star> = groups.iter().flat_map(group_of).collect();
    let searched = |(k, star): (usize, &Star)| {
        let config = star.simulated(laboratory);
        (laboratory.report)(&format!("{ROW}, star {} of {}: {}", k + 1, stars.len(), star.name()));
        laboratory.kept(ROW, &star.name(), &config, |folder| star.searched(&config, folder))
    };
    let results = stars.iter().enumerate().map(searched).collect::<Result<Vec<_>, _>>()?;
    let of_stars = ["group", "lifetime_d", "star", "true_k_kms", "true_porb_over_prot"].map(str::to_owned);
    let of_searches = OBJECTIVES.iter().flat_map(|(_, name)| RESULTS.map(|result| format!("{name}_{result}")));
    let of_change = ["change_ln_evidence_gain", "integrated_lifetime_d"].map(str::to_owned);
    let bounds = OBJECTIVES.iter().flat_map(|(_, name)| ["low68", "high68"].map(|end| format!("{name}_k_kms_{end}")));
    let mut report = Report::new(of_stars.into_iter().chain(of_searches).chain(of_change).chain(bounds));
    for (group, &(lifetime_d, has_planet)) in groups.iter().enumerate() {
        let of_group = group * stars.len() / groups.len()..(group + 1) * stars.len() / groups.len();
        for (star, result) in stars[of_group.clone()].iter().zip(&results[of_group.clone()]) {
            report.row(row(group, star, result));
        }
        let lifetime = lifetime_d.map_or("static".to_owned(), |days| format!("{days} d"));
        let planet = if has_planet { "planet" } else { "no planet" };
        report.number(&format!("spots {lifetime}, {planet}"), sum_up(&results[of_group], has_planet));
        report.figure.push(panel(group, &lifetime, has_planet));
    }
    Ok(report)
}

fn row(group: usize, star: &Star, result: &OfStar) -> Vec<f64> {
    let [k_kms, porb_over_prot, _] = star.orbit();
    let mut numbers = vec![group as f64, star.lifetime_d.unwrap_or(f64::NAN), star.seed as f64, k_kms, porb_over_prot];
    let found = || result.iter().map(|searched| searched.as_ref().ok());
    numbers.extend(found().flat_map(|searched| searched.map_or([f64::NAN; RESULTS.len()], Searched::numbers)));
    let [one_map, integrated] = [0, 1].map(|k| result[k].as_ref().ok());
    numbers.push(one_map.and_then(|searched| searched.change).unwrap_or(f64::NAN));
    numbers.push(integrated.and_then(|searched| searched.lifetime_d).unwrap_or(f64::NAN));
    let ends = |searched: Option<&Searched>| {
        let signal = searched.and_then(|searched| searched.verdict.signal);
        signal.map_or([f64::NAN; 2], |s| [s.k_kms - s.sigma_k_kms, s.k_kms + s.sigma_k_kms])
    };
    numbers.extend(found().flat_map(ends));
    numbers
}

/// Spurious detections of stars without a planet, the K of those with one.
fn panel(group: usize, lifetime: &str, has_planet: bool) -> Panel {
    let series = |(objective, name): &(&str, &str)| Series {
        name: objective.replace('-', " "),
        y: format!("{name}_{}", if has_planet { "k_kms" } else { "log10_false_alarm" }),
        interval: has_planet.then(|| ["low68", "high68"].map(|end| format!("{name}_k_kms_{end}"))),
    };
    let label = if has_planet { "*K* (km/s)" } else { "lg FAP, no planet" };
    Panel {
        x: "star".into(),
        label: format!("{label}, {lifetime}"),
        series: OBJECTIVES.iter().map(series).collect(),
        truth: has_planet.then(|| "true_k_kms".into()),
        joined: false,
        only: Some(("group".into(), group as f64)),
    }
}

/// Summary of each objective for the stars of a group.
fn sum_up(results: &[OfStar], has_planet: bool) -> Value {
    let of_objective = |k: usize| {
        let found: Vec<&Searched> = results.iter().filter_map(|result| result[k].as_ref().ok()).collect();
        let count = |is: &dyn Fn(&Searched) -> bool| found.iter().filter(|searched| is(searched)).count();
        let lowest = found.iter().map(|searched| searched.false_alarm()).fold(f64::NAN, f64::min);
        let sigmas = found.iter().filter_map(|searched| searched.median_sigma_k_kms).filter(|sigma| sigma.is_finite());
        let mut of_all = json!({
            "without_result": results.len() - found.len(),
            "lowest_false_alarm": lowest,
            "candidates": count(&Searched::is_candidate),
            "median_sigma_k_kms": median(sigmas.collect()).map(rounded),
        });
        if has_planet {
            of_all["found_at_the_right_period"] = json!(count(&|s| s.is_candidate() && s.is_right));
            of_all["k_inside_68"] = json!(share(count(&|s| s.covers(1.0)), results.len()));
            of_all["k_inside_95"] = json!(share(count(&|s| s.covers(2.0)), results.len()));
        }
        let changes = found.iter().filter_map(|searched| searched.change);
        if let Some(median) = median(changes.collect()) {
            of_all["not_judged_for_the_star_changes"] = json!(count(&|s| s.change.is_some_and(|gain| gain > CHANGES)));
            of_all["median_change_ln_evidence_gain"] = json!(rounded(median));
        }
        if let Some(lifetime_d) = median(found.iter().filter_map(|searched| searched.lifetime_d).collect()) {
            of_all["median_lifetime_d"] = json!(rounded(lifetime_d));
        }
        of_all
    };
    let mut summed = json!({ "stars": results.len() });
    for (k, (objective, _)) in OBJECTIVES.iter().enumerate() {
        summed[objective] = of_objective(k);
    }
    summed
}

fn median(mut all: Vec<f64>) -> Option<f64> {
    all.sort_by(f64::total_cmp);
    Some(0.5 * (all.get(all.len() / 2)? + all[(all.len() - 1) / 2]))
}
