//! The field under optimization: its initial values, the ranges of its parameters, its refinement,
//! and its values on a grid.

use crate::files::Volume;
use crate::grin::IndexField;
use crate::grin::field::{
    BSpline, GridError, HessianDiagonal, ProfileCoordinate, ProfileField, ProfileFunction as _,
    RegularGrid, Tricubic, Trilinear,
};
use crate::grin_design::GrinTaskError;
use crate::grin_design::task::{
    BoundaryCondition, Domain, FieldRepresentation, GrinTask, ManufacturingLimits,
};
use crate::math::Vec3;

/// The smallest number of coefficients of a spline.
const MIN_COEFFICIENTS: usize = 4;

/// A field under optimization.
#[derive(Debug, Clone, PartialEq)]
pub enum GrinField {
    /// Node values on a cube.
    Trilinear(Trilinear<f64>),
    /// Tricubic B-splines on a cube.
    Tricubic(Tricubic<f64>),
    /// A spline in the square of a radius, which ends at that radius.
    Radial(ProfileField<BSpline<f64>>, f64),
}

impl FieldRepresentation {
    /// The smallest number of nodes or coefficients of a field.
    pub(in crate::grin_design) fn min_nodes(self) -> usize {
        match self {
            Self::Trilinear { .. } | Self::Tricubic { .. } => 2,
            Self::Sphere { .. } | Self::Cylinder { .. } => MIN_COEFFICIENTS,
        }
    }

    /// The number of parameters of a field with this many nodes along a side.
    pub(in crate::grin_design) fn parameter_count(self, nodes: usize) -> usize {
        match self {
            Self::Trilinear { .. } => nodes.saturating_pow(3),
            Self::Tricubic { .. } => (nodes + 2).saturating_pow(3),
            Self::Sphere { .. } | Self::Cylinder { .. } => nodes,
        }
    }

    /// Its size in mm: half a side, or a radius.
    pub(in crate::grin_design) fn size(self) -> f64 {
        let (Self::Trilinear { half: size }
        | Self::Tricubic { half: size }
        | Self::Sphere { radius: size }
        | Self::Cylinder { radius: size }) = self;
        size
    }

    /// True if the field is a spline in one coordinate.
    pub(in crate::grin_design) fn is_radial(self) -> bool {
        matches!(self, Self::Sphere { .. } | Self::Cylinder { .. })
    }
}

impl GrinField {
    /// The field of a given representation and number of nodes that approximates a function.
    ///
    /// # Errors
    /// Too few nodes, no extent, or values that are not finite.
    pub(in crate::grin_design) fn from_function(
        kind: FieldRepresentation,
        nodes: usize,
        value: impl Fn(Vec3<f64>) -> f64,
    ) -> Result<Self, GridError> {
        Ok(match kind {
            FieldRepresentation::Trilinear { half } => {
                Self::Trilinear(Trilinear::from_function(RegularGrid::cube(nodes, half)?, value)?)
            }
            FieldRepresentation::Tricubic { half } => {
                Self::Tricubic(Tricubic::approximate(nodes.saturating_sub(1), half, value)?)
            }
            FieldRepresentation::Sphere { radius } | FieldRepresentation::Cylinder { radius } => {
                let coordinate = match kind {
                    FieldRepresentation::Cylinder { .. } => ProfileCoordinate::Cylinder,
                    _ => ProfileCoordinate::Sphere,
                };
                let coefficients = vec![value(Vec3::default()); nodes];
                let found = nodes;
                let profile = BSpline::new(0.0, radius * radius, coefficients)
                    .ok_or(GridError::TooFew { axis: 'r', found, least: MIN_COEFFICIENTS })?;
                Self::Radial(ProfileField { coordinate, profile }, radius)
            }
        })
    }

    /// The initial field of a task, with this many nodes.
    ///
    /// # Errors
    /// Too few nodes, or a volume that has not been read.
    pub fn initial(task: &GrinTask, nodes: usize) -> Result<Self, GrinTaskError> {
        let place = "start".to_owned();
        let index = task
            .start
            .index()
            .map_err(|source| GrinTaskError::Field { place, source: Box::new(source) })?;
        Ok(Self::from_function(task.field, nodes, index)?)
    }

    /// The same field with another number of nodes or coefficients.
    ///
    /// # Errors
    /// As [`Self::from_function`].
    pub(in crate::grin_design) fn refine(
        &self,
        kind: FieldRepresentation,
        nodes: usize,
    ) -> Result<Self, GridError> {
        let mut finer = Self::from_function(kind, nodes, |p| self.index_field().sample(p).index)?;
        if let (Self::Radial(coarse, _), Self::Radial(fine, _)) = (self, &mut finer) {
            let spacing = fine.profile.knot_spacing().unwrap_or(1.0);
            for (i, c) in fine.parameters_mut().iter_mut().enumerate() {
                let there = coarse.profile.evaluate(spacing * (i as f64 - 1.0));
                *c = there.value - spacing * spacing / 6.0 * there.curvature;
            }
        }
        if let (Self::Trilinear(coarse), Self::Trilinear(fine)) = (self, &mut finer) {
            fine.diagonal = coarse.diagonal;
        }
        Ok(finer)
    }

    /// Selects the Hessian of a trilinear field.
    pub(in crate::grin_design) fn set_diagonal(&mut self, diagonal: HessianDiagonal) {
        if let Self::Trilinear(field) = self {
            field.diagonal = diagonal;
        }
    }

    /// The field for tracing.
    pub fn index_field(&self) -> &dyn IndexField<f64> {
        match self {
            Self::Trilinear(field) => field,
            Self::Tricubic(field) => field,
            Self::Radial(field, _) => field,
        }
    }

