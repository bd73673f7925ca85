//! The forms of the sag and the rules of deflection that can be chosen, and the names of their numbers.

use crate::lens::{Freeform, FreeformKind, IdealElement, Row};

/// A form of the sag, as it is chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum FormChoice {
    Conic,
    OddAsphere,
    Biconic,
    Toroid,
    XyPolynomial,
    Zernike,
    FringeZernike,
    Chebyshev,
    QCon,
    QBfs,
    RadialPhase,
    XyPhase,
}

impl FormChoice {
    pub(super) const ALL: [Self; 12] = [
        Self::Conic,
        Self::OddAsphere,
        Self::Biconic,
        Self::Toroid,
        Self::XyPolynomial,
        Self::Zernike,
        Self::FringeZernike,
        Self::Chebyshev,
        Self::QCon,
        Self::QBfs,
        Self::RadialPhase,
        Self::XyPhase,
    ];

    /// The form of a surface.
    pub(super) fn of(row: &Row) -> Self {
        let Some(form) = &row.freeform else { return Self::Conic };
        match form.kind {
            FreeformKind::OddAsphere => Self::OddAsphere,
            FreeformKind::Biconic => Self::Biconic,
            FreeformKind::Toroid => Self::Toroid,
            FreeformKind::XyPolynomial { .. } => Self::XyPolynomial,
            FreeformKind::Zernike { .. } => Self::Zernike,
            FreeformKind::FringeZernike { .. } => Self::FringeZernike,
            FreeformKind::Chebyshev { .. } => Self::Chebyshev,
            FreeformKind::QCon { .. } => Self::QCon,
            FreeformKind::QBfs { .. } => Self::QBfs,
            FreeformKind::RadialPhase { .. } => Self::RadialPhase,
            FreeformKind::XyPhase { .. } => Self::XyPhase,
        }
    }

    /// The name and the explanation.
    pub(super) const fn text(self) -> (&'static str, &'static str) {
        match self {
            Self::Conic => {
                ("Conic, even asphere", "Radius, conic constant and even powers of the table alone")
            }
            Self::OddAsphere => ("Odd asphere", "Adds all powers of the distance from the axis"),
            Self::Biconic => (
                "Biconic",
                "Another radius and conic constant in the x-z plane than in the y-z plane",
            ),
            Self::Toroid => {
                ("Toroid", "A curve in the y-z plane, turned about an axis parallel to y")
            }
            Self::XyPolynomial => ("XY polynomial", "Adds powers of x/R and y/R"),
            Self::Zernike => {
                ("Zernike (Noll)", "Adds Zernike polynomials of variance 1 over a circle")
            }
            Self::FringeZernike => {
                ("Zernike (fringe)", "Adds Zernike polynomials with the value 1 at the rim")
            }
            Self::Chebyshev => ("Chebyshev", "Adds Chebyshev polynomials over a rectangle"),
            Self::QCon => ("Forbes Qcon", "Adds the strong aspheres of Forbes along the axis"),
            Self::QBfs => ("Forbes Qbfs", "Adds the mild aspheres of Forbes along the normal"),
            Self::RadialPhase => {
                ("Diffractive, radial", "Adds even powers of r/R to the phase of the light")
            }
            Self::XyPhase => {
                ("Diffractive, XY", "Adds powers of x/R and y/R to the phase of the light")
            }
        }
    }

    /// The form for a surface of this semi-diameter in mm, which leaves its shape as it is.
    pub(super) fn form(self, row: &Row, radius: f64) -> Option<Freeform<f64>> {
        let (kind, count) = match self {
            Self::Conic => return None,
            Self::OddAsphere => (FreeformKind::OddAsphere, 3),
            Self::Biconic => {
                let numbers = vec![row.curvature, row.conic];
                return Some(Freeform { kind: FreeformKind::Biconic, numbers });
            }
            Self::Toroid => {
                let numbers = vec![row.curvature];
                return Some(Freeform { kind: FreeformKind::Toroid, numbers });
            }
            Self::XyPolynomial => (FreeformKind::XyPolynomial { radius }, 5),
            Self::Zernike => (FreeformKind::Zernike { radius }, 6),
            Self::FringeZernike => (FreeformKind::FringeZernike { radius }, 9),
            Self::Chebyshev => (FreeformKind::Chebyshev { half_widths: [radius; 2] }, 6),
            Self::QCon => (FreeformKind::QCon { radius }, 4),
            Self::QBfs => (FreeformKind::QBfs { radius }, 4),
            Self::RadialPhase => (FreeformKind::RadialPhase { radius, order: 1.0 }, 2),
            Self::XyPhase => (FreeformKind::XyPhase { radius, order: 1.0 }, 5),
        };
        Some(Freeform { kind, numbers: vec![0.0; count] })
    }
}

