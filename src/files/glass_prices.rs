//! The prices of glasses that a person states, in a list to edit by hand.

use super::bounded::{MAX_LENS_BYTES, read_file};
use super::error::FileError;
use super::text::decode_unicode;
use std::path::Path;

/// Reads a list of prices: lines `SCHOTT N-BK7,1.1` of a glass by its full name and its price relative to
/// that of N-BK7; a `#` begins a remark. `None` if there is no such file.
///
/// # Errors
/// A file that cannot be read, or a line that is none of a list.
pub(super) fn read_prices(path: &Path) -> Result<Option<Vec<(String, f64)>>, FileError> {
    if !path.exists() {
        return Ok(None);
    }
    let file = path.display().to_string();
    let bytes = read_file(path, MAX_LENS_BYTES)?;
    let text = decode_unicode(&bytes, &file)?;
    parse_prices(&text, &file).map(Some)
}

fn parse_prices(text: &str, file: &str) -> Result<Vec<(String, f64)>, FileError> {
    let mut prices = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default().trim();
        if line.is_empty() {
            continue;
        }
        let found = line.rsplit_once(',').and_then(|(name, price)| {
            let price: f64 = price.trim().parse().ok()?;
            let name = name.trim().trim_matches('"');
            (!name.is_empty() && price > 0.0 && price.is_finite()).then(|| (name.to_owned(), price))
        });
        prices.push(found.ok_or_else(|| FileError::Malformed {
            file: file.to_owned(),
            place: format!("line {}", number + 1),
            found: format!("`{}`", line.escape_debug()),
            expected: "maker and name of a glass, a comma and its price above 0".to_owned(),
        })?);
    }
    Ok(prices)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_of_prices_has_a_glass_in_each_line() {
        let text = "# mine\n\nSCHOTT N-BK7, 1.1\n\"OHARA S-FPL53\",25 # by the offer of May\n";
        let prices = parse_prices(text, "prices.csv").unwrap();
        assert_eq!(prices, [("SCHOTT N-BK7".to_owned(), 1.1), ("OHARA S-FPL53".to_owned(), 25.0)]);
        for line in ["SCHOTT N-BK7", "SCHOTT N-BK7,free", "SCHOTT N-BK7,-1", ",2"] {
            let why = parse_prices(&format!("\n{line}"), "prices.csv").unwrap_err().to_string();
            assert!(why.starts_with("prices.csv, line 2: found"), "{why}");
        }
    }
}
