//! The optimization of a field, one step at a time: the caller owns the loop.

use super::field_solver::{FieldSolver, LossFunction, SolverStep};
use crate::grin::field::HessianDiagonal;
use crate::grin::{GrinSetup, Integrator};
use crate::grin_design::GrinTaskError;
use crate::grin_design::evaluation::loss::ViewResult;
use crate::grin_design::evaluation::outcome::RayCounts;
use crate::grin_design::evaluation::penalties::FieldPenalties;
use crate::grin_design::evaluation::targets::{MeasuredTargets, measure_targets};
use crate::grin_design::evaluation::views::{ViewRays, plan_views, resample_views, view_rays};
use crate::grin_design::field::GrinField;
use crate::grin_design::task::source::RaySet;
use crate::grin_design::task::{GrinTask, InitialField};
use crate::solve::ParameterBounds;

/// Steps between two choices of the tracing setup, once the field has taken shape.
const REPLAN_INTERVAL: usize = 16;
/// Steps between two evaluations of the field with the scoring rays.
const SCORE_INTERVAL: usize = 20;

/// The progress of an optimization after a step.
#[derive(Debug, Clone, PartialEq)]
pub struct GrinProgress {
    /// Steps so far.
    pub step: usize,
    /// The largest number of steps of the task.
    pub max_steps: usize,
    /// The current level, counted from 0.
    pub level: usize,
    /// Nodes along a side, or coefficients.
    pub nodes: usize,
    /// The loss of the current field for the rays of this step, in mm².
    pub loss: f64,
    /// The loss of the best field for the scoring rays.
    pub best: f64,
    /// The outcomes of the rays of this step that contribute to the loss; empty for least squares,
    /// which count rays only when the field is scored.
    pub counts: RayCounts,
    /// True if the optimization has finished.
    pub finished: bool,
}

/// The loss of a field for the scoring rays.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldScore {
    /// The loss, in mm².
    pub loss: f64,
    /// The results of the views, those of weight 0 included.
    pub views: Vec<ViewResult>,
}

/// The optimization of the field of a task. Its result does not depend on the number of threads.
#[derive(Debug)]
pub struct GrinOptimizer {
    task: GrinTask,
    penalties: FieldPenalties,
    level: usize,
    /// Steps at this level.
    level_steps: usize,
    steps: usize,
    rays: u64,
    current: GrinField,
    limits: ParameterBounds,
    solver: FieldSolver,
    setups: Vec<GrinSetup<f64>>,
    /// The measured targets of the views.
    measured: MeasuredTargets,
    /// The rays of the steps, where they are always the same.
    views: Vec<ViewRays>,
    best: GrinField,
    best_loss: f64,
    finished: bool,
}

impl GrinOptimizer {
    /// Starts the optimization of a task whose files have been read: see
    /// [`GrinTask::read_files`].
    ///
    /// # Errors
    /// A task that is invalid, or a file that has not been read.
    pub fn new(task: &GrinTask) -> Result<Self, GrinTaskError> {
        task.check()?;
        let measured = measure_targets(task)?;
        let current = GrinField::initial(task, task.levels[0].nodes)?;
        let setups = plan_views(task, current.index_field(), RaySet::Step(0))?;
        let mut runner = Self {
            task: task.clone(),
            penalties: FieldPenalties::new(task),
            level: 0,
            level_steps: 0,
            steps: 0,
            rays: 0,
            best: current.clone(),
            best_loss: f64::INFINITY,
            limits: ParameterBounds::uniform(0, [0.0; 2], 0.0),
            solver: FieldSolver::new(task.method, 0),
            views: view_rays(task, &measured, &setups, RaySet::Step(0))?,
            measured,
            current,
            setups,
            finished: false,
        };
        runner.begin_level()?;
        runner.best = runner.manufacturable();
        runner.update_best()?;
        Ok(runner)
    }

