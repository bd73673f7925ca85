//! Vignetting factors of foreign files, on planes in air whose beams are known in closed form.

use aplanat::files::{
    self, ConversionOutcome, ConversionReport, ImportSettings, OpenedLens, VignettingChoice,
};

/// A pupil of 10 mm, 10 mm behind the first and in front of the third plane.
const SEQUENCE: &str = "RDM;LEN\nEPD 10\nDIM M\nWL 587.5618\nYAN 0 20\nVUY 0 0.4\nVLY 0 0.5\n\
    VUX 0 0.9\nVLX 0 0.9\nSO 0 1E14\nS 0 10\nS 0 10\n  STO\nS 0 10\nSI 0 0\nGO\n";

/// The same: displacement 0.05, reductions 0.9 and 0.45.
const ZEMAX: &str = "VERS 240130\nMODE SEQ\nUNIT MM\nENPD 10\nFTYP 0 0 2 1\nXFLN 0 0\nYFLN 0 20\n\
    VDXN 0 0\nVDYN 0 0.05\nVCXN 0 0.9\nVCYN 0 0.45\nWAVM 1 0.5875618 1\nPWAV 1\n\
    SURF 0\n  CURV 0\n  DISZ INFINITY\n\
    SURF 1\n  CURV 0\n  DISZ 10\n  DIAM 20 1\n\
    SURF 2\n  STOP\n  CURV 0\n  DISZ 10\n  DIAM 5 0\n\
    SURF 3\n  CURV 0\n  DISZ 10\n  CLAP 0 6\n  DIAM 6 1\n\
    SURF 4\n  CURV 0\n  DISZ 0\n";

fn read(text: &str, name: &str, vignetting: VignettingChoice) -> OpenedLens {
    files::parse_with(text.as_bytes(), name, ImportSettings { vignetting }).unwrap()
}

fn rims(opened: &OpenedLens) -> Vec<Option<f64>> {
    opened.lens.surfaces.iter().map(|row| row.semi_diameter).collect()
}

fn note<'a>(report: &'a ConversionReport, text: &str) -> (ConversionOutcome, &'a str) {
    let row = report.rows.iter().find(|row| row.text.starts_with(text)).unwrap();
    (row.outcome, &row.note)
}

/// The lowest ray of the oblique beam, at -(1 - VLY) of the pupil, is the outermost one in front of the stop,
/// the uppermost one, at 1 - VUY, behind it.
fn expected() -> [f64; 3] {
    let shift = 10.0 * 20_f64.to_radians().tan();
    [shift + 5.0 * 0.5, 5.0, shift + 5.0 * 0.6]
}

fn assert_near(found: Option<f64>, expected: f64) {
    let found = found.unwrap();
    assert!(found >= expected && found < expected * (1.0 + 3e-6), "{found} {expected}");
}

#[test]
fn factors_make_surfaces_as_wide_as_their_beams() {
    let opened = read(SEQUENCE, "a.seq", VignettingChoice::Factors);
    assert_eq!(opened.vignetting, Some(VignettingChoice::Factors));
    for (found, expected) in rims(&opened).into_iter().zip(expected()) {
        assert_near(found, expected);
    }
    let report = opened.report.unwrap();
    for line in ["VUX", "VLX", "VUY", "VLY"] {
        assert_eq!(note(&report, line).0, ConversionOutcome::Approximated);
    }
    // An ellipse of semi-axes 0.1 and 0.55.
    let (outcome, text) = note(&report, "vignetting of field 2");
    let inside: f64 = text.split(' ').next().unwrap().parse().unwrap();
    assert_eq!(outcome, ConversionOutcome::Approximated);
    assert!((inside - 5.5).abs() < 0.3, "{text}");
    assert!(report.rows.iter().all(|row| row.text != "vignetting of field 1"));
}

