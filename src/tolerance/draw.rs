//! Random errors of making, the same for the same seed on any number of threads.

use super::mixture::ErrorMixture;
use crate::lens::{ErrorDistribution, Tolerance};
use rand::{RngExt as _, SeedableRng as _};
use rand_distr::StandardNormal;

/// The generator of one lens.
type Generator = rand_xoshiro::Xoshiro256PlusPlus;

/// The errors of the lens with this number, in the units of the errors.
pub(super) fn draw_errors(
    (tolerances, mixture): (&[Tolerance], &ErrorMixture),
    seed: u64,
    number: u64,
) -> Vec<f64> {
    let mut errors = vec![0.0; tolerances.len()];
    draw_independent(tolerances, seed, number, &mut errors);
    mixture.mix(&mut errors);
    errors
}

/// The independent errors of the same lens, which have a half range of 1.
pub(super) fn draw_independent(
    tolerances: &[Tolerance],
    seed: u64,
    number: u64,
    errors: &mut [f64],
) {
    // Numbers and seeds next to each other must give independent streams.
    let mixed = seed ^ number.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let mut generator = Generator::seed_from_u64(mixed);
    for (error, tolerance) in errors.iter_mut().zip(tolerances) {
        *error = unit_error(tolerance.distribution, &mut generator);
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
    use crate::lens::{ErrorCorrelation, Perturbation, PerturbationKind, ToleranceSheet};

    #[test]
    fn errors_have_the_deviation_of_their_distribution() {
        use ErrorDistribution::{Ends, Normal, NormalCut, Parabolic, Uniform};
        let error = Perturbation::of_surface(PerturbationKind::Thickness, 0);
        for distribution in [NormalCut, Normal, Uniform, Parabolic, Ends] {
            let tolerance = Tolerance { error, half_range: 0.2, distribution };
            let sheet = ToleranceSheet::of_errors(vec![tolerance]);
            let mixture = ErrorMixture::new(&sheet).unwrap();
            let draw = |i| draw_errors((&sheet.errors, &mixture), 7, i)[0];
            let squares = (0..20_000).map(|i| draw(i).powi(2));
            let found = (squares.sum::<f64>() / 20_000.0).sqrt();
            let expected = tolerance.deviation();
            assert!((found / expected - 1.0).abs() < 0.03, "{distribution:?}: {found} {expected}");
        }
    }

    /// Errors of one group have their deviations and their coefficient; those that are the same differ by
    /// their deviations alone, and others know nothing of them.
    #[test]
    fn correlated_errors_have_their_coefficient() {
        use ErrorDistribution::{Normal, Uniform};
        let error = Perturbation::of_surface(PerturbationKind::Thickness, 0);
        let tolerance =
            |half_range: f64, distribution| Tolerance { error, half_range, distribution };
        let mut sheet = ToleranceSheet::of_errors(vec![
            tolerance(0.2, Normal),
            tolerance(0.1, Uniform),
            tolerance(0.3, Normal),
            tolerance(0.6, Normal),
        ]);
        let correlation = |errors: &[usize], coefficient| ErrorCorrelation {
            errors: errors.to_vec(),
            coefficient,
        };
        sheet.correlations = vec![correlation(&[0, 1], -0.6), correlation(&[2, 3], 1.0)];
        let mixture = ErrorMixture::new(&sheet).unwrap();
        let lenses: Vec<Vec<f64>> =
            (0..40_000).map(|i| draw_errors((&sheet.errors, &mixture), 5, i)).collect();
        let mean = |a: usize, b: usize| {
            lenses.iter().map(|p| p[a] * p[b]).sum::<f64>() / lenses.len() as f64
        };
        for (i, own) in sheet.errors.iter().enumerate() {
            assert!((mean(i, i).sqrt() / own.deviation() - 1.0).abs() < 0.02, "{i}");
        }
        let found = |a: usize, b: usize| mean(a, b) / (mean(a, a) * mean(b, b)).sqrt();
        // Four standard errors.
        assert!((found(0, 1) + 0.6).abs() < 0.02 && found(0, 2).abs() < 0.02);
        assert!(lenses.iter().all(|p| (p[3] - 2.0 * p[2]).abs() < 1e-14));
    }
}
