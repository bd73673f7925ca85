//! Everything a person can ask for, as one enum.
//!
//! The window, the command line and recorded work speak the same language: an [`Edit`] changes
//! the design and can be undone, every other [`Command`] opens, saves, searches or sets up what is
//! shown.

use super::forming::GrinCommand;
use super::quest::StructureSearchRequest;
use crate::effects::{Effect, EffectOverride};
use crate::experiments::Effort;
use crate::lens::{
    Aperture, Fields, Lens, Medium, Object, Parameter, Pickup, Quantity, Row, Variable, Wavelength,
    ZoomPosition,
};
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

/// One change of the design.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Edit {
    /// Write a number.
    Set {
        /// Which.
        parameter: Parameter,
        /// Its new value.
        value: f64,
    },
    /// Write what was typed into the cell of a number: see [`evaluate`](super::evaluate).
    Type {
        /// Which.
        parameter: Parameter,
        /// A number or arithmetic on the old value.
        text: String,
    },
    /// The same for the cell that shows a curvature as a radius; nothing, 0 or `inf` is a plane.
    TypeRadius {
        /// The row.
        surface: usize,
        /// A number or arithmetic on the old radius.
        text: String,
    },
    /// Limit a surface, or let it clip nothing.
    SetSemiDiameter {
        /// The row.
        surface: usize,
        /// In mm.
        value: Option<f64>,
    },
    /// Replace all asphere coefficients, r⁴ first.
    SetAsphere {
        /// The row.
        surface: usize,
        /// The coefficients.
        terms: Vec<f64>,
    },
    /// Fill the gap behind a row with something else, or make the row a mirror.
    SetMedium {
        /// The row.
        surface: usize,
        /// Glass, air, a mirror.
        medium: Medium,
    },
    /// What lies in front of the first surface.
    SetObjectMedium(Medium),
    /// Make this row the aperture stop.
    SetStop(usize),
    /// Whether the far half of the sphere counts too.
    SetHyperhemisphere {
        /// The row.
        surface: usize,
        /// Whether it does.
        hyper: bool,
    },
    /// A remark on a row.
    SetComment {
        /// The row.
        surface: usize,
        /// The remark.
        text: String,
    },
    /// Replace a whole row.
    SetRow {
        /// Which.
        surface: usize,
        /// By what.
        row: Row,
    },
    /// Put a row in front of row `at`, or behind the last one.
    InsertRow {
        /// Where it will stand.
        at: usize,
        /// The row.
        row: Row,
    },
    /// Take a row and the gap behind it out.
    RemoveRow(usize),
    /// Turn a group of rows around, so that its last surface comes first.
    ReverseRows {
        /// Its first row.
        first: usize,
        /// Its last row.
        last: usize,
    },
    /// Multiply every length.
    Scale(f64),
    /// What the lens is called.
    SetName(String),
    /// Where its numbers come from.
    SetSource(String),
    /// Anything else worth knowing.
    SetNotes(String),
    /// Where the light comes from.
    SetObject(Object),
    /// How wide the beam is.
    SetAperture(Aperture),
    /// Limit the beam by the rim of the stop as it is now, instead of by an ideal entrance pupil.
    LimitByStop,
    /// The field points.
    SetFields(Fields),
    /// The wavelengths.
    SetWavelengths(Vec<Wavelength>),
    /// Solve the last gap for the paraxial focus, displaced by so many mm; or no longer, and leave
    /// the image plane where it is.
    SetFocusSolve(Option<f64>),
    /// Let an optimizer change a number, within bounds.
    AddVariable(Variable),
    /// Let it no longer.
    RemoveVariable(Parameter),
    /// Let an optimizer change these numbers and no others.
    SetVariables(Vec<Variable>),
    /// Let a number follow another.
    SetPickup(Pickup),
    /// Let it follow no longer; it keeps its value.
    RemovePickup(Parameter),
    /// Put a zoom position in front of position `at`, or behind the last one.
    InsertZoom {
        /// Where it will stand.
        at: usize,
        /// The position.
        position: ZoomPosition,
    },
    /// Take a zoom position out.
    RemoveZoom(usize),
    /// Replace a zoom position.
    SetZoom {
        /// Which.
        at: usize,
        /// By what.
        position: ZoomPosition,
    },
    /// Replace the whole design.
    Replace(Box<Lens>),
}

