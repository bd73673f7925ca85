//! Rays through freeforms: against another program, backwards, in every number type, in bundles, at
//! the edge of the pupil, and with their derivatives.

use aplanat::files;
use aplanat::lens::{
    Freeform, FreeformKind, IdealAction, Lens, Pose, Shape, Surface, System, blank,
};
use aplanat::math::{Dual, Vec3};
use aplanat::trace::{
    AdjointSeed, Fate, Landings, Ray, RayLimit, Rays, SurfaceParameter, TraceSink as _, Tracer,
};

fn conic(curvature: f64, conic: f64, terms: &[f64]) -> Shape<f64> {
    Shape::new(curvature, conic, terms, 0).unwrap()
}

/// A freeform of each kind with the shape that it stands on.
fn forms() -> Vec<(Shape<f64>, Freeform<f64>)> {
    let radius = 5.0;
    let of = |shape, kind, numbers: &[f64]| (shape, Freeform { kind, numbers: numbers.to_vec() });
    vec![
        of(conic(0.02, -0.5, &[]), FreeformKind::OddAsphere, &[0.0, 0.001, -2e-4, 0.0, 1e-5]),
        of(conic(-0.03, 1.4, &[1e-5]), FreeformKind::Biconic, &[0.05, -0.7]),
        of(conic(0.04, -0.3, &[]), FreeformKind::Toroid, &[-0.06, 1e-3, -2e-5]),
        of(
            conic(0.03, 0.0, &[]),
            FreeformKind::XyPolynomial { radius },
            &[0.05, -0.02, 0.1, 0.03, -0.04, 0.02, -0.05],
        ),
        of(
            conic(0.03, 0.2, &[]),
            FreeformKind::Zernike { radius },
            &[0.0, 0.01, 0.0, 0.02, 0.03, 0.0, -0.02, 0.0, 0.0, 0.0, 0.01],
        ),
        of(
            conic(0.03, 0.0, &[]),
            FreeformKind::Chebyshev { half_widths: [5.0, 4.0] },
            &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.1, 0.0, -0.05, 0.02],
        ),
        of(
            conic(0.03, -0.4, &[]),
            FreeformKind::QCon { radius },
            &[0.05, -0.03, 0.01, 0.002, -0.004],
        ),
        of(
            conic(-0.03, 0.3, &[]),
            FreeformKind::QBfs { radius },
            &[0.03, -0.01, 0.004, 0.001, -5e-4, 3e-4],
        ),
        of(
            conic(0.02, -0.5, &[1e-5]),
            FreeformKind::RadialPhase { radius, order: 2.0 },
            &[-150.0, 20.0, -8.0],
        ),
        of(
            conic(0.01, 0.0, &[]),
            FreeformKind::XyPhase { radius, order: -1.0 },
            &[40.0, -60.0, -150.0, 30.0, -90.0, 25.0, -10.0],
        ),
    ]
}

/// The rule of a form that adds to the phase, at 0.55 µm.
fn action(form: &Freeform<f64>) -> Option<IdealAction<f64>> {
    let order = form.kind.order()?;
    Some(IdealAction::Phase { path: order * 0.55e-3 / std::f64::consts::TAU })
}

/// One freeform into glass and a plane 20 mm behind its vertex.
fn single((shape, form): &(Shape<f64>, Freeform<f64>), semi_diameter: f64) -> System<f64> {
    let freeform = Some(Box::new(form.clone()));
    let ideal = action(form);
    let face =
        Surface { shape: *shape, freeform, ideal, semi_diameter, ..Surface::plane(20.0, 1.6) };
    let surfaces = vec![face, Surface::plane(0.0, 1.6)];
    System { index_before: 1.0, surfaces, stop: None }
}

fn ray([x, y, z]: [f64; 3], [l, m]: [f64; 2]) -> Ray<f64> {
    let direction = Vec3::new(l, m, (1.0 - l * l - m * m).sqrt());
    Ray { point: Vec3::new(x, y, z), direction }
}

