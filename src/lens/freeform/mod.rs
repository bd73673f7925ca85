//! Forms of the sag that are no conic with even powers of the distance from the axis.
//!
//! Every form is one formula, written once over [`Arithmetic`]: it gives the sag and its gradient for
//! numbers, second derivatives and derivatives by the coefficients for dual numbers, and bounds for
//! intervals, by which a ray finds its first crossing. The sag is a base, `z = c r²/(1 + √(1 − (1+κ)
//! c² r²)) + Σ aⱼ r^(2j+4)` or the biconic or toroid in place of the conic, plus a series of terms
//! that are linear in their coefficients. A further form is a base or a series more, nothing else. The
//! series of a diffractive form adds to the phase of the light in place of the sag.

mod base;
mod series;

pub use base::{BASE_NUMBERS, BaseSag};

use super::{ASPHERE_TERMS, Shape};
use crate::math::{Arithmetic, Dual, Real};
use serde::{Deserialize, Serialize};

/// The largest number of coefficients of a form: all terms up to the tenth degree.
pub const FREEFORM_NUMBERS: usize = 66;

/// The kind of a form, which decides what its numbers mean.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum FreeformKind {
    /// Adds `Σ aₖ r^k`; the numbers are `a₁, a₂, …`, in mm^(1−k). A term in r is a cone, whose tip is
    /// met as a plane.
    OddAsphere,
    /// A conic with another curvature and conic constant in the x-z plane than in the y-z plane:
    /// `z = (cx x² + cy y²)/(1 + √(1 − (1+kx) cx² x² − (1+ky) cy² y²))`. The numbers are `cx` in 1/mm and
    /// `kx`; those of y are the curvature and the conic constant of the row.
    Biconic,
    /// The curve `f(y)`, the conic of the row and `Σ αₖ y^(2k)`, turned about an axis parallel to y at
    /// the distance 1/cx. The numbers are `cx` in 1/mm, 0 for a cylinder, and `α₁, α₂, …`, in
    /// mm^(1−2k).
    Toroid,
    /// Adds `Σ a u^i v^j` with `u = x/R`, `v = y/R`; the numbers, in mm, are those of u, v, u², uv, v²,
    /// u³, u²v, …
    XyPolynomial {
        /// The radius R, in mm.
        radius: f64,
    },
    /// Adds Zernike polynomials over a circle, normalised to the variance 1 and in the order of Noll
    /// (JOSA 66, 207, 1976), the angle counted from x towards y. The numbers are in mm. Beyond the circle
    /// the polynomials continue.
    Zernike {
        /// The radius of the circle, in mm.
        radius: f64,
    },
    /// As [`FreeformKind::Zernike`], with the value 1 at the rim and in the fringe order, which ends with
    /// the 37th.
    FringeZernike {
        /// The radius of the circle, in mm.
        radius: f64,
    },
    /// Adds `Σ a T_i(x/X) T_j(y/Y)` with the polynomials of Chebyshev; the numbers, in mm, are those of
    /// (i, j) = (0, 0), (1, 0), (0, 1), (2, 0), (1, 1), … Beyond the rectangle the polynomials continue.
    Chebyshev {
        /// The half widths X and Y of the rectangle, in mm.
        half_widths: [f64; 2],
    },
    /// Adds `u⁴ Σ aₘ Qₘ(u²)` with `u = r/R` along the axis, the strong aspheres of Forbes (Optics Express
    /// 15, 5218, 2007, eq. 2.2). The numbers are in mm. Beyond R the polynomials continue.
    QCon {
        /// The radius R, in mm.
        radius: f64,
    },
    /// Adds `u² (1 − u²) Σ aₘ Qₘ(u²)` with `u = r/R` along the normal of the conic, the mild aspheres of
    /// Forbes (2007, eq. 3.2, there on a sphere). The numbers are in mm; they leave vertex and rim on the
    /// conic, and the squares of their slopes against it add up. Beyond R the polynomials continue.
    QBfs {
        /// The radius R, in mm.
        radius: f64,
    },
    /// Adds nothing to the sag, but `m Σ aₖ (r/R)^(2k)` from k = 1 on to the phase of the light: an ideal
    /// diffractive surface, all of whose light is in the order m. The numbers are in radians. The optical
    /// path grows by the phase times the wavelength over 2π; a lens of positive power has a negative a₁.
    RadialPhase {
        /// The radius R, in mm.
        radius: f64,
        /// The diffraction order m.
        order: f64,
    },
    /// As [`FreeformKind::RadialPhase`] with `m Σ a u^i v^j` in the order of
    /// [`FreeformKind::XyPolynomial`].
    XyPhase {
        /// The radius R, in mm.
        radius: f64,
        /// The diffraction order m.
        order: f64,
    },
}

