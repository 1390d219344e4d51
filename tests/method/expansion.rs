//! The quadratic against full reconstructions and against the independent posterior, on the oracle's data and pixels.

use crate::common::{Oracle, imager, json, numbers, oracle, truth, whole_truth};
use dimcmc::internals::maxent::SolverSettings;
use dimcmc::internals::maxent::entropy::Entropy;
use dimcmc::internals::model::{FreeParameter, Parameter, ParameterSpace, ParameterValues, Prior};
use dimcmc::internals::star::{Quadrature, SurfaceGrid};
use dimcmc::internals::surface::ObjectiveKind;
use dimcmc::internals::surface::expansion::{Expansion, Nuisance, STELLAR};
use dimcmc::internals::surface::imaging::Imager;
use dimcmc::internals::surface::static_map::SpotsCounted;
use dimcmc::internals::surface::static_map::{Posterior, Reference};
use dimcmc::internals::surface::surrogate::Surrogate;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

/// The image without a planet that a search begins with, and the parameters there.
fn planet_free(oracle: &Oracle, imager: &Imager) -> (Reference, ParameterValues) {
    let mut alone = truth(oracle);
    alone.set(Parameter::K, 0.0);
    (Reference::provisional(imager, alone, 0.97).unwrap(), alone)
}

/// A space in which everything is free, within wide bounds.
fn space(imager: &Imager, start: ParameterValues, free: &[Parameter]) -> ParameterSpace {
    let free = free.iter().map(|&parameter| FreeParameter { parameter, prior: wide(parameter) }).collect();
    let (mid, base) = (imager.mid_cycle(), imager.time_base_cycles());
    ParameterSpace::new(free, start, mid, base, imager.star.rotation_period_d)
}

/// The priors of `posterior.json`; for the other parameters bounds far beyond what the data allow.
fn wide(parameter: Parameter) -> Prior {
    match parameter {
        Parameter::K => Prior::Uniform { min: 0.0, max: 0.3 },
        Parameter::PorbOverProt => Prior::Uniform { min: 0.5, max: 4.0 },
        Parameter::Phi => Prior::Periodic,
        Parameter::OmegaEq => Prior::Uniform { min: 2.0, max: 2.2 },
        Parameter::DOmega => Prior::Uniform { min: -0.1, max: 0.1 },
        Parameter::Inclination => Prior::Uniform { min: 20.0, max: 60.0 },
        Parameter::Vsini => Prior::Uniform { min: 35.0, max: 45.0 },
        Parameter::Vsys => Prior::Uniform { min: -1.0, max: 1.0 },
        Parameter::LimbDarkening | Parameter::Contrast => Prior::Uniform { min: 0.0, max: 1.0 },
        Parameter::LineSigma | Parameter::EquivalentWidth => Prior::Uniform { min: 1.0, max: 9.0 },
        other => unreachable!("{other:?}: one map, one planet on a circle"),
    }
}

/// ln L by full reconstructions to rounding error, at the lambda of `reference`.
fn exact(imager: &Imager, reference: &Reference) -> impl Fn(&ParameterValues) -> f64 {
    let given = |p: &Parameter| reference.values.get(*p).is_some();
    let free: Vec<Parameter> = Parameter::ALL.into_iter().filter(given).collect();
    let space = space(imager, reference.values, &free);
    let posterior = Posterior::new(imager.clone(), space, ObjectiveKind::RegularisedLikelihood, reference.clone());
    let posterior = posterior.with_settings(SolverSettings::exact());
    move |values| {
        let theta = posterior.space().theta_of(values);
        posterior.likelihood(&theta).log_prob
    }
}

/// chi2 per datum at lambda = 1e-3, where `posterior.json` was made.
fn oracle_chi2(oracle: &Oracle) -> f64 {
    let chi2 = oracle.json["results"]["fixed_lambda"][0]["chi2"].as_f64().unwrap();
    chi2 / oracle.data.depth.len() as f64
}

