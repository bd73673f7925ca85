//! Derivatives of landings by errors of making, and the derivatives of these by the numbers of a lens.
//!
//! An error of making changes a number of a surface, or moves or turns it. A ray knows a surface only
//! where it meets it: with `λ`, `μ` the derivatives of a landing by the point and by the optical
//! direction of the ray, behind (') and in front, a displacement of the surface by `d` and a turn by
//! `ω` about its vertex change the landing by
//!
//! ```text
//! d·F + ω·(q × F + k' × μ' − k × μ)     F = λ' − λ
//! ```
//!
//! so that the same sweep back that gives the derivatives by curvatures and gaps gives those by poses.
//! A second sweep over numbers that carry the derivative along a direction of errors, another for each
//! ray, differentiates sums of these by every number of the lens (Griewank and Walther, *Evaluating
//! Derivatives*, 2008, chapter 5: reverse over forward); its cost does not depend on the number of
//! errors.

use super::SystemGradient;
use super::error_lanes::{ErrorColumns, HitColumns, LANES, Lane, RayColumns, TracedLanes, Vectors};
use super::sag_crossing::{ErrorReal, HitAdjoint, PerturbedSurface, SurfaceHit, cross, is_quadric};
use crate::lens::ASPHERE_TERMS;
use crate::math::{Dual, Real as _, SimdWidth, Vec3, run_vectorized};
use crate::trace::Tracer;
use crate::trace::batch::{BLOCK, Rays};
use crate::trace::interface::Interface;
use crate::trace::single::optical_direction;

/// A number of a surface, of its place or of the gap behind it, that an error of making changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ErrorNumber {
    /// The curvature.
    Curvature,
    /// The conic constant.
    Conic,
    /// The coefficient of r⁴ in the sag.
    Fourth,
    /// The coefficient of y² in the sag.
    Astigmatism,
    /// The thickness of the gap behind.
    Thickness,
    /// The index behind.
    Index,
    /// The displacement along x.
    DecenterX,
    /// The displacement along y.
    DecenterY,
    /// The turn about the x axis at the vertex.
    TiltX,
    /// The turn about the y axis at the vertex.
    TiltY,
}

impl ErrorNumber {
    /// The number of them.
    pub const COUNT: usize = 10;

    /// All numbers.
    pub const ALL: [Self; Self::COUNT] = [
        Self::Curvature,
        Self::Conic,
        Self::Fourth,
        Self::Astigmatism,
        Self::Thickness,
        Self::Index,
        Self::DecenterX,
        Self::DecenterY,
        Self::TiltX,
        Self::TiltY,
    ];
}

/// A number for each ray, each number of each surface and each axis of the image.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorRows {
    rays: usize,
    surfaces: usize,
    values: Vec<f64>,
}

impl ErrorRows {
    /// Zeros for some rays through a system of this many surfaces, for this many axes.
    pub fn zeros(rays: usize, surfaces: usize, axes: usize) -> Self {
        Self { rays, surfaces, values: vec![0.0; axes * surfaces * ErrorNumber::COUNT * rays] }
    }

    fn start(&self, axis: usize, surface: usize, number: ErrorNumber) -> usize {
        ((axis * self.surfaces + surface) * ErrorNumber::COUNT + number as usize) * self.rays
    }

    /// The numbers of all rays, for x (0) or y (1) at the image.
    pub fn row(&self, axis: usize, surface: usize, number: ErrorNumber) -> &[f64] {
        let start = self.start(axis, surface, number);
        &self.values[start..start + self.rays]
    }

    /// The same, to be changed.
    pub fn row_mut(&mut self, axis: usize, surface: usize, number: ErrorNumber) -> &mut [f64] {
        let start = self.start(axis, surface, number);
        let rays = self.rays;
        &mut self.values[start..start + rays]
    }
}

