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
    scene: &EvaluationContext<'_>,
    per: Normalization,
    sum: &mut SumOfSquares,
) -> Result<(), MeritError> {
    let wavelengths = 0..scene.sampling.channels.len();
    let landed: Result<Vec<_>, _> =
        wavelengths.map(|wavelength| trace(scene, wavelength, per)).collect();
    let landed = landed?;
    let centroids: Vec<_> =
        (0..scene.sampling.fields.len()).map(|field| centroid(scene, &landed, field)).collect();
    for (color, landed) in scene.sampling.channels.iter().zip(&landed) {
        for (field, centroid) in centroids.iter().enumerate() {
            for i in color.range(field) {
                let (x, y) = (landed.points.x[i] - centroid.x, landed.points.y[i] - centroid.y);
                sum.value += landed.weights[i] * (x * x + y * y);
            }
        }
    }
    match sum.level {
        DerivativeLevel::Value => return Ok(()),
        DerivativeLevel::Gradient => add_gradient(scene, &landed, &centroids, sum),
        DerivativeLevel::Normal => add_normal_matrix(scene, &landed, &centroids, sum),
    }
    add_edge_motion(scene, per, &centroids, sum);
    Ok(())
}

/// Adds the contribution of the moving pupil edges to the derivatives.
fn add_edge_motion(
    scene: &EvaluationContext<'_>,
    per: Normalization,
    centroids: &[Centroid],
    sum: &mut SumOfSquares,
) {
    let costs = scene.sampling.pupils.iter().map(|pupil| {
        let Centroid { x, y, .. } = centroids[pupil.field];
        let PupilMoments { area, centroid, spread } = pupil.moments;
        let [dx, dy] = [centroid[0] - x, centroid[1] - y];
        let spread = spread + area * (dx * dx + dy * dy);
        let share = pupil.share;
        let (square, constant) = match per {
            Normalization::PupilArea if area > 0.0 => {
                (share / area, -share * spread / (area * area))
            }
            Normalization::PupilArea => (0.0, 0.0),
            Normalization::Unnormalized => (share, 0.0),
        };
        QuadraticIntegrand { center: [x, y], square, constant }
    });
    sum.gradient += scene.edge_motion(costs);
}

fn trace(
    scene: &EvaluationContext<'_>,
    wavelength: usize,
    per: Normalization,
) -> Result<SpotRays, MeritError> {
    let color = &scene.sampling.channels[wavelength];
    let system = &scene.systems.unclipped[wavelength];
    let tracer = Tracer::new(system).map_err(crate::lens::LensError::from)?;
    let mut points = ImagePoints::default();
    tracer.trace_batch(&color.rays, &mut points);
    let lost = (0..color.rays.len()).find(|i| !points.fate(*i).is_imaged());
    match lost {
        None => Ok(SpotRays { tracer, points, weights: weights(scene, wavelength, per) }),
        Some(i) => Err(lost_ray_error(scene, wavelength, i, points.fate(i))),
    }
}

fn weights(scene: &EvaluationContext<'_>, wavelength: usize, per: Normalization) -> Vec<f64> {
    let color = &scene.sampling.channels[wavelength];
    let mut weights = color.weights.clone();
    if per == Normalization::Unnormalized {
        for pupil in scene.sampling.pupils.iter().filter(|p| p.wavelength == wavelength) {
            weights[color.range(pupil.field)].iter_mut().for_each(|w| *w *= pupil.moments.area);
        }
    }
    weights
}

fn lost_ray_error(
    scene: &EvaluationContext<'_>,
    wavelength: usize,
    i: usize,
    fate: Fate,
) -> MeritError {
    let color = &scene.sampling.channels[wavelength];
    let field = color.ends.iter().position(|end| i < *end).unwrap_or(0);
    let ray = i - color.range(field).start;
    MeritError::RayLost { ray, field, zoom: scene.zoom.zoom, um: color.um, fate }
}

fn centroid(scene: &EvaluationContext<'_>, landed: &[SpotRays], field: usize) -> Centroid {
    let (mut x, mut y, mut share) = (0.0, 0.0, 0.0);
    for (color, landed) in scene.sampling.channels.iter().zip(landed) {
        for i in color.range(field) {
            let w = landed.weights[i];
            share += w;
            x += if color.mirrored[field] { 0.0 } else { w * landed.points.x[i] };
            y += w * landed.points.y[i];
        }
    }
    let inverse = if share > 0.0 { 1.0 / share } else { 0.0 };
    Centroid { x: x * inverse, y: y * inverse, share }
}

/// Adds the derivatives. The centroid needs none: the sum is stationary with respect to it.
fn add_gradient(
    scene: &EvaluationContext<'_>,
    landed: &[SpotRays],
    centroids: &[Centroid],
    sum: &mut SumOfSquares,
) {
    for (wavelength, landed) in landed.iter().enumerate() {
        let color = &scene.sampling.channels[wavelength];
        let mut seeds = vec![Vec3::default(); color.rays.len()];
        for (field, centroid) in centroids.iter().enumerate() {
            for i in color.range(field) {
                let w = 2.0 * landed.weights[i];
                let (x, y) = (landed.points.x[i] - centroid.x, landed.points.y[i] - centroid.y);
                seeds[i] = Vec3::new(w * x, w * y, 0.0);
            }
        }
        let seed = |i: usize| AdjointSeed { point: seeds[i], ..AdjointSeed::default() };
        let by_number = landed.tracer.gradient(&color.rays, seed);
        sum.gradient += scene.zoom.by_variables(scene.systems, wavelength, &by_number);
    }
}

