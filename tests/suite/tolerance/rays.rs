//! Rays and merits of decentred, tilted and otherwise imperfect lenses.

use super::reference::{RAYS, ToleranceCase, assert_close, lenses, valued};
use crate::reference::{count, number, numbers};
use aplanat::lens::System;
use aplanat::math::Vec3;
use aplanat::tolerance::{Merits, merits, perturb};
use aplanat::trace::{Landings, TraceSink as _, Tracer};
use serde_json::Value;

#[test]
fn rays_of_the_nominal_lenses_are_exact() {
    for lens in lenses() {
        let tracer = Tracer::new(&lens.nominal().systems[lens.primary()]).unwrap();
        for (number, (field, pupil)) in RAYS.into_iter().enumerate() {
            let (ray, path) = lens.ray(field, pupil);
            let traced = tracer.trace(ray);
            let (p, d) = (traced.ray.point, traced.ray.direction);
            let found = [p.x, p.y, d.x, d.y, d.z, traced.opl + path];
            let expected = numbers(&lens.data["base"]["rays"][number]);
            let what = format!("{} ray {number}", lens.id());
            (0..5).for_each(|i| assert_close(found[i], expected[i], 1e-13, &what));
            assert_close(found[5], expected[5], 1e-12, &what);
        }
    }
}

/// Checks one ray; the largest distance of its points from those of the file, in mm.
fn check_hits(lens: &ToleranceCase, systems: &[System<f64>], data: &Value) -> f64 {
    let tracer = Tracer::new(&systems[count(&data["wavelength"])]).unwrap();
    let pupil = numbers(&data["pupil"]);
    let (ray, path) = lens.ray(count(&data["field"]), [pupil[0], pupil[1]]);
    let polyline = tracer.polyline(ray);
    let hits = data["hits"].as_array().unwrap();
    let mut worst: f64 = 0.0;
    for (found, expected) in polyline.points[1..].iter().zip(hits) {
        let expected = numbers(expected);
        let apart = *found - Vec3::new(expected[0], expected[1], expected[2]);
        worst = worst.max(apart.dot(apart).sqrt());
    }
    assert_eq!(polyline.points.len() - 1, hits.len());
    let traced = tracer.trace(ray);
    let direction = numbers(&data["dir"]);
    let d = traced.ray.direction;
    for (found, expected) in [d.x, d.y, d.z].into_iter().zip(direction) {
        assert_close(found, expected, 2e-14, lens.id());
    }
    assert_close(traced.opl + path, number(&data["opl"]), 2e-13, lens.id());
    worst
}

#[test]
fn rays_of_perturbed_lenses_are_exact() {
    for lens in lenses() {
        let mut worst: f64 = 0.0;
        for case in lens.data["cases"].as_array().unwrap() {
            let errors: Vec<_> =
                case["perturbations"].as_array().unwrap().iter().map(valued).collect();
            let systems = perturb(&lens.nominal(), &errors).unwrap();
            for ray in case["rays"].as_array().unwrap() {
                worst = worst.max(check_hits(&lens, &systems, ray));
            }
        }
        println!("{}: worst hit {worst:.1e} mm", lens.id());
        assert!(worst < 1e-13, "{}: {worst}", lens.id());
    }
}

/// Surfaces that are tilted, irregular or both are crossed in blocks, and ray by ray.
#[test]
fn rays_of_perturbed_lenses_in_batches_have_the_same_bits() {
    for lens in lenses() {
        for case in lens.data["cases"].as_array().unwrap() {
            let errors: Vec<_> =
                case["perturbations"].as_array().unwrap().iter().map(valued).collect();
            let systems = perturb(&lens.nominal(), &errors).unwrap();
            assert!(systems[0].has_poses());
            for colour in &lens.beam(5, 16).fields[1].colours {
                let tracer = Tracer::new(&systems[colour.wavelength]).unwrap();
                let mut landed = Landings::default();
                tracer.trace_batch(&colour.rays.iter().copied().collect(), &mut landed);
                for (i, ray) in colour.rays.iter().enumerate() {
                    let alone = tracer.trace(*ray);
                    assert_eq!(landed.fate(i), alone.fate);
                    assert!(alone.fate.is_imaged());
                    assert_eq!((landed.ray(i), landed.opl[i]), (alone.ray, alone.opl));
                }
            }
        }
    }
}

fn check_merits(found: &Merits<f64>, data: &Value, tolerance: f64, what: &str) -> f64 {
    let mut worst: f64 = 0.0;
    let mut check = |found: f64, expected: &Value| {
        let expected = number(expected);
        worst = worst.max((found / expected - 1.0).abs());
    };
    for (i, spot) in found.spots.iter().enumerate() {
        check(spot.a, &data["ms"][i]);
        check(spot.at(found.focus), &data["msc"][i]);
        check(found.wavefronts[i].chief, &data["vchief"][i]);
        check(found.wavefronts[i].tilt_removed, &data["vtilt"][i]);
    }
    assert!(worst < tolerance, "{what}: {worst:e}");
    worst
}

#[test]
fn merits_of_perturbed_lenses_are_exact() {
    for lens in lenses() {
        let phone = number(&lens.data["integral_error"]) > 1e-10;
        let (tolerance, rule) = if phone { (1e-7, (18, 36)) } else { (1e-10, (12, 28)) };
        let beam = lens.beam(rule.0, rule.1);
        let mut worst: f64 = 0.0;
        for case in lens.data["cases"].as_array().unwrap() {
            let errors: Vec<_> =
                case["perturbations"].as_array().unwrap().iter().map(valued).collect();
            let systems = perturb(&lens.nominal(), &errors).unwrap();
            let found = merits(&systems, &beam, lens.options()).unwrap();
            let name = case["name"].as_str().unwrap();
            worst = worst.max(check_merits(&found, &case["merits"], tolerance, name));
        }
        println!("{}: worst merit {worst:.1e}", lens.id());
    }
}
