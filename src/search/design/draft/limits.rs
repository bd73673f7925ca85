//! The limits of a draft as squared violations: focal length, track, back focus, edges, steepness,
//! and the map of glasses.

use super::merit::ResidualSum;
use super::parameter::model;
use super::{DraftMerit, DraftParameter};
use crate::lens::{Medium, Row};
use crate::search::design::requirements::FOCAL_LENGTH_TOLERANCE;
use crate::trace::SurfaceParameter;

/// The largest `|curvature| × semi-diameter`, and the length that a unit more of it counts as,
/// relative to the focal length.
const STEEPNESS: [f64; 2] = [0.92, 0.2];
/// The length that an index outside the map of glasses counts as, relative to the focal length.
const INDEX_LENGTH: f64 = 0.05;
/// The part of the tolerance of the focal length that a draft may use.
const FOCAL_PART: f64 = 0.6;

/// The largest and the smallest index of glasses by Abbe number, at ten steps of it.
const GLASS_MAP: [(f64, f64, f64); 12] = [
    (20.0, 1.80, 1.95),
    (25.0, 1.70, 1.92),
    (30.0, 1.65, 1.90),
    (35.0, 1.60, 1.90),
    (40.0, 1.565, 1.885),
    (45.0, 1.545, 1.835),
    (50.0, 1.525, 1.775),
    (55.0, 1.515, 1.715),
    (60.0, 1.505, 1.645),
    (70.0, 1.485, 1.525),
    (80.0, 1.45, 1.50),
    (95.0, 1.43, 1.44),
];

impl DraftMerit<'_> {
    /// Adds the squared violations of all limits that need no rays. `None` if a number is not
    /// finite.
    pub(super) fn add_limits(&self, sum: &mut ResidualSum) -> Option<()> {
        self.add_focal_length(sum)?;
        self.add_lengths(sum);
        let rows = &self.draft.lens.surfaces;
        for i in 0..rows.len() {
            self.add_steepness(i, sum);
            if i + 1 < rows.len() {
                self.add_edge(i, sum);
            }
            if self.freedom.glasses && matches!(rows[i].medium, Medium::Model { .. }) {
                self.add_glass(i, sum);
            }
        }
        Some(())
    }

    /// Adds the square of an excess in mm where that is positive; `sign` times the slopes are its
    /// derivatives.
    fn limit(
        &self,
        (term, surface): (&'static str, Option<usize>),
        excess: f64,
        (sign, slopes): (f64, &[(DraftParameter, f64)]),
        sum: &mut ResidualSum,
    ) {
        let mut row = vec![0.0; self.parameters.len()];
        for (parameter, slope) in slopes {
            if let Some(i) = self.index_of(*parameter) {
                row[i] += sign * slope;
            }
        }
        if excess > 0.0 {
            sum.broken.push((term, surface, excess));
        }
        sum.add_one_sided(self.plan.limit_weight, excess, &row);
    }

    fn add_focal_length(&self, sum: &mut ResidualSum) -> Option<()> {
        let (focal, slopes) = self.focal_length();
        if !focal.is_finite() {
            return None;
        }
        let target = self.asked.focal_length;
        let room = FOCAL_PART * FOCAL_LENGTH_TOLERANCE * target;
        let off = focal - target;
        for sign in [1.0, -1.0] {
            self.limit(("focal_length", None), sign * off - room, (sign, &slopes), sum);
        }
        Some(())
    }

    fn add_lengths(&self, sum: &mut ResidualSum) {
        let rows = &self.draft.lens.surfaces;
        let gap = |i: usize| DraftParameter::Surface(i, SurfaceParameter::Thickness);
        let margin = self.plan.margin * self.asked.focal_length;
        let track: f64 = rows.iter().map(|row| row.thickness).sum();
        let slopes: Vec<_> = (0..rows.len()).map(|i| (gap(i), 1.0)).collect();
        let long = track - self.asked.track + margin;
        self.limit(("total_track", None), long, (1.0, &slopes), sum);
        let last = rows.len() - 1;
        let short = self.asked.back_focus + margin - rows[last].thickness;
        self.limit(("back_focus", None), short, (-1.0, &[(gap(last), 1.0)]), sum);
    }

    fn add_edge(&self, i: usize, sum: &mut ResidualSum) {
        let rows = &self.draft.lens.surfaces;
        let margin = 0.2 * self.plan.margin * self.asked.focal_length + self.plan.edge_margin;
        let least = if rows[i].medium == Medium::Air { 0.0 } else { self.asked.glass_edge };
        let rim = self.rims[i].min(self.rims[i + 1]);
        let (front, rear) = (sag(&rows[i], rim), sag(&rows[i + 1], rim));
        let short = least + margin - (rows[i].thickness + rear - front);
        let mut slopes = vec![(DraftParameter::Surface(i, SurfaceParameter::Thickness), 1.0)];
        for (row, sign) in [(i, -1.0), (i + 1, 1.0)] {
            let by = sag_slopes(&rows[row], rim);
            let by = by.into_iter();
            slopes.extend(by.map(|(p, slope)| (DraftParameter::Surface(row, p), sign * slope)));
        }
        let term = if rows[i].medium == Medium::Air { "air_edge" } else { "glass_edge" };
        self.limit((term, Some(i)), short, (-1.0, &slopes), sum);
    }

    fn add_steepness(&self, i: usize, sum: &mut ResidualSum) {
        let curvature = self.draft.lens.surfaces[i].curvature;
        let length = STEEPNESS[1] * self.asked.focal_length;
        let over = (curvature * self.rims[i]).abs() - STEEPNESS[0];
        let by = DraftParameter::Surface(i, SurfaceParameter::Curvature);
        let slope = curvature.signum() * self.rims[i] * length;
        self.limit(("steepness", Some(i)), length * over, (1.0, &[(by, slope)]), sum);
    }

    /// Keeps a glass inside the map.
    fn add_glass(&self, i: usize, sum: &mut ResidualSum) {
        if self.asked.glasses.plastics.is_some() {
            return;
        }
        let (nd, vd) = model(&self.draft.lens, i);
        let ([low, high], [low_slope, high_slope]) = glass_range(vd);
        let length = INDEX_LENGTH * self.asked.focal_length;
        let [by_index, by_abbe] =
            [DraftParameter::Surface(i, SurfaceParameter::Index), DraftParameter::Abbe(i)];
        let place = ("glass", Some(i));
        let above = [(by_index, length), (by_abbe, -length * high_slope)];
        self.limit(place, length * (nd - high), (1.0, &above), sum);
        let below = [(by_index, length), (by_abbe, -length * low_slope)];
        self.limit(place, length * (low - nd), (-1.0, &below), sum);
    }
}

