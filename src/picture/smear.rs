//! A painting that moves: its mean over the way that it goes during an exposure.
//!
//! Texels are added up along the way, one after the other along its longer side; across it two neighbours are
//! mixed. What is behind a moving plane at rest shows through as the mean of its cover says, so that one moving
//! plane is exact, and where two cross the mean of their product is taken for the product of means.

use crate::math::{SimdWidth, run_vectorized};
use rayon::prelude::*;
use std::f64::consts::PI;

/// The contrast that steady motion over a way in mm leaves at a frequency along it in cycles/mm.
pub fn smear_contrast(way: f64, frequency: f64) -> f64 {
    let phase = PI * way * frequency;
    if phase == 0.0 { 1.0 } else { phase.sin() / phase }
}

/// Red, green and blue times cover, and cover.
pub(super) type PaintTexel = [f32; 4];

/// Texels that reach as far beyond the wanted ones as the way needs.
pub(super) struct SmearedTexels {
    texels: Vec<PaintTexel>,
    /// The columns of these texels.
    width: usize,
    /// The first wanted column and row in them.
    first: [usize; 2],
    taps: Vec<SmearTap>,
}

/// A texel of the way, as columns and rows back from its end, and the share of the mean that it has.
#[derive(Debug, Clone, Copy, PartialEq)]
struct SmearTap {
    back: [i64; 2],
    share: f32,
}

/// The texels needed beyond the wanted ones: before the first and behind the last columns and rows.
pub(super) fn margins(way: [f64; 2]) -> [[usize; 2]; 2] {
    // Light comes from where the painting was.
    let of = |k: usize| {
        let more = way[k].abs().ceil() as usize + 1;
        if way[k] > 0.0 { [more, 1] } else { [1, more] }
    };
    [of(0), of(1)]
}

impl SmearedTexels {
    /// The mean along a way, in texels, of texels with these [`margins`] around what is wanted.
    pub(super) fn new(texels: Vec<PaintTexel>, width: usize, way: [f64; 2]) -> Self {
        let [[left, _], [below, _]] = margins(way);
        Self { texels, width, first: [left, below], taps: taps(way) }
    }

    /// The means of a number of rows of so many columns, from this row on.
    pub(super) fn rows(&self, from: usize, (rows, columns): (usize, usize)) -> Vec<PaintTexel> {
        let mut found = vec![[0.0; 4]; rows * columns];
        found.par_chunks_mut(columns.max(1)).enumerate().for_each(|(row, line)| {
            for tap in &self.taps {
                let y = (self.first[1] + from + row) as i64 - tap.back[1];
                let x = self.first[0] as i64 - tap.back[0];
                let start = y as usize * self.width + x as usize;
                let source = &self.texels[start..start + columns];
                run_vectorized(
                    SimdWidth::Bits512,
                    #[inline(always)]
                    || add(line, source, tap.share),
                );
            }
        });
        found
    }
}

#[inline(always)]
fn add(line: &mut [PaintTexel], source: &[PaintTexel], share: f32) {
    let sums = line.as_flattened_mut();
    for (sum, value) in sums.iter_mut().zip(source.as_flattened()) {
        *sum += share * value;
    }
}

/// The texels of a way with their shares, of texels that are mixed linearly.
fn taps(way: [f64; 2]) -> Vec<SmearTap> {
    let long = usize::from(way[1].abs() > way[0].abs());
    let length = way[long].abs();
    if !(length > 0.0) {
        return vec![SmearTap { back: [0, 0], share: 1.0 }];
    }
    let (sign, slope) = (way[long].signum(), way[1 - long] / length);
    // The integral of a tent about 0.
    let integral = |u: f64| match u.clamp(-1.0, 1.0) {
        u if u < 0.0 => 0.5 * (1.0 + u) * (1.0 + u),
        u => 0.5 + u - 0.5 * u * u,
    };
    let mut taps = Vec::new();
    for i in 0..=length.ceil() as i64 {
        let at = i as f64;
        let share = (integral(length - at) - integral(-at)) / length;
        let across = slope * at.min(length);
        let part = across - across.floor();
        for (beside, part) in [(0, 1.0 - part), (1, part)] {
            let mut back = [0; 2];
            back[long] = sign as i64 * i;
            back[1 - long] = across.floor() as i64 + beside;
            if share * part > 0.0 {
                taps.push(SmearTap { back, share: (share * part) as f32 });
            }
        }
    }
    taps
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Waves along any way keep the contrast that their mean over it has, sin(x)/x, and no light is lost.
    #[test]
    fn a_smeared_wave_has_its_closed_form() {
        let (columns, rows) = (40, 30);
        for way in [[0.3, 0.0], [7.5, 0.0], [-6.0, 0.0], [0.0, 9.25], [5.0, -3.0], [-2.0, -8.5]] {
            let [[left, right], [below, above]] = margins(way);
            let (width, height) = (left + columns + right, below + rows + above);
            let nu = [0.02, 0.013];
            let phase = |x: f64, y: f64| 2.0 * PI * (nu[0] * x + nu[1] * y);
            let texel = |i: usize| {
                let [x, y] = [(i % width) as f64 - left as f64, (i / width) as f64 - below as f64];
                [1.0 + phase(x, y).cos() as f32, 0.0, 0.0, 1.0]
            };
            let texels = (0..width * height).map(texel).collect();
            let found = SmearedTexels::new(texels, width, way).rows(0, (rows, columns));
            let half = 0.5 * (phase(way[0], way[1]));
            let contrast = half.sin() / half;
            for (i, [light, _, _, cover]) in found.into_iter().enumerate() {
                let [x, y] = [i % columns, i / columns].map(|v| v as f64);
                let exact = 1.0 + contrast * (phase(x, y) - half).cos();
                assert!((f64::from(light) - exact).abs() < 6e-3, "{way:?}: {light} {exact}");
                assert!((cover - 1.0).abs() < 1e-5, "{way:?}: {cover}");
            }
        }
    }
}