fn some_rays(count: usize) -> Rays<f64> {
    let mut rays = Rays::default();
    for i in 0..count {
        let at = |step: f64| 2.0 * (i as f64 * step).fract() - 1.0;
        let start = [3.0 * at(0.856_674_8), 3.0 * at(0.733_891_8), -3.0];
        rays.push(ray(start, [0.1 * at(0.628_706_7), 0.1 * at(0.538_597_4)]));
    }
    rays
}

/// Landing x, y, direction cosines l, m and optical path in 40 digits: crossing by a root finder on
/// the sag of the definition, numerical derivatives for the normal, refraction by the angles.
const EXPECTED: [[[f64; 5]; 2]; 10] = [
    [
        [
            2.7664311580552203,
            -1.1337343769203807,
            0.04790103518295712,
            0.048146128391874564,
            35.04415986781716,
        ],
        [
            -3.198532159268064,
            3.8642454737513314,
            -0.012848311832322467,
            0.11126948647745968,
            35.1988940461113,
        ],
    ],
    [
        [
            2.364358103291809,
            -1.9461214174024917,
            0.028053694424821765,
            0.00760943042172625,
            35.023000426515466,
        ],
        [
            -2.565258411667074,
            4.522123636648768,
            0.018954406838093737,
            0.14337658740737397,
            35.301904133562445,
        ],
    ],
    [
        [
            3.870559357418988,
            -0.8094369800297289,
            0.10267282895324223,
            0.06400375661513279,
            35.25866572604374,
        ],
        [
            -5.058074321473389,
            3.6079491705943494,
            -0.10463426803529642,
            0.09972830076980098,
            35.52938887232721,
        ],
    ],
    [
        [
            2.4500111891117813,
            -1.024518133702637,
            0.03183783619955628,
            0.0536473771852683,
            34.993510031056,
        ],
        [
            -2.9872096375880033,
            3.8866430746470524,
            -0.00220109622091578,
            0.11225665669580304,
            35.183303302401505,
        ],
    ],
    [
        [
            2.6129831725249395,
            -1.0564117188498805,
            0.040301548351168136,
            0.05202407900732215,
            35.05564937460215,
        ],
        [
            -3.114396345841434,
            3.8360437180902265,
            -0.008626195113180588,
            0.10985004742796113,
            35.18832025264159,
        ],
    ],
    [
        [
            2.893240507311385,
            -0.8323473002200535,
            0.054134230448301644,
            0.06318465789814895,
            35.066914546716916,
        ],
        [
            -2.9538223528523924,
            3.729296115195736,
            -0.00040542380131341793,
            0.1042676203166639,
            35.131302315754844,
        ],
    ],
    [
        [
            2.5433417950943515,
            -0.8742745893631126,
            0.03655530625729781,
            0.06115600543067707,
            35.02123258181152,
        ],
        [
            -2.9168031836220396,
            3.7069709197437697,
            0.0014868098212746114,
            0.10310549608489297,
            35.12123570756198,
        ],
    ],
    [
        [
            3.454341308394126,
            -1.946950784312058,
            0.08243828740517294,
            0.007815299435974405,
            35.19610648363985,
        ],
        [
            -4.357280745245839,
            4.493762573664296,
            -0.07017810045720889,
            0.14266092952667592,
            35.57694604439911,
        ],
    ],
    [
        [
            2.736889277217406,
            -1.0996633967209244,
            0.04643273856823665,
            0.04985207773027497,
            35.03952621635509,
        ],
        [
            -3.159900540771356,
            3.8421969611314366,
            -0.010935859589451206,
            0.1102147747969734,
            35.18706348783643,
        ],
    ],
    [
        [
            2.935097919053624,
            -1.3192609419844652,
            0.056442861543590114,
            0.03887627589244263,
            35.07134273441366,
        ],
        [
            -3.5223179888856695,
            4.043491796717738,
            -0.02909720342663917,
            0.12033095036139277,
            35.29261764799914,
        ],
    ],
];

