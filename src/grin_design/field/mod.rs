//! Fields of a task: the one under optimization, with its limits, and the reference fields.

mod grin_field;
pub(super) mod index_bounds;
mod max_slope;
mod maximum;
mod reference;
mod task_files;

pub use grin_field::GrinField;
