//! One array in `NumPy`'s format (NEP 1): a magic string, a Python dictionary as header, and the numbers.

use super::{MAX_NODES, decode};
use crate::files::error::ParseError;
use std::io::Read;

/// An array of numbers in row-major order: the last index runs fastest.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct NpyArray {
    pub(super) shape: Vec<usize>,
    pub(super) values: Vec<f64>,
}

const MAGIC: &[u8] = b"\x93NUMPY";
/// The maximum number of bytes of a header.
const MAX_HEADER: u64 = 65_536;

/// Reads an array; `name` is its name in messages. The header comes first, and no more numbers are
/// read than it says: a small archive may hold a long row of them.
pub(super) fn read(name: &str, mut from: impl Read) -> Result<NpyArray, ParseError> {
    let wrong = |found: String, expected: &str| ParseError {
        place: format!("array {name}"),
        found,
        expected: expected.to_owned(),
    };
    let header = read_header(&mut from)
        .ok_or_else(|| wrong("no array header".into(), "NumPy's .npy format"))?;
    let entry = |key| header_entry(&header, key).unwrap_or_default();
    let kind = entry("descr").trim_matches(['\'', '"']);
    let numbers = NumberFormat::of(kind)
        .ok_or_else(|| wrong(format!("numbers of type {kind}"), "<f8, <f4, <i8 or <i4"))?;
    let shape = parse_shape(entry("shape"))
        .ok_or_else(|| wrong(format!("shape {}", entry("shape")), "a tuple of counts"))?;
    let count = shape.iter().try_fold(1_u64, |product, n| product.checked_mul(*n as u64));
    let count = count.filter(|count| *count <= MAX_NODES).ok_or_else(|| {
        wrong(format!("shape {shape:?}"), &format!("at most {MAX_NODES} numbers"))
    })?;
    let (mut data, bytes) = (Vec::new(), count * numbers.bytes as u64);
    let read = from.take(bytes + 1).read_to_end(&mut data);
    read.map_err(|error| wrong(error.to_string(), "an undamaged archive"))?;
    if data.len() as u64 != bytes {
        let found = if data.len() as u64 > bytes { "more".into() } else { data.len().to_string() };
        let expected = format!("{bytes}: one number for each element");
        return Err(wrong(format!("{found} bytes of numbers for {shape:?}"), &expected));
    }
    let values = (numbers.decode)(&data);
    let values =
        if entry("fortran_order") == "True" { to_row_major(&shape, &values) } else { values };
    Ok(NpyArray { shape, values })
}

/// A format of numbers.
struct NumberFormat {
    /// The number of bytes of one number.
    bytes: usize,
    decode: fn(&[u8]) -> Vec<f64>,
}

impl NumberFormat {
    /// The format by `NumPy`'s name; `None` for others.
    fn of(kind: &str) -> Option<Self> {
        let format = |bytes, decode| Some(Self { bytes, decode });
        match kind {
            "<f8" => format(8, |data| decode(data, f64::from_le_bytes)),
            "<f4" => format(4, |data| decode(data, |b| f64::from(f32::from_le_bytes(b)))),
            "<i8" => format(8, |data| decode(data, |b| i64::from_le_bytes(b) as f64)),
            "<i4" => format(4, |data| decode(data, |b| f64::from(i32::from_le_bytes(b)))),
            _ => None,
        }
    }
}

/// Reads the header, which leaves the numbers.
fn read_header(from: &mut impl Read) -> Option<String> {
    let mut start = [0; 8];
    from.read_exact(&mut start).ok()?;
    let [version, _] = start.strip_prefix(MAGIC)? else { return None };
    // The length of the header has 2 bytes in version 1 and 4 in later versions.
    let mut length = [0; 4];
    let bytes = if *version == 1 { 2 } else { 4 };
    from.read_exact(&mut length[..bytes]).ok()?;
    let length = u64::from(u32::from_le_bytes(length));
    let mut header = String::new();
    let is_plausible = length <= MAX_HEADER;
    is_plausible.then(|| from.take(length).read_to_string(&mut header).ok())??;
    (header.len() as u64 == length).then_some(header)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_numbers_of_an_array_begin_at_a_multiple_of_64_bytes() {
        // Headers of every length, modulo 64.
        for dimensions in 1..=64 {
            let bytes = write(&vec![1; dimensions], &[0.25]);
            let begin = bytes.len() - 8;
            assert_eq!(begin % 64, 0, "{dimensions} dimensions");
            assert_eq!(bytes[begin - 1], b'\n');
            let length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
            assert_eq!(begin, 10 + length);
        }
    }
}
