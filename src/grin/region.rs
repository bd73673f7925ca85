//! Convex regions bounded by planes and quadrics, and the intersections of straight lines with
//! their boundary.

use super::lanes::{LANES, LaneScalars, LaneVectors, get};
use crate::math::{Real, Vec3};

/// A plane or quadric `φ(x) = Σ aᵢ xᵢ² + b·x + c`, negative inside: planes, spheres, cylinders and
/// conics of revolution about an axis are all of this form.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Face<R> {
    /// `a`.
    pub square: Vec3<R>,
    /// `b`.
    pub linear: Vec3<R>,
    /// `c`.
    pub constant: R,
}

impl<R: Real> Face<R> {
    /// The plane `normal · x = offset`; the normal points outwards.
    pub fn plane(normal: Vec3<R>, offset: R) -> Self {
        Self { square: Vec3::default(), linear: normal, constant: -offset }
    }

    /// The sphere about the origin; its interior is inside.
    pub fn sphere(radius: R) -> Self {
        let square = Vec3::new(R::ONE, R::ONE, R::ONE);
        Self { square, linear: Vec3::default(), constant: -(radius * radius) }
    }

    /// The cylinder about the z axis; its interior is inside.
    pub fn cylinder(radius: R) -> Self {
        let square = Vec3::new(R::ONE, R::ONE, R::ZERO);
        Self { square, linear: Vec3::default(), constant: -(radius * radius) }
    }

    /// `φ` at a point, negative inside.
    #[inline(always)]
    pub fn level(&self, p: Vec3<R>) -> R {
        let (a, b) = (self.square, self.linear);
        p.x * (a.x * p.x + b.x) + p.y * (a.y * p.y + b.y) + p.z * (a.z * p.z + b.z) + self.constant
    }

    /// `∇φ`, outwards, not normalised.
    #[inline(always)]
    pub fn normal(&self, p: Vec3<R>) -> Vec3<R> {
        let (a, b, two) = (self.square, self.linear, R::TWO);
        Vec3::new(two * a.x * p.x + b.x, two * a.y * p.y + b.y, two * a.z * p.z + b.z)
    }

    /// The two `t` at which `x + t v` intersects the face, in ascending order; for a plane the
    /// second one is infinite.
    pub fn crossings(&self, x: Vec3<R>, v: Vec3<R>) -> Option<[R; 2]> {
        let squares = self.square;
        let a = squares.x * v.x * v.x + squares.y * v.y * v.y + squares.z * v.z * v.z;
        let half_b = self.normal(x).dot(v) * R::from_f64(0.5);
        let c = self.level(x);
        let infinite = R::from_f64(f64::INFINITY);
        if a == R::ZERO {
            let t = -(c / (half_b + half_b));
            return (half_b != R::ZERO).then_some([t, infinite]);
        }
        let radicand = half_b * half_b - a * c;
        if !(radicand >= R::ZERO) {
            return None;
        }
        // The sum without cancellation, and the other root from the product of both.
        let root = radicand.sqrt();
        let q = -(half_b + R::select(half_b < R::ZERO, -root, root));
        if q == R::ZERO {
            return Some([R::ZERO, R::ZERO]);
        }
        let (t1, t2) = (q / a, c / q);
        Some(if t1 < t2 { [t1, t2] } else { [t2, t1] })
    }
}

/// A convex region: the box between two corners, cut by further faces.
#[derive(Debug, Clone, PartialEq)]
pub struct GrinRegion<R> {
    /// The lower corner; minus infinity where there is none.
    pub low: Vec3<R>,
    /// The upper corner; infinity where there is none.
    pub high: Vec3<R>,
    /// Further faces.
    pub faces: Vec<Face<R>>,
}

/// Faces of the box: they have the numbers 0 to 5, the further ones follow.
const SIDES: usize = 6;

impl<R: Real> GrinRegion<R> {
    /// The box between two corners.
    pub fn block(low: Vec3<R>, high: Vec3<R>) -> Self {
        Self { low, high, faces: Vec::new() }
    }

    /// The cube from `-half` to `half`.
    pub fn cube(half: R) -> Self {
        Self::block(Vec3::new(-half, -half, -half), Vec3::new(half, half, half))
    }

    /// The intersection of the insides of these faces.
    pub fn within_faces(faces: Vec<Face<R>>) -> Self {
        let infinite = R::from_f64(f64::INFINITY);
        let high = Vec3::new(infinite, infinite, infinite);
        Self { low: -high, high, faces }
    }

    /// The ball about the origin.
    pub fn ball(radius: R) -> Self {
        Self::within_faces(vec![Face::sphere(radius)])
    }

    /// A finite cylinder about the z axis, from one z to another.
    pub fn rod(radius: R, from: R, to: R) -> Self {
        let mut rod = Self::within_faces(vec![Face::cylinder(radius)]);
        (rod.low.z, rod.high.z) = (from, to);
        rod
    }

    /// The same region in another number type.
    pub fn cast<S: Real>(&self) -> GrinRegion<S> {
        let vector = |v: Vec3<R>| Vec3::from_f64(v.value());
        let face = |face: &Face<R>| Face {
            square: vector(face.square),
            linear: vector(face.linear),
            constant: S::from_f64(face.constant.value()),
        };
        let faces = self.faces.iter().map(face).collect();
        GrinRegion { low: vector(self.low), high: vector(self.high), faces }
    }

    /// The largest `φ` of all faces: negative inside.
    #[inline(always)]
    pub fn level(&self, p: Vec3<R>) -> R {
        let larger = |a: R, b: R| R::select(a < b, b, a);
        let x = larger(self.low.x - p.x, p.x - self.high.x);
        let y = larger(self.low.y - p.y, p.y - self.high.y);
        let z = larger(self.low.z - p.z, p.z - self.high.z);
        let sides = larger(x, larger(y, z));
        self.faces.iter().fold(sides, |height, face| larger(height, face.level(p)))
    }

