//! The modulation transfer function of every field, with the limit that diffraction sets.

use std::sync::Arc;

use egui::{Response, RichText, Ui, WidgetInfo};
use egui_plot::{Line, LineStyle, PlotPoints};

use super::widgets::{fixed_plot, plot_curve, swatch};
use super::{Panel, displayed_results, field_name, plain_error, show_missing_results};
use crate::analysis::{AnalysisError, MtfCurve, TransferValue};
use crate::lens::Fields;
use crate::session::{AnalysisResults, FieldContrast, FieldContrasts, SessionView, Timed};
use crate::studio::actions::Actions;
use crate::studio::number;
use crate::studio::palette::{Palette, color32};

/// The height of a line of numbers below the plot.
const LINE: f32 = 23.0;
/// The lowest plot.
const LOWEST: f32 = 120.0;
/// The opacity of what belongs to the lens before.
const FAINT: f32 = 0.45;

/// The panel. It shows the last contrasts, faint, until those of a changed lens are there.
#[derive(Debug, Default)]
pub struct ContrastPanel {
    last: Option<Arc<AnalysisResults>>,
}

impl Panel for ContrastPanel {
    fn title(&self) -> &'static str {
        "MTF"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, _actions: &mut Actions) {
        let Some((results, numbers)) = displayed_results(view) else {
            return show_missing_results(ui, view);
        };
        let is_current = numbers.contrasts.is_some();
        if is_current {
            self.last = Some(Arc::clone(results));
        }
        let shown = self.last.as_ref().and_then(|last| Some((last, last.analyses.as_ref().ok()?)));
        let shown = shown.and_then(|(last, numbers)| Some((last, numbers.contrasts.as_ref()?)));
        let Some((results, contrasts)) = shown else {
            ui.weak("Computing …");
            return;
        };
        let lines = 2 + contrasts.value.fields.len();
        let height = (ui.available_height() - LINE * lines as f32).max(LOWEST);
        legend(ui, is_current);
        if !is_current {
            ui.multiply_opacity(FAINT);
        }
        plot(ui, &contrasts.value, height);
        let fields = results.lens.fields_at(results.settings.zoom);
        egui::ScrollArea::vertical().show(ui, |ui| {
            for (i, field) in contrasts.value.fields.iter().enumerate() {
                field_line(ui, fields, field, i);
            }
        });
    }
}

fn legend(ui: &mut Ui, is_current: bool) {
    if !is_current {
        ui.label(RichText::new("of the lens before; computing …").small());
        return;
    }
    let text = "tangential solid, sagittal dashed, diffraction limit dotted; all wavelengths";
    ui.label(RichText::new(text).small().weak());
}

fn plot(ui: &mut Ui, contrasts: &FieldContrasts, height: f32) {
    let palette = Palette::for_visuals(ui.visuals());
    let highest = contrasts.frequencies.last().copied().unwrap_or(1.0);
    let plot = fixed_plot(ui, "contrast", height).include_x(0.0).include_x(highest);
    let plot = plot.x_axis_label("cycles/mm").y_axis_label("contrast");
    let shown = plot.include_y(0.0).include_y(1.0).show(ui, |plot| {
        if let Some(limit) = &contrasts.limit {
            let points = contrasts.frequencies.iter().zip(limit).map(|(nu, value)| [*nu, *value]);
            let line = Line::new("diffraction limit", points.collect::<PlotPoints<'_>>());
            plot.line(line.color(color32(palette.strong)).style(LineStyle::dotted_loose()));
        }
        for (i, field) in contrasts.fields.iter().enumerate() {
            let Ok(contrast) = &field.value else { continue };
            let color = color32(palette.field(i));
            let tangential = curve_points(&contrast.curve, |point| point.tangential);
            plot.line(plot_curve(format!("T {i}"), tangential).color(color).width(1.6));
            let sagittal = curve_points(&contrast.curve, |point| point.sagittal);
            let dashed = LineStyle::dashed_loose();
            plot.line(Line::new(format!("S {i}"), sagittal).color(color).width(1.6).style(dashed));
        }
    });
    describe(&shown.response, contrasts);
}

fn curve_points(
    curve: &MtfCurve,
    section: impl Fn(&crate::analysis::MtfPoint) -> TransferValue,
) -> Vec<[f64; 2]> {
    let point = |point: &crate::analysis::MtfPoint| [point.frequency, section(point).modulus.value];
    curve.points.iter().map(point).collect()
}

fn describe(response: &Response, contrasts: &FieldContrasts) {
    let highest = contrasts.frequencies.last().copied().unwrap_or(0.0);
    let label = format!("Contrast against frequency up to {highest} cycles/mm");
    response.widget_info(|| WidgetInfo::labeled(egui::Role::Image, true, &label));
}

/// The numbers of a field: contrast at half of the highest frequency, wavefront, error, rays, time.
fn field_line(
    ui: &mut Ui,
    fields: &Fields,
    field: &Timed<Result<FieldContrast, AnalysisError>>,
    index: usize,
) {
    let palette = Palette::for_visuals(ui.visuals());
    ui.horizontal(|ui| {
        let color = color32(palette.field(index));
        swatch(ui, color);
        if let Some(point) = fields.values.get(index) {
            ui.label(RichText::new(field_name(fields.kind, *point)).color(color));
        }
        match &field.value {
            Ok(contrast) => numbers(ui, contrast, field.ms),
            Err(why) => {
                ui.label(RichText::new(why.to_string()).small().color(ui.visuals().warn_fg_color));
            }
        }
    });
}

fn numbers(ui: &mut Ui, contrast: &FieldContrast, ms: f64) {
    let curve = &contrast.curve;
    let Some(middle) = curve.points.get(curve.points.len() / 2) else { return };
    let [t, s] = [middle.tangential, middle.sagittal].map(|value| value.modulus.value);
    let worst = |part: f64, value: &TransferValue| part.max(value.modulus.error);
    let error = curve
        .points
        .iter()
        .fold(0.0, |error, point| worst(worst(error, &point.tangential), &point.sagittal));
    let at = number::format_digits(middle.frequency, 3);
    ui.label(RichText::new(format!("T {t:.3}  S {s:.3} at {at}/mm")).small());
    if let Ok(wavefront) = &contrast.wavefront {
        let rms = number::format_digits(wavefront.rms.value, 3);
        ui.label(RichText::new(format!("RMS W {rms} λ")).small())
            .on_hover_text("Standard deviation of the path difference at the primary wavelength");
    }
    let error = plain_error(error, "");
    let rays = format!("{error}, {} rays, {ms:.1} ms", curve.rays);
    ui.label(RichText::new(rays).small().weak())
        .on_hover_text("The largest error of the curves, the rays traced for them, and the time");
    if let Some(why) = contrast.without_diffraction {
        let text = RichText::new("rays alone").small().color(ui.visuals().warn_fg_color);
        ui.label(text).on_hover_text(why.to_string());
    }
}
