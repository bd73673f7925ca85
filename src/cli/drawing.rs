//! `drawing`: the layout of a lens to scale, the drawing of an element, or its solids for CAD.

use super::error::CliError;
use super::input::LensFile;
use super::output::{Output, ShortNumber, counted};
use super::output_paths::OutputPaths;
use crate::files::write_atomic;
use crate::lens::{Lens, SurfaceNumber};
use crate::report::{
    LensBody, ReportError, SolidsFile, drawing_bytes, has_extension, scale_text, solids_file,
};
use serde::Serialize;
use std::fmt::{self, Display};
use std::path::PathBuf;

/// The layout of a lens to scale for paper and CAD, or the drawing of one of its elements
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("help/drawing.txt"))]
pub(super) struct DrawingArgs {
    #[command(flatten)]
    lens: LensFile,

    /// Writes the drawing into this file: .svg, .pdf or .dxf, or .step for the solids of the elements
    #[arg(long, value_name = "FILE")]
    out: PathBuf,

    /// The drawing of this element alone, counted from 1 along the light
    #[arg(long, value_name = "N")]
    element: Option<usize>,

    /// The zoom position, counted from 0
    #[arg(long, value_name = "N", default_value_t = 0)]
    zoom: usize,
}

/// The printed result.
#[derive(Serialize)]
struct WrittenDrawing {
    out: String,
    /// Millimetres of the drawing a millimetre of the lens.
    scale: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    solids: Option<WrittenSolids>,
}

/// The solids of a STEP file.
#[derive(Serialize)]
struct WrittenSolids {
    elements: Vec<WrittenSolid>,
    /// The largest distance of a spline from its surface, in mm.
    deviation: f64,
    /// The mirrors, which have no body in the lens, by index.
    left_out: Vec<SurfaceNumber>,
}

/// An element as a solid.
#[derive(Serialize)]
struct WrittenSolid {
    element: usize,
    /// In mm³.
    volume: f64,
}

impl Display for WrittenDrawing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(solids) = &self.solids else {
            return writeln!(f, "saved as {}, scale {}", self.out, scale_text(self.scale));
        };
        let count = counted(solids.elements.len(), "element");
        writeln!(f, "saved as {}, {count}, lengths in mm", self.out)?;
        for WrittenSolid { element, volume } in &solids.elements {
            writeln!(f, "element {element:>2}  volume {} mm3", ShortNumber(*volume))?;
        }
        if solids.deviation > 0.0 {
            writeln!(f, "aspheres as splines, within {:.1e} mm", solids.deviation)?;
        }
        for mirror in &solids.left_out {
            writeln!(f, "surface {mirror} is a mirror without a body in the lens: left out")?;
        }
        Ok(())
    }
}

impl DrawingArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        let mut paths = OutputPaths::reading([("the lens", self.lens.path())]);
        paths.file("--out", Some(&self.out), &["svg", "pdf", "dxf", "step", "stp"])?;
        let opened = self.lens.open()?;
        opened.check_zoom(self.zoom)?;
        let made = if has_extension(&self.out, "step") || has_extension(&self.out, "stp") {
            self.solids(&opened.lens)
        } else {
            self.drawn(&opened.lens)
        };
        let (bytes, report) = made.map_err(|error| {
            let file = &opened.file;
            CliError::Input(match error {
                ReportError::NoElement { found, expected } => {
                    format!("--element: no element {found} in {file}; expected {expected}")
                }
                error => format!("{file}: {error}"),
            })
        })?;
        write_atomic(&self.out, &bytes)?;
        output.print(&report)
    }

    /// The file of a drawing.
    fn drawn(&self, lens: &Lens) -> Result<(Vec<u8>, WrittenDrawing), ReportError> {
        let (bytes, scale) = drawing_bytes(lens, self.zoom, self.element, &self.out)?;
        Ok((bytes, self.written(scale, None)))
    }

    /// The file of the solids.
    fn solids(&self, lens: &Lens) -> Result<(Vec<u8>, WrittenDrawing), ReportError> {
        let SolidsFile { text, bodies, deviation, left_out } =
            solids_file(lens, self.zoom, self.element)?;
        let solid = |body: &LensBody| WrittenSolid { element: body.number, volume: body.volume() };
        let elements = bodies.iter().map(solid).collect();
        let solids = WrittenSolids { elements, deviation, left_out };
        Ok((text.into_bytes(), self.written(1.0, Some(solids))))
    }

    fn written(&self, scale: f64, solids: Option<WrittenSolids>) -> WrittenDrawing {
        WrittenDrawing { out: self.out.display().to_string(), scale, solids }
    }
}
