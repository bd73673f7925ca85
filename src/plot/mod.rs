//! Plots and images as PNG: lines, markers, text, charts with axes, rasters in false colours.
//!
//! A [`Canvas`] knows pixels, a [`Chart`] maps two quantities to them. Neither knows what is drawn.

mod canvas;
mod chart;
mod color;
mod font;

pub use canvas::{Canvas, NamedPlot, Stroke, TextAlign, draw_image_row, gray_levels};
pub use chart::{Axis, Chart, Legend};
pub use color::{BLACK, Color, GREY, GRID, PALETTE, diverging, gray_level};
