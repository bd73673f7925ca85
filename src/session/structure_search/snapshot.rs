//! The state of a search over lens structures that panels read.

use super::history::SearchHistory;
use super::request::StructureSearchRequest;
use crate::lens::Lens;
use crate::merit::ConstraintMargin;
use crate::search::element::piece_count;
use crate::search::lens_landscape::LensLandscape;
use crate::search::{
    Chain, LineageNode, MutationWeights, ReservoirEntry, RunEnd, SearchRunOn, SearchStatistics,
    Temperature,
};
use crate::session::score::ScoredLens;
use std::path::PathBuf;
use std::sync::Arc;

/// The state of a search over lens structures.
#[derive(Debug, Clone)]
pub struct StructureSearchSnapshot {
    /// The specification of the search.
    pub request: Arc<StructureSearchRequest>,
    /// The lens that the search started from, limited by its stop.
    pub start: Arc<FoundLens>,
    /// The best lens so far; one of a descent that still runs has no score yet.
    pub best: Arc<FoundLens>,
    /// The lenses that the search retains and mutates, the best first.
    pub reservoir: Vec<Arc<FoundLens>>,
    /// The generation from which all new descents start; `None` if they start from any retained lens.
    pub pinned: Option<u64>,
    /// The lens of each chain; `None` while a chain looks for its next start.
    pub chains: Vec<Option<Arc<Lens>>>,
    /// The counts of moves, gradients and mutations so far.
    pub statistics: SearchStatistics,
    /// The present temperature.
    pub temperature: Temperature,
    /// The relative frequency of each kind of mutation.
    pub weights: MutationWeights,
    /// The history of the merit, with every mutation.
    pub history: Arc<SearchHistory>,
    /// The lineage as far as it is stored, in the order of generations.
    pub lineage: Vec<Arc<LineageNode<Arc<Lens>>>>,
    /// The reason why the search has ended by itself.
    pub end_reason: Option<EndReason>,
    /// The computing time in the window, in seconds.
    pub seconds: f64,
    /// The number of gradients in that time; a search of the command line may have had more before.
    pub gradients: u64,
    /// The number of rays of a gradient of the best lens.
    pub rays: usize,
    /// The constraints that the first lens violates.
    pub start_violations: Vec<ConstraintMargin>,
    /// The constraints that the best lens of a few seconds ago violates.
    pub best_violations: Vec<ConstraintMargin>,
    /// The file in which the search is saved.
    pub checkpoint: CheckpointStatus,
}

/// The reason why a search has ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EndReason {
    /// The sampler has reached its end.
    Sampler(RunEnd),
    /// The limit of the computing time is reached.
    TimeLimit,
}

/// The file of a search and the outcome of the last save.
#[derive(Debug, Clone, Default)]
pub struct CheckpointStatus {
    /// The file; `None` for a search that is not saved.
    pub path: Option<PathBuf>,
    /// The number of local moves in the file; `None` before it was written.
    pub moves: Option<u64>,
    /// The reason why the last save has failed; of a followed search, why it could not be read.
    pub error: Option<String>,
    /// True if another process runs and saves the search.
    pub is_followed: bool,
}

/// A lens of the search.
#[derive(Debug, Clone)]
pub struct FoundLens {
    /// Its generation in the lineage.
    pub number: u64,
    /// Its merit; less is better.
    pub merit: f64,
    /// Its number of elements.
    pub elements: usize,
    /// The lens.
    pub lens: Arc<Lens>,
    /// Its sharpness and light; `None` for a lens of a descent that still runs.
    pub score: Option<ScoredLens>,
}

