//! Figure 4.6 and table 4.1: the effect of paraxial projection.
//!
//! The fraction of iterations at which a search is at a lens better than its start, with projected
//! mutations and without projection. Local steps are those of the thesis, by Adam: second-order steps
//! recover nearly any mutant, projected or not. The fraction of mutants counts only iterations after a mutation, not the descent from the start with which every
//! search begins. The fractions of the thesis are listed as well; its steps differ, so that only
//! the order of the two is compared.
//!
//! Fractions of single searches vary between .02 and .9. The difference of the means over the seeds
//! is therefore reported with two standard errors, and a lens whose difference is smaller than these
//! shows no effect. The claims are about the mean over all lenses, and that no lens loses.

use super::recorded_search::{RecordedSearch, RoundRecord, run_to_end};
use super::{STUDY_LENSES, StudyLens, at_heights, mean_and_variance, plan, rules};
use crate::experiments::sharpness_vs_light::ProgressSpan;
use crate::experiments::{
    Claim, DataTable, Effort, Experiment, ExperimentOutcome, ExperimentResult, NamedPlot,
    ProgressFn, TableCell,
};
use crate::optimize::DescentMethod;
use crate::plot::{Axis, BLACK, Canvas, Chart, Color, GREY, Legend, PALETTE, Stroke};
use crate::search::{MutationKind, SearchRules};

pub(in crate::experiments) const EXPERIMENT: Experiment = Experiment {
    id: "4.6",
    title: "Mutations with paraxial projection and without, with table 4.1",
    claim: "With projection a search is more often at a lens that is better than its start",
    omits: "the loss and the step size of the thesis, which are not published: only the order of \
            the fractions is comparable",
    seconds: 540.0,
    run,
};

/// The numbers of gradients after which the fractions are read.
const READ: [u64; 2] = [1000, 5000];

/// `C` of (4.17): a descent at rest at half of the density lasts four moves on average, so that a
/// thousand gradients include mutations.
const C: f64 = 0.15;

/// Table 4.1 of the thesis: for every lens with projection at both numbers of gradients, then
/// without.
const THESIS: [[[f64; 2]; 2]; 4] = [
    [[0.356, 0.358], [0.225, 0.241]],
    [[0.964, 0.972], [0.554, 0.828]],
    [[0.118, 0.424], [0.0, 0.015]],
    [[0.087, 0.281], [0.009, 0.122]],
];

/// The first seed; chosen before any result was known, as was their number.
const FIRST_SEED: u64 = 101;

/// With and without.
const SIDES: [(bool, &str); 2] = [(true, "projection"), (false, "no projection")];

fn run(effort: Effort, progress: &mut ProgressFn<'_>) -> ExperimentResult {
    // A test covers only the lens of the plot, and one number of gradients.
    let lenses = effort.select(0..STUDY_LENSES.len(), 3..STUDY_LENSES.len());
    let (seeds, read) = (effort.select(24, 2), effort.select(&READ[..], &[200]));
    let mut differences = vec![Vec::new(); read.len()];
    let mut outcome = ExperimentOutcome::default();
    let mut table = shares_table();
    let count = lenses.len() as f64;
    for (done, i) in lenses.enumerate() {
        let [from, to] = [done, done + 1].map(|part| part as f64 / count);
        let part = ProgressSpan { from, to, name: STUDY_LENSES[i].name };
        let pair =
            ProjectionComparison::of(STUDY_LENSES[i], seeds, read[read.len() - 1], part, progress)?;
        for (k, gradients) in read.iter().enumerate() {
            differences[k].push(pair.difference(*gradients));
            pair.rows(&mut table, *gradients, THESIS[i].map(|side| side[k]));
        }
        if effort == Effort::Small {
            outcome.claims.push(pair.mutation_claim());
        }
        outcome.rays += pair.sides.iter().flatten().map(RecordedSearch::rays).sum::<usize>();
        if i + 1 == STUDY_LENSES.len() {
            outcome.pictures.push(NamedPlot { name: "telephoto", canvas: pair.draw() });
            outcome.tables.push(pair.moves());
        }
    }
    if effort == Effort::Full {
        let claims = read.iter().zip(&differences).map(|(read, cells)| claims(*read, cells));
        outcome.claims.extend(claims.flatten());
    }
    outcome.tables.insert(0, table);
    Ok(outcome)
}

fn shares_table() -> DataTable {
    let columns = [
        "lens",
        "mutations",
        "gradients",
        "share",
        "least",
        "most",
        "difference",
        "two_standard_errors",
        "effect",
        "thesis",
        "share_of_mutants",
        "generations",
        "best",
    ];
    DataTable::new("shares", &columns)
}

/// The difference of two mean fractions, with two of its standard errors.
#[derive(Debug, Clone, Copy)]
struct ShareDifference {
    mean: f64,
    error: f64,
}

