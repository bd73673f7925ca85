//! The search over structure, live: elements appear, split, fuse and vanish while the merit falls.
//!
//! Every lens that the search retains can be compared with the design, traced back through its
//! ancestors, pinned, accepted or exported. The search works on its own copy.

mod broken_limits;
mod controls;
mod family;
mod lenses;
mod limits;
mod moves;
mod plot;
mod replay;
mod setup;
mod text;

use std::sync::Arc;

use egui::{Button, Frame, Margin, Panel as Side, RichText, ScrollArea, Ui};

use super::Panel;
use crate::lens::Lens;
use crate::session::{
    Command, FoundLens, SessionView, StructureSearchCommand, StructureSearchSnapshot,
};
use crate::studio::actions::Actions;
use crate::studio::text::capitalize;
use crate::studio::thumbnails::Thumbnails;
use lenses::CardOrder;
use replay::Replay;
use setup::SearchSetup;

/// The introduction that is shown before the first search.
const INTRODUCTION: &str = "Which lens of another structure is better? The search \
    adds, removes, glues, splits, bends, flips and exchanges elements, optimizes each changed lens, \
    and retains the best lenses that differ.\n\
    The design does not change until one of them is accepted.";

/// The height of the bar of the selected lens: buttons and two lines.
const SELECTION_HEIGHT: f32 = 62.0;
/// Its height while nothing is selected.
const HINT_HEIGHT: f32 = 24.0;
/// With less height than this, the bar is above the page and scrolls with it.
const MIN_HEIGHT: f32 = 240.0;

/// A part of the panel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum SearchPage {
    /// The settings of the next search.
    #[default]
    Setup,
    /// The retained lenses, below the merit history where there is room for both.
    Lenses,
    /// The merit history alone.
    Curves,
    /// The outcome of each kind of mutation.
    Moves,
    /// The ancestors of a lens.
    Family,
}

const PAGES: [(SearchPage, &str, &str); 5] = [
    (SearchPage::Setup, "Setup", "Settings of the next search"),
    (SearchPage::Lenses, "Lenses", "Retained lenses"),
    (SearchPage::Curves, "Curves", "Merit and number of elements against iterations"),
    (SearchPage::Moves, "Statistics", "Attempts and outcomes of each kind of mutation"),
    (SearchPage::Family, "Family", "Ancestors of a lens, mutation by mutation"),
];

/// The panel.
#[derive(Debug, Default)]
pub struct SearchPanel {
    page: SearchPage,
    setup: SearchSetup,
    thumbnails: Thumbnails,
    /// The order of the retained lenses.
    order: CardOrder,
    /// The lens that was clicked.
    selected: Option<SelectedLens>,
    /// The places of the cards.
    places: lenses::CardPlaces,
    /// The mutations of a line that are shown one after the other.
    replay: Replay,
    /// The search that was shown last: a new one turns the page.
    shown_run: Option<u64>,
}

/// A lens of the search that was clicked. It is held as it was then: the best lens of a generation
/// that still descends is another one a moment later, under the same number.
#[derive(Debug, Clone)]
struct SelectedLens {
    /// The number of the search.
    run: u64,
    /// The generation.
    number: u64,
    lens: Arc<Lens>,
}

impl SelectedLens {
    /// True if a card shows this lens.
    fn is(&self, found: &FoundLens) -> bool {
        self.number == found.number
            && (Arc::ptr_eq(&self.lens, &found.lens) || self.lens == found.lens)
    }
}

/// A search that the panel shows, and the session that it belongs to.
#[derive(Debug, Clone, Copy)]
struct ShownSearch<'a> {
    view: &'a SessionView,
    run: &'a StructureSearchSnapshot,
}

impl Panel for SearchPanel {
    fn title(&self) -> &'static str {
        "Search"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        self.sync_page(view);
        controls::buttons(ui, view, &self.setup, actions);
        controls::unfinished_search(ui, view, actions);
        if let Some(why) = &view.structure_search.run.error {
            let why = capitalize(why);
            ui.colored_label(ui.visuals().error_fg_color, why);
        }
        let run = view.structure_search.run.snapshot.as_deref();
        let search = run.map(|run| ShownSearch { view, run });
        if let Some(search) = search {
            controls::progress(ui, search, actions);
            broken_limits::broken_limits(ui, search.run, self.setup.plan());
        } else if view.structure_search.run.is_active() {
            ui.weak("Preparing…");
        }
        self.pages(ui, search.is_some());
        let chooses = !matches!(self.page, SearchPage::Setup | SearchPage::Moves);
        if let Some(search) = search.filter(|_| chooses) {
            self.selection_bar(ui, search, actions);
        }
        let scroll = ScrollArea::vertical().id_salt(self.page as u8).auto_shrink([false, false]);
        scroll.show(ui, |ui| match (self.page, search) {
            (SearchPage::Setup, _) | (_, None) => self.setup_page(ui, view),
            (SearchPage::Lenses, Some(search)) => self.lenses_page(ui, search, actions),
            (SearchPage::Curves, Some(search)) => self.curves_page(ui, search, actions),
            (SearchPage::Moves, Some(search)) => moves::table(ui, search, actions),
            (SearchPage::Family, Some(search)) => self.family_page(ui, search, actions),
        });
    }
}

