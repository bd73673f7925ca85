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
        ("elliptical hole", vec![at(block(ellipse(3.0, 2.0)), [1.0, 1.0], 15.0)], disc() - 6.0 * PI),
        ("decentred stop", vec![at(block(circle(3.0)), [-4.0, 1.0], 0.0)], disc() - 9.0 * PI),
        ("triangular hole", vec![block(polygon(&triangle))], disc() - 32.0),
        ("knife edge", vec![at(block(rectangle(50.0, 10.0)), [0.0, 10.0], 0.0)], 0.5 * disc()),
        ("edge at 30 deg", vec![at(block(rectangle(50.0, 50.0)), [-25.0, 43.301_270_189_221_93], 30.0)], 0.5 * disc()),
        ("two frames", vec![frame(rectangle(4.0, 4.0)), at(frame(rectangle(4.0, 4.0)), [3.0, 0.0], 0.0)], 40.0),
        ("a frame and its hole", vec![frame(rectangle(5.0, 5.0)), block(circle(2.0))], 100.0 - 4.0 * PI),
        ("a corner of a hole", vec![frame(rectangle(5.0, 5.0)), at(block(rectangle(3.0, 3.0)), [5.0, 5.0], 0.0)], 91.0),
        ("an obscuration beside the beam", vec![at(block(circle(3.0)), [20.0, 2.0], 0.0)], disc()),
        ("a frame around the beam", vec![frame(rectangle(50.0, 60.0))], disc()),
        ("obscurations of no size", vec![block(circle(0.0)), block(rectangle(0.0, 3.0))], disc()),
    ];
    for (name, apertures, area) in cases {
        let lens = lens(&apertures);
        for field in [0.0, 8.0] {
            let found = light(&lens, field, 1e-9);
            let error = (found.area - area).abs();
            println!("{name} at {field}: {} +- {:.1e}, off by {error:.1e}", found.area, found.errors[0]);
            assert!(error <= 1e-9 * area, "{name} at {field}: {} and not {area}", found.area);
        }
    }
}
