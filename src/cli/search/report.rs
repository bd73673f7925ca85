//! The report of a search: results, reservoir, statistics and cost.

use super::SearchEnd;
use super::limits::ViolatedLimit;
use super::result::{FinishedReport, StartAgainstBest};
use crate::cli::effects::EffectReport;
use crate::cli::error::CliError;
use crate::cli::output::{ShortNumber, TextTable, write_saved};
use crate::lens::Lens;
use crate::merit::ConstraintMargin;
use crate::search::lens_landscape::{FinalizedLens, LensLandscape};
use crate::search::{FoundPoint, Landscape as _, MutationStatistics, RunEnd, SearchRunOn};
use serde::Serialize;
use std::fmt::{self, Display};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Everything that the report is made from.
pub(super) struct SearchResults<'a> {
    pub(super) landscape: &'a LensLandscape,
    pub(super) run: &'a SearchRunOn<LensLandscape>,
    /// The best lens, which keeps every limit if one near it does.
    pub(super) best: &'a Arc<Lens>,
    pub(super) ended: SearchEnd,
    pub(super) resumed: bool,
    /// The reason why a resumed run had nothing to do.
    pub(super) idle: Option<String>,
    pub(super) ms: f64,
    /// The gradients since it began or was resumed.
    pub(super) gradients: u64,
    /// The constraints that the start violates.
    pub(super) start_breaks: Vec<ConstraintMargin>,
    pub(super) compared: StartAgainstBest,
    pub(super) compared_ms: f64,
    pub(super) stored: Vec<PathBuf>,
    pub(super) stale: Vec<PathBuf>,
    pub(super) out: Option<&'a Path>,
    /// The best lens, if it could not be saved.
    pub(super) unsaved: Option<Lens>,
    pub(super) finished: Option<FinalizedLens>,
    pub(super) effects: EffectReport,
}

/// The printed result.
#[derive(Serialize)]
pub(super) struct SearchReport {
    ended: SearchEnd,
    resumed: bool,
    nothing_to_do: Option<String>,
    seed: u64,
    ms: f64,
    gradients: u64,
    gradients_in_all: u64,
    gradients_beside: u64,
    /// The largest number of aspheric surfaces.
    aspheres: usize,
    moves: u64,
    better: u64,
    generations: u64,
    rays_of_a_gradient: usize,
    temperature: f64,
    merit_start: f64,
    merit_best: f64,
    start_breaks: Vec<ViolatedLimit>,
    #[serde(flatten)]
    compared: StartAgainstBest,
    figures_ms: f64,
    reservoir: Vec<ReservoirRow>,
    mutations: Vec<MutationRow>,
    #[serde(flatten)]
    effects: EffectReport,
    ended_by: std::collections::BTreeMap<crate::search::DescentEnd, u64>,
    files: Vec<PathBuf>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    stale: Vec<PathBuf>,
    finished: Option<FinishedReport>,
    out: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    lens: Option<Lens>,
}

#[derive(Serialize)]
struct ReservoirRow {
    generation: u64,
    merit: f64,
    topology: String,
    running: bool,
}

#[derive(Serialize)]
struct MutationRow {
    kind: &'static str,
    #[serde(flatten)]
    tally: MutationStatistics,
}

impl SearchReport {
    pub(super) fn new(searched: SearchResults<'_>) -> Self {
        let SearchResults { landscape, run, ended, resumed, idle, ms, gradients, .. } = searched;
        let statistics = run.statistics();
        let row = |FoundPoint { entry, running }: FoundPoint<'_, _>| ReservoirRow {
            generation: entry.number,
            // As it is written: moved to where its limits hold.
            merit: landscape.loss(&landscape.settled(&entry.point)),
            topology: entry.topology.clone(),
            running,
        };
        let kinds = statistics.kinds.iter();
        let mutations =
            kinds.map(|(kind, tally)| MutationRow { kind: kind.name(), tally: tally.clone() });
        let finished = searched
            .finished
            .map(|finished| FinishedReport { failures: finished.failures(), finished });
        let merit_best = landscape.loss(searched.best);
        let reservoir = run.found_points().into_iter().map(row).collect();
        Self {
            ended,
            resumed,
            nothing_to_do: idle,
            seed: run.settings().seed,
            ms,
            gradients,
            gradients_in_all: statistics.gradients,
            gradients_beside: statistics.gradients_beside,
            aspheres: landscape.rules().aspheres,
            moves: statistics.moves,
            better: statistics.better,
            generations: run.lineage().total(),
            rays_of_a_gradient: landscape.rays_per_gradient(searched.best),
            temperature: run.temperature().value(),
            merit_start: run.start().loss,
            merit_best,
            start_breaks: ViolatedLimit::all(searched.start_breaks),
            compared: searched.compared,
            figures_ms: searched.compared_ms,
            reservoir,
            mutations: mutations.collect(),
            effects: searched.effects,
            ended_by: statistics.ended.clone(),
            files: searched.stored,
            stale: searched.stale,
            finished,
            out: searched.out.map(|path| path.display().to_string()),
            lens: searched.unsaved,
        }
    }

    /// Fails if the finalized lens violates a constraint.
    pub(super) fn check_finished(&self) -> Result<(), CliError> {
        match &self.finished {
            Some(FinishedReport { failures, .. }) if !failures.is_empty() => {
                Err(CliError::Failed(format!("the lens is not finished: {}", failures.join("; "))))
            }
            _ => Ok(()),
        }
    }
}

