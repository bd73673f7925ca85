//! Paraxial lenses and gratings: closed forms, wavefronts, reversal, derivatives, files.

use aplanat::files;
use aplanat::lens::{
    Edit, Freeform, FreeformKind, IdealAction, IdealElement, Lens, Medium, Pose, Shape, Surface,
    System, Wavelength, apply_edit, blank,
};
use aplanat::math::Vec3;
use aplanat::trace::{Fate, Ray, Rays, Tracer};

fn ray([x, y, z]: [f64; 3], [l, m]: [f64; 2]) -> Ray<f64> {
    let direction = Vec3::new(l, m, (1.0 - l * l - m * m).sqrt());
    Ray { point: Vec3::new(x, y, z), direction }
}

/// A plane that deflects light between two media, and a plane behind.
fn single(action: IdealAction<f64>, [before, behind]: [f64; 2], gap: f64) -> System<f64> {
    let ideal = Some(action);
    let face = Surface { ideal, ..Surface::plane(gap, behind) };
    System { index_before: before, surfaces: vec![face, Surface::plane(0.0, behind)], stop: None }
}

const HEIGHTS: [[f64; 2]; 5] = [[0.0, 0.0], [3.0, 0.0], [0.0, -5.0], [-7.0, 4.0], [2.0, 9.0]];

/// An oblique beam meets in a point of the focal plane, all of it with the same optical path.
#[test]
fn a_paraxial_lens_focuses_a_beam_without_a_wavefront_error() {
    for (power, media) in [(0.02, [1.0, 1.0]), (0.05, [1.3, 1.6]), (-0.03, [1.0, 1.2])] {
        let focus = media[1] / power;
        let tracer = Tracer::new(&single(IdealAction::Lens { power }, media, focus)).unwrap();
        let (l, m) = (0.1_f64, -0.25_f64);
        let n = (1.0 - l * l - m * m).sqrt();
        let slopes = [l / n, m / n];
        let mut paths = Vec::new();
        for [x, y] in HEIGHTS {
            // All starts lie on one wavefront.
            let back = (x * l + y * m) / 1.0;
            let start = Ray {
                point: Vec3::new(x - l * (5.0 + back), y - m * (5.0 + back), -n * (5.0 + back)),
                direction: Vec3::new(l, m, n),
            };
            let found = tracer.trace(start);
            assert_eq!(found.fate, Fate::Imaged);
            let expected = slopes.map(|u| media[0] * u / power);
            let apart = (found.ray.point.x - expected[0]).hypot(found.ray.point.y - expected[1]);
            assert!(apart < 1e-13 / power.abs(), "{apart}");
            paths.push(found.opl);
        }
        let spread = paths.iter().map(|path| (path - paths[0]).abs()).fold(0.0, f64::max);
        assert!(spread < 1e-12, "{power}: {spread}");
    }
}

/// Points at every distance are imaged to points, where `n'/s' = n/s + 1/f` says.
#[test]
fn a_paraxial_lens_images_points_to_points() {
    let (power, [n, behind]) = (0.02, [1.0, 1.5]);
    let distance = 120.0;
    let image = behind / (power - n / distance);
    let tracer = Tracer::new(&single(IdealAction::Lens { power }, [n, behind], image)).unwrap();
    let object = Vec3::new(4.0, -10.0, -distance);
    let magnification = -(n * image) / (behind * distance);
    for [x, y] in HEIGHTS {
        let along = Vec3::new(x, y, 0.0) - object;
        let direction = along * (1.0 / along.dot(along).sqrt());
        let p = tracer.trace(Ray { point: object, direction }).ray.point;
        let apart = (p.x - magnification * object.x).hypot(p.y - magnification * object.y);
        assert!(apart < 1e-12, "{p:?}");
    }
}

