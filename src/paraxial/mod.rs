//! First-order optics: what a lens does to rays close to its axis.
//!
//! Two rays say everything: a marginal one from the axial object point past the rim of the stop,
//! and a chief one from the edge of the field through its centre. Cardinal points, pupils and the
//! third-order sums follow. After Welford, *Aberrations of Optical Systems* (1986), chapters 3, 6
//! and 8.
//!
//! Sign conventions are Welford's: slopes `u = dy/dz`, and the index counts negative after an odd
//! number of mirrors, so that one formula serves lenses and mirrors. Everything is written over
//! [`Real`](crate::math::Real), so that a dual yields the derivative of a focal length.

mod first_order;
mod ray;
mod seidel;

pub use first_order::{Beam, FirstOrder, ParaxialError, ParaxialPupil, first_order};
pub use ray::{ParaxialRay, paraxial_ray, signed_indices};
pub use seidel::{Seidel, SeidelSums, seidel};
