//! The paintings on the planes of a scene: test patterns as functions, and pictures from files.

use super::raster::Raster;
use super::scene::Radiance;
use super::seen_light::{LINE, SeenColor};
use std::f64::consts::TAU;
use std::sync::Arc;

/// A point of a painted rectangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PaintedPoint {
    /// The distance from its middle to the right and upwards, in the unit of the plane.
    pub place: [f64; 2],
    /// Half of the width and height of the rectangle, in the same unit.
    pub half_size: [f64; 2],
}

/// The paint at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Paint {
    /// The radiance.
    pub radiance: Radiance,
    /// The share of what is behind that it covers, 0 to 1.
    pub cover: f64,
}

/// A painting.
#[derive(Debug, Clone)]
pub enum Pattern {
    /// The same everywhere.
    Uniform {
        /// The radiance.
        radiance: Radiance,
        /// The share of what is behind that it covers.
        cover: f64,
    },
    /// `1 + c cos(2π (f·x) + φ)`.
    Wave {
        /// The contrast c.
        contrast: f64,
        /// The periods f per unit of the plane, to the right and upwards.
        frequency: [f64; 2],
        /// The phase φ in the middle, in radians.
        phase: f64,
    },
    /// Black and white squares, this many along the height.
    Checkerboard(f64),
    /// A straight edge at 5 degrees from the vertical between a dark left and a light right side, with
    /// the contrast 4:1 of ISO 12233.
    SlantedEdge,
    /// A star of this many black and as many white sectors (Siemens).
    Star(f64),
    /// Groups of three horizontal and three vertical black bars on white; each group is
    /// the sixth root of two finer than the one before (USAF 1951).
    Bars,
    /// Small discs of this radiance on black, this many along the height, each a hundredth of their
    /// distance in radius: lights whose images are point spreads.
    Lights {
        /// The number along the height.
        count: f64,
        /// The radiance of a disc.
        radiance: f64,
    },
    /// A disc that shines evenly, with the brightness of a lit ball if it is shaded.
    Ball {
        /// The radiance in its middle.
        radiance: Radiance,
        /// The direction of the light on it as seen from its middle, to the right and upwards.
        lit_from: [f64; 2],
    },
    /// A candle's flame: a drop that is brightest above its middle.
    Flame(Radiance),
    /// A wall that a light in front of it shines on.
    LitWall {
        /// The radiance of the wall nearest to the light.
        radiance: Radiance,
        /// The place of the light over the wall, in the unit of the plane.
        light: [f64; 2],
        /// Its distance from the wall, in the same unit.
        distance: f64,
    },
    /// A picture.
    Raster(Arc<Raster>),
    /// Another painting, brighter or darker, that covers less.
    Veiled {
        /// The painting.
        pattern: Arc<Self>,
        /// The factor of its radiance.
        level: f64,
        /// The factor of its cover, 0 to 1.
        cover: f64,
    },
}

/// Places of a painting, as many as are looked at together, and the paint there in one colour.
pub(super) struct PaintLine {
    /// The number of places.
    pub(super) count: usize,
    /// To the right and upwards.
    pub(super) place: [[f64; LINE]; 2],
    /// 1 where a ray meets the painting, else 0.
    pub(super) is_met: [f64; LINE],
    pub(super) level: [f64; LINE],
    pub(super) cover: [f64; LINE],
}

impl PaintLine {
    #[inline(always)]
    pub(super) fn new(count: usize) -> Self {
        let zero = [0.0; LINE];
        Self { count, place: [zero; 2], is_met: zero, level: zero, cover: [1.0; LINE] }
    }

    /// Point by point.
    #[inline(never)]
    pub(super) fn by_point(&mut self, pattern: &Pattern, half_size: [f64; 2], seen: SeenColor) {
        for i in (0..self.count).filter(|i| self.is_met[*i] > 0.0) {
            let place = [self.place[0][i], self.place[1][i]];
            let paint = pattern.paint(PaintedPoint { place, half_size });
            (self.level[i], self.cover[i]) = (seen.of(paint.radiance), paint.cover);
        }
    }

    /// Levels of 1 and 0 of whether something is true at a place; covers all.
    #[inline(always)]
    fn white_where(&mut self, is_white: impl Fn(f64, f64) -> bool) {
        for i in 0..LINE {
            let white = is_white(self.place[0][i], self.place[1][i]);
            self.level[i] = if white { 1.0 } else { 0.0 };
        }
        self.cover = [1.0; LINE];
    }

