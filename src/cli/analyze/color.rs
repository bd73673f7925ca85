//! Results about colours, zones and beams: lateral colour, longitudinal aberration with axial colour, and
//! footprints.

use super::{AnalysisRun, AtField, SelectedField, TextLines};
use crate::analysis::{
    LateralColor, LongitudinalAberration, ZoneFocus, check_light, chief_points, footprint,
    lateral_color, longitudinal_aberration,
};
use crate::cli::error::CliError;
use crate::cli::output::{ShortNumber, counted, or_dash, without_rounding};
use crate::lens::FieldPoint;
use crate::measure::time_ms;
use crate::plot::{ChartCurve, CurveChart};
use serde::Serialize;
use std::f64::consts::TAU;

/// The number of zones of the pupil.
const ZONES: usize = 10;

/// The lateral colour at a field.
#[derive(Serialize)]
pub(super) struct LateralColorJson {
    error: f64,
    rays: usize,
    milliseconds: f64,
    colors: Vec<ColorShiftJson>,
}

#[derive(Serialize)]
struct ColorShiftJson {
    wavelength_um: f64,
    dx: f64,
    dy: f64,
    /// The image point of the chief ray; `None` where it is lost.
    point: Option<[f64; 2]>,
}

pub(super) fn lateral_colors(run: &AnalysisRun) -> Vec<AtField<LateralColorJson>> {
    let at = |field: &SelectedField| {
        let (result, milliseconds) = time_ms(|| {
            check_light(&run.model, field.traced)?;
            lateral_color(&run.model, field.traced)
        });
        let points = chief_points(&run.model, field.traced);
        let color = |color: &LateralColor| ColorShiftJson {
            wavelength_um: run.model.channels[color.wavelength].um,
            dx: color.shift[0],
            dy: color.shift[1],
            point: points[color.wavelength],
        };
        let keys = result.map(|colors| LateralColorJson {
            error: 2.0 * (run.rounding() + run.model.neglected.ray_shift),
            rays: colors.len(),
            milliseconds,
            colors: colors.iter().map(color).collect(),
        });
        AtField::new(field, keys)
    };
    run.at_each_field(at)
}

impl TextLines for LateralColorJson {
    const TITLE: &'static str =
        "lateral colour: chief rays against that of the primary wavelength, in mm at the image";

    fn lines(&self) -> Vec<String> {
        let Self { error, rays, milliseconds, colors } = self;
        let mut lines =
            vec![format!("{}, {milliseconds:.3} ms, error {error:.0e} mm", counted(*rays, "ray"))];
        lines.extend(colors.iter().map(|ColorShiftJson { wavelength_um, dx, dy, .. }| {
            format!(
                "{wavelength_um:>9} um  dx {:>12}  dy {:>12}",
                ShortNumber(*dx),
                ShortNumber(*dy)
            )
        }));
        lines
    }
}

/// The longitudinal aberration, which belongs to the axial point.
#[derive(Serialize)]
pub(super) struct LongitudinalJson {
    rays: usize,
    milliseconds: f64,
    colors: Vec<ZonesJson>,
}

#[derive(Serialize)]
struct ZonesJson {
    wavelength_um: f64,
    /// The paraxial focus against that of the primary wavelength, in mm.
    axial_color: Option<f64>,
    zones: Vec<ZoneJson>,
}

#[derive(Serialize)]
struct ZoneJson {
    pupil: f64,
    focus: Option<f64>,
    error: f64,
}

pub(super) fn longitudinal(run: &AnalysisRun) -> Vec<AtField<LongitudinalJson>> {
    let axis = FieldPoint { x: 0.0, y: 0.0, weight: 1.0 };
    let (result, milliseconds) = time_ms(|| longitudinal_aberration(&run.model, ZONES));
    let keys = result.map(|found| {
        let paraxial = |found: &LongitudinalAberration| found.zones.first().and_then(|z| z.focus);
        let primary = found.get(run.model.primary).and_then(paraxial);
        let zone = |zone: &ZoneFocus| ZoneJson {
            pupil: zone.pupil,
            focus: zone.focus,
            error: zone.error + run.model.neglected.ray_shift,
        };
        let color = |color: &LongitudinalAberration| ZonesJson {
            wavelength_um: run.model.channels[color.wavelength].um,
            axial_color: paraxial(color).zip(primary).map(|(focus, primary)| focus - primary),
            zones: color.zones.iter().map(zone).collect(),
        };
        LongitudinalJson {
            rays: found.len() * (ZONES + 1),
            milliseconds,
            colors: found.iter().map(color).collect(),
        }
    });
    vec![AtField::new(&SelectedField { given: axis, traced: axis }, keys)]
}

