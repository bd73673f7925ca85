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

/// A medium, and the outcome of its import.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::files) struct ImportedMedium {
    pub(in crate::files) medium: Medium,
    pub(in crate::files) outcome: ConversionOutcome,
    /// The substitute or the deviation; the full name of a catalogue glass.
    pub(in crate::files) note: String,
    /// The name of a glass that is not known.
    pub(in crate::files) missing: Option<String>,
}

impl ImportedMedium {
    fn used(medium: Medium, note: String) -> Self {
        Self { medium, outcome: ConversionOutcome::Used, note, missing: None }
    }

    fn approximated(medium: Medium, note: String) -> Self {
        Self { medium, outcome: ConversionOutcome::Approximated, note, missing: None }
    }
}

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
            None => return Ok(ImportedMedium::used(Medium::Air, String::new())),
            Some(line) if line.code == 2 => at = line.source.unwrap_or(usize::MAX),
            Some(line) => return Ok(resolve_glass(line, catalogues)),
        }
    }
    let line = surfaces[number].glass.as_ref().map_or(0, |glass| glass.line);
    let found = format!("surface {number}, whose glass pickups form a circle");
    Err(malformed_glass(line, found, "a pickup that ends at a glass"))
}

/// The medium of a glass that a file names without an index, of the first of the makers that has it. Other
/// characters than letters and digits do not count.
pub(in crate::files) fn named_medium(name: &str, makers: &[String]) -> ImportedMedium {
    let line = GlassLine { name: name.to_owned(), ..GlassLine::default() };
    let found = resolve_glass(&line, makers);
    let same = match &found.medium {
        Medium::Glass(full) => glass::find(full)
            .filter(|g| letters(&g.name) == letters(name) && is_expected(g, &line, makers)),
        _ => None,
    };
    match same {
        Some(glass) => ImportedMedium::used(found.medium, glass.full_name()),
        None => found,
    }
}

/// The letters and digits of a name, in upper case.
fn letters(name: &str) -> String {
    name.chars().filter(char::is_ascii_alphanumeric).flat_map(char::to_uppercase).collect()
}

fn malformed_glass(line: usize, found: String, expected: &str) -> ParseError {
    ParseError { place: format!("line {line}"), found, expected: expected.to_owned() }
}

fn resolve_glass(line: &GlassLine, catalogues: &[String]) -> ImportedMedium {
    let name = line.name.to_ascii_uppercase();
    match (name.as_str(), line.code) {
        ("MIRROR", _) => return ImportedMedium::used(Medium::Mirror, String::new()),
        ("AIR" | "", _) => return ImportedMedium::used(Medium::Air, String::new()),
        (_, 1) => return model_medium(line),
        _ if name.starts_with("___BLANK") => return model_medium(line),
        _ => {}
    }
    let named = find_in_catalogues(&name, catalogues, line);
    let exact = named.filter(|glass| is_expected(glass, line, catalogues));
    let found = exact
        .map(|glass| (glass, true))
        .or_else(|| find_similar(line, catalogues))
        .or_else(|| named.map(|glass| (glass, false)));
    match found {
        Some((glass, exact)) => catalogue_medium(line, glass, exact),
        None => unlisted_medium(line),
    }
}

/// True for a glass of the catalogues of the file, of a material without a maker, or of the index that the
/// file states: another maker may use the same name for another glass.
fn is_expected(glass: &Glass, line: &GlassLine, catalogues: &[String]) -> bool {
    let listed = catalogues.iter().any(|own| maker(own).eq_ignore_ascii_case(&glass.manufacturer));
    let agrees = !is_placeholder(line) && (glass.nd - line.nd).abs() < 5e-5;
    catalogues.is_empty() || listed || agrees || is_general(glass)
}

/// The maker of a catalogue: `OHARA_2021-04` is a version of `OHARA`.
fn maker(catalogue: &str) -> &str {
    catalogue.split(['_', '-']).next().unwrap_or_default()
}

/// The glass of this name, in the first of the catalogues that has it with the index of the line, or that has
/// it at all, or else in any. Those that a person has added come last, so that a file means the same
/// everywhere as long as the program has its glasses.
fn find_in_catalogues(
    name: &str,
    catalogues: &[String],
    line: &GlassLine,
) -> Option<&'static Glass> {
    let among = |find| find_among(find, name, catalogues, line);
    among(glass::find_built_in).or_else(|| among(glass::find_added))
}

