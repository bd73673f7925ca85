//! What a lens is: first-order data, third-order sums, sizes.

mod checks;
mod effects;

use super::failure::Failure;
use super::input::{LensFile, Opened};
use super::output::{Number, Output, Table, optional};
use crate::effects::Decision;
use crate::lens::Lens;
use crate::paraxial::{Beam, FirstOrder, Pupil, SeidelSums, first_order, seidel};
use checks::{Check, checks};
use serde::Serialize;
use std::fmt::{self, Display};

/// First-order data, Seidel sums, semi-diameters, checks, and the effects chosen and why
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/info.txt"))]
pub(super) struct Info {
    #[command(flatten)]
    lens: LensFile,

    /// Only this zoom position, counted from 0; all of them where it is absent
    #[arg(long, value_name = "N")]
    zoom: Option<usize>,
}

impl Info {
    pub(super) fn run(&self, output: &Output) -> Result<(), Failure> {
        let opened = self.lens.open()?;
        let zooms = match self.zoom {
            Some(zoom) => {
                opened.check_zoom(zoom)?;
                zoom..zoom + 1
            }
            None => 0..opened.lens.zoom_positions(),
        };
        let positions: Vec<Position> =
            zooms.map(|zoom| Position::new(&opened, zoom)).collect::<Result<_, _>>()?;
        output.print(&Report::new(&opened, positions))
    }
}

/// What is printed.
#[derive(Serialize)]
struct Report {
    name: String,
    wavelength_um: f64,
    /// The first of the positions again, so that a lens that does not zoom has its data at hand.
    #[serde(flatten)]
    first: Option<Position>,
    semi_diameters: Vec<Option<f64>>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    obstructions: Vec<Option<f64>>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    positions: Vec<Position>,
}

impl Report {
    fn new(opened: &Opened, positions: Vec<Position>) -> Self {
        let Lens { name, surfaces, .. } = &opened.lens;
        let obstructed = surfaces.iter().any(|row| row.obstruction.is_some());
        let obstructions = surfaces.iter().filter(|_| obstructed).map(|row| row.obstruction);
        Self {
            name: name.clone(),
            wavelength_um: opened.primary_um(),
            first: positions.first().cloned(),
            semi_diameters: surfaces.iter().map(|row| row.semi_diameter).collect(),
            obstructions: obstructions.collect(),
            positions: if positions.len() > 1 { positions } else { Vec::new() },
        }
    }

    fn positions(&self) -> impl Iterator<Item = &Position> {
        let first = if self.positions.is_empty() { self.first.as_ref() } else { None };
        first.into_iter().chain(&self.positions)
    }
}

/// The data at one zoom position.
#[derive(Serialize, Clone)]
struct Position {
    zoom: usize,
    #[serde(skip_serializing_if = "String::is_empty")]
    zoom_name: String,
    efl: Option<f64>,
    bfl: Option<f64>,
    ffl: Option<f64>,
    front_principal_plane: Option<f64>,
    rear_principal_plane: Option<f64>,
    f_number: Option<f64>,
    working_f_number: Option<f64>,
    entrance_pupil: PupilKeys,
    exit_pupil: PupilKeys,
    stop_surface: Option<usize>,
    stop_semi_diameter: f64,
    total_track: f64,
    paraxial_image: Option<f64>,
    image_defocus: Option<f64>,
    magnification: Option<f64>,
    lagrange: Option<f64>,
    petzval_sum: f64,
    seidel: Option<SeidelKeys>,
    #[serde(skip)]
    no_seidel: &'static str,
    checks: Vec<Check>,
    effects: Vec<Decision>,
}

#[derive(Serialize, Clone)]
struct PupilKeys {
    position: Option<f64>,
    diameter: Option<f64>,
}

impl PupilKeys {
    fn new(pupil: Pupil<f64>) -> Self {
        Self { position: pupil.position, diameter: pupil.diameter }
    }
}

#[derive(Serialize, Clone)]
struct SeidelKeys {
    total: Sums,
    surfaces: Vec<Sums>,
}

#[derive(Serialize, Clone)]
struct Sums {
    s1: f64,
    s2: f64,
    s3: f64,
    s4: f64,
    s5: f64,
    c1: f64,
    c2: f64,
}

impl Sums {
    fn new(sums: &SeidelSums<f64>) -> Self {
        let SeidelSums { s1, s2, s3, s4, s5, c1, c2 } = *sums;
        Self { s1, s2, s3, s4, s5, c1, c2 }
    }

    fn row(&self, name: String) -> impl Iterator<Item = String> {
        let sums = [self.s1, self.s2, self.s3, self.s4, self.s5, self.c1, self.c2];
        std::iter::once(name).chain(sums.map(|sum| format!("{sum:.6}")))
    }
}

impl Position {
    fn new(opened: &Opened, zoom: usize) -> Result<Self, Failure> {
        let lens = &opened.lens;
        let system = opened.system(zoom, None)?;
        let undefined = |source| Failure::Undefined { file: opened.file.clone(), source };
        let data = first_order(&system, &Beam::of(lens, zoom)).map_err(undefined)?;
        let last = system.surfaces.len() - 1;
        let media: Vec<_> = lens.surfaces.iter().map(|row| row.medium.clone()).collect();
        let (facts, effects) = effects::decisions(opened, zoom)?;
        Ok(Self {
            zoom,
            zoom_name: lens.zoom.get(zoom).map(|z| z.name.clone()).unwrap_or_default(),
            efl: data.efl,
            bfl: data.bfl,
            ffl: data.ffl,
            front_principal_plane: data.pp1,
            rear_principal_plane: data.pp2,
            f_number: data.f_number,
            working_f_number: data.working_f_number,
            entrance_pupil: PupilKeys::new(data.entrance_pupil),
            exit_pupil: PupilKeys::new(data.exit_pupil),
            stop_surface: system.stop,
            stop_semi_diameter: data.stop_semi_diameter,
            total_track: system.surfaces[..last].iter().map(|s| s.thickness).sum(),
            paraxial_image: data.paraxial_image,
            image_defocus: data.image_defocus,
            magnification: data.magnification,
            lagrange: data.lagrange,
            petzval_sum: data.petzval_sum,
            seidel: seidel_keys(opened, zoom, &data)?,
            no_seidel: if system.is_graded() {
                "those of a gradient-index medium are not implemented"
            } else {
                "there is no chief ray"
            },
            checks: checks(&system, &media, facts.fates),
            effects,
        })
    }
}

