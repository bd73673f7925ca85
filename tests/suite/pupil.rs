//! Rays from pupil coordinates against the hexapolar sums of `lenses.json`.

use crate::reference::{Reference, Worst, count, lenses, number, numbers};
use aplanat::lens::{
    ASPHERE_TERMS, Aperture, FieldKind, FieldPoint, Object, Shape, Surface, System,
};
use aplanat::paraxial::Beam;
use aplanat::pupil::{
    Accuracy, Aiming, Launch, PupilLimit, PupilPattern, RayModel, Region, RegionKind,
    pattern_points,
};
use aplanat::trace::{ImagePoints, RayLimit, Rays, TraceSink};
use std::f64::consts::PI;

/// Relative to the RMS radius, or to the height of a centroid. One unit of a ray's rounding comes on
/// top: a spot of 0.2 µm behind a pupil of 2.4 m has no eleven digits in double precision.
const TOLERANCE: f64 = 1e-11;
/// The tolerance of a ray, in units of rounding.
const ROUNDING: f64 = 16.0;

/// Centroid and RMS distance from it.
fn spot(points: &[[f64; 2]]) -> [f64; 3] {
    let n = points.len() as f64;
    let first = points[0];
    let mean = |i: usize| first[i] + points.iter().map(|p| p[i] - first[i]).sum::<f64>() / n;
    let (x, y) = (mean(0), mean(1));
    let square: f64 = points.iter().map(|p| (p[0] - x).powi(2) + (p[1] - y).powi(2)).sum();
    [x, y, (square / n).sqrt()]
}

fn compare(worst: &mut Worst, got: [f64; 3], exact: &serde_json::Value, rounding: f64) {
    let size = number(&exact["cy"]).abs().max(number(&exact["rms"]));
    for (got, name) in got.into_iter().zip(["cx", "cy", "rms"]) {
        let scale = if name == "rms" { number(&exact["rms"]) } else { size };
        worst.note(got, number(&exact[name]), TOLERANCE * scale + rounding, name);
    }
}

/// The largest coordinate on the way of a beam.
fn size(model: &RayModel) -> f64 {
    let rows = &model.channels[model.primary].system.surfaces;
    let heights = model.first_order.marginal.heights.iter();
    rows.iter().map(|row| &row.thickness).chain(heights).fold(0.0, |m: f64, v| m.max(v.abs()))
}

/// The image points of the rays of the usual pattern.
fn hexapolar(model: &RayModel, field: usize, wavelength: usize) -> Vec<[f64; 2]> {
    let launch = model.launch(model.fields[field], wavelength).unwrap();
    let rays: Rays<f64> = pattern_points(PupilPattern::Hexapolar(6))
        .iter()
        .map(|p| launch.ray(*p).unwrap())
        .collect();
    let mut landed = ImagePoints::default();
    launch.channel().tracer.trace_batch(&rays, &mut landed);
    assert_eq!(landed.fates().imaged, 127);
    landed.x.into_iter().zip(landed.y).map(|(x, y)| [x, y]).collect()
}

#[test]
fn reference_spots() {
    let mut compared = 0;
    for lens in lenses() {
        let (model, mut worst) = (lens.open_model(), Worst::default());
        let rounding = unit(&lens).max(size(&model) * f64::EPSILON * 0.5);
        for exact in lens.data["spots"].as_array().unwrap() {
            let field = count(&exact["f"]);
            let mut all = Vec::new();
            for color in exact["per_wavelength"].as_array().unwrap() {
                let points = hexapolar(&model, field, count(&color["w"]));
                compare(&mut worst, spot(&points), color, rounding);
                all.extend(points);
            }
            compare(&mut worst, spot(&all), &exact["poly"], rounding);
        }
        compared += worst.check(&format!("spots {}", lens.id()), 1.0);
    }
    assert_eq!(compared, 312);
}

/// The largest error that rounding every intermediate once makes in a ray of the file.
fn unit(lens: &Reference) -> f64 {
    let rays = lens.data["rays"].as_array().unwrap().iter();
    let units = rays.filter_map(|ray| ray["unit"]["point"].as_array());
    units.flatten().map(number).fold(0.0, f64::max)
}

