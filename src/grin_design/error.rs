//! The errors of tasks and of their fields.

use crate::files::FileError;
use crate::grin::GrinSetupError;
use crate::grin::field::GridError;

/// A task that cannot be evaluated.
#[derive(Debug, thiserror::Error)]
pub enum GrinTaskError {
    /// An invalid value.
    #[error("{place}: found {found}; expected {expected}")]
    Value {
        /// The position in the task.
        place: String,
        /// The value that was found.
        found: String,
        /// The values that are valid.
        expected: String,
    },
    /// The initial field, or a reference field, is not available.
    #[error("{place}: {source}")]
    Field {
        /// The position in the task.
        place: String,
        /// The cause.
        source: Box<ReferenceFieldError>,
    },
    /// A target image is not available.
    #[error("{place}: {source}")]
    Picture {
        /// The position in the task.
        place: String,
        /// The cause.
        source: Box<FileError>,
    },
    /// A resolution of which no field can be made.
    #[error("levels: {0}")]
    Level(#[from] GridError),
    /// The tracing setup is invalid.
    #[error("space: {0}")]
    Setup(#[from] GrinSetupError),
    /// Every parameter of the field is fixed.
    #[error(
        "levels: a field of {nodes} nodes has none that may change; expected more nodes, or an edge \
         that is not fixed"
    )]
    NoFreeParameters {
        /// The number of nodes along a side.
        nodes: usize,
    },
}

/// A reference or initial field that is not available.
#[derive(Debug, thiserror::Error)]
pub enum ReferenceFieldError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file has not been read.
    #[error("{file}: the volume has not been read")]
    NotRead {
        /// The file.
        file: String,
    },
    /// The values do not make a field.
    #[error("{file}: {source}")]
    Values {
        /// The file.
        file: String,
        /// The cause.
        source: GridError,
    },
    /// An index below 1.
    #[error(
        "{file}: node {node:?} has the index {found}; expected 1 or more; the index of a raw volume \
         is offset + scale * number, and a number has its lowest byte first"
    )]
    Index {
        /// The file.
        file: String,
        /// The node, counted from 0 along x, y and z.
        node: [usize; 3],
        /// The index there.
        found: f64,
    },
    /// An index beyond the limits of the task.
    #[error(
        "{file}: the index is {found} at {at:?} mm; expected {} to {}, the limits of the task",
        expected[0], expected[1]
    )]
    BeyondLimits {
        /// The file.
        file: String,
        /// The index farthest beyond the limits.
        found: f64,
        /// Its position, in mm.
        at: [f64; 3],
        /// The smallest and the largest index.
        expected: [f64; 2],
    },
    /// The volume does not cover the domain.
    #[error("{file}: reaches from {low} to {high} mm along {axis}; expected all of {expected:?}")]
    TooSmall {
        /// The file.
        file: String,
        /// `x`, `y` or `z`.
        axis: char,
        /// The lower end of the volume, in mm.
        low: f64,
        /// The upper end of the volume, in mm.
        high: f64,
        /// The extent of the domain, in mm.
        expected: [f64; 2],
    },
}
