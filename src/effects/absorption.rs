//! The light that the glasses of a lens absorb, for numbers that ask for it.

use crate::lens::Lens;
use crate::math::Vec3;
use crate::pupil::{Channel, RayModel, Region};
use crate::trace::Ray;

/// The order of the quadrature of each pupil whose rays are weighed.
const ORDER: usize = 4;

/// The largest share of light on the axis that the glasses of a lens absorb, over its wavelengths; glasses
/// without data count as clear.
pub(super) fn absorbed_on_axis(lens: &Lens, model: &RayModel) -> f64 {
    let share = |channel: &Channel| {
        let surfaces = &channel.system.surfaces;
        let gaps = surfaces.iter().enumerate().take(surfaces.len().saturating_sub(2));
        let along = gaps.map(|(i, row)| absorbance(lens, i, channel.um) * row.thickness.abs());
        1.0 - (-along.sum::<f64>()).exp()
    };
    model.channels.iter().map(share).fold(0.0, f64::max)
}

fn absorbance(lens: &Lens, surface: usize, um: f64) -> f64 {
    lens.absorbance(surface, um).unwrap_or(0.0)
}

/// The mean share of the light of all fields and wavelengths that the glasses of a lens let through, ray by
/// ray; `None` without light. The way between surfaces is that between their points on a straight axis.
pub fn transmitted_light(lens: &Lens, model: &RayModel) -> Option<f64> {
    let (mut passed, mut all) = (0.0, 0.0);
    for field in &model.fields {
        for (wavelength, channel) in model.channels.iter().enumerate() {
            let Ok(launch) = model.launch(*field, wavelength) else { continue };
            let region = Region::new(launch);
            let nodes = region.nodes(ORDER.min(region.orders().saturating_sub(1)));
            let rows = channel.system.surfaces.iter().enumerate();
            let gaps: Vec<(f64, f64)> =
                rows.map(|(i, row)| (absorbance(lens, i, channel.um), row.thickness)).collect();
            let rays = nodes.points.iter().zip(&nodes.weights);
            let rays = rays.filter_map(|(p, weight)| Some((region.launch.ray(*p)?, weight)));
            for (depth, weight) in
                rays.filter_map(|(ray, weight)| Some((depth(channel, ray, &gaps)?, weight)))
            {
                let weight = field.weight * channel.weight * weight;
                passed += weight * (-depth).exp();
                all += weight;
            }
        }
    }
    (all > 0.0).then(|| passed / all)
}

/// The optical depth of the glasses along a ray, by the absorbance in each gap in 1/mm and its thickness in
/// mm; `None` for a ray that does not arrive.
fn depth(channel: &Channel, ray: Ray<f64>, gaps: &[(f64, f64)]) -> Option<f64> {
    let (mut before, mut depth) = (None::<Vec3<f64>>, 0.0);
    let landing = channel.tracer.visit(ray, |i, point| {
        let front = i.checked_sub(1).and_then(|front| gaps.get(front));
        if let (Some(from), Some((absorbance, gap))) = (before, front) {
            let along = point - from + Vec3::new(0.0, 0.0, *gap);
            depth += absorbance * along.dot(along).sqrt();
        }
        before = Some(point);
    });
    landing.fate.is_imaged().then_some(depth)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::{bundled_lenses, json};

    /// Slanted rays have longer ways through glass than that of the axis, and none has a shorter one than
    /// the thinnest gap; air absorbs nothing.
    #[test]
    fn the_light_of_all_rays_is_near_that_of_the_axis() {
        let read = |name: &str| {
            let found = bundled_lenses().iter().find(|own| own.name == name).unwrap();
            let lens = json::read(found.text, name).unwrap();
            let model = RayModel::from_lens(&lens, 0).unwrap();
            (absorbed_on_axis(&lens, &model), transmitted_light(&lens, &model).unwrap())
        };
        let (axis, passed) = read("singlet_la1131");
        assert!(axis > 0.0 && axis < 0.05, "{axis}");
        assert!((1.0 - passed - axis).abs() < 0.5 * axis, "{axis} {passed}");
        let (axis, passed) = read("telescope_rc_f8");
        assert!(axis == 0.0 && (passed - 1.0).abs() < 1e-12, "{axis} {passed}");
    }
}