/// A setting of a form: its name, its unit, its value, and the form with another value.
pub(super) type Setting<T> = (&'static str, &'static str, f64, fn(T, f64) -> T);

/// The lengths over which a form is normalised, and its diffraction order.
pub(super) fn settings(kind: FreeformKind) -> Vec<Setting<FreeformKind>> {
    let mut settings: Vec<Setting<FreeformKind>> = match kind.lengths()[..] {
        [x, y] => vec![
            ("Half width x", ", mm", x, |kind, value| with_length(kind, 0, value)),
            ("Half width y", ", mm", y, |kind, value| with_length(kind, 1, value)),
        ],
        [radius] => {
            vec![("Normalisation R", ", mm", radius, |kind, value| with_length(kind, 0, value))]
        }
        _ => Vec::new(),
    };
    if let Some(order) = kind.order() {
        settings.push(("Diffraction order", "", order, with_order));
    }
    settings
}

/// The kind with another length.
fn with_length(mut kind: FreeformKind, which: usize, value: f64) -> FreeformKind {
    match &mut kind {
        FreeformKind::OddAsphere | FreeformKind::Biconic | FreeformKind::Toroid => {}
        FreeformKind::XyPolynomial { radius }
        | FreeformKind::Zernike { radius }
        | FreeformKind::FringeZernike { radius }
        | FreeformKind::QCon { radius }
        | FreeformKind::QBfs { radius }
        | FreeformKind::RadialPhase { radius, .. }
        | FreeformKind::XyPhase { radius, .. } => *radius = value,
        FreeformKind::Chebyshev { half_widths } => half_widths[which] = value,
    }
    kind
}

/// The kind with another diffraction order.
fn with_order(mut kind: FreeformKind, value: f64) -> FreeformKind {
    if let FreeformKind::RadialPhase { order, .. } | FreeformKind::XyPhase { order, .. } = &mut kind
    {
        *order = value;
    }
    kind
}

/// The name of a number of a form.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct NumberName {
    pub(super) name: String,
    /// Its meaning and its unit.
    pub(super) hint: String,
    /// True for a curvature, which is shown as a radius.
    pub(super) is_radius: bool,
}

/// The name of a number of a form.
pub(super) fn number_name(kind: FreeformKind, number: usize) -> NumberName {
    let power = |of: &str, exponent: usize| match exponent {
        0 => String::new(),
        1 => of.to_owned(),
        _ => format!("{of}{}", superscript(exponent)),
    };
    let [x, y] = kind.degrees(number).unwrap_or_default();
    let term =
        |of: String, unit: &str| (of.clone(), format!("Coefficient of {of}, in {unit}"), false);
    let (name, hint, is_radius) = match kind {
        FreeformKind::OddAsphere => term(power("r", number + 1), &unit_of_power(number + 1)),
        FreeformKind::Biconic if number == 1 => {
            ("Conic x".to_owned(), "Conic constant in the x-z plane".to_owned(), false)
        }
        FreeformKind::Biconic | FreeformKind::Toroid if number == 0 => {
            ("Radius x".to_owned(), "Radius in the x-z plane, in mm".to_owned(), true)
        }
        FreeformKind::Biconic | FreeformKind::Toroid => {
            term(power("y", 2 * number), &unit_of_power(2 * number))
        }
        FreeformKind::XyPolynomial { .. } => {
            term(format!("{}{}", power("x", x), power("y", y)), "mm at x = y = R")
        }
        FreeformKind::XyPhase { .. } => {
            term(format!("{}{}", power("x", x), power("y", y)), "radians at x = y = R")
        }
        FreeformKind::Zernike { .. } => {
            term(format!("Z{}", number + 1), "mm, in the order of Noll")
        }
        FreeformKind::FringeZernike { .. } => {
            term(format!("Z{}", number + 1), "mm, in the fringe order")
        }
        FreeformKind::Chebyshev { .. } => term(format!("T{x}(x) T{y}(y)"), "mm"),
        FreeformKind::QCon { .. } | FreeformKind::QBfs { .. } => term(format!("Q{number}"), "mm"),
        FreeformKind::RadialPhase { .. } => term(power("r", 2 * (number + 1)), "radians at r = R"),
    };
    NumberName { name, hint, is_radius }
}

/// The unit of the coefficient of a power of a length.
fn unit_of_power(exponent: usize) -> String {
    match exponent {
        1 => "mm per mm".to_owned(),
        2 => "1/mm".to_owned(),
        _ => format!("1/mm{}", superscript(exponent - 1)),
    }
}

/// A number in superscript digits.
fn superscript(number: usize) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let digit = |letter: char| letter.to_digit(10).and_then(|d| DIGITS.get(d as usize).copied());
    number.to_string().chars().filter_map(digit).collect()
}

/// A rule of deflection, as it is chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum RuleChoice {
    Plain,
    ParaxialLens,
    Grating,
}