/// `n' sin θ' = n sin θ + m λ/d` along y, and what is along x stays; the wave behind is plane.
#[test]
fn a_grating_turns_light_by_its_equation() {
    for (media, mirror) in [([1.0, 1.0], false), ([1.0, 1.5], false), ([1.2, 1.2], true)] {
        let shift = 0.35;
        let mut system = single(IdealAction::Grating { shift }, media, 30.0);
        if mirror {
            system.surfaces[0].mirror = true;
            system.surfaces[0].thickness = -30.0;
        }
        let tracer = Tracer::new(&system).unwrap();
        let (l, m) = (0.2_f64, -0.1_f64);
        let n = (1.0 - l * l - m * m).sqrt();
        let mut phases = Vec::new();
        for [x, y] in HEIGHTS {
            let back = 5.0 + x * l + y * m;
            let start = Ray {
                point: Vec3::new(x - l * back, y - m * back, -n * back),
                direction: Vec3::new(l, m, n),
            };
            let found = tracer.trace(start);
            assert_eq!(found.fate, Fate::Imaged);
            let d = found.ray.direction;
            assert!((media[1] * d.x - media[0] * l).abs() < 1e-15, "{d:?}");
            assert!((media[1] * d.y - media[0] * m - shift).abs() < 1e-15, "{d:?}");
            assert!((d.z < 0.0) == mirror && (d.dot(d) - 1.0).abs() < 1e-15);
            // The phase on a plane across the wave behind.
            phases.push(found.opl - media[1] * found.ray.point.dot(d));
        }
        let spread = phases.iter().map(|phase| (phase - phases[0]).abs()).fold(0.0, f64::max);
        assert!(spread < 1e-12, "{spread}");
    }
}

/// An order that no light is in ends by name, and its neighbour arrives.
#[test]
fn an_evanescent_order_ends_by_name() {
    let fate = |shift: f64, start: [f64; 2]| {
        let tracer = Tracer::new(&single(IdealAction::Grating { shift }, [1.0, 1.0], 5.0)).unwrap();
        tracer.trace(ray([0.0, 0.0, -1.0], start)).fate
    };
    assert_eq!(fate(0.9, [0.0, 0.0]), Fate::Imaged);
    assert_eq!(fate(1.1, [0.0, 0.0]), Fate::TotalReflection(0));
    assert_eq!(fate(0.9, [0.0, 0.2]), Fate::TotalReflection(0));
    assert_eq!(fate(0.9, [0.6, 0.0]), Fate::TotalReflection(0));
    assert_eq!(fate(1e9, [0.0, 0.0]), Fate::TotalReflection(0));
}

fn some_rays() -> Rays<f64> {
    let mut rays = Rays::default();
    for i in 0..20 {
        let at = |step: f64| 2.0 * (f64::from(i) * step).fract() - 1.0;
        let start = [3.0 * at(0.856_674_8), 3.0 * at(0.733_891_8), -3.0];
        rays.push(ray(start, [0.1 * at(0.628_706_7), 0.1 * at(0.538_597_4)]));
    }
    rays
}

/// A lens in front, the element tilted and on a curved surface if it is a grating.
fn behind_a_lens(action: IdealAction<f64>) -> System<f64> {
    let lens = Surface {
        shape: Shape::Sphere { curvature: 0.03 },
        semi_diameter: 9.0,
        ..Surface::plane(6.0, 1.5)
    };
    let shape = match action {
        IdealAction::Lens { .. } => Shape::Plane,
        IdealAction::Grating { .. } | IdealAction::Phase { .. } => {
            Shape::Conic { curvature: -0.02, conic: -0.6 }
        }
    };
    let element = Surface {
        shape,
        ideal: Some(action),
        semi_diameter: 9.0,
        pose: Some(Pose::new([0.1, -0.2], [0.05, 0.02])),
        ..Surface::plane(20.0, 1.1)
    };
    let surfaces = vec![lens, element, Surface::plane(0.0, 1.1)];
    System { index_before: 1.0, surfaces, stop: None }
}

