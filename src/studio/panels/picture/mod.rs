//! A scene seen through the lens: coarse while the lens changes, finer when it is still; beside that of
//! another lens, or with its error.

mod camera;
mod histogram;
mod magnifier;
mod points;

use std::sync::Arc;

use egui::{
    Color32, ColorImage, ComboBox, Painter, Pos2, Rect, Response, RichText, ScrollArea, Sense,
    Slider, Stroke, TextureFilter, TextureHandle, TextureOptions, Ui, Vec2, WidgetInfo, pos2, vec2,
};

use super::figure_view::accuracy_section;
use super::{Panel, displayed_results, show_missing_results};
use crate::math::format_short;
use crate::picture::{BitDepth, BuiltInScene, Exposure, Picture, photon_count};
use crate::report::FigureKind;
use crate::session::{
    AnalysisResults, Command, PanelSetting, PictureScene, ScenePicture, SessionView, Timed,
};
use crate::studio::actions::Actions;
use crate::studio::cached::{ByAddress, Cached};
use crate::studio::draw::zoom_factor;
use crate::studio::file_dialog::FileRequest;
use crate::studio::form::named_list;
use crate::studio::number;
use crate::studio::text::capitalize;
use histogram::histogram;
use magnifier::Magnifier;

type ShownPicture = Timed<Result<ScenePicture, String>>;

/// The way in which two pictures are compared, or one is looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum PictureMode {
    /// One picture.
    #[default]
    One,
    /// Both beside each other.
    Beside,
    /// Both in one, to the left and to the right of a line.
    Wipe,
    /// The error of the picture.
    Errors,
    /// The images of points over the picture.
    Points,
}

impl PictureMode {
    const ALL: [(Self, &'static str, &'static str); 5] = [
        (Self::One, "One", "The picture alone"),
        (Self::Beside, "Side by side", "Beside the picture of the other lens, as bright as it is"),
        (Self::Wipe, "Wipe", "The other lens to the left of a line"),
        (
            Self::Errors,
            "Error",
            "The error against rays from every pixel, tile by tile: black is none, white the largest",
        ),
        (
            Self::Points,
            "Points",
            "The images of points of light, enlarged at their places, as they are in the picture",
        ),
    ];
}

/// A picture that is shown, with its name.
#[derive(Clone)]
struct NamedPicture {
    name: &'static str,
    shown: Arc<ShownPicture>,
}

impl NamedPicture {
    fn new(name: &'static str, results: &AnalysisResults) -> Option<Self> {
        let shown = results.analyses.as_ref().ok()?.picture.as_ref()?;
        Some(Self { name, shown: Arc::clone(shown) })
    }

    fn picture(&self) -> Option<&ScenePicture> {
        self.shown.value.as_ref().ok()
    }
}

/// Shows the options of the picture in at most so many points of height.
type OptionList<'a> = &'a mut dyn FnMut(&mut Ui, f32);

/// The picture whose texture is kept, and the white that it is shown with.
type TextureKey = (ByAddress<ShownPicture>, u64);

/// The panel.
pub struct PicturePanel {
    textures: [Cached<TextureKey, TextureHandle>; 2],
    heat: Cached<ByAddress<ShownPicture>, TextureHandle>,
    points: Cached<ByAddress<ShownPicture>, TextureHandle>,
    mode: PictureMode,
    magnifier: Magnifier,
    /// The place of the line of a wipe, as a share of the width.
    line: f32,
    /// A picture that was kept to compare others with.
    kept: Option<NamedPicture>,
}

impl Default for PicturePanel {
    fn default() -> Self {
        Self {
            textures: Default::default(),
            heat: Cached::new(),
            points: Cached::new(),
            mode: PictureMode::default(),
            magnifier: Magnifier::default(),
            line: 0.5,
            kept: None,
        }
    }
}

impl std::fmt::Debug for PicturePanel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("PicturePanel").field("mode", &self.mode).finish_non_exhaustive()
    }
}

