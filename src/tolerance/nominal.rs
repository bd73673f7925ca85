//! A lens of the prescription with its beam, ready for errors of making.
//!
//! The pupils are found for the lens as designed, with its rims; their rays are then held. A lens that
//! is symmetric about its axis is judged on both sides of it: its errors are not symmetric.

use super::merits::open_tracers;
use super::pupils::{ColourPupil, FieldPupils, PupilTreatment, ScenePupils};
use super::refuse_if_stopped;
use super::{Beam, ColourRays, FieldBeam, MeritOptions, NominalLens, StopTest, ToleranceError};
use crate::lens::{Lens, System, lie_on_one_side};
use crate::math::Vec3;
use crate::pupil::{Accuracy, Launch, Nodes, RayModel, Region, converge};
use crate::trace::{ImagePoints, Ray};
use std::sync::Arc;

/// A lens as designed, the rays by which it is judged, and their accuracy.
#[derive(Debug, Clone)]
pub struct ToleranceScene {
    /// The lens.
    pub lens: NominalLens,
    /// The rays.
    pub beam: Beam,
    /// The quantities computed besides spots.
    pub options: MeritOptions,
    /// The largest relative error of the radius of a spot by the quadrature over its pupil.
    pub sampling_error: f64,
    /// The pupils, if they can move with errors.
    pub pupils: PupilTreatment,
}

impl ToleranceScene {
    /// A lens at a zoom position, with pupils sampled so that the radius of each spot is accurate to a
    /// relative tolerance.
    ///
    /// # Errors
    /// A lens through which no light can be traced.
    pub fn new(lens: &Lens, zoom: usize, tolerance: f64) -> Result<Self, ToleranceError> {
        Self::new_until(lens, zoom, tolerance, &|| false)
    }

    /// The same until `stop` says so.
    ///
    /// # Errors
    /// A lens through which no light can be traced, and [`ToleranceError::Stopped`].
    pub fn new_until(
        lens: &Lens,
        zoom: usize,
        tolerance: f64,
        stop: StopTest<'_>,
    ) -> Result<Self, ToleranceError> {
        let model = RayModel::from_lens(lens, zoom).map_err(|e| other(&e))?;
        let mut sampler = Sampler::new(&model, tolerance, stop);
        let (mut fields, mut pupils) = (Vec::new(), Vec::new());
        let has_one_side = has_one_side(&model);
        for (number, point) in model.fields.iter().enumerate() {
            if !(point.weight > 0.0) {
                continue;
            }
            let (first, field) = (fields.len(), sampler.field(number)?);
            let sides = if has_one_side { both_sides(&field) } else { vec![field] };
            let place = (first, sides.len() > 1);
            let colours = std::mem::take(&mut sampler.pupils);
            pupils.push(FieldPupils::new((number, *point), place, colours));
            fields.extend(sides);
        }
        let Sampler { worst, held, .. } = sampler;
        let total: f64 = fields.iter().map(|field| field.weight).sum();
        fields.iter_mut().for_each(|field| field.weight /= total);
        let beam = Beam { fields };
        let lens = NominalLens::new(lens, &model, &beam)?;
        let options = MeritOptions { primary: model.primary, wavefront: None };
        let known = held.map_or_else(|| ScenePupils::new(model, pupils), Err);
        let pupils =
            known.map_or_else(PupilTreatment::Held, |own| PupilTreatment::Known(Arc::new(own)));
        Ok(Self { lens, beam, options, sampling_error: worst, pupils })
    }

    /// The number of rays traced for a lens with errors, whose pupils are found anew if they are to move.
    pub fn rays_of_real_lens(&self, moving_pupils: bool) -> usize {
        match &self.pupils {
            PupilTreatment::Known(pupils) if moving_pupils => pupils.rays_of_lens()[0],
            _ => self.beam.rays(),
        }
    }

    /// The same with the rays of the lens as designed in all lenses with errors, whatever their rims.
    #[must_use]
    pub fn with_held_pupils(self) -> Self {
        Self { pupils: PupilTreatment::Held("it was asked for"), ..self }
    }
}

fn other(error: &dyn std::fmt::Display) -> ToleranceError {
    ToleranceError::Other(error.to_string())
}

/// True if all fields lie on one side of the axis of a lens that a half turn does not change.
pub(super) fn has_one_side(model: &RayModel) -> bool {
    let system = &model.channels[model.primary].system;
    !system.has_poses() && system.has_round_apertures() && lie_on_one_side(&model.fields)
}

/// A field off the axis and the one opposite to it, with half of the weight each.
fn both_sides(field: &FieldBeam) -> Vec<FieldBeam> {
    let Ray { point, direction } = field.chief.0;
    if point.x == 0.0 && point.y == 0.0 && direction.x == 0.0 && direction.y == 0.0 {
        return vec![field.clone()];
    }
    let half = FieldBeam { weight: 0.5 * field.weight, ..field.clone() };
    let mut opposite = half.clone();
    opposite.chief.0 = half_turn(opposite.chief.0);
    for colour in &mut opposite.colours {
        colour.rays.iter_mut().for_each(|ray| *ray = half_turn(*ray));
        colour.pupil.iter_mut().for_each(|[x, y]| (*x, *y) = (-*x, -*y));
    }
    vec![half, opposite]
}

