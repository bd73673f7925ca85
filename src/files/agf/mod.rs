//! Glass catalogues in the format of Zemax, `.agf`: one record a line, named by its first word.
//!
//! | record | content |
//! |---|---|
//! | `NM` | name, number of the formula, code, nd, vd, exclusion, status, melt frequency |
//! | `ED` | expansion from −30 to 70 °C and from 20 to 300 °C in 1e-6/K, density, `ΔPgF`, … |
//! | `CD` | coefficients of the formula |
//! | `TD` | D₀ D₁ D₂ E₀ E₁ λtk of dn/dT, reference temperature |
//! | `OD` | relative cost, codes for climate, stains, acid, alkali, phosphate |
//! | `LD` | shortest and longest wavelength, µm |
//! | `IT` | wavelength in µm, internal transmission, thickness in mm |
//!
//! A missing number is `-`; a line that begins with a number continues the record before it. Makers give the index relative to air, as this program does.

mod write;

pub use write::{AgfExport, write_agf};

use super::bounded::read_file;
use super::error::FileError;
use super::own_glass::{MAX_CATALOGUE_BYTES, maker};
use super::text;
use crate::lens::glass::{
    DispersionFormula, Glass, GlassProperties, GlassStatus, ThermalDispersion, line,
};
use std::collections::BTreeSet;
use std::path::Path;

/// The difference of two indices that may be rounding, or that of two melts.
const SAME_INDEX: f64 = 1e-4;

/// A glass catalogue of a maker.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct AgfCatalogue {
    /// The glasses, in the order of the file.
    pub glasses: Vec<Glass>,
    /// The names of glasses that are left out, each with the reason.
    pub refused: Vec<(String, String)>,
    /// The names of glasses whose formula contradicts the index that the file gives, each with both.
    pub contradictory: Vec<(String, String)>,
}

impl AgfCatalogue {
    /// Adds the glasses and remarks of another catalogue.
    pub(super) fn append(&mut self, other: Self) {
        self.glasses.extend(other.glasses);
        self.refused.extend(other.refused);
        self.contradictory.extend(other.contradictory);
    }
}

/// Reads a catalogue from a file, whose name is that of the maker.
///
/// # Errors
/// A file that cannot be read, is too long, is no text, or has no record of a glass.
pub fn read_agf(path: &Path) -> Result<AgfCatalogue, FileError> {
    let file = path.display().to_string();
    parse_agf(&read_file(path, MAX_CATALOGUE_BYTES)?, &maker(path), &file)
}

/// Reads a catalogue from the bytes of a file; `file` is its name in messages.
///
/// # Errors
/// Bytes that are no text, or a text without a record of a glass.
pub fn parse_agf(bytes: &[u8], maker: &str, file: &str) -> Result<AgfCatalogue, FileError> {
    let refuse = |found| {
        let expected = "a glass catalogue .agf with records NM, CD and LD";
        FileError::NotALens { file: file.to_owned(), found, expected }
    };
    if let Some(found) = text::binary_kind(bytes) {
        return Err(refuse(found));
    }
    let text = text::decode(bytes);
    let mut catalogue = AgfCatalogue::default();
    let mut names = BTreeSet::new();
    for records in split_glasses(&text) {
        match records.glass(maker) {
            Ok(glass) if names.insert(glass.name.clone()) => {
                let name = || glass.name.clone();
                let remark =
                    contradiction(&glass, records.stated_index()).map(|text| (name(), text));
                catalogue.contradictory.extend(remark);
                catalogue.glasses.push(glass);
            }
            Ok(glass) => {
                let why = "a second glass of this name".to_owned();
                catalogue.refused.push((glass.name, why));
            }
            Err(why) => catalogue.refused.push((records.name().to_owned(), why)),
        }
    }
    if catalogue.glasses.is_empty() && catalogue.refused.is_empty() {
        return Err(refuse("text without a glass".to_owned()));
    }
    Ok(catalogue)
}

/// The records of one glass, each as its words.
struct GlassRecords<'a>(Vec<Vec<&'a str>>);

