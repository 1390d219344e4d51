//! Orbits of many periods, semi-amplitudes and phases, the fraction recovered, and the resulting limits.

use super::shortcut::Searches;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// The injected orbits.
#[derive(Clone, Debug, PartialEq)]
pub struct Orbits {
    /// Periods over the rotation period, rising.
    pub porb_over_prot: Vec<f64>,
    /// Their semi-amplitudes (km/s), rising.
    pub k_kms: Vec<f64>,
    /// Number of their phases, evenly spaced.
    pub phases: usize,
}

/// Orbits of one period and semi-amplitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Period over the rotation period.
    pub porb_over_prot: f64,
    /// Semi-amplitude (km/s).
    pub k_kms: f64,
    /// Number of phases.
    pub phases: usize,
    /// Number of those at which the search detects a planet.
    pub detected: usize,
    /// Number of these with the right period, to half the inverse time base.
    pub recovered: usize,
}

/// K above which planets of one period are recovered.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Limit {
    /// The period (d).
    pub period_d: f64,
    /// The same over the rotation period.
    pub porb_over_prot: f64,
    /// K recovered at half of the phases (km/s); `None` beyond the semi-amplitudes that were tried.
    pub k50_kms: Option<f64>,
    /// The same at 95 %.
    pub k95_kms: Option<f64>,
}

impl Orbits {
    /// Number of orbits.
    pub fn count(&self) -> usize {
        self.porb_over_prot.len() * self.k_kms.len() * self.phases
    }
}

/// `count` values, at least two, from `low` to `high`, evenly spaced in their logarithm.
pub fn even_in_logarithm(low: f64, high: f64, count: usize) -> Vec<f64> {
    (0..count).map(|k| low * (high / low).powf(k as f64 / (count - 1) as f64)).collect()
}

/// All orbits in the linearised search, cells period after period with K rising; `progress` is called with the number
/// done since the last call, from any thread.
pub fn recovered(searches: &Searches, orbits: &Orbits, progress: &(dyn Fn(usize) + Sync)) -> Vec<Cell> {
    let column = |porb_over_prot: &f64| {
        let search = searches.of_period(*porb_over_prot);
        let cell = |k_kms: &f64| {
            let outcomes = (0..orbits.phases).map(|phase| search(*k_kms, phase as f64 / orbits.phases as f64));
            let (mut detected, mut recovered) = (0, 0);
            for outcome in outcomes {
                detected += usize::from(outcome.detected);
                recovered += usize::from(outcome.recovered);
            }
            progress(orbits.phases);
            Cell { porb_over_prot: *porb_over_prot, k_kms: *k_kms, phases: orbits.phases, detected, recovered }
        };
        orbits.k_kms.iter().map(cell).collect::<Vec<_>>()
    };
    // the level of a detection without an orbit, before all threads need it
    if let (Some(porb_over_prot), Some(k_kms)) = (orbits.porb_over_prot.first(), orbits.k_kms.first()) {
        searches.of_period(*porb_over_prot)(*k_kms, 0.0);
    }
    orbits.porb_over_prot.par_iter().flat_map_iter(column).collect()
}

/// The limit at every period.
pub fn limits(cells: &[Cell], rotation_period_d: f64) -> Vec<Limit> {
    let same = |a: &Cell, b: &Cell| a.porb_over_prot == b.porb_over_prot;
    let limit = |column: &[Cell]| Limit {
        period_d: rotation_period_d * column[0].porb_over_prot,
        porb_over_prot: column[0].porb_over_prot,
        k50_kms: reached(column, 0.5),
        k95_kms: reached(column, 0.95),
    };
    cells.chunk_by(same).map(limit).collect()
}

/// The K above which the recovered fraction stays at `share` or above, between the semi-amplitudes tried linear in ln
/// K.
fn reached(column: &[Cell], share: f64) -> Option<f64> {
    let part = |cell: &Cell| cell.recovered as f64 / cell.phases as f64;
    let below = column.iter().rposition(|cell| part(cell) < share);
    match below {
        None => column.first().map(|cell| cell.k_kms),
        Some(k) => {
            let (low, high) = (&column[k], column.get(k + 1)?);
            let along = (share - part(low)) / (part(high) - part(low));
            Some(low.k_kms * (high.k_kms / low.k_kms).powf(along))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_stand_between_the_semi_amplitudes() {
        let cell = |(k_kms, recovered)| Cell { porb_over_prot: 2.0, k_kms, phases: 10, detected: 10, recovered };
        let column = |counts: [usize; 4]| [0.1, 0.2, 0.4, 0.8].into_iter().zip(counts).map(cell).collect::<Vec<_>>();
        let limit = limits(&column([0, 2, 8, 10]), 3.0)[0];
        assert!((limit.k50_kms.unwrap() - 0.2 * 2f64.sqrt()).abs() < 1e-12, "{limit:?}");
        assert!((limit.k95_kms.unwrap() - 0.4 * 2f64.powf(0.75)).abs() < 1e-12, "{limit:?}");
        // not recovered if larger K are lost again
        let gap = limits(&column([5, 9, 4, 9]), 3.0)[0];
        assert!(gap.k50_kms.unwrap() > 0.4 && gap.k95_kms.is_none(), "{gap:?}");
        assert_eq!(limits(&column([10; 4]), 3.0)[0].k95_kms, Some(0.1));
    }
}
