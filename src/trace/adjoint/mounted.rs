//! The adjoint of a surface that is decentred, tilted, irregular or a freeform.
//!
//! The block enters the surface's own frame, is retraced through the surface there, and leaves the
//! frame in front of it. The derivatives by the state of a ray turn with the frame, because a rotation
//! is its own inverse transpose.

use super::GradientSink;
use super::block::AdjointBlock;
use super::refraction::{
    RefractionAdjoint, SagDerivatives, SagRefractionAdjoint, SurfaceNormal, unrefract,
};
use crate::lens::{ASPHERE_TERMS, BASE_NUMBERS, Freeform, FreeformKind, IdealAction, Pose};
use crate::math::{Dual, Real, Vec3};
use crate::trace::batch::BLOCK;
use crate::trace::deflection::{Deflection, LocalRule};
use crate::trace::freeform::FreeformFace;
use crate::trace::interface::Interface;
use crate::trace::mount::Mount;
use crate::trace::{SurfaceParameter, Tracer};

impl<R: Real> Tracer<R> {
    /// Retraces a block through a surface with a mount to the surface before, and hands over the
    /// derivatives by the numbers of the surface.
    #[inline(never)]
    pub(super) fn backward_mounted(
        &self,
        adjoint: &mut AdjointBlock<R>,
        i: usize,
        mount: &Mount<R>,
        sink: &mut impl GradientSink<R>,
    ) {
        let interface = &self.interfaces[i];
        // The gap in front belongs to the frame of the centred vertex.
        let own = Interface { gap: R::ZERO, ..*interface };
        adjoint.enter(&mount.behind);
        let mut columns = Vec::new();
        match (mount.astigmatism, &mount.face) {
            (_, Some(face)) => {
                columns = adjoint.retrace_freeform(&own, face, mount.ideal);
            }
            (None, None) => adjoint.retrace_surface(&own, None),
            (Some(q), None) => adjoint.retrace_irregular(&own, q),
        }
        adjoint.leave(&mount.pose, interface.gap);
        adjoint.accumulate(interface, i, sink);
        for (k, lanes) in columns.iter().enumerate() {
            let lanes = adjoint.mask_lost(lanes);
            sink.add_lanes(Some(i), SurfaceParameter::Freeform(k), &lanes);
        }
    }
}

impl<R: Real> AdjointBlock<R> {
    /// Turns the block from the frame behind a surface into its own.
    fn enter(&mut self, pose: &Pose<R>) {
        for j in 0..BLOCK {
            let (p, k) = self.block.state(j);
            self.block.set(j, pose.point_in(p), pose.direction_in(k));
            self.set(j, pose.direction_in(self.by_point(j)), pose.direction_in(self.by_k(j)));
        }
    }

    /// Turns the block, in front of a surface, into the frame of the centred vertex before.
    fn leave(&mut self, pose: &Pose<R>, gap: R) {
        for j in 0..BLOCK {
            let (p, k) = self.block.state(j);
            let p = pose.point_out(p);
            self.block.set(j, Vec3::new(p.x, p.y, p.z + gap), pose.direction_out(k));
            let by_point = pose.direction_out(self.by_point(j));
            self.set(j, by_point, pose.direction_out(self.by_k(j)));
            self.by_gap[j] = -by_point.z;
        }
    }

    /// Retraces the block through a surface with the sag `z(r²) + q y²`.
    fn retrace_irregular(&mut self, surface: &Interface<R>, q: R) {
        for j in 0..BLOCK {
            let (p, behind) = self.block.state(j);
            let at = unrefract_irregular(surface, p, behind, self.by_k(j), self.by_point(j), q);
            let lambda = at.step_multiplier(self.by_opl[j] * surface.n2);
            self.set_shape_derivatives(j, &at.sag, lambda, at.by_slope);
            self.transfer_back(surface, j, p, &at.back, at.by_point - at.normal * lambda);
        }
    }
}

/// The inputs of the base of a sag: x and y, then the numbers below.
const CURVATURE: usize = 2;
const CONIC: usize = 3;
const TERMS: usize = 4;
const OWN: usize = TERMS + ASPHERE_TERMS;
const INPUTS: usize = OWN + BASE_NUMBERS;

