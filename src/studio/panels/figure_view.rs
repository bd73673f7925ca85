//! Draws the charts of a figure, and asks for its file.

use egui::{CollapsingHeader, Color32, Label, RichText, Role, Ui, WidgetInfo};
use egui_plot::{HLine, LineStyle};

use super::widgets::{fixed_plot, plot_curve};
use crate::plot::{ChartCurve, CurveChart};
use crate::report::{AnalysisFigure, CurveColors, FigureFormat, FigureKind};
use crate::session::{AnalysisResults, analysis_figure};
use crate::studio::actions::Actions;
use crate::studio::file_dialog::FileRequest;
use crate::studio::number;
use crate::studio::palette::{Palette, color32};

/// The form of a chart in a panel.
#[derive(Debug, Clone, Copy)]
pub(super) struct ChartForm<'a> {
    /// The height of the plot in points.
    pub(super) height: f32,
    /// Places to the right and upwards that the axes contain, whatever the curves are.
    pub(super) contains: [&'a [f64]; 2],
    /// True if the axes have numbers.
    pub(super) numbers: [bool; 2],
    /// True if the axis to the right has its name.
    pub(super) has_name: bool,
    /// True if zero upwards is a place of its own, which is in the chart and has a line; false for logarithms.
    pub(super) has_zero: bool,
    /// The width of lines in points.
    pub(super) width: f32,
}

impl ChartForm<'_> {
    /// A chart of this height with all its words.
    pub(super) const fn new(height: f32) -> Self {
        let contains: [&[f64]; 2] = [&[], &[]];
        Self { height, contains, numbers: [true; 2], has_name: true, has_zero: true, width: 1.6 }
    }
}

/// A menu that asks for a file of what a panel shows.
pub(super) fn export_menu(ui: &mut Ui, kind: FigureKind, actions: &mut Actions) {
    let formats = [
        (FigureFormat::Table, "CSV…", "All numbers with errors, rays and times"),
        (FigureFormat::Image, "PNG…", "The charts as a picture"),
        (FigureFormat::Vector, "SVG…", "The charts as a drawing that keeps its sharpness"),
        (FigureFormat::Page, "PDF…", "The charts as a page"),
    ];
    let menu = ui.menu_button("Export", |ui| {
        for (format, text, hint) in formats {
            if ui.button(text).on_hover_text(hint).clicked() {
                actions.push(FileRequest::ExportFigure(kind, format));
                ui.close();
            }
        }
    });
    menu.response.on_hover_text(format!("Writes a file: {}", kind.name()));
}

/// The colour of a curve.
pub(super) fn curve_color(ui: &Ui, curve: &ChartCurve, colors: &CurveColors) -> Color32 {
    let palette = Palette::for_visuals(ui.visuals());
    match colors {
        _ if curve.color == ChartCurve::NEUTRAL => color32(palette.strong).gamma_multiply(0.7),
        CurveColors::Fields => color32(palette.field(curve.color)),
        CurveColors::Wavelengths(ums) => {
            color32(ums.get(curve.color).map_or(palette.strong, |um| palette.wavelength(*um)))
        }
    }
}

/// A chart below its title.
pub(super) fn titled_chart(
    ui: &mut Ui,
    (chart, colors): (&CurveChart, &CurveColors),
    hint: &str,
    form: ChartForm<'_>,
) {
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 6.0;
        let title = RichText::new(&chart.title).small().strong();
        let title = ui.add(Label::new(title).truncate());
        if !hint.is_empty() {
            title.on_hover_text(hint);
        }
        curve_names(ui, chart, colors);
    });
    bare_chart(ui, (chart, colors), form);
}

/// The names of several curves in their colours, one for each colour: a legend would hide them.
pub(super) fn curve_names(ui: &mut Ui, chart: &CurveChart, colors: &CurveColors) {
    let is_first = |i: usize| chart.curves[..i].iter().all(|c| c.color != chart.curves[i].color);
    let named: Vec<&ChartCurve> =
        (0..chart.curves.len()).filter(|i| is_first(*i)).map(|i| &chart.curves[i]).collect();
    if named.len() < 2 {
        return;
    }
    for curve in named {
        // Both sections of a field share its colour.
        let name = curve.name.strip_suffix(" T").unwrap_or(&curve.name);
        let color = curve_color(ui, curve, colors);
        ui.add(Label::new(RichText::new(name).small().color(color)).truncate());
    }
}

