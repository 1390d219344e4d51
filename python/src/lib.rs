//! The engine of the Python package: conversions between numpy, strings and the library. What users see is in
//! `dimcmc/`, whose functions call these.

mod calls;
mod fault;
mod job;
mod posterior;
mod run;
mod scene;

use pyo3::prelude::*;
use std::ffi::OsString;

/// The program: its arguments, the name first; the exit code.
#[pyfunction]
fn command_line(py: Python, arguments: Vec<OsString>) -> u8 {
    py.detach(|| dimcmc::command_line(arguments))
}

#[pymodule]
fn _core(module: &Bound<PyModule>) -> PyResult<()> {
    job::imported();
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<posterior::LogPosterior>()?;
    for function in [
        wrap_pyfunction!(command_line, module)?,
        wrap_pyfunction!(scene::load_config, module)?,
        wrap_pyfunction!(scene::check_config, module)?,
        wrap_pyfunction!(scene::check_observations, module)?,
        wrap_pyfunction!(scene::read_observations, module)?,
        wrap_pyfunction!(scene::write_observations, module)?,
        wrap_pyfunction!(calls::simulate, module)?,
        wrap_pyfunction!(calls::map, module)?,
        wrap_pyfunction!(calls::periodogram, module)?,
        wrap_pyfunction!(calls::limits, module)?,
        wrap_pyfunction!(calls::inject, module)?,
        wrap_pyfunction!(calls::grid, module)?,
        wrap_pyfunction!(calls::init, module)?,
        wrap_pyfunction!(calls::report, module)?,
        wrap_pyfunction!(calls::is_report, module)?,
        wrap_pyfunction!(calls::printed, module)?,
        wrap_pyfunction!(calls::broken, module)?,
        wrap_pyfunction!(calls::plan, module)?,
        wrap_pyfunction!(calls::optimise, module)?,
        wrap_pyfunction!(calls::survey, module)?,
        wrap_pyfunction!(run::sample, module)?,
        wrap_pyfunction!(run::read_run, module)?,
        wrap_pyfunction!(run::is_false_start, module)?,
        wrap_pyfunction!(calls::export, module)?,
        wrap_pyfunction!(calls::figure_names, module)?,
        wrap_pyfunction!(calls::figure, module)?,
    ] {
        module.add_function(function)?;
    }
    Ok(())
}
