//! The range of the index, and the projection of a spline onto it.
//!
//! The value of a spline is a weighted mean of its coefficients with nonnegative weights (de Boor,
//! *A Practical Guide to Splines*, chapter IX): coefficients within a range keep the value in it.
//! Those outside the domain need a wider range, for a field with a large gradient at its boundary. If
//! that violates the range within a cell that intersects the domain, the excess of the
//! coefficients of that cell beyond the range is reduced: by as much as the control points of the
//! cell require. The values in a cell are means of its control points, so that no violation is
//! missed.

use super::grin_field::GrinField;
use super::maximum::{FieldObjective, LocatedValue, RADIAL_POINTS, find_maximum, higher};
use crate::grin::field::RegularGrid;
use crate::grin_design::task::Domain;
use crate::math::Vec3;
use rayon::prelude::*;

/// Points along a side of the bounding box at which a trilinear field is sampled between its nodes.
const LATTICE: usize = 40;
/// Rounds of reducing the excess, before all of it is removed.
const MAX_ROUNDS: usize = 40;
/// A smaller excess is rounding.
const TOLERANCE: f64 = 1e-12;

/// One of the two limits of the index.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::grin_design) enum IndexBound {
    Low,
    High,
}

impl IndexBound {
    /// The value with the sign for which this limit is a maximum.
    fn signed(self, value: f64) -> f64 {
        match self {
            Self::Low => -value,
            Self::High => value,
        }
    }
}

impl GrinField {
    /// The lowest or highest index in some domains, and its position: for a trilinear field at its
    /// nodes and at many points between them, for a smooth one by a maximum search. A spline in one
    /// coordinate is searched up to its end.
    pub(in crate::grin_design) fn extreme_index(
        &self,
        spaces: &[Domain],
        bound: IndexBound,
    ) -> LocatedValue {
        let value = |p: Vec3<f64>| bound.signed(self.index_field().sample(p).index);
        let of_space = |space: &Domain| {
            if let Self::Trilinear(field) = self {
                return highest_value(field.grid(), *space, &value);
            }
            let region = space.region();
            let is_inside = |p: Vec3<f64>| region.level(p) <= 0.0;
            let inside =
                |p: Vec3<f64>| if self.is_radial() { self.covers(p) } else { is_inside(p) };
            let hill = FieldObjective { inside: &inside, value: &value };
            find_maximum(&self.index_points(*space), self.sample_spacing(*space), &hill)
        };
        let none = (f64::NEG_INFINITY, Vec3::default());
        let (most, at) = spaces.iter().map(of_space).fold(none, higher);
        (bound.signed(most), at)
    }

    /// The same field with the index limited to a range everywhere in some domains; unchanged if it
    /// is already within the range.
    #[must_use]
    pub(in crate::grin_design) fn limit_index(&self, spaces: &[Domain], range: [f64; 2]) -> Self {
        let mut kept = self.clone();
        if !self.has_loose_coefficients(range) || self.is_within(spaces, range) {
            return kept;
        }
        for _ in 0..MAX_ROUNDS {
            if !kept.has_loose_coefficients(range) {
                return kept;
            }
            let violations = kept.violations(spaces, range);
            if violations.is_empty() {
                return kept;
            }
            kept.project_coefficients(&violations, range);
        }
        let clamp = |value: &mut f64| *value = value.clamp(range[0], range[1]);
        kept.parameters_mut().iter_mut().for_each(clamp);
        kept
    }

    /// True if the index is within a range at every sample point. Control points alone are too
    /// strict: those of a cell at the surface lie outside, where a field with a large gradient may
    /// exceed the range.
    fn is_within(&self, spaces: &[Domain], [low, high]: [f64; 2]) -> bool {
        self.extreme_index(spaces, IndexBound::Low).0 >= low - TOLERANCE
            && self.extreme_index(spaces, IndexBound::High).0 <= high + TOLERANCE
    }

    /// True if the field is a spline with a coefficient beyond a range.
    fn has_loose_coefficients(&self, [low, high]: [f64; 2]) -> bool {
        let within = |value: &f64| (low..=high).contains(value);
        !matches!(self, Self::Trilinear(_)) && !self.index_field().parameters().iter().all(within)
    }

    fn is_radial(&self) -> bool {
        matches!(self, Self::Radial(..))
    }

    /// True if a point along x is covered by a spline in one coordinate, which ends.
    fn covers(&self, p: Vec3<f64>) -> bool {
        let Self::Radial(_, radius) = self else { return true };
        (0.0..=*radius).contains(&p.x) && p.y == 0.0 && p.z == 0.0
    }

