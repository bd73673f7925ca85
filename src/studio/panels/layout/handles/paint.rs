//! Drawing the handles, the arrows of the merit at them, and what a drag does.

use egui::{
    Color32, CornerRadius, FontId, Pos2, Rect, Response, Stroke, StrokeKind, TextStyle, Ui, Vec2,
};

use super::keys::{moves_up, typed_value};
use super::{
    APPEARING_DISTANCE, HandleFrame, HandleLayer, handle_name, start_value, surface_of, value_text,
    with_places,
};
use crate::paraxial::Handle;
use crate::session::{DragProgress, MeritSlopes, SessionView};
use crate::studio::number;

/// The radius of a handle, in points.
const RADIUS: f32 = 4.5;
/// The change of the merit with one point of motion, relative to the merit, at which its arrow has
/// no length, and the length for every factor of ten above it.
const ARROW: (f64, f32) = (1e-4, 7.0); // share, points
/// The largest change of the merit, relative to it, that a hint tells.
const MAX_CHANGE: f64 = 0.1;
/// The greatest length of an arrow, in points.
const MAX_ARROW: f32 = 26.0;

impl HandleLayer {
    /// True if a handle is dragged, has the focus, or the pointer or the selection is at it.
    pub(super) fn is_visible(
        &self,
        ui: &Ui,
        frame: &HandleFrame<'_>,
        handle: Handle,
        response: &Response,
    ) -> bool {
        let surface = surface_of(handle);
        let belongs = surface.is_some_and(|surface| {
            Some(surface) == frame.near || Some(surface) == frame.view.selected
        });
        let pointer = ui.input(|input| input.pointer.hover_pos());
        let is_inside = pointer.is_some_and(|at| frame.shown.response.rect.contains(at));
        let is_near = is_inside
            && pointer.is_some_and(|at| at.distance(response.rect.center()) < APPEARING_DISTANCE);
        // Those of the whole lens are few: they show while the pointer is over the drawing.
        let is_common = surface.is_none() && is_inside;
        self.grabbed.is_some() || response.has_focus() || belongs || is_near || is_common
    }

    pub(super) fn paint(
        &self,
        ui: &Ui,
        frame: &HandleFrame<'_>,
        handle: Handle,
        response: &Response,
    ) {
        let painter = ui.painter_at(frame.shown.response.rect);
        let visuals = ui.visuals();
        let center = response.rect.center();
        let is_active = self.grabbed.is_some() || response.hovered() || response.has_focus();
        let strong = visuals.selection.stroke.color;
        let fill = if is_active { strong } else { visuals.extreme_bg_color };
        let stroke = Stroke::new(1.5, strong);
        match handle {
            Handle::Vertex(_) | Handle::ImagePlane | Handle::StopPosition => {
                let square = Rect::from_center_size(center, Vec2::splat(1.7 * RADIUS));
                painter.rect(square, CornerRadius::ZERO, fill, stroke, StrokeKind::Middle);
            }
            Handle::Element { .. } | Handle::Bending { .. } => {
                let square = Rect::from_center_size(center, Vec2::new(3.4 * RADIUS, 1.7 * RADIUS));
                painter.rect(square, CornerRadius::same(3), fill, stroke, StrokeKind::Middle);
            }
            _ => {
                painter.circle(center, RADIUS, fill, stroke);
            }
        }
        let slopes = current_slopes(frame);
        // Of the surfaces that the pointer only passes the arrows would cover each other.
        let has_arrow = is_active || belongs_to_selection(frame, handle);
        let arrow = slopes.filter(|_| has_arrow);
        let arrow = arrow.and_then(|slopes| merit_arrow(frame, slopes, handle));
        if let Some(arrow) = arrow {
            painter.arrow(
                center + arrow.normalized() * 7.0,
                arrow,
                Stroke::new(2.0, visuals.warn_fg_color),
            );
        }
        if self.grabbed.is_some() || self.typed.is_some() && response.has_focus() {
            self.paint_progress(ui, frame, handle, center);
        } else if response.hovered() || response.has_focus() && self.by_keys {
            let lines = vec![(hint(frame, slopes, handle), visuals.text_color())];
            paint_lines(ui, frame, center, &lines);
        }
    }

    /// The value, what has moved, what the merit does, and why the handle stops.
    fn paint_progress(&self, ui: &Ui, frame: &HandleFrame<'_>, handle: Handle, center: Pos2) {
        let visuals = ui.visuals();
        let (plain, bad) = (visuals.text_color(), visuals.error_fg_color);
        let zoom = frame.view.settings.zoom;
        let mut lines = Vec::new();
        if let Some(typed) = &self.typed {
            let unit = handle.unit(&frame.view.lens, zoom);
            let is_valid = typed_value(typed, unit, 1.0).is_ok();
            let color = if is_valid { visuals.strong_text_color() } else { bad };
            lines.push((format!("{typed}|  Enter to set"), color));
        } else {
            let value = value_text(&frame.view.lens, zoom, handle);
            lines.push((format!("{handle}: {value}"), visuals.strong_text_color()));
        }
        if let Some(progress) = &frame.view.drag.progress {
            lines.extend(progress_lines(progress).map(|text| (text, plain)));
            lines.extend(progress.stop.iter().map(|stop| (format!("stops: {stop}"), bad)));
        }
        lines.extend(frame.view.drag.error.iter().map(|why| (why.clone(), bad)));
        if let Some(slopes) = current_slopes(frame).filter(|_| is_merit_current(frame.view)) {
            lines.push((merit_text(slopes), plain));
        }
        paint_lines(ui, frame, center, &lines);
    }
}

