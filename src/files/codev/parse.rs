//! The commands of the whole lens: title, unit, aperture, fields, wavelengths, private glasses, zoom.

use super::command::{Command, SurfaceWord, commands, parse_number, surface_word};
use super::file::{ApertureCommand, CodeVFile, CodeVSurface, FACTORS, PickupCommand, ZoomCommand};
use super::surface;
use crate::files::error::ParseError;
use crate::files::report::{ConversionOutcome, ConversionReport, ConversionRow};
use crate::lens::FieldKind;

/// The outcome of a command, with a note.
pub(super) type CommandOutcome = (ConversionOutcome, String);

pub(super) fn used() -> CommandOutcome {
    (ConversionOutcome::Used, String::new())
}

pub(super) fn preserved() -> CommandOutcome {
    (ConversionOutcome::Preserved, String::new())
}

pub(super) fn dropped(note: impl Into<String>) -> CommandOutcome {
    (ConversionOutcome::Dropped, note.into())
}

/// The largest accepted number of surfaces and of zoom positions.
const MAX_COUNT: usize = 1000;

/// Reads every command.
pub(super) fn parse(text: &str) -> Result<(CodeVFile, ConversionReport), ParseError> {
    let mut file = CodeVFile::default();
    let mut report = ConversionReport::default();
    for command in commands(text) {
        let (outcome, note) = read(&mut file, &command, report.rows.len())?;
        report.rows.push(ConversionRow {
            outcome,
            line: Some(command.line),
            keyword: command.name,
            text: command.text,
            note,
        });
    }
    add_image(&mut file, &mut report);
    Ok((file, report))
}

/// Adds the image plane to a file without `SI` whose surfaces are all there.
fn add_image(file: &mut CodeVFile, report: &mut ConversionReport) {
    if file.is_complete || !file.is_followed {
        return;
    }
    file.is_complete = true;
    file.surfaces.push(CodeVSurface { row: report.rows.len(), ..CodeVSurface::default() });
    let note = "no SI in the file: the image plane stands at the end of the last gap";
    report.add(ConversionOutcome::Approximated, "SI", note);
}

fn read(file: &mut CodeVFile, command: &Command, row: usize) -> Result<CommandOutcome, ParseError> {
    if file.in_private {
        return private_glass(file, command);
    }
    match command.name.as_str() {
        "S" | "SO" | "SI" => begin_surface(file, command, row),
        "STO" => stop(file, command),
        "PIM" => {
            file.focus = Some(row);
            Ok(used())
        }
        "PRV" => {
            file.in_private = true;
            Ok(used())
        }
        "ZOO" => zoom(file, command, row),
        "PIK" => Ok(pickup(file, command, row)),
        _ => match header(file, command)? {
            Some(outcome) => Ok(outcome),
            None => of_surface(file, command),
        },
    }
}

/// `S bend thickness glass`.
fn begin_surface(
    file: &mut CodeVFile,
    command: &Command,
    row: usize,
) -> Result<CommandOutcome, ParseError> {
    if command.name == "SO" {
        file.surfaces.clear();
    } else if file.surfaces.is_empty() {
        return Err(command.malformed(format!("`{}` before SO", command.text), "SO first"));
    }
    if file.is_complete || file.surfaces.len() > MAX_COUNT {
        let found = format!("`{}` behind the image", command.text);
        return Err(command.malformed(found, "SI as the last of at most 1000 surfaces"));
    }
    file.is_complete = command.name == "SI";
    let thickness = match command.words.get(1).map(String::as_str) {
        None => 0.0,
        Some(word) if ["INF", "INFINITY"].iter().any(|own| word.eq_ignore_ascii_case(own)) => 1e14,
        Some(_) => command.number(1)?,
    };
    let bend = if command.words.is_empty() { 0.0 } else { command.number(0)? };
    let glass = surface::glass_word(&command.words);
    file.surfaces.push(CodeVSurface { bend, thickness, glass, row, ..CodeVSurface::default() });
    Ok(used())
}

/// The surface of a command: the one that it names, or the last one.
fn target(file: &CodeVFile, command: &Command) -> Option<usize> {
    let index = match command.surface {
        Some(SurfaceWord::Object) => 0,
        Some(SurfaceWord::Number(number)) => number,
        None | Some(SurfaceWord::Image) => file.surfaces.len().checked_sub(1)?,
    };
    (index < file.surfaces.len()).then_some(index)
}

