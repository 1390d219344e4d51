//! Light curves beside profiles: dense algebra on a small star, and their constraints on spots.

use dimcmc::internals::field::{Compression, Epoch, Evidence, Field, Kernel, Lifetime, Spectrum};
use dimcmc::internals::model::Parameter;
use dimcmc::internals::surface::Known;
use dimcmc::internals::surface::evolving_map::{Assumed, Basis, Design, LEVEL, Marginal, fit};
use dimcmc::{Config, Scene};
use nalgebra::{DMatrix, DVector};
use serde_json::{Value, json};
use std::f64::consts::TAU;
use std::sync::Arc;

/// A star whose spots live some days, seen for three weeks; with a light curve that has a gap, or without.
fn config(seed: u64, profiles: usize, pixels: usize, light: Option<Value>) -> Value {
    let cycles: Vec<f64> =
        (0..profiles).map(|k| (7.0 * k as f64 + 0.31 * (k as f64).sin()) / profiles as f64).collect();
    let mut config = json!({
        "star": { "rotation_period_d": 3.0, "inclination_deg": 60.0, "vsini_kms": 25.0, "contrast": 0.3,
                  "line": { "sigma_kms": 3.0, "equivalent_width_kms": 6.0 } },
        "planet": { "k_kms": 0.2, "porb_over_prot": 1.7, "phi": 0.3 },
        "imaging": { "pixels": pixels, "objective": "marginal-likelihood" },
        "observations": { "velocity_jitter_kms": 0.0, "simulate": {
            "random_spots": { "number": 8, "lifetime_d": 12, "seed": seed }, "cycles": cycles, "seed": seed,
            "velocity_kms": { "min": -36.0, "max": 36.0, "step": 2.4 }, "snr": 700, "pixels": 3000 } }
    });
    if let Some(light) = light {
        config["photometry"] = light;
    }
    config
}

fn scene(config: &Value) -> Scene {
    Scene::new(&Config::from_json(&config.to_string()).unwrap()).unwrap()
}

fn assumed(lifetime_d: f64) -> Assumed {
    let spectrum = Spectrum { amplitude: 0.2, slope: 0.9, break_degree: 0.0 };
    let kernel = Kernel { lifetime: Lifetime::Days(lifetime_d), persistent: 0.1 };
    Assumed { field: Field { spectrum, kernel }, jitter_kms: 0.0, night_kms: 0.0 }
}

fn marginal(scene: &Scene, basis: &Arc<Basis>, lifetime_d: f64) -> Marginal {
    let values = scene.settings.values;
    let design = Arc::new(Design::new(&scene.imager, basis, &values.state()));
    Marginal::new(&scene.imager, basis, design, values, assumed(lifetime_d), None).unwrap()
}

/// Covariance of all profiles and bins written out: field, noise, and level and slope of both segments.
#[test]
fn ln_z_of_profiles_and_a_light_curve_is_that_of_dense_algebra() {
    let light = json!({ "contrast": 0.5, "limb_darkening": { "law": "quadratic", "coefficients": [0.3, 0.2] },
                        "simulate": { "cadence_d": 1.0, "sigma": 5e-4 } });
    let mut scene = scene(&config(3, 5, 250, Some(light)));
    assert_eq!((scene.imager.light_curves[0].bins.len(), scene.imager.epochs()), (17, 22));
    // two segments, of four and the rest
    let bins = &mut scene.imager.light_curves[0].bins;
    for (k, bin) in bins.iter_mut().enumerate() {
        let (first, last) = if k < 4 { (0.0, 3.0) } else { (4.0, 16.0) };
        bin.segment = usize::from(k >= 4);
        bin.place = (2.0 * k as f64 - first - last) / (last - first);
    }
    scene.imager.light_curves[0].segments = 2;
    let (imager, basis) = (&scene.imager, Arc::new(Basis::new(&scene.imager.grid).exactly()));
    let curve = &imager.light_curves[0];
    let marginal = marginal(&scene, &basis, 6.0);
    let coefficients = &marginal.settled.coefficients;
    // linear in the field, whatever they are divided by
    let linear = |epoch: Epoch| Epoch { divisor: DVector::zeros(0), ..epoch };
    let epochs: Vec<Epoch> = marginal.design.epochs(imager, coefficients).into_iter().map(linear).collect();
    let bins = &imager.light_curves[0].bins;
    let data: usize = epochs.iter().map(|epoch| epoch.len()).sum();
    let harmonics = basis.len();
    let (mut design, mut residual, mut times_d) = (DMatrix::zeros(data, harmonics), DVector::zeros(data), Vec::new());
    let mut noise = DMatrix::zeros(data, data);
    let mut row = 0;
    for (k, epoch) in epochs[..5].iter().enumerate() {
        let n = epoch.len();
        design.rows_mut(row, n).copy_from(&epoch.jacobian.whole());
        residual.rows_mut(row, n).copy_from(&(&epoch.misfit + epoch.jacobian.times(coefficients.column(k))));
        let own = DMatrix::from_diagonal(&epoch.variance) + &epoch.nuisances * epoch.nuisances.transpose();
        noise.view_mut((row, row), (n, n)).copy_from(&own);
        times_d.extend(vec![epoch.time_d; n]);
        row += n;
    }
    let first = row;
    let state = scene.settings.values.state();
    for bin in bins {
        // flux = sum of shares times 1 - 0.5 filling, over that of filling 0.06 everywhere
        let shares = curve.band.shares(&imager.grid, &imager.star, &state, &[bin.time_d]);
        let row_of = DVector::from_vec(shares).tr_mul(&basis.on_pixels) * (-0.5 / (1.0 - 0.5 * 0.06));
        design.row_mut(row).copy_from(&row_of);
        residual[row] = bin.flux - 1.0;
        noise[(row, row)] = bin.sigma * bin.sigma;
        times_d.push(bin.time_d);
        row += 1;
    }
    for (i, a) in bins.iter().enumerate() {
        for (j, b) in bins.iter().enumerate().filter(|(_, b)| b.segment == a.segment) {
            noise[(first + i, first + j)] += LEVEL * LEVEL * (1.0 + a.place * b.place);
        }
    }
    let field = marginal.assumed.field;
    let variances = DMatrix::from_diagonal(&DVector::from_vec(field.spectrum.variances(&basis.degrees)));
    let mut covariance = &design * variances * design.transpose();
    for (i, a) in times_d.iter().enumerate() {
        for (j, b) in times_d.iter().enumerate() {
            covariance[(i, j)] *= field.kernel.at(a - b);
        }
    }
    let factor = (covariance + noise).cholesky().unwrap();
    let beside: f64 = epochs.iter().map(|epoch| epoch.beside).sum();
    let squares = residual.dot(&factor.solve(&residual));
    let ln_z = beside - 0.5 * (squares + factor.ln_determinant() + data as f64 * TAU.ln());
    let exact = Compression { left_out: 0.0 };
    let found = Evidence::new(field, &basis.degrees, &epochs, coefficients, exact).unwrap().ln_evidence();
    assert!((found - ln_z).abs() < 1e-6, "{found}, not {ln_z}");
    // velocities are those of the profiles, parameters those of all
    let expansion = marginal.expansion(imager, &[Parameter::Inclination]).unwrap();
    assert_eq!((expansion.profiles(), expansion.information.nrows()), (5, 6));
}

