//! Helpers of the panel tests: a lens, a view of it with its numbers, a panel in a harness.

use std::sync::Arc;

use aplanat::files;
use aplanat::lens::Lens;
use aplanat::session::{AnalysisResults, AnalysisSettings, Command, SessionView, analyze};
use aplanat::studio::file_dialog::FileRequest;
use aplanat::studio::panels::Panel;
use aplanat::studio::theme;
use aplanat::studio::{Actions, UiAction};
use egui_kittest::Harness;

/// The heights of the panels at the right, the upper and the lower ones.
pub(super) const UPPER: f32 = 296.0;
pub(super) const LOWER: f32 = 392.0;

/// The lens that the studio opens with.
pub(super) fn double_gauss() -> Lens {
    let bundled = &files::bundled_lenses()[0];
    files::parse(bundled.text.as_bytes(), bundled.name).unwrap().lens
}

/// A view of a lens with all its numbers, those of its pupils too.
pub(super) fn view_of(lens: Lens) -> SessionView {
    let lens = Arc::new(lens);
    let settings = AnalysisSettings { pupils: true, ..AnalysisSettings::default() };
    let view =
        SessionView { lens: Arc::clone(&lens), version: 1, settings, ..SessionView::default() };
    let (version, settings) = (view.version, view.settings.clone());
    let numbers = analyze(&lens, &settings);
    let results = AnalysisResults { version, lens, settings, analyses: numbers, ms: 1.0 };
    SessionView { results: Some(Arc::new(results)), ..view }
}

/// A view of the double Gauss.
pub(super) fn view() -> SessionView {
    view_of(double_gauss())
}

/// A panel alone, with what it shows and what was asked for in it.
pub(super) struct PanelState<P> {
    pub(super) panel: P,
    pub(super) view: SessionView,
    pub(super) commands: Vec<Command>,
    pub(super) requests: Vec<FileRequest>,
}

impl<P: Panel> PanelState<P> {
    fn show(&mut self, ui: &mut egui::Ui) {
        let mut actions = Actions::default();
        self.panel.ui(ui, &self.view, &mut actions);
        for action in actions {
            match action {
                UiAction::Run(command) => self.run(command),
                UiAction::AskPath(request) => self.requests.push(request),
                other => panic!("no panel asks for {other:?}"),
            }
        }
    }

    fn run(&mut self, command: Command) {
        match &command {
            Command::Select(surface) => self.view.selected = *surface,
            Command::Preview(lens) => self.view.preview_lens = lens.clone().map(Arc::from),
            _ => {}
        }
        self.commands.push(command);
    }
}

/// A harness around a panel with the room that the default arrangement gives it at the right in a
/// window of 1280 by 800 points.
pub(super) fn small_harness<P: Panel + 'static>(
    panel: P,
    view: SessionView,
    height: f32,
) -> Harness<'static, PanelState<P>> {
    sized_harness(panel, view, [414.0, height])
}

/// A harness around a panel with some room.
pub(super) fn sized_harness<P: Panel + 'static>(
    panel: P,
    view: SessionView,
    size: [f32; 2],
) -> Harness<'static, PanelState<P>> {
    let state = PanelState { panel, view, commands: Vec::new(), requests: Vec::new() };
    let builder = Harness::builder().with_size(size).with_context_setup(theme::apply);
    builder.build_ui_state(|ui, state: &mut PanelState<P>| state.show(ui), state)
}

/// The texts that a frame has painted, those without an accessible name too.
pub(super) fn painted_texts<S>(harness: &Harness<'_, S>) -> Vec<String> {
    painted_galleys(harness).iter().map(|galley| galley.text().to_owned()).collect()
}

/// The same as they are laid out.
pub(super) fn painted_galleys<S>(harness: &Harness<'_, S>) -> Vec<Arc<egui::Galley>> {
    fn add(shape: &egui::Shape, all: &mut Vec<Arc<egui::Galley>>) {
        match shape {
            egui::Shape::Vec(parts) => parts.iter().for_each(|part| add(part, all)),
            egui::Shape::Text(text) => all.push(Arc::clone(&text.galley)),
            _ => {}
        }
    }
    let mut all = Vec::new();
    harness.output().shapes.iter().for_each(|clipped| add(&clipped.shape, &mut all));
    all
}

/// The places of the texts that a frame has painted.
pub(super) fn painted_places<S>(harness: &Harness<'_, S>) -> Vec<(String, egui::Rect)> {
    fn add(shape: &egui::Shape, all: &mut Vec<(String, egui::Rect)>) {
        match shape {
            egui::Shape::Vec(parts) => parts.iter().for_each(|part| add(part, all)),
            egui::Shape::Text(text) => {
                let place = text.galley.rect.translate(text.pos.to_vec2());
                all.push((text.galley.text().to_owned(), place));
            }
            _ => {}
        }
    }
    let mut all = Vec::new();
    harness.output().shapes.iter().for_each(|clipped| add(&clipped.shape, &mut all));
    all
}

/// A harness around a panel, large enough for all of it.
pub(super) fn panel_harness<P: Panel + 'static>(
    panel: P,
    view: SessionView,
) -> Harness<'static, PanelState<P>> {
    sized_harness(panel, view, [900.0, 620.0])
}
