//! The set of rays that get through, and the forms that it can have.

use super::annulus::Annulus;
use super::boundary::Boundary;
use crate::pupil::launch::Launch;

/// The form of a pupil.
#[derive(Debug, Clone, PartialEq)]
pub enum RegionKind {
    /// Nothing gets through.
    Dark,
    /// The whole disc gets through.
    Clear,
    /// One piece, bounded by arcs.
    StarShaped(Boundary),
    /// No single point sees all of it, or its edge is noise: it is sampled and clipped.
    Irregular {
        /// How many separate pieces were seen.
        pieces: usize,
        /// A square that holds all of it: its centre and half of its side.
        square: ([f64; 2], f64),
        /// Its two edges, where it is a ring about a shadow: its quadrature lies between them.
        annulus: Option<Box<Annulus>>,
    },
    /// Nothing limits it, so that no beam is defined.
    Unbounded,
}

/// The rays of a field at a wavelength that get through.
#[derive(Debug, Clone)]
pub struct Region<'a> {
    /// Where its rays start.
    pub launch: Launch<'a>,
    /// Its form.
    pub kind: RegionKind,
    /// Rays traced to find it.
    pub rays: usize,
}
