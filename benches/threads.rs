//! Two threads against one: a batch of evaluations through pools of either size, in turn.

mod common;

use common::paper::{Bulk, Free, Size, scene};
use common::stopwatch::{Candidate, fastest, in_turn};
use common::table::{Table, Target, thousands};
use dimcmc::internals::sampling::log_density::{Evaluator, Threads};

/// Gain in evaluations per second.
const TWICE: Target = Target::AtLeast(1.8);

/// Parameter vectors of a batch: one request by the halves of four ensembles of 32 walkers.
const BATCH: usize = 64;

const ROUNDS: usize = 15;

fn main() {
    if !common::wanted() {
        return;
    }
    let columns = ["free", "pixels", "1 thread: evaluations / s", "2 threads", &format!("2 / 1 ({TWICE})")];
    let mut table = Table::new("Threads", &columns);
    for (free, pixels) in [(Free::Three, 2000), (Free::Three, 5000), (Free::Seven, 2000)] {
        let bulk = Bulk::new(&scene(free, Size::pixels(pixels)), BATCH);
        let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let (one, two) = (pool(1), pool(2));
        let batch = |pool: &rayon::ThreadPool| pool.install(|| Threads(&bulk.target).evaluate(&bulk.points));
        let mut candidates = [Candidate::new("1 thread", || batch(&one)), Candidate::new("2 threads", || batch(&two))];
        let times = in_turn(&mut candidates, ROUNDS, 1);
        let rate = |times: &[f64]| format!("{:.0}", BATCH as f64 / fastest(times));
        table.row([
            free.name().to_owned(),
            thousands(pixels),
            rate(&times[0]),
            rate(&times[1]),
            TWICE.judge(fastest(&times[0]) / fastest(&times[1]), 2),
        ]);
    }
    table.print(&format!(
        "Batches of {BATCH} points from the bulk of the posterior; the fastest of {ROUNDS} rounds in which both take \
        turns."
    ));
}
