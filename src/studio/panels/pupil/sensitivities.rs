//! The table of semi-diameter sensitivities: for every rim that ends rays, the light and the
//! sharpness that it would gain or lose with a semi-diameter larger by 0.1 mm.

use std::ops::RangeInclusive;

use egui::{
    Align, Align2, Color32, Label, Layout as Arrange, Pos2, Rect, RichText, Role, ScrollArea,
    Sense, Shape, Stroke, TextStyle, Ui, WidgetInfo, pos2, vec2,
};
use egui_extras::{Column as Width, TableBuilder, TableRow};

use super::PupilView;
use crate::analysis::{Estimate, RimSensitivities, RimSensitivity};
use crate::session::Command;
use crate::studio::actions::Actions;
use crate::studio::number;
use crate::studio::palette::{Palette, color32};
use crate::studio::panels::field_name;

/// By how much every semi-diameter is larger in the table, in mm.
const STEP: f64 = 0.1;
/// The height of a row, in points.
const ROW: f32 = 17.0;
const HEAD: f32 = 30.0;
/// The width of a number with its arrow.
const CELL: f32 = 58.0;
/// The largest arrow.
const ARROW: f32 = 10.0;
/// The line above the table.
const TITLE: f32 = 19.0;

const HINT: &str = "The effect of a semi-diameter that is 0.1 mm larger: the change of the light, \
    in per cent of the mean area of the pupils, and of the RMS radius of the spot at \
     this wavelength, in µm. To first order, with the motion of the pupil's edge. Blue is \
     better, orange is worse; arrow lengths compare within their kind. Where the ideal entrance \
     pupil (dashed) limits the beam, no semi-diameter has an effect.";

/// The two numbers of a rim.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum SensitivityKind {
    Light,
    Blur,
}

/// A group of two columns: all fields, or one.
struct FieldColumns<'a> {
    name: String,
    sensitivities: Result<&'a RimSensitivities, String>,
}

/// The content of the table.
struct SensitivityTable<'a> {
    groups: Vec<FieldColumns<'a>>,
    /// The mean area of the pupils in mm², of which light is a share.
    area: f64,
    /// The largest change of each kind.
    largest: [f64; 2],
    selected: Option<usize>,
}

/// The height of the table below the pupils, which need some height with their labels; 0 without
/// sensitivities.
pub(super) fn height(ui: &Ui, shown: &PupilView<'_>, pupils: f32) -> f32 {
    let Some(all) = &shown.pupils.mean_sensitivities else { return 0.0 };
    let whole = TITLE
        + HEAD
        + ROW * limiting_surfaces(&SensitivityTable::new(shown, all), all).len().max(1) as f32
        + 8.0;
    let height = ui.available_height() - pupils;
    // Where there is little room the pictures come first, and the title stands for the table.
    if height < TITLE + HEAD + 1.5 * ROW { TITLE + 4.0 } else { whole.min(height) }
}

/// The table below the pictures, as high as there is room.
pub(super) fn show_table(ui: &mut Ui, shown: &PupilView<'_>, actions: &mut Actions) {
    let Some(all) = &shown.pupils.mean_sensitivities else { return };
    let height = ui.available_height();
    let table = SensitivityTable::new(shown, all);
    let significant = limiting_surfaces(&table, all);
    ui.separator();
    ui.spacing_mut().item_spacing.y = 1.0;
    if height < TITLE + HEAD {
        ui.weak("Enlarge the panel for the effect of +0.1 mm of semi-diameter").on_hover_text(HINT);
        return;
    }
    title(ui, shown, all, &significant);
    if significant.is_empty() {
        ui.weak("No semi-diameter limits the beam: the ideal entrance pupil does.");
        return;
    }
    table.show(ui, &significant, actions);
}

/// The surfaces at whose rim some ray ends.
fn limiting_surfaces(table: &SensitivityTable<'_>, all: &RimSensitivities) -> Vec<usize> {
    (0..all.surfaces.len()).filter(|i| table.limits_rays(*i)).collect()
}

fn title(ui: &mut Ui, shown: &PupilView<'_>, all: &RimSensitivities, significant: &[usize]) {
    ui.horizontal(|ui| {
        ui.strong("+0.1 mm of semi-diameter").on_hover_text(HINT);
        ui.with_layout(Arrange::right_to_left(Align::Center), |ui| {
            let cost = format!("{} rays in {:.2} ms", all.rays, shown.pupils.sensitivities.ms);
            ui.label(RichText::new(cost).small().weak());
            let others = remaining_surfaces(significant, shown.results.lens.surfaces.len());
            if !others.is_empty() {
                let text = RichText::new(format!("inactive: {others}")).small().weak();
                ui.add(Label::new(text).truncate())
                    .on_hover_text("No ray is limited by the semi-diameters of these surfaces");
            }
        });
    });
}