impl<R: Real> AdjointBlock<R> {
    /// Retraces the block through a freeform. Returns the derivatives by its numbers.
    fn retrace_freeform(
        &mut self,
        surface: &Interface<R>,
        face: &FreeformFace<R>,
        ideal: Option<IdealAction<R>>,
    ) -> Vec<[R; BLOCK]> {
        let mut columns = vec![[R::ZERO; BLOCK]; face.form.numbers.len()];
        for j in 0..BLOCK {
            if self.block.code[j] > R::ZERO {
                continue;
            }
            let (p, behind) = self.block.state(j);
            let sag = FreeformSlopes::new(surface, face, p);
            let vector = Vec3::new(-sag.gradient[0], -sag.gradient[1], R::ONE);
            let normal = SurfaceNormal { vector, m: vector.dot(vector), unit: false };
            let deflected = ideal.map(|action| {
                let ideal = Deflection::new(action, &face.form, surface, p);
                let back = DeflectionAdjoint::new(
                    &ideal,
                    (p, behind, vector),
                    self.by_k(j),
                    self.by_opl[j],
                );
                back.through_phase(action, &face.form, p)
            });
            let back = match &deflected {
                Some(deflected) => deflected.back,
                None => unrefract(surface, normal, behind, self.by_k(j)),
            };
            let n = back.by_normal;
            let [[xx, xy], [yx, yy]] = sag.bends;
            let bent = Vec3::new(xx * n.x + xy * n.y, yx * n.x + yy * n.y, R::ZERO);
            let by_rule = deflected.map_or(Vec3::default(), |deflected| deflected.by_point);
            let by_point = self.by_point(j) + by_rule - bent;
            let lambda = (by_point.dot(back.k) + self.by_opl[j] * surface.n2) / back.a;
            let weights = [lambda, -n.x, -n.y];
            self.set_base_derivatives(j, &sag, weights, &mut columns);
            let numbers = face.base(surface);
            face.form.visit_series(&numbers, p.x, p.y, |k, by| columns[k][j] = dot3(weights, by));
            self.transfer_back(surface, j, p, &back, by_point - vector * lambda);
            if let Some(deflected) = deflected {
                self.by_index_before[j] += deflected.by_indices[0];
                self.by_index_behind[j] += deflected.by_indices[1];
                let weights = deflected.by_phase;
                face.form.visit_phase(p.x, p.y, |k, by| columns[k][j] = dot3(weights, by));
            }
        }
        columns
    }

    /// Sets the derivatives by the numbers of the base, from those by the sag and its gradient.
    fn set_base_derivatives(
        &mut self,
        j: usize,
        sag: &FreeformSlopes<R>,
        weights: [R; 3],
        columns: &mut [[R; BLOCK]],
    ) {
        let by = |input: usize| dot3(weights, sag.base.map(|of| of.slope[input]));
        (self.by_curvature[j], self.by_conic[j]) = (by(CURVATURE), by(CONIC));
        for (term, lanes) in self.by_terms.iter_mut().enumerate() {
            lanes[j] = by(TERMS + term);
        }
        for (k, lanes) in columns.iter_mut().take(BASE_NUMBERS).enumerate() {
            lanes[j] = by(OWN + k);
        }
    }
}