#[test]
fn light_that_goes_back_returns_with_the_same_path_of_a_grating() {
    for action in [IdealAction::Lens { power: 0.02 }, IdealAction::Grating { shift: -0.2 }] {
        let system = behind_a_lens(action);
        let (there, back) =
            (Tracer::new(&system).unwrap(), Tracer::new(&system.reversed(3.0)).unwrap());
        for i in 0..20 {
            let start = some_rays().get(i);
            let found = there.trace(start);
            assert_eq!(found.fate, Fate::Imaged);
            let (p, d) = (found.ray.point, found.ray.direction);
            let turned =
                Ray { point: Vec3::new(p.x, p.y, -20.0), direction: Vec3::new(-d.x, -d.y, d.z) };
            let home = back.trace(turned);
            assert_eq!(home.fate, Fate::Imaged);
            let (q, e) = (home.ray.point, home.ray.direction);
            assert!((q.x - start.point.x).hypot(q.y - start.point.y) < 1e-12, "{q:?}");
            assert!((e.x + start.direction.x).hypot(e.y + start.direction.y) < 1e-13, "{e:?}");
            let grating = matches!(action, IdealAction::Grating { .. });
            assert!(!grating || (home.opl - found.opl).abs() < 1e-11);
        }
    }
}

#[test]
fn deflections_have_the_derivatives_of_their_landings() {
    for action in [IdealAction::Lens { power: 0.02 }, IdealAction::Grating { shift: -0.2 }] {
        let system = behind_a_lens(action);
        let compared = crate::freeform::assert_landing_derivatives(&format!("{action:?}"), &system);
        assert!(compared >= 5, "{compared}");
    }
}

fn lens(ideal: IdealElement) -> Lens {
    let mut lens = blank();
    lens.surfaces[0].medium = Medium::Air;
    lens.surfaces[1].ideal = Some(ideal);
    lens
}

