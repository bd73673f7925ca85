//! Figure 4.5: RESTORE against brute force, which adds a singlet behind every element, removes each
//! one, and descends from every such lens for its part of the gradients.
//!
//! Metropolis and Hastings stand beside them, and a descent from the start that never mutates: what
//! lies below it is what mutations are worth. No claim is made about that one, and none would hold:
//! from a published lens in a long valley (135 mm) it comes as low as the search, which spends its
//! gradients on many structures.

use super::sampler_comparison::{SamplerComparison, SamplerKind};
use crate::experiments::{Effort, Experiment, ExperimentError, ExperimentOutcome, ProgressFn};

pub(in crate::experiments) const EXPERIMENT: Experiment = Experiment {
    id: "4.5",
    title: "RESTORE against brute force on four lenses",
    claim: "After as many gradients RESTORE has found a better lens than either baseline",
    seconds: 750.0,
    run,
};

fn run(effort: Effort, watch: &mut ProgressFn<'_>) -> Result<ExperimentOutcome, ExperimentError> {
    let (lenses, seeds, gradients) = effort.comparison_size();
    let runners =
        &[SamplerKind::Restore, SamplerKind::Brute, SamplerKind::Metropolis, SamplerKind::Descent];
    let rivals = &runners[1..3];
    SamplerComparison { samplers: runners, rivals, lenses, seeds, gradients }.run(watch)
}
