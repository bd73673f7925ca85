//! Writing of glasses as a catalogue `.agf`, which proves itself: it is read back, and every glass has the
//! same index over its range.

use super::parse_agf;
use crate::files::atomic::write_atomic;
use crate::files::error::FileError;
use crate::files::own_glass::maker;
use crate::files::text::{number, numbers};
use crate::lens::glass::{DispersionFormula, Glass, GlassStatus};
use serde::Serialize;
use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;

/// The largest difference of an index between a glass and its record read back.
const TOLERANCE: f64 = 1e-12;
/// The number of wavelengths over the range of a glass at which the indices are compared.
const WAVELENGTHS: usize = 33;

/// The report on a catalogue that was written.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AgfExport {
    /// The number of glasses that were written.
    pub glasses: usize,
    /// The names of glasses that are left out, each with the reason.
    pub refused: Vec<(String, String)>,
    /// The largest difference of an index between a glass and its record read back.
    pub worst_index: f64,
}

/// Writes glasses as a catalogue. Its maker is the name of the file; the records have the formula, nd and vd,
/// the range, and of the density and the properties what is known.
///
/// # Errors
/// No glass that can be written, one whose index differs when it is read back, or a file that cannot be
/// written; then it is unchanged.
pub fn write_agf<'a>(
    glasses: impl IntoIterator<Item = &'a Glass>,
    path: &Path,
) -> Result<AgfExport, FileError> {
    let file = path.display().to_string();
    let mut text = "CC Written by Aplanat\r\n".to_owned();
    let (mut written, mut refused) = (Vec::new(), Vec::new());
    let mut names = BTreeSet::new();
    for glass in glasses {
        let name = short_name(glass);
        match (record(glass), names.contains(&name)) {
            (_, true) => {
                refused.push((glass.full_name(), format!("a second glass of the name {name}")));
            }
            (None, false) => {
                refused.push((glass.full_name(), "a formula that no .agf has".to_owned()));
            }
            (Some(record), false) => {
                text.push_str(&record);
                names.insert(name);
                written.push(glass);
            }
        }
    }
    if written.is_empty() {
        let (found, expected) =
            ("no glass for the catalogue".to_owned(), "one at least".to_owned());
        return Err(FileError::Unsuitable { file, found, expected });
    }
    let worst_index = largest_difference(&text, &written, path)?;
    write_atomic(path, text.as_bytes())?;
    Ok(AgfExport { glasses: written.len(), refused, worst_index })
}

/// The name without blanks, which would end it in a record.
fn short_name(glass: &Glass) -> String {
    glass.name.split_whitespace().collect()
}

/// The records of a glass; `None` for a formula that the format does not have.
fn record(glass: &Glass) -> Option<String> {
    let (formula, coefficients) = agf_formula(glass.formula, &glass.coefficients)?;
    let name = short_name(glass);
    let missing = || "-".to_owned();
    let known = glass.properties().cloned().unwrap_or_default();
    let status = status_number(known.status).map_or_else(missing, |status| status.to_string());
    let partial = glass.partial_dispersion().map_or_else(missing, |partial| {
        // The deviation from the line of normal glasses through K7 and F2.
        number(partial - (0.6438 - 0.001682 * glass.vd))
    });
    let density = glass.density.map_or_else(missing, number);
    let or_missing = |value: Option<f64>| value.map_or_else(missing, number);
    let (cost, expansion) = (or_missing(known.relative_cost), or_missing(known.expansion));
    let resistance = known.resistance.map(or_missing).join(" ");
    let code = six_digits(glass).unwrap_or_else(missing);
    let mut text = String::new();
    let mut lines = vec![
        format!("NM {name} {formula} {code} {} 0 {status} -", numbers([glass.nd, glass.vd])),
        format!("GC {}", glass.full_name()),
        format!("ED {expansion} - {density} {partial} 0"),
        format!("CD {}", numbers(coefficients)),
        format!("OD {cost} {resistance}"),
        format!("LD {}", numbers(glass.range_um)),
    ];
    lines.extend(known.thermal.map(|thermal| {
        format!("TD {} {}", numbers(thermal.coefficients), number(thermal.celsius))
    }));
    lines.extend(known.transmission.iter().map(|line| format!("IT {}", numbers(*line))));
    for line in lines {
        write!(text, "{line}\r\n").ok()?;
    }
    Some(text)
}

/// The six digits of nd and vd, `517642`; `None` for numbers that they cannot hold.
fn six_digits(glass: &Glass) -> Option<String> {
    let known = (1.0..2.0).contains(&glass.nd) && (10.0..100.0).contains(&glass.vd);
    let digits = || {
        let (index, abbe) = (1e3 * (glass.nd - 1.0), 10.0 * glass.vd);
        format!("{:03.0}{:03.0}", index.min(999.0), abbe.min(999.0))
    };
    known.then(digits)
}

fn status_number(status: Option<GlassStatus>) -> Option<usize> {
    GlassStatus::ALL.iter().position(|other| Some(*other) == status)
}

