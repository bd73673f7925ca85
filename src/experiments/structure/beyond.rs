//! Figure 4.7: the front of sharpness against light, with mutations and without.
//!
//! A sweep over weights gives the front that the structure of the lens can reach. From designs of
//! it, each with the weight and the objective that it was found with, two searches go on for as many
//! gradients: one mutates, one descends only. The best lens of each joins the front of its side.

use super::course::{Course, finish};
use super::race::Runner;
use super::{at_heights, rules};
use crate::experiments::front::lens_and_spots;
use crate::experiments::trade::{self, Part};
use crate::experiments::{Claim, Effort, Ended, Experiment, Outcome, Picture, Watch, report};
use crate::lens::Lens;
use crate::merit::{PupilEdge, Term, Weighted};
use crate::optimize::pareto::{Design, Front, Settings, Sweep, composite};
use crate::picture::{Align, Axis, BLACK, Canvas, Chart, Color, PALETTE};
use crate::search::Rules;
use crate::search::lens::Plan;

pub(in crate::experiments) const EXPERIMENT: Experiment = Experiment {
    id: "4.7",
    title: "The front of sharpness against light with mutations and without",
    claim: "Mutations find lenses beyond the front that one structure can reach",
    seconds: 40.0,
    run,
};

/// The lens of the front.
const FILE: &str = "double_gauss_nikkor_s_50";
/// The part of the work that is the sweep.
const SWEPT: f64 = 0.4;
/// How exact the numbers of a design are, relatively.
const JUDGED: f64 = 1e-4;

fn run(effort: Effort, watch: &mut Watch<'_>) -> Result<Outcome, Ended> {
    let start = at_heights(FILE)?;
    let settings =
        Settings { points: effort.pick(8, 2), steps: effort.pick(400, 25), ..Settings::default() };
    let sweep = swept(&start, &settings, watch)?;
    let chosen = chosen(sweep.front(), effort.pick(8, 2));
    let gradients = effort.pick(4000, 60);
    let sides = Sides::of(&sweep, &chosen, gradients, watch)?;
    let mut outcome = Outcome { claims: sides.claims(&sweep, effort), ..Outcome::default() };
    outcome.rays = sides.rays;
    outcome.tables.push(trade::table("designs", &sides.designs(&sweep), &mut outcome.rays)?);
    outcome.pictures.push(Picture { name: "front", canvas: sides.draw(&sweep)? });
    outcome.lenses.extend(sides.lenses());
    Ok(outcome)
}

/// The front that the lens can reach as it is.
fn swept(start: &Lens, settings: &Settings, watch: &mut Watch<'_>) -> Result<Sweep, Ended> {
    let mut sweep = Sweep::new(start, settings).map_err(Ended::from_error)?;
    let mut done = 0.0;
    loop {
        report(watch, SWEPT * done, "the front without mutations")?;
        let slice = sweep.step();
        done = slice.done as f64 / slice.total as f64;
        if slice.finished {
            return Ok(sweep);
        }
    }
}

/// Designs of a front with their weights, evenly among all.
fn chosen(front: &Front, count: usize) -> Vec<(Design, f64)> {
    let weighted = front.designs().iter().filter_map(|d| Some((d.clone(), d.weight?)));
    let all: Vec<(Design, f64)> = weighted.filter(|(_, weight)| *weight > 0.0).collect();
    let count = count.min(all.len());
    let last = (count.max(2) - 1) as f64;
    let place = |i: usize| (i as f64 / last * (all.len() - 1) as f64).round() as usize;
    (0..count).map(|i| all[place(i)].clone()).collect()
}

/// What mutations have found, and what a longer descent has.
struct Sides {
    mutated: Front,
    descended: Front,
    /// Those that mutations have found.
    found: Vec<Design>,
    rays: usize,
}

impl Sides {
    fn of(
        sweep: &Sweep,
        chosen: &[(Design, f64)],
        gradients: u64,
        watch: &mut Watch<'_>,
    ) -> Result<Self, Ended> {
        let mut courses = Vec::new();
        for runner in [Runner::Restore, Runner::Descent] {
            for (i, (design, weight)) in chosen.iter().enumerate() {
                let plan = plan(&sweep.start, *weight, gradients)?;
                courses.push(Course::new(&design.lens, &runner.plan(&plan, 1 + i as u64))?);
            }
        }
        let part = Part { from: SWEPT, to: 1.0, name: "from the front, with mutations" };
        finish(&mut courses, part, watch)?;
        let rays = courses.iter().map(Course::rays).sum();
        let judged = |(course, (_, weight)): (&Course, &(Design, f64))| {
            Design::of(&course.run.best().point, Some(*weight), JUDGED).map_err(Ended::from_error)
        };
        let (mutated, descended) = courses.split_at(chosen.len());
        let [found, longer] = [mutated, descended]
            .map(|side| side.iter().zip(chosen).map(judged).collect::<Result<Vec<_>, Ended>>());
        let (found, longer) = (found?, longer?);
        Ok(Self {
            mutated: joined(sweep.front(), &found),
            descended: joined(sweep.front(), &longer),
            found,
            rays,
        })
    }

