//! The information of planned profiles against dense algebra with numerical derivatives, and of those of several data
//! sets and light curves against a search.

use dimcmc::internals::field::{Field, Kernel, Lifetime, Spectrum};
use dimcmc::internals::model::Parameter;
use dimcmc::internals::planets::periodogram::Trial;
use dimcmc::internals::planets::periodogram::orbits::scan;
use dimcmc::internals::planets::velocities::VelocityQuadratic;
use dimcmc::internals::surface::MEAN_FILLING;
use dimcmc::internals::surface::evolving_map::{Assumed, Basis, Planned, fit};
use dimcmc::internals::surface::expansion::nuisances;
use dimcmc::{Config, Scene};
use nalgebra::{DMatrix, DVector};
use serde_json::{Value, json};
use std::sync::Arc;

const SIGMA: f64 = 1.0 / 300.0;

fn scene() -> Scene {
    let config = Config::default()
        .with("star.rotation_period_d", 3.0)
        .with("star.inclination_deg", 50.0)
        .with("star.vsini_kms", 20.0)
        .with("star.line", json!({ "sigma_kms": 4.0, "equivalent_width_kms": 6.0 }))
        .with("star.contrast", 0.2)
        .with("observations.simulate.cycles", json!([0.0, 0.31, 0.9, 1.4]))
        .with("observations.simulate.velocity_kms", json!({ "min": -30.0, "max": 30.0, "step": 4.0 }))
        .with("observations.simulate.snr", 1.0 / SIGMA)
        .with("observations.simulate.pixels", 500)
        .with("imaging", json!({ "objective": "spottedness", "pixels": 150 }));
    Scene::new(&config).unwrap()
}

#[test]
fn planned_information_is_that_of_dense_algebra() {
    let scene = scene();
    let (imager, mut values) = (&scene.imager, scene.settings.values);
    values.set(Parameter::K, 0.0);
    let field = Field {
        spectrum: Spectrum { amplitude: 0.15, slope: 0.9, break_degree: 0.0 },
        kernel: Kernel::of(Lifetime::Days(5.0)),
    };
    for jitter_kms in [0.0, 0.05] {
        let planned = Planned::new(imager, values, Assumed { field, jitter_kms, night_kms: 0.0 }, &[], None);
        for maps in [planned.mean_maps(), planned.drawn_maps(4).unwrap()] {
            let part = vec![0, 1, 3];
            let found = planned.velocities(&maps, std::slice::from_ref(&part)).unwrap().remove(0);
            let expected = dense(&scene, &field, jitter_kms, &maps, &part);
            assert_eq!(found.cycles, part.iter().map(|k| imager.cycles()[*k]).collect::<Vec<_>>());
            let off = (&found.information - &expected).amax() / expected.amax();
            // what is left out of few numbers, and rounding of differences
            assert!(off < 5e-3, "{off}: {} {expected}", found.information);
            assert_eq!(found.gradient.amax(), 0.0);
        }
    }
}

