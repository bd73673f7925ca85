//! A painting as texels at halved resolutions, so that its mean over any spot costs eight of them.
//!
//! Texels of one level are interpolated by tents: the variance of the weight of the painting around a place
//! is then a quarter of the square of a texel, the box of the texel and the tent together. A spot of a given
//! variance mixes the two levels around it so that the variances agree (Williams, SIGGRAPH 1983, chose by
//! width).

use super::pattern::{Paint, PaintedPoint};
use super::scene::SceneLayer;
use rayon::prelude::*;

/// Red, green, blue times cover, and cover.
type Texel = [f32; 4];

/// The samples along a side of a texel of the finest level.
const SAMPLES: usize = 2;

/// The part of a painting that a picture sees.
#[derive(Debug, Clone)]
pub(super) struct MipTexture {
    /// The lower left corner, in the unit of the plane from the middle of the painting.
    corner: [f64; 2],
    /// The side of a texel of the finest level.
    texel: f64,
    levels: Vec<MipLevel>,
}

#[derive(Debug, Clone)]
struct MipLevel {
    size: [usize; 2],
    texels: Vec<Texel>,
}

impl MipTexture {
    /// The painting of a layer within a rectangle, given by its lower left and its upper right corner, with
    /// texels of this size.
    pub(super) fn new(layer: &SceneLayer, [corner, end]: [[f64; 2]; 2], texel: f64) -> Self {
        let count = |k: usize| ((end[k] - corner[k]) / texel).ceil().max(1.0) as usize;
        let size = [count(0), count(1)];
        let part = texel / SAMPLES as f64;
        let mean = |column: usize, row: usize| {
            let mut sum = [0.0; 4];
            for i in 0..SAMPLES * SAMPLES {
                let at = |k: usize, cell: usize, sub: usize| {
                    corner[k] + texel * cell as f64 + part * (sub as f64 + 0.5)
                };
                let place = [at(0, column, i % SAMPLES), at(1, row, i / SAMPLES)];
                let paint = premultiplied(layer, place);
                sum = [0, 1, 2, 3].map(|c| sum[c] + paint[c]);
            }
            sum.map(|v| (v / (SAMPLES * SAMPLES) as f64) as f32)
        };
        let mut texels = vec![[0.0; 4]; size[0] * size[1]];
        let rows = texels.par_chunks_mut(size[0]).enumerate();
        rows.for_each(|(row, texels)| {
            texels.iter_mut().enumerate().for_each(|(column, texel)| *texel = mean(column, row));
        });
        let mut levels = vec![MipLevel { size, texels }];
        while let Some(next) = levels.last().and_then(MipLevel::halved) {
            levels.push(next);
        }
        Self { corner, texel, levels }
    }

    /// The mean around a place over a spot with this variance along each axis: one colour times its cover,
    /// and the cover.
    pub(super) fn mean(&self, place: [f64; 2], variance: f64, color: usize) -> [f64; 2] {
        let from_corner = [0, 1].map(|k| (place[k] - self.corner[k]) / self.texel);
        let finest = 0.25 * self.texel * self.texel;
        let ratio = (variance / finest).max(1.0);
        let last = self.levels.len() - 1;
        // The variance of a level is four times that of the one before.
        let level = (0.5 * ratio.log2()) as usize;
        if level >= last {
            return self.levels[last].tent(scaled(from_corner, last), color);
        }
        let coarser = ((ratio / 4f64.powi(level as i32) - 1.0) / 3.0).clamp(0.0, 1.0);
        let fine = self.levels[level].tent(scaled(from_corner, level), color);
        if coarser == 0.0 {
            return fine;
        }
        let coarse = self.levels[level + 1].tent(scaled(from_corner, level + 1), color);
        [0, 1].map(|k| fine[k] + coarser * (coarse[k] - fine[k]))
    }
}

fn scaled(place: [f64; 2], level: usize) -> [f64; 2] {
    place.map(|v| v / (1_u64 << level) as f64)
}

fn premultiplied(layer: &SceneLayer, place: [f64; 2]) -> [f64; 4] {
    let half_size = layer.half_size;
    if place[0].abs() > half_size[0] || place[1].abs() > half_size[1] {
        return [0.0; 4];
    }
    let Paint { radiance: [red, green, blue], cover } =
        layer.pattern.paint(PaintedPoint { place, half_size });
    [red * cover, green * cover, blue * cover, cover]
}

impl MipLevel {
    /// The level of half the resolution; `None` of a single texel.
    fn halved(&self) -> Option<Self> {
        let [width, height] = self.size;
        if width == 1 && height == 1 {
            return None;
        }
        let size = self.size.map(|count| count.div_ceil(2));
        let texel = |i: usize| {
            let (column, row) = (2 * (i % size[0]), 2 * (i / size[0]));
            let mut sum = [0.0; 4];
            for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                let (x, y) = ((column + dx).min(width - 1), (row + dy).min(height - 1));
                let found = self.texels[y * width + x];
                sum = [0, 1, 2, 3].map(|c| sum[c] + 0.25 * found[c]);
            }
            sum
        };
        Some(Self { size, texels: (0..size[0] * size[1]).map(texel).collect() })
    }

    /// A colour and the cover at a place in texels from the corner, interpolated between their middles.
    fn tent(&self, [x, y]: [f64; 2], color: usize) -> [f64; 2] {
        let [width, height] = self.size;
        let split = |at: f64, count: usize| {
            let at = (at - 0.5).clamp(0.0, (count - 1) as f64);
            let low = at as usize;
            (low, (low + 1).min(count - 1), at - low as f64)
        };
        let ((left, right, across), (lower, upper, along)) = (split(x, width), split(y, height));
        let at = |column: usize, row: usize| {
            let texel = &self.texels[row * width + column];
            [f64::from(texel[color]), f64::from(texel[3])]
        };
        let mix = |a: [f64; 2], b: [f64; 2], t: f64| [0, 1].map(|k| a[k] + t * (b[k] - a[k]));
        let below = mix(at(left, lower), at(right, lower), across);
        let above = mix(at(left, upper), at(right, upper), across);
        mix(below, above, along)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::Pattern;

    fn wave(frequency: f64) -> MipTexture {
        let layer = SceneLayer {
            distance: None,
            center: [0.0; 2],
            half_size: [64.0; 2],
            velocity: [0.0; 2],
            pattern: Pattern::Wave { contrast: 0.5, frequency: [frequency, 0.0], phase: 0.3 },
        };
        MipTexture::new(&layer, [[-64.0; 2], [64.0; 2]], 1.0)
    }

    #[test]
    fn a_spot_takes_contrast_as_its_variance_says() {
        let texture = wave(0.02);
        for variance in [0.25, 1.0, 4.0, 7.0] {
            let damping = (-0.5 * (std::f64::consts::TAU * 0.02_f64).powi(2) * variance).exp();
            for x in [-7.3, 0.0, 11.1] {
                let exact = 1.0 + 0.5 * damping * (std::f64::consts::TAU * 0.02 * x + 0.3).cos();
                let [found, cover] = texture.mean([x, 3.0], variance, 1);
                assert!((found - exact).abs() < 0.01, "{variance} {x}: {found} {exact}");
                assert!((cover - 1.0).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn the_largest_spot_has_the_mean_of_all() {
        let [found, cover] = wave(0.25).mean([0.0, 0.0], 1e9, 0);
        assert!((found - 1.0).abs() < 1e-3 && cover == 1.0, "{found}");
    }
}
