//! Projection onto a few constraints by Newton's method: to the nearest point that satisfies them, or
//! along given directions.

use nalgebra::{DMatrix, DVector};

/// Quantities that a projection holds, as functions of some coordinates.
pub trait ConstraintFunction {
    /// The constrained quantities.
    fn values(&self, at: &[f64]) -> Vec<f64>;

    /// Their derivatives by the coordinates, a row for each quantity.
    fn jacobian(&self, at: &[f64]) -> DMatrix<f64>;
}

/// The reasons that constraints cannot be satisfied.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ConstraintError {
    /// The coordinates cannot change the constrained quantities independently.
    #[error("the coordinates cannot satisfy all constraints independently")]
    Singular,
    /// Coordinates would have to leave their bounds.
    #[error("coordinates would have to leave their bounds ({} of {count} have reached them)", .held.len())]
    Bounds {
        /// The indices of the coordinates that have reached their bounds.
        held: Vec<usize>,
        /// The number of coordinates.
        count: usize,
    },
    /// No convergence within this number of steps.
    #[error("no convergence within {0} steps")]
    Steps(usize),
}

/// The maximum number of steps.
const MAX_STEPS: usize = 15;

/// The relative tolerance of the constraints.
const TOLERANCE: f64 = 1e-12;

/// The maximum number of steps from a lens that satisfies the constraints to the nearest one; each
/// costs about a microsecond.
const MAX_POLISHING_STEPS: usize = 60;

/// The smallest and largest value of each coordinate.
#[derive(Debug, Clone)]
pub struct CoordinateBounds(Vec<[f64; 2]>);

impl CoordinateBounds {
    /// Bounds from the range of each coordinate.
    pub fn new(ranges: Vec<[f64; 2]>) -> Self {
        Self(ranges)
    }

    /// The bounds widened to include coordinates that are already outside.
    #[must_use]
    pub fn widen_to_include(&self, at: &[f64]) -> Self {
        let widened = |([low, high], z): (&[f64; 2], &f64)| [low.min(*z), high.max(*z)];
        Self(self.0.iter().zip(at).map(widened).collect())
    }

    fn contain(&self, at: &DVector<f64>) -> bool {
        at.iter().zip(&self.0).all(|(z, [low, high])| (*low..=*high).contains(z))
    }

    /// Clamps every coordinate and returns those that were outside.
    fn clamp(&self, at: &mut DVector<f64>) -> Vec<usize> {
        let mut stopped = Vec::new();
        for (i, (z, [low, high])) in at.iter_mut().zip(&self.0).enumerate() {
            if !(*low..=*high).contains(z) {
                *z = z.clamp(*low, *high);
                stopped.push(i);
            }
        }
        stopped
    }
}

/// Coordinates at which the constraints are satisfied.
#[derive(Debug, Clone)]
pub struct ConstrainedPoint {
    /// The coordinates.
    pub at: Vec<f64>,
    /// The Lagrange multipliers, the coefficients of the normals.
    pub multipliers: DVector<f64>,
    /// The number of Newton steps.
    pub steps: usize,
    /// The largest residual.
    pub error: f64,
    /// True if it is the exact value of the map, not limited by a bound.
    pub exact: bool,
}

struct ProjectionProblem<'a, F> {
    function: &'a F,
    target: &'a [f64],
}

impl<F: ConstraintFunction> ProjectionProblem<'_, F> {
    fn residual(&self, at: &DVector<f64>) -> DVector<f64> {
        let values = self.function.values(at.as_slice());
        DVector::from_iterator(values.len(), self.target.iter().zip(&values).map(|(t, v)| t - v))
    }

    /// The residual that rounding leaves.
    fn tolerance(&self) -> f64 {
        TOLERANCE * self.target.iter().fold(1.0, |most: f64, t| most.max(t.abs()))
    }
}

fn largest(vector: &DVector<f64>) -> f64 {
    // NaN counts as infinity.
    vector
        .iter()
        .fold(0.0, |most: f64, v| if v.is_nan() { f64::INFINITY } else { most.max(v.abs()) })
}

/// Solves `J Jᵀ λ = c`; `None` if the rows of `J` are nearly dependent.
fn multipliers(jacobian: &DMatrix<f64>, missing: &DVector<f64>) -> Option<DVector<f64>> {
    let normal = jacobian * jacobian.transpose();
    let largest = normal.diagonal().max();
    let factor = normal.cholesky()?;
    let smallest = factor.l_dirty().diagonal().min();
    let sound = smallest * smallest > 1e-13 * largest;
    sound.then(|| factor.solve(missing))
}

/// The nearest coordinates to `start` at which the constraints are satisfied: minimum-norm steps `z
/// ← z + Jᵀ (J Jᵀ)⁻¹ c`, halved while the residual grows, with coordinates that reach a bound fixed
/// there; then, if none did, `z ← z₀ + Jᵀ (J Jᵀ)⁻¹ (c + J (z − z₀))` until the displacement is
/// along the normals, which is the solution of (4.22).
///
/// # Errors
/// Constraints that cannot be satisfied.
pub fn nearest_point<F: ConstraintFunction>(
    function: &F,
    start: &[f64],
    target: &[f64],
    bounds: &CoordinateBounds,
) -> Result<ConstrainedPoint, ConstraintError> {
    nearest_point_from(function, start, start, target, bounds)
}

