//! The handles by which a lens is changed in its drawing, and the numbers that each of them moves.

use super::{DragError, DragLimit};
use crate::lens::{Aperture, FieldKind, Fields, Lens, Medium, Parameter, Quantity, at_zoom};
use crate::paraxial::{Beam, first_order};
use serde::{Deserialize, Serialize};
use std::fmt;

/// A handle in the drawing of a lens. Surfaces are indices from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Handle {
    /// The vertex of a surface: it moves between its neighbours, which stay. Its value is the gap in
    /// front, of the first surface the gap behind, in mm.
    Vertex(usize),
    /// The curvature of a surface, in 1/mm.
    Curvature(usize),
    /// The semi-diameter of a surface, in mm.
    Rim(usize),
    /// A single or cemented element, which moves between its neighbours. Its value is the gap in
    /// front, of the first element the gap behind, in mm.
    Element {
        /// Its first surface.
        front: usize,
        /// Its last surface.
        back: usize,
    },
    /// The bending of an element: the same change of all its curvatures, which keeps the power of a
    /// thin lens. Its value is the curvature of the first surface, in 1/mm.
    Bending {
        /// The first surface of the element.
        front: usize,
        /// Its last surface.
        back: usize,
    },
    /// The stop along the axis. Its value is the gap in front in mm where the stop has a surface of
    /// its own, or else the index of the surface that is the stop.
    StopPosition,
    /// The radius of the beam in the stop, in mm.
    StopSize,
    /// The image plane. Its value is the last thickness, or its distance from the paraxial image
    /// where the lens solves for that, in mm.
    ImagePlane,
    /// The edge of the field; all field points keep their share of it. Its value is in degrees or
    /// mm, as the fields are given.
    FieldHeight,
    /// The width of the beam. Its value is the number of the aperture as it is given.
    BeamWidth,
}

impl fmt::Display for Handle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Vertex(surface) => write!(f, "vertex of surface {}", surface + 1),
            Self::Curvature(surface) => write!(f, "curvature of surface {}", surface + 1),
            Self::Rim(surface) => write!(f, "rim of surface {}", surface + 1),
            Self::Element { front, back } => {
                write!(f, "element of surfaces {} to {}", front + 1, back + 1)
            }
            Self::Bending { front, back } => {
                write!(f, "bending of surfaces {} to {}", front + 1, back + 1)
            }
            Self::StopPosition => write!(f, "position of the stop"),
            Self::StopSize => write!(f, "size of the stop"),
            Self::ImagePlane => write!(f, "image plane"),
            Self::FieldHeight => write!(f, "edge of the field"),
            Self::BeamWidth => write!(f, "width of the beam"),
        }
    }
}

/// The quantity that the value of a handle is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HandleUnit {
    /// A curvature in 1/mm, which is displayed as a radius.
    Curvature,
    /// A length in mm.
    Length,
    /// An angle in degrees.
    Angle,
    /// A pure number.
    Number,
    /// The index of a surface.
    Surface,
}

impl Handle {
    /// All handles of a lens at a zoom position.
    pub fn all(lens: &Lens, zoom: usize) -> Vec<Self> {
        let mut handles = Vec::new();
        for surface in 0..lens.surfaces.len() {
            if is_own_stop(lens, surface) {
                continue;
            }
            handles.push(Self::Vertex(surface));
            if bends_light(lens, surface) {
                handles.push(Self::Curvature(surface));
            }
            handles.push(Self::Rim(surface));
        }
        for (front, back) in elements(lens) {
            handles.push(Self::Element { front, back });
            handles.push(Self::Bending { front, back });
        }
        handles.extend([
            Self::StopPosition,
            Self::StopSize,
            Self::ImagePlane,
            Self::FieldHeight,
            Self::BeamWidth,
        ]);
        handles.retain(|handle| handle.value(lens, zoom).is_some() || handle.is_rim());
        handles
    }

    fn is_rim(self) -> bool {
        matches!(self, Self::Rim(_))
    }