/// A ray that is turned by 180° about the axis.
pub(super) fn half_turn(ray: Ray<f64>) -> Ray<f64> {
    let turn = |v: Vec3<f64>| Vec3::new(-v.x, -v.y, v.z);
    Ray { point: turn(ray.point), direction: turn(ray.direction) }
}

/// A ray that is reflected at the plane x = 0.
pub(super) fn mirror_image(ray: Ray<f64>) -> Ray<f64> {
    let flip = |v: Vec3<f64>| Vec3::new(-v.x, v.y, v.z);
    Ray { point: flip(ray.point), direction: flip(ray.direction) }
}

/// Finds the rays of fields.
struct Sampler<'a> {
    model: &'a RayModel,
    tolerance: f64,
    worst: f64,
    stop: StopTest<'a>,
    /// The pupils of the field.
    pupils: Vec<ColourPupil>,
    /// The reason why a pupil cannot move, if so.
    held: Option<&'static str>,
}

impl<'a> Sampler<'a> {
    fn new(model: &'a RayModel, tolerance: f64, stop: StopTest<'a>) -> Self {
        Self { model, tolerance, worst: 0.0, stop, pupils: Vec::new(), held: None }
    }

    fn field(&mut self, number: usize) -> Result<FieldBeam, ToleranceError> {
        let field = self.model.fields[number];
        let (mut colours, mut shares, mut chief) = (Vec::new(), 0.0, None);
        for (wavelength, channel) in self.model.channels.iter().enumerate() {
            refuse_if_stopped(self.stop)?;
            let launch = self.model.launch(field, wavelength).map_err(|e| other(&e))?;
            if wavelength == self.model.primary {
                chief = launch.ray([0.0, 0.0]).map(|ray| (ray, launch.optical_path_to(ray)));
            }
            if channel.weight > 0.0
                && let Some(rays) = self.colour(launch, channel.weight)
            {
                shares += channel.weight;
                colours.push(rays);
            }
        }
        let dark = || {
            ToleranceError::Other(format!(
                "no light of field {} gets through; expected a smaller field, or one of weight 0",
                number + 1
            ))
        };
        let chief = chief.filter(|_| shares > 0.0).ok_or_else(dark)?;
        for colour in &mut colours {
            colour.weights.iter_mut().for_each(|w| *w /= shares);
        }
        self.pupils.iter_mut().for_each(|pupil| pupil.share /= shares);
        Ok(FieldBeam { weight: field.weight, colours, chief })
    }

    /// The rays of a pupil, with this weight in sum; `None` if no light gets through.
    fn colour(&mut self, launch: Launch<'_>, share: f64) -> Option<ColourRays> {
        let region = Region::new(launch);
        let accuracy = Accuracy { tolerance: self.tolerance, ..Accuracy::default() };
        let radius = |nodes: &Nodes| {
            let moments = region.moments(nodes);
            (moments.area > 0.0).then(|| [moments.rms_radius()])
        };
        let found = converge(&region, accuracy, radius, |values| *values)?;
        let orders = found.orders;
        let error = found.errors[0] / found.values[0].max(f64::MIN_POSITIVE);
        // The order before the last differs from it by the error of that, which is half of its own.
        let spared = usize::from(found.converged && 2.0 * error <= self.tolerance && orders > 2);
        self.worst = self.worst.max(error * (1 + spared) as f64);
        let order = orders.saturating_sub(1 + spared);
        match ColourPupil::new(&region, order, share) {
            Ok(pupil) => self.pupils.push(pupil),
            Err(why) => self.held = Some(why),
        }
        let nodes = region.nodes(order);
        let traced = region.trace::<ImagePoints<f64>>(&nodes);
        let total: f64 = traced.arrivals().map(|(_, w)| w).sum();
        let mut colour = ColourRays::new(region.launch.wavelength);
        let launched = nodes.points.iter().filter_map(|p| Some((*p, region.launch.ray(*p)?)));
        let launched: Vec<_> = launched.collect();
        for (i, weight) in traced.arrivals() {
            let (pupil, ray) = launched[i];
            let (weight, path) = (share * weight / total, region.launch.optical_path_to(ray));
            if nodes.mirrored {
                colour.push_both_sides(ray, weight, pupil, path);
            } else {
                colour.push(ray, weight, pupil, path);
            }
        }
        (total > 0.0).then_some(colour)
    }
}

/// The radius within which the crossing with a surface is sought, in heights of the outermost ray: an
/// error of making moves rays by much less.
const SEARCH_MARGIN: f64 = 1.1;

