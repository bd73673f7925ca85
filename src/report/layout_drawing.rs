//! The layout of a lens to scale: elements with their numbers, mirrors, stop, image plane, axis and
//! rays, as a figure or as a sheet.

use super::body::{LensBody, lens_bodies};
use super::sheet::{DrawingSheet, standard_scale};
use crate::analysis::{RayLayout, ray_layout};
use crate::lens::{Lens, LensSection, System};
use crate::plot::{
    Color, LinePattern, PALETTE, Pen, SheetArc, SheetScale, TextAlign, VectorDrawing,
};
use crate::pupil::{RayModel, RayModelError};

/// The straight pieces of a surface that is no circle in the drawing.
const PIECES: u32 = 240;
/// The largest distance in mm on the sheet between a surface and the arc that stands for it.
const ARC_ERROR: f64 = 1e-4;
/// The colour of glass.
const GLASS: Color = [0xe3, 0xee, 0xf7];
/// The rays of a field.
const RAYS: usize = 5;
/// The size of the numbers of elements, and their distance from the rim, in mm on the sheet.
const NUMBER: f64 = 2.6;
const ABOVE: f64 = 1.6;

/// A lens at a zoom position with the rays of its drawing.
#[derive(Debug, Clone)]
pub struct LayoutScene<'a> {
    lens: &'a Lens,
    zoom: usize,
    system: System<f64>,
    rays: RayLayout,
}

impl<'a> LayoutScene<'a> {
    /// The drawing of a lens at a zoom position.
    ///
    /// # Errors
    /// A lens or an aperture through which no ray can be traced.
    pub fn new(lens: &'a Lens, zoom: usize) -> Result<Self, RayModelError> {
        let model = RayModel::from_lens(lens, zoom)?;
        let mut system = model.channels[model.primary].system.clone();
        // The stop of rays is as small as the aperture makes it; the glass around it is not.
        for (surface, row) in system.surfaces.iter_mut().zip(&lens.surfaces) {
            surface.semi_diameter = row.semi_diameter.unwrap_or(surface.semi_diameter);
        }
        Ok(Self { lens, zoom, system, rays: ray_layout(&model, RAYS) })
    }

