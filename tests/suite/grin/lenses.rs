//! Lenses with a closed form: the path of a ray, the order of convergence, and the gradient.

use super::{length, steps, until, vec3};
use aplanat::grin::field::{
    BSpline, HessianDiagonal, Luneburg, Maxwell, Parabolic, Polynomial, ProfileField, RegularGrid,
    Sech, Tricubic, Trilinear,
};
use aplanat::grin::{
    Face, GrinFate, GrinRay, GrinRegion, GrinSetup, GrinTracer, IndexField, Integrator, LastStep,
    LaunchMode, RayAdjoint, RayExit,
};
use aplanat::math::Vec3;
use std::f64::consts::{FRAC_PI_2, PI};

/// Rays onto the unit Luneburg lens from its left, each starting on its surface.
fn onto_unit_ball() -> Vec<GrinRay<f64>> {
    let ray = |i: usize| {
        let (r, angle) = (0.9 * ((i as f64 + 0.5) / 40.0).sqrt(), i as f64 * 2.399963);
        let (x, y) = (r * angle.cos(), r * angle.sin());
        GrinRay { x: vec3([x, y, -(1.0 - r * r).sqrt()]), v: vec3([0.0, 0.0, 1.0]) }
    };
    (0..40).map(ray).collect()
}

fn rms(errors: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = errors.len() as f64;
    (errors.map(|e| e * e).sum::<f64>() / count).sqrt()
}

/// The rms error of `x(π/2) = v₀` in the Luneburg lens.
fn luneburg_error(integrator: Integrator, count: u32) -> f64 {
    let field = ProfileField::sphere(Luneburg::new(1.0));
    let setup = steps(integrator, FRAC_PI_2 / f64::from(count), count);
    let rays = onto_unit_ball();
    let exits = GrinTracer::new(&field, setup).unwrap().trace_batch(&rays);
    rms(exits.iter().zip(&rays).map(|(exit, ray)| length(exit.x - ray.v)))
}

#[test]
fn grin_luneburg_focuses_with_the_order_of_each_integrator() {
    for integrator in Integrator::ALL {
        let kicks = integrator.kicks_per_step() as u32;
        let (coarse, fine) =
            (luneburg_error(integrator, 48 / kicks), luneburg_error(integrator, 192 / kicks));
        let order = (coarse / fine).log2() / 2.0;
        println!(
            "{}: {} kicks a ray {fine:.1e}, order {order:.2}",
            integrator.name(),
            192 / kicks * kicks
        );
        assert!(order > f64::from(integrator.order()) - 0.35, "{order}");
    }
    assert!(luneburg_error(Integrator::BlanesMoan, 14) < 5e-9);
    assert!(luneburg_error(Integrator::LeapfrogDkd, 96) < 5e-5);
}

#[test]
fn grin_all_optical_paths_to_a_luneburg_focus_are_equal() {
    let field = ProfileField::sphere(Luneburg::new(1.0));
    let plane: Vec<_> = onto_unit_ball()
        .iter()
        .map(|ray| GrinRay { x: vec3([ray.x.x, ray.x.y, -1.0]), ..*ray })
        .collect();
    let region = GrinRegion::ball(1.0);
    let setup = until(Integrator::BlanesMoan, 0.05, region, LastStep::Fractional);
    for exit in GrinTracer::new(&field, setup).unwrap().trace_batch(&plane) {
        assert_eq!(exit.fate, GrinFate::Left);
        assert!(length(exit.x - vec3([0.0, 0.0, 1.0])) < 2e-8, "{:?}", exit.x);
        assert!((exit.path - 1.0 - FRAC_PI_2).abs() < 2e-9, "{}", exit.path);
        assert!(exit.excess.abs() < 1e-7, "{}", exit.excess);
    }
}

