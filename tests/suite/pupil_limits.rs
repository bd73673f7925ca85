//! Pupils whose limits move a little, and pupils without light, in closed form.

use aplanat::analysis::{PupilShape, pupil, spot};
use aplanat::lens::{Aperture, FieldKind, FieldPoint, Lens, Object, Surface, System, blank};
use aplanat::paraxial::Beam;
use aplanat::pupil::{Accuracy, Aiming, RayModel, Region, RegionKind, limited_by_stop};
use std::f64::consts::PI;

/// The radius of the entrance pupil, and the distance from it to the plane with a rim, in mm.
const RADIUS: f64 = 5.0;
const DISTANCE: f64 = 50.0;

/// A beam through the pupil that is displaced by `shift` at a plane 50 mm behind.
fn displaced(shift: f64, behind: &Surface<f64>) -> RayModel {
    let front = Surface::plane(DISTANCE, 1.0);
    let surfaces = vec![front, behind.clone(), Surface::plane(0.0, 1.0)];
    let system = System { index_before: 1.0, surfaces, stop: Some(0) };
    let edge = (shift / DISTANCE).atan().to_degrees();
    let beam = Beam {
        object: Object::Infinity,
        aperture: Aperture::EntrancePupilDiameter(2.0 * RADIUS),
        field: FieldKind::Angle,
        edge,
    };
    let fields = vec![FieldPoint { x: 0.0, y: edge, weight: 1.0 }];
    let model = RayModel::from_systems(vec![(0.55, 1.0, system)], 0, beam, Aiming::Paraxial);
    RayModel { fields, ..model.unwrap() }
}

fn with_rim(shift: f64, semi_diameter: f64) -> RayModel {
    displaced(shift, &Surface { semi_diameter, ..Surface::plane(DISTANCE, 1.0) })
}

fn region(model: &RayModel) -> Region<'_> {
    Region::new(model.launch(model.fields[0], 0).unwrap())
}

/// The area that two discs have in common, for radii and the distance of their centres.
fn overlap(r: f64, s: f64, d: f64) -> f64 {
    let a = ((d * d + r * r - s * s) / (2.0 * d * r)).acos();
    let b = ((d * d + s * s - r * r) / (2.0 * d * s)).acos();
    r * r * (a - 0.5 * (2.0 * a).sin()) + s * s * (b - 0.5 * (2.0 * b).sin())
}

#[test]
fn corners_between_the_pupil_and_a_rim_are_followed_with_few_rays() {
    let before = with_rim(4.0, 5.0);
    let before = region(&before).kind;
    assert!(matches!(before, RegionKind::StarShaped(_)), "{before:?}");
    for (shift, rim) in [(4.0, 5.0), (4.05, 5.0), (3.9, 4.95), (4.0, 5.1)] {
        let model = with_rim(shift, rim);
        let tracked = Region::track(&before, model.launch(model.fields[0], 0).unwrap());
        let area = tracked.trace_pupil(8).moments.area;
        let exact = overlap(RADIUS, rim, shift);
        assert!((area / exact - 1.0).abs() < 1e-9, "{shift} {rim}: {area} {exact}");
        let searched = region(&model).rays;
        assert!(4 * tracked.rays < searched, "{shift} {rim}: {} {searched}", tracked.rays);
    }
}

/// A rim that passes into the pupil changes the arcs of the edge: it is searched for around the former light.
#[test]
fn an_edge_whose_arcs_have_changed_is_found_near_the_former_light() {
    let before = with_rim(4.0, 5.0);
    let before = region(&before).kind;
    for (shift, rim) in [(0.1, 4.0), (-4.0, 5.0), (6.0, 1.5), (9.5, 5.0)] {
        let model = with_rim(shift, rim);
        let tracked = Region::track(&before, model.launch(model.fields[0], 0).unwrap());
        let area = tracked.trace_pupil(8).moments.area;
        let inside = rim + f64::abs(shift) <= RADIUS;
        let exact = if inside { PI * rim * rim } else { overlap(RADIUS, rim, f64::abs(shift)) };
        assert!((area / exact - 1.0).abs() < 1e-9, "{shift} {rim}: {area} {exact}");
    }
}

