//! Real rays along the path of a ghost.

use super::path::GhostPath;
use crate::analysis::coating::Coating;
use crate::lens::{FieldPoint, Object};
use crate::math::Vec3;
use crate::pupil::{PupilPattern, RayModel, pattern_points};
use crate::trace::{Fates, Ray};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// The light of a ghost in the image, by real rays.
#[derive(Debug, Clone, PartialEq)]
pub struct GhostPatch {
    /// The share of the light of the entrance pupil that arrives, polarised across (s) and in (p) the
    /// planes of incidence.
    pub flux: [f64; 2],
    /// The centre of its light, x and y in mm; `None` if no ray arrives.
    pub center: Option<[f64; 2]>,
    /// The radius of the even disc with the same RMS radius, in mm; 0 if no ray arrives.
    pub radius: f64,
    /// The mean irradiance over that disc relative to the irradiance at the entrance of the lens.
    pub irradiance: f64,
    /// The ends of the rays.
    pub fates: Fates,
    /// The surface where most of the lost rays end.
    pub lost_at: Option<usize>,
}

/// The rays of a field that fill the first surface of a lens.
pub(super) struct ArrivingBeam {
    rays: Vec<Ray<f64>>,
    /// The area across the beam that a ray stands for, in mm².
    area: f64,
    /// The area of the beam that fills the entrance pupil, in mm².
    pupil_area: f64,
    /// The wavelength, in mm.
    wavelength: f64,
}

impl ArrivingBeam {
    /// The beam of a field: a square grid of about this many rays over the first surface, or over the
    /// entrance pupil if nothing limits that surface.
    pub(super) fn new(
        model: &RayModel,
        field: FieldPoint,
        wavelength: usize,
        count: usize,
    ) -> Self {
        let channel = &model.channels[wavelength];
        let first = channel.system.surfaces[0].outer_radius();
        let pupil = 0.5 * model.first_order.entrance_pupil.diameter.unwrap_or(0.0).abs();
        let reach = if first.is_finite() { first } else { pupil };
        let side = (count as f64 * 8.0 / TAU).sqrt().ceil().max(2.0) as usize;
        let points = pattern_points(PupilPattern::Square(side));
        let area = 0.5 * TAU * reach * reach / points.len().max(1) as f64;
        let chief = model.launch(field, wavelength).ok().and_then(|launch| launch.ray([0.0; 2]));
        let rays = chief.map_or_else(Vec::new, |chief| {
            let at = |p: &[f64; 2]| Vec3::new(reach * p[0], reach * p[1], 0.0);
            points.iter().map(|p| ray_to(at(p), chief, model.beam.object)).collect()
        });
        let cosine = chief.map_or(1.0, |chief| chief.direction.z.abs());
        Self {
            rays,
            area: area * cosine,
            pupil_area: 0.5 * TAU * pupil * pupil * cosine,
            wavelength: 1e-3 * channel.um,
        }
    }

    /// The light that arrives along a path.
    pub(super) fn patch(&self, path: &GhostPath, coating: Coating) -> GhostPatch {
        let mut fates = Fates::default();
        let mut ends: BTreeMap<usize, usize> = BTreeMap::new();
        let mut light = PatchSum::default();
        for ray in &self.rays {
            let found = path.trace(*ray, self.wavelength, coating);
            fates.count(found.traced.fate);
            match path.lost_at(found.traced.fate) {
                Some(surface) => *ends.entry(surface).or_default() += 1,
                None => light.add(found.traced.ray.point, found.intensity),
            }
        }
        let (center, radius) = light.disc();
        let flux = light.flux.map(|sum| sum * self.area / self.pupil_area);
        let power = 0.5 * (light.flux[0] + light.flux[1]) * self.area;
        let disc = 0.5 * TAU * radius * radius;
        GhostPatch {
            flux,
            center,
            radius,
            irradiance: if disc > 0.0 { power / disc } else { 0.0 },
            fates,
            lost_at: ends.into_iter().max_by_key(|(_, count)| *count).map(|(surface, _)| surface),
        }
    }
}

/// The ray of a field to a point of the plane through the first vertex.
fn ray_to(point: Vec3<f64>, chief: Ray<f64>, object: Object) -> Ray<f64> {
    match object {
        Object::Infinity => Ray { point, direction: chief.direction },
        Object::Finite(_) => {
            let step = point - chief.point;
            let direction = step * (1.0 / step.dot(step).sqrt());
            Ray { point: chief.point, direction }
        }
    }
}

/// The light of the rays that arrive.
#[derive(Default)]
struct PatchSum {
    flux: [f64; 2],
    first: [f64; 2],
    second: f64,
}

impl PatchSum {
    fn add(&mut self, at: Vec3<f64>, intensity: [f64; 2]) {
        let light = 0.5 * (intensity[0] + intensity[1]);
        self.flux = [0, 1].map(|k| self.flux[k] + intensity[k]);
        self.first = [self.first[0] + light * at.x, self.first[1] + light * at.y];
        self.second += light * (at.x * at.x + at.y * at.y);
    }

    /// The centre, and the radius of the even disc with the same mean square.
    fn disc(&self) -> (Option<[f64; 2]>, f64) {
        let light = 0.5 * (self.flux[0] + self.flux[1]);
        if !(light > 0.0) {
            return (None, 0.0);
        }
        let [x, y] = self.first.map(|sum| sum / light);
        let square = (self.second / light - x * x - y * y).max(0.0);
        (Some([x, y]), (2.0 * square).sqrt())
    }
}
