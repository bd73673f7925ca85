//! The warp field against exact derivatives, and the cases in which it must stay finite.

use super::{Case, GROUPS, cases, exact, group};
use aplanat::lens::{Aperture, FieldKind, FieldPoint, Object, Shape, Surface, System};
use aplanat::paraxial::Beam;
use aplanat::pupil::{
    Aiming, PupilDerivative, QuadraticIntegrand, RayModel, Region, RegionKind, WarpSampling,
};
use aplanat::trace::SystemGradient;
use serde_json::Value;

/// A Student t of seven degrees of freedom (eight replicates) is beyond this once in 270 000; there
/// are about 250 numbers, most of which hang together.
const FARTHEST: f64 = 12.0;
/// Once in fifty it is beyond three standard errors; the numbers of one pupil are all beyond if one
/// is, so that a few times as many are let pass.
const BEYOND: f64 = 0.06;

/// Estimate, standard error and exact value of every number of a group.
fn compare(found: &PupilDerivative, expected: &Value, name: &str) -> Vec<[f64; 3]> {
    let (by, error) = (group(&found.gradient, name), group(&found.error, name));
    let each = by.into_iter().zip(error).zip(exact(expected, name));
    each.filter_map(|((by, error), exact)| Some([by, error, exact?])).collect()
}

fn objectives(case: &Case) -> [(&'static str, (QuadraticIntegrand, &Value)); 2] {
    [("spot", case.spot()), ("throughput", case.throughput())]
}

fn norm(numbers: impl Iterator<Item = f64>) -> f64 {
    numbers.map(|v| v * v).sum::<f64>().sqrt()
}

/// By how many standard errors an estimate is off; zero for what is exactly zero.
fn errors_off([found, error, exact]: [f64; 3]) -> f64 {
    if found == exact { 0.0 } else { (found - exact).abs() / error }
}

#[test]
fn aperture_gradients_by_the_warp_field_are_within_their_standard_errors() {
    let (mut numbers, mut beyond, mut farthest) = (0, 0, 0.0_f64);
    for case in cases() {
        let model = case.model();
        let region = Region::new(case.launch(&model));
        for (seed, (what, (cost, expected))) in objectives(&case).into_iter().enumerate() {
            let sampling = WarpSampling { count: 8192, seed: seed as u32 + 1 };
            let found = region.warp_derivative(&cost, sampling).unwrap();
            for name in GROUPS {
                let rows = compare(&found, expected, name);
                let off = norm(rows.iter().map(|r| r[0] - r[2]));
                let share = off / norm(rows.iter().map(|r| r[2]));
                let most = rows.iter().map(|r| errors_off(*r)).fold(0.0, f64::max);
                println!("{} {what} {name}: {share:.1e}, {most:.1} standard errors", case.name());
                numbers += rows.len();
                beyond += rows.iter().filter(|r| !(errors_off(**r) <= 3.0)).count();
                farthest = farthest.max(most);
            }
        }
    }
    println!("{beyond} of {numbers} beyond 3 standard errors, the farthest {farthest:.1}");
    assert!(beyond as f64 <= BEYOND * numbers as f64, "{beyond} of {numbers}");
    assert!(farthest <= FARTHEST, "{farthest}");
}

/// Estimates from this many seeds tell a bias of an eighth of their spread.
const SEEDS: u32 = 64;
/// A Student t of 63 degrees of freedom is beyond this once in a hundred million.
const BIASED: f64 = 6.5;

#[test]
fn aperture_gradients_by_the_warp_field_have_no_bias() {
    let mut farthest = (0.0_f64, String::new());
    for case in cases() {
        let model = case.model();
        let region = Region::new(case.launch(&model));
        for (what, (cost, expected)) in objectives(&case) {
            let estimates: Vec<PupilDerivative> = (0..SEEDS)
                .map(|seed| {
                    region.warp_derivative(&cost, WarpSampling { count: 256, seed }).unwrap()
                })
                .collect();
            for name in GROUPS {
                let columns: Vec<_> =
                    estimates.iter().map(|e| compare(e, expected, name)).collect();
                let mine = format!("{name} of {what} of {}", case.name());
                farthest = farther(farthest, (farthest_of(&columns), mine));
            }
        }
    }
    let (off, place) = farthest;
    println!("mean of {SEEDS}: {off:.2} standard errors off at most, in {place}");
    assert!(off <= BIASED, "{off} in {place}");
}

/// The largest deviation of the mean of some estimates, in standard errors; the first of three
/// numbers is the estimate, the last the exact one.
fn farthest_of(columns: &[Vec<[f64; 3]>]) -> f64 {
    let off = |i: usize| {
        let each = || columns.iter().map(|rows| rows[i][0]);
        let count = columns.len() as f64;
        let mean = each().sum::<f64>() / count;
        let spread = norm(each().map(|v| v - mean)) / (count * (count - 1.0)).sqrt();
        errors_off([mean, spread, columns[0][i][2]])
    };
    (0..columns[0].len()).map(off).fold(0.0, |a, b| if b <= a { a } else { b })
}

/// The one that is farther off; a number that is not one is.
fn farther(a: (f64, String), b: (f64, String)) -> (f64, String) {
    if b.0 <= a.0 { a } else { b }
}

fn bits(found: &PupilDerivative) -> Vec<u64> {
    found.gradient.numbers().chain(found.error.numbers()).map(f64::to_bits).collect()
}

#[test]
fn aperture_gradients_by_the_warp_field_do_not_depend_on_threads() {
    let case = &cases()[2];
    let model = case.model();
    let region = Region::new(case.launch(&model));
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let sampling = WarpSampling { count: 8 * 5000, seed: 3 };
        bits(&pool.install(|| region.warp_derivative(&case.spot().0, sampling)).unwrap())
    };
    assert!(on(1) == on(2));
}

