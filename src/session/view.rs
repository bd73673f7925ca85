//! The state of a session that panels read.

use super::analysis::{AnalysisResults, AnalysisSettings};
use super::drag::DragView;
use super::experiment::ExperimentRun;
use super::grin_design::GrinView;
use super::history::HistoryNode;
use super::live_merit::MeritReport;
use super::optimization::OptimizationSnapshot;
use super::pareto::ParetoView;
use super::run::RunView;
use super::score::ScoredLens;
use super::specified_design::SpecifiedDesignView;
use super::structure_search::StructureSearchView;
use crate::files::{ImportedFile, VignettingChoice};
use crate::lens::{Lens, blank};
use crate::merit::Goal;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::sync::Arc;

/// A snapshot of one open design and of everything that is known about it. It shares its large parts
/// with the session.
#[derive(Debug, Clone)]
pub struct SessionView {
    /// The design.
    pub lens: Arc<Lens>,
    /// The number of changes of the design and of the settings.
    pub version: u64,
    /// The number of lenses that were opened or begun: a new one is another document.
    pub document: u64,
    /// The newest analyses, maybe of an earlier version.
    pub results: Option<Arc<AnalysisResults>>,
    /// The local optimization.
    pub optimization: RunView<OptimizationSnapshot>,
    /// The Pareto fronts of sharpness and light.
    pub pareto: ParetoView,
    /// The search over lens structures.
    pub structure_search: StructureSearchView,
    /// The gradient-index field that is open.
    pub grin: GrinView,
    /// The design from a specification.
    pub specified_design: SpecifiedDesignView,
    /// The sharpness and light of the design, maybe of an earlier version; `None` without a run to
    /// compare with.
    pub design_score: Option<Arc<ScoredLens>>,
    /// The lens that a panel shows in place of the design.
    pub preview_lens: Option<Arc<Lens>>,
    /// The lens that is offered in place of the design; `None` if there is none.
    pub candidate: Option<CandidateView>,
    /// The candidates that were kept beside the design.
    pub kept: Arc<Vec<KeptLens>>,
    /// The analyses of that lens, or of the one that a run shows, maybe of an earlier step.
    pub preview_results: Option<Arc<AnalysisResults>>,
    /// The merit of that lens by the merit function of the design, maybe of an earlier step.
    pub preview_merit: Option<Arc<MeritReport>>,
    /// The experiment, until it is dismissed.
    pub experiment: Option<Arc<ExperimentRun>>,
    /// The handles of the design: what is held while they are dragged, and the drag that goes on.
    pub drag: DragView,
    /// The messages so far, the newest last.
    pub messages: Arc<Vec<Message>>,
    /// True if nothing was done since the last message.
    pub message_is_recent: bool,
    /// The title of the edit that undo reverts; `None` if there is none.
    pub undo: Option<String>,
    /// The title of the edit that redo restores; `None` if there is none.
    pub redo: Option<String>,
    /// The versions of the design by number.
    pub history: Arc<Vec<Arc<HistoryNode>>>,
    /// The number of the present version.
    pub version_id: u64,
    /// The file of the design; `None` if it was never saved.
    pub path: Option<PathBuf>,
    /// The file of another program that the design was read from, with its report; `None` for any other
    /// design.
    pub imported: Option<Arc<ImportedFile>>,
    /// The treatment of the vignetting factors of foreign files that are opened.
    pub vignetting: VignettingChoice,
    /// The merit function of the design: its own, or else the one that was proposed when the design
    /// was opened; `None` if none can be proposed for it.
    pub goal: Option<Arc<Goal>>,
    /// The merit of the design, maybe of an earlier version.
    pub merit: Option<Arc<MeritReport>>,
    /// True if the design differs from its file.
    pub dirty: bool,
    /// The settings of the analyses.
    pub settings: AnalysisSettings,
    /// The index of the surface that every panel highlights.
    pub selected: Option<usize>,
}

impl Default for SessionView {
    fn default() -> Self {
        Self {
            lens: Arc::new(blank()),
            version: 0,
            results: None,
            optimization: RunView::default(),
            pareto: ParetoView::default(),
            structure_search: StructureSearchView::default(),
            grin: GrinView::default(),
            specified_design: SpecifiedDesignView::default(),
            design_score: None,
            preview_lens: None,
            candidate: None,
            kept: Arc::default(),
            preview_results: None,
            preview_merit: None,
            experiment: None,
            drag: DragView::default(),
            messages: Arc::default(),
            message_is_recent: false,
            document: 0,
            undo: None,
            redo: None,
            history: Arc::default(),
            version_id: 0,
            path: None,
            imported: None,
            vignetting: VignettingChoice::default(),
            goal: None,
            merit: None,
            dirty: false,
            settings: AnalysisSettings::default(),
            selected: None,
        }
    }
}

impl SessionView {
    /// True if the analyses belong to the present version.
    pub fn is_current(&self) -> bool {
        self.results.as_ref().is_some_and(|results| results.version == self.version)
    }
}

/// A lens that is offered in place of the design.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CandidateView {
    /// The source.
    pub source: CandidateSource,
    /// The name, as in `lens 17 of the search`.
    pub title: String,
    /// True if all panels show it; false while they show the design.
    pub shown: bool,
}

/// The source of a candidate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CandidateSource {
    /// The local optimization.
    Optimization,
    /// A lens that was chosen: of the Pareto front, of the search, or a kept one.
    Chosen,
    /// The search, as it goes on.
    Search,
}

/// A candidate that was kept beside the design.
#[derive(Debug, Clone)]
pub struct KeptLens {
    /// The name.
    pub title: String,
    /// The lens.
    pub lens: Arc<Lens>,
}

/// The severity of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Something was done.
    Note,
    /// A command was not carried out, or not completely.
    Warning,
    /// Something has failed.
    Error,
}

/// A message to the user.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Message {
    /// The severity.
    pub severity: Severity,
    /// The text.
    pub text: String,
}
