//! Hard cases of gradients in a prescription: rays that turn, leave through the side or never
//! arrive, gaps of zero length, strong gradients, clipped pupils, single precision, files.

use super::lens::{busy, lens_of, ray, system};
use aplanat::effects::{self, Effect, EffectOverride, EffectOverrides, TracePurpose};
use aplanat::files::{self, json};
use aplanat::lens::{
    Lens, Medium, PROFILE_TERMS, Parameter, ParameterKind, ProfileCoefficients, ProfileLaw,
    Quantity, Shape, System, Variable, ZoomNumber, ZoomPosition, add_variables,
};
use aplanat::math::{Real, Vec3};
use aplanat::merit::{Goal, LimitTreatment, Merit, PupilEdge, Term, WeightedTerm};
use aplanat::optimize::{DescentMethod, start};
use aplanat::paraxial::{Beam, first_order};
use aplanat::pupil::{
    Accuracy, Aiming, DerivativeEstimator, QuadraticIntegrand, RayModel, Region, RegionKind,
    differentiate,
};
use aplanat::trace::{
    Fate, Landings, Ray, RayLimit, Rays, SurfaceParameter, SystemGradient, TraceSink, Tracer,
};

/// A parabolic rod of half a pitch: what enters on the axis leaves on it.
fn half_pitch(semi_diameter: f64) -> Lens {
    let (n, g) = (1.6_f64, 0.3_f64);
    let (length, radial) = (std::f64::consts::PI / g, -(n * g) * (n * g));
    lens_of(
        &format!(
            r#"{{"thickness": {length}, "glass": {{"gradient": {{"base": {{"index": 1.6}},
            "of": "square", "radial": [{radial}]}}}}, "semi_diameter": {semi_diameter},
            "stop": true}}, {{"thickness": 1.0, "semi_diameter": {semi_diameter}}}"#
        ),
        r#"{"entrance_pupil_diameter": 1.0}"#,
    )
}

#[test]
fn grin_lens_a_ray_that_swings_out_too_far_leaves_through_the_side() {
    let tracer = Tracer::new(&system(&half_pitch(1.0))).unwrap();
    let slanted = |sine: f64| {
        let at = ray(0.0, 0.0, 0.0, sine);
        // To the vertex.
        Ray { point: at.direction * -1.0, ..at }
    };
    // It swings out to sin/(n g) at a quarter of a pitch and comes back to the axis.
    for (sine, fate) in [(0.47, Fate::Imaged), (0.4799, Fate::Imaged), (0.4801, Fate::Clipped(1))] {
        assert_eq!(tracer.trace(slanted(sine)).fate, fate, "{sine}");
        let mut side = None;
        tracer.margins(slanted(sine), |i, hurdle, margin| {
            if hurdle == RayLimit::Side {
                side = Some((i, margin));
            }
        });
        let (surface, margin) = side.unwrap();
        let exact = 1.0 - (sine / 0.48_f64).powi(2);
        assert!(surface == 1 && (margin - exact).abs() < 1e-8, "{margin} {exact}");
    }
    // Without a rim nothing is lost.
    let open = Tracer::new(&system(&half_pitch(1.0))).unwrap().without_rims();
    assert!(open.trace(slanted(0.55)).fate.is_imaged());
}

/// Layers whose index falls from 1.7 to 1.2 behind a plane in a medium of 1.7.
fn layers() -> Lens {
    let mut lens = lens_of(
        r#"{"thickness": 5.0, "glass": {"gradient": {"base": {"index": 1.7}, "axial": [-0.1]}},
        "stop": true}, {"thickness": 1.0}"#,
        r#"{"entrance_pupil_diameter": 1.0}"#,
    );
    lens.object_medium = Medium::Index(1.7);
    lens
}

