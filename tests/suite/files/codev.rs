//! The meaning of a CODE V file, on files written for the tests.

use super::foreign;
use aplanat::files::{self, ConversionOutcome, ConversionReport, LensFormat, OpenedLens};
use aplanat::lens::{
    Aperture, AxisBreak, FieldKind, FreeformKind, IdealElement, Lens, Medium, Object, Parameter,
    Pickup, Quantity,
};
use aplanat::math::Vec3;

fn text() -> String {
    String::from_utf8(foreign("tilted.seq")).unwrap()
}

fn open(text: &str) -> OpenedLens {
    files::parse(text.as_bytes(), "folder/a.seq").unwrap_or_else(|error| panic!("{error}"))
}

fn changed(from: &str, to: &str) -> OpenedLens {
    let text = text();
    assert!(text.contains(from), "{from}");
    open(&text.replacen(from, to, 1))
}

fn outcome(report: &ConversionReport, text: &str) -> ConversionOutcome {
    let row = report.rows.iter().find(|row| row.text.starts_with(text));
    row.unwrap_or_else(|| panic!("no row {text}")).outcome
}

#[test]
fn header_surfaces_and_glasses_are_read() {
    let opened = open(&text());
    assert_eq!(opened.format, LensFormat::CodeV);
    let lens = opened.lens;
    assert_eq!(lens.name, "Achromat; with a fold mirror");
    assert_eq!((lens.object, lens.surfaces.len()), (Object::Infinity, 6));
    assert_eq!(lens.aperture, Aperture::EntrancePupilDiameter(12.0));
    let fields: Vec<(f64, f64)> = lens.fields.values.iter().map(|f| (f.y, f.weight)).collect();
    assert_eq!((lens.fields.kind, fields), (FieldKind::Angle, vec![(0.0, 1.0), (1.5, 0.5)]));
    let waves: Vec<f64> = lens.wavelengths.iter().map(|wave| wave.um).collect();
    assert_eq!((waves.len(), lens.primary()), (3, 1));
    assert!((waves[0] - 0.6562725).abs() < 1e-15);
    let front = &lens.surfaces[0];
    assert_eq!((front.curvature, front.semi_diameter), (1.0 / 48.8, Some(8.6)));
    assert_eq!((front.comment.as_str(), front.stop), ("front crown", true));
    assert_eq!(front.medium, Medium::Glass("SCHOTT N-BAK4".to_owned()));
    let Medium::Model { nd, vd } = lens.surfaces[1].medium else { panic!("a private glass") };
    assert!((nd - 1.6).abs() < 1e-12 && (vd - 54.0).abs() < 5.0, "{nd} {vd}");
    assert_eq!(lens.surfaces[1].conic, -0.5);
    assert_eq!(lens.surfaces[2].asphere, [1.5e-7, -2e-10]);
    assert_eq!(lens.surfaces[4].medium, Medium::Model { nd: 1.517, vd: 64.2 });
    let curvature = Parameter::new(0, Quantity::Curvature);
    assert!(lens.variable(curvature).is_some() && lens.variables.len() == 1);
    let thickness = |surface| Parameter::new(surface, Quantity::Thickness);
    let report = opened.report.unwrap();
    let (parameter, source) = (thickness(5), thickness(4));
    assert_eq!(lens.pickups, [Pickup { parameter, source, scale: 1.0, offset: 0.0 }]);
    // The defocus of an image that is not tilted is part of the gap, which no pickup yields then.
    let defocused = changed("SI    0.0 -0.5\n  ADE 10.0", "SI    0.0 -0.5");
    assert_eq!((defocused.lens.surfaces[5].thickness, defocused.lens.pickups.len()), (-5.5, 0));
    assert_eq!(outcome(&defocused.report.unwrap(), "PIK"), ConversionOutcome::Approximated);
    assert_eq!(outcome(&report, "VUY"), ConversionOutcome::Dropped);
}

