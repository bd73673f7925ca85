//! The positions of a zoom lens: the numbers, the aperture and the fields that differ from the
//! prescription.

use super::{Aperture, Fields, Quantity};
use serde::{Deserialize, Serialize};

/// One position of a zoom lens: the data that differ from the prescription.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Default)]
#[serde(from = "ZoomPositionKeys", into = "ZoomPositionKeys")]
pub struct ZoomPosition {
    /// The name of the position.
    pub name: String,
    /// The numbers that differ, at most one for a quantity of a row; thicknesses first, as in a file.
    pub numbers: Vec<ZoomNumber>,
    /// The aperture at this position, if it differs.
    pub aperture: Option<Aperture>,
    /// The field points at this position, if they differ.
    pub fields: Option<Fields>,
}

/// A number at one zoom position, in the unit of its quantity.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ZoomNumber {
    /// The index of the row.
    pub surface: usize,
    /// The quantity.
    pub quantity: Quantity,
    /// Its value.
    pub value: f64,
}

impl ZoomNumber {
    /// The thickness in mm of the gap behind the row with index `surface`.
    pub const fn thickness(surface: usize, value: f64) -> Self {
        Self { surface, quantity: Quantity::Thickness, value }
    }

    fn is(&self, surface: usize, quantity: Quantity) -> bool {
        self.surface == surface && self.quantity == quantity
    }
}

impl ZoomPosition {
    /// The number of a quantity; `None` where it does not differ from the prescription.
    pub fn number(&self, surface: usize, quantity: Quantity) -> Option<f64> {
        self.numbers.iter().find(|own| own.is(surface, quantity)).map(|own| own.value)
    }

    /// Gives a quantity a number of its own.
    pub fn set_number(&mut self, surface: usize, quantity: Quantity, value: f64) {
        if let Some(own) = self.numbers.iter_mut().find(|own| own.is(surface, quantity)) {
            own.value = value;
            return;
        }
        let own = ZoomNumber { surface, quantity, value };
        let is_gap = |own: &ZoomNumber| own.quantity == Quantity::Thickness;
        let gaps = self.numbers.partition_point(is_gap);
        let at = if is_gap(&own) { gaps } else { self.numbers.len() };
        self.numbers.insert(at, own);
    }

    /// Makes a quantity that of the prescription.
    pub fn remove_number(&mut self, surface: usize, quantity: Quantity) {
        self.numbers.retain(|own| !own.is(surface, quantity));
    }
}

/// The keys of a zoom position in a file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ZoomPositionKeys {
    #[serde(default, skip_serializing_if = "String::is_empty")]
    name: String,
    thicknesses: Vec<ZoomThickness>,
    /// The numbers that are no thicknesses.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    numbers: Vec<ZoomNumber>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    aperture: Option<Aperture>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    fields: Option<Fields>,
}

/// A thickness of a zoom position in a file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ZoomThickness {
    surface: usize,
    thickness: f64,
}

impl From<ZoomPositionKeys> for ZoomPosition {
    fn from(keys: ZoomPositionKeys) -> Self {
        let ZoomPositionKeys { name, thicknesses, numbers, aperture, fields } = keys;
        let gaps = thicknesses.iter().map(|gap| ZoomNumber::thickness(gap.surface, gap.thickness));
        Self { name, numbers: gaps.chain(numbers).collect(), aperture, fields }
    }
}

impl From<ZoomPosition> for ZoomPositionKeys {
    fn from(position: ZoomPosition) -> Self {
        let ZoomPosition { name, numbers, aperture, fields } = position;
        let (gaps, numbers): (Vec<_>, Vec<_>) =
            numbers.into_iter().partition(|own| own.quantity == Quantity::Thickness);
        let gap = |own: ZoomNumber| ZoomThickness { surface: own.surface, thickness: own.value };
        Self { name, thicknesses: gaps.into_iter().map(gap).collect(), numbers, aperture, fields }
    }
}
