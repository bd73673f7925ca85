//! The handles of the lens in the layout: drag one, step it with the arrow keys, or type its value.
//!
//! A handle is drawn while the pointer is near it or its surface, and while its surface is selected.
//! The arrow at it shows in which direction the merit falls.

mod keys;
mod locks;
mod paint;

pub(super) use locks::locks_row;

use std::sync::Arc;

use egui::{Event, Id, Modifiers, Pos2, Rect, Response, Sense, Ui, Vec2, WidgetInfo};
use glam::DVec2;

use super::{LayoutDrawing, displayed_results};
use crate::lens::{Lens, LensSection};
use crate::paraxial::{Handle, HandlePlaces, HandleUnit};
use crate::session::{AnalysisResults, Command, SessionView};
use crate::studio::actions::Actions;
use crate::studio::draw::{SceneResponse, round_length_below};
use crate::studio::number;

/// The side of the square in which the pointer picks a handle, in points.
const HIT_SIZE: f32 = 18.0;
/// The distance in points within which a handle appears at the pointer.
const APPEARING_DISTANCE: f32 = 16.0;
/// The part of a motion that counts while Shift is held.
const FINE: f64 = 0.1;
/// The motion of an arrow key, in points.
const KEY_STEP: f64 = 4.0;
/// The least distance of the values to which a handle snaps, in points of motion.
const SNAP_STEP: f64 = 8.0;
/// The radius in mm from which on a surface snaps to a plane.
const PLANE_RADIUS: f64 = 1e5;

/// The handles over the drawing of a lens.
#[derive(Debug, Default)]
pub(super) struct HandleLayer {
    grabbed: Option<GrabbedHandle>,
    /// The text that is being typed in place of a value.
    typed: Option<String>,
    /// True if a key was the last to act, and not the pointer.
    by_keys: bool,
}

/// The handle that is being dragged or stepped, with the lens as it was before.
#[derive(Debug)]
struct GrabbedHandle {
    handle: Handle,
    before: Arc<AnalysisResults>,
    /// The motion so far, in mm.
    delta: DVec2,
    by: GrabbedBy,
}

/// The device that moves a handle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum GrabbedBy {
    Pointer,
    Keys,
    /// The pointer, whose motion counts no more because a value was typed.
    Released,
}

/// The drawing with its handles in one frame.
pub(super) struct HandleFrame<'a> {
    pub(super) view: &'a SessionView,
    pub(super) shown: &'a SceneResponse,
    pub(super) drawing: &'a LayoutDrawing,
    /// The surface under the pointer.
    pub(super) near: Option<usize>,
}

impl HandleLayer {
    /// The results of the lens before the drag, which are drawn faintly below it.
    pub(super) fn before(&self) -> Option<&Arc<AnalysisResults>> {
        self.grabbed.as_ref().map(|grabbed| &grabbed.before)
    }

    /// True while a value is typed.
    pub(super) const fn is_typing(&self) -> bool {
        self.typed.is_some()
    }

    /// Shows the handles of the design and translates their motion.
    pub(super) fn ui(&mut self, ui: &Ui, frame: &HandleFrame<'_>, actions: &mut Actions) {
        let Some((results, _)) = displayed_results(frame.view) else { return };
        if frame.view.preview_results.is_some() {
            self.grabbed = None;
            return;
        }
        self.forget_finished(frame.view);
        self.by_keys = (self.by_keys || is_key_pressed(ui)) && !is_pointer_used(ui);
        for (handle, place) in self.handles(ui, frame) {
            let response = self.interact(ui, frame, handle, place);
            self.move_by_pointer(ui, frame, results, (handle, &response), actions);
            self.move_by_keys(ui, frame, results, (handle, &response), actions);
            if self.is_visible(ui, frame, handle, &response) {
                self.paint(ui, frame, handle, &response);
            }
        }
    }

    /// The handles of this frame with their places on the screen, those under the pointer last, so that
    /// the nearest lies on top; while one is dragged, that one alone. The Tab key goes through the others
    /// in the order of the lens, wherever the pointer rests.
    fn handles(&self, ui: &Ui, frame: &HandleFrame<'_>) -> Vec<(Handle, Pos2)> {
        let place = |(handle, mm): &(Handle, DVec2)| (*handle, frame.shown.to_screen(*mm));
        let all = frame.drawing.handles.iter().map(place);
        if let Some(grabbed) = &self.grabbed {
            return all.filter(|(handle, _)| *handle == grabbed.handle).collect();
        }
        let is_offered = |(handle, at): &(Handle, Pos2)| {
            let is_own = !matches!(handle, Handle::Bending { .. });
            is_own && frame.shown.response.rect.contains(*at)
        };
        let mut offered: Vec<_> = all.filter(is_offered).collect();
        if let Some(pointer) = ui.input(|input| input.pointer.latest_pos()) {
            let distance = |at: Pos2| {
                let distance = at.distance(pointer);
                if distance < HIT_SIZE { distance } else { f32::INFINITY }
            };
            offered.sort_by(|a, b| distance(b.1).total_cmp(&distance(a.1)));
        }
        offered
    }

