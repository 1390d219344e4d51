//! `grid` as users run it: values that are those of the posterior, the same bytes whatever happens on the way, and
//! refusals that write nothing.

use crate::desk::{Desk, kill, says, two_spots};
use dimcmc::internals::data::scene::Scene;
use dimcmc::internals::inference::search::find;
use dimcmc::internals::model::Parameter;
use dimcmc::internals::sampling::log_density::{LogDensity, Status};
use dimcmc::internals::surface::static_map::{Posterior, Reference};
use serde_json::{Value, json};

const CONFIG: &str = "config.json";

const HEADER: &str = "landscape.json";

const NODES: &str = "landscape.jsonl";

const PARABOLOID: &str = "paraboloid.json";

/// The injected orbit (0.2, 1.7, 0.5) is nearest to value 2 of K, 1 of the period and 0 of the phase. The last K is
/// outside its prior.
const AXES: &str = r#"{ "k_kms": [0.11, 0.26, 4], "porb_over_prot": [1.62, 1.92, 4], "phi": [0.49, 0.55, 3] }"#;

const COUNT: usize = 48;

fn config() -> Value {
    let mut config = two_spots(Value::Null);
    config.as_object_mut().unwrap().remove("sampler");
    config["planet"]["phi"] = json!(0.5);
    config["imaging"]["pixels"] = json!(300);
    config["parameters"]["k_kms"]["max"] = json!(0.25);
    config["parameters"]["porb_over_prot"] = json!({ "prior": "log-uniform", "min": 1.0, "max": 3.0 });
    config["grid"] = json!({ "axes": serde_json::from_str::<Value>(AXES).unwrap() });
    config
}

/// A config of one free parameter, for what needs no shape.
fn line() -> Value {
    let mut config = config();
    config["parameters"] = json!({ "k_kms": { "prior": "uniform", "min": 0.0, "max": 1.0 } });
    config["observations"]["simulate"]["snr"] = json!(500);
    config["imaging"]["pixels"] = json!(200);
    config["grid"] = json!({ "axes": { "k_kms": [0.0, 0.4, 41] } });
    config
}

/// A desk with a finished likelihood grid in `whole`.
fn finished(config: Value) -> Desk {
    let desk = Desk::new(config);
    desk.succeed(&["grid", CONFIG, "--out", "whole"]);
    desk
}

