//! A gradient between two surfaces of a prescription: against glass, against rods whose rays are
//! known in closed form, against layers that keep `n sin θ`, and every derivative against differences.

use aplanat::files::json;
use aplanat::lens::{
    Lens, Medium, PROFILE_TERMS, Parameter, ProfileCoefficients, ProfileLaw, Quantity,
    RADIAL_TERMS, Surface, System,
};
use aplanat::math::{Dual, Real, Vec3};
use aplanat::paraxial::{Beam, first_order};
use aplanat::trace::{
    AdjointSeed, Fate, Landings, Ray, RayLimit, Rays, SurfaceParameter, SystemGradient, TraceSink,
    Tracer,
};
use std::f64::consts::{FRAC_PI_2, PI};

/// A lens of these rows, at infinity, with an entrance pupil.
pub(crate) fn lens_of(rows: &str, aperture: &str) -> Lens {
    let text = format!(
        r#"{{"aplanat": 1, "name": "gradient", "object": "infinity", "aperture": {aperture},
        "fields": {{"kind": "angle", "values": [{{"y": 0.0}}, {{"y": 3.0}}]}},
        "wavelengths": [{{"um": 0.5875618, "primary": true}}], "surfaces": [{rows}]}}"#
    );
    json::read(&text, "test").unwrap_or_else(|error| panic!("{error}"))
}

/// A rod with plane faces.
fn rod(law: &str, base: f64, radial: &[f64], length: f64) -> Lens {
    let rows = format!(
        r#"{{"thickness": {length}, "glass": {{"gradient": {{"base": {{"index": {base}}}, "of": "{law}",
        "radial": {radial:?}}}}}, "semi_diameter": 1.5, "stop": true}},
        {{"thickness": 2.0, "semi_diameter": 1.5}}"#
    );
    lens_of(&rows, r#"{"entrance_pupil_diameter": 2.0}"#)
}

pub(crate) fn system(lens: &Lens) -> System<f64> {
    lens.resolve(0, 0.5875618).unwrap_or_else(|error| panic!("{error}"))
}

pub(crate) fn ray(x: f64, y: f64, l: f64, m: f64) -> Ray<f64> {
    let direction = Vec3::new(l, m, (1.0 - l * l - m * m).sqrt());
    Ray { point: Vec3::new(x, y, -1.0), direction }
}

fn rays() -> Rays<f64> {
    let grid = [-0.8, -0.3, 0.0, 0.4, 0.9];
    let of = |x: f64| grid.map(|y| ray(x, y, 0.02 - 0.03 * y, 0.05 * x - 0.02));
    grid.into_iter().flat_map(of).collect()
}

/// A thick lens whose faces and gradient are of every kind, in front of an ordinary one.
pub(crate) fn busy(law: &str, radial: &[f64], axial: &[f64]) -> Lens {
    let rows = format!(
        r#"{{"curvature": 0.04, "conic": -0.4, "asphere": [1e-4, -2e-6], "thickness": 3.0,
          "glass": {{"gradient": {{"base": {{"nd": 1.62, "vd": 40.0}}, "of": "{law}",
          "radial": {radial:?}, "axial": {axial:?}}}}}, "semi_diameter": 2.5}},
        {{"curvature": -0.05, "thickness": 1.5, "glass": {{"gradient": {{"base": {{"index": 1.55}},
          "radial": [0.004, -1e-4]}}}}, "semi_diameter": 2.4, "stop": true}},
        {{"curvature": 0.03, "thickness": 0.7, "semi_diameter": 2.3}},
        {{"curvature": 0.02, "thickness": 1.0, "glass": "SCHOTT N-BK7", "semi_diameter": 2.6}},
        {{"curvature": -0.03, "thickness": 14.0, "semi_diameter": 2.6}}"#
    );
    lens_of(&rows, r#"{"entrance_pupil_diameter": 3.0}"#)
}