/// The parameter at which a ray of the fish-eye at this angle to the axis reaches the antipode.
fn half_orbit(angle: f64) -> f64 {
    let count = 20_000;
    let at = |i: usize| PI * (i as f64 + 0.5) / f64::from(count);
    let rate = |t: f64| 1.0 / (1.0 + angle.cos() * t.sin()).powi(2);
    // The integrand is smooth but not periodic: Simpson's weights on midpoints and ends.
    let middle: f64 = (0..count as usize).map(|i| rate(at(i))).sum();
    let ends: f64 = (0..=count as usize)
        .map(|i| {
            let weight = if i == 0 || i == count as usize { 0.5 } else { 1.0 };
            weight * rate(PI * i as f64 / f64::from(count))
        })
        .sum();
    (2.0 * middle + ends) / 3.0 * PI / f64::from(count)
}

#[test]
fn grin_maxwell_images_a_point_onto_its_antipode() {
    let field = ProfileField::sphere(Maxwell::new(2.0, 1.0));
    for angle in [0.0f64, 0.3, 0.7, 1.1, 1.3] {
        let sigma = half_orbit(angle);
        let setup = steps(Integrator::BlanesMoan, sigma / 40.0, 40);
        let v = vec3([angle.cos(), angle.sin() * 0.6, angle.sin() * 0.8]);
        let exit = GrinTracer::new(&field, setup)
            .unwrap()
            .trace(&GrinRay { x: vec3([-1.0, 0.0, 0.0]), v });
        assert!(length(exit.x - vec3([1.0, 0.0, 0.0])) < 2e-7, "{angle}: {:?}", exit.x);
    }
}

#[test]
fn grin_a_fibre_of_ten_thousand_periods_stays_a_sinusoid() {
    let (axis, g) = (1.5, 0.5);
    let field = ProfileField::cylinder(Parabolic::new(axis, g));
    let ray = GrinRay { x: vec3([0.5, 0.1, 0.0]), v: vec3([0.0, 0.3, 1.0]) };
    let index = field.sample(ray.x).index;
    let vz = (index * index - 0.09).sqrt();
    let ray = GrinRay { v: vec3([0.0, 0.3, vz]), ..ray };
    let (periods, per_period) = (10_000, 50);
    let sigma = 2.0 * PI / (axis * g) * f64::from(periods);
    let count = periods * per_period;
    let setup = steps(Integrator::Pefrl, sigma / f64::from(count), count);
    let tracer = GrinTracer::new(&field, setup).unwrap();
    let outcome = tracer.loss_and_gradient(&[ray], |_, exit| {
        (exit.x.x, RayAdjoint { x: vec3([1.0, 0.0, 0.0]), ..RayAdjoint::default() })
    });
    let exit = outcome.exits[0];
    // The phase drifts by a fixed amount each period; the orbit stays.
    let error = length(Vec3::new(exit.x.x, exit.x.y, 0.0) - vec3([0.5, 0.1, 0.0]));
    let retrace = outcome.gradient.retrace_error;
    println!(
        "{count} steps: off by {error:.1e} across the axis, excess {:.1e}, retrace {retrace:.1e} steps",
        exit.excess
    );
    assert!(error < 1e-3 && exit.excess.abs() < 1e-9);
    assert!((exit.x.z / (vz * sigma) - 1.0).abs() < 1e-10);
    assert!(retrace < 1e-8, "{retrace}");
    assert!((outcome.gradient.starts[0].x.x - 1.0).abs() < 0.1);
}

#[test]
fn grin_the_secant_fibre_refocuses_every_meridional_ray() {
    let a = 1.0;
    let field = ProfileField::cylinder(Sech::new(1.6, a));
    let rays: Vec<_> = (1..20)
        .map(|i| GrinRay { x: vec3([0.05 * f64::from(i), 0.0, 0.0]), v: vec3([0.0, 0.0, 1.0]) })
        .collect();
    for focus in [1.0, 3.0, 5.0] {
        let region = GrinRegion::rod(2.0, -1.0, focus * FRAC_PI_2 / a);
        let setup = until(Integrator::BlanesMoan, 0.1, region, LastStep::Fractional);
        let setup = GrinSetup { launch: LaunchMode::Scaled, ..setup };
        let exits = GrinTracer::new(&field, setup).unwrap().trace_batch(&rays);
        let worst = exits.iter().map(|exit| exit.x.x.abs()).fold(0.0, f64::max);
        println!("secant fibre, focus {focus}: farthest ray {worst:.1e} from the axis");
        assert!(exits.iter().all(|exit| exit.fate == GrinFate::Left) && worst < 2e-5);
    }
}

