//! The effects of compensators on the rays of a lens as designed.

use super::folded::ErrorParity;
use super::merits::{Rear, merits_of};
use super::{RaySensitivity, ToleranceError, ToleranceScene, sensitivities};
use crate::lens::{AdjustedPart, Compensator, Perturbation, ToleranceSheet};

/// The compensators of a lens and their effects on its rays.
#[derive(Debug, Clone)]
pub struct Compensation {
    /// The focus, then the other compensators in their order.
    pub adjustments: Vec<Compensator>,
    /// The effect of each but the focus; none for a lens that is only refocused.
    pub(super) effects: Vec<AdjustmentEffect>,
}

/// The effect of a compensator.
#[derive(Debug, Clone)]
pub(super) struct AdjustmentEffect {
    pub(super) parity: ErrorParity,
    /// By one unit, on each ray of all fields and wavelengths one after the other.
    pub(super) rays: Vec<RaySensitivity>,
}

/// The focus and the other compensators of tolerances; a travel without an end is infinite.
pub fn adjustments(sheet: &ToleranceSheet) -> Vec<Compensator> {
    let travel = sheet.focus_travel.unwrap_or(f64::INFINITY);
    let focus = Compensator { part: AdjustedPart::Focus, travel };
    std::iter::once(focus).chain(sheet.compensators.iter().copied()).collect()
}

impl Compensation {
    /// The effects of the compensators of some tolerances.
    ///
    /// # Errors
    /// A compensator that is not possible on its surface, and a lens whose rays do not arrive.
    pub fn new(scene: &ToleranceScene, sheet: &ToleranceSheet) -> Result<Self, ToleranceError> {
        let adjustments = adjustments(sheet);
        if sheet.compensators.is_empty() {
            return Ok(Self { adjustments, effects: Vec::new() });
        }
        let parts = || sheet.compensators.iter().map(|compensator| compensator.part);
        let in_lens: Vec<Perturbation> = parts().filter_map(AdjustedPart::in_lens).collect();
        let found = sensitivities(&scene.lens, &scene.beam, scene.options, &in_lens)?;
        let mut found = found.into_iter();
        let landings = SensorRays::new(scene, adjustments[0].travel)?;
        let effect = |part: AdjustedPart| match part {
            AdjustedPart::Lens(error) => found.next().map(|effect| AdjustmentEffect {
                parity: ErrorParity::of(error.kind),
                rays: effect.rays,
            }),
            tilt => Some(landings.tilt(tilt)),
        };
        let effects = parts().filter_map(effect).collect();
        Ok(Self { adjustments, effects })
    }
}

/// The rays of a lens as designed at its best focus within a travel.
struct SensorRays {
    /// For each field the point and the slopes of each ray, with its weight.
    fields: Vec<Vec<([f64; 4], f64)>>,
}

impl SensorRays {
    /// Those of a lens whose focus has this travel.
    fn new(scene: &ToleranceScene, travel: f64) -> Result<Self, ToleranceError> {
        let systems = &scene.lens.systems;
        let image = systems[scene.lens.primary].vertex_positions().last().copied();
        let rear = Rear { systems, image: image.unwrap_or_default() };
        let (merits, mut fields) = merits_of(&rear, &scene.beam, scene.options)?;
        let focus = merits.focus.clamp(-travel, travel);
        for (ray, _) in fields.iter_mut().flatten() {
            let [_, _, u, v] = *ray;
            ray[0] += focus * u;
            ray[1] += focus * v;
        }
        Ok(Self { fields })
    }

    /// Numbers of each ray relative to their mean over its field.
    fn centred(&self, of: impl Fn(&[f64; 4]) -> [f64; 4]) -> Vec<RaySensitivity> {
        let field = |rays: &Vec<([f64; 4], f64)>| {
            let mut mean = [0.0; 4];
            for (ray, weight) in rays {
                mean.iter_mut().zip(of(ray)).for_each(|(sum, value)| *sum += weight * value);
            }
            let relative = |(ray, _): &([f64; 4], f64)| {
                let value = of(ray);
                let [x, y, u, v] = [0, 1, 2, 3].map(|i| value[i] - mean[i]);
                RaySensitivity { displacement: [x, y], slope: [u, v], bend: [0.0; 2] }
            };
            rays.iter().map(relative).collect::<Vec<_>>()
        };
        self.fields.iter().flat_map(field).collect()
    }

    /// The effect of a tilt of the sensor: it moves each point along its ray in proportion to its height.
    fn tilt(&self, part: AdjustedPart) -> AdjustmentEffect {
        let about_x = part == AdjustedPart::SensorTiltX;
        let rays = self.centred(|[x, y, u, v]| {
            // A turn about y takes the x axis away from the light.
            let lever = if about_x { *y } else { -x };
            [lever * u, lever * v, *u, *v]
        });
        AdjustmentEffect { parity: ErrorParity { odd: !about_x, lateral: true }, rays }
    }
}