/// The records of every glass; those before the first one are comments.
fn split_glasses(text: &str) -> Vec<GlassRecords<'_>> {
    let mut glasses: Vec<GlassRecords<'_>> = Vec::new();
    for line in text.split(['\n', '\r']) {
        let words: Vec<&str> = line.split_whitespace().collect();
        match (words.first(), glasses.last_mut()) {
            (Some(&"NM"), _) => glasses.push(GlassRecords(vec![words])),
            (Some(first), Some(glass)) if first.parse::<f64>().is_ok() => {
                glass.0.last_mut().into_iter().for_each(|record| record.extend(&words));
            }
            (Some(_), Some(glass)) => glass.0.push(words),
            _ => {}
        }
    }
    glasses
}

impl<'a> GlassRecords<'a> {
    fn name(&self) -> &'a str {
        self.0[0].get(1).copied().unwrap_or("?")
    }

    /// The words of the first record of a kind behind its tag.
    fn words(&self, tag: &str) -> &[&'a str] {
        self.0.iter().find(|words| words[0] == tag).map_or(&[], |words| &words[1..])
    }

    /// The numbers of a record; those that are missing or no numbers are NaN.
    fn numbers(&self, tag: &str) -> Vec<f64> {
        self.words(tag).iter().map(|word| number(word)).collect()
    }

    fn glass(&self, maker: &str) -> Result<Glass, String> {
        let head = self.words("NM");
        let name = head.first().ok_or("the record NM has no name")?;
        let formula = head.get(1).copied().map_or(f64::NAN, number);
        let coefficients: Vec<f64> =
            self.numbers("CD").into_iter().map(|c| if c.is_nan() { 0.0 } else { c }).collect();
        let (formula, coefficients) = dispersion(formula, &coefficients)
            .ok_or_else(|| format!("formula {} is unknown", head.get(1).unwrap_or(&"-")))?;
        let [low, high] = self.range()?;
        let mut glass = Glass {
            name: (*name).to_owned(),
            manufacturer: maker.to_owned(),
            nd: head.get(3).copied().map_or(f64::NAN, number),
            vd: head.get(4).copied().map_or(f64::NAN, number),
            formula,
            coefficients,
            range_um: [low, high],
            density: positive(self.numbers("ED").get(2)),
            own_properties: Some(Box::new(self.properties())),
        };
        check_index(&mut glass)?;
        Ok(glass)
    }

    fn properties(&self) -> GlassProperties {
        let [costs, expansions] = ["OD", "ED"].map(|tag| self.numbers(tag));
        let class = |i: usize| costs.get(i + 1).copied().filter(|class| *class >= 0.0);
        GlassProperties {
            status: self.words("NM").get(6).and_then(|word| status(word)),
            relative_cost: positive(costs.first()),
            expansion: expansions.first().copied().filter(|value| value.is_finite()),
            thermal: self.thermal(),
            resistance: std::array::from_fn(class),
            transmission: self.transmission(),
        }
    }

    /// The change of the index with temperature; six zeros stand for none.
    fn thermal(&self) -> Option<ThermalDispersion> {
        let numbers = self.numbers("TD");
        let coefficients: [f64; 6] = numbers.get(..6)?.try_into().ok()?;
        let is_known = coefficients.iter().all(|c| c.is_finite()) && coefficients[..5] != [0.0; 5];
        let celsius = numbers.get(6).copied().filter(|value| value.is_finite());
        is_known.then_some(ThermalDispersion { coefficients, celsius: celsius.unwrap_or(20.0) })
    }

    /// The index at the d line that the file gives; 0 stands for none.
    fn stated_index(&self) -> Option<f64> {
        self.words("NM").get(3).copied().map(number).filter(|nd| *nd > 0.0)
    }

    fn range(&self) -> Result<[f64; 2], String> {
        match self.numbers("LD")[..] {
            [low, high, ..] if low > 0.0 && low < high && high.is_finite() => Ok([low, high]),
            _ => Err("the record LD has no range of wavelengths".to_owned()),
        }
    }

    fn transmission(&self) -> Vec<[f64; 3]> {
        let lines = self.0.iter().filter(|words| words[0] == "IT");
        let numbers = lines.map(|words| words[1..].iter().map(|word| number(word)));
        numbers
            .filter_map(|mut numbers| Some([numbers.next()?, numbers.next()?, numbers.next()?]))
            .filter(|line| line.iter().all(|value| value.is_finite()) && line[2] > 0.0)
            .collect()
    }
}

