//! The light of a block on the processor, in 32 bits: the specification of the shader that does the same.

use super::blocks::{PictureBlock, Quadratic};
use super::plan::{BeamLook, BlockBeam, BlockPlan, PlanSource};
use crate::math::{SimdWidth, run_vectorized};
use crate::picture::mip_texture::{LINE, MipView, PlaceLine};
use crate::picture::tent_line::{LightView, LinePlace};

/// The distance of probed pixels, and the first of them, which need not lie in a small block.
const PROBE: usize = 5;
const FIRST_PROBE: f32 = 2.0;

/// The offsets of a number of taps in their distance, and their shares.
pub(super) const fn taps(count: usize) -> &'static [(f32, f32)] {
    match count {
        1 => &[(0.0, 1.0)],
        2 => &[(-0.5, 0.5), (0.5, 0.5)],
        3 => &[(-1.0, 0.25), (0.0, 0.5), (1.0, 0.25)],
        _ => &[(-1.5, 0.125), (-0.5, 0.375), (0.5, 0.375), (1.5, 0.125)],
    }
}

/// The points of a lattice along the sides of a block: at its pixels, or one step before it and as far
/// behind it as splines reach.
pub(super) fn lattice_size(block: &PictureBlock, step: usize) -> [usize; 2] {
    block.size.map(|side| if step == 1 { side } else { (side - 1) / step + 4 })
}

/// The place of a pixel in a block, -1 to 1 over its pixels.
fn relative(pixel: f32, side: usize) -> f32 {
    let middle = 0.5 * (side as f32 - 1.0);
    (pixel - middle) / middle.max(0.5)
}

/// The first point of a lattice, in pixels.
fn first_point(step: usize) -> f32 {
    if step == 1 { 0.0 } else { -(step as f32) }
}

/// A lattice of one colour and spacing that is summed up.
struct Lattice<'a> {
    block: &'a PictureBlock,
    /// The first point and the distance of points along a row, in pixels.
    first: f32,
    step: usize,
    /// The rows, in pixels.
    rows: Vec<f32>,
    columns: usize,
    values: Vec<f32>,
}

