//! Properties of every ray, and the real rays of `lenses.json`.

use super::merit::bundled;
use super::reference::{self, Reference, number, numbers};
use aplanat::lens::{Pose, Shape, Surface, System};
use aplanat::math::{Dual, Real, Vec3};
use aplanat::trace::{
    AdjointSeed, Fate, ImagePoints, Landings, Ray, RayLimit, Rays, SimdWidth, SurfaceParameter,
    SystemGradient, TraceSink, Tracer,
};
use serde_json::Value;

const EPSILON: f64 = f64::EPSILON;

/// A ray of a reference lens as it is launched.
fn launched(row: &Value) -> Ray<f64> {
    let (p, d) = (numbers(&row["start"]), numbers(&row["dir0"]));
    Ray { point: Vec3::new(p[0], p[1], p[2]), direction: Vec3::new(d[0], d[1], d[2]) }
}

fn rows(lens: &Reference) -> Vec<Value> {
    lens.data["rays"].as_array().unwrap().clone()
}

#[test]
fn reference_lens_rays_land_where_they_must() {
    let mut compared = 0;
    for lens in reference::lenses() {
        let mut worst: f64 = 0.0;
        for row in rows(&lens) {
            let wavelength = reference::count(&row["w"]);
            let landing = Tracer::new(&lens.open(wavelength)).unwrap().trace(launched(&row));
            assert_eq!(row["status"] == "ok", landing.fate.is_imaged(), "{}: {row}", lens.id());
            let (Some(unit), true) = (row.get("unit"), landing.fate.is_imaged()) else { continue };
            let point = (&row["point"], &unit["point"], landing.ray.point);
            let direction = (&row["dir"], &unit["dir"], landing.ray.direction);
            let size = numbers(&row["point"]).iter().fold(0.0, |m: f64, v| m.max(v.abs()));
            let mut check = |got: f64, exact: f64, unit: f64, size: f64| {
                let allowed = 16.0 * unit + 2.0 * EPSILON * size;
                let error = (got - exact).abs() / allowed.max(f64::MIN_POSITIVE);
                worst = worst.max(error);
                compared += 1;
                assert!(error <= 1.0, "{}: {got:e} instead of {exact:e} in {row}", lens.id());
            };
            for ((exact, unit, got), size) in [(point, size.max(1.0)), (direction, 1.0)] {
                let (exact, unit) = (numbers(exact), numbers(unit));
                [got.x, got.y, got.z]
                    .iter()
                    .enumerate()
                    .for_each(|(i, v)| check(*v, exact[i], unit[i], size));
            }
            let opl = number(&row["opl"]);
            check(landing.opl, opl, number(&unit["opl"]), opl.abs());
        }
        println!("{}: worst ray {worst:.2} of 16 units", lens.id());
    }
    assert_eq!(compared, 2128);
}

/// Every derivative `[dx, dy, dOPL]` of the reference rays, by the backward pass.
#[test]
fn reference_lens_rays_have_the_right_derivatives() {
    let mut compared = 0;
    for lens in reference::lenses() {
        let mut worst: f64 = 0.0;
        for row in rows(&lens) {
            let Some(derivatives) = row.get("derivatives").and_then(Value::as_object) else {
                continue;
            };
            let mut system = lens.open(reference::count(&row["w"]));
            system.surfaces.iter_mut().for_each(|s| s.shape = s.shape.as_conic());
            let tracer = Tracer::new(&system).unwrap();
            let rays: Rays<f64> = std::iter::once(launched(&row)).collect();
            let axes = [Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0), Vec3::default()];
            for (output, point) in axes.into_iter().enumerate() {
                let opl = if output == 2 { 1.0 } else { 0.0 };
                let gradient = tracer.gradient(&rays, |_| AdjointSeed {
                    point,
                    opl,
                    ..AdjointSeed::default()
                });
                let (error, count) = worst_derivative(lens.id(), &gradient, derivatives, output);
                worst = worst.max(error);
                compared += count;
            }
        }
        println!("{}: worst derivative {worst:.1e}", lens.id());
    }
    assert_eq!(compared, 3339);
}

/// The largest error of the derivatives of one output, relative to the largest of them, and how many
/// were compared.
fn worst_derivative(
    lens: &str,
    gradient: &SystemGradient<f64>,
    derivatives: &serde_json::Map<String, Value>,
    output: usize,
) -> (f64, usize) {
    let exact = |row: &Value| number(&row[output]);
    let largest = derivatives.values().fold(1e-9, |m: f64, row| m.max(exact(row).abs()));
    let (mut worst, mut compared): (f64, usize) = (0.0, 0);
    for (name, row) in derivatives {
        let Some(got) = super::hard_cases::parameter(gradient, name) else { continue };
        let error = (got - exact(row)).abs() / largest;
        assert!(error < 1e-9, "{lens} {name}: {got:e} instead of {:e}", exact(row));
        worst = worst.max(error);
        compared += 1;
    }
    (worst, compared)
}

