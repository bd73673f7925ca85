//! The commands of the command line, with their results as JSON.

use crate::cli::{CommandOutcome, run_collecting, stop_collecting};
use pyo3::prelude::*;

/// Runs a command as on the command line, as in `["info", "lens.json"]`. Returns its result as JSON,
/// which may be empty, its error, and its exit status: 0 done, 1 the work failed, 2 the input is wrong.
#[pyfunction]
pub(super) fn run_command(py: Python<'_>, arguments: Vec<String>) -> (String, Option<String>, u8) {
    let CommandOutcome { json, error, status } = py.detach(|| run_collecting(&arguments));
    (json, error, status)
}

/// Ends the long commands that other threads run, with what they have.
#[pyfunction]
pub(super) fn stop_commands() {
    stop_collecting();
}
