//! The meaning of a Zemax file, keyword by keyword, on files written for the tests.

use super::foreign;
use aplanat::files::{self, ConversionOutcome, ConversionReport, FileError, OpenedLens};
use aplanat::lens::{
    Aperture, ApertureShape, Edit, FieldKind, FreeformKind, GradientIndex, Lens, Medium, Object,
    Parameter, Pickup, ProfileLaw, Quantity, SurfaceAperture, Variable, apply_edit,
};
use aplanat::math::Vec3;
use aplanat::trace::{Fate, Ray, Tracer};

fn achromat() -> String {
    String::from_utf8(foreign("achromat.zmx")).unwrap()
}

fn open(bytes: &[u8]) -> Result<OpenedLens, FileError> {
    files::parse(bytes, "folder/a.zmx")
}

fn lens(text: &str) -> Lens {
    open(text.as_bytes()).unwrap_or_else(|error| panic!("{error}")).lens
}

/// The achromat with something replaced.
fn changed(from: &str, to: &str) -> Result<OpenedLens, FileError> {
    let text = achromat();
    assert!(text.contains(from), "{from}");
    open(text.replacen(from, to, 1).as_bytes())
}

fn refusal(from: &str, to: &str) -> String {
    changed(from, to).unwrap_err().to_string()
}

fn outcome<'a>(report: &'a ConversionReport, text: &str) -> (ConversionOutcome, &'a str) {
    let row = report.rows.iter().find(|row| row.text.starts_with(text)).unwrap();
    (row.outcome, &row.note)
}

#[test]
fn every_encoding_and_line_end_gives_the_same_lens() {
    let text = achromat().replace("front crown", "Vorderlinse für \u{f8} 16");
    let expected = lens(&text);
    assert_eq!(expected.surfaces[0].comment, "Vorderlinse für ø 16");
    let utf16 = |mark: bool, bytes: fn(u16) -> [u8; 2]| -> Vec<u8> {
        let start = mark.then_some(0xFEFF);
        start.into_iter().chain(text.encode_utf16()).flat_map(bytes).collect()
    };
    let latin: Vec<u8> = text.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
    let spellings = [
        utf16(true, u16::to_le_bytes),
        utf16(false, u16::to_le_bytes),
        utf16(true, u16::to_be_bytes),
        utf16(false, u16::to_be_bytes),
        [b"\xEF\xBB\xBF", text.as_bytes()].concat(),
        latin,
        text.replace("\r\n", "\n").into_bytes(),
        text.replace("\r\n", "\r").into_bytes(),
        text.replace("\r\n  ", "\r\n").into_bytes(), // indentation is cosmetic
    ];
    for (i, bytes) in spellings.iter().enumerate() {
        assert_eq!(open(bytes).unwrap().lens, expected, "spelling {i}");
    }
}

#[test]
fn the_achromat_is_what_its_file_says() {
    let opened = open(achromat().as_bytes()).unwrap();
    let lens = &opened.lens;
    assert_eq!(lens.name, "Achromat f80");
    assert_eq!(lens.notes, "Cemented, own numbers.");
    assert_eq!(lens.source, "Imported from a.zmx");
    assert_eq!(lens.object, Object::Infinity);
    assert_eq!(lens.aperture, Aperture::EntrancePupilDiameter(16.0));
    let angles: Vec<f64> = lens.fields.values.iter().map(|field| field.y).collect();
    assert_eq!(angles, [0.0, 1.5, 2.5]);
    assert_eq!(lens.fields.values[2].weight, 2.0);
    assert_eq!(lens.wavelengths.len(), 3);
    assert_eq!(lens.primary(), 1);
    assert_eq!(lens.stop(), Some(0));
    let [first, second, third] = &lens.surfaces[..] else { panic!("three surfaces") };
    assert_eq!(first.medium, Medium::Glass("SCHOTT N-BAK4".to_owned()));
    assert_eq!((first.curvature, first.thickness), (2.0491803278688523e-2, 5.5));
    assert_eq!((first.semi_diameter, second.semi_diameter), (Some(8.6), Some(8.6)));
    assert_eq!(third.semi_diameter, None); // found automatically there
    let curvature = |surface| Parameter::new(surface, Quantity::Curvature);
    let thickness = Parameter::new(0, Quantity::Thickness);
    let free = |parameter| Variable { parameter, min: None, max: None };
    let bounded = Variable { parameter: thickness, min: Some(2.0), max: Some(9.0) };
    let expected = [free(curvature(0)), bounded, free(curvature(1)), free(curvature(2))];
    assert_eq!(lens.variables, expected);
    assert_eq!(lens.image_solve, Some(0.0));
    let check = &opened.checks[0];
    assert!((check.efl.unwrap() - 80.5879).abs() < 1e-4, "{check}");
    assert!((check.bfl.unwrap() - 76.4807).abs() < 1e-4, "{check}");
    assert_eq!(Some(third.thickness), check.bfl);
}