impl Panel for PicturePanel {
    fn title(&self) -> &'static str {
        "Picture"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        let Some((results, numbers)) = displayed_results(view) else {
            return show_missing_results(ui, view);
        };
        let present = NamedPicture::new("present", results);
        self.controls(ui, view, present.as_ref(), actions);
        let subject = (&**results, numbers.picture_accuracy.is_some());
        let named = present.clone();
        let mut options = |ui: &mut Ui, most: f32| {
            ScrollArea::vertical().id_salt("options").max_height(most).show(ui, |ui| {
                let picture = named.as_ref().and_then(NamedPicture::picture);
                camera::options(ui, view, picture, actions);
                let open = accuracy_section(ui, FigureKind::PictureAccuracy, subject, actions);
                if open != view.settings.picture_accuracy {
                    actions.push(Command::Show(PanelSetting::PictureAccuracy(open)));
                }
            });
        };
        // A wide panel has room for the options beside the picture.
        let room = ui.available_size();
        let has_picture = present.as_ref().is_some_and(|named| named.picture().is_some());
        let is_wide = has_picture && room.x - self.columns() * ASPECT * room.y > BESIDE;
        if !is_wide {
            options(ui, OPTIONS * room.y);
        }
        let Some(present) = present else {
            ui.weak("Computing …");
            return;
        };
        match &present.shown.value {
            Ok(picture) => {
                facts(ui, picture, present.shown.ms);
                let others = self.compared(view, &present);
                let options: Option<OptionList<'_>> =
                    if is_wide { Some(&mut options) } else { None };
                self.show(ui, &others, options);
            }
            Err(why) => {
                ui.label(RichText::new(why).color(ui.visuals().warn_fg_color));
            }
        }
    }
}

impl PicturePanel {
    /// The choices above the picture.
    fn controls(
        &mut self,
        ui: &mut Ui,
        view: &SessionView,
        present: Option<&NamedPicture>,
        actions: &mut Actions,
    ) {
        let has_picture = present.is_some_and(|present| present.picture().is_some());
        ui.horizontal_wrapped(|ui| {
            choose_scene(ui, view, actions);
            let save = "Saves the picture as PNG with 16 bits for a colour";
            if has_picture && ui.button("Save …").on_hover_text(save).clicked() {
                actions.push(FileRequest::SavePicture);
            }
            for (mode, name, hint) in PictureMode::ALL {
                ui.selectable_value(&mut self.mode, mode, name).on_hover_text(hint);
            }
            let hint = "Compares what comes with the picture as it is now; a candidate is compared with \
                        the design without";
            if has_picture && ui.button("Keep").on_hover_text(hint).clicked() {
                self.kept = present.map(|present| NamedPicture { name: "kept", ..present.clone() });
            }
            if self.kept.is_some() && ui.button("Forget").clicked() {
                self.kept = None;
            }
        });
        let measured = self.mode == PictureMode::Errors;
        if measured != view.settings.picture_errors {
            actions.push(Command::Show(PanelSetting::PictureErrors(measured)));
        }
        let points = self.mode == PictureMode::Points;
        if points != view.settings.picture_points {
            actions.push(Command::Show(PanelSetting::PicturePoints(points)));
        }
    }

    /// The pictures that are compared: the design and the candidate, or the one kept and the present one;
    /// the present one alone if there is no other.
    fn compared(&self, view: &SessionView, present: &NamedPicture) -> Vec<NamedPicture> {
        if !matches!(self.mode, PictureMode::Beside | PictureMode::Wipe) {
            return vec![present.clone()];
        }
        let design = view.preview_results.is_some().then_some(view.results.as_ref()).flatten();
        let design = design.and_then(|results| NamedPicture::new("design", results));
        let scene = |named: &NamedPicture| named.picture().map(|picture| picture.scene.clone());
        let same = |other: &NamedPicture| scene(other) == scene(present);
        let other = self.kept.clone().filter(same).or(design.filter(same));
        let name = if view.preview_results.is_some() { "candidate" } else { "present" };
        let mut pictures: Vec<NamedPicture> = other.into_iter().collect();
        pictures.push(NamedPicture { name, ..present.clone() });
        pictures
    }

