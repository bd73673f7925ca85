//! What straight lines make of the measurement of a task, beside what its search found.

use super::failure::Failure;
use crate::grin_task::{Chords, Medium, Task};
use crate::measure::Stopwatch;
use serde::Serialize;
use std::fmt::{self, Display};
use std::ops::ControlFlow;

/// Steps of conjugate gradients.
const STEPS: usize = 60;

/// The best field that straight lines found; their last one where the answer is not known.
#[derive(Debug, Clone, Copy, Serialize)]
pub(super) struct Lines {
    /// Its error, as that of the search.
    of_contrast: Option<f64>,
    /// Which of the steps it is.
    step: usize,
    steps: usize,
    ms: f64,
}

impl Lines {
    pub(super) fn new(name: &str, task: &Task, nodes: usize) -> Result<Self, Failure> {
        let clock = Stopwatch::start();
        let refuse = |error| Failure::Input(format!("{name}, --lines: {error}"));
        let chords = Chords::new(task).map_err(refuse)?;
        let (mut best, mut step, mut steps) = (None, 0, 0);
        let visit = |medium: &Medium| {
            steps += 1;
            let difference = task.difference(medium).ok().flatten();
            let error = difference.map(|difference| difference.of_contrast);
            if error.zip(best).is_none_or(|(error, best)| error < best) {
                (best, step) = (error, steps);
            }
            ControlFlow::Continue(())
        };
        chords.field(nodes, STEPS, visit).map_err(refuse)?;
        Ok(Self { of_contrast: best, step, steps, ms: 1e3 * clock.seconds() })
    }
}

impl Display for Lines {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { of_contrast, step, steps, ms } = self;
        write!(f, "straight lines: {steps} steps of least squares, {:.2} s", 1e-3 * ms)?;
        match of_contrast {
            Some(error) => writeln!(f, "; the best, step {step}, is off by {error:.4} of the same"),
            None => writeln!(f),
        }
    }
}
