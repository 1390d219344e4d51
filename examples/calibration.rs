//! Calibration of the periodogram on simulated stars: false-alarm probabilities of stars without a planet, and credible
//! intervals of stars with one. Every star has its own spots and its own noise.
//!
//!     cargo run --release --example calibration -- 300 results/calibration
//!
//! writes null.csv and planet.csv (one line per star) and prints the tables of `results/calibration.md`.

use dimcmc::internals::data::config;
use dimcmc::internals::data::io::csv::Table;
use dimcmc::internals::data::scene::Scene;
use dimcmc::internals::data::simulate::Simulation;
use dimcmc::internals::inference::detection::{Detection, DetectionSettings};
use dimcmc::internals::model::{FreeParameter, Parameter, ParameterSpace, ParameterValues, Prior};
use dimcmc::internals::planets::periodogram::{Frequencies, FrequencySettings, Search, SearchSettings};
use dimcmc::internals::star::Spot;
use dimcmc::internals::surface::SurfaceSettings;
use dimcmc::internals::surface::expansion::Expansion;
use dimcmc::internals::surface::imaging::Imager;
use dimcmc::internals::surface::static_map::Reference;
use dimcmc::internals::surface::surrogate::Surrogate;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::path::Path;

/// Semi-amplitude of the planets (km/s).
const K_KMS: f64 = 0.06;

/// Draws of each star's posterior.
const DRAWS: usize = 2000;

/// Periods within this fraction of the rotation period are near co-rotation.
const NEAR: f64 = 0.15;

type Failure = Box<dyn std::error::Error + Send + Sync>;

fn main() -> Result<(), Failure> {
    let mut args = std::env::args().skip(1);
    let stars: usize = args.next().as_deref().unwrap_or("300").parse()?;
    let folder = args.next().unwrap_or_else(|| "results/calibration".into());
    std::fs::create_dir_all(&folder)?;
    let scene = Scene::load("configs/demo.json".as_ref())?;
    let config::ObservationSource::Simulate(simulation) = &scene.settings.sets[0].source else {
        return Err("configs/demo.json does not simulate".into());
    };
    let null: Vec<NullStar> = in_parallel(stars, |seed| null_star(&scene, simulation, seed))?;
    NullStar::table(&null, Path::new(&folder))?;
    let planets: Vec<PlanetStar> = in_parallel(stars, |seed| planet_star(&scene, simulation, seed))?;
    PlanetStar::table(&planets, Path::new(&folder))
}

fn in_parallel<T: Send>(stars: usize, star: impl Fn(u64) -> Result<T, Failure> + Sync) -> Result<Vec<T>, Failure> {
    (0..stars).into_par_iter().with_max_len(1).map(|seed| star(seed as u64)).collect()
}

/// A star like the demo's with its own spots and noise.
fn star(scene: &Scene, like: &Simulation, seed: u64, orbit: Option<(f64, f64)>) -> (Imager, ParameterValues) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut spot = || Spot {
        longitude: rng.random_range(0.0..std::f64::consts::TAU),
        latitude: rng.random_range(-0.3f64..1.0).asin(),
        radius: rng.random_range(5f64..17.0).to_radians(),
        filling: rng.random_range(0.5..0.92),
        life: None,
    };
    let spots = (0..12).map(|_| spot()).collect();
    let mut truth = scene.settings.values;
    let (period, phi) = orbit.unwrap_or((1.7, 0.5));
    truth.set(Parameter::K, if orbit.is_some() { K_KMS } else { 0.0 });
    truth.set(Parameter::PorbOverProt, period);
    truth.set(Parameter::Phi, phi);
    let simulation = Simulation { spots, truth, seed: 1000 + seed, ..like.clone() };
    let star = scene.imager.star.clone();
    let observations = simulation.observe(&star);
    let imaging = &scene.settings.imaging;
    (Imager::new(star, &observations, imaging.pixels, imaging.entropy()), truth)
}

fn frequencies(imager: &Imager) -> Result<Frequencies, Failure> {
    let settings = FrequencySettings::default();
    Ok(Frequencies::new(&imager.cycles(), imager.star.rotation_period_d, settings)?)
}

fn detect(scene: &Scene, imager: &Imager, draws: usize) -> Result<Detection, Failure> {
    let settings = DetectionSettings {
        search: SearchSettings { draws, seed: 1 },
        ..DetectionSettings::of(SurfaceSettings::spottedness(scene.chi2_target), Vec::new())
    };
    Ok(Detection::find(imager, scene.settings.values, frequencies(imager)?, &settings, &|_| ())?)
}

/// Results for a star without a planet.
struct NullStar {
    chi2_per_datum: f64,
    unresolved_spots: f64,
    /// Of the highest peak, for each of [`MODELS`].
    delta_ln_l: [f64; 2],
    porb_over_prot: [f64; 2],
    false_alarm: [f64; 2],
}

/// Models of the residual (unresolved-spot) noise.
const MODELS: [&str; 2] = ["as the entropy has it", "fitted"];

