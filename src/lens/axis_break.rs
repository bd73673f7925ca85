//! A break of the axis: everything behind it stands on a new axis.
//!
//! The decentre and the tilt of a row move its surface alone. At an [`AxisBreak`] the axis itself is
//! displaced and turned, as at a fold mirror: a point `q` of the new frame lies at
//! `decenter + Rx Ry Rz q` in the old one, with the right-handed rotations about x, y and z. This is
//! the coordinate break of Zemax with the order flag 0, and the basic decentre of CODE V apart from
//! signs.

use super::{Lens, Pose, Row};
use crate::math::Vec3;
use serde::{Deserialize, Serialize};

/// A displacement and a turn of the axis.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AxisBreak {
    /// The displacement of the origin along x, y and z, in mm.
    #[serde(default)]
    pub decenter: [f64; 3],
    /// The rotation about x, then about the turned y, then about the turned z, in degrees.
    #[serde(default)]
    pub tilt: [f64; 3],
}

/// A tangent of the largest angle about y whose rotations about x and z are distinguished, below which
/// the axis is taken as perpendicular to the old one.
const GIMBAL: f64 = 1e-14;

impl AxisBreak {
    /// The pose of the new frame in the old one.
    pub fn pose(&self) -> Pose<f64> {
        let [x, y, z] = self.tilt.map(f64::to_radians);
        let about_z = Pose { shift: Vec3::default(), turn: rotation_about_z(z) };
        let [dx, dy, dz] = self.decenter;
        let turned = Pose::new([0.0; 2], [x, y]).then(&about_z);
        Pose { shift: Vec3::new(dx, dy, dz), ..turned }
    }

    /// The break that takes a frame to this pose.
    pub fn from_pose(pose: &Pose<f64>) -> Self {
        let [r0, r1, r2] = pose.turn;
        let cosine = r0.x.hypot(r0.y);
        let y = r0.z.atan2(cosine);
        let (x, z) = if cosine > GIMBAL {
            ((-r1.z).atan2(r2.z), (-r0.y).atan2(r0.x))
        } else {
            (r2.y.atan2(r1.y), 0.0)
        };
        let shift = pose.shift;
        let tilt = [x, y, z].map(|angle| without_negative_zero(angle.to_degrees()));
        Self { decenter: [shift.x, shift.y, shift.z].map(without_negative_zero), tilt }
    }
}

impl Row {
    /// Places the surface by the frame of its own vertex in that of the axis in front, and by the frame of
    /// the axis behind in its own: decentre and tilt where the axis goes on as it was, else breaks of the
    /// axis.
    pub fn place_on_axis(&mut self, before: &Pose<f64>, after: &Pose<f64>) {
        (self.decenter, self.tilt) = ([0.0; 2], [0.0; 2]);
        (self.break_before, self.break_after) = (None, None);
        if let Some((decenter, tilt)) = own_place(before, after) {
            (self.decenter, self.tilt) = (decenter, tilt);
        } else {
            (self.break_before, self.break_after) = (written(before), written(after));
        }
    }
}

impl Lens {
    /// Moves the surfaces `first` to `last` as one body: by a break of the axis in front of the first one,
    /// and by one behind the last one that takes the axis back to where it was. Breaks that were there are
    /// replaced. A thickness between the surfaces that changes afterwards leaves the second break as it is.
    pub fn set_group_place(&mut self, (first, last): (usize, usize), place: &AxisBreak) {
        let back = self.way_back((first, last), place);
        let is_moved = *place != AxisBreak::default();
        if let Some(row) = self.surfaces.get_mut(first) {
            row.break_before = is_moved.then_some(*place);
        }
        if let Some(row) = self.surfaces.get_mut(last) {
            row.break_after = if is_moved { written(&back) } else { None };
        }
    }

    /// The place of the surfaces `first` to `last` as [`Lens::set_group_place`] sets it; zero for a group
    /// without breaks, and `None` for one with breaks that do not take the axis back.
    pub fn group_place(&self, (first, last): (usize, usize)) -> Option<AxisBreak> {
        let rows = self.surfaces.get(first..=last)?;
        let (front, back) = (rows.first()?, rows.last()?);
        let place = front.break_before.unwrap_or_default();
        let inner = rows.iter().enumerate().any(|(i, row)| {
            (i > 0 && row.break_before.is_some())
                || (i + 1 < rows.len() && row.break_after.is_some())
        });
        let found = back.break_after.unwrap_or_default().pose();
        let rest = self.way_back((first, last), &place).inverse().then(&found);
        (!inner && rest.is_nearly_centred()).then_some(place)
    }

    /// The frame of the old axis at the last surface of a group in that of the group.
    fn way_back(&self, (first, last): (usize, usize), place: &AxisBreak) -> Pose<f64> {
        let rows = self.surfaces.get(first..last).unwrap_or_default();
        let length = rows.iter().map(|row| row.thickness).sum();
        let gap = Pose { shift: Vec3::new(0.0, 0.0, length), ..Pose::centred() };
        place.pose().then(&gap).inverse().then(&gap)
    }
}

