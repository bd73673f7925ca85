//! Linear least squares by conjugate gradients, for many unknowns (Hestenes and Stiefel 1952; Björck,
//! *Numerical Methods for Least Squares Problems*, 1996, algorithm 7.4.1).
//!
//! Stopped early it damps what the data hardly determine: each step frees one more direction.

use std::ops::ControlFlow;

/// Seeks the `u` for which `‖A u - right‖` is smallest, from zero on, in so many steps. `forward` is
/// `A u`, `back` is `Aᵀ r` with nothing for an unknown that may not change. `visit` sees every
/// iterate and may end the search.
pub(super) fn cgls(
    unknowns: usize,
    right: &[f64],
    steps: usize,
    forward: impl Fn(&[f64]) -> Vec<f64>,
    back: impl Fn(&[f64]) -> Vec<f64>,
    mut visit: impl FnMut(&[f64]) -> ControlFlow<()>,
) -> Vec<f64> {
    let mut found = vec![0.0; unknowns];
    let mut residual = right.to_vec();
    let mut slope = back(&residual);
    let mut direction = slope.clone();
    let mut steepness = dot(&slope, &slope);
    for _ in 0..steps {
        if !(steepness > 0.0) {
            break;
        }
        let there = forward(&direction);
        let curvature = dot(&there, &there);
        if !(curvature > 0.0) {
            break;
        }
        let way = steepness / curvature;
        add(&mut found, way, &direction);
        add(&mut residual, -way, &there);
        if visit(&found).is_break() {
            break;
        }
        slope = back(&residual);
        let next = dot(&slope, &slope);
        let turn = next / steepness;
        direction.iter_mut().zip(&slope).for_each(|(d, s)| *d = s + turn * *d);
        steepness = next;
    }
    found
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn add(sum: &mut [f64], factor: f64, part: &[f64]) {
    sum.iter_mut().zip(part).for_each(|(sum, part)| *sum += factor * part);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_solves_a_small_system_in_as_many_steps_as_there_are_unknowns() {
        let rows = [[2.0, 1.0], [1.0, -1.0], [0.5, 3.0]];
        let forward = |u: &[f64]| rows.iter().map(|row| dot(row, u)).collect();
        let back = |r: &[f64]| (0..2).map(|i| (0..3).map(|k| rows[k][i] * r[k]).sum()).collect();
        let right: Vec<f64> = forward(&[0.7, -0.3]);
        let mut seen = 0;
        let visit = |_: &[f64]| {
            seen += 1;
            ControlFlow::Continue(())
        };
        let found = cgls(2, &right, 2, forward, back, visit);
        assert!((found[0] - 0.7).abs() < 1e-13 && (found[1] + 0.3).abs() < 1e-13, "{found:?}");
        assert_eq!(seen, 2);
        let none = cgls(2, &[0.0; 3], 9, forward, back, |_| ControlFlow::Continue(()));
        assert_eq!(none, [0.0; 2]);
    }
}