fn stop(file: &mut CodeVFile, command: &Command) -> Result<CommandOutcome, ParseError> {
    let found = match command.surface {
        Some(SurfaceWord::Number(number)) => Some(number),
        _ => target(file, command),
    };
    if found.is_none_or(|stop| stop == 0) {
        return Err(command.malformed("a stop in front of the first surface", "STO behind its S"));
    }
    let second = file.stop.is_some_and(|stop| Some(stop) != found);
    file.stop = file.stop.or(found);
    Ok(if second { dropped("a second stop; the first one is used") } else { used() })
}

/// `GLB Sk` and `RET Sk`: decentre and tilt of the last surface start from the place of surface k;
/// `GLB Sj Sk` is the same for surface j.
fn reference(file: &mut CodeVFile, command: &Command) -> CommandOutcome {
    let last = file.surfaces.len().checked_sub(1);
    let second = command.words.first().and_then(|word| surface_word(word));
    let (at, source) = match (command.surface, second) {
        (Some(SurfaceWord::Number(at)), Some(SurfaceWord::Number(source))) => (Some(at), source),
        (Some(SurfaceWord::Number(source)), None) => (last, source),
        _ => return dropped("this place of the surface is not supported"),
    };
    let at = at.filter(|at| (1..file.surfaces.len()).contains(at) && (1..*at).contains(&source));
    let Some(at) = at else {
        return dropped("the place of a surface that is not in front of this one");
    };
    let surface = &mut file.surfaces[at];
    surface.lines.push(command.text.clone());
    surface.reference = Some(source);
    (ConversionOutcome::Used, format!("placed by the present place of surface {source}"))
}

/// A command of a surface.
fn of_surface(file: &mut CodeVFile, command: &Command) -> Result<CommandOutcome, ParseError> {
    if matches!(command.name.as_str(), "GLB" | "RET") && command.surface.is_some() {
        return Ok(reference(file, command));
    }
    let Some(index) = target(file, command) else { return Ok(preserved()) };
    let surface = &mut file.surfaces[index];
    surface.lines.push(command.text.clone());
    surface::read(surface, command)
}

/// A command of the whole lens; `None` for others.
fn header(file: &mut CodeVFile, command: &Command) -> Result<Option<CommandOutcome>, ParseError> {
    file.is_followed |=
        !file.surfaces.is_empty() && matches!(command.name.as_str(), "EPD" | "FNO" | "WL" | "YAN");
    let text = || command.words.first().cloned().unwrap_or_default();
    match command.name.as_str() {
        "RDM" => file.radii = Some(!command.has_word("N")),
        "TIT" | "TITLE" => file.title = text(),
        "COM" if file.surfaces.is_empty() => file.notes.push(text()),
        "DIM" => file.unit = Some(unit(command)?),
        "EPD" | "FNO" | "NA" | "NAO" => file.aperture = Some(aperture(command)?),
        "WL" => file.waves_nm = command.numbers()?,
        "WTW" => file.wave_weights = command.numbers()?,
        "REF" => file.reference = Some(count(command)?),
        "WTF" => file.field_weights = command.numbers()?,
        "VUX" | "VLX" | "VUY" | "VLY" => return Ok(Some(vignetting(file, command))),
        "LEN" | "GO" | "TEM" | "PRE" | "INI" | "CA" | "POL" | "DER" | "CLS" | "UID" | "WID" => {
            return Ok(Some(preserved()));
        }
        _ => return fields(file, command),
    }
    Ok(Some(used()))
}

fn unit(command: &Command) -> Result<f64, ParseError> {
    let word = command.words.first().map(|word| word.to_ascii_uppercase()).unwrap_or_default();
    match word.as_str() {
        "M" | "MM" => Ok(1.0),
        "C" | "CM" => Ok(10.0),
        "I" | "IN" => Ok(25.4),
        _ => Err(command.malformed(format!("unit `{word}`"), "M (millimetres), C or I")),
    }
}

fn aperture(command: &Command) -> Result<ApertureCommand, ParseError> {
    let value = command.number(0)?;
    if value <= 0.0 {
        return Err(command.malformed(format!("`{}`", command.text), "a number above 0"));
    }
    Ok(match command.name.as_str() {
        "EPD" => ApertureCommand::Diameter(value),
        "FNO" => ApertureCommand::FNumber(value),
        "NA" => ApertureCommand::ImageNa(value),
        _ => ApertureCommand::ObjectNa(value),
    })
}

fn count(command: &Command) -> Result<usize, ParseError> {
    let word = command.words.first().map(String::as_str).unwrap_or_default();
    word.parse().ok().filter(|count| *count <= MAX_COUNT).ok_or_else(|| {
        command.malformed(format!("`{}`", command.text), "a whole number up to 1000")
    })
}

