//! Long calls: computed on threads of their own without the interpreter's lock, while the calling thread shows progress
//! and waits for Ctrl-C.

use crate::fault::Fault;
use dimcmc::{Pace, Progress};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering::SeqCst};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// The calling thread looks for Ctrl-C and news so often.
const TICK: Duration = Duration::from_millis(50);

/// After Ctrl-C the computation is left to end by itself if it does not within this time.
const PATIENCE: Duration = Duration::from_millis(700);

/// Share of the work that is done, where it is known, and what is under way.
type News = (Option<f64>, String);

/// What a computation says of itself, and is told.
#[derive(Clone, Default)]
pub struct Job {
    stop: Arc<AtomicBool>,
    /// Whether something is being written, which nobody leaves alone.
    writing: Arc<AtomicBool>,
    news: Arc<Mutex<Option<News>>>,
}

/// What a computation unwinds with where it was told to stop.
struct Stopped;

impl Job {
    /// Set once Ctrl-C was pressed.
    pub fn stop(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.stop)
    }

    /// From now on the computation writes, and ends soon once it is told to stop.
    pub fn begin_to_write(&self) {
        self.go_on();
        self.writing.store(true, SeqCst);
    }

    /// Ends the computation here if it was told to stop.
    pub fn go_on(&self) {
        if self.stop.load(SeqCst) {
            resume_unwind(Box::new(Stopped));
        }
    }

    /// Says what is under way; ends the computation if it was told to stop.
    pub fn say(&self, text: impl Into<String>) {
        self.go_on();
        self.tell(None, text.into());
    }

    /// The same of a search.
    pub fn search(&self, Progress { stage, evaluations }: Progress) {
        self.say(match evaluations {
            0 => stage.to_string(),
            n => format!("{stage}, {n} reconstructions"),
        });
    }

    /// How much is done; ends the computation if it was told to stop.
    pub fn share(&self, done: usize, total: usize, what: &str) {
        self.go_on();
        self.count(done, total, what);
    }

    /// How much is done of what stops by itself.
    pub fn count(&self, done: usize, total: usize, what: &str) {
        self.tell(Some(done as f64 / total.max(1) as f64), format!("{done}/{total} {what}"));
    }

    /// How far a chain has come; it stops by itself.
    pub fn pace(&self, pace: &Pace) {
        let convergence = pace.convergence.as_ref().map(|words| format!(", {words}")).unwrap_or_default();
        let text = format!("step {}, acceptance {:.2}{convergence}", pace.step, pace.acceptance);
        self.tell(Some(pace.step as f64 / pace.end.max(1.0)), text);
    }

    fn tell(&self, share: Option<f64>, text: String) {
        *unpoisoned(&self.news) = Some((share, text));
    }

    fn show(&self, py: Python, progress: Option<&Py<PyAny>>) -> PyResult<()> {
        let news = unpoisoned(&self.news).take();
        match (progress, news) {
            (Some(progress), Some(news)) => progress.call1(py, news).map(drop),
            _ => Ok(()),
        }
    }
}

fn unpoisoned<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A pool of threads, and the process and number that it was made for.
type Kept = (u32, usize, Arc<ThreadPool>);

/// That many threads; all processors for `None`. Pools are kept, but those of a parent process have no threads here.
fn pool(threads: Option<usize>) -> PyResult<Arc<ThreadPool>> {
    static POOLS: Mutex<Vec<Kept>> = Mutex::new(Vec::new());
    let (process, number) = (std::process::id(), threads.unwrap_or(0));
    let mut pools = unpoisoned(&POOLS);
    if let Some((_, _, pool)) = pools.iter().find(|(of, n, _)| (*of, *n) == (process, number)) {
        return Ok(Arc::clone(pool));
    }
    let pool = ThreadPoolBuilder::new().num_threads(number).build();
    let pool = Arc::new(pool.map_err(|e| PyRuntimeError::new_err(format!("threads: {e}")))?);
    // a pool of the parent is never dropped: its threads could not be waited for
    pools.push((process, number, Arc::clone(&pool)));
    Ok(pool)
}

/// The process that the package was imported in.
static IMPORTED: OnceLock<u32> = OnceLock::new();

/// Notes where the package is imported.
pub fn imported() {
    IMPORTED.get_or_init(std::process::id);
}

/// The result of `work`, which is done soon, on the calling thread; without the interpreter's lock.
///
/// In a process that was forked off since the import, rayon's own threads are not there: another pool takes their
/// place.
///
/// # Errors
/// Threads that cannot be begun.
pub fn soon<T: Send>(py: Python, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    if IMPORTED.get() == Some(&std::process::id()) {
        return Ok(py.detach(work));
    }
    let pool = pool(None)?;
    Ok(py.detach(|| pool.install(work)))
}

/// The result of `work`, done on so many threads. `progress` is called with the share done (or `None`) and a text.
///
/// # Errors
/// What `work` comes to, and `KeyboardInterrupt`.
pub fn attend<T: Send + 'static>(
    py: Python,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
    work: impl FnOnce(&Job) -> Result<T, Fault> + Send + 'static,
) -> PyResult<T> {
    let job = Job::default();
    let here = job.clone();
    let (sender, receiver) = channel();
    pool(threads)?.spawn(move || {
        let outcome = catch_unwind(AssertUnwindSafe(|| work(&here)));
        // nobody waits for a computation that was left to itself
        let _ = sender.send(outcome);
    });
    let receiver = Mutex::new(receiver);
    let wait = |py: Python| py.detach(|| unpoisoned(&receiver).recv_timeout(TICK));
    loop {
        match wait(py) {
            Ok(outcome) => {
                job.show(py, progress.as_ref())?;
                return settled(outcome);
            }
            Err(RecvTimeoutError::Disconnected) => return Err(PyRuntimeError::new_err("the computation was lost")),
            Err(RecvTimeoutError::Timeout) => {}
        }
        let Err(interrupt) = py.check_signals().and_then(|()| job.show(py, progress.as_ref())) else { continue };
        job.stop.store(true, SeqCst);
        let asked = Instant::now();
        while job.writing.load(SeqCst) || asked.elapsed() < PATIENCE {
            match wait(py) {
                Ok(Ok(Err(Fault::Interrupted(text)))) => return Err(Fault::Interrupted(text).into()),
                Err(RecvTimeoutError::Timeout) => {}
                _ => break,
            }
        }
        return Err(interrupt);
    }
}

/// What a computation came to.
fn settled<T>(outcome: Result<Result<T, Fault>, Box<dyn Any + Send>>) -> PyResult<T> {
    match outcome {
        Ok(result) => Ok(result?),
        Err(panic) => {
            let text = panic.downcast_ref::<String>().map(String::as_str);
            let text = text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("it stopped");
            Err(PyRuntimeError::new_err(format!("a fault of dimcmc, please report it: {text}")))
        }
    }
}
