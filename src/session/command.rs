//! Everything a person can ask for, as one enum.
//!
//! The window, the command line and recorded work speak the same language: an [`Edit`] changes
//! the design and can be undone, every other [`Command`] opens, saves, searches or sets up what is
//! shown.

use super::forming::GrinCommand;
use super::quest::StructureSearchRequest;
use crate::effects::{Effect, EffectOverride};
use crate::experiments::Effort;
use crate::lens::{Edit, Lens};
use crate::merit::Goal;
use crate::optimize::{DescentMethod, pareto};
use crate::search::SteerCommand;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// One wish of a person.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Command {
    /// Change the design: one undo step.
    Edit(Edit),
    /// Limits the beam by the rim of the stop as it is now, instead of by an ideal entrance pupil: one
    /// undo step.
    LimitByStop,
    /// Typing into a cell has ended: the next edit of the same cell is an undo step of its own.
    CommitEdit,
    /// Take back the last step.
    Undo,
    /// Do it again.
    Redo,
    /// Start with another lens that has no file yet.
    New(Box<Lens>),
    /// Read a lens from a file of any known format.
    Open(PathBuf),
    /// Write the lens to its own file, or to this one, which becomes its own.
    Save(Option<PathBuf>),
    /// Write a copy, in the format of the extension.
    Export(PathBuf),
    /// Search for a better lens in the background, on a copy.
    Optimize {
        /// How.
        method: DescentMethod,
        /// What for.
        goal: Goal,
    },
    /// Hold the search after its current step.
    Pause,
    /// Let it go on.
    Resume,
    /// One step of a search that is held.
    Step,
    /// End the search; its result stays to be taken or thrown away.
    Stop,
    /// Make the best lens of the search the design, as one undo step, and end the search.
    AcceptResult,
    /// End the search and throw its result away.
    DiscardResult,
    /// Sweep the front of sharpness against light in the background, from the design.
    StartPareto {
        /// How.
        settings: pareto::ParetoSettings,
        /// Whether to do the same afterwards with pupils that the derivatives keep as they are.
        compare: bool,
    },
    /// Hold the sweep after its current slice.
    PausePareto,
    /// Let it go on.
    ResumePareto,
    /// End the sweep; its front stays.
    StopPareto,
    /// End the sweep and forget its front and all earlier ones.
    ClearPareto,
    /// Write the front into this folder: table, picture and every lens.
    ExportPareto(Option<PathBuf>),
    /// Search over structure.
    StructureSearch(StructureSearchCommand),
    /// Form a gradient-index field, or look at one.
    Grin(GrinCommand),
    /// Show another lens in place of the design, which stays what it is; `None` for the design.
    Preview(Option<Box<Lens>>),
    /// Make the lens that is shown in place of the design the design, as one undo step.
    AcceptPreview,
    /// How exact the shown numbers have to be: a relative error, 0.001 for 0.1 %.
    SetTolerance(f64),
    /// Which zoom position is shown.
    ShowZoom(usize),
    /// How many rays of each field the layout shows.
    ShowRays(usize),
    /// Whether a physical effect is computed: as planned, always or never.
    SetEffect(Effect, EffectOverride),
    /// Whether the pupils of the fields are computed: while a panel shows them.
    ShowPupils(bool),
    /// The wavelength of the pupils that are shown; `None` for the primary one.
    ShowPupilWavelength(Option<usize>),
    /// Carry out an experiment in the background, in place of the one that runs.
    StartExperiment {
        /// The number of its figure or table.
        id: String,
        /// How much it works for its claims.
        effort: Effort,
    },
    /// Tell the experiment to stop.
    CancelExperiment,
    /// End the experiment and forget what it found.
    DismissExperiment,
    /// Write what the experiment found into this folder.
    SaveExperiment(PathBuf),
    /// Point out a surface in every panel, or none.
    Select(Option<usize>),
    /// Forget the messages so far.
    ClearMessages,
}

/// What a person asks of a search over structure. It works on its own copy of the design.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StructureSearchCommand {
    /// Begin one from the design, in place of the one before.
    Start(Box<StructureSearchRequest>),
    /// Go on with the one that a file holds.
    ResumeFrom(Option<PathBuf>),
    /// Hold it after its present round.
    Pause,
    /// Let it go on.
    Resume,
    /// End it; what it has found stays.
    Stop,
    /// Pin a lens, forbid a mutation, change the temperature.
    Control(SteerCommand),
    /// Show the lens of a chain, counted from 0, in place of the design as it changes; or no more.
    Preview(Option<usize>),
    /// Save it to this file from now on, or the next one where none goes on.
    SaveTo(Option<PathBuf>),
    /// Make the lens of a generation the design, as one undo step.
    Accept(u64),
    /// Write the lens of a generation.
    Export {
        /// Its number.
        number: u64,
        /// The file.
        path: Option<PathBuf>,
    },
    /// End it and forget it; its file stays.
    Clear,
    /// Remove the file of the one that was left when the program was closed.
    DismissUnfinished,
}

impl From<Edit> for Command {
    fn from(edit: Edit) -> Self {
        Self::Edit(edit)
    }
}
