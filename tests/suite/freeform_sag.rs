//! Every form against numbers that another program computed with 40 digits from the definitions.

use aplanat::lens::{Freeform, FreeformKind, Shape};
use aplanat::math::{Arithmetic, Interval};

/// The point of the numbers below, in mm.
const AT: [f64; 2] = [1.7, -2.6];

/// A form with one number 1 and zeros in front of it.
fn single(kind: FreeformKind, number: usize) -> Freeform<f64> {
    let mut numbers = vec![0.0; number + 1];
    numbers[number] = 1.0;
    Freeform { kind, numbers }
}

fn assert_near(name: &str, found: [f64; 3], expected: [f64; 3]) {
    for (found, expected) in found.into_iter().zip(expected) {
        let apart = (found - expected).abs();
        assert!(apart < 1e-14 * (1.0 + 20.0 * expected.abs()), "{name}: {found} {expected}");
    }
}

fn assert_series(kind: FreeformKind, number: usize, expected: [f64; 3]) {
    let form = single(kind, number);
    let found = form.series_sag(&form.base(&Shape::Plane), AT[0], AT[1], |a| a);
    assert_near(&format!("{} {number}", kind.name()), found, expected);
}

#[test]
fn zernike_polynomials_are_those_of_noll() {
    let all: [(usize, [f64; 3]); 10] = [
        (1, [1.0, 0.0, 0.0]),
        (2, [1.36, 0.8, 0.0]),
        (3, [-2.08, 0.0, 0.8]),
        (5, [-3.4645582921925273, -2.037975465995604, 1.3325224200740489]),
        (8, [5.062205730785741, 6.1166433628911205, -4.800632790289214]),
        (9, [-0.8989420224953332, -4.800632790289214, -2.101634490771409]),
        (11, [13.50499193399537, 15.239322034431847, -23.30719840560165]),
        (13, [-14.205376259593887, -18.08875441916578, 20.34883679271025]),
        (18, [-24.381590918383417, -27.40255356978758, 49.13736245385258]),
        (22, [51.92515456213493, 89.80608883621541, -137.35048880832943]),
    ];
    for (number, expected) in all {
        assert_series(FreeformKind::Zernike { radius: 2.5 }, number - 1, expected);
    }
}

#[test]
fn fringe_polynomials_are_one_at_the_rim() {
    let all: [(usize, [f64; 3]); 9] = [
        (2, [0.425, 0.25, 0.0]),
        (6, [-0.5525, -0.325, 0.2125]),
        (8, [0.12390625, -0.414375, 0.58609375]),
        (9, [-0.43619140625, 0.26296875, -0.4021875]),
        (11, [-0.07759375, -0.414375, -0.18140625]),
        (16, [-0.2874407958984375, -0.50190673828125, 0.7676220703125]),
        (17, [-0.246752734375, -0.461921875, 0.07759375]),
        (36, [0.31288817615389825, 0.352580637717247, -0.5392409753322601]),
        (37, [-0.06785198540673032, 0.8705846057216227, -1.3314823381624818]),
    ];
    for (number, expected) in all {
        assert_series(FreeformKind::FringeZernike { radius: 4.0 }, number - 1, expected);
    }
}

#[test]
fn products_of_powers_and_of_chebyshev_polynomials_are_in_their_order() {
    let chebyshev = FreeformKind::Chebyshev { half_widths: [2.0, 3.0] };
    let all: [(usize, [f64; 3]); 4] = [
        (0, [1.0, 0.0, 0.0]),
        (7, [-0.38566666666666666, -1.4733333333333334, 0.14833333333333332]),
        (9, [-0.003851851851851852, 0.0, 2.0044444444444443]),
        (30, [-0.4686813111111111, 0.8564144444444445, 1.0783817777777778]),
    ];
    for (number, expected) in all {
        assert_series(chebyshev, number, expected);
    }
    let (u, v) = (AT[0] / 2.0, AT[1] / 2.0);
    let powers = [(0, [1, 0]), (1, [0, 1]), (3, [1, 1]), (4, [0, 2]), (6, [2, 1]), (64, [0, 10])];
    for (number, [i, j]) in powers {
        let slope = |power: i32, t: f64| f64::from(power) * t.powi(power - 1) / 2.0;
        let expected = [
            u.powi(i) * v.powi(j),
            if i == 0 { 0.0 } else { slope(i, u) * v.powi(j) },
            if j == 0 { 0.0 } else { slope(j, v) * u.powi(i) },
        ];
        assert_series(FreeformKind::XyPolynomial { radius: 2.0 }, number, expected);
    }
}