#[test]
fn grin_lens_a_ray_that_turns_back_has_its_own_fate() {
    let system = system(&layers());
    let tracer = Tracer::new(&system).unwrap();
    // n sin θ = 1.53 is the index 1.7 mm behind the face; 1.19 is lower than any.
    let lost = tracer.trace(ray(0.0, 0.0, 0.0, 0.9));
    assert_eq!(lost.fate, Fate::Turned(1));
    assert!(lost.ray.point.is_finite() && lost.ray.direction.is_finite());
    assert_eq!(tracer.trace(ray(0.0, 0.0, 0.0, 0.55)).fate, Fate::Imaged);
    assert_eq!(tracer.trace(ray(0.0, 0.0, 0.0, 0.65)).fate, Fate::TotalReflection(1));
    let rays: Rays<f64> = [0.9, 0.3].into_iter().map(|m| ray(0.0, 0.0, 0.0, m)).collect();
    let mut hits = Landings::default();
    tracer.trace_batch(&rays, &mut hits);
    assert_eq!((hits.fate(0), hits.x[0], hits.opl[0]), (Fate::Turned(1), 0.0, 0.0));
    assert_eq!((hits.fates().turned, hits.fates().imaged, hits.fates().total()), (1, 1, 2));
    let path = tracer.polyline(ray(0.0, 0.0, 0.0, 0.9));
    assert_eq!(path.fate, Fate::Turned(1));
    let bent = tracer.polyline(ray(0.0, 0.0, 0.0, 0.5));
    assert!(bent.points.len() > 20 && bent.heights.len() == 3);
    assert!(bent.points.iter().all(|p| p.is_finite()));
    assert!(bent.points.windows(2).all(|pair| pair[1].z > pair[0].z));
}

#[test]
fn grin_lens_rays_outside_the_valid_index_end_with_a_fate() {
    // Far outside any glass the polynomial falls to zero and below.
    for law in [ProfileLaw::Index, ProfileLaw::Square] {
        let mut system = system(&half_pitch(0.5));
        let mut terms = [0.0; PROFILE_TERMS];
        terms[0] = 0.3;
        terms[1] = -0.5;
        system.surfaces[0].grin =
            Some(ProfileCoefficients { reach: 0.5, ..ProfileCoefficients::new(law, terms) });
        for surface in &mut system.surfaces {
            surface.semi_diameter = f64::INFINITY;
        }
        let tracer = Tracer::new(&system).unwrap();
        let mut lost = 0;
        for y in [0.0, 0.4, 1.0, 1.3, 1.6, 2.5, 10.0] {
            let landing = tracer.trace(ray(0.0, y, 0.0, 0.1));
            assert!(landing.ray.point.is_finite() || !landing.fate.is_imaged(), "{law:?} {y}");
            lost += usize::from(!landing.fate.is_imaged());
        }
        assert!(lost >= 3, "{law:?}: {lost}");
    }
}

#[test]
fn grin_lens_an_index_below_one_and_gradients_too_strong_are_refused_by_name() {
    let mut lens = half_pitch(1.0);
    let parameter = Parameter::new(0, Quantity::Grin(0));
    assert!(lens.set(parameter, -2.0));
    let message = lens.resolve(0, 0.5876).unwrap_err().to_string();
    assert!(
        message.contains("the GRIN medium after surface 1 falls to the index 0.7"),
        "{message}"
    );
    // Thirty thousand turns on the way.
    let strong = lens_of(
        r#"{"thickness": 500.0, "glass": {"gradient": {"base": {"index": 1.6}, "of": "sech",
        "radial": [100.0]}}, "semi_diameter": 0.005, "stop": true},
        {"thickness": 1.0, "semi_diameter": 0.005}"#,
        r#"{"entrance_pupil_diameter": 0.001}"#,
    );
    let message = Tracer::new(&system(&strong)).unwrap_err().to_string();
    assert!(message.contains("after surface 1 is too strong for 4096 steps"), "{message}");
    let mut bad = system(&half_pitch(1.0));
    bad.surfaces[0].grin =
        Some(ProfileCoefficients::new(ProfileLaw::Index, [f64::NAN; PROFILE_TERMS]));
    assert!(Tracer::new(&bad).unwrap_err().to_string().contains("GRIN coefficient"));
}

