//! Apertures as a line of text, as a table shows them and a person types them: `rectangle ±3 x ±2 at 1, 2
//! turned 45`, `spider 3 x 0.5`, `obscuring circle ±2`, several of them behind semicolons.
//!
//! Sizes are half widths and radii, like semi-diameters, in mm; those of a spider are the number of its arms
//! and their width. An aperture lets light through inside unless it is `obscuring`, as a spider always is.

use std::fmt;
use std::str::FromStr;

use super::surface_aperture::{ApertureShape, BlockedSide, SurfaceAperture};
use crate::math::ShortNumber;

/// The forms as they are typed.
const FORMS: &str = "circle ±3, ellipse ±3 x ±2, rectangle ±3 x ±2, polygon (0, 0) (3, 0) (0, 2) or \
                     spider 3 x 0.5";

impl SurfaceAperture {
    /// Its text with numbers as `show` writes them.
    pub fn text_with(&self, show: impl Fn(f64) -> String) -> String {
        let form = match &self.shape {
            ApertureShape::Circle { radius } => format!("circle ±{}", show(*radius)),
            ApertureShape::Ellipse { half_width: a, half_height: b } => {
                format!("ellipse ±{} x ±{}", show(*a), show(*b))
            }
            ApertureShape::Rectangle { half_width: a, half_height: b } => {
                format!("rectangle ±{} x ±{}", show(*a), show(*b))
            }
            ApertureShape::Polygon { points } => {
                let corners = points.iter().map(|[x, y]| format!(" ({}, {})", show(*x), show(*y)));
                format!("polygon{}", corners.collect::<String>())
            }
            ApertureShape::Spider { arms, width } => format!("spider {arms} x {}", show(*width)),
        };
        let is_spider = matches!(self.shape, ApertureShape::Spider { .. });
        let side = if self.obscures() && !is_spider { "obscuring " } else { "" };
        let [x, y] = self.center;
        let is_beside = self.center != [0.0; 2];
        let place = is_beside.then(|| format!(" at {}, {}", show(x), show(y)));
        let turned = (self.angle != 0.0).then(|| format!(" turned {}", show(self.angle)));
        format!("{side}{form}{}{}", place.unwrap_or_default(), turned.unwrap_or_default())
    }
}

impl SurfaceAperture {
    /// Its text in reports and drawings: six digits, and of a polygon the number of its corners.
    pub fn short_text(&self) -> String {
        match &self.shape {
            ApertureShape::Polygon { points } => {
                let side = if self.obscures() { "obscuring " } else { "" };
                format!("{side}polygon of {} corners", points.len())
            }
            _ => self.text_with(|number| ShortNumber(number).to_string()),
        }
    }
}

impl fmt::Display for SurfaceAperture {
    /// The text with all digits, from which the same aperture is read.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text_with(|number| number.to_string()))
    }
}

/// The apertures of a surface as one line with all digits.
pub fn apertures_text(apertures: &[SurfaceAperture]) -> String {
    let texts: Vec<_> = apertures.iter().map(ToString::to_string).collect();
    texts.join("; ")
}

/// Reads the apertures of a surface from such a line; none from an empty one.
pub fn parse_apertures(text: &str) -> Result<Vec<SurfaceAperture>, String> {
    text.split(';').map(str::trim).filter(|part| !part.is_empty()).map(str::parse).collect()
}

impl FromStr for SurfaceAperture {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let text = text.to_lowercase();
        check_commas(&text)?;
        let mut words = words(&text);
        let obscures =
            words.first().is_some_and(|word| matches!(*word, "obscuring" | "obscuration"));
        if obscures {
            words.remove(0);
        }
        let Some((name, rest)) = words.split_first() else {
            return Err(format!("expected an aperture: {FORMS}"));
        };
        let [sizes, center, angle] = parts(rest)?;
        let shape = shape(name, &sizes)?;
        let center = match center[..] {
            [] => [0.0; 2],
            [x, y] => [x, y],
            _ => return Err(format!("expected `at x, y`, found {} numbers", center.len())),
        };
        let angle = match angle[..] {
            [] => 0.0,
            [angle] => angle,
            _ => {
                return Err(format!(
                    "expected `turned` and an angle, found {} numbers",
                    angle.len()
                ));
            }
        };
        let is_spider = matches!(shape, ApertureShape::Spider { .. });
        let blocks = if obscures || is_spider { BlockedSide::Inside } else { BlockedSide::Outside };
        Ok(Self { shape, center, angle, blocks })
    }
}

/// Refuses a comma in front of a digit outside of brackets: `3,5` may be one number or two.
fn check_commas(text: &str) -> Result<(), String> {
    let mut depth = 0;
    for (c, next) in text.chars().zip(text.chars().skip(1)) {
        depth += i32::from(c == '(') - i32::from(c == ')');
        if c == ',' && depth == 0 && next.is_ascii_digit() {
            return Err("expected a point in a number, or a space behind a comma".to_owned());
        }
    }
    Ok(())
}

/// The words and numbers of a text without the signs between them.
fn words(text: &str) -> Vec<&str> {
    let is_between = |c: char| c.is_whitespace() || matches!(c, '±' | '×' | ',' | '(' | ')');
    text.split(is_between).flat_map(split_sizes).filter(|word| !matches!(*word, "" | "x")).collect()
}

