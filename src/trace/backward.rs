//! Derivatives for every number of a lens at once: the ray is retraced backwards.
//!
//! A block of rays is traced forwards once more, keeping one number a surface: the distance `s` to
//! it. Then it goes back. From the point on a surface and the direction behind it, Snell's law
//! read backwards gives the direction in front and `s` the point before: no path is stored, no
//! tape. At each surface the adjoint passes refraction,
//!
//! ```text
//! k' = k + Γ N   Γ = (a' − a)/m   a = k·N   a'² = a² + (n'² − n²) m   m = N·N
//! ∂Γ/∂a = −Γ/a'   ∂Γ/∂m = ((n'² − n²)/2a' − Γ)/m   ∂Γ/∂(n'² − n²) = 1/2a'
//! ```
//!
//! and the intersection by the implicit function theorem, with `G` the equation of the surface and
//! `∇G = −N`: `a ds = ∂G/∂q dq − N·(dp + s dk)`. The forward formulas are those of the interface;
//! the cost does not depend on the number of parameters.

use super::Tracer;
use super::batch::{BLOCK, CHUNK, Landings, RayBlock, Rays};
use super::interface::{Interface, SurfaceForm};
use super::slot::SurfaceParameter;
use crate::lens::{ASPHERE_TERMS, PROFILE_TERMS};
use crate::math::Real;
use crate::math::Vec3;
use crate::math::{SimdWidth, run_vectorized};
use rayon::prelude::*;

/// The derivative of something by where and how a ray lands.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct AdjointSeed<R> {
    /// By the point, in the frame of the last surface.
    pub point: Vec3<R>,
    /// By the direction cosines behind the last surface.
    pub direction: Vec3<R>,
    /// By the optical path.
    pub opl: R,
}

/// Derivatives by the numbers of one surface.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SurfaceGradient<R> {
    /// By the curvature.
    pub curvature: R,
    /// By the conic constant; only where the form of the surface has one.
    pub conic: R,
    /// By the coefficients of r⁴ to r¹⁶; only where the form of the surface has them.
    pub terms: [R; ASPHERE_TERMS],
    /// By the thickness of the gap behind it.
    pub thickness: R,
    /// By the index behind it.
    pub index: R,
    /// By the semi-diameter: zero for rays that are kept, something for the edge of a pupil.
    pub semi_diameter: R,
    /// By the coefficients of the gradient behind it; only where there is one.
    pub grin_terms: [R; PROFILE_TERMS],
}

/// Derivatives by every number of a system.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SystemGradient<R> {
    /// By the index in front of the first surface.
    pub index_before: R,
    /// By the numbers of each surface.
    pub surfaces: Vec<SurfaceGradient<R>>,
}

impl<R: Real> SystemGradient<R> {
    /// Zero for a system of this many surfaces.
    pub fn zero(surfaces: usize) -> Self {
        Self { index_before: R::ZERO, surfaces: vec![SurfaceGradient::default(); surfaces] }
    }

    /// All numbers, in a fixed order.
    pub fn numbers(&self) -> impl Iterator<Item = R> {
        let of = |s: &SurfaceGradient<R>| {
            let SurfaceGradient { curvature, conic, terms, thickness, index, .. } = *s;
            let plain = [curvature, conic, thickness, index, s.semi_diameter];
            plain.into_iter().chain(terms).chain(s.grin_terms)
        };
        std::iter::once(self.index_before).chain(self.surfaces.iter().flat_map(of))
    }

    /// The gradient of as many surfaces with these numbers, in that order; zero where there are
    /// not enough of them.
    pub fn from_numbers(surfaces: usize, numbers: impl IntoIterator<Item = R>) -> Self {
        let mut numbers = numbers.into_iter();
        let mut next = || numbers.next().unwrap_or_default();
        let index_before = next();
        let surface = |_| {
            let [curvature, conic, thickness, index, semi_diameter] = [(); 5].map(|()| next());
            let terms = [(); ASPHERE_TERMS].map(|()| next());
            let grade = [(); PROFILE_TERMS].map(|()| next());
            SurfaceGradient {
                curvature,
                conic,
                terms,
                thickness,
                index,
                semi_diameter,
                grin_terms: grade,
            }
        };
        Self { index_before, surfaces: (0..surfaces).map(surface).collect() }
    }

