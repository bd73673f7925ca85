//! The wavefront of every field, its Zernike coefficients, and what diffraction makes of a point.

use std::sync::Arc;

use egui::{
    Align, Button, Color32, ColorImage, ComboBox, Grid, Image, Layout, Rect, RichText, ScrollArea,
    Sense, TextureHandle, TextureOptions, Ui, vec2,
};

use super::figure_view::{ChartForm, accuracy_section, bare_chart, export_menu};
use super::widgets::swatch;
use super::{
    Panel, displayed_results, field_name, plain_error, relative_error, show_missing_results,
};
use crate::analysis::{
    Estimate, ImageLight, SquareGrid, ZernikeOrder, ZernikeSum, aberration_name,
};
use crate::lens::Fields;
use crate::pupil::RayModel;
use crate::report::FigureKind;
use crate::session::{
    Analyses, AnalysisResults, Command, ENERGY_SHARES, FieldRayImage, FieldWavefront,
    FieldWavefronts, PanelSetting, PointImage, PointImages, RayImages, SessionView, Timed,
    analysis_figure,
};
use crate::studio::actions::Actions;
use crate::studio::cached::{ByAddress, Cached};
use crate::studio::colormap;
use crate::studio::form::named_list;
use crate::studio::number;
use crate::studio::palette::{Palette, color32};

/// The least and the largest side of a map.
const SIDE: [f32; 2] = [96.0, 420.0];
/// The room for the words above and below a map, and for its scale of colours.
const WORDS: f32 = 66.0;
const SCALE: f32 = 28.0;
/// The height of the bar of such a scale, and its steps.
const BAR: f32 = 8.0;
const STEPS: usize = 64;
/// The room between maps.
const GAP: f32 = 10.0;
/// The decades of a logarithmic image.
const DECADES: f64 = 4.0;
/// The opacity of what belongs to the lens before.
const FAINT: f32 = 0.45;

/// A view of every field.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum WavefrontPage {
    #[default]
    Map,
    Image,
    Energy,
    Zernike,
}

impl WavefrontPage {
    /// True if it shows images of a point, which take far longer than wavefronts.
    const fn shows_images(self) -> bool {
        matches!(self, Self::Image | Self::Energy)
    }

    /// The figure of the page, of images by rays or by diffraction.
    const fn figure(self, by_rays: bool) -> FigureKind {
        match (self, by_rays) {
            (Self::Map, _) => FigureKind::Wavefront,
            (Self::Zernike, _) => FigureKind::Zernike,
            (Self::Image, false) => FigureKind::PointSpread,
            (Self::Image, true) => FigureKind::RayImage,
            (Self::Energy, false) => FigureKind::Energy,
            (Self::Energy, true) => FigureKind::RayEnergy,
        }
    }
}

/// The numbers that a page needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum NumberKind {
    Waves,
    Images,
    RayImages,
}

const PAGES: [(WavefrontPage, &str, &str); 4] = [
    (WavefrontPage::Map, "Map", "Path differences over the pupil, in wavelengths"),
    (WavefrontPage::Image, "Point spread", "The image of a point, by diffraction or by rays"),
    (
        WavefrontPage::Energy,
        "Encircled energy",
        "Share of the light within circles, by diffraction or by rays",
    ),
    (WavefrontPage::Zernike, "Zernike", "Coefficients in Noll's order, in wavelengths"),
];

/// The style in which the numbers of a field become a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct PictureStyle {
    page: WavefrontPage,
    is_logarithmic: bool,
    is_dark: bool,
}

/// The numbers and the style from which textures are made.
type TextureKey = (ByAddress<AnalysisResults>, PictureStyle);

/// The panel. It shows the last numbers, faint, until those of a changed lens are there.
#[derive(Default)]
pub struct WavefrontPanel {
    page: WavefrontPage,
    /// True for intensities on a logarithmic scale.
    is_logarithmic: bool,
    /// True for the fringe order of Zernike coefficients in place of Noll's.
    is_fringe: bool,
    /// True for images by rays in place of those by diffraction.
    by_rays: bool,
    /// The last results with wavefronts, with images of a point by diffraction, and by rays.
    last: [Option<Arc<AnalysisResults>>; 3],
    textures: Cached<TextureKey, Vec<Option<TextureHandle>>>,
}

