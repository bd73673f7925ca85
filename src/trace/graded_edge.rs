//! How narrowly a ray passes a surface that a gradient touches, and how that changes with the lens.
//!
//! The side of the glass is a limit too: a ray that swings out farther than the wider of the two
//! faces leaves through it. How far it swings out is the largest distance on its way, whose derivative
//! is that at a fixed σ.
//!
//! What such a margin depends on has no closed form, so its derivatives are dual numbers carried
//! through the steps of the gap: few rays are on an edge.

use super::Tracer;
use super::fate::CLIPPED;
use super::gap::GrinGap;
use super::graded::PropagatedRay;
use super::interface::{Interface, SurfaceForm};
use super::margin::RayLimit;
use super::{AdjointSeed, SystemGradient};
use crate::lens::{ASPHERE_TERMS, PROFILE_TERMS, RotationalProfile};
use crate::math::{Dual, Real, Vec3};

/// Point and optical direction behind the surface before, that gap, the indices on both sides,
/// curvature, conic constant and coefficients of the surface, coefficients of the gradients on both
/// sides.
const INPUTS: usize = 11 + ASPHERE_TERMS + 2 * PROFILE_TERMS;
const GAP: usize = 6;
const BEFORE: usize = 7;
const BEHIND: usize = 8;
const CURVATURE: usize = 9;
const CONIC: usize = 10;
const TERMS: usize = 11;
const GRIN_TERMS_FROM: usize = TERMS + ASPHERE_TERMS;
type GrinCrossingDual = Dual<f64, INPUTS>;

impl<R: Real> PropagatedRay<R> {
    /// Point and direction behind the surface of a ray that no rim clips; one at a limit takes it.
    pub(super) fn cross_at_edge(&self, limit: Option<RayLimit>) -> Option<(Vec3<R>, Vec3<R>)> {
        if self.met.missed || self.lost.is_some_and(|cause| cause != CLIPPED) {
            return None;
        }
        if limit == Some(RayLimit::TotalReflection) {
            let along = self.met.normal * (self.met.a / self.met.m);
            return Some((self.met.point, self.k - along));
        }
        let crossing = self.refract();
        (!crossing.reflected).then_some((crossing.point, crossing.k))
    }

    /// Visits every margin at the surface.
    pub(super) fn margins(&self, i: usize, visit: &mut impl FnMut(usize, RayLimit, R)) {
        if self.met.missed {
            visit(i, RayLimit::Miss, -R::ONE);
            return;
        }
        let finite = |square: R| square.value() < f64::INFINITY;
        let rim = finite(self.surface.rim2).then_some(RayLimit::Rim);
        let side = self.side.filter(|side| finite(*side)).map(|_| RayLimit::Side);
        let inner = (self.surface.obstruction2.value() > 0.0).then_some(RayLimit::Obstruction);
        let mirror = (!self.surface.mirror).then_some(RayLimit::TotalReflection);
        // A ray that only the face itself clips is clipped by that.
        let all = [Some(RayLimit::Miss), rim, side, inner, mirror];
        for hurdle in all.into_iter().flatten() {
            visit(i, hurdle, self.margin(hurdle));
        }
    }

    /// The margin at one hurdle.
    fn margin(&self, hurdle: RayLimit) -> R {
        let met = &self.met;
        match hurdle {
            RayLimit::Miss if met.missed => -R::ONE,
            RayLimit::Miss => met.a * met.a,
            RayLimit::Rim => self.surface.rim_margin(met.point),
            RayLimit::Obstruction => self.surface.obstruction_margin(met.point),
            RayLimit::TotalReflection => met.a * met.a + self.surface.dn2 * met.m,
            RayLimit::Equator => R::ONE,
            RayLimit::Side => self.side.unwrap_or(R::ONE),
        }
    }
}

impl<R: Real> Tracer<R> {
    /// The margin at a surface of a ray that comes to its frame.
    pub(super) fn margin_from(
        &self,
        surface: usize,
        hurdle: RayLimit,
        start: Vec3<R>,
        k: Vec3<R>,
    ) -> R {
        let own = &self.interfaces[surface];
        if !self.touches_grin(surface) {
            return own.margin(hurdle, start, k);
        }
        let p = Vec3::new(start.x, start.y, start.z + own.gap);
        self.propagate(surface, p, k).margin(hurdle)
    }

