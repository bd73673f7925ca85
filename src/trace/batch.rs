//! Tracing many rays at once, in blocks, with the widest vector instructions of the processor.
//!
//! A block of rays stays in the first-level cache through all surfaces. The loop over a block has no
//! branch on a ray, so that the compiler turns it into vector instructions; it is compiled for each
//! width, and the widest that the processor has is selected at run time. Nothing is contracted or
//! reordered, so that every width, every number of threads and the single ray give the same bits.
//! GRIN media are the exception: there every ray takes steps of its own.

use super::aperture::ApertureSet;
use super::asphere;
use super::asphere_crossing;
use super::fate::{self, CLIPPED, Fate, MISSED, TOTAL_REFLECTION};
use super::interface::{Interface, Intersection, Refraction, SurfaceForm};
use super::mount::{Mount, irregular_crossings};
use super::propagation::PropagatedRay;
use super::single::{Ray, optical_direction};
use super::{Fates, Tracer};
use crate::math::Real;
use crate::math::Vec3;
use crate::math::{SimdWidth, run_vectorized};
use rayon::prelude::*;

/// The number of rays in a block.
pub(super) const BLOCK: usize = 64;
/// The number of rays in a block of those that fill no whole one.
pub(super) const SMALL_BLOCK: usize = 16;
/// The number of rays of one parallel task.
pub(super) const CHUNK: usize = 64 * BLOCK;

/// Rays as columns, each starting in the frame of the first vertex.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Rays<R> {
    /// The x coordinates of the starts, in mm.
    pub x: Vec<R>,
    /// The y coordinates of the starts, in mm.
    pub y: Vec<R>,
    /// The z coordinates of the starts, in mm.
    pub z: Vec<R>,
    /// The direction cosines along x.
    pub l: Vec<R>,
    /// The direction cosines along y.
    pub m: Vec<R>,
    /// The direction cosines along z.
    pub n: Vec<R>,
}

impl<R: Real> Rays<R> {
    /// No rays, with capacity for `count`.
    pub fn with_capacity(count: usize) -> Self {
        let column = || Vec::with_capacity(count);
        Self { x: column(), y: column(), z: column(), l: column(), m: column(), n: column() }
    }

    /// The number of rays.
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// True if there are no rays.
    pub fn is_empty(&self) -> bool {
        self.x.is_empty()
    }

    /// Adds a ray.
    pub fn push(&mut self, ray: Ray<R>) {
        self.x.push(ray.point.x);
        self.y.push(ray.point.y);
        self.z.push(ray.point.z);
        self.l.push(ray.direction.x);
        self.m.push(ray.direction.y);
        self.n.push(ray.direction.z);
    }

    /// Removes all rays and keeps the capacity.
    pub fn clear(&mut self) {
        let Self { x, y, z, l, m, n } = self;
        [x, y, z, l, m, n].into_iter().for_each(Vec::clear);
    }

    /// The ray with index `i`.
    ///
    /// # Panics
    /// If there is no such ray.
    pub fn get(&self, i: usize) -> Ray<R> {
        Ray {
            point: Vec3::new(self.x[i], self.y[i], self.z[i]),
            direction: Vec3::new(self.l[i], self.m[i], self.n[i]),
        }
    }

    pub(super) fn slice(&self, from: usize, to: usize) -> RaySlice<'_, R> {
        RaySlice {
            x: &self.x[from..to],
            y: &self.y[from..to],
            z: &self.z[from..to],
            l: &self.l[from..to],
            m: &self.m[from..to],
            n: &self.n[from..to],
        }
    }
}

impl<R: Real> FromIterator<Ray<R>> for Rays<R> {
    fn from_iter<I: IntoIterator<Item = Ray<R>>>(rays: I) -> Self {
        let rays = rays.into_iter();
        let mut columns = Self::with_capacity(rays.size_hint().0);
        rays.for_each(|ray| columns.push(ray));
        columns
    }
}

/// A borrowed part of the columns of [`Rays`].
#[derive(Clone, Copy)]
pub(super) struct RaySlice<'a, R> {
    x: &'a [R],
    y: &'a [R],
    z: &'a [R],
    l: &'a [R],
    m: &'a [R],
    n: &'a [R],
}

