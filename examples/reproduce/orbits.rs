//! R4 to R11, and co-rotation: the orbit of one planet under varied conditions, each star by three methods.
//!
//! The orbit is searched at periods within a factor of 1.4 of the injected one, as the paper's grids did (1.2 to 2.2
//! for 1.7); the periodogram searches all periods, and so do all methods where there is no planet, and in a part of R9.

use crate::cases::case::search;
use crate::cases::{Case, Estimate, Failure, Laboratory, Nodes, Outcome, Route, paper, with};
use crate::report::{Panel, Report, Series};
use serde_json::{Value, json};
use std::f64::consts::TAU;

/// The orbit is searched within this factor of the injected period.
const PERIOD_FACTOR: f64 = 1.4;

/// Rotation period of the paper's star (d).
const ROTATION_PERIOD_D: f64 = 3.0;

/// Names of the orbit's parameters.
const ORBIT: [&str; 3] = ["k_kms", "porb_over_prot", "phi"];

/// The orbit of most rows: K (km/s), Porb/Prot, phi.
const PLANET: [f64; 3] = [0.1, 1.7, 0.5];

/// A case with its varied parameters.
struct Varied {
    values: Vec<f64>,
    case: Case,
}

/// A star with a planet at `orbit`; what is varied in it goes into the name.
fn star(
    laboratory: &Laboratory,
    varied: &[(&str, f64)],
    [k, period, phi]: [f64; 3],
    changes: &[(&str, Value)],
) -> Varied {
    let pixels = laboratory.full_or_quick(5000, 1000);
    let orbit = [
        ("/planet/k_kms", json!(k)),
        ("/planet/porb_over_prot", json!(period)),
        ("/planet/phi", json!(phi)),
        ("/imaging/pixels", json!(pixels)),
        ("/parameters/porb_over_prot/min", json!(period / PERIOD_FACTOR)),
        ("/parameters/porb_over_prot/max", json!(period * PERIOD_FACTOR)),
        ("/sampler/walkers", json!(12)),
        ("/sampler/ess", json!(laboratory.full_or_quick(1000, 200))),
        ("/sampler/rhat", json!(laboratory.full_or_quick(1.01, 1.05))),
    ];
    let name: Vec<String> = varied.iter().map(|(name, value)| format!("{name}_{value}")).collect();
    Varied {
        values: varied.iter().map(|(_, value)| *value).collect(),
        case: Case {
            name: name.join("_"),
            config: with(with(paper(), &orbit), changes),
            grid: Some(Nodes::Around(laboratory.full_or_quick(9, 5))),
            chain: true,
            periodogram: Some(laboratory.full_or_quick(10_000, 1000)),
        },
    }
}

/// Runs the stars of a row and tabulates them.
fn tabulated(laboratory: &Laboratory, row: &str, names: &[&str], stars: Vec<Varied>) -> Result<Report, Failure> {
    let stars = laboratory.some(stars);
    let cases: Vec<Case> = stars.iter().map(|star| star.case.clone()).collect();
    let outcomes = laboratory.outcomes(row, &cases)?;
    let mut report = Report::new(columns(names));
    for (star, outcome) in stars.iter().zip(&outcomes) {
        report.row([&star.values[..], &numbers(outcome)].concat());
    }
    sum_up(&mut report, &outcomes);
    report.figure = ORBIT.map(|name| panel(names[0], name)).to_vec();
    // the other half of a row done in two ways is in the table
    if let Some(way) = names.iter().find(|name| WAYS.contains(name)) {
        report.figure.iter_mut().for_each(|panel| panel.only = Some(((*way).to_owned(), 0.0)));
    }
    Ok(report)
}

/// Columns on which of two models of a star was used.
const WAYS: [&str; 3] = ["equatorial_velocity_kept", "rotation_fitted", UNRESOLVED_SPOTS_FITTED];

