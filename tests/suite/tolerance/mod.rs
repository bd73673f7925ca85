//! Errors of making, against the exact answers of `tolerances.json`.

mod derivatives;
mod rays;
mod reference;