#[test]
fn grin_lens_a_gradient_that_varies_nowhere_is_glass_bit_for_bit() {
    let zero = rod("index", 1.6, &[0.0, 0.0], 5.0);
    let mut glass = zero.clone();
    glass.surfaces[0].medium = Medium::Index(1.6);
    assert_eq!(system(&zero), system(&glass));
    let (mut a, mut b) = (Landings::default(), Landings::default());
    Tracer::new(&system(&zero)).unwrap().trace_batch(&rays(), &mut a);
    Tracer::new(&system(&glass)).unwrap().trace_batch(&rays(), &mut b);
    assert_eq!(a, b);
    assert!(Tracer::new(&system(&zero)).unwrap().grin_step_plans().is_empty());
    // Forced through the steps it is glass but for rounding.
    let mut forced = system(&zero);
    forced.surfaces[0].grin =
        Some(ProfileCoefficients::new(ProfileLaw::Index, [0.0; PROFILE_TERMS]));
    Tracer::new(&forced).unwrap().trace_batch(&rays(), &mut b);
    for i in 0..rays().len() {
        for (a, b) in [(&a.x, &b.x), (&a.y, &b.y), (&a.m, &b.m), (&a.opl, &b.opl)] {
            assert!((a[i] - b[i]).abs() < 1e-14, "{} {}", a[i], b[i]);
        }
    }
}

#[test]
fn grin_lens_a_rod_has_the_focal_length_of_its_pitch() {
    let (n, g) = (1.6, 0.3);
    for (law, radial) in [
        ("square", vec![-(n * g) * (n * g)]),
        ("index", vec![-n * g * g / 2.0, 0.01]),
        ("sech", vec![g]),
    ] {
        for pitch in [0.25, 0.4, 0.1, 0.75, 1.1] {
            let length: f64 = 2.0 * PI / g * pitch;
            let lens = rod(law, n, &radial, length);
            let data = first_order(&system(&lens), &Beam::for_lens(&lens, 0)).unwrap();
            let phase = g * length;
            let efl = 1.0 / (n * g * phase.sin());
            let bfl = phase.cos() / (n * g * phase.sin());
            assert!((data.efl.unwrap() - efl).abs() < 1e-11 * efl.abs(), "{law} {pitch}");
            assert!((data.bfl.unwrap() - bfl).abs() < 1e-11 * efl.abs(), "{law} {pitch}");
            // The Petzval sum of a gradient is its thin power over n².
            let petzval = n * g * g * length / (n * n);
            assert!((data.petzval_sum - petzval).abs() < 1e-12, "{law}: {}", data.petzval_sum);
        }
        // Half a pitch turns the picture upside down and has no power.
        let half = rod(law, n, &radial, PI / g);
        let data = first_order(&system(&half), &Beam::for_lens(&half, 0)).unwrap();
        assert!(data.power.abs() < 1e-13, "{law}: {}", data.power);
        assert!((data.marginal.heights[1] + 1.0).abs() < 1e-12);
    }
}

#[test]
fn grin_lens_rays_in_a_parabolic_rod_are_sinusoids() {
    let (n, g) = (1.6, 0.3);
    for pitch in [0.25, 0.5] {
        let length = 2.0 * PI / g * pitch;
        let lens = rod("square", n, &[-(n * g) * (n * g)], length);
        let tracer = Tracer::new(&system(&lens)).unwrap();
        for ray in [ray(0.3, 0.9, 0.1, -0.2), ray(0.0, 1.2, 0.0, 0.0), ray(-0.7, 0.0, 0.0, 0.3)] {
            // Refraction keeps what lies in the face; n² = n₀² (1 − g² r²).
            let t = 1.0 / ray.direction.z;
            let at = ray.point + ray.direction * t;
            let square = n * n * (1.0 - g * g * (at.x * at.x + at.y * at.y));
            let (vx, vy) = (ray.direction.x, ray.direction.y);
            let vz = (square - vx * vx - vy * vy).sqrt();
            let (sin, cos) = (n * g * length / vz).sin_cos();
            let exact = [at.x * cos + vx / (n * g) * sin, at.y * cos + vy / (n * g) * sin];
            let mut found = [0.0; 2];
            let landing = tracer.visit(ray, |i, p| {
                if i == 1 {
                    found = [p.x, p.y];
                }
            });
            assert!(landing.fate.is_imaged());
            let out = [-at.x * n * g * sin + vx * cos, -at.y * n * g * sin + vy * cos];
            let d = landing.ray.direction;
            for (found, exact) in [(found, exact), ([d.x, d.y], out)] {
                let off = (found[0] - exact[0]).hypot(found[1] - exact[1]);
                assert!(off < 1e-8, "pitch {pitch}: {found:?} {exact:?} {off:.1e}");
            }
            assert!((d.dot(d) - 1.0).abs() < 1e-9);
        }
    }
}

