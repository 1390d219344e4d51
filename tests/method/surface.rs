//! Parameters of the star's surface as free parameters: values other than the config's are recovered, and configs that
//! fix them are unaffected.

use dimcmc::internals::data::config::Config;
use dimcmc::internals::data::scene::Scene;
use dimcmc::internals::inference::search;
use dimcmc::internals::model::Parameter;
use dimcmc::internals::surface::ObjectiveKind;
use dimcmc::internals::surface::static_map::{Posterior, Reference};
use serde_json::{Value, json};
use std::path::Path;

/// The demo, smaller, with `change` made to its config.
fn scene(change: impl Fn(&mut Value)) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/demo.json");
    let mut json: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    // the same pixels, so that few of them are enough
    json["observations"]["simulate"]["pixels"] = 500.into();
    json["imaging"]["pixels"] = 500.into();
    json["parameters"] = json!({});
    change(&mut json);
    Scene::new(&Config::at(json.clone(), &path)).unwrap()
}

/// Line and limb darkening of a star simulated with others than the config's. Its spots are faint: the map of highest
/// entropy has them without their hard edges, and a line that is narrower makes up for it (dark spots: by 4 % of its
/// width).
#[test]
fn a_surface_other_than_the_configs_is_found() {
    let truth = json!({ "limb_darkening": 0.55, "line_sigma_kms": 2.9, "equivalent_width_kms": 5.6 });
    let scene = scene(|json| {
        let simulation = &mut json["observations"]["simulate"];
        simulation["spots"].as_array_mut().unwrap().iter_mut().for_each(|spot| spot[3] = 0.12.into());
        simulation["truth"] = truth.clone();
        json["imaging"]["objective"] = "regularised-likelihood".into();
        let uniform = |min: f64, max: f64| json!({ "prior": "uniform", "min": min, "max": max });
        json["parameters"] = json!({
            "limb_darkening": uniform(0.0, 1.0), "line_sigma_kms": uniform(0.5, 6.0),
            "equivalent_width_kms": uniform(3.0, 9.0),
        });
    });
    let found = search::find(&scene.imager, &scene.space, scene.search_settings(), &|_| ()).unwrap();
    let optimum = &found.optimum;
    let names = scene.space.names();
    assert_eq!(names, ["limb_darkening", "line_sigma_kms", "equivalent_width_kms"]);
    for (i, name) in names.iter().enumerate() {
        let (best, sd) = (optimum.theta[i], optimum.written_covariance[(i, i)].sqrt());
        let (injected, start) = (truth[name].as_f64().unwrap(), scene.space.start()[i]);
        println!("{name}: {best:.4} +- {sd:.4}, injected {injected}, started at {start}");
        assert!((best - injected).abs() < 3.0 * sd, "{name}: {best} +- {sd} for {injected}");
        assert!(sd < 0.1 * (injected - start).abs(), "{name}: {sd}");
    }
    let written = serde_json::to_value(Posterior::behind(&*found.posterior).unwrap().reference().values).unwrap();
    assert_eq!(written.as_object().unwrap().len(), 11, "the eight and the free ones: {written}");
}

/// Constraints on the contrast: spots so bright that they would have to fill more than all of a pixel are out; but the
/// darker they are, the fewer there need be, and the higher the entropy is.
#[test]
fn the_contrast_has_an_upper_bound_alone() {
    let scene = scene(|json| {
        json["observations"]["simulate"]["spots"] = json!([[40, 50, 20, 1], [200, 15, 14, 1], [290, 35, 10, 1]]);
        json["observations"]["simulate"]["truth"] = json!({ "contrast": 0.2 });
        json["parameters"] = json!({ "contrast": { "prior": "uniform", "min": 0.0, "max": 0.9 } });
    });
    let mut values = scene.settings.values;
    values.set(Parameter::Contrast, 0.2);
    let reference = Reference::provisional(&scene.imager, values, 0.97).unwrap();
    let kind = ObjectiveKind::RegularisedLikelihood;
    let posterior = Posterior::new(scene.imager.clone(), scene.space.clone(), kind, reference);
    let [dark, injected, bright] = [0.05, 0.2, 0.7].map(|c| posterior.likelihood(&[c]).log_prob);
    println!("ln L {:.2} at 0.05, {:.2} at 0.7", dark - injected, bright - injected);
    assert!(dark > injected && bright < injected - 20.0, "{dark} {injected} {bright}");
}

#[test]
fn what_is_not_free_is_not_written() {
    let settings = scene(|_| ()).settings;
    let written = serde_json::to_value(settings.values).unwrap();
    assert_eq!(written.as_object().unwrap().len(), 8, "{written}");
    assert_eq!(settings.values, settings.values.clone(), "what is not given is the same as itself");
    let one = scene(|json| json["parameters"] = json!({ "contrast": { "prior": "uniform", "min": 0.0, "max": 0.5 } }));
    let written = serde_json::to_value(one.settings.values).unwrap();
    assert_eq!(written.as_object().unwrap().len(), 9, "{written}");
    // the start is the contrast of the two temperatures
    assert!((one.settings.values[Parameter::Contrast] - 0.0654).abs() < 1e-3);
    assert_eq!(one.settings.values[Parameter::Contrast], one.imager.star.contrast);
}

/// Hence a nuisance of every profile's equivalent width and a common free one are distinguished only by priors.
#[test]
fn equivalent_widths_scale_the_depth() {
    let at = |width: f64| {
        let scene = scene(|json| {
            json["observations"]["simulate"]["snr"] = Value::Null;
            json["observations"]["simulate"]["truth"] = json!({ "equivalent_width_kms": width });
        });
        scene.observations
    };
    let (narrow, wide) = (at(5.0), at(6.0));
    let both = narrow.profiles.iter().zip(&wide.profiles).flat_map(|(a, b)| a.intensity.iter().zip(&b.intensity));
    for (a, b) in both {
        assert!(((1.0 - b) - 1.2 * (1.0 - a)).abs() < 1e-12);
    }
}