    /// The columns of pictures beside each other.
    fn columns(&self) -> f32 {
        if self.mode == PictureMode::Beside { 2.0 } else { 1.0 }
    }

    /// Shows the pictures, with the options beside them where they are given.
    fn show(&mut self, ui: &mut Ui, pictures: &[NamedPicture], options: Option<OptionList<'_>>) {
        let Some(first) = pictures.first().and_then(NamedPicture::picture) else { return };
        let compares = matches!(self.mode, PictureMode::Beside | PictureMode::Wipe);
        if compares && pictures.len() < 2 {
            ui.weak(
                "Nothing to compare with: keep a picture of this scene, or let a run offer a candidate.",
            );
        }
        // Both as bright as their lenses make them: the white of the first.
        let white = first.picture.white.max(f64::MIN_POSITIVE);
        let seen: Vec<&Picture> =
            pictures.iter().filter_map(|p| Some(&p.picture()?.picture)).collect();
        let columns = if self.mode == PictureMode::Beside { seen.len() } else { 1 };
        let room = ui.available_size();
        let aspect = columns as f32 * shape(seen[0]).x / shape(seen[0]).y;
        // A wide panel has room for the numbers at the right.
        if options.is_some() || room.x - aspect * room.y > BESIDE {
            ui.horizontal_top(|ui| {
                let beside = vec2(room.x - BESIDE, room.y);
                let at = self.areas(ui, pictures, (&seen, white), beside);
                ui.vertical(|ui| {
                    histogram(ui, &seen, white);
                    self.settings(ui, first);
                    numbers(ui, pictures, (&seen, white), at);
                    let most = ui.available_height();
                    options.into_iter().for_each(|options| options(ui, most));
                });
            });
        } else {
            histogram(ui, &seen, white);
            self.settings(ui, first);
            let words = WORDS * (1 + seen.len()) as f32;
            let room = ui.available_size() - vec2(0.0, words);
            let at = self.areas(ui, pictures, (&seen, white), room);
            numbers(ui, pictures, (&seen, white), at);
        }
    }

    /// The exposure, the line of a wipe, and the way back to the whole picture.
    fn settings(&mut self, ui: &mut Ui, first: &ScenePicture) {
        if self.mode == PictureMode::Points {
            let words = first.points.as_ref().map(|found| {
                points::words(found, &first.picture.frame, self.magnifier.part().width().recip())
            });
            let words = words.unwrap_or_else(|| "Computing the images of points …".to_owned());
            ui.label(RichText::new(words).small());
        }
        if self.mode == PictureMode::Errors {
            ui.label(RichText::new(error_words(first)).small());
        }
        ui.horizontal(|ui| {
            let (luminance, seconds) = exposure(first);
            let [luminance, seconds] = [luminance, seconds].map(|v| number::format_digits(v, 3));
            let sensor = first.options.sensor();
            let text = format!("{}, {seconds} s at {luminance} cd/m²", sensor.name);
            ui.label(RichText::new(text).small()).on_hover_text(sensor.source);
            if self.mode == PictureMode::Wipe {
                let slider = Slider::new(&mut self.line, 0.0..=1.0).show_value(false).text("Line");
                ui.add(slider);
            }
            if !self.magnifier.is_whole() && ui.button("Whole picture").clicked() {
                self.magnifier = Magnifier::default();
            }
        });
    }

    /// Shows the pictures; the place under the pointer in shares of the picture.
    fn areas(
        &mut self,
        ui: &mut Ui,
        pictures: &[NamedPicture],
        (seen, white): (&[&Picture], f64),
        room: Vec2,
    ) -> Option<Pos2> {
        let shape = shape(seen[0]);
        let columns = if self.mode == PictureMode::Beside { seen.len() } else { 1 };
        let gap = ui.spacing().item_spacing.x;
        let width = room.x - gap * (columns - 1) as f32;
        let scale = (width / (shape.x * columns as f32)).min(room.y / shape.y).max(0.1);
        let size = shape * scale;
        let mut found = None;
        ui.horizontal(|ui| {
            for column in 0..columns {
                let (rect, response) = ui.allocate_exact_size(size, Sense::click_and_drag());
                describe(&response, pictures, column);
                self.navigate(ui, &response);
                self.paint(ui, rect, pictures, column, white);
                let pointer = response.hover_pos().filter(|_| response.contains_pointer());
                if let Some(pointer) = pointer {
                    found = Some(self.magnifier.place(share_of(rect, pointer)));
                }
            }
        });
        found
    }

