//! Sets of wavelengths that designers begin with, and field points that share the area of the field.

use super::glass::line;
use super::{FieldKind, FieldPoint, Fields, Wavelength};

/// The green line of mercury, in micrometres.
const E: f64 = 0.5460740;
/// The blue line of cadmium, in micrometres.
const F_PRIME: f64 = 0.4799914;
/// The red line of cadmium, in micrometres.
const C_PRIME: f64 = 0.6438469;

/// A usual set of wavelengths.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WavelengthPreset {
    /// The short name, without blanks, for the command line.
    pub name: &'static str,
    /// The title in menus.
    pub title: &'static str,
    /// The wavelengths in micrometres with their weights.
    lines: &'static [(f64, f64)],
    /// The index of the primary wavelength.
    primary: usize,
}

impl WavelengthPreset {
    /// Every preset, the most usual one first.
    pub const ALL: [Self; 10] = [
        Self {
            name: "F-d-C",
            title: "F, d, C (visible)",
            lines: &[(line::F, 1.0), (line::D, 1.0), (line::C, 1.0)],
            primary: 1,
        },
        Self {
            name: "F'-e-C'",
            title: "F', e, C' (visible)",
            lines: &[(F_PRIME, 1.0), (E, 1.0), (C_PRIME, 1.0)],
            primary: 1,
        },
        Self {
            name: "486-656",
            title: "486 to 656 nm in five steps",
            lines: &[(0.486, 1.0), (0.5285, 1.0), (0.571, 1.0), (0.6135, 1.0), (0.656, 1.0)],
            primary: 2,
        },
        // The weights are the luminous efficiency V(λ) of CIE 1924 for photopic vision.
        Self {
            name: "photopic",
            title: "Photopic, five by the eye",
            lines: &[(0.47, 0.091), (0.51, 0.503), (0.555, 1.0), (0.61, 0.503), (0.65, 0.107)],
            primary: 2,
        },
        Self::single("d", "d line, 587.6 nm", &[(line::D, 1.0)]),
        Self::single("argon", "Argon laser, 488 nm", &[(0.488, 1.0)]),
        Self::single("532", "Doubled Nd:YAG laser, 532 nm", &[(0.532, 1.0)]),
        Self::single("HeNe", "Helium-neon laser, 632.8 nm", &[(0.6328, 1.0)]),
        Self::single("1064", "Nd:YAG laser, 1064 nm", &[(1.0641, 1.0)]),
        Self::single("1550", "Telecommunication, 1550 nm", &[(1.55, 1.0)]),
    ];

    const fn single(name: &'static str, title: &'static str, lines: &'static [(f64, f64)]) -> Self {
        Self { name, title, lines, primary: 0 }
    }

    /// The wavelengths.
    pub fn wavelengths(&self) -> Vec<Wavelength> {
        let lines = self.lines.iter().enumerate();
        lines
            .map(|(i, &(um, weight))| Wavelength { um, weight, primary: i == self.primary })
            .collect()
    }

    /// The preset with exactly these wavelengths, weights and primary wavelength.
    pub fn of(wavelengths: &[Wavelength]) -> Option<&'static Self> {
        const { &Self::ALL }.iter().find(|preset| preset.wavelengths() == wavelengths)
    }
}

impl Fields {
    /// Field points from the axis to `max` along y, in steps that divide a round field into rings of
    /// equal area: the i-th of n + 1 points lies at `max √(i/n)`. A single point lies on the axis.
    pub fn equal_area(kind: FieldKind, max: f64, count: usize) -> Self {
        let steps = count.max(2) - 1;
        let y = |i: usize| max * (i as f64 / steps as f64).sqrt();
        let values = (0..count.max(1)).map(|i| FieldPoint { x: 0.0, y: y(i), weight: 1.0 });
        Self { kind, values: values.collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_preset_has_one_primary_wavelength_and_is_recognized() {
        for preset in &WavelengthPreset::ALL {
            let waves = preset.wavelengths();
            assert_eq!(waves.iter().filter(|w| w.primary).count(), 1, "{}", preset.name);
            assert!(waves.windows(2).all(|pair| pair[0].um < pair[1].um), "{}", preset.name);
            assert_eq!(WavelengthPreset::of(&waves), Some(preset));
        }
    }

    #[test]
    fn equal_area_fields_divide_the_field_into_rings_of_one_area() {
        let fields = Fields::equal_area(FieldKind::Angle, 20.0, 4);
        let squares: Vec<f64> = fields.values.iter().map(|f| f.y * f.y).collect();
        for (i, square) in squares.iter().enumerate() {
            assert!((square - 400.0 * i as f64 / 3.0).abs() < 1e-12);
        }
        let axis = Fields::equal_area(FieldKind::Angle, 20.0, 1);
        assert_eq!(axis.values, [FieldPoint { x: 0.0, y: 0.0, weight: 1.0 }]);
    }
}