#[test]
fn rays_land_where_another_program_says() {
    let starts = [ray([1.5, -2.25, -3.0], [0.1, 0.05]), ray([-2.75, 1.0, -3.0], [-0.06, 0.2])];
    let mut worst: f64 = 0.0;
    for (form, expected) in forms().iter().zip(EXPECTED) {
        // With a rim the crossing is trusted, without one it is isolated.
        for semi_diameter in [6.0, f64::INFINITY] {
            let tracer = Tracer::new(&single(form, semi_diameter)).unwrap();
            for (start, [x, y, l, m, opl]) in starts.into_iter().zip(expected) {
                let found = tracer.trace(start);
                assert_eq!(found.fate, Fate::Imaged, "{}", form.1.kind.name());
                let (p, d) = (found.ray.point, found.ray.direction);
                let apart = [p.x - x, p.y - y, d.x - l, d.y - m, found.opl - opl];
                worst = apart.into_iter().fold(worst, |worst, apart| worst.max(apart.abs()));
            }
        }
    }
    println!("freeforms against 40 digits: {worst:.1e} mm");
    assert!(worst < 1e-13, "{worst}");
}

/// Light that is sent back returns along its way: as many media, other sag signs and senses.
#[test]
fn light_that_goes_back_through_a_freeform_returns() {
    for form in forms() {
        let system = single(&form, 6.0);
        let back = Tracer::new(&system.reversed(3.0)).unwrap();
        let there = Tracer::new(&system).unwrap();
        for i in 0..60 {
            let start = some_rays(60).get(i);
            let landing = there.trace(start);
            if !landing.fate.is_imaged() {
                continue;
            }
            let (p, d) = (landing.ray.point, landing.ray.direction);
            let turned =
                Ray { point: Vec3::new(p.x, p.y, -20.0), direction: Vec3::new(-d.x, -d.y, d.z) };
            let home = back.trace(turned);
            assert_eq!(home.fate, Fate::Imaged);
            let (q, e) = (home.ray.point, home.ray.direction);
            assert!((q.x - start.point.x).hypot(q.y - start.point.y) < 1e-12, "{q:?}");
            assert!((e.x + start.direction.x).hypot(e.y + start.direction.y) < 1e-13, "{e:?}");
            assert!((home.opl - landing.opl).abs() < 1e-12);
        }
    }
}

/// A mirror sends the light back through the same freeform: the sense of travel decides there too.
#[test]
fn a_freeform_is_met_from_behind_too() {
    for (shape, form) in forms() {
        let face = |thickness: f64, index: f64| Surface {
            shape,
            freeform: Some(Box::new(form.clone())),
            ideal: action(&form),
            ..Surface::plane(thickness, index)
        };
        let mirror = Surface { mirror: true, ..Surface::plane(-8.0, 1.6) };
        let surfaces = vec![face(8.0, 1.6), mirror, face(-3.0, 1.0), Surface::plane(0.0, 1.0)];
        let system = System { index_before: 1.0, surfaces, stop: None };
        let tracer = Tracer::new(&system).unwrap();
        // A ray that is sent back along itself comes back to its start.
        let start = ray([1.0, -1.5, -3.0], [0.0, 0.0]);
        let found = tracer.trace(start);
        assert_eq!(found.fate, Fate::Imaged, "{}", form.kind.name());
        assert!(found.ray.direction.z < 0.0);
        let again = Ray {
            point: found.ray.point - Vec3::new(0.0, 0.0, 3.0),
            direction: found.ray.direction * -1.0,
        };
        let home = tracer.trace(again);
        assert_eq!(home.fate, Fate::Imaged);
        let apart = home.ray.point - start.point - Vec3::new(0.0, 0.0, 3.0);
        assert!(apart.dot(apart).sqrt() < 1e-12, "{}: {apart:?}", form.kind.name());
    }
}