/// The index at the d line by the file and by the formula, if they differ.
pub(super) fn contradiction(glass: &Glass, stated: Option<f64>) -> Option<String> {
    let (said, found) = (stated?, glass.index(line::D)?);
    let text = || format!("nd is {said} by the file, {found:.5} by its formula");
    ((found - said).abs() > SAME_INDEX).then(text)
}

fn number(word: &str) -> f64 {
    word.parse().unwrap_or(f64::NAN)
}

fn positive(value: Option<&f64>) -> Option<f64> {
    value.copied().filter(|value| *value > 0.0 && value.is_finite())
}

fn status(word: &str) -> Option<GlassStatus> {
    GlassStatus::ALL.get(word.parse::<usize>().ok()?).copied()
}

/// The formula of a number with its coefficients in the order of this program.
fn dispersion(formula: f64, c: &[f64]) -> Option<(DispersionFormula, Vec<f64>)> {
    use DispersionFormula as F;
    let at = |i: usize| c.get(i).copied().unwrap_or(0.0);
    let powers = |powers: &[f64]| {
        let terms = powers.iter().enumerate().flat_map(|(i, power)| [at(i + 1), *power]);
        (F::Poly, std::iter::once(at(0)).chain(terms).collect())
    };
    let sellmeier = |terms: usize| {
        let pairs = (0..2 * terms).map(at);
        (F::SellmeierSq, std::iter::once(0.0).chain(pairs).collect())
    };
    let as_written = |formula, count| (formula, (0..count).map(at).collect());
    Some(match formula {
        1.0 => powers(&[2.0, -2.0, -4.0, -6.0, -8.0]),
        2.0 => sellmeier(3),
        3.0 => as_written(F::Herzberger, 6),
        4.0 => as_written(F::SellmeierTwo, 5),
        5.0 => as_written(F::Conrady, 3),
        6.0 => sellmeier(4),
        7.0 => as_written(F::HandbookOne, 4),
        8.0 => as_written(F::HandbookTwo, 4),
        9.0 => (F::SellmeierSq, vec![at(0) - 1.0, at(1), at(2), at(3), at(4)]),
        10.0 => powers(&[2.0, -2.0, -4.0, -6.0, -8.0, -10.0, -12.0]),
        11.0 => sellmeier(5),
        12.0 => powers(&[2.0, -2.0, -4.0, -6.0, -8.0, 4.0, 6.0]),
        13.0 => powers(&[2.0, 4.0, -2.0, -4.0, -6.0, -8.0, -10.0, -12.0]),
        _ => return None,
    })
}

/// Refuses a glass whose formula has no index in its range, and takes nd and vd from the formula where
/// the file has none.
pub(super) fn check_index(glass: &mut Glass) -> Result<(), String> {
    let [low, high] = glass.range_um;
    let middle = 0.5 * (low + high);
    if [low, middle, high].iter().any(|um| glass.index(*um).is_none_or(|n| !(n < 10.0))) {
        return Err("its formula has no index in its range of wavelengths".to_owned());
    }
    let [f, d, c] = [line::F, line::D, line::C].map(|um| glass.index(um));
    match d.zip(f.zip(c)) {
        // A constant index has no Abbe number; 0 stands for none, as in model glasses.
        Some((d, (f, c))) if f == c => (glass.nd, glass.vd) = (d, 0.0),
        Some((d, (f, c))) => (glass.nd, glass.vd) = (d, (d - 1.0) / (f - c)),
        // Infrared materials have no index at the d line; what the file says of it is kept.
        None if !(glass.nd > 0.0 && glass.vd.is_finite()) => {
            (glass.nd, glass.vd) = (glass.index(middle).unwrap_or(1.0), 0.0);
        }
        None => {}
    }
    Ok(())
}
