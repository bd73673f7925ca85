//! The edge of a pupil: the landings of the rays on it, and its motion with the numbers of the lens.
//!
//! Along the edge the margin `M` at one limit is zero. Its derivative by every number of the lens
//! has two parts: the dependence of `M` on the surface of the limit and on the gaps beside it, by
//! dual numbers over the few inputs of one crossing, and that on the surfaces in front, by the
//! adjoint of the ray that arrives there. The cost does not depend on the number of parameters.
//!
//! In a GRIN medium a margin has no closed form, so that the dual numbers pass through the steps of
//! the gap: few rays are on an edge.

use super::aperture::ApertureSet;
use super::grin_gap::GrinGap;
use super::interface::{Interface, Intersection, SurfaceForm};
use super::margin::RayLimit;
use super::mount::Mount;
use super::propagation::{PropagatedRay, SurfaceSite};
use super::single::{Ray, optical_direction};
use super::{AdjointSeed, Rays, SystemGradient, Tracer};
use crate::lens::{ASPHERE_TERMS, PROFILE_TERMS};
use crate::math::{Dual, Real, Vec3};

/// The inputs of a margin are point and optical direction of the ray, then the numbers below.
const BEFORE: usize = 6;
const BEHIND: usize = 7;
const CURVATURE: usize = 8;
const CONIC: usize = 9;
const TERMS: usize = 10;
/// The number of inputs between homogeneous media.
const INPUTS: usize = TERMS + ASPHERE_TERMS;
/// A GRIN medium adds the thickness of the gap in front and the coefficients of both media.
const GAP: usize = INPUTS;
const TERMS_BEFORE: usize = GAP + 1;
const TERMS_BEHIND: usize = TERMS_BEFORE + PROFILE_TERMS;
/// The number of numbers of a freeform that are inputs at a time.
const FORM_INPUTS: usize = 8;
/// The number of inputs where a GRIN medium touches the surface.
const GRIN_INPUTS: usize = TERMS_BEHIND + PROFILE_TERMS;

impl<R: Real> Tracer<R> {
    /// The margin of a ray at one limit, regardless of the rims in front; `None` for a ray that does
    /// not get there.
    pub fn margin(&self, ray: Ray<R>, surface: usize, limit: RayLimit) -> Option<R> {
        Some(self.arrived(ray, surface)?.margin(limit, self.apertures.of(surface)))
    }

    /// A ray where it meets a surface; `None` for one that does not get there.
    #[inline(always)]
    fn arrived(&self, ray: Ray<R>, surface: usize) -> Option<PropagatedRay<'_, R>> {
        if self.is_plain() {
            let (p, k) = self.state_before::<false>(ray, surface)?;
            Some(self.propagate::<false>(surface, p, k))
        } else {
            let (p, k) = self.state_before::<true>(ray, surface)?;
            Some(self.propagate::<true>(surface, p, k))
        }
    }

    /// The margin of a ray at one limit as by [`Tracer::margin`], with the rims and obstructions of
    /// another tracer of the same lens; `None` also if a medium has a gradient.
    pub fn margin_with_rims(
        &self,
        rims: &Tracer<f64>,
        ray: Ray<R>,
        surface: usize,
        limit: RayLimit,
    ) -> Option<R> {
        if !self.grin_gaps.is_empty() {
            return None;
        }
        let arrived = self.arrived(ray, surface)?;
        let Interface { rim2, obstruction2, .. } = rims.interfaces[surface];
        let clipping = Interface {
            rim2: R::from_f64(rim2),
            obstruction2: R::from_f64(obstruction2),
            ..*arrived.surface
        };
        match limit {
            RayLimit::Rim => Some(clipping.rim_margin(arrived.met.point)),
            RayLimit::Obstruction => Some(clipping.obstruction_margin(arrived.met.point)),
            _ => Some(arrived.margin(limit, self.apertures.of(surface))),
        }
    }

    /// The landing of a ray on the edge, whose margin at a limit is zero. The cosine that vanishes
    /// there is set to zero, because the root of its rounding error would cost half of the digits;
    /// rims clip nothing. `None` for a ray that does not arrive.
    pub fn land_at_edge(&self, ray: Ray<R>, surface: usize, limit: RayLimit) -> Option<Vec3<R>> {
        if self.is_plain() {
            self.edge_landing::<false>(ray, surface, limit)
        } else {
            self.edge_landing::<true>(ray, surface, limit)
        }
    }

    fn edge_landing<const GENERAL: bool>(
        &self,
        ray: Ray<R>,
        surface: usize,
        limit: RayLimit,
    ) -> Option<Vec3<R>> {
        let mut k = optical_direction(ray.direction, self.index_before);
        let mut point = ray.point;
        for i in 0..self.interfaces.len() {
            let limit = (i == surface).then_some(limit);
            let behind = self.propagate::<GENERAL>(i, point, k).cross_at_edge(limit)?;
            (point, k) = self.state_out(i, behind);
        }
        point.is_finite().then_some(point)
    }

    /// Point and optical direction of a ray in front of a surface, in the frame of the surface before.
    fn state_before<const GENERAL: bool>(
        &self,
        ray: Ray<R>,
        surface: usize,
    ) -> Option<(Vec3<R>, Vec3<R>)> {
        let mut k = optical_direction(ray.direction, self.index_before);
        let mut point = ray.point;
        for i in 0..surface {
            let behind = self.propagate::<GENERAL>(i, point, k).cross_at_edge(None)?;
            (point, k) = self.state_out(i, behind);
        }
        Some((point, k))
    }

    /// The surface whose semi-diameter a limit depends on.
    fn limiting_surface(&self, surface: usize, limit: RayLimit) -> Option<usize> {
        match limit {
            RayLimit::Rim => Some(surface),
            RayLimit::Side => {
                let before = surface.checked_sub(1)?;
                let wider = self.interfaces[before].rim2 > self.interfaces[surface].rim2;
                Some(if wider { before } else { surface })
            }
            _ => None,
        }
    }
}

