//! The places of the handles of a lens in its section, and the value of a handle that a motion in
//! the section means.

use super::Handle;
use super::handle::scaled_aperture;
use crate::lens::{FieldKind, Lens, LensSection};
use crate::paraxial::FirstOrder;

/// The height of the handle of a curvature, relative to that of its surface.
const CURVATURE_HEIGHT: f64 = 0.6;
/// The height of the handle of an element below the axis, relative to its lower surface.
const ELEMENT_HEIGHT: f64 = 0.45;
/// The height of the handle of the stop's position below the axis, relative to that of the stop.
const STOP_HEIGHT: f64 = 1.12;
/// The distance of the handle of the beam in front of the lens, relative to the length of the lens.
const BEAM_DISTANCE: f64 = 0.06;
/// The largest part of the radius of a surface to which its handle is bent.
const MAX_BEND: f64 = 0.999;

/// The places of the handles of a lens at one zoom position. Points are `[z, y]` in mm from the
/// first vertex.
#[derive(Debug, Clone, Copy)]
pub struct HandlePlaces<'a> {
    /// The lens.
    pub lens: &'a Lens,
    /// The zoom position.
    pub zoom: usize,
    /// Its section as it is drawn.
    pub section: &'a LensSection<'a>,
    /// Its first-order data.
    pub first_order: &'a FirstOrder<f64>,
}

impl HandlePlaces<'_> {
    /// The place of a handle; `None` for one that is not in the section, and where the axis is broken,
    /// since handles move along a straight one.
    pub fn place(&self, handle: Handle) -> Option<[f64; 2]> {
        let section = self.section;
        if section.system().has_broken_axis() {
            return None;
        }
        let (vertices, heights) = (section.vertices(), section.heights());
        let image = section.image();
        let place = match handle {
            Handle::Vertex(surface) => [*vertices.get(surface)?, 0.0],
            Handle::Curvature(surface) => {
                section.point(surface, CURVATURE_HEIGHT * heights.get(surface)?)
            }
            Handle::Rim(surface) => section.point(surface, *heights.get(surface)?),
            Handle::Element { front, back } | Handle::Bending { front, back } => {
                let height = heights.get(front)?.min(*heights.get(back)?);
                let y = -ELEMENT_HEIGHT * height;
                [0.5 * (section.point(front, y)[0] + section.point(back, y)[0]), y]
            }
            Handle::StopPosition => {
                let stop = self.lens.stop()?;
                [*vertices.get(stop)?, -STOP_HEIGHT * heights.get(stop)?]
            }
            Handle::StopSize => {
                let stop = self.lens.stop()?;
                [
                    section.point(stop, self.first_order.stop_semi_diameter)[0],
                    self.first_order.stop_semi_diameter,
                ]
            }
            Handle::ImagePlane => [section.image_position(), 0.0],
            Handle::FieldHeight => {
                let chief = self.first_order.chief.as_ref()?;
                [section.image_position(), *chief.heights.get(image)?]
            }
            Handle::BeamWidth => {
                let ray = &self.first_order.marginal;
                let z = -BEAM_DISTANCE * self.lens.total_track();
                [z, ray.heights.first()? + z * ray.start_slope]
            }
        };
        place.iter().all(|number| number.is_finite()).then_some(place)
    }

    /// The value of a handle after its place has moved by `[dz, dy]` mm.
    pub fn value_after(&self, handle: Handle, start: f64, [dz, dy]: [f64; 2]) -> Option<f64> {
        let [_, y] = self.place(handle)?;
        Some(match handle {
            Handle::Curvature(i) | Handle::Bending { front: i, .. } => {
                let row = self.lens.row_at(i, Some(self.zoom))?;
                start + bent(row.curvature, row.conic, y, dz) - row.curvature
            }
            Handle::Vertex(_) | Handle::Element { .. } => self.moved_along(handle, start, dz),
            Handle::StopPosition if handle.span(self.lens).is_some() => {
                self.moved_along(handle, start, dz)
            }
            Handle::StopPosition => self.nearest_surface(dz)?,
            Handle::ImagePlane => start + dz,
            Handle::Rim(_) => start + dy,
            Handle::StopSize => (y + dy).abs(),
            Handle::FieldHeight => {
                let factor = (1.0 + dy / y).max(0.0);
                match self.lens.fields_at(self.zoom).kind {
                    FieldKind::Angle => (start.to_radians().tan() * factor).atan().to_degrees(),
                    FieldKind::ObjectHeight | FieldKind::ImageHeight => start * factor,
                }
            }
            Handle::BeamWidth => {
                let factor = ((y + dy) / y).max(1e-3);
                scaled_aperture(self.lens.aperture_at(self.zoom), factor)
            }
        })
        .filter(|value: &f64| value.is_finite())
    }

    /// The gap in front of what moves; of the first surface the gap behind.
    fn moved_along(&self, handle: Handle, start: f64, dz: f64) -> f64 {
        let is_first = handle.span(self.lens).is_some_and(|(front, _)| front == 0);
        if is_first { start - dz } else { start + dz }
    }

    /// The surface whose vertex is nearest to the place of the stop after a motion along the axis.
    fn nearest_surface(&self, dz: f64) -> Option<f64> {
        let z = self.place(Handle::StopPosition)?[0] + dz;
        let vertices = &self.section.vertices()[..self.section.image()];
        let distance = |i: &usize| (vertices[*i] - z).abs();
        (0..vertices.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).map(|i| i as f64)
    }
}

/// The curvature of a conic whose sag at a height is larger by `dz`: `c = 2 s / (h² + (1 + k) s²)`.
fn bent(curvature: f64, conic: f64, height: f64, dz: f64) -> f64 {
    let h2 = height * height;
    let root = (1.0 - (1.0 + conic) * curvature * curvature * h2).max(0.0).sqrt();
    let sag = curvature * h2 / (1.0 + root) + dz;
    let most =
        if conic > -1.0 { MAX_BEND * height.abs() / (1.0 + conic).sqrt() } else { f64::INFINITY };
    let sag = sag.clamp(-most, most);
    2.0 * sag / (1.0 + conic).mul_add(sag * sag, h2)
}
