//! The shared reference cases: quadruple precision, rounded to 17 digits.

use super::{length, vec3};
use crate::reference::{Worst, count, number, numbers, read};
use aplanat::grin::field::{
    BSpline, HessianDiagonal, Polynomial, ProfileField, RegularGrid, Tricubic, Trilinear,
};
use aplanat::grin::{
    EndCondition, Face, GrinRay, GrinRegion, GrinSetup, GrinTracer, IndexField, Integrator,
    LastStep, LaunchMode, RayAdjoint, RayExit,
};
use aplanat::math::Vec3;
use serde_json::Value;

fn point(value: &Value) -> Vec3<f64> {
    let [x, y, z] = numbers(value).try_into().unwrap();
    Vec3::new(x, y, z)
}

fn field(data: &Value) -> Box<dyn IndexField<f64>> {
    let coefficients = numbers(&data["coeffs"]);
    let layered = |sphere: Box<dyn IndexField<f64>>, cylinder| match data["sym"].as_str().unwrap() {
        "sphere" => sphere,
        "cylinder" => cylinder,
        other => panic!("symmetry {other}"),
    };
    let grid = |nodes: &Value| {
        let (low, h) = (number(&data["lo"]), number(&data["h"]));
        RegularGrid::new([count(nodes); 3], vec3([low; 3]), vec3([h; 3])).unwrap()
    };
    match data["kind"].as_str().unwrap() {
        "radial_poly" => {
            let p = Polynomial { coefficients };
            layered(Box::new(ProfileField::sphere(p.clone())), Box::new(ProfileField::cylinder(p)))
        }
        "radial_bspline" => {
            let p = BSpline::new(0.0, number(&data["S"]), coefficients).unwrap();
            layered(Box::new(ProfileField::sphere(p.clone())), Box::new(ProfileField::cylinder(p)))
        }
        "trilinear" => {
            let mut field = Trilinear::new(grid(&data["n"]), coefficients).unwrap();
            field.diagonal = HessianDiagonal::Exact;
            Box::new(field)
        }
        "tricubic_bspline" => Box::new(Tricubic::new(grid(&data["m"]), coefficients).unwrap()),
        other => panic!("field {other}"),
    }
}

fn integrator(name: &str) -> Integrator {
    match name {
        "yoshida4" => Integrator::Yoshida,
        "blanes_moan_srkn4_6" => Integrator::BlanesMoan,
        name => Integrator::ALL.into_iter().find(|i| i.name() == name).unwrap(),
    }
}

fn end(data: &Value) -> EndCondition<f64> {
    let last = match data["mode"].as_str().unwrap() {
        "fixed" => return EndCondition::Steps(u32::try_from(count(&data["n_steps"])).unwrap()),
        "broken_line" => LastStep::BrokenLine,
        "fractional_step" => LastStep::Fractional,
        other => panic!("end {other}"),
    };
    let d = number(&data["d"]);
    let region = match data["surface"].as_str().unwrap() {
        "sphere" => GrinRegion::ball(d),
        "box" => GrinRegion::cube(d),
        "plane" => GrinRegion::within_faces(vec![Face::plane(point(&data["normal"]), d)]),
        other => panic!("surface {other}"),
    };
    EndCondition::Boundary { region, last, limit: 100_000 }
}

/// `a |x - A|² + b |v - B|²`.
fn loss(data: &Value, exit: &RayExit<f64>) -> (f64, RayAdjoint<f64>) {
    let (a, b) = (number(&data["a"]), number(&data["b"]));
    let (dx, dv) = (exit.x - point(&data["A"]), exit.v - point(&data["B"]));
    let seed = RayAdjoint { x: dx * (2.0 * a), v: dv * (2.0 * b), path: 0.0 };
    (a * dx.dot(dx) + b * dv.dot(dv), seed)
}

#[test]
fn grin_states_losses_and_gradients_match_quadruple_precision() {
    let file = read("grin.json");
    let (mut states, mut losses) = (Worst::default(), Worst::default());
    let (mut gradients, mut starts) = (Worst::default(), Worst::default());
    for case in file["cases"].as_array().unwrap() {
        let name = case["name"].as_str().unwrap();
        let field = field(&case["field"]);
        let setup = GrinSetup {
            integrator: integrator(case["integrator"].as_str().unwrap()),
            step: number(&case["step"]),
            launch: LaunchMode::AsGiven,
            end: end(&case["end"]),
            screen: None,
        };
        let tracer = GrinTracer::new(&*field, setup).unwrap();
        let given = case["rays"].as_array().unwrap();
        let ray = |r: &Value| GrinRay { x: point(&r["x0"]), v: point(&r["v0"]) };
        let rays: Vec<_> = given.iter().map(ray).collect();
        let outcome = tracer.loss_and_gradient(&rays, |_, exit| loss(&case["loss"], exit));

        losses.note(outcome.loss, number(&case["total_loss"]), outcome.loss.max(1.0), name);
        let norm = number(&case["grad_norm"]);
        let exact = numbers(&case["grad"]);
        assert_eq!(exact.len(), outcome.gradient.parameters.len(), "{name}");
        for (got, exact) in outcome.gradient.parameters.iter().zip(exact) {
            gradients.note(*got, exact, norm, name);
        }
        for (i, r) in given.iter().enumerate() {
            let (exit, start) = (&outcome.exits[i], outcome.gradient.starts[i]);
            assert!(exit.fate.has_arrived(), "{name}: {:?}", exit.fate);
            assert_eq!(exit.steps as usize, count(&r["n_steps"]), "{name} ray {i}");
            states.note(length(exit.x - point(&r["xf"])), 0.0, 1.0, name);
            states.note(length(exit.v - point(&r["vf"])), 0.0, 1.0, name);
            starts.note(length(start.x - point(&r["dC_dx0"])), 0.0, norm, name);
            starts.note(length(start.v - point(&r["dC_dv0"])), 0.0, norm, name);
        }
    }
    let compared = [
        states.check("grin states", 1e-12),
        losses.check("grin losses", 1e-12),
        gradients.check("grin gradients by parameters", 1e-12),
        starts.check("grin gradients by starts", 1e-12),
    ];
    assert_eq!(compared, [28, 9, 705, 28]);
}
