//! The modulation transfer function of every field: against spatial frequency with the limit that diffraction
//! sets, over the field, and through focus.

use std::sync::Arc;

use egui::{Button, DragValue, Response, RichText, ScrollArea, Ui, WidgetInfo};
use egui_plot::{Line, LineStyle, PlotPoints};

use super::figure_view::{ChartForm, accuracy_section, export_menu, notes, titled_chart};
use super::widgets::{fixed_plot, plot_curve, swatch};
use super::{Panel, displayed_results, field_name, plain_error, show_missing_results};
use crate::analysis::{AnalysisError, MtfCurve, TransferValue};
use crate::lens::Fields;
use crate::report::FigureKind;
use crate::session::{
    Analyses, AnalysisResults, Command, ContrastPage, FieldContrast, FieldContrasts, PanelSetting,
    SessionView, Timed, analysis_figure,
};
use crate::studio::actions::Actions;
use crate::studio::number;
use crate::studio::palette::{Palette, color32};

/// The height of a line of numbers below the plot.
const LINE: f32 = 23.0;
/// The lowest plot.
const LOWEST: f32 = 120.0;
/// The opacity of what belongs to the lens before.
const FAINT: f32 = 0.45;

/// The pages with their names.
const PAGES: [(ContrastPage, &str, &str); 3] = [
    (ContrastPage::Frequency, "Frequency", "Contrast against spatial frequency"),
    (
        ContrastPage::Field,
        "Field",
        "Contrast at a few frequencies from the axis to the edge of the field",
    ),
    (ContrastPage::Focus, "Focus", "Contrast at a frequency against the shift of the image plane"),
];

/// The panel. It shows the last contrasts, faint, until those of a changed lens are there.
#[derive(Debug, Default)]
pub struct ContrastPanel {
    /// The last results of each page.
    last: [Option<Arc<AnalysisResults>>; 3],
}

impl Panel for ContrastPanel {
    fn title(&self) -> &'static str {
        "MTF"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        let Some((results, numbers)) = displayed_results(view) else {
            return show_missing_results(ui, view);
        };
        let page = view.settings.contrast_page;
        header(ui, view, numbers, actions);
        let known = numbers.contrast_accuracy.is_some();
        let subject = (&**results, known);
        let open = accuracy_section(ui, FigureKind::ContrastAccuracy, subject, actions);
        if open != view.settings.contrast_accuracy {
            actions.push(Command::Show(PanelSetting::ContrastAccuracy(open)));
        }
        let is_current = is_computed(numbers, page);
        let last = &mut self.last[page as usize];
        if is_current {
            *last = Some(Arc::clone(results));
        }
        let Some(results) = last.clone() else {
            ui.weak("Computing …");
            return;
        };
        if page == ContrastPage::Frequency {
            return over_frequency(ui, &results, is_current);
        }
        if !is_current {
            ui.label(RichText::new("of the lens before; computing …").small());
            ui.multiply_opacity(FAINT);
        }
        other_page(ui, &results, page);
    }
}

const fn figure_kind(page: ContrastPage) -> FigureKind {
    match page {
        ContrastPage::Frequency => FigureKind::Contrast,
        ContrastPage::Field => FigureKind::FieldContrast,
        ContrastPage::Focus => FigureKind::FocusContrast,
    }
}

const fn is_computed(numbers: &Analyses, page: ContrastPage) -> bool {
    match page {
        ContrastPage::Frequency => numbers.contrasts.is_some(),
        ContrastPage::Field => numbers.field_contrast.is_some(),
        ContrastPage::Focus => numbers.focus_contrasts.is_some(),
    }
}

