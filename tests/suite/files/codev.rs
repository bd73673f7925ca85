//! The meaning of a CODE V file, on files written for the tests.

use super::foreign;
use aplanat::files::{self, ConversionOutcome, ConversionReport, LensFormat, OpenedLens};
use aplanat::lens::{Aperture, FieldKind, Lens, Medium, Object, Parameter, Pickup, Quantity};
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
fn apertures_that_are_no_centred_circles_have_circles_that_stand_for_them() {
    let read = |to: &str| {
        let opened = changed("  CIR 8.6", to);
        let row = &opened.lens.surfaces[0];
        let (sizes, decenter) = ((row.semi_diameter, row.obstruction), row.decenter);
        assert_eq!(decenter, [0.0; 2], "the surface is curved");
        (sizes, outcome(&opened.report.unwrap(), to.trim().split(';').next().unwrap()))
    };
    let (used, approximated) = (ConversionOutcome::Used, ConversionOutcome::Approximated);
    assert_eq!(read("  REX 3; REY 4"), ((Some(5.0), None), approximated));
    assert_eq!(read("  ELX 3; ELY 2"), ((Some(3.0), None), approximated));
    assert_eq!(read("  ELX 3; ELY 3"), ((Some(3.0), None), used));
    assert_eq!(read("  ADX 1; CIR 6"), ((Some(7.0), None), approximated));
    assert_eq!(read("  REX OBS 3; REY OBS 2; CIR 8.6"), ((Some(8.6), Some(2.0)), approximated));
    assert_eq!(read("  REX EDG 3").1, ConversionOutcome::Preserved);
    assert_eq!(read("  ARO 30").1, ConversionOutcome::Dropped);
    // The fifth surface is a plane, but tilted and decentred itself.
    let tilted = changed("  XDE 0.25; ADE 3.0; DAR", "  XDE 0.25; ADE 3.0; DAR; CIR 6; ADX 1");
    assert_eq!(tilted.lens.surfaces[4].semi_diameter, Some(7.0));
    // A plane moves with its aperture.
    let third = "S     -154.5 30.0\n  ASP; A 1.5e-7; B -2.0E-10";
    let plane = changed(third, "S     0.0 30.0\n  CIR 6; ADX 1; ADY 2");
    let row = &plane.lens.surfaces[2];
    assert_eq!((row.semi_diameter, row.decenter), (Some(6.0), [1.0, 2.0]));
    assert_eq!(outcome(&plane.report.unwrap(), "ADX"), used);
}
