//! Least-squares polynomials in the two direction cosines of a pupil.

use crate::math::{SimdWidth, dot, run_vectorized};

/// The largest total degree.
pub(super) const LARGEST_DEGREE: usize = 36;

/// The box that polynomials are normalized to, and their terms.
#[derive(Debug, Clone)]
pub(super) struct PolynomialBasis {
    center: [f64; 2],
    half: [f64; 2],
    degree: usize,
    /// True if only even powers of the first cosine occur.
    even: bool,
}

/// Two polynomials: the path difference in waves and the amplitude.
#[derive(Debug, Clone)]
pub(super) struct WavePolynomial {
    basis: PolynomialBasis,
    /// The terms of each, by rising total degree: the degrees in both cosines and the coefficient.
    terms: [Vec<([usize; 2], f64)>; 2],
}

/// Polynomials through numbers at the samples of a pupil by least squares, and the way back: derivatives by the
/// numbers from those by the coefficients.
#[derive(Debug, Clone)]
pub(super) struct SampleFit {
    /// The orthogonal columns, and the columns of the triangular matrix.
    columns: Vec<Vec<f64>>,
    triangle: Vec<Vec<f64>>,
    roots: Vec<f64>,
}

/// The Chebyshev polynomials of one cosine at some places, and their derivatives by it.
#[derive(Debug, Clone)]
pub(super) struct ChebyshevLanes {
    pub(super) values: Vec<Lanes>,
    pub(super) slopes: Vec<Lanes>,
}

/// A number of each of some places or columns that are computed together.
pub(super) type Lanes = [f64; LANES];
pub(super) const LANES: usize = 8;

/// A sample of a pupil: its cosines, the two values there, and its weight.
#[derive(Debug, Clone, Copy)]
pub(super) struct FitSample {
    pub(super) cosines: [f64; 2],
    pub(super) values: [f64; 2],
    pub(super) weight: f64,
}

/// A polynomial along columns, along each of which one coordinate is constant: a Chebyshev sum in the other
/// one.
#[derive(Debug)]
pub(super) struct ColumnPolynomials {
    /// The number of columns.
    columns: usize,
    /// The coefficients of one degree after the other, each for all columns.
    coefficients: Vec<f64>,
    /// The middle and half of the side of the box along the columns.
    side: [f64; 2],
    /// True if only even degrees are there.
    even: bool,
}

/// The largest number of columns that are computed together, and a number of each.
pub(super) const WIDTH: usize = 64;
pub(super) type Row = [f64; WIDTH];

impl ChebyshevLanes {
    pub(super) fn zero() -> Self {
        let zeros = vec![[0.0; LANES]; LARGEST_DEGREE + 1];
        Self { values: zeros.clone(), slopes: zeros }
    }
}

