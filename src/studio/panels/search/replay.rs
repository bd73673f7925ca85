//! The mutations that led to a lens, one after the other, slow enough to be seen.

use std::time::Duration;

use egui::{DragValue, Ui};

use crate::session::StructureSearchSnapshot;

/// The range of the time for which each lens is shown, in seconds.
const PACE: std::ops::RangeInclusive<f64> = 0.2..=5.0;

/// The line of a lens as it is shown step by step.
#[derive(Debug)]
pub(super) struct Replay {
    /// The time for which each lens is shown, in seconds.
    pace: f64,
    running: Option<RunningReplay>,
}

impl Default for Replay {
    fn default() -> Self {
        Self { pace: 1.0, running: None }
    }
}

/// A replay that has not ended.
#[derive(Debug)]
struct RunningReplay {
    /// The generations, the oldest first.
    line: Vec<u64>,
    /// The place of the generation that is shown.
    at: usize,
    /// The time of the window at which it came up, in seconds.
    since: f64,
}

impl Replay {
    /// The generation whose line is replayed.
    pub(super) fn youngest(&self) -> Option<u64> {
        self.running.as_ref()?.line.last().copied()
    }

    /// Ends the replay.
    pub(super) fn stop(&mut self) {
        self.running = None;
    }

    /// Shows the controls for the line of a lens; the generation that is to be shown from now on, if
    /// it is another one.
    pub(super) fn ui(
        &mut self,
        ui: &mut Ui,
        run: &StructureSearchSnapshot,
        number: u64,
    ) -> Option<u64> {
        let mut line: Vec<u64> = run.ancestry(number).map(|node| node.number).collect();
        line.reverse();
        let now = ui.input(|input| input.time);
        let mut shown = None;
        ui.horizontal(|ui| {
            let text = if self.running.is_some() { "Stop the replay" } else { "Replay" };
            let hint = "Show the lens and its ancestors one after the other, the oldest first";
            if ui.button(text).on_hover_text(hint).clicked() {
                let is_new = self.running.take().is_none() && !line.is_empty();
                shown = line.first().copied().filter(|_| is_new);
                self.running = shown.map(|_| RunningReplay { line, at: 0, since: now });
            }
            let pace = DragValue::new(&mut self.pace).range(PACE).speed(0.02).suffix(" s each");
            ui.add(pace).accessible_name("Time for each lens");
            if let Some(RunningReplay { line, at, .. }) = &self.running {
                ui.weak(format!("{} of {}", at + 1, line.len()));
            }
        });
        shown.or_else(|| self.advance(ui, now))
    }

    /// The next generation, once the present one was shown for long enough.
    fn advance(&mut self, ui: &Ui, now: f64) -> Option<u64> {
        let running = self.running.as_mut()?;
        let left = running.since + self.pace - now;
        if left > 0.0 {
            ui.request_repaint_after(Duration::from_secs_f64(left));
            return None;
        }
        running.at += 1;
        running.since = now;
        let next = running.line.get(running.at).copied();
        if next.is_none() {
            self.running = None;
        } else {
            ui.request_repaint_after(Duration::from_secs_f64(self.pace));
        }
        next
    }
}
