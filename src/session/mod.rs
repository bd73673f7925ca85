//! One open design: the document, commands and undo, a search and an analyst in the background.
//!
//! A [`Session`] is told what a person wants as [`Command`]s and shows what there is as a
//! [`SessionView`]. It knows no widgets: the window, a test and a script use it alike.
//!
//! - *The document changes only by a command*, and an edit that would leave a lens that cannot be
//!   used is refused: the document is then what it was.
//! - *A search works on its own copy*: its result becomes the document when it is taken, as one
//!   undo step. So does the sweep of a front, whose lenses can be looked at before.
//! - *Nothing here waits*: numbers and searches are in newest-value slots, and `wake` is called when
//!   something new is in one.

mod analyst;
mod background;
mod clock;
mod command;
mod course;
mod desk;
mod diary;
mod edit;
mod exploration;
mod explorations;
mod explorer;
mod finishing;
mod forming;
mod fresh;
mod fronts;
mod history;
mod judged;
mod laboratory;
mod layout;
mod moments;
mod pupils;
mod quest;
mod rows;
mod saving;
mod scale;
mod scatter;
mod slot;
mod sweeper;
mod typed;
mod view;
mod worker;

pub use analyst::{Analyses, AnalysisResults, analyze};
pub use clock::Timed;
pub use command::{Command, Edit, StructureSearchCommand};
pub use desk::{Session, SessionEvent};
pub use edit::{EditError, apply_edit};
pub use exploration::{
    ChainPosition, CheckpointStatus, EndReason, FoundLens, StructureSearchSnapshot,
};
pub use explorations::StructureSearchView;
pub use forming::{
    Contour, DocumentSource, GrinAnalysis, GrinCommand, GrinDocument, GrinRun, GrinView,
    IndexProfile, LossSample, MAX_NODES, Slice, SliceQuantity, SliceSettings,
};
pub use fresh::added_glass;
pub use fronts::ParetoView;
pub use judged::ScoredLens;
pub use laboratory::{ExperimentRun, ExperimentStatus};
pub use layout::{LayoutRay, RayLayout, ray_layout};
pub use moments::{DescentMark, HistorySample, SearchHistory};
pub use pupils::FieldPupils;
pub use quest::StructureSearchRequest;
pub use saving::measure_effect_costs;
pub use scatter::{SpotPoints, spot_points};
pub use slot::Slot;
pub use sweeper::{ParetoPass, ParetoRun};
pub use typed::{ParseNumberError, evaluate};
pub use view::{AnalysisSettings, Message, SessionView, Severity, blank};
pub use worker::{
    MeritSample, OptimizationRequest, OptimizationSnapshot, OptimizerFactory, RunStatus,
};
