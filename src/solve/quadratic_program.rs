//! Convex quadratic programs within a ball: `min ½ xᵀPx + qᵀx` with `l ≤ Ax ≤ u`, a range for every
//! parameter and `|x| ≤ radius`, by the interior-point method of Goulart and Chen
//! (<https://arxiv.org/abs/2405.12762>).
//!
//! Rows may be elastic: they can be broken at a price per unit, so that there always is a solution.

use clarabel::algebra::CscMatrix;
use clarabel::solver::SupportedConeT::{NonnegativeConeT, SecondOrderConeT, ZeroConeT};
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus};
use nalgebra::{DMatrix, DVector};

/// A quadratic program.
#[derive(Clone, Copy)]
pub(super) struct QuadraticProgram<'a> {
    /// `P`, positive semidefinite.
    pub(super) hessian: &'a DMatrix<f64>,
    /// `q`.
    pub(super) gradient: &'a DVector<f64>,
    /// `A`.
    pub(super) rows: &'a DMatrix<f64>,
    /// `[l, u]` of every row.
    pub(super) bounds: &'a [[f64; 2]],
    /// The range of every parameter, which contains 0.
    pub(super) room: &'a [[f64; 2]],
    /// The radius of the ball; finite.
    pub(super) radius: f64,
    /// The price of breaking each row by one unit; `None` if none may be broken.
    pub(super) elastic: Option<&'a [f64]>,
}

/// The solution of a quadratic program.
pub(super) struct QuadraticSolution {
    pub(super) x: DVector<f64>,
    /// The multiplier of every row: positive where the upper bound holds it, negative where the
    /// lower one does.
    pub(super) multipliers: DVector<f64>,
}

/// The accuracy of the interior-point method, relative to the radius.
const ACCURACY: f64 = 1e-10;

/// The residual of the constraints up to which an iterate that has not converged is used.
const USABLE: f64 = 1e-6;

/// The part of the ball in which the bounds are approached; the rest is left to the objective.
const RESTORING_PART: f64 = 0.7;
/// The weight of the length of a step against the violation of the rows.
const BREVITY: f64 = 1e-4;
/// The room that a relaxed row gets, relative to its reach within the ball.
const MARGIN: f64 = 1e-8;

/// One side of a row: `sign · row · x ≤ distance`.
struct RowSide {
    row: usize,
    sign: f64,
    distance: f64,
    is_equality: bool,
}

/// The matrix of the constraints by triplets.
#[derive(Default)]
struct Triplets {
    rows: Vec<usize>,
    columns: Vec<usize>,
    values: Vec<f64>,
    right: Vec<f64>,
}

impl Triplets {
    fn push(&mut self, column: usize, value: f64) {
        self.rows.push(self.right.len());
        self.columns.push(column);
        self.values.push(value);
    }

    fn end_row(&mut self, right: f64) {
        self.right.push(right);
    }
}