    /// The same optimization with the Hessian of a trilinear field inside its voxels, which ignores
    /// the jumps of its gradient: for comparison. See [`HessianDiagonal`].
    #[must_use]
    pub fn with_exact_hessian(mut self) -> Self {
        self.current.set_diagonal(HessianDiagonal::Exact);
        self
    }

    /// The task.
    pub fn task(&self) -> &GrinTask {
        &self.task
    }

    /// The field at the current step.
    pub fn current(&self) -> &GrinField {
        &self.current
    }

    /// The best manufacturable field so far: it satisfies the limits of the index and of its
    /// gradient.
    pub fn best(&self) -> &GrinField {
        &self.best
    }

    /// The number of rays traced for the loss so far, each forwards and backwards.
    pub fn rays_traced(&self) -> u64 {
        self.rays
    }

    /// Steps so far.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// The current integrator and step of the first view.
    pub fn tracing(&self) -> (Integrator, f64) {
        let setup = &self.setups[0];
        (setup.integrator, setup.step)
    }

    /// Takes one step.
    ///
    /// # Errors
    /// An invalid field, which a checked task does not have.
    pub fn step(&mut self) -> Result<GrinProgress, GrinTaskError> {
        if self.finished {
            return Ok(self.progress(f64::NAN, RayCounts::default()));
        }
        if self.is_replanning_due() {
            self.replan()?;
        }
        let SolverStep { loss, counts, converged: settled, .. } = self.take_step()?;
        self.steps += 1;
        self.level_steps += 1;
        // Convergence may be an artefact of rays that are traced too coarsely.
        let settled = settled && !self.replan()?;
        if settled || self.level_steps >= self.task.levels[self.level].steps {
            self.update_best()?;
            self.end_level()?;
        } else if self.level_steps.is_multiple_of(SCORE_INTERVAL) {
            self.update_best()?;
        }
        Ok(self.progress(loss, counts))
    }

    /// Scores the current field, so that the best one is known; to be called when an optimization
    /// is stopped before its end.
    ///
    /// # Errors
    /// As [`Self::step`].
    pub fn finish(&mut self) -> Result<(), GrinTaskError> {
        self.update_best()
    }

    /// Scores a field with the scoring rays, traced to the tolerance of the task, and retraced so
    /// that chaotic rays are found.
    ///
    /// # Errors
    /// As [`Self::step`].
    pub fn score(&self, field: &GrinField) -> Result<FieldScore, GrinTaskError> {
        let mut gradient = vec![0.0; field.index_field().parameters().len()];
        self.score_with(field, |view| view.add_gradient(field.index_field(), &mut gradient))
    }

    fn score_with(
        &self,
        field: &GrinField,
        of: impl FnMut(&ViewRays) -> Result<ViewResult, GrinTaskError>,
    ) -> Result<FieldScore, GrinTaskError> {
        let setups = plan_views(&self.task, field.index_field(), RaySet::Scoring)?;
        let views = view_rays(&self.task, &self.measured, &setups, RaySet::Scoring)?;
        let results: Vec<ViewResult> = views.iter().map(of).collect::<Result<_, _>>()?;
        let weighted = views.iter().zip(&results).map(|(view, result)| view.weighted(result.loss));
        let loss = self.penalties.value(field.index_field()) + weighted.sum::<f64>();
        Ok(FieldScore { loss, views: results })
    }

    fn progress(&self, loss: f64, counts: RayCounts) -> GrinProgress {
        GrinProgress {
            step: self.steps,
            max_steps: self.task.levels.iter().map(|level| level.steps).sum(),
            level: self.level,
            nodes: self.current.nodes(),
            loss,
            best: self.best_loss,
            counts,
            finished: self.finished,
        }
    }

