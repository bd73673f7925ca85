//! Limits that a lens does not keep: said before a search for its start, and behind it for the best
//! lens.

use crate::cli::output::{ShortNumber, TextTable, or_dash, print_note};
use crate::merit::ConstraintMargin;
use crate::search::lens_landscape::describe_violation;
use serde::Serialize;
use std::fmt;

/// No more of them are said one by one before a search.
const MAX_NOTES: usize = 6;

/// A limit that is not kept.
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

/// Says what the start does not keep.
pub(super) fn warn(broken: &[ConstraintMargin]) {
    for limit in broken.iter().take(MAX_NOTES) {
        print_note(format!("note: the start breaks a limit: {}", describe_violation(limit)));
    }
    if broken.len() > MAX_NOTES {
        print_note(format!("note: and {} more", broken.len() - MAX_NOTES));
    }
}

/// Says what the best lens does not keep.
pub(super) fn write(broken: &[ViolatedLimit], f: &mut fmt::Formatter<'_>) -> fmt::Result {
    if broken.is_empty() {
        return writeln!(f, "the best lens keeps all limits\n");
    }
    writeln!(f, "the best lens breaks limits, which only --finish enforces:")?;
    let mut table =
        TextTable::new(&["limit", "surface or field", "zoom", "value", "min", "max", "off by"]);
    for ViolatedLimit { limit, off_by } in broken {
        table.row(cells(limit).into_iter().chain([format!("{off_by:.1e}")]));
    }
    writeln!(f, "{table}")
}

/// A limit up to what it may be.
pub(super) fn cells(limit: &ConstraintMargin) -> [String; 6] {
    let surface = limit.surface.map_or("-".to_owned(), |i| i.to_string());
    let [min, max] = [limit.min, limit.max].map(or_dash);
    let value = ShortNumber(limit.value).to_string();
    [limit.term.to_owned(), surface, limit.zoom.to_string(), value, min, max]
}
