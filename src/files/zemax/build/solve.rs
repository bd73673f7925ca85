//! Variables, pickups and the focus solve.

use crate::files::report::{ConversionOutcome, ConversionReport};
use crate::files::zemax::file::{CurvatureSolve, PickupLine, ZemaxFile, ZemaxSurface};
use crate::files::zemax::freeform;
use crate::files::zemax::gradient;
use crate::files::zemax::row_plan::RowPlan;
use crate::lens::{Lens, Parameter, Pickup, Quantity, Variable};

/// Adds variables, pickups and the focus solve to the lens.
pub(super) fn add_solves(
    file: &ZemaxFile,
    plan: &RowPlan,
    lens: &mut Lens,
    report: &mut ConversionReport,
) {
    for (row, planned) in plan.rows.iter().enumerate() {
        let surface = &file.surfaces[planned.surface];
        add_focus_solve(&file.surfaces[planned.gap], row, lens, report);
        match surface.curvature_solve {
            CurvatureSolve::Fixed => {}
            CurvatureSolve::Variable => add_variable(lens, row, Quantity::Curvature),
            CurvatureSolve::Pickup(line) => {
                let offset = line.offset / file.unit;
                let parameter = Parameter::new(row, Quantity::Curvature);
                let source = plan.row(line.surface);
                add_pickup(lens, parameter, source, PickupLine { offset, ..line }, report);
            }
        }
        thickness(file, plan, row, lens, report);
        if surface.variable_conic.is_some() {
            add_variable(lens, row, Quantity::Conic);
        }
        terms(surface, row, lens, report);
        if surface.glass.as_ref().is_some_and(|glass| glass.variable_index) {
            add_variable(lens, row, Quantity::Index);
        }
    }
}

/// A marginal ray height of 0 at the image is the focus solve; other height solves keep their present
/// value.
fn add_focus_solve(
    surface: &ZemaxSurface,
    row: usize,
    lens: &mut Lens,
    report: &mut ConversionReport,
) {
    let Some((height, zone, line)) = surface.marginal_height else { return };
    if row + 1 == lens.surfaces.len() && height == 0.0 && zone == 0.0 {
        lens.image_solve = Some(0.0);
        report.amend(
            line,
            ConversionOutcome::Used,
            "the last gap is solved for the paraxial focus",
        );
    } else {
        let note =
            "only the paraxial focus of the last gap can be solved; the present value is used";
        report.amend(line, ConversionOutcome::Approximated, note);
    }
}

/// Adds a variable, if the lens has the number and it is not a variable already.
fn add_variable(lens: &mut Lens, surface: usize, quantity: Quantity) {
    let parameter = Parameter::new(surface, quantity);
    if lens.get(parameter).is_some() && lens.variable(parameter).is_none() {
        lens.variables.push(Variable { parameter, min: None, max: None });
    }
}

fn thickness(
    file: &ZemaxFile,
    plan: &RowPlan,
    row: usize,
    lens: &mut Lens,
    report: &mut ConversionReport,
) {
    let surface = &file.surfaces[plan.rows[row].gap];
    let solved = lens.image_solve.is_some() && row + 1 == lens.surfaces.len();
    if solved {
        let pickup = surface.thickness_pickup.map(|pickup| pickup.line);
        let variable = surface.variable_thickness.map(|(.., line)| line);
        for line in pickup.into_iter().chain(variable) {
            report.amend(line, ConversionOutcome::Dropped, "the gap is solved for the focus");
        }
        return;
    }
    if let Some(line) = surface.thickness_pickup {
        let offset = line.offset * file.unit;
        let parameter = Parameter::new(row, Quantity::Thickness);
        add_pickup(lens, parameter, plan.gap(line.surface), PickupLine { offset, ..line }, report);
        return;
    }
    let Some((low, high, line)) = surface.variable_thickness else { return };
    add_variable(lens, row, Quantity::Thickness);
    let (low, high) = (low * file.unit, high * file.unit);
    let value = lens.surfaces[row].thickness;
    if low < high && (low..=high).contains(&value) {
        if let Some(variable) = lens.variables.last_mut() {
            (variable.min, variable.max) = (Some(low), Some(high));
        }
    } else if (low, high) != (0.0, 0.0) {
        report.amend(line, ConversionOutcome::Approximated, "variable, without its bounds");
    }
}

/// Adds the variable parameters: parameter i of an even asphere is the coefficient of r^(2i).
fn terms(surface: &ZemaxSurface, row: usize, lens: &mut Lens, report: &mut ConversionReport) {
    for &(index, line) in &surface.variable_parameters {
        if surface.kind.0 == "EVENASPH" && (2..=8).contains(&index) {
            add_variable(lens, row, Quantity::Asphere(index - 2));
        } else if let Some(number) = freeform::varied_number(&surface.kind.0, index)
            .filter(|number| lens.get(Parameter::new(row, Quantity::Freeform(*number))).is_some())
        {
            add_variable(lens, row, Quantity::Freeform(number));
        } else if let Some(quantity) = gradient::variable_quantity(&surface.kind.0, index) {
            add_variable(lens, row, quantity);
        } else {
            report.amend(line, ConversionOutcome::Dropped, "this parameter cannot be a variable");
        }
    }
}

/// Adds a pickup if it yields the present value; else the present value is used.
fn add_pickup(
    lens: &mut Lens,
    parameter: Parameter,
    source: Option<usize>,
    line: PickupLine,
    report: &mut ConversionReport,
) {
    let source = source.map(|surface| Parameter { surface, ..parameter });
    let found = source.and_then(|source| lens.get(source).map(|value| (source, value)));
    let present = lens.get(parameter).unwrap_or(0.0);
    match found {
        Some((source, value)) if source != parameter => {
            let (scale, offset) = (line.scale, line.offset);
            let given = offset + scale * value;
            if (given - present).abs() <= 1e-9 * present.abs().max(given.abs()) {
                lens.pickups.push(Pickup { parameter, source, scale, offset });
            } else {
                let note =
                    format!("the pickup yields {given}, the file has {present}, which is used");
                report.amend(line.line, ConversionOutcome::Approximated, note);
            }
        }
        _ => {
            let note = "a pickup from a surface that does not exist; the present value is used";
            report.amend(line.line, ConversionOutcome::Approximated, note);
        }
    }
}
