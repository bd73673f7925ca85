//! Search over structure: a Markov chain that mixes descent with adding, removing, gluing and
//! splitting elements (Teh, *Computational Lens Design*, chapter 4).
//!
//! A [`Landscape`] says what a point is, how a descent moves it, how it mutates and what it is
//! worth; the samplers know nothing of lenses, so that a toy problem tests exactly the text that
//! searches lenses. All of a run follows from its seed and settings: chains are as many as the
//! settings say, whatever the number of threads, and whatever is remembered between two moves can
//! be written down and read again.

mod bookkeeping;
mod checkpoint;
pub mod element;
mod error;
mod landscape;
pub mod lens_landscape;
pub mod mutation;
mod projection;
mod rules;
mod sampler;
pub mod toy;

pub use bookkeeping::{
    DescentEnd, Lineage, LineageNode, MutationStatistics, OfferOutcome, Reservoir, ReservoirEntry,
    SearchStatistics,
};
pub use error::SearchError;
pub use landscape::{Landscape, LossGradient, MutatedPoint, SearchPoint};
pub use mutation::{
    MutatedLens, MutationError, MutationKind, MutationRecord, MutationWeights, Refusal,
    StructureChange, mutate, propose,
};
pub use projection::{Projection, ProjectionError};
pub use rules::{RuleError, SearchRules};
pub use sampler::{
    Chain, ChainDescent, FoundPoint, LangevinSettings, RunEnd, SearchEvent, SearchMethod,
    SearchRun, SearchRunOn, SearchSettings, SteerCommand, Temperature, Termination,
    competing_clocks,
};

/// The random number generator of a search; its state is part of a checkpoint.
pub type Random = rand_xoshiro::Xoshiro256PlusPlus;
