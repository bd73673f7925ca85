//! Edits of whole elements: insert, remove, move, bend, cement, split. Each is one edit, and what
//! stands behind the element stays where it is as far as there is air for it.

use super::{EditError, rows};
use crate::lens::element::{power, trace};
use crate::lens::resolve::index;
use crate::lens::{
    Lens, Medium, MediumPlace, Object, Parameter, Quantity, Row, SurfaceNumber, ZoomNumber,
};
use serde::{Deserialize, Serialize};

/// The smallest gap of air beside a new element, as a share of its length.
const MIN_GAP: f64 = 0.1;

/// A change of a whole element: a single lens or a cemented group, named by one of its surfaces, or
/// one to be inserted. Surfaces are indices from 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ElementEdit {
    /// Inserts an element into the air in front of a surface, which is divided before and behind it.
    Insert {
        /// The index of its first surface; the number of surfaces appends it.
        at: usize,
        /// Its surfaces; the gap after the last one is ignored.
        rows: Vec<Row>,
    },
    /// Removes the element to which a surface belongs; air takes its place.
    Remove(usize),
    /// Moves the element to which a surface belongs along the axis, and nothing else.
    Move {
        /// One of its surfaces.
        surface: usize,
        /// The distance in mm, positive towards the image.
        by: f64,
    },
    /// Bends the element to which a surface belongs without a change of its focal length.
    Bend {
        /// One of its surfaces.
        surface: usize,
        /// The change of its curvatures, in 1/mm.
        by: f64,
    },
    /// Cements the element to which a surface belongs to the one behind it.
    Cement(usize),
    /// Splits the element to which a surface belongs: at this surface if it is cemented, otherwise a
    /// single lens into two of half its power.
    Split(usize),
}

impl ElementEdit {
    /// The title of the edit in a menu.
    pub(super) fn title(&self) -> String {
        let (what, surface) = match self {
            Self::Insert { at, .. } => return format!("insert an element at surface {}", at + 1),
            Self::Remove(surface) => ("remove", surface),
            Self::Move { surface, .. } => ("move", surface),
            Self::Bend { surface, .. } => ("bend", surface),
            Self::Cement(surface) => ("cement", surface),
            Self::Split(surface) => ("split", surface),
        };
        format!("{what} the element of surface {}", SurfaceNumber::new(*surface))
    }

    /// Carries the edit out.
    pub(super) fn apply(&self, lens: &mut Lens) -> Result<(), EditError> {
        match self {
            Self::Move { surface, by } => return shift(lens, *surface, *by),
            Self::Bend { surface, by } => return bend(lens, *surface, *by),
            Self::Insert { at, rows } => insert(lens, *at, rows)?,
            Self::Remove(surface) => remove(lens, *surface)?,
            Self::Cement(surface) => cement(lens, *surface)?,
            Self::Split(surface) => split(lens, *surface)?,
        }
        widen_bounds(lens);
        Ok(())
    }
}

/// Widens the bounds of variables to the values that they have in another structure.
fn widen_bounds(lens: &mut Lens) {
    let mut variables = std::mem::take(&mut lens.variables);
    for variable in &mut variables {
        if let Some(value) = lens.get(variable.parameter) {
            variable.min = variable.min.map(|min| min.min(value));
            variable.max = variable.max.map(|max| max.max(value));
        }
    }
    lens.variables = variables;
}

/// Inserts an element in front of row `at`; the air there is divided before and behind it.
fn insert(lens: &mut Lens, at: usize, rows: &[Row]) -> Result<(), EditError> {
    let count = lens.surfaces.len();
    if at > count {
        return Err(EditError::UnknownSurface { surface: at.into(), last: count.into() });
    }
    let Some((last, inner)) = rows.split_last() else { return Err(EditError::NoElement) };
    let length: f64 = inner.iter().map(|row| row.thickness).sum();
    let solve = lens.image_solve;
    let gaps = gaps_around(lens, at, length)?;
    if at == count {
        lens.replace_image_solve()?;
    }
    for (i, row) in inner.iter().chain([last]).enumerate() {
        let row = Row { stop: false, ..row.clone() };
        rows::insert(lens, at + i, &row)?;
    }
    let end = at + rows.len() - 1;
    lens.surfaces[end].medium = Medium::Air;
    lens.set(Parameter::new(end, Quantity::Thickness), gaps[0].1);
    if let Some(front) = at.checked_sub(1) {
        lens.set(Parameter::new(front, Quantity::Thickness), gaps[0].0);
        for zoom in 0..lens.zoom.len() {
            if lens.is_own_at(zoom, front, Quantity::Thickness) {
                set_at_zoom(lens, front, zoom, gaps[zoom + 1].0);
                set_at_zoom(lens, end, zoom, gaps[zoom + 1].1);
            }
        }
    }
    lens.image_solve = solve;
    Ok(())
}

