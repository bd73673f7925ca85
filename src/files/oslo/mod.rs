//! Lenses of the program OSLO, `.len`: reading and writing.
//!
//! A file is a list of commands, one a line. The data of a surface end with `NXT`; the first surface is
//! the object, the last one the image. Commands of the whole lens may stand anywhere, most of them in
//! front or at the end. A command that this program has no counterpart of is listed as dropped.

mod write;

pub(super) use write::write;

use super::error::{FileError, ParseError};
use super::report::{ConversionOutcome, ConversionReport, ConversionRow};
use super::zemax::{apply_focus_solve, named_medium};
use crate::lens::glass::{self, line};
use crate::lens::{
    ASPHERE_TERMS, Aperture, FieldKind, FieldPoint, Fields, Lens, Medium, Object, Parameter,
    Pickup, Quantity, Row, SurfaceNumber, Wavelength,
};

/// Object distances from this on, in the unit of the file, are infinite (OSLO Optics Reference, page 151).
const INFINITE_DISTANCE: f64 = 1e8;
/// The largest accepted number.
const MAX_NUMBER: f64 = 1e100;
/// The largest accepted number of surfaces.
const MAX_SURFACES: usize = 1000;
/// The wavelengths of a file that has none, in µm: the first one is primary.
const USUAL_WAVELENGTHS: [f64; 3] = [0.5875618, 0.4861327, 0.6562725];
/// The field points of a file, as shares of the largest, which is all that it has.
const FIELD_SHARES: [f64; 3] = [0.0, 0.7, 1.0];

/// True for a text that is a lens of OSLO: it begins a lens, and its surfaces end with `NXT`, which no
/// other format has.
pub(super) fn is_lens(text: &str) -> bool {
    let commands = || text.lines().enumerate().filter_map(|(i, line)| OsloCommand::new(i, line));
    let begins = |command: &OsloCommand<'_>| {
        command.name == "LEN"
            && command.words.first().is_some_and(|w| w.eq_ignore_ascii_case("NEW"))
    };
    commands().any(|command| begins(&command)) && commands().any(|command| command.name == "NXT")
}

/// Reads a lens from the text of a file. `file` is its name in messages, and the name of a lens that has
/// none.
///
/// # Errors
/// A number that is none, a part that is missing, or an invalid lens.
pub(super) fn read(text: &str, file: &str) -> Result<(Lens, ConversionReport), FileError> {
    let mut model = OsloModel::default();
    let mut report = ConversionReport::default();
    for (number, line) in (1..).zip(text.lines()) {
        if let Some(command) = OsloCommand::new(number, line) {
            let (outcome, note) =
                model.take(&command).map_err(|wrong: ParseError| wrong.in_file(file))?;
            report.rows.push(command.row(outcome, note));
        }
    }
    let mut lens = model.lens(&mut report).map_err(|wrong| wrong.in_file(file))?;
    super::set_origin(&mut lens, file);
    lens.check().map_err(|source| FileError::Lens { file: file.to_owned(), source })?;
    apply_focus_solve(&mut lens);
    Ok((lens, report))
}

/// A command: its line, its first word in capitals, and the others.
struct OsloCommand<'a> {
    line: usize,
    name: String,
    words: Vec<&'a str>,
    text: &'a str,
}

impl<'a> OsloCommand<'a> {
    /// The command of a line; `None` for a comment or a blank one.
    fn new(line: usize, text: &'a str) -> Option<Self> {
        let mut quoted = false;
        let comment = text.char_indices().find(|(i, letter)| {
            quoted ^= *letter == '"';
            !quoted && text[*i..].starts_with("//")
        });
        let text = text[..comment.map_or(text.len(), |(i, _)| i)].trim();
        let mut words = text.split_whitespace();
        let name = words.next()?.to_ascii_uppercase();
        Some(Self { line, name, words: words.collect(), text })
    }

