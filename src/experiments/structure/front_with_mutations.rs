//! Figure 4.7: the front of sharpness against light, with mutations and without.
//!
//! A sweep over weights gives the front that the structure of the lens can reach. From designs of
//! it, each with its weight and objective, two searches continue for the same number of gradients:
//! one with mutations, one by descent alone. What each side finds joins the front of the sweep. A
//! search with mutations is random: several seeds give the error of its hypervolume.

use super::recorded_search::{RecordedSearch, run_to_end};
use super::sampler_comparison::SamplerKind;
use super::{at_heights, mean_and_variance, rules};
use crate::experiments::pareto_front::{design_points, draw_fronts};
use crate::experiments::sharpness_vs_light::{self, ProgressSpan};
use crate::experiments::{
    Claim, Effort, Experiment, ExperimentOutcome, ExperimentResult, NamedPlot, ProgressFn,
    report_progress,
};
use crate::lens::Lens;
use crate::merit::{PupilEdge, Term, WeightedTerm};
use crate::optimize::pareto::{Front, ParetoPoint, ParetoSettings, ParetoSweep, weighted_sum_goal};
use crate::plot::{BLACK, Canvas, PALETTE};
use crate::search::SearchRules;
use crate::search::lens_landscape::SearchPlan;

pub(in crate::experiments) const EXPERIMENT: Experiment = Experiment {
    id: "4.7",
    title: "The front of sharpness against light with mutations and without",
    claim: "Mutations find lenses beyond the front that one structure can reach",
    omits: "nothing of the figure",
    seconds: 40.0,
    run,
};

/// The starting lens of the front.
const FILE: &str = "double_gauss_nikkor_s_50";
/// The part of the sweep in the whole work.
const SWEEP_SHARE: f64 = 0.4;
/// The first seed of the searches with mutations; chosen before any result was known.
const FIRST_SEED: u64 = 101;
/// The relative accuracy of the numbers of a design.
const EVALUATION_TOLERANCE: f64 = 1e-4;

fn run(effort: Effort, progress: &mut ProgressFn<'_>) -> ExperimentResult {
    let start = at_heights(FILE)?;
    let settings = ParetoSettings {
        points: effort.select(8, 2),
        steps: effort.select(400, 25),
        ..ParetoSettings::weighted_sum()
    };
    let sweep = run_sweep(&start, &settings, progress)?;
    let chosen = select_designs(sweep.front(), effort.select(8, 2));
    let gradients = effort.select(4000, 60);
    let effort_of_sides = SideEffort { gradients, seeds: effort.select(3, 1) };
    let sides = MutationGain::of(&sweep, &chosen, effort_of_sides, progress)?;
    let mut outcome =
        ExperimentOutcome { claims: sides.claims(&sweep, effort), ..ExperimentOutcome::default() };
    outcome.rays = sides.rays;
    outcome.tables.push(sharpness_vs_light::table(
        "designs",
        &sides.designs(&sweep),
        &mut outcome.rays,
    )?);
    outcome.pictures.push(NamedPlot { name: "front", canvas: sides.draw(&sweep)? });
    outcome.lenses.extend(sides.lenses());
    Ok(outcome)
}

/// The front that the structure of the lens can reach.
fn run_sweep(
    start: &Lens,
    settings: &ParetoSettings,
    progress: &mut ProgressFn<'_>,
) -> ExperimentResult<ParetoSweep> {
    let mut sweep = ParetoSweep::new(start, settings)?;
    let mut done = 0.0;
    loop {
        report_progress(progress, SWEEP_SHARE * done, "the front without mutations")?;
        let slice = sweep.step();
        done = slice.done as f64 / slice.total as f64;
        if slice.finished {
            return Ok(sweep);
        }
    }
}

/// Designs of a front with their weights, evenly distributed along it.
fn select_designs(front: &Front, count: usize) -> Vec<(ParetoPoint, f64)> {
    let weighted = front.points().iter().filter_map(|d| Some((d.clone(), d.weight?)));
    let all: Vec<(ParetoPoint, f64)> = weighted.filter(|(_, weight)| *weight > 0.0).collect();
    let count = count.min(all.len());
    let last = (count.max(2) - 1) as f64;
    let place = |i: usize| (i as f64 / last * (all.len() - 1) as f64).round() as usize;
    (0..count).map(|i| all[place(i)].clone()).collect()
}

/// The gradients of every search and the number of seeds with mutations.
#[derive(Debug, Clone, Copy)]
struct SideEffort {
    gradients: u64,
    seeds: u64,
}

/// The fronts found with mutations, and by a longer descent.
struct MutationGain {
    /// With mutations, for every seed.
    mutated: Vec<Front>,
    descended: Front,
    /// The designs found with mutations by the first seed.
    found: Vec<ParetoPoint>,
    rays: usize,
}

