//! The words around a pupil: its field, its numbers, and what is wrong where no light gets through.

use std::sync::Arc;

use eframe::egui::{
    Align, Color32, Galley, Layout as Arrange, Rect, Response, RichText, Role, Sense, TextStyle,
    Ui, Vec2, WidgetInfo, vec2,
};

use super::{Shown, within};
use crate::analysis::{Estimate, Form, Light, Loss, Pupil};
use crate::pupil::{Limit, Outline};
use crate::studio::number;
use crate::studio::palette::Palette;
use crate::studio::panels::{field_name, relative_error};
use crate::studio::wording::capital;
use crate::trace::{Fate, Hurdle};

/// The gap between two limits in a line, in points.
const GAP: f32 = 7.0;
/// The room that the square in front of a limit takes.
const MARK: f32 = 12.0;

/// What a limit is, for somebody who points at it.
pub(super) const fn hint(limit: Limit) -> &'static str {
    match limit {
        Limit::Disc => "The beam ends as the aperture of the lens says; no surface clips it there.",
        Limit::Surface(_, Hurdle::Rim) => {
            "The beam ends at the semi-diameter of this surface. Click to point the surface out."
        }
        Limit::Surface(_, Hurdle::Obstruction) => {
            "The obstruction of this surface stops rays nearer to the axis. Click to point it out."
        }
        Limit::Surface(_, Hurdle::Miss | Hurdle::Equator) => {
            "Rays beyond pass by this surface without meeting it. Click to point it out."
        }
        Limit::Surface(_, Hurdle::Reflection) => {
            "Rays beyond are totally reflected at this surface. Click to point it out."
        }
        Limit::Surface(_, Hurdle::Side) => {
            "Rays beyond leave the gradient in front of this surface through its side."
        }
        Limit::Unaimed => "No ray is found beyond that crosses the stop.",
    }
}

