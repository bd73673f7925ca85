//! Limits that a lens does not keep: said before a search for its start, and behind it for the best
//! lens.

use crate::cli::output::{Number, Table, optional, remark};
use crate::merit::Margin;
use crate::search::lens::missed;
use serde::Serialize;
use std::fmt;

/// No more of them are said one by one before a search.
const SAID: usize = 6;

/// A limit that is not kept.
#[derive(Serialize)]
pub(super) struct Broken {
    #[serde(flatten)]
    limit: Margin,
    off_by: f64,
}

impl Broken {
    pub(super) fn all(limits: Vec<Margin>) -> Vec<Self> {
        limits.into_iter().map(|limit| Self { off_by: -limit.room(), limit }).collect()
    }
}

/// Says what the start does not keep.
pub(super) fn warn(broken: &[Margin]) {
    for limit in broken.iter().take(SAID) {
        remark(format!("note: the start breaks a limit: {}", missed(limit)));
    }
    if broken.len() > SAID {
        remark(format!("note: and {} more", broken.len() - SAID));
    }
}

/// Says what the best lens does not keep.
pub(super) fn write(broken: &[Broken], f: &mut fmt::Formatter<'_>) -> fmt::Result {
    if broken.is_empty() {
        return writeln!(f, "the best lens keeps all limits\n");
    }
    writeln!(f, "the best lens breaks limits, which only --finish enforces:")?;
    let mut table =
        Table::new(&["limit", "surface or field", "zoom", "value", "min", "max", "off by"]);
    for Broken { limit, off_by } in broken {
        table.row(cells(limit).into_iter().chain([format!("{off_by:.1e}")]));
    }
    writeln!(f, "{table}")
}

/// A limit up to what it may be.
pub(super) fn cells(limit: &Margin) -> [String; 6] {
    let surface = limit.surface.map_or("-".to_owned(), |i| i.to_string());
    let [min, max] = [limit.min, limit.max].map(optional);
    let value = Number(limit.value).to_string();
    [limit.term.to_owned(), surface, limit.zoom.to_string(), value, min, max]
}
