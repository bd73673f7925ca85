//! The browser of the lens library: cards with drawings, found by words, type and numbers.

use std::collections::HashMap;
use std::sync::Arc;

use egui::text::{LayoutJob, TextWrapping};
use egui::{
    Align2, Button, ComboBox, Context, CursorIcon, FontId, Id, Painter, Rect, Response, RichText,
    Role, ScrollArea, Sense, Stroke, StrokeKind, TextEdit, Ui, Vec2, WidgetInfo, Window, pos2,
    vec2,
};

use super::actions::{Actions, UiAction};
use super::form::{named_list, number_field};
use super::text::{counted, degrees};
use super::thumbnails::Thumbnails;
use crate::files::{LibraryLens, LibraryQuery, ShortRange, library_lenses};
use crate::lens::Lens;

/// The size of a card, in points.
const CARD: Vec2 = vec2(176.0, 138.0);
/// The part of a card for its words, in points.
const WORDS: f32 = 46.0;
/// The gap between cards, in points.
const GAP: f32 = 6.0;
/// The number of lenses that are read in one frame.
const READ_PER_FRAME: usize = 4;
/// The numbers that lenses are found by: their name in a query, their title, and an example.
const RANGES: [(&str, &str, &str); 4] = [
    ("mm", "Focal length", "28..50"),
    ("f", "F-number", "..2.8"),
    ("field", "Half field, °", "20.."),
    ("elements", "Elements", "..5"),
];

/// The window.
pub(super) struct LibraryWindow {
    words: String,
    /// The type of design; empty for all.
    design: String,
    ranges: [String; RANGES.len()],
    selected: Option<&'static LibraryLens>,
    /// True once the words have had the cursor.
    entered: bool,
    scales: bool,
    focal_length: f64,
    /// The lenses that have been read; `None` for one that cannot be.
    lenses: HashMap<&'static str, Option<Arc<Lens>>>,
    thumbnails: Thumbnails,
}

impl std::fmt::Debug for LibraryWindow {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LibraryWindow").field("words", &self.words).finish_non_exhaustive()
    }
}

impl Default for LibraryWindow {
    fn default() -> Self {
        Self {
            words: String::new(),
            design: String::new(),
            ranges: Default::default(),
            selected: None,
            entered: false,
            scales: false,
            focal_length: 50.0,
            lenses: HashMap::new(),
            thumbnails: Thumbnails::default(),
        }
    }
}

impl LibraryWindow {
    /// Shows the window; true once it is closed.
    pub(super) fn ui(&mut self, context: &Context, actions: &mut Actions) -> bool {
        let (mut open, mut done) = (true, false);
        let area = context.content_rect();
        let window = Window::new("Lens library")
            .id(Id::unique("library"))
            .open(&mut open)
            .collapsible(false)
            .pivot(Align2::CENTER_CENTER)
            .default_pos(area.center())
            .default_size(vec2(960.0_f32.min(0.94 * area.width()), 0.78 * area.height()));
        window.show(context, |ui| {
            self.filters(ui);
            let found = match self.query() {
                Ok(query) => self.of_design(query.find()),
                Err(why) => {
                    ui.label(RichText::new(why).color(ui.visuals().warn_fg_color));
                    Vec::new()
                }
            };
            ui.weak(format!("{} of {} lenses", found.len(), library_lenses().len()));
            let footer = 34.0;
            let height = (ui.available_height() - footer).max(CARD.y);
            let opened = self.cards(ui, &found, height);
            done = self.footer(ui, opened, actions);
        });
        done || !open
    }

    fn filters(&mut self, ui: &mut Ui) {
        ui.horizontal_wrapped(|ui| {
            let line = TextEdit::singleline(&mut self.words)
                .hint_text("Words: maker, year, type…")
                .desired_width(190.0);
            let field = ui.add(line).accessible_name("Search the library");
            if !std::mem::replace(&mut self.entered, true) {
                field.request_focus();
            }
            let chosen = if self.design.is_empty() { "All types" } else { &self.design };
            let combo = ComboBox::from_id_salt("lens type").selected_text(chosen).width(130.0);
            let shown = combo.show_ui(ui, |ui| {
                ui.selectable_value(&mut self.design, String::new(), "All types");
                for design in designs() {
                    ui.selectable_value(&mut self.design, design.to_owned(), design);
                }
            });
            named_list(ui, shown, "Lens type");
            for ((_, title, example), text) in RANGES.iter().zip(&mut self.ranges) {
                ui.label(*title);
                let line = TextEdit::singleline(text).hint_text(*example).desired_width(54.0);
                let field = ui.add(line).accessible_name(format!("{title} range"));
                field.on_hover_text(format!("A range such as {example}, or one number"));
            }
        });
    }

    fn query(&self) -> Result<LibraryQuery, String> {
        let ranges = RANGES.iter().zip(&self.ranges).filter(|(_, text)| !text.trim().is_empty());
        let ranges: Vec<String> =
            ranges.map(|((name, ..), text)| format!("{name}={}", text.trim())).collect();
        let words = self.words.split_whitespace().chain(ranges.iter().map(String::as_str));
        LibraryQuery::new(words).map_err(|why| why.to_string())
    }

