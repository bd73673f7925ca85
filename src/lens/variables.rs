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
    let gap = matches!(parameter.quantity, Quantity::Thickness | Quantity::ZoomThickness(_));
    lens.image_solve.is_some() && gap && parameter.surface + 1 == lens.surfaces.len()
}

fn parameters(lens: &Lens, kind: ParameterKind) -> Vec<Parameter> {
    let rows = 0..lens.surfaces.len();
    let all = |quantity: Quantity| rows.clone().map(move |i| Parameter::new(i, quantity));
    match kind {
        ParameterKind::Curvatures => {
            all(Quantity::Curvature).filter(|p| refracts(lens, p.surface)).collect()
        }
        ParameterKind::Thicknesses => {
            rows.flat_map(|surface| thickness_parameters(lens, surface)).collect()
        }
        ParameterKind::Conics => {
            all(Quantity::Conic).filter(|p| lens.surfaces[p.surface].conic != 0.0).collect()
        }
        ParameterKind::Aspheres => rows
            .flat_map(|i| asphere_quantities(&lens.surfaces[i]).map(move |term| (i, term)))
            .map(|(i, quantity)| Parameter::new(i, quantity))
            .collect(),
        ParameterKind::Indices => all(Quantity::Index).collect(),
        ParameterKind::SemiDiameters => all(Quantity::SemiDiameter).collect(),
        ParameterKind::GrinCoefficients => {
            rows.flat_map(|surface| grin_parameters(lens, surface)).collect()
        }
    }
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

/// The GRIN coefficients behind a surface.
fn grin_parameters(lens: &Lens, surface: usize) -> Vec<Parameter> {
    let Medium::Grin(grin) = &lens.surfaces[surface].medium else { return Vec::new() };
    grin.written_terms().map(|k| Parameter::new(surface, Quantity::Grin(k))).collect()
}

/// The thickness parameters of a gap: the common one, and those of zoom positions that differ.
fn thickness_parameters(lens: &Lens, surface: usize) -> Vec<Parameter> {
    let own = |zoom: &usize| lens.zoom[*zoom].thicknesses.iter().any(|gap| gap.surface == surface);
    let moving: Vec<usize> = (0..lens.zoom.len()).filter(own).collect();
    let fixed = moving.len() < lens.zoom_positions();
    let fixed = fixed.then_some(Parameter::new(surface, Quantity::Thickness));
    let own = moving.iter().map(|z| Parameter::new(surface, Quantity::ZoomThickness(*z)));
    fixed.into_iter().chain(own).collect()
}

/// The lens at one of its zoom positions, as a lens with a fixed focal length.
pub fn at_zoom(lens: &Lens, zoom: usize) -> Lens {
    let mut single = lens.clone();
    single.zoom.clear();
    single.fields = lens.fields_at(zoom).clone();
    single.aperture = lens.aperture_at(zoom);
    for (i, row) in single.surfaces.iter_mut().enumerate() {
        row.thickness = lens.thickness_at(i, zoom).unwrap_or(row.thickness);
    }
    // A pickup to or from a thickness of another position is dropped.
    let here = |parameter: Parameter| match parameter.quantity {
        Quantity::ZoomThickness(z) if z == zoom => {
            Some(Parameter::new(parameter.surface, Quantity::Thickness))
        }
        Quantity::ZoomThickness(_) => None,
        _ => Some(parameter),
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
    single.variables.retain(|v| !matches!(v.parameter.quantity, Quantity::ZoomThickness(_)));
    single
}
