//! A search over structure as it is shown: where its chains are, what it keeps, where every lens
//! came from.

use super::judged::ScoredLens;
use super::moments::SearchHistory;
use super::quest::StructureSearchRequest;
use super::worker::RunStatus;
use crate::lens::Lens;
use crate::merit::ConstraintMargin;
use crate::search::element::piece_count;
use crate::search::lens_landscape::LensLandscape;
use crate::search::{
    Chain, LineageNode, MutationWeights, ReservoirEntry, RunEnd, SearchRunOn, SearchStatistics,
    Temperature,
};
use std::path::PathBuf;
use std::sync::Arc;

/// A search over structure on its way, or as it was left.
#[derive(Debug, Clone)]
pub struct StructureSearchSnapshot {
    /// Which of the session it is, counted from 1.
    pub number: u64,
    /// How it stands.
    pub status: RunStatus,
    /// What it was asked for.
    pub request: Arc<StructureSearchRequest>,
    /// The lens from which it began, limited by its stop.
    pub start: Arc<FoundLens>,
    /// The best lens so far, those of descents that go on included; these are not judged yet.
    pub best: Arc<FoundLens>,
    /// The lenses that it keeps and mutates, best first.
    pub reservoir: Vec<Arc<FoundLens>>,
    /// The generation that all new descents begin from; none where they begin from any lens kept.
    pub pinned: Option<u64>,
    /// Where each chain is; none while one looks for its next start.
    pub chains: Vec<Option<ChainPosition>>,
    /// What it has done so far.
    pub statistics: SearchStatistics,
    /// The present temperature.
    pub temperature: Temperature,
    /// How often each kind of mutation is tried, relatively to the rules.
    pub weights: MutationWeights,
    /// The merit so far, and every mutation.
    pub history: Arc<SearchHistory>,
    /// The family tree as far as it is remembered, in the order of generations.
    pub lineage: Vec<Arc<LineageNode<Arc<Lens>>>>,
    /// Why it is over, where it ended by itself.
    pub end_reason: Option<EndReason>,
    /// The time that it has worked in the window, in seconds.
    pub seconds: f64,
    /// The gradients of that time: a search may have gone on from the file of another program.
    pub gradients: u64,
    /// The rays of a gradient of the best lens.
    pub rays: usize,
    /// The limits that the start breaks.
    pub start_violations: Vec<ConstraintMargin>,
    /// Those that the best lens breaks, as it was a few seconds ago.
    pub best_violations: Vec<ConstraintMargin>,
    /// Where it is saved.
    pub checkpoint: CheckpointStatus,
}

/// Why a search over structure is over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EndReason {
    /// As the sampler says.
    Sampler(RunEnd),
    /// It has worked for as long as was asked for.
    TimeLimit,
}

/// Where a search is saved, and how that went.
#[derive(Debug, Clone, Default)]
pub struct CheckpointStatus {
    /// The file; none for a search that is not saved.
    pub path: Option<PathBuf>,
    /// The local moves that the file holds; none before it was written.
    pub moves: Option<u64>,
    /// Why it could not be written the last time.
    pub error: Option<String>,
}

/// A lens that was found.
#[derive(Debug, Clone)]
pub struct FoundLens {
    /// Its generation in the family tree.
    pub number: u64,
    /// What the search thinks of it; less is better.
    pub merit: f64,
    /// How many pieces of glass it has.
    pub elements: usize,
    /// The lens.
    pub lens: Arc<Lens>,
    /// Its sharpness and light; none for one that still descends.
    pub score: Option<ScoredLens>,
}

/// Where a chain is.
#[derive(Debug, Clone)]
pub struct ChainPosition {
    /// The generation that it descends from.
    pub number: u64,
    /// The merit there.
    pub merit: f64,
    /// How many pieces of glass the lens has there.
    pub elements: usize,
    /// The lens.
    pub lens: Arc<Lens>,
}

impl StructureSearchSnapshot {
    /// What is known of a run before its first round.
    pub(super) fn new(
        number: u64,
        quest: StructureSearchRequest,
        run: &SearchRunOn<LensLandscape>,
        path: Option<PathBuf>,
    ) -> Self {
        let start = Arc::new(FoundLens::from_entry(run.start()).scored());
        let mut exploration = Self {
            number,
            status: RunStatus::Running,
            request: Arc::new(quest),
            best: Arc::clone(&start),
            start,
            reservoir: Vec::new(),
            pinned: None,
            chains: Vec::new(),
            statistics: SearchStatistics::default(),
            temperature: run.temperature(),
            weights: MutationWeights::default(),
            history: Arc::default(),
            lineage: Vec::new(),
            end_reason: None,
            seconds: 0.0,
            gradients: 0,
            rays: 0,
            start_violations: Vec::new(),
            best_violations: Vec::new(),
            checkpoint: CheckpointStatus { path, ..CheckpointStatus::default() },
        };
        exploration.update(run);
        exploration
    }