/// `w · x` at `π/2` in the Luneburg lens, which is `w · v₀` whatever the start: the gradient by the
/// start must be 0, and `w` by the velocity.
fn luneburg_by_start(field: &dyn IndexField<f64>, integrator: Integrator, count: u32) -> [f64; 2] {
    let w = vec3([0.3, 1.0, -0.4]);
    let setup = steps(integrator, FRAC_PI_2 / f64::from(count), count);
    let ray = GrinRay { x: vec3([-0.75f64.sqrt(), 0.4, 0.3]), v: vec3([1.0, 0.0, 0.0]) };
    let loss = |_: usize, exit: &RayExit<f64>| {
        (w.dot(exit.x), RayAdjoint { x: w, ..RayAdjoint::default() })
    };
    let outcome = GrinTracer::new(field, setup).unwrap().loss_and_gradient(&[ray], loss);
    let start = outcome.gradient.starts[0];
    [length(start.x), length(start.v - w)]
}

#[test]
fn grin_trilinear_adjoints_are_inaccurate_and_smooth_ones_exact() {
    let index = |p: Vec3<f64>| (2.0 - p.dot(p).min(1.9)).sqrt();
    let mut trilinear =
        Trilinear::from_function(RegularGrid::cube(65, 1.1).unwrap(), index).unwrap();
    let smoothed = luneburg_by_start(&trilinear, Integrator::LeapfrogDkd, 500);
    trilinear.diagonal = HessianDiagonal::Exact;
    let exact = luneburg_by_start(&trilinear, Integrator::LeapfrogDkd, 500);
    let tricubic = Tricubic::approximate(64, 1.1, index).unwrap();
    let tricubic = luneburg_by_start(&tricubic, Integrator::BlanesMoan, 40);
    let closed = ProfileField::sphere(Luneburg::new(1.0));
    let closed = luneburg_by_start(&closed, Integrator::BlanesMoan, 16);
    println!("|dL/dx0| should be 0, |dL/dv0 - w| should be 0:");
    for (name, [x, v]) in [
        ("trilinear 65, exact transpose", exact),
        ("trilinear 65, smoothed diagonal", smoothed),
        ("tricubic 65", tricubic),
        ("closed form", closed),
    ] {
        println!("  {name}: {x:.1e} {v:.1e}");
    }
    assert!(exact[0] > 0.5, "the trap has gone: say so in the documentation");
    assert!(smoothed[0] < 2e-3 && smoothed[1] < 2e-3);
    assert!(tricubic[0] < 1e-4 && tricubic[1] < 1e-4);
    assert!(closed[0] < 1e-7 && closed[1] < 1e-7);
}

/// Luneburg's profile in `s = r²` as the polynomial through the zeros of Chebyshev's.
fn luneburg_polynomial(count: usize) -> Polynomial<f64> {
    let zero = |i: usize| 0.5 - 0.5 * (PI * (i as f64 + 0.5) / count as f64).cos();
    let nodes: Vec<f64> = (0..count).map(zero).collect();
    let mut divided: Vec<f64> = nodes.iter().map(|s| (2.0 - s).sqrt()).collect();
    for order in 1..count {
        for i in (order..count).rev() {
            divided[i] = (divided[i] - divided[i - 1]) / (nodes[i] - nodes[i - order]);
        }
    }
    // From Newton's form to powers of s.
    let mut coefficients = vec![0.0; count];
    for i in (0..count).rev() {
        for k in (1..count).rev() {
            coefficients[k] = coefficients[k - 1] - nodes[i] * coefficients[k];
        }
        coefficients[0] = divided[i] - nodes[i] * coefficients[0];
    }
    Polynomial { coefficients }
}

