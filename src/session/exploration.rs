//! A search over structure as it is shown: where its chains are, what it keeps, where every lens
//! came from.

use super::judged::Judged;
use super::moments::History;
use super::quest::Quest;
use super::worker::Standing;
use crate::lens::Lens;
use crate::merit::Margin;
use crate::search::element::pieces;
use crate::search::lens::LensLandscape;
use crate::search::{Chain, Entry, Node, Over, RunOf, Statistics, Temperature, Weights};
use std::path::PathBuf;
use std::sync::Arc;

/// A search over structure on its way, or as it was left.
#[derive(Debug, Clone)]
pub struct Exploration {
    /// Which of the session it is, counted from 1.
    pub number: u64,
    /// How it stands.
    pub standing: Standing,
    /// What it was asked for.
    pub quest: Arc<Quest>,
    /// The lens from which it began, limited by its stop.
    pub start: Arc<Found>,
    /// The best lens so far, those of descents that go on included; these are not judged yet.
    pub best: Arc<Found>,
    /// The lenses that it keeps and mutates, best first.
    pub reservoir: Vec<Arc<Found>>,
    /// The generation that all new descents begin from; none where they begin from any lens kept.
    pub pinned: Option<u64>,
    /// Where each chain is; none while one looks for its next start.
    pub chains: Vec<Option<Place>>,
    /// What it has done so far.
    pub statistics: Statistics,
    /// The present temperature.
    pub temperature: Temperature,
    /// How often each kind of mutation is tried, relatively to the rules.
    pub weights: Weights,
    /// The merit so far, and every mutation.
    pub history: Arc<History>,
    /// The family tree as far as it is remembered, in the order of generations.
    pub family: Vec<Arc<Node<Arc<Lens>>>>,
    /// Why it is over, where it ended by itself.
    pub over: Option<Ending>,
    /// The time that it has worked in the window, in seconds.
    pub seconds: f64,
    /// The gradients of that time: a search may have gone on from the file of another program.
    pub gradients: u64,
    /// The rays of a gradient of the best lens.
    pub rays: usize,
    /// The limits that the start breaks.
    pub start_breaks: Vec<Margin>,
    /// Those that the best lens breaks, as it was a few seconds ago.
    pub best_breaks: Vec<Margin>,
    /// Where it is saved.
    pub checkpoint: Checkpoint,
}

/// Why a search over structure is over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// As the sampler says.
    Over(Over),
    /// It has worked for as long as was asked for.
    Time,
}

/// Where a search is saved, and how that went.
#[derive(Debug, Clone, Default)]
pub struct Checkpoint {
    /// The file; none for a search that is not saved.
    pub path: Option<PathBuf>,
    /// The local moves that the file holds; none before it was written.
    pub moves: Option<u64>,
    /// Why it could not be written the last time.
    pub failed: Option<String>,
}

/// A lens that was found.
#[derive(Debug, Clone)]
pub struct Found {
    /// Its generation in the family tree.
    pub number: u64,
    /// What the search thinks of it; less is better.
    pub merit: f64,
    /// How many pieces of glass it has.
    pub elements: usize,
    /// The lens.
    pub lens: Arc<Lens>,
    /// Its sharpness and light; none for one that still descends.
    pub judged: Option<Judged>,
}

/// Where a chain is.
#[derive(Debug, Clone)]
pub struct Place {
    /// The generation that it descends from.
    pub number: u64,
    /// The merit there.
    pub merit: f64,
    /// How many pieces of glass the lens has there.
    pub elements: usize,
    /// The lens.
    pub lens: Arc<Lens>,
}

impl Exploration {
    /// What is known of a run before its first round.
    pub(super) fn new(
        number: u64,
        quest: Quest,
        run: &RunOf<LensLandscape>,
        path: Option<PathBuf>,
    ) -> Self {
        let start = Arc::new(Found::of(run.start()).judged());
        let mut exploration = Self {
            number,
            standing: Standing::Running,
            quest: Arc::new(quest),
            best: Arc::clone(&start),
            start,
            reservoir: Vec::new(),
            pinned: None,
            chains: Vec::new(),
            statistics: Statistics::default(),
            temperature: run.temperature(),
            weights: Weights::default(),
            history: Arc::default(),
            family: Vec::new(),
            over: None,
            seconds: 0.0,
            gradients: 0,
            rays: 0,
            start_breaks: Vec::new(),
            best_breaks: Vec::new(),
            checkpoint: Checkpoint { path, ..Checkpoint::default() },
        };
        exploration.look(run);
        exploration
    }

    /// Whether it goes on or can.
    pub fn is_under_way(&self) -> bool {
        self.standing.can_go_on()
    }

