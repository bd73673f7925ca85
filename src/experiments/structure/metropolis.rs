//! Figure 4.4: RESTORE against Metropolis-Hastings.
//!
//! Noise makes Langevin steps small, and nearly every mutation is much worse than the lens that it
//! comes from and is rejected; RESTORE descends from it first. Both use the same number of
//! gradients. A Langevin step finds the pupils of the lens anew, a descent only at every twentieth
//! step: in time Metropolis-Hastings is farther behind than here.

use super::sampler_comparison::{SamplerComparison, SamplerKind};
use crate::experiments::{Effort, Experiment, ExperimentError, ExperimentOutcome, ProgressFn};

pub(in crate::experiments) const EXPERIMENT: Experiment = Experiment {
    id: "4.4",
    title: "RESTORE against Metropolis-Hastings on four lenses",
    claim: "With the same number of gradients RESTORE finds a better lens",
    seconds: 400.0,
    run,
};

fn run(
    effort: Effort,
    progress: &mut ProgressFn<'_>,
) -> Result<ExperimentOutcome, ExperimentError> {
    let (lenses, seeds, gradients) = effort.comparison_size();
    let samplers = &[SamplerKind::Restore, SamplerKind::Metropolis];
    SamplerComparison { samplers, rivals: &[SamplerKind::Metropolis], lenses, seeds, gradients }
        .run(progress)
}