/// `D'^T C^-1 D'` with all derivatives by differences of the model's depths.
fn dense(scene: &Scene, field: &Field, jitter_kms: f64, maps: &DMatrix<f64>, part: &[usize]) -> DMatrix<f64> {
    let imager = &scene.imager;
    let basis = Basis::new(&imager.grid);
    let mut values = scene.settings.values;
    values.set(Parameter::K, 0.0);
    let contrast = imager.star.contrast;
    let depths = |vsys: f64, maps: &DMatrix<f64>| {
        let mut values = values;
        values.set(Parameter::Vsys, values[Parameter::Vsys] + vsys);
        let filling = (&basis.on_pixels * maps).add_scalar(MEAN_FILLING);
        let brightness = filling.map(|filling| 1.0 - (1.0 - contrast) * filling);
        DVector::from_vec(imager.response(&values.state()).depths_of_each(&brightness))
    };
    let h = 1e-3;
    let slopes = (depths(h, maps) - depths(-h, maps)) / (2.0 * h);
    let bins = slopes.len() / imager.profiles().count();
    let mut jacobian = DMatrix::zeros(slopes.len(), basis.len());
    for harmonic in 0..basis.len() {
        let moved = |h: f64| {
            let mut maps = maps.clone();
            maps.row_mut(harmonic).add_scalar_mut(h);
            depths(0.0, &maps)
        };
        jacobian.set_column(harmonic, &((moved(h) - moved(-h)) / (2.0 * h)));
    }
    let variances = field.spectrum.variances(&basis.degrees);
    let scaled = DMatrix::from_fn(jacobian.nrows(), jacobian.ncols(), |j, c| jacobian[(j, c)] * variances[c].sqrt());
    let spatial = &scaled * scaled.transpose();
    let rows: Vec<usize> = part.iter().flat_map(|k| k * bins..(k + 1) * bins).collect();
    let times_d = imager.times_d();
    let time_d = |row: usize| times_d[row / bins];
    let covariance = DMatrix::from_fn(rows.len(), rows.len(), |a, b| {
        let (j, k) = (rows[a], rows[b]);
        let noise = if j == k { SIGMA * SIGMA } else { 0.0 };
        let jitter = if j / bins == k / bins { jitter_kms * jitter_kms * slopes[j] * slopes[k] } else { 0.0 };
        spatial[(j, k)] * field.kernel.at(time_d(j) - time_d(k)) + noise + jitter
    });
    let columns =
        DMatrix::from_fn(
            rows.len(),
            part.len(),
            |a, epoch| {
                if rows[a] / bins == part[epoch] { slopes[rows[a]] } else { 0.0 }
            },
        );
    columns.tr_mul(&covariance.cholesky().unwrap().solve(&columns))
}

/// Profiles of two spectrographs, the offset of one of them fitted or known, and a light curve if there is one; fields
/// and jitter known.
fn of_sets(zero_point: Value, light: bool) -> Config {
    let set = |name: &str, cycles: &[f64], step: f64, seed: u64| {
        let velocity = json!({ "min": -30.0, "max": 30.0, "step": step });
        json!({ "name": name, "velocity_jitter_kms": 0.02 * seed as f64, "simulate": {
            "cycles": cycles, "velocity_kms": velocity, "snr": 300.0, "pixels": 500, "seed": seed
        } })
    };
    let mut second = set("b", &[0.45, 1.1, 2.2, 2.9, 3.3], 3.0, 2);
    second["zero_point_kms"] = zero_point;
    second["resolving_power"] = json!(40_000.0);
    let mut first = set("a", &[0.0, 0.31, 0.9, 1.4, 2.6, 3.7], 4.0, 1);
    first["simulate"]["random_spots"] = json!({ "number": 8, "seed": 3 });
    let field = json!({
        "objective": "marginal-likelihood", "pixels": 150,
        "spot_amplitude": 0.15, "spot_slope": 0.9, "spot_lifetime_d": 5.0
    });
    let config = Config::default()
        .with("star", json!({ "rotation_period_d": 3.0, "inclination_deg": 50.0, "vsini_kms": 20.0, "contrast": 0.2 }))
        .with("star.line", json!({ "sigma_kms": 4.0, "equivalent_width_kms": 6.0 }))
        .with("observations", json!([first, second]))
        .with("imaging", field)
        .with("parameters.vsys_kms", json!({ "prior": "uniform", "min": -1.0, "max": 1.0 }))
        .with("parameters.vsini_kms", json!({ "prior": "normal", "mean": 20.0, "sd": 0.5 }));
    match light {
        true => config.with("photometry.simulate", json!({ "cadence_d": 0.3, "sigma": 0.001 })),
        false => config,
    }
}

/// Standard errors of K, averaged over phases, at some frequencies (orbits a rotation).
fn sigmas(quadratic: &VelocityQuadratic) -> Vec<f64> {
    let sigma = |trial: &Trial| (0.5 * trial.information.try_inverse().unwrap().trace()).sqrt();
    scan(quadratic, &[0.37, 0.61, 0.83, 1.39]).iter().map(sigma).collect()
}

