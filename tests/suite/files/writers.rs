//! Files of OSLO and ray-optics that are written: read back they trace like the lens, or the export is
//! refused by name.

use super::{folder, foreign};
use aplanat::files::{self, ConversionOutcome, FileError, LensFormat, json};
use aplanat::lens::{
    Aperture, ApertureShape, FreeformKind, Lens, Medium, Object, SurfaceAperture, glass,
};
use serde_json::Value;
use std::fs;

fn library() -> impl Iterator<Item = (&'static str, Lens)> {
    files::bundled_lenses().iter().map(|b| (b.name, json::read(b.text, b.name).unwrap()))
}

/// The bundled lens with this word in its name.
fn bundled(word: &str) -> Lens {
    library().find(|(name, _)| name.contains(word)).unwrap().1
}

/// The words of a refusal, one of which names what a format cannot hold.
const REASONS: [&str; 6] = [
    "zoom positions",
    "the freeform",
    "the ideal element",
    "the obstruction",
    "the gradient-index medium",
    "without its maker",
];

#[test]
fn every_library_lens_is_written_or_refused_by_name() {
    let folder = folder("writers");
    for extension in ["len", "roa"] {
        let (mut written, mut refused) = (0, 0);
        for (name, lens) in library() {
            let target = folder.join(format!("{name}.{extension}"));
            match files::save(&lens, &target) {
                Ok(saved) => {
                    let proof = saved.proof.unwrap();
                    let positions = 0..lens.zoom_positions();
                    let fields: usize =
                        positions.map(|zoom| lens.fields_at(zoom).values.len()).sum();
                    assert_eq!(proof.rays, 200 * fields, "{name}");
                    assert!(proof.imaged >= proof.rays / 4, "{name}: {proof}");
                    assert!(proof.worst_mm <= 1e-9, "{name}: {proof}");
                    written += 1;
                }
                Err(FileError::Unsuitable { found, .. }) => {
                    let named = REASONS.iter().any(|reason| found.contains(reason));
                    assert!(named, "{name}: {found}");
                    assert!(!target.exists(), "{name}");
                    refused += 1;
                }
                Err(error) => panic!("{error}"),
            }
        }
        assert!(written >= 8, "{extension}: {written} written, {refused} refused");
    }
    fs::remove_dir_all(folder).unwrap();
}

#[test]
fn the_numbers_of_a_lens_are_in_its_oslo_file() {
    let folder = folder("oslo-writer");
    let mut lens = bundled("achromat");
    lens.image_solve = Some(0.25);
    lens.aperture = Aperture::EntrancePupilDiameter(16.0);
    lens.surfaces[0].medium = Medium::Index(1.5);
    let target = folder.join("a.len");
    let saved = files::save(&lens, &target).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(saved.format, LensFormat::Oslo);
    let text = fs::read_to_string(&target).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let radius = 1.0 / lens.surfaces[0].curvature;
    for line in [&format!("RD {radius:?}"), "EBR 8.0", "PY 0.0", "TH 0.25"] {
        assert!(lines.contains(&line), "{line}:\n{text}");
    }
    assert_eq!(lines.iter().filter(|line| **line == "AST").count(), 1);
    assert!(lines.last().unwrap().starts_with("END "));
    // The primary wavelength comes first.
    let primary = lens.wavelengths[lens.primary()].um;
    assert!(text.contains(&format!("WV {primary:?} ")), "{text}");
    let back = files::open(&target).unwrap().lens;
    assert_eq!((back.image_solve, back.primary()), (Some(0.25), 0));
    assert_eq!(back.surfaces[0].medium, Medium::Index(1.5));
    let rows = saved.report.unwrap();
    assert!(rows.rows.iter().any(|row| row.text.starts_with("fields:")), "{rows}");
    fs::remove_dir_all(folder).unwrap();
}

#[test]
fn what_rays_meet_and_a_format_does_not_have_is_refused_by_name() {
    let folder = folder("refused-writers");
    let lens = bundled("achromat");
    let refusal =
        |lens: &Lens, name: &str| files::save(lens, folder.join(name)).unwrap_err().to_string();
    let mut tilted = lens.clone();
    tilted.surfaces[1].tilt = [1.0, 0.0];
    let error = refusal(&tilted, "a.len");
    assert!(error.contains("the decentre or tilt of surface 2"), "{error}");
    assert!(files::save(&tilted, folder.join("a.roa")).is_ok());
    let mut obstructed = lens.clone();
    obstructed.surfaces[0].obstruction = Some(1.0);
    let error = refusal(&obstructed, "a.len");
    assert!(error.contains("the obstruction of surface 1"), "{error}");
    assert!(files::save(&obstructed, folder.join("b.roa")).is_ok());
    // Each of these has a format that holds it.
    let mut framed = lens.clone();
    let rectangle = ApertureShape::Rectangle { half_width: 5.0, half_height: 4.0 };
    let rectangle = SurfaceAperture { angle: 20.0, ..SurfaceAperture::inside(rectangle) };
    let oval = ApertureShape::Ellipse { half_width: 5.0, half_height: 4.0 };
    let oval = SurfaceAperture { angle: 20.0, ..SurfaceAperture::inside(oval) };
    let arms = SurfaceAperture::obscuration(ApertureShape::Spider { arms: 3, width: 1.0 });
    for (aperture, refused) in [
        (rectangle, ["a.len", "a.zmx"].as_slice()),
        (oval, ["a.len", "a.zmx", "a.optiland.json"].as_slice()),
        (arms, ["a.len", "b.roa", "a.seq"].as_slice()),
    ] {
        framed.surfaces[0].apertures = vec![aperture];
        for name in ["a.len", "a.zmx", "a.seq", "b.roa", "a.optiland.json", "a.json"] {
            if refused.contains(&name) {
                let error = refusal(&framed, name);
                assert!(error.contains("aperture") && error.contains("surface 1"), "{error}");
            } else {
                let saved = files::save(&framed, folder.join(name));
                assert!(saved.is_ok(), "{name}: {saved:?}");
            }
        }
    }
    assert!(!folder.join("a.len").exists());
    // A name of two makers means one of their glasses.
    let mut refused = 0;
    for own in glass::known().filter(|own| own.name == "SF11") {
        let mut lens = lens.clone();
        lens.surfaces[0].medium = Medium::Glass(own.full_name());
        match files::save(&lens, folder.join("c.len")) {
            Ok(_) => {
                let back = files::open(folder.join("c.len")).unwrap().lens;
                assert_eq!(back.surfaces[0].medium, lens.surfaces[0].medium);
            }
            Err(error) => {
                assert!(error.to_string().contains(&own.full_name()), "{error}");
                refused += 1;
            }
        }
    }
    assert!(refused > 0);
    fs::remove_dir_all(folder).unwrap();
}

