//! The samplers: chains of descents and mutations, the run that advances them, and its settings.

pub(super) mod chain;
pub mod competing_clocks;
mod iterated;
mod langevin;
mod metropolis;
pub(super) mod race;
mod run;
mod settings;
mod steer;
mod temperature;

pub use chain::{Chain, ChainDescent};
pub use run::{FoundPoint, RunEnd, SearchEvent, SearchRun, SearchRunOn};
pub use settings::{LangevinSettings, SearchMethod, SearchSettings};
pub use steer::SteerCommand;
pub use temperature::{Temperature, Termination};