/// The range of the index at an Abbe number, and its derivative by that.
fn glass_range(vd: f64) -> ([f64; 2], [f64; 2]) {
    let after = GLASS_MAP.iter().position(|(v, ..)| *v >= vd).unwrap_or(GLASS_MAP.len() - 1).max(1);
    let (a, b) = (GLASS_MAP[after - 1], GLASS_MAP[after]);
    let step = b.0 - a.0;
    let slopes = [(b.1 - a.1) / step, (b.2 - a.2) / step];
    ([a.1 + slopes[0] * (vd - a.0), a.2 + slopes[1] * (vd - a.0)], slopes)
}

fn sag(row: &Row, height: f64) -> f64 {
    row.shape().clamped_sag(height)
}

/// The derivatives of the sag at a height by curvature, conic and coefficients.
fn sag_slopes(row: &Row, height: f64) -> Vec<(SurfaceParameter, f64)> {
    let square = height * height;
    let (c, k) = (row.curvature, row.conic);
    let root = (1.0 - (1.0 + k) * c * c * square).max(1e-4).sqrt();
    let mut slopes = vec![
        (SurfaceParameter::Curvature, square / (root * (1.0 + root))),
        (
            SurfaceParameter::Conic,
            c.powi(3) * square * square / (2.0 * root * (1.0 + root).powi(2)),
        ),
    ];
    let term = |i: usize| (SurfaceParameter::AsphereTerm(i), square.powi(i as i32 + 2));
    slopes.extend((0..super::parameter::USED_TERMS).map(term));
    slopes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_range_of_the_index_is_linear_between_the_points_of_the_map() {
        let ([low, high], [low_slope, high_slope]) = glass_range(62.5);
        assert!((low - 1.5).abs() < 1e-12 && (high - 1.615).abs() < 1e-12, "{low} {high}");
        assert!((low_slope + 0.002).abs() < 1e-12 && (high_slope + 0.012).abs() < 1e-12);
        for (vd, least, most) in GLASS_MAP {
            let ([low, high], _) = glass_range(vd);
            assert!((low - least).abs() < 1e-12 && (high - most).abs() < 1e-12, "{vd}");
        }
    }
}
