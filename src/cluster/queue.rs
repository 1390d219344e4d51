//! Rank 0: questions out to whoever is free, answers back in order.
//!
//! Left out: the other side (`worker`), and who is next (`hands`).

use super::Ranks;
use super::hands::Hands;
use super::message::{ANSWER, BRIEF, DISMISS, HELLO, QUESTION, STOP, number, numbered, split};
use super::nap::Nap;
use mpi::Rank;
use mpi::environment::Universe;
use mpi::point_to_point::MatchedReceiveVec as _;
use mpi::traits::{Communicator as _, Destination as _, Root as _, Source as _};
use std::cell::RefCell;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// The other ranks, as the first one sees them; dismissed when this is dropped.
pub struct Queue {
    ranks: Ranks,
    /// How many questions each answers at once.
    at_once: Vec<(Rank, usize)>,
    /// What they were told last.
    brief: RefCell<Vec<u8>>,
}

impl Queue {
    /// Waits until all of them are there.
    pub(super) fn new(universe: Universe) -> Self {
        let ranks = Ranks::new(universe);
        let hello = |rank| {
            let (bytes, _) = ranks.world.process_at_rank(rank).receive_vec_with_tag::<u8>(HELLO);
            (rank, split(&bytes).0)
        };
        let at_once = (1..ranks.world.size()).map(hello).collect();
        Queue { ranks, at_once, brief: RefCell::default() }
    }

    /// How many questions are answered at once.
    pub fn size(&self) -> usize {
        self.at_once.iter().map(|(_, at_once)| at_once).sum()
    }

    /// The answers to the first of the `questions` about `brief`: to all, unless `stop` is set meanwhile, after which none is
    /// asked any more and those that were are waited for.
    pub fn answers(&self, brief: &[u8], questions: &[Vec<u8>], stop: &AtomicBool) -> Vec<Vec<u8>> {
        self.tell(brief);
        let mut hands = Hands::new(&self.at_once);
        let mut answers: Vec<Option<Vec<u8>>> = vec![None; questions.len()];
        let mut left = questions.iter().enumerate();
        let (mut open, mut hurried, mut nap) = (0, false, Nap::new());
        loop {
            let stopped = stop.load(Relaxed);
            while !stopped && left.len() > 0 {
                let Some(rank) = hands.take(left.len() > self.size()) else { break };
                let (place, question) = left.next().expect("there are some left");
                self.ranks.world.process_at_rank(rank).send_with_tag(&numbered(place, question)[..], QUESTION);
                open += 1;
            }
            if open == 0 {
                break;
            }
            if stopped && !hurried {
                self.send_all(STOP, &[]);
                hurried = true;
            }
            match self.ranks.world.any_process().immediate_matched_probe_with_tag(ANSWER) {
                Some(found) => {
                    let (bytes, status) = found.matched_receive_vec::<u8>();
                    let (place, answer) = split(&bytes);
                    answers[place] = Some(answer.to_vec());
                    hands.give_back(status.source_rank());
                    open -= 1;
                    nap = Nap::new();
                }
                None => nap.take(),
            }
        }
        answers.into_iter().map_while(|answer| answer).collect()
    }

    /// Tells all ranks what the next questions are about, unless they know.
    fn tell(&self, brief: &[u8]) {
        if *self.brief.borrow() == brief {
            return;
        }
        let mut bytes = brief.to_vec();
        self.send_all(BRIEF, &number(bytes.len()));
        self.ranks.world.process_at_rank(0).broadcast_into(&mut bytes[..]);
        self.brief.replace(bytes);
    }

    fn send_all(&self, tag: mpi::Tag, bytes: &[u8]) {
        for (rank, _) in &self.at_once {
            self.ranks.world.process_at_rank(*rank).send_with_tag(bytes, tag);
        }
    }
}

impl Drop for Queue {
    fn drop(&mut self) {
        // a job that panics is ended by the hook
        if !std::thread::panicking() {
            self.send_all(DISMISS, &[]);
        }
    }
}

impl std::fmt::Debug for Queue {
    fn fmt(&self, formatter: &mut std::fmt::Formatter) -> std::fmt::Result {
        formatter.debug_struct("Queue").field("at_once", &self.at_once).finish_non_exhaustive()
    }
}
