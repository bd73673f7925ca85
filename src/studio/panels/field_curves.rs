//! Distortion, field curvature, lateral colour and relative illumination over the field, as lens data sheets
//! show them; the foci of the zones of the pupil; the image of a square grid.

use egui::{Button, RichText, ScrollArea, Ui};

use super::figure_view::{ChartForm, export_menu, notes, titled_chart};
use super::{Panel, displayed_results, plain_error, show_missing_results};
use crate::analysis::FieldCurves;
use crate::report::{AnalysisFigure, FigureKind};
use crate::session::{Analyses, Command, FieldPage, PanelSetting, SessionView, analysis_figure};
use crate::studio::actions::Actions;

/// The height of the title of a plot.
const TITLE: f32 = 24.0;
/// The lowest plot, and the narrowest one of two beside each other.
const LOWEST: f32 = 80.0;
const NARROWEST: f32 = 190.0;
/// The height of a line of notes.
const LINE: f32 = 17.0;

/// The pages with their names.
const PAGES: [(FieldPage, &str, &str); 3] = [
    (
        FieldPage::Curves,
        "Over the field",
        "Distortion, field curvature, lateral colour and illumination over the field",
    ),
    (
        FieldPage::Longitudinal,
        "Longitudinal",
        "Spherical aberration by zone of the pupil at every wavelength, and axial colour",
    ),
    (
        FieldPage::Grid,
        "Grid",
        "The image of a square grid against that of a lens without distortion",
    ),
];

/// Explanations of the charts, by the beginning of their titles.
const HINTS: [(&str, &str); 6] = [
    (
        "Distortion,",
        "Height of the real over that of the paraxial chief ray in the image plane in use, less 1. Dashed, where \
         the plane is out of the paraxial focus: over the height in the paraxial image, f tan θ for a distant \
         object, which a defocus changes near the axis too",
    ),
    (
        "Field curvature",
        "Foci of a narrow beam about the chief ray (Coddington) from the image plane, positive along the light",
    ),
    (
        "Lateral colour",
        "Chief ray of a wavelength against that of the primary one, positive away from the axis",
    ),
    ("Relative illumination", "Irradiance in the image of a uniform scene, relative to the axis"),
    (
        "Longitudinal",
        "Crossings of the rays of the axial point with the axis behind the image plane, against their height in \
         the pupil; at height 0 the paraxial focus",
    ),
    (
        "Distortion grid",
        "Image points of chief rays; dashed: of a lens without distortion. A corner is as far from the axis as \
         the farthest field",
    ),
];

/// The panel.
#[derive(Debug, Default)]
pub struct FieldCurvesPanel;

impl Panel for FieldCurvesPanel {
    fn title(&self) -> &'static str {
        "Field curves"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        let Some((results, numbers)) = displayed_results(view) else {
            return show_missing_results(ui, view);
        };
        let page = view.settings.field_page;
        let kind = figure_kind(page);
        header(ui, page, kind, actions);
        if !is_computed(numbers, page) {
            ui.weak("Computing …");
            return;
        }
        if let Some(curves) = numbers.field_curves.as_ref().filter(|_| page == FieldPage::Curves) {
            if curves.value.points.is_empty() {
                ui.weak("All fields are on the axis: there is nothing to show over the field");
                return;
            }
            summary(ui, &curves.value, curves.ms);
        }
        match analysis_figure(kind, results) {
            Ok(figure) if page == FieldPage::Curves => over_field(ui, &figure),
            Ok(figure) => one_chart(ui, &figure),
            Err(why) => drop(ui.weak(why)),
        }
    }
}

const fn figure_kind(page: FieldPage) -> FigureKind {
    match page {
        FieldPage::Curves => FigureKind::FieldCurves,
        FieldPage::Longitudinal => FigureKind::Longitudinal,
        FieldPage::Grid => FigureKind::Grid,
    }
}

const fn is_computed(numbers: &Analyses, page: FieldPage) -> bool {
    match page {
        FieldPage::Curves => numbers.field_curves.is_some(),
        FieldPage::Longitudinal => numbers.longitudinal.is_some(),
        FieldPage::Grid => numbers.grid.is_some(),
    }
}

