//! Results as files: what the window and the command line write for a designer.

mod pareto;

pub use pareto::ParetoReport;