#[test]
fn aperture_gradients_by_the_warp_field_hold_in_single_precision() {
    for case in cases() {
        let model = case.model();
        let region = Region::new(case.launch(&model));
        for (what, (cost, _)) in objectives(&case) {
            let sampling = WarpSampling { count: 2048, seed: 5 };
            let double = region.warp_derivative(&cost, sampling).unwrap();
            let single = region.warp_derivative_in::<f32>(&cost, sampling).unwrap();
            assert!(single.gradient.numbers().all(f64::is_finite), "{}", case.name());
            for name in GROUPS {
                let (a, b) = (group(&double.gradient, name), group(&single.gradient, name));
                let off = norm(a.iter().zip(&b).map(|(a, b)| a - b));
                let error = norm(group(&double.error, name).into_iter());
                // What is exactly zero is rounding in both.
                let rounding = 1e-6 * norm(double.gradient.numbers());
                assert!(off <= error + rounding, "{} {what} {name}: {off} {error}", case.name());
            }
        }
    }
}

fn model(system: System<f64>, aperture: Aperture, edge: f64, aiming: Aiming) -> RayModel {
    let beam = Beam { object: Object::Infinity, aperture, field: FieldKind::Angle, edge };
    RayModel::from_systems(vec![(0.5876, 1.0, system)], 0, beam, aiming).unwrap()
}

fn region(model: &RayModel) -> Region<'_> {
    let field = FieldPoint { x: 0.0, y: model.beam.edge, weight: 1.0 };
    Region::new(model.launch(field, 0).unwrap())
}

#[test]
fn aperture_gradients_of_a_fixed_disc_have_no_edge_motion() {
    // Nothing clips: all of the derivative is that of fixed rays.
    let mut system = cases()[3].system();
    system.surfaces.iter_mut().for_each(|surface| surface.semi_diameter = f64::INFINITY);
    let model = model(system, Aperture::EntrancePupilDiameter(12.0), 3.0, Aiming::Paraxial);
    let region = region(&model);
    assert_eq!(region.kind, RegionKind::Clear);
    for cost in [QuadraticIntegrand::spread([0.0, 2.3]), QuadraticIntegrand::throughput()] {
        let found = region.warp_derivative(&cost, WarpSampling { count: 8192, seed: 2 }).unwrap();
        let exact = region.trace_pupil(8).biased_derivative(&cost);
        let rows = found.gradient.numbers().zip(found.error.numbers()).zip(exact.numbers());
        for ((by, error), exact) in rows {
            assert!((by - exact).abs() <= 6.0 * error + 1e-9 * exact.abs(), "{by} {error} {exact}");
        }
    }
}