#[test]
fn orbits_of_up_to_150_metres_per_second() {
    let oracle = oracle();
    let imager = imager(&oracle, oracle.grid.clone());
    orbits(&oracle, &imager);
    orbits(&oracle, &Imager { entropy: Entropy::BrightAndDark, ..imager });
}

fn orbits(oracle: &Oracle, imager: &Imager) {
    let (reference, alone) = planet_free(oracle, imager);
    let expansion = Expansion::of(imager, &reference, &[]);
    let exact = exact(imager, &reference);
    let none = exact(&alone);
    assert!((expansion.log_likelihood - none).abs() < 1e-4);
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let (mut worst, mut worst_near) = (0.0f64, 0.0f64);
    for _ in 0..12 {
        let mut orbit = alone;
        orbit.set(Parameter::K, 0.15 * rng.random::<f64>());
        orbit.set(Parameter::PorbOverProt, 0.5 + 3.5 * rng.random::<f64>());
        orbit.set(Parameter::Phi, rng.random());
        let (full, quadratic) = (exact(&orbit) - none, expansion.log_likelihood_at(&orbit) - none);
        let [k, period, phi] = [Parameter::K, Parameter::PorbOverProt, Parameter::Phi].map(|p| orbit[p]);
        println!("K {k:.3} P {period:.3} phi {phi:.3}: {full:9.3}, quadratic {quadratic:9.3}");
        let difference = (full - quadratic).abs();
        // near co-rotation the spots respond by moving, which the entropy of dark and bright pixels makes less than
        // linear
        let worst = if (period - 1.0).abs() < 0.3 { &mut worst_near } else { &mut worst };
        *worst = worst.max(difference);
    }
    println!("largest difference {worst:.4}; within 30 % of co-rotation {worst_near:.4}");
    assert!(worst < 0.05 && worst_near < 1.5);
    assert!(worst > 0.0 && worst_near > 0.0, "orbits of both kinds");
}

#[test]
fn stellar_parameters_one_sigma_off() {
    let oracle = oracle();
    // pixels with an extent: those of the oracle's table are points, and come into sight one by one
    let imager = imager(&oracle, SurfaceGrid::equal_area(2000, Quadrature::Gauss2x2));
    let reference = Reference::provisional(&imager, whole_truth(&oracle), 0.97).unwrap();
    let stellar = of_plain_spots();
    let expansion = Expansion::of(&imager, &reference, &stellar);
    let exact = exact(&imager, &reference);
    let here = exact(&reference.values);
    let at = |moves: &[(Parameter, f64)]| {
        let mut values = reference.values;
        moves.iter().for_each(|&(p, step)| values.set(p, values[p] + step));
        (exact(&values) - here, expansion.log_likelihood_at(&values) - here)
    };
    let step = |p: Parameter| match p {
        Parameter::K | Parameter::Vsys => 0.01,
        Parameter::PorbOverProt => 0.05,
        Parameter::Phi => 0.03,
        Parameter::OmegaEq => 5e-4,
        Parameter::DOmega => 1.5e-3,
        Parameter::Inclination => 0.4,
        Parameter::Vsini => 0.015,
        Parameter::LimbDarkening => 0.003,
        Parameter::LineSigma => 0.025,
        Parameter::EquivalentWidth => 0.002,
        Parameter::Contrast => 0.02,
        other => unreachable!("{other:?}: one map, one planet on a circle"),
    };
    for (s, &p) in stellar.iter().enumerate() {
        let i = expansion.profiles() + s;
        println!("{}: {} with all else fixed", p.name(), expansion.information[(i, i)].powf(-0.5));
    }
    let of_one_map: Vec<Parameter> =
        Parameter::ALL.into_iter().filter(|p| reference.values.get(*p).is_some()).collect();
    for (i, &a) in of_one_map.iter().enumerate() {
        for &b in &of_one_map[i..] {
            for sign in [-1.0, 1.0] {
                let (full, quadratic) = at(&[(a, step(a)), (b, sign * step(b))]);
                // the third order, over steps of a standard deviation each
                assert!((full - quadratic).abs() < 0.05 + 0.02 * full.abs(), "{a:?} {b:?}: {full} {quadratic}");
            }
        }
    }
}

