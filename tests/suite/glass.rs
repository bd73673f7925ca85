//! Glass catalogues of makers: every dispersion formula, damaged files, and lenses that name their glasses.

use aplanat::files::{AgfCatalogue, parse_agf, read_agf, write_agf};
use aplanat::lens::glass::{self, GlassStatus};
use serde_json::Value;
use std::path::PathBuf;
use std::process::Command;

/// The catalogue of a text.
fn parsed(text: &str) -> AgfCatalogue {
    parse_agf(text.as_bytes(), "MAKER", "maker.agf").unwrap()
}

fn glass_of(formula: u32, coefficients: &str) -> String {
    format!(
        "NM G{formula} {formula} 517642 - - 0 1 -\nED 7.1 8.3 2.51 -0.0009 0\nCD {coefficients}\nLD 0.4 0.8\n"
    )
}

#[test]
fn every_formula_has_the_index_of_its_definition() {
    let um: f64 = 0.55;
    let l2 = um * um;
    let power = |p: i32| um.powi(p);
    let sellmeier = |terms: &[(f64, f64)]| {
        (1.0 + terms.iter().map(|(k, l)| k * l2 / (l2 - l)).sum::<f64>()).sqrt()
    };
    let l = 1.0 / (l2 - 0.028);
    let cases: [(u32, &str, f64); 13] = [
        (
            1,
            "2.3 -0.01 0.01 1E-4 1E-5 1E-6",
            (2.3 - 0.01 * l2
                + 0.01 * power(-2)
                + 1e-4 * power(-4)
                + 1e-5 * power(-6)
                + 1e-6 * power(-8))
            .sqrt(),
        ),
        (2, "1.0 0.006 0.2 0.02 1.0 100", sellmeier(&[(1.0, 0.006), (0.2, 0.02), (1.0, 100.0)])),
        (
            3,
            "1.5 0.01 0.001 -0.01 0.001 -1E-4",
            1.5 + 0.01 * l + 0.001 * l * l - 0.01 * l2 + 0.001 * l2 * l2 - 1e-4 * l2 * l2 * l2,
        ),
        (4, "0.2 1.0 0.1 0.02 0.2", (1.2 + l2 / (l2 - 0.01) + 0.02 / (l2 - 0.04)).sqrt()),
        (5, "1.5 0.01 0.001", 1.5 + 0.01 / um + 0.001 / um.powf(3.5)),
        (
            6,
            "1.0 0.006 0.2 0.02 1.0 100 0.1 0.01",
            sellmeier(&[(1.0, 0.006), (0.2, 0.02), (1.0, 100.0), (0.1, 0.01)]),
        ),
        (7, "2.5 0.03 0.02 0.01", (2.5 + 0.03 / (l2 - 0.02) - 0.01 * l2).sqrt()),
        (8, "1.5 1.0 0.01 0.01", (1.5 + l2 / (l2 - 0.01) - 0.01 * l2).sqrt()),
        (9, "1.5 1.0 0.01 0.02 100", (1.5 + l2 / (l2 - 0.01) + 0.02 * l2 / (l2 - 100.0)).sqrt()),
        (
            10,
            "2.3 -0.01 0.01 1E-4 1E-5 1E-6 1E-7 1E-8",
            (2.3 - 0.01 * l2
                + 0.01 * power(-2)
                + 1e-4 * power(-4)
                + 1e-5 * power(-6)
                + 1e-6 * power(-8)
                + 1e-7 * power(-10)
                + 1e-8 * power(-12))
            .sqrt(),
        ),
        (
            11,
            "1.0 0.006 0.2 0.02 1.0 100 0.1 0.01 0.05 0.001",
            sellmeier(&[(1.0, 0.006), (0.2, 0.02), (1.0, 100.0), (0.1, 0.01), (0.05, 0.001)]),
        ),
        (
            12,
            "2.3 -0.01 0.01 1E-4 1E-5 1E-6 1E-3 1E-4",
            (2.3 - 0.01 * l2
                + 0.01 * power(-2)
                + 1e-4 * power(-4)
                + 1e-5 * power(-6)
                + 1e-6 * power(-8)
                + 1e-3 * power(4)
                + 1e-4 * power(6))
            .sqrt(),
        ),
        (
            13,
            "2.3 -0.01 1E-3 0.01 1E-4 1E-5 1E-6 1E-7 1E-8",
            (2.3 - 0.01 * l2
                + 1e-3 * power(4)
                + 0.01 * power(-2)
                + 1e-4 * power(-4)
                + 1e-5 * power(-6)
                + 1e-6 * power(-8)
                + 1e-7 * power(-10)
                + 1e-8 * power(-12))
            .sqrt(),
        ),
    ];
    let text: String = cases.iter().map(|(formula, c, _)| glass_of(*formula, c)).collect();
    let catalogue = parsed(&text);
    assert_eq!((catalogue.glasses.len(), catalogue.refused.len()), (13, 0));
    for ((formula, _, expected), entry) in cases.iter().zip(&catalogue.glasses) {
        let found = entry.index(um).unwrap();
        assert!((found - expected).abs() < 1e-13, "formula {formula}: {found}, {expected}");
        assert!(entry.index(0.39).is_none() && entry.index(0.81).is_none());
        let status = entry.properties().unwrap().status;
        assert_eq!((entry.density, status), (Some(2.51), Some(GlassStatus::Preferred)));
    }
}

