//! Inserting, removing, replacing and reversing rows; parameters that name a row are renumbered.

use super::EditError;
use crate::lens::{FREEFORM_NUMBERS, Lens, Medium, PROFILE_TERMS, Parameter, Quantity, Row};

/// Inserts a row in front of row `at`. An image solve stays with the last row.
pub(super) fn insert(lens: &mut Lens, at: usize, row: &Row) -> Result<(), EditError> {
    let count = lens.surfaces.len();
    if at > count {
        return Err(EditError::UnknownSurface { surface: at.into(), last: count.into() });
    }
    let focus = lens.image_solve;
    if at == count {
        lens.replace_image_solve()?;
    }
    lens.surfaces.insert(at, row.clone());
    lens.image_solve = focus;
    lens.renumber_rows(|surface| Some(if surface < at { surface } else { surface + 1 }));
    Ok(())
}

/// Removes a row. A parameter that followed one of its own keeps its value without the pickup.
pub(super) fn remove(lens: &mut Lens, surface: usize) -> Result<(), EditError> {
    lens.row_mut(surface)?;
    if lens.surfaces.len() == 1 {
        return Err(EditError::OnlySurface);
    }
    if lens.surfaces[surface].stop {
        return Err(EditError::RemovedStop(surface.into()));
    }
    lens.surfaces.remove(surface);
    lens.renumber_rows(|row| match row {
        row if row == surface => None,
        row if row > surface => Some(row - 1),
        row => Some(row),
    });
    Ok(())
}

/// Replaces a row; variables and pickups of parameters that it does not have are removed.
pub(super) fn replace(lens: &mut Lens, surface: usize, row: &Row) -> Result<(), EditError> {
    lens.row_mut(surface)?.clone_from(row);
    let gradient = (0..PROFILE_TERMS).map(Quantity::Grin);
    let forms = (0..FREEFORM_NUMBERS).map(Quantity::Freeform).chain(gradient);
    for quantity in [Quantity::Index, Quantity::SemiDiameter].into_iter().chain(forms) {
        let parameter = Parameter::new(surface, quantity);
        if lens.get(parameter).is_none() {
            lens.drop_references(parameter);
        }
    }
    Ok(())
}

/// Reverses the rows `first` to `last`: the surfaces and the gaps between them in reverse order, every
/// curvature and asphere coefficient with the other sign. The gap after the group stays.
pub(super) fn reverse(lens: &mut Lens, first: usize, last: usize) -> Result<(), EditError> {
    lens.row_mut(last)?;
    if first > last {
        return Err(EditError::ReversedRange { first: first.into(), last: last.into() });
    }
    if let Some(i) = (first..=last).find(|i| lens.surfaces[*i].medium == Medium::Mirror) {
        return Err(EditError::Mirror(i.into()));
    }
    let along = |i: &usize| match &lens.surfaces[*i].medium {
        Medium::Grin(gradient) => gradient.axial.iter().any(|term| *term != 0.0),
        _ => false,
    };
    if let Some(i) = (first..last).find(along) {
        return Err(EditError::AxialGrin(i.into()));
    }
    lens.reverse_rows(first, last);
    Ok(())
}
