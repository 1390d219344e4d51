//! The other ranks: told what questions are about, they answer until they are dismissed.
//!
//! MPI is the main thread's; questions are answered by threads of their own. Left out: the other side (`queue`).

use super::Ranks;
use super::message::{ANSWER, BRIEF, DISMISS, HELLO, QUESTION, STOP, number, numbered, split};
use super::nap::Nap;
use mpi::environment::Universe;
use mpi::point_to_point::MatchedReceiveVec as _;
use mpi::traits::{Communicator as _, Destination as _, Root as _, Source as _};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, mpsc};

/// Answers a question, from any thread; the flag is set when it is wanted soon.
pub type Answer<'a> = Box<dyn Fn(&[u8], &Arc<AtomicBool>) -> Vec<u8> + Sync + 'a>;

/// A rank that answers.
pub struct Worker {
    ranks: Ranks,
    at_once: usize,
}

/// What ends the questions about one thing.
enum Next {
    Brief(Vec<u8>),
    Dismissed,
}

impl Worker {
    pub(super) fn new(universe: Universe, at_once: usize) -> Self {
        Worker { ranks: Ranks::new(universe), at_once }
    }

    /// The number of this rank.
    pub fn rank(&self) -> i32 {
        self.ranks.world.rank()
    }

    /// Answers until dismissed, by what `learn` makes of each brief.
    ///
    /// # Errors
    /// What `learn` says; the other ranks wait for this one then, and must be ended.
    pub fn serve<'a, E>(&self, learn: impl Fn(&[u8]) -> Result<Answer<'a>, E>) -> Result<(), E> {
        self.first().send_with_tag(&number(self.at_once)[..], HELLO);
        let idle: Answer = Box::new(|_, _| unreachable!("nothing is asked before a brief"));
        let mut next = self.answer(&idle, 0);
        while let Next::Brief(brief) = next {
            next = self.answer(&learn(&brief)?, self.at_once);
        }
        Ok(())
    }

    /// Answers questions by so many threads until there is something else to do.
    fn answer(&self, answer: &Answer, threads: usize) -> Next {
        let stop = Arc::new(AtomicBool::new(false));
        let (ask, asked) = mpsc::channel::<Vec<u8>>();
        let (reply, replies) = mpsc::channel::<Vec<u8>>();
        let asked = Mutex::new(asked);
        std::thread::scope(|scope| {
            for _ in 0..threads {
                let (reply, asked, stop) = (reply.clone(), &asked, &stop);
                scope.spawn(move || {
                    loop {
                        let Ok(message) = asked.lock().expect("a panic ends the program").recv() else { break };
                        let (place, question) = split(&message);
                        // nobody listens any more only where the program ends
                        let _ = reply.send(numbered(place, &answer(question, stop)));
                    }
                });
            }
            let mut nap = Nap::new();
            // dropped with this closure, whereupon the threads end
            let ask = ask;
            loop {
                match self.hear(&ask, &stop) {
                    Some(ControlFlow::Break(next)) => return next,
                    Some(ControlFlow::Continue(())) => nap = Nap::new(),
                    None => {
                        // an answer ends the nap
                        if let Ok(message) = replies.recv_timeout(nap.length()) {
                            self.first().send_with_tag(&message[..], ANSWER);
                            nap = Nap::new();
                        }
                    }
                }
            }
        })
    }

    /// Takes the next message of rank 0, if there is one.
    fn hear(&self, ask: &mpsc::Sender<Vec<u8>>, stop: &AtomicBool) -> Option<ControlFlow<Next>> {
        let (bytes, status) = self.first().immediate_matched_probe()?.matched_receive_vec::<u8>();
        match status.tag() {
            QUESTION => ask.send(bytes).expect("the threads listen until the channel is closed"),
            STOP => stop.store(true, Relaxed),
            BRIEF => {
                let mut brief = vec![0; split(&bytes).0];
                self.first().broadcast_into(&mut brief[..]);
                return Some(ControlFlow::Break(Next::Brief(brief)));
            }
            DISMISS => return Some(ControlFlow::Break(Next::Dismissed)),
            tag => unreachable!("rank 0 sends no message with tag {tag}"),
        }
        Some(ControlFlow::Continue(()))
    }

    fn first(&self) -> mpi::topology::Process<'_> {
        self.ranks.world.process_at_rank(0)
    }
}
