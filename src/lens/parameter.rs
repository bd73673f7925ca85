//! The name of one number of a lens, and access to the number by it.

use super::{
    ASPHERE_TERMS, Aperture, FREEFORM_NUMBERS, Lens, Medium, PROFILE_TERMS, RADIAL_TERMS, Row,
    SurfaceNumber,
};
use serde::{Deserialize, Serialize};
use std::fmt;

/// A quantity of a row: a surface and the gap behind it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// The curvature, in 1/mm.
    Curvature,
    /// The conic constant.
    Conic,
    /// The asphere coefficient with index 0 (r⁴) to 6 (r¹⁶).
    Asphere(usize),
    /// The thickness of the gap behind the surface, in mm.
    Thickness,
    /// The refractive index of a model glass or constant medium behind the surface; of a GRIN medium
    /// the index of its base.
    Index,
    /// The coefficient of the GRIN medium behind the surface with index 0 (r²) to 5 (r¹²) or
    /// 6 (z) to 9 (z⁴).
    #[serde(rename = "gradient")]
    Grin(usize),
    /// The semi-diameter, in mm.
    SemiDiameter,
    /// The number of a freeform with this index, in the order of its kind.
    Freeform(usize),
}

/// One number of a lens: a quantity of a row, at all zoom positions or at one of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(from = "ParameterKeys", into = "ParameterKeys")]
pub struct Parameter {
    /// The index of the row.
    pub surface: usize,
    /// The quantity.
    pub quantity: Quantity,
    /// The index of the zoom position; `None` for the number at every position without one of its own.
    pub zoom: Option<usize>,
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Curvature => f.write_str("curvature of"),
            Self::Conic => f.write_str("conic constant of"),
            Self::Asphere(term) => write!(f, "asphere coefficient of r^{} of", 2 * term + 4),
            Self::Thickness => f.write_str("thickness after"),
            Self::Index => f.write_str("index after"),
            Self::Grin(k) => match k.checked_sub(RADIAL_TERMS) {
                None => write!(f, "GRIN coefficient {} of r after", k + 1),
                Some(j) => write!(f, "GRIN coefficient {} of z after", j + 1),
            },
            Self::SemiDiameter => f.write_str("semi-diameter of"),
            Self::Freeform(k) => write!(f, "freeform number {} of", k + 1),
        }
    }
}

impl fmt::Display for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} surface {}", self.quantity, SurfaceNumber::new(self.surface))?;
        self.zoom.map_or(Ok(()), |zoom| write!(f, " at zoom position {zoom}"))
    }
}

impl Parameter {
    /// A quantity of the row with index `surface`, at every zoom position without one of its own.
    pub const fn new(surface: usize, quantity: Quantity) -> Self {
        Self { surface, quantity, zoom: None }
    }

    /// A quantity of the row with index `surface` at one zoom position.
    pub const fn at_zoom(surface: usize, quantity: Quantity, zoom: usize) -> Self {
        Self { surface, quantity, zoom: Some(zoom) }
    }

    /// The name in the window, which shows a curvature as its radius and counts zoom positions from 1.
    pub fn shown_name(self) -> String {
        let surface = SurfaceNumber::new(self.surface);
        let name = match self.quantity {
            Quantity::Curvature => format!("radius of surface {surface}"),
            quantity => format!("{quantity} surface {surface}"),
        };
        match self.zoom {
            Some(zoom) => format!("{name} at zoom position {}", zoom + 1),
            None => name,
        }
    }
}

/// The keys of a parameter in a file. A thickness at a zoom position is a quantity there.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ParameterKeys {
    surface: usize,
    quantity: QuantityKey,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    zoom: Option<usize>,
}

/// The key of a quantity in a file.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum QuantityKey {
    Curvature,
    Conic,
    Asphere(usize),
    Thickness,
    ZoomThickness(usize),
    Index,
    #[serde(rename = "gradient")]
    Grin(usize),
    SemiDiameter,
    Freeform(usize),
}

impl From<ParameterKeys> for Parameter {
    fn from(ParameterKeys { surface, quantity, zoom }: ParameterKeys) -> Self {
        let (quantity, zoom) = match quantity {
            QuantityKey::Curvature => (Quantity::Curvature, zoom),
            QuantityKey::Conic => (Quantity::Conic, zoom),
            QuantityKey::Asphere(term) => (Quantity::Asphere(term), zoom),
            QuantityKey::Thickness => (Quantity::Thickness, zoom),
            QuantityKey::ZoomThickness(zoom) => (Quantity::Thickness, Some(zoom)),
            QuantityKey::Index => (Quantity::Index, zoom),
            QuantityKey::Grin(k) => (Quantity::Grin(k), zoom),
            QuantityKey::SemiDiameter => (Quantity::SemiDiameter, zoom),
            QuantityKey::Freeform(k) => (Quantity::Freeform(k), zoom),
        };
        Self { surface, quantity, zoom }
    }
}

