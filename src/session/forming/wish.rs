//! What a person asks of the gradient-index field that is open.

use super::sight::SliceSettings;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// A wish about the field that is open.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GrinCommand {
    /// Open a task or a volume from a file, in place of what is open.
    OpenFile(Option<PathBuf>),
    /// Open a task that comes with the program.
    OpenBuiltin(String),
    /// Search for the field of the task from its beginning.
    Start,
    /// Hold the search after its present step.
    Pause,
    /// Let it go on.
    Resume,
    /// End it and judge the field as it is; the best one stays.
    Stop,
    /// Write the best field: `.npz`, or `.json` with the numbers beside it in `.raw`.
    Save {
        /// The file.
        path: Option<PathBuf>,
        /// Nodes along a side, where the field is a spline in one coordinate.
        nodes: usize,
    },
    /// Close what is open.
    Close,
    /// Look at it so.
    SetSlice(SliceSettings),
    /// Whether it is looked at: what nobody sees is not computed.
    SetActive(bool),
}
