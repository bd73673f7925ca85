//! A search over structure as a person asks for it, and the engine that does it.

use super::diary::Diary;
use super::finishing::Finishing;
use crate::files::FileError;
use crate::lens::Lens;
use crate::merit::{Goal, Margin};
use crate::search::lens::{LensLandscape, Local, NoLandscape, Plan, opened};
use crate::search::{self, Rules, Run, RunOf, SearchError, Settings, Steer};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::fs;
use std::path::Path;

/// What a search over structure is asked for.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Quest {
    /// What it may do, what it aims at, how it goes.
    pub plan: Plan,
    /// Whether every curvature and gap is free, whatever the design says.
    pub free: bool,
    /// Rims are opened up to this semi-diameter first, in mm; none leaves them. No rim grows beyond
    /// it afterwards, where the rules do not say otherwise.
    pub open: Option<f64>,
    /// The search ends after so many minutes of work; none for no limit.
    pub minutes: Option<f64>,
}

/// What searches: the engine, or what a test puts in its place.
pub(super) trait Explores: Send {
    fn run(&self) -> &RunOf<LensLandscape>;
    fn round(&mut self) -> Vec<search::Event>;
    fn steer(&mut self, steer: Steer) -> Result<(), SearchError>;
    fn save(&self, path: &Path, diary: &Diary) -> Result<(), SearchError>;
    /// What makes a lens that can be made of one that was found.
    fn finishing(&self) -> Finishing;
    /// The rays of a gradient of the best lens.
    fn rays(&self) -> usize;
    /// The limits that a lens breaks.
    fn broken(&self, lens: &Lens) -> Vec<Margin>;
}

/// A run on its landscape.
pub(super) struct Engine {
    landscape: LensLandscape,
    run: RunOf<LensLandscape>,
}

/// Why a search cannot begin or go on.
#[derive(Debug, thiserror::Error)]
pub(super) enum NoQuest {
    #[error(transparent)]
    Landscape(#[from] NoLandscape),
    #[error(transparent)]
    Search(#[from] SearchError),
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{file}: no checkpoint of a search over lenses: {what}")]
    Foreign { file: String, what: String },
}

/// What a checkpoint says about the search that it belongs to.
#[derive(Deserialize)]
struct Kept {
    landscape: KeptLandscape,
    run: KeptRun,
    /// None where the search was saved by another program than the window.
    #[serde(default)]
    beside: Value,
}

#[derive(Deserialize)]
struct KeptLandscape {
    start: Lens,
    goal: Goal,
    rules: Rules,
    local: Local,
    light: Vec<Vec<f64>>,
}

#[derive(Deserialize)]
struct KeptRun {
    settings: Settings,
}

impl Engine {
    /// A search from a lens.
    pub(super) fn begin(lens: &Lens, quest: &Quest) -> Result<Self, NoQuest> {
        let mut start = lens.clone();
        let mut plan = quest.plan.clone();
        if quest.free {
            start.variables.clear();
        }
        if let Some(limit) = quest.open {
            start = opened(&start, limit);
            plan.rules.semi_diameter = plan.rules.semi_diameter.or(quest.open);
        }
        let landscape = plan.landscape(&start)?;
        let settings = plan.settings(&landscape);
        let run = Run::new(&landscape, landscape.start().clone(), &settings)?;
        Ok(Self { landscape, run })
    }

    /// The search that a checkpoint holds, what it was asked for, and what was kept beside it.
    pub(super) fn go_on(path: &Path) -> Result<(Self, Quest, Diary), NoQuest> {
        let Kept { landscape: kept, run: KeptRun { settings }, beside } = read(path)?;
        // A curve that cannot be read is no reason to lose the search.
        let diary: Diary = serde_json::from_value(beside).unwrap_or_default();
        let KeptLandscape { start, goal, rules, local, light } = kept;
        let landscape = LensLandscape::new(&start, &goal, &rules, &local)?.comparing_with(light)?;
        let run = Run::load(&landscape, &settings, path)?;
        let plan = Plan { goal: Some(goal), rules, local, settings, ..Plan::default() };
        let quest = Quest { plan, minutes: diary.minutes_left(), ..Quest::default() };
        Ok((Self { landscape, run }, quest, diary))
    }
}

fn read(path: &Path) -> Result<Kept, NoQuest> {
    let file = path.display().to_string();
    let bytes =
        fs::read(path).map_err(|source| FileError::Unreadable { file: file.clone(), source })?;
    serde_json::from_slice(&bytes)
        .map_err(|error| NoQuest::Foreign { file, what: error.to_string() })
}

impl Explores for Engine {
    fn run(&self) -> &RunOf<LensLandscape> {
        &self.run
    }

    fn round(&mut self) -> Vec<search::Event> {
        self.run.round(&self.landscape)
    }

    fn steer(&mut self, steer: Steer) -> Result<(), SearchError> {
        self.run.steer(&self.landscape, steer)
    }

    fn save(&self, path: &Path, diary: &Diary) -> Result<(), SearchError> {
        let beside = serde_json::to_value(diary).unwrap_or_default();
        self.run.save_beside(&self.landscape, path, &beside)
    }

    fn finishing(&self) -> Finishing {
        Finishing::on(self.landscape.clone())
    }

    fn rays(&self) -> usize {
        self.landscape.rays(&self.run.best().point)
    }

    fn broken(&self, lens: &Lens) -> Vec<Margin> {
        // A lens that cannot be set up is nowhere in a run.
        self.landscape.broken(lens).unwrap_or_default()
    }
}
