//! The number of different minima that descents from random lenses of one structure find in a time.
//!
//! A descent counts limits as penalties until it gains little, and keeps them as constraints from there on: a
//! minimum often lies where a limit turns sharply, which penalties approach without an end. It ends at a
//! minimum when the optimizer says so (the gradient has vanished, or nothing can be gained at the tolerance of
//! the spots, and every limit is kept to 1e-9 of its unit) and another descent from there, with rays found anew,
//! says so too and gains less than the distance below which two minima are the same.
//!
//! Two minima are the same if the signs of their curvatures and powers are, and if they are near in the
//! metric of the residuals: `d² = dxᵀ Jᵀ J dx / F` predicts the relative change of the merit between
//! them. Near a distance of 1 the merit between them decides: a hill above both means two.

use super::timing::Stopwatch;
use crate::lens::Lens;
use crate::merit::MeritError;
use crate::optimize::{
    DescentMethod, DescentState, OptimizationEnd, OptimizationProgress, Optimizer, start_from,
};
use crate::search::lens_landscape::{
    DescentSettings, LensLandscape, MinimumPlace, SAME_MINIMUM, SearchPlan, SearchSetupError,
    curvature_signs, gains_little,
};
use crate::search::{Landscape as _, Random};
use nalgebra::DVector;
use rand::SeedableRng as _;
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The evaluations after which a descent that has not ended is given up.
const MOST_EVALUATIONS: usize = 1000;
/// The starts between two looks at the flag.
const BATCH: u64 = 32;
/// The parts of the way from the lens to random numbers that are tried: of many surfaces few random ones
/// form an image.
const SPREADS: [f64; 4] = [1.0, 0.5, 0.25, 0.125];

/// The minima that descents from random lenses have found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MinimaCount {
    /// The random lenses.
    pub starts: u64,
    /// The descents that lost the light, or whose lens became invalid.
    pub lost: u64,
    /// The descents that were given up.
    pub unfinished: u64,
    /// The descents that came to a halt where the derivatives promise more, or where limits are broken.
    pub stuck: u64,
    /// The descents that ended at a minimum.
    pub ended: u64,
    /// The different minima among these.
    pub distinct: usize,
    /// The signs of curvatures and powers among them.
    pub families: usize,
    /// The minima that were found once, and those found twice.
    pub found_once: usize,
    /// The minima that were found twice.
    pub found_twice: usize,
    /// The estimated number of minima that were not found: `n₁²/2n₂` (Chao, Scand. J. Stat. 11, 1984);
    /// `None` if none was found twice.
    pub unseen: Option<f64>,
    /// The evaluations of the merit with its derivatives, all descents together.
    pub evaluations: usize,
    /// The seconds that it took.
    pub seconds: f64,
    /// The different minima in an hour at this rate.
    pub distinct_an_hour: f64,
    /// The merits of the best minima in mm².
    pub best: Vec<f64>,
}

/// The number of the best merits that are told.
const TOLD: usize = 10;

/// A minimum and how often it was found.
#[derive(Debug)]
struct Minimum {
    values: DVector<f64>,
    merit: f64,
    found: usize,
}

/// The end of a descent.
enum DescentEnd {
    Lost,
    Unfinished,
    Stuck,
    Minimum(Box<EndedDescent>),
}

/// A lens at a minimum, with the signs of its curvatures and powers.
struct EndedDescent {
    signs: String,
    place: MinimumPlace,
}

/// Counts the minima that descents from random lenses with the structure of a lens find. The same seed gives the same minima on any number of threads. Once
/// `stop` is true, those of the descents so far are returned.
///
/// # Errors
/// A lens that a search cannot start from.
pub fn count_minima(
    lens: &Lens,
    plan: &SearchPlan,
    starts: u64,
    stop: &AtomicBool,
) -> Result<MinimaCount, SearchSetupError> {
    let local = DescentSettings { method: DescentMethod::TrustRegion, ..plan.local.clone() };
    let plan = &SearchPlan { local, ..plan.clone() };
    let landscape = plan.landscape(lens)?;
    let watch = Stopwatch::start();
    let mut families: BTreeMap<String, Vec<Minimum>> = BTreeMap::new();
    let (mut begun, mut lost, mut unfinished, mut stuck) = (0, 0, 0, 0);
    let (mut ended, mut evaluations) = (0, 0);
    while begun < starts && !stop.load(Ordering::Relaxed) {
        let batch = begun..(begun + BATCH).min(starts);
        begun = batch.end;
        let descend = |start| descend(&landscape, plan.settings.seed, start);
        let ends: Vec<(DescentEnd, usize)> = batch.into_par_iter().map(descend).collect();
        for (end, used) in ends {
            evaluations += used;
            match end {
                DescentEnd::Lost => lost += 1,
                DescentEnd::Unfinished => unfinished += 1,
                DescentEnd::Stuck => stuck += 1,
                DescentEnd::Minimum(found) => {
                    ended += 1;
                    enter(families.entry(found.signs).or_default(), &found.place);
                }
            }
        }
    }
    let seconds = watch.seconds();
    let all: Vec<&Minimum> = families.values().flatten().collect();
    let times = |count| all.iter().filter(|minimum| minimum.found == count).count();
    let [found_once, found_twice] = [times(1), times(2)];
    let mut best: Vec<f64> = all.iter().map(|minimum| minimum.merit).collect();
    best.sort_by(f64::total_cmp);
    best.truncate(TOLD);
    Ok(MinimaCount {
        starts: begun,
        lost,
        unfinished,
        stuck,
        ended,
        distinct: all.len(),
        families: families.len(),
        found_once,
        found_twice,
        unseen: (found_twice > 0)
            .then(|| (found_once * found_once) as f64 / (2 * found_twice) as f64),
        evaluations,
        seconds,
        distinct_an_hour: 3600.0 * all.len() as f64 / seconds,
        best,
    })
}

