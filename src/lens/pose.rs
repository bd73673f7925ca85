//! Surfaces that are decentred and tilted; for a break of the axis itself see [`super::AxisBreak`].
//!
//! A [`Pose`] places a surface relative to the frame of its vertex in the centred lens: the point
//! `q` of the surface's own frame lies at `shift + turn q` there. A tilt by the angle `a` about x and
//! `b` about y is `turn = Rx(a) Ry(b)`, both right-handed: `Rx` takes (0, 1, 0) to (0, cos a, sin a),
//! `Ry` takes (0, 0, 1) to (sin b, 0, cos b). The surface is decentred first, then tilted about its
//! decentred vertex; surfaces behind it stay where they are.
//!
//! Several surfaces that move as one rigid body keep their poses relative to each other; see
//! [`RigidMotion`].

use crate::math::{Real, Vec3};

/// The position of a surface relative to its place in the centred lens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose<R> {
    /// The displacement of the vertex, in mm.
    pub shift: Vec3<R>,
    /// The rows of the rotation matrix.
    pub turn: [Vec3<R>; 3],
}

/// A rigid motion about a pivot on the axis: `x ↦ pivot + shift + turn (x − pivot)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigidMotion<R> {
    /// The position of the pivot on the axis, in mm from the first vertex.
    pub pivot: R,
    /// The motion apart from the position of its pivot.
    pub pose: Pose<R>,
}

impl<R: Real> Pose<R> {
    /// The place in the centred lens itself.
    pub fn centred() -> Self {
        Self::decentred(R::ZERO, R::ZERO)
    }

    /// A displacement across the axis, in mm.
    pub fn decentred(x: R, y: R) -> Self {
        let (zero, one) = (R::ZERO, R::ONE);
        let turn =
            [Vec3::new(one, zero, zero), Vec3::new(zero, one, zero), Vec3::new(zero, zero, one)];
        Self { shift: Vec3::new(x, y, zero), turn }
    }

    /// A displacement across the axis in mm, then a tilt by `about_x` and `about_y` in radians.
    pub fn new([x, y]: [R; 2], [about_x, about_y]: [R; 2]) -> Self {
        let ([sin_a, cos_a], [sin_b, cos_b]) = (sine_cosine(about_x), sine_cosine(about_y));
        let turn = [
            Vec3::new(cos_b, R::ZERO, sin_b),
            Vec3::new(sin_a * sin_b, cos_a, -(sin_a * cos_b)),
            Vec3::new(-(cos_a * sin_b), sin_a, cos_a * cos_b),
        ];
        Self { shift: Vec3::new(x, y, R::ZERO), turn }
    }

    /// A direction of the surface's own frame in the frame of the centred vertex.
    #[inline(always)]
    pub fn direction_out(&self, d: Vec3<R>) -> Vec3<R> {
        Vec3::new(self.turn[0].dot(d), self.turn[1].dot(d), self.turn[2].dot(d))
    }

    /// A direction of the frame of the centred vertex in the surface's own frame.
    #[inline(always)]
    pub fn direction_in(&self, d: Vec3<R>) -> Vec3<R> {
        self.turn[0] * d.x + self.turn[1] * d.y + self.turn[2] * d.z
    }

    /// A point of the surface's own frame in the frame of the centred vertex.
    #[inline(always)]
    pub fn point_out(&self, p: Vec3<R>) -> Vec3<R> {
        self.shift + self.direction_out(p)
    }

    /// A point of the frame of the centred vertex in the surface's own frame.
    #[inline(always)]
    pub fn point_in(&self, p: Vec3<R>) -> Vec3<R> {
        self.direction_in(p - self.shift)
    }

    /// The pose in this frame of something that has the pose `inner` in the frame that this pose places.
    #[must_use]
    pub fn then(&self, inner: &Self) -> Self {
        let columns = [0, 1, 2].map(|i| self.direction_out(inner.column(i)));
        let row =
            |of: fn(&Vec3<R>) -> R| Vec3::new(of(&columns[0]), of(&columns[1]), of(&columns[2]));
        let turn = [row(|c| c.x), row(|c| c.y), row(|c| c.z)];
        Self { shift: self.point_out(inner.shift), turn }
    }