#[test]
fn grin_lens_a_secant_rod_of_a_quarter_pitch_focuses_every_meridional_ray_on_its_face() {
    let g = 0.35;
    for turns in [1.0, 3.0] {
        let lens = rod("sech", 1.7, &[g], turns * FRAC_PI_2 / g);
        let tracer = Tracer::new(&system(&lens)).unwrap();
        for y in [0.2, 0.7, 1.0, 1.4] {
            let mut height = f64::NAN;
            let landing = tracer.visit(ray(0.0, y, 0.0, 0.0), |i, p| {
                if i == 1 {
                    height = p.y;
                }
            });
            assert!(landing.fate.is_imaged() && height.abs() < 1e-8, "{y}: {height:e}");
        }
    }
    // A parabola does not: so the test can tell.
    let parabola = rod("square", 1.7, &[-(1.7 * g) * (1.7 * g)], FRAC_PI_2 / g);
    let mut height = 0.0;
    Tracer::new(&system(&parabola)).unwrap().visit(ray(0.0, 1.4, 0.0, 0.0), |i, p| {
        height = if i == 1 { p.y } else { height };
    });
    assert!(height.abs() > 1e-3);
}

/// Gauss's rule of 8 points in each of 64 parts.
fn integral(length: f64, f: impl Fn(f64) -> f64) -> f64 {
    let nodes = [0.1834346424956498, 0.525532409916329, 0.7966664774136267, 0.9602898564975363];
    let weights = [0.362683783378362, 0.3137066458778873, 0.2223810344533745, 0.1012285362903763];
    let part = length / 64.0;
    let mut sum = 0.0;
    for i in 0..64 {
        let middle = (f64::from(i) + 0.5) * part;
        for (node, weight) in nodes.iter().zip(weights) {
            let off = 0.5 * part * node;
            sum += 0.5 * part * weight * (f(middle - off) + f(middle + off));
        }
    }
    sum
}

#[test]
fn grin_lens_layers_keep_the_sine_times_the_index() {
    let (base, axial, length) = (1.5, [0.02, -0.004, 5e-4, 1e-5], 6.0);
    for law in ["index", "square"] {
        let rows = format!(
            r#"{{"thickness": {length}, "glass": {{"gradient": {{"base": {{"index": {base}}},
            "of": "{law}", "axial": {axial:?}}}}}, "semi_diameter": 4.0, "stop": true}},
            {{"thickness": 1.0, "semi_diameter": 4.0}}"#
        );
        let lens = lens_of(&rows, r#"{"entrance_pupil_diameter": 2.0}"#);
        let tracer = Tracer::new(&system(&lens)).unwrap();
        let index = |z: f64| {
            let sum = axial.iter().rev().fold(0.0, |sum, a| (sum + a) * z);
            if law == "square" { (base * base + sum).sqrt() } else { base + sum }
        };
        for sine in [0.0, 0.2, -0.5] {
            let ray = ray(0.0, 0.3, 0.0, sine);
            let mut points = Vec::new();
            let landing = tracer.visit(ray, |_, p| points.push(p));
            assert!(landing.fate.is_imaged());
            let across = integral(length, |z| sine / (index(z).powi(2) - sine * sine).sqrt());
            let path =
                integral(length, |z| index(z).powi(2) / (index(z).powi(2) - sine * sine).sqrt());
            let off = points[1].y - points[0].y - across;
            assert!(off.abs() < 1e-9, "{law} {sine}: {off:e}");
            let air = (1.0 + 1.0) / (1.0 - sine * sine).sqrt();
            assert!((landing.opl - path - air).abs() < 1e-9, "{law}: {}", landing.opl - path - air);
            assert!((landing.ray.direction.y - sine).abs() < 1e-10);
        }
        // The first-order shift of a plate is the integral of 1/n.
        let data = first_order(&system(&lens), &Beam::for_lens(&lens, 0)).unwrap();
        let reduced = integral(length, |z| 1.0 / index(z));
        let slanted = aplanat::paraxial::paraxial_ray(&system(&lens), 0.0, 1.0);
        let off = slanted.heights[1] - reduced;
        assert!(off.abs() < 2e-12, "{law}: {off:e}");
        assert_eq!(data.efl, None, "{law}: {:?}", data.power);
    }
}

