//! Plots of gradient-index fields and of the images that they form.

use crate::grin::{GrinRay, GrinTracer, IndexField, plan_tracing};
use crate::grin_design::{GrinField, GrinTask, LightSource, ViewImage};
use crate::math::Vec3;
use crate::plot::{
    Axis, BLACK, Canvas, Chart, GREY, Legend, NamedPlot, PALETTE, Stroke, TextAlign,
    draw_image_row, gray_level, gray_levels,
};

/// The number of cells along a side of the plot of a section.
const CELLS: usize = 200;
/// The number of points of a profile.
const POINTS: usize = 300;
/// The number of rays in a plot.
const RAYS: usize = 13;

/// Plots the target image at the left and the image by traced rays at the right, both with white
/// for the brightest pixel of the target, under a name and the numbers of the image.
pub fn plot_grin_image(name: &str, image: &ViewImage, numbers: &str) -> Canvas {
    let panels = [("target", &image.target), ("image", &image.formed)];
    let peak = image.target.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let panels =
        panels.map(|(title, light)| (title.to_owned(), gray_levels(light, image.pixels, peak)));
    draw_image_row(&format!("{name}: {numbers}"), image.pixels, &panels)
}

/// Plots a field: its index along the x axis with the exact one, and a section through the z axis
/// with rays.
pub fn plot_grin_field(task: &GrinTask, medium: &GrinField) -> Vec<NamedPlot> {
    let profile = NamedPlot { name: "profile", canvas: plot_profile(task, medium) };
    vec![profile, NamedPlot { name: "section", canvas: plot_section(task, medium) }]
}

fn plot_profile(task: &GrinTask, medium: &GrinField) -> Canvas {
    let size = task.space.corners()[1].x;
    let along = |field: &dyn IndexField<f64>| -> Vec<[f64; 2]> {
        let at = |i: usize| size * (2.0 * i as f64 / POINTS as f64 - 1.0);
        let index = |x: f64| field.sample(Vec3::new(x, 0.0, 0.0)).index;
        (0..=POINTS).map(|i| [at(i), index(at(i))]).collect()
    };
    let found = along(medium.index_field());
    let exact = task.exact.as_ref().and_then(|exact| exact.field::<f64>().ok());
    let exact = exact.map(|field| along(&*field)).unwrap_or_default();
    let mut canvas = Canvas::new([1240, 760]);
    let x = Axis::linear("x, mm", found.iter().map(|p| p[0]));
    let y = Axis::linear("index", found.iter().chain(&exact).map(|p| p[1]));
    let chart = Chart::new([120.0, 110.0], [940.0, 660.0], x, y);
    chart.draw(&mut canvas, &task.name);
    canvas.curve(&chart.to_pixels(&found), PALETTE[0], Stroke::Solid);
    canvas.curve(&chart.to_pixels(&exact), BLACK, Stroke::Dashed);
    let mut legend = Legend::new([970.0, 120.0]);
    legend.curve(&mut canvas, "found", PALETTE[0], Stroke::Solid);
    if !exact.is_empty() {
        legend.curve(&mut canvas, "exact", BLACK, Stroke::Dashed);
    }
    canvas
}

