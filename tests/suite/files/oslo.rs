//! The meaning of a lens of OSLO, on a Cooke triplet whose first-order data are known.

use super::foreign;
use aplanat::files::{self, ConversionOutcome, LensFormat, OpenedLens};
use aplanat::lens::{Aperture, FieldKind, Medium, Object, Quantity};
use aplanat::paraxial::{Beam, first_order};

fn text() -> String {
    String::from_utf8(foreign("triplet.len")).unwrap()
}

fn read(text: &str) -> OpenedLens {
    files::parse(text.as_bytes(), "a.len").unwrap()
}

fn efl(opened: &OpenedLens) -> f64 {
    let lens = &opened.lens;
    let system = lens.resolve(0, lens.wavelengths[lens.primary()].um).unwrap();
    first_order(&system, &Beam::for_lens(lens, 0)).unwrap().efl.unwrap()
}

#[test]
fn a_lens_is_read() {
    let opened = files::parse(text().as_bytes(), "unknown").unwrap();
    assert_eq!(opened.format, LensFormat::Oslo);
    let lens = &opened.lens;
    assert_eq!((lens.name.as_str(), lens.source.as_str()), ("Cooke triplet", "Geary"));
    assert_eq!((lens.notes.as_str(), lens.object), ("A note", Object::Infinity));
    assert_eq!(lens.aperture, Aperture::EntrancePupilDiameter(10.0));
    assert_eq!((lens.surfaces.len(), lens.stop()), (6, Some(2)));
    let fields: Vec<f64> = lens.fields.values.iter().map(|field| field.y).collect();
    assert_eq!((lens.fields.kind, fields), (FieldKind::Angle, vec![0.0, 14.0, 20.0]));
    assert_eq!((lens.wavelengths[1].um, lens.wavelengths[1].weight), (0.48, 0.5));
    // Only an aperture that is checked clips.
    let rims: Vec<Option<f64>> = lens.surfaces.iter().map(|row| row.semi_diameter).collect();
    assert_eq!(rims, [Some(7.57), None, None, None, None, None]);
    // The reference lens has 49.99978 mm with SK16 and F2; ours are the successors of these glasses.
    assert!((efl(&opened) - 49.99978).abs() < 0.02, "{}", efl(&opened));
}

#[test]
fn units_shapes_and_what_follows_are_read() {
    let inches = read(&text().replace("UNI 1.0", "UNI 25.4"));
    assert!((efl(&inches) / efl(&read(&text())) - 25.4).abs() < 1e-9);
    let odd = text()
        .replace("RD 22.01359", "CV 0.0454\nCC -0.5\nAD 1e-6\nAF -2e-9")
        .replace("RD -18.39533", "PK CVM 1 0.001")
        .replace("TH 42.20778", "TH 42.20778\nPY 0.0")
        .replace("RD 79.6836\nTH 2.95208", "PK TH -4 2.0");
    let lens = read(&odd).lens;
    let front = &lens.surfaces[0];
    assert_eq!((front.curvature, front.conic), (0.0454, -0.5));
    assert_eq!(front.asphere, [1e-6, 0.0, -2e-9]);
    assert_eq!(lens.image_solve, Some(0.0));
    // A curvature that follows another takes its shape along.
    assert_eq!(lens.surfaces[5].conic, -0.5);
    assert_eq!(lens.surfaces[5].asphere, [-1e-6, 0.0, 2e-9]);
    let pickups: Vec<_> = lens
        .pickups
        .iter()
        .map(|p| (p.parameter.surface, p.source.surface, p.source.quantity, p.scale, p.offset))
        .collect();
    assert_eq!(
        pickups,
        [(4, 0, Quantity::Thickness, 1.0, 2.0), (5, 0, Quantity::Curvature, -1.0, 0.001)]
    );
    let mirror = read(&text().replace("GLA F2", "RFL").replace("TH 0.99997", "TH -0.99997"));
    assert_eq!(mirror.lens.surfaces[2].medium, Medium::Mirror);
}

