//! Forecasts of `dimcmc plan` against simulated campaigns: stars with random, evolving spots, each with its own nights,
//! spots and noise, the field of spots fitted to its profiles. Output: one line per star, then the ratio of achieved
//! uncertainties of K to those forecast from default spots, the same with the lifetime of these, the spots of most of
//! these stars, and those fitted to the star itself.
//!
//!     RAYON_NUM_THREADS=1 cargo run --release --example plan_check -- 50 > fits.txt
//!     RAYON_NUM_THREADS=1 cargo run --release --example plan_check -- 50 fits.txt
//!
//! The second line takes the fields from the first one's output, which takes minutes instead of most of an hour.

use dimcmc::Config;
use dimcmc::internals::data::scene::Scene;
use dimcmc::internals::field::{Field, Kernel, Lifetime, Spectrum};
use dimcmc::internals::planets::periodogram::FrequencySettings;
use dimcmc::internals::planets::periodogram::orbits::scan;
use dimcmc::internals::runs::plan::{Campaign, Outlook, PlanSettings, compared_d, outlook, range_d};
use dimcmc::internals::surface::Known;
use dimcmc::internals::surface::evolving_map::{Assumed, Basis, fit};
use dimcmc::internals::surface::expansion::nuisances;
use serde_json::json;
use std::sync::Arc;
use std::time::Instant;

/// A campaign of 16 nights, with the seed of nights, spots and noise.
fn star(seed: u64) -> Config {
    let schedule = json!({ "nights": 16, "per_night": [2, 3], "night_hours": 8.0, "seed": seed });
    let spots = json!({ "number": 12, "lifetime_d": 15.0, "seed": seed });
    Config::default()
        .with("star.rotation_period_d", 2.7)
        .with("star.inclination_deg", 60.0)
        .with("star.vsini_kms", 30.0)
        .with("star.contrast", 0.3)
        .with("star.line", json!({ "sigma_kms": 3.5, "equivalent_width_kms": 6.0 }))
        .with("observations.simulate.random_spots", spots)
        .with("observations.simulate.schedule", schedule)
        .with("observations.simulate.velocity_kms", json!({ "min": -45.0, "max": 45.0, "step": 2.0 }))
        .with("observations.simulate.snr", 1000.0)
        .with("observations.simulate.seed", seed)
        .with("observations.simulate.pixels", 4000)
        .with("imaging.pixels", 800)
        .with("imaging.objective", "marginal-likelihood")
        .with("parameters.vsys_kms", json!({ "prior": "uniform", "min": -1.0, "max": 1.0 }))
}

/// Lifetime of a field for spots that live 15 d: 0.8 of that (`results/calibration-changing.md`).
const LIFETIME_D: f64 = 12.0;

/// Forecast sigma_K for a star with these spots.
fn forecast(campaign: &Campaign, assumed: Assumed, range: [f64; 2], per_cycle: &[f64], maps: usize) -> Vec<f64> {
    let campaign = Campaign { assumed, ..campaign.clone() };
    let settings = PlanSettings { maps, draws: 1000, seed: 1, fixed: false };
    let outlooks = outlook(&campaign, range, &settings, &|_| ()).expect("an outlook");
    let whole: &Outlook = outlooks.last().expect("all nights");
    whole.at(per_cycle).iter().map(|expected| expected.sigma_k_kms.unwrap_or(f64::NAN)).collect()
}

/// sigma_K of the simulated profiles, and the spots that were fitted to them.
fn achieved(config: &Config, per_cycle: &[f64], before: Option<Known>) -> (Vec<f64>, Assumed) {
    let scene = Scene::new(config).expect("a scene");
    let known = scene.surface().field.expect("what is known of the field");
    let basis = Arc::new(Basis::new(&scene.imager.grid));
    let known = before.unwrap_or(known);
    let fitted = fit(&scene.imager, &basis, scene.settings.values, known, None).expect("a field");
    let expansion = fitted.marginal.expansion(&scene.imager, &[]).expect("an expansion");
    let quadratic = expansion.velocities(&nuisances(&scene.settings.free));
    let sigma = |trial: &dimcmc::internals::planets::periodogram::Trial| {
        trial.information.try_inverse().map_or(f64::NAN, |covariance| (0.5 * covariance.trace()).sqrt())
    };
    (scan(&quadratic, per_cycle).iter().map(sigma).collect(), fitted.marginal.assumed)
}

/// The field of a star in the output of an earlier run.
fn fitted_before(output: &str, seed: u64) -> Option<Known> {
    let cells = |line: &str| line.split(' ').map(|cell| cell.parse().ok()).collect::<Option<Vec<f64>>>();
    let row = output.lines().filter_map(cells).find(|row| row.len() == 8 && row[0] == seed as f64)?;
    Some(Known {
        amplitude: Some(row[2]),
        slope: Some(row[3]),
        break_degree: Some(Known::default().break_degree()),
        lifetime: Some(Lifetime::Days(row[4])),
        jitter_kms: Some(row[5]),
        ..Known::default()
    })
}

fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Median, and half the range from the 16th to the 84th percentile.
fn spread(values: &[f64]) -> (f64, f64) {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| sorted[((sorted.len() - 1) as f64 * share).round() as usize];
    (at(0.5), 0.5 * (at(0.84) - at(0.16)))
}

struct Star {
    campaign: Campaign,
    range: [f64; 2],
    per_cycle: Vec<f64>,
    sigma: Vec<f64>,
    assumed: Assumed,
}

fn main() {
    let number: u64 = std::env::args().nth(1).and_then(|text| text.parse().ok()).unwrap_or(50);
    let before = std::env::args().nth(2).map(|file| std::fs::read_to_string(file).expect("an earlier output"));
    let mut stars = Vec::new();
    println!("star profiles amplitude slope lifetime_d jitter_kms sigma_k_kms seconds");
    for seed in 1..=number {
        let begin = Instant::now();
        let config = star(seed);
        let campaign = Campaign::of(&config, &[], &|_| ()).expect("a campaign").remove(0);
        let range = range_d(std::slice::from_ref(&campaign), FrequencySettings::default()).expect("periods");
        let prot = campaign.imager.star.rotation_period_d;
        let periods = compared_d(std::slice::from_ref(&campaign), range);
        let per_cycle: Vec<f64> = periods.iter().map(|period_d| prot / period_d).collect();
        let (sigma, assumed) =
            achieved(&config, &per_cycle, before.as_ref().and_then(|text| fitted_before(text, seed)));
        let Assumed { field: Field { spectrum, kernel }, jitter_kms, .. } = assumed;
        let lifetime_d = kernel.lifetime.days().unwrap_or(f64::INFINITY);
        println!(
            "{seed} {} {:.4} {:.3} {lifetime_d:.2} {jitter_kms:.4} {:.5} {:.1}",
            campaign.all().len(),
            spectrum.amplitude,
            spectrum.slope,
            median(sigma.iter().copied()),
            begin.elapsed().as_secs_f64()
        );
        stars.push(Star { campaign, range, per_cycle, sigma, assumed });
    }
    let of = |number: fn(&Assumed) -> f64| median(stars.iter().map(|star| number(&star.assumed)));
    let (amplitude, slope) =
        (of(|assumed| assumed.field.spectrum.amplitude), of(|assumed| assumed.field.spectrum.slope));
    let spectrum = Spectrum { amplitude, slope, ..stars[0].assumed.field.spectrum };
    let lifetime = of(|assumed| assumed.field.kernel.lifetime.days().unwrap_or(f64::INFINITY));
    let field = Field { spectrum, kernel: Kernel::of(Lifetime::Days(lifetime)) };
    let typical = Assumed { field, jitter_kms: 0.0, night_kms: 0.0 };
    println!("typical spots: {typical:?}");
    println!("achieved over forecast sigma_K: median over stars of the median over periods, scatter of the stars,");
    println!("largest deviation of a period's median over stars");
    let told = |star: &Star| {
        let field = star.campaign.assumed.field;
        let kernel = Kernel::of(Lifetime::Days(LIFETIME_D));
        Assumed { field: Field { kernel, ..field }, ..star.campaign.assumed }
    };
    type Way<'a> = (&'a str, &'a dyn Fn(&Star) -> (Assumed, usize));
    let ways: [Way; 5] = [
        ("usual spots", &|star| (star.campaign.assumed, 8)),
        ("usual spots of their lifetime", &|star| (told(star), 8)),
        ("typical spots", &|_| (typical, 8)),
        ("typical spots, at a star without spots", &|_| (typical, 0)),
        ("the star's own spots", &|star| (star.assumed, 8)),
    ];
    for (name, way) in ways {
        let ratios: Vec<Vec<f64>> = stars
            .iter()
            .map(|star| {
                let (assumed, maps) = way(star);
                let forecast = forecast(&star.campaign, assumed, star.range, &star.per_cycle, maps);
                star.sigma.iter().zip(forecast).map(|(achieved, forecast)| achieved / forecast).collect()
            })
            .collect();
        let (middle, scatter) = spread(&ratios.iter().map(|of| median(of.iter().copied())).collect::<Vec<_>>());
        let by_period = (0..ratios[0].len()).map(|k| median(ratios.iter().map(|of| of[k])));
        let largest = by_period.map(|ratio| (ratio - 1.0).abs()).fold(0.0, f64::max);
        println!("{name}: {middle:.3} +- {scatter:.3}, {largest:.3}");
    }
}