    /// Mutable access to its parameters.
    pub(in crate::grin_design) fn parameters_mut(&mut self) -> &mut [f64] {
        match self {
            Self::Trilinear(field) => field.parameters_mut(),
            Self::Tricubic(field) => field.parameters_mut(),
            Self::Radial(field, _) => field.parameters_mut(),
        }
    }

    /// The range of each parameter. A coefficient of a spline that lies outside the domain is not
    /// an index in it and has a wider range; a penalty limits the index itself.
    pub(in crate::grin_design) fn parameter_ranges(
        &self,
        space: Domain,
        limits: ManufacturingLimits,
        edge: Option<BoundaryCondition>,
    ) -> Vec<[f64; 2]> {
        let ManufacturingLimits { low, high, .. } = limits;
        let wide = [low - (high - low), high + (high - low)];
        let region = space.region();
        let is_inside = |p: Vec3<f64>| region.level(p) < 0.0;
        let range = |inside: bool, outside: [f64; 2]| if inside { [low, high] } else { outside };
        match self {
            Self::Trilinear(field) => {
                let fixed = edge.filter(|edge| edge.fixed).map(|edge| [edge.index; 2]);
                let outside = fixed.unwrap_or([low, high]);
                let grid = field.grid();
                (0..grid.node_count()).map(|n| range(is_inside(grid.node(n)), outside)).collect()
            }
            Self::Tricubic(field) => {
                let grid = field.grid();
                // The first coefficient lies one spacing before the domain.
                let place = |n: usize| grid.node(n) - grid.spacing();
                (0..grid.node_count()).map(|n| range(is_inside(place(n)), wide)).collect()
            }
            Self::Radial(field, radius) => {
                let spacing = field.profile.knot_spacing().unwrap_or(1.0);
                let count = field.parameters().len();
                let inside = |i: usize| i >= 1 && spacing * (i as f64 - 0.5) < radius * radius;
                (0..count).map(|i| range(inside(i), wide)).collect()
            }
        }
    }

    /// Nodes along a side, or coefficients of the spline.
    pub fn nodes(&self) -> usize {
        match self {
            Self::Trilinear(field) => field.grid().counts()[0],
            Self::Tricubic(field) => field.grid().counts()[0] - 2,
            Self::Radial(field, _) => field.parameters().len(),
        }
    }

    /// Its values on a grid: those of its own nodes, or of a spline in one coordinate on this many
    /// nodes along each side of the bounding box of the domain, constant beyond the end of the
    /// spline.
    ///
    /// # Errors
    /// A domain without extent.
    pub fn volume(&self, space: Domain, nodes: usize) -> Result<Volume, GridError> {
        let grid = match self {
            Self::Trilinear(field) => *field.grid(),
            Self::Tricubic(field) => {
                let grid = field.grid();
                RegularGrid::new(grid.counts().map(|n| n - 2), grid.low(), grid.spacing())?
            }
            Self::Radial(..) => {
                let [low, high] = space.corners();
                let nodes = nodes.max(2);
                RegularGrid::new([nodes; 3], low, (high - low) * (1.0 / (nodes - 1) as f64))?
            }
        };
        let index = |n| self.index_field().sample(self.nearest_covered(grid.node(n))).index;
        Ok(Volume { grid, values: (0..grid.node_count()).map(index).collect() })
    }

    /// The nearest point covered by the field: beyond the end of a spline the index is constant,
    /// not the extrapolated polynomial.
    fn nearest_covered(&self, point: Vec3<f64>) -> Vec3<f64> {
        let Self::Radial(ProfileField { coordinate, .. }, radius) = self else { return point };
        let across = match coordinate {
            ProfileCoordinate::Sphere => point,
            ProfileCoordinate::Cylinder => Vec3::new(point.x, point.y, 0.0),
            ProfileCoordinate::Axial => return point,
        };
        let size = across.dot(across).sqrt();
        if size > *radius { point - across * (1.0 - radius / size) } else { point }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_volume_goes_on_with_the_index_at_the_end_of_a_spline() {
        let mut field =
            GrinField::from_function(FieldRepresentation::Cylinder { radius: 1.0 }, 8, |_| 1.5)
                .unwrap();
        for (i, coefficient) in field.parameters_mut().iter_mut().enumerate() {
            *coefficient -= 0.05 * i as f64;
        }
        let edge = field.index_field().sample(Vec3::new(1.0, 0.0, 0.0)).index;
        let space = Domain::Rod { radius: 1.5, from: 0.0, to: 4.0 };
        let values = field.volume(space, 9).unwrap().values;
        let least = values.iter().copied().fold(f64::INFINITY, f64::min);
        assert!((least - edge).abs() < 1e-12 && edge < 1.25, "{least} {edge}");
    }

    #[test]
    fn the_resolution_of_a_radial_spline_is_the_distance_of_its_last_knots() {
        // Cubic pieces between knots that are evenly spaced in the square of the radius.
        for (coefficients, radius) in [(9, 2.0), (20, 0.5)] {
            let pieces = f64::from(coefficients - 3);
            let last = radius * (1.0 - (1.0 - 1.0 / pieces).sqrt());
            for kind in
                [FieldRepresentation::Sphere { radius }, FieldRepresentation::Cylinder { radius }]
            {
                let nodes = coefficients as usize;
                let field = GrinField::from_function(kind, nodes, |_| 1.5).unwrap();
                let voxel = field.index_field().resolution().voxel.unwrap();
                assert!((voxel / last - 1.0).abs() < 1e-9, "{kind:?}: {voxel} {last}");
            }
        }
    }
}
