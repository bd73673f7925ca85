//! The blocks of a picture: squares of pixels over which beamlets change as quadratics of the place.

use crate::picture::ImageFrame;
use crate::picture::beamlets::{BeamletTable, TablePlace};

/// The side of the largest blocks, in pixels.
const LARGEST: usize = 64;
/// The side of the smallest blocks.
const SMALLEST: usize = 8;
/// The distance of a block from the axis over its side above which it is not cut: the directions at its
/// points are turned by less than half a right angle against each other.
const DISTANCE: f64 = 1.5;

/// A rectangle of pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct PictureBlock {
    /// The column and the row of its first pixel.
    pub(super) at: [usize; 2],
    /// Columns and rows.
    pub(super) size: [usize; 2],
    /// True about the axis: there beamlets are those of the axis, not turned, and only move with the image
    /// point.
    pub(super) is_central: bool,
}

/// A function of the place in a block, `q0 + q1 s + q2 t + q3 s² + q4 st + q5 t²`, with s and t from −1 to 1
/// over its columns and rows.
pub(super) type Quadratic<T> = [T; 6];

/// A place in a block: its image point, x and y in mm, and its place in the table.
#[derive(Debug, Clone, Copy)]
pub(super) struct BlockNode {
    pub(super) point: [f64; 2],
    pub(super) place: TablePlace,
}

/// The blocks of a picture; those near the axis are small.
pub(super) fn blocks(frame: &ImageFrame) -> Vec<PictureBlock> {
    let [columns, rows] = frame.pixels;
    let mut found = Vec::new();
    for top in (0..rows).step_by(LARGEST) {
        for left in (0..columns).step_by(LARGEST) {
            cut(frame, [left, top], LARGEST, &mut found);
        }
    }
    found
}

fn cut(frame: &ImageFrame, at: [usize; 2], side: usize, found: &mut Vec<PictureBlock>) {
    if at[0] >= frame.pixels[0] || at[1] >= frame.pixels[1] {
        return;
    }
    let [x, y] = frame.point(at, [0.5 * side as f64; 2]);
    let is_central = x.hypot(y) < DISTANCE * side as f64 * frame.pitch;
    if is_central && side > SMALLEST {
        let half = side / 2;
        for [right, down] in [[0, 0], [half, 0], [0, half], [half, half]] {
            cut(frame, [at[0] + right, at[1] + down], half, found);
        }
        return;
    }
    let size = [0, 1].map(|k| side.min(frame.pixels[k] - at[k]));
    found.push(PictureBlock { at, size, is_central });
}

impl PictureBlock {
    /// Half of the distance of the first and last pixel along a side, which s or t of 1 stands for.
    pub(super) fn half(&self, side: usize) -> f64 {
        (0.5 * (self.size[side] as f64 - 1.0)).max(0.5)
    }

    /// The nodes that determine quadratics: the middle, the corners and the middles of the sides, row by row.
    pub(super) fn nodes(&self, frame: &ImageFrame, table: &BeamletTable) -> [BlockNode; 9] {
        std::array::from_fn(|i| {
            let off = [(i % 3) as f64 - 1.0, (i / 3) as f64 - 1.0];
            let within = [0, 1].map(|k| 0.5 * self.size[k] as f64 + off[k] * self.half(k));
            let point = frame.point(self.at, within);
            BlockNode { point, place: table.place(point) }
        })
    }
}

/// The quadratic of values at the nodes of a block.
pub(super) fn fit(values: [f64; 9]) -> Quadratic<f64> {
    let [lower_left, lower, lower_right, left, middle, right, upper_left, upper, upper_right] =
        values;
    [
        middle,
        0.5 * (right - left),
        0.5 * (upper - lower),
        0.5 * (right + left) - middle,
        0.25 * (upper_right - upper_left - lower_right + lower_left),
        0.5 * (upper + lower) - middle,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_cover_every_pixel_once_and_are_small_about_the_axis() {
        let frame =
            ImageFrame { pixels: [203, 131], pitch: 0.01, center: [0.2, -0.1], inverted: true };
        let found = blocks(&frame);
        let mut covered = vec![0; 203 * 131];
        for block in &found {
            for y in block.at[1]..block.at[1] + block.size[1] {
                for x in block.at[0]..block.at[0] + block.size[0] {
                    covered[y * 203 + x] += 1;
                }
            }
            assert!(!block.is_central || block.size.iter().all(|side| *side <= SMALLEST));
        }
        assert!(covered.iter().all(|count| *count == 1));
        assert!(found.iter().any(|block| block.is_central));
    }

    #[test]
    fn a_quadratic_goes_through_its_nodes() {
        let exact = |s: f64, t: f64| 1.0 + 2.0 * s - t + 0.5 * s * s + 0.25 * s * t - 3.0 * t * t;
        let nodes = std::array::from_fn(|i| exact((i % 3) as f64 - 1.0, (i / 3) as f64 - 1.0));
        let found = fit(nodes);
        let wanted = [1.0, 2.0, -1.0, 0.5, 0.25, -3.0];
        assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-14), "{found:?}");
    }
}
