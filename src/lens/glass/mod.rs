//! Refractive index of glasses as a function of the wavelength, by catalogue name or from nd and vd.
//!
//! The catalogue is `assets/glasses.json`, a subset of the refractiveindex.info database (CC0);
//! `assets/further_glasses.json` holds more of it, for lenses that name those glasses.
//! Indices are relative to air at about 20 °C, as in the catalogues of the manufacturers, or at another
//! temperature with [`Glass::index_at`]. A person may add catalogues of their own with [`add`].

mod added;
mod dispersion;
mod melt;
mod price;
mod properties;
mod thermal;

pub use added::{add, added_glasses, additions};
pub use dispersion::DispersionFormula;
pub use melt::MeltError;
pub use price::{GlassPrice, PriceSource, set_prices};
pub use properties::{GlassProperties, GlassStatus};
pub use thermal::{THERMAL_RANGE, ThermalDispersion};

use serde::Deserialize;
use std::collections::HashMap;
use std::sync::OnceLock;

/// Wavelengths in micrometres of the spectral lines to which index and Abbe number refer.
pub mod line {
    /// The blue line of mercury.
    pub const G: f64 = 0.4358343;
    /// The blue line of hydrogen.
    pub const F: f64 = 0.4861327;
    /// The yellow line of helium.
    pub const D: f64 = 0.5875618;
    /// The red line of hydrogen.
    pub const C: f64 = 0.6562725;
}

/// The largest distance in index and Abbe number of two glasses that are the same.
const TWIN: [f64; 2] = [2e-4, 0.1];

/// One glass of the catalogue.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Glass {
    /// The name that the manufacturer gives it.
    pub name: String,
    /// The manufacturer: SCHOTT, OHARA, HOYA, …
    #[serde(rename = "maker")]
    pub manufacturer: String,
    /// The index at the d line.
    pub nd: f64,
    /// The Abbe number at the d line.
    pub vd: f64,
    /// The dispersion formula.
    pub formula: DispersionFormula,
    /// The coefficients of the formula.
    pub coefficients: Vec<f64>,
    /// The shortest and the longest wavelength of the formula, in micrometres.
    pub range_um: [f64; 2],
    /// The density in g/cm³; `None` if the catalogue does not have it.
    #[serde(rename = "density_g_cm3", default)]
    pub density: Option<f64>,
    /// The properties in its own catalogue; `None` for a glass of the program, whose properties are found by
    /// its name.
    #[serde(skip)]
    pub own_properties: Option<Box<GlassProperties>>,
}

impl Glass {
    /// The index at a wavelength in micrometres; `None` outside the range of the formula.
    pub fn index(&self, um: f64) -> Option<f64> {
        let [low, high] = self.range_um;
        if !(low..=high).contains(&um) {
            return None;
        }
        self.formula.index(&self.coefficients, um)
    }

    /// The properties beside its dispersion; `None` if none is known.
    pub fn properties(&self) -> Option<&GlassProperties> {
        self.own_properties.as_deref().or_else(|| properties::find(&self.full_name()))
    }

    /// The index at a wavelength in micrometres and a temperature in °C, relative to air of that
    /// temperature; `None` outside the range of the formula, or if its change with temperature is unknown.
    pub fn index_at(&self, um: f64, celsius: f64) -> Option<f64> {
        let thermal = self.properties()?.thermal?;
        Some(thermal.index_at(self.index(um)?, um, celsius))
    }

    /// True if its name says that it is free of lead and arsenic: the makers mark such glasses (Schott `N-`
    /// and `P-`, Ohara `S-` and `L-`, CDGM `H-` and `D-`, Sumita `K-`, Hikari `J-` and `Q-`, Hoya `E-`, `M-`
    /// and `MC-`). A glass without a mark may be free of them too.
    pub fn is_marked_lead_free(&self) -> bool {
        let marks: &[&str] = match self.manufacturer.as_str() {
            "SCHOTT" => &["N-", "P-"],
            "OHARA" => &["S-", "L-"],
            "CDGM" => &["H-", "D-"],
            "SUMITA" => &["K-"],
            "HIKARI" => &["J-", "Q-"],
            "HOYA" => &["E-", "M-", "MC-"],
            _ => &[],
        };
        marks.iter().any(|mark| self.name.starts_with(mark))
    }

    /// The partial dispersion `PgF = (ng − nF)/(nF − nC)`; `None` if the formula does not reach these lines.
    pub fn partial_dispersion(&self) -> Option<f64> {
        let [g, f, c] = [line::G, line::F, line::C].map(|um| self.index(um));
        let (g, f, c) = (g?, f?, c?);
        Some((g - f) / (f - c)).filter(|partial| partial.is_finite())
    }