/// The data sheet of SCHOTT N-BK7: coefficients, and indices at five lines.
const BK7: &str = "CC a comment\nNM N-BK7 2 517642 1.5168 64.17 0 1 -\nGC comment\n\
    ED 7.1 8.3 2.51 -0.0009 0\n\
    CD 1.03961212 0.00600069867 0.231792344 0.0200179144 1.01046945 103.560653\n\
    TD 1.86E-06 1.31E-08 -1.37E-11 4.34E-07 6.27E-10 0.17 20\nOD 1.0 2.0 0.0 1.0 2.3 2.3\n\
    LD 0.3 2.5\nIT 0.4 0.997 10\nIT 0.5 0.998 10\n";

#[test]
fn a_glass_has_everything_that_its_maker_says() {
    let catalogue = parsed(BK7);
    let entry = &catalogue.glasses[0];
    for (um, index) in [(0.4861327, 1.52238), (0.5875618, 1.51680), (0.6562725, 1.51432)] {
        assert!((entry.index(um).unwrap() - index).abs() < 5e-6);
    }
    assert!((entry.vd - 64.17).abs() < 0.005);
    let known = entry.properties().unwrap();
    assert_eq!((known.expansion, known.relative_cost), (Some(7.1), Some(1.0)));
    let thermal = known.thermal.unwrap();
    assert_eq!((thermal.coefficients[0], thermal.celsius), (1.86e-6, 20.0));
    assert_eq!(known.resistance, [2.0, 0.0, 1.0, 2.3, 2.3].map(Some));
    assert_eq!(known.transmission, [[0.4, 0.997, 10.0], [0.5, 0.998, 10.0]]);
}

#[test]
fn a_constant_index_has_no_abbe_number_and_infrared_materials_keep_that_of_the_file() {
    let constant = parsed("NM FLAT 1 0 1.5 60 0 0 -\nCD 2.25\nLD 0.3 2\n");
    assert_eq!((constant.glasses[0].nd, constant.glasses[0].vd), (1.5, 0.0));
    let infrared =
        parsed("NM GE 1 0 4.0 100.5 0 0 -\nCD 16.0 0 0.5\nLD 2 14\nNM X 1 0 - -\nCD 9\nLD 2 9\n");
    let numbers = infrared.glasses.iter().map(|entry| (entry.nd, entry.vd));
    assert_eq!(numbers.collect::<Vec<_>>(), [(4.0, 100.5), (3.0, 0.0)]);
}

