//! Deflection by a rule: a paraxial lens, a grating and a phase, forwards and backwards.
//!
//! With `k` the optical direction and `N` the normal, a surface that adds `g(x, y)` to the optical path
//! takes `q = k + ∇g` in place of `k` into Snell's law: `k' = q + Γ N` with `|k'| = n'`, so that the
//! component along the surface grows by that of `∇g`. A grating adds `g y`, a phase Φ in the order m
//! `m λ Φ/2π`. Behind a paraxial lens at the height h the slope times the
//! index is `w = n u − h φ`. The path of a plane wave from the vertex to the focus is the same for all
//! heights, which leaves for the lens `n' (2 n u·h − φ h²)/(A + B) − k·h` with `A² = n'² + n² u²` and
//! `B² = n'² + w²`.

use super::interface::{Interface, Intersection};
use crate::lens::{Freeform, IdealAction};
use crate::math::{Real, Vec3};

/// A rule at one point of a surface.
#[derive(Debug, Clone, Copy)]
pub(super) enum LocalRule<R> {
    /// A thin lens of this power in 1/mm.
    Lens(R),
    /// A path that the surface adds to the optical one.
    Added {
        /// The gradient along x and y.
        slopes: [R; 2],
        /// The path, in mm.
        path: R,
    },
}

impl<R: Real> LocalRule<R> {
    /// The rule of a surface with a form at a point.
    fn new(action: IdealAction<R>, form: &Freeform<R>, point: Vec3<R>) -> Self {
        match action {
            IdealAction::Lens { power } => Self::Lens(power),
            IdealAction::Grating { shift } => {
                Self::Added { slopes: [R::ZERO, shift], path: shift * point.y }
            }
            IdealAction::Phase { path } => {
                let [phase, by_x, by_y] = form.phase(point.x, point.y);
                Self::Added { slopes: [path * by_x, path * by_y], path: path * phase }
            }
        }
    }
}

/// A rule at a point of a surface with the media on both sides.
#[derive(Debug, Clone, Copy)]
pub(super) struct Deflection<R> {
    pub(super) rule: LocalRule<R>,
    /// The sense of travel in front.
    pub(super) sense: R,
    pub(super) mirror: bool,
    pub(super) before: R,
    pub(super) behind: R,
}

impl<R: Real> Deflection<R> {
    pub(super) fn new(
        action: IdealAction<R>,
        form: &Freeform<R>,
        surface: &Interface<R>,
        point: Vec3<R>,
    ) -> Self {
        let Interface { sense, mirror, index_before, index_behind, .. } = *surface;
        let rule = LocalRule::new(action, form, point);
        Self { rule, sense, mirror, before: index_before, behind: index_behind }
    }

    /// The direction of which the component along the surface remains.
    fn shifted(&self, k: Vec3<R>) -> Vec3<R> {
        match self.rule {
            LocalRule::Lens(_) => k,
            LocalRule::Added { slopes: [x, y], .. } => Vec3::new(k.x + x, k.y + y, k.z),
        }
    }

    /// The square of `k'·N`, negative for an order that no light is in; one for a lens.
    pub(super) fn margin(&self, k: Vec3<R>, normal: Vec3<R>) -> R {
        if matches!(self.rule, LocalRule::Lens(_)) {
            return R::ONE;
        }
        let q = self.shifted(k);
        let a = q.dot(normal);
        a * a + (self.behind * self.behind - q.dot(q)) * normal.dot(normal)
    }

    /// The direction behind of a ray at the limit, where it leaves along the surface.
    pub(super) fn grazing(&self, k: Vec3<R>, met: &Intersection<R>) -> Vec3<R> {
        let q = self.shifted(k);
        q - met.normal * (q.dot(met.normal) / met.m)
    }

    /// The optical direction behind, NaN where there is none.
    pub(super) fn deflect(&self, point: Vec3<R>, k: Vec3<R>, normal: Vec3<R>) -> Vec3<R> {
        if let LocalRule::Lens(power) = self.rule {
            let along = self.sense * self.before / k.z;
            let w = [k.x * along - point.x * power, k.y * along - point.y * power];
            return directed(w, self.behind, self.sense);
        }
        let (q, m) = (self.shifted(k), normal.dot(normal));
        let a = q.dot(normal);
        let behind = self.margin(k, normal).sqrt();
        let behind = if self.mirror { -(self.sense * behind) } else { self.sense * behind };
        q + normal * ((behind - a) / m)
    }

    /// The optical direction in front of a ray with the direction `k` behind.
    pub(super) fn undeflect(&self, point: Vec3<R>, k: Vec3<R>, normal: Vec3<R>) -> Vec3<R> {
        match self.rule {
            LocalRule::Lens(power) => {
                let along = self.sense * self.behind / k.z;
                let w = [k.x * along + point.x * power, k.y * along + point.y * power];
                directed(w, self.before, self.sense)
            }
            LocalRule::Added { slopes: [x, y], .. } => {
                let q = Vec3::new(k.x - x, k.y - y, k.z);
                let (a, m) = (q.dot(normal), normal.dot(normal));
                let before2 = a * a + (self.before * self.before - q.dot(q)) * m;
                q + normal * ((self.sense * before2.sqrt() - a) / m)
            }
        }
    }

    /// The optical path that the rule adds, in mm.
    pub(super) fn path(&self, point: Vec3<R>, k: Vec3<R>) -> R {
        let power = match self.rule {
            LocalRule::Added { path, .. } => return path,
            LocalRule::Lens(power) => power,
        };
        let along = self.sense * self.before / k.z;
        let u = [k.x * along, k.y * along];
        let w = [u[0] - point.x * power, u[1] - point.y * power];
        let n2 = self.behind * self.behind;
        let [a, b] = [u, w].map(|v| (n2 + v[0] * v[0] + v[1] * v[1]).sqrt());
        let height2 = point.x * point.x + point.y * point.y;
        let twice = R::TWO * (u[0] * point.x + u[1] * point.y) - power * height2;
        self.behind * twice / (a + b) - (k.x * point.x + k.y * point.y)
    }
}

/// The optical direction of the length `n` with the slopes `w/n`.
fn directed<R: Real>(w: [R; 2], n: R, sense: R) -> Vec3<R> {
    let factor = n / (n * n + w[0] * w[0] + w[1] * w[1]).sqrt();
    Vec3::new(w[0] * factor, w[1] * factor, sense * n * factor)
}