    /// True if another glass has nearly the same index and Abbe number: another maker's name for it.
    pub fn is_twin_of(&self, other: &Self) -> bool {
        (self.nd - other.nd).abs() < TWIN[0] && (self.vd - other.vd).abs() < TWIN[1]
    }

    /// The names of other makers for this glass, and its own others, in the order of [`known`].
    pub fn twins(&self) -> Vec<&'static Self> {
        let own = normalize(&self.full_name());
        let is_other = |glass: &&'static Self| normalize(&glass.full_name()) != own;
        let mut twins: Vec<_> = known().filter(|glass| self.is_twin_of(glass)).collect();
        twins.retain(is_other);
        // A catalogue that was added may name glasses of the program once more.
        let mut names = std::collections::HashSet::new();
        twins.retain(|glass| names.insert(normalize(&glass.full_name())));
        twins
    }

    /// The manufacturer and the name, as in lens files.
    pub fn full_name(&self) -> String {
        format!("{} {}", self.manufacturer, self.name)
    }
}

#[derive(Deserialize)]
struct GlassCatalogue {
    glasses: Vec<Glass>,
}

/// Every glass that comes with the program.
pub fn catalogue() -> &'static [Glass] {
    static CATALOGUE: OnceLock<Vec<Glass>> = OnceLock::new();
    CATALOGUE.get_or_init(|| parse_catalogue(include_str!("../../../assets/glasses.json")))
}

/// Glasses that are found by name alone: a search or a design does not propose them.
fn further_catalogue() -> &'static [Glass] {
    static CATALOGUE: OnceLock<Vec<Glass>> = OnceLock::new();
    CATALOGUE.get_or_init(|| parse_catalogue(include_str!("../../../assets/further_glasses.json")))
}

/// Some glasses, of twins only the first.
pub fn distinct<'a>(glasses: impl IntoIterator<Item = &'a Glass>) -> Vec<&'a Glass> {
    let mut found: Vec<&Glass> = Vec::new();
    for glass in glasses {
        if !found.iter().any(|other| other.is_twin_of(glass)) {
            found.push(glass);
        }
    }
    found
}

fn parse_catalogue(text: &str) -> Vec<Glass> {
    let parsed: Result<GlassCatalogue, _> = serde_json::from_str(text);
    parsed.map(|c| c.glasses).unwrap_or_default()
}

/// Every glass that a name can mean: those of [`catalogue`], then the further ones, then the added
/// ones.
pub fn known() -> impl Iterator<Item = &'static Glass> {
    catalogue().iter().chain(further_catalogue()).chain(added_glasses())
}

/// The glass with this name, `SCHOTT N-BK7` or, if only one manufacturer has it, `N-BK7`; blanks and
/// case are ignored. The further glasses are searched next, and those that a person has added last, so
/// that no catalogue changes the meaning of a name.
pub fn find(name: &str) -> Option<&'static Glass> {
    find_built_in(name).or_else(|| find_added(name))
}

/// The glass of the program with this name, as [`find`] understands it.
pub fn find_built_in(name: &str) -> Option<&'static Glass> {
    let name = normalize(name);
    let listed = names().get(&name).copied();
    listed.unwrap_or_else(|| further_names().get(&name).copied().flatten())
}

/// The glass that a person has added with this name, as [`find`] understands it.
pub fn find_added(name: &str) -> Option<&'static Glass> {
    added::find(&normalize(name))
}

/// The glass of every name; `None` for a name that two manufacturers share.
fn names() -> &'static HashMap<String, Option<&'static Glass>> {
    static NAMES: OnceLock<HashMap<String, Option<&'static Glass>>> = OnceLock::new();
    NAMES.get_or_init(|| index_names(catalogue().iter()))
}

/// The further glass of every name, likewise.
fn further_names() -> &'static HashMap<String, Option<&'static Glass>> {
    static NAMES: OnceLock<HashMap<String, Option<&'static Glass>>> = OnceLock::new();
    NAMES.get_or_init(|| index_names(further_catalogue().iter()))
}

fn index_names(
    glasses: impl DoubleEndedIterator<Item = &'static Glass> + Clone,
) -> HashMap<String, Option<&'static Glass>> {
    let mut names: HashMap<_, Option<&'static Glass>> = HashMap::new();
    for glass in glasses.clone() {
        let short = names.entry(normalize(&glass.name));
        short.and_modify(|only| *only = None).or_insert(Some(glass));
    }
    for glass in glasses.rev() {
        names.insert(normalize(&glass.full_name()), Some(glass));
    }
    names
}

