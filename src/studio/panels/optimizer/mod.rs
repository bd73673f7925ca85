//! The search for a better lens: what it aims at, how it goes, and what becomes of its result.
//!
//! The search works on its own copy. The design changes only when its result is taken.

mod goal;
mod history;
mod terms;

use eframe::egui::{
    Button, ComboBox, Context, Frame, Margin, Panel as Side, RichText, ScrollArea, Ui,
};

use super::{Panel, light};
use crate::optimize::Method;
use crate::session::{Command, Numbers, Search, Standing, View};
use crate::studio::field::Drafts;
use crate::studio::number;
use crate::studio::wording::{capital, counted_from_one};
use goal::Aims;

/// How high the merit history is, in points; less where there is little room.
const HISTORY: f32 = 130.0;

const NO_VARIABLES: &str = "No number is variable: press the badge beside one in the prescription.";

/// The panel.
#[derive(Debug, Default)]
pub struct Optimizer {
    method: Method,
    aims: Aims,
    drafts: Drafts,
}

impl Panel for Optimizer {
    fn title(&self) -> &'static str {
        "Optimizer"
    }

    fn ui(&mut self, ui: &mut Ui, view: &View, wishes: &mut Vec<Command>) {
        self.aims.keep_up(view);
        self.controls(ui, view, wishes);
        if let Some(search) = view.search.as_deref() {
            progress(ui, view, search);
            let frame = Frame::new().inner_margin(Margin { right: 10, ..Margin::ZERO });
            let plot = Side::bottom("merit history").frame(frame).show_separator_line(false);
            let room = (0.45 * ui.available_height()).min(HISTORY);
            plot.exact_size(room).show(ui, |ui| history::plot(ui, search));
        }
        if view.lens.variables.is_empty() {
            ui.colored_label(ui.visuals().warn_fg_color, NO_VARIABLES);
        }
        ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
            self.aims.ui(ui, view, &mut self.drafts, wishes);
        });
    }

    fn is_typing(&self, context: &Context) -> bool {
        self.drafts.is_typing(context)
    }
}

impl Optimizer {
    fn controls(&mut self, ui: &mut Ui, view: &View, wishes: &mut Vec<Command>) {
        let standing = view.search.as_ref().map(|search| search.standing);
        let paused = standing == Some(Standing::Paused);
        let under_way = paused || standing == Some(Standing::Running);
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = 4.0;
            self.begin(ui, view, under_way, wishes);
            let hold = if paused {
                ("Resume", Command::Resume, "Let the search go on")
            } else {
                ("Pause", Command::Pause, "Hold the search after its current step")
            };
            let buttons = [
                (hold.0, under_way, hold.1, hold.2),
                ("Step", paused, Command::Step, "Take one step of the search that is held"),
                ("Stop", under_way, Command::Stop, "End the search and keep its result to look at"),
                (
                    "Take",
                    standing.is_some(),
                    Command::Take,
                    "Make the best lens of the search the design, as one undo step",
                ),
                (
                    "Discard",
                    standing.is_some(),
                    Command::Discard,
                    "End the search and throw its result away",
                ),
            ];
            for (text, enabled, command, hint) in buttons {
                if ui.add_enabled(enabled, Button::new(text)).on_hover_text(hint).clicked() {
                    wishes.push(command);
                }
            }
        });
        self.method(ui, under_way);
        ui.add_enabled_ui(!under_way, |ui| self.aims.pupil(ui));
    }

    fn begin(&self, ui: &mut Ui, view: &View, under_way: bool, wishes: &mut Vec<Command>) {
        let ready = !under_way && !view.lens.variables.is_empty();
        let fill = ui.visuals().selection.bg_fill;
        let text = RichText::new("Optimize").strong();
        let button = ui.add_enabled(ready, Button::new(text).fill(fill));
        let button = button.on_hover_text("Search for a better lens in the background, on a copy");
        let why = if under_way { "A search is under way" } else { NO_VARIABLES };
        if button.on_disabled_hover_text(why).clicked() {
            let goal = self.aims.goal();
            wishes.push(Command::Optimize { method: self.method, goal });
        }
    }

    fn method(&mut self, ui: &mut Ui, under_way: bool) {
        ui.horizontal(|ui| {
            ui.weak("Method");
            ui.add_enabled_ui(!under_way, |ui| methods(ui, &mut self.method));
        });
    }
}

pub(super) fn methods(ui: &mut Ui, chosen: &mut Method) {
    let combo = ComboBox::from_id_salt("method").selected_text(chosen.name()).width(160.0);
    let combo = combo.show_ui(ui, |ui| {
        for method in [Method::DampedLeastSquares, Method::Adam] {
            ui.selectable_value(chosen, method, method.name());
        }
    });
    combo.response.accessible_name("Method");
}

/// How the search stands, and the numbers a designer reads first, before and after.
fn progress(ui: &mut Ui, view: &View, search: &Search) {
    let standing = match search.standing {
        Standing::Running => "Running",
        Standing::Paused => "Paused",
        Standing::Stopped => "Stopped",
        Standing::Finished => "Finished",
    };
    let step = search.progress.as_ref().map_or(0, |progress| progress.step);
    ui.horizontal(|ui| {
        ui.strong(standing);
        ui.label(format!("after step {step}"));
        if let (Some(first), Some(last)) = (search.history.first(), search.progress.as_ref()) {
            ui.separator();
            ui.label(format!("merit {:.3e} to {:.3e}", first.current, last.best));
        }
    });
    ui.label(changes(view).join(", ")).on_hover_text(
        "Mean RMS radius of the spots, focal length, and the mean area of the pupils that gets \
         through: of the design and of the lens that the search shows",
    );
    let refused = search.progress.as_ref().and_then(|progress| progress.refused.as_ref());
    if let Some(why) = refused {
        let text = RichText::new(capital(&counted_from_one(why))).small();
        ui.label(text.color(ui.visuals().warn_fg_color))
            .on_hover_text("Steps that would make the lens invalid are refused and shortened");
    }
}

/// Spots and focal length of the design and of the lens that the search shows.
pub(super) fn changes(view: &View) -> Vec<String> {
    let short = |value: f64| number::show_digits(value, 4);
    let mut texts = Vec::new();
    let before = view.results.as_ref().and_then(|results| results.numbers.as_ref().ok());
    let after = view.preview.as_ref().and_then(|results| results.numbers.as_ref().ok());
    let (Some(before), Some(after)) = (before, after) else { return texts };
    if let (Some(old), Some(new)) = (mean_spot(before), mean_spot(after)) {
        texts.push(format!("mean RMS {} to {} µm", short(1e3 * old), short(1e3 * new)));
    }
    if let (Some(old), Some(new)) = (before.first().efl, after.first().efl) {
        texts.push(format!("f {} to {} mm", short(old), short(new)));
    }
    // A search that does not ask for light may buy sharpness with it: it is told beside the spots.
    let (old, new) = (light(before), light(after));
    if old > 0.0 {
        let change = number::show_digits(100.0 * (new / old - 1.0), 3);
        let sign = if new > old { "+" } else { "" };
        texts.push(format!("light {} to {} mm² ({sign}{change} %)", short(old), short(new)));
    }
    texts
}

/// The mean RMS radius of the fields with light, in mm.
fn mean_spot(numbers: &Numbers) -> Option<f64> {
    let lit = numbers.spots.value.iter().filter_map(|spot| spot.as_ref().ok());
    let radii: Vec<f64> = lit.map(|spot| spot.rms.value).collect();
    (!radii.is_empty()).then(|| radii.iter().sum::<f64>() / radii.len() as f64)
}
