//! A slice through a field: a quantity on a raster, its contours, the rays near it, and a profile.

use super::contour::{Contour, contours, level_set};
use super::sight::{SliceQuantity, SliceSettings};
use super::subject::GrinDocument;
use crate::grin::IndexField;
use crate::grin_design::{
    FieldDifference, FieldRepresentation, GrinField, RayPaths, SlicePlane, SpatialAxis,
};
use crate::math::Vec3;
use crate::session::clock::time;
use rayon::prelude::*;
use std::sync::Arc;

/// Cells along the longer side of a slice, and fewest along the shorter one.
const CELLS: f64 = 240.0;
const FEWEST: usize = 8;
/// Points along a side of the box on which the scale of a whole field rests.
const LATTICE: usize = 20;
/// Points of a profile.
const POINTS: usize = 200;
/// About how many contours a slice has.
const CONTOURS: f64 = 10.0;
/// A range narrower than this part of its values is none.
const FLAT: f64 = 1e-12;

/// What is looked at.
#[derive(Debug, Clone)]
pub(super) struct SliceRequest {
    pub(super) subject: Arc<GrinDocument>,
    pub(super) medium: Arc<GrinField>,
    pub(super) sight: SliceSettings,
}

/// A slice through a field.
#[derive(Debug, Clone)]
pub struct Slice {
    /// What it is of.
    pub document: Arc<GrinDocument>,
    /// The field.
    pub field: Arc<GrinField>,
    /// How it is looked at.
    pub settings: SliceSettings,
    /// The lower left and the upper right corner of its picture, in mm.
    pub frame: [[f64; 2]; 2],
    /// Cells to the right and up.
    pub size: [usize; 2],
    /// The quantity in the middle of every cell, rows from the bottom; not a number where there is
    /// air.
    pub values: Vec<f64>,
    /// The smallest and the largest value of the whole field, by this slice and a lattice; for a
    /// difference as far below zero as above. Both are the same for a field that is even.
    pub range: [f64; 2],
    /// Where the quantity has round values.
    pub contours: Vec<Contour>,
    /// The difference between two contours.
    pub spacing: f64,
    /// Straight pieces of the boundary between the space and air, in mm, apart from the frame.
    pub rim: Vec<[[f64; 2]; 2]>,
    /// Rays near the slice; empty for a volume.
    pub paths: Vec<RayPaths>,
    /// Why there are none.
    pub paths_error: Option<String>,
    /// The index along a line.
    pub profile: IndexProfile,
    /// The difference from the field that is known to be the answer.
    pub difference: Option<FieldDifference>,
    /// How long its parts took, in milliseconds: the raster with contours and profile, the rays,
    /// and the difference.
    pub ms: [f64; 3],
}

/// The index along a line: the distance in mm, and the index.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct IndexProfile {
    /// Along which coordinate.
    pub along: &'static str,
    /// Of the field.
    pub current: Vec<[f64; 2]>,
    /// Of the field at the start; empty for a volume.
    pub start: Vec<[f64; 2]>,
    /// Of the field that is known to be the answer; empty where none is.
    pub reference: Vec<[f64; 2]>,
}

/// Lays a slice.
pub(super) fn compute_slice(wanted: SliceRequest) -> Slice {
    let SliceRequest { subject, medium, sight } = wanted;
    let drawn = time(|| SliceRaster::of(&subject, &medium, sight));
    let ways = time(|| match &subject.task {
        Some(task) if sight.rays > 0 => task.ray_paths(&medium, sight.plane, sight.rays),
        _ => Ok(Vec::new()),
    });
    let difference = time(|| {
        let (task, exact) = (subject.task.as_ref()?, subject.reference.as_ref()?);
        task.difference_from(&medium, &**exact).ok()
    });
    let SliceRaster { frame, size, values, range, contours, spacing, rim, profile } = drawn.value;
    let no_ways = ways.value.as_ref().err().map(ToString::to_string);
    Slice {
        document: subject,
        field: medium,
        settings: sight,
        frame,
        size,
        values,
        range,
        contours,
        spacing,
        rim,
        paths: ways.value.unwrap_or_default(),
        paths_error: no_ways,
        profile,
        difference: difference.value,
        ms: [drawn.ms, ways.ms, difference.ms],
    }
}

