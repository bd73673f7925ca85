//! Figure 4.5: RESTORE against brute force, which adds a singlet behind every element, removes each
//! one, and descends from every such lens for its part of the gradients.
//!
//! Metropolis and Hastings stand beside them, and a descent from the start that never mutates: what
//! lies below it is what mutations are worth. No claim is made about that one, and none would hold:
//! from a published lens in a long valley (135 mm) it comes as low as the search, which spends its
//! gradients on many structures.

use super::race::{Race, Runner};
use crate::experiments::{Effort, Ended, Experiment, Outcome, Watch};

pub(in crate::experiments) const EXPERIMENT: Experiment = Experiment {
    id: "4.5",
    title: "RESTORE against brute force on four lenses",
    claim: "After as many gradients RESTORE has found a better lens than either baseline",
    seconds: 750.0,
    run,
};

fn run(effort: Effort, watch: &mut Watch<'_>) -> Result<Outcome, Ended> {
    let (lenses, seeds, gradients) = effort.race();
    let runners = &[Runner::Restore, Runner::Brute, Runner::Metropolis, Runner::Descent];
    let rivals = &runners[1..3];
    Race { runners, rivals, lenses, seeds, gradients }.run(watch)
}
