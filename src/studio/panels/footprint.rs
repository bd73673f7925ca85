//! The edge of every field's beam on a surface, with the rim of the surface.

use std::f64::consts::TAU;

use egui::{ComboBox, RichText, Role, Ui, WidgetInfo};
use egui_plot::{Line, LineStyle, PlotPoints};

use super::figure_view::export_menu;
use super::widgets::{fixed_plot, swatch};
use super::{Panel, displayed_results, field_name, show_missing_results};
use crate::analysis::Footprint;
use crate::lens::{Lens, Quantity};
use crate::report::FigureKind;
use crate::session::{AnalysisResults, FieldFootprints, SessionView};
use crate::studio::actions::Actions;
use crate::studio::form::named_list;
use crate::studio::number;
use crate::studio::palette::{Palette, color32};

/// The lowest plot, in points.
const LOWEST: f32 = 120.0;
/// The height of the list of surfaces, in points.
const MENU: f32 = 360.0;
/// The number of corners of a drawn rim.
const CORNERS: usize = 96;

/// The panel.
#[derive(Debug, Default)]
pub struct FootprintPanel {
    /// The surface that was chosen; `None` for the one that is selected, or else the first.
    surface: Option<usize>,
}

impl Panel for FootprintPanel {
    fn title(&self) -> &'static str {
        "Footprint"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        let Some((results, numbers)) = displayed_results(view) else {
            return show_missing_results(ui, view);
        };
        let Some(footprints) = &numbers.footprints else {
            ui.weak("Computing …");
            return;
        };
        let image = results.lens.surfaces.len();
        let surface = self.surface.or(view.selected).unwrap_or(0).min(image);
        self.header(ui, &results.lens, (surface, footprints.ms), actions);
        let zoom = results.settings.zoom;
        let rim = results.lens.parameter_at(zoom, surface, Quantity::SemiDiameter);
        let rim = results.lens.get(rim);
        legend(ui, results, &footprints.value, (surface, rim));
        outlines(ui, &footprints.value, (surface, rim));
    }
}

impl FootprintPanel {
    /// The choice of the surface, and the time.
    fn header(
        &mut self,
        ui: &mut Ui,
        lens: &Lens,
        (shown, ms): (usize, f64),
        actions: &mut Actions,
    ) {
        ui.horizontal(|ui| {
            let combo = ComboBox::from_id_salt("footprint surface").height(MENU);
            let combo = combo.selected_text(surface_name(lens, shown)).show_ui(ui, |ui| {
                ui.selectable_value(&mut self.surface, None, "The selected surface");
                for surface in 0..=lens.surfaces.len() {
                    let name = surface_name(lens, surface);
                    ui.selectable_value(&mut self.surface, Some(surface), name);
                }
            });
            named_list(ui, combo, "Surface of the footprint");
            export_menu(ui, FigureKind::Footprint(shown), actions);
            ui.label(RichText::new(format!("primary wavelength, {ms:.1} ms")).small().weak());
        });
    }
}

fn surface_name(lens: &Lens, surface: usize) -> String {
    match lens.surfaces.get(surface) {
        None => "Image plane".to_owned(),
        Some(row) if row.stop => format!("Surface {} (stop)", surface + 1),
        Some(_) => format!("Surface {}", surface + 1),
    }
}

/// The fields with how far their beams reach from the axis, and the rim.
fn legend(
    ui: &mut Ui,
    results: &AnalysisResults,
    found: &FieldFootprints,
    (surface, rim): (usize, Option<f64>),
) {
    let palette = Palette::for_visuals(ui.visuals());
    let fields = results.lens.fields_at(results.settings.zoom);
    ui.horizontal_wrapped(|ui| {
        for (i, (prints, point)) in found.iter().zip(&fields.values).enumerate() {
            let color = color32(palette.field(i));
            swatch(ui, color);
            let reach = match prints {
                Ok(prints) => format!("{} mm", number::format_digits(prints[surface].reach, 5)),
                Err(why) => why.to_string(),
            };
            let name = field_name(fields.kind, *point);
            ui.label(RichText::new(format!("{name}: {reach}")).color(color));
        }
        let rim = rim.map(|rim| format!("rim {} mm", number::format_digits(rim, 5)));
        ui.weak(rim.unwrap_or_else(|| "no rim".to_owned()));
    });
}

/// The footprints on a surface, each with the index of its field.
fn footprints_on(
    found: &FieldFootprints,
    surface: usize,
) -> impl Iterator<Item = (usize, &Footprint)> {
    let prints = found.iter().enumerate();
    prints.filter_map(move |(i, prints)| Some((i, prints.as_ref().ok()?.get(surface)?)))
}

fn outlines(ui: &mut Ui, found: &FieldFootprints, (surface, rim): (usize, Option<f64>)) {
    let palette = Palette::for_visuals(ui.visuals());
    let height = (ui.available_height() - 4.0).max(LOWEST);
    let plot = fixed_plot(ui, "footprint", height).data_aspect(1.0);
    let plot = plot.x_axis_label("x, mm").y_axis_label("y, mm");
    let shown = plot.show(ui, |plot| {
        if let Some(rim) = rim {
            let corner = |i: usize| {
                let (sin, cos) = (TAU * i as f64 / CORNERS as f64).sin_cos();
                [rim * cos, rim * sin]
            };
            let circle: PlotPoints<'_> = (0..=CORNERS).map(corner).collect();
            let line = Line::new("rim", circle).style(LineStyle::dashed_dense());
            plot.line(line.color(color32(palette.strong)));
        }
        for (i, print) in footprints_on(found, surface) {
            let edge = print.outline.iter().chain(print.outline.first()).copied();
            let points: PlotPoints<'_> = edge.collect();
            let line = Line::new(format!("field {}", i + 1), points).width(1.5);
            plot.line(line.color(color32(palette.field(i))));
        }
    });
    let words = footprints_on(found, surface)
        .map(|(i, print)| format!("field {} reaches {:.4} mm", i + 1, print.reach));
    let words = format!("Footprint: {}", words.collect::<Vec<_>>().join(", "));
    shown.response.widget_info(|| WidgetInfo::labeled(Role::Image, true, &words));
}
