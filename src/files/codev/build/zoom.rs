//! The zoom positions.

use crate::files::codev::file::{CodeVFile, FACTORS, ZoomCommand};
use crate::files::report::{ConversionOutcome, ConversionReport};
use crate::files::vignetting::LEFT_OUT;
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
    // The displacement of the image belongs to the last gap, which has to be there before it.
    let (image, others): (Vec<_>, Vec<_>) =
        file.zoomed.iter().partition(|command| is_image_gap(command, lens));
    for command in others.into_iter().chain(image) {
        let complete = command.values.len() == file.positions;
        let done = match FACTORS.contains(&command.name.as_str()) {
            _ if !complete => Err("not one value for each position"),
            true if command.values.iter().all(|value| *value == 0.0) => Ok(()),
            true => Err(LEFT_OUT),
            false => apply(file, command, lens),
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

/// True for a surface with one behind it that has the place of another.
fn is_in_front_of_a_place(file: &CodeVFile, surface: usize) -> bool {
    file.surfaces.iter().skip(surface + 1).any(|behind| behind.reference.is_some())
}

/// True for the displacement of the image plane behind the last gap.
fn is_image_gap(command: &ZoomCommand, lens: &Lens) -> bool {
    command.name == "THI" && command.target == lens.surfaces.len() + 1
}

/// The gap in front of the image at a position, in mm: `value` is that of the last surface, or the
/// displacement of the image behind it.
fn image_gap(
    file: &CodeVFile,
    command: &ZoomCommand,
    zoom: usize,
    value: f64,
    lens: &mut Lens,
) -> Result<(), &'static str> {
    if !super::row::has_centred_image(file) {
        return Err("the gap in front of a tilted image is that of the lens");
    }
    let last = lens.surfaces.len() - 1;
    let defocus = super::row::defocus(file);
    if is_image_gap(command, lens) {
        let present = lens.thickness_at(last, zoom).unwrap_or_default();
        lens.zoom[zoom].set_number(last, Quantity::Thickness, present - defocus + value);
        return Ok(());
    }
    number(command.target, Quantity::Thickness, zoom, value + defocus, lens)
}

/// Writes the values of a command into the positions; the error is the note of the report.
fn apply(file: &CodeVFile, command: &ZoomCommand, lens: &mut Lens) -> Result<(), &'static str> {
    let unit = super::unit(file);
    for (zoom, value) in command.values.iter().copied().enumerate() {
        match command.name.as_str() {
            "THI" if is_in_front_of_a_place(file, command.target) => {
                return Err("a surface behind stands where another one does");
            }
            "THI" if command.target >= lens.surfaces.len() => {
                image_gap(file, command, zoom, value * unit, lens)?;
            }
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
    let axis = usize::from(command.name.starts_with('Y'));
    let number = command.target.checked_sub(1);
    let is_set = number.is_some_and(|i| fields.set_projected(i, axis, value * scale));
    if is_set { Ok(()) } else { Err("there is no such field") }
}