impl QuadraticProgram<'_> {
    /// The solution; `None` if the constraints contradict each other or the method fails.
    pub(super) fn solve(&self) -> Option<QuadraticSolution> {
        let sides = self.reachable_sides();
        let equalities = sides.iter().filter(|side| side.is_equality).count();
        let (matrix, slacks) = self.constraint_matrix(&sides);
        let count = self.gradient.len();
        let balls = count + 1;
        let unlimited = matrix.right.len() - balls - equalities;
        let cones = [ZeroConeT(equalities), NonnegativeConeT(unlimited), SecondOrderConeT(balls)];
        let scale = slacks.iter().fold(self.objective_scale(), |most: f64, price| most.max(*price));
        let hessian = self.scaled_hessian(count + slacks.len(), scale);
        let mut gradient: Vec<f64> =
            self.gradient.iter().map(|slope| slope * self.radius / scale).collect();
        gradient.extend(slacks.iter().map(|price| price / scale));
        let Triplets { rows, columns, values, right } = matrix;
        let size = (right.len(), gradient.len());
        let matrix = CscMatrix::new_from_triplets(size.0, size.1, rows, columns, values);
        let solver = DefaultSolver::new(&hessian, &gradient, &matrix, &right, &cones, settings());
        let mut solver = solver.ok()?;
        solver.solve();
        let solution = &solver.solution;
        let found = DVector::from_column_slice(solution.x.get(..count)?);
        // Without convergence the last iterate may still be good enough for a step.
        let usable = match solution.status {
            SolverStatus::Solved | SolverStatus::AlmostSolved => true,
            SolverStatus::MaxIterations | SolverStatus::InsufficientProgress => {
                solution.r_prim <= USABLE
            }
            _ => false,
        };
        let length = found.norm();
        (usable && length <= 1.0 + USABLE).then(|| QuadraticSolution {
            x: found * (self.radius / length.max(1.0)),
            multipliers: self.multipliers(&sides, &solution.z, scale),
        })
    }

    /// The solution under bounds as close to those given as they can be kept within a part of the
    /// ball.
    pub(super) fn solve_relaxed(&self) -> Option<QuadraticSolution> {
        let nearest = self.least_violation()?;
        let reached = self.rows * &nearest;
        let relaxed = |(row, [low, high]): (usize, &[f64; 2])| {
            let margin = MARGIN * self.radius * self.rows.row(row).norm();
            let value = reached[row];
            if low == high {
                return [value; 2];
            }
            let low = if value < *low { value - margin } else { *low };
            let high = if value > *high { value + margin } else { *high };
            [low, high]
        };
        let bounds: Vec<[f64; 2]> = (0..).zip(self.bounds).map(relaxed).collect();
        let found = QuadraticProgram { bounds: &bounds, ..*self }.solve();
        let multipliers = DVector::zeros(bounds.len());
        Some(found.unwrap_or(QuadraticSolution { x: nearest, multipliers }))
    }

    /// The shortest step within a part of the ball that breaks the rows least, by the sum of the
    /// distances to their bounds.
    fn least_violation(&self) -> Option<DVector<f64>> {
        let count = self.gradient.len();
        let radius = RESTORING_PART * self.radius;
        let lengths = (0..self.bounds.len()).map(|row| self.rows.row(row).norm());
        let prices: Vec<f64> =
            lengths.map(|length| if length > 0.0 { 1.0 / length } else { 0.0 }).collect();
        let found = QuadraticProgram {
            hessian: &(DMatrix::identity(count, count) * (BREVITY / radius)),
            gradient: &DVector::zeros(count),
            radius,
            elastic: Some(&prices),
            ..*self
        };
        found.solve().map(|found| found.x)
    }

    /// The sides of the rows that a step within the ball can reach, equalities first.
    fn reachable_sides(&self) -> Vec<RowSide> {
        let mut sides = Vec::new();
        for (row, [low, high]) in self.bounds.iter().enumerate() {
            let reach = self.rows.row(row).norm() * self.radius;
            if !(reach > 0.0) {
                continue;
            }
            if low == high {
                sides.push(RowSide { row, sign: 1.0, distance: *high, is_equality: true });
                continue;
            }
            for (sign, distance) in [(1.0, *high), (-1.0, -low)] {
                if distance < reach {
                    sides.push(RowSide { row, sign, distance, is_equality: false });
                }
            }
        }
        sides.sort_by_key(|side| !side.is_equality);
        sides
    }

    /// The constraints in units of the radius, with rows of length 1, and the price of every slack.
    fn constraint_matrix(&self, sides: &[RowSide]) -> (Triplets, Vec<f64>) {
        let count = self.gradient.len();
        let mut matrix = Triplets::default();
        let mut slacks = Vec::new();
        for side in sides {
            let length = self.rows.row(side.row).norm();
            for (column, slope) in self.rows.row(side.row).iter().enumerate() {
                matrix.push(column, side.sign * slope / length);
            }
            if let Some(prices) = self.elastic {
                let signs: &[f64] = if side.is_equality { &[-1.0, 1.0] } else { &[-1.0] };
                for sign in signs {
                    matrix.push(count + slacks.len(), *sign);
                    slacks.push(prices[side.row] * length * self.radius);
                }
            }
            matrix.end_row(side.distance / (length * self.radius));
        }
        for slack in 0..slacks.len() {
            matrix.push(count + slack, -1.0);
            matrix.end_row(0.0);
        }
        self.add_room(&mut matrix);
        matrix.end_row(1.0);
        for column in 0..count {
            matrix.push(column, -1.0);
            matrix.end_row(0.0);
        }
        (matrix, slacks)
    }

    fn add_room(&self, matrix: &mut Triplets) {
        for (column, [low, high]) in self.room.iter().enumerate() {
            for (sign, distance) in [(1.0, *high), (-1.0, -low)] {
                if distance < self.radius {
                    matrix.push(column, sign);
                    matrix.end_row(distance.max(0.0) / self.radius);
                }
            }
        }
    }

    /// The upper triangle of `P` in units of the radius, with zeros for the slacks.
    fn scaled_hessian(&self, size: usize, scale: f64) -> CscMatrix<f64> {
        let (mut rows, mut columns, mut values) = (Vec::new(), Vec::new(), Vec::new());
        for column in 0..self.gradient.len() {
            for row in 0..=column {
                rows.push(row);
                columns.push(column);
                values.push(self.hessian[(row, column)] * self.radius * self.radius / scale);
            }
        }
        CscMatrix::new_from_triplets(size, size, rows, columns, values)
    }

    /// The size of the objective within the ball.
    fn objective_scale(&self) -> f64 {
        let linear = self.radius * self.gradient.norm();
        let scale = if linear > 0.0 { linear } else { self.radius.powi(2) * self.hessian.amax() };
        if scale > 0.0 { scale } else { f64::MIN_POSITIVE.sqrt() }
    }

    fn multipliers(&self, sides: &[RowSide], duals: &[f64], scale: f64) -> DVector<f64> {
        let mut multipliers = DVector::zeros(self.bounds.len());
        for (side, dual) in sides.iter().zip(duals) {
            let length = self.rows.row(side.row).norm();
            multipliers[side.row] += side.sign * dual * scale / (length * self.radius);
        }
        multipliers
    }
}

