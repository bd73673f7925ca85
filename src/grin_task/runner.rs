//! A search for a field, one step at a time: the caller owns the loop.

use super::check::TaskError;
use super::descent::{Descent, Problem, Step};
use super::hold::Hold;
use super::measured::{Known, known};
use super::medium::Medium;
use super::scene::{Counts, Shot, ViewResult, redraw, setups, shots};
use super::source::Draw;
use super::task::{Start, Task};
use crate::grin::field::Diagonal;
use crate::grin::{Integrator, Limits, Setup};

/// Steps between two looks at how rays are traced, once the field has taken shape.
const REPLAN: usize = 16;
/// Steps between two judgements of the field by the same rays.
const JUDGE: usize = 20;

/// What a step did.
#[derive(Debug, Clone, PartialEq)]
pub struct Progress {
    /// Steps so far.
    pub step: usize,
    /// Steps that the task allows.
    pub most: usize,
    /// The level that is worked at, counted from 0.
    pub level: usize,
    /// Nodes along a side, or coefficients.
    pub nodes: usize,
    /// The loss of the current field by the rays of this step, in mm².
    pub loss: f64,
    /// The loss of the best field by the rays that all fields are judged by.
    pub best: f64,
    /// What became of the rays of this step that count for the loss; nothing for least squares,
    /// which look at them when the field is judged.
    pub counts: Counts,
    /// Whether the search is at its end.
    pub finished: bool,
}

/// How a field does by the rays that all fields are judged by.
#[derive(Debug, Clone, PartialEq)]
pub struct Judgement {
    /// The loss, in mm².
    pub loss: f64,
    /// The views, those of weight 0 included.
    pub views: Vec<ViewResult>,
}

/// A search for the field of a task. It is the same on any number of threads.
#[derive(Debug)]
pub struct Runner {
    task: Task,
    hold: Hold,
    level: usize,
    /// Steps at this level.
    taken: usize,
    steps: usize,
    rays: u64,
    current: Medium,
    limits: Limits,
    descent: Descent,
    setups: Vec<Setup<f64>>,
    /// Where rays shall go that are measured.
    known: Known,
    /// The rays of the steps, where they are always the same.
    shots: Vec<Shot>,
    best: Medium,
    best_loss: f64,
    finished: bool,
}

impl Runner {
    /// Begins a search.
    ///
    /// # Errors
    /// A task that cannot be worked on.
    pub fn new(task: &Task) -> Result<Self, TaskError> {
        task.check()?;
        task.check_volumes()?;
        let known = known(task)?;
        let current = Medium::first(task, task.levels[0].nodes)?;
        let setups = setups(task, current.field(), Draw::Step(0))?;
        let mut runner = Self {
            task: task.clone(),
            hold: Hold::new(task),
            level: 0,
            taken: 0,
            steps: 0,
            rays: 0,
            best: current.clone(),
            best_loss: f64::INFINITY,
            limits: Limits::even(0, [0.0; 2], 0.0),
            descent: Descent::new(task.method, 0),
            shots: shots(task, &known, &setups, Draw::Step(0))?,
            known,
            current,
            setups,
            finished: false,
        };
        runner.begin_level()?;
        runner.best = runner.makeable();
        runner.keep_best()?;
        Ok(runner)
    }

    /// The same search by the Hessian that a trilinear field has between its nodes, which leaves out
    /// what the jumps of its slope bring: for comparison. See [`Diagonal`].
    #[must_use]
    pub fn with_exact_hessian(mut self) -> Self {
        self.current.set_diagonal(Diagonal::Exact);
        self
    }

    /// The task.
    pub fn task(&self) -> &Task {
        &self.task
    }

    /// The field at the current step.
    pub fn current(&self) -> &Medium {
        &self.current
    }

    /// The best field so far, of those that a maker can make: it keeps the limits of the index and
    /// of the slope.
    pub fn best(&self) -> &Medium {
        &self.best
    }

    /// Rays traced for the loss so far, each with its way back.
    pub fn rays(&self) -> u64 {
        self.rays
    }

    /// Steps so far.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// How rays of the first view are traced now: integrator and step.
    pub fn tracing(&self) -> (Integrator, f64) {
        let setup = &self.setups[0];
        (setup.integrator, setup.step)
    }

    /// Takes one step.
    ///
    /// # Errors
    /// A field that cannot be made, which a checked task does not have.
    pub fn step(&mut self) -> Result<Progress, TaskError> {
        if self.finished {
            return Ok(self.progress(f64::NAN, Counts::default()));
        }
        if self.is_replanning_due() {
            self.replan()?;
        }
        let Step { loss, counts, settled, .. } = self.descend()?;
        self.steps += 1;
        self.taken += 1;
        // What seems settled may be so only for rays that are traced too coarsely.
        let settled = settled && !self.replan()?;
        if settled || self.taken >= self.task.levels[self.level].steps {
            self.keep_best()?;
            self.end_level()?;
        } else if self.taken.is_multiple_of(JUDGE) {
            self.keep_best()?;
        }
        Ok(self.progress(loss, counts))
    }

    /// Judges the current field, so that the best one is known; to be called when a search is
    /// stopped before its end.
    ///
    /// # Errors
    /// As [`Self::step`].
    pub fn settle(&mut self) -> Result<(), TaskError> {
        self.keep_best()
    }

