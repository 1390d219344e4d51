//! Marginal likelihoods against sums over all parameters, and how often noise produces a large Bayes factor.

use super::*;
use crate::planets::periodogram::sample::{self, STABILITY_KMS, correlated, normal, orbit, uneven};
use nalgebra::DVector;

const K_MAX: f64 = 0.4;

/// Uniform priors, of K up to [`K_MAX`] and of the period.
fn with_priors<T>(periods: [[f64; 2]; 2], largest_e: f64, run: impl FnOnce([&PlanetPrior; 2]) -> T) -> T {
    let ln_k = |k: f64| if (0.0..=K_MAX).contains(&k) { -K_MAX.ln() } else { f64::NEG_INFINITY };
    let ln_period = |[low, high]: [f64; 2]| {
        move |p: f64| if (low..=high).contains(&p) { -(high - low).ln() } else { f64::NEG_INFINITY }
    };
    let of = periods.map(ln_period);
    let prior = |i: usize| PlanetPrior {
        k: Density { ln: &ln_k, bounds: [0.0, K_MAX], uniform: true },
        period: Density { ln: &of[i], bounds: periods[i], uniform: true },
        largest_e,
    };
    run([&prior(0), &prior(1)])
}

/// Closed forms by the normal distribution agree with panels, wherever the bounds are.
#[test]
fn a_uniform_prior_of_k_has_a_closed_form() {
    with_priors([[1.0, 2.0]; 2], 0.0, |[prior, _]| {
        for sigma in [1e-3, 0.02, 0.4, 30.0, 1e3] {
            for top in [-30.0, -3.0, 0.0, 0.5, 2.0, 30.0].map(|errors| errors * sigma) {
                let a = 1.0 / (sigma * sigma);
                let (closed, panels) = (ln_along_ray(a, top * a, &prior.k), ln_by_panels(a, top * a, &prior.k));
                assert!((closed - panels).abs() < 1e-4, "sigma {sigma}, top {top}: {closed} {panels}");
            }
        }
    });
}

/// Sums over few directions agree with those over many, each ray by itself, wherever the orbit is and however much
/// better one direction is known than the other.
#[test]
fn a_few_directions_are_enough() {
    with_priors([[1.0, 2.0]; 2], 0.0, |[prior, _]| {
        for (sigma, ratio) in [(0.02, 1.0), (0.02, 3.0), (0.004, 1.5), (0.1, 8.0), (1.0, 30.0)] {
            for (k, phase) in [(0.0, 0.0), (0.05, 0.3), (0.2, 2.0), (0.39, 4.0)] {
                let a = Matrix2::new(1.0, 0.3, 0.3, 1.0 / (ratio * ratio)) / (sigma * sigma);
                let a = if a.determinant() > 0.0 { a } else { Matrix2::from_diagonal(&a.diagonal()) };
                let b = a * Vector2::new(k * f64::cos(phase), k * f64::sin(phase));
                const MANY: usize = 20_000;
                let rays = (0..MANY).map(|i| {
                    let (sin, cos) = (TAU * i as f64 / MANY as f64).sin_cos();
                    let direction = Vector2::new(cos, sin);
                    ln_along_ray(direction.dot(&(a * direction)), b.dot(&direction), &prior.k)
                });
                let wanted = ln_sum(&rays.collect::<Vec<_>>()) - (MANY as f64).ln();
                // with the closed form along lines, and ray by ray in panels
                for (uniform, most) in [(true, 1e-6), (false, 1e-4)] {
                    let found = ln_over_k_and_phase(&a, &b, &Density { uniform, ..prior.k });
                    assert!((found - wanted).abs() < most, "{uniform} {sigma} {ratio} {k} {phase}: {found} {wanted}");
                }
            }
        }
    });
}

/// Middles of cells.
fn cells(n: usize, [low, high]: [f64; 2]) -> impl Iterator<Item = f64> + Clone {
    (0..n).map(move |i| low + (high - low) * (i as f64 + 0.5) / n as f64)
}

fn star(k: f64, period: f64, seed: u64) -> VelocityQuadratic {
    let cycles = uneven(14, 6.0);
    let rv = orbit(&cycles, k, period, 0.3) + normal(14, seed) * 0.05;
    correlated(&cycles, &rv, seed)
}