#[test]
fn the_import_report_covers_every_line() {
    let text = achromat();
    let report = open(text.as_bytes()).unwrap().report.unwrap();
    assert_eq!(report.rows.len(), text.lines().count());
    assert_eq!(outcome(&report, "ENPD").0, ConversionOutcome::Used);
    assert_eq!(outcome(&report, "COFN").0, ConversionOutcome::Preserved);
    assert_eq!(outcome(&report, "EFFL").0, ConversionOutcome::Preserved);
    assert_eq!(outcome(&report, "VCYN").0, ConversionOutcome::Dropped);
    assert_eq!(outcome(&report, "WAVM 3").0, ConversionOutcome::Used);
    assert_eq!(outcome(&report, "WAVM 4").0, ConversionOutcome::Preserved); // padding
    let fixed: Vec<_> =
        report.rows.iter().filter(|row| row.text.starts_with("DIAM 8.6 1")).collect();
    assert_eq!(fixed[0].outcome, ConversionOutcome::Used); // beside an aperture that clips
    assert_eq!(fixed[1].outcome, ConversionOutcome::Approximated);
    let json = serde_json::to_value(&report).unwrap();
    assert_eq!(json["rows"][6]["outcome"], "used");
    assert_eq!(json["rows"][6]["line"], 7);
    assert_eq!(json["rows"][6]["keyword"], "ENPD");
    let first = report.to_string().lines().nth(1).unwrap().to_owned();
    assert!(first.starts_with("dropped") && first.contains("VCYN"), "{first}");
}

#[test]
fn old_spellings_inches_and_commas_are_read() {
    let opened = open(&foreign("schmidt_old_spelling.zmx")).unwrap();
    let lens = opened.lens;
    assert_eq!(lens.object, Object::Infinity); // 1e10 there
    assert_eq!(lens.aperture, Aperture::EntrancePupilDiameter(4.0 * 25.4));
    let fields: Vec<(f64, f64)> = lens.fields.values.iter().map(|f| (f.y, f.weight)).collect();
    assert_eq!(fields, [(0.0, 1.0), (1.0, 2.0)]);
    let waves: Vec<(f64, f64)> = lens.wavelengths.iter().map(|w| (w.um, w.weight)).collect();
    assert_eq!(waves, [(0.4861327, 1.0), (0.5875618, 3.0)]);
    let plate = &lens.surfaces[0];
    // z = α r² is a paraboloid of curvature 2 α.
    assert_eq!((plate.curvature, plate.conic), (5e-3 / 25.4, -1.0));
    assert!((plate.asphere[0] / (-3.1e-4 / 25.4_f64.powi(3)) - 1.0).abs() < 1e-15);
    assert!((plate.asphere[1] / (1e-6 / 25.4_f64.powi(5)) - 1.0).abs() < 1e-15);
    assert_eq!(plate.thickness, 0.25 * 25.4);
    assert_eq!(plate.medium, Medium::Glass("SCHOTT N-BK7".to_owned()));
    let mirror = &lens.surfaces[2];
    assert_eq!((&mirror.medium, mirror.conic), (&Medium::Mirror, -0.5));
    assert_eq!(mirror.thickness, -7.5 * 25.4);
    let report = opened.report.unwrap();
    assert_eq!(outcome(&report, "GLAS BK7").1, "SCHOTT N-BK7 in place of BK7");
    assert!(outcome(&report, "PARM 1").1.contains("paraboloid"));
}

