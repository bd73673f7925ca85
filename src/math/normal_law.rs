//! The normal law: its tail, and what of it lies beyond a limit.

/// The complementary error function, to 1e-14: its series about 0, and further out its continued fraction
/// (Abramowitz and Stegun, 7.1.6 and 7.1.14).
pub(crate) fn erfc(x: f64) -> f64 {
    if x < 0.0 {
        return 2.0 - erfc(-x);
    }
    let gauss = (-x * x).exp() / std::f64::consts::PI.sqrt();
    if x < 2.5 {
        let (mut term, mut sum) = (x, x);
        for n in 1..80 {
            term *= 2.0 * x * x / f64::from(2 * n + 1);
            sum += term;
        }
        return 1.0 - 2.0 * gauss * sum;
    }
    let fraction = (1..60).rev().fold(x, |rest, n| x + 0.5 * f64::from(n) / rest);
    gauss / fraction
}

/// The mean of the square by which a normal number with mean 0 and this variance exceeds a travel on
/// either side, and its derivative by the variance.
///
/// With `τ = T/σ` and `Q` the upper tail it is `2 [(σ² + T²) Q(τ) − T σ φ(τ)]`, and the derivative is
/// `2 Q(τ)`: that of integrals of the tail by parts.
pub(crate) fn excess_beyond(variance: f64, travel: f64) -> [f64; 2] {
    if !(variance > 0.0) {
        return [0.0, if travel > 0.0 { 0.0 } else { 1.0 }];
    }
    let sigma = variance.sqrt();
    let tau = travel / sigma;
    let tail = 0.5 * erfc(tau / std::f64::consts::SQRT_2);
    let density = (-0.5 * tau * tau).exp() / (2.0 * std::f64::consts::PI).sqrt();
    let square = 2.0 * ((variance + travel * travel) * tail - travel * sigma * density);
    [if tail > 0.0 { square.max(0.0) } else { 0.0 }, 2.0 * tail]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_complementary_error_function_is_the_tabulated_one() {
        // Abramowitz and Stegun, table 7.1, and from 30 digits.
        for (x, exact) in [
            (0.5, 0.479_500_122_186_953_5),
            (2.0, 4.677_734_981_047_266e-3),
            (3.0, 2.209_049_699_858_544e-5),
            (-1.0, 1.842_700_792_949_715),
        ] {
            assert!((erfc(x) - exact).abs() < 1e-14, "{x}: {}", erfc(x));
        }
        assert!((erfc(2.5 - 1e-12) / erfc(2.5 + 1e-12) - 1.0).abs() < 1e-10);
    }

    /// Against sums over the density, and without travel the variance itself.
    #[test]
    fn the_excess_beyond_a_travel_is_that_of_its_integral() {
        for (sigma, travel) in [(1.0, 0.5), (2.0, 3.0), (0.1, 0.35)] {
            let step = 1e-4 * sigma;
            let density = |x: f64| {
                (-0.5 * (x / sigma).powi(2)).exp() / (sigma * (2.0 * std::f64::consts::PI).sqrt())
            };
            let middle = |i: u32| travel + (f64::from(i) + 0.5) * step;
            let sum: f64 =
                (0..120_000).map(|i| (middle(i) - travel).powi(2) * density(middle(i))).sum();
            let [found, slope] = excess_beyond(sigma * sigma, travel);
            assert!((found - 2.0 * step * sum).abs() < 1e-8 * sigma * sigma, "{found}");
            let d = 1e-5 * sigma * sigma;
            let at = |variance: f64| excess_beyond(variance, travel)[0];
            let difference = (at(sigma * sigma + d) - at(sigma * sigma - d)) / (2.0 * d);
            assert!((slope - difference).abs() < 1e-8, "{slope} {difference}");
        }
        assert_eq!(excess_beyond(0.25, 0.0), [0.25, 1.0]);
        assert_eq!(excess_beyond(0.25, f64::INFINITY)[1], 0.0);
        assert_eq!(excess_beyond(0.0, 1.0), [0.0, 0.0]);
    }
}