/// A chart without words above it.
pub(super) fn bare_chart(
    ui: &mut Ui,
    (chart, colors): (&CurveChart, &CurveColors),
    form: ChartForm<'_>,
) {
    let weak = ui.visuals().weak_text_color();
    let mut plot = fixed_plot(ui, &chart.title, form.height).show_axes(form.numbers);
    if chart.is_map {
        plot = plot.data_aspect(1.0).y_axis_label(chart.axes[1]);
    }
    plot = form.contains[0].iter().fold(plot, |plot, x| plot.include_x(*x));
    plot = form.contains[1].iter().fold(plot, |plot, y| plot.include_y(*y));
    if form.has_name {
        plot = plot.x_axis_label(chart.axes[0]);
    }
    let drawn: Vec<(Color32, &ChartCurve)> =
        chart.curves.iter().map(|curve| (curve_color(ui, curve, colors), curve)).collect();
    let shown = plot.show(ui, |plot| {
        if !chart.is_map && form.has_zero {
            plot.hline(HLine::new("", 0.0).color(weak).allow_hover(false));
        }
        for (color, curve) in drawn {
            let style = if curve.dashed { LineStyle::dashed_loose() } else { LineStyle::Solid };
            // A bar without height would be a dot.
            for piece in curve.pieces.iter().filter(|piece| piece.iter().any(|p| *p != piece[0])) {
                let line = plot_curve(curve.name.clone(), piece.iter().copied());
                plot.line(line.color(color).style(style).width(form.width));
            }
        }
    });
    let words = chart_words(chart);
    shown.response.widget_info(|| WidgetInfo::labeled(Role::Image, true, &words));
}

/// The curves that are described by their ends.
const DESCRIBED: usize = 12;

/// A chart in words, with the last value of its curves.
fn chart_words(chart: &CurveChart) -> String {
    let end = |curve: &ChartCurve| {
        let [x, y] = *curve.pieces.last()?.last()?;
        let [x, y] = [x, y].map(|v| number::format_digits(v, 4));
        Some(format!("{} {y} at {x}", curve.name))
    };
    let ends: Vec<String> = chart.curves.iter().filter_map(end).take(DESCRIBED).collect();
    format!("{}: {}, against {}", chart.title, ends.join(", "), chart.axes[0])
}

/// The height of a chart of error against time, in points.
const ACCURACY: f32 = 130.0;

/// A folded section with error against time of what a panel shows, which is measured once it is open. True if it
/// is.
pub(super) fn accuracy_section(
    ui: &mut Ui,
    kind: FigureKind,
    (results, is_known): (&AnalysisResults, bool),
    actions: &mut Actions,
) -> bool {
    let header = CollapsingHeader::new("Accuracy and time").id_salt(kind.name());
    let shown = header.show(ui, |ui| match analysis_figure(kind, results) {
        Ok(figure) => {
            for chart in figure.rows.iter().flatten() {
                ui.horizontal_wrapped(|ui| {
                    ui.label(RichText::new(chart.axes[1]).small());
                    curve_names(ui, chart, &figure.colors);
                    export_menu(ui, kind, actions);
                });
                let form = ChartForm { has_zero: false, ..ChartForm::new(ACCURACY) };
                bare_chart(ui, (chart, &figure.colors), form);
            }
            notes(ui, &figure);
        }
        Err(why) if is_known => drop(ui.weak(why)),
        Err(_) => drop(ui.weak("Measuring …")),
    });
    let hint = "Error against time of this lens on this machine, both in decimal logarithms";
    shown.header_response.on_hover_text(hint);
    shown.body_returned.is_some()
}

/// Errors, rays, times and refusals, small.
pub(super) fn notes(ui: &mut Ui, figure: &AnalysisFigure) {
    for note in &figure.notes {
        ui.label(RichText::new(note).small().weak());
    }
}