/// The glass of this name among those that `find` knows.
fn find_among(
    find: fn(&str) -> Option<&'static Glass>,
    name: &str,
    catalogues: &[String],
    line: &GlassLine,
) -> Option<&'static Glass> {
    let listed =
        || catalogues.iter().filter_map(|catalogue| find(&format!("{} {name}", maker(catalogue))));
    // Several of them may have a glass of this name: index and Abbe number on the line
    // decide.
    let agrees = |glass: &&Glass| !is_placeholder(line) && (glass.nd - line.nd).abs() < 5e-5;
    let off = |glass: &&Glass| (glass.vd - line.vd).abs();
    let nearest = listed().filter(agrees).min_by(|a, b| off(a).total_cmp(&off(b)));
    nearest.or_else(|| listed().next()).or_else(|| find(name))
}

/// Prefixes of glasses that replaced older ones.
const PREFIXES: [&str; 5] = ["N-", "S-", "H-", "E-", "J-"];

/// Other names of materials.
const OTHER_NAMES: [(&str, &str); 8] = [
    ("C79-80", "FUSED_SILICA SILICA"),
    ("F_SILICA", "FUSED_SILICA SILICA"),
    ("FUSED_SILICA", "FUSED_SILICA SILICA"),
    ("ACRYLIC", "PLASTIC PMMA"),
    ("POLYCARB", "PLASTIC POLYCARBONATE"),
    ("PC", "PLASTIC POLYCARBONATE"),
    ("POLYSTYR", "PLASTIC POLYSTYRENE"),
    ("STYRENE", "PLASTIC POLYSTYRENE"),
];

/// A glass of a similar name, provided that the index on the line, if any, agrees.
fn find_similar(line: &GlassLine, catalogues: &[String]) -> Option<(&'static Glass, bool)> {
    let name = line.name.to_ascii_uppercase();
    let with = |prefix: &&str| find_in_catalogues(&format!("{prefix}{name}"), catalogues, line);
    let alike = |g: &&Glass| letters(&g.name) == letters(&name);
    let listed = |g: &&Glass| catalogues.contains(&g.manufacturer);
    let spelled = || {
        let own = glass::known().filter(alike).find(listed);
        own.or_else(|| glass::known().find(alike))
    };
    let renamed = || OTHER_NAMES.iter().find(|(other, _)| *other == name);
    // `L-TIM28_MOLD` is `L-TIM28` after moulding.
    let treated = || find_in_catalogues(name.split_once('_')?.0, catalogues, line);
    let found = PREFIXES
        .iter()
        .find_map(with)
        .or_else(spelled)
        .or_else(|| renamed().and_then(|(_, glass)| glass::find(glass)))
        .or_else(treated)?;
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
        ImportedMedium::used(medium, String::new())
    } else {
        let note = "the deviation of the partial dispersion is taken as 0";
        ImportedMedium::approximated(medium, note.to_owned())
    }
}

/// The catalogue glass; for code 4 a model glass with its offsets of nd and vd.
fn catalogue_medium(line: &GlassLine, glass: &Glass, exact: bool) -> ImportedMedium {
    let full = glass.full_name();
    if line.code == 4 && line.offsets != (0.0, 0.0) {
        let (nd, vd) = (glass.nd + line.offsets.0, glass.vd + line.offsets.1);
        let note = format!("{full} with its offsets as the model glass nd {nd}, vd {vd}");
        return ImportedMedium::approximated(Medium::Model { nd, vd }, note);
    }
    let medium = Medium::Glass(full.clone());
    if !exact {
        let note = format!("{full} in place of {}", line.name);
        return ImportedMedium::approximated(medium, note);
    }
    let far = !is_placeholder(line) && (glass.nd - line.nd).abs() > 5e-4;
    if far {
        let note = format!("{full} has nd {}, the file says {}", glass.nd, line.nd);
        return ImportedMedium::approximated(medium, note);
    }
    ImportedMedium::used(medium, full)
}

/// The index and the Abbe number of a glass of which the file says nothing: those of N-BK7, the most
/// common one.
const UNKNOWN: (f64, f64) = (1.5168, 64.17);

/// A glass that no catalogue has, by the index on its line, by the six-digit code of its name, or by
/// those of the most common glass.
fn unlisted_medium(line: &GlassLine) -> ImportedMedium {
    let stated = (!is_placeholder(line)).then_some((line.nd, line.vd));
    let code = six_digit_code(&line.name);
    let name = &line.name;
    let Some((nd, vd)) = stated.or(code) else {
        let (nd, vd) = UNKNOWN;
        let note = format!(
            "no catalogue has {name} and the line has no index: nd {nd}, vd {vd} in its place{}",
            similar(name)
        );
        let (medium, outcome) = (Medium::Model { nd, vd }, ConversionOutcome::Dropped);
        return ImportedMedium { medium, outcome, note, missing: Some(name.clone()) };
    };
    // Fictitious glasses are what their code says.
    let missing = (stated.is_some() && code.is_none()).then(|| name.clone());
    let medium = if vd == 0.0 { Medium::Index(nd) } else { Medium::Model { nd, vd } };
    let nearest = glass::nearest(nd, vd).map(Glass::full_name).unwrap_or_default();
    let note = format!(
        "no catalogue has {name}: the model glass nd {nd}, vd {vd}; the nearest glass is {nearest}"
    );
    ImportedMedium { missing, ..ImportedMedium::approximated(medium, note) }
}

