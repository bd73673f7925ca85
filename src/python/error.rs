//! Errors as exceptions of Python, with the texts of the library.

use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::{PyErr, create_exception};
use std::fmt::Display;

create_exception!(aplanat, InputError, PyValueError, "An input that is wrong.");
create_exception!(aplanat, WorkError, PyRuntimeError, "Work that began and failed.");

/// The exception for a wrong input.
pub(super) fn wrong_input(error: impl Display) -> PyErr {
    InputError::new_err(error.to_string())
}

/// The exception for work that failed.
pub(super) fn failed_work(error: impl Display) -> PyErr {
    WorkError::new_err(error.to_string())
}