#[test]
fn the_rays_of_the_warp_field_are_counted() {
    let case = &cases()[1];
    let model = case.model();
    let region = Region::new(case.launch(&model));
    let rays = |count: usize| {
        let sampling = WarpSampling { count, seed: 3 };
        region.warp_derivative(&case.throughput().0, sampling).unwrap().rays
    };
    // As many as were asked for, after those that searched for the edge.
    assert_eq!([rays(64), rays(256)], [64, 256].map(|count| region.rays + count));
}

#[test]
fn aperture_gradients_of_rays_aimed_at_the_stop_move_with_its_rim() {
    for case in [&cases()[1], &cases()[4]] {
        let plain = case.model();
        let system = plain.channels[0].system.clone();
        let model = model(system, plain.beam.aperture, plain.beam.edge, Aiming::Stop);
        let (cost, expected) = case.throughput();
        let found =
            region(&model).warp_derivative(&cost, WarpSampling { count: 8192, seed: 4 }).unwrap();
        for name in GROUPS {
            for row in compare(&found, expected, name) {
                assert!(errors_off(row) <= FARTHEST, "{name} {row:?}");
            }
        }
    }
}

#[test]
fn aperture_gradients_scale_with_the_lens() {
    let case = &cases()[4];
    let found = |scale: f64| {
        let mut system = case.system();
        for surface in &mut system.surfaces {
            surface.shape = match surface.shape {
                Shape::Sphere { curvature } => Shape::Sphere { curvature: curvature / scale },
                shape => shape,
            };
            surface.thickness *= scale;
            surface.semi_diameter *= scale;
        }
        let model = case.model_of(system);
        let launch = case.launch(&model);
        let cost = QuadraticIntegrand {
            center: [0.0, case.number("centroid_y") * scale],
            ..case.spot().0
        };
        Region::new(launch).warp_derivative(&cost, WarpSampling { count: 1024, seed: 1 }).unwrap()
    };
    let unit = found(1.0);
    for scale in [1e-50, 1e-20, 1e-3, 1e20, 1e50] {
        let scaled = found(scale);
        for (name, powers) in [("curvature", 5), ("thickness", 3), ("semi_diameter", 3)] {
            for (of, with) in [(&unit.gradient, &scaled.gradient), (&unit.error, &scaled.error)] {
                let (a, b) = (group(of, name), group(with, name));
                let size = norm(a.iter().copied());
                for (a, b) in a.iter().zip(b) {
                    let b = (0..powers).fold(b, |b, _| b / scale);
                    assert!((a - b).abs() <= 1e-6 * size, "{scale:e} {name}: {a} {b}");
                }
            }
        }
    }
}

#[test]
fn aperture_gradients_move_the_shadow_of_an_obstruction() {
    // What is left of the light is all of it without that inside a rim of the same size, which does
    // not count as a rim.
    let case = &cases()[4];
    let changed = |change: fn(&mut Surface<f64>)| {
        let mut system = case.system();
        change(&mut system.surfaces[0]);
        case.model_of(system)
    };
    let obstructed = changed(|surface| surface.obstruction = 3.0);
    let models = [case.model(), changed(|surface| surface.semi_diameter = 3.0)];
    for cost in [case.spot().0, case.throughput().0] {
        let region = Region::new(case.launch(&obstructed));
        let found = region.warp_derivative(&cost, WarpSampling { count: 8192, seed: 6 }).unwrap();
        let [mut exact, shadow] = [0, 1].map(|i| {
            let region = Region::new(case.launch(&models[i]));
            region.trace_pupil(10).boundary_derivative(&cost).unwrap()
        });
        let rim = exact.surfaces[0].semi_diameter;
        exact.add(&shadow, -1.0);
        exact.surfaces[0].semi_diameter = rim;
        for name in GROUPS {
            let (by, error) = (group(&found.gradient, name), group(&found.error, name));
            for (i, exact) in group(&exact, name).into_iter().enumerate() {
                let off = (by[i] - exact).abs();
                println!("{name} {i}: {} {exact}, {:.1} errors", by[i], off / error[i]);
                assert!(off <= FARTHEST * error[i] + 1e-9, "{name} {i}: {} {exact}", by[i]);
            }
        }
    }
}

