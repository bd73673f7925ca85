//! The texts around a pupil: its field, its numbers, and the reason why it is dark.

use std::sync::Arc;

use egui::{
    Align, Color32, Galley, Layout as Arrange, Rect, Response, RichText, Role, Sense, TextStyle,
    Ui, Vec2, WidgetInfo, vec2,
};

use super::{PupilView, show_within};
use crate::analysis::{Estimate, FieldPupil, PupilExtent, PupilShape, RayLoss};
use crate::pupil::{PupilLimit, PupilOutline};
use crate::studio::number;
use crate::studio::palette::Palette;
use crate::studio::panels::{field_name, percent_error, relative_error};
use crate::studio::text::{capitalize, counted};
use crate::trace::{Fate, RayLimit};

/// The gap between two limits in a line, in points.
const GAP: f32 = 7.0;
/// The room that the square in front of a limit takes.
const MARK: f32 = 12.0;

/// The explanation of a limit.
pub(super) const fn hint(limit: PupilLimit) -> &'static str {
    match limit {
        PupilLimit::Disc => {
            "The beam is limited by the aperture of the lens; no surface clips it there."
        }
        PupilLimit::Surface(_, RayLimit::Rim) => {
            "The beam ends at the semi-diameter of this surface. Click to select the surface."
        }
        PupilLimit::Surface(_, RayLimit::Obstruction) => {
            "The obstruction of this surface stops rays nearer to the axis. Click to select it."
        }
        PupilLimit::Surface(_, RayLimit::Aperture(_)) => {
            "An aperture of this surface stops rays outside of it. Click to select the surface."
        }
        PupilLimit::Surface(_, RayLimit::Obscuration(_)) => {
            "An obscuration of this surface stops rays inside of it. Click to select the surface."
        }
        PupilLimit::Surface(_, RayLimit::Miss | RayLimit::Equator) => {
            "Rays beyond miss this surface. Click to select it."
        }
        PupilLimit::Surface(_, RayLimit::TotalReflection) => {
            "Rays beyond are totally reflected at this surface. Click to select it."
        }
        PupilLimit::Surface(_, RayLimit::Side) => {
            "Rays beyond leave the GRIN medium in front of this surface through its side."
        }
        PupilLimit::Unaimed => "No ray beyond reaches the stop.",
    }
}

