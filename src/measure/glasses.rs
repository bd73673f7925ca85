//! What an exchange of glasses gains that is guided by predictions, beside one at random.

use super::limits::with_variables;
use super::timing::Stopwatch;
use crate::lens::Lens;
use crate::lens::glass;
use crate::merit::Goal;
use crate::optimize::{DescentMethod, ExchangeOrder, GlassSearch, GlassSearchError, start};
use serde::Serialize;
use std::sync::atomic::{AtomicBool, Ordering};

/// The steps of the descent before glasses are exchanged.
const DESCENT_STEPS: usize = 400;

/// Exchanges of the glasses of one lens.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GlassComparison {
    /// The merit of the lens as it is, and after a descent with its own glasses.
    pub merit_before: f64,
    /// The merit after a descent with the glasses of the lens.
    pub merit_optimized: f64,
    /// The exchange that is guided.
    pub guided: GlassCourse,
    /// The exchange at random, with at least as many evaluations.
    pub random: GlassCourse,
}

/// One search among glasses.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GlassCourse {
    /// The merit at the end.
    pub merit: f64,
    /// The glasses that were exchanged.
    pub exchanges: usize,
    /// The evaluations of the merit, with derivatives or without them.
    pub evaluations: usize,
    /// The time in seconds.
    pub seconds: f64,
}

/// Optimizes a lens, then exchanges its glasses for any of the catalogue, guided and at random from a seed. A
/// lens without a goal gets the default one, a lens without variables all curvatures and thicknesses. `None`
/// once `stop` is true.
///
/// # Errors
/// A lens without glasses to exchange, or without a merit.
pub fn compare_glass_exchange(
    lens: &Lens,
    seed: u64,
    tolerance: f64,
    stop: &AtomicBool,
) -> Result<Option<GlassComparison>, GlassSearchError> {
    let lens = with_variables(lens);
    let goal = Goal::of_lens(&lens)?;
    let search = |order| GlassSearch::new(&lens, &goal, tolerance, glass::catalogue(), order);
    let (guided, random) =
        (search(ExchangeOrder::Predicted)?, search(ExchangeOrder::Random(seed))?);
    let merit_before = guided.merit();
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
    let from = optimizer.best();
    let course = |search, evaluations| run(search, from, evaluations, stop);
    let Some((guided, merit_optimized)) = course(guided, None)? else { return Ok(None) };
    let Some((random, _)) = course(random, Some(guided.evaluations))? else { return Ok(None) };
    Ok(Some(GlassComparison { merit_before, merit_optimized, guided, random }))
}

/// The rounds of a search from a lens until it has ended, or until a number of evaluations, with the merit at
/// its start; `None` once `stop` is true.
fn run(
    mut search: GlassSearch,
    from: &Lens,
    evaluations: Option<usize>,
    stop: &AtomicBool,
) -> Result<Option<(GlassCourse, f64)>, GlassSearchError> {
    search.restart(from)?;
    let before = search.merit();
    let (watch, mut exchanges) = (Stopwatch::start(), 0);
    loop {
        if stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        let round = search.round()?;
        exchanges += usize::from(round.accepted.is_some());
        if evaluations.map_or(round.finished, |most| round.evaluations >= most) {
            let (merit, evaluations) = (round.merit, round.evaluations);
            let seconds = watch.seconds();
            return Ok(Some((GlassCourse { merit, exchanges, evaluations, seconds }, before)));
        }
    }
}