    /// The number of faces that each ray of a block is not inside of; positive for coordinates that
    /// are not numbers. As floating-point numbers, which lanes need not convert.
    #[inline(always)]
    pub(super) fn count_outside(&self, at: &LaneVectors<R>) -> LaneScalars<R> {
        let mut out = [R::ZERO; LANES];
        let axes = [
            (&at.x, self.low.x, self.high.x),
            (&at.y, self.low.y, self.high.y),
            (&at.z, self.low.z, self.high.z),
        ];
        for (column, low, high) in axes {
            for (out, x) in out.iter_mut().zip(column) {
                *out += R::select((low < *x) & (*x < high), R::ZERO, R::ONE);
            }
        }
        for face in &self.faces {
            for (lane, out) in out.iter_mut().enumerate() {
                *out += R::select(face.level(get(at, lane)) < R::ZERO, R::ZERO, R::ONE);
            }
        }
        out
    }

    /// The number of faces, those of the box included.
    pub fn face_count(&self) -> usize {
        SIDES + self.faces.len()
    }

    /// Face number `n`: those of the box in the order low x, high x, low y, …, then the further
    /// ones.
    ///
    /// # Panics
    /// If `n` is not less than [`Self::face_count`].
    pub fn face(&self, n: usize) -> Face<R> {
        let (zero, one) = (R::ZERO, R::ONE);
        let axis =
            [Vec3::new(one, zero, zero), Vec3::new(zero, one, zero), Vec3::new(zero, zero, one)];
        match n {
            0 => Face::plane(-axis[0], -self.low.x),
            1 => Face::plane(axis[0], self.high.x),
            2 => Face::plane(-axis[1], -self.low.y),
            3 => Face::plane(axis[1], self.high.y),
            4 => Face::plane(-axis[2], -self.low.z),
            5 => Face::plane(axis[2], self.high.z),
            _ => self.faces[n - SIDES],
        }
    }

    /// The face that a point is farthest outside of, and its distance from that face.
    pub fn outermost(&self, p: Vec3<R>) -> (usize, R) {
        let mut found = (0, R::from_f64(f64::NEG_INFINITY));
        let faces = self.faces.iter().map(|face| distance(face, p));
        for (n, distance) in self.box_distances(p).into_iter().chain(faces).enumerate() {
            if distance > found.1 {
                found = (n, distance);
            }
        }
        found
    }

    /// The distance of a point outside each side of the box, in the order of [`Self::face`]: minus
    /// infinity where there is none.
    #[inline(always)]
    fn box_distances(&self, p: Vec3<R>) -> [R; SIDES] {
        let (low, high) = (self.low - p, p - self.high);
        [low.x, high.x, low.y, high.y, low.z, high.z]
    }

    /// The point where the line `x + t v` from a point outside enters the region: the face and `t ≥
    /// 0`; `None` if the line misses. With `-v` it is the point where a ray that has just left
    /// crossed the boundary.
    pub fn entry(&self, x: Vec3<R>, v: Vec3<R>) -> Option<(usize, R)> {
        let mut found: Option<(usize, R)> = None;
        let faces = self.faces.iter().map(|face| face.level(x));
        for (n, height) in self.box_distances(x).into_iter().chain(faces).enumerate() {
            if !(height >= R::ZERO) {
                continue;
            }
            let [near, far] = self.face(n).crossings(x, v)?;
            let t = R::select(near >= R::ZERO, near, far);
            if !(t >= R::ZERO) {
                return None;
            }
            if found.is_none_or(|(_, farthest)| t > farthest) {
                found = Some((n, t));
            }
        }
        let (face, t) = found.filter(|(_, t)| t.is_finite())?;
        let at = x + v * t;
        let (_, distance) = self.outermost(at);
        (distance <= rounding_error(at, v * t)).then_some((face, t))
    }
}

/// The distance of a point from a face, to first order; negative inside.
fn distance<R: Real>(face: &Face<R>, p: Vec3<R>) -> R {
    let normal = face.normal(p);
    let length = normal.dot(normal).sqrt();
    if length > R::ZERO { face.level(p) / length } else { face.level(p) }
}

/// The distance that rounding may cause at a point reached along `displacement`.
pub(super) fn rounding_error<R: Real>(at: Vec3<R>, displacement: Vec3<R>) -> R {
    let size = at.dot(at).sqrt() + displacement.dot(displacement).sqrt();
    R::from_f64(1e3 * R::EPSILON) * size
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `2x² + 3y² − z² + x − 4y + 5z − 7` and its zeros along a ray, by substitution.
    #[test]
    fn a_ray_crosses_a_general_quadric_at_the_roots_of_its_equation() {
        let face = Face {
            square: Vec3::new(2.0, 3.0, -1.0),
            linear: Vec3::new(1.0, -4.0, 5.0),
            constant: -7.0,
        };
        let value = |p: Vec3<f64>| {
            2.0 * p.x * p.x + 3.0 * p.y * p.y - p.z * p.z + p.x - 4.0 * p.y + 5.0 * p.z - 7.0
        };
        let (x, v) = (Vec3::new(0.3, -0.2, 0.1), Vec3::new(0.7, 0.5, 0.4));
        assert!((face.level(x) - value(x)).abs() < 1e-14);
        let roots = face.crossings(x, v).unwrap();
        for t in roots {
            let p = Vec3::new(x.x + t * v.x, x.y + t * v.y, x.z + t * v.z);
            assert!(value(p).abs() < 1e-12, "{t}: {}", value(p));
        }
        assert!((roots[0] - roots[1]).abs() > 0.1, "{roots:?}");
    }
}