/// The landings of rays as columns, in the frame of the last surface; zeros for a lost ray.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Landings<R> {
    /// The x coordinates of the points, in mm.
    pub x: Vec<R>,
    /// The y coordinates of the points, in mm.
    pub y: Vec<R>,
    /// The z coordinates of the points, in mm.
    pub z: Vec<R>,
    /// The direction cosines along x behind the last surface.
    pub l: Vec<R>,
    /// The direction cosines along y behind the last surface.
    pub m: Vec<R>,
    /// The direction cosines along z behind the last surface.
    pub n: Vec<R>,
    /// The optical paths from the starts, in mm.
    pub opl: Vec<R>,
    codes: Vec<u32>,
}

impl<R: Real> Landings<R> {
    /// True if every ray arrives.
    pub fn all_arrive(&self) -> bool {
        self.codes.iter().fold(0, |all, code| all | code) == 0
    }

    /// The point and the direction of a ray behind the last surface, in its frame.
    ///
    /// # Panics
    /// If there is no such ray.
    pub fn ray(&self, i: usize) -> Ray<R> {
        Ray {
            point: Vec3::new(self.x[i], self.y[i], self.z[i]),
            direction: Vec3::new(self.l[i], self.m[i], self.n[i]),
        }
    }
}

/// The landings of rays across the axis alone, for spots; zeros for a lost ray.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ImagePoints<R> {
    /// The x coordinates of the points, in mm.
    pub x: Vec<R>,
    /// The y coordinates of the points, in mm.
    pub y: Vec<R>,
    codes: Vec<u32>,
}

/// A receiver of traced rays.
pub trait TraceSink<R>: Send {
    /// True if directions and optical paths are stored too.
    const WITH_PATH: bool;
    /// Sets the number of rays.
    fn resize(&mut self, count: usize);
    /// Borrowed parts of `size` rays each, in order.
    fn parts(&mut self, size: usize) -> Vec<TraceSinkPart<'_, R>>;
    /// The fate of a ray.
    fn fate(&self, ray: usize) -> Fate;
    /// The number of rays of each fate.
    fn fates(&self) -> Fates;
}

/// A borrowed part of the columns of a [`TraceSink`]; columns that are not stored are empty.
#[derive(Debug)]
pub struct TraceSinkPart<'a, R> {
    columns: [&'a mut [R]; 7],
    codes: &'a mut [u32],
}

fn count_fates(codes: &[u32]) -> Fates {
    let mut fates = Fates::default();
    // Most rays arrive: they are counted by vector instructions.
    let lost = codes.iter().filter(|code| **code != 0);
    lost.for_each(|code| fates.count(Fate::from_code(*code)));
    fates.imaged += codes.iter().filter(|code| **code == 0).count();
    fates
}

impl<R: Real> TraceSink<R> for Landings<R> {
    const WITH_PATH: bool = true;

    fn resize(&mut self, count: usize) {
        let Self { x, y, z, l, m, n, opl, codes } = self;
        [x, y, z, l, m, n, opl].into_iter().for_each(|column| column.resize(count, R::ZERO));
        codes.resize(count, 0);
    }

    fn parts(&mut self, size: usize) -> Vec<TraceSinkPart<'_, R>> {
        let columns = [
            &mut self.x,
            &mut self.y,
            &mut self.z,
            &mut self.l,
            &mut self.m,
            &mut self.n,
            &mut self.opl,
        ];
        let mut columns = columns.map(|column| column.chunks_mut(size));
        let part = |codes| TraceSinkPart {
            columns: std::array::from_fn(|i| columns[i].next().unwrap_or_default()),
            codes,
        };
        self.codes.chunks_mut(size).map(part).collect()
    }

    fn fate(&self, ray: usize) -> Fate {
        Fate::from_code(self.codes[ray])
    }

    fn fates(&self) -> Fates {
        count_fates(&self.codes)
    }
}

impl<R: Real> TraceSink<R> for ImagePoints<R> {
    const WITH_PATH: bool = false;

    fn resize(&mut self, count: usize) {
        self.x.resize(count, R::ZERO);
        self.y.resize(count, R::ZERO);
        self.codes.resize(count, 0);
    }