    #[inline(always)]
    pub(super) fn checkerboard(&mut self, side: f64) {
        self.white_where(|x, y| {
            let square = (x / side).floor() + (y / side).floor();
            square - 2.0 * (0.5 * square).floor() == 1.0
        });
    }

    #[inline(always)]
    pub(super) fn slanted_edge(&mut self) {
        let [dark, bright] = EDGE_LEVELS;
        self.white_where(|x, y| x > EDGE_SLOPE * y);
        self.level.iter_mut().for_each(|level| *level = if *level > 0.0 { bright } else { dark });
    }

    /// [`is_white_sector`] within a circle, and white around it.
    #[inline(always)]
    pub(super) fn star(&mut self, sectors: u32, radius: f64) {
        let [x, y] = &self.place;
        let (mut re, mut im) = ([0.0; LINE], [0.0; LINE]);
        let (mut power_re, mut power_im) = ([1.0; LINE], [0.0; LINE]);
        for i in 0..LINE {
            let largest = x[i].abs().max(y[i].abs());
            (re[i], im[i]) = (x[i] / largest, y[i] / largest);
        }
        let mut rest = sectors;
        while rest > 0 {
            if rest & 1 == 1 {
                for i in 0..LINE {
                    let product = power_re[i] * re[i] - power_im[i] * im[i];
                    power_im[i] = power_re[i] * im[i] + power_im[i] * re[i];
                    power_re[i] = product;
                }
            }
            for i in 0..LINE {
                let product = re[i] * re[i] - im[i] * im[i];
                im[i] = re[i] * im[i] + im[i] * re[i];
                re[i] = product;
            }
            rest >>= 1;
        }
        for i in 0..LINE {
            // The middle, which has no angle, belongs to the first sector.
            let is_middle = !((x[i] != 0.0) | (y[i] != 0.0));
            let is_right = (power_im[i] == 0.0) & (power_re[i] > 0.0);
            let white = (power_im[i] > 0.0) | is_right | is_middle;
            let is_outside = !(x[i] * x[i] + y[i] * y[i] <= radius * radius);
            self.level[i] = if white | is_outside { 1.0 } else { 0.0 };
        }
        self.cover = [1.0; LINE];
    }
}

fn grey(level: f64) -> Paint {
    Paint { radiance: [level; 3], cover: 1.0 }
}

const CLEAR: Paint = Paint { radiance: [0.0; 3], cover: 0.0 };
const EDGE_SLOPE: f64 = 0.087_488_663_525_924; // tan 5°
/// The radius of a light over the distance of its neighbours.
const LIGHT_RADIUS: f64 = 0.01;
const EDGE_LEVELS: [f64; 2] = [0.2, 0.8];
/// The largest number of sectors of a star whose power of the place does not overflow.
const MOST_SECTORS: f64 = 512.0;

impl Pattern {
    /// True if a star of so many sectors is a power of the place.
    pub(super) fn is_whole_star(sectors: f64) -> bool {
        sectors.fract() == 0.0 && (1.0..=MOST_SECTORS).contains(&sectors)
    }

    /// True if red, green and blue are the same everywhere.
    pub(super) fn is_grey(&self) -> bool {
        match self {
            Self::Uniform { radiance: [red, green, blue], .. } => red == green && green == blue,
            Self::Ball { .. } | Self::Flame(_) | Self::LitWall { .. } | Self::Raster(_) => false,
            Self::Veiled { pattern, .. } => pattern.is_grey(),
            Self::Wave { .. }
            | Self::Checkerboard(_)
            | Self::SlantedEdge
            | Self::Star(_)
            | Self::Bars
            | Self::Lights { .. } => true,
        }
    }

    /// True if nothing behind the rectangle can be seen through it.
    pub(super) fn covers_all(&self) -> bool {
        match self {
            Self::Uniform { cover, .. } => *cover == 1.0,
            Self::Ball { .. } | Self::Flame(_) => false,
            Self::Raster(raster) => raster.covers_all(),
            Self::Veiled { pattern, cover, .. } => *cover == 1.0 && pattern.covers_all(),
            Self::Wave { .. }
            | Self::Checkerboard(_)
            | Self::SlantedEdge
            | Self::Star(_)
            | Self::Bars
            | Self::Lights { .. }
            | Self::LitWall { .. } => true,
        }
    }

