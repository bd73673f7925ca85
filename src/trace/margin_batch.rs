//! Margins of many rays at one limit, in blocks.
//!
//! The search for the edge of a pupil asks for a few dozen rays at a time. In small blocks these take
//! the vector instructions that trace a bundle; every number has the same bits as that of a single
//! ray. The margins at a rim or an obstruction follow from the point alone; those at other limits, all
//! in GRIN media, on freeforms and ideal surfaces, and those over dual numbers of surfaces that are not centred,
//! are computed ray by ray.

use super::aperture::ApertureSet;
use super::batch::{RayBlock, Rays, SMALL_BLOCK};
use super::interface::{Interface, Intersection};
use super::margin::RayLimit;
use super::mount::Mount;
use super::{AdjointSeed, SystemGradient, Tracer};
use crate::math::{Real, SimdWidth, Vec3, run_vectorized};

impl<R: Real> Tracer<R> {
    /// The margin of every ray at one limit, as by [`Tracer::margin`]; NaN for a ray that does not
    /// get there.
    pub fn margins_at(&self, rays: &Rays<R>, surface: usize, limit: RayLimit) -> Vec<R> {
        if !self.has_block_margin(limit) {
            let margin = |i| self.margin(rays.get(i), surface, limit);
            return (0..rays.len()).map(|i| margin(i).unwrap_or(R::from_f64(f64::NAN))).collect();
        }
        let last = &self.interfaces[surface];
        let apertures = self.apertures.of(surface);
        let mut margins = Vec::with_capacity(rays.len());
        self.cross_unclipped(
            rays,
            surface,
            #[inline(always)]
            |block, count| {
                let lost = block.code;
                let mut lanes = [R::ZERO; SMALL_BLOCK];
                self.cross_one_open(
                    block,
                    surface,
                    #[inline(always)]
                    |j, met| lanes[j] = last.plain_margin(limit, met.point, apertures),
                );
                let nan = R::from_f64(f64::NAN);
                margins.extend((0..count).map(|j| R::select(lost[j] > R::ZERO, nan, lanes[j])));
            },
        );
        margins
    }

    /// The landing of every ray on the edge, as by [`Tracer::land_at_edge`]; NaN for a ray that does
    /// not arrive.
    pub fn landings_at_edge(&self, rays: &Rays<R>, surface: usize, limit: RayLimit) -> Vec<[R; 2]> {
        let nan = [R::from_f64(f64::NAN); 2];
        if !self.has_block_margin(limit) {
            let landing = |i| self.land_at_edge(rays.get(i), surface, limit);
            return (0..rays.len()).map(|i| landing(i).map_or(nan, |p| [p.x, p.y])).collect();
        }
        let mut landings = Vec::with_capacity(rays.len());
        self.cross_unclipped(rays, self.surfaces(), |block, count| {
            let lost = |j: usize| block.code[j] > R::ZERO;
            let landing = |j: usize| if lost(j) { nan } else { [block.x[j], block.y[j]] };
            landings.extend((0..count).map(landing));
        });
        landings
    }

    /// True if the margin at a limit follows from the point on the surface alone, and all surfaces are such as
    /// blocks of rays cross between homogeneous media.
    fn has_block_margin(&self, limit: RayLimit) -> bool {
        let is_block_surface = |i: usize| !self.is_general(i) || self.vector_mount(i).is_some();
        limit.is_edge_of_aperture() && (0..self.surfaces()).all(is_block_surface)
    }

    /// Traces rays to behind the first `count` surfaces, whose rims and obstructions clip nothing, and
    /// hands over block after block with the number of its rays.
    fn cross_unclipped(
        &self,
        rays: &Rays<R>,
        surfaces: usize,
        mut visit: impl FnMut(&mut RayBlock<R, SMALL_BLOCK>, usize),
    ) {
        run_vectorized(
            SimdWidth::detect(),
            #[inline(always)]
            || {
                let mut block: RayBlock<R, SMALL_BLOCK> = RayBlock::new();
                for from in (0..rays.len()).step_by(SMALL_BLOCK) {
                    let count = SMALL_BLOCK.min(rays.len() - from);
                    block.load(rays.slice(from, from + count), 0, count, self.index_before);
                    self.mask(&mut block, count);
                    self.cross_open(&mut block, surfaces);
                    visit(&mut block, count);
                }
            },
        );
    }

    /// Takes a block across the first surfaces, without their rims and obstructions.
    #[inline(always)]
    fn cross_open(&self, block: &mut RayBlock<R, SMALL_BLOCK>, surfaces: usize) {
        for i in 0..surfaces {
            self.cross_one_open(block, i, |_, _| {});
        }
    }