/// The numbers of `3x2` or `3x`, or the word as it is.
fn split_sizes(word: &str) -> Vec<&str> {
    let parts: Vec<&str> = word.split('x').filter(|part| !part.is_empty()).collect();
    if parts.iter().all(|part| part.parse::<f64>().is_ok()) { parts } else { vec![word] }
}

/// The sizes, the centre and the angle behind the name of a form.
fn parts(words: &[&str]) -> Result<[Vec<f64>; 3], String> {
    let mut parts = [const { Vec::new() }; 3];
    let mut part = 0;
    for word in words {
        match *word {
            "at" if parts[1].is_empty() => part = 1,
            "turned" | "rotated" if parts[2].is_empty() => part = 2,
            "at" | "turned" | "rotated" => return Err(format!("expected `{word}` once")),
            "°" | "deg" | "mm" => {}
            number => parts[part].push(parse_number(number)?),
        }
    }
    Ok(parts)
}

fn parse_number(word: &str) -> Result<f64, String> {
    let number = word.trim_end_matches('°').parse();
    number.map_err(|_error| format!("expected a number, `at` or `turned`, found `{word}`"))
}

/// The form of this name with its sizes.
fn shape(name: &str, sizes: &[f64]) -> Result<ApertureShape, String> {
    let found = sizes.len();
    let expected = |what: &str| Err(format!("a {name} has {what}; found {found} numbers"));
    match (name, sizes) {
        ("circle", [radius]) => Ok(ApertureShape::Circle { radius: *radius }),
        ("circle", _) => expected("one radius"),
        ("ellipse", [a, b]) => Ok(ApertureShape::Ellipse { half_width: *a, half_height: *b }),
        ("rectangle", [a, b]) => Ok(ApertureShape::Rectangle { half_width: *a, half_height: *b }),
        ("ellipse" | "rectangle", _) => expected("a half width and a half height"),
        ("polygon", _) if found.is_multiple_of(2) => {
            let points = sizes.chunks_exact(2).map(|p| [p[0], p[1]]).collect();
            Ok(ApertureShape::Polygon { points })
        }
        ("polygon", _) => expected("two numbers for each corner"),
        ("spider", [arms, width]) if arms.fract() == 0.0 && (0.0..1e6).contains(arms) => {
            Ok(ApertureShape::Spider { arms: *arms as usize, width: *width })
        }
        ("spider", _) => expected("a whole number of arms and their width"),
        _ => Err(format!("expected {FORMS}; found `{name}`")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_read_as_what_wrote_it() {
        let turned = SurfaceAperture {
            center: [1.0 / 3.0, -2e-7],
            angle: 12.5,
            ..SurfaceAperture::inside(ApertureShape::Rectangle {
                half_width: 0.1,
                half_height: 2.0,
            })
        };
        let points = vec![[0.0, 0.0], [3.0, -1.5], [1e-3, 2.0]];
        let all = vec![
            turned.clone(),
            SurfaceAperture::obscuration(ApertureShape::Circle { radius: 2.25 }),
            SurfaceAperture::inside(ApertureShape::Ellipse { half_width: 3.0, half_height: 2.0 }),
            SurfaceAperture::obscuration(ApertureShape::Polygon { points }),
            SurfaceAperture::obscuration(ApertureShape::Spider { arms: 3, width: 0.5 }),
        ];
        assert_eq!(parse_apertures(&apertures_text(&all)), Ok(all));
        assert_eq!(
            turned.text_with(|v| format!("{v:.1}")),
            "rectangle ±0.1 x ±2.0 at 0.3, -0.0 turned 12.5"
        );
    }

    #[test]
    fn the_signs_between_are_optional() {
        let plain = "rectangle 3 2 at 1 2 turned 45".parse::<SurfaceAperture>();
        assert_eq!(plain, "Rectangle ±3 × ±2 at (1, 2) turned 45°".parse());
        assert_eq!(plain, "rectangle ±3x±2 turned 45 at (1,2)".parse());
        assert_eq!(plain, "rectangle 3x2 turned 45 at 1, 2".parse());
        assert!(plain.is_ok());
        assert_eq!(parse_apertures(" ; "), Ok(Vec::new()));
    }

    #[test]
    fn what_is_no_aperture_is_named() {
        let error = |text: &str| text.parse::<SurfaceAperture>().unwrap_err();
        assert!(error("square 3").ends_with("found `square`"), "{}", error("square 3"));
        assert_eq!(error("circle 1 2"), "a circle has one radius; found 2 numbers");
        assert_eq!(error("circle wide"), "expected a number, `at` or `turned`, found `wide`");
        assert_eq!(error("circle 1 at 2"), "expected `at x, y`, found 1 numbers");
        assert_eq!(error("circle 1 turned 3 turned 4"), "expected `turned` once");
        assert!(error("rectangle 3,5").contains("a point in a number"));
        assert!(error("spider 2.5 x 1").contains("whole number of arms"));
        assert!(error("obscuring").starts_with("expected an aperture"));
    }
}