#[test]
fn configurations_solves_and_pickups_are_read() {
    let opened = open(&foreign("zoom_utf16.zmx")).unwrap();
    let lens = opened.lens;
    let report = opened.report.unwrap();
    assert_eq!(lens.zoom.len(), 3);
    let gaps: Vec<f64> = (0..3).map(|zoom| lens.thickness_at(1, zoom).unwrap()).collect();
    assert_eq!(gaps, [30.0, 12.5, 1.25]);
    assert_eq!(lens.aperture, Aperture::StopSemiDiameter(6.0));
    assert_eq!(lens.aperture_at(1), Aperture::StopSemiDiameter(5.5));
    assert_eq!(lens.fields_at(2).values[1].y, 5.0);
    assert_eq!(lens.surfaces[2].semi_diameter, Some(6.5));
    // The coordinate breaks cancel.
    assert_eq!(lens.surfaces.len(), 6);
    assert!(lens.surfaces.iter().all(|row| row.pose().is_none() && row.axis().is_none()));
    assert_eq!(outcome(&report, "TYPE COORDBRK").0, ConversionOutcome::Used);
    let glass = Medium::Model { nd: 1.62, vd: 60.3 };
    assert_eq!((&lens.surfaces[2].medium, &lens.surfaces[4].medium), (&glass, &glass));
    let pickup = |to, from, quantity, scale| Pickup {
        parameter: Parameter::new(to, quantity),
        source: Parameter::new(from, quantity),
        scale,
        offset: 0.0,
    };
    let expected = [
        pickup(1, 0, Quantity::Curvature, -1.0),
        pickup(3, 2, Quantity::Curvature, -1.0),
        pickup(4, 2, Quantity::Thickness, 1.0),
    ];
    assert_eq!(lens.pickups, expected);
    let free = |surface, quantity| lens.variable(Parameter::new(surface, quantity)).is_some();
    let gap = |zoom| Parameter::at_zoom(1, Quantity::Thickness, zoom);
    assert!((0..3).all(|zoom| lens.variable(gap(zoom)).is_some()));
    assert!(free(2, Quantity::Curvature) && free(2, Quantity::Index));
    assert_eq!(lens.image_solve, Some(0.0));
    assert_eq!(outcome(&report, "TEMP").0, ConversionOutcome::Dropped);
    assert_eq!(opened.checks.len(), 3);
    assert_eq!(Some(lens.surfaces[5].thickness), opened.checks[0].bfl);
}

#[test]
fn every_kind_of_aperture_field_and_object_is_read() {
    let finite = achromat().replace("DISZ INFINITY", "DISZ 200");
    let with = |from: &str, to: &str| lens(&finite.replacen(from, to, 1));
    assert_eq!(with("ENPD 16.0", "OBNA 0.05 0").aperture, Aperture::ObjectNa(0.05));
    let cone = with("ENPD 16.0", "OBNA 3 1").aperture;
    assert_eq!(cone, Aperture::ObjectNa(3.0_f64.to_radians().sin()));
    assert_eq!(with("ENPD 16.0", "FNUM 5.0 1").aperture, Aperture::FNumber(5.0));
    // The f-number for an object at infinity is that of the pupil.
    let Aperture::EntrancePupilDiameter(pupil) = with("ENPD 16.0", "FNUM 5.0 0").aperture else {
        panic!("a pupil diameter");
    };
    assert!((pupil - 80.5879 / 5.0).abs() < 1e-4);
    assert_eq!(with("ENPD 16.0", "FLOA").aperture, Aperture::StopSemiDiameter(8.6));
    for (kind, expected) in [
        (0, FieldKind::Angle),
        (1, FieldKind::ObjectHeight),
        (2, FieldKind::ImageHeight),
        (3, FieldKind::ImageHeight),
        (4, FieldKind::Angle),
    ] {
        let lens = with("FTYP 0 0 3", &format!("FTYP {kind} 0 3"));
        assert_eq!(lens.fields.kind, expected);
        assert_eq!(lens.object, Object::Finite(200.0));
    }
    for (unit, mm) in [("MM", 1.0), ("CM", 10.0), ("IN", 25.4), ("M", 1000.0), ("METER", 1000.0)] {
        let lens = with("UNIT MM", &format!("UNIT {unit}"));
        assert_eq!(lens.object, Object::Finite(200.0 * mm));
        assert_eq!(lens.surfaces[0].curvature, 2.0491803278688523e-2 / mm);
        assert_eq!(lens.surfaces[0].semi_diameter, Some(8.6 * mm));
    }
    // An older line counts no fields: those up to the last that is not 0.
    assert_eq!(with("FTYP 0 0 3 3 0 0 0 3", "FTYP 0").fields.values.len(), 3);
    assert_eq!(with("FTYP 0 0 3 3 0 0 0 3", "FTYP 0").wavelengths.len(), 3);
}

