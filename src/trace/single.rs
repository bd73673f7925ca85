//! Tracing one ray at a time, over any number type, with all that happens to it.

use super::Tracer;
use super::fate::{self, Fate};
use super::propagation::PropagatedRay;
use crate::lens::SystemError;
use crate::math::Real;
use crate::math::Vec3;

/// The largest coordinate of a start, in mm; the squares of larger ones would not be finite.
const LARGEST_START: f64 = 1e100;

/// A straight ray.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Ray<R> {
    /// A point of the ray, in mm.
    pub point: Vec3<R>,
    /// The direction cosines.
    pub direction: Vec3<R>,
}

impl Ray<f64> {
    /// The same ray in another number type.
    pub fn cast<R: Real>(&self) -> Ray<R> {
        Ray { point: Vec3::from_f64(self.point), direction: Vec3::from_f64(self.direction) }
    }

    /// Checks that the ray is finite and that its direction has length 1 within 1e-9.
    ///
    /// # Errors
    /// [`SystemError::Ray`], which names the ray by `number`.
    pub fn check(&self, number: usize) -> Result<(), SystemError> {
        let refuse = |found: String| Err(SystemError::Ray { ray: number, found });
        let (p, d) = (self.point, self.direction);
        let start = [("x", p.x), ("y", p.y), ("z", p.z)];
        if let Some((name, found)) = start.into_iter().find(|(_, v)| !(v.abs() <= LARGEST_START)) {
            return refuse(format!("{name} is {found:e}"));
        }
        let direction = [("L", d.x), ("M", d.y), ("N", d.z)];
        if let Some((name, found)) = direction.into_iter().find(|(_, v)| !v.is_finite()) {
            return refuse(format!("{name} is {found}"));
        }
        let length = d.dot(d).sqrt();
        if (length - 1.0).abs() > 1e-9 {
            return refuse(format!("a direction of length {length}"));
        }
        Ok(())
    }
}

/// A ray that has been traced, and its end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TracedRay<R> {
    /// The fate of the ray.
    pub fate: Fate,
    /// Point and direction in the frame of the surface at which the ray ends, of its vertex in the centred
    /// lens if it is decentred or tilted, and of the axis behind it if it is broken there: behind the last
    /// surface for a ray that arrives, at the point where it is clipped or totally reflected, or in front of
    /// the surface that it misses.
    pub ray: Ray<R>,
    /// The optical path from the start to that point, in mm.
    pub opl: R,
    /// The index of the first surface that the ray reaches by going backwards.
    pub first_backward_surface: Option<usize>,
}

/// The polyline of a ray through a lens, for drawing.
#[derive(Debug, Clone, PartialEq)]
pub struct RayPolyline {
    /// The start, every point of intersection, and intermediate points in GRIN media, in the frame of
    /// the first vertex, in mm.
    pub points: Vec<Vec3<f64>>,
    /// The distance from the axis at each surface that the ray reaches, in mm.
    pub heights: Vec<f64>,
    /// The fate of the ray.
    pub fate: Fate,
}

impl<R: Real> Tracer<R> {
    /// Traces one ray that starts in the frame of the first vertex. Its direction is normalised.
    pub fn trace(&self, ray: Ray<R>) -> TracedRay<R> {
        self.trace_surfaces(ray, self.interfaces.len(), |_, _| {})
    }

    /// Traces one ray and calls `visit` with the index of each surface and the point of intersection
    /// in its own frame, which is decentred and tilted with it.
    pub fn visit(&self, ray: Ray<R>, visit: impl FnMut(usize, Vec3<R>)) -> TracedRay<R> {
        self.trace_surfaces(ray, self.interfaces.len(), visit)
    }

    /// Traces one ray through the first surfaces, up to and including `surface`.
    pub fn trace_to(&self, ray: Ray<R>, surface: usize) -> TracedRay<R> {
        self.trace_surfaces(ray, (surface + 1).min(self.interfaces.len()), |_, _| {})
    }

    /// Compiled apart for lenses with and without GRIN media, poses or apertures of other forms, whose steps
    /// would take registers from the loop over centred surfaces and homogeneous media.
    fn trace_surfaces(
        &self,
        ray: Ray<R>,
        surfaces: usize,
        visit: impl FnMut(usize, Vec3<R>),
    ) -> TracedRay<R> {
        if self.is_plain() && self.apertures.is_empty() {
            self.trace_loop::<false>(ray, surfaces, visit)
        } else {
            self.trace_loop::<true>(ray, surfaces, visit)
        }
    }