/// The gaps before and behind an element of some length in front of row `at`, as written and at each
/// zoom position.
fn gaps_around(lens: &Lens, at: usize, length: f64) -> Result<Vec<(f64, f64)>, EditError> {
    let least = MIN_GAP * length;
    let Some(front) = at.checked_sub(1) else {
        return match lens.object_medium {
            Medium::Air => Ok(vec![(0.0, least); lens.zoom.len() + 1]),
            _ => Err(EditError::NotInAir(0.into())),
        };
    };
    if lens.surfaces[front].medium != Medium::Air {
        return Err(EditError::NotInAir(front.into()));
    }
    let is_last = at == lens.surfaces.len();
    let divide = |gap: f64| match (gap - length, is_last) {
        (left, true) if left > 2.0 * least => (least, left - least),
        (_, true) => (least, gap),
        (left, false) => (0.5 * left.max(2.0 * least), 0.5 * left.max(2.0 * least)),
    };
    let written = lens.surfaces[front].thickness;
    let zooms = (0..lens.zoom.len()).map(|zoom| lens.thickness_at(front, zoom).unwrap_or(written));
    Ok([written].into_iter().chain(zooms).map(divide).collect())
}

fn set_at_zoom(lens: &mut Lens, surface: usize, zoom: usize, thickness: f64) {
    lens.set(Parameter::at_zoom(surface, Quantity::Thickness, zoom), thickness);
}

/// The first and the last surface of the element of a surface.
fn element(lens: &mut Lens, surface: usize) -> Result<(usize, usize), EditError> {
    lens.row_mut(surface)?;
    lens.element_around(surface).ok_or(EditError::NotAnElement(surface.into()))
}

/// Removes the element of a surface; air takes its place.
fn remove(lens: &mut Lens, surface: usize) -> Result<(), EditError> {
    let (first, last) = element(lens, surface)?;
    if let Some(stop) = lens.stop().filter(|stop| (first..=last).contains(stop)) {
        return Err(EditError::RemovedStop(stop.into()));
    }
    let inner: f64 = lens.surfaces[first..last].iter().map(|row| row.thickness).sum();
    let joined = |lens: &Lens, front: usize, zoom: Option<usize>| {
        gap_at(lens, front, zoom) + inner + gap_at(lens, last, zoom)
    };
    if let Some(front) = first.checked_sub(1) {
        let written = joined(lens, front, None);
        for zoom in 0..lens.zoom.len() {
            let gap = joined(lens, front, Some(zoom));
            if gap != written {
                set_at_zoom(lens, front, zoom, gap);
            }
        }
        lens.surfaces[front].thickness = written;
    }
    (first..=last).rev().try_for_each(|row| rows::remove(lens, row))
}

/// The thickness behind a surface, at a zoom position if one is given.
fn gap_at(lens: &Lens, row: usize, zoom: Option<usize>) -> f64 {
    let own = zoom.and_then(|zoom| lens.thickness_at(row, zoom));
    own.unwrap_or(lens.surfaces[row].thickness)
}

/// Moves the element of a surface along the axis by some millimetres, towards the image if positive.
fn shift(lens: &mut Lens, surface: usize, by: f64) -> Result<(), EditError> {
    let (first, last) = element(lens, surface)?;
    match (first.checked_sub(1), &mut lens.object) {
        (Some(front), _) => change_gap(lens, front, by)?,
        (None, Object::Finite(distance)) => *distance += by,
        (None, Object::Infinity) => {}
    }
    let is_solved = lens.image_solve.is_some() && last + 1 == lens.surfaces.len();
    if is_solved { Ok(()) } else { change_gap(lens, last, -by) }
}

