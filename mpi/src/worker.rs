//! The other ranks: they receive a brief and answer questions until they are dismissed.
//!
//! Every thread takes its questions from MPI and sends its answers itself, so that no other thread has to wake up while
//! all are busy; the main thread receives orders.

use super::message::{ANSWER, HELLO, ORDER, Order, number, numbered, question, split};
use super::nap::{WHILE_IDLE, Wait, nap};
use super::world::{Ranks, abort, first};
use dimcmc::internals::runs::pool::ranks::{self, Answering, Learn};
use mpi::environment::Universe;
use mpi::point_to_point::MatchedReceiveVec as _;
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator as _, Destination as _, Root as _, Source as _};
use std::error::Error;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Longest delay of an order; questions do not wait for it.
const UNHEARD: Duration = Duration::from_millis(5);

/// A rank that answers.
pub struct Worker {
    ranks: Ranks,
    at_once: usize,
}

impl Worker {
    pub(super) fn new(universe: Universe, at_once: usize) -> Self {
        Worker { ranks: Ranks::new(universe), at_once }
    }

    /// Answers questions on the brief of this number until the next one; `None` when dismissed.
    fn answer(&self, answer: &Answering, brief: usize) -> Option<Vec<u8>> {
        let (stop, over, ear) = (Arc::new(AtomicBool::new(false)), AtomicBool::new(false), Mutex::new(()));
        std::thread::scope(|scope| {
            for _ in 0..self.at_once {
                scope.spawn(|| {
                    while let Some(message) = next_question(brief, &ear, &over) {
                        let (place, question) = split(&message);
                        let message = numbered(place, &answer(question, &stop));
                        first(&SimpleCommunicator::world()).send_with_tag(&message[..], ANSWER);
                    }
                });
            }
            let next = self.wait(&stop);
            over.store(true, Relaxed);
            next
        })
    }

    /// Waits for the next brief, and forwards the order to end soon; `None` when dismissed.
    fn wait(&self, stop: &AtomicBool) -> Option<Vec<u8>> {
        loop {
            match self.order() {
                Order::Stop => stop.store(true, Relaxed),
                Order::Brief(length) => {
                    let mut brief = vec![0; length];
                    first(&self.ranks.world).broadcast_into(&mut brief[..]);
                    return Some(brief);
                }
                Order::Dismissed => return None,
            }
        }
    }

    /// Waits for the next order of rank 0.
    fn order(&self) -> Order {
        loop {
            match first(&self.ranks.world).immediate_matched_probe_with_tag(ORDER) {
                Some(found) => return Order::from_bytes(&found.matched_receive_vec::<u8>().0),
                None => std::thread::sleep(UNHEARD),
            }
        }
    }
}

impl ranks::Worker for Worker {
    fn rank(&self) -> i32 {
        self.ranks.world.rank()
    }

    fn serve(&self, learn: Learn<'_>) -> Result<(), Box<dyn Error>> {
        first(&self.ranks.world).send_with_tag(&number(self.at_once)[..], HELLO);
        let mut brief = self.wait(&AtomicBool::new(false));
        for number in 1.. {
            let Some(bytes) = brief else { break };
            brief = self.answer(&learn(&bytes)?, number);
        }
        Ok(())
    }

    fn abort(&self, code: i32) {
        abort(code);
    }
}

/// Waits for the next question on a brief until it is `over`; the thread that holds `ear` receives.
fn next_question(brief: usize, ear: &Mutex<()>, over: &AtomicBool) -> Option<Vec<u8>> {
    let _ear = ear.lock().unwrap_or_else(PoisonError::into_inner);
    let wait = Wait::new();
    while !over.load(Relaxed) {
        match first(&SimpleCommunicator::world()).immediate_matched_probe_with_tag(question(brief)) {
            Some(found) => return Some(found.matched_receive_vec::<u8>().0),
            None => nap(wait.nap(), WHILE_IDLE),
        }
    }
    None
}
