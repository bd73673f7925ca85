//! Reduction of the surface types to a conic with a polynomial in r².

use super::file::ZemaxSurface;
use crate::files::error::ParseError;
use crate::lens::ASPHERE_TERMS;

/// The shape of a surface, in the unit of the file.
#[derive(Debug, Default, PartialEq)]
pub(super) struct ZemaxShape {
    pub(super) curvature: f64,
    pub(super) conic: f64,
    /// Coefficients of r⁴, r⁶, ...
    pub(super) asphere: Vec<f64>,
    /// The note on a reduction, with the line that made it necessary.
    pub(super) note: Option<(usize, String)>,
}

const EXPECTED: &str = "STANDARD, EVENASPH, or an asphere without odd terms; other types cannot be \
                        traced";

/// The shape of surface `number`.
pub(super) fn surface_shape(
    surface: &ZemaxSurface,
    number: usize,
) -> Result<ZemaxShape, ParseError> {
    let curvature = surface.curvature.map_or(0.0, |(value, _)| value);
    let form = ZemaxShape { curvature, conic: surface.conic, ..ZemaxShape::default() };
    let refused = |why: String| {
        let (kind, line) = &surface.kind;
        let found = format!("surface {number} of type {kind}{why}");
        let expected = EXPECTED.to_owned();
        Err(ParseError { place: format!("line {line}"), found, expected })
    };
    let result = match surface.kind.0.as_str() {
        "" | "STANDARD" | super::gradient::KIND => Ok(form),
        "EVENASPH" => add_terms(form, &parameter_terms(&surface.parameters, |i| 2 * i)),
        "ODDASPHE" => add_terms(form, &parameter_terms(&surface.parameters, |i| i)),
        "XASPHERE" => add_terms(form, &extended_terms(&surface.extra, |i| 2 * i)),
        "XOSPHERE" => add_terms(form, &extended_terms(&surface.extra, |i| i)),
        "BICONICX" => biconic(form, surface),
        _ => Err(String::new()),
    };
    result.or_else(|why| refused(if why.is_empty() { why } else { format!(", with {why}") }))
}

/// A term: power of r, coefficient, line.
type PowerTerm = (usize, f64, usize);

fn parameter_terms(parameters: &[PowerTerm], power: fn(usize) -> usize) -> Vec<PowerTerm> {
    let terms = parameters.iter().filter(|(i, ..)| (1..=8).contains(i));
    terms.map(|(i, value, line)| (power(*i), *value, *line)).collect()
}

/// Extra data: 1 number of terms, 2 normalization radius, then the coefficients.
fn extended_terms(extra: &[PowerTerm], power: fn(usize) -> usize) -> Vec<PowerTerm> {
    let value = |index| extra.iter().rfind(|(i, ..)| *i == index).map(|(_, value, _)| *value);
    let count = value(1).unwrap_or(0.0);
    let radius = value(2).unwrap_or(1.0);
    let terms = extra.iter().filter(|(i, ..)| *i > 2 && (*i - 2) as f64 <= count);
    terms
        .map(|(i, value, line)| {
            let power = power(i - 2);
            let scale = radius.powi(i32::try_from(power).unwrap_or(i32::MAX));
            (power, if *value == 0.0 { 0.0 } else { value / scale }, *line)
        })
        .collect()
}

/// Adds even terms to a conic; a term in r² is folded into the conic where this is exact.
fn add_terms(mut form: ZemaxShape, terms: &[PowerTerm]) -> Result<ZemaxShape, String> {
    let mut asphere = [0.0; ASPHERE_TERMS];
    let mut parabola = (0.0, 0);
    for &(power, value, line) in terms {
        match power {
            _ if !value.is_finite() => return Err(format!("a term in r^{power} beyond 1e308")),
            2 => parabola = (value, line),
            4..=16 if power % 2 == 0 => asphere[power / 2 - 2] = value,
            _ if value == 0.0 => {}
            _ => return Err(format!("a term in r^{power} (line {line})")),
        }
    }
    let used = asphere.iter().rposition(|a| *a != 0.0).map_or(0, |last| last + 1);
    form.asphere = asphere[..used].to_vec();
    if parabola.0 != 0.0 {
        fold_parabola(&mut form, parabola)?;
    }
    Ok(form)
}

/// Folds `α r²`, a paraboloid, into a plane or another paraboloid; other conics cannot take it exactly.
fn fold_parabola(form: &mut ZemaxShape, (alpha, line): (f64, usize)) -> Result<(), String> {
    if form.curvature != 0.0 && form.conic != -1.0 {
        return Err(format!(
            "a term in r^2 (line {line}) on a conic of constant {}; it folds exactly only into a \
             plane or a paraboloid",
            form.conic
        ));
    }
    form.curvature += 2.0 * alpha;
    form.conic = -1.0;
    let note = format!("the term in r^2 is the paraboloid of curvature {}", form.curvature);
    form.note = Some((line, note));
    Ok(())
}