/// A plain sum over K, phase and period, velocities computed for each.
#[test]
fn a_circle_is_the_sum_over_all_its_parameters() {
    for (k, seed) in [(0.0, 1), (0.1, 2)] {
        let quadratic = star(k, 1.7, seed);
        let periods = [1.2, 2.6];
        let found = with_priors([periods; 2], 0.0, |[prior, _]| Periodogram::new(&quadratic, prior).unwrap().ln_z);
        let mut terms = Vec::new();
        for period in cells(200, periods) {
            for phi in cells(24, [0.0, 1.0]) {
                let unit = orbit(&quadratic.cycles, 1.0, period, phi);
                terms.extend(cells(60, [0.0, K_MAX]).map(|k| quadratic.log_likelihood(&(&unit * k))));
            }
        }
        let wanted = ln_sum(&terms) - (terms.len() as f64).ln();
        assert!((found - wanted).abs() < 0.02, "{found} {wanted}");
    }
}

/// The same for a Keplerian orbit, uniform in eccentricity, periastron and phase.
#[test]
fn an_ellipse_is_the_sum_over_all_its_parameters() {
    let quadratic = star(0.05, 1.7, 3);
    let (periods, largest_e) = ([1.65, 1.75], 0.6);
    let found = with_priors([periods; 2], largest_e, |[prior, _]| {
        let circle = Periodogram::new(&quadratic, prior).unwrap();
        repeated((1, 0), |rng| ellipse(&quadratic, prior, (&circle, DRAWS), rng))
    });
    let mut terms = Vec::new();
    for period in cells(4, periods) {
        for e in cells(10, [0.0, largest_e]) {
            for omega in cells(40, [0.0, TAU]) {
                for start in cells(40, [0.0, TAU]) {
                    let velocity = |cycle: &f64| {
                        let (cos, sin) = true_anomaly(TAU * cycle / period + start, e);
                        cos * omega.cos() - sin * omega.sin() + e * omega.cos()
                    };
                    let unit = DVector::from_iterator(quadratic.len(), quadratic.cycles.iter().map(velocity));
                    let (g, a) = (quadratic.gradient.dot(&unit), unit.dot(&(&quadratic.information * &unit)));
                    terms.extend(cells(40, [0.0, K_MAX]).map(|k| g * k - 0.5 * a * k * k));
                }
            }
        }
    }
    let wanted = ln_sum(&terms) - (terms.len() as f64).ln();
    assert!(
        found.sd.unwrap() < 0.02 && (found.ln_bayes - wanted).abs() < 0.02 + 3.0 * found.sd.unwrap(),
        "{found:?} {wanted}"
    );
}

/// The same for two circular orbits.
#[test]
fn two_circles_are_the_sum_over_all_their_parameters() {
    let cycles = uneven(14, 6.0);
    let rv = orbit(&cycles, 0.06, 1.7, 0.3) + orbit(&cycles, 0.04, 3.1, 0.8) + normal(14, 4) * 0.03;
    let quadratic = correlated(&cycles, &rv, 4);
    let periods = [[1.6, 1.8], [2.9, 3.3]];
    let found =
        with_priors(periods, 0.0, |priors| evidence(&Jitters::none(&quadratic), priors, 1).unwrap().two_circles);
    let mut terms = Vec::new();
    for first in cells(5, periods[0]) {
        for second in cells(5, periods[1]) {
            for one in cells(40, [0.0, 1.0]).map(|phi| orbit(&cycles, 1.0, first, phi)) {
                let i_one = &quadratic.information * &one;
                let (g1, a1) = (quadratic.gradient.dot(&one), one.dot(&i_one));
                for two in cells(40, [0.0, 1.0]).map(|phi| orbit(&cycles, 1.0, second, phi)) {
                    let (g2, a2) = (quadratic.gradient.dot(&two), two.dot(&(&quadratic.information * &two)));
                    let across = i_one.dot(&two);
                    for k1 in cells(30, [0.0, K_MAX]) {
                        let on =
                            |k2: f64| g1 * k1 - 0.5 * a1 * k1 * k1 + g2 * k2 - 0.5 * a2 * k2 * k2 - across * k1 * k2;
                        terms.extend(cells(30, [0.0, K_MAX]).map(on));
                    }
                }
            }
        }
    }
    let wanted = ln_sum(&terms) - (terms.len() as f64).ln();
    let sd = found.sd.unwrap();
    assert!(sd < 0.03 && (found.ln_bayes - wanted).abs() < 0.02 + 3.0 * sd, "{found:?} {wanted}");
}