    fn navigate(&mut self, ui: &Ui, response: &Response) {
        if response.double_clicked() {
            self.magnifier = Magnifier::default();
        }
        let rect = response.rect;
        if response.dragged() {
            let by = response.drag_delta() / rect.size();
            self.magnifier = self.magnifier.dragged(by);
        }
        let pointer = response.hover_pos().filter(|_| response.contains_pointer());
        if let Some(pointer) = pointer {
            let factor = zoom_factor(ui) as f32;
            if factor != 1.0 {
                self.magnifier = self.magnifier.zoomed(factor, share_of(rect, pointer));
            }
        }
    }

    /// Paints what a column shows.
    fn paint(&mut self, ui: &Ui, rect: Rect, pictures: &[NamedPicture], column: usize, white: f64) {
        let painter = ui.painter_at(rect);
        let part = self.magnifier.part();
        if self.mode == PictureMode::Errors {
            match self.heat_texture(ui, &pictures[0]) {
                Some(id) => painter.image(id, rect, part, Color32::WHITE),
                None => painter.rect_filled(rect, 0.0, ui.visuals().extreme_bg_color),
            };
            return;
        }
        let id = self.texture(ui, column, &pictures[column], white);
        let shows_points = self.mode == PictureMode::Points;
        painter.image(id, rect, part, if shows_points { points::BEHIND } else { Color32::WHITE });
        if shows_points {
            self.paint_points(ui, (&painter, rect), &pictures[column]);
        }
        if self.mode == PictureMode::Wipe && pictures.len() > 1 {
            let id = self.texture(ui, 1, &pictures[1], white);
            let at = rect.left() + self.line * rect.width();
            let right = Rect::from_min_max(pos2(at, rect.top()), rect.max);
            let from = part.left() + self.line * part.width();
            painter.image(
                id,
                right,
                Rect::from_min_max(pos2(from, part.top()), part.max),
                Color32::WHITE,
            );
            painter.vline(at, rect.y_range(), (1.0, ui.visuals().strong_text_color()));
        }
    }

    /// Paints the images of points over a picture, once they are computed.
    fn paint_points(&mut self, ui: &Ui, (painter, rect): (&Painter, Rect), named: &NamedPicture) {
        let Some(shown) = named.picture() else { return };
        let Some(found) = &shown.points else { return };
        let texture = self.points.get(ByAddress::from(&named.shown), |_| {
            let options = TextureOptions::LINEAR;
            ui.ctx().load_texture("picture points", points::atlas(found), options)
        });
        let stroke = Stroke::new(1.0, Color32::from_gray(120));
        let subject = (found, &shown.picture.frame);
        points::paint((painter, rect, stroke), self.magnifier, subject, texture.id());
    }

    /// The texture of a picture with the white of another.
    fn texture(
        &mut self,
        ui: &Ui,
        slot: usize,
        named: &NamedPicture,
        white: f64,
    ) -> egui::TextureId {
        let key = (ByAddress::from(&named.shown), white.to_bits());
        let texture = self.textures[slot].get(key, |_| {
            let picture = named.picture().map(|shown| Picture { white, ..developed(shown) });
            let (size, bytes) = picture.map_or(([1, 1], vec![0; 3]), |picture| {
                (picture.frame.pixels, picture.srgb_bytes(BitDepth::Eight))
            });
            let image = ColorImage::from_rgb(size, &bytes);
            ui.ctx().load_texture(format!("picture {slot}"), image, PIXELS)
        });
        texture.id()
    }

