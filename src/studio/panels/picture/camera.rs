//! The options of a picture: focus, exposure and light, coating, sensor, and how well it is computed.

use egui::{CollapsingHeader, ComboBox, DragValue, Grid, RichText, ScrollArea, Ui};

use crate::analysis::Coating;
use crate::lens::Lens;
use crate::math::format_short;
use crate::picture::{PictureGate, SensorPreset};
use crate::session::{
    Command, PanelSetting, PictureEffect, PictureFocus, PictureOptions, ScenePicture, SessionView,
};
use crate::studio::actions::Actions;
use crate::studio::form::named_list;
use crate::studio::number;
use crate::studio::panels::widgets::hint_beside;
use crate::studio::text::capitalize;

/// The coatings that can be chosen.
const COATINGS: [Option<Coating>; 6] = [
    None,
    Some(Coating::Bare),
    Some(Coating::SingleLayer),
    Some(Coating::VCoat),
    Some(Coating::Flat(0.005)),
    Some(Coating::Flat(0.002)),
];
/// The tolerances that can be chosen.
const TOLERANCES: [(f64, &str); 4] =
    [(0.03, "3 %"), (0.01, "1 %"), (0.003, "0.3 %"), (0.001, "0.1 %")];
/// The height of the list of effects, in points.
const LIST: f32 = 170.0;
/// The distance in mm that is proposed for a focus.
const NEAR: f64 = 1000.0;
/// The exposure in seconds and the luminance in cd/m² that are proposed.
const EXPOSURE: f64 = 0.01;
const DAYLIGHT: f64 = 100.0;

/// The options of the picture, folded, and its effects.
pub(super) fn options(
    ui: &mut Ui,
    view: &SessionView,
    shown: Option<&ScenePicture>,
    actions: &mut Actions,
) {
    let before = &view.settings.picture_options;
    let mut options = before.clone();
    CollapsingHeader::new("Camera").id_salt("camera").show(ui, |ui| {
        let is_near = |shown: &ScenePicture| shown.focus.is_some();
        let is_far = options.distance.is_none() && !shown.is_some_and(is_near);
        camera(ui, (&view.lens, is_far), &mut options);
    });
    CollapsingHeader::new("Coating and effects").id_salt("effects").show(ui, |ui| {
        effects(ui, &mut options, shown);
    });
    if options != *before {
        actions.push(Command::Show(PanelSetting::PictureOptions(Box::new(options))));
    }
}

/// The width from which two pairs of a name and its number stand in a row, in points.
const PAIRS: f32 = 430.0;

/// Distance, focus, exposure, light, motion, sensor and accuracy, of a scene that is at infinity or not.
fn camera(ui: &mut Ui, (lens, is_far): (&Lens, bool), options: &mut PictureOptions) {
    type Field<'a> = (&'static str, &'a dyn Fn(&mut Ui, &mut PictureOptions));
    let fields: [Field<'_>; 8] = [
        ("Focus", &|ui, options| focus(ui, lens, &mut options.focus)),
        ("Scene at", &|ui, options| {
            let hint = "The distance of the scene in front of the first surface; absent: where the lens is focused";
            optional(ui, (&mut options.distance, NEAR), ("Distance of the scene", " mm", hint));
        }),
        ("Exposure", &|ui, options| {
            let hint = "Seconds; absent: until white fills 80 % of the range of the sensor";
            optional(ui, (&mut options.seconds, EXPOSURE), ("Exposure", " s", hint));
        }),
        ("White", &|ui, options| {
            let hint =
                "The luminance of white in the scene; absent: that of the scene, 100 cd/m² by day";
            let words = ("Luminance of white", " cd/m²", hint);
            optional(ui, (&mut options.luminance, DAYLIGHT), words);
        }),
        ("Sensor", &sensor),
        ("Motion", &|ui, options| velocity(ui, is_far, options)),
        ("Error", &tolerance),
        ("Way", &ways),
    ];
    let pairs = if ui.available_width() < PAIRS { 1 } else { 2 };
    Grid::new("camera").num_columns(2 * pairs).spacing([8.0, 4.0]).show(ui, |ui| {
        for (i, (name, field)) in fields.into_iter().enumerate() {
            ui.label(name);
            field(ui, options);
            if (i + 1) % pairs == 0 {
                ui.end_row();
            }
        }
    });
}

