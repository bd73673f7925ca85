//! Local optimization in the background, on a copy of the design.

use super::run::{Engine, RunKind, RunStatus, RunView, thin_history};
use crate::lens::glass::Glass;
use crate::lens::{Lens, Parameter};
use crate::merit::{Goal, TermValue};
use crate::optimize::{DescentMethod, LimitPrice, OptimizationProgress, Optimizer};
use serde::{Deserialize, Serialize};
use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

/// The maximum number of points of the merit history.
const MAX_HISTORY: usize = 2000;
/// The maximum number of lenses along the way.
const MAX_CURVE: usize = 300;

/// A specification of an optimization.
#[derive(Debug, Clone, PartialEq)]
pub struct OptimizationRequest {
    /// The descent method.
    pub method: DescentMethod,
    /// The lens to start from.
    pub lens: Arc<Lens>,
    /// The merit function.
    pub goal: Goal,
    /// The error allowed of the merit, relative to the size of the spots.
    pub tolerance: f64,
    /// The glasses that those of the lens are exchanged for afterwards; `None` to keep them.
    pub glasses: Option<Arc<[&'static Glass]>>,
}

/// Makes the optimizer of a request.
pub type OptimizerFactory =
    dyn Fn(&OptimizationRequest) -> Result<Box<dyn Optimizer>, String> + Send;

/// The state of an optimization.
#[derive(Debug, Clone)]
pub struct OptimizationSnapshot {
    /// The request, with the lens that the optimization started from.
    pub request: Arc<OptimizationRequest>,
    /// The outcome of the last step; `None` before the first.
    pub progress: Option<OptimizationProgress>,
    /// The best lens so far.
    pub best: Arc<Lens>,
    /// The lens at the current step.
    pub current: Arc<Lens>,
    /// The terms of the merit for the lens that the optimization started from.
    pub initial_terms: Vec<TermValue>,
    /// The terms of the merit for the best lens so far.
    pub best_terms: Vec<TermValue>,
    /// The limits that hold the best lens verified last, with their prices.
    pub limits: Vec<LimitPrice>,
    /// The merit against the step, with at most a few thousand points over the whole run.
    pub history: Vec<MeritSample>,
    /// The lenses along the way.
    pub curve: Arc<OptimizationCurve>,
}

/// The course of an optimization: lenses along it, to which a designer can go back.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OptimizationCurve {
    /// The variables.
    pub parameters: Vec<Parameter>,
    /// Steps in order, at most a few hundred over the whole run.
    pub points: Vec<CurvePoint>,
}

/// A step of an optimization.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CurvePoint {
    /// The number of steps so far.
    pub step: usize,
    /// The merit.
    pub merit: f64,
    /// The values of the variables.
    pub values: Vec<f64>,
}

impl OptimizationCurve {
    /// The step that is nearest to a number of steps.
    pub fn nearest(&self, step: usize) -> Option<&CurvePoint> {
        self.points.iter().min_by_key(|point| point.step.abs_diff(step))
    }

    /// A lens with the values of a step.
    pub fn lens_at(&self, point: &CurvePoint, lens: &Lens) -> Lens {
        let mut lens = lens.clone();
        for (parameter, value) in self.parameters.iter().zip(&point.values) {
            lens.set(*parameter, *value);
        }
        // A lens that was checked has pickups that can be followed.
        lens.with_pickups().unwrap_or(lens)
    }
}

/// A point of the merit history.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeritSample {
    /// The number of steps so far.
    pub step: usize,
    /// The merit of the current lens.
    pub current: f64,
    /// The merit of the best lens so far.
    pub best: f64,
}

impl RunView<OptimizationSnapshot> {
    /// The lens to show: the current one while the optimization is active, the best one afterwards.
    pub fn displayed_lens(&self) -> Option<&Arc<Lens>> {
        let snapshot = self.snapshot.as_ref()?;
        Some(if self.is_active() { &snapshot.current } else { &snapshot.best })
    }
}

/// An optimizer with its history.
pub(super) struct OptimizationEngine {
    optimizer: Box<dyn Optimizer>,
    state: OptimizationSnapshot,
    stride: usize,
    curve_stride: usize,
}

