//! Rank 0: questions to free ranks, answers in order.

use super::hands::Hands;
use super::message::{ANSWER, HELLO, ORDER, Order, numbered, question, split};
use super::nap::{WHILE_BUSY, WHILE_IDLE, Wait, nap};
use super::world::Ranks;
use dimcmc::internals::runs::pool::ranks;
use mpi::Rank;
use mpi::environment::Universe;
use mpi::point_to_point::MatchedReceiveVec as _;
use mpi::traits::{Communicator as _, Destination as _, Root as _, Source as _};
use std::cell::{Cell, RefCell};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// The other ranks, from the first one; dropping it dismisses them.
pub struct Queue {
    ranks: Ranks,
    /// Number of questions that each answers at once.
    at_once: Vec<(Rank, usize)>,
    /// The last brief, and the number of briefs so far.
    brief: RefCell<(Vec<u8>, usize)>,
    /// Duration of a question on it, once it is known.
    each: Cell<Option<Duration>>,
}

impl Queue {
    /// Waits until all of them have started.
    pub(super) fn new(universe: Universe) -> Self {
        let ranks = Ranks::new(universe);
        let hello = |rank| {
            let (bytes, _) = ranks.world.process_at_rank(rank).receive_vec_with_tag::<u8>(HELLO);
            (rank, split(&bytes).0)
        };
        let at_once = (1..ranks.world.size()).map(hello).collect();
        Queue { ranks, at_once, brief: RefCell::default(), each: Cell::default() }
    }

    /// Sends all ranks the brief of the next questions, unless they have it; returns its number.
    fn tell(&self, brief: &[u8]) -> usize {
        let (last, number) = &mut *self.brief.borrow_mut();
        if last != brief {
            *last = brief.to_vec();
            *number += 1;
            self.each.set(None);
            self.order(Order::Brief(last.len()));
            self.ranks.world.process_at_rank(0).broadcast_into(&mut last[..]);
        }
        *number
    }

    fn order(&self, order: Order) {
        for (rank, _) in &self.at_once {
            self.ranks.world.process_at_rank(*rank).send_with_tag(&order.to_bytes()[..], ORDER);
        }
    }
}

impl ranks::Ranks for Queue {
    fn size(&self) -> usize {
        self.at_once.iter().map(|(_, at_once)| at_once).sum()
    }

    fn answers(&self, brief: &[u8], questions: &[Vec<u8>], stop: &AtomicBool) -> Vec<Vec<u8>> {
        let tag = question(self.tell(brief));
        let mut hands = Hands::new(&self.at_once);
        let mut answers: Vec<Option<Vec<u8>>> = vec![None; questions.len()];
        let mut left = questions.iter().enumerate();
        let (mut open, mut answered, mut hurried, mut wait) = (0, 0, false, Wait::new());
        let (began, size) = (Instant::now(), self.size() as u32);
        loop {
            let stopped = stop.load(Relaxed);
            if answered > 0 {
                // all are half through another one on average
                self.each.set(Some(began.elapsed() * size / (answered + size / 2)));
            }
            let each = self.each.get();
            while !stopped && left.len() > 0 {
                let Some(rank) = hands.take(left.len(), each) else { break };
                let (place, bytes) = left.next().expect("there are some left");
                self.ranks.world.process_at_rank(rank).send_with_tag(&numbered(place, bytes)[..], tag);
                open += 1;
            }
            if open == 0 {
                break;
            }
            if stopped && !hurried {
                self.order(Order::Stop);
                hurried = true;
            }
            match self.ranks.world.any_process().immediate_matched_probe_with_tag(ANSWER) {
                Some(found) => {
                    let (bytes, status) = found.matched_receive_vec::<u8>();
                    let (place, answer) = split(&bytes);
                    answers[place] = Some(answer.to_vec());
                    hands.give_back(status.source_rank());
                    (open, answered) = (open - 1, answered + 1);
                    wait = Wait::new();
                }
                None => match each.filter(|_| hands.ahead(left.len(), each) > 0) {
                    Some(each) => nap(each / 8, WHILE_BUSY),
                    None => nap(wait.nap(), WHILE_IDLE),
                },
            }
        }
        answers.into_iter().map_while(|answer| answer).collect()
    }
}

impl Drop for Queue {
    fn drop(&mut self) {
        // a job that panics is ended by the hook
        if !std::thread::panicking() {
            self.order(Order::Dismissed);
        }
    }
}

impl std::fmt::Debug for Queue {
    fn fmt(&self, formatter: &mut std::fmt::Formatter) -> std::fmt::Result {
        formatter.debug_struct("Queue").field("at_once", &self.at_once).finish_non_exhaustive()
    }
}