#[test]
fn grin_lens_gaps_without_length_and_crossing_faces_are_traced() {
    let mut lens = busy("index", &[-0.01], &[0.01]);
    // No length at all: a plane against a plane.
    lens.surfaces[0].asphere.clear();
    for row in &mut lens.surfaces[..3] {
        (row.curvature, row.conic) = (0.0, 0.0);
    }
    for row in &mut lens.surfaces[..2] {
        row.thickness = 0.0;
    }
    let mut without = lens.clone();
    without.surfaces[0].medium = Medium::Air;
    without.surfaces[1].medium = Medium::Air;
    let [with, without] = [&lens, &without]
        .map(|lens| Tracer::new(&system(lens)).unwrap().trace(ray(0.1, 0.8, 0.0, 0.1)));
    assert_eq!(with.fate, without.fate);
    let off = with.ray.point - without.ray.point;
    assert!(off.dot(off).sqrt() < 1e-12, "{off:?}");
    // Two faces that cross: at the rim light goes back, and forward again.
    let crossing = lens_of(
        r#"{"curvature": 0.1, "thickness": 0.05, "glass": {"gradient": {"base": {"index": 1.6},
        "radial": [-0.01], "axial": [0.01]}}, "stop": true}, {"curvature": -0.1, "thickness": 5.0}"#,
        r#"{"entrance_pupil_diameter": 2.0}"#,
    );
    let tracer = Tracer::new(&system(&crossing)).unwrap();
    let landing = tracer.trace(ray(0.0, 1.5, 0.0, 0.0));
    assert!(landing.fate.is_imaged() && landing.first_backward_surface == Some(1), "{landing:?}");
    let mut glass = system(&crossing);
    glass.surfaces[0].grin = None;
    let straight = Tracer::new(&glass).unwrap().trace(ray(0.0, 1.5, 0.0, 0.0));
    assert!((landing.ray.point.y - straight.ray.point.y).abs() < 0.2);
}

#[test]
fn grin_lens_single_precision_is_good_to_its_digits() {
    let lens = busy("index", &[-0.01, 2e-4], &[0.01, -0.002]);
    let exact = Tracer::new(&system(&lens)).unwrap();
    let rough = Tracer::<f32>::new(&system(&lens).cast()).unwrap();
    for at in [ray(0.3, 0.9, 0.02, -0.03), ray(0.0, 0.0, 0.0, 0.1), ray(-0.7, 0.2, 0.1, 0.0)] {
        let cast = |v: Vec3<f64>| Vec3::new(v.x as f32, v.y as f32, v.z as f32);
        let landing = rough.trace(Ray { point: cast(at.point), direction: cast(at.direction) });
        let there = exact.trace(at);
        assert_eq!(landing.fate, there.fate);
        assert!((f64::from(landing.ray.point.y) - there.ray.point.y).abs() < 2e-5);
        assert!((Real::value(landing.opl) - there.opl).abs() < 1e-4);
    }
}

/// A lens with gradients whose rims clip at the edge of the field.
fn clipped() -> Lens {
    let mut lens = busy("index", &[-0.01, 2e-4], &[0.01, -0.002]);
    lens.aperture = aplanat::lens::Aperture::StopSemiDiameter(1.6);
    for (row, radius) in lens.surfaces.iter_mut().zip([2.0, 1.6, 1.7, 1.75, 1.85]) {
        row.semi_diameter = Some(radius);
    }
    lens.fields.values[1].y = 12.0;
    lens
}

/// The derivative along the edge of a pupil against that by differences, for every number.
fn agree(region: &Region<'_>, cost: &QuadraticIntegrand) -> SystemGradient<f64> {
    const ORDER: usize = 7;
    let edge = region.trace_pupil(ORDER).boundary_derivative(cost).unwrap();
    let found = region.difference_derivative(cost, ORDER).unwrap().gradient;
    let mut worst: f64 = 0.0;
    for (i, surface) in region.launch.channel().system.surfaces.iter().enumerate() {
        for slot in SurfaceParameter::all().filter(|slot| slot.exists_on(surface)) {
            let (a, b) = (edge.surfaces[i].by(slot), found.surfaces[i].by(slot));
            let scale = found.largest(slot);
            let off = if a == b { 0.0 } else { (a - b).abs() / scale };
            worst = worst.max(off);
            assert!(off <= 1e-6, "{slot:?} of {i}: {a} {b} of {scale}");
        }
    }
    println!("along the edge against differences, worst {worst:.1e}");
    edge
}

