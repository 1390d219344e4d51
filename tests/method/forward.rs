//! Truths about the forward model: symmetry, limit cases, adjointness, convergence with the number of pixels.

use crate::common::{oracle, values};
use dimcmc::internals::star::{
    LimbDarkening, LocalLine, Orbit, Quadrature, Regions, Response, Rotation, Sampling, StarSettings, StarState,
    SurfaceGrid,
};

fn state() -> StarState {
    StarState {
        rotation: Rotation { omega_eq_rad_d: 2.0, domega_rad_d: 0.0 },
        inclination: 38.0_f64.to_radians(),
        vsini_kms: 40.0,
        vsys_kms: 0.0,
        motion: Orbit { k_kms: 0.0, porb_over_prot: 1.7, phi: 0.5 }.into(),
        surface: Default::default(),
    }
}

fn sampling(times: &[f64]) -> Sampling {
    Sampling { step_kms: 1.8, profiles: times.iter().map(|&t| (t, -59.4, 67)).collect() }
}

fn unspotted(grid: &SurfaceGrid, state: &StarState, sampling: &Sampling, limb: LimbDarkening) -> Vec<f64> {
    let mut star = oracle().star;
    star.limb_darkening = limb;
    Response::new(grid, &star, state, sampling).depths(&vec![1.0; grid.len()])
}

const LINEAR: LimbDarkening = LimbDarkening::Linear(0.65);

#[test]
fn an_unspotted_profile_is_symmetric_and_has_the_equivalent_width_of_the_line() {
    for quadrature in [Quadrature::Centre, Quadrature::Gauss2x2] {
        let grid = SurfaceGrid::equal_area(5000, quadrature);
        let depth = unspotted(&grid, &state(), &sampling(&[0.0]), LINEAR);
        let deepest = depth.iter().copied().fold(0.0, f64::max);
        for j in 0..33 {
            // pixels of a ring lie symmetrically about longitude 0; weights are stored in single precision
            assert!((depth[j] - depth[66 - j]).abs() < 1e-6 * deepest, "bin {j}");
        }
        let width: f64 = depth.iter().sum::<f64>() * 1.8;
        assert!((width - 5.8).abs() < 1e-4, "equivalent width {width}");
    }
}

#[test]
fn an_unspotted_profile_converges_as_the_method_says() {
    // rms errors of the method's table for moment matching, times three
    let truth = {
        let grid = SurfaceGrid::equal_area(300_000, Quadrature::Gauss2x2);
        unspotted(&grid, &state(), &sampling(&[0.3]), LINEAR)
    };
    let rms = |pixels, quadrature| {
        let depth = unspotted(&SurfaceGrid::equal_area(pixels, quadrature), &state(), &sampling(&[0.3]), LINEAR);
        let sum: f64 = depth.iter().zip(&truth).map(|(a, b)| (a - b) * (a - b)).sum();
        (sum / truth.len() as f64).sqrt()
    };
    for (pixels, wanted) in [(2000, 3.4e-6), (5000, 9.7e-7), (20_000, 2.5e-7)] {
        let (moments, centre) = (rms(pixels, Quadrature::Gauss2x2), rms(pixels, Quadrature::Centre));
        println!("{pixels} pixels: moments {moments:.1e}, centre {centre:.1e}");
        assert!(moments < 3.0 * wanted, "{pixels} pixels: {moments:.1e}");
        assert!(centre > 5.0 * moments, "moment matching brings nothing at {pixels} pixels");
    }
}

#[test]
fn a_star_seen_pole_on_shows_its_local_line() {
    let pole_on = StarState { inclination: 1e-9, vsini_kms: 1e-6, ..state() };
    let grid = SurfaceGrid::equal_area(1000, Quadrature::Gauss2x2);
    let depth = unspotted(&grid, &pole_on, &sampling(&[0.0]), LimbDarkening::Quadratic(0.4, 0.3));
    let line = oracle().star.line;
    for (j, depth) in depth.iter().enumerate() {
        let v = -59.4 + 1.8 * j as f64;
        let gaussian = (-0.5 * (v / line.sigma_kms).powi(2)).exp() * line.strength_kms()
            / (line.sigma_kms * std::f64::consts::TAU.sqrt());
        // aliasing of the deposit
        assert!((depth - gaussian).abs() < 1e-6, "{v} km/s: {depth} instead of {gaussian}");
    }
}

