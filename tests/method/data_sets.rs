//! Several data sets of one star: each is modelled as if it were alone, and RV offsets between them do not become
//! spots.

use dimcmc::NoMaps;
use dimcmc::internals::maxent::Problem;
use dimcmc::internals::star::{Response, StarSettings};
use dimcmc::internals::surface::ReferenceError;
use dimcmc::internals::surface::calibration::offsets::HeldZeroPoint;
use dimcmc::internals::surface::evolving_map::{Basis, Design};
use dimcmc::internals::surface::imaging::Imager;
use dimcmc::internals::surface::static_map::Reference;
use dimcmc::{Config, Parameter, Scene};
use nalgebra::DMatrix;
use serde_json::{Value, json};

const OFFSET_KMS: f64 = 0.3;

/// Two spectrographs in two seasons, the second with an RV offset to the red.
fn config() -> Value {
    json!({
        "star": { "rotation_period_d": 3.0, "inclination_deg": 60.0, "vsini_kms": 25.0,
                  "photosphere_k": 4500, "spot_k": 3400, "line": { "sigma_kms": 3.0, "equivalent_width_kms": 6.0 } },
        "planet": { "k_kms": 0.15, "porb_over_prot": 1.7, "phi": 0.3 },
        "imaging": { "pixels": 250, "objective": "marginal-likelihood" },
        "observations": [
            { "name": "first", "resolving_power": 50000,
              "simulate": { "random_spots": { "number": 10, "lifetime_d": 30, "seed": 4 },
                            "cycles": [0.0, 0.31, 0.66, 1.02, 1.35, 1.68, 2.01, 2.33],
                            "velocity_kms": { "min": -36.0, "max": 36.0, "step": 2.4 }, "pixels": 3000 } },
            { "name": "second", "resolving_power": 110000, "wavelength_nm": 700, "zero_point_kms": "fitted",
              "nuisances": { "continuum_offset": 1e-3 },
              "simulate": { "cycles": [83.1, 83.43, 83.78, 84.09, 84.44, 84.75, 85.1, 85.42],
                            "velocity_kms": { "min": -34.0, "max": 34.0, "step": 1.9 }, "snr": 700, "seed": 2,
                            "zero_point_kms": OFFSET_KMS, "pixels": 3000 } }
        ]
    })
}

fn scene(config: &Value) -> Scene {
    Scene::new(&Config::from_json(&config.to_string()).unwrap()).unwrap()
}

/// The star for one set.
fn alone(s: usize) -> Scene {
    let mut one = config();
    let mut set = one["observations"][s].clone();
    set.as_object_mut().unwrap().remove("zero_point_kms");
    set["simulate"]["spots"] = json!([]);
    one["observations"] = json!([set]);
    scene(&one)
}

#[test]
fn each_set_is_seen_as_if_it_were_alone() {
    let mut known = config();
    known["observations"][1]["zero_point_kms"] = json!(0.0);
    let both = scene(&known);
    let state = both.settings.values.state();
    let map: Vec<f64> = (0..both.imager.grid.len()).map(|p| 0.9 + 0.1 * (0.3 * p as f64).sin()).collect();
    let together = both.imager.response(&state).depths(&map);
    let parts: Vec<Scene> = [0, 1].map(alone).into();
    let apart: Vec<f64> = parts.iter().flat_map(|one| one.imager.response(&state).depths(&map)).collect();
    assert_eq!(together, apart);
    assert!(parts[0].imager.star.contrast < parts[1].imager.star.contrast, "spots fade to the red");
    // a response near by, and one that is shifted, are those of the sets as well
    let nearby = both.imager.nearby(&state);
    let response = both.imager.response_near(&nearby, &state);
    let largest = |a: &[f64], b: &[f64]| a.iter().zip(b).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs()));
    assert!(largest(&response.depths(&map), &apart) < 1e-6);
    let mut moved = state;
    moved.vsys_kms += 0.7;
    assert_eq!(
        both.imager.with_velocities(&response, &moved).depths(&map),
        both.imager.with_velocities(&both.imager.response_near(&nearby, &moved), &moved).depths(&map)
    );
    // so are the data of a field, linearised anywhere
    let basis = Basis::new(&both.imager.grid);
    let coefficients = |profiles: usize| DMatrix::from_fn(basis.len(), profiles, |h, _| 0.02 * (h as f64).sin());
    let depths = |scene: &Scene| {
        let design = Design::new(&scene.imager, &basis, &state);
        let maps = coefficients(scene.imager.profiles().count());
        design.epochs(&scene.imager, &maps).into_iter().map(|epoch| epoch.misfit).collect::<Vec<_>>()
    };
    let in_one = depths(&both);
    // other spots were simulated of each alone: model and number of data are the same, noise and data are not
    let sizes: Vec<usize> = parts.iter().flat_map(&depths).map(|misfit| misfit.len()).collect();
    assert_eq!(in_one.iter().map(|misfit| misfit.len()).collect::<Vec<_>>(), sizes);
}

