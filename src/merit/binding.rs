//! Binds the variables to the numbers of resolved systems, so that no prescription has to be
//! resolved again while they change.
//!
//! Every number that changes is an affine function of one variable: a curvature is the variable
//! itself, a pickup a multiple of it, and the index of a model glass is proportional to nd.

use super::{MeritError, SLOPES, VariableDual};
use crate::lens::glass::model_index;
use crate::lens::{
    Aperture, FieldKind, Lens, LensError, Medium, Object, OperandKind, Parameter, Quantity, Shape,
    Surface, System, TemperatureChange, at_zoom, paraxial_image_distance,
};
use crate::paraxial::Beam;
use crate::pupil::{Aiming, RayModel, filled_stop_radius};
use crate::trace::{SurfaceParameter, SystemGradient};
use nalgebra::{DMatrix, DVector};

/// The temperatures in °C that the term of thermal focus compares.
const THERMAL_FOCUS_CELSIUS: [f64; 2] = [0.0, 40.0];

/// A number of a system that follows a variable: `offset + factor × variable`.
#[derive(Debug, Clone, Copy)]
struct ParameterBinding {
    variable: usize,
    surface: usize,
    target: SurfaceParameter,
    factor: f64,
    offset: f64,
}

/// A lens at one zoom position: its systems, and which of their numbers follow the variables.
#[derive(Debug, Clone)]
pub(super) struct Configuration {
    pub(super) zoom: usize,
    pub(super) primary: usize,
    pub(super) object: Object,
    pub(super) field_kind: FieldKind,
    /// True for each gap that is glass.
    pub(super) is_glass: Vec<bool>,
    /// The systems, one per wavelength.
    systems: Vec<System<f64>>,
    /// The surface that is the stop.
    pub(super) stop: usize,
    /// The beam of the lens.
    pub(super) beam: Beam,
    /// True if the beam fills the stop as far as its aperture says; false if the stop is the
    /// aperture.
    fills_stop: bool,
    bindings: Vec<Vec<ParameterBinding>>,
    /// The distance of the image plane from the paraxial focus in mm, if the last gap is solved
    /// for.
    focus_offset: Option<f64>,
    variables: usize,
    /// The semi-diameters of the light at surfaces whose rims nobody has fixed, in mm; infinite at the
    /// others.
    clear_rims: Vec<f64>,
    /// The changes to the temperatures that a term compares; `None` if none does.
    temperatures: Option<Result<[TemperatureChange; 2], LensError>>,
}

/// The systems of a zoom position at some values of the variables.
#[derive(Debug, Clone)]
pub(super) struct ResolvedSystems {
    /// The systems, one per wavelength, without the semi-diameters, so that no rim clips.
    pub(super) unclipped: Vec<System<f64>>,
    /// The systems, one per wavelength, with their semi-diameters and a stop as wide as the beam.
    pub(super) clipped: Vec<System<f64>>,
    /// The system at the primary wavelength with the semi-diameters to which its parts are made.
    pub(super) manufactured: System<f64>,
    /// The derivatives of the last gap by the variables, if it is solved for.
    focus_slopes: Option<DVector<f64>>,
    /// The derivatives of the radius of the stop by the variables, if a beam fills it in part.
    stop_slopes: Option<DVector<f64>>,
}

impl ResolvedSystems {
    /// The systems, one per wavelength, that of the primary one as its parts are made.
    pub(super) fn of_wavelengths(&self, primary: usize) -> Vec<System<f64>> {
        let mut all = self.clipped.clone();
        all[primary].clone_from(&self.manufactured);
        all
    }
}

