//! Apertures of a surface that are no circles about its vertex.
//!
//! Beside its circular rim and its central obstruction a surface may have apertures of other forms: a frame
//! that lets light through inside, or an obscuration that blocks the light that it covers, such as the arms
//! that hold a secondary mirror. Each lies in the surface's own frame, across its axis, and is decentred and
//! tilted with it. A ray passes the surface if it passes the rim, the obstruction and every aperture; one
//! that meets an edge exactly passes.

use super::LensError;
use super::check::check_number;
use serde::{Deserialize, Serialize};

/// The largest number of apertures of a surface beside its circles.
pub const MAX_APERTURES: usize = 16;
/// The largest number of corners of a polygon.
pub const MAX_CORNERS: usize = 256;
/// The largest number of arms of a spider.
pub const MAX_ARMS: usize = 32;
/// The largest number of corners among [`SurfaceAperture::ends`].
const MOST_ENDS: usize = 16;
/// The number of numbers of an aperture, see [`SurfaceAperture::numbers`].
pub const APERTURE_NUMBERS: usize = 5;

/// An aperture or an obscuration of a surface.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "ApertureKeys", into = "ApertureKeys")]
pub struct SurfaceAperture {
    /// The form about its own centre, before it is turned.
    pub shape: ApertureShape,
    /// The place of its centre beside the vertex along x and y, in mm.
    pub center: [f64; 2],
    /// The angle by which it is turned about its centre, from +x towards +y, in degrees.
    pub angle: f64,
    /// The side on which it blocks light.
    pub blocks: BlockedSide,
}

/// The form of an aperture about its centre; lengths in mm, zero or more.
#[derive(Debug, Clone, PartialEq)]
pub enum ApertureShape {
    /// A circle.
    Circle {
        /// Its radius.
        radius: f64,
    },
    /// An ellipse.
    Ellipse {
        /// Its semi-axis along x.
        half_width: f64,
        /// Its semi-axis along y.
        half_height: f64,
    },
    /// A rectangle.
    Rectangle {
        /// Half of its width along x.
        half_width: f64,
        /// Half of its height along y.
        half_height: f64,
    },
    /// A polygon whose sides do not cross, convex or not.
    Polygon {
        /// Its corners in order, either way round.
        points: Vec<[f64; 2]>,
    },
    /// Straight arms from the centre outwards without end, at equal angles, the first along x.
    Spider {
        /// The number of arms.
        arms: usize,
        /// The width of each.
        width: f64,
    },
}

/// The side of an edge on which light is blocked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BlockedSide {
    /// Light passes inside alone.
    Outside,
    /// Light passes outside alone.
    Inside,
}

/// The names of the forms in files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum ShapeName {
    Circle,
    Ellipse,
    Rectangle,
    Polygon,
    Spider,
}

/// The keys of an aperture in a file.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ApertureKeys {
    shape: ShapeName,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    radius: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    half_width: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    half_height: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    points: Option<Vec<[f64; 2]>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    arms: Option<usize>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    width: Option<f64>,
    #[serde(default, skip_serializing_if = "is_origin")]
    center: [f64; 2],
    #[serde(default, skip_serializing_if = "is_plain_zero")]
    angle: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    blocks: Option<BlockedSide>,
}

/// True for +0, the default.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "the signature that serde calls")]
fn is_plain_zero(value: &f64) -> bool {
    value.to_bits() == 0
}

fn is_origin(center: &[f64; 2]) -> bool {
    center.iter().all(is_plain_zero)
}

impl TryFrom<ApertureKeys> for SurfaceAperture {
    type Error = String;