impl FreeformKind {
    /// The name in texts.
    pub const fn name(self) -> &'static str {
        match self {
            Self::OddAsphere => "odd asphere",
            Self::Biconic => "biconic",
            Self::Toroid => "toroid",
            Self::XyPolynomial { .. } => "XY polynomial",
            Self::Zernike { .. } => "Zernike sag",
            Self::FringeZernike { .. } => "fringe Zernike sag",
            Self::Chebyshev { .. } => "Chebyshev polynomial",
            Self::QCon { .. } => "Qcon asphere",
            Self::QBfs { .. } => "Qbfs asphere",
            Self::RadialPhase { .. } => "radial phase",
            Self::XyPhase { .. } => "XY phase",
        }
    }

    /// True if the numbers belong to the base of the sag, not to a series.
    const fn has_own_base(self) -> bool {
        matches!(self, Self::Biconic | Self::Toroid)
    }

    /// True if the series adds to the phase of the light, not to the sag.
    pub const fn is_phase(self) -> bool {
        matches!(self, Self::RadialPhase { .. } | Self::XyPhase { .. })
    }

    /// True if every number multiplies a function of the distance from the axis alone.
    pub const fn is_round(self) -> bool {
        matches!(
            self,
            Self::OddAsphere | Self::QCon { .. } | Self::QBfs { .. } | Self::RadialPhase { .. }
        )
    }

    /// The diffraction order of a form that adds to the phase.
    pub const fn order(self) -> Option<f64> {
        match self {
            Self::RadialPhase { order, .. } | Self::XyPhase { order, .. } => Some(order),
            _ => None,
        }
    }

    /// The least and the largest number of numbers.
    pub const fn counts(self) -> [usize; 2] {
        match self {
            Self::Biconic => [2, 2],
            Self::Toroid => [1, BASE_NUMBERS],
            Self::OddAsphere | Self::QCon { .. } | Self::QBfs { .. } | Self::RadialPhase { .. } => {
                [0, 20]
            }
            Self::XyPolynomial { .. } | Self::XyPhase { .. } => [0, FREEFORM_NUMBERS - 1],
            Self::FringeZernike { .. } => [0, 37],
            Self::Zernike { .. } | Self::Chebyshev { .. } => [0, FREEFORM_NUMBERS],
        }
    }

    /// The degrees in x and y of the term that a number multiplies; `None` for a form whose terms are no
    /// products of a function of x and one of y.
    pub fn degrees(self, number: usize) -> Option<[usize; 2]> {
        match self {
            Self::XyPolynomial { .. } | Self::XyPhase { .. } => Some(series::powers(number + 1)),
            Self::Chebyshev { .. } => Some(series::powers(number)),
            _ => None,
        }
    }

    /// The lengths over which the coordinates are normalised, in mm; empty for a form without any.
    pub fn lengths(self) -> Vec<f64> {
        match self {
            Self::OddAsphere | Self::Biconic | Self::Toroid => Vec::new(),
            Self::XyPolynomial { radius }
            | Self::Zernike { radius }
            | Self::FringeZernike { radius }
            | Self::QCon { radius }
            | Self::QBfs { radius }
            | Self::RadialPhase { radius, .. }
            | Self::XyPhase { radius, .. } => vec![radius],
            Self::Chebyshev { half_widths } => half_widths.to_vec(),
        }
    }

    /// The same kind with the lengths multiplied by `factor`.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        let mut scaled = self;
        match &mut scaled {
            Self::OddAsphere | Self::Biconic | Self::Toroid => {}
            Self::XyPolynomial { radius }
            | Self::Zernike { radius }
            | Self::FringeZernike { radius }
            | Self::QCon { radius }
            | Self::QBfs { radius }
            | Self::RadialPhase { radius, .. }
            | Self::XyPhase { radius, .. } => *radius *= factor,
            Self::Chebyshev { half_widths } => half_widths.iter_mut().for_each(|h| *h *= factor),
        }
        scaled
    }

    /// The power of a length with which a number grows when the lens is scaled: that of mm in its unit,
    /// or 1 for a phase, which is an optical path at the same wavelength.
    pub fn power(self, number: usize) -> i32 {
        let k = i32::try_from(number).unwrap_or(i32::MAX);
        match self {
            Self::OddAsphere => -k,
            Self::Biconic => k - 1,
            Self::Toroid if number == 0 => -1,
            Self::Toroid => 1 - 2 * k,
            _ => 1,
        }
    }

    /// True if a number changes its sign with that of the sag.
    pub fn has_sign(self, number: usize) -> bool {
        !(self.is_phase() || self == Self::Biconic && number == 1)
    }

    /// True if a number is a coefficient of a function that is the same at x and at −x.
    fn is_even_in_x(self, number: usize) -> bool {
        match self {
            Self::Biconic | Self::Toroid => true,
            _ if self.is_round() => true,
            Self::Zernike { .. } => series::noll(number).is_even_in_x(),
            Self::FringeZernike { .. } => series::fringe(number).is_even_in_x(),
            _ => self.degrees(number).is_some_and(|[x, _]| x.is_multiple_of(2)),
        }
    }
}