impl ShareDifference {
    /// The effect of projection as far as the seeds show it.
    fn effect(self) -> &'static str {
        if self.mean.abs() <= self.error {
            "none"
        } else if self.mean > 0.0 {
            "more often better"
        } else {
            "less often better"
        }
    }
}

/// The claims about all lenses together after a number of gradients.
fn claims(gradients: u64, cells: &[ShareDifference]) -> [Claim; 2] {
    let count = cells.len() as f64;
    let mean = cells.iter().map(|cell| cell.mean).sum::<f64>() / count;
    let error = cells.iter().map(|cell| cell.error.powi(2)).sum::<f64>().sqrt() / count;
    let worse = cells.iter().filter(|cell| cell.mean < -cell.error).count();
    [
        Claim::at_least(
            format!(
                "share of iterations better than the start after {gradients}, gain by projection, \
                 mean of the lenses"
            ),
            mean,
            0.0,
        )
        .with_error(error),
        Claim::at_most(
            format!("lenses that projection makes worse after {gradients}, beyond their error"),
            worse as f64,
            0.0,
        ),
    ]
}

/// A lens with searches with and without projection, one for each seed.
struct ProjectionComparison {
    subject: StudyLens,
    sides: [Vec<RecordedSearch>; 2],
}

impl ProjectionComparison {
    fn of(
        subject: StudyLens,
        seeds: u64,
        gradients: u64,
        part: ProgressSpan<'_>,
        progress: &mut ProgressFn<'_>,
    ) -> ExperimentResult<Self> {
        let start = at_heights(subject.file)?;
        let mut all = Vec::new();
        for (projection, _) in SIDES {
            let mut plan = plan(&start, SearchRules { projection, ..rules() }, gradients)?;
            for seed in FIRST_SEED..FIRST_SEED + seeds {
                (plan.settings.seed, plan.settings.c) = (seed, C);
                plan.local.method = DescentMethod::Adam;
                all.push(RecordedSearch::new(&start, &plan)?);
            }
        }
        run_to_end(&mut all, part, progress)?;
        let without = all.split_off(seeds as usize);
        Ok(Self { subject, sides: [all, without] })
    }

    /// The mean fraction of a side, and the minimum and maximum of all seeds.
    fn share(&self, side: usize, gradients: u64) -> [f64; 3] {
        let shares: Vec<f64> =
            self.sides[side].iter().map(|search| search.share_after(gradients)).collect();
        let mean = shares.iter().sum::<f64>() / shares.len() as f64;
        let least = shares.iter().copied().fold(f64::INFINITY, f64::min);
        [mean, least, shares.iter().copied().fold(f64::NEG_INFINITY, f64::max)]
    }

    /// The fraction of the moves after a mutation to a lens better than the start, over all seeds;
    /// NaN without such moves.
    fn share_of_mutants(&self, side: usize, gradients: u64) -> f64 {
        let counts = self.sides[side].iter().map(|search| search.mutation_moves_after(gradients));
        let [better, moves] = counts.fold([0, 0], |sum, n| [0, 1].map(|i| sum[i] + n[i]));
        better as f64 / moves as f64
    }

    /// The mean of the best losses of a side over all seeds.
    fn best(&self, side: usize, gradients: u64) -> f64 {
        let best = self.sides[side].iter().map(|search| search.best_after(gradients));
        best.sum::<f64>() / self.sides[side].len() as f64
    }

    /// The claim of a test, which is too short for the others: there are mutations on both sides.
    fn mutation_claim(&self) -> Claim {
        let last = |search: &RecordedSearch| search.marks.last().map_or(0, |mark| mark.generation);
        let counts = self.sides.iter().map(|side| side.iter().map(last).sum::<u64>());
        let says = format!("{}: mutations with projection and without", self.subject.name);
        Claim::at_least(says, counts.min().unwrap_or(0) as f64, 1.0)
    }

    /// The difference of the mean fractions with projection and without.
    fn difference(&self, gradients: u64) -> ShareDifference {
        let [with, without] = [0, 1].map(|side| {
            let shares = self.sides[side].iter().map(|search| search.share_after(gradients));
            mean_and_variance(&shares.collect::<Vec<_>>())
        });
        ShareDifference { mean: with[0] - without[0], error: 2.0 * (with[1] + without[1]).sqrt() }
    }

    fn rows(&self, table: &mut DataTable, gradients: u64, thesis: [f64; 2]) {
        let difference = self.difference(gradients);
        for (side, (_, name)) in SIDES.iter().enumerate() {
            let [mean, least, most] = self.share(side, gradients);
            let generations_of = |search: &RecordedSearch| {
                let seen = search.marks.iter().take_while(|mark| mark.gradients <= gradients);
                seen.map(|mark| mark.generation + 1).max().unwrap_or(1) as f64
            };
            let generations = self.sides[side].iter().map(generations_of).sum::<f64>();
            let generations = generations / self.sides[side].len() as f64;
            let words = [self.subject.name, *name].map(TableCell::from);
            let mutants = self.share_of_mutants(side, gradients);
            let best = self.best(side, gradients);
            let ShareDifference { mean: gain, error } = difference;
            let ours = [gradients as f64, mean, least, most, gain, error].map(TableCell::from);
            let rest = [thesis[side], mutants, generations, best].map(TableCell::from);
            let effect = [difference.effect().into()];
            table.push_row(words.into_iter().chain(ours).chain(effect).chain(rest));
        }
    }

