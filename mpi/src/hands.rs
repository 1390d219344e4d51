//! The order of the questions: the rank with the least work is next; with more questions left than all ranks can take
//! at once, some have questions queued, so that no rank is idle.
//!
//! The transfer of a question and its answer takes a quarter of a millisecond, and several where rank 0 has to wait for
//! a processor, while an evaluation may take one (`results/scaling.md`). The longer they take and the fewer are left,
//! the fewer are queued (guided self-scheduling, Polychronopoulos & Kuck 1987): at the end of a batch no question is
//! queued behind another one while a rank is idle.

use std::collections::BTreeSet;
use std::time::Duration;

/// The number of a rank, as MPI has it.
type Rank = i32;

/// Most rounds queued.
const MOST_AHEAD: usize = 8;

/// Duration of the queue: several times the time for which rank 0 waits for a busy processor (with a third of it, a
/// tenth of the evaluations is lost).
const BRIDGED: Duration = Duration::from_millis(30);

/// Longer questions, such as a star, wait for the first free rank.
const WORTH_A_WAIT: Duration = Duration::from_secs(1);

/// A rank with its capacity and work.
struct Hand {
    at_once: usize,
    open: usize,
}

impl Hand {
    /// Questions that each of its threads has to answer before it begins with another.
    fn rounds(&self) -> usize {
        self.open / self.at_once
    }
}

/// The ranks from 1 on.
pub(super) struct Hands {
    ranks: Vec<Hand>,
    /// All of them by their rounds of work.
    by_rounds: BTreeSet<(usize, Rank)>,
    size: usize,
}

impl Hands {
    /// All ranks free.
    pub(super) fn new(at_once: &[(Rank, usize)]) -> Self {
        Hands {
            ranks: at_once.iter().map(|(_, at_once)| Hand { at_once: *at_once, open: 0 }).collect(),
            by_rounds: at_once.iter().map(|(rank, _)| (0, *rank)).collect(),
            size: at_once.iter().map(|(_, at_once)| at_once).sum(),
        }
    }

    /// The next rank, if so many questions are left, each of which takes this time where it is known.
    pub(super) fn take(&mut self, left: usize, each: Option<Duration>) -> Option<Rank> {
        let &(rounds, rank) = self.by_rounds.first()?;
        (rounds <= self.ahead(left, each)).then(|| self.change(rank, |open| open + 1))
    }

    /// Rounds that each rank may have queued.
    pub(super) fn ahead(&self, left: usize, each: Option<Duration>) -> usize {
        match each {
            Some(each) if left > self.size && each < WORTH_A_WAIT => {
                let bridged = BRIDGED.div_duration_f64(each) as usize;
                (left / (2 * self.size)).min(bridged).clamp(1, MOST_AHEAD)
            }
            _ => 0,
        }
    }

    /// A rank has answered.
    pub(super) fn give_back(&mut self, rank: Rank) {
        self.change(rank, |open| open - 1);
    }

    fn change(&mut self, rank: Rank, open: impl Fn(usize) -> usize) -> Rank {
        let hand = &mut self.ranks[rank as usize - 1];
        self.by_rounds.remove(&(hand.rounds(), rank));
        hand.open = open(hand.open);
        self.by_rounds.insert((hand.rounds(), rank));
        rank
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_has_least_to_do_comes_first_and_fewer_are_ahead_the_fewer_are_left() {
        let mut hands = Hands::new(&[(1, 1), (2, 2)]);
        let slow = Some(WORTH_A_WAIT / 2);
        // three at once; as many queued while there are more, and then none
        let taken: Vec<Option<Rank>> = (0..7).map(|_| hands.take(4, slow)).collect();
        assert_eq!(taken, [1, 2, 2, 1, 2, 2, 0].map(|rank| (rank > 0).then_some(rank)));
        assert_eq!(hands.take(3, slow), None);
        hands.give_back(1);
        assert_eq!(hands.take(3, slow), None);
        hands.give_back(1);
        assert_eq!(hands.take(3, slow), Some(1));
        // in a long batch more the less each takes, but none for long questions or while the time is unknown
        let mut ahead = |each| (0..100).filter_map(|_| hands.take(10_000, each)).count();
        assert_eq!([ahead(None), ahead(Some(WORTH_A_WAIT)), ahead(slow)], [0, 0, 1]);
        assert_eq!(ahead(Some(BRIDGED / 3)), 6);
        assert_eq!(ahead(Some(Duration::from_micros(1))), 3 * (MOST_AHEAD - 3));
    }
}