/// A number that may be absent.
fn optional(
    ui: &mut Ui,
    (number, proposed): (&mut Option<f64>, f64),
    (name, unit, hint): (&str, &str, &str),
) {
    ui.horizontal(|ui| {
        let mut asked = number.is_some();
        let check = ui.checkbox(&mut asked, "").on_hover_text(hint);
        if check.accessible_name(format!("{name} given")).changed() {
            *number = asked.then_some(proposed);
        }
        match number {
            Some(value) => positive(ui, value, (name, unit)),
            None => drop(ui.weak("auto")),
        }
    });
}

/// A positive number.
fn positive(ui: &mut Ui, value: &mut f64, (name, unit): (&str, &str)) {
    let speed = (0.01 * value.abs()).max(1e-6);
    let drag = DragValue::new(value).speed(speed).range(1e-6..=1e9).suffix(unit);
    ui.add(drag.custom_formatter(|value, _| number::format_digits(value, 5))).accessible_name(name);
}

/// The way of focusing with its distance.
fn focus(ui: &mut Ui, lens: &Lens, focus: &mut PictureFocus) {
    let mut at = focus.distance().unwrap_or(NEAR);
    let last_surface = lens.surfaces.len().saturating_sub(1);
    let (mut first, mut last) = match *focus {
        PictureFocus::Group { first, last, .. } => (first, last),
        PictureFocus::Design | PictureFocus::ImagePlane(_) => (0, last_surface),
    };
    let mut way = match focus {
        PictureFocus::Design => 0,
        PictureFocus::ImagePlane(_) => 1,
        PictureFocus::Group { .. } => 2,
    };
    let names = ["design", "image plane", "group"];
    ui.horizontal(|ui| {
        let combo = ComboBox::from_id_salt("focus").width(80.0).selected_text(names[way]);
        let list = combo.show_ui(ui, |ui| {
            for (i, name) in names.iter().enumerate() {
                ui.selectable_value(&mut way, i, *name);
            }
        });
        named_list(ui, list, "Way of focusing").on_hover_text(
            "As the lens is written, by moving the image plane, or by moving a group",
        );
        if way > 0 {
            positive(ui, &mut at, ("Distance of the focus", " mm"));
        }
        if way == 2 {
            surface(ui, &mut first, last_surface, "First surface of the focus group");
            ui.label("to");
            surface(ui, &mut last, last_surface, "Last surface of the focus group");
        }
    });
    *focus = match way {
        0 => PictureFocus::Design,
        1 => PictureFocus::ImagePlane(at),
        _ => PictureFocus::Group { distance: at, first, last },
    };
}

/// A surface by its number, which is counted from 1.
fn surface(ui: &mut Ui, index: &mut usize, most: usize, name: &str) {
    let mut shown = *index + 1;
    let drag = DragValue::new(&mut shown).range(1..=most + 1).speed(0.1);
    if ui.add(drag).accessible_name(name).changed() {
        *index = shown - 1;
    }
}

/// The velocity of the scene in mm/s, or in tangents per second if it is at infinity, which blurs it during an
/// exposure that is given.
fn velocity(ui: &mut Ui, is_far: bool, options: &mut PictureOptions) {
    let (unit, least) = if is_far { (" /s", 0.001) } else { (" mm/s", 0.1) };
    ui.horizontal(|ui| {
        let velocity = &mut options.velocity;
        for (value, name) in velocity.iter_mut().zip(["Motion to the right", "Motion upwards"]) {
            let speed = (0.01 * value.abs()).max(least);
            let drag = DragValue::new(value).speed(speed).suffix(unit).max_decimals(4);
            ui.add(drag.range(-1e6..=1e6)).accessible_name(name).on_hover_text(
                "The velocity of the scene to the right and upwards during the exposure, which has to be given; of \
                 a scene at infinity in tan(angle) per second",
            );
        }
        if options.velocity != [0.0; 2] && options.seconds.is_none() {
            ui.weak("needs an exposure");
        }
    });
}

fn sensor(ui: &mut Ui, options: &mut PictureOptions) {
    ui.horizontal(|ui| {
        let combo =
            ComboBox::from_id_salt("sensor").width(80.0).selected_text(options.sensor().name);
        let list = combo.show_ui(ui, |ui| {
            for preset in &SensorPreset::ALL {
                let chosen = options.sensor == preset.name;
                let item = ui.selectable_label(chosen, preset.name);
                if item.clicked() {
                    preset.name.clone_into(&mut options.sensor);
                }
                hint_beside(item, preset.source);
            }
        });
        named_list(ui, list, "Sensor");
        ui.checkbox(&mut options.noise, "Noise")
            .on_hover_text("Shows the numbers of the sensor with their noise in place of light");
    });
}