impl RuleChoice {
    pub(super) const ALL: [Self; 3] = [Self::Plain, Self::ParaxialLens, Self::Grating];

    /// The rule of a surface.
    pub(super) const fn of(row: &Row) -> Self {
        match row.ideal {
            None => Self::Plain,
            Some(IdealElement::Lens { .. }) => Self::ParaxialLens,
            Some(IdealElement::Grating { .. }) => Self::Grating,
        }
    }

    /// The name and the explanation.
    pub(super) const fn text(self) -> (&'static str, &'static str) {
        match self {
            Self::Plain => {
                ("Refraction, reflection", "The law of the glass or of the mirror alone")
            }
            Self::ParaxialLens => {
                ("Paraxial lens", "A plane that images without aberrations, with a focal length")
            }
            Self::Grating => ("Grating", "Straight grooves parallel to x, equally spaced along y"),
        }
    }

    /// The rule with numbers to begin with.
    pub(super) const fn rule(self) -> Option<IdealElement> {
        match self {
            Self::Plain => None,
            Self::ParaxialLens => Some(IdealElement::Lens { focal_length: 100.0 }),
            Self::Grating => Some(IdealElement::Grating { lines_per_mm: 100.0, order: 1.0 }),
        }
    }
}

/// The numbers of a rule.
pub(super) fn rule_settings(rule: IdealElement) -> Vec<Setting<IdealElement>> {
    match rule {
        IdealElement::Lens { focal_length } => {
            let set = |_, focal_length| IdealElement::Lens { focal_length };
            vec![("Focal length", ", mm", focal_length, set)]
        }
        IdealElement::Grating { lines_per_mm, order } => vec![
            ("Grooves", ", 1/mm", lines_per_mm, |rule, lines_per_mm| match rule {
                IdealElement::Grating { order, .. } => {
                    IdealElement::Grating { lines_per_mm, order }
                }
                IdealElement::Lens { .. } => rule,
            }),
            ("Order", "", order, |rule, order| match rule {
                IdealElement::Grating { lines_per_mm, .. } => {
                    IdealElement::Grating { lines_per_mm, order }
                }
                IdealElement::Lens { .. } => rule,
            }),
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::Shape;

    fn row() -> Row {
        Row { curvature: 0.02, conic: -0.4, ..Row::default() }
    }

    #[test]
    fn a_new_form_leaves_the_sag_as_it_is_but_for_the_conic_constant_of_a_toroid() {
        let shape: Shape<f64> = row().shape();
        let (conic, _) = shape.sag(25.0).unwrap();
        for choice in FormChoice::ALL.into_iter().filter(|c| *c != FormChoice::Conic) {
            let form = choice.form(&row(), 12.0).unwrap();
            assert_eq!(form.fault(), None, "{choice:?}");
            let sag = form.sag(&form.base(&shape), 3.0, 4.0)[0];
            let near = if choice == FormChoice::Toroid { 1e-3 } else { 1e-14 };
            assert!((sag - conic).abs() < near, "{choice:?}: {sag} {conic}");
            let with = Row { freeform: Some(form), ..row() };
            assert_eq!(FormChoice::of(&with), choice);
        }
    }

    #[test]
    fn numbers_have_the_names_of_their_terms() {
        let name = |kind, number| number_name(kind, number).name;
        let xy = FreeformKind::XyPolynomial { radius: 1.0 };
        let names: Vec<String> = (0..7).map(|number| name(xy, number)).collect();
        assert_eq!(names, ["x", "y", "x²", "xy", "y²", "x³", "x²y"]);
        let chebyshev = FreeformKind::Chebyshev { half_widths: [1.0; 2] };
        assert_eq!(name(chebyshev, 4), "T1(x) T1(y)");
        assert_eq!(name(FreeformKind::OddAsphere, 2), "r³");
        assert_eq!(name(FreeformKind::Toroid, 2), "y⁴");
        assert_eq!(number_name(FreeformKind::OddAsphere, 2).hint, "Coefficient of r³, in 1/mm²");
        assert!(number_name(FreeformKind::Biconic, 0).is_radius);
    }

    #[test]
    fn settings_set_what_they_show() {
        for choice in FormChoice::ALL {
            let Some(form) = choice.form(&row(), 12.0) else { continue };
            for (place, (name, _, _, set)) in settings(form.kind).into_iter().enumerate() {
                let found = settings(set(form.kind, 7.5))[place].2;
                assert_eq!(found, 7.5, "{choice:?}: {name}");
            }
        }
        for rule in [RuleChoice::ParaxialLens, RuleChoice::Grating] {
            let rule = rule.rule().unwrap();
            for (place, (name, _, _, set)) in rule_settings(rule).into_iter().enumerate() {
                assert_eq!(rule_settings(set(rule, 7.5))[place].2, 7.5, "{name}");
            }
        }
    }
}