    fn of_design(&self, mut found: Vec<&'static LibraryLens>) -> Vec<&'static LibraryLens> {
        found.retain(|lens| self.design.is_empty() || lens.design == self.design);
        found
    }

    /// Shows the cards; true if one was double-clicked.
    fn cards(&mut self, ui: &mut Ui, found: &[&'static LibraryLens], height: f32) -> bool {
        let columns = ((ui.available_width() + GAP) / (CARD.x + GAP)).floor().max(1.0) as usize;
        let rows = found.len().div_ceil(columns);
        let mut left = READ_PER_FRAME;
        let mut opened = false;
        ui.spacing_mut().item_spacing = vec2(GAP, GAP);
        let scroll = ScrollArea::vertical().max_height(height).min_scrolled_height(height);
        scroll.auto_shrink([false, false]).show_rows(ui, CARD.y, rows, |ui, shown| {
            for row in shown {
                let lenses = found.iter().skip(row * columns).take(columns);
                ui.horizontal(|ui| opened |= self.row(ui, lenses.copied(), &mut left));
            }
        });
        opened
    }

    /// Shows a row of cards; true if one was double-clicked.
    fn row(
        &mut self,
        ui: &mut Ui,
        lenses: impl Iterator<Item = &'static LibraryLens>,
        left: &mut usize,
    ) -> bool {
        let mut opened = false;
        for lens in lenses {
            let card = self.card(ui, lens, left);
            if card.clicked() {
                self.selected = Some(lens);
            }
            opened |= card.double_clicked();
        }
        opened
    }

    fn card(&mut self, ui: &mut Ui, entry: &'static LibraryLens, left: &mut usize) -> Response {
        let (rect, response) = ui.allocate_exact_size(CARD, Sense::click());
        response.widget_info(|| WidgetInfo::labeled(Role::Button, true, &entry.title));
        let response = response.on_hover_cursor(CursorIcon::PointingHand);
        let selected = self.selected.is_some_and(|lens| std::ptr::eq(lens, entry));
        let visuals = ui.visuals();
        let stroke = if response.has_focus() {
            response.scroll_to_me(None);
            Stroke::new(2.0, visuals.strong_text_color())
        } else if selected {
            Stroke::new(2.0, visuals.selection.stroke.color)
        } else {
            visuals.widgets.noninteractive.bg_stroke
        };
        let painter = ui.painter_at(rect);
        painter.rect(rect, 3.0, visuals.extreme_bg_color, stroke, StrokeKind::Inside);
        let drawing = rect.shrink(4.0).with_max_y(rect.max.y - WORDS);
        self.drawing(ui, entry, drawing, left);
        words(ui, &painter, entry, rect);
        response.on_hover_text(format!("{}\n{}", entry.title, entry.source))
    }

    /// Draws the section of a lens; it is read first, a few in each frame.
    fn drawing(&mut self, ui: &Ui, entry: &'static LibraryLens, rect: Rect, left: &mut usize) {
        if !self.lenses.contains_key(entry.name.as_str()) {
            if *left == 0 {
                return ui.ctx().request_repaint();
            }
            *left -= 1;
            self.lenses.insert(&entry.name, entry.open().ok().map(Arc::new));
        }
        let Some(Some(lens)) = self.lenses.get(entry.name.as_str()) else { return };
        self.thumbnails.paint(ui, lens, lens, rect);
    }

    /// Shows what is selected and the buttons; true if a lens was opened.
    fn footer(&mut self, ui: &mut Ui, opened: bool, actions: &mut Actions) -> bool {
        let mut pressed = opened;
        ui.horizontal(|ui| {
            let fill = ui.visuals().selection.bg_fill;
            let button = Button::new(RichText::new("Open").strong()).fill(fill);
            let button = ui.add_enabled(self.selected.is_some(), button);
            pressed |= button.on_disabled_hover_text("Select a lens first.").clicked();
            ui.checkbox(&mut self.scales, "scaled to the focal length");
            ui.add_enabled_ui(self.scales, |ui| {
                number_field(ui, "Focal length of the opened lens", &mut self.focal_length, " mm");
            });
            if let Some(lens) = self.selected {
                ui.separator();
                ui.label(&lens.title);
            }
        });
        let Some(lens) = self.selected.filter(|_| pressed) else { return false };
        actions.push(UiAction::OpenLibrary(lens, self.scales.then_some(self.focal_length)));
        true
    }
}

/// The types of design in the order of the library.
fn designs() -> Vec<&'static str> {
    let mut all: Vec<&str> = library_lenses().iter().map(|lens| lens.design.as_str()).collect();
    all.dedup();
    all
}

/// Writes title and numbers of a lens into the lower part of its card.
fn words(ui: &Ui, painter: &Painter, lens: &LibraryLens, rect: Rect) {
    let at = pos2(rect.min.x + 6.0, rect.max.y - WORDS + 2.0);
    let visuals = ui.visuals();
    let title = FontId::proportional(12.0);
    let width = rect.width() - 12.0;
    let write = |at, text: String, font, color| {
        let mut job = LayoutJob::simple_singleline(text, font, color);
        job.wrap = TextWrapping::truncate_at_width(width);
        painter.galley(at, painter.layout_job(job), color);
    };
    write(at, lens.title.clone(), title, visuals.strong_text_color());
    let lines = [
        format!("{}, {}", lens.design, parts(lens)),
        degrees(&format!(
            "{} mm  {}  {}",
            ShortRange(&lens.focal_length),
            lens.aperture,
            lens.field
        )),
    ];
    for (i, line) in lines.into_iter().enumerate() {
        let at = at + vec2(0.0, 15.0 + 13.0 * i as f32);
        write(at, line, FontId::proportional(11.0), visuals.weak_text_color());
    }
}

/// The number of elements and mirrors, in words.
fn parts(lens: &LibraryLens) -> String {
    let parts = [(lens.elements, "element"), (lens.mirrors, "mirror")];
    let parts = parts.into_iter().filter(|(count, _)| *count > 0);
    let words: Vec<String> = parts.map(|(count, noun)| counted(count as u64, noun)).collect();
    words.join(", ")
}