impl std::fmt::Debug for WavefrontPanel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("WavefrontPanel").field("page", &self.page).finish_non_exhaustive()
    }
}

impl Panel for WavefrontPanel {
    fn title(&self) -> &'static str {
        "Wavefront"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        let Some((results, numbers)) = displayed_results(view) else {
            return show_missing_results(ui, view);
        };
        ui.horizontal_wrapped(|ui| {
            self.pages(ui);
            self.light(ui, view, numbers, actions);
            export_menu(ui, self.page.figure(self.by_rays), actions);
        });
        self.ask(view, actions);
        let kind = self.kind();
        if self.page == WavefrontPage::Image && !self.by_rays {
            let subject = (&**results, numbers.point_spread_accuracy.is_some());
            let open = accuracy_section(ui, FigureKind::PointSpreadAccuracy, subject, actions);
            if open != view.settings.point_spread_accuracy {
                actions.push(Command::Show(PanelSetting::PointSpreadAccuracy(open)));
            }
        }
        let is_current = PageNumbers::of(numbers, kind).is_some();
        let last = &mut self.last[kind as usize];
        if is_current {
            *last = Some(Arc::clone(results));
        }
        let Some(results) = last.clone() else {
            ui.weak("Computing …");
            return;
        };
        let Ok(numbers) = &results.analyses else { return };
        let Some(found) = PageNumbers::of(numbers, kind) else { return };
        found.summary(ui, is_current);
        if !is_current {
            ui.multiply_opacity(FAINT);
        }
        let fields = results.lens.fields_at(results.settings.zoom);
        match (self.page, found) {
            (WavefrontPage::Energy, _) => energies(ui, &results, self.page.figure(self.by_rays)),
            (WavefrontPage::Zernike, PageNumbers::Waves(waves)) => {
                coefficients(ui, fields, &waves.value, self.is_fringe);
            }
            _ => self.maps(ui, fields, &results, found),
        }
    }
}

