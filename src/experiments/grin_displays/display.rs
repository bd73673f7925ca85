//! Figure 5.4: a display of two images, one for each of two beams at a right angle.
//!
//! The portraits of the thesis are replaced by a face and a letter. Finer levels use smaller steps:
//! with the steps of a coarse level, the noise of new rays would disturb all of their many
//! coefficients, most of which few rays cross, and destroy the result of the coarse level.

use super::{outcome_of, solve_and_evaluate, task};
use crate::experiments::{Claim, Effort, Experiment, ExperimentResult, ProgressFn};

pub(in crate::experiments) const EXPERIMENT: Experiment = Experiment {
    id: "5.4",
    title: "A display of two images",
    claim: "One field forms two images, one for each of two beams at a right angle",
    omits: "the portraits, which a face and a letter replace",
    seconds: 20.0,
    run,
};

/// The nodes along a side, in full and as a test.
const NODES: [usize; 2] = [33, 9];
/// The minimum quality in dB and the minimum correlation.
const LEAST: [[f64; 2]; 2] = [[24.0, 0.97], [14.0, 0.75]];

fn run(effort: Effort, progress: &mut ProgressFn<'_>) -> ExperimentResult {
    let task = task("display", effort, 2)?;
    let evaluated = solve_and_evaluate(&task, effort, [0.0, 1.0], progress)?;
    let [nodes, few] = NODES;
    let [least, less] = LEAST;
    let names = ["face", "letter"];
    let mut outcome = outcome_of(&evaluated, &names, effort.select(least, less), effort);
    let found = evaluated.optimizer.best().nodes();
    let says = "nodes along a side of the best field";
    outcome.claims.push(Claim::exactly(says, found as f64, effort.select(nodes, few) as f64));
    Ok(outcome)
}
