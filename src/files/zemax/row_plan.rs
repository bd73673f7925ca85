//! Coordinate breaks: the surfaces of a file that are rows, and the breaks of the axis between them.
//!
//! A coordinate break is no surface: it moves the frame of everything behind it. Between two surfaces
//! the file has a gap, then breaks with gaps of their own. One of these gaps becomes the thickness of
//! the row, the breaks in front of it its [`Row::break_after`](crate::lens::Row::break_after), and what
//! follows the [`Row::break_before`](crate::lens::Row::break_before) of the next row.

use super::file::ZemaxSurface;
use crate::lens::{AxisBreak, Pose};
use crate::math::Vec3;

/// True for a coordinate break.
pub(super) fn is_break(surface: &ZemaxSurface) -> bool {
    surface.kind.0 == "COORDBRK"
}

/// One row and its place on the axis; lengths in the unit of the file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PlannedRow {
    /// The number of the surface in the file.
    pub(super) surface: usize,
    /// The number of the surface in the file whose gap is the thickness of the row.
    pub(super) gap: usize,
    pub(super) thickness: f64,
    /// The frame of the surface in that of the axis in front of it.
    pub(super) before: Pose<f64>,
    /// The frame of the axis behind the surface in that of the surface.
    pub(super) after: Pose<f64>,
}

/// The rows that the surfaces of a file become.
#[derive(Debug, Default)]
pub(super) struct RowPlan {
    pub(super) rows: Vec<PlannedRow>,
}

impl RowPlan {
    /// The plan for the surfaces of a file, from the object to the image.
    pub(super) fn new(surfaces: &[ZemaxSurface]) -> Self {
        let image = surfaces.len().saturating_sub(1);
        let solid: Vec<usize> = (1..image).filter(|k| !is_break(&surfaces[*k])).collect();
        let first = solid.first().copied().unwrap_or(image);
        let mut before = frame_after(surfaces, 1, first).then(&own_break(surfaces, first));
        let mut rows = Vec::with_capacity(solid.len());
        for (i, surface) in solid.iter().copied().enumerate() {
            let next = solid.get(i + 1).copied().unwrap_or(image);
            let space = Space::between(surfaces, surface, next);
            let (after, rest) = if next == image { space.to_image() } else { space.parts() };
            let Space { gap, thickness, .. } = space;
            rows.push(PlannedRow { surface, gap, thickness, before, after });
            before = rest;
        }
        Self { rows }
    }

    /// The row of a surface of the file; `None` for the object, the image and a coordinate break.
    pub(super) fn row(&self, surface: usize) -> Option<usize> {
        self.rows.iter().position(|row| row.surface == surface)
    }

    /// The row whose thickness is the gap behind a surface of the file; `None` for a gap that became
    /// part of a break of the axis.
    pub(super) fn gap(&self, surface: usize) -> Option<usize> {
        self.rows.iter().position(|row| row.gap == surface)
    }
}

/// The space between two surfaces of the file that are no coordinate breaks.
#[derive(Debug)]
struct Space {
    /// The surface of the file whose gap is the thickness.
    gap: usize,
    thickness: f64,
    /// The breaks in front of that gap.
    after: Pose<f64>,
    /// Everything behind it.
    rest: Pose<f64>,
}

impl Space {
    fn between(surfaces: &[ZemaxSurface], from: usize, to: usize) -> Self {
        let gap = (from..to).find(|k| gap_behind(&surfaces[*k]) != 0.0).unwrap_or(from);
        let after = frame_after(surfaces, from + 1, gap + 1);
        let after = if gap == from { Pose::centred() } else { without_gap(after, &surfaces[gap]) };
        let rest = frame_after(surfaces, gap + 1, to).then(&own_break(surfaces, to));
        let mut space = Self { gap, thickness: gap_behind(&surfaces[gap]), after, rest };
        if space.rest.is_nearly_parallel() {
            space.thickness += space.rest.shift.z;
            space.rest.shift.z = 0.0;
        }
        space
    }

    fn parts(&self) -> (Pose<f64>, Pose<f64>) {
        (self.after, self.rest)
    }

    /// The breaks in front of a gap that leads to the image, which has no row of its own.
    fn to_image(&self) -> (Pose<f64>, Pose<f64>) {
        if self.rest.is_nearly_centred() {
            return (self.after, Pose::centred());
        }
        let [there, back] = [self.thickness, -self.thickness].map(along);
        (self.after.then(&there).then(&self.rest).then(&back), Pose::centred())
    }
}

fn gap_behind(surface: &ZemaxSurface) -> f64 {
    surface.thickness.map_or(0.0, |(value, _)| value)
}

/// A step along the axis.
fn along(z: f64) -> Pose<f64> {
    Pose { shift: Vec3::new(0.0, 0.0, z), ..Pose::centred() }
}

/// The frame before its last step along the axis.
fn without_gap(frame: Pose<f64>, surface: &ZemaxSurface) -> Pose<f64> {
    frame.then(&along(-gap_behind(surface)))
}

/// The frame behind the coordinate breaks `from..to` and their gaps.
fn frame_after(surfaces: &[ZemaxSurface], from: usize, to: usize) -> Pose<f64> {
    surfaces[from.min(to)..to].iter().fold(Pose::centred(), |frame, surface| {
        frame.then(&coordinate_break(surface)).then(&along(gap_behind(surface)))
    })
}