    fn parts(&mut self, size: usize) -> Vec<TraceSinkPart<'_, R>> {
        let columns = self.x.chunks_mut(size).zip(self.y.chunks_mut(size));
        let part = |((x, y), codes)| {
            let mut columns: [&mut [R]; 7] = Default::default();
            columns[0] = x;
            columns[1] = y;
            TraceSinkPart { columns, codes }
        };
        columns.zip(self.codes.chunks_mut(size)).map(part).collect()
    }

    fn fate(&self, ray: usize) -> Fate {
        Fate::from_code(self.codes[ray])
    }

    fn fates(&self) -> Fates {
        count_fates(&self.codes)
    }
}

impl<R: Real> Tracer<R> {
    /// Traces rays on the calling thread.
    ///
    /// # Panics
    /// If the columns of `rays` differ in length.
    pub fn trace_batch<S: TraceSink<R>>(&self, rays: &Rays<R>, sink: &mut S) {
        self.trace_batch_with(SimdWidth::detect(), rays, sink);
    }

    /// Traces rays on the calling thread with vector instructions of at most this width.
    ///
    /// # Panics
    /// If the columns of `rays` differ in length.
    pub fn trace_batch_with<S: TraceSink<R>>(
        &self,
        width: SimdWidth,
        rays: &Rays<R>,
        sink: &mut S,
    ) {
        sink.resize(rays.len());
        for (i, part) in sink.parts(CHUNK).into_iter().enumerate() {
            self.trace_chunk::<S>(width, rays, i * CHUNK, part);
        }
    }

    /// Traces rays on all cores; the results have the same bits as [`Tracer::trace_batch`].
    ///
    /// # Panics
    /// If the columns of `rays` differ in length.
    pub fn trace_batch_parallel<S: TraceSink<R>>(&self, rays: &Rays<R>, sink: &mut S) {
        sink.resize(rays.len());
        let width = SimdWidth::detect();
        let parts = sink.parts(CHUNK).into_par_iter().enumerate();
        parts.for_each(|(i, part)| self.trace_chunk::<S>(width, rays, i * CHUNK, part));
    }

    fn trace_chunk<S: TraceSink<R>>(
        &self,
        width: SimdWidth,
        rays: &Rays<R>,
        from: usize,
        mut part: TraceSinkPart<'_, R>,
    ) {
        let columns = rays.slice(from, from + part.codes.len());
        run_vectorized(
            width,
            #[inline(always)]
            || self.trace_blocks::<S>(columns, &mut part),
        );
    }

    /// Marks the rays that only fill up a block as lost, in a lens where every ray costs time of its
    /// own.
    #[inline(always)]
    pub(super) fn mask<const N: usize>(&self, block: &mut RayBlock<R, N>, count: usize) {
        let is_asphere = |i: &Interface<R>| i.form == SurfaceForm::Asphere;
        if !self.is_plain() || self.interfaces.iter().any(is_asphere) {
            block.code[count..].fill(R::ONE);
        }
    }

    /// Clips a block that has crossed a surface at its apertures. The test alone is part of the loop.
    #[inline(always)]
    pub(super) fn clip_at_apertures<const N: usize>(&self, block: &mut RayBlock<R, N>, i: usize) {
        if let Some(apertures) = self.apertures.clipping(i) {
            block.clip_apertures(apertures, i as u32);
        }
    }

    #[inline(always)]
    fn trace_blocks<S: TraceSink<R>>(
        &self,
        rays: RaySlice<'_, R>,
        part: &mut TraceSinkPart<'_, R>,
    ) {
        let whole = rays.x.len() / BLOCK * BLOCK;
        let mut block: RayBlock<R> = RayBlock::new();
        for from in (0..whole).step_by(BLOCK) {
            self.trace_block::<S, BLOCK>(&mut block, rays, from, BLOCK, part);
        }
        let mut block: RayBlock<R, SMALL_BLOCK> = RayBlock::new();
        for from in (whole..rays.x.len()).step_by(SMALL_BLOCK) {
            let count = SMALL_BLOCK.min(rays.x.len() - from);
            self.trace_block::<S, SMALL_BLOCK>(&mut block, rays, from, count, part);
        }
    }

