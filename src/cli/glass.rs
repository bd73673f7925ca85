//! `glass`: lists the glasses that lenses can name, and adds catalogues of makers.

use super::error::CliError;
use super::output::{Output, ShortNumber, TextTable};
use super::output_paths::OutputPaths;
use crate::files::{self, AgfCatalogue, AgfExport, GlassQuery};
use crate::lens::glass::{self, Glass, GlassProperties, GlassStatus, PriceSource};
use serde::Serialize;
use std::fmt;
use std::path::PathBuf;

/// Lists the glasses that lenses can name, and adds the catalogues of makers, .agf
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("help/glass.txt"))]
pub(super) struct GlassArgs {
    /// Words of maker and name, ranges of nd, vd, price and density such as nd=1.6..1.7 or vd=50.., and
    /// status=preferred or lead=no; absent: every glass
    #[arg(value_name = "WORD")]
    words: Vec<String>,

    /// The glasses nearest to an index and an Abbe number at the d line, the nearest first
    #[arg(
        long,
        value_names = ["ND", "VD"],
        num_args = 2,
        allow_negative_numbers = true,
        conflicts_with_all = ["add", "remove"]
    )]
    nearest: Option<Vec<f64>>,

    /// Adds a catalogue for good, in place of one of the same name
    #[arg(long, value_name = "FILE", conflicts_with = "words")]
    add: Option<PathBuf>,

    /// Writes the glasses as a catalogue .agf for other programs
    #[arg(long, value_name = "FILE", conflicts_with_all = ["add", "remove"])]
    out: Option<PathBuf>,

    /// Adds the glass of a melt of this glass, with the indices of --index, as `MELT NAME`
    #[arg(
        long,
        value_name = "GLASS",
        requires = "indices",
        conflicts_with_all = ["words", "add", "remove", "out", "nearest"]
    )]
    melt: Option<String>,

    /// An index that was measured on the melt at a wavelength in um, relative to air; may be repeated
    #[arg(long = "index", value_name = "UM=INDEX", value_parser = parse_index, requires = "melt")]
    indices: Vec<[f64; 2]>,

    /// The name of the melt; absent: that of the glass
    #[arg(long, value_name = "NAME", requires = "melt")]
    name: Option<String>,

    /// Removes the catalogue of this name that was added
    #[arg(long, value_name = "NAME", conflicts_with_all = ["words", "add"])]
    remove: Option<String>,
}

impl GlassArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        if let Some(path) = &self.add {
            let (catalogue, saved) = files::add_catalogue(path)?;
            return output.print(&AddedCatalogue::new(catalogue, &saved));
        }
        if let Some(glass) = &self.melt {
            return output.print(&self.add_melt(glass)?);
        }
        if let Some(name) = &self.remove {
            let removed = files::remove_catalogue(name)?.display().to_string();
            return output.print(&RemovedCatalogue { removed });
        }
        let query = GlassQuery::new(self.words.iter().map(String::as_str))
            .map_err(|why| CliError::Input(why.to_string()))?;
        let mut meant: Vec<&'static Glass> =
            glass::known().filter(|glass| query.is_met_by(glass)).collect();
        if let Some([nd, vd]) = self.nearest.as_deref() {
            sort_by_distance(&mut meant, *nd, *vd)?;
        }
        if meant.is_empty() {
            let query = self.words.join(" ");
            let text = format!("found no glass for `{query}`; `aplanat glass` lists all");
            return Err(CliError::Input(text));
        }
        if let Some(path) = &self.out {
            OutputPaths::default().file("--out", Some(path), &["agf"])?;
            let export = files::write_agf(meant, path)?;
            return output.print(&WrittenCatalogue { file: path.display().to_string(), export });
        }
        let named = glass::find(&self.words.join(" ")).filter(|glass| meant.contains(glass));
        let twins = named.map(|glass| (glass, glass.twins()));
        output.print(&GlassList { rows: meant.into_iter().map(GlassRow::new).collect(), twins })
    }
}

impl GlassArgs {
    fn add_melt(&self, name: &str) -> Result<AddedMelt, CliError> {
        let base = glass::find(name).ok_or_else(|| {
            CliError::Input(format!("found no glass `{name}`; `aplanat glass` lists all"))
        })?;
        let own = self.name.as_ref().unwrap_or(&base.name);
        let is_name = !own.is_empty() && own.chars().all(|c| c.is_ascii_graphic());
        if !is_name {
            let text =
                format!("--name: found `{}`; expected letters and digits", own.escape_debug());
            return Err(CliError::Input(text));
        }
        let (melt, left) = base
            .melt(own, &self.indices)
            .map_err(|why| CliError::Input(format!("--index: {why}")))?;
        let mut known = base.properties().cloned().unwrap_or_default();
        known.status = Some(GlassStatus::Melt);
        let melt = Glass { own_properties: Some(Box::new(known)), ..melt };
        let saved = files::add_melt(&melt)?.display().to_string();
        let name = format!("MELT {own}");
        let added = glass::find(&name).unwrap_or(base);
        Ok(AddedMelt { name, nd: added.nd, vd: added.vd, worst_index: left, saved })
    }
}

