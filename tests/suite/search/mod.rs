//! Search over structure: chains, their reservoir, family tree and checkpoints, and what they sample.

mod chain;
mod checkpoint;
mod density;
mod reservoir;
mod rugged;
mod sampling;