/// The coefficients of HIKARI J-FK5 as some files write them, on three lines.
const WRAPPED: &str = "NM J-FK5 13 1 1.487490 70.318793 0 0 1\nED 8.9 0 2.45 2.7E-3 0 0\n\
    CD 2.188268550E+000 -9.190447240E-003 -1.116210710E-004 9.263728150E-003 \n\
    7.349007330E-005 4.197242420E-006 -1.154122030E-007 0.000000000E+000 \n\
    0.000000000E+000 0.000000000E+000\nLD 3.65015000E-001 2.05809000E+000\n";

#[test]
fn records_go_on_in_lines_that_begin_with_a_number() {
    let catalogue = parsed(WRAPPED);
    let glass = &catalogue.glasses[0];
    assert!((glass.nd - 1.48749).abs() < 5e-6 && (glass.vd - 70.3188).abs() < 1e-3);
    assert!(catalogue.contradictory.is_empty());
}

#[test]
fn a_formula_that_contradicts_its_file_is_named() {
    let catalogue = parsed("NM GLUE 2 0 1.54356 40.95 0 1 -\nCD 1.3237 0 1.47E-02 0\nLD 0.38 1\n");
    let (name, text) = &catalogue.contradictory[0];
    assert!(name == "GLUE" && text.contains("1.54356") && text.contains("1.52918"), "{text}");
    assert_eq!(catalogue.glasses.len(), 1);
}

#[test]
fn glasses_that_nobody_can_use_are_refused_by_name() {
    let text = format!(
        "{BK7}{}{}{}NM EMPTY 2\n{BK7}NM\n",
        glass_of(99, "1 2"),
        glass_of(1, "-5"),
        "NM NORANGE 5 0 1.5 60 0 0 -\nCD 1.5\n"
    );
    let catalogue = parsed(&text);
    assert_eq!(catalogue.glasses.len(), 1);
    let reason = |name: &str| {
        let found = catalogue.refused.iter().find(|(refused, _)| refused == name);
        found.map_or_else(|| panic!("{name}: {:?}", catalogue.refused), |(_, why)| why.clone())
    };
    assert!(reason("G99").contains("formula 99"));
    assert!(reason("G1").contains("no index"));
    assert!(reason("NORANGE").contains("LD"));
    assert!(reason("N-BK7").contains("second"));
    for bytes in [&b""[..], b"hello", b"\x89PNG\r\n\x1a\n\0\0\0\0", &[0, 1, 2, 3, 4, 5]] {
        assert!(parse_agf(bytes, "M", "m.agf").is_err());
    }
}

#[test]
fn damaged_catalogues_do_not_panic() {
    let mut seed = 12345_u64;
    let mut next = |below: usize| {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (seed >> 33) as usize % below
    };
    let original = format!("{BK7}{}", glass_of(13, "2 1 1 1")).into_bytes();
    for _ in 0..20_000 {
        let mut bytes = original.clone();
        for _ in 0..=next(4) {
            let at = next(bytes.len());
            match next(3) {
                0 => bytes[at] = next(256) as u8,
                1 => drop(bytes.remove(at)),
                _ => bytes.insert(at, b"0-E.\n 9"[next(7)]),
            }
        }
        if let Ok(catalogue) = parse_agf(&bytes, "M", "m.agf") {
            for entry in catalogue.glasses {
                let [low, high] = entry.range_um;
                assert!([low, high].map(|um| entry.index(um)).iter().all(Option::is_some));
            }
        }
    }
}

#[test]
fn a_hundred_thousand_glasses_are_read_in_time() {
    let text: String = (0..100_000).map(|i| BK7.replace("N-BK7", &format!("X{i}"))).collect();
    assert_eq!(parsed(&text).glasses.len(), 100_000);
    let utf16: Vec<u8> =
        std::iter::once(0xFEFF_u16).chain(BK7.encode_utf16()).flat_map(u16::to_le_bytes).collect();
    assert_eq!(parse_agf(&utf16, "M", "m.agf").unwrap().glasses.len(), 1);
}

