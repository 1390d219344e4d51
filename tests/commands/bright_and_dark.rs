//! Images of bright and dark pixels: derivatives, optimality, the limit in which they equal those of spots, recovered
//! positions of faculae, and every command with them.

use crate::desk::{Desk, says, two_spots};
use dimcmc::internals::data::config::Config;
use dimcmc::internals::data::scene::Scene;
use dimcmc::internals::maxent::entropy::Entropy;
use dimcmc::internals::maxent::{Curvature, Problem, SolverSettings};
use dimcmc::internals::surface::ObjectiveKind;
use dimcmc::internals::surface::imaging::Imager;
use dimcmc::internals::surface::static_map::{Posterior, Reference};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde_json::{Value, json};
use std::path::Path;

/// Where the faculae are: longitude, latitude, radius (degrees), excess.
const FACULAE: [[f64; 4]; 4] =
    [[200.0, 40.0, 12.0, 0.15], [60.0, 20.0, 10.0, 0.15], [330.0, -10.0, 9.0, 0.2], [110.0, 60.0, 10.0, 0.12]];

/// The paper's star with faculae beside its spots.
fn scene() -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/demo.json");
    let mut config: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    config["observations"]["simulate"]["faculae"] = json!(FACULAE);
    config["imaging"]["brightness"] = json!("bright-and-dark");
    config["imaging"]["pixels"] = json!(1500);
    Scene::new(&Config::at(config.clone(), &path)).unwrap()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn image(imager: &Imager, reference: &Reference) -> Vec<f64> {
    imager.entropy.image(&reference.solution.image.coordinates)
}

#[test]
fn gradient_and_curvature_of_the_misfit_are_its_derivatives() {
    let Scene { imager, settings, .. } = scene();
    let mut problem = imager.problem(imager.response(&settings.values.state()));
    let n = imager.grid.len();
    let wave = |a: f64| -> Vec<f64> { (0..n).map(|i| (a * (i * i) as f64).sin()).collect() };
    let b: Vec<f64> = wave(0.37).iter().map(|x| 1.0 + 0.3 * x).collect();
    let (v, w, h) = (wave(0.9), wave(1.7), 1e-5);
    let (mut gradient, mut curved) = (vec![0.0; n], vec![0.0; n]);
    let mut at = |h: f64| {
        let chi2 = problem.linearise(&b.iter().zip(&v).map(|(b, v)| b + h * v).collect::<Vec<f64>>());
        problem.gradient(&mut gradient);
        (chi2, dot(&gradient, &w))
    };
    let ((chi2_plus, slope_plus), (chi2_minus, slope_minus)) = (at(h), at(-h));
    problem.linearise(&b);
    problem.gradient(&mut gradient);
    problem.curvature(Curvature::Exact, &v, &mut curved);
    // differences are accurate to h^2 and to rounding over h
    assert!((dot(&gradient, &v) / ((chi2_plus - chi2_minus) / (4.0 * h)) - 1.0).abs() < 1e-6);
    assert!((dot(&curved, &w) / ((slope_plus - slope_minus) / (2.0 * h)) - 1.0).abs() < 1e-6);
}

#[test]
fn the_solution_meets_its_optimality_conditions_and_shows_what_is_there() {
    let scene = scene();
    let imager = &scene.imager;
    let reference = Reference::build(imager, scene.settings.values, 0.97).unwrap();
    let solution = &reference.solution;
    assert!((solution.chi2 / reference.chi2_target - 1.0).abs() < 1e-9);
    let (b, area) = (image(imager, &reference), &imager.grid.area);
    let mut problem = imager.problem(reference.response.clone());
    let mut misfit = vec![0.0; b.len()];
    problem.linearise(&b);
    problem.gradient(&mut misfit);
    // gradients of -S and chi2/2 with respect to ln B
    let order: Vec<f64> = (0..b.len()).map(|p| area[p] * b[p] * b[p].ln()).collect();
    let sum: Vec<f64> = (0..b.len()).map(|p| order[p] + solution.image.lambda * b[p] * misfit[p]).collect();
    assert!(dot(&sum, &sum).sqrt() < 1e-6 * dot(&order, &order).sqrt());
    let entropy: f64 = b.iter().zip(area).map(|(b, a)| -a * (b * b.ln() - b + 1.0)).sum();
    assert!((entropy / solution.entropy - 1.0).abs() < 1e-9);
    let rms = b.iter().zip(area).map(|(b, a)| a * (b - 1.0).powi(2)).sum::<f64>().sqrt();
    assert!((rms / solution.spottedness - 1.0).abs() < 1e-9);

    // the visible part of the star: correlation with the truth, and means over what was injected
    let (truth, latitude) = (scene.true_map().unwrap(), &imager.grid.latitude);
    let seen: Vec<usize> = (0..b.len()).filter(|&p| latitude[p] > -0.35).collect();
    let mean = |map: &[f64]| seen.iter().map(|&p| map[p]).sum::<f64>() / seen.len() as f64;
    let (mean_b, mean_t) = (mean(&b), mean(&truth));
    let product =
        |x: &[f64], y: &[f64], (mx, my): (f64, f64)| -> f64 { seen.iter().map(|&p| (x[p] - mx) * (y[p] - my)).sum() };
    let variances = product(&b, &b, (mean_b, mean_b)) * product(&truth, &truth, (mean_t, mean_t));
    let correlation = product(&b, &truth, (mean_b, mean_t)) / variances.sqrt();
    println!("correlation {correlation:.3}");
    assert!(correlation > 0.8);
    let inside = |disc: &[f64]| {
        let [longitude, latitude, radius] = [0, 1, 2].map(|k| disc[k].to_radians());
        let disc = dimcmc::internals::star::Disc { longitude, latitude, radius };
        let grid = &imager.grid;
        let pixels = seen.iter().filter(|&&p| disc.contains(grid.longitude[p], grid.latitude[p]));
        let (count, sum) = pixels.fold((0.0, 0.0), |(count, sum), &p| (count + 1.0, sum + b[p]));
        sum / count
    };
    let faculae = FACULAE.map(|disc| inside(&disc) / mean_b);
    let spots = [[287.0, 69.0, 17.0], [310.0, 30.0, 10.0], [139.0, 50.0, 11.0]].map(|disc| inside(&disc) / mean_b);
    println!("over the mean: faculae {faculae:.3?}, large spots {spots:.3?}");
    // the third lies south of the equator, where a star of 38 degrees shows little
    assert!(faculae.iter().enumerate().all(|(k, b)| *b > if k == 2 { 1.0 } else { 1.08 }));
    assert!(spots.iter().all(|b| *b < 0.6));
}