#[test]
fn places_follow_the_signs_of_the_program() {
    let lens = open(&text()).lens;
    let mirror = &lens.surfaces[3];
    // ADE is left-handed.
    for turn in [mirror.break_before, mirror.break_after] {
        assert!((turn.unwrap().tilt[0] + 45.0).abs() < 1e-12);
    }
    let alone = &lens.surfaces[4];
    assert_eq!((alone.decenter, alone.break_before), ([0.25, 0.0], None));
    assert!((alone.tilt[0] + 3.0).abs() < 1e-12);
    // The image is tilted about the end of the gap, then displaced along its own axis.
    let last = &lens.surfaces[5];
    assert_eq!(last.thickness, -5.0);
    let image = last.break_after.unwrap();
    assert!((image.tilt[0] + 10.0).abs() < 1e-12);
    let end = image.pose().point_out(Vec3::new(0.0, 0.0, last.thickness));
    let (sin, cos) = 10_f64.to_radians().sin_cos();
    let apart = end - Vec3::new(0.0, -0.5 * sin, -5.0 - 0.5 * cos);
    assert!(apart.dot(apart).sqrt() < 1e-12, "{end:?}");
    let up = changed("  ADE 45.0; BEN", "  ADE -45.0; BEN").lens.resolve(0, 0.5875618).unwrap();
    let down = lens.resolve(0, 0.5875618).unwrap();
    let image = |system: &aplanat::lens::System<f64>| system.frames().last().unwrap().shift;
    assert!(image(&down).y < -40.0 && image(&up).y > 40.0);
    // A break and its reverse leave the axis as it was.
    let there = "S     -41.1 2.2 'G1'\n  YDE 1.0; ADE 4.0\n";
    let reversed = changed("S     -41.1 2.2 'G1'\n", there);
    let text = text().replacen("S     -41.1 2.2 'G1'\n", there, 1);
    let back = "S     -154.5 30.0\n  YDE 1.0; ADE 4.0; REV\n";
    let whole = open(&text.replacen("S     -154.5 30.0\n", back, 1)).lens;
    assert!(reversed.lens.surfaces[2].break_after.is_none());
    let axis = |lens: &Lens| lens.resolve(0, 0.5875618).unwrap().frames()[3].turn[1].z;
    assert!(axis(&reversed.lens).abs() > 0.01 && axis(&whole).abs() < 1e-15);
}

#[test]
fn files_without_a_mode_give_what_their_numbers_suggest() {
    let radii = changed("RDM;LEN", "LEN");
    assert_eq!(radii.lens, open(&text()).lens);
    let curvatures = "tit 'Singlet'\nso 0 100\ns 0.1 1 nbk7_schott\ns -.05 15\nsi 0 0\nfno 5\n";
    let lens = open(curvatures).lens;
    assert_eq!((lens.surfaces[0].curvature, lens.stop()), (0.1, Some(0)));
    assert_eq!(lens.aperture, Aperture::FNumber(5.0));
    let crs = curvatures.replace('\n', "\r");
    assert_eq!(open(&crs).lens, lens);
}

#[test]
fn a_file_without_an_image_has_one_behind_its_last_gap() {
    let text = "so 0 1e11\ns 0.1 1 517642\ns -.05 9.5\nepd 2.5\n";
    let opened = open(text);
    assert_eq!((opened.lens.surfaces.len(), opened.lens.surfaces[1].thickness), (2, 9.5));
    assert_eq!(outcome(&opened.report.unwrap(), "SI"), ConversionOutcome::Approximated);
    assert!(files::parse(text.replace("epd 2.5\n", "").as_bytes(), "a.seq").is_err());
}

#[test]
fn surfaces_that_cannot_be_traced_are_locked() {
    let opened = changed("  CON; K -0.5", "  DIF DOE; HOR 1.0\n  HCO C1 -0.0018");
    let report = opened.report.unwrap();
    assert_eq!(outcome(&report, "DIF DOE"), ConversionOutcome::Locked);
    let locked = opened.lens.surfaces[1].locked.as_ref().unwrap();
    assert_eq!(locked.kind, "DIF DOE");
    assert!(locked.lines.iter().any(|line| line == "HCO C1 -0.0018"));
}

#[test]
fn a_lens_is_written_and_read_back() {
    let folder = super::folder("codev");
    let lens = open(&text()).lens;
    let saved = files::save(&lens, folder.join("back.seq")).unwrap();
    let proof = saved.proof.unwrap();
    assert!(proof.worst_mm < 1e-11 && proof.imaged > 0, "{proof:?}");
    let back = files::open(folder.join("back.seq")).unwrap().lens;
    for (row, other) in lens.surfaces.iter().zip(&back.surfaces) {
        assert_eq!(
            (&row.medium, row.stop, &row.comment),
            (&other.medium, other.stop, &other.comment)
        );
        assert_eq!(row.semi_diameter, other.semi_diameter);
    }
    assert_eq!(back.variables, lens.variables);
    // A place that the format cannot hold is named.
    let mut lens = lens;
    lens.surfaces[3].tilt = [1.0, 0.0];
    let error = files::save(&lens, folder.join("other.seq")).unwrap_err().to_string();
    assert!(error.contains("surface 4") && error.contains(".seq"), "{error}");
}

