//! Transverse ray errors along the two sections of the pupil.

use super::{AtField, Lines, Task};
use crate::analysis::{Fan, FanPoint, fan};
use crate::cli::output::{Number, optional};
use crate::measure::timed;
use serde::Serialize;

/// Rays of a fan: a curve that people look at, not a sum.
const POINTS: usize = 21;

/// The fans of a field.
#[derive(Serialize)]
pub(super) struct FanKeys {
    error: f64,
    rays: usize,
    milliseconds: f64,
    colors: Vec<ColorKeys>,
}

#[derive(Serialize)]
struct ColorKeys {
    wavelength_um: f64,
    tangential: Vec<PointKeys>,
    sagittal: Vec<PointKeys>,
}

#[derive(Serialize)]
struct PointKeys {
    pupil: f64,
    dx: Option<f64>,
    dy: Option<f64>,
    fate: Option<&'static str>,
    surface: Option<usize>,
}

pub(super) fn fans(task: &Task) -> Vec<AtField<FanKeys>> {
    let at = |field: &crate::lens::Field| {
        let (result, milliseconds) = timed(|| fan(&task.bench, *field, POINTS));
        let keys = |fans: Vec<Fan>| FanKeys {
            error: task.rounding(),
            rays: 2 * POINTS * fans.len(),
            milliseconds,
            colors: fans.iter().map(|fan| ColorKeys::new(task, fan)).collect(),
        };
        AtField::new(*field, result.map(keys))
    };
    task.fields.iter().map(at).collect()
}

impl ColorKeys {
    fn new(task: &Task, fan: &Fan) -> Self {
        let keys = |points: &[FanPoint]| points.iter().map(PointKeys::new).collect();
        Self {
            wavelength_um: task.bench.colors[fan.wavelength].um,
            tangential: keys(&fan.tangential),
            sagittal: keys(&fan.sagittal),
        }
    }
}

impl PointKeys {
    fn new(point: &FanPoint) -> Self {
        Self {
            pupil: point.pupil,
            dx: point.error.map(|e| e[0]),
            dy: point.error.map(|e| e[1]),
            fate: point.fate.map(crate::trace::Fate::name),
            surface: point.fate.and_then(crate::trace::Fate::surface),
        }
    }
}

impl Lines for FanKeys {
    const TITLE: &'static str =
        "ray fans: distance from the chief ray of the primary wavelength, in mm";

    fn lines(&self) -> Vec<String> {
        let Self { error, rays, milliseconds, colors } = self;
        let mut lines = vec![format!("{rays} rays, {milliseconds:.3} ms, rounding {error:.0e} mm")];
        for color in colors {
            lines.push(format!("{} um", color.wavelength_um));
            lines.push("   pupil   tangential dy  sagittal dx  sagittal dy".to_owned());
            for (t, s) in color.tangential.iter().zip(&color.sagittal) {
                let [t, sx, sy] = [t.dy, s.dx, s.dy].map(optional);
                lines.push(format!("{:>8}  {t:>14}  {sx:>11}  {sy:>11}", Number(s.pupil)));
            }
        }
        lines
    }
}