    /// Adds another one, `factor` times.
    pub fn add(&mut self, other: &Self, factor: R) {
        self.index_before += other.index_before * factor;
        for (to, from) in self.surfaces.iter_mut().zip(&other.surfaces) {
            to.curvature += from.curvature * factor;
            to.conic += from.conic * factor;
            to.thickness += from.thickness * factor;
            to.index += from.index * factor;
            to.semi_diameter += from.semi_diameter * factor;
            to.terms.iter_mut().zip(from.terms).for_each(|(t, f)| *t += f * factor);
            to.grin_terms.iter_mut().zip(from.grin_terms).for_each(|(t, f)| *t += f * factor);
        }
    }
}

/// The derivatives of something that the adjoint of a block of rays begins with.
pub(super) trait SeedSource<R> {
    /// By the landing of ray `j`.
    fn seed(&self, j: usize) -> AdjointSeed<R>;

    /// By how far each ray is from the limits of a surface, if anything depends on that.
    #[inline(always)]
    fn limit_adjoint(&self, _surface: usize) -> Option<&LimitAdjoint<R>> {
        None
    }
}

impl<R, F: Fn(usize) -> AdjointSeed<R>> SeedSource<R> for F {
    #[inline(always)]
    fn seed(&self, j: usize) -> AdjointSeed<R> {
        self(j)
    }
}

/// The derivatives of something by the limits of a surface (see [`super::limit`]): a column for each
/// limit.
#[derive(Debug, Clone)]
pub(super) struct LimitAdjoint<R> {
    pub(super) rim: [R; BLOCK],
    pub(super) angle: [R; BLOCK],
    /// Only where there is one.
    pub(super) obstruction: Option<[R; BLOCK]>,
    /// Only where a sheet can end anything.
    pub(super) conic_edge: Option<[R; BLOCK]>,
}

/// Who takes the derivatives of a block of rays as they come.
pub(super) trait GradientSink<R> {
    /// The derivatives of a block by a number of a surface, to be added to what came before.
    /// `surface` is `None` for the index in front of the first surface.
    fn add_lanes(&mut self, surface: Option<usize>, slot: SurfaceParameter, lanes: &[R; BLOCK]);
}

impl<R: Real> GradientSink<R> for SystemGradient<R> {
    #[inline(always)]
    fn add_lanes(&mut self, surface: Option<usize>, slot: SurfaceParameter, lanes: &[R; BLOCK]) {
        let sum = lane_sum(lanes);
        let Some(surface) = surface else {
            self.index_before += sum;
            return;
        };
        let surface = &mut self.surfaces[surface];
        match slot {
            SurfaceParameter::Curvature => surface.curvature += sum,
            SurfaceParameter::Conic => surface.conic += sum,
            SurfaceParameter::AsphereTerm(term) => surface.terms[term] += sum,
            SurfaceParameter::Thickness => surface.thickness += sum,
            SurfaceParameter::Index => surface.index += sum,
            SurfaceParameter::SemiDiameter => surface.semi_diameter += sum,
            SurfaceParameter::GrinTerm(k) => surface.grin_terms[k] += sum,
        }
    }
}

/// The sum over a block in an order that lanes can keep.
#[inline(always)]
fn lane_sum<R: Real>(lanes: &[R; BLOCK]) -> R {
    let mut parts = [R::ZERO; 8];
    for eight in lanes.chunks_exact(8) {
        for (part, lane) in parts.iter_mut().zip(eight) {
            *part += *lane;
        }
    }
    let [a, b, c, d, e, f, g, h] = parts;
    ((a + b) + (c + d)) + ((e + f) + (g + h))
}

/// The derivative of each ray by some numbers of the system.
#[derive(Debug)]
struct JacobianColumns<'a, R> {
    wanted: &'a [(Option<usize>, SurfaceParameter)],
    /// A column for each wanted number.
    columns: &'a mut [[R; BLOCK]],
}

impl<R: Real> GradientSink<R> for JacobianColumns<'_, R> {
    #[inline(always)]
    fn add_lanes(&mut self, surface: Option<usize>, slot: SurfaceParameter, lanes: &[R; BLOCK]) {
        let asked = self.wanted.iter().position(|w| *w == (surface, slot));
        if let Some(column) = asked.map(|i| &mut self.columns[i]) {
            column.iter_mut().zip(lanes).for_each(|(to, from)| *to += *from);
        }
    }
}