    /// The section of the lens.
    pub fn section(&self) -> LensSection<'_> {
        LensSection::new(&self.system, &self.rays.ray_heights)
    }

    /// The bodies of glass.
    pub fn bodies(&self) -> Vec<LensBody> {
        lens_bodies(self.lens, &self.section())
    }

    /// The fields without rays in the drawing, each with the reason.
    pub fn lost_fields(&self) -> &[(usize, String)] {
        &self.rays.errors
    }

    /// A figure of this width in mm at most, at a standard scale.
    pub fn figure(&self, room: [f64; 2]) -> VectorDrawing {
        let (low, high) = self.bounds();
        let length = [high[0] - low[0], high[1] - low[1]];
        let factor = standard_scale(length, [room[0] - 6.0, room[1] - 12.0]);
        let height = factor * length[1] + 12.0;
        let middle = 0.5 * (room[0] - factor * length[0]);
        let origin = [middle - factor * low[0], height - 5.0 + factor * low[1]];
        let mut figure = VectorDrawing::new([room[0], height]);
        figure.scale = Some(SheetScale { origin, factor });
        self.draw(&mut figure, SheetScale { origin, factor });
        figure
    }

    /// A sheet with the layout, a frame and a title, in landscape format.
    pub fn sheet(&self) -> VectorDrawing {
        let (low, high) = self.bounds();
        let length = [high[0] - low[0], high[1] - low[1]];
        let mut sheet = DrawingSheet::fitting(length);
        let factor = standard_scale(length, sheet.room());
        let middle = sheet.middle();
        let origin = [
            middle[0] - 0.5 * factor * (low[0] + high[0]),
            middle[1] + 0.5 * factor * (low[1] + high[1]),
        ];
        let scale = SheetScale { origin, factor };
        self.draw(&mut sheet.drawing, scale);
        sheet.drawing.scale = Some(scale);
        sheet.finish(&self.lens.name, &self.title(), factor)
    }

    fn title(&self) -> String {
        let zoom = match self.lens.zoom.get(self.zoom) {
            Some(position) => format!(", zoom position {} {}", self.zoom, position.name),
            None => String::new(),
        };
        format!("Layout{}", zoom.trim_end())
    }

    /// The corners of what is drawn, as z and y in mm.
    fn bounds(&self) -> ([f64; 2], [f64; 2]) {
        let section = self.section();
        let surfaces =
            (0..=section.image()).flat_map(|i| section.surface(i, 24)).chain(section.axis());
        let elements = section.elements().flat_map(|(i, _)| section.element(i, 24)).flatten();
        let rays = self.rays.rays.iter().flat_map(|ray| &ray.path.points).map(|p| [p.z, p.y]);
        let points =
            surfaces.chain(elements).chain(rays).filter(|p| p.iter().all(|v| v.is_finite()));
        let (low, high) =
            points.fold(([f64::INFINITY; 2], [-f64::INFINITY; 2]), |(low, high), p| {
                ([low[0].min(p[0]), low[1].min(p[1])], [high[0].max(p[0]), high[1].max(p[1])])
            });
        if high[0] > low[0] || high[1] > low[1] { (low, high) } else { ([0.0; 2], [1.0; 2]) }
    }

    fn draw(&self, sheet: &mut VectorDrawing, scale: SheetScale) {
        let section = self.section();
        let to_sheet = |p: &[f64; 2]| scale.to_sheet(*p);
        for (front, _) in section.elements() {
            let [left, right] = section.element(front, 96);
            let outline: Vec<_> = left.iter().chain(right.iter().rev()).map(to_sheet).collect();
            sheet.area(&outline, GLASS);
        }
        let axis: Vec<_> = section.axis().iter().map(to_sheet).collect();
        sheet.line(&axis, Pen::AXIS);
        for ray in &self.rays.rays {
            let points = ray.path.points.iter().filter(|p| p.is_finite());
            let points: Vec<_> = points.map(|p| scale.to_sheet([p.z, p.y])).collect();
            sheet.line(&points, Pen::colored(PALETTE[ray.field % PALETTE.len()]));
        }
        (0..=section.image()).for_each(|i| self.draw_surface(sheet, &section, i, scale));
        (0..=section.image()).for_each(|i| self.draw_blocked(sheet, &section, i, scale));
        section.elements().for_each(|(front, _)| draw_rim(sheet, &section, front, scale));
        self.draw_stop(sheet, &section, scale);
        self.number_bodies(sheet, &section, scale);
    }

    fn draw_surface(
        &self,
        sheet: &mut VectorDrawing,
        section: &LensSection<'_>,
        i: usize,
        scale: SheetScale,
    ) {
        let surface = &self.system.surfaces[i];
        let pen = if surface.mirror {
            Pen::OUTLINE.with_width(0.6)
        } else if i == section.image() {
            Pen::OUTLINE.with_width(0.25)
        } else if self.system.index_before(i) != surface.index || surface.grin.is_some() {
            Pen::OUTLINE
        } else if self.system.stop == Some(i) {
            return;
        } else {
            Pen::THIN.with_pattern(LinePattern::Dashes)
        };
        let parts = if surface.mirror {
            section.open_parts(i, PIECES)
        } else {
            vec![section.surface(i, PIECES)]
        };
        parts.iter().for_each(|part| draw_part(sheet, part, pen, scale));
    }

    /// The parts of a surface that its obstruction and its apertures block: thick at a lens, thin at a mirror.
    fn draw_blocked(
        &self,
        sheet: &mut VectorDrawing,
        section: &LensSection<'_>,
        i: usize,
        scale: SheetScale,
    ) {
        let mirror = self.system.surfaces[i].mirror;
        let pen = if mirror { Pen::THIN } else { Pen::OUTLINE.with_width(0.8) };
        let parts = section.blocked_parts(i, PIECES);
        parts.iter().for_each(|part| draw_part(sheet, part, pen, scale));
    }

    /// Two ticks at the rim of the stop.
    fn draw_stop(&self, sheet: &mut VectorDrawing, section: &LensSection<'_>, scale: SheetScale) {
        let Some(stop) = self.system.stop else { return };
        let height = section.heights()[stop];
        for side in [1.0, -1.0] {
            let [rim, far] = [height, height + 5.0 / scale.factor]
                .map(|h| scale.to_sheet(section.plane_point(stop, side * h)));
            sheet.line(&[rim, far], Pen::OUTLINE.with_width(0.5));
        }
    }

    fn number_bodies(
        &self,
        sheet: &mut VectorDrawing,
        section: &LensSection<'_>,
        scale: SheetScale,
    ) {
        for body in lens_bodies(self.lens, section) {
            let [a, b] = body.surfaces.map(|i| scale.to_sheet(section.point(i, body.rim())));
            let at = [0.5 * (a[0] + b[0]), a[1].min(b[1]) - ABOVE];
            sheet.label(at, body.number.to_string(), NUMBER, TextAlign::Middle);
        }
    }
}

