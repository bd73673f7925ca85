//! The spot of a field.

use super::{AnalysisRun, AtField, SelectedField, TextLines, estimate_text, with_time};
use crate::analysis::{
    AnalysisError, Estimate, MonochromaticSpot, Spot, SpotPoints, spot, spot_points,
};
use crate::plot::{ChartCurve, CurveChart};
use crate::pupil::RayModel;
use serde::Serialize;

/// The spot of a field.
#[derive(Serialize)]
pub(super) struct SpotJson {
    rms: Estimate,
    radius: Estimate,
    centroid_x: Estimate,
    centroid_y: Estimate,
    reached: bool,
    radius_reached: bool,
    colors: Vec<ColorSpotJson>,
    /// The points of the diagram, if it is drawn.
    #[serde(skip)]
    points: Vec<SpotPoints>,
}

/// The spot at one wavelength.
#[derive(Serialize)]
#[serde(untagged)]
enum ColorSpotJson {
    Transmitted {
        wavelength_um: f64,
        rms: Estimate,
        centroid_x: Estimate,
        centroid_y: Estimate,
        lit_area: Estimate,
        best_focus: Option<f64>,
    },
    Dark {
        wavelength_um: f64,
        dark: String,
    },
}

pub(super) fn spots(run: &AnalysisRun) -> Vec<AtField<SpotJson>> {
    let at = |field: &SelectedField| {
        let result = with_time(|| spot(&run.model, field.traced, run.accuracy), note_time);
        let points = if run.is_drawn { diagram(run, field) } else { Vec::new() };
        AtField::new(field, result.map(|spot| SpotJson { points, ..SpotJson::new(run, &spot) }))
    };
    run.at_each_field(at)
}

/// Enters the milliseconds into all numbers of a spot, which come from the same rays.
fn note_time(result: &mut Result<Spot, AnalysisError>, milliseconds: f64) {
    let Ok(Spot { rms, centroid: [x, y], radius, channels: colors, .. }) = result else { return };
    let note = |estimate: &mut Estimate| estimate.milliseconds = Some(milliseconds);
    [rms, x, y, radius].into_iter().for_each(note);
    for MonochromaticSpot { rms, centroid: [x, y], area, .. } in colors.iter_mut().flatten() {
        [rms, x, y, area].into_iter().for_each(note);
    }
}

impl SpotJson {
    pub(super) fn rms(&self) -> f64 {
        self.rms.value
    }

    fn new(run: &AnalysisRun, spot: &Spot) -> Self {
        let colors = run.model.channels.iter().zip(&spot.channels);
        let allowed = (run.accuracy.tolerance * spot.radius.value).max(run.rounding());
        Self {
            rms: spot.rms,
            radius: spot.radius,
            centroid_x: spot.centroid[0],
            centroid_y: spot.centroid[1],
            reached: spot.is_fully_lit
                && spot.channels.iter().flatten().all(|color| color.converged),
            radius_reached: spot.radius.error <= allowed,
            colors: colors.map(|(color, spot)| ColorSpotJson::new(color.um, spot)).collect(),
            points: Vec::new(),
        }
    }
}

/// The points of the diagram of a field.
fn diagram(run: &AnalysisRun, field: &SelectedField) -> Vec<SpotPoints> {
    spot_points(&RayModel { fields: vec![field.traced], ..run.model.clone() })
}

/// The size of a cross, in parts of the geometric radius.
const CROSS: f64 = 0.04;

impl ColorSpotJson {
    const fn wavelength_um(&self) -> f64 {
        let (Self::Transmitted { wavelength_um, .. } | Self::Dark { wavelength_um, .. }) = self;
        *wavelength_um
    }
}

impl ColorSpotJson {
    fn new(wavelength_um: f64, spot: &Result<MonochromaticSpot, AnalysisError>) -> Self {
        match spot {
            Ok(spot) => Self::Transmitted {
                wavelength_um,
                rms: spot.rms,
                centroid_x: spot.centroid[0],
                centroid_y: spot.centroid[1],
                lit_area: spot.area,
                best_focus: spot.best_focus(),
            },
            Err(dark) => Self::Dark { wavelength_um, dark: dark.to_string() },
        }
    }

    fn line(&self) -> String {
        match self {
            Self::Transmitted { wavelength_um, rms, .. } => {
                estimate_text(&format!("rms at {wavelength_um} um"), rms)
            }
            Self::Dark { wavelength_um, dark } => format!("{wavelength_um} um: {dark}"),
        }
    }
}

impl TextLines for SpotJson {
    const TITLE: &'static str = "spot, in mm; the centroid is that of all colours";

    fn error_unit(key: &str) -> &'static str {
        if key == "lit_area" { "" } else { " mm" }
    }

    fn lines(&self) -> Vec<String> {
        let mut lines = vec![
            estimate_text("rms radius", &self.rms),
            estimate_text("geometric radius", &self.radius),
            estimate_text("centroid x", &self.centroid_x),
            estimate_text("centroid y", &self.centroid_y),
        ];
        if self.colors.iter().any(|color| matches!(color, ColorSpotJson::Dark { .. })) {
            lines.push("these numbers leave out the wavelengths without light below".to_owned());
        } else if !self.reached {
            lines.push("the tolerance was not reached".to_owned());
        }
        if !self.radius_reached {
            lines.push("the tolerance was not reached by the geometric radius".to_owned());
        }
        lines.extend(self.colors.iter().map(ColorSpotJson::line));
        lines
    }

    /// The diagram about the centroid.
    fn charts(&self) -> Vec<CurveChart> {
        let centroid = [self.centroid_x.value, self.centroid_y.value];
        let um = |point: &[f64; 2]| [0, 1].map(|k| 1e3 * (point[k] - centroid[k]));
        let size = 1e3 * CROSS * self.radius.value;
        let of_color = |spot: &SpotPoints| {
            let name = format!("{} um", self.colors[spot.wavelength].wavelength_um());
            let points: Vec<_> = spot.points.iter().map(um).collect();
            ChartCurve::crosses(name, spot.wavelength, &points, size)
        };
        let curves = self.points.iter().map(of_color).collect();
        vec![CurveChart::map("spot about its centroid", ["x, um", "y, um"], curves)]
    }
}
