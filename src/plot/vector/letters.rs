//! The widths of letters on paper, and lines broken by them.

use epaint_default_fonts::UBUNTU_LIGHT;
use std::sync::OnceLock;
use ttf_parser::Face;

/// The typeface of all paper.
pub(super) const TYPEFACE: &[u8] = UBUNTU_LIGHT;
/// The width of a letter that the typeface does not have, as a share of its size.
const UNKNOWN_LETTER: f64 = 0.5;

fn face() -> Option<&'static Face<'static>> {
    static FACE: OnceLock<Option<Face<'static>>> = OnceLock::new();
    FACE.get_or_init(|| Face::parse(TYPEFACE, 0).ok()).as_ref()
}

/// The width in mm of a line of text at a size in mm.
pub fn text_width(text: &str, size: f64) -> f64 {
    let letter = |face: &Face<'_>, letter: char| {
        let advance = face.glyph_hor_advance(face.glyph_index(letter)?)?;
        Some(f64::from(advance) / f64::from(face.units_per_em()))
    };
    let width = |c: char| face().and_then(|face| letter(face, c)).unwrap_or(UNKNOWN_LETTER);
    size * text.chars().map(width).sum::<f64>()
}

/// A text in lines that are no wider than this by a measure of lines, broken at blanks; a longer word has a line of
/// its own.
pub fn wrapped<W: PartialOrd + Copy>(
    text: &str,
    most: W,
    width: impl Fn(&str) -> W,
) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if width(&format!("{line} {word}")) <= most => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_are_equally_wide_and_lines_no_wider_than_asked() {
        let width = text_width("0", 10.0);
        assert!(width > 3.0 && width < 8.0, "{width}");
        assert!(('1'..='9').all(|digit| text_width(&digit.to_string(), 10.0) == width));
        let text = "the quick brown fox jumps over the lazy dog ".repeat(5);
        let lines = wrapped(&text, 40.0, |line| text_width(line, 3.0));
        assert!(lines.len() > 3 && lines.iter().all(|line| text_width(line, 3.0) <= 40.0));
        assert_eq!(lines.join(" "), text.trim_end());
    }

    #[test]
    fn the_typeface_has_the_letters_of_reports() {
        let face = face().unwrap();
        for letter in "0123456789ABCXYZabcxyz±°µØ×/()-–=.,:;%²³λνφαβ".chars() {
            assert!(face.glyph_index(letter).is_some(), "{letter}");
        }
    }
}
