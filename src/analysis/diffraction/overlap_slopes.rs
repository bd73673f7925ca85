//! Derivatives of overlap integrals by the coefficients of polynomials, with vector instructions.
//!
//! A node asks of each term of a polynomial a number times a product of Chebyshev polynomials, one of either cosine.
//! Along a column one of them is constant, so that the sums over its nodes are those for each degree in the other
//! cosine, and every term takes from them once a column. Columns are computed together, a node of each at a time.
//!
//! Of a pupil that is its own mirror image the first cosine of a displacement is odd: it is written as a polynomial with
//! the terms of the even ones, times the first cosine.

use super::overlap::{Columns, Strip, rule};
use super::polynomial::{ChebyshevLanes, LANES, LARGEST_DEGREE, Lanes, WavePolynomial};
use super::pupil_function::TransferShift;
use crate::math::{SimdWidth, run_vectorized, sin_cos_turns};
use std::f64::consts::TAU;

/// Derivatives of a number by the coefficients of the path difference in waves, and by those of the displacement of
/// either cosine.
#[derive(Debug, Clone)]
pub(super) struct TermSlopes {
    pub(super) waves: Vec<f64>,
    pub(super) cosines: [Vec<f64>; 2],
}

/// A number for each degree along columns, for some columns.
type Line = Vec<Lanes>;

const ZERO: Lanes = [0.0; LANES];

/// One of two shifted pupils along some columns.
#[derive(Debug)]
struct PupilLines {
    /// The Chebyshev polynomials of the coordinate of the columns, and those of a node of each.
    across: ChebyshevLanes,
    along: ChebyshevLanes,
    /// The path difference and the amplitude along the columns, each followed by its derivative across them.
    light: [Line; 4],
    /// The sums that nodes ask of the terms: of the path difference, of the displacement across the columns and of its
    /// derivative, and of that along them.
    asked: [Line; 4],
}

/// The path difference and the amplitude at a node of each column, each with its derivatives across and along.
type NodeLight = [[Lanes; 3]; 2];

/// An overlap of two shifted pupils with the derivatives that it adds to.
#[derive(Debug)]
pub(super) struct OverlapSlopes<'p> {
    polynomial: &'p WavePolynomial,
    shift: TransferShift,
    /// The complex factor of the transfer in the number that is differentiated.
    factor: [f64; 2],
    pupils: [PupilLines; 2],
}

/// Some columns: each with its coordinate, its weight, its lower end and its length.
#[derive(Debug, Clone, Copy)]
struct ColumnLanes {
    t: Lanes,
    weight: Lanes,
    low: Lanes,
    length: Lanes,
}

impl TermSlopes {
    pub(super) fn zero(terms: usize) -> Self {
        Self { waves: vec![0.0; terms], cosines: [vec![0.0; terms], vec![0.0; terms]] }
    }
}

impl ColumnLanes {
    /// The columns from one on; those beyond the last one repeat it without a weight.
    fn of(columns: &Columns, from: usize, factor: f64) -> Self {
        let last = columns.t.len() - 1;
        let at = |k: usize| (from + k).min(last);
        let lanes = |of: &dyn Fn(usize) -> f64| std::array::from_fn(|k| of(at(k)));
        let length = lanes(&|i| columns.ends[1][i] - columns.ends[0][i]);
        let share =
            |k: usize| if from + k > last { 0.0 } else { factor * columns.weight[from + k] };
        Self {
            t: lanes(&|i| columns.t[i]),
            weight: std::array::from_fn(|k| share(k) * length[k]),
            low: lanes(&|i| columns.ends[0][i]),
            length,
        }
    }
}

impl PupilLines {
    fn new() -> Self {
        Self {
            across: ChebyshevLanes::zero(),
            along: ChebyshevLanes::zero(),
            light: [0; 4].map(|_| vec![ZERO; LARGEST_DEGREE + 1]),
            asked: [0; 4].map(|_| vec![ZERO; LARGEST_DEGREE + 1]),
        }
    }

    /// Begins columns at values of the coordinate of an axis.
    #[inline(always)]
    fn begin(&mut self, polynomial: &WavePolynomial, axis: usize, t: &Lanes) {
        let degree = polynomial.basis().degree();
        polynomial.basis().fill(axis, t, &mut self.across);
        for line in self.light.iter_mut().chain(&mut self.asked) {
            line[..=degree].fill(ZERO);
        }
        for (terms, part) in polynomial.terms().iter().zip([0, 2]) {
            for (term, c) in terms {
                let (i, j) = (term[axis], term[1 - axis]);
                for k in 0..LANES {
                    self.light[part][j][k] += c * self.across.values[i][k];
                    self.light[part + 1][j][k] += c * self.across.slopes[i][k];
                }
            }
        }
    }

