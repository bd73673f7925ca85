//! A search of a lens, described by one value and run by one call.

use super::{DescentSettings, LandscapeError, LensLandscape, violations};
use crate::files::CheckpointError;
use crate::lens::Lens;
use crate::merit::{DerivativeLevel, Goal, Term, WeightedTerm};
use crate::optimize::DescentMethod;
use crate::search::{
    MutationKind, SEARCH_CHECKPOINT, SearchError, SearchEvent, SearchMethod, SearchRules,
    SearchRun, SearchRunOn, SearchSettings, Temperature,
};
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;
use std::path::Path;

/// Everything that a search of a lens depends on besides the lens.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SearchPlan {
    /// The goal; `None` for the default one, [`Goal::with_limits`].
    pub goal: Option<Goal>,
    /// The target focal length of the default goal, in mm; `None` for that of the lens.
    pub focal_length: Option<f64>,
    /// The share of its light that every field keeps under the default goal: one share for all
    /// fields, or one for each.
    pub light: Vec<f64>,
    /// Permitted changes and the limits of manufacturing.
    pub rules: SearchRules,
    /// Settings of the local moves.
    pub local: DescentSettings,
    /// Settings of the search.
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

/// The reasons that a search cannot be set up.
#[derive(Debug, thiserror::Error)]
pub enum SearchSetupError {
    /// The lens, the goal or the rules are invalid.
    #[error(transparent)]
    Landscape(#[from] LandscapeError),
    /// The settings or the checkpoint are invalid.
    #[error(transparent)]
    Search(#[from] SearchError),
}

/// Says which terms of the merit function of a design a search leaves out; `None` if it has all.
pub fn describe_left_out(terms: &[&str]) -> Option<String> {
    (!terms.is_empty()).then(|| {
        let names = terms.join(", ").replace('_', " ");
        format!(
            "the search leaves out what the merit function asks of some surfaces or fields only: {names}"
        )
    })
}

impl SearchPlan {
    /// The landscape of the search.
    ///
    /// # Errors
    /// The lens has no merit or no light, rules or settings are invalid, or no lens can satisfy the
    /// constraints.
    pub fn landscape(&self, lens: &Lens) -> Result<LensLandscape, LandscapeError> {
        let (common, each) = match self.light[..] {
            [share] => (share, &[][..]),
            _ => (1.0, &self.light[..]),
        };
        let rules = self.rules.normalize()?;
        let limits = rules.goal_limits();
        let usual = || Goal::with_limits(lens, &limits, self.focal_length, common);
        let goal = self.goal.clone().map_or_else(usual, Ok)?;
        let landscape =
            LensLandscape::new(lens, &goal, &rules, &self.local)?.with_field_light(each)?;
        landscape.check_feasible()?;
        let start = landscape.with_variables(landscape.start());
        let merit = landscape.merit(&start, self.local.tolerance)?;
        if merit.is_dark() {
            return Err(LandscapeError::NoLight);
        }
        // Without the gradient of its start a search would only try mutations for ever.
        merit.evaluate(&merit.values(&start), DerivativeLevel::Gradient)?;
        Ok(landscape)
    }

    /// The goal of a search from a design with a merit function of its own, and the names of its terms
    /// that a search cannot have. Of each limit of the merit function and of the plan the tighter one
    /// counts.
    ///
    /// # Errors
    /// Invalid rules, or a lens without first-order data.
    pub fn goal_of_design(
        &self,
        lens: &Lens,
        own: &Goal,
    ) -> Result<(Goal, Vec<&'static str>), LandscapeError> {
        let share = if let [share] = self.light[..] { share } else { 1.0 };
        let rules = self.rules.normalize()?;
        let usual = Goal::with_limits(lens, &rules.goal_limits(), self.focal_length, share)?;
        let (mut terms, left_out): (Vec<WeightedTerm>, Vec<WeightedTerm>) =
            own.terms.iter().copied().partition(violations::is_of_whole_lens);
        for asked in usual.terms.into_iter().filter(|weighted| weighted.term.is_limit()) {
            let name = asked.term.name();
            let known = terms.iter_mut().find(|w| w.term.name() == name && w.scope.is_all());
            match known {
                Some(known) => known.term = self.tighter(known.term, asked.term),
                None => terms.push(asked),
            }
        }
        let zoom_ratios = own.zoom_ratios.clone();
        let goal = Goal { terms, pupil: usual.pupil, zoom_ratios, limits: usual.limits };
        Ok((goal, left_out.iter().map(|weighted| weighted.term.name()).collect()))
    }

    /// The tighter of two limits of one kind; of targets the design's, unless the plan has its own.
    fn tighter(&self, own: Term, asked: Term) -> Term {
        use Term::{AirCenter, AirEdge, BackFocus, GlassCenter, GlassEdge, Steepness};
        match (own, asked) {
            (Term::FocalLength(_), _) if self.focal_length.is_some() => asked,
            (Term::Light(_), _) if self.light != [1.0] => asked,
            (GlassCenter { min, max }, GlassCenter { min: low, max: high }) => {
                GlassCenter { min: min.max(low), max: max.min(high) }
            }
            (AirCenter { min, max }, AirCenter { min: low, max: high }) => {
                AirCenter { min: min.max(low), max: max.min(high) }
            }
            (Term::SemiDiameter { min, max }, Term::SemiDiameter { min: low, max: high }) => {
                Term::SemiDiameter { min: min.max(low), max: max.min(high) }
            }
            (GlassEdge(min), GlassEdge(low)) => GlassEdge(min.max(low)),
            (AirEdge(min), AirEdge(low)) => AirEdge(min.max(low)),
            (Steepness(max), Steepness(high)) => Steepness(max.min(high)),
            (Term::TotalTrack(max), Term::TotalTrack(high)) => Term::TotalTrack(max.min(high)),
            (BackFocus(min), BackFocus(low)) => BackFocus(min.max(low)),
            _ => own,
        }
    }

    /// The landscape of the search, and the run before its first round.
    ///
    /// # Errors
    /// Those of [`SearchPlan::landscape`], and a start without a finite loss.
    pub fn begin(
        &self,
        lens: &Lens,
    ) -> Result<(LensLandscape, SearchRunOn<LensLandscape>), SearchSetupError> {
        let landscape = self.landscape(lens)?;
        let start = landscape.start().clone();
        let run = SearchRun::new(&landscape, start, &self.settings(&landscape))?;
        Ok((landscape, run))
    }

    /// The method of the local moves of a checkpoint, and its sampler.
    ///
    /// # Errors
    /// The file cannot be read, or is no checkpoint of a search over lenses.
    pub fn stored_methods(path: &Path) -> Result<(DescentMethod, SearchMethod), CheckpointError> {
        let stored: StoredSearch = SEARCH_CHECKPOINT.read(path)?;
        Ok((stored.landscape.local.method, stored.run.settings.method))
    }

    /// The run of a checkpoint, which keeps its temperature if none is given.
    ///
    /// # Errors
    /// Those of [`SearchRun::load`].
    pub fn resume(
        &self,
        landscape: &LensLandscape,
        path: &Path,
    ) -> Result<SearchRunOn<LensLandscape>, SearchError> {
        let temperature = self.settings.temperature;
        let settings = SearchSettings { temperature, ..self.settings(landscape) };
        SearchRun::load(landscape, &settings, path)
    }

    /// The settings, with the default temperature of the landscape if none is given, and without
    /// random draws if the rules exclude them.
    pub fn settings(&self, landscape: &LensLandscape) -> SearchSettings {
        let usual = || Temperature::at_half_density(landscape.loss_scale());
        let temperature = self.settings.temperature.unwrap_or_else(usual);
        let forbidden = self.rules.weight(MutationKind::Global) == 0.0;
        let gamma = if forbidden { 0.0 } else { self.settings.gamma };
        SearchSettings { temperature: Some(temperature), gamma, ..self.settings.clone() }
    }
}

/// The part of a checkpoint that tells its methods.
#[derive(Deserialize)]
struct StoredSearch {
    landscape: StoredLandscape,
    run: StoredRun,
}

#[derive(Deserialize)]
struct StoredRun {
    settings: SearchSettings,
}

#[derive(Deserialize)]
struct StoredLandscape {
    local: DescentSettings,
}

/// Searches from a lens until the run ends or `watch` breaks, which is called after every round.
///
/// # Errors
/// The lens has no merit, or rules or settings are invalid.
pub fn run(
    lens: &Lens,
    plan: &SearchPlan,
    mut watch: impl FnMut(&SearchRunOn<LensLandscape>, &[SearchEvent]) -> ControlFlow<()>,
) -> Result<SearchRunOn<LensLandscape>, SearchSetupError> {
    let (landscape, mut run) = plan.begin(lens)?;
    match run.advance(&landscape, &mut watch) {
        ControlFlow::Continue(_) | ControlFlow::Break(()) => Ok(run),
    }
}
