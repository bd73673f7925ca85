//! The error of a picture against the exact way, tile by tile.
//!
//! With two independent renderings A and B of a tile, the mean of `(A − V)(B − V)` is the squared error of V
//! without the noise of A and B. It may be negative where the error is below that noise, which must be kept
//! for the mean over tiles; a single tile then counts as without error.

use super::Picture;
use super::exact::{ExactRenderer, ExactSettings, MID_GREY};
use super::tile_sampler::PictureTile;
use crate::analysis::Estimate;
use crate::plot::{Color, GREY, glow};
use rayon::prelude::*;

/// The error of a picture on some of its tiles.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorMap {
    /// The number of columns and rows of the picture.
    pixels: [usize; 2],
    tiles: Vec<TileError>,
}

/// The error of a tile.
#[derive(Debug, Clone, PartialEq)]
struct TileError {
    tile: PictureTile,
    /// The mean squared error as a share of mid grey, or of the pixel where that is brighter.
    square: f64,
    rays: usize,
}

impl ErrorMap {
    /// The error of a picture on about `count` tiles, with this many samples of each pixel in each of two
    /// independent renderings.
    pub fn measure(
        exact: &ExactRenderer<'_>,
        picture: &Picture,
        count: usize,
        samples: usize,
    ) -> Self {
        Self::measure_until(exact, picture, (count, samples), || false)
    }

    /// The same; once `is_stopped` is true, no further tile is measured.
    pub fn measure_until(
        exact: &ExactRenderer<'_>,
        picture: &Picture,
        (count, samples): (usize, usize),
        is_stopped: impl Fn() -> bool + Sync,
    ) -> Self {
        Self::of_exposure(exact, picture, ((count, samples), 0.0), is_stopped)
    }

    /// The same for a scene that moves for some seconds.
    pub fn of_exposure(
        exact: &ExactRenderer<'_>,
        picture: &Picture,
        ((count, samples), seconds): ((usize, usize), f64),
        is_stopped: impl Fn() -> bool + Sync,
    ) -> Self {
        let tiles = exact.tiles();
        let chosen = spread_out(tiles.len(), count).into_par_iter();
        let chosen = chosen.filter(|_| !is_stopped());
        let measured =
            chosen.map(|i| TileError::measure(exact, picture, &tiles[i], (samples, seconds)));
        Self { pixels: picture.frame.pixels, tiles: measured.collect() }
    }

    /// The root mean square over all tiles as a share of mid grey, or of the pixel where that is brighter;
    /// with its own standard error.
    pub fn rms(&self) -> Estimate {
        let n = self.tiles.len().max(1) as f64;
        let mean = self.tiles.iter().map(|tile| tile.square).sum::<f64>() / n;
        let spread = self.tiles.iter().map(|tile| (tile.square - mean).powi(2)).sum::<f64>();
        let of_mean = (spread / (n * (n - 1.0).max(1.0))).sqrt();
        let value = mean.max(0.0).sqrt();
        // The error of a root: never above the root of the error.
        let error = (0.5 * of_mean / value.max(f64::MIN_POSITIVE)).min(of_mean.sqrt());
        Estimate::new(value, error, self.tiles.iter().map(|tile| tile.rays).sum())
    }

    /// The largest error of a tile, as a share like that of [`ErrorMap::rms`].
    pub fn largest(&self) -> f64 {
        self.tiles.iter().map(TileError::rms).fold(0.0, f64::max)
    }

    /// The number of columns and rows of the picture.
    pub const fn pixels(&self) -> [usize; 2] {
        self.pixels
    }

    /// True if every pixel is in a tile that was measured.
    pub fn is_whole(&self) -> bool {
        self.tiles.iter().map(|tile| tile.tile.len()).sum::<usize>()
            == self.pixels[0] * self.pixels[1]
    }

    /// The number of tiles that were measured.
    pub fn tiles(&self) -> usize {
        self.tiles.len()
    }

