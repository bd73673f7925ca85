//! Why a subcommand did not do its work, and the exit status that says so.

use crate::files::FileError;
use crate::lens::{LensError, SystemError};
use crate::merit::MeritError;
use crate::paraxial::ParaxialError;
use crate::pupil::RayModelError;
use std::io;

/// Why a subcommand did not do its work.
#[derive(Debug, thiserror::Error)]
pub(super) enum CliError {
    /// A file that cannot be read, is not what it should be, or cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// A lens that cannot be used as asked.
    #[error("{file}: {source}")]
    Lens {
        /// The lens.
        file: String,
        /// What is wrong.
        source: LensError,
    },
    /// A lens without the first-order data that are asked for.
    #[error("{file}: {source}")]
    Paraxial {
        /// The lens.
        file: String,
        /// What is wrong.
        source: ParaxialError,
    },
    /// A lens that cannot be set up for rays.
    #[error("{file}: {source}")]
    RayModel {
        /// The lens.
        file: String,
        /// What is wrong.
        source: RayModelError,
    },
    /// A lens without the merit that is asked for.
    #[error("{file}: {source}")]
    Merit {
        /// The lens.
        file: String,
        /// What is wrong.
        source: MeritError,
    },
    /// Rays that cannot be traced.
    #[error("{file}: {source}")]
    Rays {
        /// The file of the rays.
        file: String,
        /// The ray and what is wrong with it.
        source: SystemError,
    },
    /// Anything else that was asked for wrongly.
    #[error("{0}")]
    Input(String),
    /// The work was begun and could not be finished.
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

    /// Whether the reader of the result has seen enough of it.
    pub(super) fn is_closed_pipe(&self) -> bool {
        matches!(self, Self::Output(error) if error.kind() == io::ErrorKind::BrokenPipe)
    }
}
