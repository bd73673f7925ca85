//! The surface types that are freeforms: reading, and writing with the same parameters.
//!
//! | type | parameters | extra data |
//! |---|---|---|
//! | `ODDASPHE` | 1 to 8: r to r⁸ | |
//! | `XOSPHERE` | | 1 count, 2 unit R, then (r/R)^k |
//! | `BICONICX` | 1 radius in x, 0 for flat; 2 conic constant in x | |
//! | `TOROIDAL` | 1 radius of rotation, 0 for a cylinder; 2 to 8: y² to y¹⁴ | 1 count of Zernike terms |
//! | `XPOLYNOM` | | 1 count, 2 unit R, then x, y, x², xy, … |
//! | `PARAXIAL` | 1 focal length; 2 mode of the optical path | |
//! | `DGRATING` | 1 lines per µm; 2 order | |
//! | `QED_TYPE` | | 1 kind: 0 mild, 1 strong; 2 count, 3 radius R, then terms |
//! | `BINARY_2` | 0 order; 1 to 8: r² to r¹⁶ | 1 count, 2 radius R, then radians of (r/R)^(2k) |
//! | `BINARY_1` | as `BINARY_2` | 1 count, 2 radius R, then radians of x, y, x², xy, … |
//! | `SZERNSAG`, `FZERNSAG` | 0 continued beyond R; 1 to 8: r² to r¹⁶ | 1 count, 2 radius R, then terms |

use super::file::ZemaxSurface;
use super::shape::{self, ZemaxShape};
use crate::files::report::ConversionOutcome;
use crate::lens::{Freeform, FreeformKind, IdealElement, Row};

/// The freeform of a surface of a type that is none of revolution; `None` for another type.
pub(super) fn surface_form(surface: &ZemaxSurface) -> Option<Result<ZemaxShape, String>> {
    let base = ZemaxShape::base(surface);
    let form = match surface.kind.0.as_str() {
        "PARAXIAL" | "DGRATING" => return Some(ideal(base, surface)),
        "BICONICX" => return Some(Ok(biconic(base, surface))),
        "TOROIDAL" => toroid(surface),
        // Without terms it is its conic, whatever the unit.
        "XPOLYNOM" if !(extra(surface, 1) >= 1.0) => return Some(Ok(base)),
        "XPOLYNOM" => polynomial(surface),
        "QED_TYPE" => forbes(surface),
        "BINARY_1" | "BINARY_2" => return Some(phase(surface)),
        "SZERNSAG" | "FZERNSAG" => return Some(zernike(&base, surface)),
        _ => return None,
    };
    Some(form.map(|form| ZemaxShape { freeform: Some(form), ..base }))
}

/// A paraxial lens or a grating.
fn ideal(base: ZemaxShape, surface: &ZemaxSurface) -> Result<ZemaxShape, String> {
    let (first, second) = (parameter(surface, 1), parameter(surface, 2));
    if surface.kind.0 == "DGRATING" {
        let ideal = IdealElement::Grating { lines_per_mm: 1e3 * first, order: second };
        return Ok(ZemaxShape { ideal: Some(ideal), ..base });
    }
    if base.curvature != 0.0 || first == 0.0 {
        return Err(format!("the focal length {first} and the curvature {}", base.curvature));
    }
    let note = "its optical path is that of a plane wave in front of it";
    let note = Some((surface.kind.1, ConversionOutcome::Used, note.to_owned()));
    let ideal = Some(IdealElement::Lens { focal_length: first });
    Ok(ZemaxShape { conic: 0.0, ideal, note, ..base })
}

fn parameter(surface: &ZemaxSurface, index: usize) -> f64 {
    let found = surface.parameters.iter().rfind(|(i, ..)| *i == index);
    found.map_or(0.0, |(_, value, _)| *value)
}

fn extra(surface: &ZemaxSurface, index: usize) -> f64 {
    let found = surface.extra.iter().rfind(|(i, ..)| *i == index);
    found.map_or(0.0, |(_, value, _)| *value)
}

