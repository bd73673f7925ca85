//! Figure 4.4: RESTORE against Metropolis and Hastings.
//!
//! Noise makes Langevin steps small, and nearly every mutation is much worse than the lens that it
//! comes from, so that it is rejected; RESTORE descends from it first. Both spend as many gradients.
//! A Langevin step looks for the pupils of the lens anew, a step of a descent only every twentieth
//! time: by the clock Metropolis and Hastings are farther behind than here.

use super::race::{Race, Runner};
use crate::experiments::{Effort, Ended, Experiment, Outcome, Watch};

pub(in crate::experiments) const EXPERIMENT: Experiment = Experiment {
    id: "4.4",
    title: "RESTORE against Metropolis and Hastings on four lenses",
    claim: "After as many gradients RESTORE has found a better lens",
    seconds: 400.0,
    run,
};

fn run(effort: Effort, watch: &mut Watch<'_>) -> Result<Outcome, Ended> {
    let (lenses, seeds, gradients) = effort.race();
    let runners = &[Runner::Restore, Runner::Metropolis];
    Race { runners, rivals: &[Runner::Metropolis], lenses, seeds, gradients }.run(watch)
}