/// The orbit and its errors by the quadratic around the best orbit, against emcee on full reconstructions.
#[test]
#[ignore = "long: .ci/run has it run"]
fn posterior_of_the_orbit() {
    let oracle = oracle();
    let imager = imager(&oracle, oracle.grid.clone());
    let reference = Reference::build(&imager, truth(&oracle), oracle_chi2(&oracle)).unwrap();
    assert!((reference.solution.image.lambda / 1e-3 - 1.0).abs() < 1e-4);
    let free = [Parameter::K, Parameter::PorbOverProt, Parameter::Phi];
    let space = space(&imager, reference.values, &free);
    let surrogate = Surrogate::new(&imager, &space, &reference).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let draws: Vec<Vec<f64>> = (0..20_000).map(|_| space.to_physical(&surrogate.draw(&mut rng).unwrap())).collect();
    let wanted = json("posterior.json");
    for (i, key) in ["K", "P", "phi"].into_iter().enumerate() {
        let mut values: Vec<f64> = draws.iter().map(|theta| theta[i]).collect();
        values.sort_by(f64::total_cmp);
        let quantile = |p: f64| values[(p * values.len() as f64) as usize];
        let q = numbers(&wanted[key]);
        let width = 0.5 * (q[3] - q[1]);
        let offset = (quantile(0.5) - q[2]) / width;
        let ratio = 0.5 * (quantile(0.84) - quantile(0.16)) / width;
        println!("{key}: {:.4} instead of {:.4}: {offset:+.3} sigma; width x {ratio:.3}", quantile(0.5), q[2]);
        assert!(offset.abs() < 0.15 && (ratio - 1.0).abs() < 0.10);
    }
}

/// Marginalising over a parameter adds its scatter to the velocities.
#[test]
fn marginalised_velocities() {
    let oracle = oracle();
    let imager = imager(&oracle, SurfaceGrid::equal_area(800, Quadrature::Gauss2x2));
    let reference = Reference::provisional(&imager, whole_truth(&oracle), 0.97).unwrap();
    let stellar = of_plain_spots();
    let expansion = Expansion::of(&imager, &reference, &stellar);
    let orbit = |cycle: f64| reference.values.state().motion.velocity_kms(cycle);
    let nuisance = |parameter: Parameter, sd: f64| Nuisance { parameter, mean: reference.values[parameter], sd };
    let (fixed, fixed_covariance) = expansion.velocities(&[]).radial_velocities().unwrap();
    // no prior width: nothing changes
    let narrow: Vec<Nuisance> =
        stellar.iter().map(|&p| nuisance(p, 1e-9)).chain([nuisance(Parameter::Vsys, 1e-9)]).collect();
    let (same, _) = expansion.velocities(&narrow).radial_velocities().unwrap();
    assert!((&same - &fixed).amax() < 1e-6);
    // a free systemic velocity adds the same variance to all
    let (free, covariance) = expansion.velocities(&[nuisance(Parameter::Vsys, 0.5)]).radial_velocities().unwrap();
    assert!((&free - &fixed).amax() < 1e-6);
    let added = &covariance - &fixed_covariance;
    assert!(added.iter().all(|x| (x - 0.25).abs() < 1e-6));
    // stellar parameters: the covariance of the full inverse, priors added
    let wide: Vec<Nuisance> = stellar.iter().map(|&p| nuisance(p, 0.01 * step_of(p))).collect();
    let marginal = expansion.velocities(&wide).radial_velocities().unwrap().1;
    let mut joint = expansion.information.clone();
    for (s, n) in wide.iter().enumerate() {
        let i = expansion.profiles() + s;
        joint[(i, i)] += n.sd.powi(-2);
    }
    let inverse = joint.cholesky().unwrap().inverse();
    let block = inverse.view((0, 0), (expansion.profiles(), expansion.profiles()));
    assert!((marginal - block).amax() < 1e-9);
    // counted from orbital velocity 0, wherever the expansion was made
    let average = expansion.cycles.iter().zip(fixed.iter()).map(|(&e, v)| v - orbit(e)).sum::<f64>();
    assert!(average.abs() / (expansion.profiles() as f64) < 0.05);
}

