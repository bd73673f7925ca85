//! Plots and images as PNG: lines, markers, text, charts with axes, rasters in false colours; drawings on
//! paper as SVG, PDF and DXF; documents as HTML and PDF.
//!
//! A [`Canvas`] knows pixels, a [`Chart`] maps two quantities to them, a [`VectorDrawing`] knows
//! millimetres. None of them knows what is drawn.

mod canvas;
mod chart;
mod color;
mod contour;
mod curve_sheet;
mod document;
mod font;
mod vector;

pub use canvas::{Canvas, NamedPlot, Stroke, TextAlign, draw_image_row, gray_levels};
pub use chart::{Axis, Chart, Legend, round_step};
pub use color::{BLACK, Color, GREY, GRID, PALETTE, diverging, glow, gray_level};
pub use contour::{ContourGrid, contour_curves};
pub use curve_sheet::{ChartCurve, CurveChart, CurveSheet};
pub use document::{DocumentBlock, DocumentTable, ReportDocument, html_text, paper_pages};
pub use vector::{
    DxfError, LinePattern, Mark, PaperChart, PdfError, Pen, SheetArc, SheetScale, VectorDrawing,
    described_svg, dxf_bytes, pdf_bytes, svg_text, text_width, wrapped,
};