    /// The quantity of its value.
    pub fn unit(self, lens: &Lens, zoom: usize) -> HandleUnit {
        match self {
            Self::Curvature(_) | Self::Bending { .. } => HandleUnit::Curvature,
            Self::StopPosition if !lens.stop().is_some_and(|stop| is_own_stop(lens, stop)) => {
                HandleUnit::Surface
            }
            Self::FieldHeight if lens.fields_at(zoom).kind == FieldKind::Angle => HandleUnit::Angle,
            Self::BeamWidth => match lens.aperture_at(zoom) {
                Aperture::FNumber(_) | Aperture::ObjectNa(_) => HandleUnit::Number,
                Aperture::EntrancePupilDiameter(_) | Aperture::StopSemiDiameter(_) => {
                    HandleUnit::Length
                }
            },
            _ => HandleUnit::Length,
        }
    }

    /// Its value at a zoom position; `None` if the lens has no such handle, or no semi-diameter of
    /// its own at a rim.
    pub fn value(self, lens: &Lens, zoom: usize) -> Option<f64> {
        let rows = lens.surfaces.len();
        match self {
            Self::Curvature(surface) | Self::Bending { front: surface, .. } => {
                lens.get(lens.parameter_at(zoom, surface, Quantity::Curvature))
            }
            Self::Rim(surface) => {
                lens.get(lens.parameter_at(zoom, surface, Quantity::SemiDiameter))
            }
            Self::Vertex(_) | Self::Element { .. } => {
                let (front, back) = self.span(lens)?;
                let gap = front.checked_sub(1).unwrap_or(back);
                let is_solved = gap + 1 == rows && lens.image_solve.is_some();
                lens.thickness_at(gap, zoom).filter(|_| !is_solved)
            }
            Self::StopPosition => {
                let stop = lens.stop()?;
                if is_own_stop(lens, stop) {
                    Self::Vertex(stop).value(lens, zoom)
                } else {
                    Some(stop as f64)
                }
            }
            Self::StopSize => stop_radius(lens, zoom),
            Self::ImagePlane => match lens.image_solve {
                Some(offset) => Some(offset),
                None => lens.thickness_at(rows.checked_sub(1)?, zoom),
            },
            Self::FieldHeight => {
                let edge = Beam::for_lens(lens, zoom).edge.abs();
                (edge > 0.0).then_some(edge)
            }
            Self::BeamWidth => Some(aperture_number(lens.aperture_at(zoom))),
        }
    }

    /// The parameters that it moves, each with its change per unit of the value; empty for those
    /// that move none.
    pub fn motion(self, lens: &Lens, zoom: usize) -> Vec<(Parameter, f64)> {
        let curvature = |surface| (lens.parameter_at(zoom, surface, Quantity::Curvature), 1.0);
        match self {
            Self::Curvature(surface) => vec![curvature(surface)],
            Self::Bending { front, back } => (front..=back).map(curvature).collect(),
            Self::Rim(surface) => {
                vec![(lens.parameter_at(zoom, surface, Quantity::SemiDiameter), 1.0)]
            }
            Self::Vertex(_) | Self::Element { .. } | Self::StopPosition => {
                self.span(lens).map_or_else(Vec::new, |span| shift(lens, span, zoom))
            }
            Self::ImagePlane if lens.image_solve.is_none() => {
                gap_motion(lens, &[(lens.surfaces.len() - 1, 1.0)], zoom)
            }
            Self::StopSize | Self::BeamWidth => stop_rim(lens, zoom).into_iter().collect(),
            Self::ImagePlane | Self::FieldHeight => Vec::new(),
        }
    }

    /// The first and the last surface that move along the axis with it.
    pub(super) fn span(self, lens: &Lens) -> Option<(usize, usize)> {
        let (front, back) = match self {
            Self::Vertex(surface) => (surface, surface),
            Self::Element { front, back } => (front, back),
            Self::StopPosition => {
                let stop = lens.stop().filter(|stop| is_own_stop(lens, *stop))?;
                (stop, stop)
            }
            _ => return None,
        };
        (front <= back && back < lens.surfaces.len()).then_some((front, back))
    }

