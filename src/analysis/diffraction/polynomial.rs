//! Least-squares polynomials in the two direction cosines of a pupil.

use nalgebra::{DMatrix, DVector};

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

/// Two polynomials of the same terms: the path difference in waves and the amplitude.
#[derive(Debug, Clone)]
pub(super) struct WavePolynomial {
    basis: PolynomialBasis,
    coefficients: Vec<[f64; 2]>,
}

/// A sample of a pupil: its cosines, the two values there, and its weight.
pub(super) struct FitSample {
    pub(super) cosines: [f64; 2],
    pub(super) values: [f64; 2],
    pub(super) weight: f64,
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

    /// The point of the box at fractions of its sides.
    pub(super) fn in_box(&self, cell: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|k| self.center[k] + self.half[k] * (2.0 * cell[k] - 1.0))
    }

    fn step(&self) -> usize {
        if self.even { 2 } else { 1 }
    }

    fn terms(&self) -> usize {
        (0..=self.degree).map(|j| (self.degree - j) / self.step() + 1).sum()
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

    /// All terms at a point.
    fn row(&self, p: [f64; 2]) -> Vec<f64> {
        let [u, v] = self.factors(p);
        let line = |j: usize| (0..=self.degree - j).step_by(self.step()).map(move |i| (i, j));
        (0..=self.degree).flat_map(line).map(|(i, j)| u[i] * v[j]).collect()
    }

    /// The polynomials nearest to some samples, and the RMS of what each leaves.
    pub(super) fn fit(self, samples: &[FitSample]) -> Option<(WavePolynomial, [f64; 2])> {
        let (rows, columns) = (samples.len(), self.terms());
        if rows < columns {
            return None;
        }
        let roots: Vec<f64> = samples.iter().map(|sample| sample.weight.sqrt()).collect();
        let mut matrix = DMatrix::zeros(rows, columns);
        for (i, (sample, root)) in samples.iter().zip(&roots).enumerate() {
            for (j, term) in self.row(sample.cosines).into_iter().enumerate() {
                matrix[(i, j)] = root * term;
            }
        }
        let right = |k: usize| {
            let scaled = samples.iter().zip(&roots).map(|(sample, root)| root * sample.values[k]);
            DVector::from_iterator(rows, scaled)
        };
        let weight: f64 = samples.iter().map(|sample| sample.weight).sum();
        let qr = matrix.qr();
        let r = qr.r();
        let solve = |k: usize| {
            let mut projected = right(k);
            qr.q_tr_mul(&mut projected);
            let rest = projected.rows(columns, rows - columns).norm_squared();
            let solution = r.solve_upper_triangular(&projected.rows(0, columns))?;
            Some((solution, (rest / weight).sqrt()))
        };
        let ((waves, first), (amplitude, second)) = (solve(0)?, solve(1)?);
        let coefficients = (0..columns).map(|i| [waves[i], amplitude[i]]).collect();
        Some((WavePolynomial { basis: self, coefficients }, [first, second]))
    }
}

impl WavePolynomial {
    /// The path difference in waves and the amplitude at a point.
    #[inline(always)]
    pub(super) fn at(&self, p: [f64; 2]) -> [f64; 2] {
        let [u, v] = self.basis.factors(p);
        let (degree, step) = (self.basis.degree, self.basis.step());
        let (mut sum, mut next) = ([0.0; 2], 0);
        for (j, v) in v.iter().enumerate().take(degree + 1) {
            let mut line = [0.0; 2];
            for u in u[..=degree - j].iter().step_by(step) {
                let c = self.coefficients[next];
                line = [line[0] + c[0] * u, line[1] + c[1] * u];
                next += 1;
            }
            sum = [sum[0] + line[0] * v, sum[1] + line[1] * v];
        }
        sum
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
            let (found, left) = basis.fit(&samples).unwrap();
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
}