    /// The light at the node whose polynomials along the columns are filled.
    #[inline(always)]
    fn at_node(&self, degrees: impl Iterator<Item = usize>) -> NodeLight {
        let mut found = [[ZERO; 3]; 2];
        for j in degrees {
            let (values, slopes) = (&self.along.values[j], &self.along.slopes[j]);
            for (part, sums) in found.iter_mut().enumerate() {
                let (line, by_t) = (&self.light[2 * part][j], &self.light[2 * part + 1][j]);
                for k in 0..LANES {
                    sums[0][k] += line[k] * values[k];
                    sums[1][k] += by_t[k] * values[k];
                    sums[2][k] += line[k] * slopes[k];
                }
            }
        }
        found
    }

    /// Adds what the node asks: of the path difference, of the displacement across and along the columns, and of the
    /// derivatives of both.
    #[inline(always)]
    fn ask(
        &mut self,
        degrees: impl Iterator<Item = usize>,
        [waves, across, divergence, along, along_slope]: [&Lanes; 5],
    ) {
        for j in degrees {
            let (values, slopes) = (&self.along.values[j], &self.along.slopes[j]);
            for k in 0..LANES {
                self.asked[0][j][k] += waves[k] * values[k];
                self.asked[1][j][k] += across[k] * values[k];
                self.asked[2][j][k] += divergence[k] * values[k];
                self.asked[3][j][k] += along[k] * values[k] + along_slope[k] * slopes[k];
            }
        }
    }

    /// Ends columns: every term takes what the nodes ask of its degree along them.
    #[inline(always)]
    fn end(&mut self, polynomial: &WavePolynomial, axis: usize, t: &Lanes, by: &mut TermSlopes) {
        let basis = polynomial.basis();
        if basis.is_even() && axis == 0 {
            let [_, across, divergence, _] = &mut self.asked;
            for (across, divergence) in
                across.iter_mut().zip(divergence.iter_mut()).take(basis.degree() + 1)
            {
                for k in 0..LANES {
                    across[k] = t[k] * across[k] + divergence[k];
                    divergence[k] *= t[k];
                }
            }
        }
        for (number, term) in basis.degrees().enumerate() {
            let (i, j) = (term[axis], term[1 - axis]);
            let (values, slopes) = (&self.across.values[i], &self.across.slopes[i]);
            let mut sums = [0.0; 3];
            for k in 0..LANES {
                sums[0] += values[k] * self.asked[0][j][k];
                sums[1] += values[k] * self.asked[1][j][k] + slopes[k] * self.asked[2][j][k];
                sums[2] += values[k] * self.asked[3][j][k];
            }
            by.waves[number] += sums[0];
            by.cosines[axis][number] += sums[1];
            by.cosines[1 - axis][number] += sums[2];
        }
    }
}

impl<'p> OverlapSlopes<'p> {
    pub(super) fn new(
        polynomial: &'p WavePolynomial,
        shift: TransferShift,
        factor: [f64; 2],
    ) -> Self {
        let pupils = [PupilLines::new(), PupilLines::new()];
        Self { polynomial, shift, factor, pupils }
    }

    /// Adds the integral over a strip that counts so many times, of so many columns and nodes of each.
    pub(super) fn add(
        &mut self,
        strip: &Strip<'_>,
        times: f64,
        counts: [usize; 2],
        by: &mut TermSlopes,
    ) {
        let columns = strip.columns(&rule(counts[0]));
        let along = rule(counts[1]);
        for from in (0..columns.t.len()).step_by(LANES) {
            let lanes = ColumnLanes::of(&columns, from, times);
            run_vectorized(
                SimdWidth::detect(),
                #[inline(always)]
                || self.add_columns(strip.axis, &lanes, &along, by),
            );
        }
    }

    #[inline(always)]
    fn add_columns(
        &mut self,
        axis: usize,
        columns: &ColumnLanes,
        along: &[(f64, f64)],
        by: &mut TermSlopes,
    ) {
        let across = self.shift.cosines[axis];
        let places = [across, -across].map(|off| columns.t.map(|t| t + off));
        for (pupil, t) in self.pupils.iter_mut().zip(&places) {
            pupil.begin(self.polynomial, axis, t);
        }
        for (share, weight) in along {
            self.add_node(axis, columns, (*share, *weight));
        }
        for (pupil, t) in self.pupils.iter_mut().zip(&places) {
            pupil.end(self.polynomial, axis, t, by);
        }
    }