impl SearchPanel {
    /// Turns to the page of a search that has just begun, or to the setup if there is none.
    fn sync_page(&mut self, view: &SessionView) {
        let number = view.structure_search.run.id.map(|run| run.number);
        if number != self.shown_run {
            self.page = if number.is_some() { SearchPage::Lenses } else { SearchPage::Setup };
            self.shown_run = number;
        }
        if self.page != SearchPage::Family {
            self.replay.stop();
        }
        if self.selected.as_ref().is_some_and(|selected| Some(selected.run) != number) {
            self.selected = None;
        }
    }

    fn pages(&mut self, ui: &mut Ui, has_run: bool) {
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = 2.0;
            for (page, name, hint) in PAGES {
                let enabled = has_run || page == SearchPage::Setup;
                let label = Button::selectable(self.page == page, name);
                if ui.add_enabled(enabled, label).on_hover_text(hint).clicked() {
                    self.page = page;
                }
            }
        });
        ui.separator();
    }

    fn setup_page(&mut self, ui: &mut Ui, view: &SessionView) {
        let active = view.structure_search.run.is_active();
        if active {
            ui.label(RichText::new("These settings apply to the next search.").small().weak());
        } else if view.structure_search.run.snapshot.is_none() {
            ui.label(INTRODUCTION);
        }
        self.setup.ui(ui, view);
    }

    /// The retained lenses, and the merit history where it leaves room for them.
    fn lenses_page(&mut self, ui: &mut Ui, search: ShownSearch<'_>, actions: &mut Actions) {
        let is_roomy = plot::has_room(ui);
        controls::live_controls(ui, search, is_roomy, &mut self.order, actions);
        let chosen = self.selected_number();
        let marked = if is_roomy { plot::plots(ui, search, chosen) } else { None };
        let chosen = self.selected.as_ref();
        let card =
            lenses::cards(ui, search, chosen, self.order, &mut self.places, &mut self.thumbnails);
        match card {
            Some(found) => self.select(search.view, found.number, &found.lens, actions),
            None => self.select_number(search.view, marked, actions),
        }
    }

    /// The merit history alone.
    fn curves_page(&mut self, ui: &mut Ui, search: ShownSearch<'_>, actions: &mut Actions) {
        ui.horizontal(|ui| controls::temperature(ui, search, actions));
        let marked = plot::large_plots(ui, search, self.selected_number());
        self.select_number(search.view, marked, actions);
    }

    /// The line of the lens that was clicked, or of the best one.
    fn family_page(&mut self, ui: &mut Ui, search: ShownSearch<'_>, actions: &mut Actions) {
        let selected = self.selected_number().unwrap_or(search.run.best.number);
        // The line stays the same while its ancestors are shown.
        let number = self.replay.youngest().unwrap_or(selected);
        let replayed = self.replay.ui(ui, search.run, number);
        let clicked = family::tree(ui, search.run, selected);
        family::legend(ui);
        let clicked =
            clicked.or_else(|| family::ancestors(ui, search, number, &mut self.thumbnails));
        if clicked.is_some() {
            self.replay.stop();
        }
        self.select_number(search.view, clicked.or(replayed), actions);
    }

    /// The generation that was clicked.
    fn selected_number(&self) -> Option<u64> {
        self.selected.as_ref().map(|selected| selected.number)
    }

    /// Shows the lens of a generation in place of the design.
    fn select_number(&mut self, view: &SessionView, number: Option<u64>, actions: &mut Actions) {
        let (Some(number), Some(search)) = (number, &view.structure_search.run.snapshot) else {
            return;
        };
        if let Some(lens) = search.lens_by_number(number) {
            self.select(view, number, lens, actions);
        }
    }

    /// Shows a lens in place of the design; it is the one that is accepted or exported.
    fn select(&mut self, view: &SessionView, number: u64, lens: &Arc<Lens>, actions: &mut Actions) {
        let Some(id) = view.structure_search.run.id else { return };
        self.selected = Some(SelectedLens { run: id.number, number, lens: Arc::clone(lens) });
        actions.push(StructureSearchCommand::Choose { number, lens: Box::new((**lens).clone()) });
        actions.push(Command::Preview(Some(Box::new((**lens).clone()))));
    }

    /// The bar of the selected lens: below the page, or above it if there is little room.
    fn selection_bar(&mut self, ui: &mut Ui, search: ShownSearch<'_>, actions: &mut Actions) {
        if ui.available_height() < MIN_HEIGHT {
            return self.selection(ui, search, actions);
        }
        let frame = Frame::new().inner_margin(Margin { top: 4, ..Margin::ZERO });
        let side = Side::bottom("chosen lens of the search").frame(frame);
        let height = if self.selected.is_some() { SELECTION_HEIGHT } else { HINT_HEIGHT };
        let side = side.show_separator_line(false).exact_size(height);
        side.show(ui, |ui| self.selection(ui, search, actions));
    }

    fn selection(&mut self, ui: &mut Ui, search: ShownSearch<'_>, actions: &mut Actions) {
        let Some(selected) = self.selected.clone() else {
            ui.weak("Click a lens or a mark to compare it with the design.");
            return;
        };
        if lenses::lens_buttons(ui, search, selected.number, actions) {
            self.selected = None;
        }
        text::comparison(ui, search, &selected);
    }
}
