//! The cost of the window: a real one is opened, edited, repainted, left idle and closed.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use eframe::{App, CreationContext};
use egui::{Context, Ui, ViewportCommand};
use serde::Serialize;

use super::app::Studio;
use super::draw::RenderBackend;
use super::session_benchmark::{
    TimeSummary, largest_lens, time_edits, time_journaled_edits, time_moves,
};
use super::window::{self, AppResult, Persistence, StudioError};
use super::{first_lens, panels};
use crate::measure::{age_ms, processor_ms};
use crate::session::{Command, Session};

/// The number of repainted frames that share the measured processor time.
const FRAMES: usize = 20;
/// The time for which the window is left idle.
const IDLE_TIME: Duration = Duration::from_secs(5);
/// The time for which it settles before that.
const SETTLING_TIME: Duration = Duration::from_millis(700);

/// The measured cost of a window. A value that the system does not provide, or that was not
/// measured before the end was asked for, is absent.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct WindowMetrics {
    /// The name of the renderer.
    pub renderer: String,
    /// Width and height of the window in pixels.
    pub size: [u32; 2],
    /// From the start of the process to the first frame with the lens and all its numbers on the
    /// screen.
    pub first_frame_ms: Option<f64>,
    /// From an edit to the numbers of all panels, frames apart: the median of 21 edits.
    pub edit_ms: Option<f64>,
    /// The slowest of them.
    pub slowest_edit_ms: Option<f64>,
    /// From a move of a handle to the numbers of all panels with the merit and its derivatives by the
    /// handles, frames apart: the median of 200 moves with the focal length held.
    pub drag_ms: Option<f64>,
    /// The slowest of them.
    pub slowest_drag_ms: Option<f64>,
    /// The lens with the most surfaces of those that come with the program.
    pub largest_lens: Option<String>,
    /// The median of the same moves on that lens.
    pub largest_drag_ms: Option<f64>,
    /// The slowest of them.
    pub slowest_largest_drag_ms: Option<f64>,
    /// The time of an edit of that lens on the window's thread, without its results and without a
    /// journal: the median of 200 edits.
    pub unjournaled_edit_ms: Option<f64>,
    /// The slowest of them: what other threads take from the window's.
    pub slowest_unjournaled_edit_ms: Option<f64>,
    /// The same with a journal.
    pub journaled_edit_ms: Option<f64>,
    /// The slowest of them.
    pub slowest_journaled_edit_ms: Option<f64>,
    /// Processor time of a frame in which no drawing changed, all threads together.
    pub frame_processor_ms: Option<f64>,
    /// The time for which the window was left idle with the cursor in a text field.
    pub idle_seconds: Option<f64>,
    /// Processor time in that time, all threads together.
    pub idle_processor_ms: Option<f64>,
}

/// Opens a window, measures it, and closes it again; earlier once `stop` is true, with what was
/// measured until then.
///
/// # Errors
/// No window can open: see [`StudioError`].
pub fn measure_window(stop: &Arc<AtomicBool>) -> Result<WindowMetrics, StudioError> {
    let figures = Arc::new(Mutex::new(WindowMetrics::default()));
    let (shared, stop) = (Arc::clone(&figures), Arc::clone(stop));
    window::open_window(Persistence::Disabled, move |context, backend| {
        start_benchmark(context, backend, &shared, Arc::clone(&stop))
    })?;
    let found = figures.lock().unwrap_or_else(PoisonError::into_inner).clone();
    Ok(found)
}

fn start_benchmark(
    context: &CreationContext<'_>,
    backend: RenderBackend,
    figures: &Arc<Mutex<WindowMetrics>>,
    stop: Arc<AtomicBool>,
) -> AppResult {
    let wake = context.egui_ctx.clone();
    let session = Session::new(first_lens(), move || wake.request_repaint())?;
    let mut studio = Studio::new(session, backend, Persistence::Disabled, None);
    studio.close_without_asking();
    let renderer = context.wgpu_render_state.as_ref().map_or_else(
        || "OpenGL".to_owned(),
        |state| {
            let info = state.adapter.get_info();
            format!("{} ({})", info.name, info.backend)
        },
    );
    let figures = Arc::clone(figures);
    figures.lock().unwrap_or_else(PoisonError::into_inner).renderer = renderer;
    let phase = BenchmarkPhase::Opening;
    Ok(Box::new(WindowBenchmark { studio, metrics: figures, stop, phase }))
}

/// A studio that measures itself.
struct WindowBenchmark {
    studio: Studio,
    metrics: Arc<Mutex<WindowMetrics>>,
    stop: Arc<AtomicBool>,
    phase: BenchmarkPhase,
}

/// The phase of the benchmark.
#[derive(Debug, Clone, Copy)]
enum BenchmarkPhase {
    /// The first frame with the lens and all its numbers is not on the screen yet.
    Opening,
    /// It is being drawn.
    FirstDrawing,
    /// The number of frames until the drawings are complete.
    Settling(usize),
    /// The number of frames still to be repainted; the processor time at the first one.
    Repainting(usize, Option<f64>),
    /// The number of frames until the window is left idle.
    SettlingIdle(usize),
    /// Another thread measures the idle window.
    Idle,
}

impl App for WindowBenchmark {
    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        let context = ui.ctx().clone();
        self.phase = self.advance(&context);
        self.studio.ui(ui);
    }

    fn persist_egui_memory(&self) -> bool {
        false
    }
}

