//! Design tasks in one gradient-index field: the task file, the loss, the optimization of the
//! field, and reports on a field.
//!
//! A [`GrinTask`] is the content of a JSON file: the representation of the field and its
//! resolutions, the sources, the goals, the limits. A [`GrinOptimizer`] works on it one step at a
//! time, by the exact adjoint of [`grin`](crate::grin): it knows no clock, no file and no window,
//! uses no random numbers and comes to the same field on any number of threads. Rays are traced to
//! the tolerance of the task, with a step chosen anew as the field changes; rays that cannot be
//! evaluated are excluded with a fixed penalty and reported with the reason. After chapter 5 of
//! Teh, *Computational Lens Design*, whose equation numbers are given.

mod error;
mod evaluation;
mod field;
mod report;
mod solver;
mod task;

pub use error::{GrinTaskError, ReferenceFieldError};
pub use evaluation::{RayCounts, StraightRays, ViewMeasurement, ViewResult};
pub use field::GrinField;
pub use report::{
    FieldDifference, FieldExtremes, ImageLight, LimitCheck, RayPath, RayPaths, SlicePlane,
    SpatialAxis, ViewImage, ViewReport,
};
pub use solver::{FieldScore, GrinOptimizer, GrinProgress};
pub use task::{
    BUILTIN_TASKS, BoundaryCondition, BuiltinTask, Domain, FieldRepresentation, GrinMethod,
    GrinTask, InitialField, LightGoal, LightSource, LightView, ManufacturingLimits, ReferenceField,
    RefinementLevel, SourceDirections, SquareBeam, TASK_VERSION, TargetImage, TaskFile,
    TracingSettings, VolumeFile, find_builtin, read_task,
};