    fn row(&self, outcome: ConversionOutcome, note: String) -> ConversionRow {
        let (keyword, text) = (self.name.clone(), self.text.to_owned());
        ConversionRow { outcome, line: Some(self.line), keyword, text, note }
    }

    /// The text in quotes, or else all words.
    fn quoted(&self) -> String {
        let inside = self.text.split('"').nth(1);
        inside.map_or_else(|| self.words.join(" "), str::to_owned)
    }

    /// The number of a word.
    fn number(&self, i: usize) -> Result<f64, ParseError> {
        let word = self.words.get(i).copied().unwrap_or_default();
        let value = word.parse().ok().filter(|value: &f64| value.abs() <= MAX_NUMBER);
        value.ok_or_else(|| self.wrong(&format!("`{word}`"), "a number"))
    }

    /// The glass of the words: a name, indices at these wavelengths in µm, or a model.
    fn glass(&self, um: &[f64]) -> Result<OsloGlass, ParseError> {
        let wrong = || self.wrong(&format!("`{}`", self.words.join(" ")), "a glass or indices");
        let is_model = self.words.first().is_some_and(|word| word.eq_ignore_ascii_case("MOD"));
        let words = &self.words[usize::from(is_model)..];
        let is_name = |word: &&str| word.parse::<f64>().is_err();
        let named = usize::from(words.first().is_some_and(is_name));
        let index = |word: &&str| word.parse().ok().filter(|n: &f64| *n > 0.0 && *n < MAX_NUMBER);
        let n: Option<Vec<f64>> = words[named..].iter().map(index).collect();
        match (n, is_model) {
            (Some(n), false) if n.is_empty() && named == 1 => {
                Ok(OsloGlass::Named(words[0].to_owned()))
            }
            (Some(n), _) if n.is_empty() => Err(wrong()),
            (Some(n), true) if n.len() == 2 => Ok(OsloGlass::Model { nd: n[0], vd: n[1] }),
            (Some(n), _) => Ok(OsloGlass::Indices { um: um.to_vec(), n }),
            // A name of several words.
            (None, false) if named == 1 => Ok(OsloGlass::Named(words.join(" "))),
            (None, _) => Err(wrong()),
        }
    }

    fn numbers(&self) -> Result<Vec<f64>, ParseError> {
        (0..self.words.len()).map(|i| self.number(i)).collect()
    }

    fn wrong(&self, found: &str, expected: &str) -> ParseError {
        let place = format!("line {}, {}", self.line, self.name);
        ParseError { place, found: found.to_owned(), expected: expected.to_owned() }
    }
}

/// The outcome of a command, with a note.
type Taken = Result<(ConversionOutcome, String), ParseError>;

const USED: (ConversionOutcome, String) = (ConversionOutcome::Used, String::new());

fn dropped(note: &str) -> (ConversionOutcome, String) {
    (ConversionOutcome::Dropped, note.to_owned())
}

/// A surface of a file, in its unit of length.
#[derive(Debug, Clone, Default)]
struct OsloSurface {
    curvature: f64,
    thickness: f64,
    conic: f64,
    asphere: [f64; ASPHERE_TERMS],
    glass: Option<OsloGlass>,
    mirror: bool,
    semi_diameter: Option<f64>,
    stop: bool,
    focus: bool,
    comment: String,
    pickups: Vec<OsloPickup>,
}

/// A glass behind a surface.
#[derive(Debug, Clone, PartialEq)]
enum OsloGlass {
    Named(String),
    /// Indices at wavelengths in µm.
    Indices {
        um: Vec<f64>,
        n: Vec<f64>,
    },
    /// The index and the Abbe number at the d line.
    Model {
        nd: f64,
        vd: f64,
    },
}

/// A number that follows that of another surface: with its sign or the other one, and a constant in the
/// unit of the file.
#[derive(Debug, Clone)]
struct OsloPickup {
    is_curvature: bool,
    source: i64,
    scale: f64,
    offset: f64,
}