/// The landings of rays and their derivatives by errors of making.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorSlopes {
    /// The slopes `L/N` and `M/N` of the rays at the image.
    pub slopes: [Vec<f64>; 2],
    /// The derivatives of x and y by each number.
    pub rows: ErrorRows,
}

/// A sum over rays of derivatives along directions of errors, and of slopes.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorDirections {
    /// The directions in which x and y of each ray are differentiated.
    pub rows: ErrorRows,
    /// The factors of these derivatives in the sum.
    pub weights: Vec<f64>,
    /// The factors of the slopes `L/N` and `M/N` in the sum.
    pub slopes: [Vec<f64>; 2],
}

/// A number with its derivative along an error.
type ErrorDual = Dual<f64, 1>;

/// The adjoint of some rays at a surface.
pub(super) struct AdjointColumns<R> {
    pub(super) by: RayColumns<R>,
    pub(super) numbers: [[R; LANES]; ErrorNumber::COUNT],
    by_gap: [R; LANES],
    by_index_before: [R; LANES],
    by_terms: [[R; LANES]; ASPHERE_TERMS],
}

impl<R: ErrorReal> AdjointColumns<R> {
    pub(super) fn zero() -> Self {
        let zero = [R::ZERO; LANES];
        Self {
            by: RayColumns { point: Vectors::zero(), k: Vectors::zero() },
            numbers: [zero; ErrorNumber::COUNT],
            by_gap: zero,
            by_index_before: zero,
            by_terms: [zero; ASPHERE_TERMS],
        }
    }

    /// Passes a surface; the last one only ends rays.
    #[inline(always)]
    pub(super) fn pass(
        &mut self,
        interface: &Interface<f64>,
        errors: &ErrorColumns,
        hits: &HitColumns<R>,
        is_last: bool,
    ) {
        if is_quadric(interface) {
            self.pass_form::<true>(interface, errors, hits, is_last);
        } else {
            self.pass_form::<false>(interface, errors, hits, is_last);
        }
    }

    #[inline(always)]
    fn pass_form<const QUADRIC: bool>(
        &mut self,
        interface: &Interface<f64>,
        errors: &ErrorColumns,
        hits: &HitColumns<R>,
        is_last: bool,
    ) {
        // A copy of which no other code has the address: else the loop is not vectorized.
        let interface = *interface;
        for j in 0..LANES {
            let surface = PerturbedSurface::<R, QUADRIC>::new(&interface, errors.get(j));
            let (hit, behind) = (hits.get(j), (self.by.point.get(j), self.by.k.get(j)));
            let met = if is_last {
                surface.end_adjoint(&hit, behind.0, behind.1)
            } else {
                surface.adjoint(&hit, behind.0, behind.1)
            };
            self.set_numbers(j, &hit, &met, behind);
            if !QUADRIC {
                let terms = surface.by_terms(&hit, &met);
                self.by_terms.iter_mut().zip(terms).for_each(|(column, by)| column[j] = by);
            }
            let (by_point, by_k) = surface.transfer_adjoint(&hit, &met);
            self.by_gap[j] = -by_point.z;
            self.by.point.set(j, by_point);
            self.by.k.set(j, by_k);
        }
    }

    /// Sets the derivatives by the numbers of the surface; those by its pose from the derivatives by
    /// the ray behind and in front.
    #[inline(always)]
    fn set_numbers(
        &mut self,
        j: usize,
        hit: &SurfaceHit<R>,
        met: &HitAdjoint<R>,
        behind: (Vec3<R>, Vec3<R>),
    ) {
        let force = behind.0 - met.by_point;
        let torque =
            cross(hit.point, force) + cross(met.k_behind, behind.1) - cross(hit.k, met.by_k);
        let r2 = hit.point.x * hit.point.x + hit.point.y * hit.point.y;
        let [by_z, by_w] = met.by_sag;
        let mut set = |number: ErrorNumber, by: R| self.numbers[number as usize][j] = by;
        set(ErrorNumber::Curvature, met.by_curvature);
        set(ErrorNumber::Conic, met.by_conic);
        set(ErrorNumber::Fourth, r2 * (by_z * r2 + by_w + by_w));
        set(ErrorNumber::Astigmatism, met.by_astigmatism);
        set(ErrorNumber::Index, met.by_index_behind);
        set(ErrorNumber::DecenterX, force.x);
        set(ErrorNumber::DecenterY, force.y);
        set(ErrorNumber::TiltX, torque.x);
        set(ErrorNumber::TiltY, torque.y);
        self.by_index_before[j] = met.by_index_before;
    }
}