/// The levels of a painting that a beam looks at: the finer and the coarser one.
struct LookViews<'a> {
    texels: [MipView<'a>; 2],
    /// The light alone, if it covers all that the beam sees.
    light: Option<[LightView<'a>; 2]>,
}

/// The colours of the pixels of a block, row by row. `background` is the radiance behind the paintings in
/// every colour.
pub(super) fn block_light(
    source: &PlanSource<'_>,
    block: &PictureBlock,
    plan: &BlockPlan,
    background: [f64; 3],
) -> Vec<[f32; 3]> {
    let mut light = vec![[0.0; 3]; block.size[0] * block.size[1]];
    for (color, sideways) in plan.sideways.iter().enumerate() {
        let open = (sideways * background[color]) as f32;
        light.iter_mut().for_each(|pixel| pixel[color] = open);
    }
    let same = |a: &BlockBeam, b: &BlockBeam| (a.color, a.step) == (b.color, b.step);
    for beams in plan.beams.chunk_by(same) {
        let BlockBeam { color, step, .. } = beams[0];
        let mut lattice = Lattice::new(block, step);
        for beam in beams {
            let looks = &plan.looks[beam.looks[0]..beam.looks[1]];
            lattice.add(source, beam, looks, background[color] as f32);
        }
        lattice.spread(color, &mut light);
    }
    light
}

/// The rows of a block that are probed.
pub(super) fn probed_rows(block: &PictureBlock) -> Vec<f32> {
    (0..block.size[1].div_ceil(PROBE)).map(|i| FIRST_PROBE + (PROBE * i) as f32).collect()
}

/// The colours of a few pixels in some rows of a block, whose beams are planned for single pixels.
pub(super) fn probed_light(
    source: &PlanSource<'_>,
    (block, rows): (&PictureBlock, &[f32]),
    plan: &BlockPlan,
    background: [f64; 3],
) -> Vec<[f32; 3]> {
    let columns = block.size[0].div_ceil(PROBE);
    let mut light = vec![[0.0; 3]; columns * rows.len()];
    for (color, background) in background.iter().enumerate().take(source.colors) {
        let (values, rows) = (vec![0.0; light.len()], rows.to_vec());
        let first = FIRST_PROBE;
        let mut lattice = Lattice { block, first, step: PROBE, rows, columns, values };
        for beam in plan.beams.iter().filter(|beam| beam.color == color) {
            let looks = &plan.looks[beam.looks[0]..beam.looks[1]];
            lattice.add(source, beam, looks, *background as f32);
        }
        light.iter_mut().zip(&lattice.values).for_each(|(pixel, value)| pixel[color] = *value);
    }
    light
}

impl<'a> Lattice<'a> {
    /// The lattice of a block, without light.
    fn new(block: &'a PictureBlock, step: usize) -> Self {
        let ([columns, rows], first) = (lattice_size(block, step), first_point(step));
        let values = vec![0.0; columns * rows];
        let rows = (0..rows).map(|row| first + (step * row) as f32).collect();
        Self { block, first, step, rows, columns, values }
    }

    /// Adds the light of a beam.
    fn add(
        &mut self,
        source: &PlanSource<'_>,
        beam: &BlockBeam,
        looks: &[BeamLook],
        background: f32,
    ) {
        let views: Vec<LookViews<'_>> = looks
            .iter()
            .map(|look| {
                let texture = &source.planes[look.plane].texture;
                let levels = [look.level, (look.level + 1).min(texture.levels.len() - 1)];
                let light = |level: usize| texture.light(beam.color, level);
                let [fine, coarse] = levels.map(light);
                LookViews {
                    texels: levels.map(|level| texture.view(beam.color, level)),
                    light: fine.zip(coarse).filter(|_| look.is_covered).map(|(a, b)| [a, b]),
                }
            })
            .collect();
        run_vectorized(
            SimdWidth::Bits512,
            #[inline(always)]
            || self.add_views(beam, (looks, &views), background),
        );
    }

    #[inline(always)]
    fn add_views(
        &mut self,
        beam: &BlockBeam,
        (looks, views): (&[BeamLook], &[LookViews<'_>]),
        background: f32,
    ) {
        let columns = self.columns;
        let middle = 0.5 * (self.block.size[0] as f64 - 1.0);
        let advance = self.step as f64 / middle.max(0.5);
        let first = f64::from(relative(self.first, self.block.size[0]));
        let mut across = [0.0; LINE];
        for (i, place) in across[..columns].iter_mut().enumerate() {
            *place = relative(self.first + (self.step * i) as f32, self.block.size[0]);
        }
        let mut weight = [0.0; LINE];
        for (row, line) in self.rows.iter().zip(self.values.chunks_mut(columns)) {
            let along = relative(*row, self.block.size[1]);
            let (mut light, mut open) = ([0.0; LINE], [1.0; LINE]);
            for (look, views) in looks.iter().zip(views) {
                let mut seen = [[0.0; LINE]; 2];
                let line = (&across[..columns], (first, advance), along);
                add_look(look, views, line, &mut seen);
                for i in 0..columns {
                    light[i] += open[i] * seen[0][i];
                    open[i] *= 1.0 - seen[1][i];
                }
            }
            on_line(&beam.weight, (&across[..columns], along), &mut weight);
            for i in 0..columns {
                line[i] += weight[i].max(0.0) * (light[i] + open[i] * background);
            }
        }
    }

    /// Adds the lattice to the pixels of its block.
    fn spread(&self, color: usize, light: &mut [[f32; 3]]) {
        let ([width, height], columns, rows) = (self.block.size, self.columns, self.rows.len());
        if self.step == 1 {
            light.iter_mut().zip(&self.values).for_each(|(pixel, value)| pixel[color] += value);
            return;
        }
        let shares: Vec<[f32; 4]> =
            (0..self.step).map(|i| spline(i as f32 / self.step as f32)).collect();
        let mut wide = vec![0.0; width * rows];
        for (line, wide) in self.values.chunks(columns).zip(wide.chunks_mut(width)) {
            for (x, value) in wide.iter_mut().enumerate() {
                let (first, share) = (x / self.step, &shares[x % self.step]);
                *value = share[0] * line[first]
                    + share[1] * line[first + 1]
                    + share[2] * line[first + 2]
                    + share[3] * line[first + 3];
            }
        }
        for y in 0..height {
            let (first, share) = (y / self.step, &shares[y % self.step]);
            let lines: [&[f32]; 4] = std::array::from_fn(|k| &wide[(first + k) * width..][..width]);
            for (x, pixel) in light[y * width..][..width].iter_mut().enumerate() {
                pixel[color] += share[0] * lines[0][x]
                    + share[1] * lines[1][x]
                    + share[2] * lines[2][x]
                    + share[3] * lines[3][x];
            }
        }
    }
}

/// A quadratic at the places of a line of a lattice.
#[inline(always)]
fn on_line(q: &Quadratic<f32>, (across, t): (&[f32], f32), values: &mut [f32; LINE]) {
    let (a, b, c) = (q[0] + t * (q[2] + t * q[5]), q[1] + t * q[4], q[3]);
    for (value, s) in values.iter_mut().zip(across) {
        *value = a + s * (b + s * c);
    }
}

/// Adds the mean light and cover that a beam sees along a line of a lattice: its points across the block, the
/// first of them and their distance once more, and its place along the block.
#[inline(always)]
fn add_look(
    look: &BeamLook,
    views: &LookViews<'_>,
    (across, at, along): (&[f32], (f64, f64), f32),
    seen: &mut PlaceLine,
) {
    let columns = across.len();
    let line = [line_place(&look.place[0], at, along), line_place(&look.place[1], at, along)];
    if let Some(light_views) = &views.light {
        if add_covered(look, light_views, (line, columns), &mut seen[0]) {
            seen[1] = [1.0; LINE];
            return;
        }
        seen[0] = [0.0; LINE];
    }
    let mut places = [[0.0; LINE]; 2];
    on_line(&look.place[0], (across, along), &mut places[0]);
    on_line(&look.place[1], (across, along), &mut places[1]);
    add_seen(look, &views.texels, (&places, columns), seen);
}

/// A quadratic along a line of a lattice, whose first point and whose distance of points are given in the block.
#[inline(always)]
fn line_place(q: &Quadratic<f32>, (first, advance): (f64, f64), t: f32) -> LinePlace {
    let (a, b, c) = (q[0] + t * (q[2] + t * q[5]), q[1] + t * q[4], q[3]);
    let [a, b, c] = [f64::from(a), f64::from(b), f64::from(c)];
    [a + first * (b + first * c), advance * (b + 2.0 * first * c), advance * advance * c]
}

/// Adds the mean light that a beam sees of a painting that covers all, along a line; false if that cannot be
/// done, and something else may then have been added.
#[inline(always)]
fn add_covered(
    look: &BeamLook,
    [fine, coarse]: &[LightView<'_>; 2],
    (places, count): ([LinePlace; 2], usize),
    seen: &mut [f32; LINE],
) -> bool {
    for (offset, share) in taps(look.taps) {
        let [across, along] = look.tap;
        let shift = [offset * across, offset * along];
        let shares = [share * (1.0 - look.coarser), share * look.coarser];
        if !fine.add_tents(moved(&places, 1.0, shift), (shares[0], count), seen) {
            return false;
        }
        // The first texel of the coarser level has its middle a quarter of its side farther in.
        let shift = [0.5 * shift[0] - 0.25, 0.5 * shift[1] - 0.25];
        let is_mixed = look.coarser > 0.0;
        if is_mixed && !coarse.add_tents(moved(&places, 0.5, shift), (shares[1], count), seen) {
            return false;
        }
    }
    true
}

/// Places scaled and shifted.
#[inline(always)]
fn moved(places: &[LinePlace; 2], scale: f64, shift: [f32; 2]) -> [LinePlace; 2] {
    let [[a, b, c], [d, e, f]] = *places;
    let [across, along] = [f64::from(shift[0]), f64::from(shift[1])];
    [[scale * a + across, scale * b, scale * c], [scale * d + along, scale * e, scale * f]]
}

/// Adds the mean light and cover that a beam sees of a painting at some places.
#[inline(always)]
fn add_seen(
    look: &BeamLook,
    [fine, coarse]: &[MipView<'_>; 2],
    (places, count): (&PlaceLine, usize),
    seen: &mut PlaceLine,
) {
    let [across, along] = look.tap;
    for (offset, share) in taps(look.taps) {
        let shift = [offset * across, offset * along];
        let shares = [share * (1.0 - look.coarser), share * look.coarser];
        fine.add_tents(places, (1.0, shift), (shares[0], count), seen);
        if look.coarser > 0.0 {
            // The first texel of the coarser level has its middle a quarter of its side farther in.
            let shift = [0.5 * shift[0] - 0.25, 0.5 * shift[1] - 0.25];
            coarse.add_tents(places, (0.5, shift), (shares[1], count), seen);
        }
    }
}

/// The shares of four points of a lattice at a place between the two in the middle (cubic B-splines).
fn spline(f: f32) -> [f32; 4] {
    let g = 1.0 - f;
    let inner = |f: f32| 4.0 - 6.0 * f * f + 3.0 * f * f * f;
    [g * g * g, inner(f), inner(g), f * f * f].map(|v| v / 6.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splines_add_up_to_one_and_keep_straight_lines() {
        for f in [0.0, 0.25, 0.6] {
            let shares = spline(f);
            let place: f32 = shares.iter().enumerate().map(|(i, v)| v * (i as f32 - 1.0)).sum();
            assert!((shares.iter().sum::<f32>() - 1.0).abs() < 1e-6 && (place - f).abs() < 1e-6);
        }
    }

    /// A lattice of a straight slope gives its pixels that slope.
    #[test]
    fn a_lattice_reaches_every_pixel_of_its_block() {
        let block = PictureBlock { at: [0, 0], size: [23, 17], is_central: false };
        for step in [1, 2, 4] {
            let mut lattice = Lattice::new(&block, step);
            let at =
                |i: usize, k: usize| relative(lattice.first + (step * i) as f32, block.size[k]);
            let value = |i: usize| 2.0 * at(i % lattice.columns, 0) - at(i / lattice.columns, 1);
            lattice.values = (0..lattice.values.len()).map(value).collect();
            let mut light = vec![[0.0; 3]; 23 * 17];
            lattice.spread(1, &mut light);
            for (i, pixel) in light.iter().enumerate() {
                let [x, y] = [(i % 23) as f32, (i / 23) as f32];
                let exact = 2.0 * relative(x, 23) - relative(y, 17);
                assert!((pixel[1] - exact).abs() < 1e-5, "{step} {i}: {pixel:?} {exact}");
            }
        }
    }
}
