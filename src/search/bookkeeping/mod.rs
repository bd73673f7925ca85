//! The results of a search: lineage of descents, reservoir of best points, counters.

mod lineage;
mod record;
mod reservoir;
mod statistics;

pub use lineage::{DescentEnd, Lineage, LineageNode};
pub use reservoir::{OfferOutcome, Reservoir, ReservoirEntry};
pub use statistics::{MutationStatistics, SearchStatistics};
