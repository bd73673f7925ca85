//! Numbers and their calculus, without optics.
//!
//! The physics is written once over the trait [`Real`]: `f64` gives a ray, `f32` a fast preview,
//! a [`Dual`] a derivative, a dual of duals a second derivative, a [`Jet`] all second derivatives by
//! two variables.

mod double;
mod dual;
pub mod expression;
mod jet;
mod lanes;
pub mod quadrature;
mod real;
mod shown;
mod vec3;

pub use double::DoubleDouble;
pub use dual::Dual;
pub use jet::Jet;
pub use lanes::SimdWidth;
pub(crate) use lanes::run_vectorized;
pub use real::Real;
pub(crate) use shown::format_short;
pub use vec3::Vec3;
