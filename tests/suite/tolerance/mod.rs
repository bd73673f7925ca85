//! Errors of making, against the exact answers of `tolerances.json`, and their hard cases.

mod as_built;
mod as_built_term;
mod compensators;
mod correlations;
mod derivatives;
mod hard_cases;
mod rays;
mod reference;
mod worst;
