//! Search over structure: mutations and their paraxial projection.

mod mutations;
mod projection;

use aplanat::search::{Random, Rules};
use rand::SeedableRng as _;

fn seeded(seed: u64) -> Random {
    Random::seed_from_u64(seed)
}

/// Rules that let every lens of the library change.
fn generous() -> Rules {
    Rules { elements: [1, 24], ..Rules::default() }
}
