//! The errors of reports and drawings.

use super::body::BodyError;
use crate::analysis::AnalysisError;
use crate::paraxial::ParaxialError;
use crate::plot::{DxfError, PdfError};
use crate::pupil::RayModelError;

/// The reason why there is no report or drawing.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ReportError {
    /// No ray can be traced through the lens.
    #[error(transparent)]
    Rays(#[from] RayModelError),
    /// The lens has no first-order data.
    #[error(transparent)]
    Paraxial(#[from] ParaxialError),
    /// No light gets through at any field and zoom position.
    #[error("{0}; expected a lens that forms an image")]
    Dark(AnalysisError),
    /// The PDF file cannot be made.
    #[error(transparent)]
    Pdf(#[from] PdfError),
    /// The PNG file cannot be made.
    #[error("the picture cannot be written as PNG: {0}")]
    Png(String),
    /// The name of the file of a figure has another ending.
    #[error("expected a name that ends with .csv, .png, .svg or .pdf")]
    FigureEnding,
    /// A figure without curves.
    #[error("there is nothing to draw")]
    NothingDrawn,
    /// The DXF file cannot be made.
    #[error(transparent)]
    Dxf(#[from] DxfError),
    /// An element that does not exist.
    #[error("no element {found}; expected {expected}")]
    NoElement {
        /// The number asked for.
        found: usize,
        /// The numbers that exist.
        expected: String,
    },
    /// An element that is no solid of revolution.
    #[error("element {number}: {source}")]
    Body {
        /// The number of the element.
        number: usize,
        /// The reason.
        source: BodyError,
    },
    /// Elements that are no solids of revolution.
    #[error("{0}")]
    Bodies(String),
    /// A lens without glass.
    #[error("the lens has no element of glass; expected one at least")]
    NoBodies,
}

impl ReportError {
    /// The error of several elements, each with its number.
    pub(super) fn of_bodies(faults: Vec<(usize, BodyError)>) -> Self {
        let text = |(number, source): (usize, BodyError)| Self::Body { number, source }.to_string();
        Self::Bodies(faults.into_iter().map(text).collect::<Vec<_>>().join("; "))
    }
}
