//! Derivatives by every number of a lens at once, by the adjoint of a block of rays.
//!
//! A block of rays is traced forwards once more, storing one number per surface: the distance `s` to
//! it. Then it is retraced backwards. From the point on a surface and the direction behind it, Snell's
//! law solved for the incident ray gives the direction in front, and `s` the point on the surface
//! before: neither the path of the rays nor a tape is stored. At each surface the adjoint passes
//! through the refraction,
//!
//! ```text
//! k' = k + Γ N   Γ = (a' − a)/m   a = k·N   a'² = a² + (n'² − n²) m   m = N·N
//! ∂Γ/∂a = −Γ/a'   ∂Γ/∂m = ((n'² − n²)/2a' − Γ)/m   ∂Γ/∂(n'² − n²) = 1/2a'
//! ```
//!
//! and the intersection by the implicit function theorem, with `G` the equation of the surface and
//! `∇G = −N`: `a ds = ∂G/∂q dq − N·(dp + s dk)`. The forward formulas are those of
//! [`super::interface`]; the cost does not depend on the number of parameters.

mod block;
mod error_lanes;
mod error_paths;
mod errors;
mod grin;
mod mounted;
mod refraction;
mod sag_crossing;

pub use error_paths::ErrorPaths;
pub use errors::{ErrorDirections, ErrorNumber, ErrorRows, ErrorSlopes};

use super::batch::{BLOCK, CHUNK, Landings, RayBlock, Rays};
use super::interface::Interface;
use super::{SurfaceParameter, Tracer};
use crate::lens::{ASPHERE_TERMS, PROFILE_TERMS};
use crate::math::{Real, SimdWidth, Vec3, run_vectorized};
use block::AdjointBlock;
use rayon::prelude::*;

/// The derivatives of a result by the landing of a ray, with which its adjoint starts.
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
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SurfaceGradient<R> {
    /// By the curvature.
    pub curvature: R,
    /// By the conic constant; zero for a form without one.
    pub conic: R,
    /// By the coefficients of r⁴ to r¹⁶; zero for a form without them.
    pub terms: [R; ASPHERE_TERMS],
    /// By the thickness of the gap behind the surface.
    pub thickness: R,
    /// By the index behind the surface.
    pub index: R,
    /// By the semi-diameter: zero for given rays, but not for the edge of a pupil.
    pub semi_diameter: R,
    /// By the coefficients of the GRIN medium behind the surface; zero without one.
    pub grin_terms: [R; PROFILE_TERMS],
    /// By the numbers of a freeform; those that are missing are zero.
    pub freeform: Vec<R>,
    /// By the numbers of the apertures that are no circles about the vertex, five for each
    /// ([`crate::lens::SurfaceAperture::numbers`]); those that are missing are zero. Zero for given rays,
    /// but not for the edge of a pupil.
    pub apertures: Vec<R>,
}

impl<R: Real> SurfaceGradient<R> {
    /// All numbers, in a fixed order.
    fn numbers(&self) -> impl Iterator<Item = R> {
        let plain = [self.curvature, self.conic, self.thickness, self.index, self.semi_diameter];
        let fixed = plain.into_iter().chain(self.terms).chain(self.grin_terms);
        fixed.chain(self.freeform.iter().copied()).chain(self.apertures.iter().copied())
    }

    /// The derivative by a number of a freeform, mutable.
    pub(super) fn freeform_mut(&mut self, number: usize) -> &mut R {
        self.freeform.resize(self.freeform.len().max(number + 1), R::ZERO);
        &mut self.freeform[number]
    }

    /// The derivative by a number of an aperture, mutable.
    pub(super) fn aperture_mut(&mut self, number: usize) -> &mut R {
        self.apertures.resize(self.apertures.len().max(number + 1), R::ZERO);
        &mut self.apertures[number]
    }
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
    /// Zero, for a system of this many surfaces.
    pub fn zero(surfaces: usize) -> Self {
        Self { index_before: R::ZERO, surfaces: vec![SurfaceGradient::default(); surfaces] }
    }

    /// All numbers, in a fixed order, those of a freeform and of apertures after the others of a surface.
    pub fn numbers(&self) -> impl Iterator<Item = R> {
        let surfaces = self.surfaces.iter().flat_map(SurfaceGradient::numbers);
        std::iter::once(self.index_before).chain(surfaces)
    }

