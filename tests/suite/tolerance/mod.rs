//! Errors of making, against the exact answers of `tolerances.json`, and their hard cases.

mod as_built;
mod as_built_term;
mod compensators;
mod correlations;
mod derivatives;
mod focus_travel;
mod further;
mod hard_cases;
mod many_errors;
mod moving_pupil;
mod rays;
mod reference;
mod worst;
