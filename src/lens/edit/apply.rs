//! Carrying out an edit: the changed lens, or the reason why it is refused.

use super::{Edit, EditError, rows, scale};
use crate::lens::{
    Aperture, FieldPoint, Fields, Lens, LensError, Medium, Parameter, Pickup, Quantity, Row,
    TermSelection, Variable, Wavelength, ZoomNumber, ZoomPosition,
};

/// The lens after an edit. The values of parameters that follow others are up to date in it.
///
/// # Errors
/// An edit that names a surface, zoom position or parameter that the lens does not have, or that
/// would leave a lens that cannot be used.
pub fn apply_edit(lens: &Lens, edit: &Edit) -> Result<Lens, EditError> {
    let mut changed = lens.clone();
    changed.apply(edit)?;
    changed.drop_lost_zoom_numbers();
    changed.check()?;
    let changed = changed.with_pickups()?;
    changed.check()?;
    match changed.check_resolved() {
        // What could not be traced before may be put right one number at a time.
        Err(why) if lens.check_resolved().is_ok() => Err(why.into()),
        _ => Ok(changed),
    }
}

impl Lens {
    fn apply(&mut self, edit: &Edit) -> Result<(), EditError> {
        match edit {
            Edit::Set { parameter, value } => self.write(*parameter, *value)?,
            Edit::SetSemiDiameter { surface, value } => self.set_semi_diameter(*surface, *value)?,
            Edit::SetAsphere { surface, terms } => {
                self.row_mut(*surface)?.asphere.clone_from(terms);
            }
            Edit::SetMedium { surface, medium } => self.set_medium(*surface, medium)?,
            Edit::SetObjectMedium(medium) => self.object_medium.clone_from(medium),
            Edit::SetStop(surface) => self.move_stop(*surface)?,
            Edit::SetHyperhemisphere { surface, hyper } => {
                self.row_mut(*surface)?.hyperhemisphere = *hyper;
            }
            Edit::SetComment { surface, text } => self.row_mut(*surface)?.comment.clone_from(text),
            Edit::SetRow { surface, row } => rows::replace(self, *surface, row)?,
            Edit::InsertRow { at, row } => rows::insert(self, *at, row)?,
            Edit::RemoveRow(surface) => rows::remove(self, *surface)?,
            Edit::ReverseRows { first, last } => rows::reverse(self, *first, *last)?,
            Edit::Element(edit) => edit.apply(self)?,
            Edit::Scale(factor) => scale::scale(self, *factor)?,
            Edit::SetName(text) => self.name.clone_from(text),
            Edit::SetSource(text) => self.source.clone_from(text),
            Edit::SetNotes(text) => self.notes.clone_from(text),
            Edit::SetObject(object) => self.object = *object,
            Edit::SetAperture(aperture) => self.set_aperture(*aperture),
            Edit::SetFields(fields) => self.set_fields(fields),
            Edit::SetWavelengths(wavelengths) => self.set_wavelengths(wavelengths),
            Edit::SetImageSolve(offset) => self.set_image_solve(*offset)?,
            Edit::AddVariable(variable) => self.add_variable(*variable)?,
            Edit::RemoveVariable(parameter) => self.variables.retain(|v| v.parameter != *parameter),
            Edit::SetVariables(variables) => self.variables.clone_from(variables),
            Edit::SetTolerances(sheet) => self.tolerances.clone_from(sheet),
            Edit::SetPickup(pickup) => self.set_pickup(*pickup),
            Edit::RemovePickup(follower) => self.pickups.retain(|p| p.parameter != *follower),
            Edit::InsertZoom { at, position } => self.insert_zoom(*at, position)?,
            Edit::RemoveZoom(at) => self.remove_zoom(*at)?,
            Edit::SetZoom { at, position } => self.zoom_mut(*at)?.clone_from(position),
            Edit::SetMerit(goal) => self.merit.clone_from(goal),
            Edit::Replace(lens) => self.clone_from(lens),
            Edit::Sequence { edits, .. } => edits.iter().try_for_each(|edit| self.apply(edit))?,
            Edit::SetObstruction { surface, value } => self.row_mut(*surface)?.obstruction = *value,
            Edit::SetApertures { surface, apertures } => {
                self.row_mut(*surface)?.apertures.clone_from(apertures);
            }
        }
        Ok(())
    }

    /// The row of a surface.
    pub(super) fn row_mut(&mut self, surface: usize) -> Result<&mut Row, EditError> {
        let last = (self.surfaces.len() - 1).into();
        let unknown = EditError::UnknownSurface { surface: surface.into(), last };
        self.surfaces.get_mut(surface).ok_or(unknown)
    }

