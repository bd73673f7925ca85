//! Terms of real rays: spots and distortion.

use super::first_order::{image_scale, slopes};
use super::sum::{DerivativeLevel, SumOfSquares};
use super::{EvaluationContext, MeritError};
use crate::lens::{FieldKind, Object};
use crate::math::Vec3;
use crate::pupil::{PupilMoments, QuadraticIntegrand};
use crate::trace::{AdjointSeed, Fate, ImagePoints, TraceSink, Tracer};
use nalgebra::{DMatrix, DVector};

/// The traced rays of one wavelength.
struct SpotRays {
    tracer: Tracer<f64>,
    points: ImagePoints<f64>,
    /// The weight of each ray in the sum.
    weights: Vec<f64>,
}

/// The polychromatic centroid of a field in mm, and the weight of the field.
struct Centroid {
    x: f64,
    y: f64,
    share: f64,
}

/// The normalization of a spot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Normalization {
    /// By the area of its pupil: a mean square radius.
    PupilArea,
    /// None: the integral over the pupil (3.24).
    Unnormalized,
}

/// Adds the spots about their polychromatic centroids.
pub(super) fn add_spot(
    context: &EvaluationContext<'_>,
    normalization: Normalization,
    sum: &mut SumOfSquares,
) -> Result<(), MeritError> {
    let wavelengths = 0..context.sampling.channels.len();
    let traced: Result<Vec<_>, _> =
        wavelengths.map(|wavelength| trace(context, wavelength, normalization)).collect();
    let traced = traced?;
    let centroids: Vec<_> =
        (0..context.sampling.fields.len()).map(|field| centroid(context, &traced, field)).collect();
    for (channel, traced) in context.sampling.channels.iter().zip(&traced) {
        for (field, centroid) in centroids.iter().enumerate() {
            for i in channel.range(field) {
                let (x, y) = (traced.points.x[i] - centroid.x, traced.points.y[i] - centroid.y);
                sum.value += traced.weights[i] * (x * x + y * y);
            }
        }
    }
    match sum.level {
        DerivativeLevel::Value => return Ok(()),
        DerivativeLevel::Gradient => add_gradient(context, &traced, &centroids, sum),
        DerivativeLevel::Normal => add_normal_matrix(context, &traced, &centroids, sum),
    }
    add_edge_motion(context, normalization, &centroids, sum);
    Ok(())
}

/// Adds the contribution of the moving pupil edges to the derivatives.
fn add_edge_motion(
    context: &EvaluationContext<'_>,
    normalization: Normalization,
    centroids: &[Centroid],
    sum: &mut SumOfSquares,
) {
    let costs = context.sampling.pupils.iter().map(|pupil| {
        let Centroid { x, y, .. } = centroids[pupil.field];
        let PupilMoments { area, centroid, spread } = pupil.moments;
        let [dx, dy] = [centroid[0] - x, centroid[1] - y];
        let spread = spread + area * (dx * dx + dy * dy);
        let share = pupil.share;
        let (square, constant) = match normalization {
            Normalization::PupilArea if area > 0.0 => {
                (share / area, -share * spread / (area * area))
            }
            Normalization::PupilArea => (0.0, 0.0),
            Normalization::Unnormalized => (share, 0.0),
        };
        QuadraticIntegrand { center: [x, y], square, constant }
    });
    sum.gradient += context.edge_motion(costs);
}

fn trace(
    context: &EvaluationContext<'_>,
    wavelength: usize,
    normalization: Normalization,
) -> Result<SpotRays, MeritError> {
    let channel = &context.sampling.channels[wavelength];
    let system = &context.systems.unclipped[wavelength];
    let tracer = Tracer::new(system).map_err(crate::lens::LensError::from)?;
    let mut points = ImagePoints::default();
    tracer.trace_batch(&channel.rays, &mut points);
    let lost = (0..channel.rays.len()).find(|i| !points.fate(*i).is_imaged());
    match lost {
        None => {
            Ok(SpotRays { tracer, points, weights: weights(context, wavelength, normalization) })
        }
        Some(i) => Err(lost_ray_error(context, wavelength, i, points.fate(i))),
    }
}