    /// Chooses the tracing setups again; true if they have changed.
    fn replan(&mut self) -> Result<bool, GrinTaskError> {
        let set = RaySet::Step(self.steps);
        let new = plan_views(&self.task, self.current.index_field(), set)?;
        let is_finer = |(new, old): (&GrinSetup<f64>, &GrinSetup<f64>)| new.step < 0.99 * old.step;
        let changed = new.iter().zip(&self.setups).any(is_finer);
        if changed {
            self.setups = new;
            self.views = view_rays(&self.task, &self.measured, &self.setups, set)?;
            self.solver.restart();
        }
        Ok(changed)
    }

    fn is_replanning_due(&self) -> bool {
        self.level_steps.is_power_of_two() || self.level_steps.is_multiple_of(REPLAN_INTERVAL)
    }

    /// One step of the method.
    fn take_step(&mut self) -> Result<SolverStep, GrinTaskError> {
        if self.task.views.iter().any(|view| view.source.is_resampled()) {
            resample_views(&self.task, &self.measured, &mut self.views, RaySet::Step(self.steps))?;
        }
        let share = self.level_steps as f64 / self.task.levels[self.level].steps.max(1) as f64;
        let mut parameters = self.current.index_field().parameters().to_vec();
        let Self { current: shape, views, penalties, limits, solver, .. } = self;
        let step = solver.step(
            &mut parameters,
            &LossFunction { shape, views, penalties, limits },
            share,
        )?;
        shape.parameters_mut().copy_from_slice(&parameters);
        let wanted = self.views.iter().filter(|view| view.has_weight()).map(ViewRays::ray_count);
        self.rays += (step.evaluations * wanted.sum::<usize>()) as u64;
        Ok(step)
    }

    /// Replaces the best field by the current one if that is better.
    fn update_best(&mut self) -> Result<(), GrinTaskError> {
        let field = self.manufacturable();
        let loss = self.score_with(&field, |view| view.trace_result(field.index_field()))?.loss;
        if loss < self.best_loss {
            self.best_loss = loss;
            self.best = field;
        }
        Ok(())
    }

    /// The current field, projected onto the manufacturing limits.
    fn manufacturable(&self) -> GrinField {
        let GrinTask { space, limits, edge, .. } = self.task;
        let bounded = self.current.limit_index(&self.task.spaces(), [limits.low, limits.high]);
        let Some(limit) = limits.slope else { return bounded };
        let middle = || {
            let extremes = self.task.extremes(&bounded);
            0.5 * (extremes.low + extremes.high).clamp(2.0 * limits.low, 2.0 * limits.high)
        };
        let start = match self.task.start {
            InitialField::Uniform(index) => Some(index),
            InitialField::Volume(_) => None,
        };
        let towards = edge.map(|edge| edge.index).or(start).unwrap_or_else(middle);
        bounded.limit_slope(space, limit, towards)
    }

    fn end_level(&mut self) -> Result<(), GrinTaskError> {
        if self.level + 1 == self.task.levels.len() {
            self.finished = true;
            return Ok(());
        }
        self.level += 1;
        self.current = self.current.refine(self.task.field, self.task.levels[self.level].nodes)?;
        self.begin_level()?;
        let set = RaySet::Step(self.steps);
        self.setups = plan_views(&self.task, self.current.index_field(), set)?;
        self.views = view_rays(&self.task, &self.measured, &self.setups, set)?;
        self.update_best()
    }

    /// Sets the bounds and the method of a level.
    fn begin_level(&mut self) -> Result<(), GrinTaskError> {
        let GrinTask { space, limits, edge, method, .. } = self.task;
        let ranges = self.current.parameter_ranges(space, limits, edge);
        if !ranges.iter().any(|[low, high]| low < high) {
            return Err(GrinTaskError::NoFreeParameters { nodes: self.current.nodes() });
        }
        self.limits = ParameterBounds { ranges, max_change: limits.change };
        self.limits.project(self.current.parameters_mut());
        self.solver = FieldSolver::new(method, self.level);
        self.level_steps = 0;
        Ok(())
    }
}