#[test]
fn grin_lens_the_pupil_edge_depends_on_every_parameter() {
    let lens = clipped();
    let model = RayModel::with_aiming(&lens, 0, Aiming::Paraxial).unwrap();
    let region = Region::new(model.launch(lens.fields.values[1], 0).unwrap());
    let RegionKind::StarShaped(boundary) = &region.kind else { panic!("{:?}", region.kind) };
    assert!(boundary.arcs.len() > 1, "{} arcs", boundary.arcs.len());
    for cost in [
        QuadraticIntegrand::throughput(),
        QuadraticIntegrand::spread(region.trace_pupil(4).moments.centroid),
    ] {
        agree(&region, &cost);
    }
    let refused = differentiate(
        &region,
        &QuadraticIntegrand::throughput(),
        DerivativeEstimator::Warp,
        Accuracy { tolerance: 1e-2, max_rays: 10_000 },
    );
    let message = refused.unwrap_err().to_string();
    assert!(message.contains("has no warp field; expected the method `boundary`"), "{message}");
}

#[test]
fn grin_lens_the_side_of_a_rod_limits_its_pupil() {
    // A rod whose middle is where a slanted beam is widest.
    let mut lens = half_pitch(1.0);
    lens.surfaces[1].semi_diameter = Some(0.97);
    lens.aperture = aplanat::lens::Aperture::StopSemiDiameter(1.0);
    lens.fields.values[1].y = 20.0;
    let model = RayModel::with_aiming(&lens, 0, Aiming::Paraxial).unwrap();
    let region = Region::new(model.launch(lens.fields.values[1], 0).unwrap());
    let edge = agree(&region, &QuadraticIntegrand::throughput());
    // It is the side that clips, and a wider rod lets more light through.
    assert!(edge.surfaces[0].semi_diameter < -0.1, "{}", edge.surfaces[0].semi_diameter);
}

fn step(quantity: Quantity) -> f64 {
    match quantity {
        Quantity::Curvature | Quantity::Index => 1e-4,
        Quantity::Grin(1) => 1e-6,
        Quantity::Grin(_) => 1e-5,
        _ => 1e-3,
    }
}

#[test]
fn grin_lens_every_term_has_the_derivative_of_its_value_by_the_gradient() {
    let mut lens = busy("index", &[-0.01, 2e-4], &[0.01, -0.002]);
    lens.image_solve = Some(0.0);
    for (surface, quantity) in [
        (0, Quantity::Grin(0)),
        (0, Quantity::Grin(1)),
        (0, Quantity::Grin(6)),
        (1, Quantity::Grin(0)),
        (0, Quantity::Index),
        (0, Quantity::Thickness),
        (1, Quantity::Curvature),
    ] {
        crate::merit::vary(&mut lens, surface, quantity);
    }
    for term in [Term::Spot, Term::FocalLength(15.0), Term::Distortion, Term::BackFocus(20.0)] {
        crate::merit::check(&lens, term, PupilEdge::Frozen, step);
    }
    // A coefficient that is zero and varies makes a gradient of a gap that was none.
    let mut zero = busy("square", &[0.0], &[]);
    crate::merit::vary(&mut zero, 0, Quantity::Grin(0));
    crate::merit::vary(&mut zero, 0, Quantity::Grin(7));
    crate::merit::check(&zero, Term::Spot, PupilEdge::Frozen, step);
    let mut clipped = clipped();
    for quantity in [Quantity::Grin(0), Quantity::Grin(6), Quantity::SemiDiameter] {
        crate::merit::vary(&mut clipped, 0, quantity);
    }
    for term in [Term::Spot, Term::Throughput] {
        crate::merit::check(&clipped, term, PupilEdge::Moving, step);
    }
}

#[test]
fn grin_lens_a_gradient_moves_with_the_zoom() {
    let mut lens = busy("index", &[-0.01, 2e-4], &[0.01]);
    let at = |thickness: f64| ZoomPosition {
        numbers: vec![ZoomNumber::thickness(0, thickness)],
        ..ZoomPosition::default()
    };
    lens.zoom = vec![at(3.0), at(3.5)];
    let lengths = [0, 1].map(|zoom| {
        let system = lens.resolve(zoom, 0.5875618).unwrap();
        first_order(&system, &Beam::for_lens(&lens, zoom)).unwrap().efl.unwrap()
    });
    assert!((lengths[0] - lengths[1]).abs() > 1e-3);
    crate::merit::vary_at(&mut lens, Parameter::at_zoom(0, Quantity::Thickness, 1));
    crate::merit::vary(&mut lens, 0, Quantity::Grin(1));
    crate::merit::check(&lens, Term::Spot, PupilEdge::Frozen, step);
}

