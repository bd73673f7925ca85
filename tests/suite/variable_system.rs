//! Derivatives of given rays by numbers of a lens: what follows a number counts with it.

use super::merit::bundled;
use aplanat::lens::{Lens, Medium, Parameter, Pickup, Quantity};
use aplanat::math::Vec3;
use aplanat::merit::{MeritError, VariableSystem};
use aplanat::trace::{AdjointSeed, Landings, Ray, Rays, Tracer};

const UM: f64 = 0.5;

fn rays() -> Rays<f64> {
    let direction = |y: f64| Vec3::new(0.02, y, (1.0 - y * y - 0.0004_f64).sqrt());
    let heights = [-4.0, -1.0, 0.5, 3.0];
    heights
        .map(|y| Ray { point: Vec3::new(1.0, y, -5.0), direction: direction(0.01 * y) })
        .into_iter()
        .collect()
}

/// A model glass, a pickup, and an image plane that stays at the focus.
fn lens_with_followers() -> Lens {
    let mut lens = bundled("double_gauss_rudolph_50");
    lens.surfaces[0].medium = Medium::Model { nd: 1.6, vd: 50.0 };
    lens.image_solve = Some(0.1);
    lens.variables.clear();
    lens.pickups = vec![Pickup {
        parameter: Parameter::new(10, Quantity::Curvature),
        source: Parameter::new(0, Quantity::Curvature),
        scale: -1.0,
        offset: 0.0,
    }];
    lens
}

/// The sum of all landing heights and a tenth of the optical paths.
fn sum_over_rays(lens: &Lens) -> f64 {
    let tracer = Tracer::new(&lens.resolve(0, UM).unwrap()).unwrap();
    let mut landings = Landings::default();
    tracer.trace_batch(&rays(), &mut landings);
    landings.y.iter().sum::<f64>() + 0.1 * landings.opl.iter().sum::<f64>()
}

#[test]
fn derivatives_of_rays_include_what_follows_a_number() {
    let lens = lens_with_followers();
    let parameters = [
        (0, Quantity::Curvature, 1e-7),
        (1, Quantity::Thickness, 1e-4),
        (0, Quantity::Index, 1e-6),
        (3, Quantity::Conic, 1e-4),
    ];
    let named = parameters.map(|(surface, quantity, _)| Parameter::new(surface, quantity));
    let varied = VariableSystem::new(&lens, 0, UM, &named).unwrap();
    let tracer = Tracer::new(varied.system()).unwrap();
    let seed = AdjointSeed { point: Vec3::new(0.0, 1.0, 0.0), opl: 0.1, ..AdjointSeed::default() };
    let slopes = varied.by_parameters(&tracer.gradient(&rays(), |_| seed));
    for ((parameter, slope), (_, _, step)) in named.into_iter().zip(slopes).zip(parameters) {
        let at = |sign: f64| {
            let mut moved = lens.clone();
            moved.set(parameter, lens.get(parameter).unwrap() + sign * step);
            sum_over_rays(&moved)
        };
        let difference = (at(1.0) - at(-1.0)) / (2.0 * step);
        let error = (slope - difference).abs();
        assert!(error < 1e-6 * difference.abs().max(1.0), "{parameter}: {slope}, {difference}");
    }
}

#[test]
fn a_number_that_a_lens_does_not_have_is_refused() {
    let lens = bundled("double_gauss_rudolph_50");
    let missing = [Parameter::new(99, Quantity::Curvature)];
    let found = VariableSystem::new(&lens, 0, UM, &missing);
    assert!(matches!(found, Err(MeritError::NoVariables)));
}
