//! The example lenses with gradient indices: the property that each demonstrates; and gradients
//! traversed again behind a mirror.

use super::lens::{lens_of, ray, system};
use crate::merit::bundled;
use aplanat::lens::{Lens, Medium, Parameter, Quantity, RADIAL_TERMS};
use aplanat::merit::{Goal, LimitTreatment, PupilEdge, Term, WeightedTerm};
use aplanat::optimize::{DescentMethod, start};
use aplanat::paraxial::{Beam, first_order, paraxial_ray};
use aplanat::search::lens_landscape::LensSummary;
use aplanat::trace::{Ray, Tracer};

/// The RMS radius of the spot on the axis, in mm.
fn spot(lens: &Lens) -> f64 {
    LensSummary::new(lens, 1e-4).unwrap().fields[0].spot.unwrap().value
}

/// The lens after a descent to a sharp spot on the axis.
fn sharpest(mut lens: Lens, free: &[Parameter]) -> Lens {
    lens.variables.clear();
    lens.fields.values.truncate(1);
    free.iter().for_each(|p| crate::merit::vary(&mut lens, p.surface, p.quantity));
    let terms = vec![WeightedTerm::new(Term::Spot, 1.0)];
    let goal = Goal {
        terms,
        zoom_ratios: Vec::new(),
        limits: LimitTreatment::default(),
        pupil: PupilEdge::Frozen,
    };
    let mut search = start(DescentMethod::DampedLeastSquares, &lens, &goal, 1e-6).unwrap();
    for _ in 0..60 {
        if search.step().finished {
            break;
        }
    }
    search.best().clone()
}

#[test]
fn grin_example_an_axial_gradient_corrects_spherical_aberration() {
    let graded = bundled("axial_gradient_singlet_50");
    let image = Parameter::new(1, Quantity::Thickness);
    let mut glass = graded.clone();
    glass.surfaces[0].medium = Medium::Index(1.64);
    let plain = spot(&sharpest(glass, &[image]));
    let with = spot(&graded);
    println!("on the axis {:.2} um of glass, {:.4} um with the gradient", 1e3 * plain, 1e3 * with);
    assert!(with < 1e-3 * plain && plain > 0.04, "{with} {plain}");
    // From glass a descent comes to the same gradient.
    let slope = Parameter::new(0, Quantity::Grin(RADIAL_TERMS));
    let mut weak = graded.clone();
    assert!(weak.set(slope, -0.004) && weak.set(image, 46.3));
    let found = sharpest(weak, &[slope, image]);
    let (found, stated) = (found.get(slope).unwrap(), graded.get(slope).unwrap());
    assert!((found / stated - 1.0).abs() < 1e-3, "{found} {stated}");
}

#[test]
fn grin_example_a_plane_plate_has_the_focal_length_of_woods_formula() {
    let lens = bundled("wood_lens_60");
    let Medium::Grin(gradient) = &lens.surfaces[0].medium else { panic!() };
    let (n, length) = (1.6, lens.surfaces[0].thickness);
    let g = (-2.0 * gradient.radial[0] / n).sqrt();
    let first = first_order(&system(&lens), &Beam::for_lens(&lens, 0)).unwrap();
    let power = n * g * (g * length).sin();
    assert!((first.efl.unwrap() * power - 1.0).abs() < 1e-12);
    assert!((first.bfl.unwrap() * power / (g * length).cos() - 1.0).abs() < 1e-12);
    // A thin one by Wood's own formula; the plate is a tenth of its focal length.
    let thin = -1.0 / (2.0 * gradient.radial[0] * length);
    assert!((thin / first.efl.unwrap() - 1.0).abs() < 0.02, "{thin}");
    // The term in r⁴ is what makes it sharp.
    let image = Parameter::new(1, Quantity::Thickness);
    let mut parabola = lens.clone();
    assert!(parabola.set(Parameter::new(0, Quantity::Grin(1)), 0.0));
    let without = spot(&sharpest(parabola, &[image]));
    let with = spot(&lens);
    println!("on the axis {:.2} um of a parabola, {:.4} um", 1e3 * without, 1e3 * with);
    assert!(with < 1e-3 * without && without > 0.01, "{with} {without}");
}

/// A concave mirror, and on the way back from it a plate with a gradient in front of the image.
fn folded(radial: f64, axial: f64) -> Lens {
    lens_of(
        &format!(
            r#"{{"curvature": -0.01, "thickness": -20.0, "glass": "mirror", "semi_diameter": 8.0,
            "stop": true}},
            {{"curvature": 0.002, "thickness": -6.0, "glass": {{"gradient": {{"base": {{"index": 1.6}},
            "radial": [{radial}], "axial": [{axial}]}}}}, "semi_diameter": 8.0}},
            {{"curvature": -0.003, "thickness": -15.0, "semi_diameter": 8.0}}"#
        ),
        r#"{"entrance_pupil_diameter": 10.0}"#,
    )
}

#[test]
fn grin_example_first_order_data_behind_a_mirror_are_those_of_rays_near_the_axis() {
    for (radial, axial) in [(-1e-3, 0.0), (0.0, 0.02), (8e-4, -0.01)] {
        let lens = folded(radial, axial);
        let system = system(&lens);
        let paraxial = paraxial_ray(&system, 1.0, 0.0);
        let tracer = Tracer::new(&system).unwrap();
        let height = 1e-3;
        let real = tracer.trace(Ray {
            point: aplanat::math::Vec3::new(0.0, height, -1.0),
            ..ray(0.0, 0.0, 0.0, 0.0)
        });
        assert!(real.fate.is_imaged());
        let image = system.surfaces.len() - 1;
        let off = real.ray.point.y / height - paraxial.heights[image];
        assert!(off.abs() < 1e-6, "{radial} {axial}: {off:e}");
        let slope = real.ray.direction.y / real.ray.direction.z / height;
        let off = slope - paraxial.slopes[image];
        assert!(off.abs() < 1e-6, "{radial} {axial}: slope {off:e}");
        // The focus solve is the same ray.
        let mut focused = lens.clone();
        focused.image_solve = Some(0.0);
        let solved = super::lens::system(&focused);
        let ray = paraxial_ray(&solved, 1.0, 0.0);
        assert!(ray.heights[image].abs() < 1e-12, "{}", ray.heights[image]);
        let first = first_order(&solved, &Beam::for_lens(&focused, 0)).unwrap();
        assert!(first.image_defocus.unwrap().abs() < 1e-9);
    }
}

/// The contribution of a plate to the Petzval sum does not depend on the direction of the light.
#[test]
fn grin_example_the_petzval_sum_of_a_plate_is_the_same_both_ways() {
    let sum =
        |lens: &Lens| first_order(&system(lens), &Beam::for_lens(lens, 0)).unwrap().petzval_sum;
    let plate = |radial: f64| sum(&folded(radial, 0.0)) - sum(&folded(-1e-12, 0.0));
    let exact = 2.0 * 1e-3 * 6.0 / (1.6 * 1.6);
    assert!((plate(-1e-3) - exact).abs() < 1e-9, "{} {exact}", plate(-1e-3));
}
