//! The structure search: mutations and their paraxial projection; chains with budget, reservoir,
//! lineage and checkpoints, and the distribution that they sample; the landscape of lenses and its
//! rules.

mod aspheres;
mod budget;
mod chain;
mod checkpoint;
mod density;
mod gradients;
mod iterated;
mod lens;
mod limits;
mod mutations;
mod projection;
mod proposal_density;
mod reservoir;
mod rugged;
mod rules;
mod saddle;
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
