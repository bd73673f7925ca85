//! The light that the glasses of a lens absorb.

use super::glass;
use super::{Lens, Medium, Row};

impl Lens {
    /// The absorbance of the medium behind a surface at a wavelength in µm, in 1/mm (natural logarithm): 0 in
    /// air, `None` where it is not known. Behind a mirror light goes back through the medium in front of it.
    pub fn absorbance(&self, surface: usize, um: f64) -> Option<f64> {
        let crossed = |row: &&Row| row.medium != Medium::Mirror;
        let medium = self.surfaces.get(..=surface)?.iter().rev().find(crossed);
        match medium.map_or(&self.object_medium, |row| &row.medium) {
            Medium::Air => Some(0.0),
            Medium::Glass(name) => glass::find(name)?.properties()?.absorbance(um),
            _ => None,
        }
    }
}
