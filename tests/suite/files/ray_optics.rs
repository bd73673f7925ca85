//! The meaning of a model of ray-optics, on a file written for the tests.

use super::foreign;
use aplanat::files::{self, ConversionOutcome, LensFormat};
use aplanat::lens::{Aperture, FieldKind, Medium, Object};

fn text() -> String {
    String::from_utf8(foreign("doublet.roa")).unwrap()
}

#[test]
fn a_model_is_read() {
    let opened = files::parse(text().as_bytes(), "a.roa").unwrap();
    assert_eq!(opened.format, LensFormat::RayOptics);
    let lens = opened.lens;
    assert_eq!(lens.name, "Doublet written for the tests of this program");
    assert_eq!((lens.object, lens.stop()), (Object::Infinity, Some(0)));
    assert_eq!(lens.aperture, Aperture::EntrancePupilDiameter(8.0));
    let field = lens.fields.values[1];
    assert_eq!((lens.fields.kind, field.y, field.weight), (FieldKind::Angle, 2.0, 0.5));
    assert_eq!((lens.wavelengths.len(), lens.primary()), (3, 1));
    let front = &lens.surfaces[0];
    assert_eq!((front.curvature, front.conic, front.semi_diameter), (0.02, -0.5, Some(7.0)));
    // Coefficients of r^2, r^4, ...; that of r^2 is 0.
    assert_eq!(front.asphere, [1e-6, -2e-9]);
    assert_eq!(front.medium, Medium::Glass("SCHOTT N-BK7".to_owned()));
    assert_eq!(lens.surfaces[1].medium, Medium::Model { nd: 1.62, vd: 36.4 });
    let mirror = &lens.surfaces[2];
    assert_eq!((&mirror.medium, mirror.thickness), (&Medium::Mirror, -20.0));
    // Angles about x are left-handed there.
    for turn in [mirror.break_before, mirror.break_after] {
        assert!((turn.unwrap().tilt[0] + 45.0).abs() < 1e-12);
    }
    let locked = lens.surfaces[3].locked.as_ref().unwrap();
    assert_eq!(locked.kind, "ThinLens");
    let report = opened.report.unwrap();
    assert_eq!(report.count(ConversionOutcome::Locked), 1);
}

#[test]
fn odd_powers_are_locked_and_missing_parts_named() {
    let odd = text().replace("EvenPolynomial", "RadialPolynomial");
    let opened = files::parse(odd.as_bytes(), "a.roa").unwrap();
    assert_eq!(
        opened.lens.surfaces[0].locked.as_ref().unwrap().kind,
        "RadialPolynomial with a term in r^2"
    );
    let infinite =
        text().replace("\"interact_mode\"", "\"max_aperture\": -Infinity, \"interact_mode\"");
    let read = |text: &str| files::parse(text.as_bytes(), "a.roa").unwrap().lens;
    assert_eq!(read(&infinite).surfaces[..3], read(&text()).surfaces[..3]);
    for (from, to, expected) in [
        ("\"ifcs\"", "\"surfaces\"", "0 surfaces and 5 gaps"),
        ("\"value\": 8.0", "\"value\": -8.0", "found the aperture -8"),
        ("\"epd\"", "\"size\"", "expected epd, f/# or NA"),
        ("\"angle\"]", "\"slope\"]", "expected angles"),
        ("\"mm\"", "\"parsec\"", "the unit `parsec`"),
        ("\"ifcs\": [", "\"ifcs\": ", "line"),
    ] {
        let text = text();
        assert!(text.contains(from), "{from}");
        let error = files::parse(text.replacen(from, to, 1).as_bytes(), "a.roa").unwrap_err();
        assert!(error.to_string().contains(expected), "{to}: {error}");
    }
}
