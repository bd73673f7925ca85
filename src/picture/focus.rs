//! Focusing by moving the image plane, or a group of surfaces with the image plane at rest.

use super::PictureError;
use super::frame::tangent;
use crate::lens::{Lens, Object, Quantity};
use crate::pupil::{RayModel, RayModelError, limited_by_stop};

/// The same lens focused at a distance in front of its first vertex in mm by moving the image plane: as
/// far behind the paraxial image as before. The stop stays as large as it was.
///
/// # Errors
/// A lens that cannot be traced, or no image of an object at the distance.
pub fn focused(lens: &Lens, zoom: usize, distance: f64) -> Result<Lens, PictureError> {
    let before = RayModel::from_lens(lens, zoom)?.first_order;
    let defocus = lens.image_solve.or(before.image_defocus).ok_or(PictureError::Afocal)?;
    let mut moved = limited_by_stop(lens)?;
    moved.object = Object::Finite(distance);
    moved.image_solve = Some(defocus);
    let model = RayModel::from_lens(&moved, zoom).map_err(|error| match error {
        RayModelError::Undefined(_) => PictureError::Afocal,
        other => other.into(),
    })?;
    let image = model.first_order.paraxial_image.ok_or(PictureError::Afocal)?;
    let system = &model.channels[model.primary].system;
    let along = image * system.light_direction(system.surfaces.len().saturating_sub(2));
    if along > 0.0 { Ok(moved) } else { Err(PictureError::NotImaged { distance }) }
}

/// Behind a thin lens that is focused at a distance, the distance of its sharp image, and the diameter of the disc
/// there that an object point at another distance makes; all in mm, with objects beyond the focal length.
pub fn thin_lens_blur(focal: f64, f_number: f64, focus: f64, object: f64) -> [f64; 2] {
    let image = |distance: f64| focal * distance / (distance - focal);
    let [sharp, own] = [focus, object].map(image);
    [sharp, focal / f_number * (own - sharp).abs() / own]
}

/// The surfaces of a focus group, from the first to the last, by their indices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FocusGroup {
    /// The index of the first surface.
    pub first: usize,
    /// The index of the last surface.
    pub last: usize,
}

/// A lens focused by a group of surfaces that moves along the axis, with the image plane at rest.
#[derive(Debug, Clone, PartialEq)]
pub struct GroupFocus {
    /// The focused lens.
    pub lens: Lens,
    /// The way of the group towards the image in mm.
    pub shift: f64,
    /// The distance of the object from the first surface where that is now, in mm.
    pub distance: f64,
    /// The change of the field of view by focusing, the breathing of the lens: the size that an image has as
    /// seen from the entrance pupil, over that before, less 1; positive if the picture shows more of the scene.
    pub breathing: f64,
}

/// The steps in which the way of a group is searched on either side, and the halvings of the last.
const STEPS: u32 = 64;
const HALVINGS: u32 = 60;

impl FocusGroup {
    /// The lens focused at a distance in front of its first surface in mm, where the group stands as written, by
    /// moving the group: as far behind the paraxial image as before. The nearest of several ways is taken.
    ///
    /// # Errors
    /// Surfaces that are no group with a gap on the side of the image, a lens that cannot be traced, or no way
    /// within the gaps that focuses.
    pub fn focus(
        self,
        lens: &Lens,
        zoom: usize,
        distance: f64,
    ) -> Result<GroupFocus, PictureError> {
        let Self { first, last } = self;
        if first > last || last >= lens.surfaces.len() {
            return Err(PictureError::Size {
                what: "the last surface of the focus group",
                found: last as f64 + 1.0,
                expected: "a surface of the lens, not before the first one of the group",
            });
        }
        let before = RayModel::from_lens(lens, zoom)?;
        let defocus = before.first_order.image_defocus.ok_or(PictureError::Afocal)?;
        let mut still = limited_by_stop(lens)?;
        // The image plane stays where the solve has put it.
        let surfaces = &before.channels[before.primary].system.surfaces;
        let end = lens.surfaces.len() - 1;
        set_gap(&mut still, zoom, end, surfaces[end].thickness);
        still.image_solve = None;
        let gap = |surface: usize| surfaces[surface].thickness;
        // Mirrors turn the light round: gaps are negative behind an odd number of them.
        let behind = if first > 0 { gap(first - 1) } else { distance };
        let ends = [-behind.abs(), gap(last).abs()].map(|end| end * gap(last).signum());
        let moved = |shift: f64| self.moved(&still, zoom, (distance, shift));
        let off = |shift: f64| {
            let model = RayModel::from_lens(&moved(shift), zoom).ok()?;
            Some(model.first_order.image_defocus? - defocus).filter(|off| off.is_finite())
        };
        let shift = nearest_root(&off, ends).ok_or(PictureError::NotFocused { distance })?;
        let lens = moved(shift);
        let model = RayModel::from_lens(&lens, zoom)?;
        let Object::Finite(distance) = lens.object else { return Err(PictureError::Afocal) };
        let seen = |model: &RayModel| tangent(model, 1.0);
        let breathing = seen(&model)? / seen(&before)? - 1.0;
        Ok(GroupFocus { lens, shift, distance, breathing })
    }

    /// The lens with the group moved towards the image.
    fn moved(self, lens: &Lens, zoom: usize, (distance, shift): (f64, f64)) -> Lens {
        let mut moved = lens.clone();
        let gap = |surface: usize| {
            let parameter = lens.parameter_at(zoom, surface, Quantity::Thickness);
            lens.get(parameter).unwrap_or(0.0)
        };
        set_gap(&mut moved, zoom, self.last, gap(self.last) - shift);
        let front = if self.first > 0 {
            set_gap(&mut moved, zoom, self.first - 1, gap(self.first - 1) + shift);
            0.0
        } else {
            shift
        };
        moved.object = Object::Finite(distance + front);
        moved
    }
}

fn set_gap(lens: &mut Lens, zoom: usize, surface: usize, thickness: f64) {
    let parameter = lens.parameter_at(zoom, surface, Quantity::Thickness);
    lens.set(parameter, thickness);
}

/// The root of a function nearest to 0 between two ends, one on each side; `None` without one.
fn nearest_root(function: &impl Fn(f64) -> Option<f64>, ends: [f64; 2]) -> Option<f64> {
    let start = function(0.0)?;
    let mut last = [(0.0, start); 2];
    for step in 1..=STEPS {
        // Fine steps near 0, where the way of a group is.
        let part = (f64::from(step) / f64::from(STEPS)).powi(3);
        for (end, last) in ends.iter().zip(&mut last) {
            let at = part * end;
            let Some(value) = function(at) else { continue };
            let from = std::mem::replace(last, (at, value));
            if from.1 * value <= 0.0 {
                return halved(function, from, (at, value));
            }
        }
    }
    None
}

/// The root between two places with values of different signs; `None` at a pole.
fn halved(
    function: &impl Fn(f64) -> Option<f64>,
    mut low: (f64, f64),
    mut high: (f64, f64),
) -> Option<f64> {
    let largest = low.1.abs().max(high.1.abs());
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low.0 + high.0);
        let value = function(middle)?;
        if low.1 * value <= 0.0 {
            high = (middle, value);
        } else {
            low = (middle, value);
        }
    }
    Some(0.5 * (low.0 + high.0)).filter(|_| high.1.abs() <= largest)
}
