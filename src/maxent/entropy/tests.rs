//! Tests of the entropies.

use super::*;

const AREA: [f64; 4] = [0.1, 0.2, 0.3, 0.4];
const MODELS: [(Entropy, [f64; 4]); 2] = [
    // logit of 1e-3 is ln(1 / 999)
    (Entropy::Spots { default_logit: -6.906_754_778_648_554 }, [-9.0, -2.0, 0.5, 3.0]),
    (Entropy::BrightAndDark, [-2.5, -0.1, 0.2, 1.4]),
];

/// `-S / a` of one pixel as the method has it.
fn formula(entropy: Entropy, x: f64) -> f64 {
    let m = 1e-3;
    match entropy {
        Entropy::Spots { .. } => x * (x / m).ln() + (1.0 - x) * ((1.0 - x) / (1.0 - m)).ln(),
        Entropy::BrightAndDark => x * x.ln() - x + 1.0,
    }
}

fn image(entropy: Entropy, u: f64) -> f64 {
    match entropy {
        Entropy::Spots { .. } => 1.0 / (1.0 + (-u).exp()),
        Entropy::BrightAndDark => u.exp(),
    }
}

#[test]
fn value_is_the_formula() {
    assert_eq!(Entropy::new(1e-3), MODELS[0].0);
    for (entropy, u) in MODELS {
        let mut map = [0.0; 4];
        let value = entropy.value(&u, &AREA, &mut map).entropy;
        let wanted: f64 = u.iter().zip(AREA).map(|(u, a)| a * formula(entropy, image(entropy, *u))).sum();
        assert!((value + wanted).abs() < 1e-13, "{entropy:?}: {value} {wanted}");
        assert!(map.iter().zip(entropy.image(&u)).all(|(a, b)| (a / b - 1.0).abs() < 1e-14));
        assert!(map.iter().zip(u).all(|(x, u)| (x / image(entropy, u) - 1.0).abs() < 1e-14));
        assert!(entropy.value(&[entropy.default_coordinate(); 4], &AREA, &mut map).entropy.abs() < 1e-15);
    }
}

/// Differences over a step of 1e-4 are accurate to the square of the step over that of the pixel's value.
#[test]
fn gradient_and_metric_are_its_derivatives() {
    for (entropy, u) in MODELS {
        let map = entropy.image(&u);
        let (gradient, metric) = (entropy.gradient(&u, &AREA), entropy.metric(&map, &AREA));
        for p in 0..4 {
            let h = 1e-4 * map[p].min((1.0 - map[p]).abs());
            let [below, here, above] = [-h, 0.0, h].map(|h| AREA[p] * formula(entropy, map[p] + h));
            let slope = (above - below) / (2.0 * h);
            assert!((gradient[p] - slope).abs() < 1e-6 * (1.0 + slope.abs()), "{entropy:?} {p}: {slope}");
            let curvature = (above - 2.0 * here + below) / (h * h);
            assert!((f64::from(metric[p]).powi(-2) / curvature - 1.0).abs() < 1e-5, "{entropy:?} {p}: {curvature}");
        }
    }
}

#[test]
fn gain_is_the_way_down_to_where_the_gradient_vanishes() {
    for (entropy, u) in MODELS {
        for (u, change) in u.into_iter().zip([4.0, -0.3, 0.1, -2.0]) {
            // -S less its tangent at the best
            let (here, best) = (image(entropy, u), image(entropy, u + change));
            let slope = entropy.gradient(&[u + change], &[1.0])[0];
            let gain = formula(entropy, here) - formula(entropy, best) - slope * (here - best);
            assert!((entropy.gain(u, change) / gain - 1.0).abs() < 1e-9, "{entropy:?} {u}: {gain}");
        }
        // of second order while it is small
        let metric = f64::from(entropy.metric(&entropy.image(&[0.2]), &[1.0])[0]);
        assert!((entropy.gain(0.2, 1e-4) / (0.5e-8 * metric * metric) - 1.0).abs() < 1e-3);
    }
}