/// The same from coordinates `guess` that are closer to the solution than `start` is.
///
/// # Errors
/// As [`nearest_point`].
pub fn nearest_point_from<F: ConstraintFunction>(
    function: &F,
    start: &[f64],
    guess: &[f64],
    target: &[f64],
    bounds: &CoordinateBounds,
) -> Result<ConstrainedPoint, ConstraintError> {
    let problem = ProjectionProblem { function, target };
    let mut reached = find_feasible(&problem, DVector::from_column_slice(guess), bounds)?;
    let start = DVector::from_column_slice(start);
    if !reached.exact {
        return Ok(reached);
    }
    match polish(&problem, &start, &reached) {
        Some((at, multipliers)) if bounds.contain(&at) => {
            reached.error = largest(&problem.residual(&at));
            reached.at = at.as_slice().to_vec();
            reached.multipliers = multipliers;
        }
        _ => reached.exact = false,
    }
    Ok(reached)
}

fn find_feasible<F: ConstraintFunction>(
    problem: &ProjectionProblem<'_, F>,
    mut at: DVector<f64>,
    bounds: &CoordinateBounds,
) -> Result<ConstrainedPoint, ConstraintError> {
    let count = at.len();
    let mut stopped = vec![false; count];
    let mut missing = problem.residual(&at);
    for steps in 0..=MAX_STEPS {
        let error = largest(&missing);
        if error <= problem.tolerance() {
            let exact = !stopped.iter().any(|s| *s);
            let at = at.as_slice().to_vec();
            let multipliers = DVector::zeros(missing.len());
            return Ok(ConstrainedPoint { at, multipliers, steps, error, exact });
        }
        let mut jacobian = problem.function.jacobian(at.as_slice());
        for i in (0..count).filter(|i| stopped[*i]) {
            jacobian.column_mut(i).fill(0.0);
        }
        let cause = || {
            let held: Vec<usize> = (0..count).filter(|i| stopped[*i]).collect();
            if held.is_empty() {
                ConstraintError::Singular
            } else {
                ConstraintError::Bounds { held, count }
            }
        };
        let multipliers = multipliers(&jacobian, &missing).ok_or_else(cause)?;
        let step = jacobian.transpose() * multipliers;
        let (next, left) = shorten_step(problem, &at, &step, error, bounds).ok_or_else(cause)?;
        left.into_iter().for_each(|i| stopped[i] = true);
        at = next;
        missing = problem.residual(&at);
    }
    Err(ConstraintError::Steps(MAX_STEPS))
}

/// The longest of the step and its halves that reduces the residual, or that reaches a bound first.
fn shorten_step<F: ConstraintFunction>(
    problem: &ProjectionProblem<'_, F>,
    at: &DVector<f64>,
    step: &DVector<f64>,
    error: f64,
    bounds: &CoordinateBounds,
) -> Option<(DVector<f64>, Vec<usize>)> {
    let mut length = 1.0;
    for _ in 0..10 {
        let mut next = at + step * length;
        let left = bounds.clamp(&mut next);
        let found = largest(&problem.residual(&next));
        if found < error || !left.is_empty() && found.is_finite() {
            return Some((next, left));
        }
        length *= 0.5;
    }
    None
}

fn polish<F: ConstraintFunction>(
    problem: &ProjectionProblem<'_, F>,
    start: &DVector<f64>,
    reached: &ConstrainedPoint,
) -> Option<(DVector<f64>, DVector<f64>)> {
    let mut at = DVector::from_column_slice(&reached.at);
    for _ in 0..MAX_POLISHING_STEPS {
        let jacobian = problem.function.jacobian(at.as_slice());
        let wanted = problem.residual(&at) + &jacobian * (&at - start);
        let multipliers = multipliers(&jacobian, &wanted)?;
        let next = start + jacobian.transpose() * &multipliers;
        let change = largest(&(&next - &at));
        at = next;
        if change <= 1e-13 * (1.0 + largest(&at)) {
            let satisfied = largest(&problem.residual(&at)) <= 1e2 * problem.tolerance();
            return satisfied.then_some((at, multipliers));
        }
    }
    None
}

/// The coordinates `start + Nᵀ λ` at which the constraints are satisfied, with the rows of `N` as
/// directions.
///
/// # Errors
/// Constraints that cannot be satisfied.
pub fn point_along_normals<F: ConstraintFunction>(
    function: &F,
    normals: &DMatrix<f64>,
    start: &[f64],
    target: &[f64],
    bounds: &CoordinateBounds,
) -> Result<ConstrainedPoint, ConstraintError> {
    let problem = ProjectionProblem { function, target };
    let start = DVector::from_column_slice(start);
    let place = |multipliers: &DVector<f64>| &start + normals.transpose() * multipliers;
    let mut multipliers = DVector::zeros(normals.nrows());
    let mut at = place(&multipliers);
    for steps in 0..=MAX_STEPS {
        let missing = problem.residual(&at);
        let error = largest(&missing);
        if error <= problem.tolerance() {
            if !bounds.contain(&at) {
                return Err(ConstraintError::Bounds { held: Vec::new(), count: at.len() });
            }
            let at = at.as_slice().to_vec();
            return Ok(ConstrainedPoint { at, multipliers, steps, error, exact: true });
        }
        let square = function.jacobian(at.as_slice()) * normals.transpose();
        let step = square.lu().solve(&missing).ok_or(ConstraintError::Singular)?;
        let halves = (0..10).map(|halvings| &multipliers + &step * 0.5f64.powi(halvings));
        let better = |tried: &DVector<f64>| largest(&problem.residual(&place(tried))) < error;
        multipliers = halves.into_iter().find(better).ok_or(ConstraintError::Singular)?;
        at = place(&multipliers);
    }
    Err(ConstraintError::Steps(MAX_STEPS))
}