impl<'a> SensitivityTable<'a> {
    fn new(shown: &'a PupilView<'_>, all: &'a RimSensitivities) -> Self {
        let fields = shown.results.lens.fields_at(shown.results.settings.zoom);
        let mut groups =
            vec![FieldColumns { name: "All fields".to_owned(), sensitivities: Ok(all) }];
        for (point, sensitivities) in fields.values.iter().zip(&shown.pupils.sensitivities.value) {
            let name = field_name(fields.kind, *point);
            groups.push(FieldColumns {
                name,
                sensitivities: sensitivities.as_ref().map_err(ToString::to_string),
            });
        }
        let mut table =
            Self { groups, area: all.area, largest: [0.0; 2], selected: shown.view.selected };
        table.largest =
            [SensitivityKind::Light, SensitivityKind::Blur].map(|kind| table.largest_of(kind));
        table
    }

    fn largest_of(&self, kind: SensitivityKind) -> f64 {
        let known = self.groups.iter().filter_map(|group| group.sensitivities.as_ref().ok());
        let effects = known.flat_map(|sensitivities| &sensitivities.surfaces);
        effects.map(|effect| self.change(effect, kind).value.abs()).fold(0.0, f64::max)
    }

    /// True if the rim limits the rays of some field.
    fn limits_rays(&self, surface: usize) -> bool {
        let mut known = self.groups.iter().filter_map(|group| group.sensitivities.as_ref().ok());
        known.any(|sensitivities| sensitivities.surfaces[surface].is_significant())
    }

    /// The change for one step: of the light in per cent, of the radius in µm.
    fn change(&self, effect: &RimSensitivity, kind: SensitivityKind) -> Estimate {
        let (number, scale) = match kind {
            SensitivityKind::Light => (effect.area, 100.0 * STEP / self.area),
            SensitivityKind::Blur => (effect.rms, 1e3 * STEP),
        };
        Estimate::new(scale * number.value, scale * number.error, number.rays)
    }

    fn show(&self, ui: &mut Ui, significant: &[usize], actions: &mut Actions) {
        ScrollArea::horizontal().auto_shrink([false, false]).show(ui, |ui| {
            ui.spacing_mut().item_spacing = vec2(0.0, 0.0);
            let mut table = TableBuilder::new(ui)
                .id_salt(("sensitivities", self.groups.len()))
                .auto_shrink([false, false])
                .striped(true)
                .sense(Sense::click())
                .cell_layout(Arrange::left_to_right(Align::Center))
                .column(Width::exact(46.0));
            for _ in 0..2 * self.groups.len() {
                table = table.column(Width::exact(CELL));
            }
            table.header(HEAD, |row| self.head(row)).body(|mut body| {
                for surface in significant {
                    body.row(ROW, |row| self.row(row, *surface, actions));
                }
            });
        });
    }

    fn head(&self, mut row: TableRow<'_, '_>) {
        row.col(|ui| {
            two_lines(ui, "", "Surface", Align2::LEFT_CENTER);
        });
        for group in &self.groups {
            for (name, unit) in [(group.name.as_str(), "light, %"), ("", "RMS, µm")] {
                row.col(|ui| two_lines(ui, name, unit, Align2::RIGHT_CENTER));
            }
        }
    }

    fn row(&self, mut row: TableRow<'_, '_>, surface: usize, actions: &mut Actions) {
        let chosen = self.selected == Some(surface);
        row.set_selected(chosen);
        row.col(|ui| {
            let name = self.summary(surface);
            let (rect, response) = ui.allocate_exact_size(ui.available_size(), Sense::hover());
            response.widget_info(|| WidgetInfo::selected(Role::Button, true, chosen, &name));
            let font = TextStyle::Body.resolve(ui.style());
            let at = rect.left_center() + vec2(6.0, 0.0);
            let color = ui.visuals().strong_text_color();
            ui.painter().text(at, Align2::LEFT_CENTER, surface + 1, font, color);
        });
        for group in &self.groups {
            for kind in [SensitivityKind::Light, SensitivityKind::Blur] {
                row.col(|ui| self.cell(ui, group, surface, kind));
            }
        }
        let response = row.response().on_hover_text(self.details(surface));
        if response.clicked() {
            actions.push(Command::Select((!chosen).then_some(surface)));
        }
    }

    fn cell(&self, ui: &Ui, group: &FieldColumns<'_>, surface: usize, kind: SensitivityKind) {
        let rect = ui.max_rect();
        let Ok(sensitivities) = &group.sensitivities else { return };
        let change = self.change(&sensitivities.surfaces[surface], kind);
        let significant = change.value.abs() > change.error;
        let color = if significant {
            color(ui, kind, change.value)
        } else {
            ui.visuals().weak_text_color()
        };
        let font = TextStyle::Small.resolve(ui.style());
        let text = if significant { signed(change.value) } else { "·".to_owned() };
        let at = rect.right_center() - vec2(ARROW + 5.0, 0.0);
        let ink = if significant { ui.visuals().text_color() } else { color };
        ui.painter().text(at, Align2::RIGHT_CENTER, text, font, ink);
        let share = change.value / self.largest[kind as usize];
        if significant && share.is_finite() {
            arrow(ui, pos2(rect.right() - 0.5 * ARROW - 2.0, rect.center().y), share, color);
        }
    }