    fn try_from(keys: ApertureKeys) -> Result<Self, String> {
        let all = [
            ("radius", keys.radius.is_some()),
            ("half_width", keys.half_width.is_some()),
            ("half_height", keys.half_height.is_some()),
            ("points", keys.points.is_some()),
            ("arms", keys.arms.is_some()),
            ("width", keys.width.is_some()),
        ];
        let (name, wanted): (&str, &[&str]) = match keys.shape {
            ShapeName::Circle => ("circle", &["radius"]),
            ShapeName::Ellipse => ("ellipse", &["half_width", "half_height"]),
            ShapeName::Rectangle => ("rectangle", &["half_width", "half_height"]),
            ShapeName::Polygon => ("polygon", &["points"]),
            ShapeName::Spider => ("spider", &["arms", "width"]),
        };
        if let Some((key, given)) = all.iter().find(|(key, given)| wanted.contains(key) != *given) {
            let fault = if *given { "with" } else { "without" };
            return Err(format!(
                "an aperture of the shape `{name}` {fault} `{key}`, expected the keys {}",
                wanted.iter().map(|key| format!("`{key}`")).collect::<Vec<_>>().join(" and ")
            ));
        }
        let length = |length: Option<f64>| length.unwrap_or(0.0);
        let (half_width, half_height) = (length(keys.half_width), length(keys.half_height));
        let shape = match keys.shape {
            ShapeName::Circle => ApertureShape::Circle { radius: length(keys.radius) },
            ShapeName::Ellipse => ApertureShape::Ellipse { half_width, half_height },
            ShapeName::Rectangle => ApertureShape::Rectangle { half_width, half_height },
            ShapeName::Polygon => {
                ApertureShape::Polygon { points: keys.points.unwrap_or_default() }
            }
            ShapeName::Spider => {
                let arms = keys.arms.unwrap_or_default();
                ApertureShape::Spider { arms, width: length(keys.width) }
            }
        };
        let usual = match shape {
            ApertureShape::Spider { .. } => BlockedSide::Inside,
            _ => BlockedSide::Outside,
        };
        let blocks = keys.blocks.unwrap_or(usual);
        Ok(Self { shape, center: keys.center, angle: keys.angle, blocks })
    }
}

impl From<SurfaceAperture> for ApertureKeys {
    fn from(aperture: SurfaceAperture) -> Self {
        let SurfaceAperture { shape, center, angle, blocks } = aperture;
        let mut keys = Self {
            shape: ShapeName::Circle,
            radius: None,
            half_width: None,
            half_height: None,
            points: None,
            arms: None,
            width: None,
            center,
            angle,
            blocks: Some(blocks),
        };
        match shape {
            ApertureShape::Circle { radius } => keys.radius = Some(radius),
            ApertureShape::Ellipse { half_width, half_height } => {
                keys.shape = ShapeName::Ellipse;
                (keys.half_width, keys.half_height) = (Some(half_width), Some(half_height));
            }
            ApertureShape::Rectangle { half_width, half_height } => {
                keys.shape = ShapeName::Rectangle;
                (keys.half_width, keys.half_height) = (Some(half_width), Some(half_height));
            }
            ApertureShape::Polygon { points } => {
                (keys.shape, keys.points) = (ShapeName::Polygon, Some(points));
            }
            ApertureShape::Spider { arms, width } => {
                keys.shape = ShapeName::Spider;
                (keys.arms, keys.width) = (Some(arms), Some(width));
            }
        }
        keys
    }
}

impl SurfaceAperture {
    /// An aperture about the vertex, not turned, that lets light through inside.
    pub fn inside(shape: ApertureShape) -> Self {
        Self { shape, center: [0.0; 2], angle: 0.0, blocks: BlockedSide::Outside }
    }

    /// An obscuration about the vertex, not turned.
    pub fn obscuration(shape: ApertureShape) -> Self {
        Self { blocks: BlockedSide::Inside, ..Self::inside(shape) }
    }

    /// True if it blocks the light that it covers.
    pub fn obscures(&self) -> bool {
        self.blocks == BlockedSide::Inside
    }

    /// Its numbers, by which derivatives are: two sizes, then the centre along x and y in mm and the angle
    /// in degrees. The sizes are the radius, or half width and half height, or the width of the arms; those
    /// that a shape does not have, and those of a polygon, are zero.
    pub fn numbers(&self) -> [f64; APERTURE_NUMBERS] {
        let [x, y] = self.center;
        let [a, b] = match self.shape {
            ApertureShape::Circle { radius } => [radius, 0.0],
            ApertureShape::Ellipse { half_width, half_height }
            | ApertureShape::Rectangle { half_width, half_height } => [half_width, half_height],
            ApertureShape::Polygon { .. } => [0.0; 2],
            ApertureShape::Spider { width, .. } => [width, 0.0],
        };
        [a, b, x, y, self.angle]
    }

