//! The tables of a picture packed into words for a device.

use super::blocks::PictureBlock;
use super::plan::{BeamLook, BlockBeam, BlockPlan, PlanSource};
use super::sums::lattice_size;
use crate::picture::device::PackedPicture;

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
        let before = (packed.looks.len() / 24) as u32;
        for beam in &plan.beams {
            packed.beams.extend(beam.weight.map(f32::to_bits));
            packed.beams.extend(beam.looks.map(|look| before + look as u32));
            for look in &plan.looks[beam.looks[0]..beam.looks[1]] {
                packed.looks.extend(self.look_words(beam, look, offsets[look.plane]));
            }
        }
    }

    fn look_words(&self, beam: &BlockBeam, look: &BeamLook, offset: usize) -> [u32; 24] {
        let texture = &self.planes[look.plane].texture;
        let level = |level: usize| {
            let [width, height] = texture.levels[level].size.map(|v| v as u32);
            [(offset + texture.first(beam.color, level)) as u32, width, height]
        };
        let coarse = (look.level + 1).min(texture.levels.len() - 1);
        let mut words = [0; 24];
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
