//! Dependence on nights and targets.

use super::*;
use crate::model::{Clock, Ephemeris};

#[test]
fn nights_end_with_gaps() {
    let found = nights(&[5.01, 3.2, 3.0, 5.2, 3.45, 9.0], NIGHT_GAP_D);
    assert_eq!(found, vec![vec![2, 1, 4], vec![0, 3], vec![5]]);
}

#[test]
fn a_known_planet_of_negative_k_predicts_nothing() {
    let clock = Clock { rotation_period_d: 2.0, epoch_d: 0.0 };
    let ephemeris = Ephemeris { planet: 0, conjunction_d: [5.0, 0.0], period_d: [7.0, 0.0], shape: None, clock };
    let planet = KnownPlanet { ephemeris, alone: [-0.1, 0.02], k: None };
    let velocity = |k_kms| Tried::Known(&planet).velocities(&orbit(k_kms, 0.02, 0.0).unwrap(), &[0.3])[0];
    assert_eq!(velocity(-0.1), 0.0);
    assert!(velocity(0.1).abs() > 0.01);
}

fn orbit(k_kms: f64, sigma_k_kms: f64, delta_ln_l: f64) -> Option<CircularOrbit> {
    Some(CircularOrbit { k_kms, sigma_k_kms, phi: 0.0, sigma_phi: 0.1, delta_ln_l })
}

#[test]
fn what_hangs_on_a_choice_is_named() {
    let at = |k| AtTarget { chi2_target: 1.0, on_target: true, orbit: orbit(k, 0.02, 20.0) };
    let night = |orbit| WithoutNight { span_d: (0.0, 0.2), profiles: 4, orbit, delta_ln_p: Some(1.0) };
    let nights = vec![
        night(orbit(0.21, 0.025, 15.0)),
        night(orbit(0.2, 0.03, 7.0)),
        night(orbit(0.27, 0.0225, 15.0)),
        night(None),
    ];
    let targets = vec![at(0.205), at(0.2), at(0.192)];
    let steady = Robustness { all: orbit(0.2, 0.02, 20.0), targets, nights };
    assert_eq!(steady.held_out(), Some(HeldOut { delta_ln_p: 4.0, sigma_delta_ln_p: 0.0, nights: 4 }));
    assert_eq!(steady.target_matters(), None);
    let orbits = |nights: &Vec<&WithoutNight>| nights.iter().map(|n| n.orbit).collect::<Vec<_>>();
    let [moving, losing] = steady.decisive_nights(8.0);
    assert_eq!(orbits(&moving), vec![orbit(0.27, 0.0225, 15.0), None]);
    assert_eq!(orbits(&losing), vec![orbit(0.2, 0.03, 7.0)]);
    let shaky = Robustness { targets: vec![at(0.18), at(0.2), at(0.2)], ..steady };
    assert!((shaky.target_matters().unwrap() - 1.0).abs() < 1e-12);
}
