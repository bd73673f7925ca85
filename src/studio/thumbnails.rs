//! Small drawings of lenses, kept as textures.

use std::sync::Arc;

use egui::{Color32, ColorImage, Pos2, Rect, TextureHandle, TextureOptions, Ui, Vec2, pos2};
use glam::DVec2;

use super::cached::ByAddress;
use super::draw::{BoundingBox, Camera, Scene, software};
use super::palette::Palette;
use super::section::SectionDrawing;
use crate::analysis::clear_semi_diameters;
use crate::lens::{Lens, added_glass};
use crate::pupil::RayModel;

/// The number of drawings that are cached.
const CAPACITY: usize = 64;
/// The margin around a lens, in pixels.
const MARGIN: f64 = 4.0;

/// The cached drawings.
#[derive(Default)]
pub(super) struct Thumbnails {
    /// The most recently used one is the last.
    cached: Vec<Thumbnail>,
}

impl std::fmt::Debug for Thumbnails {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Thumbnails").field("drawn", &self.cached.len()).finish()
    }
}

struct Thumbnail {
    key: ThumbnailKey,
    texture: Option<TextureHandle>,
}

/// The key of a drawing.
#[derive(PartialEq)]
struct ThumbnailKey {
    lens: ByAddress<Lens>,
    design: ByAddress<Lens>,
    palette: Palette,
    size: [u32; 2],
}

impl Thumbnails {
    /// Draws a lens into a part of the window, with glass tinted that the design does not have.
    pub(super) fn paint(&mut self, ui: &Ui, lens: &Arc<Lens>, design: &Arc<Lens>, rect: Rect) {
        let all = Rect::from_min_max(Pos2::ZERO, pos2(1.0, 1.0));
        if let Some(texture) = self.texture(ui, lens, design, rect.size()) {
            ui.painter().image(texture.id(), rect, all, Color32::WHITE);
        }
    }

    /// The drawing of a lens, with glass tinted that the design does not have; `None` if it cannot
    /// be traced.
    fn texture(
        &mut self,
        ui: &Ui,
        lens: &Arc<Lens>,
        design: &Arc<Lens>,
        size: Vec2,
    ) -> Option<TextureHandle> {
        let per_point = ui.ctx().pixels_per_point();
        let palette = Palette::for_visuals(ui.visuals());
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let size = [size.x, size.y].map(|length| (length * per_point).round() as u32);
        let key = ThumbnailKey { lens: lens.into(), design: design.into(), palette, size };
        let known = self.cached.iter().position(|drawn| drawn.key == key);
        let drawn = known.map(|place| self.cached.remove(place));
        let drawn = drawn.unwrap_or_else(|| Thumbnail { texture: draw(ui, &key), key });
        let texture = drawn.texture.clone();
        self.cached.push(drawn);
        if self.cached.len() > CAPACITY {
            self.cached.remove(0);
        }
        texture
    }
}

/// The heights of the rays at each surface, in mm, if a semi-diameter follows them; otherwise none.
fn ray_heights(lens: &Lens) -> Vec<f64> {
    if lens.surfaces.iter().all(|row| row.semi_diameter.is_some()) {
        return Vec::new();
    }
    let model = RayModel::from_lens(lens, 0);
    model.map(|model| clear_semi_diameters([&model])).unwrap_or_default()
}

fn draw(ui: &Ui, key: &ThumbnailKey) -> Option<TextureHandle> {
    let ThumbnailKey { lens, design, palette, size } = key;
    let system = lens.resolve(0, lens.wavelengths[lens.primary()].um).ok()?;
    let section = SectionDrawing::new(&system, &ray_heights(lens));
    let mut scene = Scene::on([0, 0, 0, 0]);
    section.draw_glass(&mut scene, palette, &added_glass(lens, design));
    section.draw_outlines(&mut scene, palette);
    let BoundingBox { min, max } = section.bounds()?;
    // The axis extends a little beyond both ends.
    let ends = 0.05 * DVec2::new(max.x - min.x, 0.0);
    let whole = BoundingBox { min: min - ends, max: max + ends };
    let camera = Camera::fit(whole, DVec2::new(size[0].into(), size[1].into()), MARGIN);
    let picture = software::draw(&scene, camera, *size);
    let size = size.map(|n| n as usize);
    let image = ColorImage::from_rgba_premultiplied(size, &picture.rgba);
    Some(ui.ctx().load_texture("thumbnail", image, TextureOptions::LINEAR))
}