#[test]
fn light_comes_back_to_a_dark_pupil_and_darkness_takes_few_rays_to_see() {
    for (shift, rim) in [(4.0, 5.0), (0.1, 4.0), (9.5, 5.0)] {
        let model = with_rim(shift, rim);
        let launch = || model.launch(model.fields[0], 0).unwrap();
        let tracked = Region::track(&RegionKind::Dark, launch());
        assert_eq!(tracked.kind, Region::new(launch()).kind, "{shift} {rim}");
    }
    let dark = with_rim(12.0, 5.0);
    let launch = || dark.launch(dark.fields[0], 0).unwrap();
    let [tracked, searched] = [Region::track(&RegionKind::Dark, launch()), Region::new(launch())];
    assert!(tracked.is_dark() && searched.is_dark());
    assert!(30 * tracked.rays < searched.rays, "{} {}", tracked.rays, searched.rays);
}

/// A field beside the plane of the drawing has a pupil without a mirrored half: its arcs close.
#[test]
fn corners_all_around_a_pupil_are_followed_with_few_rays() {
    let aside = |shift: f64, rim: f64| {
        let mut model = with_rim(shift, rim);
        model.fields[0] = FieldPoint { x: model.fields[0].y, y: 0.0, weight: 1.0 };
        model
    };
    for (shift, rim, sign) in [(4.0, 5.0, 1.0), (1.0, 5.9, 1.0), (1.0, 5.9, -1.0)] {
        let before = aside(sign * shift, rim);
        let before = region(&before).kind;
        let model = aside(sign * (shift + 0.01), rim);
        let tracked = Region::track(&before, model.launch(model.fields[0], 0).unwrap());
        let area = tracked.trace_pupil(8).moments.area;
        let exact = overlap(RADIUS, rim, shift + 0.01);
        assert!((area / exact - 1.0).abs() < 1e-9, "{shift} {rim}: {area} {exact}");
        let searched = region(&model).rays;
        assert!(4 * tracked.rays < searched, "{shift} {rim}: {} {searched}", tracked.rays);
    }
}

/// A shadow of 2 mm in a pupil of 5 mm leaves a ring about the axis, and the dots that draw it are
/// spread evenly: their mean square distance is that of the ring, half the sum of both squares.
#[test]
fn the_dots_of_a_ring_fill_it_evenly() {
    let model = displaced(0.0, &Surface { obstruction: 2.0, ..Surface::plane(DISTANCE, 1.0) });
    let drawn = pupil(&model, model.fields[0], 0, Accuracy::default());
    let PupilShape::Irregular { pieces, dots } = drawn.shape else { panic!("{:?}", drawn.shape) };
    let mean = |of: &dyn Fn(&[f64; 2]) -> f64| dots.iter().map(of).sum::<f64>() / dots.len() as f64;
    assert!(pieces == 1 && dots.iter().all(|[x, y]| (2.0..=RADIUS).contains(&x.hypot(*y))));
    let square = mean(&|[x, y]| x * x + y * y);
    assert!((square / 14.5 - 1.0).abs() < 0.02, "{square}");
    assert!(mean(&|[x, _]| *x).abs() < 1e-9 && mean(&|[_, y]| *y).abs() < 1e-9);
}

/// The mean over the pupil of a function of the place, by the midpoints of 200 x 200 cells.
fn mean(of: impl Fn(f64, f64) -> f64) -> f64 {
    let at = |i: usize| RADIUS * ((i as f64 + 0.5) / 100.0 - 1.0);
    let cells = (0..40_000).map(|i| (at(i % 200), at(i / 200)));
    let inside: Vec<f64> =
        cells.filter(|(x, y)| x.hypot(*y) < RADIUS).map(|(x, y)| of(x, y)).collect();
    inside.iter().sum::<f64>() / inside.len() as f64
}

