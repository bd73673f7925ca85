//! The spot diagram of every field, all to one scale.
//!
//! The dots are for the eye; the radii come from integrals over the pupil, each with its error, its
//! rays and its time. Both are measured from the centroid of all colours.

use std::f64::consts::TAU;
use std::sync::Arc;

use egui::{
    Align, Color32, ComboBox, Label, Layout as Arrange, Rect, RichText, Sense, TextStyle, Ui,
    WidgetInfo,
};
use glam::DVec2;

use super::cell_layout::{CellLayout, scale_bar, show_within};
use super::figure_view::export_menu;
use super::widgets::swatch;
use super::{
    Panel, displayed_results, field_name, pupil_share, relative_error, show_missing_results,
};
use crate::analysis::{Estimate, Spot};
use crate::lens::Fields;
use crate::report::FigureKind;
use crate::session::{Analyses, AnalysisResults, Command, SessionView};
use crate::studio::actions::Actions;
use crate::studio::cached::{ByAddress, Cached};
use crate::studio::draw::{Camera, RenderBackend, Scene, SceneCanvas};
use crate::studio::form::named_list;
use crate::studio::number;
use crate::studio::palette::{Palette, color32};

/// The tolerances that can be chosen, with their names.
const TOLERANCES: [(f64, &str); 3] = [(1e-2, "1 %"), (1e-3, "0.1 %"), (1e-6, "1e-6")];

/// The field of a cell above, three lines of numbers below.
const WORDS: CellLayout = CellLayout { above: 20.0, below: 47.0 };

/// The panel.
#[derive(Debug)]
pub struct SpotPanel {
    backend: RenderBackend,
    canvas: SceneCanvas,
    scene: Cached<SpotKey, Arc<Scene>>,
}

/// The key of the drawn dots.
#[derive(Debug, PartialEq)]
struct SpotKey {
    results: ByAddress<AnalysisResults>,
    cells: Vec<Rect>,
    palette: Palette,
    per_point: f32,
}

impl SpotPanel {
    /// An empty panel.
    pub const fn new(backend: RenderBackend) -> Self {
        Self { backend, canvas: SceneCanvas::new("spots"), scene: Cached::new() }
    }
}

impl Panel for SpotPanel {
    fn title(&self) -> &'static str {
        "Spot diagram"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        header(ui, view, actions);
        let Some((results, numbers)) = displayed_results(view) else {
            return show_missing_results(ui, view);
        };
        let (rect, response) = ui.allocate_exact_size(ui.available_size(), Sense::hover());
        response.widget_info(|| WidgetInfo::labeled(egui::Role::Image, true, "Spots"));
        let cells = WORDS.cells(rect, numbers.spots.value.len());
        self.draw(ui, rect, results, numbers, &cells);
        for (i, cell) in cells.iter().enumerate() {
            let fields = results.lens.fields_at(results.settings.zoom);
            labels(ui, *cell, fields, numbers, i);
        }
        draw_scale_bar(ui, &cells, half_width(numbers));
    }
}

impl SpotPanel {
    fn draw(
        &mut self,
        ui: &Ui,
        rect: Rect,
        results: &Arc<AnalysisResults>,
        numbers: &Analyses,
        cells: &[Rect],
    ) {
        let per_point = ui.ctx().pixels_per_point();
        let palette = Palette::for_visuals(ui.visuals());
        let relative = |cell: &Rect| WORDS.picture(*cell).translate(-rect.min.to_vec2());
        let cells = cells.iter().map(relative).collect();
        let source = SpotKey { results: results.into(), cells, palette, per_point };
        let scene = self.scene.get(source, |key| Arc::new(scene(ui, key, numbers)));
        // The scene is in points from the upper left corner, y up.
        let center = DVec2::new(f64::from(rect.width()), -f64::from(rect.height())) / 2.0;
        let camera = Camera { center, scale: per_point.into() };
        self.canvas.show(ui, rect, self.backend, scene, camera);
    }
}