impl MutationGain {
    fn of(
        sweep: &ParetoSweep,
        chosen: &[(ParetoPoint, f64)],
        effort: SideEffort,
        progress: &mut ProgressFn<'_>,
    ) -> ExperimentResult<Self> {
        let mut searches = Vec::new();
        let mut add = |sampler: SamplerKind, seed: u64| {
            for (design, weight) in chosen {
                let plan = sampler.plan(&plan(&sweep.start, *weight, effort.gradients)?, seed);
                searches.push(RecordedSearch::new(&design.lens, &plan)?);
            }
            ExperimentResult::<()>::Ok(())
        };
        add(SamplerKind::Descent, FIRST_SEED)?;
        (0..effort.seeds).try_for_each(|i| add(SamplerKind::Restore, FIRST_SEED + i))?;
        let part =
            ProgressSpan { from: SWEEP_SHARE, to: 1.0, name: "from the front, with mutations" };
        run_to_end(&mut searches, part, progress)?;
        let rays = searches.iter().map(RecordedSearch::rays).sum();
        let mut sides = Vec::new();
        for side in searches.chunks(chosen.len()) {
            sides.push(evaluate_best(side, chosen)?);
        }
        let descended = extend_front(sweep.front(), &sides.remove(0));
        let mutated = sides.iter().map(|found| extend_front(sweep.front(), found)).collect();
        Ok(Self { mutated, descended, found: sides.remove(0), rays })
    }

    /// The hypervolume with mutations, the mean over the seeds with two standard errors.
    fn mutated_hypervolume(&self, start: &ParetoPoint) -> [f64; 2] {
        let volumes = self.mutated.iter().map(|front| front.relative_hypervolume(start));
        let [mean, variance] = mean_and_variance(&volumes.collect::<Vec<_>>());
        [mean, 2.0 * variance.sqrt()]
    }

    fn claims(&self, sweep: &ParetoSweep, effort: Effort) -> Vec<Claim> {
        let [with, error] = self.mutated_hypervolume(&sweep.start);
        let longer = self.descended.relative_hypervolume(&sweep.start);
        let old = self.descended.points();
        let beyond =
            |design: &&ParetoPoint| !old.iter().any(|o| o.dominates(design) || o == *design);
        let new = self.mutated.iter().map(|front| front.points().iter().filter(beyond).count());
        let mut claims = vec![
            Claim::at_least(
                "hypervolume with mutations, against that of equally long descents without",
                with,
                longer,
            )
            .with_error(error),
        ];
        // A test is too short for more.
        if effort == Effort::Full {
            let says = "designs beyond the front of equally long descents, least of the seeds";
            claims.push(Claim::at_least(says, new.min().unwrap_or(0) as f64, 1.0));
        }
        claims
    }

    fn designs<'a>(&'a self, sweep: &'a ParetoSweep) -> Vec<(&'static str, &'a ParetoPoint)> {
        let named = |name, front: &'a Front| front.points().iter().map(move |d| (name, d));
        let start = std::iter::once(("start", &sweep.start));
        start
            .chain(named("without mutations", sweep.front()))
            .chain(named("descent without mutations", &self.descended))
            .chain(self.mutated.iter().flat_map(move |front| named("with mutations", front)))
            .collect()
    }

    fn lenses(&self) -> impl Iterator<Item = (String, Lens)> {
        self.found.iter().filter_map(|design| {
            let name = format!("mutated-beta-{:.1e}", design.weight?);
            Some((name, design.lens.clone()))
        })
    }

    /// Draws the plane of blur and light, and the lenses at the ends of the front with their spots.
    fn draw(&self, sweep: &ParetoSweep) -> ExperimentResult<Canvas> {
        let mutated = self.mutated.iter().flat_map(Front::points);
        let sets = [
            ("start", design_points([&sweep.start]), BLACK),
            ("with mutations", design_points(mutated), PALETTE[0]),
            ("descent without mutations", design_points(self.descended.points()), PALETTE[2]),
            ("without mutations", design_points(sweep.front().points()), PALETTE[1]),
        ];
        let found = &self.found;
        let shown = [
            ("start", Some(&sweep.start)),
            ("mutated, sharpest", found.iter().min_by(|a, b| a.spot.total_cmp(&b.spot))),
            ("mutated, brightest", found.iter().max_by(|a, b| a.light.total_cmp(&b.light))),
        ];
        draw_fronts(2020, FILE, &sets, shown)
    }
}

/// The best lens of every search, evaluated.
fn evaluate_best(
    searches: &[RecordedSearch],
    chosen: &[(ParetoPoint, f64)],
) -> ExperimentResult<Vec<ParetoPoint>> {
    let evaluate = |(search, (_, weight)): (&RecordedSearch, &(ParetoPoint, f64))| {
        Ok(ParetoPoint::evaluate(&search.run.best().point, Some(*weight), EVALUATION_TOLERANCE)?)
    };
    searches.iter().zip(chosen).map(evaluate).collect()
}

/// The front of a front and more designs.
fn extend_front(front: &Front, found: &[ParetoPoint]) -> Front {
    let mut front = front.clone();
    found.iter().for_each(|design| {
        front.insert(design.clone());
    });
    front
}

/// The search that continues the sweep at a weight: the same objective and the same bounds of
/// semi-diameters.
fn plan(start: &ParetoPoint, weight: f64, gradients: u64) -> ExperimentResult<SearchPlan> {
    let goal = weighted_sum_goal(&start.lens, start.light, PupilEdge::Moving);
    let mut goal = goal?;
    goal.terms.push(WeightedTerm::new(Term::Throughput, weight));
    let semi_diameters = start.lens.surfaces.iter().filter_map(|row| row.semi_diameter);
    let widest =
        ParetoSettings::default().semi_diameter_factors[1] * semi_diameters.fold(0.0, f64::max);
    let rules = SearchRules { semi_diameter: Some(widest), ..rules() };
    let default = SearchPlan::default();
    let settings = crate::search::SearchSettings {
        method: crate::search::SearchMethod::Restore,
        chains: 1,
        gradients: Some(gradients),
        ..default.settings.clone()
    };
    Ok(SearchPlan { goal: Some(goal), rules, settings, ..default })
}
