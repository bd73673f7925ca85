//! Apertures that are no circles about the vertex: areas, moments and derivatives in closed form at a thin
//! ideal lens, fates of single rays and of bundles, files, edits, and numbers that are wrong.

use aplanat::files;
use aplanat::lens::{
    Aperture, ApertureShape, BlockedSide, Edit, FieldPoint, IdealElement, Lens, Medium, Row,
    SurfaceAperture, apply_edit, blank,
};
use aplanat::math::Vec3;
use aplanat::pupil::{
    Accuracy, DerivativeEstimator, QuadraticIntegrand, RayModel, Region, RegionKind,
    choose_estimator, differentiate,
};
use aplanat::trace::{
    Fate, ImagePoints, Landings, Ray, RayLimit, Rays, SurfaceParameter, TraceSink, Tracer,
};
use std::f64::consts::PI;

/// The radius of the beam in mm; the lens has the focal length 100 mm, and the image plane stands at 80 mm.
const BEAM: f64 = 10.0;
const DEFOCUS: f64 = 0.2;
/// The order of quadrature at which derivatives are compared with differences.
const ORDER: usize = 9;

/// A stop with these apertures in a beam, 5 mm in front of a thin ideal lens.
fn lens(apertures: &[SurfaceAperture]) -> Lens {
    let mut lens = blank();
    lens.aperture = Aperture::EntrancePupilDiameter(2.0 * BEAM);
    let plane = Row { medium: Medium::Air, ..Row::default() };
    let stop = Row { thickness: 5.0, stop: true, apertures: apertures.to_vec(), ..plane.clone() };
    let ideal = Some(IdealElement::Lens { focal_length: 100.0 });
    lens.surfaces = vec![stop, Row { thickness: 100.0 * (1.0 - DEFOCUS), ideal, ..plane }];
    lens
}

fn frame(shape: ApertureShape) -> SurfaceAperture {
    SurfaceAperture::inside(shape)
}

fn block(shape: ApertureShape) -> SurfaceAperture {
    SurfaceAperture::obscuration(shape)
}

fn rectangle(half_width: f64, half_height: f64) -> ApertureShape {
    ApertureShape::Rectangle { half_width, half_height }
}

fn ellipse(half_width: f64, half_height: f64) -> ApertureShape {
    ApertureShape::Ellipse { half_width, half_height }
}

fn circle(radius: f64) -> ApertureShape {
    ApertureShape::Circle { radius }
}

fn polygon(points: &[[f64; 2]]) -> ApertureShape {
    ApertureShape::Polygon { points: points.to_vec() }
}

fn at(aperture: SurfaceAperture, center: [f64; 2], angle: f64) -> SurfaceAperture {
    SurfaceAperture { center, angle, ..aperture }
}

/// Area in mm², centroid on the image plane in mm, and RMS distance from it, with the rays of the highest
/// order asked for.
struct Light {
    area: f64,
    centroid: [f64; 2],
    rms: f64,
    errors: [f64; 4],
}

fn light(lens: &Lens, field: f64, tolerance: f64) -> Light {
    let model = RayModel::from_lens(lens, 0).unwrap();
    let field = FieldPoint { x: 0.0, y: field, weight: 1.0 };
    let region = Region::new(model.launch(field, 0).unwrap());
    let accuracy = Accuracy { tolerance, max_rays: 2_000_000 };
    let numbers = |nodes: &aplanat::pupil::Nodes| {
        let found = region.moments(nodes);
        Some([found.area, found.centroid[0], found.centroid[1], found.rms_radius()])
    };
    let scales = |[area, _, _, rms]: &[f64; 4]| [*area, *rms, *rms, *rms];
    let found = aplanat::pupil::converge(&region, accuracy, numbers, scales).unwrap();
    let [area, x, y, rms] = found.values;
    Light { area, centroid: [x, y], rms, errors: found.errors }
}

fn disc() -> f64 {
    PI * BEAM * BEAM
}

