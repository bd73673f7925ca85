//! Naming one number of a lens.

use super::{ASPHERE_TERMS, Aperture, Lens, Medium, RADIAL_TERMS, ZoomThickness};
use serde::{Deserialize, Serialize};
use std::fmt;

/// What about a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// The curvature, in 1/mm.
    Curvature,
    /// The conic constant.
    Conic,
    /// The asphere coefficient number 0 (r⁴) to 6 (r¹⁶).
    Asphere(usize),
    /// The gap behind the row, in mm; at every zoom position that does not have its own.
    Thickness,
    /// The gap behind the row at one zoom position, in mm.
    ZoomThickness(usize),
    /// The index of a model glass or constant medium behind the row; of a gradient that of its
    /// base.
    Index,
    /// The coefficient of the gradient behind the row: number 0 (r²) to 5 (r¹²), 6 (z) to 9 (z⁴).
    Gradient(usize),
    /// The semi-diameter, in mm.
    SemiDiameter,
}

/// One number of a lens: a row and what about it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameter {
    /// The row, counted from 0.
    pub surface: usize,
    /// What about it.
    pub quantity: Quantity,
}

impl fmt::Display for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let surface = self.surface;
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
            Quantity::Gradient(k) => match k.checked_sub(RADIAL_TERMS) {
                None => write!(f, "gradient coefficient {} of r after surface {surface}", k + 1),
                Some(j) => write!(f, "gradient coefficient {} of z after surface {surface}", j + 1),
            },
            Quantity::SemiDiameter => write!(f, "semi-diameter of surface {surface}"),
        }
    }
}

impl Parameter {
    /// The parameter of a row.
    pub const fn new(surface: usize, quantity: Quantity) -> Self {
        Self { surface, quantity }
    }
}

impl Medium {
    /// The index that can be changed: of a model glass that at the d line; `None` where it is fixed.
    fn index(&self) -> Option<f64> {
        match self {
            Self::Model { nd: n, .. } | Self::Index(n) => Some(*n),
            Self::Grin(gradient) => gradient.base.index(),
            Self::Air | Self::Glass(_) | Self::Mirror => None,
        }
    }

    fn index_mut(&mut self) -> Option<&mut f64> {
        match self {
            Self::Model { nd: n, .. } | Self::Index(n) => Some(n),
            Self::Grin(gradient) => gradient.base.index_mut(),
            Self::Air | Self::Glass(_) | Self::Mirror => None,
        }
    }
}

impl Lens {
    /// The value of a parameter as written; `None` where the lens has no such number (no such
    /// row or zoom position, an index of a catalogue glass, an unlimited semi-diameter).
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
            Quantity::Gradient(k) => match &row.medium {
                Medium::Grin(gradient) => gradient.term(k),
                _ => None,
            },
            Quantity::SemiDiameter => row.semi_diameter,
        }
    }

    /// Writes a parameter; `false`, and nothing changed, where the lens has no such number.
    /// The stop's semi-diameter and an aperture given by it are one number: both follow.
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
            Quantity::Index => match row.medium.index_mut() {
                Some(n) => *n = value,
                None => return false,
            },
            Quantity::Gradient(k) => match &mut row.medium {
                Medium::Grin(gradient) => return gradient.set_term(k, value),
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

    /// The gap behind a row at a zoom position; `None` where there is no such row.
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
