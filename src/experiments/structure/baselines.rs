//! Figures 4.4 and 4.5: RESTORE against Metropolis-Hastings, and against brute force.
//!
//! For Metropolis-Hastings noise makes Langevin steps small, and nearly every mutation is much worse
//! than the lens that it comes from and is rejected; RESTORE descends from it first. Both use the
//! same number of gradients. A Langevin step finds the pupils of the lens anew, a descent only at
//! every twentieth step: in time Metropolis-Hastings is farther behind than here.
//!
//! Brute force adds a singlet behind every element, removes each one, and descends from every such
//! lens with an equal part of the gradients. Metropolis-Hastings and a descent without mutations are
//! plotted for comparison; the gap to the latter is the gain by mutations. No claim is made about
//! it, and none would hold: from a published lens in a long valley (135 mm) it reaches the same
//! merit as the search, which spends its gradients on many structures.

use super::sampler_comparison::{SamplerComparison, SamplerKind};
use crate::experiments::{Effort, Experiment, ExperimentResult, ProgressFn};

pub(in crate::experiments) const METROPOLIS: Experiment = Experiment {
    id: "4.4",
    title: "RESTORE against Metropolis-Hastings on four lenses",
    claim: "With the same number of gradients RESTORE finds a better lens",
    omits: "runs of 40 minutes; equal numbers of gradients are compared",
    seconds: 400.0,
    run: run_metropolis,
};

pub(in crate::experiments) const BRUTE_FORCE: Experiment = Experiment {
    id: "4.5",
    title: "RESTORE against brute force on four lenses",
    claim: "With the same number of gradients RESTORE finds a better lens than either baseline",
    omits: "runs of 40 minutes; equal numbers of gradients are compared",
    seconds: 1300.0,
    run: run_brute_force,
};

fn run_metropolis(effort: Effort, progress: &mut ProgressFn<'_>) -> ExperimentResult {
    let samplers = &[SamplerKind::Restore, SamplerKind::Metropolis];
    compare(samplers, &samplers[1..], effort, progress)
}

fn run_brute_force(effort: Effort, progress: &mut ProgressFn<'_>) -> ExperimentResult {
    let samplers =
        &[SamplerKind::Restore, SamplerKind::Brute, SamplerKind::Metropolis, SamplerKind::Descent];
    compare(samplers, &samplers[1..3], effort, progress)
}

fn compare(
    samplers: &'static [SamplerKind],
    rivals: &'static [SamplerKind],
    effort: Effort,
    progress: &mut ProgressFn<'_>,
) -> ExperimentResult {
    let (lenses, seeds, gradients) = effort.comparison_size();
    SamplerComparison { samplers, rivals, lenses, seeds, gradients }.run(progress)
}
