//! R1 and R2: the radial velocities of a spotted star, and their residuals after subtraction of the image.

use crate::cases::{Failure, Laboratory, paper, with};
use crate::report::{Panel, Report, Series};
use dimcmc::internals::surface::VelocityWithoutSpots;
use dimcmc::internals::surface::static_map::Reference;
use dimcmc::{Config, Scene, SurfaceMaps};
use serde_json::{Value, json};

/// Signal-to-noise ratio of the profiles.
const SNR: &str = "/observations/simulate/snr";

/// The paper's star on as many pixels as the paper had, with some keys changed.
fn scene(laboratory: &Laboratory, changes: &[(&str, Value)]) -> Result<Scene, Failure> {
    let pixels = [("/imaging/pixels", json!(laboratory.full_or_quick(20_000, 2000)))];
    let config = with(with(paper(), &pixels), changes);
    let path = laboratory.folder.join("config.json");
    Ok(Scene::new(&Config::at(config, &path))?)
}

fn first_moments(scene: &Scene) -> Vec<f64> {
    scene.observations.first_moments().iter().map(|rv| rv.value_kms).collect()
}

fn cycles(scene: &Scene) -> Vec<f64> {
    scene.observations.times_d().into_iter().map(|time| scene.imager.star.cycle(time)).collect()
}

/// Root mean square about the mean.
fn scatter(x: &[f64]) -> f64 {
    let n = x.len() as f64;
    let mean = x.iter().sum::<f64>() / n;
    (x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt()
}

fn peak_to_peak(x: &[f64]) -> f64 {
    let highest = x.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    highest - x.iter().copied().fold(f64::INFINITY, f64::min)
}

fn panel(label: &str, series: &[(&str, &str)], joined: bool) -> Panel {
    let series = series.iter().map(|(name, y)| Series { name: (*name).into(), y: (*y).into(), interval: None });
    Panel { x: "cycle".into(), label: label.into(), series: series.collect(), truth: None, joined, only: None }
}

/// R1: the first moments with and without noise, and of a star without spots.
pub fn profiles(laboratory: &Laboratory) -> Result<Report, Failure> {
    let none = ("/planet/k_kms", json!(0.0));
    let noisy = scene(laboratory, std::slice::from_ref(&none))?;
    let clean = scene(laboratory, &[none.clone(), (SNR, Value::Null)])?;
    let unspotted = scene(laboratory, &[none, ("/observations/simulate/spots", json!([]))])?;
    let [noisy_rv, clean_rv, photon] = [&noisy, &clean, &unspotted].map(first_moments);
    let noise: Vec<f64> = noisy_rv.iter().zip(&clean_rv).map(|(a, b)| a - b).collect();
    let mut report = Report::new(["cycle", "rv_kms", "rv_without_noise_kms", "rv_without_spots_kms"]);
    for (k, cycle) in cycles(&noisy).into_iter().enumerate() {
        report.row(vec![cycle, noisy_rv[k], clean_rv[k], photon[k]]);
    }
    report.number("rv_rms_kms", scatter(&noisy_rv));
    report.number("rv_peak_to_peak_kms", peak_to_peak(&noisy_rv));
    report.number("noise_rms_kms", scatter(&noise));
    report.number("rv_rms_without_spots_kms", scatter(&photon));
    report.number(
        "spottedness_true",
        noisy.true_spot_filling().map(|s| s.iter().zip(&noisy.imager.grid.area).map(|(s, a)| s * a).sum::<f64>()),
    );
    report.figure = vec![panel(
        "first moment (km/s)",
        &[
            ("spots and noise", "rv_kms"),
            ("spots alone", "rv_without_noise_kms"),
            ("noise alone", "rv_without_spots_kms"),
        ],
        true,
    )];
    Ok(report)
}

/// R2: observed minus modelled first moments, without a planet; with one included in the image, and one that is not.
pub fn filtered(laboratory: &Laboratory) -> Result<Report, Failure> {
    let injected = |k: f64| ("/observations/simulate/truth/k_kms", json!(k));
    let assumed = |k: f64| ("/planet/k_kms", json!(k));
    let cases = [
        ("without_planet", [injected(0.0), assumed(0.0)]),
        ("planet_modelled", [injected(0.1), assumed(0.1)]),
        ("planet_ignored", [injected(0.1), assumed(0.0)]),
    ];
    let mut columns: Vec<(String, Vec<f64>)> = Vec::new();
    let mut report = Report::default();
    for (name, changes) in cases {
        laboratory.go_on()?;
        (laboratory.report)(&format!("R2, {name}"));
        let scene = scene(laboratory, &changes)?;
        let settings = &scene.settings;
        let target = scene.chi2_target;
        // without its planet a star may not be fitted that well: then as well as possible without fitting noise by
        // spots
        let reference = Reference::build(&scene.imager, settings.values, target)
            .or_else(|_| Reference::provisional(&scene.imager, settings.values, target))?;
        let fit = SurfaceMaps::of_reference(&scene.imager, &scene.observations, &reference);
        if columns.is_empty() {
            columns.push(("cycle".to_owned(), cycles(&scene)));
        }
        let of = |f: &dyn Fn(&VelocityWithoutSpots) -> f64| fit.velocities.iter().map(f).collect::<Vec<f64>>();
        columns.push((format!("{name}_observed_kms"), of(&|v| v.moments.observed.value_kms)));
        columns.push((format!("{name}_filtered_kms"), of(&|v| v.moments.filtered_kms())));
        report.number(&format!("{name}_filtered_rms_kms"), fit.summary.filtered_rv_rms_kms.unwrap_or(f64::NAN));
        report.number(&format!("{name}_observed_rms_kms"), fit.summary.observed_rv_rms_kms);
        report.number(
            &format!("{name}_spottedness"),
            fit.summary.image.as_ref().map_or(f64::NAN, |image| image.spottedness),
        );
        report.number(&format!("{name}_chi2_per_datum"), fit.summary.chi2_per_datum);
    }
    report.columns = columns.iter().map(|(name, _)| name.clone()).collect();
    for k in 0..columns[0].1.len() {
        report.row(columns.iter().map(|(_, values)| values[k]).collect());
    }
    report.figure = vec![
        panel("first moment (km/s)", &[("observed", "without_planet_observed_kms")], true),
        panel(
            "observed - modelled (km/s)",
            &[("no planet", "without_planet_filtered_kms"), ("planet ignored", "planet_ignored_filtered_kms")],
            true,
        ),
    ];
    Ok(report)
}
