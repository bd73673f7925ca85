//! The zoom positions.

use crate::files::codev::file::{CodeVFile, ZoomCommand};
use crate::files::report::{ConversionOutcome, ConversionReport};
use crate::lens::{Aperture, Lens, Object, ZoomPosition, ZoomThickness};

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
            "THI" => thickness(command.target, zoom, value * unit, lens)?,
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
            _ => return Err("only thicknesses, aperture and fields can differ between positions"),
        }
    }
    Ok(())
}

fn thickness(target: usize, zoom: usize, value: f64, lens: &mut Lens) -> Result<(), &'static str> {
    let rows = lens.surfaces.len();
    let surface = target.checked_sub(1).filter(|surface| *surface < rows);
    let surface = surface.ok_or("there is no such gap")?;
    // The defocus of the image is part of the last gap.
    if surface + 1 == rows {
        return Err("the last gap is that of the lens");
    }
    let gaps = &mut lens.zoom[zoom].thicknesses;
    if gaps.iter().any(|gap| gap.surface == surface) {
        return Err("a second value for this gap; the first one is used");
    }
    gaps.push(ZoomThickness { surface, thickness: value });
    Ok(())
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