impl<R: Real> PropagatedRay<'_, R> {
    /// Point and direction behind the surface of a ray that no rim clips; a ray whose margin at
    /// `limit` is zero takes that limit exactly.
    #[inline(always)]
    pub(super) fn cross_at_edge(&self, limit: Option<RayLimit>) -> Option<(Vec3<R>, Vec3<R>)> {
        let met = match (limit, self.closed_form_start()) {
            (Some(RayLimit::Miss), Some(start)) if self.surface.form != SurfaceForm::Plane => {
                self.surface.intersect_tangent(start, self.k)
            }
            _ => self.met,
        };
        // At the equator rounding decides whether a ray counts as missed: it does not.
        let missed = met.missed && limit != Some(RayLimit::Equator);
        if missed || self.is_lost_inside() {
            return None;
        }
        if limit == Some(RayLimit::TotalReflection) {
            return Some((met.point, self.grazing()));
        }
        if self.ideal().is_some() {
            let refraction = self.refract();
            return (!refraction.reflected).then_some((refraction.point, refraction.k));
        }
        let refraction = self.surface.refract(met, self.k, self.indices.dn2);
        (!refraction.reflected).then_some((refraction.point, refraction.k))
    }
}

impl<R: Real> Interface<R> {
    /// The point at which a ray touches a sphere or conic.
    fn intersect_tangent(&self, start: Vec3<R>, k: Vec3<R>) -> Intersection<R> {
        let (c, conic) = (self.curvature, self.conic);
        let axial = conic * start.z;
        let b = k.z - c * (start.dot(k) + axial * k.z);
        let s = b / (c * (self.n2 + conic * k.z * k.z));
        let point = start + k * s;
        let z = R::ONE - c * (point.z + conic * point.z);
        let normal = Vec3::new(-(c * point.x), -(c * point.y), z);
        let missed = !point.is_finite();
        Intersection { point, s, normal, a: R::ZERO, m: normal.dot(normal), missed }
    }
}