    /// The gradient by these numbers in the order of [`SystemGradient::numbers`], for a system of this
    /// many surfaces without freeforms and apertures; missing numbers are zero.
    pub fn from_numbers(surfaces: usize, numbers: impl IntoIterator<Item = R>) -> Self {
        let mut numbers = numbers.into_iter();
        let mut next = || numbers.next().unwrap_or_default();
        let index_before = next();
        let surface = |_| {
            let [curvature, conic, thickness, index, semi_diameter] = [(); 5].map(|()| next());
            let terms = [(); ASPHERE_TERMS].map(|()| next());
            let grin_terms = [(); PROFILE_TERMS].map(|()| next());
            let (freeform, apertures) = (Vec::new(), Vec::new());
            SurfaceGradient {
                curvature,
                conic,
                terms,
                thickness,
                index,
                semi_diameter,
                grin_terms,
                freeform,
                apertures,
            }
        };
        Self { index_before, surfaces: (0..surfaces).map(surface).collect() }
    }

    /// Adds another gradient, multiplied by `factor`.
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
            for (number, by) in from.freeform.iter().enumerate() {
                *to.freeform_mut(number) += *by * factor;
            }
            for (number, by) in from.apertures.iter().enumerate() {
                *to.aperture_mut(number) += *by * factor;
            }
        }
    }
}

/// The derivatives with which the adjoint of a block of rays starts.
pub(super) trait SeedSource<R> {
    /// The derivatives by the landing of ray `j`.
    fn seed(&self, j: usize) -> AdjointSeed<R>;

    /// The derivatives by the distances of the rays from the limits of a surface; `None` if nothing
    /// depends on these.
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

/// The derivatives by the limit functions of a surface (see [`super::limit`]), a column for each.
#[derive(Debug, Clone)]
pub(super) struct LimitAdjoint<R> {
    pub(super) rim: [R; BLOCK],
    pub(super) angle: [R; BLOCK],
    /// `None` without an obstruction.
    pub(super) obstruction: Option<[R; BLOCK]>,
    /// `None` if the edge of the conic ends no ray.
    pub(super) conic_edge: Option<[R; BLOCK]>,
    /// Those of the sides of apertures that are no circles about the vertex.
    pub(super) apertures: Vec<[R; BLOCK]>,
}

impl<R: Real> LimitAdjoint<R> {
    /// The column of a side of an aperture.
    pub(super) fn side(&mut self, side: u16) -> &mut [R; BLOCK] {
        let side = usize::from(side);
        self.apertures.resize(self.apertures.len().max(side + 1), [R::ZERO; BLOCK]);
        &mut self.apertures[side]
    }
}

/// A receiver of the derivatives of a block of rays.
pub(super) trait GradientSink<R> {
    /// Adds the derivatives of a block by a parameter of a surface, or of object space (the index)
    /// where `surface` is `None`.
    fn add_lanes(
        &mut self,
        surface: Option<usize>,
        parameter: SurfaceParameter,
        lanes: &[R; BLOCK],
    );
}

impl<R: Real> GradientSink<R> for SystemGradient<R> {
    #[inline(always)]
    fn add_lanes(
        &mut self,
        surface: Option<usize>,
        parameter: SurfaceParameter,
        lanes: &[R; BLOCK],
    ) {
        let sum = lane_sum(lanes);
        let Some(surface) = surface else {
            self.index_before += sum;
            return;
        };
        let surface = &mut self.surfaces[surface];
        match parameter {
            SurfaceParameter::Curvature => surface.curvature += sum,
            SurfaceParameter::Conic => surface.conic += sum,
            SurfaceParameter::AsphereTerm(term) => surface.terms[term] += sum,
            SurfaceParameter::Thickness => surface.thickness += sum,
            SurfaceParameter::Index => surface.index += sum,
            SurfaceParameter::SemiDiameter => surface.semi_diameter += sum,
            SurfaceParameter::GrinTerm(k) => surface.grin_terms[k] += sum,
            SurfaceParameter::Freeform(k) => *surface.freeform_mut(k) += sum,
            SurfaceParameter::Aperture(k) => *surface.aperture_mut(k) += sum,
        }
    }
}

/// The sum over a block, in an order that vector instructions preserve.
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

/// The columns of the selected parameters, for object space and then for each surface.
#[derive(Debug)]
struct ColumnPlaces(Vec<Vec<(SurfaceParameter, usize)>>);

impl ColumnPlaces {
    fn new(selected: &[(Option<usize>, SurfaceParameter)], surfaces: usize) -> Self {
        let mut places = vec![Vec::new(); surfaces + 1];
        for (column, (surface, parameter)) in selected.iter().enumerate() {
            places[surface.map_or(0, |surface| surface + 1)].push((*parameter, column));
        }
        Self(places)
    }