impl PupilView<'_> {
    /// The field above a picture.
    pub(super) fn title(&self, ui: &mut Ui, field: usize) {
        let fields = self.results.lens.fields_at(self.results.settings.zoom);
        let Some(point) = fields.values.get(field) else { return };
        ui.strong(field_name(fields.kind, *point));
    }

    /// The numbers below a picture.
    pub(super) fn numbers(&self, ui: &mut Ui, field: usize) {
        ui.spacing_mut().item_spacing.y = 1.0;
        ui.spacing_mut().interact_size.y = 0.0;
        let pupil = &self.pupils.fields[field];
        if let Some(light) = &pupil.value.extent {
            self.area(ui, &pupil.value, light);
        }
        match &pupil.value.shape {
            PupilShape::Outlined(outline) => self.shares(ui, outline),
            PupilShape::Irregular { pieces, .. } => {
                let text = format!("irregular: {}", pieces_text(*pieces));
                ui.label(RichText::new(text).small().color(ui.visuals().warn_fg_color))
                    .on_hover_text(
                        "The edge is not visible from any one point and cannot be followed: dots \
                         are rays of a grid that get through, and the area is that of a dense \
                         sample of rays.",
                    );
            }
            PupilShape::Dark(_) | PupilShape::Unbounded | PupilShape::NoRays(_) => {}
        }
        let cost = cost_text(pupil.value.rays, pupil.ms);
        ui.label(RichText::new(cost).small().weak())
            .on_hover_text("Rays traced for outline and numbers, and the time");
    }

    fn area(&self, ui: &mut Ui, pupil: &FieldPupil, light: &PupilExtent) {
        let small = |text: String| RichText::new(text).small();
        let [x, y] = light.centroid.map(|c| number::format_digits(c.value, 4));
        ui.label(small(area_text(light.area))).on_hover_text(format!(
            "Area of what gets through. Its centroid: x {x} mm, y {y} mm from the axis."
        ));
        let share = self.pupils.axis.and_then(|axis| pupil.share_of(axis));
        if let Some(share) = share {
            ui.label(small(share_text(share))).on_hover_text(
                "Area over that of the pupil on the axis, both seen in the same way",
            );
        }
    }

    /// The limits of the pupil with their shares of its edge.
    fn shares(&self, ui: &mut Ui, outline: &PupilOutline) {
        let palette = Palette::for_visuals(ui.visuals());
        ui.horizontal_wrapped(|ui| {
            ui.spacing_mut().item_spacing = vec2(GAP, 1.0);
            for (limit, share) in outline.limits_by_share() {
                let long =
                    format!("{}: {:.1} % of the edge", self.limit_name(limit), 100.0 * share);
                let text = self.share(outline, limit, share);
                limit_label(ui, self.limit_color(&palette, limit), text)
                    .on_hover_text(capitalize(&long));
            }
        });
    }

    /// The number of lines of this width that the shares of a pupil take.
    pub(super) fn lines(&self, ui: &Ui, pupil: &FieldPupil, width: f32) -> usize {
        let wrapped = self.wrapped_lines(ui, pupil, width);
        let PupilShape::Outlined(outline) = &pupil.shape else { return 1 + wrapped };
        let (mut lines, mut used) = (1 + wrapped, 0.0);
        for (limit, share) in outline.limits_by_share() {
            let text = galley(ui, self.share(outline, limit, share), &TextStyle::Small);
            let long = MARK + text.size().x;
            if used > 0.0 && used + long > width {
                (lines, used) = (lines + 1, 0.0);
            }
            used += long + GAP;
        }
        lines
    }

    /// The lines that area, share and rays of a pupil take beyond one each.
    fn wrapped_lines(&self, ui: &Ui, pupil: &FieldPupil, width: f32) -> usize {
        let area = pupil.extent.as_ref().map(|light| area_text(light.area));
        let share = self.pupils.axis.and_then(|axis| pupil.share_of(axis)).map(share_text);
        let texts = area.into_iter().chain(share).chain([cost_text(pupil.rays, 999.99)]);
        let font = TextStyle::Small.resolve(ui.style());
        let rows = |text: String| {
            let color = ui.visuals().text_color();
            ui.painter().layout(text, font.clone(), color, width).rows.len()
        };
        texts.map(|text| rows(text).saturating_sub(1)).sum()
    }

    /// One limit with its share, as short as can be.
    fn share(&self, outline: &PupilOutline, limit: PupilLimit, share: f64) -> String {
        let who = match limit {
            PupilLimit::Disc if outline.is_clear() => return "clear disc".to_owned(),
            PupilLimit::Disc => "pupil".to_owned(),
            PupilLimit::Surface(i, RayLimit::Rim) if i == self.ray_model().stop() => {
                "stop".to_owned()
            }
            PupilLimit::Surface(i, RayLimit::Rim) => (i + 1).to_string(),
            PupilLimit::Surface(i, RayLimit::Obstruction) => format!("{} obstructs", i + 1),
            PupilLimit::Surface(i, RayLimit::Aperture(_)) => format!("{} aperture", i + 1),
            PupilLimit::Surface(i, RayLimit::Obscuration(_)) => format!("{} obscures", i + 1),
            PupilLimit::Surface(i, RayLimit::Miss | RayLimit::Equator) => {
                format!("{} missed", i + 1)
            }
            PupilLimit::Surface(i, RayLimit::TotalReflection) => format!("{} TIR", i + 1),
            PupilLimit::Surface(i, RayLimit::Side) => format!("side before {}", i + 1),
            PupilLimit::Unaimed => "unaimed".to_owned(),
        };
        format!("{who} {:.0} %", 100.0 * share)
    }

    /// Shows why a pupil cannot be drawn.
    pub(super) fn message(&self, ui: &mut Ui, picture: Rect, pupil: &FieldPupil) {
        let text = match &pupil.shape {
            PupilShape::Outlined(_) | PupilShape::Irregular { .. } => return,
            PupilShape::Dark(loss) => self.missing_light_text(loss),
            PupilShape::Unbounded => {
                "No beam: nothing limits it. Give the stop a semi-diameter.".to_owned()
            }
            PupilShape::NoRays(why) => format!("No rays: {why}."),
        };
        show_within(ui, picture.shrink(6.0), |ui| {
            ui.with_layout(Arrange::top_down(Align::Min), |ui| {
                ui.label(RichText::new(text).color(ui.visuals().warn_fg_color));
            });
        });
    }

    fn missing_light_text(&self, loss: &RayLoss) -> String {
        let Some((fate, surface)) = loss.main_fate.and_then(|fate| Some((fate, fate.surface()?)))
        else {
            return "No light: no ray can be started. Give the stop a size.".to_owned();
        };
        if self.ray_model().stop_radius() == 0.0 {
            return "No light: the stop has no size. Give it a semi-diameter.".to_owned();
        }
        let surface = surface + 1;
        let (what, repair) = match fate {
            Fate::Clipped(_) => ("clips", "Make its semi-diameter larger or the field smaller."),
            Fate::Missed(_) => ("is missed by", "Bend it less or make the field smaller."),
            Fate::Turned(_) | Fate::Trapped(_) => {
                ("is not reached through the GRIN medium by", "Weaken the index gradient.")
            }
            Fate::TotalReflection(_) | Fate::Imaged => {
                ("totally reflects", "Bend it less or make the field smaller.")
            }
        };
        let chief = if loss.includes_chief { ", the chief ray among them" } else { "" };
        format!(
            "No light: surface {surface} {what} {} of {} rays{chief}. {repair}",
            loss.count, loss.rays
        )
    }

    /// The accessible description of a pupil.
    pub(super) fn summary(&self, pupil: &FieldPupil) -> String {
        match &pupil.shape {
            PupilShape::Outlined(outline) if outline.is_clear() => "clear disc".to_owned(),
            PupilShape::Outlined(outline) => {
                let part = |(limit, share): (PupilLimit, f64)| {
                    format!("{} {:.0} %", self.limit_name(limit), 100.0 * share)
                };
                outline.limits_by_share().into_iter().map(part).collect::<Vec<_>>().join(", ")
            }
            PupilShape::Irregular { pieces, .. } => format!("irregular, {}", pieces_text(*pieces)),
            PupilShape::Dark(_) => "no light".to_owned(),
            PupilShape::Unbounded => "unbounded".to_owned(),
            PupilShape::NoRays(_) => "no rays".to_owned(),
        }
    }

    /// The description of the side under the pointer.
    pub(super) fn describe(&self, pupil: &FieldPupil, limit: PupilLimit) -> String {
        let PupilShape::Outlined(outline) = &pupil.shape else {
            return capitalize(&self.limit_name(limit));
        };
        let sides = outline.sides.iter().filter(|side| side.limit == limit);
        let length: f64 = sides.map(|side| side.length).sum();
        format!(
            "{}: {:.1} % of the edge, {} mm long\n{}",
            capitalize(&self.limit_name(limit)),
            100.0 * outline.share(limit),
            number::format_digits(length, 4),
            hint(limit)
        )
    }
}

