//! The directions from which light arrives at the points of an image, tabulated over their distance
//! from the axis.
//!
//! Every point of the image has a set of directions of its own, found by following the edge of the
//! pupil as seen from it. Samples are drawn from a polygon around that set, so that only a few are
//! lost at rims: the polygon of a ring of the image holds the outlines at its two edges and in its
//! middle, all about one moving centre, and is a little wider. Outlines between these are compared with
//! the polygons, which are widened if light would be left out.

use super::PictureError;
use crate::analysis::{AnalysisError, ImageFold, lit_outline};
use crate::pupil::RayModel;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// The number of corners of a polygon.
const CORNERS: usize = 64;
/// The number of equal shares of the area of a polygon whose first corner is known.
const SHARES: usize = 512;
/// The number of rays on an outline.
const OUTLINE: usize = 128;
/// The parts into which a side of an outline is divided, so that it reaches every corner.
const PARTS: usize = 4;
/// The width of a polygon over that of the outlines in it.
const WIDER: f64 = 1.01;
/// The same of the boxes, which are known at fewer places.
const BOX_WIDER: f64 = 1.03;

/// The area of a polygon over that of the smallest outline in it up to which one ring serves: the widening takes
/// the half of it.
const ALIKE: f64 = 1.05;

/// The polygons from which directions are drawn, one for every ring of the image.
#[derive(Debug, Clone)]
pub struct LitDirections {
    /// The width of a ring, in mm.
    step: f64,
    rings: Vec<Option<RingPolygon>>,
    /// The box around the light at every edge of a ring: its middle and half of its sides.
    boxes: Vec<Option<[[f64; 2]; 2]>>,
    /// The largest distance of an outline between the tabulated ones from the centre of its polygon, over
    /// that of the side of the polygon there; if it is above 1, all polygons are widened by twice as much.
    pub overshoot: f64,
}

/// A polygon of directions for a ring of the image.
#[derive(Debug, Clone)]
struct RingPolygon {
    /// The centre at the inner and at the outer edge of the ring.
    centers: [[f64; 2]; 2],
    /// The corners, as seen from the centre.
    corners: [[f64; 2]; CORNERS],
    /// The areas of the triangles between the centre and the sides, summed up.
    areas: [f64; CORNERS],
    /// For equal shares of the area, the first triangle that reaches into each.
    guide: [u8; SHARES],
}

/// A direction drawn from a polygon.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DrawnDirection {
    /// The direction cosines along x and y, for a point of the image on the y axis.
    pub cosines: [f64; 2],
    /// The area of the polygon in direction cosines.
    pub area: f64,
}

impl LitDirections {
    /// The directions at the points of an image up to `reach` mm from the axis at some wavelengths of a
    /// model, in at most so many rings of equal width: in one where the light of all points is nearly alike.
    ///
    /// # Errors
    /// The edge of the light is not known somewhere, there is none anywhere, or that of two fields somewhere.
    pub fn new(
        model: &RayModel,
        wavelengths: &[usize],
        reach: f64,
        rings: usize,
    ) -> Result<Self, PictureError> {
        let folds = wavelengths.iter().filter_map(|wavelength| ImageFold::find(model, *wavelength));
        let radius = folds.map(|fold| fold.radii[0]).fold(f64::INFINITY, f64::min);
        if radius < reach {
            return Err(PictureError::Directions { radius, source: AnalysisError::FoldedImage });
        }
        let at = |part: f64| outlines(model, wavelengths, part * reach);
        let ends = [0.0, 0.5, 1.0].into_par_iter().map(at).collect::<Result<Vec<_>, _>>()?;
        let rings = if is_alike(&ends) { 1 } else { rings };
        Self::between_outlines((model, wavelengths), reach, rings, &ends)
    }

    /// The number of rings.
    pub fn rings(&self) -> usize {
        self.rings.len()
    }

    /// The directions in so many rings.
    ///
    /// # Errors
    /// As [`LitDirections::new`].
    pub fn of_rings(
        model: &RayModel,
        wavelengths: &[usize],
        reach: f64,
        rings: usize,
    ) -> Result<Self, PictureError> {
        Self::between_outlines((model, wavelengths), reach, rings, &[])
    }