/// Of faint features both entropies are quadratic: with a default filling factor of one half, `-S` of spots is `2 a (s
/// - 1/2)^2`, and that of brightnesses `a (B/B0 - 1)^2 / 2` with `B0` the brightness at one half. Images and ln L are
///   the same then, and lambda differs by the factor `4 (B0 / (1 - c))^2`. The remainder is of third order: the
///   features, 1e-3.
#[test]
fn faint_features_look_the_same_to_both_models() {
    let Scene { mut imager, settings, space, .. } = scene();
    let n = imager.grid.len();
    imager.star.contrast = 0.8;
    let response = imager.response(&settings.values.state());
    let features: Vec<f64> = scene().true_map().unwrap().iter().map(|b| 1.0 + 1e-3 * (b - 1.0)).collect();
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    imager.data.depth = response.depths(&features);
    for depth in &mut imager.data.depth {
        let noise: f64 = StandardNormal.sample(&mut rng);
        *depth += 1e-6 * noise;
    }
    imager.data.inverse_variance.fill(1e12);
    let models = [Entropy::new(0.5), Entropy::BrightAndDark].map(|entropy| {
        let imager = Imager { entropy, ..imager.clone() };
        let reference = Reference::build(&imager, settings.values, 1.0).unwrap();
        (imager, reference)
    });
    let [spots, bright] = models.each_ref().map(|(imager, reference)| image(imager, reference));
    let deviation: Vec<f64> = spots.iter().map(|s| (1.0 - 0.2 * s) / 0.9 - 1.0).collect();
    let difference: Vec<f64> = (0..n).map(|p| deviation[p] - (bright[p] - 1.0)).collect();
    let relative = (dot(&difference, &difference) / dot(&deviation, &deviation)).sqrt();
    let ratio = models[0].1.solution.image.lambda / models[1].1.solution.image.lambda / (4.0 * (0.9f64 / 0.2).powi(2));
    println!("images differ by {relative:.1e}, lambdas by {:.1e}", ratio - 1.0);
    assert!(relative < 1e-3 && (ratio - 1.0).abs() < 1e-3);
    let drops = |(imager, reference): &(Imager, Reference), kind| {
        let posterior = Posterior::new(imager.clone(), space.clone(), kind, reference.clone());
        let posterior = posterior.with_settings(SolverSettings::exact());
        let start = posterior.space().start();
        let at = |k_kms: f64| posterior.likelihood(&[&[k_kms], &start[1..]].concat()).log_prob;
        // one and two standard errors of K
        [-2e-5, 1e-5].map(|k| at(start[0] + k) - at(start[0]))
    };
    let [spots, bright] = &models;
    for kind in [ObjectiveKind::Entropy, ObjectiveKind::RegularisedLikelihood] {
        let (a, b) = (drops(spots, kind), drops(bright, kind));
        println!("{kind:?}: {a:?} {b:?}");
        assert!((0..2).all(|i| (a[i] / b[i] - 1.0).abs() < 1e-3), "{kind:?}: {a:?} {b:?}");
    }
    // the mean square of B - 1 is twice -S
    let (a, b) = (drops(bright, ObjectiveKind::Spottedness), drops(bright, ObjectiveKind::Entropy));
    assert!((0..2).all(|i| (a[i] / b[i] - 1.0).abs() < 1e-3), "{a:?} {b:?}");
}

