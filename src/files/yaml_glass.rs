//! Materials of refractiveindex.info, `.yml`: one file for each.
//!
//! The name of the file is that of the material, and the folder that holds it stands for the maker; folders
//! that name a kind of file (`optical`, `nk`) are passed over. Indices are taken as relative to air. The
//! formulas are those of the database's document *Dispersion formulas*, numbers 1 to 9; tables of indices are
//! refused by name, since between their rows every index would be a guess.

use super::agf::{AgfCatalogue, check_index, contradiction};
use super::bounded::{MAX_LENS_BYTES, read_file};
use super::text;
use crate::lens::glass::{
    DispersionFormula, Glass, GlassProperties, GlassStatus, ThermalDispersion,
};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

#[derive(Deserialize)]
struct MaterialFile {
    #[serde(rename = "DATA", default)]
    data: Vec<MaterialData>,
    /// Properties in the files of the last years.
    #[serde(rename = "PROPERTIES", default)]
    properties: BTreeMap<String, serde_json::Value>,
    /// Properties in those before.
    #[serde(rename = "SPECS", default)]
    specs: BTreeMap<String, serde_json::Value>,
    #[serde(rename = "CONDITIONS", default)]
    conditions: BTreeMap<String, serde_json::Value>,
}

#[derive(Deserialize)]
struct MaterialData {
    #[serde(rename = "type")]
    kind: String,
    /// Two numbers; older files call it `range`.
    #[serde(alias = "range", default)]
    wavelength_range: String,
    #[serde(default)]
    coefficients: String,
    /// The rows of a table.
    #[serde(default)]
    data: String,
}

/// The thickness in mm for which transmissions are kept.
const THICKNESS: f64 = 10.0;

/// The folders of the database that name a kind of file and no maker.
const KINDS: [&str; 4] = ["optical", "nk", "infrared", "filter"];

/// The maker that the folder of a material stands for, in capitals; empty for the root folder.
pub(super) fn maker_of_folder(folder: &Path) -> String {
    let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().to_uppercase();
    let is_kind = KINDS.iter().any(|kind| name(folder) == kind.to_uppercase());
    let named = if is_kind { folder.parent().unwrap_or(folder) } else { folder };
    name(named)
}

/// True for a file of a material, by its name.
pub(super) fn is_material(path: &Path) -> bool {
    let has = |extension: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension));
    has("yml") || has("yaml")
}

/// The materials of a folder, by name.
pub(super) fn material_files(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let paths = entries.filter_map(|entry| Some(entry.ok()?.path()));
    let mut paths: Vec<PathBuf> = paths.filter(|path| is_material(path)).collect();
    paths.sort();
    paths
}

/// Reads all materials of a folder, whose name is that of the maker. Those that cannot be read are refused.
pub(super) fn read_materials(folder: &Path) -> AgfCatalogue {
    let mut catalogue = AgfCatalogue::default();
    for path in material_files(folder) {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let bytes = read_file(&path, MAX_LENS_BYTES).map_err(|why| why.to_string());
        let read = bytes.and_then(|b| parse_material(&b, &maker_of_folder(folder), &name));
        match read {
            Ok(material) => catalogue.append(material),
            Err(why) => catalogue.refused.push((name, why)),
        }
    }
    catalogue
}