/// The number of a formula and its coefficients in the order of the format.
fn agf_formula(formula: DispersionFormula, c: &[f64]) -> Option<(usize, Vec<f64>)> {
    use DispersionFormula as F;
    let as_written = |number, count: usize| {
        let all = (0..count).map(|i| c.get(i).copied().unwrap_or(0.0));
        (c.len() <= count).then(|| (number, all.collect()))
    };
    match formula {
        F::SellmeierSq => sellmeier(c, |pole| pole),
        F::SellmeierLin => sellmeier(c, |pole| pole * pole),
        F::Poly => powers(c),
        F::Herzberger => as_written(3, 6),
        F::SellmeierTwo => as_written(4, 5),
        F::Conrady => as_written(5, 3),
        F::HandbookOne => as_written(7, 4),
        F::HandbookTwo => as_written(8, 4),
        F::Cauchy | F::Gas | F::LorentzLorenz | F::Resonance | F::ResonancesAndPowers => None,
    }
}

/// A sum of resonances: formula 2, 6 or 11 by the number of its terms. A constant is a term without a pole.
fn sellmeier(c: &[f64], pole: impl Fn(f64) -> f64) -> Option<(usize, Vec<f64>)> {
    let constant = c.first().copied().unwrap_or(0.0);
    let pairs = c.get(1..).unwrap_or_default().chunks_exact(2);
    let mut terms: Vec<f64> =
        pairs.filter(|pair| pair[0] != 0.0).flat_map(|pair| [pair[0], pole(pair[1])]).collect();
    if constant != 0.0 {
        terms.extend([constant, 0.0]);
    }
    let (number, count) = match terms.len() {
        0..=6 => (2, 6),
        7..=8 => (6, 8),
        9..=10 => (11, 10),
        _ => return None,
    };
    terms.resize(count, 0.0);
    Some((number, terms))
}

/// The powers of the wavelength of the formulas 1, 10, 12 and 13, behind the constant.
const POWERS: [(usize, &[f64]); 4] = [
    (1, &[2.0, -2.0, -4.0, -6.0, -8.0]),
    (10, &[2.0, -2.0, -4.0, -6.0, -8.0, -10.0, -12.0]),
    (12, &[2.0, -2.0, -4.0, -6.0, -8.0, 4.0, 6.0]),
    (13, &[2.0, 4.0, -2.0, -4.0, -6.0, -8.0, -10.0, -12.0]),
];

/// A sum of powers, by the first formula that has all of them.
fn powers(c: &[f64]) -> Option<(usize, Vec<f64>)> {
    let (constant, rest) = c.split_first()?;
    let terms: Vec<[f64; 2]> = rest.chunks_exact(2).map(|term| [term[0], term[1]]).collect();
    let needed = || terms.iter().filter(|[a, _]| *a != 0.0).map(|[_, power]| *power);
    let fits = |known: &[f64]| needed().all(|power| known.contains(&power));
    let (number, known) = POWERS.into_iter().find(|(_, known)| fits(known))?;
    let sum = |power: &f64| -> f64 {
        terms.iter().filter(|[_, own]| own == power).map(|[a, _]| *a).sum()
    };
    Some((number, std::iter::once(*constant).chain(known.iter().map(sum)).collect()))
}

/// The largest difference of an index between glasses and their records read back.
fn largest_difference(text: &str, glasses: &[&Glass], path: &Path) -> Result<f64, FileError> {
    let file = path.display().to_string();
    let refuse = |what: String| FileError::RoundTripFailed { file: file.clone(), what };
    let catalogue = parse_agf(text.as_bytes(), &maker(path), &file)?;
    if let Some((name, why)) = catalogue.refused.first() {
        return Err(refuse(format!("the glass {name}: {why}")));
    }
    let mut worst = 0.0_f64;
    for (glass, read) in glasses.iter().zip(&catalogue.glasses) {
        let [low, high] = glass.range_um;
        for k in 0..WAVELENGTHS {
            let um = low + (high - low) * k as f64 / (WAVELENGTHS - 1) as f64;
            let apart = match (glass.index(um), read.index(um)) {
                (Some(own), Some(read)) => (own - read).abs(),
                (None, None) => 0.0,
                _ => f64::INFINITY,
            };
            if !(apart <= TOLERANCE) {
                let name = glass.full_name();
                return Err(refuse(format!("the index of {name} at {um} µm is {apart} apart")));
            }
            worst = worst.max(apart);
        }
    }
    Ok(worst)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_is_a_resonance_without_a_pole() {
        let (number, c) = agf_formula(DispersionFormula::SellmeierLin, &[0.5, 1.0, 0.1]).unwrap();
        assert_eq!((number, &c[..]), (2, &[1.0, 0.1 * 0.1, 0.5, 0.0, 0.0, 0.0][..]));
    }

    #[test]
    fn powers_take_the_first_formula_that_has_them() {
        let number = |c: &[f64]| agf_formula(DispersionFormula::Poly, c).map(|(number, _)| number);
        assert_eq!(number(&[2.0, 0.1, 2.0, 0.2, -8.0]), Some(1));
        assert_eq!(number(&[2.0, 0.1, -12.0]), Some(10));
        assert_eq!(number(&[2.0, 0.1, 6.0]), Some(12));
        assert_eq!(number(&[2.0, 0.1, 4.0, 0.2, -10.0]), Some(13));
        assert_eq!(number(&[2.0, 0.1, 3.0]), None);
        assert_eq!(number(&[2.0, 0.0, 3.0]), Some(1));
    }
}