/// The chain's treatment of residual (unresolved-spot) noise.
const UNRESOLVED_SPOTS_FITTED: &str = "unresolved_spots_fitted";

/// A varied parameter, and the change of the config for it.
type Way = ((&'static str, f64), Option<(&'static str, Value)>);

/// Both treatments of residual (unresolved-spot) noise.
fn ways_with_unresolved_spots() -> [Way; 2] {
    [
        ((UNRESOLVED_SPOTS_FITTED, 0.0), None),
        ((UNRESOLVED_SPOTS_FITTED, 1.0), Some(("/imaging/unresolved_spots", json!("fitted")))),
    ]
}

const ROUTES: [&str; 3] = ["grid", "chain", "periodogram"];

fn columns(names: &[&str]) -> Vec<String> {
    let mut columns: Vec<String> = names.iter().map(|&name| name.to_owned()).collect();
    columns.extend(ORBIT.map(|name| format!("true_{name}")));
    for route in ROUTES {
        let of_one = |name: &str| ["", "_low", "_high"].map(|end| format!("{route}_{name}{end}"));
        columns.extend(ORBIT.iter().flat_map(|name| of_one(name)));
        columns.extend(["reconstructions", "seconds"].map(|what| format!("{route}_{what}")));
    }
    let others = [
        "k_upper95_kms",
        "false_alarm",
        "chi2_target",
        "lambda_data",
        "spottedness",
        "search_reconstructions",
        "search_seconds",
    ];
    columns.extend(others.map(str::to_owned));
    columns
}

/// The numbers of all columns but those of what is varied.
fn numbers(outcome: &Outcome) -> Vec<f64> {
    let mut numbers: Vec<f64> =
        ORBIT.iter().map(|name| outcome.truth.get(*name).copied().unwrap_or(f64::NAN)).collect();
    for name in ROUTES {
        let route = outcome.routes().find(|(route, _)| *route == name).map(|(_, route)| route);
        for parameter in ORBIT {
            let estimate = route.and_then(|route| route.parameters.get(parameter));
            let turns = |e: &Estimate| outcome.deviation(parameter, e).map(|d| outcome.truth[parameter] + d - e.value);
            // a phase in the cycle of the truth
            let three = estimate
                .map_or([f64::NAN; 3], |e| [e.value, e.ci68[0], e.ci68[1]].map(|x| x + turns(e).unwrap_or(0.0)));
            numbers.extend(three.map(|x| rounded(x, 6)));
        }
        let cost = route.map_or([f64::NAN; 2], |route| {
            [route.reconstructions as f64, rounded(route.seconds.unwrap_or(f64::NAN), 3)]
        });
        numbers.extend(cost);
    }
    let others = [
        outcome.k_upper95_kms,
        outcome.false_alarm,
        outcome.chi2_target,
        outcome.lambda_data,
        outcome.spottedness,
        Some(outcome.search_reconstructions as f64),
        Some(outcome.search_seconds),
    ];
    numbers.extend(others.map(|x| rounded(x.unwrap_or(f64::NAN), 4)));
    numbers
}

/// `x` with this many significant digits: more are meaningless.
fn rounded(x: f64, digits: usize) -> f64 {
    format!("{x:.*e}", digits - 1).parse().unwrap_or(x)
}

/// A periodogram whose highest peak is a false alarm with a larger probability has found nothing.
const FOUND: f64 = 0.01;

