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

pub use chain::{Chain, Tour};
pub use error::SearchError;
pub use family::{Ended, Node, Tree};
pub use landscape::{Landscape, Mutated, Point, Slope};
pub use mutation::{Kind, Mutant, Refusal, mutate, propose};
pub use projection::{Projection, Unprojectable};
pub use reservoir::{Entry, Offer, Reservoir};
pub use rules::{BadRule, Rules};
pub use run::{Event, Found, Over, Run, RunOf};
pub use settings::{Langevin, Method, Settings};
pub use statistics::{Statistics, Tally};
pub use steer::Steer;
pub use temperature::{Temperature, Termination};
pub use weights::Weights;

/// The source of all chance in a search; its state is part of a checkpoint.
pub type Random = rand_xoshiro::Xoshiro256PlusPlus;