/// Rays over the pupil of a library lens at half of its field.
fn some_rays(count: usize) -> Rays<f64> {
    let angle: f64 = 0.2;
    (0..count)
        .map(|i| {
            let r = 5.0 * ((i as f64 + 0.5) / count as f64).sqrt();
            let (sin, cos) = (2.4 * i as f64).sin_cos();
            let point = Vec3::new(r * cos, r * sin - 1.0, -3.0);
            Ray { point, direction: Vec3::new(0.0, angle.sin(), angle.cos()) }
        })
        .collect()
}

fn system() -> System<f64> {
    bundled("double_gauss_rudolph_50").resolve(0, 0.5875618).unwrap()
}

#[test]
fn one_thread_two_threads_and_single_rays_give_the_same_bits() {
    let tracer = Tracer::new(&system()).unwrap();
    let rays = some_rays(10_000);
    let mut one = Landings::default();
    tracer.trace_batch(&rays, &mut one);
    for threads in [1, 2, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut many = Landings::default();
        pool.install(|| tracer.trace_batch_parallel(&rays, &mut many));
        assert_eq!(one, many, "{threads} threads");
        let seed = |i: usize| AdjointSeed {
            point: Vec3::new(one.x[i], one.y[i], 0.0),
            ..AdjointSeed::default()
        };
        let gradient = pool.install(|| tracer.gradient_parallel(&rays, seed));
        assert_eq!(gradient, tracer.gradient(&rays, seed), "{threads} threads");
    }
    let mut points = ImagePoints::default();
    for width in [SimdWidth::Baseline, SimdWidth::Bits256, SimdWidth::Bits512] {
        tracer.trace_batch_with(width, &rays, &mut points);
        assert_eq!((&points.x, &points.y), (&one.x, &one.y), "{width:?}");
    }
    for i in (0..rays.len()).step_by(97) {
        let landing = tracer.trace(rays.get(i));
        assert_eq!(landing.fate, one.fate(i));
        if landing.fate.is_imaged() {
            assert_eq!(landing.ray.point, Vec3::new(one.x[i], one.y[i], one.z[i]));
        }
    }
}

/// The lens with a mirror-like hole in the middle of a sphere, a conic, an asphere and a plane.
fn obstructed(radius: f64) -> System<f64> {
    let mut system = system();
    let c = system.surfaces[3].shape.curvature();
    let mut terms = [0.0; aplanat::lens::ASPHERE_TERMS];
    terms[0] = 1e-7;
    system.surfaces[2].shape = system.surfaces[2].shape.as_conic();
    system.surfaces[3].shape = Shape::Asphere { curvature: c, conic: 0.0, terms };
    let count = system.surfaces.len();
    for i in [0, 2, 3, 5, count - 1] {
        system.surfaces[i].obstruction = radius * (1.0 + 0.1 * i as f64);
    }
    system
}

/// The search for the edge of a pupil asks for many margins at once.
#[test]
fn margins_of_many_rays_are_those_of_single_rays() {
    let mut system = bundled("phone_us7558005_1").resolve(0, 0.5876).unwrap();
    for surface in system.surfaces.iter_mut().step_by(3) {
        surface.obstruction = 0.1;
    }
    compare_margins(&system);
    for (i, surface) in system.surfaces.iter_mut().enumerate() {
        if i % 3 != 1 {
            surface.pose = Some(Pose::new([0.01, -0.02], [0.01, -0.004]));
        }
        if i % 2 == 0 {
            surface.astigmatism = Some(1e-3);
        }
    }
    compare_margins(&system);
}

/// Compares margins and landings of rays in blocks with those of single rays, bit by bit.
fn compare_margins(system: &System<f64>) {
    let tracer = Tracer::new(system).unwrap();
    let height = system.surfaces[0].semi_diameter;
    let ray = |i: usize| {
        let (x, y) = (0.05 * (i % 5) as f64, 0.08 * (i / 5) as f64 - 1.0);
        let direction = Vec3::new(0.0, 0.1, 0.99_f64.sqrt());
        Ray { point: Vec3::new(x * height, y * height, 0.0), direction }
    };
    let rays: Rays<f64> = (0..101).map(ray).collect();
    let mut compared = 0;
    for surface in 0..system.surfaces.len() {
        for limit in [RayLimit::Rim, RayLimit::Obstruction, RayLimit::Miss] {
            let margins = tracer.margins_at(&rays, surface, limit);
            let landings = tracer.landings_at_edge(&rays, surface, limit);
            for (i, (margin, landing)) in margins.iter().zip(landings).enumerate() {
                let single = tracer.margin(rays.get(i), surface, limit);
                assert_eq!(margin.to_bits(), single.unwrap_or(f64::NAN).to_bits(), "{surface} {i}");
                compared += usize::from(margin.is_finite());
                match tracer.land_at_edge(rays.get(i), surface, limit) {
                    Some(point) => assert_eq!(landing, [point.x, point.y], "{surface} {limit:?}"),
                    None => assert!(landing[0].is_nan(), "{surface} {limit:?}"),
                }
            }
        }
    }
    assert!(compared > 1000, "{compared}");
}