fn header(ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
    ui.horizontal(|ui| {
        let palette = Palette::for_visuals(ui.visuals());
        for wavelength in &view.lens.wavelengths {
            swatch(ui, color32(palette.wavelength(wavelength.um)));
            ui.label(format!("{:.0} nm", 1e3 * wavelength.um));
        }
        ui.with_layout(Arrange::right_to_left(Align::Center), |ui| {
            export_menu(ui, FigureKind::Spots, actions);
            tolerance(ui, view, actions);
        });
    });
}

fn tolerance(ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
    let mut chosen = view.settings.tolerance;
    let known = TOLERANCES.iter().find(|(error, _)| *error == chosen);
    let text = known.map_or_else(|| format!("{chosen:e}"), |(_, name)| (*name).to_owned());
    let combo = ComboBox::from_id_salt("tolerance").width(64.0).selected_text(text);
    let shown = combo.show_ui(ui, |ui| {
        for (error, name) in TOLERANCES {
            ui.selectable_value(&mut chosen, error, name);
        }
    });
    named_list(ui, shown, "Allowed error")
        .on_hover_text("The tolerance of the numbers. As many rays are traced as it needs.");
    ui.weak("error below");
    if chosen != view.settings.tolerance {
        actions.push(Command::SetTolerance(chosen));
    }
}

/// Half of the width of every spot drawing, in mm.
pub(super) fn half_width(numbers: &Analyses) -> f64 {
    let lit = numbers.spots.value.iter().filter_map(|spot| spot.as_ref().ok());
    let widest = lit.map(|spot| spot.radius.value).fold(0.0, f64::max);
    let airy = numbers.airy.unwrap_or(0.0);
    1.12 * if widest > 0.0 { widest.max(1.1 * airy) } else { airy.max(1e-3) }
}

fn scene(ui: &Ui, source: &SpotKey, numbers: &Analyses) -> Scene {
    let palette = source.palette;
    let background = ui.visuals().panel_fill.to_srgba_unmultiplied();
    let mut scene = Scene::on(background);
    let half = half_width(numbers);
    for (field, cell) in source.cells.iter().enumerate() {
        let center = DVec2::new(cell.center().x.into(), -f64::from(cell.center().y));
        let scale = 0.5 * f64::from(cell.width()) / half;
        let frame = SpotFrame { center, half: 0.5 * f64::from(cell.width()), palette, scale };
        frame.draw(&mut scene);
        if let Some(airy) = numbers.airy {
            frame.draw_airy(&mut scene, airy, source.per_point);
        }
        if let Ok(spot) = &numbers.spots.value[field] {
            frame.draw_dots(&mut scene, numbers, spot, field, source.per_point);
        }
    }
    scene
}

/// The square of one field.
struct SpotFrame {
    center: DVec2,
    half: f64,
    palette: Palette,
    /// Points per mm.
    scale: f64,
}

impl SpotFrame {
    fn draw(&self, scene: &mut Scene) {
        let corner = |x: f64, y: f64| self.center + self.half * DVec2::new(x, y);
        let background = self.palette.background;
        let left = [corner(-1.0, -1.0), corner(-1.0, 1.0)];
        scene.strip(&left, &[corner(1.0, -1.0), corner(1.0, 1.0)], background);
        let faint = self.palette.faint;
        scene.line(corner(-1.0, 0.0), corner(1.0, 0.0), 1.0, faint);
        scene.line(corner(0.0, -1.0), corner(0.0, 1.0), 1.0, faint);
    }

    /// The first dark ring of a perfect lens, dashed.
    fn draw_airy(&self, scene: &mut Scene, radius: f64, per_point: f32) {
        let radius = radius * self.scale;
        let dashes = ((TAU * radius / 7.0) as usize).clamp(8, 90);
        let at = |turn: f64| self.center + radius * DVec2::from_angle(TAU * turn);
        if radius > 1.4 * self.half {
            return;
        }
        for dash in 0..dashes {
            let (from, to) = (dash as f64 / dashes as f64, (dash as f64 + 0.55) / dashes as f64);
            let middle = at(0.5 * (from + to));
            scene.polyline(&[at(from), middle, at(to)], 1.2 * per_point, self.palette.strong);
        }
    }