impl Tracer<f64> {
    /// The derivative of `Σ weight × margin` over rays by every number of the system, for the
    /// margin at one limit; a ray that does not get there does not contribute.
    pub fn margin_gradient(
        &self,
        surface: usize,
        limit: RayLimit,
        rays: &Rays<f64>,
        weights: &[f64],
    ) -> SystemGradient<f64> {
        if let Some(total) = self.plain_margin_gradient(surface, limit, rays, weights) {
            return total;
        }
        let mut total = SystemGradient::zero(self.interfaces.len());
        let mut seeds = vec![AdjointSeed::default(); rays.len()];
        for (i, (seed, weight)) in seeds.iter_mut().zip(weights).enumerate() {
            let Some((p, k)) = self.state_before::<true>(rays.get(i), surface) else { continue };
            *seed = if self.touches_grin(surface) {
                self.margin_seed::<GRIN_INPUTS>(surface, limit, (p, k), *weight, &mut total)
            } else {
                self.margin_seed::<INPUTS>(surface, limit, (p, k), *weight, &mut total)
            };
            if let (RayLimit::Aperture(side) | RayLimit::Obscuration(side), Some(apertures)) =
                (limit, self.apertures.of(surface))
            {
                let point = self.propagate::<true>(surface, p, k).met.point;
                apertures.add_slopes(side, point, *weight, &mut total.surfaces[surface]);
            }
            if let Some(rim) = self.limiting_surface(surface, limit) {
                let radius = self.interfaces[rim].rim2.sqrt();
                total.surfaces[rim].semi_diameter += weight * 2.0 * radius;
            }
        }
        let front = self.surfaces_before(surface).gradient(rays, |i| seeds[i]);
        total.add(&front, 1.0);
        total
    }

    /// Adds the dependence of a margin on its surface and on the gaps beside it; the rest is the seed
    /// of the ray behind the surface before, by `k` itself if that gap has a GRIN medium.
    fn margin_seed<const N: usize>(
        &self,
        surface: usize,
        limit: RayLimit,
        (p, k): (Vec3<f64>, Vec3<f64>),
        weight: f64,
        total: &mut SystemGradient<f64>,
    ) -> AdjointSeed<f64> {
        let mount = self.mount(surface);
        let apertures = self.apertures.of(surface);
        let by = self.site(surface).margin_slopes::<N>((mount, apertures), limit, p, k);
        let by = by.map(|slope| slope * weight);
        let own = &self.interfaces[surface];
        let by_k = Vec3::new(by[3], by[4], by[5]);
        let curved = self.grin_gap_before(surface).is_some();
        let direction = k * (1.0 / own.index_before);
        let by_index = by[BEFORE] + if curved { 0.0 } else { by_k.dot(direction) };
        match own.medium_before {
            Some(before) => total.surfaces[before].index += by_index,
            None => total.index_before += by_index,
        }
        let numbers = &mut total.surfaces[surface];
        if let Some(mount) = mount {
            let held = (mount, apertures);
            own.add_freeform_slopes(held, limit, (p, k), weight, &mut numbers.freeform);
        }
        numbers.index += by[BEHIND];
        numbers.curvature += by[CURVATURE];
        if matches!(own.form, SurfaceForm::Conic | SurfaceForm::Asphere) {
            numbers.conic += by[CONIC];
        }
        if own.form == SurfaceForm::Asphere {
            numbers.terms.iter_mut().zip(&by[TERMS..]).for_each(|(to, from)| *to += from);
        }
        if N == GRIN_INPUTS {
            let behind = &by[TERMS_BEHIND..];
            numbers.grin_terms.iter_mut().zip(behind).for_each(|(to, from)| *to += from);
        }
        if let Some(before) = surface.checked_sub(1) {
            let numbers = &mut total.surfaces[before];
            numbers.thickness += if N == GRIN_INPUTS { by[GAP] } else { -by[2] };
            if curved {
                let terms = &by[TERMS_BEFORE..TERMS_BEHIND];
                numbers.grin_terms.iter_mut().zip(terms).for_each(|(to, from)| *to += from);
            }
        }
        let direction = if curved { by_k } else { by_k * own.index_before };
        AdjointSeed { point: Vec3::new(by[0], by[1], by[2]), direction, opl: 0.0 }
    }

    /// The surfaces in front of one, without anything that clips.
    pub(super) fn surfaces_before(&self, surface: usize) -> Self {
        self.first_surfaces(surface).without_rims()
    }
}

