//! The base of a sag: a conic of revolution, a biconic or a toroid, with even powers of r.

use super::FreeformKind;
use crate::lens::ASPHERE_TERMS;
use crate::math::{Arithmetic, Real};

/// The largest number of numbers of a form that belong to its base.
pub const BASE_NUMBERS: usize = 8;

/// A base with all its numbers.
#[derive(Debug, Clone, Copy)]
pub struct BaseSag<N> {
    /// The kind of the form; one without a base of its own stands on a conic of revolution.
    pub kind: FreeformKind,
    /// The curvature of the section with the y-z plane, in 1/mm.
    pub curvature: N,
    /// The conic constant of that section.
    pub conic: N,
    /// The coefficients of r⁴ to r¹⁶.
    pub terms: [N; ASPHERE_TERMS],
    /// The numbers of the form that belong to the base; zero for a conic of revolution.
    pub own: [N; BASE_NUMBERS],
}

impl<R: Real> BaseSag<R> {
    /// The same base with each number mapped by `f`.
    pub fn map<N>(&self, f: impl Fn(R) -> N) -> BaseSag<N> {
        BaseSag {
            kind: self.kind,
            curvature: f(self.curvature),
            conic: f(self.conic),
            terms: self.terms.map(&f),
            own: self.own.map(&f),
        }
    }
}

impl<N: Arithmetic> BaseSag<N> {
    /// The sag in mm, and its derivatives by x and y.
    pub fn sag(&self, x: N, y: N) -> [N; 3] {
        let own = match self.kind {
            FreeformKind::Biconic => self.biconic(x, y),
            FreeformKind::Toroid => self.toroid(x, y),
            _ => self.conic(x, y),
        };
        let powers = self.powers(x, y);
        std::array::from_fn(|i| own[i] + powers[i])
    }

    /// The factor of a series that stands on the normal of the conic, one over the cosine of its
    /// inclination, with its derivatives by x and y; `None` for a series along the axis.
    pub fn series_factor(&self, x: N, y: N) -> Option<[N; 3]> {
        let FreeformKind::QBfs { .. } = self.kind else { return None };
        let (one, half) = (N::constant(1.0), N::constant(0.5));
        let (r2, c2) = (x.square() + y.square(), self.curvature.square());
        let (above, below) = (self.conic * c2, (one + self.conic) * c2);
        let (a, b) = (one - above * r2, one - below * r2);
        let factor = a.root() / b.root();
        let slope = factor * half * (below / b - above / a);
        let twice = slope + slope;
        Some([factor, x * twice, y * twice])
    }

    fn conic(&self, x: N, y: N) -> [N; 3] {
        let (z, slope) = self.section(x.square() + y.square());
        let twice = slope + slope;
        [z, x * twice, y * twice]
    }

    /// The sag of the conic at the square of a distance from the axis, and its derivative by that
    /// square.
    fn section(&self, square: N) -> (N, N) {
        let (c, one) = (self.curvature, N::constant(1.0));
        let root = (one - (one + self.conic) * c.square() * square).root();
        (c * square / (one + root), c / (root + root))
    }

    fn biconic(&self, x: N, y: N) -> [N; 3] {
        let (one, two) = (N::constant(1.0), N::constant(2.0));
        let [cx, kx, ..] = self.own;
        let (bend_x, bend_y) =
            ((one + kx) * cx.square(), (one + self.conic) * self.curvature.square());
        let root = (one - bend_x * x.square() - bend_y * y.square()).root();
        let below = one / (one + root);
        let z = (cx * x.square() + self.curvature * y.square()) * below;
        // d√ = −bend x dx / √, and z is inversely proportional to 1 + √.
        let by_root = z * below / root;
        let by_x = x * (two * cx * below + bend_x * by_root);
        [z, by_x, y * (two * self.curvature * below + bend_y * by_root)]
    }

    /// With `f` the curve in the y-z plane, `z = f + cx x²/(g + √(g² − cx² x²))`, `g = 1 − cx f`.
    fn toroid(&self, x: N, y: N) -> [N; 3] {
        let [cx, terms @ ..] = self.own;
        let square = y.square();
        let (mut f, mut slope) = self.section(square);
        let (mut sum, mut bend) = (N::constant(0.0), N::constant(0.0));
        for a in terms.into_iter().rev() {
            bend = bend * square + sum;
            sum = sum * square + a;
        }
        (f, slope) = (f + sum * square, slope + bend * square + sum);
        let g = N::constant(1.0) - cx * f;
        let root = (g.square() - cx.square() * x.square()).root();
        let z = f + cx * x.square() / (g + root);
        [z, cx * x / root, (slope + slope) * y * g / root]
    }

    fn powers(&self, x: N, y: N) -> [N; 3] {
        let r2 = x.square() + y.square();
        let (mut sum, mut slope) = (N::constant(0.0), N::constant(0.0));
        for a in self.terms.into_iter().rev() {
            slope = slope * r2 + sum;
            sum = sum * r2 + a;
        }
        let by_r2 = (slope * r2 + sum + sum) * r2;
        let twice = by_r2 + by_r2;
        [sum * r2.square(), x * twice, y * twice]
    }
}