impl<R: Real> Tracer<R> {
    /// The derivative of a sum over rays by every number of the system, on the calling thread;
    /// `seed` gives the derivative of the sum by the landing of ray `i`. Rays that are lost count
    /// nothing.
    pub fn gradient(
        &self,
        rays: &Rays<R>,
        seed: impl Fn(usize) -> AdjointSeed<R> + Sync,
    ) -> SystemGradient<R> {
        let mut total = SystemGradient::zero(self.surfaces());
        for from in (0..rays.len()).step_by(CHUNK) {
            total.add(&self.chunk_gradient(rays, from, &seed), R::ONE);
        }
        total
    }

    /// The same on all cores, to the same bits.
    pub fn gradient_parallel(
        &self,
        rays: &Rays<R>,
        seed: impl Fn(usize) -> AdjointSeed<R> + Sync,
    ) -> SystemGradient<R> {
        let starts: Vec<usize> = (0..rays.len()).step_by(CHUNK).collect();
        let parts: Vec<_> =
            starts.par_iter().map(|from| self.chunk_gradient(rays, *from, &seed)).collect();
        let mut total = SystemGradient::zero(self.surfaces());
        parts.iter().for_each(|part| total.add(part, R::ONE));
        total
    }

    fn chunk_gradient(
        &self,
        rays: &Rays<R>,
        start: usize,
        seed: &(impl Fn(usize) -> AdjointSeed<R> + Sync),
    ) -> SystemGradient<R> {
        let mut gradient = SystemGradient::zero(self.surfaces());
        let mut distances = vec![[R::ZERO; BLOCK]; self.surfaces()];
        let end = rays.len().min(start + CHUNK);
        run_vectorized(
            SimdWidth::detect(),
            #[inline(always)]
            || {
                for from in (start..end).step_by(BLOCK) {
                    let count = BLOCK.min(end - from);
                    let block = self.forward(rays, from, count, &mut distances);
                    let seed = |j| seed(from + j);
                    self.backward(block, &distances, count, &seed, &mut gradient);
                }
            },
        );
        gradient
    }

    /// Where rays land and the derivatives of their points across the axis by some numbers of the
    /// system: for each ray `2 wanted` numbers, first those of x, then those of y; zeros for a ray
    /// that is lost. `surface` is `None` for the index in front of the first one.
    pub fn jacobian(
        &self,
        rays: &Rays<R>,
        wanted: &[(Option<usize>, SurfaceParameter)],
    ) -> (Landings<R>, Vec<R>) {
        let mut hits = Landings::default();
        self.trace_batch(rays, &mut hits);
        let row = 2 * wanted.len();
        let mut matrix = vec![R::ZERO; row * rays.len()];
        let mut distances = vec![[R::ZERO; BLOCK]; self.surfaces()];
        let mut columns = vec![[R::ZERO; BLOCK]; row];
        let x =
            AdjointSeed { point: Vec3::new(R::ONE, R::ZERO, R::ZERO), ..AdjointSeed::default() };
        let y =
            AdjointSeed { point: Vec3::new(R::ZERO, R::ONE, R::ZERO), ..AdjointSeed::default() };
        run_vectorized(
            SimdWidth::detect(),
            #[inline(always)]
            || {
                for from in (0..rays.len()).step_by(BLOCK) {
                    let count = BLOCK.min(rays.len() - from);
                    let block = self.forward(rays, from, count, &mut distances);
                    columns.fill([R::ZERO; BLOCK]);
                    let (of_x, of_y) = columns.split_at_mut(wanted.len());
                    let mut rows = JacobianColumns { wanted, columns: of_x };
                    self.backward(block.clone(), &distances, count, &|_| x, &mut rows);
                    let mut rows = JacobianColumns { wanted, columns: of_y };
                    self.backward(block, &distances, count, &|_| y, &mut rows);
                    for j in 0..count {
                        let to = &mut matrix[(from + j) * row..(from + j + 1) * row];
                        to.iter_mut().zip(&columns).for_each(|(to, column)| *to = column[j]);
                    }
                }
            },
        );
        (hits, matrix)
    }

