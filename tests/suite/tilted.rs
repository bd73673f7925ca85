//! Lenses with a broken axis and with decentred and tilted surfaces.

use aplanat::analysis::{AnalysisError, longitudinal_aberration, spot};
use aplanat::files;
use aplanat::lens::{Aperture, AxisBreak, Lens, Medium, System};
use aplanat::math::Vec3;
use aplanat::pupil::{Accuracy, Aiming, RayModel};
use aplanat::trace::{Ray, Tracer};
use std::path::{Path, PathBuf};

/// An empty folder of a test.
fn folder(test: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("aplanat-tilted-{}-{test}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

fn folded() -> Lens {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/files/folded_singlet.zmx");
    files::open(path).unwrap().lens
}

/// The same singlet without its mirrors.
fn straight() -> Lens {
    let mut lens = folded();
    lens.surfaces.truncate(2);
    lens.surfaces[1].thickness = 40.0 + 30.0 + 20.0;
    lens
}

fn system(lens: &Lens) -> System<f64> {
    lens.resolve(0, 0.5875618).unwrap()
}

fn rays() -> impl Iterator<Item = Ray<f64>> {
    (0..40).map(|i| {
        let (a, b) = (f64::from(i) * 2.4, 4.5 * f64::from(i).sqrt() / 40.0_f64.sqrt());
        let slope = Vec3::new(0.01 * f64::from(i % 3), 0.02 * f64::from(i % 4), 1.0);
        let direction = slope * (1.0 / slope.dot(slope).sqrt());
        Ray { point: Vec3::new(b * a.cos(), b * a.sin(), 0.0), direction }
    })
}

#[test]
fn plane_mirrors_fold_a_beam_and_change_nothing_else() {
    let [bent, unfolded] = [folded(), straight()].map(|lens| system(&lens));
    let [through, along] = [&bent, &unfolded].map(|system| Tracer::new(system).unwrap());
    let mut worst: f64 = 0.0;
    for ray in rays() {
        let (a, b) = (through.trace(ray), along.trace(ray));
        assert!(a.fate.is_imaged() && b.fate.is_imaged());
        // Each mirror turns the frame by twice its tilt, so that the two frames are mirror images of
        // the unfolded one at y = 0 and at x = 0, in this order, up to signs.
        let (p, q) = (a.ray.point, b.ray.point);
        worst = worst.max((p.x.abs() - q.x.abs()).abs().max((p.y.abs() - q.y.abs()).abs()));
        worst = worst.max((a.opl - b.opl).abs());
    }
    println!("folded against straight: {worst:.1e} mm");
    assert!(worst < 1e-12, "{worst}");
}

#[test]
fn the_frames_of_a_folded_lens_stand_where_the_light_goes() {
    let frames = system(&folded()).frames();
    let image = frames.last().unwrap();
    // Up by 30 mm behind 44 mm, then by 20 mm to the side and down, at 60 degrees.
    let place = image.shift;
    let (sin, cos) = 60_f64.to_radians().sin_cos();
    let apart = place - Vec3::new(20.0 * sin, 30.0 - 20.0 * cos, 44.0);
    assert!(apart.dot(apart).sqrt() < 1e-12, "{place:?}");
    let chief = Ray { point: Vec3::default(), direction: Vec3::new(0.0, 0.0, 1.0) };
    let path = Tracer::new(&system(&folded())).unwrap().polyline(chief);
    let apart = *path.points.last().unwrap() - place;
    assert!(apart.dot(apart).sqrt() < 1e-12);
}

#[test]
fn light_that_goes_back_returns_to_its_start() {
    let mut lens = folded();
    lens.surfaces[0].tilt = [2.0, -3.0];
    lens.surfaces[1].decenter = [0.3, -0.2];
    let there = system(&lens);
    let back = there.reversed(0.0);
    let [forward, backward] = [&there, &back].map(|system| Tracer::new(system).unwrap());
    let gap = there.surfaces[there.surfaces.len() - 2].thickness;
    for ray in rays() {
        let end = forward.trace(ray);
        assert!(end.fate.is_imaged());
        // Two mirrors: the system is reflected, z → −z, and starts at its last vertex.
        let flip = |v: Vec3<f64>| Vec3::new(v.x, v.y, -v.z);
        let mut start = Ray { point: flip(end.ray.point), direction: -flip(end.ray.direction) };
        start.point.z -= gap;
        let home = backward.trace(start);
        assert!(home.fate.is_imaged(), "{:?}", home.fate);
        let direction = ray.direction * (1.0 / ray.direction.z);
        let at_vertex = ray.point - direction * ray.point.z;
        let apart = flip(home.ray.point) - at_vertex;
        assert!(apart.dot(apart).sqrt() < 1e-11, "{apart:?}");
    }
}

/// A tilt about y does to the axial beam what the same tilt about x does, turned by a right angle.
#[test]
fn spots_know_the_symmetry_of_a_lens() {
    let rms = |tilt: [f64; 2]| {
        let mut lens = straight();
        lens.surfaces[1].tilt = tilt;
        let model = RayModel::with_aiming(&lens, 0, Aiming::Paraxial).unwrap();
        let spot =
            spot(&model, model.fields[0], Accuracy { tolerance: 1e-8, max_rays: 100_000 }).unwrap();
        (spot.rms, spot.centroid)
    };
    let [about_x, about_y] = [rms([3.0, 0.0]), rms([0.0, 3.0])];
    assert!((about_x.0.value / about_y.0.value - 1.0).abs() < 1e-6);
    let [x, y] = about_y.1.map(|at| at.value);
    assert!(x.abs() > 0.1 && y.abs() < 1e-6, "{x} {y}");
    assert!((x.abs() - about_x.1[1].value.abs()).abs() < 1e-5, "{x} {:?}", about_x.1);
}

/// A beam fills the same part of the stop whichever way its lens is turned about the axis: the chief ray, which
/// a tilt moves aside, does not count as radius.
#[test]
fn the_part_of_a_stop_that_a_beam_fills_knows_no_direction() {
    let spot_of = |tilt: [f64; 2]| {
        let mut lens = files::open("lenses/cooke_triplet_100_f27.json").unwrap().lens;
        lens.aperture = Aperture::EntrancePupilDiameter(20.0);
        lens.fields.values.truncate(1);
        lens.surfaces[1].tilt = tilt;
        let model = RayModel::from_lens(&lens, 0).unwrap();
        let found = longitudinal_aberration(&model, 3);
        assert_eq!(found, Err(AnalysisError::NotSymmetric));
        let accuracy = Accuracy { tolerance: 1e-5, max_rays: 100_000 };
        spot(&model, model.fields[0], accuracy).unwrap()
    };
    let [first, others @ ..] = [[2.0, 0.0], [-2.0, 0.0], [0.0, 2.0], [0.0, -2.0]].map(spot_of);
    for other in others {
        assert!((other.rms.value / first.rms.value - 1.0).abs() < 1e-4);
        assert!((other.light.value / first.light.value - 1.0).abs() < 1e-4);
    }
}

#[test]
fn a_folded_lens_is_written_and_read_back() {
    let folder = folder("folded");
    let mut lens = folded();
    lens.surfaces[0].decenter = [0.1, 0.0];
    lens.surfaces[0].tilt = [0.5, -0.25];
    lens.surfaces[1].break_after =
        Some(AxisBreak { decenter: [0.5, -0.5, 2.0], tilt: [3.0, 4.0, 5.0] });
    for name in ["a.zmx", "a.seq", "a.json"] {
        let path = folder.join(name);
        let report = files::save(&lens, &path).unwrap();
        if let Some(proof) = report.proof {
            assert!(proof.worst_mm < 1e-11 && proof.imaged == proof.rays, "{proof:?}");
        }
        let back = files::open(&path).unwrap().lens;
        assert_eq!(back.surfaces.len(), lens.surfaces.len());
        let [a, b] = [&lens, &back].map(|lens| Tracer::new(&system(lens)).unwrap());
        for ray in rays() {
            let apart = a.trace(ray).ray.point - b.trace(ray).ray.point;
            assert!(apart.dot(apart).sqrt() < 1e-11);
        }
    }
}

/// Light goes down to the image plane; half a turn more and it meets the back of it.
#[test]
fn an_image_plane_that_faces_away_is_turned_over() {
    let text = std::fs::read_to_string(
        Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/files/folded_singlet.zmx"),
    );
    let tilted = |degrees: f64| {
        let image = format!(
            "SURF 9\n  TYPE COORDBRK\n  CURV 0 0 0 0 0 \"\"\n  PARM 3 {degrees}\n  DISZ 0\nSURF 10"
        );
        let text = text.as_ref().unwrap().replace("SURF 9", &image);
        files::parse(text.as_bytes(), "a.zmx").unwrap()
    };
    let (facing, away) = (tilted(10.0), tilted(190.0));
    let [a, b] = [&facing, &away].map(|opened| Tracer::new(&system(&opened.lens)).unwrap());
    for ray in rays().take(5) {
        let (a, b) = (a.trace(ray), b.trace(ray));
        let apart = a.ray.point - b.ray.point;
        assert!(a.fate.is_imaged() && b.fate.is_imaged());
        assert!(apart.dot(apart).sqrt() < 1e-11, "{apart:?}");
    }
    assert!(away.report.unwrap().to_string().contains("turned over"));
    assert!(!facing.report.unwrap().to_string().contains("turned over"));
}

#[test]
fn parts_that_nobody_knows_do_not_close_the_door() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/files/unknown_parts.zmx");
    let opened = files::open(&path).unwrap();
    let (lens, report) = (opened.lens, opened.report.unwrap());
    let media: Vec<&Medium> = lens.surfaces.iter().map(|row| &row.medium).collect();
    assert_eq!(*media[0], Medium::Model { nd: 1.61, vd: 50.5 });
    assert_eq!(*media[1], Medium::Glass("HIKARI J-LAK02".to_owned()));
    assert_eq!(*media[2], Medium::Model { nd: 1.5168, vd: 64.17 });
    assert_eq!(lens.surfaces[2].comment, "glass QQ-7 is not known");
    let locked = lens.surfaces[1].locked.as_ref().unwrap();
    assert_eq!((locked.kind.as_str(), lens.surfaces[1].curvature), ("USERSURF", -0.01));
    let text = report.to_string();
    assert!(text.starts_with("1 dropped, 1 locked, 1 approximated"), "{text}");
    for word in ["XY-12", "QQ-7", "USERSURF"] {
        assert!(text.contains(word), "{word}");
    }
    // The file that goes back has the surface as it came.
    let folder = folder("unknown");
    let back = folder.join("back.zmx");
    files::save(&lens, &back).unwrap();
    let again = files::open(&back).unwrap().lens;
    let kept = again.surfaces[1].locked.as_ref().unwrap();
    let parameters = |lines: &[String]| -> Vec<String> {
        lines.iter().filter(|line| line.starts_with("PARM")).cloned().collect()
    };
    assert_eq!(parameters(&kept.lines), parameters(&locked.lines));
}