#[test]
fn grin_lens_a_search_finds_the_term_in_r4_that_sharpens_a_rod() {
    // The secant, whose rays all come together, is a parabola with a term in r⁴.
    let (n, g) = (1.6_f64, 0.3_f64);
    let length = 0.8 * std::f64::consts::FRAC_PI_2 / g;
    let mut lens = lens_of(
        &format!(
            r#"{{"thickness": {length}, "glass": {{"gradient": {{"base": {{"index": {n}}},
            "radial": [{}, 0.0]}}}}, "semi_diameter": 1.5, "stop": true}},
            {{"thickness": 1.0, "semi_diameter": 1.5}}"#,
            -n * g * g / 2.0
        ),
        r#"{"entrance_pupil_diameter": 2.4}"#,
    );
    lens.fields.values.truncate(1);
    lens.image_solve = Some(0.0);
    lens.variables =
        vec![Variable { parameter: Parameter::new(0, Quantity::Grin(1)), min: None, max: None }];
    let goal = Goal {
        terms: vec![WeightedTerm::new(Term::Spot, 1.0)],
        zoom_ratios: Vec::new(),
        limits: LimitTreatment::default(),
        pupil: PupilEdge::Frozen,
    };
    let before = Merit::new(&lens, &goal, 1e-6).unwrap().terms(&[0.0]).unwrap()[0].value.sqrt();
    let mut search = start(DescentMethod::DampedLeastSquares, &lens, &goal, 1e-6).unwrap();
    for _ in 0..40 {
        if search.step().finished {
            break;
        }
    }
    let best = search.best();
    let after = search.terms().unwrap()[0].value.sqrt();
    let found = best.get(Parameter::new(0, Quantity::Grin(1))).unwrap();
    println!("RMS radius {before:.2e} to {after:.2e} mm, r^4 {found:.3e}");
    assert!(after < 0.1 * before, "{before} {after}");
    // 5/24 n g⁴ is that of the secant; the plane face wants a little less.
    let secant = 5.0 / 24.0 * n * g.powi(4);
    assert!(found > 0.3 * secant && found < 2.0 * secant, "{found} {secant}");
}

#[test]
fn grin_lens_files_round_trip_and_name_errors() {
    for mut lens in [
        busy("square", &[-0.03, 5e-4], &[0.02, 0.1 + 0.2 - 0.3]),
        busy("sech", &[0.1], &[]),
        busy("index", &[], &[-1.5e-7]),
    ] {
        add_variables(&mut lens, &[ParameterKind::GrinCoefficients]);
        assert!(lens.variables.len() >= 3);
        let text = json::write(&lens);
        let back = json::read(&text, "a.json").unwrap();
        assert_eq!(back, lens);
        assert_eq!(json::write(&back), text);
    }
    let text = json::write(&busy("index", &[-0.01], &[0.01]));
    let message = |from: &str, to: &str| {
        assert!(text.contains(from), "{from} in {text}");
        json::read(&text.replacen(from, to, 1), "a.json").unwrap_err().to_string()
    };
    assert!(message("\"radial\"", "\"raidal\"").contains("the unknown key `raidal`"));
    assert!(
        message("[-0.01]", "[1,2,3,4,5,6,7]").contains("7 radial coefficients; expected at most 6")
    );
    assert!(message("\"axial\": [0.01]", "\"of\": \"sech\", \"radial\": [1, 2]").len() > 10);
    assert!(
        message("\"base\": {\"nd\": 1.62, \"vd\": 40.0}", "\"base\": null")
            .contains("no glass as its base")
    );
    let mut last = busy("index", &[-0.01], &[]);
    last.surfaces[4].medium = last.surfaces[0].medium.clone();
    assert!(last.check().unwrap_err().to_string().contains("leads to the image"));
    let mut mirror = busy("index", &[-0.01], &[]);
    mirror.surfaces[2].medium = Medium::Mirror;
    assert!(mirror.check().unwrap_err().to_string().contains("ends at a mirror"));
    let mut front = busy("index", &[-0.01], &[]);
    front.object_medium = front.surfaces[0].medium.clone();
    assert!(front.check().unwrap_err().to_string().contains("object space"));
}