    fn interact(&self, ui: &Ui, frame: &HandleFrame<'_>, handle: Handle, place: Pos2) -> Response {
        let rect = Rect::from_center_size(place, Vec2::splat(HIT_SIZE));
        // The Tab key stops at the handles of the selected surface and at those of the whole lens.
        let id = handle_id(handle);
        let is_used = self.grabbed.is_some() || ui.memory(|memory| memory.has_focus(id));
        let is_stop = is_used
            || surface_of(handle).is_none_or(|surface| Some(surface) == frame.view.selected);
        let sense = if is_stop { Sense::click_and_drag() } else { Sense::CLICK | Sense::DRAG };
        let response = ui.interact(rect, id, sense);
        let value = value_text(&frame.view.lens, frame.view.settings.zoom, handle);
        response.widget_info(|| {
            let mut info = WidgetInfo::labeled(egui::Role::Slider, true, handle_name(handle));
            info.current_text_value = Some(value.clone());
            info
        });
        response
    }

    /// Ends what the session has ended, for instance by an undo.
    fn forget_finished(&mut self, view: &SessionView) {
        let goes_on = view.drag.progress.is_some();
        let begun = self.grabbed.as_ref().is_some_and(|grabbed| grabbed.delta != DVec2::ZERO);
        if !goes_on && begun && self.grabbed.as_ref().is_some_and(|g| g.by == GrabbedBy::Keys) {
            self.grabbed = None;
            self.typed = None;
        }
    }

    /// The device that moves a handle; `None` for one that is not grabbed.
    fn holds(&self, handle: Handle) -> Option<GrabbedBy> {
        let grabbed = self.grabbed.as_ref()?;
        (handle_id(grabbed.handle) == handle_id(handle)).then_some(grabbed.by)
    }

    fn grab(&mut self, handle: Handle, results: &Arc<AnalysisResults>, by: GrabbedBy) {
        let before = Arc::clone(results);
        self.grabbed = Some(GrabbedHandle { handle, before, delta: DVec2::ZERO, by });
        self.typed = None;
    }

    fn move_by_pointer(
        &mut self,
        ui: &Ui,
        frame: &HandleFrame<'_>,
        results: &Arc<AnalysisResults>,
        (handle, response): (Handle, &Response),
        actions: &mut Actions,
    ) {
        if response.clicked() {
            response.request_focus();
            if let Some(surface) = surface_of(handle) {
                actions.push(Command::Select(Some(surface)));
            }
        }
        if response.drag_started() {
            self.finish(actions);
            self.grab(moved_handle(ui, handle), results, GrabbedBy::Pointer);
            response.request_focus();
        }
        let is_held = self.holds(handle).is_some_and(|by| by != GrabbedBy::Keys);
        if !is_held {
            return;
        }
        if response.dragged() && self.typed.is_none() {
            // A drag begins some points after the button was pressed: those count, too.
            let motion = response.drag_delta();
            let motion = if response.drag_started() {
                response.total_drag_delta().unwrap_or(motion)
            } else {
                motion
            };
            self.follow(ui, frame, motion, actions);
        }
        // The Escape key ends a drag in the toolkit, too: it is handled with the other keys.
        let is_escaped = ui.input(|input| input.key_pressed(egui::Key::Escape));
        if response.drag_stopped() && !is_escaped {
            self.finish(actions);
        }
    }

    /// Moves the handle by a motion of the pointer.
    fn follow(&mut self, ui: &Ui, frame: &HandleFrame<'_>, motion: Vec2, actions: &mut Actions) {
        let Some(grabbed) = &mut self.grabbed else { return };
        if motion == Vec2::ZERO || grabbed.by != GrabbedBy::Pointer {
            return;
        }
        let modifiers = ui.input(|input| input.modifiers);
        let share = if modifiers.shift { FINE } else { 1.0 };
        let points = DVec2::new(motion.x.into(), -f64::from(motion.y));
        grabbed.delta += share * frame.shown.mm_per_point() * points;
        let value = grabbed.value(frame, modifiers);
        push_drag(grabbed, value, actions);
    }

    /// Ends the drag, which becomes one undo step.
    fn finish(&mut self, actions: &mut Actions) {
        if self.grabbed.take().is_some() {
            actions.push(Command::EndDrag);
        }
        self.typed = None;
    }

    fn cancel(&mut self, actions: &mut Actions) {
        if self.grabbed.take().is_some() {
            actions.push(Command::CancelDrag);
        }
        self.typed = None;
    }
}

impl GrabbedHandle {
    /// The value after the motion so far.
    fn value(&self, frame: &HandleFrame<'_>, modifiers: Modifiers) -> Option<f64> {
        let zoom = self.before.settings.zoom;
        with_places(&self.before, |places| {
            let start = start_value(places, self.handle)?;
            let value = places.value_after(self.handle, start, self.delta.into())?;
            if !modifiers.command {
                return Some(value);
            }
            let point = frame.shown.mm_per_point() * SNAP_STEP;
            let near = self.delta + DVec2::splat(point);
            let other = places.value_after(self.handle, start, near.into())?;
            Some(snapped(self.handle.unit(&self.before.lens, zoom), value, other))
        })
    }
}

