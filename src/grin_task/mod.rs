//! Design tasks in one gradient-index field: the task file, the loss, the optimisation of the
//! field, and reports on a field.
//!
//! A [`GrinTask`] is the content of a JSON file: the representation of the field and its
//! resolutions, the sources, the goals, the limits. A [`GrinOptimizer`] works on it one step at a
//! time, by the exact adjoint of [`grin`](crate::grin): it knows no clock, no file and no window,
//! uses no random numbers and comes to the same field on any number of threads. Rays are traced to
//! the tolerance of the task, with a step chosen anew as the field changes; rays that cannot be
//! evaluated are excluded with a fixed penalty and reported with the reason. After chapter 5 of
//! Teh, *Computational Lens Design*, whose equation numbers are given.

mod builtin;
mod check;
mod chords;
mod climb;
mod compare;
mod descent;
mod drawing;
mod given;
mod hold;
mod image;
mod kept;
mod likeness;
mod measured;
mod medium;
mod plane;
mod range;
mod refuse;
mod ring;
mod runner;
mod scene;
mod seen;
mod slope;
mod source;
mod space;
mod stage;
mod task;
mod ways;

pub use builtin::{BUILTIN_TASKS, BuiltinTask, find_builtin, read_task};
pub use check::GrinTaskError;
pub use chords::StraightRays;
pub use compare::{FieldDifference, FieldExtremes};
pub use drawing::{ImageFile, TargetImage};
pub use given::ReferenceFieldError;
pub use kept::LimitCheck;
pub use measured::ViewMeasurement;
pub use medium::GrinField;
pub use plane::{SlicePlane, SpatialAxis};
pub use runner::{FieldScore, GrinOptimizer, GrinProgress};
pub use scene::{RayCounts, ViewResult};
pub use seen::{ViewImage, ViewReport};
pub use task::{
    BoundaryCondition, Domain, FieldRepresentation, GrinMethod, GrinTask, InitialField, LightGoal,
    LightSource, LightView, ManufacturingLimits, ReferenceField, RefinementLevel, SourceDirections,
    TASK_VERSION, TracingSettings,
};
pub use ways::{RayPath, RayPaths};