#[test]
fn a_planet_is_included_where_it_is() {
    let quadratic = star(0.25, 1.7, 5);
    let found = with_priors([[0.8, 4.0]; 2], 0.9, |priors| evidence(&Jitters::none(&quadratic), priors, 1).unwrap());
    assert!(found.circle.ln_bayes > 5.0, "{found:?}");
    assert!((found.inclusion[0].porb_over_prot - 1.7).abs() < 0.1, "{found:?}");
    assert!(found.inclusion[0].false_inclusion_probability < 0.01, "{found:?}");
    // neither a second planet nor an eccentricity is requested
    assert!(found.two_circles.ln_bayes < found.circle.ln_bayes + 2.0, "{found:?}");
    assert!(found.ellipse.ln_bayes < found.circle.ln_bayes + 2.0, "{found:?}");
}

/// At least as improbable as no planet at all, and no rounding error.
#[test]
fn a_sure_planet_is_hardly_anywhere_else() {
    let quadratic = star(0.75, 1.7, 5);
    let found = with_priors([[0.8, 4.0]; 2], 0.9, |priors| evidence(&Jitters::none(&quadratic), priors, 1).unwrap());
    let (none, probability) = ((-found.circle.ln_bayes).exp(), found.inclusion[0].false_inclusion_probability);
    assert!(none < 1e-20 && (none..1e-16).contains(&probability), "{none:e} {probability:e}");
}

/// Gradients without a planet have the information as covariance: hardly any of 200 such stars has a Bayes factor above
/// 150. Takes tens of minutes on one core.
#[test]
#[ignore = "by hand: tens of minutes"]
fn by_hand_chance_hardly_makes_a_bayes_factor_of_150() {
    let above = |model: fn(&Evidence) -> f64| {
        let star = |seed: u64| {
            let cycles = uneven(40, 5.0);
            let nothing = correlated(&cycles, &DVector::zeros(40), seed);
            let factor = nothing.information.clone().cholesky().unwrap();
            let gradient = factor.l() * normal(40, 1000 + seed);
            let star = VelocityQuadratic { gradient, ..nothing };
            with_priors([[0.3, 8.0]; 2], 0.95, |priors| model(&evidence(&Jitters::none(&star), priors, seed).unwrap()))
        };
        let all: Vec<f64> = (0..200).map(star).collect();
        all.iter().filter(|ln| **ln > 150f64.ln()).count()
    };
    let largest = |e: &Evidence| e.circle.ln_bayes.max(e.ellipse.ln_bayes).max(e.two_circles.ln_bayes);
    assert!(above(largest) <= 2);
}

/// An apparent jitter without a planet vanishes with the orbit in the model: a planet of 0.3 km/s in velocities with
/// uncertainties of 0.03 km/s. With the jitter fixed at the value found without a planet, ln of the Bayes factor is
/// some 10; with the orbit in the model no jitter is needed.
#[test]
fn a_planet_does_not_hide_behind_the_jitter_that_it_makes() {
    let cycles = uneven(16, 4.0);
    let rv = sample::orbit(&cycles, 0.3, 1.7, 0.3) + 0.03 * sample::normal(16, 3);
    let without = sample::independent(&cycles, &rv, &DVector::from_element(16, 0.03));
    let jitters = Jitters::new(&without, (rv.norm_squared() / 16.0 - 9e-4).sqrt(), STABILITY_KMS);
    with_priors([[0.8, 4.0]; 2], 0.0, |priors| {
        let circle = |jitters: &Jitters| evidence(jitters, priors, 1).unwrap().circle.ln_bayes;
        let (held, shared) = (circle(&Jitters::none(&jitters.as_found().quadratic)), circle(&jitters));
        assert!(held < 12.0 && shared > held + 6.0, "{held} {shared}");
    });
    // noise alone is no planet, whatever its size
    let noise = 0.3 * sample::normal(16, 5);
    let without = sample::independent(&cycles, &noise, &DVector::from_element(16, 0.03));
    let jitters = Jitters::new(&without, 0.3, STABILITY_KMS);
    let found = with_priors([[0.8, 4.0]; 2], 0.0, |priors| evidence(&jitters, priors, 1).unwrap());
    assert!(found.circle.ln_bayes < 1.0, "{:?}", found.circle);
}
