//! The cost of a step of the local optimizers.

use super::double_gauss::double_gauss;
use super::timing::{RateStatistics, time_ms};
use super::trace::BenchmarkError;
use crate::lens::{Lens, Parameter, Quantity, Variable};
use crate::merit::{Goal, LimitTreatment, PupilEdge, Term, WeightedTerm};
use crate::optimize::{DescentMethod, start};
use rayon::ThreadPoolBuilder;
use serde::Serialize;
use std::sync::atomic::{AtomicBool, Ordering};

/// The relative accuracy of the spot radii.
const TOLERANCE: f64 = 1e-6;

/// The cost of the steps of local optimizers on one core.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StepCosts {
    /// The number of variables: all curvatures and thicknesses.
    pub variables: usize,
    /// The number of fields.
    pub fields: usize,
    /// The relative accuracy of the spot radii.
    pub tolerance: f64,
    /// One row per optimizer.
    pub rows: Vec<StepRow>,
}

/// The cost of one optimizer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StepRow {
    /// The name of the optimizer.
    pub name: &'static str,
    /// The median time of a step in milliseconds, steps that find the rays anew included.
    pub ms_per_iteration: f64,
    /// The mean time of a step in milliseconds.
    pub mean: f64,
    /// The fastest step, in milliseconds.
    pub min: f64,
    /// The slowest step, in milliseconds.
    pub max: f64,
    /// The number of rays of one evaluation.
    pub rays: usize,
    /// The estimated relative error of the mean square spot radius.
    pub error: f64,
    /// The mean square spot radius before all steps, in mm².
    pub spot_before: f64,
    /// The mean square spot radius after all steps, in mm².
    pub spot_after: f64,
}

/// Times `steps` steps of every local optimizer on one core; once `stop` is true, those whose steps
/// are all timed are returned.
pub fn measure_step_costs(steps: usize, stop: &AtomicBool) -> Result<StepCosts, BenchmarkError> {
    let clipped = with_all_variables(double_gauss());
    let mut clear = clipped.clone();
    clear.surfaces.iter_mut().for_each(|row| row.semi_diameter = None);
    let searches = [
        ("adam_clear", DescentMethod::Adam, &clear),
        ("adam_clipped", DescentMethod::Adam, &clipped),
        ("trust_region_clear", DescentMethod::TrustRegion, &clear),
        ("trust_region_clipped", DescentMethod::TrustRegion, &clipped),
        ("dls_clear", DescentMethod::DampedLeastSquares, &clear),
        ("dls_clipped", DescentMethod::DampedLeastSquares, &clipped),
    ];
    let pool = ThreadPoolBuilder::new().num_threads(1).build()?;
    let mut rows = Vec::new();
    for (name, method, lens) in searches {
        rows.extend(pool.install(|| time(name, method, lens, steps, stop))?);
    }
    Ok(StepCosts {
        variables: clear.variables.len(),
        fields: clear.fields.values.len(),
        tolerance: TOLERANCE,
        rows,
    })
}

/// The lens with all curvatures of refracting surfaces and all thicknesses as variables.
fn with_all_variables(mut lens: Lens) -> Lens {
    let curvature = |i: usize| (!lens.surfaces[i].stop).then_some((i, Quantity::Curvature));
    let curvatures = (0..lens.surfaces.len()).filter_map(curvature);
    let thicknesses = (0..lens.surfaces.len()).map(|i| (i, Quantity::Thickness));
    let variable =
        |(i, quantity)| Variable { parameter: Parameter::new(i, quantity), min: None, max: None };
    lens.variables = curvatures.chain(thicknesses).map(variable).collect();
    lens
}

/// The cost of the steps of a method; `None` once `stop` is true.
fn time(
    name: &'static str,
    method: DescentMethod,
    lens: &Lens,
    steps: usize,
    stop: &AtomicBool,
) -> Result<Option<StepRow>, BenchmarkError> {
    let terms =
        vec![WeightedTerm::new(Term::Spot, 1.0), WeightedTerm::new(Term::FocalLength(99.5), 1e-2)];
    let goal = Goal {
        terms,
        pupil: PupilEdge::Frozen,
        zoom_ratios: Vec::new(),
        limits: LimitTreatment::default(),
    };
    let mut search = start(method, lens, &goal, TOLERANCE)?;
    let before = search.terms()?;
    let mut times = Vec::with_capacity(steps);
    for _ in 0..steps {
        if stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        let (progress, ms) = time_ms(|| search.step());
        if progress.finished {
            break;
        }
        times.push(ms);
    }
    let after = search.terms()?;
    let mean = times.iter().sum::<f64>() / times.len().max(1) as f64;
    let RateStatistics { median, min, max } = RateStatistics::of(times);
    Ok(Some(StepRow {
        name,
        ms_per_iteration: median,
        mean,
        min,
        max,
        rays: before[0].rays,
        error: before[0].error / before[0].value,
        spot_before: before[0].value,
        spot_after: after[0].value,
    }))
}
