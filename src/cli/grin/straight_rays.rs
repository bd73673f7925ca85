//! Reconstruction of a measured field with straight rays, for comparison with the design.

use crate::cli::error::CliError;
use crate::grin_design::{GrinField, GrinTask, GrinTaskError, StraightRays};
use crate::measure::Stopwatch;
use serde::Serialize;
use std::fmt::{self, Display};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};

/// Steps of the conjugate gradient method.
const CGLS_STEPS: usize = 60;

/// The best field of straight rays; the last one if the exact field is not known.
#[derive(Debug, Clone, Copy, Serialize)]
pub(super) struct StraightRayResult {
    /// The error, relative to the contrast of the exact field.
    of_contrast: Option<f64>,
    /// The step of the best field, from 1.
    step: usize,
    steps: usize,
    ms: f64,
}

/// Straight rays that are ready for the solver, and the milliseconds of the preparation.
#[derive(Debug)]
pub(super) struct StraightRaySolver {
    chords: StraightRays,
    ms: f64,
}

impl StraightRaySolver {
    /// Prepares the rays; refuses a task without measured light.
    pub(super) fn new(name: &str, task: &GrinTask) -> Result<Self, CliError> {
        let clock = Stopwatch::start();
        let chords = StraightRays::new(task).map_err(|error| straight_ray_error(name, &error))?;
        Ok(Self { chords, ms: 1e3 * clock.seconds() })
    }

    /// Reconstructs the field; `None` once `stop` is true.
    pub(super) fn solve(
        self,
        name: &str,
        task: &GrinTask,
        nodes: usize,
        stop: &AtomicBool,
    ) -> Result<Option<StraightRayResult>, CliError> {
        let clock = Stopwatch::start();
        let is_stopped = || stop.load(Ordering::Relaxed);
        if is_stopped() {
            return Ok(None);
        }
        let (mut best, mut step, mut steps) = (None, 0, 0);
        let visit = |medium: &GrinField| {
            steps += 1;
            let difference = task.difference(medium).ok().flatten();
            let error = difference.map(|difference| difference.relative_to_contrast);
            let error = error.filter(|error| error.is_finite());
            if error.zip(best).is_none_or(|(error, best)| error < best) {
                (best, step) = (error, steps);
            }
            if is_stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        self.chords
            .reconstruct(nodes, CGLS_STEPS, visit)
            .map_err(|error| straight_ray_error(name, &error))?;
        let ms = self.ms + 1e3 * clock.seconds();
        let result = StraightRayResult { of_contrast: best, step, steps, ms };
        Ok((!is_stopped()).then_some(result))
    }
}

fn straight_ray_error(name: &str, error: &GrinTaskError) -> CliError {
    CliError::Input(format!("{name}, --lines: {error}"))
}

impl Display for StraightRayResult {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { of_contrast, step, steps, ms } = self;
        write!(f, "straight rays: {steps} least-squares steps, {:.2} s", 1e-3 * ms)?;
        match of_contrast {
            Some(error) => {
                writeln!(f, "; the best, step {step}, has an error of {error:.4} of the contrast")
            }
            None => writeln!(f),
        }
    }
}