impl OptimizationEngine {
    pub(super) fn start(
        factory: &OptimizerFactory,
        request: OptimizationRequest,
    ) -> Result<Self, String> {
        let optimizer = factory(&request)?;
        let initial_terms = optimizer.terms().unwrap_or_default();
        let merit = initial_terms.iter().map(|term| term.weight * term.value).sum();
        let state = OptimizationSnapshot {
            progress: None,
            best: Arc::clone(&request.lens),
            current: Arc::clone(&request.lens),
            request: Arc::new(request),
            initial_terms,
            best_terms: Vec::new(),
            limits: Vec::new(),
            history: vec![MeritSample { step: 0, current: merit, best: merit }],
            curve: Arc::default(),
        };
        let mut engine = Self { optimizer, state, stride: 1, curve_stride: 1 };
        engine.record_curve(0, merit);
        Ok(engine)
    }

    /// Adds the present lens to the curve.
    fn record_curve(&mut self, step: usize, merit: f64) {
        if !merit.is_finite() || !step.is_multiple_of(self.curve_stride) {
            return;
        }
        let lens = self.optimizer.current();
        // The curve has the values of the variables alone.
        if !has_media_of(lens, &self.state.request.lens) {
            return;
        }
        let curve = Arc::make_mut(&mut self.state.curve);
        if curve.points.is_empty() {
            let variables = &self.state.request.lens.variables;
            curve.parameters = variables.iter().map(|variable| variable.parameter).collect();
        }
        let values = curve.parameters.iter().map(|p| lens.get(*p).unwrap_or(0.0)).collect();
        curve.points.push(CurvePoint { step, merit, values });
        let step = |point: &CurvePoint| point.step;
        thin_history(&mut curve.points, &mut self.curve_stride, MAX_CURVE, step);
    }

    /// A lens with the merit function that it was optimized for.
    fn with_goal(&self, lens: &Lens) -> Lens {
        Lens { merit: Some(self.state.request.goal.clone()), ..lens.clone() }
    }
}

/// True if all gaps of two lenses have the same media.
fn has_media_of(lens: &Lens, other: &Lens) -> bool {
    let media = other.surfaces.iter().map(|row| &row.medium);
    lens.surfaces.iter().map(|row| &row.medium).eq(media)
}

impl Engine for OptimizationEngine {
    const KIND: RunKind = RunKind::Optimization;
    const THREAD: &'static str = "optimizer";
    const INTERVAL: Duration = Duration::from_millis(33);

    type Input = OptimizationRequest;
    type Request = Infallible;
    type Report = Infallible;
    type Snapshot = OptimizationSnapshot;

    fn step(&mut self) -> Result<bool, String> {
        let progress = self.optimizer.step();
        let finished = progress.finished;
        if progress.step.is_multiple_of(self.stride) || finished {
            let OptimizationProgress { step, merit: current, best, .. } = progress;
            self.state.history.push(MeritSample { step, current, best });
        }
        self.record_curve(progress.step, progress.merit);
        let step = |sample: &MeritSample| sample.step;
        thin_history(&mut self.state.history, &mut self.stride, MAX_HISTORY, step);
        self.state.progress = Some(progress);
        Ok(finished)
    }

    fn on_status(&mut self, status: RunStatus) -> Result<(), String> {
        // The lens at which the optimizer was stopped may be better than the best one that is verified.
        if status == RunStatus::Stopped {
            self.optimizer.verify_best();
        }
        Ok(())
    }

    fn handle(&mut self, request: Infallible) -> Result<Option<RunStatus>, String> {
        match request {}
    }

    fn snapshot(&mut self) -> OptimizationSnapshot {
        OptimizationSnapshot {
            best: Arc::new(self.with_goal(self.optimizer.best())),
            current: Arc::new(self.with_goal(self.optimizer.current())),
            best_terms: self.optimizer.terms().unwrap_or_default(),
            limits: self.optimizer.binding_limits().to_vec(),
            ..self.state.clone()
        }
    }
}