impl Configuration {
    pub(super) fn new(lens: &Lens, zoom: usize) -> Result<Self, MeritError> {
        let stop = lens.stop().unwrap_or(0);
        if let Some(why) = lens.surfaces[stop].stop_fault() {
            return Err(MeritError::DoesNotApply { term: "pupil", why });
        }
        let beam = Beam::for_lens(lens, zoom);
        let mut systems = Vec::new();
        let mut bindings = Vec::new();
        for wavelength in &lens.wavelengths {
            let mut system = lens.resolve(zoom, wavelength.um)?;
            if let Aperture::StopSemiDiameter(radius) = beam.aperture {
                system.surfaces[stop].semi_diameter = radius;
            }
            let bound = bind_parameters(lens, zoom, wavelength.um, &mut system);
            bindings.push(bound);
            systems.push(system);
        }
        let glass = |i: usize| {
            let row = &lens.surfaces[i];
            match row.medium {
                Medium::Mirror => systems[0].surfaces[i].index != 1.0,
                Medium::Air => false,
                Medium::Glass(_) | Medium::Model { .. } | Medium::Index(_) | Medium::Grin(_) => {
                    true
                }
            }
        };
        Ok(Self {
            zoom,
            primary: lens.primary(),
            object: lens.object,
            field_kind: lens.fields_at(zoom).kind,
            is_glass: (0..lens.surfaces.len()).map(glass).collect(),
            stop,
            beam,
            fills_stop: !matches!(beam.aperture, Aperture::StopSemiDiameter(_)),
            focus_offset: lens.image_solve,
            variables: lens.variables.len(),
            bindings,
            systems,
            clear_rims: Vec::new(),
            temperatures: None,
        })
    }

    /// Finds the changes of the lens to the temperatures that the term of thermal focus compares.
    pub(super) fn find_temperature_changes(&mut self, lens: &Lens) {
        let um = lens.wavelengths[self.primary].um;
        let [cold, warm] = THERMAL_FOCUS_CELSIUS.map(|at| TemperatureChange::new(lens, um, at));
        self.temperatures = Some(cold.and_then(|cold| Ok([cold, warm?])));
    }

    /// The changes to the temperatures that the term of thermal focus compares.
    pub(super) fn temperature_changes(&self) -> Result<&[TemperatureChange; 2], MeritError> {
        match &self.temperatures {
            Some(Ok(changes)) => Ok(changes),
            Some(Err(error)) => Err(error.clone().into()),
            None => {
                let why = "the changes with temperature were not asked for";
                Err(MeritError::DoesNotApply { term: OperandKind::ThermalFocus.name(), why })
            }
        }
    }

    /// Adds a variable for the index of the gap behind each of some rows at each wavelength, row by row
    /// behind the variables of the lens.
    pub(super) fn vary_indices(&mut self, lens: &Lens, rows: &[usize]) {
        let target = SurfaceParameter::Index;
        for row in rows {
            for bindings in &mut self.bindings {
                let bound = |surface| {
                    let variable = self.variables;
                    ParameterBinding { variable, surface, target, factor: 1.0, offset: 0.0 }
                };
                bindings.extend(followers_of_index(lens, *row, target).into_iter().map(bound));
                self.variables += 1;
            }
        }
    }

    /// The indices of the gaps behind some rows at each wavelength, row by row.
    pub(super) fn indices(&self, rows: &[usize]) -> Vec<f64> {
        let of_row = |row: &usize| -> Vec<f64> {
            self.systems.iter().map(|system| system.surfaces[*row].index).collect()
        };
        rows.iter().flat_map(of_row).collect()
    }

    /// Gives surfaces whose rims nobody has fixed the semi-diameters of the light.
    pub(super) fn set_clear_rims(&mut self, rims: &[f64]) {
        self.clear_rims = rims.to_vec();
    }

    /// The semi-diameters of the light at a surface and the next one, as far as their rims follow it;
    /// else infinite.
    pub(super) fn clear_rims(&self, surface: usize) -> [f64; 2] {
        let rim = |i: usize| self.clear_rims.get(i).copied().unwrap_or(f64::INFINITY);
        [rim(surface), rim(surface + 1)]
    }

    /// The systems at some values of the variables.
    ///
    /// # Errors
    /// An aperture that defines no beam for the lens.
    pub(super) fn at(&self, values: &[f64]) -> Result<ResolvedSystems, MeritError> {
        let mut clipped = self.systems.clone();
        for (system, bindings) in clipped.iter_mut().zip(&self.bindings) {
            for binding in bindings {
                let value = binding.offset + binding.factor * values[binding.variable];
                *binding.target.value_mut(system, binding.surface) = value;
            }
        }
        let focus_slopes = self.focus_offset.map(|offset| self.solve_focus(&mut clipped, offset));
        let manufactured = clipped[self.primary].clone();
        let stop_slopes = self.fill_stop(&mut clipped)?;
        let mut unclipped = clipped.clone();
        let surfaces = unclipped.iter_mut().flat_map(|system| &mut system.surfaces);
        surfaces.for_each(unclip);
        Ok(ResolvedSystems { unclipped, clipped, manufactured, focus_slopes, stop_slopes })
    }