#[test]
fn limb_darkening_shapes_the_profile_as_an_integral_over_the_disc_says() {
    let grid = SurfaceGrid::equal_area(20_000, Quadrature::Gauss2x2);
    let line = oracle().star.line;
    for limb in [LINEAR, LimbDarkening::Quadratic(0.3, 0.35), LimbDarkening::Quadratic(0.8, -0.2)] {
        let depth = unspotted(&grid, &state(), &sampling(&[0.0]), limb);
        // strips of the disc at x = v / vsini, each the integral of LD(mu) along it; midpoints in angle, so that the
        // limb is resolved
        let angle = |i: usize, n: usize| ((i as f64 + 0.5) / n as f64 - 0.5) * std::f64::consts::PI;
        let strip = |x: f64| {
            let half = (1.0 - x * x).sqrt();
            let at = |i| half * angle(i, 200).cos() * limb.at(half * angle(i, 200).cos());
            (0..200).map(at).sum::<f64>()
        };
        let strips: Vec<(f64, f64)> =
            (0..400).map(|i| (angle(i, 400).sin(), angle(i, 400).cos() * strip(angle(i, 400).sin()))).collect();
        let continuum: f64 = strips.iter().map(|(_, weight)| weight).sum();
        for (j, depth) in depth.iter().enumerate() {
            let v = -59.4 + 1.8 * j as f64;
            let gaussian = |x: f64| (-0.5 * ((v - 40.0 * x) / line.sigma_kms).powi(2)).exp();
            let area = line.strength_kms() / (line.sigma_kms * std::f64::consts::TAU.sqrt());
            let wanted = area * strips.iter().map(|(x, weight)| weight * gaussian(*x)).sum::<f64>() / continuum;
            assert!((depth - wanted).abs() < 3e-6, "{limb:?} {v} km/s: {depth} instead of {wanted}");
        }
    }
}

#[test]
fn orbit_and_systemic_velocity_shift_the_profile_as_a_whole() {
    let grid = SurfaceGrid::equal_area(2000, Quadrature::Gauss2x2);
    let sampling = sampling(&[0.7]);
    let orbit = Orbit { k_kms: 0.9, porb_over_prot: 1.3, phi: 0.2 };
    let cycle = 0.7 / oracle().star.rotation_period_d;
    let moved = unspotted(&grid, &StarState { motion: orbit.into(), vsys_kms: 0.4, ..state() }, &sampling, LINEAR);
    let shift = 0.4 + orbit.velocity_kms(cycle);
    let shifted = Sampling { profiles: vec![(0.7, -59.4 - shift, 67)], ..sampling };
    let at_rest = unspotted(&grid, &state(), &shifted, LINEAR);
    for (a, b) in moved.iter().zip(&at_rest) {
        assert!((a - b).abs() < 1e-12);
    }
    // phi = 0 is the largest receding velocity at cycle 0
    assert!((Orbit { phi: 0.0, ..orbit }.velocity_kms(0.0) - 0.9).abs() < 1e-15);
}

#[test]
fn a_profile_far_from_the_line_is_flat() {
    let grid = SurfaceGrid::equal_area(500, Quadrature::Centre);
    let (star, sampling) = (oracle().star, sampling(&[0.0, 0.4]));
    for vsys_kms in [200.0, -200.0, 1e9, -1e9, 1e300] {
        let response = Response::new(&grid, &star, &StarState { vsys_kms, ..state() }, &sampling);
        assert!(response.depths(&vec![1.0; grid.len()]).iter().all(|depth| *depth == 0.0), "{vsys_kms}");
        let mut map = vec![f64::NAN; grid.len()];
        response.apply_transpose(&vec![1.0; response.data_len()], &[0.0; 2], &mut map);
        assert!(map.iter().all(|x| *x == 0.0), "{vsys_kms}");
    }
}