    /// How a field does by the rays that all fields are judged by, traced as well as it needs; and
    /// back, so that chaotic ones are found.
    ///
    /// # Errors
    /// As [`Self::step`].
    pub fn judge(&self, medium: &Medium) -> Result<Judgement, TaskError> {
        let mut gradient = vec![0.0; medium.field().parameters().len()];
        self.judge_by(medium, |shot| shot.descend(medium.field(), &mut gradient))
    }

    fn judge_by(
        &self,
        medium: &Medium,
        of: impl FnMut(&Shot) -> Result<ViewResult, TaskError>,
    ) -> Result<Judgement, TaskError> {
        let setups = setups(&self.task, medium.field(), Draw::Judge)?;
        let shots = shots(&self.task, &self.known, &setups, Draw::Judge)?;
        let views: Vec<ViewResult> = shots.iter().map(of).collect::<Result<_, _>>()?;
        let weighted = shots.iter().zip(&views).map(|(shot, view)| shot.share(view.loss));
        let loss = self.hold.look(medium.field()) + weighted.sum::<f64>();
        Ok(Judgement { loss, views })
    }

    fn progress(&self, loss: f64, counts: Counts) -> Progress {
        Progress {
            step: self.steps,
            most: self.task.levels.iter().map(|level| level.steps).sum(),
            level: self.level,
            nodes: self.current.nodes(),
            loss,
            best: self.best_loss,
            counts,
            finished: self.finished,
        }
    }

    /// Chooses anew how rays are traced; whether that has changed.
    fn replan(&mut self) -> Result<bool, TaskError> {
        let draw = Draw::Step(self.steps);
        let new = setups(&self.task, self.current.field(), draw)?;
        let is_finer = |(new, old): (&Setup<f64>, &Setup<f64>)| new.step < 0.99 * old.step;
        let changed = new.iter().zip(&self.setups).any(is_finer);
        if changed {
            self.setups = new;
            self.shots = shots(&self.task, &self.known, &self.setups, draw)?;
            self.descent.restart();
        }
        Ok(changed)
    }

    fn is_replanning_due(&self) -> bool {
        self.taken.is_power_of_two() || self.taken.is_multiple_of(REPLAN)
    }

    /// One step of the method.
    fn descend(&mut self) -> Result<Step, TaskError> {
        if self.task.views.iter().any(|view| view.source.is_fresh()) {
            redraw(&self.task, &self.known, &mut self.shots, Draw::Step(self.steps))?;
        }
        let share = self.taken as f64 / self.task.levels[self.level].steps.max(1) as f64;
        let mut parameters = self.current.field().parameters().to_vec();
        let Self { current: shape, shots, hold, limits, descent, .. } = self;
        let step = descent.step(&mut parameters, &Problem { shape, shots, hold, limits }, share)?;
        shape.parameters_mut().copy_from_slice(&parameters);
        let wanted = self.shots.iter().filter(|shot| shot.is_wanted()).map(Shot::count);
        self.rays += (step.evaluations * wanted.sum::<usize>()) as u64;
        Ok(step)
    }

    /// Keeps the current field if it is better than the best one.
    fn keep_best(&mut self) -> Result<(), TaskError> {
        let medium = self.makeable();
        let field = medium.field();
        let loss = self.judge_by(&medium, |shot| shot.look(field))?.loss;
        if loss < self.best_loss {
            self.best_loss = loss;
            self.best = medium;
        }
        Ok(())
    }

    /// The current field as a maker can make it.
    fn makeable(&self) -> Medium {
        let Task { space, limits, edge, .. } = self.task;
        let bounded = self.current.bounded(&self.task.spaces(), [limits.low, limits.high]);
        let Some(limit) = limits.slope else { return bounded };
        let middle = || {
            let extremes = self.task.extremes(&bounded);
            0.5 * (extremes.low + extremes.high).clamp(2.0 * limits.low, 2.0 * limits.high)
        };
        let start = match self.task.start {
            Start::Uniform(index) => Some(index),
            Start::Volume(_) => None,
        };
        let towards = edge.map(|edge| edge.index).or(start).unwrap_or_else(middle);
        bounded.flattened(space, limit, towards)
    }

    fn end_level(&mut self) -> Result<(), TaskError> {
        if self.level + 1 == self.task.levels.len() {
            self.finished = true;
            return Ok(());
        }
        self.level += 1;
        self.current = self.current.refined(self.task.field, self.task.levels[self.level].nodes)?;
        self.begin_level()?;
        let draw = Draw::Step(self.steps);
        self.setups = setups(&self.task, self.current.field(), draw)?;
        self.shots = shots(&self.task, &self.known, &self.setups, draw)?;
        self.keep_best()
    }

    /// Limits and method of a level.
    fn begin_level(&mut self) -> Result<(), TaskError> {
        let Task { space, limits, edge, method, .. } = self.task;
        let ranges = self.current.ranges(space, limits, edge);
        if !ranges.iter().any(|[low, high]| low < high) {
            return Err(TaskError::NothingFree { nodes: self.current.nodes() });
        }
        self.limits = Limits { ranges, change: limits.change };
        self.limits.project(self.current.parameters_mut());
        self.descent = Descent::new(method, self.level);
        self.taken = 0;
        Ok(())
    }
}
