//! The medium of a `GLAS` line.
//!
//! The line names a glass but not its maker: the catalogues of `GCAT` are searched in their order.
//! Index and Abbe number on the line may be placeholders; they are used only where no catalogue has the
//! name.

use super::file::{GlassLine, ZemaxSurface};
use crate::files::error::ParseError;
use crate::files::report::ConversionOutcome;
use crate::lens::Medium;
use crate::lens::glass::{self, Glass};

/// A medium, the outcome of its import, and the note on it.
pub(super) type ImportedMedium = (Medium, ConversionOutcome, String);

/// The medium behind surface `number`.
pub(super) fn medium(
    surfaces: &[ZemaxSurface],
    number: usize,
    catalogues: &[String],
) -> Result<ImportedMedium, ParseError> {
    let mut at = number;
    // A glass may be picked up from a surface that has a pickup itself.
    for _ in 0..=surfaces.len() {
        let line = surfaces.get(at).and_then(|surface| surface.glass.as_ref());
        match line {
            None => return Ok((Medium::Air, ConversionOutcome::Used, String::new())),
            Some(line) if line.code == 2 => at = line.source.unwrap_or(usize::MAX),
            Some(line) => return resolve_glass(line, catalogues),
        }
    }
    let line = surfaces[number].glass.as_ref().map_or(0, |glass| glass.line);
    let found = format!("surface {number}, whose glass pickups form a circle");
    Err(malformed_glass(line, found, "a pickup that ends at a glass"))
}

fn malformed_glass(line: usize, found: String, expected: &str) -> ParseError {
    ParseError { place: format!("line {line}"), found, expected: expected.to_owned() }
}

fn resolve_glass(line: &GlassLine, catalogues: &[String]) -> Result<ImportedMedium, ParseError> {
    let name = line.name.to_ascii_uppercase();
    match (name.as_str(), line.code) {
        ("MIRROR", _) => return Ok((Medium::Mirror, ConversionOutcome::Used, String::new())),
        ("AIR" | "", _) => return Ok((Medium::Air, ConversionOutcome::Used, String::new())),
        (_, 1) => return Ok(model_medium(line)),
        _ if name.starts_with("___BLANK") => return Ok(model_medium(line)),
        _ => {}
    }
    let exact = find_in_catalogues(&name, catalogues);
    let found = exact.map(|glass| (glass, true)).or_else(|| find_similar(line, catalogues));
    match found {
        Some((glass, exact)) => Ok(catalogue_medium(line, glass, exact)),
        None => unlisted_medium(line),
    }
}

/// The glass of this name, in the first of the catalogues that has it, or else in any.
fn find_in_catalogues(name: &str, catalogues: &[String]) -> Option<&'static Glass> {
    let listed = catalogues.iter().find_map(|catalogue| {
        // `OHARA_2021-04` is a version of the catalogue `OHARA`.
        let maker = catalogue.split(['_', '-']).next().unwrap_or_default();
        glass::find(&format!("{maker} {name}"))
    });
    listed.or_else(|| glass::find(name))
}

/// Prefixes of glasses that replaced older ones.
const PREFIXES: [&str; 5] = ["N-", "S-", "H-", "E-", "J-"];

/// A glass of a similar name, provided that the index on the line, if any, agrees.
fn find_similar(line: &GlassLine, catalogues: &[String]) -> Option<(&'static Glass, bool)> {
    let name = line.name.to_ascii_uppercase();
    let with = |prefix: &&str| find_in_catalogues(&format!("{prefix}{name}"), catalogues);
    let letters = |name: &str| -> String {
        name.chars().filter(char::is_ascii_alphanumeric).flat_map(char::to_uppercase).collect()
    };
    let spelled = || glass::catalogue().iter().find(|g| letters(&g.name) == letters(&name));
    let found = PREFIXES.iter().find_map(with).or_else(spelled)?;
    let agrees = is_placeholder(line) || (found.nd - line.nd).abs() < 1e-3;
    agrees.then_some((found, false))
}