    /// The sample points for the index: over the domain, or along x up to the end of a spline.
    fn index_points(&self, space: Domain) -> Vec<Vec3<f64>> {
        let Self::Radial(_, radius) = self else { return self.sample_points(space) };
        let at = |i: usize| Vec3::new(radius * i as f64 / RADIAL_POINTS as f64, 0.0, 0.0);
        (0..=RADIAL_POINTS).map(at).collect()
    }

    /// The control points beyond a range, and the limit that each violates: the values of the
    /// spline in the domain are means of control points.
    fn violations(
        &self,
        spaces: &[Domain],
        [low, high]: [f64; 2],
    ) -> Vec<(WeightedMean, IndexBound)> {
        let parameters = self.index_field().parameters();
        let is_broken =
            |mean: WeightedMean| match mean.iter().map(|(i, w)| w * parameters[*i]).sum::<f64>() {
                found if found > high + TOLERANCE => Some((mean, IndexBound::High)),
                found if found < low - TOLERANCE => Some((mean, IndexBound::Low)),
                _ => None,
            };
        match self {
            Self::Trilinear(_) => Vec::new(),
            Self::Radial(..) => {
                let cells = 0..parameters.len() - 3;
                let along = |first: usize| {
                    let mean = move |w: [f64; 4]| (0..4).map(|q| (first + q, w[q])).collect();
                    CONTROL_POINTS.map(mean)
                };
                cells.flat_map(along).filter_map(is_broken).collect()
            }
            Self::Tricubic(field) => {
                let grid = field.grid();
                let [nx, ny, nz] = grid.counts().map(|count| count - 3);
                let is_out_of_range = |i: &usize| !(low..=high).contains(&parameters[*i]);
                let of_cell = |n: usize| {
                    let cell = SplineCell { grid, at: [n % nx, n / nx % ny, n / nx / ny] };
                    let counts = cell.coefficients().any(|i| is_out_of_range(&i))
                        && spaces.iter().any(|space| cell.touches(*space));
                    let points = if counts { 64 } else { 0 };
                    (0..points).filter_map(move |point| is_broken(cell.control_point(point)))
                };
                (0..nx * ny * nz).into_par_iter().flat_map_iter(of_cell).collect()
            }
        }
    }

    /// Reduces the excess of the coefficients of some control points until these are within the
    /// range.
    fn project_coefficients(
        &mut self,
        violations: &[(WeightedMean, IndexBound)],
        [low, high]: [f64; 2],
    ) {
        let beyond = |value: f64| value - value.clamp(low, high);
        let parameters = self.index_field().parameters();
        let mut shares = vec![1.0_f64; parameters.len()];
        for (mean, bound) in violations {
            let excess = |i: usize| bound.signed(beyond(parameters[i])).max(0.0);
            let over: f64 = mean.iter().map(|(i, weight)| weight * excess(*i)).sum();
            let found: f64 = mean.iter().map(|(i, weight)| weight * parameters[*i]).sum();
            let end = if *bound == IndexBound::Low { low } else { high };
            let too_far = bound.signed(found - end);
            let share = if over > 0.0 { (1.0 - too_far / over).clamp(0.0, 1.0) } else { 0.0 };
            for (i, _) in mean.iter().filter(|(i, weight)| *weight > 0.0 && excess(*i) > 0.0) {
                shares[*i] = shares[*i].min(share);
            }
        }
        for (value, share) in self.parameters_mut().iter_mut().zip(shares) {
            *value = value.clamp(low, high) + share * beyond(*value);
        }
    }
}

/// Coefficients with their weights, whose sum is 1.
type WeightedMean = Vec<(usize, f64)>;

/// The weights of the control points of a cubic B-spline in a cell: the values there are means of
/// them.
const CONTROL_POINTS: [[f64; 4]; 4] = [
    [1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0, 0.0],
    [0.0, 2.0 / 3.0, 1.0 / 3.0, 0.0],
    [0.0, 1.0 / 3.0, 2.0 / 3.0, 0.0],
    [0.0, 1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0],
];

/// A cell of a tricubic field.
#[derive(Clone, Copy)]
struct SplineCell<'a> {
    grid: &'a RegularGrid<f64>,
    at: [usize; 3],
}

impl SplineCell<'_> {
    /// The number of coefficient `n` of the 64 of the cell.
    fn coefficient(&self, n: usize) -> usize {
        let ([i, j, k], [nx, ny, _]) = (self.at, self.grid.counts());
        i + n % 4 + nx * (j + n / 4 % 4 + ny * (k + n / 16))
    }

    fn coefficients(&self) -> impl Iterator<Item = usize> {
        (0..64).map(|n| self.coefficient(n))
    }

    /// Control point `point` of its 64.
    fn control_point(&self, point: usize) -> WeightedMean {
        let [x, y, z] = [point % 4, point / 4 % 4, point / 16].map(|p| CONTROL_POINTS[p]);
        let weight = |n: usize| x[n % 4] * y[n / 4 % 4] * z[n / 16];
        (0..64).map(|n| (self.coefficient(n), weight(n))).collect()
    }

    /// True if a domain intersects the cell or its surrounding of half a cell, judged by a lattice
    /// of points.
    fn touches(&self, space: Domain) -> bool {
        let (low, h) = (self.grid.low(), self.grid.spacing());
        let region = space.region();
        (0..125).any(|n| {
            let along = |at: usize, part: usize| at as f64 + 0.5 * part as f64 - 0.5;
            let [x, y, z] =
                [along(self.at[0], n % 5), along(self.at[1], n / 5 % 5), along(self.at[2], n / 25)];
            region.level(low + Vec3::new(x * h.x, y * h.y, z * h.z)) < 0.0
        })
    }
}

