//! Failures that do not keep a command from going on: what was found is still saved elsewhere and
//! printed, and the command fails at its end.

use super::error::CliError;
use super::output::print_note;

/// The failures of a command so far.
#[derive(Debug, Default)]
pub(super) struct Failures(Vec<CliError>);

impl Failures {
    /// The value of a step that may fail; its failure is noted.
    pub(super) fn note<T, E: Into<CliError>>(&mut self, step: Result<T, E>) -> Option<T> {
        step.map_err(|error| self.0.push(error.into())).ok()
    }

    /// Fails if any step failed: the last failure is returned, the others are printed.
    pub(super) fn into_result(mut self) -> Result<(), CliError> {
        let Some(last) = self.0.pop() else { return Ok(()) };
        self.0.iter().for_each(|failure| print_note(format!("error: {failure}")));
        Err(last)
    }
}