/// A wavelength with an index.
fn parse_index(text: &str) -> Result<[f64; 2], String> {
    let number = |part: &str| part.trim().parse::<f64>().ok().filter(|value| value.is_finite());
    let pair = text.split_once('=').and_then(|(um, index)| Some([number(um)?, number(index)?]));
    pair.ok_or_else(|| {
        "expected a wavelength in um and an index, as in `0.5875618=1.51672`".to_owned()
    })
}

/// The report on a melt that was added.
#[derive(Serialize)]
struct AddedMelt {
    name: String,
    nd: f64,
    vd: f64,
    /// The largest difference between an index that was measured and that of the formula.
    worst_index: f64,
    saved: String,
}

impl fmt::Display for AddedMelt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, nd, vd, worst_index, saved } = self;
        writeln!(
            f,
            "{name}: nd {nd:.6}, vd {vd:.3}; measured indices missed by {worst_index:.1e}"
        )?;
        writeln!(f, "saved in {saved}")
    }
}

/// The number of glasses that are listed by their distance.
const NEAREST: usize = 10;

/// The nearest glasses to an index and an Abbe number, in order.
fn sort_by_distance(glasses: &mut Vec<&'static Glass>, nd: f64, vd: f64) -> Result<(), CliError> {
    if !(nd > 1.0 && nd < 10.0 && vd > 0.0 && vd < 1e3) {
        let text =
            format!("found nd {nd} and vd {vd}; expected those of a glass, such as 1.62 36.4");
        return Err(CliError::Input(text));
    }
    let distance = |glass: &Glass| glass::distance(glass, nd, vd);
    glasses.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
    glasses.truncate(NEAREST);
    Ok(())
}

/// A glass of the list.
#[derive(Serialize)]
struct GlassRow {
    maker: &'static str,
    name: &'static str,
    nd: f64,
    vd: f64,
    /// The partial dispersion `PgF`, if the formula reaches these lines.
    #[serde(rename = "PgF")]
    partial_dispersion: Option<f64>,
    range_um: [f64; 2],
    #[serde(rename = "density_g_cm3")]
    density: Option<f64>,
    status: Option<GlassStatus>,
    relative_cost: f64,
    /// The origin of that: the maker, a person's list, or the class of the glass.
    cost_source: PriceSource,
    /// The linear expansion in 1e-6/K.
    expansion: Option<f64>,
    /// The change of the index relative to air at the d line and 20 °C, in 1e-6/K.
    #[serde(rename = "dn_dt")]
    index_slope: Option<f64>,
    /// The internal transmission of 10 mm at 420 nm.
    transmission_420_nm: Option<f64>,
    marked_lead_free: bool,
    /// The other names of the same glass, of other makers too.
    twins: Vec<String>,
}

impl GlassRow {
    fn new(glass: &'static Glass) -> Self {
        let none = GlassProperties::default();
        let known = glass.properties().unwrap_or(&none);
        let price = glass.price();
        Self {
            maker: &glass.manufacturer,
            name: &glass.name,
            nd: glass.nd,
            vd: glass.vd,
            partial_dispersion: glass.partial_dispersion(),
            range_um: glass.range_um,
            density: glass.density,
            status: known.status,
            relative_cost: price.relative,
            cost_source: price.source,
            expansion: known.expansion,
            index_slope: known.thermal.map(|thermal| 1e6 * thermal.slope_at_d(glass.nd)),
            transmission_420_nm: known.internal_transmission(0.42, 10.0),
            marked_lead_free: glass.is_marked_lead_free(),
            twins: glass.twins().into_iter().map(Glass::full_name).collect(),
        }
    }
}

impl GlassRow {
    /// The price, marked where it is that of a class.
    fn price_text(&self) -> String {
        let mark = if self.cost_source == PriceSource::Estimated { "~" } else { "" };
        format!("{mark}{}", ShortNumber(self.relative_cost))
    }
}

/// Glasses, one line each.
#[derive(Serialize)]
#[serde(transparent)]
struct GlassList {
    rows: Vec<GlassRow>,
    /// The glass that was named, with its twins.
    #[serde(skip)]
    twins: Option<(&'static Glass, Vec<&'static Glass>)>,
}

