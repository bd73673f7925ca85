//! The rays of the layout, in mm: what a drawing needs and nothing about how it looks.

use crate::math::Vec3;
use crate::pupil::RayModel;
use crate::trace::{Fates, RayPolyline};

/// The rays that a layout shows.
#[derive(Debug, Clone, Default)]
pub struct RayLayout {
    /// The rays, field by field, from the lower rim of the pupil to the upper.
    pub rays: Vec<LayoutRay>,
    /// How far from the axis these rays meet each surface, the image plane last.
    pub ray_heights: Vec<f64>,
    /// How the rays ended.
    pub fates: Fates,
    /// Fields without rays, and why.
    pub errors: Vec<(usize, String)>,
}

/// One ray of a layout.
#[derive(Debug, Clone)]
pub struct LayoutRay {
    /// Its field.
    pub field: usize,
    /// Its wavelength.
    pub wavelength: usize,
    /// Where in the pupil it starts, −1 to 1.
    pub pupil: f64,
    /// Its corners in the frame of the first vertex, from in front of the lens to its end, and how
    /// it ended.
    pub path: RayPolyline,
}

/// How far in front of the lens rays begin, as a share of its length with the way to the image.
const LEAD: f64 = 0.15;

/// A fan of rays of each field in the meridional plane, at the primary wavelength.
pub fn ray_layout(bench: &RayModel, count: usize) -> RayLayout {
    let mut layout = RayLayout {
        ray_heights: vec![0.0; bench.channels[bench.primary].tracer.surfaces()],
        ..RayLayout::default()
    };
    for (field, point) in bench.fields.iter().enumerate() {
        match bench.launch(*point, bench.primary) {
            Ok(launch) => {
                for pupil in pupil_coordinates(count) {
                    if let Some(ray) = launch.ray([0.0, pupil]) {
                        let mut path = launch.channel().tracer.path(ray);
                        layout.count(&path);
                        extend_backwards(bench, &mut path.points, ray.direction);
                        let wavelength = bench.primary;
                        layout.rays.push(LayoutRay { field, wavelength, pupil, path });
                    }
                }
            }
            Err(why) => layout.errors.push((field, why.to_string())),
        }
    }
    layout
}

/// Evenly spaced places from one rim of the pupil to the other.
fn pupil_coordinates(count: usize) -> impl Iterator<Item = f64> {
    let place = move |i: usize| {
        if count < 2 { 0.0 } else { 2.0 * i as f64 / (count - 1) as f64 - 1.0 }
    };
    (0..count).map(place)
}

impl RayLayout {
    /// Notes how a ray ended and how far from the axis it met each surface.
    fn count(&mut self, path: &RayPolyline) {
        self.fates.count(path.fate);
        let met = path.fate.surface().unwrap_or(self.ray_heights.len());
        for (reached, height) in self.ray_heights.iter_mut().zip(&path.heights).take(met) {
            *reached = reached.max(*height);
        }
    }
}

/// Where drawn rays begin: in front of everything, mirrors that stand before the first vertex too.
fn drawing_start(bench: &RayModel) -> f64 {
    let positions = bench.channels[bench.primary].system.vertex_positions();
    let first = positions.iter().copied().fold(0.0, f64::min);
    let last = positions.iter().copied().fold(0.0, f64::max);
    first - LEAD * (last - first)
}

/// Moves the start of a ray to where drawing begins: the object, or a plane in front of the lens.
fn extend_backwards(bench: &RayModel, points: &mut [Vec3<f64>], along: Vec3<f64>) {
    let [start, ..] = points else { return };
    let front = drawing_start(bench);
    let from = match bench.beam.object {
        crate::lens::Object::Finite(distance) if distance > 0.0 => -distance,
        _ => f64::NEG_INFINITY,
    };
    let s = (from.max(front) - start.z) / along.z;
    let moved = *start + along * s;
    if along.z > 0.0 && moved.is_finite() {
        *start = moved;
    }
}
