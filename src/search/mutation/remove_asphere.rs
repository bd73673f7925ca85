//! Makes an aspheric surface spherical: its conic constant and its coefficients become 0 and vary no
//! longer.

use super::add_asphere::{NUMBERS, is_aspheric};
use super::distributions::choose;
use super::draft::{MutationContext, MutationDraft};
use super::queries::has_pickup;
use super::record::StructureChange;
use super::refusal::Refusal;
use crate::lens::{Lens, Quantity};
use crate::search::{Random, SearchRules};

/// The surfaces that may become spherical.
pub(super) fn sites(lens: &Lens, rules: &SearchRules) -> Result<Vec<usize>, Refusal> {
    let rows = lens.surfaces.len();
    let may = |row: &usize| {
        let is_followed = has_pickup(lens, *row, is_aspheric_number);
        rules.aspheres > 0
            && rules.may_change(*row, rows)
            && is_aspheric(lens, *row)
            && !is_followed
            && !is_fixed(lens, *row)
    };
    let found: Vec<usize> = (0..rows).filter(may).collect();
    if found.is_empty() { Err(Refusal::NoAsphere) } else { Ok(found) }
}

/// True if an aspheric number of a surface is a variable with equal bounds.
fn is_fixed(lens: &Lens, row: usize) -> bool {
    let mut variables = lens.variables.iter().filter(|v| v.parameter.surface == row);
    variables.any(|v| is_aspheric_number(v.parameter.quantity) && v.min.is_some() && v.min == v.max)
}

fn is_aspheric_number(quantity: Quantity) -> bool {
    NUMBERS.contains(&quantity) || matches!(quantity, Quantity::Asphere(_))
}

/// Makes a random aspheric surface spherical.
pub(super) fn draw(
    context: &MutationContext<'_>,
    random: &mut Random,
) -> Result<MutationDraft, Refusal> {
    let sites = sites(&context.lens, context.rules)?;
    let row = choose(&sites, random).copied().ok_or(Refusal::NoAsphere)?;
    let mut draft = context.start_draft(sites.len());
    let surface = &mut draft.lens.surfaces[row];
    surface.conic = 0.0;
    surface.asphere.clear();
    draft.drop_parameters(row, is_aspheric_number);
    draft.change = StructureChange::RemoveAsphere { surface: row.into() };
    Ok(draft)
}