#[test]
fn each_season_has_the_map_that_it_would_have_alone() {
    let mut known = config();
    known["observations"][1]["zero_point_kms"] = json!(OFFSET_KMS);
    known["imaging"]["objective"] = json!("spottedness");
    let both = scene(&known);
    assert_eq!(both.imager.maps(), 2);
    // one exchange rate of entropy and chi2 for the mean map and each of the two: the season with more data has as much
    // as alone, the other less
    const LAMBDA: f64 = 1.0;
    let image = |imager: &Imager, lambda: f64| {
        let reference = Reference::at_lambda(imager, both.settings.values, lambda).unwrap();
        imager.entropy.image(&reference.solution.image.coordinates)
    };
    let data = |imager: &Imager| imager.data.depth.len() as f64;
    let together = image(&both.imager, LAMBDA);
    let seasons = both.imager.seasons();
    let most = seasons.iter().map(data).fold(0.0, f64::max);
    let alone = |season: &Imager| image(season, LAMBDA * data(season) / most);
    let apart: Vec<f64> = seasons.iter().flat_map(alone).collect();
    let off = together.iter().zip(&apart).fold(0.0, |off: f64, (a, b)| off.max((a - b).abs()));
    assert!(together.len() == apart.len() && off < 1e-3, "{off}");
    assert!(apart.iter().fold(0.0, |most: f64, s| most.max(*s)) > 0.3, "there are spots");
    // a static map for both fits neither
    known["imaging"]["season_gap_d"] = json!(1000.0);
    let one = Config::from_json(&known.to_string()).unwrap();
    let error = Scene::new(&one).unwrap().maps(None).unwrap_err();
    assert!(
        matches!(error, NoMaps::Reference(ReferenceError::TargetBelowFloor { floor, .. }) if floor > 1.1),
        "{error}"
    );
}

#[test]
fn rotation_turns_the_map_of_a_season_from_its_own_middle() {
    let mut known = config();
    known["observations"][1]["zero_point_kms"] = json!(OFFSET_KMS);
    known["imaging"]["objective"] = json!("entropy");
    let both = scene(&known);
    let mut values = both.settings.values;
    values.set(Parameter::K, 0.0);
    values.set(Parameter::DOmega, 0.08);
    let state = values.state();
    let n = both.imager.grid.len();
    let map: Vec<f64> = (0..n).map(|p| 0.9 + 0.1 * (0.3 * p as f64).sin()).collect();
    let response = both.imager.response(&state);
    let together = response.depths(&[map.clone(), map.clone()].concat());
    // 83.1 to 85.4 cycles of 3 d
    let epochs: Vec<f64> = both.measured.seasons.iter().map(|season| season.epoch_d).collect();
    assert_eq!(epochs, [3.0, 252.0]);
    let alone = |epoch_d: f64| {
        let star = StarSettings { epoch_d, ..both.imager.star.clone() };
        Imager { star, ..both.imager.clone().with_one_map() }.response(&state).depths(&map)
    };
    let second = response.bins(8).start;
    let apart = [&alone(epochs[0])[..second], &alone(epochs[1])[second..]].concat();
    assert_eq!(together, apart);
    // evolving maps have one epoch
    assert_eq!(scene(&config()).imager.maps(), 1);
}

#[test]
fn the_misfit_of_maps_has_its_gradient_where_contrasts_differ() {
    let mut known = config();
    known["observations"][1]["zero_point_kms"] = json!(0.0);
    known["imaging"]["objective"] = json!("spottedness");
    let both = scene(&known);
    let response: Response = both.imager.response(&both.settings.values.state());
    assert_ne!(response.contrast(0), response.contrast(8));
    let mut problem = both.imager.problem(response);
    // a map of each season
    let map: Vec<f64> = (0..both.imager.areas.len()).map(|p| 0.1 + 0.05 * (0.7 * p as f64).sin()).collect();
    assert_eq!(map.len(), 2 * both.imager.grid.len());
    problem.linearise(&map);
    let mut gradient = vec![0.0; map.len()];
    problem.gradient(&mut gradient);
    let direction: Vec<f64> = (0..map.len()).map(|p| (1.3 * p as f64).cos()).collect();
    let along: f64 = gradient.iter().zip(&direction).map(|(g, d)| g * d).sum();
    let mut at = |h: f64| {
        let map: Vec<f64> = map.iter().zip(&direction).map(|(m, d)| m + h * d).collect();
        0.5 * problem.linearise(&map)
    };
    const STEP: f64 = 1e-4;
    let difference = (at(STEP) - at(-STEP)) / (2.0 * STEP);
    // a central difference of a smooth function, to some STEP^2
    assert!((along / difference - 1.0).abs() < 1e-5, "{along} {difference}");
}

#[test]
fn a_zero_point_that_is_not_known_is_found_and_held() {
    let both = scene(&config());
    let HeldZeroPoint { held_kms, found } = both.measured.sets[1].zero_point.expect("a zero point");
    println!("{held_kms}");
    assert!((held_kms - OFFSET_KMS).abs() < 0.2, "{held_kms}");
    // its uncertainty is reported by commands that fit a model
    assert_eq!(found, None);
    assert!(both.measured.sets[0].zero_point.is_none());
    assert_eq!(both.observations.profiles.len(), 16);
    assert_eq!(both.imager.profiles_of(1), 8..16);
    // an injected orbit keeps the fitted RV offset fixed, without a new fit
    let injected = both.injected(&[]).unwrap();
    assert_eq!(injected.measured, both.measured);
    let firsts = |scene: &Scene| scene.imager.profiles().map(|profile| profile.1).collect::<Vec<f64>>();
    // fixed in one step rather than in several
    assert!(firsts(&injected).iter().zip(firsts(&both)).all(|(a, b)| (a - b).abs() < 1e-12));
    // without a night, sets and RV offsets keep their order
    let second = both.imager.without(&(0..8).collect::<Vec<_>>());
    assert_eq!((second.sets.len(), second.zero_points[0].set), (1, 0));
    assert_eq!(both.imager.without(&[3, 9]).sets[0].sampling.profiles.len(), 7);
    assert_eq!(both.settings.values[Parameter::K], 0.15);
    // nights of unknown offsets; 0 is known
    assert_eq!(both.imager.nights_of_sets().concat().len(), 16);
    let mut known = both.imager.clone();
    known.night_jitters_kms = vec![Some(0.0), None];
    let mut nights = known.nights_of_sets().concat();
    nights.sort_unstable();
    assert!(nights.into_iter().eq(8..16));
}
