//! Search over structure: a Markov chain that mixes descent with adding, removing, gluing and
//! splitting elements (Teh, *Computational Lens Design*, chapter 4).
//!
//! A [`Landscape`] says what a point is, how a descent moves it, how it mutates and what it is
//! worth; the samplers know nothing of lenses, so that a toy problem tests exactly the text that
//! searches lenses. All of a run follows from its seed and settings: chains are as many as the
//! settings say, whatever the number of threads, and whatever is remembered between two moves can
//! be written down and read again.

mod chain;
mod checkpoint;
pub mod clocks;
pub mod element;
mod error;
mod family;
mod landscape;
pub mod lens;
mod metropolis;
pub mod mutation;
mod projection;
mod record;
mod repair;
mod reservoir;
mod rules;
mod run;
mod settings;
mod statistics;
mod steer;
mod temperature;
pub mod toy;
mod weights;

pub use chain::{Chain, ChainDescent};
pub use error::SearchError;
pub use family::{DescentEnd, Lineage, LineageNode};
pub use landscape::{Landscape, LossGradient, MutatedPoint, SearchPoint};
pub use mutation::{MutatedLens, MutationError, MutationKind, mutate, propose};
pub use projection::{Projection, ProjectionError};
pub use reservoir::{OfferOutcome, Reservoir, ReservoirEntry};
pub use rules::{RuleError, SearchRules};
pub use run::{FoundPoint, RunEnd, SearchEvent, SearchRun, SearchRunOn};
pub use settings::{LangevinSettings, SearchMethod, SearchSettings};
pub use statistics::{MutationStatistics, SearchStatistics};
pub use steer::SteerCommand;
pub use temperature::{Temperature, Termination};
pub use weights::MutationWeights;

/// The source of all chance in a search; its state is part of a checkpoint.
pub type Random = rand_xoshiro::Xoshiro256PlusPlus;