#[test]
fn a_catalogue_is_added_and_its_glass_found_in_a_lens() {
    let scratch = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("glass");
    drop(std::fs::remove_dir_all(&scratch));
    std::fs::create_dir_all(&scratch).unwrap();
    let folder = scratch.join("catalogues");
    let run = |words: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_aplanat"));
        let output = command.args(words).env("APLANAT_GLASSES", &folder).output().unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        (output.status.code(), text(output.stdout), text(output.stderr))
    };
    let file = scratch.join("mine.agf");
    std::fs::write(&file, BK7.replace("N-BK7", "SPECIAL-1")).unwrap();
    let lens = scratch.join("lens.json");
    let text_of_lens = std::fs::read_to_string("lenses/singlet_la1131.json").unwrap();
    std::fs::write(&lens, text_of_lens.replace("SCHOTT N-BK7", "MINE SPECIAL-1")).unwrap();
    let (file, lens) = (file.to_str().unwrap(), lens.to_str().unwrap());
    let (status, _, errors) = run(&["info", lens]);
    assert!(status == Some(2) && errors.contains("unknown glass `MINE SPECIAL-1`"), "{errors}");
    let (status, text, errors) = run(&["glass", "--add", file, "--json"]);
    let added: Value = serde_json::from_str(&text).unwrap();
    assert!(status == Some(0) && added["glasses"][0]["name"] == "SPECIAL-1", "{errors}");
    let (status, text, _) = run(&["info", lens, "--json"]);
    let own: Value = serde_json::from_str(&text).unwrap();
    let bundled = run(&["info", "lenses/singlet_la1131.json", "--json"]).1;
    let bundled: Value = serde_json::from_str(&bundled).unwrap();
    assert_eq!((status, &own["efl"]), (Some(0), &bundled["efl"]));
    let (_, text, _) = run(&["glass", "mine", "nd=1.5..1.6"]);
    assert!(text.contains("SPECIAL-1") && text.contains("1 glass"), "{text}");
    // A catalogue that has a glass of the program changes neither lenses nor exports.
    let misc = scratch.join("misc.agf");
    std::fs::write(&misc, BK7.replace("N-BK7", "CAF2")).unwrap();
    assert_eq!(run(&["glass", "--add", misc.to_str().unwrap()]).0, Some(0));
    let own = scratch.join("caf2.json");
    std::fs::write(&own, text_of_lens.replace("SCHOTT N-BK7", "CRYSTAL CAF2")).unwrap();
    let zmx = scratch.join("caf2.zmx");
    let (status, _, errors) = run(&["convert", own.to_str().unwrap(), zmx.to_str().unwrap()]);
    assert_eq!(status, Some(0), "{errors}");
    assert!(run(&["glass", "--remove", "mine"]).1.contains("removed"));
    assert!(run(&["glass", "--remove", "misc"]).1.contains("removed"));
    assert_eq!(run(&["info", lens]).0, Some(2));
    let (status, _, errors) = run(&["glass", "--remove", "mine"]);
    assert!(status == Some(2) && errors.contains("there is none"), "{errors}");
    for (words, expected) in [
        (vec!["glass", "nothing-like-it"], "found no glass"),
        (vec!["glass", "nd=high"], "expected `1.6..1.7`"),
        (vec!["glass", "weight=1"], "expected nd, vd, price, density, status or lead"),
        (vec!["glass", "--nearest", "0.2", "50"], "found nd 0.2 and vd 50"),
        (vec!["glass", "--nearest", "1.5", "nan"], "found nd 1.5 and vd NaN"),
        (vec!["glass", "--add", lens], "expected a glass catalogue"),
    ] {
        let (status, _, errors) = run(&words);
        assert!(status == Some(2) && errors.contains(expected), "{words:?}: {errors}");
    }
}

