//! Height and slope of the marginal ray at the image as functions of the parameters of a lens.

use super::ProjectionError;
use crate::lens::{Lens, LensError, Object, Parameter};
use crate::math::Real;
use crate::paraxial::{ParametricLens, ParametricRay};
use crate::solve::ConstraintFunction;
use nalgebra::DMatrix;

/// A parameter that the lenses before and after a mutation share.
#[derive(Debug, Clone, Copy)]
pub(super) struct ProjectionCoordinate {
    pub(super) old: Parameter,
    pub(super) new: Parameter,
    /// The sign of the new value relative to the old one: −1 for a reversed surface.
    pub(super) sign: f64,
    /// Its value right after the mutation.
    pub(super) value: f64,
    /// The step in which it is measured.
    pub(super) step: f64,
}

/// Height and slope of the marginal ray at the image, as functions of coordinates.
#[derive(Debug, Clone)]
pub(super) struct MarginalRayModel {
    lens: ParametricLens,
    /// Height and optical slope of the marginal ray at the first vertex, by zoom position.
    starts: Vec<(f64, f64)>,
    /// True if the last gap is solved for focus, so that the height at the image is not a
    /// constraint.
    solved: bool,
    /// The factor on slopes.
    scale: f64,
}

/// A length of the order of the focal length, the same for paraxially equivalent lenses: the focal
/// length, or for a finite object that of a thin lens of the same magnification; the minimum over
/// the zoom positions.
pub(in crate::search) fn scale(lens: &Lens) -> Result<f64, ProjectionError> {
    let model = MarginalRayModel::new(lens, lens, &[], 1.0, |c| (c.new, 1.0))?;
    let (curvatures, gaps) = model.lens.curvatures_and_gaps::<f64>(&[]);
    let mut smallest = f64::INFINITY;
    for (zoom, gaps) in gaps.iter().enumerate() {
        let slope = model.ray(zoom, &curvatures[zoom], gaps).image_slope().abs();
        let length = match lens.object {
            Object::Infinity => 1.0 / slope,
            Object::Finite(distance) => distance.abs() / (1.0 + slope * distance.abs()),
        };
        let track: f64 = gaps.iter().map(|gap| gap.abs()).sum();
        let power = slope * track.max(1e-3);
        if !(power > 1e-7 && length.is_finite() && length > 0.0) {
            return Err(ProjectionError::Afocal(zoom));
        }
        smallest = smallest.min(length);
    }
    Ok(smallest)
}

impl MarginalRayModel {
    /// A lens as a function of coordinates; `which` gives the parameter of a coordinate and its
    /// sign. The marginal ray starts from the object with the slope that reaches 1 mm at the first
    /// vertex of the `reference`.
    pub(super) fn new(
        lens: &Lens,
        reference: &Lens,
        coordinates: &[ProjectionCoordinate],
        scale: f64,
        which: impl Fn(&ProjectionCoordinate) -> (Parameter, f64),
    ) -> Result<Self, LensError> {
        let reach = |coordinate: &ProjectionCoordinate| {
            let (parameter, sign) = which(coordinate);
            vec![(parameter, sign * coordinate.step)]
        };
        let coordinates: Vec<_> = coordinates.iter().map(reach).collect();
        let model = ParametricLens::new(lens, &coordinates)?;
        let start = |zoom: usize| match (lens.object, reference.object) {
            (Object::Finite(here), Object::Finite(there)) => {
                (here / there.abs(), model.object_index(zoom) / there.abs())
            }
            _ => (1.0, 0.0),
        };
        let starts = (0..model.zoom_positions()).map(start).collect();
        Ok(Self { lens: model, starts, solved: lens.image_solve.is_some(), scale })
    }

    /// The number of constraints.
    pub(super) fn constraints(&self) -> usize {
        self.starts.len() * self.constraints_per_zoom()
    }

    fn constraints_per_zoom(&self) -> usize {
        if self.solved { 1 } else { 2 }
    }

    /// The gradient of the sum of the constrained quantities times their multipliers, over any
    /// number type.
    pub(super) fn weighted_gradient<R: Real>(&self, at: &[R], multipliers: &[f64]) -> Vec<R> {
        let (curvatures, gaps) = self.lens.curvatures_and_gaps(at);
        let mut gradient = vec![R::ZERO; at.len()];
        for (zoom, gaps) in gaps.iter().enumerate() {
            let ray = self.ray(zoom, &curvatures[zoom], gaps);
            let first = zoom * self.constraints_per_zoom();
            let slope = R::from_f64(multipliers[first] * self.scale);
            let height = if self.solved { 0.0 } else { multipliers[first + 1] };
            let seed = (R::from_f64(height), slope);
            let (by_curvature, by_gap) =
                self.lens.adjoint(zoom, &ray, &curvatures[zoom], gaps, seed);
            let here = self.lens.by_coordinates(zoom, &by_curvature, &by_gap);
            gradient.iter_mut().zip(here).for_each(|(sum, by)| *sum += by);
        }
        gradient
    }

    fn ray<R: Real>(&self, zoom: usize, curvatures: &[R], gaps: &[R]) -> ParametricRay<R> {
        let (height, slope) = self.starts[zoom];
        self.lens.ray(zoom, (R::from_f64(height), R::from_f64(slope)), curvatures, gaps)
    }
}

impl ConstraintFunction for MarginalRayModel {
    /// For every zoom position the slope, and the height unless it is solved.
    fn values(&self, at: &[f64]) -> Vec<f64> {
        let (curvatures, gaps) = self.lens.curvatures_and_gaps(at);
        let mut values = Vec::with_capacity(self.constraints());
        for (zoom, gaps) in gaps.iter().enumerate() {
            let ray = self.ray(zoom, &curvatures[zoom], gaps);
            values.push(ray.image_slope() * self.scale);
            if !self.solved {
                values.push(ray.image_height());
            }
        }
        values
    }

    fn jacobian(&self, at: &[f64]) -> DMatrix<f64> {
        let (curvatures, gaps) = self.lens.curvatures_and_gaps(at);
        let mut jacobian = DMatrix::zeros(self.constraints(), at.len());
        for (zoom, gaps) in gaps.iter().enumerate() {
            let ray = self.ray(zoom, &curvatures[zoom], gaps);
            for constraint in 0..self.constraints_per_zoom() {
                let seed = if constraint == 0 { (0.0, self.scale) } else { (1.0, 0.0) };
                let (by_curvature, by_gap) =
                    self.lens.adjoint(zoom, &ray, &curvatures[zoom], gaps, seed);
                let row = zoom * self.constraints_per_zoom() + constraint;
                let here = self.lens.by_coordinates(zoom, &by_curvature, &by_gap);
                here.enumerate().for_each(|(column, by)| jacobian[(row, column)] = by);
            }
        }
        jacobian
    }
}