/// A biconic surface that is rotationally symmetric. Parameters: 1 radius in x, 0 for flat; 2 conic
/// constant in x.
fn biconic(form: ZemaxShape, surface: &ZemaxSurface) -> Result<ZemaxShape, String> {
    let value = |index| {
        let found = surface.parameters.iter().rfind(|(i, ..)| *i == index);
        found.map_or(0.0, |(_, value, _)| *value)
    };
    let curvature = if value(1) == 0.0 { 0.0 } else { 1.0 / value(1) };
    let round = (curvature - form.curvature).abs() <= 1e-15 * curvature.abs()
        && (value(2) == form.conic || curvature == 0.0);
    if round { Ok(form) } else { Err("other curvatures in x than in y".to_owned()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn surface(kind: &str, curvature: f64, conic: f64) -> ZemaxSurface {
        ZemaxSurface {
            kind: (kind.to_owned(), 5),
            curvature: Some((curvature, 6)),
            conic,
            ..ZemaxSurface::default()
        }
    }

    #[test]
    fn even_aspheres_have_their_terms_in_place() {
        let mut s = surface("EVENASPH", 0.02, -0.5);
        s.parameters = vec![(1, 0.0, 7), (2, 1e-5, 8), (8, 1e-20, 9), (4, -2e-9, 10)];
        let form = surface_shape(&s, 1).unwrap();
        assert_eq!(form.asphere, [1e-5, 0.0, -2e-9, 0.0, 0.0, 0.0, 1e-20]);
        assert_eq!((form.curvature, form.conic), (0.02, -0.5));
    }

    #[test]
    fn a_term_in_r2_folds_into_a_plane_or_paraboloid_and_into_nothing_else() {
        let mut s = surface("EVENASPH", 0.0, 3.0);
        s.parameters = vec![(1, 0.01, 7), (2, 1e-5, 8)];
        let folded = surface_shape(&s, 1).unwrap();
        assert_eq!((folded.curvature, folded.conic, folded.asphere), (0.02, -1.0, vec![1e-5]));
        s.curvature = Some((-0.05, 6));
        s.conic = -1.0;
        let folded = surface_shape(&s, 1).unwrap();
        assert_eq!((folded.curvature, folded.conic), (-0.05 + 0.02, -1.0));
        s.conic = 0.0;
        let error = surface_shape(&s, 4).unwrap_err();
        assert_eq!(error.place, "line 5");
        assert!(error.found.starts_with("surface 4 of type EVENASPH, with a term in r^2 (line 7)"));
    }

    #[test]
    fn extended_aspheres_are_scaled_by_their_radius() {
        let mut s = surface("XASPHERE", 0.02, 0.0);
        s.extra = vec![(1, 8.0, 7), (2, 2.0, 8), (3, 0.0, 9), (4, 0.16, 10), (5, -0.64, 11)];
        assert_eq!(surface_shape(&s, 1).unwrap().asphere, [0.01, -0.01]);
        s.extra.push((12, 1.0, 12)); // r^20, beyond the eight terms in use
        assert_eq!(surface_shape(&s, 1).unwrap().asphere, [0.01, -0.01]);
        s.extra[0].1 = 10.0;
        assert!(surface_shape(&s, 1).unwrap_err().found.contains("a term in r^20 (line 12)"));
        let mut s = surface("XOSPHERE", 0.02, 0.0);
        s.extra = vec![(1, 4.0, 7), (2, 10.0, 8), (6, 1.0, 9)];
        assert_eq!(surface_shape(&s, 1).unwrap().asphere, [1e-4]);
        s.extra.push((5, 1.0, 10));
        assert!(surface_shape(&s, 1).unwrap_err().found.contains("a term in r^3 (line 10)"));
    }

    #[test]
    fn a_biconic_is_read_where_it_is_round() {
        let mut s = surface("BICONICX", 0.0, 0.0);
        s.parameters = vec![(1, 0.0, 7), (2, 0.0, 8)];
        assert_eq!(surface_shape(&s, 1).unwrap(), ZemaxShape::default());
        s.curvature = Some((0.02, 6));
        assert!(surface_shape(&s, 1).unwrap_err().found.contains("other curvatures in x"));
        s.parameters[0].1 = 50.0;
        assert_eq!(surface_shape(&s, 1).unwrap().curvature, 0.02);
    }

    #[test]
    fn what_cannot_be_traced_is_refused_by_name() {
        for kind in ["TILTSURF", "TOROIDAL", "PARAXIAL", "DGRATING", "USERSURF", "NONSEQCO"] {
            let error = surface_shape(&surface(kind, 0.0, 0.0), 3).unwrap_err();
            assert_eq!(error.found, format!("surface 3 of type {kind}"));
        }
    }
}