#[test]
fn a_spot_crosses_from_blue_to_red_and_shear_delays_high_latitudes() {
    let grid = SurfaceGrid::equal_area(5000, Quadrature::Gauss2x2);
    let spotted: Vec<f64> = (0..grid.len())
        .map(|p| {
            let near = grid.latitude[p] > 0.7 && grid.latitude[p] < 0.9;
            let longitude = (grid.longitude[p] + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU);
            if near && (longitude - std::f64::consts::PI).abs() < 0.15 { 0.0 } else { 1.0 }
        })
        .collect();
    // first moment of what is missing in the line at a given time
    let bump = |domega: f64, time: f64| {
        let state = StarState { rotation: Rotation { omega_eq_rad_d: 2.0, domega_rad_d: domega }, ..state() };
        let response = Response::new(&grid, &oracle().star, &state, &sampling(&[time]));
        let (bright, dark) = (response.depths(&vec![1.0; grid.len()]), response.depths(&spotted));
        let missing: Vec<f64> = bright.iter().zip(&dark).map(|(a, b)| a - b).collect();
        let moment: f64 = missing.iter().enumerate().map(|(j, m)| m * (-59.4 + 1.8 * j as f64)).sum();
        moment / missing.iter().map(|m| m.abs()).sum::<f64>()
    };
    assert!(bump(0.0, -0.3) < -1.0 && bump(0.0, 0.3) > 1.0);
    assert!(bump(0.5, 0.3) < bump(0.0, 0.3) - 0.5, "the spot lags where the star turns more slowly");
}

#[test]
fn the_transpose_is_the_transpose() {
    let oracle = oracle();
    let truth = values(&oracle.json["results"]["fixed_lambda"][6]["theta"], 3.0).state();
    let grid = SurfaceGrid::equal_area(1500, Quadrature::Gauss2x2);
    let response = Response::new(&grid, &oracle.star, &truth, &oracle.sampling);
    let noise = |n: usize, a: f64| (0..n).map(|i| (a * (i * i) as f64).sin()).collect::<Vec<f64>>();
    let (x, y, z) = (noise(grid.len(), 0.7), noise(response.data_len(), 1.3), noise(response.profiles(), 2.1));
    let (mut line, mut continuum, mut back) = (vec![0.0; y.len()], vec![0.0; z.len()], vec![0.0; x.len()]);
    response.apply(&x, &mut line, &mut continuum);
    response.apply_transpose(&y, &z, &mut back);
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let (there, here) = (dot(&line, &y) + dot(&continuum, &z), dot(&x, &back));
    assert!((there / here - 1.0).abs() < 1e-11, "{there} {here}");
}

/// The profile of an unspotted star with a Voigt line, against strips of the disc of which each shows its Voigt
/// profile, itself the sum of Lorentzians over a Gaussian; far into the wings, which reach beyond the star and all
/// bins.
#[test]
fn voigt_profile_of_the_whole_disc() {
    let grid = SurfaceGrid::equal_area(20_000, Quadrature::Gauss2x2);
    let sampling = Sampling { step_kms: 1.8, profiles: vec![(0.0, -149.4, 167)] };
    for (sigma_kms, gamma_kms) in [(3.2, 1.5), (2.0, 6.0)] {
        let mut star = oracle().star;
        star.line = LocalLine { gamma_kms, ..LocalLine::gaussian(sigma_kms, 5.8) };
        let depth = Response::new(&grid, &star, &state(), &sampling).depths(&vec![1.0; grid.len()]);
        // midpoints in angle, so that the limb is resolved
        let angle = |i: usize, n: usize| ((i as f64 + 0.5) / n as f64 - 0.5) * std::f64::consts::PI;
        let strips: Vec<(f64, f64)> = (0..600)
            .map(|i| {
                let (sin, cos) = angle(i, 600).sin_cos();
                let along = |j: usize| (cos * angle(j, 100).cos(), angle(j, 100).cos());
                let strip: f64 = (0..100).map(|j| along(j).1 * LINEAR.at(along(j).0)).sum();
                (40.0 * sin, cos * cos * strip)
            })
            .collect();
        let continuum: f64 = strips.iter().map(|(_, weight)| weight).sum();
        for (j, depth) in depth.iter().enumerate().step_by(7) {
            let v = -149.4 + 1.8 * j as f64;
            let voigt = |x: f64| {
                // eight standard deviations in steps far below the Lorentzian's width
                let step = 0.02 * sigma_kms;
                let lorentzian = |x: f64| gamma_kms / (std::f64::consts::PI * (x * x + gamma_kms * gamma_kms));
                let terms = (-400..=400).map(|k| f64::from(k) * step);
                terms.map(|t| gaussian(t, sigma_kms) * lorentzian(x - t)).sum::<f64>() * step
            };
            let wanted = 5.8 * strips.iter().map(|(x, weight)| weight * voigt(v - x)).sum::<f64>() / continuum;
            // pixels and aliasing, as for a Gaussian
            assert!((depth - wanted).abs() < 3e-6, "{sigma_kms} {gamma_kms} {v}: {depth} instead of {wanted}");
        }
    }
}