#[test]
fn zoom_positions_are_read() {
    let zoom = "ZOO   2\nZOO   THI S3 30.0 35.0\nZOO EPD 12.0 10.0\nZOO YAN F2 1.5 1.0\nZOO CCY S1 0 0\nGO";
    let opened = open(&text().replace("\nGO", &format!("\n{zoom}")));
    let lens = opened.lens;
    assert_eq!(lens.zoom_positions(), 2);
    assert_eq!(lens.thickness_at(2, 1), Some(35.0));
    assert_eq!(lens.aperture_at(1), Aperture::EntrancePupilDiameter(10.0));
    assert_eq!(lens.fields_at(1).values[1].y, 1.0);
    assert_eq!(outcome(&opened.report.unwrap(), "ZOO CCY"), ConversionOutcome::Dropped);
}

#[test]
fn malformed_files_are_refused_with_their_line() {
    for (from, to, expected) in [
        ("EPD   12.0", "EPD nan", "line 3: found `EPD nan`"),
        ("EPD   12.0", "EPD -3", "line 3: found `EPD -3`; expected a number above 0"),
        ("DIM   M", "DIM Q", "line 4: found unit `Q`"),
        ("SO    0.0 0.1e14", "", "line 18: found `S     48.8 5.5 NBAK4_SCHOTT` before SO"),
        ("SI    0.0 -0.5", "", "found no complete list of surfaces"),
        ("SI    0.0 -0.5", "SI 0 0\nS 1 1", "behind the image"),
        ("  STO\n", "  STO S99\n", "found the stop on surface 99"),
        ("S     -41.1 2.2", "S x 2.2", "line 23: found `S x 2.2 'G1'`"),
    ] {
        let text = text();
        assert!(text.contains(from), "{from}");
        let error = files::parse(text.replacen(from, to, 1).as_bytes(), "a.seq").unwrap_err();
        assert!(error.to_string().contains(expected), "{to}: {error}");
    }
    let text = text().replace("EPD   12.0\n", "");
    assert_eq!(open(&text).lens.aperture, Aperture::StopSemiDiameter(8.6));
    let error = files::parse(text.replace("  CIR 8.6\n", "").as_bytes(), "a.seq").unwrap_err();
    assert!(error.to_string().contains("found no aperture"), "{error}");
    for end in 0..text.len() {
        if let Ok(opened) = files::parse(&text.as_bytes()[..end], "a.seq") {
            assert_eq!(opened.lens.surfaces.len(), 6, "{end}");
        }
    }
}

#[test]
fn what_a_written_file_cannot_hold_is_reported() {
    let mut lens = changed("  CON; K -0.5", "  DIF DOE; HOR 1.0\n  HCO C1 -0.0018").lens;
    lens.surfaces[1].conic = 0.0;
    lens.surfaces[0].hyperhemisphere = true;
    let path = super::folder("codev-lost").join("lost.seq");
    let report = files::save(&lens, path).unwrap().report.unwrap();
    assert_eq!(outcome(&report, "hyperhemisphere of surface 1"), ConversionOutcome::Dropped);
    assert_eq!(outcome(&report, "surface 2: DIF DOE"), ConversionOutcome::Locked);
}

/// Light from a point far away has no numerical aperture, and no beam is of size 0.
#[test]
fn apertures_of_zoom_positions_are_those_that_a_lens_can_have() {
    let zoom = "ZOO   2\nZOO NAO 0.1 0.2\nZOO EPD 12.0 0.0\nGO";
    let opened = open(&text().replace("\nGO", &format!("\n{zoom}")));
    assert_eq!(opened.lens.zoom_positions(), 2);
    assert_eq!(opened.lens.aperture_at(1), Aperture::EntrancePupilDiameter(12.0));
    let report = opened.report.unwrap();
    assert_eq!(outcome(&report, "ZOO NAO"), ConversionOutcome::Dropped);
    assert_eq!(outcome(&report, "ZOO EPD"), ConversionOutcome::Dropped);
}

#[test]
fn every_zoom_position_is_written_and_read_back() {
    let zoom = "ZOO   3\nZOO THI S3 30.0 35.0 41.5\nGO";
    let lens = open(&text().replace("\nGO", &format!("\n{zoom}"))).lens;
    assert_eq!(lens.zoom_positions(), 3);
    let path = super::folder("codev-zoom").join("zoom.seq");
    files::save(&lens, &path).unwrap();
    let back = files::open(&path).unwrap().lens;
    for position in 0..3 {
        assert_eq!(back.thickness_at(2, position), lens.thickness_at(2, position), "{position}");
    }
}