/// A form of the sag with its numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Freeform<R> {
    /// The kind.
    pub kind: FreeformKind,
    /// The numbers, in the order and the units of the kind.
    pub numbers: Vec<R>,
}

impl<R: Real> Freeform<R> {
    /// The same form with each number mapped by `f`.
    pub fn map<S: Real>(&self, f: impl Fn(R) -> S) -> Freeform<S> {
        Freeform { kind: self.kind, numbers: self.numbers.iter().map(|a| f(*a)).collect() }
    }

    /// The same form with its sag multiplied by `turn`, which is 1 or −1.
    #[must_use]
    pub fn with_sag_sign(&self, turn: R) -> Self {
        let sign = |k: usize, a: R| if self.kind.has_sign(k) { turn * a } else { a };
        let numbers = self.numbers.iter().enumerate().map(|(k, a)| sign(k, *a)).collect();
        Self { kind: self.kind, numbers }
    }

    /// True if the sag is the same at x and at −x.
    pub fn mirrors_in_x(&self) -> bool {
        let mut odd = (0..self.numbers.len()).filter(|k| !self.kind.is_even_in_x(*k));
        odd.all(|k| self.numbers[k].value() == 0.0)
    }

    /// The base with the numbers of a conic and its even powers.
    pub fn base(&self, shape: &Shape<R>) -> BaseSag<R> {
        let (curvature, conic, terms) = shape.numbers();
        self.base_of(curvature, conic, terms)
    }

    /// The base with these numbers of the row.
    pub fn base_of(&self, curvature: R, conic: R, terms: [R; ASPHERE_TERMS]) -> BaseSag<R> {
        let mut own = [R::ZERO; BASE_NUMBERS];
        if self.kind.has_own_base() {
            own.iter_mut().zip(&self.numbers).for_each(|(to, from)| *to = *from);
        }
        BaseSag { kind: self.kind, curvature, conic, terms, own }
    }

    /// The numbers of the series in the sag.
    fn series_numbers(&self) -> &[R] {
        if self.kind.has_own_base() || self.kind.is_phase() { &[] } else { &self.numbers }
    }

    /// The sag of the series in mm, and its derivatives by x and y. `number` makes a coefficient a
    /// number of the arithmetic.
    pub fn series_sag<N: Arithmetic>(
        &self,
        base: &BaseSag<N>,
        x: N,
        y: N,
        number: impl Fn(R) -> N,
    ) -> [N; 3] {
        let mut sum = [N::constant(0.0); 3];
        self.visit_series(base, x, y, |k, term| {
            let a = number(self.numbers[k]);
            sum = std::array::from_fn(|i| sum[i] + a * term[i]);
        });
        sum
    }

    /// Calls `visit` with each number of the series in the sag and the function that it multiplies, with
    /// its derivatives by x and y.
    pub fn visit_series<N: Arithmetic>(
        &self,
        base: &BaseSag<N>,
        x: N,
        y: N,
        mut visit: impl FnMut(usize, [N; 3]),
    ) {
        let count = self.series_numbers().len();
        let Some([f, fx, fy]) = base.series_factor(x, y) else {
            return series::visit(self.kind, count, x, y, visit);
        };
        series::visit(self.kind, count, x, y, |k, [t, tx, ty]| {
            visit(k, [f * t, fx * t + f * tx, fy * t + f * ty]);
        });
    }

