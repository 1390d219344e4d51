//! Measurements of a light curve that no spots explain: single outliers, and flares.
//!
//! Spots change the flux on the time scale of a rotation. Each measurement is compared with a parabola through those of
//! a twelfth of a rotation before and after it, robust against a minority of outliers (least absolute deviations), in
//! units of its uncertainty or of the scatter around the parabolas, whichever is larger. Parabolas are fitted again
//! without the outliers, until nothing changes. A dip of several measurements may be a transit: it is reported, and
//! kept.

use super::{Flux, segments};
use nalgebra::{Matrix3, Vector3};
use std::ops::Range;

/// Half of the window of a parabola, in rotations.
const HALF_WINDOW: f64 = 1.0 / 12.0;

/// Parabolas per window: each serves the measurements around its middle.
const CELLS: f64 = 4.0;

/// Factors on a window with too few measurements.
const WIDER: [f64; 3] = [1.0, 1.5, 2.0];

/// Fewest measurements for a parabola to identify outliers,
const FEWEST: usize = 7;

/// and on each side, where any lie there: it is unreliable beyond them.
const EACH_SIDE: usize = 3;

/// A measurement so many standard deviations away is an outlier.
const WILD: f64 = 5.0;

/// Those beside a bright outlier belong to the same flare while they exceed this,
const FLARE: f64 = 2.0;

/// and those beside a faint outlier to the same dip while they are at least this far below.
const DIP: f64 = 3.0;

/// A dip of more measurements than this is kept,
const LONGEST_DIP: usize = 2;

/// unless it reduces the flux by more than this fraction, which neither spots nor planets do.
const DEEPEST: f64 = 0.5;

/// Error of a parabola as a fraction of the changes of the flux by spots, for [`WILD`] standard deviations; in a wider
/// window it grows with the third power of the factor.
const OF_SPOTS: f64 = 0.02;

/// Where neighbours are too few, a measurement farther than this fraction of the median flux from it is an outlier.
const ALONE: f64 = 0.3;

/// Iterations of parabolas without the outliers.
const ROUNDS: usize = 10;

/// Iterations of the least absolute deviations.
const STEPS: usize = 25;

/// The outliers of a light curve.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outliers {
    /// Indices of the outliers, in the order of time, each with the flux predicted from its neighbours.
    pub wild: Vec<(usize, f64)>,
    /// Dips that are kept.
    pub dips: Vec<Range<usize>>,
}

/// The outliers among measurements in the order of time, of a star with this rotation period (d), whose segments are
/// separated by gaps of more than `gap_d` (d).
pub fn outliers(measured: &[Flux], rotation_period_d: f64, gap_d: f64) -> Outliers {
    let mut all = Outliers::default();
    let mut first = 0;
    for segment in segments(measured, gap_d) {
        let Outliers { wild, dips } = Segment { measured: segment, rotation_period_d }.outliers();
        all.wild.extend(wild.into_iter().map(|(k, expected)| (first + k, expected)));
        all.dips.extend(dips.into_iter().map(|dip| first + dip.start..first + dip.end));
        first += segment.len();
    }
    all
}

/// A segment of a light curve.
struct Segment<'a> {
    measured: &'a [Flux],
    rotation_period_d: f64,
}

/// A measurement compared with its neighbours.
#[derive(Clone, Copy)]
struct Judged {
    /// Flux predicted from them.
    expected: f64,
    /// Height above that, in standard deviations.
    above: f64,
}