/// The uncertainty of K in a plan of existing data is that of a search of them: offsets, jitters, resolution and bins
/// of each set, the light curve, and the star's parameters are counted in the same way.
#[test]
fn a_plan_of_what_was_taken_is_its_search() {
    for (zero_point, light) in [(json!("fitted"), true), (json!(0.1), true), (json!("fitted"), false)] {
        let scene = Scene::new(&of_sets(zero_point, light)).unwrap();
        let imager = &scene.imager;
        let free = nuisances(&scene.settings.free);
        let (values, known) = (scene.settings.values, scene.surface().field.unwrap());
        let marginal = fit(imager, &Arc::new(Basis::new(&imager.grid)), values, known, None).unwrap().marginal;
        let search = marginal.expansion(imager, &[Parameter::Vsini]).unwrap().velocities(&free);
        let all: Vec<usize> = (0..imager.times_of_all_d().len()).collect();
        assert_eq!(all.len() > imager.profiles().count(), light);
        let planned = Planned::new(imager, marginal.values, marginal.assumed, &free, Some((&marginal, &all)));
        let plan = planned.velocities(&planned.drawn_maps(1).unwrap(), std::slice::from_ref(&all)).unwrap().remove(0);
        assert_eq!(plan.cycles, search.cycles);
        for (plan, search) in sigmas(&plan).into_iter().zip(sigmas(&search)) {
            assert!((plan / search - 1.0).abs() < 1e-2, "{plan} {search}");
        }
    }
}

/// A data set in two parts without a free offset is one; a free offset costs, and a light curve adds.
#[test]
fn offsets_cost_and_light_curves_add() {
    let of = |config: &Config, part: Option<&[usize]>| {
        let scene = Scene::new(config).unwrap();
        let free = nuisances(&scene.settings.free);
        let field = Field {
            spectrum: Spectrum { amplitude: 0.15, slope: 0.9, break_degree: 0.0 },
            kernel: Kernel::of(Lifetime::Days(5.0)),
        };
        let assumed = Assumed { field, jitter_kms: 0.04, night_kms: 0.0 };
        let planned = Planned::new(&scene.imager, scene.settings.values, assumed, &free, None);
        let all: Vec<usize> = (0..scene.imager.times_of_all_d().len()).collect();
        let part = part.map_or(all, <[usize]>::to_vec);
        sigmas(&planned.velocities(&planned.mean_maps(), &[part]).unwrap()[0])
    };
    let known = of(&of_sets(json!(0.0), false), None);
    let lower = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| *a < b * (1.0 + 1e-9));
    assert!(lower(&known, &of(&of_sets(json!("fitted"), false), None)));
    let with_light = of_sets(json!(0.0), true);
    assert!(lower(&of(&with_light, None), &known));
    // without its bins it is none
    let profiles: Vec<usize> = (0..11).collect();
    let without = of(&with_light, Some(&profiles));
    assert!(without.iter().zip(&known).all(|(a, b)| (a / b - 1.0).abs() < 1e-6), "{without:?} {known:?}");

    let whole = of_sets(json!(0.0), false);
    let [first, second] = [0, 1].map(|s| whole.get("observations").unwrap()[s].clone());
    let join = |second: &Value| {
        let mut all = [first.clone(), second.clone()];
        let simulate = all[0]["simulate"].clone();
        all[1] = json!({ "name": "b", "velocity_jitter_kms": 0.02, "simulate": simulate });
        let cycles = |of: &Value| of["simulate"]["cycles"].as_array().unwrap().clone();
        let (mut one, both) = (all[0].clone(), [cycles(&first), cycles(second)]);
        one["simulate"]["cycles"] = both.concat().into();
        all[1]["simulate"]["cycles"] = both[1].clone().into();
        all[1]["simulate"]["seed"] = json!(7);
        all[1]["simulate"].as_object_mut().unwrap().remove("random_spots");
        [whole.clone().with("observations", one), whole.clone().with("observations", all.to_vec())]
    };
    let [one, two] = join(&second).map(|config| of(&config, None));
    assert!(one.iter().zip(&two).all(|(a, b)| (a / b - 1.0).abs() < 1e-6), "{one:?} {two:?}");
}
