//! Stars that differ little from a reference: their responses use its sorting of pixels.

use super::deposit::{Arranged, Observed};
use super::grid::SurfaceGrid;
use super::response::{DEPOSITS, Part, needs, observed};
use super::{Response, Seen, StarSettings, StarState};
use std::sync::Arc;

/// Largest displacement (rad) of a point of the surface: pixels up to this far beyond the limb are included, 2 % more
/// in every pass.
const MARGIN: f64 = 0.02;

/// Largest change of its velocity, in steps of the velocity grid, ...
const LARGEST_MOVE: f64 = 0.4;

/// ... and largest third power of it times the spread of a pixel's velocities, to which the error of the spread term
/// beyond the border of a cell is proportional. On the paper's setup errors of log-probabilities are 1.2e-4 at most at
/// these limits, and by less where pixels move less (`results/performance.md`).
const LARGEST_MOVE_OF_SPREAD: f64 = 0.01;

/// Largest spread: a pixel that appears point by point may move by as much.
const LARGEST_SPREAD: f64 = 4.0;

/// A star, with the sorting of its pixels for each data set.
#[derive(Clone, Debug)]
pub struct Nearby {
    state: StarState,
    pixels: Vec<Arranged>,
}

impl Nearby {
    /// The common part of responses close to a state of star and planet.
    pub fn new(grid: &SurfaceGrid, star: &StarSettings, state: &StarState, sets: &[Seen]) -> Self {
        let arranged = |set: &Seen| {
            let star = set.star(star, &state.surface);
            Arranged::new(&observed(grid, &star, state, set, false), MARGIN)
        };
        Nearby { state: *state, pixels: sets.iter().map(arranged).collect() }
    }

    /// The response at a state that is close by; `None` at any other. Everything else must be the same as before.
    pub fn response(
        &self,
        grid: &SurfaceGrid,
        star: &StarSettings,
        state: &StarState,
        sets: &[Seen],
    ) -> Option<Response> {
        let part = |(pixels, set): (&Arranged, &Seen)| {
            let star = &set.star(star, &state.surface);
            let deposits = || {
                DEPOSITS.map(|limb_alone| {
                    let observed = observed(grid, star, state, set, limb_alone);
                    needs(star, limb_alone).then(|| Arc::new(pixels.deposit(&observed)))
                })
            };
            let is_close = self.is_close(pixels, &observed(grid, star, state, set, false));
            is_close.then(|| Part::shifted(deposits(), star, state, set))
        };
        self.pixels.iter().zip(sets).map(part).collect::<Option<Vec<_>>>().map(Response::stacked)
    }

