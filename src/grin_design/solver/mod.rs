//! The optimization of a field, one step at a time.

mod field_solver;
mod optimizer;

pub use optimizer::{FieldScore, GrinOptimizer, GrinProgress};