    /// The paint at a point.
    pub fn paint(&self, point: PaintedPoint) -> Paint {
        let PaintedPoint { place: [x, y], half_size: [half_width, half_height] } = point;
        let relative = || [x / half_width, y / half_height];
        match self {
            Self::Uniform { radiance, cover } => Paint { radiance: *radiance, cover: *cover },
            Self::Wave { contrast, frequency: [f, g], phase } => {
                grey(1.0 + contrast * (TAU * (f * x + g * y) + phase).cos())
            }
            Self::Checkerboard(count) => {
                let side = 2.0 * half_height / count;
                let square = (x / side).floor() + (y / side).floor();
                grey(square.rem_euclid(2.0))
            }
            Self::SlantedEdge => grey(EDGE_LEVELS[usize::from(x > EDGE_SLOPE * y)]),
            Self::Star(sectors) => {
                let radius = half_width.min(half_height);
                let inside = x * x + y * y <= radius * radius;
                grey(f64::from(u8::from(!inside || is_white_sector([x, y], *sectors))))
            }
            Self::Lights { count, radiance } => {
                let distance = 2.0 * half_height / count;
                let off = |v: f64| v - distance * (v / distance).round();
                let is_lit = off(x).hypot(off(y)) <= LIGHT_RADIUS * distance;
                grey(if is_lit { *radiance } else { 0.0 })
            }
            Self::Bars => grey(bars([x / half_height, y / half_height])),
            Self::Ball { radiance, lit_from } => ball(relative(), *radiance, *lit_from),
            Self::Flame(radiance) => flame(relative(), *radiance),
            Self::LitWall { radiance, light, distance } => {
                let square = (x - light[0]).powi(2) + (y - light[1]).powi(2);
                // The inverse square of the distance times the cosine on the wall.
                let share = (1.0 + square / (distance * distance)).powf(-1.5);
                Paint { radiance: radiance.map(|v| v * share), cover: 1.0 }
            }
            Self::Raster(raster) => {
                let [u, v] = relative();
                raster.paint([0.5 * (u + 1.0), 0.5 * (1.0 - v)])
            }
            Self::Veiled { pattern, level, cover } => {
                let paint = pattern.paint(point);
                let radiance = paint.radiance.map(|v| v * level);
                Paint { radiance, cover: paint.cover * cover }
            }
        }
    }
}

/// True in the first half of each of this many sectors, counted from the right upwards.
fn is_white_sector([x, y]: [f64; 2], sectors: f64) -> bool {
    let largest = x.abs().max(y.abs());
    if !(Pattern::is_whole_star(sectors) && largest > 0.0) {
        return (y.atan2(x) / TAU * sectors).rem_euclid(1.0) < 0.5;
    }
    // The sine of so many times the angle is the imaginary part of that power of x + iy, whose modulus is at
    // most √2 here.
    let (mut base, mut power) = ([x / largest, y / largest], [1.0, 0.0]);
    let times = |a: [f64; 2], b: [f64; 2]| [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]];
    let mut rest = sectors as u32;
    while rest > 0 {
        if rest & 1 == 1 {
            power = times(power, base);
        }
        base = times(base, base);
        rest >>= 1;
    }
    power[1] > 0.0 || power[1] == 0.0 && power[0] > 0.0
}

/// The height of the largest group of bars, over half of the height of the target.
const LARGEST_GROUP: f64 = 0.22;
/// The left end of the rows, and the tops of equal blocks of them.
const LEFT: f64 = -1.35;
const BLOCKS: [f64; 3] = [0.92, 0.3, -0.32];
/// The number of groups in a row; each row is half as large as the one above it.
const GROUPS: i32 = 6;
const ROWS: i32 = 6;

/// The level of the target at a place in halves of its height: three blocks of rows of groups from the top, each group
/// five bar widths high and eleven wide: three horizontal bars, a gap, three vertical bars.
fn bars([x, y]: [f64; 2]) -> f64 {
    let is_on = |top: f64| y <= top && is_in_block([x, top - y]);
    if BLOCKS.into_iter().any(is_on) { 0.0 } else { 1.0 }
}

