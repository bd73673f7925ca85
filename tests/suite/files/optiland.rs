//! The lenses of Optiland, on files written for the tests and by this program.

use aplanat::files::{self, ConversionOutcome, LensFormat, OpenedLens};
use aplanat::lens::{
    Aperture, ApertureShape, FieldKind, FreeformKind, IdealElement, Lens, Medium, Object,
    SurfaceAperture,
};
use aplanat::math::Vec3;

/// A geometry at a place along z, with its other entries.
fn surface(z: f64, geometry: &str, material: &str, more: &str) -> String {
    let cs = format!(
        r#"{{"x": 0.0, "y": 0.0, "z": {z}, "rx": 0.0, "ry": 0.0, "rz": 0.0, "reference_cs": null}}"#
    );
    format!(
        r#"{{"type": "Surface", "thickness": 0.0, "geometry": {{"cs": {cs}, {geometry}}},
        "material_post": {material}, "is_stop": false, "aperture": null, "comment": ""{more}}}"#
    )
}

const AIR: &str = r#"{"type": "IdealMaterial", "index": 1.0, "absorp": 0.0}"#;
const PLANE: &str = r#""type": "Plane", "radius": Infinity"#;

/// A file with the surfaces behind the object.
fn file(surfaces: &[String]) -> String {
    let object = format!(
        r#"{{"type": "ObjectSurface", "geometry": {{"type": "Plane", "cs": {{"x": 0.0, "y": 0.0,
        "z": -Infinity, "rx": 0.0, "ry": 0.0, "rz": 0.0, "reference_cs": null}}, "radius": Infinity}},
        "material_post": {AIR}, "comment": ""}}"#
    );
    format!(
        r#"{{"version": 1.0, "name": "A lens", "aperture": {{"type": "imageFNO", "value": 4.0}},
        "fields": {{"fields": [{{"x": 0.0, "y": 0.0, "vx": 0.0, "vy": 0.0}},
            {{"x": 3.0, "y": 4.0, "vx": 0.0, "vy": 0.25}}],
            "telecentric": false, "field_definition": {{"field_type": "AngleField"}}}},
        "wavelengths": {{"wavelengths": [
            {{"value": 486.1327, "is_primary": false, "unit": "nm"}},
            {{"value": 0.5875618, "is_primary": true, "unit": "um"}}], "polarization": "ignore"}},
        "apodization": null, "pickups": [], "solves": {{"solves": [{{}}]}},
        "surface_group": {{"surfaces": [{object}, {}]}}}}"#,
        surfaces.join(", ")
    )
}

fn open(text: &str) -> OpenedLens {
    files::parse(text.as_bytes(), "folder/a.json").unwrap_or_else(|error| panic!("{error}"))
}