/// The reason of an end, as text.
pub(super) fn stop_reason_text(ended: SearchEnd) -> &'static str {
    match ended {
        SearchEnd::Run(RunEnd::Stopped) | SearchEnd::Interrupted => "stopped",
        SearchEnd::Run(RunEnd::Moves | RunEnd::Gradients) => {
            "the maximum number of iterations was reached"
        }
        SearchEnd::Run(RunEnd::Done) => "everything was tried",
        SearchEnd::Run(RunEnd::Stuck) => "no lens was found to continue from",
        SearchEnd::Time => "the time limit was reached",
    }
}

impl Display for SearchReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ended = stop_reason_text(self.ended);
        let Self { gradients, gradients_in_all, moves, better, generations, .. } = self;
        write!(f, "{gradients} gradients of {} rays ", self.rays_of_a_gradient)?;
        writeln!(f, "in {:.2} s: {ended}", 1e-3 * self.ms)?;
        if self.resumed {
            writeln!(f, "{gradients_in_all} gradients in all, since the search began")?;
        }
        if self.gradients_beside > 0 {
            let beside = self.gradients_beside;
            writeln!(f, "{beside} gradients beside them, to choose mutations and to keep limits")?;
        }
        match self.aspheres {
            0 => writeln!(f, "no aspheric surfaces are tried; --aspheres permits some")?,
            count => writeln!(f, "at most {count} aspheric surfaces")?,
        }
        let share = 100.0 * *better as f64 / (*moves).max(1) as f64;
        writeln!(
            f,
            "{moves} moves, {share:.1} % of them better than the start; {generations} generations"
        )?;
        let (start, best) = (ShortNumber(self.merit_start), ShortNumber(self.merit_best));
        if let Some(idle) = &self.nothing_to_do {
            writeln!(f, "{idle}")?;
        }
        writeln!(f, "merit {start} -> {best}\n")?;
        self.compared.write(f)?;
        let rays = self.compared.rays();
        writeln!(f, "these numbers: {rays} rays, {:.1} ms\n", self.figures_ms)?;
        self.compared.write_terms(f)?;
        self.write_reservoir(f)?;
        self.write_mutations(f)?;
        write!(f, "\n{}", self.effects)?;
        if let Some(finished) = &self.finished {
            finished.write(f)?;
        }
        if let Some(first) = self.files.first() {
            let first = first.display();
            writeln!(f, "\n{} retained lenses, the best is {first}", self.files.len())?;
        }
        if self.out.is_some() || self.lens.is_some() {
            writeln!(f)?;
        }
        write_saved(f, self.out.as_deref(), self.lens.as_ref())
    }
}

impl SearchReport {
    fn write_reservoir(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut table = TextTable::new(&["reservoir", "merit", "generation", ""]);
        for ReservoirRow { generation, merit, topology, running } in &self.reservoir {
            let state = if *running { "running, not in it yet" } else { "" };
            let merit = ShortNumber(*merit).to_string();
            table.row([topology.clone(), merit, generation.to_string(), state.to_owned()]);
        }
        writeln!(f, "{table}")
    }

    fn write_mutations(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let head = ["mutation", "tried", "refused", "ended", "better", "retained", "moves each"];
        let mut table = TextTable::new(&head);
        for MutationRow { kind, tally } in &self.mutations {
            let refused: u64 = tally.refused.values().sum();
            let counts = [tally.tried, refused, tally.ended, tally.improved, tally.entered];
            let life = tally.mean_moves().map_or("-".to_owned(), |moves| format!("{moves:.1}"));
            let counts = counts.iter().map(ToString::to_string);
            table.row(std::iter::once((*kind).to_owned()).chain(counts).chain([life]));
        }
        write!(f, "{table}")
    }
}
