//! The work of the local optimizers until they arrive: evaluations and time until the merit is
//! within 1 % of the best one known.
//!
//! All of them minimize the same function, the goal with its limits as penalties.

use super::limits::with_variables;
use super::timing::Stopwatch;
use crate::lens::Lens;
use crate::merit::{Goal, LimitTreatment, MeritError, TermValue};
use crate::optimize::{DescentMethod, OptimizationEnd, start};
use serde::Serialize;
use std::sync::atomic::{AtomicBool, Ordering};

/// The merit relative to the best one known at which a descent has arrived.
const ARRIVED: f64 = 1.01;

/// The lowest merits that any method has found for bundled lenses with their default goals.
const BEST_KNOWN: [(&str, f64); 11] = [
    ("achromat_ac254_100", 5.3026e-6),
    ("cooke_triplet_100_f27", 1.6644e-3),
    ("double_gauss_canon_ef50_f18", 1.717e-4),
    ("double_gauss_nikkor_s_50", 2.2525e-4),
    ("double_gauss_rudolph_50", 4.710e-4),
    ("heliar_100_f45", 2.990e-4),
    ("macro_micro_nikkor_105_f28", 9.3681e-3),
    ("petzval_kodak_100_f22", 4.62e-4),
    ("telephoto_nikkor_135_f28", 4.8617e-5),
    ("tessar_50_f28", 2.4886e-4),
    ("wide_nikkor_28_f35", 2.6595e-5),
];

/// The descents of all methods from one lens.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ArrivalComparison {
    /// The number of variables.
    pub variables: usize,
    /// The merit at the start.
    pub merit_before: f64,
    /// The lowest merit known, those of these descents among them.
    pub best_known: f64,
    /// One row per method.
    pub rows: Vec<ArrivalRow>,
}

/// The descent of one method.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ArrivalRow {
    /// The method.
    pub method: DescentMethod,
    /// The merit at the end, with the rays of the lens itself.
    pub merit: f64,
    /// The number of evaluations until within 1 % of the best merit known; `None` if never.
    pub evaluations: Option<usize>,
    /// The time until then, in milliseconds.
    pub ms: Option<f64>,
    /// The number of all evaluations.
    pub evaluations_in_all: usize,
    /// The time of the whole descent, in milliseconds.
    pub ms_in_all: f64,
    /// The reason of the end; `None` after the last evaluation allowed.
    pub end: Option<OptimizationEnd>,
}

/// A descent with its course.
struct Course {
    row: ArrivalRow,
    /// The number of evaluations, the time in milliseconds and the best merit after every step.
    steps: Vec<(usize, f64, f64)>,
}

/// Optimizes a lens by every method, with up to this many evaluations each. A lens without a goal
/// gets the default one, a lens without variables all curvatures and thicknesses. `name` is the name
/// of the file of a bundled lens, without its ending. Once `stop` is true, the descents that have
/// ended are returned; `None` without any.
///
/// # Errors
/// A lens without a merit.
pub fn measure_arrival(
    lens: &Lens,
    name: &str,
    evaluations: usize,
    tolerance: f64,
    stop: &AtomicBool,
) -> Result<Option<ArrivalComparison>, MeritError> {
    let lens = with_variables(lens);
    let goal = Goal { limits: LimitTreatment::Penalties, ..Goal::of_lens(&lens)? };
    let known = BEST_KNOWN.iter().find(|(known, _)| *known == name).map(|(_, merit)| *merit);
    let mut courses: Vec<Course> = Vec::new();
    for method in DescentMethod::ALL {
        courses.extend(descend(method, &lens, &goal, evaluations, tolerance, stop)?);
    }
    if courses.is_empty() {
        return Ok(None);
    }
    let found = courses.iter().map(|course| course.row.merit).fold(f64::INFINITY, f64::min);
    let best_known = known.map_or(found, |known| known.min(found));
    let before = start(DescentMethod::TrustRegion, &lens, &goal, tolerance)?.terms()?;
    Ok(Some(ArrivalComparison {
        variables: lens.variables.len(),
        merit_before: total(&before),
        best_known,
        rows: courses.into_iter().map(|course| course.arrival(best_known)).collect(),
    }))
}

impl Course {
    /// The row with the first step that comes close to a merit.
    fn arrival(self, best_known: f64) -> ArrivalRow {
        let arrived = self.steps.iter().find(|(_, _, best)| *best <= ARRIVED * best_known);
        // The merit on the way is that of the rays of an earlier lens.
        let arrived = arrived.filter(|_| self.row.merit <= ARRIVED * best_known);
        ArrivalRow {
            evaluations: arrived.map(|step| step.0),
            ms: arrived.map(|step| step.1),
            ..self.row
        }
    }
}

/// A whole descent; `None` once `stop` is true.
fn descend(
    method: DescentMethod,
    lens: &Lens,
    goal: &Goal,
    evaluations: usize,
    tolerance: f64,
    stop: &AtomicBool,
) -> Result<Option<Course>, MeritError> {
    let watch = Stopwatch::start();
    let mut optimizer = start(method, lens, goal, tolerance)?;
    let (mut steps, mut end): (Vec<(usize, f64, f64)>, _) = (Vec::new(), None);
    while end.is_none() && steps.last().is_none_or(|step| step.0 < evaluations) {
        if stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        let progress = optimizer.step();
        steps.push((progress.evaluations, 1e3 * watch.seconds(), progress.best));
        end = progress.end;
    }
    optimizer.verify_best();
    let row = ArrivalRow {
        method,
        merit: total(&optimizer.terms()?),
        evaluations: None,
        ms: None,
        evaluations_in_all: steps.last().map_or(0, |step| step.0),
        ms_in_all: 1e3 * watch.seconds(),
        end,
    };
    Ok(Some(Course { row, steps }))
}

fn total(terms: &[TermValue]) -> f64 {
    terms.iter().map(|term| term.weight * term.value).sum()
}
