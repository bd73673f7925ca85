//! The numbers of an imported lens that show at a glance that it was read correctly.

use super::probe_rays::{ProbeLaunch, RAYS};
use crate::lens::{FieldPoint, Lens, LensError};
use crate::paraxial::Beam;
use crate::trace::Tracer;
use serde::Serialize;
use std::fmt;

/// Numbers of a lens at one zoom position, to compare with the program that wrote the file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SelfCheck {
    /// The zoom position.
    pub zoom: usize,
    /// The focal length, in mm.
    pub efl: Option<f64>,
    /// The back focal length, in mm.
    pub bfl: Option<f64>,
    /// The focal length over the diameter of the entrance pupil.
    pub f_number: Option<f64>,
    /// The paraxial image height of the edge of the field, in mm.
    pub image_height: Option<f64>,
    /// The distance from the first vertex to the image plane, in mm.
    pub total_track: f64,
    /// RMS spot radii at 0, 0.7 and 1 times the edge of the field at the primary wavelength, from
    /// rays through the paraxial entrance pupil, in micrometres; `None` where no ray arrives.
    pub rms_spot_um: [Option<f64>; 3],
    /// The error of each, in micrometres: its change when the rays became four times as many.
    pub rms_spot_error_um: [Option<f64>; 3],
}

/// The fields of the spots, in parts of the edge of the field.
const FIELDS: [f64; 3] = [0.0, 0.7, 1.0];

/// The numbers of a lens at every zoom position.
pub(super) fn self_checks(lens: &Lens) -> Result<Vec<SelfCheck>, LensError> {
    (0..lens.zoom_positions()).map(|zoom| self_check(lens, zoom)).collect()
}

fn self_check(lens: &Lens, zoom: usize) -> Result<SelfCheck, LensError> {
    let system = lens.resolve(zoom, lens.wavelengths[lens.primary()].um)?;
    let launch = ProbeLaunch::new(lens, zoom)?;
    let tracer = Tracer::new(&system)?;
    let edge = Beam::for_lens(lens, zoom).edge;
    let spot = |share: f64, count: usize| {
        let field = FieldPoint { x: 0.0, y: share * edge, weight: 1.0 };
        rms_radius_um(launch.many_rays(field, count).filter_map(|ray| {
            let landing = tracer.trace(ray);
            landing.fate.is_imaged().then_some((landing.ray.point.x, landing.ray.point.y))
        }))
    };
    let [coarse, fine] = [RAYS, 4 * RAYS].map(|count| FIELDS.map(|share| spot(share, count)));
    let change = |i: usize| Some((fine[i]? - coarse[i]?).abs());
    let data = launch.data.as_ref();
    let chief = data.and_then(|data| data.chief.as_ref());
    Ok(SelfCheck {
        zoom,
        efl: data.and_then(|data| data.efl),
        bfl: data.and_then(|data| data.bfl),
        f_number: data.and_then(|data| data.f_number),
        image_height: chief.and_then(|ray| ray.heights.last().copied()),
        total_track: system.image_position(),
        rms_spot_um: fine,
        rms_spot_error_um: [0, 1, 2].map(change),
    })
}

/// The RMS distance of points from their centroid: in micrometres for points in mm, `None` for none.
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
        let errors =
            self.rms_spot_error_um.map(|e| e.map_or(String::new(), |e| format!(" ± {e:.1e}")));
        let spots: Vec<String> =
            self.rms_spot_um.into_iter().zip(errors).map(|(v, error)| value(v) + &error).collect();
        write!(f, ", rms spot at 0, 0.7, 1 field {} um", spots.join(", "))
    }
}