/// Single rays, bundles, single precision and dual numbers take the same crossing.
#[test]
fn every_number_type_and_every_bundle_agree() {
    let rays = some_rays(150);
    for form in forms() {
        let mut system = single(&form, 4.0);
        system.surfaces[0].pose = Some(Pose::new([0.1, -0.2], [0.02, 0.03]));
        let tracer = Tracer::new(&system).unwrap();
        let (mut one, mut many) = (Landings::default(), Landings::default());
        tracer.trace_batch(&rays, &mut one);
        tracer.trace_batch_parallel(&rays, &mut many);
        let dual = Tracer::new(&system.cast::<Dual<f64, 1>>()).unwrap();
        let small = Tracer::new(&system.cast::<f32>()).unwrap();
        for i in 0..rays.len() {
            let found = tracer.trace(rays.get(i));
            assert_eq!(one.fate(i), found.fate);
            assert_eq!(dual.trace(rays.get(i).cast()).fate, found.fate);
            if !found.fate.is_imaged() {
                continue;
            }
            let p = found.ray.point;
            assert_eq!([one.x[i], one.y[i], one.opl[i]], [p.x, p.y, found.opl]);
            assert_eq!([many.x[i], many.y[i]], [p.x, p.y]);
            assert!((dual.trace(rays.get(i).cast()).ray.point.x.value - p.x).abs() < 1e-13);
            assert!((f64::from(small.trace(rays.get(i).cast()).ray.point.x) - p.x).abs() < 1e-4);
        }
    }
}

/// A sum over the landings of rays that depends on all of their numbers.
fn landing_sum(system: &System<f64>, rays: &Rays<f64>) -> f64 {
    let mut hits = Landings::default();
    Tracer::new(system).unwrap().trace_batch(rays, &mut hits);
    let one = |i: usize| {
        let (point, direction) = (0.7 * hits.x[i] - 0.4 * hits.y[i], 0.3 * hits.l[i]);
        point + direction + 5.0 * hits.m[i] + 0.2 * hits.opl[i]
    };
    (0..rays.len()).filter(|i| hits.fate(*i).is_imaged()).map(one).sum()
}

/// A step of a number that changes the sag at 4 to 5 mm by about 0.1 µm.
fn step(system: &System<f64>, surface: usize, parameter: SurfaceParameter) -> f64 {
    match parameter {
        SurfaceParameter::AsphereTerm(k) => 1e-4 * 5.0_f64.powi(-(2 * k as i32 + 3)),
        SurfaceParameter::Freeform(k) => {
            let kind = system.surfaces[surface].freeform.as_ref().unwrap().kind;
            let power = kind.power(k);
            if kind.is_phase() {
                0.1
            } else if power == 0 {
                1e-2
            } else {
                1e-4 * 4.0_f64.powi(power - 1)
            }
        }
        _ => 1e-4,
    }
}

/// Checks the adjoint of the first two surfaces against differences of the rays themselves, by every
/// number that they have; returns how many these are.
pub(crate) fn assert_landing_derivatives(name: &str, system: &System<f64>) -> usize {
    let rays = some_rays(20);
    let seed = AdjointSeed {
        point: Vec3::new(0.7, -0.4, 0.0),
        direction: Vec3::new(0.3, 5.0, 0.0),
        opl: 0.2,
    };
    let gradient = Tracer::new(system).unwrap().gradient(&rays, |_| seed);
    let mut compared = 0;
    for (i, surface) in system.surfaces.iter().enumerate().take(2) {
        let plane = surface.shape == Shape::Plane;
        let fixed = |p: &SurfaceParameter| {
            *p == SurfaceParameter::SemiDiameter || plane && *p == SurfaceParameter::Curvature
        };
        let all = SurfaceParameter::all().filter(|p| p.exists_on(surface) && !fixed(p));
        for parameter in all {
            let step = step(system, i, parameter);
            let value = |by: f64| {
                let mut moved = system.clone();
                *parameter.value_mut(&mut moved, i) += by;
                landing_sum(&moved, &rays)
            };
            let near = 8.0 * (value(step) - value(-step));
            let difference = (near - (value(2.0 * step) - value(-2.0 * step))) / (12.0 * step);
            let found = gradient.surfaces[i].by(parameter);
            let size = found.abs().max(difference.abs()).max(1e-12 / step).max(1e-3);
            assert!(
                (found - difference).abs() < 1e-6 * size,
                "{name}, surface {i}, {parameter:?}: {found} {difference}"
            );
            compared += 1;
        }
    }
    compared
}

