//! The drawing of one pupil: its area, its limits, and the ideal pupil around it.

use egui::{Align2, Color32, Mesh, Pos2, Rect, Shape, Stroke, TextStyle, Ui};
use glam::DVec2;

use crate::analysis::{FieldPupil, PupilShape};
use crate::pupil::{OutlineSide, PupilLimit, PupilOutline};
use crate::session::FieldPupils;
use crate::studio::draw::BoundingBox;
use crate::studio::palette::{Palette, color32};

/// The distance in points within which the pointer picks a side.
const NEAR: f32 = 7.0;
/// The ideal pupil is shown whole unless it is so much larger than every real one.
const LARGER: f64 = 1.6;
/// Free room around the largest pupil, as a share of its size.
const ROOM: f64 = 1.16;
/// A side shorter than this, in points, bears no number.
const SHORT: f32 = 26.0;
/// The inward extent of a pupil, in points, above which the number is inside.
const DEEP: f32 = 22.0;

/// The part of the plane that each drawing shows, all to one scale.
#[derive(Debug)]
pub(super) struct PupilWindow {
    centers: Vec<DVec2>,
    /// Half of the side of every picture, in mm.
    half: f64,
}

impl PupilWindow {
    pub(super) fn around_pupils(pupils: &FieldPupils) -> Self {
        let pupils = || pupils.fields.iter().map(|pupil| &pupil.value);
        let reach = |bounds: &BoundingBox| 0.5 * (bounds.max - bounds.min).max_element();
        let lit: Vec<Option<BoundingBox>> = pupils().map(lit_box).collect();
        let widest = lit.iter().flatten().map(reach).fold(0.0, f64::max);
        let bounds: Vec<Option<BoundingBox>> = pupils()
            .zip(lit)
            .map(|(pupil, lit)| {
                let ideal = box_around(&pupil.disc);
                let whole = union(lit, ideal);
                let fits = |bounds: &BoundingBox| widest == 0.0 || reach(bounds) <= LARGER * widest;
                whole.filter(fits).or(lit).or(ideal)
            })
            .collect();
        let half = bounds.iter().flatten().map(reach).filter(|half| half.is_finite());
        let middle =
            |bounds: &Option<BoundingBox>| bounds.map_or(DVec2::ZERO, |b| 0.5 * (b.min + b.max));
        let half = ROOM * half.fold(0.0, f64::max);
        Self {
            centers: bounds.iter().map(middle).collect(),
            half: if half > 0.0 { half } else { 1.0 },
        }
    }

    /// Points per mm.
    pub(super) fn scale(&self, picture: Rect) -> f64 {
        0.5 * f64::from(picture.width()) / self.half
    }
}

fn box_around(points: &[[f64; 2]]) -> Option<BoundingBox> {
    BoundingBox::around(points.iter().map(|p| DVec2::from(*p)))
}

fn union(a: Option<BoundingBox>, b: Option<BoundingBox>) -> Option<BoundingBox> {
    BoundingBox::around([a, b].into_iter().flatten().flat_map(|bounds| [bounds.min, bounds.max]))
}

/// The bounding box of the pupil.
fn lit_box(pupil: &FieldPupil) -> Option<BoundingBox> {
    match &pupil.shape {
        PupilShape::Outlined(outline) => {
            let points = outline.sides.iter().flat_map(|side| &side.points);
            BoundingBox::around(points.map(|p| DVec2::from(*p)))
        }
        PupilShape::Irregular { dots, .. } => box_around(dots),
        PupilShape::Dark(_) | PupilShape::Unbounded | PupilShape::NoRays(_) => None,
    }
}

/// A pupil at its place in the window.
#[derive(Debug)]
pub(super) struct PupilPicture<'a> {
    pub(super) pupil: &'a FieldPupil,
    pub(super) rect: Rect,
    center: DVec2,
    scale: f64,
}

impl<'a> PupilPicture<'a> {
    pub(super) fn new(
        pupil: &'a FieldPupil,
        window: &PupilWindow,
        field: usize,
        rect: Rect,
    ) -> Self {
        Self { pupil, rect, center: window.centers[field], scale: window.scale(rect) }
    }

    fn to_screen(&self, mm: [f64; 2]) -> Pos2 {
        let from = self.scale * (DVec2::from(mm) - self.center);
        #[expect(clippy::cast_possible_truncation, reason = "a place on the screen")]
        let (x, y) = (from.x as f32, from.y as f32);
        self.rect.center() + egui::vec2(x, -y)
    }

    fn to_screen_all(&self, points: &[[f64; 2]]) -> Vec<Pos2> {
        points.iter().map(|p| self.to_screen(*p)).collect()
    }

