//! Solving a GRIN task with progress.

use super::{ExperimentError, ExperimentResult, ProgressFn, report_progress};
use crate::grin_design::{GrinOptimizer, GrinTask};

/// Solves a task; it is the part `from` to `to` of the whole work.
pub(super) fn solve(
    task: &GrinTask,
    [from, to]: [f64; 2],
    progress: &mut ProgressFn<'_>,
) -> ExperimentResult<GrinOptimizer> {
    report_progress(progress, from, &task.name)?;
    let optimizer = GrinOptimizer::new(task).map_err(ExperimentError::from_error)?;
    solve_from(optimizer, [from, to], progress)
}

/// Continues an optimizer to its end; it is the part `from` to `to` of the whole work.
pub(super) fn solve_from(
    mut optimizer: GrinOptimizer,
    [from, to]: [f64; 2],
    progress: &mut ProgressFn<'_>,
) -> ExperimentResult<GrinOptimizer> {
    let name = optimizer.task().name.clone();
    let mut done = from;
    loop {
        let step = optimizer.step().map_err(ExperimentError::from_error)?;
        let share = step.step as f64 / step.max_steps.max(1) as f64;
        done = if step.finished { to } else { done.max(from + share.min(1.0) * (to - from)) };
        report_progress(progress, done, &name)?;
        if step.finished {
            return Ok(optimizer);
        }
    }
}
