//! Every user error ends in a message with file, place, found and expected, and no file is lost.

use super::folder;
use aplanat::files::{self, FileError, json};
use aplanat::lens::{Aperture, Lens};
use std::fs;

fn double_gauss() -> Lens {
    json::read(files::bundled_lenses()[0].text, "a.json").unwrap()
}

fn refusal(bytes: &[u8], name: &str) -> String {
    files::parse(bytes, name).unwrap_err().to_string()
}

#[test]
fn a_missing_file_is_named() {
    let error = files::open("no/such/lens.json").unwrap_err();
    assert!(matches!(error, FileError::Unreadable { .. }));
    assert!(error.to_string().starts_with("no/such/lens.json: cannot be read: "), "{error}");
    assert!(files::open(std::env::temp_dir()).is_err());
}

#[test]
fn files_that_are_not_lenses_are_identified() {
    let picture = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x01\0\0\0\x01\x08\x02\0\0\0\x90wS\xDE";
    let text = refusal(picture, "scan.zmx");
    assert!(text.starts_with("scan.zmx: found a PNG picture; expected a lens"), "{text}");
    let jpeg = [&b"\xFF\xD8\xFF\xE0\0\x10JFIF\0\x01\x01"[..], &[0; 90]].concat();
    assert!(refusal(&jpeg, "scan.zmx").contains("a JPEG picture"));
    assert!(refusal(b"", "a.json").contains("an empty file"));
    assert!(refusal(b"", "a.zmx").contains("an empty file"));
    assert!(
        refusal(b"Dear Ernst, the lens is ready.", "letter.txt")
            .contains("text that is not a lens")
    );
    assert!(refusal(b"Dear Ernst, the lens is ready.", "letter.zmx").contains("no SURF line"));
    assert!(
        refusal(b"{\"name\": \"K\xF6hler\"}", "a.json").contains("line 1: found the byte 0xf6")
    );
}

#[test]
fn a_native_file_truncated_anywhere_is_refused() {
    let text = files::bundled_lenses()[0].text.trim_end();
    for end in (1..text.len()).step_by(7) {
        let message = refusal(&text.as_bytes()[..end], "a.json");
        assert!(message.starts_with("a.json, line ") && message.contains("expected"), "{message}");
    }
}

/// Makes a good lens a bad one.
type Spoil = fn(&mut Lens);

#[test]
fn invalid_lenses_are_refused_on_reading_and_writing() {
    let folder = folder("senseless");
    let wrong: [(&str, Spoil); 9] = [
        ("the lens has no surfaces", |lens| lens.surfaces.clear()),
        ("no surface is the stop", |lens| lens.surfaces[5].stop = false),
        ("surfaces 3 and 6 are both the stop", |lens| lens.surfaces[2].stop = true),
        ("semi-diameter of surface 4 is -1", |lens| lens.surfaces[3].semi_diameter = Some(-1.0)),
        ("obstruction of surface 4 is -1", |lens| lens.surfaces[3].obstruction = Some(-1.0)),
        ("obstruction of surface 4 is inf", |lens| {
            lens.surfaces[3].obstruction = Some(f64::INFINITY);
        }),
        ("obstruction of surface 4 is 99; expected zero or more and less than", |lens| {
            lens.surfaces[3].obstruction = Some(99.0);
        }),
        ("curvature of surface 1 is NaN", |lens| lens.surfaces[0].curvature = f64::NAN),
        ("f-number is inf", |lens| lens.aperture = Aperture::FNumber(f64::INFINITY)),
    ];
    for (expected, spoil) in wrong {
        let mut lens = double_gauss();
        lens.variables.clear();
        spoil(&mut lens);
        for name in ["a.json", "a.zmx"] {
            let error = files::save(&lens, folder.join(name)).unwrap_err().to_string();
            assert!(error.contains(name) && error.contains(expected), "{error}");
            assert!(!folder.join(name).exists());
        }
        let read = json::read(&json::write(&lens), "a.json");
        assert!(read.is_err(), "{expected}");
    }
    fs::remove_dir_all(folder).unwrap();
}

#[test]
fn a_failed_write_leaves_the_existing_file() {
    let folder = folder("unwritable");
    let lens = double_gauss();
    let error = files::save(&lens, folder.join("no/such/folder/a.json")).unwrap_err();
    assert!(error.to_string().contains("cannot be written"), "{error}");
    let error = files::save(&lens, folder.join("a.doc")).unwrap_err().to_string();
    assert!(
        error.contains(
            "found the extension `doc`; expected `.json`, `.zmx`, `.seq`, `.len` or `.roa`"
        ),
        "{error}"
    );

    let occupied = folder.join("folder.json");
    fs::create_dir(&occupied).unwrap();
    let error = files::save(&lens, &occupied).unwrap_err().to_string();
    assert!(error.contains("it is a folder"), "{error}");

    let old = folder.join("old.json");
    fs::write(&old, "old").unwrap();
    let mut permissions = fs::metadata(&old).unwrap().permissions();
    permissions.set_readonly(true);
    fs::set_permissions(&old, permissions).unwrap();
    let error = files::save(&lens, &old).unwrap_err().to_string();
    assert!(error.contains("it is read-only") && error.contains("no file was changed"), "{error}");
    assert_eq!(fs::read_to_string(&old).unwrap(), "old");

    let names: Vec<_> = fs::read_dir(&folder).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(names.len(), 2, "something was left beside the targets: {names:?}");
    fs::remove_dir_all(folder).unwrap();
}

#[test]
fn saving_replaces_the_file_and_leaves_nothing_beside_it() {
    let folder = folder("replace");
    let target = folder.join("a.json");
    fs::write(&target, "old").unwrap();
    let lens = double_gauss();
    files::save(&lens, &target).unwrap();
    assert_eq!(files::open(&target).unwrap().lens, lens);
    assert_eq!(fs::read_dir(&folder).unwrap().count(), 1);
    fs::remove_dir_all(folder).unwrap();
}

#[cfg(unix)]
#[test]
fn saving_through_a_link_keeps_the_link() {
    let folder = folder("link");
    fs::write(folder.join("real.json"), "old").unwrap();
    std::os::unix::fs::symlink("real.json", folder.join("link.json")).unwrap();
    files::save(&double_gauss(), folder.join("link.json")).unwrap();
    assert!(fs::symlink_metadata(folder.join("link.json")).unwrap().is_symlink());
    assert!(files::open(folder.join("real.json")).is_ok());
    fs::remove_dir_all(folder).unwrap();
}