/// The break that a surface has in front of itself.
fn own_break(surfaces: &[ZemaxSurface], number: usize) -> Pose<f64> {
    let own = surfaces.get(number).and_then(|surface| surface.own_break);
    own.map_or_else(Pose::centred, break_pose)
}

/// Parameters: 1, 2 decentre; 3, 4, 5 tilts about x, y, z in degrees; 6: the order.
fn coordinate_break(surface: &ZemaxSurface) -> Pose<f64> {
    let value = |index| {
        let found = surface.parameters.iter().rfind(|(i, ..)| *i == index);
        found.map_or(0.0, |(_, value, _)| *value)
    };
    break_pose([1, 2, 3, 4, 5, 6].map(value))
}

/// The frame behind a break: for the order 0 the decentre comes first and the tilts are about x, y, z in
/// this order, else the reverse.
fn break_pose([dx, dy, x, y, z, order]: [f64; 6]) -> Pose<f64> {
    let turned = |tilt: [f64; 3]| AxisBreak { decenter: [0.0; 3], tilt }.pose();
    let decentred = Pose::decentred(dx, dy);
    if order == 0.0 {
        return decentred.then(&turned([x, y, z]));
    }
    let reverse = turned([0.0, 0.0, z]).then(&turned([0.0, y, 0.0])).then(&turned([x, 0.0, 0.0]));
    reverse.then(&decentred)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::Row;

    fn solid(gap: f64) -> ZemaxSurface {
        ZemaxSurface { thickness: Some((gap, 8)), ..ZemaxSurface::default() }
    }

    fn coordinate_break(parameters: [f64; 6], gap: f64) -> ZemaxSurface {
        let numbered = (1..).zip(parameters).map(|(i, value)| (i, value, 0)).collect();
        ZemaxSurface { kind: ("COORDBRK".to_owned(), 7), parameters: numbered, ..solid(gap) }
    }

    fn placed(planned: &PlannedRow) -> Row {
        let mut row = Row::default();
        row.place_on_axis(&planned.before, &planned.after);
        row
    }

    fn tilt(degrees: f64, gap: f64) -> ZemaxSurface {
        coordinate_break([0.0, 0.0, degrees, 0.0, 0.0, 0.0], gap)
    }

    #[test]
    fn breaks_that_cancel_leave_no_trace() {
        let there = coordinate_break([1.0, -2.0, 10.0, 20.0, 30.0, 0.0], 0.0);
        let back = coordinate_break([-1.0, 2.0, -10.0, -20.0, -30.0, 1.0], 0.0);
        let plan = RowPlan::new(&[solid(1e10), solid(5.0), there, back, solid(7.0), solid(0.0)]);
        assert_eq!(plan.rows.len(), 2);
        let centred = |pose: &Pose<f64>| pose.is_nearly_centred();
        assert!(plan.rows.iter().all(|row| centred(&row.before) && centred(&row.after)));
        assert_eq!((plan.row(4), plan.gap(4), plan.row(2)), (Some(1), Some(1), None));
    }

    #[test]
    fn a_fold_mirror_turns_the_axis_twice() {
        let surfaces =
            [solid(1e10), solid(50.0), tilt(45.0, 0.0), solid(0.0), tilt(45.0, -30.0), solid(0.0)];
        let plan = RowPlan::new(&surfaces);
        let mirror = &plan.rows[1];
        assert_eq!((mirror.thickness, mirror.gap), (-30.0, 4));
        let row = placed(mirror);
        for found in [row.break_before, row.break_after] {
            let AxisBreak { decenter, tilt } = found.unwrap();
            assert!((tilt[0] - 45.0).abs() < 1e-12 && decenter == [0.0; 3]);
        }
    }

    #[test]
    fn a_surface_that_alone_is_tilted_keeps_the_axis() {
        let there = coordinate_break([0.5, -0.25, 3.0, -4.0, 0.0, 0.0], 0.0);
        let back = coordinate_break([-0.5, 0.25, -3.0, 4.0, 0.0, 1.0], 12.0);
        let surfaces = [solid(1e10), there, solid(0.0), back, solid(1.0), solid(0.0)];
        let planned = RowPlan::new(&surfaces).rows[0].clone();
        let row = placed(&planned);
        assert_eq!((row.break_before, row.break_after), (None, None));
        assert_eq!(planned.thickness, 12.0);
        assert_eq!(row.decenter, [0.5, -0.25]);
        assert!((row.tilt[0] - 3.0).abs() < 1e-12 && (row.tilt[1] + 4.0).abs() < 1e-12);
    }

    #[test]
    fn a_break_in_front_of_the_image_turns_it_about_its_own_vertex() {
        let surfaces = [solid(1e10), solid(40.0), tilt(30.0, 0.0), solid(0.0)];
        let row = RowPlan::new(&surfaces).rows[0].clone();
        let end = row.after.then(&along(row.thickness));
        let expected = along(40.0).then(&break_pose([0.0, 0.0, 30.0, 0.0, 0.0, 0.0]));
        let apart = end.shift - expected.shift;
        assert!(apart.dot(apart) < 1e-24 && (end.turn[1].z - expected.turn[1].z).abs() < 1e-15);
    }
}