    fn find(&self, surface: Option<usize>, parameter: SurfaceParameter) -> Option<usize> {
        let here = &self.0[surface.map_or(0, |surface| surface + 1)];
        here.iter().find(|(selected, _)| *selected == parameter).map(|(_, column)| *column)
    }
}

/// The derivatives of each ray by the selected parameters of the system.
#[derive(Debug)]
struct JacobianColumns<'a, R> {
    places: &'a ColumnPlaces,
    /// A column for each selected parameter.
    columns: &'a mut [[R; BLOCK]],
}

impl<R: Real> GradientSink<R> for JacobianColumns<'_, R> {
    #[inline(always)]
    fn add_lanes(
        &mut self,
        surface: Option<usize>,
        parameter: SurfaceParameter,
        lanes: &[R; BLOCK],
    ) {
        if let Some(place) = self.places.find(surface, parameter) {
            let column = &mut self.columns[place];
            column.iter_mut().zip(lanes).for_each(|(to, from)| *to += *from);
        }
    }
}

impl<R: Real> Tracer<R> {
    /// The derivative of a sum over rays by every number of the system, on the calling thread;
    /// `seed` gives the derivative of the sum by the landing of ray `i`. Lost rays do not contribute.
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

    /// As [`Tracer::gradient`], on all cores; the result has the same bits.
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

    /// The landings of rays, and the derivatives of x and y by the selected parameters of the system:
    /// for each ray first those of x, then those of y; zeros for a lost ray. A surface `None` stands
    /// for object space, which has only an index.
    pub fn jacobian(
        &self,
        rays: &Rays<R>,
        selected: &[(Option<usize>, SurfaceParameter)],
    ) -> (Landings<R>, Vec<R>) {
        let mut landings = Landings::default();
        self.trace_batch(rays, &mut landings);
        (landings, self.landing_slopes(rays, selected))
    }

    /// The derivatives of x and y of the landings alone, as [`Tracer::jacobian`] gives them.
    pub fn landing_slopes(
        &self,
        rays: &Rays<R>,
        selected: &[(Option<usize>, SurfaceParameter)],
    ) -> Vec<R> {
        let x =
            AdjointSeed { point: Vec3::new(R::ONE, R::ZERO, R::ZERO), ..AdjointSeed::default() };
        let y =
            AdjointSeed { point: Vec3::new(R::ZERO, R::ONE, R::ZERO), ..AdjointSeed::default() };
        let seed = |number: usize, _ray: usize| if number == 0 { x } else { y };
        self.slopes_of_rays(rays, selected, 2, seed)
    }

    /// The derivatives of `count` numbers of each ray by the selected parameters: for each ray those
    /// of its first number, then those of the next; zeros for a lost ray. `seed` gives the derivatives
    /// of a number by the landing of a ray.
    pub fn slopes_of_rays(
        &self,
        rays: &Rays<R>,
        selected: &[(Option<usize>, SurfaceParameter)],
        count: usize,
        seed: impl Fn(usize, usize) -> AdjointSeed<R>,
    ) -> Vec<R> {
        let places = ColumnPlaces::new(selected, self.surfaces());
        let row = count * selected.len();
        let mut matrix = vec![R::ZERO; row * rays.len()];
        let mut distances = vec![[R::ZERO; BLOCK]; self.surfaces()];
        let mut columns = vec![[R::ZERO; BLOCK]; row];
        run_vectorized(
            SimdWidth::detect(),
            #[inline(always)]
            || {
                for from in (0..rays.len()).step_by(BLOCK) {
                    let lanes = BLOCK.min(rays.len() - from);
                    let block = self.forward(rays, from, lanes, &mut distances);
                    columns.fill([R::ZERO; BLOCK]);
                    for number in 0..count {
                        let columns = &mut columns[number * selected.len()..][..selected.len()];
                        let mut rows = JacobianColumns { places: &places, columns };
                        let seed = |j: usize| seed(number, from + j);
                        self.backward(block.clone(), &distances, lanes, &seed, &mut rows);
                    }
                    for j in 0..lanes {
                        let to = &mut matrix[(from + j) * row..(from + j + 1) * row];
                        to.iter_mut().zip(&columns).for_each(|(to, column)| *to = column[j]);
                    }
                }
            },
        );
        matrix
    }