/// The derivative of a margin at a rim or an obstruction by every number of the lens.
#[test]
fn the_margin_at_a_rim_has_the_derivative_of_its_value() {
    let mut system = bundled("double_gauss_rudolph_50").resolve(0, 0.5876).unwrap();
    system.surfaces[7].obstruction = 0.5;
    for surface in 0..system.surfaces.len() {
        SurfaceParameter::Curvature.promote_shape(&mut system, surface);
    }
    let rays = some_rays(21);
    let weights: Vec<f64> = (0..rays.len()).map(|i| 0.3 + 0.1 * i as f64).collect();
    for (surface, limit) in [(0, RayLimit::Rim), (5, RayLimit::Rim), (7, RayLimit::Obstruction)] {
        let sum = |system: &System<f64>| {
            let margins = Tracer::new(system).unwrap().margins_at(&rays, surface, limit);
            margins.iter().zip(&weights).map(|(margin, weight)| margin * weight).sum::<f64>()
        };
        let tracer = Tracer::new(&system).unwrap();
        let exact = tracer.margin_gradient(surface, limit, &rays, &weights);
        for i in 0..system.surfaces.len() {
            let by = &exact.surfaces[i];
            let numbers = [
                (SurfaceParameter::Curvature, by.curvature, 1e-6),
                (SurfaceParameter::Thickness, by.thickness, 1e-5),
                (SurfaceParameter::Index, by.index, 1e-6),
                (SurfaceParameter::SemiDiameter, by.semi_diameter, 1e-5),
            ];
            for (parameter, by, step) in numbers {
                let moved = |step: f64| {
                    let mut moved = system.clone();
                    *parameter.value_mut(&mut moved, i) += step;
                    sum(&moved)
                };
                let difference = (moved(step) - moved(-step)) / (2.0 * step);
                let near = (by - difference).abs() <= 1e-5 * difference.abs().max(1.0);
                assert!(near, "{surface} {limit:?}: {by} and {difference} by {parameter:?} of {i}");
            }
        }
    }
}

/// The same by the coefficients of aspheres, at their own rims and at those behind.
#[test]
fn the_margin_at_the_rim_of_an_asphere_has_the_derivative_of_its_value() {
    let mut system = bundled("double_gauss_rudolph_50").resolve(0, 0.5876).unwrap();
    for surface in [0, 3] {
        SurfaceParameter::AsphereTerm(0).promote_shape(&mut system, surface);
        *SurfaceParameter::Conic.value_mut(&mut system, surface) = -0.4;
        for (term, value) in [2e-6, -3e-8, 1e-10].into_iter().enumerate() {
            *SurfaceParameter::AsphereTerm(term).value_mut(&mut system, surface) = value;
        }
    }
    let rays = some_rays(15);
    let weights: Vec<f64> = (0..rays.len()).map(|i| 0.3 + 0.1 * i as f64).collect();
    for surface in [0, 3, 6] {
        let sum = |system: &System<f64>| {
            let tracer = Tracer::new(system).unwrap();
            let margins = tracer.margins_at(&rays, surface, RayLimit::Rim);
            margins.iter().zip(&weights).map(|(margin, weight)| margin * weight).sum::<f64>()
        };
        let tracer = Tracer::new(&system).unwrap();
        let exact = tracer.margin_gradient(surface, RayLimit::Rim, &rays, &weights);
        for i in [0, 3].into_iter().filter(|i| *i <= surface) {
            let by = &exact.surfaces[i];
            let terms = (0..4).map(|term| {
                (
                    SurfaceParameter::AsphereTerm(term),
                    by.terms[term],
                    1e-8 * 0.04_f64.powi(term as i32),
                )
            });
            for (parameter, by, step) in terms.chain([(SurfaceParameter::Conic, by.conic, 1e-4)]) {
                let moved = |step: f64| {
                    let mut moved = system.clone();
                    *parameter.value_mut(&mut moved, i) += step;
                    sum(&moved)
                };
                let difference = (moved(step) - moved(-step)) / (2.0 * step);
                let near = (by - difference).abs() <= 1e-5 * difference.abs().max(1e-3);
                assert!(near, "{surface}: {by} and {difference} by {parameter:?} of {i}");
                assert!(difference != 0.0, "{surface}: {parameter:?} of {i} does nothing");
            }
        }
    }
}

