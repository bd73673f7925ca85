//! The discrete Fourier transform of sizes that are powers of two, by halving (Cooley and Tukey,
//! Math. Comp. 19, 1965), of lines and of planes.
//!
//! `F(k) = Σ f(j) exp(∓2πi jk/n)`, the lower sign for the inverse, which divides by n as well. Lines of a plane
//! are independent of each other, so that the numbers do not depend on how many threads share them.

use rayon::prelude::*;
use std::f64::consts::TAU;

/// A complex number as its real and imaginary part.
pub(crate) type ComplexPair = [f64; 2];

/// The direction of a transform.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FourierSense {
    /// From values to frequencies.
    Forward,
    /// From frequencies to values.
    Inverse,
}

/// Transforms a plane of rows with `columns` numbers each in place; both counts are powers of two, else
/// nothing happens.
pub(crate) fn transform_plane(plane: &mut Vec<ComplexPair>, columns: usize, sense: FourierSense) {
    let rows = plane.len() / columns.max(1);
    if !(columns.is_power_of_two() && rows.is_power_of_two()) || columns * rows != plane.len() {
        return;
    }
    plane.par_chunks_mut(columns).for_each(|line| transform_line(line, sense));
    let mut turned = transposed(plane, columns);
    turned.par_chunks_mut(rows).for_each(|line| transform_line(line, sense));
    *plane = transposed(&turned, rows);
}

fn transposed(plane: &[ComplexPair], columns: usize) -> Vec<ComplexPair> {
    let rows = plane.len() / columns;
    let column = |x: usize| (0..rows).map(move |y| plane[y * columns + x]);
    (0..columns).flat_map(column).collect()
}

/// Transforms a line of a power of two of numbers in place.
fn transform_line(line: &mut [ComplexPair], sense: FourierSense) {
    let count = line.len();
    let bits = count.trailing_zeros();
    for i in 0..count {
        let j = if bits == 0 { i } else { i.reverse_bits() >> (usize::BITS - bits) };
        if i < j {
            line.swap(i, j);
        }
    }
    let sign = if sense == FourierSense::Forward { -1.0 } else { 1.0 };
    let turn = |k: usize| {
        let (sin, cos) = (sign * TAU * k as f64 / count as f64).sin_cos();
        [cos, sin]
    };
    let turns: Vec<ComplexPair> = (0..count / 2).map(turn).collect();
    let mut half = 1;
    while half < count {
        let stride = count / (2 * half);
        for block in line.chunks_exact_mut(2 * half) {
            let (low, high) = block.split_at_mut(half);
            for (k, (a, b)) in low.iter_mut().zip(high).enumerate() {
                let [cos, sin] = turns[k * stride];
                let turned = [b[0] * cos - b[1] * sin, b[0] * sin + b[1] * cos];
                *b = [a[0] - turned[0], a[1] - turned[1]];
                *a = [a[0] + turned[0], a[1] + turned[1]];
            }
        }
        half *= 2;
    }
    if sense == FourierSense::Inverse {
        let share = 1.0 / count as f64;
        line.iter_mut().for_each(|value| *value = value.map(|v| v * share));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_has_its_sums_and_comes_back() {
        let (columns, rows) = (8, 4);
        let value = |i: usize| [(1.7 * i as f64).sin(), (0.3 * i as f64).cos()];
        let plane: Vec<ComplexPair> = (0..columns * rows).map(value).collect();
        let mut found = plane.clone();
        transform_plane(&mut found, columns, FourierSense::Forward);
        for (k, found) in found.iter().enumerate() {
            let mut sum = [0.0; 2];
            for (j, [re, im]) in plane.iter().enumerate() {
                let part = |at: usize, k: usize, n: usize| (at * k) as f64 / n as f64;
                let turns =
                    part(j % columns, k % columns, columns) + part(j / columns, k / columns, rows);
                let (sin, cos) = (-TAU * turns).sin_cos();
                sum = [sum[0] + re * cos - im * sin, sum[1] + re * sin + im * cos];
            }
            assert!((sum[0] - found[0]).hypot(sum[1] - found[1]) < 1e-12, "{k}");
        }
        transform_plane(&mut found, columns, FourierSense::Inverse);
        assert!(plane.iter().zip(&found).all(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1]) < 1e-14));
        // Sizes that are no powers of two stay as they are.
        let mut odd = vec![[1.0, 0.0]; 6];
        transform_plane(&mut odd, 3, FourierSense::Forward);
        assert_eq!(odd, vec![[1.0, 0.0]; 6]);
    }
}