/// The numbers that a page shows.
#[derive(Clone, Copy)]
enum PageNumbers<'a> {
    Waves(&'a Timed<FieldWavefronts>),
    Images(&'a Timed<PointImages>),
    Rays(&'a Timed<RayImages>),
}

impl<'a> PageNumbers<'a> {
    /// The numbers of a kind; `None` while they are computed.
    fn of(numbers: &'a Analyses, kind: NumberKind) -> Option<Self> {
        match kind {
            NumberKind::Waves => Some(Self::Waves(numbers.wavefronts.as_ref()?)),
            NumberKind::Images => Some(Self::Images(numbers.point_images.as_ref()?)),
            NumberKind::RayImages => Some(Self::Rays(numbers.ray_images.as_ref()?)),
        }
    }

    /// The number of fields.
    fn count(self) -> usize {
        match self {
            Self::Waves(waves) => waves.value.fields.len(),
            Self::Images(images) => images.value.fields.len(),
            Self::Rays(images) => images.value.fields.len(),
        }
    }

    /// The wavelength, the rays and the time; or that the numbers are those of the lens before.
    fn summary(self, ui: &mut Ui, is_current: bool) {
        let at = |um: f64| format!("at {:.0} nm", 1e3 * um);
        let (light, ms) = match self {
            Self::Waves(waves) => (at(waves.value.um), waves.ms),
            Self::Images(images) => {
                (images.value.um.map_or_else(|| "all wavelengths".to_owned(), at), images.ms)
            }
            Self::Rays(images) => ("all wavelengths".to_owned(), images.ms),
        };
        let rays: usize = (0..self.count()).filter_map(|i| self.rays(i)).sum();
        let text = if is_current {
            format!("{light}, {rays} rays, {ms:.1} ms")
        } else {
            "of the lens before; computing …".to_owned()
        };
        ui.label(RichText::new(text).small().weak());
    }

    /// The rays of a field; `None` for one without numbers.
    fn rays(self, field: usize) -> Option<usize> {
        match self {
            Self::Waves(waves) => {
                Some(waves.value.fields[field].value.as_ref().ok()?.wavefront.rms.rays)
            }
            Self::Images(images) => Some(images.value.fields[field].value.as_ref().ok()?.rays),
            Self::Rays(images) => Some(images.value.fields[field].value.as_ref().ok()?.image.rays),
        }
    }

    fn ms(self, field: usize) -> f64 {
        match self {
            Self::Waves(waves) => waves.value.fields[field].ms,
            Self::Images(images) => images.value.fields[field].ms,
            Self::Rays(images) => images.value.fields[field].ms,
        }
    }

    /// The lines below the picture of a field, or the reason why there is none.
    fn lines(self, field: usize) -> Result<Vec<String>, String> {
        match self {
            Self::Waves(waves) => waves.value.fields[field].value.as_ref().map(map_lines),
            Self::Images(images) => images.value.fields[field].value.as_ref().map(image_lines),
            Self::Rays(images) => images.value.fields[field].value.as_ref().map(ray_lines),
        }
        .map_err(ToString::to_string)
    }

    /// The scale of the colours of a map.
    fn scale(self, ui: &mut Ui, field: usize, side: f32) {
        let Self::Waves(waves) = self else { return };
        let Ok(found) = &waves.value.fields[field].value else { return };
        let (most, is_dark) = (largest(&found.map), ui.visuals().dark_mode);
        let end = number::format_digits(most, 3);
        color_scale(ui, side, [format!("-{end} λ"), format!("{end} λ")], |share| {
            let [r, g, b] = colormap::diverging(2.0 * share - 1.0, is_dark);
            Color32::from_rgb(r, g, b)
        });
    }

    /// The meaning of the numbers below a picture.
    const fn hint(self) -> &'static str {
        match self {
            Self::Waves(_) => {
                "RMS without piston; P-V: the largest path difference less the smallest over the map. Paths are \
                 compared with that of the chief ray on a sphere about its image point"
            }
            Self::Images(_) => {
                "The Strehl ratio at the image point of the chief ray, and the largest one found in space: \
                 \"locally best\" where not all of the blur was searched, as in the light of several wavelengths"
            }
            Self::Rays(_) => {
                "The circles about the image point of the chief ray that hold these shares"
            }
        }
    }

    /// The picture of a field; `None` if there is none.
    fn picture(self, field: usize, style: PictureStyle) -> Option<ColorImage> {
        match self {
            Self::Waves(waves) => {
                let found = waves.value.fields[field].value.as_ref().ok()?;
                Some(map_picture(found, style))
            }
            Self::Images(images) => {
                let image = images.value.fields[field].value.as_ref().ok()?;
                Some(intensity_picture(&image.intensity, style))
            }
            Self::Rays(images) => {
                let found = images.value.fields[field].value.as_ref().ok()?;
                Some(intensity_picture(&found.image.density, style))
            }
        }
    }
}

impl WavefrontPanel {
    /// The numbers of the page.
    const fn kind(&self) -> NumberKind {
        match (self.page.shows_images(), self.by_rays) {
            (false, _) => NumberKind::Waves,
            (true, false) => NumberKind::Images,
            (true, true) => NumberKind::RayImages,
        }
    }

    /// Asks for the images that the page shows, and no others.
    fn ask(&self, view: &SessionView, actions: &mut Actions) {
        let (settings, kind) = (&view.settings, self.kind());
        let images = kind == NumberKind::Images;
        if settings.point_images != images {
            actions.push(Command::Show(PanelSetting::PointImages(images)));
        }
        let by_rays = kind == NumberKind::RayImages;
        if settings.ray_images != by_rays {
            actions.push(Command::Show(PanelSetting::RayImages(by_rays)));
        }
    }

    fn pages(&mut self, ui: &mut Ui) {
        ui.spacing_mut().item_spacing.x = 2.0;
        for (page, name, hint) in PAGES {
            let button = Button::selectable(self.page == page, name);
            if ui.add(button).on_hover_text(hint).clicked() {
                self.page = page;
            }
        }
        if self.page.shows_images() {
            let diffraction = "By diffraction at one wavelength or at all of them";
            ui.selectable_value(&mut self.by_rays, false, "Diffraction").on_hover_text(diffraction);
            let rays = "By rays alone, over all wavelengths";
            ui.selectable_value(&mut self.by_rays, true, "Rays").on_hover_text(rays);
        }
        if self.page == WavefrontPage::Zernike {
            let noll = "Noll's order, whose terms have an RMS of 1";
            ui.selectable_value(&mut self.is_fringe, false, "Noll").on_hover_text(noll);
            let fringe = "The fringe order, whose terms are 1 at the rim";
            ui.selectable_value(&mut self.is_fringe, true, "Fringe").on_hover_text(fringe);
        }
        if self.page == WavefrontPage::Image {
            let hint = format!("Intensities down to {:.0e} of the largest", 10f64.powf(-DECADES));
            ui.checkbox(&mut self.is_logarithmic, "Logarithmic").on_hover_text(hint);
        }
    }

    /// The choice of the wavelength of what is shown, if there are several: of images all of them too. Images by
    /// rays are always those of all.
    fn light(&self, ui: &mut Ui, view: &SessionView, numbers: &Analyses, actions: &mut Actions) {
        let model = &numbers.ray_model.value;
        if model.channels.len() < 2 || self.kind() == NumberKind::RayImages {
            return;
        }
        let can_be_all = self.page.shows_images();
        let shown = match view.settings.wavefront_light {
            Some(ImageLight::Wavelength(index)) if index < model.channels.len() => {
                ImageLight::Wavelength(index)
            }
            Some(ImageLight::All) if can_be_all => ImageLight::All,
            _ => ImageLight::Wavelength(model.primary),
        };
        let name = |light: ImageLight| match light {
            ImageLight::Wavelength(index) => wavelength_name(model, index),
            ImageLight::All => "All wavelengths".to_owned(),
        };
        let mut chosen = shown;
        let combo = ComboBox::from_id_salt("wavefront wavelength").width(96.0);
        let combo = combo.selected_text(name(shown)).show_ui(ui, |ui| {
            for index in 0..model.channels.len() {
                let primary = if index == model.primary { ", primary" } else { "" };
                let light = ImageLight::Wavelength(index);
                ui.selectable_value(&mut chosen, light, format!("{}{primary}", name(light)));
            }
            if can_be_all {
                ui.selectable_value(&mut chosen, ImageLight::All, name(ImageLight::All));
            }
        });
        named_list(ui, combo, "Wavelength of the wavefront");
        if chosen != shown {
            actions.push(Command::Show(PanelSetting::WavefrontLight(Some(chosen))));
        }
    }

    /// A picture of each field, as many beside each other as there is room for.
    fn maps(
        &mut self,
        ui: &mut Ui,
        fields: &Fields,
        results: &Arc<AnalysisResults>,
        found: PageNumbers<'_>,
    ) {
        let is_dark = ui.visuals().dark_mode;
        let style = PictureStyle { page: self.page, is_logarithmic: self.is_logarithmic, is_dark };
        let context = ui.ctx().clone();
        let textures = self.textures.get((ByAddress::from(results), style), |_| {
            let texture = |i: usize| {
                let image = found.picture(i, style)?;
                Some(context.load_texture(format!("wavefront {i}"), image, TextureOptions::LINEAR))
            };
            (0..found.count()).map(texture).collect()
        });
        let count = textures.len().max(1) as f32;
        let room = ui.available_size() - vec2(0.0, WORDS + SCALE);
        let side = (room.x / count - GAP).min(room.y).clamp(SIDE[0], SIDE[1]);
        ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
            let from_top = Layout::left_to_right(Align::Min).with_main_wrap(true);
            ui.with_layout(from_top, |ui| {
                ui.spacing_mut().item_spacing = vec2(GAP, 4.0);
                for (i, texture) in textures.iter().enumerate() {
                    cell(ui, (fields, i), (found, texture.as_ref()), side);
                }
            });
        });
    }
}

