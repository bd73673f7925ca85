//! Handles by the keyboard: arrow keys step the one with the focus, digits type its value, Enter and
//! leaving it end the drag, Escape takes it back.

use std::sync::Arc;

use egui::{Event, EventFilter, Key, Response, Ui};
use glam::DVec2;

use super::{
    FINE, GrabbedBy, HandleFrame, HandleLayer, KEY_STEP, moved_handle, push_drag, start_value,
    with_places,
};
use crate::math::expression::{ParseNumberError, evaluate};
use crate::paraxial::{Handle, HandleUnit};
use crate::session::AnalysisResults;
use crate::studio::actions::Actions;
use crate::studio::number;

/// The characters that begin or continue a typed value.
const VALUE_CHARACTERS: &str = "0123456789.+-*/()eEinfINF ";

/// The keys that the handle keeps to itself.
const KEPT_KEYS: EventFilter =
    EventFilter { tab: false, horizontal_arrows: true, vertical_arrows: true, escape: true };

impl HandleLayer {
    /// Carries out the keys of the handle that is dragged or has the focus.
    pub(super) fn move_by_keys(
        &mut self,
        ui: &Ui,
        frame: &HandleFrame<'_>,
        results: &Arc<AnalysisResults>,
        (handle, response): (Handle, &Response),
        actions: &mut Actions,
    ) {
        if !response.has_focus() {
            if self.holds(handle) == Some(GrabbedBy::Keys) {
                self.finish(actions);
            }
            return;
        }
        ui.memory_mut(|memory| memory.set_focus_lock_filter(response.id, KEPT_KEYS));
        self.type_value(ui, frame, results, handle, actions);
        let step = arrow_motion(ui);
        if step != DVec2::ZERO && self.typed.is_none() {
            self.step(ui, frame, results, (moved_handle(ui, handle), step), actions);
        }
        if ui.input(|input| input.key_pressed(Key::Escape)) {
            self.escape(response, actions);
        }
    }

    /// Discards the typed text, or else takes the drag back, or else leaves the handle.
    fn escape(&mut self, response: &Response, actions: &mut Actions) {
        if self.typed.take().is_some() {
            // The toolkit has let go of the pointer; the keys may go on.
            if let Some(grabbed) = &mut self.grabbed {
                grabbed.by = GrabbedBy::Keys;
            }
            return;
        }
        if self.grabbed.is_some() {
            self.cancel(actions);
        } else {
            response.surrender_focus();
        }
    }

    fn step(
        &mut self,
        ui: &Ui,
        frame: &HandleFrame<'_>,
        results: &Arc<AnalysisResults>,
        (handle, step): (Handle, DVec2),
        actions: &mut Actions,
    ) {
        if self.grabbed.is_none() {
            self.grab(handle, results, GrabbedBy::Keys);
        }
        let Some(grabbed) = &mut self.grabbed else { return };
        if grabbed.by == GrabbedBy::Released {
            return;
        }
        let (lens, zoom) = (&frame.view.lens, frame.view.settings.zoom);
        if handle.unit(lens, zoom) == HandleUnit::Surface {
            // A step of some points would seldom reach the next surface.
            let value = handle.value(lens, zoom).map(|at| at + (step.x + step.y).signum());
            return push_drag(grabbed, value, actions);
        }
        let modifiers = ui.input(|input| input.modifiers);
        let share = if modifiers.shift { FINE } else { 1.0 };
        // Either pair of arrows moves a handle along its only direction.
        let along = if moves_up(handle) { DVec2::Y } else { DVec2::X };
        let points = KEY_STEP * share * (step.x + step.y);
        grabbed.delta += points * frame.shown.mm_per_point() * along;
        let value = grabbed.value(frame, modifiers);
        push_drag(grabbed, value, actions);
    }

    /// Collects the typed text; Enter sets the value and ends the drag.
    fn type_value(
        &mut self,
        ui: &Ui,
        frame: &HandleFrame<'_>,
        results: &Arc<AnalysisResults>,
        handle: Handle,
        actions: &mut Actions,
    ) {
        for event in ui.input(|input| input.events.clone()) {
            match event {
                Event::Text(text) if text.chars().all(|c| VALUE_CHARACTERS.contains(c)) => {
                    self.typed.get_or_insert_default().push_str(&text);
                }
                Event::Key { key: Key::Backspace, pressed: true, .. } => {
                    let _last = self.typed.as_mut().and_then(String::pop);
                }
                Event::Key { key: Key::Enter, pressed: true, .. } => {
                    self.enter(frame, results, handle, actions);
                }
                _ => {}
            }
        }
    }

    /// Takes the typed value, or ends the drag without one.
    fn enter(
        &mut self,
        frame: &HandleFrame<'_>,
        results: &Arc<AnalysisResults>,
        handle: Handle,
        actions: &mut Actions,
    ) {
        let Some(text) = &self.typed else { return self.finish(actions) };
        let before = self.grabbed.as_ref().map_or(results, |grabbed| &grabbed.before);
        let zoom = frame.view.settings.zoom;
        let unit = handle.unit(&before.lens, zoom);
        let old = with_places(before, |places| start_value(places, handle)).unwrap_or(0.0);
        let Ok(value) = typed_value(text, unit, old) else { return };
        let is_dragged = self.grabbed.as_ref().is_some_and(|g| g.by == GrabbedBy::Pointer);
        if self.grabbed.is_none() {
            self.grab(handle, results, GrabbedBy::Keys);
        }
        if let Some(grabbed) = &mut self.grabbed {
            push_drag(grabbed, Some(value), actions);
        }
        self.finish(actions);
        if is_dragged {
            // The button is still down: what it does from now on counts no more.
            self.grab(handle, results, GrabbedBy::Released);
        }
    }
}

/// The value of a typed text, of a curvature from its radius.
pub(super) fn typed_value(text: &str, unit: HandleUnit, old: f64) -> Result<f64, ParseNumberError> {
    match unit {
        HandleUnit::Curvature => {
            let radius = evaluate(text, number::radius(old))?;
            Ok(if radius == 0.0 || radius.is_infinite() { 0.0 } else { 1.0 / radius })
        }
        HandleUnit::Surface => Ok(evaluate(text, old + 1.0)? - 1.0),
        _ => evaluate(text, old),
    }
}

/// True for a handle that moves up and down.
pub(super) const fn moves_up(handle: Handle) -> bool {
    matches!(handle, Handle::Rim(_) | Handle::StopSize | Handle::FieldHeight | Handle::BeamWidth)
}

/// The arrow keys pressed in this frame, as steps to the right and up.
fn arrow_motion(ui: &Ui) -> DVec2 {
    let keys = [
        (Key::ArrowRight, DVec2::X),
        (Key::ArrowLeft, DVec2::NEG_X),
        (Key::ArrowUp, DVec2::Y),
        (Key::ArrowDown, DVec2::NEG_Y),
    ];
    let any = |input: &egui::InputState, key: Key| {
        let is_press = |event: &&Event| matches!(event, Event::Key { key: found, pressed: true, .. } if *found == key);
        input.events.iter().filter(is_press).count() as f64
    };
    ui.input(|input| keys.iter().map(|(key, step)| any(input, *key) * *step).sum())
}
