//! The charts of an analysis, described once: as curves in the window and on paper, and as a table.

use super::error::ReportError;
use super::has_extension;
use crate::math::ShortNumber;
use crate::plot::{CurveChart, CurveSheet, pdf_bytes};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The meaning of the colours of curves.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum CurveColors {
    /// Each is that of a field, or of one of several kinds.
    #[default]
    Fields,
    /// Each is that of one of these wavelengths in micrometres.
    Wavelengths(Vec<f64>),
}

/// An analysis that has a figure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FigureKind {
    /// The spot diagrams.
    Spots,
    /// The transverse aberration over the pupil.
    Fans,
    /// The path differences over the pupil.
    PathFans,
    /// Distortion, field curvature, lateral colour and illumination over the field.
    FieldCurves,
    /// Crossings with the axis over the pupil.
    Longitudinal,
    /// The image of a square grid.
    Grid,
    /// The third-order sums of the surfaces.
    Seidel,
    /// Contrast against spatial frequency.
    Contrast,
    /// Contrast over the field.
    FieldContrast,
    /// Contrast through focus.
    FocusContrast,
    /// The map of the wavefront.
    Wavefront,
    /// The Zernike coefficients.
    Zernike,
    /// The image of a point by diffraction.
    PointSpread,
    /// The encircled energy by diffraction.
    Energy,
    /// The image of a point by rays.
    RayImage,
    /// The encircled energy by rays.
    RayEnergy,
    /// The beams on a surface of this index, the image plane last.
    Footprint(usize),
    /// The spot over the whole field.
    SpotMap,
    /// Light that two surfaces reflect.
    Ghosts,
    /// Error against time of contrast.
    ContrastAccuracy,
    /// Error against time of the point spread.
    PointSpreadAccuracy,
    /// Error against time of pictures.
    PictureAccuracy,
}

impl FigureKind {
    /// The name of the analysis, as files are named after it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Spots => "Spot diagrams",
            Self::Fans => "Ray fans",
            Self::PathFans => "OPD fans",
            Self::FieldCurves => "Field curves",
            Self::Longitudinal => "Longitudinal aberration",
            Self::Grid => "Distortion grid",
            Self::Seidel => "Seidel sums",
            Self::Contrast => "MTF",
            Self::FieldContrast => "MTF over the field",
            Self::FocusContrast => "MTF through focus",
            Self::Wavefront => "Wavefront",
            Self::Zernike => "Zernike coefficients",
            Self::PointSpread => "Point spread",
            Self::Energy => "Encircled energy",
            Self::RayImage => "Point spread by rays",
            Self::RayEnergy => "Encircled energy by rays",
            Self::Footprint(_) => "Footprint",
            Self::SpotMap => "Spot over the field",
            Self::Ghosts => "Ghosts",
            Self::ContrastAccuracy => "Accuracy of MTF",
            Self::PointSpreadAccuracy => "Accuracy of the point spread",
            Self::PictureAccuracy => "Accuracy of pictures",
        }
    }
}

/// The charts of an analysis.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct AnalysisFigure {
    /// The name of the analysis.
    pub title: String,
    /// The charts that are drawn, in rows.
    pub rows: Vec<Vec<CurveChart>>,
    /// Numbers that belong into the table in place of those of the charts, where curves are made of them, as
    /// contours are of a map; empty where the charts are the numbers.
    pub tables: Vec<CurveChart>,
    /// Errors, rays and times, and what has no result.
    pub notes: Vec<String>,
    /// The meaning of the colours.
    pub colors: CurveColors,
}

/// The form of the file of a figure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FigureFormat {
    /// A table as CSV.
    Table,
    /// Charts as PNG.
    Image,
    /// Charts as SVG.
    Vector,
    /// Charts as PDF.
    Page,
}

impl FigureFormat {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Table, Self::Image, Self::Vector, Self::Page];

    /// The ending of its files.
    pub const fn extension(self) -> &'static str {
        match self {
            Self::Table => "csv",
            Self::Image => "png",
            Self::Vector => "svg",
            Self::Page => "pdf",
        }
    }

    /// The form that the ending of a name says.
    pub fn of(path: &Path) -> Option<Self> {
        Self::ALL.into_iter().find(|format| has_extension(path, format.extension()))
    }
}

