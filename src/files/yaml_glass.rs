//! Materials of refractiveindex.info, `.yml`: one file for each.
//!
//! The name of the file is that of the material, and the folder that holds it stands for the maker. The
//! formulas are those of the database's document *Dispersion formulas*, numbers 1 to 9; tables of indices are
//! refused by name, since between their rows every index would be a guess.

use super::agf::{AgfCatalogue, AgfGlass, check_index};
use super::bounded::{MAX_LENS_BYTES, read_file};
use super::error::FileError;
use super::own_glass::maker;
use super::text;
use crate::lens::glass::{DispersionFormula, Glass};
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

/// Reads all materials of a folder, whose name is that of the maker.
///
/// # Errors
/// A file that cannot be read, or is too long.
pub(super) fn read_materials(folder: &Path) -> Result<AgfCatalogue, FileError> {
    let mut catalogue = AgfCatalogue::default();
    for path in material_files(folder) {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        match parse_material(&read_file(&path, MAX_LENS_BYTES)?, &maker(folder), &name) {
            Ok(glass) => catalogue.glasses.push(glass),
            Err(why) => catalogue.refused.push((name, why)),
        }
    }
    Ok(catalogue)
}

/// The material of a file.
///
/// # Errors
/// The reason why it has no index: no YAML, a table, or a formula that has no value in its own range.
pub(super) fn parse_material(bytes: &[u8], maker: &str, name: &str) -> Result<AgfGlass, String> {
    if let Some(found) = text::binary_kind(bytes) {
        return Err(found);
    }
    let file: MaterialFile = serde_norway::from_str(&text::decode(bytes))
        .map_err(|why| format!("not a material of refractiveindex.info: {}", first_line(&why)))?;
    let formula = file.data.iter().find_map(|data| Some((data, data.formula()?)));
    let Some((data, (formula, coefficients))) = formula else {
        let kinds: Vec<&str> = file.data.iter().map(|data| data.kind.as_str()).collect();
        let found = if kinds.is_empty() { "no data".to_owned() } else { kinds.join(", ") };
        return Err(format!("{found}; expected one of the formulas 1 to 9"));
    };
    let range = numbers(&data.wavelength_range);
    let [low, high] = range[..] else { return Err("it has no range of wavelengths".to_owned()) };
    let number = |key: &str| file.number(key);
    let mut glass = Glass {
        name: name.to_owned(),
        manufacturer: maker.to_owned(),
        nd: number("nd").unwrap_or(f64::NAN),
        vd: number("Vd").unwrap_or(f64::NAN),
        formula,
        coefficients,
        range_um: [low, high],
        density: number("density").filter(|density| *density > 0.0),
    };
    check_index(&mut glass)?;
    Ok(AgfGlass::without_remarks(glass))
}

impl MaterialFile {
    /// A property; numbers may have a unit behind them.
    fn number(&self, key: &str) -> Option<f64> {
        let value = self.properties.get(key).or_else(|| self.specs.get(key))?;
        let text = || value.as_str()?.split_whitespace().next()?.parse().ok();
        value.as_f64().or_else(text).filter(|value: &f64| value.is_finite())
    }
}

impl MaterialData {
    /// The formula with its coefficients; `None` for a table.
    fn formula(&self) -> Option<(DispersionFormula, Vec<f64>)> {
        use DispersionFormula as F;
        let number: u8 = self.kind.strip_prefix("formula")?.trim().parse().ok()?;
        let formula = match number {
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
        };
        Some((formula, numbers(&self.coefficients)))
    }
}

/// The numbers of a text, up to the first word that is none.
fn numbers(text: &str) -> Vec<f64> {
    text.split_whitespace().map_while(|word| word.parse().ok()).collect()
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
        let glass = parse_material(text.as_bytes(), "MAKER", "G").unwrap().glass;
        glass.index(0.6).unwrap()
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
        let glass = parse_material(text.as_bytes(), "SCHOTT", "N-BK7").unwrap().glass;
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
        let no_range = material("formula 2", "0 1.1 0.01").replace("0.3 2.5", "often");
        assert!(refusal(&no_range).contains("no range of wavelengths"));
    }

    #[test]
    fn no_damage_of_a_material_is_a_panic() {
        let text = material("formula 2", "0 1.1 0.01").into_bytes();
        for i in 0..5000_usize {
            let mut damaged = text.clone();
            let at = i.wrapping_mul(2_654_435_761) % damaged.len();
            damaged[at] = (i / 7 % 256) as u8;
            if let Ok(glass) = parse_material(&damaged, "M", "G") {
                assert!(
                    glass.glass.index(0.5 * glass.glass.range_um.iter().sum::<f64>()).is_some()
                );
            }
        }
    }
}