#[test]
fn apertures_of_the_file_clip_beside_its_factors() {
    let opened = read(ZEMAX, "a.zmx", VignettingChoice::Factors);
    let [first, stop, third] = rims(&opened)[..] else { panic!() };
    let [front, pupil, _] = expected();
    // The drawn semi-diameter of 20 mm clips nothing in the file.
    assert_near(first, front);
    assert_near(stop, pupil);
    assert_eq!(third, Some(6.0));
    let report = opened.report.unwrap();
    assert_eq!(note(&report, "semi-diameter of surface 3").0, ConversionOutcome::Used);
    // The automatic semi-diameter of the stop.
    let [stated] = &opened.stated[..] else { panic!("{:?}", opened.stated) };
    assert_eq!((stated.what.as_str(), stated.file_mm), ("semi-diameter of surface 2", 5.0));
    assert!((stated.found_mm.unwrap() - 5.0).abs() < 1e-12);
}

#[test]
fn without_the_choice_factors_are_left_out_and_the_report_says_so() {
    for (text, name, line) in [(SEQUENCE, "a.seq", "VUY"), (ZEMAX, "a.zmx", "VCYN")] {
        let opened = read(text, name, VignettingChoice::Rims);
        assert_eq!(opened.lens, files::parse(text.as_bytes(), name).unwrap().lens);
        let report = opened.report.as_ref().unwrap();
        let (outcome, why) = note(report, line);
        assert_eq!(outcome, ConversionOutcome::Dropped);
        assert!(why.contains("left out"), "{why}");
    }
    assert_eq!(rims(&read(SEQUENCE, "a.seq", VignettingChoice::Rims)), [None; 3]);
}

#[test]
fn factors_that_leave_no_pupil_are_left_out() {
    let none = SEQUENCE.replace("VUY 0 0.4", "VUY 0 1.6");
    let opened = read(&none, "a.seq", VignettingChoice::Factors);
    assert_eq!(rims(&opened), [None; 3]);
    assert_eq!(note(&opened.report.unwrap(), "VUY").0, ConversionOutcome::Dropped);
    let zero = SEQUENCE.replace("0.4", "0").replace("0.5\n", "0\n").replace("0.9", "0");
    assert_eq!(read(&zero, "a.seq", VignettingChoice::Factors).vignetting, None);
}

/// The factors of each position set the rims together: the widest beam of all needs them.
#[test]
fn factors_of_zoom_positions_are_read() {
    let zoomed = SEQUENCE.replace("GO\n", "ZOO 2\nZOO VUY F2 0.4 0.1\nZOO VLY F1 0 0\nGO\n");
    let table = "MNUM 2 1\nFVCY 2 1 0.45 0 0 0 1 1 1 0 0 \"\" 0\nFVCY 2 2 0.3 0 0 0 1 1 1 0 0 \"\" 0\n\
        FVDY 2 1 0.05 0 0 0 1 1 1 0 0 \"\" 0\nFVDY 2 2 0.2 0 0 0 1 1 1 0 0 \"\" 0\n";
    let [front, pupil, _] = expected();
    // The upper edge of the second position is at 0.9.
    let behind = 10.0 * 20_f64.to_radians().tan() + 5.0 * 0.9;
    for (text, name, line) in
        [(zoomed, "a.seq", "ZOO VUY"), (format!("{ZEMAX}{table}"), "a.zmx", "FVCY 2 2")]
    {
        let opened = read(&text, name, VignettingChoice::Factors);
        assert_eq!(opened.lens.zoom_positions(), 2);
        let [first, stop, third] = rims(&opened)[..] else { panic!() };
        assert_near(first, front);
        assert_near(stop, pupil);
        if name == "a.seq" {
            assert_near(third, behind);
        }
        let report = opened.report.unwrap();
        assert_eq!(note(&report, line).0, ConversionOutcome::Approximated);
        for position in [1, 2] {
            let row = format!("vignetting of field 2 at zoom position {position}");
            assert!(note(&report, &row).1.contains("by the factors"));
        }
        let left_out = read(&text, name, VignettingChoice::Rims).report.unwrap();
        assert_eq!(note(&left_out, line).0, ConversionOutcome::Dropped);
    }
}
