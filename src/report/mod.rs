//! Results as files and drawings: Pareto fronts, GRIN fields and their images.

mod grin_plots;
mod pareto;

pub use grin_plots::{plot_grin_field, plot_grin_image};
pub use pareto::ParetoReport;
