//! The specification of a search over lens structures, and the search as it is started or resumed.

use super::finalize::LensFinalizer;
use super::history::SearchHistory;
use crate::files::CheckpointError;
use crate::lens::Lens;
use crate::merit::{ConstraintMargin, Goal};
use crate::search::lens_landscape::{
    DescentSettings, LandscapeError, LensLandscape, SearchPlan, with_open_apertures,
};
use crate::search::{
    SEARCH_CHECKPOINT, SearchError, SearchEvent, SearchRules, SearchRun, SearchRunOn,
    SearchSettings, SteerCommand,
};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::Path;

/// A specification of a search over lens structures.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StructureSearchRequest {
    /// The rules, the merit function and the settings of the search.
    pub plan: SearchPlan,
    /// True if every curvature and thickness is variable, whatever the variables of the design.
    pub free: bool,
    /// The semi-diameter, in mm, to which smaller apertures are opened first; `None` leaves them. It
    /// is also the upper limit of semi-diameters, unless the rules have another one.
    pub open: Option<f64>,
    /// The limit of the computing time, in minutes; `None` for no limit.
    pub minutes: Option<f64>,
}

/// The reasons why a search cannot start or resume.
#[derive(Debug, thiserror::Error)]
pub(super) enum StructureSearchError {
    #[error(transparent)]
    Landscape(#[from] LandscapeError),
    #[error(transparent)]
    Search(#[from] SearchError),
    #[error("{file}: no checkpoint of a search over lenses: {what}")]
    Foreign { file: String, what: String },
}

/// The state of a session that is saved beside a search: the curve and the time so far. The search
/// itself does not depend on it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub(super) struct CheckpointSidecar {
    /// The limit of the computing time, in minutes; `None` for no limit.
    pub(super) minutes: Option<f64>,
    /// The computing time so far, in seconds.
    pub(super) seconds: f64,
    /// The number of gradients in that time.
    pub(super) gradients: u64,
    /// The history of the merit, with every mutation.
    pub(super) history: SearchHistory,
}

impl CheckpointSidecar {
    /// The limit of the computing time; `None` once it is used up, so that a resumed search continues.
    pub(super) fn remaining_minutes(&self) -> Option<f64> {
        self.minutes.filter(|minutes| self.seconds < 60.0 * minutes)
    }
}

/// The content of a checkpoint that specifies the search.
#[derive(Deserialize)]
struct SavedSearch {
    landscape: SavedLandscape,
    run: SavedRun,
    /// Data of the session; null if the command line saved the search.
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

/// A run of the sampler with its landscape.
pub(super) struct LensSearch {
    landscape: LensLandscape,
    pub(super) run: SearchRunOn<LensLandscape>,
}

impl LensSearch {
    /// A new search from a lens.
    pub(super) fn new(
        lens: &Lens,
        request: &StructureSearchRequest,
    ) -> Result<Self, StructureSearchError> {
        let mut start = lens.clone();
        let mut plan = request.plan.clone();
        if request.free {
            start.variables.clear();
        }
        if let Some(limit) = request.open {
            start = with_open_apertures(&start, limit);
            plan.rules.semi_diameter = plan.rules.semi_diameter.or(request.open);
        }
        let landscape = plan.landscape(&start)?;
        let settings = plan.settings(&landscape);
        let run = SearchRun::new(&landscape, landscape.start().clone(), &settings)?;
        Ok(Self { landscape, run })
    }

    /// The search of a checkpoint, its specification, and what was saved beside it.
    pub(super) fn resume(
        path: &Path,
    ) -> Result<(Self, StructureSearchRequest, CheckpointSidecar), StructureSearchError> {
        let SavedSearch { landscape, run: SavedRun { settings }, beside } = read(path)?;
        // A history that cannot be read is no reason to lose the search.
        let sidecar: CheckpointSidecar = serde_json::from_value(beside).unwrap_or_default();
        let SavedLandscape { start, goal, rules, local, light } = landscape;
        let landscape =
            LensLandscape::new(&start, &goal, &rules, &local)?.with_reference_light(light)?;
        let run = SearchRun::load(&landscape, &settings, path)?;
        let plan = SearchPlan { goal: Some(goal), rules, local, settings, ..SearchPlan::default() };
        let minutes = sidecar.remaining_minutes();
        let request = StructureSearchRequest { plan, minutes, ..StructureSearchRequest::default() };
        Ok((Self { landscape, run }, request, sidecar))
    }

    /// One turn of every chain.
    pub(super) fn round(&mut self) -> Vec<SearchEvent> {
        self.run.round(&self.landscape)
    }

    pub(super) fn control(&mut self, command: SteerCommand) -> Result<(), SearchError> {
        self.run.steer(&self.landscape, command)
    }

    pub(super) fn save(&self, path: &Path, sidecar: &CheckpointSidecar) -> Result<(), SearchError> {
        let beside = serde_json::to_value(sidecar).unwrap_or_default();
        self.run.save_with_sidecar(&self.landscape, path, &beside)
    }

    pub(super) fn finalizer(&self) -> LensFinalizer {
        LensFinalizer::new(self.landscape.clone())
    }

    /// The number of rays of a gradient of the best lens.
    pub(super) fn rays_per_gradient(&self) -> usize {
        self.landscape.rays_per_gradient(&self.run.best().point)
    }

    /// The constraints that a lens violates.
    pub(super) fn violations(&self, lens: &Lens) -> Vec<ConstraintMargin> {
        // A lens that cannot be set up does not occur in a run.
        self.landscape.violations(lens).unwrap_or_default()
    }
}

fn read(path: &Path) -> Result<SavedSearch, StructureSearchError> {
    SEARCH_CHECKPOINT.read(path).map_err(|error| match error {
        CheckpointError::Corrupt { file, what } => StructureSearchError::Foreign { file, what },
        error => SearchError::from(error).into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_of_time_that_is_used_up_no_longer_counts() {
        let remaining = |minutes, seconds| {
            CheckpointSidecar { minutes, seconds, ..CheckpointSidecar::default() }
                .remaining_minutes()
        };
        assert_eq!(remaining(Some(2.0), 119.0), Some(2.0));
        assert_eq!(remaining(Some(2.0), 121.0), None);
        assert_eq!(remaining(None, 5.0), None);
    }
}
