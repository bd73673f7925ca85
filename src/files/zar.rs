//! Archives of Zemax, `.zar`: a lens with the catalogues and data that it needs.
//!
//! An archive is a sequence of members, each a header of fixed length with name and size, then the
//! data. Names that end in `.LZW` are compressed by LZW with codes of 9 bits and more, the most
//! significant bit first, without the reserved codes of GIF and TIFF, which is why the libraries for
//! these do not read it. The layout is that of the public program zmxtools (T. Vettenburg).

use super::bounded::MAX_LENS_BYTES;
use super::error::{FileError, ParseError};
use encoding_rs::UTF_16LE;

/// A layout of the header of a member.
struct HeaderLayout {
    signature: [u8; 2],
    bytes: usize,
    size: std::ops::Range<usize>,
    name: usize,
    wide_name: bool,
}

const LAYOUTS: [HeaderLayout; 2] = [
    HeaderLayout {
        signature: [0xEC, 0x03],
        bytes: 0x288,
        size: 0x10..0x18,
        name: 0x30,
        wide_name: true,
    },
    HeaderLayout {
        signature: [0xEA, 0x00],
        bytes: 0x14C,
        size: 0x0C..0x10,
        name: 0x20,
        wide_name: false,
    },
];

/// A member of an archive.
#[derive(Debug, Clone, Copy)]
pub(super) struct Member<'a> {
    layout: &'static HeaderLayout,
    header: &'a [u8],
    data: &'a [u8],
}

impl std::fmt::Debug for HeaderLayout {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:02x?}", self.signature)
    }
}

/// True for bytes that begin like an archive.
pub(super) fn is_archive(bytes: &[u8]) -> bool {
    layout_of(bytes).is_some()
}

fn layout_of(bytes: &[u8]) -> Option<&'static HeaderLayout> {
    let long = |layout: &&HeaderLayout| bytes.len() >= layout.bytes;
    LAYOUTS.iter().filter(long).find(|layout| bytes.starts_with(&layout.signature))
}

/// The members of an archive; `file` is its name in messages.
///
/// # Errors
/// A header that is not one, or data that end early.
pub(super) fn members<'a>(bytes: &'a [u8], file: &str) -> Result<Vec<Member<'a>>, FileError> {
    let mut left = bytes;
    let mut found = Vec::new();
    while !left.is_empty() {
        let member = Member::first_of(left).ok_or_else(|| {
            let place = format!("byte {}", bytes.len() - left.len());
            let found = "a damaged member".to_owned();
            let expected = "the header of a member and all of its data".to_owned();
            ParseError { place, found, expected }.in_file(file)
        })?;
        left = &left[member.header.len() + member.data.len()..];
        found.push(member);
    }
    Ok(found)
}

impl<'a> Member<'a> {
    fn first_of(bytes: &'a [u8]) -> Option<Self> {
        let layout = layout_of(bytes)?;
        let (header, rest) = bytes.split_at(layout.bytes);
        let digits = header[layout.size.clone()].iter().rev();
        let size = digits.fold(0_u64, |size, byte| size << 8 | u64::from(*byte));
        let data = rest.get(..usize::try_from(size).ok()?)?;
        Some(Self { layout, header, data })
    }

    fn stored_name(&self) -> String {
        let bytes = &self.header[self.layout.name..];
        let name = if self.layout.wide_name {
            UTF_16LE.decode_without_bom_handling(bytes).0.into_owned()
        } else {
            String::from_utf8_lossy(bytes).into_owned()
        };
        let name = name.split('\0').next().unwrap_or_default();
        name.rsplit(['/', '\\']).next().unwrap_or_default().to_owned()
    }

    fn is_compressed(&self) -> bool {
        self.stored_name().to_ascii_uppercase().ends_with(".LZW")
    }

    /// The name of the file, without a folder.
    pub(super) fn name(&self) -> String {
        let mut name = self.stored_name();
        if self.is_compressed() {
            name.truncate(name.len() - ".LZW".len());
        }
        name
    }

    /// True for a file of this kind, given in lower case.
    pub(super) fn has_extension(&self, extension: &str) -> bool {
        let name = self.name().to_ascii_lowercase();
        name.rsplit_once('.').is_some_and(|(_, found)| found == extension)
    }