    #[inline(always)]
    fn trace_block<S: TraceSink<R>, const N: usize>(
        &self,
        block: &mut RayBlock<R, N>,
        rays: RaySlice<'_, R>,
        from: usize,
        count: usize,
        part: &mut TraceSinkPart<'_, R>,
    ) {
        block.load(rays, from, count, self.index_before);
        self.mask(block, count);
        for (i, interface) in self.interfaces.iter().enumerate() {
            if let Some(mount) = self.vector_mount(i) {
                block.cross_mounted_into::<S>(
                    interface,
                    i as u32,
                    mount,
                    self.apertures.clipping(i),
                );
            } else if self.is_general(i) {
                block.cross_general_into::<S>(self, i);
            } else {
                block.cross::<S>(interface, i as u32);
                self.clip_at_apertures(block, i);
            }
        }
        let index = self.interfaces.last().map_or(self.index_before, |i| i.index_behind);
        block.store::<S>(part, from, count, index);
    }
}

/// A block of rays on their way, as columns.
#[derive(Clone)]
pub(super) struct RayBlock<R, const N: usize = BLOCK> {
    pub(super) x: [R; N],
    pub(super) y: [R; N],
    pub(super) z: [R; N],
    pub(super) kx: [R; N],
    pub(super) ky: [R; N],
    pub(super) kz: [R; N],
    opl: [R; N],
    /// 0 for a ray on its way, else the code of its loss; a number of the same width as the others, so
    /// that the vector instructions need no conversion.
    pub(super) code: [R; N],
}

impl<R: Real, const N: usize> RayBlock<R, N> {
    #[inline(always)]
    pub(super) fn new() -> Self {
        let zero = [R::ZERO; N];
        Self { x: zero, y: zero, z: zero, kx: zero, ky: zero, kz: zero, opl: zero, code: zero }
    }

    /// Loads rays from columns; a block that is not full is filled up with its first ray.
    #[inline(always)]
    pub(super) fn load(&mut self, rays: RaySlice<'_, R>, from: usize, count: usize, index: R) {
        for (to, column) in [
            (&mut self.x, rays.x),
            (&mut self.y, rays.y),
            (&mut self.z, rays.z),
            (&mut self.kx, rays.l),
            (&mut self.ky, rays.m),
            (&mut self.kz, rays.n),
        ] {
            to[..count].copy_from_slice(&column[from..from + count]);
            to[count..].fill(column[from]);
        }
        for j in 0..N {
            let k = optical_direction(Vec3::new(self.kx[j], self.ky[j], self.kz[j]), index);
            (self.kx[j], self.ky[j], self.kz[j]) = (k.x, k.y, k.z);
            self.opl[j] = R::ZERO;
            self.code[j] = R::ZERO;
        }
    }

    /// Loads the rays that `ray` makes.
    #[inline(always)]
    pub(super) fn fill(&mut self, index: R, ray: impl Fn(usize) -> Ray<R>) {
        for j in 0..N {
            let ray = ray(j);
            self.set(j, ray.point, optical_direction(ray.direction, index));
            self.code[j] = R::ZERO;
        }
    }

    /// The same rays over another number type.
    #[inline(always)]
    pub(super) fn map<S: Real>(&self, f: impl Fn(R) -> S) -> RayBlock<S, N> {
        let column = |from: &[R; N]| std::array::from_fn(|j| f(from[j]));
        RayBlock {
            x: column(&self.x),
            y: column(&self.y),
            z: column(&self.z),
            kx: column(&self.kx),
            ky: column(&self.ky),
            kz: column(&self.kz),
            opl: column(&self.opl),
            code: column(&self.code),
        }
    }

    /// Point and optical direction of a ray.
    #[inline(always)]
    pub(super) fn state(&self, j: usize) -> (Vec3<R>, Vec3<R>) {
        let p = Vec3::new(self.x[j], self.y[j], self.z[j]);
        (p, Vec3::new(self.kx[j], self.ky[j], self.kz[j]))
    }

    #[inline(always)]
    pub(super) fn set(&mut self, j: usize, p: Vec3<R>, k: Vec3<R>) {
        (self.x[j], self.y[j], self.z[j]) = (p.x, p.y, p.z);
        (self.kx[j], self.ky[j], self.kz[j]) = (k.x, k.y, k.z);
    }

    #[inline(always)]
    fn cross<S: TraceSink<R>>(&mut self, interface: &Interface<R>, number: u32) {
        if S::WITH_PATH {
            let mut opl = self.opl;
            self.cross_with(interface, number, |j, met| opl[j] += met.s * interface.n2);
            self.opl = opl;
        } else {
            self.cross_with(interface, number, |_, _| {});
        }
    }