/// The part of a slice that needs no rays.
struct SliceRaster {
    frame: [[f64; 2]; 2],
    size: [usize; 2],
    values: Vec<f64>,
    range: [f64; 2],
    contours: Vec<Contour>,
    spacing: f64,
    rim: Vec<[[f64; 2]; 2]>,
    profile: IndexProfile,
}

impl SliceRaster {
    fn of(subject: &GrinDocument, medium: &GrinField, sight: SliceSettings) -> Self {
        let frame = subject.corners.map(|corner| sight.plane.project(corner));
        let size = cells(frame);
        let quantity = |p: Vec3<f64>| value(subject, medium, sight.quantity, p);
        let at = |n: usize| {
            let share = |i: usize, axis: usize| {
                let [low, high] = [frame[0][axis], frame[1][axis]];
                low + (high - low) * (i as f64 + 0.5) / size[axis] as f64
            };
            sight.plane.point([share(n % size[0], 0), share(n / size[0], 1)])
        };
        let seen = |p: Vec3<f64>| if subject.contains(p) { quantity(p) } else { f64::NAN };
        let count = size[0] * size[1];
        let values: Vec<f64> = (0..count).into_par_iter().map(|n| seen(at(n))).collect();
        let heights: Vec<f64> = (0..count).map(|n| subject.height(at(n))).collect();
        let everywhere: Vec<f64> = lattice(subject.corners).into_par_iter().map(seen).collect();
        let range = range(values.iter().chain(&everywhere), sight.quantity.is_difference());
        let spacing = round((range[1] - range[0]) / CONTOURS);
        let contours = contours(&values, size, frame, range, spacing);
        let rim = level_set(&heights, size, frame, 0.0);
        let profile = profile(subject, medium, sight.plane);
        Self { frame, size, values, range, contours, spacing, rim, profile }
    }
}

/// A quantity at a point.
fn value(subject: &GrinDocument, medium: &GrinField, quantity: SliceQuantity, p: Vec3<f64>) -> f64 {
    let sample = medium.field().sample(p);
    let less = |other: &dyn IndexField<f64>| sample.index - other.sample(p).index;
    match quantity {
        SliceQuantity::Index => sample.index,
        SliceQuantity::Slope => sample.gradient.dot(sample.gradient).sqrt(),
        SliceQuantity::Change => less(subject.start.field()),
        SliceQuantity::Error => subject.reference.as_ref().map_or(f64::NAN, |exact| less(&**exact)),
    }
}

/// How many cells a picture has: square ones, unless it is very narrow.
fn cells(frame: [[f64; 2]; 2]) -> [usize; 2] {
    let sides = [0, 1].map(|axis| frame[1][axis] - frame[0][axis]);
    let longer = sides[0].max(sides[1]);
    sides.map(|side| ((CELLS * side / longer).round() as usize).max(FEWEST))
}

/// Points all over a box.
fn lattice([low, high]: [Vec3<f64>; 2]) -> Vec<Vec3<f64>> {
    let part = |low: f64, high: f64, i: usize| {
        low + (high - low) * (i % LATTICE) as f64 / (LATTICE - 1) as f64
    };
    let at = |n: usize| {
        Vec3::new(
            part(low.x, high.x, n),
            part(low.y, high.y, n / LATTICE),
            part(low.z, high.z, n / LATTICE / LATTICE),
        )
    };
    (0..LATTICE.pow(3)).map(at).collect()
}

