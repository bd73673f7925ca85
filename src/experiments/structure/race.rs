//! Samplers side by side: the same lenses, the same objective, as many gradients, several seeds.

use super::course::{Course, finish};
use super::{SUBJECTS, Subject, at_heights, plan, rules};
use crate::experiments::trade::Part;
use crate::experiments::{Cell, Claim, Effort, Ended, Outcome, Picture, Table, Watch};
use crate::picture::{Align, Axis, BLACK, Canvas, Chart, PALETTE, Stroke};
use crate::search::lens::Plan;
use crate::search::{Method, Settings, Temperature, Termination};

/// A sampler in a race.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Runner {
    Restore,
    Metropolis,
    Brute,
    /// Steps downhill from the start alone: what mutations are worth.
    Descent,
}

impl Runner {
    fn name(self) -> &'static str {
        match self {
            Self::Restore => "RESTORE",
            Self::Metropolis => "Metropolis and Hastings",
            Self::Brute => "brute force",
            Self::Descent => "descent alone",
        }
    }

    pub(super) fn plan(self, plan: &Plan, seed: u64) -> Plan {
        let mut own = plan.clone();
        own.settings.seed = seed;
        own.settings.method = match self {
            Self::Restore | Self::Descent => Method::Restore,
            Self::Metropolis => Method::Metropolis,
            Self::Brute => Method::Brute,
        };
        if self == Self::Descent {
            own.settings = endless(&own.settings);
        }
        own
    }
}

/// A descent that no clock ends.
fn endless(settings: &Settings) -> Settings {
    Settings {
        temperature: Temperature::new(f64::INFINITY),
        termination: Termination::Relative,
        c: 0.0,
        longest: usize::MAX,
        ..settings.clone()
    }
}

/// The first of some samplers against the others.
#[derive(Debug, Clone, Copy)]
pub(super) struct Race {
    pub(super) runners: &'static [Runner],
    /// Those that the first one must beat.
    pub(super) rivals: &'static [Runner],
    pub(super) lenses: usize,
    pub(super) seeds: u64,
    pub(super) gradients: u64,
}

/// What became of a lens.
struct Heat {
    subject: Subject,
    /// The loss at the start.
    start: f64,
    /// For every sampler a search of each seed.
    courses: Vec<(Runner, Vec<Course>)>,
}

impl Race {
    /// The parts that a claim about most seeds needs: four of five.
    fn most(&self) -> f64 {
        (0.8 * self.seeds as f64).floor()
    }

    pub(super) fn run(&self, watch: &mut Watch<'_>) -> Result<Outcome, Ended> {
        let mut outcome = Outcome::default();
        let mut heats = Vec::new();
        for (i, subject) in self.subjects().iter().enumerate() {
            let [from, to] = [i, i + 1].map(|part| part as f64 / self.lenses as f64);
            heats.push(self.heat(*subject, Part { from, to, name: subject.name }, watch)?);
        }
        for heat in &heats {
            outcome.claims.extend(self.claims(heat));
            let all = heat.courses.iter().flat_map(|(_, courses)| courses);
            outcome.rays += all.map(Course::rays).sum::<usize>();
        }
        outcome.tables.push(ends(&heats));
        outcome.tables.push(self.curves(&heats));
        outcome.pictures.push(Picture { name: "merit", canvas: self.draw(&heats) });
        outcome.lenses.extend(heats.iter().filter_map(Heat::best));
        Ok(outcome)
    }

