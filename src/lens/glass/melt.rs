//! A glass from the indices that were measured on a melt of it.

use super::{DispersionFormula, Glass};
use nalgebra::{Matrix2, Vector2};

/// The largest difference of an index from that of the catalogue that a melt has.
const MELT_SPREAD: f64 = 0.01;

/// The fault of indices that are no melt of a glass.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeltError {
    /// No index.
    #[error("found no index; expected one at least")]
    Empty,
    /// A wavelength outside the range of the glass.
    #[error("{glass} has no index at {um} um; expected a wavelength from {low} to {high} um")]
    Wavelength {
        /// The glass.
        glass: String,
        /// The wavelength in micrometres.
        um: f64,
        /// The shortest wavelength of its formula.
        low: f64,
        /// The longest wavelength of its formula.
        high: f64,
    },
    /// An index that no melt of the glass has.
    #[error(
        "found {found} at {um} um, where {glass} has {index:.6}; expected a melt within 0.01 of it"
    )]
    Index {
        /// The glass.
        glass: String,
        /// The wavelength in micrometres.
        um: f64,
        /// The index that was measured.
        found: f64,
        /// That of the catalogue.
        index: f64,
    },
    /// A formula that has no constant and no factor to change.
    #[error(
        "the formula of {0} cannot be fitted; expected a glass with Sellmeier's or Schott's formula"
    )]
    Formula(String),
    /// The same wavelength twice, or too small a difference between two.
    #[error("found wavelengths that do not tell its dispersion; expected different ones")]
    Singular,
}

impl Glass {
    /// The glass of a melt: wavelengths in µm, each with the index that was measured there relative to air.
    /// The square of the index less its constant is scaled, and from two wavelengths on the constant is
    /// changed as well, both by least squares. Returns the glass and the largest difference that is left.
    ///
    /// # Errors
    /// See [`MeltError`].
    pub fn melt(&self, name: &str, measured: &[[f64; 2]]) -> Result<(Self, f64), MeltError> {
        let constant = self.constant().ok_or_else(|| MeltError::Formula(self.full_name()))?;
        let [factor, offset] = self.fit(constant, measured)?;
        let mut melted = Self { name: name.to_owned(), ..self.clone() };
        melted.change(factor, offset);
        let left =
            measured.iter().filter_map(|[um, index]| Some((melted.index(*um)? - index).abs()));
        let left = left.fold(0.0, f64::max);
        Ok((melted, left))
    }

    /// The constant of the formula for the square of the index; `None` for another kind of formula.
    fn constant(&self) -> Option<f64> {
        let first = self.coefficients.first().copied().unwrap_or(0.0);
        match self.formula {
            DispersionFormula::SellmeierSq | DispersionFormula::SellmeierLin => Some(1.0 + first),
            DispersionFormula::Poly => Some(first),
            _ => None,
        }
    }

    /// The relative change of the part that depends on the wavelength, and that of the constant.
    fn fit(&self, constant: f64, measured: &[[f64; 2]]) -> Result<[f64; 2], MeltError> {
        let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
        for [um, found] in measured.iter().copied() {
            let [low, high] = self.range_um;
            let glass = || self.full_name();
            let index = self.index(um);
            let index =
                index.ok_or_else(|| MeltError::Wavelength { glass: glass(), um, low, high })?;
            if !((found - index).abs() <= MELT_SPREAD) {
                return Err(MeltError::Index { glass: glass(), um, found, index });
            }
            let row = Vector2::new(index * index - constant, 1.0);
            normal += row * row.transpose();
            right += row * (found * found - index * index);
        }
        match measured.len() {
            0 => Err(MeltError::Empty),
            1 => Ok([right[0] / normal[(0, 0)], 0.0]),
            _ => {
                let inverse = normal.try_inverse().ok_or(MeltError::Singular)?;
                let found = inverse * right;
                // A change of the dispersion by more than a part in ten is no melt but rounding.
                let is_melt = found[0].abs() < 0.1 && found.iter().all(|change| change.is_finite());
                if is_melt { Ok([found[0], found[1]]) } else { Err(MeltError::Singular) }
            }
        }
    }

    /// Scales the part of the formula that depends on the wavelength, and adds to its constant.
    fn change(&mut self, factor: f64, offset: f64) {
        for pair in self.coefficients.get_mut(1..).unwrap_or_default().chunks_exact_mut(2) {
            pair[0] *= 1.0 + factor;
        }
        if let Some(first) = self.coefficients.first_mut() {
            *first += offset;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::glass::{find, line};

    fn bk7() -> &'static Glass {
        find("SCHOTT N-BK7").unwrap()
    }

    #[test]
    fn a_melt_has_the_indices_that_were_measured() {
        for name in ["SCHOTT N-BK7", "CDGM H-K9L", "SCHOTT N-SF11"] {
            let glass = find(name).unwrap();
            let at = |um: f64, by: f64| [um, glass.index(um).unwrap() + by];
            let (one, left) = glass.melt("M", &[at(line::D, 2.3e-4)]).unwrap();
            assert!(left < 1e-14 && one.name == "M", "{name} {left}");
            let pair = [at(line::F, 2.1e-4), at(line::C, 1.9e-4)];
            let (two, left) = glass.melt("M", &pair).unwrap();
            assert!(left < 1e-12, "{name} {left}");
            // Between both lines the index moves by something between both changes.
            let moved = two.index(line::D).unwrap() - glass.index(line::D).unwrap();
            assert!((1.9e-4..2.1e-4).contains(&moved), "{name} {moved}");
            // Three changes that no melt has are fitted as well as it goes.
            let three = [at(line::F, 1e-4), at(line::D, -1e-4), at(line::C, 1e-4)];
            let (_, left) = glass.melt("M", &three).unwrap();
            assert!((1e-5..2e-4).contains(&left), "{name} {left}");
        }
    }

    #[test]
    fn what_is_no_melt_is_refused() {
        let glass = bk7();
        let refused = |measured: &[[f64; 2]]| glass.melt("M", measured).unwrap_err();
        assert_eq!(refused(&[]), MeltError::Empty);
        assert!(matches!(refused(&[[0.1, 1.5]]), MeltError::Wavelength { .. }));
        for index in [1.6, f64::NAN, 0.0, f64::INFINITY] {
            assert!(matches!(refused(&[[line::D, index]]), MeltError::Index { .. }), "{index}");
        }
        assert_eq!(refused(&[[line::D, 1.5168], [line::D, 1.5169]]), MeltError::Singular);
        let water = Glass { formula: DispersionFormula::Gas, ..glass.clone() };
        assert!(water.melt("M", &[[line::D, 1.5168]]).is_err());
    }
}
