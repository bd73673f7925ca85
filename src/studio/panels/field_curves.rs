//! Distortion, field curvature, lateral colour and relative illumination over the field, as lens data sheets
//! show them.

use egui::{Label, RichText, Ui, WidgetInfo};
use egui_plot::{HLine, LineStyle};

use super::widgets::{fixed_plot, plot_curve};
use super::{Panel, displayed_results, plain_error, show_missing_results};
use crate::analysis::{Distortion, FieldCurvePoint, FieldCurves};
use crate::lens::{FieldKind, Lens, Wavelength};
use crate::session::SessionView;
use crate::studio::actions::Actions;
use crate::studio::draw::Rgba;
use crate::studio::number;
use crate::studio::palette::{Palette, color32};

/// The height of the title of a plot.
const TITLE: f32 = 24.0;
/// The lowest plot, and the narrowest one of two beside each other.
const LOWEST: f32 = 80.0;
const NARROWEST: f32 = 190.0;

/// The panel.
#[derive(Debug, Default)]
pub struct FieldCurvesPanel;

impl Panel for FieldCurvesPanel {
    fn title(&self) -> &'static str {
        "Field curves"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, _actions: &mut Actions) {
        let Some((results, numbers)) = displayed_results(view) else {
            return show_missing_results(ui, view);
        };
        let Some(curves) = &numbers.field_curves else {
            ui.weak("Computing …");
            return;
        };
        if curves.value.points.is_empty() {
            ui.weak("All fields are on the axis: there is nothing to show over the field");
            return;
        }
        let kind = results.lens.fields_at(results.settings.zoom).kind;
        summary(ui, &curves.value, curves.ms);
        let charts = charts(&curves.value, &results.lens, Palette::for_visuals(ui.visuals()));
        let columns = if ui.available_width() < 2.0 * NARROWEST { 1 } else { 2 };
        let rows = charts.len().div_ceil(columns);
        let height = (ui.available_height() / rows as f32 - TITLE).max(LOWEST);
        egui::ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
            ui.columns(columns, |uis| {
                for (i, chart) in charts.into_iter().enumerate() {
                    chart.show(&mut uis[i % columns], unit(kind), height);
                }
            });
        });
    }
}

/// The unit of a field.
const fn unit(kind: FieldKind) -> &'static str {
    match kind {
        FieldKind::Angle => "degrees",
        FieldKind::ObjectHeight => "mm in the object",
        FieldKind::ImageHeight => "mm in the image",
    }
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

/// A curve with its name, its colour and how it is drawn.
struct Curve {
    name: String,
    points: Vec<[f64; 2]>,
    color: Rgba,
    dashed: bool,
}

/// A quantity against the field.
struct Chart {
    title: &'static str,
    hint: &'static str,
    curves: Vec<Curve>,
    from_zero: bool,
}

fn charts(curves: &FieldCurves, lens: &Lens, palette: Palette) -> Vec<Chart> {
    let [first, second] = [palette.field(0), palette.field(1)];
    let against = |number: &dyn Fn(&FieldCurvePoint) -> Option<f64>| {
        let point = |point: &FieldCurvePoint| Some([point.height, number(point)?]);
        curves.points.iter().filter_map(point).collect::<Vec<_>>()
    };
    let curve =
        |name: &str, color, dashed, points| Curve { name: name.to_owned(), points, color, dashed };
    let focus = |point: &FieldCurvePoint| point.curvature.as_ref().ok().copied();
    let tangential = against(&|point| focus(point)?.tangential);
    let sagittal = against(&|point| focus(point)?.sagittal);
    let light = |point: &FieldCurvePoint| Some(100.0 * point.illumination.relative?.value);
    let mut charts = vec![
        distortion(curves, [first, second]),
        Chart {
            title: "Field curvature, mm",
            hint: "Foci of a narrow beam about the chief ray (Coddington) from the image plane, positive \
                   along the light",
            curves: vec![
                curve("tangential", first, false, tangential),
                curve("sagittal", second, true, sagittal),
            ],
            from_zero: false,
        },
        Chart {
            title: "Relative illumination, %",
            hint: "Irradiance in the image of a uniform scene, relative to the axis",
            curves: vec![curve("illumination", first, false, against(&light))],
            from_zero: true,
        },
    ];
    if lens.wavelengths.len() > 1 {
        charts.insert(2, lateral_color(curves, lens, palette));
    }
    charts
}