impl PolynomialBasis {
    /// The basis of the largest degree with at most `terms` terms over the box of some points.
    pub(super) fn new(points: impl Iterator<Item = [f64; 2]>, terms: usize, even: bool) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for p in points {
            low = [0, 1].map(|k| low[k].min(p[k]));
            high = [0, 1].map(|k| high[k].max(p[k]));
        }
        if even {
            low[0] = -high[0].abs().max(low[0].abs());
            high[0] = -low[0];
        }
        let center = [0, 1].map(|k| 0.5 * (low[k] + high[k]));
        let half = [0, 1].map(|k| (0.5 * (high[k] - low[k])).max(f64::MIN_POSITIVE));
        let with = |degree| Self { center, half, degree, even };
        let degree = (0..=LARGEST_DEGREE).rev().find(|degree| with(*degree).terms() <= terms);
        with(degree.unwrap_or(0))
    }

    /// The same of a degree.
    pub(super) fn of_degree(
        points: impl Iterator<Item = [f64; 2]>,
        degree: usize,
        even: bool,
    ) -> Self {
        Self { degree: degree.min(LARGEST_DEGREE), ..Self::new(points, 0, even) }
    }

    /// The Chebyshev polynomials of a coordinate at some places, with their derivatives; meant for [`run_vectorized`].
    #[inline(always)]
    pub(super) fn fill(&self, axis: usize, places: &Lanes, found: &mut ChebyshevLanes) {
        let inverse = 1.0 / self.half[axis];
        let twice = places.map(|place| 2.0 * inverse * (place - self.center[axis]));
        let ChebyshevLanes { values, slopes } = found;
        (values[0], slopes[0]) = ([1.0; LANES], [0.0; LANES]);
        (values[1], slopes[1]) = (twice.map(|v| 0.5 * v), [inverse; LANES]);
        for n in 2..=self.degree {
            for k in 0..LANES {
                values[n][k] = twice[k] * values[n - 1][k] - values[n - 2][k];
                slopes[n][k] = 2.0 * inverse * values[n - 1][k] + twice[k] * slopes[n - 1][k]
                    - slopes[n - 2][k];
            }
        }
    }

    /// The largest total degree.
    pub(super) fn degree(&self) -> usize {
        self.degree
    }

    /// True if only even powers of the first cosine occur.
    pub(super) fn is_even(&self) -> bool {
        self.even
    }

    /// The point of the box at fractions of its sides.
    pub(super) fn in_box(&self, cell: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|k| self.center[k] + self.half[k] * (2.0 * cell[k] - 1.0))
    }

    /// The degrees in both cosines of every term, by rising total degree.
    pub(super) fn degrees(&self) -> impl Iterator<Item = [usize; 2]> + use<> {
        let step = if self.even { 2 } else { 1 };
        (0..=self.degree).flat_map(move |n| (0..=n).step_by(step).map(move |i| [i, n - i]))
    }

    /// The number of terms up to the largest degree.
    fn terms(&self) -> usize {
        self.degrees().count()
    }

    /// The Chebyshev polynomials of both coordinates at a point.
    #[inline(always)]
    fn factors(&self, p: [f64; 2]) -> [[f64; LARGEST_DEGREE + 1]; 2] {
        [0, 1].map(|k| {
            let x = (p[k] - self.center[k]) / self.half[k];
            let mut factors = [0.0; LARGEST_DEGREE + 1];
            (factors[0], factors[1]) = (1.0, x);
            for i in 2..=self.degree {
                factors[i] = 2.0 * x * factors[i - 1] - factors[i - 2];
            }
            factors
        })
    }

    /// The polynomials nearest to some samples, each of the lowest degree that leaves an RMS below the
    /// one allowed, or else of the largest, with the RMS of what each leaves.
    pub(super) fn fit(
        self,
        samples: &[FitSample],
        allowed: [f64; 2],
    ) -> Option<(WavePolynomial, [f64; 2])> {
        let count = self.terms();
        if samples.len() < count {
            return None;
        }
        let roots: Vec<f64> = samples.iter().map(|sample| sample.weight.sqrt()).collect();
        let mut columns = vec![Vec::with_capacity(samples.len()); count + 2];
        let degrees: Vec<[usize; 2]> = self.degrees().collect();
        for (sample, root) in samples.iter().zip(&roots) {
            let [u, v] = self.factors(sample.cosines);
            let terms = degrees.iter().map(|[i, j]| u[*i] * v[*j]).chain(sample.values);
            columns.iter_mut().zip(terms).for_each(|(column, term)| column.push(root * term));
        }
        let triangle = orthogonalize(&mut columns);
        let total = samples.iter().map(|sample| sample.weight).sum::<f64>().sqrt();
        let solve = |k: usize| self.solve(&triangle, count + k, allowed[k] * total);
        let ((waves, left), (amplitude, rest)) = (solve(0)?, solve(1)?);
        let terms = [waves, amplitude].map(|list| degrees.iter().copied().zip(list).collect());
        Some((WavePolynomial { basis: self, terms }, [left / total, rest / total]))
    }

    /// The coefficients of a right-hand side, up to the lowest degree that leaves no more than allowed,
    /// and what they leave.
    fn solve(&self, triangle: &[Vec<f64>], right: usize, allowed: f64) -> Option<(Vec<f64>, f64)> {
        let parts = &triangle[right];
        let count = self.terms();
        let mut square =
            parts[parts.len() - 1].powi(2) + parts[count..right].iter().map(|v| v * v).sum::<f64>();
        let (mut used, mut left) = (count, square.sqrt());
        for degree in (0..self.degree).rev() {
            let fewer = Self { degree, ..self.clone() }.terms();
            square += parts[fewer..used].iter().map(|v| v * v).sum::<f64>();
            if square.sqrt() > allowed {
                break;
            }
            (used, left) = (fewer, square.sqrt());
        }
        let solution = back_substituted(triangle, &parts[..used]);
        solution.iter().all(|v| v.is_finite()).then_some((solution, left))
    }
}

