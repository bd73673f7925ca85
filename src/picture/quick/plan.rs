//! The plan of a block: the beams that are evaluated in it, each with its views of the paintings.
//!
//! A beam is a beamlet of one colour over a block. The picture of a beam is smooth if its spot is wide, and
//! is evaluated on a lattice of pixels then, between which cubic B-splines interpolate. These blur by a third
//! of the square of their spacing, which is taken off the variance of the spot, as the square of a pixel over
//! twelve is added. A spot that is longer than wide is a row of round ones.

use super::blocks::{BlockNode, PictureBlock, Quadratic, fit};
use crate::picture::ImageFrame;
use crate::picture::beamlets::{BeamletSpot, BeamletTable};
use crate::picture::mip_texture::MipTexture;
use std::sync::Arc;

/// The spacing of a lattice over the smaller standard deviation of the spot in pixels, at most: the spline
/// then takes three quarters of the variance.
const SPACING: f64 = 1.5;
/// The texels at the border of a painting that may have less than full cover.
const BORDER: f64 = 4.0;
/// The side of a block over the largest spacing.
const PARTS: usize = 4;
/// The larger variance of a spot over the smaller up to which it is taken for round.
const ROUND: f64 = 1.35;
/// The largest ratio of variances of a row of round spots; one that is longer is widened.
const LONGEST: f64 = 20.0;

/// A plane of the scene: where it is, how beamlets meet it, and its painting.
#[derive(Debug)]
pub(super) struct ScenePlane {
    /// The spots, from the axis, by row of the table, then colour and window.
    pub(super) spots: Vec<Vec<BeamletSpot>>,
    /// The places of the mean rays of each colour near the axis over their image points.
    pub(super) scales: Vec<f64>,
    /// The middle of the painting, and half of its sides.
    pub(super) center: [f64; 2],
    pub(super) half_size: [f64; 2],
    /// The way of the painting during the exposure.
    pub(super) way: [f64; 2],
    pub(super) texture: Arc<MipTexture>,
}

/// A beamlet of one colour in a block.
#[derive(Debug, Clone, Copy)]
pub(super) struct BlockBeam {
    pub(super) weight: Quadratic<f32>,
    pub(super) color: usize,
    /// The spacing of its lattice, in pixels.
    pub(super) step: usize,
    /// Its first view of a painting, and the one behind the last.
    pub(super) looks: [usize; 2],
}

/// A beam's view of a painting.
#[derive(Debug, Clone, Copy)]
pub(super) struct BeamLook {
    /// The place in texels of the level from the middle of the first, column and row.
    pub(super) place: [Quadratic<f32>; 2],
    pub(super) plane: usize,
    /// The level, and the share of the coarser one.
    pub(super) level: usize,
    pub(super) coarser: f32,
    /// The number of round spots in a row.
    pub(super) taps: usize,
    /// Their distance, in texels.
    pub(super) tap: [f32; 2],
    /// True if the painting covers all that the beam sees.
    pub(super) is_covered: bool,
}

/// The beams of a block.
#[derive(Debug, Clone, Default)]
pub(super) struct BlockPlan {
    /// In the order of colours and of spacings, the finest first.
    pub(super) beams: Vec<BlockBeam>,
    pub(super) looks: Vec<BeamLook>,
    /// The light of each colour that comes from no plane in front of the lens, for a background of 1.
    pub(super) sideways: Vec<f64>,
}

/// The tables that plans are made of.
#[derive(Debug, Clone, Copy)]
pub(super) struct PlanSource<'a> {
    pub(super) table: &'a BeamletTable,
    pub(super) planes: &'a [ScenePlane],
    pub(super) frame: &'a ImageFrame,
    pub(super) colors: usize,
}

/// The spots of a beam on a plane, over a block.
struct SeenSpot {
    plane: usize,
    place: [Quadratic<f64>; 2],
    variance: [f64; 3],
    /// The derivatives of the place by the pixel: along columns and along rows.
    slopes: [[f64; 2]; 2],
}

