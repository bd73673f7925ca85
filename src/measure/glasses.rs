//! The gain by an exchange of glasses, and its cost.

use super::limits::with_variables;
use super::timing::Stopwatch;
use crate::lens::Lens;
use crate::lens::glass;
use crate::merit::Goal;
use crate::optimize::{DescentMethod, GlassSearch, GlassSearchError, start};
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
    let lens = with_variables(lens);
    let goal = Goal::of_lens(&lens)?;
    let mut search = GlassSearch::new(&lens, &goal, tolerance, glass::catalogue(), seed)?;
    let merit_before = search.merit();
    let mut optimizer = start(DescentMethod::TrustRegion, &lens, &goal, tolerance)?;
    for _ in 0..DESCENT_STEPS {
        if stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        if optimizer.step().finished {
            break;
        }
    }
    optimizer.verify_best();
    search.restart(optimizer.best())?;
    let (watch, mut exchanges) = (Stopwatch::start(), 0);
    let merit_optimized = search.merit();
    while !stop.load(Ordering::Relaxed) {
        let round = search.round()?;
        exchanges += usize::from(round.accepted.is_some());
        if round.finished {
            let (merit, evaluations) = (round.merit, round.evaluations);
            let seconds = watch.seconds();
            return Ok(Some(GlassGain {
                merit_before,
                merit_optimized,
                merit,
                exchanges,
                evaluations,
                seconds,
            }));
        }
    }
    Ok(None)
}