/// True if index and Abbe number on the line are placeholders.
fn is_placeholder(line: &GlassLine) -> bool {
    line.nd <= 1.0 || (line.nd, line.vd) == (1.5, 40.0)
}

fn model_medium(line: &GlassLine) -> ImportedMedium {
    let medium = if line.vd == 0.0 {
        Medium::Index(line.nd)
    } else {
        Medium::Model { nd: line.nd, vd: line.vd }
    };
    if line.partial == 0.0 {
        (medium, ConversionOutcome::Used, String::new())
    } else {
        let note = "the deviation of the partial dispersion is taken as 0";
        (medium, ConversionOutcome::Approximated, note.to_owned())
    }
}

/// The catalogue glass; for code 4 a model glass with its offsets of nd and vd.
fn catalogue_medium(line: &GlassLine, glass: &Glass, exact: bool) -> ImportedMedium {
    let full = glass.full_name();
    if line.code == 4 && line.offsets != (0.0, 0.0) {
        let (nd, vd) = (glass.nd + line.offsets.0, glass.vd + line.offsets.1);
        let note = format!("{full} with its offsets as the model glass nd {nd}, vd {vd}");
        return (Medium::Model { nd, vd }, ConversionOutcome::Approximated, note);
    }
    let medium = Medium::Glass(full.clone());
    if !exact {
        let note = format!("{full} in place of {}", line.name);
        return (medium, ConversionOutcome::Approximated, note);
    }
    let far = !is_placeholder(line) && (glass.nd - line.nd).abs() > 5e-4;
    if far {
        let note = format!("{full} has nd {}, the file says {}", glass.nd, line.nd);
        return (medium, ConversionOutcome::Approximated, note);
    }
    (medium, ConversionOutcome::Used, full)
}

/// A glass that no catalogue has, by the index on its line or by the six-digit code of its name.
fn unlisted_medium(line: &GlassLine) -> Result<ImportedMedium, ParseError> {
    let numbers =
        if is_placeholder(line) { six_digit_code(&line.name) } else { Some((line.nd, line.vd)) };
    let Some((nd, vd)) = numbers else {
        let similar = glass::similar_names(&line.name);
        let hint = if similar.is_empty() {
            String::new()
        } else {
            format!("; similar names: {}", similar.join(", "))
        };
        let found = format!("the unknown glass `{}` without an index on its line", line.name);
        let expected = format!("a catalogue glass, or one with nd and vd{hint}");
        return Err(malformed_glass(line.line, found, &expected));
    };
    let medium = if vd == 0.0 { Medium::Index(nd) } else { Medium::Model { nd, vd } };
    let note = format!("no catalogue has {}: the model glass nd {nd}, vd {vd}", line.name);
    Ok((medium, ConversionOutcome::Approximated, note))
}

/// True for materials without a maker: crystals, fused silica, plastics.
pub(super) fn is_general(glass: &Glass) -> bool {
    matches!(glass.manufacturer.as_str(), "CRYSTAL" | "PLASTIC" | "FUSED_SILICA")
}

