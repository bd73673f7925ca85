//! Gauss rules: nodes and weights that integrate polynomials exactly.

use std::f64::consts::PI;
use std::sync::OnceLock;

/// Nodes and weights of the Gauss-Legendre rule with `count` nodes on the interval from `from` to
/// `to`, in ascending order; exact for polynomials of degree `2 count - 1`.
///
/// Newton's iteration on the Legendre polynomial from Tricomi's estimate of its zeros.
pub fn gauss_legendre(count: usize, from: f64, to: f64) -> Vec<(f64, f64)> {
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
    let node = |i: usize| {
        let (x, weight) = legendre_zero(count, count - 1 - i);
        (middle + half * x, half * weight)
    };
    (0..count).map(node).collect()
}

/// Nodes and weights on the interval from 0 to 1.
pub type GaussRule = Vec<(f64, f64)>;

/// The largest number of nodes of a remembered rule.
pub const LARGEST_RULE: usize = 512;

/// The Gauss-Legendre rule with `count` nodes, or the largest one, on the interval from 0 to 1, computed once.
pub fn legendre_rule(count: usize) -> &'static GaussRule {
    static RULES: [OnceLock<GaussRule>; LARGEST_RULE + 1] =
        [const { OnceLock::new() }; LARGEST_RULE + 1];
    let count = count.min(LARGEST_RULE);
    RULES[count].get_or_init(|| gauss_legendre(count, 0.0, 1.0))
}

/// The `count` Chebyshev points from 0 to 1, ends included: `(1 − cos(π j/(count − 1)))/2`.
pub fn chebyshev_points(count: usize) -> impl Iterator<Item = f64> {
    let step = PI / (count.max(2) - 1) as f64;
    (0..count).map(move |j| (0.5 * step * j as f64).sin().powi(2))
}

/// The shares with which values at the [`chebyshev_points`] add up to that of the polynomial through them at a
/// point from 0 to 1, by the second barycentric formula (Berrut and Trefethen, SIAM Review 46, 2004).
pub fn chebyshev_weights(nodes: &[f64], t: f64) -> Vec<f64> {
    if let Some(at) = nodes.iter().position(|node| *node == t) {
        return (0..nodes.len()).map(|j| if j == at { 1.0 } else { 0.0 }).collect();
    }
    let last = nodes.len() - 1;
    let weight = |(j, node): (usize, &f64)| {
        let end = if j == 0 || j == last { 0.5 } else { 1.0 };
        if j % 2 == 0 { end / (t - node) } else { -end / (t - node) }
    };
    let weights: Vec<f64> = nodes.iter().enumerate().map(weight).collect();
    let total: f64 = weights.iter().sum();
    weights.into_iter().map(|weight| weight / total).collect()
}

/// The zero of the Legendre polynomial with index `i`, from the largest down, and its weight.
fn legendre_zero(count: usize, i: usize) -> (f64, f64) {
    let n = count as f64;
    let mut x = (PI * (i as f64 + 0.75) / (n + 0.5)).cos();
    for _ in 0..8 {
        let (p, slope) = legendre(count, x);
        x -= p / slope;
    }
    let (_, slope) = legendre(count, x);
    (x, 2.0 / ((1.0 - x * x) * slope * slope))
}

/// The Legendre polynomial of degree `count` and its derivative, by the three-term recurrence.
fn legendre(count: usize, x: f64) -> (f64, f64) {
    let (mut before, mut p) = (1.0, x);
    for k in 2..=count {
        let k = k as f64;
        (before, p) = (p, ((2.0 * k - 1.0) * x * p - (k - 1.0) * before) / k);
    }
    let slope = count as f64 * (x * p - before) / (x * x - 1.0);
    (p, slope)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rule_is_exact_for_its_degree() {
        for count in 1..40 {
            let degree = 2 * count as i32 - 2; // even, so that the integral is not zero
            let rule = gauss_legendre(count, -1.0, 1.0);
            let sum: f64 = rule.iter().map(|(x, w)| w * x.powi(degree)).sum();
            assert!((sum - 2.0 / f64::from(degree + 1)).abs() < 1e-14, "{count} nodes");
            assert!(rule.windows(2).all(|pair| pair[0].0 < pair[1].0));
        }
    }
}
