//! A lens in section, as every figure of the thesis shows it: glass, stop, rays.

use crate::lens::{LensSection, System};
use crate::plot::{BLACK, Canvas, Chart, Color, GREY, Stroke};
use crate::pupil::Launch;

/// Straight pieces of a surface.
const PIECES: u32 = 48;
/// The outer end of the blades of a stop, in multiples of the largest semi-diameter.
const BLADE: f64 = 1.1;

/// A system in its section through the axis, `z` to the right and `y` upwards, in mm.
pub(super) struct SectionPlot<'a> {
    section: LensSection<'a>,
    reach: f64,
}

impl<'a> SectionPlot<'a> {
    pub(super) fn new(system: &'a System<f64>) -> Self {
        let sizes = system.surfaces.iter().map(|surface| surface.semi_diameter);
        let reach = sizes.filter(|size| size.is_finite()).fold(0.0, f64::max);
        Self { section: LensSection::new(system, &[]), reach }
    }

    /// The corners of what is drawn: `z` and `y`.
    pub(super) fn extent(&self) -> [[f64; 2]; 2] {
        let high = BLADE * self.reach;
        let image = self.section.image_position();
        [[-self.reach, image], [-high, high]]
    }

    /// Draws the surfaces, the edges of the glass, the blades of the stop and the image plane.
    pub(super) fn draw(&self, canvas: &mut Canvas, chart: &Chart) {
        let system = self.section.system();
        let last = self.section.image();
        for i in 0..last {
            if system.stop == Some(i) && system.index_before(i) == self.index_behind(i) {
                self.draw_blades(canvas, chart, i);
                continue;
            }
            canvas.curve(&chart.to_pixels(&self.arc(i)), GREY, Stroke::Solid);
            if self.index_behind(i) != 1.0 {
                self.draw_edges(canvas, chart, i);
            }
        }
        let image = self.section.image_position();
        let ends = [[image, -self.reach], [image, self.reach]];
        canvas.curve(&chart.to_pixels(&ends), BLACK, Stroke::Dashed);
    }

    /// Draws the way of a ray, as far as it gets.
    pub(super) fn draw_ray(
        &self,
        canvas: &mut Canvas,
        chart: &Chart,
        launch: &Launch<'_>,
        p: [f64; 2],
        color: Color,
    ) {
        let Some(ray) = launch.ray(p) else { return };
        let path = launch.channel().tracer.polyline(ray);
        let before = ray.point - ray.direction * self.reach;
        let start = [before.z, before.y];
        let corners = std::iter::once(start).chain(path.points.iter().map(|p| [p.z, p.y]));
        let corners: Vec<[f64; 2]> = corners.collect();
        for pair in chart.to_pixels(&corners).windows(2) {
            canvas.line(pair[0], pair[1], color);
        }
    }

    fn index_behind(&self, surface: usize) -> f64 {
        self.section.system().surfaces[surface].index
    }

    fn arc(&self, surface: usize) -> Vec<[f64; 2]> {
        self.section.surface(surface, PIECES)
    }

    /// From the rim of a surface to that of the next one.
    fn draw_edges(&self, canvas: &mut Canvas, chart: &Chart, surface: usize) {
        let (left, right) = (self.arc(surface), self.arc(surface + 1));
        for (a, b) in [(left.first(), right.first()), (left.last(), right.last())] {
            if let (Some(a), Some(b)) = (a, b) {
                canvas.curve(&chart.to_pixels(&[*a, *b]), GREY, Stroke::Solid);
            }
        }
    }

    fn draw_blades(&self, canvas: &mut Canvas, chart: &Chart, surface: usize) {
        let opening = self.section.system().surfaces[surface].semi_diameter;
        let z = self.section.vertices()[surface];
        for side in [-1.0, 1.0] {
            let blade = [[z, side * opening], [z, side * BLADE * self.reach]];
            let blade = chart.to_pixels(&blade);
            canvas.curve(&blade, BLACK, Stroke::Solid);
            canvas.markers(&blade[..1], BLACK);
        }
    }
}
