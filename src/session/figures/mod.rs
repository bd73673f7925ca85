//! The content of the panels of analyses as figures: the same charts in the window, on paper and in a table.

mod accuracy;
mod beams;
mod contrast;
mod fans;
mod field;
mod wavefront;

use super::analysis::{Analyses, AnalysisResults, field_name};
use crate::analysis::Estimate;
use crate::lens::{FieldKind, Fields};
use crate::report::{AnalysisFigure, FigureKind, note_number};

/// The figure of an analysis.
///
/// # Errors
/// Numbers that are not computed, since no panel shows them, or that there are none.
pub fn analysis_figure(
    kind: FigureKind,
    results: &AnalysisResults,
) -> Result<AnalysisFigure, String> {
    let numbers = results.analyses.as_ref().map_err(Clone::clone)?;
    let subject =
        Subject { results, numbers, fields: results.lens.fields_at(results.settings.zoom) };
    let figure = match kind {
        FigureKind::Spots => Some(beams::spots(&subject)),
        FigureKind::Fans => fans::fans(&subject),
        FigureKind::PathFans => fans::path_fans(&subject),
        FigureKind::FieldCurves => field::curves(&subject),
        FigureKind::Longitudinal => field::longitudinal(&subject),
        FigureKind::Grid => field::grid(&subject),
        FigureKind::Seidel => Some(field::seidel(&subject)?),
        FigureKind::Contrast => contrast::over_frequency(&subject),
        FigureKind::FieldContrast => contrast::over_field(&subject),
        FigureKind::FocusContrast => contrast::through_focus(&subject),
        FigureKind::Wavefront => wavefront::maps(&subject),
        FigureKind::Zernike => wavefront::coefficients(&subject),
        FigureKind::PointSpread => wavefront::point_spread(&subject),
        FigureKind::Energy => wavefront::energy(&subject),
        FigureKind::RayImage => wavefront::ray_image(&subject),
        FigureKind::RayEnergy => wavefront::ray_energy(&subject),
        FigureKind::Footprint(surface) => beams::footprint(&subject, surface),
        FigureKind::SpotMap => beams::spot_map(&subject)?,
        FigureKind::Ghosts => beams::ghosts(&subject)?,
        FigureKind::ContrastAccuracy => accuracy::contrast(&subject)?,
        FigureKind::PointSpreadAccuracy => accuracy::point_spread(&subject)?,
        FigureKind::PictureAccuracy => accuracy::picture(&subject)?,
    };
    let figure = figure.ok_or_else(|| {
        format!("{} is not computed yet; open its panel and wait for it", kind.name())
    })?;
    Ok(AnalysisFigure { title: kind.name().to_owned(), ..figure })
}

/// A lens with its numbers.
struct Subject<'a> {
    results: &'a AnalysisResults,
    numbers: &'a Analyses,
    fields: &'a Fields,
}

impl Subject<'_> {
    /// The name of a field.
    fn field(&self, index: usize) -> String {
        let point = self.fields.values.get(index);
        point.map_or_else(String::new, |point| field_name(self.fields.kind, *point))
    }

    /// The wavelengths in micrometres.
    fn wavelengths(&self) -> Vec<f64> {
        self.numbers.ray_model.value.channels.iter().map(|channel| channel.um).collect()
    }

    /// The name of a wavelength by its index.
    fn wavelength(&self, index: usize) -> String {
        let all = self.wavelengths();
        let whole = |um: f64| format!("{:.0} nm", 1e3 * um);
        let Some(um) = all.get(index) else { return String::new() };
        let alike = all.iter().filter(|other| whole(**other) == whole(*um)).count();
        if alike > 1 { wavelength_text(*um) } else { whole(*um) }
    }

    /// The name of the light of a wavelength in micrometres, or of all of them.
    fn light(&self, um: Option<f64>) -> String {
        let Some(um) = um else { return "all wavelengths".to_owned() };
        let place = self.wavelengths().iter().position(|known| *known == um);
        place.map_or_else(|| wavelength_text(um), |index| self.wavelength(index))
    }

    /// The name of the primary wavelength.
    fn primary(&self) -> String {
        self.wavelength(self.numbers.ray_model.value.primary)
    }

    /// The name of the axis of the field.
    fn field_axis(&self) -> &'static str {
        match self.fields.kind {
            FieldKind::Angle => "field, degrees",
            FieldKind::ObjectHeight => "field, mm in the object",
            FieldKind::ImageHeight => "field, mm in the image",
        }
    }
}

/// The name of a wavelength.
fn wavelength_text(um: f64) -> String {
    format!("{} nm", note_number((1e6 * um).round() / 1e3))
}

/// A number with its error, rays and time.
fn estimate_note(name: &str, estimate: &Estimate, unit: &str) -> String {
    let Estimate { value, error, rays, .. } = *estimate;
    format!("{name}: {} ± {error:.1e}{unit}, {rays} rays", note_number(value))
}

/// Milliseconds as they stand in a note.
fn ms_text(ms: f64) -> String {
    format!("{ms:.2} ms")
}
