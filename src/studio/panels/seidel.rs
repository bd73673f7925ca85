//! The third-order sums of a lens, surface by surface.

use egui::{Align, Color32, Grid, Layout as Arrange, RichText, ScrollArea, Ui, Vec2, vec2};

use super::figure_view::{ChartForm, export_menu, notes, titled_chart};
use super::{Panel, displayed_results, show_missing_results};
use crate::lens::Lens;
use crate::paraxial::{SEIDEL_SUM_NAMES, Seidel, SeidelSums};
use crate::report::{AnalysisFigure, FigureKind};
use crate::session::{SessionView, analysis_figure};
use crate::studio::actions::Actions;

/// The panel.
#[derive(Debug, Default)]
pub struct SeidelPanel {
    /// True for bars in place of numbers.
    bars: bool,
}

impl Panel for SeidelPanel {
    fn title(&self) -> &'static str {
        "Seidel sums"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        let Some((results, numbers)) = displayed_results(view) else {
            return show_missing_results(ui, view);
        };
        if numbers.seidel.value.is_some() {
            self.header(ui, actions);
        }
        if self.bars
            && let Ok(figure) = analysis_figure(FigureKind::Seidel, results)
        {
            return bars(ui, &figure);
        }
        ScrollArea::both().auto_shrink([false, false]).show(ui, |ui| match &numbers.seidel.value {
            Some(seidel) => sums(ui, &results.lens, seidel),
            None => drop(ui.weak(missing_sums(numbers.ray_model.value.has_grin()))),
        });
    }
}

impl SeidelPanel {
    fn header(&mut self, ui: &mut Ui, actions: &mut Actions) {
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = 2.0;
            let table = "The sums of every surface as numbers";
            ui.selectable_value(&mut self.bars, false, "Table").on_hover_text(table);
            let bars = "The sums of every surface as bars, that of the lens last";
            ui.selectable_value(&mut self.bars, true, "Bars").on_hover_text(bars);
            export_menu(ui, FigureKind::Seidel, actions);
        });
    }
}

/// The lowest and the narrowest chart of bars, and the height of its title.
const LOWEST: f32 = 70.0;
const NARROWEST: f32 = 190.0;
const TITLE: f32 = 24.0;
/// The height of the notes below the charts.
const WORDS: f32 = 40.0;
/// The widest bar.
const BAR: f32 = 12.0;

/// A chart of bars for each sum.
fn bars(ui: &mut Ui, figure: &AnalysisFigure) {
    let charts: Vec<_> = figure.rows.iter().flatten().collect();
    let columns = ((ui.available_width() / NARROWEST) as usize).clamp(1, 4);
    let rows = charts.len().div_ceil(columns);
    let room = ui.available_height() - WORDS;
    let height = (room / rows as f32 - TITLE).max(LOWEST);
    let surfaces = charts.first().map_or(1, |chart| chart.curves[0].pieces.len());
    let width = 0.6 * ui.available_width() / columns as f32 / (surfaces + 3) as f32;
    let ends = [0.0, (surfaces + 2) as f64];
    ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
        ui.columns(columns, |uis| {
            for (i, chart) in charts.into_iter().enumerate() {
                let contains: [&[f64]; 2] = [&ends, &[0.0]];
                let width = width.clamp(1.5, BAR);
                let form = ChartForm { contains, width, ..ChartForm::new(height) };
                titled_chart(&mut uis[i % columns], (chart, &figure.colors), "", form);
            }
        });
        notes(ui, figure);
    });
}

/// The reason why a lens has no sums.
const fn missing_sums(has_grin: bool) -> &'static str {
    if has_grin {
        "No third-order sums: those of a gradient-index medium are not implemented"
    } else {
        "No third-order sums: the lens has no paraxial chief ray"
    }
}

/// The height of a row.
const ROW: f32 = 14.0;
/// The room between two columns.
const GAP: f32 = 6.0;
/// The width of the column of surfaces.
const SURFACE: f32 = 48.0;

fn sums(ui: &mut Ui, lens: &Lens, seidel: &Seidel<f64>) {
    ui.label(RichText::new("Seidel sums, µm").strong()).on_hover_text(
        "Third-order wave aberrations at the edge of pupil and field, surface by surface \
         (Welford's S1 to S5, C1, C2); the tint shows where they come from",
    );
    ui.spacing_mut().interact_size.y = ROW;
    let width =
        ((ui.available_width() - SURFACE) / SEIDEL_SUM_NAMES.len() as f32 - GAP).clamp(34.0, 80.0);
    let cell = vec2(width, ROW);
    Grid::new("seidel").num_columns(8).spacing([GAP, 2.0]).striped(true).show(ui, |ui| {
        ui.weak("Surf");
        for (symbol, meaning) in SEIDEL_SUM_NAMES {
            right(ui, cell, |ui| drop(ui.weak(symbol).on_hover_text(meaning)));
        }
        ui.end_row();
        for (i, sums) in seidel.surfaces.iter().enumerate() {
            let stop = lens.surfaces.get(i).is_some_and(|row| row.stop);
            ui.label(if stop { format!("{} STO", i + 1) } else { (i + 1).to_string() });
            numbers(ui, cell, sums, &largest(seidel));
        }
        ui.strong("Sum");
        numbers(ui, cell, &seidel.total, &[f64::INFINITY; 7]);
    });
}

/// The largest contribution to each sum.
fn largest(seidel: &Seidel<f64>) -> [f64; 7] {
    let mut most = [0.0_f64; 7];
    for sums in &seidel.surfaces {
        for (most, value) in most.iter_mut().zip(sums.to_array()) {
            *most = most.max(value.abs());
        }
    }
    most
}

fn numbers(ui: &mut Ui, cell: Vec2, sums: &SeidelSums<f64>, largest: &[f64; 7]) {
    for (value, largest) in sums.to_array().into_iter().zip(largest) {
        let share = if *largest > 0.0 { value / largest } else { 0.0 };
        right(ui, cell, |ui| {
            let text = RichText::new(fixed(1e3 * value)).small();
            let tint = tint(ui, share);
            ui.label(text.background_color(tint));
        });
    }
    ui.end_row();
}

/// A number with at most five characters besides its sign, so that the columns have the same width.
fn fixed(value: f64) -> String {
    let size = value.abs();
    if size >= 1e5 || (size < 1e-3 && size > 0.0) {
        format!("{value:.1e}")
    } else if size >= 100.0 {
        format!("{value:.1}")
    } else {
        // Adding zero takes the sign from a zero.
        format!("{:.3}", value + 0.0)
    }
}

/// The tint of a contribution: red for positive, blue for negative.
fn tint(ui: &Ui, share: f64) -> Color32 {
    let color =
        if share > 0.0 { ui.visuals().error_fg_color } else { ui.visuals().hyperlink_color };
    color.gamma_multiply((0.4 * share.abs()) as f32)
}

/// Shows something at the right end of a cell.
fn right(ui: &mut Ui, cell: Vec2, show: impl FnOnce(&mut Ui)) {
    ui.allocate_ui_with_layout(cell, Arrange::right_to_left(Align::Center), show);
}