/// The material of a file, alone in a catalogue, with a remark if its formula contradicts the index that it
/// gives.
///
/// # Errors
/// The reason why it has no index: no YAML, a table, or a formula that has no value in its own range.
pub(super) fn parse_material(
    bytes: &[u8],
    maker: &str,
    name: &str,
) -> Result<AgfCatalogue, String> {
    if let Some(found) = text::binary_kind(bytes) {
        return Err(found);
    }
    let file: MaterialFile = serde_norway::from_str(&text::decode(bytes))
        .map_err(|why| format!("not a material of refractiveindex.info: {}", first_line(&why)))?;
    let absolute = ["n_is_absolute", "n_absolute"];
    if absolute.iter().any(|key| file.is_true(key)) {
        return Err(
            "its indices are relative to vacuum; expected indices relative to air".to_owned()
        );
    }
    let formula = file.data.iter().find_map(|data| Some((data, data.formula()?)));
    let Some((data, formula)) = formula else {
        let kinds: Vec<&str> = file.data.iter().map(|data| data.kind.as_str()).collect();
        let found = if kinds.is_empty() { "no data".to_owned() } else { kinds.join(", ") };
        return Err(format!("{found}; expected one of the formulas 1 to 9"));
    };
    let range = numbers(&data.wavelength_range).unwrap_or_default();
    let [low, high] = range[..] else { return Err("it has no range of wavelengths".to_owned()) };
    if !(low > 0.0 && low < high) {
        return Err(format!("its range of wavelengths is {low} to {high}"));
    }
    let coefficients = numbers(&data.coefficients).filter(|c| is_whole(formula, c.len()));
    let coefficients =
        coefficients.ok_or_else(|| format!("its coefficients are `{}`", data.coefficients))?;
    let number = |key: &str| file.number(key);
    let mut glass = Glass {
        name: name.to_owned(),
        manufacturer: maker.to_owned(),
        nd: number("nd").unwrap_or(f64::NAN),
        vd: number("Vd").unwrap_or(f64::NAN),
        formula,
        coefficients,
        range_um: [low, high],
        density: file.density(),
        own_properties: Some(Box::new(file.glass_properties())),
    };
    check_index(&mut glass)?;
    let remark = contradiction(&glass, number("nd")).map(|text| (name.to_owned(), text));
    let glasses = vec![glass];
    Ok(AgfCatalogue {
        glasses,
        contradictory: remark.into_iter().collect(),
        ..AgfCatalogue::default()
    })
}

impl MaterialFile {
    /// A property; numbers may have a unit behind them.
    fn number(&self, key: &str) -> Option<f64> {
        let value = self.value(key)?;
        let text = || value.as_str()?.split_whitespace().next()?.parse().ok();
        value.as_f64().or_else(text).filter(|value: &f64| value.is_finite())
    }

    /// The density in g/cm³: files have it in this unit, or a list of values in kg/m³.
    fn density(&self) -> Option<f64> {
        let value = self.value("density")?;
        let in_grams = || {
            let text = value.as_str().filter(|text| text.contains("g/cm"))?;
            text.split_whitespace().next()?.parse().ok()
        };
        let in_kilograms = || Some(value.as_array()?.first()?.get("value")?.as_f64()? / 1000.0);
        in_grams().or_else(in_kilograms).filter(|density: &f64| *density > 0.0)
    }

    fn glass_properties(&self) -> GlassProperties {
        let classes = ["climatic", "stain", "acid", "alkali", "phosphate"];
        let named = |status: &GlassStatus| {
            self.value("glass_status").and_then(|value| value.as_str()) == Some(status.name())
        };
        GlassProperties {
            status: GlassStatus::ALL.into_iter().find(named),
            relative_cost: None,
            expansion: self.expansion(),
            thermal: self.thermal(),
            resistance: classes.map(|class| self.number(&format!("{class}_resistance"))),
            transmission: self.data.iter().find_map(MaterialData::transmission).unwrap_or_default(),
        }
    }

    fn value(&self, key: &str) -> Option<&serde_json::Value> {
        self.properties.get(key).or_else(|| self.specs.get(key))
    }

    /// The expansion in the first range of temperatures, which holds room temperature, in 1e-6/K.
    fn expansion(&self) -> Option<f64> {
        let first = self.value("thermal_expansion")?.as_array()?.first()?;
        let text = first.get("coefficient")?.as_str()?;
        let per_kelvin: f64 = text.split_whitespace().next()?.parse().ok()?;
        Some(1e6 * per_kelvin).filter(|value| value.is_finite())
    }

    fn thermal(&self) -> Option<ThermalDispersion> {
        let first = self.value("thermal_dispersion")?.as_array()?.first()?;
        let coefficients = numbers(first.get("coefficients")?.as_str()?)?.try_into().ok()?;
        let celsius = self.number("temperature").unwrap_or(20.0);
        Some(ThermalDispersion { coefficients, celsius })
    }

    fn is_true(&self, key: &str) -> bool {
        let sections = [&self.properties, &self.specs, &self.conditions];
        let value = sections.iter().find_map(|section| section.get(key));
        value.is_some_and(|value| value.as_bool() == Some(true) || value.as_str() == Some("true"))
    }
}

impl MaterialData {
    /// The internal transmission by the table of the extinction coefficient `k`: `exp(−4πk d/λ)`.
    fn transmission(&self) -> Option<Vec<[f64; 3]>> {
        if self.kind.trim() != "tabulated k" {
            return None;
        }
        let row = |line: &str| {
            let [um, extinction] = numbers(line)?.try_into().ok()?;
            let micrometres = 1e3 * THICKNESS;
            let share = (-4.0 * std::f64::consts::PI * extinction * micrometres / um).exp();
            (um > 0.0 && share <= 1.0).then_some([um, share, THICKNESS])
        };
        self.data.lines().map(row).collect()
    }