/// The terms of the extra data, as many as the count at `first`, without zeros at the end; behind the
/// count is the radius R.
fn extra_terms(surface: &ZemaxSurface, first: usize) -> Result<(f64, Vec<f64>), String> {
    let (count, unit) = (extra(surface, first), extra(surface, first + 1));
    let places = (1..1_001_u32).take_while(|i| f64::from(*i) <= count);
    let mut terms: Vec<f64> = places.map(|i| extra(surface, first + 1 + i as usize)).collect();
    trim(&mut terms);
    if terms.iter().any(|a| !a.is_finite()) || !(unit > 0.0 && unit.is_finite()) {
        return Err(format!("the normalization radius {unit}"));
    }
    Ok((unit, terms))
}

fn trim(terms: &mut Vec<f64>) {
    let used = terms.iter().rposition(|a| *a != 0.0).map_or(0, |last| last + 1);
    terms.truncate(used);
}

fn reciprocal(radius: f64) -> f64 {
    if radius == 0.0 { 0.0 } else { radius.recip() }
}

/// A form, if the numbers can be traced.
fn checked(kind: FreeformKind, numbers: Vec<f64>) -> Result<Freeform<f64>, String> {
    let form = Freeform { kind, numbers };
    form.fault().map_or(Ok(form), Err)
}

/// A biconic; a surface that is round is a conic.
fn biconic(base: ZemaxShape, surface: &ZemaxSurface) -> ZemaxShape {
    let curvature = reciprocal(parameter(surface, 1));
    let conic = parameter(surface, 2);
    let round = (curvature - base.curvature).abs() <= 1e-15 * curvature.abs()
        && (conic == base.conic || curvature == 0.0);
    let form = Freeform { kind: FreeformKind::Biconic, numbers: vec![curvature, conic] };
    ZemaxShape { freeform: (!round).then_some(form), ..base }
}

fn toroid(surface: &ZemaxSurface) -> Result<Freeform<f64>, String> {
    let zernike = extra_terms(surface, 1).is_ok_and(|(_, terms)| !terms.is_empty());
    if zernike {
        return Err("Zernike terms".to_owned());
    }
    let mut terms: Vec<f64> = (2..=8).map(|i| parameter(surface, i)).collect();
    trim(&mut terms);
    terms.insert(0, reciprocal(parameter(surface, 1)));
    checked(FreeformKind::Toroid, terms)
}

fn polynomial(surface: &ZemaxSurface) -> Result<Freeform<f64>, String> {
    let (radius, terms) = extra_terms(surface, 1)?;
    checked(FreeformKind::XyPolynomial { radius }, terms)
}

/// An asphere of Forbes.
fn forbes(surface: &ZemaxSurface) -> Result<Freeform<f64>, String> {
    let kind = extra(surface, 1);
    let (radius, terms) = extra_terms(surface, 2)?;
    match kind {
        0.0 => checked(FreeformKind::QBfs { radius }, terms),
        1.0 => checked(FreeformKind::QCon { radius }, terms),
        _ => Err(format!("the kind {kind}")),
    }
}

/// A diffractive surface on an even asphere.
fn phase(surface: &ZemaxSurface) -> Result<ZemaxShape, String> {
    let powers = shape::parameter_terms(&surface.parameters, |i| 2 * i);
    let base = shape::even_polynomial(surface, &powers)?;
    if !(extra(surface, 1) >= 1.0) {
        return Ok(base);
    }
    let (radius, terms) = extra_terms(surface, 1)?;
    let stated = surface.parameters.iter().any(|(i, ..)| *i == 0);
    let order = if stated { parameter(surface, 0) } else { 1.0 };
    let kind = if surface.kind.0 == "BINARY_2" {
        FreeformKind::RadialPhase { radius, order }
    } else {
        FreeformKind::XyPhase { radius, order }
    };
    let note = "the file states no diffraction order; order 1 is taken";
    let note = (surface.kind.1, ConversionOutcome::Approximated, note.to_owned());
    let note = if stated { base.note } else { Some(note) };
    Ok(ZemaxShape { freeform: Some(checked(kind, terms)?), note, ..base })
}

