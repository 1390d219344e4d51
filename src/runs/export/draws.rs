//! The order of the draws where an ensemble is one chain: all its walkers one after the other, first the early half of
//! each, then the late half.
//!
//! - R-hat and ESS of other programs compare chains, and treat the draws of each as a time series. Ensembles are
//!   independent of each other, so an ensemble is a chain.
//! - Within it a walker's steps stay together: the correlation of successive steps appears at lag 1, 2, ..., and ESS is
//!   ensembles x walkers x steps / tau. With the walkers of a step side by side it would appear at lags of 16, 32, ...
//!   (for 16 walkers), and be missed: sums over lags stop at the first negative one, and ESS would be ten times too
//!   high for a tau of 12.
//! - Programs split a chain into two halves to detect a drift. With the early half of every walker first, that split
//!   separates early steps from late ones, as in `summary.json`: R-hat of the two is the same. For an odd number of
//!   steps the middle one is early for the first half of the walkers and late for the second; `summary.json` omits it.
//!
//! Limitations: where one walker ends and another begins, neighbours are independent. That reduces the correlation by a
//! fraction of tau / (steps / 2). And correlations between walkers of an ensemble at different times are missed: the
//! ESS of `summary.json`, from the means of whole ensembles, includes them, with more noise. In chains of 40 steps the
//! two differed by up to a factor of two.

use crate::sampling::chain::{Chain, Record};
use std::ops::Range;

/// Draws of every ensemble: indices of their records among those of the chain.
#[derive(Clone, Debug, PartialEq)]
pub struct Draws {
    /// `[ensemble][draw]`.
    places: Vec<Vec<usize>>,
}

impl Draws {
    /// Draws of the steps in `steps`.
    pub fn of(chain: &Chain, steps: Range<usize>) -> Self {
        let shape = chain.shape();
        let order = order(steps, shape.walkers);
        let place =
            |ensemble: usize, [step, walker]: [usize; 2]| step * shape.size() + ensemble * shape.walkers + walker;
        let ensemble = |e: usize| order.iter().map(|draw| place(e, *draw)).collect();
        Draws { places: (0..shape.ensembles).map(ensemble).collect() }
    }

    /// Number of ensembles, and of draws in each.
    pub fn shape(&self) -> [usize; 2] {
        [self.places.len(), self.places.first().map_or(0, Vec::len)]
    }

    /// Records of the draws, ensemble after ensemble.
    pub fn records<'a>(&'a self, chain: &'a Chain) -> impl Iterator<Item = &'a Record> {
        self.places.iter().flat_map(|places| self::records(places, chain))
    }

    /// Records of the draws of one ensemble.
    pub fn ensemble<'a>(&'a self, chain: &'a Chain, ensemble: usize) -> impl Iterator<Item = &'a Record> {
        records(&self.places[ensemble], chain)
    }
}

fn records<'a>(places: &'a [usize], chain: &'a Chain) -> impl Iterator<Item = &'a Record> {
    places.iter().map(|&place| &chain.records()[place])
}

/// Step and walker of the draws of an ensemble.
fn order(steps: Range<usize>, walkers: usize) -> Vec<[usize; 2]> {
    let cut = |walker: usize| steps.start + (steps.len() + usize::from(walker < walkers / 2)) / 2;
    let of = |walker: usize, range: Range<usize>| range.map(move |step| [step, walker]);
    let early = (0..walkers).flat_map(|walker| of(walker, steps.start..cut(walker)));
    let late = (0..walkers).flat_map(|walker| of(walker, cut(walker)..steps.end));
    early.chain(late).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_draw_once_and_early_ones_in_the_first_half() {
        for (steps, walkers) in [(3..9, 4), (3..10, 4), (0..1, 4), (0..2, 2), (5..5, 2), (2..7, 3)] {
            let found = order(steps.clone(), walkers);
            let mut sorted = found.clone();
            sorted.sort();
            let all: Vec<[usize; 2]> = steps.clone().flat_map(|step| (0..walkers).map(move |w| [step, w])).collect();
            assert_eq!(sorted, all);
            let half = found.len() / 2;
            let (early, late) = (&found[..half], &found[found.len() - half..]);
            let (last, first) = (early.iter().map(|d| d[0]).max(), late.iter().map(|d| d[0]).min());
            assert!(last <= first, "{steps:?} {walkers}: {found:?}");
        }
        assert_eq!(order(0..3, 2), [[0, 0], [1, 0], [0, 1], [2, 0], [1, 1], [2, 1]]);
    }
}
