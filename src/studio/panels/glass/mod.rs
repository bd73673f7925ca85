//! Glasses: a table to search and to sort, and a map; a click replaces the glass of the selected surface.

mod labels;
mod list;
mod map;
mod table;

use std::sync::Arc;

use egui::{Align, Button, ComboBox, Layout, RichText, TextEdit, Ui, vec2};

use super::{Panel, valid_edit};
use crate::lens::glass::{self, Glass};
use crate::lens::{Edit, GradientIndex, Lens, Medium, Row, SurfaceNumber};
use crate::merit::Goal;
use crate::optimize::DescentMethod;
use crate::session::{Command, SessionView};
use crate::studio::actions::Actions;
use crate::studio::cached::Cached;
use crate::studio::form::named_list;
use crate::studio::number;
use crate::studio::text::capitalize;
use crate::studio::text_input::error_color;
use list::{GlassColumn, GlassNumbers, GlassOrder, ListedGlass};
use map::{GlassMap, MapAxes};
use table::table;

/// The least width of the panel at which the map stands beside the table.
const BESIDE: f32 = 640.0;
/// The width of the table beside the map.
const TABLE: f32 = 522.0;
/// The share of the height that the map has above the table.
const ABOVE: f32 = 0.45;

/// The origin of a list: the search, the order, what distances count from, and the additions of glasses.
type ListKey = (String, GlassOrder, Option<GlassNumbers>, usize);

/// The panel.
#[derive(Debug, Default)]
pub struct GlassPanel {
    query: String,
    order: GlassOrder,
    axes: MapAxes,
    listed: Cached<ListKey, Arc<Result<Vec<ListedGlass>, String>>>,
    /// The glass under the pointer in the frame before.
    pointed: Option<&'static Glass>,
    /// The glass of the surface in the frame before, to which the table has scrolled.
    present: Option<&'static Glass>,
    /// The reason why the last click has replaced nothing.
    refused: Option<(RefusalPlace, String)>,
}

impl Panel for GlassPanel {
    fn title(&self) -> &'static str {
        "Glass"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        let surface = view.selected.filter(|surface| *surface < view.lens.surfaces.len());
        let medium = surface.map(|surface| &view.lens.surfaces[surface].medium);
        let numbers = medium.and_then(GlassNumbers::of);
        let near = numbers.filter(|_| self.order.column == GlassColumn::Distance);
        let key = (self.query.clone(), self.order, near, glass::additions());
        let listed = Arc::clone(
            self.listed
                .get(key, |(query, order, near, _)| Arc::new(list::list(query, *order, *near))),
        );
        let glasses = listed.as_deref().unwrap_or_default();
        self.controls(ui, view, (surface, glasses.len()), actions);
        self.status(ui, view, (medium.zip(numbers), glasses), actions);
        if let Err(why) = &*listed {
            ui.label(RichText::new(capitalize(why)).color(error_color(ui)));
        }
        if let Some(clicked) = self.body(ui, (&view.lens, surface, medium), glasses) {
            self.replace(view, clicked.glass, actions);
        }
    }
}

impl GlassPanel {
    /// The surface, the search, and what the map shows.
    fn controls(
        &mut self,
        ui: &mut Ui,
        view: &SessionView,
        (surface, count): (Option<usize>, usize),
        actions: &mut Actions,
    ) {
        ui.horizontal_wrapped(|ui| {
            choose_surface(ui, &view.lens, surface, actions);
            let line = TextEdit::singleline(&mut self.query)
                .hint_text("Search: lak schott nd=1.7.. vd=50..")
                .desired_width(200.0);
            let field = ui.add(line).accessible_name("Search the glasses");
            field.on_hover_text(
                "Parts of name and catalogue, ranges of nd, vd, price and density, status=preferred, lead=no: \
                 all must hold",
            );
            let nearest = self.order.column == GlassColumn::Distance;
            let button = ui.selectable_label(nearest, "Nearest first");
            let hint = "The nearest glasses to that of the surface first: 0.001 in nd counts as much as \
                        0.5 in vd";
            if button.on_hover_text(hint).clicked() {
                let column = if nearest { GlassColumn::Name } else { GlassColumn::Distance };
                self.order = GlassOrder { column, descending: false };
            }
            let combo = ComboBox::from_id_salt("axes of the map").selected_text(self.axes.name());
            let shown = combo.width(92.0).show_ui(ui, |ui| {
                for (axes, name) in MapAxes::ALL {
                    ui.selectable_value(&mut self.axes, axes, name);
                }
            });
            named_list(ui, shown, "Axes of the map");
            let noun = if count == 1 { "glass" } else { "glasses" };
            ui.weak(format!("{count} {noun}"));
            self.exchange_button(ui, view, count, actions);
        });
    }