/// Takes some rays to a surface and through it; the last one only ends them.
#[inline(always)]
fn cross_surface<R: ErrorReal>(
    interface: &Interface<f64>,
    errors: &ErrorColumns,
    (rays, hits): (&mut RayColumns<R>, &mut HitColumns<R>),
    distances: &[f64; LANES],
    is_last: bool,
) {
    if is_quadric(interface) {
        cross_form::<R, true>(interface, errors, (rays, hits), distances, is_last);
    } else {
        cross_form::<R, false>(interface, errors, (rays, hits), distances, is_last);
    }
}

#[inline(always)]
fn cross_form<R: ErrorReal, const QUADRIC: bool>(
    interface: &Interface<f64>,
    errors: &ErrorColumns,
    (rays, hits): (&mut RayColumns<R>, &mut HitColumns<R>),
    distances: &[f64; LANES],
    is_last: bool,
) {
    // Copies of which no other code has the address: else the loop is not vectorized.
    let (interface, distances) = (*interface, *distances);
    for (j, distance) in distances.iter().enumerate() {
        let surface = PerturbedSurface::<R, QUADRIC>::new(&interface, errors.get(j));
        let mut hit = surface.meet(rays.point.get(j), rays.k.get(j), *distance);
        if !is_last {
            let (point, k) = surface.refract(&mut hit);
            rays.point.set(j, point);
            rays.k.set(j, k);
        }
        hits.set(j, &hit);
    }
}

impl Tracer<f64> {
    /// True if derivatives by errors of making are known: media are homogeneous, surfaces centred.
    pub fn has_error_slopes(&self) -> bool {
        self.is_plain()
    }

    /// The landings of rays that all arrive, with their derivatives by errors of making; zeros for a
    /// lens without them ([`Tracer::has_error_slopes`]).
    pub fn error_slopes(&self, rays: &Rays<f64>) -> ErrorSlopes {
        let rows = ErrorRows::zeros(rays.len(), self.surfaces(), 2);
        let column = || vec![0.0; rays.len()];
        let mut found = ErrorSlopes { slopes: [column(), column()], rows };
        let mut tape = self.empty_tape();
        self.visit_lanes(
            rays,
            #[inline(always)]
            |traced| self.lane_slopes(traced, &mut tape, &mut found),
        );
        found
    }

    /// The derivative by every number of the system of a sum of derivatives along errors, with rays
    /// and directions held. All rays must arrive.
    pub fn error_direction_gradient(
        &self,
        rays: &Rays<f64>,
        directions: &ErrorDirections,
    ) -> SystemGradient<f64> {
        let mut gradient = SystemGradient::zero(self.surfaces());
        let mut tape = self.empty_tape();
        self.visit_lanes(
            rays,
            #[inline(always)]
            |traced| {
                for axis in 0..2 {
                    self.lane_gradient(traced, &mut tape, (directions, axis), &mut gradient);
                }
            },
        );
        gradient
    }

    /// Visits the rays in groups, each traced to the image.
    pub(super) fn visit_lanes(&self, rays: &Rays<f64>, mut visit: impl FnMut(&TracedLanes)) {
        if !self.has_error_slopes() {
            return;
        }
        run_vectorized(
            SimdWidth::detect(),
            #[inline(always)]
            || {
                let mut distances = vec![[0.0; BLOCK]; self.surfaces()];
                for from in (0..rays.len()).step_by(BLOCK) {
                    let count = BLOCK.min(rays.len() - from);
                    self.forward(rays, from, count, &mut distances);
                    for first in (0..count).step_by(LANES) {
                        let lane = Lane { from: from + first, count: LANES.min(count - first) };
                        visit(&self.traced_lanes(rays, lane, first, &distances));
                    }
                }
            },
        );
    }

