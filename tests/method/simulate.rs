//! Simulated observations and first-moment velocities, against the oracle's star and against statistics.

use crate::common::{json, numbers, oracle};
use dimcmc::internals::data::config;
use dimcmc::internals::data::scene::{Scene, fingerprint};
use dimcmc::internals::posterior::simulate::{SIGMA_WITHOUT_NOISE, Simulation};
use dimcmc::internals::star::observation::{Observations, Profile};
use dimcmc::internals::star::{Disc, Facula, Quadrature, Spot, SurfaceGrid};
use std::path::Path;

/// The demo's star, which is the oracle's, with `change` made to its simulation.
fn demo(change: impl Fn(&mut Simulation)) -> Observations {
    let settings = config::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/demo.json")).unwrap();
    let config::ObservationSource::Simulate(mut simulation) = settings.source else { panic!() };
    change(&mut simulation);
    simulation.observe(&settings.star)
}

fn rms(x: &[f64]) -> f64 {
    (x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64).sqrt()
}

#[test]
fn profiles_and_activity_jitter_are_the_oracles() {
    let quiet = demo(|s| s.snr = None);
    let forward = json("forward.json");
    for (profile, intensity) in quiet.profiles.iter().zip(forward["intensity"].as_array().unwrap()) {
        for (got, wanted) in profile.intensity.iter().zip(numbers(intensity)) {
            // the reference is right to 3e-5 and 20,000 pixels to 1e-4
            assert!((got - wanted).abs() < 1e-4);
        }
        assert!(profile.sigma.iter().all(|s| *s == SIGMA_WITHOUT_NOISE));
    }
    let without_planet = demo(|s| {
        s.snr = None;
        s.truth.0[0] = 0.0;
    });
    let rv: Vec<f64> = without_planet.first_moments().iter().map(|rv| rv.value_kms).collect();
    let peak_to_peak = rv.iter().fold(f64::MIN, |a, x| a.max(*x)) - rv.iter().fold(f64::MAX, |a, x| a.min(*x));
    let wanted = &oracle().json["star_stats"];
    let close = |got: f64, key: &str| {
        let wanted = wanted[key].as_f64().unwrap();
        println!("{key}: {got} {wanted}");
        // the oracle's star has its spots on whole pixels, and is another one by 0.1 % or so
        assert!((got / wanted - 1.0).abs() < 3e-3, "{key}: {got} {wanted}");
    };
    close(rms(&rv), "jitter_rms");
    close(peak_to_peak, "jitter_p2p");
}

#[test]
fn noise_is_as_announced_and_its_velocity_error_too() {
    let coarse = |seed: Option<u64>| {
        demo(|s| {
            s.pixels = 500;
            s.seed = seed.unwrap_or(0);
            s.snr = seed.and(s.snr);
        })
    };
    let quiet = coarse(None);
    let mean_of_squares = |f: &dyn Fn(&Observations) -> f64| {
        let seeds = 40;
        (0..seeds).map(|seed| f(&coarse(Some(seed)))).sum::<f64>() / seeds as f64
    };
    let noise = mean_of_squares(&|noisy| {
        let pairs = noisy.profiles.iter().zip(&quiet.profiles);
        let residuals = pairs.flat_map(|(a, b)| a.intensity.iter().zip(&b.intensity).map(|(a, b)| (a - b) / 1e-3));
        rms(&residuals.collect::<Vec<_>>()).powi(2)
    });
    // 114,000 numbers: 4 standard errors of a mean of squares
    assert!((noise - 1.0).abs() < 4.0 * (2.0_f64 / 114_000.0).sqrt(), "{noise}");
    let pull = mean_of_squares(&|noisy| {
        let pairs = noisy.first_moments().into_iter().zip(quiet.first_moments());
        rms(&pairs.map(|(a, b)| (a.value_kms - b.value_kms) / a.sigma_kms).collect::<Vec<_>>()).powi(2)
    });
    // 2000 velocities: 4 standard errors
    assert!((pull - 1.0).abs() < 4.0 * (2.0_f64 / 2000.0).sqrt(), "{pull}");
}

