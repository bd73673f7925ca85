//! Input that arrives in one frame, handed out in the order in which it was typed.
//!
//! egui gives every widget all events of a frame. On a slow machine a number, Enter and the next
//! number arrive together: the field that Enter leads to would then read what was typed before it.
//! A key that moves the cursor or runs a command therefore gets a frame of its own, after what came
//! before it; what comes later waits. So does what follows a button that goes down or up: egui looks for
//! what was pressed where the pointer is at the end of the frame, and a fast drag would begin too late.

use std::collections::VecDeque;

use egui::{Event, Key, RawInput};

/// Input that waits for the next frame.
#[derive(Debug, Default)]
pub struct InputQueue {
    waiting: VecDeque<Event>,
}

impl InputQueue {
    /// Leaves the events before the first key that acts, or that key alone if it is the first, and those
    /// up to the first click of a button; keeps the others for later frames. Returns true if some wait.
    pub fn limit(&mut self, input: &mut RawInput) -> bool {
        self.waiting.extend(input.events.drain(..));
        while let Some(event) =
            self.waiting.pop_front_if(|event| input.events.is_empty() || !acts(event))
        {
            let ends = acts(&event) || matches!(event, Event::PointerButton { .. });
            input.events.push(event);
            if ends {
                break;
            }
        }
        !self.waiting.is_empty()
    }
}

/// True for a key that ends an edit, moves the cursor or runs a command, and for pasted cells.
fn acts(event: &Event) -> bool {
    match event {
        Event::Paste(_) => true,
        Event::Key { key, pressed: true, modifiers, .. } => {
            let moves = matches!(
                key,
                Key::Enter
                    | Key::Tab
                    | Key::Escape
                    | Key::F2
                    | Key::ArrowUp
                    | Key::ArrowDown
                    | Key::ArrowLeft
                    | Key::ArrowRight
                    | Key::PageUp
                    | Key::PageDown
                    | Key::Home
                    | Key::End
                    | Key::Insert
                    | Key::Delete
            );
            moves || modifiers.command
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::{Modifiers, PointerButton, pos2};

    fn press(key: Key) -> Event {
        let modifiers = Modifiers::NONE;
        Event::Key { key, physical_key: None, pressed: true, repeat: false, modifiers }
    }

    #[test]
    fn a_drag_begins_where_the_button_went_down() {
        let moved = |x: f32| Event::PointerMoved(pos2(x, 0.0));
        let button = |x: f32, pressed| {
            let (button, modifiers) = (PointerButton::Primary, Modifiers::NONE);
            Event::PointerButton { pos: pos2(x, 0.0), button, pressed, modifiers }
        };
        let events =
            vec![moved(1.0), button(1.0, true), moved(5.0), moved(9.0), button(9.0, false)];
        let mut input = RawInput { events: events.clone(), ..RawInput::default() };
        let mut queue = InputQueue::default();
        assert!(queue.limit(&mut input));
        assert_eq!(input.events, events[..2]);
        input.events.clear();
        assert!(!queue.limit(&mut input));
        assert_eq!(input.events, events[2..]);
    }

    #[test]
    fn a_key_that_ends_an_edit_has_a_frame_of_its_own() {
        let text = |text: &str| Event::Text(text.to_owned());
        let events = vec![text("9"), text("5"), press(Key::Enter), text("8"), press(Key::Tab)];
        let mut input = RawInput { events: events.clone(), ..RawInput::default() };
        let mut queue = InputQueue::default();
        assert!(queue.limit(&mut input));
        assert_eq!(input.events, events[..2]);
        let mut input = RawInput { events: vec![text("7")], ..RawInput::default() };
        for wanted in [&events[2..3], &events[3..4], &events[4..5]] {
            assert!(queue.limit(&mut input), "what came later stays behind");
            assert_eq!(input.events, wanted);
            input.events.clear();
        }
        assert!(!queue.limit(&mut input));
        assert_eq!(input.events, [text("7")]);
    }
}
