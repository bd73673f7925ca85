//! Ray fans: the transverse aberration of every field across two sections of its pupil, or its path
//! differences.

use egui::{Button, RichText, ScrollArea, Ui};

use super::figure_view::{ChartForm, bare_chart, export_menu};
use super::widgets::swatch;
use super::{Panel, displayed_results, field_name, show_missing_results};
use crate::lens::Fields;
use crate::plot::CurveChart;
use crate::report::{AnalysisFigure, FigureKind};
use crate::session::{
    Analyses, AnalysisResults, Command, PanelSetting, SessionView, analysis_figure,
};
use crate::studio::actions::Actions;
use crate::studio::number;
use crate::studio::palette::{Palette, color32};

/// The height of the words of a field.
const WORDS: f32 = 22.0;
/// The lowest plot.
const LOWEST: f32 = 62.0;

/// The panel.
#[derive(Debug, Default)]
pub struct FansPanel;

impl Panel for FansPanel {
    fn title(&self) -> &'static str {
        "Ray fans"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        let Some((results, numbers)) = displayed_results(view) else {
            return show_missing_results(ui, view);
        };
        let paths = view.settings.path_fans;
        let page = if paths { FansPage::PATHS } else { FansPage::RAYS };
        header(ui, page, actions);
        let Some((errors, ms)) = page.outcomes(numbers) else {
            ui.weak("Computing …");
            return;
        };
        match analysis_figure(page.kind, results) {
            Ok(figure) => page.show(ui, results, (&figure, &errors, ms)),
            Err(why) => drop(ui.weak(why)),
        }
    }
}

/// The quantity that fans show.
#[derive(Debug, Clone, Copy, PartialEq)]
struct FansPage {
    kind: FigureKind,
    paths: bool,
    unit: &'static str,
    hint: &'static str,
    legend: &'static str,
}

impl FansPage {
    const RAYS: Self = Self {
        kind: FigureKind::Fans,
        paths: false,
        unit: "µm",
        hint: "Distance from the image point of the chief ray of the primary wavelength, on one scale, \
               against the coordinate in the stop from rim to rim",
        legend: "left: εy along y, right: εx along x of the stop",
    };
    const PATHS: Self = Self {
        kind: FigureKind::PathFans,
        paths: true,
        unit: "wavelengths",
        hint: "Path of the chief ray less that of the ray on the reference sphere about its image point, each \
               wavelength in its own waves and about its own chief ray, on one scale, against the pupil",
        legend: "left: along y, right: along x of the pupil",
    };

    /// The reason for each field why it has no fan, and the time; `None` while they are computed.
    fn outcomes(self, numbers: &Analyses) -> Option<(Vec<Option<String>>, f64)> {
        fn errors<T, E: ToString>(fields: &[Result<T, E>]) -> Vec<Option<String>> {
            fields.iter().map(|field| field.as_ref().err().map(ToString::to_string)).collect()
        }
        if self.paths {
            let found = numbers.path_fans.as_ref()?;
            return Some((errors(&found.value), found.ms));
        }
        let found = numbers.fans.as_ref()?;
        Some((errors(&found.value), found.ms))
    }

    fn show(
        self,
        ui: &mut Ui,
        results: &AnalysisResults,
        (figure, errors, ms): (&AnalysisFigure, &[Option<String>], f64),
    ) {
        let scale = scale(&figure.rows);
        let Ok(numbers) = &results.analyses else { return };
        self.legend(ui, numbers, scale, ms);
        let count = errors.len().max(1) as f32;
        let between = 2.0 * ui.spacing().item_spacing.y;
        let height = (ui.available_height() / count - WORDS - between - 1.0).max(LOWEST);
        let fields = results.lens.fields_at(results.settings.zoom);
        let mut lit = figure.rows.iter();
        ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
            for (field, error) in errors.iter().enumerate() {
                self.name(ui, fields, field);
                match (error, if error.is_none() { lit.next() } else { None }) {
                    (None, Some(row)) => sections(ui, figure, row, (scale, height)),
                    (Some(why), _) => warn(ui, why),
                    (None, None) => {}
                }
            }
        });
    }

    fn legend(self, ui: &mut Ui, numbers: &Analyses, scale: f64, ms: f64) {
        let palette = Palette::for_visuals(ui.visuals());
        ui.horizontal_wrapped(|ui| {
            for channel in &numbers.ray_model.value.channels {
                swatch(ui, color32(palette.wavelength(channel.um)));
                ui.label(RichText::new(format!("{:.0} nm", 1e3 * channel.um)).small());
            }
            let unit = self.unit;
            let scale = number::format_digits(scale, 3);
            let text = format!("in {unit}, all plots to {scale}; {ms:.1} ms");
            ui.label(RichText::new(text).small().weak()).on_hover_text(self.hint);
        });
    }

    fn name(self, ui: &mut Ui, fields: &Fields, field: usize) {
        let palette = Palette::for_visuals(ui.visuals());
        let Some(point) = fields.values.get(field) else { return };
        let color = color32(palette.field(field));
        ui.horizontal(|ui| {
            swatch(ui, color);
            ui.label(RichText::new(field_name(fields.kind, *point)).color(color));
            ui.label(RichText::new(self.legend).small().weak());
        });
    }
}

/// The choice between rays and paths, and the menu of files.
fn header(ui: &mut Ui, page: FansPage, actions: &mut Actions) {
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 2.0;
        for (paths, name, hint) in [
            (false, "Transverse", "Distances of the rays from the chief ray in the image plane"),
            (true, "OPD", "Optical path differences in wavelengths"),
        ] {
            let button = Button::selectable(page.paths == paths, name);
            if ui.add(button).on_hover_text(hint).clicked() && page.paths != paths {
                actions.push(Command::Show(PanelSetting::PathFans(paths)));
            }
        }
        export_menu(ui, page.kind, actions);
    });
}

fn warn(ui: &mut Ui, why: &str) {
    ui.label(RichText::new(why).small().color(ui.visuals().warn_fg_color));
}

/// The largest number that some fan shows.
fn scale(rows: &[Vec<CurveChart>]) -> f64 {
    let curves = rows.iter().flatten().flat_map(|chart| &chart.curves);
    let points = curves.flat_map(|curve| curve.pieces.iter().flatten());
    points.map(|[_, value]| value.abs()).fold(1e-3, f64::max)
}

/// The tangential section beside the sagittal one.
fn sections(ui: &mut Ui, figure: &AnalysisFigure, row: &[CurveChart], (scale, height): (f64, f32)) {
    let ends = [-scale, scale];
    let form = ChartForm {
        contains: [&[-1.0, 1.0], &ends],
        numbers: [false, true],
        has_name: false,
        width: 1.4,
        ..ChartForm::new(height)
    };
    ui.columns(2, |uis| {
        for (ui, chart) in uis.iter_mut().zip(row) {
            bare_chart(ui, (chart, &figure.colors), form);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::ChartCurve;

    #[test]
    fn the_scale_holds_the_largest_number_of_any_fan() {
        let chart = |value: f64| {
            let curve = ChartCurve::new("", 0, [(0.0, Some(0.5)), (1.0, Some(value))]);
            vec![CurveChart::new("", ["", ""], vec![curve])]
        };
        assert_eq!(scale(&[chart(1.0), chart(-7.0), Vec::new()]), 7.0);
    }
}
