//! The zoom positions.

use crate::files::codev::file::{CodeVFile, ZoomCommand};
use crate::files::report::{ConversionOutcome, ConversionReport};
use crate::lens::{Aperture, Lens, Object, Parameter, Quantity, ZoomPosition};

/// Adds the zoom positions of the file to the lens.
pub(super) fn add_positions(file: &CodeVFile, lens: &mut Lens, report: &mut ConversionReport) {
    if file.positions < 2 {
        for command in &file.zoomed {
            drop_command(command, "the lens does not zoom", report);
        }
        return;
    }
    lens.zoom = vec![ZoomPosition::default(); file.positions];
    for command in &file.zoomed {
        let complete = command.values.len() == file.positions;
        let done = if complete {
            apply(command, super::unit(file), lens)
        } else {
            Err("not one value for each position")
        };
        if let Err(why) = done {
            drop_command(command, why, report);
        }
    }
}

fn drop_command(command: &ZoomCommand, why: &str, report: &mut ConversionReport) {
    report.rows[command.row].outcome = ConversionOutcome::Dropped;
    why.clone_into(&mut report.rows[command.row].note);
}

/// Writes the values of a command into the positions; the error is the note of the report.
fn apply(command: &ZoomCommand, unit: f64, lens: &mut Lens) -> Result<(), &'static str> {
    for (zoom, value) in command.values.iter().copied().enumerate() {
        match command.name.as_str() {
            "THI" => number(command.target, Quantity::Thickness, zoom, value * unit, lens)?,
            "CUY" => number(command.target, Quantity::Curvature, zoom, value / unit, lens)?,
            "RDY" => {
                let curvature = if value == 0.0 { 0.0 } else { (value * unit).recip() };
                number(command.target, Quantity::Curvature, zoom, curvature, lens)?;
            }
            "K" => number(command.target, Quantity::Conic, zoom, value, lens)?,
            "EPD" if value > 0.0 => {
                lens.zoom[zoom].aperture = Some(Aperture::EntrancePupilDiameter(value * unit));
            }
            "FNO" if value > 0.0 => lens.zoom[zoom].aperture = Some(Aperture::FNumber(value)),
            "NAO" if value > 0.0 && lens.object != Object::Infinity => {
                lens.zoom[zoom].aperture = Some(Aperture::ObjectNa(value));
            }
            "XAN" | "YAN" | "XOB" | "YOB" | "XIM" | "YIM" => {
                field(command, zoom, value, unit, lens)?;
            }
            name => {
                let term = name.len() == 1 && "ABCDEFG".contains(name);
                let term = term.then(|| usize::from(name.as_bytes()[0] - b'A'));
                let term = term.ok_or("this cannot differ between positions")?;
                let value = value / unit.powi(2 * term as i32 + 3);
                number(command.target, Quantity::Asphere(term), zoom, value, lens)?;
            }
        }
    }
    Ok(())
}

fn number(
    target: usize,
    quantity: Quantity,
    zoom: usize,
    value: f64,
    lens: &mut Lens,
) -> Result<(), &'static str> {
    let rows = lens.surfaces.len();
    let surface = target.checked_sub(1).filter(|surface| *surface < rows);
    let surface = surface.ok_or("there is no such surface")?;
    // The defocus of the image is part of the last gap.
    if surface + 1 == rows && quantity == Quantity::Thickness {
        return Err("the last gap is that of the lens");
    }
    if lens.is_own_at(zoom, surface, quantity) {
        return Err("a second value for this number; the first one is used");
    }
    let is_set = lens.set(Parameter::at_zoom(surface, quantity, zoom), value);
    if is_set { Ok(()) } else { Err("the surface has no such number") }
}

fn field(
    command: &ZoomCommand,
    zoom: usize,
    value: f64,
    unit: f64,
    lens: &mut Lens,
) -> Result<(), &'static str> {
    let position = &mut lens.zoom[zoom];
    let fields = position.fields.get_or_insert_with(|| lens.fields.clone());
    let scale = if command.name.ends_with("AN") { 1.0 } else { unit };
    let number = command.target.checked_sub(1);
    let point = number.and_then(|i| fields.values.get_mut(i)).ok_or("there is no such field")?;
    let along_x = command.name.starts_with('X');
    let coordinate = if along_x { &mut point.x } else { &mut point.y };
    *coordinate = value * scale;
    Ok(())
}
