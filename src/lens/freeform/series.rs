//! The series that a form adds to its base: functions of x and y with their derivatives.

use super::FreeformKind;
use crate::math::Arithmetic;

/// The number of powers from 0 to the largest degree of a polynomial in x and y.
const POWERS: usize = 13;

/// Calls `visit` with the index of each of the first `count` terms of a series, the term at a point,
/// and its derivatives by x and y in mm.
pub(super) fn visit<N: Arithmetic>(
    kind: FreeformKind,
    count: usize,
    x: N,
    y: N,
    visit: impl FnMut(usize, [N; 3]),
) {
    match kind {
        FreeformKind::Biconic | FreeformKind::Toroid => {}
        FreeformKind::OddAsphere => visit_odd(count, x, y, visit),
        FreeformKind::QCon { radius } => visit_strong(radius, count, (x, y), visit),
        FreeformKind::QBfs { radius } => visit_mild(radius, count, (x, y), visit),
        FreeformKind::RadialPhase { radius, .. } => visit_even(radius, count, (x, y), visit),
        FreeformKind::XyPolynomial { radius } | FreeformKind::XyPhase { radius, .. } => {
            let (x, y) = (PowerTable::monomials(x, radius), PowerTable::monomials(y, radius));
            visit_products((&x, &y), 1, count, visit);
        }
        FreeformKind::Chebyshev { half_widths: [across, along] } => {
            let (x, y) = (PowerTable::chebyshev(x, across), PowerTable::chebyshev(y, along));
            visit_products((&x, &y), 0, count, visit);
        }
        FreeformKind::Zernike { radius } => visit_zernike(noll, radius, count, (x, y), visit),
        FreeformKind::FringeZernike { radius } => {
            visit_zernike(fringe, radius, count, (x, y), visit);
        }
    }
}

/// The powers of the distance from the axis from the first on.
fn visit_odd<N: Arithmetic>(count: usize, x: N, y: N, mut visit: impl FnMut(usize, [N; 3])) {
    let r = N::length(x, y);
    let r2 = x.square() + y.square();
    // The powers k − 2 and k − 1.
    let (mut before, mut last) = (N::constant(0.0), N::constant(1.0));
    for k in 1..=count {
        let power = if k == 1 { r } else { before * r2 };
        let slopes = if k == 1 {
            [N::cosine(x, r), N::cosine(y, r)]
        } else {
            let slope = N::constant(k as f64) * before;
            [slope * x, slope * y]
        };
        visit(k - 1, [power, slopes[0], slopes[1]]);
        (before, last) = (last, power);
    }
}

/// A polynomial in `t = (r/R)²` with its derivative by t.
#[derive(Clone, Copy)]
struct RadialTerm<N> {
    value: N,
    slope: N,
}

/// `t = (r/R)²` at a point, and its derivatives by x and y.
struct RadialArgument<N> {
    t: N,
    slopes: [N; 2],
}

impl<N: Arithmetic> RadialArgument<N> {
    fn new(radius: f64, (x, y): (N, N)) -> Self {
        let inverse = N::constant(1.0 / radius);
        let (u, v) = (x * inverse, y * inverse);
        let twice = inverse + inverse;
        Self { t: u.square() + v.square(), slopes: [twice * u, twice * v] }
    }

    /// The function of x and y that a polynomial in t is, with its derivatives.
    fn term(&self, of: RadialTerm<N>) -> [N; 3] {
        [of.value, of.slope * self.slopes[0], of.slope * self.slopes[1]]
    }
}

/// The even powers of r/R from the second on.
fn visit_even<N: Arithmetic>(
    radius: f64,
    count: usize,
    point: (N, N),
    mut visit: impl FnMut(usize, [N; 3]),
) {
    let at = RadialArgument::new(radius, point);
    let mut before = N::constant(1.0);
    for k in 0..count {
        let slope = N::constant((k + 1) as f64) * before;
        before = before * at.t;
        visit(k, at.term(RadialTerm { value: before, slope }));
    }
}