/// The name of a wavelength of a model.
fn wavelength_name(model: &RayModel, index: usize) -> String {
    model.channels.get(index).map_or_else(String::new, |wave| format!("{:.1} nm", 1e3 * wave.um))
}

/// The path differences of a field as a picture.
fn map_picture(found: &FieldWavefront, style: PictureStyle) -> ColorImage {
    let most = largest(&found.map).max(f64::MIN_POSITIVE);
    raster(&found.map, |value| {
        let [r, g, b] = colormap::diverging((*value)? / most, style.is_dark);
        Some(Color32::from_rgb(r, g, b))
    })
}

/// The image of a point as a picture.
fn intensity_picture(image: &SquareGrid<f64>, style: PictureStyle) -> ColorImage {
    let peak = image.values.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    raster(image, |value| {
        let share = value / peak;
        let share =
            if style.is_logarithmic { 1.0 + share.max(0.0).log10() / DECADES } else { share };
        let [r, g, b] = colormap::sequential(share);
        Some(Color32::from_rgb(r, g, b))
    })
}

/// The largest size of a path difference.
fn largest(map: &SquareGrid<Option<f64>>) -> f64 {
    map.values.iter().flatten().map(|waves| waves.abs()).fold(0.0, f64::max)
}

/// The pixels of a grid, the highest row first.
fn raster<T>(grid: &SquareGrid<T>, color: impl Fn(&T) -> Option<Color32>) -> ColorImage {
    let count = grid.count;
    let pixel = |n: usize| {
        let value = &grid.values[(count - 1 - n / count) * count + n % count];
        color(value).unwrap_or(Color32::TRANSPARENT)
    };
    ColorImage::new([count, count], (0..count * count).map(pixel).collect())
}