/// True on a bar of a block of rows, at a place to the right of the middle and down from its top.
fn is_in_block([x, mut down]: [f64; 2]) -> bool {
    let mut height = LARGEST_GROUP;
    for _ in 0..ROWS {
        let mut left = LEFT;
        for group in 0..GROUPS {
            let bar = height / 5.0 * (-f64::from(group) / 6.0).exp2();
            if is_bar([(x - left) / bar, down / bar]) {
                return true;
            }
            left += 13.0 * bar;
        }
        down -= 1.2 * height;
        height *= 0.5;
    }
    false
}

/// True on a bar of a group, in bar widths from its upper left corner.
fn is_bar([right, down]: [f64; 2]) -> bool {
    let is_even = |at: f64| (at.floor() as i32) % 2 == 0;
    let inside = |at: f64, from: f64| at >= from && at < from + 5.0;
    inside(down, 0.0)
        && (inside(right, 0.0) && is_even(down) || inside(right, 6.0) && is_even(right))
}

/// A ball of Lambert's cosine, lit from a side in front of it.
fn ball([u, v]: [f64; 2], radiance: Radiance, [lx, ly]: [f64; 2]) -> Paint {
    let square = u * u + v * v;
    if square > 1.0 {
        return CLEAR;
    }
    let front = (1.0 - square).sqrt();
    let lit = ((front + lx * u + ly * v) / (1.0 + lx * lx + ly * ly).sqrt()).max(0.0);
    Paint { radiance: radiance.map(|level| level * lit), cover: 1.0 }
}

