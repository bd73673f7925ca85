//! The library of published lenses: its index describes its lenses, a query finds them, and a lens
//! is written at another focal length.

use super::cli::{Scratch, done, done_json, refused};
use aplanat::files::{
    self, LibraryLens, LibraryQuery, StatedAperture, json, library_lenses, scale_to_focal_length,
};
use aplanat::lens::{Lens, Medium};
use aplanat::paraxial::{Beam, FirstOrder, first_order};
use std::collections::BTreeSet;

/// The index states three or four digits.
const STATED: f64 = 4e-3;

fn file_names(folder: &str) -> BTreeSet<String> {
    let names = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name());
    let names = names.map(|name| name.into_string().unwrap());
    names.filter_map(|name| name.strip_suffix(".json").map(str::to_owned)).collect()
}

fn text_of(name: &str) -> String {
    let more = format!("lenses/more/{name}.json");
    std::fs::read_to_string(&more)
        .or_else(|_| std::fs::read_to_string(format!("lenses/{name}.json")))
        .unwrap()
}

#[test]
fn the_library_is_the_files_of_both_folders() {
    let [bundled, more] = ["lenses", "lenses/more"].map(file_names);
    assert!(bundled.is_disjoint(&more));
    let names: Vec<&str> = library_lenses().iter().map(|lens| lens.name.as_str()).collect();
    let listed: BTreeSet<String> = names.iter().map(|name| (*name).to_owned()).collect();
    assert_eq!(listed, bundled.union(&more).cloned().collect());
    assert_eq!((listed.len(), bundled.len(), more.len()), (names.len(), 24, 164));
    for entry in library_lenses() {
        let text = entry.text().unwrap();
        assert_eq!(text, text_of(&entry.name), "{}: build again", entry.name);
        assert_eq!(json::write(&entry.open().unwrap()), text, "{}: not as written", entry.name);
    }
}

fn data(lens: &Lens, zoom: usize) -> FirstOrder<f64> {
    let system = lens.resolve(zoom, lens.wavelengths[lens.primary()].um).unwrap();
    first_order(&system, &Beam::for_lens(lens, zoom)).unwrap()
}

/// The media other than air, of which a stop inside an element makes no second one.
fn elements(lens: &Lens) -> usize {
    let mut count = 0;
    let mut before = &lens.object_medium;
    for row in lens.surfaces.iter().filter(|row| row.medium != Medium::Mirror) {
        count += usize::from(row.medium != Medium::Air && row.medium != *before);
        before = &row.medium;
    }
    count
}

fn is_near(found: f64, stated: f64) -> bool {
    (found / stated - 1.0).abs() < STATED
}

#[test]
fn the_index_describes_the_lenses() {
    for entry in library_lenses() {
        let lens = entry.open().unwrap();
        let LibraryLens { name, title, focal_length, .. } = entry;
        assert_eq!(*title, lens.name, "{name}");
        let last = lens.zoom_positions() - 1;
        let ends = [data(&lens, 0), data(&lens, last)];
        for (data, stated) in ends.iter().zip([focal_length[0], *focal_length.last().unwrap()]) {
            assert!(is_near(data.efl.unwrap().abs(), stated), "{name}: {:?}", data.efl);
        }
        if let StatedAperture::FNumber(stated) = &entry.aperture {
            let found = ends.each_ref().map(|data| data.f_number.unwrap());
            assert!(is_near(found[0], stated[0]), "{name}: f/{found:?}");
            assert!(is_near(found[1], *stated.last().unwrap()), "{name}: f/{found:?}");
        }
        let mirrors = lens.surfaces.iter().filter(|row| row.medium == Medium::Mirror).count();
        let aspheres =
            lens.surfaces.iter().filter(|row| row.conic != 0.0 || !row.asphere.is_empty());
        // Light crosses the two elements of the relay there and back.
        let counted = if name == "relay_dyson_1959" { 2 } else { elements(&lens) };
        assert_eq!(
            (counted, mirrors, aspheres.count()),
            (entry.elements, entry.mirrors, entry.aspheres),
            "{name}"
        );
    }
}

fn found(words: &[&str]) -> Vec<&'static str> {
    let query = LibraryQuery::new(words.iter().copied()).unwrap();
    query.find().into_iter().map(|lens| lens.name.as_str()).collect()
}

