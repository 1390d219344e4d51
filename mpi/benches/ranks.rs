//! Ranks of a cluster against one thread: the cost of the queue between them, the sharing of a batch by two workers,
//! and the inputs of `examples/scaling.py` for a cluster: seconds of evaluations, of messages, and of the work that
//! only rank 0 does.
//!
//! Starts itself by `mpirun`.

#[path = "../../benches/common/mod.rs"]
mod common;

use common::paper::{Free, Size, scene};
use common::stopwatch::{Candidate, fastest, in_turn, quantile, seconds};
use common::table::{Table, Target, thousands};
use dimcmc::internals::data::config::{Config, Settings};
use dimcmc::internals::data::scene::Scene;
use dimcmc::internals::inference::search;
use dimcmc::internals::runs::origin::Origin;
use dimcmc::internals::runs::pool::ranks::{Answering, Rank, Ranks};
use dimcmc::internals::runs::pool::{Answer as _, Asked, Brief, Evaluations, Pool, Question, Target as Density, Task};
use dimcmc::internals::sampling::ensemble::{Sampler, StartDraw, draw_start};
use dimcmc::internals::sampling::log_density::{Evaluation, Evaluator, LogDensity, Threads};
use dimcmc::internals::surface::static_map::Posterior;
use dimcmc::internals::surface::surrogate::{Surrogate, SurrogateMove};
use dimcmc_mpi::join;
use std::process::Command;
use std::sync::atomic::AtomicBool;

/// Seconds with the queue and one rank over those without it.
const OVERHEAD: Target = Target::AtMost(1.02);

/// Gain in evaluations per second, over the number of workers.
const EFFICIENCY: Target = Target::AtLeast(0.9);

/// Parameter vectors of a batch: one request by the halves of four ensembles of 32 walkers.
const BATCH: usize = 64;

/// Number of these that are evaluated one by one.
const SINGLE: usize = 16;

/// Rounds; on a shared machine the fastest counts, so that many short ones are better than a few long ones.
const ROUNDS: usize = 25;

/// Rounds of whole batches.
const BATCHES: usize = 12;

/// Requests without computation.
const ECHOES: usize = 2000;

const CASES: [(Free, usize); 2] = [(Free::Three, 2000), (Free::Seven, 2000)];

fn main() {
    if std::env::args().any(|argument| argument == "--rank") {
        return rank();
    }
    if !common::wanted() {
        return;
    }
    seam();
    for ranks in ["3", "2"] {
        let mut mpirun = Command::new("mpirun");
        mpirun.args(["--oversubscribe", "--allow-run-as-root", "--bind-to", "none", "-n", ranks]);
        let this = std::env::current_exe().expect("a program has a path");
        match mpirun.arg(this).args(["--rank", "--bench"]).status() {
            Ok(status) => assert!(status.success(), "{status}"),
            Err(error) => return println!("mpirun: {error}"),
        }
    }
}

/// A pool of one thread against the bare density: batches of one vector, in turn, each by its fastest round.
fn seam() {
    let columns = ["free", "pixels", "bare: ms of an evaluation", "pool", &format!("pool / bare ({OVERHEAD})")];
    let mut table = Table::new("The seam with one rank", &columns);
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    one.install(|| {
        for (free, pixels) in CASES {
            let Case { target, task, points, .. } = Case::new(free, pixels);
            let pool = Pool::default();
            let evaluations = Evaluations::new(&pool, &target, &task);
            let (mut bare, mut seam) = (0.0, 0.0);
            for theta in &points[..SINGLE] {
                let batch = [theta.clone()];
                let mut candidates = [
                    Candidate::new("bare", || target.evaluate(theta)),
                    Candidate::new("pool", || evaluations.evaluate(&batch)),
                ];
                let times = in_turn(&mut candidates, ROUNDS, 1);
                bare += 1e3 * fastest(&times[0]) / SINGLE as f64;
                seam += 1e3 * fastest(&times[1]) / SINGLE as f64;
            }
            let judged = OVERHEAD.judge(seam / bare, 3);
            table.row([free.name().to_owned(), thousands(pixels), format!("{bare:.3}"), format!("{seam:.3}"), judged]);
        }
    });
    table.print(&format!(
        "{SINGLE} points from the bulk of the posterior, one by one; each by its fastest of {ROUNDS} rounds in turn."
    ));
}

