//! Text files: the encoding is guessed from the bytes, binary files are recognized, and numbers are
//! written so that they read back to the same bits.

use super::error::{FileError, ParseError};
use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE, WINDOWS_1252};

/// The first bytes of common binary files, and their kinds.
const SIGNATURES: &[(&[u8], &str)] = &[
    (b"\x89PNG", "a PNG picture"),
    (b"\xFF\xD8\xFF", "a JPEG picture"),
    (b"GIF8", "a GIF picture"),
    (b"BM", "a BMP picture"),
    (b"II*\0", "a TIFF picture"),
    (b"MM\0*", "a TIFF picture"),
    (b"RIFF", "a RIFF file (WebP, WAV or AVI)"),
    (b"%PDF", "a PDF document"),
    (b"PK\x03\x04", "a ZIP archive"),
    (b"\x1F\x8B", "a gzip archive"),
    (b"\x7FELF", "a program"),
    (b"MZ", "a program"),
];

/// A number in the fewest digits that read back to the same bits.
pub(super) fn number(value: f64) -> String {
    if value == 0.0 || (1e-5..1e15).contains(&value.abs()) {
        format!("{value:?}")
    } else {
        format!("{value:E}")
    }
}

/// Numbers with blanks between them.
pub(super) fn numbers(values: impl IntoIterator<Item = f64>) -> String {
    values.into_iter().map(number).collect::<Vec<_>>().join(" ")
}

/// The kind of a file that is not text; `None` for text.
pub(super) fn binary_kind(bytes: &[u8]) -> Option<String> {
    let known = SIGNATURES.iter().find(|(signature, _)| bytes.starts_with(signature));
    // Some signatures are letters, so they count only in a file with control characters.
    let binary = control_share(bytes) > 0.02;
    match known {
        Some((_, what)) if binary => Some((*what).to_owned()),
        None if binary && encoding(bytes).1 == WINDOWS_1252 => Some("binary data".to_owned()),
        _ if bytes.is_empty() => Some("an empty file".to_owned()),
        _ => None,
    }
}

fn control_share(bytes: &[u8]) -> f64 {
    let start = &bytes[..bytes.len().min(4096)];
    let control = |b: &&u8| **b < 9 || (14..32).contains(*b) || **b == 127;
    start.iter().filter(control).count() as f64 / start.len().max(1) as f64
}

/// Decodes UTF-16 or UTF-8, with or without a byte order mark, or Windows-1252.
pub(super) fn decode(bytes: &[u8]) -> String {
    let (mark, encoding) = encoding(bytes);
    let (text, _) = encoding.decode_without_bom_handling(&bytes[mark..]);
    text.into_owned()
}

/// Refuses 8-bit encodings, whose letters depend on the country.
fn require_unicode(bytes: &[u8]) -> Result<(), ParseError> {
    if encoding(bytes).1 != WINDOWS_1252 {
        return Ok(());
    }
    let good = std::str::from_utf8(bytes).map_or_else(|error| error.valid_up_to(), str::len);
    let line = bytes[..good].split(|byte| *byte == b'\n').count();
    let found = format!("the byte {:#04x}", bytes.get(good).copied().unwrap_or_default());
    Err(ParseError { place: format!("line {line}"), found, expected: "UTF-8 text".to_owned() })
}

/// Decodes the text of a JSON file; `name` is its name in messages.
///
/// # Errors
/// [`FileError::Malformed`] for an 8-bit encoding, with the line of the first byte that is not UTF-8.
pub fn decode_unicode(bytes: &[u8], name: &str) -> Result<String, FileError> {
    require_unicode(bytes).map_err(|wrong| wrong.in_file(name))?;
    Ok(decode(bytes))
}

/// Encodes little-endian UTF-16 with a byte order mark.
pub(super) fn encode_utf16(text: &str) -> Vec<u8> {
    std::iter::once(0xFEFF).chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect()
}

/// The length of the byte order mark, in bytes, and the encoding.
fn encoding(bytes: &[u8]) -> (usize, &'static Encoding) {
    if let Some((encoding, mark)) = Encoding::for_bom(bytes) {
        return (mark, encoding);
    }
    if zero_share(bytes, 1) > 0.3 {
        (0, UTF_16LE)
    } else if zero_share(bytes, 0) > 0.3 {
        (0, UTF_16BE)
    } else if std::str::from_utf8(bytes).is_ok() {
        (0, UTF_8)
    } else {
        (0, WINDOWS_1252)
    }
}

/// The share of zeros among every other byte at the start, which is high for Latin text in UTF-16.
fn zero_share(bytes: &[u8], first: usize) -> f64 {
    let start = &bytes[..bytes.len().min(400)];
    let half = || start.iter().skip(first).step_by(2);
    half().filter(|byte| **byte == 0).count() as f64 / half().count().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn utf16(text: &str, mark: bool, bytes: fn(u16) -> [u8; 2]) -> Vec<u8> {
        let start = mark.then_some(0xFEFF);
        start.into_iter().chain(text.encode_utf16()).flat_map(bytes).collect()
    }

    #[test]
    fn every_encoding_gives_the_same_text() {
        let text = "NAME Tessär 50 mm\r\nSURF 0\r\n";
        for mark in [false, true] {
            assert_eq!(decode(&utf16(text, mark, u16::to_le_bytes)), text);
            assert_eq!(decode(&utf16(text, mark, u16::to_be_bytes)), text);
        }
        assert_eq!(decode(text.as_bytes()), text);
        assert_eq!(decode(&[b"\xEF\xBB\xBF", text.as_bytes()].concat()), text);
        let latin: Vec<u8> = text.chars().map(|c| c as u8).collect();
        assert_eq!(decode(&latin), text);
    }

    #[test]
    fn pictures_are_no_text_and_letters_are() {
        let picture = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x01\0\0\0\x01\x08\x02";
        assert_eq!(binary_kind(picture).unwrap(), "a PNG picture");
        assert_eq!(binary_kind(b"\0\x01\x02\x03\x04\x05\xF0\xF1").unwrap(), "binary data");
        assert_eq!(binary_kind(b"").unwrap(), "an empty file");
        assert_eq!(binary_kind(b"BMW and MZ are letters"), None);
        assert_eq!(binary_kind(&utf16("SURF 0\r\n  STOP\r\n", false, u16::to_le_bytes)), None);
    }
}
