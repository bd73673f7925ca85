//! The rays of a lens drawing, in mm, independent of the drawing.

use crate::lens::Object;
use crate::math::Vec3;
use crate::pupil::RayModel;
use crate::trace::{Fates, RayPolyline};

/// Meridional rays through a lens.
#[derive(Debug, Clone, Default)]
pub struct RayLayout {
    /// The rays of each field, from the lower edge of the pupil to the upper.
    pub rays: Vec<LayoutRay>,
    /// The largest distance from the axis at which the rays meet each surface, the image plane last, in
    /// mm.
    pub ray_heights: Vec<f64>,
    /// The number of rays by their fate.
    pub fates: Fates,
    /// The fields without rays, each with the reason.
    pub errors: Vec<(usize, String)>,
}

/// A ray of a layout.
#[derive(Debug, Clone)]
pub struct LayoutRay {
    /// The index of its field.
    pub field: usize,
    /// The index of its wavelength.
    pub wavelength: usize,
    /// Its relative pupil height, −1 to 1.
    pub pupil: f64,
    /// Its vertices in the frame of the first surface, from a point in front of the lens to its end,
    /// and its fate.
    pub path: RayPolyline,
}

/// The distance in front of the lens at which rays begin, relative to the total track.
const LEAD: f64 = 0.15;

/// Traces `count` meridional rays of each field at the primary wavelength.
pub fn ray_layout(model: &RayModel, count: usize) -> RayLayout {
    let mut layout = RayLayout {
        ray_heights: vec![0.0; model.channels[model.primary].tracer.surfaces()],
        ..RayLayout::default()
    };
    for (field, point) in model.fields.iter().enumerate() {
        match model.launch(*point, model.primary) {
            Ok(launch) => {
                let heights: Vec<[f64; 2]> = pupil_coordinates(count).map(|y| [0.0, y]).collect();
                for (pupil, ray) in pupil_coordinates(count).zip(launch.rays_through_stop(&heights))
                {
                    if let Some(ray) = ray {
                        let mut path = launch.channel().tracer.polyline(ray);
                        layout.count(&path);
                        extend_backwards(model, &mut path.points, ray.direction);
                        let wavelength = model.primary;
                        layout.rays.push(LayoutRay { field, wavelength, pupil, path });
                    }
                }
            }
            Err(why) => layout.errors.push((field, why.to_string())),
        }
    }
    layout
}

/// Evenly spaced pupil heights from −1 to 1.
fn pupil_coordinates(count: usize) -> impl Iterator<Item = f64> {
    let place = move |i: usize| {
        if count < 2 { 0.0 } else { 2.0 * i as f64 / (count - 1) as f64 - 1.0 }
    };
    (0..count).map(place)
}

impl RayLayout {
    /// Counts the fate of a ray and its heights at the surfaces.
    fn count(&mut self, path: &RayPolyline) {
        self.fates.count(path.fate);
        let met = path.fate.surface().unwrap_or(self.ray_heights.len());
        for (reached, height) in self.ray_heights.iter_mut().zip(&path.heights).take(met) {
            *reached = reached.max(*height);
        }
    }
}

/// The z at which rays begin: in front of all surfaces, also of mirrors before the first vertex.
fn drawing_start(model: &RayModel) -> f64 {
    let frames = model.channels[model.primary].system.frames();
    let positions = || frames.iter().map(|frame| frame.shift.z);
    let first = positions().fold(0.0, f64::min);
    let last = positions().fold(0.0, f64::max);
    first - LEAD * (last - first)
}

/// Moves the start of a ray to the object or to a plane in front of the lens, whichever is nearer.
fn extend_backwards(model: &RayModel, points: &mut [Vec3<f64>], along: Vec3<f64>) {
    let [start, ..] = points else { return };
    let front = drawing_start(model);
    let from = match model.beam.object {
        Object::Finite(distance) if distance > 0.0 => -distance,
        _ => f64::NEG_INFINITY,
    };
    let s = (from.max(front) - start.z) / along.z;
    let moved = *start + along * s;
    if along.z > 0.0 && moved.is_finite() {
        *start = moved;
    }
}