fn progress_lines(progress: &DragProgress) -> impl Iterator<Item = String> {
    progress.moved_text().map(|moved| format!("held by {moved}")).into_iter()
}

/// The merit now, and before the drag.
pub(super) fn merit_text(slopes: &MeritSlopes) -> String {
    let now = number::format_digits(slopes.merit, 4);
    if slopes.merit == slopes.before {
        return format!("merit {now}");
    }
    format!("merit {now}, was {}", number::format_digits(slopes.before, 4))
}

/// True if the merit belongs to the present version of the design.
pub(super) fn is_merit_current(view: &SessionView) -> bool {
    view.drag.slopes.as_ref().is_some_and(|slopes| slopes.version == view.version)
}

/// Lines of text in a box beside a place, inside the drawing.
fn paint_lines(ui: &Ui, frame: &HandleFrame<'_>, at: Pos2, lines: &[(String, Color32)]) {
    let area = frame.shown.response.rect;
    let painter = ui.painter_at(area);
    let font: FontId = TextStyle::Small.resolve(ui.style());
    let width = (area.width() - 40.0).clamp(80.0, 420.0);
    let galleys: Vec<_> = lines
        .iter()
        .map(|(text, color)| painter.layout(text.clone(), font.clone(), *color, width))
        .collect();
    let size = galleys.iter().fold(Vec2::ZERO, |size, galley| {
        Vec2::new(size.x.max(galley.size().x), size.y + galley.size().y)
    });
    let size = size + Vec2::splat(8.0);
    let mut corner = at + Vec2::new(14.0, 12.0);
    corner.x = corner.x.min(area.right() - size.x - 4.0).max(area.left() + 4.0);
    if corner.y + size.y > area.bottom() - 4.0 {
        corner.y = (at.y - 14.0 - size.y).max(area.top() + 4.0);
    }
    let visuals = ui.visuals();
    let stroke = visuals.widgets.noninteractive.bg_stroke;
    let rect = Rect::from_min_size(corner, size);
    painter.rect(rect, CornerRadius::same(3), visuals.window_fill, stroke, StrokeKind::Inside);
    let mut place = corner + Vec2::splat(4.0);
    for galley in galleys {
        let height = galley.size().y;
        painter.galley(place, galley, Color32::PLACEHOLDER);
        place.y += height;
    }
}

/// True for a handle of the selected surface or of the whole lens.
fn belongs_to_selection(frame: &HandleFrame<'_>, handle: Handle) -> bool {
    surface_of(handle).is_none_or(|surface| Some(surface) == frame.view.selected)
}

/// The slopes of the merit, if there are any for a lens like the present one.
fn current_slopes<'a>(frame: &HandleFrame<'a>) -> Option<&'a MeritSlopes> {
    frame.view.drag.slopes.as_ref()?.result.as_ref().ok()
}

/// The change of a handle's value with a millimetre of motion.
fn value_per_mm(frame: &HandleFrame<'_>, handle: Handle) -> Option<f64> {
    let results = frame.view.results.as_ref()?;
    with_places(results, |places| {
        let start = start_value(places, handle)?;
        let step = frame.shown.mm_per_point();
        let delta = if moves_up(handle) { [0.0, step] } else { [step, 0.0] };
        Some((places.value_after(handle, start, delta)? - start) / step)
    })
}

/// The change of the merit with a point of motion, relative to the merit.
fn change_per_point(frame: &HandleFrame<'_>, slopes: &MeritSlopes, handle: Handle) -> Option<f64> {
    let slope = slopes.slope(handle)? * value_per_mm(frame, handle)?;
    let share = slope * frame.shown.mm_per_point() / slopes.merit.abs();
    share.is_finite().then_some(share)
}

/// The arrow towards a smaller merit on the screen.
fn merit_arrow(frame: &HandleFrame<'_>, slopes: &MeritSlopes, handle: Handle) -> Option<Vec2> {
    let share = change_per_point(frame, slopes, handle)?;
    let decades = (share.abs() / ARROW.0).log10();
    if !(decades > 0.3) {
        return None;
    }
    #[expect(clippy::cast_possible_truncation, reason = "a length on the screen")]
    let length = (ARROW.1 * decades as f32).min(MAX_ARROW);
    let sign = if share > 0.0 { -1.0 } else { 1.0 };
    let along = if moves_up(handle) { Vec2::new(0.0, -1.0) } else { Vec2::new(1.0, 0.0) };
    Some(sign * length * along)
}

/// Name, value and slope of a handle.
fn hint(frame: &HandleFrame<'_>, slopes: Option<&MeritSlopes>, handle: Handle) -> String {
    let value = value_text(&frame.view.lens, frame.view.settings.zoom, handle);
    let mut text = format!("{}, {value}", handle_name(handle).trim_start_matches("Handle: "));
    let share = slopes.and_then(|slopes| change_per_point(frame, slopes, handle));
    if share == Some(0.0) {
        text.push_str("\nthe merit does not depend on it");
    } else if let Some(share) = share {
        // A tenth of the way, and so on, until the derivative describes what happens on it.
        let tenths = (share.abs() / MAX_CHANGE).log10().ceil().max(0.0);
        let part = 0.1f64.powf(tenths);
        let (mm, share) = (part * frame.shown.mm_per_point(), part * share);
        let [rising, falling] = if moves_up(handle) {
            ["upwards", "downwards"]
        } else {
            ["to the right", "to the left"]
        };
        let towards = if share > 0.0 { falling } else { rising };
        let change = number::format_digits(100.0 * share.abs(), 2);
        let way = number::format_digits(mm, 2);
        text = format!("{text}\nmerit falls by {change} % with {way} mm {towards}");
    }
    text
}