/// The highest value at the nodes of a grid in a domain, and between them.
fn highest_value(
    grid: &RegularGrid<f64>,
    space: Domain,
    value: &dyn Fn(Vec3<f64>) -> f64,
) -> LocatedValue {
    let region = space.region();
    let nodes = (0..grid.node_count()).map(|n| grid.node(n)).filter(|p| region.level(*p) <= 0.0);
    let places = nodes.chain(space.lattice(LATTICE));
    places.map(|p| (value(p), p)).fold((f64::NEG_INFINITY, grid.low()), higher)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grin_design::task::FieldRepresentation;

    /// A field with variations so strong that it exceeds its range inside and outside the domain.
    fn out_of_range(kind: FieldRepresentation) -> GrinField {
        let mut field = GrinField::from_function(kind, 9, |_| 1.3).unwrap();
        let wave = |i: usize| 1.3 + 3.0 * (0.7 * i as f64).sin();
        let numbers = field.parameters_mut().iter_mut().enumerate();
        numbers.for_each(|(i, value)| *value = wave(i));
        field
    }

    #[test]
    fn a_spline_is_put_within_its_range_and_not_changed_where_it_is_there() {
        let (space, range) = (Domain::Ball { radius: 1.0 }, [1.0, 1.6]);
        for kind in [
            FieldRepresentation::Tricubic { half: 1.0 },
            FieldRepresentation::Sphere { radius: 1.0 },
            FieldRepresentation::Cylinder { radius: 1.0 },
        ] {
            let out_of_range = out_of_range(kind);
            let before = [IndexBound::Low, IndexBound::High]
                .map(|bound| out_of_range.extreme_index(&[space], bound).0);
            assert!(before[0] < 0.95 && before[1] > 1.65, "{kind:?}: {before:?}");
            let kept = out_of_range.limit_index(&[space], range);
            for i in 0..40_000 {
                let t = f64::from(i);
                let side = |golden: f64| 2.0 * (t * golden).fract() - 1.0;
                let p = Vec3::new(side(0.8191725), side(0.6710436), side(0.5497005));
                let index = kept.index_field().sample(p).index;
                let inside = p.dot(p) <= 1.0;
                assert!(!inside || (1.0 - 1e-9..=1.6 + 1e-9).contains(&index), "{kind:?} {index}");
            }
            assert_eq!(kept.limit_index(&[space], range), kept, "once is enough");
            assert_eq!(out_of_range.limit_index(&[space], [-9.0, 9.0]), out_of_range, "{kind:?}");
        }
    }

    #[test]
    fn a_steep_field_that_keeps_its_range_in_the_space_is_left_alone() {
        let fish_eye = |p: Vec3<f64>| 2.0 / (1.0 + p.dot(p));
        let field =
            GrinField::from_function(FieldRepresentation::Tricubic { half: 1.1 }, 17, fish_eye)
                .unwrap();
        let range = [0.999, 2.5];
        assert!(field.has_loose_coefficients(range), "it is below it outside");
        assert_eq!(field.limit_index(&[Domain::Ball { radius: 1.0 }], range), field);
    }

    #[test]
    fn only_what_counts_at_a_broken_place_is_taken_back() {
        let mut field =
            GrinField::from_function(FieldRepresentation::Tricubic { half: 1.0 }, 9, |_| 1.5)
                .unwrap();
        let last = field.parameters_mut().len() - 1;
        field.parameters_mut()[0] = 100.0;
        field.parameters_mut()[last] = 1.7;
        let kept = field.limit_index(&[Domain::Cube { half: 1.0 }], [1.0, 1.6]);
        let parameters = kept.index_field().parameters();
        assert!(parameters[0] < 100.0 && parameters[0] > 1.6, "{}", parameters[0]);
        assert_eq!(
            parameters[1..],
            field.index_field().parameters()[1..],
            "far away nothing changes"
        );
        let (most, _) = kept.extreme_index(&[Domain::Cube { half: 1.0 }], IndexBound::High);
        assert!(most <= 1.6 + 1e-9 && most > 1.59, "{most}");
    }
}