/// The break of a frame; `None` for the frame itself.
fn written(pose: &Pose<f64>) -> Option<AxisBreak> {
    (!pose.is_nearly_centred()).then(|| AxisBreak::from_pose(pose))
}

/// Decentre and tilt of a surface alone, if the axis behind it is that in front of it.
fn own_place(before: &Pose<f64>, after: &Pose<f64>) -> Option<([f64; 2], [f64; 2])> {
    if !before.then(after).is_nearly_centred() {
        return None;
    }
    let AxisBreak { decenter: [x, y, z], tilt: [about_x, about_y, about_z] } =
        AxisBreak::from_pose(before);
    let fits = z == 0.0 && about_z.abs() < 1e-12 && about_x.abs() < 90.0 && about_y.abs() < 90.0;
    fits.then_some(([x, y], [about_x, about_y]))
}

impl Pose<f64> {
    /// True if rounding explains the difference to the frame itself.
    pub fn is_nearly_centred(&self) -> bool {
        let shift = self.shift;
        self.is_nearly_parallel() && [shift.x, shift.y, shift.z].iter().all(|v| v.abs() < 1e-9)
    }

    /// True if rounding explains the angles between the axes of the two frames.
    pub fn is_nearly_parallel(&self) -> bool {
        let [x, y, z] = self.turn;
        let off = [x.x - 1.0, x.y, x.z, y.x, y.y - 1.0, y.z, z.x, z.y, z.z - 1.0];
        off.iter().all(|v| v.abs() < 1e-12)
    }
}

fn without_negative_zero(value: f64) -> f64 {
    if value == 0.0 { 0.0 } else { value }
}

fn rotation_about_z(angle: f64) -> [Vec3<f64>; 3] {
    let (sin, cos) = angle.sin_cos();
    [Vec3::new(cos, -sin, 0.0), Vec3::new(sin, cos, 0.0), Vec3::new(0.0, 0.0, 1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn largest_difference(a: &Pose<f64>, b: &Pose<f64>) -> f64 {
        let differences = (0..3).map(|i| a.turn[i] - b.turn[i]).chain([a.shift - b.shift]);
        differences.map(|d| d.dot(d).sqrt()).fold(0.0, f64::max)
    }

    #[test]
    fn angles_are_those_of_the_rotation() {
        for tilt in [[0.0; 3], [45.0, 0.0, 0.0], [10.0, -20.0, 30.0], [170.0, 80.0, -175.0]] {
            let written = AxisBreak { decenter: [1.0, -2.0, 3.0], tilt };
            let back = AxisBreak::from_pose(&written.pose());
            for (a, b) in back.tilt.into_iter().zip(tilt) {
                assert!((a - b).abs() < 1e-12, "{tilt:?} became {:?}", back.tilt);
            }
            assert_eq!(back.decenter, written.decenter);
        }
    }

    #[test]
    fn an_axis_across_the_old_one_has_angles_too() {
        for tilt in [[30.0, 90.0, 0.0], [25.0, -90.0, 15.0]] {
            let pose = AxisBreak { decenter: [0.0; 3], tilt }.pose();
            let back = AxisBreak::from_pose(&pose).pose();
            assert!(largest_difference(&pose, &back) < 1e-14);
        }
    }

    #[test]
    fn a_group_is_turned_as_a_body_and_what_follows_stays() {
        let mut lens = crate::lens::blank();
        let frames = |lens: &Lens| lens.resolve(0, 0.5876).unwrap().frames();
        let straight = frames(&lens);
        let place = AxisBreak { decenter: [0.0, 1.0, 0.0], tilt: [10.0, 0.0, 0.0] };
        lens.set_group_place((0, 1), &place);
        let turned = frames(&lens);
        assert!(largest_difference(&turned[2], &straight[2]) < 1e-14);
        // The plate is 5 mm thick, and a turn about x takes z to (0, -sin, cos).
        let (sin, cos) = 10.0_f64.to_radians().sin_cos();
        let back = turned[1].shift - Vec3::new(0.0, 1.0 - 5.0 * sin, 5.0 * cos);
        assert!(back.dot(back).sqrt() < 1e-14, "{back:?}");
        assert_eq!(lens.group_place((0, 1)), Some(place));
        lens.surfaces[0].thickness = 6.0;
        assert_eq!(lens.group_place((0, 1)), None);
        lens.set_group_place((0, 1), &AxisBreak::default());
        assert_eq!(lens.group_place((0, 1)), Some(AxisBreak::default()));
        assert!(lens.surfaces.iter().all(|row| row.break_after.is_none()));
    }

    #[test]
    fn a_pose_and_its_inverse_cancel() {
        let pose = AxisBreak { decenter: [1.0, 2.0, -3.0], tilt: [40.0, 50.0, 60.0] }.pose();
        for both in [pose.then(&pose.inverse()), pose.inverse().then(&pose)] {
            assert!(largest_difference(&both, &Pose::centred()) < 1e-15 * 8.0);
        }
    }
}