/// Draws the rims of the element behind a surface, and where its surfaces continue flat.
fn draw_rim(sheet: &mut VectorDrawing, section: &LensSection<'_>, front: usize, scale: SheetScale) {
    let height = section.heights()[front].max(section.heights()[front + 1]);
    for side in [1.0, -1.0] {
        let points = [
            section.point(front, side * section.heights()[front]),
            section.point(front, side * height),
            section.point(front + 1, side * height),
            section.point(front + 1, side * section.heights()[front + 1]),
        ];
        sheet.line(&points.map(|p| scale.to_sheet(p)), Pen::OUTLINE);
    }
}

fn draw_part(sheet: &mut VectorDrawing, part: &[[f64; 2]], pen: Pen, scale: SheetScale) {
    draw_curve(sheet, &part.iter().map(|p| scale.to_sheet(*p)).collect::<Vec<_>>(), pen);
}

/// Draws a curve as a straight line or an arc where it is one, and else as a polyline.
pub(super) fn draw_curve(sheet: &mut VectorDrawing, points: &[[f64; 2]], pen: Pen) {
    let [first, .., last] = points else { return };
    let middle = points[points.len() / 2];
    let arc = SheetArc::through([*first, middle, *last]);
    let on_arc = |arc: &SheetArc| {
        let off = |p: &[f64; 2]| (p[0] - arc.center[0]).hypot(p[1] - arc.center[1]) - arc.radius;
        points.iter().all(|p| off(p).abs() < ARC_ERROR)
    };
    let along = [last[0] - first[0], last[1] - first[1]];
    let length = along[0].hypot(along[1]).max(f64::MIN_POSITIVE);
    let off_line =
        |p: &[f64; 2]| ((p[0] - first[0]) * along[1] - (p[1] - first[1]) * along[0]) / length;
    if points.iter().all(|p| off_line(p).abs() < ARC_ERROR) {
        sheet.line(&[*first, *last], pen);
    } else if let Some(arc) = arc.filter(on_arc) {
        sheet.arc(arc, pen);
    } else {
        sheet.line(points, pen);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::{bundled_lenses, json};
    use crate::plot::Mark;

    /// The layout is in the middle of the room that frame and title leave, and no rim is drawn outside
    /// of what the sheet makes room for.
    #[test]
    fn a_layout_lies_in_the_middle_of_its_sheet() {
        for name in ["double_gauss_rudolph_50", "telescope_rc_f8", "wide_nikkor_28_f35"] {
            let bundled = bundled_lenses().iter().find(|bundled| bundled.name == name).unwrap();
            let lens = json::read(bundled.text, name).unwrap();
            let scene = LayoutScene::new(&lens, 0).unwrap();
            let (low, high) = scene.bounds();
            let sheet = scene.sheet();
            let scale = sheet.scale.unwrap();
            let [left, bottom] = scale.to_sheet(low);
            let [right, top] = scale.to_sheet(high);
            let [width, height] = sheet.size;
            assert!((left - (width - right)).abs() < 1e-9, "{name}: {left} {right}");
            // The title is 20 mm high and stands on the frame.
            assert!((top - (height - 20.0 - bottom)).abs() < 1e-9, "{name}: {top} {bottom}");
            let inside = |p: &[f64; 2]| {
                let [z, y] = scale.to_model(*p);
                (low[0] - 1e-6..=high[0] + 1e-6).contains(&z)
                    && (low[1] - 1e-6..=high[1] + 1e-6).contains(&y)
            };
            let is_rim =
                |mark: &&Mark| matches!(mark, Mark::Line { pen, .. } if *pen == Pen::OUTLINE);
            for mark in sheet.marks.iter().filter(is_rim) {
                let Mark::Line { points, .. } = mark else { continue };
                assert!(points.iter().all(inside), "{name}: {points:?}");
                // The cylinder of a lens is as high as the higher one of its two surfaces.
                let heights: Vec<f64> =
                    points.iter().map(|p| scale.to_model(*p)[1].abs()).collect();
                if let [front, start, end, back] = heights[..] {
                    let highest = front.max(back) - 1e-9;
                    assert!(start >= highest && end >= highest, "{name}: {heights:?}");
                }
            }
        }
    }
}
