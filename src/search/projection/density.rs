//! The change of volume by the projection.
//!
//! The nearest lens is where `z − z₀ = Jᵀλ` and `g(z) = g₀(z₀)`. Differentiated by `z₀`, with `H` the
//! sum of the second derivatives of `g` times their multipliers,
//! `[I − H, −Jᵀ; J, 0] [dz; dλ] = [I; J₀] dz₀`: equation (4.30) with its factors put right. Of the
//! whole Jacobian the determinant is `det(J₀ Jᵀ) / det[I − H, −Jᵀ; J, 0]`, since bordering the block
//! with the right side and eliminating it from there leaves only `J₀ Jᵀ`.

use super::model::MarginalRayModel;
use crate::math::Dual;
use crate::solve::ConstraintFunction as _;
use nalgebra::{DMatrix, DVector};

/// The logarithm of the determinant of the map to the nearest lens, which is `at` with the
/// `multipliers`; `before` holds the derivatives of the constraints at its start. `None` if it is
/// singular.
pub(super) fn log_determinant(
    before: &DMatrix<f64>,
    model: &MarginalRayModel,
    at: &[f64],
    multipliers: &DVector<f64>,
) -> Option<f64> {
    let jacobian = model.jacobian(at);
    let across = (before * jacobian.transpose()).lu().determinant().abs();
    let block = block(model, at, multipliers, &jacobian).lu().determinant().abs();
    let log = across.ln() - block.ln();
    log.is_finite().then_some(log)
}

fn block(
    model: &MarginalRayModel,
    at: &[f64],
    multipliers: &DVector<f64>,
    jacobian: &DMatrix<f64>,
) -> DMatrix<f64> {
    let (count, constraints) = (at.len(), jacobian.nrows());
    let mut block = DMatrix::identity(count + constraints, count + constraints);
    for i in 0..constraints {
        block[(count + i, count + i)] = 0.0;
    }
    let mut lifted: Vec<Dual<f64, 1>> = at.iter().map(|z| Dual::constant(*z)).collect();
    for column in 0..count {
        lifted[column].slope = [1.0];
        let gradient = model.weighted_gradient(&lifted, multipliers.as_slice());
        lifted[column].slope = [0.0];
        for (row, by) in gradient.iter().enumerate() {
            block[(row, column)] -= by.slope[0];
        }
    }
    block.view_mut((0, count), (count, constraints)).copy_from(&(-jacobian.transpose()));
    block.view_mut((count, 0), (constraints, count)).copy_from(jacobian);
    block
}
