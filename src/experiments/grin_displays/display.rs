//! Figure 5.4: a display that shows two pictures, one to each of two beams at a right angle.
//!
//! The portraits of the thesis are replaced by a face and a letter. Finer levels descend by smaller
//! steps: with the steps of a coarse level the noise of fresh rays would move every one of their many
//! coefficients, most of which few rays meet, and undo what the coarse level has found.

use super::{outcome_of, solve_and_evaluate, task};
use crate::experiments::{
    Claim, Effort, Experiment, ExperimentError, ExperimentOutcome, ProgressFn,
};

pub(in crate::experiments) const EXPERIMENT: Experiment = Experiment {
    id: "5.4",
    title: "A display of two pictures",
    claim: "One field makes two pictures, one for each of two beams at a right angle",
    seconds: 20.0,
    run,
};

/// Nodes along a side, in full and as a test.
const NODES: [usize; 2] = [33, 9];
/// The least quality in dB and the least correlation.
const LEAST: [[f64; 2]; 2] = [[24.0, 0.97], [14.0, 0.75]];

fn run(effort: Effort, watch: &mut ProgressFn<'_>) -> Result<ExperimentOutcome, ExperimentError> {
    let task = task("display", effort, 2)?;
    let shown = solve_and_evaluate(&task, [0.0, 1.0], watch)?;
    let [nodes, few] = NODES;
    let [least, less] = LEAST;
    let mut outcome = outcome_of(&shown, &["face", "letter"], effort.select(least, less));
    let found = shown.runner.best().nodes();
    let says = "nodes along a side of the best field";
    outcome.claims.push(Claim::exactly(says, found as f64, effort.select(nodes, few) as f64));
    Ok(outcome)
}