    /// The dots, short waves over long ones.
    fn draw_dots(
        &self,
        scene: &mut Scene,
        numbers: &Analyses,
        spot: &Spot,
        field: usize,
        per_point: f32,
    ) {
        let colors = &numbers.ray_model.value.channels;
        let mut scatters: Vec<_> =
            numbers.spot_points.value.iter().filter(|scatter| scatter.field == field).collect();
        let um = |wavelength: usize| colors[wavelength].um;
        scatters.sort_by(|a, b| um(b.wavelength).total_cmp(&um(a.wavelength)));
        let centroid = DVec2::new(spot.centroid[0].value, spot.centroid[1].value);
        for scatter in scatters {
            let [r, g, b, _] = self.palette.wavelength(um(scatter.wavelength));
            for point in &scatter.points {
                let from = self.scale * (DVec2::from(*point) - centroid);
                if from.abs().max_element() <= self.half {
                    scene.dot(self.center + from, 2.4 * per_point, [r, g, b, 205]);
                }
            }
        }
    }
}

/// The words of a cell: its field above the picture, its numbers below.
fn labels(ui: &mut Ui, cell: Rect, fields: &Fields, numbers: &Analyses, field: usize) {
    let spot = &numbers.spots.value[field];
    show_within(ui, WORDS.above(cell), |ui| {
        ui.horizontal(|ui| {
            field_label(ui, fields, field);
            clipped_label(ui, pupil_share(spot.as_ref().ok()));
        });
    });
    show_within(ui, WORDS.below(cell), |ui| {
        ui.spacing_mut().item_spacing.y = 1.0;
        match spot {
            Ok(spot) => radii(ui, spot),
            Err(why) => {
                let text = RichText::new(why.to_string()).small();
                ui.label(text.color(ui.visuals().warn_fg_color));
            }
        }
    });
}

fn field_label(ui: &mut Ui, fields: &Fields, field: usize) {
    let palette = Palette::for_visuals(ui.visuals());
    let Some(point) = fields.values.get(field) else { return };
    let color = color32(palette.field(field));
    swatch(ui, color);
    ui.label(RichText::new(field_name(fields.kind, *point)).color(color));
}

/// The share of the pupil that gets through, if it is vignetted.
fn clipped_label(ui: &mut Ui, lit: f64) {
    if lit < 0.995 {
        let text = RichText::new(format!("{:.0} % of pupil", 100.0 * lit)).small();
        ui.label(text.weak()).on_hover_text(
            "The rest is vignetted. The integral follows the edge of the remaining pupil.",
        );
    }
}

fn radii(ui: &mut Ui, spot: &Spot) {
    radius_line(
        ui,
        "RMS",
        spot.rms,
        "Root mean square distance from the centroid of all colours, by quadrature over the \
         pupil; the dots are other rays",
    );
    radius_line(
        ui,
        "GEO",
        spot.radius,
        "Geometric radius: the largest distance from the centroid of all colours",
    );
    let time = spot.rms.milliseconds.map(|ms| format!(", {ms:.2} ms")).unwrap_or_default();
    let rays = RichText::new(format!("{} rays{time}", spot.radius.rays)).small();
    ui.label(rays.weak()).on_hover_text("Rays traced for these numbers, and the time");
}

/// A radius with its relative error in one line; in a narrow cell the error stands in the tooltip.
fn radius_line(ui: &mut Ui, name: &str, radius: Estimate, hint: &str) {
    let value = format!("{name} {} µm", number::format_digits(1e3 * radius.value, 4));
    let whole = format!("{value}{}", relative_error(radius));
    let font = TextStyle::Small.resolve(ui.style());
    let layout = ui.painter().layout_no_wrap(whole.clone(), font, Color32::PLACEHOLDER);
    let fits = layout.size().x <= ui.available_width();
    let label = Label::new(RichText::new(if fits { &whole } else { &value }).small()).truncate();
    ui.add(label).on_hover_text(format!("{whole}\n{hint}"));
}

/// The scale of all cells, in the first one.
fn draw_scale_bar(ui: &Ui, cells: &[Rect], half: f64) {
    let Some(first) = cells.first().map(|cell| WORDS.picture(*cell)) else { return };
    scale_bar(ui, first, 0.5 * f64::from(first.width()) / half, 0.4);
}
