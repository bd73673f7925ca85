//! The mean square wavefront of the pupils, and what their Strehl ratio lacks of 1.
//!
//! Piston and the image point are those that make either least; as it is stationary in them, they are
//! held fixed in its derivatives. The radius of the reference sphere is that of the lens in
//! which the rays were found.

use super::scoped_part::ScopedPart;
use super::spot::lost_ray_error;
use super::sum::{DerivativeLevel, SumOfSquares};
use super::{EvaluationContext, MeritError};
use crate::analysis::{FittedWavefront, ImageRay, WavefrontCost, WavefrontReference, image_rays};
use crate::lens::TermScope;
use crate::pupil::TracedPupil;
use crate::trace::{AdjointSeed, Landings, Rays, SystemGradient, TraceSink as _, Tracer};
use nalgebra::DMatrix;
use std::ops::Range;

/// The rays of one pupil in a term.
struct PupilPart {
    wavelength: usize,
    field: usize,
    /// Its rays among those of the wavelength.
    range: Range<usize>,
    /// The weights of its rays.
    weights: Vec<f64>,
    fitted: FittedWavefront,
    cost: WavefrontCost,
}

/// Adds the mean costs of the wavefronts.
pub(super) fn add_wavefront(
    context: &EvaluationContext<'_>,
    cost: WavefrontCost,
    scope: TermScope,
    sum: &mut SumOfSquares,
) -> Result<(), MeritError> {
    let part = ScopedPart::new(context, scope)?;
    for wavelength in 0..context.sampling.channels.len() {
        let system = &context.systems.unclipped[wavelength];
        let tracer = Tracer::new(system).map_err(crate::lens::LensError::from)?;
        let pupils = fit_pupils(context, &tracer, wavelength, (part, cost))?;
        for pupil in &pupils {
            sum.value += pupil.weights.iter().sum::<f64>() * pupil.fitted.cost(cost);
        }
        if sum.level > DerivativeLevel::Value {
            add_gradient(context, &tracer, wavelength, &pupils, sum);
            add_edge_motion(context, &tracer, &pupils, sum)?;
        }
        if sum.level == DerivativeLevel::Normal {
            add_normal_matrix(context, &tracer, wavelength, &pupils, sum);
        }
    }
    Ok(())
}

/// The pupils of a wavelength that a term is about, those without light left out.
fn fit_pupils(
    context: &EvaluationContext<'_>,
    tracer: &Tracer<f64>,
    wavelength: usize,
    (part, cost): (ScopedPart, WavefrontCost),
) -> Result<Vec<PupilPart>, MeritError> {
    let channel = &context.sampling.channels[wavelength];
    let system = &context.systems.unclipped[wavelength];
    let rays = image_rays(tracer, &channel.rays, |i| channel.paths[i]);
    let mut pupils = Vec::new();
    for pupil in context.sampling.pupils.iter().filter(|pupil| pupil.wavelength == wavelength) {
        let factor = part.factor(pupil.field, wavelength);
        let range = channel.range(pupil.field);
        let Some(form) = pupil.reference.filter(|_| factor > 0.0 && !range.is_empty()) else {
            continue;
        };
        let lost = |i: &usize| rays[*i].is_none();
        if let Some(i) = range.clone().find(lost) {
            let mut landed = Landings::default();
            tracer.trace_batch(&channel.rays, &mut landed);
            return Err(lost_ray_error(context, wavelength, i, landed.fate(i)));
        }
        let reference = WavefrontReference::new(system, channel.um, form);
        let own: Vec<ImageRay> = rays[range.clone()].iter().flatten().copied().collect();
        let weights: Vec<f64> = channel.weights[range.clone()].iter().map(|w| factor * w).collect();
        let mirrored = channel.mirrored[pupil.field];
        let fitted = FittedWavefront::new(reference, &own, &weights, mirrored);
        let brightest = |fitted: FittedWavefront| match cost {
            WavefrontCost::MeanSquare => fitted,
            WavefrontCost::StrehlLoss => fitted.brightest(&own, &weights, mirrored),
        };
        let fitted = fitted.map(brightest).ok_or(MISSES_SPHERE)?;
        pupils.push(PupilPart { wavelength, field: pupil.field, range, weights, fitted, cost });
    }
    Ok(pupils)
}