/// This program as a rank.
fn rank() {
    match join(1).unwrap() {
        Rank::Only => panic!("started without mpirun"),
        Rank::First(queue) => {
            workers(&*queue);
            if queue.size() == 1 {
                ingredients(&*queue);
            }
        }
        Rank::Other(worker) => {
            let learn = |brief: &[u8]| {
                let echo: Answering = Box::new(|question, _| question.to_vec());
                match Brief::from_bytes(brief) {
                    None => Ok(echo),
                    Some(_) => dimcmc::internals::runs::batch::learn(brief),
                }
            };
            worker.serve(&learn).unwrap();
        }
    }
}

/// A posterior around its maximum and points from its bulk.
struct Case {
    scene: Scene,
    posterior: Posterior,
    target: Density,
    task: Task,
    points: Vec<Vec<f64>>,
}

impl Case {
    fn new(free: Free, pixels: usize) -> Self {
        // of the config as in its file, which ranks read: not with the start moved to the truth
        let Settings { resolved, path, .. } = scene(free, Size::pixels(pixels)).settings;
        let scene = Scene::new(&Config::at(resolved.clone(), &path)).unwrap();
        let settings = search::SearchSettings { other_starts: 0, ..scene.search_settings() };
        let found = search::find(&scene.imager, &scene.space, settings, &|_| ()).unwrap();
        let task = Task::new(&scene, &Origin::of(&scene, &found), scene.space.names(), Asked::LogProbability);
        let target = Density::new(found.posterior.clone(), scene.settings.imaging.unresolved_spots).unwrap();
        let (centre, covariance) = (&found.optimum.theta[..], &found.optimum.covariance);
        let draw = StartDraw { centre, covariance, scale: 1.0, ensembles: 1, walkers: BATCH, seed: 1 };
        let allowed = |theta: &[f64]| scene.space.log_prior(theta).is_finite();
        let points = draw_start(&*found.posterior, &draw, &allowed).unwrap().remove(0);
        let posterior = Posterior::behind(&*found.posterior).expect("a static map").clone();
        Case { scene, posterior, target, task, points }
    }
}

/// All workers against one thread, and as many threads, of rank 0, in turn.
fn workers(queue: &dyn Ranks) {
    let workers = queue.size();
    let over = format!("workers / 1 thread / {workers} ({EFFICIENCY})");
    let columns = [
        "free",
        "pixels",
        "1 thread: evaluations / s",
        "as many threads",
        "workers",
        &over,
        "workers / as many threads",
    ];
    let mut table = Table::new(&format!("Ranks: {} of them, {workers} of which work", workers + 1), &columns);
    for (free, pixels) in CASES {
        let Case { target, task, points, .. } = Case::new(free, pixels);
        let brief = Brief::Density(Box::new(task)).to_bytes();
        let questions: Vec<Vec<u8>> = points.iter().map(Question::to_bytes).collect();
        let ask = || queue.answers(&brief, &questions, &AtomicBool::new(false));
        let here: Vec<Vec<u8>> = points.iter().map(|theta| target.evaluate(theta).to_bytes()).collect();
        assert!(ask() == here, "the same bytes");
        let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let (one, several) = (pool(1), pool(workers));
        let threads = |pool: &rayon::ThreadPool| pool.install(|| Threads(&target).evaluate(&points));
        let mut candidates = [
            Candidate::new("1 thread", || threads(&one)),
            Candidate::new("as many threads", || threads(&several)),
            Candidate::new("workers", ask),
        ];
        let times = in_turn(&mut candidates, BATCHES, 1);
        let [alone, threaded, ranks] = [0, 1, 2].map(|k| BATCH as f64 / fastest(&times[k]));
        table.row([
            free.name().to_owned(),
            thousands(pixels),
            format!("{alone:.0}"),
            format!("{threaded:.0}"),
            format!("{ranks:.0}"),
            EFFICIENCY.judge(ranks / alone / workers as f64, 2),
            format!("{:.2}", ranks / threaded),
        ]);
    }
    table.print(&format!(
        "Batches of {BATCH} points from the bulk of the posterior, the same bytes by all; rank 0 only hands them out. \
        The fastest of \
         {BATCHES} rounds in which all take turns."
    ));
}