    /// Whether it goes on or can.
    pub fn is_active(&self) -> bool {
        self.status.is_active()
    }

    /// The part that is done, 0 to 1, where there is a limit.
    pub fn fraction_done(&self) -> Option<f64> {
        let settings = &self.request.plan.settings;
        let part = |limit: Option<u64>, count: u64| Some(count as f64 / limit?.max(1) as f64);
        let parts = [
            part(settings.moves, self.statistics.moves),
            part(settings.gradients, self.statistics.gradients),
            self.request.minutes.map(|minutes| self.seconds / (60.0 * minutes)),
        ];
        let most = parts.into_iter().flatten().fold(f64::NEG_INFINITY, f64::max);
        most.is_finite().then(|| most.min(1.0))
    }

    /// The lens of a generation, if it is remembered.
    pub fn lens_by_number(&self, number: u64) -> Option<&Arc<Lens>> {
        let found = self.reservoir.iter().chain([&self.best]).find(|found| found.number == number);
        found.map(|found| &found.lens).or_else(|| Some(&self.node(number)?.point))
    }

    /// A generation, if it is remembered.
    pub fn node(&self, number: u64) -> Option<&Arc<LineageNode<Arc<Lens>>>> {
        let place = self.lineage.binary_search_by_key(&number, |node| node.number).ok()?;
        self.lineage.get(place)
    }

    /// A generation and its ancestors, youngest first, as far as they are remembered.
    pub fn ancestry(&self, number: u64) -> impl Iterator<Item = &Arc<LineageNode<Arc<Lens>>>> {
        let parent = |node: &&Arc<LineageNode<Arc<Lens>>>| self.node(node.parent?);
        std::iter::successors(self.node(number), parent)
    }

    /// Takes over how a run stands.
    pub(super) fn update(&mut self, run: &SearchRunOn<LensLandscape>) {
        self.statistics = run.statistics().clone();
        self.temperature = run.temperature();
        self.weights = run.weights().clone();
        self.pinned = run.pinned().map(|entry| entry.number);
        self.chains = positions(run);
        self.update_retained(run);
        self.update_lineage(run);
    }

    /// The reservoir, whose new lenses are judged, and the best lens.
    fn update_retained(&mut self, run: &SearchRunOn<LensLandscape>) {
        let known = |entry: &ReservoirEntry<Lens>| {
            let mut known = self.reservoir.iter().chain([&self.start, &self.best]);
            let same = |found: &&Arc<FoundLens>| found.matches(entry) && found.score.is_some();
            known.find(same).cloned()
        };
        let kept = |entry: &ReservoirEntry<Lens>| {
            known(entry).unwrap_or_else(|| Arc::new(FoundLens::from_entry(entry).scored()))
        };
        let mut reservoir: Vec<_> = run.reservoir().entries().iter().map(kept).collect();
        reservoir.sort_by(|a, b| a.merit.total_cmp(&b.merit));
        self.reservoir = reservoir;
        if let Some(same) = self.reservoir.iter().find(|found| found.matches(run.best())) {
            self.best = Arc::clone(same);
        } else if !self.best.matches(run.best()) {
            self.best = Arc::new(FoundLens::from_entry(run.best()));
        }
    }

    /// The family tree; generations that have ended stay what they are.
    fn update_lineage(&mut self, run: &SearchRunOn<LensLandscape>) {
        let old = std::mem::take(&mut self.lineage);
        let known = |number: u64| {
            let place = old.binary_search_by_key(&number, |node| node.number).ok()?;
            old.get(place).filter(|node| node.ended.is_some()).cloned()
        };
        let nodes = run.lineage().nodes().iter();
        let family =
            nodes.map(|node| known(node.number).unwrap_or_else(|| Arc::new(to_shared(node))));
        self.lineage = family.collect();
    }
}

/// Where each chain of a run is.
fn positions(run: &SearchRunOn<LensLandscape>) -> Vec<Option<ChainPosition>> {
    let place = |chain: &Chain<Lens, _>| {
        let (lens, merit) = chain.position()?;
        let (number, elements) = (chain.generation(), piece_count(lens));
        Some(ChainPosition { number, merit, elements, lens: Arc::new(lens.clone()) })
    };
    run.chains().iter().map(place).collect()
}

/// A generation whose lens can be shared.
fn to_shared(node: &LineageNode<Lens>) -> LineageNode<Arc<Lens>> {
    LineageNode {
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

impl FoundLens {
    fn from_entry(entry: &ReservoirEntry<Lens>) -> Self {
        Self {
            number: entry.number,
            merit: entry.loss,
            elements: piece_count(&entry.point),
            lens: Arc::new(entry.point.clone()),
            score: None,
        }
    }

    fn scored(mut self) -> Self {
        self.score = Some(ScoredLens::new(Arc::clone(&self.lens)));
        self
    }

    fn matches(&self, entry: &ReservoirEntry<Lens>) -> bool {
        self.number == entry.number && self.merit == entry.loss
    }
}
