//! Contour lines of a function that is known on a grid.

use super::{ChartCurve, round_step};
use crate::math::ShortNumber;

/// A point of a grid: its place and its value.
type Node = ([f64; 2], f64);

/// The values of a function at the nodes of a grid.
#[derive(Debug, Clone, PartialEq)]
pub struct ContourGrid {
    /// The places of the columns and of the rows, ascending.
    pub places: [Vec<f64>; 2],
    /// The values row by row; `None` where the function has none.
    pub values: Vec<Option<f64>>,
}

impl ContourGrid {
    /// The least and the largest value; `None` if the function has no value at all.
    pub fn range(&self) -> Option<[f64; 2]> {
        let values = self.values.iter().flatten();
        values.fold(None, |range, value| {
            let [least, most] = range.unwrap_or([*value; 2]);
            Some([value.min(least), value.max(most)])
        })
    }

    /// The pieces of the line on which the function has a value: straight across triangles, two for each
    /// cell of the grid, in which it is interpolated linearly.
    pub fn line(&self, level: f64) -> Vec<Vec<[f64; 2]>> {
        let [columns, rows] = [self.places[0].len(), self.places[1].len()];
        let cells = (1..rows).flat_map(|j| (1..columns).map(move |i| [i, j]));
        let triangles = cells.flat_map(|[i, j]| {
            let [a, b] = [[i - 1, j - 1], [i, j]];
            [[a, [i, j - 1], b], [a, [i - 1, j], b]]
        });
        triangles.filter_map(|corners| self.crossing(corners, level)).collect()
    }

    fn node(&self, [i, j]: [usize; 2]) -> Option<Node> {
        let value = *self.values.get(j * self.places[0].len() + i)?;
        Some(([self.places[0][i], self.places[1][j]], value?))
    }

    /// The line across a triangle.
    fn crossing(&self, corners: [[usize; 2]; 3], level: f64) -> Option<Vec<[f64; 2]>> {
        let [a, b, c] = corners.map(|corner| self.node(corner));
        let [a, b, c] = [a?, b?, c?];
        let on_side = |(from, to): (Node, Node)| {
            let (low, high) = (from.1 - level, to.1 - level);
            // A corner that lies on the line counts as above it.
            if (low < 0.0) == (high < 0.0) {
                return None;
            }
            let t = low / (low - high);
            Some([0, 1].map(|k| from.0[k] + t * (to.0[k] - from.0[k])))
        };
        let ends: Vec<[f64; 2]> =
            [(a, b), (b, c), (c, a)].into_iter().filter_map(on_side).collect();
        (ends.len() == 2).then_some(ends)
    }
}

/// The largest number of contour lines.
const CONTOURS: f64 = 10.0;

/// Contour lines at round numbers, dashed below zero; their step is named in the unit of the values.
pub fn contour_curves(grid: &ContourGrid, unit: &str) -> Vec<ChartCurve> {
    let Some([least, most]) = grid.range().filter(|[least, most]| most > least) else {
        return Vec::new();
    };
    let step = round_step((most - least) / CONTOURS);
    #[expect(clippy::cast_possible_truncation, reason = "about ten lines")]
    let [first, last] = [(least / step).ceil(), (most / step).floor()].map(|i| i as i64);
    let line = |i: i64| {
        let name = match i {
            0 => "0".to_owned(),
            1.. if least < 0.0 => format!("above, every {} {unit}", ShortNumber(step)),
            ..0 if most > 0.0 => format!("below, every {} {unit}", ShortNumber(step)),
            _ => format!("every {} {unit}", ShortNumber(step)),
        };
        let color = usize::from(i < 0) + 2 * usize::from(i == 0);
        let pieces = grid.line(i as f64 * step);
        ChartCurve { name, color, dashed: i < 0, pieces }
    };
    (first..=last).map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn places(count: i32) -> Vec<f64> {
        (-count..=count).map(|i| f64::from(i) / f64::from(count)).collect()
    }

    /// A map of one sign has a scale too.
    #[test]
    fn every_side_of_zero_names_its_step() {
        let names = |shift: f64| {
            let side = places(20);
            let square = |y: f64| side.iter().map(move |x| Some(x * x + y * y - shift));
            let values = side.iter().flat_map(|y| square(*y)).collect();
            let curves = contour_curves(
                &ContourGrid { places: [side.clone(), side.clone()], values },
                "waves",
            );
            let mut names: Vec<String> = curves.into_iter().map(|curve| curve.name).collect();
            names.dedup();
            names
        };
        assert_eq!(names(0.0), ["0", "every 0.2 waves"]);
        assert_eq!(names(2.0), ["every 0.2 waves", "0"]);
        assert_eq!(names(1.0), ["below, every 0.2 waves", "0", "above, every 0.2 waves"]);
    }

    /// The contours of a paraboloid are circles; without a value there is no line.
    #[test]
    fn a_paraboloid_has_circles() {
        let side = places(40);
        let value = |y: f64| side.iter().map(move |x| (*x > -0.5).then_some(x * x + y * y));
        let values = side.iter().flat_map(|y| value(*y)).collect();
        let grid = ContourGrid { places: [side.clone(), side.clone()], values };
        let pieces = grid.line(0.64);
        let points: Vec<&[f64; 2]> = pieces.iter().flatten().collect();
        assert!(points.len() > 100);
        for [x, y] in points {
            assert!((x.hypot(*y) - 0.8).abs() < 1e-3 && *x > -0.51, "{x} {y}");
        }
        assert_eq!(grid.range().map(|range| range.map(|v| (1e9 * v).round())), Some([0.0, 2e9]));
        assert!(grid.line(3.0).is_empty());
        let dark = ContourGrid { values: vec![None; 81 * 81], ..grid };
        assert_eq!((dark.range(), dark.line(0.5).len()), (None, 0));
    }
}