fn settings() -> DefaultSettings<f64> {
    DefaultSettings {
        verbose: false,
        max_threads: 1,
        max_iter: 60,
        tol_gap_abs: ACCURACY,
        tol_gap_rel: ACCURACY,
        tol_feas: ACCURACY,
        ..DefaultSettings::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_that_a_step_can_reach_hold_whatever_the_radius() {
        // The nearest point to (100, 0) with x + y at most `bound`, in a ball: on the boundary of
        // the ball or on the line.
        let (hessian, rows) = (DMatrix::identity(2, 2), DMatrix::from_row_slice(1, 2, &[1.0, 1.0]));
        let room = [[f64::NEG_INFINITY, f64::INFINITY]; 2];
        for (radius, target) in [(20.0, 100.0), (0.05, 1.0)] {
            let gradient = DVector::from_vec(vec![-target, 0.0]);
            for part in [0.1, 0.5, 0.9, 1.3, 2.0] {
                let bound = part * radius;
                let program = QuadraticProgram {
                    hessian: &hessian,
                    gradient: &gradient,
                    rows: &rows,
                    bounds: &[[f64::NEG_INFINITY, bound]],
                    room: &room,
                    radius,
                    elastic: None,
                };
                let x = program.solve().unwrap().x;
                // Without the row: (radius, 0), whose sum is the radius.
                if part > 1.0 {
                    assert!((x[0] - radius).abs() < 1e-4 * radius, "{radius} {part}: {x}");
                    continue;
                }
                // On the line and on the circle.
                let along = (radius * radius - 0.5 * bound * bound).sqrt() / 2f64.sqrt();
                let exact = [0.5 * bound + along, 0.5 * bound - along];
                let off = (x[0] - exact[0]).hypot(x[1] - exact[1]);
                assert!(off < 1e-3 * radius, "{radius} {part}: {x} {exact:?}");
            }
        }
    }
}