    /// The normal lens where only one is asked for.
    fn subjects(&self) -> &'static [Subject] {
        if self.lenses == 1 { &SUBJECTS[1..2] } else { &SUBJECTS[..self.lenses] }
    }

    fn heat(&self, subject: Subject, part: Part<'_>, watch: &mut Watch<'_>) -> Result<Heat, Ended> {
        let start = at_heights(subject.file)?;
        let plan = plan(&start, rules(), self.gradients)?;
        let mut all = Vec::new();
        for runner in self.runners {
            for seed in 1..=self.seeds {
                all.push(Course::new(&start, &runner.plan(&plan, seed))?);
            }
        }
        finish(&mut all, part, watch)?;
        let loss = all[0].start();
        let mut rest = all.into_iter();
        let of_each =
            |runner: &Runner| (*runner, rest.by_ref().take(self.seeds as usize).collect());
        let courses = self.runners.iter().map(of_each).collect();
        Ok(Heat { subject, start: loss, courses })
    }

    fn claims(&self, heat: &Heat) -> Vec<Claim> {
        let first = heat.ends(self.runners[0]);
        let claim = |rival: &Runner| {
            let other = heat.ends(*rival);
            let below = first.iter().zip(&other).filter(|(own, other)| own < other).count();
            let names = [self.runners[0], *rival].map(Runner::name);
            let says = format!(
                "{}: seeds of {} with which {} ends below {}",
                heat.subject.name, self.seeds, names[0], names[1]
            );
            Claim::at_least(says, below as f64, self.most())
        };
        self.rivals.iter().map(claim).collect()
    }

    /// Where curves are read.
    fn places(&self) -> impl Iterator<Item = u64> {
        let limit = self.gradients;
        (0..=POINTS).map(move |i| limit * i / POINTS)
    }

    fn curves(&self, heats: &[Heat]) -> Table {
        let columns = ["lens", "sampler", "gradients", "median", "least", "most"];
        let mut table = Table::new("curves", &columns);
        for heat in heats {
            for (runner, courses) in &heat.courses {
                for gradients in self.places() {
                    let [least, median, most] = spread(courses, gradients);
                    let words = [heat.subject.name, runner.name()].map(Cell::from);
                    let numbers = [gradients as f64, median, least, most].map(Cell::from);
                    table.row(words.into_iter().chain(numbers));
                }
            }
        }
        table
    }

    /// The best merit over that of the start for every lens: the middle seed, the best and the worst.
    fn draw(&self, heats: &[Heat]) -> Canvas {
        let rows = heats.len().div_ceil(2) as u32;
        let mut canvas = Canvas::new([1500, 140 + 620 * rows]);
        for (i, runner) in self.runners.iter().enumerate() {
            let x = 120.0 + 340.0 * i as f64;
            let color = PALETTE[i % PALETTE.len()];
            canvas.curve(&[[x, 27.0], [x + 40.0, 27.0]], color, Stroke::Solid);
            canvas.text([x + 52.0, 20.0], runner.name(), BLACK, Align::Left);
        }
        let note = "solid: middle seed; dashed: best and worst";
        canvas.text([120.0, 52.0], note, BLACK, Align::Left);
        for (i, heat) in heats.iter().enumerate() {
            let left = 120.0 + 740.0 * (i % 2) as f64;
            let top = 160.0 + 620.0 * (i / 2) as f64;
            self.draw_heat(&mut canvas, heat, [left, top]);
        }
        canvas
    }

    fn draw_heat(&self, canvas: &mut Canvas, heat: &Heat, [left, top]: [f64; 2]) {
        let all = heat.courses.iter().flat_map(|(_, courses)| courses);
        let lowest = all.map(|course| course.run.best().loss / heat.start);
        let chart = Chart::new(
            [left, top],
            [left + 580.0, top + 440.0],
            Axis::linear("gradients", [0.0, self.gradients as f64]),
            Axis::logarithmic("best merit / start", lowest.chain([1.0]), 1e-9),
        );
        chart.draw(canvas, heat.subject.name);
        for (i, (_, courses)) in heat.courses.iter().enumerate() {
            let color = PALETTE[i % PALETTE.len()];
            let strokes = [Stroke::Dashed, Stroke::Solid, Stroke::Dashed];
            for (k, stroke) in strokes.into_iter().enumerate() {
                let at = |g: u64| chart.place([g as f64, spread(courses, g)[k] / heat.start]);
                let points: Vec<[f64; 2]> = self.places().map(at).collect();
                canvas.curve(&points, color, stroke);
            }
        }
    }
}

/// Places of a curve.
const POINTS: u64 = 100;

impl Heat {
    /// The best losses of a sampler, by seed.
    fn ends(&self, runner: Runner) -> Vec<f64> {
        let own = self.courses.iter().find(|(other, _)| *other == runner);
        own.map_or(Vec::new(), |(_, courses)| courses.iter().map(|c| c.run.best().loss).collect())
    }

    /// The best lens of all, with its name.
    fn best(&self) -> Option<(String, crate::lens::Lens)> {
        let all = self.courses.iter().flat_map(|(_, courses)| courses);
        let best = all.min_by(|a, b| a.run.best().loss.total_cmp(&b.run.best().loss))?;
        Some((self.subject.file.to_owned(), best.run.best().point.clone()))
    }
}

/// The best losses after so many gradients: least, middle and most of all seeds.
fn spread(courses: &[Course], gradients: u64) -> [f64; 3] {
    let mut all: Vec<f64> = courses.iter().map(|course| course.best_after(gradients)).collect();
    all.sort_by(f64::total_cmp);
    [0, all.len() / 2, all.len() - 1].map(|place| all[place])
}

/// Where every search has ended.
fn ends(heats: &[Heat]) -> Table {
    let columns =
        ["lens", "sampler", "seed", "gradients", "generations", "start", "best", "elements"];
    let mut table = Table::new("ends", &columns);
    for heat in heats {
        for (runner, courses) in &heat.courses {
            for course in courses {
                let run = &course.run;
                let words = [heat.subject.name, runner.name()].map(Cell::from);
                let numbers = [
                    run.settings().seed as f64,
                    run.statistics().gradients as f64,
                    run.tree().born() as f64,
                    heat.start,
                    run.best().loss,
                ];
                let row = words.into_iter().chain(numbers.map(Cell::from));
                table.row(row.chain([run.best().topology.as_str().into()]));
            }
        }
    }
    table
}

impl Effort {
    /// How much a race is worth: lenses, seeds, gradients.
    pub(super) fn race(self) -> (usize, u64, u64) {
        self.pick((SUBJECTS.len(), 5, 12_000), (1, 2, 200))
    }
}
