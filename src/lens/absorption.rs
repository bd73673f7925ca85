//! The light that the glasses of a lens absorb.

use super::glass;
use super::{Lens, Medium};

impl Lens {
    /// The absorbance of the medium behind a surface at a wavelength in µm, in 1/mm (natural logarithm): 0 in
    /// air and at mirrors, `None` where it is not known.
    pub fn absorbance(&self, surface: usize, um: f64) -> Option<f64> {
        match &self.surfaces.get(surface)?.medium {
            Medium::Air | Medium::Mirror => Some(0.0),
            Medium::Glass(name) => glass::find(name)?.properties()?.absorbance(um),
            _ => None,
        }
    }
}
