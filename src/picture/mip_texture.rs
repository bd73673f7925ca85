//! A painting as texels at halved resolutions, so that its mean over any spot costs eight of them.
//!
//! Texels of one level are interpolated by tents: the variance of the weight of the painting around a place
//! is then a quarter of the square of a texel, the box of the texel and the tent together. A spot of a given
//! variance mixes the two levels around it so that the variances agree (Williams, SIGGRAPH 1983, chose by
//! width).

use super::exact::luminance;
use super::pattern::{Paint, PaintLine, PaintedPoint};
use super::scene::SceneLayer;
use super::seen_light::{LINE as PAINTED, SeenColor};
use super::smear::{PaintTexel, SmearedTexels, margins};
use super::tent_line::{LightView, split};
use crate::math::{SimdWidth, run_vectorized};
use rayon::prelude::*;

/// Light times cover, and cover.
pub(super) type Texel = [f32; 2];

/// The samples along a side of a texel of the finest level whose neighbours differ from it.
const SAMPLES: usize = 4;
/// The difference of two texels over their sum that is smooth enough for one sample.
const SMOOTH: f32 = 0.02;
/// The share of a level that is left out.
const LITTLE: f64 = 0.03;
/// The rows of texels that are painted together.
const ROWS: usize = 32;

/// The part of a painting that a picture sees.
#[derive(Debug, Clone)]
pub(super) struct MipTexture {
    /// The lower left corner, in the unit of the plane from the middle of the painting.
    pub(super) corner: [f64; 2],
    /// The side of a texel of the finest level.
    pub(super) texel: f64,
    /// The texels of all planes, each with its levels from the finest on.
    pub(super) texels: Vec<Texel>,
    /// The levels of a plane.
    pub(super) levels: Vec<MipLevel>,
    /// The light of all texels, and the same with the even columns of each row before its odd ones; none if
    /// something is behind the painting that its middle lets through.
    lights: [Vec<f32>; 2],
    /// The number of texels of a plane: one for each colour, or one for all if the painting is grey.
    plane: usize,
    planes: usize,
}

/// A level of a texture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct MipLevel {
    /// The index of its first texel in its plane.
    pub(super) first: usize,
    /// Columns and rows.
    pub(super) size: [usize; 2],
}

/// The texels of a level.
#[derive(Debug, Clone, Copy)]
pub(super) struct MipView<'a> {
    texels: &'a [Texel],
    width: usize,
    /// The last column and row.
    last: [f32; 2],
    /// The last column and row that have a next one, or 0.
    inner: [f32; 2],
    /// The distance of the next texel in a row and in a column; 0 if there is one only.
    next: [usize; 2],
}

/// The longest line of places.
pub(super) const LINE: usize = 64;

/// Places along a line, in texels from the middle of the first, or the light and the cover there.
pub(super) type PlaceLine = [[f32; LINE]; 2];

impl MipTexture {
    /// The painting of a layer within a rectangle, given by its lower left and its upper right corner, with
    /// texels of this size, for three colours or one; its mean over the way that it goes during an exposure.
    pub(super) fn new(
        layer: &SceneLayer,
        [corner, end]: [[f64; 2]; 2],
        (texel, way): (f64, [f64; 2]),
        colors: usize,
    ) -> Self {
        let count = |k: usize| ((end[k] - corner[k]) / texel).ceil().max(1.0) as usize;
        let levels = levels([count(0), count(1)]);
        let plane = levels.last().map_or(0, |level| level.first + level.len());
        let planes = if colors == 3 && !layer.pattern.is_grey() { 3 } else { 1 };
        let texels = vec![[0.0; 2]; plane * planes];
        let lights = [Vec::new(), Vec::new()];
        let mut texture = Self { corner, texel, texels, levels, lights, plane, planes };
        let size = texture.levels[0].size;
        let canvas = PaintedTexels { layer, corner, texel, size };
        if way == [0.0; 2] {
            texture.paint(|from| canvas.rows(from), colors);
        } else {
            let moved = canvas.smeared(way.map(|way| way / texel));
            texture.paint(|from| moved.rows(from, (ROWS.min(size[1] - from), size[0])), colors);
        }
        texture.halve();
        if layer.pattern.covers_all() {
            texture.keep_light();
        }
        texture
    }

    /// Keeps the light of all texels by itself.
    fn keep_light(&mut self) {
        self.lights[0] = self.texels.par_iter().map(|[light, _]| *light).collect();
        let part = |plane: usize, level: &MipLevel| {
            let first = plane * self.plane + level.first;
            split(&self.lights[0][first..first + level.len()], level.size[0])
        };
        let all: Vec<(usize, &MipLevel)> = (0..self.planes)
            .flat_map(|plane| self.levels.iter().map(move |l| (plane, l)))
            .collect();
        let parts: Vec<Vec<f32>> =
            all.par_iter().map(|(plane, level)| part(*plane, level)).collect();
        self.lights[1] = parts.concat();
    }

