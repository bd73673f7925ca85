//! The commands of a session.

use super::analysis::{ContrastPage, FieldPage, PictureOptions, SceneFile};
use super::grin_design::GrinCommand;
use super::specified_design::SpecifiedDesignCommand;
use super::structure_search::StructureSearchCommand;
use crate::analysis::{Coating, ImageLight};
use crate::effects::{Effect, EffectOverride};
use crate::experiments::Effort;
use crate::files::VignettingChoice;
use crate::lens::{Edit, Lens, StartingLens};
use crate::merit::Goal;
use crate::optimize::{DescentMethod, pareto};
use crate::paraxial::{DragSettings, Handle};
use crate::picture::BuiltInScene;
use crate::report::PaperKind;
use crate::tolerance::{LoosestGoal, ToleranceGrade};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// A command of the user. An [`Edit`] changes the design and can be undone; the other commands open
/// and save, control background runs, or set what is shown.
#[expect(clippy::large_enum_variant, reason = "made once for each action of a person")]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Command {
    /// Changes the design, as one undo step.
    Edit(Edit),
    /// Limits the beam by the present aperture of the stop instead of an ideal entrance pupil, as one
    /// undo step.
    LimitByStop,
    /// Scales the design to a focal length in mm at the zoom position that is shown, as one undo step.
    ScaleToFocalLength(f64),
    /// Inserts the lens of a file as an element, as one undo step.
    InsertLens {
        /// The file, of any known format.
        path: PathBuf,
        /// The index of its first surface; the number of surfaces appends it.
        at: usize,
    },
    /// Ends an edit of a table cell: the next edit of the same cell is an undo step of its own.
    CommitEdit,
    /// Moves a handle of the design to a value, or as near to it as what is locked allows. All moves
    /// of one handle until the drag ends are one undo step.
    DragHandle {
        /// The handle.
        handle: Handle,
        /// Its new value.
        value: f64,
        /// The semi-diameter in mm with which a surface without one is drawn.
        rim: Option<f64>,
    },
    /// Ends the drag of a handle. Every command that changes or stores the design does so too.
    EndDrag,
    /// Ends the drag of a handle and restores the design before it.
    CancelDrag,
    /// Sets what is held while handles are dragged, and by which numbers.
    SetDragSettings(DragSettings),
    /// Reverts the last undo step.
    Undo,
    /// Restores the undo step that was reverted last.
    Redo,
    /// Makes a version of the history the design.
    GoTo(u64),
    /// Names a version of the history; an empty name is none.
    NameVersion {
        /// The version.
        id: u64,
        /// The name.
        name: String,
    },
    /// Makes the lens of a step of an optimization the design, as one undo step.
    Rewind {
        /// The version that the optimization led to; `None` for the optimization that is shown.
        version: Option<u64>,
        /// The step.
        step: usize,
    },
    /// Starts with another lens that has no file yet.
    New(Box<Lens>),
    /// Begins a lens for a focal length, an aperture and fields, which stay asked for while it has no
    /// focus yet.
    Begin(Box<StartingLens>),
    /// Reads a lens from a file of any known format.
    Open(PathBuf),
    /// Sets how the vignetting factors of foreign files are treated that are opened from now on.
    SetVignetting(VignettingChoice),
    /// Writes the lens to its own file, or to this one, which becomes its own.
    Save(Option<PathBuf>),
    /// Writes a copy in the format of the extension.
    Export(PathBuf),
    /// Writes a report, the layout, the solids of the lens or what an analysis shows, in the format of the
    /// extension.
    ExportPaper {
        /// The kind of the file.
        kind: PaperKind,
        /// The file.
        path: PathBuf,
    },
    /// Writes the report on the file of another program that the design was read from, as text.
    SaveImportReport(PathBuf),
    /// Adds a glass catalogue for good, whose glasses lenses can name from now on.
    AddGlasses(PathBuf),
    /// Starts a local optimization of a copy of the design.
    Optimize {
        /// The descent method.
        method: DescentMethod,
        /// The merit function.
        goal: Goal,
        /// The glasses that those of the lens are exchanged for afterwards, by words and ranges as the Glass
        /// panel takes them; `None` to keep them.
        #[serde(default)]
        glasses: Option<String>,
    },
    /// Pauses the optimization after its current step.
    Pause,
    /// Resumes the optimization.
    Resume,
    /// Takes one step of the paused optimization.
    Step,
    /// Stops the optimization; its result can be accepted or discarded.
    Stop,
    /// Makes the best lens of the optimization the design, as one undo step, and ends the optimization.
    AcceptResult,
    /// Ends the optimization and discards its result.
    DiscardResult,
    /// Starts a sweep of the Pareto front of sharpness and light from the design.
    StartPareto {
        /// The settings of the sweep.
        settings: pareto::ParetoSettings,
        /// True for a second pass whose derivatives keep the pupils frozen.
        compare: bool,
    },
    /// Pauses the sweep after its current step.
    PausePareto,
    /// Resumes the sweep.
    ResumePareto,
    /// Stops the sweep; its front remains.
    StopPareto,
    /// Ends the sweep and dismisses all fronts.
    ClearPareto,
    /// Writes the front into a folder: table, plot and every lens.
    ExportPareto(PathBuf),
    /// A command for the search over lens structures.
    StructureSearch(StructureSearchCommand),
    /// A command for the gradient-index field.
    Grin(GrinCommand),
    /// A command for the design from a specification.
    SpecifiedDesign(SpecifiedDesignCommand),
    /// Shows another lens in place of the design, which does not change; `None` shows the design.
    Preview(Option<Box<Lens>>),
    /// Makes the lens that is shown in place of the design the design, as one undo step.
    AcceptPreview,
    /// Makes the lens that is shown in place of the design the design, wherever it comes from.
    AcceptCandidate,
    /// Keeps that lens beside the design, which does not change.
    KeepCandidate,
    /// Dismisses that lens: an optimization ends, a search or a front goes on.
    DiscardCandidate,
    /// Sets whether that lens is shown or the design.
    ShowCandidate(bool),
    /// Sets what a panel shows of the design.
    Show(PanelSetting),
    /// Sets the relative error allowed of the numbers, 0.001 for 0.1 %.
    SetTolerance(f64),
    /// Sets the index of the zoom position to show.
    ShowZoom(usize),
    /// Sets whether a physical effect is computed: as planned, always or never.
    SetEffect(Effect, EffectOverride),
    /// Saves the picture of the scene as PNG.
    SavePicture(PathBuf),
    /// Starts an experiment in place of the one that runs.
    StartExperiment {
        /// The number of its figure or table.
        id: String,
        /// The computational effort.
        effort: Effort,
    },
    /// Stops the experiment.
    CancelExperiment,
    /// Stops the experiment and dismisses its results.
    DismissExperiment,
    /// Writes the results of the experiment into a folder.
    SaveExperiment(PathBuf),
    /// Highlights a surface in every panel, or none.
    Select(Option<usize>),
    /// Removes all messages.
    ClearMessages,
}