#[test]
fn biconics_toroids_and_odd_powers_have_their_sag() {
    let conic = |curvature, conic| Shape::Conic { curvature, conic };
    let of = |kind, shape: &Shape<f64>, numbers: &[f64]| {
        let form = Freeform { kind, numbers: numbers.to_vec() };
        form.sag(&form.base(shape), AT[0], AT[1])
    };
    let found = of(FreeformKind::Biconic, &conic(-0.03, 1.4), &[0.05, -0.7]);
    let expected = [-0.02927324031515718, 0.08534046311587572, 0.07841301597963247];
    assert_near("biconic", found, expected);
    let found = of(FreeformKind::Toroid, &conic(0.04, -0.3), &[-0.06, 1e-3, -2e-5]);
    let expected = [0.05511080741888341, -0.10166383344321872, -0.1087475350740074];
    assert_near("toroid", found, expected);
    let found = of(FreeformKind::OddAsphere, &Shape::Plane, &[0.01, -0.002, 3e-4, 1e-5, -2e-6]);
    let expected = [0.021110272325419864, 0.0035719420592882356, -0.005462970208323184];
    assert_near("odd asphere", found, expected);
    // A cylinder with its axis along x, which no curvature in x bends.
    let found = of(FreeformKind::Toroid, &conic(0.1, 0.0), &[0.0]);
    assert!((found[0] - (10.0 - (100.0_f64 - 2.6 * 2.6).sqrt())).abs() < 1e-14);
    assert_eq!(found[1], 0.0);
}

/// A biconic and a toroid that are round are the conic itself, and so is a form without numbers.
#[test]
fn forms_that_are_round_are_conics() {
    let shape = Shape::Conic { curvature: 0.05, conic: 0.0 };
    let (z, slope) = shape.sag(AT[0] * AT[0] + AT[1] * AT[1]).unwrap();
    let expected = [z, 2.0 * AT[0] * slope, 2.0 * AT[1] * slope];
    for (kind, numbers) in [
        (FreeformKind::Biconic, vec![0.05, 0.0]),
        (FreeformKind::Toroid, vec![0.05]),
        (FreeformKind::OddAsphere, vec![]),
    ] {
        let form = Freeform { kind, numbers };
        assert_near(kind.name(), form.sag(&form.base(&shape), AT[0], AT[1]), expected);
    }
}

#[test]
fn curvatures_at_the_vertex_and_symmetries_are_known() {
    let shape = Shape::Conic { curvature: 0.02, conic: -0.4 };
    let curvatures = |kind, numbers: &[f64]| {
        Freeform { kind, numbers: numbers.to_vec() }.vertex_curvatures(&shape)
    };
    assert_eq!(curvatures(FreeformKind::OddAsphere, &[0.1, 0.03, 1.0]), [0.08, 0.08]);
    assert_eq!(curvatures(FreeformKind::Biconic, &[0.07, 9.0]), [0.07, 0.02]);
    assert_eq!(curvatures(FreeformKind::Toroid, &[0.07, 0.01]), [0.07, 0.04]);
    let xy = FreeformKind::XyPolynomial { radius: 2.0 };
    let [x, y] = curvatures(xy, &[0.0, 0.0, 0.02, 0.0, 0.04]);
    assert!((x - 0.03).abs() < 1e-16 && (y - 0.04).abs() < 1e-16);
    for (kind, even) in [
        (xy, vec![1, 2, 4, 6, 8]),
        (FreeformKind::Chebyshev { half_widths: [1.0; 2] }, vec![0, 2, 3, 5]),
        (FreeformKind::Zernike { radius: 1.0 }, vec![0, 2, 3, 5]),
        (FreeformKind::FringeZernike { radius: 1.0 }, vec![0, 2, 3, 4]),
    ] {
        for number in 0..6 {
            let form = single(kind, number);
            let base = form.base(&Shape::Plane);
            let at = |x: f64| form.series_sag(&base, x, 0.3, |a| a)[0];
            assert_eq!(
                (at(0.4) - at(-0.4)).abs() < 1e-15,
                form.mirrors_in_x(),
                "{kind:?} {number}"
            );
            assert!(form.mirrors_in_x() || !even.contains(&number), "{kind:?} {number}");
        }
    }
}

