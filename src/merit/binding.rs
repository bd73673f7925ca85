//! From variables to the numbers of resolved systems, without looking anything up again.
//!
//! Every number that moves is a straight line in one variable: a curvature is the variable, a
//! pickup a multiple of it, the index of a model glass grows in proportion with nd.

use super::{Along, MeritError};
use crate::lens::glass::model_index;
use crate::lens::{
    Aperture, FieldKind, Lens, Medium, Object, Quantity, Shape, Surface, System, focus_gap,
};
use crate::paraxial::Beam;
use crate::pupil::{Aiming, Bench};
use crate::trace::{Gradient, Slot};
use nalgebra::DVector;

/// A number of a system that follows a variable: `offset + factor × variable`.
#[derive(Debug, Clone, Copy)]
struct Line {
    variable: usize,
    surface: usize,
    slot: Slot,
    factor: f64,
    offset: f64,
}

/// A lens at one zoom position: its systems, and which of their numbers follow the variables.
#[derive(Debug, Clone)]
pub(super) struct Zoom {
    pub(super) number: usize,
    pub(super) primary: usize,
    pub(super) object: Object,
    pub(super) field: FieldKind,
    /// Which gaps are glass.
    pub(super) glass: Vec<bool>,
    /// One for each wavelength.
    systems: Vec<System<f64>>,
    /// How the beam is limited.
    aperture: Aperture,
    lines: Vec<Vec<Line>>,
    /// The distance of the image plane from the paraxial focus, where the last gap is solved.
    focus: Option<f64>,
    variables: usize,
}

/// The systems of a zoom position at some values of the variables.
#[derive(Debug, Clone)]
pub(super) struct Systems {
    /// One for each wavelength, opened so that rims do not clip.
    pub(super) opened: Vec<System<f64>>,
    /// The same with their rims.
    pub(super) rimmed: Vec<System<f64>>,
    /// The derivative of the last gap by the variables where it is solved.
    focus: Option<DVector<f64>>,
}

impl Zoom {
    pub(super) fn new(lens: &Lens, number: usize) -> Result<Self, MeritError> {
        let aperture = lens.aperture_at(number);
        let mut systems = Vec::new();
        let mut lines = Vec::new();
        for wavelength in &lens.wavelengths {
            let mut system = lens.system(number, wavelength.um)?;
            if let (Some(stop), Aperture::StopSemiDiameter(radius)) = (system.stop, aperture) {
                system.surfaces[stop].semi_diameter = radius;
            }
            let found = lines_of(lens, number, wavelength.um, &mut system);
            lines.push(found);
            systems.push(system);
        }
        let glass = |i: usize| {
            let row = &lens.surfaces[i];
            match row.medium {
                Medium::Mirror => systems[0].surfaces[i].index != 1.0,
                Medium::Air => false,
                Medium::Glass(_)
                | Medium::Model { .. }
                | Medium::Index(_)
                | Medium::Gradient(_) => true,
            }
        };
        Ok(Self {
            number,
            primary: lens.primary(),
            object: lens.object,
            field: lens.fields_at(number).kind,
            glass: (0..lens.surfaces.len()).map(glass).collect(),
            aperture,
            focus: lens.focus,
            variables: lens.variables.len(),
            lines,
            systems,
        })
    }

    /// The systems at some values of the variables.
    pub(super) fn at(&self, values: &[f64]) -> Systems {
        let mut rimmed = self.systems.clone();
        for (system, lines) in rimmed.iter_mut().zip(&self.lines) {
            for line in lines {
                let number = line.offset + line.factor * values[line.variable];
                *line.slot.of(system, line.surface) = number;
            }
        }
        let mut found = Systems { opened: Vec::new(), rimmed, focus: None };
        if let Some(offset) = self.focus {
            self.solve_focus(&mut found, offset);
        }
        found.opened.clone_from(&found.rimmed);
        let surfaces = found.opened.iter_mut().flat_map(|system| &mut system.surfaces);
        surfaces.for_each(open_up);
        found
    }