#[test]
fn reference_rays_of_exact_pupil_points() {
    let mut compared = 0;
    for lens in lenses() {
        let (model, mut worst) = (lens.open_model(), Worst::default());
        let rounding = ROUNDING * (size(&model) * f64::EPSILON * 0.5).max(unit(&lens));
        for ray in lens.data["rays"].as_array().unwrap() {
            let (f, w) = (count(&ray["f"]), count(&ray["w"]));
            let pupil = numbers(&ray["pupil"]);
            let launch = model.launch(model.fields[f], w).unwrap();
            let start = launch.ray([pupil[0], pupil[1]]).unwrap();
            let landing = launch.channel().tracer.trace(start);
            let exact = numbers(&ray["xy_exact_pupil"]);
            let point = landing.ray.point;
            for (got, exact) in [point.x, point.y].into_iter().zip(exact) {
                worst.note(got, exact, rounding, format!("{f} {w} {pupil:?}"));
            }
        }
        compared += worst.check(&format!("rays of {}", lens.id()), 1.0);
    }
    assert_eq!(compared, 1520);
}

/// RMS radius at every order of a region's quadrature, with the rays that each order traces: those
/// that land, and all of them.
fn orders(region: &Region<'_>) -> Vec<(usize, usize, f64)> {
    let at = |order: usize| {
        let nodes = region.nodes(order);
        let landed = region.trace::<ImagePoints<f64>>(&nodes);
        let area: f64 = landed.arrivals().map(|(_, w)| w).sum();
        let points = &landed.sink;
        let y = landed.arrivals().map(|(i, w)| w * points.y[i]).sum::<f64>() / area;
        let square = |i: usize| points.x[i].powi(2) + (points.y[i] - y).powi(2);
        let rms = (landed.arrivals().map(|(i, w)| w * square(i)).sum::<f64>() / area).sqrt();
        (nodes.points.len(), nodes.points.len() + nodes.rays, rms)
    };
    (0..region.orders()).map(at).collect()
}

fn double_gauss() -> Reference {
    lenses().into_iter().find(|lens| lens.id() == "double_gauss").unwrap()
}

/// Prints the errors of all orders against the highest and returns them.
fn errors(model: &RayModel, field: usize) -> Vec<(usize, f64)> {
    let region = Region::new(model.launch(model.fields[field], model.primary).unwrap());
    let orders = orders(&region);
    let best = orders.last().unwrap().2;
    println!("field {}, {} rays to find the pupil", model.fields[field].y, region.rays);
    for (rays, all, rms) in &orders {
        println!("  {rays} rays ({all} with the edge): {:.1e}", (rms / best - 1.0).abs());
    }
    orders.iter().map(|(rays, _, rms)| (*rays, (rms / best - 1.0).abs())).collect()
}

#[test]
fn a_clear_pupil_takes_25_rays_for_nine_digits() {
    let errors = errors(&double_gauss().open_model(), 2);
    let (_, error) = errors.iter().find(|(rays, _)| *rays == 25).unwrap();
    assert!(*error < 1e-9, "{error:e}");
}

#[test]
fn a_clipped_pupil_takes_72_rays_for_six_digits() {
    let model = double_gauss().clipped_model();
    for field in [1, 2] {
        let errors = errors(&model, field);
        assert!(errors.iter().any(|(rays, error)| *rays <= 72 && *error < 1e-6));
    }
}

/// Surfaces `(curvature, gap, index behind, semi-diameter)` and an image plane, in air.
fn system(rows: &[(f64, f64, f64, f64)], stop: usize) -> System<f64> {
    let surface = |(curvature, thickness, index, semi_diameter): (f64, f64, f64, f64)| Surface {
        shape: Shape::simplest(curvature, 0.0, [0.0; ASPHERE_TERMS]),
        semi_diameter,
        ..Surface::plane(thickness, index)
    };
    let image = surface((0.0, 0.0, 1.0, f64::INFINITY));
    let surfaces = rows.iter().copied().map(surface).chain([image]).collect();
    System { index_before: 1.0, surfaces, stop: Some(stop) }
}

