//! Ten thousand damaged files: none causes a panic, and each gives a lens or a message.

use super::{FOREIGN, ROUNDED, foreign};
use aplanat::files::{self, json, zemax};

/// The number of files, unless the environment variable `APLANAT_SPOILED_FILES` gives another one.
const FILES: usize = 10_000;

/// A generator of 64 random bits (Steele and others, `SplitMix64`, 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let a = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let b = (a ^ (a >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        b ^ (b >> 31)
    }

    fn below(&mut self, end: usize) -> usize {
        usize::try_from(self.next() % end.max(1) as u64).unwrap()
    }
}

/// The contents of damaged and hostile files.
const WORDS: [&str; 24] = [
    "NaN",
    "1e308",
    "-1",
    "0",
    "1e-320",
    "99999999999999999999",
    "INFINITY",
    "\"",
    "{",
    "]",
    ",",
    "\r\n",
    "SURF 0",
    "STOP",
    "MNUM 3 1",
    "THIC 1 2 5",
    "GLAS MIRROR",
    "TYPE EVENASPH",
    "PARM 1 1",
    "null",
    "true",
    "\"radius\": 0",
    "1e99",
    "\u{1F52D}",
];

/// The bytes with one to four things wrong.
fn spoiled(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..=random.below(4) {
        let at = random.below(bytes.len() + 1);
        let end = (at + random.below(40)).min(bytes.len());
        match random.below(7) {
            0 => bytes.truncate(at),
            1 => drop(bytes.drain(at..end)),
            2 => drop(bytes.splice(at..end, WORDS[random.below(WORDS.len())].bytes())),
            3 => {
                let part = bytes[at..end].to_vec();
                let to = random.below(bytes.len() + 1);
                drop(bytes.splice(to..to, part));
            }
            4 => drop(bytes.splice(at..at, [random.next() as u8])),
            _ if at < bytes.len() => bytes[at] ^= 1 << random.below(8),
            _ => {}
        }
    }
    bytes
}

/// Each library lens in JSON, in Zemax in 8 bits and in UTF-16, and the foreign files.
fn seeds() -> Vec<Vec<u8>> {
    let mut seeds: Vec<Vec<u8>> =
        FOREIGN.iter().chain(&ROUNDED).map(|name| foreign(name)).collect();
    for bundled in files::bundled_lenses() {
        let lens = json::read(bundled.text, bundled.name).unwrap();
        let (text, _) = zemax::write(&lens).unwrap();
        seeds.push(bundled.text.as_bytes().to_vec());
        seeds.push(text.encode_utf16().flat_map(u16::to_le_bytes).collect());
        seeds.push(text.into_bytes());
    }
    seeds
}

#[test]
fn no_damaged_file_causes_a_panic() {
    let seeds = seeds();
    let mut random = Random(2);
    let (mut lenses, mut messages) = (0, 0);
    let files = std::env::var("APLANAT_SPOILED_FILES").ok().and_then(|count| count.parse().ok());
    let files: usize = files.unwrap_or(FILES);
    for i in 0..files {
        let bytes = spoiled(&seeds[i % seeds.len()], &mut random);
        let name = ["a.json", "a.zmx", "a.seq", "a.roa", "a.len", "a"][random.below(6)];
        match files::parse(&bytes, name) {
            Ok(opened) => {
                lenses += 1;
                assert!(opened.lens.check().is_ok());
                let text = json::write(&opened.lens);
                assert_eq!(json::read(&text, "a.json").unwrap(), opened.lens);
            }
            Err(error) => {
                messages += 1;
                assert!(error.to_string().starts_with(name), "{error}");
            }
        }
    }
    println!("{files} spoiled files: {lenses} lenses, {messages} messages");
    assert!(lenses > files / 20 && messages > files / 4);
}