/// `t² Qₘ(t)` with the Jacobi polynomials `Qₘ(t) = P_m^(0,4)(2t − 1)`, by their recurrence (Abramowitz and
/// Stegun, eq. 22.7.1).
fn visit_strong<N: Arithmetic>(
    radius: f64,
    count: usize,
    point: (N, N),
    mut visit: impl FnMut(usize, [N; 3]),
) {
    let at = RadialArgument::new(radius, point);
    let (t, twice) = (at.t, N::constant(2.0));
    let z = twice * t - N::constant(1.0);
    let zero = N::constant(0.0);
    let mut last = RadialTerm { value: N::constant(1.0), slope: zero };
    let mut before = RadialTerm { value: zero, slope: zero };
    for m in 0..count {
        if m > 0 {
            let n = m as f64;
            let scale = 2.0 * n * (n + 4.0) * (2.0 * n + 2.0);
            let linear = (2.0 * n + 3.0) * (2.0 * n + 4.0) * (2.0 * n + 2.0) / scale;
            let fixed = N::constant(-16.0 * (2.0 * n + 3.0) / scale);
            let second = N::constant(2.0 * (n - 1.0) * (n + 3.0) * (2.0 * n + 4.0) / scale);
            let factor = N::constant(linear) * z + fixed;
            let by_t = N::constant(2.0 * linear);
            let value = factor * last.value - second * before.value;
            let slope = factor * last.slope + by_t * last.value - second * before.slope;
            (before, last) = (last, RadialTerm { value, slope });
        }
        let square = t.square();
        let slope = twice * t * last.value + square * last.slope;
        visit(m, at.term(RadialTerm { value: square * last.value, slope }));
    }
}

/// `t (1 − t) Qₘ(t)` by the recurrences of Forbes, Optics Express 18, 13851, 2010, eqs. A.14 to A.16:
/// `Q` is made of polynomials P by steps f, g and h that orthogonalise their slopes.
fn visit_mild<N: Arithmetic>(
    radius: f64,
    count: usize,
    point: (N, N),
    mut visit: impl FnMut(usize, [N; 3]),
) {
    let at = RadialArgument::new(radius, point);
    let t = at.t;
    let number = N::constant;
    let zero = RadialTerm { value: number(0.0), slope: number(0.0) };
    let (mut p, mut p_before) = (RadialTerm { value: number(2.0), ..zero }, zero);
    let (mut q, mut q_before) = (RadialTerm { value: number(1.0), ..zero }, zero);
    let (mut f, mut f_before, mut g) = (2.0_f64, 0.0, 0.0);
    for m in 0..count {
        if m > 0 {
            let n = m as f64;
            let next = if m == 1 {
                RadialTerm { value: number(6.0) - number(8.0) * t, slope: number(-8.0) }
            } else {
                let factor = number(2.0) - number(4.0) * t;
                RadialTerm {
                    value: factor * p.value - p_before.value,
                    slope: factor * p.slope - number(4.0) * p.value - p_before.slope,
                }
            };
            (p, p_before) = (next, p);
            let h = if m == 1 { 0.0 } else { -n * (n - 1.0) / (2.0 * f_before) };
            g = if m == 1 { -0.5 } else { -(1.0 + g * h) / f };
            let square = if m == 1 { 4.75 } else { n * (n + 1.0) + 3.0 - g * g - h * h };
            (f, f_before) = (square.sqrt(), f);
            let [inverse, by_q, by_before] = [1.0 / f, g / f, h / f].map(number);
            let step = |p: N, q: N, before: N| p * inverse - by_q * q - by_before * before;
            let value = step(p.value, q.value, q_before.value);
            let slope = step(p.slope, q.slope, q_before.slope);
            (q, q_before) = (RadialTerm { value, slope }, q);
        }
        let rest = number(1.0) - t;
        let slope = (rest - t) * q.value + t * rest * q.slope;
        visit(m, at.term(RadialTerm { value: t * rest * q.value, slope }));
    }
}

/// The exponents of x and y of a term of the order 1, x, y, x², xy, y², …
pub(super) fn powers(number: usize) -> [usize; 2] {
    let (mut degree, mut first) = (0, 0);
    while first + degree < number {
        first += degree + 1;
        degree += 1;
    }
    [degree - (number - first), number - first]
}

/// The polynomials of one coordinate, degree by degree, with their derivatives by it in mm.
struct PowerTable<N> {
    values: [N; POWERS],
    slopes: [N; POWERS],
}

impl<N: Arithmetic> PowerTable<N> {
    fn monomials(x: N, unit: f64) -> Self {
        let inverse = N::constant(1.0 / unit);
        let u = x * inverse;
        let mut values = [N::constant(1.0); POWERS];
        for n in 1..POWERS {
            // The bounds of an even power are those of a square.
            values[n] =
                if n.is_multiple_of(2) { values[n / 2].square() } else { values[n - 1] * u };
        }
        let slope = |n: usize| N::constant(n as f64) * values[n.saturating_sub(1)] * inverse;
        let slopes = std::array::from_fn(slope);
        Self { values, slopes }
    }