fn model(system: System<f64>, aperture: Aperture, edge: f64, aiming: Aiming) -> RayModel {
    let beam = Beam { object: Object::Infinity, aperture, field: FieldKind::Angle, edge };
    let fields = vec![FieldPoint { x: 0.0, y: edge, weight: 1.0 }];
    RayModel {
        fields,
        ..RayModel::from_systems(vec![(0.55, 1.0, system)], 0, beam, aiming).unwrap()
    }
}

fn area(region: &Region<'_>) -> f64 {
    let orders = region.orders();
    region.nodes(orders.saturating_sub(1).min(8)).weights.iter().sum()
}

/// The area that two discs have in common, for radii and the distance of their centres.
fn overlap(r: f64, s: f64, d: f64) -> f64 {
    let a = ((d * d + r * r - s * s) / (2.0 * d * r)).acos();
    let b = ((d * d + s * s - r * r) / (2.0 * d * s)).acos();
    r * r * (a - a.sin() * a.cos()) + s * s * (b - b.sin() * b.cos())
}

#[test]
fn a_pupil_cut_by_a_distant_rim_is_the_overlap_of_two_discs() {
    // A stop of radius 5 and a rim of radius 10, 100 mm behind it: the centre of the rim's shadow
    // lies 10 mm from the middle of the stop, so that the chief ray exactly meets the rim.
    let edge = 0.1f64.atan().to_degrees();
    for offset in [-3.0, -0.5, 0.0, 0.5, 3.0, 4.9] {
        let rows = [(0.0, 100.0, 1.0, 5.0), (0.0, 50.0, 1.0, 10.0 + offset)];
        let model =
            model(system(&rows, 0), Aperture::StopSemiDiameter(5.0), edge, Aiming::Paraxial);
        let region = Region::new(model.launch(model.fields[0], 0).unwrap());
        let exact = overlap(5.0, 10.0 + offset, 10.0) / 25.0;
        assert!((area(&region) - exact).abs() < 1e-12, "{offset}: {} {exact}", area(&region));
    }
}

/// A stop of radius 5 and a rim of radius `rim` 100 mm behind it, the centre of whose shadow lies
/// 10 mm from the middle of the stop.
fn vignetted(rim: f64, turn: f64) -> (RayModel, FieldPoint) {
    let edge = 0.1f64.atan().to_degrees();
    let rows = [(0.0, 100.0, 1.0, 5.0), (0.0, 50.0, 1.0, rim)];
    let model = model(system(&rows, 0), Aperture::StopSemiDiameter(5.0), edge, Aiming::Paraxial);
    (model, FieldPoint { x: edge * turn.sin(), y: edge * turn.cos(), weight: 1.0 })
}

