//! The minimum of the model of a sum of squares within a trust region.

use super::TrustRegion;
use super::separate::{LeastAlong, PiecewiseModel};
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// The pieces of the model in which its minimum is looked for.
const MAX_PIECES: usize = 30;
/// The gain relative to all so far that is worth no further piece.
const SMALL_PIECE: f64 = 1e-4;

impl TrustRegion {
    /// The minimum of a model within the trust region and the bounds, from piece to piece.
    pub(super) fn model_minimum(
        &self,
        model: PiecewiseModel<'_>,
        room: &[[f64; 2]],
        radius: f64,
    ) -> DVector<f64> {
        let mut change = DVector::zeros(model.point.half_gradient.len());
        let mut gained = 0.0;
        for _ in 0..MAX_PIECES {
            let (hessian, gradient) = model.piece(&change);
            let target = self.bounded_step(&hessian, &gradient, room, radius);
            let LeastAlong { part, is_in_piece } = model.least_along(&change, &target);
            let next = &change + (target - &change) * part;
            let gain = model.decrease(&next);
            if !(gain > gained) {
                break;
            }
            let is_last = is_in_piece && part >= 1.0 || gain - gained <= SMALL_PIECE * gain;
            (change, gained) = (next, gain);
            if is_last {
                break;
            }
        }
        change
    }

    /// The minimum of a parabola within the trust region and the bounds: the way to the minimum for
    /// the free parameters is followed to the first bound, where that parameter is fixed, and the
    /// minimum is found again for the others.
    fn bounded_step(
        &self,
        hessian: &DMatrix<f64>,
        gradient: &DVector<f64>,
        room: &[[f64; 2]],
        radius: f64,
    ) -> DVector<f64> {
        let mut change = DVector::zeros(gradient.len());
        let held = |i: &usize| {
            let [low, high] = room[*i];
            (gradient[*i] >= 0.0 && low >= 0.0) || (gradient[*i] <= 0.0 && high <= 0.0)
        };
        let mut free: Vec<usize> = (0..gradient.len()).filter(|i| !held(i)).collect();
        while !free.is_empty() {
            let target = self.free_minimum(hessian, gradient, &change, &free, radius);
            let way = |k: usize| target[k] - change[free[k]];
            let reach = |k: usize| {
                let [low, high] = room[free[k]];
                let bound = if way(k) < 0.0 { low } else { high };
                if way(k) == 0.0 { f64::INFINITY } else { (bound - change[free[k]]) / way(k) }
            };
            let first = (0..free.len()).min_by(|a, b| reach(*a).total_cmp(&reach(*b)));
            let Some((first, fraction)) = first.map(|k| (k, reach(k))).filter(|(_, t)| *t < 1.0)
            else {
                free.iter().zip(target.iter()).for_each(|(i, value)| change[*i] = *value);
                break;
            };
            let steps: Vec<f64> = (0..free.len()).map(|k| fraction.max(0.0) * way(k)).collect();
            free.iter().zip(steps).for_each(|(i, step)| change[*i] += step);
            free.remove(first);
        }
        change
    }

    /// The values of the free parameters at the minimum of the model within the trust region, the
    /// others staying where they are.
    fn free_minimum(
        &self,
        hessian: &DMatrix<f64>,
        gradient: &DVector<f64>,
        change: &DVector<f64>,
        free: &[usize],
        radius: f64,
    ) -> DVector<f64> {
        let mut fixed = change.clone();
        free.iter().for_each(|i| fixed[*i] = 0.0);
        let remaining = (radius * radius - self.length(&fixed).powi(2)).max(0.0).sqrt();
        let slope = gradient + hessian * &fixed;
        let pick =
            |all: &DVector<f64>| DVector::from_iterator(free.len(), free.iter().map(|i| all[*i]));
        let scales = pick(&self.scales);
        let inner = DMatrix::from_fn(free.len(), free.len(), |i, j| {
            hessian[(free[i], free[j])] / (scales[i] * scales[j])
        });
        minimize_in_ball(inner, &pick(&slope).component_div(&scales), remaining)
            .component_div(&scales)
    }
}

/// The minimum of `2 gᵀd + dᵀHd` with `|d| ≤ radius`, by the eigenvectors of `H`; directions without
/// curvature are left alone if the radius is infinite.
fn minimize_in_ball(hessian: DMatrix<f64>, gradient: &DVector<f64>, radius: f64) -> DVector<f64> {
    let SymmetricEigen { eigenvectors, eigenvalues } = SymmetricEigen::new(hessian);
    let slopes = eigenvectors.tr_mul(gradient);
    let largest = eigenvalues.amax();
    let flat = 1e-14 * largest;
    let step = |shift: f64| {
        slopes.zip_map(&eigenvalues, |slope, value| {
            let value = value + shift;
            if value > flat { -slope / value } else { 0.0 }
        })
    };
    let least = eigenvalues.min();
    let newton = step(0.0);
    if least > flat && newton.norm() <= radius || radius == f64::INFINITY {
        return eigenvectors * newton;
    }
    // The length falls with the shift: bisection in its logarithm above the least eigenvalue.
    let base = (-least).max(0.0);
    let (mut low, mut high) =
        (1e-16 * largest, gradient.norm() / radius.max(f64::MIN_POSITIVE) + largest);
    for _ in 0..200 {
        let middle = (low * high).sqrt();
        if step(base + middle).norm() > radius {
            low = middle;
        } else {
            high = middle;
        }
        if high <= low * (1.0 + 1e-6) {
            break;
        }
    }
    let mut found = step(base + high);
    let missing = radius * radius - found.norm_squared();
    // The hard case: the gradient has no part along the direction of least curvature.
    if least < -flat && missing > 0.01 * radius * radius {
        let lowest = eigenvalues.imin();
        found[lowest] += if slopes[lowest] > 0.0 { -missing.sqrt() } else { missing.sqrt() };
    }
    eigenvectors * found
}