/// The error of ln lifetime from the second difference of ln Z at a field that is known but for that.
fn lifetime_error(scene: &Scene, basis: &Arc<Basis>, lifetime_d: f64) -> f64 {
    const STEP: f64 = 0.3;
    let at = |step: f64| marginal(scene, basis, lifetime_d * f64::exp(step)).ln_evidence();
    let bend = (2.0 * at(0.0) - at(STEP) - at(-STEP)) / (STEP * STEP);
    bend.max(0.0).sqrt().recip()
}

#[test]
fn a_light_curve_tells_the_lifetime_of_spots() {
    let light = json!({ "simulate": { "cadence_d": 0.2, "sigma": 3e-4 } });
    let [with, without] = [Some(light), None].map(|light| {
        let scene = scene(&config(5, 8, 250, light));
        lifetime_error(&scene, &Arc::new(Basis::new(&scene.imager.grid)), 12.0)
    });
    assert!(with < 0.5 * without, "{with} with a light curve, {without} without");
}

/// Fits of some stars: errors of the lifetime, the rest of the field fixed, and K in units of its error.
#[test]
#[ignore = "long: .ci/run has it run"]
fn light_curves_halve_the_error_of_the_lifetime_and_do_not_bias_k() {
    let light = json!({ "simulate": { "cadence_d": 0.1, "sigma": 3e-4 } });
    const STARS: u64 = 3;
    let (mut ratios, mut pulls) = (Vec::new(), Vec::new());
    for seed in 1..=STARS {
        let [with, without] = [Some(light.clone()), None].map(|light| {
            let scene = scene(&config(seed, 16, 500, light));
            let basis = Arc::new(Basis::seen(&scene.imager, &scene.settings.values));
            let known = Known { jitter_kms: Some(0.0), ..Known::default() };
            let fitted = fit(&scene.imager, &basis, scene.settings.values, known, None).unwrap().marginal;
            let lifetime_d = fitted.assumed.field.kernel.lifetime.days().unwrap();
            let at = |step: f64| {
                let mut assumed = fitted.assumed;
                assumed.field.kernel.lifetime = Lifetime::Days(lifetime_d * f64::exp(step));
                let (design, values) = (Arc::clone(&fitted.design), fitted.values);
                Marginal::new(&scene.imager, &basis, design, values, assumed, Some(&fitted)).unwrap().ln_evidence()
            };
            let error = ((2.0 * at(0.0) - at(0.3) - at(-0.3)) / 0.09).max(0.0).sqrt().recip();
            // along the true orbit: its velocities are those of the values
            let quadratic = fitted.expansion(&scene.imager, &[]).unwrap();
            let orbit = scene.settings.values.state().motion.first.orbit;
            let unit =
                DVector::from_iterator(16, quadratic.cycles.iter().map(|c| orbit.velocity_kms(*c) / orbit.k_kms));
            let information = (quadratic.information * &unit).dot(&unit);
            (error, quadratic.gradient.dot(&unit) / information.sqrt(), lifetime_d, information.sqrt().recip())
        });
        eprintln!("{seed}: with {with:?}, without {without:?}");
        ratios.push(with.0 / without.0);
        pulls.push(with.1);
    }
    ratios.sort_by(f64::total_cmp);
    assert!(ratios[1] < 0.6, "errors of the lifetime over those without: {ratios:?}");
    let mean = pulls.iter().sum::<f64>() / STARS as f64;
    assert!(mean.abs() < 3.0 / (STARS as f64).sqrt() && pulls.iter().all(|pull| pull.abs() < 3.5), "{pulls:?}");
}