#[test]
fn the_sides_of_an_outline_are_as_long_as_the_arcs_of_two_discs() {
    for (rim, turn) in [(8.0, 0.0), (10.0, 0.0), (10.0, 0.7), (12.0, -2.0)] {
        let (model, field) = vignetted(rim, turn);
        let region = Region::new(model.launch(field, 0).unwrap());
        let outline = region.outline(128).unwrap();
        let (stop, clips) =
            (PupilLimit::Surface(0, RayLimit::Rim), PupilLimit::Surface(1, RayLimit::Rim));
        assert_eq!(outline.sides.len(), 2, "{rim} {turn}");
        // Half the angle that each arc spans about its own centre.
        let half = |r: f64, s: f64| ((100.0 + r * r - s * s) / (20.0 * r)).acos();
        let (a, b) = (10.0 * half(5.0, rim), 2.0 * rim * half(rim, 5.0));
        for (limit, exact) in [(stop, a), (clips, b)] {
            let share = outline.share(limit);
            assert!((share - exact / (a + b)).abs() < 3e-6, "{rim} {turn} {limit:?} {share}");
        }
        let total: f64 = outline.limits_by_share().iter().map(|(_, share)| share).sum();
        assert!((total - 1.0).abs() < 1e-12);
        assert_eq!(outline.corners().count(), 2);
        let first = &outline.sides[0];
        let second = &outline.sides[1];
        let gap = |a: &[f64; 2], b: &[f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
        assert!(gap(first.points.last().unwrap(), &second.points[0]) < 1e-6);
        assert!(gap(second.points.last().unwrap(), &first.points[0]) < 1e-6);
        for [x, y] in &outline.sides.iter().find(|s| s.limit == stop).unwrap().points {
            // A corner is located to a billionth of the radius.
            assert!((x.hypot(*y) - 5.0).abs() < 2e-8, "on the rim of the stop, in mm: {x} {y}");
        }
    }
}

#[test]
fn the_extent_of_a_pupil_is_in_square_millimetres_about_its_centroid() {
    let accuracy = Accuracy { tolerance: 1e-10, max_rays: 100_000 };
    for (rim, turn) in [(10.0, 0.0), (8.0, 0.7)] {
        let (model, field) = vignetted(rim, turn);
        let region = Region::new(model.launch(field, 0).unwrap());
        let found = region.extent(accuracy).unwrap();
        let exact = overlap(5.0, rim, 10.0);
        assert!((found.values[0] - exact).abs() < 1e-9 * exact, "{} {exact}", found.values[0]);
        // The first moments of two circular segments, about the middle of the stop.
        let segment = |r: f64, s: f64| {
            2.0 / 3.0 * (r * ((100.0 + r * r - s * s) / (20.0 * r)).acos().sin()).powi(3)
        };
        let (near, far) = (segment(5.0, rim), segment(rim, 5.0));
        let centre = (10.0 * (exact - lone(5.0, rim)) - far + near) / exact;
        let out = found.values[1].hypot(found.values[2]);
        assert!((out - centre).abs() < 1e-8, "{out} {centre}");
    }
}

/// The area of the segment of a disc of radius `r` that a chord shared with a disc of radius `s`,
/// 10 mm away, cuts off.
fn lone(r: f64, s: f64) -> f64 {
    let half = ((100.0 + r * r - s * s) / (20.0 * r)).acos();
    r * r * (half - half.sin() * half.cos())
}

#[test]
fn a_clear_pupil_is_a_disc_of_the_aperture() {
    let rows = [(0.0, 100.0, 1.0, f64::INFINITY), (0.0, 50.0, 1.0, f64::INFINITY)];
    let aperture = Aperture::EntrancePupilDiameter(10.0);
    for aiming in [Aiming::Paraxial, Aiming::Chief, Aiming::Stop] {
        let model = model(system(&rows, 1), aperture, 20.0, aiming);
        let region = Region::new(model.launch(model.fields[0], 0).unwrap());
        let outline = region.outline(64).unwrap();
        assert!(outline.is_clear() && outline.corners().count() == 0);
        assert_eq!(outline.limits_by_share(), [(PupilLimit::Disc, 1.0)]);
        let [area, x, y] = region.extent(Accuracy::default()).unwrap().values;
        // In air, the plane of the stop is seen from the first vertex undistorted.
        assert!((area / (25.0 * PI) - 1.0).abs() < 1e-12, "{aiming:?} {area}");
        assert!(x.abs() < 1e-12 && (y + 100.0 * 20f64.to_radians().tan()).abs() < 1e-9, "{y}");
    }
}

#[test]
fn limits_have_names() {
    let (model, _) = vignetted(8.0, 0.0);
    let cases = [
        (PupilLimit::Disc, "entrance pupil"),
        (PupilLimit::Surface(0, RayLimit::Rim), "stop, surface 1"),
        (PupilLimit::Surface(1, RayLimit::Rim), "rim of surface 2"),
        (PupilLimit::Surface(1, RayLimit::Miss), "missed surface 2"),
        (PupilLimit::Surface(1, RayLimit::TotalReflection), "critical angle at surface 2"),
        (PupilLimit::Unaimed, "no ray to the stop"),
    ];
    for (limit, name) in cases {
        assert_eq!(model.limit_name(limit), name);
    }
}

#[test]
fn a_stop_of_size_zero_passes_no_light() {
    let rows = [(0.01, 5.0, 1.5, 20.0), (-0.01, 10.0, 1.0, 20.0), (0.0, 80.0, 1.0, 0.0)];
    for aiming in [Aiming::Paraxial, Aiming::Chief, Aiming::Stop] {
        let model = model(system(&rows, 2), Aperture::StopSemiDiameter(0.0), 5.0, aiming);
        let Ok(launch) = model.launch(model.fields[0], 0) else { continue };
        assert!(Region::new(launch).is_dark(), "{aiming:?}");
    }
}

#[test]
fn a_sliver_cut_off_by_a_semi_diameter_is_found() {
    // The rim's shadow cuts off at most 0.2 % of the radius, and no ray of the first look is in it.
    for cut in [0.01, 0.002, 0.0005] {
        let rows = [(0.0, 100.0, 1.0, f64::INFINITY), (0.0, 50.0, 1.0, 60.0)];
        let edge = ((55.0 + 5.0 * cut) / 100.0f64).atan().to_degrees();
        let aperture = Aperture::EntrancePupilDiameter(10.0);
        let model = model(system(&rows, 0), aperture, edge, Aiming::Paraxial);
        for turn in [0.0f64, 0.2, 0.11] {
            let field = FieldPoint { x: edge * turn.sin(), y: edge * turn.cos(), weight: 1.0 };
            let region = Region::new(model.launch(field, 0).unwrap());
            let exact = overlap(1.0, 12.0, 11.0 + cut);
            assert!(
                matches!(region.kind, RegionKind::StarShaped(_)),
                "{cut} {turn} {:?}",
                region.kind
            );
            assert!((area(&region) - exact).abs() < 1e-10, "{cut} {turn}");
        }
    }
}

#[test]
fn a_semi_diameter_of_zero_passes_no_light() {
    for edge in [0.0, 3.0] {
        let rows = [(0.01, 5.0, 1.5, 20.0), (-0.01, 90.0, 1.0, 0.0)];
        for aperture in [Aperture::StopSemiDiameter(5.0), Aperture::EntrancePupilDiameter(10.0)] {
            let model = model(system(&rows, 0), aperture, edge, Aiming::Paraxial);
            let launch = model.launch(model.fields[0], 0).unwrap();
            assert!(Region::new(launch).is_dark(), "{aperture:?} {edge}");
        }
    }
}

#[test]
fn a_beam_without_limits_has_no_finite_edge() {
    let rows = [(0.0, 10.0, 1.5, f64::INFINITY), (0.0, 10.0, 1.0, f64::INFINITY)];
    let mut model = model(system(&rows, 0), Aperture::StopSemiDiameter(1.0), 5.0, Aiming::Paraxial);
    let color = &mut model.channels[0];
    color.system.surfaces[0].semi_diameter = f64::INFINITY;
    color.tracer = aplanat::trace::Tracer::new(&color.system).unwrap();
    let region = Region::new(model.launch(model.fields[0], 0).unwrap());
    assert_eq!(region.kind, RegionKind::Unbounded);
}

#[test]
fn a_pupil_in_two_pieces_is_detected_and_sampled() {
    // Strong spherical aberration: a small hole where a zone crosses the axis lets the middle and
    // that zone through, but not what lies between.
    let rows = [(0.02, 8.0, 1.5, 14.0), (-0.02, 44.4, 1.0, 14.0), (0.0, 5.0, 1.0, 0.12)];
    let model =
        model(system(&rows, 0), Aperture::EntrancePupilDiameter(26.0), 0.0, Aiming::Paraxial);
    let region = Region::new(model.launch(model.fields[0], 0).unwrap());
    let RegionKind::Irregular { pieces, .. } = region.kind else { panic!("{:?}", region.kind) };
    assert!(pieces >= 2, "{pieces}");
    let spot = aplanat::analysis::spot(&model, model.fields[0], Accuracy::default()).unwrap();
    let points = pattern_points(PupilPattern::Square(900));
    let rays: Rays<f64> = points.iter().map(|p| region.launch.ray(*p).unwrap()).collect();
    let mut landed = ImagePoints::default();
    region.launch.channel().tracer.trace_batch(&rays, &mut landed);
    let lit = || (0..rays.len()).filter(|i| landed.fate(*i).is_imaged());
    let square: f64 = lit().map(|i| landed.x[i].powi(2) + landed.y[i].powi(2)).sum();
    let rms = (square / lit().count() as f64).sqrt();
    assert!((spot.rms.value - rms).abs() < 3.0 * spot.rms.error + 2e-3 * rms, "{spot:?} {rms}");
}

/// A disc of radius 5 mm, and 100 mm behind it a plane that is obstructed as far as `inner`: its
/// shadow lies `away` radii of the disc from the middle.
fn shadowed(inner: f64, away: f64, turn: f64) -> (RayModel, FieldPoint) {
    let mut lens = system(&[(0.0, 100.0, 1.0, f64::INFINITY), (0.0, 50.0, 1.0, f64::INFINITY)], 0);
    lens.surfaces[1].obstruction = 5.0 * inner;
    let edge = (0.05 * away).atan().to_degrees();
    let model = model(lens, Aperture::EntrancePupilDiameter(10.0), edge, Aiming::Paraxial);
    (model, FieldPoint { x: edge * turn.sin(), y: edge * turn.cos(), weight: 1.0 })
}

/// The area of a pupil, with its error.
fn lit(model: &RayModel, field: FieldPoint, tolerance: f64) -> aplanat::analysis::Estimate {
    let accuracy = Accuracy { tolerance, max_rays: 300_000 };
    aplanat::analysis::spot(model, field, accuracy).unwrap().channels[0].unwrap().area
}

#[test]
fn an_annular_pupil_is_connected_but_not_star_shaped() {
    for inner in [0.02, 0.1, 0.4, 0.75, 0.95] {
        for aiming in [Aiming::Paraxial, Aiming::Chief, Aiming::Stop] {
            let mut lens = system(&[(0.0, 50.0, 1.0, 5.0)], 0);
            lens.surfaces[0].obstruction = 5.0 * inner;
            let model = model(lens, Aperture::StopSemiDiameter(5.0), 1.0, aiming);
            let region = Region::new(model.launch(model.fields[0], 0).unwrap());
            assert_ring(&region);
            let exact = PI * (1.0 - inner * inner);
            assert!((area(&region) - exact).abs() < 1e-12, "{inner} {aiming:?}");
            let estimate = lit(&model, model.fields[0], 1e-6);
            assert!((estimate.value - exact).abs() < 1e-9, "{inner} {aiming:?}: {estimate:?}");
            assert!(estimate.rays < 2000, "{inner} {aiming:?}: {estimate:?}");
        }
    }
}

/// A ring is one piece that no point sees, with two edges.
fn assert_ring(region: &Region<'_>) {
    let ring = matches!(region.kind, RegionKind::Irregular { pieces: 1, annulus: Some(_), .. });
    assert!(ring, "{:?}", region.kind);
}

#[test]
fn an_obstruction_smaller_than_the_first_grid_is_found() {
    for inner in [0.05, 0.01, 1e-3, 1e-6] {
        for away in [0.0, 0.043, 0.51, 0.93, 0.9999] {
            for turn in [0.0f64, 0.2, 2.9] {
                let (model, field) = shadowed(inner, away, turn);
                let region = Region::new(model.launch(field, 0).unwrap());
                let whole = away + inner < 1.0;
                if whole {
                    assert_ring(&region);
                    let exact = PI * (1.0 - inner * inner);
                    let found = lit(&model, field, 1e-3);
                    let error = (found.value - exact).abs();
                    let what = format!("{inner} {away} {turn}: {error:e} {found:?}");
                    assert!(error <= 3.0 * found.error + 1e-9, "{what}");
                    // Beside the edge the ring is very narrow on one side.
                    let best = (area(&region) - exact).abs();
                    assert!(away > 0.6 || best < 1e-9, "{what} {best:e}");
                } else {
                    let ragged = matches!(
                        region.kind,
                        RegionKind::Irregular { pieces: 1, annulus: None, .. }
                    );
                    assert!(ragged, "{inner} {away} {turn}: {:?}", region.kind);
                }
            }
        }
        // Just outside, and far from it.
        for away in [1.0 + 1.01 * inner, 3.0, 40.0] {
            let (model, field) = shadowed(inner, away, 0.2);
            let region = Region::new(model.launch(field, 0).unwrap());
            assert_eq!(region.kind, RegionKind::Clear, "{inner} {away}");
        }
    }
}

#[test]
fn a_shadow_across_the_edge_splits_a_star_shaped_pupil() {
    let mut split = 0;
    for (inner, away) in
        [(2.0, 2.5), (2.0, 2.9), (0.5, 1.3), (0.02, 1.01), (0.2, 1.1), (2.0, 2.0), (0.5, 0.9)]
    {
        for turn in [0.0, 0.3] {
            let (model, field) = shadowed(inner, away, turn);
            let region = Region::new(model.launch(field, 0).unwrap());
            let exact = PI - overlap(1.0, inner, away);
            match region.kind {
                RegionKind::StarShaped(_) => {
                    split += 1;
                    // Slower where the pupil has horns.
                    assert!((area(&region) - exact).abs() < 1e-7, "{inner} {away} {turn}");
                }
                RegionKind::Irregular { .. } => {
                    let area = lit(&model, field, 1e-3);
                    let error = (area.value - exact).abs();
                    assert!(error <= 3.0 * area.error, "{inner} {away}: {area:?} {exact}");
                }
                kind => panic!("{inner} {away} {turn}: {kind:?}"),
            }
        }
    }
    assert!(split >= 8, "{split}");
}

#[test]
fn a_shadow_across_a_narrow_pupil_leaves_two_pieces() {
    // The disc and a rim of the same size, 8 mm off; the shadow lies in the middle between them.
    let rows = [(0.0, 50.0, 1.0, 5.0), (0.0, 50.0, 1.0, f64::INFINITY), (0.0, 50.0, 1.0, 5.0)];
    let mut lens = system(&rows, 0);
    lens.surfaces[1].obstruction = 1.5;
    let edge = 0.08f64.atan().to_degrees();
    let model = model(lens, Aperture::EntrancePupilDiameter(10.0), edge, Aiming::Paraxial);
    let region = Region::new(model.launch(model.fields[0], 0).unwrap());
    assert!(matches!(region.kind, RegionKind::Irregular { pieces: 2, .. }), "{:?}", region.kind);
}

#[test]
fn an_obstruction_as_wide_as_the_beam_passes_no_light() {
    let (model, field) = shadowed(1.5, 0.2, 0.0);
    assert!(Region::new(model.launch(field, 0).unwrap()).is_dark());
}

#[test]
fn turning_the_field_turns_the_spot() {
    let model = double_gauss().clipped_model();
    let spot = |x: f64, y: f64| {
        let accuracy = Accuracy { tolerance: 1e-8, max_rays: 100_000 };
        aplanat::analysis::spot(&model, FieldPoint { x, y, weight: 1.0 }, accuracy).unwrap()
    };
    let upright = spot(0.0, 14.0);
    for angle in [0.3f64, 1.0, std::f64::consts::FRAC_PI_2, -2.5] {
        let turned = spot(14.0 * angle.sin(), 14.0 * angle.cos());
        assert!((turned.rms.value / upright.rms.value - 1.0).abs() < 1e-8, "{angle}");
        let height = turned.centroid[0].value.hypot(turned.centroid[1].value);
        assert!((height / upright.centroid[1].value - 1.0).abs() < 1e-9, "{angle}");
    }
}

#[test]
fn aimed_rays_cross_the_stop_where_they_should() {
    for lens in lenses().iter().filter(|lens| lens.aimed_at_stop()) {
        let model = lens.clipped_model();
        let radius = model.stop_radius();
        for field in &model.fields {
            let launch = model.launch(*field, model.primary).unwrap();
            for p in pattern_points(PupilPattern::Hexapolar(3)) {
                let [x, y] = launch.stop_point(p).unwrap();
                let miss = (x - p[0] * radius).hypot(y - p[1] * radius);
                assert!(miss < 1e-14 * (1.0 + radius), "{} {}: {miss:e}", lens.id(), field.y);
            }
        }
    }
}

#[test]
fn a_fisheye_accepts_fields_beyond_90_degrees() {
    let lens = aplanat::files::open("lenses/fisheye_minolta_16_f28.json").unwrap().lens;
    let model = RayModel::from_lens(&lens, 0).unwrap();
    assert_eq!(model.aiming, Aiming::Chief);
    for angle in [45.0, 80.0, 88.0, 90.0, 92.0] {
        let field = FieldPoint { x: 0.0, y: angle, weight: 1.0 };
        let launch = model.launch(field, model.primary).unwrap();
        let [x, y] = launch.stop_point([0.0, 0.0]).unwrap();
        assert!(x.hypot(y) < 1e-9 * model.stop_radius(), "{angle}");
        let (found, counted) = (area(&Region::new(launch.clone())), counted_area(&launch));
        println!("{angle} degrees: pupil area {found:.6}, counted {counted:.4}");
        assert!((found / counted - 1.0).abs() < 5e-3, "{angle}: {found} and {counted}");
    }
}

/// The area of a pupil by the number of points of a fine grid from which rays arrive.
fn counted_area(launch: &Launch<'_>) -> f64 {
    const SIDE: usize = 240;
    let step = 2.4 / SIDE as f64;
    let at = |i: usize| (i as f64 + 0.5) * step - 1.2;
    let points: Vec<[f64; 2]> = (0..SIDE * SIDE)
        .map(|i| [at(i % SIDE), at(i / SIDE)])
        .filter(|p| !launch.model.ends_at_disc() || p[0].hypot(p[1]) <= 1.0)
        .collect();
    let (launched, landed) = launch.trace_points(&points);
    let arrived: Vec<[f64; 2]> = (0..launched.len())
        .filter(|i| landed.fate(*i).is_imaged())
        .map(|i| points[launched[i]])
        .collect();
    let inside = arrived.iter().all(|p| p[0].abs().max(p[1].abs()) < 1.2 - step);
    assert!(inside && !arrived.is_empty(), "the pupil does not fit into the grid");
    arrived.len() as f64 * step * step
}

#[test]
fn a_telecentric_object_space_fills_its_aperture() {
    // The stop stands in the back focal plane of a lens.
    let mut lens =
        system(&[(0.02, 3.0, 1.5, 30.0), (-0.02, 0.0, 1.0, 30.0), (0.0, 60.0, 1.0, 30.0)], 2);
    let focus = aplanat::lens::paraxial_image_distance(
        &system(&[(0.02, 3.0, 1.5, 30.0), (-0.02, 0.0, 1.0, 30.0)], 0),
        Object::Infinity,
    );
    lens.surfaces[1].thickness = focus;
    let beam = Beam {
        object: Object::Finite(49.0),
        aperture: Aperture::ObjectNa(0.1),
        field: FieldKind::ObjectHeight,
        edge: 2.0,
    };
    let mut model =
        RayModel::from_systems(vec![(0.55, 1.0, lens)], 0, beam, Aiming::Paraxial).unwrap();
    // Rounding may leave the pupil very far away instead of at infinity; both must do.
    for position in [model.first_order.entrance_pupil.position, None] {
        model.first_order.entrance_pupil.position = position;
        if position.is_none() {
            model.first_order.entrance_pupil.diameter = None;
        }
        let launch = model.launch(FieldPoint { x: 0.0, y: 2.0, weight: 1.0 }, 0).unwrap();
        let [x, y] = launch.stop_point([0.0, 0.0]).unwrap();
        assert!(x.hypot(y) < 0.05, "{x} {y}");
        let ray = launch.ray([0.0, 1.0]).unwrap();
        assert!((ray.direction.y.abs() - 0.1).abs() < 1e-6, "{:?}", ray.direction);
        assert_eq!(Region::new(launch).kind, RegionKind::Clear);
    }
}

/// The edge of a pupil that is no rim of a lens is the stop where rays are aimed at it.
#[test]
fn the_edge_of_the_pupil_itself_is_named_by_what_rays_are_aimed_at() {
    let lens = crate::merit::bundled("double_gauss_rudolph_50");
    let model = RayModel::from_lens(&lens, 0).unwrap();
    let name = |aiming| RayModel { aiming, ..model.clone() }.limit_name(PupilLimit::Disc);
    assert_eq!(name(Aiming::Stop), "rim of the stop");
    assert_eq!(name(Aiming::Paraxial), "entrance pupil");
}