/// Luneburg's profile in `s = r²` as a cubic spline of so many cells, `f - h²/6 f''` at its knots.
fn luneburg_spline(cells: usize) -> BSpline<f64> {
    let h = 1.2 / cells as f64;
    let f = |i: i32| (2.0 - f64::from(i) * h).sqrt();
    let coefficient = |i: i32| f(i) - (f(i + 1) - 2.0 * f(i) + f(i - 1)) / 6.0;
    let coefficients = (-1..cells as i32 + 2).map(coefficient).collect();
    BSpline::new(0.0, 1.2, coefficients).unwrap()
}

#[test]
fn grin_no_smooth_luneburg_lens_moves_its_focus_with_the_start_of_a_ray() {
    let index = |p: Vec3<f64>| (2.0 - p.dot(p).min(1.9)).sqrt();
    let fields: [(&str, Box<dyn IndexField<f64>>); 4] = [
        ("closed form", Box::new(ProfileField::sphere(Luneburg::new(1.0)))),
        ("polynomial in r², 14 terms", Box::new(ProfileField::sphere(luneburg_polynomial(14)))),
        ("b-spline in r², 32 cells", Box::new(ProfileField::sphere(luneburg_spline(32)))),
        // Along the axes of a grid, where no error averages out: 65 nodes leave 1.7e-4.
        ("tricubic 97", Box::new(Tricubic::approximate(96, 1.1, index).unwrap())),
    ];
    let w = vec3([0.3, 1.0, -0.4]);
    let loss = |_: usize, exit: &RayExit<f64>| {
        (w.dot(exit.x), RayAdjoint { x: w, ..RayAdjoint::default() })
    };
    for (name, field) in fields {
        let setup = steps(Integrator::BlanesMoan, FRAC_PI_2 / 40.0, 40);
        let outcome =
            GrinTracer::new(&*field, setup).unwrap().loss_and_gradient(&onto_unit_ball(), loss);
        let worst = outcome.gradient.starts.iter().map(|start| length(start.x)).fold(0.0, f64::max);
        println!("{name}: |dL/dx0| at most {worst:.1e} of 40 rays");
        assert!(worst < 1e-4, "{name}: {worst:e}");
    }
}

#[test]
fn grin_a_ball_of_glass_refracts_as_snell_says() {
    let field = ProfileField::sphere(Polynomial { coefficients: vec![1.5] });
    let screen = Face::plane(vec3([0.0, 0.0, 1.0]), 3.0);
    let setup = until(Integrator::LeapfrogDkd, 0.05, GrinRegion::ball(1.0), LastStep::Fractional);
    let glass = GrinSetup { launch: LaunchMode::Refracted, screen: Some(screen), ..setup.clone() };
    for h in [0.0f64, 0.2, 0.5, 0.9] {
        let ray = GrinRay { x: vec3([h, 0.0, -4.0]), v: vec3([0.0, 0.0, 1.0]) };
        let exit = GrinTracer::new(&field, glass.clone()).unwrap().trace(&ray);
        // Two equal refractions about the centre: the deviation is 2 (α - β).
        let (alpha, beta) = (h.asin(), (h / 1.5).asin());
        let direction = -2.0 * (alpha - beta);
        let leaves = 2.0 * beta - alpha; // polar angle of the exit, seen from the far pole
        let (x, z) = (leaves.sin(), leaves.cos());
        let reach = (3.0 - z) / direction.cos();
        let path = (4.0 - alpha.cos()) + 1.5 * 2.0 * beta.cos() + reach;
        assert!((exit.x.x - (x + reach * direction.sin())).abs() < 1e-12, "{h}: {:?}", exit.x);
        assert!((exit.v.x - direction.sin()).abs() < 1e-12);
        assert!((exit.path - path).abs() < 1e-12, "{h}: {} {path}", exit.path);
    }
    // Without refraction the jump shows itself.
    let ray = GrinRay { x: vec3([0.2, 0.0, -4.0]), v: vec3([0.0, 0.0, 1.0]) };
    let exit = GrinTracer::new(&field, setup).unwrap().trace(&ray);
    assert!((exit.excess - (1.0 - 2.25)).abs() < 1e-12);
}
