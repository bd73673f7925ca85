//! Results as files and drawings: Pareto fronts, GRIN fields and their images; the prescription report of
//! a lens, its layout, its elements and its bill of material.

mod analysis_figure;
mod as_built_file;
mod body;
mod element_drawing;
mod error;
mod first_order_table;
mod grin_plots;
mod image_charts;
mod layout_drawing;
mod materials;
mod paper_file;
mod pareto;
mod prescription;
mod prescription_tables;
mod sheet;
mod step;
mod surface_tolerances;
mod tolerance_warnings;

pub use analysis_figure::{
    AnalysisFigure, CurveColors, FigureFormat, FigureKind, note_number, sheet_bytes,
};
pub use as_built_file::{FurtherColumns, tolerance_sheet, tolerance_table};
pub use body::{BodyError, LensBody, lens_bodies};
pub use element_drawing::element_drawing;
pub use error::ReportError;
pub use first_order_table::first_order_numbers;
pub use grin_plots::{plot_grin_field, plot_grin_image};
pub use layout_drawing::LayoutScene;
pub use paper_file::{
    PaperKind, SolidsFile, drawing_bytes, has_extension, report_bytes, solids_file,
};
pub use pareto::ParetoReport;
pub use prescription::{ReportSettings, prescription_report};
pub use sheet::scale_text;
pub use surface_tolerances::surface_tolerances;
pub use tolerance_warnings::tolerance_warnings;