    /// The lens with another value of this handle and everything else as it was.
    ///
    /// # Errors
    /// A handle that the lens does not have, or a value without meaning for it.
    pub(super) fn with_value(
        self,
        lens: &Lens,
        zoom: usize,
        value: f64,
    ) -> Result<Lens, DragError> {
        let mut changed = lens.clone();
        let missing = || DragError::NoHandle(self);
        match self {
            Self::Rim(surface) => {
                let rim = lens.parameter_at(zoom, surface, Quantity::SemiDiameter);
                changed.set(rim, value).then_some(()).ok_or_else(missing)?;
            }
            Self::FieldHeight => {
                let old = self.value(lens, zoom).ok_or_else(missing)?;
                scale_fields(fields_mut(&mut changed, zoom), old, value);
            }
            Self::BeamWidth => set_aperture(&mut changed, zoom, value),
            Self::StopSize => {
                let old = self.value(lens, zoom).ok_or_else(missing)?;
                let wider = scaled_aperture(lens.aperture_at(zoom), value / old);
                set_aperture(&mut changed, zoom, wider);
            }
            Self::ImagePlane if lens.image_solve.is_some() => changed.image_solve = Some(value),
            Self::StopPosition if self.span(lens).is_none() => {
                move_stop(&mut changed, value).ok_or_else(missing)?;
            }
            _ => {
                let old = self.value(lens, zoom).ok_or_else(missing)?;
                for (parameter, by) in self.motion(lens, zoom) {
                    let start = lens.get(parameter).ok_or_else(missing)?;
                    // The moved number itself takes the very value, free of rounding.
                    let to =
                        if by == 1.0 && start == old { value } else { start + by * (value - old) };
                    changed.set(parameter, to);
                }
            }
        }
        Ok(changed)
    }

    /// The range of its value, and what ends it below and above.
    pub(super) fn range(self, lens: &Lens, zoom: usize) -> [(f64, DragLimit); 2] {
        let value = self.value(lens, zoom).unwrap_or(0.0);
        let least = (SMALLEST_SHARE * value, DragLimit::Positive);
        let open = (f64::INFINITY, DragLimit::Positive);
        match self {
            Self::FieldHeight if lens.fields_at(zoom).kind == FieldKind::Angle => {
                [least, (value.max(MAX_FIELD_ANGLE), DragLimit::FieldAngle)]
            }
            Self::BeamWidth if matches!(lens.aperture_at(zoom), Aperture::ObjectNa(_)) => {
                [least, (value.max(MAX_NA), DragLimit::Aperture)]
            }
            Self::FieldHeight | Self::StopSize | Self::BeamWidth => [least, open],
            Self::StopPosition if self.span(lens).is_none() => {
                let last = lens.surfaces.len().saturating_sub(1) as f64;
                [(0.0, DragLimit::LensEnd), (last, DragLimit::LensEnd)]
            }
            _ => self.motion_range(lens, zoom, value),
        }
    }

    fn motion_range(self, lens: &Lens, zoom: usize, value: f64) -> [(f64, DragLimit); 2] {
        let mut low = (f64::NEG_INFINITY, DragLimit::Positive);
        let mut high = (f64::INFINITY, DragLimit::Positive);
        for (parameter, by) in self.motion(lens, zoom) {
            let start = lens.get(parameter).unwrap_or(value);
            let [least, most] = super::limit::parameter_range(lens, parameter);
            let ends = [least, most].map(|(end, why)| (value + (end - start) / by, why));
            let [least, most] = if by < 0.0 { [ends[1], ends[0]] } else { ends };
            if least.0 > low.0 {
                low = least;
            }
            if most.0 < high.0 {
                high = most;
            }
        }
        // A value that is outside already may stay, but not move farther out.
        [(low.0.min(value), low.1), (high.0.max(value), high.1)]
    }
}

/// The smallest size of a beam or a field, relative to that before.
const SMALLEST_SHARE: f64 = 1e-3;
/// The largest field angle, in degrees, to which a field of less than that can be dragged.
const MAX_FIELD_ANGLE: f64 = 89.0;
/// The largest numerical aperture to which a smaller one can be dragged.
const MAX_NA: f64 = 0.99;

/// True for a stop with a surface of its own, which bends no light.
pub(super) fn is_own_stop(lens: &Lens, surface: usize) -> bool {
    lens.surfaces[surface].stop && !bends_light(lens, surface)
}

/// True if light changes its direction at a surface.
fn bends_light(lens: &Lens, surface: usize) -> bool {
    let before = match surface.checked_sub(1) {
        Some(before) => &lens.surfaces[before].medium,
        None => &lens.object_medium,
    };
    let behind = &lens.surfaces[surface].medium;
    *behind == Medium::Mirror || before != behind
}

