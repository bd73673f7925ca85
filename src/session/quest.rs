//! A search over structure as a person asks for it: what it may do, how it goes, how long.

use crate::files::FileError;
use crate::lens::Lens;
use crate::merit::{Goal, Term};
use crate::search::lens::{LensLandscape, Local, NoLandscape, goal, opened};
use crate::search::{self, Rules, Run, RunOf, SearchError, Settings, Steer};
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::Path;

/// What a search over structure is asked for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Quest {
    /// The sampler, its chains, its chance and its end.
    pub settings: Settings,
    /// What may become of a lens, and what a factory can make.
    pub rules: Rules,
    /// How a lens descends.
    pub local: Local,
    /// The focal length that is asked for, in mm; none for that of the lens.
    pub focal_length: Option<f64>,
    /// The least share of the light at the start, at every field.
    pub light: f64,
    /// Rims are opened up to this semi-diameter first, in mm; none leaves them.
    pub open: Option<f64>,
    /// The search ends after so many minutes of work; none for no limit.
    pub minutes: Option<f64>,
}

impl Default for Quest {
    fn default() -> Self {
        Self {
            settings: Settings { gradients: None, ..Settings::default() },
            rules: Rules::default(),
            local: Local::default(),
            focal_length: None,
            light: 1.0,
            open: None,
            minutes: None,
        }
    }
}

/// What searches: the engine, or what a test puts in its place.
pub(super) trait Explores: Send {
    fn run(&self) -> &RunOf<LensLandscape>;
    fn round(&mut self) -> Vec<search::Event>;
    fn steer(&mut self, steer: Steer) -> Result<(), SearchError>;
    fn save(&self, path: &Path) -> Result<(), SearchError>;
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
}

#[derive(Deserialize)]
struct KeptLandscape {
    start: Lens,
    goal: Goal,
    rules: Rules,
    local: Local,
}

#[derive(Deserialize)]
struct KeptRun {
    settings: Settings,
}

impl Engine {
    /// A search from a lens.
    pub(super) fn begin(lens: &Lens, quest: &Quest) -> Result<Self, NoQuest> {
        let Quest { settings, rules, local, focal_length, light, open, .. } = quest;
        let opened = open.map(|limit| opened(lens, limit));
        let lens = opened.as_ref().unwrap_or(lens);
        let goal = goal(lens, rules, *focal_length, *light)?;
        let landscape = LensLandscape::new(lens, &goal, rules, local)?;
        let run = Run::new(&landscape, landscape.start().clone(), settings)?;
        Ok(Self { landscape, run })
    }

    /// The search that a checkpoint holds, and what it was asked for.
    pub(super) fn go_on(path: &Path) -> Result<(Self, Quest), NoQuest> {
        let Kept { landscape: kept, run: KeptRun { settings } } = read(path)?;
        let landscape = LensLandscape::new(&kept.start, &kept.goal, &kept.rules, &kept.local)?;
        let run = Run::load(&landscape, &settings, path)?;
        let light = kept.goal.terms.iter().find_map(|weighted| match weighted.term {
            Term::Light(share) => Some(share),
            _ => None,
        });
        let quest = Quest {
            settings,
            rules: kept.rules,
            local: kept.local,
            light: light.unwrap_or(0.0),
            ..Quest::default()
        };
        Ok((Self { landscape, run }, quest))
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

    fn save(&self, path: &Path) -> Result<(), SearchError> {
        self.run.save(&self.landscape, path)
    }
}
