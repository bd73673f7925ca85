//! Tolerances as operands of a `.zmx` file, written and read.

use super::foreign;
use aplanat::files::{self, ConversionOutcome, ConversionReport};
use aplanat::lens::{
    AdjustedPart, Compensator, ErrorCorrelation, ErrorDistribution, Lens, Perturbation,
    PerturbationKind, Tolerance, ToleranceSheet,
};

fn achromat() -> String {
    String::from_utf8(foreign("achromat.zmx")).unwrap()
}

/// The achromat with lines in place of its only tolerance operand, and the report of the lines.
fn with_operands(lines: &[&str]) -> (Lens, Vec<(ConversionOutcome, String)>) {
    let text = achromat().replace("TOL TOFF 0 0 0 0 0 0 0", &lines.join("\r\n"));
    let opened = files::parse(text.as_bytes(), "a.zmx").unwrap();
    let report = opened.report.unwrap();
    let told = report.rows.into_iter().filter(|row| row.keyword == "TOL");
    (opened.lens, told.map(|row| (row.outcome, row.note)).collect())
}

fn tolerance(kind: PerturbationKind, [first, last]: [usize; 2], half_range: f64) -> Tolerance {
    let error = Perturbation { kind, first, last };
    Tolerance { error, half_range, distribution: ErrorDistribution::NormalCut }
}

/// Saved and opened again, with the text of the file and the report of the export.
fn round_trip(lens: &Lens, name: &str) -> (Lens, String, ConversionReport) {
    let path = super::folder(name).join("lens.zmx");
    let report = files::save(lens, &path).unwrap().report.unwrap();
    let text = files::decode_unicode(&std::fs::read(&path).unwrap(), "lens.zmx").unwrap();
    (files::open(&path).unwrap().lens, text, report)
}

fn assert_same(found: &ToleranceSheet, expected: &ToleranceSheet) {
    assert_eq!(found.errors.len(), expected.errors.len());
    for (found, expected) in found.errors.iter().zip(&expected.errors) {
        assert_eq!((found.error, found.distribution), (expected.error, expected.distribution));
        let apart = (found.half_range / expected.half_range - 1.0).abs();
        assert!(apart < 1e-12, "{found:?} {expected:?}");
    }
    assert_eq!(found.compensators, expected.compensators);
    assert_eq!(found.focus_travel, expected.focus_travel);
}

#[test]
fn tolerances_come_back_from_a_file() {
    use PerturbationKind as Kind;
    let mut lens = files::parse(achromat().as_bytes(), "a.zmx").unwrap().lens;
    assert_eq!(lens.tolerances, None);
    lens.surfaces[0].asphere = vec![1e-7];
    let of = |kind| tolerance(kind, [0, 0], 2e-3);
    let body = |kind| tolerance(kind, [0, 2], 1e-3);
    let mut errors: Vec<Tolerance> = [
        Kind::Curvature,
        Kind::Conic,
        Kind::Asphere,
        Kind::Irregularity,
        Kind::Thickness,
        Kind::ThicknessAdjusted,
        Kind::Index,
        Kind::Abbe,
        Kind::SurfaceDecenterX,
        Kind::SurfaceDecenterY,
        Kind::SurfaceTiltX,
        Kind::SurfaceTiltY,
    ]
    .map(of)
    .into();
    errors.extend([Kind::ElementDecenterX, Kind::ElementDecenterY, Kind::ElementTiltX].map(body));
    errors[2].distribution = ErrorDistribution::Uniform;
    errors[3].distribution = ErrorDistribution::Parabolic;
    let travel = 0.5;
    let part = AdjustedPart::Lens(Perturbation::of_surface(Kind::Thickness, 1));
    let compensators = vec![Compensator { part, travel }];
    let sheet = ToleranceSheet {
        focus_travel: Some(2.0),
        compensators,
        ..ToleranceSheet::of_errors(errors)
    };
    lens.tolerances = Some(sheet.clone());
    let (back, text, report) = round_trip(&lens, "zemax-tolerances");
    assert_same(back.tolerances.as_ref().unwrap(), &sheet);
    for line in ["TOL TCUR   1   0 -0.002 0.002", "TOL TTHI   1   1 ", "TOL TTHI   1   2 "] {
        assert!(text.contains(line), "{line}: {text}");
    }
    assert!(text.find("TOL ").unwrap() < text.find("MNUM").unwrap_or(text.len()));
    let losses = report.rows_with(ConversionOutcome::Dropped);
    assert_eq!(losses.filter(|row| row.text.contains("tolerance")).count(), 0);
}