impl TextLines for LongitudinalJson {
    const TITLE: &'static str =
        "longitudinal aberration: crossings of rays with the axis, in mm behind the image plane";

    fn lines(&self) -> Vec<String> {
        let mut lines = vec![format!("{}, {:.3} ms", counted(self.rays, "ray"), self.milliseconds)];
        for color in &self.colors {
            let axial = or_dash(color.axial_color);
            lines.push(format!("{} um, axial colour {axial} mm", color.wavelength_um));
            lines.push("   pupil         focus    error".to_owned());
            lines.extend(color.zones.iter().map(|ZoneJson { pupil, focus, error }| {
                format!("{:>8}  {:>12}  {error:.0e}", ShortNumber(*pupil), or_dash(*focus))
            }));
        }
        lines
    }

    /// The pupil stands upright, as is usual for this curve.
    fn charts(&self) -> Vec<CurveChart> {
        let curve = |(i, color): (usize, &ZonesJson)| {
            let zones = color.zones.iter().map(|zone| (zone.pupil, zone.focus));
            ChartCurve::new(format!("{} um", color.wavelength_um), i, zones).transposed()
        };
        let curves = self.colors.iter().enumerate().map(curve).collect();
        let axes = ["focus behind the image plane, mm", "pupil"];
        vec![CurveChart::new("longitudinal aberration", axes, curves)]
    }
}

/// The number of points on the edge of a footprint.
const EDGE: usize = 72;

/// The footprint of a field on a surface.
#[derive(Serialize)]
pub(super) struct FootprintJson {
    /// The index of the surface, from 0.
    surface: usize,
    error: f64,
    rays: usize,
    milliseconds: f64,
    /// The largest distance of the edge from the axis of the surface, in mm.
    reach: f64,
    semi_diameter: Option<f64>,
    outline: Vec<[f64; 2]>,
}

pub(super) fn footprints(
    run: &AnalysisRun,
    surface: usize,
) -> Result<Vec<AtField<FootprintJson>>, CliError> {
    let primary = run.model.primary;
    let count = run.model.channels[primary].system.surfaces.len();
    let Some(index) = surface.checked_sub(1).filter(|index| *index < count) else {
        let text = format!("--surface: found {surface}; expected 1 to {count}");
        return Err(CliError::Input(text));
    };
    let at = |field: &SelectedField| {
        let (result, milliseconds) =
            time_ms(|| footprint(&run.model, field.traced, primary, index, EDGE));
        let keys = result.map(|found| FootprintJson {
            surface: index,
            error: run.rounding() + run.model.neglected.ray_shift,
            rays: found.outline.len(),
            milliseconds,
            reach: found.reach,
            semi_diameter: found.semi_diameter,
            outline: found.outline,
        });
        AtField::new(field, keys)
    };
    Ok(run.at_each_field(at))
}

impl TextLines for FootprintJson {
    const TITLE: &'static str =
        "footprint of the beam at the primary wavelength, in mm in the frame of the surface";

    fn lines(&self) -> Vec<String> {
        let Self { error, rays, milliseconds, reach, semi_diameter, .. } = self;
        let rim = or_dash(*semi_diameter);
        let number = self.surface + 1;
        let mut lines = vec![
            format!("surface {number}: reach {} ± {error:.0e}, rim {rim}", ShortNumber(*reach)),
            format!("{}, {milliseconds:.3} ms", counted(*rays, "ray")),
            format!("{:>12}  {:>12}", "x, mm", "y, mm"),
        ];
        let corner = |point: &[f64; 2]| {
            let [x, y] = point.map(|v| ShortNumber(without_rounding(v, *error)));
            format!("{x:>12}  {y:>12}")
        };
        lines.extend(self.outline.iter().step_by(6).map(corner));
        lines
    }

    /// The edge of the beam, and the rim.
    fn charts(&self) -> Vec<CurveChart> {
        let closed = self.outline.iter().chain(self.outline.first()).copied().collect();
        let line = |name: &str, color, points| {
            let pieces = vec![points];
            ChartCurve { name: name.to_owned(), color, dashed: false, pieces }
        };
        let on_rim = |radius: f64| {
            let point = |i: usize| {
                let (sin, cos) = (TAU * i as f64 / EDGE as f64).sin_cos();
                [radius * cos, radius * sin]
            };
            line("rim", 1, (0..=EDGE).map(point).collect()).dashed()
        };
        let curves = self.semi_diameter.map(on_rim).into_iter();
        let curves = std::iter::once(line("beam", 0, closed)).chain(curves).collect();
        let title = format!("beam on surface {}", self.surface + 1);
        vec![CurveChart::map(title, ["x, mm", "y, mm"], curves)]
    }
}