    #[inline(never)]
    fn cross_general_into<S: TraceSink<R>>(&mut self, tracer: &Tracer<R>, number: usize) {
        let mut opl = self.opl;
        self.cross_general(tracer, number, |j, arrived| {
            if S::WITH_PATH {
                opl[j] += arrived.path;
            }
        });
        self.opl = opl;
    }

    /// Crosses a surface that is decentred, tilted or irregular. Never part of the loop over centred
    /// surfaces, whose registers it would occupy.
    #[inline(never)]
    fn cross_mounted_into<S: TraceSink<R>>(
        &mut self,
        interface: &Interface<R>,
        number: u32,
        mount: &Mount<R>,
        apertures: Option<&ApertureSet<R>>,
    ) {
        let mut opl = self.opl;
        run_vectorized(
            SimdWidth::detect(),
            #[inline(always)]
            || {
                self.cross_mounted(
                    interface,
                    number,
                    (mount, apertures),
                    #[inline(always)]
                    |j, met| {
                        if S::WITH_PATH {
                            opl[j] += met.s * interface.n2;
                        }
                    },
                );
            },
        );
        self.opl = opl;
    }

    #[inline(always)]
    pub(super) fn cross_mounted(
        &mut self,
        interface: &Interface<R>,
        number: u32,
        (mount, apertures): (&Mount<R>, Option<&ApertureSet<R>>),
        keep: impl FnMut(usize, &Intersection<R>),
    ) {
        for j in 0..N {
            let (p, k) = self.state(j);
            let p = Vec3::new(p.x, p.y, p.z - interface.gap);
            self.set(j, mount.pose.point_in(p), mount.pose.direction_in(k));
        }
        // The gap in front belongs to the frame of the centred vertex.
        let own = Interface { gap: R::ZERO, ..*interface };
        match mount.astigmatism {
            None => self.cross_with(&own, number, keep),
            Some(q) => self.cross_irregular(&own, number, q, keep),
        }
        if let Some(apertures) = apertures {
            self.clip_apertures(apertures, number);
        }
        for j in 0..N {
            let (p, k) = self.state(j);
            self.set(j, mount.behind.point_out(p), mount.behind.direction_out(k));
        }
    }

    /// Crosses the sag `z(r²) + q y²`.
    #[inline(always)]
    fn cross_irregular(
        &mut self,
        interface: &Interface<R>,
        number: u32,
        q: R,
        keep: impl FnMut(usize, &Intersection<R>),
    ) {
        let mut rays = asphere::RayStarts::<R, N>::new();
        let mut from = self.revolution_distances(interface);
        for (j, from) in from.iter_mut().enumerate() {
            let (p, k) = self.state(j);
            let (start, before) = interface.closest_approach(p, k);
            *from -= before;
            rays.set(j, start, k);
        }
        let s = irregular_crossings(interface, q, &rays, from);
        self.cross_form(
            interface,
            number,
            #[inline(always)]
            |i, j, p, k| i.intersection_on_irregular(i.closest_approach(p, k), k, s[j], q),
            keep,
        );
        if interface.obstruction2 > R::ZERO {
            self.clip_obstruction(interface, number);
        }
    }

    /// The distance along `k` of every ray to the surface of revolution; NaN for a miss.
    #[inline(always)]
    fn revolution_distances(&self, interface: &Interface<R>) -> [R; N] {
        match interface.form {
            SurfaceForm::Plane => self.distances_by(
                #[inline(always)]
                |_, p, k| interface.intersect_plane(p, k),
            ),
            SurfaceForm::Sphere => self.distances_by(
                #[inline(always)]
                |_, p, k| interface.intersect_sphere(p, k),
            ),
            SurfaceForm::Conic => self.distances_by(
                #[inline(always)]
                |_, p, k| interface.intersect_conic(p, k),
            ),
            SurfaceForm::Asphere => {
                let s = self.asphere_distances(interface);
                self.distances_by(
                    #[inline(always)]
                    |j, p, k| {
                        let (start, before) = interface.closest_approach(p, k);
                        interface.intersection_on_asphere(start, k, s[j], before)
                    },
                )
            }
        }
    }

    #[inline(always)]
    fn distances_by(&self, meet: impl Fn(usize, Vec3<R>, Vec3<R>) -> Intersection<R>) -> [R; N] {
        let mut distances = [R::ZERO; N];
        for (j, distance) in distances.iter_mut().enumerate() {
            let (p, k) = self.state(j);
            let met = meet(j, p, k);
            *distance = R::select(met.missed, R::from_f64(f64::NAN), met.s);
        }
        distances
    }

