//! The name of one number of a lens, and access to the number by it.

use super::{ASPHERE_TERMS, Aperture, Lens, Medium, RADIAL_TERMS, SurfaceNumber, ZoomThickness};
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
    /// The thickness of the gap behind the surface in mm, at every zoom position without one of its
    /// own.
    Thickness,
    /// The thickness of the gap behind the surface at the zoom position with this index, in mm.
    ZoomThickness(usize),
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

/// One number of a lens: a quantity of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameter {
    /// The index of the row.
    pub surface: usize,
    /// The quantity.
    pub quantity: Quantity,
}

impl fmt::Display for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let surface = SurfaceNumber::new(self.surface);
        match self.quantity {
            Quantity::Curvature => write!(f, "curvature of surface {surface}"),
            Quantity::Conic => write!(f, "conic constant of surface {surface}"),
            Quantity::Asphere(term) => {
                write!(f, "asphere coefficient of r^{} of surface {surface}", 2 * term + 4)
            }
            Quantity::Thickness => write!(f, "thickness after surface {surface}"),
            Quantity::ZoomThickness(zoom) => {
                write!(f, "thickness after surface {surface} at zoom position {zoom}")
            }
            Quantity::Index => write!(f, "index after surface {surface}"),
            Quantity::Grin(k) => match k.checked_sub(RADIAL_TERMS) {
                None => write!(f, "GRIN coefficient {} of r after surface {surface}", k + 1),
                Some(j) => write!(f, "GRIN coefficient {} of z after surface {surface}", j + 1),
            },
            Quantity::SemiDiameter => write!(f, "semi-diameter of surface {surface}"),
            Quantity::Freeform(k) => write!(f, "freeform number {} of surface {surface}", k + 1),
        }
    }
}

impl Parameter {
    /// A quantity of the row with index `surface`.
    pub const fn new(surface: usize, quantity: Quantity) -> Self {
        Self { surface, quantity }
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

impl Lens {
    /// The value of a parameter as written; `None` if the lens has no such number (no such row or
    /// zoom position, the index of a catalogue glass, an unlimited semi-diameter).
    pub fn get(&self, parameter: Parameter) -> Option<f64> {
        let row = self.surfaces.get(parameter.surface)?;
        match parameter.quantity {
            Quantity::Curvature => Some(row.curvature),
            Quantity::Conic => Some(row.conic),
            Quantity::Asphere(term) => {
                (term < ASPHERE_TERMS).then(|| row.asphere.get(term).copied().unwrap_or(0.0))
            }
            Quantity::Thickness => Some(row.thickness),
            Quantity::ZoomThickness(zoom) => self.thickness_at(parameter.surface, zoom),
            Quantity::Index => row.medium.index(),
            Quantity::Grin(k) => match &row.medium {
                Medium::Grin(grin) => grin.term(k),
                _ => None,
            },
            Quantity::SemiDiameter => row.semi_diameter,
            Quantity::Freeform(k) => row.freeform.as_ref()?.numbers.get(k).copied(),
        }
    }

    /// Sets a parameter. Returns `false` and changes nothing if the lens has no such number. The
    /// semi-diameter of the stop also sets an aperture that is given by it.
    pub fn set(&mut self, parameter: Parameter, value: f64) -> bool {
        let zooms = self.zoom.len();
        let Some(row) = self.surfaces.get_mut(parameter.surface) else { return false };
        match parameter.quantity {
            Quantity::Curvature => row.curvature = value,
            Quantity::Conic => row.conic = value,
            Quantity::Asphere(term) if term < ASPHERE_TERMS => {
                if row.asphere.len() <= term {
                    row.asphere.resize(term + 1, 0.0);
                }
                row.asphere[term] = value;
            }
            Quantity::Thickness => row.thickness = value,
            Quantity::ZoomThickness(zoom) if zoom < zooms => {
                self.set_zoom_thickness(parameter.surface, zoom, value);
            }
            Quantity::Asphere(_) | Quantity::ZoomThickness(_) => return false,
            Quantity::Freeform(k) => {
                let form = row.freeform.as_mut();
                match form.and_then(|form| form.numbers.get_mut(k)) {
                    Some(number) => *number = value,
                    None => return false,
                }
            }
            Quantity::Index => match row.medium.index_mut() {
                Some(n) => *n = value,
                None => return false,
            },
            Quantity::Grin(k) => match &mut row.medium {
                Medium::Grin(grin) => return grin.set_term(k, value),
                _ => return false,
            },
            Quantity::SemiDiameter => {
                row.semi_diameter = Some(value);
                if let (true, Aperture::StopSemiDiameter(stop)) = (row.stop, &mut self.aperture) {
                    *stop = value;
                }
            }
        }
        true
    }

    /// The thickness of the gap behind a surface at a zoom position in mm; `None` without that row.
    pub fn thickness_at(&self, surface: usize, zoom: usize) -> Option<f64> {
        let own = self.zoom.get(zoom).and_then(|position| {
            position.thicknesses.iter().find(|gap| gap.surface == surface).map(|gap| gap.thickness)
        });
        own.or_else(|| self.surfaces.get(surface).map(|row| row.thickness))
    }

    fn set_zoom_thickness(&mut self, surface: usize, zoom: usize, thickness: f64) {
        let gaps = &mut self.zoom[zoom].thicknesses;
        match gaps.iter_mut().find(|gap| gap.surface == surface) {
            Some(gap) => gap.thickness = thickness,
            None => gaps.push(ZoomThickness { surface, thickness }),
        }
    }
}