/// A setting of what panels show of the design.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PanelSetting {
    /// The number of rays of each field in the layout.
    Rays(usize),
    /// True to compute the pupils of the fields.
    Pupils(bool),
    /// True to compute the ray fans.
    Fans(bool),
    /// True to compute the fans of path differences.
    PathFans(bool),
    /// True to compute results over the field.
    FieldCurves(bool),
    /// The page of these that is shown.
    FieldPage(FieldPage),
    /// True to compute the contrast of the fields.
    Contrasts(bool),
    /// The page of the contrast that is shown.
    ContrastPage(ContrastPage),
    /// The spatial frequency in cycles/mm of contrast over the field and through focus; `None` for one that the
    /// lens resolves well.
    ContrastFrequency(Option<f64>),
    /// True to measure error against time of contrast.
    ContrastAccuracy(bool),
    /// True to measure error against time of the point spread.
    PointSpreadAccuracy(bool),
    /// True to measure error against time of pictures.
    PictureAccuracy(bool),
    /// True to compute the wavefronts of the fields.
    Wavefronts(bool),
    /// True to compute the images of a point beside the wavefronts.
    PointImages(bool),
    /// True to compute the images of a point by rays.
    RayImages(bool),
    /// The light of images of a point, and of wavefronts where it is of one wavelength; `None` for the primary one.
    WavefrontLight(Option<ImageLight>),
    /// True to compute the footprints of the fields.
    Footprints(bool),
    /// True to compute the spot over the whole field.
    SpotMap(bool),
    /// True to compute the ghosts.
    Ghosts(bool),
    /// The coating of the surfaces that make ghosts.
    Coating(Coating),
    /// The surfaces of the ghost that the layout shows.
    Ghost(Option<[usize; 2]>),
    /// True to compute the picture of a scene.
    Picture(bool),
    /// The scene of the picture, in place of a picture from a file too.
    Scene(BuiltInScene),
    /// The picture from a file that is the scene of the picture; it is no part of a written command.
    #[serde(skip)]
    SceneFile(SceneFile),
    /// The options of the picture.
    PictureOptions(Box<PictureOptions>),
    /// True to measure the error of the picture everywhere.
    PictureErrors(bool),
    /// True to compute the images of points over the picture.
    PicturePoints(bool),
    /// True to compute the lens as it is made.
    Tolerances(bool),
    /// The class of care in making of a lens without tolerances of its own.
    ToleranceGrade(ToleranceGrade),
    /// The largest rms spot radius of a good lens in mm; `None` for no yield.
    GoodRms(Option<f64>),
    /// The frequency in cycles/mm at which lenses as made have a contrast; `None` for none.
    ToleranceFrequency(Option<f64>),
    /// The aim of the loosest tolerances; `None` to find none.
    Loosest(Option<LoosestGoal>),
    /// The index of the wavelength of the pupils; `None` for the primary one.
    PupilWavelength(Option<usize>),
}

impl Command {
    /// True if a drag of a handle goes on with the command.
    pub(super) const fn continues_drag(&self) -> bool {
        matches!(
            self,
            Self::DragHandle { .. }
                | Self::EndDrag
                | Self::CancelDrag
                | Self::CommitEdit
                | Self::Grin(_)
                | Self::SpecifiedDesign(_)
                | Self::Select(_)
                | Self::Show(PanelSetting::Pupils(_) | PanelSetting::Rays(_))
                | Self::ClearMessages
        )
    }
}

impl From<StructureSearchCommand> for Command {
    fn from(command: StructureSearchCommand) -> Self {
        Self::StructureSearch(command)
    }
}

impl From<SpecifiedDesignCommand> for Command {
    fn from(command: SpecifiedDesignCommand) -> Self {
        Self::SpecifiedDesign(command)
    }
}

impl From<Edit> for Command {
    fn from(edit: Edit) -> Self {
        Self::Edit(edit)
    }
}