    /// The texture of the error of a picture; `None` while it is not measured.
    fn heat_texture(&mut self, ui: &Ui, named: &NamedPicture) -> Option<egui::TextureId> {
        let map = named.picture()?.error_map.as_ref()?;
        let texture = self.heat.get(ByAddress::from(&named.shown), |_| {
            let image = ColorImage::from_rgb(map.pixels(), map.heat(map.largest()).as_flattened());
            ui.ctx().load_texture("picture errors", image, PIXELS)
        });
        Some(texture.id())
    }
}

/// Shows the numbers of the place under the pointer, or a hint to point there.
fn numbers(
    ui: &mut Ui,
    pictures: &[NamedPicture],
    (seen, white): (&[&Picture], f64),
    at: Option<Pos2>,
) {
    match at {
        Some(at) => readout(ui, pictures, (seen, white), at),
        None => drop(ui.weak(POINT)),
    }
}

/// The numbers of the pixels at a place in shares of the pictures.
fn readout(ui: &mut Ui, pictures: &[NamedPicture], (seen, white): (&[&Picture], f64), at: Pos2) {
    let Some(first) = pictures.first().and_then(NamedPicture::picture) else { return };
    let sensor = &first.options.sensor().model;
    // The same exposure for all: normal for the first.
    let (luminance, seconds) = exposure(first);
    for (named, picture) in pictures.iter().zip(seen) {
        let [column, row] = pixel_at(picture, at);
        let values = picture.values[row * picture.frame.pixels[0] + column];
        let [red, green, blue] = values.map(|value| 100.0 * value / white);
        let lux = luminance * picture.gray([column, row]);
        let photons = photon_count(lux, picture.frame.pitch, seconds);
        let dark = sensor.dark_current * seconds;
        let noise = if sensor.is_saturated(photons, dark) {
            "saturated".to_owned()
        } else {
            format!("SNR {:.1}", sensor.signal_to_noise(photons, dark))
        };
        let text = format!(
            "{}, pixel {column}, {row}: red {red:.1}, green {green:.1}, blue {blue:.1} % of white, \
             {noise}",
            capitalize(named.name)
        );
        ui.label(RichText::new(text).small()).on_hover_text(EXPOSURE);
    }
}

/// The width that is left beside the picture for its numbers to stand there, in points.
const BESIDE: f32 = 240.0;
/// The width of a picture over its height.
const ASPECT: f32 = 1.5;
/// The height of a line of numbers below the picture, in points.
const WORDS: f32 = 18.0;
/// The largest share of the height of the panel that the options of a picture take.
const OPTIONS: f32 = 0.5;
const POINT: &str =
    "Point at the picture: light and signal-to-noise ratio of a pixel; the wheel magnifies";
const EXPOSURE: &str = "The signal-to-noise ratio of a pixel of the sensor, by the mean of its colours; without an \
                        exposure in the camera it is that at which white of the first picture fills 80 % of the \
                        range; the same time for both";

/// The luminance of white in cd/m² and the exposure in seconds of a picture.
fn exposure(shown: &ScenePicture) -> (f64, f64) {
    let options = &shown.options;
    let luminance = options.luminance_of(shown.scene.built_in());
    let normal = || options.sensor().model.normal_exposure(&shown.picture, luminance);
    (luminance, options.seconds.unwrap_or_else(normal))
}

/// The picture as light, or by the numbers of the sensor with their noise.
fn developed(shown: &ScenePicture) -> Picture {
    if !shown.options.noise {
        return shown.picture.clone();
    }
    let (luminance, seconds) = exposure(shown);
    let exposure = Exposure { luminance, seconds, seed: 0 };
    let sensor = &shown.options.sensor().model;
    sensor.expose(&shown.picture, &exposure).develop(&shown.picture)
}

/// The columns and rows of a picture.
fn shape(picture: &Picture) -> Vec2 {
    let [columns, rows] = picture.frame.pixels.map(|count| count as f32);
    vec2(columns, rows)
}

/// The column and the row at a place in shares of a picture.
fn pixel_at(picture: &Picture, at: Pos2) -> [usize; 2] {
    let [columns, rows] = picture.frame.pixels;
    let place = |share: f32, count: usize| ((share * count as f32) as usize).min(count - 1);
    [place(at.x, columns), place(at.y, rows)]
}