/// A Zernike sag; its term in r² is split exactly between the focus and the piston.
fn zernike(base: &ZemaxShape, surface: &ZemaxSurface) -> Result<ZemaxShape, String> {
    let (radius, mut terms) = extra_terms(surface, 1)?;
    let decenters = [9, 10].map(|i| parameter(surface, i));
    if decenters != [0.0; 2] {
        return Err("decentred Zernike terms".to_owned());
    }
    let is_standard = surface.kind.0 == "SZERNSAG";
    let square = parameter(surface, 1) * radius * radius;
    if square != 0.0 {
        terms.resize(terms.len().max(4), 0.0);
        let focus = if is_standard { 3.0_f64.sqrt() } else { 1.0 };
        // ρ² = (Z₄/√3 + 1)/2, without the root in the fringe order.
        terms[3] += 0.5 * square / focus;
        terms[0] += 0.5 * square;
    }
    let kind = if is_standard {
        FreeformKind::Zernike { radius }
    } else {
        FreeformKind::FringeZernike { radius }
    };
    let mut asphere: Vec<f64> = (2..=8).map(|i| parameter(surface, i)).collect();
    trim(&mut asphere);
    let note = "the Zernike terms continue beyond their normalization radius here";
    let note = (parameter(surface, 0) == 0.0)
        .then(|| (surface.kind.1, ConversionOutcome::Approximated, note.to_owned()));
    Ok(ZemaxShape { asphere, freeform: Some(checked(kind, terms)?), note, ..*base })
}

/// A conic with powers of r that are no even ones up to r¹⁶ alone; each term has its power, its
/// coefficient and its line.
pub(super) fn odd_asphere(terms: &[(usize, f64, usize)]) -> Result<Freeform<f64>, String> {
    let most = FreeformKind::OddAsphere.counts()[1];
    let mut numbers = Vec::new();
    for &(power, value, line) in terms.iter().filter(|(_, value, _)| *value != 0.0) {
        if power == 0 || power > most {
            return Err(format!("a term in r^{power} (line {line})"));
        }
        numbers.resize(numbers.len().max(power), 0.0);
        numbers[power - 1] += value;
    }
    checked(FreeformKind::OddAsphere, numbers)
}

/// The lines of a freeform: its type, then its parameters and extra data.
pub(super) struct FormLines {
    /// The name of the type.
    pub(super) kind: &'static str,
    /// The parameters, each with its number.
    pub(super) parameters: Vec<(usize, f64)>,
    /// The extra data, from the first on.
    pub(super) extra: Vec<f64>,
}

