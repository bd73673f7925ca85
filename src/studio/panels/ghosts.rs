//! Light that two surfaces reflect on its way to the image: a list of the pairs, one of which the layout
//! shows.

use egui::{ComboBox, Grid, RichText, ScrollArea, Ui};

use super::figure_view::export_menu;
use super::{Panel, displayed_results, field_name, show_missing_results};
use crate::analysis::{Coating, Ghost};
use crate::lens::{Fields, SurfaceNumber};
use crate::report::FigureKind;
use crate::session::{Command, FieldGhosts, PanelSetting, SessionView};
use crate::studio::actions::Actions;
use crate::studio::form::named_list;
use crate::studio::number;
use crate::studio::text::capitalize;

/// The coatings that can be chosen.
const COATINGS: [Coating; 5] = [
    Coating::Bare,
    Coating::SingleLayer,
    Coating::VCoat,
    Coating::Flat(0.005),
    Coating::Flat(0.002),
];

/// The panel.
#[derive(Debug, Default)]
pub struct GhostsPanel {
    /// The index of the field of the list.
    field: usize,
}

impl Panel for GhostsPanel {
    fn title(&self) -> &'static str {
        "Ghosts"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        let Some((results, numbers)) = displayed_results(view) else {
            return show_missing_results(ui, view);
        };
        let fields = results.lens.fields_at(results.settings.zoom);
        self.field = self.field.min(fields.values.len().saturating_sub(1));
        self.choices(ui, fields, view, actions);
        let Some(found) = &numbers.ghosts else {
            ui.weak("Computing …");
            return;
        };
        match &found.value {
            Ok(ghosts) => self.list(ui, (ghosts, found.ms), view, actions),
            Err(why) => {
                ui.weak(capitalize(&why.to_string()));
            }
        }
    }
}

impl GhostsPanel {
    /// The coating and the field.
    fn choices(&mut self, ui: &mut Ui, fields: &Fields, view: &SessionView, actions: &mut Actions) {
        ui.horizontal_wrapped(|ui| {
            let mut coating = view.settings.coating;
            let name = |coating: Coating| capitalize(&coating.to_string());
            let combo = ComboBox::from_id_salt("coating").selected_text(name(coating));
            let shown = combo.show_ui(ui, |ui| {
                for choice in COATINGS {
                    ui.selectable_value(&mut coating, choice, name(choice));
                }
            });
            named_list(ui, shown, "Coating between air and glass");
            if coating != view.settings.coating {
                actions.push(Command::Show(PanelSetting::Coating(coating)));
            }
            for (i, point) in fields.values.iter().enumerate() {
                ui.selectable_value(&mut self.field, i, field_name(fields.kind, *point));
            }
            export_menu(ui, FigureKind::Ghosts, actions);
        });
    }

    /// The ghosts of the field, the brightest first.
    fn list(
        &self,
        ui: &mut Ui,
        (ghosts, ms): (&FieldGhosts, f64),
        view: &SessionView,
        actions: &mut Actions,
    ) {
        let Some(listed) = ghosts.fields.get(self.field) else { return };
        summary(ui, ghosts, listed, ms);
        ScrollArea::both().auto_shrink([false, false]).show(ui, |ui| {
            Grid::new("ghosts").striped(true).spacing([12.0, 2.0]).show(ui, |ui| {
                for (head, hint) in HEADS {
                    ui.weak(head).on_hover_text(hint);
                }
                ui.end_row();
                for ghost in listed {
                    row(ui, ghost, view.settings.ghost, actions);
                }
            });
        });
    }
}

/// The columns with their explanations.
const HEADS: [(&str, &str); 6] = [
    (
        "Surfaces",
        "Reflected first at the one, then at the other; click to see the light in the layout",
    ),
    ("Irradiance", "Mean over the ghost, relative to that at the entrance of the lens"),
    ("Radius, mm", "Of the even disc with the same RMS radius"),
    ("Share", "Of the light that fills the entrance pupil"),
    ("Focus, mm", "Behind the image plane, by first-order optics"),
    ("Centre, mm", "x and y in the image"),
];

fn summary(ui: &mut Ui, ghosts: &FieldGhosts, listed: &[Ghost], ms: f64) {
    let rays: usize = listed.iter().map(|ghost| ghost.patch.fates.total()).sum();
    let text = format!(
        "{:.2} % passes without reflection; {} pairs send {} % of the light to the image plane; {rays} \
         rays, {ms:.0} ms",
        100.0 * ghosts.ranking.direct,
        ghosts.ranking.ghosts.len(),
        number::format_digits(100.0 * ghosts.ranking.flux, 2),
    );
    ui.label(RichText::new(text).small().weak());
}

fn row(ui: &mut Ui, ghost: &Ghost, shown: Option<[usize; 2]>, actions: &mut Actions) {
    let pair = [ghost.paraxial.first, ghost.paraxial.second];
    let [first, second] = pair.map(SurfaceNumber::new);
    let is_shown = shown == Some(pair);
    let label = ui.selectable_label(is_shown, format!("{first}, {second}"));
    if label.accessible_name(format!("Ghost of surfaces {first} and {second}")).clicked() {
        let chosen = (!is_shown).then_some(pair);
        actions.push(Command::Show(PanelSetting::Ghost(chosen)));
    }
    let patch = &ghost.patch;
    let centre = patch.center.map_or("no ray arrives".to_owned(), |[x, y]| {
        let [x, y] = [x, y].map(|v| number::without_rounding(v, patch.radius));
        format!("{}, {}", number::format_digits(x, 3), number::format_digits(y, 3))
    });
    let focus = ghost.paraxial.focus.map(|focus| number::format_digits(focus, 4));
    ui.label(number::format_digits(patch.irradiance, 3));
    ui.label(number::format_digits(patch.radius, 4));
    ui.label(number::format_digits(0.5 * (patch.flux[0] + patch.flux[1]), 3));
    ui.label(focus.unwrap_or_else(|| "none".to_owned()));
    ui.label(centre);
    ui.end_row();
}