    /// The lens with its rims, ready for rays; a stop whose semi-diameter is the aperture has it.
    pub(super) fn bench(
        &self,
        found: &Systems,
        lens: &Lens,
        aiming: Aiming,
    ) -> Result<Bench, MeritError> {
        let weighted = lens.wavelengths.iter().zip(&found.rimmed);
        let systems = weighted.map(|(w, system)| (w.um, w.weight, system.clone())).collect();
        let mut beam = Beam::of(lens, self.number);
        let primary = &found.rimmed[self.primary];
        if let (Some(stop), Aperture::StopSemiDiameter(_)) = (primary.stop, self.aperture) {
            beam.aperture = Aperture::StopSemiDiameter(primary.surfaces[stop].semi_diameter);
        }
        Ok(Bench::new(systems, self.primary, beam, aiming)?)
    }

    fn solve_focus(&self, found: &mut Systems, offset: f64) {
        let primary = &found.rimmed[self.primary];
        let gap = focus_gap(primary, self.object) + offset;
        let slope =
            |variable| focus_gap(&self.along_unfocused(primary, variable), self.object).slope[0];
        found.focus = Some(DVector::from_iterator(self.variables, (0..self.variables).map(slope)));
        for system in &mut found.rimmed {
            let last = system.surfaces.len() - 2;
            system.surfaces[last].thickness = gap;
        }
    }

    fn along_unfocused(&self, primary: &System<f64>, variable: usize) -> System<Along> {
        let mut system: System<Along> = primary.lift();
        for line in self.lines[self.primary].iter().filter(|line| line.variable == variable) {
            line.slot.of(&mut system, line.surface).slope[0] = line.factor;
        }
        system
    }

    /// The system at the primary wavelength with its derivative along one variable.
    pub(super) fn along(&self, found: &Systems, variable: usize) -> System<Along> {
        let mut system = self.along_unfocused(&found.rimmed[self.primary], variable);
        if let Some(focus) = &found.focus {
            let last = system.surfaces.len() - 2;
            system.surfaces[last].thickness.slope[0] = focus[variable];
        }
        system
    }

    /// The derivatives by the variables from those by the numbers of a system.
    pub(super) fn collect(
        &self,
        found: &Systems,
        wavelength: usize,
        gradient: &Gradient<f64>,
    ) -> DVector<f64> {
        let mut by_variable = DVector::zeros(self.variables);
        for line in &self.lines[wavelength] {
            let surface = &gradient.surfaces[line.surface];
            let by_number = match line.slot {
                Slot::Curvature => surface.curvature,
                Slot::Conic => surface.conic,
                Slot::Term(term) => surface.terms[term],
                Slot::Thickness => surface.thickness,
                Slot::Index => surface.index,
                Slot::SemiDiameter => surface.semi_diameter,
                Slot::Grade(k) => surface.grade[k],
            };
            by_variable[line.variable] += line.factor * by_number;
        }
        if let Some(focus) = &found.focus {
            let last = gradient.surfaces.len() - 2;
            by_variable.axpy(gradient.surfaces[last].thickness, focus, 1.0);
        }
        by_variable
    }

    /// The numbers of a system that some variable moves.
    pub(super) fn moving(&self, wavelength: usize) -> Vec<(Option<usize>, Slot)> {
        let mut moving = Vec::new();
        for line in &self.lines[wavelength] {
            let number = (Some(line.surface), line.slot);
            if !moving.contains(&number) {
                moving.push(number);
            }
        }
        let last = (Some(self.systems[wavelength].surfaces.len() - 2), Slot::Thickness);
        if self.focus.is_some() && !moving.contains(&last) {
            moving.push(last);
        }
        moving
    }

    /// The derivatives by the variables from those by the moving numbers.
    pub(super) fn collect_row(
        &self,
        found: &Systems,
        wavelength: usize,
        moving: &[(Option<usize>, Slot)],
        row: &[f64],
        by_variable: &mut [f64],
    ) {
        by_variable.fill(0.0);
        let by = |surface: usize, slot: Slot| {
            moving.iter().position(|m| *m == (Some(surface), slot)).map_or(0.0, |i| row[i])
        };
        for line in &self.lines[wavelength] {
            by_variable[line.variable] += line.factor * by(line.surface, line.slot);
        }
        if let Some(focus) = &found.focus {
            let last = self.systems[wavelength].surfaces.len() - 2;
            let by_gap = by(last, Slot::Thickness);
            by_variable.iter_mut().zip(focus.iter()).for_each(|(to, f)| *to += by_gap * f);
        }
    }
}

