//! Search over structure: descents and mutations that add, remove, glue and split elements or exchange
//! glasses. An iterated local search races mutants and goes on from what is better; the Markov chains
//! that mix descents with mutations are those of Teh, *Computational Lens Design*, chapter 4.
//!
//! A [`Landscape`] defines the points of a search, their loss, descent and mutations. The samplers
//! do not depend on lenses, so that a toy problem tests the same code that searches lenses. A run
//! is determined by its seed and settings, independent of the number of threads, and its complete
//! state can be saved between two rounds and resumed.

mod bookkeeping;
mod checkpoint;
pub mod design;
pub mod element;
mod error;
mod landscape;
pub mod lens_landscape;
pub mod mutation;
mod predicted_gain;
mod projection;
mod rules;
mod sampler;
pub mod toy;

pub use bookkeeping::{
    DescentEnd, Lineage, LineageNode, MutationStatistics, OfferOutcome, Reservoir, ReservoirEntry,
    SearchStatistics,
};
pub use checkpoint::SEARCH_CHECKPOINT;
pub use error::SearchError;
pub use landscape::{Landscape, LossGradient, MutatedPoint, SearchPoint, Settlement};
pub use mutation::{
    MutatedLens, MutationError, MutationKind, MutationRecord, MutationWeights, Refusal,
    StructureChange, mutate, perturb, propose,
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