impl WindowBenchmark {
    /// Does the work of this frame and returns the next phase.
    fn advance(&mut self, context: &Context) -> BenchmarkPhase {
        if self.is_stopped() {
            context.send_viewport_cmd(ViewportCommand::Close);
            return BenchmarkPhase::Idle;
        }
        if !matches!(self.phase, BenchmarkPhase::Idle) {
            context.request_repaint();
        }
        match self.phase {
            BenchmarkPhase::Opening if self.studio.session().view().is_current() => {
                BenchmarkPhase::FirstDrawing
            }
            BenchmarkPhase::Opening => BenchmarkPhase::Opening,
            BenchmarkPhase::FirstDrawing => {
                let size = context.content_rect().size() * context.pixels_per_point();
                self.record(|figures| {
                    figures.first_frame_ms = age_ms();
                    figures.size = [size.x as u32, size.y as u32];
                });
                self.time_edits();
                self.time_drags();
                self.time_journal();
                BenchmarkPhase::Settling(5)
            }
            BenchmarkPhase::Settling(0) => BenchmarkPhase::Repainting(FRAMES, processor_ms()),
            BenchmarkPhase::Settling(left) => BenchmarkPhase::Settling(left - 1),
            BenchmarkPhase::Repainting(0, before) => {
                let spent = processor_ms_since(before).map(|ms| ms / FRAMES as f64);
                self.record(|figures| figures.frame_processor_ms = spent);
                context.memory_mut(|memory| memory.request_focus(panels::first_radius_field()));
                BenchmarkPhase::SettlingIdle(5)
            }
            BenchmarkPhase::Repainting(left, before) => {
                BenchmarkPhase::Repainting(left - 1, before)
            }
            BenchmarkPhase::SettlingIdle(0) => {
                self.measure_idle(context);
                BenchmarkPhase::Idle
            }
            BenchmarkPhase::SettlingIdle(left) => BenchmarkPhase::SettlingIdle(left - 1),
            BenchmarkPhase::Idle => BenchmarkPhase::Idle,
        }
    }

    fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    fn record(&self, note: impl FnOnce(&mut WindowMetrics)) {
        note(&mut self.metrics.lock().unwrap_or_else(PoisonError::into_inner));
    }

    /// Types radii and waits each time for the numbers of all panels.
    fn time_edits(&mut self) {
        let stop = Arc::clone(&self.stop);
        let Some(times) = time_edits(self.studio.session_mut(), &stop) else { return };
        let TimeSummary { median, slowest } = times;
        self.record(|figures| {
            (figures.edit_ms, figures.slowest_edit_ms) = (Some(median), Some(slowest));
        });
    }

    /// Drags a handle of the first lens, and one of the largest.
    fn time_drags(&mut self) {
        let stop = Arc::clone(&self.stop);
        let session = self.studio.session_mut();
        let Some(first) = time_moves(session, first_lens(), &stop) else { return };
        let Some(largest) = largest_lens() else { return };
        let name = largest.name.clone();
        let second = time_moves(session, largest, &stop);
        session.apply(Command::New(Box::new(first_lens())));
        self.record(|figures| {
            (figures.drag_ms, figures.slowest_drag_ms) = (Some(first.median), Some(first.slowest));
            figures.largest_lens = Some(name);
            figures.largest_drag_ms = second.map(|times| times.median);
            figures.slowest_largest_drag_ms = second.map(|times| times.slowest);
        });
    }

    /// Edits the largest lens with a journal and without one.
    fn time_journal(&self) {
        let Some([without, with]) = time_journaled_edits(&self.stop) else { return };
        self.record(|figures| {
            figures.unjournaled_edit_ms = Some(without.median);
            figures.slowest_unjournaled_edit_ms = Some(without.slowest);
            figures.journaled_edit_ms = Some(with.median);
            figures.slowest_journaled_edit_ms = Some(with.slowest);
        });
    }

    /// Leaves the window idle, measures its processor time meanwhile, and closes it.
    fn measure_idle(&self, context: &Context) {
        let (figures, window) = (Arc::clone(&self.metrics), context.clone());
        let stop = Arc::clone(&self.stop);
        let look = move || {
            thread::sleep(SETTLING_TIME);
            let before = processor_ms();
            if sleep_unless(&stop, IDLE_TIME) {
                let spent = processor_ms_since(before);
                let mut figures = figures.lock().unwrap_or_else(PoisonError::into_inner);
                figures.idle_seconds = Some(IDLE_TIME.as_secs_f64());
                figures.idle_processor_ms = spent;
            }
            window.send_viewport_cmd(ViewportCommand::Close);
        };
        if let Err(error) = thread::Builder::new().name("idle".into()).spawn(look) {
            log::warn!("the idle window cannot be watched: {error}");
            context.send_viewport_cmd(ViewportCommand::Close);
        }
    }
}

fn processor_ms_since(before: Option<f64>) -> Option<f64> {
    Some(processor_ms()? - before?)
}

/// Sleeps for a time, a quarter of a second at once; false if `stop` became true.
fn sleep_unless(stop: &AtomicBool, time: Duration) -> bool {
    let parts = time.as_millis() / PART.as_millis();
    (0..parts).all(|_| {
        thread::sleep(PART);
        !stop.load(Ordering::Relaxed)
    })
}

/// The longest sleep of the thread that watches the idle window: short enough to end soon, long
/// enough to cost no processor time.
const PART: Duration = Duration::from_millis(250);