    /// The surface whose rim a hurdle is.
    pub(super) fn limiting_surface(&self, surface: usize, hurdle: RayLimit) -> Option<usize> {
        match hurdle {
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

impl Tracer<f64> {
    /// The derivatives of a margin by the inputs of one crossing.
    pub(super) fn grin_margin_slopes(
        &self,
        surface: usize,
        hurdle: RayLimit,
        start: Vec3<f64>,
        k: Vec3<f64>,
    ) -> [f64; INPUTS] {
        let own = &self.interfaces[surface];
        let gap = GrinCrossingDual::variable(own.gap, GAP);
        let input = GrinCrossingDual::variable;
        let p = Vec3::new(input(start.x, 0), input(start.y, 1), input(start.z + own.gap, 2));
        let k = Vec3::new(input(k.x, 3), input(k.y, 4), input(k.z, 5));
        let [before, behind] =
            [(own.index_before, BEFORE), (own.index_behind, BEHIND)].map(|(n, i)| input(n, i));
        let lifted = |gap: Option<&GrinGap<f64>>, base: &GrinCrossingDual, first: usize| {
            gap.map(|gap| gap.with_inputs(base, first))
        };
        let front = lifted(self.grin_gap_before(surface), &before, GRIN_TERMS_FROM);
        let own_gap =
            lifted(self.grin_gap_behind(surface), &behind, GRIN_TERMS_FROM + PROFILE_TERMS);
        let own = Interface { gap, ..own.with_inputs(&[before, behind], CURVATURE) };
        // The surface before stands for where the ray came from.
        let entry = surface
            .checked_sub(1)
            .map_or(own, |i| self.interfaces[i].with_inputs(&[before, before], CURVATURE));
        let local = Tracer {
            interfaces: vec![entry.fixed(), own],
            index_before: before,
            grin_gaps: vec![front, own_gap],
            step_plans: Vec::new(),
        };
        local.propagate(1, p, k).margin(hurdle).slope
    }

    /// Takes what the surface and the gaps beside it contribute; the rest is the seed of the ray
    /// behind the surface before, by `k` where that gap has a gradient.
    pub(super) fn grin_margin_seed(
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
        let graded = self.grin_gap_before(surface).is_some();
        let direction = if graded { by_k } else { by_k * own.index_before };
        let by_index = by[BEFORE] + if graded { 0.0 } else { by_k.dot(k) / own.index_before };
        match own.medium_before {
            Some(before) => {
                total.surfaces[before].index += by_index;
                total.surfaces[before].thickness += by[GAP];
                let grades = &by[GRIN_TERMS_FROM..GRIN_TERMS_FROM + PROFILE_TERMS];
                let to = &mut total.surfaces[before].grin_terms;
                to.iter_mut().zip(grades).for_each(|(to, from)| *to += from);
            }
            None => total.index_before += by_index,
        }
        let numbers = &mut total.surfaces[surface];
        numbers.index += by[BEHIND];
        numbers.curvature += by[CURVATURE];
        if matches!(own.form, SurfaceForm::Conic | SurfaceForm::Asphere) {
            numbers.conic += by[CONIC];
        }
        if own.form == SurfaceForm::Asphere {
            numbers
                .terms
                .iter_mut()
                .zip(&by[TERMS..GRIN_TERMS_FROM])
                .for_each(|(to, from)| *to += from);
        }
        let grades = &by[GRIN_TERMS_FROM + PROFILE_TERMS..];
        numbers.grin_terms.iter_mut().zip(grades).for_each(|(to, from)| *to += from);
        AdjointSeed { point: Vec3::new(by[0], by[1], by[2]), direction, opl: 0.0 }
    }
}

impl GrinGap<f64> {
    /// The same gap with its numbers as inputs.
    fn with_inputs(&self, base: &GrinCrossingDual, first: usize) -> GrinGap<GrinCrossingDual> {
        let mut grade = self.field.coefficients.map(GrinCrossingDual::constant);
        grade.used = [crate::lens::RADIAL_TERMS, crate::lens::AXIAL_TERMS];
        for (k, term) in grade.terms.iter_mut().enumerate() {
            *term = GrinCrossingDual::variable(term.value, first + k);
        }
        GrinGap {
            field: RotationalProfile { base: *base, coefficients: grade },
            ops: crate::grin::Integrator::BlanesMoan.ops(),
            step: GrinCrossingDual::constant(self.step),
            max_steps: self.max_steps,
            side2: GrinCrossingDual::constant(self.side2),
        }
    }
}

impl Interface<GrinCrossingDual> {
    /// The same surface with numbers that nothing changes.
    fn fixed(&self) -> Self {
        let fix = |n: GrinCrossingDual| GrinCrossingDual::constant(n.value);
        Self {
            curvature: fix(self.curvature),
            conic: fix(self.conic),
            terms: self.terms.map(fix),
            ..*self
        }
    }
}
