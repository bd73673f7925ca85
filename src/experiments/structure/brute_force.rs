//! Figure 4.5: RESTORE against brute force, which adds a singlet behind every element, removes each
//! one, and descends from every such lens with an equal part of the gradients.
//!
//! Metropolis-Hastings and a descent without mutations are plotted for comparison; the gap to the
//! latter is the gain by mutations. No claim is made about it, and none would hold: from a
//! published lens in a long valley (135 mm) it reaches the same merit as the search, which spends
//! its gradients on many structures.

use super::sampler_comparison::{SamplerComparison, SamplerKind};
use crate::experiments::{Effort, Experiment, ExperimentError, ExperimentOutcome, ProgressFn};

pub(in crate::experiments) const EXPERIMENT: Experiment = Experiment {
    id: "4.5",
    title: "RESTORE against brute force on four lenses",
    claim: "With the same number of gradients RESTORE finds a better lens than either baseline",
    seconds: 750.0,
    run,
};

fn run(
    effort: Effort,
    progress: &mut ProgressFn<'_>,
) -> Result<ExperimentOutcome, ExperimentError> {
    let (lenses, seeds, gradients) = effort.comparison_size();
    let samplers =
        &[SamplerKind::Restore, SamplerKind::Brute, SamplerKind::Metropolis, SamplerKind::Descent];
    let rivals = &samplers[1..3];
    SamplerComparison { samplers, rivals, lenses, seeds, gradients }.run(progress)
}
