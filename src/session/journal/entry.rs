//! The lines of a journal: JSON behind a checksum.

use crate::lens::Lens;
use crate::paraxial::DragSettings;
use crate::session::history::HistoryNode;
use crate::session::run::RunKind;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::sync::Arc;

/// The version of the format.
pub(super) const VERSION: u32 = 1;
/// The number of digits of a checksum.
const DIGITS: usize = 8;

/// An event in the life of a design.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(in crate::session) enum JournalEntry {
    /// The first line: the format, and the file of the design.
    Begin {
        version: u32,
        path: Option<PathBuf>,
        /// The version of the design that is in its file.
        saved: Option<u64>,
    },
    /// A new version, or another state of the one with its number.
    Node(Arc<HistoryNode>),
    /// Another version is the present one.
    Present(u64),
    /// The merit of a version.
    Merit { node: u64, merit: f64 },
    /// The name of a version; empty for none.
    Name { node: u64, name: String },
    /// A version was written to the file of the design.
    Saved { node: u64, path: PathBuf },
    /// A running computation has found lenses.
    Run(RunRecord),
    /// The quantities that drags hold have changed.
    Locks(DragSettings),
    /// The lenses of the run of a kind are accepted, discarded or dismissed.
    RunEnded(RunKind),
    /// The design was closed: there is nothing to recover.
    Closed,
}

/// Lenses that a running computation has found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::session) struct RunRecord {
    /// The kind of the run.
    pub(in crate::session) kind: RunKind,
    /// The version from which it started.
    pub(in crate::session) node: u64,
    /// The best lens so far with a title, or every lens of a front that is new.
    pub(in crate::session) lenses: Vec<(String, Option<f64>, Arc<Lens>)>,
}

impl RunRecord {
    /// True if every lens that was found counts, and not only the newest.
    pub(super) fn keeps_all(&self) -> bool {
        self.kind == RunKind::Pareto
    }
}

impl JournalEntry {
    /// The line of the entry; `None` if it cannot be written.
    pub(super) fn line(&self) -> Option<Vec<u8>> {
        let json = serde_json::to_string(self).ok()?;
        let checksum = crc32fast::hash(json.as_bytes());
        Some(format!("{checksum:0DIGITS$x} {json}\n").into_bytes())
    }

    /// The entry of a line without its end; `None` for a damaged one.
    pub(super) fn from_line(line: &[u8]) -> Option<Self> {
        let (checksum, json) = line.split_at_checked(DIGITS)?;
        let json = json.strip_prefix(b" ")?;
        let checksum = u32::from_str_radix(std::str::from_utf8(checksum).ok()?, 16).ok()?;
        (crc32fast::hash(json) == checksum).then(|| serde_json::from_slice(json).ok())?
    }
}