/// Curvature, thickness, index behind, semi-diameter of each surface, and a plane image.
fn system(rows: &[(f64, f64, f64, f64)]) -> System<f64> {
    let surface = |&(curvature, thickness, index, semi_diameter): &(f64, f64, f64, f64)| {
        let shape = Shape::simplest(curvature, 0.0, [0.0; 7]);
        Surface { shape, thickness, index, semi_diameter, ..Surface::plane(0.0, 1.0) }
    };
    let surfaces = rows.iter().map(surface).chain([Surface::plane(0.0, 1.0)]).collect();
    System { index_before: 1.0, surfaces, stop: Some(0) }
}

fn all_finite(gradient: &SystemGradient<f64>) -> bool {
    gradient.numbers().all(f64::is_finite)
}

#[test]
fn aperture_gradients_by_the_warp_field_are_finite_in_hard_cases() {
    use Aperture::{EntrancePupilDiameter as Beam, StopSemiDiameter as Stop};
    type Hard = (&'static str, &'static [(f64, f64, f64, f64)], Aperture, f64);
    let hard: [Hard; 8] = [
        ("a plane plate", &[(0.0, 5.0, 1.5, 5.0), (0.0, 9.0, 1.0, 6.0)], Stop(5.0), 0.0),
        ("equal indices", &[(0.02, 5.0, 1.0, 5.0), (0.0, 9.0, 1.0, 6.0)], Stop(5.0), 8.0),
        ("a ball", &[(0.1, 20.0, 1.5, 10.0), (-0.1, 5.0, 1.0, 10.0)], Stop(10.0), 0.0),
        ("rims beyond a ball", &[(0.1, 20.0, 1.5, 12.0), (-0.1, 5.0, 1.0, 15.0)], Stop(12.0), 3.0),
        ("grazing", &[(0.0, 5.0, 1.0, 9.0), (0.12, 3.0, 1.7, 30.0)], Stop(9.0), 20.0),
        ("no light", &[(0.01, 5.0, 1.5, 5.0), (0.0, 9.0, 1.0, 0.0)], Stop(5.0), 0.0),
        (
            "two pieces",
            &[(0.02, 8.0, 1.5, 14.0), (-0.02, 44.4, 1.0, 14.0), (0.0, 5.0, 1.0, 0.12)],
            Beam(26.0),
            0.0,
        ),
        (
            "no star",
            &[(0.02, 8.0, 1.5, 14.0), (-0.02, 44.4, 1.0, 14.0), (0.0, 5.0, 1.0, 0.3)],
            Beam(26.0),
            0.1,
        ),
    ];
    for (name, rows, aperture, edge) in hard {
        let model = model(system(rows), aperture, edge, Aiming::Paraxial);
        let region = region(&model);
        for cost in [QuadraticIntegrand::spread([0.0; 2]), QuadraticIntegrand::throughput()] {
            let sampling = WarpSampling { count: 4096, seed: 9 };
            let double = region.warp_derivative(&cost, sampling);
            let single = region.warp_derivative_in::<f32>(&cost, sampling);
            assert_eq!(double.is_none(), name == "no light", "{name} {:?}", region.kind);
            for found in [double, single].into_iter().flatten() {
                assert!(all_finite(&found.gradient) && all_finite(&found.error), "{name}");
            }
        }
    }
}
