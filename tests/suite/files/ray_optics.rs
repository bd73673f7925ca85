//! The meaning of a model of ray-optics, on a file written for the tests.

use super::foreign;
use aplanat::files::{self, ConversionOutcome, LensFormat};
use aplanat::lens::{
    Aperture, ApertureShape, FieldKind, FreeformKind, IdealElement, Medium, Object, SurfaceAperture,
};
use serde_json::Value;

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
    let thin = IdealElement::Lens { focal_length: 100.0 };
    assert_eq!(lens.surfaces[3].ideal, Some(thin));
    let report = opened.report.unwrap();
    assert_eq!(report.count(ConversionOutcome::Locked), 0);
    assert_eq!(report.count(ConversionOutcome::Approximated), 1);
}

/// Apertures of every form, decentred, turned and as obscurations, here and back.
#[test]
fn apertures_of_every_form_are_read_and_written_again() {
    let figure =
        |shape, center, angle| SurfaceAperture { center, angle, ..SurfaceAperture::inside(shape) };
    let rectangle = ApertureShape::Rectangle { half_width: 3.0, half_height: 2.0 };
    let ellipse = ApertureShape::Ellipse { half_width: 1.0, half_height: 0.5 };
    let mut lens = files::parse(text().as_bytes(), "a.roa").unwrap().lens;
    // No file of the format has a paraxial lens.
    lens.surfaces[3].ideal = None;
    lens.surfaces[0].obstruction = Some(0.25);
    lens.surfaces[0].apertures = vec![
        figure(rectangle, [0.5, -0.25], 20.0),
        SurfaceAperture::obscuration(ellipse),
        figure(ApertureShape::Circle { radius: 4.0 }, [1.0, 0.0], 0.0),
    ];
    let path = super::folder("roa-figures").join("a.roa");
    files::save(&lens, &path).unwrap();
    let opened = files::open(&path).unwrap();
    let back = &opened.lens.surfaces[0];
    assert_eq!(back.apertures, lens.surfaces[0].apertures);
    assert_eq!((back.semi_diameter, back.obstruction), (Some(7.0), Some(0.25)));
    let report = opened.report.unwrap();
    let traced = report.rows.iter().filter(|row| row.note.ends_with(": traced"));
    assert_eq!(traced.count(), 3);
    let arms = ApertureShape::Spider { arms: 3, width: 0.5 };
    lens.surfaces[0].apertures = vec![SurfaceAperture::obscuration(arms)];
    let refused = files::save(&lens, &path).unwrap_err().to_string();
    assert!(refused.contains("an aperture, a polygon or arms, of surface 1"), "{refused}");
}

/// Coefficients are optical paths in the unit of the file at the wavelength of the element.
#[test]
fn a_radial_phase_is_read() {
    let element = |function: &str| {
        format!(
            "\"phase_element\": {{\"__instance_type__\": [\"rayoptics.oprops.doe\", \
             \"DiffractiveElement\"], \"attributes\": {{\"coefficients\": [-0.005, 1e-6], \
             \"ref_wl\": 500.0, \"order\": 1, \"phase_fct_name\": \"{function}\"}}}}, \
             \"label\": \"front\""
        )
    };
    let read = |function: &str| {
        let text = text().replace("\"label\": \"front\"", &element(function));
        files::parse(text.as_bytes(), "a.roa").unwrap().lens.surfaces[0].clone()
    };
    let row = read("radial_phase_fct");
    let form = row.freeform.unwrap();
    assert_eq!(form.kind, FreeformKind::RadialPhase { radius: 1.0, order: 1.0 });
    let waves = form.numbers.iter().map(|a| a / std::f64::consts::TAU).collect::<Vec<f64>>();
    assert!((waves[0] + 10.0).abs() < 1e-12 && (waves[1] - 2e-3).abs() < 1e-15, "{waves:?}");
    assert_eq!((row.locked, row.asphere), (None, vec![1e-6, -2e-9]));
    assert_eq!(read("another_fct").locked.unwrap().kind, "DiffractiveElement");
}

#[test]
fn odd_powers_are_read_and_what_is_missing_or_unknown_is_named() {
    let first = |profile: &str| {
        let text = text().replace("EvenPolynomial", profile);
        files::parse(text.as_bytes(), "a.roa").unwrap().lens.surfaces[0].clone()
    };
    let odd = first("RadialPolynomial").freeform.unwrap();
    assert_eq!((odd.kind, &odd.numbers[..]), (FreeformKind::OddAsphere, &[0.0, 1e-6, -2e-9][..]));
    assert_eq!(first("YToroid").locked.unwrap().kind, "YToroid");
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

/// A lens has 1000 surfaces at most, with those of the object and of the image in a file.
#[test]
fn a_model_has_as_many_surfaces_as_a_lens() {
    let with = |count: usize| {
        let mut file: Value = serde_json::from_str(&text()).unwrap();
        let model = &mut file["optical_model"]["attributes"]["seq_model"]["attributes"];
        for (list, more) in [("ifcs", count - 6), ("gaps", count - 6)] {
            let list = model[list].as_array_mut().unwrap();
            // Behind the second surface of the lens, where its glass goes on.
            let again = list[2].clone();
            list.splice(2..2, std::iter::repeat_n(again, more));
        }
        files::parse(file.to_string().as_bytes(), "a.roa")
    };
    assert_eq!(with(1000).unwrap().lens.surfaces.len(), 998);
    let error = with(1001).unwrap_err().to_string();
    assert!(error.contains("1001 surfaces") && error.contains("998"), "{error}");
}