const MISSES_SPHERE: MeritError = MeritError::DoesNotApply {
    term: "wavefront",
    why: "a ray misses the reference sphere: its error is larger than the distance of the exit pupil",
};

fn add_gradient(
    context: &EvaluationContext<'_>,
    tracer: &Tracer<f64>,
    wavelength: usize,
    pupils: &[PupilPart],
    sum: &mut SumOfSquares,
) {
    let channel = &context.sampling.channels[wavelength];
    let mut seeds = vec![AdjointSeed::default(); channel.rays.len()];
    for pupil in pupils {
        for (i, weight) in pupil.weights.iter().enumerate() {
            let factor = weight * pupil.fitted.cost_slope(pupil.cost, i);
            seeds[pupil.range.start + i] = pupil.fitted.seed(i, factor);
        }
    }
    let by_number = tracer.gradient(&channel.rays, |i| seeds[i]);
    sum.gradient += context.zoom.by_variables(context.systems, wavelength, &by_number);
}

/// Adds the motion of the edges: the cost of a pupil changes by the excess that light at its edge brings,
/// over its area.
fn add_edge_motion(
    context: &EvaluationContext<'_>,
    tracer: &Tracer<f64>,
    pupils: &[PupilPart],
    sum: &mut SumOfSquares,
) -> Result<(), MeritError> {
    sum.gradient += context.sum_over_pupils(|sampled, traced| {
        let is_same = |part: &&PupilPart| {
            (part.wavelength, part.field) == (sampled.wavelength, sampled.field)
        };
        let Some(part) = pupils.iter().find(is_same) else { return Ok(None) };
        edge_motion(part, sampled.moments.area, tracer, traced).map(Some)
    })?;
    Ok(())
}

fn edge_motion(
    part: &PupilPart,
    area: f64,
    tracer: &Tracer<f64>,
    traced: &TracedPupil<'_>,
) -> Result<SystemGradient<f64>, MeritError> {
    let share = part.weights.iter().sum::<f64>() / area;
    let costs = |rays: &Rays<f64>| {
        let ends = image_rays(tracer, rays, |i| traced.path_to(rays.get(i)));
        let excess = |at: &ImageRay| part.fitted.cost_excess(part.cost, at);
        ends.iter().map(|at| share * at.as_ref().map_or(0.0, excess)).collect()
    };
    let why = "the pupil is disconnected or not star-shaped, and the motion of its edge is unknown; \
               expected a goal with frozen pupils";
    traced.edge_motion_of_rays(costs).ok_or(MeritError::DoesNotApply { term: "wavefront", why })
}

/// Adds the Gauss-Newton matrix of the path differences without piston and tilt.
fn add_normal_matrix(
    context: &EvaluationContext<'_>,
    tracer: &Tracer<f64>,
    wavelength: usize,
    pupils: &[PupilPart],
    sum: &mut SumOfSquares,
) {
    let channel = &context.sampling.channels[wavelength];
    let moving = context.zoom.moving_parameters(wavelength);
    let by_variable = context.zoom.parameter_slopes(context.systems, wavelength, &moving);
    for pupil in pupils {
        let rays: Rays<f64> = pupil.range.clone().map(|i| channel.rays.get(i)).collect();
        let curvature = pupil.fitted.cost_curvature(pupil.cost);
        let roots: Vec<f64> = pupil.weights.iter().map(|w| (w * curvature).sqrt()).collect();
        let seed = |_, ray: usize| pupil.fitted.seed(ray.min(roots.len() - 1), 1.0);
        let slopes = tracer.slopes_of_rays(&rays, &moving, 1, seed);
        let mut rows = DMatrix::from_row_slice(roots.len(), moving.len(), &slopes);
        rows.row_iter_mut().zip(&roots).for_each(|(mut row, root)| row *= *root);
        let rows =
            pupil.fitted.without_piston_and_tilt(rows, &roots, channel.mirrored[pupil.field]);
        let by_variables = rows * &by_variable;
        sum.normal.gemm_tr(1.0, &by_variables, &by_variables, 1.0);
    }
}