    fn trace_loop<const GENERAL: bool>(
        &self,
        ray: Ray<R>,
        surfaces: usize,
        mut visit: impl FnMut(usize, Vec3<R>),
    ) -> TracedRay<R> {
        let (mut k, mut index) =
            (optical_direction(ray.direction, self.index_before), self.index_before);
        let (opl, first_backward_surface) = (R::ZERO, None);
        let mut traced = TracedRay { fate: Fate::Imaged, ray, opl, first_backward_surface };
        for i in 0..surfaces {
            let p = traced.ray.point;
            let arrived = self.propagate::<GENERAL>(i, p, k);
            let blocks = |p| GENERAL && self.is_outside_apertures(i, p);
            let behind = traced.cross(i, p, &arrived, blocks, &mut visit);
            (k, index) = match behind {
                Some(behind) => (behind, arrived.indices.behind),
                None => (arrived.k, arrived.indices.before),
            };
            if GENERAL {
                if arrived.met.missed {
                    k = self.direction_before(i, k);
                } else {
                    k = self.direction_out(i, k);
                    traced.ray.point = self.point_out(i, traced.ray.point);
                }
            }
            if behind.is_none() {
                break;
            }
        }
        traced.ray.direction = k * (R::ONE / index);
        traced
    }
}

impl<R: Real> TracedRay<R> {
    /// Takes the ray from `p`, in the frame of the surface before, through a surface to which it has
    /// been propagated. Returns its optical direction behind, or `None` if it is lost.
    #[inline(always)]
    fn cross(
        &mut self,
        i: usize,
        p: Vec3<R>,
        arrived: &PropagatedRay<'_, R>,
        blocks: impl Fn(Vec3<R>) -> bool,
        visit: &mut impl FnMut(usize, Vec3<R>),
    ) -> Option<Vec3<R>> {
        let mut refraction = arrived.refract();
        refraction.clipped |= !arrived.met.missed && blocks(refraction.point);
        if arrived.met.missed {
            self.ray.point = arrived.end_position(p);
        } else {
            self.ray.point = refraction.point;
            self.opl += arrived.path;
            if self.first_backward_surface.is_none()
                && is_backwards(refraction.s, p, arrived.indices.n2)
            {
                self.first_backward_surface = Some(i);
            }
            visit(i, refraction.point);
        }
        let Some(cause) = arrived.loss_cause(&refraction) else { return Some(refraction.k) };
        self.fate = Fate::from_code(fate::encode(i as u32, cause));
        None
    }
}

/// True if the path of length `s k` from `p` leads backwards by more than rounding explains, as
/// between surfaces that touch.
fn is_backwards<R: Real>(s: R, p: Vec3<R>, n2: R) -> bool {
    let size = p.x.value().abs() + p.y.value().abs() + p.z.value().abs();
    s.value() * n2.value().sqrt() < -16.0 * R::EPSILON * size
}

impl Tracer<f64> {
    /// The polyline of a ray, for drawing. A ray that misses a surface is extended to the vertex plane
    /// of that surface, if it travels towards it.
    pub fn polyline(&self, ray: Ray<f64>) -> RayPolyline {
        let mut points = vec![ray.point];
        let frames = self.frames();
        let mut heights = Vec::with_capacity(self.interfaces.len());
        let landing = self.visit(ray, |i, p| {
            if let Some(gap) = self.grin_gap_before(i) {
                let before = self.trace_to(ray, i - 1).ray;
                let inside = gap.sample_points(&self.interfaces[i], before);
                points.extend(inside.map(|p| frames[i - 1].point_out(p)));
            }
            heights.push(p.x.hypot(p.y));
            let p = self.mount(i).map_or(p, |mount| mount.pose.point_out(p));
            points.push(frames[i].point_out(p));
        });
        if let Fate::Missed(surface) = landing.fate {
            let (p, d) = (landing.ray.point, landing.ray.direction);
            let s = -p.z / d.z;
            if s.is_finite() && s > 0.0 {
                points.push(frames[surface as usize].point_out(p + d * s));
            }
        }
        RayPolyline { points, heights, fate: landing.fate }
    }
}

/// The optical direction `n d / |d|`.
#[inline(always)]
pub(super) fn optical_direction<R: Real>(direction: Vec3<R>, index: R) -> Vec3<R> {
    direction * (index / direction.dot(direction).sqrt())
}