/// Makes a gap longer at every zoom position; one of air does not become negative.
fn change_gap(lens: &mut Lens, surface: usize, by: f64) -> Result<(), EditError> {
    let parameter = Parameter::new(surface, Quantity::Thickness);
    lens.check_writable(parameter)?;
    let row = &mut lens.surfaces[surface];
    let written = row.thickness;
    row.thickness += by;
    let numbers = lens.zoom.iter_mut().flat_map(|position| &mut position.numbers);
    let is_gap =
        |own: &&mut ZoomNumber| own.surface == surface && own.quantity == Quantity::Thickness;
    let own = numbers.filter(is_gap).map(|gap| {
        let before = gap.value;
        gap.value += by;
        before
    });
    let before = own.chain([written]).filter(|gap| *gap >= 0.0).fold(f64::INFINITY, f64::min);
    if before + by < 0.0 {
        return Err(EditError::NoRoom { surface: surface.into(), room: before, needed: -by });
    }
    Ok(())
}

/// Bends the element of a surface: every curvature changes by the same amount in 1/mm, and the last
/// one besides so that the focal length in its surroundings stays.
fn bend(lens: &mut Lens, surface: usize, by: f64) -> Result<(), EditError> {
    let (first, last) = element(lens, surface)?;
    let kept = element_power(lens, first, last)?;
    for row in first..=last {
        let parameter = Parameter::new(row, Quantity::Curvature);
        lens.check_writable(parameter)?;
        lens.surfaces[row].curvature += by;
    }
    keep_power(lens, first, last, kept)
}

/// The index in front of a row at the primary wavelength.
fn index_in_front(lens: &Lens, row: usize, um: f64) -> Result<f64, EditError> {
    let mut n = index(&lens.object_medium, MediumPlace::Object, um, 1.0)?;
    for (i, row) in lens.surfaces[..row].iter().enumerate() {
        n = index(&row.medium, MediumPlace::behind(i), um, n)?;
    }
    Ok(n)
}

fn element_power(lens: &Lens, first: usize, last: usize) -> Result<f64, EditError> {
    let um = lens.wavelengths[lens.primary()].um;
    Ok(power(&lens.surfaces[first..=last], um, index_in_front(lens, first, um)?)?)
}

/// Sets the last curvature of an element to that with which it has a power, if there is one.
fn keep_power(lens: &mut Lens, first: usize, last: usize, kept: f64) -> Result<(), EditError> {
    let um = lens.wavelengths[lens.primary()].um;
    let front = index_in_front(lens, first, um)?;
    let (slope, height, step) = trace(&lens.surfaces[first..=last], um, front)?;
    let change = (kept + slope) / (height * step);
    if change.is_finite() {
        lens.surfaces[last].curvature += change;
    }
    Ok(())
}

/// The power of the whole lens as written, at the primary wavelength; `None` where it cannot be
/// computed.
fn lens_power(lens: &Lens) -> Option<f64> {
    let um = lens.wavelengths[lens.primary()].um;
    let front = index_in_front(lens, 0, um).ok()?;
    power(&lens.surfaces, um, front).ok().filter(|power| power.is_finite())
}

/// Sets the curvature of a surface to that with which the whole lens has a power, if there is one.
fn keep_lens_power(lens: &mut Lens, surface: usize, kept: Option<f64>) {
    let before = lens.surfaces[surface].curvature;
    // The power is linear in each curvature; the second step removes what rounding has left.
    for _ in 0..2 {
        let curvature = lens.surfaces[surface].curvature;
        let step = curvature.abs().max(1e-3);
        let Some((kept, now)) = kept.zip(lens_power(lens)) else { return };
        lens.surfaces[surface].curvature = curvature + step;
        let slope = lens_power(lens).map(|there| (there - now) / step);
        let change = slope.map(|slope| (kept - now) / slope).filter(|change| change.is_finite());
        lens.surfaces[surface].curvature = change.map_or(before, |change| curvature + change);
    }
}

