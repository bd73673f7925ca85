//! Searches that are watched: after every round it is written down how far they are.

use crate::experiments::sharpness_vs_light::ProgressSpan;
use crate::experiments::{ExperimentError, ProgressFn, report_progress};
use crate::lens::Lens;
use crate::search::lens_landscape::{LensLandscape, SearchPlan};
use crate::search::{MutationKind, SearchRun, SearchRunOn};
use rayon::prelude::*;

/// Gradients between two looks at whether a search shall go on.
const SLICE: u64 = 100;

/// A search, and what became of it so far.
#[derive(Debug)]
pub(super) struct RecordedSearch {
    pub(super) landscape: LensLandscape,
    pub(super) run: SearchRunOn<LensLandscape>,
    pub(super) marks: Vec<RoundRecord>,
}

/// How far a search was after a round.
#[derive(Debug, Clone, Copy)]
pub(super) struct RoundRecord {
    pub(super) gradients: u64,
    pub(super) moves: u64,
    /// Moves that led to something better than the start.
    pub(super) better: u64,
    pub(super) best: f64,
    /// Where its first chain is; none where its descent has just ended.
    pub(super) loss: Option<f64>,
    /// The generation of that chain, and the mutation with which it began.
    pub(super) generation: u64,
    pub(super) kind: Option<MutationKind>,
}

impl RecordedSearch {
    pub(super) fn new(start: &Lens, plan: &SearchPlan) -> Result<Self, ExperimentError> {
        let landscape = plan.landscape(start).map_err(ExperimentError::from_error)?;
        let settings = plan.settings(&landscape);
        let run = SearchRun::new(&landscape, landscape.start().clone(), &settings);
        Ok(Self { run: run.map_err(ExperimentError::from_error)?, landscape, marks: Vec::new() })
    }

    /// The loss of the lens at the start.
    pub(super) fn start(&self) -> f64 {
        self.run.start().loss
    }

    /// The loss of the best lens after so many gradients.
    pub(super) fn best_after(&self, gradients: u64) -> f64 {
        let seen = self.marks.partition_point(|mark| mark.gradients <= gradients);
        self.marks[..seen].last().map_or(self.start(), |mark| mark.best)
    }

    /// The share of the moves that led to something better than the start, up to so many
    /// gradients; not a number before the first move.
    pub(super) fn share_after(&self, gradients: u64) -> f64 {
        let seen = self.marks.iter().take_while(|mark| mark.gradients <= gradients);
        seen.last().map_or(f64::NAN, |mark| mark.better as f64 / mark.moves as f64)
    }

    /// Of the moves behind a mutation: those that led to something better than the start, and all.
    pub(super) fn mutation_moves_after(&self, gradients: u64) -> [u64; 2] {
        let (mut counts, mut last) = ([0, 0], [0, 0]);
        for mark in self.marks.iter().take_while(|mark| mark.gradients <= gradients) {
            let now = [mark.better, mark.moves];
            if mark.kind.is_some() {
                counts = [0, 1].map(|i| counts[i] + now[i] - last[i]);
            }
            last = now;
        }
        counts
    }

    /// About how many rays it traced for its gradients.
    pub(super) fn rays(&self) -> usize {
        self.landscape.rays_per_gradient(self.landscape.start())
            * self.run.statistics().gradients as usize
    }

    /// The part that is done.
    fn done(&self) -> f64 {
        let limit = self.run.settings().gradients.unwrap_or(0).max(1) as f64;
        let share = self.run.statistics().gradients as f64 / limit;
        if self.run.end_reason().is_some() { 1.0 } else { share.min(1.0) }
    }

    fn advance(&mut self) {
        let until = self.run.statistics().gradients + SLICE;
        while self.run.end_reason().is_none() && self.run.statistics().gradients < until {
            self.run.round(&self.landscape);
            self.marks.push(self.record());
        }
    }

    fn record(&self) -> RoundRecord {
        let done = self.run.statistics();
        let chain = &self.run.chains()[0];
        let generation = chain.generation();
        RoundRecord {
            gradients: done.gradients,
            moves: done.moves,
            better: done.better,
            best: self.run.best().loss,
            loss: chain.position().map(|(_, loss)| loss),
            generation,
            kind: self.run.lineage().node(generation).and_then(|node| node.kind),
        }
    }
}

/// Lets some searches go on side by side until all of them are over.
pub(super) fn run_to_end(
    courses: &mut [RecordedSearch],
    part: ProgressSpan<'_>,
    watch: &mut ProgressFn<'_>,
) -> Result<(), ExperimentError> {
    loop {
        let done: f64 =
            courses.iter().map(RecordedSearch::done).sum::<f64>() / courses.len() as f64;
        report_progress(watch, part.from + (part.to - part.from) * done, part.name)?;
        if courses.iter().all(|course| course.run.end_reason().is_some()) {
            return Ok(());
        }
        courses.par_iter_mut().for_each(RecordedSearch::advance);
    }
}