/// The content of a file.
#[derive(Debug)]
struct OsloModel {
    name: String,
    source: String,
    notes: Vec<String>,
    unit: f64,
    beam_radius: Option<f64>,
    object_na: Option<f64>,
    field: Option<(FieldKind, f64)>,
    wavelengths: Vec<f64>,
    weights: Vec<f64>,
    surfaces: Vec<OsloSurface>,
    is_ended: bool,
}

impl Default for OsloModel {
    fn default() -> Self {
        Self {
            name: String::new(),
            source: String::new(),
            notes: Vec::new(),
            unit: 1.0,
            beam_radius: None,
            object_na: None,
            field: None,
            wavelengths: Vec::new(),
            weights: Vec::new(),
            surfaces: vec![OsloSurface::default()],
            is_ended: false,
        }
    }
}

impl OsloModel {
    /// Takes a command of the lens or of the present surface.
    fn take(&mut self, command: &OsloCommand<'_>) -> Taken {
        if self.is_ended {
            return Ok(dropped("behind the end of the lens"));
        }
        match command.name.as_str() {
            "LEN" => self.name = command.quoted(),
            "DES" => self.source = command.quoted(),
            "UNI" => self.unit = command.number(0)?,
            "EBR" => self.beam_radius = Some(command.number(0)?),
            "NAO" => self.object_na = Some(command.number(0)?),
            "ANG" => self.field = Some((FieldKind::Angle, command.number(0)?)),
            "OBH" => self.field = Some((FieldKind::ObjectHeight, command.number(0)?)),
            "GIH" => self.field = Some((FieldKind::ImageHeight, command.number(0)?)),
            "WV" => self.wavelengths = command.numbers()?,
            "WW" => self.weights = command.numbers()?,
            "NXT" if self.surfaces.len() < MAX_SURFACES => {
                self.surfaces.push(OsloSurface::default());
            }
            "NXT" => return Err(command.wrong("another surface", "at most 1000")),
            "END" => self.is_ended = true,
            name if name.starts_with("SNO") => self.notes.push(command.quoted()),
            _ => return self.take_of_surface(command),
        }
        Ok(USED)
    }

    fn take_of_surface(&mut self, command: &OsloCommand<'_>) -> Taken {
        let um = self.wavelengths_um().to_vec();
        let Some(surface) = self.surfaces.last_mut() else { return Ok(dropped("no surface")) };
        match command.name.as_str() {
            "RD" => {
                let radius = command.number(0)?;
                surface.set_curvature(if radius == 0.0 { 0.0 } else { 1.0 / radius });
            }
            "CV" => surface.set_curvature(command.number(0)?),
            "TH" => {
                surface.thickness = command.number(0)?;
                surface.focus = false;
                surface.pickups.retain(|pickup| pickup.is_curvature);
            }
            "CC" => surface.conic = command.number(0)?,
            "AD" | "AE" | "AF" | "AG" | "AH" | "AI" | "AJ" => {
                let term = command.name.as_bytes()[1] - b'D';
                surface.asphere[usize::from(term)] = command.number(0)?;
            }
            "GLA" | "GLASS" => {
                surface.glass = Some(command.glass(&um)?);
                surface.mirror = false;
            }
            "AIR" => (surface.glass, surface.mirror) = (None, false),
            "RFL" | "RFH" => surface.mirror = true,
            "AST" => surface.stop = true,
            "NOT" => surface.comment = command.quoted(),
            "AP" => return surface.take_aperture(command),
            "PK" => return surface.take_pickup(command),
            "PY" if command.number(0)? == 0.0 => surface.focus = true,
            "GTO" => return Err(command.wrong("a jump to another surface", "surfaces in order")),
            "CBK" | "DRW" | "CHK" | "LME" | "LMN" | "DLRS" | "DLFD" | "DLAP" | "DLAS" | "DLNR" => {
                return Ok((ConversionOutcome::Preserved, String::new()));
            }
            _ => return Ok(dropped("this program has no counterpart")),
        }
        Ok(USED)
    }