    /// The directions in rings, whose outlines on the axis, half way and at the end may be known.
    fn between_outlines(
        (model, wavelengths): (&RayModel, &[usize]),
        reach: f64,
        rings: usize,
        known: &[Vec<Outline>],
    ) -> Result<Self, PictureError> {
        let step = reach / rings as f64;
        let at = |part: f64| outlines(model, wavelengths, part * step);
        let found = |i: usize| match known.get(i / rings) {
            Some(known) if i.is_multiple_of(rings) => Ok(known.clone()),
            _ => at(0.5 * i as f64),
        };
        let found: Result<Vec<_>, _> = (0..=2 * rings).into_par_iter().map(found).collect();
        let found = found?;
        let ring =
            |i: usize| RingPolygon::new([&found[2 * i], &found[2 * i + 1], &found[2 * i + 2]]);
        let boxes = found.iter().step_by(2).map(|outlines| bounding_box(outlines)).collect();
        let mut table = Self { step, rings: (0..rings).map(ring).collect(), boxes, overshoot: 0.0 };
        if table.rings.iter().all(Option::is_none) {
            return Err(PictureError::NoLight);
        }
        let between =
            [0.13, 0.37, 0.61, 0.89].map(|part| (part * rings as f64).floor() + 0.25 + 0.5 * part);
        let checked: Result<Vec<_>, PictureError> =
            between.into_par_iter().map(|part| Ok((part, at(part)?))).collect();
        table.widen_to(&checked?);
        Ok(table)
    }

    /// Widens all polygons if an outline between the tabulated ones lies outside its own.
    fn widen_to(&mut self, checked: &[(f64, Vec<Outline>)]) {
        let farthest = checked.iter().flat_map(|(part, outlines)| {
            let ring = self.rings.get(*part as usize).and_then(Option::as_ref);
            let points = outlines.iter().flatten();
            points.filter_map(move |point| Some(ring?.relative_distance(*point, part.fract())))
        });
        self.overshoot = farthest.fold(0.0, f64::max);
        if self.overshoot > 1.0 {
            let factor = 1.0 + 2.0 * (self.overshoot - 1.0);
            self.rings.iter_mut().flatten().for_each(|ring| ring.widen(factor));
        }
    }

    /// A box around the directions at a distance from the axis, its middle and half of its sides along x
    /// and y for a point of the image on the y axis; it changes continuously. `None` where it is dark.
    pub fn bounds(&self, radius: f64) -> Option<[[f64; 2]; 2]> {
        let place = (radius / self.step).min((self.boxes.len() - 1) as f64);
        let index = (place as usize).min(self.boxes.len() - 2);
        let [inner, outer] = [self.boxes[index], self.boxes[index + 1]];
        let (from, to) = (inner.or(outer)?, outer.or(inner)?);
        let part = place - index as f64;
        let half = between([from[1], to[1]], part).map(|v| BOX_WIDER * v);
        Some([between([from[0], to[0]], part), half])
    }

    /// The direction at a distance from the axis for two numbers between 0 and 1, evenly distributed over
    /// the polygon there; `None` where it is dark.
    #[inline]
    pub fn draw(&self, radius: f64, unit: [f64; 2]) -> Option<DrawnDirection> {
        let place = radius / self.step;
        let index = (place as usize).min(self.rings.len() - 1);
        let ring = self.rings.get(index)?.as_ref()?;
        Some(ring.draw(place - index as f64, unit))
    }
}

/// The outline of the light of one wavelength; empty where it is dark.
type Outline = Vec<[f64; 2]>;

fn outlines(
    model: &RayModel,
    wavelengths: &[usize],
    radius: f64,
) -> Result<Vec<Outline>, PictureError> {
    let outline = |wavelength: &usize| match lit_outline(model, *wavelength, radius, OUTLINE) {
        Ok(outline) => Ok(outline),
        Err(AnalysisError::NoLight | AnalysisError::NoRays(_)) => Ok(Vec::new()),
        Err(source) => Err(PictureError::Directions { radius, source }),
    };
    wavelengths.iter().map(outline).collect()
}

/// True if one polygon holds the outlines on the axis, half way and at the end of an image with little to spare.
fn is_alike(ends: &[Vec<Outline>]) -> bool {
    let [axis, middle, end] = ends else { return false };
    let Some(ring) = RingPolygon::new([axis, middle, end]) else { return false };
    let areas = ends.iter().flatten().map(|outline| area(outline));
    ring.areas[CORNERS - 1] < ALIKE * areas.fold(f64::INFINITY, f64::min)
}

