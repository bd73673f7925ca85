//! Interpretation of the content of a sequence file as a lens.
//!
//! Surface 0 of the file is the object and the last one the image; surface k between them is row
//! k − 1 here. Lengths become millimetres.

mod aperture;
mod glass;
mod row;
mod zoom;

pub(in crate::files) use row::frames;

use super::file::{ApertureCommand, CodeVFile, CodeVSurface, FACTORS, ZoomCommand};
use crate::files::error::ParseError;
use crate::files::foreign_lens::ForeignLens;
use crate::files::report::{ConversionOutcome, ConversionReport};
use crate::files::vignetting::{PupilFactors, ZoomedFactors};
use crate::lens::{
    Aperture, FieldKind, FieldPoint, Fields, Lens, Medium, Object, Quantity, Wavelength,
    paraxial_image_distance,
};

/// Object distances from this on are infinite.
const INFINITE_DISTANCE: f64 = 1e10;

/// The unit of the wavelengths of a file, in µm.
const NANOMETRE: f64 = 1e-3;

/// The largest difference in mm between the solved image distance and the one of the file.
const FOCUS_TOLERANCE: f64 = 1e-4;

/// Builds the lens; the report receives everything that cannot be represented.
pub(super) fn build(file: &CodeVFile, report: &mut ConversionReport) -> Result<Lens, ParseError> {
    let whole = |found: &str, expected: &str| {
        let (found, expected) = (found.to_owned(), expected.to_owned());
        ParseError { place: "the whole file".to_owned(), found, expected }
    };
    if !file.is_complete || file.surfaces.len() < 3 {
        let expected = "SO, at least one S, and SI; is the file truncated?";
        return Err(whole("no complete list of surfaces", expected));
    }
    let object =
        object(file).ok_or_else(|| whole("an object at the first surface", "a distance"))?;
    let stop = file.stop.unwrap_or(1);
    if stop + 1 >= file.surfaces.len() {
        return Err(whole(&format!("the stop on surface {stop}"), "one of the surfaces"));
    }
    let mut lens = Lens {
        name: file.title.clone(),
        notes: file.notes.join("\n"),
        object,
        object_medium: object_medium(file, report),
        aperture: aperture(file, stop, object, report)?,
        fields: fields(file),
        wavelengths: wavelengths(file),
        ..crate::lens::blank()
    };
    lens.surfaces = row::rows(file, stop, report);
    zoom::add_positions(file, &mut lens, report);
    row::add_variables(file, &mut lens, report);
    Ok(lens)
}

/// The lens with its report, and the vignetting factors and apertures of the file.
pub(super) fn with_beam(file: &CodeVFile, lens: Lens, report: ConversionReport) -> ForeignLens {
    let image = file.surfaces.len() - 1;
    let has_aperture =
        |surface: &CodeVSurface| surface.clip.is_some() || surface.outline.half != [None; 2];
    let clips = file.surfaces[1..image].iter().map(has_aperture).collect();
    let factors = vignetting(file, lens.fields.values.len());
    ForeignLens { lens, report, factors, clips, automatic: Vec::new() }
}

/// The vignetting factors of the fields at every zoom position; empty without any in the file.
fn vignetting(file: &CodeVFile, fields: usize) -> ZoomedFactors {
    let zoomed = || {
        let is_factor = |own: &&ZoomCommand| FACTORS.contains(&own.name.as_str());
        file.zoomed.iter().filter(move |own| file.positions > 1 && is_factor(own))
    };
    if file.vignetting.iter().all(Vec::is_empty) && zoomed().next().is_none() {
        return Vec::new();
    }
    let at = |kind: usize, zoom: usize, field: usize| {
        let is_it = |own: &&ZoomCommand| own.name == FACTORS[kind] && own.target == field + 1;
        let own = zoomed().find(is_it).and_then(|own| own.values.get(zoom));
        let base = file.vignetting[kind].get(field);
        own.or(base).copied().unwrap_or(0.0)
    };
    let factors = |zoom, field| {
        let [ux, lx, uy, ly] = [0, 1, 2, 3].map(|kind| at(kind, zoom, field));
        let [dx, cx] = PupilFactors::of_edges(ux, lx);
        let [dy, cy] = PupilFactors::of_edges(uy, ly);
        PupilFactors { decenter: [dx, dy], compression: [cx, cy], angle: 0.0 }
    };
    let position = |zoom| (0..fields).map(|field| factors(zoom, field)).collect();
    (0..file.positions.max(1)).map(position).collect()
}

