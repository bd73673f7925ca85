//! Terms of real rays: spots and distortion.

use super::first_order::{image_scale, slopes};
use super::sum::{Detail, Sum};
use super::{MeritError, Scene};
use crate::lens::{FieldKind, Object};
use crate::math::Vec3;
use crate::pupil::{Cost, Moments};
use crate::trace::{Fate, Points, Seed, Sink, Tracer};
use nalgebra::{DMatrix, DVector};

/// Where the rays of one wavelength land.
struct Landed {
    tracer: Tracer<f64>,
    points: Points<f64>,
    /// The weight of each in the sum.
    weights: Vec<f64>,
}

/// The centroid of each field over all wavelengths, and the share of the field in the whole.
struct Centroid {
    x: f64,
    y: f64,
    share: f64,
}

/// What a spot is divided by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Per {
    /// The area of its pupil: a mean square radius.
    Area,
    /// Nothing: the integral over the pupil (3.24).
    Nothing,
}

/// The spots about their polychromatic centroids.
pub(super) fn spot(scene: &Scene<'_>, per: Per, sum: &mut Sum) -> Result<(), MeritError> {
    let wavelengths = 0..scene.sampling.colors.len();
    let landed: Result<Vec<_>, _> =
        wavelengths.map(|wavelength| trace(scene, wavelength, per)).collect();
    let landed = landed?;
    let centroids: Vec<_> =
        (0..scene.sampling.fields.len()).map(|field| centroid(scene, &landed, field)).collect();
    for (color, landed) in scene.sampling.colors.iter().zip(&landed) {
        for (field, centroid) in centroids.iter().enumerate() {
            for i in color.range(field) {
                let (x, y) = (landed.points.x[i] - centroid.x, landed.points.y[i] - centroid.y);
                sum.value += landed.weights[i] * (x * x + y * y);
            }
        }
    }
    match sum.detail {
        Detail::Value => return Ok(()),
        Detail::Gradient => gradient(scene, &landed, &centroids, sum),
        Detail::Normal => normal(scene, &landed, &centroids, sum),
    }
    edges(scene, per, &centroids, sum);
    Ok(())
}

/// What the motion of the pupils' edges adds to the derivative.
fn edges(scene: &Scene<'_>, per: Per, centroids: &[Centroid], sum: &mut Sum) {
    let costs = scene.sampling.pupils.iter().map(|pupil| {
        let Centroid { x, y, .. } = centroids[pupil.field];
        let Moments { area, centroid, spread } = pupil.moments;
        let [dx, dy] = [centroid[0] - x, centroid[1] - y];
        let spread = spread + area * (dx * dx + dy * dy);
        let share = pupil.share;
        let (square, constant) = match per {
            Per::Area if area > 0.0 => (share / area, -share * spread / (area * area)),
            Per::Area => (0.0, 0.0),
            Per::Nothing => (share, 0.0),
        };
        Cost { center: [x, y], square, constant }
    });
    sum.gradient += scene.edge_motion(costs);
}

fn trace(scene: &Scene<'_>, wavelength: usize, per: Per) -> Result<Landed, MeritError> {
    let color = &scene.sampling.colors[wavelength];
    let system = &scene.systems.opened[wavelength];
    let tracer = Tracer::new(system).map_err(crate::lens::LensError::from)?;
    let mut points = Points::default();
    tracer.batch(&color.rays, &mut points);
    let lost = (0..color.rays.len()).find(|i| !points.fate(*i).is_imaged());
    match lost {
        None => Ok(Landed { tracer, points, weights: weights(scene, wavelength, per) }),
        Some(i) => Err(lost_ray(scene, wavelength, i, points.fate(i))),
    }
}

fn weights(scene: &Scene<'_>, wavelength: usize, per: Per) -> Vec<f64> {
    let color = &scene.sampling.colors[wavelength];
    let mut weights = color.weights.clone();
    if per == Per::Nothing {
        for pupil in scene.sampling.pupils.iter().filter(|p| p.wavelength == wavelength) {
            weights[color.range(pupil.field)].iter_mut().for_each(|w| *w *= pupil.moments.area);
        }
    }
    weights
}

fn lost_ray(scene: &Scene<'_>, wavelength: usize, i: usize, fate: Fate) -> MeritError {
    let color = &scene.sampling.colors[wavelength];
    let field = color.ends.iter().position(|end| i < *end).unwrap_or(0);
    let ray = i - color.range(field).start;
    MeritError::Lost { ray, field, zoom: scene.zoom.number, um: color.um, fate }
}