    /// The part that is done, 0 to 1, where there is a limit.
    pub fn done(&self) -> Option<f64> {
        let settings = &self.quest.plan.settings;
        let part = |limit: Option<u64>, count: u64| Some(count as f64 / limit?.max(1) as f64);
        let parts = [
            part(settings.moves, self.statistics.moves),
            part(settings.gradients, self.statistics.gradients),
            self.quest.minutes.map(|minutes| self.seconds / (60.0 * minutes)),
        ];
        let most = parts.into_iter().flatten().fold(f64::NEG_INFINITY, f64::max);
        most.is_finite().then(|| most.min(1.0))
    }

    /// The lens of a generation, if it is remembered.
    pub fn lens_of(&self, number: u64) -> Option<&Arc<Lens>> {
        let found = self.reservoir.iter().chain([&self.best]).find(|found| found.number == number);
        found.map(|found| &found.lens).or_else(|| Some(&self.node(number)?.point))
    }

    /// A generation, if it is remembered.
    pub fn node(&self, number: u64) -> Option<&Arc<Node<Arc<Lens>>>> {
        let place = self.family.binary_search_by_key(&number, |node| node.number).ok()?;
        self.family.get(place)
    }

    /// A generation and its ancestors, youngest first, as far as they are remembered.
    pub fn line(&self, number: u64) -> impl Iterator<Item = &Arc<Node<Arc<Lens>>>> {
        let parent = |node: &&Arc<Node<Arc<Lens>>>| self.node(node.parent?);
        std::iter::successors(self.node(number), parent)
    }

    /// Takes over how a run stands.
    pub(super) fn look(&mut self, run: &RunOf<LensLandscape>) {
        self.statistics = run.statistics().clone();
        self.temperature = run.temperature();
        self.weights = run.weights().clone();
        self.pinned = run.pinned().map(|entry| entry.number);
        self.chains = places(run);
        self.keep(run);
        self.remember(run);
    }

    /// The reservoir, whose new lenses are judged, and the best lens.
    fn keep(&mut self, run: &RunOf<LensLandscape>) {
        let known = |entry: &Entry<Lens>| {
            let mut known = self.reservoir.iter().chain([&self.start, &self.best]);
            let same = |found: &&Arc<Found>| found.is(entry) && found.judged.is_some();
            known.find(same).cloned()
        };
        let kept = |entry: &Entry<Lens>| {
            known(entry).unwrap_or_else(|| Arc::new(Found::of(entry).judged()))
        };
        let mut reservoir: Vec<_> = run.reservoir().entries().iter().map(kept).collect();
        reservoir.sort_by(|a, b| a.merit.total_cmp(&b.merit));
        self.reservoir = reservoir;
        if let Some(same) = self.reservoir.iter().find(|found| found.is(run.best())) {
            self.best = Arc::clone(same);
        } else if !self.best.is(run.best()) {
            self.best = Arc::new(Found::of(run.best()));
        }
    }

    /// The family tree; generations that have ended stay what they are.
    fn remember(&mut self, run: &RunOf<LensLandscape>) {
        let old = std::mem::take(&mut self.family);
        let known = |number: u64| {
            let place = old.binary_search_by_key(&number, |node| node.number).ok()?;
            old.get(place).filter(|node| node.ended.is_some()).cloned()
        };
        let nodes = run.tree().nodes().iter();
        let family = nodes.map(|node| known(node.number).unwrap_or_else(|| Arc::new(shown(node))));
        self.family = family.collect();
    }
}

/// Where each chain of a run is.
fn places(run: &RunOf<LensLandscape>) -> Vec<Option<Place>> {
    let place = |chain: &Chain<Lens, _>| {
        let (lens, merit) = chain.place()?;
        let (number, elements) = (chain.number(), pieces(lens));
        Some(Place { number, merit, elements, lens: Arc::new(lens.clone()) })
    };
    run.chains().iter().map(place).collect()
}

/// A generation whose lens can be shared.
fn shown(node: &Node<Lens>) -> Node<Arc<Lens>> {
    Node {
        number: node.number,
        parent: node.parent,
        chain: node.chain,
        kind: node.kind,
        what: node.what.clone(),
        before: node.before,
        mutated: node.mutated,
        descended: node.descended,
        moves: node.moves,
        gradients: node.gradients,
        ended: node.ended,
        offer: node.offer,
        point: Arc::new(node.point.clone()),
    }
}

impl Found {
    fn of(entry: &Entry<Lens>) -> Self {
        Self {
            number: entry.number,
            merit: entry.loss,
            elements: pieces(&entry.point),
            lens: Arc::new(entry.point.clone()),
            judged: None,
        }
    }

    fn judged(mut self) -> Self {
        self.judged = Some(Judged::of(Arc::clone(&self.lens)));
        self
    }

    fn is(&self, entry: &Entry<Lens>) -> bool {
        self.number == entry.number && self.merit == entry.loss
    }
}