impl AnalysisFigure {
    /// All numbers as CSV: the notes as lines that begin with `#`, then a line for each point of each curve
    /// with its chart, its name, and both quantities with their names.
    pub fn csv(&self) -> String {
        let mut text = String::new();
        for note in std::iter::once(&self.title).chain(&self.notes) {
            text.extend(["# ", &note.replace(['\r', '\n'], " "), "\r\n"]);
        }
        text.push_str("chart,curve,x_name,y_name,x,y\r\n");
        let drawn = self.rows.iter().flatten();
        let charts: Vec<&CurveChart> =
            if self.tables.is_empty() { drawn.collect() } else { self.tables.iter().collect() };
        for chart in charts {
            let [x_name, y_name] = chart.axes.map(quoted);
            for curve in &chart.curves {
                let (title, name) = (quoted(&chart.title), quoted(&curve.name));
                for [x, y] in curve.pieces.iter().flatten() {
                    let line = [&title, &name, &x_name, &y_name, &x.to_string(), &y.to_string()];
                    text.extend([&line.map(String::as_str).join(","), "\r\n"]);
                }
            }
        }
        text
    }

    /// The charts on a sheet with the name of the lens, and the notes below them.
    pub fn sheet(&self, lens: &str) -> CurveSheet {
        let title = format!("{lens}: {}", self.title);
        CurveSheet { title, rows: self.rows.clone(), caption: self.notes.clone() }
    }

    /// The bytes of a file, in the form that the ending of its name says.
    ///
    /// # Errors
    /// An ending of another form, nothing to draw, or a file that cannot be made.
    pub fn bytes(&self, lens: &str, path: &Path) -> Result<Vec<u8>, ReportError> {
        let format = FigureFormat::of(path).ok_or(ReportError::FigureEnding)?;
        let is_drawn = format != FigureFormat::Table;
        if is_drawn && self.rows.iter().flatten().all(|chart| chart.curves.is_empty()) {
            return Err(ReportError::NothingDrawn);
        }
        if !is_drawn {
            return Ok(self.csv().into_bytes());
        }
        sheet_bytes(&self.sheet(lens), lens, path)
    }
}

/// The bytes of the file of a sheet: .png, .svg or .pdf, as the ending of its name says.
///
/// # Errors
/// Another ending, or a file that cannot be made.
pub fn sheet_bytes(sheet: &CurveSheet, lens: &str, path: &Path) -> Result<Vec<u8>, ReportError> {
    match FigureFormat::of(path) {
        Some(FigureFormat::Image) => sheet.png().map_err(|why| ReportError::Png(why.to_string())),
        Some(FigureFormat::Vector) => Ok(sheet.svg().into_bytes()),
        Some(FigureFormat::Page) => Ok(pdf_bytes(lens, &[sheet.drawing()])?),
        Some(FigureFormat::Table) | None => Err(ReportError::FigureEnding),
    }
}

/// A number as it stands in a note.
pub fn note_number(value: f64) -> String {
    ShortNumber(value).to_string()
}

/// A text as a cell of CSV.
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\r', '\n']) {
        return format!("\"{}\"", text.replace('"', "\"\""));
    }
    text.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::ChartCurve;

    fn figure() -> AnalysisFigure {
        let points = [(0.0, Some(1.0)), (0.5, Some(-2.5e-3)), (1.0, None)];
        let curve = ChartCurve::new("588 nm, \"d\"", 0, points);
        let chart = CurveChart::new("0°", ["pupil", "µm"], vec![curve]);
        let (title, notes) = ("Ray fans".to_owned(), vec!["65 rays".to_owned()]);
        AnalysisFigure { title, rows: vec![vec![chart]], notes, ..AnalysisFigure::default() }
    }

    #[test]
    fn every_point_has_a_line_with_its_names() {
        let expected = "# Ray fans\r\n# 65 rays\r\nchart,curve,x_name,y_name,x,y\r\n\
            0°,\"588 nm, \"\"d\"\"\",pupil,µm,0,1\r\n0°,\"588 nm, \"\"d\"\"\",pupil,µm,0.5,-0.0025\r\n";
        assert_eq!(figure().csv(), expected);
    }

    #[test]
    fn the_ending_of_a_name_says_the_form_of_the_file() {
        let begins = |name: &str| figure().bytes("lens", Path::new(name)).map(|b| b[..4].to_vec());
        assert_eq!(begins("a.csv").unwrap(), b"# Ra");
        assert_eq!(begins("a.PNG").unwrap(), b"\x89PNG");
        assert_eq!(begins("a.pdf").unwrap(), b"%PDF");
        assert!(begins("a.svg").unwrap().starts_with(b"<"));
        assert_eq!(begins("a.txt"), Err(ReportError::FigureEnding));
        let svg = String::from_utf8(figure().bytes("lens", Path::new("a.svg")).unwrap()).unwrap();
        assert!(svg.contains("<desc>65 rays</desc>") && svg.contains(">65 rays</text>"), "{svg}");
        let empty = AnalysisFigure::default();
        assert_eq!(empty.bytes("lens", Path::new("a.png")), Err(ReportError::NothingDrawn));
    }
}