/// The range of all values that are numbers.
fn range<'a>(values: impl Iterator<Item = &'a f64>, is_difference: bool) -> [f64; 2] {
    let none = [f64::INFINITY, f64::NEG_INFINITY];
    let finite = values.filter(|value| value.is_finite());
    let [low, high] = finite.fold(none, |[l, h], value| [l.min(*value), h.max(*value)]);
    if low > high {
        return [0.0; 2];
    }
    if is_difference {
        let most = low.abs().max(high.abs());
        return [-most, most];
    }
    let is_even = high - low <= FLAT * high.abs();
    if is_even { [low; 2] } else { [low, high] }
}

/// The smallest of 1, 2 and 5 times a power of ten that is not below a number; 0 for none.
fn round(length: f64) -> f64 {
    if !(length > 0.0 && length.is_finite()) {
        return 0.0;
    }
    let decade = 10_f64.powf(length.log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|step| step * decade);
    steps.into_iter().find(|step| *step >= length * (1.0 - 1e-9)).unwrap_or(10.0 * decade)
}

/// The index along a radius, of a spline in it; else along the line through the middle of a slice.
fn profile(subject: &GrinDocument, medium: &GrinField, plane: SlicePlane) -> IndexProfile {
    let radius = subject.task.as_ref().and_then(|task| radius(task.field));
    let [across, above] = plane.axis.across();
    let middle = subject.middle(above);
    let ends = radius.map_or_else(|| subject.depth_range(across), |radius| [0.0, radius]);
    let place = |t: f64| match radius {
        Some(_) => Vec3::new(t, 0.0, 0.0),
        None => plane.point([t, middle]),
    };
    let of = |field: &dyn IndexField<f64>| -> Vec<[f64; 2]> {
        let at = |i: usize| ends[0] + (ends[1] - ends[0]) * i as f64 / POINTS as f64;
        let seen = |t: &f64| radius.is_some() || subject.contains(place(*t));
        let index = |t: f64| [t, field.sample(place(t)).index];
        let points = (0..=POINTS).map(at).filter(seen).map(index);
        points.filter(|[_, index]| index.is_finite()).collect()
    };
    let start = subject.task.as_ref().map(|_| of(subject.start.field()));
    let exact = subject.reference.as_ref().map(|exact| of(&**exact));
    IndexProfile {
        along: if radius.is_some() { "r" } else { across.name() },
        current: of(medium.field()),
        start: start.unwrap_or_default(),
        reference: exact.unwrap_or_default(),
    }
}

/// Where a spline in one coordinate ends.
fn radius(kind: FieldRepresentation) -> Option<f64> {
    match kind {
        FieldRepresentation::Sphere { radius } | FieldRepresentation::Cylinder { radius } => {
            Some(radius)
        }
        FieldRepresentation::Trilinear { .. } | FieldRepresentation::Tricubic { .. } => None,
    }
}

impl SliceRequest {
    /// Whether both are the same field, looked at in the same way.
    pub(super) fn matches(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.medium, &other.medium) && self.sight == other.sight
    }
}

impl Slice {
    /// The axes that point right and up.
    pub const fn axes(&self) -> [SpatialAxis; 2] {
        self.settings.plane.axis.across()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contours_are_round_numbers_apart() {
        let cases = [(0.06, 0.1), (0.1, 0.1), (0.11, 0.2), (3.0, 5.0), (0.0, 0.0), (f64::NAN, 0.0)];
        for (length, spacing) in cases {
            assert!((round(length) - spacing).abs() < 1e-12, "{length}");
        }
    }

    #[test]
    fn a_range_knows_even_fields_and_differences() {
        assert_eq!(range([1.0, f64::NAN, 1.0].iter(), false), [1.0, 1.0]);
        assert_eq!(range([-0.1, 0.3].iter(), true), [-0.3, 0.3]);
        assert_eq!(range([f64::NAN].iter(), false), [0.0, 0.0]);
    }

    #[test]
    fn narrow_slices_have_enough_cells() {
        assert_eq!(cells([[0.0, 0.0], [2.0, 1.0]]), [240, 120]);
        assert_eq!(cells([[0.0, 0.0], [100.0, 0.1]]), [240, 8]);
    }
}
