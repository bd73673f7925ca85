//! The minimum of a quadratic function of few variables within a box.

use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};

/// A convex quadratic function `½ (y − c)' K (y − c)` of variables `y` in a box; the centre `c` differs
/// from use to use.
#[derive(Debug, Clone, PartialEq)]
pub struct BoxedQuadratic {
    /// The matrix `K`, positive semidefinite.
    matrix: DMatrix<f64>,
    /// The range of each variable.
    ranges: Vec<[f64; 2]>,
}

/// A share that is added to the diagonal of the matrix: variables that do the same to the function
/// then share the work.
const RIDGE: f64 = 1e-10;
/// An eigenvalue of the matrix, scaled to a diagonal of ones, below this is zero.
const SINGULAR: f64 = 1e-9;
/// A derivative of the function in scaled variables below this share of the largest is zero.
const FLAT: f64 = 1e-9;

impl BoxedQuadratic {
    /// A function with this matrix, and the range of each variable.
    pub fn new(matrix: DMatrix<f64>, ranges: Vec<[f64; 2]>) -> Self {
        Self { matrix, ranges }
    }

    /// True if the range of a variable has an end.
    pub fn is_bounded(&self) -> bool {
        self.ranges.iter().flatten().any(|end| end.is_finite())
    }

    /// The value at variables, for a centre.
    pub fn value(&self, variables: &[f64], center: &[f64]) -> f64 {
        let offsets: Vec<f64> = variables.iter().zip(center).map(|(y, c)| y - c).collect();
        let row = |i: usize| -> f64 {
            offsets.iter().enumerate().map(|(j, offset)| self.matrix[(i, j)] * offset).sum()
        };
        0.5 * offsets.iter().enumerate().map(|(i, offset)| offset * row(i)).sum::<f64>()
    }

    /// True if variables lie in the box.
    pub fn holds(&self, variables: &[f64]) -> bool {
        let inside = |(y, [low, high]): (&f64, &[f64; 2])| *low <= *y && *y <= *high;
        variables.iter().zip(&self.ranges).all(inside)
    }

    /// The variables in the box at which the function with this centre is least: by an active set, one
    /// bound at a time.
    pub fn minimum(&self, center: &[f64]) -> Vec<f64> {
        if self.holds(center) {
            return center.to_vec();
        }
        let clamped = center.iter().zip(&self.ranges).map(|(c, [low, high])| c.clamp(*low, *high));
        let mut y: Vec<f64> = clamped.collect();
        if y.len() == 1 {
            return y;
        }
        let mut held: Vec<bool> =
            y.iter().zip(&self.ranges).map(|(y, [low, high])| y <= low || y >= high).collect();
        for _ in 0..8 * (y.len() + 1) {
            if self.step_to_bound(&mut y, center, &mut held) {
                continue;
            }
            match self.bound_to_leave(&y, center, &held) {
                Some(free) => held[free] = false,
                None => break,
            }
        }
        y
    }

    /// Takes the free variables to their minimum, or to the first bound on the way, which is then held;
    /// true for the latter.
    fn step_to_bound(&self, y: &mut [f64], center: &[f64], held: &mut [bool]) -> bool {
        let free: Vec<usize> = (0..y.len()).filter(|i| !held[*i]).collect();
        let slope = self.slope(y, center);
        let part = DMatrix::from_fn(free.len(), free.len(), |i, j| {
            let ridge = if i == j { 1.0 + RIDGE } else { 1.0 };
            ridge * self.matrix[(free[i], free[j])]
        });
        let right = DVector::from_iterator(free.len(), free.iter().map(|i| -slope[*i]));
        let Some(factor) = Cholesky::new(part) else {
            // A variable that does nothing stays where it is.
            free.iter().filter(|i| self.matrix[(**i, **i)] <= 0.0).for_each(|i| held[*i] = true);
            return free.iter().any(|i| held[*i]);
        };
        let step = factor.solve(&right);
        let reach = |(i, step): (&usize, &f64)| {
            let [low, high] = self.ranges[*i];
            let bound = if *step > 0.0 { high } else { low };
            (*i, if *step == 0.0 { f64::INFINITY } else { (bound - y[*i]) / step })
        };
        let first = free.iter().zip(step.iter()).map(reach).min_by(|a, b| a.1.total_cmp(&b.1));
        let stopped = first.filter(|(_, share)| *share < 1.0);
        let share = stopped.map_or(1.0, |(_, share)| share.max(0.0));
        for (i, step) in free.iter().zip(step.iter()) {
            y[*i] = (y[*i] + share * step).clamp(self.ranges[*i][0], self.ranges[*i][1]);
        }
        if let Some((i, _)) = stopped {
            let [low, high] = self.ranges[i];
            y[i] = if (y[i] - low).abs() < (high - y[i]).abs() { low } else { high };
            held[i] = true;
        }
        stopped.is_some()
    }