/// The lines for the form of a row; `None` if the format has no such surface.
pub(super) fn form_lines(row: &Row, form: &Freeform<f64>) -> Option<FormLines> {
    let plain = row.asphere.iter().all(|a| *a == 0.0);
    let lines = |kind, parameters, extra| Some(FormLines { kind, parameters, extra });
    let normalised = |radius: f64| {
        let head = [form.numbers.len() as f64, radius];
        head.into_iter().chain(form.numbers.iter().copied()).collect::<Vec<f64>>()
    };
    let numbered = |first: usize, numbers: &[f64]| -> Vec<(usize, f64)> {
        (first..).zip(numbers.iter().copied()).collect()
    };
    match form.kind {
        FreeformKind::OddAsphere => {
            let powers = merged_powers(row, form);
            if powers.len() <= 8 {
                return lines("ODDASPHE", numbered(1, &powers), Vec::new());
            }
            let head = [powers.len() as f64, 1.0];
            lines("XOSPHERE", Vec::new(), head.into_iter().chain(powers).collect())
        }
        FreeformKind::Biconic if plain => {
            let numbers = [reciprocal(form.numbers[0]), form.numbers[1]];
            lines("BICONICX", numbered(1, &numbers), Vec::new())
        }
        FreeformKind::Toroid if plain => {
            let mut numbers = form.numbers.clone();
            numbers[0] = reciprocal(numbers[0]);
            lines("TOROIDAL", numbered(1, &numbers), Vec::new())
        }
        FreeformKind::XyPolynomial { radius } if plain => {
            lines("XPOLYNOM", Vec::new(), normalised(radius))
        }
        FreeformKind::QCon { radius } | FreeformKind::QBfs { radius } if plain => {
            let strong = matches!(form.kind, FreeformKind::QCon { .. });
            let mut extra = normalised(radius);
            extra.insert(0, f64::from(u8::from(strong)));
            lines("QED_TYPE", Vec::new(), extra)
        }
        FreeformKind::RadialPhase { radius, order } => {
            lines("BINARY_2", even_parameters(row, order), normalised(radius))
        }
        FreeformKind::XyPhase { radius, order } => {
            lines("BINARY_1", even_parameters(row, order), normalised(radius))
        }
        FreeformKind::Zernike { radius } => {
            lines("SZERNSAG", even_parameters(row, 1.0), normalised(radius))
        }
        FreeformKind::FringeZernike { radius } => {
            lines("FZERNSAG", even_parameters(row, 1.0), normalised(radius))
        }
        _ => None,
    }
}

/// The lines of a paraxial lens or a grating; `None` for a grating on a surface that is no conic.
pub(super) fn ideal_lines(row: &Row, ideal: IdealElement) -> Option<FormLines> {
    let extra = Vec::new();
    match ideal {
        IdealElement::Lens { focal_length } => {
            let parameters = vec![(1, focal_length), (2, 0.0)];
            Some(FormLines { kind: "PARAXIAL", parameters, extra })
        }
        IdealElement::Grating { lines_per_mm, order } => {
            let conic = row.freeform.is_none() && row.asphere.iter().all(|a| *a == 0.0);
            let parameters = vec![(1, 1e-3 * lines_per_mm), (2, order)];
            conic.then_some(FormLines { kind: "DGRATING", parameters, extra })
        }
    }
}

/// The lines of a row of a type of its own; `None` for a conic with even powers, and for what the format
/// does not have.
pub(super) fn row_lines(row: &Row) -> Option<FormLines> {
    match (row.ideal, &row.freeform) {
        (Some(ideal), _) => ideal_lines(row, ideal),
        (None, Some(form)) => form_lines(row, form),
        (None, None) => None,
    }
}

/// The first parameter, which is the order or says that the terms continue beyond the radius; then the
/// powers from r⁴ on.
fn even_parameters(row: &Row, first: f64) -> Vec<(usize, f64)> {
    let powers = row.asphere.iter().enumerate().map(|(term, a)| (term + 2, *a));
    std::iter::once((0, first)).chain(powers).collect()
}

/// All powers of r beside the conic, from the first on.
pub(in crate::files) fn merged_powers(row: &Row, form: &Freeform<f64>) -> Vec<f64> {
    let mut powers = form.numbers.clone();
    for (term, a) in row.asphere.iter().enumerate().filter(|(_, a)| **a != 0.0) {
        powers.resize(powers.len().max(2 * term + 4), 0.0);
        powers[2 * term + 3] += a;
    }
    trim(&mut powers);
    powers
}

/// The number of a freeform that a parameter is.
pub(super) fn varied_number(kind: &str, index: usize) -> Option<usize> {
    // The first parameter of these is a radius, of which a curvature is no linear function.
    let (first, last) = match kind {
        "ODDASPHE" => (1, 8),
        "BICONICX" => (2, 2),
        "TOROIDAL" => (2, 8),
        _ => return None,
    };
    (first..=last).contains(&index).then(|| index - 1)
}
