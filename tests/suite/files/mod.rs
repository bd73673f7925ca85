//! Files of every kind: reading, refusal with a message, and lossless round trips.

mod bad_input;
mod codev;
mod mutations;
mod old_files;
mod optiland;
mod oslo;
mod ray_optics;
mod round_trip;
mod vignetting;
mod volume;
mod writers;
mod zemax;
mod zemax_tolerances;

use std::path::PathBuf;

/// A folder of its own for each test, empty.
fn folder(test: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("aplanat-{}-{test}", std::process::id()));
    std::fs::remove_dir_all(&folder).ok();
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// The bytes of one of our own foreign files.
fn foreign(name: &str) -> Vec<u8> {
    std::fs::read(format!("tests/files/{name}")).unwrap()
}

/// The foreign files in `tests/files`.
const FOREIGN: [&str; 3] = ["achromat.zmx", "schmidt_old_spelling.zmx", "zoom_utf16.zmx"];

/// Files whose numbers a round trip changes by rounding: tilts, radii, wavelengths in nanometres.
const ROUNDED: [&str; 6] = [
    "folded_singlet.zmx",
    "unknown_parts.zmx",
    "tilted.seq",
    "doublet.roa",
    "triplet.len",
    "singlet.optiland.json",
];
