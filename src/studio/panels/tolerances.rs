//! Errors of making: what each of them does to the lens, and how sharp the lenses are that are made.

use std::sync::Arc;

use egui::{Button, ComboBox, DragValue, Grid, Response, RichText, ScrollArea, Sense, Ui, vec2};
use egui::{Role, WidgetInfo};
use egui_plot::{Line, LineStyle, PlotPoints, VLine};

use super::widgets::{fixed_plot, hint_beside};
use super::{
    Panel, RMS_OVER_FIELDS, RMS_OVER_FIELDS_HINT, displayed_results, show_missing_results,
};
use crate::lens::{Edit, Perturbation, PerturbationKind, SurfaceNumber, Tolerance};
use crate::session::{AsBuiltLens, Command, PanelSetting, SessionView, Timed};
use crate::studio::actions::Actions;
use crate::studio::form::named_list;
use crate::studio::number;
use crate::studio::palette::{Palette, color32};
use crate::tolerance::{AsBuiltSpot, ToleranceGrade};

/// The height of the distribution.
const PLOT: f32 = 110.0;
/// The least width of the panel at which the distribution stands beside the numbers.
const BESIDE: f32 = 560.0;
/// The width and the height of the bar of a share.
const BAR: [f32; 2] = [60.0, 10.0];

/// The panel.
#[derive(Debug, Default)]
pub struct TolerancesPanel {
    /// The error whose half range is being changed, and its value as it is shown.
    changing: Option<(usize, f64)>,
    /// The lens as it is made, as last computed.
    latest: Option<Arc<Timed<Result<AsBuiltLens, String>>>>,
}

impl Panel for TolerancesPanel {
    fn title(&self) -> &'static str {
        "Tolerances"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        let Some((_, numbers)) = displayed_results(view) else {
            return show_missing_results(ui, view);
        };
        if numbers.as_built.is_some() {
            self.latest.clone_from(&numbers.as_built);
        }
        let Some(shown) = self.latest.clone() else {
            ui.weak("Computing …");
            return;
        };
        // Numbers of the lens before are told from its own by their colour.
        if numbers.as_built.is_none() {
            ui.visuals_mut().override_text_color = Some(ui.visuals().weak_text_color());
        }
        match &shown.value {
            Ok(made) => self.show(ui, view, (made, shown.ms), actions),
            Err(why) => {
                choose_grade(ui, view, None, actions);
                ui.label(RichText::new(why).color(ui.visuals().warn_fg_color));
            }
        }
    }
}

impl TolerancesPanel {
    fn show(
        &mut self,
        ui: &mut Ui,
        view: &SessionView,
        (made, ms): (&AsBuiltLens, f64),
        actions: &mut Actions,
    ) {
        ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
            ui.horizontal_wrapped(|ui| {
                choose_grade(ui, view, Some(made), actions);
                choose_limit(ui, view, made, actions);
            });
            facts(ui, made, ms);
            if ui.available_width() > BESIDE {
                ui.horizontal_top(|ui| {
                    ui.vertical(|ui| summary(ui, made));
                    ui.vertical(|ui| distribution(ui, made));
                });
            } else {
                summary(ui, made);
                distribution(ui, made);
            }
            travels(ui, made);
            self.errors(ui, made, actions);
        });
    }

    /// The errors, that with the largest share after refocusing first.
    fn errors(&mut self, ui: &mut Ui, made: &AsBuiltLens, actions: &mut Actions) {
        let mut order: Vec<usize> = (0..made.shares.len()).collect();
        order.sort_by(|a, b| made.shares[*b][1].total_cmp(&made.shares[*a][1]));
        Grid::new("errors of making").num_columns(5).striped(true).show(ui, |ui| {
            for (title, hint) in COLUMNS {
                hint_beside(ui.weak(title), hint);
            }
            ui.end_row();
            for i in order {
                self.error_row(ui, made, i, actions);
                ui.end_row();
            }
        });
    }

    fn error_row(&mut self, ui: &mut Ui, made: &AsBuiltLens, i: usize, actions: &mut Actions) {
        let tolerance = &made.sheet.errors[i];
        let Perturbation { kind, first, .. } = tolerance.error;
        let name = Button::new(RichText::new(title(kind)).small()).frame(false);
        if ui.add(name).on_hover_text("Highlights the surface in every panel").clicked() {
            actions.push(Command::Select(Some(first)));
        }
        ui.label(RichText::new(surfaces(tolerance.error)).small());
        self.half_range(ui, made, i, actions);
        for share in made.shares[i] {
            share_bar(ui, share);
        }
    }

    /// The half range of an error; a changed one becomes a tolerance of the lens.
    fn half_range(&mut self, ui: &mut Ui, made: &AsBuiltLens, i: usize, actions: &mut Actions) {
        let Tolerance { error, half_range, .. } = made.sheet.errors[i];
        let (factor, unit) = shown_unit(error.kind);
        let stored = factor * half_range;
        let changing = self.changing.filter(|(row, _)| *row == i).map(|(_, value)| value);
        let mut value = changing.unwrap_or(stored);
        let drag = DragValue::new(&mut value)
            .speed(0.02 * stored.max(f64::MIN_POSITIVE))
            .range(0.0..=f64::MAX)
            .update_while_editing(false)
            .suffix(unit)
            .custom_formatter(|value, _| number::format_digits(value, 3));
        let response = ui.add(drag);
        name_half_range(&response, error, value);
        if response.changed() {
            self.changing = Some((i, value));
        }
        let has_ended = response.drag_stopped() || response.lost_focus() || !response.dragged();
        if let Some((row, value)) = self.changing.filter(|(row, _)| *row == i && has_ended) {
            self.changing = None;
            let mut sheet = made.sheet.clone();
            sheet.errors[row].half_range = value / factor;
            actions.push(Command::Edit(Edit::SetTolerances(Some(sheet))));
        }
    }
}

