//! The change of the index of glass with temperature.

use super::line;
use serde::{Deserialize, Serialize};

/// The temperatures in °C for which the formula holds.
pub const THERMAL_RANGE: [f64; 2] = [-100.0, 140.0];
/// The pressure of air on which relative indices are based, in atmospheres: that of the catalogues.
const ATMOSPHERES: f64 = 1.0;

/// The change of the index of a glass with temperature: with `ΔT` from a reference temperature, the index
/// `n` in vacuum changes by `(n² − 1)/(2n) · (D₀ΔT + D₁ΔT² + D₂ΔT³ + (E₀ΔT + E₁ΔT²)/(λ² − λtk²))`, λ in µm
/// (Schott, *TIE-19: Temperature coefficient of the refractive index*).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ThermalDispersion {
    /// D₀, D₁, D₂, E₀, E₁ and λtk.
    pub coefficients: [f64; 6],
    /// The reference temperature, in °C.
    pub celsius: f64,
}

impl ThermalDispersion {
    /// The index relative to air at another temperature, both of that temperature, from the `index` of the
    /// catalogue, relative to air at the reference temperature; the wavelength is in µm.
    pub fn index_at(&self, index: f64, um: f64, celsius: f64) -> f64 {
        let [d0, d1, d2, e0, e1, resonance] = self.coefficients;
        let absolute = index * air_index(um, self.celsius);
        let by = celsius - self.celsius;
        let near_resonance = by * (e0 + e1 * by) / (um * um - resonance * resonance);
        let sum = by * (d0 + by * (d1 + by * d2)) + near_resonance;
        let change = (absolute * absolute - 1.0) / (2.0 * absolute) * sum;
        (absolute + change) / air_index(um, celsius)
    }

    /// The change of the index in 1/K relative to air, at the d line and 20 °C.
    pub fn slope_at_d(&self, nd: f64) -> f64 {
        let at = |celsius| self.index_at(nd, line::D, celsius);
        (at(25.0) - at(15.0)) / 10.0
    }
}

/// The index of air at a temperature and at the pressure of the catalogues (Kohlrausch, *Praktische
/// Physik*, 1968, volume 1, page 408, as Schott's TIE-19 has it); the wavelength is in µm.
pub(super) fn air_index(um: f64, celsius: f64) -> f64 {
    let square = um * um;
    let reference = 6432.8
        + 2_949_810.0 * square / (146.0 * square - 1.0)
        + 25_540.0 * square / (41.0 * square - 1.0);
    1.0 + 1e-8 * reference * ATMOSPHERES / (1.0 + (celsius - 15.0) * 3.4785e-3)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::glass::find;

    /// The data sheet of N-BK7 (Schott, 2014) has the mean change between two temperatures in 1e-6/K, in
    /// vacuum and relative to air, with one decimal.
    #[test]
    fn n_bk7_changes_as_its_data_sheet_says() {
        let glass = find("SCHOTT N-BK7").unwrap();
        let thermal = glass.properties().unwrap().thermal.unwrap();
        let at = |um, celsius| thermal.index_at(glass.index(um).unwrap(), um, celsius);
        let relative =
            |um, [low, high]: [f64; 2]| 1e6 * (at(um, high) - at(um, low)) / (high - low);
        let absolute = |um, [low, high]: [f64; 2]| {
            let of = |celsius| at(um, celsius) * air_index(um, celsius);
            1e6 * (of(high) - of(low)) / (high - low)
        };
        let sheet = [
            ([-40.0, -20.0], [2.4, 2.9, 3.3], [0.3, 0.8, 1.2]),
            ([20.0, 40.0], [2.4, 3.0, 3.5], [1.1, 1.6, 2.1]),
            ([60.0, 80.0], [2.5, 3.1, 3.7], [1.5, 2.1, 2.7]),
        ];
        for (range, by_air, in_vacuum) in sheet {
            for ((um, expected), vacuum) in
                [1.060, 0.5460740, 0.4358343].into_iter().zip(by_air).zip(in_vacuum)
            {
                assert!((relative(um, range) - expected).abs() < 0.06, "{um} {range:?}");
                assert!((absolute(um, range) - vacuum).abs() < 0.06, "{um} {range:?}");
            }
        }
        // At its own temperature it has the index of the catalogue.
        assert!((at(line::D, thermal.celsius) - glass.nd).abs() < 1e-6);
    }

    /// Air at 15 °C and 760 mm of mercury has the index 1.00027665 at 0.6 µm or so.
    #[test]
    fn air_has_the_index_of_the_tables() {
        assert!((air_index(0.5875618, 15.0) - 1.000_277).abs() < 1e-6);
        assert!(air_index(0.5875618, 100.0) < air_index(0.5875618, 15.0));
    }
}
