//! Search over structure: a Markov chain that mixes descent with adding, removing, gluing and
//! splitting elements (Teh, *Computational Lens Design*, chapter 4).
//!
//! A [`Landscape`] says what a point is, how a descent moves it, how it mutates and what it is
//! worth; the samplers know nothing of lenses, so that a toy problem tests exactly the text that
//! searches lenses. All of a run follows from its seed and settings: chains are as many as the
//! settings say, whatever the number of threads, and whatever is remembered between two moves can
//! be written down and read again.

pub mod element;
mod landscape;
pub mod mutation;
mod projection;
mod repair;
mod rules;

pub use landscape::{Landscape, Mutated, Point};
pub use mutation::{Kind, Mutant, Refusal, mutate, propose};
pub use projection::{Projection, Unprojectable};
pub use rules::Rules;

/// The source of all chance in a search; its state is part of a checkpoint.
pub type Random = rand_xoshiro::Xoshiro256PlusPlus;