/// Adds the gradient and the Gauss-Newton matrix: `Σ w (∂x − ∂x̄)(∂x − ∂x̄)ᵀ = Σ w ∂x ∂xᵀ − W ∂x̄
/// ∂x̄ᵀ` for each field.
fn add_normal_matrix(
    scene: &EvaluationContext<'_>,
    landed: &[SpotRays],
    centroids: &[Centroid],
    sum: &mut SumOfSquares,
) {
    let count = sum.gradient.len();
    // The mean slopes of x and y of every field.
    let mut means = vec![[DVector::zeros(count), DVector::zeros(count)]; centroids.len()];
    for (wavelength, landed) in landed.iter().enumerate() {
        let color = &scene.sampling.channels[wavelength];
        let moving = scene.zoom.moving_parameters(wavelength);
        let (_, rows) = landed.tracer.jacobian(&color.rays, &moving);
        let mut weighted = DMatrix::zeros(count, 2 * color.rays.len());
        let mut slope = vec![0.0; count];
        for (field, centroid) in centroids.iter().enumerate() {
            let axes = color.range(field).flat_map(|i| [(i, 0), (i, 1)]);
            for (i, axis) in axes {
                let w = landed.weights[i];
                let at = [landed.points.x[i] - centroid.x, landed.points.y[i] - centroid.y][axis];
                let from = (2 * i + axis) * moving.len();
                let row = &rows[from..from + moving.len()];
                scene.zoom.row_by_variables(scene.systems, wavelength, &moving, row, &mut slope);
                let column = DVector::from_column_slice(&slope);
                sum.gradient.axpy(2.0 * w * at, &column, 1.0);
                if axis == 1 || !color.mirrored[field] {
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
    scene: &EvaluationContext<'_>,
    sum: &mut SumOfSquares,
) -> Result<(), MeritError> {
    let primary = scene.zoom.primary;
    let heights = paraxial_heights(scene)?;
    let system = &scene.systems.unclipped[primary];
    let tracer = Tracer::new(system).map_err(crate::lens::LensError::from)?;
    let scale = image_scale(system, scene.zoom.object);
    let scale_slope = slopes(scene, sum.level, |system| image_scale(system, scene.zoom.object));
    let moving = scene.zoom.moving_parameters(primary);
    let chief = &scene.sampling.chief_rays;
    let (hits, rows) = tracer.jacobian(chief, &moving);
    let total: f64 = scene.sampling.fields.iter().map(|f| f.weight).sum();
    let mut slope = vec![0.0; sum.gradient.len()];
    for (field, height) in heights.iter().enumerate() {
        if scene.sampling.is_dark(field) {
            continue;
        }
        if !hits.fate(field).is_imaged() {
            return Err(lost_chief_error(scene, field, hits.fate(field)));
        }
        let weight = scene.sampling.fields[field].weight / total;
        for (axis, at) in [hits.x[field], hits.y[field]].into_iter().enumerate() {
            let from = (2 * field + axis) * moving.len();
            let row = &rows[from..from + moving.len()];
            scene.zoom.row_by_variables(scene.systems, primary, &moving, row, &mut slope);
            let column = DVector::from_column_slice(&slope) - &scale_slope * height[axis];
            sum.add_residual(weight, at - scale * height[axis], &column);
        }
    }
    Ok(())
}

fn lost_chief_error(scene: &EvaluationContext<'_>, field: usize, fate: Fate) -> MeritError {
    let um = scene.sampling.channels[scene.zoom.primary].um;
    MeritError::RayLost { ray: 0, field, zoom: scene.zoom.zoom, um, fate }
}

/// The quantity proportional to the paraxial image height, per field: `tan θ`, or the object height
/// in mm.
fn paraxial_heights(scene: &EvaluationContext<'_>) -> Result<Vec<[f64; 2]>, MeritError> {
    let refuse = |why| Err(MeritError::DoesNotApply { term: "distortion", why });
    let convert = |v: f64| match (scene.zoom.field_kind, scene.zoom.object) {
        (FieldKind::Angle, Object::Infinity) => Some(v.to_radians().tan()),
        (FieldKind::ObjectHeight, _) => Some(v),
        (FieldKind::ImageHeight, _) | (FieldKind::Angle, Object::Finite(_)) => None,
    };
    let mut heights = Vec::new();
    for field in &scene.sampling.fields {
        if scene.zoom.field_kind == FieldKind::Angle && field.x.hypot(field.y) >= 89.0 {
            return refuse("a field of 90 degrees or more has no image at f tan(theta)");
        }
        let (Some(x), Some(y)) = (convert(field.x), convert(field.y)) else {
            return refuse("the fields are neither angles of a distant object nor object heights");
        };
        heights.push([x, y]);
    }
    Ok(heights)
}