#[test]
fn apertures_that_are_no_centred_circles_are_traced_and_written_again() {
    let folder = super::folder("codev-figures");
    let read = |to: &str| {
        let opened = changed("  CIR 8.6", to);
        let row = opened.lens.surfaces[0].clone();
        assert_eq!(row.decenter, [0.0; 2]);
        files::save(&opened.lens, folder.join("a.seq")).unwrap();
        let back = files::open(folder.join("a.seq")).unwrap().lens;
        assert_eq!(back.surfaces[0].apertures, row.apertures, "{to}");
        let sizes = (back.surfaces[0].semi_diameter, back.surfaces[0].obstruction);
        assert_eq!(sizes, (row.semi_diameter, row.obstruction), "{to}");
        let texts: Vec<String> = row.apertures.iter().map(ToString::to_string).collect();
        let command = to.trim().split(';').next().unwrap();
        (sizes, texts.join("; "), outcome(&opened.report.unwrap(), command))
    };
    let used = ConversionOutcome::Used;
    let clear = (None, None);
    for (to, sizes, text) in [
        ("  REX 3; REY 4", clear, "rectangle ±3 x ±4"),
        ("  ELX 3; ELY 2", clear, "ellipse ±3 x ±2"),
        ("  ELX 3; ELY 3", (Some(3.0), None), ""),
        ("  CIR 6; ADX 1", clear, "circle ±6 at 1, 0"),
        ("  ADX 1; ADY -2; CIR 6", clear, "circle ±6 at 1, -2"),
        ("  REX OBS 3; REY OBS 2; CIR 8.6", (Some(8.6), None), "obscuring rectangle ±3 x ±2"),
        ("  CIR HOL 2; REX 3; REY 4", (None, Some(2.0)), "rectangle ±3 x ±4"),
        ("  ARO 30; REX 3; REY 4", clear, "rectangle ±3 x ±4 turned 30"),
        ("  REX 3; REY S1 4; ADX 0.5; ARO 30", clear, "rectangle ±3 x ±4 at 0.5, 0 turned 30"),
    ] {
        assert_eq!(read(to), (sizes, text.to_owned(), used), "{to}");
    }
    assert_eq!(read("  REX EDG 3").2, ConversionOutcome::Preserved);
    // Without an aperture nothing is turned.
    assert_eq!(read("  ARO 30").2, ConversionOutcome::Preserved);
    // A plane stays where it is.
    let third = "S     -154.5 30.0\n  ASP; A 1.5e-7; B -2.0E-10";
    let plane = changed(third, "S     0.0 30.0\n  CIR 6; ADX 1; ADY 2");
    let row = &plane.lens.surfaces[2];
    assert_eq!((row.semi_diameter, row.decenter), (None, [0.0; 2]));
    assert_eq!(row.apertures[0].center, [1.0, 2.0]);
    assert_eq!(outcome(&plane.report.unwrap(), "ADX"), used);
}

/// Two planes in air with a lens of one element, whose gaps, aperture and fields change with the position.
const ZOOM: &str = "RDM;LEN\nEPD 5\nDIM M\nWL 587.5618\nXAN 0 1\nYAN 0 2\nSO 0 1E14\n\
    S 50 3 517642\n  STO\nS -50 45\nSI 0 0.5\nZOO 2\nZOO THI S1 3 4\nZOO THI S2 45 44\n\
    ZOO EPD 5 4\nZOO XAN F2 1 1.5\nZOO YAN F2 2 1\nGO\n";

