//! Slices through a field: a quantity on a raster, its contours, the rays near it, and a profile.

use super::contour::{Contour, contours, level_set};
use super::document::GrinDocument;
use crate::grin::IndexField;
use crate::grin_design::{
    FieldDifference, FieldRepresentation, GrinField, RayPaths, SlicePlane, SpatialAxis,
};
use crate::math::Vec3;
use crate::session::clock::time;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The number of cells along the longer side of a slice.
const CELLS: f64 = 240.0;
/// The minimum number of cells along the shorter side.
const MIN_CELLS: usize = 8;
/// The number of points along each side of the box that determine the range of a whole field.
const LATTICE: usize = 20;
/// The number of intervals of a profile.
const POINTS: usize = 200;
/// The approximate number of contours of a slice.
const CONTOURS: f64 = 10.0;
/// A range narrower than this fraction of its values counts as empty.
const FLAT: f64 = 1e-12;

/// A request for a slice.
#[derive(Debug, Clone)]
pub(super) struct SliceRequest {
    pub(super) document: Arc<GrinDocument>,
    pub(super) field: Arc<GrinField>,
    pub(super) settings: SliceSettings,
}

/// A slice through a field.
#[derive(Debug, Clone)]
pub struct Slice {
    /// The document.
    pub document: Arc<GrinDocument>,
    /// The field.
    pub field: Arc<GrinField>,
    /// The settings of the slice.
    pub settings: SliceSettings,
    /// The lower left and the upper right corner of the slice, in mm.
    pub frame: [[f64; 2]; 2],
    /// The number of cells to the right and upwards.
    pub size: [usize; 2],
    /// The quantity in the middle of every cell, rows from the bottom; NaN in air.
    pub values: Vec<f64>,
    /// The minimum and the maximum of the whole field, by this slice and a lattice; symmetric about
    /// zero for a difference, and equal for a constant field.
    pub range: [f64; 2],
    /// The contours at round values of the quantity.
    pub contours: Vec<Contour>,
    /// The difference between two contours.
    pub spacing: f64,
    /// Line segments of the boundary between the domain and air, in mm, without the frame.
    pub rim: Vec<[[f64; 2]; 2]>,
    /// Rays near the slice; empty for a volume or after an error.
    pub paths: Vec<RayPaths>,
    /// The reason why the rays could not be traced.
    pub paths_error: Option<String>,
    /// The index along a line.
    pub profile: IndexProfile,
    /// The difference from the reference field, if there is one.
    pub difference: Option<FieldDifference>,
    /// The times of the parts, in milliseconds: the raster with contours and profile, the rays, and
    /// the difference.
    pub ms: [f64; 3],
}

/// The index along a line: the distance in mm, and the index.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct IndexProfile {
    /// The name of the coordinate.
    pub along: &'static str,
    /// The profile of the field.
    pub current: Vec<[f64; 2]>,
    /// The profile of the initial field; empty for a volume.
    pub start: Vec<[f64; 2]>,
    /// The profile of the reference field; empty without one.
    pub reference: Vec<[f64; 2]>,
}

/// Computes a slice.
pub(super) fn compute_slice(request: SliceRequest) -> Slice {
    let SliceRequest { document, field, settings } = request;
    let raster = time(|| SliceRaster::of(&document, &field, settings));
    let paths = time(|| match &document.task {
        Some(task) if settings.rays > 0 => task.ray_paths(&field, settings.plane, settings.rays),
        _ => Ok(Vec::new()),
    });
    let difference = time(|| {
        let (task, reference) = (document.task.as_ref()?, document.reference.as_ref()?);
        task.difference_from(&field, &**reference).ok()
    });
    let ms = [raster.ms, paths.ms, difference.ms];
    let SliceRaster { frame, size, values, range, contours, spacing, rim, profile } = raster.value;
    Slice {
        document,
        field,
        settings,
        frame,
        size,
        values,
        range,
        contours,
        spacing,
        rim,
        paths_error: paths.value.as_ref().err().map(ToString::to_string),
        paths: paths.value.unwrap_or_default(),
        profile,
        difference: difference.value,
        ms,
    }
}

/// The parts of a slice without its rays.
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
    fn of(document: &GrinDocument, field: &GrinField, settings: SliceSettings) -> Self {
        let frame = document.corners.map(|corner| settings.plane.project(corner));
        let size = cells(frame);
        let quantity = |p: Vec3<f64>| value(document, field, settings.quantity, p);
        let at = |n: usize| {
            let share = |i: usize, axis: usize| {
                let [low, high] = [frame[0][axis], frame[1][axis]];
                low + (high - low) * (i as f64 + 0.5) / size[axis] as f64
            };
            settings.plane.point([share(n % size[0], 0), share(n / size[0], 1)])
        };
        let seen = |p: Vec3<f64>| if document.contains(p) { quantity(p) } else { f64::NAN };
        let count = size[0] * size[1];
        let values: Vec<f64> = (0..count).into_par_iter().map(|n| seen(at(n))).collect();
        let heights: Vec<f64> = (0..count).map(|n| document.height(at(n))).collect();
        let everywhere: Vec<f64> = lattice(document.corners).into_par_iter().map(seen).collect();
        let range = range(values.iter().chain(&everywhere), settings.quantity.is_difference());
        let spacing = round((range[1] - range[0]) / CONTOURS);
        let contours = contours(&values, size, frame, range, spacing);
        let rim = level_set(&heights, size, frame, 0.0);
        let profile = profile(document, field, settings.plane);
        Self { frame, size, values, range, contours, spacing, rim, profile }
    }
}

