//! Gauss rules of the unit disc and its pieces, computed once.

use crate::math::quadrature::{GaussRule, legendre_rule};
use std::f64::consts::PI;
use std::sync::OnceLock;

/// The largest number of nodes.
pub(super) const LARGEST: usize = 224;

/// The Gauss-Legendre rule with `count` nodes on the interval from 0 to 1.
pub(super) fn legendre(count: usize) -> &'static GaussRule {
    legendre_rule(count.min(LARGEST))
}

/// The Gauss rule with `count` nodes for `∫ f(r) r dr` from 0 to 1.
///
/// Its nodes are those of the Gauss-Radau rule with one more node, without the one at the centre:
/// the zeros of `(P_n + P_{n+1}) / (1 + x)` (Abramowitz and Stegun, 25.4.31).
pub(super) fn radial(count: usize) -> &'static GaussRule {
    static RULES: [OnceLock<GaussRule>; LARGEST + 1] = [const { OnceLock::new() }; LARGEST + 1];
    let count = count.min(LARGEST);
    RULES[count].get_or_init(|| radial_rule(count))
}

fn radial_rule(count: usize) -> GaussRule {
    let weight = |x: f64| {
        let [p, _] = legendre_pair(count, x);
        let radau = (1.0 - x) / (((count + 1) as f64) * p).powi(2);
        (0.5 * (1.0 + x), 0.25 * radau * (1.0 + x))
    };
    zeros(count).into_iter().map(weight).collect()
}

/// The zeros of `P_n + P_{n+1}` other than −1, ascending: bracketed on a grid finer than their
/// distance, then halved down to rounding.
fn zeros(count: usize) -> Vec<f64> {
    let value = |x: f64| legendre_pair(count, x).iter().sum::<f64>();
    let cells = 8 * (count + 1);
    let node = |i: usize| -(PI * (i as f64 + 0.5) / (cells as f64 + 0.5)).cos();
    let pairs = (0..cells).map(|i| (node(i), node(i + 1).min(1.0)));
    let changes = pairs.filter(|(a, b)| (value(*a) > 0.0) != (value(*b) > 0.0));
    changes.map(|(a, b)| bisect(value, a, b)).collect()
}

fn bisect(value: impl Fn(f64) -> f64, mut a: f64, mut b: f64) -> f64 {
    let rising = value(b) > 0.0;
    for _ in 0..60 {
        let middle = 0.5 * (a + b);
        if (value(middle) > 0.0) == rising {
            b = middle;
        } else {
            a = middle;
        }
    }
    0.5 * (a + b)
}

/// The Legendre polynomials of degree `n` and `n + 1`.
fn legendre_pair(n: usize, x: f64) -> [f64; 2] {
    let (mut before, mut p) = (0.0, 1.0);
    for k in 0..=n {
        let k = k as f64;
        let next = ((2.0 * k + 1.0) * x * p - k * before) / (k + 1.0);
        (before, p) = (p, next);
    }
    [before, p]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_radial_rule_is_exact_for_its_degree() {
        for count in 1..=40 {
            let rule = radial(count);
            assert_eq!(rule.len(), count);
            // The recurrence of the polynomials rounds once a degree.
            let rounding = 1e-14 + 5e-16 * count as f64;
            for degree in 0..2 * count {
                let power = i32::try_from(degree).unwrap();
                let sum: f64 = rule.iter().map(|(r, w)| w * r.powi(power)).sum();
                assert!((sum - 1.0 / (degree as f64 + 2.0)).abs() < rounding, "{count}, {degree}");
            }
        }
    }
}