/// The columns of the errors with their explanations.
const COLUMNS: [(&str, &str); 5] = [
    ("Error", "The error of making"),
    ("Surfaces", "The surfaces that it concerns, counted from 1"),
    ("±", "Half of the permitted range; drag it or type another one, which the lens then keeps"),
    ("Fixed", "Its share in the growth of the expected mean square spot at the fixed image plane"),
    ("Refocused", "Its share after each lens is refocused"),
];

fn name_half_range(response: &Response, error: Perturbation, value: f64) {
    let label = format!("Half range of {} {}", title(error.kind), surfaces(error));
    response.widget_info(|| {
        let mut info = WidgetInfo::labeled(Role::SpinButton, true, &label);
        info.value = Some(value);
        info
    });
}

/// Chooses a class for a lens without tolerances, or removes those of the lens.
fn choose_grade(
    ui: &mut Ui,
    view: &SessionView,
    made: Option<&AsBuiltLens>,
    actions: &mut Actions,
) {
    if made.is_some_and(|made| made.from_lens) {
        ui.label("Tolerances of this lens");
        let hint = "Removes them from the lens, so that a class of care in making proposes some";
        if ui.button("Remove").on_hover_text(hint).clicked() {
            actions.push(Command::Edit(Edit::SetTolerances(None)));
        }
        return;
    }
    let chosen = view.settings.grade;
    let name = ToleranceGrade::ALL.iter().find(|(grade, _)| *grade == chosen);
    let combo = ComboBox::from_id_salt("grade").selected_text(name.map_or("", |(_, name)| name));
    let shown = combo.show_ui(ui, |ui| {
        for (grade, name) in ToleranceGrade::ALL {
            if ui.selectable_label(chosen == grade, name).clicked() {
                actions.push(Command::Show(PanelSetting::ToleranceGrade(grade)));
            }
        }
    });
    let hint = "The class of care in making that proposes tolerances";
    named_list(ui, shown, "Care in making").on_hover_text(hint);
    let Some(made) = made else { return };
    let hint = "Keeps these tolerances in the lens, so that they are saved and can be changed";
    if ui.button("Keep in the lens").on_hover_text(hint).clicked() {
        actions.push(Command::Edit(Edit::SetTolerances(Some(made.sheet.clone()))));
    }
}

/// Chooses the largest RMS of a good lens.
fn choose_limit(ui: &mut Ui, view: &SessionView, made: &AsBuiltLens, actions: &mut Actions) {
    let mut asks = view.settings.good_rms.is_some();
    let hint = "Adds the share of lenses whose rms spot radius is at most this";
    if ui.checkbox(&mut asks, "Good up to").on_hover_text(hint).changed() {
        let proposed = 1.2 * made.analysis.spots[1].form_mean_rms;
        actions.push(Command::Show(PanelSetting::GoodRms(asks.then_some(proposed))));
    }
    if let Some(limit) = view.settings.good_rms {
        let mut um = 1e3 * limit;
        let speed = 0.01 * um;
        let drag = DragValue::new(&mut um).speed(speed).range(1e-6..=1e6).suffix(" µm");
        if ui.add(drag).changed() {
            actions.push(Command::Show(PanelSetting::GoodRms(Some(1e-3 * um))));
        }
    }
}

