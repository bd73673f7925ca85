//! The front of sharpness against light.

use super::merit::bundled;
use aplanat::lens::{Field, Wavelength};
use aplanat::merit::PupilEdge;
use aplanat::optimize::Method;
use aplanat::optimize::pareto::{Settings, Sweep};

fn sweep(name: &str, settings: &Settings) -> Sweep {
    let mut lens = bundled(name);
    lens.variables.clear();
    lens.wavelengths = vec![Wavelength { um: 0.587_561_8, weight: 1.0, primary: true }];
    lens.fields.values = [0.0, 10.0, 20.0].map(|y| Field { x: 0.0, y, weight: 1.0 }).to_vec();
    let mut sweep = Sweep::new(&lens, settings).unwrap();
    while !sweep.step().finished {}
    sweep
}

#[test]
#[ignore]
fn look() {
    let arg = |name: &str, or: usize| std::env::var(name).map_or(or, |v| v.parse().unwrap());
    for name in ["double_gauss_rudolph_50", "double_gauss_nikkor_s_50"] {
        for pupil in [PupilEdge::Moving, PupilEdge::Kept] {
            let t = std::time::Instant::now();
            let settings = Settings {
                points: arg("POINTS", 8),
                steps: arg("STEPS", 500),
                pupil,
                method: if arg("ADAM", 0) > 0 { Method::Adam } else { Method::DampedLeastSquares },
                blur: [4e-5, std::env::var("BLUR").map_or(1e-3, |v| v.parse().unwrap())],
                ..Settings::default()
            };
            let found = sweep(name, &settings);
            println!(
                "{name} {pupil:?} start {} {} hypervolume {} in {:.2} s",
                found.start.spot,
                found.start.light,
                found.hypervolume(),
                t.elapsed().as_secs_f64()
            );
            let designs = found.front().designs();
            for d in designs.iter().step_by(designs.len().div_ceil(12)) {
                println!("  {:?} {:.5} {:.2}", d.weight.map(f64::sqrt), d.spot, d.light);
            }
        }
    }
}