/// Similar names, as the end of a sentence.
fn similar(name: &str) -> String {
    let names = glass::similar_names(name);
    if names.is_empty() { String::new() } else { format!("; similar names: {}", names.join(", ")) }
}

/// True for materials without a maker: crystals, fused silica, plastics.
pub(in crate::files) fn is_general(glass: &Glass) -> bool {
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
        let bk7 = found(line("N-BK7", 0, 1.5, 40.0)).unwrap();
        assert_eq!((bk7.medium, bk7.outcome), (glass("SCHOTT N-BK7"), ConversionOutcome::Used));
        let bk7 = found(line("BK7", 0, 1.5168, 64.17)).unwrap();
        let expected = (glass("SCHOTT N-BK7"), ConversionOutcome::Approximated);
        assert_eq!((bk7.medium, bk7.outcome), expected);
        assert_eq!(bk7.note, "SCHOTT N-BK7 in place of BK7");
        assert_eq!(found(line("n-bk7", 3, 0.0, 0.0)).unwrap().medium, glass("SCHOTT N-BK7"));
        // An old name whose index differs from that of the new glass is a model glass.
        let other = found(line("BK7", 0, 1.6, 60.0)).unwrap();
        assert_eq!(other.medium, Medium::Model { nd: 1.6, vd: 60.0 });
        for (name, expected) in [
            ("J-LAK02", "HIKARI J-LAK02"),
            ("B270", "SCHOTT B270"),
            ("C79-80", "FUSED_SILICA SILICA"),
            ("L-TIM28_MOLD", "OHARA L-TIM28"),
        ] {
            let found = found(line(name, 0, 0.0, 0.0)).unwrap();
            assert_eq!((found.medium, found.missing), (glass(expected), None));
        }
    }

    #[test]
    fn models_mirrors_and_codes_are_what_they_say() {
        assert_eq!(
            found(line("___BLANK", 1, 1.6, 36.0)).unwrap().medium,
            Medium::Model { nd: 1.6, vd: 36.0 }
        );
        assert_eq!(found(line("___BLANK", 1, 1.33, 0.0)).unwrap().medium, Medium::Index(1.33));
        assert_eq!(found(line("MIRROR", 0, 1.5, 40.0)).unwrap().medium, Medium::Mirror);
        for name in ["517642", "517.642"] {
            assert_eq!(
                found(line(name, 0, 0.0, 0.0)).unwrap().medium,
                Medium::Model { nd: 1.517, vd: 64.2 }
            );
        }
        let mut shifted = line("N-BK7", 4, 0.0, 0.0);
        shifted.offsets = (0.001, 0.2);
        let shifted = found(shifted).unwrap();
        let bk7 = glass::find("N-BK7").unwrap();
        assert_eq!(shifted.medium, Medium::Model { nd: bk7.nd + 0.001, vd: bk7.vd + 0.2 });
        assert_eq!(shifted.outcome, ConversionOutcome::Approximated);
    }

    #[test]
    fn an_unknown_glass_has_the_index_of_its_line_or_a_stated_substitute() {
        let known = found(line("XYZ-9", 0, 1.7, 30.0)).unwrap();
        assert_eq!(known.medium, Medium::Model { nd: 1.7, vd: 30.0 });
        assert_eq!(known.outcome, ConversionOutcome::Approximated);
        assert!(known.note.contains("no catalogue has XYZ-9"), "{}", known.note);
        for (nd, vd) in [(1.5, 40.0), (0.0, 0.0)] {
            let unknown = found(line("XYZ-9", 0, nd, vd)).unwrap();
            assert_eq!(unknown.medium, Medium::Model { nd: 1.5168, vd: 64.17 });
            assert_eq!(unknown.outcome, ConversionOutcome::Dropped);
            assert_eq!(unknown.missing.as_deref(), Some("XYZ-9"));
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
        assert_eq!(medium(&surfaces, 0, &[]).unwrap().medium, glass("SCHOTT N-BK7"));
        let circle = [pickup(1), pickup(0)];
        assert!(medium(&circle, 0, &[]).unwrap_err().found.contains("form a circle"));
    }
}
