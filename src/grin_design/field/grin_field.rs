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
    /// The field of a given representation and number of nodes that approximates a function; a spline
    /// in one coordinate approximates its mean over the directions across the centre or the axis.
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
                let coefficients = radial_coefficients(kind, nodes, value);
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

/// The coefficients of a spline in the square of the radius that approximates a function: accurate to
/// fourth order in the distance `h` of its knots, and exact for its cubic polynomials.
fn radial_coefficients(
    kind: FieldRepresentation,
    nodes: usize,
    value: impl Fn(Vec3<f64>) -> f64,
) -> Vec<f64> {
    let cells = nodes.saturating_sub(MIN_COEFFICIENTS - 1).max(1);
    let axes = if matches!(kind, FieldRepresentation::Cylinder { .. }) { 2 } else { 3 };
    let centre = value(Vec3::default());
    let change = |knot: usize| {
        let radius = kind.size() * (knot as f64 / cells as f64).sqrt();
        let around = (0..axes).flat_map(|axis| {
            let along = |k| if k == axis { radius } else { 0.0 };
            let place = Vec3::new(along(0), along(1), along(2));
            [place, -place]
        });
        around.map(|place| value(place) - centre).sum::<f64>() / f64::from(2 * axes)
    };
    let mut changes: Vec<f64> = (0..=cells).map(change).collect();
    // Two more knots at either end, where the function may have no values.
    for _ in 0..2 {
        changes.push(extrapolated(changes.iter().rev()));
        changes.insert(0, extrapolated(changes.iter()));
    }
    // The value less a sixth of h² times the second derivative.
    let coefficient = |f: &[f64]| centre + f[1] - (f[0] - 2.0 * f[1] + f[2]) / 6.0;
    changes.windows(3).map(coefficient).take(nodes).collect()
}

/// The value before the first of a row, on the polynomial through up to four of these.
fn extrapolated<'a>(values: impl Iterator<Item = &'a f64>) -> f64 {
    let values: Vec<f64> = values.take(4).copied().collect();
    match values[..] {
        [a, b, c, d] => 4.0 * (a + c) - 6.0 * b - d,
        [a, b, c] => 3.0 * (a - b) + c,
        [a, b] => 2.0 * a - b,
        _ => values.first().copied().unwrap_or(0.0),
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
    #[test]
    fn a_radial_spline_is_exact_for_cubic_polynomials_in_the_square_of_the_radius() {
        for kind in [
            FieldRepresentation::Sphere { radius: 2.0 },
            FieldRepresentation::Cylinder { radius: 2.0 },
        ] {
            let across = |p: Vec3<f64>| p.x * p.x + p.y * p.y;
            let square = |p: Vec3<f64>| match kind {
                FieldRepresentation::Sphere { .. } => p.dot(p),
                _ => across(p),
            };
            let index = |p: Vec3<f64>| {
                let s = square(p);
                1.7 - 0.05 * s + 0.01 * s * s - 1e-3 * s * s * s
            };
            for nodes in [6, 7, 15] {
                let field = GrinField::from_function(kind, nodes, index).unwrap();
                for p in [(0.0, 0.0, 0.0), (1.1, -0.4, 0.9), (0.2, 0.1, -0.3), (-1.2, 1.5, 0.1)] {
                    let p = Vec3::new(p.0, p.1, p.2);
                    let found = field.index_field().sample(p).index;
                    assert!((found - index(p)).abs() < 1e-13, "{kind:?} {nodes}: {found} {p:?}");
                }
            }
        }
    }

    #[test]
    fn twice_the_knots_of_a_radial_spline_leave_a_sixteenth_of_the_error() {
        let fish_eye = |p: Vec3<f64>| 2.0 / (1.0 + p.dot(p));
        let error = |cells: usize| {
            let kind = FieldRepresentation::Sphere { radius: 1.0 };
            let field = GrinField::from_function(kind, cells + 3, fish_eye).unwrap();
            let places = (0..200).map(|i| Vec3::new(0.0, f64::from(i) / 200.0, 0.0));
            let errors = places.map(|p| (field.index_field().sample(p).index - fish_eye(p)).abs());
            errors.fold(0.0, f64::max)
        };
        let (coarse, fine) = (error(16), error(32));
        assert!(fine < 1e-5 && (10.0..24.0).contains(&(coarse / fine)), "{coarse} {fine}");
    }

    #[test]
    fn a_radial_spline_of_a_slanted_function_is_its_mean_around_the_axis() {
        let slanted = |p: Vec3<f64>| 1.6 + 0.1 * p.x - 0.2 * p.y;
        let kind = FieldRepresentation::Cylinder { radius: 1.0 };
        let field = GrinField::from_function(kind, 9, slanted).unwrap();
        let found = field.index_field().sample(Vec3::new(0.6, 0.3, 0.0)).index;
        assert!((found - 1.6).abs() < 1e-14, "{found}");
    }
}
