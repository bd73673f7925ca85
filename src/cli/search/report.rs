//! What a search prints: the start against the best lens, what there is besides, and what it took.

use super::Ended;
use crate::cli::failure::Failure;
use crate::cli::output::{Number, Table, optional};
use crate::search::lens::{FieldFigures, Figures, Finished, LensLandscape};
use crate::search::{Over, RunOf, Tally};
use serde::Serialize;
use std::fmt::{self, Display};
use std::path::Path;

/// All that is known after a search.
pub(super) struct Found<'a> {
    pub(super) landscape: &'a LensLandscape,
    pub(super) run: &'a RunOf<LensLandscape>,
    pub(super) ended: Ended,
    pub(super) resumed: bool,
    pub(super) ms: f64,
    /// Gradients since it began or was taken up again.
    pub(super) gradients: u64,
    /// Of the start and of the best lens.
    pub(super) figures: [Figures; 2],
    pub(super) figures_ms: f64,
    pub(super) stored: Vec<String>,
    pub(super) out: Option<&'a Path>,
    pub(super) finished: Option<Finished>,
}

/// What is printed.
#[derive(Serialize)]
pub(super) struct Report {
    ended: Ended,
    resumed: bool,
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
    start: Figures,
    best: Figures,
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
}

#[derive(Serialize)]
struct Mutations {
    kind: &'static str,
    #[serde(flatten)]
    tally: Tally,
}

#[derive(Serialize)]
struct FinishedKeys {
    failures: Vec<String>,
    #[serde(flatten)]
    finished: Finished,
}

impl Report {
    pub(super) fn new(found: Found<'_>) -> Self {
        let Found { landscape, run, ended, resumed, ms, gradients, .. } = found;
        let statistics = run.statistics();
        let [start, best] = found.figures;
        let mut reservoir: Vec<Kept> = run
            .reservoir()
            .entries()
            .iter()
            .map(|entry| Kept {
                generation: entry.number,
                merit: entry.loss,
                topology: entry.topology.clone(),
            })
            .collect();
        reservoir.sort_by(|a, b| a.merit.total_cmp(&b.merit));
        let kinds = statistics.kinds.iter();
        let mutations =
            kinds.map(|(kind, tally)| Mutations { kind: kind.name(), tally: tally.clone() });
        let finished =
            found.finished.map(|finished| FinishedKeys { failures: finished.failures(), finished });
        Self {
            ended,
            resumed,
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
            start,
            best,
            figures_ms: found.figures_ms,
            reservoir,
            mutations: mutations.collect(),
            ended_by: statistics.ended.clone(),
            files: found.stored,
            finished,
            out: found.out.map(|path| path.display().to_string()),
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

/// µm.
fn spot(field: &FieldFigures) -> [String; 2] {
    let both = |spot: crate::analysis::Estimate| {
        [format!("{:.3}", 1e3 * spot.value), format!("{:.0e}", 1e3 * spot.error)]
    };
    field.spot.map_or(["-".to_owned(), "-".to_owned()], both)
}

impl Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ended = match self.ended {
            Ended::Run(Over::Stopped) | Ended::Interrupted => "stopped",
            Ended::Run(Over::Moves | Over::Gradients) => "the iterations are used up",
            Ended::Run(Over::Done) => "everything was tried",
            Ended::Run(Over::Stuck) => "nothing was found to go on from",
            Ended::Time => "the time is used up",
        };
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
        writeln!(f, "merit {start} -> {best}\n")?;
        self.compare(f)?;
        self.write_reservoir(f)?;
        self.write_mutations(f)?;
        if let Some(finished) = &self.finished {
            finished.write(f)?;
        }
        if let Some(first) = self.files.first() {
            writeln!(f, "\n{} lenses of the reservoir, the best is {first}", self.files.len())?;
        }
        match &self.out {
            Some(out) => writeln!(f, "\nsaved as {out}"),
            None => Ok(()),
        }
    }
}

impl Report {
    /// The start against the best lens.
    fn compare(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (start, best) = (&self.start, &self.best);
        let mut table = Table::new(&[
            "field",
            "spot, um",
            "error",
            "best",
            "error",
            "light, mm^2",
            "error",
            "best",
            "error",
        ]);
        for (before, after) in start.fields.iter().zip(&best.fields) {
            let zoom = if start.focal_lengths.len() > 1 {
                format!(" zoom {}", before.zoom)
            } else {
                String::new()
            };
            let name = if before.x == 0.0 {
                format!("{}{zoom}", Number(before.y))
            } else {
                format!("{}, {}{zoom}", Number(before.x), Number(before.y))
            };
            let light = |field: &FieldFigures| {
                [format!("{:.2}", field.light.value), format!("{:.0e}", field.light.error)]
            };
            let cells = [spot(before), spot(after), light(before), light(after)];
            table.row(std::iter::once(name).chain(cells.into_iter().flatten()));
        }
        write!(f, "{table}")?;
        for (a, b) in start.focal_lengths.iter().zip(&best.focal_lengths) {
            writeln!(f, "focal length {} -> {} mm", optional(*a), optional(*b))?;
        }
        writeln!(f, "track {} -> {} mm", Number(start.track), Number(best.track))?;
        let [from, to] = [start, best].map(|lens| format!("{} ({})", lens.elements, lens.topology));
        writeln!(f, "elements {from} -> {to}")?;
        let rays = start.rays() + best.rays();
        writeln!(f, "these numbers: {rays} rays, {:.1} ms\n", self.figures_ms)
    }

    fn write_reservoir(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut table = Table::new(&["reservoir", "merit", "generation"]);
        for Kept { generation, merit, topology } in &self.reservoir {
            table.row([topology.clone(), Number(*merit).to_string(), generation.to_string()]);
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

impl FinishedKeys {
    fn write(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Finished { glasses, limits, light, figures, confirmed, .. } = &self.finished;
        let verdict = if self.failures.is_empty() { "every limit is kept" } else { "NOT finished" };
        writeln!(f, "\nfinished: {verdict}")?;
        for change in glasses {
            let (nd, vd) = change.was;
            let was = format!("{} {}", Number(nd), optional(vd));
            let (nd, vd) = change.is;
            let is = format!("{} ({} {})", change.glass, Number(nd), Number(vd));
            writeln!(f, "  glass behind surface {}: {was} -> {is}", change.surface)?;
        }
        let head =
            ["field", "spot, um", "error", "other rays", "light, mm^2", "error", "other rays"];
        let mut table = Table::new(&head);
        for (field, other) in figures.fields.iter().zip(confirmed) {
            let name = format!("{} zoom {}", Number(field.y), field.zoom);
            let second = [format!("{:.3}", 1e3 * other.spot), format!("{:.2}", other.light)];
            let light = [format!("{:.2}", field.light.value), format!("{:.0e}", field.light.error)];
            let [spot_second, light_second] = second;
            let cells = spot(field).into_iter().chain([spot_second]).chain(light);
            table.row(std::iter::once(name).chain(cells).chain([light_second]));
        }
        writeln!(f, "{table}")?;
        let mut table = Table::new(&["limit", "surface", "zoom", "value", "min", "max", "margin"]);
        for limit in limits.iter().chain(light) {
            let surface = limit.surface.map_or("-".to_owned(), |i| i.to_string());
            let bounds = [limit.min, limit.max].map(optional);
            let [min, max] = bounds;
            let (value, margin) = (Number(limit.value), format!("{:.4}", limit.room()));
            let start = [limit.term.to_owned(), surface, limit.zoom.to_string(), value.to_string()];
            table.row(start.into_iter().chain([min, max, margin]));
        }
        write!(f, "{table}")
    }
}
