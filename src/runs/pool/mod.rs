//! Evaluates batches of parameter vectors on threads or MPI ranks. Answers are in the order of the questions; results
//! are independent of the backend.
//!
//! `target` passes a vector to the density of the surface model, `task` is the input with which another process
//! evaluates the same to the bit, `message` encodes questions and answers as bytes, `ranks` is what other processes
//! have to do.

mod message;
pub mod ranks;
mod target;
mod task;

pub use message::{Answer, Question, orbit_from_bytes};
pub use target::Target;
pub use task::{Asked, Brief, Task, TaskError};

use crate::sampling::log_density::{Evaluation, Evaluator, LogDensity as _};
use ranks::Ranks;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};
use std::sync::{Arc, OnceLock};

/// The backend of reconstructions, until it is told to stop: no reconstruction is begun after that, and current ones
/// are finished.
#[derive(Default)]
pub struct Pool {
    stop: Arc<AtomicBool>,
    workers: Workers,
}

#[derive(Default)]
enum Workers {
    /// Threads of this machine: one reconstruction is serial, a batch is spread over rayon's current pool.
    #[default]
    Threads,
    /// The other ranks of a cluster.
    Ranks(Box<dyn Ranks>),
}

impl Pool {
    /// The threads of this machine, until `stop` is set.
    pub fn threads(stop: Arc<AtomicBool>) -> Self {
        Pool { stop, workers: Workers::Threads }
    }

    /// The ranks of a cluster, until `stop` is set.
    pub fn ranks(ranks: Box<dyn Ranks>, stop: Arc<AtomicBool>) -> Self {
        Pool { stop, workers: Workers::Ranks(ranks) }
    }

    /// Number of concurrent reconstructions.
    pub fn size(&self) -> usize {
        match &self.workers {
            Workers::Threads => rayon::current_num_threads(),
            Workers::Ranks(ranks) => ranks.size(),
        }
    }

    /// Whether other processes are involved, and may end the job.
    pub fn is_of_ranks(&self) -> bool {
        !matches!(self.workers, Workers::Threads)
    }

    /// Set by the caller to stop.
    pub fn stop(&self) -> &AtomicBool {
        &self.stop
    }

    /// The same, to be shared with others.
    pub fn shared_stop(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.stop)
    }

    /// Whether it was told to stop.
    pub fn stopped(&self) -> bool {
        self.stop.load(Relaxed)
    }

    /// The answers to the first questions: to all, unless told to stop meanwhile. Other processes use `brief` (a
    /// [`Brief`] as bytes), this one uses `here`, which is equivalent.
    pub fn answers<Q: Question, A: Answer>(
        &self,
        brief: &[u8],
        questions: &[Q],
        here: impl Fn(&Q) -> A + Sync,
    ) -> Vec<A> {
        self.by_ranks_or(brief, questions, || {
            // threads see only the flag: MPI stays on this one
            let stop = self.stop();
            let answer = |question| (!stop.load(Relaxed)).then(|| here(question));
            let all: Vec<Option<A>> = questions.par_iter().with_max_len(1).map(answer).collect();
            all.into_iter().map_while(|answer| answer).collect()
        })
    }

    /// The same for questions that require their own batches: one thread each, and no thread that waits for a batch
    /// takes another question meanwhile, as rayon's would.
    pub fn answers_apart<Q: Question, A: Answer + Sync>(
        &self,
        brief: &[u8],
        questions: &[Q],
        here: impl Fn(&Q) -> A + Sync,
    ) -> Vec<A> {
        self.by_ranks_or(brief, questions, || {
            let (stop, next) = (self.stop(), AtomicUsize::new(0));
            let answers: Vec<OnceLock<A>> = questions.iter().map(|_| OnceLock::new()).collect();
            let work = || {
                let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread can be begun");
                while !stop.load(Relaxed) {
                    let place = next.fetch_add(1, Relaxed);
                    let Some(question) = questions.get(place) else { break };
                    let _ = answers[place].set(alone.install(|| here(question)));
                }
            };
            std::thread::scope(|scope| {
                (0..self.size().min(questions.len())).for_each(|_| drop(scope.spawn(work)));
            });
            answers.into_iter().map_while(OnceLock::into_inner).collect()
        })
    }

    /// The answers of other processes or, where there are none, of `threads`.
    fn by_ranks_or<Q: Question, A: Answer>(
        &self,
        brief: &[u8],
        questions: &[Q],
        threads: impl FnOnce() -> Vec<A>,
    ) -> Vec<A> {
        match &self.workers {
            Workers::Threads => threads(),
            Workers::Ranks(ranks) => {
                let questions: Vec<Vec<u8>> = questions.iter().map(Question::to_bytes).collect();
                let read = |bytes: Vec<u8>| A::from_bytes(&bytes).expect("a rank of this very program answers");
                ranks.answers(brief, &questions, &self.stop).into_iter().map(read).collect()
            }
        }
    }
}

/// Log-probabilities of a [`Target`] by a pool; counts them.
pub struct Evaluations<'a> {
    pool: &'a Pool,
    target: &'a Target,
    brief: Vec<u8>,
    count: AtomicUsize,
}

impl<'a> Evaluations<'a> {
    /// For `target`, which other processes receive as `task`.
    pub fn new(pool: &'a Pool, target: &'a Target, task: &Task) -> Self {
        Evaluations {
            pool,
            target,
            brief: Brief::Density(Box::new(task.clone())).to_bytes(),
            count: AtomicUsize::new(0),
        }
    }

    /// Their number.
    pub fn count(&self) -> usize {
        self.count.load(Relaxed)
    }
}

impl Evaluator for Evaluations<'_> {
    fn evaluate(&self, batch: &[Vec<f64>]) -> Vec<Evaluation> {
        self.count.fetch_add(batch.len(), Relaxed);
        self.pool.answers(&self.brief, batch, |theta| self.target.evaluate(theta))
    }

    fn goes_on(&self, evaluations: usize) -> bool {
        self.count.fetch_add(evaluations, Relaxed);
        !self.pool.stopped()
    }
}