/// A small star with faculae.
fn config() -> Value {
    let mut config = two_spots(json!({ "ensembles": 4, "walkers": 8, "steps": 300, "ess": 400, "rhat": 1.03 }));
    config["observations"]["simulate"]["faculae"] = json!([[140.0, 30.0, 25.0, 0.3], [330.0, 50.0, 15.0, 0.2]]);
    config["imaging"] =
        json!({ "pixels": 300, "chi2_target": 1.05, "brightness": "bright-and-dark", "objective": "spottedness" });
    config["grid"] = json!({ "axes": { "k_kms": [0.16, 0.24, 9], "phi": [-0.04, 0.04, 9] } });
    config
}

#[test]
fn every_command_takes_it_and_the_injected_orbit_is_found() {
    let desk = Desk::new(config());
    for command in ["simulate", "map", "optimise", "grid", "sample"] {
        desk.succeed(&[command, "config.json", "--out", command]);
    }
    desk.succeed(&["periodogram", "config.json", "--out", "periodogram", "--draws", "1000"]);
    desk.succeed(&["analyse", "sample"]);
    desk.succeed(&["compare", "sample", "grid", "--out", "compare"]);
    for folder in ["simulate", "map", "optimise", "grid", "sample", "periodogram", "compare"] {
        desk.succeed(&["plot", folder]);
    }
    desk.succeed(&["report", "map", "--out", "report"]);
    desk.succeed(&["export", "sample", "--format", "csv", "--out", "csv"]);

    let numbers =
        |value: &Value| -> Vec<f64> { value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect() };
    let (map, fit, truth) = (desk.json("map/map.json"), desk.json("map/fit.json"), desk.json("simulate/truth.json"));
    assert_eq!(truth["faculae"], config()["observations"]["simulate"]["faculae"]);
    assert!(map.get("spot_filling").is_none());
    let (b, area) = (numbers(&map["brightness"]), numbers(&map["area_fraction"]));
    let mean = |part: fn(f64) -> f64| b.iter().zip(&area).map(|(b, a)| a * part(b - 1.0)).sum::<f64>();
    let close = |key: &str, wanted: f64| assert!((fit[key].as_f64().unwrap() / wanted - 1.0).abs() < 1e-12, "{key}");
    close("spottedness", mean(|x| x * x).sqrt());
    close("darkness", mean(|x| (-x).max(0.0)));
    close("brightness_excess", mean(|x| x.max(0.0)));
    assert!(numbers(&map["true_brightness"]).iter().any(|b| *b > 1.29));
    let svg = desk.read("map/figures/map.svg");
    assert!(svg.contains("injected-facula") && svg.contains("brightness over that of the photosphere"));

    // chain, paraboloid and blind search recover the injected K, with uncertainties like those of a star with only
    // spots
    let k = &desk.json("sample/summary.json")["parameters"]["k_kms"];
    let [low, high] = [0, 1].map(|i| k["ci95"][i].as_f64().unwrap());
    let sd = k["sd"].as_f64().unwrap();
    assert!(low < 0.2 && 0.2 < high, "{k}");
    assert!(sd > 0.003 && sd < 0.03, "{k}");
    let vertex = &desk.json("grid/paraboloid.json")["parameters"]["k_kms"];
    let (vertex, error) = (vertex["vertex"].as_f64().unwrap(), vertex["error"].as_f64().unwrap());
    assert!(
        (vertex - k["median"].as_f64().unwrap()).abs() < 0.5 * sd && (error / sd - 1.0).abs() < 0.25,
        "{vertex} {error}"
    );
    let best = &desk.json("periodogram/periodogram.json")["best"];
    println!("K {k}, paraboloid {vertex} +- {error}, blind {best}");
    // the likelihood grid of the other model differs
    let mut other = config();
    other["imaging"] = json!({ "pixels": 300, "chi2_target": 4.0, "objective": "spottedness" });
    desk.write("other.json", &other.to_string());
    desk.succeed(&["grid", "other.json", "--out", "other"]);
    says(&desk.refusal(&["compare", "sample", "other", "--out", "no"]), &["imaging.brightness"]);
}

/// Maps of an evolving star are of filling factors, those of faculae below 0; they are written and drawn as such.
#[test]
fn maps_of_an_evolving_star_have_filling_factors() {
    let mut config = crate::shared::config();
    config["observations"]["simulate"]["faculae"] = json!(FACULAE);
    let desk = Desk::new(config);
    desk.succeed(&["map", "config.json", "--out", "map"]);
    let maps = desk.json("map/map.json")["maps"].as_array().unwrap().clone();
    assert!(maps.iter().all(|map| map["spot_filling"].is_array() && map.get("brightness").is_none()));
    desk.succeed(&["plot", "map"]);
    desk.succeed(&["report", "map"]);
}