    /// The map as an image of the size of the picture, row by row from the upper left corner: black where
    /// there is no error to white at `white`, which is a share like that of [`ErrorMap::rms`]; grey where
    /// nothing was measured.
    pub fn heat(&self, white: f64) -> Vec<Color> {
        let [columns, rows] = self.pixels;
        let mut colors = vec![GREY; columns * rows];
        for tile in &self.tiles {
            let color = glow(tile.rms() / white.max(f64::MIN_POSITIVE));
            tile.tile.pixels().for_each(|[column, row]| colors[row * columns + column] = color);
        }
        colors
    }
}

/// At most `count` places among `all`, in steps of the golden ratio, which reach all parts; all of them if
/// there are no more.
fn spread_out(all: usize, count: usize) -> Vec<usize> {
    if count >= all {
        return (0..all).collect();
    }
    let part = |i: usize| (0.5 + 0.618_033_988_749_895 * i as f64).fract();
    (0..count).map(|i| (part(i) * all as f64) as usize).collect()
}

impl TileError {
    fn measure(
        exact: &ExactRenderer<'_>,
        picture: &Picture,
        tile: &PictureTile,
        (samples, seconds): (usize, f64),
    ) -> Self {
        let render = |seed: u32| {
            let settings = ExactSettings { tolerance: -1.0, max_samples: samples, seed, seconds };
            exact.sample_tile(tile, &settings)
        };
        let (a, b) = (render(0x5EED_0001), render(0x5EED_0002));
        let grey = MID_GREY * picture.white;
        let (mut sum, mut count) = (0.0, 0.0);
        for (i, [column, row]) in tile.pixels().enumerate() {
            let shown = picture.values[row * picture.frame.pixels[0] + column];
            for ((shown, a), b) in shown.into_iter().zip(a.values[i]).zip(b.values[i]) {
                sum += (a - shown) * (b - shown) / (0.5 * (a + b)).max(grey).powi(2);
                count += 1.0;
            }
        }
        Self { tile: tile.clone(), square: sum / count, rays: a.samples + b.samples }
    }

    fn rms(&self) -> f64 {
        self.square.max(0.0).sqrt()
    }
}

/// [`ErrorMap::rms`] of a picture on about `count` tiles with this many samples of each pixel.
pub fn quick_error(
    exact: &ExactRenderer<'_>,
    picture: &Picture,
    count: usize,
    samples: usize,
) -> Estimate {
    ErrorMap::measure(exact, picture, count, samples).rms()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tile(columns: std::ops::Range<usize>, square: f64) -> TileError {
        TileError { tile: PictureTile::new(columns, 0..2), square, rays: 10 }
    }

    /// Two tiles of errors 3 % and 1 %, and one that was not measured.
    #[test]
    fn a_map_is_white_at_its_largest_error_and_grey_where_nothing_is_known() {
        let tiles = vec![tile(0..2, 9e-4), tile(2..4, 1e-4)];
        let map = ErrorMap { pixels: [5, 2], tiles };
        assert!((map.rms().value - 5e-4_f64.sqrt()).abs() < 1e-15, "{:?}", map.rms());
        assert!((map.largest() - 0.03).abs() < 1e-15);
        assert_eq!(map.rms().rays, 20);
        let heat = map.heat(map.largest());
        assert_eq!([heat[0], heat[6]], [[0xff; 3]; 2]);
        assert_eq!(heat[4], GREY);
        assert!(heat[2] != heat[0] && heat[2] != [0; 3] && heat[2] == heat[8], "{heat:?}");
    }

    #[test]
    fn noise_that_cancels_is_no_error() {
        let map = ErrorMap { pixels: [4, 2], tiles: vec![tile(0..2, 1e-6), tile(2..4, -1e-6)] };
        assert_eq!(map.rms().value, 0.0);
        assert!(map.rms().error > 0.0);
        assert_eq!(map.heat(1.0)[2], [0; 3]);
    }

    #[test]
    fn chosen_tiles_differ_and_all_of_them_are_all() {
        assert_eq!(spread_out(5, 9), [0, 1, 2, 3, 4]);
        let mut few = spread_out(100, 24);
        few.sort_unstable();
        few.dedup();
        assert_eq!(few.len(), 24);
    }
}
