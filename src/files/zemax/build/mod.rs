//! Interpretation of the content of a file as a lens.
//!
//! Surface 0 of the file is the object and the last one the image; surface k between them is row
//! k − 1 here. Lengths become millimetres.

mod aperture;
mod beam;
mod row;
mod solve;
mod zoom;

use super::file::{ZemaxFile, ZemaxSurface};
use super::row_plan::{RowPlan, is_break};
use super::{glass, gradient, tolerance};
use crate::files::error::ParseError;
use crate::files::foreign_lens::ForeignLens;
use crate::files::report::{ConversionOutcome, ConversionReport};
use crate::lens::{Environment, Lens, Medium, Object, Row};

/// Builds the lens; the report receives everything that cannot be represented.
pub(super) fn build(file: &ZemaxFile, report: &mut ConversionReport) -> Result<Lens, ParseError> {
    check_complete(file)?;
    let plan = RowPlan::new(&file.surfaces);
    report_breaks(file, report);
    let stop = stop(file, &plan, report)?;
    let object = object(file)?;
    let object_medium = object_medium(file, report)?;
    let surfaces = rows(file, &plan, stop, report)?;
    let aperture = beam::aperture(file, stop, &object_medium)?;
    let (name, source, notes, zoom_names) = split_notes(file);
    let mut lens = Lens {
        name,
        source,
        notes,
        object,
        object_medium,
        aperture,
        fields: beam::fields(file)?,
        wavelengths: beam::wavelengths(file, report)?,
        surfaces,
        zoom: Vec::new(),
        variables: Vec::new(),
        pickups: Vec::new(),
        image_solve: None,
        environment: Environment::default(),
        merit: None,
        tolerances: None,
    };
    report_image(file, report);
    zoom::add_positions(file, &plan, &mut lens, &zoom_names, report)?;
    solve::add_solves(file, &plan, &mut lens, report);
    beam::infinite_f_number(file, &mut lens, report);
    lens.tolerances = tolerance::sheet(file, &plan, &lens, report);
    Ok(lens)
}

/// The lens with its report, the vignetting factors of the file, and its semi-diameters.
pub(super) fn with_beam(file: &ZemaxFile, lens: Lens, report: ConversionReport) -> ForeignLens {
    let plan = RowPlan::new(&file.surfaces);
    let surfaces = || plan.rows.iter().map(|row| &file.surfaces[row.surface]);
    let has_aperture = |surface: &ZemaxSurface| surface.clip.is_some() || surface.outline.is_some();
    let clips = surfaces().map(has_aperture).collect();
    let computed = |(i, surface): (usize, &ZemaxSurface)| {
        let given = surface.semi_diameter.filter(|given| !given.fixed && given.value > 0.0)?;
        Some((i, given.value * file.unit))
    };
    let automatic = surfaces().enumerate().filter_map(computed).collect();
    let factors = beam::vignetting(file, lens.fields.values.len());
    ForeignLens { lens, report, factors, clips, automatic }
}

/// Refuses a truncated file.
fn check_complete(file: &ZemaxFile) -> Result<(), ParseError> {
    let surfaces = &file.surfaces;
    let wrong = |line, found: String, expected: &str| {
        Err(ParseError { place: format!("line {line}"), found, expected: expected.to_owned() })
    };
    for (number, surface) in surfaces.iter().enumerate() {
        let curvature = surface.curvature.is_some() || number == 0;
        for (is_given, keyword) in [(curvature, "CURV"), (surface.thickness.is_some(), "DISZ")] {
            if !is_given {
                let found = format!("surface {number} without {keyword}");
                return wrong(surface.line, found, "all its lines; is the file truncated?");
            }
        }
    }
    let image = surfaces.last().and_then(|surface| surface.thickness);
    if let Some((thickness, line)) = image.filter(|(thickness, _)| *thickness != 0.0) {
        let found = format!("a thickness of {thickness} behind the last surface");
        return wrong(line, found, "an image with thickness 0; is the file truncated?");
    }
    let solid = surfaces.iter().filter(|surface| !is_break(surface)).count();
    if solid < 3 || [surfaces.first(), surfaces.last()].into_iter().flatten().any(is_break) {
        let found = format!("{solid} surfaces");
        let line = surfaces.last().map_or(1, |surface| surface.line);
        return wrong(line, found, "an object, at least one surface, and an image");
    }
    Ok(())
}

/// The surface of the file that is the stop.
fn stop(
    file: &ZemaxFile,
    plan: &RowPlan,
    report: &mut ConversionReport,
) -> Result<usize, ParseError> {
    let surfaces = &file.surfaces;
    let numbered = surfaces.iter().enumerate();
    let mut stops = numbered.filter_map(|(number, surface)| Some((number, surface.stop?)));
    let wrong = |place: String, found: String| {
        Err(ParseError {
            place,
            found,
            expected: "exactly one STOP, between object and image".to_owned(),
        })
    };
    let Some((stop, line)) = stops.next() else {
        let [first, last] = [0, surfaces.len() - 1].map(|number| surfaces[number].line);
        return wrong(format!("lines {first} to {last}"), "no STOP".to_owned());
    };
    if let Some((_, second)) = stops.next() {
        return wrong(format!("line {second}"), format!("a second STOP after that of line {line}"));
    }
    if stop == 0 || stop + 1 == surfaces.len() {
        return wrong(format!("line {line}"), format!("STOP on surface {stop}"));
    }
    if plan.row(stop).is_some() {
        return Ok(stop);
    }
    let next = plan.rows.iter().map(|row| row.surface).find(|surface| *surface > stop);
    let surface = next.or(plan.rows.last().map(|row| row.surface)).unwrap_or(stop);
    let note = format!("on a coordinate break; surface {surface} is the stop in its place");
    report.amend(line, ConversionOutcome::Approximated, note);
    Ok(surface)
}