    /// Traces a block and stores the distance to each surface.
    #[inline(always)]
    fn forward(
        &self,
        rays: &Rays<R>,
        from: usize,
        count: usize,
        distances: &mut [[R; BLOCK]],
    ) -> RayBlock<R> {
        let mut block: RayBlock<R> = RayBlock::new();
        block.load(rays.slice(from, from + count), 0, count, self.index_before);
        self.mask(&mut block, count);
        for (i, (interface, distance)) in self.interfaces.iter().zip(distances).enumerate() {
            if self.is_general(i) {
                block.cross_general(self, i, |j, arrived| distance[j] = arrived.met.s);
            } else {
                block.cross_recording(interface, i as u32, distance);
                self.clip_at_apertures(&mut block, i);
            }
        }
        block
    }

    /// Retraces a block from the last surface to its start and hands over the derivatives.
    #[inline(always)]
    pub(super) fn backward(
        &self,
        block: RayBlock<R>,
        distances: &[[R; BLOCK]],
        count: usize,
        seeds: &impl SeedSource<R>,
        sink: &mut impl GradientSink<R>,
    ) {
        let mut adjoint = AdjointBlock::new(block);
        self.seed_landing(&mut adjoint, count, seeds, sink);
        for (i, (interface, distance)) in self.interfaces.iter().zip(distances).enumerate().rev() {
            adjoint.s = *distance;
            if self.touches_grin(i) {
                self.backward_grin(&mut adjoint, i, sink);
                continue;
            }
            if let Some(mount) = self.mount(i) {
                self.backward_mounted(&mut adjoint, i, mount, sink);
                continue;
            }
            let limits = seeds.limit_adjoint(i);
            if let (Some(limits), Some(apertures)) = (limits, self.apertures.of(i)) {
                adjoint.aperture_adjoint(apertures, &limits.apertures, i, sink);
            }
            // A factor that is known to be 1 costs nothing.
            if interface.sense > R::ZERO {
                adjoint.retrace_surface(&Interface { sense: R::ONE, ..*interface }, limits);
            } else {
                adjoint.retrace_surface(&Interface { sense: -R::ONE, ..*interface }, limits);
            }
            adjoint.accumulate(interface, i, sink);
            if limits.is_some() {
                let lanes = adjoint.mask_lost(&adjoint.by_semi_diameter);
                sink.add_lanes(Some(i), SurfaceParameter::SemiDiameter, &lanes);
            }
        }
        self.add_launch_index(&adjoint, sink);
    }

    /// The adjoint of the landing; the direction cosines are `k / n'`. In front of a GRIN medium, where
    /// a part of a lens may end but never a lens, the seed is by `k` itself.
    #[inline(always)]
    fn seed_landing(
        &self,
        adjoint: &mut AdjointBlock<R>,
        count: usize,
        seeds: &impl SeedSource<R>,
        sink: &mut impl GradientSink<R>,
    ) {
        let index = self.interfaces.last().map_or(self.index_before, |i| i.index_behind);
        let last = self.interfaces.len().checked_sub(1).and_then(|i| self.grin_gap_behind(i));
        let inverse = if last.is_some() { R::ONE } else { R::ONE / index };
        let mut by_index = [R::ZERO; BLOCK];
        for (j, by_index) in by_index.iter_mut().enumerate().take(count) {
            if adjoint.block.code[j] > R::ZERO {
                continue;
            }
            let seed = seeds.seed(j);
            let (_, k) = adjoint.block.state(j);
            let direction = seed.direction * inverse;
            adjoint.set(j, seed.point, direction);
            adjoint.by_opl[j] = seed.opl;
            if last.is_none() {
                *by_index = -(direction.dot(k) * inverse);
            }
        }
        let behind = self.interfaces.iter().rposition(|interface| !interface.mirror);
        sink.add_lanes(behind, SurfaceParameter::Index, &by_index);
    }

    /// The adjoint of the launch: the first optical direction is the index times the direction.
    #[inline(always)]
    fn add_launch_index(&self, adjoint: &AdjointBlock<R>, sink: &mut impl GradientSink<R>) {
        let inverse = R::ONE / self.index_before;
        let lanes = std::array::from_fn(|j| {
            let (_, k) = adjoint.block.state(j);
            let by_index = adjoint.by_k(j).dot(k) * inverse;
            R::select(adjoint.block.code[j] > R::ZERO, R::ZERO, by_index)
        });
        sink.add_lanes(None, SurfaceParameter::Index, &lanes);
    }
}
