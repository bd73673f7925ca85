//! The merit reached by a structure search over time or over gradients, for all samplers; over time
//! also for several tolerances of the spots.
//!
//! Every lens compared is evaluated anew with the same fine sampling, so that a search with a
//! coarse one does not look better than it is.

use super::timing::Stopwatch;
use crate::lens::Lens;
use crate::merit::MeritError;
use crate::search::lens_landscape::{LensLandscape, SearchPlan, SearchSetupError};
use crate::search::{MutationKind, SearchMethod, SearchRunOn};
use serde::Serialize;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};

/// The fractions of the time or of the gradients after which the merit is recorded.
const MARKS: [f64; 4] = [0.125, 0.25, 0.5, 1.0];
/// The tolerances compared.
const TOLERANCES: [f64; 4] = [1e-1, 1e-2, 1e-3, 1e-4];
/// The tolerance with which lenses are compared.
const EVALUATION_TOLERANCE: f64 = 1e-4;

/// The length of each search of a benchmark.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SearchLength {
    /// A time in seconds.
    Seconds(f64),
    /// A number of gradients.
    Gradients(u64),
}

/// The length and the number of the runs of a benchmark.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SearchBudget {
    /// The length of each search.
    #[serde(flatten)]
    pub length: SearchLength,
    /// The number of seeds.
    pub seeds: u64,
    /// The first seed.
    pub first_seed: u64,
}

/// A search that is compared with others.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SearchContender {
    /// Basin hopping (Wales, Doye, J. Phys. Chem. A 101, 5111, 1997) that accepts improvements alone: all
    /// variables are displaced at random, and a descent follows. The structure stays.
    BasinHopping,
    /// An iterated local search with one mutant at a time, which does not race, and no displacements.
    SingleTrial,
    /// A descent from the start without mutations, the same for every seed.
    Descent,
    /// A search by a sampler.
    #[serde(untagged)]
    Sampler(SearchMethod),
}

impl SearchContender {
    /// All contenders.
    pub const ALL: [Self; 7] = [
        Self::Sampler(SearchMethod::IteratedLocalSearch),
        Self::Descent,
        Self::BasinHopping,
        Self::SingleTrial,
        Self::Sampler(SearchMethod::BruteForce),
        Self::Sampler(SearchMethod::Metropolis),
        Self::Sampler(SearchMethod::Restore),
    ];

    /// Makes the usual plan one of this contender.
    fn apply_to(self, plan: &mut SearchPlan) {
        match self {
            Self::Sampler(method) => plan.settings.method = method,
            Self::BasinHopping | Self::SingleTrial => {
                plan.settings.method = SearchMethod::IteratedLocalSearch;
                plan.settings.trials = 1;
                let is_excluded = |kind: &MutationKind| {
                    (*kind == MutationKind::Displacement) == (self == Self::SingleTrial)
                };
                for kind in MutationKind::PERTURBATIONS.into_iter().filter(is_excluded) {
                    plan.rules.exclude(kind);
                }
            }
            Self::Descent => plan.settings = plan.settings.without_mutations(),
        }
    }
}

/// The results of a contender at a tolerance.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SearchRow {
    /// The search.
    pub method: SearchContender,
    /// The relative tolerance of the spot radii.
    pub tolerance: f64,
    /// The number of gradients, all seeds together.
    pub gradients: u64,
    /// The merit after fractions of the time or of the gradients.
    pub marks: Vec<MeritQuantiles>,
    /// The merit at the end for each seed.
    pub ends: Vec<f64>,
    /// The comparison of the first contender with this one; `None` for the first one itself.
    pub against: Option<SignTest>,
}

/// The paired comparison of two contenders, seed by seed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SignTest {
    /// The number of seeds with which the first contender ends below the other one.
    pub below: usize,
    /// The number of seeds with which they do not end alike.
    pub seeds: usize,
    /// The probability of at least so many if both were as good: the sign test, one-sided.
    pub probability: f64,
}

impl SignTest {
    /// The test for pairs of merits, the smaller one being better.
    pub fn new(first: &[f64], other: &[f64]) -> Self {
        let pairs = || first.iter().zip(other);
        let below = pairs().filter(|(a, b)| a < b).count();
        let seeds = pairs().filter(|(a, b)| a != b).count();
        let choose = |k: usize| (0..k).fold(1.0, |c, i| c * (seeds - i) as f64 / (i + 1) as f64);
        let tail: f64 = (below..=seeds).map(choose).sum();
        Self { below, seeds, probability: tail / 2f64.powi(seeds as i32) }
    }
}

/// The merit of the best lens after some time or some gradients: best, median and worst of all seeds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MeritQuantiles {
    /// The seconds or the gradients since the start.
    pub after: f64,
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
    /// The length and the number of seeds.
    pub race: SearchBudget,
    /// The merit of the starting lens.
    pub start: f64,
    /// The contenders at the tolerance asked for.
    pub methods: Vec<SearchRow>,
    /// RESTORE at other tolerances, whose effect is one of time: empty for equal gradients.
    pub tolerances: Vec<SearchRow>,
}