    /// A button that lets the optimizer try the listed glasses in place of those of the lens.
    fn exchange_button(
        &self,
        ui: &mut Ui,
        view: &SessionView,
        count: usize,
        actions: &mut Actions,
    ) {
        let is_glass = |row: &Row| matches!(row.medium, Medium::Glass(_) | Medium::Model { .. });
        let reason = if view.optimization.is_active() {
            "An optimization is running"
        } else if view.lens.variables.is_empty() {
            "No number is variable: the lens could not follow another glass"
        } else if count == 0 || !view.lens.surfaces.iter().any(is_glass) {
            "There is no glass to exchange"
        } else {
            ""
        };
        let goal = view.goal.as_ref().filter(|_| reason.is_empty());
        let button = ui.add_enabled(goal.is_some(), Button::new("Optimize with these"));
        let hint = "Optimizes a copy of the design, then exchanges its glasses for those listed here, as long \
                    as the merit falls; the Optimizer has the result";
        let button = button.on_hover_text(hint).on_disabled_hover_text(reason);
        if let (true, Some(goal)) = (button.clicked(), goal) {
            let (goal, glasses) = (Goal::clone(goal), Some(self.query.clone()));
            let method = DescentMethod::TrustRegion;
            actions.push(Command::Optimize { method, goal, glasses });
        }
    }

    /// The glass of the surface and the nearest one to it, or what a click needs.
    fn status(
        &mut self,
        ui: &mut Ui,
        view: &SessionView,
        (present, listed): (Option<(&Medium, GlassNumbers)>, &[ListedGlass]),
        actions: &mut Actions,
    ) {
        ui.horizontal_wrapped(|ui| {
            let of_now = |(place, _): &&(RefusalPlace, String)| *place == refusal_place(view);
            if let Some((_, why)) = self.refused.as_ref().filter(of_now) {
                ui.label(RichText::new(why).color(error_color(ui)));
                return;
            }
            let Some((medium, numbers)) = present else {
                ui.weak(match view.selected {
                    None => "Choose a surface: a click on a glass replaces the one behind it.",
                    Some(_) => "Behind this surface is no glass that could be replaced.",
                });
                return;
            };
            ui.label(RichText::new(describe(numbers, "")).small());
            let Some(nearest) = list::nearest(listed, numbers, catalogue_glass(medium)) else {
                return;
            };
            let apart = GlassNumbers {
                nd: nearest.glass.nd - numbers.nd,
                vd: nearest.glass.vd - numbers.vd,
                partial: nearest.partial.zip(numbers.partial).map(|(a, b)| a - b),
            };
            ui.label(RichText::new("Nearest:").small().weak());
            let name = nearest.glass.full_name();
            let button = ui.small_button(&name).on_hover_text(nearest.describe());
            if button.accessible_name(format!("Replace by the nearest glass, {name}")).clicked() {
                self.replace(view, nearest.glass, actions);
            }
            ui.label(RichText::new(describe(apart, "Δ")).small().weak());
        });
    }

    /// The table and the map; the glass that was clicked in one of them.
    fn body(
        &mut self,
        ui: &mut Ui,
        (lens, surface, medium): (&Lens, Option<usize>, Option<&Medium>),
        glasses: &[ListedGlass],
    ) -> Option<ListedGlass> {
        let present = medium.and_then(catalogue_glass);
        let follows = present.is_some() && self.present != present;
        self.present = present;
        let map =
            GlassMap { axes: self.axes, listed: glasses, lens, surface, pointed: self.pointed };
        let room = ui.available_size();
        let down = Layout::top_down(Align::Min);
        let (outcome, mapped) = if room.x > BESIDE {
            let shown = ui.horizontal_top(|ui| {
                let size = vec2(TABLE, room.y);
                let outcome = ui.allocate_ui_with_layout(size, down, |ui| {
                    table(ui, glasses, self.order, (present, follows))
                });
                (outcome.inner, ui.vertical(|ui| map.show(ui, room.y)).inner)
            });
            shown.inner
        } else {
            let mapped = map.show(ui, ABOVE * room.y);
            (table(ui, glasses, self.order, (present, follows)), mapped)
        };
        if let Some(column) = outcome.sorted {
            self.order = self.order.clicked(column);
        }
        self.pointed = outcome.pointed.map(|listed| listed.glass);
        let clicked = mapped.filter(|(_, clicked)| *clicked).map(|(listed, _)| listed);
        outcome.clicked.or(clicked)
    }

