//! The gain by an exchange of glasses, its cost, and the gain at that cost without predictions.

use super::limits::with_variables;
use super::timing::Stopwatch;
use crate::lens::Lens;
use crate::lens::glass;
use crate::merit::Goal;
use crate::optimize::{DescentMethod, GlassRound, GlassSearch, GlassSearchError, start};
use serde::Serialize;
use std::sync::atomic::{AtomicBool, Ordering};

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
    /// The merit by exchanges in a random order with as many evaluations.
    pub merit_random: f64,
}

/// Optimizes a lens, then exchanges its glasses for any of the catalogue, in an order by a seed. A lens
/// without a goal gets the default one, a lens without variables all curvatures and thicknesses. `None` once
/// `stop` is true.
///
/// # Errors
/// A lens without glasses to exchange, or without a merit.
pub fn measure_glass_gain(
    lens: &Lens,
    seed: u64,
    tolerance: f64,
    stop: &AtomicBool,
) -> Result<Option<GlassGain>, GlassSearchError> {
    let first = with_variables(lens);
    let goal = Goal::of_lens(&first)?;
    let mut search = GlassSearch::new(&first, &goal, tolerance, glass::catalogue(), seed)?;
    let merit_before = search.merit();
    let mut optimizer = start(DescentMethod::TrustRegion, &first, &goal, tolerance)?;
    for _ in 0..DESCENT_STEPS {
        if stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        if optimizer.step().finished {
            break;
        }
    }
    optimizer.verify_best();
    let lens = optimizer.best();
    search.restart(lens)?;
    let watch = Stopwatch::start();
    let merit_optimized = search.merit();
    let Some((rounds, exchanges)) = search_to_end(&mut search, stop)? else { return Ok(None) };
    let seconds = watch.seconds();
    let mut random = GlassSearch::new(&first, &goal, tolerance, glass::catalogue(), seed)?;
    random = random.without_predictions();
    random.restart(lens)?;
    let Some(merit_random) = merit_after(&mut random, rounds.evaluations, stop)? else {
        return Ok(None);
    };
    Ok(Some(GlassGain {
        merit_before,
        merit_optimized,
        merit: rounds.merit,
        exchanges,
        evaluations: rounds.evaluations,
        seconds,
        merit_random,
    }))
}

/// The last round of a search, and the exchanges that were taken; `None` once `stop` is true.
fn search_to_end(
    search: &mut GlassSearch,
    stop: &AtomicBool,
) -> Result<Option<(GlassRound, usize)>, GlassSearchError> {
    let mut exchanges = 0;
    while !stop.load(Ordering::Relaxed) {
        let round = search.round()?;
        exchanges += usize::from(round.accepted.is_some());
        if round.finished {
            return Ok(Some((round, exchanges)));
        }
    }
    Ok(None)
}

/// The merit of a search after this many evaluations, which begins anew from its best lens where it ends
/// before; `None` once `stop` is true.
fn merit_after(
    search: &mut GlassSearch,
    evaluations: usize,
    stop: &AtomicBool,
) -> Result<Option<f64>, GlassSearchError> {
    let mut merit = search.merit();
    while !stop.load(Ordering::Relaxed) {
        let round = search.round()?;
        if round.evaluations > evaluations {
            return Ok(Some(merit));
        }
        merit = round.merit;
    }
    Ok(None)
}