    /// A zoom position.
    fn zoom_mut(&mut self, at: usize) -> Result<&mut ZoomPosition, EditError> {
        let count = self.zoom.len();
        self.zoom.get_mut(at).ok_or(EditError::UnknownZoomPosition { at, count })
    }

    /// Refuses a parameter that a pickup or a solve decides.
    pub(super) fn check_writable(&mut self, parameter: Parameter) -> Result<(), EditError> {
        self.row_mut(parameter.surface)?;
        if let Some(pickup) = self.pickups.iter().find(|p| p.parameter == parameter) {
            return Err(EditError::PickedUp(parameter, pickup.source));
        }
        let is_gap = parameter.quantity == Quantity::Thickness;
        if is_gap && self.image_solve.is_some() && parameter.surface + 1 == self.surfaces.len() {
            return Err(EditError::Solved);
        }
        Ok(())
    }

    fn write(&mut self, parameter: Parameter, value: f64) -> Result<(), EditError> {
        self.check_writable(parameter)?;
        if self.set(parameter, value) {
            Ok(())
        } else {
            Err(EditError::UnknownParameter(parameter))
        }
    }

    fn set_semi_diameter(&mut self, surface: usize, value: Option<f64>) -> Result<(), EditError> {
        let parameter = Parameter::new(surface, Quantity::SemiDiameter);
        if let Some(value) = value {
            return self.write(parameter, value);
        }
        self.check_writable(parameter)?;
        self.drop_references(parameter);
        self.row_mut(surface)?.semi_diameter = None;
        Ok(())
    }

    /// Sets the medium; one without an index parameter drops what refers to that parameter.
    fn set_medium(&mut self, surface: usize, medium: &Medium) -> Result<(), EditError> {
        self.row_mut(surface)?.medium.clone_from(medium);
        let index = Parameter::new(surface, Quantity::Index);
        if self.get(index).is_none() {
            self.drop_references(index);
        }
        Ok(())
    }

    /// Removes a parameter from the variables and pickups.
    pub(super) fn drop_references(&mut self, parameter: Parameter) {
        self.variables.retain(|v| v.parameter != parameter);
        self.pickups.retain(|p| p.parameter != parameter && p.source != parameter);
    }

    /// Removes the numbers of zoom positions that their rows do not have any more, with what refers to
    /// them: the index where a glass of a catalogue has been chosen, or the rim of a stop that is the
    /// aperture now.
    fn drop_lost_zoom_numbers(&mut self) {
        for zoom in 0..self.zoom.len() {
            let is_aperture = matches!(self.aperture_at(zoom), Aperture::StopSemiDiameter(_));
            let rows = &self.surfaces;
            let exists = |own: &ZoomNumber| {
                let row = rows.get(own.surface);
                row.is_some_and(|row| {
                    let is_stop = row.stop && own.quantity == Quantity::SemiDiameter;
                    row.get(own.quantity).is_some() && !(is_stop && is_aperture)
                })
            };
            let (kept, lost): (Vec<_>, Vec<_>) =
                std::mem::take(&mut self.zoom[zoom].numbers).into_iter().partition(exists);
            self.zoom[zoom].numbers = kept;
            for own in lost {
                self.drop_references(Parameter::at_zoom(own.surface, own.quantity, zoom));
            }
        }
    }

    /// Moves the stop. An aperture given by the size of the stop takes that of the new stop.
    fn move_stop(&mut self, surface: usize) -> Result<(), EditError> {
        self.row_mut(surface)?;
        for (i, row) in self.surfaces.iter_mut().enumerate() {
            row.stop = i == surface;
        }
        let row = &mut self.surfaces[surface];
        if let Aperture::StopSemiDiameter(size) = &mut self.aperture {
            let own = *row.semi_diameter.get_or_insert(*size);
            *size = own;
        }
        Ok(())
    }

    /// Sets the aperture; one given by the size of the stop sets the semi-diameter of the stop.
    fn set_aperture(&mut self, aperture: Aperture) {
        self.aperture = aperture;
        if let (Aperture::StopSemiDiameter(size), Some(stop)) = (aperture, self.stop()) {
            self.surfaces[stop].semi_diameter = Some(size);
        }
    }

    fn add_variable(&mut self, variable: Variable) -> Result<(), EditError> {
        self.check_writable(variable.parameter)?;
        match self.variables.iter_mut().find(|v| v.parameter == variable.parameter) {
            Some(old) => *old = variable,
            None => self.variables.push(variable),
        }
        Ok(())
    }

