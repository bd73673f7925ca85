//! The pupil of each field: its outline, each side in the colour of what limits it.
//!
//! All pupils are drawn to one scale in the plane through the first vertex. The numbers below each
//! are integrals over it, with their error, their rays and their time.

mod picture;
mod sensitivities;
mod text;

use egui::{
    Align, ComboBox, Id, Layout as Arrange, Rect, Response, Sense, Ui, UiBuilder, WidgetInfo, vec2,
};

use super::cell_layout::{CellLayout, scale_bar, show_within};
use super::widgets::swatch;
use super::{Panel, displayed_results, show_missing_results, zoom_name};
use crate::analysis::{FieldPupil, PupilShape};
use crate::pupil::{PupilLimit, RayModel};
use crate::session::{self, Analyses, AnalysisResults, Command, PanelSetting, SessionView, Timed};
use crate::studio::actions::Actions;
use crate::studio::form::named_list;
use crate::studio::palette::{Palette, color32};
use crate::studio::text::capitalize;
use picture::{PupilPicture, PupilWindow};

/// The field of a cell above, four lines of numbers below; more where a pupil has more limits than
/// fit in one.
const WORDS: CellLayout = CellLayout { above: 20.0, below: 62.0 };
const LINE: f32 = 14.0;
/// The height of a picture that is not given up for the table below.
const PICTURE: f32 = 103.0;
/// The largest share of a drawing's width that the scale bar takes.
const BAR: f64 = 0.3;

/// The panel.
#[derive(Debug, Default)]
pub struct PupilPanel {
    /// Limits in the order in which they have turned up, so that none changes its colour while the
    /// lens is bent.
    known_limits: Vec<PupilLimit>,
    /// The number of surfaces of the lens that the limits belong to.
    surfaces: usize,
}

impl Panel for PupilPanel {
    fn title(&self) -> &'static str {
        "Pupil"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        let Some((results, numbers)) = displayed_results(view) else {
            return show_missing_results(ui, view);
        };
        let Some(pupils) = &numbers.pupils else {
            ui.weak("Computing…");
            return;
        };
        let pupils = &pupils.value;
        self.remember_limits(pupils, results.lens.surfaces.len());
        header(ui, view, pupils, actions);
        let shown = PupilView { known_limits: &self.known_limits, view, results, numbers, pupils };
        shown.legend(ui, actions);
        let all = ui.available_rect_before_wrap();
        let (words, _) = shown.layout_cells(ui, all);
        let table = sensitivities::height(ui, &shown, words.above + words.below + PICTURE);
        let (above, below) = all.split_top_bottom_at_y(all.bottom() - table);
        ui.scope_builder(UiBuilder::new().max_rect(above), |ui| shown.pictures(ui, actions));
        show_within(ui, below, |ui| sensitivities::show_table(ui, &shown, actions));
    }
}

impl PupilPanel {
    /// Notes limits that were not there before.
    fn remember_limits(&mut self, pupils: &session::FieldPupils, surfaces: usize) {
        if self.surfaces != surfaces {
            *self = Self { known_limits: Vec::new(), surfaces };
        }
        for limit in limits(pupils) {
            if !self.known_limits.contains(&limit) {
                self.known_limits.push(limit);
            }
        }
    }
}

/// All limits of all pupils, from the first surface to the last, the disc in front.
fn limits(pupils: &session::FieldPupils) -> Vec<PupilLimit> {
    let sides = pupils.fields.iter().filter_map(|pupil| match &pupil.value.shape {
        PupilShape::Outlined(outline) => Some(&outline.sides),
        _ => None,
    });
    let mut limits: Vec<PupilLimit> = sides.flatten().map(|side| side.limit).collect();
    limits.sort_by_key(|limit| match limit {
        PupilLimit::Surface(surface, hurdle) => Some((*surface, *hurdle)),
        PupilLimit::Disc | PupilLimit::Unaimed => None,
    });
    limits.dedup();
    limits
}

/// The explanation of the drawings.
const HINT: &str = "Shaded: rays that get through. Coloured: what ends them. Dashed: the ideal \
     entrance pupil, as it would be if no surface clipped. Rings: corners, where one limit takes \
     over from another. Cross: the centroid. In the plane through the first vertex, seen along the \
     axis; where the field reaches beyond 45°, seen along the beam of each field instead.";

fn header(ui: &mut Ui, view: &SessionView, pupils: &session::FieldPupils, actions: &mut Actions) {
    ui.horizontal(|ui| {
        wavelength(ui, view, pupils.wavelength, actions);
        ui.with_layout(Arrange::right_to_left(Align::Center), |ui| {
            let across = pupils.fields.iter().any(|pupil| pupil.value.across_beam);
            let plane = if across { "across the beam" } else { "in the plane of the first vertex" };
            ui.weak(plane).on_hover_text(HINT);
            if view.lens.zoom_positions() > 1 {
                ui.weak(format!("{},", zoom_name(&view.lens, view.settings.zoom)));
            }
        });
    });
}

