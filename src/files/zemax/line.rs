//! A line of a `.zmx` file: a keyword and fields separated by blanks.

use crate::files::error::ParseError;

/// The largest accepted number.
const MAX_NUMBER: f64 = 1e100;

/// One line that is not blank.
#[derive(Debug, Clone)]
pub(super) struct ZemaxLine<'a> {
    /// The line number, from 1.
    pub(super) number: usize,
    /// The first word.
    pub(super) keyword: &'a str,
    /// The text behind the keyword.
    pub(super) rest: &'a str,
    /// The words behind the keyword; a quoted text is one word.
    pub(super) fields: Vec<&'a str>,
    /// True if numbers have a decimal comma.
    pub(super) comma: bool,
}

/// The lines of a text that are not blank.
pub(super) fn lines(text: &str) -> Vec<ZemaxLine<'_>> {
    let mut lines: Vec<ZemaxLine<'_>> = text.lines().zip(1..).filter_map(parse_line).collect();
    if has_decimal_commas(&lines) {
        lines.iter_mut().for_each(|line| line.comma = true);
    }
    lines
}

fn parse_line((text, number): (&str, usize)) -> Option<ZemaxLine<'_>> {
    let text = text.trim();
    let keyword = text.split_whitespace().next()?;
    let rest = text[keyword.len()..].trim_start();
    Some(ZemaxLine { number, keyword, rest, fields: split_fields(rest), comma: false })
}

/// True if curvatures or thicknesses have commas and no points.
fn has_decimal_commas(lines: &[ZemaxLine<'_>]) -> bool {
    let lengths = || {
        let geometry = lines.iter().filter(|line| matches!(line.keyword, "CURV" | "DISZ"));
        geometry.filter_map(|line| line.fields.first())
    };
    lengths().any(|field| field.contains(',')) && !lengths().any(|field| field.contains('.'))
}

fn split_fields(rest: &str) -> Vec<&str> {
    let mut fields = Vec::new();
    let mut rest = rest.trim_start();
    while !rest.is_empty() {
        let (field, behind) = match rest.strip_prefix('"') {
            Some(quoted) => quoted.split_once('"').unwrap_or((quoted, "")),
            None => rest.split_once(char::is_whitespace).unwrap_or((rest, "")),
        };
        fields.push(field);
        rest = behind.trim_start();
    }
    fields
}

impl ZemaxLine<'_> {
    /// The whole line, without surrounding blanks.
    pub(super) fn source_text(&self) -> String {
        format!("{} {}", self.keyword, self.rest).trim_end().to_owned()
    }

    /// The place of the line in a message.
    pub(super) fn place(&self) -> String {
        format!("line {}", self.number)
    }

    /// The error that the line is malformed.
    pub(super) fn malformed(&self, found: impl Into<String>, expected: &str) -> ParseError {
        ParseError { place: self.place(), found: found.into(), expected: expected.to_owned() }
    }

    /// The number in a field.
    pub(super) fn number(&self, field: usize) -> Result<f64, ParseError> {
        let Some(text) = self.fields.get(field) else {
            let found = format!("`{}` with {} fields", self.source_text(), self.fields.len());
            return Err(self.malformed(found, &format!("a number in field {}", field + 1)));
        };
        self.parse(text).ok_or_else(|| {
            let found = format!("`{text}` in `{}`", self.source_text());
            self.malformed(found, "a finite number below 1e100")
        })
    }

    /// The number in a field, or `default` if the line is shorter.
    pub(super) fn number_or(&self, field: usize, default: f64) -> Result<f64, ParseError> {
        if field < self.fields.len() { self.number(field) } else { Ok(default) }
    }

    /// Every field as a number.
    pub(super) fn numbers(&self) -> Result<Vec<f64>, ParseError> {
        (0..self.fields.len()).map(|field| self.number(field)).collect()
    }

    /// The whole number in a field; some writers append `.0`.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a whole number in range"
    )]
    pub(super) fn count(&self, field: usize) -> Result<usize, ParseError> {
        let number = self.number(field)?;
        if number >= 0.0 && number.fract() == 0.0 && number <= f64::from(u32::MAX) {
            return Ok(number as usize);
        }
        Err(self.malformed(
            format!("`{number}` in `{}`", self.source_text()),
            "a whole number, 0 or more",
        ))
    }

    /// The whole number in a field, if there is one.
    pub(super) fn count_if_any(&self, field: usize) -> Option<usize> {
        self.count(field).ok()
    }

    /// The text of a field.
    pub(super) fn word(&self, field: usize) -> Result<&str, ParseError> {
        self.fields.get(field).copied().ok_or_else(|| {
            let found = format!("`{}` with {} fields", self.source_text(), self.fields.len());
            self.malformed(found, &format!("a word in field {}", field + 1))
        })
    }

    fn parse(&self, text: &str) -> Option<f64> {
        let number: f64 =
            if self.comma { text.replace(',', ".").parse() } else { text.parse() }.ok()?;
        // `inf` and `nan` parse as numbers too.
        (number.abs() <= MAX_NUMBER).then_some(number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_in_every_spelling() {
        let text = "PARM 1.2E-003 5.E-1 -1. .5 1.797e2 +3 0.019500000000000000001";
        let expected = [1.2e-3, 0.5, -1.0, 0.5, 179.7, 3.0, 0.0195];
        assert_eq!(lines(text)[0].numbers().unwrap(), expected);
        for wrong in ["nan", "NaN", "inf", "INFINITY", "1e999", "1e308", "0x1", "--1"] {
            let text = format!("\n  CURV {wrong} 0");
            let error = lines(&text)[0].number(0).unwrap_err();
            assert_eq!(error.place, "line 2");
            assert!(error.found.contains(wrong), "{}", error.found);
        }
        assert!(lines("CURV")[0].number(0).unwrap_err().found.contains("with 0 fields"));
        assert!(lines("PWAV 1.5")[0].count(0).is_err() && lines("PWAV -1")[0].count(0).is_err());
    }

    #[test]
    fn commas_are_decimal_only_in_files_without_points() {
        let read = |text| lines(text)[0].number(0).ok();
        assert_eq!(read("CURV 0,02\nDISZ 5"), Some(0.02));
        assert_eq!(read("CURV 0,02\nDISZ 5.0"), None);
    }

    #[test]
    fn a_quoted_text_is_one_field() {
        let line = &lines("  CURV 0.5 0 \"two words\" 3 \"")[0];
        assert_eq!(line.fields, ["0.5", "0", "two words", "3", ""]);
        assert_eq!(line.rest, "0.5 0 \"two words\" 3 \"");
    }
}