    /// Traces a block and keeps the distance to each surface.
    #[inline(always)]
    fn forward(
        &self,
        rays: &Rays<R>,
        from: usize,
        count: usize,
        distances: &mut [[R; BLOCK]],
    ) -> RayBlock<R> {
        let mut block = RayBlock::new();
        block.load(rays.slice(from, from + count), 0, count, self.index_before);
        self.mask(&mut block, count);
        for (i, (interface, distance)) in self.interfaces.iter().zip(distances).enumerate() {
            if self.touches_grin(i) {
                block.cross_grin(self, i, |j, arrival| distance[j] = arrival.met.s);
            } else {
                block.cross_recording(interface, i as u32, distance);
            }
        }
        block
    }

    /// Retraces a block from the last surface to its start and passes on the derivatives.
    #[inline(always)]
    pub(super) fn backward(
        &self,
        block: RayBlock<R>,
        distances: &[[R; BLOCK]],
        count: usize,
        sowing: &impl SeedSource<R>,
        harvest: &mut impl GradientSink<R>,
    ) {
        let mut way = AdjointBlock::new(block);
        self.seed_landing(&mut way, count, sowing, harvest);
        for (i, (interface, distance)) in self.interfaces.iter().zip(distances).enumerate().rev() {
            way.s = *distance;
            if self.touches_grin(i) {
                self.backward_grin(&mut way, i, harvest);
                continue;
            }
            let pulls = sowing.limit_adjoint(i);
            // A factor that is known to be one costs nothing.
            if interface.sense > R::ZERO {
                way.retrace_surface(&Interface { sense: R::ONE, ..*interface }, pulls);
            } else {
                way.retrace_surface(&Interface { sense: -R::ONE, ..*interface }, pulls);
            }
            way.accumulate(interface, i, harvest);
            if pulls.is_some() {
                let lanes = way.mask_lost(&way.by_semi_diameter);
                harvest.add_lanes(Some(i), SurfaceParameter::SemiDiameter, &lanes);
            }
        }
        self.add_launch_index(&way, harvest);
    }

    /// The adjoint of the landing; the direction cosines are `k / n'`. In front of a gap with a
    /// gradient, where a lens never ends but a part of one may, the seed is by `k` itself.
    #[inline(always)]
    fn seed_landing(
        &self,
        way: &mut AdjointBlock<R>,
        count: usize,
        sowing: &impl SeedSource<R>,
        harvest: &mut impl GradientSink<R>,
    ) {
        let index = self.interfaces.last().map_or(self.index_before, |i| i.index_behind);
        let last = self.interfaces.len().checked_sub(1).and_then(|i| self.grin_gap_behind(i));
        let inverse = if last.is_some() { R::ONE } else { R::ONE / index };
        let mut by_index = [R::ZERO; BLOCK];
        for (j, by_index) in by_index.iter_mut().enumerate().take(count) {
            if way.block.code[j] > R::ZERO {
                continue;
            }
            let seed = sowing.seed(j);
            let (_, k) = way.block.state(j);
            let direction = seed.direction * inverse;
            way.set(j, seed.point, direction);
            way.by_opl[j] = seed.opl;
            if last.is_none() {
                *by_index = -(direction.dot(k) * inverse);
            }
        }
        let behind = self.interfaces.iter().rposition(|interface| !interface.mirror);
        harvest.add_lanes(behind, SurfaceParameter::Index, &by_index);
    }

    /// The first optical direction is the index times the direction.
    #[inline(always)]
    fn add_launch_index(&self, way: &AdjointBlock<R>, harvest: &mut impl GradientSink<R>) {
        let inverse = R::ONE / self.index_before;
        let lanes = std::array::from_fn(|j| {
            let (_, k) = way.block.state(j);
            let by_index = way.by_k(j).dot(k) * inverse;
            R::select(way.block.code[j] > R::ZERO, R::ZERO, by_index)
        });
        harvest.add_lanes(None, SurfaceParameter::Index, &lanes);
    }
}

/// A block of rays on its way back: where it is, the derivatives by its state, and those by the
/// numbers of the surface it has just passed. One value, so that the compiler sees that no column
/// overlaps another.
pub(super) struct AdjointBlock<R> {
    pub(super) block: RayBlock<R>,
    /// The distance to the surface.
    pub(super) s: [R; BLOCK],
    pub(super) by_x: [R; BLOCK],
    pub(super) by_y: [R; BLOCK],
    pub(super) by_z: [R; BLOCK],
    pub(super) by_kx: [R; BLOCK],
    pub(super) by_ky: [R; BLOCK],
    pub(super) by_kz: [R; BLOCK],
    pub(super) by_opl: [R; BLOCK],
    pub(super) by_curvature: [R; BLOCK],
    pub(super) by_conic: [R; BLOCK],
    pub(super) by_gap: [R; BLOCK],
    pub(super) by_semi_diameter: [R; BLOCK],
    pub(super) by_index_before: [R; BLOCK],
    pub(super) by_index_behind: [R; BLOCK],
    pub(super) by_terms: [[R; BLOCK]; ASPHERE_TERMS],
}