    /// One of its numbers, in the order of [`SurfaceAperture::numbers`]; `None` if it has none there.
    pub fn number_mut(&mut self, number: usize) -> Option<&mut f64> {
        match (number, &mut self.shape) {
            (2, _) => self.center.first_mut(),
            (3, _) => self.center.last_mut(),
            (4, _) => Some(&mut self.angle),
            (
                0,
                ApertureShape::Circle { radius: size } | ApertureShape::Spider { width: size, .. },
            ) => Some(size),
            (
                0 | 1,
                ApertureShape::Ellipse { half_width, half_height }
                | ApertureShape::Rectangle { half_width, half_height },
            ) => Some(if number == 0 { half_width } else { half_height }),
            _ => None,
        }
    }

    /// The same aperture with all lengths times a factor.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        let by = |length: f64| length * factor;
        let shape = match &self.shape {
            ApertureShape::Circle { radius } => ApertureShape::Circle { radius: by(*radius) },
            ApertureShape::Ellipse { half_width, half_height } => ApertureShape::Ellipse {
                half_width: by(*half_width),
                half_height: by(*half_height),
            },
            ApertureShape::Rectangle { half_width, half_height } => ApertureShape::Rectangle {
                half_width: by(*half_width),
                half_height: by(*half_height),
            },
            ApertureShape::Polygon { points } => {
                ApertureShape::Polygon { points: points.iter().map(|p| p.map(by)).collect() }
            }
            ApertureShape::Spider { arms, width } => {
                ApertureShape::Spider { arms: *arms, width: by(*width) }
            }
        };
        Self { shape, center: self.center.map(by), ..*self }
    }

    /// A point about its centre, before it is turned, as a point of the surface.
    pub fn place(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = turn(self.angle);
        let [x, y] = self.center;
        [x + u * cos - v * sin, y + u * sin + v * cos]
    }

    /// The point in its middle on the surface: the mean of the corners of a polygon, else its centre.
    pub fn middle(&self) -> [f64; 2] {
        let ApertureShape::Polygon { points } = &self.shape else { return self.center };
        let count = points.len().max(1) as f64;
        self.place([0, 1].map(|k| points.iter().map(|p| p[k]).sum::<f64>() / count))
    }

    /// The corners on the surface, in order; of a circle or an ellipse those of the rectangle around it,
    /// and none of a spider.
    pub fn corners(&self) -> Vec<[f64; 2]> {
        let box_corners = |a: f64, b: f64| vec![[a, b], [-a, b], [-a, -b], [a, -b]];
        let own = match &self.shape {
            ApertureShape::Circle { radius } => box_corners(*radius, *radius),
            ApertureShape::Ellipse { half_width, half_height }
            | ApertureShape::Rectangle { half_width, half_height } => {
                box_corners(*half_width, *half_height)
            }
            ApertureShape::Polygon { points } => points.clone(),
            ApertureShape::Spider { .. } => Vec::new(),
        };
        own.into_iter().map(|p| self.place(p)).collect()
    }

    /// The points of its edge that are farthest from its middle, on the surface: at most sixteen corners, or the
    /// ends of both axes; none of a spider.
    pub fn ends(&self) -> Vec<[f64; 2]> {
        let axes =
            |a: f64, b: f64| [[a, 0.0], [-a, 0.0], [0.0, b], [0.0, -b]].map(|p| self.place(p));
        match &self.shape {
            ApertureShape::Circle { radius } => axes(*radius, *radius).into(),
            ApertureShape::Ellipse { half_width, half_height } => {
                axes(*half_width, *half_height).into()
            }
            _ => {
                let corners = self.corners();
                let step = corners.len().div_ceil(MOST_ENDS).max(1);
                corners.into_iter().step_by(step).collect()
            }
        }
    }

    /// The largest distance from the vertex in mm at which it lets light through; infinite for an
    /// obscuration. Of an ellipse beside the vertex or turned, an upper bound.
    pub fn reach(&self) -> f64 {
        let [x, y] = self.center;
        match (self.blocks, &self.shape) {
            (BlockedSide::Inside, _) | (_, ApertureShape::Spider { .. }) => f64::INFINITY,
            (_, ApertureShape::Circle { radius }) => x.hypot(y) + radius,
            (_, ApertureShape::Ellipse { half_width, half_height }) => {
                x.hypot(y) + half_width.max(*half_height)
            }
            _ => self.corners().iter().map(|[x, y]| x.hypot(*y)).fold(0.0, f64::max),
        }
    }

    /// The fault of its numbers, as the rest of a sentence; `None` for one that can be traced with.
    pub fn fault(&self) -> Option<String> {
        let wrong = |what: &str, found: f64| {
            Some(format!(
                "has the {what} {found}; expected a number of mm, zero or more, below 1e100"
            ))
        };
        let is_length = |length: f64| (0.0..1e100).contains(&length);
        for (what, found) in self.named_sizes() {
            if !is_length(found) {
                return wrong(what, found);
            }
        }
        if let Some(found) = self.center.into_iter().find(|v| !(v.abs() < 1e100)) {
            return Some(format!("has the centre {found}; expected numbers of mm below 1e100"));
        }
        if !(self.angle.abs() <= 360.0) {
            let angle = self.angle;
            return Some(format!("is turned by {angle}; expected at most 360 degrees"));
        }
        match &self.shape {
            ApertureShape::Polygon { points } => polygon_fault(points),
            ApertureShape::Spider { arms, .. } if !(1..=MAX_ARMS).contains(arms) => {
                Some(format!("has {arms} arms; expected 1 to {MAX_ARMS}"))
            }
            ApertureShape::Spider { .. } if !self.obscures() => Some(
                "is a spider that blocks outside; expected `\"blocks\": \"inside\"`".to_owned(),
            ),
            _ => None,
        }
    }

    /// Its sizes with their names.
    fn named_sizes(&self) -> Vec<(&'static str, f64)> {
        match self.shape {
            ApertureShape::Circle { radius } => vec![("radius", radius)],
            ApertureShape::Ellipse { half_width, half_height }
            | ApertureShape::Rectangle { half_width, half_height } => {
                vec![("half width", half_width), ("half height", half_height)]
            }
            ApertureShape::Polygon { .. } => Vec::new(),
            ApertureShape::Spider { width, .. } => vec![("width of arms", width)],
        }
    }
}