/// The content of the cell of a field.
type CellContent<'a> = (PageNumbers<'a>, Option<&'a TextureHandle>);

/// A field, its picture and the numbers of it.
fn cell(ui: &mut Ui, field: (&Fields, usize), content: CellContent<'_>, side: f32) {
    let from_top = Layout::top_down(Align::Min);
    ui.allocate_ui_with_layout(vec2(side, side + WORDS + SCALE), from_top, |ui| {
        ui.set_width(side);
        let name = heading(ui, field.0, field.1);
        cell_content(ui, (&name, field.1), content, side);
    });
}

fn cell_content(
    ui: &mut Ui,
    (name, field): (&str, usize),
    (found, texture): CellContent<'_>,
    side: f32,
) {
    let lines = match found.lines(field) {
        Ok(lines) => lines,
        Err(why) => {
            ui.label(RichText::new(why).small().color(ui.visuals().warn_fg_color));
            return;
        }
    };
    if let Some(texture) = texture {
        let what = match found {
            PageNumbers::Waves(_) => "Wavefront",
            PageNumbers::Images(_) => "Point spread",
            PageNumbers::Rays(_) => "Point spread by rays",
        };
        let words = format!("{what} at {name}: {}", lines.join(", "));
        let rays = found.rays(field).unwrap_or(0);
        ui.add(Image::new(texture).fit_to_exact_size(vec2(side, side)).alt_text(words))
            .on_hover_text(format!("{rays} rays, {:.1} ms", found.ms(field)));
    }
    found.scale(ui, field, side);
    for line in lines {
        ui.label(RichText::new(line).small()).on_hover_text(found.hint());
    }
}

/// A bar of the colours of a scale with the numbers at its ends.
fn color_scale(ui: &mut Ui, side: f32, ends: [String; 2], color: impl Fn(f64) -> Color32) {
    let (bar, _) = ui.allocate_exact_size(vec2(side, BAR), Sense::hover());
    let step = side / STEPS as f32;
    for i in 0..STEPS {
        let corner = bar.min + vec2(step * i as f32, 0.0);
        // Steps overlap, so that no gap is seen between them.
        let part = Rect::from_min_size(corner, vec2(1.5 * step, BAR)).intersect(bar);
        ui.painter().rect_filled(part, 0.0, color((i as f64 + 0.5) / STEPS as f64));
    }
    ui.horizontal(|ui| {
        let [low, high] = ends;
        ui.label(RichText::new(low).small().weak());
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            ui.label(RichText::new(high).small().weak());
        });
    });
}