#[test]
fn what_has_no_counterpart_is_listed_and_what_is_wrong_is_named() {
    let opened = read(&text().replace("AP 4.05", "TLA 3.0\nAP 4.05\nGRT 2"));
    let report = opened.report.unwrap();
    let dropped: Vec<&str> =
        report.rows_with(ConversionOutcome::Dropped).map(|row| row.text.as_str()).collect();
    assert_eq!(dropped, ["TLA 3.0", "GRT 2"]);
    for (from, to, expected) in [
        ("EBR 5.0", "EBR wide", "line 3, EBR: found `wide`; expected a number"),
        ("EBR 5.0", "", "expected EBR or NAO"),
        ("EBR 5.0", "EBR -5", "expected more than 0"),
        ("TH 6.00755", "TH 1e300", "found `1e300`"),
        ("UNI 1.0", "UNI 0", "expected more than 0"),
        ("AP 6.7", "PK CV 1.5", "expected the number of a surface"),
    ] {
        let error = files::parse(text().replacen(from, to, 1).as_bytes(), "a.len").unwrap_err();
        assert!(error.to_string().contains(expected), "{to}: {error}");
    }
    assert!(files::parse(b"LEN NEW \"x\"\nEBR 1\nNXT\nEND", "a.len").is_err());
}

#[test]
fn an_object_nearby_has_the_aperture_of_its_beam() {
    let near = read(&text().replace("TH 1.0e+20", "TH 100.0").replace("ANG 20.0", "OBH 10.0"));
    let Aperture::ObjectNa(na) = near.lens.aperture else { panic!("{:?}", near.lens.aperture) };
    assert!((na - 5.0 / 5.0_f64.hypot(100.0)).abs() < 1e-15);
    assert_eq!(near.lens.object, Object::Finite(100.0));
    assert_eq!(
        (near.lens.fields.kind, near.lens.fields.values[2].y),
        (FieldKind::ObjectHeight, 10.0)
    );
}

#[test]
fn a_glass_may_have_indices_instead_of_a_name() {
    let medium = |glass: &str| {
        let text =
            text().replacen("WV 0.55 0.48 0.65\n", "", 1).replacen("WW 1.0 0.5 0.5\n", "", 1);
        read(&text.replacen("GLA F2", glass, 1)).lens.surfaces[2].medium.clone()
    };
    assert_eq!(medium("GLA 1.5168"), Medium::Index(1.5168));
    assert_eq!(medium("GLA MOD 1.62 36.4"), Medium::Model { nd: 1.62, vd: 36.4 });
    let Medium::Model { nd, vd, .. } = medium("GLA MOD MINE 1.62 1.63 1.61") else { panic!() };
    assert!(nd == 1.62 && (vd - 0.62 / 0.02).abs() < 1e-9);
    let wrong = text().replacen("GLA F2", "GLA MOD", 1);
    let error = files::parse(wrong.as_bytes(), "a.len").unwrap_err().to_string();
    assert!(error.contains("expected a glass or indices"), "{error}");
}

#[test]
fn the_image_may_stand_beside_the_focus() {
    let shifted = text().replace("// SRF 7\nAIR", "// SRF 7\nAIR\nTH 0.25");
    let lens = read(&shifted).lens;
    assert!((lens.surfaces[5].thickness - (42.20778 + 0.25)).abs() < 1e-12);
    let solved = read(&shifted.replace("TH 42.20778", "PY 0.0")).lens;
    assert_eq!(solved.image_solve, Some(0.25));
    // The row shows where the focus is.
    let focus = read(&text().replace("TH 42.20778", "PY 0.0")).lens.surfaces[5].thickness;
    assert!((solved.surfaces[5].thickness - focus - 0.25).abs() < 1e-9 && focus > 40.0);
    let far = read(&text().replace("TH 1.0e+20", "TH 9.9999999996e+09")).lens;
    assert_eq!(far.object, Object::Infinity);
}