/// A singlet of a glass by name, whose front has this geometry.
fn singlet(geometry: &str) -> String {
    let glass = r#"{"type": "Material", "name": "N-BK7", "reference": "schott"}"#;
    let rim = r#", "aperture": {"type": "RadialAperture", "r_max": 6.0, "r_min": 0.5}"#;
    let front = surface(2.0, geometry, glass, "").replace(r#", "aperture": null"#, rim);
    let front = front.replace(r#""is_stop": false"#, r#""is_stop": true"#);
    let back =
        surface(5.0, r#""type": "StandardGeometry", "radius": -40.0, "conic": -1.5"#, AIR, "");
    file(&[front, back, surface(45.0, PLANE, AIR, "")])
}

#[test]
fn a_lens_is_what_its_file_says() {
    let opened = open(&singlet(
        r#""type": "EvenAsphere", "radius": 50.0, "conic": -0.5,
        "coefficients": [0.0, 1e-5, -2e-8, 0.0]"#,
    ));
    assert_eq!(opened.format, LensFormat::Optiland);
    let lens = &opened.lens;
    assert_eq!((lens.name.as_str(), lens.object), ("A lens", Object::Infinity));
    assert_eq!((lens.aperture, lens.fields.kind), (Aperture::FNumber(4.0), FieldKind::Angle));
    let [x, y] = lens.fields.projected_points()[1];
    assert!((x - 3.0).abs() < 1e-12 && (y - 4.0).abs() < 1e-12);
    let waves: Vec<f64> = lens.wavelengths.iter().map(|wave| wave.um).collect();
    assert!((waves[0] - 0.4861327).abs() < 1e-15 && lens.primary() == 1);
    let [front, back] = &lens.surfaces[..] else { panic!() };
    assert_eq!((front.curvature, front.conic, front.thickness), (1.0 / 50.0, -0.5, 3.0));
    assert_eq!((&front.asphere[..], front.stop), (&[1e-5, -2e-8][..], true));
    assert_eq!(front.medium, Medium::Glass("SCHOTT N-BK7".to_owned()));
    assert_eq!((front.semi_diameter, front.obstruction), (Some(6.0), Some(0.5)));
    assert_eq!((back.curvature, back.conic, back.thickness), (-1.0 / 40.0, -1.5, 40.0));
    let report = opened.report.unwrap();
    let outcome = |text: &str| report.rows.iter().find(|row| row.text == text).unwrap().outcome;
    assert_eq!(outcome("vignetting factors"), ConversionOutcome::Dropped);
    assert_eq!(outcome("solves"), ConversionOutcome::Approximated);
}

/// Figures and what is common to two of them or in one alone, here and back.
#[test]
fn apertures_of_every_form_are_read_and_written_again() {
    let read = |aperture: &str| {
        let radial = r#"{"type": "RadialAperture", "r_max": 6.0, "r_min": 0.5}"#;
        let opened = open(&singlet(PLANE).replace(radial, aperture));
        let row = opened.lens.surfaces[0].clone();
        let texts: Vec<String> = row.apertures.iter().map(ToString::to_string).collect();
        let dropped = opened.report.unwrap().count(ConversionOutcome::Dropped);
        // One for the vignetting factors.
        if dropped == 1 {
            let path = super::folder("optiland-figures").join("a.optiland.json");
            files::save(&opened.lens, &path).unwrap();
            let back = files::open(&path).unwrap().lens.surfaces[0].clone();
            assert_eq!(back.apertures, row.apertures, "{aperture}");
            assert_eq!(back.semi_diameter, row.semi_diameter, "{aperture}");
            assert_eq!(back.obstruction, row.obstruction, "{aperture}");
        }
        ((row.semi_diameter, row.obstruction), texts.join("; "), dropped)
    };
    let rectangle =
        r#"{"type": "RectangularAperture", "x_min": -3, "x_max": 1, "y_min": -2, "y_max": 2}"#;
    let ellipse =
        r#"{"type": "EllipticalAperture", "a": 2, "b": 1, "offset_x": 0.5, "offset_y": 0}"#;
    let ring =
        r#"{"type": "OffsetRadialAperture", "r_max": 4, "r_min": 1, "offset_x": 1, "offset_y": 2}"#;
    let polygon = r#"{"type": "PolygonAperture", "x": [0, -4, 4], "y": [5, -3, -3]}"#;
    let circle = r#"{"type": "RadialAperture", "r_max": 5.0, "r_min": 0.0}"#;
    let pair = |kind: &str, a: &str, b: &str| {
        format!(r#"{{"type": "{kind}Aperture", "a": {a}, "b": {b}}}"#)
    };
    let none = (None, None);
    for (aperture, sizes, text) in [
        (rectangle.to_owned(), none, "rectangle ±2 x ±2 at -1, 0"),
        (ellipse.to_owned(), none, "ellipse ±2 x ±1 at 0.5, 0"),
        (ring.to_owned(), none, "obscuring circle ±1 at 1, 2; circle ±4 at 1, 2"),
        (polygon.to_owned(), none, "polygon (0, 5) (-4, -3) (4, -3)"),
        (pair("Intersection", circle, rectangle), (Some(5.0), None), "rectangle ±2 x ±2 at -1, 0"),
        (
            pair("Difference", circle, ellipse),
            (Some(5.0), None),
            "obscuring ellipse ±2 x ±1 at 0.5, 0",
        ),
        (
            pair("Difference", rectangle, &pair("Union", ellipse, polygon)),
            none,
            "rectangle ±2 x ±2 at -1, 0; \
             obscuring ellipse ±2 x ±1 at 0.5, 0; obscuring polygon (0, 5) (-4, -3) (4, -3)",
        ),
    ] {
        assert_eq!(read(&aperture), (sizes, text.to_owned(), 1), "{aperture}");
    }
    // What is in one of two alone, or in either, is no such aperture.
    assert_eq!(read(&pair("Union", circle, rectangle)), (none, String::new(), 2));
    assert_eq!(read(&pair("Difference", circle, ring)), (none, String::new(), 2));
    // A spider is written as rectangles.
    let mut lens = open(&singlet(PLANE)).lens;
    let arms = ApertureShape::Spider { arms: 3, width: 0.5 };
    lens.surfaces[0].apertures = vec![SurfaceAperture::obscuration(arms)];
    let path = super::folder("optiland-arms").join("a.optiland.json");
    files::save(&lens, &path).unwrap();
    assert_eq!(files::open(&path).unwrap().lens.surfaces[0].apertures.len(), 3);
}

#[test]
fn a_curved_image_is_said_to_be_flat() {
    let plane = singlet(PLANE);
    let end = plane.rfind(PLANE).unwrap();
    let curved = r#""type": "StandardGeometry", "radius": -100.0, "conic": 0.0"#;
    let text = format!("{}{curved}{}", &plane[..end], &plane[end + PLANE.len()..]);
    let dropped = |text: &str| {
        let report = open(text).report.unwrap();
        report.rows.iter().any(|row| row.text == "image")
    };
    assert!(dropped(&text) && !dropped(&plane));
}

#[test]
fn geometries_are_forms_or_locked() {
    let kind = |geometry: &str| {
        let lens = open(&singlet(geometry)).lens;
        let row = lens.surfaces[0].clone();
        (row.freeform.map(|form| (form.kind, form.numbers)), row.locked.map(|own| own.kind))
    };
    let odd =
        r#""type": "OddAsphere", "radius": 50.0, "conic": 0.0, "coefficients": [0.0, 0.0, 1e-4]"#;
    assert_eq!(kind(odd).0, Some((FreeformKind::OddAsphere, vec![0.0, 0.0, 1e-4])));
    let table = r#""type": "PolynomialGeometry", "radius": 50.0, "conic": 0.0,
        "coefficients": [[0.0, 0.01], [0.0, 2e-3]]"#;
    let numbers = vec![0.0, 0.01, 0.0, 2e-3];
    assert_eq!(kind(table).0, Some((FreeformKind::XyPolynomial { radius: 1.0 }, numbers)));
    let toroid = r#""type": "ToroidalGeometry", "radius": 50.0, "conic": 0.0, "radius_x": 25.0,
        "radius_y": 50.0, "conic_yz": -1.0, "coeffs_poly_y": [0.0, 1e-6]"#;
    assert_eq!(kind(toroid).0, Some((FreeformKind::Toroid, vec![0.04, 0.0, 1e-6])));
    let cylinder = r#""type": "BiconicGeometry", "radius_x": Infinity, "radius_y": 50.0,
        "conic_x": 0.0, "conic_y": -0.5"#;
    assert_eq!(kind(cylinder).0, Some((FreeformKind::Biconic, vec![0.0, 0.0])));
    // The sum of two profiles is no biconic of the kind that is traced here.
    let sum = cylinder.replace("Infinity", "30.0");
    assert_eq!(kind(&sum), (None, Some("BiconicGeometry".to_owned())));
    let piston = table.replace("[[0.0", "[[0.5");
    assert_eq!(kind(&piston).1, Some("PolynomialGeometry".to_owned()));
    let other = r#""type": "GridSagGeometry", "radius": 50.0"#;
    assert_eq!(kind(other).1, Some("GridSagGeometry".to_owned()));
}

/// Places are rotations about x, then the fixed y and z; a surface between two that stand on one axis leaves
/// the axis as it is.
#[test]
fn surfaces_stand_where_the_file_puts_them() {
    let turned = |z: f64, words: &str, more: &str| {
        let cs = r#""rx": 0.0, "ry": 0.0, "rz": 0.0"#;
        let mirror = r#", "interaction_model": {"type": "RefractiveReflectiveModel",
            "is_reflective": true, "coating": null, "bsdf": null}"#;
        surface(z, PLANE, AIR, if more.is_empty() { "" } else { mirror }).replace(cs, words)
    };
    let all = [
        turned(0.0, r#""rx": 0.0, "ry": 0.0, "rz": 0.0"#, ""),
        turned(10.0, r#""rx": 0.1, "ry": -0.2, "rz": 0.3"#, ""),
        turned(20.0, r#""rx": 0.0, "ry": 0.0, "rz": 0.0"#, ""),
        turned(50.0, r#""rx": 0.4, "ry": 0.0, "rz": 0.0"#, "mirror"),
        turned(30.0, r#""rx": 0.8, "ry": 0.0, "rz": 0.0"#, ""),
    ];
    let lens = open(&file(&all)).lens;
    assert_eq!(lens.surfaces[3].medium, Medium::Mirror);
    assert_eq!(lens.surfaces[1].thickness, 10.0);
    let system = lens.resolve(0, 0.5875618).unwrap();
    let frames = system.frames();
    let stand = |i: usize| system.surfaces[i].pose.map_or(frames[i], |pose| frames[i].then(&pose));
    let near = |a: Vec3<f64>, b: Vec3<f64>| (a - b).dot(a - b).sqrt() < 1e-12;
    for (i, z) in [0.0, 10.0, 20.0, 50.0, 30.0].into_iter().enumerate() {
        assert!(near(stand(i).shift, Vec3::new(0.0, 0.0, z)), "{i}: {:?}", stand(i));
    }
    // A point on the own z axis of the second surface, turned about x, y and z in this order.
    let [(sx, cx), (sy, cy), (sz, cz)] = [0.1, -0.2, 0.3].map(f64::sin_cos);
    let after_x = Vec3::new(0.0, -sx, cx);
    let after_y =
        Vec3::new(cy * after_x.x + sy * after_x.z, after_x.y, cy * after_x.z - sy * after_x.x);
    let after_z =
        Vec3::new(cz * after_y.x - sz * after_y.y, sz * after_y.x + cz * after_y.y, after_y.z);
    assert!(near(stand(1).direction_out(Vec3::new(0.0, 0.0, 1.0)), after_z));
    let image = stand(4).direction_out(Vec3::new(0.0, 0.0, 1.0));
    assert!(near(image, Vec3::new(0.0, -0.8_f64.sin(), 0.8_f64.cos())));
}

#[test]
fn lenses_are_written_and_read_back() {
    let folder = super::folder("optiland");
    let mut written = 0;
    for bundled in files::bundled_lenses() {
        let lens = files::json::read(bundled.text, bundled.name).unwrap();
        let path = folder.join(format!("{}.optiland.json", bundled.name));
        let graded = lens.surfaces.iter().any(|row| matches!(row.medium, Medium::Grin(_)));
        match files::save(&lens, &path) {
            Ok(saved) => {
                assert_eq!(saved.format, LensFormat::Optiland);
                assert!(saved.proof.unwrap().worst_mm < 1e-9, "{}", bundled.name);
                let back = files::open(&path).unwrap().lens;
                let media = |lens: &Lens| -> Vec<Medium> {
                    lens.surfaces.iter().map(|row| row.medium.clone()).collect()
                };
                assert_eq!(media(&back), media(&lens), "{}", bundled.name);
                written += 1;
            }
            Err(error) => {
                assert!(graded || lens.zoom.len() > 1, "{}: {error}", bundled.name);
            }
        }
    }
    assert!(written > 15, "{written}");
    // The mirror of the other program: tilts, a mirror and a thin lens.
    let mut lens = files::parse(&super::foreign("tilted.seq"), "tilted.seq").unwrap().lens;
    lens.surfaces[4].medium = Medium::Air;
    lens.surfaces[4].curvature = 0.0;
    lens.surfaces[4].ideal = Some(IdealElement::Lens { focal_length: 300.0 });
    let saved = files::save(&lens, folder.join("tilted.optiland.json")).unwrap();
    let proof = saved.proof.unwrap();
    assert!(proof.worst_mm < 1e-9 && proof.imaged > 0, "{proof}");
}

#[test]
fn malformed_files_are_refused_by_name() {
    for (from, to, place) in [
        ("\"imageFNO\"", "\"other\"", "aperture"),
        ("4.0}", "-4.0}", "aperture"),
        ("AngleField", "OtherField", "fields"),
        ("\"surfaces\": [", "\"surface\": [", "surface_group"),
    ] {
        let text = singlet(r#""type": "Plane""#);
        assert!(text.contains(from), "{from}");
        let error = files::parse(text.replacen(from, to, 1).as_bytes(), "a.json").unwrap_err();
        assert!(error.to_string().contains(place), "{error}");
    }
}
