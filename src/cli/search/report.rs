//! What a search prints: the start against the best lens, what there is besides, and what it took.

use super::Ended;
use super::found::{Compared, FinishedKeys};
use super::limits::Broken;
use crate::cli::failure::Failure;
use crate::cli::output::{Number, Table};
use crate::merit::Margin;
use crate::search::lens::{Finished, LensLandscape};
use crate::search::{Found, Over, RunOf, Tally};
use serde::Serialize;
use std::fmt::{self, Display};
use std::path::Path;

/// All that is known after a search.
pub(super) struct Searched<'a> {
    pub(super) landscape: &'a LensLandscape,
    pub(super) run: &'a RunOf<LensLandscape>,
    pub(super) ended: Ended,
    pub(super) resumed: bool,
    /// Why it had nothing to do, if that is so.
    pub(super) idle: Option<String>,
    pub(super) ms: f64,
    /// Gradients since it began or was taken up again.
    pub(super) gradients: u64,
    /// What the start does not keep.
    pub(super) start_breaks: Vec<Margin>,
    pub(super) compared: Compared,
    pub(super) compared_ms: f64,
    pub(super) stored: Vec<String>,
    pub(super) out: Option<&'a Path>,
    pub(super) finished: Option<Finished>,
}

/// What is printed.
#[derive(Serialize)]
pub(super) struct Report {
    ended: Ended,
    resumed: bool,
    nothing_to_do: Option<String>,
    seed: u64,
    ms: f64,
    gradients: u64,
    gradients_in_all: u64,
    moves: u64,
    better: u64,
    generations: u64,
    rays_of_a_gradient: usize,
    temperature: f64,
    merit_start: f64,
    merit_best: f64,
    start_breaks: Vec<Broken>,
    #[serde(flatten)]
    compared: Compared,
    figures_ms: f64,
    reservoir: Vec<Kept>,
    mutations: Vec<Mutations>,
    ended_by: std::collections::BTreeMap<crate::search::Ended, u64>,
    files: Vec<String>,
    finished: Option<FinishedKeys>,
    out: Option<String>,
}

#[derive(Serialize)]
struct Kept {
    generation: u64,
    merit: f64,
    topology: String,
    running: bool,
}

#[derive(Serialize)]
struct Mutations {
    kind: &'static str,
    #[serde(flatten)]
    tally: Tally,
}

impl Report {
    pub(super) fn new(searched: Searched<'_>) -> Self {
        let Searched { landscape, run, ended, resumed, idle, ms, gradients, .. } = searched;
        let statistics = run.statistics();
        let kept = |Found { entry, running }: Found<'_, _>| Kept {
            generation: entry.number,
            merit: entry.loss,
            topology: entry.topology.clone(),
            running,
        };
        let kinds = statistics.kinds.iter();
        let mutations =
            kinds.map(|(kind, tally)| Mutations { kind: kind.name(), tally: tally.clone() });
        let finished = searched
            .finished
            .map(|finished| FinishedKeys { failures: finished.failures(), finished });
        Self {
            ended,
            resumed,
            nothing_to_do: idle,
            seed: run.settings().seed,
            ms,
            gradients,
            gradients_in_all: statistics.gradients,
            moves: statistics.moves,
            better: statistics.better,
            generations: run.tree().born(),
            rays_of_a_gradient: landscape.rays(&run.best().point),
            temperature: run.temperature().value(),
            merit_start: run.start().loss,
            merit_best: run.best().loss,
            start_breaks: Broken::all(searched.start_breaks),
            compared: searched.compared,
            figures_ms: searched.compared_ms,
            reservoir: run.found().into_iter().map(kept).collect(),
            mutations: mutations.collect(),
            ended_by: statistics.ended.clone(),
            files: searched.stored,
            finished,
            out: searched.out.map(|path| path.display().to_string()),
        }
    }

    /// A lens that was to be finished and could not be is a failure.
    pub(super) fn verdict(&self) -> Result<(), Failure> {
        match &self.finished {
            Some(FinishedKeys { failures, .. }) if !failures.is_empty() => {
                Err(Failure::Failed(format!("the lens is not finished: {}", failures.join("; "))))
            }
            _ => Ok(()),
        }
    }
}

/// What ended a search, in words.
pub(super) fn why(ended: Ended) -> &'static str {
    match ended {
        Ended::Run(Over::Stopped) | Ended::Interrupted => "stopped",
        Ended::Run(Over::Moves | Over::Gradients) => "the iterations are used up",
        Ended::Run(Over::Done) => "everything was tried",
        Ended::Run(Over::Stuck) => "nothing was found to go on from",
        Ended::Time => "the time is used up",
    }
}

impl Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ended = why(self.ended);
        let Self { gradients, gradients_in_all, moves, better, generations, .. } = self;
        write!(f, "{gradients} gradients of {} rays ", self.rays_of_a_gradient)?;
        writeln!(f, "in {:.2} s: {ended}", 1e-3 * self.ms)?;
        if self.resumed {
            writeln!(f, "{gradients_in_all} gradients in all, since the search began")?;
        }
        let share = 100.0 * *better as f64 / (*moves).max(1) as f64;
        writeln!(
            f,
            "{moves} moves, {share:.1} % of them better than the start; {generations} generations"
        )?;
        let (start, best) = (Number(self.merit_start), Number(self.merit_best));
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
        if let Some(finished) = &self.finished {
            finished.write(f)?;
        }
        if let Some(first) = self.files.first() {
            writeln!(f, "\n{} lenses that were found, the best is {first}", self.files.len())?;
        }
        match &self.out {
            Some(out) => writeln!(f, "\nsaved as {out}"),
            None => Ok(()),
        }
    }
}

impl Report {
    fn write_reservoir(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut table = Table::new(&["reservoir", "merit", "generation", ""]);
        for Kept { generation, merit, topology, running } in &self.reservoir {
            let state = if *running { "running, not in it yet" } else { "" };
            let merit = Number(*merit).to_string();
            table.row([topology.clone(), merit, generation.to_string(), state.to_owned()]);
        }
        writeln!(f, "{table}")
    }

    fn write_mutations(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let head = ["mutation", "tried", "refused", "ended", "better", "kept", "moves each"];
        let mut table = Table::new(&head);
        for Mutations { kind, tally } in &self.mutations {
            let refused: u64 = tally.refused.values().sum();
            let counts = [tally.tried, refused, tally.ended, tally.improved, tally.entered];
            let life = tally.lifetime().map_or("-".to_owned(), |moves| format!("{moves:.1}"));
            let counts = counts.iter().map(ToString::to_string);
            table.row(std::iter::once((*kind).to_owned()).chain(counts).chain([life]));
        }
        write!(f, "{table}")
    }
}
