//! The files of reports, drawings and solids, each in the form that the ending of its name says.

use super::analysis_figure::FigureKind;
use super::body::LensBody;
use super::element_drawing::{chosen_body, element_drawing};
use super::error::ReportError;
use super::layout_drawing::LayoutScene;
use super::prescription::{ReportSettings, prescription_report};
use super::step::step_file;
use crate::lens::{Lens, Medium, SurfaceNumber};
use crate::plot::{dxf_bytes, html_text, paper_pages, pdf_bytes, svg_text};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The kind of a file for paper or for mechanical design.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PaperKind {
    /// The prescription report: .pdf or .html.
    Report,
    /// The layout: .pdf, .svg or .dxf.
    Layout,
    /// The elements as solids: .step or .stp.
    Solids,
    /// The errors of making with their effects: .csv.
    ToleranceTable,
    /// The lenses that are made: .png.
    ToleranceCharts,
    /// The charts of an analysis: .csv, .png, .svg or .pdf.
    Figure(FigureKind),
}

impl PaperKind {
    /// The endings of its files, the usual one first.
    pub const fn extensions(self) -> &'static [&'static str] {
        match self {
            Self::Report => &["pdf", "html"],
            Self::Layout => &["pdf", "svg", "dxf"],
            Self::Solids => &["step", "stp"],
            Self::ToleranceTable => &["csv"],
            Self::ToleranceCharts => &["png"],
            Self::Figure(_) => &["csv", "png", "svg", "pdf"],
        }
    }
}

/// The bytes of a report, and its pages if it is paper.
///
/// # Errors
/// A lens through which no ray can be traced.
pub fn report_bytes(
    lens: &Lens,
    settings: ReportSettings,
    path: &Path,
) -> Result<(Vec<u8>, Option<usize>), ReportError> {
    let document = prescription_report(lens, settings)?;
    if !has_extension(path, "pdf") {
        return Ok((html_text(&document).into_bytes(), None));
    }
    let pages = paper_pages(&document);
    Ok((pdf_bytes(&document.title, &pages)?, Some(pages.len())))
}

/// The bytes of a drawing, of the layout or of one element, and the millimetres of the file a millimetre
/// of the lens.
///
/// # Errors
/// A lens through which no ray can be traced, or an element that cannot be drawn.
pub fn drawing_bytes(
    lens: &Lens,
    zoom: usize,
    element: Option<usize>,
    path: &Path,
) -> Result<(Vec<u8>, f64), ReportError> {
    let sheet = match element {
        Some(number) => element_drawing(lens, zoom, number)?,
        None => LayoutScene::new(lens, zoom)?.sheet(),
    };
    if has_extension(path, "dxf") {
        return Ok((dxf_bytes(&sheet)?, 1.0));
    }
    let scale = sheet.scale.map_or(1.0, |scale| scale.factor);
    if has_extension(path, "pdf") {
        return Ok((pdf_bytes(&lens.name, std::slice::from_ref(&sheet))?, scale));
    }
    Ok((svg_text(&sheet).into_bytes(), scale))
}

/// The solids of a lens as a file.
#[derive(Debug, Clone, PartialEq)]
pub struct SolidsFile {
    /// The text of the file.
    pub text: String,
    /// The elements in it.
    pub bodies: Vec<LensBody>,
    /// The largest distance in mm of a spline from its surface.
    pub deviation: f64,
    /// The mirrors, which have no body in a lens.
    pub left_out: Vec<SurfaceNumber>,
}

/// The solids of all elements of a lens at a zoom position, or of one.
///
/// # Errors
/// A lens through which no ray can be traced, without elements, or with elements that are no solids of
/// revolution.
pub fn solids_file(
    lens: &Lens,
    zoom: usize,
    element: Option<usize>,
) -> Result<SolidsFile, ReportError> {
    let all = LayoutScene::new(lens, zoom)?.bodies();
    let bodies = match element {
        Some(number) => vec![chosen_body(&all, number)?.clone()],
        None => all,
    };
    let file = step_file(&lens.name, &bodies)?;
    let is_bare = |i: &usize| {
        let is_mirror = lens.surfaces[*i].medium == Medium::Mirror;
        is_mirror && !bodies.iter().any(|body| body.surfaces.contains(i))
    };
    let mirrors = (0..lens.surfaces.len()).filter(is_bare).map(SurfaceNumber::new);
    let left_out = mirrors.filter(|_| element.is_none()).collect();
    Ok(SolidsFile { text: file.text, bodies, deviation: file.deviation, left_out })
}

/// True if the name of a file ends like this, in upper or lower case.
pub fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|found| found.eq_ignore_ascii_case(extension))
}
