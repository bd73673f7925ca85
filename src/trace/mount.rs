//! Surfaces that are decentred, tilted, or not rotationally symmetric.
//!
//! Between surfaces a ray is in the frame of the vertex that the surface has in the centred lens. At a
//! surface with a [`Pose`] it enters the surface's own frame, is intersected and refracted there, and
//! leaves it again. Where the axis is broken, it leaves into the frame of the new axis: everything
//! behind stands on it, and the gaps are measured along it. An irregular surface has the sag
//! `z(r²) + q y²` in its own frame; the crossing with the surface of revolution is corrected by
//! Newton's iteration. A freeform has a search of its own (`freeform`).

use super::Tracer;
use super::asphere::{RayStarts, iterate_newton};
use super::deflection::Deflection;
use super::freeform::FreeformFace;
use super::interface::{Interface, Intersection};
use super::propagation::PropagatedRay;
use crate::lens::{Freeform, FreeformKind, IdealAction, Pose, Surface, System};
use crate::math::{Real, Vec3};

/// The number of steps of Newton's iteration after which the crossing with an irregular surface is
/// exact to rounding: each squares the error, which begins with some wavelengths.
const NEWTON_STEPS: usize = 4;

/// The crossings of rays with the sag `z(r²) + q y²`, from those with the surface of revolution.
#[inline(always)]
pub(super) fn irregular_crossings<R: Real, const W: usize>(
    surface: &Interface<R>,
    q: R,
    rays: &RayStarts<R, W>,
    mut s: [R; W],
) -> [R; W] {
    iterate_newton::<R, W, NEWTON_STEPS>(rays, surface.n2, &mut s, |point, k| {
        surface.height_above_irregular(point, k, q)
    });
    s
}

/// The position and the irregularity of a surface.
#[derive(Debug, Clone)]
pub(super) struct Mount<R> {
    pub(super) pose: Pose<R>,
    /// The axis behind the surface in the frame in front of it; `None` where it is not broken.
    pub(super) axis: Option<Pose<R>>,
    /// The surface's own frame in the frame behind it.
    pub(super) behind: Pose<R>,
    /// The coefficient of y² in the sag, in 1/mm; `None` for a surface of revolution and a freeform.
    pub(super) astigmatism: Option<R>,
    /// The form of the sag; `None` for a conic with even powers.
    pub(super) face: Option<FreeformFace<R>>,
    /// The rule by which it deflects light; a surface with one has a form too.
    pub(super) ideal: Option<IdealAction<R>>,
}

/// The mounts of all surfaces; empty for a centred system.
pub(super) fn mounts<R: Real>(
    system: &System<R>,
    interfaces: &[Interface<R>],
) -> Vec<Option<Mount<R>>> {
    if !system.has_poses() {
        return Vec::new();
    }
    let mount = |(surface, interface): (&Surface<R>, &Interface<R>)| {
        let pose = surface.pose.unwrap_or_else(Pose::centred);
        let behind = surface.axis.map_or(pose, |axis| axis.inverse().then(&pose));
        let (axis, mut astigmatism) = (surface.axis, surface.astigmatism);
        let plain = Freeform { kind: FreeformKind::OddAsphere, numbers: Vec::new() };
        let form = surface.freeform.as_deref().or(surface.ideal.is_some().then_some(&plain));
        let face = form.map(|form| {
            let irregular = astigmatism.take().unwrap_or(R::ZERO);
            FreeformFace::new(interface, form, irregular)
        });
        let ideal = surface.ideal;
        surface.is_mounted().then_some(Mount { pose, axis, behind, astigmatism, face, ideal })
    };
    system.surfaces.iter().zip(interfaces).map(mount).collect()
}

impl<R: Real> Mount<R> {
    /// Propagates a straight ray from the frame of the surface before; the result is in the surface's
    /// own frame.
    #[inline(never)]
    pub(super) fn propagate<'a>(
        &self,
        surface: &'a Interface<R>,
        p: Vec3<R>,
        k: Vec3<R>,
    ) -> PropagatedRay<'a, R> {
        let start = self.pose.point_in(Vec3::new(p.x, p.y, p.z - surface.gap));
        let k = self.pose.direction_in(k);
        if let Some(face) = &self.face {
            let met = face.intersect(surface, start, k);
            let arrived = PropagatedRay::met_at(surface, met, k);
            let Some(action) = self.ideal else { return arrived };
            return arrived.deflected_by(Deflection::new(action, &face.form, surface, met.point));
        }
        match self.astigmatism {
            None => PropagatedRay::straight(surface, start, k),
            Some(q) => PropagatedRay::met_at(surface, surface.intersect_irregular(start, k, q), k),
        }
    }

    /// The same mount with every number mapped by `f`.
    pub(super) fn map<S: Real>(&self, f: impl Fn(R) -> S) -> Mount<S> {
        let turned = |pose: Pose<R>| pose.map(&f);
        Mount {
            pose: turned(self.pose),
            axis: self.axis.map(turned),
            behind: turned(self.behind),
            astigmatism: self.astigmatism.map(&f),
            face: self.face.as_ref().map(|face| face.map(&f)),
            ideal: self.ideal.map(|ideal| ideal.map(&f)),
        }
    }
}

