//! Numbers and their calculus, without optics.
//!
//! The physics is written once over the trait [`Real`]: `f64` gives a ray, `f32` a fast preview,
//! a [`Dual`] a derivative, a dual of duals a second derivative, a [`Jet`] all second derivatives by
//! two variables, an [`Interval`] bounds of all values.

mod double;
mod dual;
pub mod expression;
mod format;
mod fourier;
mod interval;
mod jet;
mod lanes;
mod normal_law;
pub mod quadrature;
mod real;
mod turns;
mod vec3;

pub use double::DoubleDouble;
pub use dual::Dual;
pub(crate) use format::{ShortNumber, format_short};
pub(crate) use fourier::{ComplexPair, FourierSense, transform_plane};
pub use interval::{Arithmetic, Interval};
pub use jet::Jet;
pub use lanes::SimdWidth;
pub(crate) use lanes::{dot, run_vectorized, sum_of_products};
pub(crate) use normal_law::{erfc, excess_beyond};
pub use real::Real;
pub(crate) use turns::sin_cos_turns;
pub use vec3::Vec3;