    /// Takes a block across a surface without its rim and obstruction, and hands over where its rays meet it.
    #[inline(always)]
    fn cross_one_open(
        &self,
        block: &mut RayBlock<R, SMALL_BLOCK>,
        surface: usize,
        keep: impl FnMut(usize, &Intersection<R>),
    ) {
        let (interface, number) = (&self.interfaces[surface], surface as u32);
        match self.vector_mount(surface) {
            Some(mount) => block.cross_mounted_open(interface, number, mount, keep),
            None => block.cross_with(&interface.open(), number, keep),
        }
    }
}

impl<R: Real> RayBlock<R, SMALL_BLOCK> {
    /// Crosses a surface that is decentred, tilted or irregular, without what clips there. Never part of the
    /// loop over centred surfaces, whose registers it would occupy.
    #[inline(never)]
    fn cross_mounted_open(
        &mut self,
        interface: &Interface<R>,
        number: u32,
        mount: &Mount<R>,
        keep: impl FnMut(usize, &Intersection<R>),
    ) {
        run_vectorized(
            SimdWidth::detect(),
            #[inline(always)]
            || self.cross_mounted(&interface.open(), number, (mount, None), keep),
        );
    }
}

impl Tracer<f64> {
    /// As [`Tracer::margin_gradient`] at a rim, an obstruction or another aperture: the adjoint of the point on that
    /// surface, where the bundle ends.
    pub(super) fn plain_margin_gradient(
        &self,
        surface: usize,
        limit: RayLimit,
        rays: &Rays<f64>,
        weights: &[f64],
    ) -> Option<SystemGradient<f64>> {
        if !self.is_plain() || !limit.is_edge_of_aperture() {
            return None;
        }
        let outwards = if limit == RayLimit::Rim { -2.0 } else { 2.0 };
        let front = self.ending_at(surface);
        let side = match limit {
            RayLimit::Aperture(side) | RayLimit::Obscuration(side) => {
                self.apertures.of(surface).map(|set| (set, side))
            }
            _ => None,
        };
        let mut total = SystemGradient::zero(self.surfaces());
        let mut seeds = Vec::with_capacity(rays.len());
        let mut arrived = 0.0;
        front.cross_unclipped(rays, surface + 1, |block, count| {
            for j in 0..count {
                let weight = weights[seeds.len()];
                let weight = if block.code[j] > 0.0 { 0.0 } else { weight };
                let factor = outwards * weight;
                let mut point = Vec3::new(factor * block.x[j], factor * block.y[j], 0.0);
                if let Some((set, side)) = side {
                    let at = block.state(j).0;
                    let [x, y] = set.by_point(side, at);
                    point = Vec3::new(weight * x, weight * y, 0.0);
                    set.add_slopes(side, at, weight, &mut total.surfaces[surface]);
                }
                seeds.push(AdjointSeed { point, ..AdjointSeed::default() });
                arrived += weight;
            }
        });
        total.add(&front.gradient(rays, |i| seeds[i]), 1.0);
        if limit == RayLimit::Rim {
            let radius = self.interfaces[surface].rim2.sqrt();
            total.surfaces[surface].semi_diameter += 2.0 * radius * arrived;
        }
        Some(total)
    }

    /// The surfaces up to one that refracts nothing, without anything that clips.
    fn ending_at(&self, surface: usize) -> Self {
        let mut front = self.surfaces_before(surface + 1);
        if let Some(last) = front.interfaces.last_mut() {
            (last.index_behind, last.dn2) = (last.index_before, 0.0);
        }
        front
    }
}

impl<R: Real> Interface<R> {
    /// The same surface without a rim and an obstruction.
    #[inline(always)]
    fn open(&self) -> Self {
        Self { rim2: R::from_f64(f64::INFINITY), obstruction2: R::ZERO, ..*self }
    }

    /// The margin at the rim, the obstruction or an aperture for a point of the surface.
    #[inline(always)]
    fn plain_margin(&self, limit: RayLimit, p: Vec3<R>, apertures: Option<&ApertureSet<R>>) -> R {
        match limit {
            RayLimit::Rim => self.rim_margin(p),
            RayLimit::Aperture(side) | RayLimit::Obscuration(side) => {
                apertures.map_or(R::ONE, |apertures| apertures.margin(side, p))
            }
            _ => self.obstruction_margin(p),
        }
    }
}
