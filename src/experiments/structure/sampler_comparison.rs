//! Comparison of samplers: the same lenses, objective and number of gradients, several seeds.

use super::recorded_search::{RecordedSearch, run_to_end};
use super::{STUDY_LENSES, StudyLens, at_heights, plan, rules};
use crate::experiments::sharpness_vs_light::ProgressSpan;
use crate::experiments::{
    Claim, DataTable, Effort, ExperimentOutcome, ExperimentResult, NamedPlot, ProgressFn, TableCell,
};
use crate::plot::{Axis, BLACK, Canvas, Chart, PALETTE, Stroke, TextAlign};
use crate::search::SearchMethod;
use crate::search::lens_landscape::SearchPlan;

/// A sampler of the comparison.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SamplerKind {
    Restore,
    Metropolis,
    Brute,
    /// Descent from the start without mutations.
    Descent,
}

impl SamplerKind {
    fn name(self) -> &'static str {
        match self {
            Self::Restore => "RESTORE",
            Self::Metropolis => "Metropolis-Hastings",
            Self::Brute => "brute force",
            Self::Descent => "descent alone",
        }
    }

    pub(super) fn plan(self, plan: &SearchPlan, seed: u64) -> SearchPlan {
        let mut own = plan.clone();
        own.settings.seed = seed;
        own.settings.method = match self {
            Self::Restore | Self::Descent => SearchMethod::Restore,
            Self::Metropolis => SearchMethod::Metropolis,
            Self::Brute => SearchMethod::BruteForce,
        };
        if self == Self::Descent {
            own.settings = own.settings.without_mutations();
        }
        own
    }
}

/// A comparison of the first of some samplers with the others.
#[derive(Debug, Clone, Copy)]
pub(super) struct SamplerComparison {
    pub(super) samplers: &'static [SamplerKind],
    /// The samplers that the first one has to beat.
    pub(super) rivals: &'static [SamplerKind],
    pub(super) lenses: usize,
    pub(super) seeds: u64,
    pub(super) gradients: u64,
}

/// The results for a lens.
struct LensComparison {
    subject: StudyLens,
    /// The loss of the starting lens.
    start: f64,
    /// The searches of each sampler, one for each seed.
    searches: Vec<(SamplerKind, Vec<RecordedSearch>)>,
}

impl SamplerComparison {
    /// The number of seeds that a claim about most seeds needs: four of five.
    fn required_seeds(&self) -> f64 {
        (0.8 * self.seeds as f64).floor()
    }

    pub(super) fn run(&self, progress: &mut ProgressFn<'_>) -> ExperimentResult {
        let mut outcome = ExperimentOutcome::default();
        let mut comparisons = Vec::new();
        for (i, subject) in self.subjects().iter().enumerate() {
            let [from, to] = [i, i + 1].map(|part| part as f64 / self.lenses as f64);
            comparisons.push(self.compare_lens(
                *subject,
                ProgressSpan { from, to, name: subject.name },
                progress,
            )?);
        }
        for comparison in &comparisons {
            outcome.claims.extend(self.claims(comparison));
            let all = comparison.searches.iter().flat_map(|(_, searches)| searches);
            outcome.rays += all.map(RecordedSearch::rays).sum::<usize>();
        }
        outcome.tables.push(final_table(&comparisons));
        outcome.tables.push(self.curves(&comparisons));
        outcome.pictures.push(NamedPlot { name: "merit", canvas: self.draw(&comparisons) });
        outcome.lenses.extend(comparisons.iter().filter_map(LensComparison::best));
        Ok(outcome)
    }