/// Makes columns orthogonal to those before and of length 1; the columns of the triangular matrix that
/// they are products with. Right-hand sides among the last ones make it as accurate as Householder's
/// method (Björck, *Numerical Methods for Least Squares Problems*, 1996, section 2.4).
fn orthogonalize(columns: &mut [Vec<f64>]) -> Vec<Vec<f64>> {
    let mut triangle = Vec::with_capacity(columns.len());
    for k in 0..columns.len() {
        let (before, rest) = columns.split_at_mut(k);
        let column = &mut rest[0];
        let parts = run_vectorized(
            SimdWidth::detect(),
            #[inline(always)]
            || {
                let mut parts = Vec::with_capacity(k + 1);
                for other in before.iter() {
                    let part = dot(other, column);
                    column.iter_mut().zip(other).for_each(|(value, unit)| *value -= part * unit);
                    parts.push(part);
                }
                let length = dot(column, column).sqrt();
                column.iter_mut().for_each(|value| *value /= length);
                parts.push(length);
                parts
            },
        );
        triangle.push(parts);
    }
    triangle
}

impl SampleFit {
    /// The terms of a basis through samples, and the polynomials through the values of these; `None` for fewer
    /// samples than terms.
    pub(super) fn new(
        basis: &PolynomialBasis,
        samples: &[FitSample],
    ) -> Option<(Self, WavePolynomial)> {
        let degrees: Vec<[usize; 2]> = basis.degrees().collect();
        let count = degrees.len();
        if samples.len() < count {
            return None;
        }
        let roots: Vec<f64> = samples.iter().map(|sample| sample.weight.sqrt()).collect();
        let mut columns = vec![Vec::with_capacity(samples.len()); count + 2];
        for (sample, root) in samples.iter().zip(&roots) {
            let [u, v] = basis.factors(sample.cosines);
            let terms = degrees.iter().map(|[i, j]| u[*i] * v[*j]).chain(sample.values);
            columns.iter_mut().zip(terms).for_each(|(column, term)| column.push(root * term));
        }
        let mut triangle = orthogonalize(&mut columns);
        let solution = |k: usize| -> Vec<([usize; 2], f64)> {
            let parts = &triangle[count + k][..count];
            degrees.iter().copied().zip(back_substituted(&triangle, parts)).collect()
        };
        let polynomial = WavePolynomial { basis: basis.clone(), terms: [0, 1].map(solution) };
        columns.truncate(count);
        triangle.truncate(count);
        let is_finite = triangle.iter().flatten().all(|v| v.is_finite());
        is_finite.then_some((Self { columns, triangle, roots }, polynomial))
    }

    /// The number of terms.
    pub(super) fn terms(&self) -> usize {
        self.columns.len()
    }

    /// The derivatives by the numbers at the samples from those by the coefficients of their polynomial.
    pub(super) fn by_samples(&self, by_coefficient: &[f64]) -> Vec<f64> {
        let mut parts = by_coefficient.to_vec();
        for k in 0..parts.len() {
            let (known, row) = (&parts[..k], &self.triangle[k]);
            let rest: f64 = known.iter().zip(row).map(|(part, r)| part * r).sum();
            parts[k] = (parts[k] - rest) / row[k];
        }
        let mut by = vec![0.0; self.roots.len()];
        run_vectorized(
            SimdWidth::detect(),
            #[inline(always)]
            || {
                for (column, part) in self.columns.iter().zip(&parts) {
                    by.iter_mut().zip(column).for_each(|(by, unit)| *by += part * unit);
                }
                by.iter_mut().zip(&self.roots).for_each(|(by, root)| *by *= root);
            },
        );
        by
    }
}

