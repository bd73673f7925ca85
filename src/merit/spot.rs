//! Terms of real rays: spots and distortion.

use super::first_order::{image_scale, slopes};
use super::scoped_part::ScopedPart;
use super::sum::{DerivativeLevel, SumOfSquares};
use super::{EvaluationContext, MeritError};
use crate::lens::{FieldKind, Object, TermScope, TermSelection};
use crate::math::{SimdWidth, Vec3, dot, run_vectorized};
use crate::pupil::{PupilMoments, QuadraticIntegrand};
use crate::trace::{AdjointSeed, Fate, ImagePoints, TraceSink, Tracer};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::ops::Range;

/// The traced rays of one wavelength.
struct SpotRays {
    tracer: Tracer<f64>,
    points: Vec<[f64; 2]>,
    /// The weight of each ray in the sum.
    weights: Vec<f64>,
}

/// The polychromatic centroid of a field in mm, and the weight of the field.
struct Centroid {
    x: f64,
    y: f64,
    share: f64,
}

impl Centroid {
    /// The position of an image point relative to the centroid, in mm.
    fn offset(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [x - self.x, y - self.y]
    }
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
    scope: TermScope,
    sum: &mut SumOfSquares,
) -> Result<(), MeritError> {
    let part = ScopedPart::new(context, scope)?;
    let wavelengths = 0..context.sampling.channels.len();
    let traced: Result<Vec<_>, _> =
        wavelengths.map(|wavelength| trace(context, wavelength, normalization, part)).collect();
    let traced = traced?;
    let centroids: Vec<_> =
        (0..context.sampling.fields.len()).map(|field| centroid(context, &traced, field)).collect();
    for (channel, traced) in context.sampling.channels.iter().zip(&traced) {
        for (field, centroid) in centroids.iter().enumerate() {
            for i in channel.range(field) {
                let [x, y] = centroid.offset(traced.points[i]);
                sum.value += traced.weights[i] * (x * x + y * y);
            }
        }
    }
    match sum.level {
        DerivativeLevel::Value => return Ok(()),
        DerivativeLevel::Gradient => add_gradient(context, &traced, &centroids, sum),
        DerivativeLevel::Normal => add_normal_matrix(context, &traced, &centroids, sum),
    }
    add_edge_motion(context, (normalization, part), &centroids, sum);
    Ok(())
}

