//! Lenses at other temperatures: closed forms, derivatives, files, and refusals by name.

use super::merit::{bundled, check_term, step};
use aplanat::lens::{
    Aperture, Environment, Lens, LensError, Medium, ParameterKind, Row, add_variables, glass,
    paraxial_image_distance,
};
use aplanat::merit::{
    Goal, LimitTreatment, Merit, MeritError, OperandKind, PupilEdge, Term, WeightedTerm,
};
use aplanat::optimize::{DescentMethod, start};
use serde_json::Value;
use std::process::Command;

const TERM: Term = Term::Operand { kind: OperandKind::ThermalFocus, min: None, max: None };

fn goal(terms: Vec<WeightedTerm>) -> Goal {
    let limits = LimitTreatment::Constraints;
    Goal { terms, pupil: PupilEdge::Frozen, zoom_ratios: Vec::new(), limits }
}

fn thermal_focus(lens: &Lens) -> Result<f64, MeritError> {
    let merit = Merit::new(lens, &goal(vec![WeightedTerm::new(TERM, 1.0)]), 1e-3)?;
    Ok(merit.operand_margins(&merit.values(lens))?[0].value)
}

/// The paraxial image from the image plane, in mm.
fn defocus(lens: &Lens) -> f64 {
    let system = lens.resolve(0, lens.wavelengths[lens.primary()].um).unwrap();
    let gap = system.surfaces[system.surfaces.len() - 2].thickness;
    paraxial_image_distance(&system, lens.object) - gap
}

/// A thin lens of one glass with a focal length of 100 mm.
fn thin_lens(name: &str) -> Lens {
    let mut lens = bundled("achromat_ac254_100");
    lens.wavelengths.retain(|wavelength| wavelength.primary);
    lens.wavelengths[0].um = glass::line::D;
    lens.fields.values.truncate(1);
    lens.aperture = Aperture::EntrancePupilDiameter(0.1);
    lens.variables.clear();
    let curvature = 0.005 / (glass::find(name).unwrap().index(glass::line::D).unwrap() - 1.0);
    let row = |curvature, medium, thickness| Row { curvature, medium, thickness, ..Row::default() };
    lens.surfaces =
        vec![row(curvature, Medium::Glass(name.into()), 1e-7), row(-curvature, Medium::Air, 100.0)];
    lens.surfaces[0].stop = true;
    lens
}

/// A thin lens in air changes its focal length by `(α − (dn/dT)/(n − 1)) f` per kelvin, and the mount its
/// distance from the image plane by `α_m f` (Rogers and Roberts, *Handbook of Optics*, volume I, 1995,
/// chapter 39).
#[test]
fn a_thin_lens_defocuses_by_its_opto_thermal_constant() {
    for name in ["SCHOTT N-BK7", "SCHOTT N-FK51A", "OHARA S-FPL53", "CDGM H-ZF52"] {
        let mut lens = thin_lens(name);
        lens.environment.mount_expansion = 13.0;
        let material = glass::find(name).unwrap();
        let known = material.properties().unwrap();
        let at = |celsius| material.index_at(glass::line::D, celsius).unwrap();
        let slope = (at(40.0) - at(0.0)) / 40.0;
        let (n, expansion) = (at(20.0), 1e-6 * known.expansion.unwrap());
        let expected = 40.0 * 100.0 * (expansion - slope / (n - 1.0) - 13e-6);
        let found = thermal_focus(&lens).unwrap();
        assert!(
            (found - expected).abs() < 2e-3 * expected.abs() + 1e-6,
            "{name} {found} {expected}"
        );
        // The same by two lenses at these temperatures.
        let [cold, warm] = [0.0, 40.0].map(|celsius| lens.at_temperature(0, celsius).unwrap());
        let difference = defocus(&warm) - defocus(&cold);
        assert!((found - difference).abs() < 1e-9, "{name} {found} {difference}");
    }
}

/// The object may lie in glass, whose index changes too; a mirror in front of the lens keeps that index.
#[test]
fn an_object_in_glass_is_warmed_with_the_lens() {
    let mut lens = thin_lens("SCHOTT N-SF11");
    lens.object_medium = Medium::Glass("SCHOTT N-BK7".to_owned());
    let found = thermal_focus(&lens).unwrap();
    let [cold, warm] = [0.0, 40.0].map(|celsius| lens.at_temperature(0, celsius).unwrap());
    let difference = defocus(&warm) - defocus(&cold);
    assert!((found - difference).abs() < 1e-9, "{found} {difference}");
    let in_air = thermal_focus(&thin_lens("SCHOTT N-SF11")).unwrap();
    assert!((found - in_air).abs() > 1e-4, "{found} {in_air}");
}