/// Runs a search from a lens with each contender, the others being compared with the first one, and over
/// equal times at every tolerance. Once `stop` is true, the runs so far are returned.
///
/// # Errors
/// A lens that a search cannot start from.
pub fn compare_searches(
    lens: &Lens,
    plan: &SearchPlan,
    contenders: &[SearchContender],
    race: SearchBudget,
    stop: &AtomicBool,
) -> Result<SearchBenchmark, SearchSetupError> {
    let landscape = plan.landscape(lens)?;
    let row = |method: SearchContender, tolerance, gradients| {
        let mut plan = plan.clone();
        (plan.local.tolerance, plan.local.coarse) = (tolerance, tolerance);
        (plan.settings.gradients, plan.settings.moves) = (gradients, None);
        method.apply_to(&mut plan);
        run_seeds(lens, &plan, method, race, stop)
    };
    let usual = plan.local.tolerance;
    let mut methods: Vec<SearchRow> = Vec::new();
    for method in contenders.iter().copied() {
        if stop.load(Ordering::Relaxed) {
            break;
        }
        // Brute force divides the number of gradients that the first contender computed in the time.
        let share = methods.first().map(|first| (first.gradients / race.seeds.max(1)).max(1));
        let is_divided = method == SearchContender::Sampler(SearchMethod::BruteForce);
        let gradients = match race.length {
            SearchLength::Gradients(gradients) => Some(gradients),
            SearchLength::Seconds(_) => share.filter(|_| is_divided),
        };
        let mut found = row(method, usual, gradients)?;
        found.against = methods.first().map(|first| SignTest::new(&first.ends, &found.ends));
        methods.push(found);
    }
    let mut tolerances = Vec::new();
    let is_timed = matches!(race.length, SearchLength::Seconds(_));
    for tolerance in TOLERANCES.into_iter().filter(|_| is_timed) {
        if !stop.load(Ordering::Relaxed) {
            let restore = SearchContender::Sampler(SearchMethod::Restore);
            tolerances.push(row(restore, tolerance, None)?);
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
    method: SearchContender,
    race: SearchBudget,
    stop: &AtomicBool,
) -> Result<SearchRow, SearchSetupError> {
    let mut gradients = 0;
    let mut found: Vec<Vec<f64>> = vec![Vec::new(); MARKS.len()];
    let seeds = race.first_seed..race.first_seed.saturating_add(race.seeds);
    for seed in seeds.take_while(|_| !stop.load(Ordering::Relaxed)) {
        let mut plan = plan.clone();
        plan.settings.seed = seed;
        if method == SearchContender::Descent && seed > race.first_seed {
            found.iter_mut().for_each(|merits| merits.extend(merits.last().copied()));
        } else {
            gradients += run_seed(lens, &plan, race.length, stop, &mut found)?;
        }
    }
    let ends = found.last().cloned().unwrap_or_default();
    let mark = |(part, merits): (f64, &mut Vec<f64>)| {
        merits.sort_by(f64::total_cmp);
        let at = |i: usize| merits.get(i).copied().unwrap_or(f64::INFINITY);
        MeritQuantiles {
            after: part * race.length.value(),
            best: at(0),
            median: at(merits.len() / 2),
            worst: at(merits.len().saturating_sub(1)),
        }
    };
    let reached = MARKS.into_iter().zip(&mut found).filter(|(_, merits)| !merits.is_empty());
    let marks = reached.map(mark).collect();
    let tolerance = plan.local.tolerance;
    Ok(SearchRow { method, tolerance, gradients, marks, ends, against: None })
}

impl SearchLength {
    /// The seconds or the gradients.
    pub fn value(self) -> f64 {
        match self {
            Self::Seconds(seconds) => seconds,
            Self::Gradients(gradients) => gradients as f64,
        }
    }

    /// The seconds or the gradients of a run so far.
    fn passed(self, watch: Stopwatch, run: &SearchRunOn<LensLandscape>) -> f64 {
        match self {
            Self::Seconds(_) => watch.seconds(),
            Self::Gradients(_) => all_gradients(run) as f64,
        }
    }
}

/// Runs one search; adds the merit of its best lens at every mark, and returns the number of its
/// gradients.
fn run_seed(
    lens: &Lens,
    plan: &SearchPlan,
    length: SearchLength,
    stop: &AtomicBool,
    found: &mut [Vec<f64>],
) -> Result<u64, SearchSetupError> {
    let (landscape, mut run) = plan.begin(lens)?;
    let watch = Stopwatch::start();
    let mut best = Vec::new();
    let end = run.advance(&landscape, |run, _| {
        let passed = MARKS[best.len()..]
            .iter()
            .take_while(|mark| length.passed(watch, run) >= *mark * length.value());
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
    Ok(all_gradients(&run))
}

/// The gradients of a run, those that moved its retained lenses to where the limits hold included.
fn all_gradients(run: &SearchRunOn<LensLandscape>) -> u64 {
    run.statistics().gradients + run.statistics().gradients_beside
}