#[test]
fn gradient_of_spottedness_is_its_derivative() {
    for (entropy, u) in MODELS {
        let map = entropy.image(&u);
        let gradient = entropy.spottedness_gradient(&map, &AREA);
        for p in 0..4 {
            let at = |h: f64| {
                let mut moved = map.clone();
                moved[p] += h;
                entropy.spottedness(&moved, &AREA)
            };
            let slope = (at(1e-5) - at(-1e-5)) / 2e-5;
            assert!((gradient[p] - slope).abs() < 1e-9, "{entropy:?} {p}: {} {slope}", gradient[p]);
        }
    }
    let blank = Entropy::BrightAndDark.spottedness_gradient(&[1.0; 4], &AREA);
    assert_eq!(blank[..], [0.0; 4]);
}

#[test]
fn a_step_in_the_metric_is_one_of_the_image_and_its_value_that_of_where_it_leads() {
    for (entropy, few) in MODELS {
        // more than one chunk, and part of another
        let u: Vec<f64> = few.into_iter().cycle().take(1030).collect();
        let area: Vec<f64> = AREA.into_iter().cycle().take(u.len()).collect();
        let map = entropy.image(&u);
        let scale = entropy.metric(&map, &area);
        let z: Vec<f32> = (0..u.len()).map(|p| (0.7 * p as f32).sin()).collect();
        let (mut there, mut image) = (vec![f64::NAN; u.len()], vec![f64::NAN; u.len()]);
        let step = MetricStep { u: &u, image: &map, z: &z, scale: &scale, length: 0.5, cap: 2.0 };
        let value = entropy.advance(step, &area, &mut there, &mut image);
        let changes: Vec<f32> = z.iter().zip(&scale).map(|(z, scale)| 0.5 * (z * scale)).collect();
        let (mut moved, mut of_moved) = (vec![f64::NAN; u.len()], vec![f64::NAN; u.len()]);
        entropy.step(&u, &map, &changes, 2.0, &mut moved);
        assert!(there == moved && value == entropy.value(&moved, &area, &mut of_moved) && image == of_moved);
        assert!((value.spottedness / entropy.spottedness(&image, &area) - 1.0).abs() < 1e-13);
    }
}

#[test]
fn steps_from_next_to_the_ends_of_the_domain_are_finite_and_lead_where_they_should() {
    for (entropy, _) in MODELS {
        let limit = entropy.lowest_coordinate().abs();
        for u in (-60..=60).map(|k| 0.5 * f64::from(k)) {
            let (map, mut moved) = (entropy.image(&[u]), [f64::NAN]);
            for step in (-180..=20).flat_map(|k| [-1.0, 1.0].map(|sign| sign * 10f32.powf(0.1 * k as f32))) {
                entropy.step(&[u], &map, &[step], 2.0, &mut moved);
                let change = moved[0] - u;
                let leads_there = change * f64::from(step) >= 0.0 && change.abs() <= 2.0;
                assert!(leads_there && moved[0].abs() <= limit, "{entropy:?} {u} {step:e}: {moved:?}");
            }
        }
    }
    // a default beyond the end
    let entropy = Entropy::new(1e-20);
    let (u, mut moved) = ([entropy.default_coordinate()], [f64::NAN]);
    entropy.step(&u, &entropy.image(&u), &[0.0], 2.0, &mut moved);
    assert_eq!(moved, [entropy.lowest_coordinate()]);
}

#[test]
fn steps_are_straight_in_the_image_as_long_as_they_are_small() {
    for (entropy, u) in MODELS {
        let (map, mut moved) = (entropy.image(&u), [0.0; 4]);
        for part in [-0.45, 0.3] {
            let step: Vec<f32> = map.iter().map(|x| (part * x.min((1.0 - x).abs())) as f32).collect();
            entropy.step(&u, &map, &step, 2.0, &mut moved);
            let there = entropy.image(&moved);
            // single precision
            let off = |p: usize| (there[p] - map[p]) / f64::from(step[p]) - 1.0;
            assert!((0..4).all(|p| off(p).abs() < 1e-6), "{entropy:?} {part}");
        }
        // steps out of the domain are limited
        for step in [-1e9, 1e9] {
            entropy.step(&u, &map, &[step; 4], 2.0, &mut moved);
            assert!((0..4).all(|p| ((moved[p] - u[p]).abs() - 2.0).abs() < 1e-12 && (moved[p] > u[p]) == (step > 0.0)));
        }
    }
}