/// The largest distance in mm from the axis at which a ray of a beam meets each surface, whatever its
/// rim.
fn ray_heights(systems: &[System<f64>], beam: &Beam) -> Result<Vec<f64>, ToleranceError> {
    let mut heights = vec![0.0_f64; systems[0].surfaces.len()];
    let tracers = open_tracers(systems)?;
    for colour in beam.fields.iter().flat_map(|field| &field.colours) {
        for ray in &colour.rays {
            tracers[colour.wavelength].visit(*ray, |i, p| {
                heights[i] = heights[i].max(p.x.hypot(p.y));
            });
        }
    }
    Ok(heights)
}

impl NominalLens {
    /// A lens at its wavelengths, with the semi-diameters of the prescription or else those that the
    /// rays need.
    fn new(lens: &Lens, model: &RayModel, beam: &Beam) -> Result<Self, ToleranceError> {
        let whole: Vec<System<f64>> = model.channels.iter().map(|c| c.system.clone()).collect();
        let heights = ray_heights(&whole, beam)?;
        let mut systems = whole.clone();
        for system in &mut systems {
            let has_grin = system.has_grin();
            for (surface, height) in system.surfaces.iter_mut().zip(&heights) {
                surface.remove_apertures();
                if !has_grin && *height > 0.0 {
                    surface.semi_diameter = SEARCH_MARGIN * height;
                }
            }
        }
        let written = lens.surfaces.iter().zip(heights);
        let semi_diameters = written.map(|(row, height)| row.semi_diameter.unwrap_or(height));
        Ok(Self {
            systems,
            wavelengths: model.channels.iter().map(|c| c.um).collect(),
            primary: model.primary,
            semi_diameters: semi_diameters.collect(),
            rims: whole[model.primary]
                .surfaces
                .iter()
                .map(|own| (own.semi_diameter, own.obstruction, own.apertures.clone()))
                .collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::FieldPoint;

    #[test]
    fn two_opposite_fields_share_the_weight_of_one() {
        let ray = |x: f64, y: f64| Ray {
            point: Vec3::new(x, y, 0.0),
            direction: Vec3::new(0.0, 0.6, 0.8),
        };
        let mut colour = ColourRays::new(0);
        colour.push(ray(1.0, 2.0), 1.0, [0.1, 0.2], 0.0);
        let field = FieldBeam { weight: 0.3, colours: vec![colour], chief: (ray(0.0, 0.0), 0.0) };
        let [same, opposite] = both_sides(&field).try_into().unwrap();
        assert_eq!([same.weight, opposite.weight], [0.15, 0.15]);
        let turned = opposite.colours[0].rays[0];
        assert_eq!([turned.point.x, turned.point.y, turned.direction.y], [-1.0, -2.0, -0.6]);
        assert_eq!(opposite.colours[0].pupil[0], [-0.1, -0.2]);
    }

    /// Half a pupil stands for its mirror image, at the mirrored place of the pupil.
    #[test]
    fn the_rays_of_a_field_on_an_axis_fill_both_halves_of_the_pupil() {
        let found = crate::files::bundled_lenses().iter().find(|b| b.name == "tessar_50_f28");
        let found = found.unwrap();
        let lens = crate::files::json::read(found.text, found.name).unwrap();
        let model = RayModel::from_lens(&lens, 0).unwrap();
        let mut sampler = Sampler::new(&model, 1e-2, &|| false);
        let field = sampler.field(1).unwrap();
        for colour in &field.colours {
            let mean = |of: &dyn Fn(usize) -> f64| -> f64 {
                (0..colour.rays.len()).map(|i| colour.weights[i] * of(i)).sum()
            };
            assert!(mean(&|i| colour.pupil[i][0]).abs() < 1e-12);
            assert!(mean(&|i| colour.rays[i].point.x).abs() < 1e-10);
            assert!(mean(&|i| colour.pupil[i][0].abs()) > 0.05);
            // The same side of the pupil is the same side of the beam.
            assert!(
                (0..colour.rays.len())
                    .all(|i| { colour.pupil[i][0] * colour.rays[i].point.x >= 0.0 })
            );
        }
    }

    /// A field without weight is not traced, so it does not stand for the other side.
    #[test]
    fn fields_are_on_one_side_if_those_with_weight_are() {
        let one_side = |heights: &[(f64, f64)]| {
            let mut lens = crate::lens::blank();
            let field = |(y, weight): &(f64, f64)| FieldPoint { x: 0.0, y: *y, weight: *weight };
            lens.fields.values = heights.iter().map(field).collect();
            has_one_side(&RayModel::from_lens(&lens, 0).unwrap())
        };
        assert!(one_side(&[(0.0, 1.0), (4.0, 1.0)]) && one_side(&[(-4.0, 1.0), (0.0, 0.5)]));
        assert!(one_side(&[(0.0, 1.0), (4.0, 1.0), (-3.0, 0.0)]));
        assert!(!one_side(&[(0.0, 1.0), (4.0, 1.0), (-3.0, 0.1)]));
    }
}