impl Shown<'_> {
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
        if let Some(light) = &pupil.value.light {
            self.area(ui, &pupil.value, light);
        }
        match &pupil.value.form {
            Form::Outlined(outline) => self.shares(ui, outline),
            Form::Ragged { pieces, .. } => {
                let text = format!("ragged: {}", torn(*pieces));
                ui.label(RichText::new(text).small().color(ui.visuals().warn_fg_color))
                    .on_hover_text(
                        "No point sees all of the edge, so that it is not followed: dots are rays \
                         of a grid that get through, and the area is what a dense sample of rays \
                         counts.",
                    );
            }
            Form::Dark(_) | Form::Endless | Form::NoRays(_) => {}
        }
        let cost = format!("{} rays, {:.2} ms", pupil.value.rays, pupil.ms);
        ui.label(RichText::new(cost).small().weak())
            .on_hover_text("Rays traced for outline and numbers, and the time it took");
    }

    fn area(&self, ui: &mut Ui, pupil: &Pupil, light: &Light) {
        let small = |text: String| RichText::new(text).small();
        let [x, y] = light.centroid.map(|c| number::show_digits(c.value, 4));
        ui.label(small(square(light.area))).on_hover_text(format!(
            "Area of what gets through. Its centroid: x {x} mm, y {y} mm from the axis."
        ));
        let share = self.pupils.axis.and_then(|axis| pupil.share_of(axis));
        if let Some(share) = share {
            ui.label(small(percent(share))).on_hover_text(
                "Area over that of the pupil on the axis, both seen in the same way",
            );
        }
    }

    /// What limits the pupil and over what share of its edge.
    fn shares(&self, ui: &mut Ui, outline: &Outline) {
        let palette = Palette::of(ui.visuals());
        ui.horizontal_wrapped(|ui| {
            ui.spacing_mut().item_spacing = vec2(GAP, 1.0);
            for (limit, share) in outline.limits() {
                let long = format!("{}: {:.1} % of the edge", self.name(limit), 100.0 * share);
                let text = self.share(outline, limit, share);
                marked(ui, self.color(&palette, limit), text).on_hover_text(capital(&long));
            }
        });
    }

    /// How many lines of such a width the shares of a pupil take.
    pub(super) fn lines(&self, ui: &Ui, pupil: &Pupil, width: f32) -> usize {
        let Form::Outlined(outline) = &pupil.form else { return 1 };
        let (mut lines, mut used) = (1, 0.0);
        for (limit, share) in outline.limits() {
            let text = laid_out(ui, self.share(outline, limit, share), &TextStyle::Small);
            let long = MARK + text.size().x;
            if used > 0.0 && used + long > width {
                (lines, used) = (lines + 1, 0.0);
            }
            used += long + GAP;
        }
        lines
    }

    /// One limit with its share, as short as can be.
    fn share(&self, outline: &Outline, limit: Limit, share: f64) -> String {
        let who = match limit {
            Limit::Disc if outline.is_clear() => return "clear disc".to_owned(),
            Limit::Disc => "pupil".to_owned(),
            Limit::Surface(i, Hurdle::Rim) if i == self.bench().stop() => "stop".to_owned(),
            Limit::Surface(i, Hurdle::Rim) => (i + 1).to_string(),
            Limit::Surface(i, Hurdle::Obstruction) => format!("{} obstructs", i + 1),
            Limit::Surface(i, Hurdle::Miss | Hurdle::Equator) => format!("{} missed", i + 1),
            Limit::Surface(i, Hurdle::Reflection) => format!("{} TIR", i + 1),
            Limit::Surface(i, Hurdle::Side) => format!("side before {}", i + 1),
            Limit::Unaimed => "unaimed".to_owned(),
        };
        format!("{who} {:.0} %", 100.0 * share)
    }

    /// What stands in a picture in which there is nothing to draw.
    pub(super) fn message(&self, ui: &mut Ui, picture: Rect, pupil: &Pupil) {
        let text = match &pupil.form {
            Form::Outlined(_) | Form::Ragged { .. } => return,
            Form::Dark(loss) => self.why_dark(loss),
            Form::Endless => {
                "No beam: nothing limits it. Give the stop a semi-diameter.".to_owned()
            }
            Form::NoRays(why) => format!("No rays: {why}."),
        };
        within(ui, picture.shrink(6.0), |ui| {
            ui.with_layout(Arrange::top_down(Align::Min), |ui| {
                ui.label(RichText::new(text).color(ui.visuals().warn_fg_color));
            });
        });
    }

    fn why_dark(&self, loss: &Loss) -> String {
        let Some((fate, surface)) = loss.most.and_then(|fate| Some((fate, fate.surface()?))) else {
            return "Dark: no ray can be started. Give the stop a size.".to_owned();
        };
        if self.bench().stop_radius() == 0.0 {
            return "Dark: the stop has no size. Give it a semi-diameter.".to_owned();
        }
        let surface = surface + 1;
        let (what, repair) = match fate {
            Fate::Clipped(_) => ("clips", "Make its semi-diameter larger or the field smaller."),
            Fate::Missed(_) => ("is missed by", "Bend it less or make the field smaller."),
            Fate::Turned(_) | Fate::Trapped(_) => {
                ("is not reached through the gradient by", "Weaken the gradient.")
            }
            Fate::TotalReflection(_) | Fate::Imaged => {
                ("totally reflects", "Bend it less or make the field smaller.")
            }
        };
        let chief = if loss.chief { ", the chief ray among them" } else { "" };
        format!(
            "Dark: surface {surface} {what} {} of {} rays{chief}. {repair}",
            loss.ended, loss.rays
        )
    }

    /// What a screen reader says about a pupil.
    pub(super) fn summary(&self, pupil: &Pupil) -> String {
        match &pupil.form {
            Form::Outlined(outline) if outline.is_clear() => "clear disc".to_owned(),
            Form::Outlined(outline) => {
                let part = |(limit, share): (Limit, f64)| {
                    format!("{} {:.0} %", self.name(limit), 100.0 * share)
                };
                outline.limits().into_iter().map(part).collect::<Vec<_>>().join(", ")
            }
            Form::Ragged { pieces, .. } => format!("ragged, {}", torn(*pieces)),
            Form::Dark(_) => "dark".to_owned(),
            Form::Endless => "endless".to_owned(),
            Form::NoRays(_) => "no rays".to_owned(),
        }
    }

    /// What is said about the side under the pointer.
    pub(super) fn describe(&self, pupil: &Pupil, limit: Limit) -> String {
        let Form::Outlined(outline) = &pupil.form else { return capital(&self.name(limit)) };
        let sides = outline.sides.iter().filter(|side| side.limit == limit);
        let length: f64 = sides.map(|side| side.length).sum();
        format!(
            "{}: {:.1} % of the edge, {} mm long\n{}",
            capital(&self.name(limit)),
            100.0 * outline.share(limit),
            number::show_digits(length, 4),
            hint(limit)
        )
    }
}

/// Words, not yet in the window.
fn laid_out(ui: &Ui, text: String, style: &TextStyle) -> Arc<Galley> {
    let font = style.resolve(ui.style());
    ui.painter().layout_no_wrap(text, font, ui.visuals().text_color())
}

/// Small words with a square in front that no end of a line parts from them.
fn marked(ui: &mut Ui, color: Color32, text: String) -> Response {
    let words = laid_out(ui, text, &TextStyle::Small);
    let (rect, response) = ui.allocate_exact_size(words.size() + vec2(MARK, 0.0), Sense::hover());
    response.widget_info(|| WidgetInfo::labeled(Role::Label, true, words.text()));
    paint_marked(ui, rect, color, words);
    response
}

/// The same as a button that may be chosen.
pub(super) fn entry(ui: &mut Ui, color: Color32, text: String, chosen: bool) -> Response {
    let words = laid_out(ui, text, &TextStyle::Body);
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

fn torn(pieces: usize) -> String {
    if pieces == 1 { "edge not followed".to_owned() } else { format!("{pieces} pieces") }
}

/// An area with its relative error, in m² where mm² would be too many.
fn square(area: Estimate) -> String {
    let (value, unit) =
        if area.value < 1e6 { (area.value, "mm²") } else { (1e-6 * area.value, "m²") };
    format!("{} {unit}{}", number::show_digits(value, 4), relative_error(area))
}

/// A share with its error in percent.
fn percent(share: Estimate) -> String {
    let value = number::show_digits(100.0 * share.value, 4);
    format!("{value} % of the axis{}", relative_error(share))
}