/// The star's parameters where spots are merely dimmed photosphere.
fn of_plain_spots() -> Vec<Parameter> {
    STELLAR.iter().copied().filter(|p| !Parameter::REGIONS.contains(p)).collect()
}

fn step_of(p: Parameter) -> f64 {
    match p {
        Parameter::Inclination | Parameter::Vsini => 10.0,
        _ => 1.0,
    }
}

/// Where the orbit is synchronous with the rotation, spots mimic it.
#[test]
fn co_rotation_hides_a_planet() {
    let oracle = oracle();
    let imager = imager(&oracle, oracle.grid.clone());
    let (reference, _) = planet_free(&oracle, &imager);
    let expansion = Expansion::of(&imager, &reference, &[]);
    let quadratic = expansion.velocities(&[]);
    let sigma = |period: f64| {
        let x = nalgebra::DMatrix::from_fn(quadratic.len(), 2, |k, c| {
            let angle = TAU * (quadratic.cycles[k] - imager.mid_cycle()) / period;
            if c == 0 { angle.cos() } else { angle.sin() }
        });
        let covariance = x.tr_mul(&(&quadratic.information * &x)).cholesky().unwrap().inverse();
        covariance.trace().sqrt()
    };
    let loss = sigma(1.0) / sigma(1.7);
    println!("sigma of an amplitude at Porb = Prot over that at 1.7: {loss:.2}");
    assert!(loss > 2.0);
    // photon noise alone scatters the gradient less than the information says
    let eigen = (&expansion.information - &expansion.noise).symmetric_eigenvalues();
    assert!(eigen.min() > -1e-2 * quadratic.information.diagonal().max());
}