/// Errors, rays, real lenses, time.
fn facts(ui: &mut Ui, made: &AsBuiltLens, ms: f64) {
    let (errors, rays, samples) = (made.shares.len(), made.rays, made.analysis.samples);
    let by = if samples == 0 {
        "by derivatives alone".to_owned()
    } else {
        format!("corrected by {samples} real lenses")
    };
    let text = format!("{errors} errors, {rays} rays, {by}, {ms:.0} ms");
    let hover = format!(
        "Each spot is sampled to {:.1e} of its radius. The mean square spot is a quadratic form in \
         the errors; real lenses with random errors tell how far it is to be trusted. Rims clip \
         nothing",
        made.sampling_error
    );
    ui.label(RichText::new(text).small().weak()).on_hover_text(hover);
    let lost = made.analysis.lost;
    if lost > 0 {
        let text = format!("{lost} of {samples} real lenses lose rays and count as bad");
        ui.label(RichText::new(text).small().color(ui.visuals().warn_fg_color));
    }
    let apart = made.analysis.spots.iter().any(|spot| samples > 0 && !spot.form_agrees);
    if apart {
        let text = "the quadratic form differs from real lenses; the corrected numbers count";
        ui.label(RichText::new(text).small().color(ui.visuals().warn_fg_color));
    }
}

/// The spots of lenses that are made, at the fixed focus and refocused.
fn summary(ui: &mut Ui, made: &AsBuiltLens) {
    let spots = &made.analysis.spots;
    let um = |mm: f64| format!("{} µm", number::format_digits(1e3 * mm, 3));
    let mut rows: Vec<(String, [String; 2])> = vec![
        ("As designed".into(), spots.each_ref().map(|s| um(s.nominal_rms))),
        ("Mean of the lenses".into(), spots.each_ref().map(|s| with_error(s.mean_rms))),
    ];
    for (i, quantile) in spots[0].quantiles.iter().enumerate() {
        let name = format!("{:.0} % of the lenses, at most", 100.0 * quantile.share);
        rows.push((name, spots.each_ref().map(|s| um(s.quantiles[i].corrected))));
    }
    if spots.iter().all(|spot| spot.good.is_some()) {
        rows.push(("Good lenses".into(), spots.each_ref().map(good_share)));
    }
    if let Some([designed, expected]) = made.wavefront {
        let waves = |rms: f64| format!("{} λ", number::format_digits(rms, 3));
        rows.push(("Wavefront as designed".into(), designed.map(waves)));
        rows.push(("Wavefront of the lenses".into(), expected.map(waves)));
    }
    Grid::new("spots as made").num_columns(3).striped(true).show(ui, |ui| {
        ui.weak(RMS_OVER_FIELDS).on_hover_text(RMS_OVER_FIELDS_HINT);
        ui.weak("fixed focus");
        ui.weak("refocused");
        ui.end_row();
        for (name, values) in rows {
            ui.label(name);
            for value in values {
                ui.label(value);
            }
            ui.end_row();
        }
    });
}

/// The travels of focus and of the other compensators.
fn travels(ui: &mut Ui, made: &AsBuiltLens) {
    Grid::new("compensators").num_columns(4).striped(true).show(ui, |ui| {
        for (title, hint) in TRAVEL_COLUMNS {
            hint_beside(ui.weak(title), hint);
        }
        ui.end_row();
        for own in &made.analysis.travels {
            let (factor, unit) =
                if own.part.is_angle() { (60.0_f64.to_degrees(), "'") } else { (1e3, " µm") };
            let shown = |value: f64| format!("{}{unit}", number::format_digits(factor * value, 3));
            let found = own.real.unwrap_or(own.form);
            let place =
                own.part.in_lens().map_or_else(String::new, |part| format!(" {}", surfaces(part)));
            ui.label(RichText::new(format!("{}{place}", own.part.name())).small());
            ui.label(own.travel.map_or_else(|| "unlimited".to_owned(), shown));
            ui.label(format!("{} ± {}", shown(found.mean), shown(found.deviation)));
            let stopped = format!("{:.1} %", 100.0 * found.at_stop);
            let color = if found.at_stop > 0.01 {
                ui.visuals().warn_fg_color
            } else {
                ui.visuals().text_color()
            };
            ui.label(RichText::new(stopped).color(color));
            ui.end_row();
        }
    });
}

/// The columns of the compensators with their explanations.
const TRAVEL_COLUMNS: [(&str, &str); 4] = [
    ("Compensator", "What is adjusted in each lens after assembly"),
    ("Travel", "The largest adjustment to either side; compensators are kept in the lens file"),
    ("Adjustment", "Its mean and its standard deviation"),
    ("At its stop", "The share of lenses at the end of the travel, where the rest remains"),
];