#[test]
fn obscurations_and_inner_radii_obstruct() {
    let read = |to: &str| {
        let opened = changed("  CLAP 0 8.6 0", to).unwrap_or_else(|error| panic!("{error}"));
        let row = &opened.lens.surfaces[0];
        let sizes = (row.obstruction, row.semi_diameter);
        let report = opened.report.unwrap();
        let line = to.trim().lines().next().unwrap().trim().to_owned();
        (sizes, outcome(&report, &line).0, outcome(&report, "DIAM 8.6 1").0)
    };
    let (used, dropped) = (ConversionOutcome::Used, ConversionOutcome::Dropped);
    assert_eq!(read("  CLAP 2.5 8.6 0"), ((Some(2.5), Some(8.6)), used, used));
    assert_eq!(read("  FLAP 0 8.6 0"), ((None, Some(8.6)), used, used));
    // A semi-diameter that a person fixed is only drawn there.
    assert_eq!(
        read("  OBSC 0 2.5 0"),
        ((Some(2.5), Some(8.6)), used, ConversionOutcome::Approximated)
    );
    // That of an obscuration is often its own size.
    assert_eq!(read("  OBSC 0 8.6 0"), ((Some(8.6), None), used, ConversionOutcome::Preserved));
    assert_eq!(
        read("  OBSC 1 2.5 0"),
        ((None, Some(8.6)), dropped, ConversionOutcome::Approximated)
    );
    // The drawn semi-diameter does not clip beside a rectangle, which does.
    assert_eq!(read("  SQAP 1.5 2 0"), ((None, None), used, ConversionOutcome::Preserved));
    assert_eq!(read("  SPID 1 2 0").1, used);
    assert_eq!(read("  SPID 0 2 0").1, dropped);
    let both = read("  CLAP 1 8.6 0\r\n  OBSC 0 2.5 0").0;
    assert_eq!(both, (Some(2.5), Some(8.6)));
    let inches = achromat().replace("UNIT MM", "UNIT IN").replace("CLAP 0 8.6", "CLAP 1 8.6");
    assert_eq!(lens(&inches).surfaces[0].obstruction, Some(25.4));
    for (wrong, found) in [("CLAP 9 8.6", "from 9 to 8.6"), ("OBSC 0 -1", "from 0 to -1")] {
        let text = refusal("CLAP 0 8.6", wrong);
        assert!(text.contains("line 38: found an aperture") && text.contains(found), "{text}");
    }
    let at_image = achromat().replace("  DIAM 3.6 0", "  OBSC 0 1 0\r\n  DIAM 3.6 0");
    let report = open(at_image.as_bytes()).unwrap().report.unwrap();
    assert_eq!(outcome(&report, "OBSC").0, ConversionOutcome::Dropped);
}

/// A circle beside the vertex clips there, on a plane as on a sphere.
#[test]
fn apertures_beside_the_vertex_clip_there() {
    let beside = "  CLAP 0 6 0\r\n  OBDC 1.5 -2 0";
    let plane = achromat()
        .replace("CURV 2.0491803278688523E-2 1 0 0 0", "CURV 0 0 0 0 0")
        .replace("  CLAP 0 8.6 0", beside);
    for opened in [changed("  CLAP 0 8.6 0", beside), open(plane.as_bytes())] {
        let opened = opened.unwrap();
        let (row, report) = (opened.lens.surfaces[0].clone(), opened.report.unwrap());
        assert_eq!((row.semi_diameter, row.decenter), (None, [0.0; 2]));
        let circle = SurfaceAperture::inside(ApertureShape::Circle { radius: 6.0 });
        assert_eq!(row.apertures, [SurfaceAperture { center: [1.5, -2.0], ..circle }]);
        for line in ["CLAP 0 6 0", "OBDC 1.5 -2 0"] {
            assert_eq!(outcome(&report, line).0, ConversionOutcome::Used, "{line}");
        }
        let note = outcome(&report, "CLAP 0 6 0").1;
        assert_eq!(note, "circle ±6 at 1.5, -2: traced");
        // A ray passes if it meets the surface within 6 mm of (1.5, -2).
        let system = opened.lens.resolve(0, 0.5875618).unwrap();
        let tracer = Tracer::<f64>::new(&system).unwrap();
        for i in 0..400 {
            let [x, y] = [i % 20, i / 20].map(|k| f64::from(k) - 9.5);
            let direction = Vec3::new(0.0, 0.0, 1.0);
            let fate = tracer.trace(Ray { point: Vec3::new(x, y, -1.0), direction }).fate;
            let inside = (x - 1.5).hypot(y + 2.0) <= 6.0;
            assert_eq!(fate != Fate::Clipped(0), inside, "{x} {y}: {fate:?}");
        }
    }
}