/// The area that an outline encloses.
fn area(outline: &[[f64; 2]]) -> f64 {
    let next = outline.iter().skip(1).chain(outline.first());
    0.5 * outline.iter().zip(next).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum::<f64>().abs()
}

/// The smallest rectangle around outlines: its middle and half of its sides; `None` if all are dark.
fn bounding_box(outlines: &[Outline]) -> Option<[[f64; 2]; 2]> {
    let points = || outlines.iter().flatten();
    points().next()?;
    let side = |k: usize| {
        let low = points().map(|p| p[k]).fold(f64::INFINITY, f64::min);
        let high = points().map(|p| p[k]).fold(f64::NEG_INFINITY, f64::max);
        [0.5 * (low + high), 0.5 * (high - low)]
    };
    let ([x, width], [y, height]) = (side(0), side(1));
    Some([[x, y], [width, height]])
}

fn between([from, to]: [[f64; 2]; 2], part: f64) -> [f64; 2] {
    [0, 1].map(|k| from[k] + part * (to[k] - from[k]))
}

impl RingPolygon {
    /// The polygon around the outlines at the inner edge, in the middle and at the outer edge of a ring.
    fn new(outlines: [&Vec<Outline>; 3]) -> Option<Self> {
        let middle = |outlines: &Vec<Outline>| Some(bounding_box(outlines)?[0]);
        let [inner, center, outer] = outlines.map(middle);
        let any = inner.or(outer).or(center)?;
        let centers = [inner.or(outer).unwrap_or(any), outer.or(inner).unwrap_or(any)];
        let mut radii = [0.0; CORNERS];
        for (outlines, part) in outlines.into_iter().zip([0.0, 0.5, 1.0]) {
            let center = between(centers, part);
            outlines.iter().for_each(|outline| enclose(&mut radii, outline, center));
        }
        let widest = radii.iter().fold(0.0, |a: f64, b| a.max(*b));
        let corner = |i: usize| {
            let (sin, cos) = (TAU * i as f64 / CORNERS as f64).sin_cos();
            let radius = if radii[i] > 0.0 { radii[i] } else { widest };
            [sin, cos].map(|v| v * radius * WIDER / (PI / CORNERS as f64).cos())
        };
        let corners = std::array::from_fn(corner);
        let areas = areas(&corners);
        Some(Self { centers, guide: guide(&areas), areas, corners })
    }

    fn widen(&mut self, factor: f64) {
        self.corners.iter_mut().for_each(|corner| *corner = corner.map(|v| v * factor));
        self.areas = areas(&self.corners);
        self.guide = guide(&self.areas);
    }

    /// The distance of a direction from the centre over that of the side of the polygon there.
    fn relative_distance(&self, point: [f64; 2], part: f64) -> f64 {
        let center = between(self.centers, part);
        let [x, y] = [point[0] - center[0], point[1] - center[1]];
        let i = corner_before([x, y]);
        let [a, b] = [self.corners[i], self.corners[(i + 1) % CORNERS]];
        // The share u a + v b of the direction has u + v = 1 on the side.
        let determinant = a[0] * b[1] - a[1] * b[0];
        ((x * b[1] - y * b[0]) + (a[0] * y - a[1] * x)) / determinant
    }

    #[inline(always)]
    fn draw(&self, part: f64, [u, v]: [f64; 2]) -> DrawnDirection {
        let area = self.areas[CORNERS - 1];
        let wanted = u * area;
        let share = ((u * SHARES as f64) as usize).min(SHARES - 1);
        let mut side = usize::from(self.guide[share]) & (CORNERS - 1);
        // At most one side ends in nearly every share, without a branch that is hard to foresee.
        side = (side + usize::from(self.areas[side] <= wanted)).min(CORNERS - 1);
        while side < CORNERS - 1 && self.areas[side] <= wanted {
            side += 1;
        }
        let before = if side == 0 { 0.0 } else { self.areas[side - 1] };
        let along = ((wanted - before) / (self.areas[side] - before)).clamp(0.0, 1.0);
        let on_side = between([self.corners[side], self.corners[(side + 1) % CORNERS]], along);
        let center = between(self.centers, part);
        let cosines = [0, 1].map(|k| center[k] + v.sqrt() * on_side[k]);
        DrawnDirection { cosines, area }
    }
}