    fn set_pickup(&mut self, pickup: Pickup) {
        self.variables.retain(|v| v.parameter != pickup.parameter);
        match self.pickups.iter_mut().find(|p| p.parameter == pickup.parameter) {
            Some(old) => *old = pickup,
            None => self.pickups.push(pickup),
        }
    }

    fn set_image_solve(&mut self, offset: Option<f64>) -> Result<(), EditError> {
        if offset.is_none() {
            self.replace_image_solve()?;
        }
        self.image_solve = offset;
        let last = self.surfaces.len() - 1;
        if offset.is_some() {
            let is_solved = |p: Parameter| p.surface == last && p.quantity == Quantity::Thickness;
            self.variables.retain(|v| !is_solved(v.parameter));
        }
        Ok(())
    }

    /// Replaces the image solve by the last thickness that it gives at each zoom position.
    pub(super) fn replace_image_solve(&mut self) -> Result<(), EditError> {
        if self.image_solve.is_none() {
            return Ok(());
        }
        let last = self.surfaces.len() - 1;
        let um = self.wavelengths[self.primary()].um;
        let gaps: Result<Vec<f64>, LensError> = (0..self.zoom_positions())
            .map(|zoom| Ok(self.resolve(zoom, um)?.surfaces[last].thickness))
            .collect();
        let gaps = gaps?;
        self.surfaces[last].thickness = gaps[0];
        for (position, thickness) in self.zoom.iter_mut().zip(gaps) {
            position.set_number(last, Quantity::Thickness, thickness);
        }
        self.image_solve = None;
        Ok(())
    }

    /// Sets the field points. Terms of the merit function about one that moves in the list follow it.
    fn set_fields(&mut self, fields: &Fields) {
        let before = std::mem::replace(&mut self.fields, fields.clone()).values;
        let place = |i: usize| {
            let same =
                |new: &&FieldPoint| before.get(i).is_some_and(|f| (f.x, f.y) == (new.x, new.y));
            fields.values.iter().position(|new| same(&new))
        };
        if let Some(goal) = self.merit.as_mut().filter(|_| before.len() != fields.values.len()) {
            goal.renumber(TermSelection::Fields, |_, i| place(i));
        }
    }

    /// Sets the wavelengths. Terms of the merit function about one that moves in the list follow it.
    fn set_wavelengths(&mut self, wavelengths: &[Wavelength]) {
        let before = std::mem::replace(&mut self.wavelengths, wavelengths.to_vec());
        let place = |i: usize| {
            let um = before.get(i)?.um;
            wavelengths.iter().position(|new| new.um == um)
        };
        if let Some(goal) = self.merit.as_mut().filter(|_| before.len() != wavelengths.len()) {
            goal.renumber(TermSelection::Wavelengths, |_, i| place(i));
        }
    }

    fn insert_zoom(&mut self, at: usize, position: &ZoomPosition) -> Result<(), EditError> {
        let count = self.zoom.len();
        if at > count {
            return Err(EditError::UnknownZoomPosition { at, count });
        }
        self.zoom.insert(at, position.clone());
        self.renumber_zooms(|zoom| Some(if zoom < at { zoom } else { zoom + 1 }));
        Ok(())
    }

    fn remove_zoom(&mut self, at: usize) -> Result<(), EditError> {
        self.zoom_mut(at)?;
        self.zoom.remove(at);
        self.renumber_zooms(|zoom| match zoom {
            zoom if zoom == at => None,
            zoom if zoom > at => Some(zoom - 1),
            zoom => Some(zoom),
        });
        Ok(())
    }

    fn renumber_zooms(&mut self, map: impl Fn(usize) -> Option<usize>) {
        self.map_parameters(|parameter| match parameter.zoom {
            Some(zoom) => map(zoom).map(|zoom| Parameter { zoom: Some(zoom), ..parameter }),
            None => Some(parameter),
        });
        if let Some(goal) = &mut self.merit {
            goal.renumber(TermSelection::Zooms, |_, zoom| map(zoom));
        }
    }

    /// Refuses a lens that cannot be resolved at some zoom position and wavelength.
    fn check_resolved(&self) -> Result<(), LensError> {
        for zoom in 0..self.zoom_positions() {
            self.wavelengths.iter().try_for_each(|w| self.resolve(zoom, w.um).map(drop))?;
        }
        Ok(())
    }
}
