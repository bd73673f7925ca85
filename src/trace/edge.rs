//! The edge of a pupil: how the rays on it land, and how it moves with the lens.
//!
//! Along the edge the margin `M` of one hurdle is zero. Its derivative by every number of the lens
//! has two parts: what the hurdle's own surface does to it, by dual numbers over the few inputs of
//! one crossing, and what the surfaces in front do to the ray that arrives there, by the backward
//! pass through those. The cost does not depend on the number of parameters.

use super::interface::{Form, Interface, Meeting};
use super::margin::Hurdle;
use super::single::{Ray, launch};
use super::{Gradient, Rays, Seed, Tracer};
use crate::lens::ASPHERE_TERMS;
use crate::math::{Dual, Real, Vec3};

/// What the margin of one crossing depends on: point and optical direction of the ray, the indices
/// on both sides, curvature, conic constant and coefficients.
const INPUTS: usize = 10 + ASPHERE_TERMS;
type Local = Dual<f64, INPUTS>;

impl<R: Real> Tracer<R> {
    /// The margin of a ray at one hurdle, whatever happens to it at the rims before; `None` where
    /// it does not get there.
    pub fn margin(&self, ray: Ray<R>, surface: usize, hurdle: Hurdle) -> Option<R> {
        let (start, k) = self.arrive(ray, surface)?;
        Some(self.margin_from(surface, hurdle, start, k))
    }

    /// Where a ray of the edge lands: one that takes a hurdle with no margin at all. The cosine
    /// that vanishes there is set to zero, because the root of its rounding error would cost half
    /// of the digits; rims clip nothing. `None` where the ray does not arrive.
    pub fn land_at_edge(&self, ray: Ray<R>, surface: usize, hurdle: Hurdle) -> Option<Vec3<R>> {
        let mut k = launch(ray.direction, self.index_before);
        let mut point = ray.point;
        for (i, interface) in self.interfaces.iter().enumerate() {
            let start = Vec3::new(point.x, point.y, point.z - interface.gap);
            let limit = (i == surface).then_some(hurdle);
            (point, k) = if self.touches_gradient(i) {
                self.arrive_at(i, point, k).pass_edge(limit)?
            } else {
                interface.pass_edge(start, k, limit)?
            };
        }
        point.is_finite().then_some(point)
    }

    /// A ray in front of a surface, in its frame: point and optical direction.
    fn arrive(&self, ray: Ray<R>, surface: usize) -> Option<(Vec3<R>, Vec3<R>)> {
        let mut k = launch(ray.direction, self.index_before);
        let mut point = ray.point;
        for (i, interface) in self.interfaces[..surface].iter().enumerate() {
            let start = Vec3::new(point.x, point.y, point.z - interface.gap);
            (point, k) = if self.touches_gradient(i) {
                self.arrive_at(i, point, k).pass_edge(None)?
            } else {
                interface.pass_edge(start, k, None)?
            };
        }
        let gap = self.interfaces[surface].gap;
        Some((Vec3::new(point.x, point.y, point.z - gap), k))
    }
}

impl<R: Real> Interface<R> {
    /// Meets the surface and goes on, clipped by no rim; a ray at a limit takes it exactly.
    fn pass_edge(
        &self,
        start: Vec3<R>,
        k: Vec3<R>,
        limit: Option<Hurdle>,
    ) -> Option<(Vec3<R>, Vec3<R>)> {
        let met = match limit {
            Some(Hurdle::Miss) if !matches!(self.form, Form::Plane | Form::Asphere) => {
                self.meet_tangent(start, k)
            }
            _ => self.meeting(start, k),
        };
        // At the equator rounding decides whether a ray counts as missed: it does not.
        if met.missed && limit != Some(Hurdle::Equator) {
            return None;
        }
        if limit == Some(Hurdle::Reflection) {
            return Some((met.point, k - met.normal * (met.a / met.m)));
        }
        let crossing = self.go_on(met, k);
        (!crossing.reflected).then_some((crossing.point, crossing.k))
    }

    /// Where a ray touches a sphere or conic.
    fn meet_tangent(&self, start: Vec3<R>, k: Vec3<R>) -> Meeting<R> {
        let (c, conic) = (self.curvature, self.conic);
        let axial = conic * start.z;
        let b = k.z - c * (start.dot(k) + axial * k.z);
        let s = b / (c * (self.n2 + conic * k.z * k.z));
        let point = start + k * s;
        let z = R::ONE - c * (point.z + conic * point.z);
        let normal = Vec3::new(-(c * point.x), -(c * point.y), z);
        Meeting { point, s, normal, a: R::ZERO, m: normal.dot(normal), missed: !point.is_finite() }
    }