    /// `T'_n = n U_(n−1)`; both follow `P_(n+1) = 2 u P_n − P_(n−1)`.
    fn chebyshev(x: N, unit: f64) -> Self {
        let inverse = N::constant(1.0 / unit);
        let u = x * inverse;
        let mut values = [N::constant(1.0); POWERS];
        let mut second = [N::constant(1.0); POWERS];
        (values[1], second[1]) = (u, u + u);
        for n in 2..POWERS {
            values[n] = (u + u) * values[n - 1] - values[n - 2];
            second[n] = (u + u) * second[n - 1] - second[n - 2];
        }
        let slope = |n: usize| N::constant(n as f64) * second[n.saturating_sub(1)] * inverse;
        let slopes = std::array::from_fn(slope);
        Self { values, slopes }
    }
}

/// Products of polynomials in x and in y, in the order of [`powers`] from the term `first` on.
fn visit_products<N: Arithmetic>(
    (x, y): (&PowerTable<N>, &PowerTable<N>),
    first: usize,
    count: usize,
    mut visit: impl FnMut(usize, [N; 3]),
) {
    for k in 0..count {
        let [i, j] = powers(k + first);
        let value = x.values[i] * y.values[j];
        visit(k, [value, x.slopes[i] * y.values[j], x.values[i] * y.slopes[j]]);
    }
}

/// A Zernike polynomial: `factor R_n^m(ρ)` times the cosine or the sine of m φ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ZernikeTerm {
    n: usize,
    m: usize,
    sine: bool,
    factor: f64,
}

impl ZernikeTerm {
    pub(super) fn is_even_in_x(self) -> bool {
        self.m.is_multiple_of(2) != self.sine
    }

    /// `R_n^m(ρ)/ρ^m` and its derivative by `t = ρ²`, by the scheme of Horner.
    fn radial<N: Arithmetic>(self, t: N) -> [N; 2] {
        let (sum, difference) = (usize::midpoint(self.n, self.m), (self.n - self.m) / 2);
        let mut coefficient =
            (0..difference).fold(1.0, |product, i| product * (self.n - i) as f64 / (i + 1) as f64);
        let (mut value, mut slope) = (N::constant(0.0), N::constant(0.0));
        for s in 0..=difference {
            slope = slope * t + value;
            value = value * t + N::constant(coefficient);
            let next =
                -(((sum - s) * (difference - s)) as f64) / ((s + 1) * (self.n - s).max(1)) as f64;
            coefficient *= next;
        }
        [value, slope]
    }
}

/// The polynomial with an index, from 0, in the order of Noll.
pub(super) fn noll(index: usize) -> ZernikeTerm {
    let (mut n, mut rest) = (0, index);
    while rest > n {
        n += 1;
        rest -= n;
    }
    let m = n % 2 + 2 * usize::midpoint(rest, (n + 1) % 2);
    let factor = if m == 0 { n + 1 } else { 2 * (n + 1) } as f64;
    // The first polynomial has the number 1, and even numbers have cosines.
    ZernikeTerm { n, m, sine: m > 0 && index.is_multiple_of(2), factor: factor.sqrt() }
}

/// The polynomial with an index, from 0, in the fringe order.
pub(super) fn fringe(index: usize) -> ZernikeTerm {
    if index == 36 {
        return ZernikeTerm { n: 12, m: 0, sine: false, factor: 1.0 };
    }
    let group = index.isqrt();
    let place = index - group * group;
    let m = group - place / 2;
    ZernikeTerm { n: 2 * group - m, m, sine: place % 2 == 1, factor: 1.0 }
}

/// The terms by `ρ^m cos(m φ)` and `ρ^m sin(m φ)`, the parts of `(u + i v)^m`: polynomials, whose
/// derivatives are m times those of the power below.
fn visit_zernike<N: Arithmetic>(
    term: fn(usize) -> ZernikeTerm,
    radius: f64,
    count: usize,
    (x, y): (N, N),
    mut visit: impl FnMut(usize, [N; 3]),
) {
    let inverse = N::constant(1.0 / radius);
    let (u, v) = (x * inverse, y * inverse);
    let t = u.square() + v.square();
    let mut waves = [[N::constant(1.0), N::constant(0.0)]; POWERS];
    for m in 1..POWERS {
        let [cosine, sine] = waves[m - 1];
        waves[m] = [u * cosine - v * sine, u * sine + v * cosine];
    }
    for k in 0..count {
        let term = term(k);
        let [value, slope] = term.radial(t);
        let order = N::constant(term.m as f64);
        let [cosine, sine] = waves[term.m.saturating_sub(1)];
        let (wave, by_u, by_v) = if term.sine {
            (waves[term.m][1], order * sine, order * cosine)
        } else {
            (waves[term.m][0], order * cosine, -(order * sine))
        };
        let twice = (slope + slope) * wave;
        let factor = N::constant(term.factor);
        let scale = factor * inverse;
        let slopes = [twice * u + value * by_u, twice * v + value * by_v];
        visit(k, [factor * value * wave, scale * slopes[0], scale * slopes[1]]);
    }
}
