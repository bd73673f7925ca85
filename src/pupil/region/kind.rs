//! The region of a pupil and the forms that it can have.

use super::annulus::Annulus;
use super::boundary::Boundary;
use crate::pupil::launch::Launch;

/// The form of the region of a pupil.
#[derive(Debug, Clone, PartialEq)]
pub enum RegionKind {
    /// No ray gets through.
    Dark,
    /// The whole disc gets through.
    Clear,
    /// One piece, star-shaped about a point and bounded by arcs.
    StarShaped(Boundary),
    /// Neither clear nor star-shaped, or with an edge that is noise: it is sampled and clipped.
    Irregular {
        /// The number of separate pieces found.
        pieces: usize,
        /// A square around it: its centre and half of its side, in pupil coordinates.
        square: ([f64; 2], f64),
        /// Its two edges if it is an annulus around an obstruction; its quadrature lies between
        /// them.
        annulus: Option<Box<Annulus>>,
    },
    /// Nothing limits it, so that no beam is defined.
    Unbounded,
}

/// The pupil points of a field at a wavelength from which rays get through.
#[derive(Debug, Clone)]
pub struct Region<'a> {
    /// The rays of the field.
    pub launch: Launch<'a>,
    /// The form of the region.
    pub kind: RegionKind,
    /// The number of rays traced to find it.
    pub rays: usize,
}

impl Region<'_> {
    /// True if no light gets through.
    pub fn is_dark(&self) -> bool {
        self.kind == RegionKind::Dark
    }
}
