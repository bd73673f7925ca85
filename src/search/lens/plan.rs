//! A whole search of a lens, in one call.

use super::{DescentSettings, LandscapeError, LensLandscape, goal};
use crate::lens::Lens;
use crate::merit::Goal;
use crate::search::{
    MutationKind, SearchError, SearchEvent, SearchRules, SearchRun, SearchRunOn, SearchSettings,
    Temperature,
};
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;

/// Everything that a search of a lens depends on besides the lens.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SearchPlan {
    /// What is asked for; none asks for what [`goal()`] does.
    pub goal: Option<Goal>,
    /// The focal length in mm that the usual goal asks for; none for what the lens has.
    pub focal_length: Option<f64>,
    /// How much of its light every field keeps by the usual goal: one share for all, or one for
    /// each field.
    pub light: Vec<f64>,
    /// What may be done, and what a factory can make.
    pub rules: SearchRules,
    /// How lenses descend.
    pub local: DescentSettings,
    /// How the search goes.
    pub settings: SearchSettings,
}

impl Default for SearchPlan {
    fn default() -> Self {
        Self {
            goal: None,
            focal_length: None,
            light: vec![1.0],
            rules: SearchRules::default(),
            local: DescentSettings::default(),
            settings: SearchSettings::default(),
        }
    }
}

/// Why there is no search.
#[derive(Debug, thiserror::Error)]
pub enum SearchSetupError {
    /// The lens, the goal or the rules.
    #[error(transparent)]
    Landscape(#[from] LandscapeError),
    /// The settings, or a checkpoint.
    #[error(transparent)]
    Search(#[from] SearchError),
}

impl SearchPlan {
    /// The landscape that is searched.
    ///
    /// # Errors
    /// A lens without merit, rules or settings without meaning, limits that no lens keeps.
    pub fn landscape(&self, lens: &Lens) -> Result<LensLandscape, LandscapeError> {
        let (common, each) = match self.light[..] {
            [share] => (share, &[][..]),
            _ => (1.0, &self.light[..]),
        };
        let rules = self.rules.normalize()?;
        let usual = || goal(lens, &rules, self.focal_length, common);
        let goal = self.goal.clone().map_or_else(usual, Ok)?;
        let landscape =
            LensLandscape::new(lens, &goal, &rules, &self.local)?.with_field_light(each)?;
        landscape.check_feasible()?;
        Ok(landscape)
    }

    /// The settings, with the temperature that this landscape calls for where none is given, and
    /// without draws from anywhere where the rules forbid them.
    pub fn settings(&self, landscape: &LensLandscape) -> SearchSettings {
        let usual = || Temperature::at_half_density(landscape.loss_scale());
        let temperature = self.settings.temperature.unwrap_or_else(usual);
        let forbidden = self.rules.weight(MutationKind::Global) == 0.0;
        let gamma = if forbidden { 0.0 } else { self.settings.gamma };
        SearchSettings { temperature: Some(temperature), gamma, ..self.settings.clone() }
    }
}

/// Searches from a lens until the settings say that it is over, or `watch` does, which is shown the
/// run after every round.
///
/// # Errors
/// A lens without merit, rules or settings without meaning.
pub fn run(
    lens: &Lens,
    plan: &SearchPlan,
    mut watch: impl FnMut(&SearchRunOn<LensLandscape>, &[SearchEvent]) -> ControlFlow<()>,
) -> Result<SearchRunOn<LensLandscape>, SearchSetupError> {
    let landscape = plan.landscape(lens)?;
    let start = landscape.start().clone();
    let mut run = SearchRun::new(&landscape, start, &plan.settings(&landscape))?;
    while run.end_reason().is_none() {
        let events = run.round(&landscape);
        if watch(&run, &events).is_break() {
            break;
        }
    }
    Ok(run)
}