#[test]
fn rectangles_ellipses_and_spiders_are_traced_and_written_again() {
    let folder = super::folder("zemax-figures");
    let read = |to: &str| {
        let opened = changed("  CLAP 0 8.6 0", to).unwrap_or_else(|error| panic!("{error}"));
        let row = opened.lens.surfaces[0].clone();
        files::save(&opened.lens, folder.join("a.zmx")).unwrap();
        let back = files::open(folder.join("a.zmx")).unwrap().lens;
        assert_eq!(back.surfaces[0].apertures, row.apertures, "{to}");
        assert_eq!(back.surfaces[0].obstruction, row.obstruction, "{to}");
        let sizes = (row.semi_diameter, row.obstruction);
        let report = opened.report.unwrap();
        let line = to.trim().lines().next().unwrap().trim().to_owned();
        let texts: Vec<String> = row.apertures.iter().map(ToString::to_string).collect();
        (sizes, texts.join("; "), outcome(&report, &line).0)
    };
    let used = ConversionOutcome::Used;
    let clear = (None, None);
    let text = |text: &str| text.to_owned();
    assert_eq!(read("  ELAP 3 4 0"), (clear, text("ellipse ±3 x ±4"), used));
    assert_eq!(read("  ELAP 4 4 0"), ((Some(4.0), None), String::new(), used));
    assert_eq!(
        read("  SQAP 2 3 0\r\n  OBDC 1 -1 0"),
        (clear, text("rectangle ±2 x ±3 at 1, -1"), used)
    );
    // The drawn semi-diameter clips here.
    let drawn = (Some(8.6), None);
    assert_eq!(read("  SQOB 2 3 0"), (drawn, text("obscuring rectangle ±2 x ±3"), used));
    assert_eq!(read("  SPID 0.5 3 0"), (drawn, text("spider 3 x 0.5"), used));
    assert_eq!(read("  SQAP 0 3 0").2, ConversionOutcome::Dropped);
    let inches = achromat().replace("UNIT MM", "UNIT IN").replace("CLAP 0 8.6", "SQAP 1 2");
    let shape = ApertureShape::Rectangle { half_width: 25.4, half_height: 50.8 };
    assert_eq!(lens(&inches).surfaces[0].apertures, [SurfaceAperture::inside(shape)]);
    // The format has no second centre and no turned figure.
    let mut two = changed("  CLAP 0 8.6 0", "  SQAP 2 3 0\r\n  OBDC 1 -1 0").unwrap().lens;
    let turned = SurfaceAperture { angle: 30.0, ..two.surfaces[0].apertures[0].clone() };
    two.surfaces[0].apertures.push(turned);
    let error = files::save(&two, folder.join("b.zmx")).unwrap_err().to_string();
    assert!(error.contains("aperture 2 of surface 1") && error.contains("turned 30"), "{error}");
}

#[test]
fn unsupported_solves_are_frozen_and_reported() {
    let cases = [
        (
            "CURV -2.4330900243309004E-2 1 0 0",
            "CURV -2.4330900243309004E-2 11 4 0",
            "f-number solve",
        ),
        (
            "CURV -2.4330900243309004E-2 1 0 0",
            "CURV -2.4330900243309004E-2 4 1 -1",
            "which is used",
        ),
        (
            "CURV -2.4330900243309004E-2 1 0 0",
            "CURV -2.4330900243309004E-2 4 9 1",
            "does not exist",
        ),
        ("MAZH 0 0", "MAZH 0 0.7", "the present value is used"),
        ("VDSZ 2 9", "TOLE 1 5", "the present value of the solve"),
        ("VDSZ 2 9", "VDSZ 6 9", "without its bounds"),
    ];
    for (from, to, note) in cases {
        let opened = changed(from, to).unwrap_or_else(|error| panic!("{to}: {error}"));
        let report = opened.report.unwrap();
        let (outcome, found) = outcome(&report, to);
        assert_eq!(outcome, ConversionOutcome::Approximated, "{to}");
        assert!(found.contains(note), "{to}: {found}");
        assert!(opened.lens.pickups.is_empty());
    }
}