/// The third-order sums, with colour between the two outer wavelengths.
fn seidel_keys(
    opened: &Opened,
    zoom: usize,
    data: &FirstOrder<f64>,
) -> Result<Option<SeidelKeys>, Failure> {
    let system = opened.system(zoom, None)?;
    let um = opened.lens.wavelengths.iter().map(|w| w.um);
    let (short, long) = (um.clone().fold(f64::INFINITY, f64::min), um.fold(0.0, f64::max));
    let outer = (opened.system(zoom, Some(short))?, opened.system(zoom, Some(long))?);
    let sums = seidel(&system, data, Some((&outer.0, &outer.1)));
    Ok(sums.map(|sums| SeidelKeys {
        total: Sums::new(&sums.total),
        surfaces: sums.surfaces.iter().map(Sums::new).collect(),
    }))
}

impl Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}\nat {} um, lengths in mm\n", self.name, self.wavelength_um)?;
        write!(f, "{}", self.first_order())?;
        for position in self.positions() {
            write!(f, "\n{}", position.seidel_table())?;
        }
        for position in self.positions() {
            write!(f, "\n{}", position.effects_and_checks())?;
        }
        writeln!(f, "\nsemi-diameters  {}", radii(&self.semi_diameters, "unlimited"))?;
        if self.obstructions.is_empty() {
            return Ok(());
        }
        writeln!(f, "obstructions    {}", radii(&self.obstructions, "none"))
    }
}

/// Radii in a row, with a word for those that are not there.
fn radii(radii: &[Option<f64>], none: &str) -> String {
    let shown = |r: &Option<f64>| r.map_or(none.to_owned(), |r| Number(r).to_string());
    radii.iter().map(shown).collect::<Vec<_>>().join("  ")
}

/// A row of the table of first-order data.
type Datum = (&'static str, fn(&Position) -> String);

const FIRST_ORDER: [Datum; 18] = [
    ("focal length", |p| optional(p.efl)),
    ("back focal point, from the last vertex", |p| optional(p.bfl)),
    ("front focal point, from the first vertex", |p| optional(p.ffl)),
    ("front principal plane, from the first vertex", |p| optional(p.front_principal_plane)),
    ("rear principal plane, from the last vertex", |p| optional(p.rear_principal_plane)),
    ("f-number", |p| optional(p.f_number)),
    ("working f-number", |p| optional(p.working_f_number)),
    ("entrance pupil, from the first vertex", |p| optional(p.entrance_pupil.position)),
    ("entrance pupil diameter", |p| optional(p.entrance_pupil.diameter)),
    ("exit pupil, from the last vertex", |p| optional(p.exit_pupil.position)),
    ("exit pupil diameter", |p| optional(p.exit_pupil.diameter)),
    ("stop semi-diameter", |p| Number(p.stop_semi_diameter).to_string()),
    ("first vertex to image plane", |p| Number(p.total_track).to_string()),
    ("paraxial image, from the last vertex", |p| optional(p.paraxial_image)),
    ("image plane behind the paraxial image", |p| optional(p.image_defocus)),
    ("magnification", |p| optional(p.magnification)),
    ("Lagrange invariant", |p| optional(p.lagrange)),
    ("Petzval sum, 1/mm", |p| Number(p.petzval_sum).to_string()),
];

impl Report {
    fn first_order(&self) -> Table {
        let head = |p: &Position| format!("zoom {} {}", p.zoom, p.zoom_name);
        let mut table = Table::default();
        if !self.positions.is_empty() {
            table.row(std::iter::once(String::new()).chain(self.positions().map(head)));
        }
        for (name, value) in FIRST_ORDER {
            table.row(std::iter::once(name.to_owned()).chain(self.positions().map(value)));
        }
        table
    }
}

impl Position {
    fn effects_and_checks(&self) -> String {
        let zoom = self.zoom;
        let mut lines = vec![format!("effects on spots good to {}, zoom {zoom}", effects::SHARE)];
        lines.extend(self.effects.iter().map(effects::line));
        lines.push(format!("\nchecks, zoom {zoom}"));
        lines.extend(self.checks.iter().map(Check::line));
        if self.checks.is_empty() {
            lines.push("  nothing to remark".to_owned());
        }
        lines.join("\n") + "\n"
    }

    fn seidel_table(&self) -> Table {
        let title = format!("Seidel sums, zoom {}", self.zoom);
        let columns =
            ["spherical", "coma", "astigm.", "Petzval", "distort.", "axial c.", "lateral c."];
        let Some(seidel) = &self.seidel else {
            return Table::new(&[&format!("{title}: none, since {}", self.no_seidel)]);
        };
        let mut table = Table::new(&[[title.as_str()].as_slice(), &columns].concat());
        for (i, sums) in seidel.surfaces.iter().enumerate() {
            table.row(sums.row(format!("surface {i}")));
        }
        table.row(seidel.total.row("sum".to_owned()));
        table
    }
}
