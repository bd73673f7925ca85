//! `info`: first-order data, Seidel sums, sizes, checks and effects of a lens.

mod checks;
mod effects;
mod material;

use super::effects::{EffectArgs, EffectChoices, decision_text};
use super::error::CliError;
use super::input::{LensFile, LoadedLens};
use super::output::{Output, ShortNumber, TextTable, or_dash};
use crate::effects::EffectDecision;
use crate::lens::{Lens, SurfaceAperture, SurfaceNumber};
use crate::paraxial::{Beam, FirstOrder, Seidel, SeidelSums, first_order, seidel};
use crate::report::first_order_numbers;
use checks::{LensCheck, checks};
use material::Material;
use serde::Serialize;
use std::fmt::{self, Display};

/// First-order data, Seidel sums, semi-diameters, checks, and the computed effects with reasons
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/info.txt"))]
pub(super) struct InfoArgs {
    #[command(flatten)]
    lens: LensFile,

    /// Only this zoom position, counted from 0; absent: all of them
    #[arg(long, value_name = "N")]
    zoom: Option<usize>,

    #[command(flatten)]
    effects: EffectArgs,
}

impl InfoArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        let choices = self.effects.choices(&[])?;
        let opened = self.lens.open()?;
        let zooms = match self.zoom {
            Some(zoom) => {
                opened.check_zoom(zoom)?;
                zoom..zoom + 1
            }
            None => 0..opened.lens.zoom_positions(),
        };
        let positions: Vec<ZoomReport> =
            zooms.map(|zoom| ZoomReport::new(&opened, zoom, &choices)).collect::<Result<_, _>>()?;
        output.print(&InfoReport::new(&opened, positions))
    }
}

/// The printed result.
#[derive(Serialize)]
struct InfoReport {
    name: String,
    wavelength_um: f64,
    /// The data of the first position, so that those of a lens without zoom are at the top.
    #[serde(flatten)]
    first: Option<ZoomReport>,
    semi_diameters: Vec<Option<f64>>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    obstructions: Vec<Option<f64>>,
    /// The apertures of other forms of each surface; only for a lens that has one.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    apertures: Vec<Vec<SurfaceAperture>>,
    /// The glass at the first position; `None` for a lens without any.
    #[serde(skip_serializing_if = "Option::is_none")]
    glass: Option<Material>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    positions: Vec<ZoomReport>,
}

impl InfoReport {
    fn new(opened: &LoadedLens, positions: Vec<ZoomReport>) -> Self {
        let Lens { name, surfaces, .. } = &opened.lens;
        let obstructed = surfaces.iter().any(|row| row.obstruction.is_some());
        let obstructions = surfaces.iter().filter(|_| obstructed).map(|row| row.obstruction);
        let framed = surfaces.iter().any(|row| !row.apertures.is_empty());
        let apertures = surfaces.iter().filter(|_| framed).map(|row| row.apertures.clone());
        Self {
            name: name.clone(),
            wavelength_um: opened.primary_um(),
            first: positions.first().cloned(),
            glass: Material::new(&opened.lens, positions.first().map_or(0, |first| first.zoom)),
            semi_diameters: surfaces.iter().map(|row| row.semi_diameter).collect(),
            obstructions: obstructions.collect(),
            apertures: apertures.collect(),
            positions: if positions.len() > 1 { positions } else { Vec::new() },
        }
    }

    fn positions(&self) -> impl Iterator<Item = &ZoomReport> {
        let first = if self.positions.is_empty() { self.first.as_ref() } else { None };
        first.into_iter().chain(&self.positions)
    }
}

/// The data at one zoom position.
#[derive(Serialize, Clone)]
struct ZoomReport {
    zoom: usize,
    #[serde(skip_serializing_if = "String::is_empty")]
    zoom_name: String,
    #[serde(flatten)]
    first_order: FirstOrder<f64>,
    stop_surface: Option<usize>,
    total_track: f64,
    seidel: Option<Seidel<f64>>,
    #[serde(skip)]
    no_seidel: &'static str,
    checks: Vec<LensCheck>,
    effects: Vec<EffectDecision>,
}

impl ZoomReport {
    fn new(opened: &LoadedLens, zoom: usize, choices: &EffectChoices) -> Result<Self, CliError> {
        let lens = &opened.lens;
        let system = opened.system(zoom, None)?;
        let undefined = |source| CliError::Paraxial { file: opened.file.clone(), source };
        let data = first_order(&system, &Beam::for_lens(lens, zoom)).map_err(undefined)?;
        let media: Vec<_> = lens.surfaces.iter().map(|row| row.medium.clone()).collect();
        let (facts, effects) = effects::decisions(opened, zoom, choices)?;
        let model = opened.ray_model(zoom)?;
        let mut checks = checks(&system, &media, &model, data.stop_semi_diameter, facts.fates);
        checks.extend(checks::unusual_parts(lens));
        Ok(Self {
            zoom,
            zoom_name: lens.zoom.get(zoom).map(|z| z.name.clone()).unwrap_or_default(),
            stop_surface: system.stop,
            total_track: system.image_position(),
            seidel: seidel_sums(opened, zoom, &data)?,
            no_seidel: if system.has_grin() {
                "those of a gradient-index medium are not implemented"
            } else if data.chief.is_none() || data.lagrange.is_none() {
                "there is no chief ray"
            } else {
                "a surface is so steep that they are no finite numbers"
            },
            first_order: data,
            checks,
            effects,
        })
    }
}