    /// The bytes of the file; `archive` is the name of the archive in messages.
    ///
    /// # Errors
    /// Compressed data that are damaged, or that are longer than a lens file may be.
    pub(super) fn contents(&self, archive: &str) -> Result<Vec<u8>, FileError> {
        if !self.is_compressed() {
            return Ok(self.data.to_vec());
        }
        decompress(self.data, MAX_LENS_BYTES as usize).map_err(|found| {
            let expected = "data compressed by LZW, at most 64 MB when expanded".to_owned();
            ParseError { place: self.name(), found, expected }.in_file(archive)
        })
    }
}

/// Expands LZW codes. The word that a code adds is the expansion of the code before and the first byte of
/// its own, and these are neighbours in the output: so a word is stored as its place there.
fn decompress(data: &[u8], max: usize) -> Result<Vec<u8>, String> {
    let mut output: Vec<u8> = Vec::new();
    let mut starts: Vec<u32> = Vec::new();
    let mut bit = 0;
    loop {
        let words = 256 + starts.len().saturating_sub(1);
        let width = (usize::BITS - words.leading_zeros()) as usize;
        if bit + width > 8 * data.len() {
            return Ok(output);
        }
        let code = read_bits(data, bit, width);
        bit += width;
        let start = output.len();
        starts.push(start as u32);
        match code.checked_sub(256) {
            None => output.push(code as u8),
            Some(word) if word + 1 < starts.len() => {
                let (from, to) = (starts[word] as usize, starts[word + 1] as usize);
                // The last byte of the newest word is the first one of this very copy.
                (from..=to).for_each(|i| output.push(output[i]));
            }
            Some(_) => return Err(format!("the code {code} of {words} words")),
        }
        if output.len() > max {
            return Err(format!("more than {max} bytes"));
        }
    }
}

