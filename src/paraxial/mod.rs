//! First-order optics: the imaging of a lens by rays close to its axis.
//!
//! Two rays determine all results: the marginal ray, from the axial object point through the rim of
//! the stop, and the chief ray, from the edge of the field through its centre. Cardinal points, pupils
//! and the third-order sums follow from them. After Welford, *Aberrations of Optical Systems* (1986), chapters 3, 6
//! and 8.
//!
//! Sign conventions are Welford's: slopes are `u = dy/dz`, and the index is negative behind an odd
//! number of mirrors, so that one formula holds for lenses and mirrors. Everything is written over
//! [`Real`](crate::math::Real), so that a dual yields the derivative of a focal length.

mod drag;
mod first_order;
mod parametric;
mod ray;
mod seidel;

pub use drag::{
    DragError, DragLimit, DragOutcome, DragSettings, DragStop, FirstOrderLock, FreeNumbers, Handle,
    HandleDrag, HandlePlaces, HandleUnit, HeldEdit, HoldError, LockError, MovedNumber, elements,
    hold_after_edit, short_name, tangents,
};
pub use first_order::{Beam, FirstOrder, ParaxialError, ParaxialPupil, first_order};
pub use parametric::{ParametricLens, ParametricRay, free_parameters};
pub use ray::{ParaxialRay, paraxial_ray, signed_indices};
pub use seidel::{SEIDEL_SUM_NAMES, Seidel, SeidelSums, seidel};
