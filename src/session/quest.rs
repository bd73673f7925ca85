//! A search over structure as a person asks for it, and the engine that does it.

use super::diary::CheckpointSidecar;
use super::finishing::LensFinalizer;
use crate::files::FileError;
use crate::lens::Lens;
use crate::merit::{ConstraintMargin, Goal};
use crate::search::lens_landscape::{
    DescentSettings, LandscapeError, LensLandscape, SearchPlan, with_open_apertures,
};
use crate::search::{
    self, SearchError, SearchRules, SearchRun, SearchRunOn, SearchSettings, SteerCommand,
};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::fs;
use std::path::Path;

/// What a search over structure is asked for.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StructureSearchRequest {
    /// What it may do, what it aims at, how it goes.
    pub plan: SearchPlan,
    /// Whether every curvature and gap is free, whatever the design says.
    pub free: bool,
    /// Rims are opened up to this semi-diameter first, in mm; none leaves them. No rim grows beyond
    /// it afterwards, where the rules do not say otherwise.
    pub open: Option<f64>,
    /// The search ends after so many minutes of work; none for no limit.
    pub minutes: Option<f64>,
}

/// What searches: the engine, or what a test puts in its place.
pub(super) trait StructureSearchEngine: Send {
    fn run(&self) -> &SearchRunOn<LensLandscape>;
    fn round(&mut self) -> Vec<search::SearchEvent>;
    fn control(&mut self, steer: SteerCommand) -> Result<(), SearchError>;
    fn save(&self, path: &Path, diary: &CheckpointSidecar) -> Result<(), SearchError>;
    /// What makes a lens that can be made of one that was found.
    fn finalizer(&self) -> LensFinalizer;
    /// The rays of a gradient of the best lens.
    fn rays(&self) -> usize;
    /// The limits that a lens breaks.
    fn violations(&self, lens: &Lens) -> Vec<ConstraintMargin>;
}

/// A run on its landscape.
pub(super) struct LensSearchEngine {
    landscape: LensLandscape,
    run: SearchRunOn<LensLandscape>,
}

/// Why a search cannot begin or go on.
#[derive(Debug, thiserror::Error)]
pub(super) enum StructureSearchError {
    #[error(transparent)]
    Landscape(#[from] LandscapeError),
    #[error(transparent)]
    Search(#[from] SearchError),
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{file}: no checkpoint of a search over lenses: {what}")]
    Foreign { file: String, what: String },
}

/// What a checkpoint says about the search that it belongs to.
#[derive(Deserialize)]
struct SavedSearch {
    landscape: SavedLandscape,
    run: SavedRun,
    /// None where the search was saved by another program than the window.
    #[serde(default)]
    beside: Value,
}

#[derive(Deserialize)]
struct SavedLandscape {
    start: Lens,
    goal: Goal,
    rules: SearchRules,
    local: DescentSettings,
    light: Vec<Vec<f64>>,
}

#[derive(Deserialize)]
struct SavedRun {
    settings: SearchSettings,
}

impl LensSearchEngine {
    /// A search from a lens.
    pub(super) fn start(
        lens: &Lens,
        quest: &StructureSearchRequest,
    ) -> Result<Self, StructureSearchError> {
        let mut start = lens.clone();
        let mut plan = quest.plan.clone();
        if quest.free {
            start.variables.clear();
        }
        if let Some(limit) = quest.open {
            start = with_open_apertures(&start, limit);
            plan.rules.semi_diameter = plan.rules.semi_diameter.or(quest.open);
        }
        let landscape = plan.landscape(&start)?;
        let settings = plan.settings(&landscape);
        let run = SearchRun::new(&landscape, landscape.start().clone(), &settings)?;
        Ok(Self { landscape, run })
    }

    /// The search that a checkpoint holds, what it was asked for, and what was kept beside it.
    pub(super) fn resume(
        path: &Path,
    ) -> Result<(Self, StructureSearchRequest, CheckpointSidecar), StructureSearchError> {
        let SavedSearch { landscape: kept, run: SavedRun { settings }, beside } = read(path)?;
        // A curve that cannot be read is no reason to lose the search.
        let diary: CheckpointSidecar = serde_json::from_value(beside).unwrap_or_default();
        let SavedLandscape { start, goal, rules, local, light } = kept;
        let landscape =
            LensLandscape::new(&start, &goal, &rules, &local)?.with_reference_light(light)?;
        let run = SearchRun::load(&landscape, &settings, path)?;
        let plan = SearchPlan { goal: Some(goal), rules, local, settings, ..SearchPlan::default() };
        let quest = StructureSearchRequest {
            plan,
            minutes: diary.remaining_minutes(),
            ..StructureSearchRequest::default()
        };
        Ok((Self { landscape, run }, quest, diary))
    }
}

fn read(path: &Path) -> Result<SavedSearch, StructureSearchError> {
    let file = path.display().to_string();
    let bytes =
        fs::read(path).map_err(|source| FileError::Unreadable { file: file.clone(), source })?;
    serde_json::from_slice(&bytes)
        .map_err(|error| StructureSearchError::Foreign { file, what: error.to_string() })
}

impl StructureSearchEngine for LensSearchEngine {
    fn run(&self) -> &SearchRunOn<LensLandscape> {
        &self.run
    }

    fn round(&mut self) -> Vec<search::SearchEvent> {
        self.run.round(&self.landscape)
    }

    fn control(&mut self, steer: SteerCommand) -> Result<(), SearchError> {
        self.run.steer(&self.landscape, steer)
    }

    fn save(&self, path: &Path, diary: &CheckpointSidecar) -> Result<(), SearchError> {
        let beside = serde_json::to_value(diary).unwrap_or_default();
        self.run.save_with_sidecar(&self.landscape, path, &beside)
    }

    fn finalizer(&self) -> LensFinalizer {
        LensFinalizer::new(self.landscape.clone())
    }

    fn rays(&self) -> usize {
        self.landscape.rays_per_gradient(&self.run.best().point)
    }

    fn violations(&self, lens: &Lens) -> Vec<ConstraintMargin> {
        // A lens that cannot be set up is nowhere in a run.
        self.landscape.violations(lens).unwrap_or_default()
    }
}
