//! Contours of a raster, by marching squares.

/// A contour of a raster.
#[derive(Debug, Clone, PartialEq)]
pub struct Contour {
    /// The value.
    pub level: f64,
    /// Its line segments, in mm.
    pub pieces: Vec<[[f64; 2]; 2]>,
}

/// The contours of a raster at the multiples of `spacing` within a range. Its rows are from the bottom
/// and its cells fill the frame; there is no contour next to a cell that is NaN.
pub(super) fn contours(
    values: &[f64],
    size: [usize; 2],
    frame: [[f64; 2]; 2],
    [low, high]: [f64; 2],
    spacing: f64,
) -> Vec<Contour> {
    if !(spacing > 0.0) {
        return Vec::new();
    }
    let (first, last) = ((low / spacing).ceil() as i64, (high / spacing).floor() as i64);
    let of = |n: i64| {
        let level = n as f64 * spacing;
        Contour { level, pieces: level_set(values, size, frame, level) }
    };
    (first..=last).map(of).filter(|contour| !contour.pieces.is_empty()).collect()
}

/// The line segments on which a raster has the value `level`.
pub(super) fn level_set(
    values: &[f64],
    [width, height]: [usize; 2],
    frame: [[f64; 2]; 2],
    level: f64,
) -> Vec<[[f64; 2]; 2]> {
    let place = |right: f64, up: f64| {
        let along = |axis: usize, t: f64, count: usize| {
            frame[0][axis] + (frame[1][axis] - frame[0][axis]) * (t + 0.5) / count as f64
        };
        [along(0, right, width), along(1, up, height)]
    };
    let mut found = Vec::new();
    for row in 0..height.saturating_sub(1) {
        for column in 0..width.saturating_sub(1) {
            let corner = |i: usize, j: usize| values[(row + j) * width + column + i] - level;
            let corners = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
            let at = |[x, y]: [f64; 2]| place(column as f64 + x, row as f64 + y);
            found.extend(in_cell(corners).map(|piece| piece.map(at)));
        }
    }
    found
}

/// The line segments of the zero set in the unit square, by the values at its corners.
fn in_cell(corners: [f64; 4]) -> impl Iterator<Item = [[f64; 2]; 2]> {
    const PLACES: [[f64; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let finite = corners.iter().all(|value| value.is_finite());
    let crossing = |i: usize| {
        let j = (i + 1) % 4;
        let (a, b) = (corners[i], corners[j]);
        if !finite || (a < 0.0) == (b < 0.0) {
            return None;
        }
        let t = a / (a - b);
        Some([0, 1].map(|axis| PLACES[i][axis] + t * (PLACES[j][axis] - PLACES[i][axis])))
    };
    let mut met = (0..4).filter_map(crossing);
    let pairs = [met.next().zip(met.next()), met.next().zip(met.next())];
    pairs.into_iter().flatten().map(|(a, b)| [a, b])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contours_of_a_cone_are_circles() {
        let (size, frame) = ([41, 41], [[-1.025, -1.025], [1.025, 1.025]]);
        let at = |i: usize| -1.0 + 0.05 * i as f64;
        let values: Vec<f64> = (0..41 * 41).map(|n| f64::hypot(at(n % 41), at(n / 41))).collect();
        let found = contours(&values, size, frame, [0.0, 1.0], 0.25);
        let levels: Vec<f64> = found.iter().map(|contour| contour.level).collect();
        assert_eq!(levels, [0.25, 0.5, 0.75, 1.0]);
        for Contour { level, pieces } in found {
            let radii = pieces.iter().flatten().map(|[x, y]| x.hypot(*y));
            let off = radii.map(|r| (r - level).abs()).fold(0.0, f64::max);
            assert!(off < 0.01, "{off} at {level}");
            let length: f64 =
                pieces.iter().map(|[a, b]| f64::hypot(b[0] - a[0], b[1] - a[1])).sum();
            let round = std::f64::consts::TAU * level;
            assert!((length / round - 1.0).abs() < 0.02, "{length} of {round}");
        }
    }

    #[test]
    fn there_is_no_contour_beside_air_or_without_a_range() {
        let values = [0.0, 1.0, f64::NAN, 1.0];
        let frame = [[0.0; 2], [1.0; 2]];
        assert!(contours(&values, [2, 2], frame, [0.0, 1.0], 0.5).is_empty());
        assert!(contours(&[1.0; 4], [2, 2], frame, [1.0, 1.0], 0.0).is_empty());
    }
}