/// Pixels that are magnified keep their edges.
const PIXELS: TextureOptions =
    TextureOptions { magnification: TextureFilter::Nearest, ..TextureOptions::LINEAR };

/// A place of an area in shares of its width and height.
fn share_of(rect: Rect, place: Pos2) -> Pos2 {
    Pos2::ZERO + (place - rect.min) / rect.size().max(Vec2::splat(1.0))
}

/// The name of what a column shows.
fn describe(response: &Response, pictures: &[NamedPicture], column: usize) {
    let Some(named) = pictures.get(column) else { return };
    let Some(picture) = named.picture() else { return };
    let scene = picture.scene.name();
    let label = if pictures.len() > 1 {
        format!("Picture of {scene} through the {} lens", named.name)
    } else {
        format!("Picture of {scene} through the lens")
    };
    response.widget_info(|| WidgetInfo::labeled(egui::Role::Image, true, &label));
}

/// The scale of the map of errors, or why there is none.
fn error_words(shown: &ScenePicture) -> String {
    if shown.options.exact {
        return "Exact: rays are followed from every pixel, there is nothing to compare with"
            .to_owned();
    }
    shown.error_map.as_ref().map_or_else(
        || "Measuring the error …".to_owned(),
        |map| {
            let most = number::format_digits(100.0 * map.largest(), 3);
            format!("Black is no error, white {most} % of mid grey, grey not measured")
        },
    )
}

fn choose_scene(ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
    let chosen = view.settings.picture_scene();
    let combo = ComboBox::from_id_salt("scene").selected_text(chosen.name());
    let shown = combo.show_ui(ui, |ui| {
        for (scene, name) in BuiltInScene::ALL {
            if ui.selectable_label(chosen == PictureScene::BuiltIn(scene), name).clicked() {
                actions.push(Command::Show(PanelSetting::Scene(scene)));
            }
        }
        let hint = "A PNG or JPEG file; it can also be dropped on the window";
        if ui.button("Picture from a file…").on_hover_text(hint).clicked() {
            actions.push(FileRequest::OpenScene);
            ui.close();
        }
    });
    named_list(ui, shown, "Scene");
}

/// Pixels, error, focus and time.
fn facts(ui: &mut Ui, picture: &ScenePicture, ms: f64) {
    let [width, height] = picture.picture.frame.pixels;
    let focus = picture.focus.map_or("infinity".to_owned(), |mm| format!("{mm:.0} mm"));
    let error = picture
        .error
        .map_or("coarse".to_owned(), |error| format!("± {:.1} % of mid grey", 100.0 * error.value));
    let largest = picture.error_map.as_ref().map_or(String::new(), |map| {
        format!(", at most {:.1} % in {} tiles", 100.0 * map.largest(), map.tiles())
    });
    let device = picture.device.as_deref().unwrap_or("processor");
    let way = if picture.is_exact { "exact" } else { "quick" };
    let breathing = picture.breathing.map(|share| format!(", breathing {:.2} %", 100.0 * share));
    let breathing = breathing.unwrap_or_default();
    let text = format!(
        "{width} x {height}, {way}, {error}{largest}, focus at {focus}{breathing}, {ms:.0} ms, {device}"
    );
    let left_out = picture.left_out.join("; ");
    let hover = format!(
        "The error of the quick way is measured against rays from every pixel of the tiles, that of the exact way \
         is its noise. Left out: {left_out}"
    );
    ui.horizontal_wrapped(|ui| {
        ui.label(RichText::new(text).small().weak()).on_hover_text(hover);
        let asked = picture.options.tolerance;
        if picture.error.is_some_and(|error| error.value > asked) && !picture.is_exact {
            let text = format!("more than the {} % asked for", format_short(100.0 * asked));
            let hint = "Exact, in the camera, follows rays from every pixel to that error";
            let color = ui.visuals().warn_fg_color;
            ui.label(RichText::new(text).small().color(color)).on_hover_text(hint);
        }
    });
}