    const fn outline(&self) -> Option<&'a PupilOutline> {
        match &self.pupil.shape {
            PupilShape::Outlined(outline) => Some(outline),
            _ => None,
        }
    }

    /// The limit at the side nearest to a place of the window.
    pub(super) fn limit_near(&self, at: Pos2) -> Option<PupilLimit> {
        let sides = self.outline()?.sides.iter();
        let distance = |side: &OutlineSide| {
            let places = self.to_screen_all(&side.points);
            places
                .windows(2)
                .map(|ends| distance_to_segment(at, ends[0], ends[1]))
                .fold(NEAR, f32::min)
        };
        let near =
            sides.map(|side| (distance(side), side.limit)).min_by(|a, b| a.0.total_cmp(&b.0));
        near.filter(|(distance, _)| *distance < NEAR).map(|(_, limit)| limit)
    }

    /// Paints the pupil; `color` and `bold` give the style of a limit.
    pub(super) fn paint(
        &self,
        ui: &Ui,
        color: impl Fn(&Palette, PupilLimit) -> Color32,
        bold: impl Fn(PupilLimit) -> bool,
    ) {
        let palette = Palette::for_visuals(ui.visuals());
        let painter = ui.painter_at(self.rect);
        painter.rect_filled(self.rect, 0.0, color32(palette.background));
        if matches!(
            self.pupil.shape,
            PupilShape::Dark(_) | PupilShape::Unbounded | PupilShape::NoRays(_)
        ) {
            return;
        }
        self.paint_axes(&painter, &palette);
        self.paint_disc(&painter, &palette);
        let lit = color32(palette.glass).gamma_multiply(0.8);
        match &self.pupil.shape {
            PupilShape::Outlined(outline) => {
                painter.add(self.fill(outline, lit));
                self.paint_sides(ui, outline, |limit| color(&palette, limit), bold);
            }
            PupilShape::Irregular { dots, .. } => {
                let dot = color32(palette.outline);
                let dots = dots.iter().map(|p| Shape::circle_filled(self.to_screen(*p), 1.3, dot));
                painter.extend(dots);
            }
            PupilShape::Dark(_) | PupilShape::Unbounded | PupilShape::NoRays(_) => {}
        }
        if let Some(light) = &self.pupil.extent {
            let at = self.to_screen([light.centroid[0].value, light.centroid[1].value]);
            let stroke = Stroke::new(1.2, color32(palette.strong));
            painter.hline(at.x - 4.0..=at.x + 4.0, at.y, stroke);
            painter.vline(at.x, at.y - 4.0..=at.y + 4.0, stroke);
        }
    }

    /// The two lines through the axis of the lens.
    fn paint_axes(&self, painter: &egui::Painter, palette: &Palette) {
        let axis = self.to_screen([0.0; 2]);
        let stroke = Stroke::new(1.0, color32(palette.faint).gamma_multiply(0.6));
        painter.hline(self.rect.x_range(), axis.y, stroke);
        painter.vline(axis.x, self.rect.y_range(), stroke);
    }

    /// The ideal pupil, dashed.
    fn paint_disc(&self, painter: &egui::Painter, palette: &Palette) {
        let stroke = Stroke::new(1.0, color32(palette.faint));
        painter.extend(Shape::dashed_line(&self.to_screen_all(&self.pupil.disc), stroke, 4.0, 3.0));
    }

    /// The area of the pupil, as triangles around the point from which its whole edge is visible.
    fn fill(&self, outline: &PupilOutline, color: Color32) -> Shape {
        let mut mesh = Mesh::default();
        mesh.colored_vertex(self.to_screen(outline.center), color);
        let edge = outline.sides.iter().flat_map(|side| &side.points);
        edge.for_each(|p| mesh.colored_vertex(self.to_screen(*p), color));
        let corners = u32::try_from(mesh.vertices.len()).unwrap_or(0);
        (2..corners).for_each(|i| mesh.add_triangle(0, i - 1, i));
        Shape::mesh(mesh)
    }

    fn paint_sides(
        &self,
        ui: &Ui,
        outline: &PupilOutline,
        color: impl Fn(PupilLimit) -> Color32,
        bold: impl Fn(PupilLimit) -> bool,
    ) {
        let painter = ui.painter_at(self.rect);
        for side in &outline.sides {
            let width = if bold(side.limit) { 4.5 } else { 2.2 };
            painter.line(self.to_screen_all(&side.points), Stroke::new(width, color(side.limit)));
        }
        let palette = Palette::for_visuals(ui.visuals());
        for corner in outline.corners() {
            let ring = Stroke::new(1.2, color32(palette.strong));
            painter.circle(self.to_screen(corner), 3.0, color32(palette.background), ring);
        }
        for side in &outline.sides {
            self.side_number(ui, side, outline.center, color(side.limit));
        }
    }

    /// Draws the number of a side's surface at its middle: inside if there is room, else outside.
    fn side_number(&self, ui: &Ui, side: &OutlineSide, center: [f64; 2], color: Color32) {
        let Some(surface) = side.limit.surface() else { return };
        #[expect(clippy::cast_possible_truncation, reason = "a length on the screen")]
        let long = (side.length * self.scale) as f32;
        let Some(middle) = side.points.get(side.points.len() / 2) else { return };
        if long < SHORT {
            return;
        }
        let (middle, center) = (self.to_screen(*middle), self.to_screen(center));
        let inwards = center - middle;
        let step = if inwards.length() > DEEP { 9.0 } else { -9.0 };
        let at = middle + step * inwards.normalized();
        let font = TextStyle::Small.resolve(ui.style());
        let text = (surface + 1).to_string();
        ui.painter_at(self.rect).text(at, Align2::CENTER_CENTER, text, font, color);
    }
}

/// The distance of a place from a straight line between two others.
fn distance_to_segment(at: Pos2, from: Pos2, to: Pos2) -> f32 {
    let along = to - from;
    let square = along.length_sq();
    let share = if square > 0.0 { ((at - from).dot(along) / square).clamp(0.0, 1.0) } else { 0.0 };
    (at - (from + share * along)).length()
}
