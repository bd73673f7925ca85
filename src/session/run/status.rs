//! The identity and the status of a background run.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The kinds of background runs of a session; there is one run of each at a time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RunKind {
    /// A local optimization of the variables.
    Optimization,
    /// A sweep of the Pareto front of sharpness and light.
    Pareto,
    /// A search over lens structures.
    StructureSearch,
    /// The design of a gradient-index field.
    GrinDesign,
    /// The design of a lens from a specification.
    SpecifiedDesign,
}

/// Identifies a run of a session.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct RunId {
    /// The kind of the run.
    pub kind: RunKind,
    /// The number of the run among those of its kind, counted from 1.
    pub number: u64,
}

/// The status of a background run.
///
/// `Starting`, `Pausing` and `Stopping` are requests that the engine has not carried out yet: it does
/// so after its current step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum RunStatus {
    /// No run was started, or the last one was dismissed.
    #[default]
    Idle,
    /// The run was asked to start or to resume.
    Starting,
    /// The run takes steps.
    Running,
    /// The run was asked to pause.
    Pausing,
    /// The run waits and can be resumed.
    Paused,
    /// The run was asked to stop.
    Stopping,
    /// The run was stopped; its results remain.
    Stopped,
    /// The run has reached its end.
    Finished,
    /// The run could not start, or an error ended it.
    Failed,
}

impl RunStatus {
    /// True if the run takes steps, is about to, or can be resumed.
    pub const fn is_active(self) -> bool {
        match self {
            Self::Starting | Self::Running | Self::Pausing | Self::Paused | Self::Stopping => true,
            Self::Idle | Self::Stopped | Self::Finished | Self::Failed => false,
        }
    }

    /// The status that a request leads to; itself for a status that is no request.
    pub(super) const fn target(self) -> Self {
        match self {
            Self::Starting => Self::Running,
            Self::Pausing => Self::Paused,
            Self::Stopping => Self::Stopped,
            other => other,
        }
    }
}

/// A background run as panels see it.
#[derive(Debug)]
pub struct RunView<S> {
    /// The run; `None` where no run was started or the last one was dismissed.
    pub id: Option<RunId>,
    /// Its status, with the request that is being carried out.
    pub status: RunStatus,
    /// The reason why the last run could not start or has failed.
    pub error: Option<String>,
    /// The latest state of the run; `None` before it has started.
    pub snapshot: Option<Arc<S>>,
}

impl<S> RunView<S> {
    /// True if the run takes steps, is about to, or can be resumed.
    pub const fn is_active(&self) -> bool {
        self.status.is_active()
    }
}

impl<S> Clone for RunView<S> {
    fn clone(&self) -> Self {
        Self { error: self.error.clone(), snapshot: self.snapshot.clone(), ..*self }
    }
}

impl<S> Default for RunView<S> {
    fn default() -> Self {
        Self { id: None, status: RunStatus::Idle, error: None, snapshot: None }
    }
}