fn null_star(scene: &Scene, like: &Simulation, seed: u64) -> Result<NullStar, Failure> {
    let (imager, _) = star(scene, like, seed, None);
    let frequencies = frequencies(&imager)?;
    let found = detect(scene, &imager, 10_000)?;
    let view = &found.planet_free;
    let reference = view.solution::<Reference>().expect("a static map");
    let trusting = Search::new(&view.regularised, &frequencies, SearchSettings { draws: 10_000, seed: 1 })?;
    let both = [&trusting, &found.blind];
    let height = |search: &Search| search.best().orbit.delta_ln_l;
    Ok(NullStar {
        chi2_per_datum: reference.solution.chi2 / imager.data.depth.len() as f64,
        unresolved_spots: view.unresolved_spots,
        delta_ln_l: both.map(height),
        porb_over_prot: both.map(|search| search.best().porb_over_prot),
        false_alarm: both.map(|search| search.false_alarm.probability(height(search)).value()),
    })
}

impl NullStar {
    fn table(stars: &[NullStar], folder: &Path) -> Result<(), Failure> {
        let columns = "chi2_per_datum,unresolved_spots,delta_ln_l_entropy,porb_over_prot_entropy,false_alarm_entropy,\
                       delta_ln_l,porb_over_prot,false_alarm";
        let mut csv = Table::new(&columns.split(',').collect::<Vec<_>>());
        for star in stars {
            let of = |i: usize| [star.delta_ln_l[i], star.porb_over_prot[i], star.false_alarm[i]];
            csv.row(&[&[star.chi2_per_datum, star.unresolved_spots][..], &of(0), &of(1)].concat());
        }
        std::fs::write(folder.join("null.csv"), csv.into_bytes())?;
        println!("{} stars without a planet\n", stars.len());
        println!("| unresolved spots | KS distance | p | below 1 % | below 5 % | below 10 % | below 50 % |");
        println!("|---|---|---|---|---|---|---|");
        for (i, name) in MODELS.into_iter().enumerate() {
            let mut values: Vec<f64> = stars.iter().map(|star| star.false_alarm[i]).collect();
            values.sort_by(f64::total_cmp);
            let (distance, p) = kolmogorov_smirnov(&values);
            let below = |level: f64| share(values.iter().filter(|v| **v <= level).count(), values.len());
            let shares = [0.01, 0.05, 0.1, 0.5].map(below).join(" | ");
            println!("| {name} | {distance:.3} | {p:.2e} | {shares} |");
        }
        println!();
        Ok(())
    }
}

/// Results for a star with a planet.
struct PlanetStar {
    porb_over_prot: f64,
    /// Highest peak of the blind search, and its false-alarm probability.
    delta_ln_l: f64,
    found_porb_over_prot: f64,
    false_alarm: f64,
    k_kms: f64,
    sigma_k_kms: f64,
    /// For each of [`MODELS`], the fraction of the posterior below the truth in K, Porb/Prot, phi (within half a turn).
    ranks: [[f64; 3]; 2],
}

fn planet_star(scene: &Scene, like: &Simulation, seed: u64) -> Result<PlanetStar, Failure> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(1);
    let (period, phi) = (rng.random_range(0.5f64.ln()..4f64.ln()).exp(), rng.random::<f64>());
    let (imager, truth) = star(scene, like, 10_000 + seed, Some((period, phi)));
    let found = detect(scene, &imager, 2000)?;
    let peak = found.blind.best();
    let free = [
        (Parameter::K, Prior::Uniform { min: 0.0, max: 0.3 }),
        (Parameter::PorbOverProt, Prior::LogUniform { min: 0.5, max: 4.0 }),
        (Parameter::Phi, Prior::Periodic),
    ];
    let free = free.into_iter().map(|(parameter, prior)| FreeParameter { parameter, prior }).collect();
    let reference = found.last().solution::<Reference>().expect("a static map");
    let (mid, base) = (imager.mid_cycle(), imager.time_base_cycles());
    let space = ParameterSpace::new(free, reference.values, mid, base, imager.star.rotation_period_d);
    let expansion = Expansion::of(&imager, reference, &[]);
    let honest = &found.last().quadratic;
    let fitted = Expansion {
        gradient: &honest.gradient - &honest.information * &expansion.centre,
        information: honest.information.clone(),
        ..expansion.clone()
    };
    let ranks = [&expansion, &fitted].map(|expansion| {
        let surrogate = Surrogate::of_expansion(expansion, &space, &imager)?;
        let draws = (0..DRAWS).filter_map(|_| Some(space.to_physical(&surrogate.draw(&mut rng)?)));
        Some(ranks(&draws.collect::<Vec<_>>(), [truth[Parameter::K], period, phi]))
    });
    let [Some(entropy), Some(fitted)] = ranks else { return Err("the likelihood has no maximum".into()) };
    Ok(PlanetStar {
        porb_over_prot: period,
        delta_ln_l: peak.orbit.delta_ln_l,
        found_porb_over_prot: found.best.porb_over_prot,
        false_alarm: found.blind.false_alarm.probability(peak.orbit.delta_ln_l).value(),
        k_kms: found.best.orbit.k_kms,
        sigma_k_kms: found.best.orbit.sigma_k_kms,
        ranks: [entropy, fitted],
    })
}