impl StructureSearchSnapshot {
    /// The state before the first round.
    pub(super) fn new(
        request: StructureSearchRequest,
        run: &SearchRunOn<LensLandscape>,
        path: Option<PathBuf>,
    ) -> Self {
        let start = Arc::new(FoundLens::from_entry(run.start()).scored());
        let mut exploration = Self {
            request: Arc::new(request),
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

    /// The fraction of the search that is done, 0 to 1; `None` without a limit.
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

    /// The lens of a generation, if it is stored.
    pub fn lens_by_number(&self, number: u64) -> Option<&Arc<Lens>> {
        let found = self.reservoir.iter().chain([&self.best]).find(|found| found.number == number);
        found.map(|found| &found.lens).or_else(|| Some(&self.node(number)?.point))
    }

    /// A generation, if it is stored.
    pub fn node(&self, number: u64) -> Option<&Arc<LineageNode<Arc<Lens>>>> {
        let place = self.lineage.binary_search_by_key(&number, |node| node.number).ok()?;
        self.lineage.get(place)
    }

    /// A generation and its ancestors, the youngest first, as far as they are stored.
    pub fn ancestry(&self, number: u64) -> impl Iterator<Item = &Arc<LineageNode<Arc<Lens>>>> {
        let parent = |node: &&Arc<LineageNode<Arc<Lens>>>| self.node(node.parent?);
        std::iter::successors(self.node(number), parent)
    }

    /// Takes over the state of the sampler.
    pub(super) fn update(&mut self, run: &SearchRunOn<LensLandscape>) {
        self.statistics = run.statistics().clone();
        self.temperature = run.temperature();
        self.weights = run.weights().clone();
        self.pinned = run.pinned().map(|entry| entry.number);
        let lens = |chain: &Chain<_, _>| chain.position().map(|(lens, _)| Arc::clone(lens));
        self.chains = run.chains().iter().map(lens).collect();
        self.update_retained(run);
        self.update_lineage(run);
    }

    /// Takes over the retained lenses, with scores of new ones, and the best lens.
    fn update_retained(&mut self, run: &SearchRunOn<LensLandscape>) {
        let known = |entry: &ReservoirEntry<Arc<Lens>>| {
            let mut known = self.reservoir.iter().chain([&self.start, &self.best]);
            let same = |found: &&Arc<FoundLens>| found.matches(entry) && found.score.is_some();
            known.find(same).cloned()
        };
        let retained = |entry: &ReservoirEntry<Arc<Lens>>| {
            known(entry).unwrap_or_else(|| Arc::new(FoundLens::from_entry(entry).scored()))
        };
        let mut reservoir: Vec<_> = run.reservoir().entries().iter().map(retained).collect();
        reservoir.sort_by(|a, b| a.merit.total_cmp(&b.merit));
        self.reservoir = reservoir;
        if let Some(same) = self.reservoir.iter().find(|found| found.matches(run.best())) {
            self.best = Arc::clone(same);
        } else if !self.best.matches(run.best()) {
            self.best = Arc::new(FoundLens::from_entry(run.best()));
        }
    }

    /// Takes over the lineage; generations whose descents have ended are shared with the state before.
    fn update_lineage(&mut self, run: &SearchRunOn<LensLandscape>) {
        let old = std::mem::take(&mut self.lineage);
        let known = |number: u64| {
            let place = old.binary_search_by_key(&number, |node| node.number).ok()?;
            old.get(place).filter(|node| node.end.is_some()).cloned()
        };
        let nodes = run.lineage().nodes().iter();
        let shared = nodes.map(|node| known(node.number).unwrap_or_else(|| Arc::new(node.clone())));
        self.lineage = shared.collect();
    }
}

impl FoundLens {
    fn from_entry(entry: &ReservoirEntry<Arc<Lens>>) -> Self {
        Self {
            number: entry.number,
            merit: entry.loss,
            elements: piece_count(&entry.point),
            lens: Arc::clone(&entry.point),
            score: None,
        }
    }

    fn scored(mut self) -> Self {
        self.score = Some(ScoredLens::new(Arc::clone(&self.lens)));
        self
    }

    fn matches(&self, entry: &ReservoirEntry<Arc<Lens>>) -> bool {
        self.number == entry.number && self.merit == entry.loss
    }
}