#[test]
fn an_obstruction_clips_inside_and_its_edge_passes() {
    let plane =
        |obstruction: f64| Surface { semi_diameter: 4.0, obstruction, ..Surface::plane(1.0, 1.5) };
    let surfaces = vec![plane(0.0), plane(2.0), plane(0.0)];
    let tracer = Tracer::new(&System { index_before: 1.0, surfaces, stop: None }).unwrap();
    let below = f64::from_bits(2.0_f64.to_bits() - 1);
    for (y, fate) in [
        (0.0, Fate::Clipped(1)),
        (below, Fate::Clipped(1)),
        (-below, Fate::Clipped(1)),
        (2.0, Fate::Imaged),
        (-2.0, Fate::Imaged),
        (4.0, Fate::Imaged),
        (4.1, Fate::Clipped(0)),
    ] {
        let ray = Ray { point: Vec3::new(0.0, y, -1.0), direction: Vec3::new(0.0, 0.0, 1.0) };
        assert_eq!(tracer.trace(ray).fate, fate, "{y}");
        let mut hits = Landings::default();
        tracer.trace_batch(&std::iter::once(ray).collect(), &mut hits);
        assert_eq!(hits.fate(0), fate, "{y}");
        let mut found = None;
        tracer.margins(ray, |surface, hurdle, margin| {
            if hurdle == RayLimit::Obstruction {
                assert!(found.replace((surface, margin)).is_none());
            }
        });
        assert_eq!(found, Some((1, y * y - 4.0)));
    }
}

#[test]
fn obstructed_rays_have_the_same_fate_in_blocks_and_singly() {
    let (clear, system) = (system(), obstructed(1.0));
    let tracer = Tracer::new(&system).unwrap();
    let rays = some_rays(5000);
    let (mut hits, mut without) = (Landings::default(), Landings::default());
    tracer.trace_batch(&rays, &mut hits);
    let mut open = system.clone();
    open.surfaces.iter_mut().for_each(|surface| surface.obstruction = 0.0);
    Tracer::new(&open).unwrap().trace_batch(&rays, &mut without);
    let mut narrow = Landings::default();
    tracer.trace_batch_with(SimdWidth::Baseline, &rays, &mut narrow);
    assert_eq!(hits, narrow);
    let mut blocked = std::collections::BTreeSet::new();
    for i in 0..rays.len() {
        let ray = rays.get(i);
        let landing = tracer.trace(ray);
        assert_eq!(landing.fate, hits.fate(i), "ray {i}");
        let mut first = None;
        tracer.margins(ray, |surface, hurdle, margin| {
            if first.is_none() && !(margin >= 0.0) {
                first = Some((surface, hurdle));
            }
        });
        assert_eq!(first.map(|(surface, _)| surface), landing.fate.surface(), "ray {i}");
        if let Some((surface, RayLimit::Obstruction)) = first {
            assert_eq!(landing.fate, Fate::Clipped(u32::try_from(surface).unwrap()));
            blocked.insert(surface);
        } else {
            assert_eq!(landing.fate, without.fate(i), "ray {i}");
            assert_eq!((hits.x[i], hits.opl[i]), (without.x[i], without.opl[i]));
        }
    }
    assert!(blocked.len() >= 4, "{blocked:?}");
    assert!(clear.surfaces.iter().all(|surface| surface.obstruction == 0.0));
}

#[test]
fn obstructions_that_leave_no_light_are_refused() {
    for (wrong, semi_diameter) in
        [(-1.0, 5.0), (f64::NAN, 5.0), (5.0, 5.0), (6.0, 5.0), (f64::INFINITY, f64::INFINITY)]
    {
        let mut system = system();
        system.surfaces[2].obstruction = wrong;
        system.surfaces[2].semi_diameter = semi_diameter;
        let error = Tracer::new(&system).unwrap_err().to_string();
        assert!(error.starts_with("obstruction of surface 3 is "), "{error}");
    }
    let mut system = system();
    (system.surfaces[2].obstruction, system.surfaces[2].semi_diameter) = (0.0, 0.0);
    assert!(Tracer::new(&system).is_ok());
    assert_eq!(obstructed(1.0).cast::<f32>().surfaces[0].obstruction, 1.0);
}

#[test]
fn a_ray_turned_about_the_axis_lands_turned() {
    let tracer = Tracer::new(&system()).unwrap();
    let rays = some_rays(50);
    let (sin, cos) = 0.7_f64.sin_cos();
    let turn = |v: Vec3<f64>| Vec3::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y, v.z);
    for i in 0..rays.len() {
        let ray = rays.get(i);
        let turned = Ray { point: turn(ray.point), direction: turn(ray.direction) };
        let (one, other) = (tracer.trace(ray), tracer.trace(turned));
        assert_eq!(one.fate, other.fate);
        let difference = turn(one.ray.point) - other.ray.point;
        assert!(!one.fate.is_imaged() || difference.dot(difference).sqrt() < 1e-12);
    }
}

