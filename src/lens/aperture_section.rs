//! The parts of a section in the y-z plane that the apertures of a surface block.

use super::surface_aperture::{ApertureShape, SurfaceAperture};
use super::{Surface, turn};

/// An interval of heights on a surface at x = 0, in mm, the lower end first.
pub type HeightInterval = [f64; 2];

impl Surface<f64> {
    /// The heights at x = 0, up to `reach` from the vertex, at which the obstruction or an aperture blocks
    /// light, in ascending order and without overlaps. The rim of the surface is left out.
    pub fn blocked_heights(&self, reach: f64) -> Vec<HeightInterval> {
        let hole = [-self.obstruction, self.obstruction];
        let mut blocked = if self.obstruction > 0.0 { vec![hole] } else { Vec::new() };
        for aperture in &self.apertures {
            let covered = covered_heights(aperture, reach);
            blocked.extend(if aperture.obscures() { covered } else { gaps_between(&covered) });
        }
        union_within(blocked, reach)
    }
}

/// The heights at x = 0 that an aperture covers.
fn covered_heights(aperture: &SurfaceAperture, reach: f64) -> Vec<HeightInterval> {
    let crossed = |corners: Vec<[f64; 2]>| polygon_heights(&corners);
    match &aperture.shape {
        ApertureShape::Circle { radius } => oval_heights(aperture, [*radius; 2]),
        ApertureShape::Ellipse { half_width, half_height } => {
            oval_heights(aperture, [*half_width, *half_height])
        }
        ApertureShape::Spider { arms, width } => {
            let [x, y] = aperture.center;
            let length = 2.0 * (reach + x.hypot(y));
            let arm =
                |k: usize| arm_corners(aperture, 360.0 * k as f64 / *arms as f64, [length, *width]);
            let arms: Vec<_> = (0..*arms).flat_map(|k| crossed(arm(k))).collect();
            union_within(arms, reach)
        }
        _ => crossed(aperture.corners()),
    }
}

/// The corners of the arm of a spider that is turned by this angle from the first one.
fn arm_corners(aperture: &SurfaceAperture, angle: f64, [length, width]: [f64; 2]) -> Vec<[f64; 2]> {
    let arm = SurfaceAperture { angle: aperture.angle + angle, ..aperture.clone() };
    let half = 0.5 * width;
    [[0.0, half], [length, half], [length, -half], [0.0, -half]].map(|p| arm.place(p)).to_vec()
}

/// The heights at which the line x = 0 lies inside of a polygon. A polygon with a side on that line is met on
/// the side on which it lies, since a ray that meets an edge exactly passes a frame.
fn polygon_heights(corners: &[[f64; 2]]) -> Vec<HeightInterval> {
    let least = corners.iter().map(|corner| corner[0]).fold(f64::INFINITY, f64::min);
    let is_left = |x: f64| if least < 0.0 { x < 0.0 } else { x <= 0.0 };
    let side = |i: usize| (corners[i], corners[(i + 1) % corners.len()]);
    let crossing = |(a, b): ([f64; 2], [f64; 2])| {
        let crosses = is_left(a[0]) != is_left(b[0]);
        crosses.then(|| a[1] + (b[1] - a[1]) * a[0] / (a[0] - b[0]))
    };
    let mut heights: Vec<f64> = (0..corners.len()).map(side).filter_map(crossing).collect();
    heights.sort_by(f64::total_cmp);
    heights.chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect()
}

/// The heights at which the line x = 0 lies inside of an oval with these semi-axes.
fn oval_heights(aperture: &SurfaceAperture, semi_axes: [f64; 2]) -> Vec<HeightInterval> {
    // In units of its semi-axes the oval is a circle, and the line is `start + y·along`.
    let (sin, cos) = turn(aperture.angle);
    let own =
        |[x, y]: [f64; 2]| [(x * cos + y * sin) / semi_axes[0], (y * cos - x * sin) / semi_axes[1]];
    let [start, along] = [own(aperture.center.map(|v| -v)), own([0.0, 1.0])];
    let dot = |a: [f64; 2], b: [f64; 2]| a[0] * b[0] + a[1] * b[1];
    let middle = -dot(start, along) / dot(along, along);
    let nearest = [0, 1].map(|k| start[k] + middle * along[k]);
    let half = ((1.0 - dot(nearest, nearest)) / dot(along, along)).sqrt();
    if half > 0.0 { vec![[middle - half, middle + half]] } else { Vec::new() }
}

