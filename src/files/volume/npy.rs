//! One array in `NumPy`'s format (NEP 1): a magic string, a Python dictionary as header, and the numbers.

use super::decode;
use crate::files::error::ParseError;

/// An array of numbers in row-major order: the last index runs fastest.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct NpyArray {
    pub(super) shape: Vec<usize>,
    pub(super) values: Vec<f64>,
}

const MAGIC: &[u8] = b"\x93NUMPY";

/// Reads an array; `name` is its name in messages.
pub(super) fn read(name: &str, bytes: &[u8]) -> Result<NpyArray, ParseError> {
    let wrong = |found: String, expected: &str| ParseError {
        place: format!("array {name}"),
        found,
        expected: expected.to_owned(),
    };
    let (header, data) = split_header(bytes)
        .ok_or_else(|| wrong("no array header".into(), "NumPy's .npy format"))?;
    let entry = |key| header_entry(header, key).unwrap_or_default();
    let kind = entry("descr").trim_matches(['\'', '"']);
    let numbers: Vec<f64> = match kind {
        "<f8" => decode(data, f64::from_le_bytes),
        "<f4" => decode(data, |b| f64::from(f32::from_le_bytes(b))),
        "<i8" => decode(data, |b| i64::from_le_bytes(b) as f64),
        "<i4" => decode(data, |b| f64::from(i32::from_le_bytes(b))),
        _ => return Err(wrong(format!("numbers of type {kind}"), "<f8, <f4, <i8 or <i4")),
    };
    let shape = parse_shape(entry("shape"))
        .ok_or_else(|| wrong(format!("shape {}", entry("shape")), "a tuple of counts"))?;
    let count = shape.iter().try_fold(1_usize, |product, n| product.checked_mul(*n));
    if count != Some(numbers.len()) {
        return Err(wrong(
            format!("{} numbers for {shape:?}", numbers.len()),
            "one for each element",
        ));
    }
    let values =
        if entry("fortran_order") == "True" { to_row_major(&shape, &numbers) } else { numbers };
    Ok(NpyArray { shape, values })
}

/// The header and the bytes of the numbers.
fn split_header(bytes: &[u8]) -> Option<(&str, &[u8])> {
    let rest = bytes.strip_prefix(MAGIC)?;
    let (version, rest) = rest.split_at_checked(2)?;
    // The length of the header has 2 bytes in version 1 and 4 in later versions.
    let (length, rest) = if version[0] == 1 {
        let (length, rest) = rest.split_first_chunk()?;
        (u32::from(u16::from_le_bytes(*length)), rest)
    } else {
        let (length, rest) = rest.split_first_chunk()?;
        (u32::from_le_bytes(*length), rest)
    };
    let (header, data) = rest.split_at_checked(length as usize)?;
    Some((std::str::from_utf8(header).ok()?, data))
}

/// The text of an entry of the header, a dictionary of strings, words and tuples.
fn header_entry<'a>(header: &'a str, key: &str) -> Option<&'a str> {
    let (_, rest) = header.split_once(&format!("'{key}'"))?;
    let rest = rest.trim_start().strip_prefix(':')?.trim_start();
    let end = if rest.starts_with('(') { rest.find(')')? + 1 } else { rest.find([',', '}'])? };
    Some(rest[..end].trim())
}

fn parse_shape(tuple: &str) -> Option<Vec<usize>> {
    let inner = tuple.strip_prefix('(')?.strip_suffix(')')?;
    let counts = inner.split(',').map(str::trim).filter(|count| !count.is_empty());
    counts.map(|count| count.parse().ok()).collect()
}

/// Reorders numbers from column-major to row-major order.
fn to_row_major(shape: &[usize], numbers: &[f64]) -> Vec<f64> {
    let place = |mut n: usize| {
        let (mut at, mut stride) = (0, numbers.len());
        for count in shape.iter().rev() {
            stride /= count;
            at += n % count * stride;
            n /= count;
        }
        at
    };
    (0..numbers.len()).map(|n| numbers[place(n)]).collect()
}

/// Writes an array of 8-byte numbers.
pub(super) fn write(shape: &[usize], values: &[f64]) -> Vec<u8> {
    let counts: Vec<String> = shape.iter().map(|count| format!("{count},")).collect();
    let shape = counts.join(" ");
    let mut header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({shape}), }}");
    // The numbers begin at a multiple of 64 bytes, and the header ends with a line feed.
    let before = MAGIC.len() + 4;
    let padding = (before + header.len() + 1).next_multiple_of(64) - before - header.len() - 1;
    header.push_str(&" ".repeat(padding));
    header.push('\n');
    let mut bytes = MAGIC.to_vec();
    bytes.extend([1, 0]);
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    values.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
    bytes
}
