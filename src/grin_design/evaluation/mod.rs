//! The evaluation of a field: the rays of each view with their targets, the loss and its gradient.

pub(super) mod loss;
pub(super) mod outcome;
pub(super) mod penalties;
pub(super) mod screen;
mod straight_rays;
pub(super) mod targets;
pub(super) mod views;

pub use loss::ViewResult;
pub use outcome::RayCounts;
pub use straight_rays::StraightRays;
pub use targets::ViewMeasurement;