/// The adjoint through two freeforms, the second one tilted and irregular too.
#[test]
fn freeforms_have_the_derivatives_of_their_landings() {
    let forms = forms();
    for (i, form) in forms.iter().enumerate() {
        let mut system = single(form, 8.0);
        let (shape, other) = forms[(i + 1) % forms.len()].clone();
        let second = Surface {
            shape,
            ideal: action(&other),
            freeform: Some(Box::new(other)),
            pose: Some(Pose::new([0.2, -0.1], [0.01, 0.02])),
            astigmatism: Some(1e-3),
            ..Surface::plane(15.0, 1.1)
        };
        system.surfaces.insert(1, second);
        system.surfaces[0].thickness = 4.0;
        system.surfaces[0].shape = form.0.as_asphere();
        let compared = assert_landing_derivatives(form.1.kind.name(), &system);
        assert!(compared > 15, "{compared}");
    }
}

/// The margins at a rim behind a freeform and at its own, with their derivatives.
#[test]
fn margins_of_freeforms_have_the_derivatives_of_their_values() {
    let rays = some_rays(6);
    let weights: Vec<f64> = (0..rays.len()).map(|i| 0.3 + 0.1 * i as f64).collect();
    for form in forms() {
        let mut system = single(&form, 8.0);
        system.surfaces[1].semi_diameter = 9.0;
        for (surface, limit) in
            [(0, RayLimit::Rim), (0, RayLimit::TotalReflection), (1, RayLimit::Rim)]
        {
            let sum = |system: &System<f64>| {
                let margins = Tracer::new(system).unwrap().margins_at(&rays, surface, limit);
                margins.iter().zip(&weights).map(|(margin, weight)| margin * weight).sum::<f64>()
            };
            let tracer = Tracer::new(&system).unwrap();
            let by = tracer.margin_gradient(surface, limit, &rays, &weights);
            let all = SurfaceParameter::all().filter(|p| p.exists_on(&system.surfaces[0]));
            for parameter in all.filter(|p| !matches!(p, SurfaceParameter::AsphereTerm(_))) {
                let power = match parameter {
                    SurfaceParameter::Freeform(k) => form.1.kind.power(k) - 1,
                    _ => 0,
                };
                let is_phase = form.1.kind.is_phase();
                let phase = is_phase && matches!(parameter, SurfaceParameter::Freeform(_));
                let step = if phase { 0.1 } else { 1e-4 * 3.0_f64.powi(power) };
                let moved = |step: f64| {
                    let mut moved = system.clone();
                    *parameter.value_mut(&mut moved, 0) += step;
                    sum(&moved)
                };
                let difference = (moved(step) - moved(-step)) / (2.0 * step);
                let found = by.surfaces[0].by(parameter);
                let size = difference.abs().max(1.0);
                let name = form.1.kind.name();
                assert!(
                    (found - difference).abs() < 1e-5 * size,
                    "{name} {surface} {limit:?} {parameter:?}: {found} {difference}"
                );
            }
        }
    }
}

/// A round freeform is a conic: the general path and the plain one give the same rays, spots and
/// first-order data.
#[test]
fn a_freeform_that_is_round_is_the_lens_without_it() {
    let plain = lens();
    for (kind, numbers) in [
        (FreeformKind::OddAsphere, vec![]),
        (FreeformKind::Biconic, vec![0.02, 0.0]),
        (FreeformKind::Toroid, vec![0.02]),
        (FreeformKind::Zernike { radius: 10.0 }, vec![0.0; 12]),
    ] {
        let mut shaped = plain.clone();
        shaped.surfaces[0].freeform = Some(Freeform { kind, numbers });
        let [a, b] = [&plain, &shaped].map(|lens| lens.resolve(0, 0.5875618).unwrap());
        let last = |system: &System<f64>| system.surfaces[1].thickness;
        assert!((last(&a) - last(&b)).abs() < 1e-12, "{}", kind.name());
        let [a, b] = [a, b].map(|system| Tracer::new(&system).unwrap());
        for i in 0..30 {
            let start = some_rays(30).get(i);
            let (p, q) = (a.trace(start), b.trace(start));
            assert_eq!(p.fate, q.fate);
            let apart = p.ray.point - q.ray.point;
            assert!(apart.dot(apart).sqrt() < 1e-12 && (p.opl - q.opl).abs() < 1e-12);
        }
    }
}