/// A paraxial lens has its focal length in first-order optics, and survives its files.
#[test]
fn ideal_elements_survive_their_files() {
    let folder = std::env::temp_dir().join(format!("aplanat-ideal-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let thin = IdealElement::Lens { focal_length: 80.0 };
    for ideal in [thin, IdealElement::Grating { lines_per_mm: 600.0, order: -1.0 }] {
        let written = lens(ideal);
        let text = files::json::write(&written);
        assert_eq!(files::json::read(&text, "a.json").unwrap(), written, "{text}");
        let path = folder.join("ideal.zmx");
        files::save(&written, &path).unwrap();
        let again = files::open(&path).unwrap().lens;
        assert_eq!(again.surfaces[1].ideal, written.surfaces[1].ideal);
    }
    let mut focused = lens(thin);
    focused.image_solve = Some(0.0);
    let gap = focused.resolve(0, 0.5875618).unwrap().surfaces[1].thickness;
    assert!((gap - 80.0).abs() < 1e-12, "{gap}");
    focused.surfaces[1].curvature = 0.01;
    let error = focused.check().unwrap_err().to_string();
    assert!(error.contains("surface 2: a paraxial lens is a plane"), "{error}");
    std::fs::remove_dir_all(&folder).unwrap();
}

/// A lens with a phase on the plane that light leaves.
fn diffractive(kind: FreeformKind, numbers: &[f64]) -> Lens {
    let mut lens = blank();
    lens.surfaces[0].medium = Medium::Air;
    lens.surfaces[1].freeform = Some(Freeform { kind, numbers: numbers.to_vec() });
    lens
}

/// A phase that grows evenly is a grating: `m λ a/(2π R)` is its `m λ/d`.
#[test]
fn an_even_phase_is_a_grating() {
    let (radius, order) = (4.0, -2.0);
    let phase = diffractive(FreeformKind::XyPhase { radius, order }, &[0.0, 700.0]);
    let lines_per_mm = 700.0 / (std::f64::consts::TAU * radius);
    let ruled = lens(IdealElement::Grating { lines_per_mm, order });
    let [a, b] =
        [&phase, &ruled].map(|lens| Tracer::new(&lens.resolve(0, 0.486).unwrap()).unwrap());
    for i in 0..20 {
        let (p, q) = (a.trace(some_rays().get(i)), b.trace(some_rays().get(i)));
        assert_eq!(p.fate, Fate::Imaged);
        let apart = p.ray.point - q.ray.point;
        assert!(apart.dot(apart).sqrt() < 1e-12 && (p.opl - q.opl).abs() < 1e-12, "{p:?} {q:?}");
    }
}

/// `f = −π R²/(m a₁ λ)`: the focal length of a diffractive lens is inversely proportional to the
/// wavelength and to the order, whether rays or first-order optics say it.
#[test]
fn a_diffractive_lens_focuses_by_wavelength_and_order() {
    for (order, um) in [(1.0, 0.5875618), (1.0, 0.4861), (3.0, 0.6563), (-1.0, 0.55)] {
        let kind = FreeformKind::RadialPhase { radius: 5.0, order };
        let first = if order < 0.0 { 900.0 } else { -900.0 };
        let mut lens = diffractive(kind, &[first]);
        lens.image_solve = Some(0.0);
        lens.wavelengths = vec![Wavelength { um, weight: 1.0, primary: true }];
        let system = lens.resolve(0, um).unwrap();
        let focus = -std::f64::consts::PI * 25.0 / (order * first * um * 1e-3);
        let gap = system.surfaces[1].thickness;
        assert!((gap / focus - 1.0).abs() < 1e-13, "{gap} {focus}");
        let y = Tracer::new(&system).unwrap().trace(ray([0.0, 1e-4, -1.0], [0.0; 2])).ray.point.y;
        assert!(y.abs() < 1e-10, "{y}");
        // Without an order light goes straight on, at any phase.
        let none = FreeformKind::RadialPhase { radius: 5.0, order: 0.0 };
        let system = diffractive(none, &[first, 1e5]).resolve(0, um).unwrap();
        let found = Tracer::new(&system).unwrap().trace(ray([0.3, 1.5, -1.0], [0.0; 2]));
        assert_eq!((found.ray.point.x, found.ray.point.y), (0.3, 1.5));
        assert_eq!((found.ray.direction.x, found.ray.direction.y), (0.0, 0.0));
    }
}

/// Far outside the radius of its unit the phase continues until no light is in its order.
#[test]
fn a_phase_ends_by_name_where_its_order_is_evanescent() {
    let kind = FreeformKind::RadialPhase { radius: 1.0, order: 1.0 };
    let tracer = Tracer::new(&diffractive(kind, &[-800.0]).resolve(0, 0.55).unwrap()).unwrap();
    // sin θ' = λ |a₁| r/(π R²) reaches 1 at r = 7.14 mm.
    let limit = std::f64::consts::PI / (0.55e-3 * 800.0);
    let fate = |y: f64| tracer.trace(ray([0.0, y, -1.0], [0.0; 2])).fate;
    assert_eq!(fate(0.999 * limit), Fate::Imaged);
    assert_eq!(fate(1.001 * limit), Fate::TotalReflection(1));
    let wild = diffractive(kind, &[1e90]).resolve(0, 0.55).unwrap();
    let found = Tracer::new(&wild).unwrap().trace(ray([0.0, 1.0, -1.0], [0.0; 2]));
    assert_eq!(found.fate, Fate::TotalReflection(1));
    assert!(found.ray.point.is_finite() && found.opl.is_finite());
}

/// A lens that is scaled keeps its angles, a phase grows with it; a file in inches keeps the phase.
#[test]
fn a_phase_is_scaled_as_a_path_and_read_as_an_angle() {
    let kind = FreeformKind::RadialPhase { radius: 5.0, order: 1.0 };
    let lens = diffractive(kind, &[-900.0, 40.0]);
    let large = apply_edit(&lens, &Edit::Scale(3.0)).unwrap();
    let [a, b] = [&lens, &large].map(|l| Tracer::new(&l.resolve(0, 0.55).unwrap()).unwrap());
    let (p, q) =
        (a.trace(ray([1.0, 2.0, -1.0], [0.1, 0.0])), b.trace(ray([3.0, 6.0, -3.0], [0.1, 0.0])));
    let apart = q.ray.point - p.ray.point * 3.0;
    assert!(apart.dot(apart).sqrt() < 1e-12 && (q.opl - 3.0 * p.opl).abs() < 1e-11, "{apart:?}");
    let form = lens.surfaces[1].freeform.as_ref().unwrap().in_mm(25.4);
    assert_eq!(form.numbers, [-900.0, 40.0]);
    assert_eq!(form.kind, FreeformKind::RadialPhase { radius: 127.0, order: 1.0 });
}

/// What contradicts itself is refused by its surface.
#[test]
fn a_phase_and_a_rule_on_one_surface_are_refused() {
    let kind = FreeformKind::RadialPhase { radius: 5.0, order: 1.0 };
    let mut both = diffractive(kind, &[-900.0]);
    both.surfaces[1].ideal = Some(IdealElement::Grating { lines_per_mm: 100.0, order: 1.0 });
    let error = both.check().unwrap_err().to_string();
    assert!(error.contains("surface 2: a grating and a radial phase on one surface"), "{error}");
    let kind = FreeformKind::RadialPhase { radius: 5.0, order: f64::NAN };
    let error = diffractive(kind, &[1.0]).check().unwrap_err().to_string();
    assert!(error.contains("the order of the radial phase is NaN"), "{error}");
}

/// The coefficients of the other programs are optical paths at one wavelength, `Σ c r^(2k)`.
#[test]
fn a_radial_phase_survives_a_sequence_file() {
    let folder = std::env::temp_dir().join(format!("aplanat-phase-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("phase.seq");
    let kind = FreeformKind::RadialPhase { radius: 4.0, order: 2.0 };
    let mut written = diffractive(kind, &[-300.0, 20.0, 0.0, 5.0]);
    written.surfaces[1].curvature = 0.01;
    written.surfaces[1].conic = -0.7;
    written.surfaces[1].asphere = vec![1e-6];
    files::save(&written, &path).unwrap();
    let again = files::open(&path).unwrap().lens;
    let [a, b] = [&written, &again].map(|l| Tracer::new(&l.resolve(0, 0.486).unwrap()).unwrap());
    for i in 0..20 {
        let (p, q) = (a.trace(some_rays().get(i)), b.trace(some_rays().get(i)));
        let apart = p.ray.point - q.ray.point;
        assert!(p.fate == Fate::Imaged && apart.dot(apart).sqrt() < 1e-11, "{apart:?}");
        assert!((p.opl - q.opl).abs() < 1e-11);
    }
    let inches = "RDM;LEN\nDIM I\nEPD 0.2\nWL 500\nYAN 0\nSO 0 1E14\nS 0 2\n STO\n DIF DOE\n \
                  HOR 1\n HWL 500\n HCT R\n HCO C1 -0.25\nSI 0 0\nGO\n";
    std::fs::write(&path, inches).unwrap();
    let lens = files::open(&path).unwrap().lens;
    // A path of −r²/4 in inches is a lens of 2 inches at its wavelength.
    let mut focused = lens.clone();
    focused.image_solve = Some(0.0);
    let gap = focused.resolve(0, 0.5).unwrap().surfaces[0].thickness;
    assert!((gap - 2.0 * 25.4).abs() < 1e-10, "{gap}");
    for (from, to) in [("HCT R", "HCT X"), (" HWL 500\n", "")] {
        std::fs::write(&path, inches.replace(from, to)).unwrap();
        let locked = files::open(&path).unwrap().lens;
        assert!(locked.surfaces[0].locked.is_some() && locked.surfaces[0].freeform.is_none());
    }
    std::fs::write(&path, inches.replace("HCO C1", "HCO C99")).unwrap();
    let error = files::open(&path).unwrap_err().to_string();
    assert!(error.contains("C1 to C20"), "{error}");
    std::fs::remove_dir_all(&folder).unwrap();
}