/// The first and the last surface of each single or cemented element without a mirror.
pub fn elements(lens: &Lens) -> Vec<(usize, usize)> {
    let rows = &lens.surfaces;
    let is_solid = |i: usize| !matches!(rows[i].medium, Medium::Air | Medium::Mirror);
    let mut found = Vec::new();
    let mut front = 0;
    while front < rows.len() {
        let back = (front..rows.len()).find(|i| !is_solid(*i)).unwrap_or(rows.len());
        if back > front && back < rows.len() && rows[back].medium != Medium::Mirror {
            found.push((front, back));
        }
        front = back + 1;
    }
    found
}

/// The gaps in front of and behind surfaces that move together along the axis.
fn shift(lens: &Lens, (front, back): (usize, usize), zoom: usize) -> Vec<(Parameter, f64)> {
    let solved = lens.image_solve.is_some() && back + 1 == lens.surfaces.len();
    let behind = (!solved).then_some(back);
    match front.checked_sub(1) {
        Some(before) => {
            let gaps: Vec<_> = [Some((before, 1.0)), behind.map(|gap| (gap, -1.0))]
                .into_iter()
                .flatten()
                .collect();
            gap_motion(lens, &gaps, zoom)
        }
        None => behind.map_or_else(Vec::new, |gap| gap_motion(lens, &[(gap, 1.0)], zoom)),
    }
}

/// The parameters of gaps: those of one zoom position where all of the gaps have their own there,
/// or else those of all zoom positions, so that what stays in place does so at each of them.
fn gap_motion(lens: &Lens, gaps: &[(usize, f64)], zoom: usize) -> Vec<(Parameter, f64)> {
    let has_own = |zoom: usize, gap: usize| lens.is_own_at(zoom, gap, Quantity::Thickness);
    if gaps.iter().all(|(gap, _)| has_own(zoom, *gap)) {
        let own =
            |(gap, by): &(usize, f64)| (Parameter::at_zoom(*gap, Quantity::Thickness, zoom), *by);
        return gaps.iter().map(own).collect();
    }
    let all = |(gap, by): &(usize, f64)| {
        let (gap, by) = (*gap, *by);
        let zooms = (0..lens.zoom.len()).filter(move |zoom| has_own(*zoom, gap)).map(Some);
        let parameter = Parameter::new(gap, Quantity::Thickness);
        let zooms = [None].into_iter().chain(zooms);
        zooms.map(move |zoom| (Parameter { zoom, ..parameter }, by)).collect::<Vec<_>>()
    };
    gaps.iter().flat_map(all).collect()
}

/// The rim of a stop that is the aperture of the lens, with its change per unit.
fn stop_rim(lens: &Lens, zoom: usize) -> Option<(Parameter, f64)> {
    let is_stop = matches!(lens.aperture_at(zoom), Aperture::StopSemiDiameter(_));
    let stop = lens.stop().filter(|_| is_stop)?;
    Some((Parameter::new(stop, Quantity::SemiDiameter), 1.0))
}

/// The height of the paraxial marginal ray at the stop; `None` without a beam.
fn stop_radius(lens: &Lens, zoom: usize) -> Option<f64> {
    if let Aperture::StopSemiDiameter(radius) = lens.aperture_at(zoom) {
        return Some(radius);
    }
    let system = lens.resolve(zoom, lens.wavelengths[lens.primary()].um).ok()?;
    let radius = first_order(&system, &Beam::for_lens(lens, zoom)).ok()?.stop_semi_diameter;
    (radius > 0.0 && radius.is_finite()).then_some(radius)
}

const fn aperture_number(aperture: Aperture) -> f64 {
    let (Aperture::EntrancePupilDiameter(number)
    | Aperture::FNumber(number)
    | Aperture::ObjectNa(number)
    | Aperture::StopSemiDiameter(number)) = aperture;
    number
}

const fn with_number(aperture: Aperture, number: f64) -> Aperture {
    match aperture {
        Aperture::EntrancePupilDiameter(_) => Aperture::EntrancePupilDiameter(number),
        Aperture::FNumber(_) => Aperture::FNumber(number),
        Aperture::ObjectNa(_) => Aperture::ObjectNa(number),
        Aperture::StopSemiDiameter(_) => Aperture::StopSemiDiameter(number),
    }
}

