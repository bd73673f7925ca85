//! The illumination of the fields.

use super::{AnalysisRun, AtField, SelectedField, TextLines, estimate_text};
use crate::analysis::{
    Estimate, Illumination, energy_irradiance, illumination, irradiance, scene_irradiance,
};
use crate::cli::output::ShortNumber;
use crate::lens::FieldPoint;
use crate::measure::time_ms;
use crate::picture::Scene;
use crate::pupil::RayModel;
use crate::trace::Ray;
use serde::Serialize;

/// The light at a field; a field without light has 0 and the reason.
#[derive(Serialize)]
pub(super) struct IlluminationJson {
    irradiance: Estimate,
    relative: Option<Estimate>,
    /// The irradiance from the energy of the field element.
    energy: Option<Estimate>,
    point: [f64; 2],
    cone: Estimate,
    relative_cone: Option<Estimate>,
    #[serde(skip_serializing_if = "Option::is_none")]
    dark: Option<String>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    points: Vec<PointLight>,
}

/// The irradiance at a point of the image, in mm; `None` where no light arrives or where it is not known.
#[derive(Clone, Serialize)]
struct PointLight {
    x: f64,
    y: f64,
    irradiance: Option<Estimate>,
    #[serde(skip_serializing_if = "Option::is_none")]
    refused: Option<String>,
}

/// The irradiance at the points that were asked for, of a scene or of radiance 1 everywhere.
fn point_lights(run: &AnalysisRun, scene: Option<&Scene>) -> Vec<PointLight> {
    // The plan of the fields' beams says nothing about rims that other points see.
    let model = RayModel::from_lens(&run.opened.lens, run.zoom);
    let model = model.as_ref().unwrap_or(&run.model);
    let at = |point: &[f64; 2]| {
        let (w, accuracy) = (model.primary, run.accuracy);
        let (found, ms) = time_ms(|| match scene {
            None => irradiance(model, w, *point, accuracy),
            Some(scene) => {
                let radiance = |ray: &Ray<f64>| scene.radiance(ray, 0.0)[0];
                scene_irradiance(model, w, *point, radiance, accuracy)
            }
        });
        let timed = |e| Estimate { milliseconds: Some(ms), ..e };
        let refused = found.as_ref().err().filter(|why| !why.is_loss_of_light());
        PointLight {
            x: point[0],
            y: point[1],
            refused: refused.map(ToString::to_string),
            irradiance: found.ok().map(timed),
        }
    };
    run.points.iter().map(at).collect()
}

pub(super) fn illuminations(
    run: &AnalysisRun,
    scene: Option<&Scene>,
) -> Vec<AtField<IlluminationJson>> {
    let points = point_lights(run, scene);
    // The reference is the first field of the lens, even if it is not selected.
    let first = run.model.fields.first();
    let selected: Vec<FieldPoint> = run.fields.iter().map(|field| field.traced).collect();
    let skipped = usize::from(first != selected.first());
    let fields = first.into_iter().take(skipped).chain(&selected).copied().collect();
    let model = RayModel { fields, ..run.model.clone() };
    let (results, ms) = time_ms(|| illumination(&model, model.primary, run.accuracy));
    let dark = results.iter().all(|light| light.error.is_some());
    let found = |(field, light): (&SelectedField, &Illumination)| match light.error {
        Some(why) if dark => AtField::new(field, Err(why)),
        _ => keys(run, field, (light, &points), ms),
    };
    run.fields.iter().zip(&results[skipped..]).map(found).collect()
}

fn keys(
    run: &AnalysisRun,
    field: &SelectedField,
    (light, points): (&Illumination, &[PointLight]),
    milliseconds: f64,
) -> AtField<IlluminationJson> {
    let timed = |estimate, milliseconds| Estimate { milliseconds: Some(milliseconds), ..estimate };
    let primary = run.model.primary;
    let (energy, energy_ms) =
        time_ms(|| energy_irradiance(&run.model, field.traced, primary, run.accuracy));
    let keys = IlluminationJson {
        irradiance: timed(light.irradiance, milliseconds),
        relative: light.relative.map(|e| timed(e, milliseconds)),
        energy: energy.ok().map(|e| timed(e, energy_ms)),
        point: light.point,
        cone: timed(light.cone, milliseconds),
        relative_cone: light.relative_cone.map(|e| timed(e, milliseconds)),
        dark: light.error.map(|dark| dark.to_string()),
        points: points.to_vec(),
    };
    AtField::new(field, Ok(keys))
}

impl TextLines for IlluminationJson {
    const TITLE: &'static str = "illumination at the primary wavelength: irradiance at the centroid \
         of the spot over the radiance of a uniform scene, and against the first field; the cone is \
         that of the rays of one field";

    fn lines(&self) -> Vec<String> {
        let mut lines = vec![if self.irradiance.error.is_finite() {
            estimate_text("irradiance", &self.irradiance)
        } else {
            "irradiance not known".to_owned()
        }];
        lines.extend(self.relative.iter().map(|e| estimate_text("relative", e)));
        lines.extend(self.energy.iter().map(|e| estimate_text("by energy", e)));
        lines.push(estimate_text("cone", &self.cone));
        lines.extend(self.relative_cone.iter().map(|e| estimate_text("relative cone", e)));
        lines.extend(self.points.iter().map(|PointLight { x, y, irradiance, refused }| {
            let place = format!("at {}, {} mm", ShortNumber(*x), ShortNumber(*y));
            let why = refused.as_deref().unwrap_or("no light");
            irradiance
                .as_ref()
                .map_or_else(|| format!("{place}: {why}"), |light| estimate_text(&place, light))
        }));
        lines.extend(self.dark.clone());
        lines
    }
}
