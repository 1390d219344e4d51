//! This program as a rank of a job: fails on purpose, or is queried and timed.

use dimcmc::internals::runs::pool::ranks::{Answering, Rank, Ranks};
use dimcmc_mpi::join;
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant, SystemTime};

/// Questions of a job.
const QUESTIONS: u8 = 40;

/// Plays a role; whoever panics notes down when.
pub fn play(role: &str, args: &[String]) -> ExitCode {
    let at_once = if role == "order-and-rest" { 2 } else { 1 };
    match join(at_once).unwrap() {
        Rank::Only => panic!("started without mpirun"),
        Rank::First(queue) => first(role, args, &*queue),
        Rank::Other(worker) => {
            let rank = worker.rank();
            let learn = |brief: &[u8]| {
                let brief = brief[0];
                let answering: Answering = Box::new(move |question, _| answer(role, args, rank, brief, question));
                Ok(answering)
            };
            worker.serve(&learn).unwrap();
        }
    }
    ExitCode::SUCCESS
}

/// Seconds since 1970.
pub fn now_s() -> f64 {
    SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap().as_secs_f64()
}

fn first(role: &str, args: &[String], queue: &dyn Ranks) {
    if role == "many-briefs" {
        return many_briefs(queue);
    }
    let questions: Vec<Vec<u8>> = (0..QUESTIONS).map(|k| vec![k]).collect();
    let (began, before) = (Instant::now(), processor_s());
    let answers = queue.answers(b"a brief", &questions, &AtomicBool::new(false));
    if role == "panic-on-first" {
        panic_noted(&args[0], 0);
    }
    println!("in order: {}", u8::from(answers.iter().zip(&questions).all(|(a, q)| a[0] == 2 * q[0])));
    println!("seconds: {}", began.elapsed().as_secs_f64());
    println!("processor: {}", processor_s() - before);
}

/// More briefs than there are tags, each answered by itself.
fn many_briefs(queue: &dyn Ranks) {
    let questions: Vec<Vec<u8>> = (0..5).map(|k| vec![k]).collect();
    let right = (0..1100_u16).filter(|k| {
        let brief = (k % 100) as u8;
        let answers = queue.answers(&[brief], &questions, &AtomicBool::new(false));
        answers.iter().map(|answer| answer[0]).eq((0..5).map(|question| brief + question))
    });
    println!("right: {}", right.count());
}

fn answer(role: &str, args: &[String], rank: i32, brief: u8, question: &[u8]) -> Vec<u8> {
    match (role, question[0]) {
        ("panic-on-worker", 9..) if rank == 2 => panic_noted(&args[0], rank),
        // the other one is busy for longer than a test may take
        ("panic-on-worker", 9..) => std::thread::sleep(Duration::from_secs(100)),
        ("many-briefs", question) => return vec![brief + question],
        ("order-and-rest", _) => std::thread::sleep(Duration::from_millis(50)),
        _ => {}
    }
    vec![2 * question[0]]
}

fn panic_noted(file: &str, rank: i32) {
    std::fs::write(file, now_s().to_string()).unwrap();
    panic!("on purpose on rank {rank}");
}

/// Processor time of this process, in hundredths of a second.
fn processor_s() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap();
    let fields: Vec<&str> = stat.rsplit_once(") ").unwrap().1.split_whitespace().collect();
    fields[11..13].iter().map(|ticks| ticks.parse::<f64>().unwrap() / 100.0).sum()
}