/// A quantity at a point.
fn value(document: &GrinDocument, field: &GrinField, quantity: SliceQuantity, p: Vec3<f64>) -> f64 {
    let sample = field.index_field().sample(p);
    let less = |other: &dyn IndexField<f64>| sample.index - other.sample(p).index;
    match quantity {
        SliceQuantity::Index => sample.index,
        SliceQuantity::Slope => sample.gradient.dot(sample.gradient).sqrt(),
        SliceQuantity::Change => less(document.start.index_field()),
        SliceQuantity::Error => {
            document.reference.as_ref().map_or(f64::NAN, |exact| less(&**exact))
        }
    }
}

/// The number of cells of a slice: square cells, unless it is very narrow.
fn cells(frame: [[f64; 2]; 2]) -> [usize; 2] {
    let sides = [0, 1].map(|axis| frame[1][axis] - frame[0][axis]);
    let longer = sides[0].max(sides[1]);
    sides.map(|side| ((CELLS * side / longer).round() as usize).max(MIN_CELLS))
}

/// The points of a regular lattice in a box.
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

/// The range of all finite values.
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

/// The smallest of 1, 2 and 5 times a power of ten that is not below the length; 0 if there is none.
fn round(length: f64) -> f64 {
    if !(length > 0.0 && length.is_finite()) {
        return 0.0;
    }
    let decade = 10_f64.powf(length.log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|step| step * decade);
    steps.into_iter().find(|step| *step >= length * (1.0 - 1e-9)).unwrap_or(10.0 * decade)
}

/// The index along the radius for a spline in it, else along a line through the middle of the slice.
fn profile(document: &GrinDocument, field: &GrinField, plane: SlicePlane) -> IndexProfile {
    let radius = document.task.as_ref().and_then(|task| radius(task.field));
    let [across, above] = plane.axis.across();
    let middle = document.middle(above);
    let ends = radius.map_or_else(|| document.depth_range(across), |radius| [0.0, radius]);
    let place = |t: f64| match radius {
        Some(_) => Vec3::new(t, 0.0, 0.0),
        None => plane.point([t, middle]),
    };
    let of = |field: &dyn IndexField<f64>| -> Vec<[f64; 2]> {
        let at = |i: usize| ends[0] + (ends[1] - ends[0]) * i as f64 / POINTS as f64;
        let seen = |t: &f64| radius.is_some() || document.contains(place(*t));
        let index = |t: f64| [t, field.sample(place(t)).index];
        let points = (0..=POINTS).map(at).filter(seen).map(index);
        points.filter(|[_, index]| index.is_finite()).collect()
    };
    let start = document.task.as_ref().map(|_| of(document.start.index_field()));
    let exact = document.reference.as_ref().map(|exact| of(&**exact));
    IndexProfile {
        along: if radius.is_some() { "r" } else { across.name() },
        current: of(field.index_field()),
        start: start.unwrap_or_default(),
        reference: exact.unwrap_or_default(),
    }
}

/// The radius at which a spline in one coordinate ends.
fn radius(kind: FieldRepresentation) -> Option<f64> {
    match kind {
        FieldRepresentation::Sphere { radius } | FieldRepresentation::Cylinder { radius } => {
            Some(radius)
        }
        FieldRepresentation::Trilinear { .. } | FieldRepresentation::Tricubic { .. } => None,
    }
}

impl SliceRequest {
    /// True if both requests give the same slice of the same field.
    pub(super) fn matches(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.field, &other.field) && self.settings == other.settings
    }
}

impl Slice {
    /// The axes that point right and up.
    pub const fn axes(&self) -> [SpatialAxis; 2] {
        self.settings.plane.axis.across()
    }
}

/// The maximum number of rays of each view in a slice.
pub(super) const MAX_RAYS: usize = 60;

/// The quantity that a slice shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SliceQuantity {
    /// The refractive index.
    Index,
    /// The absolute value of its gradient, in 1/mm.
    Slope,
    /// The index minus that of the initial field.
    Change,
    /// The index minus that of the reference field.
    Error,
}

impl SliceQuantity {
    /// Every quantity.
    pub const ALL: [Self; 4] = [Self::Index, Self::Slope, Self::Change, Self::Error];

    /// The name of the quantity with its unit.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Index => "index",
            Self::Slope => "gradient of the index, 1/mm",
            Self::Change => "index minus the initial one",
            Self::Error => "index minus the reference",
        }
    }

    /// True if zero is in the middle of the scale of the quantity.
    pub const fn is_difference(self) -> bool {
        matches!(self, Self::Change | Self::Error)
    }
}

/// The settings of a slice.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SliceSettings {
    /// The plane of the slice.
    pub plane: SlicePlane,
    /// The quantity that it shows.
    pub quantity: SliceQuantity,
    /// The maximum number of rays of each view.
    pub rays: usize,
}

impl Default for SliceSettings {
    fn default() -> Self {
        let plane = SlicePlane { axis: SpatialAxis::Y, depth: 0.0 };
        Self { plane, quantity: SliceQuantity::Index, rays: 11 }
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
