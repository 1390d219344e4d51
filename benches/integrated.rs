//! Marginal likelihood: the cost of ln Z with a new star, a new field and a new orbit, from one reference; on one
//! thread.

mod common;

use common::stopwatch::{fastest, seconds};
use common::table::{Table, Target};
use dimcmc::internals::model::{FreeParameter, Parameter, Prior};
use dimcmc::internals::surface::Known;
use dimcmc::internals::surface::evolving_map::{Basis, Held, MarginalPosterior, fit};
use dimcmc::{Config, LogDensity as _, Scene};
use serde_json::json;
use std::sync::Arc;

/// Milliseconds of 40 profiles of 57 bins on one core.
const NEW_STAR: Target = Target::AtMost(100.0);
const NEW_FIELD: Target = Target::AtMost(50.0);
const NEW_ORBIT: Target = Target::AtMost(2.0);

/// Number of repetitions; the fastest counts.
const ROUNDS: usize = 7;

/// Standard errors of K (km/s), Porb/Prot, phi, inclination (deg) and vsini (km/s) of such a star.
const ERRORS: [f64; 5] = [0.02, 0.07, 0.06, 1.5, 0.08];

const ORBIT: [Parameter; 3] = [Parameter::K, Parameter::PorbOverProt, Parameter::Phi];

fn main() {
    if !common::wanted() {
        return;
    }
    let star = format!("new star / ms ({NEW_STAR})");
    let field = format!("new field / ms ({NEW_FIELD})");
    let orbit = format!("new orbit / ms ({NEW_ORBIT})");
    let columns = [
        "profiles",
        "numbers",
        "harmonics",
        &star,
        "a star far off / ms",
        &field,
        &orbit,
        "reference / ms",
        "fit of the field / s",
    ];
    let mut table = Table::new("All maps integrated over", &columns);
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread can be begun");
    for profiles in [20, 40, 80] {
        alone.install(|| measure(profiles, &mut table));
    }
    table.print(
        "Profiles of 57 bins over 15 nights, 2,000 pixels, vsini 40 km/s, S/N 1000, spots that live some 30 d; one \
        thread; the targets are for 40 profiles. New star: another vsini, inclination and orbit, a standard error or \
        so away; far off: 2 % away, which is ten of vsini. New field: another amplitude, slope and lifetime, and \
        orbit, 2 % away. All find the most probable maps from those of the reference. Reference: the same from \
        uniform maps. Numbers that profiles are compressed to, and harmonics of the maps: products with the \
        harmonics are numbers^2 * harmonics, the factor numbers^3 / 3. The fastest of 7; a fit once.",
    );
}

/// A star with this many profiles.
fn scene(profiles: usize) -> Scene {
    let cycle = |k: usize| 5.0 * (k as f64 + 0.3 * (7.0 * k as f64).sin()) / profiles as f64;
    let cycles: Vec<f64> = (0..profiles).map(cycle).collect();
    let config = Config::default()
        .with("star.rotation_period_d", 3.0)
        .with("star.inclination_deg", 38.0)
        .with("star.vsini_kms", 40.0)
        .with("star.line", json!({ "sigma_kms": 2.5, "equivalent_width_kms": 5.8 }))
        .with("star.contrast", 0.1)
        .with("instrument.resolving_power", 65_000.0)
        .with("planet", json!({ "k_kms": 0.1, "porb_over_prot": 1.7, "phi": 0.3 }))
        .with("observations.simulate.random_spots", json!({ "number": 16, "lifetime_d": 30, "seed": 1 }))
        .with("observations.simulate.cycles", cycles)
        .with("observations.simulate.velocity_kms", json!({ "min": -50.4, "max": 50.4, "step": 1.8 }))
        .with("imaging.objective", "marginal-likelihood");
    Scene::new(&config).expect("a star")
}

fn measure(profiles: usize, table: &mut Table) {
    let scene = scene(profiles);
    let mut values = scene.settings.values;
    let field = [(Parameter::SpotAmplitude, 0.25), (Parameter::SpotSlope, 1.5), (Parameter::SpotLifetime, 30.0)];
    field.into_iter().for_each(|(p, value)| values.set(p, value));
    let posterior = |free: &[Parameter]| {
        let wide = |parameter: &Parameter| FreeParameter {
            parameter: *parameter,
            prior: Prior::Uniform { min: 0.0, max: 3000.0 },
        };
        let space = scene.space_of(&free.iter().map(wide).collect::<Vec<_>>());
        let held = Held { break_degree: Known::default().break_degree(), jitter_kms: 0.0, night_kms: 0.0 };
        MarginalPosterior::new(scene.imager.clone(), &space, values, held).expect("a reference")
    };
    // at this distance, another point each time
    let ms = |posterior: &MarginalPosterior, far: &dyn Fn(usize, f64) -> f64| {
        let here = posterior.space().theta_of(&posterior.reference().values);
        let round = |k: usize| {
            let shift = |(i, x): (usize, &f64)| x + far(i, *x) * ((3 * k + 5 * i) as f64).sin();
            let theta: Vec<f64> = here.iter().enumerate().map(shift).collect();
            seconds(|| assert!(posterior.evaluate(&theta).is_finite()))
        };
        1e3 * fastest(&(0..ROUNDS).map(round).collect::<Vec<_>>())
    };
    let parts = |_: usize, x: f64| 0.02 * x;
    let judged = |target: Target, ms: f64| if profiles == 40 { target.judge(ms, 2) } else { format!("{ms:.2}") };
    let star = posterior(&[&ORBIT[..], &[Parameter::Inclination, Parameter::Vsini]].concat());
    let reference = 1e3 * fastest(&(0..2).map(|_| seconds(|| posterior(&ORBIT))).collect::<Vec<_>>());
    let basis = Arc::new(Basis::seen(&scene.imager, &values));
    let known = Known { jitter_kms: Some(0.0), ..Known::default() };
    let fitted = seconds(|| fit(&scene.imager, &basis, values, known, None).expect("a field"));
    table.row([
        profiles.to_string(),
        star.reference().settled.evidence.compressed_len().to_string(),
        star.reference().basis.len().to_string(),
        judged(NEW_STAR, ms(&star, &|i, _| ERRORS[i])),
        format!("{:.0}", ms(&star, &parts)),
        judged(NEW_FIELD, ms(&posterior(&[&ORBIT[..], &Parameter::FIELD].concat()), &parts)),
        judged(NEW_ORBIT, ms(&posterior(&ORBIT), &parts)),
        format!("{reference:.0}"),
        format!("{fitted:.1}"),
    ]);
}