/// Frames, obscurations and both, of every form, each with its area in closed form.
#[test]
fn areas_of_apertures_are_those_of_plane_figures() {
    let triangle = [[0.0, 5.0], [-4.0, -3.0], [4.0, -3.0]];
    let notched = [[-4.0, -4.0], [4.0, -4.0], [4.0, 4.0], [0.0, 1.0], [-4.0, 4.0]];
    let cases: Vec<(&str, Vec<SurfaceAperture>, f64)> = vec![
        ("rectangle", vec![frame(rectangle(4.0, 2.0))], 32.0),
        ("turned rectangle", vec![at(frame(rectangle(4.0, 2.0)), [1.0, -2.0], 30.0)], 32.0),
        ("slit", vec![at(frame(rectangle(6.0, 0.3)), [0.0; 2], 20.0)], 7.2),
        ("ellipse", vec![frame(ellipse(4.0, 2.0))], 8.0 * PI),
        ("turned ellipse", vec![at(frame(ellipse(4.0, 2.0)), [-3.0, 1.0], 70.0)], 8.0 * PI),
        ("decentred circle", vec![at(frame(circle(3.0)), [5.0, 2.0], 0.0)], 9.0 * PI),
        ("triangle", vec![frame(polygon(&triangle))], 32.0),
        ("turned triangle", vec![at(frame(polygon(&triangle)), [1.0, 1.0], -40.0)], 32.0),
        ("notched polygon", vec![frame(polygon(&notched))], 64.0 - 12.0),
        ("hole", vec![block(rectangle(3.0, 2.0))], disc() - 24.0),
        ("decentred hole", vec![at(block(rectangle(3.0, 2.0)), [4.0, 1.0], 15.0)], disc() - 24.0),
        (
            "elliptical hole",
            vec![at(block(ellipse(3.0, 2.0)), [1.0, 1.0], 15.0)],
            disc() - 6.0 * PI,
        ),
        ("decentred stop", vec![at(block(circle(3.0)), [-4.0, 1.0], 0.0)], disc() - 9.0 * PI),
        ("triangular hole", vec![block(polygon(&triangle))], disc() - 32.0),
        ("knife edge", vec![at(block(rectangle(50.0, 10.0)), [0.0, 10.0], 0.0)], 0.5 * disc()),
        (
            "edge at 30 deg",
            vec![at(block(rectangle(50.0, 50.0)), [-25.0, 43.301_270_189_221_93], 30.0)],
            0.5 * disc(),
        ),
        (
            "two frames",
            vec![frame(rectangle(4.0, 4.0)), at(frame(rectangle(4.0, 4.0)), [3.0, 0.0], 0.0)],
            40.0,
        ),
        (
            "a frame and its hole",
            vec![frame(rectangle(5.0, 5.0)), block(circle(2.0))],
            100.0 - 4.0 * PI,
        ),
        (
            "a corner of a hole",
            vec![frame(rectangle(5.0, 5.0)), at(block(rectangle(3.0, 3.0)), [5.0, 5.0], 0.0)],
            91.0,
        ),
        ("an obscuration beside the beam", vec![at(block(circle(3.0)), [20.0, 2.0], 0.0)], disc()),
        ("a frame around the beam", vec![frame(rectangle(50.0, 60.0))], disc()),
        ("obscurations of no size", vec![block(circle(0.0)), block(rectangle(0.0, 3.0))], disc()),
    ];
    for (name, apertures, area) in cases {
        let lens = lens(&apertures);
        for field in [0.0, 8.0] {
            let found = light(&lens, field, 1e-9);
            let error = (found.area - area).abs();
            assert!(error <= 1e-9 * area, "{name} at {field}: {} and not {area}", found.area);
        }
    }
}