/// The choice of the page, the frequency, and the menu of files.
fn header(ui: &mut Ui, view: &SessionView, numbers: &Analyses, actions: &mut Actions) {
    let shown = view.settings.contrast_page;
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.x = 2.0;
        for (page, name, hint) in PAGES {
            let button = Button::selectable(shown == page, name);
            if ui.add(button).on_hover_text(hint).clicked() && page != shown {
                actions.push(Command::Show(PanelSetting::ContrastPage(page)));
            }
        }
        if shown != ContrastPage::Frequency {
            frequency(ui, view, numbers, actions);
        }
        export_menu(ui, figure_kind(shown), actions);
    });
}

/// The frequency of contrast over the field and through focus.
fn frequency(ui: &mut Ui, view: &SessionView, numbers: &Analyses, actions: &mut Actions) {
    let over_field = || numbers.field_contrast.as_ref()?.value.frequencies.last().copied();
    let in_focus = || numbers.focus_contrasts.as_ref().map(|found| found.value.frequency);
    let present =
        if view.settings.contrast_page == ContrastPage::Field { over_field() } else { in_focus() };
    let asked = view.settings.contrast_frequency;
    let Some(mut frequency) = asked.or(present) else { return };
    let speed = (0.01 * frequency).max(0.01);
    let drag = DragValue::new(&mut frequency)
        .speed(speed)
        .range(0.01..=1e5)
        .suffix(" /mm")
        .custom_formatter(|value, _| number::format_digits(value, 4));
    let hint = "Cycles/mm; over the field also at a half and a quarter of it";
    let field = ui.add(drag).on_hover_text(hint);
    if field.accessible_name("Spatial frequency").changed() {
        actions.push(Command::Show(PanelSetting::ContrastFrequency(Some(frequency))));
    }
    if asked.is_some()
        && ui.button("Auto").on_hover_text("A frequency that the lens resolves well").clicked()
    {
        actions.push(Command::Show(PanelSetting::ContrastFrequency(None)));
    }
}

/// The contrast of the fields against frequency, with a line of numbers for each.
fn over_frequency(ui: &mut Ui, results: &AnalysisResults, is_current: bool) {
    let Ok(numbers) = &results.analyses else { return };
    let Some(contrasts) = &numbers.contrasts else { return };
    let lines = 2 + contrasts.value.fields.len();
    let height = (ui.available_height() - LINE * lines as f32).max(LOWEST);
    legend(ui, is_current);
    if !is_current {
        ui.multiply_opacity(FAINT);
    }
    plot(ui, &contrasts.value, height);
    let fields = results.lens.fields_at(results.settings.zoom);
    ScrollArea::vertical().show(ui, |ui| {
        for (i, field) in contrasts.value.fields.iter().enumerate() {
            field_line(ui, fields, field, i);
        }
    });
}

/// The contrast over the field or through focus, with its notes.
fn other_page(ui: &mut Ui, results: &AnalysisResults, page: ContrastPage) {
    let figure = match analysis_figure(figure_kind(page), results) {
        Ok(figure) => figure,
        Err(why) => return drop(ui.weak(why)),
    };
    let text = "tangential solid, sagittal dashed";
    ui.label(RichText::new(text).small().weak());
    let words = LINE * (2 + figure.notes.len()) as f32;
    let height = (ui.available_height() - words).max(LOWEST);
    ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
        for chart in figure.rows.iter().flatten() {
            let form = ChartForm { contains: [&[], &[0.0, 1.0]], ..ChartForm::new(height) };
            titled_chart(ui, (chart, &figure.colors), "", form);
        }
        notes(ui, &figure);
    });
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
    let hover = "The largest error of the curves, the rays traced for them, and the time";
    ui.label(RichText::new(rays).small().weak()).on_hover_text(match curve.sphere {
        0.0 => hover.to_owned(),
        left => format!("{hover}. The choice of the reference sphere leaves {left:.1e} of it"),
    });
    if let Some(why) = contrast.without_diffraction {
        let text = RichText::new("rays alone").small().color(ui.visuals().warn_fg_color);
        ui.label(text).on_hover_text(why.to_string());
    }
}