/// Melts stand in a catalogue of their own, one beside the other, and lenses name them.
#[test]
fn melts_are_added_one_by_one() {
    let folder = std::env::temp_dir().join(format!("aplanat-melts-{}", std::process::id()));
    let run = |words: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_aplanat"));
        let output = command.args(words).env("APLANAT_GLASSES", &folder).output().unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        (output.status.code(), text(output.stdout), text(output.stderr))
    };
    let melt = |glass: &str, name: &str, indices: &[&str]| {
        let mut words = vec!["glass", "--json", "--melt", glass, "--name", name];
        indices.iter().for_each(|index| words.extend(["--index", index]));
        run(&words)
    };
    let (code, json, errors) =
        melt("SCHOTT N-BK7", "BK7-1", &["0.5875618=1.51672", "0.4861327=1.52229"]);
    assert_eq!(code, Some(0), "{errors}");
    let added: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(added["name"], "MELT BK7-1");
    assert!((added["nd"].as_f64().unwrap() - 1.51672).abs() < 1e-9, "{json}");
    assert!(added["worst_index"].as_f64().unwrap() < 1e-9, "{json}");
    assert_eq!(melt("CDGM H-K9L", "K9L-2", &["0.5875618=1.51690"]).0, Some(0));
    // One of the same name is replaced.
    assert_eq!(melt("SCHOTT N-BK7", "BK7-1", &["0.5875618=1.51661"]).0, Some(0));
    let (_, json, _) = run(&["glass", "--json", "MELT", "status=melt"]);
    let listed: Vec<Value> = serde_json::from_str(&json).unwrap();
    assert_eq!(listed.len(), 2, "{json}");
    let of = |name: &str| listed.iter().find(|glass| glass["name"] == name).unwrap();
    assert!((of("BK7-1")["nd"].as_f64().unwrap() - 1.51661).abs() < 1e-9);
    // What is known of the glass is kept.
    assert_eq!(of("BK7-1")["expansion"], 7.1);
    assert_eq!(of("K9L-2")["maker"], "MELT");
    for (glass, name, index, expected) in [
        ("SCHOTT N-BK7", "A", "0.5875618=1.6", "expected a melt within 0.01"),
        ("SCHOTT N-BK7", "A", "0.01=1.5", "has no index at 0.01 um"),
        ("SCHOTT N-BK7", "A", "1.5", "expected a wavelength in um"),
        ("NO-SUCH", "A", "0.5=1.5", "found no glass `NO-SUCH`"),
        ("SCHOTT N-BK7", "A B", "0.5875618=1.5168", "expected letters and digits"),
    ] {
        let (code, _, errors) = melt(glass, name, &[index]);
        assert!(code == Some(2) && errors.contains(expected), "{index}: {errors}");
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

/// The glasses that stand for a model glass, by the distance that the program states.
#[test]
fn the_nearest_glasses_are_listed_in_their_order() {
    let list = |words: &[&str]| -> Vec<Value> {
        let mut command = Command::new(env!("CARGO_BIN_EXE_aplanat"));
        command.args(["glass", "--nearest", "1.6204", "36.4", "--json"]).args(words);
        let output = command.env("APLANAT_GLASSES", "nowhere").output().unwrap();
        serde_json::from_slice(&output.stdout).unwrap()
    };
    let distance = |glass: &Value| {
        let [nd, vd] = ["nd", "vd"].map(|key| glass[key].as_f64().unwrap());
        ((nd - 1.6204) / 1e-3).hypot((vd - 36.4) / 0.5)
    };
    let all = list(&[]);
    assert!(all.len() == 10 && all.is_sorted_by_key(&distance));
    let far = list(&["schott", "vd=60.."]);
    assert!(far.is_sorted_by_key(&distance) && far.iter().all(|glass| glass["maker"] == "SCHOTT"));
    assert!(distance(&far[0]) > distance(&all[9]));
}

/// A member of an archive of Zemax in its first layout, not compressed.
fn archive_member(name: &str, data: &[u8]) -> Vec<u8> {
    let mut header = vec![0; 0x14C];
    header[..2].copy_from_slice(&[0xEA, 0x00]);
    header[0x0C..0x10].copy_from_slice(&(data.len() as u32).to_le_bytes());
    header[0x20..0x20 + name.len()].copy_from_slice(name.as_bytes());
    [header, data.to_vec()].concat()
}

#[test]
fn materials_and_the_catalogues_of_an_archive_are_added_and_removed() {
    let scratch = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("glass_kinds");
    drop(std::fs::remove_dir_all(&scratch));
    std::fs::create_dir_all(scratch.join("mymaker")).unwrap();
    let folder = scratch.join("catalogues");
    let run = |words: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_aplanat"));
        let output = command.args(words).env("APLANAT_GLASSES", &folder).output().unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        (output.status.code(), text(output.stdout), text(output.stderr))
    };
    let material = |name: &str, text: &str| {
        let path = scratch.join("mymaker").join(name);
        std::fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let text = "DATA:\n  - type: formula 5\n    wavelength_range: 0.35 2.5\n    coefficients: 1.5 0.004 -2\n";
    let (a, b) = (material("A-1.yml", text), material("B-2.yml", text));
    let table =
        material("T.yml", "DATA:\n  - type: tabulated nk\n    data: |\n        0.4 1.5 0\n");
    for file in [&a, &b] {
        assert_eq!(run(&["glass", "--add", file]).0, Some(0));
    }
    // The second one did not replace the first, in the folder and in the program.
    let (_, listed, _) = run(&["glass", "mymaker"]);
    assert!(
        listed.contains("A-1") && listed.contains("B-2") && listed.contains("2 glasses"),
        "{listed}"
    );
    let (status, _, errors) = run(&["glass", "--add", &table]);
    assert!(status == Some(2) && errors.contains("expected a material with a formula"), "{errors}");
    let zmx = std::fs::read("tests/files/achromat.zmx").unwrap();
    let archive = [
        archive_member("ACHROMAT.ZMX", &zmx),
        archive_member("MINE.AGF", BK7.replace("N-BK7", "SPECIAL-1").as_bytes()),
    ];
    let zar = scratch.join("achromat.zar");
    std::fs::write(&zar, archive.concat()).unwrap();
    let zar = zar.to_str().unwrap();
    let (status, text, errors) = run(&["glass", "--add", zar, "--json"]);
    let added: Value = serde_json::from_str(&text).unwrap();
    assert_eq!((status, &added["glasses"][0]["name"]), (Some(0), &"SPECIAL-1".into()), "{errors}");
    let focal_length = |file: &str| {
        let info: Value = serde_json::from_str(&run(&["info", file, "--json"]).1).unwrap();
        info["efl"].clone()
    };
    assert_eq!(focal_length(zar), focal_length("tests/files/achromat.zmx"));
    for name in ["mymaker", "mine"] {
        assert!(run(&["glass", "--remove", name]).1.contains("removed"));
    }
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 0);
}