/// The number of `width` bits from a bit on, the most significant one first.
fn read_bits(data: &[u8], from: usize, width: usize) -> usize {
    (from..from + width)
        .fold(0, |value, i| value << 1 | usize::from(data[i / 8] >> (7 - i % 8) & 1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::{self, LensFormat};
    use std::collections::HashMap;

    /// Compresses by the definition: the longest known word, then one more byte.
    fn compress(text: &[u8]) -> Vec<u8> {
        let mut words: HashMap<Vec<u8>, usize> = (0..=255).map(|b| (vec![b], b as usize)).collect();
        let mut codes: Vec<(usize, usize)> = Vec::new();
        let mut word: Vec<u8> = Vec::new();
        // The reader knows one word less than the writer while it reads a code.
        let width = |emitted: usize| {
            (usize::BITS - (256 + emitted.saturating_sub(1)).leading_zeros()) as usize
        };
        for byte in text {
            let longer = [word.as_slice(), &[*byte]].concat();
            if words.contains_key(&longer) {
                word = longer;
                continue;
            }
            codes.push((words[&word], width(codes.len())));
            words.insert(longer, words.len());
            word = vec![*byte];
        }
        if !word.is_empty() {
            codes.push((words[&word], width(codes.len())));
        }
        let bits =
            codes.iter().flat_map(|(code, width)| (0..*width).rev().map(move |i| code >> i & 1));
        let bits: Vec<usize> = bits.collect();
        let byte =
            |bits: &[usize]| bits.iter().enumerate().map(|(i, b)| (*b as u8) << (7 - i)).sum();
        bits.chunks(8).map(byte).collect()
    }

    /// A member with a header of either layout.
    fn member(layout: &HeaderLayout, name: &str, data: &[u8]) -> Vec<u8> {
        let mut header = vec![0; layout.bytes];
        header[..2].copy_from_slice(&layout.signature);
        let size = (data.len() as u64).to_le_bytes();
        let length = layout.size.len();
        header[layout.size.clone()].copy_from_slice(&size[..length]);
        let wide = || name.encode_utf16().flat_map(u16::to_le_bytes).collect();
        let name: Vec<u8> = if layout.wide_name { wide() } else { name.as_bytes().to_vec() };
        header[layout.name..layout.name + name.len()].copy_from_slice(&name);
        header.extend_from_slice(data);
        header
    }

    fn archive(layout: &HeaderLayout) -> (Vec<u8>, Vec<u8>) {
        let lens = include_bytes!("../../tests/files/achromat.zmx").to_vec();
        let catalogue = b"CC test\nNM TEST 2 0 1.5 50 0\n".repeat(40);
        let parts = [
            member(layout, "C:\\Users\\x\\ACHROMAT.ZMX.LZW", &compress(&lens)),
            member(layout, "PART.CFG", b"\0\x01\x02"),
            member(layout, "TEST.AGF.LZW", &compress(&catalogue)),
        ];
        (parts.concat(), lens)
    }

    #[test]
    fn what_was_compressed_comes_back() {
        let mut noise = 1_u32;
        let mut random = || {
            noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (noise >> 24) as u8
        };
        let texts: [Vec<u8>; 5] = [
            Vec::new(),
            b"a".to_vec(),
            vec![b'a'; 5000],
            (0..70_000).map(|_| random()).collect(),
            b"CURV 0.01 0 0 0 0\r\n".repeat(900),
        ];
        for text in texts {
            assert_eq!(decompress(&compress(&text), 1 << 20), Ok(text));
        }
    }

    #[test]
    fn members_of_both_layouts_are_read() {
        for layout in &LAYOUTS {
            let (bytes, lens) = archive(layout);
            let members = members(&bytes, "a.zar").unwrap();
            let names: Vec<String> = members.iter().map(Member::name).collect();
            assert_eq!(names, ["ACHROMAT.ZMX", "PART.CFG", "TEST.AGF"]);
            assert!(members[0].has_extension("zmx") && !members[1].has_extension("zmx"));
            assert_eq!(members[0].contents("a.zar").unwrap(), lens);
            assert_eq!(members[1].contents("a.zar").unwrap(), b"\0\x01\x02");
        }
    }

    #[test]
    fn the_lens_of_an_archive_is_the_lens_of_its_file() {
        let (bytes, lens) = archive(&LAYOUTS[0]);
        let opened = files::parse(&bytes, "ACHROMAT.zar").unwrap();
        let alone = files::parse(&lens, "ACHROMAT.ZMX").unwrap();
        assert_eq!(opened.format, LensFormat::Archive);
        assert_eq!(opened.lens.surfaces, alone.lens.surfaces);
        let report = opened.report.unwrap();
        let row = report.rows.iter().find(|row| row.text == "TEST.AGF").unwrap();
        assert!(row.note.contains("aplanat glass --add"), "{}", row.note);
    }

    #[test]
    fn damaged_archives_are_refused_by_place() {
        let (bytes, _) = archive(&LAYOUTS[0]);
        let refusal = |bytes: &[u8]| files::parse(bytes, "a.zar").unwrap_err().to_string();
        assert!(refusal(&bytes[..bytes.len() - 9]).contains("a damaged member"));
        let no_lens = member(&LAYOUTS[0], "X.TXT", b"nothing");
        assert!(refusal(&no_lens).contains("no lens .zmx"));
        let bad = member(&LAYOUTS[0], "X.ZMX.LZW", &[0xFF; 40]);
        assert!(refusal(&bad).contains("X.ZMX: "), "{}", refusal(&bad));
        // An archive of 12 kB that expands to 50 MB is stopped at its bound.
        assert_eq!(
            decompress(&compress(&vec![7; 1 << 20]), 1 << 19).unwrap_err(),
            "more than 524288 bytes"
        );
    }

    #[test]
    fn no_damage_of_an_archive_is_a_panic() {
        let (bytes, _) = archive(&LAYOUTS[1]);
        for i in 0..2000_usize {
            let mut damaged = bytes.clone();
            let at = i.wrapping_mul(2_654_435_761) % damaged.len();
            damaged[at] ^= 1 << (i % 8);
            damaged.truncate(damaged.len() - i % 37);
            // The header of the first member is kept, so that it is taken for an archive.
            damaged[..2].copy_from_slice(&LAYOUTS[1].signature);
            if let Ok(opened) = files::parse(&damaged, "a.zar") {
                assert!(!opened.lens.surfaces.is_empty());
            }
        }
    }
}