/// A power of two scales every number without rounding.
#[test]
fn a_lens_scaled_by_a_power_of_two_gives_the_scaled_bits() {
    let mut lens = bundled("phone_us7558005_1");
    lens.surfaces[2].hyperhemisphere = true;
    let system = lens.resolve(0, 0.5875618).unwrap();
    let factor = 1024.0;
    let scaled = System {
        surfaces: system.surfaces.iter().map(|s| scale(s, factor)).collect(),
        ..system.clone()
    };
    let (small, large) = (Tracer::new(&system).unwrap(), Tracer::new(&scaled).unwrap());
    let mut imaged = 0;
    for i in 0..200 {
        let y = -0.7 + 0.007 * f64::from(i);
        let direction = Vec3::new(0.0, 0.2, (1.0_f64 - 0.04).sqrt());
        let ray = |f: f64| Ray { point: Vec3::new(0.1 * f, y * f, -0.5 * f), direction };
        let (one, other) = (small.trace(ray(1.0)), large.trace(ray(factor)));
        assert_eq!(one.fate, other.fate);
        assert_eq!(one.ray.point * factor, other.ray.point);
        assert_eq!(one.ray.direction, other.ray.direction);
        assert_eq!(one.opl * factor, other.opl);
        imaged += usize::from(one.fate.is_imaged());
    }
    assert!(imaged > 100);
}

fn scale(surface: &Surface<f64>, factor: f64) -> Surface<f64> {
    let (c, k, mut terms) = surface.shape.numbers();
    let mut power = factor.powi(3);
    for a in &mut terms {
        *a /= power;
        power *= factor * factor;
    }
    Surface {
        shape: Shape::simplest(c / factor, k, terms),
        thickness: surface.thickness * factor,
        semi_diameter: surface.semi_diameter * factor,
        obstruction: surface.obstruction * factor,
        ..surface.clone()
    }
}

/// Light that goes back the way it came arrives where it started.
#[test]
fn a_reversed_ray_returns_to_its_start() {
    for name in ["double_gauss_rudolph_50", "zoom_tamron_28_75_f28", "phone_us7558005_1"] {
        let system = bundled(name).resolve(0, 0.5875618).unwrap();
        let (forth, back) =
            (Tracer::new(&system).unwrap(), Tracer::new(&reversed(&system)).unwrap());
        let scale = 0.1 * system.surfaces[0].semi_diameter;
        for i in 0..20 {
            let direction = Vec3::new(0.0, 0.1, 0.99_f64.sqrt());
            let start = Vec3::new(0.3 * scale, scale * (0.2 * f64::from(i) - 2.0), 0.0);
            let landing = forth.trace(Ray { point: start, direction });
            if !landing.fate.is_imaged() {
                continue;
            }
            let (p, d) = (landing.ray.point, landing.ray.direction);
            let turned = Ray { point: p, direction: Vec3::new(-d.x, -d.y, d.z) };
            let home = back.trace(turned);
            assert!(home.fate.is_imaged(), "{name}: {home:?}");
            let miss = home.ray.point - start;
            assert!(miss.dot(miss).sqrt() < 1e-10, "{name}: {miss:?}");
        }
    }
}

/// The same lens as light from the image sees it; its last surface is the plane of the first
/// vertex.
fn reversed(system: &System<f64>) -> System<f64> {
    let count = system.surfaces.len();
    let image_index = system.surfaces[count - 1].index;
    let mut surfaces = vec![Surface::plane(system.surfaces[count - 2].thickness, image_index)];
    for i in (0..count - 1).rev() {
        let (c, k, terms) = system.surfaces[i].shape.numbers();
        let thickness = i.checked_sub(1).map_or(0.0, |before| system.surfaces[before].thickness);
        surfaces.push(Surface {
            shape: Shape::simplest(-c, k, terms.map(|a| -a)),
            thickness,
            index: system.index_before(i),
            ..system.surfaces[i].clone()
        });
    }
    surfaces.push(Surface::plane(0.0, system.index_before));
    System { index_before: image_index, surfaces, stop: None }
}

#[test]
fn a_plane_between_equal_media_changes_nothing() {
    let system = system();
    let mut longer = system.clone();
    let gap = longer.surfaces[3].clone();
    longer.surfaces[3].thickness *= 0.25;
    let thickness = gap.thickness - longer.surfaces[3].thickness;
    let plane = Surface { shape: Shape::Plane, thickness, semi_diameter: f64::INFINITY, ..gap };
    longer.surfaces.insert(4, plane);
    let (one, other) = (Tracer::new(&system).unwrap(), Tracer::new(&longer).unwrap());
    let rays = some_rays(50);
    for i in 0..rays.len() {
        let (a, b) = (one.trace(rays.get(i)), other.trace(rays.get(i)));
        let miss = a.ray.point - b.ray.point;
        assert!(!a.fate.is_imaged() || miss.dot(miss).sqrt() < 1e-12);
    }
}

