//! Every field: its derivatives against forward differentiation of its value, its block methods
//! against its single ones, and its values outside the domain.

use super::{Kind, vec3};
use crate::grin::kinds;
use aplanat::grin::field::{
    GridError, HessianDiagonal, IndexSamples, Luneburg, Maxwell, Parabolic, Polynomial,
    ProfileField, RegularGrid, Sech, Tricubic, Trilinear,
};
use aplanat::grin::{IndexField, LANES, LaneVectors};
use aplanat::math::{Dual, Vec3};

/// Points inside every field, none on a face of a voxel.
fn points() -> Vec<Vec3<f64>> {
    let at = |i: usize, p: f64| ((i as f64 + 1.0) * p).fract() * 1.5 - 0.75;
    (0..LANES).map(|i| vec3([at(i, 0.618034), at(i, 0.754878), at(i, 0.569840)])).collect()
}

fn close(got: f64, exact: f64, what: &str) {
    assert!((got - exact).abs() <= 2e-12 * exact.abs().max(1.0), "{what}: {got} for {exact}");
}

#[test]
fn grin_gradients_and_hessians_are_the_derivatives_of_the_index() {
    type Slopes = Dual<f64, 3>;
    for kind in kinds() {
        let plain = kind.field::<f64>(|_, value| value);
        let carried = kind.field::<Slopes>(|_, value| Slopes::constant(value));
        for p in points() {
            let at = Vec3::new(
                Slopes::variable(p.x, 0),
                Slopes::variable(p.y, 1),
                Slopes::variable(p.z, 2),
            );
            let (sample, hessian) = (plain.sample(p), plain.hessian(p));
            let exact = carried.sample(at);
            close(sample.index, exact.index.value, kind.name);
            let g = [sample.gradient.x, sample.gradient.y, sample.gradient.z];
            let dg = [exact.gradient.x, exact.gradient.y, exact.gradient.z];
            let axes = [vec3([1.0, 0.0, 0.0]), vec3([0.0, 1.0, 0.0]), vec3([0.0, 0.0, 1.0])];
            for i in 0..3 {
                close(g[i], exact.index.slope[i], kind.name);
                let row = hessian.times(axes[i]);
                for (j, got) in [row.x, row.y, row.z].into_iter().enumerate() {
                    close(got, dg[i].slope[j], kind.name);
                }
            }
        }
    }
}

#[test]
fn grin_accumulation_is_the_transpose_of_the_parameter_derivative() {
    type Slope = Dual<f64, 1>;
    for kind in kinds() {
        let plain = kind.field::<f64>(|_, value| value);
        for (n, p) in points().into_iter().enumerate() {
            let (weight, pull) = (0.7, vec3([0.3, -0.5, 0.2]));
            let mut gradient = vec![0.0; plain.parameters().len()];
            plain.accumulate(p, weight, pull, &mut gradient);
            let direction = |i: usize| ((i + n) as f64 * 0.618034).fract() - 0.4;
            let moved = kind.field::<Slope>(|i, value| Slope { value, slope: [direction(i)] });
            let exact = moved.sample(Vec3::from_f64(p));
            let slope = |r: Slope| r.slope[0];
            let g = exact.gradient;
            let exact =
                weight * slope(exact.index) + vec3([slope(g.x), slope(g.y), slope(g.z)]).dot(pull);
            let got: f64 = gradient.iter().enumerate().map(|(i, g)| g * direction(i)).sum();
            close(got, exact, kind.name);
        }
    }
}

#[test]
fn grin_blocks_give_the_bits_of_single_points() {
    for kind in kinds() {
        for diagonal in [HessianDiagonal::Exact, HessianDiagonal::Smoothed] {
            let field = Kind { diagonal, ..kind }.field::<f64>(|_, value| value);
            // Some of them outside.
            let points: Vec<_> = points().iter().map(|p| *p * 1.6).collect();
            let columns = |f: &dyn Fn(usize) -> Vec3<f64>| {
                let mut c = LaneVectors::default();
                for lane in 0..LANES {
                    (c.x[lane], c.y[lane], c.z[lane]) = (f(lane).x, f(lane).y, f(lane).z);
                }
                c
            };
            let at = columns(&|lane| points[lane]);
            let times = columns(&|lane| vec3([0.1 * lane as f64, 1.0, -0.3]));
            let weight: [f64; LANES] = std::array::from_fn(|lane| 1.0 - 0.1 * lane as f64);
            let (mut samples, mut again) = (IndexSamples::default(), IndexSamples::default());
            let mut product = LaneVectors::default();
            field.sample_block(&at, &mut samples);
            field.sample_block_with_hessians(&at, &times, &mut again, &mut product);
            let mut deposits = vec![0.0; field.parameters().len()];
            let mut single = deposits.clone();
            field.accumulate_block(&at, &weight, &times, &mut deposits);
            for (lane, p) in points.iter().enumerate() {
                let sample = field.sample(*p);
                let bent = field.hessian(*p).times(vec3([0.1 * lane as f64, 1.0, -0.3]));
                for block in [&samples, &again] {
                    assert_eq!(block.index[lane], sample.index, "{}", kind.name);
                    assert_eq!(block.gradient.y[lane], sample.gradient.y, "{}", kind.name);
                }
                assert_eq!(product.z[lane], bent.z, "{}", kind.name);
                let pull = vec3([times.x[lane], times.y[lane], times.z[lane]]);
                field.accumulate(*p, weight[lane], pull, &mut single);
            }
            assert_eq!(deposits, single, "{}", kind.name);
        }
    }
}