    /// Every move of the first seed.
    fn moves(&self) -> DataTable {
        let columns = ["mutations", "gradients", "generation", "began_with", "merit", "best"];
        let mut table = DataTable::new("moves", &columns);
        for (searches, (_, name)) in self.sides.iter().zip(SIDES) {
            for mark in &searches[0].marks {
                let kind = mark.kind.map_or("start", MutationKind::name);
                let numbers = [mark.gradients as f64, mark.generation as f64].map(TableCell::from);
                let merits = [mark.loss.unwrap_or(f64::NAN), mark.best].map(TableCell::from);
                let row = std::iter::once(TableCell::from(name)).chain(numbers);
                table.push_row(row.chain([kind.into()]).chain(merits));
            }
        }
        table
    }

    /// Draws the merit of every move of the first seed, on both sides, coloured by the mutation
    /// that started its descent.
    fn draw(&self) -> Canvas {
        let mut canvas = Canvas::new([1700, 1240]);
        let all = || self.sides.iter().flat_map(|side| &side[0].marks);
        let last = all().map(|mark| mark.gradients).max().unwrap_or(1) as f64;
        let start = self.sides[0][0].start();
        let losses = all().filter_map(|mark| mark.loss).filter(|loss| *loss < WORST * start);
        let losses: Vec<f64> = losses.chain([start]).collect();
        for (i, (_, name)) in SIDES.iter().enumerate() {
            let top = 120.0 + 580.0 * i as f64;
            let x = Axis::linear("gradients", [0.0, last]);
            let y = Axis::logarithmic("merit", losses.iter().copied(), 1e-12);
            let chart = Chart::new([120.0, top], [1380.0, top + 420.0], x, y);
            chart.draw(&mut canvas, &format!("{}, {name}", self.subject.name));
            let level = [[0.0, start], [last, start]];
            canvas.curve(&chart.to_pixels(&level), GREY, Stroke::Dashed);
            draw_moves(&mut canvas, &chart, &self.sides[i][0].marks);
        }
        key(&mut canvas);
        canvas
    }
}

/// Losses above this multiple of the start are not drawn.
const WORST: f64 = 1e4;

/// The colour of a move.
fn color(kind: Option<MutationKind>) -> Color {
    let place =
        kind.and_then(|kind| MutationKind::MUTATIONS.iter().position(|other| *other == kind));
    match (kind, place) {
        (None, _) => BLACK,
        (_, Some(place)) if place < PALETTE.len() => PALETTE[place],
        _ => GREY,
    }
}

fn draw_moves(canvas: &mut Canvas, chart: &Chart, marks: &[RoundRecord]) {
    for descent in marks.chunk_by(|a, b| a.generation == b.generation) {
        let losses = descent.iter().filter_map(|mark| Some([mark.gradients as f64, mark.loss?]));
        let inside: Vec<[f64; 2]> = losses.filter(|point| chart.contains(*point)).collect();
        let places = chart.to_pixels(&inside);
        let color = color(descent[0].kind);
        canvas.curve(&places, color, Stroke::Solid);
        canvas.markers(&places[..places.len().min(1)], color);
    }
}

/// Draws the legend of the mutations.
fn key(canvas: &mut Canvas) {
    let kinds = std::iter::once(None)
        .chain(MutationKind::MUTATIONS.map(Some))
        .chain([Some(MutationKind::Global)]);
    let mut legend = Legend::new([1420.0, 140.0]);
    for kind in kinds {
        legend.marker(canvas, kind.map_or("start", MutationKind::name), color(kind));
    }
    legend.curve(canvas, "merit of the start", GREY, Stroke::Dashed);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::structure::STUDY_LENSES;
    use crate::experiments::structure::recorded_search::with_rounds;

    #[test]
    fn the_error_of_a_difference_has_the_variances_of_both_sides() {
        let share = |better: u64| with_rounds(&[(10, 10, better, 1.0)]);
        let sides = [vec![share(5), share(7)], vec![share(2), share(4)]];
        let comparison = ProjectionComparison { subject: STUDY_LENSES[0], sides };
        let found = comparison.difference(10);
        assert!((found.mean - 0.3).abs() < 1e-12, "{}", found.mean);
        // Each mean of two has a standard error of 0.1; twice that of the difference.
        assert!((found.error - 2.0 * 0.02f64.sqrt()).abs() < 1e-12, "{}", found.error);
    }
}
