//! Commands for the search over lens structures.

use super::request::StructureSearchRequest;
use crate::search::SteerCommand;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// A command for the search over lens structures, which works on a copy of the design.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StructureSearchCommand {
    /// Starts a search from the design, in place of the one before.
    Start(Box<StructureSearchRequest>),
    /// Resumes the search of a file.
    ResumeFrom(PathBuf),
    /// Pauses the search after its current round.
    Pause,
    /// Resumes the search.
    Resume,
    /// Stops the search; its lenses remain.
    Stop,
    /// Changes the search between two rounds: its pinned lens, mutations or temperature.
    Control(SteerCommand),
    /// Shows the lens of the chain with this index in place of the design; `None` shows the design.
    Preview(Option<usize>),
    /// Saves the search to this file from now on, or the next search if none is active.
    SaveTo(PathBuf),
    /// Makes the lens of a generation the design, as one undo step.
    Accept(u64),
    /// Finalizes and writes the lens of a generation.
    Export {
        /// The generation.
        number: u64,
        /// The file.
        path: PathBuf,
    },
    /// Ends the search and dismisses its lenses; its file remains.
    Clear,
    /// Dismisses the search that was unfinished when the program was closed.
    DismissUnfinished,
}