/// What a uniform beam does behind a square, half a disc and a decentred circle, out of focus: the image is
/// the aperture times the defocus.
#[test]
fn moments_of_apertures_are_those_of_plane_figures() {
    let spot = |apertures: &[SurfaceAperture]| light(&lens(apertures), 0.0, 1e-9);
    let square = spot(&[frame(rectangle(3.0, 3.0))]);
    let rms = DEFOCUS * (2.0 * 9.0_f64 / 3.0).sqrt();
    assert!((square.rms - rms).abs() < 1e-10 * rms, "{} and not {rms}", square.rms);
    assert!(square.errors[3] < 1e-8 * rms);
    let oblong = spot(&[at(frame(rectangle(4.0, 1.0)), [2.0, -1.0], 35.0)]);
    let rms = DEFOCUS * (17.0_f64 / 3.0).sqrt();
    assert!((oblong.rms - rms).abs() < 1e-10 * rms, "{} and not {rms}", oblong.rms);
    let centre = [2.0, -1.0].map(|v: f64| DEFOCUS * v);
    let apart = (oblong.centroid[0] - centre[0]).hypot(oblong.centroid[1] - centre[1]);
    assert!(apart < 1e-10, "{:?}", oblong.centroid);
    let oval = spot(&[at(frame(ellipse(4.0, 1.0)), [0.0, 3.0], -20.0)]);
    let rms = DEFOCUS * (17.0_f64 / 4.0).sqrt();
    assert!((oval.rms - rms).abs() < 1e-10 * rms && (oval.centroid[1] - 0.6).abs() < 1e-10);
    let half = spot(&[at(block(rectangle(50.0, 10.0)), [0.0, 10.0], 0.0)]);
    let low = -DEFOCUS * 4.0 * BEAM / (3.0 * PI);
    assert!((half.centroid[1] - low).abs() < 1e-9 && half.centroid[0].abs() < 1e-9);
    let square2 = 0.5 * (DEFOCUS * BEAM).powi(2) - low * low;
    assert!((half.rms - square2.sqrt()).abs() < 1e-9);
}

/// Arms split the light into pieces, which are sampled: the exact numbers lie within the errors that are told.
#[test]
fn spiders_and_other_thin_figures_are_never_overlooked() {
    let spider = |arms: usize, width: f64| ApertureShape::Spider { arms, width };
    let hole = 3.0_f64;
    // The part of an arm from the hole to the rim, whose ends are arcs: the exact area of a strip of a disc.
    let strip = |r: f64, w: f64| {
        let h = 0.5 * w;
        h * (r * r - h * h).sqrt() + r * r * (h / r).asin()
    };
    let ring = PI * (BEAM * BEAM - hole * hole);
    for (arms, width) in [(4, 1.0), (3, 0.2), (4, 0.05), (1, 0.02), (6, 0.01)] {
        let mut lens = lens(&[at(block(spider(arms, width)), [0.0; 2], 12.0)]);
        lens.surfaces[0].obstruction = Some(hole);
        let lens = lens;
        let dark = arms as f64 * (strip(BEAM, width) - strip(hole, width));
        let model = RayModel::from_lens(&lens, 0).unwrap();
        let region =
            Region::new(model.launch(FieldPoint { x: 0.0, y: 0.0, weight: 1.0 }, 0).unwrap());
        assert!(
            matches!(region.kind, RegionKind::Irregular { annulus: None, .. }),
            "{arms} {width}"
        );
        let found = light(&lens, 0.0, 1e-4);
        let error = (found.area - (ring - dark)).abs();
        assert!(error <= found.errors[0] && found.errors[0] < 1e-3 * ring, "{arms} {width}");
    }
    // A bar through a beam without a hole, and one that only touches its middle.
    for (half, height) in [(50.0, 0.01), (4.0, 0.005), (0.004, 0.003)] {
        let found =
            light(&lens(&[at(block(rectangle(half, height)), [0.3, 0.2], 33.0)]), 4.0, 1e-4);
        let chord = 2.0
            * (BEAM * BEAM
                - (0.2 * 33f64.to_radians().cos() - 0.3 * 33f64.to_radians().sin()).powi(2))
            .sqrt();
        let exact = disc() - 2.0 * height * chord.min(2.0 * half);
        let error = (found.area - exact).abs();
        assert!(error <= found.errors[0] + 1e-5 && found.errors[0] > 0.0, "{half} {height}");
    }
}