/// The name in upper case without blanks.
fn normalize(name: &str) -> String {
    name.chars().filter(|c| !c.is_whitespace()).flat_map(char::to_uppercase).collect()
}

/// Catalogue names similar to one that was not found, for an error message.
pub fn similar_names(name: &str) -> Vec<String> {
    let letters = |text: &str| -> String {
        normalize(text).chars().filter(char::is_ascii_alphanumeric).collect()
    };
    let wanted = letters(name);
    let near = |glass: &&Glass| {
        let short = letters(&glass.name);
        wanted.ends_with(&short) || short.contains(&wanted)
    };
    catalogue().iter().filter(near).take(3).map(Glass::full_name).collect()
}

/// The distance of a glass from an index and an Abbe number at the d line: 0.001 in the index counts as
/// much as 0.5 in the Abbe number, and both as 1.
pub fn distance(glass: &Glass, nd: f64, vd: f64) -> f64 {
    ((glass.nd - nd) / 1e-3).hypot((glass.vd - vd) / 0.5)
}

/// The catalogue glass nearest to an index and an Abbe number at the d line, by [`distance`].
pub fn nearest(nd: f64, vd: f64) -> Option<&'static Glass> {
    let from = |glass: &&Glass| distance(glass, nd, vd);
    catalogue().iter().min_by(|a, b| from(a).total_cmp(&from(b)))
}

/// The partial dispersion `PgF` of a glass on the normal line through K7 and F2, by its Abbe number:
/// `0.6438 − 0.001682 vd` (Schott TIE-29).
pub fn normal_partial_dispersion(vd: f64) -> f64 {
    0.6438 - 0.001682 * vd
}

/// The index of a model glass at a wavelength in micrometres, from index and Abbe number at the d
/// line, by Conrady's form `n = A + B/λ + C/λ^3.5` through nd, the difference nF − nC, and the
/// partial dispersion of the normal line, [`normal_partial_dispersion`]; constant for `vd = 0`.
pub fn model_index(nd: f64, vd: f64, um: f64) -> f64 {
    if vd == 0.0 {
        return nd;
    }
    let p = |l: f64| 1.0 / l;
    let q = |l: f64| l.powf(-3.5);
    let spread = (nd - 1.0) / vd;
    let partial = normal_partial_dispersion(vd) * spread;
    // B and C from nF − nC and ng − nF.
    let (a11, a12) = (p(line::F) - p(line::C), q(line::F) - q(line::C));
    let (a21, a22) = (p(line::G) - p(line::F), q(line::G) - q(line::F));
    let determinant = a11 * a22 - a12 * a21;
    let b = (spread * a22 - partial * a12) / determinant;
    let c = (a11 * partial - a21 * spread) / determinant;
    nd + b * (p(um) - p(line::D)) + c * (q(um) - q(line::D))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_catalogue_agrees_with_its_own_nd_and_vd() {
        assert!(catalogue().len() > 300);
        for glass in known() {
            let n = |um| glass.index(um).unwrap();
            let vd = (n(line::D) - 1.0) / (n(line::F) - n(line::C));
            assert!((n(line::D) - glass.nd).abs() < 2e-6, "{}", glass.full_name());
            assert!((vd - glass.vd).abs() < 2e-3 * vd, "{}", glass.full_name());
        }
    }

    #[test]
    fn further_glasses_are_found_by_name_and_not_proposed() {
        assert!(further_catalogue().len() > 1000);
        assert_eq!(find("J-LAK02").unwrap().full_name(), "HIKARI J-LAK02");
        assert!(catalogue().iter().all(|glass| glass.name != "J-LAK02"));
        // The data sheet of 1993 says 1.5230 at the d line.
        assert!((find("B270").unwrap().nd - 1.5230).abs() < 4e-5);
        // A name of the catalogue keeps its meaning.
        assert_eq!(find("N-BK7").unwrap().full_name(), "SCHOTT N-BK7");
    }

    #[test]
    fn the_nearest_glass_of_a_glass_is_itself() {
        let bk7 = find("SCHOTT N-BK7").unwrap();
        assert_eq!(nearest(bk7.nd, bk7.vd).unwrap().nd, bk7.nd);
    }

    #[test]
    fn a_model_glass_has_its_index_and_abbe_number() {
        let n = |um| model_index(1.62004, 36.37, um);
        assert!((n(line::D) - 1.62004).abs() < 1e-15);
        assert!(((n(line::D) - 1.0) / (n(line::F) - n(line::C)) - 36.37).abs() < 1e-9);
        let real = find("SCHOTT F2").unwrap();
        assert!((n(line::G) - real.index(line::G).unwrap()).abs() < 1e-4);
    }
}