/// An asphere without a rim that bends away from a ray, and comes back to it far out.
#[test]
fn a_ray_meets_an_unlimited_asphere_far_from_where_it_began() {
    let (curvature, term) = (0.02, -125.0 / 150f64.powi(4));
    let mut terms = [0.0; 7];
    terms[0] = term;
    let shape = Shape::Asphere { curvature, conic: -1.0, terms };
    let surface = Surface { shape, ..Surface::plane(300.0, 1.0) };
    let surfaces = vec![surface, Surface::plane(0.0, 1.0)];
    let tracer = Tracer::new(&System { index_before: 1.0, surfaces, stop: None }).unwrap();
    // At 45 degrees from a height of 50 mm at the vertex plane: z = r - 50, and c r²/2 + a r⁴ = z at
    // 150 mm and at no smaller height.
    let gap = |r: f64| 0.5 * curvature * r * r + term * r.powi(4) - (r - 50.0);
    assert!((500..1500).all(|i| gap(0.1 * f64::from(i)) > 0.0) && gap(150.0).abs() < 1e-9);
    let direction = Vec3::new(0.0, 0.5f64.sqrt(), 0.5f64.sqrt());
    let met = tracer.trace_to(Ray { point: Vec3::new(0.0, 49.0, -1.0), direction }, 0);
    assert!(met.fate.is_imaged(), "{met:?}");
    let Vec3 { y, z, .. } = met.ray.point;
    assert!((y - 150.0).abs() < 1e-9 && (z - 100.0).abs() < 1e-9, "{y} {z}");
}

#[test]
fn a_curvature_that_vanishes_joins_the_plane() {
    let trace = |curvature: f64| {
        let mut system = system();
        system.surfaces[2].shape = Shape::Conic { curvature, conic: 0.5 };
        Tracer::new(&system).unwrap().trace(some_rays(40).get(7))
    };
    let plane = {
        let mut system = system();
        system.surfaces[2].shape = Shape::Plane;
        Tracer::new(&system).unwrap().trace(some_rays(40).get(7))
    };
    for curvature in [1e-17, -1e-17, 1e-300, -1e-300, 0.0] {
        let landing = trace(curvature);
        assert_eq!(landing.fate, plane.fate);
        let miss = landing.ray.point - plane.ray.point;
        assert!(miss.dot(miss).sqrt() < 1e-13, "{curvature:e}: {miss:?}");
    }
}

/// Forward duals against differences, and the second derivative by nested duals against both.
#[test]
fn jets_are_the_derivatives_of_rays() {
    type Jet = Dual<Dual<f64, 1>, 1>;
    let at = |c: f64| {
        let mut system = system();
        system.surfaces[4].shape = Shape::Sphere { curvature: c };
        Tracer::new(&system).unwrap().trace(some_rays(40).get(9)).ray.point.y
    };
    let c = system().surfaces[4].shape.curvature();
    let mut lifted: System<Jet> = system().cast();
    lifted.surfaces[4].shape = Shape::Sphere { curvature: Jet::variable(Dual::variable(c, 0), 0) };
    let ray = some_rays(40).get(9);
    let ray = Ray { point: Vec3::from_f64(ray.point), direction: Vec3::from_f64(ray.direction) };
    let y = Tracer::new(&lifted).unwrap().trace(ray).ray.point.y;
    let h = 1e-5;
    let first = (8.0 * (at(c + h) - at(c - h)) - at(c + 2.0 * h) + at(c - 2.0 * h)) / (12.0 * h);
    let h = 3e-5;
    let second = (at(c + h) - 2.0 * at(c) + at(c - h)) / (h * h);
    assert_eq!(y.value(), at(c));
    assert!((y.slope[0].value / first - 1.0).abs() < 1e-8, "{y:?} {first}");
    assert!((y.slope[0].slope[0] / second - 1.0).abs() < 1e-4, "{y:?} {second}");
}

#[test]
fn lost_rays_end_with_a_surface_and_finite_numbers() {
    let tracer = Tracer::new(&system()).unwrap();
    let mut fates = std::collections::BTreeSet::new();
    let mut rays = Rays::default();
    for i in 0..4000 {
        let (a, b) = (0.37 * f64::from(i), 0.0007 * f64::from(i));
        let direction = Vec3::new(b.sin() * a.cos(), b.sin() * a.sin(), b.cos());
        rays.push(Ray { point: Vec3::new(0.0, 0.004 * f64::from(i) - 8.0, -2.0), direction });
    }
    let mut hits = Landings::default();
    tracer.trace_batch(&rays, &mut hits);
    for i in 0..rays.len() {
        let landing = tracer.trace(rays.get(i));
        assert_eq!(landing.fate, hits.fate(i), "ray {i}");
        assert!(landing.ray.point.is_finite() && landing.ray.direction.is_finite());
        assert!([hits.x[i], hits.y[i], hits.opl[i]].iter().all(|v| v.is_finite()));
        fates.insert(landing.fate.name());
    }
    assert_eq!(hits.fates().total(), rays.len());
    assert!(fates.len() >= 3, "{fates:?}");
    assert!(matches!(tracer.trace(rays.get(0)).fate, Fate::Clipped(_) | Fate::Imaged));
}