    /// The pose of the outer frame in the frame that this pose places.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let turn = [0, 1, 2].map(|i| self.column(i));
        Self { shift: -self.direction_in(self.shift), turn }
    }

    /// The pose of a surface with this pose that is carried along by a rigid motion; `vertex` is the
    /// position of its centred vertex on the axis, in mm from the first one.
    #[must_use]
    pub fn carried(&self, motion: &RigidMotion<R>, vertex: R) -> Self {
        let lever = Vec3::new(R::ZERO, R::ZERO, motion.pivot - vertex);
        let shift = lever + motion.pose.point_out(self.shift - lever);
        Self { shift, ..motion.pose.then(self) }
    }

    /// A column of the rotation matrix.
    fn column(&self, i: usize) -> Vec3<R> {
        let of = |row: &Vec3<R>| [row.x, row.y, row.z][i];
        Vec3::new(of(&self.turn[0]), of(&self.turn[1]), of(&self.turn[2]))
    }

    /// The same pose in space that is reflected at a plane across the axis.
    #[must_use]
    pub fn reflected(&self) -> Self {
        let flip = |v: Vec3<R>| Vec3::new(v.x, v.y, -v.z);
        let [x, y, z] = self.turn;
        Self { shift: flip(self.shift), turn: [flip(x), flip(y), -flip(z)] }
    }

    /// The same pose with every number mapped by `f`.
    pub fn map<S: Real>(&self, f: impl Fn(R) -> S) -> Pose<S> {
        let vector = |v: Vec3<R>| Vec3::new(f(v.x), f(v.y), f(v.z));
        Pose { shift: vector(self.shift), turn: self.turn.map(vector) }
    }

    /// True if every number is finite.
    pub fn is_finite(&self) -> bool {
        self.shift.is_finite() && self.turn.iter().all(|row| row.is_finite())
    }
}

/// Sine and cosine of an angle in radians, with its derivatives up to the third: the derivatives
/// enter by the addition theorems, since `angle − value` is a number whose fourth power is zero.
fn sine_cosine<R: Real>(angle: R) -> [R; 2] {
    let value = angle.value();
    let (sin, cos) = value.sin_cos();
    let (sin, cos) = (R::from_f64(sin), R::from_f64(cos));
    if R::ORDER == 0 {
        return [sin, cos];
    }
    let h = angle - R::from_f64(value);
    let square = h * h;
    let small_sin = h - h * square * R::from_f64(1.0 / 6.0);
    let small_cos = R::ONE - square * R::from_f64(0.5);
    [sin * small_cos + cos * small_sin, cos * small_cos - sin * small_sin]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Dual;

    type Second = Dual<Dual<f64, 1>, 1>;

    fn second(value: f64) -> Second {
        Dual::variable(Dual::variable(value, 0), 0)
    }

    #[test]
    fn sine_and_cosine_have_their_derivatives() {
        for angle in [0.0, 0.3, -2.0] {
            let [sin, cos] = sine_cosine(second(angle));
            assert!((sin.slope[0].value - angle.cos()).abs() < 1e-15);
            assert!((sin.slope[0].slope[0] + angle.sin()).abs() < 1e-15);
            assert!((cos.slope[0].value + angle.sin()).abs() < 1e-15);
            assert!((cos.slope[0].slope[0] + angle.cos()).abs() < 1e-15);
        }
    }

    #[test]
    fn a_point_that_enters_and_leaves_a_pose_is_where_it_was() {
        let pose = Pose::new([0.3, -0.2], [0.1, -0.25]);
        let p = Vec3::new(1.0, 2.0, 3.0);
        let back = pose.point_out(pose.point_in(p)) - p;
        assert!(back.dot(back).sqrt() < 1e-15);
    }

    #[test]
    fn tilts_are_right_handed() {
        let about_x = Pose::new([0.0; 2], [0.1, 0.0]).direction_out(Vec3::new(0.0, 1.0, 0.0));
        assert!((about_x.z - 0.1_f64.sin()).abs() < 1e-16);
        let about_y = Pose::new([0.0; 2], [0.0, 0.1]).direction_out(Vec3::new(0.0, 0.0, 1.0));
        assert!((about_y.x - 0.1_f64.sin()).abs() < 1e-16);
    }

    /// A sphere that rolls about its centre of curvature stays the same sphere: its vertex moves on
    /// it.
    #[test]
    fn a_surface_that_is_carried_turns_about_the_pivot() {
        let motion = RigidMotion { pivot: 50.0, pose: Pose::new([0.0; 2], [0.02, 0.03]) };
        let pose = Pose::centred().carried(&motion, 10.0);
        let center: Vec3<f64> = pose.point_out(Vec3::new(0.0, 0.0, 40.0));
        assert!((center.z - 40.0).abs() < 1e-13 && center.x.hypot(center.y) < 1e-13);
        assert!(pose.shift.y > 0.0 && pose.shift.x < 0.0);
    }

    #[test]
    fn a_pose_is_finite_if_every_number_is() {
        assert!(Pose::new([0.3, -0.2], [0.1, 0.2]).is_finite());
        for (decenter, tilt) in [([f64::INFINITY, 0.0], [0.0; 2]), ([0.0; 2], [0.0, f64::NAN])] {
            assert!(!Pose::new(decenter, tilt).is_finite(), "{decenter:?} {tilt:?}");
        }
    }
}
