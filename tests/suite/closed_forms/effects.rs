//! The decisions about effects, from measurements that are known in advance.

use super::{FOCAL, assert_near, lens, row};
use crate::merit::bundled;
use aplanat::effects::{
    Effect, EffectMeasurements, EffectOverrides, TracePurpose, measure_effects, plan,
};
use aplanat::files;
use aplanat::lens::{Aperture, Lens, Medium, Row};
use aplanat::measure::EffectTask;
use std::process::Command;
use std::time::Instant;

/// A paraboloid mirror, its own stop, with the image plane `defocus` behind its focus.
fn mirror(defocus: f64, fields: &[f64]) -> Lens {
    let mirror = Row {
        conic: -1.0,
        stop: true,
        medium: Medium::Mirror,
        ..row(-0.5 / FOCAL, -FOCAL - defocus, 1.0)
    };
    lens(vec![mirror], Aperture::EntrancePupilDiameter(20.0), fields)
}

fn measured(aspheres: &[(usize, f64)], smallest_spot: f64) -> EffectMeasurements {
    let measured = measure_effects(&mirror(0.1, &[0.0]), 0).unwrap();
    EffectMeasurements { aspheres: aspheres.to_vec(), smallest_spot, surfaces: 10, ..measured }
}

#[test]
fn the_smallest_spot_is_that_of_the_sharpest_field() {
    // Coma grows with the field; on the axis there is defocus alone: δ R/(f √2).
    for fields in [&[0.0, 2.0, 3.0], &[3.0, 2.0, 0.0]] {
        let measured = measure_effects(&mirror(0.1, fields), 0).unwrap();
        assert_near(measured.smallest_spot, 0.1 * 10.0 / FOCAL / 2f64.sqrt(), 0.05);
    }
    let blurred = measure_effects(&mirror(0.1, &[3.0]), 0).unwrap().smallest_spot;
    assert!(blurred > 0.02, "{blurred}");
}

#[test]
fn aspheres_left_out_stay_below_the_limit_together() {
    // One micrometre may be neglected; the shifts add up.
    let auto = |aspheres: &[(usize, f64)]| {
        let measured = measured(aspheres, 1.0);
        let plan = plan(&measured, TracePurpose::Spot(1e-3), &EffectOverrides::default());
        let residual = plan.decision(Effect::Asphere).unwrap().residual;
        (plan.as_conic, residual)
    };
    assert_eq!(auto(&[(2, 6e-4), (5, 6e-4)]), (vec![2], 6e-4));
    assert_eq!(auto(&[(2, 6e-4), (5, 3e-4), (7, 2e-3)]), (vec![2, 5], 6e-4 + 3e-4));
    assert_eq!(auto(&[(1, 5e-4), (2, 4e-4), (3, 3e-4)]), (vec![2, 3], 3e-4 + 4e-4));
    assert_eq!(auto(&[(1, 2e-3)]), (vec![], 0.0));
}

#[test]
fn an_effect_costs_time_only_where_it_is_computed() {
    let spherical = bundled("singlet_la1131");
    let aspheric = bundled("phone_us7558005_1");
    let asphere_cost = |lens: &Lens| {
        let overrides = EffectOverrides::default();
        let task = EffectTask { lens, zoom: 0, tolerance: 1e-6, overrides: &overrides };
        let facts = task.measure_effects().unwrap();
        let plan = task.measure_costs(&facts, || false).unwrap();
        plan.decision(Effect::Asphere).unwrap().cost.unwrap()
    };
    assert_eq!(asphere_cost(&spherical).saved_ms, 0.0);
    let cost = asphere_cost(&aspheric);
    assert!(cost.saved_ms > 0.0 && cost.saved_share < 1.0, "{cost:?}");
}

/// What `info` prints of the effects of a lens, and the milliseconds that it took.
#[expect(clippy::disallowed_methods, reason = "times of the program are compared with it")]
fn info(name: &str) -> (serde_json::Value, f64) {
    let start = Instant::now();
    let path = format!("lenses/{name}.json");
    let output = Command::new(env!("CARGO_BIN_EXE_aplanat"))
        .env("APLANAT_GLASSES", "no folder")
        .args(["info", &path, "--json"])
        .output()
        .unwrap();
    let elapsed = 1e3 * start.elapsed().as_secs_f64();
    (serde_json::from_slice(&output.stdout).unwrap(), elapsed)
}

#[test]
fn no_effect_saves_more_time_than_was_spent_and_what_does_nothing_saves_none() {
    assert!(files::bundled_lenses().iter().any(|lens| lens.name == "singlet_la1131"));
    for name in ["singlet_la1131", "double_gauss_rudolph_50"] {
        let (info, elapsed) = info(name);
        let effects = info["effects"].as_array().unwrap();
        for effect in effects {
            let saved = effect["saved_ms"].as_f64().unwrap();
            assert!(saved < elapsed, "{name}: {effect} of {elapsed} ms");
        }
        // Spheres and planes in air with an object at infinity.
        for idle in ["asphere", "finite_object", "gradient", "poses", "temperature"] {
            let effect = effects.iter().find(|effect| effect["effect"] == idle).unwrap();
            assert_eq!(effect["saved_ms"].as_f64(), Some(0.0), "{name}: {effect}");
        }
    }
}
