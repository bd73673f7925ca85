//! Random errors of making, the same for the same seed on any number of threads.

use crate::lens::{ErrorDistribution, Tolerance};
use rand::{RngExt as _, SeedableRng as _};
use rand_distr::StandardNormal;

/// The generator of one lens.
type Generator = rand_xoshiro::Xoshiro256PlusPlus;

/// The errors of the lens with this number, in the units of the errors.
pub(super) fn draw_errors(tolerances: &[Tolerance], seed: u64, number: u64) -> Vec<f64> {
    let mut errors = vec![0.0; tolerances.len()];
    draw_errors_into(tolerances, seed, number, &mut errors);
    errors
}

/// The same as numbers that are overwritten.
pub(super) fn draw_errors_into(
    tolerances: &[Tolerance],
    seed: u64,
    number: u64,
    errors: &mut [f64],
) {
    // Numbers and seeds next to each other must give independent streams.
    let mixed = seed ^ number.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let mut generator = Generator::seed_from_u64(mixed);
    for (error, tolerance) in errors.iter_mut().zip(tolerances) {
        *error = tolerance.half_range * unit_error(tolerance.distribution, &mut generator);
    }
}

/// An error with a half range of 1.
fn unit_error(distribution: ErrorDistribution, generator: &mut Generator) -> f64 {
    match distribution {
        ErrorDistribution::Normal => 0.5 * generator.sample::<f64, _>(StandardNormal),
        ErrorDistribution::NormalCut => loop {
            let found = 0.5 * generator.sample::<f64, _>(StandardNormal);
            if found.abs() <= 1.0 {
                return found;
            }
        },
        ErrorDistribution::Uniform => 2.0 * generator.random::<f64>() - 1.0,
        // The inverse of its distribution function (1 + p³)/2.
        ErrorDistribution::Parabolic => (2.0 * generator.random::<f64>() - 1.0).cbrt(),
        ErrorDistribution::Ends => {
            if generator.random::<bool>() {
                1.0
            } else {
                -1.0
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{Perturbation, PerturbationKind};

    #[test]
    fn errors_have_the_deviation_of_their_distribution() {
        use ErrorDistribution::{Ends, Normal, NormalCut, Parabolic, Uniform};
        let error = Perturbation::of_surface(PerturbationKind::Thickness, 0);
        for distribution in [NormalCut, Normal, Uniform, Parabolic, Ends] {
            let tolerance = [Tolerance { error, half_range: 0.2, distribution }];
            let squares = (0..20_000).map(|i| draw_errors(&tolerance, 7, i)[0].powi(2));
            let found = (squares.sum::<f64>() / 20_000.0).sqrt();
            let expected = tolerance[0].deviation();
            assert!((found / expected - 1.0).abs() < 0.03, "{distribution:?}: {found} {expected}");
        }
    }
}