/// The choice of the wavelength; only its name if there is one.
fn wavelength(ui: &mut Ui, view: &SessionView, shown: usize, actions: &mut Actions) {
    let palette = Palette::for_visuals(ui.visuals());
    let waves = &view.lens.wavelengths;
    let name =
        |i: usize| waves.get(i).map_or_else(String::new, |wave| format!("{:.1} nm", 1e3 * wave.um));
    if let Some(wave) = waves.get(shown) {
        swatch(ui, color32(palette.wavelength(wave.um)));
    }
    if waves.len() < 2 {
        ui.label(name(shown));
        return;
    }
    let mut chosen = shown;
    let combo = ComboBox::from_id_salt("pupil wavelength").width(80.0).selected_text(name(shown));
    let combo = combo.show_ui(ui, |ui| {
        for (i, wave) in waves.iter().enumerate() {
            let primary = if wave.primary { ", primary" } else { "" };
            ui.selectable_value(&mut chosen, i, format!("{}{primary}", name(i)));
        }
    });
    named_list(ui, combo, "Wavelength of the pupils");
    if chosen != shown {
        actions.push(Command::Show(PanelSetting::PupilWavelength(Some(chosen))));
    }
}

/// The content of one frame.
struct PupilView<'a> {
    known_limits: &'a [PupilLimit],
    view: &'a SessionView,
    results: &'a AnalysisResults,
    numbers: &'a Analyses,
    pupils: &'a session::FieldPupils,
}

impl PupilView<'_> {
    fn ray_model(&self) -> &RayModel {
        &self.numbers.ray_model.value
    }

    /// The name of a limit.
    fn limit_name(&self, limit: PupilLimit) -> String {
        self.ray_model().limit_name(limit)
    }

    fn limit_color(&self, palette: &Palette, limit: PupilLimit) -> egui::Color32 {
        if limit == PupilLimit::Disc {
            return color32(palette.strong);
        }
        let surfaces = || self.known_limits.iter().filter(|limit| **limit != PupilLimit::Disc);
        color32(palette.limit(surfaces().position(|known| *known == limit).unwrap_or(0)))
    }

    /// True if a limit belongs to the selected surface.
    fn is_selected(&self, limit: PupilLimit) -> bool {
        limit.surface().is_some() && limit.surface() == self.view.selected
    }

    /// Selects the surface of a limit, or clears the selection.
    fn select(&self, limit: PupilLimit, actions: &mut Actions) {
        let surface = limit.surface();
        let wanted = surface.filter(|surface| self.view.selected != Some(*surface));
        if surface.is_some() {
            actions.push(Command::Select(wanted));
        }
    }

    /// The colours of the limits; a click points out the surface.
    fn legend(&self, ui: &mut Ui, actions: &mut Actions) {
        let palette = Palette::for_visuals(ui.visuals());
        ui.horizontal_wrapped(|ui| {
            ui.spacing_mut().item_spacing = vec2(2.0, 0.0);
            for limit in limits(self.pupils) {
                let (color, name) =
                    (self.limit_color(&palette, limit), capitalize(&self.limit_name(limit)));
                let label = text::limit_button(ui, color, name, self.is_selected(limit));
                if label.on_hover_text(text::hint(limit)).clicked() {
                    self.select(limit, actions);
                }
            }
        });
    }

    /// The room for the words of all cells, and the cells.
    fn layout_cells(&self, ui: &Ui, rect: Rect) -> (CellLayout, Vec<Rect>) {
        let fields = &self.pupils.fields;
        let cells = WORDS.cells(rect, fields.len());
        let lines = |(pupil, cell): (&Timed<FieldPupil>, &Rect)| {
            self.lines(ui, &pupil.value, WORDS.below(*cell).width())
        };
        let most = fields.iter().zip(&cells).map(lines).max().unwrap_or(1);
        let below = WORDS.below + LINE * (most - 1) as f32;
        let words = CellLayout { below, ..WORDS };
        (words, words.cells(rect, fields.len()))
    }

    fn pictures(&self, ui: &mut Ui, actions: &mut Actions) {
        let (rect, _) = ui.allocate_exact_size(ui.available_size(), Sense::hover());
        let (words, cells) = self.layout_cells(ui, rect);
        let Some(first) = cells.first() else { return };
        let window = PupilWindow::around_pupils(self.pupils);
        let all = self.pupils.fields.iter().zip(&cells).enumerate();
        let pictures: Vec<_> = all
            .map(|(i, (pupil, cell))| {
                let rect = words.picture(*cell);
                let response = self.interact(ui, rect, i, &pupil.value);
                (PupilPicture::new(&pupil.value, &window, i, rect), response)
            })
            .collect();
        let pointed = pictures.iter().find_map(|(picture, response)| {
            let limit = picture.limit_near(response.hover_pos()?)?;
            Some((picture, response, limit))
        });
        if let Some((picture, response, limit)) = pointed {
            response.clone().on_hover_text_at_pointer(self.describe(picture.pupil, limit));
            if response.clicked() {
                self.select(limit, actions);
            }
        }
        let bold = |limit| self.is_selected(limit) || pointed.is_some_and(|p| p.2 == limit);
        for ((i, cell), (picture, _)) in cells.iter().enumerate().zip(&pictures) {
            picture.paint(ui, |palette, limit| self.limit_color(palette, limit), bold);
            show_within(ui, words.above(*cell), |ui| self.title(ui, i));
            self.message(ui, picture.rect, picture.pupil);
            show_within(ui, words.below(*cell), |ui| self.numbers(ui, i));
        }
        let first = words.picture(*first);
        scale_bar(ui, first, window.scale(first), BAR);
    }

    /// The response of the area of a pupil, with its accessible name.
    fn interact(&self, ui: &Ui, rect: Rect, field: usize, pupil: &FieldPupil) -> Response {
        let id = Id::unique("pupil").with(field);
        let response = ui.interact(rect, id, Sense::click());
        let name = format!("Pupil of field {}: {}", field + 1, self.summary(pupil));
        response.widget_info(|| WidgetInfo::labeled(egui::Role::Image, true, &name));
        response
    }
}