/// The gaps between disjoint intervals in ascending order, without end.
fn gaps_between(intervals: &[HeightInterval]) -> Vec<HeightInterval> {
    let starts = std::iter::once(f64::NEG_INFINITY).chain(intervals.iter().map(|own| own[1]));
    let ends = intervals.iter().map(|own| own[0]).chain(std::iter::once(f64::INFINITY));
    starts.zip(ends).map(|(start, end)| [start, end]).collect()
}

/// The union of intervals between two heights.
fn union_within(mut intervals: Vec<HeightInterval>, reach: f64) -> Vec<HeightInterval> {
    intervals.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut union: Vec<HeightInterval> = Vec::new();
    for [low, high] in intervals {
        let [low, high] = [low.max(-reach), high.min(reach)];
        match union.last_mut() {
            _ if !(low < high) => {}
            Some(last) if low <= last[1] => last[1] = last[1].max(high),
            _ => union.push([low, high]),
        }
    }
    union
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blocked(apertures: Vec<SurfaceAperture>, obstruction: f64) -> Vec<HeightInterval> {
        Surface { obstruction, apertures, ..Surface::plane(0.0, 1.0) }.blocked_heights(10.0)
    }

    #[test]
    fn a_frame_blocks_outside_and_an_obscuration_inside() {
        let rectangle = ApertureShape::Rectangle { half_width: 4.0, half_height: 3.0 };
        let frame = SurfaceAperture::inside(rectangle.clone());
        assert_eq!(blocked(vec![frame], 0.0), [[-10.0, -3.0], [3.0, 10.0]]);
        let mut turned = SurfaceAperture::obscuration(rectangle);
        (turned.angle, turned.center) = (90.0, [1.0, 2.0]);
        assert_eq!(blocked(vec![turned], 1.0), [[-2.0, 6.0]]);
        assert_eq!(blocked(Vec::new(), 0.0), [[0.0; 2]; 0]);
    }

    #[test]
    fn a_frame_with_a_side_on_the_section_lets_light_through_on_either_side() {
        for x in [-3.0, 3.0] {
            let rectangle = ApertureShape::Rectangle { half_width: 3.0, half_height: 2.0 };
            let mut frame = SurfaceAperture::inside(rectangle);
            frame.center = [x, 0.0];
            assert_eq!(blocked(vec![frame], 0.0), [[-10.0, -2.0], [2.0, 10.0]], "{x}");
        }
    }

    #[test]
    fn an_oval_is_met_at_its_chord() {
        let oval = ApertureShape::Ellipse { half_width: 5.0, half_height: 2.0 };
        let mut aperture = SurfaceAperture::obscuration(oval);
        aperture.center = [3.0, 0.0];
        let [[low, high]] = blocked(vec![aperture.clone()], 0.0)[..] else {
            panic!("one interval")
        };
        assert!((high - 1.6).abs() < 1e-15 && (low + 1.6).abs() < 1e-15);
        aperture.center = [6.0, 0.0];
        assert!(blocked(vec![aperture], 0.0).is_empty());
    }

    /// The arm along +y hides all above the vertex, the two others lie beside the line x = 0.
    #[test]
    fn the_arm_of_a_spider_reaches_to_the_rim() {
        let spider = SurfaceAperture::obscuration(ApertureShape::Spider { arms: 3, width: 1.0 });
        let upright = SurfaceAperture { angle: 90.0, ..spider };
        let [[low, high]] = blocked(vec![upright], 0.0)[..] else { panic!("one interval") };
        assert!((-1.0..=0.0).contains(&low) && high == 10.0, "{low} {high}");
    }
}