/// For each method: deviation of its estimates from the truth, and mean cost. Most rows have one map and one noise
/// seed, so that these are not statistics of a method but its results for those data.
fn sum_up(report: &mut Report, outcomes: &[Outcome]) {
    for name in ROUTES {
        let routes: Vec<(&Outcome, &Route)> =
            outcomes.iter().filter_map(|o| Some((o, o.routes().find(|(route, _)| *route == name)?.1))).collect();
        let mut numbers = serde_json::Map::new();
        for parameter in ORBIT {
            let deviations: Vec<(f64, f64)> = routes
                .iter()
                .filter(|(outcome, _)| {
                    let found = name != "periodogram" || outcome.false_alarm.is_some_and(|p| p < FOUND);
                    // a planet that is not there has no period
                    found && (parameter == ORBIT[0] || outcome.truth.get(ORBIT[0]).is_some_and(|k| *k > 0.0))
                })
                .filter_map(|(outcome, route)| {
                    let estimate = route.parameters.get(parameter)?;
                    Some((outcome.deviation(parameter, estimate)?, estimate.error()))
                })
                .collect();
            let n = deviations.len() as f64;
            let mean = |f: &dyn Fn(&(f64, f64)) -> f64| rounded(deviations.iter().map(f).sum::<f64>() / n, 4);
            let value = json!({
                "estimates": deviations.len(),
                "mean_deviation": mean(&|(d, _)| *d),
                "rms_deviation": rounded((deviations.iter().map(|(d, _)| d * d).sum::<f64>() / n).sqrt(), 4),
                "mean_error": mean(&|(_, error)| *error),
            });
            numbers.insert(parameter.to_owned(), value);
        }
        let total = |f: &dyn Fn(&Route) -> f64| routes.iter().map(|(_, route)| f(route)).sum::<f64>();
        let each = routes.len().max(1) as f64;
        numbers.insert("reconstructions_each".into(), json!(rounded(total(&|r| r.reconstructions as f64) / each, 4)));
        numbers.insert("seconds_each".into(), json!(rounded(total(&|r| r.seconds.unwrap_or(f64::NAN)) / each, 3)));
        let notes: Vec<&String> = routes.iter().filter_map(|(_, route)| route.note.as_ref()).collect();
        numbers.insert("notes".into(), json!(notes));
        report.number(name, Value::Object(numbers));
    }
    let failed: Vec<&String> = outcomes.iter().filter_map(|outcome| outcome.failed.as_ref()).collect();
    report.number("failed", json!(failed));
}

fn panel(x: &str, name: &str) -> Panel {
    let series = |route: &str| Series {
        name: route.to_owned(),
        y: format!("{route}_{name}"),
        interval: Some(["low", "high"].map(|end| format!("{route}_{name}_{end}"))),
    };
    Panel {
        x: x.to_owned(),
        label: name.to_owned(),
        series: ROUTES.iter().map(|route| series(route)).collect(),
        truth: Some(format!("true_{name}")),
        joined: false,
        only: None,
    }
}

const SEED: &str = "/observations/simulate/seed";

