//! Numbers without optics.
//!
//! The physics is written once over the trait [`Real`]: `f64` gives a ray, `f32` a fast preview,
//! a [`Dual`] a derivative, a dual of duals a second derivative, a [`Jet`] all second derivatives by
//! two variables.

mod double;
mod dual;
mod jet;
mod lanes;
pub mod quadrature;
mod real;
mod shown;
mod vec3;

pub use double::Double;
pub use dual::Dual;
pub use jet::Jet;
pub use lanes::Width;
pub(crate) use lanes::widest;
pub use real::Real;
pub(crate) use shown::brief;
pub use vec3::Vec3;
