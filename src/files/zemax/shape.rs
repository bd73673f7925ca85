//! Reduction of the surface types to a conic with a polynomial in r², or to a freeform.

use super::even_fit;
use super::file::ZemaxSurface;
use super::freeform;
use crate::files::report::ConversionOutcome;
use crate::lens::{ASPHERE_TERMS, Freeform, IdealElement};

/// The shape of a surface, in the unit of the file.
#[derive(Debug, Default, PartialEq)]
pub(super) struct ZemaxShape {
    pub(super) curvature: f64,
    pub(super) conic: f64,
    /// Coefficients of r⁴, r⁶, ...
    pub(super) asphere: Vec<f64>,
    /// The form beside, if there is one.
    pub(super) freeform: Option<Freeform<f64>>,
    /// The rule by which it deflects light, if there is one.
    pub(super) ideal: Option<IdealElement>,
    /// The note on a reduction, with the line that made it necessary.
    pub(super) note: Option<(usize, ConversionOutcome, String)>,
}

impl ZemaxShape {
    /// The conic of a surface, whatever its type adds to it.
    pub(super) fn base(surface: &ZemaxSurface) -> Self {
        let curvature = surface.curvature.map_or(0.0, |(value, _)| value);
        Self { curvature, conic: surface.conic, ..Self::default() }
    }
}

/// The shape of a surface.
///
/// # Errors
/// What cannot be traced: the end of a sentence behind the surface type, empty for the type itself.
pub(super) fn surface_shape(surface: &ZemaxSurface) -> Result<ZemaxShape, String> {
    let form = ZemaxShape::base(surface);
    match surface.kind.0.as_str() {
        "" | "STANDARD" | super::gradient::KIND => Ok(form),
        "EVENASPH" => polynomial(surface, &parameter_terms(&surface.parameters, |i| 2 * i)),
        "ODDASPHE" => polynomial(surface, &parameter_terms(&surface.parameters, |i| i)),
        "XASPHERE" => polynomial(surface, &extended_terms(&surface.extra, |i| 2 * i)),
        "XOSPHERE" => polynomial(surface, &extended_terms(&surface.extra, |i| i)),
        _ => freeform::surface_form(surface).unwrap_or_else(|| Err(String::new())),
    }
}

/// A term: power of r, coefficient, line.
pub(super) type PowerTerm = (usize, f64, usize);

