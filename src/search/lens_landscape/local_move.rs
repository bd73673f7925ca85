//! Local moves: segments of a descent from a lens.
//!
//! The first segments of a descent count limits as penalties, by which it comes through lenses that break
//! them. A penalty turns sharply where another rim begins to take light, and a descent along such a turn
//! crawls. So once segments gain little, the next ones keep the limits as constraints, which know where
//! limits turn.

use super::LensLandscape;
use crate::lens::Lens;
use crate::merit::MeritError;
use crate::optimize::{
    DescentMethod, DescentState, LimitedSegment, SegmentResult, SegmentSettings,
    run_limited_segment, run_segment,
};
use std::sync::Arc;

/// The gain of a move relative to the loss below which the next one keeps the limits.
const SLOW_GAIN: f64 = 0.1;
/// The gradients of a move that keeps the limits, relative to the steps of other moves: its rays and
/// corrections at the end take a part of them.
const LIMITED_GRADIENTS: usize = 3;
/// The most times as many as that in a later one of several such moves in a row, where long moves are allowed.
pub(super) const LARGEST_MULTIPLE: usize = 4;
/// The gradients below which a move does not keep the limits.
const FEWEST_GRADIENTS: usize = 20;
/// The number of such moves in a descent that may fail.
const FAILURES: usize = 3;
/// The relative increase of the loss that a move may make, since the rays of two lenses differ.
const SLACK: f64 = 0.05;

/// True if a move by penalties from one loss to another gains so little that limits are to be kept from there on.
pub fn gains_little(before: f64, loss: f64) -> bool {
    loss >= (1.0 - SLOW_GAIN) * before
}

/// The end of a local move.
#[derive(Debug)]
pub(super) struct LocalMove {
    pub(super) lens: Arc<Lens>,
    /// The loss of the lens.
    pub(super) loss: f64,
    /// The gradients that the move has taken.
    pub(super) gradients: usize,
}

impl LensLandscape {
    /// A local move of at most `most` steps.
    pub(super) fn try_move(
        &self,
        lens: &Arc<Lens>,
        memory: &mut DescentState,
        most: usize,
    ) -> Result<LocalMove, MeritError> {
        memory.has_ended = false;
        if memory.keeps_limits && most >= FEWEST_GRADIENTS {
            return self.limited_move(lens, memory, most);
        }
        let (before, moved) = self.penalized_move(lens, memory, most)?;
        let is_slow = gains_little(before, moved.loss);
        memory.keeps_limits = is_slow
            && !memory.penalties_only
            && self.local.method == DescentMethod::TrustRegion
            && self.goal.terms.iter().any(|weighted| weighted.term.is_limit())
            && memory.failures_with_limits < FAILURES;
        memory.limited_segments = 0;
        Ok(moved)
    }

    /// A move that keeps the limits; none, and penalties in the next one, if no lens nearby keeps them or
    /// only a worse one does.
    fn limited_move(
        &self,
        lens: &Arc<Lens>,
        memory: &mut DescentState,
        most: usize,
    ) -> Result<LocalMove, MeritError> {
        let before = self.evaluate(lens)?;
        let tolerance = self.local.tolerance;
        let longest = memory.largest_multiple.unwrap_or(1);
        let multiple = (memory.limited_segments + 1).min(longest);
        let evaluations = (multiple * LIMITED_GRADIENTS * self.local.steps).min(most);
        let asked = LimitedSegment { evaluations, tolerance };
        let free = self.with_variables(lens);
        let segment = self
            .constrained_merit(lens)
            .and_then(|merit| run_limited_segment(merit, &free, asked, memory));
        let gradients = segment.as_ref().map_or(1, |segment| segment.gradients);
        let has_ended = segment.as_ref().is_ok_and(|segment| segment.has_ended);
        let moved = segment.and_then(|segment| self.evaluated(segment, lens));
        if let Ok((there, loss)) = moved
            && loss < (1.0 + SLACK) * before
        {
            // The first segment began where limits were broken, by which its end is judged: the next one has
            // to end too.
            memory.has_ended = has_ended && memory.limited_segments > 0;
            memory.limited_segments += 1;
            return Ok(LocalMove { lens: there, loss, gradients });
        }
        memory.keeps_limits = false;
        memory.failures_with_limits += 1;
        Ok(LocalMove { lens: lens.clone(), loss: before, gradients })
    }

    /// The lens at the end of a segment with the variables of another one, and its loss with its own pupils.
    fn evaluated(
        &self,
        segment: SegmentResult,
        from: &Lens,
    ) -> Result<(Arc<Lens>, f64), MeritError> {
        let mut there = segment.lens;
        there.variables.clone_from(&from.variables);
        let loss = self.evaluate(&there)?;
        Ok((Arc::new(there), loss))
    }

    /// A move by penalties, and the loss before it.
    fn penalized_move(
        &self,
        lens: &Arc<Lens>,
        memory: &mut DescentState,
        most: usize,
    ) -> Result<(f64, LocalMove), MeritError> {
        let settings = &self.local;
        let is_coarse = memory.steps < settings.coarse_steps;
        let tolerance = if is_coarse { settings.coarse } else { settings.tolerance };
        let merit = self.merit(lens, tolerance)?;
        let (method, rate) = (settings.method, settings.rate);
        let asked = SegmentSettings { method, steps: settings.steps.min(most), rate };
        let segment = run_segment(merit, &self.with_variables(lens), asked, memory)?;
        let gradients = segment.gradients;
        let before = self.priced(lens, segment.initial_merit);
        match self.evaluated(segment, lens) {
            Ok((there, loss)) if loss < before || is_coarse => {
                memory.grow_step();
                Ok((before, LocalMove { lens: there, loss, gradients }))
            }
            Ok((there, loss)) if loss < (1.0 + SLACK) * before => {
                memory.shrink_step();
                Ok((before, LocalMove { lens: there, loss, gradients }))
            }
            Ok(_) | Err(_) => {
                memory.restart_slower();
                let loss = if is_coarse { self.evaluate(lens)? } else { before };
                Ok((before, LocalMove { lens: lens.clone(), loss, gradients }))
            }
        }
    }
}