/// The gradient is the derivative of the sag, the bounds over a square contain it, and where a base
/// ends there is nothing.
#[test]
fn bounds_contain_every_sag_and_gradients_are_derivatives() {
    let radius = 5.0;
    let numbers: Vec<f64> = (0..30).map(|k| 0.03 / f64::from(k * k + 4)).collect();
    for kind in [
        FreeformKind::OddAsphere,
        FreeformKind::Biconic,
        FreeformKind::Toroid,
        FreeformKind::XyPolynomial { radius },
        FreeformKind::Zernike { radius },
        FreeformKind::FringeZernike { radius },
        FreeformKind::Chebyshev { half_widths: [5.0, 7.0] },
        FreeformKind::QCon { radius },
        FreeformKind::QBfs { radius },
    ] {
        let count = kind.counts()[1].min(numbers.len());
        // The same sag at 5 mm from every number.
        let scaled = |(k, a): (usize, &f64)| a * 5.0_f64.powi(kind.power(k) - 1);
        let numbers = numbers[..count].iter().enumerate().map(scaled).collect();
        let form = Freeform { kind, numbers };
        let base = form.base(&Shape::Conic { curvature: 0.03, conic: 0.2 });
        let bounds = {
            let base = base.map(Interval::constant);
            let (x, y) = (Interval::between(0.9, 1.1), Interval::between(-2.1, -2.0));
            let (a, b) = (base.sag(x, y), form.series_sag(&base, x, y, Interval::constant));
            [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
        };
        for i in 0..25 {
            let (x, y) = (0.9 + 0.05 * f64::from(i % 5), -2.1 + 0.025 * f64::from(i / 5));
            let sag = |x: f64, y: f64| form.sag(&base, x, y);
            let found = sag(x, y);
            assert!(bounds.iter().zip(found).all(|(bounds, value)| bounds.contains(value)));
            let h = 1e-5;
            let slopes = [
                (sag(x + h, y)[0] - sag(x - h, y)[0]) / (2.0 * h),
                (sag(x, y + h)[0] - sag(x, y - h)[0]) / (2.0 * h),
            ];
            for (found, expected) in found[1..].iter().zip(slopes) {
                assert!((found - expected).abs() < 1e-8, "{kind:?}: {found} {expected}");
            }
        }
        assert!(bounds.iter().all(|b| b.high - b.low < 3.0), "{kind:?}: {bounds:?}");
    }
    let sphere = Freeform { kind: FreeformKind::OddAsphere, numbers: vec![] };
    let base = sphere.base(&Shape::Sphere { curvature: 0.5 }).map(Interval::constant);
    assert!(base.sag(Interval::between(2.1, 3.0), Interval::constant(0.0))[0].is_empty());
}

#[test]
fn faults_are_named() {
    let fault = |kind, numbers: Vec<f64>| Freeform { kind, numbers }.fault();
    assert_eq!(fault(FreeformKind::OddAsphere, vec![1e9]), None);
    assert!(
        fault(FreeformKind::Biconic, vec![0.1]).unwrap().contains("1 numbers; expected 2 to 2")
    );
    let zernike = FreeformKind::Zernike { radius: 0.0 };
    assert!(fault(zernike, vec![]).unwrap().contains("normalised to 0 mm"));
    let wrong = fault(FreeformKind::OddAsphere, vec![0.0, f64::NAN]).unwrap();
    assert!(wrong.contains("number 2 of the odd asphere is NaN"), "{wrong}");
}

/// `Qₘ(u²)` of a kind, with u along x; `weight` is what it is multiplied by in the sag.
fn q(kind: FreeformKind, m: usize, u: f64, weight: f64) -> f64 {
    let form = single(kind, m);
    form.series_sag(&form.base(&Shape::Plane), 2.0 * u, 0.0, |a| a)[0] / weight
}

/// The first polynomials as Forbes prints them (Optics Express 15, 5218, 2007, eqs. 2.5 and 3.6).
#[test]
fn polynomials_of_forbes_are_those_that_he_prints() {
    for u in [0.3_f64, 0.77, 0.999] {
        let x = u * u;
        let strong = [
            1.0,
            -(5.0 - 6.0 * x),
            15.0 - 14.0 * x * (3.0 - 2.0 * x),
            -(35.0 - 12.0 * x * (14.0 - x * (21.0 - 10.0 * x))),
        ];
        let mild = [
            1.0,
            (13.0 - 16.0 * x) / 19.0_f64.sqrt(),
            (2.0_f64 / 95.0).sqrt() * (29.0 - 4.0 * x * (25.0 - 19.0 * x)),
            (2.0_f64 / 2545.0).sqrt() * (207.0 - 4.0 * x * (315.0 - x * (577.0 - 320.0 * x))),
        ];
        for (m, (strong, mild)) in strong.into_iter().zip(mild).enumerate() {
            let found = q(FreeformKind::QCon { radius: 2.0 }, m, u, x * x);
            assert!((found - strong).abs() < 1e-13, "{m} {u}: {found} {strong}");
            let found = q(FreeformKind::QBfs { radius: 2.0 }, m, u, x * (1.0 - x));
            assert!((found - mild).abs() < 1e-11, "{m} {u}: {found} {mild}");
        }
    }
}

/// Up to the highest order the slopes of the mild polynomials are orthonormal over the aperture with the
/// weight 1/√(1 − u²), and the strong polynomials are orthogonal with the weight u⁸ u (2007, eqs. 2.3 and
/// 3.4): Gauss's quadrature at the nodes of Chebyshev is exact for both.
#[test]
fn polynomials_of_forbes_are_orthogonal() {
    let count = 20_usize;
    let nodes = 200_u32;
    let angle = |i: u32| std::f64::consts::PI * (f64::from(i) + 0.5) / f64::from(2 * nodes);
    let (mild, strong) = (FreeformKind::QBfs { radius: 1.0 }, FreeformKind::QCon { radius: 1.0 });
    let table = |kind: FreeformKind, place: usize| -> Vec<Vec<f64>> {
        let all = Freeform { kind, numbers: vec![1.0; count] };
        let at = |i: u32| {
            let mut row = vec![0.0; count];
            let base = all.base(&Shape::Plane);
            all.visit_series(&base, angle(i).sin(), 0.0, |k, term: [f64; 3]| row[k] = term[place]);
            row
        };
        (0..nodes).map(at).collect()
    };
    let (slopes, values) = (table(mild, 1), table(strong, 0));
    let norm = |m: usize| 1.0 / (4.0 * (m as f64) + 10.0);
    let mut worst: [f64; 2] = [0.0; 2];
    for m in 0..count {
        for n in 0..=m {
            let mean = |of: &dyn Fn(u32) -> f64| (0..nodes).map(of).sum::<f64>() / f64::from(nodes);
            let found = mean(&|i| slopes[i as usize][m] * slopes[i as usize][n]);
            let expected = if m == n { 1.0 } else { 0.0 };
            worst[0] = worst[0].max((found - expected).abs());
            // ∫ (u⁴ Qₘ)(u⁴ Qₙ) u du with du = cos θ dθ.
            let found = std::f64::consts::FRAC_PI_2
                * mean(&|i| {
                    let row = &values[i as usize];
                    row[m] * row[n] * angle(i).sin() * angle(i).cos()
                });
            let expected = if m == n { norm(m) } else { 0.0 };
            worst[1] = worst[1].max((found - expected).abs());
        }
    }
    println!("{worst:?}");
    assert!(worst[0] < 1e-11, "{worst:?}");
    assert!(worst[1] < 1e-5, "{worst:?}");
}