fn weights(
    context: &EvaluationContext<'_>,
    wavelength: usize,
    normalization: Normalization,
) -> Vec<f64> {
    let channel = &context.sampling.channels[wavelength];
    let mut weights = channel.weights.clone();
    if normalization == Normalization::Unnormalized {
        for pupil in context.sampling.pupils.iter().filter(|p| p.wavelength == wavelength) {
            weights[channel.range(pupil.field)].iter_mut().for_each(|w| *w *= pupil.moments.area);
        }
    }
    weights
}

fn lost_ray_error(
    context: &EvaluationContext<'_>,
    wavelength: usize,
    i: usize,
    fate: Fate,
) -> MeritError {
    let channel = &context.sampling.channels[wavelength];
    let field = channel.ends.iter().position(|end| i < *end).unwrap_or(0);
    let ray = i - channel.range(field).start;
    MeritError::RayLost { ray, field, zoom: context.zoom.zoom, um: channel.um, fate }
}

fn centroid(context: &EvaluationContext<'_>, traced: &[SpotRays], field: usize) -> Centroid {
    let (mut x, mut y, mut share) = (0.0, 0.0, 0.0);
    for (channel, traced) in context.sampling.channels.iter().zip(traced) {
        for i in channel.range(field) {
            let w = traced.weights[i];
            share += w;
            x += if channel.mirrored[field] { 0.0 } else { w * traced.points.x[i] };
            y += w * traced.points.y[i];
        }
    }
    let inverse = if share > 0.0 { 1.0 / share } else { 0.0 };
    Centroid { x: x * inverse, y: y * inverse, share }
}

/// Adds the derivatives. The centroid needs none: the sum is stationary with respect to it.
fn add_gradient(
    context: &EvaluationContext<'_>,
    traced: &[SpotRays],
    centroids: &[Centroid],
    sum: &mut SumOfSquares,
) {
    for (wavelength, traced) in traced.iter().enumerate() {
        let channel = &context.sampling.channels[wavelength];
        let mut seeds = vec![Vec3::default(); channel.rays.len()];
        for (field, centroid) in centroids.iter().enumerate() {
            for i in channel.range(field) {
                let w = 2.0 * traced.weights[i];
                let (x, y) = (traced.points.x[i] - centroid.x, traced.points.y[i] - centroid.y);
                seeds[i] = Vec3::new(w * x, w * y, 0.0);
            }
        }
        let seed = |i: usize| AdjointSeed { point: seeds[i], ..AdjointSeed::default() };
        let by_number = traced.tracer.gradient(&channel.rays, seed);
        sum.gradient += context.zoom.by_variables(context.systems, wavelength, &by_number);
    }
}

/// Adds the gradient and the Gauss-Newton matrix: `Σ w (∂x − ∂x̄)(∂x − ∂x̄)ᵀ = Σ w ∂x ∂xᵀ − W ∂x̄
/// ∂x̄ᵀ` for each field.
fn add_normal_matrix(
    context: &EvaluationContext<'_>,
    traced: &[SpotRays],
    centroids: &[Centroid],
    sum: &mut SumOfSquares,
) {
    let count = sum.gradient.len();
    // The mean slopes of x and y of every field.
    let mut means = vec![[DVector::zeros(count), DVector::zeros(count)]; centroids.len()];
    for (wavelength, traced) in traced.iter().enumerate() {
        let channel = &context.sampling.channels[wavelength];
        let moving = context.zoom.moving_parameters(wavelength);
        let (_, rows) = traced.tracer.jacobian(&channel.rays, &moving);
        let mut weighted = DMatrix::zeros(count, 2 * channel.rays.len());
        let mut slope = vec![0.0; count];
        for (field, centroid) in centroids.iter().enumerate() {
            let axes = channel.range(field).flat_map(|i| [(i, 0), (i, 1)]);
            for (i, axis) in axes {
                let w = traced.weights[i];
                let position =
                    [traced.points.x[i] - centroid.x, traced.points.y[i] - centroid.y][axis];
                let from = (2 * i + axis) * moving.len();
                let row = &rows[from..from + moving.len()];
                context.zoom.row_by_variables(
                    context.systems,
                    wavelength,
                    &moving,
                    row,
                    &mut slope,
                );
                let column = DVector::from_column_slice(&slope);
                sum.gradient.axpy(2.0 * w * position, &column, 1.0);
                if axis == 1 || !channel.mirrored[field] {
                    means[field][axis].axpy(w, &column, 1.0);
                }
                weighted.set_column(2 * i + axis, &(column * w.sqrt()));
            }
        }
        sum.normal.gemm(1.0, &weighted, &weighted.transpose(), 1.0);
    }
    for (mean, centroid) in means.iter().zip(centroids).filter(|(_, c)| c.share > 0.0) {
        for slope in mean {
            sum.normal.ger(-1.0 / centroid.share, slope, slope, 1.0);
        }
    }
}

