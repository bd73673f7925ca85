//! What a step of a search costs.

use super::clock::time_ms;
use super::double_gauss::double_gauss;
use super::rates::RateStatistics;
use super::trace::BenchmarkError;
use crate::lens::{Lens, Parameter, Quantity, Variable};
use crate::merit::{Goal, PupilEdge, Term, WeightedTerm};
use crate::optimize::{DescentMethod, start};
use rayon::ThreadPoolBuilder;
use serde::Serialize;

/// Spots are good to this share of their radius.
const TOLERANCE: f64 = 1e-6;

/// What steps of searches cost on one core.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StepCosts {
    /// How many numbers are free: all curvatures and thicknesses.
    pub variables: usize,
    /// How many fields there are.
    pub fields: usize,
    /// How good the spots are, relative.
    pub tolerance: f64,
    /// A search each.
    pub rows: Vec<StepRow>,
}

/// One search.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StepRow {
    /// What it is called.
    pub name: &'static str,
    /// Milliseconds a step: the median of all, those included that find the rays anew.
    pub ms_per_iteration: f64,
    /// The mean, in which finding the rays anew has its share.
    pub mean: f64,
    /// The fastest step.
    pub min: f64,
    /// The slowest step.
    pub max: f64,
    /// Rays of one evaluation.
    pub rays: usize,
    /// The estimated error of the spots' mean square, relative.
    pub error: f64,
    /// The mean square radius of the spots before and after, in mm².
    pub spot_before: f64,
    /// The same after all steps.
    pub spot_after: f64,
}

/// Times `steps` steps of every search on one core.
pub fn measure_step_costs(steps: usize) -> Result<StepCosts, BenchmarkError> {
    let clipped = with_all_variables(double_gauss());
    let mut clear = clipped.clone();
    clear.surfaces.iter_mut().for_each(|row| row.semi_diameter = None);
    let searches = [
        ("adam_clear", DescentMethod::Adam, &clear),
        ("adam_clipped", DescentMethod::Adam, &clipped),
        ("dls_clear", DescentMethod::DampedLeastSquares, &clear),
        ("dls_clipped", DescentMethod::DampedLeastSquares, &clipped),
    ];
    let pool = ThreadPoolBuilder::new().num_threads(1).build()?;
    let row = |(name, method, lens)| pool.install(|| time(name, method, lens, steps));
    Ok(StepCosts {
        variables: clear.variables.len(),
        fields: clear.fields.values.len(),
        tolerance: TOLERANCE,
        rows: searches.into_iter().map(row).collect::<Result<_, _>>()?,
    })
}

/// All curvatures of surfaces that bend light, and all thicknesses.
fn with_all_variables(mut lens: Lens) -> Lens {
    let bent = |i: usize| (!lens.surfaces[i].stop).then_some((i, Quantity::Curvature));
    let curvatures = (0..lens.surfaces.len()).filter_map(bent);
    let thicknesses = (0..lens.surfaces.len()).map(|i| (i, Quantity::Thickness));
    let variable =
        |(i, quantity)| Variable { parameter: Parameter::new(i, quantity), min: None, max: None };
    lens.variables = curvatures.chain(thicknesses).map(variable).collect();
    lens
}

fn time(
    name: &'static str,
    method: DescentMethod,
    lens: &Lens,
    steps: usize,
) -> Result<StepRow, BenchmarkError> {
    let terms = vec![
        WeightedTerm { term: Term::Spot, weight: 1.0 },
        WeightedTerm { term: Term::FocalLength(99.5), weight: 1e-2 },
    ];
    let goal = Goal { terms, pupil: PupilEdge::Frozen, zoom_ratios: Vec::new() };
    let mut search = start(method, lens, &goal, TOLERANCE)?;
    let before = search.terms()?;
    let mut times = Vec::with_capacity(steps);
    for _ in 0..steps {
        let (progress, ms) = time_ms(|| search.step());
        if progress.finished {
            break;
        }
        times.push(ms);
    }
    let after = search.terms()?;
    let mean = times.iter().sum::<f64>() / times.len().max(1) as f64;
    let RateStatistics { median, min, max } = RateStatistics::of(times);
    Ok(StepRow {
        name,
        ms_per_iteration: median,
        mean,
        min,
        max,
        rays: before[0].rays,
        error: before[0].error / before[0].value,
        spot_before: before[0].value,
        spot_after: after[0].value,
    })
}