/// nd and vd of a six-digit code: 1.517 and 64.2 for `517642` and `517.642`.
fn six_digit_code(name: &str) -> Option<(f64, f64)> {
    let digits: String = name.chars().filter(|c| *c != '.').collect();
    if digits.len() != 6 || !digits.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    let (nd, vd) = digits.split_at(3);
    // Parsed from decimal text, so that it is the f64 nearest to 1.517.
    let (nd, vd): (f64, f64) = (format!("1.{nd}").parse().ok()?, vd.parse().ok()?);
    Some((nd, vd / 10.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(name: &str, code: usize, nd: f64, vd: f64) -> GlassLine {
        GlassLine {
            name: name.to_owned(),
            code,
            source: None,
            nd,
            vd,
            partial: 0.0,
            variable_index: false,
            offsets: (0.0, 0.0),
            line: 9,
        }
    }

    fn found(line: GlassLine) -> Result<ImportedMedium, ParseError> {
        let surface = ZemaxSurface { glass: Some(line), ..ZemaxSurface::default() };
        medium(&[surface], 0, &["OHARA".to_owned(), "SCHOTT".to_owned()])
    }

    fn glass(name: &str) -> Medium {
        Medium::Glass(name.to_owned())
    }

    #[test]
    fn names_are_found_in_the_catalogues() {
        let (medium, outcome, _) = found(line("N-BK7", 0, 1.5, 40.0)).unwrap();
        assert_eq!((medium, outcome), (glass("SCHOTT N-BK7"), ConversionOutcome::Used));
        let (medium, outcome, note) = found(line("BK7", 0, 1.5168, 64.17)).unwrap();
        assert_eq!((medium, outcome), (glass("SCHOTT N-BK7"), ConversionOutcome::Approximated));
        assert_eq!(note, "SCHOTT N-BK7 in place of BK7");
        let (medium, ..) = found(line("n-bk7", 3, 0.0, 0.0)).unwrap();
        assert_eq!(medium, glass("SCHOTT N-BK7"));
        // An old name whose index differs from that of the new glass is a model glass.
        let (medium, ..) = found(line("BK7", 0, 1.6, 60.0)).unwrap();
        assert_eq!(medium, Medium::Model { nd: 1.6, vd: 60.0 });
    }

    #[test]
    fn models_mirrors_and_codes_are_what_they_say() {
        assert_eq!(
            found(line("___BLANK", 1, 1.6, 36.0)).unwrap().0,
            Medium::Model { nd: 1.6, vd: 36.0 }
        );
        assert_eq!(found(line("___BLANK", 1, 1.33, 0.0)).unwrap().0, Medium::Index(1.33));
        assert_eq!(found(line("MIRROR", 0, 1.5, 40.0)).unwrap().0, Medium::Mirror);
        for name in ["517642", "517.642"] {
            assert_eq!(
                found(line(name, 0, 0.0, 0.0)).unwrap().0,
                Medium::Model { nd: 1.517, vd: 64.2 }
            );
        }
        let mut shifted = line("N-BK7", 4, 0.0, 0.0);
        shifted.offsets = (0.001, 0.2);
        let (medium, outcome, _) = found(shifted).unwrap();
        let bk7 = glass::find("N-BK7").unwrap();
        assert_eq!(medium, Medium::Model { nd: bk7.nd + 0.001, vd: bk7.vd + 0.2 });
        assert_eq!(outcome, ConversionOutcome::Approximated);
    }

    #[test]
    fn an_unknown_glass_needs_an_index() {
        let (medium, outcome, note) = found(line("XYZ-9", 0, 1.7, 30.0)).unwrap();
        assert_eq!(
            (medium, outcome),
            (Medium::Model { nd: 1.7, vd: 30.0 }, ConversionOutcome::Approximated)
        );
        assert!(note.contains("no catalogue has XYZ-9"));
        for (nd, vd) in [(1.5, 40.0), (0.0, 0.0)] {
            let error = found(line("XYZ-9", 0, nd, vd)).unwrap_err();
            assert_eq!(error.place, "line 9");
            assert!(error.found.contains("`XYZ-9`"));
        }
    }

    #[test]
    fn picked_up_glasses_are_followed_and_circles_refused() {
        let pickup = |source| {
            let glass = GlassLine { source: Some(source), ..line("X", 2, 0.0, 0.0) };
            ZemaxSurface { glass: Some(glass), ..ZemaxSurface::default() }
        };
        let end =
            ZemaxSurface { glass: Some(line("N-BK7", 0, 0.0, 0.0)), ..ZemaxSurface::default() };
        let surfaces = [pickup(1), pickup(2), end];
        assert_eq!(medium(&surfaces, 0, &[]).unwrap().0, glass("SCHOTT N-BK7"));
        let circle = [pickup(1), pickup(0)];
        assert!(medium(&circle, 0, &[]).unwrap_err().found.contains("form a circle"));
    }
}