    /// Limits the stop to what the beam fills of it, and returns the derivatives of its radius by
    /// the variables; `None` if its own rim is smaller.
    fn fill_stop(&self, systems: &mut [System<f64>]) -> Result<Option<DVector<f64>>, MeritError> {
        if !self.fills_stop {
            return Ok(None);
        }
        let beam = &self.beam;
        let primary = &systems[self.primary];
        let radius = filled_stop_radius(primary, beam)?;
        if primary.surfaces[self.stop].semi_diameter <= radius {
            return Ok(None);
        }
        let slopes = self.slopes(primary, |along| {
            filled_stop_radius(along, beam).unwrap_or_else(|_| VariableDual::constant(radius))
        });
        for system in systems {
            system.surfaces[self.stop].semi_diameter = radius;
        }
        Ok(Some(slopes))
    }

    /// The ray model of the lens with its semi-diameters, limited by its stop.
    pub(super) fn ray_model(
        &self,
        systems: &ResolvedSystems,
        lens: &Lens,
        aiming: Aiming,
    ) -> Result<RayModel, MeritError> {
        let weighted = lens.wavelengths.iter().zip(&systems.clipped);
        let channels = weighted.map(|(w, system)| (w.um, w.weight, system.clone())).collect();
        let mut beam = Beam::for_lens(lens, self.zoom);
        let primary = &systems.clipped[self.primary];
        beam.aperture = Aperture::StopSemiDiameter(primary.surfaces[self.stop].semi_diameter);
        Ok(RayModel::from_systems(channels, self.primary, beam, aiming)?)
    }

    /// Moves the image plane of the systems to the focus, and returns the derivatives of the last
    /// gap by the variables.
    fn solve_focus(&self, systems: &mut [System<f64>], offset: f64) -> DVector<f64> {
        let primary = &systems[self.primary];
        let gap = paraxial_image_distance(primary, self.object) + offset;
        let slopes = self.slopes(primary, |along| paraxial_image_distance(along, self.object));
        for system in systems {
            let last = system.surfaces.len() - 2;
            system.surfaces[last].thickness = gap;
        }
        slopes
    }

    /// The derivatives by the variables of a number of a system that does not depend on the focus.
    fn slopes(
        &self,
        primary: &System<f64>,
        number: impl Fn(&System<VariableDual>) -> VariableDual,
    ) -> DVector<f64> {
        let blocks = (0..self.variables).step_by(SLOPES);
        let slopes =
            blocks.flat_map(|first| number(&self.along_without_focus(primary, first)).slope);
        DVector::from_iterator(self.variables, slopes.take(self.variables))
    }

    /// A system with its derivatives along a block of variables, given by the first.
    fn along_without_focus(&self, primary: &System<f64>, first: usize) -> System<VariableDual> {
        self.along_at(primary, self.primary, first)
    }

    /// The system of a wavelength with its derivatives along a block of variables, given by the
    /// first.
    fn along_at(
        &self,
        system: &System<f64>,
        wavelength: usize,
        first: usize,
    ) -> System<VariableDual> {
        let mut system: System<VariableDual> = system.cast();
        for binding in &self.bindings[wavelength] {
            let direction = binding.variable.checked_sub(first).filter(|along| *along < SLOPES);
            if let Some(direction) = direction {
                let number = binding.target.value_mut(&mut system, binding.surface);
                number.slope[direction] = binding.factor;
            }
        }
        system
    }

