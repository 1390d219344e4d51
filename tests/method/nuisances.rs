//! Nuisances of line and continuum against dense algebra, differences and simulated stars whose continua wander.

use crate::common::{dot, hold_derivatives, imager, oracle, truth};
use dimcmc::SurfaceMaps;
use dimcmc::internals::data::config::{Config, ObservationSource};
use dimcmc::internals::data::scene::Scene;
use dimcmc::internals::maxent::{Problem, SolverSettings};
use dimcmc::internals::model::{FreeParameter, Parameter, ParameterSpace, ParameterValues, Prior};
use dimcmc::internals::star::observation::{Observations, Profile};
use dimcmc::internals::star::{Quadrature, SurfaceGrid};
use dimcmc::internals::surface::ObjectiveKind;
use dimcmc::internals::surface::expansion::{Expansion, STELLAR};
use dimcmc::internals::surface::imaging::Imager;
use dimcmc::internals::surface::nuisances::LineAndContinuum;
use dimcmc::internals::surface::static_map::{Posterior, Reference};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;
use std::path::Path;

const PRIORS: LineAndContinuum =
    LineAndContinuum { continuum_offset: 1e-3, continuum_slope: 2e-3, equivalent_width: 0.02 };

/// The oracle's data as observations.
fn observations(imager: &Imager) -> Observations {
    let mut bins = imager.data.depth.iter().zip(&imager.data.inverse_variance);
    let step_kms = imager.sets[0].sampling.step_kms;
    let profiles = imager.profiles().map(|(time_d, first_velocity_kms, n)| {
        let (intensity, sigma) = bins.by_ref().take(n).map(|(d, w)| (1.0 - d, w.powf(-0.5))).unzip();
        Profile { time_d, first_velocity_kms, step_kms, intensity, sigma, exposure_s: None }
    });
    Observations { profiles: profiles.collect() }
}

fn with_nuisances(pixels: usize, priors: LineAndContinuum) -> Imager {
    let oracle = oracle();
    let imager = imager(&oracle, SurfaceGrid::equal_area(pixels, Quadrature::Gauss2x2));
    let observations = observations(&imager);
    imager.with_nuisances(priors, &observations)
}

#[test]
fn gradient_and_curvature_of_the_misfit_are_its_derivatives() {
    let imager = with_nuisances(1000, PRIORS);
    let mut problem = imager.problem(imager.response(&truth(&oracle()).state()));
    hold_derivatives(&mut problem, imager.grid.len());
}

/// chi2 marginalised over nuisances is the smallest chi2 over their values, each penalised by its prior.
#[test]
fn chi2_is_the_least_over_all_nuisances() {
    let imager = with_nuisances(1000, PRIORS);
    let mut problem = imager.problem(imager.response(&truth(&oracle()).state()));
    let chi2 = problem.linearise(&vec![0.05; imager.grid.len()]);
    let bins = imager.sets[0].sampling.profiles[0].2;
    let mean = |j: usize| imager.data.depth.iter().skip(j).step_by(bins).sum::<f64>() / 50.0;
    let mut least = 0.0;
    for (k, (model, observed)) in problem.model().chunks(bins).zip(imager.data.depth.chunks(bins)).enumerate() {
        let t = DMatrix::from_fn(bins, 3, |j, i| match i {
            0 => -1.0,
            1 => -(2.0 * j as f64 / (bins as f64 - 1.0) - 1.0),
            _ => mean(j),
        });
        let left = DVector::from_iterator(bins, observed.iter().zip(model).map(|(d, m)| d - m));
        let price = DVector::from(PRIORS.numbers().map(|sd| 1e-6 / (sd * sd)).to_vec());
        let best = (t.tr_mul(&t) + DMatrix::from_diagonal(&price)).cholesky().unwrap().solve(&t.tr_mul(&left));
        least += (&left - &t * &best).norm_squared() / 1e-6;
        least += best.iter().zip(PRIORS.numbers()).map(|(x, sd)| (x / sd).powi(2)).sum::<f64>();
        let mut depth = vec![0.0; imager.data.depth.len()];
        let range = k * bins..(k + 1) * bins;
        let estimate = imager.data.nuisances.estimate(range.clone(), problem.weighted_residual(), &mut depth);
        for (got, wanted) in estimate.line_and_continuum.numbers().iter().zip(best.iter()) {
            assert!((got - wanted).abs() < 1e-9, "{estimate:?} {best}");
        }
        assert!((DVector::from_column_slice(&depth[range]) - &t * &best).amax() < 1e-12);
    }
    assert!((chi2 / least - 1.0).abs() < 1e-9, "{chi2} {least}");
}

#[test]
fn no_prior_width_is_no_nuisance() {
    let plain = imager(&oracle(), SurfaceGrid::equal_area(600, Quadrature::Gauss2x2));
    let chi2 = |imager: &Imager| {
        let mut problem = imager.problem(imager.response(&truth(&oracle()).state()));
        problem.linearise(&vec![0.05; imager.grid.len()])
    };
    let none = with_nuisances(600, LineAndContinuum::default());
    assert!(none.data.nuisances.is_empty());
    assert_eq!(chi2(&plain), chi2(&none));
    let narrow = with_nuisances(600, LineAndContinuum::of_numbers([1e-9; 3]));
    // in proportion to the square of the width, which is 1e-6 of the constraint by the data
    assert!((chi2(&narrow) / chi2(&plain) - 1.0).abs() < 1e-9);
}