/// The choice of the page, and the menu of files.
fn header(ui: &mut Ui, shown: FieldPage, kind: FigureKind, actions: &mut Actions) {
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.x = 2.0;
        for (page, name, hint) in PAGES {
            let button = Button::selectable(shown == page, name);
            if ui.add(button).on_hover_text(hint).clicked() && page != shown {
                actions.push(Command::Show(PanelSetting::FieldPage(page)));
            }
        }
        export_menu(ui, kind, actions);
    });
}

/// The number of rays, the error of the illumination and the time.
fn summary(ui: &mut Ui, curves: &FieldCurves, ms: f64) {
    let lights = || curves.points.iter().filter_map(|point| point.illumination.relative);
    let error = lights().map(|light| light.error).fold(0.0, f64::max);
    let rays: usize = lights().map(|light| light.rays).sum();
    let error = plain_error(100.0 * error, " %");
    let text = format!("illumination {error}, {rays} rays, {ms:.1} ms; primary wavelength");
    ui.label(RichText::new(text).small().weak());
}

fn hint(title: &str) -> &'static str {
    HINTS.iter().find(|(begin, _)| title.starts_with(begin)).map_or("", |(_, hint)| hint)
}

/// All charts over the field, two beside each other where there is room.
fn over_field(ui: &mut Ui, figure: &AnalysisFigure) {
    let charts: Vec<_> = figure.rows.iter().flatten().collect();
    let columns = if ui.available_width() < 2.0 * NARROWEST { 1 } else { 2 };
    let rows = charts.len().div_ceil(columns);
    let height = (ui.available_height() / rows as f32 - TITLE).max(LOWEST);
    ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
        ui.columns(columns, |uis| {
            for (i, chart) in charts.into_iter().enumerate() {
                let from_zero: &[f64] =
                    if chart.title.starts_with("Relative") { &[0.0, 100.0] } else { &[0.0] };
                let form = ChartForm { contains: [&[0.0], from_zero], ..ChartForm::new(height) };
                let subject = (chart, &figure.colors);
                titled_chart(&mut uis[i % columns], subject, hint(&chart.title), form);
            }
        });
    });
}

/// One chart with its notes below.
fn one_chart(ui: &mut Ui, figure: &AnalysisFigure) {
    let words = TITLE + LINE * figure.notes.len() as f32;
    let height = (ui.available_height() - words).max(1.5 * LOWEST);
    ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
        for chart in figure.rows.iter().flatten() {
            let pupil: [&[f64]; 2] = if chart.is_map { [&[], &[]] } else { [&[0.0], &[0.0, 1.0]] };
            let form = ChartForm { contains: pupil, ..ChartForm::new(height) };
            titled_chart(ui, (chart, &figure.colors), hint(&chart.title), form);
        }
        notes(ui, figure);
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files;
    use crate::session::{AnalysisResults, AnalysisSettings, analyze};
    use std::sync::Arc;

    /// The double Gauss is out of its paraxial focus: that is no distortion, and against the paraxial image
    /// it is one on the axis too, where a curve that began at 0 would jump.
    #[test]
    fn the_distortion_begins_beside_the_axis() {
        let bundled = &files::bundled_lenses()[0];
        let lens = files::parse(bundled.text.as_bytes(), bundled.name).unwrap().lens;
        let settings = AnalysisSettings { field_curves: true, ..AnalysisSettings::default() };
        let analyses = analyze(&lens, &settings);
        let lens = Arc::new(lens);
        let results = AnalysisResults { version: 1, lens, settings, analyses, ms: 1.0 };
        let figure = analysis_figure(FigureKind::FieldCurves, &results).unwrap();
        let [in_plane, in_focus] = [0, 1].map(|i| &figure.rows[0][0].curves[i].pieces[0]);
        assert!(in_plane.len() > 2 && in_plane[0][0] > 0.0, "{in_plane:?}");
        assert!(
            in_plane[0][1].abs() < 0.02 && in_focus[0][1].abs() > 0.05,
            "{in_plane:?} {in_focus:?}"
        );
    }
}