/// The name of a field with its colour.
fn heading(ui: &mut Ui, fields: &Fields, index: usize) -> String {
    let color = color32(Palette::for_visuals(ui.visuals()).field(index));
    let name = fields.values.get(index).map(|point| field_name(fields.kind, *point));
    let name = name.unwrap_or_default();
    ui.horizontal(|ui| {
        swatch(ui, color);
        ui.label(RichText::new(&name).color(color));
    });
    name
}

/// A number with its unit and its error.
fn estimate_text(estimate: Estimate, unit: &str) -> String {
    let value = number::format_digits(estimate.value, 3);
    if estimate.error > estimate.value.abs() {
        // More than a whole of itself is no share.
        return format!("{value}{unit} ± {}{unit}", number::format_digits(estimate.error, 1));
    }
    format!("{value}{unit}{}", relative_error(estimate))
}

fn map_lines(found: &FieldWavefront) -> Vec<String> {
    let waves = || found.map.values.iter().flatten().copied();
    let high = waves().fold(f64::NEG_INFINITY, f64::max);
    let low = waves().fold(f64::INFINITY, f64::min);
    let rms = estimate_text(found.wavefront.rms, " λ");
    let range = number::format_digits((high - low).max(0.0), 3);
    vec![format!("RMS {rms}"), format!("P-V {range} λ")]
}

fn image_lines(image: &PointImage) -> Vec<String> {
    let width = number::format_digits(2e3 * image.intensity.half_width, 3);
    vec![
        format!("Strehl {} at the chief ray", estimate_text(image.strehl.at_chief, "")),
        format!("{} Strehl {}", image.strehl.best_name(), estimate_text(image.strehl.best, "")),
        format!("{width} µm wide, intensity {}", plain_error(image.error, "")),
    ]
}

fn ray_lines(found: &FieldRayImage) -> Vec<String> {
    let width = number::format_digits(2e3 * found.image.density.half_width, 3);
    let shares = found.image.share_radii.iter().copied().map(Some).collect::<Vec<_>>();
    vec![
        share_text(&shares),
        format!("{width} µm wide, {} of the peak", plain_error(100.0 * found.image.error, " %")),
    ]
}

/// The radii of the circles that hold shares of the light.
fn share_text(radii: &[Option<Estimate>]) -> String {
    let text = |(share, radius): (&f64, &Option<Estimate>)| {
        let within = radius.map_or_else(
            || "beyond the image".to_owned(),
            |radius| format!("within {} µm", number::format_digits(1e3 * radius.value, 3)),
        );
        format!("{:.0} % {within}", 100.0 * share)
    };
    let list: Vec<String> = ENERGY_SHARES.iter().zip(radii).map(text).collect();
    list.join(", ")
}

/// The radii of shares of a field; `None` without light.
fn field_shares(results: &AnalysisResults, kind: FigureKind, field: usize) -> Option<String> {
    let numbers = results.analyses.as_ref().ok()?;
    if kind == FigureKind::RayEnergy {
        let found = numbers.ray_images.as_ref()?.value.fields.get(field)?.value.as_ref().ok()?;
        let radii = found.image.share_radii.iter().copied().map(Some).collect::<Vec<_>>();
        return Some(share_text(&radii));
    }
    let found = numbers.point_images.as_ref()?.value.fields.get(field)?.value.as_ref().ok()?;
    Some(share_text(&found.share_radii))
}

/// The share of the light within circles, a curve for each field.
fn energies(ui: &mut Ui, results: &AnalysisResults, kind: FigureKind) {
    let figure = match analysis_figure(kind, results) {
        Ok(figure) => figure,
        Err(why) => return drop(ui.weak(why)),
    };
    let fields = results.lens.fields_at(results.settings.zoom);
    ui.horizontal_wrapped(|ui| {
        ui.label(RichText::new("share of the light").small());
        for i in 0..fields.values.len() {
            heading(ui, fields, i);
            if let Some(shares) = field_shares(results, kind, i) {
                ui.label(RichText::new(shares).small());
            }
        }
    });
    let limit = if kind == FigureKind::Energy { "dashed curve: without aberrations; " } else { "" };
    let marks = format!("{limit}upright: the radii of 50 % and 80 %");
    ui.label(RichText::new(marks).small().weak());
    let height = (ui.available_height() - 24.0).max(SIDE[0]);
    for chart in figure.rows.iter().flatten() {
        if chart.curves.is_empty() {
            ui.weak("No field has an image of a point.");
            continue;
        }
        let form = ChartForm { contains: [&[0.0], &[0.0, 1.0]], ..ChartForm::new(height) };
        bare_chart(ui, (chart, &figure.colors), form);
    }
    let error = format!("share {}", energy_error(results, kind));
    ui.label(RichText::new(error).small().weak());
}