impl SurfaceSite<'_, f64> {
    /// The derivatives of a margin by its inputs, for a ray in the frame of the surface before.
    fn margin_slopes<const N: usize>(
        &self,
        (mount, apertures): (Option<&Mount<f64>>, Option<&ApertureSet<f64>>),
        limit: RayLimit,
        p: Vec3<f64>,
        k: Vec3<f64>,
    ) -> [f64; N] {
        let input = Dual::<f64, N>::variable;
        let apertures = apertures.map(|set| set.map(Dual::constant));
        let apertures = apertures.as_ref();
        let k = Vec3::new(input(k.x, 3), input(k.y, 4), input(k.z, 5));
        let own = self.surface;
        let indices = [(own.index_before, BEFORE), (own.index_behind, BEHIND)];
        let indices = indices.map(|(n, i)| input(n, i));
        let surface = own.with_inputs(&indices);
        let (x, y) = (input(p.x, 0), input(p.y, 1));
        if let Some(mount) = mount {
            let (mount, p) = (mount.map(Dual::constant), Vec3::new(x, y, input(p.z, 2)));
            return mount.propagate(&surface, p, k).margin(limit, apertures).slope;
        }
        if N < GRIN_INPUTS {
            let start = Vec3::new(x, y, input(p.z - own.gap, 2));
            return PropagatedRay::straight(&surface, start, k).margin(limit, apertures).slope;
        }
        let surface = Interface { gap: input(own.gap, GAP), ..surface };
        let entry = self.entry.map(|entry| entry.map(Dual::constant));
        let before = self.before.map(|gap| gap.with_inputs(indices[0], TERMS_BEFORE));
        let behind = self.behind.map(|gap| gap.with_inputs(indices[1], TERMS_BEHIND));
        let site = SurfaceSite {
            surface: &surface,
            entry: entry.as_ref(),
            before: before.as_ref(),
            behind: behind.as_ref(),
        };
        site.propagate(Vec3::new(x, y, input(p.z, 2)), k).margin(limit, apertures).slope
    }
}

impl Interface<f64> {
    /// Adds the derivatives of a margin by the numbers of a freeform, some at a time.
    fn add_freeform_slopes(
        &self,
        (mount, apertures): (&Mount<f64>, Option<&ApertureSet<f64>>),
        limit: RayLimit,
        (p, k): (Vec3<f64>, Vec3<f64>),
        weight: f64,
        total: &mut Vec<f64>,
    ) {
        let apertures = apertures.map(|set| set.map(Dual::constant));
        let apertures = apertures.as_ref();
        let count = mount.face.as_ref().map_or(0, |face| face.form.numbers.len());
        total.resize(count.max(total.len()), 0.0);
        let surface = self.map(Dual::<f64, FORM_INPUTS>::constant);
        let (p, k) = (Vec3::from_f64(p), Vec3::from_f64(k));
        for (block, totals) in total[..count].chunks_mut(FORM_INPUTS).enumerate() {
            let mut varied = mount.map(Dual::constant);
            let numbers = varied.face.iter_mut().flat_map(|face| &mut face.form.numbers);
            for (i, number) in numbers.skip(block * FORM_INPUTS).take(FORM_INPUTS).enumerate() {
                *number = Dual::variable(number.value, i);
            }
            let by = varied.propagate(&surface, p, k).margin(limit, apertures).slope;
            totals.iter_mut().zip(by).for_each(|(to, by)| *to += weight * by);
        }
    }

    /// The same surface between these indices, with its curvature, conic constant and coefficients
    /// as inputs; a plane as the sphere that it may become.
    fn with_inputs<const N: usize>(
        &self,
        [before, behind]: &[Dual<f64, N>; 2],
    ) -> Interface<Dual<f64, N>> {
        let (before, behind) = (*before, *behind);
        Interface {
            form: if self.form == SurfaceForm::Plane { SurfaceForm::Sphere } else { self.form },
            curvature: Dual::variable(self.curvature, CURVATURE),
            conic: Dual::variable(self.conic, CONIC),
            terms: std::array::from_fn(|j| Dual::variable(self.terms[j], TERMS + j)),
            index_before: before,
            n2: before * before,
            index_behind: behind,
            dn2: (behind - before) * (behind + before),
            ..self.map(Dual::constant)
        }
    }
}

impl GrinGap<f64> {
    /// The same gap with the index of its base and its coefficients, from input `first` on, as
    /// inputs.
    fn with_inputs<const N: usize>(
        &self,
        base: Dual<f64, N>,
        first: usize,
    ) -> GrinGap<Dual<f64, N>> {
        let mut coefficients = self.field.coefficients.map(Dual::constant);
        coefficients.used = [crate::lens::RADIAL_TERMS, crate::lens::AXIAL_TERMS];
        for (k, term) in coefficients.terms.iter_mut().enumerate() {
            *term = Dual::variable(term.value, first + k);
        }
        self.with_field(crate::lens::RotationalProfile { base, coefficients })
    }
}