#[test]
fn a_reversed_lens_leads_rays_back_to_where_they_came_from() {
    for name in ["double_gauss_canon_fd50_f12", "phone_us7558005_1", "telescope_rc_f8"] {
        let lens = bundled(name);
        let system = lens.resolve(0, lens.wavelengths[lens.primary()].um).unwrap();
        let size = system.surfaces[0].semi_diameter.min(100.0);
        let shadow = system.surfaces[0].obstruction;
        let (there, back) =
            (Tracer::new(&system).unwrap(), Tracer::new(&system.reversed(0.0)).unwrap());
        let last = system.surfaces[system.surfaces.len() - 2].thickness;
        let mut arrived = 0;
        for i in 0..40 {
            let (sin, cos) = (f64::from(i) * 2.4).sin_cos();
            let radius = shadow + 0.02 * f64::from(i) * size;
            let (x, y) = (radius * cos, radius * sin);
            let start = Ray { point: Vec3::new(x, y, 0.0), direction: Vec3::new(0.01, 0.0, 1.0) };
            let landing = there.trace(start);
            if !landing.fate.is_imaged() {
                continue;
            }
            arrived += 1;
            let (p, d) = (landing.ray.point, landing.ray.direction);
            // What was behind the last vertex is in front of it now.
            let turned = Ray {
                point: Vec3::new(p.x, p.y, -(last + p.z)),
                direction: Vec3::new(-d.x, -d.y, d.z),
            };
            let home = back.trace(turned);
            assert!(home.fate.is_imaged(), "{name}: {:?}", home.fate);
            let (q, e) = (home.ray.point, home.ray.direction);
            assert!((q.x - x).hypot(q.y - y) < 1e-9 * size, "{name}: {q:?} for {x}, {y}");
            assert!((e.x / e.z + 0.01).hypot(e.y / e.z) < 1e-10, "{name}: {e:?}");
        }
        assert!(arrived > 10, "{name}: {arrived}");
    }
}

/// A hyperhemisphere is the whole of a sphere or ellipsoid; a hyperboloid has a second sheet, which
/// belongs to no surface.
#[test]
fn the_second_sheet_of_a_hyperboloid_is_no_surface() {
    let fate = |conic: f64, hyperhemisphere: bool, z: f64| {
        let surface = Surface {
            shape: Shape::Conic { curvature: 0.1, conic },
            hyperhemisphere,
            ..crate::aperture::image()
        };
        let system = System { index_before: 1.0, surfaces: vec![surface], stop: None };
        let direction = Vec3::new(0.0, 0.9992_f64, 0.04);
        let direction = direction * (1.0 / direction.dot(direction).sqrt());
        Tracer::new(&system).unwrap().trace(Ray { point: Vec3::new(0.0, -60.0, z), direction }).fate
    };
    // z = r²/10/(1 + √(1 + 3 r²/100)) has its other sheet below z = −2·10/3, the sphere its far
    // half above z = 10.
    for whole in [false, true] {
        assert_eq!(fate(-4.0, whole, -20.0), Fate::Missed(0));
        assert_eq!(fate(-1.5, whole, -90.0), Fate::Missed(0));
        let far = if whole { Fate::Imaged } else { Fate::Missed(0) };
        assert_eq!(fate(0.0, whole, 12.0), far);
        assert_eq!(fate(-0.5, whole, 20.0), far);
    }
}

/// Derivatives through decentred, tilted and irregular surfaces, against differences.
#[test]
fn mounted_surfaces_have_the_derivatives_of_their_landings() {
    let mut system = system();
    for surface in &mut system.surfaces {
        // A plane has no curvature that could change.
        if surface.shape == Shape::Plane {
            surface.shape = Shape::Sphere { curvature: 0.0 };
        }
    }
    for i in [1, 4, 7] {
        let i64 = i as f64;
        system.surfaces[i].pose = Some(Pose::new([0.1 * i64, -0.2], [0.01, -0.005 * i64]));
    }
    system.surfaces[2].axis = Some(Pose::new([0.05, 0.1], [0.02, -0.01]));
    system.surfaces[4].axis = Some(Pose::new([-0.1, 0.0], [-0.01, 0.02]));
    system.surfaces[4].astigmatism = Some(2e-4);
    system.surfaces[7].astigmatism = Some(-1e-4);
    let rays = some_rays(19);
    let seed = AdjointSeed {
        point: Vec3::new(0.7, -0.4, 0.0),
        direction: Vec3::new(0.3, 5.0, 0.0),
        opl: 0.2,
    };
    let sum = |system: &System<f64>| {
        let mut hits = Landings::default();
        Tracer::new(system).unwrap().trace_batch(&rays, &mut hits);
        (0..rays.len())
            .filter(|i| hits.fate(*i).is_imaged())
            .map(|i| {
                0.7 * hits.x[i] - 0.4 * hits.y[i]
                    + 0.3 * hits.l[i]
                    + 5.0 * hits.m[i]
                    + 0.2 * hits.opl[i]
            })
            .sum::<f64>()
    };
    let gradient = Tracer::new(&system).unwrap().gradient(&rays, |_| seed);
    let mut compared = 0;
    for i in 0..system.surfaces.len() - 1 {
        let difference = |step: f64, set: fn(&mut System<f64>, usize, f64)| {
            let value = |by: f64| {
                let mut other = system.clone();
                set(&mut other, i, by);
                sum(&other)
            };
            (8.0 * (value(step) - value(-step)) - (value(2.0 * step) - value(-2.0 * step)))
                / (12.0 * step)
        };
        let found = &gradient.surfaces[i];
        let pairs = [
            (found.thickness, difference(1e-3, |s, i, by| s.surfaces[i].thickness += by)),
            (found.index, difference(1e-5, |s, i, by| s.surfaces[i].index += by)),
            (
                found.curvature,
                difference(1e-6, |s, i, by| {
                    *SurfaceParameter::Curvature.value_mut(s, i) += by;
                }),
            ),
        ];
        for (k, (found, difference)) in pairs.into_iter().enumerate() {
            let size = found.abs().max(difference.abs()).max(1.0);
            assert!((found - difference).abs() < 1e-7 * size, "{i} {k}: {found} {difference}");
            compared += 1;
        }
    }
    assert_eq!(compared, 3 * (system.surfaces.len() - 1));
}