/// A singlet whose image is in the paraxial focus.
fn lens() -> Lens {
    let mut lens = blank();
    lens.surfaces[0].curvature = 0.02;
    lens.surfaces[1].curvature = -0.01;
    lens.image_solve = Some(0.0);
    lens
}

/// The focus is that of the y-z section: a cylinder focuses there or nowhere.
#[test]
fn first_order_data_are_those_of_the_section() {
    let mut cylinder = lens();
    cylinder.surfaces[1].curvature = 0.0;
    cylinder.surfaces[0].freeform =
        Some(Freeform { kind: FreeformKind::Toroid, numbers: vec![0.0] });
    let mut round = cylinder.clone();
    round.surfaces[0].freeform = None;
    let gap = |lens: &Lens| lens.resolve(0, 0.5875618).unwrap().surfaces[1].thickness;
    assert!((gap(&cylinder) - gap(&round)).abs() < 1e-12);
    let tracer = Tracer::new(&cylinder.resolve(0, 0.5875618).unwrap()).unwrap();
    let landing = |x: f64, y: f64| tracer.trace(ray([x, y, -1.0], [0.0, 0.0])).ray.point;
    assert_eq!(landing(2.0, 0.0).x, 2.0);
    assert!(landing(2.0, 1e-3).y.abs() < 1e-9);
}

/// The number of rays of each fate, which end at finite numbers.
fn fates_of(
    tracer: &Tracer<f64>,
    rays: &Rays<f64>,
) -> std::collections::BTreeMap<&'static str, usize> {
    let mut fates = std::collections::BTreeMap::new();
    for i in 0..rays.len() {
        let found = tracer.trace(rays.get(i));
        *fates.entry(found.fate.name()).or_default() += 1;
        let (p, d) = (found.ray.point, found.ray.direction);
        assert!(p.is_finite() && d.is_finite() && found.opl.is_finite(), "{found:?}");
    }
    fates
}

/// Numbers of any size end in a fate and a finite number, without a panic and in bounded time.
#[test]
fn wild_freeforms_end_in_a_fate() {
    let rays = some_rays(6);
    let mut fates = std::collections::BTreeMap::<&str, usize>::new();
    for (shape, form) in forms() {
        for factor in [1e9, -1e9, 1e30, 1e-300, 1e3] {
            for curvature in [0.0, 3.0, -1e6] {
                let mut wild = form.clone();
                wild.numbers.iter_mut().for_each(|a| *a *= factor);
                let (_, conic, terms) = shape.numbers();
                let shape = Shape::simplest(curvature, conic, terms);
                for semi_diameter in [2.0, f64::INFINITY] {
                    let system = single(&(shape, wild.clone()), semi_diameter);
                    let tracer = Tracer::new(&system).unwrap();
                    let found = fates_of(&tracer, &rays).into_iter();
                    found.for_each(|(fate, count)| *fates.entry(fate).or_default() += count);
                }
            }
        }
    }
    println!("{fates:?}");
    assert!(fates["imaged"] > 60 && fates["missed"] > 60);
}

/// A ray beside a base that ends, and rays along the axis of a cone and of a cylinder.
/// The vertex of these forms is on them: the ray along the axis arrives there, from afar and from the
/// vertex itself, whatever the rim.
#[test]
fn the_ray_along_the_axis_meets_the_vertex() {
    let at_vertex = [0, 1, 2, 3].map(|i| forms().swap_remove(i));
    for form in at_vertex {
        for semi_diameter in [f64::INFINITY, 100.0, 30.0, 5.0] {
            let tracer = Tracer::new(&single(&form, semi_diameter)).unwrap();
            let (far, near) = ([0.0, 0.0, -10.0], [0.0; 3]);
            for (start, slopes) in [
                (far, [0.0, 0.0]),
                (far, [0.0, 1e-30]),
                (far, [1e-18, 1e-18]),
                (near, [0.0, 0.0]),
                (near, [0.0, 0.3]),
            ] {
                let mut met = Vec::new();
                let traced = tracer.visit(ray(start, slopes), |i, p| met.push((i, p)));
                let place = format!("{:?} {semi_diameter} {start:?} {slopes:?}", form.1.kind);
                assert!(traced.fate.is_imaged(), "{place}: {:?}", traced.fate);
                let at: Vec3<f64> = met[0].1;
                assert!(at.x.hypot(at.y).hypot(at.z) < 1e-12, "{place}: {at:?}");
            }
        }
    }
    for form in forms() {
        let tracer = Tracer::new(&single(&form, f64::INFINITY)).unwrap();
        assert!(tracer.trace(ray([0.0, 0.0, -10.0], [0.0; 2])).fate.is_imaged(), "{form:?}");
    }
}