#[test]
fn a_simulation_is_a_function_of_its_settings() {
    let small = |seed| {
        demo(|s| {
            s.pixels = 500;
            s.seed = seed;
        })
    };
    assert_eq!(small(3), small(3));
    assert_ne!(small(3), small(4));
    assert_eq!(fingerprint(&small(3)), fingerprint(&small(3)));
    assert_ne!(fingerprint(&small(3)), fingerprint(&small(4)));
}

fn depths(observations: &Observations) -> Vec<f64> {
    observations.profiles.iter().flat_map(|p| p.intensity.clone()).collect()
}

/// Zero points move profiles by what `truth.json` says of them, and leave the noise as it is.
#[test]
fn zero_points_are_velocities_of_their_own() {
    let with = |snr: Option<f64>, jitter: f64| {
        demo(|s| {
            s.pixels = 2000;
            s.snr = snr;
            s.velocity_jitter_kms = jitter;
        })
    };
    let settings = config::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/demo.json")).unwrap();
    let config::ObservationSource::Simulate(simulation) = settings.source else { panic!() };
    assert!(simulation.zero_points_kms().is_empty());
    let zero_points = Simulation { velocity_jitter_kms: 0.5, ..simulation }.zero_points_kms();
    // fifty numbers know their scatter to 10 %
    assert!((rms(&zero_points) / 0.5 - 1.0).abs() < 0.25, "{}", rms(&zero_points));
    let (still, moved) = (with(None, 0.0), with(None, 0.5));
    for ((still, moved), zero_point) in still.first_moments().iter().zip(moved.first_moments()).zip(&zero_points) {
        // the last bins cut a little of the line off
        let shift = moved.value_kms - still.value_kms;
        assert!((shift - zero_point).abs() < 2e-3 + 0.01 * zero_point.abs(), "{shift} {zero_point}");
    }
    let noise = |jitter: f64| -> Vec<f64> {
        let (loud, quiet) = (with(Some(1000.0), jitter), with(None, jitter));
        depths(&loud).iter().zip(depths(&quiet)).map(|(a, b)| a - b).collect()
    };
    assert!(noise(0.0).iter().zip(noise(0.5)).all(|(a, b)| (a - b).abs() < 1e-15));
}

/// Correlations of (c - 1) / (c + 1) between neighbours, the variance of white noise, and nothing from one profile to
/// the next.
#[test]
fn noise_is_correlated_over_as_many_bins_as_asked_for() {
    let noise = |correlated_bins: f64| {
        let with = |snr: Option<f64>| {
            demo(|s| {
                s.pixels = 500;
                (s.snr, s.correlated_bins, s.bins) = (snr, correlated_bins, 200);
            })
        };
        let (loud, quiet) = (depths(&with(Some(1000.0))), depths(&with(None)));
        loud.iter().zip(quiet).map(|(a, b)| 1000.0 * (a - b)).collect::<Vec<f64>>()
    };
    let (white, together) = (noise(1.0), noise(3.0));
    for (white, together) in white.chunks(200).zip(together.chunks(200)) {
        assert!((white[0] - together[0]).abs() < 1e-9, "the first bin of a profile");
        assert!((together[1] - 0.5 * together[0] - 0.75f64.sqrt() * white[1]).abs() < 1e-9);
    }
    // 10,000 bins, of which a third are independent
    assert!((rms(&together) - 1.0).abs() < 0.04, "{}", rms(&together));
    let product = |lag: usize| {
        let pairs =
            together.chunks(200).flat_map(|p| p.iter().zip(&p[lag..]).map(|(a, b)| a * b).collect::<Vec<f64>>());
        pairs.sum::<f64>() / (50 * (200 - lag)) as f64
    };
    for (lag, wanted) in [(1, 0.5), (2, 0.25), (5, 0.03125)] {
        assert!((product(lag) - wanted).abs() < 0.06, "{lag}: {}", product(lag));
    }
}