impl PlanSource<'_> {
    /// The beams of a block, on lattices of this spacing in pixels at most.
    pub(super) fn plan(&self, block: &PictureBlock, most: usize) -> BlockPlan {
        let nodes = block.nodes(self.frame, self.table);
        let mut found =
            BlockPlan { sideways: self.sideways(block, &nodes), ..BlockPlan::default() };
        for color in 0..self.colors {
            let from = found.beams.len();
            for window in 0..self.table.windows {
                self.add_beam(block, &nodes, (color, window, most), &mut found);
            }
            found.beams[from..].sort_by_key(|beam| beam.step);
        }
        found
    }

    fn sideways(&self, block: &PictureBlock, nodes: &[BlockNode; 9]) -> Vec<f64> {
        let place = nodes[4].place;
        let at = |row: usize, color: usize| self.table.rows[row].sideways[color];
        let of_color = |color: usize| {
            if block.is_central {
                return at(0, color);
            }
            let inner = at(place.row, color);
            inner + place.part.min(1.0) * (at(place.row + 1, color) - inner)
        };
        (0..self.colors).map(of_color).collect()
    }

    /// Adds the beam of a window if it brings light.
    fn add_beam(
        &self,
        block: &PictureBlock,
        nodes: &[BlockNode; 9],
        (color, window, most): (usize, usize, usize),
        found: &mut BlockPlan,
    ) {
        let index = color * self.table.windows + window;
        let weights: [f64; 9] = std::array::from_fn(|i| {
            let place = nodes[i].place;
            let at = |row: usize| self.table.rows[row].beamlets[index].weight;
            let inner = at(if block.is_central { 0 } else { place.row });
            if block.is_central {
                return inner;
            }
            (inner + place.part * (at(place.row + 1) - inner)).max(0.0)
        });
        if weights.iter().all(|weight| !(*weight > 0.0)) {
            return;
        }
        let seen = |plane: usize| self.seen(block, nodes, plane, (color, index));
        let spots: Vec<SeenSpot> = (0..self.planes.len()).map(seen).collect();
        let most = most.min(block.size[0].min(block.size[1]) / PARTS).max(1);
        let step = spots.iter().map(|spot| spot.step(most)).min().unwrap_or(1);
        let first = found.looks.len();
        found.looks.extend(spots.iter().filter_map(|spot| self.look(spot, step)));
        let looks = [first, found.looks.len()];
        let weight = fit(weights).map(|v| v as f32);
        found.beams.push(BlockBeam { weight, color, step, looks });
    }

    /// The spots of a beam on a plane.
    fn seen(
        &self,
        block: &PictureBlock,
        nodes: &[BlockNode; 9],
        plane: usize,
        (color, index): (usize, usize),
    ) -> SeenSpot {
        let ScenePlane { spots, scales, center, .. } = &self.planes[plane];
        let spots: [BeamletSpot; 9] = std::array::from_fn(|i| {
            let BlockNode { point, place } = nodes[i];
            if block.is_central {
                let spot = spots[0][index];
                let moved = |k: usize| spot.place[k] + scales[color] * point[k];
                return BeamletSpot { place: [moved(0), moved(1)], ..spot };
            }
            let [inner, outer] = [place.row, place.row + 1].map(|row| &spots[row][index]);
            inner.mixed(outer, place.part).turned(place.turn)
        });
        // Where a beam has no light, its place is that of another node: it has no weight there.
        let lit = spots.iter().find(|spot| spot.weight > 0.0).copied().unwrap_or_default();
        let lit = |i: usize| if spots[i].weight > 0.0 { spots[i] } else { lit };
        let place = [0, 1].map(|k| fit(std::array::from_fn(|i| lit(i).place[k] - center[k])));
        let slopes = [1, 2].map(|along| [0, 1].map(|k| place[k][along] / block.half(along - 1)));
        SeenSpot { plane, place, variance: lit(4).variance, slopes }
    }

    /// The view of a painting by a beam on a lattice; `None` far beside the painting.
    fn look(&self, spot: &SeenSpot, step: usize) -> Option<BeamLook> {
        let ScenePlane { texture, half_size, way, .. } = &self.planes[spot.plane];
        let blur = RoundSpots::new(spot.blurred(step), texture.finest());
        let (level, coarser) = texture.level(blur.variance);
        let unit = texture.texel * 2_f64.powi(level as i32);
        let reach = 3.0 * blur.longest.sqrt() + 2.0 * unit;
        // A lattice goes beyond its block by a quarter of it.
        let wide = |k: usize| spot.place[k][1..].iter().map(|v| 1.5 * v.abs()).sum::<f64>();
        let is_beside =
            |k: usize| spot.place[k][0].abs() > half_size[k] + way[k].abs() + wide(k) + reach;
        if is_beside(0) || is_beside(1) {
            return None;
        }
        let is_within = |k: usize| {
            let inside = half_size[k] - way[k].abs();
            spot.place[k][0].abs() + wide(k) + reach + BORDER * unit < inside
        };
        let scaled = |k: usize| {
            let mut place = spot.place[k].map(|v| v / unit);
            place[0] -= texture.corner[k] / unit + 0.5;
            place.map(|v| v as f32)
        };
        let tap = blur.tap.map(|v| (v / unit) as f32);
        let (plane, coarser) = (spot.plane, coarser as f32);
        Some(BeamLook {
            place: [scaled(0), scaled(1)],
            plane,
            level,
            coarser,
            taps: blur.taps,
            tap,
            is_covered: texture.light(0, 0).is_some() && is_within(0) && is_within(1),
        })
    }
}

impl SeenSpot {
    /// The largest spacing of a lattice on which the spot is smooth, a power of two up to `most`.
    fn step(&self, most: usize) -> usize {
        let [[a, c], [b, d]] = self.slopes;
        let determinant = a * d - b * c;
        let [xx, xy, yy] = self.variance;
        // The variance in pixels: through the inverse of the slopes.
        let through = |[p, q]: [f64; 2], [r, s]: [f64; 2]| {
            (p * r * xx + (p * s + q * r) * xy + q * s * yy) / (determinant * determinant)
        };
        let (first, second) = ([d, -b], [-c, a]);
        let on_pixels = [through(first, first), through(first, second), through(second, second)];
        let [longer, shorter] = axes(on_pixels).0;
        let least = shorter.max(longer / LONGEST) + 1.0 / 12.0;
        let mut step = 1;
        while 2 * step <= most && (2 * step) as f64 <= SPACING * least.sqrt() {
            step *= 2;
        }
        step
    }

