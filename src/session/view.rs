//! What a panel reads: a snapshot of the session that nothing changes.

use super::analyst::AnalysisResults;
use super::explorations::StructureSearchView;
use super::forming::GrinView;
use super::fronts::ParetoView;
use super::laboratory::ExperimentRun;
use super::worker::OptimizationSnapshot;
use crate::effects::EffectOverrides;
use crate::lens::{Lens, blank};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::sync::Arc;

/// A snapshot of one open design and everything that is known about it.
#[derive(Debug, Clone)]
pub struct SessionView {
    /// The design.
    pub lens: Arc<Lens>,
    /// Counts every change of the design and of the settings.
    pub version: u64,
    /// The newest numbers there are, maybe of an older version.
    pub results: Option<Arc<AnalysisResults>>,
    /// The search in the background, or the last one whose result was neither taken nor thrown
    /// away.
    pub optimization: Option<Arc<OptimizationSnapshot>>,
    /// The fronts of sharpness against light.
    pub pareto: ParetoView,
    /// The search over structure.
    pub structure_search: StructureSearchView,
    /// The gradient-index field that is open.
    pub grin: GrinView,
    /// A lens that is shown in place of the design.
    pub preview_lens: Option<Arc<Lens>>,
    /// The numbers of that lens, or of the one that the search shows, maybe of a step before.
    pub preview_results: Option<Arc<AnalysisResults>>,
    /// The experiment in the background, or the last one until it is put away.
    pub experiment: Option<Arc<ExperimentRun>>,
    /// What was said, newest last.
    pub messages: Vec<Message>,
    /// What undo would take back; `None` where there is nothing.
    pub undo: Option<String>,
    /// What redo would do again; `None` where there is nothing.
    pub redo: Option<String>,
    /// The file of the design; `None` where it was never saved.
    pub path: Option<PathBuf>,
    /// Whether the design differs from its file.
    pub dirty: bool,
    /// What is shown and how exactly.
    pub settings: AnalysisSettings,
    /// The surface that every panel points out.
    pub selected: Option<usize>,
}

impl Default for SessionView {
    fn default() -> Self {
        Self {
            lens: Arc::new(blank()),
            version: 0,
            results: None,
            optimization: None,
            pareto: ParetoView::default(),
            structure_search: StructureSearchView::default(),
            grin: GrinView::default(),
            preview_lens: None,
            preview_results: None,
            experiment: None,
            messages: Vec::new(),
            undo: None,
            redo: None,
            path: None,
            dirty: false,
            settings: AnalysisSettings::default(),
            selected: None,
        }
    }
}

impl SessionView {
    /// Whether the numbers belong to the design as it is now.
    pub fn is_current(&self) -> bool {
        self.results.as_ref().is_some_and(|results| results.version == self.version)
    }
}

/// What is shown and how exactly.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AnalysisSettings {
    /// The relative error that the shown numbers may have.
    pub tolerance: f64,
    /// The zoom position that is shown.
    pub zoom: usize,
    /// How many rays of each field the layout shows.
    pub rays: usize,
    /// Effects that are not left to the plan.
    pub overrides: EffectOverrides,
    /// Whether pupils are computed: what is not shown is not.
    pub pupils: bool,
    /// The wavelength of the pupils; `None` for the primary one.
    pub pupil_wavelength: Option<usize>,
}

impl Default for AnalysisSettings {
    fn default() -> Self {
        Self {
            tolerance: 1e-3,
            zoom: 0,
            rays: 15,
            overrides: EffectOverrides::default(),
            pupils: false,
            pupil_wavelength: None,
        }
    }
}

/// How much a message matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Something was done.
    Note,
    /// A wish was not fulfilled, or not wholly.
    Warning,
    /// Something failed.
    Error,
}

/// Something that was said to the person.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Message {
    /// How much it matters.
    pub severity: Severity,
    /// The words.
    pub text: String,
}