/// The normal of a surface and everything about it that the adjoint needs.
#[derive(Clone, Copy)]
pub(super) struct SurfaceNormal<R> {
    pub(super) vector: Vec3<R>,
    /// `N·N`.
    pub(super) m: R,
    /// Whether `m` is one wherever a ray meets the surface.
    pub(super) unit: bool,
}

#[inline(always)]
fn sphere_normal<R: Real>(surface: &Interface<R>, p: Vec3<R>) -> SurfaceNormal<R> {
    let c = surface.curvature;
    let vector = Vec3::new(-(c * p.x), -(c * p.y), R::ONE - c * p.z);
    SurfaceNormal { vector, m: R::ONE, unit: true }
}

#[inline(always)]
fn conic_normal<R: Real>(surface: &Interface<R>, p: Vec3<R>) -> SurfaceNormal<R> {
    let c = surface.curvature;
    let vector = Vec3::new(-(c * p.x), -(c * p.y), R::ONE - c * (p.z + surface.conic * p.z));
    SurfaceNormal { vector, m: vector.dot(vector), unit: false }
}

impl<R: Real> Interface<R> {
    /// The adjoint of the limit of the angle, and what is left of it for the square of the index in
    /// front, all else of the index apart.
    #[inline(always)]
    fn angle_limit_adjoint(
        &self,
        pull: R,
        normal: SurfaceNormal<R>,
        back: RefractionAdjoint<R>,
    ) -> (RefractionAdjoint<R>, R) {
        let share = pull / self.n2;
        let loss = self.index_drop2();
        let by_a = -((back.a + back.a) * share);
        let mut by_normal = back.by_normal + back.k * by_a;
        if !normal.unit {
            by_normal = by_normal + normal.vector * (loss * share * R::TWO);
        }
        let by_k = back.by_k + normal.vector * by_a;
        let by_behind2 = R::select(loss > R::ZERO, -(share * normal.m), R::ZERO);
        let by_dn2 = back.by_dn2 + by_behind2;
        let by_n2 = (back.a * back.a - loss * normal.m) * share / self.n2;
        (RefractionAdjoint { by_k, by_normal, by_dn2, ..back }, by_n2)
    }
}

/// What refraction read backwards gives.
#[derive(Clone, Copy)]
pub(super) struct RefractionAdjoint<R> {
    /// The direction in front.
    pub(super) k: Vec3<R>,
    /// `k·N`.
    pub(super) a: R,
    pub(super) by_k: Vec3<R>,
    pub(super) by_normal: Vec3<R>,
    pub(super) by_dn2: R,
}

#[inline(always)]
pub(super) fn unrefract<R: Real>(
    surface: &Interface<R>,
    normal: SurfaceNormal<R>,
    behind: Vec3<R>,
    by_behind: Vec3<R>,
) -> RefractionAdjoint<R> {
    let SurfaceNormal { vector, m, unit } = normal;
    let a_behind = behind.dot(vector);
    let by_gamma = by_behind.dot(vector);
    let inverse_m = if unit { R::ONE } else { R::ONE / m };
    let (a, gamma, by_a, by_m, by_dn2);
    if surface.mirror {
        a = -a_behind;
        gamma = -((a + a) * inverse_m);
        by_a = -((by_gamma + by_gamma) * inverse_m);
        by_m = -(gamma * by_gamma * inverse_m);
        by_dn2 = R::ZERO;
    } else {
        a = surface.sense * (a_behind * a_behind - surface.dn2 * m).sqrt();
        gamma = (a_behind - a) * inverse_m;
        let scaled = by_gamma / a_behind;
        by_a = -(scaled * gamma);
        by_dn2 = scaled * R::from_f64(0.5);
        by_m = (by_dn2 * surface.dn2 - by_gamma * gamma) * inverse_m;
    }
    let k = behind - vector * gamma;
    let mut by_normal = by_behind * gamma + k * by_a;
    if !unit {
        by_normal = by_normal + vector * (by_m + by_m);
    }
    RefractionAdjoint { k, a, by_k: by_behind + vector * by_a, by_normal, by_dn2 }
}