    /// Adds a node of each column.
    #[inline(always)]
    fn add_node(&mut self, axis: usize, columns: &ColumnLanes, (share, weight): (f64, f64)) {
        let basis = self.polynomial.basis();
        let is_odd_along = basis.is_even() && axis == 1;
        let step = if is_odd_along { 2 } else { 1 };
        let degrees = || (0..=basis.degree()).step_by(step);
        let off = self.shift.cosines[1 - axis];
        let middle: Lanes = std::array::from_fn(|k| columns.low[k] + share * columns.length[k]);
        let v = [off, -off].map(|off| middle.map(|v| v + off));
        for (pupil, v) in self.pupils.iter_mut().zip(&v) {
            basis.fill(1 - axis, v, &mut pupil.along);
        }
        let [plus, minus] = self.pupils.each_ref().map(|pupil| pupil.at_node(degrees()));
        // The factor times the integrand, and minus its derivative by half of the divergence.
        let (mut re, mut im, mut divergence) = (ZERO, ZERO, ZERO);
        for k in 0..LANES {
            let (sin, cos) = sin_cos_turns(minus[0][0][k] - plus[0][0][k]);
            let size = columns.weight[k] * weight * plus[1][0][k] * minus[1][0][k];
            re[k] = size * (self.factor[0] * cos - self.factor[1] * sin);
            im[k] = TAU * size * (self.factor[0] * sin + self.factor[1] * cos);
            divergence[k] = -0.5 * re[k];
        }
        let pupils = self.pupils.iter_mut().zip([(1.0, &plus), (-1.0, &minus)]).zip(&v);
        for ((pupil, (sign, [waves, amplitude])), v) in pupils {
            let (mut by_waves, mut by_t, mut by_v, mut slope) = (ZERO, ZERO, ZERO, divergence);
            for k in 0..LANES {
                by_waves[k] = sign * im[k];
                // −Re(c ∂f/f) of the first factor, of the conjugate of the second.
                let relative = re[k] / amplitude[0][k];
                by_t[k] = -(relative * amplitude[1][k] + by_waves[k] * waves[1][k]);
                by_v[k] = -(relative * amplitude[2][k] + by_waves[k] * waves[2][k]);
                if is_odd_along {
                    by_v[k] = v[k] * by_v[k] + divergence[k];
                    slope[k] = v[k] * divergence[k];
                }
            }
            pupil.ask(degrees(), [&by_waves, &by_t, &divergence, &by_v, &slope]);
        }
    }
}

/// Some points of a pupil with their Chebyshev polynomials.
#[derive(Debug)]
pub(super) struct PupilPoints<'p> {
    polynomial: &'p WavePolynomial,
    factors: [ChebyshevLanes; 2],
}

impl<'p> PupilPoints<'p> {
    pub(super) fn new(polynomial: &'p WavePolynomial) -> Self {
        let factors = [ChebyshevLanes::zero(), ChebyshevLanes::zero()];
        Self { polynomial, factors }
    }

    /// The path differences in waves and the amplitudes at points that are given by their first and by their second
    /// cosines.
    pub(super) fn light_at(&mut self, places: &[Lanes; 2]) -> [Lanes; 2] {
        run_vectorized(
            SimdWidth::detect(),
            #[inline(always)]
            || {
                self.fill(places);
                self.polynomial.terms().each_ref().map(|terms| self.sum_of(terms))
            },
        )
    }

    /// Computes the polynomials at points.
    #[inline(always)]
    fn fill(&mut self, places: &[Lanes; 2]) {
        for ((axis, place), factors) in places.iter().enumerate().zip(&mut self.factors) {
            self.polynomial.basis().fill(axis, place, factors);
        }
    }

    /// The sum of some terms at the points.
    #[inline(always)]
    fn sum_of(&self, terms: &[([usize; 2], f64)]) -> Lanes {
        let [first, second] = &self.factors;
        let mut sum = ZERO;
        for ([i, j], c) in terms {
            let factors = first.values[*i].iter().zip(&second.values[*j]);
            sum.iter_mut().zip(factors).for_each(|(sum, (u, v))| *sum += c * u * v);
        }
        sum
    }

    /// Adds to the derivatives by the coefficients of the displacement those by the displacement of each of some
    /// points, given by their cosines.
    pub(super) fn add_displacements(
        &mut self,
        places: &[Lanes; 2],
        by_point: [Lanes; 2],
        by: &mut TermSlopes,
    ) {
        run_vectorized(
            SimdWidth::detect(),
            #[inline(always)]
            || self.fill(places),
        );
        let [first, second] = &self.factors;
        let basis = self.polynomial.basis();
        let [mut across, along] = by_point;
        if basis.is_even() {
            // The first Chebyshev polynomial times half of the width of the box is the cosine itself.
            let cosines = first.values[1].iter().zip(&first.slopes[1]);
            across.iter_mut().zip(cosines).for_each(|(by, (value, slope))| *by *= value / slope);
        }
        run_vectorized(
            SimdWidth::detect(),
            #[inline(always)]
            || {
                for (number, [i, j]) in basis.degrees().enumerate() {
                    let mut sums = [0.0; 2];
                    for k in 0..LANES {
                        let term = first.values[i][k] * second.values[j][k];
                        sums[0] += across[k] * term;
                        sums[1] += along[k] * term;
                    }
                    by.cosines[0][number] += sums[0];
                    by.cosines[1][number] += sums[1];
                }
            },
        );
    }
}