/// Unresolved spots counted in the posterior: the same at the reference; near it ln of the density of the gradient,
/// marginalised over its size by an independent sum; ln L falls everywhere, not faster than without them, and continues
/// to fall where the quadratics would have turned the sum of exact ln L and their difference upwards.
#[test]
fn a_posterior_that_counts_unresolved_spots() {
    let oracle = oracle();
    let imager = imager(&oracle, SurfaceGrid::equal_area(1000, Quadrature::Gauss2x2));
    let at = truth(&oracle);
    let reference = Reference::build(&imager, at, 0.97).unwrap();
    let free = [Parameter::K, Parameter::PorbOverProt, Parameter::Phi];
    let space = space(&imager, at, &free);
    let posterior = Posterior::new(imager.clone(), space, ObjectiveKind::Spottedness, reference);
    let counted = SpotsCounted::new(&posterior).unwrap();
    let exact = |values: &ParameterValues| {
        let theta = [values[Parameter::K], values[Parameter::PorbOverProt], values[Parameter::Phi]];
        posterior.likelihood(&theta).log_prob
    };
    let here = exact(&at);
    assert!((counted.log_likelihood(&at, here) - here).abs() < 1e-9);
    // finer and by plain algebra: determinants and inverses of S = noise + f (information - noise)
    let expansion = Expansion::of(posterior.imager(), posterior.reference(), &[]);
    let mut eigen = (&expansion.information - &expansion.noise).symmetric_eigen();
    // no covariance is negative
    eigen.eigenvalues.apply(|e| *e = e.max(0.0));
    let spots = eigen.recompose();
    let ln_density = |values: &ParameterValues| {
        let left = &expansion.gradient - &expansion.information * (expansion.coordinates(values) - &expansion.centre);
        let term = |f: f64| {
            let covariance = &expansion.noise + f * &spots;
            let inverse = covariance.clone().try_inverse().unwrap();
            let eigen = covariance.symmetric_eigenvalues();
            -0.5 * eigen.iter().map(|e| e.abs().ln()).sum::<f64>() - 0.5 * left.dot(&(inverse * &left))
        };
        let terms: Vec<f64> = (0..=120).map(|k| term(10f64.powf(f64::from(k) / 20.0))).collect();
        let largest = terms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        largest + terms.iter().map(|t| (t - largest).exp()).sum::<f64>().ln()
    };
    let quadratic = |values: &ParameterValues| ln_density(values) - ln_density(&at);
    let with_k = |k_kms: f64| {
        let mut values = at;
        values.set(Parameter::K, k_kms);
        values
    };
    for k_kms in [0.08, 0.09, 0.11, 0.12] {
        let values = with_k(k_kms);
        let (with, expected) = (counted.log_likelihood(&values, exact(&values)), here + quadratic(&values));
        // spottedness differs from any quadratic by a few hundredths two sigma off
        assert!((with - expected).abs() < 0.05, "K = {k_kms}: {with} for {expected}");
    }
    let mut last = (here, here);
    for k_kms in [0.15, 0.25, 0.4, 0.8, 1.5, 3.0] {
        let values = with_k(k_kms);
        let alone = exact(&values);
        let with = counted.log_likelihood(&values, alone);
        println!("K = {k_kms}: {alone:.2}, spots counted {with:.2}");
        assert!(with < last.1, "K = {k_kms}: {with} after {}", last.1);
        assert!(with - here >= alone - here - 0.05 * alone.abs(), "K = {k_kms}: {with} below {alone}");
        last = (alone, with);
    }
}

/// The part of ln L beyond the quadratic is tempered, nowhere magnified: also where the quadratic is above the
/// reference, which happens next to one that is not its maximum, and the density of the gradient below it.
#[test]
fn unresolved_spots_magnify_nothing() {
    let oracle = oracle();
    let imager = imager(&oracle, SurfaceGrid::equal_area(1000, Quadrature::Gauss2x2));
    let mut at = truth(&oracle);
    at.set(Parameter::K, 0.07);
    let reference = Reference::build(&imager, at, 0.97).unwrap();
    let expansion = Expansion::of(&imager, &reference, &[]);
    let free = [Parameter::K, Parameter::PorbOverProt, Parameter::Phi];
    let posterior = Posterior::new(imager.clone(), space(&imager, at, &free), ObjectiveKind::Spottedness, reference);
    let counted = SpotsCounted::new(&posterior).unwrap();
    let here = posterior.likelihood(&[0.07, at[Parameter::PorbOverProt], at[Parameter::Phi]]).log_prob;
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let mut above = 0;
    for _ in 0..2000 {
        let mut values = at;
        values.set(Parameter::K, rng.random_range(0.0..0.2));
        values.set(Parameter::PorbOverProt, rng.random_range(1.2..2.5));
        values.set(Parameter::Phi, rng.random_range(0.2..0.8));
        let quadratic = expansion.log_likelihood_at(&values) - expansion.log_likelihood;
        let at = |beyond: f64| counted.log_likelihood(&values, here + quadratic + beyond);
        let gain = at(0.5) - at(0.0);
        assert!(gain > 0.0 && gain <= 0.5, "{values:?}: {gain}");
        above += usize::from(quadratic > 0.0 && at(0.0) < here);
    }
    println!("{above} of 2000 above the reference to second order and below it with spots counted");
    assert!(above > 0, "the case that this is about");
}
