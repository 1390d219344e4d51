//! The density, for samplers in Python.

use crate::calls::Manner;
use crate::fault::Fault;
use crate::job::{attend, soon};
use crate::scene::{Arrays, ConfigText, Source};
use dimcmc::{Failure, LogDensity as _};
use numpy::{AllowTypeChange, PyArray1, PyArrayLikeDyn, PyArrayMethods as _, PyUntypedArrayMethods as _};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::borrow::Cow;
use std::sync::Arc;

/// What samplers call.
#[pyclass(frozen, module = "dimcmc._core")]
pub struct LogPosterior(Arc<dimcmc::LogPosterior>);

/// Vectors as numpy has them; lists and other numbers are converted.
type Vectors<'py> = PyArrayLikeDyn<'py, f64, AllowTypeChange>;

#[pymethods]
impl LogPosterior {
    /// With a search for the reference, or without where `origin` says what it is.
    #[new]
    fn new(
        py: Python,
        config: ConfigText,
        observations: Option<Arrays>,
        origin: Option<String>,
        manner: Manner,
    ) -> PyResult<Self> {
        let source = Source::new(py, config, observations)?;
        let made = attend(py, manner.0, manner.1, move |job| {
            job.say("profiles");
            let scene = source.scene(None)?;
            let failed = |error| Failure::run(scene.path(), error);
            if let Some(origin) = origin {
                return Ok(dimcmc::LogPosterior::again(&scene, &origin, scene.path()).map_err(failed)?);
            }
            scene.require_free()?;
            let scene = scene.fitted(&|what| job.say(what));
            let failed = |error| Failure::run(scene.path(), error);
            let found = scene.optimise_with(&|progress| job.search(progress));
            let found = found.map_err(|e| Failure::search(scene.path(), e))?;
            job.say("places where evaluations start");
            Ok::<_, Fault>(dimcmc::LogPosterior::new(&scene, found).map_err(failed)?)
        })?;
        Ok(LogPosterior(Arc::new(made)))
    }

    /// Names of the parameters.
    #[getter]
    fn names(&self) -> Vec<String> {
        self.0.names().to_vec()
    }

    /// What `new` takes as `origin`.
    fn origin(&self) -> String {
        self.0.origin()
    }

    /// Best parameters and their standard deviations.
    fn optimum<'py>(&self, py: Python<'py>) -> [Bound<'py, PyArray1<f64>>; 2] {
        [self.0.optimum(), self.0.sd()].map(|numbers| PyArray1::from_vec(py, numbers))
    }

    /// Log-probability of a vector, or of each row.
    fn log_prob<'py>(
        &self,
        py: Python<'py>,
        theta: Vectors<'py>,
        threads: Option<usize>,
    ) -> PyResult<Bound<'py, PyAny>> {
        if self.is_one(&theta)? {
            let theta = contiguous(&theta);
            return Ok(soon(py, || self.0.evaluate(&theta).log_prob)?.into_pyobject(py)?.into_any());
        }
        // the computation may outlive the array
        let (all, posterior) = (contiguous(&theta).into_owned(), Arc::clone(&self.0));
        let values = attend(py, threads, None, move |job| {
            let stopped = || Fault::Interrupted("interrupted".into());
            posterior.batch(&all, &job.stop()).ok_or_else(stopped)
        })?;
        Ok(PyArray1::from_vec(py, values).into_any())
    }

    /// ln of the prior density of a vector, or of each row.
    fn log_prior<'py>(&self, py: Python<'py>, theta: Vectors<'py>) -> PyResult<Bound<'py, PyAny>> {
        let one = self.is_one(&theta)?;
        let theta = contiguous(&theta);
        let values: Vec<f64> = theta.chunks_exact(self.0.names().len()).map(|theta| self.0.log_prior(theta)).collect();
        Ok(match one {
            true => values[0].into_pyobject(py)?.into_any(),
            false => PyArray1::from_vec(py, values).into_any(),
        })
    }

    /// The parameters at a point of the unit cube, or at each row.
    fn prior_transform<'py>(&self, py: Python<'py>, unit: Vectors<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.is_one(&unit)?;
        if unit.as_array().iter().any(|u| !(0.0..=1.0).contains(u)) {
            return Err(PyValueError::new_err("a point of the unit cube: all numbers must be from 0 to 1"));
        }
        let (shape, unit) = (unit.shape().to_vec(), contiguous(&unit));
        let dimension = self.0.names().len();
        let theta: Vec<f64> = unit.chunks_exact(dimension).flat_map(|unit| self.0.prior_transform(unit)).collect();
        Ok(PyArray1::from_vec(py, theta).reshape(shape)?.into_any())
    }
}

impl LogPosterior {
    /// Whether this is one vector; several are rows.
    fn is_one(&self, vectors: &Vectors) -> PyResult<bool> {
        let names = self.0.names();
        match *vectors.shape() {
            [n] if n == names.len() => Ok(true),
            [_, n] if n == names.len() => Ok(false),
            ref shape => Err(PyValueError::new_err(format!(
                "expected {} numbers ({}), or rows of so many, not an array of shape {shape:?}",
                names.len(),
                names.join(", ")
            ))),
        }
    }
}

/// The numbers row by row, copied only where they do not lie so.
fn contiguous<'a>(vectors: &'a Vectors) -> Cow<'a, [f64]> {
    let view = vectors.as_array();
    // `as_slice` of the array itself would take columns for rows where they are what lies together
    match view.to_slice() {
        Some(slice) => Cow::Borrowed(slice),
        None => Cow::Owned(view.iter().copied().collect()),
    }
}
