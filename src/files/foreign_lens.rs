//! A lens read from a foreign file, before it is checked against the file.

use super::report::{ConversionOutcome, ConversionReport};
use super::vignetting::{VignettingChoice, ZoomedFactors, apply_factors, are_usable, beam_reach};
use super::{LensFormat, OpenedLens, image_side, self_check};
use crate::lens::{Lens, SurfaceNumber};
use serde::Serialize;
use std::fmt;

/// The choices of a person on how foreign files are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ImportSettings {
    /// The treatment of vignetting factors.
    pub vignetting: VignettingChoice,
}

/// A number that a foreign file states although it follows from the lens, beside the one of this program.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StatedNumber {
    /// The name of the number.
    pub what: String,
    /// The number of the file, in mm.
    pub file_mm: f64,
    /// The number of this program, in mm; `None` if a ray is lost on its way.
    pub found_mm: Option<f64>,
}

impl fmt::Display for StatedNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let found = self.found_mm.map_or("none".to_owned(), |found| format!("{found:.6} mm"));
        write!(f, "{}: {} mm in the file, {found} here", self.what, self.file_mm)
    }
}

/// A lens with its report, and what else the file says of its beam.
#[derive(Debug)]
pub(super) struct ForeignLens {
    pub(super) lens: Lens,
    pub(super) report: ConversionReport,
    /// The vignetting factors; empty if there are none.
    pub(super) factors: ZoomedFactors,
    /// True for each surface with an aperture that clips in the other program.
    pub(super) clips: Vec<bool>,
    /// The semi-diameters in mm of surfaces, by index, that the other program computed from its rays.
    pub(super) automatic: Vec<(usize, f64)>,
}

impl From<(Lens, ConversionReport)> for ForeignLens {
    fn from((lens, report): (Lens, ConversionReport)) -> Self {
        let (factors, clips, automatic) = (Vec::new(), Vec::new(), Vec::new());
        Self { lens, report, factors, clips, automatic }
    }
}

impl ForeignLens {
    /// The lens with numbers to compare, its factors treated by choice.
    pub(super) fn opened(mut self, format: LensFormat, settings: ImportSettings) -> OpenedLens {
        image_side::face_image(&mut self.lens, &mut self.report);
        let stated = self.stated();
        let has_factors = are_usable(&self.factors);
        if has_factors && settings.vignetting == VignettingChoice::Factors {
            let Self { lens, report, factors, clips, .. } = &mut self;
            if let Err(why) = apply_factors(lens, factors, clips, report) {
                report.add(ConversionOutcome::Dropped, "vignetting factors", why.to_string());
            }
        }
        let Self { lens, report, .. } = self;
        let checks = self_check::self_checks(&lens).unwrap_or_default();
        let vignetting = has_factors.then_some(settings.vignetting);
        OpenedLens { lens, format, report: Some(report), checks, stated, vignetting }
    }

    /// The semi-diameters that the other program computed, beside the reach of the same rays here.
    fn stated(&self) -> Vec<StatedNumber> {
        if self.automatic.is_empty() {
            return Vec::new();
        }
        let Ok(reach) = beam_reach(&self.lens, &self.factors, 0..1) else { return Vec::new() };
        let number = |(surface, file_mm): &(usize, f64)| StatedNumber {
            what: format!("semi-diameter of surface {}", SurfaceNumber::new(*surface)),
            file_mm: *file_mm,
            found_mm: reach.get(*surface).copied().flatten(),
        };
        self.automatic.iter().map(number).collect()
    }
}