    /// The margin of a ray at a hurdle of this surface; see [`Tracer::margins`].
    pub(super) fn margin(&self, hurdle: Hurdle, start: Vec3<R>, k: Vec3<R>) -> R {
        let met = self.meeting(start, k);
        match hurdle {
            Hurdle::Rim => self.rim_margin(met.point),
            Hurdle::Obstruction => self.obstruction_margin(met.point),
            Hurdle::Reflection => met.a * met.a + self.dn2 * met.m,
            Hurdle::Miss => match self.form {
                Form::Plane => self.sense * k.z,
                Form::Asphere => met.a * met.a,
                Form::Sphere | Form::Conic => self.discriminant(start, k),
            },
            Hurdle::Equator => self.equator_margin(&met),
            // Glass has no side.
            Hurdle::Side => R::ONE,
        }
    }
}

impl Tracer<f64> {
    /// The derivative of `Σ weight × margin` over rays by every number of the system, for the
    /// margin of one hurdle; a ray that does not get there counts nothing.
    pub fn margin_gradient(
        &self,
        surface: usize,
        hurdle: Hurdle,
        rays: &Rays<f64>,
        weights: &[f64],
    ) -> Gradient<f64> {
        let mut total = Gradient::zero(self.interfaces.len());
        let mut seeds = vec![Seed::default(); rays.len()];
        for (i, (seed, weight)) in seeds.iter_mut().zip(weights).enumerate() {
            if let Some((start, k)) = self.arrive(rays.get(i), surface) {
                *seed = if self.touches_gradient(surface) {
                    let slopes = self.graded_margin_slopes(surface, hurdle, start, k);
                    self.sow_graded_margin(surface, k, &slopes, *weight, &mut total)
                } else {
                    let slopes = self.interfaces[surface].margin_slopes(hurdle, start, k);
                    self.sow_margin(surface, k, &slopes, *weight, &mut total)
                };
                if let Some(rim) = self.limiting(surface, hurdle) {
                    let radius = self.interfaces[rim].rim2.sqrt();
                    total.surfaces[rim].semi_diameter += weight * 2.0 * radius;
                }
            }
        }
        let front = self.front(surface).gradient(rays, |i| seeds[i]);
        total.add(&front, 1.0);
        total
    }

    /// Takes what the hurdle's own surface contributes; the rest is the seed of the ray in front.
    fn sow_margin(
        &self,
        surface: usize,
        k: Vec3<f64>,
        slopes: &[f64; INPUTS],
        weight: f64,
        total: &mut Gradient<f64>,
    ) -> Seed<f64> {
        let by = slopes.map(|slope| slope * weight);
        let own = &self.interfaces[surface];
        let by_k = Vec3::new(by[3], by[4], by[5]);
        let direction = k * (1.0 / own.index_before);
        let by_index = by[6] + by_k.dot(direction);
        match own.medium {
            Some(before) => total.surfaces[before].index += by_index,
            None => total.index_before += by_index,
        }
        let numbers = &mut total.surfaces[surface];
        numbers.index += by[7];
        numbers.curvature += by[8];
        if matches!(own.form, Form::Conic | Form::Asphere) {
            numbers.conic += by[9];
        }
        if own.form == Form::Asphere {
            numbers.terms.iter_mut().zip(&by[10..]).for_each(|(to, from)| *to += from);
        }
        if let Some(before) = surface.checked_sub(1) {
            total.surfaces[before].thickness -= by[2];
        }
        let point = Vec3::new(by[0], by[1], by[2]);
        Seed { point, direction: by_k * own.index_before, opl: 0.0 }
    }

    /// The surfaces in front of one, with nothing that clips.
    fn front(&self, surface: usize) -> Self {
        let interfaces = self.interfaces[..surface].to_vec();
        let gaps = self.gaps.iter().take(surface).cloned().collect();
        let plans = Vec::new();
        Self { interfaces, index_before: self.index_before, gaps, plans }.opened()
    }
}

impl Interface<f64> {
    /// The derivatives of a margin by the inputs of one crossing.
    fn margin_slopes(&self, hurdle: Hurdle, start: Vec3<f64>, k: Vec3<f64>) -> [f64; INPUTS] {
        let local = self.local();
        let input = Local::variable;
        let start = Vec3::new(input(start.x, 0), input(start.y, 1), input(start.z, 2));
        let k = Vec3::new(input(k.x, 3), input(k.y, 4), input(k.z, 5));
        local.margin(hurdle, start, k).slope
    }

    /// The same surface with its numbers as inputs.
    fn local(&self) -> Interface<Local> {
        let indices = [(self.index_before, 6), (self.index_behind, 7)];
        self.with_inputs(&indices.map(|(n, i)| Local::variable(n, i)), 8)
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
            form: if self.form == Form::Plane { Form::Sphere } else { self.form },
            mirror: self.mirror,
            far: self.far,
            sense: constant(self.sense),
            gap: constant(self.gap),
            curvature: Dual::variable(self.curvature, first),
            conic: Dual::variable(self.conic, first + 1),
            terms,
            medium: self.medium,
            index_before: before,
            n2: before * before,
            index_behind: behind,
            dn2: (behind - before) * (behind + before),
            rim2: constant(self.rim2),
            obstruction2: constant(self.obstruction2),
            sheet: constant(self.sheet),
            steepest: self.steepest,
            span: self.span,
        }
    }
}
