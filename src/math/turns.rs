//! Sine and cosine of a phase counted in turns, without branches, so that loops over many phases become vector
//! instructions.

use std::f64::consts::TAU;

/// Added to a number below 2⁵⁰ in size, it leaves the nearest integer in the lowest bits.
const ROUNDING: f64 = 6_755_399_441_055_744.0;

/// The terms `(2π)^n/n!` of both series up to those that rounding hides at an eighth of a turn: of the
/// sine in odd, of the cosine in even powers, with their signs.
const SINE: [f64; 9] = series(1);
const COSINE: [f64; 9] = series(0);

const fn series(first: i32) -> [f64; 9] {
    let mut terms = [0.0; 9];
    let (mut term, mut n) = (1.0, 0);
    while n < first + 18 {
        if n % 2 == first {
            let k = (n / 2) as usize;
            terms[k] = if k.is_multiple_of(2) { term } else { -term };
        }
        n += 1;
        term *= TAU / n as f64;
    }
    terms
}

/// `(sin 2πx, cos 2πx)` for `|x|` below 2⁴⁸, within 3e-16 of that of the rounded `x`.
#[inline(always)]
pub(crate) fn sin_cos_turns(x: f64) -> (f64, f64) {
    let shifted = 4.0 * x + ROUNDING;
    let quarters = shifted.to_bits();
    let f = x - 0.25 * (shifted - ROUNDING);
    let square = f * f;
    let sum = |terms: &[f64; 9]| terms.iter().rev().fold(0.0, |sum, term| sum * square + term);
    let (sin, cos) = (f * sum(&SINE), sum(&COSINE));
    let (s, c) = if quarters & 1 == 0 { (sin, cos) } else { (cos, sin) };
    let sign = |half: u64| (half & 2) << 62;
    (
        f64::from_bits(s.to_bits() ^ sign(quarters)),
        f64::from_bits(c.to_bits() ^ sign(quarters.wrapping_add(1))),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sines_of_turns_are_those_of_angles() {
        for i in -20_000..20_000 {
            let x = f64::from(i) * 1.2345e-3;
            // The turns that are left are exact.
            let (sin, cos) = (TAU * (x - x.round())).sin_cos();
            let found = sin_cos_turns(x);
            assert!((found.0 - sin).abs() < 6e-16 && (found.1 - cos).abs() < 6e-16, "{x}");
        }
        for (x, exact) in
            [(0.0, (0.0, 1.0)), (0.25, (1.0, 0.0)), (-0.5, (0.0, -1.0)), (1e9, (0.0, 1.0))]
        {
            let found = sin_cos_turns(x);
            assert!((found.0 - exact.0).abs() < 1e-15 && (found.1 - exact.1).abs() < 1e-15, "{x}");
        }
    }
}
