//! Who is asked next: whoever is free; and where more questions are left than all can take, whoever has only what it is at, so that it
//! need not wait for the next one.
//!
//! A question and its answer take 0.2 ms on the way, mostly of naps on both sides, where an evaluation may take one
//! (`results/scaling.md`). At the end of a batch nothing waits behind another question while somebody is idle. Left out: messages.

use mpi::Rank;

/// A rank with what it can do and has to do.
struct Hand {
    at_once: usize,
    open: usize,
}

/// The ranks from 1 on.
pub(super) struct Hands {
    ranks: Vec<Hand>,
    /// Ranks, each as often as it can begin with a question now.
    free: Vec<Rank>,
    /// Ranks that may have no more than they are at; who has more is passed over.
    ahead: Vec<Rank>,
}

impl Hands {
    /// All of them free. They are asked in turn, so that a batch that is short of questions is spread over all ranks.
    pub(super) fn new(at_once: &[(Rank, usize)]) -> Self {
        let most = at_once.iter().map(|(_, at_once)| *at_once).max().unwrap_or(0);
        let turn = |turn| at_once.iter().rev().filter(move |(_, at_once)| turn < *at_once).map(|(rank, _)| *rank);
        let free = (0..most).rev().flat_map(turn).collect();
        Hands { ranks: at_once.iter().map(|(_, n)| Hand { at_once: *n, open: 0 }).collect(), free, ahead: Vec::new() }
    }

    /// The next one to ask; one that is busy only if there are `many` questions.
    pub(super) fn take(&mut self, many: bool) -> Option<Rank> {
        let mut rank = self.free.pop();
        while rank.is_none() && many {
            let busy = self.ahead.pop()?;
            rank = Some(busy).filter(|busy| self.hand(*busy).open == self.hand(*busy).at_once);
        }
        let hand = self.hand(rank?);
        hand.open += 1;
        if hand.open == hand.at_once {
            self.ahead.extend(rank);
        }
        rank
    }

    /// A rank has answered.
    pub(super) fn give_back(&mut self, rank: Rank) {
        let hand = self.hand(rank);
        hand.open -= 1;
        if hand.open < hand.at_once { self.free.push(rank) } else { self.ahead.push(rank) }
    }

    fn hand(&mut self, rank: Rank) -> &mut Hand {
        &mut self.ranks[rank as usize - 1]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_free_ones_come_first_and_nobody_has_more_than_one_ahead() {
        let mut hands = Hands::new(&[(1, 1), (2, 2)]);
        let all: Vec<Option<Rank>> = (0..6).map(|_| hands.take(true)).collect();
        // both, the second thread of 2, one ahead for each, and no more
        assert_eq!(all[..3], [Some(1), Some(2), Some(2)]);
        let mut ahead = [all[3], all[4]];
        ahead.sort();
        assert_eq!((ahead, all[5]), ([Some(1), Some(2)], None));
        // it goes on with what it has ahead, and may have another only if there are many
        hands.give_back(1);
        assert_eq!(hands.take(false), None);
        assert_eq!(hands.take(true), Some(1));
        // 2 goes on with the one ahead, then has a thread free
        hands.give_back(2);
        hands.give_back(2);
        assert_eq!(hands.take(false), Some(2));
        assert_eq!(hands.take(false), None);
    }
}
