//! Lets a surface become aspheric: its conic constant varies from now on, and then its coefficients of
//! r⁴ and r⁶.
//!
//! A number starts at 0, so that the lens and its merit are unchanged. That it varies is the mark by which
//! a surface counts as aspheric before it has left its sphere. An aspheric surface is priced as half an
//! element.

use super::distributions::choose;
use super::draft::{MutationContext, MutationDraft};
use super::queries::has_pickup;
use super::record::StructureChange;
use super::refusal::Refusal;
use crate::lens::{Lens, Medium, Parameter, Quantity, Variable};
use crate::search::element::piece_count;
use crate::search::{Random, SearchRules};

/// The numbers of an aspheric surface in the order in which they are added.
pub(super) const NUMBERS: [Quantity; 3] =
    [Quantity::Conic, Quantity::Asphere(0), Quantity::Asphere(1)];
/// The range of a conic constant.
const CONICS: [f64; 2] = [-30.0, 10.0];
/// `|curvature| × semi-diameter` below which a conic constant has no effect.
const FLAT: f64 = 1e-3;

/// The surfaces that are aspheric, or that may become so by a descent.
pub(in crate::search) fn aspheric_rows(lens: &Lens) -> Vec<usize> {
    (0..lens.surfaces.len()).filter(|row| is_aspheric(lens, *row)).collect()
}

/// True if a surface is neither a sphere nor a plane, or if an aspheric number of it varies.
pub(super) fn is_aspheric(lens: &Lens, row: usize) -> bool {
    let surface = &lens.surfaces[row];
    let is_conic = surface.conic != 0.0 && surface.curvature != 0.0;
    let has_terms = surface.asphere.iter().any(|term| *term != 0.0);
    is_conic || has_terms || NUMBERS.iter().any(|number| varies(lens, row, *number))
}

/// True if a number of a surface is a variable.
fn varies(lens: &Lens, row: usize, quantity: Quantity) -> bool {
    let variable = lens.variable(Parameter::new(row, quantity));
    variable.is_some_and(|variable| variable.min.is_none() || variable.min != variable.max)
}

/// The numbers that may vary in addition: of each surface the next one.
pub(in crate::search) fn sites(
    lens: &Lens,
    rules: &SearchRules,
) -> Result<Vec<Parameter>, Refusal> {
    let present = aspheric_rows(lens);
    // Half an element for each of them, the new one included.
    let price = 2 * piece_count(lens) + present.len() + 1;
    let is_full = present.len() >= rules.aspheres || price > 2 * rules.elements[1];
    if rules.aspheres == 0 {
        return Err(Refusal::TooManyAspheres);
    }
    let rows = lens.surfaces.len();
    let may = |row: &usize| {
        let is_free = rules.may_change(*row, rows) && refracts(lens, *row);
        let is_followed = has_pickup(lens, *row, |quantity| NUMBERS.contains(&quantity));
        is_free && !is_followed && (present.contains(row) || !is_full)
    };
    let next = |row: usize| {
        let known = |number: Quantity| lens.variable(Parameter::new(row, number)).is_some();
        let rim = lens.surfaces[row].semi_diameter.unwrap_or(1.0);
        let is_flat = (lens.surfaces[row].curvature * rim).abs() < FLAT;
        let useful = NUMBERS.into_iter().filter(|number| !is_flat || *number != Quantity::Conic);
        let number = useful.into_iter().find(|number| !known(*number))?;
        Some(Parameter::new(row, number))
    };
    let found: Vec<Parameter> = (0..rows).filter(may).filter_map(next).collect();
    match found.is_empty() {
        false => Ok(found),
        true if is_full => Err(Refusal::TooManyAspheres),
        true => Err(Refusal::NoSurfaceForAsphere),
    }
}

/// True if light is refracted or reflected at a surface.
fn refracts(lens: &Lens, row: usize) -> bool {
    let before = row.checked_sub(1).map_or(&lens.object_medium, |i| &lens.surfaces[i].medium);
    lens.surfaces[row].medium != *before || *before == Medium::Mirror
}

/// The lens with an aspheric number that varies.
pub(in crate::search) fn marked(lens: &Lens, parameter: Parameter) -> Lens {
    let mut lens = lens.clone();
    let [min, max] = match parameter.quantity {
        Quantity::Conic => CONICS.map(Some),
        _ => [None, None],
    };
    lens.variables.retain(|variable| variable.parameter != parameter);
    lens.variables.push(Variable { parameter, min, max });
    lens
}

/// Lets a number of a random surface vary.
pub(super) fn draw(
    context: &MutationContext<'_>,
    random: &mut Random,
) -> Result<MutationDraft, Refusal> {
    let sites = sites(&context.lens, context.rules)?;
    let parameter = choose(&sites, random).copied().ok_or(Refusal::NoSurfaceForAsphere)?;
    let mut draft = context.start_draft(sites.len());
    draft.lens = marked(&draft.lens, parameter);
    let Parameter { surface, quantity, .. } = parameter;
    draft.change = StructureChange::AddAsphere { surface: surface.into(), quantity };
    Ok(draft)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::blank;

    fn rules(aspheres: usize, most: usize) -> SearchRules {
        SearchRules { aspheres, elements: [1, most], ..SearchRules::default() }
    }

    /// The conic comes first, a plane has none, and each surface has one next number.
    #[test]
    fn numbers_are_added_in_order() {
        let mut lens = blank();
        lens.surfaces[0].curvature = 0.02;
        let first = sites(&lens, &rules(1, 8)).unwrap();
        assert_eq!(first[0], Parameter::new(0, Quantity::Conic));
        assert_eq!(first[1], Parameter::new(1, Quantity::Asphere(0)));
        let lens = marked(&lens, first[0]);
        assert_eq!(aspheric_rows(&lens), [0]);
        // No other surface may be aspheric, but this one may have another number.
        let second = sites(&lens, &rules(1, 8)).unwrap();
        assert_eq!(second, [Parameter::new(0, Quantity::Asphere(0))]);
        let lens = marked(&marked(&lens, second[0]), Parameter::new(0, Quantity::Asphere(1)));
        assert!(matches!(sites(&lens, &rules(1, 8)), Err(Refusal::TooManyAspheres)));
    }

    /// An aspheric surface costs half an element.
    #[test]
    fn aspheres_are_priced() {
        let lens = blank();
        assert!(matches!(sites(&lens, &rules(2, 1)), Err(Refusal::TooManyAspheres)));
        let one = marked(&lens, sites(&lens, &rules(4, 2)).unwrap()[0]);
        let two = marked(&one, sites(&one, &rules(4, 2)).unwrap()[1]);
        assert_eq!(aspheric_rows(&two).len(), 2);
        assert!(matches!(sites(&lens, &rules(0, 8)), Err(Refusal::TooManyAspheres)));
    }
}
