//! The gain by an exchange of glasses, its cost, and the gain at that cost without predictions.

use super::limits::with_variables;
use super::timing::Stopwatch;
use crate::lens::Lens;
use crate::lens::glass;
use crate::merit::Goal;
use crate::optimize::{DescentMethod, GlassSearch, GlassSearchError, start};
use serde::Serialize;
use std::ops::ControlFlow;

/// The steps of the descent before glasses are exchanged.
const DESCENT_STEPS: usize = 400;

/// The exchange of the glasses of one lens.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GlassGain {
    /// The merit of the lens as it is.
    pub merit_before: f64,
    /// The merit after a descent with the glasses of the lens, model glasses included.
    pub merit_optimized: f64,
    /// The merit with the last glasses.
    pub merit: f64,
    /// The glasses that were exchanged.
    pub exchanges: usize,
    /// The evaluations of the merit for the exchange.
    pub evaluations: usize,
    /// The time of the exchange in seconds.
    pub seconds: f64,
    /// True if no further exchange gains; false if it was ended before.
    pub finished: bool,
    /// The merit by exchanges in a random order with as many evaluations; `None` if they were ended before.
    pub merit_random: Option<f64>,
}

/// A part of a measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GlassPhase {
    /// The descent with the glasses of the lens.
    Descent,
    /// The exchange in the order of predictions.
    Guided,
    /// The exchange in a random order.
    Random,
}

/// The state of a measurement that goes on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GlassProgress {
    /// The part.
    pub phase: GlassPhase,
    /// The evaluations of it so far.
    pub evaluations: usize,
    /// The merit so far.
    pub merit: f64,
    /// The exchanges so far.
    pub exchanges: usize,
}

/// The caller of a measurement, who is told where it is and may end it.
type GlassWatch<'a> = dyn FnMut(GlassProgress) -> ControlFlow<()> + 'a;

/// Optimizes a lens, then exchanges its glasses for any of the catalogue, in an order by a seed, until nothing
/// gains or `most` evaluations are used. A lens without a goal gets the default one, a lens without variables all
/// curvatures and thicknesses. Ended by `watch`, it gives what was found so far; `None` before the exchange began.
///
/// # Errors
/// A lens without glasses to exchange, or without a merit.
pub fn measure_glass_gain(
    lens: &Lens,
    (seed, tolerance): (u64, f64),
    most: Option<usize>,
    watch: &mut GlassWatch<'_>,
) -> Result<Option<GlassGain>, GlassSearchError> {
    let first = with_variables(lens);
    let goal = Goal::of_lens(&first)?;
    let mut search = GlassSearch::new(&first, &goal, tolerance, glass::catalogue(), seed)?;
    let merit_before = search.merit();
    let Some(lens) = descended(&first, &goal, tolerance, watch)? else { return Ok(None) };
    search.restart(&lens)?;
    let merit_optimized = search.merit();
    let guided = exchange(&mut search, (GlassPhase::Guided, most), watch)?;
    let merit_random = if guided.is_ended_early || guided.evaluations == 0 {
        None
    } else {
        let random = GlassSearch::new(&first, &goal, tolerance, glass::catalogue(), seed)?;
        let mut random = random.without_predictions();
        random.restart(&lens)?;
        let limit = (GlassPhase::Random, Some(guided.evaluations));
        let found = exchange(&mut random, limit, watch)?;
        (!found.is_ended_early && found.evaluations > 0).then_some(found.merit)
    };
    Ok(Some(GlassGain {
        merit_before,
        merit_optimized,
        merit: guided.merit,
        exchanges: guided.exchanges,
        evaluations: guided.evaluations,
        seconds: guided.seconds,
        finished: guided.is_finished,
        merit_random,
    }))
}

/// A lens after a descent with its glasses; `None` once `watch` ends it.
fn descended(
    lens: &Lens,
    goal: &Goal,
    tolerance: f64,
    watch: &mut GlassWatch<'_>,
) -> Result<Option<Lens>, GlassSearchError> {
    let mut optimizer = start(DescentMethod::TrustRegion, lens, goal, tolerance)?;
    for _ in 0..DESCENT_STEPS {
        let step = optimizer.step();
        let (evaluations, merit) = (step.evaluations, step.best);
        let phase = GlassPhase::Descent;
        if watch(GlassProgress { phase, evaluations, merit, exchanges: 0 }).is_break() {
            return Ok(None);
        }
        if step.finished {
            break;
        }
    }
    optimizer.verify_best();
    Ok(Some(optimizer.best().clone()))
}

/// The end of an exchange.
struct ExchangeEnd {
    merit: f64,
    exchanges: usize,
    evaluations: usize,
    /// The time of the rounds that count.
    seconds: f64,
    /// True if nothing further gains.
    is_finished: bool,
    /// True if `watch` ended it.
    is_ended_early: bool,
}

/// Exchanges glasses until nothing gains, or a round takes more than the evaluations that it may: that round
/// does not count. A search in a random order begins anew from its best lens where it ends before.
fn exchange(
    search: &mut GlassSearch,
    (phase, most): (GlassPhase, Option<usize>),
    watch: &mut GlassWatch<'_>,
) -> Result<ExchangeEnd, GlassSearchError> {
    let clock = Stopwatch::start();
    let mut end = ExchangeEnd {
        merit: search.merit(),
        exchanges: 0,
        evaluations: 0,
        seconds: 0.0,
        is_finished: false,
        is_ended_early: false,
    };
    loop {
        let round = search.round()?;
        if most.is_some_and(|most| round.evaluations > most) {
            return Ok(end);
        }
        end.merit = round.merit;
        end.exchanges += usize::from(round.accepted.is_some());
        end.evaluations = round.evaluations;
        end.seconds = clock.seconds();
        let ExchangeEnd { merit, exchanges, evaluations, .. } = end;
        if phase == GlassPhase::Guided && round.finished {
            return Ok(ExchangeEnd { is_finished: true, ..end });
        }
        if watch(GlassProgress { phase, evaluations, merit, exchanges }).is_break() {
            return Ok(ExchangeEnd { is_ended_early: true, ..end });
        }
    }
}
