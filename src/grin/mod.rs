//! Light in one gradient-index field: fields, ray integrators and their discrete adjoint. Knows no
//! lens.
//!
//! In the canonical parameter σ, with `dσ = ds/η`, a ray obeys `x' = v`, `v' = η ∇η` (Sharma et al.,
//! Appl. Opt. 21, 1982; equations 5.5 and 5.6 of Pediredla et al., "Adjoint nonlinear ray tracing",
//! ACM TOG 41, 2022) and `|v| = η` stays true along it; the optical path grows by `η²`. Every
//! [`Integrator`] is a list of drifts, which move `x`, and kicks, which turn `v`. That makes each
//! step exactly reversible, so the gradient of a loss needs no stored path: the ray is traced
//! backwards from its end and the transpose of each drift and kick is applied on the way. Memory
//! does not grow with the number of steps.
//!
//! The transpose is of the *discrete* map, so it equals what automatic differentiation gives. For a
//! trilinear grid that is the wrong answer to the question a designer asks: see
//! [`Trilinear`](field::Trilinear).
//!
//! Lengths are in the unit of the field (mm for a lens), `v` has no unit, σ is a length.

mod adjoint;
mod exit;
mod fate;
pub mod field;
mod gradient;
mod integrator;
mod lanes;
mod plan;
mod region;
mod setup;
mod state;
mod step;
mod tape;
mod tracer;

pub use exit::RayExit;
pub use fate::{GrinFate, GrinFateCounts};
pub use field::IndexField;
pub use gradient::{AdjointGradient, LossAndGradient};
pub use integrator::{Integrator, IntegratorOp};
pub use lanes::{LANES, LaneScalars, LaneVectors};
pub use plan::{TracingPlan, plan_tracing};
pub use region::{Face, GrinRegion};
pub use setup::{EndCondition, GrinSetup, GrinSetupError, LastStep, LaunchMode};
pub use state::{GrinRay, RayAdjoint, RayState};
pub use step::GrinTracer;
pub use tape::TapeGradient;