    /// The systems of all wavelengths with their derivatives along each block of variables in turn,
    /// with the first variable of the block.
    pub(super) fn all_systems_along<'a>(
        &'a self,
        systems: &'a ResolvedSystems,
    ) -> impl Iterator<Item = (usize, Vec<System<VariableDual>>)> + 'a {
        let all = systems.of_wavelengths(self.primary);
        (0..self.variables).step_by(SLOPES).map(move |first| {
            let along = |(i, system)| {
                let mut system = self.along_at(system, i, first);
                move_focus(&mut system, systems, first);
                system
            };
            (first, all.iter().enumerate().map(along).collect())
        })
    }

    /// The systems at the primary wavelength with their derivatives along each block of variables in
    /// turn, with the first variable of the block.
    pub(super) fn systems_along<'a>(
        &'a self,
        systems: &'a ResolvedSystems,
    ) -> impl Iterator<Item = (usize, System<VariableDual>)> + 'a {
        (0..self.variables).step_by(SLOPES).map(|first| {
            let mut system = self.along_without_focus(&systems.manufactured, first);
            move_focus(&mut system, systems, first);
            (first, system)
        })
    }

    /// The derivatives by the variables from those by the numbers of a system.
    pub(super) fn by_variables(
        &self,
        systems: &ResolvedSystems,
        wavelength: usize,
        gradient: &SystemGradient<f64>,
    ) -> DVector<f64> {
        let mut by_variable = DVector::zeros(self.variables);
        for binding in &self.bindings[wavelength] {
            let surface = &gradient.surfaces[binding.surface];
            let by_number = match binding.target {
                SurfaceParameter::Curvature => surface.curvature,
                SurfaceParameter::Conic => surface.conic,
                SurfaceParameter::AsphereTerm(term) => surface.terms[term],
                SurfaceParameter::Thickness => surface.thickness,
                SurfaceParameter::Index => surface.index,
                SurfaceParameter::SemiDiameter
                    if binding.surface == self.stop && systems.stop_slopes.is_some() =>
                {
                    0.0
                }
                SurfaceParameter::SemiDiameter => surface.semi_diameter,
                target @ (SurfaceParameter::GrinTerm(_)
                | SurfaceParameter::Freeform(_)
                | SurfaceParameter::Aperture(_)) => surface.by(target),
            };
            by_variable[binding.variable] += binding.factor * by_number;
        }
        if let Some(focus) = &systems.focus_slopes {
            let last = gradient.surfaces.len() - 2;
            by_variable.axpy(gradient.surfaces[last].thickness, focus, 1.0);
        }
        if let Some(stop) = &systems.stop_slopes {
            by_variable.axpy(gradient.surfaces[self.stop].semi_diameter, stop, 1.0);
        }
        by_variable
    }

    /// The parameters of a system that vary with some variable.
    pub(super) fn moving_parameters(
        &self,
        wavelength: usize,
    ) -> Vec<(Option<usize>, SurfaceParameter)> {
        let mut varying = Vec::new();
        for binding in &self.bindings[wavelength] {
            let parameter = (Some(binding.surface), binding.target);
            if !varying.contains(&parameter) {
                varying.push(parameter);
            }
        }
        let last = (Some(self.systems[wavelength].surfaces.len() - 2), SurfaceParameter::Thickness);
        if self.focus_offset.is_some() && !varying.contains(&last) {
            varying.push(last);
        }
        varying
    }

    /// The derivatives of the varying parameters by the variables: a row for each parameter.
    pub(super) fn parameter_slopes(
        &self,
        systems: &ResolvedSystems,
        wavelength: usize,
        varying: &[(Option<usize>, SurfaceParameter)],
    ) -> DMatrix<f64> {
        let mut slopes = DMatrix::zeros(varying.len(), self.variables);
        let row = |surface: usize, parameter: SurfaceParameter| {
            varying.iter().position(|varies| *varies == (Some(surface), parameter))
        };
        for binding in &self.bindings[wavelength] {
            if let Some(row) = row(binding.surface, binding.target) {
                slopes[(row, binding.variable)] += binding.factor;
            }
        }
        let last = self.systems[wavelength].surfaces.len() - 2;
        if let (Some(focus), Some(row)) =
            (&systems.focus_slopes, row(last, SurfaceParameter::Thickness))
        {
            slopes.row_mut(row).iter_mut().zip(focus.iter()).for_each(|(to, by)| *to += by);
        }
        slopes
    }
}

/// Gives the last gap of a system its derivatives along a block of variables, if it is solved
/// for.
fn move_focus(system: &mut System<VariableDual>, systems: &ResolvedSystems, first: usize) {
    let Some(focus) = &systems.focus_slopes else { return };
    let last = system.surfaces.len() - 2;
    let slopes = &mut system.surfaces[last].thickness.slope;
    slopes.iter_mut().zip(focus.iter().skip(first)).for_each(|(to, by)| *to = *by);
}

/// Removes the limits of a surface: while the lens changes, rays may pass a rim or an obstruction
/// by any amount. An asphere still ends not far beyond its semi-diameter, because there its
/// polynomial is meaningless and rays may cross it several times.
fn unclip(surface: &mut Surface<f64>) {
    surface.obstruction = 0.0;
    surface.apertures.clear();
    surface.semi_diameter = match surface.shape {
        _ if surface.freeform.is_some() => ASPHERE_MARGIN * surface.semi_diameter,
        Shape::Asphere { .. } => ASPHERE_MARGIN * surface.semi_diameter,
        Shape::Plane | Shape::Sphere { .. } | Shape::Conic { .. } => f64::INFINITY,
    };
}