/// Every number of a surface that a ray depends on, with a step for differences.
fn numbers(surface: &Surface<f64>) -> Vec<(SurfaceParameter, f64)> {
    let mut all = vec![
        (SurfaceParameter::Thickness, 1e-3),
        (SurfaceParameter::Index, 1e-4),
        (SurfaceParameter::Curvature, 1e-4),
    ];
    if SurfaceParameter::Conic.exists_on(surface) {
        all.push((SurfaceParameter::Conic, 1e-2));
    }
    if SurfaceParameter::AsphereTerm(0).exists_on(surface) {
        all.extend(
            (0..3).map(|t| (SurfaceParameter::AsphereTerm(t), 1e-4 * 0.2_f64.powi(2 * t as i32))),
        );
    }
    for k in (0..PROFILE_TERMS).filter(|k| SurfaceParameter::GrinTerm(*k).exists_on(surface)) {
        let power = if k < RADIAL_TERMS { 2 * k as i32 + 2 } else { (k - RADIAL_TERMS) as i32 + 1 };
        // Short enough that the plan of the steps stays the same.
        all.push((SurfaceParameter::GrinTerm(k), 1e-4 * 0.5_f64.powi(power)));
    }
    all
}

/// A smooth function of where and how a ray lands.
fn loss<R: Real>(p: Vec3<R>, d: Vec3<R>, opl: R) -> R {
    let c = R::from_f64;
    p.x * p.x + c(0.7) * p.x * p.y + c(0.4) * p.y + c(3.0) * d.x * d.y + d.y * d.y - c(0.5) * d.z
        + c(0.3) * opl
}

/// Its slopes.
fn seed(p: Vec3<f64>, d: Vec3<f64>) -> AdjointSeed<f64> {
    AdjointSeed {
        point: Vec3::new(2.0 * p.x + 0.7 * p.y, 0.7 * p.x + 0.4, 0.0),
        direction: Vec3::new(3.0 * d.y, 3.0 * d.x + 2.0 * d.y, -0.5),
        opl: 0.3,
    }
}

fn gradients() -> [Lens; 3] {
    [
        busy("index", &[-0.01, 2e-4], &[0.01, -0.002]),
        busy("square", &[-0.03, 5e-4], &[0.02, 0.003, -1e-3]),
        busy("sech", &[0.1], &[-0.015]),
    ]
}

#[test]
fn grin_lens_every_derivative_of_a_ray_is_that_of_differences_and_of_duals() {
    let mut worst: f64 = 0.0;
    for lens in gradients() {
        let system = system(&lens);
        let rays = rays();
        let mut hits = Landings::default();
        let tracer = Tracer::new(&system).unwrap();
        tracer.trace_batch(&rays, &mut hits);
        assert_eq!(hits.fates().imaged, rays.len());
        let at = |h: &Landings<f64>, i: usize| {
            let p = Vec3::new(h.x[i], h.y[i], h.z[i]);
            (p, Vec3::new(h.l[i], h.m[i], h.n[i]), h.opl[i])
        };
        let found = tracer.gradient(&rays, |i| {
            let (p, d, _) = at(&hits, i);
            seed(p, d)
        });
        let value = |system: &System<f64>| -> f64 {
            let mut hits = Landings::default();
            Tracer::new(system).unwrap().trace_batch(&rays, &mut hits);
            (0..rays.len()).map(|i| at(&hits, i)).map(|(p, d, o)| loss(p, d, o)).sum()
        };
        let size = found.numbers().fold(0.0, |m: f64, v| m.max(v.abs()));
        for surface in 0..system.surfaces.len() - 1 {
            for (slot, step) in numbers(&system.surfaces[surface]) {
                let moved = |h: f64| {
                    let mut system = system.clone();
                    slot.promote_shape(&mut system, surface);
                    *slot.value_mut(&mut system, surface) += h;
                    value(&system)
                };
                // The plan is made for the coefficients that count.
                if let (SurfaceParameter::GrinTerm(k), Some(grade)) =
                    (slot, system.surfaces[surface].grin)
                    && grade.terms[k] == 0.0
                {
                    let by = found.surfaces[surface].by(slot);
                    let exact = by_dual(&system, surface, slot, &rays);
                    assert!((by - exact).abs() < 1e-3 * exact.abs().max(1e-3 * size.min(1.0)));
                    continue;
                }
                let difference = (8.0 * (moved(step) - moved(-step)) - moved(2.0 * step)
                    + moved(-2.0 * step))
                    / (12.0 * step);
                let by = found.surfaces[surface].by(slot);
                let scale = difference.abs().max(1e-3 * size.min(1.0));
                let off = (by - difference).abs() / scale;
                worst = worst.max(off);
                assert!(off < 1e-6, "{slot:?} of {surface}: {by} {difference} {off:.1e}");
                let exact = by_dual(&system, surface, slot, &rays);
                let off = (by - exact).abs() / scale;
                assert!(off < 1e-8, "{slot:?} of {surface}: {by} and by duals {exact}");
            }
        }
    }
    println!("worst against differences {worst:.1e}");
}