/// A drop with its tip upwards, clear at its foot.
fn flame([u, v]: [f64; 2], radiance: Radiance) -> Paint {
    let up = 0.5 * (v + 1.0);
    let width = (up.sqrt() * (1.0 - up) * 2.2).min(1.0);
    if u.abs() > width {
        return CLEAR;
    }
    let bright = (0.25 + 0.75 * (4.0 * up * (1.0 - up))).min(1.0);
    Paint { radiance: radiance.map(|level| level * bright), cover: 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn level(pattern: &Pattern, place: [f64; 2]) -> f64 {
        pattern.paint(PaintedPoint { place, half_size: [1.5, 1.0] }).radiance[0]
    }

    #[test]
    fn patterns_have_their_levels_where_they_belong() {
        let board = Pattern::Checkerboard(4.0);
        assert_eq!([level(&board, [0.1, 0.1]), level(&board, [0.6, 0.1])], [0.0, 1.0]);
        assert_eq!(level(&board, [-0.1, 0.1]), 1.0);
        // Two along the height, one of them in the middle: their distance is 1, their radius 0.01.
        let lights = Pattern::Lights { count: 2.0, radiance: 50.0 };
        let shown = [[0.0, 0.0], [1.0, -1.0], [0.0, 0.009], [0.0, 0.011], [0.5, 0.5]];
        assert_eq!(shown.map(|place| level(&lights, place)), [50.0, 50.0, 50.0, 0.0, 0.0]);
        let edge = Pattern::SlantedEdge;
        assert_eq!([level(&edge, [0.08, 0.9]), level(&edge, [0.08, 0.93])], [0.8, 0.2]);
        let star = Pattern::Star(4.0);
        assert_eq!([level(&star, [0.5, 0.01]), level(&star, [0.5, -0.01])], [1.0, 0.0]);
        let wave = Pattern::Wave { contrast: 0.5, frequency: [2.0, 0.0], phase: 0.0 };
        assert!((level(&wave, [0.25, 0.7]) - 0.5).abs() < 1e-15);
    }

    /// The power of the place tells the same sectors as the angle.
    #[test]
    fn sectors_are_those_of_the_angle() {
        for i in 0..5000_u32 {
            let angle = TAU * 0.618_033_988_749_895 * f64::from(i);
            let (sin, cos) = angle.sin_cos();
            for (radius, sectors) in [(1e-9, 36.0), (0.7, 1.0), (3e8, 511.0)] {
                let share = (angle / TAU * sectors).rem_euclid(1.0);
                // Within rounding of an edge either is right.
                if (share - 0.5).abs().min(share).min(1.0 - share) > 1e-9 {
                    let found = is_white_sector([radius * cos, radius * sin], sectors);
                    assert_eq!(found, share < 0.5, "{angle} {sectors}");
                }
            }
        }
        assert!(is_white_sector([0.0, 0.0], 36.0) && !is_white_sector([0.0, -1.0], 1.5));
    }

    #[test]
    fn half_of_a_group_of_bars_is_black_and_groups_do_not_touch() {
        // The first group: three horizontal bars from its upper left corner.
        let bar = LARGEST_GROUP / 5.0;
        let at = |right: f64, down: f64| bars([LEFT + right * bar, BLOCKS[0] - down * bar]);
        let column: Vec<f64> = (0..6).map(|i| at(2.5, f64::from(i) + 0.5)).collect();
        assert_eq!(column, [0.0, 1.0, 0.0, 1.0, 0.0, 1.0]);
        let row: Vec<f64> = (5..12).map(|i| at(f64::from(i) + 0.5, 2.5)).collect();
        assert_eq!(row, [1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0]);
    }

    #[test]
    fn a_wall_darkens_by_the_inverse_square_and_the_cosine_and_a_ball_towards_its_side() {
        let wall = Pattern::LitWall { radiance: [2.0; 3], light: [0.3, -0.2], distance: 0.5 };
        assert_eq!(level(&wall, [0.3, -0.2]), 2.0);
        // As far beside the foot as the light is away: half by the square, 1/sqrt 2 by the cosine.
        assert!((level(&wall, [0.3, 0.3]) - 2.0 * 0.5f64.powf(1.5)).abs() < 1e-15);
        // A ball is brightest where its surface faces the light, at (lx, ly, 1) over its length.
        let ball = Pattern::Ball { radiance: [1.0; 3], lit_from: [2.0, -2.0] };
        let at = |u: f64, v: f64| level(&ball, [1.5 * u, v]);
        assert!((at(2.0 / 3.0, -2.0 / 3.0) - 1.0).abs() < 1e-12);
        assert_eq!(at(-0.6, 0.7), 0.0);
        assert!((at(0.0, 0.0) - 1.0 / 3.0).abs() < 1e-12);
    }

    #[test]
    fn a_star_is_white_around_its_circle_and_its_first_sector() {
        let star = Pattern::Star(4.0);
        for place in [[1.2, 0.1], [1.2, -0.1], [0.8, -0.8], [-0.8, 0.8]] {
            assert_eq!(level(&star, place), 1.0, "{place:?}");
        }
        // Eight sectors of 45 degrees in turn, the first of them from the right upwards.
        let around = (0..8).map(|i| (TAU * (f64::from(i) + 0.5) / 8.0).sin_cos());
        let levels: Vec<f64> =
            around.map(|(sin, cos)| level(&star, [0.5 * cos, 0.5 * sin])).collect();
        assert_eq!(levels, [1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0]);
    }

    #[test]
    fn the_left_end_of_the_rows_crosses_three_bars_of_six_rows_of_three_blocks() {
        let column = (0..400_000).map(|i| bars([LEFT + 1e-4, 1.0 - 5e-6 * f64::from(i)]));
        let levels: Vec<f64> = column.collect();
        let entered = levels.windows(2).filter(|pair| pair[0] > pair[1]).count();
        assert_eq!(entered, 3 * 6 * 3);
    }

    #[test]
    fn a_picture_is_painted_with_its_first_pixel_above_on_the_left() {
        let light = [0.1, 0.2, 0.3, 0.4].map(|level| [level, level, level, 1.0]).to_vec();
        let image = crate::files::ColorImage { width: 2, height: 2, light };
        let raster = Pattern::Raster(Arc::new(Raster::new(image)));
        let corners = [[-1.4, 0.9], [1.4, 0.9], [-1.4, -0.9], [1.4, -0.9]];
        for (corner, exact) in corners.into_iter().zip([0.1, 0.2, 0.3, 0.4]) {
            assert!((level(&raster, corner) - exact).abs() < 1e-7, "{corner:?}");
        }
    }

    /// A row of groups, each smaller by a sixth of an octave, has the three bars of every group.
    #[test]
    fn a_row_of_bars_crosses_every_group() {
        let down = 0.5 * LARGEST_GROUP / 5.0;
        let row = (0..400_000).map(|i| bars([LEFT - 1e-3 + 1e-5 * f64::from(i), BLOCKS[0] - down]));
        let levels: Vec<f64> = row.collect();
        let entered = levels.windows(2).filter(|pair| pair[0] > pair[1]).count();
        // On the first horizontal bar, then each of three vertical ones.
        assert_eq!(entered, 4 * GROUPS as usize);
    }
}