/// A descent from a random lens, with the number of its evaluations.
fn descend(landscape: &LensLandscape, seed: u64, start: u64) -> (DescentEnd, usize) {
    // Each start has random numbers of its own, whatever thread it is on.
    let mut random = Random::seed_from_u64(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ start);
    let drawn = SPREADS.iter().find_map(|spread| landscape.draw_near(*spread, &mut random));
    let Some(drawn) = drawn else { return (DescentEnd::Lost, 0) };
    let (lens, used) = approach(landscape, drawn);
    let Some(lens) = lens else { return (DescentEnd::Lost, used) };
    finish(landscape, &lens, used)
}

/// A descent within the limits, again and again with rays found anew until one gains little; with the number
/// of evaluations in all.
fn finish(landscape: &LensLandscape, lens: &Lens, mut used: usize) -> (DescentEnd, usize) {
    let tolerance = landscape.tolerance();
    let (mut at, mut before) = (lens.clone(), f64::INFINITY);
    loop {
        let optimizer = landscape.constrained_merit(&at).and_then(|merit| {
            let free = landscape.with_variables(&at);
            start_from(DescentMethod::TrustRegion, merit, &free, tolerance)
        });
        let Ok(optimizer) = optimizer else { return (DescentEnd::Lost, used) };
        let (mut halted, last) = run(optimizer, MOST_EVALUATIONS.saturating_sub(used));
        used += last.evaluations;
        let Some(end) = last.end else { return (DescentEnd::Unfinished, used) };
        let gains_nothing = last.best >= (1.0 - SAME_MINIMUM) * before;
        if gains_nothing && end.is_minimum() {
            let found = EndedDescent::new(landscape, &halted, tolerance);
            let end = found.map_or(DescentEnd::Lost, |found| DescentEnd::Minimum(Box::new(found)));
            return (end, used);
        }
        if gains_nothing || end == OptimizationEnd::Conflict {
            return (DescentEnd::Stuck, used);
        }
        halted.variables.clone_from(&lens.variables);
        (at, before) = (halted, last.best);
    }
}

/// A lens after moves by penalties until one gains little, `None` if it has lost the light; and their
/// gradients.
fn approach(landscape: &LensLandscape, start: Arc<Lens>) -> (Option<Arc<Lens>>, usize) {
    let mut memory = DescentState::with_penalties();
    let (mut lens, mut used, mut before) = (start, 0, f64::INFINITY);
    while used < MOST_EVALUATIONS {
        let (next, loss, gradients) = landscape.descend(&lens, &mut memory);
        (lens, used) = (next, used + gradients.max(1));
        if !loss.is_finite() {
            return (None, used);
        }
        if gains_little(before, loss) {
            break;
        }
        before = loss;
    }
    (Some(lens), used)
}

/// The lens where an optimizer ends or has made so many evaluations, and its last step.
fn run(mut optimizer: Box<dyn Optimizer>, most: usize) -> (Lens, OptimizationProgress) {
    loop {
        let progress = optimizer.step();
        if progress.finished || progress.evaluations >= most {
            return (optimizer.best().clone(), progress);
        }
    }
}

impl EndedDescent {
    fn new(landscape: &LensLandscape, lens: &Lens, tolerance: f64) -> Result<Self, MeritError> {
        let lens = landscape.with_variables(lens);
        let signs = curvature_signs(&lens, landscape.focal_length());
        Ok(Self { signs, place: MinimumPlace::new(landscape, &lens, tolerance)? })
    }
}

/// Enters a minimum among those with the same signs; of two that are the same the better one is kept.
fn enter(family: &mut Vec<Minimum>, found: &MinimumPlace) {
    match family.iter_mut().find(|known| found.is_same(&known.values, known.merit)) {
        Some(known) => {
            known.found += 1;
            if found.value < known.merit {
                known.merit = found.value;
                known.values.clone_from(&found.values);
            }
        }
        None => family.push(Minimum { values: found.values.clone(), merit: found.value, found: 1 }),
    }
}