impl Segment<'_> {
    fn outliers(&self) -> Outliers {
        let mut found = Outliers::default();
        // neither outliers nor dips are used for predictions beside them
        let mut trusted = vec![true; self.measured.len()];
        let mut judged = Vec::new();
        for _ in 0..ROUNDS {
            judged = self.judged(&trusted, &judged);
            found = self.told(&judged);
            let mut now = vec![true; self.measured.len()];
            for flare in found.wild.chunk_by(|a, b| a.0 + 1 == b.0) {
                // nor is the tail of a flare, which is assumed to last as long as its detected part
                let tail = if flare.len() > LONGEST_DIP { flare.len() } else { 0 };
                let (first, last) = (flare[0].0, flare[flare.len() - 1].0 + tail);
                now[first..=last.min(self.measured.len() - 1)].fill(false);
            }
            found.dips.iter().for_each(|dip| now[dip.clone()].fill(false));
            if now == trusted {
                break;
            }
            trusted = now;
        }
        found
    }

    /// Comparison of each with the trusted measurements; where these are too few, as `before`.
    fn judged(&self, trusted: &[bool], before: &[Judged]) -> Vec<Judged> {
        let cells = self.cells();
        let parabolas: Vec<Option<Parabola>> = cells.iter().map(|cell| self.parabola(cell, trusted)).collect();
        let expected = |(cell, parabola): (&Range<usize>, &Option<Parabola>)| {
            let of = |one: &Flux| parabola.as_ref().map(|parabola| parabola.at(one.time_d));
            self.measured[cell.clone()].iter().map(of).collect::<Vec<_>>()
        };
        let expected: Vec<Option<f64>> = cells.iter().zip(&parabolas).flat_map(expected).collect();
        let spread = self.spread(trusted);
        let off = |k: usize| Some((self.measured[k].flux - expected[k]?) / self.measured[k].sigma);
        let mut judged = Vec::with_capacity(self.measured.len());
        for (cell, parabola) in cells.into_iter().zip(parabolas) {
            let scatter = self.scatter(&cell, &off);
            for k in cell {
                let one = &self.measured[k];
                let said = |expected: f64, sd: f64| Judged { expected, above: (one.flux - expected) / sd };
                judged.push(match (expected[k], &parabola) {
                    (Some(expected), Some(Parabola { wider, .. })) => {
                        said(expected, one.sigma * scatter + OF_SPOTS * wider.powi(3) * spread.width / WILD)
                    }
                    _ => match before.get(k) {
                        Some(before) => *before,
                        None => said(spread.median, one.sigma + ALONE * spread.median / WILD),
                    },
                });
            }
        }
        judged
    }

    /// Measurements that share a parabola.
    fn cells(&self) -> Vec<Range<usize>> {
        let width_d = 2.0 * HALF_WINDOW * self.rotation_period_d / CELLS;
        let mut next = 0;
        let of_cell = |cell: &[Flux]| {
            next += cell.len();
            next - cell.len()..next
        };
        super::cells(self.measured, width_d).map(of_cell).collect()
    }

    /// The measurements between two times (d), as indices.
    fn within(&self, [first_d, last_d]: [f64; 2]) -> Range<usize> {
        let before = |time_d: f64| self.measured.partition_point(|one| one.time_d < time_d);
        before(first_d)..self.measured.partition_point(|one| one.time_d <= last_d)
    }

    /// A parabola through trusted measurements around those of a cell.
    fn parabola(&self, cell: &Range<usize>, trusted: &[bool]) -> Option<Parabola> {
        let time_d = 0.5 * (self.measured[cell.start].time_d + self.measured[cell.end - 1].time_d);
        let trusted_in = |all: Range<usize>| all.filter(|k| trusted[*k]).map(|k| &self.measured[k]).collect::<Vec<_>>();
        WIDER.iter().find_map(|wider| {
            let half_d = wider * HALF_WINDOW * self.rotation_period_d;
            let all = self.within([time_d - half_d, time_d + half_d]);
            let around = trusted_in(all.clone());
            let is_enough = |side: Range<usize>| {
                side.is_empty() || {
                    let needed = EACH_SIDE.min(side.len());
                    trusted_in(side).len() >= needed
                }
            };
            let is_between = is_enough(all.start..cell.start) && is_enough(cell.end..all.end);
            let is_enough = around.len() >= FEWEST && is_between;
            if is_enough { Parabola::through(&around, time_d, half_d, *wider) } else { None }
        })
    }

    /// Scatter around parabolas within a rotation of a cell, in units of the errors, at least 1.
    fn scatter(&self, cell: &Range<usize>, off: &dyn Fn(usize) -> Option<f64>) -> f64 {
        /// Standard deviation over the median deviation.
        const OF_MEDIAN: f64 = 1.4826;
        let [first, last] = [cell.start, cell.end - 1].map(|k| self.measured[k].time_d);
        let around = self.within([first - self.rotation_period_d, last + self.rotation_period_d]);
        let mut off: Vec<f64> = around.filter_map(off).map(f64::abs).collect();
        off.sort_by(f64::total_cmp);
        off.get(off.len() / 2).map_or(1.0, |median| (OF_MEDIAN * median).max(1.0))
    }

    /// Median of the trusted ones, and the distance between their 5 and 95 % quantiles.
    fn spread(&self, trusted: &[bool]) -> Spread {
        let kept = self.measured.iter().zip(trusted).filter(|(_, trusted)| **trusted);
        let mut fluxes: Vec<f64> = kept.map(|(one, _)| one.flux).collect();
        fluxes.sort_by(f64::total_cmp);
        let at = |share: f64| fluxes.get((share * fluxes.len() as f64) as usize).copied().unwrap_or_default();
        Spread { median: at(0.5), width: at(0.95) - at(0.05) }
    }

    /// The outliers among compared measurements, and dips that may be transits.
    fn told(&self, judged: &[Judged]) -> Outliers {
        let mut found = Outliers::default();
        let sign = |one: &Judged| match one.above {
            up if up > FLARE => 1,
            down if down < -DIP => -1,
            _ => 0,
        };
        let mut first = 0;
        for run in judged.chunk_by(|a, b| sign(a) == sign(b)) {
            let all = first..first + run.len();
            first += run.len();
            let named = |k: usize| (k, judged[k].expected);
            match sign(&run[0]) {
                0 => {}
                1 if run.iter().any(|one| one.above > WILD) => found.wild.extend(all.map(named)),
                -1 if run.iter().any(|one| one.above < -WILD) => {
                    let is_deep = |k: &usize| self.measured[*k].flux < DEEPEST * judged[*k].expected;
                    let deep = all.clone().filter(is_deep).count();
                    if all.len() - deep <= LONGEST_DIP {
                        found.wild.extend(all.map(named));
                    } else {
                        found.wild.extend(all.clone().filter(is_deep).map(named));
                        found.dips.push(all);
                    }
                }
                _ => {}
            }
        }
        found
    }
}

