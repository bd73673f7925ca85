//! The largest gradient of a field, and its limitation.
//!
//! A field is linear in its parameters, and a constant one has all parameters equal. Scaling the
//! difference of all parameters from one index by a factor therefore scales the gradient everywhere
//! by that factor: the limit holds exactly, and a field within the range of the index remains
//! there.

use super::grin_field::GrinField;
use super::maximum::{FieldObjective, LocatedValue, find_maximum, higher};
use crate::grin::IndexField as _;
use crate::grin::field::Trilinear;
use crate::grin_design::task::Domain;
use crate::grin_design::task::geometry::length;
use crate::math::Vec3;
use rayon::prelude::*;

/// The relative margin below the limit: of a trilinear field for rounding, of a smooth one for the
/// error of the maximum search.
const MARGINS: [f64; 2] = [1e-9, 1e-3];

impl GrinField {
    /// The largest gradient in the domain, in 1/mm: of a trilinear field exactly, over all voxels
    /// that intersect the domain; of a smooth one to about a thousandth.
    pub fn max_slope(&self, space: Domain) -> f64 {
        self.locate_max_slope(space).0
    }

    /// The same, with its position.
    pub(in crate::grin_design) fn locate_max_slope(&self, space: Domain) -> LocatedValue {
        if let Self::Trilinear(field) = self {
            return max_voxel_slope(field, space);
        }
        let region = space.region();
        let inside = |p: Vec3<f64>| region.level(p) <= 0.0;
        let slope = |p: Vec3<f64>| length(self.index_field().sample(p).gradient);
        let hill = FieldObjective { inside: &inside, value: &slope };
        let (steepest, at) =
            find_maximum(&self.sample_points(space), self.sample_spacing(space), &hill);
        (steepest.max(0.0), at)
    }

    /// The same field, scaled towards an index until its gradient is nowhere above the limit.
    #[must_use]
    pub(in crate::grin_design) fn limit_slope(
        &self,
        space: Domain,
        limit: f64,
        towards: f64,
    ) -> Self {
        let steepest = self.max_slope(space);
        let mut flat = self.clone();
        if steepest > limit {
            let margin = MARGINS[usize::from(!matches!(self, Self::Trilinear(_)))];
            let factor = (1.0 - margin) * limit / steepest;
            let scale = |value: &mut f64| *value = towards + factor * (*value - towards);
            flat.parameters_mut().iter_mut().for_each(scale);
        }
        flat
    }
}

/// The square of the gradient within a voxel is convex along each axis: it is largest in a corner,
/// where it is made of the three edges that meet there.
fn max_voxel_slope(field: &Trilinear<f64>, space: Domain) -> LocatedValue {
    let grid = field.grid();
    let (region, [nx, ny, nz]) = (space.region(), grid.counts());
    let (values, h) = (field.parameters(), grid.spacing());
    let strides = [1, nx, nx * ny];
    let of_voxel = |n: usize| {
        let (i, j, k) = (n % (nx - 1), n / (nx - 1) % (ny - 1), n / (nx - 1) / (ny - 1));
        let corner = |c: usize| i + (c & 1) + nx * (j + (c >> 1 & 1)) + nx * ny * (k + (c >> 2));
        let middle = (grid.node(corner(0)) + grid.node(corner(7))) * 0.5;
        let touches = |p: Vec3<f64>| region.level(p) < 0.0;
        if !touches(middle) && !(0..8).any(|c| touches(grid.node(corner(c)))) {
            return (0.0, middle);
        }
        let edge = |c: usize, axis: usize| {
            let from = corner(c & !(1 << axis));
            values[from + strides[axis]] - values[from]
        };
        let slope =
            |c: usize| length(Vec3::new(edge(c, 0) / h.x, edge(c, 1) / h.y, edge(c, 2) / h.z));
        (0..8).map(|c| (slope(c), grid.node(corner(c)))).fold((0.0, middle), higher)
    };
    let voxels = (0..(nx - 1) * (ny - 1) * (nz - 1)).into_par_iter();
    voxels.map(of_voxel).reduce(|| (0.0, grid.low()), higher)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grin::field::RegularGrid;
    use crate::grin_design::task::FieldRepresentation;

    #[test]
    fn one_node_that_stands_out_is_found_wherever_it_is() {
        let low = Vec3::new(-1.0, -1.0, -1.0);
        let grid = RegularGrid::new([5, 5, 6], low, Vec3::new(0.5, 0.5, 0.4)).unwrap();
        let steepest = (2.0f64.powi(2) + 2.0f64.powi(2) + 2.5f64.powi(2)).sqrt();
        for node in (0..grid.node_count()).filter(|n| n % 7 == 0 || n % 5 == 4) {
            let mut values = vec![1.5; grid.node_count()];
            values[node] = 2.5;
            let field = Trilinear::new(grid, values).unwrap();
            let (slope, at) = max_voxel_slope(&field, Domain::Cube { half: 1.0 });
            assert!((slope - steepest).abs() < 1e-9, "node {node}: {slope} {steepest}");
            assert_eq!(at, grid.node(node));
        }
    }

    #[test]
    fn the_gradient_of_a_parabola_is_largest_at_its_end() {
        // n = 1.5 + 0.1 r², whose gradient is 0.2 r, largest at the rim of the cylinder: coefficients
        // that are linear make a spline that is.
        let kind = FieldRepresentation::Cylinder { radius: 1.0 };
        let mut field = GrinField::from_function(kind, 9, |_| 1.5).unwrap();
        for (i, value) in field.parameters_mut().iter_mut().enumerate() {
            *value += 0.1 * (i as f64 - 1.0) / 6.0;
        }
        let steepest = field.max_slope(Domain::Rod { radius: 0.8, from: -2.0, to: 2.0 });
        assert!((steepest - 0.16).abs() < 1e-3, "{steepest}");
    }
}