/// The gap in front of the image changes with the position in nearly every zoom lens, and holds the defocus.
#[test]
fn last_gaps_apertures_and_skew_fields_of_zoom_positions_are_written_and_read_back() {
    let opened = open(ZOOM);
    let dropped =
        |opened: &OpenedLens| opened.report.as_ref().unwrap().count(ConversionOutcome::Dropped);
    assert_eq!(dropped(&opened), 0, "{}", opened.report.unwrap());
    let lens = opened.lens;
    assert_eq!([0, 1].map(|zoom| lens.thickness_at(1, zoom)), [Some(45.5), Some(44.5)]);
    let skew = lens.fields_at(1).projected_points()[1];
    assert!((skew[0] - 1.5).abs() < 1e-12 && (skew[1] - 1.0).abs() < 1e-12, "{skew:?}");
    let moved = ZOOM.replace("ZOO EPD", "ZOO THI SI 0.5 0.75\nZOO EPD");
    assert_eq!(open(&moved).lens.thickness_at(1, 1), Some(44.75));
    let folder = super::folder("codev-zoom-all");
    for name in ["zoom.seq", "zoom.zmx"] {
        let saved = files::save(&lens, folder.join(name)).unwrap();
        assert_eq!(saved.report.unwrap().count(ConversionOutcome::Dropped), 0, "{name}");
        let back = files::open(folder.join(name)).unwrap().lens;
        for zoom in 0..2 {
            assert_eq!(back.aperture_at(zoom), lens.aperture_at(zoom), "{name}");
            let points = [&back, &lens].map(|lens| lens.fields_at(zoom).projected_points()[1]);
            let apart = (points[0][0] - points[1][0]).hypot(points[0][1] - points[1][1]);
            assert!(apart < 1e-12, "{name}: {points:?}");
        }
    }
}

#[test]
fn zoom_lenses_of_the_library_are_written_as_sequences() {
    let folder = super::folder("codev-zoom-library");
    for name in ["zoom_nikkor_28_80", "zoom_tamron_28_75_f28"] {
        let bundled = files::bundled_lenses().iter().find(|lens| lens.name == name).unwrap();
        let lens = files::json::read(bundled.text, name).unwrap();
        let saved = files::save(&lens, folder.join(format!("{name}.seq"))).unwrap();
        assert!(saved.proof.unwrap().worst_mm < 1e-9, "{name}");
    }
}

#[test]
fn special_forms_are_traced_and_written_back() {
    let folder = super::folder("codev-special");
    let front = "S     48.8 5.5 NBAK4_SCHOTT";
    for (special, kind, numbers) in [
        (
            "SPS XYP 20; SCO NRADIUS 10; SCO K -0.5; SCO C3 0.01; SCO C4 0.02",
            FreeformKind::XyPolynomial { radius: 10.0 },
            vec![0.0, 0.01, 0.02],
        ),
        (
            "SPS ODD 0.0; SCO K -0.5; SCO AR3 1e-4; SCO C6 2e-6",
            FreeformKind::OddAsphere,
            vec![0.0, 0.0, 1e-4, 0.0, 2e-6],
        ),
        (
            "SPS QCN 9; SCO C4 0.03; SCO C6 -0.01; SCO K -0.5",
            FreeformKind::QCon { radius: 9.0 },
            vec![0.03, 0.0, -0.01],
        ),
        (
            "SPS QBF 9; SCO C3 0.03; SCO C4 -0.01; SCO C17 -0.5",
            FreeformKind::QBfs { radius: 9.0 },
            vec![0.03, -0.01],
        ),
        (
            "SPS ZFR; SCO C1 -0.5; SCO C3 9; SCO C8 0.02",
            FreeformKind::FringeZernike { radius: 9.0 },
            vec![0.0, 0.0, 0.0, 0.0, 0.02],
        ),
    ] {
        let text = text().replacen(front, &format!("{front}\n  {special}"), 1);
        let opened = open(&text);
        let row = &opened.lens.surfaces[0];
        let form = row.freeform.as_ref().unwrap_or_else(|| panic!("{special}"));
        assert_eq!((form.kind, &form.numbers, row.conic), (kind, &numbers, -0.5));
        assert_eq!(outcome(opened.report.as_ref().unwrap(), "SPS"), ConversionOutcome::Used);
        let saved = files::save(&opened.lens, folder.join("special.seq")).unwrap();
        assert!(saved.proof.unwrap().worst_mm < 1e-9, "{special}");
        let back = files::open(folder.join("special.seq")).unwrap().lens;
        assert_eq!(back.surfaces[0].freeform, row.freeform);
    }
    // Coefficients of an odd asphere are those of r/R.
    let odd = text().replacen(front, &format!("{front}\n  SPS ODD 2.0; SCO AR3 8.0"), 1);
    assert_eq!(open(&odd).lens.surfaces[0].freeform.as_ref().unwrap().numbers[2], 1.0);
    for unknown in ["SPS ZRN 9; SCO C4 0.1", "SPS QCN 9; SCO C2 0.1", "SPS XYP 9; SCO Q7 0.1"] {
        let opened = open(&text().replacen(front, &format!("{front}\n  {unknown}"), 1));
        let row = &opened.lens.surfaces[0];
        assert!(row.locked.is_some() && row.freeform.is_none(), "{unknown}");
        assert!(opened.report.unwrap().count(ConversionOutcome::Locked) > 0, "{unknown}");
    }
}