    /// The rays of a group, filled up with the first one.
    #[inline(always)]
    fn traced_lanes(
        &self,
        rays: &Rays<f64>,
        lane: Lane,
        first: usize,
        distances: &[[f64; BLOCK]],
    ) -> TracedLanes {
        let mut start = RayColumns { point: Vectors::zero(), k: Vectors::zero() };
        for j in 0..LANES {
            let ray = rays.get(lane.from + if j < lane.count { j } else { 0 });
            start.point.set(j, ray.point);
            start.k.set(j, optical_direction(ray.direction, self.index_before));
        }
        let of = |all: &[f64; BLOCK]| {
            std::array::from_fn(|j| all[first + if j < lane.count { j } else { 0 }])
        };
        TracedLanes { lane, start, distances: distances.iter().map(of).collect() }
    }

    /// Room for rays at each surface, which every group overwrites.
    pub(super) fn empty_tape<R: ErrorReal>(&self) -> Vec<HitColumns<R>> {
        vec![HitColumns::zero(); self.surfaces()]
    }

    /// Takes rays to the image, and stores them at each surface.
    #[inline(always)]
    pub(super) fn record<R: ErrorReal>(
        &self,
        traced: &TracedLanes,
        errors: impl Fn(usize) -> ErrorColumns,
        tape: &mut [HitColumns<R>],
    ) {
        let lift = |v: &Vectors<f64>| Vectors {
            x: v.x.map(R::from_f64),
            y: v.y.map(R::from_f64),
            z: v.z.map(R::from_f64),
        };
        let mut rays = RayColumns { point: lift(&traced.start.point), k: lift(&traced.start.k) };
        for (i, (interface, hits)) in self.interfaces.iter().zip(tape).enumerate() {
            let is_last = i + 1 == self.surfaces();
            let errors = errors(i);
            cross_surface(interface, &errors, (&mut rays, hits), &traced.distances[i], is_last);
        }
    }

    #[inline(always)]
    fn lane_slopes(
        &self,
        traced: &TracedLanes,
        tape: &mut [HitColumns<f64>],
        found: &mut ErrorSlopes,
    ) {
        self.record(traced, |_| ErrorColumns::NONE, tape);
        let Some(image) = tape.last() else { return };
        let Lane { from, count } = traced.lane;
        for j in 0..count {
            let k = image.at.k.get(j);
            found.slopes[0][from + j] = k.x / k.z;
            found.slopes[1][from + j] = k.y / k.z;
        }
        for axis in 0..2 {
            let mut adjoint = AdjointColumns::<f64>::zero();
            let by = &mut adjoint.by.point;
            *(if axis == 0 { &mut by.x } else { &mut by.y }) = [1.0; LANES];
            for (i, interface) in self.interfaces.iter().enumerate().rev() {
                adjoint.pass(interface, &ErrorColumns::NONE, &tape[i], i + 1 == tape.len());
                adjoint.store(&mut found.rows, axis, (i, interface), traced.lane);
            }
        }
    }