fn by_dual(system: &System<f64>, surface: usize, slot: SurfaceParameter, rays: &Rays<f64>) -> f64 {
    type D = Dual<f64, 1>;
    let mut dual: System<D> = system.cast();
    slot.promote_shape(&mut dual, surface);
    slot.value_mut(&mut dual, surface).slope[0] = 1.0;
    let tracer = Tracer::new(&dual).unwrap();
    let of = |i: usize| {
        let ray = rays.get(i);
        let ray =
            Ray { point: Vec3::from_f64(ray.point), direction: Vec3::from_f64(ray.direction) };
        let landing = tracer.trace(ray);
        loss(landing.ray.point, landing.ray.direction, landing.opl).slope[0]
    };
    (0..rays.len()).map(of).sum()
}

#[test]
fn grin_lens_batches_single_rays_and_threads_give_the_same_bits() {
    for lens in gradients() {
        let tracer = Tracer::new(&system(&lens)).unwrap();
        let many: Rays<f64> = (0..200)
            .map(|i| {
                let (x, y) = (0.008 * f64::from(i) - 0.9, 0.5 - 0.004 * f64::from(i));
                ray(x, y, 0.0, 0.02)
            })
            .collect();
        let (mut a, mut b) = (Landings::default(), Landings::default());
        tracer.trace_batch(&many, &mut a);
        tracer.trace_batch_parallel(&many, &mut b);
        assert_eq!(a, b);
        for i in 0..many.len() {
            let landing = tracer.trace(many.get(i));
            assert_eq!((landing.fate, landing.opl), (a.fate(i), a.opl[i]));
            assert_eq!((landing.ray.point.x, landing.ray.point.y), (a.x[i], a.y[i]));
        }
        let one =
            |_: usize| AdjointSeed { point: Vec3::new(1.0, 0.5, 0.0), ..AdjointSeed::default() };
        let serial: SystemGradient<f64> = tracer.gradient(&many, one);
        assert_eq!(serial, tracer.gradient_parallel(&many, one));
    }
}

/// A coarser tolerance takes fewer steps and is kept: in the rod of a catalogue a ten-millionth of the gap takes an
/// eighth of them or less.
#[test]
fn grin_lens_a_coarser_tolerance_takes_fewer_steps() {
    let path = std::path::Path::new("lenses/grin_rod_melles_griot.json");
    let rod = aplanat::files::open(path).unwrap().lens.resolve(0, 0.63).unwrap();
    let fine = Tracer::new(&rod).unwrap();
    let coarse = Tracer::with_grin_tolerance(&rod, 1e-7).unwrap();
    let [many, few] = [&fine, &coarse].map(|tracer| tracer.grin_step_plans()[0].steps);
    assert!(few * 8 <= many, "{few} {many}");
    for (y, slope) in [(0.1, 0.0), (0.5, 0.02), (-0.55, 0.05), (0.3, -0.1)] {
        let start = ray(0.1, y, 0.0, slope);
        let (a, b) = (fine.trace(start), coarse.trace(start));
        assert_eq!((a.fate, b.fate), (Fate::Imaged, Fate::Imaged), "{y} {slope}");
        let off = a.ray.point - b.ray.point;
        let off = off.dot(off).sqrt();
        assert!(off > 0.0 && off < 1e-7 * 2.0 * rod.surfaces[0].thickness, "{y} {slope}: {off:e}");
    }
}

