//! Profiles that are exposed for long, while the star rotates, against the mean of many short ones.

use super::common::{dot, wave};
use dimcmc::internals::star::{
    Exposure, LimbDarkening, LocalLine, Nearby, Orbit, OwnMap, Quadrature, Regions, Response, Rotation, Sampling, Seen,
    StarSettings, StarState, SurfaceGrid,
};
use dimcmc::{Config, Scene};
use serde_json::{Value, json};

const PROT_D: f64 = 3.0;
const VSINI_KMS: f64 = 30.0;

fn star(regions: Regions) -> StarSettings {
    StarSettings {
        rotation_period_d: PROT_D,
        epoch_d: 0.4,
        limb_darkening: LimbDarkening::Linear(0.7),
        contrast: 0.5,
        line: LocalLine::gaussian(3.0, 5.8),
        regions,
    }
}

fn state(vsini_kms: f64) -> StarState {
    StarState {
        rotation: Rotation { omega_eq_rad_d: std::f64::consts::TAU / PROT_D, domega_rad_d: 0.05 },
        inclination: 0.9,
        vsini_kms,
        vsys_kms: 0.3,
        motion: Orbit { k_kms: 0.1, porb_over_prot: 1.7, phi: 0.4 }.into(),
        surface: Default::default(),
    }
}

const TIMES_D: [f64; 4] = [0.1, 1.3, 2.05, 4.9];

/// Lengths (d): an instant, half a per cent of a rotation, five and ten per cent.
const LENGTHS_D: [f64; 4] = [0.0, 0.005 * PROT_D, 0.05 * PROT_D, 0.1 * PROT_D];

fn sampling(times_d: &[f64]) -> Sampling {
    Sampling { step_kms: 1.8, profiles: times_d.iter().map(|time_d| (*time_d, -50.4, 57)).collect() }
}

fn seen(star: &StarSettings, lengths_d: &[f64]) -> Seen {
    let mut seen = Seen::from(sampling(&TIMES_D));
    seen.exposures = seen.exposures(star, &state(VSINI_KMS), lengths_d);
    seen
}

/// Filling of a dark spot of 10 degrees and of a grey half of the star: pixels.
fn brightness(grid: &SurfaceGrid) -> Vec<f64> {
    let value = |p: usize| {
        let (longitude, latitude) = (grid.longitude[p], grid.latitude[p]);
        let (sin, cos) = latitude.sin_cos();
        let near = 0.35_f64.sin() * sin + 0.35_f64.cos() * cos * (longitude - 3.03).cos();
        let spot = if near > 10_f64.to_radians().cos() { 0.2 } else { 1.0 };
        spot * (0.9 + 0.1 * longitude.sin() * cos)
    };
    (0..grid.len()).map(value).collect()
}

/// Line and continuum of every profile.
fn applied(response: &Response, map: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let (mut line, mut continuum) = (vec![0.0; response.data_len()], vec![0.0; response.profiles()]);
    response.apply(map, &mut line, &mut continuum);
    (line, continuum)
}

/// The mean of 50 short profiles of each exposure, all with the velocity of its middle.
fn fine_mean(grid: &SurfaceGrid, star: &StarSettings, state: &StarState, map: &[f64]) -> (Vec<f64>, Vec<f64>) {
    const SHORT: usize = 50;
    let (mut line, mut continuum) = (vec![0.0; 57 * TIMES_D.len()], vec![0.0; TIMES_D.len()]);
    for (k, (time_d, length_d)) in TIMES_D.iter().zip(LENGTHS_D).enumerate() {
        let velocity = |time_d: f64| state.motion.velocity_kms(star.cycle(time_d));
        let times_d = (0..SHORT).map(|j| time_d + length_d * ((j as f64 + 0.5) / SHORT as f64 - 0.5));
        let of = |t: f64| (t, -50.4 + velocity(t) - velocity(*time_d), 57);
        let sampling = Sampling { step_kms: 1.8, profiles: times_d.map(of).collect() };
        let (lines, continua) = applied(&Response::new(grid, star, state, &sampling), map);
        for (j, depth) in lines.iter().enumerate() {
            line[57 * k + j % 57] += depth / SHORT as f64;
        }
        continuum[k] = continua.iter().sum::<f64>() / SHORT as f64;
    }
    (line, continuum)
}