fn with_error([value, error]: [f64; 2]) -> String {
    format!("{} µm", number::with_error(1e3 * value, 1e3 * error))
}

/// The share of good lenses with the interval of the real ones.
fn good_share(spot: &AsBuiltSpot) -> String {
    let Some(good) = spot.good else { return String::new() };
    let [low, high] = good.interval.map(|share| 100.0 * share);
    let share = 100.0 * good.corrected;
    if high > low && high - low < 100.0 {
        format!("{share:.1} % ({low:.0} to {high:.0} %)")
    } else {
        format!("{share:.1} %")
    }
}

/// The share of lenses against the RMS that they do not exceed.
fn distribution(ui: &mut Ui, made: &AsBuiltLens) {
    let palette = Palette::for_visuals(ui.visuals());
    let text = "share of lenses against RMS over the fields, µm; fixed focus dashed";
    ui.label(RichText::new(text).small().weak());
    let shown = fixed_plot(ui, "as built", PLOT).include_y(0.0).include_y(1.0).show(ui, |plot| {
        for (i, spot) in made.analysis.spots.iter().enumerate() {
            let points = spot.distribution.iter().map(|q| [1e3 * q.corrected, q.share]);
            let style = if i == 0 { LineStyle::dashed_loose() } else { LineStyle::Solid };
            let color = color32(palette.field(i));
            let name = if i == 0 { "fixed focus" } else { "refocused" };
            let line = Line::new(name, points.collect::<PlotPoints<'_>>());
            plot.line(line.color(color).width(1.6).style(style));
            let designed = VLine::new("as designed", 1e3 * spot.nominal_rms);
            plot.vline(designed.color(color).style(LineStyle::dotted_dense()));
        }
    });
    let label = "Share of lenses against their RMS over the fields";
    shown.response.widget_info(|| WidgetInfo::labeled(Role::Image, true, label));
}

fn share_bar(ui: &mut Ui, share: f64) {
    ui.horizontal(|ui| {
        let (place, _) = ui.allocate_exact_size(vec2(BAR[0], BAR[1]), Sense::hover());
        let mut bar = place;
        bar.set_width(BAR[0] * share.clamp(0.0, 1.0) as f32);
        ui.painter().rect_filled(place, 2.0, ui.visuals().extreme_bg_color);
        ui.painter().rect_filled(bar, 2.0, ui.visuals().selection.bg_fill);
        ui.label(RichText::new(format!("{:.1} %", 100.0 * share)).small());
    });
}

/// The factor and the unit in which half ranges of a kind are shown.
fn shown_unit(kind: PerturbationKind) -> (f64, &'static str) {
    match kind {
        _ if kind.is_angle() => (60.0_f64.to_degrees(), "'"),
        PerturbationKind::Abbe => (100.0, " %"),
        PerturbationKind::Curvature => (1.0, " /mm"),
        PerturbationKind::Conic | PerturbationKind::Asphere | PerturbationKind::Index => (1.0, ""),
        _ => (1e3, " µm"),
    }
}

/// The name of an error in a line of its own.
const fn title(kind: PerturbationKind) -> &'static str {
    match kind {
        PerturbationKind::Curvature => "Curvature",
        PerturbationKind::Conic => "Conic constant",
        PerturbationKind::Asphere => "Asphere, r⁴",
        PerturbationKind::Irregularity => "Irregularity",
        PerturbationKind::Thickness => "Thickness",
        PerturbationKind::ThicknessAdjusted => "Thickness, adjusted",
        PerturbationKind::Index => "Index",
        PerturbationKind::Abbe => "Abbe number",
        PerturbationKind::SurfaceDecenterX => "Surface decentre x",
        PerturbationKind::SurfaceDecenterY => "Surface decentre y",
        PerturbationKind::SurfaceTiltX => "Surface tilt x",
        PerturbationKind::SurfaceTiltY => "Surface tilt y",
        PerturbationKind::ElementDecenterX => "Element decentre x",
        PerturbationKind::ElementDecenterY => "Element decentre y",
        PerturbationKind::ElementTiltX => "Element tilt x",
        PerturbationKind::ElementTiltY => "Element tilt y",
        PerturbationKind::ElementRollX => "Element roll x",
        PerturbationKind::ElementRollY => "Element roll y",
    }
}

/// The surfaces of an error, counted from 1.
fn surfaces(error: Perturbation) -> String {
    let [first, last] = [error.first, error.last].map(SurfaceNumber::new);
    if error.first == error.last { first.to_string() } else { format!("{first}–{last}") }
}