#[test]
fn a_shifted_line_has_a_shifted_first_moment() {
    let line = |shift: f64| Profile {
        time_d: 0.0,
        first_velocity_kms: -30.0,
        intensity: (0..61).map(|j| 1.0 - 0.4 * (-0.5 * ((f64::from(j) - 30.0 - shift) / 4.0).powi(2)).exp()).collect(),
        sigma: vec![1e-3; 61],
    };
    for shift in [-3.0, 0.0, 0.123] {
        // a sampled Gaussian has the moments of the Gaussian; what its tail of 6.7 sigma lacks is below 1e-8
        assert!((line(shift).first_moment(1.0).value_kms - shift).abs() < 1e-8);
    }
}

/// Faculae brighten what spots leave free; without them nothing changes.
#[test]
fn brightness_of_spots_and_faculae() {
    let disc = |longitude: f64| Disc { longitude, latitude: 0.3, radius: 0.4 };
    let spot = |longitude: f64, filling: f64| Spot { longitude, latitude: 0.3, radius: 0.4, filling, life: None };
    let facula = |longitude: f64, excess: f64| Facula { disc: disc(longitude), excess };
    let settings = config::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/demo.json")).unwrap();
    let config::ObservationSource::Simulate(mut simulation) = settings.source else { panic!() };
    let grid = SurfaceGrid::equal_area(2000, Quadrature::Gauss2x2);
    simulation.spots = vec![spot(1.0, 0.6), spot(3.0, 1.0)];
    let spots_alone = simulation.brightness(&grid, 0.1);
    let wanted = simulation.spot_filling(&grid);
    assert!(spots_alone.iter().zip(wanted).all(|(b, s)| *b == 1.0 - (1.0 - 0.1) * s));
    simulation.faculae = vec![facula(1.0, 0.2), facula(3.0, 0.2), facula(5.0, 0.2), facula(5.1, 0.3)];
    let brightness = simulation.brightness(&grid, 0.1);
    let at = |longitude: f64| {
        let near = |&p: &usize| (grid.longitude[p] - longitude).abs() < 0.1 && (grid.latitude[p] - 0.3).abs() < 0.1;
        let inside: Vec<f64> = (0..grid.len()).filter(near).map(|p| brightness[p]).collect();
        inside.iter().for_each(|b| assert!((b - inside[0]).abs() < 1e-12));
        inside[0]
    };
    // half filled, filled, the larger of two excesses, photosphere
    for (longitude, wanted) in [(1.0, 0.6 * 0.1 + 0.4 * 1.2), (3.0, 0.1), (5.05, 1.3), (2.0, 1.0)] {
        assert!((at(longitude) - wanted).abs() < 1e-12, "{longitude}: {} {wanted}", at(longitude));
    }
    // the excess of light over the whole star is that of the area
    simulation.spots.clear();
    simulation.faculae = vec![facula(2.0, 0.5)];
    let light: f64 = simulation.brightness(&grid, 0.1).iter().zip(&grid.area).map(|(b, a)| a * (b - 1.0)).sum();
    let cap = 0.5 * (1.0 - 0.4f64.cos());
    // 8 x 8 points a pixel: a few hundred of them on the edge
    assert!((light / (0.5 * cap) - 1.0).abs() < 5e-3, "{light} {}", 0.5 * cap);
}

#[test]
fn the_scene_of_the_demo() {
    let scene = Scene::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/demo.json")).unwrap();
    assert_eq!(scene.space.names(), ["k_kms", "porb_over_prot", "phi"]);
    assert_eq!(scene.truth, Some(scene.settings.values));
    assert!((scene.imager.mid_cycle() - 1.47).abs() < 1e-12);
    let truth = scene.true_spot_filling().unwrap();
    let coverage: f64 = truth.iter().zip(&scene.imager.grid.area).map(|(s, a)| s * a).sum();
    let wanted = oracle().json["star_stats"]["coverage"].as_f64().unwrap();
    assert!((coverage / wanted - 1.0).abs() < 5e-3, "{coverage} {wanted}");
}