    /// The lenses compared; the normal lens if there is only one.
    fn subjects(&self) -> &'static [StudyLens] {
        if self.lenses == 1 { &STUDY_LENSES[1..2] } else { &STUDY_LENSES[..self.lenses] }
    }

    fn compare_lens(
        &self,
        subject: StudyLens,
        part: ProgressSpan<'_>,
        progress: &mut ProgressFn<'_>,
    ) -> ExperimentResult<LensComparison> {
        let start = at_heights(subject.file)?;
        let plan = plan(&start, rules(), self.gradients)?;
        let mut all = Vec::new();
        for sampler in self.samplers {
            for seed in 1..=self.seeds {
                all.push(RecordedSearch::new(&start, &sampler.plan(&plan, seed))?);
            }
        }
        run_to_end(&mut all, part, progress)?;
        let loss = all[0].start();
        let mut rest = all.into_iter();
        let of_each =
            |sampler: &SamplerKind| (*sampler, rest.by_ref().take(self.seeds as usize).collect());
        let searches = self.samplers.iter().map(of_each).collect();
        Ok(LensComparison { subject, start: loss, searches })
    }

    fn claims(&self, comparison: &LensComparison) -> Vec<Claim> {
        let first = comparison.final_losses(self.samplers[0]);
        let claim = |rival: &SamplerKind| {
            let other = comparison.final_losses(*rival);
            let below = first.iter().zip(&other).filter(|(own, other)| own < other).count();
            let names = [self.samplers[0], *rival].map(SamplerKind::name);
            let says = format!(
                "{}: seeds of {} with which {} ends below {}",
                comparison.subject.name, self.seeds, names[0], names[1]
            );
            Claim::at_least(says, below as f64, self.required_seeds())
        };
        self.rivals.iter().map(claim).collect()
    }

    /// The numbers of gradients at which curves are evaluated.
    fn gradient_counts(&self) -> impl Iterator<Item = u64> {
        let limit = self.gradients;
        (0..=POINTS).map(move |i| limit * i / POINTS)
    }

    fn curves(&self, comparisons: &[LensComparison]) -> DataTable {
        let columns = ["lens", "sampler", "gradients", "median", "least", "most"];
        let mut table = DataTable::new("curves", &columns);
        for comparison in comparisons {
            for (sampler, searches) in &comparison.searches {
                for gradients in self.gradient_counts() {
                    let [least, median, most] = spread(searches, gradients);
                    let words = [comparison.subject.name, sampler.name()].map(TableCell::from);
                    let numbers = [gradients as f64, median, least, most].map(TableCell::from);
                    table.push_row(words.into_iter().chain(numbers));
                }
            }
        }
        table
    }

    /// Draws the best merit relative to the start for every lens: median, best and worst seed.
    fn draw(&self, comparisons: &[LensComparison]) -> Canvas {
        let rows = comparisons.len().div_ceil(2) as u32;
        let mut canvas = Canvas::new([1500, 140 + 620 * rows]);
        for (i, sampler) in self.samplers.iter().enumerate() {
            let x = 120.0 + 340.0 * i as f64;
            let color = PALETTE[i % PALETTE.len()];
            canvas.curve(&[[x, 27.0], [x + 40.0, 27.0]], color, Stroke::Solid);
            canvas.text([x + 52.0, 20.0], sampler.name(), BLACK, TextAlign::Left);
        }
        let note = "solid: middle seed; dashed: best and worst";
        canvas.text([120.0, 52.0], note, BLACK, TextAlign::Left);
        for (i, comparison) in comparisons.iter().enumerate() {
            let left = 120.0 + 740.0 * (i % 2) as f64;
            let top = 160.0 + 620.0 * (i / 2) as f64;
            self.draw_lens(&mut canvas, comparison, [left, top]);
        }
        canvas
    }

    fn draw_lens(&self, canvas: &mut Canvas, comparison: &LensComparison, [left, top]: [f64; 2]) {
        let all = comparison.searches.iter().flat_map(|(_, searches)| searches);
        let lowest = all.map(|search| search.run.best().loss / comparison.start);
        let chart = Chart::new(
            [left, top],
            [left + 580.0, top + 440.0],
            Axis::linear("gradients", [0.0, self.gradients as f64]),
            Axis::logarithmic("best merit / start", lowest.chain([1.0]), 1e-9),
        );
        chart.draw(canvas, comparison.subject.name);
        for (i, (_, searches)) in comparison.searches.iter().enumerate() {
            let color = PALETTE[i % PALETTE.len()];
            let strokes = [Stroke::Dashed, Stroke::Solid, Stroke::Dashed];
            for (k, stroke) in strokes.into_iter().enumerate() {
                let at =
                    |g: u64| chart.to_pixel([g as f64, spread(searches, g)[k] / comparison.start]);
                let points: Vec<[f64; 2]> = self.gradient_counts().map(at).collect();
                canvas.curve(&points, color, stroke);
            }
        }
    }
}

/// The number of intervals of a curve.
const POINTS: u64 = 100;

impl LensComparison {
    /// The final best losses of a sampler, by seed.
    fn final_losses(&self, sampler: SamplerKind) -> Vec<f64> {
        let own = self.searches.iter().find(|(other, _)| *other == sampler);
        own.map_or(Vec::new(), |(_, searches)| searches.iter().map(|c| c.run.best().loss).collect())
    }

    /// The best lens of all, with its name.
    fn best(&self) -> Option<(String, crate::lens::Lens)> {
        let all = self.searches.iter().flat_map(|(_, searches)| searches);
        let best = all.min_by(|a, b| a.run.best().loss.total_cmp(&b.run.best().loss))?;
        Some((self.subject.file.to_owned(), best.run.best().point.as_ref().clone()))
    }
}

/// The minimum, median and maximum of the best losses of all seeds after a number of gradients.
fn spread(searches: &[RecordedSearch], gradients: u64) -> [f64; 3] {
    let mut all: Vec<f64> = searches.iter().map(|search| search.best_after(gradients)).collect();
    all.sort_by(f64::total_cmp);
    [0, all.len() / 2, all.len() - 1].map(|place| all[place])
}

/// The table of the final losses of all searches.
fn final_table(comparisons: &[LensComparison]) -> DataTable {
    let columns =
        ["lens", "sampler", "seed", "gradients", "generations", "start", "best", "elements"];
    let mut table = DataTable::new("ends", &columns);
    for comparison in comparisons {
        for (sampler, searches) in &comparison.searches {
            for search in searches {
                let run = &search.run;
                let words = [comparison.subject.name, sampler.name()].map(TableCell::from);
                let numbers = [
                    run.settings().seed as f64,
                    run.statistics().gradients as f64,
                    run.lineage().total() as f64,
                    comparison.start,
                    run.best().loss,
                ];
                let row = words.into_iter().chain(numbers.map(TableCell::from));
                table.push_row(row.chain([run.best().topology.as_str().into()]));
            }
        }
    }
    table
}

impl Effort {
    /// The size of a comparison: lenses, seeds, gradients.
    pub(super) fn comparison_size(self) -> (usize, u64, u64) {
        self.select((STUDY_LENSES.len(), 5, 12_000), (1, 2, 200))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::structure::recorded_search::with_rounds;

    #[test]
    fn the_spread_over_seeds_is_the_best_the_middle_and_the_worst() {
        let best = |loss: f64| with_rounds(&[(10, 1, 1, 2.0 * loss), (20, 2, 1, loss)]);
        let searches = [0.3, 0.1, 0.2].map(best);
        assert_eq!(spread(&searches, 15), [0.2, 0.4, 0.6]);
        assert_eq!(spread(&searches, 20), [0.1, 0.2, 0.3]);
        assert_eq!(spread(&searches[..1], 20), [0.3; 3]);
    }
}
