//! What went wrong, as an exception.

use dimcmc::Failure;
use pyo3::PyErr;
use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError, PyValueError};

/// Why there is no result: a line for the user.
#[derive(Debug)]
pub enum Fault {
    /// The user can put it right: `ValueError`.
    Input(String),
    /// The input was right, and yet it did not work: `RuntimeError`.
    Failed(String),
    /// `KeyboardInterrupt`.
    Interrupted(String),
}

impl<E: Into<Failure>> From<E> for Fault {
    fn from(error: E) -> Self {
        let failure = error.into();
        match failure.is_input() {
            true => Fault::Input(failure.to_string()),
            false => Fault::Failed(failure.to_string()),
        }
    }
}

impl From<Fault> for PyErr {
    fn from(fault: Fault) -> Self {
        match fault {
            Fault::Input(text) => PyValueError::new_err(text),
            Fault::Failed(text) => PyRuntimeError::new_err(text),
            Fault::Interrupted(text) => PyKeyboardInterrupt::new_err(text),
        }
    }
}