    /// Adds the derivative of the sum over a group for one axis; the slopes belong to the first.
    #[inline(always)]
    fn lane_gradient(
        &self,
        traced: &TracedLanes,
        tape: &mut [HitColumns<ErrorDual>],
        (directions, axis): (&ErrorDirections, usize),
        gradient: &mut SystemGradient<f64>,
    ) {
        let surface = |i: usize| (i, &self.interfaces[i]);
        let errors = |i: usize| ErrorColumns::load(&directions.rows, axis, surface(i), traced.lane);
        self.record(traced, errors, tape);
        let Some(image) = tape.last() else { return };
        let mut adjoint = AdjointColumns::<ErrorDual>::zero();
        for j in 0..traced.lane.count {
            let ray = traced.lane.from + j;
            let by = &mut adjoint.by.point;
            let column = if axis == 0 { &mut by.x } else { &mut by.y };
            column[j] = ErrorDual::constant(directions.weights[ray]);
            if axis == 0 {
                let factors = [directions.slopes[0][ray], directions.slopes[1][ray]];
                adjoint.by.k.set(j, slope_seed(image.at.k.get(j), factors));
            }
        }
        for (i, interface) in self.interfaces.iter().enumerate().rev() {
            adjoint.pass(interface, &errors(i), &tape[i], i + 1 == tape.len());
            adjoint.add_to(gradient, (i, interface));
        }
    }
}

/// The derivatives by the optical direction of a sum of slopes `kx/kz` and `ky/kz`: part of the
/// derivative along the error.
#[inline(always)]
fn slope_seed(k: Vec3<ErrorDual>, [u, v]: [f64; 2]) -> Vec3<ErrorDual> {
    let k = k.value();
    let inverse = 1.0 / k.z;
    let by = [u * inverse, v * inverse, -(u * k.x + v * k.y) * inverse * inverse];
    let [x, y, z] = by.map(|by| ErrorDual::ZERO.shifted(by));
    Vec3::new(x, y, z)
}

impl AdjointColumns<f64> {
    /// Stores the derivatives by the numbers of a surface and of the gap and the medium in front.
    #[inline(always)]
    fn store(
        &self,
        rows: &mut ErrorRows,
        axis: usize,
        (i, interface): (usize, &Interface<f64>),
        lane: Lane,
    ) {
        for number in ErrorNumber::ALL {
            let lanes = &self.numbers[number as usize];
            match number {
                ErrorNumber::Index if interface.mirror => {}
                _ => add_lanes(rows.row_mut(axis, i, number), lanes, lane),
            }
        }
        if let Some(before) = i.checked_sub(1) {
            add_lanes(rows.row_mut(axis, before, ErrorNumber::Thickness), &self.by_gap, lane);
        }
        if let Some(medium) = interface.medium_before {
            add_lanes(rows.row_mut(axis, medium, ErrorNumber::Index), &self.by_index_before, lane);
        }
    }
}

/// Adds the numbers of some rays to a row.
#[inline(always)]
pub(super) fn add_lanes(row: &mut [f64], lanes: &[f64; LANES], Lane { from, count }: Lane) {
    row[from..from + count].iter_mut().zip(lanes).for_each(|(to, by)| *to += by);
}

/// The sum of derivatives along an error.
#[inline(always)]
fn sum_along(lanes: &[ErrorDual; LANES]) -> f64 {
    lanes.iter().map(|dual| dual.slope[0]).sum()
}

impl AdjointColumns<ErrorDual> {
    /// Adds the derivatives along the error to those by the numbers of a system.
    #[inline(always)]
    fn add_to(&self, gradient: &mut SystemGradient<f64>, (i, interface): (usize, &Interface<f64>)) {
        let surface = &mut gradient.surfaces[i];
        surface.curvature += sum_along(&self.numbers[ErrorNumber::Curvature as usize]);
        surface.conic += sum_along(&self.numbers[ErrorNumber::Conic as usize]);
        if !is_quadric(interface) {
            surface.terms.iter_mut().zip(&self.by_terms).for_each(|(to, by)| *to += sum_along(by));
        }
        if !interface.mirror {
            surface.index += sum_along(&self.numbers[ErrorNumber::Index as usize]);
        }
        if let Some(before) = i.checked_sub(1) {
            gradient.surfaces[before].thickness += sum_along(&self.by_gap);
        }
        match interface.medium_before {
            Some(medium) => gradient.surfaces[medium].index += sum_along(&self.by_index_before),
            None => gradient.index_before += sum_along(&self.by_index_before),
        }
    }
}
