//! Choosing the variables of a lens, and reducing a zoom lens to one position.

use super::{Lens, Medium, Parameter, Pickup, Quantity, Row, Variable};

/// A kind of parameter that an optimizer may change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ParameterKind {
    /// The curvature of every surface that refracts or reflects.
    Curvatures,
    /// Every thickness; separately at each zoom position at which it differs.
    Thicknesses,
    /// Every conic constant that is not 0.
    Conics,
    /// Every asphere coefficient and every number of a freeform that is written in the prescription.
    Aspheres,
    /// Every index of a model glass or constant medium.
    Indices,
    /// Every semi-diameter that is written in the prescription.
    SemiDiameters,
    /// Every GRIN coefficient that is written in the prescription.
    GrinCoefficients,
}

/// Makes every parameter of the given kinds a variable, as [`add_variable`] does; existing variables
/// keep their bounds.
pub fn add_variables(lens: &mut Lens, kinds: &[ParameterKind]) {
    let chosen: Vec<Parameter> = kinds.iter().flat_map(|kind| parameters(lens, *kind)).collect();
    for parameter in chosen {
        add_variable(lens, parameter);
    }
}

/// Makes a parameter a variable without bounds; an existing variable keeps its bounds. Returns
/// `false` if the parameter follows a pickup, is solved or does not exist.
pub fn add_variable(lens: &mut Lens, parameter: Parameter) -> bool {
    let follows = lens.pickups.iter().any(|pickup| pickup.parameter == parameter);
    if follows || is_solved(lens, parameter) || lens.get(parameter).is_none() {
        return false;
    }
    if lens.variable(parameter).is_none() {
        lens.variables.push(Variable { parameter, min: None, max: None });
    }
    true
}

/// True for the last thickness of a lens with an image solve.
fn is_solved(lens: &Lens, parameter: Parameter) -> bool {
    let is_gap = parameter.quantity == Quantity::Thickness;
    lens.image_solve.is_some() && is_gap && parameter.surface + 1 == lens.surfaces.len()
}

fn parameters(lens: &Lens, kind: ParameterKind) -> Vec<Parameter> {
    let rows = 0..lens.surfaces.len();
    let row = |i: usize| &lens.surfaces[i];
    let of_rows = |quantity: Quantity| rows.clone().map(move |i| (i, quantity));
    let written: Vec<(usize, Quantity)> = match kind {
        ParameterKind::Curvatures => {
            of_rows(Quantity::Curvature).filter(|(i, _)| refracts(lens, *i)).collect()
        }
        ParameterKind::Thicknesses => of_rows(Quantity::Thickness).collect(),
        ParameterKind::Conics => {
            of_rows(Quantity::Conic).filter(|(i, _)| row(*i).conic != 0.0).collect()
        }
        ParameterKind::Aspheres => rows
            .flat_map(|i| asphere_quantities(row(i)).map(move |quantity| (i, quantity)))
            .collect(),
        ParameterKind::Indices => of_rows(Quantity::Index).collect(),
        ParameterKind::SemiDiameters => of_rows(Quantity::SemiDiameter).collect(),
        ParameterKind::GrinCoefficients => rows
            .flat_map(|i| grin_quantities(row(i)).into_iter().map(move |quantity| (i, quantity)))
            .collect(),
    };
    written.into_iter().flat_map(|(i, quantity)| at_all_positions(lens, i, quantity)).collect()
}

/// True if light changes its direction at a surface.
fn refracts(lens: &Lens, surface: usize) -> bool {
    let before = match surface.checked_sub(1) {
        Some(before) => &lens.surfaces[before].medium,
        None => &lens.object_medium,
    };
    let behind = &lens.surfaces[surface].medium;
    // An axial profile starts anew behind each surface.
    let starts = matches!(behind, Medium::Grin(grin) if grin.is_axial());
    *behind == Medium::Mirror || before != behind || starts
}

/// The coefficients of the sag beside the conic that are written.
fn asphere_quantities(row: &Row) -> impl Iterator<Item = Quantity> + use<> {
    let numbers = row.freeform.as_ref().map_or(0, |form| form.numbers.len());
    let terms = (0..row.asphere.len()).map(Quantity::Asphere);
    terms.chain((0..numbers).map(Quantity::Freeform))
}

/// The GRIN coefficients behind a surface that are written.
fn grin_quantities(row: &Row) -> Vec<Quantity> {
    let Medium::Grin(grin) = &row.medium else { return Vec::new() };
    grin.written_terms().map(Quantity::Grin).collect()
}

/// The parameters of a quantity: the common one, and those of zoom positions with numbers of their
/// own.
fn at_all_positions(lens: &Lens, surface: usize, quantity: Quantity) -> Vec<Parameter> {
    let is_own = |zoom: &usize| lens.is_own_at(*zoom, surface, quantity);
    let own: Vec<usize> = (0..lens.zoom.len()).filter(is_own).collect();
    let common = (own.len() < lens.zoom_positions()).then_some(Parameter::new(surface, quantity));
    let own = own.into_iter().map(|zoom| Parameter::at_zoom(surface, quantity, zoom));
    common.into_iter().chain(own).collect()
}

/// The lens at one of its zoom positions, as a lens with a fixed focal length.
pub fn at_zoom(lens: &Lens, zoom: usize) -> Lens {
    let mut single = lens.with_pickups().unwrap_or_else(|_| lens.clone());
    single.take_numbers_of(zoom);
    single.zoom.clear();
    single.fields = lens.fields_at(zoom).clone();
    single.aperture = lens.aperture_at(zoom);
    // A pickup to or from a number that is not that of this position is dropped.
    let here = |parameter: Parameter| {
        let Parameter { surface, quantity, zoom: at } = parameter;
        let is_own = lens.is_own_at(zoom, surface, quantity);
        let holds = at.map_or(!is_own, |other| other == zoom);
        holds.then_some(Parameter::new(surface, quantity))
    };
    single.pickups = lens
        .pickups
        .iter()
        .filter_map(|pickup| {
            let (parameter, source) = (here(pickup.parameter)?, here(pickup.source)?);
            Some(Pickup { parameter, source, ..*pickup })
        })
        .collect();
    if let Some(goal) = &mut single.merit {
        goal.restrict_to_zoom(zoom);
    }
    single.variables.retain(|v| v.parameter.zoom.is_none());
    single
}