/// The index of the corner before a direction from the centre, counted from +y towards +x.
fn corner_before([x, y]: [f64; 2]) -> usize {
    let turn = x.atan2(y).rem_euclid(TAU) / TAU;
    ((turn * CORNERS as f64) as usize).min(CORNERS - 1)
}

/// Raises the distances of corners from a centre so that an outline is inside.
fn enclose(radii: &mut [f64; CORNERS], outline: &[[f64; 2]], center: [f64; 2]) {
    let next = outline.iter().skip(1).chain(outline.first());
    for (from, to) in outline.iter().zip(next) {
        for part in 0..PARTS {
            let point = between([*from, *to], part as f64 / PARTS as f64);
            let from_center = [point[0] - center[0], point[1] - center[1]];
            let radius = from_center[0].hypot(from_center[1]);
            let corner = corner_before(from_center);
            for i in [corner, (corner + 1) % CORNERS] {
                radii[i] = radii[i].max(radius);
            }
        }
    }
}

/// For equal shares of the area, the first triangle that reaches into each.
fn guide(areas: &[f64; CORNERS]) -> [u8; SHARES] {
    let area = areas[CORNERS - 1];
    std::array::from_fn(|i| {
        let wanted = i as f64 / SHARES as f64 * area;
        areas.partition_point(|sum| *sum <= wanted).min(CORNERS - 1) as u8
    })
}

/// The areas of the triangles between the centre and the sides, summed up.
fn areas(corners: &[[f64; 2]; CORNERS]) -> [f64; CORNERS] {
    let mut sum = 0.0;
    std::array::from_fn(|i| {
        let (a, b) = (corners[i], corners[(i + 1) % CORNERS]);
        sum += 0.5 * (a[0] * b[1] - a[1] * b[0]).abs();
        sum
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An outline of a circle.
    fn circle([x, y]: [f64; 2], radius: f64) -> Vec<Outline> {
        let point = |i: usize| {
            let (sin, cos) = (TAU * i as f64 / 128.0).sin_cos();
            [x + radius * sin, y + radius * cos]
        };
        vec![(0..128).map(point).collect()]
    }

    #[test]
    fn draws_fill_a_moving_circle_evenly() {
        let [a, b, c] = [0.0, 0.05, 0.1].map(|y| circle([0.0, y], 0.1));
        let ring = RingPolygon::new([&a, &b, &c]).unwrap();
        let area = PI * 0.01;
        let drawn = ring.draw(0.5, [0.3, 0.7]);
        assert!(drawn.area > area && drawn.area < 1.05 * area, "{}", drawn.area / area);
        let (mut inside, mut sum) = (0, [0.0; 2]);
        for i in 0..4096_u32 {
            let unit = [0, 1].map(|d| f64::from(sobol_burley::sample(i, d, 7)));
            let [x, y] = ring.draw(0.5, unit).cosines;
            inside += usize::from(x.hypot(y - 0.05) < 0.1);
            sum = [sum[0] + x, sum[1] + y - 0.05];
        }
        let share = inside as f64 / 4096.0 * drawn.area / area;
        assert!((share - 1.0).abs() < 2e-3, "{share}");
        assert!(sum.iter().all(|v| v.abs() < 4096.0 * 2e-4), "{sum:?}");
    }

    #[test]
    fn a_dark_ring_has_no_polygon_and_light_outside_is_noticed() {
        assert!(RingPolygon::new([&vec![], &vec![], &vec![]]).is_none());
        let ring = circle([0.0, 0.0], 0.1);
        let ring = RingPolygon::new([&ring, &ring, &ring]);
        let boxes = vec![None, None];
        let mut table = LitDirections { step: 1.0, rings: vec![ring], boxes, overshoot: 0.0 };
        assert_eq!(table.bounds(0.5), None);
        table.widen_to(&[(0.25, circle([0.0, 0.0], 0.12))]);
        assert!((table.overshoot - 1.188).abs() < 0.01, "{}", table.overshoot);
        let drawn = table.draw(0.5, [0.5, 0.5]).unwrap();
        assert!(drawn.area > PI * 0.12_f64.powi(2), "{drawn:?}");
    }
}
