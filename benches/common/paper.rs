//! The paper's setup (Petit et al. 2015, section 2) at any size: a spotted star with a planet, 50 profiles over three
//! rotations in 57 bins; three or seven free parameters.

use dimcmc::internals::data::config::Config;
use dimcmc::internals::data::scene::Scene;
use dimcmc::internals::inference::search::{self, SearchSettings};
use dimcmc::internals::runs::pool::Target as Density;
use dimcmc::internals::sampling::ensemble::{StartDraw, draw_start};
use dimcmc::internals::star::{Response, StarState};
use dimcmc::internals::surface::static_map::Posterior;
use serde_json::{Value, json};
use std::hint::black_box;
use std::path::{Path, PathBuf};

/// The free parameters.
#[derive(Clone, Copy)]
pub enum Free {
    /// The orbit: K, period, phase.
    Three,
    /// Also both rotations, inclination and vsini.
    Seven,
}

impl Free {
    pub fn name(self) -> &'static str {
        match self {
            Free::Three => "3-D",
            Free::Seven => "7-D",
        }
    }

    fn config(self) -> &'static str {
        match self {
            Free::Three => "configs/demo.json",
            Free::Seven => "configs/paper_7d.json",
        }
    }
}

/// Pixels, profiles and velocity bins.
#[derive(Clone, Copy)]
pub struct Size {
    pub pixels: usize,
    pub profiles: usize,
    pub step_kms: f64,
}

impl Size {
    /// The paper's profiles and bins on a map of that many pixels.
    pub fn pixels(pixels: usize) -> Self {
        Size { pixels, profiles: 50, step_kms: 1.8 }
    }
}

/// A file of this repository.
pub fn file(name: &str) -> PathBuf {
    let above = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors();
    above.map(|folder| folder.join(name)).find(|path| path.exists()).expect("the benches are in the repository")
}

/// The scene, its start at the injected values.
pub fn scene(free: Free, size: Size) -> Scene {
    let path = file(free.config());
    let mut config: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    config["imaging"]["pixels"] = json!(size.pixels);
    let simulate = &mut config["observations"]["simulate"];
    simulate["velocity_kms"]["step"] = json!(size.step_kms);
    let spacing = 3.0 / size.profiles as f64;
    simulate["cycles"] = (0..size.profiles).map(|k| json!(k as f64 * spacing)).collect();
    let truth = simulate["truth"].as_object().cloned().unwrap_or_default();
    for (name, value) in truth {
        let section = if config["star"].get(&name).is_some() || name == "omega_eq_rad_d" { "star" } else { "planet" };
        config[section][&name] = value;
    }
    Scene::new(&Config::at(config, &path)).unwrap()
}

/// The star as injected.
pub fn truth(scene: &Scene) -> StarState {
    scene.truth.expect("a simulation").state()
}

/// A map with structure on all scales: no two neighbours alike.
pub fn uneven_map(pixels: usize) -> Vec<f64> {
    (0..pixels).map(|p| 0.8 + 0.2 * (0.7 * p as f64).sin()).collect()
}

/// Passes alone: maps and profiles are made before the timing.
pub struct Passes {
    from: [Vec<f64>; 3],
    to: [Vec<f64>; 3],
    single: [Vec<f32>; 2],
}

impl Passes {
    pub fn new(response: &Response) -> Self {
        let from = [response.pixels(), response.data_len(), response.profiles()].map(uneven_map);
        let single: Vec<f32> = from[0].iter().map(|x| *x as f32).collect();
        Passes { to: from.clone(), from, single: [single.clone(), single] }
    }

    /// That many passes, forward and transpose in turn.
    pub fn run(&mut self, response: &Response, passes: u32) {
        let ([x, y, z], [map, line, continuum]) = (&self.from, &mut self.to);
        for pass in 0..passes {
            match pass % 2 {
                0 => response.apply(black_box(x), line, continuum),
                _ => response.apply_transpose(black_box(y), black_box(z), map),
            }
        }
        black_box(&self.to);
    }

    /// That many passes, forward and back, in single precision.
    pub fn run_single(&mut self, response: &Response, passes: u32) {
        let [x, map] = &mut self.single;
        for _ in 0..passes / 2 {
            response.apply_and_back(black_box(x), map, |_, _, continuum| continuum);
        }
        black_box(&self.single);
    }
}

/// A posterior and points drawn from its bulk: a Gaussian around the maximum, with the covariance from the curvature
/// there.
pub struct Bulk {
    pub posterior: Posterior,
    /// The density of a chain: the posterior with its warm starts.
    pub target: Density,
    pub points: Vec<Vec<f64>>,
}

impl Bulk {
    /// The posterior around its maximum, where a search from the injected values has put the reference.
    pub fn new(scene: &Scene, points: usize) -> Self {
        let settings = SearchSettings { other_starts: 0, ..scene.search_settings() };
        let found = search::find(&scene.imager, &scene.space, settings, &|_| ()).unwrap();
        let draw = StartDraw {
            centre: &found.optimum.theta,
            covariance: &found.optimum.covariance,
            scale: 1.0,
            ensembles: 1,
            walkers: points,
            seed: 1,
        };
        let allowed = |theta: &[f64]| scene.space.log_prior(theta).is_finite();
        let points = draw_start(&*found.posterior, &draw, &allowed).unwrap().remove(0);
        let target = Density::new(found.posterior.clone(), scene.settings.imaging.unresolved_spots).unwrap();
        let posterior = Posterior::behind(&*found.posterior).expect("a static map").clone();
        Bulk { posterior, target, points }
    }
}
