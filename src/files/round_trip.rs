//! Rays that show whether two lenses are the same: a fixed set through the paraxial entrance
//! pupil, for every field point and zoom position.

use super::FileError;
use crate::lens::{FieldKind, FieldPoint, Lens, LensError, Object};
use crate::math::Vec3;
use crate::paraxial::{Beam, FirstOrder, first_order};
use crate::trace::{Fate, Ray, Tracer};
use serde::Serialize;
use std::fmt;

/// How many rays each field point and zoom position gets.
const RAYS: usize = 200;

/// How far apart two ends of the same ray may be, in mm.
const TOLERANCE: f64 = 1e-9;

/// That a written file traces like the lens it was written from.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct RoundTripCheck {
    /// How many rays were traced through both.
    pub rays: usize,
    /// How many of them reached the image.
    pub imaged: usize,
    /// How far apart the ends of a ray were at most, in mm.
    pub worst_mm: f64,
}

impl fmt::Display for RoundTripCheck {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { rays, imaged, worst_mm } = self;
        write!(f, "read back and traced: {rays} rays, {imaged} imaged, at most {worst_mm} mm apart")
    }
}

/// Traces the same rays through a lens and through what was read back of it; `file` is for the
/// error.
pub(super) fn check_round_trip(
    lens: &Lens,
    back: &Lens,
    file: &str,
) -> Result<RoundTripCheck, FileError> {
    let unusable = |source| FileError::Lens { file: file.to_owned(), source };
    let mut proof = RoundTripCheck::default();
    // A single configuration is no zoom lens there.
    let positions = lens.zoom_positions();
    if back.zoom_positions() != positions {
        let what = format!("{} zoom positions in place of {positions}", back.zoom_positions());
        return Err(FileError::RoundTripFailed { file: file.to_owned(), what });
    }
    for zoom in 0..positions {
        let written = tracers(lens, zoom).map_err(unusable)?;
        let read = tracers(back, zoom).map_err(unusable)?;
        let launch = ProbeLaunch::new(lens, zoom).map_err(unusable)?;
        for (number, field) in lens.fields_at(zoom).values.iter().enumerate() {
            for (i, ray) in launch.rays(*field).enumerate() {
                let wave = i % written.len();
                compare(&written[wave], &read[wave], ray, &mut proof).map_err(|what| {
                    let what = format!("zoom {zoom}, field {number}, ray {i}: {what}");
                    FileError::RoundTripFailed { file: file.to_owned(), what }
                })?;
            }
        }
    }
    Ok(proof)
}

/// One for each wavelength.
fn tracers(lens: &Lens, zoom: usize) -> Result<Vec<Tracer<f64>>, LensError> {
    let at = |um| Ok(Tracer::new(&lens.resolve(zoom, um)?)?);
    lens.wavelengths.iter().map(|wave| at(wave.um)).collect()
}

fn compare(
    written: &Tracer<f64>,
    read: &Tracer<f64>,
    ray: Ray<f64>,
    proof: &mut RoundTripCheck,
) -> Result<(), String> {
    let (a, b) = (written.trace(ray), read.trace(ray));
    proof.rays += 1;
    if a.fate != b.fate {
        return Err(format!("{:?} in place of {:?}", b.fate, a.fate));
    }
    if a.fate != Fate::Imaged {
        return Ok(());
    }
    proof.imaged += 1;
    let apart = a.ray.point - b.ray.point;
    let apart = apart.dot(apart).sqrt().max((a.opl - b.opl).abs());
    proof.worst_mm = proof.worst_mm.max(apart);
    if apart <= TOLERANCE { Ok(()) } else { Err(format!("ends {apart} mm apart")) }
}

/// Where the rays of a field point start.
struct ProbeLaunch {
    object: Object,
    kind: FieldKind,
    data: Option<FirstOrder<f64>>,
    /// Where the pupil is, from the first vertex, and half its diameter.
    pupil: (f64, f64),
}

impl ProbeLaunch {
    fn new(lens: &Lens, zoom: usize) -> Result<Self, LensError> {
        let system = lens.resolve(zoom, lens.wavelengths[lens.primary()].um)?;
        let data = first_order(&system, &Beam::for_lens(lens, zoom)).ok();
        let pupil = data.as_ref().and_then(|data| {
            let pupil = data.entrance_pupil;
            Some((pupil.position?, 0.5 * pupil.diameter?.abs()))
        });
        // Without a pupil, whatever the first surface lets in.
        let first = system.surfaces[0].semi_diameter;
        let open = (0.0, if first.is_finite() { first } else { 1.0 });
        let kind = lens.fields_at(zoom).kind;
        Ok(Self { object: lens.object, kind, data, pupil: pupil.unwrap_or(open) })
    }

    /// The rays of one field point, spread evenly over the pupil.
    fn rays(&self, field: FieldPoint) -> impl Iterator<Item = Ray<f64>> {
        let origin = self.origin(field);
        sunflower().map(move |(x, y)| {
            let (z, radius) = self.pupil;
            let target = Vec3::new(x * radius, y * radius, z);
            match origin {
                ProbeOrigin::Far(direction) => {
                    Ray { point: launch_point(target, direction), direction }
                }
                ProbeOrigin::Near(point) => {
                    let way = target - point;
                    let sense = if way.z < 0.0 { -1.0 } else { 1.0 };
                    let direction = way * (sense / way.dot(way).sqrt());
                    Ray { point, direction }
                }
            }
        })
    }