    /// The phase in radians of the first order, and its derivatives by x and y in mm; zero for a form
    /// that adds to the sag.
    pub fn phase(&self, x: R, y: R) -> [R; 3] {
        let mut sum = [R::ZERO; 3];
        self.visit_phase(x, y, |k, term| {
            let a = self.numbers[k];
            sum = std::array::from_fn(|i| sum[i] + a * term[i]);
        });
        sum
    }

    /// Calls `visit` with each number of the phase and the function that it multiplies, with its
    /// derivatives by x and y.
    pub fn visit_phase(&self, x: R, y: R, visit: impl FnMut(usize, [R; 3])) {
        let count = if self.kind.is_phase() { self.numbers.len() } else { 0 };
        series::visit(self.kind, count, x, y, visit);
    }

    /// The second derivatives of [`Freeform::phase`] at a point: by x and x, x and y, y and y.
    pub fn phase_bends(&self, x: R, y: R) -> [R; 3] {
        let at = |value, direction| Dual::<R, 2>::variable(value, direction);
        let [_, by_x, by_y] = self.map(Dual::<R, 2>::constant).phase(at(x, 0), at(y, 1));
        [by_x.slope[0], by_x.slope[1], by_y.slope[1]]
    }

    /// The sag in mm on a base, and its derivatives by x and y; NaN where the base does not exist.
    pub fn sag(&self, base: &BaseSag<R>, x: R, y: R) -> [R; 3] {
        let (own, series) = (base.sag(x, y), self.series_sag(base, x, y, |a| a));
        std::array::from_fn(|i| own[i] + series[i])
    }

    /// The curvatures of the sections with the x-z and the y-z plane at the vertex, in 1/mm. The tip
    /// of a cone counts as a plane.
    pub fn vertex_curvatures(&self, shape: &Shape<R>) -> [R; 2] {
        let constant = Dual::<R, 2>::constant;
        let form = self.map(constant);
        let base = self.base(shape).map(constant);
        let at = |direction| Dual::variable(R::ZERO, direction);
        let [_, by_x, by_y] = form.sag(&base, at(0), at(1));
        [by_x.slope[0], by_y.slope[1]]
    }
}

impl Freeform<f64> {
    /// The same form with every length multiplied by `factor`.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        let scale = |(k, a): (usize, &f64)| a * factor.powi(self.kind.power(k));
        let numbers = self.numbers.iter().enumerate().map(scale).collect();
        Self { kind: self.kind.scaled(factor), numbers }
    }

    /// The same form with its lengths in mm, given in a unit of `unit` mm. Unlike a lens that is scaled, a
    /// phase remains what it is.
    #[must_use]
    pub fn in_mm(&self, unit: f64) -> Self {
        if self.kind.is_phase() {
            return Self { kind: self.kind.scaled(unit), numbers: self.numbers.clone() };
        }
        self.scaled(unit)
    }

    /// The sag in mm of the section with the y-z plane; beyond the edge of the base that at the
    /// edge.
    pub fn section_sag(&self, shape: &Shape<f64>, y: f64) -> f64 {
        let sag = |y: f64| self.sag(&self.base(shape), 0.0, y)[0];
        let found = sag(y);
        if found.is_finite() {
            return found;
        }
        let (mut inside, mut outside) = (0.0, y);
        for _ in 0..60 {
            let middle = 0.5 * (inside + outside);
            let end = if sag(middle).is_finite() { &mut inside } else { &mut outside };
            *end = middle;
        }
        Some(sag(inside)).filter(|z| z.is_finite()).unwrap_or(0.0)
    }

    /// The fault of the numbers, as the rest of a sentence; `None` if there is none.
    pub fn fault(&self) -> Option<String> {
        let ([least, most], found) = (self.kind.counts(), self.numbers.len());
        let name = self.kind.name();
        if found < least || found > most {
            return Some(format!("the {name} has {found} numbers; expected {least} to {most}"));
        }
        if let Some(length) = self.kind.lengths().into_iter().find(|l| !(*l > 0.0 && *l < 1e50)) {
            return Some(format!("the {name} is normalised to {length} mm; expected more than 0"));
        }
        if let Some(order) = self.kind.order().filter(|order| !(order.abs() <= 1e9)) {
            return Some(format!("the order of the {name} is {order}; expected a finite one"));
        }
        let wrong = self.numbers.iter().position(|a| !(a.abs() <= 1e100))?;
        let (number, found) = (wrong + 1, self.numbers[wrong]);
        Some(format!("number {number} of the {name} is {found}; expected a finite one"))
    }
}