/// The largest error of the shares of a kind.
fn energy_error(results: &AnalysisResults, kind: FigureKind) -> String {
    let Ok(numbers) = &results.analyses else { return String::new() };
    let rays = || {
        let found = numbers.ray_images.as_ref()?;
        let lit = found.value.fields.iter().filter_map(|field| field.value.as_ref().ok());
        Some(lit.flat_map(|lit| lit.image.energy.iter().map(|e| e.error)).fold(0.0, f64::max))
    };
    let waves = || {
        let found = numbers.point_images.as_ref()?;
        let lit = found.value.fields.iter().filter_map(|field| field.value.as_ref().ok());
        Some(lit.flat_map(|lit| lit.energy.iter().map(|(_, e)| e.error)).fold(0.0, f64::max))
    };
    let error = if kind == FigureKind::RayEnergy { rays() } else { waves() };
    plain_error(error.unwrap_or(0.0), "")
}

/// A table of the coefficients, a column for each field.
fn coefficients(ui: &mut Ui, fields: &Fields, waves: &FieldWavefronts, is_fringe: bool) {
    let order = if is_fringe { ZernikeOrder::Fringe } else { ZernikeOrder::Noll };
    let sum = |field: &FieldWavefront| {
        if is_fringe { field.fringe.clone().ok() } else { field.zernike.clone().ok() }
    };
    let sums: Vec<_> =
        waves.fields.iter().map(|field| field.value.as_ref().ok().and_then(sum)).collect();
    let count = sums.iter().flatten().map(|sum| sum.coefficients.len()).max().unwrap_or(0);
    let indices = order.indices(count);
    ScrollArea::both().auto_shrink([false, false]).show(ui, |ui| {
        Grid::new("zernike").striped(true).spacing([12.0, 2.0]).show(ui, |ui| {
            ui.weak("No.");
            ui.weak("Aberration, λ");
            for i in 0..sums.len() {
                heading(ui, fields, i);
            }
            ui.end_row();
            for (k, index) in indices.into_iter().enumerate().skip(1) {
                ui.label((k + 1).to_string());
                ui.label(aberration_name(index));
                for sum in &sums {
                    let found = sum.as_ref().and_then(|sum| sum.coefficients.get(k));
                    coefficient(ui, found.map(|e| e.value));
                }
                ui.end_row();
            }
            let rows: [(&str, SumNumber); 2] = [
                ("RMS of the rest", |sum| sum.rest.value),
                ("largest error", |sum| {
                    sum.coefficients.iter().map(|e| e.error).fold(0.0, f64::max)
                }),
            ];
            for (name, number) in rows {
                ui.label("");
                ui.label(name);
                sums.iter().for_each(|sum| coefficient(ui, sum.as_ref().map(number)));
                ui.end_row();
            }
        });
    });
}

/// A number of a sum of polynomials.
type SumNumber = fn(&ZernikeSum) -> f64;

/// The least size of a number of the table that is not zero to its four digits.
const SEEN: f64 = 5e-5;

/// A number of the table at the right of its column, so that the points of all are below each other.
fn coefficient(ui: &mut Ui, number: Option<f64>) {
    // Rounding has no sign.
    let seen = number.map(|waves| if waves.abs() < SEEN { 0.0 } else { waves });
    let text = seen.map_or("-".to_owned(), |waves| format!("{waves:.4}"));
    let right = Layout::right_to_left(Align::Center);
    ui.with_layout(right, |ui| ui.label(text));
}
