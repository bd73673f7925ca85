//! Figure 5.9: a fibre that refocuses parallel light periodically, compared with the parabolic one.
//!
//! The field is optimized for its first focus alone. For meridional rays the exact answer is the
//! hyperbolic secant, which refocuses at one, three and five times that distance; the parabolic
//! profile has no focus, so it is compared at those planes where its own blur is smallest.

use super::{
    Claim, DataTable, Effort, Experiment, ExperimentOutcome, ExperimentResult, NamedPlot,
    ProgressFn, builtin_task, solve,
};
use crate::grin::field::{Parabolic, ProfileField};
use crate::grin::{
    EndCondition, GrinRay, GrinRegion, GrinSetup, GrinTracer, Integrator, LastStep, LaunchMode,
};
use crate::grin_design::{GrinField, GrinTask};
use crate::math::Vec3;
use crate::plot::{Axis, Canvas, Chart, Legend, PALETTE, Stroke};
use crate::report::plot_grin_field;
use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2, SQRT_2};

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "5.9",
    title: "A focusing fibre compared with the parabolic one",
    claim: "The optimized profile focuses better than the parabolic one, over more periods",
    omits: "nothing of the figure",
    seconds: 1.0,
    run,
};

/// The minimum improvement factor of the foci.
const BETTER: f64 = 1000.0;
/// The largest deviation of the index from the secant.
const NEAR: f64 = 1e-4;
/// The number of planes tried for the focus of the parabolic fibre, and the number of refinements.
const PLANES: usize = 40;
const REFINED: usize = 4;
/// The number of steps of a ray from focus to focus.
const STEPS: f64 = 40.0;

fn run(_: Effort, progress: &mut ProgressFn<'_>) -> ExperimentResult {
    let task = builtin_task("fibre")?;
    let optimizer = solve(&task, [0.0, 1.0], progress)?;
    let best = optimizer.best();
    let spots = optimizer.score(best)?.views;
    let (_, rays) = task.scoring_rays(&task.views[0]);
    let mut outcome = ExperimentOutcome {
        rays: optimizer.rays_traced() as usize,
        ..ExperimentOutcome::default()
    };
    let columns = ["focus", "plane_mm", "spot_mm", "parabola_plane_mm", "parabola_spot_mm"];
    let mut table = DataTable::new("foci", &columns);
    for (i, view) in spots.iter().enumerate() {
        let order = (2 * i + 1) as f64;
        let (plane, spot) = parabola(&rays, order)?;
        outcome.rays += PLANES * REFINED * rays.len();
        table.push_row([
            (i + 1).into(),
            (order * FRAC_PI_2).into(),
            view.spot.into(),
            plane.into(),
            spot.into(),
        ]);
        let says =
            format!("focus {}: blur of the parabolic fibre, relative to the optimized one", i + 1);
        outcome.claims.push(Claim::at_least(says, spot / view.spot, BETTER));
    }
    let difference = task.difference(best)?;
    let relative = difference.map_or(f64::NAN, |difference| difference.relative);
    let says = "relative difference from the hyperbolic secant";
    outcome.claims.push(Claim::at_most(says, relative, NEAR));
    outcome.tables.push(table);
    outcome.pictures = plot_grin_field(&task, best);
    outcome
        .pictures
        .push(NamedPlot { name: "misses", canvas: draw_focus_errors(&task, best, &rays)? });
    Ok(outcome)
}

/// `√(2 - r²)`, the parabolic fibre (5.42).
fn parabolic() -> ProfileField<Parabolic<f64>> {
    ProfileField::cylinder(Parabolic::new(SQRT_2, FRAC_1_SQRT_2))
}

/// The distance of each ray from the axis of the parabolic fibre at a plane.
fn heights(rays: &[GrinRay<f64>], plane: f64) -> ExperimentResult<Vec<f64>> {
    let region = GrinRegion::rod(1.5, -1.0, plane);
    let setup = GrinSetup {
        integrator: Integrator::BlanesMoan,
        step: FRAC_PI_2 / STEPS,
        launch: LaunchMode::Scaled,
        end: EndCondition::Boundary { region, last: LastStep::Fractional, limit: 100_000 },
        screen: None,
    };
    let field = parabolic();
    let tracer = GrinTracer::new(&field, setup)?;
    Ok(tracer.trace_batch(rays).iter().map(|exit| exit.x.x).collect())
}

/// The plane near a focus of the parabolic fibre where its blur is smallest, and that blur.
fn parabola(rays: &[GrinRay<f64>], order: f64) -> ExperimentResult<(f64, f64)> {
    // Its rays cross the axis at η(r) π/2 times an odd number, r the height where they start.
    let (mut from, mut to) = (0.9 * FRAC_PI_2 * order, SQRT_2 * FRAC_PI_2 * order);
    let mut best = (from, f64::INFINITY);
    for _ in 0..REFINED {
        let gap = (to - from) / PLANES as f64;
        for i in 0..=PLANES {
            let plane = from + gap * i as f64;
            let squares = heights(rays, plane)?.iter().map(|x| x * x).sum::<f64>();
            let blur = (squares / rays.len() as f64).sqrt();
            if blur < best.1 {
                best = (plane, blur);
            }
        }
        (from, to) = (best.0 - gap, best.0 + gap);
    }
    Ok(best)
}

/// Draws the distance of the rays from the axis at the foci against their height.
fn draw_focus_errors(
    task: &GrinTask,
    best: &GrinField,
    rays: &[GrinRay<f64>],
) -> ExperimentResult<Canvas> {
    let mut curves = Vec::new();
    for (i, view) in task.views.iter().enumerate() {
        let order = (2 * i + 1) as f64;
        let (plane, _) = parabola(rays, order)?;
        let color = PALETTE[i % PALETTE.len()];
        let points = |heights: Vec<f64>| -> Vec<[f64; 2]> {
            rays.iter().zip(heights).map(|(ray, x)| [ray.x.x, x.abs()]).collect()
        };
        curves.push((format!("parabolic, focus {}", i + 1), points(heights(rays, plane)?), color));
        let space = view.space.unwrap_or(task.space);
        let plan = crate::grin::plan_tracing(
            best.index_field(),
            &space.region(),
            task.launch,
            rays,
            task.tolerance,
        );
        let setup = plan?.setup;
        let tracer = GrinTracer::new(best.index_field(), setup)?;
        let found = tracer.trace_batch(rays).iter().map(|exit| radius(exit.x)).collect();
        curves.push((format!("optimized, focus {}", i + 1), points(found), color));
    }
    let mut canvas = Canvas::new([1500, 860]);
    let all = || curves.iter().flat_map(|curve| &curve.1);
    let x = Axis::linear("height of the ray, mm", all().map(|p| p[0]).chain([0.0]));
    let y = Axis::logarithmic("distance from the axis, mm", all().map(|p| p[1]), 1e-8);
    let chart = Chart::new([140.0, 110.0], [960.0, 760.0], x, y);
    chart.draw(&mut canvas, "ray errors at the foci");
    let mut legend = Legend::new([1000.0, 123.0]);
    for (i, (name, points, color)) in curves.iter().enumerate() {
        let stroke = if i % 2 == 0 { Stroke::Dashed } else { Stroke::Solid };
        canvas.curve(&chart.to_pixels(points), *color, stroke);
        legend.curve(&mut canvas, name, *color, stroke);
    }
    Ok(canvas)
}

fn radius(p: Vec3<f64>) -> f64 {
    p.x.hypot(p.y)
}