fn is_key_pressed(ui: &Ui) -> bool {
    let is_press = |event: &Event| matches!(event, Event::Key { pressed: true, .. });
    ui.input(|input| input.events.iter().any(is_press))
}

fn is_pointer_used(ui: &Ui) -> bool {
    ui.input(|input| input.pointer.delta() != Vec2::ZERO || input.pointer.any_pressed())
}

fn push_drag(grabbed: &GrabbedHandle, value: Option<f64>, actions: &mut Actions) {
    let rim = with_places(&grabbed.before, |places| start_value(places, grabbed.handle));
    if let Some(value) = value {
        actions.push(Command::DragHandle { handle: grabbed.handle, value, rim });
    }
}

/// Calls a function with the places of the handles of an analysed lens.
fn with_places<T>(
    results: &AnalysisResults,
    function: impl FnOnce(&HandlePlaces<'_>) -> Option<T>,
) -> Option<T> {
    let analyses = results.analyses.as_ref().ok()?;
    let model = &analyses.ray_model.value;
    let system = &model.channels[model.primary].system;
    let section = &LensSection::new(system, &analyses.layout.value.ray_heights);
    let (lens, zoom) = (&*results.lens, results.settings.zoom);
    function(&HandlePlaces { lens, zoom, section, first_order: analyses.first_order() })
}

/// The places of all handles of a lens in its drawing, in mm.
pub(super) fn handle_places(results: &AnalysisResults) -> Vec<(Handle, DVec2)> {
    let places = with_places(results, |places| {
        let all = Handle::all(places.lens, places.zoom).into_iter();
        Some(all.filter_map(|handle| Some((handle, places.place(handle)?.into()))).collect())
    });
    places.unwrap_or_default()
}

/// The value of a handle, of a rim without one the height to which its surface is drawn.
fn start_value(places: &HandlePlaces<'_>, handle: Handle) -> Option<f64> {
    handle.value(places.lens, places.zoom).or_else(|| match handle {
        Handle::Rim(_) => Some(places.place(handle)?[1]),
        _ => None,
    })
}

/// The round value nearest to a value; `other` is one a few points of motion away.
fn snapped(unit: HandleUnit, value: f64, other: f64) -> f64 {
    match unit {
        HandleUnit::Surface => value,
        HandleUnit::Curvature => {
            let radius = number::radius(value);
            if radius.abs() > PLANE_RADIUS {
                return 0.0;
            }
            // A few points of motion are more than the radius of a weakly curved surface.
            let moved = ((other - value) * radius * radius).abs().min(radius.abs());
            let step = round_length_below(moved);
            1.0 / ((radius / step).round() * step)
        }
        _ => {
            let step = round_length_below((other - value).abs());
            (value / step).round() * step
        }
    }
}

/// The surface to which a handle belongs; `None` for those of the whole lens.
fn surface_of(handle: Handle) -> Option<usize> {
    match handle {
        Handle::Vertex(surface) | Handle::Curvature(surface) | Handle::Rim(surface) => {
            Some(surface)
        }
        Handle::Element { front, .. } | Handle::Bending { front, .. } => Some(front),
        _ => None,
    }
}

fn handle_name(handle: Handle) -> String {
    format!("Handle: {handle}")
}

/// The handle that moves: the Alt key bends an element instead of moving it.
fn moved_handle(ui: &Ui, handle: Handle) -> Handle {
    match handle {
        Handle::Element { front, back } if ui.input(|input| input.modifiers.alt) => {
            Handle::Bending { front, back }
        }
        _ => handle,
    }
}

/// The place of a handle in the toolkit, which the two of an element share.
fn handle_id(handle: Handle) -> Id {
    let handle = match handle {
        Handle::Bending { front, back } => Handle::Element { front, back },
        _ => handle,
    };
    Id::unique(("layout handle", handle))
}

/// The value of a handle as it is read.
fn value_text(lens: &Lens, zoom: usize, handle: Handle) -> String {
    let unit = handle.unit(lens, zoom);
    handle.value(lens, zoom).map_or_else(String::new, |value| text_of(unit, value))
}

/// A value with its unit; a curvature as a radius.
fn text_of(unit: HandleUnit, value: f64) -> String {
    match unit {
        HandleUnit::Curvature => {
            format!("radius {} mm", number::format_digits(number::radius(value), 6))
        }
        HandleUnit::Length => format!("{} mm", number::format_digits(value, 6)),
        HandleUnit::Angle => format!("{}°", number::format_digits(value, 6)),
        HandleUnit::Number => number::format_digits(value, 6),
        HandleUnit::Surface => format!("surface {}", value + 1.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A few points of motion change a weak curvature by more than itself.
    #[test]
    fn a_long_radius_snaps_to_a_round_one() {
        for (change, round) in [(1e-3, 75.0), (0.05, 50.0), (10.0, 50.0)] {
            let value = 1.0 / 73.6;
            let radius = 1.0 / snapped(HandleUnit::Curvature, value, value + change);
            assert!((radius - round).abs() < 1e-9, "{change}: {radius}");
        }
    }
}
