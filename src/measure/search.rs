//! The merit reached by a structure search over time, for all samplers and several tolerances of
//! the spots.
//!
//! Every lens compared is evaluated anew with the same fine sampling, so that a search with a
//! coarse one does not look better than it is.

use super::timing::Stopwatch;
use crate::lens::Lens;
use crate::merit::MeritError;
use crate::search::lens_landscape::{LensLandscape, SearchPlan, SearchSetupError};
use crate::search::{SearchMethod, SearchSettings};
use serde::Serialize;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};

/// The fractions of the time after which the merit is recorded.
const MARKS: [f64; 4] = [0.125, 0.25, 0.5, 1.0];
/// The tolerances compared.
const TOLERANCES: [f64; 4] = [1e-1, 1e-2, 1e-3, 1e-4];
/// The tolerance with which lenses are compared.
const EVALUATION_TOLERANCE: f64 = 1e-4;

/// The duration and the number of runs of a benchmark.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SearchBudget {
    /// The duration of each search, in seconds.
    pub seconds: f64,
    /// The number of seeds, from 1 on.
    pub seeds: u64,
}

/// The results of a sampler at a tolerance.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SearchRow {
    /// The sampler.
    pub method: SearchMethod,
    /// The relative tolerance of the spot radii.
    pub tolerance: f64,
    /// The number of gradients, all seeds together.
    pub gradients: u64,
    /// The merit after fractions of the time.
    pub marks: Vec<MeritQuantiles>,
}

/// The merit of the best lens after some time: best, median and worst of all seeds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MeritQuantiles {
    /// The time since the start, in seconds.
    pub seconds: f64,
    /// The best of all seeds.
    pub best: f64,
    /// The median.
    pub median: f64,
    /// The worst.
    pub worst: f64,
}

/// The benchmark of the samplers and of the tolerances.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SearchBenchmark {
    /// The duration and the number of seeds.
    pub race: SearchBudget,
    /// The merit of the starting lens.
    pub start: f64,
    /// The samplers at the tolerance asked for.
    pub methods: Vec<SearchRow>,
    /// RESTORE at other tolerances.
    pub tolerances: Vec<SearchRow>,
}

/// Runs a search from a lens with every sampler and at every tolerance, all for the same time. Once
/// `stop` is true, the runs so far are returned.
///
/// # Errors
/// A lens that a search cannot start from.
pub fn compare_searches(
    lens: &Lens,
    plan: &SearchPlan,
    race: SearchBudget,
    stop: &AtomicBool,
) -> Result<SearchBenchmark, SearchSetupError> {
    let landscape = plan.landscape(lens)?;
    let row = |method, tolerance, gradients| {
        let mut plan = plan.clone();
        (plan.local.tolerance, plan.local.coarse) = (tolerance, tolerance);
        plan.settings = SearchSettings { method, gradients, moves: None, ..plan.settings };
        run_seeds(lens, &plan, race, stop)
    };
    let usual = plan.local.tolerance;
    let restore = row(SearchMethod::Restore, usual, None)?;
    // Brute force divides the number of gradients that another sampler computed in the same time.
    let share = restore.gradients / race.seeds.max(1);
    let mut methods = vec![restore];
    for (method, gradients) in
        [(SearchMethod::Metropolis, None), (SearchMethod::BruteForce, Some(share.max(1)))]
    {
        if !stop.load(Ordering::Relaxed) {
            methods.push(row(method, usual, gradients)?);
        }
    }
    let mut tolerances = Vec::new();
    for tolerance in TOLERANCES {
        if !stop.load(Ordering::Relaxed) {
            tolerances.push(row(SearchMethod::Restore, tolerance, None)?);
        }
    }
    let start = merit_of(&landscape, landscape.start()).unwrap_or(f64::INFINITY);
    Ok(SearchBenchmark { race, start, methods, tolerances })
}

fn merit_of(landscape: &LensLandscape, lens: &Lens) -> Result<f64, MeritError> {
    let merit = landscape.merit(lens, EVALUATION_TOLERANCE)?;
    merit.value(&merit.values(&landscape.with_variables(lens)))
}

fn run_seeds(
    lens: &Lens,
    plan: &SearchPlan,
    race: SearchBudget,
    stop: &AtomicBool,
) -> Result<SearchRow, SearchSetupError> {
    let mut gradients = 0;
    let mut found: Vec<Vec<f64>> = vec![Vec::new(); MARKS.len()];
    for seed in (1..=race.seeds).take_while(|_| !stop.load(Ordering::Relaxed)) {
        let mut plan = plan.clone();
        plan.settings.seed = seed;
        gradients += run_seed(lens, &plan, race.seconds, stop, &mut found)?;
    }
    let mark = |(part, merits): (f64, &mut Vec<f64>)| {
        merits.sort_by(f64::total_cmp);
        let at = |i: usize| merits.get(i).copied().unwrap_or(f64::INFINITY);
        MeritQuantiles {
            seconds: part * race.seconds,
            best: at(0),
            median: at(merits.len() / 2),
            worst: at(merits.len().saturating_sub(1)),
        }
    };
    let reached = MARKS.into_iter().zip(&mut found).filter(|(_, merits)| !merits.is_empty());
    let marks = reached.map(mark).collect();
    let (method, tolerance) = (plan.settings.method, plan.local.tolerance);
    Ok(SearchRow { method, tolerance, gradients, marks })
}

/// Runs one search; adds the merit of its best lens at every mark, and returns the number of its
/// gradients.
fn run_seed(
    lens: &Lens,
    plan: &SearchPlan,
    seconds: f64,
    stop: &AtomicBool,
    found: &mut [Vec<f64>],
) -> Result<u64, SearchSetupError> {
    let (landscape, mut run) = plan.begin(lens)?;
    let watch = Stopwatch::start();
    let mut best = Vec::new();
    let end = run.advance(&landscape, |run, _| {
        let passed =
            MARKS[best.len()..].iter().take_while(|mark| watch.seconds() >= *mark * seconds);
        for _ in 0..passed.count() {
            best.push(run.best().point.clone());
        }
        if best.len() < MARKS.len() && !stop.load(Ordering::Relaxed) {
            ControlFlow::Continue(())
        } else {
            ControlFlow::Break(())
        }
    });
    // A run that has ended stays as it is until the last mark.
    if end.is_continue() {
        best.resize(MARKS.len(), run.best().point.clone());
    }
    for (merits, lens) in found.iter_mut().zip(&best) {
        merits.push(merit_of(&landscape, lens).unwrap_or(f64::INFINITY));
    }
    Ok(run.statistics().gradients)
}