/// The attributes of an object of a class.
fn attributes<'a>(value: &'a Value, class: &str) -> &'a Value {
    assert_eq!(value["__instance_type__"][1], class, "{value}");
    &value["attributes"]
}

#[test]
fn a_model_of_ray_optics_has_the_numbers_and_indices_of_the_lens() {
    let folder = folder("roa-writer");
    let mut lens = bundled("double_gauss_rudolph");
    let target = folder.join("a.roa");
    // The size of the stop becomes that of its image in object space.
    let saved = files::save(&lens, &target).unwrap_or_else(|error| panic!("{error}"));
    assert!(matches!(lens.aperture, Aperture::StopSemiDiameter(_)));
    let rows = saved.report.unwrap().rows;
    let row = rows.iter().find(|row| row.text == "aperture").unwrap();
    assert_eq!(row.outcome, ConversionOutcome::Approximated);
    lens.aperture = Aperture::FNumber(4.0);
    files::save(&lens, &target).unwrap_or_else(|error| panic!("{error}"));
    let file: Value = serde_json::from_str(&fs::read_to_string(&target).unwrap()).unwrap();
    let model = attributes(&file["optical_model"], "OpticalModel");
    let sequence = attributes(&model["seq_model"], "SequentialModel");
    let (surfaces, gaps) = (&sequence["ifcs"], &sequence["gaps"]);
    assert_eq!(surfaces.as_array().unwrap().len(), lens.surfaces.len() + 2);
    assert_eq!(sequence["stop_surface"], lens.stop().unwrap() + 1);
    for (i, row) in lens.surfaces.iter().enumerate() {
        let gap = attributes(&gaps[i + 1], "Gap");
        assert_eq!(gap["thi"], row.thickness);
        let id = attributes(&surfaces[i + 1], "Surface")["profile_id"].as_str().unwrap();
        assert_eq!(attributes(&model["profile_dict"][id], "Spherical")["cv"], row.curvature);
        let Medium::Glass(name) = &row.medium else { continue };
        let table = attributes(&gap["medium"], "InterpolatedMedium");
        let own = glass::find(name).unwrap();
        let waves: Vec<f64> = serde_json::from_value(table["wvls"].clone()).unwrap();
        assert!(waves.windows(2).all(|two| two[0] < two[1]) && waves.len() > 4, "{waves:?}");
        for wave in &lens.wavelengths {
            let place = waves.iter().position(|nm| *nm == wave.um * 1e3).unwrap();
            assert_eq!(table["rndx"][place], own.index(wave.um).unwrap());
        }
    }
    let back = files::open(&target).unwrap();
    assert_eq!((back.format, back.lens.object), (LensFormat::RayOptics, Object::Infinity));
    assert_eq!(back.lens.fields, lens.fields);
    assert_eq!(back.lens.aperture, lens.aperture);
    fs::remove_dir_all(folder).unwrap();
}

/// A fold mirror, an asphere, a tilt and a diffractive phase, from files of their own.
#[test]
fn places_and_forms_go_through_a_model_of_ray_optics() {
    let folder = folder("roa-forms");
    let mut lens = files::parse(&foreign("tilted.seq"), "tilted.seq").unwrap().lens;
    lens.surfaces[0].freeform = Some(aplanat::lens::Freeform {
        kind: FreeformKind::RadialPhase { radius: 5.0, order: 1.0 },
        numbers: vec![-3.0, 0.25],
    });
    lens.surfaces[5].freeform = Some(aplanat::lens::Freeform {
        kind: FreeformKind::OddAsphere,
        numbers: vec![0.0, 0.0, 1e-6],
    });
    let target = folder.join("a.roa");
    let saved = files::save(&lens, &target).unwrap_or_else(|error| panic!("{error}"));
    assert!(saved.proof.unwrap().imaged > 100);
    let back = files::open(&target).unwrap();
    // A model glass keeps its numbers beside the table of its indices.
    let media =
        |lens: &Lens| lens.surfaces.iter().map(|row| row.medium.clone()).collect::<Vec<_>>();
    assert!(media(&lens).iter().any(|medium| matches!(medium, Medium::Model { .. })));
    assert_eq!(media(&back.lens), media(&lens));
    let kinds = |lens: &Lens| {
        let rows = lens.surfaces.iter();
        rows.map(|row| row.freeform.as_ref().map(|form| form.kind.name())).collect::<Vec<_>>()
    };
    assert_eq!(kinds(&back.lens), kinds(&lens));
    assert_eq!(back.report.unwrap().count(ConversionOutcome::Locked), 0);
    fs::remove_dir_all(folder).unwrap();
}