struct Spread {
    median: f64,
    width: f64,
}

/// A parabola in time.
struct Parabola {
    middle_d: f64,
    half_d: f64,
    /// Half the window, in units of the usual one.
    wider: f64,
    coefficients: Vector3<f64>,
}

impl Parabola {
    /// Least absolute deviations, in units of the uncertainties: least squares with weights that fall with the
    /// distance.
    fn through(around: &[&Flux], middle_d: f64, half_d: f64, wider: f64) -> Option<Self> {
        let powers = |one: &Flux| {
            let x = (one.time_d - middle_d) / half_d;
            Vector3::new(1.0, x, x * x)
        };
        // relative to one of them, so that sums of large fluxes lose no precision
        let from = around[0].flux;
        let mut coefficients = Vector3::zeros();
        for step in 0..STEPS {
            let (mut normal, mut along) = (Matrix3::zeros(), Vector3::zeros());
            for one in around {
                let powers = powers(one);
                let off = ((one.flux - from - powers.dot(&coefficients)) / one.sigma).abs();
                /// Deviations below this fraction of an uncertainty count as zero.
                const NONE: f64 = 0.05;
                let weight = if step == 0 { 1.0 } else { off.max(NONE).recip() } / (one.sigma * one.sigma);
                normal += weight * powers * powers.transpose();
                along += weight * (one.flux - from) * powers;
            }
            coefficients = normal.cholesky()?.solve(&along);
        }
        coefficients[0] += from;
        Some(Parabola { middle_d, half_d, wider, coefficients })
    }