/// Changes of a config that leave the period free, as it may be without a planet.
fn all_the_periods() -> [(&'static str, Value); 2] {
    [("/parameters/porb_over_prot/min", json!(0.5)), ("/parameters/porb_over_prot/max", json!(4.0))]
}

/// R4. The likelihood grid does not model unresolved spots, so that only the chain is made in both ways.
pub fn no_planet(laboratory: &Laboratory) -> Result<Report, Failure> {
    let mut stars = Vec::new();
    for (way, unresolved_spots) in ways_with_unresolved_spots() {
        for seed in 1..=5_u32 {
            let mut changes = vec![(SEED, json!(seed))];
            changes.extend(all_the_periods());
            changes.extend(unresolved_spots.clone());
            let mut star = star(laboratory, &[("seed", f64::from(seed)), way], [0.0, 1.7, 0.5], &changes);
            let [k, period, phi] = laboratory.full_or_quick([11, 15, 12], [5, 5, 5]);
            let nodes = Nodes::At([(0.0, 0.2, k), (0.5, 4.0, period), (0.0, 1.0, phi)]);
            star.case.grid = unresolved_spots.is_none().then_some(nodes);
            stars.push(star);
        }
    }
    tabulated(laboratory, "R4", &["seed", UNRESOLVED_SPOTS_FITTED], stars)
}

/// R5.
pub fn amplitudes(laboratory: &Laboratory) -> Result<Report, Failure> {
    let [_, period, phi] = PLANET;
    let star = |&k: &f64| star(laboratory, &[("k_kms", k)], [k, period, phi], &[]);
    let all = [0.01, 0.02, 0.03, 0.04, 0.06, 0.08, 0.1, 0.12, 0.15, 0.2];
    tabulated(laboratory, "R5", &["k_kms"], all.iter().map(star).collect())
}

/// R6.
pub fn periods(laboratory: &Laboratory) -> Result<Report, Failure> {
    let [k, _, phi] = PLANET;
    let star = |tenths: u32| {
        let period = f64::from(tenths) / 10.0;
        star(laboratory, &[("porb_over_prot", period)], [k, period, phi], &[])
    };
    tabulated(laboratory, "R6", &["porb_over_prot"], (5..=20).map(star).collect())
}

/// R7.
pub fn phases(laboratory: &Laboratory) -> Result<Report, Failure> {
    let [k, period, _] = PLANET;
    let star = |tenths: u32| {
        let phi = f64::from(tenths) / 10.0;
        star(laboratory, &[("phi", phi)], [k, period, phi], &[])
    };
    tabulated(laboratory, "R7", &["phi"], (0..10).map(star).collect())
}

/// R8.
pub fn targets(laboratory: &Laboratory) -> Result<Report, Failure> {
    let star = |(target, seed): (f64, u32)| {
        let changes = [("/imaging/chi2_target", json!(target)), (SEED, json!(seed))];
        star(laboratory, &[("chi2_target", target), ("seed", f64::from(seed))], PLANET, &changes)
    };
    let all = (1..=3).flat_map(|seed| [0.94, 0.97, 1.0].map(|target| (target, seed)));
    tabulated(laboratory, "R8", &["chi2_target", "seed"], all.map(star).collect())
}

/// R9. Once with the projected velocity fixed, as measured from a line's width, and once with the equatorial velocity
/// fixed, so that vsini changes with the inclination; the latter also with all periods allowed.
pub fn inclinations(laboratory: &Laboratory) -> Result<Report, Failure> {
    const TRUE_DEG: f64 = 38.0;
    const VSINI_KMS: f64 = 40.0;
    let star = |(assumed, equatorial, all_periods): (f64, bool, bool)| {
        let ratio = assumed.to_radians().sin() / TRUE_DEG.to_radians().sin();
        let mut changes = vec![
            ("/observations/simulate/truth/inclination_deg", json!(TRUE_DEG)),
            ("/star/inclination_deg", json!(assumed)),
        ];
        if equatorial {
            changes.push(("/observations/simulate/truth/vsini_kms", json!(VSINI_KMS)));
            changes.push(("/star/vsini_kms", json!(VSINI_KMS * ratio)));
            // where nothing fits, K grows beyond what the paper's planets have
            changes.push(("/parameters/k_kms/max", json!(0.6)));
        }
        if all_periods {
            changes.extend(all_the_periods());
        }
        let [equatorial, all_periods] = [equatorial, all_periods].map(|is| f64::from(u8::from(is)));
        let varied = [("assumed_deg", assumed), ("equatorial_velocity_kept", equatorial), ("all_periods", all_periods)];
        star(laboratory, &varied, PLANET, &changes)
    };
    // far off the solver takes minutes to find that nothing fits
    let projected = laboratory.full_or_quick(&[33.0, 35.0, 37.0, 38.0, 39.0, 41.0, 43.0][..], &[37.0, 39.0]);
    let equatorial = laboratory.full_or_quick(&[35.0, 36.0, 40.0, 43.0][..], &[]);
    let projected = projected.iter().map(|&assumed| (assumed, false, false));
    let near = equatorial.iter().map(|&assumed| (assumed, true, false));
    let everywhere = equatorial.iter().map(|&assumed| (assumed, true, true));
    let names = ["assumed_deg", "equatorial_velocity_kept", "all_periods"];
    tabulated(laboratory, "R9", &names, projected.chain(near).chain(everywhere).map(star).collect())
}

/// Shear of the star, and of the model.
fn sheared(laboratory: &Laboratory, gamma: f64, assumed: f64) -> Varied {
    let shear = |gamma: f64| json!(gamma * TAU / ROTATION_PERIOD_D);
    let changes = [("/observations/simulate/truth/domega_rad_d", shear(gamma)), ("/star/domega_rad_d", shear(assumed))];
    star(laboratory, &[("gamma", gamma)], PLANET, &changes)
}

/// R10.
pub fn shear_modelled(laboratory: &Laboratory) -> Result<Report, Failure> {
    let stars = (0..=5).map(|k| f64::from(4 * k) / 1000.0).map(|gamma| sheared(laboratory, gamma, gamma));
    tabulated(laboratory, "R10", &["gamma"], stars.collect())
}

/// R11. Once with the rotation of the equator, and once with the solid rotation that fits the profiles best, as assumed
/// by an observer unaware of shear.
pub fn shear_ignored(laboratory: &Laboratory) -> Result<Report, Failure> {
    let mut stars = Vec::new();
    for gamma in (0..=6).map(|k| f64::from(4 * k) / 1000.0) {
        stars.push(Varied { values: vec![gamma, 0.0], ..sheared(laboratory, gamma, 0.0) });
    }
    let gammas = laboratory.full_or_quick(&[0.004, 0.008, 0.012, 0.016, 0.02][..], &[0.012]);
    for &gamma in gammas {
        laboratory.go_on()?;
        (laboratory.report)(&format!("R11, gamma {gamma}: solid rotation that fits best"));
        let mut star = sheared(laboratory, gamma, 0.0);
        let prior = json!({ "prior": "uniform", "min": 2.0, "max": 2.2 });
        let injected = ("/observations/simulate/truth/omega_eq_rad_d", json!(TAU / ROTATION_PERIOD_D));
        let free = with(star.case.config.clone(), &[injected.clone(), ("/parameters/omega_eq_rad_d", prior)]);
        let (scene, found) = search(&free, &laboratory.folder.join("config.json"), laboratory.pool)?;
        let index = scene.space.names().iter().position(|name| name == "omega_eq_rad_d").expect("it is free");
        let omega = rounded(found.optimum.theta[index], 7);
        star.case.name += "_rotation_fitted";
        star.case.config = with(star.case.config, &[injected, ("/star/omega_eq_rad_d", json!(omega))]);
        stars.push(Varied { values: vec![gamma, 1.0], ..star });
    }
    tabulated(laboratory, "R11", &["gamma", "rotation_fitted"], stars)
}

/// K = 100 m/s at the rotation period, the same number of profiles over more and more rotations, for several noise
/// seeds.
pub fn co_rotation(laboratory: &Laboratory) -> Result<Report, Failure> {
    const PROFILES: u32 = 50;
    let mut stars = Vec::new();
    for (way, unresolved_spots) in ways_with_unresolved_spots() {
        for (rotations, seed) in
            [1, 2, 3, 4, 6, 8].into_iter().flat_map(|rotations| (1..=3).map(move |seed| (rotations, seed)))
        {
            let cycle = |k: u32| f64::from(k * rotations) / f64::from(PROFILES);
            let cycles: Vec<f64> = (0..PROFILES).map(cycle).collect();
            let mut changes = vec![("/observations/simulate/cycles", json!(cycles)), (SEED, json!(seed))];
            changes.extend(unresolved_spots.clone());
            let varied = [("rotations", f64::from(rotations)), ("seed", f64::from(seed)), way];
            let mut star = star(laboratory, &varied, [0.1, 1.0, 0.5], &changes);
            // its agreement with the chain is shown in the other rows
            star.case.grid = None;
            stars.push(star);
        }
    }
    tabulated(laboratory, "co-rotation", &["rotations", "seed", UNRESOLVED_SPOTS_FITTED], stars)
}
