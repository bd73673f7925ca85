//! Background runs: long computations that are started, paused, resumed, stepped and stopped.
//!
//! A [`BackgroundRun`] is the session's handle of one thread with one [`Engine`] at a time. Requests
//! go in and status changes and reports come out through channels; the state that panels read is a
//! snapshot in a newest-value slot, so that a slow window never delays a run. The engine works on
//! its own copy of the design. A panic in it fails the run and not the session.

mod background;
mod engine;
mod latest;
mod status;
mod tracker;

pub(super) use background::BackgroundRun;
pub(super) use engine::{Engine, EventSender, RunEvent, catch_panic};
pub(super) use latest::{LatestRequestWorker, WorkerOutput};
pub use status::{RunId, RunKind, RunStatus, RunView};

/// Keeps a history short: beyond `limit` samples the stride doubles, and only samples whose step is a
/// multiple of it remain.
pub(super) fn thin_history<T>(
    history: &mut Vec<T>,
    stride: &mut usize,
    limit: usize,
    step: impl Fn(&T) -> usize,
) {
    if history.len() > limit {
        *stride *= 2;
        history.retain(|sample| step(sample).is_multiple_of(*stride));
    }
}