fn gaussian(x: f64, sigma: f64) -> f64 {
    (-0.5 * (x / sigma).powi(2)).exp() / (sigma * std::f64::consts::TAU.sqrt())
}

/// Only the part of the equivalent width beyond the bins is lost: `(gamma/pi) / v` on either side, to first order.
#[test]
fn voigt_wings_hold_their_share_of_the_equivalent_width() {
    let grid = SurfaceGrid::equal_area(2000, Quadrature::Gauss2x2);
    let mut star = oracle().star;
    star.line = LocalLine { gamma_kms: 1.5, ..LocalLine::gaussian(3.2, 5.8) };
    let mut last = 0.0;
    for reach in [200.0, 800.0, 3200.0] {
        let bins = (2.0 * reach / 1.8) as usize;
        let sampling = Sampling { step_kms: 1.8, profiles: vec![(0.0, -0.9 * (bins - 1) as f64, bins)] };
        let depths = Response::new(&grid, &star, &state(), &sampling).depths(&vec![1.0; grid.len()]);
        let area = depths.iter().sum::<f64>() * 1.8 / 5.8;
        let beyond = 2.0 * 1.5 / (std::f64::consts::PI * 0.9 * bins as f64);
        // the star's rotation and the line's width change the share by (v/reach)^2
        assert!((1.0 - area - beyond).abs() < beyond * 2.0 * (40.0f64 / reach).powi(2) + 1e-7, "{reach}: {area}");
        assert!(area > last);
        last = area;
    }
}

/// A surface in the state is equivalent to a star with such settings.
#[test]
fn surface_parameters_stand_in_place_of_settings() {
    let grid = SurfaceGrid::equal_area(1000, Quadrature::Gauss2x2);
    let sampling = sampling(&[0.0, 1.1]);
    let mut other = oracle().star;
    other.limb_darkening = LimbDarkening::Linear(0.4);
    other.contrast = 0.3;
    other.line.sigma_kms = 4.0f64.hypot(other.line.instrumental_sigma_kms);
    other.line.equivalent_width_kms = Some(7.0);
    let surface = dimcmc::internals::star::Surface {
        limb_darkening: Some(0.4),
        line_sigma_kms: Some(4.0),
        equivalent_width_kms: Some(7.0),
        contrast: Some(0.3),
        ..Default::default()
    };
    let map: Vec<f64> = (0..grid.len()).map(|p| 1.0 + 0.3 * (p as f64).sin()).collect();
    let direct = Response::new(&grid, &other, &state(), &sampling);
    let state = StarState { surface, ..state() };
    let response = Response::new(&grid, &oracle().star, &state, &sampling);
    assert_eq!(response.depths(&map), direct.depths(&map));
    assert_eq!(response.with_velocities(&oracle().star, &state, &[sampling.into()]).depths(&map), direct.depths(&map));
    assert_eq!((response.contrast(0), direct.contrast(0)), (0.3, 0.3));
}

