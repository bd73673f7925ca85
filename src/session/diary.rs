//! What a session keeps beside a saved search, so that it looks the next day as it was left: the curve
//! behind it and the time that it has taken. The search itself does not depend on it.

use super::moments::SearchHistory;
use serde::{Deserialize, Serialize};

/// What is kept beside a saved search.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub(super) struct CheckpointSidecar {
    /// It ends after so many minutes of work; none for no limit.
    pub(super) minutes: Option<f64>,
    /// The time that it has worked, in seconds.
    pub(super) seconds: f64,
    /// The gradients of that time.
    pub(super) gradients: u64,
    /// The merit so far, and every mutation.
    pub(super) history: SearchHistory,
}

impl CheckpointSidecar {
    /// The limit, unless it is used up: whoever goes on with such a search wants more of it.
    pub(super) fn remaining_minutes(&self) -> Option<f64> {
        self.minutes.filter(|minutes| self.seconds < 60.0 * minutes)
    }
}
