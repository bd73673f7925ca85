//! What straight lines make of the measurement of a task, beside what its search found.

use super::failure::Failure;
use crate::grin_task::{Chords, Medium, Task, TaskError};
use crate::measure::Stopwatch;
use serde::Serialize;
use std::fmt::{self, Display};
use std::ops::ControlFlow;

/// Steps of conjugate gradients.
const STEPS: usize = 60;

/// The best field that straight lines found; their last one where the answer is not known.
#[derive(Debug, Clone, Copy, Serialize)]
pub(super) struct Found {
    /// Its error, as that of the search.
    of_contrast: Option<f64>,
    /// Which of the steps it is.
    step: usize,
    steps: usize,
    ms: f64,
}

/// Straight lines, ready to be solved for; what that took, in milliseconds.
#[derive(Debug)]
pub(super) struct Lines {
    chords: Chords,
    ms: f64,
}

impl Lines {
    /// Refuses a task whose light was not measured.
    pub(super) fn new(name: &str, task: &Task) -> Result<Self, Failure> {
        let clock = Stopwatch::start();
        let chords = Chords::new(task).map_err(|error| refused(name, &error))?;
        Ok(Self { chords, ms: 1e3 * clock.seconds() })
    }

    pub(super) fn found(self, name: &str, task: &Task, nodes: usize) -> Result<Found, Failure> {
        let clock = Stopwatch::start();
        let (mut best, mut step, mut steps) = (None, 0, 0);
        let visit = |medium: &Medium| {
            steps += 1;
            let difference = task.difference(medium).ok().flatten();
            let error = difference.map(|difference| difference.of_contrast);
            let error = error.filter(|error| error.is_finite());
            if error.zip(best).is_none_or(|(error, best)| error < best) {
                (best, step) = (error, steps);
            }
            ControlFlow::Continue(())
        };
        self.chords.field(nodes, STEPS, visit).map_err(|error| refused(name, &error))?;
        Ok(Found { of_contrast: best, step, steps, ms: self.ms + 1e3 * clock.seconds() })
    }
}

fn refused(name: &str, error: &TaskError) -> Failure {
    Failure::Input(format!("{name}, --lines: {error}"))
}

impl Display for Found {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { of_contrast, step, steps, ms } = self;
        write!(f, "straight lines: {steps} steps of least squares, {:.2} s", 1e-3 * ms)?;
        match of_contrast {
            Some(error) => writeln!(f, "; the best, step {step}, is off by {error:.4} of the same"),
            None => writeln!(f),
        }
    }
}