impl<R: Real> AdjointBlock<R> {
    #[inline(always)]
    fn new(block: RayBlock<R>) -> Self {
        let zero = [R::ZERO; BLOCK];
        Self {
            block,
            s: zero,
            by_x: zero,
            by_y: zero,
            by_z: zero,
            by_kx: zero,
            by_ky: zero,
            by_kz: zero,
            by_opl: zero,
            by_curvature: zero,
            by_conic: zero,
            by_gap: zero,
            by_semi_diameter: zero,
            by_index_before: zero,
            by_index_behind: zero,
            by_terms: [zero; ASPHERE_TERMS],
        }
    }

    #[inline(always)]
    pub(super) fn by_point(&self, j: usize) -> Vec3<R> {
        Vec3::new(self.by_x[j], self.by_y[j], self.by_z[j])
    }

    #[inline(always)]
    pub(super) fn by_k(&self, j: usize) -> Vec3<R> {
        Vec3::new(self.by_kx[j], self.by_ky[j], self.by_kz[j])
    }

    #[inline(always)]
    pub(super) fn set(&mut self, j: usize, by_point: Vec3<R>, by_k: Vec3<R>) {
        (self.by_x[j], self.by_y[j], self.by_z[j]) = (by_point.x, by_point.y, by_point.z);
        (self.by_kx[j], self.by_ky[j], self.by_kz[j]) = (by_k.x, by_k.y, by_k.z);
    }

    /// Goes back through a surface to the one before.
    #[inline(always)]
    fn retrace_surface(&mut self, surface: &Interface<R>, pulls: Option<&LimitAdjoint<R>>) {
        let sheet = pulls.and_then(|pulls| {
            self.rim_adjoint(surface, &pulls.rim);
            if let Some(pull) = &pulls.obstruction {
                self.radius_adjoint(pull, -(R::ONE / surface.obstruction2));
            }
            pulls.conic_edge.as_ref().map(|sheet| self.conic_edge_adjoint(surface, sheet))
        });
        let angle = pulls.map(|pulls| &pulls.angle);
        match surface.form {
            SurfaceForm::Plane | SurfaceForm::Sphere => self.retrace(surface, sphere_normal, angle),
            SurfaceForm::Conic => self.retrace(surface, conic_normal, angle),
            SurfaceForm::Asphere => self.retrace_asphere(surface, angle),
        }
        if let Some([by_curvature, by_conic]) = sheet {
            for j in 0..BLOCK {
                self.by_curvature[j] += by_curvature[j];
                self.by_conic[j] += by_conic[j];
            }
        }
    }

    /// The adjoint of the rim.
    #[inline(always)]
    fn rim_adjoint(&mut self, surface: &Interface<R>, pull: &[R; BLOCK]) {
        let (inverse, radius) = (R::ONE / surface.rim2, surface.rim2.sqrt());
        self.radius_adjoint(pull, inverse);
        for (j, pull) in pull.iter().enumerate() {
            let (p, _) = self.block.state(j);
            self.by_semi_diameter[j] = -(*pull * inverse * (p.x * p.x + p.y * p.y) / radius);
        }
    }

    /// The adjoint of half the square of the distance from the axis, `factor` times.
    #[inline(always)]
    fn radius_adjoint(&mut self, pull: &[R; BLOCK], factor: R) {
        for (j, pull) in pull.iter().enumerate() {
            let (p, _) = self.block.state(j);
            let share = *pull * factor;
            self.by_x[j] += p.x * share;
            self.by_y[j] += p.y * share;
        }
    }

    /// The adjoint of the edge of a conic; what it leaves for the curvature and the conic constant.
    #[inline(always)]
    fn conic_edge_adjoint(&mut self, surface: &Interface<R>, pull: &[R; BLOCK]) -> [[R; BLOCK]; 2] {
        let (c, k1) = (surface.curvature, R::ONE + surface.conic);
        let mut left = [[R::ZERO; BLOCK]; 2];
        for (j, pull) in pull.iter().enumerate() {
            let (p, _) = self.block.state(j);
            if surface.form == SurfaceForm::Asphere {
                let (r2, pull) = (p.x * p.x + p.y * p.y, c * *pull);
                let outward = k1 * c * pull * R::TWO;
                self.by_x[j] += p.x * outward;
                self.by_y[j] += p.y * outward;
                (left[0][j], left[1][j]) = (k1 * r2 * pull * R::TWO, c * r2 * pull);
            } else {
                let along = p.z * *pull;
                self.by_z[j] += k1 * c * *pull;
                (left[0][j], left[1][j]) = (k1 * along, c * along);
            }
        }
        left
    }

