//! The edge of a pupil: how the rays on it land, and how it moves with the lens.
//!
//! Along the edge the margin `M` of one hurdle is zero. Its derivative by every number of the lens
//! has two parts: what the hurdle's own surface does to it, by dual numbers over the few inputs of
//! one crossing, and what the surfaces in front do to the ray that arrives there, by the backward
//! pass through those. The cost does not depend on the number of parameters.

use super::interface::{Interface, Intersection, SurfaceForm};
use super::margin::RayLimit;
use super::single::{Ray, optical_direction};
use super::{AdjointSeed, Rays, SystemGradient, Tracer};
use crate::lens::ASPHERE_TERMS;
use crate::math::{Dual, Real, Vec3};

/// What the margin of one crossing depends on: point and optical direction of the ray, the indices
/// on both sides, curvature, conic constant and coefficients.
const INPUTS: usize = 10 + ASPHERE_TERMS;
type CrossingDual = Dual<f64, INPUTS>;

impl<R: Real> Tracer<R> {
    /// The margin of a ray at one hurdle, whatever happens to it at the rims before; `None` where
    /// it does not get there.
    pub fn margin(&self, ray: Ray<R>, surface: usize, hurdle: RayLimit) -> Option<R> {
        let (start, k) = self.state_before(ray, surface)?;
        Some(self.margin_from(surface, hurdle, start, k))
    }

    /// Where a ray of the edge lands: one that takes a hurdle with no margin at all. The cosine
    /// that vanishes there is set to zero, because the root of its rounding error would cost half
    /// of the digits; rims clip nothing. `None` where the ray does not arrive.
    pub fn land_at_edge(&self, ray: Ray<R>, surface: usize, hurdle: RayLimit) -> Option<Vec3<R>> {
        let mut k = optical_direction(ray.direction, self.index_before);
        let mut point = ray.point;
        for (i, interface) in self.interfaces.iter().enumerate() {
            let start = Vec3::new(point.x, point.y, point.z - interface.gap);
            let limit = (i == surface).then_some(hurdle);
            (point, k) = if self.touches_grin(i) {
                self.propagate(i, point, k).cross_at_edge(limit)?
            } else {
                interface.cross_at_edge(start, k, limit)?
            };
        }
        point.is_finite().then_some(point)
    }

    /// A ray in front of a surface, in its frame: point and optical direction.
    fn state_before(&self, ray: Ray<R>, surface: usize) -> Option<(Vec3<R>, Vec3<R>)> {
        let mut k = optical_direction(ray.direction, self.index_before);
        let mut point = ray.point;
        for (i, interface) in self.interfaces[..surface].iter().enumerate() {
            let start = Vec3::new(point.x, point.y, point.z - interface.gap);
            (point, k) = if self.touches_grin(i) {
                self.propagate(i, point, k).cross_at_edge(None)?
            } else {
                interface.cross_at_edge(start, k, None)?
            };
        }
        let gap = self.interfaces[surface].gap;
        Some((Vec3::new(point.x, point.y, point.z - gap), k))
    }
}

impl<R: Real> Interface<R> {
    /// Meets the surface and goes on, clipped by no rim; a ray at a limit takes it exactly.
    fn cross_at_edge(
        &self,
        start: Vec3<R>,
        k: Vec3<R>,
        limit: Option<RayLimit>,
    ) -> Option<(Vec3<R>, Vec3<R>)> {
        let met = match limit {
            Some(RayLimit::Miss)
                if !matches!(self.form, SurfaceForm::Plane | SurfaceForm::Asphere) =>
            {
                self.intersect_tangent(start, k)
            }
            _ => self.intersect(start, k),
        };
        // At the equator rounding decides whether a ray counts as missed: it does not.
        if met.missed && limit != Some(RayLimit::Equator) {
            return None;
        }
        if limit == Some(RayLimit::TotalReflection) {
            return Some((met.point, k - met.normal * (met.a / met.m)));
        }
        let crossing = self.refract(met, k);
        (!crossing.reflected).then_some((crossing.point, crossing.k))
    }

    /// Where a ray touches a sphere or conic.
    fn intersect_tangent(&self, start: Vec3<R>, k: Vec3<R>) -> Intersection<R> {
        let (c, conic) = (self.curvature, self.conic);
        let axial = conic * start.z;
        let b = k.z - c * (start.dot(k) + axial * k.z);
        let s = b / (c * (self.n2 + conic * k.z * k.z));
        let point = start + k * s;
        let z = R::ONE - c * (point.z + conic * point.z);
        let normal = Vec3::new(-(c * point.x), -(c * point.y), z);
        Intersection {
            point,
            s,
            normal,
            a: R::ZERO,
            m: normal.dot(normal),
            missed: !point.is_finite(),
        }
    }

    /// The margin of a ray at a hurdle of this surface; see [`Tracer::margins`].
    pub(super) fn margin(&self, hurdle: RayLimit, start: Vec3<R>, k: Vec3<R>) -> R {
        let met = self.intersect(start, k);
        match hurdle {
            RayLimit::Rim => self.rim_margin(met.point),
            RayLimit::Obstruction => self.obstruction_margin(met.point),
            RayLimit::TotalReflection => met.a * met.a + self.dn2 * met.m,
            RayLimit::Miss => match self.form {
                SurfaceForm::Plane => self.sense * k.z,
                SurfaceForm::Asphere => met.a * met.a,
                SurfaceForm::Sphere | SurfaceForm::Conic => self.discriminant(start, k),
            },
            RayLimit::Equator => self.equator_margin(&met),
            // Glass has no side.
            RayLimit::Side => R::ONE,
        }
    }
}

