//! Search over structure: mutations and their paraxial projection; chains, their budget, reservoir,
//! family tree and checkpoints, and what they sample; lenses as what is searched, and their rules.

mod budget;
mod chain;
mod checkpoint;
mod density;
mod gradients;
mod lens;
mod mutations;
mod projection;
mod proposal_density;
mod reservoir;
mod rugged;
mod rules;
mod sampling;

use aplanat::search::{Random, SearchRules};
use rand::SeedableRng as _;

fn seeded(seed: u64) -> Random {
    Random::seed_from_u64(seed)
}

/// Rules that let every lens of the library change.
fn generous() -> SearchRules {
    SearchRules { elements: [1, 24], ..SearchRules::default() }
}