    /// The light of a level for a colour, if the painting covers all behind it.
    pub(super) fn light(&self, color: usize, level: usize) -> Option<LightView<'_>> {
        let first = self.first(color, level);
        let part = first..first + self.levels[level].len();
        let [texels, halves] = &self.lights;
        let width = self.levels[level].size[0];
        Some(LightView { texels: texels.get(part.clone())?, halves: halves.get(part)?, width })
    }

    /// Paints the finest level of every plane with what a function has for the rows from one on.
    fn paint(&mut self, rows: impl Fn(usize) -> Vec<PaintTexel> + Sync, colors: usize) {
        let (width, plane, planes) = (self.levels[0].size[0], self.plane, self.planes);
        let finest = self.levels[0].len();
        let mut parts: Vec<_> = self
            .texels
            .chunks_mut(plane)
            .map(|texels| texels[..finest].chunks_mut(ROWS * width))
            .collect();
        let bands = finest.div_ceil(ROWS * width);
        let bands: Vec<Vec<&mut [Texel]>> =
            (0..bands).map(|_| parts.iter_mut().filter_map(Iterator::next).collect()).collect();
        bands.into_par_iter().enumerate().for_each(|(band, mut parts)| {
            let painted = rows(band * ROWS);
            for (color, part) in parts.iter_mut().enumerate() {
                for (texel, [red, green, blue, cover]) in part.iter_mut().zip(&painted) {
                    let light = match (planes, colors) {
                        (3, _) => [*red, *green, *blue][color],
                        (_, 3) => *red,
                        _ => luminance([*red, *green, *blue].map(f64::from)) as f32,
                    };
                    *texel = [light, *cover];
                }
            }
        });
    }

    /// Makes the coarser levels, each from the one before it.
    fn halve(&mut self) {
        let levels = &self.levels;
        for texels in self.texels.chunks_mut(self.plane) {
            for pair in levels.windows(2) {
                let (fine, coarse) = texels.split_at_mut(pair[1].first);
                let fine = &fine[pair[0].first..];
                halve_level((fine, pair[0].size), (&mut coarse[..pair[1].len()], pair[1].size));
            }
        }
    }

    /// The plane of a colour.
    pub(super) fn plane_of(&self, color: usize) -> usize {
        color.min(self.planes - 1)
    }

    /// The index of the first texel of a level for a colour.
    pub(super) fn first(&self, color: usize, level: usize) -> usize {
        self.plane_of(color) * self.plane + self.levels[level].first
    }

    /// The texels of a level for a colour.
    pub(super) fn view(&self, color: usize, level: usize) -> MipView<'_> {
        let MipLevel { size: [width, height], .. } = self.levels[level];
        let first = self.first(color, level);
        let before = |count: usize, less: usize| count.saturating_sub(less) as f32;
        MipView {
            texels: &self.texels[first..first + width * height],
            width,
            last: [before(width, 1), before(height, 1)],
            inner: [before(width, 2), before(height, 2)],
            next: [usize::from(width > 1), if height > 1 { width } else { 0 }],
        }
    }

    /// The level whose variance is just below one, in the unit of the plane squared, and the part of the
    /// coarser level beside it that makes up for the rest.
    pub(super) fn level(&self, variance: f64) -> (usize, f64) {
        let ratio = (variance / self.finest()).max(1.0);
        let last = self.levels.len() - 1;
        // The variance of a level is four times that of the one before.
        let level = (0.5 * ratio.log2()) as usize;
        if level >= last {
            return (last, 0.0);
        }
        match ((ratio / 4_f64.powi(level as i32) - 1.0) / 3.0).clamp(0.0, 1.0) {
            coarser if coarser < LITTLE => (level, 0.0),
            coarser if coarser > 1.0 - LITTLE => (level + 1, 0.0),
            coarser => (level, coarser),
        }
    }

    /// The variance of the finest level.
    pub(super) fn finest(&self) -> f64 {
        0.25 * self.texel * self.texel
    }
}

impl MipLevel {
    fn len(&self) -> usize {
        self.size[0] * self.size[1]
    }
}

