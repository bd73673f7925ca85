//! Violated constraints: noted for the start before a search, and reported for the best lens after it.

use crate::cli::output::{ShortNumber, TextTable, or_dash, print_note};
use crate::merit::ConstraintMargin;
use crate::search::lens_landscape::describe_violation;
use serde::Serialize;
use std::fmt;

/// The number of violations that are noted one by one before a search.
const MAX_NOTES: usize = 6;

/// A violated constraint.
#[derive(Serialize)]
pub(super) struct ViolatedLimit {
    #[serde(flatten)]
    limit: ConstraintMargin,
    off_by: f64,
}

impl ViolatedLimit {
    pub(super) fn all(limits: Vec<ConstraintMargin>) -> Vec<Self> {
        limits.into_iter().map(|limit| Self { off_by: -limit.slack(), limit }).collect()
    }
}

/// Notes the constraints that the start violates.
pub(super) fn warn(broken: &[ConstraintMargin]) {
    for limit in broken.iter().take(MAX_NOTES) {
        print_note(format!("note: the start violates a constraint: {}", describe_violation(limit)));
    }
    if broken.len() > MAX_NOTES {
        print_note(format!("note: and {} more", broken.len() - MAX_NOTES));
    }
}

/// Writes the constraints that the best lens violates.
pub(super) fn write(broken: &[ViolatedLimit], f: &mut fmt::Formatter<'_>) -> fmt::Result {
    if broken.is_empty() {
        return writeln!(f, "the best lens satisfies all constraints\n");
    }
    writeln!(f, "the best lens violates constraints, which only --finish enforces:")?;
    let mut table =
        TextTable::new(&["constraint", "place", "zoom", "value", "min", "max", "off by"]);
    for ViolatedLimit { limit, off_by } in broken {
        table.row(cells(limit).into_iter().chain([format!("{off_by:.1e}")]));
    }
    writeln!(f, "{table}")
}

/// The cells of a constraint, up to its bounds.
pub(super) fn cells(limit: &ConstraintMargin) -> [String; 6] {
    let place = limit.place().unwrap_or_else(|| "-".to_owned());
    let [min, max] = [limit.min, limit.max].map(or_dash);
    let value = ShortNumber(limit.value).to_string();
    [limit.term.to_owned(), place, limit.zoom.to_string(), value, min, max]
}