/// True if apertures are the same after any turn about the vertex.
pub(super) fn are_round(apertures: &[SurfaceAperture]) -> bool {
    let is_round = |shape: &ApertureShape| match shape {
        ApertureShape::Circle { .. } => true,
        ApertureShape::Ellipse { half_width, half_height } => half_width == half_height,
        _ => false,
    };
    apertures.iter().all(|aperture| aperture.center == [0.0; 2] && is_round(&aperture.shape))
}

/// Sine and cosine of an angle in degrees, exact at multiples of a right angle.
pub(crate) fn turn(degrees: f64) -> (f64, f64) {
    match degrees.rem_euclid(360.0) {
        0.0 => (0.0, 1.0),
        90.0 => (1.0, 0.0),
        180.0 => (0.0, -1.0),
        270.0 => (-1.0, 0.0),
        _ => degrees.to_radians().sin_cos(),
    }
}

/// The fault of the corners of a polygon.
fn polygon_fault(points: &[[f64; 2]]) -> Option<String> {
    if let Some(found) = points.iter().flatten().find(|v| !(v.abs() < 1e100)) {
        return Some(format!("has a corner at {found}; expected numbers of mm below 1e100"));
    }
    let count = points.len();
    if !(3..=MAX_CORNERS).contains(&count) {
        return Some(format!("has {count} corners; expected 3 to {MAX_CORNERS}"));
    }
    let side = |i: usize| (points[i], points[(i + 1) % count]);
    if (0..count).any(|i| side(i).0 == side(i).1) {
        return Some("has two corners at the same place; expected each once".to_owned());
    }
    let crossing = (0..count).find_map(|i| {
        let other = (i + 1..count).find(|j| are_apart(i, *j, count) && meet(side(i), side(*j)))?;
        Some((i + 1, other + 1))
    });
    if let Some((a, b)) = crossing {
        return Some(format!("has sides {a} and {b} that meet; expected sides that do not"));
    }
    let doubled = |(p, q): Segment| p[0] * q[1] - p[1] * q[0];
    let area: f64 = (0..count).map(|i| doubled(side(i))).sum();
    (area == 0.0).then(|| "has no area; expected corners around one".to_owned())
}