/// Every formula of the catalogues that come with the program is one of those of `.agf`.
#[test]
fn glasses_are_written_as_a_catalogue_and_read_back_with_their_indices() {
    let folder = std::env::temp_dir().join(format!("aplanat-agf-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("OWN.agf");
    let all: Vec<_> = glass::known().collect();
    let export = write_agf(all.iter().copied(), &path).unwrap();
    assert_eq!(export.glasses + export.refused.len(), all.len());
    let second = |(_, why): &(String, String)| why.starts_with("a second glass of the name");
    assert!(export.refused.iter().all(second), "{:?}", export.refused);
    assert!(export.glasses > 1000 && export.worst_index <= 1e-12, "{export:?}");
    let read = read_agf(&path).unwrap();
    assert_eq!((read.glasses.len(), read.refused.len()), (export.glasses, 0));
    assert!(read.contradictory.is_empty(), "{:?}", read.contradictory);
    let schott = read.glasses.iter().find(|own| own.name == "N-BK7").unwrap();
    let own = glass::find("SCHOTT N-BK7").unwrap();
    assert_eq!((schott.range_um, schott.density), (own.range_um, own.density));
    assert_eq!(schott.manufacturer, "OWN");
    // Schott's datasheet.
    assert!((schott.nd - 1.51680).abs() < 5e-6 && (schott.vd - 64.17).abs() < 5e-3);
    assert!(write_agf([], &path).is_err());
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn a_catalogue_is_written_by_the_command_line() {
    let folder = std::env::temp_dir().join(format!("aplanat-agf-cli-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("PICK.agf");
    let run = |out: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_aplanat"));
        command.args(["glass", "schott", "nd=1.7..", "--out", out, "--json"]).output().unwrap()
    };
    let output = run(path.to_str().unwrap());
    assert!(output.status.success(), "{output:?}");
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let read = read_agf(&path).unwrap();
    assert_eq!(report["glasses"], read.glasses.len());
    assert!(read.glasses.len() > 10 && read.glasses.iter().all(|own| own.nd >= 1.7));
    let wrong = run(folder.join("PICK.txt").to_str().unwrap());
    assert_eq!(wrong.status.code(), Some(2));
    std::fs::remove_dir_all(folder).unwrap();
}

/// The price of the program's glasses is a class until a person or a maker says otherwise, and the twins
/// of a glass that is named are listed.
#[test]
fn glasses_are_chosen_by_their_price_and_twins_are_listed() {
    let folder = std::env::temp_dir().join(format!("aplanat-prices-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let run = |words: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_aplanat"));
        let output = command.args(words).env("APLANAT_GLASSES", &folder).output().unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        (output.status.code(), text(output.stdout), text(output.stderr))
    };
    let listed = |words: &[&str]| -> Vec<Value> {
        let (code, json, errors) = run(&[&["glass", "--json"], words].concat());
        assert_eq!(code, Some(0), "{errors}");
        serde_json::from_str(&json).unwrap()
    };
    let cheap = listed(&["price=..3", "schott"]);
    assert!(cheap.len() > 30, "{}", cheap.len());
    for glass in &cheap {
        assert!(glass["relative_cost"].as_f64().unwrap() <= 3.0, "{glass}");
        assert_eq!(glass["cost_source"], "estimated");
    }
    let price = |name: &str| {
        let found = listed(&["schott", name]);
        let own = found.iter().find(|glass| glass["name"] == *name).unwrap();
        (own["relative_cost"].as_f64().unwrap(), own["cost_source"].as_str().unwrap().to_owned())
    };
    assert_eq!(price("N-BK7"), (1.0, "estimated".to_owned()));
    std::fs::write(folder.join("prices.csv"), "# mine\nSCHOTT N-BK7,1.25\nschott f2, 2.5\n")
        .unwrap();
    assert_eq!(price("N-BK7"), (1.25, "person".to_owned()));
    assert_eq!(price("F2"), (2.5, "person".to_owned()));
    // The maker knows better.
    let catalogue = folder.join("own").with_file_name("SCHOTT.agf");
    std::fs::write(&catalogue, BK7).unwrap();
    let (relative, source) = price("N-BK7");
    assert_eq!(source, "maker", "{relative}");
    std::fs::write(folder.join("prices.csv"), "SCHOTT N-BK7,cheap\n").unwrap();
    let (code, text, errors) = run(&["glass", "N-BK7"]);
    assert!(code == Some(0) && errors.contains("prices.csv, line 1"), "{errors}");
    assert!(text.contains("twins of SCHOTT N-BK7") && text.contains("HOYA BSC7"), "{text}");
    let twins = listed(&["schott", "N-BK7"])[0]["twins"].clone();
    assert!(twins.as_array().unwrap().iter().any(|twin| twin == "CDGM H-K9L"), "{twins}");
    assert!(!run(&["glass", "schott", "nd=1.5..1.6"]).1.contains("twins of"));
    std::fs::remove_dir_all(&folder).unwrap();
}
