//! Linear least squares by conjugate gradients, for many unknowns (Hestenes and Stiefel 1952; Björck,
//! *Numerical Methods for Least Squares Problems*, 1996, algorithm 7.4.1).
//!
//! Stopped early it regularises: directions that the data hardly determine are found last.

use super::dot;
use std::ops::ControlFlow;

/// Minimises `‖A u - right‖` from `u = 0`, in at most `steps` steps. `forward` returns `A u`,
/// `back` returns `Aᵀ r`, with zeros for fixed unknowns. `visit` receives every iterate and may stop
/// the iteration.
pub fn cgls(
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
    let mut square = dot(&slope, &slope);
    for _ in 0..steps {
        if !(square > 0.0) {
            break;
        }
        let image = forward(&direction);
        let curvature = dot(&image, &image);
        if !(curvature > 0.0) {
            break;
        }
        let length = square / curvature;
        add(&mut found, length, &direction);
        add(&mut residual, -length, &image);
        if visit(&found).is_break() {
            break;
        }
        slope = back(&residual);
        let next = dot(&slope, &slope);
        let ratio = next / square;
        direction.iter_mut().zip(&slope).for_each(|(d, s)| *d = s + ratio * *d);
        square = next;
    }
    found
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
        let mut visited = 0;
        let visit = |_: &[f64]| {
            visited += 1;
            ControlFlow::Continue(())
        };
        let found = cgls(2, &right, 2, forward, back, visit);
        assert!((found[0] - 0.7).abs() < 1e-13 && (found[1] + 0.3).abs() < 1e-13, "{found:?}");
        assert_eq!(visited, 2);
        let none = cgls(2, &[0.0; 3], 9, forward, back, |_| ControlFlow::Continue(()));
        assert_eq!(none, [0.0; 2]);
    }
}
