//! The merit of the design, evaluated in the background after every change: its terms with their
//! errors, and the limits with their margins.

use super::clock::{Timed, time};
use super::run::{LatestRequestWorker, catch_panic};
use crate::lens::{Lens, SurfaceNumber};
use crate::merit::{
    ConstraintMargin, Goal, Merit, MeritError, Term, TermValue, constraint_margins,
};
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

    fn evaluate(request: &MeritRequest) -> Result<Self, MeritError> {
        let MeritRequest { lens, design, goal, tolerance } = request;
        let mut merit = Merit::new(lens, goal, *tolerance)?;
        let compares = |term| matches!(term, Term::Light(_) | Term::MeanLight(_));
        let about_light = goal.terms.iter().any(|asked| compares(asked.term));
        if about_light && !Arc::ptr_eq(lens, design) {
            let own = Merit::new(design, goal, *tolerance)?;
            let counts = |merit: &Merit| -> Vec<usize> {
                merit.initial_light().iter().map(Vec::len).collect()
            };
            // Lenses with other fields have no light to compare.
            if counts(&own) == counts(&merit) {
                merit = merit.with_initial_light(own.initial_light());
            }
        }
        let terms = merit.terms(&merit.values(lens))?;
        Self::new(lens, &merit, terms)
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

/// A lens to evaluate.
#[derive(Debug)]
pub(super) struct MeritRequest {
    pub(super) lens: Arc<Lens>,
    /// The design, with whose light it is compared.
    pub(super) design: Arc<Lens>,
    pub(super) goal: Arc<Goal>,
    /// The relative error allowed of the spots.
    pub(super) tolerance: f64,
}

/// Evaluates the merit of the design or of a candidate, the newest version only.
#[derive(Debug)]
pub(super) struct LiveMerit {
    worker: LatestRequestWorker<MeritRequest, MeritReport>,
}

impl LiveMerit {
    pub(super) fn spawn(wake: impl Fn() + Send + 'static) -> io::Result<Self> {
        let worker = LatestRequestWorker::spawn("merit", wake, |request: MeritRequest, output| {
            let text = |why: MeritError| merit_error_text(&why, &request.lens);
            let values = || MeritValues::evaluate(&request).map_err(text);
            let Timed { value: values, ms } = time(|| catch_panic(values));
            let MeritRequest { lens, goal, .. } = request;
            output.publish(MeritReport { lens, goal, values, ms });
        })?;
        Ok(Self { worker })
    }

    /// Requests the merit of another version.
    pub(super) fn request(&self, request: MeritRequest) {
        self.worker.request(request);
    }

    /// The newest merit, maybe of an earlier version.
    pub(super) fn latest(&self) -> Option<Arc<MeritReport>> {
        self.worker.latest()
    }
}

/// The reason why a lens has no merit, with fields and zoom positions counted from 1 as the window does;
/// the position only where there are several.
pub(super) fn merit_error_text(why: &MeritError, lens: &Lens) -> String {
    let place = |field: usize, zoom: usize| {
        let field = format!("field {}", field + 1);
        if lens.zoom.len() > 1 { format!("{field}, zoom position {}", zoom + 1) } else { field }
    };
    match why {
        MeritError::Launch { field, zoom, cause } => format!("{}: {cause}", place(*field, *zoom)),
        MeritError::NoLight { field, zoom, um } => {
            format!("{}: no light gets through at {um} µm", place(*field, *zoom))
        }
        MeritError::RayLost { ray, field, zoom, um, fate } => format!(
            "{}: ray {} at {um} µm is lost: {} at surface {}",
            place(*field, *zoom),
            ray + 1,
            fate.name(),
            SurfaceNumber::new(fate.surface().unwrap_or(0))
        ),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{ZoomPosition, blank};
    use crate::pupil::LaunchError;

    #[test]
    fn fields_and_zoom_positions_count_from_one() {
        let why = MeritError::Launch { field: 2, zoom: 1, cause: LaunchError::NotAimed };
        let mut lens = blank();
        let text = "field 3: no ray of this field was found that crosses the centre of the stop";
        assert_eq!(merit_error_text(&why, &lens), text);
        lens.zoom = vec![ZoomPosition::default(); 2];
        assert!(merit_error_text(&why, &lens).starts_with("field 3, zoom position 2: "));
        let dark = MeritError::NoLight { field: 0, zoom: 0, um: 0.5 };
        assert!(merit_error_text(&dark, &lens).starts_with("field 1, zoom position 1: no light"));
    }
}
