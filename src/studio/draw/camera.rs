//! The part of the plane that a drawing shows, with equal axes.

use glam::{DVec2, Vec2};

/// A pixel never shows less than this: 32-bit positions 100 mm from the origin are exact to
/// 8e-6 mm, a sixth of such a pixel.
const MAX_SCALE: f64 = 2e4; // px per mm
/// A thousand pixels never show more than ten kilometres.
const MIN_SCALE: f64 = 1e-4; // px per mm

/// The smallest upright box around some points, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundingBox {
    /// Its lower left corner.
    pub min: DVec2,
    /// Its upper right corner.
    pub max: DVec2,
}

impl BoundingBox {
    /// The bounding box of all finite points; `None` without any.
    pub fn around(points: impl IntoIterator<Item = DVec2>) -> Option<Self> {
        let mut finite = points.into_iter().filter(|point| point.is_finite());
        let first = finite.next()?;
        let start = Self { min: first, max: first };
        Some(finite.fold(start, |b, p| Self { min: b.min.min(p), max: b.max.max(p) }))
    }
}

/// The mapping from millimetres to pixels: `center` is in the middle of the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// The point in the middle of the picture, mm.
    pub center: DVec2,
    /// Pixels per millimetre, on both axes.
    pub scale: f64,
}

impl Camera {
    /// Shows the whole box, `margin` pixels from the rim of a picture of `size` pixels.
    ///
    /// A box without extent is shown a millimetre wide.
    pub fn fit(bounds: BoundingBox, size: DVec2, margin: f64) -> Self {
        let extent = bounds.max - bounds.min;
        let extent = if extent.max_element() > 0.0 { extent } else { DVec2::ONE };
        let available = (size - 2.0 * margin).max(DVec2::ONE);
        let scale = (available / extent.max(DVec2::splat(1e-12))).min_element();
        Self { center: bounds.min.midpoint(bounds.max), scale: scale.clamp(MIN_SCALE, MAX_SCALE) }
    }

    /// The pixel of a point of the plane in an image of `size` pixels, y down.
    pub fn to_px(self, mm: DVec2, size: DVec2) -> DVec2 {
        0.5 * size + self.scale * flip(mm - self.center)
    }

    /// The point of the plane at a pixel.
    pub fn to_mm(self, px: DVec2, size: DVec2) -> DVec2 {
        self.center + flip(px - 0.5 * size) / self.scale
    }

    /// The camera after the picture was dragged by some pixels, y down.
    #[must_use]
    pub fn dragged(self, px: DVec2) -> Self {
        Self { center: self.center - flip(px) / self.scale, ..self }
    }

    /// The camera nearer by `factor`, with the point under `px` staying where it is.
    #[must_use]
    pub fn zoomed(self, factor: f64, px: DVec2, size: DVec2) -> Self {
        let scale = (self.scale * factor).clamp(MIN_SCALE, MAX_SCALE);
        let fixed = self.to_mm(px, size);
        Self { center: fixed + (self.center - fixed) * (self.scale / scale), scale }
    }

    /// Centre and scale as the drawings use them.
    pub(super) fn to_f32(self) -> (Vec2, f32) {
        #[expect(clippy::cast_possible_truncation, reason = "between the two limits above")]
        (self.center.as_vec2(), self.scale as f32)
    }
}

fn flip(v: DVec2) -> DVec2 {
    DVec2::new(v.x, -v.y)
}

/// The longest of 1, 2 and 5 times a power of ten that is not above `limit`: a scale bar.
pub fn round_length_below(limit: f64) -> f64 {
    if !(limit.is_finite() && limit > 0.0) {
        return 1.0;
    }
    let decade = 10_f64.powf(limit.log10().floor());
    let step = [5.0, 2.0].into_iter().find(|step| step * decade <= limit).unwrap_or(1.0);
    step * decade
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: DVec2 = DVec2::new(640.0, 480.0);

    #[test]
    fn pixels_and_millimetres_are_each_others_inverse() {
        let camera = Camera { center: DVec2::new(3.0, -2.0), scale: 17.0 };
        let px = DVec2::new(12.0, 400.0);
        assert!(camera.to_px(camera.to_mm(px, SIZE), SIZE).distance(px) < 1e-9);
    }

    #[test]
    fn zooming_keeps_the_point_under_the_pointer() {
        let camera = Camera { center: DVec2::new(3.0, -2.0), scale: 17.0 };
        let px = DVec2::new(12.0, 400.0);
        for factor in [0.5, 3.0, 1e9] {
            let nearer = camera.zoomed(factor, px, SIZE);
            assert!(nearer.to_mm(px, SIZE).distance(camera.to_mm(px, SIZE)) < 1e-9);
        }
    }

    #[test]
    fn dragging_takes_the_plane_along() {
        let camera = Camera { center: DVec2::ZERO, scale: 10.0 };
        let moved = camera.dragged(DVec2::new(20.0, 30.0));
        let before = camera.to_px(DVec2::ONE, SIZE);
        assert!(moved.to_px(DVec2::ONE, SIZE).distance(before + DVec2::new(20.0, 30.0)) < 1e-9);
    }

    #[test]
    fn fitting_shows_the_whole_box() {
        let bounds = BoundingBox { min: DVec2::new(-5.0, -20.0), max: DVec2::new(100.0, 20.0) };
        let camera = Camera::fit(bounds, SIZE, 10.0);
        assert!(camera.to_px(bounds.min, SIZE).x >= 10.0 - 1e-9);
        assert!(camera.to_px(bounds.max, SIZE).x <= 630.0 + 1e-9);
    }

    #[test]
    fn a_box_without_extent_can_be_fitted() {
        let point = BoundingBox { min: DVec2::ONE, max: DVec2::ONE };
        assert!(Camera::fit(point, SIZE, 10.0).scale.is_finite());
        assert!(Camera::fit(point, DVec2::ZERO, 10.0).scale.is_finite());
    }

    #[test]
    fn scale_bars_are_round() {
        for (limit, length) in [(1.0, 1.0), (1.99, 1.0), (4.9, 2.0), (9.0, 5.0), (0.034, 0.02)] {
            assert!((round_length_below(limit) - length).abs() < 1e-12 * length, "{limit}");
        }
        assert_eq!(round_length_below(f64::NAN), 1.0);
    }
}