#[test]
fn grin_lens_the_bundled_rod_is_that_of_the_catalogue() {
    let lens = files::open("lenses/grin_rod_melles_griot.json").unwrap().lens;
    let system = lens.resolve(0, 0.63).unwrap();
    let data = first_order(&system, &Beam::for_lens(&lens, 0)).unwrap();
    let (n, g, length) = (1.608_f64, 0.339_f64, lens.surfaces[0].thickness);
    let (sin, cos) = (g * length).sin_cos();
    assert!((data.efl.unwrap() - 1.0 / (n * g * sin)).abs() < 1e-9);
    assert!((data.bfl.unwrap() - cos / (n * g * sin)).abs() < 1e-9);
    // The catalogue's own rod of 5.37 mm: its pitch, and the distance of its focus from its face.
    let mut rod = lens;
    rod.surfaces[0].thickness = 5.37;
    rod.image_solve = None;
    let data = first_order(&rod.resolve(0, 0.63).unwrap(), &Beam::for_lens(&rod, 0)).unwrap();
    assert!((g * 5.37 / std::f64::consts::TAU - 0.29).abs() < 5e-3);
    assert!((data.bfl.unwrap().abs() - 0.46).abs() < 0.01, "{:?}", data.bfl);
}

#[test]
fn grin_lens_effects_say_what_a_gradient_costs_and_leave_out_none() {
    let task = TracePurpose::Spot(1e-2);
    let planned = |lens: &Lens, choices: &EffectOverrides| {
        effects::plan(&effects::measure_effects(lens, 0).unwrap(), task, choices)
    };
    let rod = files::open("lenses/grin_rod_melles_griot.json").unwrap().lens;
    let auto = planned(&rod, &EffectOverrides::default());
    let decision = auto.decision(Effect::GradientIndex).unwrap();
    assert!(decision.computed && decision.surfaces == [0], "{decision:?}");
    assert!(decision.reason.contains("steps"), "{}", decision.reason);
    let off =
        planned(&rod, &EffectOverrides::default().with(Effect::GradientIndex, EffectOverride::Off));
    let model = effects::build_ray_model(&rod, 0, &off).unwrap();
    assert!(!model.has_grin() && effects::build_ray_model(&rod, 0, &auto).unwrap().has_grin());
    let even = busy("index", &[0.0], &[]);
    let mut even = even;
    even.surfaces[1].medium = Medium::Index(1.55);
    let decision = planned(&even, &EffectOverrides::default());
    let decision = decision.decision(Effect::GradientIndex).unwrap();
    assert!(!decision.computed && decision.surfaces.is_empty(), "{decision:?}");
}

#[test]
fn grin_lens_reversed_rays_retrace_their_path() {
    let system = system(&busy("square", &[-0.03, 5e-4], &[0.02, 0.003]));
    let there = Tracer::new(&system).unwrap().trace(ray(0.2, 0.7, 0.03, -0.05));
    assert!(there.fate.is_imaged());
    let last = system.surfaces.len() - 2;
    let back = system.reversed(1.0);
    assert!(back.surfaces[last - 1].grin.is_some() && back.surfaces[0].grin.is_none());
    // From the image back to where it came from: the reversed lens lies the other way round.
    let turned = |v: Vec3<f64>| Vec3::new(v.x, v.y, -v.z);
    let start = turned(there.ray.point) - Vec3::new(0.0, 0.0, system.surfaces[last].thickness);
    let direction = turned(there.ray.direction * -1.0);
    let landing = Tracer::new(&back).unwrap().trace(Ray { point: start, direction });
    let at = ray(0.2, 0.7, 0.03, -0.05);
    assert!((landing.ray.point.x - at.point.x).abs() < 1e-8, "{landing:?}");
    assert!((landing.ray.point.y - at.point.y).abs() < 1e-8, "{landing:?}");
    assert!((landing.opl - there.opl).abs() < 1e-8);
}

/// The shape of every face, for a system without one.
#[test]
fn grin_lens_a_gap_needs_two_refracting_faces() {
    let mut system: System<f64> = system(&half_pitch(1.0));
    system.surfaces[1].mirror = true;
    assert!(Tracer::new(&system).unwrap_err().to_string().contains("touches a mirror"));
    system.surfaces[1].mirror = false;
    system.surfaces[0].shape = Shape::Sphere { curvature: 0.1 };
    system.surfaces[0].hyperhemisphere = true;
    assert!(Tracer::new(&system).unwrap_err().to_string().contains("hyperhemisphere"));
}
