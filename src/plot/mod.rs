//! Plots and images as PNG: lines, markers, text, charts with axes, rasters in false colours.
//!
//! A [`Canvas`] knows pixels, a [`Chart`] maps two quantities to them. Neither knows what is drawn.

mod canvas;
mod chart;
mod color;
mod font;
mod image_row;
mod legend;

pub use canvas::{Canvas, NamedPlot, Stroke, TextAlign};
pub use chart::{Axis, Chart};
pub use color::{BLACK, Color, GREY, GRID, PALETTE, diverging, gray_level};
pub use image_row::{draw_image_row, gray_levels};
pub use legend::Legend;
