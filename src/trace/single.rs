//! One ray at a time, over any number type, with everything about its way.

use super::Tracer;
use super::fate::{self, CLIPPED, Fate, MISSED, TOTAL_REFLECTION};
use super::graded::PropagatedRay;
use super::interface::Interface;
use crate::lens::SystemError;
use crate::math::Real;
use crate::math::Vec3;

/// A straight ray.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Ray<R> {
    /// A point on it, in mm.
    pub point: Vec3<R>,
    /// Its direction cosines.
    pub direction: Vec3<R>,
}

impl Ray<f64> {
    /// Refuses a ray that is not finite or whose direction is not of length 1 within 1e-9; `number`
    /// is how the error calls it.
    pub fn check(&self, number: usize) -> Result<(), SystemError> {
        let refuse = |found: String| Err(SystemError::Ray { ray: number, found });
        let (p, d) = (self.point, self.direction);
        let sizes = [p.x, p.y, p.z].map(f64::abs);
        if !(p.is_finite() && d.is_finite()) || sizes.iter().any(|v| *v > 1e100) {
            return refuse(format!("start {p:?}, direction {d:?}"));
        }
        let length = d.dot(d).sqrt();
        if (length - 1.0).abs() > 1e-9 {
            return refuse(format!("a direction of length {length}"));
        }
        Ok(())
    }
}

/// Where and how a ray ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TracedRay<R> {
    /// How.
    pub fate: Fate,
    /// Point and direction in the frame of the surface where it ended: behind the last surface for
    /// a ray that arrived, where it was clipped or reflected, or where it was before the surface
    /// that it missed (in the frame of that surface).
    pub ray: Ray<R>,
    /// The optical path from the start to that point, in mm.
    pub opl: R,
    /// The first surface that was reached by going backwards.
    pub first_backward_surface: Option<usize>,
}

/// The corners of a ray's way and how it ended.
#[derive(Debug, Clone, PartialEq)]
pub struct RayPolyline {
    /// The start, every point of incidence, and points between on the curve through a gradient, in
    /// the frame of the first vertex.
    pub points: Vec<Vec3<f64>>,
    /// How far from the axis it meets each surface, as far as it gets.
    pub heights: Vec<f64>,
    /// How it ended.
    pub fate: Fate,
}

impl<R: Real> Tracer<R> {
    /// Traces one ray that starts in the frame of the first vertex. Its direction is normalised.
    pub fn trace(&self, ray: Ray<R>) -> TracedRay<R> {
        self.trace_surfaces(ray, self.interfaces.len(), |_, _| {})
    }

    /// Traces one ray and calls `visit` with each surface and the point of incidence in its frame.
    pub fn visit(&self, ray: Ray<R>, visit: impl FnMut(usize, Vec3<R>)) -> TracedRay<R> {
        self.trace_surfaces(ray, self.interfaces.len(), visit)
    }

    /// Traces one ray through the first surfaces, up to and with `surface`.
    pub fn trace_to(&self, ray: Ray<R>, surface: usize) -> TracedRay<R> {
        self.trace_surfaces(ray, (surface + 1).min(self.interfaces.len()), |_, _| {})
    }

    fn trace_surfaces(
        &self,
        ray: Ray<R>,
        surfaces: usize,
        visit: impl FnMut(usize, Vec3<R>),
    ) -> TracedRay<R> {
        if self.grin_gaps.is_empty() {
            self.trace_homogeneous(ray, surfaces, visit)
        } else {
            self.trace_grin(ray, surfaces, visit)
        }
    }

    fn trace_homogeneous(
        &self,
        ray: Ray<R>,
        surfaces: usize,
        mut visit: impl FnMut(usize, Vec3<R>),
    ) -> TracedRay<R> {
        let mut k = optical_direction(ray.direction, self.index_before);
        let mut landing =
            TracedRay { fate: Fate::Imaged, ray, opl: R::ZERO, first_backward_surface: None };
        let mut index = self.index_before;
        for (i, interface) in self.interfaces[..surfaces].iter().enumerate() {
            let Some(behind) = landing.cross(i, interface, k, &mut visit) else { break };
            (k, index) = (behind, interface.index_behind);
        }
        landing.ray.direction = k * (R::ONE / index);
        landing
    }