/// The radius up to which an asphere is extended, in semi-diameters.
const ASPHERE_MARGIN: f64 = 1.2;

/// The system of a lens at a wavelength, each surface in a shape that has the numbers that vary.
pub(super) fn resolve_for_variables(
    lens: &Lens,
    zoom: usize,
    um: f64,
) -> Result<System<f64>, MeritError> {
    let mut system = lens.resolve(zoom, um)?;
    bind_parameters(lens, zoom, um, &mut system);
    Ok(system)
}

/// The bindings of the variables at a wavelength; surfaces of `system` are promoted to shapes that
/// have the numbers bound.
fn bind_parameters(
    lens: &Lens,
    zoom: usize,
    um: f64,
    system: &mut System<f64>,
) -> Vec<ParameterBinding> {
    let mut bindings = Vec::new();
    for (variable, free) in lens.variables.iter().enumerate() {
        let start = lens.get(free.parameter).unwrap_or(0.0);
        for (parameter, factor) in lens.dependents(free.parameter) {
            let Parameter { surface, quantity, zoom: of } = parameter;
            let is_moved = of.map_or(!lens.is_own_at(zoom, surface, quantity), |of| of == zoom);
            let target = match quantity {
                _ if !is_moved => continue,
                Quantity::Curvature => SurfaceParameter::Curvature,
                Quantity::Conic => SurfaceParameter::Conic,
                Quantity::Asphere(term) => SurfaceParameter::AsphereTerm(term),
                Quantity::Thickness => SurfaceParameter::Thickness,
                Quantity::Index => SurfaceParameter::Index,
                Quantity::Grin(k) => SurfaceParameter::GrinTerm(k),
                Quantity::Freeform(k) => SurfaceParameter::Freeform(k),
                Quantity::SemiDiameter if has_own_aperture(lens, zoom, surface) => continue,
                Quantity::SemiDiameter => SurfaceParameter::SemiDiameter,
            };
            let growth = if target == SurfaceParameter::Index {
                index_slope(lens, surface, um)
            } else {
                1.0
            };
            let factor = factor * growth;
            for surface in followers_of_index(lens, surface, target) {
                if let SurfaceParameter::GrinTerm(_) = target {
                    let graded = &mut system.surfaces[surface].grin;
                    *graded = graded.or_else(|| at_zoom(lens, zoom).grin_coefficients(surface));
                }
                target.promote_shape(system, surface);
                let now = *target.value_mut(system, surface);
                let offset = if factor == 1.0 && now == start { 0.0 } else { now - factor * start };
                bindings.push(ParameterBinding { variable, surface, target, factor, offset });
            }
        }
    }
    bindings
}

/// True if the surface is the stop and the zoom position defines its size by an aperture of its
/// own.
fn has_own_aperture(lens: &Lens, zoom: usize, surface: usize) -> bool {
    lens.surfaces[surface].stop && lens.zoom.get(zoom).is_some_and(|z| z.aperture.is_some())
}

/// The derivative of the index of a gap by its nd.
fn index_slope(lens: &Lens, surface: usize, um: f64) -> f64 {
    let medium = match &lens.surfaces[surface].medium {
        Medium::Grin(gradient) => &gradient.base,
        medium => medium,
    };
    match *medium {
        Medium::Model { vd, .. } => model_index(2.0, vd, um) - model_index(1.0, vd, um),
        _ => 1.0,
    }
}

/// The surfaces behind which the number applies: the surface itself and, for an index, the mirrors
/// that follow it and the image plane.
fn followers_of_index(lens: &Lens, surface: usize, parameter: SurfaceParameter) -> Vec<usize> {
    let mut all = vec![surface];
    if parameter == SurfaceParameter::Index {
        let mirrors =
            lens.surfaces[surface + 1..].iter().take_while(|r| r.medium == Medium::Mirror);
        all.extend((1..=mirrors.count()).map(|i| surface + i));
        if all.last() == Some(&(lens.surfaces.len() - 1)) {
            all.push(lens.surfaces.len());
        }
    }
    all
}