/// Adds the contribution of the moving pupil edges to the derivatives.
fn add_edge_motion(
    context: &EvaluationContext<'_>,
    (normalization, part): (Normalization, ScopedPart),
    centroids: &[Centroid],
    sum: &mut SumOfSquares,
) {
    let costs = context.sampling.pupils.iter().map(|pupil| {
        let Centroid { x, y, .. } = centroids[pupil.field];
        let PupilMoments { area, centroid, spread } = pupil.moments;
        let [dx, dy] = [centroid[0] - x, centroid[1] - y];
        let spread = spread + area * (dx * dx + dy * dy);
        let share = pupil.share * part.factor(pupil.field, pupil.wavelength);
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
    part: ScopedPart,
) -> Result<SpotRays, MeritError> {
    let channel = &context.sampling.channels[wavelength];
    let system = &context.systems.unclipped[wavelength];
    let tracer = Tracer::new(system).map_err(crate::lens::LensError::from)?;
    let weights = weights(context, wavelength, normalization, part);
    if !context.traced_pupils.is_empty() {
        return Ok(SpotRays { tracer, points: channel.points.clone(), weights });
    }
    let mut landed = ImagePoints::default();
    tracer.trace_batch(&channel.rays, &mut landed);
    let lost = (0..channel.rays.len()).find(|i| !landed.fate(*i).is_imaged());
    match lost {
        None => {
            let points = landed.x.into_iter().zip(landed.y).map(|(x, y)| [x, y]).collect();
            Ok(SpotRays { tracer, points, weights })
        }
        Some(i) => Err(lost_ray_error(context, wavelength, i, landed.fate(i))),
    }
}

fn weights(
    context: &EvaluationContext<'_>,
    wavelength: usize,
    normalization: Normalization,
    part: ScopedPart,
) -> Vec<f64> {
    let channel = &context.sampling.channels[wavelength];
    let mut weights = channel.weights.clone();
    if !part.scope.is_all() {
        for field in 0..context.sampling.fields.len() {
            let factor = part.factor(field, wavelength);
            weights[channel.range(field)].iter_mut().for_each(|w| *w *= factor);
        }
    }
    if normalization == Normalization::Unnormalized {
        for pupil in context.sampling.pupils.iter().filter(|p| p.wavelength == wavelength) {
            weights[channel.range(pupil.field)].iter_mut().for_each(|w| *w *= pupil.moments.area);
        }
    }
    weights
}

pub(super) fn lost_ray_error(
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
            x += if channel.mirrored[field] { 0.0 } else { w * traced.points[i][0] };
            y += w * traced.points[i][1];
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
    let of_wavelength = |(wavelength, traced): (usize, &SpotRays)| {
        let channel = &context.sampling.channels[wavelength];
        let mut seeds = vec![Vec3::default(); channel.rays.len()];
        for (field, centroid) in centroids.iter().enumerate() {
            for i in channel.range(field) {
                let w = 2.0 * traced.weights[i];
                let [x, y] = centroid.offset(traced.points[i]);
                seeds[i] = Vec3::new(w * x, w * y, 0.0);
            }
        }
        let seed = |i: usize| AdjointSeed { point: seeds[i], ..AdjointSeed::default() };
        let by_number = traced.tracer.gradient(&channel.rays, seed);
        context.zoom.by_variables(context.systems, wavelength, &by_number)
    };
    let gradients: Vec<DVector<f64>> = traced.par_iter().enumerate().map(of_wavelength).collect();
    gradients.into_iter().for_each(|gradient| sum.gradient += gradient);
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
    let of_wavelength = |(wavelength, traced): (usize, &SpotRays)| {
        let moving = context.zoom.moving_parameters(wavelength);
        let by_variable = context.zoom.parameter_slopes(context.systems, wavelength, &moving);
        let rays = &context.sampling.channels[wavelength].rays;
        let rows = traced.tracer.landing_slopes(rays, &moving);
        let slopes = WeightedSlopes::new(&rows, moving.len(), &traced.weights);
        let normal = slopes.normal_matrix() * &by_variable;
        (slopes, by_variable, normal)
    };
    let parts: Vec<_> = traced.par_iter().enumerate().map(of_wavelength).collect();
    let channels = context.sampling.channels.iter().zip(traced);
    for ((channel, traced), (slopes, by_variable, normal)) in channels.zip(parts) {
        let offsets = centroids.iter().enumerate().flat_map(|(field, centroid)| {
            channel.range(field).map(|i| centroid.offset(traced.points[i]))
        });
        let gradient = slopes.times_offsets(&offsets.collect::<Vec<_>>());
        sum.gradient.gemv_tr(2.0, &by_variable, &gradient, 1.0);
        for (field, means) in means.iter_mut().enumerate() {
            for (axis, mean) in means.iter_mut().enumerate() {
                if axis == 1 || !channel.mirrored[field] {
                    let by_number = slopes.sum(axis, channel.range(field));
                    mean.gemv_tr(1.0, &by_variable, &by_number, 1.0);
                }
            }
        }
        sum.normal.gemm(1.0, &by_variable.transpose(), &normal, 1.0);
    }
    for (mean, centroid) in means.iter().zip(centroids).filter(|(_, c)| c.share > 0.0) {
        for slope in mean {
            sum.normal.ger(-1.0 / centroid.share, slope, slope, 1.0);
        }
    }
}

/// The derivatives of image points by numbers of a system, each times the root of the weight of its
/// ray: for each number those of x of all rays, then those of y.
struct WeightedSlopes {
    numbers: usize,
    /// The roots of the weights.
    roots: Vec<f64>,
    slopes: Vec<f64>,
}

impl WeightedSlopes {
    /// From the derivatives of x by all numbers, then of y, for each ray in turn.
    fn new(rows: &[f64], numbers: usize, weights: &[f64]) -> Self {
        let roots: Vec<f64> = weights.iter().map(|weight| weight.sqrt()).collect();
        let rays = roots.len();
        let mut slopes = vec![0.0; rows.len()];
        for (i, root) in roots.iter().enumerate() {
            for axis in 0..2 {
                let row = &rows[(2 * i + axis) * numbers..][..numbers];
                for (number, slope) in row.iter().enumerate() {
                    slopes[(2 * number + axis) * rays + i] = root * slope;
                }
            }
        }
        Self { numbers, roots, slopes }
    }

    /// Those of x and y by one number.
    fn of(&self, number: usize) -> &[f64] {
        let length = 2 * self.roots.len();
        &self.slopes[number * length..][..length]
    }

    /// `Σ w offset ∂`, by each number.
    fn times_offsets(&self, offsets: &[[f64; 2]]) -> DVector<f64> {
        let along = |axis: usize| {
            let pairs = self.roots.iter().zip(offsets);
            pairs.map(move |(root, offset)| root * offset[axis])
        };
        let weighted: Vec<f64> = along(0).chain(along(1)).collect();
        self.dots(
            #[inline(always)]
            |number| dot(self.of(number), &weighted),
        )
    }

    /// `Σ w ∂` of one axis over some rays, by each number.
    fn sum(&self, axis: usize, rays: Range<usize>) -> DVector<f64> {
        let roots = &self.roots[rays.clone()];
        let from = axis * self.roots.len() + rays.start;
        self.dots(
            #[inline(always)]
            |number| dot(&self.of(number)[from..from + roots.len()], roots),
        )
    }

    /// `Σ w ∂ ∂ᵀ` over both axes.
    fn normal_matrix(&self) -> DMatrix<f64> {
        let mut normal = DMatrix::zeros(self.numbers, self.numbers);
        for column in 0..self.numbers {
            let of_column = self.of(column);
            let products = self.dots(
                #[inline(always)]
                |row| if row < column { 0.0 } else { dot(self.of(row), of_column) },
            );
            for row in column..self.numbers {
                normal[(row, column)] = products[row];
                normal[(column, row)] = products[row];
            }
        }
        normal
    }

    /// A number for each of the numbers of the system, computed with vector instructions.
    #[inline(always)]
    fn dots(&self, of: impl Fn(usize) -> f64) -> DVector<f64> {
        run_vectorized(
            SimdWidth::detect(),
            #[inline(always)]
            || DVector::from_iterator(self.numbers, (0..self.numbers).map(&of)),
        )
    }
}

/// Adds the mean square distance of the chief rays' image points from the paraxial image, in mm².
pub(super) fn add_distortion(
    context: &EvaluationContext<'_>,
    scope: TermScope,
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
    let inside = |field: &usize| scope.has(TermSelection::Fields, *field);
    let fields = context.sampling.fields.iter().enumerate();
    let total: f64 = fields.filter(|(field, _)| inside(field)).map(|(_, f)| f.weight).sum();
    let by_variable = context.zoom.parameter_slopes(context.systems, primary, &moving).transpose();
    for (field, height) in heights.iter().enumerate() {
        if context.sampling.is_dark(field) || !inside(&field) {
            continue;
        }
        if !hits.fate(field).is_imaged() {
            return Err(lost_chief_error(context, field, hits.fate(field)));
        }
        let weight = context.sampling.fields[field].weight / total;
        for (axis, position) in [hits.x[field], hits.y[field]].into_iter().enumerate() {
            let from = (2 * field + axis) * moving.len();
            let row = &rows[from..from + moving.len()];
            let slope = &by_variable * DVector::from_column_slice(row);
            let column = slope - &scale_slope * height[axis];
            sum.add_residual(weight, position - scale * height[axis], &column);
        }
    }
    Ok(())
}

pub(super) fn lost_chief_error(
    context: &EvaluationContext<'_>,
    field: usize,
    fate: Fate,
) -> MeritError {
    let um = context.sampling.channels[context.zoom.primary].um;
    MeritError::RayLost { ray: 0, field, zoom: context.zoom.zoom, um, fate }
}

/// The vector proportional to the paraxial image point, per field: `tan θ` along the direction of the
/// field, or the object height in mm.
pub(super) fn paraxial_heights(
    context: &EvaluationContext<'_>,
) -> Result<Vec<[f64; 2]>, MeritError> {
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