/// Fraction of the draws below the truth; for phases, around their mean direction.
fn ranks(draws: &[Vec<f64>], truth: [f64; 3]) -> [f64; 3] {
    let share =
        |below: &dyn Fn(&Vec<f64>) -> bool| draws.iter().filter(|d| below(d)).count() as f64 / draws.len() as f64;
    let turn = |phi: f64| (std::f64::consts::TAU * phi).sin_cos();
    let (sin, cos) = draws.iter().map(|d| turn(d[2])).fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
    let centre = sin.atan2(cos) / std::f64::consts::TAU;
    let from_centre = |phi: f64| phi - centre - (phi - centre).round();
    [share(&|d| d[0] < truth[0]), share(&|d| d[1] < truth[1]), share(&|d| from_centre(d[2]) < from_centre(truth[2]))]
}

impl PlanetStar {
    fn near(&self) -> bool {
        (self.porb_over_prot - 1.0).abs() < NEAR
    }

    fn table(stars: &[PlanetStar], folder: &Path) -> Result<(), Failure> {
        let columns = "porb_over_prot,found_porb_over_prot,delta_ln_l,false_alarm,k_kms,sigma_k_kms,rank_k_entropy,\
                       rank_p_entropy,rank_phi_entropy,rank_k,rank_p,rank_phi";
        let mut csv = Table::new(&columns.split(',').collect::<Vec<_>>());
        for s in stars {
            let found = [s.porb_over_prot, s.found_porb_over_prot, s.delta_ln_l, s.false_alarm, s.k_kms, s.sigma_k_kms];
            csv.row(&[&found[..], &s.ranks.concat()].concat());
        }
        std::fs::write(folder.join("planet.csv"), csv.into_bytes())?;
        println!("{} stars with a planet of {} m/s\n", stars.len(), 1000.0 * K_KMS);
        println!("| period | stars | unresolved spots | K 68 % | K 95 % | P 68 % | P 95 % | phi 68 % | phi 95 % |");
        println!("|---|---|---|---|---|---|---|---|---|");
        let all: Vec<&PlanetStar> = stars.iter().collect();
        let (near, away): (Vec<&PlanetStar>, Vec<&PlanetStar>) = stars.iter().partition(|s| s.near());
        let groups = [("all", all), ("away from co-rotation", away), ("within 15 % of co-rotation", near)];
        for (name, group) in &groups {
            for (m, model) in MODELS.into_iter().enumerate() {
                let inside = |i: usize, level: f64| {
                    let count = group.iter().filter(|s| (s.ranks[m][i] - 0.5).abs() < 0.5 * level).count();
                    share(count, group.len())
                };
                let cells: Vec<String> = (0..3).flat_map(|i| [inside(i, 0.68), inside(i, 0.95)]).collect();
                println!("| {name} | {} | {model} | {} |", group.len(), cells.join(" | "));
            }
        }
        println!("\n| period | stars | FAP below 1 % | and at the right period |\n|---|---|---|---|");
        for (name, group) in &groups {
            let found = |s: &&&PlanetStar| s.false_alarm < 0.01;
            // within a third of the resolution of the time base
            let right = |s: &&&PlanetStar| (1.0 / s.porb_over_prot - 1.0 / s.found_porb_over_prot).abs() < 0.12;
            let detected = share(group.iter().filter(found).count(), group.len());
            let rightly = share(group.iter().filter(found).filter(right).count(), group.len());
            println!("| {name} | {} | {detected} | {rightly} |", group.len());
        }
        Ok(())
    }
}

/// A fraction in per cent with its binomial error.
fn share(count: usize, of: usize) -> String {
    let n = of.max(1) as f64;
    let p = count as f64 / n;
    format!("{:.1} +- {:.1} %", 100.0 * p, 100.0 * (p * (1.0 - p) / n).sqrt())
}

/// Distance of sorted values from the uniform distribution, and the probability of a larger one by chance (Kolmogorov).
fn kolmogorov_smirnov(sorted: &[f64]) -> (f64, f64) {
    let n = sorted.len() as f64;
    let distance = sorted.iter().enumerate().map(|(i, x)| (x - i as f64 / n).abs().max(((i + 1) as f64 / n - x).abs()));
    let distance = distance.fold(0.0, f64::max);
    let z = distance * (n.sqrt() + 0.12 + 0.11 / n.sqrt());
    let p = (1..100).map(|k| 2.0 * (-1f64).powi(k - 1) * (-2.0 * (k as f64 * z).powi(2)).exp()).sum::<f64>();
    (distance, p.clamp(0.0, 1.0))
}