/// The levels of a plane of this size, to that of a single texel.
fn levels(finest: [usize; 2]) -> Vec<MipLevel> {
    let mut levels = vec![MipLevel { first: 0, size: finest }];
    while let Some(MipLevel { first, size }) = levels.last().copied()
        && size != [1, 1]
    {
        let first = first + size[0] * size[1];
        levels.push(MipLevel { first, size: size.map(|count| count.div_ceil(2)) });
    }
    levels
}

/// Halves the resolution of a level.
fn halve_level(
    (fine, [width, height]): (&[Texel], [usize; 2]),
    (coarse, size): (&mut [Texel], [usize; 2]),
) {
    coarse.par_chunks_mut(size[0]).enumerate().for_each(|(row, line)| {
        let lower = &fine[2 * row * width..][..width];
        let upper = &fine[(2 * row + 1).min(height - 1) * width..][..width];
        for (column, texel) in line.iter_mut().enumerate() {
            let (left, right) = (2 * column, (2 * column + 1).min(width - 1));
            for (k, value) in texel.iter_mut().enumerate() {
                *value =
                    0.25 * (lower[left][k] + lower[right][k] + upper[left][k] + upper[right][k]);
            }
        }
    });
}

/// The texels of the finest level as they are painted.
struct PaintedTexels<'a> {
    layer: &'a SceneLayer,
    corner: [f64; 2],
    texel: f64,
    size: [usize; 2],
}

impl PaintedTexels<'_> {
    /// The texels as their mean over a way in texels.
    fn smeared(&self, way: [f64; 2]) -> SmearedTexels {
        let [[left, right], [below, above]] = margins(way);
        let corner =
            [self.corner[0] - self.texel * left as f64, self.corner[1] - self.texel * below as f64];
        let size = [self.size[0] + left + right, self.size[1] + below + above];
        let wide = PaintedTexels { corner, size, ..*self };
        let starts = (0..size[1]).into_par_iter().step_by(ROWS);
        let rows: Vec<Vec<PaintTexel>> = starts.map(|from| wide.rows(from)).collect();
        SmearedTexels::new(rows.concat(), size[0], way)
    }

    /// Red, green, blue times cover, and cover, of the rows that belong together, from this one on: sampled
    /// in the middle of a texel, and at more places where its neighbours differ.
    fn rows(&self, from: usize) -> Vec<PaintTexel> {
        let [width, height] = self.size;
        let to = (from + ROWS).min(height);
        let first = from.saturating_sub(1);
        let middles: Vec<Vec<PaintTexel>> =
            (first..(to + 1).min(height)).map(|row| self.middles(row)).collect();
        let row = |row: usize| &middles[row.clamp(first, first + middles.len() - 1) - first];
        let texel = |y: usize, x: usize| {
            let here = row(y)[x];
            let beside = [
                row(y)[x.saturating_sub(1)],
                row(y)[(x + 1).min(width - 1)],
                row(y.saturating_sub(1))[x],
                row(y + 1)[x],
            ];
            let is_smooth = beside.iter().all(|other| is_close(here, *other));
            if is_smooth { here } else { self.mean([x, y]) }
        };
        (from..to).flat_map(|y| (0..width).map(move |x| (y, x))).map(|(y, x)| texel(y, x)).collect()
    }

    /// The paint in the middles of the texels of a row; many at once where the painting is grey.
    fn middles(&self, row: usize) -> Vec<PaintTexel> {
        let width = self.size[0];
        if !self.layer.pattern.is_grey() {
            return (0..width).map(|column| self.sample([column, row], [0.5; 2])).collect();
        }
        let half_size = self.layer.half_size;
        let at = |k: usize, i: usize| self.corner[k] + self.texel * (i as f64 + 0.5);
        let (seen, y) = (SeenColor { color: 0, colors: 3 }, at(1, row));
        let mut middles = Vec::with_capacity(width);
        for from in (0..width).step_by(PAINTED) {
            let count = PAINTED.min(width - from);
            let mut paint = PaintLine::new(count);
            for i in 0..count {
                let x = at(0, from + i);
                (paint.place[0][i], paint.place[1][i]) = (x, y);
                let is_inside = x.abs() <= half_size[0] && y.abs() <= half_size[1];
                paint.is_met[i] = if is_inside { 1.0 } else { 0.0 };
            }
            run_vectorized(
                SimdWidth::detect(),
                #[inline(always)]
                || self.layer.pattern.paint_line(half_size, seen, &mut paint),
            );
            middles.extend((0..count).map(|i| {
                let cover = if paint.is_met[i] > 0.0 { paint.cover[i] } else { 0.0 };
                let light = if cover > 0.0 { (paint.level[i] * cover) as f32 } else { 0.0 };
                [light, light, light, cover as f32]
            }));
        }
        middles
    }

    /// The mean over a texel.
    fn mean(&self, cell: [usize; 2]) -> PaintTexel {
        let mut sum = [0.0; 4];
        for i in 0..SAMPLES * SAMPLES {
            let part = [i % SAMPLES, i / SAMPLES].map(|k| (k as f64 + 0.5) / SAMPLES as f64);
            let paint = self.sample(cell, part);
            sum = [0, 1, 2, 3].map(|c| sum[c] + paint[c]);
        }
        sum.map(|v| v / (SAMPLES * SAMPLES) as f32)
    }

    /// The paint at a place within a texel.
    fn sample(&self, cell: [usize; 2], part: [f64; 2]) -> PaintTexel {
        let half_size = self.layer.half_size;
        let place = [0, 1].map(|k| self.corner[k] + self.texel * (cell[k] as f64 + part[k]));
        if place[0].abs() > half_size[0] || place[1].abs() > half_size[1] {
            return [0.0; 4];
        }
        let Paint { radiance: [red, green, blue], cover } =
            self.layer.pattern.paint(PaintedPoint { place, half_size });
        [red * cover, green * cover, blue * cover, cover].map(|v| v as f32)
    }
}