/// Rays may pass a rim or an obstruction by any amount while the lens moves, but an asphere ends not far behind its
/// own: outside, its polynomial means nothing, and rays may cross it several times.
fn open_up(surface: &mut Surface<f64>) {
    surface.obstruction = 0.0;
    surface.semi_diameter = match surface.shape {
        Shape::Asphere { .. } => BEYOND * surface.semi_diameter,
        Shape::Plane | Shape::Sphere { .. } | Shape::Conic { .. } => f64::INFINITY,
    };
}

/// How far an asphere goes on behind its rim.
const BEYOND: f64 = 1.2;

/// What follows the variables at a wavelength; the system is written in forms that have all these
/// numbers.
fn lines_of(lens: &Lens, zoom: usize, um: f64, system: &mut System<f64>) -> Vec<Line> {
    let mut lines = Vec::new();
    for (variable, free) in lens.variables.iter().enumerate() {
        let start = lens.get(free.parameter).unwrap_or(0.0);
        for (parameter, factor) in lens.followers(free.parameter) {
            let surface = parameter.surface;
            let own_gap = has_own_gap(lens, zoom, surface);
            let slot = match parameter.quantity {
                Quantity::Curvature => Slot::Curvature,
                Quantity::Conic => Slot::Conic,
                Quantity::Asphere(term) => Slot::Term(term),
                Quantity::Thickness if !own_gap => Slot::Thickness,
                Quantity::ZoomThickness(z) if z == zoom => Slot::Thickness,
                Quantity::Index => Slot::Index,
                Quantity::Gradient(k) => Slot::Grade(k),
                Quantity::SemiDiameter if !has_own_aperture(lens, zoom, surface) => {
                    Slot::SemiDiameter
                }
                Quantity::Thickness | Quantity::ZoomThickness(_) | Quantity::SemiDiameter => {
                    continue;
                }
            };
            let growth = if slot == Slot::Index { index_growth(lens, surface, um) } else { 1.0 };
            let factor = factor * growth;
            for surface in followers_of_index(lens, surface, slot) {
                if let Slot::Grade(_) = slot {
                    let graded = &mut system.surfaces[surface].graded;
                    *graded = graded.or_else(|| lens.grade(surface));
                }
                slot.widen(system, surface);
                let now = *slot.of(system, surface);
                let offset = if factor == 1.0 && now == start { 0.0 } else { now - factor * start };
                lines.push(Line { variable, surface, slot, factor, offset });
            }
        }
    }
    lines
}

fn has_own_gap(lens: &Lens, zoom: usize, surface: usize) -> bool {
    let position = lens.zoom.get(zoom);
    position.is_some_and(|p| p.thicknesses.iter().any(|gap| gap.surface == surface))
}

/// Whether the surface is the stop of a zoom position whose own aperture says how large it is.
fn has_own_aperture(lens: &Lens, zoom: usize, surface: usize) -> bool {
    lens.surfaces[surface].stop && lens.zoom.get(zoom).is_some_and(|z| z.aperture.is_some())
}

/// How fast the index of a gap grows with its nd.
fn index_growth(lens: &Lens, surface: usize, um: f64) -> f64 {
    let medium = match &lens.surfaces[surface].medium {
        Medium::Gradient(gradient) => &gradient.base,
        medium => medium,
    };
    match *medium {
        Medium::Model { vd, .. } => model_index(2.0, vd, um) - model_index(1.0, vd, um),
        _ => 1.0,
    }
}

/// The surface itself, and for an index the mirrors behind it, and the image plane, which keep it.
fn followers_of_index(lens: &Lens, surface: usize, slot: Slot) -> Vec<usize> {
    let mut all = vec![surface];
    if slot == Slot::Index {
        let mirrors =
            lens.surfaces[surface + 1..].iter().take_while(|r| r.medium == Medium::Mirror);
        all.extend((1..=mirrors.count()).map(|i| surface + i));
        if all.last() == Some(&(lens.surfaces.len() - 1)) {
            all.push(lens.surfaces.len());
        }
    }
    all
}
