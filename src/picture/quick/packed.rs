//! The tables of a picture packed into words for a device.

use super::blocks::PictureBlock;
use super::plan::{BeamLook, BlockBeam, BlockPlan, PlanSource};
use super::sums::lattice_size;
use crate::picture::device::PackedPicture;

/// The words of a view of a painting.
const LOOK_WORDS: usize = 24;

impl PlanSource<'_> {
    /// All that a device needs for a picture of these blocks with their plans, whose groups work on so many points.
    pub(super) fn pack(
        &self,
        (blocks, plans): (&[PictureBlock], &[BlockPlan]),
        background: [f64; 3],
        group: usize,
    ) -> PackedPicture<'_> {
        let mut packed = PackedPicture {
            pixels: self.frame.pixels,
            texels: self.planes.iter().map(|plane| &plane.texture.texels[..]).collect(),
            beams: Vec::new(),
            looks: Vec::new(),
            lattices: Vec::new(),
            values: 0,
            blocks: Vec::new(),
            lattice_shares: Vec::new(),
            block_shares: Vec::new(),
        };
        let offsets = self.texel_offsets();
        for (i, (block, plan)) in blocks.iter().zip(plans).enumerate() {
            let first = packed.lattices.len() / 10;
            self.pack_beams(plan, &offsets, &mut packed);
            let before = (packed.beams.len() / 8 - plan.beams.len()) as u32;
            pack_lattices(block, plan, (before, background, group), &mut packed);
            let [left, top] = block.at.map(|v| v as u32);
            let [width, height] = block.size.map(|v| v as u32);
            let last = packed.lattices.len() / 10;
            packed.blocks.extend([left, top, width, height, first as u32, last as u32]);
            let open =
                |color: usize| plan.sideways.get(color).map_or(0.0, |v| v * background[color]);
            packed.blocks.extend([0, 1, 2].map(|color| (open(color) as f32).to_bits()));
            share(block.size[0] * block.size[1], i, group, &mut packed.block_shares);
        }
        packed
    }

    /// The indices of the first texels of the paintings.
    fn texel_offsets(&self) -> Vec<usize> {
        let sum = |sum: &mut usize, count: usize| {
            let before = *sum;
            *sum += count;
            Some(before)
        };
        self.planes.iter().map(|plane| plane.texture.texels.len()).scan(0, sum).collect()
    }

    fn pack_beams(&self, plan: &BlockPlan, offsets: &[usize], packed: &mut PackedPicture<'_>) {
        // Views are packed in the order of beams, which is not that of the plan: beams are sorted by their steps.
        let count = |packed: &PackedPicture<'_>| (packed.looks.len() / LOOK_WORDS) as u32;
        for beam in &plan.beams {
            let first = count(packed);
            for look in &plan.looks[beam.looks[0]..beam.looks[1]] {
                packed.looks.extend(self.look_words(beam, look, offsets[look.plane]));
            }
            packed.beams.extend(beam.weight.map(f32::to_bits));
            packed.beams.extend([first, count(packed)]);
        }
    }

    fn look_words(&self, beam: &BlockBeam, look: &BeamLook, offset: usize) -> [u32; LOOK_WORDS] {
        let texture = &self.planes[look.plane].texture;
        let level = |level: usize| {
            let [width, height] = texture.levels[level].size.map(|v| v as u32);
            [(offset + texture.first(beam.color, level)) as u32, width, height]
        };
        let coarse = (look.level + 1).min(texture.levels.len() - 1);
        let mut words = [0; LOOK_WORDS];
        let numbers = look.place.iter().flatten().chain(&look.tap).chain([&look.coarser]);
        words.iter_mut().zip(numbers).for_each(|(word, v)| *word = v.to_bits());
        words[15] = look.taps as u32;
        words[16..19].copy_from_slice(&level(look.level));
        words[19..22].copy_from_slice(&level(coarse));
        words
    }
}

/// Packs the lattices of a block, whose beams come after `before` others.
fn pack_lattices(
    block: &PictureBlock,
    plan: &BlockPlan,
    (before, background, group): (u32, [f64; 3], usize),
    packed: &mut PackedPicture<'_>,
) {
    let same = |a: &BlockBeam, b: &BlockBeam| (a.color, a.step) == (b.color, b.step);
    let mut beam = before;
    for beams in plan.beams.chunk_by(same) {
        let BlockBeam { color, step, .. } = beams[0];
        let [columns, rows] = lattice_size(block, step);
        let next = beam + beams.len() as u32;
        let [width, height] = block.size.map(|v| v as u32);
        let index = packed.lattices.len() / 10;
        packed.lattices.extend([beam, next, packed.values as u32, columns as u32, rows as u32]);
        let behind = (background[color] as f32).to_bits();
        packed.lattices.extend([step as u32, width, height, color as u32, behind]);
        share(columns * rows, index, group, &mut packed.lattice_shares);
        packed.values += columns * rows;
        beam = next;
    }
}

/// Divides points among groups.
fn share(points: usize, owner: usize, group: usize, shares: &mut Vec<u32>) {
    for first in (0..points).step_by(group) {
        shares.extend([owner as u32, first as u32]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files;
    use crate::picture::quick::blocks::blocks;
    use crate::picture::{
        BuiltInScene, Coloring, ExactRenderer, ImageFrame, QuickRenderer, field_diagonal,
        picture_model,
    };

    /// The beams of a plan are sorted by the spacing of their lattices, their views are in the order of windows.
    #[test]
    fn a_beam_keeps_its_own_views_in_any_order_of_beams() {
        let bundled = files::bundled_lenses().iter().find(|lens| lens.name == "achromat_ac254_100");
        let bundled = bundled.unwrap();
        let lens = files::parse(bundled.text.as_bytes(), bundled.name).unwrap().lens;
        let (model, bands) = picture_model(&lens, 0, Coloring::Rgb(1)).unwrap();
        let frame = ImageFrame::new(&model, [64, 48], field_diagonal(&model).unwrap()).unwrap();
        let scene = BuiltInScene::Star.build(&model, &frame, None).unwrap();
        let exact = ExactRenderer::new(&model, &bands, &scene, frame).unwrap();
        let renderer = QuickRenderer::new(&model, &bands, &exact).unwrap();
        let (source, all) = (renderer.source(&renderer.levels[0]), blocks(&frame));
        let mut plan = source.plan(&all[0], usize::MAX);
        plan.beams.reverse();
        assert!(plan.beams.len() > 2 && plan.beams[0].looks[0] > 0);
        let plans = [plan];
        let packed = source.pack((&all[..1], &plans), [0.0; 3], 64);
        for (beam, words) in plans[0].beams.iter().zip(packed.beams.chunks_exact(8)) {
            let looks = &plans[0].looks[beam.looks[0]..beam.looks[1]];
            let own: Vec<u32> =
                looks.iter().flat_map(|look| source.look_words(beam, look, 0)).collect();
            let [first, end] = [words[6], words[7]].map(|look| LOOK_WORDS * look as usize);
            assert_eq!(packed.looks[first..end], own);
        }
    }
}