impl From<Edit> for Command {
    fn from(edit: Edit) -> Self {
        Self::Edit(edit)
    }
}

/// The cell that an edit writes to; consecutive edits of one cell are one undo step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum EditedCell {
    Number(Parameter),
    Comment(usize),
    Name,
    Source,
    Notes,
}

impl Edit {
    /// The cell into which a person types or drags with this edit, if it is such a one.
    pub(super) fn cell(&self) -> Option<EditedCell> {
        let curvature = |surface| Parameter::new(surface, Quantity::Curvature);
        match self {
            Self::Set { parameter, .. } | Self::Type { parameter, .. } => {
                Some(EditedCell::Number(*parameter))
            }
            Self::TypeRadius { surface, .. } => Some(EditedCell::Number(curvature(*surface))),
            Self::SetComment { surface, .. } => Some(EditedCell::Comment(*surface)),
            Self::SetName(_) => Some(EditedCell::Name),
            Self::SetSource(_) => Some(EditedCell::Source),
            Self::SetNotes(_) => Some(EditedCell::Notes),
            _ => None,
        }
    }

    /// What the edit is called in a menu: `Undo insert surface`.
    pub fn title(&self) -> String {
        match self {
            Self::Set { parameter, .. } | Self::Type { parameter, .. } => parameter.to_string(),
            Self::TypeRadius { surface, .. } => format!("radius of surface {surface}"),
            Self::SetSemiDiameter { surface, .. } => format!("semi-diameter of surface {surface}"),
            Self::SetAsphere { surface, .. } => format!("asphere of surface {surface}"),
            Self::SetMedium { surface, .. } => format!("glass after surface {surface}"),
            Self::SetObjectMedium(_) => "object medium".to_owned(),
            Self::SetStop(surface) => format!("stop to surface {surface}"),
            Self::SetHyperhemisphere { surface, .. } => format!("far half of surface {surface}"),
            Self::SetComment { surface, .. } => format!("remark on surface {surface}"),
            Self::SetRow { surface, .. } => format!("surface {surface}"),
            Self::InsertRow { at, .. } => format!("insert surface {at}"),
            Self::RemoveRow(surface) => format!("remove surface {surface}"),
            Self::ReverseRows { first, last } => format!("flip surfaces {first} to {last}"),
            Self::Scale(factor) => format!("scale by {factor}"),
            Self::SetName(_) => "name".to_owned(),
            Self::SetSource(_) => "source".to_owned(),
            Self::SetNotes(_) => "notes".to_owned(),
            Self::SetObject(_) => "object".to_owned(),
            Self::SetAperture(_) => "aperture".to_owned(),
            Self::LimitByStop => "limit the beam by the stop".to_owned(),
            Self::SetFields(_) => "fields".to_owned(),
            Self::SetWavelengths(_) => "wavelengths".to_owned(),
            Self::SetFocusSolve(_) => "focus solve".to_owned(),
            Self::AddVariable(variable) => format!("free the {}", variable.parameter),
            Self::SetVariables(_) => "variables".to_owned(),
            Self::RemoveVariable(parameter) => format!("fix the {parameter}"),
            Self::SetPickup(pickup) => format!("pickup of the {}", pickup.parameter),
            Self::RemovePickup(parameter) => format!("no pickup of the {parameter}"),
            Self::InsertZoom { at, .. } => format!("insert zoom position {at}"),
            Self::RemoveZoom(at) => format!("remove zoom position {at}"),
            Self::SetZoom { at, .. } => format!("zoom position {at}"),
            Self::Replace(_) => "replace the lens".to_owned(),
        }
    }
}
