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
use crate::analysis::{Estimate, SquareGrid, ZernikeOrder, aberration_name};
use crate::lens::Fields;
use crate::session::{
    AnalysisResults, Command, FieldWavefront, FieldWavefronts, PanelSetting, PointImage,
    PointImages, SessionView, Timed,
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

impl WavefrontPage {
    /// True if it shows images of a point, which take far longer than wavefronts.
    const fn shows_images(self) -> bool {
        matches!(self, Self::Image | Self::Energy)
    }
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
type TextureKey = (ByAddress<AnalysisResults>, PictureStyle);

/// The panel. It shows the last numbers, faint, until those of a changed lens are there.
#[derive(Default)]
pub struct WavefrontPanel {
    page: WavefrontPage,
    /// True for intensities on a logarithmic scale.
    is_logarithmic: bool,
    /// The last results with wavefronts, and the last ones with images of a point.
    last: [Option<Arc<AnalysisResults>>; 2],
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
        self.pages(ui);
        let images = self.page.shows_images();
        if view.settings.point_images != images {
            actions.push(Command::Show(PanelSetting::PointImages(images)));
        }
        let is_current =
            if images { numbers.point_images.is_some() } else { numbers.wavefronts.is_some() };
        let last = &mut self.last[usize::from(images)];
        if is_current {
            *last = Some(Arc::clone(results));
        }
        let Some(results) = last.clone() else {
            ui.weak("Computing …");
            return;
        };
        let Ok(numbers) = &results.analyses else { return };
        let found = match (images, &numbers.wavefronts, &numbers.point_images) {
            (false, Some(waves), _) => PageNumbers::Waves(waves),
            (true, _, Some(images)) => PageNumbers::Images(images),
            _ => return,
        };
        found.summary(ui, is_current);
        if !is_current {
            ui.multiply_opacity(FAINT);
        }
        let fields = results.lens.fields_at(results.settings.zoom);
        match (self.page, found) {
            (WavefrontPage::Energy, PageNumbers::Images(images)) => {
                energies(ui, fields, &images.value);
            }
            (WavefrontPage::Zernike, PageNumbers::Waves(waves)) => {
                coefficients(ui, fields, &waves.value);
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
}

impl PageNumbers<'_> {
    /// The number of fields.
    fn count(self) -> usize {
        match self {
            Self::Waves(waves) => waves.value.fields.len(),
            Self::Images(images) => images.value.fields.len(),
        }
    }

    /// The wavelength, the rays and the time; or that the numbers are those of the lens before.
    fn summary(self, ui: &mut Ui, is_current: bool) {
        let (um, ms) = match self {
            Self::Waves(waves) => (waves.value.um, waves.ms),
            Self::Images(images) => (images.value.um, images.ms),
        };
        let rays: usize = (0..self.count()).filter_map(|i| self.rays(i)).sum();
        let text = if is_current {
            format!("at {:.0} nm, {rays} rays, {ms:.1} ms", 1e3 * um)
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
        }
    }

    fn ms(self, field: usize) -> f64 {
        match self {
            Self::Waves(waves) => waves.value.fields[field].ms,
            Self::Images(images) => images.value.fields[field].ms,
        }
    }

    /// The lines below the picture of a field, or the reason why there is none.
    fn lines(self, field: usize) -> Result<Vec<String>, String> {
        match self {
            Self::Waves(waves) => waves.value.fields[field].value.as_ref().map(map_lines),
            Self::Images(images) => images.value.fields[field].value.as_ref().map(image_lines),
        }
        .map_err(ToString::to_string)
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
                Some(image_picture(image, style))
            }
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
        let room = ui.available_size() - vec2(0.0, WORDS);
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

/// The path differences of a field as a picture.
fn map_picture(found: &FieldWavefront, style: PictureStyle) -> ColorImage {
    let most = largest(&found.map).max(f64::MIN_POSITIVE);
    raster(&found.map, |value| {
        let [r, g, b] = colormap::diverging((*value)? / most, style.is_dark);
        Some(Color32::from_rgb(r, g, b))
    })
}

/// The image of a point as a picture.
fn image_picture(image: &PointImage, style: PictureStyle) -> ColorImage {
    let peak = image.intensity.values.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    raster(&image.intensity, |value| {
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
    ui.allocate_ui_with_layout(vec2(side, side + WORDS), from_top, |ui| {
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
        let is_map = matches!(found, PageNumbers::Waves(_));
        let what = if is_map { "Wavefront" } else { "Point spread" };
        let words = format!("{what} at {name}: {}", lines.join(", "));
        let rays = found.rays(field).unwrap_or(0);
        ui.add(Image::new(texture).fit_to_exact_size(vec2(side, side)).alt_text(words))
            .on_hover_text(format!("{rays} rays, {:.1} ms", found.ms(field)));
    }
    for line in lines {
        ui.label(RichText::new(line).small());
    }
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
fn energies(ui: &mut Ui, fields: &Fields, found: &PointImages) {
    let palette = Palette::for_visuals(ui.visuals());
    ui.horizontal_wrapped(|ui| {
        for i in 0..found.fields.len() {
            heading(ui, fields, i);
        }
    });
    let lit = found.fields.iter().enumerate();
    let lit = lit.filter_map(|(i, field)| Some((i, field.value.as_ref().ok()?)));
    let lit: Vec<(usize, &PointImage)> = lit.collect();
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