/// The solution of a triangular system that is given by its columns.
fn back_substituted(triangle: &[Vec<f64>], right: &[f64]) -> Vec<f64> {
    let mut solution = right.to_vec();
    for k in (0..solution.len()).rev() {
        solution[k] /= triangle[k][k];
        let (known, value) = (&triangle[k], solution[k]);
        solution[..k].iter_mut().zip(known).for_each(|(part, r)| *part -= r * value);
    }
    solution
}

impl WavePolynomial {
    /// The terms of the path difference in waves and of the amplitude: the degrees in both cosines and the coefficient.
    pub(super) fn terms(&self) -> &[Vec<([usize; 2], f64)>; 2] {
        &self.terms
    }

    pub(super) fn basis(&self) -> &PolynomialBasis {
        &self.basis
    }

    /// The largest total degree of a term.
    pub(super) fn degree(&self) -> usize {
        let terms = self.terms.iter().flatten();
        terms.map(|([i, j], _)| i + j).max().unwrap_or(0)
    }

    /// The path difference in waves and the amplitude at a point.
    #[inline(always)]
    pub(super) fn at(&self, p: [f64; 2]) -> [f64; 2] {
        let [u, v] = self.basis.factors(p);
        self.terms.each_ref().map(|terms| terms.iter().map(|([i, j], c)| c * u[*i] * v[*j]).sum())
    }

    /// The weighted RMS of what the polynomials leave of some samples.
    pub(super) fn rest(&self, samples: &[FitSample]) -> [f64; 2] {
        let (mut squares, mut weight) = ([0.0; 2], 0.0);
        for sample in samples {
            let found = self.at(sample.cosines);
            for k in [0, 1] {
                squares[k] += sample.weight * (found[k] - sample.values[k]).powi(2);
            }
            weight += sample.weight;
        }
        squares.map(|square| if weight > 0.0 { (square / weight).sqrt() } else { 0.0 })
    }

    /// True if the polynomials are even in the first cosine.
    pub(super) fn is_even(&self) -> bool {
        self.basis.even
    }

    /// The path difference (0) or the amplitude (1) along columns at values `t` of the coordinate of an
    /// axis, x (0) or y (1).
    pub(super) fn columns(&self, part: usize, axis: usize, t: &[f64]) -> ColumnPolynomials {
        let (basis, along, count) = (&self.basis, 1 - axis, t.len());
        let even = basis.even && along == 0;
        let step = if even { 2 } else { 1 };
        let terms = &self.terms[part];
        let highest = |axis: usize| terms.iter().map(|(term, _)| term[axis]).max().unwrap_or(0);
        let mut factors = vec![1.0; count * (highest(axis) + 1).max(2)];
        let mut coefficients = vec![0.0; count * (highest(along) / step + 1)];
        let x = |t: f64| (t - basis.center[axis]) / basis.half[axis];
        factors[count..2 * count].iter_mut().zip(t).for_each(|(factor, t)| *factor = x(*t));
        run_vectorized(
            SimdWidth::detect(),
            #[inline(always)]
            || {
                for from in (2 * count..factors.len()).step_by(count) {
                    let (known, next) = factors.split_at_mut(from);
                    for k in 0..count {
                        next[k] = 2.0 * known[count + k] * known[from - count + k]
                            - known[from - 2 * count + k];
                    }
                }
                for (term, c) in terms {
                    let from = count * (term[along] / step);
                    let sums = &mut coefficients[from..from + count];
                    let factors = &factors[count * term[axis]..][..count];
                    sums.iter_mut().zip(factors).for_each(|(sum, factor)| *sum += c * factor);
                }
            },
        );
        ColumnPolynomials {
            columns: count,
            coefficients,
            side: [basis.center[along], basis.half[along]],
            even,
        }
    }
}

impl ColumnPolynomials {
    /// The difference from other polynomials of the same terms.
    pub(super) fn minus(mut self, other: &Self) -> Self {
        let pairs = self.coefficients.iter_mut().zip(&other.coefficients);
        pairs.for_each(|(value, other)| *value -= other);
        self
    }

