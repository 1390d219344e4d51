//! Runs: begun, gone on with, and read.

use crate::calls::Manner;
use crate::fault::Fault;
use crate::job::{attend, soon};
use crate::scene::{Arrays, ConfigText, Source};
use dimcmc::{Chain, Conclusion, Failure, GridScan, Meter, Pool, Run, Scene, StartFrom, StopReason};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// How a run begins: from the optimum or all over the prior, replacing another one or not; or how it goes on.
#[derive(Clone, Copy, FromPyObject)]
pub struct Beginning {
    #[pyo3(item)]
    prior: bool,
    #[pyo3(item)]
    replace: bool,
    #[pyo3(item)]
    resume: bool,
    #[pyo3(item)]
    extend: Option<usize>,
}

/// `dimcmc sample`.
#[pyfunction]
pub fn sample(
    py: Python,
    config: ConfigText,
    observations: Option<Arrays>,
    out: PathBuf,
    beginning: Beginning,
    seed: Option<u64>,
    manner: Manner,
) -> PyResult<()> {
    let source = Source::new(py, config, observations)?;
    attend(py, manner.0, manner.1, move |job| {
        let began = Instant::now();
        job.say("profiles");
        let scene = source.scene(seed)?;
        let failed = |error| Fault::from(Failure::run(scene.path(), error));
        let pool = Pool::threads(job.stop());
        let mut run = match beginning.resume {
            true => {
                job.say("reading the chain, reference image");
                Run::resume(&scene, &out, beginning.extend, &pool).map_err(failed)?
            }
            false => begin(job, &scene, beginning, &pool)?,
        };
        job.begin_to_write();
        if !beginning.resume {
            run = run.kept_in(&out, beginning.replace).map_err(failed)?;
        }
        let mut meter = Meter::new(&run);
        let reason = run.go(&pool, |records, convergence| job.pace(&meter.step(records, convergence)));
        Run::note_effort(&out, !beginning.resume, began.elapsed().as_secs_f64(), pool.size()).map_err(failed)?;
        if reason.map_err(failed)? == StopReason::Interrupted {
            let step = run.chain.steps().saturating_sub(1);
            return Err(Fault::Interrupted(format!(
                "interrupted after step {step}; resume with the same call and out={:?}, resume=True",
                out.display().to_string()
            )));
        }
        let (conclusion, _) = Conclusion::read(&out).map_err(failed)?;
        conclusion.write(&out).map_err(failed)
    })
}

/// A run in memory, with its walkers where they start.
fn begin(job: &crate::job::Job, scene: &Scene, beginning: Beginning, pool: &Pool) -> Result<Run, Fault> {
    scene.require_free()?;
    let scene = &scene.clone().fitted(&|what| job.say(what));
    let found = scene.optimise_with(&|progress| job.search(progress));
    let found = found.map_err(|e| Failure::search(scene.path(), e))?;
    job.say("start of the walkers, blind search");
    let from = if beginning.prior { StartFrom::Prior } else { StartFrom::Optimum };
    Ok(Run::in_memory(scene, found, from, pool).map_err(|e| Failure::run(scene.path(), e))?)
}

/// Whether nothing but the false start of a run or a grid is in a folder, which another one may replace.
#[pyfunction]
pub fn is_false_start(folder: PathBuf) -> bool {
    Run::is_false_start(&folder) || GridScan::is_false_start(&folder)
}

/// Reads a run: names, text and summary; draws by name; positions `[step, ensemble, walker, parameter]`,
/// log-probabilities and numbers beside them `[step, ensemble, walker]`, all flat.
#[pyfunction]
pub fn read_run(py: Python, folder: PathBuf) -> PyResult<Bound<PyDict>> {
    let (conclusion, chain) = soon(py, || read(&folder))??;
    let content = PyDict::new(py);
    let draws = PyDict::new(py);
    for (name, values) in conclusion.draws(&chain) {
        draws.set_item(name, PyArray1::from_vec(py, values))?;
    }
    content.set_item("draws", draws)?;
    let shape = chain.shape();
    content.set_item("names", chain.names())?;
    content.set_item("shape", (chain.steps(), shape.ensembles, shape.walkers))?;
    content.set_item("text", conclusion.text)?;
    content.set_item("summary", serde_json::to_string(&conclusion.summary).expect("plain data"))?;
    content.set_item("chain", flat(py, chain.records().iter().flat_map(|record| record.theta.iter().copied())))?;
    content.set_item("log_prob", flat(py, chain.records().iter().map(|record| record.log_prob)))?;
    let numbers = PyDict::new(py);
    for (k, name) in shape.numbers.iter().enumerate() {
        numbers.set_item(name, flat(py, chain.records().iter().map(|record| record.numbers[k])))?;
    }
    content.set_item("numbers", numbers)?;
    Ok(content)
}

fn read(folder: &Path) -> Result<(Conclusion, Chain), Fault> {
    Ok(Conclusion::read(folder).map_err(|e| Failure::run(folder, e))?)
}

fn flat<'py>(py: Python<'py>, numbers: impl Iterator<Item = f64>) -> Bound<'py, PyArray1<f64>> {
    PyArray1::from_vec(py, numbers.collect())
}