#[test]
fn gratings_are_traced_and_written_back() {
    let front = "S     48.8 5.5 NBAK4_SCHOTT";
    let ruled = |words: &str| open(&text().replacen(front, &format!("{front}\n  {words}"), 1));
    let opened = ruled("DIF GRT; GRO -1; GRS 0.004");
    let expected = IdealElement::Grating { lines_per_mm: 250.0, order: -1.0 };
    assert_eq!(opened.lens.surfaces[0].ideal, Some(expected));
    let path = super::folder("codev-grating").join("grating.seq");
    let proof = files::save(&opened.lens, &path).unwrap().proof.unwrap();
    assert!(proof.worst_mm < 1e-9, "{proof}");
    for unknown in
        ["DIF GRT; GRO 1", "DIF GRT; GRS 0.004; GRX 1; GRY 0", "DIF GRT; GRS 1; ASP; A 1e-6"]
    {
        let row = &ruled(unknown).lens.surfaces[0];
        assert_eq!(row.locked.as_ref().unwrap().kind, "DIF GRT", "{unknown}");
    }
}

/// A surface with the place of another one stands where that one does, whatever is between.
#[test]
fn surfaces_are_placed_by_others() {
    let start = "RDM;LEN\nEPD 5\nDIM M\nWL 587.5618\nYAN 0\nSO 0 1E14\nS 0 10\n  STO\n\
        S 0 7\n  YDE 1; ADE 20\nS 0 3\n  XDE 2; BDE -30\n";
    let end = "  ZDE 25; ADE 5\nS 0 4\nSI 0 0\nGO\n";
    for place in ["GLB S2", "RET S2"] {
        let opened = open(&format!("{start}S 0 6\n  {place}\n{end}"));
        assert_eq!(outcome(opened.report.as_ref().unwrap(), place), ConversionOutcome::Used);
        let system = opened.lens.resolve(0, 0.5875618).unwrap();
        let stand = |i: usize| {
            let (frame, surface) = (system.frames()[i], &system.surfaces[i]);
            surface.pose.map_or(frame, |pose| frame.then(&pose))
        };
        let frames = [0, 1, 2, 3, 4].map(stand);
        let own = AxisBreak { decenter: [0.0, 0.0, 25.0], tilt: [-5.0, 0.0, 0.0] };
        let (found, expected) = (&frames[3], frames[1].then(&own.pose()));
        assert!(expected.inverse().then(found).is_nearly_centred(), "{found:?} {expected:?}");
        let apart = found.shift - expected.shift;
        assert!(apart.dot(apart).sqrt() < 1e-12);
        // The next surface stands behind it.
        let gap = frames[3].inverse().then(&frames[4]).shift;
        assert!((gap - Vec3::new(0.0, 0.0, 6.0)).dot(gap - Vec3::new(0.0, 0.0, 6.0)) < 1e-24);
    }
    let named = open(&format!("{start}S 0 6\n{end}GLB S4 S2\n"));
    assert!(outcome(named.report.as_ref().unwrap(), "GLB") == ConversionOutcome::Used);
    let unknown = open(&format!("{start}S 0 6\n  GLB S9\n{end}"));
    assert!(outcome(unknown.report.as_ref().unwrap(), "GLB") == ConversionOutcome::Dropped);
}

/// Another maker's glass of the same name is another glass.
#[test]
fn a_glass_of_another_maker_is_no_exact_one() {
    let opened = changed("NBAK4_SCHOTT", "KZFS4_SCHOTT");
    assert_eq!(opened.lens.surfaces[0].medium, Medium::Glass("SCHOTT N-KZFS4".to_owned()));
    let report = opened.report.unwrap();
    let row = report.rows.iter().find(|row| row.text.contains("KZFS4")).unwrap();
    assert_eq!(row.outcome, ConversionOutcome::Approximated, "{}", row.note);
}

#[test]
fn a_gradient_index_medium_is_refused_by_name() {
    let bundled = files::bundled_lenses().iter().find(|lens| lens.name == "wood_lens_60").unwrap();
    let lens = files::json::read(bundled.text, "wood").unwrap();
    let path = super::folder("codev-gradient").join("a.seq");
    let error = files::save(&lens, path).unwrap_err().to_string();
    assert!(error.contains("the gradient-index medium of surface 1"), "{error}");
}
