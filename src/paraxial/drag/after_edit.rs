//! Holding what is locked after an edit that is no drag: the lens that the edit has made gets the locked
//! quantities of the one before by the least change of its own numbers.

use super::hold::HeldLens;
use super::{DragError, DragSettings, DragStop, MovedNumber};
use crate::lens::{Edit, Lens, apply_edit};
use std::fmt;

/// A lens that has the locked quantities of another one.
#[derive(Debug, Clone, PartialEq)]
pub struct HeldEdit {
    /// The lens.
    pub lens: Lens,
    /// The numbers that have changed for that, those that changed most first.
    pub moved: Vec<MovedNumber>,
}

/// The reason why a lens cannot have the locked quantities of another one.
#[derive(Debug, Clone, PartialEq)]
pub enum HoldError {
    /// One of the lenses has no such quantity.
    Lock(DragError),
    /// The free numbers cannot give it.
    Stop(DragStop),
}

impl fmt::Display for HoldError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Lock(error) => write!(f, "{error}"),
            Self::Stop(stop) => write!(f, "{stop}"),
        }
    }
}

impl std::error::Error for HoldError {}

/// The lens that an edit has made of another one, with the locked quantities that it had before. Both have the
/// same zoom positions.
///
/// # Errors
/// A locked quantity that one of them does not have, or that no lens nearby has.
pub fn hold_after_edit(
    before: &Lens,
    after: &Lens,
    settings: &DragSettings,
) -> Result<HeldEdit, HoldError> {
    let held = HeldLens::like(before, after, settings).map_err(HoldError::Lock)?;
    let at = held.solve(0.0, &held.origin()).map_err(HoldError::Stop)?;
    let mut lens = after.clone();
    held.write(&mut lens, &at);
    let lens = apply_edit(after, &Edit::Replace(Box::new(lens)));
    let lens = lens.map_err(|why| HoldError::Stop(DragStop::Lens(why)))?;
    Ok(HeldEdit { moved: held.moved(&lens, &at), lens })
}