#[test]
fn lenses_are_found_by_words_and_ranges() {
    assert_eq!(found(&[]).len(), 188);
    assert_eq!(
        found(&["HEXAR"]),
        ["compact_konica_hexar_35_f2"],
        "a word of the title, in any case"
    );
    assert_eq!(found(&["2,031,792", "example 2"]), ["historical_topogon_79_f125"]);
    assert_eq!(found(&["tessar_50_f28"]), ["tessar_50_f28"], "the name alone, not others with it");
    let fast = found(&["double gauss", "f=..1"]);
    assert_eq!(fast.len(), 3);
    assert!(fast.contains(&"double_gauss_voigtlander_nokton_60_f095"), "{fast:?}");
    assert!(found(&["zoom", "mm=50"]).contains(&"zoom_tamron_28_75_f28"), "within its range");
    assert!(found(&["aspheres=5..", "elements=5"]).contains(&"phone_us6744570_2"));
    assert!(found(&["field=90..", "mirrors=1.."]).is_empty());
    let heights: Vec<&str> = found(&["microscope", "field=0.."]);
    assert!(!heights.contains(&"microscope_us5000548_1"), "its source states a height");
    let refused = |word: &str| LibraryQuery::new([word]).unwrap_err().to_string();
    assert!(refused("efl=3").contains("`efl`; expected mm, f"));
    for word in ["f=", "f=2..1", "f=a", "f=NaN"] {
        assert!(refused(word).contains("range"), "{word}");
    }
}

#[test]
fn a_lens_is_scaled_to_a_focal_length() {
    for (name, mm) in [
        ("telescope_hubble_f24", 100.0),
        ("relay_dyson_1959", 10.0),
        ("zoom_tamron_28_75_f28", 50.0),
    ] {
        let entry = library_lenses().iter().find(|lens| lens.name == name).unwrap();
        let lens = entry.open().unwrap();
        let scaled = scale_to_focal_length(&lens, mm).unwrap();
        let [before, after] = [&lens, &scaled].map(|lens| data(lens, 0));
        let factor = mm / before.efl.unwrap().abs();
        assert!((after.efl.unwrap() / before.efl.unwrap() / factor - 1.0).abs() < 1e-12, "{name}");
        let [was, is] = [before, after].map(|data| data.working_f_number.unwrap());
        assert!((is / was - 1.0).abs() < 1e-12, "{name}: {was} {is}");
        assert!(
            scaled.notes.ends_with(&format!("to a focal length of {mm} mm.")),
            "{}",
            scaled.notes
        );
        for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(scale_to_focal_length(&lens, wrong).is_err());
        }
    }
}

#[test]
fn the_command_lists_and_writes() {
    let all = done_json(&["library"], "");
    assert_eq!(all.as_array().unwrap().len(), 188);
    assert_eq!(all[0]["type"], "singlet");
    let listed = done(&["library", "tessar", "f=2.8"], "");
    assert!(listed.contains("US 2,838,978") && listed.ends_with("lenses\n"), "{listed}");
    for file in ["library.json", "library.zmx"] {
        let out = Scratch::new(file);
        let name = "tessar_canon_50_f28";
        let report =
            done_json(&["library", name, "--out", out.path(), "--focal-length", "100"], "");
        assert_eq!(
            (&report["written"]["name"], &report["out"]),
            (&name.into(), &out.path().into())
        );
        let written = files::open(&out.0).unwrap().lens;
        assert!((data(&written, 0).efl.unwrap() / 100.0 - 1.0).abs() < 1e-9);
    }
    refused(2, &["library", "no such lens"], "", &["no lens for `no such lens`"]);
    let out = Scratch::new("none.json");
    let several = ["library", "tessar", "--out", out.path()];
    refused(2, &several, "", &["lenses for `tessar`", "expected the name of one"]);
    let wrong = ["library", "tessar_50_f28", "--out", out.path(), "--focal-length", "0"];
    refused(2, &wrong, "", &["--focal-length: found the focal length 0; expected"]);
    refused(2, &["library", "x=1"], "", &["`x`; expected mm"]);
    refused(2, &["library", "--out", out.path()], "", &["WORD"]);
    assert!(!out.0.exists());
}
