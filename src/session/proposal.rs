//! The merit function that is proposed for a design without one of its own.
//!
//! Its targets are those of the lens as it was opened, or as it was asked for, so that an edit of a
//! number does not move them; its terms follow the structure.

use crate::lens::{Lens, Medium, StartingForm, StartingLens};
use crate::merit::{Goal, Term};
use crate::paraxial::{Beam, first_order};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The merit function that is proposed for a version of the design.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MeritProposal {
    /// The merit function; `None` if none can be proposed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub goal: Option<Arc<Goal>>,
    /// The focal length that is asked for, in mm; `None` for an afocal lens.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub focal_length: Option<f64>,
    /// The system that a lens which began without glass is for, until it has a focus to which an
    /// f-number can refer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub asked: Option<StartingLens>,
}

impl MeritProposal {
    /// The proposal for a lens that was opened or scaled: it is to keep its focal length.
    pub(super) fn of(lens: &Lens) -> Arc<Self> {
        Arc::new(Self::with_focal_length(lens, None))
    }

    /// The proposal for a lens that was begun.
    pub(super) fn of_new(lens: &Lens, starting: &StartingLens) -> Arc<Self> {
        let proposal = Self::with_focal_length(lens, Some(starting.focal_length));
        let asked = (starting.form == StartingForm::Empty).then(|| starting.clone());
        Arc::new(Self { asked, ..proposal })
    }

    fn with_focal_length(lens: &Lens, focal_length: Option<f64>) -> Self {
        let goal = Goal::default_at(lens, focal_length).ok().map(Arc::new);
        let terms = goal.iter().flat_map(|goal| &goal.terms);
        let target = terms.into_iter().find_map(|weighted| match weighted.term {
            Term::FocalLength(target) => Some(target),
            _ => None,
        });
        Self { goal, focal_length: focal_length.or(target), asked: None }
    }

    /// The proposal for the lens after an edit: of another structure it is a new one with the same
    /// focal length, which is that of the first zoom position.
    pub(super) fn followed(self: &Arc<Self>, before: &Lens, after: &Lens) -> Arc<Self> {
        if has_structure_of(before, after) {
            return Arc::clone(self);
        }
        let asked = self.asked.clone();
        let change = first_position_change(before, after);
        let focal_length = self.focal_length.map(|asked| change * asked);
        Arc::new(Self { asked, ..Self::with_focal_length(after, focal_length) })
    }

    /// The proposal for a lens that has what was asked for.
    pub(super) fn fulfilled(&self) -> Self {
        Self { asked: None, ..self.clone() }
    }
}

/// The focal length of the first zoom position after zoom positions were added or removed, relative to
/// that before; 1 where both are the same position, or one of them is afocal.
fn first_position_change(before: &Lens, after: &Lens) -> f64 {
    if before.zoom.len() == after.zoom.len() || before.zoom.first() == after.zoom.first() {
        return 1.0;
    }
    let focal_length = |lens: &Lens| {
        let um = lens.wavelengths.get(lens.primary())?.um;
        first_order(&lens.resolve(0, um).ok()?, &Beam::for_lens(lens, 0)).ok()?.efl
    };
    let change = focal_length(before).zip(focal_length(after)).map(|(old, new)| new / old);
    change.filter(|change| change.is_finite() && *change != 0.0).unwrap_or(1.0)
}

/// True if two lenses have as many surfaces and zoom positions, and glass, air and mirrors at the same
/// places.
fn has_structure_of(one: &Lens, other: &Lens) -> bool {
    let kind = |medium: &Medium| match medium {
        Medium::Air => 0,
        Medium::Mirror => 1,
        _ => 2,
    };
    let kinds =
        |lens: &Lens| -> Vec<u8> { lens.surfaces.iter().map(|row| kind(&row.medium)).collect() };
    one.zoom.len() == other.zoom.len() && kinds(one) == kinds(other)
}