/// Where the light is in pieces, the warp field gives the derivative by the edges of figures with a standard
/// error.
#[test]
fn derivatives_behind_a_spider_are_sampled_with_their_error() {
    let (width, hole) = (1.0, 3.0);
    let arms = ApertureShape::Spider { arms: 4, width };
    let mut lens =
        lens(&[at(frame(rectangle(6.0, 5.0)), [0.0; 2], 0.0), at(block(arms), [0.0; 2], 10.0)]);
    lens.surfaces[0].obstruction = Some(hole);
    // The warp field knows no ideal lens.
    lens.surfaces[1] = Row { curvature: -0.01, thickness: 80.0, ..Row::default() };
    lens.surfaces[0].medium = Medium::Index(1.5);
    let model = RayModel::from_lens(&lens, 0).unwrap();
    let region = Region::new(model.launch(FieldPoint { x: 0.0, y: 3.0, weight: 1.0 }, 0).unwrap());
    let accuracy = Accuracy { tolerance: 3e-2, max_rays: 300_000 };
    assert_eq!(choose_estimator(&region, accuracy).unwrap().0, DerivativeEstimator::Warp);
    let cost = QuadraticIntegrand::throughput();
    let found = differentiate(&region, &cost, DerivativeEstimator::Warp, accuracy).unwrap();
    // Along its middle an arm of the spider is as long as the way from the hole to the frame.
    let cos = 10f64.to_radians().cos();
    let length = |half: f64| half / cos;
    let inner = (hole * hole - 0.25 * width * width).sqrt();
    let by_width = 2.0 * (length(6.0) + length(5.0)) - 4.0 * inner;
    let by_half_width = -2.0 * (10.0 - width / cos);
    let by_half_height = -2.0 * (12.0 - width / cos);
    let exact = [(0, by_half_width), (1, by_half_height), (5, by_width)];
    for (number, exact) in exact {
        let parameter = SurfaceParameter::Aperture(number);
        let got = found.gradient.surfaces[0].by(parameter);
        let error = found.error.surfaces[0].by(parameter);
        assert!((got - exact).abs() < 4.0 * error && error < 0.1 * exact.abs(), "{number}");
    }
}