#[test]
fn grin_lens_the_plan_keeps_its_tolerance() {
    for lens in gradients() {
        let mut system = system(&lens);
        let tracer = Tracer::new(&system).unwrap();
        for plan in tracer.grin_step_plans() {
            assert!(plan.error <= plan.tolerance && plan.steps.is_power_of_two(), "{plan:?}");
            println!("{plan:?}");
        }
        // A gap in two halves has other steps: what differs is their error.
        let whole = tracer.trace(ray(0.5, 0.8, 0.02, -0.05));
        let first = system.surfaces[0].clone();
        let half = Surface {
            shape: aplanat::lens::Shape::Plane,
            thickness: 0.5 * first.thickness,
            grin: first
                .grin
                .map(|grade| ProfileCoefficients { origin: 0.5 * first.thickness, ..grade }),
            ..first
        };
        system.surfaces[0].thickness *= 0.5;
        system.surfaces.insert(1, half);
        let halved = Tracer::new(&system).unwrap().trace(ray(0.5, 0.8, 0.02, -0.05));
        let off = whole.ray.point - halved.ray.point;
        assert!(off.dot(off).sqrt() < 1e-8, "{off:?}");
        assert!((whole.opl - halved.opl).abs() < 1e-8);
    }
}

#[test]
fn grin_lens_parameters_are_named_and_set() {
    let mut lens = busy("index", &[-0.01], &[0.01]);
    let radial = Parameter::new(0, Quantity::Grin(0));
    let axial = Parameter::new(0, Quantity::Grin(7));
    assert_eq!((lens.get(radial), lens.get(axial)), (Some(-0.01), Some(0.0)));
    assert!(lens.set(axial, -0.002) && lens.set(Parameter::new(0, Quantity::Index), 1.63));
    assert_eq!(
        (lens.get(axial), lens.get(Parameter::new(0, Quantity::Index))),
        (Some(-0.002), Some(1.63))
    );
    assert_eq!(axial.to_string(), "GRIN coefficient 2 of z after surface 1");
    assert!(!lens.set(Parameter::new(3, Quantity::Grin(0)), 1.0));
    assert_eq!(lens.get(Parameter::new(0, Quantity::Grin(10))), None);
    assert_eq!(Fate::Turned(2).surface(), Some(2));
}

/// A rod of 1 mm with an end of half a millimetre of radius.
#[test]
fn grin_lens_a_small_one_is_the_same_all_around() {
    let lens = lens_of(
        r#"{"thickness": 1.0, "glass": {"gradient": {"base": {"index": 1.6}, "of": "index",
        "radial": [-0.1]}}, "semi_diameter": 0.45, "stop": true},
        {"curvature": -2.0, "thickness": 0.5, "semi_diameter": 0.45}"#,
        r#"{"entrance_pupil_diameter": 0.6}"#,
    );
    let tracer = Tracer::new(&system(&lens)).unwrap();
    for height in [0.1, 0.25, 0.3] {
        let landing = |turn: f64| {
            let (sin, cos) = turn.sin_cos();
            let found = tracer.trace(ray(height * cos, height * sin, 0.0, 0.0));
            assert!(found.fate.is_imaged(), "{height} {turn}: {:?}", found.fate);
            // Back to the plane of the axis and the ray.
            let Vec3 { x, y, .. } = found.ray.point;
            [x * cos + y * sin, y * cos - x * sin]
        };
        let first = landing(0.0);
        for turn in [0.7, FRAC_PI_2, 2.5, PI, 4.0, 1.5 * PI] {
            let [along, across] = landing(turn);
            assert!((along - first[0]).abs() < 1e-9 && across.abs() < 1e-9, "{height} {turn}");
        }
    }
}

#[test]
fn grin_lens_a_ray_that_misses_the_end_of_its_gradient_has_a_negative_margin() {
    let mut system = system(&rod("index", 1.6, &[-0.01], 5.0));
    // A ball of half a millimetre at the end of a rod of 1.5 mm.
    system.surfaces[1].shape = aplanat::lens::Shape::Sphere { curvature: 2.0 };
    system.surfaces[1].semi_diameter = f64::INFINITY;
    let tracer = Tracer::new(&system).unwrap();
    let margin = |height: f64| tracer.margin(ray(0.0, height, 0.0, 0.0), 1, RayLimit::Miss);
    assert!(margin(0.1).unwrap() > 0.0);
    assert_eq!(margin(0.9), Some(-1.0));
}