    /// The held variable whose motion into the box lowers the function most.
    fn bound_to_leave(&self, y: &[f64], center: &[f64], held: &[bool]) -> Option<usize> {
        let slope = self.slope(y, center);
        let scaled = |i: usize| slope[i] / self.matrix[(i, i)].sqrt().max(f64::MIN_POSITIVE);
        let all = (0..y.len()).filter(|i| self.matrix[(*i, *i)] > 0.0);
        let largest = all.map(|i| scaled(i).abs()).fold(0.0, f64::max);
        let gain = |i: usize| {
            let [low, high] = self.ranges[i];
            let inwards = if y[i] <= low { -scaled(i) } else { scaled(i) };
            (held[i] && low < high && self.matrix[(i, i)] > 0.0 && inwards > FLAT * largest)
                .then_some((i, inwards))
        };
        let found = (0..y.len()).filter_map(gain).max_by(|a, b| a.1.total_cmp(&b.1));
        found.map(|(i, _)| i)
    }

    fn slope(&self, y: &[f64], center: &[f64]) -> Vec<f64> {
        let row = |i: usize| (0..y.len()).map(|j| self.matrix[(i, j)] * (y[j] - center[j])).sum();
        (0..y.len()).map(row).collect()
    }
}

/// The pseudoinverse of a positive semidefinite matrix with variables of different units: directions
/// that change nothing, to rounding, stay as they are.
pub fn scaled_pseudoinverse(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let unit = |i: usize| {
        let own = matrix[(i, i)];
        if own > 0.0 { 1.0 / own.sqrt() } else { 0.0 }
    };
    let count = matrix.nrows();
    let scaled = DMatrix::from_fn(count, count, |i, j| unit(i) * matrix[(i, j)] * unit(j));
    let SymmetricEigen { eigenvectors, eigenvalues } = SymmetricEigen::new(scaled);
    let inverse = |m: usize| if eigenvalues[m] > SINGULAR { 1.0 / eigenvalues[m] } else { 0.0 };
    DMatrix::from_fn(count, count, |i, j| {
        let sum = (0..count).map(|m| eigenvectors[(i, m)] * inverse(m) * eigenvectors[(j, m)]);
        unit(i) * sum.sum::<f64>() * unit(j)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn function(entries: &[f64], ranges: &[[f64; 2]]) -> BoxedQuadratic {
        let count = ranges.len();
        BoxedQuadratic::new(DMatrix::from_row_slice(count, count, entries), ranges.to_vec())
    }

    /// The least value over a fine grid of the box.
    fn least_on_grid(f: &BoxedQuadratic, center: &[f64]) -> f64 {
        let at = |range: [f64; 2], i: usize| range[0] + (range[1] - range[0]) * i as f64 / 60.0;
        let mut least = f64::INFINITY;
        for i in 0..61 * 61 * 61 {
            let steps = [i % 61, i / 61 % 61, i / 3721];
            let y: Vec<f64> = f.ranges.iter().zip(steps).map(|(r, s)| at(*r, s)).collect();
            least = least.min(f.value(&y, center));
        }
        least
    }

    #[test]
    fn the_minimum_in_a_box_is_not_above_any_point_of_it() {
        let matrix = [4.0, 3.0, 1.0, 3.0, 5.0, -2.0, 1.0, -2.0, 3.0];
        let f = function(&matrix, &[[-1.0, 1.0], [-0.5, 0.5], [-2.0, 0.25]]);
        for center in [[2.0, -2.0, 0.0], [0.2, 0.6, 3.0], [-4.0, 4.0, -4.0], [0.9, 0.0, 0.3]] {
            let found = f.minimum(&center);
            assert!(f.holds(&found));
            let (value, least) = (f.value(&found, &center), least_on_grid(&f, &center));
            assert!(value <= least * (1.0 + 1e-9), "{center:?}: {value} {least}");
        }
        assert_eq!(f.minimum(&[0.1, 0.2, 0.2]), [0.1, 0.2, 0.2]);
    }

    /// Two variables that do the same, one of which has little room, and one that does nothing.
    #[test]
    fn a_variable_takes_over_where_its_twin_has_no_room() {
        let matrix = [1.0, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0];
        let f = function(&matrix, &[[-0.1, 0.1], [-5.0, 5.0], [-1.0, 1.0]]);
        let center = [1.0, 1.0, 3.0];
        let found = f.minimum(&center);
        assert!(f.holds(&found) && f.value(&found, &center) < 1e-9, "{found:?}");
        let none = function(&matrix, &[[0.0, 0.0], [0.0, 0.0], [0.0, 0.0]]);
        assert_eq!(none.minimum(&center), [0.0; 3]);
        let inverse = scaled_pseudoinverse(&f.matrix);
        let again = &f.matrix * &inverse * &f.matrix;
        assert!((again - &f.matrix).amax() < 1e-12);
    }
}
