//! One open design: the document, its versions, and everything that is computed from it in the
//! background.
//!
//! A [`Session`] carries out [`Command`]s and shows its state as a [`SessionView`]. It knows no
//! widgets: the window, a test and a script use it alike.
//!
//! - *The document changes only by a command*, and an edit that would leave a lens that cannot be
//!   used is refused: the document stays as it was.
//! - *A run works on its own copy*: an optimization, a sweep of the Pareto front and a structure search
//!   change the document only when one of their lenses is accepted, as one undo step.
//! - *Nothing here waits*: analyses and runs have threads of their own, their newest states are in
//!   slots, and `wake` is called when there is something new in one.

mod analysis;
mod clock;
mod command;
mod drag;
mod experiment;
mod figures;
mod grin_design;
mod history;
mod journal;
mod live_merit;
mod optimization;
mod pareto;
mod proposal;
mod run;
mod saved_runs;
mod score;
mod slot;
mod specified_design;
mod state;
mod structure_search;
mod view;

pub use crate::tolerance::{LoosestGoal, LoosestTolerances};
pub use analysis::{
    AccuracyCurves, AccuracyPoint, Analyses, AnalysisResults, AnalysisSettings, AsBuiltLens,
    ContrastPage, ENERGY_SHARES, FieldContrast, FieldContrastCurves, FieldContrasts, FieldFans,
    FieldFootprints, FieldGhosts, FieldPage, FieldPathFans, FieldPupils, FieldRayImage,
    FieldWavefront, FieldWavefronts, FocusContrasts, PictureEffect, PictureFocus, PictureOptions,
    PictureScene, PointImage, PointImages, RayImages, SceneFile, ScenePicture, analyze,
    confirm_as_built, predict_as_built,
};
pub use clock::Timed;
pub use command::{Command, PanelSetting};
pub use drag::{DragProgress, DragView, HandleSlopes, MeritSlopes};
pub use experiment::{ExperimentRun, ExperimentStatus};
pub use figures::analysis_figure;
pub use grin_design::{
    Contour, DocumentSource, GrinAnalysis, GrinCommand, GrinDocument, GrinPictures, GrinRun,
    GrinView, IndexProfile, LossSample, MAX_NODES, Slice, SliceQuantity, SliceSettings,
};
pub use history::HistoryNode;
pub use live_merit::{MeritReport, MeritValues};
pub use optimization::{
    CurvePoint, MeritSample, OptimizationCurve, OptimizationRequest, OptimizationSnapshot,
    OptimizerFactory,
};
pub use pareto::{ParetoPass, ParetoRun, ParetoView};
pub use proposal::MeritProposal;
pub use run::{RunId, RunKind, RunStatus, RunView};
pub use score::ScoredLens;
pub use slot::Slot;
pub use specified_design::{
    OfferedLens, SpecificationRequest, SpecifiedDesign, SpecifiedDesignCommand, SpecifiedDesignView,
};
pub use state::{Session, SessionEvent};
pub use structure_search::{
    CheckpointStatus, DescentMark, EndReason, FoundLens, HistorySample, SearchHistory,
    StructureSearchCommand, StructureSearchRequest, StructureSearchSnapshot, StructureSearchView,
};
pub use view::{CandidateSource, CandidateView, KeptLens, Message, SessionView, Severity};