    /// The variance with that of a pixel and without that of the splines of a lattice.
    fn blurred(&self, step: usize) -> [f64; 3] {
        let splines = if step > 1 { (step * step) as f64 / 3.0 } else { 0.0 };
        let more = 1.0 / 12.0 - splines;
        let [[a, c], [b, d]] = self.slopes;
        let pixel = [a * a + b * b, a * c + b * d, c * c + d * d];
        [0, 1, 2].map(|k| self.variance[k] + more * pixel[k])
    }
}

/// A row of round spots with the variance of a longer one.
#[derive(Debug, Clone, Copy, PartialEq)]
struct RoundSpots {
    /// The variance of each.
    variance: f64,
    /// The variance along the row.
    longest: f64,
    taps: usize,
    /// Their distance.
    tap: [f64; 2],
}

impl RoundSpots {
    /// The row for a variance along x, of x with y, and along y, none below a least one.
    fn new(variance: [f64; 3], least: f64) -> Self {
        let ([longer, shorter], direction) = axes(variance);
        let shorter = shorter.max(least);
        let longer = longer.max(shorter);
        let variance = if longer < ROUND * shorter {
            0.5 * (longer + shorter)
        } else {
            shorter.max(longer / LONGEST)
        };
        let rest = (longer - variance).max(0.0);
        // The shares of taps in a row of distance 1 have variances of 1/4 (1, 1), 1/2 (1, 2, 1) and
        // 3/4 (1, 3, 3, 1).
        let (taps, distance) = match rest / variance {
            ratio if longer < ROUND * shorter || ratio < 0.1 => (1, 0.0),
            ratio if ratio < 1.3 => (2, (4.0 * rest).sqrt()),
            ratio if ratio < 2.9 => (3, (2.0 * rest).sqrt()),
            _ => (4, (rest / 0.75).sqrt()),
        };
        Self { variance, longest: longer, taps, tap: direction.map(|v| v * distance) }
    }
}

/// The smaller variance of a spot with that of a pixel of this side, and without that of splines where they
/// are used.
pub(super) fn least_variance(variance: [f64; 3], pixel: f64) -> f64 {
    let square = pixel * pixel;
    let least = axes(variance).0[1].max(0.0) + square / 12.0;
    let splines =
        if least > (2.0 / SPACING).powi(2) * square { SPACING * SPACING / 3.0 } else { 0.0 };
    least * (1.0 - splines)
}

/// The larger and the smaller variance along an axis of an ellipse, and the direction of the larger.
fn axes([xx, xy, yy]: [f64; 3]) -> ([f64; 2], [f64; 2]) {
    let (mean, off) = (0.5 * (xx + yy), 0.5 * (xx - yy));
    let root = off.hypot(xy);
    let (sin, cos) = (0.5 * xy.atan2(off)).sin_cos();
    ([mean + root, mean - root], [cos, sin])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The offsets and shares of the taps, as where they are summed.
    fn variance_of(spots: &RoundSpots) -> [f64; 3] {
        let along: f64 = crate::picture::quick::sums::taps(spots.taps)
            .iter()
            .map(|(offset, share)| f64::from(offset * offset * share))
            .sum();
        let [x, y] = spots.tap;
        [spots.variance + along * x * x, along * x * y, spots.variance + along * y * y]
    }

    #[test]
    fn a_row_of_round_spots_has_the_variance_of_a_long_one() {
        for ratio in [1.0, 1.3, 1.8, 3.0, 5.0] {
            for angle in [0.0_f64, 0.4, 1.2, 2.9] {
                let (sin, cos) = angle.sin_cos();
                let off = ratio - 1.0;
                let exact = [1.0 + off * cos * cos, off * sin * cos, 1.0 + off * sin * sin];
                let spots = RoundSpots::new(exact, 0.1);
                let found = variance_of(&spots);
                if ratio < ROUND {
                    assert!((found[0] + found[2] - exact[0] - exact[2]).abs() < 1e-6);
                    continue;
                }
                let near = found.iter().zip(exact).all(|(a, b)| (a - b).abs() < 1e-6);
                assert!(near, "{ratio} {angle}: {found:?} {exact:?} {spots:?}");
            }
        }
    }

    #[test]
    fn no_spot_is_smaller_than_a_texel_or_longer_than_its_row() {
        let small = RoundSpots::new([1e-9, 0.0, 1e-9], 0.25);
        assert_eq!((small.variance, small.taps), (0.25, 1));
        let long = RoundSpots::new([100.0, 0.0, 1e-3], 1e-6);
        assert!((long.variance - 100.0 / LONGEST).abs() < 1e-12 && long.taps == 4, "{long:?}");
    }
}
