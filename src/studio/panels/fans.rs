//! Ray fans: the transverse aberration of every field across two sections of its pupil.

use egui::{Response, RichText, ScrollArea, Ui, WidgetInfo};

use super::widgets::{fixed_plot, plot_curve, swatch};
use super::{Panel, displayed_results, field_name, show_missing_results};
use crate::analysis::{AnalysisError, Fan, FanPoint};
use crate::lens::Fields;
use crate::session::{Analyses, SessionView};
use crate::studio::actions::Actions;
use crate::studio::number;
use crate::studio::palette::{Palette, color32};

/// The height of the words of a field.
const WORDS: f32 = 22.0;
/// The lowest plot.
const LOWEST: f32 = 80.0;

/// The panel.
#[derive(Debug, Default)]
pub struct FansPanel;

impl Panel for FansPanel {
    fn title(&self) -> &'static str {
        "Ray fans"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, _actions: &mut Actions) {
        let Some((results, numbers)) = displayed_results(view) else {
            return show_missing_results(ui, view);
        };
        let Some(fans) = &numbers.fans else {
            ui.weak("Computing …");
            return;
        };
        let scale = scale(&fans.value);
        legend(ui, numbers, scale, fans.ms);
        let rows = fans.value.len().max(1) as f32;
        let between = 2.0 * ui.spacing().item_spacing.y;
        let height = (ui.available_height() / rows - WORDS - between - 1.0).max(LOWEST);
        let fields = results.lens.fields_at(results.settings.zoom);
        ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
            for (field, fans) in fans.value.iter().enumerate() {
                name(ui, fields, field);
                match fans {
                    Ok(fans) => sections(ui, numbers, fans, (field, scale, height)),
                    Err(why) => warn(ui, *why),
                }
            }
        });
    }
}

fn warn(ui: &mut Ui, why: AnalysisError) {
    let text = RichText::new(why.to_string()).small();
    ui.label(text.color(ui.visuals().warn_fg_color));
}

/// The largest aberration that some fan shows, in µm.
fn scale(fans: &[Result<Vec<Fan>, AnalysisError>]) -> f64 {
    let fans = fans.iter().filter_map(|fans| fans.as_ref().ok()).flatten();
    let points = fans.flat_map(|fan| fan.tangential.iter().chain(&fan.sagittal));
    let sizes = points.filter_map(|point| point.error).flatten().map(f64::abs);
    1e3 * sizes.fold(1e-6, f64::max)
}

fn legend(ui: &mut Ui, numbers: &Analyses, scale: f64, ms: f64) {
    let palette = Palette::for_visuals(ui.visuals());
    ui.horizontal(|ui| {
        for channel in &numbers.ray_model.value.channels {
            swatch(ui, color32(palette.wavelength(channel.um)));
            ui.label(RichText::new(format!("{:.0} nm", 1e3 * channel.um)).small());
        }
        let text = format!("in µm, all plots to {}; {ms:.1} ms", number::format_digits(scale, 3));
        ui.label(RichText::new(text).small().weak()).on_hover_text(
            "Distance from the image point of the chief ray of the primary wavelength, on one scale, \
             against the coordinate in the stop from rim to rim",
        );
    });
}

fn name(ui: &mut Ui, fields: &Fields, field: usize) {
    let palette = Palette::for_visuals(ui.visuals());
    let Some(point) = fields.values.get(field) else { return };
    let color = color32(palette.field(field));
    ui.horizontal(|ui| {
        swatch(ui, color);
        ui.label(RichText::new(field_name(fields.kind, *point)).color(color));
        ui.label(RichText::new("left: εy along y, right: εx along x of the stop").small().weak());
    });
}

/// The tangential section beside the sagittal one.
fn sections(
    ui: &mut Ui,
    numbers: &Analyses,
    fans: &[Fan],
    (field, scale, height): (usize, f64, f32),
) {
    ui.columns_const(|[left, right]| {
        let tangential = |fan: &Fan| curves(&fan.tangential, 1);
        section(
            left,
            numbers,
            fans,
            (&format!("Tangential fan {field}"), scale, height),
            tangential,
        );
        let sagittal = |fan: &Fan| curves(&fan.sagittal, 0);
        section(right, numbers, fans, (&format!("Sagittal fan {field}"), scale, height), sagittal);
    });
}

fn section(
    ui: &mut Ui,
    numbers: &Analyses,
    fans: &[Fan],
    (name, scale, height): (&str, f64, f32),
    curves: impl Fn(&Fan) -> Vec<Vec<[f64; 2]>>,
) {
    let palette = Palette::for_visuals(ui.visuals());
    let plot = fixed_plot(ui, name, height).include_x(-1.0).include_x(1.0);
    let plot = plot.include_y(-scale).include_y(scale).show_axes([false, true]);
    let shown = plot.show(ui, |plot| {
        for fan in fans {
            let um = numbers.ray_model.value.channels[fan.wavelength].um;
            let color = color32(palette.wavelength(um));
            for points in curves(fan) {
                let line = plot_curve(format!("{:.0} nm", 1e3 * um), points);
                plot.line(line.color(color).width(1.4));
            }
        }
    });
    describe(&shown.response, name, scale);
}

/// The parts of a fan between rays that are lost: the coordinate in the stop and the error along an axis
/// of the image in µm.
fn curves(points: &[FanPoint], axis: usize) -> Vec<Vec<[f64; 2]>> {
    let arrived = |point: &FanPoint| point.error.map(|error| [point.pupil, 1e3 * error[axis]]);
    let parts = points.chunk_by(|a, b| a.error.is_some() == b.error.is_some());
    let parts = parts.map(|part| part.iter().filter_map(arrived).collect::<Vec<_>>());
    parts.filter(|part| !part.is_empty()).collect()
}

fn describe(response: &Response, name: &str, scale: f64) {
    let label = format!("{name}: up to {} µm", number::format_digits(scale, 3));
    response.widget_info(|| WidgetInfo::labeled(egui::Role::Image, true, &label));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lost_rays_part_a_fan() {
        let point = |pupil: f64, error: Option<[f64; 2]>| FanPoint { pupil, error, fate: None };
        let points = [
            point(-1.0, None),
            point(-0.5, Some([1e-3, 2e-3])),
            point(0.0, Some([0.0, 0.0])),
            point(0.5, None),
            point(1.0, Some([3e-3, -4e-3])),
        ];
        assert_eq!(curves(&points, 1), [vec![[-0.5, 2.0], [0.0, 0.0]], vec![[1.0, -4.0]]]);
        assert_eq!(curves(&points, 0), [vec![[-0.5, 1.0], [0.0, 0.0]], vec![[1.0, 3.0]]]);
    }

    #[test]
    fn the_scale_holds_the_largest_aberration_of_any_fan() {
        let point = |error| FanPoint { pupil: 0.0, error: Some(error), fate: None };
        let fan = |error| Fan { wavelength: 0, tangential: vec![point(error)], sagittal: vec![] };
        let fans = [Ok(vec![fan([1e-3, -7e-3])]), Err(AnalysisError::NoLight), Ok(vec![])];
        assert_eq!(scale(&fans), 7.0);
    }
}