impl fmt::Display for GlassList {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let head = [
            "maker", "name", "nd", "vd", "PgF", "um", "g/cm3", "status", "price", "1e-6/K",
            "dn/dT", "T420",
        ];
        let mut table = TextTable::new(&head).left(&[1, 7]);
        let dash = || "-".to_owned();
        let short = |value: Option<f64>| value.map_or_else(dash, |v| ShortNumber(v).to_string());
        for glass in &self.rows {
            let [low, high] = glass.range_um.map(ShortNumber);
            table.row([
                glass.maker.to_owned(),
                glass.name.to_owned(),
                format!("{:.5}", glass.nd),
                format!("{:.2}", glass.vd),
                glass.partial_dispersion.map_or_else(dash, |value| format!("{value:.4}")),
                format!("{low}..{high}"),
                glass.density.map_or_else(dash, |value| format!("{value:.2}")),
                glass.status.map_or_else(dash, |status| status.to_string()),
                glass.price_text(),
                short(glass.expansion),
                glass.index_slope.map_or_else(dash, |slope| format!("{slope:.2}")),
                glass.transmission_420_nm.map_or_else(dash, |share| format!("{share:.3}")),
            ]);
        }
        write!(f, "{table}")?;
        writeln!(f, "{}", counted_glasses(self.rows.len()))?;
        if self.rows.iter().any(|glass| glass.cost_source == PriceSource::Estimated) {
            writeln!(f, "~: a class, estimated from the family of the glass")?;
        }
        self.twins.as_ref().map_or(Ok(()), |(glass, twins)| write_twins(f, glass, twins))
    }
}

/// Writes the twins of a glass with their distances from it.
fn write_twins(f: &mut fmt::Formatter<'_>, named: &Glass, twins: &[&'static Glass]) -> fmt::Result {
    if twins.is_empty() {
        return writeln!(f, "\nno other glass is a twin of {}", named.full_name());
    }
    writeln!(f, "\ntwins of {}, as differences from it", named.full_name())?;
    let mut table = TextTable::new(&["glass", "nd", "vd", "PgF", "price", "status"]).left(&[0, 5]);
    let dash = || "-".to_owned();
    for glass in twins {
        let partial = glass.partial_dispersion().zip(named.partial_dispersion());
        let row = GlassRow::new(glass);
        table.row([
            glass.full_name(),
            format!("{:+.5}", glass.nd - named.nd),
            format!("{:+.2}", glass.vd - named.vd),
            partial.map_or_else(dash, |(a, b)| format!("{:+.4}", a - b)),
            row.price_text(),
            row.status.map_or_else(dash, |status| status.to_string()),
        ]);
    }
    write!(f, "{table}")
}

fn counted_glasses(count: usize) -> String {
    if count == 1 { "1 glass".to_owned() } else { format!("{count} glasses") }
}

/// The report on a catalogue that was added.
#[derive(Serialize)]
struct AddedCatalogue {
    saved: Vec<String>,
    glasses: Vec<AddedGlass>,
    refused: Vec<GlassRemark>,
    contradictory: Vec<GlassRemark>,
}

#[derive(Serialize)]
struct AddedGlass {
    name: String,
    nd: f64,
    vd: f64,
    #[serde(flatten)]
    properties: GlassProperties,
}

#[derive(Serialize)]
struct GlassRemark {
    name: String,
    why: String,
}

impl AddedCatalogue {
    fn new(catalogue: AgfCatalogue, saved: &[PathBuf]) -> Self {
        let added = |glass: Glass| {
            let properties = glass.properties().cloned().unwrap_or_default();
            AddedGlass { name: glass.name, nd: glass.nd, vd: glass.vd, properties }
        };
        let remarks = |found: Vec<(String, String)>| {
            found.into_iter().map(|(name, why)| GlassRemark { name, why }).collect()
        };
        Self {
            saved: saved.iter().map(|path| path.display().to_string()).collect(),
            glasses: catalogue.glasses.into_iter().map(added).collect(),
            refused: remarks(catalogue.refused),
            contradictory: remarks(catalogue.contradictory),
        }
    }
}

impl fmt::Display for AddedCatalogue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let glasses = counted_glasses(self.glasses.len());
        writeln!(
            f,
            "{glasses}, {} refused; saved as {}",
            self.refused.len(),
            self.saved.join(", ")
        )?;
        let remarks = self.refused.iter().chain(&self.contradictory);
        remarks.into_iter().try_for_each(|glass| writeln!(f, "  {}: {}", glass.name, glass.why))
    }
}

/// The report on a catalogue that was written.
#[derive(Serialize)]
struct WrittenCatalogue {
    file: String,
    #[serde(flatten)]
    export: AgfExport,
}

impl fmt::Display for WrittenCatalogue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { file, export: AgfExport { glasses, refused, worst_index } } = self;
        let (count, left) = (counted_glasses(*glasses), refused.len());
        writeln!(f, "{count} written to {file}, {left} left out")?;
        writeln!(f, "read back: indices at most {worst_index:e} apart over the range of each")?;
        refused.iter().try_for_each(|(name, why)| writeln!(f, "  {name}: {why}"))
    }
}

/// The report on a catalogue that was removed.
#[derive(Serialize)]
struct RemovedCatalogue {
    removed: String,
}

impl fmt::Display for RemovedCatalogue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "removed {}", self.removed)
    }
}