impl Tracer<f64> {
    /// The derivative of `Σ weight × margin` over rays by every number of the system, for the
    /// margin of one hurdle; a ray that does not get there counts nothing.
    pub fn margin_gradient(
        &self,
        surface: usize,
        hurdle: RayLimit,
        rays: &Rays<f64>,
        weights: &[f64],
    ) -> SystemGradient<f64> {
        let mut total = SystemGradient::zero(self.interfaces.len());
        let mut seeds = vec![AdjointSeed::default(); rays.len()];
        for (i, (seed, weight)) in seeds.iter_mut().zip(weights).enumerate() {
            if let Some((start, k)) = self.state_before(rays.get(i), surface) {
                *seed = if self.touches_grin(surface) {
                    let slopes = self.grin_margin_slopes(surface, hurdle, start, k);
                    self.grin_margin_seed(surface, k, &slopes, *weight, &mut total)
                } else {
                    let slopes = self.interfaces[surface].margin_slopes(hurdle, start, k);
                    self.margin_seed(surface, k, &slopes, *weight, &mut total)
                };
                if let Some(rim) = self.limiting_surface(surface, hurdle) {
                    let radius = self.interfaces[rim].rim2.sqrt();
                    total.surfaces[rim].semi_diameter += weight * 2.0 * radius;
                }
            }
        }
        let front = self.surfaces_before(surface).gradient(rays, |i| seeds[i]);
        total.add(&front, 1.0);
        total
    }

    /// Takes what the hurdle's own surface contributes; the rest is the seed of the ray in front.
    fn margin_seed(
        &self,
        surface: usize,
        k: Vec3<f64>,
        slopes: &[f64; INPUTS],
        weight: f64,
        total: &mut SystemGradient<f64>,
    ) -> AdjointSeed<f64> {
        let by = slopes.map(|slope| slope * weight);
        let own = &self.interfaces[surface];
        let by_k = Vec3::new(by[3], by[4], by[5]);
        let direction = k * (1.0 / own.index_before);
        let by_index = by[6] + by_k.dot(direction);
        match own.medium_before {
            Some(before) => total.surfaces[before].index += by_index,
            None => total.index_before += by_index,
        }
        let numbers = &mut total.surfaces[surface];
        numbers.index += by[7];
        numbers.curvature += by[8];
        if matches!(own.form, SurfaceForm::Conic | SurfaceForm::Asphere) {
            numbers.conic += by[9];
        }
        if own.form == SurfaceForm::Asphere {
            numbers.terms.iter_mut().zip(&by[10..]).for_each(|(to, from)| *to += from);
        }
        if let Some(before) = surface.checked_sub(1) {
            total.surfaces[before].thickness -= by[2];
        }
        let point = Vec3::new(by[0], by[1], by[2]);
        AdjointSeed { point, direction: by_k * own.index_before, opl: 0.0 }
    }

    /// The surfaces in front of one, with nothing that clips.
    fn surfaces_before(&self, surface: usize) -> Self {
        let interfaces = self.interfaces[..surface].to_vec();
        let gaps = self.grin_gaps.iter().take(surface).cloned().collect();
        let plans = Vec::new();
        Self { interfaces, index_before: self.index_before, grin_gaps: gaps, step_plans: plans }
            .without_rims()
    }
}

impl Interface<f64> {
    /// The derivatives of a margin by the inputs of one crossing.
    fn margin_slopes(&self, hurdle: RayLimit, start: Vec3<f64>, k: Vec3<f64>) -> [f64; INPUTS] {
        let local = self.with_dual_inputs();
        let input = CrossingDual::variable;
        let start = Vec3::new(input(start.x, 0), input(start.y, 1), input(start.z, 2));
        let k = Vec3::new(input(k.x, 3), input(k.y, 4), input(k.z, 5));
        local.margin(hurdle, start, k).slope
    }

    /// The same surface with its numbers as inputs.
    fn with_dual_inputs(&self) -> Interface<CrossingDual> {
        let indices = [(self.index_before, 6), (self.index_behind, 7)];
        self.with_inputs(&indices.map(|(n, i)| CrossingDual::variable(n, i)), 8)
    }

    /// The same surface between these indices, its curvature, conic constant and coefficients as
    /// inputs from number `first` on; a plane as the sphere that it may become.
    pub(super) fn with_inputs<const N: usize>(
        &self,
        [before, behind]: &[Dual<f64, N>; 2],
        first: usize,
    ) -> Interface<Dual<f64, N>> {
        let (before, behind, constant) = (*before, *behind, Dual::constant);
        let terms = std::array::from_fn(|j| Dual::variable(self.terms[j], first + 2 + j));
        Interface {
            form: if self.form == SurfaceForm::Plane { SurfaceForm::Sphere } else { self.form },
            mirror: self.mirror,
            starts_far: self.starts_far,
            sense: constant(self.sense),
            gap: constant(self.gap),
            curvature: Dual::variable(self.curvature, first),
            conic: Dual::variable(self.conic, first + 1),
            terms,
            medium_before: self.medium_before,
            index_before: before,
            n2: before * before,
            index_behind: behind,
            dn2: (behind - before) * (behind + before),
            rim2: constant(self.rim2),
            obstruction2: constant(self.obstruction2),
            min_normal_z: constant(self.min_normal_z),
            slope_bound: self.slope_bound,
            sag_range: self.sag_range,
        }
    }
}