fn nodes(desk: &Desk, folder: &str) -> Vec<Value> {
    desk.read(&format!("{folder}/{NODES}")).lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn numbers(nodes: &[Value], key: &str) -> Vec<f64> {
    nodes.iter().map(|node| node[key].as_f64().unwrap()).collect()
}

fn same_landscape(desk: &Desk, a: &str, b: &str) {
    for file in [HEADER, NODES, PARABOLOID] {
        let [a, b] = [a, b].map(|folder| desk.read(&format!("{folder}/{file}")));
        assert!(a == b, "{file} differs");
    }
}

fn copy(desk: &Desk, from: &str, to: &str) {
    std::fs::create_dir(desk.path(to)).unwrap();
    for file in [HEADER, NODES] {
        std::fs::copy(desk.path(from).join(file), desk.path(to).join(file)).unwrap();
    }
}

/// The posterior that `sample` would draw from.
fn sampled(scene: &Scene) -> Posterior {
    let found = find(&scene.imager, &scene.space, scene.search_settings(), &|_| ()).unwrap();
    Posterior::behind(&*found.posterior).unwrap().clone()
}

#[test]
fn the_landscape_is_that_of_the_chain() {
    let desk = Desk::new(config());
    let table = desk.succeed(&["grid", CONFIG, "--out", "whole"]);
    let nodes = nodes(&desk, "whole");
    assert_eq!(nodes.len(), COUNT);

    // the highest node is the one nearest to the injected orbit
    let log_likelihood = numbers(&nodes, "log_likelihood");
    let best = (0..COUNT).max_by(|a, b| log_likelihood[*a].total_cmp(&log_likelihood[*b])).unwrap();
    assert_eq!(best, 2 * 12 + 3, "{log_likelihood:.1?}");
    for (name, value) in [("k_kms", 0.21), ("porb_over_prot", 1.72), ("phi", 0.49)] {
        assert!((nodes[best][name].as_f64().unwrap() - value).abs() < 1e-12, "{name}");
    }
    says(&table, &["truth", "k_kms", "0.2100", "at node 27", "48 reconstructions", "0 failed", "48 nodes in"]);
    says(&table, &["may lie outside: widen grid.axes.phi\n", "landscape.json, landscape.jsonl, paraboloid.json"]);

    // every value is that of the posterior without its prior, parameters identified by name
    let scene = Scene::load(&desk.path(CONFIG)).unwrap();
    let place = |node: &Value| scene.space.names().iter().map(|name| node[name].as_f64().unwrap()).collect();
    let thetas: Vec<Vec<f64>> = nodes.iter().map(place).collect();
    let posterior = sampled(&scene).with_warm_starts_for(&thetas, COUNT);
    assert!(posterior.warm_starts().count() > 0, "nodes far from the best one are worth an image there");
    for (index, node) in nodes.iter().enumerate() {
        assert_eq!(node["index"], index);
        let theta = &thetas[index];
        let evaluation = posterior.evaluate(theta);
        if node["k_kms"].as_f64().unwrap() > 0.25 {
            assert_eq!(evaluation.status, Status::OutsidePrior);
            continue;
        }
        // ln L and prior are added and separated again
        let expected = evaluation.log_prob - scene.space.log_prior(theta);
        assert!((log_likelihood[index] - expected).abs() <= 1e-12 * expected.abs().max(1.0), "{node}");
        assert_eq!(json!([node["spottedness"], node["chi2"]]), json!(evaluation.numbers));
        let ended = json!([evaluation.status, evaluation.model_applications]);
        assert_eq!(json!([node["status"], node["model_applications"]]), ended);
    }

    // and of images made from nothing, at values put together by hand
    let converged: Vec<&Value> = nodes.iter().filter(|node| node["status"] == "converged").collect();
    assert!(converged.len() > COUNT / 3, "{}", converged.len());
    for node in converged.iter().step_by(4) {
        let mut values = scene.settings.values;
        values.set(Parameter::K, node["k_kms"].as_f64().unwrap());
        values.set(Parameter::PorbOverProt, node["porb_over_prot"].as_f64().unwrap());
        values.set(Parameter::Phi, node["phi"].as_f64().unwrap());
        let image = Reference::build(&scene.imager, values, 1.05).unwrap().solution;
        let expected = [
            ("spottedness", image.spottedness),
            ("entropy", image.entropy),
            ("chi2", image.chi2),
            ("lambda", image.image.lambda),
        ];
        for (key, expected) in expected {
            // a node is accurate to 1e-3 in ln L, its image to a few times that in lambda
            let found = node[key].as_f64().unwrap();
            assert!((found / expected - 1.0).abs() < 5e-3, "{node}, {key}: {found} {expected}");
        }
    }
}

#[test]
fn the_number_of_threads_does_not_show() {
    let desk = Desk::new(line());
    let [one, two] = [("1", "a"), ("2", "b")].map(|(threads, out)| {
        let table = desk.succeed(&["grid", CONFIG, "--out", out, "--threads", threads]);
        table.split("41 nodes in").next().unwrap().to_string()
    });
    assert_eq!(one, two);
    same_landscape(&desk, "a", "b");
}

#[test]
fn the_paraboloid_of_an_earlier_landscape_does_not_outlive_it() {
    const MANY: usize = 10_000;
    let mut config = line();
    config["grid"]["axes"]["k_kms"][2] = json!(MANY);
    let desk = Desk::new(config);
    std::fs::create_dir(desk.path("again")).unwrap();
    desk.write(&format!("again/{PARABOLOID}"), "{}");
    let mut child = desk.start(&["grid", CONFIG, "--out", "again", "--threads", "1", "--force"]);
    desk.wait_for_lines(&format!("again/{NODES}"), &mut child, 1);
    kill(child);
    assert!(desk.lines(&format!("again/{NODES}")) < MANY, "killed too late");
    assert!(!desk.path("again").join(PARABOLOID).exists());
}

#[test]
fn another_config_grid_or_data_are_not_resumed() {
    let desk = finished(line());
    let resume = ["grid", CONFIG, "--out", "whole", "--resume"];
    for (pointer, value, key) in [
        ("/imaging/chi2_target", json!(1.06), "imaging.chi2_target (1.05 then, 1.06 now)"),
        ("/parameters/k_kms/max", json!(0.9), "parameters.k_kms.max (1.0 then, 0.9 now)"),
        ("/observations/simulate/seed", json!(8), "observations.simulate.seed (7 then, 8 now)"),
        ("/grid/axes/k_kms", json!([0.0, 0.4, 42]), "grid.axes.k_kms"),
        ("/grid/axes", json!({ "k_kms": [0.0, 0.4, 41], "vsys_kms": [-0.1, 0.1, 3] }), "grid.axes.vsys_kms"),
    ] {
        desk.set(pointer, value);
        says(&desk.refusal(&resume), &["whole: ", key, "of the config changed since this run began"]);
    }
    // the chain's length has nothing to do with it
    desk.set("/sampler", json!({ "steps": 7 }));
    desk.succeed(&resume);
}

#[test]
fn what_is_no_landscape_is_not_resumed_and_nothing_is_overwritten() {
    let desk = finished(line());
    std::fs::create_dir(desk.path("empty")).unwrap();
    for folder in ["empty", "absent"] {
        says(&desk.refusal(&["grid", CONFIG, "--out", folder, "--resume"]), &[folder, "no landscape.json"]);
    }
    desk.refusal(&["grid", CONFIG, "--out", "whole"]);
    desk.refusal(&["sample", CONFIG, "--out", "whole", "--resume"]);

    let broken = |change: &dyn Fn(&str) -> String, problem: &str| {
        let nodes = desk.read(&format!("whole/{NODES}"));
        let line = change(nodes.lines().nth(4).unwrap());
        let folder = problem.split(' ').next().unwrap().trim_matches('`').to_string();
        copy(&desk, "whole", &folder);
        desk.edit(&format!("{folder}/{NODES}"), |nodes| crate::desk::with_line(&nodes, 5, &line));
        let message = desk.refusal(&["grid", CONFIG, "--out", &folder, "--resume"]);
        says(&message, &[&format!("{folder}/{NODES}, line 5: "), problem]);
    };
    broken(&|line| line[..30].to_string(), "EOF");
    broken(&|line| line.replace("\"index\":4", "\"index\":5"), "expected node 4 but found node 5");
    broken(&|line| line.replace("\"k_kms\":0.0", "\"k_kms\":0.1"), "node 4 is at [0.04");
    broken(&|line| line.replace("\"k_kms\"", "\"phi\""), "missing key `k_kms`");
    broken(&|line| line.replace("\"chi2\"", "\"chi\""), "unknown key `chi`");
    broken(&|line| line.replace("\"converged\"", "\"non-finite\""), "status");

    // how long it took is not the same again
    let results =
        || desk.inventory().into_iter().filter(|(path, _)| !path.ends_with("whole/effort.json")).collect::<Vec<_>>();
    let before = results();
    desk.succeed(&["grid", CONFIG, "--out", "whole", "--force"]);
    assert!(results() == before);
}

/// A parameter on an axis is free whether it has a prior or not; one with a prior and no axis is fixed.
#[test]
fn the_axes_are_free_and_nothing_else() {
    let mut config = config();
    config["grid"] = json!({ "axes": { "vsys_kms": [-0.05, 0.05, 3], "k_kms": [0.1, 0.3, 3] } });
    let desk = finished(config);
    let nodes = nodes(&desk, "whole");
    assert_eq!(nodes.len(), 9);
    // the order of the axes is that of the parameters, not of the config; the last runs fastest
    for (key, expected) in [("vsys_kms", [-0.05, 0.0, 0.05]), ("k_kms", [0.1, 0.1, 0.1])] {
        for (found, expected) in numbers(&nodes, key).into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{key}: {found} {expected}");
        }
    }
    assert!(nodes[0]["phi"].is_null() && nodes[0]["porb_over_prot"].is_null());
    let header = desk.json(&format!("whole/{HEADER}"));
    let reference = &header["reference"]["parameters"];
    assert_eq!((&reference["phi"], &reference["porb_over_prot"]), (&json!(0.5), &json!(1.7)));
    assert_ne!((&reference["k_kms"], &reference["vsys_kms"]), (&json!(0.2), &json!(0.0)), "searched for");
    assert_eq!(header["grid"]["axes"][1]["name"], "vsys_kms");
}

