//! Search over structure: mutations and their paraxial projection.

mod mutations;
mod projection;