#[test]
fn a_dark_pupil_is_as_deep_as_its_rays_are_far_from_light() {
    let blocked = |obstruction: f64| Surface { obstruction, ..Surface::plane(DISTANCE, 1.0) };
    for (model, exact) in [
        (displaced(0.0, &blocked(7.5)), mean(|x, y| 7.5 - x.hypot(y))),
        (displaced(1.0, &blocked(9.0)), mean(|x, y| 9.0 - x.hypot(y + 1.0))),
        (with_rim(12.0, 6.0), mean(|x, y| x.hypot(y + 12.0) - 6.0)),
        (with_rim(8.0, 2.0), mean(|x, y| x.hypot(y + 8.0) - 2.0)),
    ] {
        let pupil = region(&model).trace_pupil(0);
        assert!(!pupil.has_light());
        let depth = pupil.dark.as_ref().unwrap().depth() * RADIUS;
        // The mean over a grid of 9 x 9 rays against that over the disc.
        assert!((depth / exact - 1.0).abs() < 0.1, "{depth} {exact}");
        let area = -pupil.signed_area();
        assert!((area / (PI * RADIUS * depth) - 1.0).abs() < 0.02, "{area} {depth}");
    }
}

/// The image plane shows the pupil itself: what two discs of 5 mm have in common.
#[test]
fn the_farthest_ray_of_a_clipped_spot_is_at_a_corner_of_its_pupil() {
    // Whole; and with a shadow across the middle that leaves two pieces, of which samples are traced
    // that hardly reach into the corners.
    for (shift, shadow, allowed) in [(4.0, 0.0, 1e-4), (8.0, 1.5, 0.03)] {
        let mut model = displaced(0.5 * shift, &Surface::plane(DISTANCE, 1.0));
        let mut system = model.channels[0].system.clone();
        system.surfaces[1].obstruction = shadow;
        let rim = Surface { semi_diameter: 5.0, ..Surface::plane(DISTANCE, 1.0) };
        system.surfaces.insert(2, rim);
        let edge = model.beam;
        let fields = model.fields.clone();
        model =
            RayModel::from_systems(vec![(0.55, 1.0, system)], 0, edge, Aiming::Paraxial).unwrap();
        model.fields = fields;
        let accuracy = Accuracy { tolerance: 1e-4, max_rays: 200_000 };
        let radius = spot(&model, model.fields[0], accuracy).unwrap().radius;
        let exact = (RADIUS * RADIUS - 0.25 * shift * shift).sqrt();
        assert!((radius.value / exact - 1.0).abs() <= allowed, "{radius:?} {exact}");
        assert!((radius.value - exact).abs() <= radius.error + 1e-9, "{radius:?} {exact}");
        assert!(radius.error <= allowed * exact, "{shift}: {radius:?}");
    }
}

/// The size of the stop that a beam is given by counts, not the rim of its row.
#[test]
fn a_beam_given_by_its_stop_keeps_its_light_when_it_is_limited_by_it() {
    let mut lens = blank();
    lens.surfaces[0].curvature = 0.02;
    let light = |lens: &Lens| {
        let model = RayModel::from_lens(lens, 0).unwrap();
        spot(&model, lens.fields.values[0], Accuracy::default()).unwrap().light.value
    };
    for (size, rim) in [(4.0, 6.0), (6.0, 4.0)] {
        lens.aperture = Aperture::StopSemiDiameter(size);
        lens.surfaces[0].semi_diameter = Some(rim);
        let limited = limited_by_stop(&lens).unwrap();
        assert_eq!(limited.aperture, lens.aperture);
        let (before, after) = (light(&lens), light(&limited));
        assert!((before / (PI * size * size) - 1.0).abs() < 1e-3, "{size} {rim}: {before}");
        assert!((after / before - 1.0).abs() < 1e-6, "{size} {rim}: {before} {after}");
    }
}