impl From<Parameter> for ParameterKeys {
    fn from(Parameter { surface, quantity, zoom }: Parameter) -> Self {
        let (quantity, zoom) = match (quantity, zoom) {
            (Quantity::Curvature, _) => (QuantityKey::Curvature, zoom),
            (Quantity::Conic, _) => (QuantityKey::Conic, zoom),
            (Quantity::Asphere(term), _) => (QuantityKey::Asphere(term), zoom),
            (Quantity::Thickness, Some(zoom)) => (QuantityKey::ZoomThickness(zoom), None),
            (Quantity::Thickness, None) => (QuantityKey::Thickness, None),
            (Quantity::Index, _) => (QuantityKey::Index, zoom),
            (Quantity::Grin(k), _) => (QuantityKey::Grin(k), zoom),
            (Quantity::SemiDiameter, _) => (QuantityKey::SemiDiameter, zoom),
            (Quantity::Freeform(k), _) => (QuantityKey::Freeform(k), zoom),
        };
        Self { surface, quantity, zoom }
    }
}

impl Medium {
    /// The index that a parameter can change, of a model glass at the d line; `None` if it is fixed.
    fn index(&self) -> Option<f64> {
        match self {
            Self::Model { nd: n, .. } | Self::Index(n) => Some(*n),
            Self::Grin(grin) => grin.base.index(),
            Self::Air | Self::Glass(_) | Self::Mirror => None,
        }
    }

    fn index_mut(&mut self) -> Option<&mut f64> {
        match self {
            Self::Model { nd: n, .. } | Self::Index(n) => Some(n),
            Self::Grin(grin) => grin.base.index_mut(),
            Self::Air | Self::Glass(_) | Self::Mirror => None,
        }
    }
}

impl Row {
    /// The quantities of which the row has a number; asphere coefficients as far as they are written.
    pub fn quantities(&self) -> Vec<Quantity> {
        let plain = [
            Quantity::Curvature,
            Quantity::Conic,
            Quantity::Thickness,
            Quantity::Index,
            Quantity::SemiDiameter,
        ];
        let all = plain
            .into_iter()
            .chain((0..self.asphere.len()).map(Quantity::Asphere))
            .chain((0..PROFILE_TERMS).map(Quantity::Grin))
            .chain((0..FREEFORM_NUMBERS).map(Quantity::Freeform));
        all.filter(|quantity| self.get(*quantity).is_some()).collect()
    }

    /// The value of a quantity; `None` if the row has no such number (the index of a catalogue glass,
    /// an unlimited semi-diameter).
    pub fn get(&self, quantity: Quantity) -> Option<f64> {
        match quantity {
            Quantity::Curvature => Some(self.curvature),
            Quantity::Conic => Some(self.conic),
            Quantity::Asphere(term) => {
                (term < ASPHERE_TERMS).then(|| self.asphere.get(term).copied().unwrap_or(0.0))
            }
            Quantity::Thickness => Some(self.thickness),
            Quantity::Index => self.medium.index(),
            Quantity::Grin(k) => match &self.medium {
                Medium::Grin(grin) => grin.term(k),
                _ => None,
            },
            Quantity::SemiDiameter => self.semi_diameter,
            Quantity::Freeform(k) => self.freeform.as_ref()?.numbers.get(k).copied(),
        }
    }

    /// Sets a quantity. Returns `false` and changes nothing if the row has no such number.
    pub fn set(&mut self, quantity: Quantity, value: f64) -> bool {
        match quantity {
            Quantity::Curvature => self.curvature = value,
            Quantity::Conic => self.conic = value,
            Quantity::Asphere(term) if term < ASPHERE_TERMS => {
                if self.asphere.len() <= term {
                    self.asphere.resize(term + 1, 0.0);
                }
                self.asphere[term] = value;
            }
            Quantity::Asphere(_) => return false,
            Quantity::Thickness => self.thickness = value,
            Quantity::Freeform(k) => {
                let form = self.freeform.as_mut();
                match form.and_then(|form| form.numbers.get_mut(k)) {
                    Some(number) => *number = value,
                    None => return false,
                }
            }
            Quantity::Index => match self.medium.index_mut() {
                Some(n) => *n = value,
                None => return false,
            },
            Quantity::Grin(k) => match &mut self.medium {
                Medium::Grin(grin) => return grin.set_term(k, value),
                _ => return false,
            },
            Quantity::SemiDiameter => self.semi_diameter = Some(value),
        }
        true
    }
}