    /// The values at one place of each of `count` columns from one on, by Clenshaw's recurrence; meant for
    /// [`run_vectorized`].
    #[inline(always)]
    pub(super) fn values(&self, from: usize, count: usize, places: &Row) -> Row {
        let count = count.min(WIDTH);
        let [middle, half] = self.side;
        let (mut twice, mut last, mut sums) = ([0.0; WIDTH], [0.0; WIDTH], [0.0; WIDTH]);
        for k in 0..count {
            let at = (places[k] - middle) / half;
            twice[k] = 2.0 * if self.even { 2.0 * at * at - 1.0 } else { at };
        }
        for row in self.coefficients[self.columns..].chunks_exact(self.columns).rev() {
            let row = &row[from..from + count];
            for k in 0..count {
                let next = row[k] - last[k] + twice[k] * sums[k];
                last[k] = sums[k];
                sums[k] = next;
            }
        }
        let row = &self.coefficients[from..from + count];
        for k in 0..count {
            sums[k] = row[k] - last[k] + 0.5 * twice[k] * sums[k];
        }
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_polynomials_leave_is_the_weighted_rms_of_the_rest() {
        let at = |i: usize| [0.1 * (0.37 * i as f64).sin(), 0.1 * (0.61 * i as f64).cos()];
        let sample = |i: usize, scale: f64| {
            let cosines = at(i);
            let values = [(40.0 * cosines[0]).sin() + cosines[1].abs(), 1.0 + cosines[0].powi(3)];
            FitSample { cosines, values, weight: scale * (1.0 + (i % 3) as f64) }
        };
        for scale in [1.0, 1e-3, 250.0] {
            let samples: Vec<FitSample> = (0..120).map(|i| sample(i, scale)).collect();
            let basis = PolynomialBasis::new((0..120).map(at), 15, false);
            let (found, left) = basis.fit(&samples, [0.0; 2]).unwrap();
            let total: f64 = samples.iter().map(|sample| sample.weight).sum();
            for k in [0, 1] {
                let square =
                    |s: &FitSample| s.weight * (s.values[k] - found.at(s.cosines)[k]).powi(2);
                let exact = (samples.iter().map(square).sum::<f64>() / total).sqrt();
                assert!((left[k] - exact).abs() < 1e-9, "{scale}: {left:?} {exact}");
                assert!(k == 1 || exact > 1e-4, "nothing is left: {exact}");
            }
        }
    }

    #[test]
    fn columns_have_the_values_of_the_polynomials() {
        let at = |i: usize| [0.1 * (0.37 * i as f64).sin(), 0.02 + 0.1 * (0.61 * i as f64).cos()];
        for even in [false, true] {
            let sample = |i: usize| {
                let [a, b] = at(i);
                let odd = if even { 0.0 } else { a.powi(3) };
                let values = [(30.0 * a).cos() * (20.0 * b).sin() + odd, 1.0 + b - a * a];
                FitSample { cosines: [a, b], values, weight: 1.0 }
            };
            let samples: Vec<FitSample> = (0..900).map(sample).collect();
            let basis = PolynomialBasis::new((0..900).map(at), 100, even);
            let (found, left) = basis.fit(&samples, [1e-4, 1e-12]).unwrap();
            assert!(left[0] < 1e-4 && left[1] < 1e-12, "{left:?}");
            assert!(found.terms[1].len() <= 6, "a polynomial of degree 2");
            let t = [-0.05, 0.0, 0.01, 0.07];
            let v = [0.01, -0.03, 0.06, 0.02];
            for (axis, part) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                let mut places = [0.0; WIDTH];
                places[..3].copy_from_slice(&v[1..]);
                let values = found.columns(part, axis, &t).values(1, 3, &places);
                let at = |k: usize| if axis == 0 { [t[k], v[k]] } else { [v[k], t[k]] };
                let is_exact = |k: usize| (values[k - 1] - found.at(at(k))[part]).abs() < 1e-13;
                assert!((1..4).all(is_exact), "{axis} {part}: {values:?}");
            }
        }
    }
}