#[test]
fn malformed_files_are_refused_with_their_line() {
    let cases = [
        ("MODE SEQ", "MODE NSC", "line 2: found `MODE NSC`; expected MODE SEQ"),
        ("UNIT MM", "UNIT PARSEC", "line 6: found unit `PARSEC`"),
        ("ENPD 16.0", "ENPD nan", "line 7: found `nan` in `ENPD nan`"),
        ("ENPD 16.0", "ENPD", "line 7: found `ENPD` with 0 fields"),
        ("ENPD 16.0", "ENPD -3", "line 7: found Diameter(-3.0)"),
        ("ENPD 16.0", "ENPD 0", "line 7: found Diameter(0.0)"),
        ("ENPD 16.0", "OBNA 95 1", "line 7: found ObjectConeDegrees(95.0)"),
        ("ENPD 16.0", "OBNA 0 1", "line 7: found ObjectConeDegrees(0.0)"),
        ("ENPD 16.0", "", "found no aperture before it; expected ENPD, FNUM, OBNA or FLOA"),
        ("SURF 0", "  DISZ 3\r\nSURF 0", "line 23: found `DISZ 3` before the first SURF"),
        ("SURF 2", "SURF 3", "line 39: found `SURF 3`; expected SURF 2"),
        ("CURV -2.4330900243309004E-2", "CURV 1e308", "line 41: found `1e308`"),
        ("CURV -2.4330900243309004E-2", "CURV NaN", "line 41: found `NaN`"),
        ("DISZ 2.2", "DISZ INFINITY", "line 42: found an infinite thickness after surface 2"),
        ("DISZ 2.2", "", "line 39: found surface 2 without DISZ"),
        ("DISZ 2.2", "STOP", "line 39: found surface 2 without DISZ"),
        ("  COAT AR", "  DIAM -2", "line 33: found a semi-diameter of -2"),
        (
            "  DISZ 2.2",
            "  STOP\r\n  DISZ 2.2",
            "line 42: found a second STOP after that of line 29",
        ),
        ("  STOP", "", "found no STOP; expected exactly one STOP"),
        ("WAVM 1 0.4861327", "WAVM x 0.4861327", "line 16: found `x`"),
        ("MNUM 1 1", "MNUM 99999999 1", "found 99999999 configurations; expected at most 1000"),
    ];
    for (from, to, expected) in cases {
        let text = refusal(from, to);
        assert!(text.starts_with("folder/a.zmx, ") || text.contains("folder/a.zmx: "), "{text}");
        assert!(text.contains(expected), "{to}: {text}");
    }
}