fn vignetting(file: &mut CodeVFile, command: &Command) -> CommandOutcome {
    let values = command.numbers().ok();
    if values.as_ref().is_some_and(|values| values.iter().all(|value| *value == 0.0)) {
        return preserved();
    }
    let known = FACTORS.iter().position(|name| *name == command.name);
    if let (Some(values), Some(kind)) = (values, known) {
        file.vignetting[kind] = values;
    }
    dropped(crate::files::vignetting::LEFT_OUT)
}

/// `XAN`, `YOB` and the like: one coordinate of all field points.
fn fields(file: &mut CodeVFile, command: &Command) -> Result<Option<CommandOutcome>, ParseError> {
    let kind = match command.name.get(1..) {
        Some("AN") => FieldKind::Angle,
        Some("OB") => FieldKind::ObjectHeight,
        Some("IM" | "RI") => FieldKind::ImageHeight,
        _ => return Ok(None),
    };
    let values = match command.name.as_bytes()[0] {
        b'X' => &mut file.fields_x,
        b'Y' => &mut file.fields_y,
        _ => return Ok(None),
    };
    *values = command.numbers()?;
    file.field_kind = Some(kind);
    Ok(Some(if command.name.ends_with("RI") {
        let note = "real image heights are read as paraxial ones";
        (ConversionOutcome::Approximated, note.to_owned())
    } else {
        used()
    }))
}

/// A line of a private catalogue: `PWL wavelengths`, a name with its indices, or `END`.
fn private_glass(file: &mut CodeVFile, command: &Command) -> Result<CommandOutcome, ParseError> {
    match command.name.as_str() {
        "END" => file.in_private = false,
        "PWL" => file.private_nm = command.numbers()?,
        _ if command.words.iter().all(|word| parse_number(word).is_some()) => {
            file.private.insert(command.name.clone(), command.numbers()?);
        }
        _ => return Ok(dropped("a private glass that is not given by its indices")),
    }
    Ok(used())
}

/// `ZOO count`, or `ZOO name Sk values`.
fn zoom(file: &mut CodeVFile, command: &Command, row: usize) -> Result<CommandOutcome, ParseError> {
    let Some(name) = command.words.first() else { return Ok(preserved()) };
    if let Ok(count) = name.parse::<usize>() {
        if count > MAX_COUNT {
            return Err(command.malformed(format!("{count} zoom positions"), "at most 1000"));
        }
        file.positions = count;
        return Ok(used());
    }
    let word = command.words.get(1).map(String::as_str).unwrap_or_default();
    let field = || word.get(1..)?.parse::<usize>().ok().filter(|_| word.starts_with(['F', 'f']));
    let named = match surface_word(word) {
        Some(SurfaceWord::Number(number)) => Some(number),
        Some(SurfaceWord::Image) => file.surfaces.len().checked_sub(1),
        _ => field(),
    };
    let first = if named.is_some() { 2 } else { 1 };
    let values: Option<Vec<f64>> =
        command.words.iter().skip(first).map(|word| parse_number(word)).collect();
    let Some(values) = values else { return Ok(dropped("cannot change with the zoom position")) };
    let (name, target) = (name.to_ascii_uppercase(), named.unwrap_or(0));
    file.zoomed.push(ZoomCommand { name, target, values, row });
    Ok(used())
}

/// `PIK RDY S4 Z1 RDY S2 Z1 scale offset`.
fn pickup(file: &mut CodeVFile, command: &Command, row: usize) -> CommandOutcome {
    let words = command.words.iter().map(String::as_str);
    let position = |word: &&str| word.starts_with(['Z', 'z']) && surface_word(word).is_none();
    let words: Vec<&str> = words.filter(|word| !position(word)).collect();
    let frozen = || {
        let note = "this pickup is replaced by its present value";
        (ConversionOutcome::Approximated, note.to_owned())
    };
    let [to, at, from, source, rest @ ..] = &words[..] else { return frozen() };
    let is_thickness = to.eq_ignore_ascii_case("THI");
    let known = is_thickness || to.eq_ignore_ascii_case("RDY");
    let (Some(SurfaceWord::Number(surface)), Some(SurfaceWord::Number(source))) =
        (surface_word(at), surface_word(source))
    else {
        return frozen();
    };
    if !known || !from.eq_ignore_ascii_case(to) {
        return frozen();
    }
    let number =
        |i: usize, otherwise| rest.get(i).and_then(|w| parse_number(w)).unwrap_or(otherwise);
    let (scale, offset) = (number(0, 1.0), number(1, 0.0));
    file.pickups.push(PickupCommand { is_thickness, surface, source, scale, offset, row });
    used()
}