/// Millimetres per unit.
fn unit(file: &CodeVFile) -> f64 {
    file.unit.unwrap_or(1.0)
}

fn object(file: &CodeVFile) -> Option<Object> {
    let distance = file.surfaces[0].thickness;
    if distance.abs() >= INFINITE_DISTANCE {
        return Some(Object::Infinity);
    }
    (distance != 0.0).then_some(Object::Finite(distance * unit(file)))
}

fn object_medium(file: &CodeVFile, report: &mut ConversionReport) -> Medium {
    let imported = glass::medium(file, 0);
    match imported.medium {
        Medium::Mirror => {
            let row = &mut report.rows[file.surfaces[0].row];
            row.outcome = ConversionOutcome::Dropped;
            "the object cannot be a mirror".clone_into(&mut row.note);
            Medium::Air
        }
        medium => medium,
    }
}

fn aperture(
    file: &CodeVFile,
    stop: usize,
    object: Object,
    report: &mut ConversionReport,
) -> Result<Aperture, ParseError> {
    Ok(match file.aperture {
        Some(ApertureCommand::Diameter(v)) => Aperture::EntrancePupilDiameter(v * unit(file)),
        Some(ApertureCommand::FNumber(v)) => Aperture::FNumber(v),
        // n' sin u' is the paraxial n' u' there.
        Some(ApertureCommand::ImageNa(v)) => Aperture::FNumber(0.5 / v),
        Some(ApertureCommand::ObjectNa(v)) if object != Object::Infinity => Aperture::ObjectNa(v),
        _ => {
            let Some(radius) = file.surfaces[stop].clip.filter(|radius| *radius > 0.0) else {
                let (found, place) = ("no aperture".to_owned(), "the whole file".to_owned());
                let expected = "EPD, FNO, NA, or NAO for a finite object".to_owned();
                return Err(ParseError { place, found, expected });
            };
            let note = "no aperture in the file: the stop is as wide as its CIR";
            report.add(ConversionOutcome::Approximated, "EPD", note);
            Aperture::StopSemiDiameter(radius * unit(file))
        }
    })
}

fn fields(file: &CodeVFile) -> Fields {
    let kind = file.field_kind.unwrap_or(FieldKind::Angle);
    let scale = if kind == FieldKind::Angle { 1.0 } else { unit(file) };
    let count = file.fields_x.len().max(file.fields_y.len()).max(1);
    let at = |values: &[f64], i: usize, otherwise: f64| values.get(i).copied().unwrap_or(otherwise);
    let point = |i| {
        let [x, y] = [&file.fields_x, &file.fields_y].map(|values| at(values, i, 0.0) * scale);
        let weight = at(&file.field_weights, i, 1.0);
        match kind {
            FieldKind::Angle => FieldPoint::from_projected_angles([x, y], weight),
            FieldKind::ObjectHeight | FieldKind::ImageHeight => FieldPoint { x, y, weight },
        }
    };
    Fields { kind, values: (0..count).map(point).collect() }
}

fn wavelengths(file: &CodeVFile) -> Vec<Wavelength> {
    let given: &[f64] = if file.waves_nm.is_empty() { &[587.5618] } else { &file.waves_nm };
    let wave = |(i, nm): (usize, &f64)| Wavelength {
        um: nm * NANOMETRE,
        weight: file.wave_weights.get(i).copied().unwrap_or(1.0),
        primary: file.reference == Some(i + 1),
    };
    given.iter().enumerate().map(wave).collect()
}

/// Makes the last gap follow the paraxial focus, if the file says so and its own gap is that one.
pub(super) fn solve_focus(file: &CodeVFile, lens: &mut Lens, report: &mut ConversionReport) {
    let Some(row) = file.focus else { return };
    let defocus = row::defocus(file);
    let written = lens.surfaces.last().map_or(0.0, |row| row.thickness);
    let system = lens.resolve(0, lens.wavelengths[lens.primary()].um);
    let solved = system.ok().map(|system| paraxial_image_distance(&system, lens.object) + defocus);
    let is_zoomed = lens.is_zoomed(lens.surfaces.len() - 1, Quantity::Thickness);
    if solved.is_some_and(|gap| (gap - written).abs() <= FOCUS_TOLERANCE) && !is_zoomed {
        lens.image_solve = Some(defocus);
        let last = lens.surfaces.last_mut();
        last.into_iter().for_each(|row| row.thickness = solved.unwrap_or(written));
    } else {
        let note = "the image distance of the file is used: it is not the paraxial one here";
        report.rows[row].outcome = ConversionOutcome::Approximated;
        note.clone_into(&mut report.rows[row].note);
    }
}