    fn lens(&self, report: &mut ConversionReport) -> Result<Lens, ParseError> {
        let [object, rows @ .., image] = self.surfaces.as_slice() else {
            return Err(missing("one surface", "an object, surfaces and an image"));
        };
        if rows.is_empty() {
            return Err(missing("no surface between object and image", "one at least"));
        }
        if !(self.unit > 0.0) {
            return Err(missing(&format!("{} mm a unit", self.unit), "more than 0"));
        }
        if image.curvature != 0.0 {
            let note = "the image surface is taken as a plane";
            report.add(ConversionOutcome::Approximated, "image", note);
        }
        if object.mirror {
            return Err(missing("a mirror as the object", "a surface without a mirror"));
        }
        let distance = object.thickness * self.unit;
        if distance == 0.0 {
            let note = "the object has no distance: it is taken to be at infinity";
            report.add(ConversionOutcome::Approximated, "TH of the object", note);
        }
        let is_far = object.thickness.abs() >= INFINITE_DISTANCE || distance == 0.0;
        // The thickness of the image is the distance from the solved focus to the image surface.
        let shift = image.thickness * self.unit;
        let is_solved = rows.last().is_some_and(|last| last.focus);
        let object_medium = medium(object, "the object", report);
        let mut lens = Lens {
            name: self.name.clone(),
            source: self.source.clone(),
            notes: self.notes.join("\n"),
            object: if is_far { Object::Infinity } else { Object::Finite(distance) },
            aperture: self.aperture((!is_far).then_some(distance), &object_medium)?,
            object_medium,
            fields: self.fields(is_far, report),
            wavelengths: self.wavelengths(),
            image_solve: is_solved.then_some(shift),
            surfaces: Vec::with_capacity(rows.len()),
            ..crate::lens::blank()
        };
        let stop = rows.iter().position(|surface| surface.stop).unwrap_or_else(|| {
            let note = "no stop in the file: the first surface";
            report.add(ConversionOutcome::Approximated, "AST", note);
            0
        });
        for (i, surface) in rows.iter().enumerate() {
            let place = format!("surface {}", SurfaceNumber::new(i));
            let medium = medium(surface, &place, report);
            lens.surfaces.push(Row { stop: i == stop, medium, ..surface.row(self.unit) });
            if surface.focus && i + 1 < rows.len() {
                let note = "only the last thickness is solved; the written one is kept";
                report.add(ConversionOutcome::Dropped, &format!("PY of {place}"), note);
            }
        }
        if !is_solved && let Some(last) = lens.surfaces.last_mut() {
            last.thickness += shift;
        }
        self.add_pickups(rows, &mut lens, report);
        Ok(lens)
    }

    /// Adds the pickups. That of a curvature takes the shape along: conic constant and asphere.
    fn add_pickups(&self, rows: &[OsloSurface], lens: &mut Lens, report: &mut ConversionReport) {
        for (i, surface) in rows.iter().enumerate() {
            for pickup in &surface.pickups {
                let Some(found) = pickup.resolve(i, rows.len(), self.unit) else {
                    let place = format!("PK of surface {}", SurfaceNumber::new(i));
                    let note = "it follows a surface that is none of this lens";
                    report.add(ConversionOutcome::Dropped, &place, note);
                    continue;
                };
                if pickup.is_curvature {
                    let source = lens.surfaces[found.source.surface].clone();
                    lens.surfaces[i].conic = source.conic;
                    lens.surfaces[i].asphere =
                        source.asphere.iter().map(|term| found.scale * term).collect();
                }
                lens.pickups.push(found);
            }
        }
    }