    fn claims(&self, sweep: &Sweep, effort: Effort) -> Vec<Claim> {
        let (spot, light) = (2.0 * sweep.start.spot, sweep.start.light);
        let volume = |front: &Front| front.hypervolume(spot, light);
        let fronts = [&self.mutated, &self.descended, sweep.front()];
        let [with, longer, without] = fronts.map(volume);
        let old = self.descended.designs();
        let beyond = |design: &&Design| !old.iter().any(|o| o.dominates(design) || o == *design);
        let new = self.mutated.designs().iter().filter(beyond).count();
        let mut claims = vec![
            Claim::at_least(
                "hypervolume of the front with mutations, against that without",
                with,
                without,
            ),
            Claim::at_least(
                "hypervolume with mutations, against that of descents as long without",
                with,
                longer,
            ),
        ];
        // A test has no room for more.
        if effort == Effort::Full {
            let says = "designs beyond the front of descents as long";
            claims.push(Claim::at_least(says, new as f64, 1.0));
        }
        claims
    }

    fn designs<'a>(&'a self, sweep: &'a Sweep) -> Vec<(&'static str, &'a Design)> {
        let named = |name, front: &'a Front| front.designs().iter().map(move |d| (name, d));
        let start = std::iter::once(("start", &sweep.start));
        start
            .chain(named("without mutations", sweep.front()))
            .chain(named("descended on", &self.descended))
            .chain(named("with mutations", &self.mutated))
            .collect()
    }

    fn lenses(&self) -> impl Iterator<Item = (String, Lens)> {
        self.found.iter().filter_map(|design| {
            let name = format!("mutated-beta-{:.1e}", design.weight?);
            Some((name, design.lens.clone()))
        })
    }

    /// The plane of blur and light, and the lenses at the ends of the front with their spots.
    fn draw(&self, sweep: &Sweep) -> Result<Canvas, Ended> {
        let mut canvas = Canvas::new([2020, 1000]);
        let um = |design: &Design| [1e3 * design.spot, design.light];
        let points = |front: &Front| front.designs().iter().map(um).collect::<Vec<_>>();
        let sets: [(&str, Vec<[f64; 2]>, Color); 4] = [
            ("start", vec![um(&sweep.start)], BLACK),
            ("with mutations", points(&self.mutated), PALETTE[0]),
            ("descended on without", points(&self.descended), PALETTE[2]),
            ("without mutations", points(sweep.front()), PALETTE[1]),
        ];
        let all = || sets.iter().flat_map(|set| &set.1);
        let x = Axis::linear("blur (rms), um", all().map(|p| p[0]).chain([0.0]));
        let y = Axis::linear("area of the pupil, mm^2", all().map(|p| p[1]).chain([0.0]));
        let chart = Chart::new([120.0, 200.0], [840.0, 880.0], x, y);
        chart.draw(&mut canvas, FILE);
        for (i, (label, points, color)) in sets.iter().enumerate() {
            let place = [130.0, 20.0 + 28.0 * i as f64];
            canvas.marks(&[[place[0], place[1] + 7.0]], *color);
            canvas.text([place[0] + 20.0, place[1]], label, BLACK, Align::Left);
            canvas.marks(&chart.places(points), *color);
        }
        let found = &self.found;
        let shown = [
            ("start", Some(&sweep.start)),
            ("mutated, sharpest", found.iter().min_by(|a, b| a.spot.total_cmp(&b.spot))),
            ("mutated, brightest", found.iter().max_by(|a, b| a.light.total_cmp(&b.light))),
        ];
        for (i, (name, design)) in shown.into_iter().enumerate() {
            if let Some(design) = design {
                lens_and_spots(&mut canvas, name, &design.lens, 90.0 + 310.0 * i as f64)?;
            }
        }
        Ok(canvas)
    }
}

/// A front that more designs have been offered to.
fn joined(front: &Front, found: &[Design]) -> Front {
    let mut front = front.clone();
    found.iter().for_each(|design| {
        front.offer(design.clone());
    });
    front
}

/// The search that goes on where the sweep was with this weight: the same objective, no wider rims.
fn plan(start: &Design, weight: f64, gradients: u64) -> Result<Plan, Ended> {
    let goal = composite(&start.lens, start.light, PupilEdge::Moving);
    let mut goal = goal.map_err(Ended::from_error)?;
    goal.terms.push(Weighted { term: Term::Throughput, weight });
    let rims = start.lens.surfaces.iter().filter_map(|row| row.semi_diameter);
    let widest = Settings::default().rims[1] * rims.fold(0.0, f64::max);
    let rules = Rules { semi_diameter: Some(widest), ..rules() };
    let default = Plan::default();
    let settings = crate::search::Settings {
        chains: 1,
        gradients: Some(gradients),
        ..default.settings.clone()
    };
    Ok(Plan { goal: Some(goal), rules, settings, ..default })
}
