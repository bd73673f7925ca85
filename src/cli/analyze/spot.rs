//! Where the rays of a field land.

use super::{AtField, Lines, Task, show, with_time};
use crate::analysis::{ColorSpot, Dark, Estimate, Spot, spot};
use serde::Serialize;

/// The spot of a field.
#[derive(Serialize)]
pub(super) struct SpotKeys {
    rms: Estimate,
    radius: Estimate,
    centroid_x: Estimate,
    centroid_y: Estimate,
    reached: bool,
    colors: Vec<ColorKeys>,
}

/// The spot in one colour.
#[derive(Serialize)]
#[serde(untagged)]
enum ColorKeys {
    Lit {
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

pub(super) fn spots(task: &Task) -> Vec<AtField<SpotKeys>> {
    let at = |field: &crate::lens::Field| {
        let result = with_time(|| spot(&task.bench, *field, task.accuracy), note_time);
        AtField::new(*field, result.map(|spot| SpotKeys::new(task, &spot)))
    };
    task.fields.iter().map(at).collect()
}

/// All numbers of a spot come from the same rays at the same time.
fn note_time(result: &mut Result<Spot, Dark>, milliseconds: f64) {
    let Ok(Spot { rms, centroid: [x, y], radius, colors, .. }) = result else { return };
    let note = |estimate: &mut Estimate| estimate.milliseconds = Some(milliseconds);
    [rms, x, y, radius].into_iter().for_each(note);
    for ColorSpot { rms, centroid: [x, y], area, .. } in colors.iter_mut().flatten() {
        [rms, x, y, area].into_iter().for_each(note);
    }
}

impl SpotKeys {
    pub(super) fn rms(&self) -> f64 {
        self.rms.value
    }

    fn new(task: &Task, spot: &Spot) -> Self {
        let colors = task.bench.colors.iter().zip(&spot.colors);
        Self {
            rms: spot.rms,
            radius: spot.radius,
            centroid_x: spot.centroid[0],
            centroid_y: spot.centroid[1],
            reached: spot.colors.iter().flatten().all(|color| color.reached),
            colors: colors.map(|(color, spot)| ColorKeys::new(color.um, spot)).collect(),
        }
    }
}

impl ColorKeys {
    fn new(wavelength_um: f64, spot: &Result<ColorSpot, Dark>) -> Self {
        match spot {
            Ok(spot) => Self::Lit {
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
            Self::Lit { wavelength_um, rms, .. } => {
                show(&format!("rms at {wavelength_um} um"), rms)
            }
            Self::Dark { wavelength_um, dark } => format!("{wavelength_um} um: {dark}"),
        }
    }
}

impl Lines for SpotKeys {
    const TITLE: &'static str = "spot, in mm; the centroid is that of all colours";

    fn lines(&self) -> Vec<String> {
        let mut lines = vec![
            show("rms radius", &self.rms),
            show("geometric radius", &self.radius),
            show("centroid x", &self.centroid_x),
            show("centroid y", &self.centroid_y),
        ];
        if !self.reached {
            lines.push("the tolerance was not reached".to_owned());
        }
        lines.extend(self.colors.iter().map(ColorKeys::line));
        lines
    }
}