/// The Seidel sums, with colour between the two outer wavelengths.
fn seidel_sums(
    opened: &LoadedLens,
    zoom: usize,
    data: &FirstOrder<f64>,
) -> Result<Option<Seidel<f64>>, CliError> {
    let system = opened.system(zoom, None)?;
    let um = opened.lens.wavelengths.iter().map(|w| w.um);
    let (short, long) = (um.clone().fold(f64::INFINITY, f64::min), um.fold(0.0, f64::max));
    let outer = (opened.system(zoom, Some(short))?, opened.system(zoom, Some(long))?);
    Ok(seidel(&system, data, Some((&outer.0, &outer.1))))
}

/// The Seidel sum in mm from which on it is written with an exponent.
const LARGEST_PLAIN_SUM: f64 = 1e5;

/// A row of the table of Seidel sums.
fn seidel_row(name: String, sums: &SeidelSums<f64>) -> impl Iterator<Item = String> {
    let cell = |sum: f64| {
        if sum.abs() < LARGEST_PLAIN_SUM { format!("{sum:.6}") } else { format!("{sum:.5e}") }
    };
    let cells = sums.to_array().map(cell);
    std::iter::once(name).chain(cells)
}

impl Display for InfoReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}\nat {} um, lengths in mm\n", self.name, self.wavelength_um)?;
        write!(f, "{}", self.first_order())?;
        for position in self.positions() {
            write!(f, "\n{}", position.seidel_table())?;
        }
        for position in self.positions() {
            write!(f, "\n{}", position.effects_and_checks())?;
        }
        if let Some(glass) = &self.glass {
            writeln!(f, "\n{}", glass.text())?;
        }
        writeln!(f, "\nsemi-diameters  {}", radii_text(&self.semi_diameters, "unlimited"))?;
        if !self.obstructions.is_empty() {
            writeln!(f, "obstructions    {}", radii_text(&self.obstructions, "none"))?;
        }
        for (i, own) in self.apertures.iter().enumerate() {
            for aperture in own {
                writeln!(f, "aperture of {}   {}", i + 1, aperture.short_text())?;
            }
        }
        Ok(())
    }
}

/// Radii in a line, with a word for those that are not set.
fn radii_text(radii: &[Option<f64>], none: &str) -> String {
    let shown = |r: &Option<f64>| r.map_or(none.to_owned(), |r| ShortNumber(r).to_string());
    radii.iter().map(shown).collect::<Vec<_>>().join("  ")
}

impl InfoReport {
    fn first_order(&self) -> TextTable {
        let head = |p: &ZoomReport| format!("zoom {} {}", p.zoom, p.zoom_name);
        let mut table = TextTable::default();
        if !self.positions.is_empty() {
            table.row(std::iter::once(String::new()).chain(self.positions().map(head)));
        }
        let columns: Vec<_> =
            self.positions().map(|p| first_order_numbers(&p.first_order, p.total_track)).collect();
        let names = columns.first().into_iter().flatten().map(|(name, _)| *name);
        for (i, name) in names.enumerate() {
            let values = columns.iter().map(|column| or_dash(column[i].1));
            table.row(std::iter::once(name.to_owned()).chain(values));
        }
        table
    }
}

impl ZoomReport {
    fn effects_and_checks(&self) -> String {
        let zoom = self.zoom;
        let mut lines =
            vec![format!("effects on spots good to {}, zoom {zoom}", effects::SPOT_TOLERANCE)];
        lines.extend(self.effects.iter().map(decision_text));
        lines.push(format!("\nchecks, zoom {zoom}"));
        lines.extend(self.checks.iter().map(LensCheck::line));
        if self.checks.is_empty() {
            lines.push("  no warnings".to_owned());
        }
        lines.join("\n") + "\n"
    }

    fn seidel_table(&self) -> TextTable {
        let title = format!("Seidel sums, zoom {}", self.zoom);
        let columns =
            ["spherical", "coma", "astigm.", "Petzval", "distort.", "axial c.", "lateral c."];
        let Some(seidel) = &self.seidel else {
            return TextTable::new(&[&format!("{title}: none: {}", self.no_seidel)]);
        };
        let mut table = TextTable::new(&[[title.as_str()].as_slice(), &columns].concat());
        for (i, sums) in seidel.surfaces.iter().enumerate() {
            table.row(seidel_row(format!("surface {}", SurfaceNumber::new(i)), sums));
        }
        table.row(seidel_row("sum".to_owned(), &seidel.total));
        table
    }
}
