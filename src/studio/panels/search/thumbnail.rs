//! Small drawings of lenses, drawn once each; glass that the design does not have is tinted.

use std::sync::Arc;

use eframe::egui::{ColorImage, TextureHandle, TextureOptions, Ui, Vec2};

use crate::lens::Lens;
use crate::session::fresh_glass;
use crate::studio::draw::{Bounds, Camera, Scene, software};
use crate::studio::palette::Palette;
use crate::studio::section::Section;
use glam::DVec2;

/// So many drawings are kept.
const KEPT: usize = 64;
/// The free room around a lens, in pixels.
const MARGIN: f64 = 4.0;

/// The drawings so far.
#[derive(Default)]
pub(super) struct Thumbnails {
    /// The one that was used last stands last.
    drawn: Vec<Thumbnail>,
}

impl std::fmt::Debug for Thumbnails {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Thumbnails").field("drawn", &self.drawn.len()).finish()
    }
}

struct Thumbnail {
    key: Key,
    texture: Option<TextureHandle>,
}

/// All on which a drawing depends.
struct Key {
    lens: Arc<Lens>,
    design: Arc<Lens>,
    palette: Palette,
    size: [u32; 2],
}

impl PartialEq for Key {
    /// Lenses are compared by address, which cannot be another's while they are held.
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.lens, &other.lens)
            && Arc::ptr_eq(&self.design, &other.design)
            && self.palette == other.palette
            && self.size == other.size
    }
}

impl Thumbnails {
    /// The drawing of a lens beside the design; none of one that cannot be traced.
    pub(super) fn of(
        &mut self,
        ui: &Ui,
        lens: &Arc<Lens>,
        design: &Arc<Lens>,
        size: Vec2,
    ) -> Option<TextureHandle> {
        let per_point = ui.ctx().pixels_per_point();
        let palette = Palette::of(ui.visuals());
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let size = [size.x, size.y].map(|length| (length * per_point).round() as u32);
        let key = Key { lens: Arc::clone(lens), design: Arc::clone(design), palette, size };
        let known = self.drawn.iter().position(|drawn| drawn.key == key);
        let drawn = known.map(|place| self.drawn.remove(place));
        let drawn = drawn.unwrap_or_else(|| Thumbnail { texture: draw(ui, &key), key });
        let texture = drawn.texture.clone();
        self.drawn.push(drawn);
        if self.drawn.len() > KEPT {
            self.drawn.remove(0);
        }
        texture
    }
}

fn draw(ui: &Ui, key: &Key) -> Option<TextureHandle> {
    let Key { lens, design, palette, size } = key;
    let system = lens.system(0, lens.wavelengths[lens.primary()].um).ok()?;
    let section = Section::new(&system, &[]);
    let mut scene = Scene::on([0, 0, 0, 0]);
    section.draw_glass(&mut scene, palette, &fresh_glass(lens, design));
    section.draw_outlines(&mut scene, palette);
    let Bounds { min, max } = section.bounds()?;
    // The axis goes on a little beyond both ends.
    let ends = 0.05 * DVec2::new(max.x - min.x, 0.0);
    let whole = Bounds { min: min - ends, max: max + ends };
    let camera = Camera::fit(whole, DVec2::new(size[0].into(), size[1].into()), MARGIN);
    let picture = software::draw(&scene, camera, *size);
    let size = size.map(|n| n as usize);
    let image = ColorImage::from_rgba_premultiplied(size, &picture.rgba);
    Some(ui.ctx().load_texture("thumbnail", image, TextureOptions::LINEAR))
}