/// The quadratic expansion with nuisances, against full reconstructions.
#[test]
fn the_expansion_knows_of_them() {
    let imager = with_nuisances(800, PRIORS);
    let reference = Reference::provisional(&imager, truth(&oracle()), 0.97).unwrap();
    let expansion = Expansion::of(&imager, &reference, &STELLAR[..4]);
    let free = [Parameter::K, Parameter::Vsini, Parameter::Vsys];
    let wide = Prior::Uniform { min: -1e3, max: 1e3 };
    let space = ParameterSpace::new(
        free.map(|parameter| FreeParameter { parameter, prior: wide }).to_vec(),
        reference.values,
        imager.mid_cycle(),
        imager.time_base_cycles(),
        3.0,
    );
    let posterior = Posterior::new(imager, space, ObjectiveKind::RegularisedLikelihood, reference.clone());
    let posterior = posterior.with_settings(SolverSettings::exact());
    let exact = |values: &ParameterValues| posterior.likelihood(&free.map(|p| values[p])).log_prob;
    let here = exact(&reference.values);
    assert!((here - expansion.log_likelihood).abs() < 1e-4);
    for moves in [[0.02, 0.0, 0.0], [-0.02, 0.02, 0.01], [0.0, 0.015, -0.02]] {
        let mut values = reference.values;
        free.iter().zip(moves).for_each(|(&p, step)| values.set(p, values[p] + step));
        let (full, quadratic) = (exact(&values) - here, expansion.log_likelihood_at(&values) - here);
        // the third order, over steps of one or two standard deviations
        assert!((full - quadratic).abs() < 0.03 + 0.02 * full.abs(), "{moves:?}: {full} {quadratic}");
    }
}

/// The demo's star with continua and lines that wander, and with `nuisances` in its config.
fn wandering(nuisances: bool) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/demo.json");
    let mut json: serde_json::Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    json["observations"]["simulate"]["continuum"] =
        serde_json::json!({ "offset": 1e-3, "slope": 2e-3, "equivalent_width": 0.02 });
    // the same pixels, so that few of them are enough
    json["observations"]["simulate"]["pixels"] = 600.into();
    json["imaging"]["pixels"] = 600.into();
    if nuisances {
        json["imaging"]["nuisances"] = serde_json::to_value(PRIORS).unwrap();
    }
    Scene::new(&Config::at(json.clone(), &path)).unwrap()
}

/// `K cos` and `K sin` of the orbit at its true period, from the planet-free image, with their errors.
fn amplitudes(scene: &Scene) -> [(f64, f64); 2] {
    let mut alone = scene.settings.values;
    alone.set(Parameter::K, 0.0);
    let reference = Reference::provisional(&scene.imager, alone, 0.97).unwrap();
    let expansion = Expansion::of(&scene.imager, &reference, &[]);
    let x = DMatrix::from_fn(expansion.cycles.len(), 2, |k, c| {
        let angle = TAU * (expansion.cycles[k] / 1.7 - 0.5);
        if c == 0 { angle.cos() } else { angle.sin() }
    });
    let covariance = x.tr_mul(&(&expansion.information * &x)).cholesky().unwrap().inverse();
    let best = &covariance * x.tr_mul(&expansion.gradient);
    [0, 1].map(|i| (best[i], covariance[(i, i)].sqrt()))
}

#[test]
fn an_orbit_is_found_under_wandering_continua() {
    let scene = wandering(true);
    // K = 0.1 km/s at phase 0.5
    let [(k, sigma_k), (across, sigma_across)] = amplitudes(&scene);
    println!("with nuisances: {k:.4} +- {sigma_k:.4}, {across:.4} +- {sigma_across:.4}");
    assert!(((k - 0.1) / sigma_k).abs() < 2.5 && (across / sigma_across).abs() < 2.5);
    // they degrade little: without wandering the error is 0.011
    assert!(sigma_k < 0.02);
    let reference = Reference::build(&scene.imager, scene.settings.values, 0.97).unwrap();
    let fit = SurfaceMaps::of_reference(&scene.imager, &scene.observations, &reference);
    assert!(fit.summary.residual_rms < 1.05e-3, "{}", fit.summary.residual_rms);
    // every profile's own numbers come back: within their errors, which priors and spots make no smaller than a tenth
    // of the prior
    let ObservationSource::Simulate(simulation) = &scene.settings.sets[0].source else { panic!() };
    for i in 0..3 {
        let (found, injected): (Vec<f64>, Vec<f64>) =
            fit.nuisances.iter().zip(simulation.nuisances()).map(|(a, b)| (a.numbers()[i], b.numbers()[i])).unzip();
        let off: Vec<f64> = found.iter().zip(&injected).map(|(a, b)| a - b).collect();
        let (off, size) = (dot(&off, &off).sqrt(), dot(&injected, &injected).sqrt());
        println!("nuisance {i}: {:.3} of it is left", off / size);
        assert!(off < 0.4 * size, "nuisance {i}: {off} of {size}");
    }
    // without nuisances there is no map that fits, and the orbit is off
    let scene = wandering(false);
    assert!(Reference::build(&scene.imager, scene.settings.values, 0.97).is_err());
    let [(k, sigma_k), (across, sigma_across)] = amplitudes(&scene);
    println!("without: {k:.4} +- {sigma_k:.4}, {across:.4} +- {sigma_across:.4}");
    assert!(((k - 0.1) / sigma_k).hypot(across / sigma_across) > 3.0);
}