#[test]
fn what_no_operand_says_is_named() {
    use PerturbationKind as Kind;
    let mut lens = files::parse(achromat().as_bytes(), "a.zmx").unwrap().lens;
    let mut errors = vec![
        tolerance(Kind::ElementRollX, [0, 2], 1e-3),
        tolerance(Kind::Asphere, [0, 0], 1e-7),
        tolerance(Kind::Abbe, [2, 2], 0.01),
        tolerance(Kind::Conic, [0, 0], 0.1),
    ];
    errors[3].distribution = ErrorDistribution::Ends;
    let correlations = vec![ErrorCorrelation { errors: vec![0, 3], coefficient: 0.5 }];
    lens.tolerances = Some(ToleranceSheet { correlations, ..ToleranceSheet::of_errors(errors) });
    let (back, _, report) = round_trip(&lens, "zemax-lost-tolerances");
    assert_eq!(back.tolerances.unwrap().errors.len(), 1);
    let told: Vec<String> =
        report.rows.iter().map(|row| format!("{}: {}", row.text, row.note)).collect();
    for text in [
        "element roll x, surfaces 1 to 3: no operand",
        "asphere r^4, surfaces 1 to 1: the surface has no aspheric",
        "Abbe number, surfaces 3 to 3: the gap has no Abbe number",
        "correlations of tolerances",
        "errors at their bounds are parabolic there",
    ] {
        assert!(told.iter().any(|row| row.contains(text)), "{text}: {told:#?}");
    }
}

#[test]
fn operands_of_other_programs_are_read() {
    let (lens, told) = with_operands(&[
        "TOL TOFF   0   0 0 0   0 0 0 0 0",
        "TOL TWAV   0   0 5.461E-01 0   0 0 0 0 0",
        "TOL COMP   3   0 -1.5 1.5   0 0 0 0 0",
        "TOL TRAD   1   0 -0.2 0.2   0 0 0 0 0",
        "TOL TFRN   2   0 -3 3   0 0 0 0 0",
        "TOL TTHI   1   1 -0.05 0.03   0 0 0 0 0",
        "TOL TABB   1   0 -0.5598 0.5598   0 0 0 0 0",
        "TOL TEDX   1   3 -0.02 0.02   0 0 0 0 0",
        "TOL TMCO   1   0 -0.02 0.02   0 0 0 0 0",
        "TOL TCON   9   0 -0.02 0.02   0 0 0 0 0",
        "TOL TSTX   1   0 nan",
        "TOL",
    ]);
    let outcomes: Vec<ConversionOutcome> = told.iter().map(|(outcome, _)| *outcome).collect();
    let (used, kept) = (ConversionOutcome::Used, ConversionOutcome::Preserved);
    let approximated = ConversionOutcome::Approximated;
    let expected = [kept, used, used, used, used, approximated, used, used, kept, kept, kept, kept];
    assert_eq!(outcomes, expected);
    let sheet = lens.tolerances.unwrap();
    assert_eq!(sheet.focus_travel, Some(1.5));
    let half: Vec<f64> = sheet.errors.iter().map(|own| own.half_range).collect();
    let radius = 1.0 / lens.surfaces[0].curvature;
    // A radius longer by 0.2 mm, and three fringes of half a wavelength of sag at a rim of 8.6 mm.
    let sag = 3.0 * 0.5 * 546.1e-6;
    let curvatures = [1.0 / radius - 1.0 / (radius + 0.2), 2.0 * sag / (8.6 * 8.6)];
    assert!((half[0] / curvatures[0] - 1.0).abs() < 0.01, "{half:?}");
    assert!((half[1] / curvatures[1] - 1.0).abs() < 1e-9, "{half:?} {curvatures:?}");
    assert_eq!(half[2], 0.05);
    assert!((half[3] - 0.01).abs() < 1e-4, "{half:?}");
    assert_eq!(half[4], 0.02);
}