fn dot3<R: Real>(a: [R; 3], b: [R; 3]) -> R {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The adjoint of a deflection by a rule.
#[derive(Clone, Copy)]
struct DeflectionAdjoint<R> {
    back: RefractionAdjoint<R>,
    by_point: Vec3<R>,
    /// By the indices in front and behind.
    by_indices: [R; 2],
    /// By the optical path that the surface adds, and by its gradient along x and y.
    by_added: [R; 3],
    /// The same by the phase of a form and its gradient.
    by_phase: [R; 3],
}

/// The number of inputs of a deflection: point, direction, normal, indices and the gradient of what is
/// added to the optical path.
const DEFLECTION_INPUTS: usize = 13;

impl<R: Real> DeflectionAdjoint<R> {
    /// From the point, the direction behind and the normal, and the derivatives by that direction and
    /// by the optical path.
    fn new(
        ideal: &Deflection<R>,
        (point, behind, normal): (Vec3<R>, Vec3<R>, Vec3<R>),
        by_behind: Vec3<R>,
        by_opl: R,
    ) -> Self {
        let k = ideal.undeflect(point, behind, normal);
        let input = Dual::<R, DEFLECTION_INPUTS>::variable;
        let vector = |v: Vec3<R>, first: usize| {
            Vec3::new(input(v.x, first), input(v.y, first + 1), input(v.z, first + 2))
        };
        let varied = Deflection {
            rule: match ideal.rule {
                LocalRule::Lens(power) => LocalRule::Lens(Dual::constant(power)),
                LocalRule::Added { slopes: [x, y], path } => LocalRule::Added {
                    slopes: [input(x, 11), input(y, 12)],
                    path: Dual::constant(path),
                },
            },
            sense: Dual::constant(ideal.sense),
            mirror: ideal.mirror,
            before: input(ideal.before, 9),
            behind: input(ideal.behind, 10),
        };
        let (at, along) = (vector(point, 0), vector(k, 3));
        let there = varied.deflect(at, along, vector(normal, 6));
        let path = varied.path(at, along);
        let by = |i: usize| {
            let slope = Vec3::new(there.x.slope[i], there.y.slope[i], there.z.slope[i]);
            by_behind.dot(slope) + by_opl * path.slope[i]
        };
        let by_vector = |first: usize| Vec3::new(by(first), by(first + 1), by(first + 2));
        let (a, by_dn2) = (k.dot(normal), R::ZERO);
        let back = RefractionAdjoint { k, a, by_k: by_vector(3), by_normal: by_vector(6), by_dn2 };
        let mut by_point = by_vector(0);
        if let LocalRule::Added { slopes, .. } = ideal.rule {
            (by_point.x, by_point.y) =
                (by_point.x + by_opl * slopes[0], by_point.y + by_opl * slopes[1]);
        }
        Self {
            back,
            by_point,
            by_indices: [by(9), by(10)],
            by_added: [by_opl, by(11), by(12)],
            by_phase: [R::ZERO; 3],
        }
    }

    /// The same with the dependence of the gradient of a phase on the point, and the derivatives by the
    /// phase.
    fn through_phase(mut self, action: IdealAction<R>, form: &Freeform<R>, p: Vec3<R>) -> Self {
        let IdealAction::Phase { path } = action else { return self };
        self.by_phase = self.by_added.map(|by| path * by);
        let [_, x, y] = self.by_phase;
        let [xx, xy, yy] = form.phase_bends(p.x, p.y);
        self.by_point = self.by_point + Vec3::new(xx * x + xy * y, xy * x + yy * y, R::ZERO);
        self
    }
}

/// The gradient of a freeform at a point, its derivatives by the point, and those of the base by all
/// its numbers.
struct FreeformSlopes<R> {
    gradient: [R; 2],
    bends: [[R; 2]; 2],
    base: [Dual<R, INPUTS>; 3],
}

impl<R: Real> FreeformSlopes<R> {
    fn new(surface: &Interface<R>, face: &FreeformFace<R>, p: Vec3<R>) -> Self {
        let input = Dual::<R, INPUTS>::variable;
        let mut base = face.base(surface).map(Dual::constant);
        base.curvature = input(base.curvature.value, CURVATURE);
        base.conic = input(base.conic.value, CONIC);
        base.terms = std::array::from_fn(|i| input(base.terms[i].value, TERMS + i));
        base.own = std::array::from_fn(|i| input(base.own[i].value, OWN + i));
        let inputs = (input(p.x, 0), input(p.y, 1));
        let numbers = base;
        let mut base = numbers.sag(inputs.0, inputs.1);
        if let FreeformKind::QBfs { .. } = face.form.kind {
            // The series stands on the normal of the base and depends on its numbers.
            let series = face.form.series_sag(&numbers, inputs.0, inputs.1, Dual::constant);
            base = std::array::from_fn(|i| base[i] + series[i]);
            return Self::of(face, p, base, [Dual::constant(R::ZERO); 2]);
        }
        let (x, y) = (Dual::<R, 2>::variable(p.x, 0), Dual::<R, 2>::variable(p.y, 1));
        let plain = face.base(surface).map(Dual::constant);
        let [_, by_x, by_y] = face.form.series_sag(&plain, x, y, Dual::constant);
        Self::of(face, p, base, [by_x, by_y])
    }

    /// From the base and the gradient of a series that stands beside it.
    fn of(
        face: &FreeformFace<R>,
        p: Vec3<R>,
        base: [Dual<R, INPUTS>; 3],
        [by_x, by_y]: [Dual<R, 2>; 2],
    ) -> Self {
        let twice = face.astigmatism + face.astigmatism;
        let bend = |base: &Dual<R, INPUTS>, series: Dual<R, 2>| {
            [base.slope[0] + series.slope[0], base.slope[1] + series.slope[1]]
        };
        let (along_x, mut along_y) = (bend(&base[1], by_x), bend(&base[2], by_y));
        along_y[1] += twice;
        let gradient = [base[1].value + by_x.value, base[2].value + by_y.value + twice * p.y];
        Self { gradient, bends: [along_x, along_y], base }
    }
}

/// The adjoint of refraction at a point of a surface with the sag `z(r²) + q y²`.
fn unrefract_irregular<R: Real>(
    surface: &Interface<R>,
    p: Vec3<R>,
    behind: Vec3<R>,
    by_behind: Vec3<R>,
    by_point: Vec3<R>,
    q: R,
) -> SagRefractionAdjoint<R> {
    let sag = SagDerivatives::new(surface, p.x * p.x + p.y * p.y);
    let slope = -(sag.slope + sag.slope);
    let slope_y = slope - (q + q);
    let vector = Vec3::new(p.x * slope, p.y * slope_y, R::ONE);
    let back = unrefract(
        surface,
        SurfaceNormal { vector, m: vector.dot(vector), unit: false },
        behind,
        by_behind,
    );
    // N = (−2 x w, −2 y (w + q), 1) with w = dz/dr².
    let n = back.by_normal;
    let by_slope = -(p.x * n.x + p.y * n.y) * R::TWO;
    let radial = by_slope * sag.second * R::TWO;
    let along = Vec3::new(p.x * radial + n.x * slope, p.y * radial + n.y * slope_y, R::ZERO);
    let by_point = by_point + along;
    SagRefractionAdjoint { sag, normal: vector, back, by_point, by_slope, by_n2: R::ZERO }
}
