//! Searches with a record of their progress after every round.

use crate::experiments::sharpness_vs_light::ProgressSpan;
use crate::experiments::{ExperimentResult, ProgressFn, report_progress};
use crate::lens::Lens;
use crate::search::lens_landscape::{LensLandscape, SearchPlan};
use crate::search::{MutationKind, SearchRunOn};
use rayon::prelude::*;
use std::ops::ControlFlow;

/// The number of gradients of all searches together between two reports of progress, and the largest
/// one of each: a report is the only occasion to stop them.
const SLICE: u64 = 400;
const SLICE_OF_EACH: u64 = 100;

/// A search with the record of its rounds.
#[derive(Debug)]
pub(super) struct RecordedSearch {
    pub(super) landscape: LensLandscape,
    pub(super) run: SearchRunOn<LensLandscape>,
    pub(super) marks: Vec<RoundRecord>,
}

/// The progress of a search after a round.
#[derive(Debug, Clone, Copy)]
pub(super) struct RoundRecord {
    pub(super) gradients: u64,
    pub(super) moves: u64,
    /// The number of moves to a lens better than the start.
    pub(super) better: u64,
    pub(super) best: f64,
    /// The loss of its first chain; `None` if its descent has just ended.
    pub(super) loss: Option<f64>,
    /// The generation of that chain.
    pub(super) generation: u64,
    pub(super) kind: Option<MutationKind>,
}

impl RecordedSearch {
    pub(super) fn new(start: &Lens, plan: &SearchPlan) -> ExperimentResult<Self> {
        let (landscape, run) = plan.begin(start)?;
        Ok(Self { landscape, run, marks: Vec::new() })
    }

    /// The loss of the starting lens.
    pub(super) fn start(&self) -> f64 {
        self.run.start().loss
    }

    /// The loss of the best lens after a number of gradients.
    pub(super) fn best_after(&self, gradients: u64) -> f64 {
        let seen = self.marks.partition_point(|mark| mark.gradients <= gradients);
        self.marks[..seen].last().map_or(self.start(), |mark| mark.best)
    }

    /// The fraction of the moves to a lens better than the start, up to a number of gradients; NaN
    /// before the first move.
    pub(super) fn share_after(&self, gradients: u64) -> f64 {
        let seen = self.marks.iter().take_while(|mark| mark.gradients <= gradients);
        seen.last().map_or(f64::NAN, |mark| mark.better as f64 / mark.moves as f64)
    }

    /// The number of moves after a mutation to a lens better than the start, and the number of all
    /// moves after one.
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

    /// The approximate number of rays traced for its gradients.
    pub(super) fn rays(&self) -> usize {
        self.landscape.rays_per_gradient(self.landscape.start())
            * self.run.statistics().gradients as usize
    }

    /// The completed fraction.
    fn done(&self) -> f64 {
        let limit = self.run.settings().gradients.unwrap_or(0).max(1) as f64;
        let share = self.run.statistics().gradients as f64 / limit;
        if self.run.end_reason().is_some() { 1.0 } else { share.min(1.0) }
    }

    /// Goes on until about so many gradients more are made.
    fn advance(&mut self, gradients: u64) {
        let Self { landscape, run, marks } = self;
        let until = run.statistics().gradients + gradients;
        let flow = run.advance(landscape, |run, _| {
            marks.push(RoundRecord::new(run));
            if run.statistics().gradients < until {
                ControlFlow::Continue(())
            } else {
                ControlFlow::Break(())
            }
        });
        match flow {
            ControlFlow::Continue(_) | ControlFlow::Break(()) => {}
        }
    }
}

impl RoundRecord {
    fn new(run: &SearchRunOn<LensLandscape>) -> Self {
        let done = run.statistics();
        let chain = &run.chains()[0];
        let generation = chain.generation();
        Self {
            gradients: done.gradients,
            moves: done.moves,
            better: done.better,
            best: run.best().loss,
            loss: chain.position().map(|(_, loss)| loss),
            generation,
            kind: run.lineage().node(generation).and_then(|node| node.kind),
        }
    }
}

/// Runs searches in parallel until all of them have ended.
pub(super) fn run_to_end(
    searches: &mut [RecordedSearch],
    part: ProgressSpan<'_>,
    progress: &mut ProgressFn<'_>,
) -> ExperimentResult<()> {
    let slice = (SLICE / searches.len().max(1) as u64).clamp(1, SLICE_OF_EACH);
    loop {
        let done: f64 =
            searches.iter().map(RecordedSearch::done).sum::<f64>() / searches.len() as f64;
        report_progress(progress, part.from + (part.to - part.from) * done, part.name)?;
        if searches.iter().all(|search| search.run.end_reason().is_some()) {
            return Ok(());
        }
        searches.par_iter_mut().for_each(|search| search.advance(slice));
    }
}

/// A search with these rounds: gradients, moves, moves to better lenses, and the best loss.
#[cfg(test)]
pub(super) fn with_rounds(rounds: &[(u64, u64, u64, f64)]) -> RecordedSearch {
    let record = |&(gradients, moves, better, best): &(u64, u64, u64, f64)| RoundRecord {
        gradients,
        moves,
        better,
        best,
        loss: None,
        generation: 0,
        kind: None,
    };
    let lens = crate::files::bundled_lenses().iter().find(|b| b.name == "singlet_la1131").unwrap();
    let lens = crate::files::json::read(lens.text, lens.name).unwrap();
    let mut search = RecordedSearch::new(&lens, &SearchPlan::default()).unwrap();
    search.marks = rounds.iter().map(record).collect();
    search
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_is_read_up_to_a_number_of_gradients() {
        let search = with_rounds(&[(10, 4, 1, 0.9), (20, 8, 2, 0.5), (30, 10, 5, 0.5)]);
        assert!(search.share_after(9).is_nan(), "before the first move");
        assert_eq!([10, 19, 20, 99].map(|g| search.share_after(g)), [0.25, 0.25, 0.25, 0.5]);
        assert_eq!([10, 29, 99].map(|g| search.best_after(g)), [0.9, 0.5, 0.5]);
        assert_eq!(search.best_after(5), search.start());
    }
}
