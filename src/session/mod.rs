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
mod exploration;
mod explorations;
mod explorer;
mod finishing;
mod forming;
mod fronts;
mod history;
mod judged;
mod laboratory;
mod moments;
mod pupils;
mod quest;
mod saving;
mod slot;
mod sweeper;
mod view;
mod worker;

pub use analyst::{Analyses, AnalysisResults, analyze};
pub use clock::Timed;
pub use command::{Command, StructureSearchCommand};
pub use desk::{Session, SessionEvent};
pub use exploration::{
    ChainPosition, CheckpointStatus, EndReason, FoundLens, StructureSearchSnapshot,
};
pub use explorations::StructureSearchView;
pub use forming::{
    Contour, DocumentSource, GrinAnalysis, GrinCommand, GrinDocument, GrinRun, GrinView,
    IndexProfile, LossSample, MAX_NODES, Slice, SliceQuantity, SliceSettings,
};
pub use fronts::ParetoView;
pub use judged::ScoredLens;
pub use laboratory::{ExperimentRun, ExperimentStatus};
pub use moments::{DescentMark, HistorySample, SearchHistory};
pub use pupils::FieldPupils;
pub use quest::StructureSearchRequest;
pub use saving::measure_effect_costs;
pub use slot::Slot;
pub use sweeper::{ParetoPass, ParetoRun};
pub use view::{AnalysisSettings, Message, SessionView, Severity};
pub use worker::{
    MeritSample, OptimizationRequest, OptimizationSnapshot, OptimizerFactory, RunStatus,
};
