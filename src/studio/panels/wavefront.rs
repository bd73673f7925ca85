//! The wavefront of every field, its Zernike coefficients, and what diffraction makes of a point.

use std::sync::Arc;

use egui::{
    Align, Button, Color32, ColorImage, Grid, Image, Layout, RichText, ScrollArea, TextureHandle,
    TextureOptions, Ui, vec2,
};

use super::widgets::{fixed_plot, plot_curve, swatch};
use super::{
    Panel, displayed_results, field_name, plain_error, relative_error, show_missing_results,
};
use crate::analysis::{AnalysisError, Estimate, SquareGrid, ZernikeOrder, aberration_name};
use crate::lens::Fields;
use crate::session::{
    AnalysisResults, FieldWavefront, FieldWavefronts, PointImage, SessionView, Timed,
};
use crate::studio::actions::Actions;
use crate::studio::cached::{ByAddress, Cached};
use crate::studio::colormap;
use crate::studio::number;
use crate::studio::palette::{Palette, color32};

/// The least and the largest side of a map.
const SIDE: [f32; 2] = [96.0, 260.0];
/// The room for the words above and below a map.
const WORDS: f32 = 66.0;
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

const PAGES: [(WavefrontPage, &str, &str); 4] = [
    (WavefrontPage::Map, "Map", "Path differences over the pupil, in wavelengths"),
    (WavefrontPage::Image, "Point spread", "The image of a point by diffraction"),
    (
        WavefrontPage::Energy,
        "Encircled energy",
        "Share of the light within circles, by diffraction",
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
type TextureKey = (ByAddress<Timed<FieldWavefronts>>, PictureStyle);

/// The panel. It shows the last wavefronts, faint, until those of a changed lens are there.
#[derive(Default)]
pub struct WavefrontPanel {
    page: WavefrontPage,
    /// True for intensities on a logarithmic scale.
    is_logarithmic: bool,
    last: Option<Arc<AnalysisResults>>,
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

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, _actions: &mut Actions) {
        let Some((results, numbers)) = displayed_results(view) else {
            return show_missing_results(ui, view);
        };
        let is_current = numbers.wavefronts.is_some();
        if is_current {
            self.last = Some(Arc::clone(results));
        }
        self.pages(ui);
        let Some(results) = self.last.clone() else {
            ui.weak("Computing …");
            return;
        };
        let Some(waves) = results.analyses.as_ref().ok().and_then(|n| n.wavefronts.as_ref()) else {
            return;
        };
        summary(ui, waves, is_current);
        if !is_current {
            ui.multiply_opacity(FAINT);
        }
        let fields = results.lens.fields_at(results.settings.zoom);
        match self.page {
            WavefrontPage::Map | WavefrontPage::Image => self.maps(ui, fields, waves),
            WavefrontPage::Energy => energies(ui, fields, &waves.value),
            WavefrontPage::Zernike => coefficients(ui, fields, &waves.value),
        }
    }
}

impl WavefrontPanel {
    fn pages(&mut self, ui: &mut Ui) {
        ui.horizontal_wrapped(|ui| {
            ui.spacing_mut().item_spacing.x = 2.0;
            for (page, name, hint) in PAGES {
                let button = Button::selectable(self.page == page, name);
                if ui.add(button).on_hover_text(hint).clicked() {
                    self.page = page;
                }
            }
            if self.page == WavefrontPage::Image {
                let hint =
                    format!("Intensities down to {:.0e} of the largest", 10f64.powf(-DECADES));
                ui.checkbox(&mut self.is_logarithmic, "Logarithmic").on_hover_text(hint);
            }
        });
    }

    /// A picture of each field, as many beside each other as there is room for.
    fn maps(&mut self, ui: &mut Ui, fields: &Fields, waves: &Arc<Timed<FieldWavefronts>>) {
        let is_dark = ui.visuals().dark_mode;
        let style = PictureStyle { page: self.page, is_logarithmic: self.is_logarithmic, is_dark };
        let context = ui.ctx().clone();
        let textures = self.textures.get((ByAddress::from(waves), style), |_| {
            let texture = |(i, field): (usize, &Timed<Result<FieldWavefront, AnalysisError>>)| {
                let image = picture(field.value.as_ref().ok()?, style)?;
                Some(context.load_texture(format!("wavefront {i}"), image, TextureOptions::LINEAR))
            };
            waves.value.fields.iter().enumerate().map(texture).collect()
        });
        let count = textures.len().max(1) as f32;
        let room = ui.available_size() - vec2(0.0, WORDS);
        let side = (room.x / count - GAP).min(room.y).clamp(SIDE[0], SIDE[1]);
        ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
            let from_top = Layout::left_to_right(Align::Min).with_main_wrap(true);
            ui.with_layout(from_top, |ui| {
                ui.spacing_mut().item_spacing = vec2(GAP, 4.0);
                for (i, (texture, field)) in textures.iter().zip(&waves.value.fields).enumerate() {
                    cell(ui, (fields, i), (style.page, field, texture.as_ref()), side);
                }
            });
        });
    }
}

