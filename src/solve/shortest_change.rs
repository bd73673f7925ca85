//! The shortest change under linear limits: the limits that are broken are taken as equalities, and those
//! that the change would break are added, until all hold. This solves for a few limits without a quadratic
//! program; where limits depend on one another, or one would have to be released, nothing is returned.

use nalgebra::{DMatrix, DVector};

/// The number of times that limits are added.
const ROUNDS: usize = 8;
/// The share of the largest distance to a limit that is rounding.
const ROUNDING: f64 = 1e-12;
/// The pivot relative to that of an independent limit below which limits depend on one another.
const SMALLEST_PIVOT: f64 = 1e-4;

/// A limit of a change: `low ≤ direction · change ≤ high`, with a direction of length 1.
struct LinearLimit {
    direction: DVector<f64>,
    low: f64,
    high: f64,
}

impl LinearLimit {
    /// The distance of a change from the range of the limit, positive if it has to grow.
    fn distance(&self, change: &DVector<f64>) -> f64 {
        let value = self.direction.dot(change);
        (self.low - value).max(0.0) + (self.high - value).min(0.0)
    }

    fn is_equality(&self) -> bool {
        self.low == self.high
    }
}

/// A limit that is met as an equality.
struct ActiveLimit<'a> {
    limit: &'a LinearLimit,
    target: f64,
    /// The sign of the multiplier by which the limit holds the change back.
    sign: f64,
}

/// The shortest `x` with `bounds[i][0] ≤ rows[i] · x ≤ bounds[i][1]` and `room[j][0] ≤ x[j] ≤ room[j][1]`. Rows of
/// zeros are left out. `None` if this method does not find it; there may be one nevertheless.
pub(super) fn shortest_change(
    rows: &DMatrix<f64>,
    bounds: &[[f64; 2]],
    room: &[[f64; 2]],
) -> Option<DVector<f64>> {
    let limits = linear_limits(rows, bounds, room);
    let mut change = DVector::zeros(rows.ncols());
    let distances = limits.iter().map(|limit| limit.distance(&change).abs());
    let rounding = ROUNDING * distances.fold(0.0, f64::max);
    let mut active: Vec<ActiveLimit<'_>> = Vec::new();
    for _ in 0..ROUNDS {
        let before = active.len();
        for limit in &limits {
            let distance = limit.distance(&change);
            let is_active = active.iter().any(|one| std::ptr::eq(one.limit, limit));
            if distance.abs() > rounding && !is_active {
                let target = limit.direction.dot(&change) + distance;
                active.push(ActiveLimit { limit, target, sign: distance.signum() });
            }
        }
        if active.len() == before {
            return Some(change);
        }
        change = shortest_meeting(&active, rows.ncols())?;
    }
    None
}

fn linear_limits(rows: &DMatrix<f64>, bounds: &[[f64; 2]], room: &[[f64; 2]]) -> Vec<LinearLimit> {
    let count = rows.ncols();
    let of_row = |(row, [low, high]): (usize, &[f64; 2])| {
        let length = rows.row(row).norm();
        let direction = || rows.row(row).transpose() / length;
        (length > 0.0).then(|| LinearLimit {
            direction: direction(),
            low: low / length,
            high: high / length,
        })
    };
    let of_parameter = |(j, [low, high]): (usize, &[f64; 2])| {
        let direction = DVector::from_fn(count, |i, _| f64::from(u8::from(i == j)));
        LinearLimit { direction, low: *low, high: *high }
    };
    let by_rows = (0..).zip(bounds).filter_map(of_row);
    by_rows.chain((0..).zip(room).map(of_parameter)).collect()
}

/// The shortest change that meets limits as equalities; `None` if they depend on one another, or if a shorter
/// change would keep one of them without meeting it.
fn shortest_meeting(active: &[ActiveLimit<'_>], count: usize) -> Option<DVector<f64>> {
    let directions = DMatrix::from_fn(active.len(), count, |i, j| active[i].limit.direction[j]);
    let targets = DVector::from_iterator(active.len(), active.iter().map(|one| one.target));
    let factor = (&directions * directions.transpose()).cholesky()?;
    let smallest = factor.l_dirty().diagonal().min();
    if !(smallest > SMALLEST_PIVOT) {
        return None;
    }
    let multipliers = factor.solve(&targets);
    let holds = |(one, multiplier): (&ActiveLimit<'_>, &f64)| {
        one.limit.is_equality() || one.sign * multiplier >= 0.0
    };
    let is_shortest = active.iter().zip(multipliers.iter()).all(holds);
    is_shortest.then(|| directions.tr_mul(&multipliers))
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDE: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

    fn check(rows: &[[f64; 2]], bounds: &[[f64; 2]], room: [[f64; 2]; 2], expected: [f64; 2]) {
        let rows = DMatrix::from_fn(rows.len(), 2, |i, j| rows[i][j]);
        let found = shortest_change(&rows, bounds, &room).unwrap();
        let off = (found[0] - expected[0]).hypot(found[1] - expected[1]);
        assert!(off < 1e-12, "{found} {expected:?}");
    }

    #[test]
    fn broken_limits_are_met_by_the_shortest_change() {
        let sum = [[2.0, 2.0]];
        check(&sum, &[[4.0, f64::INFINITY]], [WIDE; 2], [1.0, 1.0]);
        check(&sum, &[[f64::NEG_INFINITY, -4.0]], [WIDE; 2], [-1.0, -1.0]);
        check(&sum, &[[-1.0, 1.0]], [WIDE; 2], [0.0, 0.0]);
        check(&[[0.0, 0.0], [0.0, 3.0]], &[[5.0, 5.0], [3.0, 3.0]], [WIDE; 2], [0.0, 1.0]);
    }

    /// Another limit, or a range, that the shortest change to the first limit would break is kept.
    #[test]
    fn limits_that_a_change_would_break_are_kept() {
        let rows = [[1.0, 1.0], [1.0, 0.0]];
        check(&rows, &[[2.0, f64::INFINITY], [f64::NEG_INFINITY, 0.5]], [WIDE; 2], [0.5, 1.5]);
        check(&rows[..1], &[[2.0, 2.0]], [[-1.0, 0.5], WIDE], [0.5, 1.5]);
    }

    #[test]
    fn limits_that_contradict_or_depend_on_one_another_are_left_to_others() {
        let twice = DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 1.0, 0.0]);
        let above = [1.0, f64::INFINITY];
        for bounds in [[above, [f64::NEG_INFINITY, 0.0]], [above, above]] {
            assert!(shortest_change(&twice, &bounds, &[WIDE; 2]).is_none());
        }
    }
}