/// What grows as a whole stays in focus: in a telescope whose mirrors are of the mount's material all lengths
/// grow alike, a defocus that it has included.
#[test]
fn a_telescope_of_one_material_is_athermal() {
    let lens = bundled("telescope_rc_f8");
    let focal = |lens: &Lens| defocus(lens);
    for celsius in [-100.0, 0.0, 60.0, 140.0] {
        let other = lens.at_temperature(0, celsius).unwrap();
        let grown = 1.0 + 23.6e-6 * (celsius - 20.0);
        assert!((focal(&other) - grown * focal(&lens)).abs() < 1e-9, "{celsius}");
        let ratio = other.surfaces[0].thickness / lens.surfaces[0].thickness;
        assert!((ratio - grown).abs() < 1e-12, "{ratio} {grown}");
    }
    assert!((thermal_focus(&lens).unwrap() - 40.0 * 23.6e-6 * focal(&lens)).abs() < 1e-9);
}

/// At the temperature for which a prescription holds nothing changes.
#[test]
fn room_temperature_changes_nothing() {
    let lens = bundled("double_gauss_rudolph_50");
    let mut named = lens.clone();
    for row in &mut named.surfaces {
        if let Medium::Model { nd, vd } = row.medium {
            let nearest = glass::catalogue()
                .iter()
                .filter(|glass| glass.manufacturer == "SCHOTT")
                .min_by(|a, b| glass::distance(a, nd, vd).total_cmp(&glass::distance(b, nd, vd)));
            row.medium = Medium::Glass(nearest.unwrap().full_name());
        }
    }
    let same = named.at_temperature(0, 20.0).unwrap();
    for (a, b) in named.surfaces.iter().zip(&same.surfaces) {
        assert!((a.curvature - b.curvature).abs() <= 1e-15 * a.curvature.abs());
        assert!((a.thickness - b.thickness).abs() <= 1e-12);
        assert_eq!(a.semi_diameter, b.semi_diameter);
    }
    assert!((defocus(&same) - defocus(&named)).abs() < 1e-9);
}

/// The gap between two steep surfaces follows the mount at their rims and not at their vertices.
#[test]
fn an_air_gap_is_held_at_the_rims() {
    let mut lens = thin_lens("SCHOTT N-BK7");
    lens.environment.mount_expansion = 0.0;
    lens.surfaces[1].semi_diameter = Some(12.0);
    let sag = lens.resolve(0, glass::line::D).unwrap().surfaces[1].shape.sag(144.0).unwrap().0;
    let warm = lens.at_temperature(0, 60.0).unwrap();
    let growth = 7.1e-6 * 40.0;
    // The rim stays, and the vertex moves by the growth of the sag, away from the image where it is concave
    // towards the glass.
    let moved = warm.surfaces[1].thickness - 100.0;
    assert!((moved - sag * growth).abs() < 1e-12, "{moved} {}", sag * growth);
}

#[test]
fn derivatives_of_the_thermal_focus_agree_with_differences() {
    let mut lens = with_catalogue_glass(bundled("tessar_50_f28"));
    lens.variables.clear();
    for kind in
        [ParameterKind::Curvatures, ParameterKind::Thicknesses, ParameterKind::SemiDiameters]
    {
        add_variables(&mut lens, &[kind]);
    }
    let target = Term::Operand { kind: OperandKind::ThermalFocus, min: Some(0.1), max: Some(0.1) };
    check_term(&lens, WeightedTerm::new(target, 1.0), PupilEdge::Frozen, step);
}

/// The lens with the nearest Schott glasses in place of model glasses.
fn with_catalogue_glass(mut lens: Lens) -> Lens {
    for row in &mut lens.surfaces {
        if let Medium::Model { nd, vd } = row.medium {
            let schott = glass::catalogue().iter().filter(|glass| glass.manufacturer == "SCHOTT");
            let off = |glass: &&glass::Glass| glass::distance(glass, nd, vd);
            let nearest = schott.min_by(|a, b| off(a).total_cmp(&off(b)));
            row.medium = Medium::Glass(nearest.unwrap().full_name());
        }
    }
    lens
}

/// An optimizer moves the focus of a triplet with temperature to what is asked for, at one wavelength.
#[test]
fn an_optimizer_keeps_a_limit_of_thermal_focus() {
    let mut lens = with_catalogue_glass(bundled("cooke_triplet_100_f27"));
    lens.wavelengths = vec![lens.wavelengths[lens.primary()]];
    lens.variables.clear();
    add_variables(&mut lens, &[ParameterKind::Curvatures, ParameterKind::Thicknesses]);
    let before = thermal_focus(&lens).unwrap();
    let asked = 0.9 * before;
    let kind = OperandKind::ThermalFocus;
    let thermal = Term::Operand { kind, min: Some(asked), max: Some(asked) };
    let terms = vec![
        WeightedTerm::new(Term::Spot, 1.0),
        WeightedTerm::new(Term::FocalLength(100.0), 1.0),
        WeightedTerm::new(thermal, 1.0),
    ];
    let mut optimizer = start(DescentMethod::TrustRegion, &lens, &goal(terms), 1e-3).unwrap();
    for _ in 0..400 {
        if optimizer.step().finished {
            break;
        }
    }
    optimizer.verify_best();
    let after = thermal_focus(optimizer.best()).unwrap();
    assert!((after - asked).abs() <= 1e-9, "{before} {asked} {after}");
}