    /// Goes back through a conic (a plane, a sphere) to the surface before.
    #[inline(always)]
    fn retrace(
        &mut self,
        surface: &Interface<R>,
        normal: impl Fn(&Interface<R>, Vec3<R>) -> SurfaceNormal<R>,
        angle: Option<&[R; BLOCK]>,
    ) {
        let surface = *surface;
        let (c, k1) = (surface.curvature, R::ONE + surface.conic);
        let half = R::from_f64(0.5);
        for j in 0..BLOCK {
            let (p, behind) = self.block.state(j);
            let normal = normal(&surface, p);
            let mut back = unrefract(&surface, normal, behind, self.by_k(j));
            let mut by_n2 = R::ZERO;
            if let Some(angle) = angle {
                (back, by_n2) = surface.angle_limit_adjoint(angle[j], normal, back);
            }
            let n = back.by_normal;
            let by_point = self.by_point(j) - Vec3::new(n.x * c, n.y * c, n.z * (k1 * c));
            let lambda = (by_point.dot(back.k) + self.by_opl[j] * surface.n2) / back.a;
            let bulge = p.x * p.x + p.y * p.y + k1 * p.z * p.z;
            self.by_curvature[j] = lambda * bulge * half - (p.x * n.x + p.y * n.y + k1 * p.z * n.z);
            if !normal.unit {
                self.by_conic[j] = c * p.z * (lambda * p.z * half - n.z);
            }
            self.transfer_back(&surface, j, p, &back, by_point - normal.vector * lambda);
            if angle.is_some() {
                self.by_index_before[j] += by_n2 * surface.index_before * R::TWO;
            }
        }
    }

    /// Goes back through an asphere to the surface before.
    #[inline(always)]
    fn retrace_asphere(&mut self, surface: &Interface<R>, angle: Option<&[R; BLOCK]>) {
        let surface = *surface;
        for j in 0..BLOCK {
            let (p, behind) = self.block.state(j);
            let sag = SagDerivatives::new(&surface, p.x * p.x + p.y * p.y);
            let slope = -(sag.slope + sag.slope);
            let vector = Vec3::new(p.x * slope, p.y * slope, R::ONE);
            let normal = SurfaceNormal { vector, m: vector.dot(vector), unit: false };
            let mut back = unrefract(&surface, normal, behind, self.by_k(j));
            let mut by_n2 = R::ZERO;
            if let Some(angle) = angle {
                (back, by_n2) = surface.angle_limit_adjoint(angle[j], normal, back);
            }
            // N = (−2 x w, −2 y w, 1) with w = dz/dr².
            let n = back.by_normal;
            let by_slope = -(p.x * n.x + p.y * n.y) * R::TWO;
            let radial = by_slope * sag.second * R::TWO;
            let by_point = self.by_point(j)
                + Vec3::new(p.x * radial + n.x * slope, p.y * radial + n.y * slope, R::ZERO);
            let lambda = (by_point.dot(back.k) + self.by_opl[j] * surface.n2) / back.a;
            (self.by_curvature[j], self.by_conic[j]) = sag.by_conic(lambda, by_slope);
            let terms = sag.by_terms(lambda, by_slope);
            self.by_terms.iter_mut().zip(terms).for_each(|(column, by_term)| column[j] = by_term);
            self.transfer_back(&surface, j, p, &back, by_point - vector * lambda);
            if angle.is_some() {
                self.by_index_before[j] += by_n2 * surface.index_before * R::TWO;
            }
        }
    }

    /// From the surface to the one before: the adjoint of the way between and of the gap.
    #[inline(always)]
    pub(super) fn transfer_back(
        &mut self,
        surface: &Interface<R>,
        j: usize,
        p: Vec3<R>,
        back: &RefractionAdjoint<R>,
        by_start: Vec3<R>,
    ) {
        let s = self.s[j];
        let start = p - back.k * s;
        self.by_gap[j] = -by_start.z;
        // dn2 = n'² − n², and the optical path is s n².
        self.by_index_behind[j] = back.by_dn2 * surface.index_behind * R::TWO;
        let path = self.by_opl[j] * s;
        self.by_index_before[j] = (path - back.by_dn2) * surface.index_before * R::TWO;
        self.set(j, by_start, back.by_k + by_start * s);
        self.block.set(j, Vec3::new(start.x, start.y, start.z + surface.gap), back.k);
    }

