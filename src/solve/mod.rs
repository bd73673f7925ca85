//! Optimisers as pure numerics, each once: for lenses and fields alike.
//!
//! None of them knows what its numbers mean. Each takes one step at a time, so that the caller owns
//! the loop, and none reads a clock or draws random numbers.

mod adam;
mod bounds;
mod cgls;
mod constrained;
mod lbfgs;
mod levenberg_marquardt;
mod projection;
mod quadratic_program;
mod trust_region;

pub use adam::{Adam, AdamMoments};
pub use bounds::ParameterBounds;
pub use cgls::cgls;
pub use constrained::{
    LimitValues, LimitedPoint, LimitedStep, LimitedTrustRegion, SLACK, smallest_conflict,
};
pub use lbfgs::{Lbfgs, LbfgsStep};
pub use levenberg_marquardt::{
    Damping, LevenbergMarquardt, LevenbergMarquardtStep, NielsenDamping, ResidualRows, damped_step,
    predicted_decrease,
};
pub use projection::{
    ConstrainedPoint, ConstraintError, ConstraintFunction, CoordinateBounds, nearest_point,
    nearest_point_from, point_along_normals,
};
pub use trust_region::{LeastSquaresPoint, TrustRegion, TrustRegionStep};

/// The scalar product.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
