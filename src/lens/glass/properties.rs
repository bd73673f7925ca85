//! Properties of a glass beside its dispersion.
//!
//! Those of the program's own glasses are in `assets/glass_properties.json`, from the data sheets that
//! the refractiveindex.info database (CC0) collects.

use super::thermal::ThermalDispersion;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::fmt;
use std::sync::OnceLock;

/// The availability of a glass, as its maker states it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GlassStatus {
    /// Regularly made.
    Standard,
    /// Kept in stock, and made often.
    Preferred,
    /// No longer made.
    Obsolete,
    /// Made on demand.
    Special,
    /// Made from the data of a melt.
    Melt,
}

impl GlassStatus {
    /// All of them, in the order of the numbers in catalogues `.agf`.
    pub const ALL: [Self; 5] =
        [Self::Standard, Self::Preferred, Self::Obsolete, Self::Special, Self::Melt];

    /// Its name in files and reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Standard => "standard",
            Self::Preferred => "preferred",
            Self::Obsolete => "obsolete",
            Self::Special => "special",
            Self::Melt => "melt",
        }
    }
}

impl fmt::Display for GlassStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The properties of a glass beside its dispersion, as far as its catalogue has them.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GlassProperties {
    /// Its status with the maker.
    pub status: Option<GlassStatus>,
    /// The price relative to that of N-BK7.
    pub relative_cost: Option<f64>,
    /// The linear expansion around room temperature (from −30 to 70 °C with most makers), in 1e-6/K.
    pub expansion: Option<f64>,
    /// The change of the index with temperature.
    pub thermal: Option<ThermalDispersion>,
    /// The classes of resistance to climate, stains, acid, alkali and phosphate, 0 or 1 being the best.
    pub resistance: [Option<f64>; 5],
    /// Wavelength in µm, internal transmission and the thickness in mm that has it, by wavelength.
    pub transmission: Vec<[f64; 3]>,
}

impl GlassProperties {
    /// The internal transmission through a thickness in mm at a wavelength in µm; `None` outside of those of
    /// the catalogue.
    pub fn internal_transmission(&self, um: f64, mm: f64) -> Option<f64> {
        Some((-self.absorbance(um)? * mm).exp())
    }

    /// The absorbance in 1/mm at a wavelength in µm, the negative natural logarithm of the internal
    /// transmission over the thickness, between the two nearest wavelengths of the catalogue; `None` outside
    /// them.
    pub fn absorbance(&self, um: f64) -> Option<f64> {
        let after = self.transmission.iter().position(|entry| entry[0] >= um)?;
        // Some catalogues have a transmission above 1.
        let absorbance = |entry: &[f64; 3]| -entry[1].clamp(f64::MIN_POSITIVE, 1.0).ln() / entry[2];
        let [end, value] = [self.transmission[after][0], absorbance(&self.transmission[after])];
        if end == um {
            return Some(value);
        }
        let before = &self.transmission[after.checked_sub(1)?];
        let part = (um - before[0]) / (end - before[0]);
        Some(absorbance(before) * (1.0 - part) + value * part)
    }
}

#[derive(Deserialize)]
struct PropertyFile {
    glasses: HashMap<String, GlassProperties>,
}

/// The properties of a glass of the program, by its full name.
pub(super) fn find(full_name: &str) -> Option<&'static GlassProperties> {
    static PROPERTIES: OnceLock<HashMap<String, GlassProperties>> = OnceLock::new();
    let all = PROPERTIES.get_or_init(|| {
        let text = include_str!("../../../assets/glass_properties.json");
        let parsed: Result<PropertyFile, _> = serde_json::from_str(text);
        parsed.map(|file| file.glasses).unwrap_or_default()
    });
    all.get(full_name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::glass::{find as find_glass, known};

    #[test]
    fn nearly_every_glass_has_properties() {
        let all: Vec<_> = known().filter_map(|glass| glass.properties()).collect();
        assert!(all.len() > 1600, "{}", all.len());
        assert!(all.iter().filter(|p| p.thermal.is_some()).count() > 1250);
        assert!(all.iter().filter(|p| p.status == Some(GlassStatus::Preferred)).count() > 400);
    }

    /// N-BK7 passes 0.997 at 420 nm through 10 mm (data sheet of the maker).
    #[test]
    fn transmission_is_a_power_of_the_thickness() {
        let glass = find_glass("SCHOTT N-BK7").unwrap().properties().unwrap();
        let through = |um, mm| glass.internal_transmission(um, mm).unwrap();
        assert!((through(0.42, 10.0) - 0.997).abs() < 5e-4);
        assert!((through(0.42, 25.0) - through(0.42, 10.0).powf(2.5)).abs() < 1e-12);
        // Between two wavelengths of the catalogue it is between both.
        assert!(through(0.375, 10.0) > through(0.37, 10.0));
        assert!(through(0.375, 10.0) < through(0.38, 10.0));
        assert_eq!(glass.internal_transmission(0.2, 10.0), None);
        assert_eq!(glass.internal_transmission(20.0, 10.0), None);
    }

    /// A glass through which nothing passes at one wavelength has a transmission of zero there, not NaN.
    #[test]
    fn an_opaque_glass_has_no_light() {
        let transmission = vec![[0.3, 0.0, 10.0], [0.4, 0.9, 10.0]];
        let glass = GlassProperties { transmission, ..GlassProperties::default() };
        assert!(glass.internal_transmission(0.3, 10.0).unwrap() < 1e-300);
        assert!(glass.internal_transmission(0.35, 1.0).unwrap() < 1e-9);
        assert_eq!(glass.internal_transmission(0.3, 0.0), Some(1.0));
    }
}