#[test]
fn what_is_unknown_is_refused_by_name() {
    let lens = bundled("tessar_50_f28");
    let mut model = lens.clone();
    model.surfaces[0].medium = Medium::Model { nd: 1.6, vd: 50.0 };
    let refused = model.at_temperature(0, 40.0).unwrap_err();
    assert!(matches!(refused, LensError::NoThermalData { .. }), "{refused}");
    assert!(refused.to_string().contains("nd 1.6"), "{refused}");
    assert!(matches!(
        thermal_focus(&model),
        Err(MeritError::Lens(LensError::NoThermalData { .. }))
    ));
    model.environment = Environment { celsius: Some(40.0), ..Environment::default() };
    assert!(matches!(model.resolve(0, 0.5876), Err(LensError::NoThermalData { .. })));
    let mut gradient = bundled("grin_rod_melles_griot");
    gradient.environment.celsius = Some(40.0);
    assert!(matches!(gradient.resolve(0, 0.5876), Err(LensError::NoThermalData { .. })));
    for celsius in [-101.0, 141.0, f64::NAN, f64::INFINITY] {
        assert!(
            with_catalogue_glass(lens.clone()).at_temperature(0, celsius).is_err(),
            "{celsius}"
        );
    }
    for mount_expansion in [f64::NAN, 1e9, -11.0] {
        let mut wrong = lens.clone();
        wrong.environment.mount_expansion = mount_expansion;
        assert!(wrong.check().is_err(), "{mount_expansion}");
    }
}

#[test]
fn the_environment_is_kept_in_the_file() {
    let mut lens = with_catalogue_glass(bundled("tessar_50_f28"));
    let plain = serde_json::to_value(&lens).unwrap();
    assert!(plain.get("environment").is_none());
    lens.environment = Environment { celsius: Some(-10.0), mount_expansion: 8.6 };
    let text = serde_json::to_string(&lens).unwrap();
    let back: Lens = serde_json::from_str(&text).unwrap();
    assert_eq!(back.environment, lens.environment);
    let wrong = text.replace("mount_expansion", "mount_growth");
    assert!(serde_json::from_str::<Lens>(&wrong).is_err());
}

fn aplanat(arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_aplanat")).args(arguments).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn the_command_line_has_temperatures() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/lenses/achromat_ac254_100.json");
    let (code, json, errors) =
        aplanat(&["analyze", file, "thermal", "--temperatures", "0,20,40", "--json"]);
    assert_eq!(code, Some(0), "{errors}");
    let found: Value = serde_json::from_str(&json).unwrap();
    let rows = found["fields"][0]["temperatures"].as_array().unwrap();
    assert_eq!(rows.len(), 3);
    let lens = bundled("achromat_ac254_100");
    let number = |row: usize, key: &str| rows[row][key].as_f64().unwrap();
    let moved = number(2, "defocus") - number(0, "defocus");
    assert!((moved - thermal_focus(&lens).unwrap()).abs() < 1e-9);
    assert!(number(1, "rms_refocused") <= rows[1]["rms"]["value"].as_f64().unwrap());
    for (wrong, expected) in [
        (&["--temperatures", "500"][..], "-100 to 140"),
        (&["--temperatures", "x"], "invalid"),
        (&["--mount", "1e9"], "expansion of the mount"),
    ] {
        let (code, _, errors) = aplanat(&[&["analyze", file, "thermal"][..], wrong].concat());
        assert_eq!(code, Some(2), "{errors}");
        assert!(errors.contains(expected), "{errors}");
    }
}

/// A glass search takes conditions of price, status and lead.
#[test]
fn glasses_are_searched_by_status_price_and_lead() {
    let count = |words: &[&str]| {
        let (code, json, errors) = aplanat(&[&["glass", "--json"][..], words].concat());
        (code, serde_json::from_str::<Value>(&json).unwrap_or_default(), errors)
    };
    let (_, all, _) = count(&["status=preferred", "lead=no"]);
    let all = all.as_array().unwrap();
    assert!(all.len() > 30, "{}", all.len());
    for glass in all {
        assert_eq!(glass["status"], "preferred");
        assert!(glass["marked_lead_free"].as_bool().unwrap());
        assert!(!glass["name"].as_str().unwrap().starts_with("SF"), "{glass}");
    }
    // No catalogue of the program has prices: they are those of the classes of glasses.
    let (_, cheap, _) = count(&["price=..3"]);
    for glass in cheap.as_array().unwrap() {
        assert!(glass["relative_cost"].as_f64().unwrap() <= 3.0, "{glass}");
    }
    for (wrong, expected) in [
        ("status=cheap", "standard, preferred"),
        ("lead=yes", "lead=no"),
        ("weight=1", "price, density"),
    ] {
        let (code, _, errors) = count(&[wrong]);
        assert_eq!(code, Some(2));
        assert!(errors.contains(expected), "{errors}");
    }
}