/// Object distances from this on are infinite.
const INFINITE_DISTANCE: f64 = 1e10;

fn object(file: &ZemaxFile) -> Result<Object, ParseError> {
    let (distance, line) = file.surfaces[0].thickness.unwrap_or((f64::INFINITY, 0));
    if distance.abs() >= INFINITE_DISTANCE {
        return Ok(Object::Infinity);
    }
    if distance == 0.0 {
        let expected = "a distance other than 0, or INFINITY".to_owned();
        let found = "an object at the first surface".to_owned();
        return Err(ParseError { place: format!("line {line}"), found, expected });
    }
    Ok(Object::Finite(distance * file.unit))
}

fn object_medium(file: &ZemaxFile, report: &mut ConversionReport) -> Result<Medium, ParseError> {
    let glass = glass::medium(&file.surfaces, 0, &file.catalogues)?;
    if let Some(line) = &file.surfaces[0].glass {
        if glass.medium == Medium::Mirror {
            report.amend(line.line, ConversionOutcome::Dropped, "the object cannot be a mirror");
            return Ok(Medium::Air);
        }
        report.amend(line.line, glass.outcome, glass.note);
    }
    Ok(glass.medium)
}

fn rows(
    file: &ZemaxFile,
    plan: &RowPlan,
    stop: usize,
    report: &mut ConversionReport,
) -> Result<Vec<Row>, ParseError> {
    let mut rows = Vec::with_capacity(plan.rows.len());
    for planned in &plan.rows {
        let number = planned.surface;
        let glass = glass::medium(&file.surfaces, number, &file.catalogues)?;
        if let Some(line) = &file.surfaces[number].glass {
            report.amend(line.line, glass.outcome, glass.note.clone());
        }
        let medium = gradient::medium(&file.surfaces[number], file.unit).unwrap_or(glass.medium);
        let mut row = row::row(file, planned, stop, medium, report)?;
        if let (Some(name), true) = (glass.missing, row.comment.is_empty()) {
            row.comment = format!("glass {name} is not known");
        }
        rows.push(row);
    }
    Ok(rows)
}

/// Reports the coordinate breaks, which become breaks of the axis.
fn report_breaks(file: &ZemaxFile, report: &mut ConversionReport) {
    for surface in file.surfaces.iter().filter(|surface| is_break(surface)) {
        report.amend(surface.kind.1, ConversionOutcome::Used, "a break of the axis");
        let clip = surface.clip.map(|(_, line)| line);
        let outline = surface.outline.map(|own| own.line);
        let lines = [surface.glass.as_ref().map(|glass| glass.line), clip, outline];
        for line in lines.into_iter().flatten().chain(surface.other_apertures.iter().copied()) {
            report.amend(line, ConversionOutcome::Preserved, "on a coordinate break");
        }
    }
}

/// Reports the properties of object and image that are lost, since both are planes here.
fn report_image(file: &ZemaxFile, report: &mut ConversionReport) {
    for surface in [file.surfaces.first(), file.surfaces.last()].into_iter().flatten() {
        if let Some((curvature, line)) = surface.curvature
            && curvature != 0.0
        {
            report.amend(
                line,
                ConversionOutcome::Dropped,
                "object and image are planes in this program",
            );
        }
        if let Some(given) = surface.semi_diameter {
            report.amend(
                given.line,
                ConversionOutcome::Preserved,
                "object and image do not clip in this program",
            );
        }
        let circles = surface.clip.into_iter().chain(surface.obstruction).map(|(_, line)| line);
        let others = surface.outline.into_iter().chain(surface.block).map(|own| own.line);
        let drawn = surface.other_apertures.iter().copied();
        for line in circles.chain(others).chain(drawn) {
            report.amend(
                line,
                ConversionOutcome::Dropped,
                "object and image do not clip in this program",
            );
        }
        let terms = surface.parameters.iter().chain(&surface.extra);
        for (_, _, line) in terms.filter(|(_, value, _)| *value != 0.0) {
            report.amend(
                *line,
                ConversionOutcome::Dropped,
                "object and image are planes in this program",
            );
        }
    }
    if let Some(glass) = file.surfaces.last().and_then(|surface| surface.glass.as_ref()) {
        report.amend(
            glass.line,
            ConversionOutcome::Dropped,
            "a medium behind the image is not supported",
        );
    }
}

/// Name, source, notes and names of the zoom positions, as this program exports them.
fn split_notes(file: &ZemaxFile) -> (String, String, String, Vec<String>) {
    let mut source = String::new();
    let mut zoom = Vec::new();
    let mut notes: Vec<&str> = Vec::new();
    for note in &file.notes {
        match (note.strip_prefix(super::SOURCE), note.strip_prefix(super::ZOOM_NAME)) {
            (Some(text), _) if source.is_empty() => text.clone_into(&mut source),
            (_, Some(text)) if file.configurations > 1 => zoom.push(text.to_owned()),
            _ => notes.push(note),
        }
    }
    (file.name.clone(), source, notes.join("\n").trim().to_owned(), zoom)
}