/// The distortion in the image plane, and that of the paraxial image where a defocus tells them apart.
fn distortion(curves: &FieldCurves, [first, second]: [Rgba; 2]) -> Chart {
    let against = |number: fn(&Distortion) -> Option<f64>| {
        // On the axis both heights vanish, and their ratio has no value.
        let point = |point: &FieldCurvePoint| {
            let share = number(point.distortion.as_ref().ok()?)?;
            Some([point.height, 100.0 * share])
        };
        curves.points.iter().filter_map(point).collect::<Vec<_>>()
    };
    let in_plane = against(|found| found.in_plane.or(found.distortion));
    let in_focus = against(|found| found.distortion);
    let is_defocused = in_plane.iter().zip(&in_focus).any(|(a, b)| (a[1] - b[1]).abs() > 1e-3);
    let curve =
        |name: &str, color, dashed, points| Curve { name: name.into(), points, color, dashed };
    let mut shown = vec![curve("image plane", first, false, in_plane)];
    if is_defocused {
        shown.push(curve("paraxial image", second, true, in_focus));
    }
    Chart {
        title: "Distortion, %",
        hint: "Height of the real over that of the paraxial chief ray in the image plane in use, less 1. \
               Dashed, where the plane is out of the paraxial focus: over the height in the paraxial \
               image, f tan θ for a distant object, which a defocus changes near the axis too",
        curves: shown,
        from_zero: false,
    }
}

/// The lateral colour: a curve for each wavelength but the primary one.
fn lateral_color(curves: &FieldCurves, lens: &Lens, palette: Palette) -> Chart {
    let primary = lens.primary();
    let others = lens.wavelengths.iter().enumerate().filter(|(i, _)| *i != primary);
    let curve = |(k, (i, wavelength)): (usize, (usize, &Wavelength))| {
        let point = |point: &FieldCurvePoint| {
            let shift = point.lateral_color.as_ref().ok()?.get(i)?;
            Some([point.height, 1e3 * shift])
        };
        Curve {
            name: format!("{:.0} nm", 1e3 * wavelength.um),
            points: curves.points.iter().filter_map(point).collect(),
            color: palette.field(k),
            dashed: k > 0,
        }
    };
    Chart {
        title: "Lateral colour, µm",
        hint: "Chief ray of a wavelength against that of the primary one, positive away from the axis",
        curves: others.enumerate().map(curve).collect(),
        from_zero: false,
    }
}

impl Chart {
    fn show(self, ui: &mut Ui, unit: &'static str, height: f32) {
        self.heading(ui);
        let label = self.describe(unit);
        let weak = ui.visuals().weak_text_color();
        let mut plot = fixed_plot(ui, self.title, height).include_x(0.0).include_y(0.0);
        if self.from_zero {
            plot = plot.include_y(100.0);
        }
        let shown = plot.x_axis_label(format!("field, {unit}")).show(ui, |plot| {
            plot.hline(HLine::new("", 0.0).color(weak).allow_hover(false));
            for Curve { name, points, color, dashed } in self.curves {
                let style = if dashed { LineStyle::dashed_loose() } else { LineStyle::Solid };
                plot.line(plot_curve(name, points).color(color32(color)).style(style).width(1.6));
            }
        });
        shown.response.widget_info(|| WidgetInfo::labeled(egui::Role::Image, true, &label));
    }

    /// The title, with the names of several curves in their colours: a legend would hide them.
    fn heading(&self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = 6.0;
            let title = RichText::new(self.title).small().strong();
            ui.add(Label::new(title).truncate()).on_hover_text(self.hint);
            for curve in self.curves.iter().filter(|_| self.curves.len() > 1) {
                let name = RichText::new(&curve.name).small().color(color32(curve.color));
                ui.add(Label::new(name).truncate());
            }
        });
    }

    /// The chart in words, with its values at the edge of the field.
    fn describe(&self, unit: &str) -> String {
        let edge = |curve: &Curve| {
            let [field, value] = *curve.points.last()?;
            let [field, value] = [field, value].map(|v| number::format_digits(v, 4));
            Some(format!("{} {value} at {field} {unit}", curve.name))
        };
        let edges: Vec<String> = self.curves.iter().filter_map(edge).collect();
        format!("{}: {}", self.title, edges.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files;
    use crate::session::{AnalysisSettings, analyze};

    /// The double Gauss is out of its paraxial focus: that is no distortion, and against the paraxial image
    /// it is one on the axis too, where a curve that began at 0 would jump.
    #[test]
    fn the_distortion_begins_beside_the_axis() {
        let bundled = &files::bundled_lenses()[0];
        let lens = files::parse(bundled.text.as_bytes(), bundled.name).unwrap().lens;
        let settings = AnalysisSettings { field_curves: true, ..AnalysisSettings::default() };
        let curves = analyze(&lens, &settings).unwrap().field_curves.unwrap().value;
        let charts = charts(&curves, &lens, Palette::DARK);
        let [in_plane, in_focus] = [0, 1].map(|i| &charts[0].curves[i].points);
        assert!(in_plane.len() > 2 && in_plane[0][0] > 0.0, "{in_plane:?}");
        assert!(
            in_plane[0][1].abs() < 0.02 && in_focus[0][1].abs() > 0.05,
            "{in_plane:?} {in_focus:?}"
        );
    }
}
