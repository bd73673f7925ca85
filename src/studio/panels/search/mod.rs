//! The search over structure, live: elements appear, split, fuse and vanish while the merit falls.
//!
//! Every lens that the search keeps can be looked at beside the design, traced back through its
//! ancestors, pinned, taken or exported. The search works on its own copy.

mod controls;
mod family;
mod lenses;
mod light;
mod limits;
mod marks;
mod moves;
mod plot;
mod setup;
mod thumbnail;
mod words;

use eframe::egui::{Button, Frame, Margin, Panel as Side, RichText, ScrollArea, Ui};

use super::Panel;
use crate::session::{Command, Exploration, Explore, View};
use crate::studio::wording::{capital, counted_from_one};
use setup::Setup;
use thumbnail::Thumbnails;

/// What the panel is about, before anything is searched.
const WHAT: &str = "Which lens of another structure is better? Chains descend from the design, add, \
    remove, glue, split, bend, flip and exchange elements, and keep the best lens of every \
    pattern of glass and air.\n\
    The design stays what it is until one of their lenses is taken.";

/// The height of what is said about the lens that was clicked: buttons and two lines.
const CHOICE: f32 = 62.0;
/// With less height than this, it stands above the page and moves with it.
const ROOMY: f32 = 240.0;

/// A part of the panel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Page {
    /// What is asked for.
    #[default]
    Setup,
    /// How it goes, and the lenses that are kept.
    Run,
    /// What became of each kind of mutation.
    Moves,
    /// Where a lens came from.
    Family,
}

const PAGES: [(Page, &str, &str); 4] = [
    (Page::Setup, "Setup", "What the search may do, and how long"),
    (Page::Run, "Lenses", "The merit as it falls, and the lenses that are kept"),
    (Page::Moves, "Moves", "How often each kind of mutation is tried, and what became of it"),
    (Page::Family, "Family", "Where a lens came from, mutation by mutation"),
];

/// The panel.
#[derive(Debug, Default)]
pub struct StructureSearch {
    page: Page,
    setup: Setup,
    thumbnails: Thumbnails,
    /// The generation that was clicked, and the search that it belongs to.
    chosen: Option<(u64, u64)>,
    /// The search that was shown last: a new one turns the page.
    shown: Option<u64>,
}

impl Panel for StructureSearch {
    fn title(&self) -> &'static str {
        "Search"
    }

    fn ui(&mut self, ui: &mut Ui, view: &View, wishes: &mut Vec<Command>) {
        self.turn(view);
        controls::buttons(ui, view, &self.setup, wishes);
        controls::left(ui, view, wishes);
        if let Some(why) = &view.explorations.failed {
            let why = capital(&counted_from_one(why));
            ui.colored_label(ui.visuals().error_fg_color, why);
        }
        let run = view.explorations.run.clone();
        if let Some(run) = run.as_deref() {
            controls::progress(ui, view, run);
        } else if view.explorations.starting {
            ui.weak("Looking at the lens…");
        }
        self.pages(ui, run.is_some());
        if let (Page::Run | Page::Family, Some(run)) = (self.page, run.as_deref()) {
            self.choice(ui, view, run, wishes);
        }
        let scroll = ScrollArea::vertical().id_salt(self.page as u8).auto_shrink([false, false]);
        scroll.show(ui, |ui| match (self.page, run.as_deref()) {
            (Page::Setup, _) | (_, None) => self.ask(ui, view),
            (Page::Run, Some(run)) => self.lenses(ui, view, run, wishes),
            (Page::Moves, Some(run)) => moves::table(ui, run, wishes),
            (Page::Family, Some(run)) => self.family(ui, view, run, wishes),
        });
    }
}

impl StructureSearch {
    /// Turns to what is new: a search that has just begun, or the setup where there is none.
    fn turn(&mut self, view: &View) {
        let number = view.explorations.run.as_ref().map(|run| run.number);
        if number != self.shown {
            self.page = if number.is_some() { Page::Run } else { Page::Setup };
            self.shown = number;
        }
        if self.chosen.is_some_and(|(run, _)| Some(run) != number) {
            self.chosen = None;
        }
    }

    fn pages(&mut self, ui: &mut Ui, has_run: bool) {
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = 2.0;
            for (page, name, hint) in PAGES {
                let enabled = has_run || page == Page::Setup;
                let label = Button::selectable(self.page == page, name);
                if ui.add_enabled(enabled, label).on_hover_text(hint).clicked() {
                    self.page = page;
                }
            }
        });
        ui.separator();
    }

    fn ask(&mut self, ui: &mut Ui, view: &View) {
        let under_way = view.explorations.run.as_ref().is_some_and(|run| run.is_under_way());
        if under_way {
            ui.label(RichText::new("The next search will begin with these.").small().weak());
        } else if view.explorations.run.is_none() {
            ui.label(WHAT);
        }
        self.setup.ui(ui, view);
    }

    /// The merit, and the lenses that are kept.
    fn lenses(&mut self, ui: &mut Ui, view: &View, run: &Exploration, wishes: &mut Vec<Command>) {
        controls::hand(ui, view, run, wishes);
        let clicked = plot::plots(ui, view, run, self.number());
        let chosen = self.number();
        let clicked =
            clicked.or_else(|| lenses::cards(ui, view, run, chosen, &mut self.thumbnails));
        self.choose(run, clicked, wishes);
    }

    /// The line of the lens that was clicked, or of the best one.
    fn family(&mut self, ui: &mut Ui, view: &View, run: &Exploration, wishes: &mut Vec<Command>) {
        let number = self.number().unwrap_or(run.best.number);
        let clicked = family::picture(ui, run, number);
        let clicked = clicked.or_else(|| family::line(ui, view, run, number, &mut self.thumbnails));
        self.choose(run, clicked, wishes);
    }

    /// The generation that was clicked.
    fn number(&self) -> Option<u64> {
        self.chosen.map(|(_, number)| number)
    }

    /// Shows a generation in place of the design.
    fn choose(&mut self, run: &Exploration, number: Option<u64>, wishes: &mut Vec<Command>) {
        let Some(number) = number else { return };
        self.chosen = Some((run.number, number));
        if let Some(lens) = run.lens_of(number) {
            wishes.push(Command::Preview(Some(Box::new((**lens).clone()))));
        }
    }

    /// What to do with the lens that was clicked, and how it stands beside the design: below the
    /// page, or above it where there is little room.
    fn choice(&mut self, ui: &mut Ui, view: &View, run: &Exploration, wishes: &mut Vec<Command>) {
        if ui.available_height() < ROOMY {
            return self.chosen(ui, view, run, wishes);
        }
        let frame = Frame::new().inner_margin(Margin { top: 4, ..Margin::ZERO });
        let side = Side::bottom("chosen lens of the search").frame(frame);
        let side = side.show_separator_line(false).exact_size(CHOICE);
        side.show(ui, |ui| self.chosen(ui, view, run, wishes));
    }

    fn chosen(&mut self, ui: &mut Ui, view: &View, run: &Exploration, wishes: &mut Vec<Command>) {
        let number = self.number();
        let lens = number.and_then(|number| run.lens_of(number));
        let (Some(number), Some(_)) = (number, lens) else {
            ui.weak("Click a lens or a mark to see it beside the design.");
            return;
        };
        if lenses::actions(ui, view, run, number, wishes) {
            self.chosen = None;
        }
        words::compared(ui, view, run, number);
    }
}

/// The wish for something of the search.
fn wish(explore: Explore) -> Command {
    Command::Explore(explore)
}
