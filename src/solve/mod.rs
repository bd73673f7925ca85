//! Optimizers as pure numerics, each once: for lenses and fields alike.
//!
//! None of them knows what its numbers mean. Each takes one step at a time, so that the caller owns
//! the loop, and none reads a clock or draws random numbers.

mod adam;
mod bounds;
mod boxed_quadratic;
mod cgls;
mod conflict;
mod constrained;
mod kink;
mod lbfgs;
mod levenberg_marquardt;
mod limit_values;
mod model_minimum;
mod projection;
mod quadratic_program;
mod restoration;
mod separate;
mod shortest_change;
mod trust_region;

pub use adam::{Adam, AdamMoments};
pub use bounds::ParameterBounds;
pub use boxed_quadratic::{BoxedQuadratic, scaled_pseudoinverse};
pub use cgls::cgls;
pub use conflict::smallest_conflict;
pub use constrained::{LimitedTrustRegion, LimitedTrustRegionMemory};
pub use lbfgs::{Lbfgs, LbfgsStep};
pub use levenberg_marquardt::{
    Damping, LevenbergMarquardt, LevenbergMarquardtStep, NielsenDamping, ResidualRows, damped_step,
    predicted_decrease,
};
pub use limit_values::{LimitValues, LimitedPoint, LimitedStep, SLACK};
pub use projection::{
    ConstrainedPoint, ConstraintError, ConstraintFunction, CoordinateBounds, nearest_point,
    nearest_point_from, point_along_normals,
};
pub use separate::SeparateResidual;
pub use trust_region::{LeastSquaresPoint, TrustRegion, TrustRegionMemory, TrustRegionStep};

/// The scalar product.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