/// A lens by its name and apertures, with the derivatives of its light by their numbers.
type Case = (&'static str, Vec<SurfaceAperture>, Vec<(usize, f64)>);

/// `L = −area`, by every number of the apertures, against closed forms, and all numbers of the lens against
/// differences of pupils that were searched for again.
#[test]
fn derivatives_follow_the_edges_of_apertures() {
    let accuracy = Accuracy { tolerance: 1e-7, max_rays: 500_000 };
    let triangle = [[0.0, 5.0], [-4.0, -3.0], [4.0, -3.0]];
    let cases: [Case; 8] = [
        ("rectangle", vec![frame(rectangle(4.0, 2.0))], vec![(0, -8.0), (1, -16.0)]),
        (
            "turned",
            vec![at(frame(rectangle(4.0, 2.0)), [1.0, -2.0], 30.0)],
            vec![(0, -8.0), (1, -16.0)],
        ),
        (
            "ellipse",
            vec![at(frame(ellipse(4.0, 2.0)), [1.0, 0.5], 20.0)],
            vec![(0, -2.0 * PI), (1, -4.0 * PI)],
        ),
        ("circle", vec![at(frame(circle(3.0)), [4.0, 1.0], 0.0)], vec![(0, -6.0 * PI)]),
        ("triangle", vec![at(frame(polygon(&triangle)), [0.5, 0.5], 10.0)], vec![]),
        ("hole", vec![at(block(rectangle(3.0, 2.0)), [2.0, 1.0], 15.0)], vec![(0, 8.0), (1, 12.0)]),
        (
            "elliptical hole",
            vec![at(block(ellipse(3.0, 2.0)), [1.0, 1.0], 15.0)],
            vec![(0, 2.0 * PI), (1, 3.0 * PI)],
        ),
        (
            "knife",
            vec![at(block(rectangle(50.0, 10.0)), [0.0, 10.0], 0.0)],
            vec![(1, 20.0), (3, -20.0)],
        ),
    ];
    for (name, apertures, exact) in cases {
        let lens = lens(&apertures);
        let model = RayModel::from_lens(&lens, 0).unwrap();
        let field = FieldPoint { x: 0.0, y: 6.0, weight: 1.0 };
        let region = Region::new(model.launch(field, 0).unwrap());
        assert_eq!(choose_estimator(&region, accuracy).unwrap().0, DerivativeEstimator::Boundary);
        for cost in [QuadraticIntegrand::throughput(), QuadraticIntegrand::spread([0.1, 8.0])] {
            let by = |estimator| differentiate(&region, &cost, estimator, accuracy).unwrap();
            let found = by(DerivativeEstimator::Boundary);
            if cost.square == 0.0 {
                let scale = found.gradient.surfaces[0]
                    .apertures
                    .iter()
                    .fold(1.0, |a: f64, b| a.max(b.abs()));
                for (number, exact) in &exact {
                    let got = found.gradient.surfaces[0].by(SurfaceParameter::Aperture(*number));
                    assert!(
                        (got - exact).abs() < 1e-7 * scale,
                        "{name} {number}: {got} and not {exact}"
                    );
                }
                let is_whole = !name.starts_with("knife");
                let moved =
                    (2..4).map(|k| found.gradient.surfaces[0].by(SurfaceParameter::Aperture(k)));
                let moved: Vec<f64> = moved.collect();
                assert!(
                    !is_whole || moved.iter().all(|by| by.abs() < 1e-7 * scale),
                    "{name} {moved:?}"
                );
            }
            // At one order both have the same error of quadrature but for its own derivative.
            let traced = region.trace_pupil(ORDER).boundary_derivative(&cost).unwrap();
            let other = region.difference_derivative(&cost, ORDER).unwrap().gradient;
            for slot in SurfaceParameter::all() {
                let scale = other.largest(slot).max(1e-2);
                for (got, exact) in traced.of_kind(slot).zip(other.of_kind(slot)) {
                    let apart = (got - exact).abs() / scale;
                    assert!(apart < 3e-6, "{name} {slot:?}: {got} {exact}, {apart:.1e}");
                }
            }
        }
    }
}

fn cast(x: f64, y: f64) -> Ray<f64> {
    Ray { point: Vec3::new(x, y, 0.0), direction: Vec3::new(0.0, 0.0, 1.0) }
}

/// Points of a spiral over the beam.
fn spiral(count: u32) -> Vec<[f64; 2]> {
    let place = |i: u32| {
        let (sin, cos) = (2.399_963 * f64::from(i)).sin_cos();
        let r = 12.0 * ((f64::from(i) + 0.5) / f64::from(count)).sqrt();
        [r * cos, r * sin]
    };
    (0..count).map(place).collect()
}

/// Single rays, bundles in every width and margins agree on the fate of every ray, centred, tilted and behind
/// an asphere, in double and single precision.
#[test]
fn single_rays_and_bundles_have_the_same_fates() {
    let apertures = [
        at(frame(rectangle(9.0, 7.0)), [0.5, 0.0], 10.0),
        at(block(ellipse(2.0, 1.0)), [1.0, -2.0], 30.0),
        block(ApertureShape::Spider { arms: 3, width: 0.5 }),
        at(
            frame(polygon(&[[-8.0, -8.0], [8.0, -8.0], [8.0, 8.0], [0.0, 1.0], [-8.0, 8.0]])),
            [0.0; 2],
            5.0,
        ),
    ];
    for form in 0..4 {
        let mut lens = lens(&apertures);
        let row = &mut lens.surfaces[0];
        match form {
            1 => (row.decenter, row.tilt) = ([0.5, -0.25], [4.0, -3.0]),
            2 => (row.curvature, row.conic, row.asphere) = (0.01, -0.5, vec![1e-6]),
            3 => (row.curvature, row.semi_diameter, row.obstruction) = (0.02, Some(8.5), Some(0.7)),
            _ => {}
        }
        let system = lens.resolve(0, 0.5875618).unwrap();
        let tracer = Tracer::new(&system).unwrap();
        let rays: Rays<f64> = spiral(3000).into_iter().map(|[x, y]| cast(x, y)).collect();
        let mut landings = Landings::default();
        tracer.trace_batch(&rays, &mut landings);
        let mut points = ImagePoints::default();
        tracer.trace_batch_parallel(&rays, &mut points);
        let mut clipped = 0;
        for i in 0..rays.len() {
            let alone = tracer.trace(rays.get(i));
            assert_eq!(alone.fate, landings.fate(i), "form {form}");
            assert_eq!(alone.fate, points.fate(i), "form {form}");
            let mut first = None;
            tracer.margins(rays.get(i), |surface, limit, margin| {
                if first.is_none() && !(margin >= 0.0) {
                    first = Some((surface, limit));
                }
                if margin.abs() > 0.0 && matches!(limit, RayLimit::Aperture(0)) {
                    assert_eq!(tracer.margin(rays.get(i), surface, limit), Some(margin));
                }
            });
            assert_eq!(first.is_none(), alone.fate.is_imaged());
            clipped += usize::from(alone.fate == Fate::Clipped(0));
        }
        assert!(clipped > 500 && clipped < 2500, "{clipped}");
        let single: Tracer<f32> = Tracer::new(&system.cast()).unwrap();
        let mut coarse = ImagePoints::default();
        let rays32: Rays<f32> = (0..rays.len()).map(|i| rays.get(i).cast()).collect();
        single.trace_batch(&rays32, &mut coarse);
        let differ = (0..rays.len()).filter(|i| coarse.fate(*i) != points.fate(*i)).count();
        assert!(differ < 5, "{differ} rays at an edge");
    }
}

/// A lens without such apertures takes the same bits as one whose apertures are out of the way.
#[test]
fn apertures_out_of_the_way_change_no_bit() {
    let path = std::path::PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let plain = files::open(path.join("lenses/double_gauss_rudolph_50.json")).unwrap().lens;
    let mut framed = plain.clone();
    for row in &mut framed.surfaces {
        row.apertures = vec![frame(rectangle(1e3, 1e3)), at(block(circle(1.0)), [500.0, 0.0], 0.0)];
        row.apertures.push(at(block(circle(1.0)), [-500.0, 0.0], 0.0));
    }
    let [plain, framed] = [plain, framed].map(|lens| lens.resolve(0, 0.5875618).unwrap());
    let [plain, framed] = [plain, framed].map(|system| Tracer::new(&system).unwrap());
    let rays: Rays<f64> = spiral(2000).into_iter().map(|[x, y]| cast(x, y)).collect();
    let [a, b] = [plain, framed].map(|tracer| {
        let mut landings = Landings::default();
        tracer.trace_batch(&rays, &mut landings);
        let seed = |_| aplanat::trace::AdjointSeed {
            point: Vec3::new(1.0, 2.0, 0.0),
            ..Default::default()
        };
        (landings, tracer.gradient(&rays, seed))
    });
    assert_eq!(a.0, b.0);
    assert_eq!(a.1, b.1);
}

/// Light that is blocked altogether is dark, and says so.
#[test]
fn a_pupil_that_is_blocked_altogether_has_no_light_by_name() {
    let dark = [
        vec![block(rectangle(20.0, 20.0))],
        vec![frame(circle(0.0))],
        vec![frame(rectangle(0.0, 5.0))],
        vec![at(frame(rectangle(2.0, 2.0)), [30.0, 0.0], 0.0)],
        vec![frame(rectangle(3.0, 3.0)), block(circle(5.0))],
        vec![at(frame(circle(2.0)), [-4.0, 0.0], 0.0), at(frame(circle(2.0)), [4.0, 0.0], 0.0)],
    ];
    for apertures in dark {
        let model = RayModel::from_lens(&lens(&apertures), 0).unwrap();
        let field = FieldPoint { x: 0.0, y: 0.0, weight: 1.0 };
        let region = Region::new(model.launch(field, 0).unwrap());
        assert!(region.is_dark(), "{apertures:?}: {:?}", region.kind);
        let cost = QuadraticIntegrand::throughput();
        let found =
            differentiate(&region, &cost, DerivativeEstimator::Boundary, Accuracy::default());
        let message = found.unwrap_err().to_string();
        assert!(message.contains("no light gets through"), "{message}");
    }
}

fn text(apertures: &str) -> String {
    let plain = files::json::write(&lens(&[]));
    plain.replacen("\"stop\": true", &format!("\"stop\": true, \"apertures\": [{apertures}]"), 1)
}

#[test]
fn native_files_keep_apertures() {
    let apertures = vec![
        at(frame(rectangle(4.0, 2.0)), [1.0, -2.0], 30.0),
        block(ellipse(3.0, 1.0 / 3.0)),
        at(block(circle(0.5)), [0.0, 1.0], 0.0),
        frame(polygon(&[[0.0, 5.0], [-4.0, -3.0], [4.0, -3.0]])),
        block(ApertureShape::Spider { arms: 4, width: 0.2 }),
    ];
    let lens = lens(&apertures);
    let written = files::json::write(&lens);
    assert_eq!(files::json::read(&written, "a.json").unwrap(), lens);
    let short = text(r#"{"shape": "rectangle", "half_width": 4, "half_height": 2}"#);
    let read = files::json::read(&short, "a.json").unwrap();
    assert_eq!(read.surfaces[0].apertures, [frame(rectangle(4.0, 2.0))]);
    assert!(!files::json::write(&self::lens(&[])).contains("apertures"));
}

#[test]
fn wrong_apertures_are_refused_by_name_and_place() {
    let message = |apertures: &str| match files::json::read(&text(apertures), "a.json") {
        Ok(lens) => lens.check().unwrap_err().to_string(),
        Err(error) => error.to_string(),
    };
    for (apertures, words) in [
        (
            r#"{"shape": "rectangle", "half_width": -4, "half_height": 2}"#,
            "aperture 1 of surface 1 has the half width -4",
        ),
        (r#"{"shape": "circle", "radius": 2, "center": [1e200, 0]}"#, "centre"),
        (r#"{"shape": "circle", "radius": 2, "angle": 400}"#, "360"),
        (r#"{"shape": "circle"}"#, "without `radius`"),
        (r#"{"shape": "circle", "radius": 2, "half_width": 1}"#, "with `half_width`"),
        (r#"{"shape": "circle", "radius": 2, "width": 1}"#, "with `width`"),
        (r#"{"shape": "star", "radius": 2}"#, "star"),
        (r#"{"shape": "circle", "radius": 2, "blocks": "left"}"#, "left"),
        (r#"{"shape": "circle", "radius": 2, "size": 1}"#, "size"),
        (
            r#"{"shape": "circle", "radius": 2}, {"shape": "polygon", "points": [[0, 0], [1, 1]]}"#,
            "aperture 2 of surface 1 has 2 corners",
        ),
        (r#"{"shape": "polygon", "points": [[0, 0], [1, 1], [1, 0], [0, 1]]}"#, "sides 1 and 3"),
        (r#"{"shape": "spider", "arms": 0, "width": 1}"#, "arms"),
        (r#"{"shape": "spider", "arms": 3, "width": 1, "blocks": "outside"}"#, "spider"),
    ] {
        let message = message(apertures);
        assert!(message.contains(words), "{apertures}: {message}");
    }
    let mut lens = lens(&[frame(rectangle(f64::NAN, 1.0))]);
    let message = lens.check().unwrap_err().to_string();
    assert!(message.contains("aperture 1 of surface 1 has the half width NaN"), "{message}");
    lens.surfaces[0].apertures = vec![frame(circle(1.0)); 17];
    assert!(lens.check().unwrap_err().to_string().contains("17"));
}

#[test]
fn scaling_scales_apertures_and_reversal_keeps_them_at_their_surface() {
    let own = at(frame(rectangle(4.0, 2.0)), [1.0, -2.0], 30.0);
    let scaled = apply_edit(&lens(std::slice::from_ref(&own)), &Edit::Scale(2.0)).unwrap();
    let expected = at(frame(rectangle(8.0, 4.0)), [2.0, -4.0], 30.0);
    assert_eq!(scaled.surfaces[0].apertures, [expected]);
    let mut reversed = lens(std::slice::from_ref(&own));
    reversed.reverse_rows(0, 1);
    assert!(reversed.surfaces[0].apertures.is_empty());
    assert_eq!(reversed.surfaces[1].apertures, [own]);
    assert_eq!(BlockedSide::Outside, reversed.surfaces[1].apertures[0].blocks);
}

/// A slit that is far narrower than the cells of any grid of rays has its area, at whatever angle.
#[test]
fn narrow_slits_have_their_area_at_every_angle() {
    for angle in (0..12).map(|i| 15.0 * f64::from(i) + 5.0) {
        let slit = at(frame(rectangle(6.0, 0.01)), [0.0; 2], angle);
        let found = light(&lens(&[slit]), 0.0, 1e-2);
        let off = (found.area - 0.24).abs();
        assert!(off <= found.errors[0] && found.errors[0] < 0.24, "{angle}: {} {off}", found.area);
    }
}

#[test]
fn surfaces_are_as_large_as_the_light_behind_apertures() {
    let size = |apertures: &[SurfaceAperture]| {
        let model = RayModel::from_lens(&lens(apertures), 0).unwrap();
        aplanat::analysis::clear_semi_diameters([&model])[0]
    };
    let square = frame(rectangle(4.0, 4.0));
    let corner = 32.0_f64.sqrt();
    for apertures in [vec![square.clone()], vec![square, block(circle(1.0))]] {
        let found = size(&apertures);
        assert!(found <= corner && found >= 0.99 * corner, "{found}");
    }
    let aside = size(&[at(frame(circle(2.0)), [5.0, 0.0], 0.0)]);
    assert!((aside - 7.0).abs() < 1e-3, "{aside}");
}

/// What is tabulated over the distance from the axis alone is refused by name.
#[test]
fn pictures_behind_apertures_that_are_no_circles_are_refused() {
    let text = std::fs::read_to_string("lenses/achromat_ac254_100.json").unwrap();
    let mut lens: serde_json::Value = serde_json::from_str(&text).unwrap();
    lens["surfaces"][0]["apertures"] =
        serde_json::json!([{"shape": "rectangle", "half_width": 3.0, "half_height": 2.0}]);
    let framed = super::cli::Scratch::with("framed.json", &lens.to_string());
    let out = super::cli::Scratch::new("framed.png");
    let picture =
        ["picture", framed.path(), "--scene", "star", "--pixels", "8x8", "--out", out.path()];
    super::cli::refused(2, &picture, "", &["surface 1", "no circle about its vertex"]);
}

/// The motion of edges between pieces of a pupil is sampled by the warp field, which tilted surfaces do not have.
#[test]
fn a_tilted_lens_behind_a_spider_is_no_lens_to_optimize_without_its_edges() {
    let text = std::fs::read_to_string("lenses/achromat_ac254_100.json").unwrap();
    let mut lens: serde_json::Value = serde_json::from_str(&text).unwrap();
    lens["surfaces"][0]["apertures"] =
        serde_json::json!([{"shape": "spider", "arms": 3, "width": 0.5}]);
    lens["surfaces"][2]["tilt"] = serde_json::json!([0.1, 0.0]);
    let tilted = super::cli::Scratch::with("tilted_spider.json", &lens.to_string());
    let out = super::cli::Scratch::new("tilted_spider_out.json");
    let optimize =
        ["optimize", tilted.path(), "--vary=curvatures", "--steps=2", "--out", out.path()];
    let words = ["not star-shaped", "tilted", "frozen pupils"];
    super::cli::refused(2, &optimize, "", &words);
}

/// Tolerances use the rays that get through, on the side on which they do, and no more than their budget.
#[test]
fn tolerances_know_apertures_beside_the_axis() {
    let spider = block(ApertureShape::Spider { arms: 3, width: 0.2 });
    for aperture in [at(frame(circle(2.0)), [5.0, 0.0], 0.0), spider] {
        let mut lens = lens(&[aperture]);
        lens.fields.values = [1.0, 2.0].map(|y| FieldPoint { x: 0.0, y, weight: 1.0 }).into();
        let scene = aplanat::tolerance::ToleranceScene::new(&lens, 0, 1e-2).unwrap();
        let model = RayModel::from_lens(&lens, 0).unwrap();
        assert_eq!(scene.beam.fields.len(), 2, "no field on the other side is like one of these");
        for colour in scene.beam.fields.iter().flat_map(|field| &field.colours) {
            let imaged = |ray: &&Ray<f64>| model.channels[0].tracer.trace(**ray).fate.is_imaged();
            assert_eq!(colour.rays.iter().filter(imaged).count(), colour.rays.len());
            assert!(colour.rays.len() < 200_000, "{}", colour.rays.len());
        }
    }
}
