//! The merit of the design, evaluated in the background after every change: its terms with their
//! errors, and the limits with their margins.

use super::clock::{Timed, time};
use super::run::{LatestRequestWorker, catch_panic};
use crate::lens::Lens;
use crate::merit::{ConstraintMargin, Goal, Merit, MeritError, TermValue, constraint_margins};
use std::io;
use std::sync::Arc;

/// The merit of a lens.
#[derive(Debug, Clone)]
pub struct MeritReport {
    /// The lens.
    pub lens: Arc<Lens>,
    /// The merit function.
    pub goal: Arc<Goal>,
    /// Its values, or the reason why it has none.
    pub values: Result<MeritValues, String>,
    /// The time that they took, in milliseconds.
    pub ms: f64,
}

/// The values of a merit function.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MeritValues {
    /// The weighted sum of all terms.
    pub total: f64,
    /// The terms, in the order of the merit function.
    pub terms: Vec<TermValue>,
    /// Every quantity that a term limits, with its bounds.
    pub limits: Vec<ConstraintMargin>,
}

impl MeritValues {
    /// The part of a term in the sum of the magnitudes of all terms, 0 to 1; `None` if all are zero.
    pub fn share(&self, term: usize) -> Option<f64> {
        let size = |term: &TermValue| (term.weight * term.value).abs();
        let sum: f64 = self.terms.iter().map(size).sum();
        let share = size(self.terms.get(term)?) / sum;
        share.is_finite().then_some(share)
    }

    fn evaluate(lens: &Lens, goal: &Goal, tolerance: f64) -> Result<Self, String> {
        let merit = Merit::new(lens, goal, tolerance).map_err(|why| why.to_string())?;
        let terms = merit.terms(&merit.values(lens)).map_err(|why| why.to_string())?;
        Self::new(lens, &merit, terms).map_err(|why| why.to_string())
    }

    /// The values of terms that were evaluated for a lens, with its limits.
    pub(super) fn new(
        lens: &Lens,
        merit: &Merit,
        terms: Vec<TermValue>,
    ) -> Result<Self, MeritError> {
        let values = merit.values(lens);
        let goal = merit.goal();
        let asked = goal.terms.iter().copied();
        let mut limits = constraint_margins(lens, asked)?;
        limits.extend(merit.operand_margins(&values)?);
        let total = terms.iter().map(|term| term.weight * term.value).sum();
        Ok(Self { total, terms, limits })
    }
}

/// A lens to evaluate with its merit function, and the tolerance of the spots.
type MeritRequest = (Arc<Lens>, Arc<Goal>, f64);

/// Evaluates the merit of the design, the newest version only.
#[derive(Debug)]
pub(super) struct LiveMerit {
    worker: LatestRequestWorker<MeritRequest, MeritReport>,
}

impl LiveMerit {
    pub(super) fn spawn(wake: impl Fn() + Send + 'static) -> io::Result<Self> {
        let worker = LatestRequestWorker::spawn("merit", wake, |request: MeritRequest, output| {
            let (lens, goal, tolerance) = request;
            let evaluate = || catch_panic(|| MeritValues::evaluate(&lens, &goal, tolerance));
            let Timed { value: values, ms } = time(evaluate);
            output.publish(MeritReport { lens, goal, values, ms });
        })?;
        Ok(Self { worker })
    }

    /// Requests the merit of another version.
    pub(super) fn request(&self, lens: Arc<Lens>, goal: Arc<Goal>, tolerance: f64) {
        self.worker.request((lens, goal, tolerance));
    }

    /// The newest merit, maybe of an earlier version.
    pub(super) fn latest(&self) -> Option<Arc<MeritReport>> {
        self.worker.latest()
    }
}