    /// Replaces the glass of the surface as one undo step, or keeps the reason why not.
    fn replace(&mut self, view: &SessionView, glass: &Glass, actions: &mut Actions) {
        self.refused = match replacement(view, glass) {
            Ok(edit) => {
                actions.extend([Command::Edit(edit), Command::CommitEdit]);
                None
            }
            Err(why) => Some((refusal_place(view), capitalize(&why))),
        };
    }
}

/// The selected surface, and whether a candidate is shown: a refusal holds as long as they stay.
type RefusalPlace = (Option<usize>, bool);

fn refusal_place(view: &SessionView) -> RefusalPlace {
    (view.selected, view.candidate.as_ref().is_some_and(|candidate| candidate.shown))
}

/// The edit that replaces the glass behind the selected surface.
fn replacement(view: &SessionView, glass: &Glass) -> Result<Edit, String> {
    if view.candidate.as_ref().is_some_and(|candidate| candidate.shown) {
        return Err(
            "a candidate is shown in place of the design; accept or discard it first".into()
        );
    }
    let surface = view.selected.ok_or("choose a surface with glass behind it first")?;
    let row = view.lens.surfaces.get(surface).ok_or("this surface has no glass behind it")?;
    let new = Medium::Glass(glass.full_name());
    let what = match &row.medium {
        Medium::Air => "air",
        Medium::Mirror => "a mirror",
        Medium::Glass(_) | Medium::Model { .. } | Medium::Index(_) | Medium::Grin(_) => "",
    };
    if !what.is_empty() {
        let number = SurfaceNumber::new(surface);
        return Err(format!("surface {number} has {what}; choose one with glass behind it"));
    }
    let medium = match &row.medium {
        Medium::Grin(old) => {
            Medium::Grin(Box::new(GradientIndex { base: new, ..GradientIndex::clone(old) }))
        }
        _ => new,
    };
    let edit = Edit::SetMedium { surface, medium };
    valid_edit(&view.lens, edit)
}

/// The catalogue glass of a medium, that of its base for a gradient.
fn catalogue_glass(medium: &Medium) -> Option<&'static Glass> {
    match medium {
        Medium::Glass(name) => glass::find(name),
        Medium::Grin(gradient) => catalogue_glass(&gradient.base),
        Medium::Air | Medium::Mirror | Medium::Model { .. } | Medium::Index(_) => None,
    }
}

/// The choice of the surface, of those with glass behind them.
fn choose_surface(ui: &mut Ui, lens: &Lens, surface: Option<usize>, actions: &mut Actions) {
    ui.label("Surface");
    let name = |i: usize| format!("{}  {}", i + 1, medium_name(&lens.surfaces[i].medium));
    let title = surface.map_or_else(|| "none".to_owned(), name);
    let combo = ComboBox::from_id_salt("surface of the glass").selected_text(title).width(150.0);
    let shown = combo.show_ui(ui, |ui| {
        for (i, row) in lens.surfaces.iter().enumerate() {
            let is_glass = !matches!(row.medium, Medium::Air | Medium::Mirror);
            if is_glass && ui.selectable_label(surface == Some(i), name(i)).clicked() {
                actions.push(Command::Select(Some(i)));
            }
        }
    });
    named_list(ui, shown, "Surface whose glass is replaced");
}

fn medium_name(medium: &Medium) -> String {
    match medium {
        Medium::Air => "air".to_owned(),
        Medium::Mirror => "mirror".to_owned(),
        Medium::Glass(name) => name.clone(),
        Medium::Model { .. } => "model glass".to_owned(),
        Medium::Index(index) => format!("index {}", number::format_digits(*index, 5)),
        Medium::Grin(gradient) => format!("gradient on {}", medium_name(&gradient.base)),
    }
}

/// The three numbers in a line, each behind a sign.
fn describe(GlassNumbers { nd, vd, partial }: GlassNumbers, sign: &str) -> String {
    let rest = partial.map_or_else(String::new, |partial| format!(", {sign}PgF {partial:.4}"));
    format!("{sign}nd {nd:.5}, {sign}vd {vd:.2}{rest}")
}