/// Adds the mean square distance of the chief rays' image points from the paraxial image, in mm².
pub(super) fn add_distortion(
    context: &EvaluationContext<'_>,
    sum: &mut SumOfSquares,
) -> Result<(), MeritError> {
    let primary = context.zoom.primary;
    let heights = paraxial_heights(context)?;
    let system = &context.systems.unclipped[primary];
    let tracer = Tracer::new(system).map_err(crate::lens::LensError::from)?;
    let scale = image_scale(system, context.zoom.object);
    let scale_slope = slopes(context, sum.level, |system| image_scale(system, context.zoom.object));
    let moving = context.zoom.moving_parameters(primary);
    let chief = &context.sampling.chief_rays;
    let (hits, rows) = tracer.jacobian(chief, &moving);
    let total: f64 = context.sampling.fields.iter().map(|f| f.weight).sum();
    let mut slope = vec![0.0; sum.gradient.len()];
    for (field, height) in heights.iter().enumerate() {
        if context.sampling.is_dark(field) {
            continue;
        }
        if !hits.fate(field).is_imaged() {
            return Err(lost_chief_error(context, field, hits.fate(field)));
        }
        let weight = context.sampling.fields[field].weight / total;
        for (axis, position) in [hits.x[field], hits.y[field]].into_iter().enumerate() {
            let from = (2 * field + axis) * moving.len();
            let row = &rows[from..from + moving.len()];
            context.zoom.row_by_variables(context.systems, primary, &moving, row, &mut slope);
            let column = DVector::from_column_slice(&slope) - &scale_slope * height[axis];
            sum.add_residual(weight, position - scale * height[axis], &column);
        }
    }
    Ok(())
}

fn lost_chief_error(context: &EvaluationContext<'_>, field: usize, fate: Fate) -> MeritError {
    let um = context.sampling.channels[context.zoom.primary].um;
    MeritError::RayLost { ray: 0, field, zoom: context.zoom.zoom, um, fate }
}

/// The vector proportional to the paraxial image point, per field: `tan θ` along the direction of the
/// field, or the object height in mm.
fn paraxial_heights(context: &EvaluationContext<'_>) -> Result<Vec<[f64; 2]>, MeritError> {
    let refuse = |why| Err(MeritError::DoesNotApply { term: "distortion", why });
    let mut heights = Vec::new();
    for field in &context.sampling.fields {
        let size = field.x.hypot(field.y);
        let stretch = match (context.zoom.field_kind, context.zoom.object) {
            (FieldKind::Angle, Object::Infinity) if size >= 89.0 => {
                return refuse("a field of 90 degrees or more has no image at f tan(theta)");
            }
            (FieldKind::Angle, Object::Infinity) if size > 0.0 => size.to_radians().tan() / size,
            (FieldKind::Angle, Object::Infinity) | (FieldKind::ObjectHeight, _) => 1.0,
            (FieldKind::ImageHeight, _) | (FieldKind::Angle, Object::Finite(_)) => {
                return refuse(
                    "the fields are neither angles of a distant object nor object heights",
                );
            }
        };
        heights.push([stretch * field.x, stretch * field.y]);
    }
    Ok(heights)
}
