//! The multi-configuration table: each configuration is a zoom position.

use crate::files::error::ParseError;
use crate::files::report::{ConversionOutcome, ConversionReport};
use crate::files::vignetting::LEFT_OUT;
use crate::files::zemax::file::{ConfigurationOperand, FACTORS, ZemaxFile};
use crate::files::zemax::row_plan::RowPlan;
use crate::lens::{Aperture, FieldKind, Lens, Object, Parameter, Quantity, Variable, ZoomPosition};
use std::collections::BTreeMap;

/// Adds zoom positions to the lens, if the file has more than one configuration.
pub(super) fn add_positions(
    file: &ZemaxFile,
    plan: &RowPlan,
    lens: &mut Lens,
    names: &[String],
    report: &mut ConversionReport,
) -> Result<(), ParseError> {
    let is_factor = |own: &&ConfigurationOperand| FACTORS.contains(&own.name.as_str());
    file.operands.iter().filter(is_factor).for_each(|own| report_factor(own, report));
    if file.configurations < 2 {
        return Ok(());
    }
    check_complete(file)?;
    let name = |i: usize| names.get(i).cloned().unwrap_or_default();
    lens.zoom = (0..file.configurations)
        .map(|i| ZoomPosition { name: name(i), ..ZoomPosition::default() })
        .collect();
    for operand in &file.operands {
        if is_factor(&operand) {
            continue;
        }
        if let Err(why) = apply(file.unit, plan, lens, operand) {
            report.amend(operand.line, ConversionOutcome::Dropped, why);
        }
    }
    Ok(())
}

/// Reports a vignetting factor of a configuration; [`super::beam::vignetting`] reads them.
fn report_factor(operand: &ConfigurationOperand, report: &mut ConversionReport) {
    if operand.value == 0.0 {
        report.amend(operand.line, ConversionOutcome::Preserved, "");
    } else {
        report.amend(operand.line, ConversionOutcome::Dropped, LEFT_OUT);
    }
}

/// Refuses an operand without a value for each configuration.
fn check_complete(file: &ZemaxFile) -> Result<(), ParseError> {
    let mut values: BTreeMap<(&str, usize), (usize, usize)> = BTreeMap::new();
    for operand in &file.operands {
        let (count, line) = values.entry((&operand.name, operand.target)).or_default();
        (*count, *line) = (*count + 1, operand.line);
    }
    let configurations = file.configurations;
    for ((name, target), (count, line)) in values {
        if count < configurations {
            let found =
                format!("{count} values of {name} {target} for {configurations} configurations");
            let expected = "one for each; is the file truncated?".to_owned();
            return Err(ParseError { place: format!("line {line}"), found, expected });
        }
    }
    Ok(())
}

/// Writes one value into its zoom position; the error is the note of the report.
fn apply(
    unit: f64,
    plan: &RowPlan,
    lens: &mut Lens,
    operand: &ConfigurationOperand,
) -> Result<(), &'static str> {
    let zoom = operand.configuration - 1;
    match operand.name.as_str() {
        "THIC" => thickness(unit, plan, lens, operand),
        "APER" => aperture(unit, lens, operand),
        "CRVT" => of_surface(plan, lens, operand, (Quantity::Curvature, unit.recip())),
        "CONN" => of_surface(plan, lens, operand, (Quantity::Conic, 1.0)),
        "SDIA" => {
            let stop = lens.stop().is_some() && lens.stop() == plan.row(operand.target);
            if !(stop && matches!(lens.aperture, Aperture::StopSemiDiameter(_))) {
                return of_surface(plan, lens, operand, (Quantity::SemiDiameter, unit));
            }
            lens.zoom[zoom].aperture = Some(Aperture::StopSemiDiameter(operand.value * unit));
            Ok(())
        }
        _ => field(unit, lens, operand),
    }
}

fn thickness(
    unit: f64,
    plan: &RowPlan,
    lens: &mut Lens,
    operand: &ConfigurationOperand,
) -> Result<(), &'static str> {
    if operand.target == 0 {
        return Err("the object distance cannot change with the zoom position");
    }
    let Some(surface) = plan.gap(operand.target) else {
        return Err("there is no such gap, or it is part of a break of the axis");
    };
    if operand.value.abs() >= 1e10 {
        return Err("an infinite gap");
    }
    number(lens, operand, (surface, Quantity::Thickness), unit)
}

/// A number of a surface, whose unit is that of the file times a factor.
fn of_surface(
    plan: &RowPlan,
    lens: &mut Lens,
    operand: &ConfigurationOperand,
    (quantity, factor): (Quantity, f64),
) -> Result<(), &'static str> {
    let surface = plan.row(operand.target).ok_or("there is no such surface")?;
    number(lens, operand, (surface, quantity), factor)
}

fn number(
    lens: &mut Lens,
    operand: &ConfigurationOperand,
    (surface, quantity): (usize, Quantity),
    factor: f64,
) -> Result<(), &'static str> {
    let zoom = operand.configuration - 1;
    let parameter = Parameter::at_zoom(surface, quantity, zoom);
    if lens.is_own_at(zoom, surface, quantity) {
        return Err("a second value for this number; the first one is used");
    }
    if !lens.set(parameter, operand.value * factor) {
        return Err("the surface has no such number here");
    }
    if operand.variable {
        lens.variables.push(Variable { parameter, min: None, max: None });
    }
    Ok(())
}

/// The aperture at a zoom position, defined as that of the lens.
fn aperture(
    unit: f64,
    lens: &mut Lens,
    operand: &ConfigurationOperand,
) -> Result<(), &'static str> {
    let value = operand.value;
    if lens.object != Object::Infinity && matches!(lens.aperture, Aperture::FNumber(_)) {
        return Err("the f-number of a finite object cannot change with the zoom position");
    }
    if value <= 0.0 {
        return Err("an aperture of 0");
    }
    let aperture = match lens.aperture {
        Aperture::EntrancePupilDiameter(_) => Aperture::EntrancePupilDiameter(value * unit),
        Aperture::FNumber(_) => Aperture::FNumber(value),
        Aperture::ObjectNa(_) => Aperture::ObjectNa(value),
        Aperture::StopSemiDiameter(_) => return Err("the size of the stop is the aperture"),
    };
    lens.zoom[operand.configuration - 1].aperture = Some(aperture);
    Ok(())
}

fn field(unit: f64, lens: &mut Lens, operand: &ConfigurationOperand) -> Result<(), &'static str> {
    let position = &mut lens.zoom[operand.configuration - 1];
    let fields = position.fields.get_or_insert_with(|| lens.fields.clone());
    let scale = if fields.kind == FieldKind::Angle { 1.0 } else { unit };
    let axis = usize::from(operand.name == "YFIE");
    let number = operand.target.checked_sub(1);
    let is_set = number.is_some_and(|i| fields.set_projected(i, axis, operand.value * scale));
    if is_set { Ok(()) } else { Err("there is no such field") }
}
