//! The images of all views that make one, each beside its target: as the loss sees them while a design takes steps,
//! and rendered, with their error, once the field rests.

use egui::{
    Color32, ColorImage, Image as Shown, RichText, TextureHandle, TextureOptions, Ui, vec2,
};

use super::text;
use crate::grin_design::ViewImage;
use crate::picture::ProjectedView;
use crate::session::{GrinAnalysis, GrinPictures, GrinRun, SessionView};
use crate::studio::cached::{ByAddress, Cached};

/// The images as textures.
#[derive(Default)]
pub(super) struct ViewImages {
    pairs: Cached<ImageKey, Vec<ImagePair>>,
}

/// The light that is shown: that of the loss, and the rendered images.
type ImageKey =
    (ByAddress<Result<GrinAnalysis, String>>, Option<ByAddress<Result<GrinPictures, String>>>);

/// The target image and the resulting image of a view.
struct ImagePair {
    view: usize,
    textures: [TextureHandle; 2],
}

impl std::fmt::Debug for ViewImages {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Images").finish_non_exhaustive()
    }
}

impl ViewImages {
    /// Shows them one above the other.
    pub(super) fn ui(&mut self, ui: &mut Ui, view: &SessionView, run: &GrinRun) {
        let Some(source) = &view.grin.analysis else {
            ui.weak("Tracing all views…");
            return;
        };
        let Ok(analysis) = source.as_ref() else { return };
        let rendered = view.grin.pictures.as_ref();
        let pictures = rendered.and_then(|pictures| pictures.as_ref().as_ref().ok());
        let key = (source.into(), rendered.map(ByAddress::from));
        let pairs = self.pairs.get(key, |_| image_pairs(ui, analysis, pictures));
        if pairs.is_empty() {
            ui.weak("No view of this task makes an image.");
            return;
        }
        for pair in pairs {
            let name = run.document.task.as_ref().and_then(|task| task.views.get(pair.view));
            let name = name.map_or("", |view| view.name.as_str());
            ui.label(match pictures.and_then(|pictures| picture_of(pictures, pair.view)) {
                Some(picture) => text::picture_text(name, picture),
                None => text::image_text(name, &analysis.views.value[pair.view]),
            });
            pair.ui(ui, name);
        }
        if let Some(pictures) = pictures {
            let text = format!("Images in {:.0} ms", pictures.views.ms);
            ui.label(RichText::new(text).small().weak());
        } else if let Some(Err(why)) = rendered.map(AsRef::as_ref) {
            ui.weak(format!("No rendered images: {why}"));
        }
    }
}

impl ImagePair {
    /// Shows both side by side.
    fn ui(&self, ui: &mut Ui, name: &str) {
        let side = (0.5 * (ui.available_width() - 10.0)).clamp(60.0, 320.0);
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = 6.0;
            for (texture, what) in self.textures.iter().zip(["target", "result"]) {
                ui.vertical(|ui| {
                    let image = Shown::new(texture).fit_to_exact_size(vec2(side, side));
                    ui.add(image.alt_text(format!("Image of {name}: {what}")))
                        .on_hover_text("Seen against the light");
                    ui.label(RichText::new(what).small().weak());
                });
            }
        });
    }
}

/// The rendered image of a view.
fn picture_of(pictures: &GrinPictures, view: usize) -> Option<&ProjectedView> {
    pictures.views.value.get(view)?.as_ref()
}

fn image_pairs(
    ui: &Ui,
    analysis: &GrinAnalysis,
    pictures: Option<&GrinPictures>,
) -> Vec<ImagePair> {
    let views = analysis.views.value.iter().enumerate();
    let rendered = |view| Some(&picture_of(pictures?, view)?.image);
    let images =
        views.filter_map(|(view, seen)| Some((view, rendered(view).or(seen.image.as_ref())?)));
    let pair = |(view, image): (usize, &ViewImage)| {
        // Both to one scale: the brightest of the picture is white.
        let white = image.target.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let texture = |what: &str, values: &[f64]| {
            let name = format!("{what} {view}");
            ui.ctx().load_texture(
                name,
                gray_image(values, image.pixels, white),
                TextureOptions::NEAREST,
            )
        };
        ImagePair {
            view,
            textures: [texture("wanted", &image.target), texture("made", &image.formed)],
        }
    };
    images.map(pair).collect()
}

/// Light in grey, rows from the top.
fn gray_image(values: &[f64], pixels: usize, white: f64) -> ColorImage {
    let pixel = |n: usize| {
        let value = values[(pixels - 1 - n / pixels) * pixels + n % pixels];
        Color32::from_gray((255.0 * (value / white).clamp(0.0, 1.0)).round() as u8)
    };
    ColorImage::new([pixels, pixels], (0..pixels * pixels).map(pixel).collect())
}