    /// A lost ray counts nothing, whatever its numbers have become.
    #[inline(always)]
    pub(super) fn mask_lost(&self, lanes: &[R; BLOCK]) -> [R; BLOCK] {
        std::array::from_fn(|j| R::select(self.block.code[j] > R::ZERO, R::ZERO, lanes[j]))
    }

    /// Hands over the derivatives by the numbers of a surface.
    #[inline(always)]
    pub(super) fn accumulate(
        &self,
        surface: &Interface<R>,
        i: usize,
        harvest: &mut impl GradientSink<R>,
    ) {
        let arrived = |lanes: &[R; BLOCK]| self.mask_lost(lanes);
        harvest.add_lanes(Some(i), SurfaceParameter::Curvature, &arrived(&self.by_curvature));
        if matches!(surface.form, SurfaceForm::Conic | SurfaceForm::Asphere) {
            harvest.add_lanes(Some(i), SurfaceParameter::Conic, &arrived(&self.by_conic));
        }
        if surface.form == SurfaceForm::Asphere {
            for (term, lanes) in self.by_terms.iter().enumerate() {
                harvest.add_lanes(Some(i), SurfaceParameter::AsphereTerm(term), &arrived(lanes));
            }
        }
        if let Some(before) = i.checked_sub(1) {
            harvest.add_lanes(Some(before), SurfaceParameter::Thickness, &arrived(&self.by_gap));
        }
        harvest.add_lanes(
            surface.medium_before,
            SurfaceParameter::Index,
            &arrived(&self.by_index_before),
        );
        let behind = if surface.mirror { surface.medium_before } else { Some(i) };
        harvest.add_lanes(behind, SurfaceParameter::Index, &arrived(&self.by_index_behind));
    }
}

/// An asphere at a distance from the axis: `w = dz/dr²` and every derivative of z and w.
pub(super) struct SagDerivatives<R> {
    r2: R,
    curvature: R,
    /// `√(1 − (1+κ) c² r²)`.
    root: R,
    /// `w`.
    pub(super) slope: R,
    /// `dw/dr²`.
    pub(super) second: R,
}

impl<R: Real> SagDerivatives<R> {
    #[inline(always)]
    pub(super) fn new(surface: &Interface<R>, r2: R) -> Self {
        let c = surface.curvature;
        let square = (R::ONE + surface.conic) * c * c;
        let root = (R::ONE - square * r2).sqrt();
        let (mut slope, mut bend) = (R::ZERO, R::ZERO);
        for (j, a) in surface.terms.into_iter().enumerate().rev() {
            let degree = R::from_f64(j as f64 + 2.0);
            bend = bend * r2 + a * degree * (degree - R::ONE);
            slope = slope * r2 + a * degree;
        }
        Self {
            r2,
            curvature: c,
            root,
            slope: c / (root + root) + slope * r2,
            second: c * square / (R::from_f64(4.0) * root * root * root) + bend,
        }
    }

    /// Derivatives by curvature and conic constant, from those by z and by w.
    #[inline(always)]
    pub(super) fn by_conic(&self, by_z: R, by_w: R) -> (R, R) {
        let (c, q, r2) = (self.curvature, self.root, self.r2);
        let (one_q, cube) = (R::ONE + q, q * q * q);
        let by_curvature = by_z * r2 / (q * one_q) + by_w / (cube + cube);
        let c3 = c * c * c * r2;
        let by_conic =
            by_z * c3 * r2 / (R::TWO * q * one_q * one_q) + by_w * c3 / (R::from_f64(4.0) * cube);
        (by_curvature, by_conic)
    }

    /// Derivatives by the coefficients, from those by z and by w.
    #[inline(always)]
    pub(super) fn by_terms(&self, by_z: R, by_w: R) -> [R; ASPHERE_TERMS] {
        let mut power = self.r2;
        std::array::from_fn(|term| {
            let by_term = power * (by_z * self.r2 + by_w * R::from_f64(term as f64 + 2.0));
            power = power * self.r2;
            by_term
        })
    }
}
