//! Commands for the gradient-index field of a session.

use super::slice_settings::SliceSettings;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// A command for the gradient-index field that is open.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GrinCommand {
    /// Opens a task or a volume from a file in place of the open document.
    OpenFile(PathBuf),
    /// Opens a built-in task.
    OpenBuiltin(String),
    /// Starts the design of the field from its beginning.
    Start,
    /// Pauses the design after its current step.
    Pause,
    /// Resumes the design.
    Resume,
    /// Stops the design and evaluates the current field; the best one remains.
    Stop,
    /// Writes the best field: `.npz`, or `.json` with the numbers beside it in `.raw`.
    Save {
        /// The file.
        path: PathBuf,
        /// The number of nodes along a side, for a field that is a spline in one coordinate.
        nodes: usize,
    },
    /// Closes the document.
    Close,
    /// Sets the slice to show.
    SetSlice(SliceSettings),
    /// Sets whether a panel shows the field; otherwise no slices and images are computed.
    SetActive(bool),
}