fn plot_section(task: &GrinTask, medium: &GrinField) -> Canvas {
    let field = medium.index_field();
    let [low, high] = task.space.corners();
    let region = task.space.region();
    let extremes = task.extremes(medium);
    let range = (extremes.high - extremes.low).max(f64::MIN_POSITIVE);
    // Light travels to the right.
    let part = |low: f64, high: f64, i: usize| low + (high - low) * (i as f64 + 0.5) / CELLS as f64;
    let shade = |n: usize| {
        let p = Vec3::new(part(high.x, low.x, n / CELLS), 0.0, part(low.z, high.z, n % CELLS));
        if region.level(p) >= 0.0 {
            return [0xff; 3];
        }
        gray_level(1.0 - 0.7 * (field.sample(p).index - extremes.low) / range)
    };
    let colors: Vec<_> = (0..CELLS * CELLS).map(shade).collect();
    let mut canvas = Canvas::new([960, 1030]);
    let (corner, side) = ([110.0, 110.0], 4.0 * CELLS as f64);
    let place = |p: Vec3<f64>| {
        let share = |v: f64, low: f64, high: f64| (v - low) / (high - low);
        [corner[0] + side * share(p.z, low.z, high.z), corner[1] + side * share(p.x, high.x, low.x)]
    };
    let middle = corner[0] + 0.5 * side;
    canvas.text([middle, 20.0], &task.name, BLACK, TextAlign::Middle);
    let scale = format!("index {:.4} (light) to {:.4} (dark)", extremes.low, extremes.high);
    canvas.text([middle, 52.0], &scale, GREY, TextAlign::Middle);
    canvas.raster(corner, CELLS, 4, &colors);
    for path in paths(task, field) {
        let points: Vec<[f64; 2]> = path.into_iter().map(place).collect();
        canvas.curve(&points, PALETTE[0], Stroke::Solid);
    }
    let z = Axis::spanning("z, mm (light travels to the right)", low.z, high.z);
    let x = Axis::spanning("x, mm", low.x, high.x);
    Chart::new(corner, corner.map(|edge| edge + side), z, x).draw_ticks(&mut canvas);
    canvas
}

/// The paths of rays of the first view's kind in the plane of z and x.
fn paths(task: &GrinTask, field: &dyn IndexField<f64>) -> Vec<Vec<Vec3<f64>>> {
    let rays = in_plane(&task.views[0].source, task.space.diameter());
    let region = task.space.region();
    let Ok(plan) = plan_tracing(field, &region, task.launch, &rays, task.tolerance) else {
        return Vec::new();
    };
    let Ok(tracer) = GrinTracer::new(field, plan.setup) else { return Vec::new() };
    let path = |ray: &GrinRay<f64>| {
        let (states, exit) = tracer.trace_path(ray);
        states.into_iter().map(|state| state.x).chain([exit.x]).collect()
    };
    rays.iter().map(path).collect()
}

fn in_plane(source: &LightSource, back: f64) -> Vec<GrinRay<f64>> {
    let share = |i: usize| 2.0 * i as f64 / (RAYS - 1) as f64 - 1.0;
    let parallel = |height: f64, z: f64| -> Vec<GrinRay<f64>> {
        let at = |i: usize| Vec3::new(height * share(i), 0.0, z);
        (0..RAYS).map(|i| GrinRay { x: at(i), v: Vec3::new(0.0, 0.0, 1.0) }).collect()
    };
    match source {
        LightSource::Parallel { radius, .. } => parallel(*radius, -back),
        LightSource::Beam { half, .. } => parallel(*half, -back),
        LightSource::Fan { height, z, .. } => parallel(*height, *z),
        LightSource::Points { radius, cone, .. } => {
            let ray = |i: usize| {
                let (sin, cos) = (cone.to_radians() * share(i)).sin_cos();
                GrinRay { x: Vec3::new(0.0, 0.0, -radius), v: Vec3::new(sin, 0.0, cos) }
            };
            (0..RAYS).map(ray).collect()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drawn_rays_are_spread_evenly_from_edge_to_edge() {
        let rays = in_plane(&LightSource::Fan { height: 2.0, z: -3.0, rays: 5 }, 10.0);
        let heights: Vec<f64> = rays.iter().map(|ray| ray.x.x).collect();
        assert_eq!((heights.len(), heights[0], heights[RAYS - 1]), (RAYS, -2.0, 2.0));
        let step = 4.0 / (RAYS - 1) as f64;
        assert!(heights.windows(2).all(|pair| (pair[1] - pair[0] - step).abs() < 1e-12));
        assert!(rays.iter().all(|ray| ray.x.z == -3.0 && ray.v.z == 1.0));
    }
}