    /// The formula; `None` for a table.
    fn formula(&self) -> Option<DispersionFormula> {
        use DispersionFormula as F;
        let number: u8 = self.kind.strip_prefix("formula")?.trim().parse().ok()?;
        Some(match number {
            1 => F::SellmeierLin,
            2 => F::SellmeierSq,
            3 => F::Poly,
            4 => F::ResonancesAndPowers,
            5 => F::Cauchy,
            6 => F::Gas,
            7 => F::Herzberger,
            8 => F::LorentzLorenz,
            9 => F::Resonance,
            _ => return None,
        })
    }
}

/// True for a number of coefficients without half a term at the end.
fn is_whole(formula: DispersionFormula, count: usize) -> bool {
    use DispersionFormula as F;
    let pairs = [F::SellmeierLin, F::SellmeierSq, F::Poly, F::Cauchy, F::Gas];
    count > 0 && (count % 2 == 1 || !pairs.contains(&formula))
}

/// The numbers of a text; `None` if a word is none.
fn numbers(text: &str) -> Option<Vec<f64>> {
    let number = |word: &str| word.parse().ok().filter(|number: &f64| number.is_finite());
    text.split_whitespace().map(number).collect()
}

fn first_line(why: &serde_norway::Error) -> String {
    why.to_string().lines().next().unwrap_or_default().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn material(kind: &str, coefficients: &str) -> String {
        format!(
            "# a comment\nREFERENCES: \"somebody, <i>somewhere</i>\"\nCOMMENTS: none\nDATA:\n  - type: {kind}\n    \
             wavelength_range: 0.3 2.5\n    coefficients: {coefficients}\n  - type: tabulated k\n    data: |\n        \
             0.3 1e-6\n        0.4 2e-8\nPROPERTIES:\n    density: 2.51 g/cm<sup>3</sup>\n    nd: 1.5168\n"
        )
    }

    fn index(kind: &str, coefficients: &str) -> f64 {
        let text = material(kind, coefficients);
        let material = parse_material(text.as_bytes(), "MAKER", "G").unwrap();
        material.glasses[0].index(0.6).unwrap()
    }

    #[test]
    fn every_formula_is_that_of_the_database() {
        let um: f64 = 0.6;
        let l2 = um * um;
        let close = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-14);
        close(index("formula 1", "0.1 1.1 0.1"), (1.1 + 1.1 * l2 / (l2 - 0.01)).sqrt());
        close(index("formula 2", "0 1.1 0.01"), (1.0 + 1.1 * l2 / (l2 - 0.01)).sqrt());
        close(index("formula 3", "2.2 -0.01 2 0.01 -2"), (2.2 - 0.01 * l2 + 0.01 / l2).sqrt());
        close(
            index("formula 4", "2.2 0.1 2 0.1 2 0.02 0 0.2 2 -0.01 2"),
            (2.2 + 0.1 * l2 / (l2 - 0.01) + 0.02 / (l2 - 0.04) - 0.01 * l2).sqrt(),
        );
        close(index("formula 5", "1.5 0.004 -2 1e-4 -4"), 1.5 + 0.004 / l2 + 1e-4 / (l2 * l2));
        close(index("formula 6", "0 0.05792 238.0 0.00167 57.36"), {
            1.0 + 0.05792 / (238.0 - 1.0 / l2) + 0.00167 / (57.36 - 1.0 / l2)
        });
        let l = 1.0 / (l2 - 0.028);
        close(
            index("formula 7", "1.5 0.004 1e-4 -0.001"),
            1.5 + 0.004 * l + 1e-4 * l * l - 0.001 * l2,
        );
        let lorentz = 0.3 + 0.01 * l2 / (l2 - 0.02) - 0.001 * l2;
        close(
            index("formula 8", "0.3 0.01 0.02 -0.001"),
            ((1.0 + 2.0 * lorentz) / (1.0 - lorentz)).sqrt(),
        );
        close(index("formula 9", "2.2 0.01 0.02 0.03 0.1 1.0"), {
            (2.2 + 0.01 / (l2 - 0.02) + 0.03 * (um - 0.1) / ((um - 0.1).powi(2) + 1.0)).sqrt()
        });
    }

    #[test]
    fn the_published_numbers_of_bk7_give_its_index() {
        let coefficients =
            "0 1.03961212 0.00600069867 0.231792344 0.0200179144 1.01046945 103.560653";
        let text = material("formula 2", coefficients);
        let material = parse_material(text.as_bytes(), "SCHOTT", "N-BK7").unwrap();
        assert_eq!(material.contradictory, []);
        let glass = &material.glasses[0];
        // The data sheet: nd 1.51680, vd 64.17.
        assert!((glass.nd - 1.51680).abs() < 5e-6 && (glass.vd - 64.17).abs() < 5e-3);
        assert_eq!(glass.density, Some(2.51));
        assert_eq!((glass.full_name(), glass.range_um), ("SCHOTT N-BK7".to_owned(), [0.3, 2.5]));
    }

    #[test]
    fn what_has_no_formula_is_refused_by_name() {
        let refusal =
            |text: &str| parse_material(text.as_bytes(), "M", "G").err().unwrap_or_default();
        let table = material("tabulated nk", "");
        assert!(
            refusal(&table).contains("tabulated nk, tabulated k; expected one of the formulas")
        );
        assert!(refusal("REFERENCES: none").contains("no data; expected"));
        assert!(refusal(": : [").contains("not a material"));
        assert!(refusal("").contains("an empty file"));
        assert!(refusal(&material("formula 12", "1 2 3")).contains("formula 12, tabulated k"));
        assert!(refusal(&material("formula 2", "-3")).contains("no index in its range"));
        assert!(
            refusal(&material("formula 2", "0 1.1 0,01")).contains("coefficients are `0 1.1 0,01`")
        );
        assert!(refusal(&material("formula 2", "0 1.1")).contains("coefficients are `0 1.1`"));
        let backwards = material("formula 2", "0 1.1 0.01").replace("0.3 2.5", "2.5 0.3");
        assert!(refusal(&backwards).contains("range of wavelengths is 2.5 to 0.3"));
        let vacuum = material("formula 2", "0 1.1 0.01") + "SPECS:\n    n_is_absolute: true\n";
        assert!(refusal(&vacuum).contains("relative to vacuum"));
        let no_range = material("formula 2", "0 1.1 0.01").replace("0.3 2.5", "often");
        assert!(refusal(&no_range).contains("no range of wavelengths"));
    }

    #[test]
    fn an_index_that_contradicts_the_formula_is_named() {
        let remarks = |nd: &str| {
            let text = material("formula 2", "0 1.1 0.01").replace("nd: 1.5168", nd);
            parse_material(text.as_bytes(), "M", "G").unwrap().contradictory
        };
        // n² = 1 + 1.1 λ²/(λ² − 0.01) at 0.5875618 µm.
        let text = "nd is 1.5168 by the file, 1.46042 by its formula".to_owned();
        assert_eq!(remarks("nd: 1.5168"), [("G".to_owned(), text)]);
        assert_eq!(remarks("nd: 1.46042"), []);
        assert_eq!(remarks("Vd: 50"), []);
    }

    #[test]
    fn densities_of_both_ages_of_the_database_are_in_grams() {
        let list = material("formula 2", "0 1.1 0.01")
            .replace("density: 2.51 g/cm<sup>3</sup>", "density:\n      - value: 2510");
        let density =
            |text: &str| parse_material(text.as_bytes(), "M", "G").unwrap().glasses[0].density;
        assert!((density(&list).unwrap() - 2.51).abs() < 1e-12);
        let bare = material("formula 2", "0 1.1 0.01").replace("2.51 g/cm<sup>3</sup>", "2510");
        assert_eq!(density(&bare), None);
    }

    #[test]
    fn the_folder_of_a_material_stands_for_its_maker() {
        let maker = |path: &str| maker_of_folder(Path::new(path));
        assert_eq!(maker("data/specs/schott/optical"), "SCHOTT");
        assert_eq!(maker("data/main/SiO2/nk"), "SIO2");
        assert_eq!((maker("lib.v1.2"), maker("/")), ("LIB.V1.2".to_owned(), String::new()));
    }

    #[test]
    fn no_damage_of_a_material_is_a_panic() {
        let text = material("formula 2", "0 1.1 0.01").into_bytes();
        for i in 0..5000_usize {
            let mut damaged = text.clone();
            let at = i.wrapping_mul(2_654_435_761) % damaged.len();
            damaged[at] = (i / 7 % 256) as u8;
            if let Ok(material) = parse_material(&damaged, "M", "G") {
                let glass = &material.glasses[0];
                assert!(glass.index(0.5 * glass.range_um.iter().sum::<f64>()).is_some());
            }
        }
    }
}