    fn at(&self, time_d: f64) -> f64 {
        let x = (time_d - self.middle_d) / self.half_d;
        self.coefficients.dot(&Vector3::new(1.0, x, x * x))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    const PERIOD_D: f64 = 3.0;
    const SIGMA: f64 = 3e-4;

    /// A spotted star for twelve days, with noise, and an addition to its flux.
    fn seen(cadence_d: f64, added: impl Fn(f64) -> f64) -> Vec<Flux> {
        let mut state = 1u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 11) as f64 + 0.5) / (1u64 << 53) as f64
        };
        let flux = |k: usize| {
            let time_d = 2_459_000.5 + k as f64 * cadence_d;
            let turn = TAU * k as f64 * cadence_d / PERIOD_D;
            let spots = 0.97 + 0.02 * turn.cos() + 0.008 * (2.0 * turn + 1.0).cos() + 0.003 * (3.0 * turn).sin();
            let noise = (-2.0 * uniform().ln()).sqrt() * (TAU * uniform()).cos();
            Flux { time_d, flux: spots + SIGMA * noise + added(time_d - 2_459_000.5), sigma: SIGMA }
        };
        (0..(12.0 / cadence_d) as usize).map(flux).collect()
    }

    fn wild(measured: &[Flux]) -> Vec<usize> {
        outliers(measured, PERIOD_D, 3.0).wild.into_iter().map(|(k, _)| k).collect()
    }

    #[test]
    fn a_spotted_star_has_none() {
        for cadence_d in [0.002, 0.02, 0.05, 0.1, 0.3, 1.0] {
            let mut measured = seen(cadence_d, |_| 0.0);
            assert_eq!(outliers(&measured, PERIOD_D, 3.0), Outliers::default(), "every {cadence_d} d");
            // nor with a gap of a day and uncertainties that are three times too small
            measured.retain(|one| !(2_459_004.0..2_459_005.0).contains(&one.time_d));
            measured.iter_mut().for_each(|one| one.sigma /= 3.0);
            assert_eq!(outliers(&measured, PERIOD_D, 3.0), Outliers::default(), "every {cadence_d} d");
        }
        // nor for a pulsating star
        let pulsating = seen(0.02, |t| 30.0 * SIGMA * (TAU * t / 0.13).sin());
        assert_eq!(outliers(&pulsating, PERIOD_D, 3.0), Outliers::default());
    }

    #[test]
    fn single_ones_are_found_wherever_they_are() {
        let clean = seen(0.02, |_| 0.0);
        for k in [0, 1, 185, 300, clean.len() - 1] {
            for factor in [0.0, 0.01, 0.95, 1.05, 1.2, 3.0] {
                let mut measured = clean.clone();
                measured[k].flux *= factor;
                assert_eq!(wild(&measured), [k], "measurement {k}, times {factor}");
            }
        }
        let mut two = clean.clone();
        two[200].flux = 1e-3;
        two[201].flux = 2e-3;
        assert_eq!(wild(&two), [200, 201]);
        // ten of bad pointing, which are too deep for a transit
        let mut ten = clean;
        ten[200..210].iter_mut().for_each(|one| one.flux *= 0.1);
        assert_eq!(wild(&ten), (200..210).collect::<Vec<_>>());
    }

    #[test]
    fn what_neighbours_expect_is_told() {
        let mut measured = seen(0.02, |_| 0.0);
        let before = measured[185].flux;
        measured[185].flux *= 3.0;
        let found = outliers(&measured, PERIOD_D, 3.0).wild[0].1;
        assert!((found - before).abs() < 5.0 * SIGMA, "{found}, not {before}");
    }

    #[test]
    fn flares_are_left_out_down_to_their_tails() {
        for height in [0.02, 0.2] {
            let flare = |t: f64| if t < 5.55 { 0.0 } else { height * (-(t - 5.55) / 0.06).exp() };
            let measured = seen(0.02, flare);
            let found = wild(&measured);
            let above = |k: usize| flare(measured[k].time_d - 2_459_000.5);
            // everything well above the noise, and little else
            assert!((0..measured.len()).all(|k| above(k) < 10.0 * SIGMA || found.contains(&k)), "{height}: {found:?}");
            assert!(found.iter().all(|k| above(*k) > 0.2 * SIGMA), "{height}: {found:?}");
        }
    }

    #[test]
    fn a_transit_is_told_of_and_kept() {
        let measured = seen(0.02, |t| if (5.0..5.15).contains(&t) { -0.01 } else { 0.0 });
        let Outliers { wild, dips } = outliers(&measured, PERIOD_D, 3.0);
        assert_eq!((wild.len(), dips.len(), dips.first()), (0, 1, Some(&(250..258))));
    }

    #[test]
    fn measurements_without_neighbours_are_wild_if_no_spots_do_that() {
        let mut measured = seen(1.0, |_| 0.0);
        measured[4].flux *= 3.0;
        measured[7].flux *= 0.01;
        assert_eq!(wild(&measured), [4, 7]);
    }
}
