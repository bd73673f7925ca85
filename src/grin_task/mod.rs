//! Design tasks in one gradient-index field: which light shall go where, what a maker can make, and
//! the search for the field.
//!
//! A [`Task`] is what a person writes, as JSON: the kind of field and its resolutions, the
//! sources, the goals, the limits. A [`Runner`] works on it one step at a time, by the exact adjoint
//! of [`grin`](crate::grin): it knows no clock, no file and no window, draws nothing by chance and
//! comes to the same field on any number of threads. Rays are traced as well as the tolerance of
//! the task asks, chosen anew as the field takes shape; a ray that cannot count is left out, at a
//! constant price, and told with its reason. After chapter 5 of Teh, *Computational Lens Design*,
//! whose equation numbers are given.

mod builtin;
mod cgls;
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
mod least_squares;
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

pub use builtin::{BUILTIN, Builtin, find, read};
pub use check::TaskError;
pub use chords::Chords;
pub use compare::{Difference, Extremes};
pub use drawing::{Drawing, PictureFile};
pub use given::NoField;
pub use kept::Kept;
pub use measured::Measurement;
pub use medium::Medium;
pub use plane::{Axis, Plane};
pub use runner::{Judgement, Progress, Runner};
pub use scene::{Counts, ViewResult};
pub use seen::{Image, Seen};
pub use task::{
    Directions, Edge, Exact, FieldKind, Goal, Level, MakerLimits, Method, Source, Space, Start,
    Task, Tracing, VERSION, View,
};
pub use ways::{Way, Ways};