fn is_close(a: PaintTexel, b: PaintTexel) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= SMOOTH * (a.abs() + b.abs()))
}

/// Two to the 23rd, above which numbers are whole.
const WHOLE: f32 = 8_388_608.0;

/// A whole number at or below a positive one, or one less where that is whole itself: rounding, unlike a
/// conversion, runs through vector registers.
#[inline(always)]
fn before(place: f32) -> f32 {
    (place - 0.5).max(0.0) + WHOLE - WHOLE
}

/// A whole number from 0 to 2^23 as an integer.
#[inline(always)]
fn whole(number: f32) -> u32 {
    (number + WHOLE).to_bits().wrapping_sub(WHOLE.to_bits())
}

impl MipView<'_> {
    /// Adds a share of the light times cover and of the cover at places `scale * place + shift`,
    /// interpolated between the middles of texels.
    #[inline(always)]
    pub(super) fn add_tents(
        &self,
        places: &PlaceLine,
        (scale, shift): (f32, [f32; 2]),
        (share, count): (f32, usize),
        sums: &mut PlaceLine,
    ) {
        let (mut firsts, mut across, mut along) = ([0_u32; LINE], [0.0; LINE], [0.0; LINE]);
        let (width, last, inner) = (self.width as u32, self.last, self.inner);
        for i in 0..count {
            let u = (scale * places[0][i] + shift[0]).max(0.0).min(last[0]);
            let v = (scale * places[1][i] + shift[1]).max(0.0).min(last[1]);
            let (column, row) = (before(u).min(inner[0]), before(v).min(inner[1]));
            across[i] = u - column;
            along[i] = v - row;
            firsts[i] = whole(row).wrapping_mul(width).wrapping_add(whole(column));
        }
        let mut mixed = [[0.0; 4]; LINE];
        for i in 0..count {
            let (lower, t) = (firsts[i] as usize, along[i]);
            let (lower, upper) = (self.pair(lower), self.pair(lower + self.next[1]));
            for k in 0..4 {
                mixed[i][k] = lower[k] + t * (upper[k] - lower[k]);
            }
        }
        let [lights, covers] = sums;
        for i in 0..count {
            let ([a, p, b, q], s) = (mixed[i], across[i]);
            lights[i] += share * (a + s * (b - a));
            covers[i] += share * (p + s * (q - p));
        }
    }

    /// A texel and the next one in its row: four numbers beside each other, which are mixed by one vector
    /// instruction.
    #[inline(always)]
    fn pair(&self, first: usize) -> [f32; 4] {
        let [a, p] = self.texels[first];
        let [b, q] = self.texels[first + self.next[0]];
        [a, p, b, q]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::Pattern;

    fn texture(pattern: Pattern) -> MipTexture {
        let half_size = [64.0; 2];
        let layer =
            SceneLayer { distance: None, center: [0.0; 2], half_size, velocity: [0.0; 2], pattern };
        MipTexture::new(&layer, [[-64.0; 2], [64.0; 2]], (1.0, [0.0; 2]), 3)
    }

    fn wave(frequency: f64) -> MipTexture {
        texture(Pattern::Wave { contrast: 0.5, frequency: [frequency, 0.0], phase: 0.3 })
    }

    /// The mean over a spot about a place.
    fn mean(texture: &MipTexture, place: [f64; 2], variance: f64, color: usize) -> [f64; 2] {
        let (level, coarser) = texture.level(variance);
        let at = |level: usize| {
            let side = texture.texel * 2_f64.powi(level as i32);
            let at = [0, 1].map(|k| ((place[k] - texture.corner[k]) / side - 0.5) as f32);
            tent(texture.view(color, level), at).map(f64::from)
        };
        let (fine, coarse) = (at(level), at((level + 1).min(texture.levels.len() - 1)));
        [0, 1].map(|k| fine[k] + coarser * (coarse[k] - fine[k]))
    }

    /// Light and cover at one place.
    fn tent(view: MipView<'_>, at: [f32; 2]) -> [f32; 2] {
        let mut sums = [[0.0; LINE]; 2];
        view.add_tents(&at.map(|v| [v; LINE]), (1.0, [0.0; 2]), (1.0, 1), &mut sums);
        sums.map(|values| values[0])
    }

    #[test]
    fn a_spot_takes_contrast_as_its_variance_says() {
        let texture = wave(0.02);
        for variance in [0.25, 1.0, 4.0, 7.0] {
            let damping = (-0.5 * (std::f64::consts::TAU * 0.02_f64).powi(2) * variance).exp();
            for x in [-7.3, 0.0, 11.1] {
                let exact = 1.0 + 0.5 * damping * (std::f64::consts::TAU * 0.02 * x + 0.3).cos();
                let [found, cover] = mean(&texture, [x, 3.0], variance, 1);
                assert!((found - exact).abs() < 0.01, "{variance} {x}: {found} {exact}");
                assert!((cover - 1.0).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn the_largest_spot_has_the_mean_of_all() {
        let [found, cover] = mean(&wave(0.25), [0.0, 0.0], 1e9, 0);
        assert!((found - 1.0).abs() < 1e-3 && cover == 1.0, "{found}");
    }

    /// A texel that an edge crosses has the mean of both sides; one grey plane serves all colours.
    #[test]
    fn edges_are_sampled_finely_and_grey_is_kept_once() {
        let edge = texture(Pattern::SlantedEdge);
        assert_eq!([0, 1, 2].map(|color| edge.plane_of(color)), [0; 3]);
        // Half a unit above the axis, the edge lies a share of 0.0437 of a texel to the right of it.
        let [light, _] = tent(edge.view(0, 0), [64.0, 64.0]);
        assert!((light - (0.8 - 0.6 * 0.0437)).abs() < 0.1, "{light}");
        let orange = texture(Pattern::Uniform { radiance: [1.0, 0.5, 0.0], cover: 0.5 });
        let seen = [0, 1, 2].map(|color| tent(orange.view(color, 0), [9.0, 9.0]));
        assert_eq!(seen, [[0.5, 0.5], [0.25, 0.5], [0.0, 0.5]]);
    }

    /// A line whose places advance by nearly two texels, one, a half or a quarter has the same light as its
    /// single places, and one that advances otherwise, or leaves the painting, is refused.
    #[test]
    fn a_line_of_neighbouring_texels_has_the_light_of_its_places() {
        let texture = wave(0.07);
        let (view, light) = (texture.view(1, 0), texture.light(1, 0).unwrap());
        for (advance, count) in
            [(1.93, 29), (1.0, 64), (1.04, 37), (0.97, 11), (0.52, 64), (0.26, 50)]
        {
            let line = [[11.3, advance, 1e-4], [40.2, -0.013, 2e-4]];
            let mut places = [[0.0; LINE]; 2];
            for (i, k) in (0..count).flat_map(|i| [(i, 0), (i, 1)]) {
                let [a, b, c] = line[k];
                places[k][i] = (a + i as f64 * (b + i as f64 * c)) as f32;
            }
            let (mut exact, mut found) = ([[0.0; LINE]; 2], [0.0; LINE]);
            view.add_tents(&places, (1.0, [0.0; 2]), (0.7, count), &mut exact);
            assert!(light.add_tents(line, (0.7, count), &mut found), "{advance}");
            let pairs = exact[0].iter().zip(&found).take(count);
            let off = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(off < 2e-5, "{advance} {count}: {off}");
        }
        let mut sums = [0.0; LINE];
        for line in [[9.0, 5.0, 0.0], [9.0, -1.0, 0.0], [100.0, 1.0, 0.0], [-0.5, 1.0, 0.0]] {
            assert!(!light.add_tents([line, [40.0, 0.0, 0.0]], (1.0, 40), &mut sums), "{line:?}");
        }
        let orange = texture_of_cover(0.5);
        assert!(orange.light(0, 0).is_none(), "what is behind it can be seen");
    }

    fn texture_of_cover(cover: f64) -> MipTexture {
        texture(Pattern::Uniform { radiance: [1.0; 3], cover })
    }
}
