//! The rays of the layout, in mm: what a drawing needs and nothing about how it looks.

use crate::math::Vec3;
use crate::pupil::Bench;
use crate::trace::{Fates, Path};

/// The rays that a layout shows.
#[derive(Debug, Clone, Default)]
pub struct Layout {
    /// The rays, field by field, from the lower rim of the pupil to the upper.
    pub rays: Vec<DrawnRay>,
    /// How far from the axis these rays meet each surface, the image plane last.
    pub reached: Vec<f64>,
    /// How the rays ended.
    pub fates: Fates,
    /// Fields without rays, and why.
    pub dark: Vec<(usize, String)>,
}

/// One ray of a layout.
#[derive(Debug, Clone)]
pub struct DrawnRay {
    /// Its field.
    pub field: usize,
    /// Its wavelength.
    pub wavelength: usize,
    /// Where in the pupil it starts, −1 to 1.
    pub pupil: f64,
    /// Its corners in the frame of the first vertex, from in front of the lens to its end, and how
    /// it ended.
    pub path: Path,
}

/// How far in front of the lens rays begin, as a share of its length with the way to the image.
const LEAD: f64 = 0.15;

/// A fan of rays of each field in the meridional plane, at the primary wavelength.
pub fn layout(bench: &Bench, count: usize) -> Layout {
    let mut layout = Layout {
        reached: vec![0.0; bench.colors[bench.primary].tracer.surfaces()],
        ..Layout::default()
    };
    for (field, point) in bench.fields.iter().enumerate() {
        match bench.launch(*point, bench.primary) {
            Ok(launch) => {
                for pupil in across(count) {
                    if let Some(ray) = launch.ray([0.0, pupil]) {
                        let mut path = launch.color().tracer.path(ray);
                        layout.count(&path);
                        lead_in(bench, &mut path.points, ray.direction);
                        let wavelength = bench.primary;
                        layout.rays.push(DrawnRay { field, wavelength, pupil, path });
                    }
                }
            }
            Err(why) => layout.dark.push((field, why.to_string())),
        }
    }
    layout
}

/// Evenly spaced places from one rim of the pupil to the other.
fn across(count: usize) -> impl Iterator<Item = f64> {
    let place = move |i: usize| {
        if count < 2 { 0.0 } else { 2.0 * i as f64 / (count - 1) as f64 - 1.0 }
    };
    (0..count).map(place)
}

impl Layout {
    /// Notes how a ray ended and how far from the axis it met each surface.
    fn count(&mut self, path: &Path) {
        self.fates.count(path.fate);
        let met = path.fate.surface().unwrap_or(self.reached.len());
        for (reached, height) in self.reached.iter_mut().zip(&path.heights).take(met) {
            *reached = reached.max(*height);
        }
    }
}

/// Where drawn rays begin: in front of everything, mirrors that stand before the first vertex too.
fn front(bench: &Bench) -> f64 {
    let surfaces = &bench.colors[bench.primary].system.surfaces;
    let (mut z, mut first, mut last) = (0.0_f64, 0.0_f64, 0.0_f64);
    for surface in surfaces {
        (first, last) = (first.min(z), last.max(z));
        z += surface.thickness;
    }
    first - LEAD * (last - first)
}

/// Moves the start of a ray to where drawing begins: the object, or a plane in front of the lens.
fn lead_in(bench: &Bench, points: &mut [Vec3<f64>], along: Vec3<f64>) {
    let [start, ..] = points else { return };
    let front = front(bench);
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