    /// The beam; an object nearby has the numerical aperture of the beam on the first surface.
    fn aperture(&self, distance: Option<f64>, object: &Medium) -> Result<Aperture, ParseError> {
        let aperture = match (self.beam_radius, self.object_na, distance) {
            (_, Some(na), Some(_)) => Aperture::ObjectNa(na),
            (Some(radius), _, Some(distance)) => {
                let index = index_of(object);
                let radius = radius * self.unit;
                Aperture::ObjectNa(index * radius / radius.hypot(distance))
            }
            (Some(radius), _, None) => Aperture::EntrancePupilDiameter(2.0 * radius * self.unit),
            (None, Some(_), None) => {
                return Err(missing("NAO and an object at infinity", "EBR"));
            }
            _ => return Err(missing("no aperture", "EBR or NAO")),
        };
        let (Aperture::ObjectNa(value) | Aperture::EntrancePupilDiameter(value)) = aperture else {
            return Ok(aperture);
        };
        if value > 0.0 { Ok(aperture) } else { Err(missing("an aperture of 0", "more than 0")) }
    }

    fn fields(&self, is_far: bool, report: &mut ConversionReport) -> Fields {
        let (kind, largest) = match self.field {
            Some((FieldKind::ObjectHeight, _)) if is_far => {
                let note = "the object is at infinity: only the axis is kept";
                report.add(ConversionOutcome::Dropped, "OBH", note);
                (FieldKind::Angle, 0.0)
            }
            Some((FieldKind::Angle, angle)) => (FieldKind::Angle, angle),
            Some((kind, height)) => (kind, height * self.unit),
            None => (FieldKind::Angle, 0.0),
        };
        let shares: &[f64] = if largest == 0.0 { &[0.0] } else { &FIELD_SHARES };
        let point = |share: &f64| FieldPoint { x: 0.0, y: share * largest, weight: 1.0 };
        Fields { kind, values: shares.iter().map(point).collect() }
    }

    /// The wavelengths in µm that were set last; never empty.
    fn wavelengths_um(&self) -> &[f64] {
        if self.wavelengths.is_empty() { &USUAL_WAVELENGTHS } else { &self.wavelengths }
    }

    fn wavelengths(&self) -> Vec<Wavelength> {
        let all = self.wavelengths_um().iter().enumerate();
        let weight = |i: usize| self.weights.get(i).copied().unwrap_or(1.0);
        all.map(|(i, um)| Wavelength { um: *um, weight: weight(i), primary: i == 0 }).collect()
    }
}

impl OsloSurface {
    /// Sets the curvature, which then follows no other.
    fn set_curvature(&mut self, curvature: f64) {
        self.curvature = curvature;
        self.pickups.retain(|pickup| !pickup.is_curvature);
    }

    /// The aperture of a surface, which clips rays only if it is checked.
    fn take_aperture(&mut self, command: &OsloCommand<'_>) -> Taken {
        let is_checked = |word: &&str| word.eq_ignore_ascii_case("CHK");
        let first = command.words.first();
        let is_unchecked = |word: &&str| word.eq_ignore_ascii_case("UNC");
        let place = usize::from(first.is_some_and(|word| is_checked(word) || is_unchecked(word)));
        let radius = command.number(place)?;
        if first.is_some_and(is_checked) {
            self.semi_diameter = Some(radius).filter(|radius| *radius > 0.0);
            return Ok(USED);
        }
        let note =
            "not checked: it clips no rays, and the semi-diameter is left to them".to_owned();
        Ok((ConversionOutcome::Preserved, note))
    }

    fn take_pickup(&mut self, command: &OsloCommand<'_>) -> Taken {
        let kind = command.words.first().map(|word| word.to_ascii_uppercase());
        let (is_curvature, scale) = match kind.as_deref() {
            Some("CV") => (true, 1.0),
            Some("CVM") => (true, -1.0),
            Some("TH") => (false, 1.0),
            Some("THM") => (false, -1.0),
            _ => return Ok(dropped("only curvatures and thicknesses follow others here")),
        };
        let source = command.number(1)?;
        if source.fract() != 0.0 || source.abs() > MAX_SURFACES as f64 {
            return Err(command.wrong(&source.to_string(), "the number of a surface"));
        }
        let offset = if command.words.len() > 2 { command.number(2)? } else { 0.0 };
        self.pickups.retain(|pickup| pickup.is_curvature != is_curvature);
        self.pickups.push(OsloPickup { is_curvature, source: source as i64, scale, offset });
        Ok(USED)
    }