#[test]
fn grin_the_smoothed_diagonal_is_exact_for_a_quadratic_up_to_the_rim() {
    let f = |p: Vec3<f64>| 1.2 + 0.3 * p.x * p.x - 0.2 * p.y * p.y + 0.1 * p.z * p.z + p.x * p.y;
    for counts in [[3, 4, 5], [9, 3, 6]] {
        let grid = RegularGrid::new(counts, vec3([-1.0; 3]), vec3([0.31, 0.5, 0.4])).unwrap();
        let field = Trilinear::from_function(grid, f).unwrap();
        for p in points() {
            let d = field.hessian(p).diagonal;
            close(d.x, 0.6, "along x");
            close(d.y, -0.4, "along y");
            close(d.z, 0.2, "along z");
        }
    }
    let flat = Trilinear::from_function(RegularGrid::cube(2, 1.0).unwrap(), f).unwrap();
    assert!(flat.hessian(vec3([0.1, 0.2, 0.3])).diagonal.x.abs() < 1e-14);
}

#[test]
fn grin_lenses_have_their_textbook_indices() {
    let at = |r: f64| vec3([0.6 * r, 0.0, 0.8 * r]);
    let luneburg = ProfileField::sphere(Luneburg::new(2.0));
    close(luneburg.sample(at(0.0)).index, 2f64.sqrt(), "luneburg centre");
    close(luneburg.sample(at(2.0)).index, 1.0, "luneburg rim");
    let maxwell = ProfileField::sphere(Maxwell::new(2.0, 3.0));
    close(maxwell.sample(at(3.0)).index, 1.0, "maxwell rim");
    let parabolic = ProfileField::cylinder(Parabolic::new(1.5, 0.5));
    let r = vec3([0.3, 0.4, 7.0]);
    close(parabolic.sample(r).index, 1.5 * (1.0 - 0.25 * 0.25f64).sqrt(), "parabolic");
    let sech = ProfileField::cylinder(Sech::new(1.6, 2.0));
    for r in [0.0f64, 1e-9, 0.1, 1.0, 3.0] {
        let exact = 1.6 / (2.0 * r).cosh();
        close(sech.sample(vec3([0.0, r, 1.0])).index, exact, "sech");
    }
}

#[test]
fn grin_tricubic_interpolation_converges_with_fourth_order() {
    let f = |p: Vec3<f64>| 1.5 / (1.0 + 0.4 * p.dot(p));
    let worst = |cells: usize| {
        let field = Tricubic::approximate(cells, 1.0, f).unwrap();
        let error = |p: &Vec3<f64>| (field.sample(*p).index - f(*p)).abs();
        points().iter().map(error).fold(0.0, f64::max)
    };
    let (coarse, fine) = (worst(8), worst(32));
    assert!(fine < 1e-5 && coarse / fine > 200.0, "{coarse:e} {fine:e}");
}

#[test]
fn grin_empty_volumes_are_refused_and_one_voxel_suffices() {
    let low = vec3([0.0; 3]);
    let grid = |n| RegularGrid::new([n, 2, 2], low, vec3([1.0; 3])).unwrap();
    let few = |found| GridError::TooFew { axis: 'x', found, least: 2 };
    assert_eq!(Trilinear::<f64>::new(grid(0), vec![]).unwrap_err(), few(0));
    assert_eq!(Trilinear::new(grid(1), vec![1.0; 4]).unwrap_err(), few(1));
    let wrong = GridError::Values { found: 7, expected: 8 };
    assert_eq!(Trilinear::new(grid(2), vec![1.0; 7]).unwrap_err(), wrong);
    let mut values = vec![1.0; 8];
    values[5] = f64::NAN;
    let nan = GridError::NotANumber { node: 5 };
    assert_eq!(Trilinear::new(grid(2), values).unwrap_err(), nan);
    let flat = RegularGrid::new([2; 3], low, vec3([1.0, 0.0, 1.0])).unwrap_err();
    assert_eq!(flat, GridError::Extent { axis: 'y' });
    assert!(RegularGrid::cube(1, 1.0).is_err() && Tricubic::approximate(0, 1.0, |_| 1.0).is_err());
    let one = Trilinear::new(grid(2), vec![1.5; 8]).unwrap();
    assert_eq!(one.sample(vec3([0.3, 0.9, 0.1])).index, 1.5);
}

#[test]
fn grin_every_field_is_finite_far_away() {
    for kind in kinds() {
        let field = kind.field::<f64>(|_, value| value);
        for p in [[1e3, -1e3, 1e3], [1e200, 0.0, 0.0], [f64::NAN; 3], [f64::INFINITY; 3]] {
            let sample = field.sample(vec3(p));
            let _ = field.hessian(vec3(p));
            field.accumulate(vec3(p), 1.0, vec3(p), &mut vec![0.0; field.parameters().len()]);
            assert!(p[0] != 1e3 || sample.index.is_finite(), "{}", kind.name);
        }
    }
    let constant = ProfileField::axial(Polynomial { coefficients: vec![1.5] });
    assert_eq!(constant.sample(vec3([0.0, 0.0, 9.0])).gradient, Vec3::default());
}
