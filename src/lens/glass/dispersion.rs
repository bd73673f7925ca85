//! Dispersion formulas: the index as a function of the wavelength.

use serde::{Deserialize, Serialize};

/// A dispersion formula, with the wavelength λ in micrometres.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DispersionFormula {
    /// `n² = 1 + c₀ + Σ Bᵢ λ²/(λ² − Cᵢ)`.
    SellmeierSq,
    /// `n² = 1 + c₀ + Σ Bᵢ λ²/(λ² − Cᵢ²)`.
    SellmeierLin,
    /// `n² = c₀ + Σ cᵢ λ^pᵢ`.
    Poly,
    /// `n = A + B L + C L² + D λ² + E λ⁴ + F λ⁶` with `L = 1/(λ² − 0.028)`.
    Herzberger,
    /// `n² = 1 + A + B₁ λ²/(λ² − C₁²) + B₂/(λ² − C₂²)`.
    SellmeierTwo,
    /// `n = A + B/λ + C/λ^3.5`.
    Conrady,
    /// `n² = A + B/(λ² − C) − D λ²`.
    HandbookOne,
    /// `n² = A + B λ²/(λ² − C) − D λ²`.
    HandbookTwo,
    /// `n = c₀ + Σ cᵢ λ^pᵢ`.
    Cauchy,
    /// `n = 1 + c₀ + Σ Bᵢ/(Cᵢ − 1/λ²)`.
    Gas,
    /// `(n² − 1)/(n² + 2) = A + B λ²/(λ² − C) + D λ²`.
    LorentzLorenz,
    /// `n² = A + B/(λ² − C) + D (λ − E)/((λ − E)² + F)`.
    Resonance,
    /// `n² = c₀ + Σ B λ^p/(λ² − C^q) + Σ cᵢ λ^pᵢ` with two terms in the first sum.
    ResonancesAndPowers,
}

/// The constant of Herzberger's formula, in µm².
const HERZBERGER: f64 = 0.028;

impl DispersionFormula {
    /// The index at a wavelength in micrometres; `None` where the formula has no value. Missing
    /// coefficients are zero.
    pub fn index(self, coefficients: &[f64], um: f64) -> Option<f64> {
        let c = |i: usize| coefficients.get(i).copied().unwrap_or(0.0);
        let l2 = um * um;
        let sum = |term: &dyn Fn(f64, f64) -> f64| -> f64 {
            let pairs = coefficients.get(1..).unwrap_or_default().chunks_exact(2);
            c(0) + pairs.map(|pair| term(pair[0], pair[1])).sum::<f64>()
        };
        let square = match self {
            Self::SellmeierSq => 1.0 + sum(&|b, c| b * l2 / (l2 - c)),
            Self::SellmeierLin => 1.0 + sum(&|b, c| b * l2 / (l2 - c * c)),
            Self::Poly => sum(&|c, power| c * um.powf(power)),
            Self::SellmeierTwo => {
                1.0 + c(0) + c(1) * l2 / (l2 - c(2) * c(2)) + c(3) / (l2 - c(4) * c(4))
            }
            Self::HandbookOne => c(0) + c(1) / (l2 - c(2)) - c(3) * l2,
            Self::HandbookTwo => c(0) + c(1) * l2 / (l2 - c(2)) - c(3) * l2,
            Self::Herzberger => {
                let l = 1.0 / (l2 - HERZBERGER);
                let far = l2 * (c(3) + l2 * (c(4) + l2 * c(5)));
                return finite(c(0) + l * (c(1) + l * c(2)) + far);
            }
            Self::Conrady => return finite(c(0) + c(1) / um + c(2) / um.powf(3.5)),
            Self::Cauchy => return finite(sum(&|c, power| c * um.powf(power))),
            Self::Gas => return finite(1.0 + sum(&|b, c| b / (c - 1.0 / l2))),
            Self::LorentzLorenz => {
                let ratio = c(0) + c(1) * l2 / (l2 - c(2)) + c(3) * l2;
                (1.0 + 2.0 * ratio) / (1.0 - ratio)
            }
            Self::Resonance => {
                let away = um - c(4);
                c(0) + c(1) / (l2 - c(2)) + c(3) * away / (away * away + c(5))
            }
            Self::ResonancesAndPowers => resonances_and_powers(coefficients, um),
        };
        (square > 0.0).then(|| square.sqrt()).and_then(finite)
    }
}

/// The square of the index by [`DispersionFormula::ResonancesAndPowers`].
fn resonances_and_powers(coefficients: &[f64], um: f64) -> f64 {
    let (first, rest) = coefficients.split_at(coefficients.len().min(1));
    let (resonances, powers) = rest.split_at(rest.len().min(8));
    let resonance = |term: &[f64]| match *term {
        // A term that is absent has no pole either.
        [0.0, ..] => 0.0,
        [b, power, c, exponent] => b * um.powf(power) / (um * um - c.powf(exponent)),
        _ => f64::NAN,
    };
    first.iter().sum::<f64>()
        + resonances.chunks(4).map(resonance).sum::<f64>()
        + powers.chunks_exact(2).map(|term| term[0] * um.powf(term[1])).sum::<f64>()
}

fn finite(index: f64) -> Option<f64> {
    (index.is_finite() && index > 0.0).then_some(index)
}

#[cfg(test)]
mod tests {
    use super::DispersionFormula as F;

    #[test]
    fn every_formula_is_that_of_its_definition() {
        let um: f64 = 0.6;
        let l2 = 0.36_f64;
        let at = |formula: F, c: &[f64]| formula.index(c, um).unwrap();
        let close = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-15);
        close(at(F::SellmeierSq, &[0.1, 1.0, 0.01]), (1.1 + l2 / 0.35).sqrt());
        close(at(F::SellmeierLin, &[0.1, 1.0, 0.1]), (1.1 + l2 / 0.35).sqrt());
        close(at(F::Poly, &[2.0, 0.5, 2.0, 0.01, -2.0]), (2.0 + 0.18 + 0.01 / l2).sqrt());
        close(
            at(F::SellmeierTwo, &[0.1, 1.0, 0.1, 0.2, 0.2]),
            (1.1 + l2 / 0.35 + 0.2 / 0.32).sqrt(),
        );
        close(at(F::HandbookOne, &[2.0, 0.1, 0.01, 0.02]), (2.0 + 0.1 / 0.35 - 0.02 * l2).sqrt());
        close(
            at(F::HandbookTwo, &[2.0, 0.1, 0.01, 0.02]),
            (2.0 + 0.1 * l2 / 0.35 - 0.02 * l2).sqrt(),
        );
        close(at(F::Conrady, &[1.5, 0.01, 0.001]), 1.5 + 0.01 / um + 0.001 / um.powf(3.5));
        let l = 1.0 / (l2 - 0.028);
        let far = 0.01 * l2 + 0.002 * l2 * l2 + 0.0003 * l2 * l2 * l2;
        close(
            at(F::Herzberger, &[1.5, 0.01, 0.001, 0.01, 0.002, 0.0003]),
            1.5 + 0.01 * l + 0.001 * l * l + far,
        );
    }

    #[test]
    fn where_a_formula_has_no_value_there_is_no_index() {
        assert_eq!(F::SellmeierSq.index(&[0.0, 1.0, 0.25], 0.5), None);
        assert_eq!(F::Poly.index(&[-1.0], 0.5), None);
        assert_eq!(F::Conrady.index(&[], 0.5), None);
        assert_eq!(F::Herzberger.index(&[f64::NAN], 0.5), None);
    }
}