    /// Crosses a surface that a GRIN medium touches or that is not centred, ray by ray.
    #[inline(never)]
    pub(super) fn cross_general(
        &mut self,
        tracer: &Tracer<R>,
        number: usize,
        mut keep: impl FnMut(usize, &PropagatedRay<'_, R>),
    ) {
        for j in 0..N {
            if self.code[j] > R::ZERO {
                continue;
            }
            let (p, k) = self.state(j);
            let arrived = tracer.propagate::<true>(number, p, k);
            keep(j, &arrived);
            let mut crossing = arrived.refract();
            let is_outside = tracer.is_outside_apertures(number, crossing.point);
            crossing.clipped |= !arrived.met.missed && is_outside;
            let (p, k) = tracer.state_out(number, (crossing.point, crossing.k));
            self.set(j, p, k);
            if let Some(cause) = arrived.loss_cause(&crossing) {
                self.code[j] = R::from_f64(f64::from(fate::encode(number as u32, cause)));
            }
        }
    }

    /// Crosses a surface and stores the distance to it.
    #[inline(always)]
    pub(super) fn cross_recording(
        &mut self,
        interface: &Interface<R>,
        number: u32,
        distance: &mut [R; N],
    ) {
        self.cross_with(interface, number, |j, met| distance[j] = met.s);
    }

    /// Crosses a surface; the two senses of travel are compiled apart, since a factor that is known
    /// to be 1 costs nothing.
    #[inline(always)]
    pub(super) fn cross_with(
        &mut self,
        interface: &Interface<R>,
        number: u32,
        keep: impl FnMut(usize, &Intersection<R>),
    ) {
        if interface.sense > R::ZERO {
            self.cross_along(&Interface { sense: R::ONE, ..*interface }, number, keep);
        } else {
            self.cross_along(&Interface { sense: -R::ONE, ..*interface }, number, keep);
        }
        if interface.obstruction2 > R::ZERO {
            self.clip_obstruction(interface, number);
        }
    }

    /// Clips the rays that met a surface inside its obstruction.
    #[inline(always)]
    fn clip_obstruction(&mut self, interface: &Interface<R>, number: u32) {
        let lost = |cause: u32| R::from_f64(f64::from(fate::encode(number, cause)));
        let (clipped, reflected) = (lost(CLIPPED), lost(TOTAL_REFLECTION));
        for j in 0..N {
            let (p, _) = self.state(j);
            let code = self.code[j];
            let arrived = !(code > R::ZERO) | (code == reflected);
            self.code[j] = R::select(arrived & interface.obstructs(p), clipped, code);
        }
    }

    /// Clips the rays that met a surface where one of its apertures blocks them. Never part of the loop
    /// over surfaces, whose registers it would occupy.
    #[inline(never)]
    fn clip_apertures(&mut self, apertures: &ApertureSet<R>, number: u32) {
        let lost = |cause: u32| R::from_f64(f64::from(fate::encode(number, cause)));
        let (clipped, reflected) = (lost(CLIPPED), lost(TOTAL_REFLECTION));
        for j in 0..N {
            let (p, _) = self.state(j);
            let code = self.code[j];
            let arrived = !(code > R::ZERO) | (code == reflected);
            if arrived && !apertures.passes(p) {
                self.code[j] = clipped;
            }
        }
    }

    #[inline(always)]
    fn cross_along(
        &mut self,
        interface: &Interface<R>,
        number: u32,
        keep: impl FnMut(usize, &Intersection<R>),
    ) {
        match interface.form {
            SurfaceForm::Plane => {
                self.cross_form(
                    interface,
                    number,
                    #[inline(always)]
                    |i, _, p, k| i.intersect_plane(p, k),
                    keep,
                );
            }
            SurfaceForm::Sphere => {
                self.cross_form(
                    interface,
                    number,
                    #[inline(always)]
                    |i, _, p, k| i.intersect_sphere(p, k),
                    keep,
                );
            }
            SurfaceForm::Conic => {
                self.cross_form(
                    interface,
                    number,
                    #[inline(always)]
                    |i, _, p, k| i.intersect_conic(p, k),
                    keep,
                );
            }
            SurfaceForm::Asphere if R::ORDER > 0 => {
                let lost = self.code.map(|code| code > R::ZERO);
                let meet = |i: &Interface<R>, j: usize, p, k| {
                    if lost[j] { i.approach_asphere(p, k) } else { i.intersect_asphere(p, k) }
                };
                self.cross_form(interface, number, meet, keep);
            }
            SurfaceForm::Asphere => {
                let s = self.asphere_distances(interface);
                let meet = |i: &Interface<R>, j: usize, p, k| {
                    let (start, before) = i.closest_approach(p, k);
                    i.intersection_on_asphere(start, k, s[j], before)
                };
                self.cross_form(interface, number, meet, keep);
            }
        }
    }

    /// The distance along `k` of every ray to an asphere, from its start or its point of closest
    /// approach; NaN for a miss.
    #[inline(always)]
    fn asphere_distances(&self, interface: &Interface<R>) -> [R; N] {
        let mut before = [R::ZERO; N];
        let mut rays = asphere::RayStarts::<R, N>::new();
        for (j, before) in before.iter_mut().enumerate() {
            let (p, k) = self.state(j);
            let (start, distance) =
                interface.closest_approach(Vec3::new(p.x, p.y, p.z - interface.gap), k);
            *before = distance;
            rays.set(j, start, k);
        }
        let asphere::NewtonResult { mut s, trusted } = asphere::newton_crossings(interface, &rays);
        for j in 0..N {
            if !(trusted[j] > R::ZERO) && !(self.code[j] > R::ZERO) {
                let (p, k) = rays.get(j);
                let (p, k, start) = (p.value(), k.value(), -before[j].value());
                let found = asphere_crossing::isolate_crossing(interface.value(), p, k, start);
                s[j] = R::from_f64(found.unwrap_or(f64::NAN));
            }
        }
        s
    }

    #[inline(always)]
    fn cross_form(
        &mut self,
        interface: &Interface<R>,
        number: u32,
        meet: impl Fn(&Interface<R>, usize, Vec3<R>, Vec3<R>) -> Intersection<R>,
        mut keep: impl FnMut(usize, &Intersection<R>),
    ) {
        let interface = *interface;
        let lost = |cause: u32| R::from_f64(f64::from(fate::encode(number, cause)));
        let (missed, clipped) = (lost(MISSED), lost(CLIPPED));
        let reflected = lost(TOTAL_REFLECTION);
        for j in 0..N {
            let (p, k) = self.state(j);
            let p = Vec3::new(p.x, p.y, p.z - interface.gap);
            let met = meet(&interface, j, p, k);
            keep(j, &met);
            let crossing = interface.refract(met, k, interface.dn2);
            self.set(j, crossing.point, crossing.k);
            let code = first_cause(&crossing, missed, clipped, reflected);
            self.code[j] = R::select(self.code[j] > R::ZERO, self.code[j], code);
        }
    }

    #[inline(always)]
    fn store<S: TraceSink<R>>(
        &self,
        part: &mut TraceSinkPart<'_, R>,
        from: usize,
        count: usize,
        index: R,
    ) {
        let inverse = R::ONE / index;
        let arrived = |j: usize, value: R| R::select(self.code[j] > R::ZERO, R::ZERO, value);
        for j in 0..count {
            part.columns[0][from + j] = arrived(j, self.x[j]);
            part.columns[1][from + j] = arrived(j, self.y[j]);
        }
        if S::WITH_PATH {
            for j in 0..count {
                part.columns[2][from + j] = arrived(j, self.z[j]);
                part.columns[3][from + j] = arrived(j, self.kx[j] * inverse);
                part.columns[4][from + j] = arrived(j, self.ky[j] * inverse);
                part.columns[5][from + j] = arrived(j, self.kz[j] * inverse);
                part.columns[6][from + j] = arrived(j, self.opl[j]);
            }
        }
        for j in 0..count {
            part.codes[from + j] = self.code[j].value() as u32;
        }
    }
}

/// The code of the first cause of a loss at a surface, or 0.
#[inline(always)]
fn first_cause<R: Real>(crossing: &Refraction<R>, missed: R, clipped: R, reflected: R) -> R {
    let code = R::select(crossing.reflected, reflected, R::ZERO);
    let code = R::select(crossing.clipped, clipped, code);
    R::select(crossing.missed, missed, code)
}