#[test]
fn a_phase_axis_may_wrap_or_go_once_around() {
    let config = config();
    let desk = Desk::new(config);
    for (axis, expected) in
        [(json!([0.8, 1.2, 3]), vec![0.8, 0.0, 0.2]), (json!([0, 1, 4]), vec![0.0, 0.25, 0.5, 0.75])]
    {
        desk.set("/grid/axes", json!({ "phi": axis }));
        let table = desk.succeed(&["grid", CONFIG, "--out", "out", "--force"]);
        let phi = numbers(&nodes(&desk, "out"), "phi");
        assert_eq!(phi.len(), expected.len());
        assert!(phi.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-12), "{phi:?}");
        assert_eq!(table.contains("on the edge of the grid"), expected.len() == 3, "a circle has no edge");
    }
}

/// The paraboloid of the likelihood grid: its error bar is that of the curvature at the best parameters, for which the
/// search has derivatives; and the user may choose the nodes.
#[test]
fn the_paraboloid_is_the_curvature() {
    let mut config = config();
    config["grid"] = json!({ "axes": { "k_kms": [0.15, 0.25, 11], "phi": [0.46, 0.54, 11] } });
    let desk = Desk::new(config);
    let table = desk.succeed(&["grid", CONFIG, "--out", "whole"]);
    says(&table, &["paraboloid through the ", " above the lowest chi2, residuals ", "vertex", "error"]);
    let (header, found) = (desk.json(&format!("whole/{HEADER}")), desk.json(&format!("whole/{PARABOLOID}")));
    assert_eq!((&found["names"], &found["refused"]), (&json!(["k_kms", "phi"]), &Value::Null));
    for (i, name) in ["k_kms", "phi"].into_iter().enumerate() {
        let number = |value: &Value| value.as_f64().unwrap();
        let (vertex, error) =
            (number(&found["parameters"][name]["vertex"]), number(&found["parameters"][name]["error"]));
        let optimum = &header["optimum"];
        let (best, sd) = (number(&optimum["parameters"][name]), number(&optimum["sd"][name]));
        // ln L is a parabola to a tenth or so within two error bars
        assert!(
            (vertex - best).abs() < 0.15 * sd && (error / sd - 1.0).abs() < 0.15,
            "{name}: {vertex} {best} {error} {sd}"
        );
        assert!((number(&found["covariance"][i][i]).sqrt() / error - 1.0).abs() < 1e-12);
        assert_eq!(found["truth"][name], if name == "phi" { json!(0.5) } else { json!(0.2) });
    }
    let before = desk.read(&format!("whole/{NODES}"));
    let table = desk.succeed(&["grid", CONFIG, "--out", "whole", "--resume", "--fit-nodes", "30", "--fit-radius", "4"]);
    says(&table, &["paraboloid through the 30 nodes"]);
    assert_eq!(desk.json(&format!("whole/{PARABOLOID}"))["rule"], json!({ "nodes": 30, "radius": 4 }));
    assert!(desk.read(&format!("whole/{NODES}")) == before);
    // no minimum is a result too
    desk.set("/grid/axes", json!({ "k_kms": [0.0, 0.1, 4] }));
    let table = desk.succeed(&["grid", CONFIG, "--out", "edge"]);
    let reason = "no well-defined minimum: the highest node lies on the edge of k_kms";
    says(&table, &[reason]);
    let refused = desk.json(&format!("edge/{PARABOLOID}"));
    assert_eq!((&refused["refused"], &refused["parameters"]), (&json!(reason), &Value::Null));
}

#[test]
fn a_config_without_a_grid_is_refused() {
    let desk = Desk::new(line());
    desk.set("/grid", Value::Null);
    says(&desk.refusal(&["grid", CONFIG, "--out", "out"]), &["config.json: grid: missing"]);
}