    /// A rim in one sentence.
    fn summary(&self, surface: usize) -> String {
        let Ok(sensitivities) = &self.groups[0].sensitivities else { return String::new() };
        let of = |kind| signed(self.change(&sensitivities.surfaces[surface], kind).value);
        format!(
            "Rim of surface {} by 0.1 mm: light {} %, RMS {} µm",
            surface + 1,
            of(SensitivityKind::Light),
            of(SensitivityKind::Blur)
        )
    }

    /// A rim with the errors of its numbers.
    fn details(&self, surface: usize) -> String {
        let line = |group: &FieldColumns<'_>| match &group.sensitivities {
            Ok(sensitivities) => {
                let of = |kind, unit| {
                    let change = self.change(&sensitivities.surfaces[surface], kind);
                    if change.value == 0.0 && change.error == 0.0 {
                        return "none".to_owned();
                    }
                    let sign = if change.value > 0.0 { "+" } else { "" };
                    format!("{sign}{} {unit}", number::with_error(change.value, change.error))
                };
                let (light, blur) =
                    (of(SensitivityKind::Light, "%"), of(SensitivityKind::Blur, "µm"));
                format!("{}: light {light}, RMS {blur}", group.name)
            }
            Err(why) => format!("{}: {why}", group.name),
        };
        let lines: Vec<String> = self.groups.iter().map(line).collect();
        format!(
            "Surface {}, semi-diameter 0.1 mm larger\n{}\nClick to select the surface.",
            surface + 1,
            lines.join("\n")
        )
    }
}

/// More light is for the better, and a smaller spot.
fn color(ui: &Ui, kind: SensitivityKind, change: f64) -> Color32 {
    let palette = Palette::for_visuals(ui.visuals());
    let better = (change > 0.0) == (kind == SensitivityKind::Light);
    color32(if better { palette.better } else { palette.worse })
}

/// Draws an arrow up or down, with a length by its share of the largest.
fn arrow(ui: &Ui, middle: Pos2, share: f64, color: Color32) {
    #[expect(clippy::cast_possible_truncation, reason = "a length on the screen")]
    let length = ARROW * (0.35 + 0.65 * share.abs().min(1.0)) as f32;
    let up = if share > 0.0 { -1.0 } else { 1.0 };
    let tip = middle + vec2(0.0, 0.5 * up * length);
    let foot = middle - vec2(0.0, 0.5 * up * length);
    let side = vec2(0.35 * length, 0.0);
    let points = vec![tip, foot + side, foot - side];
    ui.painter().add(Shape::convex_polygon(points, color, Stroke::NONE));
}

/// Two lines at the head of a column.
fn two_lines(ui: &Ui, above: &str, below: &str, align: Align2) {
    let rect = ui.max_rect();
    let (upper, lower) = rect.split_top_bottom_at_fraction(0.5);
    let font = TextStyle::Small.resolve(ui.style());
    let edge = |rect: Rect| {
        if align == Align2::LEFT_CENTER {
            rect.left_center() + vec2(2.0, 0.0)
        } else {
            rect.right_center() - vec2(3.0, 0.0)
        }
    };
    let visuals = ui.visuals();
    // The name of a group stands over both of its columns.
    let painter = ui.painter().with_clip_rect(ui.clip_rect().expand2(vec2(CELL, 0.0)));
    painter.text(edge(upper), align, above, font.clone(), visuals.text_color());
    painter.text(edge(lower), align, below, font, visuals.weak_text_color());
}

/// A number with its sign, and with as many digits as fit beside an arrow.
fn signed(value: f64) -> String {
    let sign = if value > 0.0 { "+" } else { "" };
    let digits = if value.abs() < 0.1 { 2 } else { 3 };
    format!("{sign}{}", number::format_compact(value, digits))
}

/// The surfaces that are not among some, as the window counts them: `2 to 5, 7 to 10`.
fn remaining_surfaces(significant: &[usize], count: usize) -> String {
    let mut ranges: Vec<RangeInclusive<usize>> = Vec::new();
    for surface in (0..count).filter(|i| !significant.contains(i)).map(|i| i + 1) {
        match ranges.last_mut() {
            Some(range) if range.end() + 1 == surface => *range = *range.start()..=surface,
            _ => ranges.push(surface..=surface),
        }
    }
    let text = |range: &RangeInclusive<usize>| match (*range.start(), *range.end()) {
        (first, last) if first == last => first.to_string(),
        (first, last) if first + 1 == last => format!("{first}, {last}"),
        (first, last) => format!("{first} to {last}"),
    };
    ranges.iter().map(text).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surfaces_without_effect_are_told_in_ranges() {
        assert_eq!(remaining_surfaces(&[0, 5, 10], 11), "2 to 5, 7 to 10");
        assert_eq!(remaining_surfaces(&[2], 4), "1, 2, 4");
        assert_eq!(remaining_surfaces(&[0, 1], 2), "");
    }
}