/// The wavelength, the rays and the time; or that the numbers are those of the lens before.
fn summary(ui: &mut Ui, waves: &Timed<FieldWavefronts>, is_current: bool) {
    let text = if is_current {
        let lit = waves.value.fields.iter().filter_map(|field| field.value.as_ref().ok());
        let rays: usize = lit
            .map(|field| {
                let image = field.image.as_ref().map_or(0, |image| image.rays);
                field.wavefront.rms.rays + image
            })
            .sum();
        format!("at {:.0} nm, {rays} rays, {:.1} ms", 1e3 * waves.value.um, waves.ms)
    } else {
        "of the lens before; computing …".to_owned()
    };
    ui.label(RichText::new(text).small().weak());
}

/// The picture of a field; `None` if there is none.
fn picture(field: &FieldWavefront, style: PictureStyle) -> Option<ColorImage> {
    if style.page == WavefrontPage::Map {
        let most = largest(&field.map).max(f64::MIN_POSITIVE);
        return Some(raster(&field.map, |value| {
            let [r, g, b] = colormap::diverging((*value)? / most, style.is_dark);
            Some(Color32::from_rgb(r, g, b))
        }));
    }
    let image = field.image.as_ref().ok()?;
    let peak = image.intensity.values.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    Some(raster(&image.intensity, |value| {
        let share = value / peak;
        let share =
            if style.is_logarithmic { 1.0 + share.max(0.0).log10() / DECADES } else { share };
        let [r, g, b] = colormap::sequential(share);
        Some(Color32::from_rgb(r, g, b))
    }))
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
type CellContent<'a> =
    (WavefrontPage, &'a Timed<Result<FieldWavefront, AnalysisError>>, Option<&'a TextureHandle>);

/// A field, its picture and the numbers of it.
fn cell(ui: &mut Ui, field: (&Fields, usize), content: CellContent<'_>, side: f32) {
    let from_top = Layout::top_down(Align::Min);
    ui.allocate_ui_with_layout(vec2(side, side + WORDS), from_top, |ui| {
        ui.set_width(side);
        let name = heading(ui, field.0, field.1);
        cell_content(ui, &name, content, side);
    });
}

fn cell_content(ui: &mut Ui, name: &str, (page, field, texture): CellContent<'_>, side: f32) {
    let Ok(found) = &field.value else {
        return refusal(ui, field.value.as_ref().err());
    };
    let lines = match (page, &found.image) {
        (WavefrontPage::Map, _) => map_lines(found),
        (_, Ok(image)) => image_lines(image),
        (_, Err(why)) => return refusal(ui, Some(why)),
    };
    if let Some(texture) = texture {
        let what = if page == WavefrontPage::Map { "Wavefront" } else { "Point spread" };
        let words = format!("{what} at {name}: {}", lines.join(", "));
        ui.add(Image::new(texture).fit_to_exact_size(vec2(side, side)).alt_text(words))
            .on_hover_text(format!("{} rays, {:.1} ms", found.wavefront.rms.rays, field.ms));
    }
    for line in lines {
        ui.label(RichText::new(line).small());
    }
}

fn refusal(ui: &mut Ui, why: Option<&AnalysisError>) {
    let why = why.map(ToString::to_string).unwrap_or_default();
    ui.label(RichText::new(why).small().color(ui.visuals().warn_fg_color));
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
    format!("{value}{unit}{}", relative_error(estimate))
}

fn map_lines(found: &FieldWavefront) -> Vec<String> {
    let most = number::format_digits(largest(&found.map), 3);
    let rms = estimate_text(found.wavefront.rms, " λ");
    vec![format!("RMS {rms}"), format!("within ± {most} λ")]
}

fn image_lines(image: &PointImage) -> Vec<String> {
    let width = number::format_digits(2e3 * image.intensity.half_width, 3);
    vec![
        format!("Strehl {}", estimate_text(image.strehl.at_chief, "")),
        format!("best {}", estimate_text(image.strehl.best, "")),
        format!("{width} µm wide, {}", plain_error(image.error, "")),
    ]
}

/// The share of the light within circles, a curve for each field.
fn energies(ui: &mut Ui, fields: &Fields, waves: &FieldWavefronts) {
    let palette = Palette::for_visuals(ui.visuals());
    ui.horizontal_wrapped(|ui| {
        for i in 0..waves.fields.len() {
            heading(ui, fields, i);
        }
    });
    let lit: Vec<(usize, &PointImage)> = images(waves).collect();
    if lit.is_empty() {
        ui.weak("No field has an image by diffraction.");
        return;
    }
    let height = (ui.available_height() - 24.0).max(SIDE[0]);
    let plot =
        fixed_plot(ui, "encircled energy", height).include_x(0.0).include_y(0.0).include_y(1.0);
    let plot = plot.x_axis_label("radius, µm").y_axis_label("share of the light");
    plot.show(ui, |plot| {
        for (i, image) in &lit {
            let circles = image.energy.iter().map(|(radius, share)| [1e3 * radius, share.value]);
            let points = std::iter::once([0.0; 2]).chain(circles);
            plot.line(plot_curve(format!("field {i}"), points).color(color32(palette.field(*i))));
        }
    });
    let errors = lit.iter().flat_map(|(_, image)| image.energy.iter().map(|(_, e)| e.error));
    let error = errors.fold(0.0, f64::max);
    ui.label(RichText::new(plain_error(error, "")).small().weak());
}

/// The fields that have an image, with their indices.
fn images(waves: &FieldWavefronts) -> impl Iterator<Item = (usize, &PointImage)> {
    let fields = waves.fields.iter().enumerate();
    fields.filter_map(|(i, field)| Some((i, field.value.as_ref().ok()?.image.as_ref().ok()?)))
}

/// A table of the coefficients, a column for each field.
fn coefficients(ui: &mut Ui, fields: &Fields, waves: &FieldWavefronts) {
    let sums: Vec<_> = waves
        .fields
        .iter()
        .map(|field| field.value.as_ref().ok().and_then(|field| field.zernike.as_ref().ok()))
        .collect();
    let count = sums.iter().flatten().map(|sum| sum.coefficients.len()).max().unwrap_or(0);
    let indices = ZernikeOrder::Noll.indices(count);
    ScrollArea::both().auto_shrink([false, false]).show(ui, |ui| {
        Grid::new("zernike").striped(true).spacing([12.0, 2.0]).show(ui, |ui| {
            ui.weak("Noll");
            ui.weak("Aberration");
            for i in 0..sums.len() {
                heading(ui, fields, i);
            }
            ui.end_row();
            for (k, index) in indices.into_iter().enumerate().skip(1) {
                ui.label((k + 1).to_string());
                ui.label(aberration_name(index));
                for sum in &sums {
                    let found = sum.and_then(|sum| sum.coefficients.get(k).copied());
                    ui.label(found.map_or("-".to_owned(), |e| format!("{:.4}", e.value)));
                }
                ui.end_row();
            }
            ui.label("");
            ui.label("RMS of the rest");
            for sum in &sums {
                ui.label(sum.map_or("-".to_owned(), |sum| format!("{:.4}", sum.rest.value)));
            }
            ui.end_row();
        });
    });
}
