//! The errors of subcommands, and their exit status.

use crate::files::FileError;
use crate::lens::{LensError, SystemError};
use crate::merit::MeritError;
use crate::paraxial::ParaxialError;
use crate::pupil::RayModelError;
use std::io;

/// An error of a subcommand.
#[derive(Debug, thiserror::Error)]
pub(super) enum CliError {
    /// A file that cannot be read or written, or is malformed.
    #[error(transparent)]
    File(#[from] FileError),
    /// A lens that cannot be resolved.
    #[error("{file}: {source}")]
    Lens {
        /// The file of the lens.
        file: String,
        /// The cause.
        source: LensError,
    },
    /// A lens without first-order data.
    #[error("{file}: {source}")]
    Paraxial {
        /// The file of the lens.
        file: String,
        /// The cause.
        source: ParaxialError,
    },
    /// A lens for which no rays can be launched.
    #[error("{file}: {source}")]
    RayModel {
        /// The file of the lens.
        file: String,
        /// The cause.
        source: RayModelError,
    },
    /// A lens for which the merit function is not defined.
    #[error("{file}: {source}")]
    Merit {
        /// The file of the lens.
        file: String,
        /// The cause.
        source: MeritError,
    },
    /// Rays that cannot be traced.
    #[error("{file}: {source}")]
    Rays {
        /// The file of the rays.
        file: String,
        /// The ray and its error.
        source: SystemError,
    },
    /// Any other wrong input.
    #[error("{0}")]
    Input(String),
    /// The work began and failed.
    #[error("{0}")]
    Failed(String),
    /// The result could not be printed.
    #[error("standard output: {0}")]
    Output(#[from] io::Error),
}

impl CliError {
    /// The exit status: 0 done, 1 the work failed, 2 the input is wrong.
    pub(super) fn exit_status(&self) -> u8 {
        match self {
            Self::File(FileError::Unwritable { .. } | FileError::RoundTripFailed { .. })
            | Self::Failed(_) => 1,
            Self::Output(_) => u8::from(!self.is_closed_pipe()),
            Self::File(_)
            | Self::Lens { .. }
            | Self::Paraxial { .. }
            | Self::RayModel { .. }
            | Self::Merit { .. }
            | Self::Rays { .. }
            | Self::Input(_) => 2,
        }
    }

    /// The error of a lens without light.
    pub(super) fn no_light(file: &str) -> Self {
        Self::Input(format!("{file}: no light gets through; expected a lens that forms an image"))
    }

    /// True if the reader of standard output has closed it.
    pub(super) fn is_closed_pipe(&self) -> bool {
        matches!(self, Self::Output(error) if error.kind() == io::ErrorKind::BrokenPipe)
    }
}
