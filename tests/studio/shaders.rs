//! Every shader in the source is valid for an ordinary graphics card.

use std::fs;
use std::path::{Path, PathBuf};

use naga::valid::{Capabilities, ValidationFlags, Validator};

fn shaders(dir: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(dir).unwrap().map(|entry| entry.unwrap().path());
    let (dirs, files): (Vec<_>, Vec<_>) = entries.partition(|path| path.is_dir());
    let mut found: Vec<_> =
        files.into_iter().filter(|f| f.extension().is_some_and(|e| e == "wgsl")).collect();
    found.extend(dirs.iter().flat_map(|dir| shaders(dir)));
    found
}

#[test]
fn every_shader_is_valid() {
    let found = shaders(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"));
    assert!(found.len() >= 3, "the search for shaders lost some: {found:?}");
    for path in found {
        let text = fs::read_to_string(&path).unwrap();
        let module = naga::front::wgsl::parse_str(&text)
            .unwrap_or_else(|e| panic!("{}: {}", path.display(), e.emit_to_string(&text)));
        Validator::new(ValidationFlags::all(), Capabilities::default())
            .validate(&module)
            .unwrap_or_else(|e| panic!("{}: {}", path.display(), e.emit_to_string(&text)));
    }
}