impl Lens {
    /// Every parameter, row by row: those at all zoom positions, then those of which positions have
    /// numbers of their own.
    pub fn parameters(&self) -> Vec<Parameter> {
        let of_row = |(surface, row): (usize, &Row)| {
            let shared = row.quantities().into_iter().map(move |q| Parameter::new(surface, q));
            let positions = self.zoom.iter().enumerate();
            let numbers =
                positions.flat_map(|(zoom, at)| at.numbers.iter().map(move |own| (zoom, own)));
            let own = numbers.filter(move |(_, own)| own.surface == surface);
            shared
                .chain(own.map(move |(zoom, own)| Parameter::at_zoom(surface, own.quantity, zoom)))
        };
        self.surfaces.iter().enumerate().flat_map(of_row).collect()
    }

    /// The value of a parameter as written, at a zoom position without a number of its own that of all
    /// positions; `None` if the lens has no such number (no such row or zoom position, the index of a
    /// catalogue glass, an unlimited semi-diameter).
    pub fn get(&self, parameter: Parameter) -> Option<f64> {
        let Parameter { surface, quantity, zoom } = parameter;
        let shared = self.surfaces.get(surface)?.get(quantity)?;
        let Some(zoom) = zoom else { return Some(shared) };
        let own = self.zoom.get(zoom)?.number(surface, quantity);
        Some(own.unwrap_or(shared))
    }

    /// Sets a parameter. Returns `false` and changes nothing if the lens has no such number. The
    /// semi-diameter of the stop also sets an aperture that is given by it.
    pub fn set(&mut self, parameter: Parameter, value: f64) -> bool {
        let Parameter { surface, quantity, zoom } = parameter;
        let Some(row) = self.surfaces.get_mut(surface) else { return false };
        if let Some(zoom) = zoom {
            let Some(position) = self.zoom.get_mut(zoom).filter(|_| row.get(quantity).is_some())
            else {
                return false;
            };
            position.set_number(surface, quantity, value);
            return true;
        }
        if !row.set(quantity, value) {
            return false;
        }
        if let (Quantity::SemiDiameter, true, Aperture::StopSemiDiameter(stop)) =
            (quantity, row.stop, &mut self.aperture)
        {
            *stop = value;
        }
        true
    }

    /// The thickness of the gap behind a surface at a zoom position in mm; `None` without that row.
    pub fn thickness_at(&self, surface: usize, zoom: usize) -> Option<f64> {
        let own = self.zoom.get(zoom).and_then(|at| at.number(surface, Quantity::Thickness));
        own.or_else(|| self.surfaces.get(surface).map(|row| row.thickness))
    }

    /// A row with the numbers of a zoom position, or as it is at all others; `None` without that row.
    pub fn row_at(&self, surface: usize, zoom: Option<usize>) -> Option<Row> {
        let mut row = self.surfaces.get(surface)?.clone();
        let numbers = zoom.and_then(|zoom| self.zoom.get(zoom)).map(|at| &at.numbers);
        for own in numbers.into_iter().flatten().filter(|own| own.surface == surface) {
            row.set(own.quantity, own.value);
        }
        Some(row)
    }

    /// True if a quantity of a row has a number of its own at a zoom position.
    pub fn is_own_at(&self, zoom: usize, surface: usize, quantity: Quantity) -> bool {
        self.zoom.get(zoom).is_some_and(|at| at.number(surface, quantity).is_some())
    }

    /// The parameter whose value holds for a quantity of a row at a zoom position: that of the position
    /// if it has a number of its own, or else the common one.
    pub fn parameter_at(&self, zoom: usize, surface: usize, quantity: Quantity) -> Parameter {
        let zoom = self.is_own_at(zoom, surface, quantity).then_some(zoom);
        Parameter { surface, quantity, zoom }
    }

    /// True if a quantity of a row has a number of its own at some zoom position.
    pub fn is_zoomed(&self, surface: usize, quantity: Quantity) -> bool {
        (0..self.zoom.len()).any(|zoom| self.is_own_at(zoom, surface, quantity))
    }
}