fn centroid(scene: &Scene<'_>, landed: &[Landed], field: usize) -> Centroid {
    let (mut x, mut y, mut share) = (0.0, 0.0, 0.0);
    for (color, landed) in scene.sampling.colors.iter().zip(landed) {
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

/// The centroid needs no derivative: moving it changes the sum by nothing in first order.
fn gradient(scene: &Scene<'_>, landed: &[Landed], centroids: &[Centroid], sum: &mut Sum) {
    for (wavelength, landed) in landed.iter().enumerate() {
        let color = &scene.sampling.colors[wavelength];
        let mut seeds = vec![Vec3::default(); color.rays.len()];
        for (field, centroid) in centroids.iter().enumerate() {
            for i in color.range(field) {
                let w = 2.0 * landed.weights[i];
                let (x, y) = (landed.points.x[i] - centroid.x, landed.points.y[i] - centroid.y);
                seeds[i] = Vec3::new(w * x, w * y, 0.0);
            }
        }
        let seed = |i: usize| Seed { point: seeds[i], ..Seed::default() };
        let by_number = landed.tracer.gradient(&color.rays, seed);
        sum.gradient += scene.zoom.collect(scene.systems, wavelength, &by_number);
    }
}

/// Gauss-Newton: `Σ w (∂x − ∂x̄)(∂x − ∂x̄)ᵀ = Σ w ∂x ∂xᵀ − W ∂x̄ ∂x̄ᵀ` for each field.
fn normal(scene: &Scene<'_>, landed: &[Landed], centroids: &[Centroid], sum: &mut Sum) {
    let count = sum.gradient.len();
    // The mean slopes of x and y of every field.
    let mut means = vec![[DVector::zeros(count), DVector::zeros(count)]; centroids.len()];
    for (wavelength, landed) in landed.iter().enumerate() {
        let color = &scene.sampling.colors[wavelength];
        let moving = scene.zoom.moving(wavelength);
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
                scene.zoom.collect_row(scene.systems, wavelength, &moving, row, &mut slope);
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

/// The mean square distance of the chief rays' image points from the paraxial image.
pub(super) fn distortion(scene: &Scene<'_>, sum: &mut Sum) -> Result<(), MeritError> {
    let primary = scene.zoom.primary;
    let heights = heights(scene)?;
    let system = &scene.systems.opened[primary];
    let tracer = Tracer::new(system).map_err(crate::lens::LensError::from)?;
    let scale = image_scale(system, scene.zoom.object);
    let scale_slope = slopes(scene, sum.detail, |system| image_scale(system, scene.zoom.object));
    let moving = scene.zoom.moving(primary);
    let chief = &scene.sampling.chief;
    let (hits, rows) = tracer.jacobian(chief, &moving);
    let total: f64 = scene.sampling.fields.iter().map(|f| f.weight).sum();
    let mut slope = vec![0.0; sum.gradient.len()];
    for (field, height) in heights.iter().enumerate() {
        if scene.sampling.is_dark(field) {
            continue;
        }
        if !hits.fate(field).is_imaged() {
            return Err(lost_chief(scene, field, hits.fate(field)));
        }
        let weight = scene.sampling.fields[field].weight / total;
        for (axis, at) in [hits.x[field], hits.y[field]].into_iter().enumerate() {
            let from = (2 * field + axis) * moving.len();
            let row = &rows[from..from + moving.len()];
            scene.zoom.collect_row(scene.systems, primary, &moving, row, &mut slope);
            let column = DVector::from_column_slice(&slope) - &scale_slope * height[axis];
            sum.residual(weight, at - scale * height[axis], &column);
        }
    }
    Ok(())
}

fn lost_chief(scene: &Scene<'_>, field: usize, fate: Fate) -> MeritError {
    let um = scene.sampling.colors[scene.zoom.primary].um;
    MeritError::Lost { ray: 0, field, zoom: scene.zoom.number, um, fate }
}

/// `tan θ` of each field, or its object height: what the paraxial image is proportional to.
fn heights(scene: &Scene<'_>) -> Result<Vec<[f64; 2]>, MeritError> {
    let refuse = |why| Err(MeritError::DoesNotApply { term: "distortion", why });
    let convert = |v: f64| match (scene.zoom.field, scene.zoom.object) {
        (FieldKind::Angle, Object::Infinity) => Some(v.to_radians().tan()),
        (FieldKind::ObjectHeight, _) => Some(v),
        (FieldKind::ImageHeight, _) | (FieldKind::Angle, Object::Finite(_)) => None,
    };
    let mut heights = Vec::new();
    for field in &scene.sampling.fields {
        if scene.zoom.field == FieldKind::Angle && field.x.hypot(field.y) >= 89.0 {
            return refuse("a field of 90 degrees or more has no image at f tan(theta)");
        }
        let (Some(x), Some(y)) = (convert(field.x), convert(field.y)) else {
            return refuse("the fields are neither angles of a distant object nor object heights");
        };
        heights.push([x, y]);
    }
    Ok(heights)
}