impl<R: Real> Interface<R> {
    /// The intersection with the sag `z(r²) + q y²`, near that with the surface of revolution.
    fn intersect_irregular(&self, p: Vec3<R>, k: Vec3<R>, q: R) -> Intersection<R> {
        let plain = self.value().intersect(p.value(), k.value());
        let (start, before) = self.closest_approach(p, k);
        let mut ray = RayStarts::<f64, 1>::new();
        ray.set(0, start.value(), k.value());
        let from = if plain.missed { f64::NAN } else { plain.s - before.value() };
        let [s] = irregular_crossings(&self.value(), q.value(), &ray, [from]);
        let mut s = R::from_f64(s);
        for _ in 0..R::ORDER {
            let (f, slope) = self.height_above_irregular(start + k * s, k, q);
            s -= f / slope;
        }
        self.intersection_on_irregular((start, before), k, s, q)
    }

    /// The intersection at `start + s k`, which lies on the sag `z(r²) + q y²`; missed if `s` is NaN.
    #[inline(always)]
    pub(super) fn intersection_on_irregular(
        &self,
        (start, before): (Vec3<R>, R),
        k: Vec3<R>,
        s: R,
        q: R,
    ) -> Intersection<R> {
        let met = self.intersection_at(start + k * s, k, before + s);
        let twice = q * met.point.y;
        let normal = Vec3::new(met.normal.x, met.normal.y - (twice + twice), met.normal.z);
        let a = k.dot(normal);
        let missed = !(self.sense * a > R::ZERO);
        Intersection { normal, a, m: normal.dot(normal), missed, ..met }
    }

    /// `z(r²) + q y² − z` at a point, and its derivative along `k`.
    #[inline(always)]
    fn height_above_irregular(&self, point: Vec3<R>, k: Vec3<R>, q: R) -> (R, R) {
        let (height, slope) = self.height_above(point, k);
        let lean = q * point.y;
        (height + lean * point.y, slope + (lean + lean) * k.y)
    }
}

impl<R: Real> Tracer<R> {
    /// True if no GRIN medium, pose or irregularity asks for the general loops.
    #[inline(always)]
    pub(super) fn is_plain(&self) -> bool {
        self.grin_gaps.is_empty() && self.mounts.is_empty()
    }

    /// The mount of a surface; `None` for a centred one.
    #[inline(always)]
    pub(super) fn mount(&self, surface: usize) -> Option<&Mount<R>> {
        self.mounts.get(surface)?.as_ref()
    }

    /// The mount of a surface that vector instructions cross: between homogeneous media, with the sag
    /// of a conic or an asphere, irregular or not. `None` for numbers that are not plain ones of 64
    /// bits, whose iteration is another.
    #[inline(always)]
    pub(super) fn vector_mount(&self, surface: usize) -> Option<&Mount<R>> {
        let is_plain_number = R::ORDER == 0 && R::EPSILON == f64::EPSILON;
        let mount =
            self.mount(surface).filter(|_| is_plain_number && !self.touches_grin(surface))?;
        (mount.face.is_none() && mount.ideal.is_none()).then_some(mount)
    }

    /// A point in the own frame of a surface, in the frame behind it.
    #[inline(always)]
    pub(super) fn point_out(&self, surface: usize, p: Vec3<R>) -> Vec3<R> {
        self.mount(surface).map_or(p, |mount| mount.behind.point_out(p))
    }

    /// A direction in the own frame of a surface, in the frame behind it.
    #[inline(always)]
    pub(super) fn direction_out(&self, surface: usize, k: Vec3<R>) -> Vec3<R> {
        self.mount(surface).map_or(k, |mount| mount.behind.direction_out(k))
    }

    /// Point and direction in the own frame of a surface, in the frame behind it.
    #[inline(always)]
    pub(super) fn state_out(&self, i: usize, (p, k): (Vec3<R>, Vec3<R>)) -> (Vec3<R>, Vec3<R>) {
        (self.point_out(i, p), self.direction_out(i, k))
    }

    /// A direction in the own frame of a surface that is missed, in the frame in front of it.
    #[inline(always)]
    pub(super) fn direction_before(&self, surface: usize, k: Vec3<R>) -> Vec3<R> {
        self.mount(surface).map_or(k, |mount| mount.pose.direction_out(k))
    }

    /// The frame in front of every surface in that of the first one.
    pub(super) fn frames(&self) -> Vec<Pose<R>> {
        let mut frame = Pose::centred();
        let mut frames = Vec::with_capacity(self.interfaces.len());
        for (i, interface) in self.interfaces.iter().enumerate() {
            let gap = Vec3::new(R::ZERO, R::ZERO, interface.gap);
            frame.shift = frame.point_out(gap);
            frames.push(frame);
            if let Some(axis) = self.mount(i).and_then(|mount| mount.axis.as_ref()) {
                frame = frame.then(axis);
            }
        }
        frames
    }
}