/// Light that has already passed the vertex plane of a surface that it misses is drawn to where it
/// last met glass; light on its way there is drawn as far as that plane.
#[test]
fn the_drawing_of_a_ray_that_misses_ends_where_it_is() {
    let sphere = |curvature: f64, thickness: f64| Surface {
        shape: Shape::Sphere { curvature },
        ..Surface::plane(thickness, 1.0)
    };
    let drawn = |gap: f64| {
        let surfaces = vec![sphere(0.1, gap), sphere(1.0 / 3.0, 5.0)];
        let system = System { index_before: 1.0, surfaces, stop: None };
        let direction = Vec3::new(0.0, 0.0, 1.0);
        let ray = Ray { point: Vec3::new(0.0, 8.0, -1.0), direction };
        Tracer::new(&system).unwrap().polyline(ray)
    };
    // At a height of 8 the first sphere of radius 10 is 4 behind its vertex.
    for (gap, ends) in [(2.0, vec![-1.0, 4.0]), (6.0, vec![-1.0, 4.0, 6.0])] {
        let found = drawn(gap);
        assert_eq!(found.fate, Fate::Missed(1));
        let z: Vec<f64> = found.points.iter().map(|p| p.z).collect();
        assert!(z.len() == ends.len(), "{z:?}");
        assert!(z.iter().zip(ends).all(|(a, b)| (a - b).abs() < 1e-12), "{z:?}");
    }
}

#[test]
fn light_goes_through_no_medium_without_a_positive_index() {
    let system = |before: f64, behind: f64| System {
        index_before: before,
        surfaces: vec![Surface::plane(5.0, behind), Surface::plane(0.0, 1.0)],
        stop: None,
    };
    assert!(Tracer::new(&system(1.0, 1.5)).is_ok());
    for bad in [0.0, -1.5, f64::NAN, f64::INFINITY] {
        assert!(Tracer::new(&system(bad, 1.5)).is_err(), "{bad} in front");
        assert!(Tracer::new(&system(1.0, bad)).is_err(), "{bad} behind");
    }
}

/// Rays to points of a conic that are known beforehand, with the normal there: half of the gradient
/// of `2z − c (r² + (1 + κ) z²)`.
#[test]
fn the_margin_at_a_miss_is_that_along_the_normal_of_the_conic() {
    let (curvature, index) = (0.04, 1.5);
    for conic in [0.0, -2.0, -1.0, 0.7] {
        let shape = Shape::Conic { curvature, conic };
        let surfaces = vec![Surface { shape, ..Surface::plane(0.0, 1.7) }];
        let tracer = Tracer::new(&System { index_before: index, surfaces, stop: None }).unwrap();
        for [x, y, u, v] in [[3.0, -5.0, 0.2, 0.1], [0.0, 9.0, 0.0, -0.3], [7.0, 2.0, 0.3, 0.0]] {
            let r2: f64 = x * x + y * y;
            let root = (1.0 - (1.0 + conic) * curvature * curvature * r2).sqrt();
            let point = Vec3::new(x, y, curvature * r2 / (1.0 + root));
            let normal = Vec3::new(-curvature * x, -curvature * y, root);
            let direction = Vec3::new(u, v, (1.0_f64 - u * u - v * v).sqrt());
            let mut found = None;
            tracer.margins(
                Ray { point: point - direction * 20.0, direction },
                |_, limit, margin| {
                    found = found.or((limit == RayLimit::Miss).then_some(margin));
                },
            );
            let exact = (index * direction.dot(normal)).powi(2);
            let found: f64 = found.unwrap();
            assert!((found / exact - 1.0).abs() < 1e-12, "{conic} {x} {y}: {found} {exact}");
        }
    }
}
