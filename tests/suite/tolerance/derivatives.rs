//! First and second derivatives by errors of making.

use super::reference::{RAYS, ToleranceCase, assert_close, lenses, perturbation};
use crate::reference::{number, numbers};
use aplanat::math::Dual;
use aplanat::tolerance::{Derivatives, Jet2, perturb, sensitivities};
use aplanat::trace::Tracer;
use serde_json::Value;

/// Checks a pair of derivatives: the first one relative to the larger of itself and
/// `√|value × second|`.
fn check(found: Derivatives, pair: &Value, tolerance: [f64; 2], what: &str) {
    check_difference(found, found, pair, tolerance, what);
}

/// As [`check`], for a merit that is a difference of terms, of which one is `part`: where they
/// cancel, their rounding remains.
fn check_difference(
    found: Derivatives,
    part: Derivatives,
    pair: &Value,
    [first, second]: [f64; 2],
    what: &str,
) {
    let expected = numbers(pair);
    let scale = expected[0].abs().max((found.value * expected[1]).abs().sqrt());
    // What symmetry makes 0 is rounding.
    let floor = 1e-12 * found.value;
    let rounding = 16.0 * f64::EPSILON;
    let by_first = first * scale + floor + rounding * part.first.abs();
    let by_second = second * expected[1].abs() + floor + rounding * part.second.abs();
    assert_close(found.first, expected[0], by_first, &format!("{what}, first"));
    assert_close(found.second, expected[1], by_second, &format!("{what}, second"));
}

fn name(error: &Value) -> String {
    format!("{} {} {}", error["kind"], error["first"], error["last"])
}

/// Every error of the file, by the derivatives of four rays.
#[test]
fn derivatives_of_rays_are_exact() {
    for lens in lenses() {
        for error in lens.data["derivatives"].as_array().unwrap() {
            let variable = Jet2::variable(Dual::variable(0.0, 0), 0);
            let systems = perturb(&lens.nominal(), &[(perturbation(error), variable)]).unwrap();
            let tracer = Tracer::new(&systems[lens.primary()]).unwrap();
            for (number, (field, pupil)) in RAYS.into_iter().enumerate() {
                let (ray, _) = lens.ray(field, pupil);
                let traced = tracer.trace(ray.cast());
                let (p, d) = (traced.ray.point, traced.ray.direction);
                let found = [p.x, p.y, d.x, d.y, d.z, traced.opl];
                let what = format!("{} {} ray {number}", lens.id(), name(error));
                check_ray(&found.map(Derivatives::from), &error["rays"][number], &what);
            }
        }
    }
}

/// Checks the derivatives of all numbers of a ray, relative to the largest of them.
fn check_ray(found: &[Derivatives; 6], pairs: &Value, what: &str) {
    let pairs: Vec<Vec<f64>> = (0..6).map(|i| numbers(&pairs[i])).collect();
    let largest = |i: usize| pairs.iter().fold(0.0, |m: f64, pair| m.max(pair[i].abs()));
    let (first, second) = (largest(0), largest(1));
    for (found, pair) in found.iter().zip(&pairs) {
        assert_close(found.first, pair[0], 1e-10 * first + 1e-12, what);
        assert_close(found.second, pair[1], 1e-8 * second.max(first) + 1e-9, what);
    }
}

/// Checks the merits of every `step`th error, from `start` on.
fn check_merits(lens: &ToleranceCase, start: usize, step: usize, rule: (usize, usize)) {
    let data = lens.data["derivatives"].as_array().unwrap();
    let chosen: Vec<&Value> = data.iter().skip(start).step_by(step).collect();
    let errors: Vec<_> = chosen.iter().map(|error| perturbation(error)).collect();
    let beam = lens.beam(rule.0, rule.1);
    let found = sensitivities(&lens.nominal(), &beam, lens.options(), &errors).unwrap();
    let floor = 100.0 * number(&lens.data["integral_error"]);
    let tolerance = [floor.max(1e-9), floor.max(1e-7)];
    for (found, error) in found.iter().zip(chosen) {
        let what = format!("{} {}", lens.id(), name(error));
        check(found.mean_square(), &error["mean"], tolerance, &what);
        let fixed = found.mean_square();
        let focused = found.mean_square_focused();
        check_difference(focused, fixed, &error["mean_focused"], tolerance, &what);
        let merits = &found.merits;
        for (i, spot) in merits.spots.iter().enumerate() {
            check(spot.a.into(), &error["mean_square"][i], tolerance, &what);
            let focused = spot.at(merits.focus).into();
            let expected = &error["mean_square_focused"][i];
            check_difference(focused, spot.a.into(), expected, tolerance, &what);
            let waves = merits.wavefronts[i];
            check(waves.chief.into(), &error["wavefront_variance_chief"][i], tolerance, &what);
            let tilt = &error["wavefront_variance_tilt_removed"][i];
            check(waves.tilt_removed.into(), tilt, tolerance, &what);
        }
    }
}

#[test]
fn derivatives_of_merits_are_exact() {
    for (lens, rule) in lenses().iter().zip([(8, 16), (8, 20), (14, 28)]) {
        check_merits(lens, 1, 61, rule);
    }
}

#[test]
fn derivatives_of_merits_by_every_error_are_exact() {
    for (lens, rule) in lenses().iter().zip([(10, 24), (10, 28), (18, 36)]) {
        check_merits(lens, 0, 1, rule);
    }
}