/// Cements a surface to the next one across the air between them: the new surface has the mean of
/// their curvatures, and what stands behind the element stays where it is.
fn cement(lens: &mut Lens, surface: usize) -> Result<(), EditError> {
    let (_, last) = element(lens, surface)?;
    let next = last + 1;
    if lens.surfaces.get(next).is_some_and(|row| row.stop && row.medium == Medium::Air) {
        return Err(EditError::StopBetween(next.into()));
    }
    let Some((_, end)) = lens.element_around(next).filter(|(first, _)| *first == next) else {
        return Err(EditError::NothingToCement(surface.into()));
    };
    let gap = lens.surfaces[last].thickness;
    let [front, back] = [&lens.surfaces[last], &lens.surfaces[next]];
    let largest = |a: Option<f64>, b: Option<f64>| Some(a?.max(b?));
    let joined = Row {
        curvature: 0.5 * (front.curvature + back.curvature),
        thickness: back.thickness,
        medium: back.medium.clone(),
        semi_diameter: largest(front.semi_diameter, back.semi_diameter),
        stop: front.stop || back.stop,
        ..front.clone()
    };
    lens.surfaces[next].stop = false;
    rows::remove(lens, next)?;
    rows::replace(lens, last, &joined)?;
    for position in &mut lens.zoom {
        position.remove_number(last, Quantity::Thickness);
    }
    absorb(lens, end - 1, gap);
    Ok(())
}

/// Makes the gap behind an element longer, or shorter as far as there is air.
fn absorb(lens: &mut Lens, surface: usize, by: f64) {
    let unchanged = lens.clone();
    if change_gap(lens, surface, by).is_err() {
        *lens = unchanged;
    }
}

/// Splits the element of a surface: at a cemented surface into the parts before and behind it, a
/// single lens into two of half its power each.
fn split(lens: &mut Lens, surface: usize) -> Result<(), EditError> {
    let (first, last) = element(lens, surface)?;
    if (first + 1..last).contains(&surface) {
        return separate(lens, surface, last);
    }
    if last > first + 1 {
        return Err(EditError::NothingToSplit(surface.into()));
    }
    halve(lens, first)
}

/// Parts a cemented group at one of its surfaces, which is then there twice.
fn separate(lens: &mut Lens, surface: usize, last: usize) -> Result<(), EditError> {
    let copy = Row { stop: false, ..lens.surfaces[surface].clone() };
    let gap = 0.2 * lens.surfaces[surface - 1].thickness.min(copy.thickness);
    rows::insert(lens, surface + 1, &copy)?;
    let air = Row { thickness: gap, medium: Medium::Air, ..lens.surfaces[surface].clone() };
    rows::replace(lens, surface, &air)?;
    absorb(lens, last + 1, -gap);
    Ok(())
}

/// Replaces a single lens by two of half its curvatures and thickness, with the same power together.
fn halve(lens: &mut Lens, first: usize) -> Result<(), EditError> {
    let last = first + 1;
    let kept = element_power(lens, first, last)?;
    let whole = lens_power(lens);
    let [front, back] = [lens.surfaces[first].clone(), lens.surfaces[last].clone()];
    let height = back.semi_diameter.or(front.semi_diameter).unwrap_or(front.thickness);
    // Two concave surfaces that face each other touch at their rims.
    let sag = 0.25 * (back.curvature - front.curvature).max(0.0) * height * height;
    let gap = 0.1 * front.thickness + sag;
    let half =
        |row: &Row| Row { curvature: 0.5 * row.curvature, asphere: Vec::new(), ..row.clone() };
    let glass = Row { thickness: 0.5 * front.thickness, ..half(&front) };
    let plain = Row { stop: false, ..glass.clone() };
    let air = Row { thickness: gap, stop: false, ..half(&back) };
    rows::insert(lens, last, &air)?;
    rows::insert(lens, last + 1, &plain)?;
    rows::replace(lens, first, &glass)?;
    rows::replace(lens, last + 2, &Row { thickness: back.thickness, ..half(&back) })?;
    keep_power(lens, first, last + 2, kept)?;
    absorb(lens, last + 2, -gap);
    // The principal planes of two lenses lie elsewhere than those of one, which the lens feels.
    keep_lens_power(lens, last + 2, whole);
    Ok(())
}