/// Words, not yet in the window.
fn galley(ui: &Ui, text: String, style: &TextStyle) -> Arc<Galley> {
    let font = style.resolve(ui.style());
    ui.painter().layout_no_wrap(text, font, ui.visuals().text_color())
}

/// Small words with a square in front that no end of a line parts from them.
fn limit_label(ui: &mut Ui, color: Color32, text: String) -> Response {
    let words = galley(ui, text, &TextStyle::Small);
    let (rect, response) = ui.allocate_exact_size(words.size() + vec2(MARK, 0.0), Sense::hover());
    response.widget_info(|| WidgetInfo::labeled(Role::Label, true, words.text()));
    paint_marked(ui, rect, color, words);
    response
}

/// The same as a button that may be chosen.
pub(super) fn limit_button(ui: &mut Ui, color: Color32, text: String, chosen: bool) -> Response {
    let words = galley(ui, text, &TextStyle::Body);
    let edge = vec2(4.0, 2.0);
    let size = words.size() + vec2(MARK, 0.0) + 2.0 * edge;
    let (rect, response) = ui.allocate_exact_size(size, Sense::click());
    let info = || WidgetInfo::selected(Role::Button, true, chosen, words.text());
    response.widget_info(info);
    let visuals = ui.style().interact_selectable(&response, chosen);
    if chosen || response.hovered() || response.has_focus() {
        ui.painter().rect_filled(rect, visuals.corner_radius, visuals.weak_bg_fill);
    }
    paint_marked(ui, rect.shrink2(edge), color, words);
    response
}

fn paint_marked(ui: &Ui, rect: Rect, color: Color32, words: Arc<Galley>) {
    let mark = Rect::from_center_size(rect.left_center() + vec2(4.5, 0.0), Vec2::splat(8.0));
    ui.painter().rect_filled(mark, 1.0, color);
    ui.painter().galley(rect.min + vec2(MARK, 0.0), words, ui.visuals().text_color());
}

fn pieces_text(pieces: usize) -> String {
    if pieces == 1 { "edge not followed".to_owned() } else { format!("{pieces} pieces") }
}

/// The rays of a pupil and their time.
fn cost_text(rays: usize, ms: f64) -> String {
    format!("{}, {ms:.2} ms", counted(rays as u64, "ray"))
}

/// An area with its relative error, in m² where mm² would be too many.
fn area_text(area: Estimate) -> String {
    let (value, unit) =
        if area.value < 1e6 { (area.value, "mm²") } else { (1e-6 * area.value, "m²") };
    format!("{} {unit}{}", number::format_digits(value, 4), relative_error(area))
}

/// A share of the axis in percent with its error, which is in percent of the axis too.
fn share_text(share: Estimate) -> String {
    let value = number::format_digits(100.0 * share.value, 4);
    if !number::is_error(share.value, share.error) {
        return format!("{value} % of axis");
    }
    format!("{value} % {} of axis", percent_error(100.0 * share.error))
}
