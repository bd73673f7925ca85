//! Which numbers of a lens are free.

use super::{Lens, Medium, Parameter, Pickup, Quantity, Variable};

/// A kind of number that an optimizer may change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ParameterKind {
    /// Every curvature with a medium of its own behind it.
    Curvatures,
    /// Every gap, at each zoom position by itself where it moves.
    Thicknesses,
    /// Every conic constant that is not 0.
    Conics,
    /// Every asphere coefficient that is written.
    Aspheres,
    /// Every index of a model glass or constant medium.
    Indices,
    /// Every semi-diameter that is written.
    SemiDiameters,
    /// Every coefficient of a gradient that is written.
    GrinCoefficients,
}

/// Frees every number of some kinds that does not follow another one; what is a variable already
/// keeps its bounds.
pub fn add_variables(lens: &mut Lens, kinds: &[ParameterKind]) {
    let chosen: Vec<Parameter> = kinds.iter().flat_map(|kind| parameters(lens, *kind)).collect();
    for parameter in chosen {
        add_variable(lens, parameter);
    }
}

/// Makes a number a variable, unless it is one, follows another number or does not exist.
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

/// Whether it is the last gap and the focus decides it.
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
            .flat_map(|i| (0..lens.surfaces[i].asphere.len()).map(move |term| (i, term)))
            .map(|(i, term)| Parameter::new(i, Quantity::Asphere(term)))
            .collect(),
        ParameterKind::Indices => all(Quantity::Index).collect(),
        ParameterKind::SemiDiameters => all(Quantity::SemiDiameter).collect(),
        ParameterKind::GrinCoefficients => {
            rows.flat_map(|surface| grin_parameters(lens, surface)).collect()
        }
    }
}

/// Whether light changes its direction at a surface.
fn refracts(lens: &Lens, surface: usize) -> bool {
    let before = match surface.checked_sub(1) {
        Some(before) => &lens.surfaces[before].medium,
        None => &lens.object_medium,
    };
    let behind = &lens.surfaces[surface].medium;
    // A gradient along the axis begins anew behind each surface.
    let starts = matches!(behind, Medium::Grin(gradient) if gradient.is_axial());
    *behind == Medium::Mirror || before != behind || starts
}

/// The coefficients of the gradient behind a surface.
fn grin_parameters(lens: &Lens, surface: usize) -> Vec<Parameter> {
    let Medium::Grin(gradient) = &lens.surfaces[surface].medium else { return Vec::new() };
    gradient.written_terms().map(|k| Parameter::new(surface, Quantity::Gradient(k))).collect()
}

/// The numbers that say how wide a gap is: one, or one for each zoom position.
fn thickness_parameters(lens: &Lens, surface: usize) -> Vec<Parameter> {
    let own = |zoom: &usize| lens.zoom[*zoom].thicknesses.iter().any(|gap| gap.surface == surface);
    let moving: Vec<usize> = (0..lens.zoom.len()).filter(own).collect();
    let fixed = moving.len() < lens.zoom_positions();
    let fixed = fixed.then_some(Parameter::new(surface, Quantity::Thickness));
    let own = moving.iter().map(|z| Parameter::new(surface, Quantity::ZoomThickness(*z)));
    fixed.into_iter().chain(own).collect()
}

/// The lens at one of its zoom positions, as if it had no others.
pub fn at_zoom(lens: &Lens, zoom: usize) -> Lens {
    let mut single = lens.clone();
    single.zoom.clear();
    single.fields = lens.fields_at(zoom).clone();
    single.aperture = lens.aperture_at(zoom);
    for (i, row) in single.surfaces.iter_mut().enumerate() {
        row.thickness = lens.thickness_at(i, zoom).unwrap_or(row.thickness);
    }
    // What follows a gap of another position, or is followed by one, keeps its value.
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
    single.variables.retain(|v| !matches!(v.parameter.quantity, Quantity::ZoomThickness(_)));
    single
}