fn tolerance(ui: &mut Ui, options: &mut PictureOptions) {
    let known = TOLERANCES.iter().find(|(error, _)| *error == options.tolerance);
    let text =
        known.map_or_else(|| format_short(options.tolerance), |(_, name)| (*name).to_owned());
    let combo = ComboBox::from_id_salt("picture tolerance").width(80.0).selected_text(text);
    let list = combo.show_ui(ui, |ui| {
        for (error, name) in TOLERANCES {
            ui.selectable_value(&mut options.tolerance, error, name);
        }
    });
    named_list(ui, list, "Allowed error of the picture")
        .on_hover_text("A share of mid grey, split over sampling, diffraction, losses and ghosts");
}

fn ways(ui: &mut Ui, options: &mut PictureOptions) {
    ui.horizontal(|ui| {
        ui.checkbox(&mut options.exact, "Exact")
            .on_hover_text("Follows rays from every pixel: slow, to the error that is allowed");
        ui.checkbox(&mut options.processor, "Processor").on_hover_text(
            "Makes the quick picture on the processor though there may be a graphics card",
        );
    });
}

/// The coating, and the effects with their numbers.
fn effects(ui: &mut Ui, options: &mut PictureOptions, shown: Option<&ScenePicture>) {
    ui.horizontal_wrapped(|ui| {
        let name = |coating: Option<Coating>| {
            match coating {
                None => "Nothing is lost".to_owned(),
                Some(Coating::Bare) => "Bare glass".to_owned(),
                Some(coating) => capitalize(&coating.to_string()),
            }
        };
        let combo = ComboBox::from_id_salt("picture coating").selected_text(name(options.coating));
        let list = combo.show_ui(ui, |ui| {
            for coating in COATINGS {
                ui.selectable_value(&mut options.coating, coating, name(coating));
            }
        });
        named_list(ui, list, "Coating of the picture").on_hover_text(
            "Of all surfaces between air and glass: with one, losses and ghosts are in the picture",
        );
        for (effect, name) in PictureEffect::ALL {
            let mut on = options.includes(effect);
            let hint = "Off: left out whatever its number is. On: in the picture where its number asks for it";
            if ui.checkbox(&mut on, capitalize(name)).on_hover_text(hint).changed() {
                options.left_out.retain(|other| *other != effect);
                if !on {
                    options.left_out.push(effect);
                }
            }
        }
        ui.checkbox(&mut options.effects, "Measure").on_hover_text(
            "Lists every effect with its number, its limit, and the time that leaving it out saves",
        );
    });
    let Some(shown) = shown else { return };
    let (gates, left_out) = (&shown.gates, &shown.left_out);
    for share in &shown.shares {
        let [used, allowed] =
            [share.used, share.allowed].map(|v| number::format_digits(100.0 * v, 2));
        ui.label(RichText::new(format!("{}: {used} of {allowed} %", share.effect)).small());
    }
    match gates {
        Some(gates) => table(ui, gates),
        None if options.effects => drop(ui.weak("Measuring …")),
        None => {}
    }
    for why in left_out {
        ui.label(RichText::new(format!("left out: {why}")).small().weak());
    }
}

/// A row for each effect.
fn table(ui: &mut Ui, gates: &[PictureGate]) {
    ScrollArea::both().max_height(LIST).id_salt("effect list").show(ui, |ui| {
        Grid::new("picture effects").striped(true).spacing([10.0, 2.0]).show(ui, |ui| {
            for head in ["Effect", "", "Number", "Limit", "Saves", "Reason"] {
                ui.weak(head);
            }
            ui.end_row();
            for gate in gates {
                let unit = |value: f64| match gate.unit {
                    "share" => format!("{} %", number::format_digits(100.0 * value, 3)),
                    unit => format!("{} {unit}", number::format_digits(value, 3)),
                };
                ui.label(capitalize(gate.effect));
                ui.label(if gate.on { "on" } else { "off" });
                ui.label(gate.number.map_or("-".to_owned(), unit));
                ui.label(unit(gate.limit));
                let saved = gate.saved_milliseconds.map(|ms| format!("{ms:.0} ms"));
                ui.label(saved.unwrap_or_else(|| "-".to_owned()));
                ui.label(RichText::new(gate.reason).small());
                ui.end_row();
            }
        });
    });
}