/// The parameters of a simulated cluster.
fn ingredients(queue: &dyn Ranks) {
    let columns =
        ["free", "pixels", "ms of an evaluation: 5 %", "50 %", "95 %", "largest / mean", "ms of rank 0 for a proposal"];
    let mut table = Table::new("Evaluations of the bulk, and what only rank 0 does", &columns);
    for (free, pixels) in CASES {
        let Case { scene, posterior, target, points, .. } = Case::new(free, pixels);
        let ms: Vec<f64> = points
            .iter()
            .map(|theta| 1e3 * (0..3).map(|_| seconds(|| target.evaluate(theta))).fold(f64::INFINITY, f64::min))
            .collect();
        let mean = ms.iter().sum::<f64>() / ms.len() as f64;
        let at = |p| format!("{:.2}", quantile(&ms, p));
        let proposal = format!("{:.3}", 1e3 * proposal_s(&scene, &posterior, &points));
        let spread = format!("{:.2}", quantile(&ms, 1.0) / mean);
        table.row([free.name().to_owned(), thousands(pixels), at(0.05), at(0.5), at(0.95), spread, proposal]);
    }
    table.print(
        "The fastest of three evaluations each; a proposal of the default mix, accepting and recording it included.",
    );
    let questions = vec![vec![0; 64]; ECHOES];
    let alone: Vec<f64> =
        (0..20).map(|k| seconds(|| queue.answers(b"echo", &questions[k..=k], &AtomicBool::new(false)))).collect();
    let many: Vec<f64> =
        (0..5).map(|_| seconds(|| queue.answers(b"echo", &questions, &AtomicBool::new(false)))).collect();
    println!(
        "A question and its answer, nothing to think about: {:.0} us alone, {:.1} us each in a row of {ECHOES} \
        (medians).\n",
        1e6 * quantile(&alone, 0.5),
        1e6 * quantile(&many, 0.5) / ECHOES as f64
    );
}

/// Answers immediately.
struct Instantly;

impl Evaluator for Instantly {
    fn evaluate(&self, batch: &[Vec<f64>]) -> Vec<Evaluation> {
        vec![Evaluation { numbers: vec![0.1, 1.0], ..Evaluation::of(0.0) }; batch.len()]
    }
}

/// Seconds of a sampler's step for each walker, evaluations left out.
fn proposal_s(scene: &Scene, posterior: &Posterior, points: &[Vec<f64>]) -> f64 {
    let mut settings = scene.settings.sampler.clone();
    (settings.ensembles, settings.walkers) = (2, Some(BATCH / 2));
    let surrogate = Surrogate::new(&scene.imager, &scene.space, posterior.reference()).unwrap();
    let sampler = Sampler::new(posterior, &Instantly, &settings).unwrap();
    let sampler = sampler.with_move(settings.moves.surrogate, Box::new(SurrogateMove(surrogate)));
    let start: Vec<Vec<Vec<f64>>> = points.chunks(BATCH / 2).map(<[_]>::to_vec).collect();
    let (mut state, _) = sampler.start(&start).unwrap();
    let stop = AtomicBool::new(false);
    let times: Vec<f64> = (0..50).map(|_| seconds(|| sampler.step(&mut state, &stop))).collect();
    quantile(&times, 0.5) / BATCH as f64
}