#[test]
fn special_rays_have_known_ends() {
    let of = |curvature, kind, numbers: &[f64]| {
        let form = Freeform { kind, numbers: numbers.to_vec() };
        Tracer::new(&single(&(conic(curvature, 0.0, &[]), form), f64::INFINITY)).unwrap()
    };
    // The biconic ends at 5 mm along x and at 10 mm along y.
    let biconic = of(0.1, FreeformKind::Biconic, &[0.2, 0.0]);
    let fate = |x: f64, y: f64| biconic.trace(ray([x, y, -9.0], [0.0, 0.0])).fate;
    assert_eq!(fate(4.9, 0.0), Fate::Imaged);
    assert_eq!(fate(5.1, 0.0), Fate::Missed(0));
    assert_eq!(fate(0.0, 9.9), Fate::Imaged);
    assert_eq!(fate(0.0, 10.1), Fate::Missed(0));
    // A cone refracts by one angle at every height, and not at its tip.
    let cone = of(0.0, FreeformKind::OddAsphere, &[0.1]);
    let slope = |x: f64| cone.trace(ray([x, 0.0, -1.0], [0.0, 0.0])).ray.direction.x;
    let half = 0.1_f64.atan();
    let bend = -(half - (half.sin() / 1.6).asin()).sin();
    assert_eq!(slope(0.0), 0.0);
    assert!((slope(1.0) - bend).abs() < 1e-15 && (slope(3.0) - bend).abs() < 1e-15);
    // An oblique ray that crosses a wave several times takes the first crossing: u = x/5, T4.
    let wave = FreeformKind::Chebyshev { half_widths: [5.0, 5.0] };
    let tracer = of(0.0, wave, &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    let start = Ray { point: Vec3::new(-6.0, 0.0, -0.3), direction: Vec3::new(1.0, 0.0, 0.05) };
    let mut first = None;
    tracer.visit(start, |surface, p| first = first.or((surface == 0).then_some(p)));
    let point: Vec3<f64> = first.unwrap();
    let height = |x: f64| {
        let u = x / 5.0;
        8.0 * u.powi(4) - 8.0 * u * u + 1.0 - (-0.3 + 0.05 * (x + 6.0))
    };
    let scanned = (0..200_000).map(|i| -6.0 + 6e-5 * f64::from(i));
    let mut before = scanned.clone().zip(scanned.skip(1));
    let (low, high) = before.find(|(a, b)| height(*a) > 0.0 && height(*b) <= 0.0).unwrap();
    assert!(low <= point.x && point.x <= high, "{point:?}: {low} {high}");
}

#[test]
fn freeforms_survive_the_lens_file() {
    for (shape, form) in forms() {
        let mut lens = lens();
        let (curvature, conic, _) = shape.numbers();
        (lens.surfaces[0].curvature, lens.surfaces[0].conic) = (curvature, conic);
        lens.surfaces[0].freeform = Some(form);
        let text = files::json::write(&lens);
        let again = files::json::read(&text, "a.json").unwrap();
        assert_eq!(again, lens, "{text}");
    }
    let text = files::json::write(&lens());
    let wrong = text.replacen(
        "\"thickness\"",
        "\"freeform\": {\"kind\": {\"zernike\": {\"radius\": -1.0}}, \"numbers\": [0.1]}, \"thickness\"",
        1,
    );
    let error = files::json::read(&wrong, "a.json").unwrap_err().to_string();
    assert!(error.contains("surface 1: the Zernike sag is normalised to -1 mm"), "{error}");
}

/// Every form that the format has goes through a foreign file and comes back with the same rays.
#[test]
fn freeforms_survive_a_foreign_file() {
    let folder = std::env::temp_dir().join(format!("aplanat-freeform-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let mut all = forms();
    all.push((conic(0.0, 0.0, &[1e-5]), all[0].1.clone()));
    let long = Freeform { kind: FreeformKind::OddAsphere, numbers: vec![1e-7; 11] };
    all.push((conic(0.01, 0.0, &[]), long));
    let fringe = FreeformKind::FringeZernike { radius: 8.0 };
    all.push((
        conic(0.01, -1.0, &[2e-6, 1e-9]),
        Freeform { kind: fringe, numbers: vec![0.0, 0.0, 1e-2, 0.0, 3e-3] },
    ));
    for (shape, form) in all {
        let mut written = lens();
        let (curvature, conic, terms) = shape.numbers();
        let row = &mut written.surfaces[0];
        (row.curvature, row.conic, row.asphere) = (curvature, conic, terms.to_vec());
        row.freeform = Some(form.clone());
        let path = folder.join("form.zmx");
        let saved = files::save(&written, &path);
        let name = form.kind.name();
        let has_powers = form.kind == FreeformKind::Biconic && terms[0] != 0.0;
        if has_powers || matches!(form.kind, FreeformKind::Chebyshev { .. }) {
            let error = saved.unwrap_err().to_string();
            assert!(error.contains("surface 1") && error.contains("as .zmx does not"), "{error}");
            continue;
        }
        saved.unwrap();
        let again = files::open(&path).unwrap().lens;
        assert_eq!(again.surfaces[0].freeform.as_ref().map(|form| form.kind), Some(form.kind));
        let [a, b] = [&written, &again]
            .map(|lens| Tracer::new(&lens.resolve(0, 0.5875618).unwrap()).unwrap());
        for i in 0..40 {
            let (p, q) = (a.trace(some_rays(40).get(i)), b.trace(some_rays(40).get(i)));
            assert_eq!(p.fate, q.fate, "{name}");
            let apart = p.ray.point - q.ray.point;
            assert!(apart.dot(apart).sqrt() < 1e-11, "{name}: {apart:?}");
        }
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

/// Toroids and biconics go through a `.seq` file too; other forms are refused by their surface.
#[test]
fn toroids_and_biconics_survive_a_sequence_file() {
    let folder = std::env::temp_dir().join(format!("aplanat-sequence-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("form.seq");
    for (kind, numbers, kept) in [
        (FreeformKind::Biconic, vec![0.05, -0.7], true),
        (FreeformKind::Toroid, vec![-0.06, 0.0, -2e-5, 1e-8], true),
        (FreeformKind::Toroid, vec![0.0], true),
        (FreeformKind::Toroid, vec![0.0, 1e-3], false),
        (FreeformKind::OddAsphere, vec![0.0, 0.0, 1e-4], true),
    ] {
        let mut written = lens();
        written.surfaces[0].conic = -0.3;
        written.surfaces[0].freeform = Some(Freeform { kind, numbers });
        let saved = files::save(&written, &path);
        if !kept {
            let error = saved.unwrap_err().to_string();
            assert!(error.contains("surface 1") && error.contains("as .seq does not"), "{error}");
            continue;
        }
        saved.unwrap();
        let again = files::open(&path).unwrap().lens;
        let [a, b] = [&written, &again]
            .map(|lens| Tracer::new(&lens.resolve(0, 0.5875618).unwrap()).unwrap());
        for i in 0..40 {
            let (p, q) = (a.trace(some_rays(40).get(i)), b.trace(some_rays(40).get(i)));
            let apart = p.ray.point - q.ray.point;
            assert!(p.fate == q.fate && apart.dot(apart).sqrt() < 1e-11, "{apart:?}");
        }
    }
    std::fs::remove_dir_all(&folder).unwrap();
}