    fn row(&self, unit: f64) -> Row {
        let count = self.asphere.iter().rposition(|term| *term != 0.0).map_or(0, |last| last + 1);
        let term = |(i, value): (usize, &f64)| value * unit.powi(-(2 * i as i32 + 3));
        Row {
            curvature: self.curvature / unit,
            thickness: self.thickness * unit,
            conic: self.conic,
            asphere: self.asphere[..count].iter().enumerate().map(term).collect(),
            semi_diameter: self.semi_diameter.map(|radius| radius * unit),
            comment: self.comment.clone(),
            ..Row::default()
        }
    }
}

impl OsloPickup {
    /// The pickup of the row with an index; `None` if it follows no row in front of or behind it. A
    /// negative number counts back from the surface itself.
    fn resolve(&self, row: usize, rows: usize, unit: f64) -> Option<Pickup> {
        let own = i64::try_from(row).ok()? + 1;
        let number = if self.source < 0 { own + self.source } else { self.source };
        let source = usize::try_from(number - 1).ok().filter(|i| *i < rows && *i != row)?;
        let (quantity, offset) = if self.is_curvature {
            (Quantity::Curvature, self.offset / unit)
        } else {
            (Quantity::Thickness, self.offset * unit)
        };
        Some(Pickup {
            parameter: Parameter::new(row, quantity),
            source: Parameter::new(source, quantity),
            scale: self.scale,
            offset,
        })
    }
}

/// The medium behind a surface.
fn medium(surface: &OsloSurface, place: &str, report: &mut ConversionReport) -> Medium {
    if surface.mirror {
        return Medium::Mirror;
    }
    let name = match &surface.glass {
        None => return Medium::Air,
        Some(OsloGlass::Named(name)) if name.eq_ignore_ascii_case("AIR") => return Medium::Air,
        Some(OsloGlass::Named(name)) => name,
        Some(OsloGlass::Model { nd, vd }) => return Medium::Model { nd: *nd, vd: *vd },
        Some(OsloGlass::Indices { um, n }) => {
            let (medium, note) = medium_of_indices(um, n);
            if !note.is_empty() {
                report.add(ConversionOutcome::Approximated, &format!("GLA of {place}"), note);
            }
            return medium;
        }
    };
    let imported = named_medium(name, &[]);
    if imported.outcome != ConversionOutcome::Used {
        report.add(imported.outcome, &format!("glass {name} of {place}"), imported.note);
    }
    imported.medium
}

/// The index of the object medium at the d line.
fn index_of(medium: &Medium) -> f64 {
    match medium {
        Medium::Index(n) | Medium::Model { nd: n, .. } => *n,
        Medium::Glass(name) => glass::find(name).map_or(1.0, |glass| glass.nd),
        Medium::Air | Medium::Mirror | Medium::Grin(_) => 1.0,
    }
}

/// The medium with given indices, and what is approximated: a model glass if the d, F and C lines are
/// among the wavelengths.
fn medium_of_indices(um: &[f64], n: &[f64]) -> (Medium, &'static str) {
    if n.iter().all(|other| *other == n[0]) {
        return (Medium::Index(n[0]), "");
    }
    let at = |line: f64| {
        um.iter().zip(n).find(|(um, _)| (**um - line).abs() < 1e-4).map(|(_, index)| *index)
    };
    match (at(line::D), at(line::F), at(line::C)) {
        (Some(nd), Some(f), Some(c)) if f > c => {
            let vd = (nd - 1.0) / (f - c);
            (Medium::Model { nd, vd }, "a model glass with these indices at d, F and C")
        }
        _ => (Medium::Index(n[0]), "the index at the first wavelength, without dispersion"),
    }
}

fn missing(found: &str, expected: &str) -> ParseError {
    let place = "the lens".to_owned();
    ParseError { place, found: found.to_owned(), expected: expected.to_owned() }
}