/// The number of an aperture whose paraxial beam is wider by a factor.
pub(super) fn scaled_aperture(aperture: Aperture, factor: f64) -> f64 {
    match aperture {
        Aperture::FNumber(number) => number / factor,
        // In air; the marginal ray scales with the tangent of its angle.
        Aperture::ObjectNa(na) => (na.min(1.0).asin().tan() * factor).atan().sin(),
        Aperture::EntrancePupilDiameter(number) | Aperture::StopSemiDiameter(number) => {
            number * factor
        }
    }
}

/// Sets the number of the aperture. The rim of the stop, which would clip a wider beam, scales with
/// the beam.
fn set_aperture(lens: &mut Lens, zoom: usize, number: f64) {
    let before = at_zoom(lens, zoom);
    let aperture = with_number(lens.aperture_at(zoom), number);
    match lens.zoom.get_mut(zoom).and_then(|position| position.aperture.as_mut()) {
        Some(own) => *own = aperture,
        None => lens.aperture = aperture,
    }
    let Some(stop) = lens.stop() else { return };
    if let Aperture::StopSemiDiameter(radius) = aperture {
        let of_position = |at: &Option<Aperture>| match at {
            Some(Aperture::StopSemiDiameter(radius)) => *radius,
            _ => 0.0,
        };
        let widest = lens.zoom.iter().map(|at| of_position(&at.aperture)).fold(radius, f64::max);
        lens.surfaces[stop].semi_diameter = Some(widest);
    } else if let Some(rim) = lens.surfaces[stop].semi_diameter {
        let (old, new) = (stop_radius(&before, 0), stop_radius(lens, zoom));
        let factor = old.zip(new).map_or(1.0, |(old, new)| new / old);
        lens.surfaces[stop].semi_diameter = Some(rim * factor);
    }
}

fn fields_mut(lens: &mut Lens, zoom: usize) -> &mut Fields {
    match lens.zoom.get_mut(zoom).and_then(|position| position.fields.as_mut()) {
        Some(own) => own,
        None => &mut lens.fields,
    }
}

/// Scales all field points; those at the edge take its very value.
fn scale_fields(fields: &mut Fields, old: f64, new: f64) {
    for coordinate in fields.values.iter_mut().flat_map(|point| [&mut point.x, &mut point.y]) {
        let at_edge = coordinate.abs() == old;
        *coordinate = if at_edge { new.copysign(*coordinate) } else { *coordinate * (new / old) };
    }
}

/// Makes the surface with this index the stop. An aperture given by the size of the stop takes the
/// radius that its paraxial beam has at the new one.
fn move_stop(lens: &mut Lens, index: f64) -> Option<()> {
    let index = index.round();
    let surface = (0..lens.surfaces.len()).find(|i| *i as f64 == index)?;
    if lens.surfaces[surface].stop {
        return Some(());
    }
    let radii: Vec<_> =
        (0..lens.zoom_positions()).map(|zoom| marginal_height(lens, zoom, surface)).collect();
    for (i, row) in lens.surfaces.iter_mut().enumerate() {
        row.stop = i == surface;
    }
    for (zoom, radius) in radii.into_iter().enumerate() {
        let position = lens.zoom.get_mut(zoom).and_then(|position| position.aperture.as_mut());
        let own = match position {
            Some(own) => own,
            None if zoom == 0 => &mut lens.aperture,
            None => continue,
        };
        if let Aperture::StopSemiDiameter(size) = own {
            *size = radius?;
            let rim = &mut lens.surfaces[surface].semi_diameter;
            *rim = Some(rim.map_or(*size, |rim| rim.max(*size)));
        }
    }
    Some(())
}

/// The height of the paraxial marginal ray at a surface.
fn marginal_height(lens: &Lens, zoom: usize, surface: usize) -> Option<f64> {
    let system = lens.resolve(zoom, lens.wavelengths[lens.primary()].um).ok()?;
    let first = first_order(&system, &Beam::for_lens(lens, zoom)).ok()?;
    first.marginal.heights.get(surface).map(|height| height.abs()).filter(|h| *h > 0.0)
}
