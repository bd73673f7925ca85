//! A mosaic of colour filters (Bayer, US 3,971,065): a pixel measures one colour, and the others are
//! interpolated from its neighbours.
//!
//! Interpolation is linear: each colour is the mean of the nearest pixels that measure it, weighted 2 beside
//! and 1 across a corner. It makes colours at fine patterns that are not in the light, as cameras do.

use super::sensor::SensorImage;

/// The colour that a pixel measures: 0 for red, 1 for green, 2 for blue; red is in the upper left corner.
const fn filter_color([column, row]: [usize; 2]) -> usize {
    column % 2 + row % 2
}

/// The weight of a neighbour, one row or column away at most.
fn weight(dx: i64, dy: i64) -> f64 {
    f64::from(4_u8 >> (dx.abs() + dy.abs()))
}

impl SensorImage {
    /// The image that a sensor with filters over its pixels gives; a colour that no neighbour measures is
    /// that of the pixel.
    #[must_use]
    pub fn through_filters(&self, columns: usize) -> Self {
        let rows = self.numbers.len() / columns.max(1);
        let pixel = |i: usize| {
            let (column, row) = (i % columns, i / columns);
            [0, 1, 2].map(|color| self.interpolated([column, row], [columns, rows], color))
        };
        let numbers = (0..self.numbers.len()).map(pixel).collect();
        Self { numbers, ..self.clone() }
    }

    /// The number of a colour at a pixel, from those pixels that measure it.
    fn interpolated(&self, [column, row]: [usize; 2], size: [usize; 2], color: usize) -> u16 {
        let own = filter_color([column, row]);
        let number = |[x, y]: [usize; 2], color: usize| self.numbers[y * size[0] + x][color];
        if own == color {
            return number([column, row], color);
        }
        let (mut sum, mut weights) = (0.0, 0.0);
        for (dx, dy) in (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| (dx, dy))) {
            let place = [(column, dx, size[0]), (row, dy, size[1])].map(|(at, step, count)| {
                usize::try_from(at as i64 + step).ok().filter(|at| *at < count)
            });
            let [Some(x), Some(y)] = place else { continue };
            if filter_color([x, y]) == color {
                sum += weight(dx, dy) * f64::from(number([x, y], color));
                weights += weight(dx, dy);
            }
        }
        if weights > 0.0 { (sum / weights).round() as u16 } else { number([column, row], own) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(columns: usize, rows: usize, of: impl Fn(usize, usize) -> [u16; 3]) -> SensorImage {
        let numbers = (0..columns * rows).map(|i| of(i % columns, i / columns)).collect();
        SensorImage { numbers, white: 100.0, black: 0.0, saturated: 0.0 }
    }

    #[test]
    fn half_of_the_filters_are_green() {
        let colors = [[0, 0], [1, 0], [0, 1], [1, 1]].map(filter_color);
        assert_eq!(colors, [0, 1, 1, 2]);
    }

    /// Light of one colour everywhere, and light that grows evenly, which linear interpolation keeps inside.
    #[test]
    fn even_and_linear_light_is_kept() {
        let even = image(5, 4, |_, _| [40, 50, 60]);
        assert_eq!(even.through_filters(5), even);
        let slope = image(8, 8, |x, y| [0, 1, 2].map(|c| (100 + 10 * x + 6 * y + c) as u16));
        let seen = slope.through_filters(8);
        for (x, y) in (1..7).flat_map(|x| (1..7).map(move |y| (x, y))) {
            assert_eq!(seen.numbers[8 * y + x], slope.numbers[8 * y + x], "{x} {y}");
        }
    }

    /// White and black columns of the width of a pixel: red falls on white columns alone, blue on black ones.
    #[test]
    fn a_pattern_finer_than_the_filters_gets_colours() {
        let lines = image(8, 8, |x, _| if x % 2 == 0 { [200; 3] } else { [0; 3] });
        let seen = lines.through_filters(8);
        assert_eq!(seen.numbers[8 * 3 + 4][0], 200);
        assert_eq!(seen.numbers[8 * 3 + 4][2], 0);
    }

    #[test]
    fn a_single_pixel_has_the_colour_that_it_measures() {
        let one = image(1, 1, |_, _| [7, 8, 9]);
        assert_eq!(one.through_filters(1).numbers, [[7, 7, 7]]);
        assert!(image(0, 0, |_, _| [0; 3]).through_filters(0).numbers.is_empty());
    }
}