    /// The same where a gradient fills a gap: a loop of its own, since what it needs would take
    /// registers from the other one.
    #[cold]
    #[inline(never)]
    fn trace_grin(
        &self,
        ray: Ray<R>,
        surfaces: usize,
        mut visit: impl FnMut(usize, Vec3<R>),
    ) -> TracedRay<R> {
        let mut k = optical_direction(ray.direction, self.index_before);
        let mut landing =
            TracedRay { fate: Fate::Imaged, ray, opl: R::ZERO, first_backward_surface: None };
        let mut index = self.index_before;
        for (i, interface) in self.interfaces[..surfaces].iter().enumerate() {
            if !self.touches_grin(i) {
                let Some(behind) = landing.cross(i, interface, k, &mut visit) else { break };
                (k, index) = (behind, interface.index_behind);
                continue;
            }
            let p = landing.ray.point;
            let arrival = self.propagate(i, p, k);
            let Some(behind) = landing.cross_grin(i, p, &arrival, &mut visit) else {
                (k, index) = (arrival.k, arrival.surface.index_before);
                break;
            };
            (k, index) = (behind, arrival.surface.index_behind);
        }
        landing.ray.direction = k * (R::ONE / index);
        landing
    }
}

impl<R: Real> TracedRay<R> {
    /// Takes a ray with the optical direction `k` through a surface between glasses; its direction
    /// behind, if it gets through.
    #[inline(always)]
    fn cross(
        &mut self,
        i: usize,
        interface: &Interface<R>,
        k: Vec3<R>,
        visit: &mut impl FnMut(usize, Vec3<R>),
    ) -> Option<Vec3<R>> {
        let p = self.ray.point;
        let crossing = interface.cross(p, k);
        let code = |cause| fate::encode(i as u32, cause);
        if crossing.missed {
            self.ray.point.z = p.z - interface.gap;
            self.fate = Fate::from_code(code(MISSED));
            return None;
        }
        self.ray.point = crossing.point;
        self.opl += crossing.s * interface.n2;
        if self.first_backward_surface.is_none() && is_backwards(crossing.s, p, interface.n2) {
            self.first_backward_surface = Some(i);
        }
        visit(i, crossing.point);
        if crossing.clipped || crossing.reflected {
            let cause = if crossing.clipped { CLIPPED } else { TOTAL_REFLECTION };
            self.fate = Fate::from_code(code(cause));
            return None;
        }
        Some(crossing.k)
    }

    /// Takes a ray that comes from `p` through a surface that a gradient touches; its direction
    /// behind, if it gets through.
    fn cross_grin(
        &mut self,
        i: usize,
        p: Vec3<R>,
        arrival: &PropagatedRay<R>,
        visit: &mut impl FnMut(usize, Vec3<R>),
    ) -> Option<Vec3<R>> {
        let crossing = arrival.refract();
        if arrival.met.missed {
            self.ray.point = arrival.end_position(p);
        } else {
            self.ray.point = crossing.point;
            self.opl += arrival.path;
            if self.first_backward_surface.is_none()
                && is_backwards(crossing.s, p, arrival.surface.n2)
            {
                self.first_backward_surface = Some(i);
            }
            visit(i, crossing.point);
        }
        match arrival.loss_cause(&crossing) {
            None => Some(crossing.k),
            Some(cause) => {
                self.fate = Fate::from_code(fate::encode(i as u32, cause));
                None
            }
        }
    }
}

/// Whether a way of length `s k` from `p` leads back by more than rounding can explain, as between
/// surfaces that touch.
fn is_backwards<R: Real>(s: R, p: Vec3<R>, n2: R) -> bool {
    let size = p.x.value().abs() + p.y.value().abs() + p.z.value().abs();
    s.value() * n2.value().sqrt() < -16.0 * R::EPSILON * size
}

impl Tracer<f64> {
    /// The corners of a ray's way, for drawing. A ray that misses a surface is drawn on to the
    /// vertex plane of that surface, if it is going there.
    pub fn path(&self, ray: Ray<f64>) -> RayPolyline {
        let mut points = vec![ray.point];
        let mut vertices = Vec::with_capacity(self.interfaces.len());
        let mut z = 0.0;
        for interface in &self.interfaces {
            z += interface.gap;
            vertices.push(z);
        }
        let mut heights = Vec::with_capacity(self.interfaces.len());
        let landing = self.visit(ray, |i, p| {
            if let Some(gap) = self.grin_gap_before(i) {
                let before = self.trace_to(ray, i - 1).ray;
                let inside = gap.sample_points(&self.interfaces[i], before);
                points.extend(inside.map(|p| Vec3::new(p.x, p.y, p.z + vertices[i - 1])));
            }
            heights.push(p.x.hypot(p.y));
            points.push(Vec3::new(p.x, p.y, p.z + vertices[i]));
        });
        if let Fate::Missed(surface) = landing.fate {
            let (p, d) = (landing.ray.point, landing.ray.direction);
            let s = -p.z / d.z;
            if s.is_finite() && s > 0.0 {
                let end = p + d * s;
                points.push(Vec3::new(end.x, end.y, vertices[surface as usize]));
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