pub(super) fn parameter_terms(
    parameters: &[PowerTerm],
    power: fn(usize) -> usize,
) -> Vec<PowerTerm> {
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

/// A conic with powers of r. One with odd powers is a freeform. Of even powers that no even asphere has,
/// the even asphere nearest to them inside the semi-diameter is taken if that is near enough, since every
/// method knows it, or else a freeform.
fn polynomial(surface: &ZemaxSurface, terms: &[PowerTerm]) -> Result<ZemaxShape, String> {
    let as_freeform = || {
        let form = freeform::odd_asphere(terms)?;
        Ok(ZemaxShape { freeform: Some(form), ..ZemaxShape::base(surface) })
    };
    let is_odd = |(power, value, _): &PowerTerm| !power.is_multiple_of(2) && *value != 0.0;
    if terms.iter().any(is_odd) {
        return as_freeform();
    }
    even_polynomial(surface, terms).or_else(|why| as_freeform().map_err(|_longer| why))
}

/// A conic with even powers of r: exactly, or else by the even asphere nearest to it.
pub(super) fn even_polynomial(
    surface: &ZemaxSurface,
    terms: &[PowerTerm],
) -> Result<ZemaxShape, String> {
    let base = ZemaxShape::base(surface);
    add_terms(ZemaxShape::base(surface), terms).or_else(|why| {
        let reach = surface.semi_diameter.map(|given| given.value);
        let reach = surface.clip.map(|(radius, _)| radius).or(reach).filter(|radius| *radius > 0.0);
        let Some(radius) = reach else { return Err(why) };
        let squared: f64 = terms.iter().filter(|(power, ..)| *power == 2).map(|(_, a, _)| a).sum();
        let sag = |r: f64| {
            let root = (1.0 - (1.0 + base.conic) * base.curvature * base.curvature * r * r).sqrt();
            let sum =
                terms.iter().map(|(power, a, _)| a * r.powi(i32::try_from(*power).unwrap_or(0)));
            base.curvature * r * r / (1.0 + root) + sum.sum::<f64>()
        };
        let curvature = base.curvature + 2.0 * squared;
        fitted(curvature, radius, sag, surface.kind.1).map_err(|_unfitted| why)
    })
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
    form.note = Some((line, ConversionOutcome::Used, note));
    Ok(())
}

/// The even asphere in place of another sag, if it is near enough.
fn fitted(
    curvature: f64,
    radius: f64,
    sag: impl Fn(f64) -> f64,
    line: usize,
) -> Result<ZemaxShape, String> {
    let found = even_fit::fit(sag, curvature, radius)
        .filter(|fit| fit.error <= even_fit::LARGEST_ERROR)
        .ok_or_else(|| format!("no even asphere that agrees up to r = {radius}"))?;
    let note = format!(
        "an even asphere in its place, which agrees up to r = {radius} within {:.1e}",
        found.error
    );
    let note = Some((line, ConversionOutcome::Approximated, note));
    Ok(ZemaxShape {
        curvature,
        conic: found.conic,
        asphere: found.terms,
        freeform: None,
        ideal: None,
        note,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::zemax::file::SemiDiameterLine;
    use crate::lens::FreeformKind;

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
        let form = surface_shape(&s).unwrap();
        assert_eq!(form.asphere, [1e-5, 0.0, -2e-9, 0.0, 0.0, 0.0, 1e-20]);
        assert_eq!((form.curvature, form.conic), (0.02, -0.5));
    }

    #[test]
    fn a_term_in_r2_folds_into_a_plane_or_paraboloid_and_into_nothing_else() {
        let mut s = surface("EVENASPH", 0.0, 3.0);
        s.parameters = vec![(1, 0.01, 7), (2, 1e-5, 8)];
        let folded = surface_shape(&s).unwrap();
        assert_eq!((folded.curvature, folded.conic, folded.asphere), (0.02, -1.0, vec![1e-5]));
        s.curvature = Some((-0.05, 6));
        s.conic = -1.0;
        let folded = surface_shape(&s).unwrap();
        assert_eq!((folded.curvature, folded.conic), (-0.05 + 0.02, -1.0));
        s.conic = 0.0;
        // Without a semi-diameter it is a freeform.
        let unlimited = surface_shape(&s).unwrap();
        assert_eq!(unlimited.freeform.unwrap().numbers, [0.0, 0.01, 0.0, 1e-5]);
        assert_eq!((unlimited.curvature, unlimited.conic), (-0.05, 0.0));
        // Inside a semi-diameter another even asphere is as good.
        s.semi_diameter = Some(SemiDiameterLine { value: 8.0, fixed: false, line: 9 });
        let fitted = surface_shape(&s).unwrap();
        let (_, outcome, note) = fitted.note.clone().unwrap();
        assert_eq!((outcome, fitted.curvature), (ConversionOutcome::Approximated, -0.05 + 0.02));
        let shape =
            crate::lens::Shape::new(fitted.curvature, fitted.conic, &fitted.asphere, 0).unwrap();
        for r in [2.0_f64, 5.5, 8.0] {
            let sphere = -0.05 * r * r / (1.0 + (1.0 - 0.0025 * r * r).sqrt());
            let exact = sphere + 0.01 * r * r + 1e-5 * r.powi(4);
            assert!((shape.sag(r * r).unwrap().0 - exact).abs() < 1e-9, "{r}: {note}");
        }
        // The cusp of a term in r has no such asphere.
        s.kind.0 = "ODDASPHE".to_owned();
        let odd = surface_shape(&s).unwrap().freeform.unwrap();
        assert_eq!((odd.kind, &odd.numbers[..]), (FreeformKind::OddAsphere, &[0.01, 1e-5][..]));
    }

    #[test]
    fn extended_aspheres_are_scaled_by_their_radius() {
        let mut s = surface("XASPHERE", 0.02, 0.0);
        s.extra = vec![(1, 8.0, 7), (2, 2.0, 8), (3, 0.0, 9), (4, 0.16, 10), (5, -0.64, 11)];
        assert_eq!(surface_shape(&s).unwrap().asphere, [0.01, -0.01]);
        s.extra.push((12, 1.0, 12)); // r^20, beyond the eight terms in use
        assert_eq!(surface_shape(&s).unwrap().asphere, [0.01, -0.01]);
        s.extra[0].1 = 10.0;
        let longer = surface_shape(&s).unwrap().freeform.unwrap();
        assert_eq!((longer.numbers.len(), longer.numbers[19]), (20, 2.0_f64.powi(-20)));
        s.extra.push((13, 1.0, 13)); // r^22
        s.extra[0].1 = 11.0;
        assert!(surface_shape(&s).unwrap_err().contains("a term in r^20 (line 12)"));
        let mut s = surface("XOSPHERE", 0.02, 0.0);
        s.extra = vec![(1, 4.0, 7), (2, 10.0, 8), (6, 1.0, 9)];
        assert_eq!(surface_shape(&s).unwrap().asphere, [1e-4]);
        s.extra.push((5, 1.0, 10));
        let odd = surface_shape(&s).unwrap().freeform.unwrap();
        assert!((odd.numbers[2] - 1e-3).abs() < 1e-18 && (odd.numbers[3] - 1e-4).abs() < 1e-19);
    }

    #[test]
    fn aspheres_of_forbes_keep_their_kind() {
        let mut s = surface("QED_TYPE", 0.05, -0.6);
        s.extra = vec![(1, 1.0, 7), (2, 4.0, 8), (3, 8.0, 9), (4, 0.3, 10), (6, -0.2, 11)];
        let strong = surface_shape(&s).unwrap();
        let form = strong.freeform.unwrap();
        assert_eq!((strong.curvature, strong.conic, strong.note), (0.05, -0.6, None));
        assert_eq!(form.kind, FreeformKind::QCon { radius: 8.0 });
        assert_eq!(form.numbers, [0.3, 0.0, -0.2]);
        s.extra[0].1 = 0.0;
        let mild = surface_shape(&s).unwrap().freeform.unwrap();
        assert_eq!((mild.kind, mild.numbers), (FreeformKind::QBfs { radius: 8.0 }, form.numbers));
        s.extra[0].1 = 2.0;
        assert!(surface_shape(&s).unwrap_err().contains("the kind 2"));
        s.extra[2].1 = 0.0;
        assert!(surface_shape(&s).unwrap_err().contains("normalization radius 0"));
    }

    /// The sag of a diffractive surface is that of an even asphere.
    #[test]
    fn diffractive_surfaces_keep_their_order_and_phase() {
        for (name, kind) in [
            ("BINARY_2", FreeformKind::RadialPhase { radius: 5.0, order: -2.0 }),
            ("BINARY_1", FreeformKind::XyPhase { radius: 5.0, order: -2.0 }),
        ] {
            let mut s = surface(name, 0.02, -0.5);
            s.parameters = vec![(0, -2.0, 6), (2, 1e-5, 7)];
            s.extra = vec![(1, 3.0, 8), (2, 5.0, 8), (3, -300.0, 9), (4, 12.0, 9), (6, 9.0, 9)];
            let read = surface_shape(&s).unwrap();
            assert_eq!((read.curvature, read.conic, &read.asphere[..]), (0.02, -0.5, &[1e-5][..]));
            let form = read.freeform.unwrap();
            assert_eq!((form.kind, &form.numbers[..]), (kind, &[-300.0, 12.0][..]));
            s.extra[0].1 = 0.0;
            assert_eq!(surface_shape(&s).unwrap().freeform, None);
            s.extra[0].1 = 3.0;
            s.parameters.remove(0);
            let (_, outcome, note) = surface_shape(&s).unwrap().note.unwrap();
            assert_eq!(outcome, ConversionOutcome::Approximated);
            assert!(note.contains("order 1"), "{note}");
        }
    }

    #[test]
    fn biconics_toroids_and_polynomials_are_freeforms_unless_they_are_round() {
        let mut s = surface("BICONICX", 0.0, 0.0);
        s.parameters = vec![(1, 0.0, 7), (2, 0.0, 8)];
        assert_eq!(surface_shape(&s).unwrap(), ZemaxShape::default());
        s.curvature = Some((0.02, 6));
        let cylinder = surface_shape(&s).unwrap();
        assert_eq!(
            (cylinder.curvature, cylinder.freeform.unwrap().numbers),
            (0.02, vec![0.0, 0.0])
        );
        s.parameters[0].1 = 50.0;
        assert_eq!(surface_shape(&s).unwrap().freeform, None);
        let mut s = surface("TOROIDAL", 0.02, -1.0);
        s.parameters = vec![(1, -25.0, 7), (3, 1e-5, 8)];
        let toroid = surface_shape(&s).unwrap().freeform.unwrap();
        assert_eq!((toroid.kind, toroid.numbers), (FreeformKind::Toroid, vec![-0.04, 0.0, 1e-5]));
        let mut s = surface("XPOLYNOM", 0.02, 0.5);
        s.extra = vec![(1, 5.0, 7), (2, 4.0, 8), (3, 0.1, 9), (6, -0.2, 10), (8, 9.0, 11)];
        let form = surface_shape(&s).unwrap().freeform.unwrap();
        assert_eq!(form.kind, FreeformKind::XyPolynomial { radius: 4.0 });
        assert_eq!(form.numbers, [0.1, 0.0, 0.0, -0.2]);
        s.extra[1].1 = 0.0;
        assert!(surface_shape(&s).unwrap_err().contains("normalization radius 0"));
        s.extra[0].1 = 0.0;
        let plain = surface_shape(&s).unwrap();
        assert_eq!((plain.curvature, plain.conic, plain.freeform), (0.02, 0.5, None));
    }

    /// The term in r² of a Zernike sag is its focus with a piston, both orders.
    #[test]
    fn a_zernike_sag_keeps_its_even_powers() {
        for kind in ["SZERNSAG", "FZERNSAG"] {
            let mut s = surface(kind, 0.02, 0.0);
            s.parameters = vec![(0, 1.0, 5), (1, 3e-3, 6), (2, 1e-5, 7)];
            s.extra = vec![(1, 5.0, 7), (2, 4.0, 8), (7, 0.01, 9)];
            let read = surface_shape(&s).unwrap();
            assert_eq!((read.asphere.as_slice(), &read.note), (&[1e-5][..], &None));
            let form = read.freeform.unwrap();
            for (x, y) in [(0.0, 0.0), (1.5, -2.0), (3.0, 4.0)] {
                let mut fifth = form.clone();
                fifth.numbers[..4].fill(0.0);
                let base = form.base(&crate::lens::Shape::Plane);
                let sag = |form: &Freeform<f64>| form.series_sag(&base, x, y, |a| a)[0];
                let apart = sag(&form) - sag(&fifth);
                assert!((apart - 3e-3 * (x * x + y * y)).abs() < 1e-16, "{kind}: {apart}");
            }
            s.parameters[0].1 = 0.0;
            let note = surface_shape(&s).unwrap().note.unwrap();
            assert_eq!(note.1, ConversionOutcome::Approximated);
            assert!(note.2.contains("continue beyond"));
            s.parameters.push((9, 1.0, 10));
            assert!(surface_shape(&s).unwrap_err().contains("decentred Zernike"));
        }
    }

    #[test]
    fn what_cannot_be_traced_is_refused() {
        for kind in ["TILTSURF", "USERSURF", "NONSEQCO"] {
            assert_eq!(surface_shape(&surface(kind, 0.0, 0.0)), Err(String::new()));
        }
    }
}