fn largest(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn a_long_exposure_is_the_mean_of_fifty_short_ones() {
    let grid = SurfaceGrid::equal_area(5000, Quadrature::Gauss2x2);
    let map = brightness(&grid);
    let plages = Regions { line_width: 1.24, equivalent_width: 1.07, shift_kms: 0.27, area: 2.3, ..Regions::PLAIN };
    let limb = Regions { area_limb: 0.4, dimming_limb: -0.5, ..plages };
    for regions in [Regions::PLAIN, plages, limb] {
        let star = star(regions);
        let seen = seen(&star, &LENGTHS_D);
        assert_eq!(seen.exposures.iter().map(|exposure| exposure.looks).collect::<Vec<_>>(), [1, 2, 5, 8]);
        let sets = [seen];
        let state = state(VSINI_KMS);
        let response = Response::of_sets(&grid, &star, &state, &sets);
        let (line, continuum) = applied(&response, &map);
        let (wanted, wanted_continuum) = fine_mean(&grid, &star, &state, &map);
        let deepest = wanted.iter().copied().fold(0.0, f64::max);
        // the spot is 2 % of the depth, the quadrature is good to a thousandth of that
        assert!(largest(&line, &wanted) < 3e-5 * deepest, "{}", largest(&line, &wanted) / deepest);
        assert!(largest(&continuum, &wanted_continuum) < 3e-5, "{}", largest(&continuum, &wanted_continuum));
        // without exposures profiles are off by more than their noise at 1000
        let (instant, _) = applied(&Response::new(&grid, &star, &state, &sampling(&TIMES_D)), &map);
        assert_eq!(instant[..57], line[..57], "an instant is as it was");
        assert!(largest(&instant, &wanted) > 2e-3 * deepest, "{}", largest(&instant, &wanted) / deepest);
        // the transpose
        let (y, z, mut back) = (wave(line.len(), 0.7), wave(continuum.len(), 1.1), vec![0.0; map.len()]);
        let (mut change, mut continuum) = (line.clone(), continuum.clone());
        response.change(&map, &mut change, &mut continuum);
        response.apply_transpose(&y, &z, &mut back);
        let (there, again) = (dot(&change, &y) + dot(&continuum, &z), dot(&map, &back));
        assert!((there - again).abs() < 1e-12 * there.abs().max(1.0), "{there} {again}");
        // a star near by, and another orbit
        let nearby = Nearby::new(&grid, &star, &state, &sets);
        let other = StarState { vsini_kms: 30.01, ..state };
        let close = nearby.response(&grid, &star, &other, &sets).expect("a star close by");
        let (sorted, _) = applied(&Response::of_sets(&grid, &star, &other, &sets), &map);
        assert!(largest(&applied(&close, &map).0, &sorted) < 3e-7 * deepest);
        let moved = StarState { vsys_kms: 0.9, ..state };
        let shifted = response.with_velocities(&star, &moved, &sets);
        let (anew, _) = applied(&Response::of_sets(&grid, &star, &moved, &sets), &map);
        assert_eq!(applied(&shifted, &map).0, anew);
    }
}

#[test]
fn derivatives_by_vsini_and_rotation_are_those_of_the_mean() {
    let grid = SurfaceGrid::equal_area(5000, Quadrature::Gauss2x2);
    let (map, star) = (brightness(&grid), star(Regions::PLAIN));
    let sets = [seen(&star, &LENGTHS_D)];
    let faster = |h: f64| StarState { vsini_kms: VSINI_KMS + h, ..state(VSINI_KMS) };
    let turning = |h: f64| {
        let mut state = state(VSINI_KMS);
        state.rotation.omega_eq_rad_d += h;
        state
    };
    let all: [(&dyn Fn(f64) -> StarState, f64); 2] = [(&faster, 0.2), (&turning, 0.01)];
    for (at, h) in all {
        let slope = |of: &dyn Fn(&StarState) -> Vec<f64>| -> Vec<f64> {
            let (above, below) = (of(&at(h)), of(&at(-h)));
            above.iter().zip(below).map(|(a, b)| (a - b) / (2.0 * h)).collect()
        };
        let smeared = slope(&|state| applied(&Response::of_sets(&grid, &star, state, &sets), &map).0);
        let wanted = slope(&|state| fine_mean(&grid, &star, state, &map).0);
        let steepest = wanted.iter().fold(0.0, |s: f64, x| s.max(x.abs()));
        assert!(largest(&smeared, &wanted) < 1e-3 * steepest, "{}", largest(&smeared, &wanted) / steepest);
    }
}

#[test]
fn several_maps_each_have_their_exposures() {
    let grid = SurfaceGrid::equal_area(2000, Quadrature::Gauss2x2);
    let star = star(Regions::PLAIN);
    let mut set = seen(&star, &LENGTHS_D);
    set.own_maps = [0, 0, 1, 1].map(|number| OwnMap { number, epoch_d: star.epoch_d }).to_vec();
    let two = Response::of_sets(&grid, &star, &state(VSINI_KMS), &[set.clone()]);
    let one = Response::of_sets(&grid, &star, &state(VSINI_KMS), &[Seen { own_maps: Vec::new(), ..set }]);
    let map = brightness(&grid);
    let other: Vec<f64> = map.iter().map(|x| x * x).collect();
    let (line, _) = applied(&two, &[map.clone(), other.clone()].concat());
    assert_eq!(line[..2 * 57], applied(&one, &map).0[..2 * 57]);
    assert_eq!(line[2 * 57..], applied(&one, &other).0[2 * 57..]);
}

#[test]
fn short_exposures_and_none_are_instants() {
    let star = star(Regions::PLAIN);
    // a tenth of a bin is passed in 0.0029 d
    assert_eq!(seen(&star, &[0.0, 0.001, 0.002, 0.0028]).exposures, []);
    assert_eq!(seen(&star, &[0.0, 0.0, 0.0, 0.0029]).exposures[3], Exposure { length_d: 0.0029, looks: 2 });
}

/// A star with one long night of profiles, simulated.
fn config(objective: &str, exposure_s: Option<f64>) -> Value {
    let cycles: Vec<f64> = (0..12).map(|k| 0.29 * f64::from(k)).collect();
    let mut config = json!({
        "star": { "rotation_period_d": 1.0, "inclination_deg": 60.0, "vsini_kms": 30.0, "contrast": 0.3,
                  "line": { "sigma_kms": 3.0, "equivalent_width_kms": 6.0 } },
        "planet": { "k_kms": 0.1, "porb_over_prot": 2.3, "phi": 0.2 },
        "observations": { "simulate": {
            "random_spots": { "number": 8, "seed": 4 }, "cycles": cycles,
            "velocity_kms": { "min": -45.0, "max": 45.0, "step": 1.8 }, "pixels": 4000 } },
        "imaging": { "pixels": 500, "objective": objective },
        "parameters": { "k_kms": { "prior": "uniform", "min": 0.0, "max": 0.3 } }
    });
    if let Some(exposure_s) = exposure_s {
        config["observations"]["exposure_s"] = json!(exposure_s);
    }
    config
}

fn scene(config: &Value) -> Result<Scene, String> {
    let config = Config::from_json(&config.to_string()).map_err(|e| e.to_string())?;
    Scene::new(&config).map_err(|e| e.to_string())
}

#[test]
fn the_key_reaches_model_and_simulation() {
    let without = scene(&config("spottedness", None)).unwrap();
    assert!(without.imager.sets[0].exposures.is_empty());
    assert!(without.observations.profiles.iter().all(|profile| profile.exposure_s.is_none()));
    // 5 % of a rotation
    let with = scene(&config("spottedness", Some(4320.0))).unwrap();
    assert_eq!(with.imager.sets[0].exposures, [Exposure { length_d: 0.05, looks: 5 }; 12]);
    let depths = |scene: &Scene| scene.imager.data.depth.clone();
    assert!(largest(&depths(&with), &depths(&without)) > 1e-3, "{}", largest(&depths(&with), &depths(&without)));
    // too short to matter: the same bytes
    let short = scene(&config("spottedness", Some(20.0))).unwrap();
    assert!(short.imager.sets[0].exposures.is_empty());
    assert_eq!(depths(&short), depths(&without));
    // without some profiles each has its own
    let some = with.imager.without(&[0, 3]);
    assert_eq!((some.sets[0].exposures.len(), some.sets[0].sampling.profiles.len()), (10, 10));
}

#[test]
fn exposures_that_are_too_long_are_refused() {
    for (exposure_s, problem) in [
        (8650.0, "8650 s is 0.1001 of a rotation (star.rotation_period_d 1 d), at most 0.1 is modelled"),
        (-1.0, "-1 s must be 0 or more"),
    ] {
        let message = scene(&config("spottedness", Some(exposure_s))).expect_err("refused");
        assert!(message.contains(&format!("observations.exposure_s: {problem}")), "{message}");
    }
    assert!(scene(&config("spottedness", Some(8640.0))).is_ok());
}