/// True if two sides of a polygon have no corner in common.
fn are_apart(i: usize, j: usize, count: usize) -> bool {
    (i + 1) % count != j && (j + 1) % count != i
}

type Segment = ([f64; 2], [f64; 2]);

/// True if two segments have a point in common.
fn meet((a, b): Segment, (c, d): Segment) -> bool {
    let side = |p: [f64; 2], q: [f64; 2], r: [f64; 2]| {
        (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
    };
    let between = |p: [f64; 2], q: [f64; 2], r: [f64; 2]| {
        (0..2).all(|k| p[k].min(q[k]) <= r[k] && r[k] <= p[k].max(q[k]))
    };
    let [ca, cb] = [side(c, d, a), side(c, d, b)];
    let [ac, ad] = [side(a, b, c), side(a, b, d)];
    let touches = |value: f64, (p, q): Segment, r: [f64; 2]| value == 0.0 && between(p, q, r);
    touches(ca, (c, d), a)
        || touches(cb, (c, d), b)
        || touches(ac, (a, b), c)
        || touches(ad, (a, b), d)
        || (ca * cb < 0.0 && ac * ad < 0.0)
}

/// Checks the apertures of the surface with this number.
pub(super) fn check_apertures(
    apertures: &[SurfaceAperture],
    surface: super::SurfaceNumber,
) -> Result<(), LensError> {
    if apertures.len() > MAX_APERTURES {
        let found = apertures.len() as f64;
        let what = format_args!("number of apertures of surface {surface}");
        return check_number(what, found, false, "at most 16");
    }
    let faults = apertures.iter().enumerate().filter_map(|(k, own)| Some((k, own.fault()?)));
    faults.into_iter().next().map_or(Ok(()), |(k, why)| {
        let text = format!("aperture {} of surface {surface} {why}", k + 1);
        Err(LensError::Inconsistent(text))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rectangle(center: [f64; 2], angle: f64) -> SurfaceAperture {
        let shape = ApertureShape::Rectangle { half_width: 2.0, half_height: 1.0 };
        SurfaceAperture { center, angle, ..SurfaceAperture::inside(shape) }
    }

    #[test]
    fn faults_are_named() {
        let polygon = |points: &[[f64; 2]]| {
            SurfaceAperture::inside(ApertureShape::Polygon { points: points.to_vec() }).fault()
        };
        assert_eq!(polygon(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]), None);
        let bow = polygon(&[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]).unwrap();
        assert!(bow.contains("sides 1 and 3"), "{bow}");
        assert!(polygon(&[[0.0, 0.0], [1.0, 1.0]]).unwrap().contains("2 corners"));
        assert!(polygon(&[[0.0, 0.0], [0.0, 0.0], [1.0, 1.0]]).unwrap().contains("same place"));
        let circle = |radius: f64| SurfaceAperture::inside(ApertureShape::Circle { radius });
        assert!(circle(-1.0).fault().unwrap().contains("radius -1"));
        assert!(circle(f64::NAN).fault().unwrap().contains("radius NaN"));
        assert_eq!(circle(0.0).fault(), None);
        let spider = ApertureShape::Spider { arms: 3, width: 1.0 };
        assert!(SurfaceAperture::inside(spider).fault().unwrap().contains("spider"));
    }

    #[test]
    fn the_reach_is_the_distance_of_the_farthest_point() {
        assert_eq!(rectangle([1.0, 3.0], 0.0).reach(), 5.0);
        let beside = SurfaceAperture { center: [3.0, 4.0], ..rectangle([0.0; 2], 0.0) };
        let circle = SurfaceAperture { shape: ApertureShape::Circle { radius: 1.0 }, ..beside };
        assert_eq!(circle.reach(), 6.0);
        assert_eq!(
            SurfaceAperture { blocks: BlockedSide::Inside, ..circle }.reach(),
            f64::INFINITY
        );
    }
}
