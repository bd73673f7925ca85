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

    /// True if some variable may move up to an end of its range.
    pub fn has_stops(&self) -> bool {
        self.ranges.iter().any(|[low, high]| low < high && (low.is_finite() || high.is_finite()))
    }

    /// The same function without ends of ranges but for variables that have no range at all.
    #[must_use]
    pub fn without_stops(&self) -> Self {
        let free = |range: &[f64; 2]| {
            if range[0] < range[1] { [f64::NEG_INFINITY, f64::INFINITY] } else { *range }
        };
        Self { matrix: self.matrix.clone(), ranges: self.ranges.iter().map(free).collect() }
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

    /// The first and the second derivatives of the least value in the box by its centre: variables at an end of
    /// their range stay there, the others follow.
    pub fn derivatives_of_least(&self, center: &[f64]) -> (DVector<f64>, DMatrix<f64>) {
        let y = self.minimum(center);
        let first = DVector::from_iterator(y.len(), self.slope(&y, center).iter().map(|by| -by));
        let is_inside = self.holds(center);
        let is_held = |i: &usize| {
            let [low, high] = self.ranges[*i];
            low >= high || !is_inside && (y[*i] <= low || y[*i] >= high)
        };
        let (held, free): (Vec<usize>, Vec<usize>) = (0..y.len()).partition(is_held);
        let part = |rows: &[usize], columns: &[usize]| {
            DMatrix::from_fn(rows.len(), columns.len(), |i, j| self.matrix[(rows[i], columns[j])])
        };
        let both = part(&held, &free);
        let following = &both * scaled_pseudoinverse(&part(&free, &free)) * both.transpose();
        let own = part(&held, &held) - following;
        let mut second = DMatrix::zeros(y.len(), y.len());
        for (i, row) in held.iter().enumerate() {
            held.iter().enumerate().for_each(|(j, column)| second[(*row, *column)] = own[(i, j)]);
        }
        (first, second)
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
    if count == 0 {
        return matrix.clone();
    }
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

    /// Derivatives of the least value in boxes that hold one variable, both and none, by differences.
    #[test]
    fn derivatives_of_the_least_value_are_those_of_differences() {
        let matrix = DMatrix::from_row_slice(2, 2, &[2.0, 0.5, 0.5, 1.0]);
        let far = f64::INFINITY;
        for (ranges, center) in [
            ([[-1.0, 1.0], [-far, far]], [3.0, 0.2]),
            ([[-1.0, 1.0], [-1.0, 1.0]], [3.0, 2.5]),
            ([[-1.0, 1.0], [-1.0, 1.0]], [0.3, -0.2]),
            ([[0.0, 0.0], [-far, far]], [0.0, 0.4]),
            ([[0.0, 0.0], [0.0, 0.0]], [0.1, 0.4]),
        ] {
            let quadratic = BoxedQuadratic::new(matrix.clone(), ranges.to_vec());
            let least = |at: [f64; 2]| quadratic.value(&quadratic.minimum(&at), &at);
            let (first, second) = quadratic.derivatives_of_least(&center);
            let step = 1e-3;
            let moved = |i: usize, by: f64| {
                let mut at = center;
                at[i] += by;
                at
            };
            for i in 0..2 {
                let slope = (least(moved(i, step)) - least(moved(i, -step))) / (2.0 * step);
                assert!((first[i] - slope).abs() < 1e-9, "{ranges:?} {i}: {} {slope}", first[i]);
                let twice = least(moved(i, step)) + least(moved(i, -step)) - 2.0 * least(center);
                let curvature = twice / (step * step);
                assert!((second[(i, i)] - curvature).abs() < 1e-6, "{ranges:?} {i}: {second}");
            }
        }
    }

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