    fn origin(&self, field: FieldPoint) -> ProbeOrigin {
        let focal = self.data.as_ref().and_then(|data| data.efl).unwrap_or(1.0);
        let scale = self.data.as_ref().and_then(|data| data.magnification).unwrap_or(1.0);
        let degrees = std::f64::consts::PI / 180.0;
        let (to_angle, to_height) = match self.kind {
            FieldKind::Angle => (degrees, None),
            FieldKind::ObjectHeight => (0.0, Some(1.0)),
            FieldKind::ImageHeight => (1.0 / focal, Some(1.0 / scale)),
        };
        match (self.object, to_height) {
            (Object::Infinity, _) => ProbeOrigin::Far(direction(field, to_angle)),
            (Object::Finite(distance), Some(to_height)) => {
                ProbeOrigin::Near(Vec3::new(field.x * to_height, field.y * to_height, -distance))
            }
            (Object::Finite(distance), None) => {
                let (z, _) = self.pupil;
                let height = |angle: f64| -(angle * degrees).tan() * (distance + z);
                ProbeOrigin::Near(Vec3::new(height(field.x), height(field.y), -distance))
            }
        }
    }
}

/// Where light comes from: a direction in which it goes, or a point.
#[derive(Clone, Copy)]
enum ProbeOrigin {
    Far(Vec3<f64>),
    Near(Vec3<f64>),
}

fn direction(field: FieldPoint, to_angle: f64) -> Vec3<f64> {
    let angle = field.x.hypot(field.y) * to_angle;
    let share = if angle == 0.0 { 0.0 } else { angle.sin() / field.x.hypot(field.y) };
    Vec3::new(field.x * share, field.y * share, angle.cos())
}

/// A point on the ray in front of the lens, where it goes forwards at all.
fn launch_point(target: Vec3<f64>, direction: Vec3<f64>) -> Vec3<f64> {
    if direction.z < 0.01 { target } else { target - direction * (target.z / direction.z) }
}

/// Points spread evenly over the unit disc: a sunflower.
fn sunflower() -> impl Iterator<Item = (f64, f64)> {
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    (0..RAYS).map(move |i| {
        let radius = ((i as f64 + 0.5) / RAYS as f64).sqrt();
        let (sin, cos) = (golden * i as f64).sin_cos();
        (radius * cos, radius * sin)
    })
}

/// What a person compares with the original program at one glance, at one zoom position.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SelfCheck {
    /// The zoom position.
    pub zoom: usize,
    /// The focal length, in mm.
    pub efl: Option<f64>,
    /// The back focal length, in mm.
    pub bfl: Option<f64>,
    /// Focal length over entrance pupil diameter.
    pub f_number: Option<f64>,
    /// The paraxial height of the image of the field's edge, in mm.
    pub image_height: Option<f64>,
    /// From the first vertex to the image, in mm.
    pub total_track: f64,
    /// Root mean square spot radii at 0, 0.7 and the whole field at the primary wavelength, in
    /// micrometres, as good as 200 rays can tell; `None` where no ray arrives.
    pub rms_spot_um: [Option<f64>; 3],
}

/// The numbers of a lens at every zoom position.
pub(super) fn self_checks(lens: &Lens) -> Result<Vec<SelfCheck>, LensError> {
    (0..lens.zoom_positions()).map(|zoom| self_check(lens, zoom)).collect()
}

fn self_check(lens: &Lens, zoom: usize) -> Result<SelfCheck, LensError> {
    let system = lens.resolve(zoom, lens.wavelengths[lens.primary()].um)?;
    let launch = ProbeLaunch::new(lens, zoom)?;
    let tracer = Tracer::new(&system)?;
    let edge = Beam::for_lens(lens, zoom).edge;
    let spot = |share: f64| {
        let field = FieldPoint { x: 0.0, y: share * edge, weight: 1.0 };
        rms_radius_um(launch.rays(field).filter_map(|ray| {
            let landing = tracer.trace(ray);
            landing.fate.is_imaged().then_some((landing.ray.point.x, landing.ray.point.y))
        }))
    };
    let data = launch.data.as_ref();
    let chief = data.and_then(|data| data.chief.as_ref());
    Ok(SelfCheck {
        zoom,
        efl: data.and_then(|data| data.efl),
        bfl: data.and_then(|data| data.bfl),
        f_number: data.and_then(|data| data.f_number),
        image_height: chief.and_then(|ray| ray.heights.last().copied()),
        total_track: system.image_position(),
        rms_spot_um: [0.0, 0.7, 1.0].map(spot),
    })
}

/// About the centre of the points, in micrometres for millimetres.
fn rms_radius_um(points: impl Iterator<Item = (f64, f64)>) -> Option<f64> {
    let points: Vec<(f64, f64)> = points.collect();
    let count = points.len() as f64;
    if points.is_empty() {
        return None;
    }
    let (x, y) = points.iter().fold((0.0, 0.0), |(a, b), (x, y)| (a + x / count, b + y / count));
    let square = |(u, v): &(f64, f64)| (u - x).powi(2) + (v - y).powi(2);
    Some(1e3 * (points.iter().map(square).sum::<f64>() / count).sqrt())
}

impl fmt::Display for SelfCheck {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let value = |v: Option<f64>| v.map_or("none".to_owned(), |v| format!("{v:.6}"));
        write!(
            f,
            "zoom {}: efl {} mm, bfl {} mm, f/{}, image height {} mm, track {:.6} mm",
            self.zoom,
            value(self.efl),
            value(self.bfl),
            value(self.f_number),
            value(self.image_height),
            self.total_track
        )?;
        let spots = self.rms_spot_um.map(value);
        write!(f, ", rms spot at 0, 0.7, 1 field {} um", spots.join(", "))
    }
}
