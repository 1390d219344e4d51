//! Who is asked next: whoever has least to do; and where more questions are left than all can take at once, some have
//! questions ahead, so that nobody waits for the next one.
//!
//! A question and its answer take a quarter of a millisecond on the way, and several where rank 0 has to wait for a
//! processor, while an evaluation may take one (`results/scaling.md`). Fewer are ahead the longer they take, and the
//! fewer are left (guided self-scheduling, Polychronopoulos & Kuck 1987): at the end of a batch nothing waits behind
//! another question while somebody is idle.

use mpi::Rank;
use std::collections::BTreeSet;
use std::time::Duration;

/// Most rounds ahead.
const MOST_AHEAD: usize = 8;

/// How long what is ahead is to last: several times what rank 0 waits for a processor that others are at (with
/// a third of it, a tenth of the evaluations is lost).
const BRIDGED: Duration = Duration::from_millis(30);

/// Questions that take as long, a star say, wait for whoever is free first.
const WORTH_A_WAIT: Duration = Duration::from_secs(1);

/// A rank with what it can do and has to do.
struct Hand {
    at_once: usize,
    open: usize,
}

impl Hand {
    /// Questions that every one of its threads has to answer before it begins with another.
    fn rounds(&self) -> usize {
        self.open / self.at_once
    }
}

/// The ranks from 1 on.
pub(super) struct Hands {
    ranks: Vec<Hand>,
    /// All of them by the rounds that they have to do.
    by_rounds: BTreeSet<(usize, Rank)>,
    size: usize,
}

impl Hands {
    /// All of them free.
    pub(super) fn new(at_once: &[(Rank, usize)]) -> Self {
        Hands {
            ranks: at_once.iter().map(|(_, at_once)| Hand { at_once: *at_once, open: 0 }).collect(),
            by_rounds: at_once.iter().map(|(rank, _)| (0, *rank)).collect(),
            size: at_once.iter().map(|(_, at_once)| at_once).sum(),
        }
    }

    /// The next one to ask when so many questions are left, each of which takes so long as far as it is known.
    pub(super) fn take(&mut self, left: usize, each: Option<Duration>) -> Option<Rank> {
        let &(rounds, rank) = self.by_rounds.first()?;
        (rounds <= self.ahead(left, each)).then(|| self.change(rank, |open| open + 1))
    }

    /// Rounds that all may have ahead.
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
        // three at once; as many ahead again while there are more, and then none
        let taken: Vec<Option<Rank>> = (0..7).map(|_| hands.take(4, slow)).collect();
        assert_eq!(taken, [1, 2, 2, 1, 2, 2, 0].map(|rank| (rank > 0).then_some(rank)));
        assert_eq!(hands.take(3, slow), None);
        hands.give_back(1);
        assert_eq!(hands.take(3, slow), None);
        hands.give_back(1);
        assert_eq!(hands.take(3, slow), Some(1));
        // of a long batch more the less each takes, but for long ones and as long as it is not known
        let mut ahead = |each| (0..100).filter_map(|_| hands.take(10_000, each)).count();
        assert_eq!([ahead(None), ahead(Some(WORTH_A_WAIT)), ahead(slow)], [0, 0, 1]);
        assert_eq!(ahead(Some(BRIDGED / 3)), 6);
        assert_eq!(ahead(Some(Duration::from_micros(1))), 3 * (MOST_AHEAD - 3));
    }
}