    /// Whether all pixels are nearly at their former positions.
    fn is_close(&self, pixels: &Arranged, star: &Observed) -> bool {
        let &Observed { grid, state, ref looks, step_kms, .. } = star;
        if step_kms != pixels.step_kms {
            return false;
        }
        let longest = looks.since_epoch_d.iter().fold(0.0, |longest: f64, time| longest.max(time.abs()));
        let tilt = (state.inclination - self.state.inclination).abs();
        grid.rings.iter().flat_map(|ring| &ring.points).all(|point| {
            let (sin, cos) = (point.sin_latitude, point.cos_latitude);
            let [was, is] = [&self.state, state].map(|s| s.vsini_kms * s.rotation.relative(sin) * cos);
            let [before, now] = [&self.state, state].map(|s| s.rotation.angular_velocity(sin));
            let turn = (now - before).abs() * longest;
            let moved = ((is - was).abs() + is.abs() * turn) / step_kms;
            let spread = 0.5 * (is * point.longitude_offset / step_kms).powi(2);
            cos * turn + tilt <= MARGIN
                && moved <= LARGEST_MOVE
                && moved.powi(3) * spread <= LARGEST_MOVE_OF_SPREAD
                && spread <= LARGEST_SPREAD
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::star::{LimbDarkening, LocalLine, Orbit, Quadrature, Regions, Rotation, Sampling};

    const STAR: StarSettings = StarSettings {
        rotation_period_d: 3.0,
        epoch_d: 0.0,
        limb_darkening: LimbDarkening::Linear(0.7),
        contrast: 0.5,
        line: LocalLine {
            sigma_kms: 3.18,
            instrumental_sigma_kms: 0.0,
            gamma_kms: 0.0,
            equivalent_width_kms: Some(5.8),
        },
        regions: Regions::PLAIN,
    };

    /// The star, and one that differs by this much.
    fn star(rotation: f64, shear: f64, tilt: f64, vsini_kms: f64) -> StarState {
        StarState {
            rotation: Rotation { omega_eq_rad_d: 2.1 + rotation, domega_rad_d: 0.05 + shear },
            inclination: 0.7 + tilt,
            vsini_kms: 40.0 + vsini_kms,
            vsys_kms: 0.3,
            motion: Orbit { k_kms: 0.1, porb_over_prot: 1.7, phi: 0.4 }.into(),
            surface: Default::default(),
        }
    }

    fn sampling() -> [Seen; 1] {
        [Sampling { step_kms: 1.8, profiles: (0..5).map(|k| (2.0 * k as f64, -50.0, 57)).collect() }.into()]
    }

    #[test]
    fn stars_close_by_are_seen_as_if_they_had_been_sorted() {
        let sampling = &sampling();
        // as many pixels as make all orders of cells; changes that are nearly the largest allowed
        for (pixels, quadrature, moves) in [
            (7, Quadrature::Centre, 1.0),
            (900, Quadrature::Gauss2x2, 0.45),
            (2000, Quadrature::Gauss2x2, 0.65),
            (13_000, Quadrature::Gauss2x2, 1.0),
            (41_000, Quadrature::Centre, 1.0),
        ] {
            let grid = &SurfaceGrid::equal_area(pixels, quadrature);
            let nearby = Nearby::new(grid, &STAR, &star(0.0, 0.0, 0.0, 0.0), sampling);
            let map: Vec<f64> = (0..grid.len()).map(|p| 0.8 + 0.2 * (0.7 * p as f64).sin()).collect();
            let others = [[0.0; 4], [1e-3, 0.0, 0.01, 0.0], [-2e-4, 5e-4, -0.015, -0.2], [0.0, 0.0, 0.0199, 0.0]];
            for [rotation, shear, tilt, vsini] in others {
                let state = star(moves * rotation, moves * shear, tilt, moves * vsini);
                let sorted = Response::of_sets(grid, &STAR, &state, sampling);
                let again = nearby.response(grid, &STAR, &state, sampling).expect("a star close by");
                let [(line, continuum), (line_again, continuum_again)] = [&sorted, &again].map(|response| {
                    let (mut line, mut continuum) = (vec![0.0; response.data_len()], vec![0.0; response.profiles()]);
                    response.apply(&map, &mut line, &mut continuum);
                    (line, continuum)
                });
                let off = |a: &[f64], b: &[f64]| a.iter().zip(b).fold(0.0, |off: f64, (a, b)| off.max((a - b).abs()));
                let deepest = line.iter().fold(0.0, |deepest: f64, depth| deepest.max(*depth));
                let line = off(&line, &line_again) / deepest;
                assert!(line < 3e-7, "{pixels} pixels, {state:?}: {line:e}");
                // no pixel at the limb is missing
                let continuum = off(&continuum, &continuum_again);
                assert!(continuum < 1e-12, "{pixels} pixels, {state:?}: {continuum:e}");
            }
        }
    }

    #[test]
    fn stars_farther_away_are_refused() {
        let (grid, sampling) = (&SurfaceGrid::equal_area(900, Quadrature::Gauss2x2), &sampling());
        let nearby = Nearby::new(grid, &STAR, &star(0.0, 0.0, 0.0, 0.0), sampling);
        let is_close = |star: &StarSettings, state: StarState| nearby.response(grid, star, &state, sampling).is_some();
        assert!(is_close(&STAR, star(0.0, 0.0, 0.0, 0.0)));
        for far in
            [star(2e-3, 0.0, 0.0, 0.0), star(0.0, 0.01, 0.0, 0.0), star(0.0, 0.0, -0.03, 0.0), star(0.0, 0.0, 0.0, 0.5)]
        {
            assert!(!is_close(&STAR, far), "{far:?}");
        }
        // NaN is never close
        assert!(!is_close(&STAR, star(f64::NAN, 0.0, 0.0, 0.0)));
        // pixels as wide as several steps
        let coarse = &SurfaceGrid::equal_area(100, Quadrature::Gauss2x2);
        let state = star(0.0, 0.0, 0.0, 0.0);
        assert!(Nearby::new(coarse, &STAR, &state, sampling).response(coarse, &STAR, &state, sampling).is_none());
        // another velocity grid
        let narrow = StarSettings { line: LocalLine { sigma_kms: 2.0, ..STAR.line }, ..STAR };
        assert!(!is_close(&narrow, star(0.0, 0.0, 0.0, 0.0)));
    }
}