#[test]
fn a_truncated_file_is_never_another_lens() {
    let text = achromat();
    let whole = lens(&text);
    for end in 0..text.len() {
        match open(&text.as_bytes()[..end]) {
            Ok(opened) => assert_eq!(opened.lens, whole, "{end}"),
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
}

#[test]
fn of_two_apertures_the_narrower_clips() {
    for apertures in ["  CLAP 0 8.6 0\r\n  FLAP 0 6.5 0", "  CLAP 0 6.5 0\r\n  FLAP 0 8.6 0"] {
        let lens = changed("  CLAP 0 8.6 0", apertures).unwrap().lens;
        assert_eq!(lens.surfaces[0].semi_diameter, Some(6.5), "{apertures}");
    }
}

#[test]
fn a_thickness_follows_thicknesses_alone() {
    let read = |pickup: &str| changed("  DISZ 2.2", &format!("  DISZ 2.2\r\n  {pickup}")).unwrap();
    // The fourth number names the column of the source; 0 is its own.
    let own = read("PZUP 1 0.2 1.1 0").lens;
    assert_eq!(own.pickups.len(), 1);
    let pickup = own.pickups[0];
    assert_eq!(pickup.source, Parameter::new(0, Quantity::Thickness));
    assert_eq!((pickup.scale, pickup.offset), (0.2, 1.1));
    let other = read("PZUP 1 0.2 1.1 1");
    assert!(other.lens.pickups.is_empty());
    assert_eq!(other.lens.surfaces[1].thickness, 2.2);
    let report = other.report.unwrap();
    assert_eq!(outcome(&report, "PZUP").0, ConversionOutcome::Approximated);
}

#[test]
fn the_f_number_of_a_finite_object_is_written_as_a_working_one() {
    let mut lens = lens(&achromat().replace("DISZ INFINITY", "DISZ 200"));
    lens.aperture = Aperture::FNumber(5.0);
    let folder = super::folder("working-f-number");
    let target = folder.join("a.zmx");
    for (object, line) in [(Object::Finite(200.0), "FNUM 5.0 1"), (Object::Infinity, "FNUM 5.0 0")]
    {
        lens.object = object;
        files::save(&lens, &target).unwrap();
        let bytes = std::fs::read(&target).unwrap();
        let units: Vec<u16> =
            bytes.chunks(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])).collect();
        let text = String::from_utf16(&units).unwrap();
        assert!(text.lines().any(|written| written.trim() == line), "no {line} in {text}");
        assert_eq!(files::open(&target).unwrap().lens.aperture, Aperture::FNumber(5.0));
    }
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn heights_of_fields_have_the_unit_of_lengths_and_angles_have_none() {
    let finite = achromat().replace("DISZ INFINITY", "DISZ 200");
    for (unit, mm) in [("MM", 1.0), ("IN", 25.4), ("CM", 10.0)] {
        for (kind, factor) in [(0, 1.0), (1, mm), (2, mm), (3, mm)] {
            let text = finite.replace("UNIT MM", &format!("UNIT {unit}"));
            let lens = lens(&text.replace("FTYP 0 0 3", &format!("FTYP {kind} 0 3")));
            let heights: Vec<f64> = lens.fields.values.iter().map(|field| field.y).collect();
            assert_eq!(heights, [0.0, 1.5 * factor, 2.5 * factor], "{unit}, kind {kind}");
        }
    }
}

#[test]
fn coefficients_of_a_gradient_have_the_unit_of_their_power() {
    let values = [3.0, 5.0, 7.0, 0.1, 0.2, 0.3];
    let parameter = |(i, value): (usize, &f64)| format!("\r\n  PARM {} {value}", i + 3);
    let parameters: Vec<String> = values.iter().enumerate().map(parameter).collect();
    let lines = format!("  TYPE GRINSUR3\r\n  PARM 2 1.6{}", parameters.concat());
    let text = achromat().replacen("  TYPE STANDARD", "  TYPE REPLACED", 2);
    let text = text.replacen("  TYPE REPLACED", "  TYPE STANDARD", 1);
    let text = text.replacen("  TYPE REPLACED", &lines, 1).replace("UNIT MM", "UNIT IN");
    let lens = lens(&text);
    let Medium::Grin(gradient) = &lens.surfaces[0].medium else { panic!("{lens:?}") };
    assert_eq!(gradient.base, Medium::Index(1.6));
    let powers = [2, 4, 6, 1, 2, 3];
    let found = gradient.radial.iter().chain(&gradient.axial);
    for ((found, value), power) in found.zip(values).zip(powers) {
        let expected = value / 25.4_f64.powi(power);
        assert!((found / expected - 1.0).abs() < 1e-14, "{found} {expected}");
    }
    assert_eq!((gradient.radial.len(), gradient.axial.len()), (3, 3));
}

#[test]
fn odd_powers_of_the_height_are_read_as_they_are() {
    let with = |parameter: usize| {
        let lines = format!("  TYPE ODDASPHE\r\n  PARM {parameter} 1e-5");
        let text = achromat().replacen("  TYPE STANDARD", "  TYPE REPLACED", 2);
        let text = text.replacen("  TYPE REPLACED", "  TYPE STANDARD", 1);
        open(text.replacen("  TYPE REPLACED", &lines, 1).as_bytes())
    };
    for power in [1, 3, 5, 7] {
        let opened = with(power).unwrap();
        let report = opened.report.unwrap();
        assert_eq!(outcome(&report, "TYPE ODDASPHE").0, ConversionOutcome::Used);
        let form = opened.lens.surfaces[0].freeform.as_ref().unwrap();
        assert_eq!((form.kind, form.numbers.len()), (FreeformKind::OddAsphere, power));
        assert_eq!(form.numbers[power - 1], 1e-5);
    }
    assert_eq!(with(4).unwrap().lens.surfaces[0].asphere, [1e-5]);
    assert_eq!(with(8).unwrap().lens.surfaces[0].asphere, [0.0, 0.0, 1e-5]);
}

#[test]
fn indices_adjusted_to_another_environment_are_reported() {
    let read = |line: &str| {
        let text = achromat().replacen("UNIT MM", &format!("{line}\r\nUNIT MM"), 1);
        let report = open(text.as_bytes()).unwrap().report.unwrap();
        outcome(&report, "ENVD").0
    };
    assert_eq!(read("ENVD 50 1 1"), ConversionOutcome::Approximated);
    assert_eq!(read("ENVD 20 0.5 1"), ConversionOutcome::Approximated);
    assert_eq!(read("ENVD 50 1 0"), ConversionOutcome::Preserved);
    assert_eq!(read("ENVD 20 1 1"), ConversionOutcome::Preserved);
}

/// The other program has no aspheric surface in front of this kind of medium.
#[test]
fn an_asphere_in_front_of_a_gradient_is_never_lost_in_silence() {
    let mut lens = lens(&achromat());
    let gradient = GradientIndex {
        base: Medium::Index(1.6),
        law: ProfileLaw::Index,
        radial: vec![-1e-3],
        axial: Vec::new(),
    };
    lens.surfaces[0].medium = Medium::Grin(Box::new(gradient));
    let folder = super::folder("asphere-and-gradient");
    let target = folder.join("a.zmx");
    files::save(&lens, &target).unwrap();
    assert_eq!(files::open(&target).unwrap().lens.surfaces[0].medium, lens.surfaces[0].medium);
    lens.surfaces[0].asphere = vec![1e-6];
    match files::save(&lens, &target) {
        Err(error) => assert!(error.to_string().contains("not saved"), "{error}"),
        Ok(report) => {
            let again = files::open(&target).unwrap().lens;
            assert_eq!(again.surfaces[0].asphere, [1e-6]);
            let rows = report.report.unwrap().rows;
            let lost = rows.iter().filter(|row| row.outcome != ConversionOutcome::Used);
            assert!(lost.into_iter().any(|row| row.text.contains("surface 1")), "{rows:?}");
        }
    }
    std::fs::remove_dir_all(folder).unwrap();
}

/// A skew field of 10 degrees in both planes: the tangents of both are the slopes of its direction.
#[test]
fn skew_angles_are_those_of_both_planes() {
    let text = achromat();
    let line = |word: &str| text.lines().find(|line| line.trim_start().starts_with(word)).unwrap();
    let replaced = text.replacen(line("XFLN"), "XFLN 10 0 4", 1);
    let replaced = replaced.replacen(line("YFLN"), "YFLN 10 3 0", 1);
    let field = lens(&replaced).fields.values[0];
    let slope = field.x.hypot(field.y).to_radians().tan() / 2f64.sqrt();
    assert!((slope - 10f64.to_radians().tan()).abs() < 1e-15, "{field:?}");
    assert!((field.x - field.y).abs() < 1e-15, "{field:?}");
    let [x, y] = field.projected_angles();
    assert!((x - 10.0).abs() < 1e-13 && (y - 10.0).abs() < 1e-13, "{x} {y}");
    let read = lens(&replaced);
    let (written, _) = files::zemax::write(&read).unwrap();
    let again = lens(&written);
    let pairs = read.fields.values.iter().zip(&again.fields.values);
    for (a, b) in pairs {
        assert!((a.x - b.x).abs() < 1e-13 && (a.y - b.y).abs() < 1e-13, "{a:?} {b:?}");
    }
}

/// Nobody traces a user-defined aperture, but the file that is written has its line again.
#[test]
fn apertures_of_other_forms_are_written_back() {
    let lines = "  SQAP 3 4 0\r\n  SPID 0.5 3 0\r\n  UDAD 0 1 2 3\r\n  OBDC 0.5 0 0";
    let opened = changed("  CLAP 0 8.6 0", lines).unwrap();
    let report = opened.report.unwrap();
    for (line, expected) in [
        ("SQAP", ConversionOutcome::Used),
        ("SPID", ConversionOutcome::Used),
        ("UDAD", ConversionOutcome::Dropped),
    ] {
        assert_eq!(outcome(&report, line).0, expected, "{line}");
    }
    assert!(outcome(&report, "UDAD").1.contains("writes the line back"));
    let (mut lens, folder) = (opened.lens, super::folder("zemax-apertures"));
    let written = |lens: &Lens| {
        let saved = files::save(lens, folder.join("aperture.zmx")).unwrap();
        let text = files::decode_unicode(&std::fs::read(folder.join("aperture.zmx")).unwrap(), "a");
        (text.unwrap(), saved.report.unwrap())
    };
    let (text, _) = written(&lens);
    for line in lines.split("\r\n") {
        assert!(text.contains(line), "{line}: {text}");
    }
    let back = files::open(folder.join("aperture.zmx")).unwrap().lens;
    assert_eq!(back.surfaces[0], lens.surfaces[0]);
    // The native format keeps them too.
    let native = files::json::read(&files::json::write(&lens), "a.json").unwrap();
    assert_eq!(native.surfaces, lens.surfaces);
    // Other apertures, another size: the lines are not those of this lens any more.
    let edit = Edit::Scale(2.0);
    assert_eq!(apply_edit(&lens, &edit).unwrap().surfaces[0].foreign_aperture, None);
    lens.surfaces[0].apertures.pop();
    let (text, report) = written(&lens);
    assert!(!text.contains("SPID") && !text.contains("UDAD") && text.contains("SQAP"));
    assert_eq!(outcome(&report, "aperture of surface 1").0, ConversionOutcome::Approximated);
}