/// A star with regions that have a different line, which are smaller and brighter at the limb, by the formula: a sum
/// over pixels, on a grid so fine that each is a point.
#[test]
fn regions_are_as_the_formula_says() {
    let regions = Regions {
        line_width: 1.4,
        equivalent_width: 1.1,
        shift_kms: 0.4,
        area: 2.0,
        area_limb: -0.7,
        dimming_limb: -0.5,
    };
    let (q, u, inclination, vsini_kms, line) = (0.7, 0.65, 0.9f64, 30.0, LocalLine::gaussian(3.0, 5.0));
    let star = StarSettings {
        rotation_period_d: 3.0,
        epoch_d: 0.0,
        limb_darkening: LimbDarkening::Linear(u),
        contrast: 1.0 - q,
        line,
        regions,
    };
    let state = StarState { inclination, vsini_kms, vsys_kms: 0.2, ..state() };
    let state = StarState { rotation: Rotation { omega_eq_rad_d: 2.1, domega_rad_d: 0.0 }, ..state };
    let grid = SurfaceGrid::equal_area(40_000, Quadrature::Gauss2x2);
    let filling: Vec<f64> = (0..grid.len())
        .map(|p| if (grid.longitude[p] - 0.6).powi(2) + (grid.latitude[p] - 0.4).powi(2) < 0.2 { 0.8 } else { 0.0 })
        .collect();
    let (time_d, first_kms, step_kms, bins) = (0.4, -45.0, 1.8, 51);
    let sampling = Sampling { step_kms, profiles: vec![(time_d, first_kms, bins)] };
    let response = Response::new(&grid, &star, &state, &sampling);
    let brightness: Vec<f64> = filling.iter().map(|x| 1.0 - q * x).collect();
    let depths = response.depths(&brightness);
    let gaussian = |sigma: f64, width: f64, v: f64| {
        width / (sigma * std::f64::consts::TAU.sqrt()) * (-0.5 * (v / sigma).powi(2)).exp()
    };
    let shift_kms = state.vsys_kms + state.motion.velocity_kms(star.cycle(time_d));
    let (mut sums, mut continuum) = (vec![0.0; bins], 0.0);
    for (p, x) in filling.iter().enumerate() {
        let (sin, cos) = grid.latitude[p].sin_cos();
        let psi = grid.longitude[p] + 2.1 * time_d;
        let mu = sin * inclination.cos() + cos * inclination.sin() * psi.cos();
        if mu <= 0.0 {
            continue;
        }
        let limb = 1.0 - mu;
        let weight = grid.area[p] * mu * (1.0 - u * limb);
        let dimming = q + regions.dimming_limb * limb;
        let area = regions.area + regions.area_limb * limb;
        for (j, sum) in sums.iter_mut().enumerate() {
            let v = first_kms + j as f64 * step_kms - shift_kms - vsini_kms * cos * psi.sin();
            let own = gaussian(3.0, 5.0, v);
            let changed = gaussian(1.4 * 3.0, 1.1 * 5.0, v - regions.shift_kms);
            *sum += weight * (own - x * (dimming * own - area * (changed - own)));
        }
        continuum += weight * (1.0 - x * dimming);
    }
    let deepest = depths.iter().copied().fold(0.0, f64::max);
    for (depth, sum) in depths.iter().zip(&sums) {
        assert!((depth - sum / continuum).abs() < 1e-3 * deepest, "{depth} {}", sum / continuum);
    }
    // and the transpose is one
    let (mut line, mut level) = (vec![0.0; bins], [0.0]);
    response.change(&filling, &mut line, &mut level);
    let back: Vec<f64> = (0..bins).map(|j| (0.3 * j as f64).sin()).collect();
    let mut out = vec![0.0; grid.len()];
    response.apply_transpose(&back, &[0.7], &mut out);
    let there: f64 = line.iter().zip(&back).map(|(a, b)| a * b).sum::<f64>() + 0.7 * level[0];
    let again: f64 = out.iter().zip(&filling).map(|(a, b)| a * b).sum();
    assert!((there - again).abs() < 1e-10 * again.abs(), "{there} {again}");
}
