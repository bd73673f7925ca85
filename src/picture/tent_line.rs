//! Tents along a line of places whose texels lie beside each other.
//!
//! Places along a row of a picture advance by nearly the same part of a texel. Where that is nearly two, one, a half
//! or a quarter, the texels of one corner after the other of all tents are neighbours in memory: they are
//! loaded by whole registers, while places that lie anyhow need a load for each. A tent weighs a texel by one minus
//! the distance of both; as many columns and rows of texels count as the places drift away from an even
//! advance. That is half of the work for a single corner of a tent, and a tenth in time.

use super::mip_texture::LINE;

/// A place along a line, in texels: a polynomial of second degree in the number of the point.
pub(super) type LinePlace = [f64; 3];

/// The light of a level of a painting, without its cover.
#[derive(Debug, Clone, Copy)]
pub(super) struct LightView<'a> {
    /// Row by row.
    pub(super) texels: &'a [f32],
    /// The same, of each row its even columns before its odd ones.
    pub(super) halves: &'a [f32],
    pub(super) width: usize,
}

/// The largest drift of places away from an even advance, in texels.
const DRIFT: f64 = 7.0;

/// The smallest and the largest value along a line of so many points, or beyond.
#[inline(always)]
fn range([a, b, c]: LinePlace, count: usize) -> [f64; 2] {
    let last = count.saturating_sub(1) as f64;
    let end = a + last * (b + last * c);
    let bend = 0.25 * c.abs() * last * last;
    [a.min(end) - bend, a.max(end) + bend]
}

/// The values along a line.
#[inline(always)]
fn values<const N: usize>(place: LinePlace) -> [f32; N] {
    let [a, b, c] = [place[0] as f32, place[1] as f32, place[2] as f32];
    let mut values = [0.0; N];
    for (i, value) in values.iter_mut().enumerate() {
        let i = i as f32;
        *value = a + i * (b + i * c);
    }
    values
}

/// The weight of a texel at a distance.
#[inline(always)]
fn tent(distance: f32) -> f32 {
    (1.0 - distance.abs()).max(0.0)
}

impl LightView<'_> {
    /// Adds a share of the light at the places of a line of so many points, interpolated between the middles of
    /// texels; false if they do not lie so that this can be done.
    #[inline(always)]
    pub(super) fn add_tents(
        &self,
        places: [LinePlace; 2],
        (share, count): (f32, usize),
        sums: &mut [f32; LINE],
    ) -> bool {
        let points = (share, count);
        match places[0][1] {
            advance if !(advance > 0.1875 && advance < 3.0) => false,
            advance if advance > 1.5 => self.add_line::<2>(places, points, sums),
            advance if advance > 0.75 => self.add_line::<1>(places, points, sums),
            advance if advance > 0.375 => self.add_phases::<2>(places, points, sums),
            _ => self.add_phases::<4>(places, points, sums),
        }
    }

    /// Every second or fourth place by itself.
    #[inline(always)]
    fn add_phases<const P: usize>(
        &self,
        places: [LinePlace; 2],
        (share, count): (f32, usize),
        sums: &mut [f32; LINE],
    ) -> bool {
        let apart = P as f64;
        let mut parts = [[0.0; LINE]; P];
        let later = |[a, b, c]: LinePlace, by: f64| {
            [a + by * (b + by * c), apart * (b + 2.0 * by * c), apart * apart * c]
        };
        for (phase, part) in parts.iter_mut().enumerate() {
            let by = phase as f64;
            let moved = [later(places[0], by), later(places[1], by)];
            if !self.add_line::<1>(moved, (share, count.div_ceil(P)), part) {
                return false;
            }
        }
        for (i, sums) in sums.chunks_exact_mut(P).enumerate() {
            for (sum, part) in sums.iter_mut().zip(&parts) {
                *sum += part[i];
            }
        }
        true
    }

    #[inline(always)]
    fn add_line<const S: usize>(
        &self,
        places: [LinePlace; 2],
        (share, count): (f32, usize),
        sums: &mut [f32; LINE],
    ) -> bool {
        match count {
            0..=16 => self.add_points::<S, 16>(places, (share, count), sums),
            17..=32 => self.add_points::<S, 32>(places, (share, count), sums),
            33..=48 => self.add_points::<S, 48>(places, (share, count), sums),
            _ => self.add_points::<S, LINE>(places, (share, count), sums),
        }
    }

    /// The tents of at most `N` points that advance by about `S` texels.
    #[inline(always)]
    fn add_points<const S: usize, const N: usize>(
        &self,
        [mut across, mut along]: [LinePlace; 2],
        (share, count): (f32, usize),
        sums: &mut [f32; LINE],
    ) -> bool {
        across[1] -= S as f64;
        let ([left, right], [low, high]) = (range(across, count), range(along, count));
        if !(left >= 0.0 && low >= 0.0 && right - left < DRIFT && high - low < DRIFT) {
            return false;
        }
        let (column, row) = (left as usize, low as usize);
        across[0] -= column as f64;
        along[0] -= row as f64;
        let columns = (right - column as f64) as usize + 2;
        let rows = (high - row as f64) as usize + 2;
        // The points behind the last one read what is there, and are not used.
        let behind = (row + rows) * self.width + column + columns + N;
        if column + S * (count - 1) + columns > self.width || behind > self.texels.len() {
            return false;
        }
        let (across, along) = (values::<N>(across), values::<N>(along));
        for y in 0..rows {
            let mut line = [0.0; N];
            for x in 0..columns {
                let Some(texels) = self.texels_from::<S, N>(row + y, column + x) else {
                    return false;
                };
                let from = x as f32;
                for i in 0..N {
                    line[i] += tent(across[i] - from) * texels[i];
                }
            }
            let from = y as f32;
            for i in 0..N {
                sums[i] += share * tent(along[i] - from) * line[i];
            }
        }
        true
    }

    /// The texels of a row from a column on, `S` columns apart.
    #[inline(always)]
    fn texels_from<const S: usize, const N: usize>(
        &self,
        row: usize,
        column: usize,
    ) -> Option<&[f32; N]> {
        let first = row * self.width;
        if S == 1 {
            return self.texels.get(first + column..)?.first_chunk();
        }
        let half = if column.is_multiple_of(2) { 0 } else { self.width.div_ceil(2) };
        self.halves.get(first + half + column / 2..)?.first_chunk()
    }
}

/// The light of rows, of each its even columns before its odd ones.
pub(super) fn split(texels: &[f32], width: usize) -> Vec<f32> {
    let mut halves = Vec::with_capacity(texels.len());
    for row in texels.chunks(width) {
        halves.extend(row.iter().step_by(2));
        halves.extend(row.iter().skip(1).step_by(2));
    }
    halves
}
