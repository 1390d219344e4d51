//! The independent reference numbers under `tests/data/oracle` (see the README there), in this crate's types.
#![allow(dead_code)]

use dimcmc::internals::maxent::entropy::Entropy;
use dimcmc::internals::maxent::{Curvature, Problem};
use dimcmc::internals::model::{Parameter, ParameterValues};
use dimcmc::internals::numerics::units::{instrumental_sigma_kms, planck_contrast};
use dimcmc::internals::star::{LimbDarkening, LocalLine, Sampling, StarSettings, SurfaceGrid};
use dimcmc::internals::surface::imaging::{Data, Imager, ImagingProblem};
use serde_json::Value;
use std::f64::consts::TAU;
use std::path::PathBuf;

pub fn oracle_file(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data/oracle").join(name)
}

pub fn json(name: &str) -> Value {
    serde_json::from_str(&std::fs::read_to_string(oracle_file(name)).unwrap()).unwrap()
}

pub fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

/// Star, pixel table, sampling and data of `oracle.json`.
pub struct Oracle {
    pub json: Value,
    pub star: StarSettings,
    pub grid: SurfaceGrid,
    pub sampling: Sampling,
    pub data: Data,
    pub default_spot: f64,
}

pub fn oracle() -> Oracle {
    let json = json("oracle.json");
    let spec = &json["spec"];
    let number = |key: &str| spec[key].as_f64().unwrap();
    let sigma_kms = number("sigma_local").hypot(instrumental_sigma_kms(number("R")));
    let star = StarSettings {
        rotation_period_d: number("prot"),
        epoch_d: 0.0,
        limb_darkening: LimbDarkening::Linear(number("u")),
        contrast: planck_contrast(number("tspot"), number("tphot"), 1000.0 * number("wavelength_um")),
        line: LocalLine {
            instrumental_sigma_kms: instrumental_sigma_kms(number("R")),
            ..LocalLine::gaussian(sigma_kms, number("ew"))
        },
        regions: Default::default(),
    };
    let pixels = &json["pixels"];
    let table = |key: &str| numbers(&pixels[key]);
    let grid = SurfaceGrid::from_table(table("lon_rad"), table("lat_rad"), table("area_fraction"));
    let velocity = numbers(&json["velocity_kms"]);
    let cycles = numbers(&spec["cycles"]);
    let sampling = Sampling {
        step_kms: number("dv"),
        profiles: cycles.iter().map(|e| (e * number("prot"), velocity[0], velocity.len())).collect(),
    };
    let depth: Vec<f64> = json["depth"].as_array().unwrap().iter().flat_map(numbers).collect();
    let sigma = json["sigma"].as_f64().unwrap();
    let inverse_variance = vec![1.0 / (sigma * sigma); depth.len()];
    let data = Data { inverse_variance, depth, correlated_bins: 1.0, nuisances: Default::default() };
    let default_spot = number("default_spot");
    Oracle { json, star, grid, sampling, data, default_spot }
}

/// The oracle's data on these pixels.
pub fn imager(oracle: &Oracle, grid: SurfaceGrid) -> Imager {
    Imager {
        areas: grid.area.clone(),
        grid,
        star: oracle.star.clone(),
        sets: vec![oracle.sampling.clone().into()],
        zero_points: Vec::new(),
        light_curves: Vec::new(),
        indicators: Vec::new(),
        mean_profile: 0.0,
        drifts: Vec::new(),
        jitter_shares: Vec::new(),
        night_jitters_kms: Vec::new(),
        data: oracle.data.clone(),
        entropy: Entropy::new(oracle.default_spot),
    }
}

/// The injected values.
pub fn truth(oracle: &Oracle) -> ParameterValues {
    values(&oracle.json["results"]["fixed_lambda"][0]["theta"], oracle.star.rotation_period_d)
}

/// The injected values, those of the surface too.
pub fn whole_truth(oracle: &Oracle) -> ParameterValues {
    let mut values = truth(oracle);
    let LimbDarkening::Linear(u) = oracle.star.limb_darkening else { panic!() };
    values.set(Parameter::LimbDarkening, u);
    values.set(Parameter::LineSigma, oracle.json["spec"]["sigma_local"].as_f64().unwrap());
    values.set(Parameter::EquivalentWidth, oracle.star.line.strength_kms());
    values.set(Parameter::Contrast, oracle.star.contrast);
    values
}

/// Parameter values of one of the oracle's `theta` objects.
pub fn values(theta: &Value, rotation_period_d: f64) -> ParameterValues {
    let number = |key: &str| theta[key].as_f64().unwrap();
    let omega_eq = TAU / rotation_period_d * number("oeq");
    let mut values = ParameterValues::of_eight([0.0; 8]);
    values.set(Parameter::K, number("K"));
    values.set(Parameter::PorbOverProt, number("P"));
    values.set(Parameter::Phi, number("phi"));
    values.set(Parameter::OmegaEq, omega_eq);
    values.set(Parameter::DOmega, number("gamma") * omega_eq);
    values.set(Parameter::Inclination, number("inc"));
    values.set(Parameter::Vsini, number("vsini"));
    values.set(Parameter::Vsys, number("vsys"));
    values
}

/// Numbers without a pattern.
pub fn wave(n: usize, a: f64) -> Vec<f64> {
    (0..n).map(|i| (a * (i * i) as f64).sin()).collect()
}

pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Gradient and curvature of the misfit of maps of `n` pixels against differences.
pub fn hold_derivatives(problem: &mut ImagingProblem, n: usize) {
    let s: Vec<f64> = wave(n, 0.37).iter().map(|x| 0.3 + 0.2 * x).collect();
    let (v, w) = (wave(n, 0.9), wave(n, 1.7));
    let (mut gradient, mut curved) = (vec![0.0; n], vec![0.0; n]);
    let h = 1e-5;
    let mut at = |h: f64| {
        let shifted: Vec<f64> = s.iter().zip(&v).map(|(s, v)| s + h * v).collect();
        let chi2 = problem.linearise(&shifted);
        problem.gradient(&mut gradient);
        (chi2, dot(&gradient, &w))
    };
    let ((chi2_plus, slope_plus), (chi2_minus, slope_minus)) = (at(h), at(-h));
    problem.linearise(&s);
    problem.gradient(&mut gradient);
    problem.curvature(Curvature::Exact, &v, &mut curved);
    let slope = (chi2_plus - chi2_minus) / (4.0 * h);
    // differences of chi2, which is some 1e6 and rounded at 1e-16 of itself
    assert!((dot(&gradient, &v) / slope - 1.0).abs() < 1e-6);
    assert!((problem.slope(&v) / slope - 1.0).abs() < 1e-6);
    let second = (slope_plus - slope_minus) / (2.0 * h);
    assert!((dot(&curved, &w) / second - 1.0).abs() < 1e-6, "{} {second}", dot(&curved, &w));
}
